//! Finished frames as files and back: `.exr` holds linear radiance, the layers that were drawn and a header that says
//! what made the picture, `.png` what a screen shows; a progressive render goes on from an `.exr`.
//!
//! ```no_run
//! # use parhelion::{config::RenderConfig, picture, renderer::*, scene, vk};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let device = vk::Device::open(&vk::DeviceOptions::default())?;
//! # let scene = scene::builtin::by_name("cornell")?;
//! # let camera = scene.cameras[0].clone();
//! # let mut renderer = Renderer::new(&device, scene, &RendererOptions::default())?;
//! # let mut config = RenderConfig::default();
//! config.apply_override("method=path")?;
//! let origin = picture::Origin::of(&renderer, &camera);
//! let file = std::path::Path::new("cornell.exr");
//! let frame = renderer.render(&config, &camera, &FrameRequest::default())?;
//! picture::write(file, &origin, &config, &frame)?;
//! // Twice as many samples, to the bits of a render without a break.
//! config.path_trace.spp *= 2;
//! let resume = Resume::read(file, &config, &origin, false)?;
//! let request = FrameRequest { resume: Some(&resume), ..FrameRequest::default() };
//! let frame = renderer.render(&config, &camera, &request)?;
//! # Ok(())
//! # }
//! ```

use crate::ErrorClass;
use crate::config::RenderConfig;
use crate::output::{self, Attribute, Channels, Picture, extension};
use crate::renderer::{Aov, Frame, Layer, Renderer, Resume};
use crate::scene::Camera;
use crate::techniques::path_trace::PathTraceConfig;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

/// What draws a picture beside its settings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    /// The scene's name.
    pub scene: String,
    /// [`crate::scene::Scene::fingerprint`] of scene and camera, 16 hexadecimal digits.
    pub scene_hash: String,
    /// The device's name.
    pub device: String,
    /// Its driver and version.
    pub driver: String,
    /// The backend's name.
    pub backend: String,
    /// What else was asked of the picture, in words, such as a limit of time; empty where nothing was.
    pub asked: String,
}

impl Origin {
    /// Of pictures that `renderer` draws of its scene, as it is now, by `camera`.
    #[must_use]
    pub fn of(renderer: &Renderer, camera: &Camera) -> Self {
        let info = renderer.device().info();
        Self {
            scene: renderer.scene().name.clone(),
            scene_hash: format!("{:016x}", renderer.scene().fingerprint(camera)),
            device: info.name.clone(),
            driver: info.driver(),
            backend: renderer.backend().0.name().to_owned(),
            asked: String::new(),
        }
    }
}

/// Writes a frame as its file's name says: [`exr()`] to `.exr`, [`Frame::display`] to `.png`, with text chunks for tone
/// mapping, exposure, glare and denoiser.
///
/// # Errors
/// A name that ends in neither, or a file that cannot be written.
pub fn write(
    file: &Path,
    origin: &Origin,
    config: &RenderConfig,
    frame: &Frame,
) -> Result<(), output::Error> {
    match extension(file).as_deref() {
        Some("exr") => output::write_exr(file, &exr(origin, config, frame)),
        Some("png") => {
            let mut texts = vec![
                ("Software", output::SOFTWARE.to_owned()),
                ("Tone mapping", config.tone_map.operator.title().to_owned()),
                ("Exposure", exposure(config, frame)),
                ("Scene hash", origin.scene_hash.clone()),
                ("Backend", origin.backend.clone()),
                ("Settings", settings(config)),
            ];
            if !origin.asked.is_empty() {
                texts.push(("Asked", origin.asked.clone()));
            }
            let glare = &config.glare;
            if glare.strength > 0.0 {
                texts.push(("Glare", format!("strength {}, radius {}", glare.strength, glare.radius)));
            }
            if let Some(denoised) = &frame.denoised {
                texts.push(("Denoiser", denoised.by.clone()));
            }
            output::write_png(file, frame.beauty.width, &frame.display, &texts)
        }
        _ => {
            let source = io::Error::new(io::ErrorKind::InvalidInput, "pictures are written as .exr or .png");
            Err(output::Error { file: file.into(), source })
        }
    }
}

