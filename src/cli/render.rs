//! `parhelion render`.

use super::args::Render;
use super::progress::Reporter;
use super::settings::settings;
use super::stats::stats;
use super::table::table;
use super::{Failure, choose, economy, extension, input, interrupt, print, scene};
use crate::config::RenderConfig;
use crate::denoise::Denoiser;
use crate::output::{self, Attribute, Channels, Picture};
use crate::renderer::{self, Aov, Frame, FrameRequest, Layer, Preview, Renderer, RendererOptions, Resume};
use crate::scene::{Camera, Environment, SceneProfile};
use crate::techniques::path_trace::PathTraceConfig;
use crate::vk::{self, DeviceKind, DeviceOptions};
use glam::Vec3;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

pub(super) fn run(args: &Render) -> Result<(), Failure> {
    let mut config = settings(args)?;
    let wish = choose::wish(args)?;
    if wish.is_none() {
        config.method.check_layers(&config, &args.aov).map_err(|error| input!("--aov: {error}"))?;
    }
    let denoiser = denoiser(args)?;
    let outputs = outputs(args)?;
    interrupt::listen()?;
    let reporter = Reporter::new(&args.common);

    let name = scene::name(&args.common);
    let environment = args.environment.as_deref().map(environment).transpose()?;
    let roughness = config.whitted.mirror_roughness;
    let (scene, camera) = scene::load(&args.common, environment, &reporter)?;
    let profile = SceneProfile::of(&scene, roughness);

    let select = args.common.device.clone();
    let device = vk::Device::open(&DeviceOptions { select, ..DeviceOptions::default() })?;
    reporter.stage("build", &name);
    let options =
        RendererOptions { backend: args.common.backend.into(), visibility: config.indirect.visibility };
    let mut renderer = Renderer::new(&device, scene, &options)?;
    let chosen = match wish {
        Some(wish) => {
            let chosen = choose::chosen(args, wish, &config, &mut renderer, &camera, &reporter)?;
            config = chosen.config.clone();
            config.method.check_layers(&config, &args.aov).map_err(|error| input!("--aov: {error}"))?;
            Some(chosen)
        }
        None => None,
    };
    let left_out = (config.method.left_out)(&profile, &config);
    left_out.iter().for_each(|line| reporter.note(line));

    let origin = Origin::of(&renderer, &camera);
    let resume = args.resume.as_deref().map(|file| resume(file, args, &config, &origin)).transpose()?;

    interrupt::heeded();
    reporter.stage("render", &name);
    let taps: Vec<String> = args.tap.iter().map(|(tap, _)| tap.clone()).collect();
    let progress = |progress: renderer::Progress<'_>| reporter.progress(progress);
    // What can't be written shows when the last picture is.
    let show = |frame: &Frame| {
        for file in &outputs {
            if let Err(error) = write(file, &origin, &config, frame) {
                tracing::warn!("{error}");
            }
        }
    };
    let request = FrameRequest {
        aovs: &args.aov,
        taps: &taps,
        // A budget is of warm frames.
        repeat: args.repeat.unwrap_or(u32::from(chosen.is_some())),
        time: args.time,
        noise: args.noise,
        resume: resume.as_ref(),
        denoiser: denoiser.as_ref(),
        // Times are of renders that nothing interrupts.
        preview: (args.repeat.is_none() && chosen.is_none())
            .then(|| Preview { every: args.preview.unwrap_or(Duration::from_secs(10)), show: &show }),
        cancel: Some(&interrupt::CANCEL),
        progress: Some(&progress),
        ..FrameRequest::default()
    };
    let frame = renderer.render(&config, &camera, &request)?;

    reporter.stage("write", &name);
    let mut report = header(&config, &renderer, &profile, &frame);
    if args.explain {
        for line in profile.explain() {
            let _ = writeln!(report, "left out: {line}");
        }
        for line in &left_out {
            let _ = writeln!(report, "not modelled: {line}");
        }
        if config.indirect.boxes().is_none() {
            let visibility = config.indirect.visibility.name();
            let _ = writeln!(report, "left out: visibility {visibility}: no structure over triangles' boxes");
        }
    }
    report.push_str(&table(&frame));
    if let Some(chosen) = &chosen {
        report.push_str(&chosen.report);
        report.push_str(&chosen.outcome(&frame, &renderer, &camera));
    }
    for file in &outputs {
        if interrupt::CANCEL.load(Ordering::SeqCst) && frame.samples.is_none() {
            return Err(renderer::Error::Cancelled.into());
        }
        let what = write(file, &origin, &config, &frame)?;
        let _ = writeln!(report, "{}: {what}, {}", file.display(), extent(&config));
    }
    for ((tap, layer), (_, file)) in frame.taps.iter().zip(&args.tap) {
        output::write_exr(file, &tapped(tap, layer))?;
        let _ = writeln!(report, "{}: {tap}, {}x{}", file.display(), layer.width, layer.height);
    }
    // What has been rendered is told, whatever becomes of this.
    let mut failed = None;
    let mut economy = None;
    if args.explain && !interrupt::CANCEL.load(Ordering::SeqCst) {
        reporter.stage("economy", &name);
        match economy::measure(&mut renderer, &config, &camera, args.repeat, &progress) {
            Ok(measured) => {
                report.push_str(&measured.table());
                economy = Some(measured);
            }
            Err(error) => failed = Some(error),
        }
    }
    if let Some(file) = &args.stats {
        let stats = stats(args, &config, &camera, &renderer, &profile, &frame, &outputs, economy.as_ref());
        output::write_file(file, |out| writeln!(out, "{stats:#}"))?;
        let _ = writeln!(report, "{}: statistics", file.display());
    }
    drop(reporter);
    if !args.common.quiet {
        print(&report)?;
    }
    if let Some(error) = failed {
        return Err(error.into());
    }
    // A progressive picture that was cut short is written, and is no success.
    let target = config.method.progressive.map_or(0, |progressive| (progressive.samples)(&config));
    let cut = interrupt::CANCEL.load(Ordering::SeqCst) && frame.samples.is_some_and(|n| n < target);
    if cut { Err(renderer::Error::Cancelled.into()) } else { Ok(()) }
}

