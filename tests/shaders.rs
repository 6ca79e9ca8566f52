//! What Rust and GLSL must agree on: layouts, numbers, and SPIR-V that is valid.

mod common;

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};
use parhelion::graph::{Executor, Graph, Grid, RunOptions};
use parhelion::sampling;
use parhelion::shaders::{self, SceneData};
use parhelion::vk::{Backend, MemoryKind};
use std::io::Write;
use std::process::Command;
use std::sync::Arc;

/// A structure whose words all differ.
fn numbered<T: Pod>(start: u32) -> T {
    let mut value = T::zeroed();
    for (i, word) in
        bytemuck::cast_slice_mut::<T, u32>(std::slice::from_mut(&mut value)).iter_mut().enumerate()
    {
        *word = start + i as u32;
    }
    value
}

fn words<T: Pod>(value: &T) -> Vec<u32> {
    bytemuck::cast_slice(std::slice::from_ref(value)).to_vec()
}

/// GLSL reads each member of element 1 of each shared structure by name: the words come back in order.
#[test]
fn shared_structures_have_one_layout() {
    let Some((_guard, device)) = common::device() else { return };
    use shaders::test::layout::{Bind, Params, kernel};
    let mut g = Graph::new();
    let mut expected: Vec<u32> = Vec::new();
    macro_rules! array {
        ($name:literal, $ty:ty) => {{
            let data: [$ty; 2] = [Zeroable::zeroed(), numbered(0x3f00_0000 + ((expected.len() as u32) << 8))];
            expected.extend(words(&data[1]));
            let buffer = g.buffer($name, size_of_val(&data) as u64);
            g.upload($name, buffer, bytemuck::cast_slice(&data).to_vec());
            buffer
        }};
    }
    let (instances, triangles) =
        (array!("instances", shaders::Instance), array!("triangles", shaders::Triangle));
    let (materials, textures) =
        (array!("materials", shaders::Material), array!("textures", shaders::Texture));
    let (lights, vpls) = (array!("lights", shaders::Light), array!("vpls", shaders::Vpl));
    let choices = array!("choices", shaders::LightChoice);
    let nodes = array!("nodes", shaders::LightNode);
    // The shader leaves out the padding at the end of Texture: it has none to read elsewhere.
    let scene: SceneData = numbered(0x3e00_0000);
    expected.extend(words(&scene));
    let out = g.buffer("words", 4 * expected.len() as u64);
    let bind = Bind { instances, triangles, materials, textures, lights, vpls, choices, nodes, words: out };
    g.pass("layout", &kernel(), bind, Params {}, Grid::Of([1, 1, 1]));
    let ticket = g.read_buffer::<u32>(out);

    let mut uniform = device.buffer("scene", size_of::<SceneData>() as u64, MemoryKind::Upload).unwrap();
    uniform.mapped_mut().unwrap()[..size_of::<SceneData>()].copy_from_slice(bytemuck::bytes_of(&scene));
    let set = Arc::new(device.scene_set(Backend::Software, uniform, None).unwrap());
    let mut executor = Executor::new(&device, Backend::Software).unwrap();
    let mut run = executor.run(g, &RunOptions { scene: Some(&set), ..RunOptions::default() }).unwrap();
    assert_eq!(run.take(ticket), expected);
}

