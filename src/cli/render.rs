//! `parhelion render`.

use super::args::Render;
use super::progress::Reporter;
use super::settings::settings;
use super::stats::stats;
use super::table::table;
use super::{Failure, extension, input, interrupt, print, scene};
use parhelion::config::RenderConfig;
use parhelion::output::{self, Attribute, Channels, Picture};
use parhelion::renderer::{self, Aov, Frame, FrameRequest, Layer, Renderer, RendererOptions};
use parhelion::scene::SceneProfile;
use parhelion::techniques::tone_map::OPERATOR;
use parhelion::vk::{self, DeviceKind, DeviceOptions};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

pub(super) fn run(args: &Render) -> Result<(), Failure> {
    let config = settings(args)?;
    let outputs = outputs(args)?;
    interrupt::listen()?;
    let reporter = Reporter::new(&args.common);

    let name = scene::name(&args.common);
    let (scene, camera) = scene::load(&args.common, &reporter)?;
    let roughness = config.whitted.mirror_roughness;
    let profile = SceneProfile::of(&scene, roughness);
    if profile.rough_lobes {
        reporter.note(&format!("specular lobes rougher than {roughness} are left out"));
    }

    let select = args.common.device.clone();
    let device = vk::Device::open(&DeviceOptions { select, ..DeviceOptions::default() })?;
    reporter.stage("build", &name);
    let options =
        RendererOptions { backend: args.common.backend.into(), visibility: config.indirect.visibility };
    let mut renderer = Renderer::new(&device, scene, &options)?;

    reporter.stage("render", &name);
    interrupt::heeded();
    let taps: Vec<String> = args.tap.iter().map(|(tap, _)| tap.clone()).collect();
    let progress = |progress: renderer::Progress<'_>| reporter.progress(progress);
    let request = FrameRequest {
        aovs: &args.aov,
        taps: &taps,
        repeat: args.repeat.unwrap_or(0),
        cancel: Some(&interrupt::CANCEL),
        progress: Some(&progress),
    };
    let frame = renderer.render(&config, &camera, &request)?;

    reporter.stage("write", &name);
    let mut report = header(&config, &renderer, &profile, &frame);
    if args.explain {
        for line in profile.explain() {
            let _ = writeln!(report, "left out: {line}");
        }
        if config.indirect.boxes().is_none() {
            let visibility = config.indirect.visibility.name();
            let _ = writeln!(report, "left out: visibility {visibility}: no structure over triangles' boxes");
        }
    }
    report.push_str(&table(&frame));
    for file in &outputs {
        if interrupt::CANCEL.load(Ordering::SeqCst) {
            return Err(renderer::Error::Cancelled.into());
        }
        if extension(file).as_deref() == Some("exr") {
            output::write_exr(file, &picture(&config, &renderer, &frame))?;
            let _ = writeln!(report, "{}: linear radiance, {}", file.display(), extent(&config));
        } else {
            let exposure = exposure(&config, &frame);
            let texts = [
                ("Software", concat!("parhelion ", env!("CARGO_PKG_VERSION")).to_owned()),
                ("Tone mapping", OPERATOR.to_owned()),
                ("Exposure", exposure.clone()),
            ];
            output::write_png(file, frame.beauty.width, &frame.display, &texts)?;
            let _ =
                writeln!(report, "{}: {OPERATOR}, exposure {exposure}, {}", file.display(), extent(&config));
        }
    }
    for ((tap, layer), (_, file)) in frame.taps.iter().zip(&args.tap) {
        output::write_exr(file, &tapped(tap, layer))?;
        let _ = writeln!(report, "{}: {tap}, {}x{}", file.display(), layer.width, layer.height);
    }
    if let Some(file) = &args.stats {
        let stats = stats(args, &config, &camera, &renderer, &profile, &frame, &outputs);
        output::write_file(file, |out| writeln!(out, "{stats:#}"))?;
        let _ = writeln!(report, "{}: statistics", file.display());
    }
    drop(reporter);
    if args.common.quiet { Ok(()) } else { print(&report) }
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
    let _ = writeln!(
        text,
        "method: {}, {}, {} VPLs of {} paths, min distance {:.3} m",
        config.method.name(),
        extent(config),
        frame.vpl_count,
        frame.path_count,
        frame.min_distance,
    );
    if let Some(pixels) = frame.regathered {
        let share = 100.0 * f64::from(pixels) / (frame.beauty.data.len() / 3) as f64;
        let _ = writeln!(text, "gathered again: {pixels} pixels ({share:.1} %)");
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

fn picture<'a>(config: &RenderConfig, renderer: &Renderer, frame: &'a Frame) -> Picture<'a> {
    let mut channels = vec![channels(&["R", "G", "B"].map(String::from), &frame.beauty)];
    for (aov, layer) in &frame.aovs {
        let suffixes: &[&str] = match aov {
            Aov::Depth => &["Z"],
            Aov::N | Aov::P => &["X", "Y", "Z"],
            _ => &["R", "G", "B"],
        };
        let name = |suffix: &&str| match aov {
            Aov::Depth => (*suffix).to_owned(),
            _ => format!("{}.{suffix}", aov.name()),
        };
        channels.push(self::channels(&suffixes.iter().map(name).collect::<Vec<_>>(), layer));
    }
    let text = |value: &dyn ToString| Attribute::Text(value.to_string());
    let info = renderer.device().info();
    let json = |value: serde_json::Result<String>| Attribute::Text(value.unwrap_or_default());
    Picture {
        size: config.size,
        window: config.window(),
        channels,
        attributes: vec![
            ("parhelion:version", text(&env!("CARGO_PKG_VERSION"))),
            ("parhelion:scene", text(&renderer.scene().name)),
            ("parhelion:method", text(&config.method.name())),
            ("parhelion:settings", json(serde_json::to_string(config))),
            ("parhelion:seed", Attribute::Number(config.seed.into())),
            ("parhelion:device", text(&info.name)),
            ("parhelion:driver", text(&info.driver())),
            ("parhelion:backend", text(&renderer.backend().0.name())),
            ("parhelion:times", json(serde_json::to_string(&frame.passes))),
            ("parhelion:vpl_count", Attribute::Number(frame.vpl_count.into())),
            ("parhelion:exposure_ev", Attribute::Number(frame.exposure_ev.into())),
        ],
    }
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
