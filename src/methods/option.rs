//! Words of the command line that set one key.

/// A word of the command line that sets one key.
#[derive(Clone, Copy, Debug)]
pub struct CliOption {
    /// The word, with its dashes.
    pub word: &'static str,
    /// The key it sets.
    pub key: &'static str,
    /// The group that help shows it in.
    pub group: OptionGroup,
    /// Whether only the whole help shows it.
    pub rare: bool,
    /// One line for help texts.
    pub help: &'static str,
    /// What the whole help says beside, if anything.
    pub more: &'static str,
    /// What follows the word.
    pub value: OptionValue,
}

impl CliOption {
    /// The word without its dashes.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.word.trim_start_matches('-')
    }
}

/// A group of options in help texts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum OptionGroup {
    /// How light is computed.
    Light,
    /// What the picture is like.
    Picture,
    /// What trades error for time.
    Speed,
}

/// What follows the word of an option.
#[derive(Clone, Copy, Debug)]
pub enum OptionValue {
    /// A whole number from 0 on; how help calls it.
    Whole(&'static str),
    /// A finite number; how help calls it.
    Number(&'static str),
    /// A finite number from 0 on; how help calls it.
    Distance(&'static str),
    /// One of some words; how help calls it.
    Word(&'static str, &'static [&'static str]),
    /// Nothing: the key is set to true.
    Flag,
}

/// Of every method that counts bounces.
pub(super) const BOUNCES: CliOption = CliOption {
    word: "--bounces",
    key: "vpl_shoot.bounces",
    group: OptionGroup::Light,
    rare: false,
    help: "Most indirect bounces: fewer lose light [default: auto, chance ends paths]",
    more: "",
    value: OptionValue::Whole("N"),
};
