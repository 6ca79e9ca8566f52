//! The level over triangles on the device.

use super::levels::{Deforming, Meshes};
use super::upload;
use crate::vk;
use std::sync::Arc;

/// The one level, or the lower of two.
#[derive(Debug)]
pub(super) struct SoftwareLower {
    /// Absent where two levels hold no triangle.
    pub(super) nodes: Option<Arc<vk::Buffer>>,
    pub(super) triangles: Option<Arc<vk::Buffer>>,
    /// Meshes to be brought into shape.
    pub(super) deforming: Arc<[Deforming]>,
}

impl SoftwareLower {
    /// All but where it is placed.
    pub(super) fn of(device: &vk::Device, meshes: Meshes) -> Result<Arc<Self>, vk::Error> {
        let [nodes, triangles] =
            [bytemuck::cast_slice(&meshes.nodes), bytemuck::cast_slice(&meshes.triangles)];
        Self::upload(device, nodes, triangles, meshes.deforming)
    }

    pub(super) fn upload(
        device: &vk::Device,
        nodes: &[u8],
        triangles: &[u8],
        deforming: Vec<Deforming>,
    ) -> Result<Arc<Self>, vk::Error> {
        let nodes = upload(device, "bvh.nodes", nodes)?.map(Arc::new);
        let triangles = upload(device, "bvh.triangles", triangles)?.map(Arc::new);
        Ok(Arc::new(Self { nodes, triangles, deforming: deforming.into() }))
    }
}
