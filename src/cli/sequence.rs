//! `parhelion render --frames`: which frames, when they are, what sees them and where they go.

use super::args::Render;
use super::failure::{Failure, input};
use super::progress::Reporter;
use super::scene;
use crate::output::extension;
use crate::scene::{Camera, CameraPath, Scene};
use std::f32::consts::TAU;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// A film.
pub(super) struct Sequence {
    pub(super) frames: RangeInclusive<u32>,
    fps: f64,
    way: Way,
}

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
    pub(super) fn of(args: &Render) -> Result<Option<Self>, Failure> {
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
            (None, Way::Turntable(count)) => 1..=*count,
            (None, _) if film.fps.is_some() => return Err(input!("--fps: needs --frames")),
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
        Ok(Some(Self { frames, fps: film.fps.unwrap_or(24.0), way }))
    }

    /// Whether the scene is expected to move.
    pub(super) fn is_timed(&self) -> bool {
        matches!(self.way, Way::Scene)
    }

    pub(super) fn count(&self) -> usize {
        self.frames.clone().count()
    }

    /// Seconds from the film's beginning, which is frame 0.
    pub(super) fn time(&self, frame: u32) -> f64 {
        f64::from(frame) / self.fps
    }

    /// The animations that are played.
    pub(super) fn clips(args: &Render, scene: &Scene, reporter: &Reporter) -> Result<Vec<usize>, Failure> {
        let clips = scene.clips();
        let listed = |indices: &mut dyn Iterator<Item = usize>| {
            indices.map(|i| format!("{i}: {}", clips[i].name)).collect::<Vec<_>>().join(", ")
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
        let index = || word.parse().ok().filter(|&index: &usize| index < clips.len());
        let found = named.or_else(index).ok_or_else(|| match clips {
            [] => input!("--animation: the scene has no animation that can be played"),
            _ => input!("--animation: no animation `{word}`; choose among {}", listed(&mut (0..clips.len()))),
        });
        Ok(vec![found?])
    }

    /// The scene in a frame, and what sees it.
    pub(super) fn shot(
        &self,
        args: &Render,
        base: &Scene,
        clips: &[usize],
        frame: u32,
    ) -> Result<(Scene, Camera), Failure> {
        let time = self.time(frame);
        let scene = base.pose(clips, time).map_err(|error| Failure {
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
                let turn = (f64::from(frame) - 1.0).rem_euclid(f64::from(*count)) / f64::from(*count);
                camera.turned(pivot, turn as f32 * TAU)
            }
        };
        Ok((scene, camera))
    }

    /// Refuses names that frames would write over each other.
    pub(super) fn check(&self, files: &Files) -> Result<(), Failure> {
        match files.all().find(|file| self.count() > 1 && numbered(file, 0) == **file) {
            Some(file) => {
                Err(input!("{}: frames need a number in their names: one # or more", file.display()))
            }
            None => Ok(()),
        }
    }
}

/// Each run of `#` in a file's name becomes the frame's number, as wide at least.
fn numbered(file: &Path, frame: u32) -> PathBuf {
    let Some(name) = file.file_name().and_then(|name| name.to_str()) else { return file.into() };
    let (mut numbered, mut rest) = (String::new(), name);
    while let Some(start) = rest.find('#') {
        let run = rest[start..].find(|c| c != '#').unwrap_or(rest.len() - start);
        numbered.push_str(&rest[..start]);
        numbered.push_str(&format!("{frame:0run$}"));
        rest = &rest[start + run..];
    }
    numbered.push_str(rest);
    file.with_file_name(numbered)
}

#[cfg(test)]
mod tests {
    use super::*;

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
