//! Two levels for kernels to traverse: nodes over placements above nodes over each mesh's own triangles.
//!
//! A mesh is held once however often it is placed, 112 bytes a placement; where that is for the sake of what moves, all that
//! stays is placed together. Kernels test triangles in the world, rounded as where all lie in one level, so hits are the same
//! bit for bit; only boxes are met in object space.

use super::software::{HOST_BYTES, LeafTriangle, MAX_STACK_DEPTH, SoftwareBvh, check_count, wide_tree};
use super::{Error, Geometry, Placed, WorldTriangle, world_position};
use crate::scene::corners;
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
    /// Meshes to be brought into shape; their nodes and triangles come last.
    pub deforming: Vec<Deforming>,
}

/// Nodes over a mesh that is to be brought into shape.
#[derive(Clone, Debug, Default)]
pub struct Deforming {
    /// Index into [`Geometry::meshes`].
    pub mesh: u32,
    /// The first node, its root.
    pub first_node: u32,
    /// Nodes that it has room for.
    pub node_count: u32,
    /// The first triangle, in leaf order.
    pub first_triangle: u32,
    /// Triangles.
    pub triangle_count: u32,
    /// Of each triangle in leaf order its primitive and what a ray must ask of it.
    pub leaves: Vec<[u32; 2]>,
    /// Its nodes, those that hold triangles alone first and each above all that it holds.
    pub heights: Vec<Vec<u32>>,
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
        // Stable: what changes shape comes last.
        let mut order: Vec<(u32, &Placed)> =
            (0..).zip(&geometry.instances).filter(|(_, placed)| apart(placed)).collect();
        order.sort_by_key(|(_, placed)| geometry.deformed(placed.mesh).is_some());
        for (instance, placed) in order {
            let deformed = geometry.deformed(placed.mesh).is_some();
            let Some(inverse) = inverse(&placed.transform) else {
                debug_assert!(!deformed, "what changes shape can be placed");
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
                    *known.insert(if deformed {
                        meshes.append_deforming(placed.mesh, object)?
                    } else {
                        meshes.append(object, count(&instance), split)?
                    })
                }
            };
            meshes.places.lower.push(Lower {
                instance,
                moves: placed.moves,
                root,
                solid,
                inverse: Some(inverse),
                transform: placed.transform,
                bounds: placed_bounds(geometry, instance),
            });
        }
        meshes.places.lower.sort_by_key(|lower| lower.instance);
        Ok(meshes)
    }

    /// Builds nodes over meshes that are to be brought into shape alone.
    ///
    /// # Errors
    /// As for [`build`](Self::build).
    pub fn deforming(geometry: &Geometry) -> Result<Self, Error> {
        let mut meshes = Self::default();
        for mesh in (0..).take(geometry.deformed.len()).filter(|&mesh| geometry.deformed(mesh).is_some()) {
            let range = geometry.meshes[mesh as usize];
            check_count(range.triangle_count.into())?;
            meshes.append_deforming(mesh, geometry.object_triangles(range))?;
        }
        Ok(meshes)
    }

    /// Adds nodes over all triangles of a mesh that is to be brought into shape: they may come to coincide, and to part again.
    fn append_deforming(
        &mut self,
        mesh: u32,
        triangles: impl Iterator<Item = WorldTriangle>,
    ) -> Result<(Option<u32>, bool), Error> {
        let triangles: Vec<WorldTriangle> = triangles.collect();
        super::room("triangles", triangles.len() as u64, HOST_BYTES)?;
        let bvh = SoftwareBvh::over(&triangles, false, MESH_DEPTH)?;
        let (first_node, first_triangle) = (self.nodes.len() as u32, self.triangles.len() as u32);
        let packed = packed_levels(triangles.len() as u32);
        let room = bvh.nodes.len().max(packed.iter().sum::<u32>() as usize);
        self.places.depth = self.places.depth.max(bvh.stack_depth).max(packed.len() as u32);
        self.deforming.push(Deforming {
            mesh,
            first_node,
            node_count: room as u32,
            first_triangle,
            triangle_count: triangles.len() as u32,
            leaves: bvh.triangles.iter().map(|leaf| [leaf.primitive, leaf.blocks]).collect(),
            heights: heights(&bvh.nodes, first_node),
        });
        self.add(bvh);
        self.nodes.resize(first_node as usize + room, CwBvhNode::default());
        Ok((Some(first_node), false))
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
        self.places.depth = self.places.depth.max(bvh.stack_depth);
        Ok((Some(self.add(bvh)), solid))
    }

    /// Adds a tree, and returns its first node.
    fn add(&mut self, bvh: SoftwareBvh) -> u32 {
        let (first_node, first_triangle) = (self.nodes.len() as u32, self.triangles.len() as u32);
        self.nodes.extend(bvh.nodes.into_iter().map(|node| CwBvhNode {
            child_base_idx: node.child_base_idx + first_node,
            primitive_base_idx: node.primitive_base_idx + first_triangle,
            ..node
        }));
        self.triangles.extend(bvh.triangles);
        first_node
    }
}

/// Nodes by how far they are from the triangles below them.
fn heights(nodes: &[CwBvhNode], first_node: u32) -> Vec<Vec<u32>> {
    let mut height = vec![0_usize; nodes.len()];
    for index in (0..nodes.len()).rev() {
        let first = nodes[index].child_base_idx as usize;
        let children = first..first + nodes[index].imask.count_ones() as usize;
        height[index] = children.map(|child| height[child] + 1).max().unwrap_or(0);
    }
    let mut all = vec![Vec::new(); height.iter().max().map_or(0, |top| top + 1)];
    for (index, height) in (0..).zip(height) {
        all[height].push(first_node + index);
    }
    all
}

/// Nodes of each level, the root's first, of a full tree of eight children a node over so many triangles.
#[must_use]
pub fn packed_levels(triangles: u32) -> Vec<u32> {
    let mut levels = vec![triangles.div_ceil(8).max(1)];
    while let Some(&below @ 2..) = levels.last() {
        levels.push(below.div_ceil(8));
    }
    levels.reverse();
    levels
}

/// Whether what is placed so can be told from where it is.
pub(crate) fn is_placeable(transform: &Affine3A) -> bool {
    inverse(transform).is_some()
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
            lower.bounds = placed_bounds(geometry, lower.instance);
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

/// The box around an instance's triangles, as far as they may come.
fn placed_bounds(geometry: &Geometry, instance: u32) -> Aabb {
    let placed = &geometry.instances[instance as usize];
    match geometry.deformed(placed.mesh) {
        Some(ends) => {
            Aabb::from_points(&corners(ends).map(|corner| world_position(&placed.transform, corner).into()))
        }
        None => world_bounds(geometry.instance_triangles(instance)),
    }
}

/// The box around triangles.
fn world_bounds(triangles: impl Iterator<Item = WorldTriangle>) -> Aabb {
    let all = |bounds: Aabb, triangle: WorldTriangle| {
        bounds.union(&Aabb::from_points(&triangle.vertices.map(Vec3A::from)))
    };
    triangles.fold(Aabb::INVALID, all)
}
