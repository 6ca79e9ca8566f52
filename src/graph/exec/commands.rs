//! Recording of passes and barriers into command buffers.

use crate::graph::{
    planned::{Barrier, Plan},
    work::{Dispatch, KernelWork, Object, Work},
};
use crate::vk::{self, BindingKind, Pipeline};
use ash::vk as raw;
use std::sync::Arc;

/// A kernel ready to be bound.
#[derive(Debug)]
pub(super) struct Kernel {
    pub(super) pipeline: Arc<Pipeline>,
    pub(super) scene: Option<raw::DescriptorSet>,
}

/// What passes are recorded from.
#[derive(Clone, Copy)]
pub(super) struct Recorder<'f> {
    pub(super) device: &'f vk::Device,
    pub(super) plan: &'f Plan,
    pub(super) objects: &'f [Object],
}

impl Recorder<'_> {
    fn buffer(&self, resource: u32) -> raw::Buffer {
        match &self.objects[resource as usize] {
            Object::Buffer(buffer) => buffer.raw(),
            _ => raw::Buffer::null(),
        }
    }

    fn image(&self, resource: u32) -> raw::Image {
        match &self.objects[resource as usize] {
            Object::Image(image) => image.raw(),
            _ => raw::Image::null(),
        }
    }

    /// Waits for all earlier work on the device and gives new imports their layout.
    pub(super) fn begin(&self, cmd: raw::CommandBuffer) {
        let fresh: Vec<raw::ImageMemoryBarrier2<'_>> = self
            .new_imports()
            .map(|image| {
                layout_barrier(
                    image.raw(),
                    raw::PipelineStageFlags2::ALL_COMMANDS,
                    raw::AccessFlags2::MEMORY_WRITE,
                )
                .dst_stage_mask(raw::PipelineStageFlags2::ALL_COMMANDS)
            })
            .collect();
        let all = [raw::MemoryBarrier2::default()
            .src_stage_mask(raw::PipelineStageFlags2::ALL_COMMANDS)
            .src_access_mask(raw::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(raw::PipelineStageFlags2::ALL_COMMANDS)
            .dst_access_mask(raw::AccessFlags2::MEMORY_READ | raw::AccessFlags2::MEMORY_WRITE)];
        let info = raw::DependencyInfo::default().memory_barriers(&all).image_memory_barriers(&fresh);
        // SAFETY: `cmd` is being recorded, and the images live as long as the run.
        unsafe { self.device.raw().cmd_pipeline_barrier2(cmd, &info) };
    }

    /// Imported images that no graph has used before.
    pub(super) fn new_imports(&self) -> impl Iterator<Item = &vk::Image> {
        self.plan.resources.iter().zip(self.objects).filter_map(|(planned, object)| match object {
            Object::Image(image) if planned.imported && planned.lifetime.is_some() && !image.is_general() => {
                Some(&**image)
            }
            _ => None,
        })
    }

    pub(super) fn barrier(&self, cmd: raw::CommandBuffer, barrier: &Barrier) {
        let (before, after) = (barrier.before.flags(), barrier.after.flags());
        let written = if barrier.memory { raw::AccessFlags2::MEMORY_WRITE } else { raw::AccessFlags2::NONE };
        let used = raw::AccessFlags2::MEMORY_READ | raw::AccessFlags2::MEMORY_WRITE;
        let memory = [raw::MemoryBarrier2::default()
            .src_stage_mask(before)
            .src_access_mask(written)
            .dst_stage_mask(after)
            .dst_access_mask(if barrier.memory { used } else { raw::AccessFlags2::NONE })];
        let images: Vec<raw::ImageMemoryBarrier2<'_>> = (barrier.initialise.iter())
            .map(|&image| layout_barrier(self.image(image as u32), before, written).dst_stage_mask(after))
            .collect();
        let memory = if barrier.before.is_empty() { &[] } else { memory.as_slice() };
        let info = raw::DependencyInfo::default().memory_barriers(memory).image_memory_barriers(&images);
        // SAFETY: `cmd` is being recorded, and the images live as long as the run.
        unsafe { self.device.raw().cmd_pipeline_barrier2(cmd, &info) };
    }

    /// A part of a kernel's grid; an indirect one has no parts.
    pub(super) fn dispatch(
        &self,
        cmd: raw::CommandBuffer,
        kernel: &Kernel,
        work: &KernelWork,
        ([x, y, z], [nx, ny, nz]): ([u32; 3], [u32; 3]),
    ) {
        self.bind(cmd, kernel, work);
        let device = self.device.raw();
        // SAFETY: the pipeline was made for base workgroups and its resources are bound. The grid is within the limits
        // that planning checked, or the graph checked that the buffer holds the arguments and a barrier made them visible.
        unsafe {
            match work.dispatch {
                Dispatch::Groups(_) => device.cmd_dispatch_base(cmd, x, y, z, nx, ny, nz),
                Dispatch::Indirect { buffer, offset } => {
                    // lavapipe (up to Mesa 25.0 at least) adds the base of the dispatch before to an indirect one.
                    device.cmd_dispatch_base(cmd, 0, 0, 0, 0, 0, 0);
                    device.cmd_dispatch_indirect(cmd, self.buffer(buffer), offset);
                }
            }
        }
    }

    fn bind(&self, cmd: raw::CommandBuffer, kernel: &Kernel, work: &KernelWork) {
        let (device, layout) = (self.device.raw(), kernel.pipeline.layout());
        let point = raw::PipelineBindPoint::COMPUTE;
        let infos: Vec<(raw::DescriptorBufferInfo, raw::DescriptorImageInfo)> = (work.bound.iter())
            .map(|&resource| match &self.objects[resource as usize] {
                Object::Buffer(buffer) => (buffer.descriptor(), raw::DescriptorImageInfo::default()),
                Object::Image(image) => {
                    let info = raw::DescriptorImageInfo::default()
                        .image_view(image.view())
                        .image_layout(raw::ImageLayout::GENERAL);
                    (raw::DescriptorBufferInfo::default(), info)
                }
                Object::None => Default::default(),
            })
            .collect();
        let writes: Vec<raw::WriteDescriptorSet<'_>> = (work.code.bindings.iter().zip(&infos))
            .map(|(binding, (buffer, image))| {
                let write = raw::WriteDescriptorSet::default()
                    .dst_binding(binding.binding)
                    .descriptor_type(binding.descriptor_type());
                match binding.kind {
                    BindingKind::Buffer { .. } => write.buffer_info(std::slice::from_ref(buffer)),
                    BindingKind::Image(_) => write.image_info(std::slice::from_ref(image)),
                }
            })
            .collect();
        // SAFETY: `cmd` is being recorded; pipeline, resources and scene live until the run has waited; the graph
        // checked that resources and parameters are those of the kernel the layout was made from.
        unsafe {
            device.cmd_bind_pipeline(cmd, point, kernel.pipeline.raw());
            if let Some(scene) = kernel.scene {
                device.cmd_bind_descriptor_sets(cmd, point, layout, 0, &[scene], &[]);
            }
            if !writes.is_empty() {
                self.device.push_descriptor().cmd_push_descriptor_set(cmd, point, layout, 1, &writes);
            }
            if !work.params.is_empty() {
                device.cmd_push_constants(cmd, layout, raw::ShaderStageFlags::COMPUTE, 0, &work.params);
            }
        }
    }

    pub(super) fn transfer(&self, cmd: raw::CommandBuffer, work: &Work, staging: raw::Buffer, at: u64) {
        let device = self.device.raw();
        let general = raw::ImageLayout::GENERAL;
        let layers =
            raw::ImageSubresourceLayers::default().aspect_mask(raw::ImageAspectFlags::COLOR).layer_count(1);
        let extent = |resource: u32| match &self.objects[resource as usize] {
            Object::Image(image) => {
                let [width, height] = image.extent();
                raw::Extent3D { width, height, depth: 1 }
            }
            _ => raw::Extent3D::default(),
        };
        let texels = |resource| {
            [raw::BufferImageCopy::default()
                .buffer_offset(at)
                .image_subresource(layers)
                .image_extent(extent(resource))]
        };
        let is_image = |resource: u32| matches!(self.objects[resource as usize], Object::Image(_));
        let bytes = |src_offset, dst_offset, size| [raw::BufferCopy { src_offset, dst_offset, size }];
        // SAFETY: `cmd` is being recorded, all objects live until the run has waited, the graph checked that
        // offsets and sizes are inside of them, and every image is in the general layout.
        unsafe {
            match *work {
                Work::Fill { buffer, value } => {
                    let size = self.plan.resources[buffer as usize].desc.bytes();
                    device.cmd_fill_buffer(cmd, self.buffer(buffer), 0, size, value);
                }
                Work::Clear { image } => {
                    let (zero, all) = (raw::ClearColorValue::default(), [vk::COLOR_RANGE]);
                    device.cmd_clear_color_image(cmd, self.image(image), general, &zero, &all);
                }
                Work::Upload { to, .. } if is_image(to) => {
                    device.cmd_copy_buffer_to_image(cmd, staging, self.image(to), general, &texels(to));
                }
                Work::Upload { to, bytes: ref data, .. } => {
                    if !data.is_empty() {
                        device.cmd_copy_buffer(
                            cmd,
                            staging,
                            self.buffer(to),
                            &bytes(at, 0, data.len() as u64),
                        );
                    }
                }
                Work::CopyBuffer { from, from_offset, to, to_offset, size } => {
                    let region = bytes(from_offset, to_offset, size);
                    device.cmd_copy_buffer(cmd, self.buffer(from), self.buffer(to), &region);
                }
                Work::CopyImage { from, to } => {
                    let region = [raw::ImageCopy::default()
                        .src_subresource(layers)
                        .dst_subresource(layers)
                        .extent(extent(from))];
                    device.cmd_copy_image(cmd, self.image(from), general, self.image(to), general, &region);
                }
                Work::Readback { from, .. } if is_image(from) => {
                    device.cmd_copy_image_to_buffer(cmd, self.image(from), general, staging, &texels(from));
                }
                Work::Readback { from, .. } => {
                    let size = self.plan.resources[from as usize].desc.bytes();
                    device.cmd_copy_buffer(cmd, self.buffer(from), staging, &bytes(0, at, size));
                }
                Work::Kernel(_) | Work::Raw(_) => {}
            }
        }
    }
}

/// From an undefined layout to the one all images stay in, with the second stages still to be set.
fn layout_barrier(
    image: raw::Image,
    before: raw::PipelineStageFlags2,
    written: raw::AccessFlags2,
) -> raw::ImageMemoryBarrier2<'static> {
    raw::ImageMemoryBarrier2::default()
        .src_stage_mask(before)
        .src_access_mask(written)
        .dst_access_mask(raw::AccessFlags2::MEMORY_READ | raw::AccessFlags2::MEMORY_WRITE)
        .old_layout(raw::ImageLayout::UNDEFINED)
        .new_layout(raw::ImageLayout::GENERAL)
        .src_queue_family_index(raw::QUEUE_FAMILY_IGNORED)
        .dst_queue_family_index(raw::QUEUE_FAMILY_IGNORED)
        .image(image)
        .subresource_range(vk::COLOR_RANGE)
}
