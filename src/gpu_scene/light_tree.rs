//! A tree over lights with a place, for choosing one by what it can give a point (Conty Estevez & Kulla, "Importance
//! Sampling of Many Lights with Adaptive Tree Splitting", 2018). `glsl/lib/light_sampler.glsl` descends it.

use crate::shaders::{LIGHT_NODE_DELTA, LIGHT_NODE_LEAF, LIGHT_NODE_TWO_SIDED, LightNode};
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// Where the nodes of emissive triangles begin and those of other lights, and what has both below it.
pub(super) const JOINT_ROOT: u32 = 0;
pub(super) const EMITTER_ROOT: u32 = 2;
pub(super) const DELTA_ROOT: u32 = 3;
pub(super) const FIRST_NODE: usize = 4;

/// Centroids are sorted into so many bins along an axis.
const BINS: usize = 12;

/// What cones are widened by (radians): more than 32-bit cosines lose.
const SLACK: f64 = 1e-3;

/// Where a light is, and where it shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    low: DVec3,
    high: DVec3,
    /// Of a sphere around it.
    center: DVec3,
    radius: f64,
    /// Of a cone that all normals are in, with its half angle.
    axis: DVec3,
    spread: f64,
    /// Greatest angle from a normal that light leaves at.
    reach: f64,
    two_sided: bool,
    /// W/sr towards where it shines most, all channels.
    intensity: f64,
}

impl Bounds {
    /// A triangle that emits on the side of its normal times `side`, or on both.
    pub(super) fn of_triangle([a, b, c]: [DVec3; 3], side: f64, two_sided: bool, intensity: f64) -> Self {
        let across = (b - a).cross(c - a);
        let center = (a + b + c) / 3.0;
        let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
        // 32 bits do not know which way a sliver faces.
        let sliver = across.length() < 1e-4 * longest;
        Self {
            low: a.min(b).min(c),
            high: a.max(b).max(c),
            center,
            radius: [a, b, c].map(|v| v.distance(center)).into_iter().fold(0.0, f64::max),
            axis: (across * side).try_normalize().unwrap_or(DVec3::Z),
            spread: if sliver { PI } else { 0.0 },
            reach: 0.5 * PI,
            two_sided: two_sided || sliver,
            intensity,
        }
    }

    /// A light without size that shines `reach` (radians) around `axis`; all around from π.
    pub(super) fn of_point(at: DVec3, axis: DVec3, reach: f64, intensity: f64) -> Self {
        let (spread, reach) = if reach < PI { (0.0, reach) } else { (PI, 0.5 * PI) };
        let axis = axis.try_normalize().unwrap_or(DVec3::Z);
        Self { low: at, high: at, center: at, radius: 0.0, axis, spread, reach, two_sided: false, intensity }
    }

    fn union(self, other: Self) -> Self {
        let (low, high) = (self.low.min(other.low), self.high.max(other.high));
        let (axis, spread) = cone(&self, &other);
        let center = 0.5 * (low + high);
        let around = |b: &Self| b.center.distance(center) + b.radius;
        Self {
            low,
            high,
            center,
            radius: low.distance(center).min(around(&self).max(around(&other))),
            axis,
            spread,
            reach: self.reach.max(other.reach),
            two_sided: self.two_sided || other.two_sided,
            intensity: self.intensity + other.intensity,
        }
    }

    /// What descending to it is expected to cost (surface area orientation heuristic): intensity times the solid angle of
    /// its cone, weighted by cosine, times the surface of the sphere around its box.
    fn cost(&self) -> f64 {
        let (o, w) = (self.spread, (self.spread + self.reach).min(PI));
        let (sin, cos) = o.sin_cos();
        let beyond = 0.5 * PI * (2.0 * w * sin - (o - 2.0 * w).cos() - 2.0 * o * sin + cos);
        let around = 2.0 * PI * (1.0 - cos) + beyond;
        self.intensity * around * self.low.distance_squared(self.high)
    }

    fn node(&self, unit: f64, child: u32, parent: u32) -> LightNode {
        let two_sided = if self.two_sided { LIGHT_NODE_TWO_SIDED } else { 0 };
        LightNode {
            center: self.center.as_vec3().to_array(),
            radius: (self.radius * (1.0 + 1e-6)) as f32,
            axis: self.axis.as_vec3().to_array(),
            // A light that gives next to nothing is still chosen now and then.
            intensity: (self.intensity * unit).max(1e-12) as f32,
            cos_spread: self.spread.cos() as f32,
            cos_reach: (self.reach + SLACK).cos() as f32,
            child: child | two_sided,
            parent,
        }
    }
}

