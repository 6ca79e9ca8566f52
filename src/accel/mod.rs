//! Geometry that rays are traced against: the scene's triangles as both backends see them, and structures over them.
//!
//! A hit names its surface by two numbers that are the same on every backend and on the CPU:
//! - `instance` 0 is the *merged mesh*: all meshes placed exactly once that stay, transformed to the world and put
//!   one after the other in instance order, so that a scene without repetition needs no second level;
//!   instances 1… are the placements of meshes used more than once or to be moved, in the scene's order.
//! - `primitive` is the triangle's index in that mesh, opaque triangles before alpha-masked ones.
//!
//! A transform that mirrors leaves the order of a triangle's vertices as it is, so barycentric coordinates
//! always belong to the vertices in the file's order; whoever needs the front side asks the sign of the
//! determinant.

pub mod boxes;
pub mod cpu;
mod hardware;
pub mod levels;
mod lower;
mod report;
pub mod software;
mod structure;

pub use report::StructureReport;
pub(crate) use structure::DEFORMED;
pub use structure::{Arrangement, Levels, Rebuild, Structure, Traversal};

use crate::ErrorClass;
use crate::memory::{Budget, Shortage};
use crate::scene::{AlphaMode, Deformation, Instance, Material, Scene};
use crate::vk;
use glam::{Affine3A, DVec3, Vec3};

/// All triangles of a scene with their placements.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Vertices (m): of range 0 in the world, of the other ranges in object space.
    pub positions: Vec<Vec3>,
    /// Indices into `positions`, range after range.
    pub triangles: Vec<[u32; 3]>,
    /// Where each triangle comes from, as long as `triangles`.
    pub source: Vec<Source>,
    /// Range 0 is the merged mesh and may be empty; the others are the meshes used more than once or to be moved.
    pub meshes: Vec<MeshRange>,
    /// Placement 0 is the merged mesh under the identity.
    pub instances: Vec<Placed>,
    /// Of each mesh that [is to be brought into shape](crate::scene::Scene::deformations) smallest and largest coordinates (m)
    /// that it may come to have, in object space; empty where none is.
    pub deformed: Vec<Option<[Vec3; 2]>>,
}

/// A triangle in the [`Scene`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Source {
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Index into that mesh's triangles.
    pub triangle: u32,
    /// Index into [`Scene::instances`]; for a mesh used more than once, its first.
    pub instance: u32,
    /// How it blocks rays.
    pub blocks: Blocks,
}

/// Consecutive triangles that are placed together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshRange {
    /// Index into [`Geometry::triangles`].
    pub first_triangle: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// Triangles of the range from this one on are alpha-masked; equal to `triangle_count` where none is.
    pub masked_from: u32,
}

/// A range of triangles placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Index into [`Geometry::meshes`].
    pub mesh: u32,
    /// Object to world.
    pub transform: Affine3A,
    /// Index into [`Scene::instances`]; `u32::MAX` for the merged mesh, which holds many.
    pub instance: u32,
    /// Whether it [is to move](crate::scene::Instance::moves) or to change shape.
    pub moves: bool,
}

/// A triangle in the world with the ids that a hit on it carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldTriangle {
    /// Vertices (m).
    pub vertices: [Vec3; 3],
    /// Index into [`Geometry::instances`].
    pub instance: u32,
    /// Index into the instance's range.
    pub primitive: u32,
    /// How it blocks rays.
    pub blocks: Blocks,
}

/// What a ray must ask of a triangle that it meets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Blocks {
    /// Whether there are holes, by the material's alpha.
    pub masked: bool,
    /// Whether some light may go straight through.
    pub sheer: bool,
    /// Whether all of it is a pane, which imperfect visibility leaves out.
    pub pane: bool,
}

impl Blocks {
    pub(crate) fn of(material: &Material) -> Self {
        Self {
            masked: matches!(material.alpha_mode, AlphaMode::Mask { .. }),
            sheer: material.may_be_sheer(),
            pane: material.is_pane(),
        }
    }
}

