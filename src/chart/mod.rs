//! Speed against accuracy: a sweep over methods and settings, what it leaves on the front, and a page that shows it.

pub mod answer;
pub mod choose;
pub mod data;
pub mod front;
pub mod grid;
mod journal;
mod mean;
pub mod picture;
pub mod reference;
pub mod report;
pub mod svg;
pub mod sweep;
mod table;

pub use grid::Setting;
pub use reference::{Reference, ReferenceRequest};
pub use sweep::{Sweep, run};
