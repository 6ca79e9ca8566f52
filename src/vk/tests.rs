//! What the layer promises, on the device at hand.

use ash::vk;

use super::image::COLOR_RANGE;
use super::{Device, DeviceOptions, Error, Format, Image, MemoryKind, TimestampPool};
use crate::ErrorClass;
use crate::common;

/// Bytes without a pattern that a misplaced copy could repeat.
fn noise(len: usize, seed: u32) -> Vec<u8> {
    let mut state = seed | 1;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        (state >> 11) as u8
    };
    (0..len).map(|_| next()).collect()
}

#[test]
fn validation_messages_are_seen() {
    let Some((_guard, device)) = common::device() else { return };
    if !device.validation().is_active() {
        return;
    }
    assert!(device.validation().take().is_empty(), "nothing before");
    // VUID-VkBufferCreateInfo-size-00912: a buffer of no bytes.
    let info = vk::BufferCreateInfo::default().usage(vk::BufferUsageFlags::STORAGE_BUFFER);
    // SAFETY: wrong on purpose; the driver at hand makes an empty buffer or an error of it.
    unsafe {
        if let Ok(buffer) = device.raw().create_buffer(&info, None) {
            device.raw().destroy_buffer(buffer, None);
        }
    }
    let messages = device.validation().take();
    assert!(messages.iter().any(|m| m.contains("VUID-VkBufferCreateInfo-size-00912")), "{messages:?}");
    assert!(device.validation().take().is_empty(), "taking empties the log");

    let buffer = device.buffer("filled twice", 64, MemoryKind::Device).unwrap();
    let fill_twice = |barrier: bool| {
        use vk::{AccessFlags2 as A, PipelineStageFlags2 as S};
        device
            .run("fill twice", |cmd| {
                // SAFETY: the buffer has 64 bytes and lives until `run` has waited. The order of the fills is
                // open without a barrier; either is defined.
                unsafe { device.raw().cmd_fill_buffer(cmd, buffer.raw(), 0, 64, 1) };
                if barrier {
                    // Which of the transfer stages a fill is has changed between versions of Vulkan.
                    let fill = (S::ALL_TRANSFER, A::TRANSFER_WRITE);
                    device.memory_barrier(cmd, fill, fill);
                }
                // SAFETY: as above.
                unsafe { device.raw().cmd_fill_buffer(cmd, buffer.raw(), 0, 64, 2) };
            })
            .unwrap();
        device.validation().take()
    };
    assert_eq!(fill_twice(true), Vec::<String>::new());
    let messages = fill_twice(false);
    assert!(messages.iter().any(|m| m.contains("SYNC-HAZARD-WRITE-AFTER-WRITE")), "{messages:?}");
}

#[test]
fn buffers_keep_their_bytes() {
    let Some((_guard, device)) = common::device() else { return };
    // More than one piece of staging, and sizes that are no whole words.
    for size in [0, 1, 3, 4, 257, 1 << 20, (64 << 20) + 5] {
        let bytes = noise(size, 1);
        let buffer = device.upload("round trip", &bytes).unwrap();
        assert_eq!(buffer.size(), size as u64);
        assert_eq!(buffer.address() % 256, 0);
        assert!(device.download(&buffer).unwrap() == bytes, "{size} bytes");
    }
}

#[test]
fn mapped_memory_is_for_its_own_direction() {
    let Some((_guard, device)) = common::device() else { return };
    let mut upload = device.buffer("upload", 100, MemoryKind::Upload).unwrap();
    let mut readback = device.buffer("readback", 100, MemoryKind::Readback).unwrap();
    let mut own = device.buffer("own", 100, MemoryKind::Device).unwrap();
    assert_eq!(upload.mapped_mut().map(|m| m.len()), Some(100));
    assert_eq!(readback.mapped().unwrap().map(<[u8]>::len), Some(100));
    assert!(upload.mapped().unwrap().is_none() && readback.mapped_mut().is_none());
    assert!(own.mapped_mut().is_none() && own.mapped().unwrap().is_none());
    let bytes = noise(100, 2);
    upload.mapped_mut().unwrap().copy_from_slice(&bytes);
    device
        .run("copy", |cmd| {
            let region = vk::BufferCopy { src_offset: 0, dst_offset: 0, size: 100 };
            // SAFETY: both buffers have 100 bytes and live until `run` has waited.
            unsafe { device.raw().cmd_copy_buffer(cmd, upload.raw(), readback.raw(), &[region]) };
            device.memory_barrier(
                cmd,
                (vk::PipelineStageFlags2::COPY, vk::AccessFlags2::TRANSFER_WRITE),
                (vk::PipelineStageFlags2::HOST, vk::AccessFlags2::HOST_READ),
            );
        })
        .unwrap();
    assert_eq!(readback.mapped().unwrap().unwrap(), bytes);
}