/// A structure that cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The software structure would not fit.
    #[error(
        "the scene's {triangles} triangles, all instances counted, need {bytes} bytes on the device for tracing, more than the {available} there are"
    )]
    TooLarge {
        /// Triangles with every instance counted.
        triangles: u64,
        /// What vertices and nodes take.
        bytes: u64,
        /// What the caller allowed.
        available: u64,
    },
    /// The host has no room to build a structure.
    #[error("a structure over the scene's {count} {what}, all instances counted, {shortage}")]
    NoRoom {
        /// Plural noun.
        what: &'static str,
        /// How many there are.
        count: u64,
        /// What that takes, and what is left.
        shortage: Shortage,
    },
    /// Triangles would be split into too many boxes.
    #[error("triangles split at {longest} m make more than {limit} boxes; raise indirect.box_split")]
    TooFine {
        /// Longest side of a box (m).
        longest: f32,
        /// How many boxes there may be.
        limit: u64,
    },
    /// More than an index of 32 bits, or the device, can name.
    #[error("the scene has {count} {what}; at most {limit} can be traced")]
    TooMany {
        /// Plural noun.
        what: &'static str,
        /// How many there are.
        count: u64,
        /// How many there may be.
        limit: u64,
    },
    /// The device or its driver.
    #[error(transparent)]
    Vulkan(#[from] vk::Error),
}

impl Error {
    /// What kind of failure this is: a scene past what the device holds is one of memory.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        match self {
            Self::Vulkan(error) => error.class(),
            Self::TooFine { .. } => ErrorClass::Input,
            Self::TooLarge { .. } | Self::NoRoom { .. } | Self::TooMany { .. } => ErrorClass::Memory,
        }
    }
}

/// Refuses to build over so many things, each of which takes so many bytes of the host's memory on the way.
fn room(what: &'static str, count: u64, bytes: u64) -> Result<(), Error> {
    let taken = Budget::of_process().take(count.saturating_mul(bytes));
    taken.map_err(|shortage| Error::NoRoom { what, count, shortage })
}

/// Absent where there is nothing to upload.
fn upload(device: &vk::Device, name: &str, bytes: &[u8]) -> Result<Option<vk::Buffer>, vk::Error> {
    if bytes.is_empty() { Ok(None) } else { device.upload(name, bytes).map(Some) }
}

/// The world position of `point` under a placement: the one place that decides how it is rounded.
#[must_use]
pub fn world_position(transform: &Affine3A, point: Vec3) -> Vec3 {
    transform.transform_point3(point)
}

impl Geometry {
    /// Merges, sorts and places the triangles of `scene`, which must be valid (`Scene::validate`). Triangles
    /// without area are left out: they have no normal to shade with.
    ///
    /// # Errors
    /// [`Error::TooMany`] if vertices or triangles cannot be numbered by 32 bits.
    pub fn of(scene: &Scene) -> Result<Self, Error> {
        let mut uses = vec![0_u32; scene.meshes.len()];
        for instance in &scene.instances {
            uses[instance.mesh as usize] += 1;
        }
        let (mut vertices, mut triangles) = (0_u64, 0_u64);
        for (mesh, _) in scene.meshes.iter().zip(&uses).filter(|(_, uses)| **uses > 0) {
            vertices += mesh.positions.len() as u64;
            triangles += mesh.triangles.len() as u64;
        }
        at_most("vertices", vertices, u64::from(u32::MAX))?;
        at_most("triangles", triangles, u64::from(u32::MAX))?;
        at_most("instances", scene.instances.len() as u64, u64::from(u32::MAX) - 1)?;

        let blocks: Vec<Blocks> = scene.materials.iter().map(Blocks::of).collect();
        let mut geometry = Self::default();
        let merged = Placed { mesh: 0, transform: Affine3A::IDENTITY, instance: u32::MAX, moves: false };
        geometry.instances.push(merged);

        let is_merged = |part: &Part| {
            uses[part.mesh as usize] == 1
                && !scene.instances[part.instance as usize].moves
                && scene.deformation(part.mesh).is_none()
        };
        let once: Vec<Part> = parts(scene).filter(is_merged).collect();
        geometry.append(scene, &once, &blocks, |part, point| {
            world_position(&scene.instances[part.instance as usize].transform, point)
        });

        let mut range_of = vec![None; scene.meshes.len()];
        for part in parts(scene).filter(|part| !is_merged(part)) {
            let mesh = *range_of[part.mesh as usize]
                .get_or_insert_with(|| geometry.append(scene, &[part], &blocks, |_, point| point));
            let Instance { transform, moves, .. } = scene.instances[part.instance as usize];
            let moves = moves || scene.deformation(part.mesh).is_some();
            geometry.instances.push(Placed { mesh, transform, instance: part.instance, moves });
        }
        geometry.place(scene);
        Ok(geometry)
    }