/// Exposure of [`Frame::display`] for people: stops, and whether they were chosen by brightness.
#[must_use]
pub fn exposure(config: &RenderConfig, frame: &Frame) -> String {
    let how = match (config.tone_map.exposure, config.crop) {
        (Some(_), _) => "",
        (None, None) => " (auto)",
        (None, Some(_)) => " (auto, of the crop)",
    };
    format!("{:+.2} EV{how}", frame.exposure_ev)
}

/// Radiance as `R`, `G`, `B`, the frame's layers as `NAME.R` and so on (depth as `Z`, vectors by `X`, `Y`, `Z`), radiance
/// before denoising as `noisy.R`, `noisy.G`, `noisy.B`; attributes `parhelion:…` for origin, settings (JSON), seed and
/// what came of them.
#[must_use]
pub fn exr<'a>(origin: &Origin, config: &RenderConfig, frame: &'a Frame) -> Picture<'a> {
    let mut channels = vec![layer_channels("", &["R", "G", "B"], &frame.beauty)];
    for (aov, layer) in &frame.aovs {
        let name = if *aov == Aov::Depth { "" } else { aov.name() };
        channels.push(layer_channels(name, aov.channel_names(), layer));
    }
    if let Some(denoised) = &frame.denoised {
        channels.push(layer_channels("noisy", &["R", "G", "B"], &denoised.noisy));
    }
    let text = |value: &dyn ToString| Attribute::Text(value.to_string());
    let json = |value: serde_json::Result<String>| Attribute::Text(value.unwrap_or_default());
    let number = |value: f64| Attribute::Number(value);
    let mut attributes = vec![
        ("parhelion:version", text(&env!("CARGO_PKG_VERSION"))),
        ("parhelion:scene", text(&origin.scene)),
        ("parhelion:scene_hash", text(&origin.scene_hash)),
        ("parhelion:method", text(&config.method.name)),
        ("parhelion:settings", text(&settings(config))),
        ("parhelion:seed", number(config.seed.into())),
        ("parhelion:device", text(&origin.device)),
        ("parhelion:driver", text(&origin.driver)),
        ("parhelion:backend", text(&origin.backend)),
        ("parhelion:times", json(serde_json::to_string(&frame.passes))),
        ("parhelion:exposure_ev", number(frame.exposure_ev.into())),
    ];
    if !origin.asked.is_empty() {
        attributes.push(("parhelion:asked", text(&origin.asked)));
    }
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

/// All settings, as JSON.
fn settings(config: &RenderConfig) -> String {
    serde_json::to_string(config).unwrap_or_default()
}

/// Whether a file is a picture that [`write()`] left of the same scene, camera, settings and backend, with these layers if it
/// is an `.exr`. One that can't be read is none.
#[must_use]
pub fn is_of(file: &Path, origin: &Origin, config: &RenderConfig, aovs: &[Aov]) -> bool {
    let made_of = [&origin.scene_hash, &origin.backend, &settings(config), &origin.asked];
    match extension(file).as_deref() {
        Some("exr") => output::read_exr(file).is_ok_and(|read| {
            let keys = ["scene_hash", "backend", "settings", "asked"].map(|key| format!("parhelion:{key}"));
            let same = keys.iter().zip(made_of).all(|(key, made_of)| match read.attributes.get(key) {
                Some(Attribute::Text(text)) => text == made_of,
                _ => made_of.is_empty(),
            });
            let has = |aov: &Aov| {
                let named =
                    |channel: &str| channel.strip_prefix(aov.name()).is_some_and(|c| c.starts_with('.'));
                read.channels.keys().any(|name| named(name) || *aov == Aov::Depth && name == "Z")
            };
            same && aovs.iter().all(has)
        }),
        Some("png") => output::read_png_texts(file).is_ok_and(|texts| {
            let of =
                |key: &str| texts.iter().find(|(keyword, _)| keyword == key).map_or("", |(_, text)| text);
            let keys = ["Scene hash", "Backend", "Settings", "Asked"];
            keys.iter().zip(made_of).all(|(key, made_of)| of(key) == made_of)
        }),
        _ => false,
    }
}

