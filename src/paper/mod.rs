//! The experiment of Marques & Santos 2010 (§5) on any scene: its four approaches and ours at 180, 90 and 30 VPLs,
//! what each costs, stage by stage, and how far its picture is from that of the unaccelerated approach.
//!
//! Errors are stated twice: against the canonical approach at 180 VPLs, which shows what the accelerations alone do,
//! and against the same approach at 4096 VPLs of another seed, which shows what is left to gain. Where nothing sets
//! `min_distance` it shrinks as VPLs grow in number, so the second also holds the light that the distance costs.

mod markdown;
mod measure;

pub use measure::{AMPLIFICATION, Component, LayerErrors, PictureError, difference};

use crate::config::{ConfigError, RenderConfig};
use crate::renderer::{self, Aov, Frame, FrameRequest, Progress, Renderer, RendererOptions};
use crate::scene::Camera;
use crate::{accel::StructureReport, vk::DeviceInfo};
use measure::{Layers, components};
use std::sync::atomic::AtomicBool;

/// Numbers of VPLs that are compared. The first is that of the pictures and of the canonical one.
pub const VPLS: [u32; 3] = [180, 90, 30];

/// VPLs of the reference.
pub const REFERENCE_VPLS: u32 = 4096;

/// Where the paper's own numbers come from, and what they are not.
pub const PUBLISHED: &str = "Marques & Santos 2010, figures 6 and 7: frames a second on a GeForce GTX 480 at 800x600 \
    and 180 VPLs, in their version of this scene with settings that they give in part";

/// One way to render what all of them render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Approach {
    /// Its preset in [`crate::config::PRESETS`].
    pub preset: &'static str,
    /// Its name in tables.
    pub label: &'static str,
    /// Whether it is ours; the others are the paper's, each with all that the one before it has.
    pub ours: bool,
}

/// What is compared; the first is the canonical one.
pub const APPROACHES: [Approach; 5] = [
    Approach { preset: "paper-canonical", label: "canonical", ours: false },
    Approach { preset: "paper-imperfect", label: "+ imperfect visibility", ours: false },
    Approach { preset: "paper-downsampled", label: "+ 4x4 downsampling", ours: false },
    Approach { preset: "paper-interleaved", label: "+ 3x3 interleaving", ours: false },
    Approach { preset: "fast", label: "fast (ours)", ours: true },
];

impl Approach {
    /// File name of its picture.
    #[must_use]
    pub fn picture(&self) -> String {
        format!("{}.png", self.preset)
    }

    /// File name of its difference from the canonical picture, which itself has none.
    #[must_use]
    pub fn difference(&self) -> Option<String> {
        (*self != APPROACHES[0]).then(|| format!("{}-difference.png", self.preset))
    }

    /// Frames a second that the paper publishes: for scenes named `conference…` and `office…`, at 180 VPLs.
    #[must_use]
    pub fn published_fps(&self, scene: &str, vpls: u32) -> Option<f64> {
        let scene = scene.to_lowercase();
        let fps = match () {
            () if vpls != 180 => return None,
            () if scene.starts_with("conference") => [0.26, 0.56, 2.25, 2.79],
            () if scene.starts_with("office") => [0.64, 0.96, 5.36, 7.63],
            () => return None,
        };
        APPROACHES.iter().zip(fps).find(|(approach, _)| *approach == self).map(|(_, fps)| fps)
    }

    fn config(&self, base: &RenderConfig, vpls: u32) -> Result<RenderConfig, ConfigError> {
        let mut config = base.clone();
        config.apply_preset(self.preset)?;
        config.vpl_shoot.vpls = vpls;
        Ok(config)
    }
}

/// How the experiment is done.
#[derive(Clone, Copy)]
pub struct Experiment<'a> {
    /// Everything that the presets leave alone: size, seed, bounces, `min_distance`.
    pub base: &'a RenderConfig,
    /// Where the scene is seen from.
    pub camera: &'a Camera,
    /// As for [`FrameRequest::repeat`]; the reference, which is not timed, is rendered once.
    pub repeat: u32,
    /// Set to stop between submits.
    pub cancel: Option<&'a AtomicBool>,
    /// Told what is being done.
    pub progress: Option<&'a dyn Fn(Progress<'_>)>,
}