/// Copies `bytes` into an image and out again.
fn through_image(device: &Device, image: &Image, bytes: &[u8]) -> Vec<u8> {
    use vk::{AccessFlags2 as A, PipelineStageFlags2 as S};
    let input = device.upload("texels in", bytes).unwrap();
    let output = device.buffer("texels out", bytes.len() as u64, MemoryKind::Device).unwrap();
    let [width, height] = image.extent();
    let region = vk::BufferImageCopy::default()
        .image_subresource(
            vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1),
        )
        .image_extent(vk::Extent3D { width, height, depth: 1 });
    device
        .run("image round trip", |cmd| {
            let barrier = [vk::ImageMemoryBarrier2::default()
                .src_stage_mask(S::ALL_COMMANDS)
                .dst_stage_mask(S::COPY)
                .dst_access_mask(A::TRANSFER_WRITE)
                .old_layout(vk::ImageLayout::UNDEFINED)
                .new_layout(vk::ImageLayout::GENERAL)
                .image(image.raw())
                .subresource_range(COLOR_RANGE)];
            let info = vk::DependencyInfo::default().image_memory_barriers(&barrier);
            let raw = device.raw();
            // SAFETY: the copies fit image and buffers, which live until `run` has waited.
            unsafe {
                raw.cmd_pipeline_barrier2(cmd, &info);
                let layout = vk::ImageLayout::GENERAL;
                raw.cmd_copy_buffer_to_image(cmd, input.raw(), image.raw(), layout, &[region]);
                device.memory_barrier(cmd, (S::COPY, A::TRANSFER_WRITE), (S::COPY, A::TRANSFER_READ));
                raw.cmd_copy_image_to_buffer(cmd, image.raw(), layout, output.raw(), &[region]);
            }
        })
        .unwrap();
    device.download(&output).unwrap()
}

#[test]
fn images_keep_their_texels_in_every_format() {
    let Some((_guard, device)) = common::device() else { return };
    for format in Format::ALL {
        let image = device.image("texels", [13, 7], format).unwrap();
        let mut bytes = noise(13 * 7 * format.size() as usize, 3);
        // NaN and denormal bit patterns need not survive a copy through a float format.
        for word in bytes.chunks_exact_mut(2) {
            word[1] = 0x3c;
        }
        assert!(through_image(&device, &image, &bytes) == bytes, "{format:?}");
    }
}

#[test]
fn images_beyond_the_limit_are_refused() {
    let Some((_guard, device)) = common::device() else { return };
    let limit = device.info().max_image_dimension;
    for extent in [[limit + 1, 1], [1, limit + 1], [0, 1]] {
        let error = device.image("wide", extent, Format::R32Float).unwrap_err();
        assert!(matches!(error, Error::TooLarge { .. }), "{error}");
        assert!(error.to_string().contains("wide"));
    }
}

