//! Materials and lights against closed forms, against the published formulas in 64 bits, and each sampler against its
//! own density.

mod common;

use bytemuck::Zeroable;
use glam::{Affine3A, DVec3, Quat, Vec2, Vec3};
use parhelion::accel::Geometry;
use parhelion::config::{LightChoice, RenderConfig};
use parhelion::graph::{Executor, Graph, Grid, RunOptions};
use parhelion::renderer::{BackendChoice, Renderer, RendererOptions};
use parhelion::sampling::{hash, sample_cosine_hemisphere};
use parhelion::scene::{
    self, Clearcoat, Environment, Image, Instance, Light, LightKind, LoadOptions, Material, Mesh, NormalMap,
    Sampler, Scene, TextureRef, TextureTransform, Wrap,
};
use parhelion::shaders::test::{bsdf, lights, surface};
use parhelion::shaders::{
    self, BsdfAnswer, BsdfQuery, LightAnswer, MATERIAL_SOLID, NO_TEXTURE, SceneData, SceneSpec,
    SurfaceAnswer, SurfaceQuery,
};
use parhelion::vk::{Backend, Device, MemoryKind};
use std::f64::consts::PI;
use std::sync::Arc;

const DIFFUSE: u32 = 1;
const GLOSSY: u32 = 2;
const DELTA: u32 = 4;
const TRANSMIT: u32 = 8;
const PANE: u32 = 16;
const ALL: u32 = 31;

// ---- numbers ----

/// In [0, 1), of `dimension` and `index`.
fn random(index: u32, dimension: u32) -> f32 {
    (hash(index ^ hash(dimension)) >> 8) as f32 / 16_777_216.0
}

/// One in each of n² cells of the first two dimensions.
fn stratified(index: u32, n: u32) -> Vec3 {
    let cell = Vec2::new((index % n) as f32, (index / n % n) as f32);
    let xy = (cell + Vec2::new(random(index, 0), random(index, 1))) / n as f32;
    Vec3::new(xy.x.min(0.999_999_9), xy.y.min(0.999_999_9), random(index, 2))
}

/// χ² of counts against what is expected, cells that expect fewer than 10 taken together, over its critical value at
/// α = 1e-5 (Wilson & Hilferty 1931).
fn chi2(counts: &[f64], expected: &[f64]) -> f64 {
    let (mut sum, mut cells, mut pooled) = (0.0, 0, (0.0, 0.0));
    for (&n, &e) in counts.iter().zip(expected) {
        if e < 10.0 {
            pooled = (pooled.0 + n, pooled.1 + e);
        } else {
            sum += (n - e).powi(2) / e;
            cells += 1;
        }
    }
    if pooled.1 >= 5.0 {
        sum += (pooled.0 - pooled.1).powi(2) / pooled.1;
        cells += 1;
    } else {
        assert!(pooled.0 <= 30.0, "{} samples where {} are expected", pooled.0, pooled.1);
    }
    let k = f64::from(cells - 1);
    sum / (k * (1.0 - 2.0 / (9.0 * k) + 4.265 * (2.0 / (9.0 * k)).sqrt()).powi(3))
}

// ---- materials ----

/// A plane of one material, on which queries are answered.
struct Plane {
    executor: Executor,
    set: Arc<parhelion::vk::SceneSet>,
}

impl Plane {
    fn new(device: &Device, energy_conserving: bool) -> Self {
        let mut uniform = device.buffer("scene", size_of::<SceneData>() as u64, MemoryKind::Upload).unwrap();
        // The method path's.
        let pane_roughness = 0.009_999;
        let energy_conserving = energy_conserving.into();
        let scene = SceneData { energy_conserving, pane_roughness, ..SceneData::zeroed() };
        uniform.mapped_mut().unwrap()[..size_of::<SceneData>()].copy_from_slice(bytemuck::bytes_of(&scene));
        let set = Arc::new(device.scene_set(Backend::Software, uniform, None).unwrap());
        Self { executor: Executor::new(device, Backend::Software).unwrap(), set }
    }

    fn ask(&mut self, materials: &[shaders::Material], queries: &[BsdfQuery]) -> Vec<BsdfAnswer> {
        let mut g = Graph::new();
        let m = g.buffer("materials", size_of_val(materials) as u64);
        g.upload("materials", m, bytemuck::cast_slice(materials).to_vec());
        let q = g.buffer("queries", size_of_val(queries) as u64);
        g.upload("queries", q, bytemuck::cast_slice(queries).to_vec());
        let answers = g.buffer("answers", (queries.len() * size_of::<BsdfAnswer>()) as u64);
        let bind = bsdf::Bind { materials: m, queries: q, answers };
        let params = bsdf::Params { count: queries.len() as u32 };
        let kernel = bsdf::kernel(&SceneSpec::default());
        g.pass("bsdf", &kernel, bind, params, Grid::Of([queries.len() as u32, 1, 1]));
        let ticket = g.read_buffer::<BsdfAnswer>(answers);
        let options = RunOptions { scene: Some(&self.set), ..RunOptions::default() };
        self.executor.run(g, &options).unwrap().take(ticket)
    }
}

/// A white dielectric of index 1.5.
fn plastic(roughness: f32) -> shaders::Material {
    shaders::Material {
        base_color: [1.0; 3],
        alpha: 1.0,
        roughness,
        specular_color: [1.0; 3],
        specular: 1.0,
        ior: 1.5,
        base_color_texture: NO_TEXTURE,
        ..shaders::Material::zeroed()
    }
}

fn metal(roughness: f32) -> shaders::Material {
    shaders::Material { base_color: [0.9, 0.6, 0.3], metallic: 1.0, ..plastic(roughness) }
}

fn pane(roughness: f32) -> shaders::Material {
    shaders::Material { transmission: 1.0, ..plastic(roughness) }
}

fn glass(roughness: f32) -> shaders::Material {
    shaders::Material { flags: MATERIAL_SOLID, ..pane(roughness) }
}

/// Everything at once.
fn paint(roughness: f32) -> shaders::Material {
    shaders::Material {
        base_color: [0.8, 0.5, 0.2],
        metallic: 0.3,
        transmission: 0.25,
        specular: 0.7,
        specular_color: [0.5, 1.0, 0.8],
        clearcoat: 0.8,
        clearcoat_roughness: 0.3,
        ..plastic(roughness)
    }
}

fn towards(degrees: f32) -> Vec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    Vec3::new(0.8 * sin, -0.6 * sin, cos)
}

fn query(wo: Vec3) -> BsdfQuery {
    BsdfQuery {
        wo: wo.to_array(),
        front: 1,
        lobes: ALL,
        wi: [0.0, 0.0, 1.0],
        normal: [0.0, 0.0, 1.0],
        clearcoat_normal: [0.0, 0.0, 1.0],
        ..BsdfQuery::zeroed()
    }
}

/// Directions and their solid angles: the midpoints of `fine`² parts of each of 24 × 16 cells around `axis`.
struct Sphere {
    frame: glam::Mat3,
    fine: usize,
}

impl Sphere {
    const RINGS: usize = 24;
    const SECTORS: usize = 16;

    fn around(axis: Vec3, fine: usize) -> Self {
        Self { frame: parhelion::sampling::basis_around(axis), fine }
    }