/// Writes one picture; returns what it is.
fn write(
    file: &Path,
    origin: &Origin,
    config: &RenderConfig,
    frame: &Frame,
) -> Result<String, output::Error> {
    if extension(file).as_deref() == Some("exr") {
        output::write_exr(file, &picture(origin, config, frame))?;
        let denoised = if frame.denoised.is_some() { ", denoised" } else { "" };
        return Ok(format!("linear radiance{denoised}"));
    }
    let exposure = exposure(config, frame);
    let operator = config.tone_map.operator.title();
    let mut texts = vec![
        ("Software", concat!("parhelion ", env!("CARGO_PKG_VERSION")).to_owned()),
        ("Tone mapping", operator.to_owned()),
        ("Exposure", exposure.clone()),
    ];
    let glare = &config.glare;
    let mut what = format!("{operator}, exposure {exposure}");
    if glare.strength > 0.0 {
        texts.push(("Glare", format!("strength {}, radius {}", glare.strength, glare.radius)));
        let _ = write!(what, ", glare {}", glare.strength);
    }
    if let Some(denoised) = &frame.denoised {
        texts.push(("Denoiser", denoised.by.clone()));
        what.push_str(", denoised");
    }
    output::write_png(file, frame.beauty.width, &frame.display, &texts)?;
    Ok(what)
}

/// Open Image Denoise, if it is asked for, from where the environment says it is.
fn denoiser(args: &Render) -> Result<Option<Denoiser>, Failure> {
    if !args.denoise {
        return Ok(None);
    }
    if let Some(aov) = args.aov.iter().find(|aov| aov.takes_halves()) {
        let name = aov.name();
        return Err(input!(
            "--denoise: --aov {name} is of the samples' mean, which a denoised picture is not"
        ));
    }
    if args.resume.is_some() {
        return Err(input!("--denoise: --resume goes on with a reference, and a denoised picture is none"));
    }
    let path = std::env::var_os("PARHELION_OIDN").map(PathBuf::from);
    Ok(Some(Denoiser::load(path.as_deref())?))
}

