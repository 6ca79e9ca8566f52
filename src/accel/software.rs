//! The structure that kernels traverse themselves: an eight-wide compressed BVH over world triangles.
//!
//! Nodes of 80 bytes after Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through
//! Compressed Wide BVHs" (2017). A binned SAH build (Wald 2007) and `obvhs`' reinsertion (Meister and Bittner
//! 2018) make a binary tree, `obvhs`' dynamic programme collapses it. The binary build is ours because PLOC
//! takes quadratic time and linear depth on nested boxes; child boxes are requantised here because theirs may
//! be a rounding too small, and a closed mesh must not leak.
//!
//! Instances are flattened, 48 bytes a triangle and about 25 of nodes, unless [two levels](super::levels) are asked for or
//! take much less.

use super::boxes::{Bounds, Boxes};
use super::{Blocks, Error, Geometry, WorldTriangle};
use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::bvh2::{Bvh2, DEFAULT_MAX_STACK_DEPTH};
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::splits::split_aabbs_precise;
use obvhs::triangle::Triangle;

/// The deepest stack a kernel may ask for: with 64 invocations 12 KiB of the 16 KiB of shared memory that
/// every device has.
pub const MAX_STACK_DEPTH: u32 = crate::shaders::MAX_STACK_DEPTH;

/// `obvhs` counts seven decisions a binary node in 32 bits.
const MAX_TRIANGLES: u64 = 1 << 28;
/// How many of the binary tree's largest nodes reinsertion tries to place better. More gain little, and each
/// can cost a visit of every node.
const REINSERTIONS: f32 = 256.0;
/// Depth at which the SAH build starts to halve by count; the worst case adds log₂ of the triangles to it.
const SAH_DEPTH: u32 = 64;
const BINS: usize = 64;
/// Bytes of the host's memory that a triangle or box takes until the structure is on the device, which is in the same
/// memory where the device is a CPU: 305 were measured at the peak for 2 to 8 million.
pub(super) const HOST_BYTES: u64 = 384;

/// Bit of [`LeafTriangle::blocks`]: there may be a hole, by the material's alpha.
pub const MASKED: u32 = crate::shaders::LEAF_MASKED;
/// Some light may go straight through.
pub const SHEER: u32 = crate::shaders::LEAF_SHEER;
/// All of it is a pane.
pub const PANE: u32 = crate::shaders::LEAF_PANE;

/// A triangle in leaf order, as `glsl/trace/software.glsl` reads it: three 16-byte words.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct LeafTriangle {
    /// First vertex (m).
    pub a: [f32; 3],
    /// Instance, as in [`Geometry`].
    pub instance: u32,
    /// Second vertex (m).
    pub b: [f32; 3],
    /// Primitive, as in [`Geometry`].
    pub primitive: u32,
    /// Third vertex (m).
    pub c: [f32; 3],
    /// What a ray must ask of it: [`MASKED`], [`SHEER`] and [`PANE`].
    pub blocks: u32,
}

/// Nodes and triangles, ready for the device.
#[derive(Clone, Debug)]
pub struct SoftwareBvh {
    /// Nodes, the root first; a child comes after its parent.
    pub nodes: Vec<CwBvhNode>,
    /// Triangles in leaf order.
    pub triangles: Vec<LeafTriangle>,
    /// What kernels must set `STACK_DEPTH` to: no traversal holds more entries.
    pub stack_depth: u32,
}

impl SoftwareBvh {
    /// Builds the structure over all world triangles, deterministically and on the calling thread. With `split`,
    /// large slanted triangles lie in several leaves: fewer rays meet their boxes, and their own boxes are lost.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if the buffers would take more than `available_bytes`, [`Error::TooMany`] past 2²⁸
    /// triangles.
    pub fn build(geometry: &Geometry, split: bool, available_bytes: u64) -> Result<Self, Error> {
        let count = geometry.world_triangle_count();
        check_count(count)?;
        super::room("triangles", count, HOST_BYTES)?;
        let too_large = |bytes| Error::TooLarge { triangles: count, bytes, available: available_bytes };
        let triangle_bytes = count * size_of::<LeafTriangle>() as u64;
        if triangle_bytes > available_bytes {
            return Err(too_large(triangle_bytes));
        }

        // A placement can flatten triangles that had area.
        let triangles: Vec<WorldTriangle> =
            geometry.world_triangles().filter(|triangle| super::has_area(triangle.vertices)).collect();
        let bvh = Self::over(&triangles, split, MAX_STACK_DEPTH)?;
        if bvh.bytes() > available_bytes { Err(too_large(bvh.bytes())) } else { Ok(bvh) }
    }