    /// Adds one range of all `parts`, opaque triangles first, and returns its index.
    fn append(
        &mut self,
        scene: &Scene,
        parts: &[Part],
        blocks: &[Blocks],
        place: impl Fn(&Part, Vec3) -> Vec3,
    ) -> u32 {
        let first_triangle = self.triangles.len() as u32;
        let mut bases = Vec::with_capacity(parts.len());
        for part in parts {
            bases.push(self.positions.len() as u32);
            self.positions.extend(scene.meshes[part.mesh as usize].positions.iter().map(|&p| place(part, p)));
        }
        let mut masked_from = 0;
        for want_masked in [false, true] {
            for (part, base) in parts.iter().zip(&bases) {
                let mesh = &scene.meshes[part.mesh as usize];
                for (index, corners) in mesh.triangles.iter().enumerate() {
                    let corners = corners.map(|corner| base + corner);
                    let has_area = has_area(corners.map(|corner| self.positions[corner as usize]));
                    let blocks = blocks[mesh.materials[index] as usize];
                    if has_area && blocks.masked == want_masked {
                        self.triangles.push(corners);
                        self.source.push(Source {
                            mesh: part.mesh,
                            triangle: index as u32,
                            instance: part.instance,
                            blocks,
                        });
                    }
                }
            }
            if !want_masked {
                masked_from = self.triangles.len() as u32 - first_triangle;
            }
        }
        let triangle_count = self.triangles.len() as u32 - first_triangle;
        self.meshes.push(MeshRange { first_triangle, triangle_count, masked_from });
        self.meshes.len() as u32 - 1
    }

    /// Places what moves as it is in `scene`, of which nothing else has changed but shapes.
    pub fn place(&mut self, scene: &Scene) {
        let any = !scene.deformations.is_empty();
        self.deformed.resize(if any { self.meshes.len() } else { 0 }, None);
        for placed in self.instances.iter_mut().filter(|placed| placed.moves) {
            let Instance { transform, mesh, .. } = scene.instances[placed.instance as usize];
            placed.transform = transform;
            if any {
                self.deformed[placed.mesh as usize] = scene.deformation(mesh).map(Deformation::bounds);
            }
        }
    }

    /// Where a mesh's vertices may come to be, in object space, if it is to be brought into shape.
    fn deformed(&self, mesh: u32) -> Option<[Vec3; 2]> {
        self.deformed.get(mesh as usize).copied().flatten()
    }

    /// Number of triangles with every instance counted.
    #[must_use]
    pub fn world_triangle_count(&self) -> u64 {
        self.instances.iter().map(|placed| u64::from(self.meshes[placed.mesh as usize].triangle_count)).sum()
    }