/// Where a picture comes from, for its header.
struct Origin {
    scene: String,
    scene_hash: String,
    device: String,
    driver: String,
    backend: &'static str,
}

impl Origin {
    fn of(renderer: &Renderer, camera: &Camera) -> Self {
        let info = renderer.device().info();
        Self {
            scene: renderer.scene().name.clone(),
            scene_hash: format!("{:016x}", renderer.scene().fingerprint(camera)),
            device: info.name.clone(),
            driver: info.driver(),
            backend: renderer.backend().0.name(),
        }
    }
}

/// The settings that decide which samples there are, as text; how many is not one of them.
fn sampling(config: &RenderConfig) -> String {
    let path_trace =
        PathTraceConfig { spp: 0, max_depth: Some(config.max_depth()), ..config.path_trace.clone() };
    let (method, energy_conserving) = (config.method.name, config.energy_conserving);
    serde_json::json!({ "method": method, "path_trace": path_trace, "energy_conserving": energy_conserving })
        .to_string()
}

/// Reads what a render of the same picture left behind.
fn resume(file: &Path, args: &Render, config: &RenderConfig, origin: &Origin) -> Result<Resume, Failure> {
    let name = file.display();
    let read = output::read_exr(file).map_err(Failure::input)?;
    let text = |key: &str| match read.attributes.get(key) {
        Some(Attribute::Text(text)) => Some(text.clone()),
        Some(Attribute::Number(number)) => Some(number.to_string()),
        None => None,
    };
    let samples = text("parhelion:samples").and_then(|n| n.parse().ok());
    let Some(samples) = samples.filter(|&n: &u32| n > 0) else {
        return Err(input!("--resume: {name}: not a picture that --method path wrote"));
    };
    let differs = |what: &str, there: String, here: String| {
        input!("--resume: {name}: its {what} is {there}, not {here}")
    };
    let size = |[width, height]: [u32; 2]| format!("{width}x{height}");
    if read.size != config.size {
        return Err(differs("size", size(read.size), size(config.size)));
    }
    if read.window != config.window() {
        return Err(differs("window", format!("{:?}", read.window), format!("{:?}", config.window())));
    }
    for (what, key, here) in [
        ("scene hash", "parhelion:scene_hash", origin.scene_hash.clone()),
        ("seed", "parhelion:seed", config.seed.to_string()),
        ("backend", "parhelion:backend", origin.backend.to_owned()),
        ("sampling", "parhelion:sampling", sampling(config)),
    ] {
        let there = text(key).unwrap_or_default();
        if there != here {
            return Err(differs(what, there, here));
        }
    }
    let layer = |names: [&str; 3]| {
        let [x0, y0, x1, y1] = read.window;
        Some(Layer { width: x1 - x0, height: y1 - y0, channels: 3, data: read.interleaved(&names)? })
    };
    let noisy = layer(["noisy.R", "noisy.G", "noisy.B"]);
    let Some(mean) = noisy.or_else(|| layer(["R", "G", "B"])) else {
        return Err(input!("--resume: {name}: has no channels R, G and B"));
    };
    let halves = layer(["half_a.R", "half_a.G", "half_a.B"])
        .zip(layer(["half_b.R", "half_b.G", "half_b.B"]))
        .map(|(a, b)| [a, b]);
    let rates = layer(["rate.now", "rate.variance", "rate.taken"]);
    let halved = args.aov.iter().any(|aov| aov.takes_halves());
    if config.path_trace.adaptive && (halves.is_none() || rates.is_none()) {
        return Err(input!(
            "--resume: {name}: has no layers half_a, half_b and rate, which --adaptive goes on from"
        ));
    }
    if halves.is_none() && (args.noise.is_some() || halved) {
        return Err(input!(
            "--resume: {name}: has no layers half_a and half_b, which --noise and --aov variance go on from"
        ));
    }
    Ok(Resume { samples, mean, halves, rates })
}

