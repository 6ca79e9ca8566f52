//! Parhelion renders global illumination with virtual point lights on any Vulkan device.

// Gives programs that use this library what the linker needs beside shaderc itself.
#[cfg(feature = "compile")]
extern crate shaderc_link as _;

pub mod accel;
pub mod chart;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
#[cfg(feature = "compile")]
mod compile;
pub mod denoise;
pub mod docs;
mod error;
mod files;
pub mod gpu_scene;
#[allow(unsafe_code)]
pub mod graph;
mod layer;
pub mod memory;
pub mod methods;
pub mod metrics;
pub mod output;
mod page;
pub mod paper;
pub mod picture;
mod read;
#[cfg(feature = "compile")]
mod reflect;
pub mod renderer;
pub mod sampling;
pub mod scene;
pub mod shaders;
pub mod stress;
pub mod techniques;
mod text;
#[allow(unsafe_code)]
pub mod vk;

#[cfg(feature = "compile")]
pub use compile::CompileError;
pub use error::ErrorClass;
pub use methods::config;

// Unit and integration tests share one set of helpers, which names the crate as the latter do.
#[cfg(test)]
extern crate self as parhelion;

#[cfg(test)]
#[path = "../tests/common/mod.rs"]
mod common;
