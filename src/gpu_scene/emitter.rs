//! What light is chosen by: the power of emissive triangles and of the environment, in 64 bits.

use super::light_tree::Bounds;
use crate::accel::Geometry;
use crate::sampling::halton;
use crate::scene::{Environment, Filter, Image, Material, Scene, TextureRef, Wrap, srgb_to_linear};
use crate::shaders::LightChoice;
use glam::{DVec3, Mat3A, Vec2};
use std::f64::consts::PI;

/// −1 where a placement turns front and back round, else 1.
pub(super) fn orientation(matrix: Mat3A) -> f32 {
    if matrix.determinant() < 0.0 { -1.0 } else { 1.0 }
}

/// An emissive triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Emitter {
    pub(super) instance: u32,
    pub(super) primitive: u32,
    /// W, all channels.
    pub(super) power: f64,
    pub(super) bounds: Bounds,
}

/// Mean power over area (W/m², all channels) that each triangle of `geometry` emits, both sides where it has two. Empty
/// where none emits.
pub(super) fn weights(scene: &Scene, geometry: &Geometry) -> Vec<f32> {
    if !scene.materials.iter().any(Material::emits) {
        return Vec::new();
    }
    let decode: [f64; 256] = std::array::from_fn(|i| f64::from(srgb_to_linear(i as f32 / 255.0)));
    let weight = |source: &crate::accel::Source| {
        let mesh = &scene.meshes[source.mesh as usize];
        let material = &scene.materials[mesh.materials[source.triangle as usize] as usize];
        if !material.emits() {
            return 0.0;
        }
        let sides = if material.double_sided { 2.0 } else { 1.0 };
        let mean = material.emission_texture.map_or(DVec3::ONE, |texture| {
            let all = if texture.uv_set == 1 { &mesh.uv1 } else { &mesh.uv0 };
            let corner = |v: u32| all.get(v as usize).copied().unwrap_or_default();
            let uv = mesh.triangles[source.triangle as usize].map(corner);
            mean_texel(&scene.images[texture.image as usize], &texture, uv, &decode)
        });
        (PI * sides * (material.emission.as_dvec3() * mean).element_sum()) as f32
    };
    let weights: Vec<f32> = geometry.source.iter().map(weight).collect();
    if weights.iter().all(|&weight| weight == 0.0) { Vec::new() } else { weights }
}

/// All triangles in the world that emit.
pub(super) fn emitters(scene: &Scene, geometry: &Geometry, weights: &[f32]) -> Vec<Emitter> {
    if weights.is_empty() {
        return Vec::new();
    }
    let power = |triangle: crate::accel::WorldTriangle| {
        let placed = &geometry.instances[triangle.instance as usize];
        let index = (geometry.meshes[placed.mesh as usize].first_triangle + triangle.primitive) as usize;
        let corners = triangle.vertices.map(|v| v.as_dvec3());
        let [a, b, c] = corners;
        let power = f64::from(weights[index]) * 0.5 * (b - a).cross(c - a).length();
        let (instance, primitive) = (triangle.instance, triangle.primitive);
        let source = geometry.source[index];
        let material = scene.meshes[source.mesh as usize].materials[source.triangle as usize];
        let two_sided = scene.materials[material as usize].double_sided;
        // Merged triangles have been placed before.
        let merged = &scene.instances[source.instance as usize].transform;
        let side = orientation(if instance == 0 { merged.matrix3 } else { placed.transform.matrix3 });
        let intensity = power / if two_sided { 2.0 * PI } else { PI };
        let bounds = Bounds::of_triangle(corners, f64::from(side), two_sided, intensity);
        (power > 0.0).then_some(Emitter { instance, primitive, power, bounds })
    };
    geometry.world_triangles().filter_map(power).collect()
}

