//! What can go wrong between a scene and its picture.

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
    /// Stopped by the caller.
    #[error("interrupted")]
    Cancelled,
}

impl Error {
    /// The process's exit code for this error: 2 bad input, 3 no suitable device, 75 device lost or out of
    /// memory, 130 interrupted, 1 anything else.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Vulkan(error) => error.exit_code(),
            Self::Graph(graph::Error::Vulkan(error)) => error.exit_code(),
            Self::Graph(graph::Error::Cancelled) | Self::Cancelled => 130,
            Self::Graph(graph::Error::Declaration(_))
            | Self::Scene(_)
            | Self::Config(_)
            | Self::SoftwareOnly { .. } => 2,
            Self::Layer(_) | Self::Resume(_) => 2,
            Self::NoRayQuery { .. } => 3,
            Self::Structure(error) => error.exit_code(),
            Self::Denoise(error) => error.exit_code(),
            Self::Graph(_) => 1,
        }
    }
}
