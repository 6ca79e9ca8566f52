//! Measures every setting with every seed against the reference. Seeds take turns over all settings, so that a machine
//! that drifts drifts for all of them; what warms up is not counted.

use super::answer::{answers, front_of};
use super::data::{self, Chart, Failure, MetricInfo, PassTime, Point, Spread};
use super::grid::Setting;
use super::journal::{Entry, Header, Journal, Mean};
use super::{Reference, mean, picture, report, table};
use crate::ErrorClass;
use crate::config::RenderConfig;
use crate::metrics::{self, Errors, FlipMap, ReferenceNoise, SeedError, SeedErrors};
use crate::output::{self, Channels, Picture, magma};
use crate::page;
use crate::read;
use crate::renderer::{self, FrameRequest, Layer, Progress, Renderer};
use crate::scene::{Camera, Feature, SceneProfile};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// How a sweep is done.
#[derive(Clone, Copy)]
pub struct Sweep<'a> {
    /// What is compared; all of one size.
    pub settings: &'a [Setting],
    /// What it is measured against.
    pub reference: &'a Reference,
    /// Where the scene is seen from.
    pub camera: &'a Camera,
    /// Seeds for each setting, from `seed` on; at least 1.
    pub seeds: u32,
    /// The first seed.
    pub seed: u32,
    /// As for [`FrameRequest::repeat`]. With 0 every setting is rendered small once before all others, so that no time
    /// holds a compilation or the building of a structure.
    pub repeat: u32,
    /// Folder for the report, which is there.
    pub folder: &'a Path,
    /// When to begin no further measurement.
    pub deadline: Option<Instant>,
    /// Set to stop.
    pub cancel: Option<&'a AtomicBool>,
    /// Told what is being done.
    pub progress: Option<&'a dyn Fn(Progress<'_>)>,
}

/// An error that ends a sweep without a chart. A setting that fails does not end it.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// What is common to all settings cannot be rendered.
    #[error(transparent)]
    Render(#[from] renderer::Error),
    /// A file of the report cannot be read or written.
    #[error(transparent)]
    File(#[from] output::Error),
    /// The folder holds measurements of something else.
    #[error("{}: {problem}; take another folder (-o), or remove that file", file.display())]
    Other {
        /// The journal.
        file: PathBuf,
        /// What is different.
        problem: String,
    },
}

impl Error {
    /// What kind of failure this is.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        match self {
            Self::Render(error) => error.class(),
            Self::File(error) => error.class(),
            Self::Other { .. } => ErrorClass::Input,
        }
    }
}

/// What finished measurements are kept in.
pub const JOURNAL: &str = "journal.jsonl";

/// Folder of pictures in the report's.
pub const PICTURES: &str = "pictures";

/// Folder of means over seeds, from which another sweep goes on.
pub const MEANS: &str = "means";

/// Files of a report beside its pictures.
pub const FILES: [&str; 4] = ["data.json", "data.csv", "index.html", JOURNAL];

/// What is measured, the one shown first first: key, label, sentence, whether it has a sign.
const METRICS: [(&str, &str, &str, bool); 9] = [
    (
        "rel_mse",
        "relMSE",
        "Mean of squared errors over the reference's square: doubling the light of a pixel counts 1, wherever it is.",
        false,
    ),
    (
        "rel_mse_trimmed",
        "relMSE, trimmed",
        "Without the largest 0.1 % of its terms: fireflies put aside.",
        false,
    ),
    (
        "rel_mse_blocks",
        "relMSE, blocks",
        "Of the means of blocks of 32x32 pixels: grain averages out, light that is missing over an area does not.",
        false,
    ),
    ("flip", "HDR-FLIP", "What a person sees who flips between picture and reference, 0 to 1.", false),
    ("mape", "MAPE", "Mean absolute error in proportion to the reference.", false),
    ("smape", "SMAPE", "The same in proportion to the mean of picture and reference, 0 to 2.", false),
    ("signed_bias", "bias", "Light that is lost (negative) or added, as a share of all light.", true),
    (
        "rmse",
        "RMSE / peak",
        "Root mean squared error over the reference's peak: PSNR is -20 log10 of it.",
        false,
    ),
    ("dssim", "1 - SSIM", "Structure that is not the reference's.", false),
];

