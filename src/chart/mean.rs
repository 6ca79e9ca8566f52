//! The mean over seeds of a setting's pictures: a file each, so that a sweep goes on with it.

use crate::metrics::rel_mse;
use crate::output::{self, Attribute, Channels, Picture, read_exr, write_exr};
use crate::renderer::Layer;
use std::path::Path;

/// Attributes: what the pictures are of, and how many seeds there are.
const IDENTITY: &str = "parhelion:mean_of";
const SEEDS: &str = "parhelion:seeds";

/// relMSE of the mean over the first `turn` + 1 seeds, the last of which is `image`; none where `file` does not hold the mean
/// of those before it. `identity` is what they have in common.
///
/// A seed that is in the file already was measured before, but not noted: its picture has the same bits.
pub(super) fn with(
    file: &Path,
    identity: &str,
    turn: u32,
    image: &[f32],
    reference: &Layer,
) -> Result<Option<f64>, output::Error> {
    let held = held(file, identity);
    let mean = match held {
        Some((count, mean)) if count == turn + 1 => return Ok(Some(rel_mse(&mean, &reference.data))),
        Some((count, mean)) if count == turn => {
            let share = 1.0 / f64::from(turn + 1);
            let next = |(&mean, &value): (&f32, &f32)| {
                (f64::from(mean) + share * (f64::from(value) - f64::from(mean))) as f32
            };
            mean.iter().zip(image).map(next).collect()
        }
        _ if turn == 0 => image.to_vec(),
        _ => return Ok(None),
    };
    let [width, height] = [reference.width, reference.height];
    let picture = Picture {
        size: [width, height],
        window: [0, 0, width, height],
        channels: vec![Channels { names: ["R", "G", "B"].map(String::from).into(), data: &mean }],
        attributes: vec![
            (IDENTITY, Attribute::Text(identity.into())),
            (SEEDS, Attribute::Number(f64::from(turn + 1))),
        ],
    };
    write_exr(file, &picture)?;
    Ok(Some(rel_mse(&mean, &reference.data)))
}

fn held(file: &Path, identity: &str) -> Option<(u32, Vec<f32>)> {
    let picture = read_exr(file).ok()?;
    let same = picture.attributes.get(IDENTITY) == Some(&Attribute::Text(identity.into()));
    match picture.attributes.get(SEEDS) {
        Some(Attribute::Number(count)) if same => {
            Some((*count as u32, picture.interleaved(&["R", "G", "B"])?))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_grows_seed_by_seed_and_takes_none_twice() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.exr");
        let reference = Layer { width: 2, height: 2, channels: 3, data: vec![1.0; 12] };
        let add = |of: &str, turn, level: f32| with(&file, of, turn, &[level; 12], &reference).unwrap();
        let error = |level: f64| (level - 1.0).powi(2) / 1.01;
        let near = |found: Option<f64>, level| (found.unwrap() / error(level) - 1.0).abs() < 1e-5;
        assert!(
            near(add("it", 0, 1.2), 1.2) && near(add("it", 1, 1.5), 1.35) && near(add("it", 2, 1.2), 1.3)
        );
        // It is in already.
        assert!(near(add("it", 2, 1.2), 1.3));
        // Seeds before it are not there, or of something else.
        assert_eq!((add("it", 4, 1.1), add("other", 3, 1.1), add("it", 1, 1.1)), (None, None, None));
        assert!(near(add("it", 3, 1.1), 1.25));
        // The first begins anew.
        assert!(near(add("other", 0, 1.1), 1.1) && near(add("other", 1, 1.3), 1.2));
    }
}
