//! A statistical test of light that is itself tested: it holds for the sources as they are and fails for each of a list of
//! faults planted in them.
//!
//! Reflected light at points of several materials is estimated by four samplers: lights, lights that have a size by their
//! own table, lobes, and lights with lobes (multiple importance sampling); and known by quadrature for all but a pane.
//! Every estimate is a mean of `REPLICATES` independent ones, each of `SAMPLES` points of a scrambled (0, 2)-sequence, so
//! the difference of two over its standard error is Student's t, turned into a normal z (Wallace 1959). Of the comparisons
//! of one run none may be beyond the z that chance exceeds once in 1e5 runs (Bonferroni).
//!
//! Faults are planted side by side in one kernel and chosen by number when it runs: compiling takes longer than sampling.
#![cfg(feature = "compile")]

mod common;

use common::quad;
use glam::{Affine3A, DVec3, Vec3};
use parhelion::config::{LightChoice, RenderConfig};
use parhelion::graph::{Graph, Grid, ParamValue, RuntimeKernel};
use parhelion::renderer::{BackendChoice, Renderer, RendererOptions};
use parhelion::scene::{Camera, Clearcoat, Environment, Instance, Light, LightKind, Material, Scene};
use parhelion::vk::{Backend, Device};
use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

const REPLICATES: u32 = 64;
const SAMPLES: u32 = 256;

const KERNEL: &str = r#"#version 460
#extension GL_GOOGLE_include_directive : require
layout(local_size_x = 64) in;
layout(push_constant) uniform Params { uint count; uint replicates; uint samples; uint seed; uint fault; } params;
bool planted(uint fault) { return params.fault == fault; }
#include "lib/bsdf.glsl"
#include "lib/light_sampler.glsl"
#include "trace/trace.glsl"

layout(set = 1, binding = 0, scalar) readonly buffer Queries { vec4 data[]; } queries; // direction to the viewer, primitive
layout(set = 1, binding = 1, scalar) writeonly buffer Answers { vec4 data[]; } answers;

const uint LOBES = LOBE_ALL & ~LOBE_DELTA;

float weight(float p, float q) { return p * p / (p * p + q * q); }
float value(vec3 v) { return dot(v, vec3(0.5, 0.3, 0.2)); }
vec3 off(Surface s, vec3 direction) {
    vec3 n = s.geometric_normal;
    return offset_origin(s.position, dot(n, direction) < 0.0 ? -n : n);
}

bool through(Surface s) { return s.material.transmission > 0.0; }

// f·|cosθ| L over the density of light sampling, weighted if `both`.
vec3 asked(Surface s, bool front, vec3 wo, LightSample light, bool both) {
    if (light.delta) return vec3(0.0);
    float pdf;
    vec3 f = bsdf_evaluate(s, front, wo, light.direction, LOBES, pdf);
    if (f == vec3(0.0) || trace_any(off(s, light.direction), light.direction, 0.0, light.distance)) return vec3(0.0);
    return f * light.radiance_over_pdf * (both ? weight(light.pdf, pdf) : 1.0);
}

vec3 found(Surface s, bool front, vec3 wo, vec3 u, bool both) {
    BsdfSample b;
    if (!bsdf_sample(s, front, wo, u, LOBES, b)) return vec3(0.0);
    vec3 from = off(s, b.direction);
    Hit hit;
    if (!trace_closest(from, b.direction, 0.0, 1.0 / 0.0, hit)) {
        return b.weight * environment_radiance(b.direction) * (both ? weight(b.pdf, environment_pdf(all_lights(), b.direction)) : 1.0);
    }
    Surface lamp = surface_at(hit);
    bool lit = face(lamp, -b.direction);
    vec3 emitted = emitted_radiance(lamp.material, lit);
    if (emitted == vec3(0.0)) return emitted;
    float pdf = light_pdf(all_lights(), receiver_at(s), through(s), from, hit, lamp, lit, -b.direction, distance(from, lamp.position));
    return b.weight * emitted * (both ? weight(b.pdf, pdf) : 1.0);
}

vec3 point(uint i, uint seed, uint set) { return vec3(sobol(i, hash(seed, set)), sobol(i, hash(seed, set + 1u)).x); }

