//! Two levels for kernels to traverse: nodes over placements above nodes over each mesh's own triangles.
//!
//! A mesh is held once however often it is placed, 112 bytes a placement; where that is for the sake of what moves, all that
//! stays is placed together. Kernels test triangles in the world, rounded as where all lie in one level, so hits are the same
//! bit for bit; only boxes are met in object space.

use super::software::{HOST_BYTES, LeafTriangle, MAX_STACK_DEPTH, SoftwareBvh, check_count, wide_tree};
use super::{Error, Geometry, Placed, WorldTriangle};
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
    /// Instance, as in [`Geometry`]; of what is placed together the first, which triangles count from.
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

/// Instances of [`Geometry`] that are placed together, and where in the lower level their triangles are.
#[derive(Clone, Copy, Debug)]
struct Lower {
    /// The first.
    instance: u32,
    /// Whether it is to move.
    moves: bool,
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
    /// What is placed.
    pub places: Places,
}

/// What the lower level's nodes are placed by.
#[derive(Clone, Debug, Default)]
pub struct Places {
    /// Most levels of nodes of a mesh.
    depth: u32,
    lower: Vec<Lower>,
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
    /// Builds nodes over each mesh, or over those that move and over all others together; deterministically and on the calling
    /// thread. Of triangles that coincide and let no light through one is kept, which a ray would meet first.
    ///
    /// # Errors
    /// [`Error::TooMany`] past 2²⁸ triangles, each mesh's counted once but for those placed together, [`Error::NoRoom`].
    pub fn build(geometry: &Geometry, split: bool, each: bool) -> Result<Self, Error> {
        let mut meshes = Self::default();
        let apart = |placed: &Placed| each || placed.moves;
        let together: Vec<u32> = (0..)
            .zip(&geometry.instances)
            .filter_map(|(instance, placed)| (!apart(placed)).then_some(instance))
            .collect();
        let count = |&instance: &u32| {
            let mesh = geometry.instances[instance as usize].mesh;
            u64::from(geometry.meshes[mesh as usize].triangle_count)
        };
        let own: HashSet<u32> =
            geometry.instances.iter().filter(|placed| apart(placed)).map(|placed| placed.mesh).collect();
        let own = own.iter().map(|&mesh| u64::from(geometry.meshes[mesh as usize].triangle_count));
        check_count(own.sum::<u64>() + together.iter().map(count).sum::<u64>())?;
        if !together.is_empty() {
            let triangles = together.iter().flat_map(|&instance| geometry.instance_triangles(instance));
            meshes.append_in_world(0, triangles, together.iter().map(count).sum(), split)?;
        }
        let mut shared = vec![None; geometry.meshes.len()];
        for (instance, placed) in (0..).zip(&geometry.instances).filter(|(_, placed)| apart(placed)) {
            let Some(inverse) = inverse(&placed.transform) else {
                let triangles =
                    geometry.instance_triangles(instance).map(|t| WorldTriangle { instance: 0, ..t });
                meshes.append_in_world(instance, triangles, count(&instance), split)?;
                continue;
            };
            let known = &mut shared[placed.mesh as usize];
            let (root, solid) = match known {
                Some(known) => *known,
                None => {
                    let object = geometry.object_triangles(geometry.meshes[placed.mesh as usize]);
                    *known.insert(meshes.append(object, count(&instance), split)?)
                }
            };
            meshes.places.lower.push(Lower {
                instance,
                moves: placed.moves,
                root,
                solid,
                inverse: Some(inverse),
                transform: placed.transform,
                bounds: world_bounds(geometry.instance_triangles(instance)),
            });
        }
        Ok(meshes)
    }

    /// Adds nodes over triangles in the world, which are placed where they are.
    fn append_in_world(
        &mut self,
        instance: u32,
        triangles: impl Iterator<Item = WorldTriangle> + Clone,
        count: u64,
        split: bool,
    ) -> Result<(), Error> {
        let bounds = world_bounds(triangles.clone());
        let (root, solid) = self.append(triangles, count, split)?;
        let transform = Affine3A::IDENTITY;
        self.places.lower.push(Lower {
            instance,
            moves: false,
            root,
            solid,
            inverse: None,
            transform,
            bounds,
        });
        Ok(())
    }

