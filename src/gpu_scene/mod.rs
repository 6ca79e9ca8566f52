//! A scene's shading data on a device: what `glsl/lib/surface.glsl`, `lights.glsl` and `light_sampler.glsl` read.

mod emitter;
mod light_tree;

use crate::accel::Geometry;
use crate::scene::{
    AlphaMode, Environment, Filter, Light, LightKind, Material, NormalMap, Scene, SceneProfile, TextureRef,
    TextureUse, Wrap,
};
use crate::shaders::{
    self, LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SPOT, LightSet, MATERIAL_ALPHA_BLEND, MATERIAL_ALPHA_MASK,
    MATERIAL_DOUBLE_SIDED, MATERIAL_SHEER, MATERIAL_SLAB, MATERIAL_SOLID, MATERIAL_UNLIT, NO_TEXTURE,
    SceneData, TEXTURE_DEEP, TEXTURE_NEAREST, TEXTURE_SRGB, TEXTURE_UV1, TEXTURE_WRAP_CLAMP,
    TEXTURE_WRAP_MIRROR, TEXTURE_WRAP_U_SHIFT, TEXTURE_WRAP_V_SHIFT, TRIANGLE_MIRRORED,
};
use crate::vk;
use emitter::{Emitter, EnvironmentTable, orientation};
use glam::{Mat3, Vec2, Vec3, Vec4};
use light_tree::{Bounds, DELTA_ROOT, EMITTER_ROOT, JOINT_ROOT, Subtree};
use std::collections::BTreeMap;
use std::f32::consts::PI;
use std::sync::Arc;

/// Lights without size up to which a point asks each of them; of more it samples some by the tree.
pub(crate) const MOST_ASKED_LIGHTS: u32 = 8;

/// Least probability of the tree, and of what is infinitely far away, where there is both: what either is thought to give
/// is a mean over the scene.
const LEAST_SHARE: f64 = 0.25;

/// Buffers that live as long as the scene, and their addresses.
#[derive(Clone, Debug)]
pub struct GpuScene {
    /// By name; images by number, too.
    buffers: BTreeMap<String, Arc<vk::Buffer>>,
    emitters: Arc<[Emitter]>,
    emitter_tree: Arc<Subtree>,
    /// Whether any material emits.
    emission: bool,
    /// ∫L dω of the environment (W/m², all channels), and of what of it exceeds its mean; 0 without one.
    environment_flux: f64,
    excess_flux: f64,
    /// Whether lobes may be sampled beside an environment.
    lobes: bool,
    /// Addresses and constants of the scene; camera and frame are the renderer's to fill in.
    pub(crate) data: SceneData,
}

impl GpuScene {
    /// Uploads everything but the structures rays are traced in.
    ///
    /// # Errors
    /// Out of device memory, naming the array.
    pub fn upload(device: &vk::Device, scene: &Scene, geometry: &Geometry) -> Result<Self, vk::Error> {
        let mut gpu = Self {
            buffers: BTreeMap::new(),
            emitters: Arc::default(),
            emitter_tree: Arc::default(),
            emission: false,
            environment_flux: 0.0,
            excess_flux: 0.0,
            lobes: false,
            data: SceneData::default(),
        };
        gpu.data.triangles = gpu.array(device, "scene.triangles", &triangles(scene, geometry))?;
        gpu.data.positions = gpu.array(device, "scene.positions", &geometry.positions)?;
        let attributes = Attributes::of(scene, geometry);
        gpu.data.normals = gpu.array(device, "scene.normals", &attributes.normals)?;
        gpu.data.uv0 = gpu.array(device, "scene.uv0", &attributes.uv0)?;
        gpu.data.uv1 = gpu.array(device, "scene.uv1", &attributes.uv1)?;
        gpu.data.colors = gpu.array(device, "scene.colors", &attributes.colors)?;
        gpu.data.tangents = gpu.array(device, "scene.tangents", &tangents(scene, geometry))?;
        gpu.data.triangle_count = u32::try_from(geometry.world_triangle_count()).unwrap_or(u32::MAX);
        gpu.place(device, scene.bounds(), geometry, geometry.ray_epsilon())?;
        gpu.set_materials(device, scene)?;
        gpu.shine(device, scene, geometry)?;
        gpu.set_lights(device, &scene.lights)?;
        Ok(gpu)
    }