/// The experiment's outcome as far as it has come.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Version of the program.
    pub parhelion: &'static str,
    /// Whether every row is there.
    pub complete: bool,
    /// The scene.
    pub scene: SceneFacts,
    /// The camera's name.
    pub camera: String,
    /// The device.
    pub device: DeviceInfo,
    /// Its driver, for people.
    pub driver: String,
    /// What traced rays, and why.
    pub backend: BackendFacts,
    /// Settings that the presets were applied to.
    pub base: RenderConfig,
    /// Renders after the warm-up that times are medians of; 0: one render.
    pub repeat: u32,
    /// Exposure of all pictures (stops): the canonical picture's own.
    pub exposure_ev: f32,
    /// The picture with most VPLs, once it is there.
    pub reference: Option<Reference>,
    /// What was built to trace rays in.
    pub structures: Vec<StructureReport>,
    /// Where published numbers come from; absent where no row has any.
    pub published: Option<&'static str>,
    /// One for each number of VPLs and approach, in the order they were rendered.
    pub rows: Vec<Row>,
}

/// What a scene is.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SceneFacts {
    /// Its name.
    pub name: String,
    /// Triangles in the world.
    pub triangles: usize,
    /// Lights other than emissive surfaces.
    pub lights: usize,
}

/// What traced rays.
#[derive(Clone, Debug, serde::Serialize)]
pub struct BackendFacts {
    /// Its word.
    pub name: &'static str,
    /// Why it was chosen.
    pub reason: String,
}

/// The canonical approach with [`REFERENCE_VPLS`].
#[derive(Clone, Debug, serde::Serialize)]
pub struct Reference {
    /// VPLs asked for.
    pub vpls: u32,
    /// VPLs that exist.
    pub vpl_count: u32,
    /// Its seed, no row's.
    pub seed: u32,
    /// Distance below which light is left out (m).
    pub min_distance: f32,
}

/// One approach with one number of VPLs.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Row {
    /// The preset.
    pub approach: &'static str,
    /// Its name in tables.
    pub label: &'static str,
    /// Whether it is ours and not the paper's.
    pub ours: bool,
    /// VPLs asked for.
    pub vpls: u32,
    /// VPLs that exist.
    pub vpl_count: u32,
    /// Distance below which light is left out (m).
    pub min_distance: f32,
    /// Rays traced.
    pub rays: u64,
    /// Pixels gathered by themselves because no filter could serve them; absent where that never happens.
    pub regathered: Option<u32>,
    /// Milliseconds a frame, on the device where it has timestamps.
    pub frame_ms: f64,
    /// Frames a second.
    pub fps: f64,
    /// Time of the canonical approach with as many VPLs, divided by this one's.
    pub speed_up: f64,
    /// Where the time goes.
    pub components: Vec<Component>,
    /// Distance from other pictures.
    pub error: RowErrors,
    /// What the paper reports.
    pub published: Option<PublishedRate>,
    /// File name of its picture, where one is kept.
    pub picture: Option<String>,
    /// File name of its difference from the canonical picture.
    pub difference: Option<String>,
}

/// How far a picture is from two others.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct RowErrors {
    /// From the canonical approach at 180 VPLs.
    pub canonical: LayerErrors,
    /// From the reference; absent until there is one.
    pub reference: Option<LayerErrors>,
}

/// A number of the paper, not ours.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct PublishedRate {
    /// Frames a second.
    pub fps: f64,
    /// Over the paper's own canonical approach.
    pub speed_up: f64,
}

/// Pictures of a row just finished, sRGB and RGBA, under the exposure of the canonical one.
#[derive(Clone, Copy, Debug)]
pub struct Pictures<'a> {
    /// The row's own picture.
    pub display: &'a [u8],
    /// Its amplified difference from the canonical one ([`difference`]), unless it is that one.
    pub difference: Option<&'a [u8]>,
}