/// Measures, writing the report to the folder whenever every setting has one more seed, and at the end: `data.json`,
/// `data.csv`, `index.html`, pictures, and [`JOURNAL`] and [`MEANS`], from which another sweep of the same scene and folder goes on.
///
/// A sweep that is cancelled, or reaches its deadline, leaves a chart of what is finished.
///
/// # Errors
/// The folder holds another chart, or a file of it cannot be written.
pub fn run(renderer: &mut Renderer, sweep: &Sweep<'_>) -> Result<Chart, Error> {
    let header = header(renderer, sweep);
    let file = sweep.folder.join(JOURNAL);
    let mut journal = match Journal::open(&file, &header)? {
        Ok(journal) => journal,
        Err(problem) => return Err(Error::Other { file, problem }),
    };
    for folder in [PICTURES, MEANS].map(|name| sweep.folder.join(name)) {
        fs::create_dir_all(&folder).map_err(|source| output::Error { file: folder, source })?;
    }
    let exposure = picture::exposure(&sweep.reference.layer.data);
    let show = picture::display(&sweep.reference.layer.data, exposure);
    write_jpeg(sweep, &reference_image(), &show)?;

    let mut failures: BTreeMap<&str, String> = BTreeMap::new();
    let mut steps = Steps::of(sweep, &journal);
    let stopped = || sweep.cancel.is_some_and(|cancel| cancel.load(Ordering::SeqCst));
    let over = || stopped() || sweep.deadline.is_some_and(|deadline| Instant::now() >= deadline);
    if sweep.repeat == 0 {
        for setting in sweep.settings.iter().filter(|setting| steps.left(setting, &journal)) {
            if over() {
                break;
            }
            let [width, height] = setting.config.size;
            let mut config = RenderConfig { size: [width.min(64), height.min(48)], ..setting.config.clone() };
            if let Some(progressive) = &config.method.progressive {
                (progressive.set_samples)(&mut config, 1);
            }
            let general = setting.general.then(|| renderer.unneeded(&config));
            let beside: Vec<&[Feature]> = general.as_deref().into_iter().collect();
            let request = FrameRequest { beside: &beside, cancel: sweep.cancel, ..FrameRequest::default() };
            // What fails here fails again below, where it is told.
            let _ = renderer.render(&config, sweep.camera, &request);
        }
    }
    for turn in 0..sweep.seeds {
        for setting in sweep.settings {
            let config = RenderConfig { seed: sweep.seed.wrapping_add(turn), ..setting.config.clone() };
            if journal.find(&config, setting.general).is_some() || failures.contains_key(setting.id.as_str())
            {
                continue;
            }
            if over() {
                break;
            }
            match measure(renderer, sweep, setting, &config, &mut steps) {
                Ok(Measured::Entry(mut entry, image)) => {
                    entry.mean = match journal.find(&config, false) {
                        Some(before) => before.mean,
                        None => mean_to(sweep, setting, turn, &header, &image)?,
                    };
                    journal.add(*entry)?;
                }
                Ok(Measured::Cancelled) => break,
                Ok(Measured::Failed(problem)) => drop(failures.insert(&setting.id, problem)),
                Err(error) => return Err(error.into()),
            }
        }
        write(sweep, &chart(renderer, sweep, &journal, &failures))?;
        if over() {
            break;
        }
    }
    let chart = chart(renderer, sweep, &journal, &failures);
    if chart.complete {
        forget_dominated(sweep, &chart);
    }
    Ok(chart)
}