    /// Replaces where instances are, and the extent that follows from it (`bounds`, m). What shines is to be set anew.
    ///
    /// # Errors
    /// Out of device memory.
    pub fn place(
        &mut self,
        device: &vk::Device,
        bounds: Option<(Vec3, Vec3)>,
        geometry: &Geometry,
        ray_epsilon: f32,
    ) -> Result<(), vk::Error> {
        self.data.instances = self.array(device, "scene.instances", &instances(geometry))?;
        self.data.ray_epsilon = ray_epsilon;
        let (low, high) = bounds.unwrap_or_default();
        self.data.scene_center = ((low + high) * 0.5).to_array();
        self.data.scene_radius = 0.5 * low.distance(high);
        Ok(())
    }

    /// Replaces materials and what they need of images and the environment. What shines is to be set anew.
    ///
    /// # Errors
    /// Out of device memory.
    pub fn set_materials(&mut self, device: &vk::Device, scene: &Scene) -> Result<(), vk::Error> {
        let (materials, textures) = self.materials(device, scene)?;
        self.data.materials = self.array(device, "scene.materials", &materials)?;
        self.data.textures = self.array(device, "scene.textures", &textures)?;
        self.emission = scene.materials.iter().any(Material::emits);
        // Any threshold of what is a mirror may follow.
        let lobes = scene.environment.is_some() && SceneProfile::of(scene, 0.0).rough_lobes;
        let known = self.data.environment != 0 && lobes == self.lobes;
        self.lobes = lobes;
        match &scene.environment {
            Some(environment) if !known => self.environment(device, environment),
            _ => Ok(()),
        }
    }

    /// Replaces tables of the triangles that emit. Lights are to be set anew.
    ///
    /// # Errors
    /// Out of device memory.
    pub fn shine(
        &mut self,
        device: &vk::Device,
        scene: &Scene,
        geometry: &Geometry,
    ) -> Result<(), vk::Error> {
        let weights = emitter::weights(scene, geometry);
        self.data.emission_weights = self.array(device, "scene.emission_weights", &weights)?;
        self.emitters = emitter::emitters(scene, geometry, &weights).into();
        self.emitter_tree =
            Arc::new(Subtree::of(&self.emitters.iter().map(|e| e.bounds).collect::<Vec<_>>()));
        let leaves = leaves_by_triangle(geometry, &self.emitters, &self.emitter_tree);
        self.data.emitter_leaves = self.array(device, "scene.emitter_leaves", &leaves)?;
        Ok(())
    }

    fn environment(&mut self, device: &vk::Device, environment: &Environment) -> Result<(), vk::Error> {
        let table = EnvironmentTable::of(environment);
        let excess = table.as_ref().filter(|_| self.lobes).and_then(|table| table.of_excess(environment));
        self.data.environment = self.array(device, "environment", &environment.texels)?;
        self.data.environment_size = [environment.width, environment.height];
        let table = table.unwrap_or_default();
        self.data.environment_rows = self.array(device, "environment.rows", &table.rows)?;
        self.data.environment_columns = self.array(device, "environment.columns", &table.columns)?;
        self.environment_flux = table.flux;
        let excess = excess.unwrap_or_default();
        self.data.excess_rows = self.array(device, "environment.excess_rows", &excess.rows)?;
        self.data.excess_columns = self.array(device, "environment.excess_columns", &excess.columns)?;
        self.excess_flux = excess.flux;
        Ok(())
    }