/// A resource as a pass left it ([`Frame::taps`]): one channel as `Y`, up to four as `R`, `G`, `B`, `A`, more by number.
#[must_use]
pub fn tapped<'a>(tap: &str, layer: &'a Layer) -> Picture<'a> {
    let names = match layer.channels {
        1 => vec!["Y".to_owned()],
        n @ 2..=4 => ["R", "G", "B", "A"][..n].iter().map(ToString::to_string).collect(),
        n => (0..n).map(|channel| format!("c{channel}")).collect(),
    };
    Picture {
        size: [layer.width, layer.height],
        window: [0, 0, layer.width, layer.height],
        channels: vec![Channels { names, data: &layer.data }],
        attributes: vec![("parhelion:tap", Attribute::Text(tap.to_owned()))],
    }
}

fn layer_channels<'a>(name: &str, suffixes: &[&str], layer: &'a Layer) -> Channels<'a> {
    let named = |suffix: &&str| match name {
        "" => (*suffix).to_owned(),
        _ => format!("{name}.{suffix}"),
    };
    Channels { names: suffixes.iter().map(named).collect(), data: &layer.data }
}

/// The settings that decide which samples there are, as text; how many is not one of them.
fn sampling(config: &RenderConfig) -> String {
    let path_trace =
        PathTraceConfig { spp: 0, max_depth: Some(config.max_depth()), ..config.path_trace.clone() };
    serde_json::json!({
        "method": config.method.name,
        "path_trace": path_trace,
        "energy_conserving": config.energy_conserving,
        "shadow_terminator": config.shadow_terminator,
        "panes": config.panes,
        "light_choice": config.light_choice,
    })
    .to_string()
}

/// What differs between two texts of [`sampling`], as it is in each; the texts themselves where they are none.
fn differing(there: String, here: String) -> (String, String) {
    fn leaves(path: &str, value: &Value, found: &mut BTreeMap<String, String>) {
        match value {
            Value::Object(members) => {
                members.iter().for_each(|(name, value)| leaves(&format!("{path}.{name}"), value, found));
            }
            value => drop(found.insert(path.trim_start_matches('.').to_owned(), value.to_string())),
        }
    }
    let parsed = [&there, &here].map(|text| {
        let mut found = BTreeMap::new();
        leaves("", &serde_json::from_str(text).unwrap_or_default(), &mut found);
        found
    });
    let only = |a: usize, b: usize| {
        let differ = parsed[a].iter().filter(|(name, value)| parsed[b].get(*name) != Some(value));
        differ.map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>().join(", ")
    };
    match (only(0, 1), only(1, 0)) {
        (a, b) if a.is_empty() || b.is_empty() => (there, here),
        differing => differing,
    }
}

/// A picture that a render cannot go on from.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResumeError {
    /// The file cannot be read, or is no OpenEXR picture.
    #[error(transparent)]
    Read(#[from] output::Error),
    /// No progressive method wrote it.
    #[error("{}: its header names no number of samples, as that of a path-traced picture does", file.display())]
    NoSamples {
        /// The file.
        file: PathBuf,
    },
    /// It was drawn of another scene or in another way.
    #[error("{}: its {what} is {there}, not {here}", file.display())]
    Differs {
        /// The file.
        file: PathBuf,
        /// What is different: size, window, scene hash (with the camera), seed, backend or sampling.
        what: &'static str,
        /// What the file says.
        there: String,
        /// What the render at hand has.
        here: String,
    },
    /// Channels that the render at hand goes on from are not there.
    #[error("{}: has no {channels}", file.display())]
    Missing {
        /// The file.
        file: PathBuf,
        /// Their names, and what needs them.
        channels: &'static str,
    },
}

impl ResumeError {
    /// What kind of failure this is: bad input.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        ErrorClass::Input
    }
}