void main() {
    uint at = gl_GlobalInvocationID.x;
    if (at >= params.count * params.replicates) return;
    vec4 query = queries.data[at / params.replicates];
    vec3 wo = query.xyz;
    Surface s = surface_at(Hit(0.0, 0u, uint(query.w), vec2(0.0, 0.5)));
    bool front = face(s, wo);
    vec3 from = offset_origin(s.position, s.geometric_normal);
    uint seed = hash(params.seed, at);
    vec4 sum = vec4(0.0);
    LightSample light;
    for (uint i = 0u; i < params.samples; ++i) {
        LightSample light;
        // One call of each: what is inlined once compiles in a third of the time.
        for (uint way = 0u; way < 5u; ++way) {
            vec3 u = point(i, seed, 2u * way), reflected = vec3(0.0);
            bool both = way > 2u;
            if (way == 2u || way == 4u) {
                reflected = found(s, front, wo, u, both);
            } else {
                LightSource lights = all_lights();
                if (way == 1u) lights = sampled_lights();
                if (sample_light(lights, receiver_at(s), through(s), from, u.zxy, light)) reflected = asked(s, front, wo, light, both);
            }
            sum[min(way, 3u)] += value(reflected);
        }
    }
    answers.data[at] = sum / float(params.samples);
}
"#;

const SAMPLERS: [&str; 4] = ["lights", "lights with a size", "lobes", "both"];

/// An expression of a file under `glsl/` with another in its place that is wrong.
struct Fault {
    what: &'static str,
    file: &'static str,
    /// What stands there once, the expression in `«»`.
    place: &'static str,
    wrong: &'static str,
}

const fn fault(what: &'static str, file: &'static str, place: &'static str, wrong: &'static str) -> Fault {
    Fault { what, file, place, wrong }
}

const LIGHTS: &str = "lib/lights.glsl";
const SAMPLER: &str = "lib/light_sampler.glsl";
const BSDF: &str = "lib/bsdf.glsl";
const SURFACE: &str = "lib/surface.glsl";

const EMISSION: &str = "? material.base_color : «material.emission»;";
const SKY: &str = "return «Vec3Array(scene.environment)[uint(clamp(y, 0, size.y - 1) * size.x + x)].at»;";
const SKY_SAMPLE: &str = "s.pdf = «choice.probability * environment_density(lights, cell)»;";
const SKY_DENSITY: &str = "return «environment_probability(lights) * environment_density(lights, cell)»;";
const TEXEL_DENSITY: &str = "return «probability / solid_angle»;";
const SKY_THERE: &str = "if («lights.rows == 0UL») return 0.0;";
const SKY_FOUND: &str = "return «s.radiance_over_pdf != vec3(0.0)»;";
const SKY_HEIGHT: &str = "float k = «2.0 * sine * sine + v * height»;";
const LAMP_SAMPLE: &str = "emitter_density(p.index, inverse_power) * «way.distance2 / way.cosine»;";
const LAMP_POWER: &str = "chosen.by_tree, «lights.table.inverse_power», s);";
const LAMP_DENSITY: &str = "return «cosine > 0.0 ? emitter_density(index, lights.inverse_power) * distance * distance / cosine : 0.0»;";
const LAMP_WEIGHT: &str = "way.radiance / pdf, «pdf», false, false);";
const LAMP_POINT: &str = "float root = «sqrt(u.x)»;";
const TREE_DOWN: &str = "probability *= «left ? p : 1.0 - p»;\n        node = first;";
const TREE_UP: &str = "probability *= «!lit ? 0.0 : left ? p : 1.0 - p»;";
const TREE_BESIDE: &str = "chosen.choice.probability = «probability * lights.tree_probability»;";
const TREE_BESIDE_WEIGHT: &str =
    "float probability = «lights.tree_probability * probability_of(lights.root, leaf, x, through)»;";
const TREE_BESIDE_SKY: &str = "chosen.choice.probability *= «rest»;";
const FACET_WEIGHT: &str =
    "probability * «facet_pdf(facet(instance, hit.primitive, from), distance * distance, cosine)» : 0.0;";
