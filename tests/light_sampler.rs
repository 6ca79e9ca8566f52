//! Lights chosen by what a point can get of them: probabilities are what they say and nowhere 0 where light arrives, and
//! pictures are those of lights chosen by power.

mod common;

use common::{gray, quad};
use glam::{DVec3, Vec3};
use parhelion::config::{LightChoice, RenderConfig};
use parhelion::graph::{Graph, Grid, RuntimeKernel};
use parhelion::methods::{igi, path};
use parhelion::renderer::{Aov, BackendChoice, FrameRequest, Renderer, RendererOptions};
use parhelion::scene::{Camera, Environment, Light, LightKind, Material, Mesh, Scene};
use parhelion::shaders::{LightReceiver, ListedLight, SceneSpec, test::light_sampler};
use parhelion::vk::{Backend, Device};
use std::collections::BTreeMap;
use std::path::Path;

fn software(device: &Device, scene: Scene) -> Renderer {
    let options =
        RendererOptions { backend: BackendChoice::Force(Backend::Software), ..RendererOptions::default() };
    Renderer::new(device, scene, &options).unwrap()
}

/// The i-th of numbers in [0, 1) that look random.
fn random(i: u32) -> f32 {
    let mut x = i.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
    for _ in 0..3 {
        x = (x ^ (x >> 16)).wrapping_mul(0x45d9_f3b3);
    }
    (x >> 8) as f32 / 16_777_216.0
}

fn random_vector(i: u32) -> Vec3 {
    Vec3::new(random(3 * i), random(3 * i + 1), random(3 * i + 2)) * 2.0 - 1.0
}

fn lamp(double_sided: bool, radiance: f32) -> Material {
    Material { emission: Vec3::splat(radiance), double_sided, ..Material::diffuse("lamp", Vec3::ZERO) }
}

fn light(kind: LightKind, position: Vec3, direction: Vec3) -> Light {
    Light { name: String::new(), kind, position, direction, intensity: Vec3::ONE }
}

/// Triangles of their own, in one mesh; each of one of these materials.
fn soup(triangles: &[([Vec3; 3], u32)], materials: Vec<Material>, lights: Vec<Light>) -> Scene {
    let mesh = Mesh {
        positions: triangles.iter().flat_map(|(corners, _)| *corners).collect(),
        triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        materials: triangles.iter().map(|(_, material)| *material).collect(),
        ..Mesh::default()
    };
    Scene { lights, ..common::scene(vec![mesh], materials) }
}

/// One-sided and two-sided triangles of all sizes, thin ones, equal ones and parallel ones; points, some of them equal, and
/// spots.
fn mixture() -> Scene {
    let mut triangles: Vec<([Vec3; 3], u32)> = (0..24)
        .map(|i| {
            let (at, size) = (3.0 * random_vector(i), 0.02 + random(7000 + i).powi(3));
            (std::array::from_fn(|c| at + size * random_vector(100 + 3 * i + c as u32)), i % 2)
        })
        .collect();
    triangles.extend([triangles[0], triangles[0], triangles[1]]);
    let thin = [Vec3::new(-1.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.0, 1.0, 1e-6)];
    triangles.push((thin, 0));
    for i in 0..6 {
        let at = Vec3::new(i as f32 - 3.0, 2.0, 0.5);
        triangles.push(([at, at + Vec3::X * 0.5, at + Vec3::Z * 0.5], 0));
    }
    let mut lights: Vec<_> =
        (0..3).map(|i| light(LightKind::Point, 2.0 * random_vector(300 + i), Vec3::Y)).collect();
    lights.push(lights[0].clone());
    lights.extend((0..4).map(|i| {
        let outer = [0.01, 0.3, 1.0, 1.5][i as usize];
        let direction = random_vector(410 + i).normalize();
        light(LightKind::Spot { inner: 0.5 * outer, outer }, 2.0 * random_vector(400 + i), direction)
    }));
    soup(&triangles, vec![lamp(false, 1.0), lamp(true, 3.0)], lights)
}

