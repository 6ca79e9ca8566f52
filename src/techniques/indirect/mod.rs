//! Indirect irradiance at primary hits from virtual point lights (Marques & Santos 2010, eq. 1).
//!
//! E(x) = (1/π) Σ_k Φ_k V(x, y_k) G(x, y_k), one shadow ray a VPL with G > 0, where
//! G = cosθ_x cosθ_k / d² · f(0.8 m, 1.2 m, d) with the paper's cubic smooth step f. Irradiance, not radiance, is
//! kept: the albedo multiplies when the picture is composed, so filters never blur textures. What glossy lobes reflect of
//! VPLs is radiance in an image of its own ([`glossy`]), by every pixel and every VPL, never filtered. VPLs themselves
//! shine as Lambertians.
//!
//! Bias: f drops light from VPLs nearer than m; in a convex box about 4/(3π) · m · ΣL_edge / A of one bounce.
//! [`IndirectConfig::compensation`] gives it back.
//! Cost: a shadow ray for every pixel and VPL that face each other; nearly all of a frame.
//!
//! Imperfect visibility ([`Visibility`]; Marques & Santos 2010, §4.1) lets triangles' bounding boxes block these rays.
//! A box does if the segment enters and leaves it between its ends; one that holds an end does not, or every surface
//! would shadow itself. Two errors follow. *False shadows*: boxes stand out from slanted and curved surfaces. Light
//! lost under `boxes` and `boxes-plane`, without splitting, on indirect light alone:
//!
//! | scene | `boxes` | `boxes-plane` |
//! |---|---|---|
//! | axis-aligned rectangles | 0 | 0 |
//! | inside a sphere of 5120 triangles | 66 % | 0 |
//! | outside of it | 44 % | 3 % |
//! | a cube room turned by 37° | 19 % | 0 |
//! | the paper's Conference room (202 318 triangles here) | 10.2 % | 3.4 % |
//! | its Office (22 432) | 18.6 % | 8.0 % |
//!
//! *Missed occluders*: a box that holds an end lets light through what is in it. Among 60 large triangles 11 % of what
//! is hidden is seen under `boxes`, 24 % under `boxes-plane`; split at a fifth of their reach 0.4 % and 3 %.
//! In software on two cores the gather of these two rooms takes 0.6 to 0.8 of its time under `boxes`, 0.9 to 1 under
//! `boxes-plane` and 0.65 to 0.85 under `boxes-inline`: nearly as many nodes are visited, but a third fewer leaves. In
//! `builtin:office` all take the same.

mod downsample;
mod free_path;
mod gather;
mod glossy;
mod interleave;
mod passes;

pub use free_path::free_path;
pub use passes::{Indirect, Samples, gather, glossy, reconstruct};

use super::gbuffer::{GBuffer, Planes};
use super::setting::{BadValue, Settings, within};
use super::{Kernels, vpl_shoot::VplShootConfig, vpl_shoot::Vpls};
use crate::accel::boxes::BoxOptions;
use crate::graph::{Buffer, Res};
use crate::shaders;

