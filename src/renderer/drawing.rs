//! A frame as a graph, and what it brings back.

use super::frame::Frame;
use super::window::Window;
use crate::config::{LightChoice, RenderConfig};
use crate::graph::{self, Desc, Graph, Image, Res, Run, Tap, Ticket};
use crate::layer::Layer;
use crate::methods::{Aov, FrameInfo, VplCounts};
use crate::scene::Feature;
use crate::techniques::{Kernels, compose, glare, tone_map};
use crate::vk::{self, Format};
use glam::DVec3;
use std::sync::Arc;

/// What a frame's passes leave behind.
pub(super) struct FrameResources {
    /// Beauty, then the layers asked for; with several pixel samples their means.
    images: Vec<Res<Image>>,
    vpls: Option<VplCounts>,
    regathered: Option<Res<graph::Buffer>>,
}

impl FrameResources {
    /// What several graphs have left, beauty first.
    pub(super) fn of(images: Vec<Res<Image>>) -> Self {
        Self { images, vpls: None, regathered: None }
    }
}

/// What decides a frame, once for all the graphs that draw it.
pub(super) struct Drawing {
    pub(super) config: RenderConfig,
    pub(super) kernels: Kernels,
    pub(super) window: Window,
    /// Layers beside beauty.
    pub(super) layers: Vec<Aov>,
    /// Where kernels' coordinates begin, in the file's (m).
    pub(super) origin: DVec3,
    /// As [`FrameInfo::free_path`].
    pub(super) free_path: Option<f32>,
}

impl Drawing {
    /// Records the method and the layers; with several pixel samples, adds sample number `sample` to `means`.
    pub(super) fn record(
        &self,
        g: &mut Graph,
        info: &FrameInfo,
        layers: &[Aov],
        means: &[Arc<vk::Image>],
        sample: u32,
    ) -> FrameResources {
        let Self { config, kernels, window, free_path, .. } = self;
        let info = &FrameInfo { free_path: *free_path, ..*info };
        let mut drawn = (config.method.record)(g, kernels, config, info);
        let mut images = vec![drawn.beauty];
        images.extend(layers.iter().map(|&aov| drawn.image(g, kernels, aov)));
        if window.extent != info.extent {
            let origin = [0, 1].map(|axis| window.origin[axis] - info.origin[axis]);
            images.iter_mut().for_each(|image| *image = compose::cut(g, *image, origin, window.extent));
        }
        for (image, mean) in images.iter_mut().zip(means) {
            let mean = g.import_image(mean.name().to_owned(), mean);
            compose::accumulate(g, *image, mean, sample);
            *image = mean;
        }
        FrameResources { images, vpls: drawn.vpls, regathered: drawn.regathered }
    }
}

/// The kernels for a frame, which model these, too.
pub(super) fn modelling(kernels: Kernels, config: &RenderConfig, features: &[Feature]) -> Kernels {
    let kernels = kernels.modelling(features);
    let kernels = if config.shadow_terminator { kernels } else { kernels.without_curves() };
    let kernels = if config.panes { kernels } else { kernels.without_panes() };
    let by_power = config.light_choice == LightChoice::Power;
    let kernels = if by_power { kernels.without_light_tree() } else { kernels };
    (config.method.kernels)(kernels, config)
}

/// A picture for a screen and its exposure, which glare leaves as it is.
pub(super) fn display(
    g: &mut Graph,
    config: &RenderConfig,
    radiance: Res<Image>,
) -> (Res<Image>, Res<graph::Buffer>) {
    let exposure = tone_map::exposure(g, &config.tone_map, radiance);
    let spread = glare::glare(g, &config.glare, radiance, config.size[1]);
    (tone_map::tone_map(g, &config.tone_map, spread, exposure), exposure)
}

/// Asks for what each `PASS:RESOURCE` names.
pub(super) fn taps(g: &mut Graph, specs: &[String]) -> Result<Vec<(String, Tap)>, graph::Error> {
    specs.iter().map(|spec| Ok((spec.clone(), g.tap(spec)?))).collect()
}

