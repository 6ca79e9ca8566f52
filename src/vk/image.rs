//! Images.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ash::vk;

use super::heap::{Block, Heap};
use super::{Device, Error, Format, MemoryKind, Requirements};

/// A two-dimensional storage image with one view.
#[derive(Debug)]
pub struct Image {
    raw: vk::Image,
    view: vk::ImageView,
    extent: [u32; 2],
    format: Format,
    name: String,
    /// Its layout has become `GENERAL`, where it stays.
    general: AtomicBool,
    block: Arc<Block>,
}

impl Image {
    /// Width and height in texels.
    #[must_use]
    pub fn extent(&self) -> [u32; 2] {
        self.extent
    }

    /// Texel format.
    #[must_use]
    pub fn format(&self) -> Format {
        self.format
    }

    /// The name it was given.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    pub(crate) fn raw(&self) -> vk::Image {
        self.raw
    }

    pub(crate) fn view(&self) -> vk::ImageView {
        self.view
    }

    pub(crate) fn is_general(&self) -> bool {
        self.general.load(Ordering::Relaxed)
    }

    /// To be called once the work that changes the layout is submitted: what follows on the queue finds it changed.
    pub(crate) fn set_general(&self) {
        self.general.store(true, Ordering::Relaxed);
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        let device = self.block.device.raw();
        // SAFETY: by the rule of the module, nothing in flight uses it.
        unsafe {
            device.destroy_image_view(self.view, None);
            device.destroy_image(self.raw, None);
        }
    }
}

/// All of a colour image.
pub(crate) const COLOR_RANGE: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};

impl Device {
    /// An image, its contents and layout undefined.
    ///
    /// # Errors
    ///
    /// [`Error::TooLarge`], [`Error::OutOfDeviceMemory`], or what the driver said.
    pub fn image(&self, name: &str, extent: [u32; 2], format: Format) -> Result<Image, Error> {
        let requirements = self.image_requirements(name, extent, format)?;
        let block = Block::new(self, name, requirements, MemoryKind::Device, false)?;
        self.bind_image(name, extent, format, block, 0)
    }

    /// What an image needs of its memory.
    pub(crate) fn image_requirements(
        &self,
        name: &str,
        extent: [u32; 2],
        format: Format,
    ) -> Result<Requirements, Error> {
        let limit = self.info().max_image_dimension;
        if extent.iter().any(|&n| n == 0 || n > limit) {
            return Err(Error::TooLarge {
                what: format!("image `{name}` of {}x{} texels; its longer side", extent[0], extent[1]),
                value: u64::from(extent[0].max(extent[1])),
                limit: u64::from(limit),
            });
        }
        let create = image_info(extent, format);
        let info = vk::DeviceImageMemoryRequirements::default().create_info(&create);
        let mut out = vk::MemoryRequirements2::default();
        // SAFETY: as for buffers.
        unsafe { self.raw().get_device_image_memory_requirements(&info, &mut out) };
        Ok(self.requirements(out.memory_requirements, 1))
    }

    /// An image placed in `heap`. Whatever shares its bytes must not be in use at the same time.
    pub(crate) fn image_in(
        &self,
        heap: &Heap,
        offset: u64,
        extent: [u32; 2],
        format: Format,
        name: &str,
    ) -> Result<Image, Error> {
        self.bind_image(name, extent, format, heap.0.clone(), offset)
    }

    fn bind_image(
        &self,
        name: &str,
        extent: [u32; 2],
        format: Format,
        block: Arc<Block>,
        offset: u64,
    ) -> Result<Image, Error> {
        // SAFETY: the format was checked when the device was chosen, the extent with the requirements.
        let raw = unsafe { self.raw().create_image(&image_info(extent, format), None) }
            .map_err(Error::vulkan("vkCreateImage", name))?;
        self.set_name(raw, name);
        let view = vk::ImageView::null();
        let mut image =
            Image { raw, view, extent, format, name: name.to_owned(), general: false.into(), block };
        let block = &image.block;
        // SAFETY: as for buffers.
        unsafe { self.raw().bind_image_memory(raw, block.raw(), block.allocation.offset() + offset) }
            .map_err(Error::vulkan("vkBindImageMemory", name))?;
        let info = vk::ImageViewCreateInfo::default()
            .image(raw)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format.raw())
            .subresource_range(COLOR_RANGE);
        // SAFETY: the image is bound.
        image.view = unsafe { self.raw().create_image_view(&info, None) }
            .map_err(Error::vulkan("vkCreateImageView", name))?;
        self.set_name(image.view, name);
        Ok(image)
    }
}

fn image_info(extent: [u32; 2], format: Format) -> vk::ImageCreateInfo<'static> {
    vk::ImageCreateInfo::default()
        .image_type(vk::ImageType::TYPE_2D)
        .format(format.raw())
        .extent(vk::Extent3D { width: extent[0], height: extent[1], depth: 1 })
        .mip_levels(1)
        .array_layers(1)
        .samples(vk::SampleCountFlags::TYPE_1)
        .tiling(vk::ImageTiling::OPTIMAL)
        .usage(
            vk::ImageUsageFlags::STORAGE
                | vk::ImageUsageFlags::TRANSFER_SRC
                | vk::ImageUsageFlags::TRANSFER_DST,
        )
        .initial_layout(vk::ImageLayout::UNDEFINED)
}
