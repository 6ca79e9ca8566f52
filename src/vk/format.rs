//! Texel formats in Vulkan's terms.

use ash::vk;

use super::Format;

impl Format {
    pub(crate) const ALL: [Self; 7] = [
        Self::Rgba32Float,
        Self::Rg32Float,
        Self::R32Float,
        Self::Rgba32Uint,
        Self::R32Uint,
        Self::Rgba16Float,
        Self::Rgba8Unorm,
    ];

    pub(crate) fn raw(self) -> vk::Format {
        match self {
            Self::Rgba32Float => vk::Format::R32G32B32A32_SFLOAT,
            Self::Rg32Float => vk::Format::R32G32_SFLOAT,
            Self::R32Float => vk::Format::R32_SFLOAT,
            Self::Rgba32Uint => vk::Format::R32G32B32A32_UINT,
            Self::R32Uint => vk::Format::R32_UINT,
            Self::Rgba16Float => vk::Format::R16G16B16A16_SFLOAT,
            Self::Rgba8Unorm => vk::Format::R8G8B8A8_UNORM,
        }
    }
}
