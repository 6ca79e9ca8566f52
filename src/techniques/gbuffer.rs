//! What the camera sees: one ray a pixel.

use super::Kernels;
use crate::graph::{Graph, Grid, Image, ImageDesc, Res};
use crate::shaders::gbuffer::{geometry, primary};
use crate::vk::Format;

/// Primary hits, one a pixel.
#[derive(Clone, Copy, Debug)]
pub struct GBuffer {
    /// Instance, primitive and barycentrics (`glsl/trace/hit.glsl`).
    pub hits: Res<Image>,
    /// Diffuse albedo there: what irradiance is multiplied with, last of all.
    pub albedo: Res<Image>,
    /// Where the window begins in the whole picture (pixels).
    pub origin: [u32; 2],
}

/// Shading normal and depth (m, along the viewing direction), and position (m). Misses are 0.
#[derive(Clone, Copy, Debug)]
pub struct Geometry {
    /// Normal in xyz, depth in w.
    pub normal_depth: Res<Image>,
    /// Position in xyz.
    pub position: Res<Image>,
}

/// Which neighbours are on one plane.
#[derive(Clone, Copy, Debug)]
pub struct Planes {
    /// Most distance from the plane of what counts as on it, in ways (pixels' edges) between the two.
    pub reach: f32,
    /// Least cosine between normals.
    pub least_cosine: f32,
}

/// Traces the camera's rays for the window of `extent` pixels that begins at pixel `origin`.
pub fn gbuffer(g: &mut Graph, k: &Kernels, origin: [u32; 2], extent: [u32; 2]) -> GBuffer {
    g.group("gbuffer", |g| {
        let hits = g.image("hits", ImageDesc::new(extent, Format::Rgba32Uint));
        let albedo = g.image("albedo", ImageDesc::new(extent, Format::Rgba32Float));
        let bind = primary::Bind { out_hits: hits, out_albedo: albedo };
        g.pass("primary", &primary::kernel(&k.scene), bind, primary::Params {}, Grid::Over(hits));
        GBuffer { hits, albedo, origin }
    })
}

/// Unpacks the hits for filters and outputs.
pub fn unpack(g: &mut Graph, k: &Kernels, gb: &GBuffer) -> Geometry {
    g.group("gbuffer", |g| {
        let desc = g.desc(gb.albedo);
        let normal_depth = g.image("normal_depth", desc);
        let position = g.image("position", desc);
        let bind = geometry::Bind { hits: gb.hits, out_normal_depth: normal_depth, out_position: position };
        g.pass("geometry", &geometry::kernel(&k.scene), bind, geometry::Params {}, Grid::Over(normal_depth));
        Geometry { normal_depth, position }
    })
}
