//! From a scene and a configuration to a picture.
//!
//! A scene is [prepared](Prepared) for a device once: shading data, the structures rays are traced in, what it needs of a
//! pipeline. A [`Renderer`] draws it: each frame is a graph built anew and handed to the device.
//! [`Renderer::render`] draws a whole picture and measures it, a [`Stepper`] one step at a time.

mod choice;
mod deform;
mod drawing;
mod edit;
mod error;
mod finite;
mod frame;
mod growing;
mod measure;
mod plan;
mod prepared;
mod request;
mod resident;
mod seen;
mod stepper;
mod submit;
mod times;
mod window;

pub use crate::layer::Layer;
pub use crate::methods::Aov;
pub use choice::{Timing, cached_timing};
pub use edit::{Invalidated, Redone};
pub use error::Error;
pub use finite::NotFinite;
pub use frame::{Denoised, Frame, PassStats};
pub use growing::noise;
pub use plan::plan;
pub use prepared::Prepared;
pub use request::{BackendChoice, FrameRequest, Preview, Progress, RendererOptions, Resume};
pub use stepper::Stepper;
pub use submit::Renderer;
