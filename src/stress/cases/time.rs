//! Sequences: what moves, and what stays behind.

use super::super::scenes;
use super::Case;
use super::measure::largest;
use crate::config::RenderConfig;
use crate::metrics;
use crate::renderer::{Error, Layer};
use crate::stress::lab::{Lab, Measured, Part, Plate, Shot, Subject};
use glam::{Vec3, Vec3A, vec3};

const PILLARS: Subject = Subject { name: "pillars", make: scenes::pillars };
const WIRES: Subject = Subject { name: "wires", make: scenes::wires };

/// Frames of a sequence.
const FRAMES: usize = 3;

pub(super) const CASES: &[Case] = &[
    Case {
        name: "popping",
        mechanism: "A light goes along behind pillars: virtual lights jump from one to the next.",
        number: "flicker: relMSE of the changes from frame to frame",
        limit: 0.015,
        settings: &[],
        measure: popping,
    },
    Case {
        name: "switched-off",
        mechanism: "A light goes out: what a method remembers of earlier frames is wrong at once.",
        number: "largest radiance in the next frame",
        limit: 0.0,
        settings: &[],
        measure: lag,
    },
    Case {
        name: "crawling",
        mechanism: "The camera goes sideways by parts of a pixel: samples and patterns that belong to the screen go \
                    with it and crawl over what stands still.",
        number: "flicker of indirect light: relMSE of the changes from frame to frame",
        limit: 0.05,
        settings: &["vpl_shoot.vpls=1024"],
        measure: crawling,
    },
];

/// Flicker of a sequence of shots.
fn flicker(
    lab: &mut Lab<'_>,
    config: &RenderConfig,
    subject: &Subject,
    part: Part,
    shots: &[Shot],
) -> Result<Measured, Error> {
    let (mut frames, mut references) = (Vec::new(), Vec::new());
    for shot in shots {
        frames.push(lab.picture(subject, shot, config, part)?);
        references.push(lab.reference(subject, shot, config, part)?);
    }
    let slices = |layers: &'_ [Layer]| layers.iter().map(|layer| layer.data.clone()).collect::<Vec<_>>();
    let (a, b) = (slices(&frames), slices(&references));
    let value = metrics::flicker(
        &a.iter().map(Vec::as_slice).collect::<Vec<_>>(),
        &b.iter().map(Vec::as_slice).collect::<Vec<_>>(),
    );
    let label = |what: &str, layers: Vec<Layer>| {
        let plate = |(i, layer)| Plate { label: format!("{what} {}", i + 1), layer };
        layers.into_iter().enumerate().map(plate).collect::<Vec<_>>()
    };
    let mut plates = label("frame", frames);
    plates.extend(label("reference", references));
    Ok(Measured { value, plates })
}

fn popping(lab: &mut Lab<'_>, config: &RenderConfig) -> Result<Measured, Error> {
    let at = |i: usize| vec3(1.0 + 0.15 * i as f32, 1.0, 0.6);
    let shot = |i| Shot { index: i, lights: Some(vec![scenes::point(at(i), 1.0)]), camera: None };
    flicker(lab, config, &PILLARS, Part::All, &(0..FRAMES).map(shot).collect::<Vec<_>>())
}

fn crawling(lab: &mut Lab<'_>, config: &RenderConfig) -> Result<Measured, Error> {
    let camera = lab.camera(&WIRES)?;
    let shot = |index: usize| {
        let mut camera = camera.clone();
        camera.transform.translation += Vec3A::from(Vec3::X * (0.04 * index as f32));
        Shot { index, lights: None, camera: Some(camera) }
    };
    let shots: Vec<_> = (0..FRAMES).map(shot).collect();
    flicker(lab, config, &WIRES, Part::Indirect, &shots)
}

fn lag(lab: &mut Lab<'_>, config: &RenderConfig) -> Result<Measured, Error> {
    let lit = lab.picture(&PILLARS, &Shot::default(), config, Part::All)?;
    let off = Shot { index: 1, lights: Some(Vec::new()), camera: None };
    let dark = lab.picture(&PILLARS, &off, config, Part::All)?;
    let value = largest(dark.data.iter().map(|&value| f64::from(value.abs())));
    Ok(Measured::new(value, [("after", dark), ("before", lit)]))
}
