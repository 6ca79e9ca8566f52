//! Both trace backends against brute force in 64 bits, ray by ray.
//!
//! A reported hit is right if the ray meets that triangle, or passes it closer than the arithmetic of 32 bits
//! can tell, at that distance, and no triangle that the ray meets beyond doubt is nearer. "Closer than can be
//! told" is [`ULPS`] units in the last place of the largest coordinate in play; along the ray it grows by
//! 1/cosine.

mod common;

use glam::{Affine3A, DVec3, Quat, Vec3, vec3};
use parhelion::accel::cpu::{BruteForce, Crossing, Ray};
use parhelion::accel::levels::{Meshes, worthwhile};
use parhelion::accel::software::{MAX_STACK_DEPTH, SoftwareBvh};
use parhelion::accel::{Arrangement, Error, Geometry, Levels, Structure};
use parhelion::graph::{Executor, Graph, Grid, RunOptions};
use parhelion::scene::{AlphaMode, Instance, Material, Mesh, Scene, builtin};
use parhelion::shaders::test::trace::{Bind, Params, Spec};
use parhelion::shaders::{self, SceneData, SceneSpec, TestHit as Hit, TestRay};
use parhelion::vk::{Backend, Device};
use std::ops::Range;
use std::sync::Arc;

const ULPS: f64 = 8.0;
const RAYS: usize = 100_000;

/// `test/trace.comp` writes an infinite distance otherwise.
fn found(hit: &Hit) -> bool {
    hit.t != f32::INFINITY
}

/// What rays are traced in.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    OneLevel,
    TwoLevels,
    /// Two for what moves.
    Moving,
    RayQuery,
}

impl Way {
    fn backend(self) -> Backend {
        if self == Self::RayQuery { Backend::RayQuery } else { Backend::Software }
    }
}

/// A scene on the device in one structure.
struct Traced<'a> {
    device: &'a Device,
    backend: Backend,
    structure: Structure,
    geometry: &'a Geometry,
}

impl<'a> Traced<'a> {
    fn new(device: &'a Device, way: Way, geometry: &'a Geometry) -> Self {
        let levels = match way {
            Way::TwoLevels => Levels::Two,
            Way::Moving => Levels::AsNeeded,
            Way::OneLevel | Way::RayQuery => Levels::One,
        };
        let backend = way.backend();
        let arrangement = Arrangement { levels, ..Arrangement::default() };
        let structure = Structure::build(device, backend, geometry, arrangement).unwrap();
        Self { device, backend, structure, geometry }
    }

    fn trace(&self, rays: &[Ray], any_hit: bool) -> Vec<Hit> {
        let mut data = SceneData { ray_epsilon: self.geometry.ray_epsilon(), ..SceneData::default() };
        self.structure.describe(&mut data);
        let spec = SceneSpec {
            alpha_mask: self.geometry.source.iter().any(|s| s.blocks.masked),
            instanced: self.geometry.instances.len() > 1,
            stack_depth: self.structure.traversal().stack_depth,
            two_levels: self.structure.traversal().two_levels,
            ..SceneSpec::default()
        };
        let rays: Vec<TestRay> = rays
            .iter()
            .map(|ray| TestRay {
                origin: ray.origin.to_array(),
                t_min: ray.t_min,
                direction: ray.direction.to_array(),
                t_max: ray.t_max,
            })
            .collect();
        let uniform = self.device.upload("scene", bytemuck::bytes_of(&data)).unwrap();
        let set = Arc::new(self.device.scene_set(self.backend, uniform, self.structure.top_level()).unwrap());
        let kernel = shaders::test::trace::kernel(Spec { any_hit }, &spec);

        let mut g = Graph::new();
        let input = g.buffer("rays", size_of_val(rays.as_slice()) as u64);
        g.upload("upload", input, bytemuck::cast_slice(&rays).to_vec());
        let hits = g.buffer("hits", (rays.len() * size_of::<Hit>()) as u64);
        let count = rays.len() as u32;
        g.pass("trace", &kernel, Bind { rays: input, hits }, Params { count }, Grid::Of([count, 1, 1]));
        let ticket = g.read_buffer(hits);
        let mut executor = Executor::new(self.device, self.backend).unwrap();
        let options = RunOptions { scene: Some(&set), ..RunOptions::default() };
        executor.run(g, &options).unwrap().take(ticket)
    }

    fn closest(&self, rays: &[Ray]) -> Vec<Hit> {
        self.trace(rays, false)
    }

    fn any(&self, rays: &[Ray]) -> Vec<bool> {
        self.trace(rays, true).iter().map(found).collect()
    }
}

/// Every structure the device has.
fn with_structures(test: impl Fn(&Device, Way)) {
    if let Some((_guard, device)) = common::device() {
        test(&device, Way::OneLevel);
        test(&device, Way::TwoLevels);
    }
    if let Some((_guard, device)) = common::ray_query_device() {
        test(&device, Way::RayQuery);
    }
}