#[test]
fn heaps_hold_buffers_and_images_in_turn() {
    let Some((_guard, device)) = common::device() else { return };
    let buffer_needs = device.buffer_requirements("a", 5000).unwrap();
    let image_needs = device.image_requirements("b", [33, 9], Format::Rgba32Float).unwrap();
    let second = buffer_needs.size.next_multiple_of(image_needs.alignment);
    let bits = buffer_needs.memory_type_bits & image_needs.memory_type_bits;
    let heap = device.heap("heap", second + image_needs.size.max(buffer_needs.size), bits).unwrap();
    assert!(heap.size() >= second + image_needs.size);

    let buffer = device.buffer_in(&heap, 0, 5000, "a").unwrap();
    let image = device.image_in(&heap, second, [33, 9], Format::Rgba32Float, "b").unwrap();
    let shared = device.buffer_in(&heap, 0, 4000, "c").unwrap();
    assert_eq!(buffer.address(), shared.address(), "the same bytes");
    assert_eq!(buffer.address() % 256, 0);

    let bytes = noise(5000, 4);
    let staged = device.upload("staged", &bytes).unwrap();
    device
        .run("fill", |cmd| {
            let region = vk::BufferCopy { src_offset: 0, dst_offset: 0, size: 5000 };
            // SAFETY: both buffers have 5000 bytes and live until `run` has waited.
            unsafe { device.raw().cmd_copy_buffer(cmd, staged.raw(), buffer.raw(), &[region]) };
        })
        .unwrap();
    let texels: Vec<u8> = bytemuck::cast_slice(&[1.5_f32; 33 * 9 * 4]).to_vec();
    assert!(through_image(&device, &image, &texels) == texels);
    drop(heap);
    assert_eq!(device.download(&buffer).unwrap(), bytes, "the image beside it wrote elsewhere");
    assert_eq!(device.download(&shared).unwrap(), bytes[..4000]);
}

#[test]
fn memory_is_counted_and_all_of_it_comes_back() {
    let Some((_guard, device)) = common::device() else { return };
    let before = device.memory();
    let a = device.buffer("a", 1 << 20, MemoryKind::Device).unwrap();
    let b = device.image("b", [256, 256], Format::Rgba32Float).unwrap();
    let heap = device.heap("c", 1 << 20, !0).unwrap();
    let placed = device.buffer_in(&heap, 0, 100, "d").unwrap();
    let during = device.memory();
    assert!(during.current >= before.current + (3 << 20));
    assert!(during.by_name["a"] >= 1 << 20 && during.by_name["b"] >= 1 << 20);
    drop((a, b, heap));
    assert!(device.memory().by_name.contains_key("c"), "what is placed in a heap keeps it");
    drop(placed);
    let after = device.memory();
    assert_eq!((after.current, &after.by_name), (before.current, &before.by_name));
    assert!(after.peak >= during.current);
}

#[test]
fn too_much_memory_is_one_clear_error() {
    let Some((_guard, device)) = common::device() else { return };
    let size = device.info().memory_bytes + (1 << 30);
    for size in [size, u64::MAX] {
        let error = device.buffer("flattened scene", size, MemoryKind::Device).unwrap_err();
        assert_eq!(error.class(), ErrorClass::Memory);
        let text = error.to_string();
        assert!(text.contains("flattened scene") && text.contains(&size.to_string()), "{text}");
    }
}

#[test]
fn command_buffers_come_back() {
    let Some((_guard, device)) = common::device() else { return };
    let buffer = device.buffer("filled", 64, MemoryKind::Device).unwrap();
    drop(device.commands("discarded").unwrap());
    for value in 0..20_u32 {
        device
            // SAFETY: the buffer has 64 bytes and lives until `run` has waited.
            .run("fill", |cmd| unsafe { device.raw().cmd_fill_buffer(cmd, buffer.raw(), 0, 64, value) })
            .unwrap();
    }
    assert_eq!(device.download(&buffer).unwrap(), 19_u32.to_le_bytes().repeat(16));
    // Two in flight at once, waited for in either order, or by dropping.
    let first = device.submit(device.commands("first").unwrap()).unwrap();
    let second = device.submit(device.commands("second").unwrap()).unwrap();
    second.wait().unwrap();
    first.wait().unwrap();
    drop((first, second));
    device.wait_idle().unwrap();
}