/// Does the experiment. `finished` gets the report after each row, with pictures where the row has any, and once
/// after the reference, which comes second; its error ends the experiment.
///
/// Every approach is first rendered small, so that no row's time holds a compilation or the building of a structure.
///
/// # Errors
/// As for [`Renderer::render`], and those of `finished`.
pub fn run<E: From<renderer::Error>>(
    renderer: &mut Renderer,
    experiment: &Experiment<'_>,
    mut finished: impl FnMut(&Report, Option<(&Row, Pictures<'_>)>) -> Result<(), E>,
) -> Result<Report, E> {
    let canonical = APPROACHES[0];
    let mut steps = Steps::of(experiment).map_err(renderer::Error::from)?;
    for approach in APPROACHES {
        let [width, height] = experiment.base.size;
        let base = RenderConfig { size: [width.min(64), height.min(48)], ..experiment.base.clone() };
        let config = approach.config(&base, VPLS[0]).map_err(renderer::Error::from)?;
        let request = FrameRequest { cancel: experiment.cancel, ..FrameRequest::default() };
        renderer.render(&config, experiment.camera, &request)?;
    }
    let config = canonical.config(experiment.base, VPLS[0]).map_err(renderer::Error::from)?;
    let exposure_ev = steps.render(renderer, "exposure", &config, 0)?.exposure_ev;
    let base = RenderConfig {
        tone_map: crate::techniques::tone_map::ToneMapConfig {
            exposure: Some(exposure_ev),
            ..experiment.base.tone_map.clone()
        },
        ..experiment.base.clone()
    };

    let mut report = Report::new(renderer, experiment, exposure_ev);
    let mut canonical_picture: Option<(Layers, Vec<u8>)> = None;
    let mut reference: Option<Layers> = None;
    for vpls in VPLS {
        let mut canonical_ms = None;
        for approach in APPROACHES {
            let config = approach.config(&base, vpls).map_err(renderer::Error::from)?;
            let frame = steps.render(renderer, approach.preset, &config, experiment.repeat)?;
            let layers = Layers::of(&frame);
            let (of_canonical, its_display) =
                canonical_picture.get_or_insert_with(|| (layers.clone(), frame.display.clone()));
            let errors = RowErrors {
                canonical: layers.errors(of_canonical),
                reference: reference.as_ref().map(|reference| layers.errors(reference)),
            };
            let mut row = Row::new(&approach, &report.scene.name, vpls, &frame, errors);
            row.speed_up = *canonical_ms.get_or_insert(row.frame_ms) / row.frame_ms;
            let pictured = vpls == VPLS[0];
            if pictured {
                row.picture = Some(approach.picture());
                row.difference = approach.difference();
            }
            let difference = row.difference.is_some().then(|| difference(&frame.display, its_display));
            report.push(row, renderer);
            let row = report.rows.last().filter(|_| pictured);
            let pictures = Pictures { display: &frame.display, difference: difference.as_deref() };
            finished(&report, row.map(|row| (row, pictures)))?;

            if reference.is_none() {
                let mut config = canonical.config(&base, REFERENCE_VPLS).map_err(renderer::Error::from)?;
                config.seed = config.seed.wrapping_add(1);
                let frame = steps.render(renderer, "reference", &config, 0)?;
                let layers = Layers::of(&frame);
                for row in &mut report.rows {
                    row.error.reference = Some(of_canonical.errors(&layers));
                }
                report.reference = Some(Reference {
                    vpls: REFERENCE_VPLS,
                    vpl_count: frame.vpl_count.unwrap_or_default(),
                    seed: config.seed,
                    min_distance: frame.min_distance.unwrap_or_default(),
                });
                reference = Some(layers);
                finished(&report, None)?;
            }
        }
    }
    Ok(report)
}

impl Report {
    fn new(renderer: &Renderer, experiment: &Experiment<'_>, exposure_ev: f32) -> Self {
        let scene = renderer.scene();
        let info = renderer.device().info();
        let (backend, reason) = renderer.backend();
        let triangles =
            crate::scene::SceneProfile::of(scene, experiment.base.whitted.mirror_roughness).triangles;
        Self {
            parhelion: env!("CARGO_PKG_VERSION"),
            complete: false,
            scene: SceneFacts { name: scene.name.clone(), triangles, lights: scene.lights.len() },
            camera: experiment.camera.name.clone(),
            device: info.clone(),
            driver: info.driver(),
            backend: BackendFacts { name: backend.name(), reason: reason.into() },
            base: experiment.base.clone(),
            repeat: experiment.repeat,
            exposure_ev,
            reference: None,
            structures: Vec::new(),
            published: None,
            rows: Vec::new(),
        }
    }

    fn push(&mut self, row: Row, renderer: &Renderer) {
        self.published = self.published.or(row.published.map(|_| PUBLISHED));
        self.rows.push(row);
        self.structures = renderer.structures().to_vec();
        self.complete = self.rows.len() == VPLS.len() * APPROACHES.len();
    }
}

impl Row {
    fn new(approach: &Approach, scene: &str, vpls: u32, frame: &Frame, error: RowErrors) -> Self {
        let frame_ms = frame.total_ms.unwrap_or(frame.wall_ms);
        let published = approach.published_fps(scene, vpls).zip(APPROACHES[0].published_fps(scene, vpls));
        Self {
            approach: approach.preset,
            label: approach.label,
            ours: approach.ours,
            vpls,
            vpl_count: frame.vpl_count.unwrap_or_default(),
            min_distance: frame.min_distance.unwrap_or_default(),
            rays: frame.rays,
            regathered: frame.regathered,
            frame_ms,
            fps: 1e3 / frame_ms,
            speed_up: 1.0,
            components: components(&frame.passes),
            error,
            published: published.map(|(fps, canonical)| PublishedRate { fps, speed_up: fps / canonical }),
            picture: None,
            difference: None,
        }
    }
}

/// How much of all rendering is done, counted in shadow rays from gather samples.
struct Steps<'a> {
    experiment: &'a Experiment<'a>,
    done: f64,
    all: f64,
}

impl<'a> Steps<'a> {
    fn of(experiment: &'a Experiment<'a>) -> Result<Self, ConfigError> {
        let canonical = |vpls| APPROACHES[0].config(experiment.base, vpls);
        let mut all = cost(&canonical(VPLS[0])?, 0) + cost(&canonical(REFERENCE_VPLS)?, 0);
        for vpls in VPLS {
            for approach in APPROACHES {
                all += cost(&approach.config(experiment.base, vpls)?, experiment.repeat);
            }
        }
        Ok(Self { experiment, done: 0.0, all })
    }

    fn render(
        &mut self,
        renderer: &mut Renderer,
        what: &str,
        config: &RenderConfig,
        repeat: u32,
    ) -> Result<Frame, renderer::Error> {
        let cost = cost(config, repeat);
        let progress = |progress: Progress<'_>| {
            if let Some(report) = self.experiment.progress {
                let pass = format!("{what}, {} VPLs: {}", config.vpl_shoot.vpls, progress.pass);
                report(Progress { pass: &pass, done: (self.done + cost * progress.done) / self.all });
            }
        };
        let request = FrameRequest {
            // Not `indirect`: that layer is a pass of its own, which would be timed with the others.
            aovs: &[Aov::Albedo, Aov::Irradiance],
            repeat,
            cancel: self.experiment.cancel,
            progress: Some(&progress),
            ..FrameRequest::default()
        };
        let frame = renderer.render(config, self.experiment.camera, &request)?;
        self.done += cost;
        Ok(frame)
    }
}