    /// The same over these triangles, whatever they take.
    pub(super) fn over(triangles: &[WorldTriangle], split: bool, most_levels: u32) -> Result<Self, Error> {
        let bounds = |triangle: &WorldTriangle| Aabb::from_points(&triangle.vertices.map(Vec3A::from));
        let mut boxes: Vec<Aabb> = triangles.iter().map(bounds).collect();
        let of = if split { pre_split(triangles, &mut boxes) } else { (0..boxes.len() as u32).collect() };
        let (tree, stack_depth) = wide_tree(&boxes, most_levels)?;
        let triangle = |piece: &u32| leaf_triangle(&triangles[of[*piece as usize] as usize]);
        let triangles = tree.primitive_indices.iter().map(triangle).collect();
        Ok(Self { triangles, nodes: tree.nodes, stack_depth })
    }

    /// Device memory it takes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        (self.node_bytes().len() + self.triangle_bytes().len()) as u64
    }

    /// What `SceneData::bvh_nodes` points to; 16-byte alignment.
    #[must_use]
    pub fn node_bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.nodes)
    }

    /// What `SceneData::bvh_triangles` points to; 16-byte alignment. Empty for an empty scene.
    #[must_use]
    pub fn triangle_bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.triangles)
    }
}

/// Nodes over triangles' bounding boxes, ready for the device: 24 bytes a box, 16 more with planes, and about 25
/// of nodes.
#[derive(Clone, Debug)]
pub struct SoftwareBoxes {
    /// Nodes, the root first; a child comes after its parent.
    pub nodes: Vec<CwBvhNode>,
    /// Boxes in leaf order, planes with them if there are any.
    pub boxes: Boxes,
    /// What kernels must set `STACK_DEPTH` to: no traversal holds more entries.
    pub stack_depth: u32,
}

impl SoftwareBoxes {
    /// Builds the structure, deterministically and on the calling thread.
    ///
    /// # Errors
    /// [`Error::TooMany`] past 2²⁸ boxes.
    pub fn build(boxes: &Boxes) -> Result<Self, Error> {
        super::at_most("bounding boxes", boxes.bounds.len() as u64, MAX_TRIANGLES)?;
        super::room("triangles' boxes", boxes.bounds.len() as u64, HOST_BYTES)?;
        let aabb = |bounds: &Bounds| Aabb::new(bounds.low.into(), bounds.high.into());
        let (tree, stack_depth) =
            wide_tree(&boxes.bounds.iter().map(aabb).collect::<Vec<_>>(), MAX_STACK_DEPTH)?;
        let order = || tree.primitive_indices.iter().map(|&index| index as usize);
        let sorted = Boxes {
            bounds: order().map(|index| boxes.bounds[index]).collect(),
            planes: order().filter_map(|index| boxes.planes.get(index).copied()).collect(),
        };
        Ok(Self { nodes: tree.nodes, boxes: sorted, stack_depth })
    }

    /// What `SceneData::box_nodes` points to; 16-byte alignment.
    #[must_use]
    pub fn node_bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.nodes)
    }
}

pub(super) fn check_count(triangles: u64) -> Result<(), Error> {
    super::at_most("triangles with all instances counted", triangles, MAX_TRIANGLES)
}

/// The eight-wide tree over boxes, and its levels of nodes: more than `most_levels` only where halving by count makes more.
pub(super) fn wide_tree(boxes: &[Aabb], most_levels: u32) -> Result<(CwBvh, u32), Error> {
    let mut tree = collapse(&binary_tree(boxes, SAH_DEPTH, REINSERTIONS));
    let mut stack_depth = depth(&tree.nodes);
    if stack_depth > most_levels {
        tree = collapse(&binary_tree(boxes, 0, 0.0));
        stack_depth = depth(&tree.nodes);
    }
    super::at_most("levels of nodes", stack_depth.into(), MAX_STACK_DEPTH.into())?;
    requantise(&mut tree, boxes);
    Ok((tree, stack_depth))
}

