//! What can go wrong between a scene and its picture.

use crate::ErrorClass;
use crate::memory::Shortage;
use crate::methods::NoLayer;
use crate::scene::SceneError;
use crate::{accel, denoise, graph, vk};

/// What keeps a scene from being prepared or drawn.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The device or its driver.
    #[error(transparent)]
    Vulkan(#[from] vk::Error),
    /// The frame's graph: a wrong tap, or a limit of the device passed.
    #[error(transparent)]
    Graph(#[from] graph::Error),
    /// The structure rays are traced in.
    #[error(transparent)]
    Structure(#[from] accel::Error),
    /// The scene's own parts do not fit together.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The configuration.
    #[error(transparent)]
    Config(#[from] crate::config::ConfigError),
    /// The method does not draw a layer asked for.
    #[error(transparent)]
    Layer(#[from] NoLayer),
    /// The picture to go on from does not fit: its size, or layers that are missing.
    #[error("{0}")]
    Resume(String),
    /// The backend asked for does not exist on the device.
    #[error("device {device} has no ray query (VK_KHR_ray_query); use --backend software or auto")]
    NoRayQuery {
        /// The device's name.
        device: String,
    },
    /// The kind of visibility exists on the other backend only.
    #[error("visibility {visibility} is traced in software only; use --backend software or auto")]
    SoftwareOnly {
        /// Its word.
        visibility: &'static str,
    },
    /// The picture cannot be denoised.
    #[error(transparent)]
    Denoise(#[from] denoise::Error),
    /// The host has no room for the picture.
    #[error("a picture of {width}x{height} pixels with its layers {shortage}")]
    NoRoom {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// What that takes, and what is left.
        shortage: Shortage,
    },
    /// Stopped by the caller.
    #[error("interrupted")]
    Cancelled,
}

impl Error {
    /// What kind of failure this is.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        match self {
            Self::Vulkan(error) => error.class(),
            Self::Graph(error) => error.class(),
            Self::Structure(error) => error.class(),
            Self::Denoise(error) => error.class(),
            Self::Scene(error) => error.class(),
            Self::Config(error) => error.class(),
            Self::Layer(error) => error.class(),
            Self::Resume(_) | Self::SoftwareOnly { .. } => ErrorClass::Input,
            Self::NoRoom { .. } => ErrorClass::Memory,
            Self::NoRayQuery { .. } => ErrorClass::Device,
            Self::Cancelled => ErrorClass::Interrupted,
        }
    }
}
