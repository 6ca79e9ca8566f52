//! Picks method and settings for a time or an error from a scene's front: that of a chart, or one that a quick probe of
//! small renders predicts.

use super::answer::error_of;
use super::data::{Chart, Point};
use super::grid;
use super::reference::{self, ReferenceRequest};
use super::sweep::Noise;
use crate::ErrorClass;
use crate::config::{ConfigError, RenderConfig};
use crate::files;
use crate::methods::{self, REGISTRY, Sweeps};
use crate::metrics;
use crate::read;
use crate::renderer::{self, FrameRequest, Progress, Renderer};
use crate::scene::Camera;
use crate::vk::{self, DeviceKind};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wish {
    /// At most so many milliseconds a frame.
    Ms(f64),
    /// At most this relMSE.
    RelMse(f64),
}

/// A setting and what it is predicted to come to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// In few words.
    pub label: String,
    /// As [`grid::config`] takes them.
    pub settings: BTreeMap<String, Value>,
    /// Milliseconds of a warm frame.
    pub ms: f64,
    /// relMSE against the reference.
    pub rel_mse: f64,
}

/// What settings are predicted to come to, for one scene, camera, size, device and backend.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Front {
    /// What the predictions come from, in words.
    pub about: String,
    /// The settings.
    pub candidates: Vec<Candidate>,
}

/// What was picked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice<'a> {
    /// The setting.
    pub candidate: &'a Candidate,
    /// Whether it is predicted to fulfil the wish; otherwise it is the nearest to it.
    pub fulfils: bool,
}

/// The least error within the time, or the least time within the error; where nothing is, the fastest, or the most
/// exact. None of no candidates.
#[must_use]
pub fn choose(candidates: &[Candidate], wish: Wish) -> Option<Choice<'_>> {
    let fulfils = |candidate: &&Candidate| match wish {
        Wish::Ms(ms) => candidate.ms <= ms,
        Wish::RelMse(error) => candidate.rel_mse <= error,
    };
    let (time, error) = (|c: &&Candidate| c.ms, |c: &&Candidate| c.rel_mse);
    let fitting = candidates.iter().filter(fulfils);
    let best = match wish {
        Wish::Ms(_) => fitting.min_by(|a, b| error(a).total_cmp(&error(b)).then(time(a).total_cmp(&time(b)))),
        Wish::RelMse(_) => {
            fitting.min_by(|a, b| time(a).total_cmp(&time(b)).then(error(a).total_cmp(&error(b))))
        }
    };
    let nearest = || match wish {
        Wish::Ms(_) => candidates.iter().min_by(|a, b| time(a).total_cmp(&time(b))),
        Wish::RelMse(_) => candidates.iter().min_by(|a, b| error(a).total_cmp(&error(b))),
    };
    best.map(|candidate| Choice { candidate, fulfils: true })
        .or_else(|| nearest().map(|candidate| Choice { candidate, fulfils: false }))
}

impl Front {
    /// The points of a chart with their errors as [`error_of`] has them, their times in proportion to the pixels of `size`, and progressive methods
    /// with more samples than were charted.
    #[must_use]
    pub fn of_chart(chart: &Chart, size: [u32; 2]) -> Self {
        let pixels = |[width, height]: [u32; 2]| f64::from(width) * f64::from(height);
        let scale = pixels(size) / pixels(chart.size);
        let candidate = |point: &Point| {
            Some(Candidate {
                label: point.label.clone(),
                settings: point.settings.clone(),
                ms: point.ms.median * scale,
                rel_mse: error_of(point, chart.reference.noise)?.0,
            })
        };
        let candidates = chart.points.iter().filter_map(candidate).collect();
        let [width, height] = chart.size;
        let scaled = if scale == 1.0 { "" } else { ", times in proportion to pixels" };
        let about = format!(
            "a chart of {} settings at {width}x{height} on {}{scaled}",
            chart.points.len(),
            chart.device
        );
        Self { about, candidates }.with_more_samples()
    }

