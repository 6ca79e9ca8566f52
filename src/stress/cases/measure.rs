use crate::config::RenderConfig;
use crate::renderer::{Error, Layer};
use crate::stress::lab::{Lab, Measured, Part, Shot, Subject};

/// A measure of a picture against the reference.
pub(super) fn against_reference(
    lab: &mut Lab<'_>,
    config: &RenderConfig,
    subject: &Subject,
    part: Part,
    measure: impl Fn(&[f32], &[f32]) -> f64,
) -> Result<Measured, Error> {
    mean_against_reference(lab, config, subject, part, 1, measure)
}

/// Of the mean of pictures by `seeds` seeds: many leave what is lost, and little noise.
pub(super) fn mean_against_reference(
    lab: &mut Lab<'_>,
    config: &RenderConfig,
    subject: &Subject,
    part: Part,
    seeds: u32,
    measure: impl Fn(&[f32], &[f32]) -> f64,
) -> Result<Measured, Error> {
    let shot = Shot::default();
    let mut picture = lab.picture(subject, &shot, config, part)?;
    for i in 1..seeds {
        let config = RenderConfig { seed: config.seed.wrapping_add(i), ..config.clone() };
        let other = lab.picture(subject, &shot, &config, part)?;
        picture.data.iter_mut().zip(&other.data).for_each(|(sum, value)| *sum += value);
    }
    picture.data.iter_mut().for_each(|sum| *sum /= seeds as f32);
    let reference = lab.reference(subject, &shot, config, part)?;
    let value = measure(&picture.data, &reference.data);
    Ok(Measured::new(value, [("picture", picture), ("reference", reference)]))
}

pub(super) fn mean(layer: &Layer) -> f64 {
    layer.data.iter().map(|&value| f64::from(value)).sum::<f64>() / layer.data.len() as f64
}

pub(super) fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    // `f64::max` would hide a NaN.
    values.into_iter().fold(0.0, |a, b| if b.is_nan() || b > a { b } else { a })
}