    fn points(&self) -> Vec<(usize, Vec3, f64)> {
        let (rings, sectors) = (Self::RINGS * self.fine, Self::SECTORS * self.fine);
        let mut points = Vec::with_capacity(rings * sectors);
        for ring in 0..rings {
            // Rings narrow towards the axis.
            let edge = |i: usize| PI * (i as f64 / rings as f64).powi(2);
            let (low, high) = (edge(ring), edge(ring + 1));
            let theta = 0.5 * (low + high);
            let solid_angle = (low.cos() - high.cos()) * 2.0 * PI / sectors as f64;
            for sector in 0..sectors {
                let phi = 2.0 * PI * (sector as f64 + 0.5) / sectors as f64 - PI;
                let local = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
                let cell = ring / self.fine * Self::SECTORS + sector / self.fine;
                points.push((cell, self.frame * local.as_vec3(), solid_angle));
            }
        }
        points
    }

    fn cell(&self, direction: Vec3) -> usize {
        let local = (self.frame.transpose() * direction).as_dvec3();
        let theta = local.truncate().length().atan2(local.z);
        let ring = ((theta / PI).sqrt() * Self::RINGS as f64) as usize;
        let sector = ((local.y.atan2(local.x) / (2.0 * PI) + 0.5) * Self::SECTORS as f64) as usize;
        ring.min(Self::RINGS - 1) * Self::SECTORS + sector.min(Self::SECTORS - 1)
    }
}

/// Directions are where the density says they are, those absorbed below the horizon included (χ², α = 1e-5); the density
/// is at most one in all; the weight is f·cosθ over the density, which bsdf_pdf gives too.
#[test]
fn samples_follow_their_density_and_carry_f_over_it() {
    let Some((_guard, device)) = common::device() else { return };
    let tilted = Vec3::new(0.3, -0.2, 1.0).normalize();
    let up = Vec3::Z;
    let coat = Vec3::new(-0.2, 0.1, 1.0).normalize();
    let cases: &[(&str, shaders::Material, f32, u32, Vec3, bool)] = &[
        ("diffuse", plastic(1.0), 30.0, DIFFUSE, up, true),
        ("diffuse, tilted", plastic(1.0), 30.0, DIFFUSE, tilted, true),
        ("metal 0.2", metal(0.2), 20.0, ALL, up, true),
        ("metal 0.5", metal(0.5), 70.0, ALL, up, true),
        ("metal 1, grazing", metal(1.0), 88.0, ALL, up, true),
        ("metal 0.5, tilted", metal(0.5), 70.0, ALL, tilted, true),
        ("plastic 0.3", plastic(0.3), 60.0, ALL, up, true),
        ("pane 0.4", pane(0.4), 40.0, ALL, up, true),
        ("glass 0.3, in", glass(0.3), 30.0, ALL, up, true),
        ("glass 0.6, in, grazing", glass(0.6), 80.0, ALL, up, true),
        ("glass 0.3, out", glass(0.3), 30.0, ALL, up, false),
        ("glass 0.5, out, near the critical angle", glass(0.5), 42.0, ALL, up, false),
        ("glass 0.4, transmission only", glass(0.4), 50.0, GLOSSY | TRANSMIT, tilted, true),
        ("paint", paint(0.4), 50.0, ALL, tilted, true),
        ("paint, grazing", paint(0.7), 80.0, ALL, up, true),
    ];
    const N: u32 = 1 << 16;
    let mut plane = Plane::new(&device, false);
    for &(name, material, degrees, lobes, normal, front) in cases {
        let wo = towards(degrees);
        let base = BsdfQuery {
            lobes,
            front: front.into(),
            normal: normal.to_array(),
            clearcoat_normal: if name.starts_with("paint") { coat } else { up }.to_array(),
            ..query(wo)
        };
        let sphere = Sphere::around((2.0 * wo.z * up - wo).normalize(), 16);
        let points = sphere.points();
        let quadrature: Vec<_> =
            points.iter().map(|&(_, wi, _)| BsdfQuery { wi: wi.to_array(), ..base }).collect();
        let mut expected = vec![0.0; Sphere::RINGS * Sphere::SECTORS + 1];
        for (answer, &(cell, _, solid_angle)) in plane.ask(&[material], &quadrature).iter().zip(&points) {
            expected[cell] += f64::from(answer.pdf) * solid_angle * f64::from(N);
        }
        let all: f64 = expected.iter().sum();
        assert!(all < 1.003 * f64::from(N), "{name}: the density integrates to {}", all / f64::from(N));
        *expected.last_mut().unwrap() = (f64::from(N) - all).max(0.0);

        let random = |i| Vec3::new(random(i, 0), random(i, 1), random(i, 2));
        let samples: Vec<_> = (0..N).map(|i| BsdfQuery { u: random(i).to_array(), ..base }).collect();
        let answers = plane.ask(&[material], &samples);
        let mut counts = vec![0.0; expected.len()];
        for answer in &answers {
            let place =
                if answer.found == 1 { sphere.cell(answer.direction.into()) } else { counts.len() - 1 };
            counts[place] += 1.0;
        }
        let ratio = chi2(&counts, &expected);
        assert!(ratio < 1.0, "{name}: χ² is {ratio} times its critical value");

        let again: Vec<_> =
            answers.iter().filter(|a| a.found == 1).map(|a| BsdfQuery { wi: a.direction, ..base }).collect();
        let found: Vec<_> = answers.iter().filter(|a| a.found == 1).collect();
        for (sample, at) in found.iter().zip(plane.ask(&[material], &again)) {
            assert_eq!(sample.lobe & DELTA, 0, "{name}");
            assert_eq!(sample.lobe & lobes, sample.lobe, "{name}: a lobe nobody asked for");
            assert!((sample.sample_pdf / at.pdf - 1.0).abs() < 1e-5, "{name}: {sample:?} {at:?}");
            for c in 0..3 {
                let expected = at.f[c] / at.pdf;
                let difference = (sample.weight[c] - expected).abs();
                assert!(difference <= 1e-5 * expected, "{name}: {sample:?} {at:?}");
            }
        }
    }
}

// ---- the published formulas in 64 bits (glTF 2.0, appendix B) ----

fn ggx(cos_h: f64, alpha: f64) -> f64 {
    let a2 = alpha * alpha;
    a2 / (PI * (cos_h * cos_h * (a2 - 1.0) + 1.0).powi(2))
}

fn visibility(o: f64, i: f64, alpha: f64) -> f64 {
    let a2 = alpha * alpha;
    0.5 / (i * (o * o * (1.0 - a2) + a2).sqrt() + o * (i * i * (1.0 - a2) + a2).sqrt())
}

fn schlick(f0: f64, f90: f64, cos: f64) -> f64 {
    f0 + (f90 - f0) * (1.0 - cos).powi(5)
}

fn fresnel(cos_i: f64, eta: f64) -> f64 {
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin2_t >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    0.5 * (s * s + p * p)
}

/// f of a material without transmission or clear coat, one channel.
fn published(m: &shaders::Material, channel: usize, wo: DVec3, wi: DVec3) -> f64 {
    let base = f64::from(m.base_color[channel]);
    let (metallic, alpha) = (f64::from(m.metallic), f64::from(m.roughness * m.roughness));
    let h = (wo + wi).normalize();
    let lobe = visibility(wo.z, wi.z, alpha) * ggx(h.z, alpha);
    let specular = f64::from(m.specular);
    let dielectric = |c: usize| {
        let r = (f64::from(m.ior) - 1.0) / (f64::from(m.ior) + 1.0);
        let f0 = (r * r * f64::from(m.specular_color[c])).min(1.0);
        specular * schlick(f0, 1.0, wo.dot(h))
    };
    let strongest = (0..3).map(dielectric).fold(0.0, f64::max);
    let plastic = (1.0 - strongest) * base / PI + dielectric(channel) * lobe;
    let metal = schlick(base, 1.0, wo.dot(h)) * lobe;
    plastic * (1.0 - metallic) + metal * metallic
}