/// PCG (O'Neill 2014): the same rays on every machine.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let word = (((old >> 18) ^ old) >> 27) as u32;
        word.rotate_right((old >> 59) as u32)
    }

    fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / (1 << 24) as f32
    }

    fn index(&mut self, range: Range<usize>) -> usize {
        range.start + self.bits() as usize % (range.end - range.start)
    }

    /// In the cube from −1 to 1.
    fn cube(&mut self) -> Vec3 {
        vec3(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.cube();
            if (1e-3..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Mesh {
    Mesh { materials: vec![0; triangles.len()], positions, triangles, ..Mesh::default() }
}

fn soup(triangles: impl IntoIterator<Item = [Vec3; 3]>) -> Mesh {
    let positions: Vec<Vec3> = triangles.into_iter().flatten().collect();
    let triangles = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    mesh(positions, triangles)
}

fn placed(mesh: u32, transform: Affine3A) -> Instance {
    Instance { name: String::new(), mesh, transform, moves: false }
}

fn scene(meshes: Vec<Mesh>, instances: Vec<Instance>) -> Scene {
    let masked = Material { alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, ..Material::default() };
    let meshes = meshes.into_iter().map(Arc::new).collect();
    Scene { meshes, instances, materials: vec![Material::default(), masked], ..Scene::default() }
}

fn single(mesh: Mesh) -> Geometry {
    Geometry::of(&scene(vec![mesh], vec![placed(0, Affine3A::IDENTITY)])).unwrap()
}

/// A closed surface about the origin: a sphere of radius 1 whose vertices are moved by up to `bump`.
fn closed(rings: u32, segments: u32, bump: f32) -> Mesh {
    let mut random = Random(7);
    let mut at = |direction: Vec3| direction * (1.0 + bump * (random.unit() * 2.0 - 1.0));
    let mut positions = vec![at(Vec3::Y)];
    for ring in 1..rings {
        for segment in 0..segments {
            let (sin, cos) = (std::f32::consts::PI * ring as f32 / rings as f32).sin_cos();
            let (z, x) = (std::f32::consts::TAU * segment as f32 / segments as f32).sin_cos();
            positions.push(at(vec3(x * sin, cos, z * sin)));
        }
    }
    positions.push(at(-Vec3::Y));
    let south = positions.len() as u32 - 1;
    let vertex = |ring: u32, segment: u32| match ring {
        0 => 0,
        _ if ring == rings => south,
        _ => 1 + (ring - 1) * segments + segment % segments,
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for segment in 0..segments {
            let [a, b] = [vertex(ring, segment), vertex(ring, segment + 1)];
            let [c, d] = [vertex(ring + 1, segment), vertex(ring + 1, segment + 1)];
            if ring > 0 {
                triangles.push([a, b, d]);
            }
            if ring + 1 < rings {
                triangles.push([a, d, c]);
            }
        }
    }
    mesh(positions, triangles)
}

fn scattered(count: usize) -> Mesh {
    let mut random = Random(1);
    soup((0..count).map(|_| {
        let centre = random.cube();
        let size = 0.5 * random.unit().powi(3);
        [0; 3].map(|_| centre + size * random.cube())
    }))
}

/// Needles that share a centre, each around the one before.
fn nested_slivers(count: usize) -> Mesh {
    soup((1..=count).map(|i| {
        let reach = i as f32 / count as f32;
        [vec3(-reach, -1e-4 * reach, 0.0), vec3(reach, 0.0, 1e-4 * reach), vec3(reach, 1e-4 * reach, 0.0)]
    }))
}

fn moved(mut mesh: Mesh, scale: f32, offset: Vec3) -> Mesh {
    mesh.positions.iter_mut().for_each(|p| *p = *p * scale + offset);
    mesh
}

/// Rays of all kinds: at random points, vertices and edges from near and far, along axes, bounded and not.
fn rays(geometry: &Geometry, count: usize) -> Vec<Ray> {
    let triangles: Vec<_> = geometry.world_triangles().map(|triangle| triangle.vertices).collect();
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &vertex in triangles.iter().flatten() {
        (low, high) = (low.min(vertex), high.max(vertex));
    }
    if triangles.is_empty() {
        (low, high) = (Vec3::NEG_ONE, Vec3::ONE);
    }
    let (centre, half) = ((low + high) * 0.5, (high - low) * 0.5);
    let mut random = Random(42);
    (0..count)
        .map(|_| {
            let reach = if random.unit() < 0.2 { 10.0 } else { 1.2 };
            let mut origin = centre + random.cube() * half.max_element() * reach;
            let target = if triangles.is_empty() {
                random.cube()
            } else {
                let [a, b, c] = triangles[random.index(0..triangles.len())];
                match random.index(0..4) {
                    0 => a,
                    1 => a + (b - a) * random.unit(),
                    2 => a + (b - a) * random.unit() + (c - a) * random.unit(),
                    _ => centre + random.cube() * half,
                }
            };
            let mut direction = target - origin;
            match random.index(0..4) {
                0 => direction = direction.normalize_or(Vec3::X),
                1 if random.unit() < 0.5 => {
                    let axis = random.index(0..3);
                    direction = Vec3::AXES[axis] * (target - origin)[axis].signum();
                    origin = target - direction * half.max_element() * 3.0 * random.unit();
                }
                _ => {}
            }
            let bounded = random.unit() < 0.3;
            let (t_min, t_max) =
                if bounded { (0.5 * random.unit(), 0.5 + random.unit()) } else { (0.0, f32::INFINITY) };
            Ray { origin, direction, t_min, t_max }
        })
        .collect()
}

/// Brute force that knows how well 32 bits can tell.
struct Oracle {
    brute: BruteForce,
    largest: f64,
}

impl Oracle {
    fn new(geometry: &Geometry) -> Self {
        Self { brute: BruteForce::new(geometry), largest: f64::from(geometry.largest_coordinate()) }
    }

    fn lateral(&self, ray: &Ray) -> f64 {
        ULPS * f64::from(f32::EPSILON) * self.largest.max(f64::from(ray.origin.abs().max_element()))
    }

    /// How far (m) a hit's place in the triangle's plane can be off: more where the triangle as the ray sees it
    /// is a sliver.
    fn in_plane(&self, ray: &Ray, crossing: &Crossing) -> f64 {
        let triangle = self.brute.triangle(crossing.hit.instance, crossing.hit.primitive).unwrap();
        let [a, b, c] = triangle.vertices.map(Vec3::as_dvec3);
        let longest = [b - a, c - b, a - c].map(DVec3::length_squared).into_iter().fold(0.0, f64::max);
        self.lateral(ray) * longest / (b - a).cross(c - a).length() / crossing.cosine
    }

    /// How far `t` of a crossing can be off.
    fn along(&self, ray: &Ray, crossing: &Crossing) -> f64 {
        self.in_plane(ray, crossing) / ray.direction.as_dvec3().length()
    }

    /// The nearest distance beyond which an answer must not lie; infinite if a miss is right.
    fn latest(&self, ray: &Ray) -> f64 {
        self.brute
            .crossings(ray)
            .filter(|c| c.inside > self.lateral(ray) / c.cosine)
            .map(|c| (c.hit.t, self.along(ray, &c)))
            .filter(|(t, off)| t - off > f64::from(ray.t_min) && t + off < f64::from(ray.t_max))
            .map(|(t, off)| t + off)
            .fold(f64::INFINITY, f64::min)
    }

    /// Whether the ray may be said to meet something.
    fn possible(&self, ray: &Ray) -> bool {
        self.brute.crossings(ray).any(|c| {
            let off = self.along(ray, &c);
            c.inside >= -self.lateral(ray) / c.cosine
                && c.hit.t + off > f64::from(ray.t_min)
                && c.hit.t - off < f64::from(ray.t_max)
        })
    }

    fn check(&self, ray: &Ray, hit: &Hit) -> Result<(), String> {
        let latest = self.latest(ray);
        if !found(hit) {
            return if latest == f64::INFINITY {
                Ok(())
            } else {
                Err(format!("missed what is before {latest}"))
            };
        }
        let t = f64::from(hit.t);
        if !(hit.t > ray.t_min && hit.t < ray.t_max) {
            return Err("outside the ray's interval".into());
        }
        let id = (hit.instance, hit.primitive);
        let crossing = self.brute.crossings(ray).find(|c| (c.hit.instance, c.hit.primitive) == id);
        let Some(crossing) = crossing else {
            return Err(format!("not a triangle the ray can cross: {hit:?}"));
        };
        let off = self.along(ray, &crossing);
        if crossing.inside < -self.lateral(ray) / crossing.cosine {
            return Err(format!("{} m beside its triangle", -crossing.inside));
        }
        if (crossing.hit.t - t).abs() > off {
            return Err(format!("t should be {} ± {off}", crossing.hit.t));
        }
        if t - off > latest {
            return Err(format!("something is before {latest}"));
        }
        let lateral = self.beside(ray, hit);
        if lateral > self.in_plane(ray, &crossing) {
            return Err(format!("barycentrics lie {lateral} m beside the ray"));
        }
        Ok(())
    }

    /// Distance (m) of the point that the barycentrics name from the ray's line.
    fn beside(&self, ray: &Ray, hit: &Hit) -> f64 {
        let [a, b, c] =
            self.brute.triangle(hit.instance, hit.primitive).unwrap().vertices.map(Vec3::as_dvec3);
        let [v, w] = hit.barycentrics.map(f64::from);
        let point: DVec3 = a * (1.0 - v - w) + b * v + c * w - ray.origin.as_dvec3();
        let direction = ray.direction.as_dvec3().normalize();
        (point - direction * point.dot(direction)).length()
    }
}

/// Runs `check` over all rays on every core and fails with the first complaints.
fn check_all<T: Sync>(rays: &[Ray], answers: &[T], check: impl Fn(&Ray, &T) -> Result<(), String> + Sync) {
    assert_eq!(rays.len(), answers.len());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let chunk = rays.len().div_ceil(threads).max(1);
    let complaints: Vec<String> = std::thread::scope(|scope| {
        let check = &check;
        let work = rays.chunks(chunk).zip(answers.chunks(chunk)).map(|(rays, answers)| {
            scope.spawn(move || {
                let pairs = rays.iter().zip(answers);
                pairs
                    .filter_map(|(ray, answer)| check(ray, answer).err().map(|e| format!("{ray:?}: {e}")))
                    .collect()
            })
        });
        let work: Vec<std::thread::ScopedJoinHandle<'_, Vec<String>>> = work.collect();
        work.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    let count = complaints.len();
    assert!(count == 0, "{count} of {} rays:\n{}", rays.len(), complaints[..count.min(8)].join("\n"));
}

fn agrees_with_brute_force(geometry: &Geometry, count: usize) {
    let rays = rays(geometry, count);
    let oracle = Oracle::new(geometry);
    with_structures(|device, way| {
        eprintln!("{way:?}");
        let traced = Traced::new(device, way, geometry);
        check_all(&rays, &traced.closest(&rays), |ray, hit| oracle.check(ray, hit));
        check_all(&rays, &traced.any(&rays), |ray, &blocked| {
            if blocked && !oracle.possible(ray) {
                return Err("blocked by nothing".into());
            }
            if !blocked && oracle.latest(ray) != f64::INFINITY {
                return Err("not blocked".into());
            }
            Ok(())
        });
    });
}

#[test]
fn scattered_triangles() {
    agrees_with_brute_force(&single(scattered(500)), RAYS);
}

#[test]
fn a_closed_bumpy_mesh() {
    agrees_with_brute_force(&single(closed(12, 20, 0.2)), RAYS);
}

#[test]
fn slivers() {
    agrees_with_brute_force(&single(nested_slivers(300)), RAYS);
}

#[test]
fn one_triangle() {
    agrees_with_brute_force(&single(soup([[Vec3::X, Vec3::Y, Vec3::Z]])), RAYS);
}

#[test]
fn an_empty_scene_is_never_hit() {
    for geometry in [Geometry::of(&Scene::default()).unwrap(), single(Mesh::default())] {
        agrees_with_brute_force(&geometry, 1000);
    }
}

#[test]
fn triangles_without_area_are_left_out() {
    let point = [Vec3::X; 3];
    let line = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
    let geometry = single(soup([point, line, [Vec3::X, Vec3::Y, Vec3::Z], line, point]));
    assert_eq!(geometry.triangles.len(), 1);
    assert_eq!(geometry.source[0].triangle, 2);
    agrees_with_brute_force(&geometry, 10_000);
}

#[test]
fn every_scale_and_far_from_the_origin() {
    for (scale, offset) in [(1e-3, 0.0), (1e4, 0.0), (10.0, 1e5), (1e-3, 1.0)] {
        let mut mesh = scattered(100);
        let bumpy = closed(8, 12, 0.2);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(&bumpy.positions);
        mesh.triangles.extend(bumpy.triangles.iter().map(|t| t.map(|v| v + first)));
        mesh.materials = vec![0; mesh.triangles.len()];
        agrees_with_brute_force(&single(moved(mesh, scale, Vec3::splat(offset))), RAYS / 4);
    }
}

#[test]
fn instances_carry_the_same_ids() {
    let turned = Affine3A::from_scale_rotation_translation(
        vec3(-0.5, 0.7, 0.3),
        Quat::from_rotation_y(1.0),
        vec3(0.2, 1.5, -0.3),
    );
    let instances = vec![
        placed(1, Affine3A::from_translation(vec3(1.5, 0.0, 0.0))),
        placed(0, turned),
        placed(1, turned),
        placed(2, Affine3A::from_translation(vec3(-1.5, 0.0, 0.0))),
    ];
    let scene = scene(vec![scattered(100), closed(5, 8, 0.1), closed(4, 6, 0.3)], instances);
    let geometry = Geometry::of(&scene).unwrap();
    assert_eq!(geometry.instances.len(), 3, "the merged mesh and two placements");
    assert_eq!(geometry.meshes.len(), 2);
    agrees_with_brute_force(&geometry, RAYS);
}

/// Placements of every kind, each mesh several times: turned, mirrored, sheared, stretched, tiny, far from their own origin,
/// in the same place as another; with `odd` also such as have no inverse, and one mesh with holes.
fn placements(odd: bool) -> Geometry {
    let turned = |angle: f32, at: Vec3| Affine3A::from_rotation_translation(Quat::from_rotation_y(angle), at);
    let sheared = Affine3A::from_cols(
        vec3(1.0, 0.2, 0.0).into(),
        vec3(0.7, 1.0, -0.3).into(),
        vec3(0.0, 0.9, 0.4).into(),
        vec3(-2.0, 0.5, 1.0).into(),
    );
    let far = Vec3::splat(1e4);
    let transforms = [
        Affine3A::IDENTITY,
        turned(0.7, vec3(2.0, 0.0, -1.0)),
        turned(0.7, vec3(2.0, 0.0, -1.0)),
        Affine3A::from_scale(vec3(-1.0, 1.0, 1.0)),
        sheared,
        Affine3A::from_scale_rotation_translation(vec3(3.0, 1e-3, 0.5), Quat::from_rotation_z(1.0), Vec3::Y),
        Affine3A::from_scale(Vec3::splat(1e-4)),
        Affine3A::from_translation(vec3(0.0, 0.0, 4.0)),
    ];
    let flat = [vec3(1.0, 0.0, 1.0), vec3(1.0, 1e-20, 1.0), Vec3::ZERO].map(Affine3A::from_scale);
    let transforms = transforms.iter().chain(flat.iter().filter(|_| odd));
    let holes = Mesh { materials: vec![odd.into(); 440], ..closed(12, 20, 0.2) };
    let meshes =
        vec![closed(5, 8, 0.1), scattered(40), moved(closed(6, 9, 0.1), 1.0, far), holes, scattered(20)];
    let mut instances = vec![placed(4, turned(-1.0, Vec3::X))];
    for (i, &transform) in transforms.enumerate() {
        for mesh in 0..4 {
            let home = if mesh == 2 { Affine3A::from_translation(-far) } else { Affine3A::IDENTITY };
            // Each mesh in places of its own, but for the first three.
            let apart = if i < 3 { Vec3::ZERO } else { Vec3::X * (mesh as f32 - 1.5) };
            instances.push(placed(mesh, Affine3A::from_translation(apart) * transform * home));
        }
    }
    Geometry::of(&scene(meshes, instances)).unwrap()
}

#[test]
fn placements_of_every_kind() {
    agrees_with_brute_force(&placements(false), RAYS / 4);
}

/// In the world triangles are the same, so what is met is, too, to the last bit; but where 32 bits make a line of a triangle
/// there, which one level leaves out.
#[test]
fn two_levels_are_one() {
    let Some((_guard, device)) = common::device() else { return };
    let same = |geometry: &Geometry, count| {
        let [one, two] = [Way::OneLevel, Way::TwoLevels].map(|way| Traced::new(&device, way, geometry));
        assert_same(&one, &two, count);
    };
    same(&placements(false), RAYS);
    same(&placements(true), RAYS / 2);
    for (scale, offset) in [(1e-3, 0.0), (1e4, 0.0), (10.0, 1e5)] {
        let mesh = moved(scattered(100), scale, Vec3::splat(offset));
        let turn = |i: u8| {
            let axis = Vec3::new(1.0, f32::from(i), 2.0).normalize();
            let there = Affine3A::from_translation(Vec3::splat(offset));
            there * Affine3A::from_axis_angle(axis, f32::from(i)) * there.inverse()
        };
        let instances = (0..9).map(|i| placed(0, turn(i))).collect();
        same(&Geometry::of(&scene(vec![mesh], instances)).unwrap(), RAYS / 4);
    }
}

/// What moves is placed by itself and all that stays together; neither that nor where it was before shows in what is met.
#[test]
fn what_moves_is_met_where_it_is() {
    let Some((_guard, device)) = common::device() else { return };
    for odd in [false, true] {
        let still = placements(odd);
        let mut moving = still.clone();
        // Of each mesh some: those odd ones have no inverse.
        moving.instances[1..].iter_mut().step_by(3).for_each(|placed| placed.moves = true);
        let start = Traced::new(&device, Way::Moving, &moving);
        assert_same(&Traced::new(&device, Way::OneLevel, &still), &start, RAYS / 4);
        if odd {
            continue;
        }
        for angle in [0.3, 2.0] {
            let turn = Affine3A::from_rotation_translation(Quat::from_rotation_z(angle), Vec3::Y * angle);
            let mut there = moving.clone();
            for placed in there.instances.iter_mut().filter(|placed| placed.moves) {
                placed.transform = turn * placed.transform;
            }
            let structure = start.structure.moved(&device, &there).unwrap().unwrap();
            let names: Vec<&str> = structure.reports().iter().map(|report| &*report.name).collect();
            assert_eq!(names, ["software", "software-top"]);
            let followed =
                Traced { device: &device, backend: Backend::Software, structure, geometry: &there };
            assert_same(&Traced::new(&device, Way::OneLevel, &there), &followed, RAYS / 4);
        }
        // Without an inverse a placement's triangles are in the world.
        let mut flat = moving.clone();
        flat.instances[1].transform = Affine3A::from_scale(vec3(1.0, 1e-20, 1.0));
        assert!(start.structure.moved(&device, &flat).unwrap().is_none());
    }
}

fn assert_same(one: &Traced<'_>, two: &Traced<'_>, count: usize) {
    let geometry = one.geometry;
    let rays = rays(geometry, count);
    assert!(two.structure.traversal().two_levels && !one.structure.traversal().two_levels);
    let bits = |hit: &Hit| {
        let [v, w] = hit.barycentrics.map(f32::to_bits);
        found(hit).then_some((hit.t.to_bits(), hit.instance, hit.primitive, v, w))
    };
    let [a, b] = [one, two].map(|traced| traced.closest(&rays));
    assert!(a.iter().filter(|hit| found(hit)).count() > count / 10);
    let oracle = Oracle::new(geometry);
    let is_line = |hit: &Hit| {
        let triangle = oracle.brute.triangle(hit.instance, hit.primitive).unwrap();
        let [a, b, c] = triangle.vertices.map(Vec3::as_dvec3);
        (b - a).cross(c - a) == DVec3::ZERO
    };
    let same = |a: &Hit, b: &Hit| bits(a) == bits(b) || found(b) && is_line(b);
    let differ = a.iter().zip(&b).zip(&rays).filter(|((a, b), _)| !same(a, b));
    let differ: Vec<_> = differ.map(|((a, b), ray)| format!("{ray:?}: {a:?}, {b:?}")).collect();
    assert!(differ.is_empty(), "{} rays: {}", differ.len(), differ[0]);
    let lines = b.iter().filter(|hit| found(hit) && is_line(hit)).count();
    let [a, b] = [one.any(&rays), two.any(&rays)];
    assert!(a.iter().zip(&b).filter(|(a, b)| a != b).count() <= lines);
}

/// What coincides would all be met at once: a ray asks one of it. Masked triangles have holes of their own.
#[test]
fn of_what_coincides_one_is_kept() {
    let mut mesh = soup([[Vec3::X, Vec3::Y, Vec3::Z]; 40]);
    mesh.materials[20..].fill(1);
    let masked = Mesh { materials: vec![1; 40], ..mesh.clone() };
    let instances = (0..300).map(|i| placed(i % 2, Affine3A::IDENTITY)).collect();
    let geometry = Geometry::of(&scene(vec![mesh, masked], instances)).unwrap();
    let meshes = Meshes::build(&geometry, false, true).unwrap();
    // The opaque one of the first mesh, and all of the second.
    assert_eq!(meshes.triangles.len(), 1 + 40);
    let top = meshes.places.top().unwrap();
    assert_eq!(top.placements.len(), 1 + 150);

    let solid = soup([[Vec3::X, Vec3::Y, Vec3::Z]; 40]);
    let instances = (0..300).map(|_| placed(0, Affine3A::IDENTITY)).collect();
    let geometry = Geometry::of(&scene(vec![solid], instances)).unwrap();
    let meshes = Meshes::build(&geometry, false, true).unwrap();
    let placements = meshes.places.top().unwrap().placements;
    assert_eq!((meshes.triangles.len(), placements.len(), placements[0].instance), (1, 1, 1));
    agrees_with_brute_force(&geometry, 1000);
}

#[test]
fn two_levels_are_built_where_they_save_memory() {
    let times = |triangles: usize, placements: usize| {
        let instances = (0..placements).map(|_| placed(0, Affine3A::IDENTITY)).collect();
        Geometry::of(&scene(vec![soup(vec![[Vec3::X, Vec3::Y, Vec3::Z]; triangles])], instances)).unwrap()
    };
    assert!(worthwhile(&times(1000, 8000)));
    assert!(!worthwhile(&times(1000, 3000)), "219 MB");
    assert!(!worthwhile(&times(5_000_000, 1)), "nothing saved");
    assert!(!worthwhile(&times(1, 4_000_000)), "placements take more");
}

#[test]
fn at_equal_distance_the_lowest_id_wins() {
    let mesh = scattered(50);
    let mut many = mesh.clone();
    for _ in 0..6 {
        many.triangles.extend(&mesh.triangles);
    }
    many.materials = vec![0; many.triangles.len()];
    let geometry = single(many);
    agrees_with_brute_force(&geometry, 10_000);
    let rays = rays(&geometry, 10_000);
    if let Some((_guard, device)) = common::device() {
        let hits = Traced::new(&device, Way::OneLevel, &geometry).closest(&rays);
        assert!(hits.iter().any(found));
        assert!(hits.iter().filter(|hit| found(hit)).all(|hit| hit.primitive < 50));
    }
}

#[test]
fn a_closed_mesh_leaks_no_ray_at_its_edges_and_vertices() {
    for (scale, offset) in [(1.0, 0.0), (1e-3, 0.0), (1e4, 0.0), (100.0, 1e5)] {
        let geometry = single(moved(closed(60, 90, 0.02), scale, Vec3::splat(offset)));
        let triangles: Vec<_> = geometry.world_triangles().map(|triangle| triangle.vertices).collect();
        let mut random = Random(3);
        let rays: Vec<Ray> = (0..RAYS)
            .map(|_| {
                let [a, b, _] = triangles[random.index(0..triangles.len())];
                let target = a + (b - a) * if random.unit() < 0.3 { 0.0 } else { random.unit() };
                let origin = random.cube() * 0.3 * scale + Vec3::splat(offset);
                Ray { origin, direction: target - origin, t_min: 0.0, t_max: f32::INFINITY }
            })
            .collect();
        with_structures(|device, way| {
            let traced = Traced::new(device, way, &geometry);
            let leaks = traced.closest(&rays).iter().filter(|hit| !found(hit)).count();
            let lit = traced.any(&rays).iter().filter(|blocked| !**blocked).count();
            if way != Way::RayQuery {
                assert_eq!((leaks, lit), (0, 0), "scale {scale}, offset {offset}");
            }
            if leaks > 0 {
                eprintln!("{way:?}, scale {scale}, offset {offset}: the driver leaks {leaks} of {RAYS} rays");
            }
        });
    }
}

/// Walls that are flat along axes, rays along axes and along walls' edges too: what asks for the nearest hit and what
/// asks for any finds one. The latter ends traversal early, on some lanes of a subgroup before others.
#[test]
fn a_closed_box_lets_no_ray_out() {
    let geometry = Geometry::of(&builtin::by_name("closed-box").unwrap()).unwrap();
    let triangles: Vec<_> = geometry.world_triangles().map(|triangle| triangle.vertices).collect();
    let size = triangles.iter().flatten().copied().reduce(Vec3::max).unwrap();
    let mut random = Random(11);
    let rays: Vec<Ray> = (0..RAYS)
        .map(|_| {
            // A third of the coordinates are those of vertices; a wall's own leave it as a scattered ray does.
            let mut origin = Vec3::ZERO;
            for axis in 0..3 {
                let at = match random.index(0..3) {
                    0 => triangles[random.index(0..triangles.len())][0][axis],
                    _ => random.unit() * size[axis],
                };
                origin[axis] = at.clamp(geometry.ray_epsilon(), size[axis] - geometry.ray_epsilon());
            }
            let axis = random.index(0..3);
            let sign = if random.unit() < 0.5 { -1.0 } else { 1.0 };
            let mut direction = random.direction();
            match random.index(0..4) {
                // Zeros of either sign.
                0 => direction = Vec3::AXES[axis] * sign,
                1 => direction[axis] = 0.0 * sign,
                _ => {}
            }
            let t_max = if random.unit() < 0.5 { f32::INFINITY } else { 4.0 * size.length() };
            Ray { origin, direction: direction.normalize(), t_min: 0.0, t_max }
        })
        .collect();
    with_structures(|device, way| {
        let traced = Traced::new(device, way, &geometry);
        let leaks = traced.closest(&rays).iter().filter(|hit| !found(hit)).count();
        let lit = traced.any(&rays).iter().filter(|blocked| !**blocked).count();
        assert_eq!((leaks, lit), (0, 0), "{way:?}");
    });
}

/// Rays that leave the surface of a convex mesh, half of them along it, by the arithmetic of
/// `lib/surface.glsl` and `trace/offset.glsl`; with the triangle each starts on.
fn leaving(geometry: &Geometry, outward: f32) -> Vec<(Ray, (u32, u32))> {
    let epsilon = geometry.ray_epsilon();
    let triangles: Vec<_> = geometry.world_triangles().collect();
    let mut random = Random(5);
    (0..RAYS)
        .map(|_| {
            let triangle = triangles[random.index(0..triangles.len())];
            let [a, b, c] = triangle.vertices;
            let (mut v, mut w) = (random.unit(), random.unit());
            if v + w > 1.0 {
                (v, w) = (1.0 - v, 1.0 - w);
            }
            let normal = (b - a).cross(c - a).normalize() * outward;
            let mut direction = random.direction();
            if random.unit() < 0.5 {
                direction -= normal * direction.dot(normal) * (1.0 - 1e-4 * random.unit());
            }
            if direction.dot(normal) < 0.0 {
                direction = -direction;
            }
            let origin = a + (v * (b - a) + w * (c - a)) + epsilon * normal;
            (
                Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY },
                (triangle.instance, triangle.primitive),
            )
        })
        .collect()
}

#[test]
fn surfaces_neither_shadow_themselves_nor_leak() {
    for (scale, offset) in [(1.0, 0.0), (1e-3, 0.0), (1e4, 0.0), (100.0, 1e5), (1e4, 1e5)] {
        // Finer meshes than that are not convex where vertices lie on a grid of 8 mm.
        for segments in if offset == 0.0 { &[12, 90][..] } else { &[12] } {
            let place = Affine3A::from_scale_rotation_translation(
                Vec3::splat(scale),
                Quat::from_rotation_x(0.5),
                Vec3::splat(offset),
            );
            let far = Affine3A::from_translation(Vec3::splat(5.0 * scale)) * place;
            let sphere = closed(*segments, *segments, 0.0);
            let merged = scene(vec![sphere.clone()], vec![placed(0, place)]);
            let instanced = scene(vec![sphere], vec![placed(0, place), placed(0, far)]);
            for (scene, context) in [(merged, "merged"), (instanced, "instanced")] {
                let geometry = Geometry::of(&scene).unwrap();
                let (outward, _): (Vec<_>, Vec<_>) = leaving(&geometry, 1.0).into_iter().unzip();
                let (inward, own): (Vec<_>, Vec<_>) = leaving(&geometry, -1.0).into_iter().unzip();
                with_structures(|device, way| {
                    let traced = Traced::new(device, way, &geometry);
                    let reach = 0.5 * scale;
                    let near: Vec<Ray> = outward.iter().map(|ray| Ray { t_max: reach, ..*ray }).collect();
                    let shadowed = traced.any(&near).iter().filter(|blocked| **blocked).count();
                    let hits = traced.closest(&inward);
                    let leaks = hits.iter().filter(|hit| !found(hit)).count();
                    let own = hits
                        .iter()
                        .zip(&own)
                        .filter(|(hit, own)| (hit.instance, hit.primitive) == **own)
                        .count();
                    assert_eq!(
                        (shadowed, own, leaks),
                        (0, 0, 0),
                        "{way:?}, {context}, scale {scale}, offset {offset}, {segments} segments"
                    );
                });
            }
        }
    }
}

#[test]
fn masked_triangles_ask_the_kernel() {
    let mut mesh = scattered(300);
    mesh.materials = (0..300).map(|i| u32::from(i % 3 != 0)).collect();
    let instances = vec![
        placed(0, Affine3A::IDENTITY),
        placed(1, Affine3A::IDENTITY),
        placed(1, Affine3A::from_rotation_y(0.7)),
    ];
    let mut all_masked = closed(5, 7, 0.1);
    all_masked.materials.fill(1);
    let geometry = Geometry::of(&scene(vec![mesh, all_masked], instances)).unwrap();
    let rays = rays(&geometry, 20_000);
    let oracle = BruteForce::new(&geometry);
    // As test/trace.comp decides it.
    let solid = |c: &Crossing| {
        let masked = oracle.triangle(c.hit.instance, c.hit.primitive).unwrap().blocks.masked;
        let [v, w] = c.hit.barycentrics;
        !masked || v + w <= 0.5
    };
    with_structures(|device, way| {
        let traced = Traced::new(device, way, &geometry);
        let hits = traced.closest(&rays);
        let blocked = traced.any(&rays);
        let mut masked_hits = 0;
        for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(blocked) {
            let (t_min, t_max) = (f64::from(ray.t_min), f64::from(ray.t_max));
            let near = |c: &Crossing| c.inside > -1e-4 && c.hit.t > t_min - 1e-3 && c.hit.t < t_max + 1e-3;
            let sure = |c: &Crossing| {
                let [v, w] = c.hit.barycentrics;
                let off_the_limits = (c.hit.t - t_min).abs() > 1e-3 && (c.hit.t - t_max).abs() > 1e-3;
                c.cosine > 0.01 && c.inside > 1e-4 && off_the_limits && (v + w - 0.5).abs() > 1e-2
            };
            let crossings: Vec<_> = oracle.crossings(ray).filter(near).collect();
            if !crossings.iter().all(sure) {
                continue;
            }
            let expected = crossings.iter().filter(|c| solid(c)).min_by(|a, b| a.hit.t.total_cmp(&b.hit.t));
            assert_eq!(found(hit), expected.is_some(), "{way:?} {ray:?}");
            assert_eq!(blocked, expected.is_some(), "{way:?} {ray:?}");
            if let Some(expected) = expected {
                let id = (expected.hit.instance, expected.hit.primitive);
                assert_eq!((hit.instance, hit.primitive), id, "{way:?} {ray:?}");
                masked_hits += usize::from(oracle.triangle(id.0, id.1).unwrap().blocks.masked);
            }
        }
        assert!(masked_hits > 100);
    });
}

#[test]
fn degenerate_rays_end() {
    let geometry = single(closed(12, 20, 0.1));
    let good = Ray { origin: Vec3::ZERO, direction: Vec3::X, t_min: 0.0, t_max: f32::INFINITY };
    let odd = [
        Ray { direction: Vec3::ZERO, ..good },
        Ray { direction: Vec3::splat(f32::NAN), ..good },
        Ray { origin: Vec3::splat(f32::NAN), ..good },
        Ray { origin: Vec3::splat(f32::INFINITY), ..good },
        Ray { t_min: 1.0, t_max: 0.5, ..good },
        Ray { t_max: 0.0, ..good },
    ];
    if let Some((_guard, device)) = common::device() {
        let traced = Traced::new(&device, Way::OneLevel, &geometry);
        assert!(found(&traced.closest(&[good])[0]));
        assert!(traced.closest(&odd).iter().all(|hit| !found(hit)));
        assert!(!traced.any(&odd).contains(&true));
    }
}

#[test]
fn a_hundred_thousand_nested_slivers_build_and_trace() {
    let geometry = single(nested_slivers(100_000));
    let bvh = SoftwareBvh::build(&geometry, true, u64::MAX).unwrap();
    assert!(bvh.stack_depth <= MAX_STACK_DEPTH);
    if let Some((_guard, device)) = common::device() {
        let rays = rays(&geometry, 64);
        let oracle = Oracle::new(&geometry);
        let traced = Traced::new(&device, Way::OneLevel, &geometry);
        check_all(&rays, &traced.closest(&rays), |ray, hit| oracle.check(ray, hit));
    }
}

#[test]
fn past_the_devices_memory_it_refuses() {
    let geometry = single(closed(12, 20, 0.0));
    let needed = SoftwareBvh::build(&geometry, true, u64::MAX).unwrap().bytes();
    assert!(SoftwareBvh::build(&geometry, true, needed).is_ok());
    for available in [0, 440 * 48, needed - 1] {
        let error = SoftwareBvh::build(&geometry, true, available).unwrap_err();
        assert!(
            matches!(error, Error::TooLarge { triangles: 440, bytes, .. } if bytes > available),
            "{error}"
        );
        assert!(error.to_string().contains("440 triangles"));
    }
}