/// A file, or three numbers.
fn environment(word: &str) -> Result<Environment, Failure> {
    let numbers: Option<Vec<f32>> = word.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[r, g, b]) if [r, g, b].iter().all(|v| v.is_finite() && *v >= 0.0) => {
            Ok(Environment::constant(Vec3::new(r, g, b)))
        }
        Some(_) => Err(input!("--environment: `{word}` is not three numbers of at least 0")),
        None => Environment::load(Path::new(word)).map_err(|error| input!("--environment: {error}")),
    }
}

/// Every picture to write, known to be writable before anything is computed.
fn outputs(args: &Render) -> Result<Vec<PathBuf>, Failure> {
    let mut pictures = args.output.clone();
    if pictures.is_empty() {
        let mut name = scene::stem(&args.common);
        name.push(".png");
        pictures.push(name.into());
    }
    for file in &pictures {
        if !matches!(extension(file).as_deref(), Some("exr" | "png")) {
            return Err(input!("{}: pictures are written as .exr or .png", file.display()));
        }
    }
    if !args.aov.is_empty() && !pictures.iter().any(|file| extension(file).as_deref() == Some("exr")) {
        return Err(input!("--aov: layers need an .exr among the pictures (-o FILE.exr)"));
    }
    for (index, aov) in args.aov.iter().enumerate() {
        if args.aov[..index].contains(aov) {
            return Err(input!("--aov: {} is named twice", aov.name()));
        }
    }
    for (_, file) in &args.tap {
        if extension(file).as_deref() != Some("exr") {
            return Err(input!("--tap: {}: taps are written as .exr", file.display()));
        }
    }
    let files = pictures.iter().chain(args.tap.iter().map(|(_, file)| file)).chain(&args.stats);
    for (index, file) in files.clone().enumerate() {
        if files.clone().take(index).any(|earlier| earlier == file) {
            return Err(input!("{}: named twice", file.display()));
        }
        output::check_writable(file).map_err(Failure::input)?;
    }
    Ok(pictures)
}

fn header(config: &RenderConfig, renderer: &Renderer, profile: &SceneProfile, frame: &Frame) -> String {
    let info = renderer.device().info();
    let (backend, reason) = renderer.backend();
    let cpu = if info.kind == DeviceKind::Cpu { ", a CPU device" } else { "" };
    let lights = renderer.scene().lights.len();
    let mut text = format!(
        "scene: {}, {} triangles, {lights} light{}\n",
        renderer.scene().name,
        profile.triangles,
        if lights == 1 { "" } else { "s" },
    );
    let _ = write!(text, "method: {}, {}", config.method.name, extent(config));
    if let (Some(vpls), Some(paths), Some(distance)) = (frame.vpl_count, frame.path_count, frame.min_distance)
    {
        let _ = write!(text, ", {vpls} VPLs of {paths} paths, min distance {distance:.3} m");
    }
    if let Some(samples) = frame.samples {
        let _ = write!(text, ", {samples} samples a pixel, at most {} edges a path", config.max_depth());
    }
    if let Some(noise) = frame.noise {
        let when = if frame.denoised.is_some() { " before denoising" } else { "" };
        let _ = write!(text, ", error about {:.2} %{when}", 100.0 * noise);
    }
    text.push('\n');
    if let Some(pixels) = frame.regathered {
        let share = 100.0 * f64::from(pixels) / (frame.beauty.data.len() / 3) as f64;
        let _ = writeln!(text, "gathered again: {pixels} pixels ({share:.1} %)");
    }
    if let Some(denoised) = &frame.denoised {
        let _ = writeln!(text, "denoised: {}, {:.1} ms on the CPU", denoised.by, denoised.ms);
    }
    let _ = writeln!(text, "device: {}{cpu} ({})", info.name, info.driver());
    let _ = writeln!(text, "backend: {} ({reason})", backend.name());
    for structure in renderer.structures() {
        let mib = structure.bytes as f64 / f64::from(1 << 20);
        let _ = writeln!(
            text,
            "structure: {}, {mib:.1} MiB, built in {:.1} ms",
            structure.name, structure.build_ms
        );
    }
    let _ =
        writeln!(text, "peak device memory: {:.1} MiB", frame.peak_device_bytes as f64 / f64::from(1 << 20));
    text
}