    /// All triangles in the world, ordered by instance and then primitive.
    pub fn world_triangles(&self) -> impl Iterator<Item = WorldTriangle> + '_ {
        (0..self.instances.len() as u32).flat_map(|instance| self.instance_triangles(instance))
    }

    /// Those of one instance.
    fn instance_triangles(&self, instance: u32) -> impl Iterator<Item = WorldTriangle> + Clone + '_ {
        let placed = &self.instances[instance as usize];
        let range = self.meshes[placed.mesh as usize];
        (0..range.triangle_count).map(move |primitive| {
            let index = (range.first_triangle + primitive) as usize;
            let corners = self.triangles[index];
            let vertices = corners.map(|corner| {
                let point = self.positions[corner as usize];
                if instance == 0 { point } else { world_position(&placed.transform, point) }
            });
            WorldTriangle { vertices, instance, primitive, blocks: self.source[index].blocks }
        })
    }

    /// A mesh's triangles where it itself has them, as of instance 0.
    fn object_triangles(&self, range: MeshRange) -> impl Iterator<Item = WorldTriangle> + '_ {
        (0..range.triangle_count).map(move |primitive| {
            let index = (range.first_triangle + primitive) as usize;
            let vertices = self.triangles[index].map(|corner| self.positions[corner as usize]);
            WorldTriangle { vertices, instance: 0, primitive, blocks: self.source[index].blocks }
        })
    }

    /// Whether anything is to move.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.instances.iter().any(|placed| placed.moves)
    }

    /// Of each mesh the largest coordinates of its triangles, by axis (m), deformations left out.
    pub(crate) fn extents(&self) -> Vec<Vec3> {
        let extent = |range: &MeshRange| {
            let first = range.first_triangle as usize;
            self.triangles[first..first + range.triangle_count as usize]
                .iter()
                .flatten()
                .fold(Vec3::ZERO, |largest, &corner| largest.max(self.positions[corner as usize].abs()))
        };
        self.meshes.iter().map(extent).collect()
    }

    /// The largest number that enters the computation of a world position (m): world coordinates, and of
    /// placed meshes also the terms that cancel when a distant object space is moved here.
    #[must_use]
    pub fn largest_coordinate(&self) -> f32 {
        self.largest_of(&self.extents())
    }

    fn largest_of(&self, extents: &[Vec3]) -> f32 {
        self.instances.iter().zip(0..).fold(0.0_f32, |largest, (placed, index)| {
            let deformed = self.deformed(placed.mesh).map(|[low, high]| low.abs().max(high.abs()));
            let extent = deformed.unwrap_or(extents[placed.mesh as usize]);
            let bound = if index == 0 {
                extent
            } else {
                let Affine3A { matrix3: m, translation } = placed.transform;
                Vec3::from(
                    m.x_axis.abs() * extent.x
                        + m.y_axis.abs() * extent.y
                        + m.z_axis.abs() * extent.z
                        + translation.abs(),
                )
            };
            largest.max(bound.max_element())
        })
    }

    /// How far (m) `offset_origin` in `glsl/trace/offset.glsl` moves a ray's origin off a surface:
    /// [`OFFSET_ULPS`] units in the last place of the largest coordinate.
    #[must_use]
    pub fn ray_epsilon(&self) -> f32 {
        self.ray_epsilon_of(&self.extents())
    }

    /// The same where the meshes' [extents](Self::extents) are known.
    pub(crate) fn ray_epsilon_of(&self, extents: &[Vec3]) -> f32 {
        OFFSET_ULPS * f32::EPSILON * self.largest_of(extents)
    }
}

/// Units in the last place of the scene's largest coordinate by which ray origins leave their surface: twice
/// what keeps closed convex meshes from shadowing themselves and from leaking on both backends.
pub const OFFSET_ULPS: f32 = 4.0;

/// Whether the vertices span a plane, beyond the rounding of 64 bits.
fn has_area(vertices: [Vec3; 3]) -> bool {
    let [a, b, c] = vertices.map(Vec3::as_dvec3);
    (b - a).cross(c - a) != DVec3::ZERO
}

/// One placement of a mesh, before merging.
#[derive(Clone, Copy)]
struct Part {
    mesh: u32,
    instance: u32,
}

fn parts(scene: &Scene) -> impl Iterator<Item = Part> + '_ {
    scene.instances.iter().zip(0..).map(|(instance, index)| Part { mesh: instance.mesh, instance: index })
}

