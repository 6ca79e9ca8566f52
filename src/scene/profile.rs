use super::material::TextureUse;
use super::{AlphaMode, Image, Instance, Light, LightKind, Material, Scene};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// What a scene needs from a renderer; whatever it does not need is left out of the pipeline. Only materials of
/// at least one triangle count.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct SceneProfile {
    /// Triangles in the world, each instance counted.
    pub triangles: usize,
    /// Vertices of all meshes, instances not counted.
    pub vertices: usize,
    /// Instances.
    pub instances: usize,
    /// Materials.
    pub materials: usize,
    /// Base colour textures.
    pub textures: bool,
    /// Textures of roughness and metalness.
    pub metallic_roughness_textures: bool,
    /// Normal maps, the clear coat's among them.
    pub normal_maps: bool,
    /// Textures of the dielectric reflection's strength or colour.
    pub specular_textures: bool,
    /// Textures of transmission.
    pub transmission_textures: bool,
    /// Textures of emission.
    pub emission_textures: bool,
    /// Materials with a clear coat.
    pub clearcoat: bool,
    /// Textures of the clear coat's strength or roughness.
    pub clearcoat_textures: bool,
    /// Textures of 16 bits a channel.
    pub deep_textures: bool,
    /// Textures that use the second coordinate set.
    pub uv1: bool,
    /// Vertex colours.
    pub vertex_colors: bool,
    /// Shading normals other than the triangles' own.
    pub smooth_normals: bool,
    /// Triangles whose shading normals bend away from their own.
    pub curved: bool,
    /// A mesh with more than one instance.
    pub instanced: bool,
    /// Opaque materials with a specular lobe as smooth as a mirror.
    pub mirrors: bool,
    /// Materials that transmit light.
    pub glass: bool,
    /// Those with a rough surface.
    pub rough_glass: bool,
    /// Those that are thin walls smooth enough to let light straight through.
    pub panes: bool,
    /// Whether any of those has something on both of its sides, which shadow rays then join.
    pub beyond_panes: bool,
    /// Planes of panes that have everything on one side: bits of unit normals and distances (m), away from everything.
    #[serde(skip)]
    pub borders: Vec<[u32; 4]>,
    /// Transmitting materials that are solid bodies.
    pub volumes: bool,
    /// Materials with holes.
    pub alpha_mask: bool,
    /// Materials whose alpha is partial coverage.
    pub alpha_blend: bool,
    /// Materials that emit light.
    pub emission: bool,
    /// Materials that show their base colour as it is.
    pub unlit: bool,
    /// Specular lobes too rough for a mirror, those of clear coats among them.
    pub rough_lobes: bool,
    /// Clear coats as smooth as a mirror.
    pub smooth_coats: bool,
    /// Dielectrics as smooth as a mirror over a diffuse base, whose share depends on both directions.
    pub polished: bool,
    /// Point lights.
    pub point_lights: usize,
    /// Spot lights.
    pub spot_lights: usize,
    /// Directional lights.
    pub directional_lights: usize,
    /// Light from infinitely far around.
    pub environment: bool,
}

/// Perceptual roughness up to which every method takes a lobe for one direction: its square stays below `DELTA_ALPHA` of
/// `glsl/lib/bsdf.glsl`.
pub(crate) const DELTA_ROUGHNESS: f32 = 0.009_999;

/// Panes beyond this many planes are taken to have something on both sides.
const MAX_BORDERS: usize = 64;

/// The planes of panes that stay, where all else that stays lies on one side of each: their normals point away from it.
#[derive(Clone, Debug)]
pub(crate) struct Borders {
    /// None where anything lies on both sides.
    planes: Option<Vec<(DVec3, f64)>>,
    /// How far off a plane is on it (m).
    tolerance: f64,
}

