//! Speed against accuracy: a sweep over methods and settings, what it leaves on the front, and a page that shows it.

pub mod data;
