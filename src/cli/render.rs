//! `parhelion render`.

use super::args::Render;
use super::choose::{self, Chosen};
use super::failure::{Failure, input};
use super::print::print;
use super::progress::Reporter;
use super::sequence::{Files, Sequence};
use super::settings::settings;
use super::sheet::Sheet;
use super::stats::stats;
use super::table::table;
use super::{economy, interrupt, scene};
use crate::chart::choose::Wish;
use crate::config::RenderConfig;
use crate::denoise::Denoiser;
use crate::output::{self, extension};
use crate::picture::{self, Origin};
use crate::renderer::{
    self, Aov, Frame, FrameRequest, NotFinite, Preview, Renderer, RendererOptions, Resume,
};
use crate::scene::{Camera, Environment, Scene, SceneProfile};
use crate::text;
use crate::vk::{self, DeviceKind};
use glam::Vec3;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// What all pictures of a command have in common.
struct Job<'a> {
    args: &'a Render,
    denoiser: Option<Denoiser>,
    reporter: Reporter,
    name: String,
}

/// What came of a picture.
struct Drawn {
    report: String,
    /// What went wrong when it was there.
    failed: Option<renderer::Error>,
    /// It has fewer samples than it should.
    cut: bool,
    /// [`Frame::display`].
    display: Vec<u8>,
}

pub(super) fn run(args: &Render) -> Result<(), Failure> {
    let config = settings(args)?;
    let wish = choose::wish(args)?;
    if wish.is_none() {
        config.method.check_layers(&config, &args.aov).map_err(|error| input!("--aov: {error}"))?;
    }
    let denoiser = denoiser(args)?;
    let sequence = Sequence::of(args, &config)?;
    let files = files(args, sequence.as_ref())?;
    interrupt::listen()?;
    let job = Job { args, denoiser, reporter: Reporter::new(&args.machine), name: scene::name(&args.common) };

    let (scene, camera) = scene::load_with(&args.common, sequence.is_some(), &job.reporter)?;
    let options = RendererOptions {
        backend: args.machine.backend.into(),
        visibility: config.indirect.visibility,
        ..RendererOptions::default()
    };
    if let Some(sequence) = sequence {
        return job.film(&sequence, &scene, config, wish, &files, &options);
    }
    let mut renderer = scene::renderer(scene, &args.common, &args.machine, &options, &job.reporter)?;
    let (config, chosen) = job.chosen(config, wish, &mut renderer, &camera)?;
    let profile = renderer.profile(config.whitted.mirror_roughness);
    (config.method.left_out)(&profile, &config).iter().for_each(|line| job.reporter.note(line));

    let origin = Origin::of(&renderer, &camera);
    let halves = args.noise.is_some() || args.aov.iter().any(|aov| aov.takes_halves());
    let resume = args.resumed().map(|file| Resume::read(file, &config, &origin, halves));
    let resume = resume.transpose().map_err(|error| input!("--resume: {error}"))?;

    interrupt::heeded();
    job.reporter.stage("render", &job.name);
    let progress = |progress: renderer::Progress<'_>| job.reporter.progress(progress);
    // What can't be written shows when the last picture is. A pipe would hold one behind the other.
    let replaced: Vec<_> = files.pictures.iter().filter(|file| !output::is_stream(file)).collect();
    let show = |frame: &Frame| {
        for file in &replaced {
            if let Err(error) = picture::write(file, &origin, &config, frame) {
                tracing::warn!("{error}");
            }
        }
    };
    // Times are of renders that nothing interrupts.
    let preview = (args.repeat.is_none() && chosen.is_none())
        .then(|| Preview { every: args.preview.unwrap_or(Duration::from_secs(10)), show: &show });
    let watch = Watch { alone: true, origin: &origin, resume: resume.as_ref(), preview, progress: &progress };
    let drawn = job.draw(&mut renderer, &camera, &config, chosen.as_ref(), &files, &watch)?;
    let Job { reporter, .. } = job;
    drop(reporter);
    if !args.machine.quiet {
        print(&drawn.report)?;
    }
    match drawn {
        Drawn { failed: Some(error), .. } => Err(error.into()),
        // A progressive picture that was cut short is written, and is no success.
        Drawn { cut: true, .. } => Err(renderer::Error::Cancelled.into()),
        _ => Ok(()),
    }
}