fn cost(config: &RenderConfig, repeat: u32) -> f64 {
    let side = config.indirect.downsample * config.indirect.interleave;
    f64::from(config.vpl_shoot.vpls) / f64::from(side * side) * f64::from(1 + repeat)
}

/// What a renderer for the experiment is made with: a backend that has every approach's visibility.
#[must_use]
pub fn renderer_options(backend: renderer::BackendChoice) -> RendererOptions {
    let visibility = crate::techniques::indirect::Visibility::Boxes;
    RendererOptions { backend, visibility, ..RendererOptions::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_numbers_belong_to_the_papers_scenes_and_approaches() {
        let [canonical, _, _, interleaved, fast] = APPROACHES;
        assert_eq!(canonical.published_fps("conference_4pt", 180), Some(0.26));
        assert_eq!(interleaved.published_fps("Office", 180), Some(7.63));
        for (approach, scene, vpls) in [
            (canonical, "cornell", 180),
            (canonical, "office", 90),
            (fast, "office", 180),
            (fast, "my office", 180),
        ] {
            assert_eq!(approach.published_fps(scene, vpls), None, "{scene}, {vpls}");
        }
    }

    #[test]
    fn every_approach_is_a_preset_and_the_first_accelerates_nothing() {
        for approach in APPROACHES {
            let config = approach.config(&RenderConfig::default(), 30).unwrap();
            config.validate().unwrap();
            assert_eq!(config.vpl_shoot.vpls, 30);
            assert_eq!(approach.difference().is_none(), approach == APPROACHES[0]);
        }
        let canonical = APPROACHES[0].config(&RenderConfig::default(), VPLS[0]).unwrap();
        assert!(!canonical.indirect.filtered() && canonical.indirect.boxes().is_none());
    }
}
