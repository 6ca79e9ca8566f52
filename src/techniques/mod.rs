//! One stage each: a function from graph handles to graph handles, its configuration and its citation.
//! A technique's name is its module, its folder of kernels, its timing label and its word on the command line.

pub mod compose;
pub mod gbuffer;
pub mod glare;
pub mod indirect;
pub mod path_trace;
pub mod tone_map;
pub mod vpl_shoot;
pub mod whitted;

use crate::scene::SceneProfile;
use crate::shaders::SceneSpec;
use indirect::Visibility;

/// The kernels of all techniques, specialised to what a scene needs.
#[derive(Clone, Debug)]
pub struct Kernels {
    pub(crate) profile: SceneProfile,
    scene: SceneSpec,
}

impl Kernels {
    /// Specialises the kernels; `stack_depth` is what the software structure needs.
    #[must_use]
    pub fn new(profile: &SceneProfile, stack_depth: u32) -> Self {
        let scene = SceneSpec {
            alpha_mask: profile.alpha_mask,
            instanced: profile.instanced,
            textures: profile.textures,
            uv1: profile.uv1,
            vertex_colors: profile.vertex_colors,
            smooth_normals: profile.smooth_normals,
            mirrors: profile.mirrors,
            glass: profile.glass,
            volumes: profile.volumes,
            spot_lights: profile.spot_lights > 0,
            directional_lights: profile.directional_lights > 0,
            metallic_roughness_textures: profile.metallic_roughness_textures,
            normal_maps: profile.normal_maps,
            specular_textures: profile.specular_textures,
            transmission_textures: profile.transmission_textures,
            emission_textures: profile.emission_textures,
            clearcoat: profile.clearcoat,
            clearcoat_textures: profile.clearcoat_textures,
            alpha_blend: profile.alpha_blend,
            emissive_triangles: profile.emission,
            environment: profile.environment,
            stack_depth,
            visibility: Visibility::Exact as u32,
        };
        Self { profile: profile.clone(), scene }
    }

    /// The kernels for another kind of visibility between surfaces and VPLs.
    #[must_use]
    pub fn with_visibility(mut self, visibility: Visibility) -> Self {
        self.scene.visibility = visibility as u32;
        self
    }

    /// The constants themselves.
    #[cfg(feature = "compile")]
    pub(crate) fn scene_spec(&self) -> &SceneSpec {
        &self.scene
    }

    /// Lights that reach points one by one.
    pub(crate) fn lights(&self) -> u32 {
        let profile = &self.profile;
        (profile.point_lights + profile.spot_lights + profile.directional_lights) as u32
    }

    /// Whether any surface reflects or transmits like a mirror or glass.
    pub(crate) fn specular(&self) -> bool {
        self.profile.mirrors || self.profile.glass
    }
}

/// Passes that count their rays, in the order of the cells they count in (`glsl/lib/counters.glsl`).
pub(crate) const RAY_COUNTERS: [&str; 8] = [
    "vpl_shoot/paths",
    "gbuffer/primary",
    "whitted/direct",
    "whitted/tree",
    "whitted/light",
    "indirect/gather",
    "indirect/regather",
    "path_trace/trace",
];

/// Cells a counter is spread over.
pub(crate) const COUNTER_LANES: usize = 256;