/// Corners, places on their planes, and places around.
fn receivers(scene: &Scene) -> Vec<LightReceiver> {
    let around = (0..40).map(|i| 4.0 * random_vector(600 + i));
    let at_lights = scene.lights.iter().map(|light| light.position);
    let on_triangles = scene.meshes[0].triangles.iter().take(20).flat_map(|t| {
        let [a, b, c] = t.map(|v| scene.meshes[0].positions[v as usize]);
        [a, (a + b + c) / 3.0, a + 3.0 * (b - a), a + 1e-3 * (b - a).cross(c - a).normalize_or_zero()]
    });
    let positions: Vec<Vec3> = around.chain(at_lights).chain(on_triangles).collect();
    let receiver = |(i, position): (u32, Vec3)| LightReceiver {
        position: position.to_array(),
        through: u32::from(i % 4 == 0),
        normal: [random_vector(900 + i).normalize(), Vec3::Y, Vec3::NEG_Y][i as usize % 3].to_array(),
    };
    (0..).zip(positions).map(receiver).collect()
}

/// Choices at these receivers and all probabilities: `each` answers a receiver, by the kernel or by this one.
fn listed(
    renderer: &mut Renderer,
    other: Option<&RuntimeKernel>,
    receivers: &[LightReceiver],
    nodes: u32,
    each: u32,
) -> Vec<ListedLight> {
    let mut g = Graph::new();
    let places = g.buffer("receivers", size_of_val(receivers) as u64);
    g.upload("receivers", places, bytemuck::cast_slice(receivers).to_vec());
    let threads = receivers.len() as u32 * each;
    let answers = g.buffer("answers", u64::from(threads) * size_of::<ListedLight>() as u64);
    let count = receivers.len() as u32;
    let grid = Grid::Of([threads, 1, 1]);
    if let Some(kernel) = other {
        let params = [("count", count.into()), ("each", each.into()), ("nodes", nodes.into())];
        let bind = [("receivers", places.into()), ("answers", answers.into())];
        g.pass_named("choose", kernel, &bind, &params, grid).unwrap();
    } else {
        let bind = light_sampler::Bind { receivers: places, answers };
        let params = light_sampler::Params { count, each, nodes };
        g.pass("choose", &light_sampler::kernel(&SceneSpec::default()), bind, params, grid);
    }
    let ticket = g.read_buffer::<ListedLight>(answers);
    let camera = Camera::look_at("unused", Vec3::Y * 20.0, Vec3::ZERO, 1.0);
    renderer.run(g, &RenderConfig::default(), &camera).unwrap().take(ticket)
}

/// Nodes of trees over so many triangles and other lights.
fn node_count(triangles: usize, lights: usize) -> u32 {
    let below_root = |n: usize| 2 * n.max(1) - 2;
    (4 + below_root(triangles) + below_root(lights)) as u32
}

/// Whether a light gives a receiver anything, by points of it; well inside, where 32 bits do not decide.
fn contributes(scene: &Scene, index: usize, x: &LightReceiver) -> bool {
    let (position, normal) = (Vec3::from(x.position).as_dvec3(), Vec3::from(x.normal).as_dvec3());
    let meets = |to: DVec3| x.through != 0 || normal.dot(to.normalize_or_zero()) > 1e-5;
    if let Some(light) = scene.lights.get(index) {
        let to = light.position.as_dvec3() - position;
        let shines = match light.kind {
            LightKind::Spot { outer, .. } => {
                light.direction.as_dvec3().angle_between(-to) < f64::from(outer) - 1e-4
            }
            _ => true,
        };
        return to.length() > 1e-6 && shines && meets(to);
    }
    let triangle = index - scene.lights.len();
    let mesh = &scene.meshes[0];
    let [a, b, c] = mesh.triangles[triangle].map(|v| mesh.positions[v as usize].as_dvec3());
    let front = (b - a).cross(c - a).normalize_or_zero();
    let two_sided = scene.materials[mesh.materials[triangle] as usize].double_sided;
    (1..20).flat_map(|i| (1..20 - i).map(move |j| (i, j))).any(|(i, j)| {
        let to = a + (b - a) * (f64::from(i) / 20.0) + (c - a) * (f64::from(j) / 20.0) - position;
        let facing = -front.dot(to.normalize_or_zero());
        (if two_sided { facing.abs() } else { facing }) > 1e-5 && meets(to)
    })
}