/// How virtual point lights are gathered.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct IndirectConfig {
    /// The paper's min_d (m): light from VPLs nearer than 0.8 of it is dropped, from 1.2 of it on complete.
    /// More hides the splotches around VPLs and leaves more to `compensation`, without which it darkens corners; 0 keeps all
    /// light and its infinite variance. Absent: the median way from what the camera sees to what that sees; without
    /// `compensation` ½·√(A/N) for a scene of area A and N VPLs (ours: the paper does not say).
    pub min_distance: Option<f32>,
    /// Rays, 0 … 64, that each pixel and each point behind mirrors and glass sends to find the light that VPLs leave out:
    /// what bounding takes from them (Kollig & Keller 2004), the light that glossy lobes reflect, whatever comes by way of
    /// mirrors and glass. They ask a cache of irradiance in the world ([`super::radiance_cache`]). 0: none, and no pass;
    /// lobes then are lit by VPLs, and presets leave it so. With any, `min_distance` follows what is seen and is a dial from
    /// VPLs to final gathering, and points behind mirrors and glass are lit by a subset of the VPLs each, as pixels are.
    /// More: less grain, of what `filter` combined leaves; time in proportion. The defaults at 800×600 on an H200 against
    /// path tracing of 1024 samples, of 12 seeds each: milliseconds, relMSE as median and worst, bias as the mean ± standard
    /// error (rooms with a star: 2048 samples, 16 seeds, before records knew what mirrors bring); beside it 180 VPLs by
    /// themselves, of 8 seeds against path tracing of at most 5 edges:
    ///
    /// | room | ms | relMSE | bias | by VPLs alone |
    /// |---|---|---|---|---|
    /// | Conference room, 4 points | 29 | 0.016, 0.027 | 0.0 ± 0.3 % | 0.032, −9.1 % |
    /// | Office, 2 points * | 18 | 0.019, 0.028 | −0.3 ± 0.5 % | 0.027, −4.2 % |
    /// | Conference room, panels | 34 | 0.025, 0.050 | 0.0 ± 0.1 % | 0.073, −4.8 % |
    /// | Office, panels and lamp | 23 | 0.051, 0.069 | −1.2 ± 0.2 % | 0.045, −4.8 % |
    /// | Sponza | 21 | 0.038, 0.122 | +0.7 ± 0.5 % | 0.17, −5.7 % |
    /// | a staircase | 21 | 0.035, 0.043 | −1.9 ± 0.4 % | 0.55, −18 % |
    /// | a cabin | 22 | 0.029, 0.031 | 0.0 ± 0.1 % | 0.096, −0.6 % |
    /// | plates and lamps of Veach's * | 9 | 0.081, 0.089 | −0.1 ± 0.0 % | 0.11, −0.4 % |
    /// | a school room lit by the sky through windows * | 27 | 0.72, 39 | −8 ± 6 % | |
    ///
    /// Bias: the cache's. Rays meet triangles whatever the visibility.
    pub compensation: u32,
    /// What blocks light from VPLs.
    pub visibility: Visibility,
    /// Longest edge (m), above 0, that a bounding box may have before its triangle is split, for `boxes` and
    /// `boxes-plane` (ours). Less misses fewer occluders and costs boxes, hence memory and time: at 0.1 m the Office has
    /// three times as many bytes of boxes. `boxes-plane` nears exact visibility (the Office loses 2.2 % in place of
    /// 8.0); under `boxes` false shadows of small triangles shrink, but those of large slanted walls, whose boxes held
    /// the rays' ends before, grow: the room turned by 37° loses 49 % at 0.05 m. Absent, as in the paper: no triangle
    /// is split.
    pub box_split: Option<f32>,
    /// Gather on one sample in a window of so many pixels squared, 1 … 16; 1 gathers at every pixel. The paper
    /// uses 4. More is faster and blurs indirect shadows; edges depend on `upsample`.
    pub downsample: u32,
    /// How pixels get their light from the samples.
    pub upsample: Upsample,
    /// Split the VPLs' paths into this number squared of subsets, 1, 2 or 3, one for each sample of a tile; 1
    /// gives all to each. The paper uses 3. More is faster and leaves a pattern where neighbours do not fit.
    pub interleave: u32,
    /// Which sample of a tile has which subset.
    pub pattern: Pattern,
    /// What hides the tiles.
    pub filter: Filter,
    /// Neighbours count in the paper's discontinuity buffer while their depth differs by less than this share of
    /// the pixel's, above 0. More averages across edges, less leaves the pattern on slanted surfaces. Ours: the
    /// paper gives none.
    pub depth_threshold: f32,
    /// … and while the cosine between normals is above this, −1 … 1. Ours: the paper gives none (and says below,
    /// which would be the angle).
    pub normal_threshold: f32,
    /// For `plane` and `combined`: a sample fits up to this distance from the pixel's plane, in edges of a window
    /// (times the edge of a tile, for `combined`), above 0. More bleeds between near planes, less leaves more
    /// pixels without a sample.
    pub plane_threshold: f32,
    /// … and its weight falls to 0 as the cosine between normals falls to this, −1 … 1 (1 excluded).
    pub plane_cosine: f32,
    /// For `combined` with `upsample` plane: a pixel that samples of fewer than this share of the subsets fit is gathered by
    /// itself, 0 … 1. Small surfaces, thin lines and edges have few: more leaves less error there and costs as many rays a
    /// pixel as there are VPLs. 0: only where none fits.
    pub least_fit: f32,
    /// Whether clear coats and specular lobes rougher than `whitted.mirror_roughness` count: in direct light, behind
    /// mirrors, and at primary hits lit by every VPL at every pixel, whatever the accelerations. Without, their light is
    /// missing, and pictures of materials other than Lambertian are darker; with, a scene that has such materials takes
    /// about one canonical gather longer, others nothing. On, because that is what a file's materials say; the presets
    /// are the paper's and leave it off.
    pub glossy: bool,
}

