//! What errors are measured against: two path traced pictures of seeds that nothing else uses. Their mean is the
//! reference, a quarter of the squared difference between them its own noise.

use crate::ErrorClass;
use crate::config::RenderConfig;
use crate::methods;
use crate::output::{self, Attribute, Channels, Picture, ReadPicture, read_exr, write_exr};
use crate::renderer::{self, FrameRequest, Layer, Progress, Renderer};
use crate::scene::Camera;
use crate::techniques::path_trace::{PathTraceConfig, PixelFilter};
use crate::vk;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Seeds of the two halves.
pub const SEEDS: [u32; 2] = [0x5eed_aaaa, 0x5eed_bbbb];

/// Samples a pixel of both halves together, unless others are asked for: in the Office 384 leave a relMSE of 0.03, ten
/// times less than which virtual lights reach.
pub const SAMPLES: u32 = 16384;

/// … and time for them, unless a number is asked for.
pub const TIME: Duration = Duration::from_secs(240);

/// Edges of the longest paths, unless others are asked for: what is beyond 64 of them shows in no room.
pub const DEPTH: u32 = 64;

/// A picture to measure against.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Radiance, three channels a pixel.
    pub layer: Layer,
    /// Two independent pictures it is the mean of.
    pub halves: Option<[Layer; 2]>,
    /// How it was made, in words.
    pub about: String,
    /// Samples a pixel, where known.
    pub spp: Option<u32>,
}

/// Which reference is wanted.
#[derive(Clone, Copy)]
pub struct ReferenceRequest<'a> {
    /// Where the scene is seen from.
    pub camera: &'a Camera,
    /// Pixels.
    pub size: [u32; 2],
    /// Samples a pixel; otherwise [`SAMPLES`], or as many as fit in the time.
    pub spp: Option<u32>,
    /// Time for it where `spp` is not given.
    pub time: Duration,
    /// Edges of the longest paths.
    pub depth: u32,
    /// A file that may hold it, and will, beside the one in the user's cache folder.
    pub file: &'a Path,
    /// Set to stop.
    pub cancel: Option<&'a AtomicBool>,
    /// Told what is being done.
    pub progress: Option<&'a dyn Fn(Progress<'_>)>,
}

/// A reference that cannot be made or used.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    /// It cannot be rendered.
    #[error(transparent)]
    Render(#[from] renderer::Error),
    /// Its file cannot be read or written.
    #[error(transparent)]
    File(#[from] output::Error),
    /// It cannot be measured against.
    #[error("{file}: {problem}")]
    Unfit {
        /// Its file.
        file: String,
        /// Why not.
        problem: String,
    },
}

impl ReferenceError {
    /// What kind of failure this is.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        match self {
            Self::Render(error) => error.class(),
            Self::File(error) => error.class(),
            Self::Unfit { .. } => ErrorClass::Input,
        }
    }
}

const HALVES: [[&str; 3]; 2] = [["half_a.R", "half_a.G", "half_a.B"], ["half_b.R", "half_b.G", "half_b.B"]];

/// Attribute that references have, and other pictures do not.
const ABOUT: &str = "parhelion:reference";

/// The two independent pictures that a reference is the mean of, three channels each.
///
/// Other pictures have none: what a render calls halves is every other sample of a stratified set.
#[must_use]
pub fn halves(picture: &ReadPicture) -> Option<[Vec<f32>; 2]> {
    picture.attributes.get(ABOUT)?;
    let [a, b] = HALVES.each_ref().map(|names| picture.interleaved(names));
    Some([a?, b?])
}

impl Reference {
    /// Reads a picture of `size` pixels, with its halves where it has them.
    ///
    /// # Errors
    /// A file that is no such picture, or holds values that nothing can be measured against.
    pub fn read(file: &Path, size: [u32; 2]) -> Result<Self, ReferenceError> {
        let unfit = |problem: String| ReferenceError::Unfit { file: file.display().to_string(), problem };
        let picture = read_exr(file)?;
        let [width, height] = size;
        if picture.size != size || picture.window != [0, 0, width, height] {
            let [w, h] = picture.size;
            return Err(unfit(format!("{w}x{h} pixels, or a part of them, not {width}x{height}")));
        }
        let layer =
            |names: &[&str; 3]| Some(Layer { width, height, channels: 3, data: picture.interleaved(names)? });
        let Some(mean) = layer(&["R", "G", "B"]) else { return Err(unfit("no channels R, G and B".into())) };
        if let Some(at) = mean.data.iter().position(|value| !value.is_finite()) {
            let (x, y) = (at / 3 % width as usize, at / 3 / width as usize);
            return Err(unfit(format!("{} at pixel {x},{y}", mean.data[at])));
        }
        if mean.data.iter().all(|&value| value == 0.0) {
            return Err(unfit("black: relative errors have nothing to relate to".into()));
        }
        let spp = match picture.attributes.get("parhelion:samples") {
            Some(Attribute::Number(samples)) => Some(*samples as u32),
            _ => None,
        };
        let about = match picture.attributes.get(ABOUT) {
            Some(Attribute::Text(text)) => text.clone(),
            _ => format!("the picture {}", file.display()),
        };
        let halves =
            halves(&picture).map(|halves| halves.map(|data| Layer { width, height, channels: 3, data }));
        Ok(Self { layer: mean, halves, about, spp })
    }

    /// A mean squared error that the reference's own noise adds to any picture's, by `measure` of its half against it;
    /// none without halves.
    #[must_use]
    pub fn noise(&self, measure: impl Fn(&[f32], &[f32]) -> f64) -> Option<f64> {
        // (a − (a + b)/2)² = (a − b)²/4
        self.halves.as_ref().map(|[a, _]| measure(&a.data, &self.layer.data))
    }