/// Mean linear colour over a triangle, by one point for each texel it covers, at least 16 and at most 256.
fn mean_texel(image: &Image, texture: &TextureRef, corners: [Vec2; 3], decode: &[f64; 256]) -> DVec3 {
    let transform = texture.transform.to_affine();
    let size = Vec2::new(image.width as f32, image.height as f32);
    let [a, b, c] = corners.map(|uv| transform.transform_point2(uv) * size);
    let covered = 0.5 * (b - a).perp_dot(c - a).abs();
    let count = if covered < 256.0 { 16.max(covered as u32) } else { 256 };
    let texel = |x: f32, y: f32| {
        let wrap = |i: f32, n: u32, mode: Wrap| {
            let (i, n) = (i as i64, i64::from(n));
            (match mode {
                Wrap::Repeat => i.rem_euclid(n),
                Wrap::MirroredRepeat if i.rem_euclid(2 * n) < n => i.rem_euclid(2 * n),
                Wrap::MirroredRepeat => 2 * n - 1 - i.rem_euclid(2 * n),
                Wrap::ClampToEdge => i.clamp(0, n - 1),
            }) as usize
        };
        let column = wrap(x, image.width, texture.sampler.wrap_u);
        let row = wrap(y, image.height, texture.sampler.wrap_v);
        let i = row * image.width as usize + column;
        let high = image.texels[i];
        DVec3::from_array(std::array::from_fn(|channel| match image.low_bytes().get(i) {
            Some(low) => {
                let value = u16::from_be_bytes([high[channel], low[channel]]);
                srgb_to_linear(f32::from(value) / 65535.0).into()
            }
            None => decode[high[channel] as usize],
        }))
    };
    let mut sum = DVec3::ZERO;
    for i in 0..count {
        let root = halton(0, i + 1, 0).sqrt();
        let v = halton(1, i + 1, 0);
        let p = a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v);
        if texture.sampler.filter == Filter::Nearest {
            sum += texel(p.x.floor(), p.y.floor());
            continue;
        }
        let corner = (p - 0.5).floor();
        let f = (p - 0.5 - corner).as_dvec2();
        let row = |y: f32| texel(corner.x, y).lerp(texel(corner.x + 1.0, y), f.x);
        sum += row(corner.y).lerp(row(corner.y + 1.0), f.y);
    }
    sum / f64::from(count)
}

/// How directions to an environment are chosen: rows, then columns of each, in proportion to solid angle times mean
/// luminance of a texel, bilinear interpolation included. Empty of no light.
#[derive(Default)]
pub(super) struct EnvironmentTable {
    /// Cumulative probability of rows.
    pub(super) rows: Vec<f32>,
    /// Cumulative probability of each row's columns.
    pub(super) columns: Vec<f32>,
    /// ∫L dω, all channels (W/m²).
    pub(super) flux: f64,
    /// ∫L dω, luminance (W/m²).
    total: f64,
}

impl EnvironmentTable {
    /// No texel is left out that any light comes from. `None` for a black environment.
    pub(super) fn of(environment: &Environment) -> Option<Self> {
        Self::above(environment, 0.0).filter(|table| table.total > 0.0)
    }

    /// The same of what exceeds the mean, for samples beside those of lobes, which find the rest (MIS compensation;
    /// Karlík et al., "MIS Compensation", 2019). `None` where nothing does but by rounding.
    pub(super) fn of_excess(&self, environment: &Environment) -> Option<Self> {
        Self::above(environment, self.total / (4.0 * PI)).filter(|table| table.total > 1e-6 * self.total)
    }

    /// Of what luminance exceeds `base`.
    fn above(environment: &Environment, base: f64) -> Option<Self> {
        let (width, height) = (environment.width as usize, environment.height as usize);
        let row_of = |y: usize| &environment.texels[y * width..(y + 1) * width];
        let (mut rows, mut columns) = (Vec::with_capacity(height), Vec::with_capacity(width * height));
        let (mut total, mut flux) = (0.0, 0.0);
        for y in 0..height {
            // Means of a bilinear function over its middle cell: 1/8, 3/4, 1/8 both ways.
            let (above, below) = (row_of(y.saturating_sub(1)), row_of((y + 1).min(height - 1)));
            let vertical: Vec<DVec3> = (0..width)
                .map(|x| 0.125 * (above[x].as_dvec3() + below[x].as_dvec3()) + 0.75 * row_of(y)[x].as_dvec3())
                .collect();
            let edge = |i: usize| (PI * i as f64 / height as f64).cos();
            let solid_angle = 2.0 * PI / width as f64 * (edge(y) - edge(y + 1));
            let first = columns.len();
            let mut row = 0.0;
            let mut sums = Vec::with_capacity(width);
            for x in 0..width {
                let (left, right) = (vertical[(x + width - 1) % width], vertical[(x + 1) % width]);
                let mean = 0.125 * (left + right) + 0.75 * vertical[x];
                let luminance = mean.dot(DVec3::new(0.2126, 0.7152, 0.0722));
                if luminance > base {
                    flux += mean.element_sum() * ((luminance - base) / luminance) * solid_angle;
                    row += (luminance - base) * solid_angle;
                }
                sums.push(row);
            }
            let share = |(x, sum)| if row > 0.0 { sum / row } else { (x + 1) as f64 / width as f64 };
            columns.extend(sums.into_iter().enumerate().map(share).map(|v| v as f32));
            columns[first + width - 1] = 1.0;
            total += row;
            rows.push(total);
        }
        let mut rows: Vec<f32> = rows.into_iter().map(|sum| (sum / total) as f32).collect();
        *rows.last_mut()? = 1.0;
        Some(Self { rows, columns, flux, total })
    }
}