    /// Adds nodes over triangles. Returns the first node, none where nothing has area, and whether no light passes what was
    /// added.
    fn append(
        &mut self,
        all: impl Iterator<Item = WorldTriangle>,
        count: u64,
        split: bool,
    ) -> Result<(Option<u32>, bool), Error> {
        super::room("triangles", count, HOST_BYTES)?;
        let mut known = HashSet::new();
        let mut solid = true;
        let mut triangles = Vec::new();
        for triangle in all {
            let opaque = !(triangle.blocks.masked || triangle.blocks.sheer);
            let bits = triangle.vertices.map(|vertex| vertex.to_array().map(f32::to_bits));
            if !super::has_area(triangle.vertices) || known.contains(&bits) {
                continue;
            }
            solid &= opaque;
            if opaque {
                known.insert(bits);
            }
            triangles.push(triangle);
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
        self.places.depth = self.places.depth.max(bvh.stack_depth);
        Ok((Some(first_node), solid))
    }
}

impl Places {
    /// Whether anything is to move.
    #[must_use]
    pub fn move_any(&self) -> bool {
        self.lower.iter().any(|lower| lower.moves)
    }

    /// Where `geometry` has what moves. None where a placement has lost its inverse: then its triangles are to be brought to
    /// the world.
    #[must_use]
    pub fn moved(&self, geometry: &Geometry) -> Option<Self> {
        let mut places = self.clone();
        for lower in places.lower.iter_mut().filter(|lower| lower.moves) {
            lower.transform = geometry.instances[lower.instance as usize].transform;
            lower.inverse = Some(inverse(&lower.transform)?);
            lower.bounds = world_bounds(geometry.instance_triangles(lower.instance));
        }
        let all = geometry.instances.iter().filter(|placed| placed.moves).count();
        (places.lower.iter().filter(|lower| lower.moves).count() == all).then_some(places)
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
            .lower
            .iter()
            .filter_map(|lower| Some((lower, lower.root?)))
            .filter(|(lower, _)| first(lower))
            .map(|(lower, root)| (lower.bounds, lower.record(root)))
            .collect();
        let (bounds, records): (Vec<Aabb>, Vec<Placement>) = placed.into_iter().unzip();
        let (tree, depth) = wide_tree(&bounds, TOP_DEPTH)?;
        let placements = tree.primitive_indices.iter().map(|&index| records[index as usize]).collect();
        let top = Top { nodes: tree.nodes, placements, depth };
        super::at_most("levels of nodes", self.stack_depth(&top).into(), MAX_STACK_DEPTH.into())?;
        Ok(top)
    }

    /// What kernels must set `STACK_DEPTH` to: of each level of nodes one entry can wait, and placements of one. What moves may
    /// come to have more levels above it.
    #[must_use]
    pub fn stack_depth(&self, top: &Top) -> u32 {
        let upper = if self.move_any() {
            top.depth.next_multiple_of(4).min(TOP_DEPTH.max(top.depth))
        } else {
            top.depth
        };
        upper + 1 + self.depth
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
    fn record(&self, root: u32) -> Placement {
        let placed = self.inverse.map(|inverse| (self.transform, inverse));
        let (transform, inverse) = placed.unwrap_or_default();
        let m = transform.matrix3;
        Placement {
            x: m.x_axis.to_array(),
            root,
            y: m.y_axis.to_array(),
            instance: self.instance,
            z: m.z_axis.to_array(),
            padding0: 0,
            at: transform.translation.to_array(),
            padding1: 0,
            inverse: inverse.to_cols_array_2d().map(|[x, y, z]| [x, y, z, 0.0]),
        }
    }
}

/// The box around triangles.
fn world_bounds(triangles: impl Iterator<Item = WorldTriangle>) -> Aabb {
    let all = |bounds: Aabb, triangle: WorldTriangle| {
        bounds.union(&Aabb::from_points(&triangle.vertices.map(Vec3A::from)))
    };
    triangles.fold(Aabb::INVALID, all)
}