/// Axis and half angle of a cone around those of two.
fn cone(a: &Bounds, b: &Bounds) -> (DVec3, f64) {
    let (wide, narrow) = if a.spread >= b.spread { (a, b) } else { (b, a) };
    // Triangles that shine on both sides have no front.
    let turned = wide.two_sided && narrow.two_sided && wide.axis.dot(narrow.axis) < 0.0;
    let narrow_axis = if turned { -narrow.axis } else { narrow.axis };
    let between = wide.axis.angle_between(narrow_axis);
    if (between + narrow.spread).min(PI) <= wide.spread {
        return (wide.axis, wide.spread);
    }
    let spread = 0.5 * (wide.spread + between + narrow.spread);
    match wide.axis.cross(narrow_axis).try_normalize() {
        Some(around) if spread < PI => {
            (DQuat::from_axis_angle(around, spread - wide.spread) * wide.axis, spread)
        }
        // Neighbours in all 64 bits, or opposite.
        None if between < 1.0 => (wide.axis, spread),
        _ => (wide.axis, PI),
    }
}

/// One of [`Subtree::nodes`].
#[derive(Clone, Debug)]
struct Node {
    bounds: Bounds,
    /// First of two children, or which light this is.
    child: u32,
    leaf: bool,
    parent: u32,
}

/// A tree over lights of one kind. The root comes first, siblings side by side.
#[derive(Clone, Debug, Default)]
pub(super) struct Subtree {
    nodes: Vec<Node>,
}

impl Subtree {
    pub(super) fn of(lights: &[Bounds]) -> Self {
        let mut tree = Self::default();
        let mut items: Vec<(u32, Bounds)> = (0..).zip(lights.iter().copied()).collect();
        if !items.is_empty() {
            tree.nodes.push(Node { bounds: lights[0], child: 0, leaf: false, parent: 0 });
            tree.build(0, &mut items);
        }
        tree
    }

    /// Other numbers for the lights that leaves name.
    pub(super) fn name_leaves(&mut self, name: impl Fn(u32) -> u32) {
        self.nodes.iter_mut().filter(|node| node.leaf).for_each(|node| node.child = name(node.child));
    }

    fn build(&mut self, place: usize, items: &mut [(u32, Bounds)]) {
        if let [(light, bounds)] = *items {
            self.nodes[place] = Node { bounds, child: light, leaf: true, ..self.nodes[place] };
            return;
        }
        let middle = split(items);
        let (left, right) = items.split_at_mut(middle);
        let first = self.nodes.len();
        let child = Node { bounds: left[0].1, child: 0, leaf: false, parent: place as u32 };
        self.nodes.extend([child.clone(), child]);
        self.build(first, left);
        self.build(first + 1, right);
        self.nodes[place].bounds = self.nodes[first].bounds.union(self.nodes[first + 1].bounds);
        self.nodes[place].child = first as u32;
    }
}

/// Sorts lights into two groups, neither empty; how many are in the first.
fn split(items: &mut [(u32, Bounds)]) -> usize {
    let centers = items.iter().map(|(_, b)| b.center);
    let (low, high) = centers.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), c| (l.min(c), h.max(c)));
    let extent = high - low;
    let bin = |b: &Bounds, axis: usize| {
        (((b.center[axis] - low[axis]) / extent[axis] * BINS as f64) as usize).min(BINS - 1)
    };
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| extent[axis] > 0.0) {
        let mut bins = [None::<Bounds>; BINS];
        for (_, bounds) in items.iter() {
            let bin = &mut bins[bin(bounds, axis)];
            *bin = join(*bin, Some(*bounds));
        }
        let mut above = [None; BINS];
        let mut all = None;
        for i in (0..BINS).rev() {
            all = join(all, bins[i]);
            above[i] = all;
        }
        let mut below = None;
        for i in 1..BINS {
            below = join(below, bins[i - 1]);
            let (Some(left), Some(right)) = (below, above[i]) else { continue };
            // Thin slabs are split across.
            let cost = (left.cost() + right.cost()) * (extent.max_element() / extent[axis]);
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, i));
            }
        }
    }
    let Some((_, axis, first)) = best else { return items.len() / 2 };
    // Those in the first bins come first, in their order: the tree is the same whoever builds it.
    items.sort_by_key(|(_, bounds)| bin(bounds, axis) >= first);
    items.partition_point(|(_, bounds)| bin(bounds, axis) < first)
}

fn join(a: Option<Bounds>, b: Option<Bounds>) -> Option<Bounds> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(b)),
        (a, b) => a.or(b),
    }
}

