//! Methods: ordered lists of techniques, nothing else.

pub mod igi;
pub mod path;

use crate::config::RenderConfig;
use crate::graph::{Buffer, Graph, Image, Res};
use crate::scene::SceneProfile;
use crate::techniques::Kernels;
use crate::techniques::gbuffer::{GBuffer, Geometry};
use crate::techniques::path_trace::Means;

/// A layer beside beauty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Aov {
    /// Diffuse albedo that irradiance is multiplied with, 3 channels.
    Albedo,
    /// Unit shading normal in the world, turned to the camera, 3 channels.
    N,
    /// Position in the world (m), 3 channels.
    P,
    /// Radiance by emission and direct light, 3 channels.
    Direct,
    /// Radiance through mirrors and glass, 3 channels.
    Specular,
    /// Radiance by indirect light in the diffuse part, 3 channels.
    Indirect,
    /// Radiance by indirect light in glossy lobes, 3 channels.
    Glossy,
    /// Indirect irradiance (W/m²), 3 channels.
    Irradiance,
    /// Distance along the viewing direction (m), 1 channel.
    Depth,
    /// Variance of beauty's mean, estimated by its halves (one degree of freedom), 3 channels.
    Variance,
    /// Radiance by samples 0, 2, 4, … alone, 3 channels.
    HalfA,
    /// Radiance by samples 1, 3, 5, … alone, 3 channels.
    HalfB,
    /// Of adaptive sampling, 3 channels: samples a pixel takes for each that pixels take on average, the variance that
    /// rates so far have led to, 1 where it is that of equal rates, and samples it took before the rates last changed.
    Rate,
}

impl Aov {
    /// All of them.
    pub const ALL: [Self; 13] = [
        Self::Albedo,
        Self::N,
        Self::P,
        Self::Direct,
        Self::Specular,
        Self::Indirect,
        Self::Glossy,
        Self::Irradiance,
        Self::Depth,
        Self::Variance,
        Self::HalfA,
        Self::HalfB,
        Self::Rate,
    ];

    /// Its word on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Albedo => "albedo",
            Self::N => "N",
            Self::P => "P",
            Self::Direct => "direct",
            Self::Specular => "specular",
            Self::Indirect => "indirect",
            Self::Glossy => "glossy",
            Self::Irradiance => "irradiance",
            Self::Depth => "depth",
            Self::Variance => "variance",
            Self::HalfA => "half_a",
            Self::HalfB => "half_b",
            Self::Rate => "rate",
        }
    }

    /// Whether it takes independent halves of a progressive picture's samples.
    #[must_use]
    pub fn takes_halves(self) -> bool {
        matches!(self, Self::Variance | Self::HalfA | Self::HalfB)
    }

    /// Channels of the layer.
    #[must_use]
    pub fn channels(self) -> usize {
        if self == Self::Depth { 1 } else { 3 }
    }
}

/// What a method draws. All images are of the window's size.
#[derive(Clone, Copy, Debug)]
pub struct Layers {
    /// Radiance of everything together.
    pub beauty: Res<Image>,
    /// Primary hits.
    pub gbuffer: GBuffer,
    /// Normals, depths and positions, where the method has made them.
    pub geometry: Option<Geometry>,
    /// Radiance by emission and direct light, where it is apart.
    pub direct: Option<Res<Image>>,
    /// Radiance through mirrors and glass, where there are any and it is apart.
    pub specular: Option<Res<Image>>,
    /// Indirect irradiance (W/m²), where there is one.
    pub irradiance: Option<Res<Image>>,
    /// Radiance by indirect light in glossy lobes, where there are any and it is apart.
    pub glossy: Option<Res<Image>>,
    /// Beauty by every second sample, of progressive methods asked for it.
    pub halves: Option<[Res<Image>; 2]>,
    /// Rates of adaptive sampling, where it is.
    pub rates: Option<Res<Image>>,
    /// VPLs that exist, of methods that have some.
    pub vpl_count: Option<Res<Buffer>>,
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
    /// What a progressive method has come to.
    pub means: Option<Means>,
    /// Samples a pixel that a progressive method has taken before.
    pub taken: u32,
    /// Samples a pixel that a progressive method takes in this graph.
    pub samples: u32,
}

/// A way to render.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// Its word everywhere.
    pub name: &'static str,
    /// One line for help texts.
    pub about: &'static str,
    /// A paragraph: how it works, what it is known to lose, how its error looks, whose it is.
    pub description: &'static str,
    /// The layers it can draw.
    pub aovs: &'static [Aov],
    /// Whether a picture grows over many graphs, by [`FrameInfo::samples`] each; one graph draws it otherwise.
    pub progressive: bool,
    /// Records one graph.
    pub record: fn(&mut Graph, &Kernels, &RenderConfig, &FrameInfo) -> Layers,
    /// What of a scene it does not model as configured, a sentence each.
    pub left_out: fn(&SceneProfile, &RenderConfig) -> Vec<String>,
}

/// All methods there are.
pub const REGISTRY: &[Method] = &[igi::METHOD, path::METHOD];

impl Method {
    /// Checks that the method can draw these layers with these settings.
    ///
    /// # Errors
    /// Names the first that it can't.
    pub fn check(&self, config: &RenderConfig, aovs: &[Aov]) -> Result<(), NoLayer> {
        let there = |aov: &Aov| self.aovs.contains(aov) && (*aov != Aov::Rate || config.path_trace.adaptive);
        match aovs.iter().find(|aov| !there(aov)) {
            Some(aov) => Err(NoLayer {
                method: self.name,
                layer: aov.name(),
                there: self.aovs.iter().copied().filter(there).collect(),
            }),
            None => Ok(()),
        }
    }
}

/// A layer that a method does not draw.
#[derive(Clone, Debug, thiserror::Error)]
#[error("method {method} has no layer `{layer}`; there are {}", names(.there))]
pub struct NoLayer {
    /// The method.
    pub method: &'static str,
    /// The layer asked for.
    pub layer: &'static str,
    /// Those there are.
    pub there: Vec<Aov>,
}

fn names(aovs: &[Aov]) -> String {
    aovs.iter().map(|aov| aov.name()).collect::<Vec<_>>().join(", ")
}

/// The method called `name`.
///
/// # Panics
/// If there is none: configurations only hold names of the registry.
#[must_use]
pub fn named(name: &str) -> &'static Method {
    REGISTRY.iter().find(|method| method.name == name).expect("configurations name methods of the registry")
}