/// At every receiver the probabilities add up to one or, where some bound is loose, less; choices come with the probability
/// that the light has and as often as it says; and every light that gives anything has one. What is wrong otherwise.
fn check(scene: &Scene, renderer: &mut Renderer, other: Option<&RuntimeKernel>) -> Result<(), String> {
    let (triangles, lights) = (scene.meshes[0].triangles.len(), scene.lights.len());
    let receivers = receivers(scene);
    let each = 4096;
    let answers = listed(renderer, other, &receivers, node_count(triangles, lights), each);
    let (mut lit, mut dark, mut full) = (0, 0, 0);
    let (mut chi2, mut freedom) = (0.0, 0.0);
    for (x, answers) in receivers.iter().zip(answers.chunks_exact(each as usize)) {
        let listed: BTreeMap<u32, f64> =
            answers.iter().filter(|a| a.light != u32::MAX).map(|a| (a.light, a.listed.into())).collect();
        assert_eq!(listed.len(), triangles + lights, "{x:?}");
        let sum: f64 = listed.values().sum();
        if sum > 1.0 + 1e-5 {
            return Err(format!("probabilities add up to {sum} at {x:?}"));
        }
        full += usize::from(sum > 1.0 - 1e-5);
        for (&light, &probability) in &listed {
            let gives = contributes(scene, light as usize, x);
            if gives && probability == 0.0 {
                return Err(format!("light {light} gives something and is never chosen at {x:?}"));
            }
            lit += usize::from(gives);
            dark += usize::from(probability == 0.0);
        }
        let mut times = BTreeMap::<u32, f64>::new();
        for answer in answers.iter().filter(|a| a.chosen != u32::MAX) {
            let known = listed[&answer.chosen];
            if (f64::from(answer.probability) / known - 1.0).abs() > 1e-4 {
                return Err(format!("{answer:?} has {known}"));
            }
            *times.entry(answer.chosen).or_default() += 1.0;
        }
        let each = f64::from(each);
        let of = |(light, p): (&u32, &f64)| (p * each, times.get(light).copied().unwrap_or_default());
        let mut cells: Vec<(f64, f64)> = listed.iter().map(of).collect();
        cells.push(((1.0 - sum) * each, each - times.values().sum::<f64>()));
        let large = cells.iter().filter(|(expected, _)| *expected > 10.0);
        chi2 += large.clone().map(|(expected, seen)| (seen - expected).powi(2) / expected).sum::<f64>();
        freedom += (large.count() as f64 - 1.0).max(0.0);
    }
    let z = (chi2 - freedom) / (2.0_f64 * freedom).sqrt();
    println!("{lit} give something, {dark} have no chance; {full} places lose none; χ² {z:+.1} σ");
    assert!(lit > 1000 && dark > 500 && full > 10);
    // χ² of many degrees of freedom is nearly normal; beyond 5 σ once in 2 million runs.
    if z.abs() < 5.0 { Ok(()) } else { Err(format!("χ² of {chi2} at {freedom} degrees of freedom")) }
}

#[test]
fn probabilities_are_what_they_say() {
    let Some((_guard, device)) = common::device() else { return };
    let scene = mixture();
    check(&scene, &mut software(&device, scene.clone()), None).unwrap();
}

