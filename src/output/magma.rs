/// Colour (sRGB) of a value 0 … 1 in the map `magma` of van der Walt and Smith (2015), which rises evenly in lightness: a
/// polynomial within 5/255 of its table. What lies outside is clamped, NaN is green.
#[must_use]
pub fn magma(value: f32) -> [u8; 3] {
    const TERMS: [[f32; 3]; 7] = [
        [-0.002_136_485, -0.000_749_655, -0.005_386_128],
        [0.251_660_54, 0.677_523_24, 2.494_026_6],
        [8.353_717, -3.577_719_5, 0.314_467_9],
        [-27.668_734, 14.264_731, -13.649_213],
        [52.176_14, -27.943_606, 12.944_169],
        [-50.768_525, 29.046_583, 4.234_153],
        [18.655_706, -11.489_774, -5.601_961_5],
    ];
    if value.is_nan() {
        return [0, 255, 0];
    }
    let t = value.clamp(0.0, 1.0);
    [0, 1, 2].map(|c| (255.0 * TERMS.iter().rev().fold(0.0, |sum, term| sum * t + term[c])).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::magma;

    /// Entries of the table.
    #[test]
    fn it_is_the_map_of_that_name() {
        for (value, expected) in EXPECTED {
            let close = magma(value).iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 5);
            assert!(close, "{value}: {:?}", magma(value));
        }
        assert_eq!((magma(-1.0), magma(7.0)), (magma(0.0), magma(1.0)));
        let lightness = |i: u16| magma(f32::from(i) / 255.0).map(f32::from).iter().sum::<f32>();
        assert!((0..255).all(|i| lightness(i + 1) > lightness(i) - 2.0));
    }

    const EXPECTED: [(f32, [u8; 3]); 5] = [
        (0.0, [0, 0, 4]),
        (67.0 / 255.0, [86, 20, 125]),
        (128.0 / 255.0, [183, 55, 121]),
        (191.0 / 255.0, [251, 135, 97]),
        (1.0, [252, 253, 191]),
    ];
}
