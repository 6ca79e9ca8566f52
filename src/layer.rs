//! What a picture holds for each pixel, on the host.

/// Numbers in rows, the top one first, channels interleaved.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layer {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Numbers a pixel.
    pub channels: usize,
    /// `width · height · channels` numbers.
    pub data: Vec<f32>,
}