const FACET_DENSITY: &str = "if (f.solid_angle > 0.0) return «1.0 / f.solid_angle»;";
const FACET_POINT: &str = "float half_angle = «0.5 * f.solid_angle * u.x»;";
const LAMBERTIAN: &str =
    "f += («beneath * diffuse_factor(s, l, split, wi, front) * cos_d» / PI) * l.diffuse;";
const LAMBERTIAN_DENSITY: &str = "pdf += «l.p_diffuse * cos_d / PI»;";
const LOBE: &str = "f += «beneath * lobe.x» * split.reflected;";
const COAT_DENSITY: &str = "pdf += «l.p_coat * lobe.y»;";
const VISIBLE_DENSITY: &str = "smith_lambda(wi, alpha)), «d / (1.0 + lambda_o)»);";
const VISIBLE_NORMAL: &str = "vec3 v = normalize(vec3(«alpha» * wo.xy, wo.z));";
const TRANSMITTED_DENSITY: &str =
    "pdf = l.p_interface * «(1.0 - reflect_probability(l, split, lobes))» * lobe.y;";

const FAULTS: &[Fault] = &[
    fault("emission times 1.02", SURFACE, EMISSION, "1.02 * material.emission"),
    fault(
        "the sky times 1.02",
        LIGHTS,
        SKY,
        "1.02 * Vec3Array(scene.environment)[uint(clamp(y, 0, size.y - 1) * size.x + x)].at",
    ),
    fault(
        "Lambertian times 1.02",
        BSDF,
        LAMBERTIAN,
        "1.02 * beneath * diffuse_factor(s, l, split, wi, front) * cos_d",
    ),
    fault("rough lobe times 1.02", BSDF, LOBE, "1.02 * beneath * lobe.x"),
    fault("Lambertian without cosine", BSDF, LAMBERTIAN, "beneath * diffuse_factor(s, l, split, wi, front)"),
    fault("probability of the sky forgotten", LIGHTS, SKY_SAMPLE, "environment_density(lights, cell)"),
    fault("the same in the weight alone", LIGHTS, SKY_DENSITY, "environment_density(lights, cell)"),
    fault("sky's density without solid angle", LIGHTS, TEXEL_DENSITY, "probability"),
    fault(
        "sky's density 0 where light arrives",
        LIGHTS,
        SKY_THERE,
        "lights.rows == 0UL || direction.x > 0.5",
    ),
    fault(
        "a part of the sky never sampled",
        LIGHTS,
        SKY_FOUND,
        "s.radiance_over_pdf != vec3(0.0) && s.direction.x < 0.7",
    ),
    fault("rows of the sky not uniform", LIGHTS, SKY_HEIGHT, "2.0 * sine * sine + v * v * height"),
    fault("lamp's density without distance²", SAMPLER, LAMP_SAMPLE, "1.0 / way.cosine"),
    fault("lamp's density without cosine", SAMPLER, LAMP_SAMPLE, "way.distance2"),
    fault("lamp's choice by the wrong power", SAMPLER, LAMP_POWER, "scene.inverse_power"),
    fault(
        "lamp's density in the weight without distance²",
        LIGHTS,
        LAMP_DENSITY,
        "cosine > 0.0 ? emitter_density(index, lights.inverse_power) / cosine : 0.0",
    ),
    fault(
        "lamp's density in the weight 0 off its normal",
        LIGHTS,
        LAMP_DENSITY,
        "cosine > 0.8 ? emitter_density(index, lights.inverse_power) * distance * distance / cosine : 0.0",
    ),
    fault("lamp's weight by area", LIGHTS, LAMP_WEIGHT, "pdf * way.cosine / way.distance2"),
    fault("points of a lamp not uniform", LIGHTS, LAMP_POINT, "u.x"),
    fault("probability of half of the lamps forgotten", SAMPLER, TREE_DOWN, "left ? p : 1.0"),
    fault("the same in the weight alone", SAMPLER, TREE_UP, "!lit ? 0.0 : left ? p : 1.0"),
    fault("probability of all lamps forgotten", SAMPLER, TREE_BESIDE, "probability"),
    fault(
        "the same in the weight alone",
        SAMPLER,
        TREE_BESIDE_WEIGHT,
        "probability_of(lights.root, leaf, x, through)",
    ),
    fault("probability of the sky beside lamps forgotten", SAMPLER, TREE_BESIDE_SKY, "1.0"),
    fault("solid angle times 1.1", SAMPLER, FACET_DENSITY, "1.0 / (1.1 * f.solid_angle)"),
    fault(
        "solid angle in the weight of another place",
        SAMPLER,
        FACET_WEIGHT,
        "facet_pdf(facet(instance, hit.primitive, from + vec3(0.0, 0.4, 0.0)), distance * distance, cosine)",
    ),
    fault("directions to a lamp not uniform", SAMPLER, FACET_POINT, "0.5 * f.solid_angle * u.x * u.x"),
    fault("probability of the diffuse lobe forgotten", BSDF, LAMBERTIAN_DENSITY, "cos_d / PI"),
    fault("density of the coat forgotten", BSDF, COAT_DENSITY, "0.0"),
    fault("all light beneath a coat", BSDF, LAMBERTIAN, "diffuse_factor(s, l, split, wi, front) * cos_d"),
    fault("density of visible normals unmasked", BSDF, VISIBLE_DENSITY, "d"),
    fault("normals of another roughness sampled", BSDF, VISIBLE_NORMAL, "1.5 * alpha"),
    fault("probability of transmission forgotten", BSDF, TRANSMITTED_DENSITY, "1.0"),
];