#[test]
fn timestamps_time_work() {
    let Some((_guard, device)) = common::device() else { return };
    let mut pool = TimestampPool::new(&device, "times", 3).unwrap();
    let buffer = device.buffer("filled", 32 << 20, MemoryKind::Device).unwrap();
    for _ in 0..2 {
        pool.reset();
        let started = std::time::Instant::now();
        device
            .run("timed", |cmd| {
                let stage = vk::PipelineStageFlags2::ALL_TRANSFER;
                pool.begin(cmd, 0, stage);
                pool.begin(cmd, 1, stage);
                // SAFETY: the buffer has that many bytes and lives until `run` has waited.
                unsafe { device.raw().cmd_fill_buffer(cmd, buffer.raw(), 0, 32 << 20, 7) };
                pool.end(cmd, 1, stage);
                pool.end(cmd, 0, stage);
            })
            .unwrap();
        let wall = started.elapsed().as_nanos() as u64;
        match pool.nanoseconds(2).unwrap() {
            // Nested intervals nest, and both are inside the host's own.
            Some(ns) => assert!(0 < ns[1] && ns[1] <= ns[0] && ns[0] <= wall, "{ns:?} in {wall}"),
            None => assert!(!device.info().timestamps),
        }
    }
}

#[test]
fn a_device_closes_without_a_message() {
    let Some((_guard, _shared)) = common::device() else { return };
    let device = Device::open(&DeviceOptions { validation: true, select: None }).unwrap();
    let buffer = device.upload("last", &[1, 2, 3]).unwrap();
    let clone = device.clone();
    drop(device);
    assert_eq!(clone.download(&buffer).unwrap(), [1, 2, 3]);
    drop(buffer);
    assert!(clone.memory().by_name.is_empty(), "nothing left to leak: {:?}", clone.memory());
    assert_eq!(clone.memory().current, 0);
    assert_eq!(clone.validation().take(), Vec::<String>::new());
}

#[test]
fn devices_are_listed_and_chosen_by_all_their_names() {
    let Some((_guard, device)) = common::device() else { return };
    let all = super::enumerate().unwrap();
    let info = &all[device.info().index];
    assert_eq!((&info.name, &info.uuid), (&device.info().name, &device.info().uuid));
    for name in [info.index.to_string(), info.name.to_uppercase(), info.uuid.clone()] {
        let options = DeviceOptions { select: Some(name.clone()), validation: false };
        assert_eq!(Device::open(&options).unwrap().info().index, info.index, "{name}");
    }
    let nobody = DeviceOptions { select: Some("no such device".to_owned()), validation: false };
    let error = Device::open(&nobody).unwrap_err();
    assert!(error.to_string().contains(&info.name), "{error}");
}

/// Kernels, compiled from GLSL where the program can.
#[cfg(feature = "compile")]
mod kernels {
    // Names what shaderc's own library leaves out, where it is linked from the system.
    extern crate shaderc_link as _;

    use std::borrow::Cow;

    use super::*;
    use crate::vk::accel::{Input, Instance, Triangles};
    use crate::vk::{
        AccelerationStructure, Access, Backend, Binding, BindingKind, KernelCode, Modules, Pipelines,
    };

    fn spirv(source: &str) -> Vec<u32> {
        let compiler = shaderc::Compiler::new().unwrap();
        let mut options = shaderc::CompileOptions::new().unwrap();
        options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
        let source = format!("#version 460\n#extension GL_EXT_ray_query : require\n{source}");
        let kind = shaderc::ShaderKind::Compute;
        compiler
            .compile_into_spirv(&source, kind, "test", "main", Some(&options))
            .unwrap()
            .as_binary()
            .to_vec()
    }

    /// A kernel whose set 1 is one buffer of words, `results`, at binding 0.
    fn kernel(name: &'static str, source: &str, params_size: u32, spec_ids: &'static [u32]) -> KernelCode {
        let binding = Binding {
            name: Cow::Borrowed("results"),
            binding: 0,
            kind: BindingKind::Buffer { stride: 4 },
            access: Access::Write,
        };
        KernelCode {
            name: Cow::Borrowed(name),
            workgroup: [1, 1, 1],
            bindings: Cow::Owned(vec![binding]),
            params_size,
            params: Cow::Borrowed(&[]),
            spec_ids: Cow::Borrowed(spec_ids),
            uses_scene: true,
            modules: Modules::Plain(Cow::Owned(spirv(source))),
        }
    }

