//! Ranges of settings.

use std::fmt::Display;
use std::ops::RangeInclusive;

/// A value outside its range.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {problem}")]
pub struct BadValue {
    /// The key it was given to, with its group.
    pub key: &'static str,
    /// What is wrong with it.
    pub problem: String,
}

impl BadValue {
    /// What is wrong with the value of `key`.
    pub fn new(key: &'static str, problem: impl Into<String>) -> Self {
        Self { key, problem: problem.into() }
    }
}

/// A group of settings.
pub trait Settings {
    /// Checks every range its fields' documentation states.
    ///
    /// # Errors
    /// The first value outside its range.
    fn check(&self) -> Result<(), BadValue>;
}

/// Checks that a value lies in a range.
///
/// # Errors
/// It does not, or is no number.
pub fn within<T: PartialOrd + Display>(
    key: &'static str,
    value: T,
    range: RangeInclusive<T>,
) -> Result<(), BadValue> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(BadValue::new(key, format!("{value} is not within {} … {}", range.start(), range.end())))
}
