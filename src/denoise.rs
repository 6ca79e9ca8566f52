//! Denoising of finished pictures with Intel's Open Image Denoise 2, by their albedo and normals (feature `denoise`).
//!
//! A denoised picture is smooth, not right: what the network takes for noise is gone, and nothing bounds its error. So
//! no reference is ever denoised, and pictures keep the noisy radiance beside. A crop is denoised by what it shows
//! alone, and differs from the same part of the whole.
//!
//! The library is found when the program runs: a machine without it builds and runs everything else. The crate `oidn`
//! (2.5.1) links it at build time or downloads it, which is why this module calls its C interface instead, and only on
//! the CPU, whose memory the pictures are in.

#[cfg(not(feature = "denoise"))]
mod absent;
#[cfg(feature = "denoise")]
#[allow(unsafe_code)]
mod oidn;

#[cfg(not(feature = "denoise"))]
pub use absent::Denoiser;
#[cfg(feature = "denoise")]
pub use oidn::Denoiser;

use crate::ErrorClass;
use crate::layer::Layer;

/// A picture that cannot be denoised.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The crate was built without the feature.
    #[error("this program was built without it; build with `--features denoise`")]
    NotBuilt,
    /// The library is not on this machine, or not of version 2.
    #[error(
        "no usable Open Image Denoise 2: {reason}; install it, or set PARHELION_OIDN to its file or folder"
    )]
    Absent {
        /// What the system says.
        reason: String,
    },
    /// The library refused its work.
    #[error("Open Image Denoise: {0}")]
    Library(String),
    /// A layer does not fit the picture.
    #[error("layer `{0}` does not have three channels and the picture's size")]
    Shape(&'static str),
}

impl Error {
    /// What kind of failure this is: bad input where the program cannot denoise at all.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        match self {
            Self::NotBuilt => ErrorClass::Input,
            Self::Absent { .. } | Self::Library(_) | Self::Shape(_) => ErrorClass::Other,
        }
    }
}

/// What a picture is denoised from. All layers have three channels and one size.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// Radiance, linear, of any scale.
    pub radiance: &'a Layer,
    /// Diffuse albedo at primary hits, 0 … 1.
    pub albedo: &'a Layer,
    /// Unit normals at primary hits, or 0.
    pub normal: &'a Layer,
}