/// How a picture comes about.
struct Watch<'a> {
    /// No other picture is behind it.
    alone: bool,
    origin: &'a Origin,
    resume: Option<&'a Resume>,
    preview: Option<Preview<'a>>,
    progress: &'a dyn Fn(renderer::Progress<'_>),
}

impl Job<'_> {
    /// The settings of a wish, if there is one.
    fn chosen(
        &self,
        config: RenderConfig,
        wish: Option<Wish>,
        renderer: &mut Renderer,
        camera: &Camera,
    ) -> Result<(RenderConfig, Option<Chosen>), Failure> {
        let Some(wish) = wish else { return Ok((config, None)) };
        let chosen = choose::chosen(self.args, wish, &config, renderer, camera, &self.reporter)?;
        let config = chosen.config.clone();
        config.method.check_layers(&config, &self.args.aov).map_err(|error| input!("--aov: {error}"))?;
        Ok((config, Some(chosen)))
    }

    /// Draws frame by frame, each by a renderer of its own.
    fn film(
        &self,
        sequence: &Sequence,
        base: &Scene,
        mut config: RenderConfig,
        mut wish: Option<Wish>,
        files: &Files,
        options: &RendererOptions,
    ) -> Result<(), Failure> {
        let (args, reporter) = (self.args, &self.reporter);
        let clips = Sequence::clips(args, base, reporter)?;
        if base.motion.is_none() && sequence.is_timed() {
            reporter.note("nothing moves in the scene: it has no animation that can be played");
        }
        if sequence.blurs() && config.method.progressive.is_none() && wish.is_none() {
            let name = config.method.name;
            reporter.note(&format!("motion blur is left out (--shutter): --method {name} draws a moment"));
        }
        let screens = files.shows_screens() || args.film.sheet.is_some();
        if sequence.count() > 1 && config.tone_map.exposure.is_none() && screens {
            reporter.note("each frame is shown at an exposure of its own: --exposure keeps brightness even");
        }
        let count = sequence.count();
        let size = config.crop.map_or(config.size, |[x0, y0, x1, y1]| [x1 - x0, y1 - y0]);
        let sheet = args.film.sheet.clone().map(|file| Sheet::new(file, count, size));
        let mut sheet = sheet.transpose()?;
        let device = scene::device(&args.machine)?;
        let (mut drawn, mut left_out): (Vec<f64>, usize) = (Vec::new(), 0);
        let mut said = Vec::new();
        let (mut last, mut kept) = (None, None::<Renderer>);
        interrupt::heeded();
        reporter.stage("render", &self.name);
        for (index, frame) in sequence.frames.iter().enumerate() {
            let begun = Instant::now();
            if interrupt::CANCEL.load(Ordering::SeqCst) {
                return Err(renderer::Error::Cancelled.into());
            }
            let of_frame = files.of_frame(frame);
            let samples = config.method.progressive.as_ref().map(|method| (method.samples)(&config));
            let moments = sequence.moments(frame, samples);
            let (&(last_moment, _), earlier) = moments.split_last().expect("there is one at least");
            let (scene, camera) = sequence.shot(args, base, &clips, last_moment)?;
            let renderer = self.place(&mut kept, &device, scene, options)?;
            let mut chosen = None;
            if wish.is_some() {
                // All frames have the settings of the first.
                (config, chosen) = self.chosen(config, wish.take(), renderer, &camera)?;
            }
            let origin = Origin { asked: sequence.asked(args), ..Origin::of(renderer, &camera) };
            let there = |file: &PathBuf| picture::is_of(file, &origin, &config, &args.aov);
            let others = || of_frame.taps.iter().chain(&of_frame.stats).all(|file| file.exists());
            if args.resume.is_some() && of_frame.pictures.iter().all(there) && others() {
                left_out += 1;
                continue;
            }
            let profile = renderer.profile(config.whitted.mirror_roughness);
            for line in (config.method.left_out)(&profile, &config) {
                if !said.contains(&line) {
                    reporter.note(&line);
                    said.push(line);
                }
            }
            let progress = |progress: renderer::Progress<'_>| {
                let pass = format!("frame {frame}: {}", progress.pass);
                let done = (index as f64 + progress.done) / count as f64;
                reporter.progress(renderer::Progress { pass: &pass, done });
            };
            let mut grown = None;
            for &(moment, end) in earlier {
                let (scene, camera) = sequence.shot(args, base, &clips, moment)?;
                let renderer = self.place(&mut kept, &device, scene, options)?;
                grown = Some(self.grow(renderer, &camera, &config, end, grown.as_ref(), &progress)?);
            }
            if !earlier.is_empty() {
                let (scene, _) = sequence.shot(args, base, &clips, last_moment)?;
                self.place(&mut kept, &device, scene, options)?;
            }
            let renderer = kept.as_mut().expect("it was placed");
            let watch = Watch {
                alone: false,
                origin: &origin,
                resume: grown.as_ref(),
                preview: None,
                progress: &progress,
            };
            let picture = self.draw(renderer, &camera, &config, chosen.as_ref(), &of_frame, &watch)?;
            if let Some(error) = picture.failed {
                return Err(error.into());
            }
            if picture.cut {
                return Err(renderer::Error::Cancelled.into());
            }
            if let Some(sheet) = &mut sheet {
                sheet.add(&picture.display)?;
            }
            drawn.push(begun.elapsed().as_secs_f64());
            interrupt::heeded();
            last = Some(picture.report);
        }
        let mut report = last.unwrap_or_default();
        let seconds = drawn.iter().fold(0.0, |sum, seconds| sum + seconds);
        let _ = writeln!(
            report,
            "frames: {} drawn in {seconds:.1} s, {left_out} left out: they are there",
            drawn.len()
        );
        if let Some(file) = &args.film.sheet {
            let _ = writeln!(report, "{}: {count} frames side by side", text::path(file));
        }
        if !args.machine.quiet {
            reporter.clear();
            print(&report)?;
        }
        Ok(())
    }

    /// The renderer of a film, with this scene.
    fn place<'a>(
        &self,
        kept: &'a mut Option<Renderer>,
        device: &vk::Device,
        scene: Scene,
        options: &RendererOptions,
    ) -> Result<&'a mut Renderer, Failure> {
        match kept {
            Some(renderer) => {
                renderer.set_scene(scene).map_err(|error| scene::unbuilt(&self.args.common, error))?;
                Ok(renderer)
            }
            none => Ok(none.insert(scene::build(device, scene, &self.args.common, options)?)),
        }
    }

    /// What a progressive picture has come to after this moment, by `samples` in all.
    fn grow(
        &self,
        renderer: &mut Renderer,
        camera: &Camera,
        config: &RenderConfig,
        samples: u32,
        before: Option<&Resume>,
        progress: &dyn Fn(renderer::Progress<'_>),
    ) -> Result<Resume, Failure> {
        let mut config = config.clone();
        config.path_trace.spp = samples;
        let halves = self.args.aov.iter().any(|aov| aov.takes_halves());
        let request = FrameRequest {
            aovs: if halves { &[Aov::HalfA, Aov::HalfB] } else { &[] },
            resume: before,
            cancel: Some(&interrupt::CANCEL),
            progress: Some(progress),
            ..FrameRequest::default()
        };
        let frame = renderer.render(&config, camera, &request)?;
        if frame.samples != Some(samples) {
            return Err(renderer::Error::Cancelled.into());
        }
        let mut layers = frame.aovs.into_iter().map(|(_, layer)| layer);
        let halves = layers.next().zip(layers.next()).map(|(a, b)| [a, b]);
        Ok(Resume { samples, mean: frame.beauty, halves, rates: None })
    }

    /// Draws a picture and writes what is asked for of it.
    fn draw(
        &self,
        renderer: &mut Renderer,
        camera: &Camera,
        config: &RenderConfig,
        chosen: Option<&Chosen>,
        files: &Files,
        watch: &Watch<'_>,
    ) -> Result<Drawn, Failure> {
        let Self { args, reporter, name, .. } = self;
        let taps: Vec<String> = args.tap.iter().map(|(tap, _)| tap.clone()).collect();
        let profile = renderer.profile(config.whitted.mirror_roughness);
        let left_out = (config.method.left_out)(&profile, config);
        let request = FrameRequest {
            aovs: &args.aov,
            taps: &taps,
            // A budget is of warm frames.
            repeat: args.repeat.unwrap_or(u32::from(chosen.is_some())),
            time: args.time,
            noise: args.noise,
            resume: watch.resume,
            denoiser: self.denoiser.as_ref(),
            preview: watch.preview,
            cancel: Some(&interrupt::CANCEL),
            progress: Some(watch.progress),
            ..FrameRequest::default()
        };
        let frame =
            renderer.render(config, camera, &request).map_err(|error| scene::unbuilt(&args.common, error))?;
        let target =
            config.method.progressive.as_ref().map_or(0, |progressive| (progressive.samples)(config));
        let short = frame.samples.is_some_and(|n| n < target);
        if !watch.alone && short && interrupt::CANCEL.load(Ordering::SeqCst) {
            // A frame that is there is a whole one.
            return Err(renderer::Error::Cancelled.into());
        }
        interrupt::finishing();

        if watch.alone {
            reporter.stage("write", name);
        }
        let mut written = String::new();
        for file in &files.pictures {
            if interrupt::CANCEL.load(Ordering::SeqCst) && frame.samples.is_none() {
                return Err(renderer::Error::Cancelled.into());
            }
            picture::write(file, watch.origin, config, &frame)?;
            let what = content(file, config, &frame);
            let _ = writeln!(written, "{}: {what}, {}", text::path(file), extent(config));
        }
        for ((tap, layer), file) in frame.taps.iter().zip(&files.taps) {
            output::write_exr(file, &picture::tapped(tap, layer))?;
            let (width, height) = (layer.width, layer.height);
            let _ = writeln!(written, "{}: {}, {width}x{height}", text::path(file), text::line(tap));
        }

        // What is asked of the device from here on may be given up: the pictures are there, and are told of.
        interrupt::heeded();
        let mut failed = None;
        let mut seen = None;
        if frame.path_count.is_some() && !interrupt::CANCEL.load(Ordering::SeqCst) {
            match renderer.paths_seen(config, camera) {
                Ok(share) => seen = share,
                Err(error) => failed = Some(error),
            }
        }
        if let Some(line) = few_paths(renderer, &profile, &frame, seen) {
            reporter.note(&line);
        }

        let mut not_finite = NotFinite::of(config, &frame);
        if let Some(not_finite) = &mut not_finite {
            if failed.is_none() && !interrupt::CANCEL.load(Ordering::SeqCst) {
                match renderer.pass_not_finite(
                    config,
                    camera,
                    &frame,
                    not_finite.first,
                    Some(&interrupt::CANCEL),
                ) {
                    Ok(pass) => not_finite.pass = pass,
                    Err(renderer::Error::Cancelled) => {}
                    Err(error) => failed = Some(error),
                }
            }
            reporter.warning(&not_finite.line());
        }

        let mut report = header(config, renderer, &profile, &frame, seen);
        if args.explain {
            for line in profile.explain() {
                let _ = writeln!(report, "left out: {line}");
            }
            for line in &left_out {
                let _ = writeln!(report, "not modelled: {line}");
            }
            if config.indirect.boxes().is_none() {
                let visibility = config.indirect.visibility.name();
                let _ =
                    writeln!(report, "left out: visibility {visibility}: no structure over triangles' boxes");
            }
        }
        report.push_str(&table(&frame));
        if let Some(chosen) = chosen {
            report.push_str(&chosen.report);
            report.push_str(&chosen.outcome(&frame, renderer, camera));
        }
        report.push_str(&written);
        let mut economy = None;
        if args.explain && failed.is_none() && !interrupt::CANCEL.load(Ordering::SeqCst) {
            reporter.stage("economy", name);
            match economy::measure(renderer, config, camera, args.repeat, &watch.progress) {
                Ok(measured) => {
                    report.push_str(&measured.table());
                    economy = Some(measured);
                }
                Err(error) => failed = Some(error),
            }
        }
        interrupt::finishing();
        if let Some(file) = &files.stats {
            let stats = stats(
                args,
                config,
                camera,
                renderer,
                &profile,
                &frame,
                seen,
                not_finite.as_ref(),
                &files.pictures,
                economy.as_ref(),
            );
            output::write_file(file, |out| writeln!(out, "{stats:#}"))?;
            let _ = writeln!(report, "{}: statistics", text::path(file));
        }
        let cut = interrupt::CANCEL.load(Ordering::SeqCst) && short;
        Ok(Drawn { report, failed, cut, display: frame.display })
    }
}