/// The same fails for faults.
#[cfg(feature = "compile")]
#[test]
fn wrong_probabilities_are_seen() {
    let Some((_guard, device)) = common::device() else { return };
    let scene = mixture();
    let mut renderer = software(&device, scene.clone());
    let read = |name: &str| {
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl").join(name)).unwrap()
    };
    let (kernel, sampler) = (read("test/light_sampler.comp"), read("lib/light_sampler.glsl"));
    for (right, wrong) in [
        ("probability *= left ? p : 1.0 - p;", "probability *= p;"),
        ("bool left = u < p;", "bool left = u < p * p;"),
        ("cos_beyond(side, cos_size) < -1e-4", "side < -1e-4"),
        ("facing = cos_beyond(cos_beyond(facing, node.cos_spread), cos_size);", ""),
        ("dot(to, node.axis) >= slack", "dot(to, node.axis) <= slack"),
    ] {
        assert_eq!(sampler.matches(right).count(), 1, "{right}");
        let source = kernel.replace("#include \"lib/light_sampler.glsl\"", &sampler.replace(right, wrong));
        let other = RuntimeKernel::from_glsl(&renderer, "fault", &source).unwrap();
        println!("{wrong}: {}", check(&scene, &mut renderer, Some(&other)).unwrap_err());
    }
}

/// A light behind the receiver or that faces away has no chance, one alone has all of it; equal ones share.
#[test]
fn few_lights_have_their_shares() {
    let Some((_guard, device)) = common::device() else { return };
    let up = |y: f32| LightReceiver { position: [0.1, y, 0.2], through: 0, normal: Vec3::Y.to_array() };
    let ceiling = |material| ([Vec3::Y * 2.0, Vec3::Y * 2.0 + Vec3::X, Vec3::Y * 2.0 + Vec3::Z], material);
    let chances = |triangles: &[([Vec3; 3], u32)], x| {
        let scene = soup(triangles, vec![lamp(false, 2.0), gray(0.5), lamp(true, 1.0)], Vec::new());
        let count = triangles.iter().filter(|(_, material)| *material != 1).count();
        let answers = listed(&mut software(&device, scene), None, &[x], node_count(count, 0), 64);
        let listed = answers.iter().filter(|a| a.light != u32::MAX);
        listed.map(|a| (a.light, a.listed)).collect::<BTreeMap<_, _>>()
    };
    assert_eq!(chances(&[ceiling(0)], up(0.0)), BTreeMap::from([(0, 1.0)]));
    assert_eq!(chances(&[ceiling(0)], up(3.0)), BTreeMap::from([(0, 0.0)]));
    // All black but one.
    assert_eq!(chances(&[ceiling(1), ceiling(1), ceiling(0)], up(0.0)), BTreeMap::from([(0, 1.0)]));
    let away = ([Vec3::Y * 2.0, Vec3::Y * 2.0 + Vec3::Z, Vec3::Y * 2.0 + Vec3::X], 0);
    let of_two = chances(&[ceiling(0), away], up(0.0));
    assert_eq!(of_two, BTreeMap::from([(0, 1.0), (1, 0.0)]));
    let shares = chances(&[ceiling(0), ceiling(0), ceiling(2), ceiling(2)], up(0.0));
    for (light, share) in [(0, 2.0), (1, 2.0), (2, 1.0), (3, 1.0)] {
        assert!((shares[&light] - share / 6.0).abs() < 1e-5, "{shares:?}");
    }
}