    /// Replaces the lights and nothing else.
    ///
    /// # Errors
    /// Out of device memory.
    pub fn set_lights(&mut self, device: &vk::Device, lights: &[Light]) -> Result<(), vk::Error> {
        let records = light_records(lights, self.data.scene_radius);
        self.data.light_count = records.len() as u32;
        self.data.lights = self.array(device, "scene.lights", &records)?;

        let mut powers: Vec<_> = records.iter().map(|record| (0, 0, power(record))).collect();
        powers.extend(self.emitters.iter().map(|e| (e.instance, e.primitive, e.power)));
        // What falls on the disc through the bounding sphere, from all around; positive also in a scene without extent.
        let disc = f64::from(PI * self.data.scene_radius.powi(2));
        let environment = |rows, flux: f64| (rows != 0).then(|| (0, 0, (flux * disc).max(f64::MIN_POSITIVE)));
        let all = environment(self.data.environment_rows, self.environment_flux);
        let excess = environment(self.data.excess_rows, self.excess_flux);
        let emitters = powers[records.len()..].to_vec();
        powers.extend(all);
        let (mut choices, inverse_power) = emitter::choices(&powers);
        let (area_choices, inverse_area_power) = emitter::choices(&powers[records.len()..]);
        self.data.light_choice_count = choices.len() as u32;
        self.data.inverse_area_power = inverse_area_power;
        self.data.excess_choices = choices.len() as u32;
        self.data.excess_choice_count = area_choices.len() as u32;
        self.data.inverse_excess_power = inverse_area_power;
        choices.extend(area_choices);
        if self.lobes && all.is_some() {
            let (excess_choices, inverse_excess_power) =
                emitter::choices(&[emitters, excess.into_iter().collect()].concat());
            self.data.excess_choices = choices.len() as u32;
            self.data.excess_choice_count = excess_choices.len() as u32;
            self.data.inverse_excess_power = inverse_excess_power;
            choices.extend(excess_choices);
        }
        if self.emission || self.data.light_count > MOST_ASKED_LIGHTS {
            self.light_tree(device, &records, &mut choices, all, excess)?;
        } else {
            self.data.light_nodes = self.array::<u8>(device, "scene.light_nodes", &[])?;
        }
        self.data.light_choices = self.array(device, "scene.light_choices", &choices)?;
        self.data.inverse_power = inverse_power;
        Ok(())
    }

    /// Lights chosen by a tree, and beside it tables of what is infinitely far away.
    fn light_tree(
        &mut self,
        device: &vk::Device,
        records: &[shaders::Light],
        choices: &mut Vec<shaders::LightChoice>,
        environment: Option<(u32, u32, f64)>,
        excess: Option<(u32, u32, f64)>,
    ) -> Result<(), vk::Error> {
        let placed: Vec<(u32, Bounds)> =
            (0..).zip(records).filter_map(|(i, light)| Some((i, bounds(light)?))).collect();
        let mut deltas = Subtree::of(&placed.iter().map(|(_, bounds)| *bounds).collect::<Vec<_>>());
        deltas.name_leaves(|leaf| placed[leaf as usize].0);
        let nodes = light_tree::nodes(&self.emitter_tree, &deltas);
        let suns: Vec<_> = (0..)
            .zip(records)
            .filter(|(_, light)| light.kind == LIGHT_DIRECTIONAL)
            .map(|(i, light)| (i, 0, power(light)))
            .collect();
        let emitted: f64 = self.emitters.iter().map(|e| e.power).sum();
        let shone: f64 = placed.iter().map(|(i, _)| power(&records[*i as usize])).sum();
        let mut set = |deltas: bool, sky: Option<(u32, u32, f64)>| {
            let infinite: Vec<_> = suns.iter().filter(|_| deltas).copied().chain(sky).collect();
            let emitters = !self.emitters.is_empty();
            let root = match (emitters, deltas && !placed.is_empty()) {
                (true, true) => JOINT_ROOT,
                (false, true) => DELTA_ROOT,
                _ => EMITTER_ROOT,
            };
            let near = emitted + if deltas { shone } else { 0.0 };
            let far: f64 = infinite.iter().map(|&(.., power)| power).sum();
            let tree_probability = match (near > 0.0, infinite.is_empty()) {
                (true, false) => (near / (near + far)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE) as f32,
                (near, _) => f32::from(near),
            };
            let (first, count) = (choices.len() as u32, infinite.len() as u32);
            choices.extend(emitter::choices(&infinite).0);
            LightSet { root, tree_probability, first, count }
        };
        let sampled = records.len() as u32 > MOST_ASKED_LIGHTS;
        self.data.all_lights = set(true, environment);
        self.data.sampled_lights = set(sampled, environment);
        self.data.lights_beside_lobes = set(sampled, excess);
        self.data.light_nodes = self.array(device, "scene.light_nodes", &nodes)?;
        Ok(())
    }