/// A file of `glsl/lib` with every fault of it where `planted` chooses.
fn planted(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl").join(name);
    let mut text = std::fs::read_to_string(path).unwrap();
    let places: BTreeSet<_> =
        FAULTS.iter().filter(|fault| fault.file == name).map(|fault| fault.place).collect();
    for place in places {
        let right = place.replace(['«', '»'], "");
        assert_eq!(text.matches(&right).count(), 1, "{name}: `{right}`");
        let (before, rest) = place.split_once('«').unwrap();
        let (expression, after) = rest.split_once('»').unwrap();
        let here = FAULTS.iter().enumerate().filter(|(_, fault)| fault.file == name && fault.place == place);
        let wrong: String =
            here.map(|(i, fault)| format!("planted({}u) ? ({}) : ", i + 1, fault.wrong)).collect();
        text = text.replace(&right, &format!("{before}({wrong}({expression})){after}"));
    }
    text
}

/// `text` with all that it includes of `glsl/lib`.
fn inline(text: &str, done: &mut BTreeSet<String>) -> String {
    let mut out = String::new();
    for line in text.lines() {
        let name = line.strip_prefix("#include \"").and_then(|rest| rest.strip_suffix('"'));
        match name.filter(|name| name.starts_with("lib/")) {
            Some(name) if done.insert(name.into()) => out += &inline(&planted(name), done),
            Some(_) => {}
            None => {
                out += line;
                out.push('\n');
            }
        }
    }
    out
}

// ---- what is lit, and by what ----

/// Receivers in a row on the plane y = 0; lamps over them.
struct Case {
    sky: Environment,
    lamps: Vec<[Vec3; 3]>,
    radiance: Vec<f32>,
}

fn receivers() -> Vec<Material> {
    let gray = Material::diffuse("gray", Vec3::splat(0.8));
    let metal = Material { name: "metal".into(), roughness: 0.7, ..Material::default() };
    let base_color = Vec3::new(0.6, 0.4, 0.2).extend(1.0);
    let plastic = Material { name: "plastic".into(), base_color, metallic: 0.0, ..metal.clone() };
    let coat =
        Clearcoat { factor: 1.0, roughness: 0.5, texture: None, roughness_texture: None, normal_map: None };
    let coated = Material { name: "coated".into(), clearcoat: Some(coat), ..plastic.clone() };
    let pane = Material { name: "pane".into(), transmission: 0.8, metallic: 0.0, ..metal.clone() };
    vec![gray, metal, plastic, coated, pane]
}

fn case() -> Case {
    // One bright corner on a dim slope.
    let texel = |i: u32| Vec3::splat(if i == 9 { 4.0 } else { 0.2 + 0.05 * i as f32 });
    let sky = Environment { name: "sky".into(), width: 8, height: 4, texels: (0..32).map(texel).collect() };
    let lamps = vec![
        [Vec3::new(-1.5, 1.4, -1.2), Vec3::X * 3.0, Vec3::Z * 1.6],
        [Vec3::new(-1.2, 0.5, 1.2), Vec3::X * 2.4, Vec3::new(0.0, 0.8, 0.4)],
    ];
    Case { sky, lamps, radiance: vec![2.0, 1.0] }
}

