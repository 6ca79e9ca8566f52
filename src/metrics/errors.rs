use super::{
    FlipMap, flip, mape, mse, peak, psnr, rel_mse, rel_mse_blocks, rel_mse_trimmed, signed_bias, smape, ssim,
};

/// Every measure of one picture against its reference.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Errors {
    /// [`rel_mse`].
    pub rel_mse: f64,
    /// [`rel_mse_trimmed`].
    pub rel_mse_trimmed: f64,
    /// [`rel_mse_blocks`].
    pub rel_mse_blocks: f64,
    /// [`mape`].
    pub mape: f64,
    /// [`smape`].
    pub smape: f64,
    /// [`signed_bias`].
    pub signed_bias: f64,
    /// [`mse`].
    pub mse: f64,
    /// [`peak`] of the reference, for the next two.
    pub peak: f64,
    /// [`psnr`] (dB).
    pub psnr: f64,
    /// [`ssim`]; absent where no window of it fits the picture.
    pub ssim: Option<f64>,
    /// Mean of [`flip`]; absent where there are not three channels.
    pub flip: Option<f64>,
}

/// All measures, and the map of [`flip`] where there are three channels.
///
/// # Panics
/// If the slices differ in length or are not whole rows.
#[must_use]
pub fn errors(image: &[f32], reference: &[f32], width: usize, channels: usize) -> (Errors, Option<FlipMap>) {
    let map = (channels == 3).then(|| flip(image, reference, width));
    let (mse, peak) = (mse(image, reference), peak(reference));
    let errors = Errors {
        rel_mse: rel_mse(image, reference),
        rel_mse_trimmed: rel_mse_trimmed(image, reference),
        rel_mse_blocks: rel_mse_blocks(image, reference, width, channels),
        mape: mape(image, reference),
        smape: smape(image, reference),
        signed_bias: signed_bias(image, reference),
        mse,
        peak,
        psnr: psnr(mse, peak),
        ssim: ssim(image, reference, width, channels, peak),
        flip: map.as_ref().map(FlipMap::mean),
    };
    (errors, map)
}