    /// Positions of vertices, and normals where there are any.
    pub(crate) fn vertices(&self) -> Option<(&Arc<vk::Buffer>, Option<&Arc<vk::Buffer>>)> {
        Some((self.buffers.get("scene.positions")?, self.buffers.get("scene.normals")))
    }

    /// Replaces them.
    pub(crate) fn set_vertices(&mut self, positions: Arc<vk::Buffer>, normals: Option<Arc<vk::Buffer>>) {
        self.data.positions = positions.address();
        self.buffers.insert("scene.positions".into(), positions);
        if let Some(normals) = normals {
            self.data.normals = normals.address();
            self.buffers.insert("scene.normals".into(), normals);
        }
    }

    /// Whether anything that has a size shines: emissive triangles or the environment.
    pub(crate) fn area_lights(&self) -> bool {
        self.data.light_choice_count > self.data.light_count
    }

    /// Bytes on the device.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.buffers.values().map(|buffer| buffer.size()).sum()
    }

    /// Bytes that were uploaded since it was `other`.
    #[must_use]
    pub fn bytes_beside(&self, other: &Self) -> u64 {
        let is_new = |&(name, buffer): &(&String, &Arc<vk::Buffer>)| {
            other.buffers.get(name).is_none_or(|known| !Arc::ptr_eq(known, buffer))
        };
        self.buffers.iter().filter(is_new).map(|(_, buffer)| buffer.size()).sum()
    }

    /// The address of a new buffer with these elements, in place of the one of that name; 0 where there are none.
    fn array<T: bytemuck::Pod>(
        &mut self,
        device: &vk::Device,
        name: &str,
        data: &[T],
    ) -> Result<u64, vk::Error> {
        if data.is_empty() {
            self.buffers.remove(name);
            return Ok(0);
        }
        let buffer = device.upload(name, bytemuck::cast_slice(data))?;
        let address = buffer.address();
        self.buffers.insert(name.to_owned(), Arc::new(buffer));
        Ok(address)
    }

    fn materials(
        &mut self,
        device: &vk::Device,
        scene: &Scene,
    ) -> Result<(Vec<shaders::Material>, Vec<shaders::Texture>), vk::Error> {
        let mut textures = Vec::new();
        let mut materials = Vec::new();
        for material in &scene.materials {
            let mut record = without_textures();
            for (usage, texture) in material.textures() {
                // Unlit surfaces show their base colour only.
                if material.unlit && usage != TextureUse::BaseColor {
                    continue;
                }
                let image = &scene.images[texture.image as usize];
                let name = format!("image {} {}", texture.image, image.name);
                let address = match self.buffers.get(&name) {
                    Some(known) => known.address(),
                    None => self.array(device, &name, &image.texels)?,
                };
                *texture_slot(&mut record, usage) = textures.len() as u32;
                let mut flags = if usage.is_srgb() { TEXTURE_SRGB } else { 0 };
                if !image.low_bytes().is_empty() {
                    flags |= TEXTURE_DEEP;
                }
                textures.push(texture_record(&texture, address, [image.width, image.height], flags));
            }
            let mut flags = 0;
            let mut alpha_cutoff = 0.0;
            if material.double_sided {
                flags |= MATERIAL_DOUBLE_SIDED;
            }
            if material.unlit {
                flags |= MATERIAL_UNLIT;
            }
            if let AlphaMode::Mask { cutoff } = material.alpha_mode {
                flags |= MATERIAL_ALPHA_MASK;
                alpha_cutoff = cutoff;
            }
            if material.alpha_mode == AlphaMode::Blend {
                flags |= MATERIAL_ALPHA_BLEND;
            }
            if material.may_be_sheer() {
                flags |= MATERIAL_SHEER;
            }
            let coat = material.clearcoat.filter(|_| !material.unlit).unwrap_or_default();
            let scale = |map: Option<NormalMap>| map.map_or(1.0, |map| map.scale);
            let mut absorption = Vec3::ZERO;
            if let Some(volume) = material.volume.filter(|_| material.may_transmit()) {
                flags |= MATERIAL_SOLID;
                absorption = volume.absorption();
            } else if let Some(depth) = material.slab {
                flags |= MATERIAL_SLAB;
                absorption = depth;
            }
            materials.push(shaders::Material {
                base_color: material.base_color.truncate().to_array(),
                alpha: material.base_color.w,
                emission: material.emission.to_array(),
                roughness: material.roughness,
                specular_color: material.specular_color.to_array(),
                specular: material.specular,
                absorption: absorption.to_array(),
                metallic: material.metallic,
                ior: material.ior,
                transmission: material.transmission,
                alpha_cutoff,
                flags,
                clearcoat: coat.factor,
                clearcoat_roughness: coat.roughness,
                normal_scale: scale(material.normal_map),
                clearcoat_normal_scale: scale(coat.normal_map),
                ..record
            });
        }
        Ok((materials, textures))
    }
}