    /// A number that changes with its pixels.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let words = self.layer.data.iter().flat_map(|value| value.to_bits().to_le_bytes());
        let hash = words
            .fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01b3));
        format!("{hash:016x}")
    }

    fn write(&self, file: &Path, identity: &str, asked: u32) -> Result<(), output::Error> {
        let [width, height] = [self.layer.width, self.layer.height];
        let names = |names: [&str; 3]| names.map(String::from).to_vec();
        let mut channels = vec![Channels { names: names(["R", "G", "B"]), data: &self.layer.data }];
        for (half, half_names) in self.halves.iter().flatten().zip(HALVES) {
            channels.push(Channels { names: names(half_names), data: &half.data });
        }
        let attributes = vec![
            (ABOUT, Attribute::Text(self.about.clone())),
            ("parhelion:identity", Attribute::Text(identity.into())),
            ("parhelion:asked", Attribute::Number(asked.into())),
            ("parhelion:samples", Attribute::Number(self.spp.unwrap_or_default().into())),
        ];
        write_exr(
            file,
            &Picture { size: [width, height], window: [0, 0, width, height], channels, attributes },
        )
    }
}

/// Finds the reference in its file or the user's cache folder, or renders it.
///
/// # Errors
/// A cancelled or failed render, a black picture, or a file that cannot be written.
pub fn reference(
    renderer: &mut Renderer,
    request: &ReferenceRequest<'_>,
) -> Result<Reference, ReferenceError> {
    let identity = identity(renderer, request.camera, request.size, request.depth);
    // What was rendered until the time was over will do again, unless more is asked for.
    let asked = request.spp.unwrap_or(0);
    let fits = |file: &Path| {
        let attributes = read_exr(file).ok()?.attributes;
        let number = |key: &str| match attributes.get(key) {
            Some(Attribute::Number(number)) => Some(*number as u32),
            _ => None,
        };
        let same = attributes.get("parhelion:identity") == Some(&Attribute::Text(identity.clone()));
        let enough = number("parhelion:samples")? >= request.spp.unwrap_or(SAMPLES);
        (same && (enough || number("parhelion:asked")? == asked)).then_some(())
    };
    let cache = cache_file(&identity);
    for file in std::iter::once(request.file).chain(cache.as_deref()) {
        if fits(file).is_some()
            && let Ok(reference) = Reference::read(file, request.size)
        {
            if file != request.file {
                reference.write(request.file, &identity, asked)?;
            }
            return Ok(reference);
        }
    }
    let reference = render(renderer, request)?;
    reference.write(request.file, &identity, asked)?;
    // A cache that cannot be written is only slower next time.
    if let Some(file) = cache.filter(|file| !output::is_stream(file)) {
        let written = file.parent().map_or(Ok(()), std::fs::create_dir_all);
        if written.is_err() || reference.write(&file, &identity, asked).is_err() {
            tracing::debug!("{}: cannot be written", file.display());
        }
    }
    // Read back as any other, with the checks that come with it.
    Reference::read(request.file, request.size)
}

fn cache_file(identity: &str) -> Option<PathBuf> {
    Some(vk::cache_folder()?.join("references").join(format!("{identity}.exr")))
}

/// The reference of a scene that is in the user's cache folder, if there is one, made in the usual way.
#[must_use]
pub fn cached(renderer: &Renderer, camera: &Camera, size: [u32; 2]) -> Option<Reference> {
    Reference::read(&cache_file(&identity(renderer, camera, size, DEPTH))?, size).ok()
}

/// What decides a reference but for its number of samples.
fn identity(renderer: &Renderer, camera: &Camera, [width, height]: [u32; 2], depth: u32) -> String {
    let fingerprint = renderer.scene().fingerprint(camera);
    format!("{fingerprint:016x}-{width}x{height}-{depth}-{}", env!("CARGO_PKG_VERSION"))
}

/// Renders it, whatever there is.
pub(super) fn render(
    renderer: &mut Renderer,
    request: &ReferenceRequest<'_>,
) -> Result<Reference, renderer::Error> {
    let mut spp = request.spp.unwrap_or(SAMPLES).div_ceil(2).max(1);
    let mut half = |index: usize, time: Option<Duration>, spp: u32| {
        let config = RenderConfig {
            method: methods::REFERENCE,
            size: request.size,
            seed: SEEDS[index],
            path_trace: PathTraceConfig {
                spp,
                max_depth: Some(request.depth),
                pixel_filter: PixelFilter::Center,
                ..PathTraceConfig::default()
            },
            ..RenderConfig::default()
        };
        let progress = |progress: Progress<'_>| {
            if let Some(report) = request.progress {
                report(Progress { pass: "reference", done: 0.5 * (index as f64 + progress.done) });
            }
        };
        let frame_request = FrameRequest {
            time,
            cancel: request.cancel,
            progress: Some(&progress),
            ..FrameRequest::default()
        };
        let frame = renderer.render(&config, request.camera, &frame_request)?;
        // A progressive picture that was cut short comes as if it were whole.
        if request.cancel.is_some_and(|cancel| cancel.load(Ordering::SeqCst)) {
            return Err(renderer::Error::Cancelled);
        }
        Ok((frame.beauty, frame.samples.unwrap_or(spp)))
    };
    let time = request.spp.is_none().then_some(request.time / 2);
    let (a, samples) = half(0, time, spp)?;
    spp = samples;
    let (b, _) = half(1, None, spp)?;
    let data = a.data.iter().zip(&b.data).map(|(a, b)| 0.5 * (a + b)).collect();
    let about = format!("path tracing, at most {} edges a path", request.depth);
    let layer = Layer { data, ..a.clone() };
    Ok(Reference { layer, halves: Some([a, b]), about, spp: Some(2 * spp) })
}