fn header(renderer: &Renderer, sweep: &Sweep<'_>) -> Header {
    let info = renderer.device().info();
    Header {
        parhelion: env!("CARGO_PKG_VERSION").into(),
        scene: format!("{:016x}", renderer.scene().fingerprint(sweep.camera)),
        size: [sweep.reference.layer.width, sweep.reference.layer.height],
        device: info.name.clone(),
        driver: info.driver(),
        backend: renderer.backend().0.name().into(),
        reference: sweep.reference.fingerprint(),
    }
}

enum Measured {
    /// … and its picture.
    Entry(Box<Entry>, Vec<f32>),
    Failed(String),
    Cancelled,
}

/// Renders one setting with one seed; pictures are of the first.
fn measure(
    renderer: &mut Renderer,
    sweep: &Sweep<'_>,
    setting: &Setting,
    config: &RenderConfig,
    steps: &mut Steps<'_>,
) -> Result<Measured, output::Error> {
    let progress = |progress: Progress<'_>| steps.report(setting, progress);
    let general = setting.general.then(|| renderer.unneeded(config));
    let beside: Vec<&[Feature]> = general.as_deref().into_iter().collect();
    let request = FrameRequest {
        repeat: sweep.repeat,
        beside: &beside,
        cancel: sweep.cancel,
        progress: Some(&progress),
        ..FrameRequest::default()
    };
    renderer.device().reset_peak();
    let frame = match renderer.render(config, sweep.camera, &request) {
        Ok(frame) => frame,
        Err(renderer::Error::Cancelled) => return Ok(Measured::Cancelled),
        Err(error) if error.class() == ErrorClass::Interrupted => return Ok(Measured::Cancelled),
        Err(error) => return Ok(Measured::Failed(error.to_string())),
    };
    // A progressive picture that was cut short comes as if it were whole.
    if sweep.cancel.is_some_and(|cancel| cancel.load(Ordering::SeqCst)) {
        return Ok(Measured::Cancelled);
    }
    steps.done += cost(setting);
    let (image, reference) = (&frame.beauty.data, &sweep.reference.layer.data);
    if let Some(at) = image.iter().position(|value| !value.is_finite()) {
        let width = frame.beauty.width as usize;
        let (x, y, value) = (at / 3 % width, at / 3 / width, image[at]);
        return Ok(Measured::Failed(format!("its picture is {value} at pixel {x},{y}")));
    }
    let (errors, map) = metrics::errors(image, reference, frame.beauty.width as usize, 3);
    if config.seed == sweep.seed || !sweep.folder.join(image_key(setting)).exists() {
        let exposure = picture::exposure(reference);
        write_jpeg(sweep, &image_key(setting), &picture::display(image, exposure))?;
        let FlipMap { map } = map.unwrap_or(FlipMap { map: Vec::new() });
        let pixels: Vec<u8> = map.into_iter().flat_map(magma).collect();
        write_jpeg(sweep, &error_key(setting), &pixels)?;
        let [width, height] = config.size;
        let channels = vec![Channels { names: ["R", "G", "B"].map(String::from).into(), data: image }];
        let picture = Picture {
            size: config.size,
            window: [0, 0, width, height],
            channels,
            attributes: vec![("parhelion:setting", output::Attribute::Text(setting.label.clone()))],
        };
        output::write_exr(&sweep.folder.join(exr_name(setting)), &picture)?;
    }
    let pass = |pass: renderer::PassStats| Some(PassTime { path: pass.path, ms: pass.ms? });
    let entry = Entry {
        config: config.clone(),
        ms: frame.total_ms.unwrap_or(frame.wall_ms),
        general_ms: frame.beside_ms.first().copied(),
        passes: frame.passes.into_iter().filter_map(pass).collect(),
        rays: frame.rays,
        device_bytes: frame.peak_device_bytes,
        metrics: values(&errors),
        mean: None,
    };
    Ok(Measured::Entry(Box::new(entry), frame.beauty.data))
}