fn hemisphere(index: u32) -> Vec3 {
    sample_cosine_hemisphere(Vec2::new(random(index, 7), random(index, 8)))
}

/// f at random pairs of directions is what glTF 2.0 publishes, and that of refraction what Walter et al. do.
#[test]
fn reflection_and_refraction_are_the_published_ones() {
    let Some((_guard, device)) = common::device() else { return };
    let mut plane = Plane::new(&device, false);
    let mixed = |roughness| shaders::Material { clearcoat: 0.0, transmission: 0.0, ..paint(roughness) };
    for material in [plastic(0.3), plastic(0.9), metal(0.4), mixed(0.5), mixed(0.8)] {
        let pairs: Vec<_> = (0..2000).map(|i| (hemisphere(2 * i), hemisphere(2 * i + 1))).collect();
        let queries: Vec<_> =
            pairs.iter().map(|&(wo, wi)| BsdfQuery { wi: wi.to_array(), ..query(wo) }).collect();
        for (answer, (wo, wi)) in plane.ask(&[material], &queries).iter().zip(&pairs) {
            for c in 0..3 {
                let expected = published(&material, c, wo.as_dvec3(), wi.as_dvec3()) * f64::from(wi.z);
                let f = f64::from(answer.f[c]);
                assert!((f - expected).abs() <= 2e-4 * expected + 1e-6, "{wo} {wi}: {f} for {expected}");
            }
        }
    }
    for (roughness, front) in [(0.3, 1), (0.7, 1), (0.7, 0)] {
        let pairs: Vec<_> = (0..4000).map(|i| (hemisphere(2 * i), -hemisphere(2 * i + 1))).collect();
        let queries: Vec<_> =
            pairs.iter().map(|&(wo, wi)| BsdfQuery { wi: wi.to_array(), front, ..query(wo) }).collect();
        let alpha = f64::from(roughness * roughness);
        let (n_o, n_i) = if front == 1 { (1.0, 1.5) } else { (1.5, 1.0) };
        let mut refracted = 0;
        for (answer, (wo, wi)) in plane.ask(&[glass(roughness)], &queries).iter().zip(&pairs) {
            let (o, i) = (wo.as_dvec3(), wi.as_dvec3());
            let mut h = (n_o * o + n_i * i).normalize();
            h *= h.z.signum();
            let (oh, ih) = (o.dot(h), i.dot(h));
            let expected = if oh > 0.0 && ih < 0.0 {
                let lambda = |c: f64| 0.5 * ((1.0 + alpha * alpha * (1.0 / (c * c) - 1.0)).sqrt() - 1.0);
                let g = 1.0 / (1.0 + lambda(o.z) + lambda(i.z));
                // Walter et al. 2007, eq. 21, times |cosθ_i|, for radiance: over (n_i/n_o)².
                let t = 1.0 - fresnel(oh, n_i / n_o);
                let jacobian = n_i * n_i * -ih / (n_o * oh + n_i * ih).powi(2);
                oh / o.z * t * g * ggx(h.z, alpha) * jacobian * (n_o / n_i).powi(2)
            } else {
                0.0
            };
            refracted += u32::from(expected > 0.0);
            let f = f64::from(answer.f[0]);
            assert!((f - expected).abs() <= 1e-3 * expected + 1e-5, "{wo} {wi}: {f} for {expected}");
        }
        assert!(refracted > 1000);
    }
}

/// Light that goes the other way is scattered alike; through a boundary, but for the square of its index.
#[test]
fn scattering_is_reciprocal() {
    let Some((_guard, device)) = common::device() else { return };
    let uncoated = shaders::Material { clearcoat: 0.0, ..paint(0.5) };
    let pairs: Vec<_> = (0..2000).map(|i| (hemisphere(2 * i), hemisphere(2 * i + 1))).collect();
    let ask = |plane: &mut Plane, material, back: bool, to: fn(Vec3, Vec3) -> [Vec3; 2]| {
        let both = |&(a, b): &(Vec3, Vec3)| {
            let [wo, wi] = to(a, b);
            BsdfQuery { wi: wi.to_array(), front: u32::from(!back), ..query(wo) }
        };
        let queries: Vec<_> = pairs.iter().map(both).collect();
        plane.ask(&[material], &queries)
    };
    let close = |a: f32, b: f32| (a - b).abs() <= 1e-3 * a.max(b) + 1e-6;
    for conserving in [false, true] {
        let mut plane = Plane::new(&device, conserving);
        for material in [plastic(0.4), metal(0.3), uncoated, pane(0.5)] {
            let there = ask(&mut plane, material, false, |a, b| [a, b]);
            let back = ask(&mut plane, material, false, |a, b| [b, a]);
            for ((a, b), (wo, wi)) in there.iter().zip(&back).zip(&pairs) {
                for c in 0..3 {
                    assert!(close(a.f[c] / wi.z, b.f[c] / wo.z), "{wo} {wi}: {a:?} {b:?}");
                }
            }
        }
    }
    let mut plane = Plane::new(&device, false);
    for (roughness, solid) in [(0.5, true), (0.8, true), (0.5, false)] {
        let material = if solid { glass(roughness) } else { pane(roughness) };
        // Seen from the other side the world is turned about X.
        let there = ask(&mut plane, material, false, |a, b| [a, -b]);
        let back = ask(&mut plane, material, true, |a, b| {
            let turn = |v: Vec3| Vec3::new(v.x, -v.y, -v.z);
            [turn(-b), turn(a)]
        });
        let scale = if solid { 1.5 * 1.5 } else { 1.0 };
        for ((a, b), (wo, wi)) in there.iter().zip(&back).zip(&pairs) {
            assert!(close(a.f[0] * scale / wi.z, b.f[0] / wo.z), "{wo} {wi}: {a:?} {b:?}");
        }
    }
}

/// Mean weight over all directions: the share of light scattered towards `degrees` in a white furnace. With it, as a
/// ratio over the square of the index, what a boundary transmits.
fn albedo(plane: &mut Plane, material: shaders::Material, degrees: f32, lobes: u32, front: bool) -> f64 {
    const SIDE: u32 = 96;
    let base = BsdfQuery { lobes, front: front.into(), ..query(towards(degrees)) };
    let queries: Vec<_> =
        (0..SIDE * SIDE).map(|i| BsdfQuery { u: stratified(i, SIDE).to_array(), ..base }).collect();
    let answers = plane.ask(&[material], &queries);
    let weight = |a: &BsdfAnswer| {
        f64::from(a.weight.iter().copied().fold(0.0, f32::max))
            * f64::from(a.eta * a.eta)
            * f64::from(a.found)
    };
    answers.iter().map(weight).sum::<f64>() / f64::from(SIDE * SIDE)
}