impl Default for IndirectConfig {
    fn default() -> Self {
        Self {
            min_distance: None,
            compensation: 8,
            visibility: Visibility::Exact,
            box_split: None,
            downsample: 1,
            upsample: Upsample::Paper,
            interleave: 3,
            pattern: Pattern::Regular,
            filter: Filter::Combined,
            depth_threshold: 0.05,
            normal_threshold: 0.9,
            plane_threshold: 0.5,
            plane_cosine: 0.8,
            least_fit: 0.0,
            glossy: true,
        }
    }
}

impl Settings for IndirectConfig {
    fn check(&self) -> Result<(), BadValue> {
        within("indirect.compensation", self.compensation, 0..=64)?;
        within("indirect.downsample", self.downsample, 1..=16)?;
        within("indirect.interleave", self.interleave, 1..=3)?;
        within("indirect.depth_threshold", self.depth_threshold, f32::MIN_POSITIVE..=f32::MAX)?;
        within("indirect.normal_threshold", self.normal_threshold, -1.0..=1.0)?;
        within("indirect.plane_threshold", self.plane_threshold, f32::MIN_POSITIVE..=f32::MAX)?;
        within("indirect.plane_cosine", self.plane_cosine, -1.0..=0.999)?;
        within("indirect.least_fit", self.least_fit, 0.0..=1.0)?;
        if let Some(distance) = self.min_distance
            && !(distance.is_finite() && distance >= 0.0)
        {
            let problem = format!("{distance} is not a distance (finite, at least 0)");
            return Err(BadValue::new("indirect.min_distance", problem));
        }
        match self.box_split {
            Some(longest) if !(longest.is_finite() && longest > 0.0) => {
                let problem = format!("{longest} is not a length (finite, above 0)");
                Err(BadValue::new("indirect.box_split", problem))
            }
            Some(_) if self.boxes().is_none() => {
                let problem = format!("visibility {} has no boxes to split", self.visibility.name());
                Err(BadValue::new("indirect.box_split", problem))
            }
            _ => Ok(()),
        }
    }
}

/// What blocks light from VPLs, at primary hits and behind mirrors and glass alike. Light straight from the lights
/// always meets triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Visibility {
    /// Triangles.
    #[default]
    Exact = shaders::VISIBILITY_EXACT as isize,
    /// The paper's imperfect visibility: triangles' bounding boxes, in a second structure.
    Boxes = shaders::VISIBILITY_BOXES as isize,
    /// Ours: as `boxes`, but a box with thickness blocks only what enters and leaves it on opposite sides of its
    /// triangle's plane.
    BoxesPlane = shaders::VISIBILITY_BOXES_PLANE as isize,
    /// As `boxes`, without a second structure: rays descend that over triangles and stop at the box of a leaf's
    /// triangle. Traced in software only.
    BoxesInline = shaders::VISIBILITY_BOXES_INLINE as isize,
}

impl Visibility {
    /// All kinds.
    pub const ALL: &'static [Self] = &[Self::Exact, Self::Boxes, Self::BoxesPlane, Self::BoxesInline];

    /// Their words.
    pub const NAMES: &'static [&'static str] =
        &[Self::Exact.name(), Self::Boxes.name(), Self::BoxesPlane.name(), Self::BoxesInline.name()];

    /// Its word on the command line, in files and in charts.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Boxes => "boxes",
            Self::BoxesPlane => "boxes-plane",
            Self::BoxesInline => "boxes-inline",
        }
    }

    /// Whether only the software backend has it.
    #[must_use]
    pub fn software_only(self) -> bool {
        self == Self::BoxesInline
    }
}

/// How pixels get their light from samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Upsample {
    /// The paper's equation 2: samples weigh by distance and by the cosine between normals. Light bleeds between
    /// parallel planes; a pixel that no sample fits takes the nearest.
    #[default]
    Paper,
    /// Samples also have to continue the pixel's plane; pixels that none fits are gathered by themselves.
    Plane,
}

