//! One stage each: a function from graph handles to graph handles, its configuration and its citation.
//! A technique's name is its module, its folder of kernels, its timing label and its word on the command line.

pub mod compose;
pub mod gbuffer;
pub mod glare;
pub mod indirect;
pub mod path_trace;
pub mod radiance_cache;
pub mod setting;
pub mod tone_map;
pub mod vpl_shoot;
pub mod whitted;

use crate::accel::Traversal;
use crate::accel::software::MAX_STACK_DEPTH;
use crate::gpu_scene::MOST_ASKED_LIGHTS;
use crate::scene::{Feature, SceneProfile};
use crate::shaders::SceneSpec;

/// The kernels of all techniques, specialised to what a scene needs.
#[derive(Clone, Debug)]
pub struct Kernels {
    pub(crate) profile: SceneProfile,
    /// Lights without size.
    lights: u32,
    scene: SceneSpec,
}

impl Kernels {
    /// Specialises the kernels to a scene and the structure that rays are traced in.
    #[must_use]
    pub fn new(profile: &SceneProfile, traversal: Traversal) -> Self {
        let lights = delta_lights(profile);
        Self { profile: profile.clone(), lights, scene: Self::specialised(profile, traversal) }
    }

    /// Models these, too: the picture stays the same. Comes before [`Self::with_indirect`].
    #[must_use]
    pub(crate) fn modelling(self, features: &[Feature]) -> Self {
        let profile = features.iter().fold(self.profile, |profile, &feature| profile.with(feature));
        let deep = features.contains(&Feature::DeepStructure);
        let stack_depth = if deep { MAX_STACK_DEPTH } else { self.scene.stack_depth };
        let traversal = Traversal { stack_depth, two_levels: self.scene.two_levels };
        Self { scene: Self::specialised(&profile, traversal), profile, ..self }
    }

    fn specialised(profile: &SceneProfile, traversal: Traversal) -> SceneSpec {
        SceneSpec {
            alpha_mask: profile.alpha_mask,
            instanced: profile.instanced,
            textures: profile.textures,
            deep_textures: profile.deep_textures,
            uv1: profile.uv1,
            vertex_colors: profile.vertex_colors,
            smooth_normals: profile.smooth_normals,
            curved: profile.curved,
            mirrors: profile.mirrors,
            glass: profile.glass,
            panes: profile.panes,
            sheer: profile.alpha_blend || profile.panes && profile.beyond_panes,
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
            light_tree: profile.emission || delta_lights(profile) > MOST_ASKED_LIGHTS,
            stack_depth: traversal.stack_depth,
            two_levels: traversal.two_levels,
            // Lobes are what a technique asks for.
            glossy: false,
            ..SceneSpec::default()
        }
    }

    /// Panes are glass as any other: `panes` is off.
    #[must_use]
    pub(crate) fn without_panes(mut self) -> Self {
        self.scene.panes = false;
        self.scene.sheer = self.profile.alpha_blend;
        self
    }

    /// Facets are what they are: `shadow_terminator` is off.
    #[must_use]
    pub(crate) fn without_curves(mut self) -> Self {
        self.scene.curved = false;
        self
    }

    /// Lights are chosen by power alone: `light_choice` is so.
    #[must_use]
    pub(crate) fn without_light_tree(mut self) -> Self {
        self.scene.light_tree = false;
        self
    }

    /// The constants themselves.
    #[cfg(feature = "compile")]
    pub(crate) fn scene_spec(&self) -> &SceneSpec {
        &self.scene
    }

    /// Lights without size.
    pub(crate) fn lights(&self) -> u32 {
        self.lights
    }

    /// Those that points ask one by one.
    pub(crate) fn asked_lights(&self) -> u32 {
        if self.samples_deltas() { 0 } else { self.lights }
    }

    fn samples_deltas(&self) -> bool {
        self.scene.light_tree && self.lights > MOST_ASKED_LIGHTS
    }

    /// Whether points sample lights that they do not ask one by one.
    pub(crate) fn samples_lights(&self) -> bool {
        self.area_lights() || self.samples_deltas()
    }

    /// Whether anything that has a size shines: emissive triangles or the environment.
    pub(crate) fn area_lights(&self) -> bool {
        self.profile.emission || self.profile.environment
    }

    /// Whether any surface reflects or transmits like a mirror or glass, or lets light straight through.
    pub(crate) fn specular(&self) -> bool {
        self.profile.mirrors
            || self.profile.glass
            || self.scene.sheer
            || (self.scene.glossy && self.profile.smooth_coats)
    }

    /// Whether any surface lets light straight through.
    pub(crate) fn sheer(&self) -> bool {
        self.scene.sheer
    }

    /// Whether clear coats and lobes rougher than a mirror count.
    pub(crate) fn glossy(&self) -> bool {
        self.scene.glossy
    }

    /// Whether any of those is not a mirror.
    pub(crate) fn glossy_lobes(&self) -> bool {
        self.scene.glossy && self.profile.rough_lobes
    }

    /// Whether paths that find no light before their last edge may find some there.
    pub(crate) fn finds_light(&self) -> bool {
        self.area_lights() || self.profile.unlit
    }

    /// Whether these are the same kernels as others, in the same passes.
    pub(crate) fn same_as(&self, other: &Self) -> bool {
        let passes =
            |k: &Self| [k.specular(), k.glossy_lobes(), k.area_lights(), k.samples_lights(), k.finds_light()];
        self.scene == other.scene && passes(self) == passes(other)
    }
}

fn delta_lights(profile: &SceneProfile) -> u32 {
    (profile.point_lights + profile.spot_lights + profile.directional_lights) as u32
}

#[cfg(test)]
mod tests {
    use super::indirect::IndirectConfig;
    use super::*;

    /// A constant that no feature turns on would be left out of the general pipeline.
    #[test]
    fn all_features_together_turn_every_constant_on() {
        // How many levels there are is no feature: either kernel reads its own structure alone.
        let structure = Traversal { stack_depth: 1, two_levels: true };
        let nothing = Kernels::new(&SceneProfile::default(), structure);
        let everything = nothing.clone().modelling(Feature::ALL).with_indirect(&IndirectConfig::default());
        let text = format!("{:?}", everything.scene);
        assert!(text.contains("true") && !text.contains("false"), "{text}");
        assert_eq!(everything.scene.stack_depth, MAX_STACK_DEPTH);
        assert!(everything.specular() && everything.glossy_lobes() && everything.finds_light());
        assert_eq!(everything.lights(), 0);
        let drawing = |kernels: &Kernels| kernels.clone().with_indirect(&IndirectConfig::default());
        for feature in Feature::ALL {
            let one = drawing(&nothing.clone().modelling(&[*feature]));
            assert!(
                *feature == Feature::SmoothCoats || !one.same_as(&drawing(&nothing)),
                "{feature:?} changes nothing"
            );
        }
    }
}
