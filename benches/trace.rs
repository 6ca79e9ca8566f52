//! Rays a second of both backends: `cargo bench --bench trace [-- SCENE...]`; the built-in rooms by default.
//!
//! Primary rays see the scene from its first camera, in 8×8 tiles; diffuse rays leave their hits in cosine
//! distribution; shadow rays join the hits of a tile with the same random surface points, as the gather of
//! virtual point lights does. Builds are timed with them.

use glam::{Vec3, vec3};
use parhelion::accel::{Arrangement, Geometry, Levels, Structure};
use parhelion::graph::{Executor, Graph, Grid, RunOptions};
use parhelion::scene::{self, LoadOptions, View};
use parhelion::shaders::test::trace::{Bind, Params, Spec};
use parhelion::shaders::{self, SceneData, SceneSpec, TestHit, TestRay};
use parhelion::vk::{Backend, Device, DeviceOptions};
use std::path::Path;
use std::sync::Arc;

const SIZE: [usize; 2] = [320, 240];
const TARGETS: usize = 16;
const REPEATS: usize = 3;

struct Bench<'a> {
    device: &'a Device,
    backend: Backend,
    structure: Structure,
    data: SceneData,
    spec: SceneSpec,
}

impl Bench<'_> {
    /// Hits, and millions of rays a second in the fastest of some repeats.
    fn trace(&self, rays: &[TestRay], any_hit: bool) -> anyhow::Result<(Vec<TestHit>, f64)> {
        let uniform = self.device.upload("scene", bytemuck::bytes_of(&self.data))?;
        let set = Arc::new(self.device.scene_set(self.backend, uniform, self.structure.top_level())?);
        let input = Arc::new(self.device.upload("rays", bytemuck::cast_slice(rays))?);
        let mut executor = Executor::new(self.device, self.backend)?;
        let kernel = shaders::test::trace::kernel(Spec { any_hit }, &self.spec);
        let count = rays.len() as u32;
        let mut fastest = f64::INFINITY;
        let mut found = Vec::new();
        for _ in 0..=REPEATS {
            let mut g = Graph::new();
            let rays = g.import_buffer("rays", &input);
            let hits = g.buffer("hits", u64::from(count) * size_of::<TestHit>() as u64);
            g.pass("trace", &kernel, Bind { rays, hits }, Params { count }, Grid::Of([count, 1, 1]));
            let ticket = g.read_buffer(hits);
            let mut run = executor.run(g, &RunOptions { scene: Some(&set), ..RunOptions::default() })?;
            let ms = run.passes.iter().find(|pass| pass.path == "trace").and_then(|pass| pass.ms);
            fastest = fastest.min(ms.ok_or_else(|| anyhow::anyhow!("the device has no timestamps"))?);
            found = run.take(ticket);
        }
        Ok((found, f64::from(count) / fastest / 1e3))
    }
}

/// PCG (O'Neill 2014).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let word = ((((old >> 18) ^ old) >> 27) as u32).rotate_right((old >> 59) as u32);
        (word >> 8) as f32 / (1 << 24) as f32
    }

    fn on_sphere(&mut self) -> Vec3 {
        let (z, phi) = (1.0 - 2.0 * self.unit(), std::f32::consts::TAU * self.unit());
        let r = (1.0 - z * z).max(0.0).sqrt();
        vec3(r * phi.cos(), r * phi.sin(), z)
    }
}

fn ray(origin: Vec3, direction: Vec3, t_max: f32) -> TestRay {
    TestRay { origin: origin.to_array(), t_min: 0.0, direction: direction.to_array(), t_max }
}

fn primary(scene: &scene::Scene) -> Vec<TestRay> {
    let camera = scene.cameras.first().cloned().unwrap_or_else(|| scene.frame_camera());
    let yfov = match camera.view {
        View::Perspective { yfov } => yfov,
        View::Orthographic { .. } => 1.0,
    };
    let (up, right) = ((0.5 * yfov).tan(), (0.5 * yfov).tan() * SIZE[0] as f32 / SIZE[1] as f32);
    let pixel = |x: usize, y: usize| {
        let [u, v] = [(x, SIZE[0]), (y, SIZE[1])].map(|(at, size)| (2 * at + 1) as f32 / size as f32 - 1.0);
        let direction = camera.transform.transform_vector3(vec3(u * right, -v * up, -1.0));
        ray(camera.transform.translation.into(), direction.normalize(), f32::INFINITY)
    };
    let tiles = (0..SIZE[1] / 8).flat_map(|y| (0..SIZE[0] / 8).map(move |x| (8 * x, 8 * y)));
    tiles.flat_map(|(x, y)| (0..64).map(move |i| (x + i % 8, y + i / 8))).map(|(x, y)| pixel(x, y)).collect()
}