/// No lobe alone gives more than it gets, nor does the whole with the energy-conserving mix.
#[test]
fn lobes_conserve_energy_in_a_white_furnace() {
    let Some((_guard, device)) = common::device() else { return };
    let white = |roughness| shaders::Material { base_color: [1.0; 3], ..metal(roughness) };
    let coat = |roughness| shaders::Material {
        base_color: [0.0; 3],
        specular: 0.0,
        clearcoat: 1.0,
        clearcoat_roughness: roughness,
        ..plastic(1.0)
    };
    let coated =
        |roughness| shaders::Material { clearcoat: 1.0, clearcoat_roughness: roughness, ..plastic(0.5) };
    type Lobe<'a> = (&'a str, &'a dyn Fn(f32) -> shaders::Material, u32, bool);
    let lobes: &[Lobe<'_>] = &[
        ("diffuse", &plastic, DIFFUSE, true),
        ("metal", &white, GLOSSY | DELTA, true),
        ("dielectric", &plastic, GLOSSY | DELTA, true),
        ("pane", &pane, GLOSSY | DELTA | TRANSMIT | PANE, true),
        ("glass in", &glass, GLOSSY | DELTA | TRANSMIT, true),
        ("glass out", &glass, GLOSSY | DELTA | TRANSMIT, false),
        ("coat", &coat, ALL, true),
    ];
    let mut plane = Plane::new(&device, false);
    let mut conserving = Plane::new(&device, true);
    for roughness in [0.0, 0.005, 0.05, 0.2, 0.5, 1.0] {
        for degrees in [0.0, 45.0, 75.0, 85.0, 89.0] {
            for (name, material, mask, front) in lobes {
                let all = albedo(&mut plane, material(roughness), degrees, *mask, *front);
                assert!(all <= 1.002, "{name}, roughness {roughness}, {degrees}°: {all}");
            }
            for (name, material) in [("plastic", plastic(roughness)), ("coated", coated(roughness))] {
                let all = albedo(&mut conserving, material, degrees, ALL, true);
                assert!(all <= 1.01, "{name}, roughness {roughness}, {degrees}°: {all}");
                // The price: a few percent at most where light is not grazing.
                assert!(degrees > 60.0 || all > 0.8, "{name}, roughness {roughness}, {degrees}°: {all}");
            }
        }
        // A smooth interface splits light without loss.
        if roughness < 0.01 {
            for degrees in [0.0, 45.0, 75.0] {
                for (material, front) in [
                    (white(roughness), true),
                    (pane(roughness), true),
                    (glass(roughness), true),
                    (glass(roughness), false),
                ] {
                    let all = albedo(&mut plane, material, degrees, ALL, front);
                    assert!((all - 1.0).abs() < 1e-4, "roughness {roughness}, {degrees}°: {all}");
                }
            }
        }
    }
}

/// Albedo of the published dielectric mix, by quadrature of its own: slopes in proportion to D·cosθ_h for the specular
/// part, cosine for the diffuse part.
fn published_albedo(roughness: f64, degrees: f64) -> f64 {
    let alpha = roughness * roughness;
    let o = DVec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
    let n = 512;
    let mut sum = 0.0;
    for a in 0..n {
        for b in 0..n {
            let (r, phi) = ((a as f64 + 0.5) / n as f64, 2.0 * PI * (b as f64 + 0.5) / n as f64);
            let tan = alpha * (r / (1.0 - r)).sqrt();
            let h = DVec3::new(tan * phi.cos(), tan * phi.sin(), 1.0).normalize();
            let oh = o.dot(h);
            let i = 2.0 * oh * h - o;
            if oh > 0.0 && i.z > 0.0 {
                sum += schlick(0.04, 1.0, oh) * 4.0 * visibility(o.z, i.z, alpha) * i.z * oh / h.z;
            }
            let i = DVec3::new(r.sqrt() * phi.cos(), r.sqrt() * phi.sin(), (1.0 - r).sqrt());
            sum += 1.0 - schlick(0.04, 1.0, o.dot((o + i).normalize()));
        }
    }
    sum / f64::from(n * n)
}

/// The mix as published has the albedo it has, above 1 at grazing angles.
#[test]
fn the_published_mix_has_its_own_albedo() {
    let Some((_guard, device)) = common::device() else { return };
    let mut plane = Plane::new(&device, false);
    assert!((published_albedo(0.05, 85.0) - 1.59).abs() < 0.01, "{}", published_albedo(0.05, 85.0));
    for roughness in [0.05, 0.2, 0.5, 1.0] {
        for degrees in [0.0, 45.0, 75.0, 85.0] {
            let expected = published_albedo(roughness, degrees);
            let found = albedo(&mut plane, plastic(roughness as f32), degrees as f32, ALL, true);
            assert!((found / expected - 1.0).abs() < 0.01, "{roughness}, {degrees}°: {found} for {expected}");
        }
    }
}

/// The Lambertian that stands for the diffuse part: exactly its albedo, Fresnel's share and the coat's taken off.
#[test]
fn the_diffuse_albedo_is_that_of_the_mix() {
    let Some((_guard, device)) = common::device() else { return };
    let mut plane = Plane::new(&device, false);
    for degrees in [0.0_f32, 60.0, 80.0] {
        let cos = f64::from(degrees.to_radians().cos());
        let m = paint(0.5);
        let coat = f64::from(m.clearcoat) * schlick(0.04, 1.0, cos);
        // Transmission: the exact Fresnel of a thin wall, its strongest channel times the specular factor.
        let r = fresnel(cos, 1.5);
        let share = (1.0 - 0.7 * (2.0 * r / (1.0 + r))) * (1.0 - coat) * 0.7 * 0.75;
        let answer = plane.ask(&[m], &[query(towards(degrees))])[0];
        for (found, base) in answer.diffuse.iter().zip(m.base_color) {
            assert!((f64::from(*found) - share * f64::from(base)).abs() < 1e-5, "{degrees}°: {answer:?}");
        }
    }
}

/// Delta lobes: α under 1e-4 reflects and refracts by Snell's law, weighted by Fresnel's reflectance; no density sees it.
#[test]
fn smooth_interfaces_scatter_into_two_directions() {
    let Some((_guard, device)) = common::device() else { return };
    let mut plane = Plane::new(&device, false);
    let wo = towards(40.0);
    for (material, front, eta) in
        [(glass(0.009), true, 1.5), (glass(0.0), false, 1.0 / 1.5), (pane(0.0), true, 1.0)]
    {
        let queries: Vec<_> = (0..1000)
            .map(|i| BsdfQuery {
                u: [0.3, 0.6, (i as f32 + 0.5) / 1000.0],
                front: front.into(),
                wi: Vec3::new(-wo.x, -wo.y, wo.z).to_array(),
                ..query(wo)
            })
            .collect();
        let mut reflected = 0.0;
        for answer in plane.ask(&[material], &queries) {
            assert_eq!((answer.found, answer.pdf, answer.sample_pdf, answer.f), (1, 0.0, 0.0, [0.0; 3]));
            let wi = Vec3::from(answer.direction);
            if answer.lobe == DELTA {
                reflected += 1e-3;
                assert!(wi.abs_diff_eq(Vec3::new(-wo.x, -wo.y, wo.z), 1e-6));
                assert!((answer.weight[0] - 1.0).abs() < 1e-5);
            } else {
                assert_eq!(answer.lobe, if eta == 1.0 { PANE } else { DELTA | TRANSMIT });
                let bent = Vec3::new(-wo.x / eta, -wo.y / eta, 0.0);
                let expected = bent - Vec3::Z * (1.0 - bent.length_squared()).sqrt();
                assert!(wi.abs_diff_eq(expected, 1e-6), "{wi} for {expected}");
                assert!((answer.eta - eta).abs() < 1e-6);
                assert!((answer.weight[0] * eta * eta - 1.0).abs() < 1e-5, "{answer:?}");
            }
        }
        let mut r = fresnel(f64::from(wo.z), f64::from(eta));
        if eta == 1.0 {
            r = fresnel(f64::from(wo.z), 1.5);
            r = 2.0 * r / (1.0 + r);
        }
        assert!((reflected - r).abs() < 2e-3, "{reflected} for {r}");
    }
    // α just above is a lobe.
    let rough = plane.ask(&[glass(0.0101)], &[query(wo)])[0];
    assert_eq!(rough.lobe & DELTA, 0);
    assert!(rough.sample_pdf > 0.0);
}