/// Which sample of a tile has which subset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pattern {
    /// The same in every tile: any window of a tile's size holds each subset once.
    #[default]
    Regular,
    /// Another order in each tile: noise in place of a pattern.
    Irregular,
}

/// What hides the tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Filter {
    /// The paper's two: a discontinuity buffer over the samples, then upsampling.
    Paper,
    /// One edge-aware filter that averages each subset by itself. Where every pixel has a sample, what its subset brings there
    /// and around says how unlike its neighbours it is: shadows and thin lines keep their edges. What rays of `compensation`
    /// find is averaged over neighbours, too.
    #[default]
    Combined,
}

impl IndirectConfig {
    /// The second structure that the visibility needs, if it needs one; without panes, which light passes.
    #[must_use]
    pub fn boxes(&self) -> Option<BoxOptions> {
        let planes = self.visibility == Visibility::BoxesPlane;
        (planes || self.visibility == Visibility::Boxes).then_some(BoxOptions {
            split: self.box_split,
            planes,
            panes: false,
        })
    }

    /// The distance in force for a scene of `area` m².
    #[must_use]
    pub fn min_distance(&self, area: f32, free_path: Option<f32>, shoot: &VplShootConfig) -> f32 {
        let by_area = || 0.5 * (area / shoot.vpls as f32).sqrt();
        self.min_distance.unwrap_or_else(|| free_path.unwrap_or_else(by_area))
    }

    /// Subsets the light paths are split into.
    #[must_use]
    pub fn subsets(&self) -> u32 {
        self.interleave * self.interleave
    }

    /// A point behind mirrors and glass is lit by one VPL in so many: where rays bring part of the light, they are as many
    /// as a pixel's.
    pub(crate) fn behind_mirrors(&self) -> u32 {
        if self.compensation > 0 { self.subsets() } else { 1 }
    }

    /// Whether pixels depend on others.
    #[must_use]
    pub fn filtered(&self) -> bool {
        self.downsample > 1 || self.interleave > 1
    }

    /// Pixels that lend what rays find to each other, if any do.
    #[must_use]
    pub fn planes(&self) -> Option<Planes> {
        let planes = Planes { reach: self.plane_threshold, least_cosine: self.plane_cosine };
        (self.compensation > 0 && self.filter == Filter::Combined).then_some(planes)
    }

    /// Pixels beyond a part of the picture that decide what is in it.
    #[must_use]
    pub(crate) fn reach(&self) -> u32 {
        let samples = match self.filter {
            _ if !self.filtered() => 0,
            // Upsampling looks two samples far, the discontinuity buffer one.
            Filter::Paper => 4,
            // The combined filter three, and four more on its second attempt.
            Filter::Combined => 8,
        };
        (samples * self.downsample).max(self.planes().map_or(0, |_| super::radiance_cache::REACH))
    }

    /// Subsets that need a fitting sample.
    fn least_found(&self) -> u32 {
        ((self.least_fit * self.subsets() as f32).ceil() as u32).max(1)
    }

    fn irregular(&self) -> bool {
        self.pattern == Pattern::Irregular && self.interleave > 1
    }
}

impl Kernels {
    /// The kernels for the visibility of VPLs and the lobes that are asked for.
    #[must_use]
    pub fn with_indirect(mut self, config: &IndirectConfig) -> Self {
        self.scene.visibility = config.visibility as u32;
        let profile = &self.profile;
        self.scene.glossy = config.glossy && (profile.rough_lobes || profile.clearcoat || profile.polished);
        self
    }
}

/// VPLs one pass loops over. Bounds what a single workgroup can take, and stays below a limit of lavapipe before
/// Mesa 23: it leaves a shader's loops after 65 535 iterations in all, those of traversal included, without a word.
pub(crate) const RANGE: u32 = 512;

/// What all stages here share.
struct Scope<'a> {
    kernels: &'a Kernels,
    config: &'a IndirectConfig,
    gbuffer: &'a GBuffer,
    vpls: &'a Vpls,
    min_distance: f32,
}

/// The grid of gather samples.
struct SampleGrid {
    /// The whole picture's cell that the first sample stands for.
    first_cell: [u32; 2],
    /// Samples.
    extent: [u32; 2],
}

/// Pixels that no sample fits.
#[derive(Clone, Copy)]
struct Missing {
    list: Res<Buffer>,
    /// Workgroups that work on the list, and its length.
    args: Res<Buffer>,
}

#[cfg(test)]
mod tests;
