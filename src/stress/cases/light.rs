//! How light is carried: singularities, clamps, lobes, caustics, samples.

use super::super::scenes;
use super::Case;
use super::measure::{against_reference, largest, mean};
use crate::config::RenderConfig;
use crate::methods::Aov;
use crate::metrics;
use crate::renderer::{Error, Layer};
use crate::stress::lab::{Lab, Measured, Part, Shot, Subject};
use glam::Vec3;
use std::f64::consts::PI;

const CREASE: Subject = Subject { name: "crease", make: scenes::crease };
const BRIGHT: Subject = Subject { name: "cube", make: || scenes::cube(0.8) };
const BRIGHTER: Subject = Subject { name: "cube", make: || scenes::cube(0.9) };
const METAL: Subject = Subject { name: "metal floor", make: scenes::metal_floor };
const PANE: Subject = Subject { name: "pane", make: scenes::pane };
const LAMP: Subject = Subject { name: "lamp", make: scenes::glass_and_lamp };
const MANY: Subject = Subject { name: "many lights", make: scenes::many_lights };
const DARK: Subject = Subject { name: "dark", make: scenes::dark };

pub(super) const CASES: &[Case] = &[
    Case {
        name: "crease",
        mechanism: "Light between near surfaces grows as one over their distance squared: virtual lights in a crease \
                    make bright spots around them.",
        number: "largest excess of indirect light, in means of the reference",
        limit: 2.0,
        settings: &[],
        measure: |lab, config| against_reference(lab, config, &CREASE, Part::Indirect, excess),
    },
    Case {
        name: "clamp",
        mechanism: "What keeps virtual lights' spots away takes the light itself: in a convex box \
                    4/(3π) · m · ΣL/A of light between walls lit evenly, at every bounce.",
        number: "share of indirect light lost or gained, against Φ/A · Σρᵏ",
        limit: 0.03,
        settings: &[],
        measure: clamp,
    },
    Case {
        name: "glossy",
        mechanism: "A narrow lobe sees few virtual lights, each as a spot.",
        number: "relMSE",
        limit: 0.02,
        settings: &[],
        measure: |lab, config| against_reference(lab, config, &METAL, Part::All, metrics::rel_mse),
    },
    Case {
        name: "pane",
        mechanism: "Light of a point through a pane is found by rays that ask the light only where panes let them pass.",
        number: "share of light lost on a floor under a pane, against Fresnel's equations",
        limit: 0.05,
        settings: &[],
        measure: pane,
    },
    Case {
        name: "caustic",
        mechanism: "Light through a body of glass, which bends it, is found by no ray that asks a lamp; paths find lamps \
                    that have a size by chance.",
        number: "share of light lost on a floor under the body",
        limit: 0.05,
        settings: &[],
        measure: |lab, config| {
            against_reference(lab, config, &LAMP, Part::All, |image, reference| {
                metrics::signed_bias(image, reference).abs()
            })
        },
    },
    Case {
        name: "many-lights",
        mechanism: "Of 10 000 lights of unequal power few shine on a path or a virtual light.",
        number: "relMSE",
        limit: 0.05,
        settings: &[],
        measure: |lab, config| against_reference(lab, config, &MANY, Part::All, metrics::rel_mse),
    },
    Case {
        name: "no-light",
        mechanism: "Nothing to choose from, and nothing to divide by.",
        number: "largest radiance",
        limit: 0.0,
        settings: &[],
        measure: |lab, config| {
            let picture = lab.picture(&DARK, &Shot::default(), config, Part::All)?;
            let value = largest(picture.data.iter().map(|&value| f64::from(value.abs())));
            Ok(Measured::new(value, [("picture", picture)]))
        },
    },
    Case {
        name: "halton",
        mechanism: "The first points of Halton's sequence in high bases lie on a line: paths of many bounces go \
                    the same way. Scrambled digits (any seed but 0) part them.",
        number: "largest difference between the sides of a cube that get the same light, in their mean",
        limit: 0.1,
        settings: &["vpl_shoot.bounces=16", "vpl_shoot.vpls=160"],
        measure: halton,
    },
];