/// Nothing is infinite, undefined or negative, however grazing the view and extreme the numbers.
#[test]
fn scattering_stays_finite_at_the_edges() {
    let Some((_guard, device)) = common::device() else { return };
    let mut queries = Vec::new();
    let mut materials = Vec::new();
    for make in [plastic, metal, pane, glass, paint] {
        for roughness in [0.0, 0.0101, 0.05, 0.5, 1.0] {
            let material = materials.len() as u32;
            materials.push(make(roughness));
            materials[material as usize].clearcoat_roughness = roughness;
            for z in [1e-7_f32, 1e-4, 0.5, 1.0] {
                let wo = Vec3::new((1.0 - z * z).sqrt(), 0.0, z);
                for u in 0..27_u32 {
                    let end = |i: u32| [0.0, 0.5, 0.999_999_94][(i % 3) as usize];
                    let u = [end(u), end(u / 3), end(u / 9)];
                    let wi = Vec3::new(-wo.x, 0.0, if u[0] == 0.5 { -z } else { z });
                    let normal = Vec3::new(-u[1], 0.2, 1.0).normalize().to_array();
                    for front in 0..2 {
                        let wi = wi.to_array();
                        queries.push(BsdfQuery { u, wi, front, material, normal, ..query(wo) });
                    }
                }
            }
        }
    }
    for conserving in [false, true] {
        let answers = Plane::new(&device, conserving).ask(&materials, &queries);
        for (query, a) in queries.iter().zip(answers) {
            let numbers = [a.f, a.weight, a.sample_f, a.diffuse, [a.pdf, a.sample_pdf, a.eta]];
            let fine = numbers.as_flattened().iter().all(|v| v.is_finite() && *v >= 0.0);
            assert!(fine && Vec3::from(a.direction).is_finite(), "{query:?} {a:?}");
            assert!(a.found == 0 || (Vec3::from(a.direction).length() - 1.0).abs() < 1e-4, "{query:?} {a:?}");
        }
    }
}

// ---- surfaces ----

fn instance(mesh: u32, transform: Affine3A) -> Instance {
    Instance { name: String::new(), mesh, transform, moves: false }
}

fn renderer(device: &Device, scene: Scene) -> Renderer {
    let options =
        RendererOptions { backend: BackendChoice::Force(Backend::Software), ..RendererOptions::default() };
    Renderer::new(device, scene, &options).unwrap()
}

fn surfaces(renderer: &mut Renderer, queries: &[SurfaceQuery]) -> Vec<SurfaceAnswer> {
    let mut g = Graph::new();
    let q = g.buffer("queries", size_of_val(queries) as u64);
    g.upload("queries", q, bytemuck::cast_slice(queries).to_vec());
    let answers = g.buffer("answers", (queries.len() * size_of::<SurfaceAnswer>()) as u64);
    let params = surface::Params { count: queries.len() as u32 };
    let kernel = surface::kernel(&SceneSpec::default());
    let bind = surface::Bind { queries: q, answers };
    g.pass("surface", &kernel, bind, params, Grid::Of([queries.len() as u32, 1, 1]));
    let ticket = g.read_buffer::<SurfaceAnswer>(answers);
    let camera = renderer.scene().frame_camera();
    renderer.run(g, &RenderConfig::default(), &camera).unwrap().take(ticket)
}

fn texture(image: u32) -> TextureRef {
    TextureRef {
        image,
        uv_set: 0,
        sampler: Sampler { wrap_u: Wrap::ClampToEdge, wrap_v: Wrap::ClampToEdge, ..Sampler::default() },
        transform: TextureTransform::default(),
    }
}

fn image(width: u32, height: u32, texels: &[[u8; 4]]) -> Image {
    Image { name: "texels".into(), width, height, texels: texels.to_vec() }
}

/// A unit square in the plane z = 0, facing +Z, its texture upright.
fn square() -> Mesh {
    Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y],
        normals: vec![Vec3::Z; 4],
        uv0: vec![Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![0; 2],
        ..Mesh::default()
    }
}

/// Each texture multiplies its factor, in its channels and its encoding.
#[test]
fn textures_multiply_their_factors() {
    let Some((_guard, device)) = common::device() else { return };
    let texel = [51_u8, 102, 153, 204];
    let linear = texel.map(|v| f32::from(v) / 255.0);
    let decoded = [0, 1, 2].map(|c| ((linear[c] + 0.055) / 1.055).powf(2.4));
    let material = Material {
        metallic: 0.5,
        roughness: 0.75,
        metallic_roughness_texture: Some(texture(0)),
        emission: Vec3::new(2.0, 3.0, 4.0),
        emission_texture: Some(texture(0)),
        transmission: 0.5,
        transmission_texture: Some(texture(0)),
        specular: 0.5,
        specular_texture: Some(texture(0)),
        specular_color: Vec3::new(0.5, 1.0, 1.0),
        specular_color_texture: Some(texture(0)),
        clearcoat: Some(Clearcoat {
            factor: 0.5,
            texture: Some(texture(0)),
            roughness: 0.5,
            roughness_texture: Some(texture(0)),
            normal_map: None,
        }),
        ..Material::default()
    };
    let scene = Scene {
        meshes: vec![square().into()],
        instances: vec![instance(0, Affine3A::IDENTITY)],
        materials: vec![material],
        images: vec![image(1, 1, &[texel]).into()],
        ..Scene::default()
    };
    let mut renderer = renderer(&device, scene);
    let m = surfaces(&mut renderer, &[SurfaceQuery::zeroed()])[0].material;
    let close = |what: &str, a: f32, b: f32| assert!((a - b).abs() < 1e-6, "{what}: {a} for {b}");
    close("roughness", m.roughness, 0.75 * linear[1]);
    close("metallic", m.metallic, 0.5 * linear[2]);
    close("transmission", m.transmission, 0.5 * linear[0]);
    close("specular", m.specular, 0.5 * linear[3]);
    close("clearcoat", m.clearcoat, 0.5 * linear[0]);
    close("clearcoat roughness", m.clearcoat_roughness, 0.5 * linear[1]);
    for c in 0..3 {
        close("emission", m.emission[c], [2.0, 3.0, 4.0][c] * decoded[c]);
        close("specular colour", m.specular_color[c], [0.5, 1.0, 1.0][c] * decoded[c]);
    }
}