impl Borders {
    pub(crate) fn of(scene: &Scene) -> Self {
        let stays = |instance: &&Instance| !is_moving(scene, instance);
        let points = scene.instances.iter().filter(stays).flat_map(|instance| scene.reach(instance));
        let ends = points.map(|p| (p, p)).reduce(|(low, high), (p, _)| (low.min(p), high.max(p)));
        let tolerance = ends.map_or(0.0, |(low, high)| 1e-5 * f64::from((high - low).length()));
        let mut borders = Self { planes: Some(Vec::new()), tolerance };
        for instance in scene.instances.iter().filter(stays) {
            borders.add(scene, instance, &stays);
        }
        borders
    }

    /// Adds the panes of an instance, of which all that counts must be on one side.
    fn add(&mut self, scene: &Scene, instance: &Instance, counts: &dyn Fn(&&Instance) -> bool) {
        let tolerance = self.tolerance;
        let materials = &scene.meshes[instance.mesh as usize].materials;
        for (triangle, &material) in scene.instance_triangles(instance).zip(materials) {
            let material = &scene.materials[material as usize];
            let Some(planes) = &mut self.planes else { return };
            if !material.may_transmit() || !material.may_be_sheer() {
                continue;
            }
            let [a, b, c] = triangle.map(Vec3::as_dvec3);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let known = |&(n, d): &(DVec3, f64)| [a, b, c].iter().all(|p| (n.dot(*p) - d).abs() <= tolerance);
            if planes.iter().any(known) {
                continue;
            }
            let counted = || scene.instances.iter().filter(counts);
            let points = || counted().flat_map(|instance| scene.reach(instance));
            let heights = || points().map(|p| normal.dot(p.as_dvec3() - a));
            let (below, above) = (heights().all(|h| h <= tolerance), heights().all(|h| h >= -tolerance));
            if below == above || planes.len() == MAX_BORDERS {
                self.planes = None;
                return;
            }
            let normal = if below { normal } else { -normal };
            planes.push((normal, normal.dot(a)));
        }
    }

    /// With what moves, too: bits of normals and distances, none where anything lies on both sides.
    fn with_moving(&self, scene: &Scene) -> Option<Vec<[u32; 4]>> {
        let mut all = self.clone();
        for instance in scene.instances.iter().filter(|instance| is_moving(scene, instance)) {
            let (planes, tolerance) = (all.planes.as_ref()?, self.tolerance);
            let inside = |p: Vec3| planes.iter().all(|&(n, d)| n.dot(p.as_dvec3()) - d <= tolerance);
            if !scene.reach(instance).all(inside) {
                return None;
            }
            all.add(scene, instance, &|_| true);
        }
        // Lights on the plane itself are on neither side.
        let bits = |(n, d): (DVec3, f64)| n.extend(d - self.tolerance).as_vec4().to_array().map(f32::to_bits);
        Some(all.planes?.into_iter().map(bits).collect())
    }
}

fn is_moving(scene: &Scene, instance: &Instance) -> bool {
    instance.moves || scene.deformation(instance.mesh).is_some()
}

impl SceneProfile {
    /// Reads the profile off a valid scene; specular lobes of at most `mirror_roughness` (0…1) are mirrors. A texture
    /// of roughness may hold any value up to its factor, a texture of metalness likewise.
    #[must_use]
    pub fn of(scene: &Scene, mirror_roughness: f32) -> Self {
        let mut uses = vec![0_usize; scene.meshes.len()];
        for instance in &scene.instances {
            uses[instance.mesh as usize] += 1;
        }
        let mut used = vec![false; scene.materials.len()];
        let mut profile = Self {
            instances: scene.instances.len(),
            instanced: scene.instances.iter().any(|instance| instance.moves)
                || !scene.deformations.is_empty(),
            environment: scene.environment.is_some(),
            ..Self::default()
        };
        for (mesh, &uses) in scene.meshes.iter().zip(&uses).filter(|&(_, &uses)| uses > 0) {
            profile.triangles += uses * mesh.triangles.len();
            profile.vertices += mesh.positions.len();
            profile.instanced |= uses > 1;
            profile.vertex_colors |= !mesh.colors.is_empty();
            profile.smooth_normals |= mesh.normals.iter().any(|&normal| normal != Vec3::ZERO);
            profile.curved = profile.curved || mesh.is_curved();
            for &material in &mesh.materials {
                used[material as usize] = true;
            }
        }
        // Normals may bend away from what is flat at rest.
        profile.curved |= profile.smooth_normals && !scene.deformations.is_empty();
        for material in
            scene.materials.iter().zip(used).filter_map(|(material, used)| used.then_some(material))
        {
            profile.add(material, &scene.images, mirror_roughness);
        }
        if profile.panes {
            profile.set_borders(scene, &Borders::of(scene));
        }
        profile.set_lights(&scene.lights);
        profile
    }

