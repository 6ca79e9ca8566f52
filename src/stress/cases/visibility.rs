//! What blocks light: bounding boxes, thin walls, narrow gaps.

use super::super::scenes;
use super::Case;
use super::measure::{against_reference, largest, mean, mean_against_reference};
use crate::config::RenderConfig;
use crate::metrics;
use crate::renderer::{Error, Layer};
use crate::stress::lab::{Lab, Measured, Part, Shot, Subject};

const BLINDS: Subject = Subject { name: "blinds", make: scenes::blinds };
const TURNED: Subject = Subject { name: "turned", make: scenes::turned };
const THIN: Subject = Subject { name: "thin wall", make: scenes::thin_wall };
const AJAR: Subject = Subject { name: "ajar", make: scenes::ajar };

/// Little light is lost to so small a distance.
const FINE: &[&str] = &["vpl_shoot.vpls=1024", "indirect.min_distance=0.05"];

/// One seed's noise is no loss.
const SEEDS: u32 = 4;

pub(super) const CASES: &[Case] = &[
    Case {
        name: "blinds",
        mechanism: "The box of a slanted slat fills the gap beside it.",
        number: "share of indirect light lost or gained, over four seeds",
        limit: 0.1,
        settings: FINE,
        measure: |lab, config| mean_against_reference(lab, config, &BLINDS, Part::Indirect, SEEDS, bias),
    },
    Case {
        name: "turned",
        mechanism: "Walls that follow no axis stand out of the room with their boxes, and these shadow the walls \
                    beside them.",
        number: "share of indirect light lost or gained, over four seeds",
        limit: 0.1,
        settings: FINE,
        measure: |lab, config| mean_against_reference(lab, config, &TURNED, Part::Indirect, SEEDS, bias),
    },
    Case {
        name: "thin-wall",
        mechanism: "A wall without thickness parts a lit room from a dark one; floor and ceiling go on beyond it.",
        number: "largest radiance in the dark room, in means of the lit one",
        limit: 0.0,
        settings: &[],
        measure: leak,
    },
    Case {
        name: "ajar",
        mechanism: "All light comes through a door ajar: few paths pass it.",
        number: "relMSE of blocks of 4x4 pixels",
        limit: 0.15,
        settings: &[],
        measure: |lab, config| {
            let width = config.size[0] as usize;
            // The reference has noise of its own here, which blocks average away.
            let blocks = |image: &[f32]| metrics::block_average(image, width, 3, 4);
            let error =
                |image: &[f32], reference: &[f32]| metrics::rel_mse(&blocks(image), &blocks(reference));
            against_reference(lab, config, &AJAR, Part::All, error)
        },
    },
];

fn bias(image: &[f32], reference: &[f32]) -> f64 {
    metrics::signed_bias(image, reference).abs()
}

/// The wall stands in the middle of the picture.
fn leak(lab: &mut Lab<'_>, config: &RenderConfig) -> Result<Measured, Error> {
    let picture = lab.picture(&THIN, &Shot::default(), config, Part::All)?;
    let columns = picture.data.chunks_exact(3).zip((0..picture.width).cycle());
    let half = |dark: bool| {
        let wanted = move |x: u32| if dark { 2 * x + 1 > picture.width } else { 2 * x + 1 < picture.width };
        columns.clone().filter(move |(_, x)| wanted(*x)).flat_map(|(pixel, _)| pixel.iter().copied())
    };
    let lit: Vec<f32> = half(false).collect();
    let lit = mean(&Layer { width: lit.len() as u32, height: 1, channels: 1, data: lit });
    let value = largest(half(true).map(f64::from)) / lit;
    Ok(Measured::new(value, [("picture", picture.clone())]))
}