fn without_textures() -> shaders::Material {
    shaders::Material {
        base_color_texture: NO_TEXTURE,
        metallic_roughness_texture: NO_TEXTURE,
        normal_texture: NO_TEXTURE,
        emission_texture: NO_TEXTURE,
        transmission_texture: NO_TEXTURE,
        specular_texture: NO_TEXTURE,
        specular_color_texture: NO_TEXTURE,
        clearcoat_texture: NO_TEXTURE,
        clearcoat_roughness_texture: NO_TEXTURE,
        clearcoat_normal_texture: NO_TEXTURE,
        ..shaders::Material::default()
    }
}

fn texture_slot(record: &mut shaders::Material, usage: TextureUse) -> &mut u32 {
    match usage {
        TextureUse::BaseColor => &mut record.base_color_texture,
        TextureUse::MetallicRoughness => &mut record.metallic_roughness_texture,
        TextureUse::Normal => &mut record.normal_texture,
        TextureUse::Emission => &mut record.emission_texture,
        TextureUse::Transmission => &mut record.transmission_texture,
        TextureUse::Specular => &mut record.specular_texture,
        TextureUse::SpecularColor => &mut record.specular_color_texture,
        TextureUse::Clearcoat => &mut record.clearcoat_texture,
        TextureUse::ClearcoatRoughness => &mut record.clearcoat_roughness_texture,
        TextureUse::ClearcoatNormal => &mut record.clearcoat_normal_texture,
    }
}

fn instances(geometry: &Geometry) -> Vec<shaders::Instance> {
    geometry
        .instances
        .iter()
        .map(|placed| shaders::Instance {
            object_to_world: placed.transform.to_cols_array_2d(),
            first_triangle: geometry.meshes[placed.mesh as usize].first_triangle,
            orientation: orientation(placed.transform.matrix3),
        })
        .collect()
}

/// For each instance where its triangles begin, then for each triangle of those that emit which node is its own; 0 where it
/// has none.
fn leaves_by_triangle(geometry: &Geometry, emitters: &[Emitter], tree: &Subtree) -> Vec<u32> {
    if emitters.is_empty() {
        return Vec::new();
    }
    let mut leaves = vec![0; geometry.instances.len()];
    let of_emitters = light_tree::emitter_leaves(tree, emitters.len());
    let mut last = None;
    for (emitter, leaf) in emitters.iter().zip(of_emitters) {
        if last.replace(emitter.instance) != Some(emitter.instance) {
            leaves[emitter.instance as usize] = leaves.len() as u32;
            let mesh = geometry.instances[emitter.instance as usize].mesh;
            leaves.resize(leaves.len() + geometry.meshes[mesh as usize].triangle_count as usize, 0);
        }
        let first = leaves[emitter.instance as usize];
        leaves[(first + emitter.primitive) as usize] = leaf;
    }
    leaves
}

/// `None` of lights infinitely far away.
fn bounds(light: &shaders::Light) -> Option<Bounds> {
    let reach = match light.kind {
        LIGHT_DIRECTIONAL => return None,
        LIGHT_SPOT => f64::from(light.cos_outer).acos(),
        _ => std::f64::consts::PI,
    };
    let double = |v: [f32; 3]| Vec3::from(v).as_dvec3();
    let intensity = double(light.intensity).element_sum();
    Some(Bounds::of_point(double(light.position), double(light.direction), reach, intensity))
}