    /// Renews what places and shapes of what moves decide, where there are panes.
    pub(crate) fn set_places(&mut self, scene: &Scene, borders: &Borders) {
        self.set_borders(scene, borders);
        self.set_lights(&scene.lights);
    }

    fn set_borders(&mut self, scene: &Scene, borders: &Borders) {
        let borders = borders.with_moving(scene);
        self.beyond_panes = borders.is_none() || self.environment;
        self.borders = borders.unwrap_or_default();
    }

    /// Whether pipelines for another serve for it.
    pub(crate) fn is_served_by(&self, other: &Self) -> bool {
        *self == Self { borders: self.borders.clone(), ..other.clone() }
    }

    /// Renews what the lights decide.
    pub fn set_lights(&mut self, lights: &[Light]) {
        if !self.borders.is_empty() {
            self.beyond_panes = self.environment;
        }
        (self.point_lights, self.spot_lights, self.directional_lights) = (0, 0, 0);
        for light in lights {
            *match light.kind {
                LightKind::Point => &mut self.point_lights,
                LightKind::Spot { .. } => &mut self.spot_lights,
                LightKind::Directional => &mut self.directional_lights,
            } += 1;
            let beyond = |[x, y, z, d]: [f32; 4]| light.position.dot(Vec3::new(x, y, z)) >= d;
            self.beyond_panes |= !self.borders.is_empty()
                && (light.kind == LightKind::Directional
                    || self.borders.iter().any(|plane| beyond(plane.map(f32::from_bits))));
        }
    }

    fn add(&mut self, material: &Material, images: &[Arc<Image>], mirror_roughness: f32) {
        self.materials += 1;
        for (usage, texture) in material.textures() {
            // Unlit surfaces show their base colour only.
            if material.unlit && usage != TextureUse::BaseColor {
                continue;
            }
            self.uv1 |= texture.uv_set == 1;
            self.deep_textures |= !images[texture.image as usize].low_bytes().is_empty();
            *match usage {
                TextureUse::BaseColor => &mut self.textures,
                TextureUse::MetallicRoughness => &mut self.metallic_roughness_textures,
                TextureUse::Normal | TextureUse::ClearcoatNormal => &mut self.normal_maps,
                TextureUse::Emission => &mut self.emission_textures,
                TextureUse::Transmission => &mut self.transmission_textures,
                TextureUse::Specular | TextureUse::SpecularColor => &mut self.specular_textures,
                TextureUse::Clearcoat | TextureUse::ClearcoatRoughness => &mut self.clearcoat_textures,
            } = true;
        }
        self.alpha_mask |= matches!(material.alpha_mode, AlphaMode::Mask { .. });
        self.alpha_blend |= material.alpha_mode == AlphaMode::Blend;
        if material.unlit {
            self.unlit = true;
            return;
        }
        if let Some(coat) = material.clearcoat.filter(|coat| coat.factor > 0.0) {
            let rough = coat.roughness > mirror_roughness;
            self.clearcoat = true;
            self.rough_lobes |= rough;
            self.smooth_coats |= !rough || coat.roughness_texture.is_some();
        }
        self.emission |= material.emits();
        let dielectric =
            material.specular * material.specular_color.max_element() > 0.0 && material.ior > 1.0;
        let specular = material.metallic > 0.0 || dielectric;
        let smooth = material.roughness <= mirror_roughness;
        let glass = material.may_transmit();
        let textured = material.metallic_roughness_texture.is_some();
        // Where some is glass, kernels that model glass let what mirrors mirror.
        self.mirrors |= specular && (smooth || textured) && !glass;
        self.polished |= dielectric && smooth && material.may_scatter();
        self.rough_lobes |= specular && !smooth;
        self.glass |= glass;
        self.rough_glass |= glass && !smooth;
        let straight = smooth || textured || material.roughness <= DELTA_ROUGHNESS;
        self.panes |= glass && material.volume.is_none() && straight;
        self.volumes |= glass && material.volume.is_some();
    }