/// Where rays leave the surfaces that were hit, and the normals there.
fn surfaces(geometry: &Geometry, rays: &[TestRay], hits: &[TestHit]) -> Vec<(Vec3, Vec3)> {
    let triangles: Vec<_> = geometry.world_triangles().collect();
    let offset = geometry.ray_epsilon();
    let point = |(ray, hit): (&TestRay, &TestHit)| {
        if hit.t == f32::INFINITY {
            return (Vec3::from(ray.origin), Vec3::Y);
        }
        let at = triangles.partition_point(|t| (t.instance, t.primitive) < (hit.instance, hit.primitive));
        let [a, b, c] = triangles[at].vertices;
        let normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
        let normal = if normal.dot(ray.direction.into()) > 0.0 { -normal } else { normal };
        let [v, w] = hit.barycentrics;
        (a + (v * (b - a) + w * (c - a)) + offset * normal, normal)
    };
    rays.iter().zip(hits).map(point).collect()
}

fn main() -> anyhow::Result<()> {
    let names: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let names = if names.is_empty() {
        ["builtin:office", "builtin:conference"].map(str::to_owned).to_vec()
    } else {
        names
    };
    let device = Device::open(&DeviceOptions::default())?;
    println!("{}, {}", device.info().name, device.info().driver());
    println!("| scene | triangles | structure | build ms | MB | primary Mray/s | diffuse | shadow |");
    println!("|---|---|---|---|---|---|---|---|");
    for name in names {
        let scene = scene::load(Path::new(&name), &LoadOptions::default())?;
        let geometry = Geometry::of(&scene)?;
        let ways = [
            (Backend::Software, Levels::One, "software"),
            (Backend::Software, Levels::Two, "two levels"),
            (Backend::RayQuery, Levels::One, "ray-query"),
        ];
        for (backend, levels, label) in ways {
            if backend == Backend::RayQuery && !device.info().ray_query {
                continue;
            }
            let arrangement = Arrangement { levels, ..Arrangement::default() };
            let structure = Structure::build(&device, backend, &geometry, arrangement)?;
            let mut data = SceneData { ray_epsilon: geometry.ray_epsilon(), ..SceneData::default() };
            structure.describe(&mut data);
            let spec = SceneSpec {
                alpha_mask: false,
                instanced: geometry.instances.len() > 1,
                stack_depth: structure.traversal().stack_depth,
                two_levels: structure.traversal().two_levels,
                ..SceneSpec::default()
            };
            let [ms, bytes] = structure
                .reports()
                .iter()
                .fold([0.0; 2], |[ms, bytes], report| [ms + report.build_ms, bytes + report.bytes as f64]);
            let bench = Bench { device: &device, backend, structure, data, spec };

            let mut random = Random(1);
            let rays = primary(&scene);
            let (hits, primary) = bench.trace(&rays, false)?;
            let seen = surfaces(&geometry, &rays, &hits);
            let rays: Vec<TestRay> = seen
                .iter()
                .map(|&(p, n)| ray(p, (n + random.on_sphere()).normalize_or(n), f32::INFINITY))
                .collect();
            let (hits, diffuse) = bench.trace(&rays, false)?;
            let lit = surfaces(&geometry, &rays, &hits);
            let targets: Vec<Vec3> =
                (0..TARGETS).map(|_| lit[(random.unit() * lit.len() as f32) as usize].0).collect();
            let joined = seen.chunks(64).flat_map(|tile| {
                targets
                    .iter()
                    .flat_map(move |&to| tile.iter().map(move |&(from, _)| ray(from, to - from, 1.0)))
            });
            let (_, shadow) = bench.trace(&joined.collect::<Vec<_>>(), true)?;
            println!(
                "| {name} | {} | {} | {ms:.0} | {:.1} | {primary:.2} | {diffuse:.2} | {shadow:.2} |",
                geometry.world_triangle_count(),
                label,
                bytes / 1e6,
            );
        }
    }
    Ok(())
}
