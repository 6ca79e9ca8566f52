//! Two levels for kernels to traverse: nodes over placements above nodes over each mesh's own triangles.
//!
//! A mesh is held once however often it is placed, 112 bytes a placement. Kernels test triangles in the world, rounded as
//! where all lie in one level, so hits are the same bit for bit; only boxes are met in object space.

use super::software::{HOST_BYTES, LeafTriangle, MAX_STACK_DEPTH, SoftwareBvh, check_count, wide_tree};
use super::{Error, Geometry, MeshRange, Placed, WorldTriangle, world_position};
use glam::{Affine3A, Mat3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::cwbvh::node::CwBvhNode;
use std::collections::HashSet;

/// Levels of nodes over a mesh's triangles, and over placements: beyond, trees are halved by count.
const MESH_DEPTH: u32 = 16;
const TOP_DEPTH: u32 = 7;
/// Bytes of a triangle in one level, about.
const TRIANGLE_BYTES: u64 = 73;
/// Two levels are built where they save as much as they take, and at least so many bytes.
const LEAST_SAVED: u64 = 256 << 20;

/// A placement, as `glsl/trace/software.glsl` reads it: seven 16-byte words.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Placement {
    /// Object to world: image of the X axis.
    pub x: [f32; 3],
    /// The first node of its mesh.
    pub root: u32,
    /// Image of the Y axis.
    pub y: [f32; 3],
    /// Instance, as in [`Geometry`].
    pub instance: u32,
    /// Image of the Z axis.
    pub z: [f32; 3],
    padding0: u32,
    /// Image of the origin (m).
    pub at: [f32; 3],
    padding1: u32,
    /// World to object, without the origin: columns.
    pub inverse: [[f32; 4]; 3],
}

/// The upper level: nodes over placements.
#[derive(Clone, Debug, Default)]
pub struct Top {
    /// Nodes, the root first; a child comes after its parent.
    pub nodes: Vec<CwBvhNode>,
    /// Placements in leaf order.
    pub placements: Vec<Placement>,
    /// Levels of nodes.
    depth: u32,
}

/// An instance of [`Geometry`], and where in the lower level its triangles are.
#[derive(Clone, Copy, Debug)]
struct Lower {
    /// The first node; none where no triangle has area.
    root: Option<u32>,
    /// Whether no light passes any triangle.
    solid: bool,
    /// World to object; none where triangles are in the world.
    inverse: Option<Mat3>,
    transform: Affine3A,
    /// In the world.
    bounds: Aabb,
}

/// The lower level: nodes over each mesh's triangles, and what [`Top`] is built of.
#[derive(Clone, Debug, Default)]
pub struct Meshes {
    /// Of all meshes, one after the other.
    pub nodes: Vec<CwBvhNode>,
    /// In leaf order.
    pub triangles: Vec<LeafTriangle>,
    /// Most levels of nodes.
    depth: u32,
    instances: Vec<Lower>,
}

/// Whether two levels take so much less memory than one that they are built where nothing else decides: at most half, and
/// 256 MiB less.
#[must_use]
pub fn worthwhile(geometry: &Geometry) -> bool {
    let one = geometry.world_triangle_count().saturating_mul(TRIANGLE_BYTES);
    let two = geometry.triangles.len() as u64 * TRIANGLE_BYTES
        + (geometry.instances.len() * size_of::<Placement>()) as u64;
    one / 2 >= two && one - two >= LEAST_SAVED
}

impl Meshes {
    /// Builds nodes over each mesh, deterministically and on the calling thread. Of triangles that coincide and let no light
    /// through one is kept, which a ray would meet first.
    ///
    /// # Errors
    /// [`Error::TooMany`] past 2²⁸ triangles, each mesh's counted once.
    pub fn build(geometry: &Geometry, split: bool) -> Result<Self, Error> {
        check_count(geometry.triangles.len() as u64)?;
        let mut meshes = Self::default();
        let mut shared = vec![None; geometry.meshes.len()];
        let corners: Vec<Vec<u32>> = geometry.meshes.iter().map(|range| corners(geometry, range)).collect();
        for placed in &geometry.instances {
            let range = geometry.meshes[placed.mesh as usize];
            // What has no inverse is brought to the world.
            let inverse = inverse(&placed.transform);
            let known = shared[placed.mesh as usize].filter(|_| inverse.is_some());
            let (root, solid) = match known {
                Some(known) => known,
                None => {
                    let transform = inverse.is_none().then_some(&placed.transform);
                    meshes.append(geometry, range, transform, split)?
                }
            };
            if inverse.is_some() {
                shared[placed.mesh as usize] = Some((root, solid));
            }
            let bounds = world_bounds(geometry, placed, &corners[placed.mesh as usize]);
            meshes.instances.push(Lower { root, solid, inverse, transform: placed.transform, bounds });
        }
        Ok(meshes)
    }