    fn any_textures(&self) -> bool {
        self.textures
            || self.metallic_roughness_textures
            || self.normal_maps
            || self.specular_textures
            || self.transmission_textures
            || self.emission_textures
            || self.clearcoat_textures
    }

    /// One line for each thing that is left out of the pipeline, and why.
    #[must_use]
    pub fn explain(&self) -> Vec<String> {
        let any = self.any_textures();
        let textured_or_colored = self.textures || self.vertex_colors;
        let reasons = [
            (!self.mirrors && !self.glass, "no mirrors or glass: no specular bounces"),
            (self.mirrors && !self.glass, "no glass: no refraction"),
            (self.glass && !self.volumes, "no solid glass: panes are crossed straight, no absorption"),
            (self.glass && !self.panes, "no smooth thin panes: glass blocks shadow rays"),
            (any && !self.textures, "no textures of base colour"),
            (!any, "no textures: no sampling, no texture coordinates"),
            (
                any && !self.metallic_roughness_textures,
                "no textures of roughness and metalness: one of each a material",
            ),
            (any && !self.normal_maps, "no normal maps: no tangents"),
            (
                any && !self.specular_textures,
                "no textures of specular reflection: one strength and colour a material",
            ),
            (any && !self.transmission_textures, "no textures of transmission: one a material"),
            (any && !self.emission_textures, "no textures of emission: one radiance a material"),
            (!self.clearcoat, "no clear coats"),
            (
                self.clearcoat && !self.clearcoat_textures,
                "no textures of clear coats: one strength and roughness a material",
            ),
            (any && !self.deep_textures, "no textures of 16 bits a channel: 8 are read"),
            (any && !self.uv1, "no texture uses the second coordinate set: it is not uploaded"),
            (!self.vertex_colors, "no vertex colours: they are not read"),
            (!textured_or_colored, "one base colour a material: albedo comes from the material alone"),
            (!self.smooth_normals, "no shading normals: triangles' own normals"),
            (
                self.smooth_normals && !self.curved,
                "shading normals are the triangles' own: no facets to smooth",
            ),
            (!self.alpha_blend, "no blended materials: every surface covers all behind it"),
            (!self.alpha_mask, "no alpha masks: every triangle is opaque to rays"),
            (!self.instanced, "every mesh is there once and stays: no two-level traversal"),
            (!self.emission, "no emission: none is added to what the camera sees"),
            (!self.unlit, "no unlit materials: every surface is shaded"),
            (self.point_lights == 0, "no point lights"),
            (self.spot_lights == 0, "no spot lights"),
            (self.directional_lights == 0, "no directional lights"),
            (!self.environment, "no environment: rays that leave the scene find nothing"),
            (!self.emission && !self.environment, "no lights of any size: one shadow ray to each"),
            (!self.rough_lobes, "no specular lobes but mirrors: VPLs light diffuse parts alone"),
        ];
        reasons.iter().filter(|(holds, _)| *holds).map(|(_, why)| (*why).to_owned()).collect()
    }
}