fn extent(config: &RenderConfig) -> String {
    let [width, height] = config.size;
    match config.crop {
        Some([x0, y0, x1, y1]) => format!("{x0},{y0} to {x1},{y1} of {width}x{height}"),
        None => format!("{width}x{height}"),
    }
}

fn exposure(config: &RenderConfig, frame: &Frame) -> String {
    let how = match (config.tone_map.exposure, config.crop) {
        (Some(_), _) => "",
        (None, None) => " (auto)",
        (None, Some(_)) => " (auto, of the crop)",
    };
    format!("{:+.2} EV{how}", frame.exposure_ev)
}

fn picture<'a>(origin: &Origin, config: &RenderConfig, frame: &'a Frame) -> Picture<'a> {
    let mut channels = vec![channels(&["R", "G", "B"].map(String::from), &frame.beauty)];
    for (aov, layer) in &frame.aovs {
        let name = |suffix: &&str| match aov {
            Aov::Depth => (*suffix).to_owned(),
            _ => format!("{}.{suffix}", aov.name()),
        };
        channels.push(self::channels(&aov.channel_names().iter().map(name).collect::<Vec<_>>(), layer));
    }
    if let Some(denoised) = &frame.denoised {
        channels.push(self::channels(&["noisy.R", "noisy.G", "noisy.B"].map(String::from), &denoised.noisy));
    }
    let text = |value: &dyn ToString| Attribute::Text(value.to_string());
    let json = |value: serde_json::Result<String>| Attribute::Text(value.unwrap_or_default());
    let number = |value: f64| Attribute::Number(value);
    let mut attributes = vec![
        ("parhelion:version", text(&env!("CARGO_PKG_VERSION"))),
        ("parhelion:scene", text(&origin.scene)),
        ("parhelion:scene_hash", text(&origin.scene_hash)),
        ("parhelion:method", text(&config.method.name)),
        ("parhelion:settings", json(serde_json::to_string(config))),
        ("parhelion:seed", number(config.seed.into())),
        ("parhelion:device", text(&origin.device)),
        ("parhelion:driver", text(&origin.driver)),
        ("parhelion:backend", text(&origin.backend)),
        ("parhelion:times", json(serde_json::to_string(&frame.passes))),
        ("parhelion:exposure_ev", number(frame.exposure_ev.into())),
    ];
    if let Some(denoised) = &frame.denoised {
        attributes.push(("parhelion:denoiser", text(&denoised.by)));
    }
    if let Some(count) = frame.vpl_count {
        attributes.push(("parhelion:vpl_count", number(count.into())));
    }
    if let Some(samples) = frame.samples {
        attributes.push(("parhelion:samples", number(samples.into())));
        attributes.push(("parhelion:sampling", text(&sampling(config))));
    }
    if let Some(noise) = frame.noise {
        attributes.push(("parhelion:noise", number(noise)));
    }
    Picture { size: config.size, window: config.window(), channels, attributes }
}

fn tapped<'a>(tap: &str, layer: &'a Layer) -> Picture<'a> {
    let names = match layer.channels {
        1 => vec!["Y".to_owned()],
        n @ 2..=4 => ["R", "G", "B", "A"][..n].iter().map(ToString::to_string).collect(),
        n => (0..n).map(|channel| format!("c{channel}")).collect(),
    };
    Picture {
        size: [layer.width, layer.height],
        window: [0, 0, layer.width, layer.height],
        channels: vec![channels(&names, layer)],
        attributes: vec![("parhelion:tap", Attribute::Text(tap.to_owned()))],
    }
}

fn channels<'a>(names: &[String], layer: &'a Layer) -> Channels<'a> {
    Channels { names: names.to_vec(), data: &layer.data }
}