fn excess(image: &[f32], reference: &[f32]) -> f64 {
    let mean = reference.iter().map(|&value| f64::from(value)).sum::<f64>() / reference.len() as f64;
    largest(image.iter().zip(reference).map(|(&i, &r)| f64::from(i - r) / mean))
}

/// Indirect light on a side of a cube, where pixels are equal areas.
fn side(lab: &mut Lab<'_>, config: &RenderConfig, subject: &Subject, index: usize) -> Result<Layer, Error> {
    let config = RenderConfig { size: [config.size[1]; 2], ..config.clone() };
    let camera = Some(lab.scene(subject)?.cameras[index].clone());
    lab.picture(subject, &Shot { index, camera, lights: None }, &config, Part::Indirect)
}

/// Indirect light on all of them.
fn sides(lab: &mut Lab<'_>, config: &RenderConfig, subject: &Subject) -> Result<Vec<Layer>, Error> {
    (0..6).map(|index| side(lab, config, subject, index)).collect()
}

fn clamp(lab: &mut Lab<'_>, config: &RenderConfig) -> Result<Measured, Error> {
    let mut sides = sides(lab, config, &BRIGHT)?;
    let radiance = sides.iter().map(mean).sum::<f64>() / 6.0;
    let (albedo, area) = (0.8_f64, 6.0 * f64::from(scenes::CUBE_SIDE).powi(2));
    let missing = config.vpl_shoot.bounces.map_or(0.0, |bounces| albedo.powi(bounces as i32));
    let powers = albedo * (1.0 - missing) / (1.0 - albedo);
    let irradiance = 4.0 * PI / area * powers;
    let value = (PI / albedo * radiance / irradiance - 1.0).abs();
    Ok(Measured::new(value, [("one side", sides.swap_remove(0))]))
}

fn halton(lab: &mut Lab<'_>, config: &RenderConfig) -> Result<Measured, Error> {
    let sides = sides(lab, config, &BRIGHTER)?;
    let means = || sides.iter().map(mean);
    let all = means().sum::<f64>() / 6.0;
    let (low, high) = means().fold((f64::INFINITY, 0.0_f64), |(a, b), m| (a.min(m), b.max(m)));
    let of = |value: f64| sides.iter().find(|side| mean(side) == value).cloned();
    let plates = [("darkest side", of(low)), ("brightest side", of(high))];
    let plates = plates.map(|(label, side)| (label, side.unwrap_or_else(|| sides[0].clone())));
    Ok(Measured::new((high - low) / all, plates))
}

/// Light of a point through a thin pane above a floor: I cosθ/d² · (1 − R)/(1 + R) of the floor's albedo, R the share
/// that one face reflects.
fn pane(lab: &mut Lab<'_>, config: &RenderConfig) -> Result<Measured, Error> {
    let picture = lab.picture(&PANE, &Shot::default(), config, Part::All)?;
    let positions = lab.layer(&PANE, config, Aov::P)?;
    let light = |at: &[f32]| {
        let to_light = scenes::PANE_LIGHT - Vec3::from_slice(at);
        let (d, n) = (f64::from(to_light.length()), f64::from(scenes::PANE_INDEX));
        let cos = f64::from(to_light.y) / d;
        let inside = (1.0 - (1.0 - cos * cos) / (n * n)).sqrt();
        let s = ((cos - n * inside) / (cos + n * inside)).powi(2);
        let p = ((n * cos - inside) / (n * cos + inside)).powi(2);
        let reflected = 0.5 * (s + p);
        let albedo = f64::from(scenes::PANE_ALBEDO);
        (albedo / PI * cos / (d * d) * (1.0 - reflected) / (1.0 + reflected)) as f32
    };
    let truth = positions.data.chunks_exact(3).flat_map(|at| [light(at); 3]).collect();
    let truth = Layer { data: truth, ..positions };
    let value = (mean(&picture) / mean(&truth) - 1.0).abs();
    Ok(Measured::new(value, [("picture", picture), ("truth", truth)]))
}
