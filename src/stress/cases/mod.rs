//! The cases, by what they try.

mod filters;
mod geometry;
mod light;
mod measure;
mod time;
mod visibility;

use super::Case;

/// All of them, in the order of the page.
pub(super) const ALL: [&[Case]; 5] =
    [light::CASES, visibility::CASES, filters::CASES, time::CASES, geometry::CASES];
