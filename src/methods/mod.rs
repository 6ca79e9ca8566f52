//! Methods: ordered lists of techniques, nothing else.

pub mod igi;

use crate::config::RenderConfig;
use crate::graph::{Buffer, Graph, Image, Res};
use crate::techniques::Kernels;
use crate::techniques::gbuffer::{GBuffer, Geometry};

/// What a method draws. All images are of the window's size.
#[derive(Clone, Copy, Debug)]
pub struct Layers {
    /// Radiance of everything together.
    pub beauty: Res<Image>,
    /// Primary hits.
    pub gbuffer: GBuffer,
    /// Normals, depths and positions, where the method has made them.
    pub geometry: Option<Geometry>,
    /// Radiance by emission and direct light.
    pub direct: Res<Image>,
    /// Radiance through mirrors and glass, where there are any.
    pub specular: Option<Res<Image>>,
    /// Indirect irradiance (W/m²).
    pub irradiance: Res<Image>,
    /// VPLs that exist.
    pub vpl_count: Res<Buffer>,
    /// Four unsigned integers, the last of them how many pixels no filter could serve; where some may be.
    pub regathered: Option<Res<Buffer>>,
}

/// What a method needs to know beside its configuration.
#[derive(Clone, Copy, Debug)]
pub struct FrameInfo {
    /// Where the window rendered begins in the whole picture (pixels).
    pub origin: [u32; 2],
    /// Pixels of the window rendered.
    pub extent: [u32; 2],
    /// The scene's surface (m²).
    pub area: f32,
}

/// A way to render.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// Its word everywhere.
    pub name: &'static str,
    /// One line for help texts.
    pub about: &'static str,
    /// Records one frame.
    pub record: fn(&mut Graph<'_>, &Kernels, &RenderConfig, &FrameInfo) -> Layers,
}

/// All methods there are.
pub const REGISTRY: &[Method] = &[igi::METHOD];

/// The method called `name`.
///
/// # Panics
/// If there is none: configurations only hold names of the registry.
#[must_use]
pub fn named(name: &str) -> &'static Method {
    REGISTRY.iter().find(|method| method.name == name).expect("configurations name methods of the registry")
}