    /// Adds progressive methods with more samples than there is, a fifth more each: their time grows in proportion, their
    /// error falls so.
    fn with_more_samples(mut self) -> Self {
        for method in REGISTRY {
            if let Some(progressive) = &method.progressive {
                self.candidates.extend(self.more_samples(method.name, progressive.key));
            }
        }
        self
    }

    fn more_samples(&self, method: &str, key: &str) -> Vec<Candidate> {
        let samples = |candidate: &Candidate| candidate.settings.get(key).and_then(Value::as_u64);
        let same = |a: &Candidate, b: &Candidate| {
            let rest = |candidate: &Candidate| {
                let mut settings = candidate.settings.clone();
                settings.remove(key);
                settings
            };
            rest(a) == rest(b)
        };
        let most = |candidate: &&Candidate| {
            let longer = |other: &Candidate| same(candidate, other) && samples(other) > samples(candidate);
            samples(candidate).is_some() && !self.candidates.iter().any(longer)
        };
        let name = key.rsplit('.').next().unwrap_or(key);
        let mut more = Vec::new();
        for least in self.candidates.iter().filter(most) {
            let first = samples(least).unwrap_or(1);
            let longer = (1..=64)
                .map(|quarter| (first as f64 * 2.0_f64.powf(f64::from(quarter) / 4.0)).round() as u64);
            let mut last = first;
            for samples in longer.filter(|&samples| samples <= u64::from(crate::config::MAX_SPP)) {
                if std::mem::replace(&mut last, samples) == samples {
                    continue;
                }
                let mut settings = least.settings.clone();
                settings.insert(key.into(), samples.into());
                let factor = samples as f64 / first as f64;
                more.push(Candidate {
                    label: format!("{method} {name}={samples}"),
                    settings,
                    ms: least.ms * factor,
                    rel_mse: least.rel_mse / factor,
                });
            }
        }
        more
    }

    /// The front that a chart or probe left behind for this scene, camera, size, device and backend.
    #[must_use]
    pub fn cached(renderer: &Renderer, camera: &Camera, size: [u32; 2]) -> Option<Self> {
        serde_json::from_slice(&read::regular(&cache_file(renderer, camera, size)?, read::RESULTS).ok()?).ok()
    }

    /// Leaves the front for [`Front::cached`].
    pub fn remember(&self, renderer: &Renderer, camera: &Camera, size: [u32; 2]) {
        let Some(file) = cache_file(renderer, camera, size) else { return };
        let text = serde_json::to_vec(self).unwrap_or_default();
        // A cache that cannot be written is only slower next time.
        if let Err(error) = files::write_cache(&file, &text) {
            tracing::debug!("{}: {error}", file.display());
        }
    }
}

fn cache_file(renderer: &Renderer, camera: &Camera, [width, height]: [u32; 2]) -> Option<PathBuf> {
    let (scene, backend) = (renderer.scene().fingerprint(camera), renderer.backend().0.name());
    let (device, version) = (&renderer.device().info().uuid, env!("CARGO_PKG_VERSION"));
    let name = format!("{scene:016x}-{width}x{height}-{device}-{backend}-{version}.json");
    Some(vk::cache_folder()?.join("fronts").join(name))
}

/// How a probe is done.
#[derive(Clone, Copy)]
pub struct Probe<'a> {
    /// Where the scene is seen from.
    pub camera: &'a Camera,
    /// Pixels of the picture that is to be predicted.
    pub size: [u32; 2],
    /// Set to stop.
    pub cancel: Option<&'a AtomicBool>,
    /// Told what is being done.
    pub progress: Option<&'a dyn Fn(Progress<'_>)>,
}

/// Samples a pixel of a probe's reference on a CPU, …
const REFERENCE: u32 = 128;

