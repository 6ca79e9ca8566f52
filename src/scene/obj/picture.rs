//! Pictures made of those that a material names: several in one, or normals of heights.

use crate::scene::{AlphaMode, Image, Sampler, Wrap};
use glam::Vec3;

/// Which channel of a picture is a scalar (`-imfchan`).
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Channel {
    Red,
    Green,
    Blue,
    Matte,
    Luminance,
}

impl Channel {
    pub(super) fn of(word: &str) -> Option<Self> {
        Some(match word {
            "r" => Self::Red,
            "g" => Self::Green,
            "b" => Self::Blue,
            "m" => Self::Matte,
            "l" => Self::Luminance,
            _ => return None,
        })
    }

    fn value(self, [r, g, b, a]: [f32; 4]) -> f32 {
        match self {
            Self::Red => r,
            Self::Green => g,
            Self::Blue => b,
            Self::Matte => a,
            Self::Luminance => 0.2126 * r + 0.7152 * g + 0.0722 * b,
        }
    }
}

/// A picture of scalars.
#[derive(Clone, Copy)]
pub(super) struct Scalar<'a> {
    pub(super) image: &'a Image,
    pub(super) channel: Channel,
}

impl Scalar<'_> {
    fn at(&self, x: usize, y: usize) -> f32 {
        self.channel.value(texel(self.image, x, y))
    }

    /// Between the texels around a place in a picture of another size.
    fn resampled(&self, (x, y): (u32, u32), size: (u32, u32)) -> f32 {
        resampled(self.image, (x, y), size, |texel| [self.channel.value(texel); 4])[0]
    }
}

/// Encoded values from 0 to 1.
fn texel(image: &Image, x: usize, y: usize) -> [f32; 4] {
    let at = y * image.width as usize + x;
    match image.low_bytes() {
        [] => image.texels[at].map(|byte| f32::from(byte) / 255.0),
        low => {
            let (high, low) = (image.texels[at], low[at]);
            [0, 1, 2, 3].map(|i| f32::from(u16::from_be_bytes([high[i], low[i]])) / 65535.0)
        }
    }
}

fn resampled(
    image: &Image,
    (x, y): (u32, u32),
    (width, height): (u32, u32),
    of: impl Fn([f32; 4]) -> [f32; 4],
) -> [f32; 4] {
    let axis = |at: u32, count: u32, texels: u32| {
        let place = ((at as f32 + 0.5) * texels as f32 / count as f32 - 0.5).clamp(0.0, (texels - 1) as f32);
        let low = place as usize;
        (low, (low + 1).min(texels as usize - 1), place - place.floor())
    };
    let ((x0, x1, u), (y0, y1, v)) = (axis(x, width, image.width), axis(y, height, image.height));
    let mix = |a: [f32; 4], b: [f32; 4], t: f32| [0, 1, 2, 3].map(|i| a[i] + t * (b[i] - a[i]));
    let row = |y| mix(of(texel(image, x0, y)), of(texel(image, x1, y)), u);
    mix(row(y0), row(y1), v)
}

fn byte(value: f32) -> u8 {
    (value * 255.0).round() as u8
}

/// The larger of the sizes of `images`.
pub(super) fn common_size<'a>(images: impl Iterator<Item = &'a Image>) -> (u32, u32) {
    images.fold((1, 1), |(width, height), image| (width.max(image.width), height.max(image.height)))
}

/// Texels of what `of` has at each.
fn drawn(name: String, (width, height): (u32, u32), of: impl Fn((u32, u32)) -> [f32; 4]) -> Image {
    let texels =
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|at| of(at).map(byte)).collect();
    Image { name, width, height, texels }
}

/// `color`, white without one, with an alpha of its own.
pub(super) fn with_alpha(color: Option<&Image>, alpha: Scalar<'_>) -> Image {
    let size = common_size(color.into_iter().chain([alpha.image]));
    let name = [color.map_or("", |color| &color.name), &alpha.image.name].join(" + ");
    drawn(name, size, |at| {
        let [r, g, b, _] = color.map_or([1.0; 4], |color| resampled(color, at, size, |texel| texel));
        [r, g, b, alpha.resampled(at, size)]
    })
}

/// Which channel of a picture of opacity holds it: its own alpha where that varies.
pub(super) fn opacity_channel(image: &Image) -> Channel {
    let opaque = image.texels[..image.count()].iter().all(|texel| texel[3] == 255);
    if opaque { Channel::Luminance } else { Channel::Matte }
}

/// What an alpha means that is nearly all 0 or 1: a hole, whose edges alone are in between.
pub(super) fn alpha_mode(image: &Image) -> AlphaMode {
    let between = image.texels.iter().filter(|texel| (16..240).contains(&texel[3])).count();
    if between * 10 <= image.texels.len() { AlphaMode::Mask { cutoff: 0.5 } } else { AlphaMode::Blend }
}

/// Roughness in green and metalness in blue; 1 where there is no picture of it.
pub(super) fn roughness_and_metalness(roughness: Option<Scalar<'_>>, metalness: Option<Scalar<'_>>) -> Image {
    let maps = [roughness, metalness];
    let size = common_size(maps.iter().flatten().map(|map| map.image));
    let names: Vec<&str> = maps.iter().flatten().map(|map| &*map.image.name).collect();
    drawn(names.join(" + "), size, |at| {
        let [green, blue] = maps.map(|map| map.map_or(1.0, |map| map.resampled(at, size)));
        [1.0, green, blue, 1.0]
    })
}