/// The mean of all seeds' pictures up to this turn's, where those before are there.
fn mean_to(
    sweep: &Sweep<'_>,
    setting: &Setting,
    turn: u32,
    header: &Header,
    image: &[f32],
) -> Result<Option<Mean>, output::Error> {
    let file = sweep.folder.join(MEANS).join(format!("{}.exr", setting.id));
    let first = RenderConfig { seed: sweep.seed, ..setting.config.clone() };
    let identity = serde_json::to_string(&(header, first))
        .map_err(|error| output::Error { file: file.clone(), source: error.into() })?;
    let rel_mse = mean::with(&file, &identity, turn, image, &sweep.reference.layer)?;
    Ok(rel_mse.map(|rel_mse| Mean { from: sweep.seed, rel_mse }))
}

/// By the keys of [`METRICS`].
fn values(errors: &Errors) -> BTreeMap<String, f64> {
    let values = [
        ("rel_mse", Some(errors.rel_mse)),
        ("rel_mse_trimmed", Some(errors.rel_mse_trimmed)),
        ("rel_mse_blocks", Some(errors.rel_mse_blocks)),
        ("flip", errors.flip),
        ("mape", Some(errors.mape)),
        ("smape", Some(errors.smape)),
        ("signed_bias", Some(errors.signed_bias)),
        ("rmse", Some((errors.mse / (errors.peak * errors.peak)).sqrt())),
        ("dssim", errors.ssim.map(|ssim| 1.0 - ssim)),
    ];
    values.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))).collect()
}

/// The reference's own share of squared errors, by the same keys.
#[derive(Clone, Debug, Default)]
pub(super) struct Noise {
    squares: BTreeMap<&'static str, f64>,
    own: Option<ReferenceNoise>,
}

impl Noise {
    pub(super) fn of(reference: &Reference) -> Self {
        let peak = metrics::peak(&reference.layer.data);
        let mse = |a: &[f32], b: &[f32]| metrics::mse(a, b) / (peak * peak);
        let Layer { width, data, .. } = &reference.layer;
        let own = |[half, _]: &[Layer; 2]| ReferenceNoise::of(&half.data, data, *width as usize, 3);
        let own = reference.halves.as_ref().map(own);
        let noise = [
            ("rel_mse", own.map(|own| own.rel_mse)),
            ("rel_mse_blocks", own.map(|own| own.rel_mse_blocks)),
            ("rel_mse_trimmed", reference.noise(metrics::rel_mse_trimmed)),
            ("rmse", reference.noise(mse)),
        ];
        Self { squares: noise.into_iter().filter_map(|(key, value)| Some((key, value?))).collect(), own }
    }

    /// A measured value without it, by [`metrics::without_noise`].
    pub(super) fn subtracted(&self, key: &str, value: f64) -> f64 {
        match self.squares.get(key) {
            Some(noise) if key == "rmse" => metrics::without_noise(value * value, *noise).sqrt(),
            Some(noise) => metrics::without_noise(value, *noise),
            None => value,
        }
    }

    /// Whether an error stands ten times above it.
    fn ranks(&self, rel_mse: f64) -> bool {
        self.rel_mse().is_none_or(|noise| rel_mse >= 10.0 * noise)
    }

    fn rel_mse(&self) -> Option<f64> {
        self.own.map(|own| own.rel_mse)
    }
}

