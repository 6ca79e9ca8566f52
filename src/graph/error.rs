//! What can be wrong with a graph, its plan or its run.

use crate::ErrorClass;
use std::fmt;

/// Something declared wrongly, found while recording or planning; no device was touched.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// Path of the pass, where one is concerned.
    pub pass: Option<String>,
    /// Name of the pass's kernel.
    pub shader: Option<String>,
    /// The variable of the shader, or the operand of a transfer pass.
    pub variable: Option<String>,
    /// What is wrong.
    pub what: String,
}

impl Mistake {
    pub(super) fn new(what: impl Into<String>) -> Self {
        Self { pass: None, shader: None, variable: None, what: what.into() }
    }

    pub(super) fn in_pass(mut self, pass: &str) -> Self {
        self.pass = Some(pass.to_owned());
        self
    }

    pub(super) fn in_shader(mut self, shader: &str) -> Self {
        self.shader = Some(shader.to_owned());
        self
    }

    pub(super) fn at(mut self, variable: &str) -> Self {
        self.variable = Some(variable.to_owned());
        self
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for (word, name) in [("pass", &self.pass), ("shader", &self.shader), ("variable", &self.variable)] {
            if let Some(name) = name {
                write!(f, "{separator}{word} `{name}`")?;
                separator = ", ";
            }
        }
        if !separator.is_empty() {
            f.write_str(": ")?;
        }
        f.write_str(&self.what)
    }
}

impl std::error::Error for Mistake {}

impl Mistake {
    /// What kind of failure this is: bad input.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        ErrorClass::Input
    }
}

/// What a plan does wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Violation {
    /// Two passes touch the same memory, one of them writes, and nothing orders them or makes the write seen.
    #[error(
        "pass `{second}` touches `{later}` without waiting for pass `{first}`, which touches `{earlier}`"
    )]
    Unordered {
        /// Path of the earlier pass.
        first: String,
        /// Path of the later pass.
        second: String,
        /// The earlier pass's resource.
        earlier: String,
        /// The later pass's resource: the same, or one in the same memory.
        later: String,
    },
    /// Two transients in use at the same time share memory.
    #[error("`{first}` and `{second}` are in use at the same time and share memory")]
    Clobbered {
        /// One resource.
        first: String,
        /// The other.
        second: String,
    },
    /// A transient has no memory, or lies outside its heap.
    #[error("`{resource}` has no memory")]
    Unplaced {
        /// The resource.
        resource: String,
    },
    /// A transient is read before it is written.
    #[error("pass `{pass}` reads `{resource}`, which nothing has written")]
    Unwritten {
        /// Path of the pass.
        pass: String,
        /// The resource.
        resource: String,
    },
    /// An image's layout is not set at its first use, or is set elsewhere.
    #[error("image `{resource}` is {} in pass `{pass}`", if *.missing { "not initialised" } else { "initialised wrongly" })]
    Layout {
        /// Path of the pass.
        pass: String,
        /// The image.
        resource: String,
        /// Whether it should have been set here.
        missing: bool,
    },
}

/// An error of planning or running a graph.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The graph is declared wrongly.
    #[error(transparent)]
    Declaration(#[from] Mistake),
    /// The run was stopped by [`RunOptions::cancel`](super::RunOptions::cancel).
    #[error("interrupted")]
    Cancelled,
    /// The planner made a plan that the oracle refuses: a bug of the library. Sought in debug builds only.
    #[error("the plan is wrong: {0}")]
    Plan(#[from] Violation),
    /// The device or its driver.
    #[error(transparent)]
    Vulkan(#[from] crate::vk::Error),
}

impl Error {
    /// What kind of failure this is.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        match self {
            Self::Declaration(mistake) => mistake.class(),
            Self::Cancelled => ErrorClass::Interrupted,
            Self::Plan(_) => ErrorClass::Other,
            Self::Vulkan(error) => error.class(),
        }
    }
}

/// ` (did you mean `x`?)` when a candidate is close, else nothing.
pub(super) fn suggestion<'n>(asked: &str, names: impl IntoIterator<Item = &'n str>) -> String {
    names
        .into_iter()
        .map(|name| (distance(asked, name), name))
        .min()
        .filter(|&(d, name)| d <= (asked.len().max(name.len()) / 2).max(1))
        .map(|(_, name)| format!(" (did you mean `{name}`?)"))
        .unwrap_or_default()
}

/// Levenshtein's.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, &y) in b.iter().enumerate() {
            let substitute = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = substitute.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

/// `a`, `b` and so on, for messages.
pub(super) fn quoted<'n>(names: impl IntoIterator<Item = &'n str>) -> String {
    let list: Vec<String> = names.into_iter().map(|name| format!("`{name}`")).collect();
    if list.is_empty() { "none".into() } else { list.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suggestions_are_near_or_absent() {
        assert_eq!(
            suggestion("out_irradance", ["normal", "out_irradiance"]),
            " (did you mean `out_irradiance`?)"
        );
        assert_eq!(suggestion("xyz", ["normal", "depth"]), "");
        assert_eq!(suggestion("a", []), "");
    }

    #[test]
    fn distance_is_levenshteins() {
        for (a, b, d) in [("kitten", "sitting", 3), ("", "abc", 3), ("abc", "", 3), ("same", "same", 0)] {
            assert_eq!(distance(a, b), d);
        }
    }
}