/// A normal map bends the normal in the frame of the texture, in merged, placed, scaled and mirrored instances alike;
/// the coat has its own. The expected normal is made in object space and carried by the inverse transpose.
#[test]
fn normal_maps_follow_their_instances() {
    let Some((_guard, device)) = common::device() else { return };
    // x = 0.4, y = −0.2, z = 0.6 up to the rounding of bytes; the coat bends the other way.
    let bent = [179, 102, 204, 255].map(|v: u8| 2.0 * f32::from(v) / 255.0 - 1.0);
    let other = [77, 128, 204, 255].map(|v: u8| 2.0 * f32::from(v) / 255.0 - 1.0);
    let mut mesh = square();
    let material = Material {
        normal_map: Some(NormalMap { texture: texture(0), scale: 0.5 }),
        clearcoat: Some(Clearcoat {
            factor: 1.0,
            normal_map: Some(NormalMap { texture: texture(1), scale: 1.0 }),
            ..Clearcoat::default()
        }),
        ..Material::default()
    };
    mesh.generate_tangents(std::slice::from_ref(&material));
    let squash = Affine3A::from_scale_rotation_translation(
        Vec3::new(2.0, 0.5, 3.0),
        Quat::from_euler(glam::EulerRot::XYZ, 0.3, -0.8, 1.2),
        Vec3::new(5.0, 1.0, -2.0),
    );
    let transforms = [
        squash,
        Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)),
        squash * Affine3A::from_scale(Vec3::new(1.0, -2.0, 1.0)),
    ];
    for merged in [true, false] {
        for transform in transforms {
            let again = Affine3A::from_translation(Vec3::splat(20.0));
            let mut instances = vec![instance(0, transform)];
            if !merged {
                instances.push(instance(0, again));
            }
            let scene = Scene {
                meshes: vec![mesh.clone().into()],
                instances,
                materials: vec![material.clone()],
                images: [[179, 102, 204, 255], [77, 128, 204, 255]]
                    .map(|texel| image(1, 1, &[texel]).into())
                    .to_vec(),
                ..Scene::default()
            };
            let placed = Geometry::of(&scene).unwrap().instances.len() - 1;
            assert_eq!(placed, if merged { 0 } else { 2 });
            let mut renderer = renderer(&device, scene);
            let query =
                SurfaceQuery { instance: u32::from(!merged), primitive: 1, barycentrics: [0.25, 0.5] };
            let found = surfaces(&mut renderer, &[query])[0];
            let m = transform.matrix3;
            let flip = m.determinant().signum();
            let normal = Vec3::from((m.inverse().transpose() * glam::Vec3A::Z).normalize());
            // The frame: normal, tangent without its part along it, and the bitangent on the texture's upper side.
            let tangent = Vec3::from(m * glam::Vec3A::X);
            let tangent = (tangent - normal * normal.dot(tangent)).normalize();
            let bitangent = flip * normal.cross(tangent);
            assert!(bitangent.dot((m * glam::Vec3A::Y).into()) > 0.0);
            let map = |v: [f32; 4], scale: f32| {
                (scale * (v[0] * tangent + v[1] * bitangent) + v[2] * normal).normalize()
            };
            let (expected, coat) = (map(bent, 0.5), map(other, 1.0));
            assert!(Vec3::from(found.normal).abs_diff_eq(expected, 1e-5), "{found:?} for {expected}");
            assert!(Vec3::from(found.clearcoat_normal).abs_diff_eq(coat, 1e-5), "{found:?} for {coat}");
            assert!(Vec3::from(found.geometric_normal).abs_diff_eq(normal, 1e-5));
        }
    }
}

/// Real normal maps and tangents of the format's own samples: all normals are unit vectors on the front, many of them
/// bent.
#[test]
fn sample_models_have_bent_normals() {
    let Some((_guard, device)) = common::device() else { return };
    let Some(file) = common::shared("gltf-samples/ClearCoatTest/glTF-Binary/ClearCoatTest.glb") else {
        return;
    };
    let scene = scene::load(&file, &LoadOptions::default()).unwrap();
    assert_eq!(scene.materials.iter().filter(|m| m.clearcoat.is_some()).count(), 6);
    let bumpy: Vec<bool> = scene.materials.iter().map(|m| m.normal_map.is_some()).collect();
    assert!(bumpy.iter().any(|&b| b));
    let geometry = Geometry::of(&scene).unwrap();
    let queries: Vec<_> = (0..geometry.meshes[0].triangle_count)
        .map(|primitive| SurfaceQuery { instance: 0, primitive, barycentrics: [0.3, 0.3] })
        .collect();
    let mapped: Vec<bool> = geometry.source[..queries.len()]
        .iter()
        .map(|s| bumpy[scene.meshes[s.mesh as usize].materials[s.triangle as usize] as usize])
        .collect();
    let answers = surfaces(&mut renderer(&device, scene), &queries);
    let mut bent = 0;
    for (answer, mapped) in answers.iter().zip(mapped) {
        let (normal, front) = (Vec3::from(answer.normal), Vec3::from(answer.geometric_normal));
        assert!((normal.length() - 1.0).abs() < 1e-5 && normal.dot(front) > 0.0, "{answer:?}");
        bent += u32::from(mapped && normal.dot(front) < 0.99);
    }
    assert!(bent > 100, "{bent}");
}

// ---- lights ----

fn light_answers(renderer: &mut Renderer, from: Vec3, count: u32) -> Vec<LightAnswer> {
    answers_by(renderer, from, count, 0, LightChoice::Power)
}

/// From all lights, or, with a `set` of 2, from what is chosen beside lobes.
fn answers_by(
    renderer: &mut Renderer,
    from: Vec3,
    count: u32,
    set: u32,
    light_choice: LightChoice,
) -> Vec<LightAnswer> {
    let numbers: Vec<[f32; 3]> = (0..count).map(|i| [random(i, 3), random(i, 4), random(i, 5)]).collect();
    let mut g = Graph::new();
    let n = g.buffer("numbers", u64::from(count) * 12);
    g.upload("numbers", n, bytemuck::cast_slice(&numbers).to_vec());
    let answers = g.buffer("answers", u64::from(count) * size_of::<LightAnswer>() as u64);
    let params = lights::Params { from: from.to_array(), count, normal: [0.0; 3], set };
    let bind = lights::Bind { numbers: n, answers };
    let kernel = lights::kernel(&SceneSpec::default());
    g.pass("lights", &kernel, bind, params, Grid::Of([count, 1, 1]));
    let ticket = g.read_buffer::<LightAnswer>(answers);
    let camera = renderer.scene().frame_camera();
    renderer.run(g, &RenderConfig { light_choice, ..RenderConfig::default() }, &camera).unwrap().take(ticket)
}

fn lamp(radiance: Vec3) -> Material {
    Material { emission: radiance, ..Material::diffuse("lamp", Vec3::ZERO) }
}

/// Quads at distance 2 above the origin, facing down, of the given widths, one a material.
fn lamps(widths: &[f32], materials: Vec<Material>) -> Scene {
    let meshes: Vec<Mesh> = widths
        .iter()
        .zip(0..)
        .map(|(&width, i)| {
            let x = 1.5 * i as f32;
            Mesh {
                positions: [(0.0, 0.0), (width, 0.0), (width, 1.0), (0.0, 1.0)]
                    .map(|(u, v)| Vec3::new(x + u, 2.0, v))
                    .to_vec(),
                uv0: vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                materials: vec![i; 2],
                ..Mesh::default()
            }
        })
        .collect();
    let instances = (0..meshes.len() as u32).map(|i| instance(i, Affine3A::IDENTITY)).collect();
    let meshes = meshes.into_iter().map(Arc::new).collect();
    Scene { meshes, instances, materials, ..Scene::default() }
}