/// An alias table (Vose 1991) over (instance, primitive, power); lights and the environment have no triangle to name.
/// With it the inverse of all power (1/W).
pub(super) fn choices(powers: &[(u32, u32, f64)]) -> (Vec<LightChoice>, f32) {
    let total: f64 = powers.iter().map(|&(.., power)| power).sum();
    let count = powers.len();
    let mut scaled: Vec<f64> = powers.iter().map(|&(.., power)| power / total * count as f64).collect();
    let mut choices: Vec<LightChoice> = powers
        .iter()
        .zip(0..)
        .map(|(&(instance, primitive, power), place)| LightChoice {
            probability: (power / total) as f32,
            threshold: 1.0,
            alias: place,
            instance,
            primitive,
        })
        .collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..count).partition(|&i| scaled[i] < 1.0);
    while let (Some(less), Some(&more)) = (small.pop(), large.last()) {
        choices[less].threshold = scaled[less] as f32;
        choices[less].alias = more as u32;
        scaled[more] -= 1.0 - scaled[less];
        if scaled[more] < 1.0 {
            large.pop();
            small.push(more);
        }
    }
    (choices, (1.0 / total) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn aliases_share_out_exactly_the_powers() {
        let powers: Vec<(u32, u32, f64)> =
            (0..97_u32).map(|i| (i, 2 * i, f64::from(i * i % 31) + 1e-3 * f64::from(i))).collect();
        let total: f64 = powers.iter().map(|p| p.2).sum();
        let (choices, inverse) = choices(&powers);
        assert!((f64::from(inverse) * total - 1.0).abs() < 1e-6);
        let mut shares = vec![0.0; powers.len()];
        for (i, choice) in choices.iter().enumerate() {
            assert_eq!((choice.instance, choice.primitive), (i as u32, 2 * i as u32));
            shares[i] += f64::from(choice.threshold) / choices.len() as f64;
            shares[choice.alias as usize] += (1.0 - f64::from(choice.threshold)) / choices.len() as f64;
        }
        for (i, (&(.., power), share)) in powers.iter().zip(&shares).enumerate() {
            assert!((power / total - share).abs() < 1e-7, "{i}: {power} of {total} gets {share}");
            assert!((f64::from(choices[i].probability) - power / total).abs() < 1e-7);
        }
    }

    #[test]
    fn means_of_texels_take_all_of_their_bits() {
        let image = Image { name: String::new(), width: 1, height: 1, texels: vec![[96; 4], [255; 4]] };
        let texture =
            TextureRef { image: 0, uv_set: 0, sampler: Default::default(), transform: Default::default() };
        let mean = mean_texel(&image, &texture, [Vec2::ZERO, Vec2::X, Vec2::Y], &[0.0; 256]);
        let expected = f64::from(srgb_to_linear(f32::from(0x60ff_u16) / 65535.0));
        assert!((mean - DVec3::splat(expected)).length() < 1e-6, "{mean} instead of {expected}");
    }

    #[test]
    fn a_black_environment_is_no_light_and_a_constant_one_gives_its_flux() {
        assert!(EnvironmentTable::of(&Environment::constant(Vec3::ZERO)).is_none());
        let mut environment = Environment::constant(Vec3::new(1.0, 2.0, 3.0));
        (environment.width, environment.height) = (8, 5);
        environment.texels = vec![environment.texels[0]; 40];
        let table = EnvironmentTable::of(&environment).unwrap();
        assert!((table.flux - 24.0 * PI).abs() < 1e-9);
        for (y, &row) in table.rows.iter().enumerate() {
            let expected = 0.5 - 0.5 * (PI * (y + 1) as f64 / 5.0).cos();
            assert!((f64::from(row) - expected).abs() < 1e-6);
        }
    }
}