    /// Builds the upper level. Of placements that coincide and let no light through one is kept, which a ray would meet first.
    ///
    /// # Errors
    /// [`Error::TooMany`] levels of nodes.
    pub fn top(&self) -> Result<Top, Error> {
        let mut known = HashSet::new();
        let mut first = |lower: &Lower| {
            let place = lower.inverse.map(|_| lower.transform.to_cols_array().map(f32::to_bits));
            !lower.solid || known.insert((lower.root, place))
        };
        let placed: Vec<(Aabb, Placement)> = self
            .instances
            .iter()
            .zip(0..)
            .filter_map(|(lower, instance)| Some((lower, lower.root?, instance)))
            .filter(|(lower, ..)| first(lower))
            .map(|(lower, root, instance)| (lower.bounds, lower.record(root, instance)))
            .collect();
        let (bounds, records): (Vec<Aabb>, Vec<Placement>) = placed.into_iter().unzip();
        let (tree, depth) = wide_tree(&bounds, TOP_DEPTH)?;
        let placements = tree.primitive_indices.iter().map(|&index| records[index as usize]).collect();
        let top = Top { nodes: tree.nodes, placements, depth };
        super::at_most("levels of nodes", self.stack_depth(&top).into(), MAX_STACK_DEPTH.into())?;
        Ok(top)
    }

    /// What kernels must set `STACK_DEPTH` to: of each level of nodes one entry can wait, and placements of one.
    #[must_use]
    pub fn stack_depth(&self, top: &Top) -> u32 {
        top.depth + 1 + self.depth
    }

    /// Adds nodes over a range's triangles, brought to the world where a transform is given. Returns the first node, none
    /// where nothing has area, and whether no light passes what was added.
    fn append(
        &mut self,
        geometry: &Geometry,
        range: MeshRange,
        transform: Option<&Affine3A>,
        split: bool,
    ) -> Result<(Option<u32>, bool), Error> {
        super::room("triangles", range.triangle_count.into(), HOST_BYTES)?;
        let mut known = HashSet::new();
        let mut solid = true;
        let mut triangles = Vec::new();
        for primitive in 0..range.triangle_count {
            let index = (range.first_triangle + primitive) as usize;
            let blocks = geometry.source[index].blocks;
            let vertices = geometry.triangles[index].map(|corner| {
                let point = geometry.positions[corner as usize];
                transform.map_or(point, |transform| world_position(transform, point))
            });
            let opaque = !(blocks.masked || blocks.sheer);
            let bits = vertices.map(|vertex| vertex.to_array().map(f32::to_bits));
            if !super::has_area(vertices) || known.contains(&bits) {
                continue;
            }
            solid &= opaque;
            if opaque {
                known.insert(bits);
            }
            triangles.push(WorldTriangle { vertices, instance: 0, primitive, blocks });
        }
        if triangles.is_empty() {
            return Ok((None, solid));
        }
        let bvh = SoftwareBvh::over(&triangles, split, MESH_DEPTH)?;
        let (first_node, first_triangle) = (self.nodes.len() as u32, self.triangles.len() as u32);
        self.nodes.extend(bvh.nodes.into_iter().map(|node| CwBvhNode {
            child_base_idx: node.child_base_idx + first_node,
            primitive_base_idx: node.primitive_base_idx + first_triangle,
            ..node
        }));
        self.triangles.extend(bvh.triangles);
        self.depth = self.depth.max(bvh.stack_depth);
        Ok((Some(first_node), solid))
    }
}

/// World to object, where what 32 bits make of it is a number of a size that products of lengths can bear.
fn inverse(transform: &Affine3A) -> Option<Mat3> {
    const MOST: f32 = 1e15;
    let inverse = Mat3::from(transform.matrix3).as_dmat3().inverse().as_mat3();
    let bearable = |m: &Mat3| m.to_cols_array().iter().all(|x| x.abs() < MOST);
    (bearable(&inverse) && bearable(&transform.matrix3.into())).then_some(inverse)
}

impl Lower {
    fn record(&self, root: u32, instance: u32) -> Placement {
        let placed = self.inverse.map(|inverse| (self.transform, inverse));
        let (transform, inverse) = placed.unwrap_or_default();
        let m = transform.matrix3;
        Placement {
            x: m.x_axis.to_array(),
            root,
            y: m.y_axis.to_array(),
            instance,
            z: m.z_axis.to_array(),
            padding0: 0,
            at: transform.translation.to_array(),
            padding1: 0,
            inverse: inverse.to_cols_array_2d().map(|[x, y, z]| [x, y, z, 0.0]),
        }
    }
}

/// Vertices that a mesh's triangles name, each once.
fn corners(geometry: &Geometry, range: &MeshRange) -> Vec<u32> {
    let triangles = range.first_triangle as usize..(range.first_triangle + range.triangle_count) as usize;
    let mut corners: Vec<u32> = geometry.triangles[triangles].iter().flatten().copied().collect();
    corners.sort_unstable();
    corners.dedup();
    corners
}

/// The box around a placement's triangles in the world.
fn world_bounds(geometry: &Geometry, placed: &Placed, corners: &[u32]) -> Aabb {
    corners.iter().fold(Aabb::INVALID, |bounds, &corner| {
        let point = world_position(&placed.transform, geometry.positions[corner as usize]);
        let point = Vec3A::from(point);
        bounds.union(&Aabb::new(point, point))
    })
}