/// Emissive triangles are chosen in proportion to power and hit uniformly in area (χ²); the density that a ray finds
/// is the sample's; so is the radiance.
#[test]
fn emitters_are_sampled_by_power_and_area() {
    let Some((_guard, device)) = common::device() else { return };
    let mut dull = lamp(Vec3::new(1.0, 2.0, 3.0));
    dull.double_sided = false;
    // Black on the left, white on the right: mean one half.
    let mut striped = lamp(Vec3::splat(4.0));
    striped.emission_texture = Some(texture(0));
    let mut scene = lamps(&[1.0, 0.5, 1.0], vec![dull, lamp(Vec3::splat(8.0)), striped]);
    scene.images = vec![image(2, 1, &[[0, 0, 0, 255], [255; 4]]).into()];
    let powers = [6.0, 2.0 * 24.0 * 0.5, 2.0 * 12.0 * 0.5];
    let total: f64 = powers.iter().sum();
    let mut renderer = renderer(&device, scene);
    const N: u32 = 1 << 16;
    let answers = light_answers(&mut renderer, Vec3::new(0.7, 0.0, 0.3), N);
    let mut counts = vec![0.0; 6 * 4 + 1];
    let mut missed = 0;
    for a in &answers {
        if a.flags & 1 == 0 {
            counts[24] += 1.0;
            continue;
        }
        assert_eq!(a.flags, 1);
        if a.ray_distance.is_infinite() {
            missed += 1; // by rounding, at the outline
            continue;
        }
        assert!((a.distance - a.ray_distance).abs() < 1e-4, "{a:?}");
        assert!((a.pdf / a.ray_pdf - 1.0).abs() < 1e-3, "{a:?}");
        for c in 0..3 {
            assert!(
                (a.radiance_over_pdf[c] * a.pdf - a.radiance[c]).abs() < 2e-3 * a.radiance[c].max(1.0),
                "{a:?}"
            );
        }
        // Four parts of a triangle, of equal area.
        let [b1, b2] = a.barycentrics;
        let b0 = 1.0 - b1 - b2;
        let part = if b0 > 0.5 {
            0
        } else if b1 > 0.5 {
            1
        } else if b2 > 0.5 {
            2
        } else {
            3
        };
        counts[4 * a.primitive as usize + part] += 1.0;
    }
    assert!(missed < 10, "{missed}");
    // Of the striped one's triangles the dark quarter gives no samples; both have the same mean but for its estimate.
    let mut expected = [0.0; 25];
    for triangle in 0..6 {
        for part in 0..4 {
            expected[4 * triangle + part] = f64::from(N) * powers[triangle / 2] / total / 8.0;
        }
    }
    let plain: f64 = counts[..16].iter().sum();
    let share: f64 = expected[..16].iter().sum();
    assert!((plain - share).abs() < 4.5 * share.sqrt() + 0.02 * share, "{plain} for {share}");
    let scale = plain / share;
    let expected: Vec<f64> = expected[..16].iter().map(|e| e * scale).collect();
    let ratio = chi2(&counts[..16], &expected);
    assert!(ratio < 1.0, "χ² is {ratio} times its critical value: {counts:?}");
    // From behind the one-sided lamp is dark: only the others answer.
    let behind = light_answers(&mut renderer, Vec3::new(0.7, 5.0, 0.3), 1 << 12);
    for a in behind.iter().filter(|a| a.flags & 1 == 1) {
        assert!(a.primitive >= 2, "{a:?}");
    }
}

/// Triangles of placed instances, scaled and mirrored, are chosen by their area in the world, and face the same way.
#[test]
fn emitters_in_instances_are_sampled_by_their_area() {
    let Some((_guard, device)) = common::device() else { return };
    let mut material = lamp(Vec3::ONE);
    material.double_sided = false;
    let mut scene = lamps(&[1.0], vec![material]);
    // Turned over by the mirror: its front stays the lower side, as its normal is carried along.
    let mirrored = Affine3A::from_scale_rotation_translation(
        Vec3::new(-2.0, 1.0, 1.5),
        Quat::from_rotation_x(0.2),
        Vec3::new(-1.0, 0.0, 0.0),
    );
    scene.instances.push(instance(0, mirrored));
    let mut renderer = renderer(&device, scene);
    const N: u32 = 1 << 14;
    let answers = light_answers(&mut renderer, Vec3::ZERO, N);
    let (mut left, mut missed) = (0, 0);
    for a in &answers {
        assert_eq!(a.flags, 1, "both shine on the origin: {a:?}");
        if a.ray_distance.is_infinite() {
            missed += 1;
            continue;
        }
        left += u32::from(a.direction[0] < 0.0);
        assert!(
            (a.distance - a.ray_distance).abs() < 1e-4 && (a.pdf / a.ray_pdf - 1.0).abs() < 1e-3,
            "{a:?}"
        );
        assert_eq!(a.radiance, [1.0; 3]);
    }
    let share = f64::from(left) / f64::from(N);
    assert!((share - 0.75).abs() < 0.016, "{share} of the samples are on three quarters of the area");
    assert!(missed < 10, "{missed}");
}

/// An environment's directions follow luminance times solid angle (χ² over coarse cells), and a ray finds their density;
/// beside lobes they follow what exceeds the mean luminance.
#[test]
fn environments_are_sampled_by_luminance() {
    let Some((_guard, device)) = common::device() else { return };
    let (width, height) = (16, 8);
    let texels: Vec<Vec3> = (0..width * height)
        .map(|i| Vec3::new(random(i, 10), random(i, 11), random(i, 12)).powf(4.0) * 10.0)
        .collect();
    let environment = Environment { name: "noise".into(), width, height, texels };
    let twin = environment.clone();
    let mut scene = lamps(&[0.001], vec![Material::default()]);
    scene.environment = Some(environment.into());
    let mut renderer = renderer(&device, scene);
    const N: u32 = 1 << 16;
    let cell = |d: Vec3| {
        let uv = Vec2::new(
            d.z.atan2(d.x) / std::f32::consts::TAU + 0.5,
            d.y.clamp(-1.0, 1.0).acos() / std::f32::consts::PI,
        );
        let at = (uv * Vec2::new(width as f32, height as f32)).as_uvec2();
        (at.y.min(height - 1) * width + at.x.min(width - 1)) as usize
    };
    // Means over a cell's angles, as the tables have them, times its solid angle.
    let mut luminances = vec![0.0; (width * height) as usize];
    let solid_angle = |cell: usize| {
        let edge = |i: usize| (PI * i as f64 / f64::from(height)).cos();
        let row = cell / width as usize;
        (edge(row) - edge(row + 1)) * 2.0 * PI / f64::from(width)
    };
    const FINE: u32 = 16;
    for y in 0..height * FINE {
        let edge = |i: u32| PI * f64::from(i) / f64::from(height * FINE);
        let theta = 0.5 * (edge(y) + edge(y + 1));
        for x in 0..width * FINE {
            let phi = 2.0 * PI * ((f64::from(x) + 0.5) / f64::from(width * FINE) - 0.5);
            let d = DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()).as_vec3();
            let luminance = twin.radiance(d).dot(Vec3::new(0.2126, 0.7152, 0.0722));
            luminances[cell(d)] += f64::from(luminance) * solid_angle(cell(d)) / f64::from(FINE * FINE);
        }
    }
    let mean = luminances.iter().sum::<f64>() / (4.0 * PI);
    for beside_lobes in [false, true] {
        let base = if beside_lobes { mean } else { 0.0 };
        let above = |(cell, luminance): (usize, &f64)| (luminance - base * solid_angle(cell)).max(0.0);
        let mut expected: Vec<f64> = luminances.iter().enumerate().map(above).collect();
        let total: f64 = expected.iter().sum();
        for e in &mut expected {
            *e *= f64::from(N) / total;
        }
        let mut counts = vec![0.0; expected.len()];
        let mut elsewhere = 0;
        for a in
            answers_by(&mut renderer, Vec3::ZERO, N, if beside_lobes { 2 } else { 0 }, LightChoice::Power)
        {
            assert_eq!(a.flags, 1, "{a:?}");
            let d = Vec3::from(a.direction);
            assert!((d.length() - 1.0).abs() < 1e-5);
            counts[cell(d)] += 1.0;
            let radiance = twin.radiance(d);
            assert!(Vec3::from(a.radiance).abs_diff_eq(radiance, 1e-3), "{a:?} for {radiance}");
            elsewhere += u32::from((a.pdf / a.ray_pdf - 1.0).abs() > 1e-3);
        }
        assert!(elsewhere < 10, "{elsewhere} directions are in another cell for the ray than for the sample");
        let ratio = chi2(&counts, &expected);
        assert!(ratio < 1.0, "χ² is {ratio} times its critical value");
    }
}

