//! The Vulkan layer: the only owner of Vulkan objects.
//!
//! A [`Device`] is chosen by score or by name, reports in one message what it lacks, and hands out
//! [`Buffer`]s, [`Image`]s and [`Heap`]s that free themselves. [`Pipelines`] turns [`KernelCode`] into
//! compute pipelines, with a cache on disk.
//!
//! # Objects in use
//!
//! Dropping a Vulkan object destroys it at once. Whoever records a command buffer keeps everything it
//! names alive until its [`Submission`] has been waited for; dropping a `Submission` waits.

pub(crate) mod accel;
mod allocator;
mod buffer;
mod cache;
mod command;
mod debug;
mod device;
mod error;
mod format;
mod heap;
mod image;
mod instance;
mod kernel;
mod manifest;
mod pipeline;
mod probe;
mod queue;
mod select;
#[cfg(test)]
mod tests;
mod transfer;

pub use accel::AccelerationStructure;
pub use allocator::{MemoryKind, MemoryReport, Requirements};
pub use buffer::Buffer;
pub use cache::cache_folder;
pub use command::{CommandBuffer, Submission, TimestampPool};
pub use debug::ValidationLog;
pub use device::{Device, DeviceOptions};
pub use error::Error;
pub use heap::Heap;
pub(crate) use image::COLOR_RANGE;
pub use image::Image;
pub use kernel::{Access, Backend, Binding, BindingKind, Format, KernelCode, Modules, ParamMember};
pub use manifest::usable_drivers;
pub use pipeline::{Pipeline, Pipelines, SceneSet};
pub use probe::enumerate;
pub use select::{DeviceInfo, DeviceKind};
