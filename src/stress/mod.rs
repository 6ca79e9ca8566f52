//! Scenes that provoke known failures, and a page of what each method makes of them.

pub mod data;
pub mod report;
