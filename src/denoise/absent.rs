use super::{Error, Input};
use crate::layer::Layer;
use std::path::Path;

/// The library, which this build cannot load: there is none of this type.
#[derive(Debug)]
pub enum Denoiser {}

impl Denoiser {
    /// Fails.
    ///
    /// # Errors
    /// [`Error::NotBuilt`].
    pub fn load(_: Option<&Path>) -> Result<Self, Error> {
        Err(Error::NotBuilt)
    }

    /// The library's name and version.
    #[must_use]
    pub fn name(&self) -> String {
        match *self {}
    }

    /// The picture without noise.
    ///
    /// # Errors
    /// None: there is no denoiser to ask.
    pub fn denoise(&self, _: &Input<'_>) -> Result<Layer, Error> {
        match *self {}
    }
}
