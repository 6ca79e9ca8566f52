//! The stages in their order.

use super::{Filter, IndirectConfig, Missing, SampleGrid, Scope, Upsample, downsample, interleave};
use crate::graph::{Buffer, Graph, Image, Res};
use crate::shaders::MissingArgs;
use crate::techniques::Kernels;
use crate::techniques::gbuffer::{GBuffer, Geometry};
use crate::techniques::vpl_shoot::Vpls;

/// Indirect light of a frame.
#[derive(Clone, Copy, Debug)]
pub struct Indirect {
    /// Irradiance at every pixel (W/m²).
    pub irradiance: Res<Image>,
    /// Four unsigned integers, the last of them how many pixels were gathered by themselves; where some may be.
    pub regathered: Option<Res<Buffer>>,
}

/// Irradiance at gather samples, still to be brought to the pixels.
#[derive(Clone, Copy, Debug)]
pub struct Samples {
    pub(super) gathered: Res<Image>,
    pub(super) min_distance: f32,
}

/// Gathers irradiance at the samples from their VPLs.
pub fn gather(
    g: &mut Graph,
    k: &Kernels,
    config: &IndirectConfig,
    gbuffer: &GBuffer,
    vpls: &Vpls,
    min_distance: f32,
) -> Samples {
    let s = Scope { kernels: k, config, gbuffer, vpls, min_distance };
    let window = g.desc(gbuffer.albedo).extent;
    let first_cell = gbuffer.origin.map(|pixel| pixel / config.downsample);
    let end = |axis: usize| (gbuffer.origin[axis] + window[axis]).div_ceil(config.downsample);
    let extent = [0, 1].map(|axis| end(axis) - first_cell[axis]);
    let gathered = g.group("indirect", |g| super::gather::gather(g, &s, &SampleGrid { first_cell, extent }));
    Samples { gathered, min_distance }
}

/// Radiance (W/(sr·m²)) by the glossy lobes of primary hits from all VPLs; `None` where there are none.
pub fn glossy(
    g: &mut Graph,
    k: &Kernels,
    config: &IndirectConfig,
    gbuffer: &GBuffer,
    vpls: &Vpls,
    min_distance: f32,
) -> Option<Res<Image>> {
    let s = Scope { kernels: k, config, gbuffer, vpls, min_distance };
    k.glossy_lobes().then(|| g.group("indirect", |g| super::glossy::glossy(g, &s)))
}

/// Brings the samples' light to every pixel. Without `geometry` the samples are the pixels.
pub fn reconstruct(
    g: &mut Graph,
    k: &Kernels,
    config: &IndirectConfig,
    gbuffer: &GBuffer,
    geometry: Option<&Geometry>,
    vpls: &Vpls,
    samples: &Samples,
) -> Indirect {
    let &Samples { gathered, min_distance } = samples;
    let s = Scope { kernels: k, config, gbuffer, vpls, min_distance };
    let Some(geometry) = geometry else { return Indirect { irradiance: gathered, regathered: None } };
    g.group("indirect", |g| {
        let samples = match (config.filter, config.interleave) {
            (Filter::Paper, 2..) => interleave::interleave(g, &s, geometry, gathered),
            _ => gathered,
        };
        if config.filter == Filter::Paper && config.downsample == 1 {
            return Indirect { irradiance: samples, regathered: None };
        }
        let missing = missing(g, config, g.desc(gbuffer.albedo).extent);
        let irradiance = match config.filter {
            Filter::Paper => downsample::upsample(g, &s, geometry, samples, missing),
            Filter::Combined => downsample::combined(g, &s, geometry, samples, missing),
        };
        let regathered = (config.upsample == Upsample::Plane).then(|| {
            super::gather::regather(g, &s, missing, irradiance);
            missing.args
        });
        Indirect { irradiance, regathered }
    })
}

fn missing(g: &mut Graph, config: &IndirectConfig, [width, height]: [u32; 2]) -> Missing {
    let room = if config.upsample == Upsample::Plane { u64::from(width) * u64::from(height) } else { 1 };
    let list = g.buffer("missing", 4 * room);
    let none = MissingArgs { groups: [0, 1, 1], count: 0 };
    let args = g.buffer_with("regather_args", bytemuck::bytes_of(&none).to_vec());
    Missing { list, args }
}