fn place(i: usize) -> Vec3 {
    Vec3::new(0.4 * (i as f32 - 2.0), 0.0, 0.0)
}

/// To the viewer: well above the plane, and low.
fn viewers() -> [Vec3; 2] {
    [Vec3::new(0.3, 0.9, -0.4), Vec3::new(-0.5, 0.45, 0.6)].map(Vec3::normalize)
}

fn scene(case: &Case) -> Scene {
    let mut materials = receivers();
    let mut meshes: Vec<_> = (0..materials.len())
        .map(|i| quad(place(i) - Vec3::new(0.1, 0.0, 0.1), Vec3::Z * 0.2, Vec3::X * 0.2, i as u32))
        .collect();
    for (lamp, radiance) in case.lamps.iter().zip(&case.radiance) {
        meshes.push(quad(lamp[0], lamp[1], lamp[2], materials.len() as u32));
        materials
            .push(Material { emission: Vec3::splat(*radiance), ..Material::diffuse("lamp", Vec3::ZERO) });
    }
    let instance = |mesh| Instance { name: String::new(), mesh, transform: Affine3A::IDENTITY, moves: false };
    let instances = (0..meshes.len() as u32).map(instance).collect();
    // A strong light that has no size is chosen by the one table, not by the other.
    let bulb = Light {
        name: "bulb".into(),
        kind: LightKind::Point,
        position: Vec3::new(0.0, 30.0, 0.0),
        direction: Vec3::NEG_Y,
        intensity: Vec3::splat(5.0),
    };
    let environment = Some(case.sky.clone());
    Scene {
        name: "row".into(),
        meshes: meshes.into_iter().map(Arc::new).collect(),
        instances,
        materials,
        lights: vec![bulb],
        environment: environment.map(Arc::new),
        ..Scene::default()
    }
}

/// Radiance that arrives at a receiver.
fn arriving(case: &Case, from: DVec3, direction: DVec3) -> f64 {
    let mut nearest = (f64::INFINITY, None);
    for (lamp, &radiance) in case.lamps.iter().zip(&case.radiance) {
        let [o, u, v] = lamp.map(|p| p.as_dvec3());
        let n = u.cross(v);
        let t = (o - from).dot(n) / direction.dot(n);
        let p = from + t * direction - o;
        let inside = |edge: DVec3, other: DVec3| {
            let across = n.cross(other);
            (0.0..=1.0).contains(&(p.dot(across) / edge.dot(across)))
        };
        if t > 0.0 && t < nearest.0 && inside(u, v) && inside(v, u) {
            // Diffuse surfaces emit on both sides.
            nearest = (t, Some(f64::from(radiance)));
        }
    }
    nearest.1.unwrap_or_else(|| f64::from(case.sky.radiance(direction.as_vec3()).x))
}

/// f·cosθ of all but the pane, as glTF 2.0 and KHR_materials_clearcoat publish it, of the colour that `value` weighs.
fn scattered(material: usize, wo: DVec3, wi: DVec3) -> Option<f64> {
    let h = (wo + wi).normalize();
    let schlick = |cosine: f64| 0.04 + 0.96 * (1.0 - cosine).powi(5);
    // GGX with Smith's height-correlated shadowing, all reflected.
    let lobe = |alpha: f64| {
        let alpha2 = alpha * alpha;
        let lambda = |w: DVec3| 0.5 * ((1.0 + alpha2 * (1.0 / (w.y * w.y) - 1.0)).sqrt() - 1.0);
        let d = alpha2 / (PI * (h.y * h.y * (alpha2 - 1.0) + 1.0).powi(2));
        d / (4.0 * wo.y * (1.0 + lambda(wo) + lambda(wi)))
    };
    let plastic = || {
        let fresnel = schlick(wo.dot(h));
        let color = 0.5 * 0.6 + 0.3 * 0.4 + 0.2 * 0.2;
        (1.0 - fresnel) * color / PI * wi.y + fresnel * lobe(0.49)
    };
    match material {
        0 => Some(0.8 / PI * wi.y),
        1 => Some(lobe(0.49)),
        2 => Some(plastic()),
        3 => Some((1.0 - schlick(wo.y)) * plastic() + schlick(wo.y) * lobe(0.25)),
        _ => None,
    }
}