fn chart(
    renderer: &Renderer,
    sweep: &Sweep<'_>,
    journal: &Journal,
    failures: &BTreeMap<&str, String>,
) -> Chart {
    let noise = Noise::of(sweep.reference);
    let all = |setting: &Setting| -> Vec<&Entry> {
        let seeds = (0..sweep.seeds).map(|turn| sweep.seed.wrapping_add(turn));
        let configs = seeds.map(|seed| RenderConfig { seed, ..setting.config.clone() });
        configs.filter_map(|config| journal.find(&config, setting.general)).collect()
    };
    let measured: Vec<(&Setting, Vec<&Entry>)> =
        sweep.settings.iter().map(|setting| (setting, all(setting))).collect();
    let complete = measured.iter().all(|(setting, entries)| {
        entries.len() as u32 == sweep.seeds || failures.contains_key(setting.id.as_str())
    });
    let points = measured.iter().filter_map(|(setting, entries)| point(setting, entries, sweep.seed, &noise));
    let mut points: Vec<Point> = points.collect();
    for index in front_of(&points, "rel_mse") {
        let point = &mut points[index];
        let setting = sweep.settings.iter().find(|setting| setting.id == point.id);
        let name = setting.map(exr_name).filter(|name| sweep.folder.join(name).exists());
        point.exr = name;
    }
    let failed = |setting: &Setting| {
        let error = failures.get(setting.id.as_str())?.clone();
        Some(Failure { label: setting.label.clone(), error })
    };
    let info = renderer.device().info();
    let scene = renderer.scene();
    let info_of = |&(key, label, about, signed): &(&str, &str, &str, bool)| MetricInfo {
        key: key.into(),
        label: label.into(),
        about: about.into(),
        signed,
    };
    Chart {
        schema: data::SCHEMA,
        version: env!("CARGO_PKG_VERSION").into(),
        scene: scene.name.clone(),
        fingerprint: format!("{:016x}", scene.fingerprint(sweep.camera)),
        triangles: SceneProfile::of(scene, 0.0).triangles as u64,
        camera: sweep.camera.name.clone(),
        size: [sweep.reference.layer.width, sweep.reference.layer.height],
        device: info.name.clone(),
        driver: info.driver(),
        backend: renderer.backend().0.name().into(),
        reference: data::Reference {
            about: sweep.reference.about.clone(),
            spp: sweep.reference.spp,
            noise: noise.rel_mse(),
            bias_se: noise.own.map(|own| own.bias_se),
            image: reference_image(),
        },
        metrics: METRICS.iter().map(info_of).collect(),
        answers: answers(&points, noise.rel_mse()),
        points,
        complete,
        failures: sweep.settings.iter().filter_map(failed).collect(),
        images: BTreeMap::new(),
    }
}

fn point(setting: &Setting, entries: &[&Entry], seed: u32, noise: &Noise) -> Option<Point> {
    let first = entries.first()?;
    let spread = |value: &dyn Fn(&Entry) -> Option<f64>| {
        Spread::of(entries.iter().filter_map(|entry| value(entry)).collect())
    };
    let of = |key: &str| {
        spread(&|entry| entry.metrics.get(key).map(|&value| noise.subtracted(key, value)))
            .map(|spread| (key.to_owned(), spread))
    };
    let measured = spread(&|entry| entry.metrics.get("rel_mse").copied())?;
    let time = |pass: &PassTime| {
        let ms = |entry: &Entry| Some(entry.passes.iter().find(|other| other.path == pass.path)?.ms);
        Some(PassTime { path: pass.path.clone(), ms: spread(&ms)?.median })
    };
    Some(Point {
        id: setting.id.clone(),
        method: setting.config.method.name.into(),
        label: setting.label.clone(),
        settings: setting.settings.clone(),
        seeds: entries.len() as u32,
        ms: spread(&|entry| Some(entry.ms))?,
        passes: first.passes.iter().filter_map(time).collect(),
        rays: first.rays,
        device_bytes: entries.iter().map(|entry| entry.device_bytes).max()?,
        metrics: METRICS.iter().filter_map(|(key, ..)| of(key)).collect(),
        over_seeds: over_seeds(entries, seed, noise),
        ranked: noise.ranks(measured.median),
        general_ms: spread(&|entry| entry.general_ms).map(|spread| spread.median),
        image: image_key(setting),
        error_image: error_key(setting),
        exr: None,
    })
}

