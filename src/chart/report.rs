//! A chart as a page to look at.

use super::data::Chart;

/// `chart` as one HTML file that needs neither network nor server.
///
/// Numbers that are not finite become `null` in its data and are shown as missing.
#[must_use]
pub fn html(chart: &Chart) -> String {
    crate::page::fill(include_str!("report.html"), chart)
}
