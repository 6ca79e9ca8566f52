//! `parhelion render --frames`: which frames, when they are, what sees them and where they go.

use super::args::{Frames, Render};
use super::failure::{Failure, input};
use super::progress::Reporter;
use super::scene;
use crate::config::RenderConfig;
use crate::output::extension;
use crate::scene::{Camera, CameraPath, Scene};
use std::collections::HashSet;
use std::f32::consts::TAU;
use std::path::{Path, PathBuf};

/// A film.
pub(super) struct Sequence {
    pub(super) frames: Frames,
    fps: f64,
    /// Share of a frame's time that the shutter is open.
    shutter: f64,
    way: Way,
}

/// Most moments that the samples of a frame are spread over.
const MOMENTS: u32 = 64;

/// What the camera does.
enum Way {
    /// What the scene's does.
    Scene,
    /// It goes once around in so many frames.
    Turntable(u32),
    Path(CameraPath),
}

/// Where a picture and what is told of it go.
pub(super) struct Files {
    pub(super) pictures: Vec<PathBuf>,
    pub(super) taps: Vec<PathBuf>,
    pub(super) stats: Option<PathBuf>,
}

impl Files {
    pub(super) fn all(&self) -> impl Iterator<Item = &PathBuf> + Clone {
        self.pictures.iter().chain(&self.taps).chain(&self.stats)
    }

    /// Whether any is tone mapped.
    pub(super) fn shows_screens(&self) -> bool {
        self.pictures.iter().any(|file| extension(file).as_deref() == Some("png"))
    }

    /// With the frame's number in place of `#`.
    pub(super) fn of_frame(&self, frame: u32) -> Self {
        let numbered = |file: &PathBuf| numbered(file, frame);
        Self {
            pictures: self.pictures.iter().map(numbered).collect(),
            taps: self.taps.iter().map(numbered).collect(),
            stats: self.stats.as_ref().map(numbered),
        }
    }
}

impl Sequence {
    /// The film asked for, if one is.
    pub(super) fn of(args: &Render, config: &RenderConfig) -> Result<Option<Self>, Failure> {
        let film = &args.film;
        let way = match (&film.turntable, &film.camera_path) {
            (Some(count), _) => Way::Turntable(*count),
            (_, Some(file)) => Way::Path(
                CameraPath::read(file)
                    .map_err(|problem| input!("--camera-path: {}: {problem}", file.display()))?,
            ),
            _ => Way::Scene,
        };
        let frames = match (&film.frames, &way) {
            (Some(frames), _) => frames.clone(),
            (None, Way::Turntable(count)) => Frames { range: 1..=*count, step: 1 },
            (None, _) if film.fps.is_some() => return Err(input!("--fps: needs --frames")),
            (None, _) if film.shutter.is_some() => return Err(input!("--shutter: needs --frames")),
            (None, _) if film.sheet.is_some() => return Err(input!("--sheet: needs --frames")),
            (None, _) if film.animation.is_some() => return Err(input!("--animation: needs --frames")),
            (None, _) if matches!(args.resume, Some(None)) => {
                return Err(input!("--resume: needs the picture to go on from, or --frames"));
            }
            (None, _) => return Ok(None),
        };
        let single = [
            (args.explain, "--explain"),
            (args.preview.is_some(), "--preview"),
            (args.resumed().is_some(), "--resume FILE.exr"),
        ];
        if let Some((_, option)) = single.iter().find(|(given, _)| *given) {
            return Err(input!("{option}: of a single picture, not of --frames"));
        }
        let shutter = film.shutter.unwrap_or(0.0);
        let ends = [(args.time.is_some(), "--time"), (args.noise.is_some(), "--noise")];
        let progressive = config.method.progressive.as_ref();
        let adapts = progressive.is_some_and(|method| (method.adaptive)(config));
        for (given, option) in
            ends.into_iter().chain([(adapts, "--adaptive"), (args.repeat.is_some(), "--repeat")])
        {
            if given && shutter > 0.0 {
                return Err(input!("{option}: not with --shutter, whose samples are spread over time"));
            }
        }
        Ok(Some(Self { frames, fps: film.fps.unwrap_or(24.0), shutter, way }))
    }

    /// Whether the scene is expected to move.
    pub(super) fn is_timed(&self) -> bool {
        matches!(self.way, Way::Scene)
    }

    pub(super) fn count(&self) -> usize {
        self.frames.count()
    }

    /// What is asked of its frames beside settings, in words.
    pub(super) fn asked(&self, args: &Render) -> String {
        let time = args.time.map(|time| format!("time {time:?}"));
        let noise = args.noise.map(|noise| format!("noise {noise}"));
        let denoised = args.denoise.then(|| "denoised".to_owned());
        let shutter =
            self.blurs().then(|| format!("shutter {} at {} frames a second", self.shutter, self.fps));
        [time, noise, denoised, shutter].into_iter().flatten().collect::<Vec<_>>().join(", ")
    }

    /// Whether motion blurs it.
    pub(super) fn blurs(&self) -> bool {
        self.shutter > 0.0
    }

    /// Moments (in frames) that a picture of so many samples is drawn at, each with the samples up to its end.
    pub(super) fn moments(&self, frame: u32, samples: Option<u32>) -> Vec<(f64, u32)> {
        let shutter = if samples.is_some() { self.shutter } else { 0.0 };
        let samples = samples.unwrap_or(1);
        let count = if shutter > 0.0 { samples.clamp(1, MOMENTS) } else { 1 };
        let moment = |i: u32| {
            let open = shutter * (f64::from(i) + 0.5) / f64::from(count);
            let end = (u64::from(samples) * u64::from(i + 1) / u64::from(count)) as u32;
            (f64::from(frame) + open, end)
        };
        (0..count).map(moment).collect()
    }