/// Whether a picture shows normals, not heights: of about unit length, out of the surface, and more blue than red.
pub(super) fn shows_normals(image: &Image) -> bool {
    let texels = &image.texels[..image.count()];
    let unit = |&&[r, g, b, _]: &&[u8; 4]| {
        let normal = Vec3::new(r.into(), g.into(), b.into()) / 127.5 - 1.0;
        (normal.length() - 1.0).abs() < 0.15 && normal.z > 0.0
    };
    let blue: i64 = texels.iter().map(|texel| i64::from(texel[2]) - i64::from(texel[0])).sum();
    let count = texels.len();
    blue > 25 * count as i64 && texels.iter().filter(unit).count() * 10 >= 9 * count
}

/// Normals, of 16 bits a channel, of heights from 0 to 1 texel, by central differences.
pub(super) fn normals_of(heights: Scalar<'_>, sampler: Sampler) -> Image {
    let Image { ref name, width, height, .. } = *heights.image;
    let (columns, rows) = (width as usize, height as usize);
    let beside = |at: usize, count: usize, wrap: Wrap| match wrap {
        Wrap::Repeat => ((at + count - 1) % count, (at + 1) % count),
        Wrap::MirroredRepeat | Wrap::ClampToEdge => (at.saturating_sub(1), (at + 1).min(count - 1)),
    };
    let mut texels = vec![[0; 4]; 2 * columns * rows];
    let (high, low) = texels.split_at_mut(columns * rows);
    for y in 0..rows {
        let (above, below) = beside(y, rows, sampler.wrap_v);
        for x in 0..columns {
            let (left, right) = beside(x, columns, sampler.wrap_u);
            let slope = |a: f32, b: f32| 0.5 * (b - a);
            let to_right = slope(heights.at(left, y), heights.at(right, y));
            let upwards = slope(heights.at(x, below), heights.at(x, above));
            let normal = Vec3::new(-to_right, -upwards, 1.0).normalize();
            let encoded = (0.5 + 0.5 * normal)
                .extend(1.0)
                .to_array()
                .map(|v| ((v * 65535.0).round() as u16).to_be_bytes());
            high[y * columns + x] = encoded.map(|[high, _]| high);
            low[y * columns + x] = encoded.map(|[_, low]| low);
        }
    }
    Image { name: format!("normals of {name}"), width, height, texels }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, texels: Vec<[u8; 4]>) -> Image {
        Image { name: "a".into(), width, height: texels.len() as u32 / width, texels }
    }

    fn gray(v: u8) -> [u8; 4] {
        [v, v, v, 255]
    }

    #[test]
    fn normals_lean_away_from_where_heights_grow() {
        // By 51/255 a texel to the right, and by twice that downwards.
        let texels = (0..9).map(|i| gray(51 * (i % 3 + 2 * (i / 3)).min(5) as u8)).collect();
        let heights = image(3, texels);
        let made = normals_of(Scalar { image: &heights, channel: Channel::Luminance }, Sampler::default());
        let [x, y, z, _] = texel(&made, 1, 1).map(|v| 2.0 * v - 1.0);
        assert!((x / z + 0.2).abs() < 1e-3 && (y / z - 0.4).abs() < 1e-3, "{x} {y} {z}");
        assert!((Vec3::new(x, y, z).length() - 1.0).abs() < 1e-4);
        assert!(!shows_normals(&heights));
        assert!(shows_normals(&image(2, vec![[128, 128, 255, 255], [160, 100, 245, 255]])));
        assert!(!shows_normals(&image(2, vec![gray(201); 4])));
    }

    #[test]
    fn pictures_of_two_sizes_are_joined() {
        let color = image(1, vec![[10, 20, 30, 40]]);
        let alpha = image(4, vec![gray(0), gray(0), gray(255), gray(255)]);
        let joined = with_alpha(Some(&color), Scalar { image: &alpha, channel: Channel::Red });
        assert_eq!((joined.width, joined.height), (4, 1));
        assert_eq!(joined.texels, [[10, 20, 30, 0], [10, 20, 30, 0], [10, 20, 30, 255], [10, 20, 30, 255]]);
        assert_eq!(alpha_mode(&joined), AlphaMode::Mask { cutoff: 0.5 });
        assert_eq!(alpha_mode(&image(1, vec![[0, 0, 0, 128]])), AlphaMode::Blend);
        let wide = image(2, vec![gray(0), gray(200)]);
        let rough = Scalar { image: &wide, channel: Channel::Luminance };
        let made = roughness_and_metalness(Some(rough), None);
        assert_eq!(made.texels, [[255, 0, 255, 255], [255, 200, 255, 255]]);
        let scalar = Scalar { image: &wide, channel: Channel::Green };
        let four = [0, 1, 2, 3].map(|x| byte(scalar.resampled((x, 0), (4, 1))));
        assert_eq!(four, [0, 50, 150, 200]);
    }
}