    /// Runs workgroups `base..base + groups` and returns the words of `results`, -1 where untouched.
    struct Run<'a> {
        pipelines: &'a Pipelines,
        code: &'a KernelCode,
        backend: Backend,
        spec: &'a [u32],
        params: &'a [u8],
        uniform: &'a [u8],
        structure: Option<&'a AccelerationStructure>,
        groups: [u32; 2],
        words: usize,
    }

    impl Run<'_> {
        fn results(&self) -> Vec<i32> {
            use vk::{AccessFlags2 as A, PipelineStageFlags2 as S};
            let device = self.pipelines.device();
            let raw = device.raw();
            let pipeline = self.pipelines.get(self.code, self.spec, self.backend).unwrap();
            let uniform = device.upload("scene", self.uniform).unwrap();
            let set = device.scene_set(self.backend, uniform, self.structure).unwrap();
            let results = device.upload("results", &vec![0xff; self.words * 4]).unwrap();
            let point = vk::PipelineBindPoint::COMPUTE;
            device
                .run("kernel", |cmd| {
                    let buffers = [results.descriptor()];
                    let write = vk::WriteDescriptorSet::default()
                        .dst_binding(0)
                        .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                        .buffer_info(&buffers);
                    let push = device.push_descriptor();
                    // SAFETY: layouts come from the kernel; everything bound lives until `run` has waited.
                    unsafe {
                        raw.cmd_bind_pipeline(cmd, point, pipeline.raw());
                        raw.cmd_bind_descriptor_sets(cmd, point, pipeline.layout(), 0, &[set.raw()], &[]);
                        push.cmd_push_descriptor_set(cmd, point, pipeline.layout(), 1, &[write]);
                        if !self.params.is_empty() {
                            let stage = vk::ShaderStageFlags::COMPUTE;
                            raw.cmd_push_constants(cmd, pipeline.layout(), stage, 0, self.params);
                        }
                        raw.cmd_dispatch_base(cmd, self.groups[0], 0, 0, self.groups[1], 1, 1);
                    }
                    let compute = (S::COMPUTE_SHADER, A::SHADER_STORAGE_WRITE);
                    device.memory_barrier(cmd, compute, (S::ALL_COMMANDS, A::MEMORY_READ));
                })
                .unwrap();
            bytemuck::pod_collect_to_vec(&device.download(&results).unwrap())
        }
    }

    const WIRING: &str = "
        layout(local_size_x = 1) in;
        layout(constant_id = 3) const int A = 0;
        layout(constant_id = 7) const int B = 0;
        layout(set = 0, binding = 0) uniform Scene { int scene; };
        layout(set = 1, binding = 0) writeonly buffer Results { int results[]; };
        layout(push_constant) uniform Params { int p; ivec3 q; };
        void main() {
            uint i = gl_GlobalInvocationID.x;
            results[i] = int(i) + 10 * A + 100 * B + 1000 * p + 10000 * q.z + 100000 * scene;
        }";

    #[test]
    fn constants_params_scene_and_base_reach_the_kernel() {
        let Some((_guard, device)) = common::device() else { return };
        let pipelines = Pipelines::with_cache(&device, None).unwrap();
        let code = kernel("wiring", WIRING, 28, &[3, 7]);
        let uniform = &6_i32.to_ne_bytes();
        let params: Vec<u8> = [4_i32, 0, 0, 0, 0, 0, 5].iter().flat_map(|v| v.to_ne_bytes()).collect();
        let mut backends = vec![Backend::Software];
        backends.extend(device.info().ray_query.then_some(Backend::RayQuery));
        for backend in backends {
            let run = |spec: &[u32]| {
                let (pipelines, code, params) = (&pipelines, &code, &params);
                let (groups, words, structure) = ([2, 3], 6, None);
                Run { pipelines, code, backend, spec, params, uniform, structure, groups, words }.results()
            };
            assert_eq!(run(&[2, 3]), [-1, -1, 654_322, 654_323, 654_324, -1]);
            assert_eq!(run(&[0, 9]), [-1, -1, 654_902, 654_903, 654_904, -1]);
        }
    }

    #[test]
    fn pipelines_are_made_once_each() {
        let Some((_guard, device)) = common::device() else { return };
        let pipelines = Pipelines::with_cache(&device, None).unwrap();
        let code = kernel("wiring", WIRING, 28, &[3, 7]);
        let get = |spec: &[u32]| pipelines.get(&code, spec, Backend::Software).unwrap();
        let first = get(&[1, 2]);
        assert_eq!(first.raw(), get(&[1, 2]).raw());
        assert_ne!(first.raw(), get(&[2, 2]).raw());
        assert_eq!(first.layout(), get(&[2, 2]).layout());
        let other = kernel("wiring", &WIRING.replace("10 * A", "20 * A"), 28, &[3, 7]);
        assert_ne!(first.raw(), pipelines.get(&other, &[1, 2], Backend::Software).unwrap().raw());
    }

    #[test]
    fn kernels_that_do_not_fit_are_named() {
        let Some((_guard, device)) = common::device() else { return };
        let pipelines = Pipelines::with_cache(&device, None).unwrap();
        let good = kernel("wiring", WIRING, 28, &[3, 7]);
        let limit = device.info().max_workgroup_invocations;
        let software = Modules::Tracing { software: None, ray_query: None };
        for (code, word) in [
            (KernelCode { spec_ids: Cow::Borrowed(&[3]), ..good.clone() }, "2 values"),
            (KernelCode { params_size: 132, ..good.clone() }, "132 bytes"),
            (KernelCode { workgroup: [limit, 2, 1], ..good.clone() }, "invocations"),
            (KernelCode { modules: software, ..good.clone() }, "Software"),
        ] {
            let error = pipelines.get(&code, &[1, 2], Backend::Software).unwrap_err().to_string();
            assert!(error.contains("`wiring`") && error.contains(word), "{error}");
        }
    }

    #[test]
    fn a_damaged_cache_file_costs_time_only() {
        let Some((_guard, device)) = common::device() else { return };
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("deep/pipelines.bin");
        let code = kernel("wiring", WIRING, 28, &[3, 7]);
        let compile = || {
            let pipelines = Pipelines::with_cache(&device, Some(file.clone())).unwrap();
            pipelines.get(&code, &[1, 2], Backend::Software).unwrap();
        };
        compile();
        let good = std::fs::read(&file).unwrap();
        compile();
        let mut bad = good.clone();
        bad[good.len() / 2] ^= 0xff;
        for damaged in [bad.as_slice(), &good[..good.len() - 1], b"", b"not a cache"] {
            std::fs::write(&file, damaged).unwrap();
            compile();
            assert_eq!(std::fs::read(&file).unwrap().len(), good.len(), "written anew");
        }
        // A folder in the file's place can neither be read nor replaced.
        std::fs::remove_file(&file).unwrap();
        std::fs::create_dir(&file).unwrap();
        compile();
    }

    const TRACE: &str = "
        layout(local_size_x = 1) in;
        layout(set = 0, binding = 0) uniform Scene { int scene; };
        layout(set = 0, binding = 1) uniform accelerationStructureEXT tlas;
        layout(set = 1, binding = 0) writeonly buffer Results { int results[]; };
        void main() {
            vec3 origin = vec3(float(gl_GlobalInvocationID.x) + 0.25, 0.25, -1.0);
            rayQueryEXT q;
            rayQueryInitializeEXT(q, tlas, gl_RayFlagsNoneEXT, 0xffu, origin, 0.0, vec3(0, 0, 1), 100.0);
            int candidates = 0;
            while (rayQueryProceedEXT(q)) candidates++;
            int hit = -2;
            if (rayQueryGetIntersectionTypeEXT(q, true) == gl_RayQueryCommittedIntersectionTriangleEXT)
                hit = 1000 * int(rayQueryGetIntersectionInstanceCustomIndexEXT(q, true))
                    + 100 * int(rayQueryGetIntersectionGeometryIndexEXT(q, true))
                    + 10 * int(rayQueryGetIntersectionPrimitiveIndexEXT(q, true))
                    + int(round(rayQueryGetIntersectionTEXT(q, true)));
            results[gl_GlobalInvocationID.x] = candidates > 0 ? 50000 + candidates : hit;
        }";

    fn trace(device: &Device, structure: &AccelerationStructure, rays: u32) -> Vec<i32> {
        let pipelines = Pipelines::with_cache(device, None).unwrap();
        let (spec, params): (&[u32], &[u8]) = (&[], &[]);
        let (code, backend) = (&kernel("trace", TRACE, 0, &[]), Backend::RayQuery);
        let (pipelines, uniform, structure) = (&pipelines, &[0; 4], Some(structure));
        let (groups, words) = ([0, rays], rays as usize);
        Run { pipelines, code, backend, spec, params, uniform, structure, groups, words }.results()
    }

    fn at(x: f32, z: f32, custom_index: u32, structure: &AccelerationStructure) -> Instance {
        Instance {
            transform: [[1., 0., 0., x], [0., 1., 0., 0.], [0., 0., 1., z]],
            custom_index,
            record_offset: 0,
            mask: 0xff,
            flags: vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE,
            structure: structure.address(),
        }
    }

    #[test]
    fn rays_hit_what_was_built() {
        let Some((_guard, device)) = common::ray_query_device() else { return };
        // Two triangles side by side in the plane z = 0, over vertices of 16 bytes.
        let corners: [[f32; 4]; 4] = [[0., 0., 0., 9.], [1., 0., 0., 9.], [0., 1., 0., 9.], [2., 0., 0., 9.]];
        let top: [[f32; 4]; 1] = [[1., 1., 0., 9.]];
        let vertices =
            device.upload("vertices", bytemuck::cast_slice(&[&corners[..], &top[..]].concat())).unwrap();
        let indices = device.upload("indices", bytemuck::cast_slice(&[0_u32, 1, 2, 1, 3, 4])).unwrap();
        let triangles = |first: u64, triangle_count, opaque| Triangles {
            vertices: vertices.address(),
            vertex_stride: 16,
            vertex_count: 5,
            indices: indices.address() + 12 * first,
            triangle_count,
            opaque,
        };
        let both = [triangles(0, 2, true)];
        let split = [triangles(0, 1, true), triangles(1, 1, true)];
        let masked = [triangles(0, 1, false)];
        let nothing = [triangles(0, 0, true)];
        let meshes: [&[Triangles]; 4] = [&both, &split, &masked, &nothing];
        let (built, report) =
            device.build_bottom_structures("meshes", &meshes.map(Input::Triangles)).unwrap();
        assert_eq!(report.bytes, built.iter().map(AccelerationStructure::bytes).sum::<u64>());
        assert!(report.bytes <= report.bytes_before_compaction && report.scratch_bytes > 0);

        let instances = [
            at(0., 0., 1, &built[0]),
            at(2., 1., 2, &built[1]),
            at(4., 2., 3, &built[2]),
            // Behind the first, and so never seen.
            at(0., 3., 4, &built[0]),
            at(5., 0., 5, &built[3]),
        ];
        let (structure, _) = device.build_instance_structure("scene", &instances).unwrap();
        // Custom index, geometry, primitive, distance; the masked one is left to the kernel.
        assert_eq!(trace(&device, &structure, 6), [1001, 1011, 2002, 2102, 50_001, -2]);
    }

    #[test]
    fn rays_miss_an_empty_scene() {
        let Some((_guard, device)) = common::ray_query_device() else { return };
        let (meshes, report) = device.build_bottom_structures("no meshes", &[]).unwrap();
        assert!(meshes.is_empty() && report.bytes == 0);
        let (structure, report) = device.build_instance_structure("no instances", &[]).unwrap();
        assert!(report.bytes > 0);
        assert_eq!(trace(&device, &structure, 2), [-2, -2]);
    }

    #[test]
    fn structures_free_their_memory() {
        let Some((_guard, device)) = common::ray_query_device() else { return };
        let before = device.memory().by_name;
        drop(device.build_instance_structure("brief", &[]).unwrap());
        assert_eq!(device.memory().by_name, before);
    }
}