/// Reflected radiance by the midpoint rule.
fn expected(case: &Case, material: usize, wo: Vec3) -> Option<f64> {
    const ROWS: u32 = 400;
    const COLUMNS: u32 = 1600;
    scattered(material, DVec3::Y, DVec3::Y)?;
    let mut sum = 0.0;
    for cell in 0..ROWS * COLUMNS {
        let (row, column) = (cell / COLUMNS, cell % COLUMNS);
        let y = (f64::from(row) + 0.5) / f64::from(ROWS);
        let azimuth = 2.0 * PI * (f64::from(column) + 0.5) / f64::from(COLUMNS);
        let r = (1.0 - y * y).sqrt();
        let wi = DVec3::new(r * azimuth.cos(), y, r * azimuth.sin());
        sum += scattered(material, wo.as_dvec3(), wi)? * arriving(case, place(material).as_dvec3(), wi);
    }
    Some(sum * 2.0 * PI / f64::from(ROWS * COLUMNS))
}

// ---- the test of light ----

/// A mean and its squared standard error.
#[derive(Clone, Copy)]
struct Estimate {
    mean: f64,
    variance: f64,
}

impl Estimate {
    fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0));
        Self { mean, variance }
    }

    /// Of a quadrature: what that and 32 bits leave.
    fn exact(mean: f64) -> Self {
        Self { mean, variance: (3e-4 * mean).powi(2) }
    }

    /// How far apart, as a standard normal variable if they are equal, and the standard error over the mean.
    fn apart(self, other: Self) -> (f64, f64) {
        let rounding = (1e-5 * other.mean).powi(2);
        let variance = self.variance + other.variance + rounding;
        let t = (self.mean - other.mean) / variance.sqrt();
        let n = f64::from(REPLICATES) - 1.0;
        let freedom = variance.powi(2) / ((self.variance.powi(2) + other.variance.powi(2)) / n + 1e-99);
        let freedom = freedom.clamp(n, 1e6);
        let z = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0) * (freedom * (t * t / freedom).ln_1p()).sqrt();
        (z, variance.sqrt() / other.mean)
    }
}

/// What a comparison came to.
struct Comparison {
    what: String,
    z: f64,
    error: f64,
}

/// The scene with what is known of it.
struct Lab {
    renderer: Renderer,
    kernel: RuntimeKernel,
    /// By viewer and material.
    expected: Vec<Option<f64>>,
}

impl Lab {
    fn new(device: &Device) -> Self {
        let options = RendererOptions {
            backend: BackendChoice::Force(Backend::Software),
            ..RendererOptions::default()
        };
        let case = case();
        let of = |wo| (0..receivers().len()).map(|m| expected(&case, m, wo)).collect::<Vec<_>>();
        let expected = viewers().map(of).concat();
        let renderer = Renderer::new(device, scene(&case), &options).unwrap();
        let source = inline(KERNEL, &mut BTreeSet::new());
        let kernel = RuntimeKernel::from_glsl(&renderer, "faults", &source).unwrap();
        Self { renderer, kernel, expected }
    }