/// Of seeds one after another from `seed` on; those that a sweep was cut short before are not there.
fn over_seeds(entries: &[&Entry], seed: u32, noise: &Noise) -> Option<SeedErrors> {
    let error = |entry: &&Entry| {
        let [rel_mse, signed_bias, rel_mse_blocks] =
            ["rel_mse", "signed_bias", "rel_mse_blocks"].map(|key| entry.metrics.get(key).copied());
        Some(SeedError { rel_mse: rel_mse?, signed_bias: signed_bias?, rel_mse_blocks: rel_mse_blocks? })
    };
    let errors: Vec<SeedError> = entries.iter().map(error).collect::<Option<_>>()?;
    let last = entries.last()?;
    let whole = last.config.seed.wrapping_sub(seed) as usize + 1 == entries.len();
    let mean = last.mean.filter(|mean| whole && mean.from == seed);
    SeedErrors::of(&errors, mean.map(|mean| mean.rel_mse), &noise.own.unwrap_or_default())
}

impl Spread {
    /// Of no measurements there is none.
    #[must_use]
    pub fn of(values: Vec<f64>) -> Option<Self> {
        let ends = |end: fn(f64, f64) -> f64| values.iter().copied().reduce(end);
        let (min, max) = (ends(f64::min)?, ends(f64::max)?);
        Some(Self { median: metrics::median(values)?, min, max })
    }
}

fn reference_image() -> String {
    format!("{PICTURES}/reference.jpg")
}

fn image_key(setting: &Setting) -> String {
    format!("{PICTURES}/{}.jpg", setting.id)
}

fn error_key(setting: &Setting) -> String {
    format!("{PICTURES}/{}-error.jpg", setting.id)
}

fn exr_name(setting: &Setting) -> String {
    format!("{PICTURES}/{}.exr", setting.id)
}

/// Writes everything but pictures anew.
fn write(sweep: &Sweep<'_>, chart: &Chart) -> Result<(), Error> {
    let [json, csv, html, _] = FILES.map(|name| sweep.folder.join(name));
    let text = serde_json::to_string_pretty(chart)
        .map_err(|error| output::Error { file: json.clone(), source: error.into() })?;
    output::write_file(&json, |out| writeln!(out, "{text}"))?;
    output::write_file(&csv, |out| out.write_all(table::csv(chart).as_bytes()))?;
    let keys = chart.points.iter().flat_map(|point| [&point.image, &point.error_image]);
    let image = |key: &String| {
        let bytes = read::regular(&sweep.folder.join(key), read::RESULTS).ok()?;
        Some((key.clone(), page::data_url("image/jpeg", &bytes)))
    };
    let images = keys.chain([&chart.reference.image]).filter_map(image).collect();
    let page = report::html(&Chart { images, ..chart.clone() });
    output::write_file(&html, |out| out.write_all(page.as_bytes()))?;
    Ok(())
}

fn write_jpeg(sweep: &Sweep<'_>, name: &str, pixels: &[u8]) -> Result<(), output::Error> {
    let file = sweep.folder.join(name);
    let jpeg = picture::jpeg(pixels, sweep.reference.layer.width)
        .map_err(|source| output::Error { file: file.clone(), source })?;
    output::write_file(&file, |out| out.write_all(&jpeg))
}

/// Linear pictures are kept of the front only.
fn forget_dominated(sweep: &Sweep<'_>, chart: &Chart) {
    for setting in sweep.settings {
        let name = exr_name(setting);
        if chart.points.iter().all(|point| point.exr.as_ref() != Some(&name)) {
            // Gone already, where the sweep went on from an earlier one.
            let _ = fs::remove_file(sweep.folder.join(name));
        }
    }
}

/// How much of the sweep is done, by a guess at what each setting costs.
struct Steps<'a> {
    sweep: &'a Sweep<'a>,
    done: f64,
    all: f64,
}

