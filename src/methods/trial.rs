//! What a method makes of the stress suite.

/// Settings that a method is tried with in a case of the stress suite. A case that none of a method's trials names is
/// tried with its defaults, and is to hold.
#[derive(Clone, Copy, Debug)]
pub struct Trial {
    /// Name of the case.
    pub case: &'static str,
    /// As for [`super::config::RenderConfig::apply_override`]; none are the defaults. A first `preset=NAME` begins with a preset.
    pub settings: &'static [&'static str],
    /// Why it misses the bound, if it is known to.
    pub known: Option<&'static str>,
}

/// A trial that meets the bound.
pub(super) const fn holds(case: &'static str, settings: &'static [&'static str]) -> Trial {
    Trial { case, settings, known: None }
}

/// A trial that is known to miss the bound.
pub(super) const fn fails(case: &'static str, settings: &'static [&'static str], why: &'static str) -> Trial {
    Trial { case, settings, known: Some(why) }
}
