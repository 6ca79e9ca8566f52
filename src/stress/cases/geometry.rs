//! Coordinates and triangles at the ends of what there is.

use super::super::scenes;
use super::Case;
use crate::accel::Geometry;
use crate::accel::cpu::{BruteForce, Ray};
use crate::config::RenderConfig;
use crate::methods::Aov;
use crate::metrics;
use crate::renderer::Error;
use crate::scene::View;
use crate::stress::lab::{Lab, Measured, Part, Shot, Subject};

const ROOM: Subject = Subject { name: "room", make: scenes::furnished };
const SMALL: Subject = Subject { name: "small", make: scenes::small };
const LARGE: Subject = Subject { name: "large", make: scenes::large };
const FAR: Subject = Subject { name: "far", make: scenes::far };
const DEGENERATE: Subject = Subject { name: "degenerate", make: scenes::degenerate };
const DUPLICATED: Subject = Subject { name: "duplicated", make: scenes::duplicated };
const COINCIDENT: Subject = Subject { name: "coincident", make: scenes::coincident };
const SLIVERS: Subject = Subject { name: "slivers", make: scenes::slivers };

/// Width of the needles of [`SLIVERS`] (m).
const NEEDLE: f64 = 4e-3;

const AS_IN_THE_ROOM: &str = "relMSE against the plain room by the same method";

pub(super) const CASES: &[Case] = &[
    Case {
        name: "small",
        mechanism: "A room 2 mm wide: distances kept from surfaces must follow the scene's size.",
        number: AS_IN_THE_ROOM,
        limit: 1e-6,
        settings: &["path_trace.spp=16"],
        measure: |lab, config| like_the_room(lab, config, &SMALL),
    },
    Case {
        name: "large",
        mechanism: "A room 33 km wide: products of lengths must not overflow.",
        number: AS_IN_THE_ROOM,
        limit: 1e-6,
        settings: &["path_trace.spp=16"],
        measure: |lab, config| like_the_room(lab, config, &LARGE),
    },
    Case {
        name: "far",
        mechanism: "A room 160 m wide 10 000 km from the origin: positions are 1 m apart, and its corners are at whole metres.",
        number: AS_IN_THE_ROOM,
        limit: 1e-6,
        settings: &["path_trace.spp=16"],
        measure: |lab, config| like_the_room(lab, config, &FAR),
    },
    Case {
        name: "zero-area",
        mechanism: "Triangles that are lines or points have no normal.",
        number: AS_IN_THE_ROOM,
        limit: 0.0,
        settings: &["path_trace.spp=16"],
        measure: |lab, config| like_the_room(lab, config, &DEGENERATE),
    },
    Case {
        name: "duplicated",
        mechanism: "Every triangle is there twice: each must count once.",
        number: AS_IN_THE_ROOM,
        limit: 1e-6,
        settings: &["path_trace.spp=16"],
        measure: |lab, config| like_the_room(lab, config, &DUPLICATED),
    },
    Case {
        name: "coincident",
        mechanism: "A black floor lies in the floor's plane: rays must agree on which they hit, and none may pass \
                    between.",
        number: AS_IN_THE_ROOM,
        limit: 1e-6,
        settings: &["indirect.min_distance=0.1", "path_trace.spp=16"],
        measure: |lab, config| like_the_room(lab, config, &COINCIDENT),
    },
    Case {
        name: "slivers",
        mechanism: "Boxes of 100 000 needles lie inside each other: no hierarchy parts them.",
        number: "share of pixels that hit where brute force misses, the reverse, or are off by more than a needle's width",
        limit: 0.002,
        settings: &["vpl_shoot.vpls=1", "path_trace.spp=1"],
        measure: slivers,
    },
];

fn like_the_room(lab: &mut Lab<'_>, config: &RenderConfig, subject: &Subject) -> Result<Measured, Error> {
    let shot = Shot::default();
    let picture = lab.picture(subject, &shot, config, Part::All)?;
    let room = lab.picture(&ROOM, &shot, config, Part::All)?;
    let value = metrics::rel_mse(&picture.data, &room.data);
    Ok(Measured::new(value, [("picture", picture), ("plain room", room)]))
}

fn slivers(lab: &mut Lab<'_>, config: &RenderConfig) -> Result<Measured, Error> {
    let depth = lab.layer(&SLIVERS, config, Aov::Depth)?;
    let picture = lab.picture(&SLIVERS, &Shot::default(), config, Part::All)?;
    let camera = lab.camera(&SLIVERS)?;
    let oracle = BruteForce::new(&Geometry::of(lab.scene(&SLIVERS)?)?);
    let axes = camera.transform.matrix3;
    let View::Orthographic { ymag } = camera.view else { unreachable!("the scene's camera is orthographic") };
    let [width, height] = config.size.map(|side| side as f32);
    let wrong = (0..config.size[1]).flat_map(|y| (0..config.size[0]).map(move |x| (x, y))).zip(&depth.data);
    let wrong = wrong.filter(|((x, y), seen)| {
        let right = (2.0 * (*x as f32 + 0.5) / width - 1.0) * ymag * width / height;
        let up = (1.0 - 2.0 * (*y as f32 + 0.5) / height) * ymag;
        let origin = camera.transform.translation + axes.x_axis * right + axes.y_axis * up;
        let ray =
            Ray { origin: origin.into(), direction: (-axes.z_axis).into(), t_min: 0.0, t_max: f32::INFINITY };
        let t = oracle.closest(&ray).map_or(0.0, |hit| hit.t);
        // Those in front are seen edge on, where 32 bits say little about how deep.
        (t - f64::from(**seen)).abs() > NEEDLE
    });
    Ok(Measured::new(wrong.count() as f64 / depth.data.len() as f64, [("picture", picture)]))
}