impl Resume {
    /// Reads a picture that [`write()`] left of a progressive render, to go on from it by `config`. `halves` says that the
    /// render at hand has a limit to noise or draws a layer that takes halves ([`Aov::takes_halves`]).
    ///
    /// # Errors
    /// [`ResumeError`] names the file and what does not fit: a picture of another size, window, scene, seed, backend or
    /// sampling, or one without the layers that `halves` and adaptive sampling need.
    pub fn read(
        file: &Path,
        config: &RenderConfig,
        origin: &Origin,
        halves: bool,
    ) -> Result<Self, ResumeError> {
        let read = output::read_exr(file)?;
        let text = |key: &str| match read.attributes.get(key) {
            Some(Attribute::Text(text)) => Some(text.clone()),
            Some(Attribute::Number(number)) => Some(number.to_string()),
            None => None,
        };
        let samples = text("parhelion:samples").and_then(|n| n.parse().ok());
        let Some(samples) = samples.filter(|&n: &u32| n > 0) else {
            return Err(ResumeError::NoSamples { file: file.into() });
        };
        let size = |[width, height]: [u32; 2]| format!("{width}x{height}");
        for (what, there, here) in [
            ("size", size(read.size), size(config.size)),
            ("window", format!("{:?}", read.window), format!("{:?}", config.window())),
            ("scene hash", text("parhelion:scene_hash").unwrap_or_default(), origin.scene_hash.clone()),
            ("seed", text("parhelion:seed").unwrap_or_default(), config.seed.to_string()),
            ("backend", text("parhelion:backend").unwrap_or_default(), origin.backend.clone()),
            ("sampling", text("parhelion:sampling").unwrap_or_default(), sampling(config)),
        ] {
            if there != here {
                let (there, here) = differing(there, here);
                return Err(ResumeError::Differs { file: file.into(), what, there, here });
            }
        }
        let missing = |channels| ResumeError::Missing { file: file.into(), channels };
        let layer = |names: [&str; 3]| {
            let [x0, y0, x1, y1] = read.window;
            Some(Layer { width: x1 - x0, height: y1 - y0, channels: 3, data: read.interleaved(&names)? })
        };
        let noisy = layer(["noisy.R", "noisy.G", "noisy.B"]);
        let mean = noisy.or_else(|| layer(["R", "G", "B"])).ok_or_else(|| missing("channels R, G and B"))?;
        let kept = layer(["half_a.R", "half_a.G", "half_a.B"])
            .zip(layer(["half_b.R", "half_b.G", "half_b.B"]))
            .map(|(a, b)| [a, b]);
        let rates = layer(["rate.now", "rate.variance", "rate.taken"]);
        if config.path_trace.adaptive && (kept.is_none() || rates.is_none()) {
            return Err(missing("layers half_a, half_b and rate, which adaptive sampling goes on from"));
        }
        if halves && kept.is_none() {
            return Err(missing(
                "layers half_a and half_b, which a limit to noise and the layer variance go on from",
            ));
        }
        Ok(Self { samples, mean, halves: kept, rates })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common;
    use crate::methods::path;

    /// A frame of 3×2 pixels with both halves, its settings and its origin.
    fn drawn() -> (Frame, RenderConfig, Origin) {
        let layer = |first: u8| Layer {
            width: 3,
            height: 2,
            channels: 3,
            data: (first..first + 18).map(f32::from).collect(),
        };
        let frame = Frame {
            beauty: layer(0),
            aovs: vec![(Aov::HalfA, layer(50)), (Aov::HalfB, layer(100))],
            samples: Some(7),
            ..common::frame()
        };
        let config = RenderConfig { method: &path::METHOD, size: [3, 2], ..RenderConfig::default() };
        let word = |word: &str| word.to_owned();
        let origin = Origin {
            scene: word("room"),
            scene_hash: word("0123456789abcdef"),
            device: word("device"),
            driver: word("driver 1"),
            backend: word("software"),
            asked: String::new(),
        };
        (frame, config, origin)
    }

    #[test]
    fn what_was_written_is_resumed() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.exr");
        let (frame, config, origin) = drawn();
        write(&file, &origin, &config, &frame).unwrap();
        // Another device will do: the fingerprints and the backend decide.
        let other = Origin { device: "another".into(), ..origin.clone() };
        let more = RenderConfig {
            path_trace: PathTraceConfig { spp: 500, ..config.path_trace.clone() },
            ..config.clone()
        };
        let resume = Resume::read(&file, &more, &other, true).unwrap();
        assert_eq!((resume.samples, &resume.mean), (7, &frame.beauty));
        let halves = resume.halves.unwrap();
        assert!(halves.iter().eq(frame.aovs.iter().map(|(_, layer)| layer)));
        assert!(resume.rates.is_none());
    }