/// Promises of everything a frame brings back.
pub(super) struct Tickets {
    images: Vec<Ticket<[f32; 4]>>,
    display: Ticket<u8>,
    exposure: Ticket<f32>,
    vpls: Option<(Ticket<u32>, VplCounts)>,
    regathered: Option<Ticket<u32>>,
}

impl Tickets {
    /// None where no `picture` is wanted: then everything is made and left on the device.
    pub(super) fn take(
        g: &mut Graph,
        config: &RenderConfig,
        recorded: FrameResources,
        picture: bool,
    ) -> Option<Self> {
        let (display, exposure) = display(g, config, recorded.images[0]);
        if !picture {
            recorded.images.into_iter().for_each(|image| g.keep(image));
            g.keep(display);
            return None;
        }
        Some(Self {
            images: recorded.images.iter().map(|&image| g.read_image(image)).collect(),
            display: g.read_image(display),
            exposure: g.read_buffer(exposure),
            vpls: recorded.vpls.map(|vpls| (g.read_buffer(vpls.count), vpls)),
            regathered: recorded.regathered.map(|args| g.read_buffer(args)),
        })
    }

    pub(super) fn redeem(self, run: &mut Run, drawing: &Drawing, taps: Vec<(String, Tap)>) -> Frame {
        let [width, height] = drawing.window.extent;
        let mut images =
            self.images.into_iter().map(|ticket| run.take(ticket)).collect::<Vec<_>>().into_iter();
        let layer = |texels: Vec<[f32; 4]>, channels: std::ops::Range<usize>| Layer {
            width,
            height,
            channels: channels.len(),
            data: texels.iter().flat_map(|texel| texel[channels.clone()].iter().copied()).collect(),
        };
        let beauty = layer(images.next().unwrap_or_default(), 0..3);
        let aovs = drawing.layers.iter().zip(images).map(|(&aov, mut texels)| {
            if aov == Aov::P && drawing.origin != DVec3::ZERO {
                texels.iter_mut().for_each(|texel| *texel = in_file(*texel, drawing.origin));
            }
            (aov, layer(texels, aov.first_channel()..aov.first_channel() + aov.channels()))
        });
        let aovs = aovs.collect();
        let taps = taps.into_iter().map(|(spec, tap)| (spec, tapped(run, tap))).collect();
        let (vpl_count, path_count, min_distance) = match self.vpls {
            Some((ticket, vpls)) => {
                (run.take(ticket).first().copied(), Some(vpls.paths), Some(vpls.min_distance))
            }
            None => (None, None, None),
        };
        Frame {
            beauty,
            display: run.take(self.display),
            exposure_ev: run.take(self.exposure).first().copied().unwrap_or_default(),
            aovs,
            taps,
            vpl_count,
            regathered: self.regathered.and_then(|ticket| run.take(ticket).last().copied()),
            path_count,
            min_distance,
            ..Frame::default()
        }
    }
}

/// A position in the file's coordinates; the fourth number is the share of samples that hit something.
fn in_file([x, y, z, hit]: [f32; 4], origin: DVec3) -> [f32; 4] {
    (DVec3::new(x.into(), y.into(), z.into()) + origin * f64::from(hit)).as_vec3().extend(hit).to_array()
}

/// Images keep their shape, buffers become a row of words; integers keep their bits.
fn tapped(run: &mut Run, tap: Tap) -> Layer {
    let bytes = run.take(tap.ticket);
    let words = || bytes.chunks_exact(4).map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]])).collect();
    match tap.desc {
        Desc::Image(desc) => {
            let data: Vec<f32> = match desc.format {
                Format::Rgba8Unorm => bytes.iter().map(|&b| f32::from(b) / 255.0).collect(),
                Format::Rgba16Float => {
                    let halves = bytes.chunks_exact(2).map(|b| half::f16::from_ne_bytes([b[0], b[1]]));
                    halves.map(half::f16::to_f32).collect()
                }
                _ => words(),
            };
            let [width, height] = desc.extent;
            Layer { width, height, channels: data.len() / (width as usize * height as usize), data }
        }
        Desc::Buffer(_) | Desc::Scene => {
            let data: Vec<f32> = words();
            Layer { width: data.len() as u32, height: 1, channels: 1, data }
        }
    }
}