/// Replaces the boxes of large triangles by several of their pieces (Ernst and Greiner 2007) where those are together
/// much smaller, and returns the triangle of each box. A box is split while its area is above average and its halves
/// have less than 1/1.5 of it (1/1.4 below twice the average), so there are never more than five times as many. On an
/// H100 this takes 15 % off scattered rays in the Conference room, which gets 17 % more boxes; splitting more, or
/// only the largest, gains less.
fn pre_split(triangles: &[WorldTriangle], boxes: &mut Vec<Aabb>) -> Vec<u32> {
    let mut of: Vec<u32> = (0..boxes.len() as u32).collect();
    let areas = || boxes.iter().map(Aabb::half_area);
    let largest = areas().fold(0.0, f32::max);
    let average = areas().sum::<f32>() / boxes.len().max(1) as f32;
    let high = (2.0 * average).max(0.9 * average + 0.1 * largest);
    if high.is_finite() {
        let corner = |triangle: &WorldTriangle, i: usize| Vec3A::from(triangle.vertices[i]);
        let corners = |t: &WorldTriangle| Triangle { v0: corner(t, 0), v1: corner(t, 1), v2: corner(t, 2) };
        let triangles: Vec<Triangle> = triangles.iter().map(corners).collect();
        split_aabbs_precise(boxes, &mut of, &triangles, average, high, 1.5, 1.4, 12, 12);
    }
    of
}

fn blocks_bits(blocks: Blocks) -> u32 {
    let bit = |holds, bit| if holds { bit } else { 0 };
    bit(blocks.masked, MASKED) | bit(blocks.sheer, SHEER) | bit(blocks.pane, PANE)
}

fn leaf_triangle(triangle: &WorldTriangle) -> LeafTriangle {
    let [a, b, c] = triangle.vertices.map(|vertex| vertex.to_array());
    LeafTriangle {
        a,
        instance: triangle.instance,
        b,
        primitive: triangle.primitive,
        c,
        blocks: blocks_bits(triangle.blocks),
    }
}

/// Collapses to eight children a node; an empty scene gets a root without children.
fn collapse(tree: &Bvh2) -> CwBvh {
    let mut wide = bvh2_to_cwbvh(tree, 3, true, false);
    if wide.nodes.is_empty() {
        wide.nodes.push(CwBvhNode::default());
    }
    wide
}

/// Levels of nodes, which bounds a traversal's stack: of each level but the last one entry can wait.
fn depth(nodes: &[CwBvhNode]) -> u32 {
    let mut levels = vec![1_u32; nodes.len()];
    for index in 0..nodes.len() {
        let first = nodes[index].child_base_idx as usize;
        for child in first..first + nodes[index].imask.count_ones() as usize {
            levels[child] = levels[index] + 1;
        }
    }
    levels.into_iter().max().unwrap_or(1)
}

/// A binary tree with one box a leaf. Below `sah_depth` levels, and where centroids coincide, it halves by
/// count, so that depth stays within `sah_depth` + ⌈log₂ boxes⌉ whatever the boxes are.
fn binary_tree(boxes: &[Aabb], sah_depth: u32, reinsertions: f32) -> Bvh2 {
    struct Task {
        node: usize,
        first: usize,
        end: usize,
        depth: u32,
    }
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    let centres: Vec<Vec3A> = boxes.iter().map(|b| b.min * 0.5 + b.max * 0.5).collect();
    let mut nodes = Vec::with_capacity((2 * boxes.len()).saturating_sub(1));
    let mut deepest = 0;
    let mut tasks = Vec::new();
    if !boxes.is_empty() {
        nodes.push(Bvh2Node::default());
        tasks.push(Task { node: 0, first: 0, end: boxes.len(), depth: 0 });
    }
    while let Some(Task { node, first, end, depth }) = tasks.pop() {
        deepest = deepest.max(depth);
        let part = &mut order[first..end];
        let bounds = part.iter().fold(Aabb::INVALID, |all, &i| all.union(&boxes[i as usize]));
        if part.len() == 1 {
            nodes[node] = Bvh2Node::new(bounds, 1, first as u32);
            continue;
        }
        let left = (depth < sah_depth)
            .then(|| split(part, boxes, &centres))
            .flatten()
            .unwrap_or_else(|| halve(part, &centres));
        let children = nodes.len();
        nodes[node] = Bvh2Node::new(bounds, 0, children as u32);
        nodes.resize(children + 2, Bvh2Node::default());
        let middle = first + left;
        tasks.push(Task { node: children + 1, first: middle, end, depth: depth + 1 });
        tasks.push(Task { node: children, first, end: middle, depth: depth + 1 });
    }
    let mut tree = Bvh2 {
        nodes,
        primitive_indices: order,
        children_are_ordered_after_parents: true,
        max_depth: DEFAULT_MAX_STACK_DEPTH.max(deepest as usize + 1),
        ..Bvh2::default()
    };
    let share = reinsertions / tree.nodes.len().max(1) as f32;
    ReinsertionOptimizer::default().run(&mut tree, share, None);
    tree
}

