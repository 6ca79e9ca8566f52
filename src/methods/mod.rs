//! Methods: ordered lists of techniques, and all that the rest of the program needs to know of them. A method is one
//! file; configuration, help, charts, the choice of settings, the stress suite and docs find it in [`REGISTRY`].

mod aov;
pub mod config;
pub mod igi;
mod layers;
mod method;
mod option;
mod own;
pub mod path;
mod registry;
#[cfg(test)]
mod toy;
mod trial;

pub use aov::Aov;
pub use layers::{Layers, VplCounts};
pub use method::{Conditional, FrameInfo, Method, NoLayer, Progressive, Reach, Sweeps};
pub use option::{CliOption, OptionGroup, OptionValue};
pub use own::{Group, Own};
pub use registry::{REFERENCE, REGISTRY, comparable, named};
pub use trial::Trial;