fn at_most(what: &'static str, count: u64, limit: u64) -> Result<(), Error> {
    if count > limit { Err(Error::TooMany { what, count, limit }) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;
    use glam::vec3;
    use std::sync::Arc;

    fn mesh(height: f32, materials: &[u32]) -> Mesh {
        let at = |i: usize| vec3(i as f32, height, 0.0);
        Mesh {
            positions: (0..materials.len()).flat_map(|i| [at(i), at(i) + Vec3::X, at(i) + Vec3::Z]).collect(),
            triangles: (0..materials.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            materials: materials.to_vec(),
            ..Mesh::default()
        }
    }

    fn scene(instances: &[(u32, Affine3A)]) -> Scene {
        Scene {
            meshes: [mesh(0.0, &[0, 1, 0]), mesh(1.0, &[1, 0]), mesh(2.0, &[0]), mesh(3.0, &[0])]
                .map(Arc::new)
                .to_vec(),
            instances: instances
                .iter()
                .map(|&(mesh, transform)| Instance { name: String::new(), mesh, transform, moves: false })
                .collect(),
            materials: vec![
                Material::default(),
                Material { alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, ..Material::default() },
            ],
            ..Scene::default()
        }
    }

    #[test]
    fn meshes_used_once_are_merged_and_others_placed() {
        let up = Affine3A::from_translation(Vec3::Y * 10.0);
        let mirror = Affine3A::from_scale(vec3(-1.0, 1.0, 1.0));
        let scene = scene(&[(1, up), (2, up), (0, mirror), (2, mirror)]);
        let geometry = Geometry::of(&scene).unwrap();

        assert_eq!(
            geometry.meshes,
            [
                MeshRange { first_triangle: 0, triangle_count: 5, masked_from: 3 },
                MeshRange { first_triangle: 5, triangle_count: 1, masked_from: 1 },
            ]
        );
        assert_eq!(
            geometry.instances[1..],
            [
                Placed { mesh: 1, transform: up, instance: 1, moves: false },
                Placed { mesh: 1, transform: mirror, instance: 3, moves: false }
            ]
        );
        let sources: Vec<_> = geometry.source.iter().map(|s| (s.mesh, s.triangle, s.instance)).collect();
        assert_eq!(sources, [(1, 1, 0), (0, 0, 2), (0, 2, 2), (1, 0, 0), (0, 1, 2), (2, 0, 1)]);
        assert_eq!(geometry.world_triangle_count(), 7);

        let world: Vec<_> = geometry.world_triangles().collect();
        assert_eq!(world.len(), 7);
        let ids: Vec<_> = world.iter().map(|t| (t.instance, t.primitive, t.blocks.masked)).collect();
        let merged = [(0, 0, false), (0, 1, false), (0, 2, false), (0, 3, true), (0, 4, true)];
        assert_eq!(ids, [&merged[..], &[(1, 0, false), (2, 0, false)]].concat());
        for triangle in &world {
            let placed = geometry.instances[triangle.instance as usize];
            let range = geometry.meshes[placed.mesh as usize];
            let source = geometry.source[(range.first_triangle + triangle.primitive) as usize];
            let instance = if triangle.instance == 0 { source.instance } else { placed.instance };
            let instance = &scene.instances[instance as usize];
            assert_eq!(instance.mesh, source.mesh);
            let mesh = &scene.meshes[source.mesh as usize];
            let expected = mesh.triangles[source.triangle as usize]
                .map(|corner| instance.transform.transform_point3(mesh.positions[corner as usize]));
            assert_eq!(triangle.vertices, expected, "vertices keep their order under a mirror");
        }
    }

    #[test]
    fn a_scene_without_repetition_is_one_mesh() {
        let geometry = Geometry::of(&scene(&[(0, Affine3A::IDENTITY), (3, Affine3A::IDENTITY)])).unwrap();
        assert_eq!((geometry.meshes.len(), geometry.instances.len()), (1, 1));
        assert_eq!(geometry.positions.len(), 12);
    }

    #[test]
    fn the_largest_coordinate_counts_terms_that_cancel() {
        let far = Affine3A::from_translation(vec3(0.0, 1e5, 0.0));
        let back = Affine3A::from_translation(vec3(0.0, -1e5, 0.0));
        assert_eq!(Geometry::of(&Scene::default()).unwrap().largest_coordinate(), 0.0);
        let merged = Geometry::of(&scene(&[(2, far)])).unwrap();
        assert_eq!(merged.largest_coordinate(), 100_002.0);
        let mut scene = scene(&[(2, back), (2, back)]);
        scene.mesh_mut(2).positions.iter_mut().for_each(|p| p.y += 1e5);
        let placed = Geometry::of(&scene).unwrap();
        assert_eq!(placed.largest_coordinate(), 200_002.0);
        assert_eq!(placed.ray_epsilon(), OFFSET_ULPS * f32::EPSILON * 200_002.0);
    }
}
