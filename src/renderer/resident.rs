//! A scene's data on a device.

use crate::accel::Structure;
use crate::gpu_scene::GpuScene;
use crate::shaders::SceneData;

/// What runs in flight use of a scene, and keep.
#[derive(Clone, Debug)]
pub(super) struct Resident {
    pub(super) structure: Structure,
    pub(super) gpu: GpuScene,
}

impl Resident {
    /// What kernels know of the scene, camera and frame still to be filled in.
    pub(super) fn data(&self) -> SceneData {
        let mut data = self.gpu.data;
        self.structure.describe(&mut data);
        data
    }

    /// Whether anything that has a size shines.
    pub(super) fn area_lights(&self) -> bool {
        self.gpu.area_lights()
    }
}