fn triangles(scene: &Scene, geometry: &Geometry) -> Vec<shaders::Triangle> {
    let merged = geometry.meshes.first().map_or(0, |range| range.triangle_count as usize);
    let records = geometry.triangles.iter().zip(&geometry.source).enumerate();
    records
        .map(|(index, (&vertices, source))| {
            let mut material = scene.meshes[source.mesh as usize].materials[source.triangle as usize];
            let transform = &scene.instances[source.instance as usize].transform;
            if index < merged && orientation(transform.matrix3) < 0.0 {
                material |= TRIANGLE_MIRRORED;
            }
            shaders::Triangle { vertices, material }
        })
        .collect()
}

/// Vertex attributes in the order of [`Geometry::positions`]; empty where no mesh has any.
#[derive(Default)]
struct Attributes {
    normals: Vec<Vec3>,
    uv0: Vec<Vec2>,
    uv1: Vec<Vec2>,
    colors: Vec<Vec4>,
}

impl Attributes {
    fn of(scene: &Scene, geometry: &Geometry) -> Self {
        fn sized<T: Clone>(wanted: bool, count: usize, fill: T) -> Vec<T> {
            vec![fill; if wanted { count } else { 0 }]
        }
        let count = geometry.positions.len();
        let meshes = &scene.meshes;
        let mut attributes = Self {
            normals: sized(meshes.iter().any(|m| !m.normals.is_empty()), count, Vec3::ZERO),
            uv0: sized(meshes.iter().any(|m| !m.uv0.is_empty()), count, Vec2::ZERO),
            uv1: sized(meshes.iter().any(|m| !m.uv1.is_empty()), count, Vec2::ZERO),
            colors: sized(meshes.iter().any(|m| !m.colors.is_empty()), count, Vec4::ONE),
        };
        let merged = geometry.meshes.first().map_or(0, |range| range.triangle_count as usize);
        for (index, (to, source)) in geometry.triangles.iter().zip(&geometry.source).enumerate() {
            let mesh = &meshes[source.mesh as usize];
            let from = mesh.triangles[source.triangle as usize];
            let normal_matrix = (index < merged && !mesh.normals.is_empty())
                .then(|| cofactor(scene.instances[source.instance as usize].transform.matrix3.into()));
            for (&to, from) in to.iter().zip(from) {
                let (to, from) = (to as usize, from as usize);
                if let Some(&normal) = mesh.normals.get(from) {
                    attributes.normals[to] =
                        normal_matrix.map_or(normal, |m| (m * normal).normalize_or_zero());
                }
                if let Some(&uv) = mesh.uv0.get(from) {
                    attributes.uv0[to] = uv;
                }
                if let Some(&uv) = mesh.uv1.get(from) {
                    attributes.uv1[to] = uv;
                }
                if let Some(&color) = mesh.colors.get(from) {
                    attributes.colors[to] = color;
                }
            }
        }
        attributes
    }
}

/// Three a triangle, in the world for merged meshes; empty where no mesh has any.
fn tangents(scene: &Scene, geometry: &Geometry) -> Vec<[Vec4; 3]> {
    if scene.meshes.iter().all(|mesh| mesh.tangents.is_empty()) {
        return Vec::new();
    }
    let merged = geometry.meshes.first().map_or(0, |range| range.triangle_count as usize);
    let corners = geometry.source.iter().enumerate().map(|(index, source)| {
        let corners = scene.meshes[source.mesh as usize].tangents.get(source.triangle as usize);
        let corners = corners.copied().unwrap_or([Vec4::ZERO; 3]);
        if index >= merged {
            return corners;
        }
        let m = scene.instances[source.instance as usize].transform.matrix3;
        // A mirror turns the bitangent round against the cross product that it is made by.
        corners.map(|t| (Mat3::from(m) * t.truncate()).normalize_or_zero().extend(orientation(m) * t.w))
    });
    corners.collect()
}