    /// The animations that are played.
    pub(super) fn clips(args: &Render, scene: &Scene, reporter: &Reporter) -> Result<Vec<usize>, Failure> {
        let clips = scene.clips();
        let listed = |indices: &mut dyn Iterator<Item = usize>| {
            let listed = indices.map(|i| format!("{}: {}", clips[i].index, clips[i].name));
            listed.collect::<Vec<_>>().join(", ")
        };
        let Some(word) = &args.film.animation else {
            let played = scene.clips_together();
            let mut others = (0..clips.len()).filter(|clip| !played.contains(clip)).peekable();
            if others.peek().is_some() {
                let (played, others) = (listed(&mut played.iter().copied()), listed(&mut others));
                reporter.note(&format!("animations played: {played}; left out (--animation): {others}"));
            }
            return Ok(played);
        };
        let named = clips.iter().position(|clip| clip.name == *word);
        let index = || {
            let index: usize = word.parse().ok()?;
            clips.iter().position(|clip| clip.index == index)
        };
        let found = named.or_else(index).ok_or_else(|| match clips {
            [] => input!("--animation: the scene has no animation that can be played"),
            _ => input!("--animation: no animation `{word}`; choose among {}", listed(&mut (0..clips.len()))),
        });
        Ok(vec![found?])
    }

    /// The scene at a time of the film, which begins at frame 0, and what sees it.
    pub(super) fn shot(
        &self,
        args: &Render,
        base: &Scene,
        clips: &[usize],
        frame: f64,
    ) -> Result<(Scene, Camera), Failure> {
        let time = frame / self.fps;
        let scene = base.pose_lazily(clips, time).map_err(|error| Failure {
            class: error.class(),
            error: anyhow::anyhow!("frame {frame}, at {time} s: {error}"),
        })?;
        let camera = match &self.way {
            Way::Path(path) => path.camera(time, &scene),
            Way::Scene => scene::camera(&args.common, &scene)?,
            Way::Turntable(count) => {
                let camera = scene::camera(&args.common, &scene)?;
                let centre = || base.bounds().map_or(glam::Vec3::ZERO, |(low, high)| low.midpoint(high));
                let pivot = args.common.look_at.map_or_else(centre, |point| base.local(point.into()));
                // Frame 1 sees what a still picture does.
                let turn = (frame - 1.0).rem_euclid(f64::from(*count)) / f64::from(*count);
                camera.turned(pivot, turn as f32 * TAU)
            }
        };
        Ok((scene, camera))
    }

    /// Refuses names that frames would write over each other.
    pub(super) fn check(&self, files: &Files) -> Result<(), Failure> {
        if let Some(file) = files.all().find(|file| self.count() > 1 && numbered(file, 0) == **file) {
            return Err(input!("{}: frames need a number in their names: one # or more", file.display()));
        }
        // Of longer films the first frames will do.
        let mut written = HashSet::new();
        for frame in self.frames.iter().take(100_000) {
            for file in files.of_frame(frame).all() {
                if files.all().count() > 1 && !written.insert(file.clone()) {
                    return Err(input!(
                        "{}: written twice, the second time by frame {frame}",
                        file.display()
                    ));
                }
            }
        }
        Ok(())
    }
}

/// No name of a file is longer.
const LONGEST: usize = 255;

/// Each run of `#` in a file's name becomes the frame's number, as wide at least.
fn numbered(file: &Path, frame: u32) -> PathBuf {
    let Some(name) = file.file_name().and_then(|name| name.to_str()) else { return file.into() };
    let (mut numbered, mut rest) = (String::new(), name);
    while let Some(start) = rest.find('#') {
        let run = rest[start..].find(|c| c != '#').unwrap_or(rest.len() - start);
        numbered.push_str(&rest[..start]);
        let width = run.min(LONGEST);
        numbered.push_str(&format!("{frame:0width$}"));
        rest = &rest[start + run..];
    }
    numbered.push_str(rest);
    file.with_file_name(numbered)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_spread_over_the_open_shutter() {
        let film = |shutter| Sequence {
            frames: Frames { range: 1..=1, step: 1 },
            fps: 24.0,
            shutter,
            way: Way::Scene,
        };
        assert_eq!(film(0.0).moments(7, Some(100)), [(7.0, 100)]);
        assert_eq!(film(0.5).moments(7, None), [(7.0, 1)]);
        assert_eq!(film(0.5).moments(7, Some(2)), [(7.125, 1), (7.375, 2)]);
        let many = film(1.0).moments(3, Some(1000));
        assert_eq!((many.len(), many[63].1), (64, 1000));
        assert!(
            many.is_sorted_by(|a, b| a.0 < b.0 && a.1 < b.1)
                && many.iter().all(|m| (3.0..4.0).contains(&m.0))
        );
        let mean = many.iter().map(|moment| moment.0).sum::<f64>() / 64.0;
        assert!((mean - 3.5).abs() < 1e-12);
    }

    #[test]
    fn numbers_take_the_place_of_hashes() {
        for (name, expected) in [
            ("out/walk.####.exr", "out/walk.0017.exr"),
            ("#.png", "17.png"),
            ("a#b###", "a17b017"),
            ("a#/plain.png", "a#/plain.png"),
        ] {
            assert_eq!(numbered(Path::new(name), 17), Path::new(expected));
        }
        assert_eq!(numbered(Path::new("#.png"), 12345), Path::new("12345.png"));
    }
}