/// Both ways of choosing have one mean, by paths and by direct light, with lamps, a sky, a sun, spots and more lights than
/// are asked one by one; and of lamps the tree's is the quieter one.
#[test]
fn pictures_are_those_of_lights_chosen_by_power() {
    let Some((_guard, device)) = common::device() else { return };
    let mut scene = mixture();
    scene.materials.push(gray(0.7));
    scene.materials.push(Material { roughness: 0.5, metallic: 0.0, ..gray(0.4) });
    for (y, material) in [(-3.0, 2), (3.5, 3)] {
        scene.meshes.push(quad(Vec3::new(-4.0, y, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0, material).into());
    }
    let with = |lights: usize, sky: bool| {
        let mut scene = Scene {
            meshes: scene.meshes.clone(),
            lights: scene.lights[..lights.min(8)].to_vec(),
            ..common::scene(scene.meshes.clone(), scene.materials.clone())
        };
        scene
            .lights
            .extend((8..lights as u32).map(|i| light(LightKind::Point, 3.0 * random_vector(i), Vec3::Y)));
        if sky {
            scene.environment = Some(Environment::constant(Vec3::splat(0.2)).into());
            scene.lights.push(Light {
                intensity: Vec3::splat(0.5),
                ..light(LightKind::Directional, Vec3::ZERO, Vec3::new(0.3, -0.8, 0.5).normalize())
            });
        }
        scene
    };
    for (lights, sky) in [(0, false), (3, true), (40, true)] {
        let mut renderer = software(&device, with(lights, sky));
        for method in [&path::METHOD, &igi::METHOD] {
            let camera = Camera::look_at("", Vec3::new(3.0, 1.0, 6.0), Vec3::ZERO, 1.0);
            let mut config = RenderConfig { method, size: [24, 24], ..common::plain() };
            config.path_trace.max_depth = Some(3);
            config.path_trace.spp = 16;
            config.vpl_shoot.vpls = 1;
            config.vpl_shoot.bounces = Some(1);
            let aovs: &[Aov] = if *method == path::METHOD { &[] } else { &[Aov::Direct] };
            let mut seen = [LightChoice::Tree, LightChoice::Power].map(|light_choice| {
                let blocks: Vec<Vec<f64>> = (1..=8)
                    .map(|seed| {
                        let config = RenderConfig { light_choice, seed, ..config.clone() };
                        let frame = renderer
                            .render(&config, &camera, &FrameRequest { aovs, ..FrameRequest::default() })
                            .unwrap();
                        let data = if aovs.is_empty() { &frame.beauty.data } else { &frame.aovs[0].1.data };
                        // Means of 6 × 6 pixels.
                        (0..16)
                            .map(|block| {
                                let pixels =
                                    (0..36).map(|i| (6 * (block / 4) + i / 6) * 24 + 6 * (block % 4) + i % 6);
                                pixels.map(|p| f64::from(data[3 * p])).sum::<f64>() / 36.0
                            })
                            .collect()
                    })
                    .collect();
                blocks
            });
            let [tree, power] = &mut seen;
            let mut squares = [0.0; 2];
            let mut worst: f64 = 0.0;
            for block in 0..16 {
                let of = |runs: &[Vec<f64>]| {
                    let mean = runs.iter().map(|run| run[block]).sum::<f64>() / 8.0;
                    (mean, runs.iter().map(|run| (run[block] - mean).powi(2)).sum::<f64>() / 56.0)
                };
                let ((a, va), (b, vb)) = (of(tree), of(power));
                if b > 0.0 {
                    squares = [squares[0] + va / (b * b), squares[1] + vb / (b * b)];
                }
                worst = worst.max((a - b).abs() / (va + vb + (1e-4 * b).powi(2) + 1e-20).sqrt());
            }
            println!("{}, {lights} lights, sky {sky}: {worst:.1} σ; variances {squares:?}", method.name);
            // Student's t of about 14 degrees of freedom: once in 1e5 runs of these 96 blocks.
            assert!(worst < 8.0, "{}, {lights} lights: {worst:.1} σ", method.name);
            // Of lamps alone; what a sky leaves to choose is little.
            let lamps_alone = *method == igi::METHOD && lights == 0;
            assert!(!lamps_alone || squares[0] < 0.5 * squares[1], "{squares:?}");
        }
    }
}