/// What a picture holds, in words.
fn content(file: &Path, config: &RenderConfig, frame: &Frame) -> String {
    let mut what = if extension(file).as_deref() == Some("exr") {
        "linear radiance".to_owned()
    } else {
        let exposure = picture::exposure(config, frame);
        let mut what = format!("{}, exposure {exposure}", config.tone_map.operator.title());
        if config.glare.strength > 0.0 {
            let _ = write!(what, ", glare {}", config.glare.strength);
        }
        what
    };
    if frame.denoised.is_some() {
        what.push_str(", denoised");
    }
    what
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
    if args.resumed().is_some() {
        return Err(input!(
            "--denoise: not with --resume, which goes on with a reference: a denoised picture is none"
        ));
    }
    let path = std::env::var_os("PARHELION_OIDN").map(PathBuf::from);
    Ok(Some(Denoiser::load(path.as_deref())?))
}

/// Every file to write, known to be writable before anything is computed.
fn files(args: &Render, sequence: Option<&Sequence>) -> Result<Files, Failure> {
    let mut pictures = args.output.clone();
    if pictures.is_empty() && args.film.sheet.is_none() {
        let mut name = scene::stem(&args.common);
        name.push(if sequence.is_some() { ".####.png" } else { ".png" });
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
    let taps = args.tap.iter().map(|(_, file)| file.clone()).collect();
    let files = Files { pictures, taps, stats: args.stats.clone() };
    if let Some(sequence) = sequence {
        sequence.check(&files)?;
    }
    let first = sequence.map(|sequence| files.of_frame(*sequence.frames.range.start()));
    let first = first.as_ref().unwrap_or(&files);
    if let Some(sheet) = &args.film.sheet
        && extension(sheet).as_deref() != Some("png")
    {
        return Err(input!("--sheet: {}: it is written as .png", sheet.display()));
    }
    let all = || first.all().chain(&args.film.sheet);
    for (index, file) in all().enumerate() {
        if all().take(index).any(|earlier| earlier == file) {
            return Err(input!("{}: named twice", file.display()));
        }
        output::check_writable(file).map_err(Failure::input)?;
    }
    Ok(files)
}

/// With fewer paths than 1/(⅓)² a mean over them differs by more than a third from seed to seed.
const FEW_PATHS: f64 = 9.0;

/// What the user should know of a picture whose indirect light rests on few paths, of which this share is seen.
fn few_paths(
    renderer: &Renderer,
    profile: &SceneProfile,
    frame: &Frame,
    seen: Option<f64>,
) -> Option<String> {
    let (scene, paths, share) = (renderer.scene(), frame.path_count?, seen?);
    // So few were asked for.
    if f64::from(paths) < FEW_PATHS {
        return None;
    }
    let black = |environment: &Environment| environment.texels.iter().all(|&texel| texel == Vec3::ZERO);
    let shines = profile.emission
        || scene.lights.iter().any(|light| light.intensity != Vec3::ZERO)
        || scene.environment.as_ref().is_some_and(|environment| !black(environment));
    let mut materials = scene.meshes.iter().flat_map(|mesh| &mesh.materials);
    if !shines || !materials.any(|&material| scene.materials[material as usize].may_scatter()) {
        return None;
    }
    let count = (share * f64::from(paths)).round();
    let remedy = "more of them (--vpls) may find what there is";
    if frame.vpl_count == Some(0) {
        return Some(format!(
            "none of {paths} light paths left a VPL: indirect light, if there is any, is missing; {remedy}"
        ));
    }
    // Where most are seen they are well spread, and as few as was asked for.
    (count < FEW_PATHS && share < 0.5).then(|| match count {
        0.0 => format!("none of {paths} light paths lights anything that is seen: indirect light, if there is any, is missing; {remedy}"),
        _ => format!(
            "indirect light rests on {count} of {paths} light paths: pictures differ by over a third from seed to seed; {remedy}"
        ),
    })
}

fn header(
    config: &RenderConfig,
    renderer: &Renderer,
    profile: &SceneProfile,
    frame: &Frame,
    seen: Option<f64>,
) -> String {
    let info = renderer.device().info();
    let (backend, reason) = renderer.backend();
    let cpu = if info.kind == DeviceKind::Cpu { ", a CPU device" } else { "" };
    let lights = renderer.scene().lights.len();
    let mut text = format!(
        "scene: {}, {} triangles, {lights} light{}\n",
        text::line(&renderer.scene().name),
        profile.triangles,
        if lights == 1 { "" } else { "s" },
    );
    let _ = write!(text, "method: {}, {}", config.method.name, extent(config));
    if let (Some(vpls), Some(paths), Some(distance)) = (frame.vpl_count, frame.path_count, frame.min_distance)
    {
        let _ = write!(text, ", {vpls} VPLs of {paths} paths");
        if let Some(share) = seen {
            let _ = write!(text, " ({:.1} % seen)", 100.0 * share);
        }
        let _ = write!(text, ", min distance {distance:.3} m");
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