/// Digits and hashes to the bit, warps to rounding; and the warps have the densities they claim (χ² over
/// equal-probability cells, α = 1e-5).
#[test]
fn sampling_has_one_truth_and_the_right_densities() {
    let Some((_guard, device)) = common::device() else { return };
    use shaders::test::sampling::{Bind, Params, kernel};
    let count = 1u32 << 14;
    let cos_max = 0.6f32;
    let mut executor = Executor::new(&device, Backend::Software).unwrap();
    for (dimension, seed) in [(0, 0), (1, 0), (2, 5), (3, 5), (40, 0), (66, 0xdead_beef)] {
        let mut g = Graph::new();
        let out_samples = g.buffer("samples", u64::from(count) * 48);
        let out_bits = g.buffer("bits", u64::from(count) * 20);
        let params = Params { count, dimension, seed, cos_max };
        g.pass("sampling", &kernel(), Bind { out_samples, out_bits }, params, Grid::Of([count, 1, 1]));
        let (samples, bits) = (g.read_buffer::<f32>(out_samples), g.read_buffer::<u32>(out_bits));
        let mut run = executor.run(g, &RunOptions::default()).unwrap();
        let (samples, bits) = (run.take(samples), run.take(bits));

        let mut cells = [[0u32; 64]; 3];
        for i in 0..count {
            let at = 5 * i as usize;
            assert_eq!(
                bits[at..at + 2],
                sampling::halton_digits(dimension, i, seed),
                "element {i} of {dimension}"
            );
            assert_eq!(bits[at + 2], sampling::hash(i ^ sampling::hash(seed)), "hash of {i}");
            assert_eq!(bits[at + 3..at + 5], sampling::sobol_bits(i, seed), "Sobol' point {i}");
            let u = Vec2::new(sampling::halton(0, i, seed), sampling::halton(1, i, seed));
            let at = 12 * i as usize;
            let got = [0, 3, 6, 9].map(|k| Vec3::from_slice(&samples[at + k..at + k + 3]));
            let sphere = sampling::sample_sphere(u);
            let expected = [
                sphere,
                sampling::sample_cone(u, cos_max),
                sampling::sample_cosine_hemisphere(u),
                sampling::basis_around(sphere).x_axis,
            ];
            for k in 0..3 {
                assert!(
                    (got[k] - expected[k]).abs().max_element() < 1e-5,
                    "{k} of {i}: {} {}",
                    got[k],
                    expected[k]
                );
            }
            // The tangent amplifies the rounding of its normal near the pole.
            assert!(got[3].dot(got[0]).abs() < 1e-5 && (got[3].length() - 1.0).abs() < 1e-5);

            // Equal-probability cells: 8 of the polar distribution by 8 of the angle.
            let polar = [
                0.5 - 0.5 * got[0].z,
                (1.0 - got[1].z) / (1.0 - cos_max),
                got[2].x * got[2].x + got[2].y * got[2].y,
            ];
            for k in 0..3 {
                let angle = got[k].y.atan2(got[k].x) / std::f32::consts::TAU + 0.5;
                let cell = |v: f32| ((v * 8.0) as usize).min(7);
                cells[k][8 * cell(polar[k]) + cell(angle)] += 1;
            }
        }
        // 63 degrees of freedom: P(χ² > 129.5) = 1e-5 for random points; low-discrepancy ones lie far below.
        for (k, cells) in cells.iter().enumerate() {
            let expected = f64::from(count) / 64.0;
            let chi2: f64 = cells.iter().map(|&n| (f64::from(n) - expected).powi(2) / expected).sum();
            assert!(chi2 < 129.5, "warp {k}, seed {seed}: χ² = {chi2}");
        }
    }
}

/// Every kernel in every variant passes the Khronos validator.
#[test]
fn kernels_are_valid_spirv() {
    let present = Command::new("spirv-val").arg("--version").output().is_ok();
    if !common::require("validation", present, "no spirv-val (package spirv-tools)") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut checked = 0;
    for code in shaders::ALL {
        let variants = [Backend::Software, Backend::RayQuery].map(|backend| (backend, code.module(backend)));
        for (backend, words) in variants {
            let words = words.unwrap_or_else(|| panic!("{} has no {} variant", code.name, backend.name()));
            let path = folder.path().join("module.spv");
            let mut file = std::fs::File::create(&path).unwrap();
            file.write_all(bytemuck::cast_slice(words)).unwrap();
            let output = Command::new("spirv-val")
                .args(["--target-env", "vulkan1.3", "--scalar-block-layout"])
                .arg(&path)
                .output()
                .unwrap();
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{} ({}): {errors}", code.name, backend.name());
            checked += 1;
        }
    }
    assert!(checked >= 2 * 10, "only {checked} modules");
}

/// lavapipe takes two seconds a megabyte to make a pipeline, every call being a copy of what is called, and far more where
/// nothing is cached: what is asked for in many places wants one place that asks.
#[test]
fn kernels_are_short() {
    for code in shaders::ALL {
        for backend in [Backend::Software, Backend::RayQuery] {
            let size = code.module(backend).map_or(0, |words| 4 * words.len());
            assert!(size < 700_000, "{} ({}) has {size} bytes", code.name, backend.name());
        }
    }
}

/// Sums beyond 32 bits, and beyond what a cell's low word holds.
#[test]
fn ray_counters_carry() {
    let Some((_guard, device)) = common::device() else { return };
    use shaders::test::rays::{Bind, Params, kernel};
    let cells = device.upload("ray_counters", &vec![0; 8 * shaders::COUNTER_LANES as usize]).unwrap();
    let scene = SceneData { ray_counters: cells.address(), ..SceneData::zeroed() };
    let mut uniform = device.buffer("scene", size_of::<SceneData>() as u64, MemoryKind::Upload).unwrap();
    uniform.mapped_mut().unwrap()[..size_of::<SceneData>()].copy_from_slice(bytemuck::bytes_of(&scene));
    let set = Arc::new(device.scene_set(Backend::Software, uniform, None).unwrap());
    let mut executor = Executor::new(&device, Backend::Software).unwrap();
    let (rays, threads) = (0xf000_0001, 64 * 300);
    let mut g = Graph::new();
    let done = g.buffer("done", 4 * u64::from(threads));
    g.pass("rays", &kernel(), Bind { done }, Params { rays }, Grid::Of([threads, 1, 1]));
    g.keep(done);
    executor.run(g, &RunOptions { scene: Some(&set), ..RunOptions::default() }).unwrap();
    let bytes = device.download(&cells).unwrap();
    let lanes = bytes.chunks_exact(8).map(|cell| u64::from_le_bytes(cell.try_into().unwrap()));
    assert_eq!(lanes.sum::<u64>(), u64::from(rays) * u64::from(threads));
}
