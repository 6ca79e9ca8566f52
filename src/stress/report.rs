//! Verdicts as a page to look at.

use super::data::Stress;

/// `stress` as one HTML file that needs neither network nor server.
#[must_use]
pub fn html(stress: &Stress) -> String {
    crate::page::fill(include_str!("report.html"), stress)
}