/// Partitions `part` at the cheapest of the bins' planes and returns how many lie left of it.
fn split(part: &mut [u32], boxes: &[Aabb], centres: &[Vec3A]) -> Option<usize> {
    let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for &i in part.iter() {
        low = low.min(centres[i as usize]);
        high = high.max(centres[i as usize]);
    }
    let scale = BINS as f32 * (1.0 - f32::EPSILON) / (high - low);
    let bin = |i: u32, axis: usize| (((centres[i as usize] - low) * scale)[axis] as usize).min(BINS - 1);

    let mut best = None;
    let mut best_cost = f32::INFINITY;
    for axis in (0..3).filter(|&axis| scale[axis].is_finite()) {
        let mut bins = [(Aabb::INVALID, 0_u32); BINS];
        for &i in part.iter() {
            let (bounds, count) = &mut bins[bin(i, axis)];
            *bounds = bounds.union(&boxes[i as usize]);
            *count += 1;
        }
        let mut right_costs = [0.0; BINS];
        let (mut bounds, mut count) = (Aabb::INVALID, 0);
        for plane in (1..BINS).rev() {
            bounds = bounds.union(&bins[plane].0);
            count += bins[plane].1;
            right_costs[plane] = if count > 0 { bounds.half_area() * count as f32 } else { f32::INFINITY };
        }
        (bounds, count) = (Aabb::INVALID, 0);
        for plane in 1..BINS {
            bounds = bounds.union(&bins[plane - 1].0);
            count += bins[plane - 1].1;
            let cost = bounds.half_area() * count as f32 + right_costs[plane];
            if count > 0 && cost < best_cost {
                best_cost = cost;
                best = Some((axis, plane));
            }
        }
    }
    let (axis, plane) = best?;
    let mut left = 0;
    for at in 0..part.len() {
        if bin(part[at], axis) < plane {
            part.swap(left, at);
            left += 1;
        }
    }
    Some(left)
}

/// Partitions `part` at the median of the widest axis of its centres.
fn halve(part: &mut [u32], centres: &[Vec3A]) -> usize {
    let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for &i in part.iter() {
        low = low.min(centres[i as usize]);
        high = high.max(centres[i as usize]);
    }
    let axis = Vec3::from(high - low).max_position();
    let middle = part.len() / 2;
    part.select_nth_unstable_by(middle, |&a, &b| {
        centres[a as usize][axis].total_cmp(&centres[b as usize][axis]).then(a.cmp(&b))
    });
    middle
}

/// Sets every node's grid and child boxes anew, from the triangles' boxes up, so that each decoded box
/// contains what it stands for.
fn requantise(tree: &mut CwBvh, boxes: &[Aabb]) {
    let mut bounds = vec![Aabb::INVALID; tree.nodes.len()];
    for index in (0..tree.nodes.len()).rev() {
        let mut node = tree.nodes[index];
        let mut children = [None; 8];
        for (slot, child) in children.iter_mut().enumerate() {
            if node.is_child_empty(slot) {
                continue;
            }
            let inside = if node.is_leaf(slot) {
                let (first, count) = node.child_primitives(slot);
                tree.primitive_indices[first as usize..(first + count) as usize]
                    .iter()
                    .fold(Aabb::INVALID, |all, &i| all.union(&boxes[i as usize]))
            } else {
                bounds[node.child_node_index(slot) as usize]
            };
            *child = Some(inside);
            bounds[index] = bounds[index].union(&inside);
        }
        let all = bounds[index];
        if children.iter().all(Option::is_none) {
            continue;
        }
        node.p = all.min.into();
        for axis in 0..3 {
            let (low, high) = (f64::from(all.min[axis]), f64::from(all.max[axis]));
            let exponent = grid_exponent(high - low);
            node.e[axis] = exponent;
            let cell = f64::from(f32::from_bits(u32::from(exponent) << 23));
            let (mins, maxs) = match axis {
                0 => (&mut node.child_min_x, &mut node.child_max_x),
                1 => (&mut node.child_min_y, &mut node.child_max_y),
                _ => (&mut node.child_min_z, &mut node.child_max_z),
            };
            for (slot, child) in children.iter().enumerate() {
                let Some(child) = child else { continue };
                mins[slot] = ((f64::from(child.min[axis]) - low) / cell).floor() as u8;
                maxs[slot] = ((f64::from(child.max[axis]) - low) / cell).ceil() as u8;
            }
        }
        tree.nodes[index] = node;
    }
}

