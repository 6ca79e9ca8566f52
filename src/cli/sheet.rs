//! `parhelion render --sheet`: frames of a film side by side in one picture.

use super::failure::{Failure, input};
use crate::output;
use std::path::PathBuf;

/// Pixels between frames.
const GAP: usize = 2;

/// Largest side in pixels.
const MOST: usize = 16_384;

/// Rows of frames, those still to come in grey.
pub(super) struct Sheet {
    file: PathBuf,
    columns: usize,
    size: [usize; 2],
    /// Of a frame.
    frame: [usize; 2],
    /// RGBA.
    pixels: Vec<u8>,
    added: usize,
}

impl Sheet {
    /// For so many frames of this size, as square as can be counted in frames.
    pub(super) fn new(file: PathBuf, count: usize, frame: [u32; 2]) -> Result<Self, Failure> {
        let columns = (count as f64).sqrt().ceil() as usize;
        let frame = frame.map(|side| side as usize);
        let side = |count: usize, side: usize| count * (side + GAP) - GAP;
        let size = [side(columns, frame[0]), side(count.div_ceil(columns), frame[1])];
        if let [width, height] = size
            && width.max(height) > MOST
        {
            return Err(input!(
                "--sheet: {count} frames side by side are {width}x{height} pixels, more than {MOST} along a side; fewer \
                 frames (--frames A-B/STEP) or a smaller --size"
            ));
        }
        output::check_writable(&file).map_err(Failure::input)?;
        let pixels = [128, 128, 128, 255].repeat(size[0] * size[1]);
        Ok(Self { file, columns, size, frame, pixels, added: 0 })
    }

    /// Puts a frame (RGBA) behind those that are there, and writes the file.
    pub(super) fn add(&mut self, frame: &[u8]) -> Result<(), output::Error> {
        let [width, height] = self.frame;
        let at = [self.added % self.columns, self.added / self.columns];
        let [left, top] = [at[0] * (width + GAP), at[1] * (height + GAP)];
        for (row, line) in frame.chunks_exact(4 * width).enumerate() {
            let start = 4 * ((top + row) * self.size[0] + left);
            self.pixels[start..start + line.len()].copy_from_slice(line);
        }
        self.added += 1;
        output::write_png(&self.file, self.size[0] as u32, &self.pixels, &[])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_lie_in_rows() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("sheet.png");
        let mut sheet = Sheet::new(file.clone(), 3, [2, 1]).unwrap();
        for shade in [10, 20, 30] {
            sheet.add(&[shade; 8]).unwrap();
        }
        let picture = image::open(&file).unwrap().to_rgba8();
        assert_eq!(picture.dimensions(), (6, 4));
        let shade = |x, y| picture.get_pixel(x, y).0[0];
        assert_eq!([shade(1, 0), shade(4, 0), shade(0, 3)], [10, 20, 30]);
        assert_eq!([shade(2, 0), shade(0, 1), shade(5, 3)], [128; 3]);
        assert!(Sheet::new(file, 10_000, [800, 600]).is_err());
    }
}