/// … and elsewhere time for them: errors near its noise cannot be told apart.
const REFERENCE_TIME: Duration = Duration::from_secs(10);

/// Predicts a front by small renders. On a CPU, where time is short, of an eighth and a quarter of the picture's width and
/// height: times follow by the line through both, errors are taken as they are. Elsewhere of the picture's own size, since
/// a GPU is not busy with less, and of more settings.
///
/// # Errors
/// As for [`Renderer::render`].
pub fn probe(renderer: &mut Renderer, probe: &Probe<'_>) -> Result<Front, renderer::Error> {
    let cpu = renderer.device().info().kind == DeviceKind::Cpu;
    let part = |divisor: u32| probe.size.map(|side| (side / divisor).max(side.min(32)));
    let sizes = if cpu { vec![part(8), part(4)] } else { vec![probe.size] };
    let largest = sizes[sizes.len() - 1];
    let base = base(probe.size);
    let settings =
        probed(&base, !cpu).map_err(|problem| ConfigError::Value { key: "grid".into(), problem })?;
    let steps = 1 + settings.len();
    let report = |step: usize, progress: Progress<'_>| {
        if let Some(report) = probe.progress {
            report(Progress { pass: "probe", done: (step as f64 + progress.done) / steps as f64 });
        }
    };
    let request = ReferenceRequest {
        camera: probe.camera,
        size: largest,
        spp: cpu.then_some(REFERENCE),
        time: REFERENCE_TIME,
        depth: reference::DEPTH,
        file: std::path::Path::new(""),
        cancel: probe.cancel,
        progress: Some(&|progress: Progress<'_>| report(0, progress)),
    };
    let reference = reference::render(renderer, &request)?;
    let noise = Noise::of(&reference);
    let mut candidates = Vec::new();
    for (index, setting) in settings.into_iter().enumerate() {
        let mut times = Vec::new();
        let mut rel_mse = f64::NAN;
        for size in &sizes {
            let config = RenderConfig { size: *size, ..setting.config.clone() };
            let progress = |progress: Progress<'_>| report(1 + index, progress);
            let request = FrameRequest {
                repeat: 2,
                cancel: probe.cancel,
                progress: Some(&progress),
                ..FrameRequest::default()
            };
            let frame = match renderer.render(&config, probe.camera, &request) {
                Err(error) if error.class() == ErrorClass::Interrupted => return Err(error),
                Err(error) => {
                    tracing::debug!("{}: {error}", setting.label);
                    break;
                }
                Ok(frame) => frame,
            };
            times.push((pixels(*size), frame.total_ms.unwrap_or(frame.wall_ms)));
            if *size == largest {
                let measured = metrics::rel_mse(&frame.beauty.data, &reference.layer.data);
                rel_mse = noise.subtracted("rel_mse", measured);
            }
        }
        if rel_mse.is_finite() {
            let ms = at(&times, pixels(probe.size));
            candidates.push(Candidate { label: setting.label, settings: setting.settings, ms, rel_mse });
        }
    }
    let words: Vec<_> = sizes.iter().map(|[width, height]| format!("{width}x{height}")).collect();
    let line = if cpu { ", times by the line through both" } else { "" };
    let about = format!("a probe at {}{line}", words.join(" and "));
    Ok(Front { about, candidates }.with_more_samples())
}

/// What a probe tries of every method.
pub(crate) fn probed(base: &RenderConfig, finer: bool) -> Result<Vec<grid::Setting>, String> {
    let mut settings = Vec::new();
    for Sweeps { probe, finer: beside, .. } in REGISTRY.iter().map(|method| &method.sweeps) {
        let texts = [*probe, if finer { beside } else { "" }];
        for text in texts.into_iter().filter(|text| !text.is_empty()) {
            settings.extend(grid::parse(text, base)?);
        }
    }
    Ok(settings)
}