/// Beside lobes nothing is left of a constant environment: samples are a lamp's, or there are none.
#[test]
fn a_constant_environment_is_left_to_lobes() {
    let Some((_guard, device)) = common::device() else { return };
    let shining = Material { emission: Vec3::ONE, ..Material::default() };
    for (material, shines) in [(shining, true), (Material::default(), false)] {
        let mut scene = lamps(&[1.0], vec![material]);
        scene.environment = Some(Environment::constant(Vec3::new(1.0, 2.0, 3.0)).into());
        let mut renderer = renderer(&device, scene);
        let found = |answers: &[LightAnswer]| answers.iter().filter(|a| a.flags == 1).count();
        let all = light_answers(&mut renderer, Vec3::ZERO, 1 << 12);
        assert_eq!(found(&all), all.len());
        assert!(all.iter().any(|a| a.ray_distance.is_infinite() && a.ray_pdf > 0.0));
        let beside = answers_by(&mut renderer, Vec3::ZERO, 1 << 12, 2, LightChoice::Power);
        assert_eq!(found(&beside), if shines { beside.len() } else { 0 });
        let off = beside.iter().filter(|a| (a.pdf / a.ray_pdf - 1.0).abs() > 1e-3).count();
        assert!(!shines || off < 10, "{off} rays find another density than their sample's");
    }
}

/// The mean over samples of radiance over density times cosine is irradiance: closed forms of a point, a directional and
/// a spot light, a constant environment and a luminous sphere, all at once and each alone.
#[test]
fn the_mean_of_light_samples_is_irradiance() {
    let Some((_guard, device)) = common::device() else { return };
    let light = |kind, position, direction, intensity: f32| Light {
        name: String::new(),
        kind,
        position,
        direction,
        intensity: Vec3::splat(intensity),
    };
    // A receiver at the origin that faces +Y.
    let point = light(LightKind::Point, Vec3::new(1.0, 2.0, 0.0), Vec3::NEG_Y, 30.0);
    let sun = light(LightKind::Directional, Vec3::ZERO, Vec3::new(0.0, -0.8, 0.6), 2.0);
    let spot = light(LightKind::Spot { inner: 0.2, outer: 0.6 }, Vec3::new(0.0, 3.0, 0.0), Vec3::NEG_Y, 40.0);
    let e_point = 30.0 * 2.0 / 5.0_f64.powf(1.5);
    let (e_sun, e_spot, e_sky) = (2.0 * 0.8, 40.0 / 9.0, 0.5 * PI);
    // A luminous sphere of radius 1 at distance 3, L = 2: E = πL (r/d)², and inscribed facets shrink it a little.
    let mut sphere = Mesh { ..Mesh::default() };
    let (rows, columns) = (32_u32, 64_u32);
    for row in 0..=rows {
        for column in 0..columns {
            let (theta, phi) =
                (PI * f64::from(row) / f64::from(rows), 2.0 * PI * f64::from(column) / f64::from(columns));
            let d = DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            sphere.positions.push(d.as_vec3() + Vec3::new(0.0, 3.0, 0.0));
            let next = (column + 1) % columns;
            let v = |r: u32, c: u32| r * columns + c;
            if row < rows {
                sphere.triangles.push([v(row, column), v(row, next), v(row + 1, column)]);
                sphere.triangles.push([v(row + 1, column), v(row, next), v(row + 1, next)]);
            }
        }
    }
    sphere.triangles.retain(|t| {
        let [a, b, c] = t.map(|v| sphere.positions[v as usize]);
        (b - a).cross(c - a).length() > 1e-6
    });
    sphere.materials = vec![0; sphere.triangles.len()];
    let mut shining = lamp(Vec3::splat(2.0));
    shining.double_sided = false;
    let e_sphere = PI * 2.0 / 9.0;
    let base = Scene {
        meshes: vec![sphere.into()],
        instances: vec![instance(0, Affine3A::IDENTITY)],
        materials: vec![Material::diffuse("dark", Vec3::ONE)],
        ..Scene::default()
    };
    let with = |lights: &[&Light], sky: bool, sphere: bool| Scene {
        lights: lights.iter().map(|&l| l.clone()).collect(),
        environment: sky.then(|| Environment::constant(Vec3::splat(0.5)).into()),
        materials: vec![if sphere { shining.clone() } else { base.materials[0].clone() }],
        ..base.clone()
    };
    let cases = [
        ("point", with(&[&point], false, false), e_point),
        ("sun", with(&[&sun], false, false), e_sun),
        ("spot", with(&[&spot], false, false), e_spot),
        ("sky", with(&[], true, false), e_sky),
        ("sphere", with(&[], false, true), e_sphere),
        ("all", with(&[&point, &sun, &spot], true, true), e_point + e_sun + e_spot + e_sky + e_sphere),
    ];
    const N: u32 = 1 << 16;
    for (name, scene, expected) in cases {
        let mut renderer = renderer(&device, scene);
        for (choice, most) in [(LightChoice::Power, 66), (LightChoice::Tree, 200)] {
            let answers = answers_by(&mut renderer, Vec3::ZERO, N, 0, choice);
            // Nothing is between: shadowing by the sphere itself is not asked for.
            let front =
                |a: &LightAnswer| f64::from(a.radiance_over_pdf[0]) * f64::from(a.direction[1].max(0.0));
            let seen = |a: &&LightAnswer| a.flags & 1 == 1;
            let sum: f64 = answers.iter().filter(seen).map(front).sum();
            let squares: f64 = answers.iter().filter(seen).map(|a| front(a).powi(2)).sum();
            let mean = sum / f64::from(N);
            let error = ((squares / f64::from(N) - mean * mean).max(0.0) / f64::from(N)).sqrt();
            let tolerance = 4.5 * error
                + 1e-4 * expected
                + if name == "sphere" || name == "all" { 0.01 * e_sphere } else { 0.0 };
            assert!((mean - expected).abs() < tolerance, "{name}: {mean} ± {error} for {expected}");
            // Nearer facets may lie in the way of a sample; at the outline the offset of its end tells.
            let other = |a: &&LightAnswer| {
                (a.pdf / a.ray_pdf - 1.0).abs() > 2e-3 && a.ray_distance >= 0.999 * a.distance
            };
            let others = answers.iter().filter(|a| a.flags & 3 == 1).filter(other).count();
            assert!(others < most, "{name}: {others} rays find another density than their sample's");
        }
    }
}

/// Lights exchanged in place are those that are chosen from.
#[test]
fn replaced_lights_are_sampled() {
    let Some((_guard, device)) = common::device() else { return };
    let light = |x: f32| Light {
        name: String::new(),
        kind: LightKind::Point,
        position: Vec3::new(x, 1.0, 0.0),
        direction: Vec3::NEG_Y,
        intensity: Vec3::ONE,
    };
    let mut scene = lamps(&[1.0], vec![lamp(Vec3::splat(0.5))]);
    scene.lights = vec![light(-3.0)];
    let mut renderer = renderer(&device, scene);
    let share = |answers: &[LightAnswer]| {
        answers.iter().filter(|a| a.flags & 2 == 2).count() as f64 / answers.len() as f64
    };
    // 3 · 4π W of a light beside 2 · 3 · π/2 of a lamp.
    let before = share(&light_answers(&mut renderer, Vec3::ZERO, 1 << 14));
    assert!((before - 12.0 / 15.0).abs() < 0.02, "{before}");
    renderer.set_lights(vec![light(3.0), light(4.0), light(5.0)]).unwrap();
    let answers = light_answers(&mut renderer, Vec3::ZERO, 1 << 14);
    assert!((share(&answers) - 36.0 / 39.0).abs() < 0.02);
    assert!(answers.iter().filter(|a| a.flags & 2 == 2).all(|a| a.direction[0] > 0.0));
    renderer.set_lights(Vec::new()).unwrap();
    assert_eq!(share(&light_answers(&mut renderer, Vec3::ZERO, 1 << 10)), 0.0);
}