    /// All comparisons with this fault planted, counted from 1; 0 for none.
    fn compare(&mut self, fault: u32, seed: u32, light_choice: LightChoice) -> Vec<Comparison> {
        let materials = receivers();
        let of_viewer = |wo: &Vec3| {
            (0..materials.len()).map(|m| wo.extend(2.0 * m as f32).to_array()).collect::<Vec<_>>()
        };
        let queries: Vec<[f32; 4]> = viewers().iter().flat_map(of_viewer).collect();
        let threads = queries.len() as u32 * REPLICATES;
        let mut g = Graph::new();
        let asked = g.buffer("queries", size_of_val(&queries[..]) as u64);
        g.upload("queries", asked, bytemuck::cast_slice(&queries).to_vec());
        let answers = g.buffer("answers", u64::from(threads) * 16);
        let params = [
            ("count", ParamValue::from(queries.len() as u32)),
            ("replicates", ParamValue::from(REPLICATES)),
            ("samples", ParamValue::from(SAMPLES)),
            ("seed", ParamValue::from(seed)),
            ("fault", ParamValue::from(fault)),
        ];
        let bind = [("queries", asked.into()), ("answers", answers.into())];
        g.pass_named("faults", &self.kernel, &bind, &params, Grid::Of([threads, 1, 1])).unwrap();
        let ticket = g.read_buffer::<[f32; 4]>(answers);
        let camera = Camera::look_at("unused", Vec3::Y, Vec3::ZERO, 1.0);
        let config = RenderConfig { light_choice, ..RenderConfig::default() };
        let answers = self.renderer.run(g, &config, &camera).unwrap().take(ticket);
        let mut comparisons = Vec::new();
        for (i, answers) in answers.chunks_exact(REPLICATES as usize).enumerate() {
            let of = |sampler: usize| answers.iter().map(|a| f64::from(a[sampler])).collect::<Vec<_>>();
            let estimates = [0, 1, 2, 3].map(|sampler| Estimate::of(&of(sampler)));
            let mut known: Vec<_> = SAMPLERS.into_iter().zip(estimates).collect();
            known.extend(self.expected[i].map(|mean| ("quadrature", Estimate::exact(mean))));
            let material = &materials[i % materials.len()].name;
            for (first, &(a, left)) in known.iter().enumerate() {
                for &(b, right) in &known[first + 1..] {
                    let (z, error) = left.apart(right);
                    comparisons.push(Comparison { what: format!("{material}: {a} against {b}"), z, error });
                }
            }
        }
        comparisons
    }
}

/// The z that chance exceeds once in 1e5 runs of so many comparisons, on either side: 2(1 − Φ(z)) = 1e-5/n, by bisection of
/// Mills' ratio's bound from above.
fn bound(n: usize) -> f64 {
    let p = 1e-5 / n as f64;
    let tail = |z: f64| 2.0 * (-0.5 * z * z).exp() / (z * (2.0 * PI).sqrt());
    let (mut low, mut high) = (1.0, 20.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if tail(middle) > p { low = middle } else { high = middle }
    }
    high
}

fn worst(comparisons: &[Comparison]) -> &Comparison {
    comparisons.iter().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap()
}

/// The sources hold with every seed, where light by both samplers would show 2 % at six standard errors; each fault is seen.
#[test]
fn light_holds_and_every_fault_is_seen() {
    let Some((_guard, device)) = common::device() else { return };
    let mut lab = Lab::new(&device);
    for (seed, choice) in (1..=4).flat_map(|seed| [(seed, LightChoice::Power), (seed, LightChoice::Tree)]) {
        let right = lab.compare(0, seed, choice);
        let (worst, bound) = (worst(&right), bound(right.len()));
        println!("as it is, {choice:?}, seed {seed}: {:.1} σ of {bound:.1} ({})", worst.z, worst.what);
        assert!(worst.z < bound, "{}: {:.2} σ", worst.what, worst.z);
        let sharp = right.iter().filter(|c| c.what.ends_with("both against quadrature"));
        assert!(sharp.clone().count() == 8 && sharp.clone().all(|c| 6.0 * c.error < 0.02));
    }
    let mut unseen = Vec::new();
    for (fault, number) in FAULTS.iter().zip(1..) {
        let by_tree = fault.file == SAMPLER && ![LAMP_POWER, LAMP_SAMPLE].contains(&fault.place);
        let choice = if by_tree { LightChoice::Tree } else { LightChoice::Power };
        let wrong = lab.compare(number, 1, choice);
        let (worst, bound) = (worst(&wrong), bound(wrong.len()));
        let seen = wrong.iter().filter(|c| c.z > bound).count();
        println!("{}: {:.1} σ ({}), {seen} of {} see it", fault.what, worst.z, worst.what, wrong.len());
        if worst.z < bound {
            unseen.push(fault.what);
        }
    }
    assert!(unseen.is_empty(), "{unseen:?}");
}