    type Change<'a> = &'a dyn Fn(&mut RenderConfig, &mut Origin);

    #[test]
    fn what_does_not_fit_is_refused_by_file_and_name() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.exr");
        let (frame, config, origin) = drawn();
        write(&file, &origin, &config, &frame).unwrap();
        let refused = |change: Change<'_>| {
            let (mut config, mut origin) = (config.clone(), origin.clone());
            change(&mut config, &mut origin);
            let error = Resume::read(&file, &config, &origin, false).unwrap_err();
            assert_eq!(error.class(), ErrorClass::Input);
            assert!(error.to_string().contains("a.exr"), "{error}");
            error
        };
        let changes: [(&str, Change<'_>); 6] = [
            ("size", &|config, _| config.size = [2, 3]),
            ("window", &|config, _| config.crop = Some([0, 0, 1, 1])),
            ("scene hash", &|_, origin| origin.scene_hash = "another".into()),
            ("seed", &|config, _| config.seed = 1),
            ("backend", &|_, origin| origin.backend = "ray-query".into()),
            ("sampling", &|config, _| config.path_trace.max_depth = Some(2)),
        ];
        for (expected, change) in changes {
            let error = refused(change);
            assert!(matches!(error, ResumeError::Differs { what, .. } if what == expected), "{error}");
        }

        let without = Frame { aovs: Vec::new(), ..frame.clone() };
        write(&file, &origin, &config, &without).unwrap();
        Resume::read(&file, &config, &origin, false).unwrap();
        let error = Resume::read(&file, &config, &origin, true).unwrap_err();
        assert!(
            error.to_string().ends_with("half_b, which a limit to noise and the layer variance go on from")
        );
        let mut adaptive = config.clone();
        adaptive.path_trace.adaptive = true;
        write(&file, &origin, &adaptive, &frame).unwrap();
        let error = Resume::read(&file, &adaptive, &origin, false).unwrap_err();
        assert!(
            matches!(error, ResumeError::Missing { .. }) && error.to_string().contains("rate"),
            "{error}"
        );

        write(&file, &origin, &config, &Frame { samples: None, ..frame }).unwrap();
        let error = Resume::read(&file, &config, &origin, false).unwrap_err();
        assert!(matches!(error, ResumeError::NoSamples { .. }), "{error}");
        assert!(matches!(
            Resume::read(Path::new("none.exr"), &config, &origin, false),
            Err(ResumeError::Read(_))
        ));
    }

    /// A denoised picture keeps what its samples drew, which is what a render goes on from.
    #[test]
    fn noisy_radiance_is_what_is_resumed() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.exr");
        let (mut frame, config, origin) = drawn();
        let noisy = Layer { data: vec![0.5; 18], ..frame.beauty.clone() };
        frame.denoised =
            Some(crate::renderer::Denoised { noisy: noisy.clone(), by: "denoiser".into(), ms: 1.0 });
        write(&file, &origin, &config, &frame).unwrap();
        assert_eq!(Resume::read(&file, &config, &origin, false).unwrap().mean, noisy);
    }

    #[test]
    fn other_endings_are_refused() {
        let (frame, config, origin) = drawn();
        let error = write(Path::new("a.jpg"), &origin, &config, &frame).unwrap_err();
        assert!(error.to_string().contains("a.jpg: pictures are written as .exr or .png"), "{error}");
    }
}