/// Both trees as the device reads them: at [`JOINT_ROOT`] what has both below it, at [`EMITTER_ROOT`] and [`DELTA_ROOT`]
/// each. Without lights none of them is any.
pub(super) fn nodes(emitters: &Subtree, deltas: &Subtree) -> Vec<LightNode> {
    let roots = [emitters, deltas].map(|tree| tree.nodes.first().map(|node| node.bounds));
    let mut nodes = vec![LightNode::default(); FIRST_NODE];
    let Some(all) = join(roots[0], roots[1]) else { return nodes };
    let unit = 1.0 / all.intensity;
    nodes[JOINT_ROOT as usize] = all.node(unit, EMITTER_ROOT, JOINT_ROOT);
    for (tree, root, kind) in [(emitters, EMITTER_ROOT, 0), (deltas, DELTA_ROOT, LIGHT_NODE_DELTA)] {
        // All but the root go behind what is there.
        let behind = nodes.len() as u32 - 1;
        let placed = |i: u32| if i == 0 { root } else { behind + i };
        for (node, i) in tree.nodes.iter().zip(0..) {
            let child = if node.leaf { node.child | LIGHT_NODE_LEAF | kind } else { placed(node.child) };
            let parent = if i == 0 { JOINT_ROOT } else { placed(node.parent) };
            let node = node.bounds.node(unit, child, parent);
            if i == 0 {
                nodes[root as usize] = node;
            } else {
                nodes.push(node);
            }
        }
    }
    nodes
}

/// Where in [`nodes`] each emitter's leaf is.
pub(super) fn emitter_leaves(emitters: &Subtree, count: usize) -> Vec<u32> {
    let mut leaves = vec![EMITTER_ROOT; count];
    for (node, i) in emitters.nodes.iter().zip(0..).filter(|(node, i)| node.leaf && *i > 0) {
        leaves[node.child as usize] = FIRST_NODE as u32 - 1 + i;
    }
    leaves
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every light is in one leaf, nodes hold all that is below them, and links lead back; also of lights at one place.
    #[test]
    fn nodes_hold_what_is_below_them() {
        let number = |i: u32| f64::from(crate::sampling::halton(0, i + 1, 0));
        let vector = |i: u32| DVec3::new(number(3 * i), number(7 * i + 1), number(5 * i + 2)) - 0.5;
        let corners = |i: u32| [i, i + 1, i + 2].map(|k| 10.0 * vector(i / 3) + vector(k));
        let lamp = |i: u32| Bounds::of_triangle(corners(i), 1.0, i.is_multiple_of(4), number(i) + 0.1);
        for (emitters, points) in [(0, 0), (1, 0), (0, 1), (2, 3), (200, 60)] {
            let lamps: Vec<_> = (0..emitters).map(lamp).collect();
            let spot = |i: u32| {
                Bounds::of_point(vector(i / 30), vector(i), if i.is_multiple_of(2) { PI } else { 0.4 }, 1.0)
            };
            let spots: Vec<_> = (0..points).map(spot).collect();
            let (emitter_tree, delta_tree) = (Subtree::of(&lamps), Subtree::of(&spots));
            let nodes = nodes(&emitter_tree, &delta_tree);
            let leaves = emitter_leaves(&emitter_tree, lamps.len());
            let mut found = [vec![0; lamps.len()], vec![0; spots.len()]];
            for (place, node) in nodes.iter().enumerate().filter(|(_, node)| node.intensity > 0.0) {
                let index = (node.child & crate::shaders::LIGHT_NODE_INDEX) as usize;
                if node.child & LIGHT_NODE_LEAF == 0 {
                    assert!(index.is_multiple_of(2) && index > place);
                    continue;
                }
                let delta = node.child & LIGHT_NODE_DELTA != 0;
                found[usize::from(delta)][index] += 1;
                let light = if delta { spots[index] } else { lamps[index] };
                assert!(delta || leaves[index] as usize == place);
                let points = if delta { [light.center; 3] } else { corners(index as u32) };
                let mut up = place as u32;
                while up != JOINT_ROOT {
                    let parent = nodes[up as usize].parent;
                    let above = nodes[parent as usize];
                    let first = above.child & crate::shaders::LIGHT_NODE_INDEX;
                    assert!(parent == JOINT_ROOT || first == up & !1);
                    let center = glam::Vec3::from(above.center).as_dvec3();
                    assert!(points.iter().all(|p| p.distance(center) <= f64::from(above.radius) + 1e-5));
                    let cosine = glam::Vec3::from(above.axis).as_dvec3().dot(light.axis);
                    let cosine = if above.child & LIGHT_NODE_TWO_SIDED != 0 { cosine.abs() } else { cosine };
                    let spread = f64::from(above.cos_spread).clamp(-1.0, 1.0).acos() + SLACK;
                    assert!(cosine.clamp(-1.0, 1.0).acos() + light.spread <= spread || spread >= PI);
                    up = parent;
                }
            }
            assert!(found.iter().flatten().all(|&times| times == 1), "{emitters} and {points}");
            let root = nodes[JOINT_ROOT as usize].intensity;
            assert!(emitters + points == 0 || (root - 1.0).abs() < 1e-6);
        }
    }
}