/// Carries normals under any scaling, mirrored transforms included.
fn cofactor(m: Mat3) -> Mat3 {
    let sign = orientation(m.into());
    sign * Mat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

fn texture_record(texture: &TextureRef, texels: u64, size: [u32; 2], flags: u32) -> shaders::Texture {
    let wrap = |mode| match mode {
        Wrap::Repeat => 0,
        Wrap::MirroredRepeat => TEXTURE_WRAP_MIRROR,
        Wrap::ClampToEdge => TEXTURE_WRAP_CLAMP,
    };
    let sampler = texture.sampler;
    let mut flags =
        flags | wrap(sampler.wrap_u) << TEXTURE_WRAP_U_SHIFT | wrap(sampler.wrap_v) << TEXTURE_WRAP_V_SHIFT;
    if sampler.filter == Filter::Nearest {
        flags |= TEXTURE_NEAREST;
    }
    if texture.uv_set == 1 {
        flags |= TEXTURE_UV1;
    }
    let rows = texture.transform.to_affine();
    let (m, offset) = (rows.matrix2, rows.translation);
    shaders::Texture {
        texels,
        size,
        transform_u: [m.x_axis.x, m.y_axis.x, offset.x],
        transform_v: [m.x_axis.y, m.y_axis.y, offset.y],
        flags,
        padding0: 0,
    }
}

/// W, all channels.
fn power(light: &shaders::Light) -> f64 {
    light.flux.iter().map(|&f| f64::from(f)).sum()
}

/// Lights with their flux and the distribution they are chosen by: in proportion to power. Lights that give
/// none are left out, as are cones too narrow for 32-bit floats. What a directional light emits is what falls
/// on the disc of `radius` (m).
fn light_records(lights: &[Light], radius: f32) -> Vec<shaders::Light> {
    let shining = lights.iter().filter(|light| light.intensity.max_element() > 0.0);
    let mut records: Vec<_> = shining
        .map(|light| {
            let (kind, inner, outer, extent) = match light.kind {
                LightKind::Point => (LIGHT_POINT, 0.0, PI, 4.0 * PI),
                // The fall-off is the square of a linear function of cosθ between the cones.
                LightKind::Spot { inner, outer } => {
                    let (i, o) = (inner.cos(), outer.cos());
                    (LIGHT_SPOT, inner, outer, 2.0 * PI * ((1.0 - i) + (i - o) / 3.0))
                }
                LightKind::Directional => (LIGHT_DIRECTIONAL, 0.0, PI, PI * radius * radius),
            };
            shaders::Light {
                position: light.position.to_array(),
                kind,
                direction: light.direction.to_array(),
                // Apart, since kernels divide by the difference.
                cos_inner: inner.cos().max(outer.cos().next_up()),
                intensity: light.intensity.to_array(),
                cos_outer: outer.cos(),
                // What a wide scene takes may be more than a float.
                flux: (light.intensity * extent).min(Vec3::MAX).to_array(),
                power_cdf: 0.0,
            }
        })
        .filter(|record| power(record) > 0.0)
        .collect();
    let total: f64 = records.iter().map(power).sum();
    let mut sum = 0.0;
    for record in &mut records {
        sum += power(record);
        record.power_cdf = (sum / total) as f32;
    }
    if let Some(last) = records.last_mut() {
        last.power_cdf = 1.0;
    }
    records
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a light is chosen by is a number, whatever its cone and however wide the scene.
    #[test]
    fn power_is_positive_and_finite() {
        let light = |kind, intensity| Light {
            name: String::new(),
            kind,
            position: Vec3::ZERO,
            direction: Vec3::NEG_Y,
            intensity: Vec3::splat(intensity),
        };
        let narrow = light(LightKind::Spot { inner: 0.0, outer: 1e-4 }, 1.0);
        let sun = light(LightKind::Directional, 1e24);
        let records = light_records(&[narrow, sun, light(LightKind::Point, 1.0)], 1e9);
        assert_eq!(
            records.iter().map(|record| record.kind).collect::<Vec<_>>(),
            [LIGHT_DIRECTIONAL, LIGHT_POINT]
        );
        assert!(records.iter().all(|record| power(record) > 0.0 && power(record).is_finite()));
        assert!(records[0].power_cdf > 0.9 && records[1].power_cdf == 1.0);
    }
}