/// What a chart begins with too: pixels' centres, and all light there is.
fn base(size: [u32; 2]) -> RenderConfig {
    let mut base = RenderConfig { size, ..RenderConfig::default() };
    methods::comparable(&mut base, Some(reference::DEPTH));
    base
}

fn pixels([width, height]: [u32; 2]) -> f64 {
    f64::from(width) * f64::from(height)
}

/// Milliseconds for so many pixels, by the line through the first and the last (pixels, milliseconds); never one that
/// falls, nor one that begins below 0.
fn at(times: &[(f64, f64)], pixels: f64) -> f64 {
    match (times.first(), times.last()) {
        (Some(&(p0, t0)), Some(&(p1, t1))) if p1 > p0 => {
            let slope = ((t1 - t0) / (p1 - p0)).clamp(0.0, t1 / p1);
            t1 + slope * (pixels - p1)
        }
        (_, Some(&(p, t))) => t * pixels / p,
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::answer::tests::point;
    use crate::chart::data::{Reference, SCHEMA};
    use proptest::prelude::*;

    fn candidate(label: &str, ms: f64, rel_mse: f64) -> Candidate {
        Candidate { label: label.into(), settings: BTreeMap::new(), ms, rel_mse }
    }

    proptest! {
        /// Nothing fits better; where nothing fits, nothing is nearer.
        #[test]
        fn no_other_choice_is_better(
            pairs in prop::collection::vec((1_u16..50, 1_u16..50), 1..30),
            limit in 0_u16..60,
        ) {
            let all: Vec<_> = pairs.iter().map(|&(ms, e)| candidate("", ms.into(), e.into())).collect();
            let limit = f64::from(limit);
            let time = choose(&all, Wish::Ms(limit)).unwrap();
            let fits = |c: &&Candidate| c.ms <= limit;
            prop_assert_eq!(time.fulfils, all.iter().any(|c| fits(&c)));
            if time.fulfils {
                prop_assert!(fits(&time.candidate));
                prop_assert!(all.iter().filter(fits).all(|c| c.rel_mse >= time.candidate.rel_mse));
            } else {
                prop_assert!(all.iter().all(|c| c.ms >= time.candidate.ms));
            }
            let error = choose(&all, Wish::RelMse(limit)).unwrap();
            let fits = |c: &&Candidate| c.rel_mse <= limit;
            prop_assert_eq!(error.fulfils, all.iter().any(|c| fits(&c)));
            if error.fulfils {
                prop_assert!(fits(&error.candidate));
                prop_assert!(all.iter().filter(fits).all(|c| c.ms >= error.candidate.ms));
            } else {
                prop_assert!(all.iter().all(|c| c.rel_mse >= error.candidate.rel_mse));
            }
        }
    }

    /// A front whose cost is rays traced: VPLs cost a ray each and leave a bias, paths ten each and leave none.
    fn chart(size: [u32; 2]) -> Chart {
        let rays = |a_pixel: f64| pixels(size) * a_pixel / 1e4;
        let vpls =
            [30.0, 90.0, 180.0, 720.0].map(|n| point(&format!("{n} VPLs"), rays(n / 9.0), 0.04 + 2.0 / n));
        let paths = [1.0, 4.0, 16.0].map(|n| {
            let mut point = point(&format!("{n} paths"), rays(10.0 * n), 2.0 / n);
            point.settings = BTreeMap::from([
                ("method".to_owned(), "path".into()),
                ("path_trace.spp".to_owned(), Value::from(n as u64)),
            ]);
            point
        });
        let mut points: Vec<_> = vpls.into_iter().chain(paths).collect();
        // Too good to be told from the reference, whose noise is all that is known of it.
        points.push(Point { ranked: false, ..point("lucky", 0.001, 1e-6) });
        let text = |text: &str| text.to_owned();
        Chart {
            schema: SCHEMA,
            version: text("1"),
            scene: text("s"),
            fingerprint: text("f"),
            triangles: 1,
            camera: text("c"),
            size,
            device: text("rays"),
            driver: text(""),
            backend: text("software"),
            reference: Reference {
                about: text(""),
                spp: None,
                noise: Some(0.9),
                bias_se: None,
                image: text(""),
            },
            metrics: Vec::new(),
            points,
            complete: true,
            failures: Vec::new(),
            answers: Vec::new(),
            images: BTreeMap::new(),
        }
    }

    /// No test machine has a GPU's time.
    #[test]
    fn finer_settings_are_others_than_those_of_every_probe() {
        let base = base([64, 48]);
        let coarse = probed(&base, false).unwrap();
        let mut all = probed(&base, true).unwrap();
        all.retain(|setting| coarse.iter().all(|other| other.config != setting.config));
        assert_eq!(all.len(), probed(&base, true).unwrap().len() - coarse.len());
        for method in REGISTRY {
            assert!(coarse.iter().any(|setting| setting.config.method == *method), "{}", method.name);
        }
        let finer = |method: &str| all.iter().filter(|setting| setting.config.method.name == method).count();
        assert_eq!((finer("igi"), finer("path")), (8, 0));
    }

    #[test]
    fn a_front_of_rays_answers_with_its_best() {
        let front = Front::of_chart(&chart([100, 100]), [100, 100]);
        let label = |wish| {
            let choice = choose(&front.candidates, wish).unwrap();
            (choice.candidate.label.as_str(), choice.fulfils)
        };
        assert_eq!(label(Wish::Ms(12.0)), ("igi 90 VPLs", true));
        assert_eq!(label(Wish::Ms(20.0)), ("igi 180 VPLs", true));
        assert_eq!(label(Wish::Ms(1.0)), ("igi lucky", true));
        assert_eq!(label(Wish::Ms(0.0)), ("igi lucky", false));
        assert_eq!(front.candidates[7].rel_mse, 0.9);
        assert_eq!(label(Wish::RelMse(0.055)), ("igi 180 VPLs", true));
        // VPLs keep their bias: only paths get there, with more samples than were measured.
        assert_eq!(label(Wish::RelMse(0.02)), ("path spp=108", true));
        let found = choose(&front.candidates, Wish::RelMse(0.02)).unwrap().candidate;
        assert!((found.ms - 1080.0).abs() < 1e-9 && (found.rel_mse - 2.0 / 108.0).abs() < 1e-12);
        assert_eq!(found.settings["path_trace.spp"], 108);
        assert_eq!(label(Wish::Ms(700.0)), ("path spp=64", true));
        assert!(choose(&[], Wish::Ms(1.0)).is_none());
    }

    #[test]
    fn another_size_takes_time_in_proportion() {
        let of = |size| Front::of_chart(&chart([100, 100]), size);
        let (same, large) = (of([100, 100]), of([200, 150]));
        assert!(large.about.contains("in proportion") && !same.about.contains("in proportion"));
        for (a, b) in same.candidates.iter().zip(&large.candidates) {
            assert!((b.ms / a.ms - 3.0).abs() < 1e-9 && a.rel_mse == b.rel_mse);
        }
    }

    #[test]
    fn a_line_through_two_sizes_keeps_its_fixed_part() {
        // 2 ms and 1 ms a thousand pixels.
        let times = [(1000.0, 3.0), (4000.0, 6.0)];
        assert!((at(&times, 16_000.0) - 18.0).abs() < 1e-9);
        // Slower than in proportion, by noise: in proportion.
        assert!((at(&[(1000.0, 1.0), (4000.0, 8.0)], 16_000.0) - 32.0).abs() < 1e-9);
        // Faster with more pixels, by noise: no slope.
        assert_eq!(at(&[(1000.0, 3.0), (4000.0, 2.0)], 16_000.0), 2.0);
        assert_eq!(at(&[(1000.0, 3.0)], 2000.0), 6.0);
    }
}