impl<'a> Steps<'a> {
    fn of(sweep: &'a Sweep<'a>, journal: &Journal) -> Self {
        let mut steps = Self { sweep, done: 0.0, all: 0.0 };
        for setting in sweep.settings {
            let left = (0..sweep.seeds).filter(|&turn| steps.unfinished(setting, turn, journal)).count();
            steps.all += cost(setting) * left as f64;
        }
        steps
    }

    fn unfinished(&self, setting: &Setting, turn: u32, journal: &Journal) -> bool {
        let config = RenderConfig { seed: self.sweep.seed.wrapping_add(turn), ..setting.config.clone() };
        journal.find(&config, setting.general).is_none()
    }

    fn left(&self, setting: &Setting, journal: &Journal) -> bool {
        (0..self.sweep.seeds).any(|turn| self.unfinished(setting, turn, journal))
    }

    fn report(&self, setting: &Setting, progress: Progress<'_>) {
        if let Some(report) = self.sweep.progress {
            let done = (self.done + cost(setting) * progress.done) / self.all.max(f64::MIN_POSITIVE);
            report(Progress { pass: &setting.label, done });
        }
    }
}

/// Rays a pixel, roughly.
fn cost(Setting { config, general, .. }: &Setting) -> f64 {
    let rays = (config.method.cost)(config);
    if *general { 2.0 * rays } else { rays }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_lies_between_and_of_nothing_is_none() {
        assert_eq!(Spread::of(vec![3.0, 1.0, 2.0]), Some(Spread { median: 2.0, min: 1.0, max: 3.0 }));
        assert_eq!(Spread::of(vec![4.0, 1.0]), Some(Spread { median: 2.5, min: 1.0, max: 4.0 }));
        assert_eq!(Spread::of(Vec::new()), None);
    }

    /// A picture that is the truth has the reference's noise for an error; one that is not has it on top.
    #[test]
    fn the_references_noise_is_taken_off_every_square() {
        let count = 3 * 64 * 64;
        let noise = |i: usize, salt: u64| {
            let mut h = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ salt;
            h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            ((h >> 40) as f64 / f64::from(1 << 24) - 0.5) as f32
        };
        let layer = |data| Layer { width: 64, height: 64, channels: 3, data };
        let half = |salt| (0..count).map(|i| 1.0 + 0.2 * noise(i, salt)).collect::<Vec<f32>>();
        let (a, b) = (half(0x1234_5678_9abc), half(0xfedc_ba98_7654));
        let mean = a.iter().zip(&b).map(|(a, b)| 0.5 * (a + b)).collect();
        let reference = Reference {
            layer: layer(mean),
            halves: Some([layer(a), layer(b)]),
            about: String::new(),
            spp: None,
        };
        let found = Noise::of(&reference);
        // Half the variance of a uniform number 0.2 wide.
        let variance = 0.2_f64.powi(2) / 12.0 / 2.0;
        assert!((found.squares["rel_mse"] / (variance / 1.01) - 1.0).abs() < 0.05, "{found:?}");
        let measure = |level: f32| metrics::rel_mse(&vec![level; count], &reference.layer.data);
        assert!(!found.ranks(measure(1.0)) && found.ranks(measure(1.5)));
        // 67 % too much before.
        let error = found.subtracted("rel_mse", measure(1.05));
        assert!((error / (0.0025 / 1.01) - 1.0).abs() < 0.2, "{error}");
        assert!((found.subtracted("rel_mse", measure(1.0)) / measure(1.0) - 0.1).abs() < 1e-9);
        let peak = metrics::peak(&reference.layer.data);
        let rmse = metrics::mse(&vec![1.2; count], &reference.layer.data).sqrt() / peak;
        assert!((found.subtracted("rmse", rmse) * peak / 0.2 - 1.0).abs() < 0.01);
        assert_eq!(found.subtracted("flip", 0.5), 0.5);
        let alone = Noise::of(&Reference { halves: None, ..reference });
        assert!(alone.ranks(1e-9) && alone.subtracted("rel_mse", 0.25) == 0.25);
    }
}