/// The biased exponent of the smallest power of two of which 255 reach over `extent`, at least 2⁻¹⁰⁰.
fn grid_exponent(extent: f64) -> u8 {
    let mut exponent = 27_u8;
    while exponent < 254 && f64::from(f32::from_bits(u32::from(exponent) << 23)) * 255.0 < extent {
        exponent += 1;
    }
    exponent
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::{MeshRange, Placed, Source};
    use glam::{Affine3A, vec3};
    use proptest::prelude::*;

    fn geometry(triangles: &[[Vec3; 3]]) -> Geometry {
        let count = triangles.len() as u32;
        Geometry {
            positions: triangles.iter().flatten().copied().collect(),
            triangles: (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            source: vec![Source::default(); triangles.len()],
            meshes: vec![MeshRange { first_triangle: 0, triangle_count: count, masked_from: count }],
            instances: vec![Placed {
                mesh: 0,
                transform: Affine3A::IDENTITY,
                instance: u32::MAX,
                moves: false,
            }],
            deformed: Vec::new(),
        }
    }

    /// Every point of a triangle lies in all decoded boxes above a leaf that holds it, but for the rounding of 64 bits
    /// at the largest coordinate (kernels allow for 32; what splitting rounds is of 32 bits). Unsplit, a triangle is
    /// in one leaf.
    fn check(bvh: &SoftwareBvh, triangles: usize, split: bool) {
        let mut leaves = vec![Vec::<(LeafTriangle, Vec<[[f64; 2]; 3]>)>::new(); triangles];
        let coordinates = bvh.triangles.iter().flat_map(|t| [t.a, t.b, t.c]).flatten();
        let epsilon = if split { 4.0 * f64::from(f32::EPSILON) } else { 2.0 * f64::EPSILON };
        let rounding = epsilon * f64::from(coordinates.fold(0.0, |largest: f32, c| largest.max(c.abs())));
        let mut stack = vec![(0, Vec::<[[f64; 2]; 3]>::new(), 1)];
        while let Some((index, boxes, level)) = stack.pop() {
            assert!(level <= bvh.stack_depth);
            let node = &bvh.nodes[index];
            for slot in (0..8).filter(|&slot| !node.is_child_empty(slot)) {
                let cell = |axis: usize| f64::from(f32::from_bits(u32::from(node.e[axis]) << 23));
                let planes = [
                    [node.child_min_x[slot], node.child_max_x[slot]],
                    [node.child_min_y[slot], node.child_max_y[slot]],
                    [node.child_min_z[slot], node.child_max_z[slot]],
                ];
                let mut inside = boxes.clone();
                inside.push(std::array::from_fn(|axis| {
                    planes[axis].map(|q| f64::from(node.p[axis]) + f64::from(q) * cell(axis))
                }));
                if !node.is_leaf(slot) {
                    stack.push((node.child_node_index(slot) as usize, inside, level + 1));
                    continue;
                }
                let (first, count) = node.child_primitives(slot);
                for triangle in &bvh.triangles[first as usize..(first + count) as usize] {
                    leaves[triangle.primitive as usize].push((*triangle, inside.clone()));
                }
            }
        }
        for leaves in &leaves {
            assert!(if split { !leaves.is_empty() } else { leaves.len() == 1 });
            let [a, b, c] = [leaves[0].0.a, leaves[0].0.b, leaves[0].0.c].map(|v| v.map(f64::from));
            for (i, j) in
                (0..=4).flat_map(|i| (0..=4 - i).map(move |j| (f64::from(i) / 4.0, f64::from(j) / 4.0)))
            {
                let point: [f64; 3] =
                    std::array::from_fn(|axis| (1.0 - i - j) * a[axis] + i * b[axis] + j * c[axis]);
                let holds = |boxes: &Vec<[[f64; 2]; 3]>| {
                    boxes.iter().all(|b| {
                        b.iter()
                            .zip(point)
                            .all(|([low, high], p)| (low - rounding..=high + rounding).contains(&p))
                    })
                };
                assert!(leaves.iter().any(|(_, boxes)| holds(boxes)), "{point:?} is outside its boxes");
            }
        }
    }

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            4 => -1.0_f32..1.0,
            1 => prop::sample::select(vec![0.0_f32, 1.0, -1.0, 0.5, 1e-20, 1e-3, 1e4, 1e5, -1e5, 1.000_000_1]),
        ]
    }

    proptest! {
        #[test]
        fn boxes_contain_their_triangles(
            triangles in prop::collection::vec(prop::array::uniform9(coordinate()), 0..200)
        ) {
            let triangles: Vec<[Vec3; 3]> = triangles
                .iter()
                .map(|c| [vec3(c[0], c[1], c[2]), vec3(c[3], c[4], c[5]), vec3(c[6], c[7], c[8])])
                .filter(|&t| crate::accel::has_area(t))
                .collect();
            for split in [false, true] {
                let bvh = SoftwareBvh::build(&geometry(&triangles), split, u64::MAX).unwrap();
                check(&bvh, triangles.len(), split);
                prop_assert!(bvh.triangles.len() <= 5 * triangles.len());
            }
        }
    }

    #[test]
    fn an_empty_scene_has_a_root_without_children() {
        let bvh = SoftwareBvh::build(&Geometry::default(), true, u64::MAX).unwrap();
        assert_eq!((bvh.nodes.len(), bvh.triangles.len(), bvh.stack_depth), (1, 0, 1));
        check(&bvh, 0, true);
    }

    #[test]
    fn a_long_slanted_triangle_is_split_and_small_ones_are_not() {
        let mut triangles = vec![[Vec3::ZERO, vec3(10.0, 10.0, 0.0), vec3(10.0, 10.0, 1.0)]];
        triangles.extend((0..99).map(|i| [0.0, 0.1, 0.2].map(|x| vec3(i as f32 + x, x * x, 1.0 - x))));
        let bvh = SoftwareBvh::build(&geometry(&triangles), true, u64::MAX).unwrap();
        check(&bvh, triangles.len(), true);
        let leaves = |primitive| bvh.triangles.iter().filter(|t| t.primitive == primitive).count();
        assert!(leaves(0) > 4);
        assert!((1..100).all(|primitive| leaves(primitive) == 1));
    }

    #[test]
    fn halving_keeps_the_tree_within_the_stack() {
        // Boxes whose sizes double from one to the next are what SAH splits one at a time.
        let triangles: Vec<[Vec3; 3]> = (0..120)
            .map(|i| {
                let size = (0.5 * i as f32 - 30.0).exp2();
                [Vec3::splat(size), vec3(2.0 * size, size, 0.0), vec3(size, 0.0, 3.0 * size)]
            })
            .collect();
        let geometry = geometry(&triangles);
        let boxes: Vec<Aabb> = geometry
            .world_triangles()
            .map(|triangle| Aabb::from_points(&triangle.vertices.map(Vec3A::from)))
            .collect();
        let halved = collapse(&binary_tree(&boxes, 0, 0.0));
        assert!(depth(&halved.nodes) <= 7, "log₂ 120 rounded up");
        let bvh = SoftwareBvh::build(&geometry, false, u64::MAX).unwrap();
        assert!(bvh.stack_depth <= MAX_STACK_DEPTH);
        check(&bvh, triangles.len(), false);
    }

    #[test]
    fn a_build_repeats_bit_for_bit() {
        let triangles: Vec<[Vec3; 3]> = (0..500_u32)
            .map(|i| {
                let at = vec3((i * 7 % 31) as f32, (i * 11 % 17) as f32, (i % 5) as f32);
                [at, at + Vec3::X, at + Vec3::Y]
            })
            .collect();
        let geometry = geometry(&triangles);
        let [a, b] = [0; 2].map(|_| SoftwareBvh::build(&geometry, false, u64::MAX).unwrap());
        assert_eq!(a.node_bytes(), b.node_bytes());
        assert_eq!(a.triangle_bytes(), b.triangle_bytes());
    }
}
