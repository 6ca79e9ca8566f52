//! Meshes that a device brings into shape: those whose every vertex alone says where it goes, and nothing else of the scene
//! follows from.

use crate::scene::deformation::Deformation;
use crate::scene::import;
use crate::scene::limits::MAX_COORDINATE;
use crate::scene::mesh::is_small;
use crate::scene::shape::{MorphTarget, Shape};
use crate::scene::validate::invertible;
use crate::scene::{Instance, Material, Scene};
use glam::{DAffine3, DVec3, Vec3};
use std::collections::HashMap;

/// How far vertices of a shape may come.
#[derive(Debug)]
pub(super) struct Reach {
    /// What each joint moves; of what has no skin all.
    boxes: Vec<(Option<u32>, [DVec3; 2])>,
    /// What each morph target adds by weight 1.
    deltas: Vec<[DVec3; 2]>,
    materials: Vec<u32>,
    /// Where it is seen.
    instances: Vec<u32>,
}

impl Reach {
    /// None where a device cannot bring it into shape.
    pub(super) fn of(mesh: u32, shape: &Shape, parts: &Scene) -> Option<Self> {
        let rest = &parts.meshes[mesh as usize];
        let same = rest.tangents.is_empty() && shape.base.tangents.is_empty();
        let alike = rest.triangles == shape.base.triangles && rest.materials == shape.base.materials;
        let finite = |target: &MorphTarget| {
            target.positions.iter().chain(&target.normals).all(|delta| delta.is_finite())
        };
        if !same
            || !alike
            || !import::is_done(rest, parts.materials.len())
            || !shape.targets.iter().all(finite)
        {
            return None;
        }
        let mut boxes: Vec<(Option<u32>, [DVec3; 2])> = Vec::new();
        let mut place = HashMap::new();
        for (index, &position) in shape.base.positions.iter().enumerate() {
            let at = position.as_dvec3();
            let mut add = |joint: Option<u32>| {
                let of = *place.entry(joint).or_insert_with(|| {
                    boxes.push((joint, [at, at]));
                    boxes.len() - 1
                });
                let ends = &mut boxes[of].1;
                *ends = [ends[0].min(at), ends[1].max(at)];
            };
            match &shape.influences {
                Some(influences) => influences.vertex(index).iter().for_each(|&(joint, _)| add(Some(joint))),
                None => add(None),
            }
        }
        let delta = |target: &MorphTarget| {
            let zero = [DVec3::ZERO; 2];
            target.positions.iter().map(|d| d.as_dvec3()).fold(zero, |[l, h], d| [l.min(d), h.max(d)])
        };
        let mut materials = rest.materials.clone();
        materials.sort_unstable();
        materials.dedup();
        let placed = |(index, instance): (u32, &Instance)| (instance.mesh == mesh).then_some(index);
        let instances = (0..).zip(&parts.instances).filter_map(placed).collect();
        Some(Self { boxes, deltas: shape.targets.iter().map(delta).collect(), materials, instances })
    }

    /// Smallest and largest coordinates (m), none where something turns inside out or goes too far.
    fn bounds(&self, weights: &[f32], joints: &[DAffine3], origin: DVec3) -> Option<[Vec3; 2]> {
        let mut added = [DVec3::ZERO; 2];
        for (&weight, delta) in weights.iter().zip(&self.deltas) {
            let [a, b] = delta.map(|end| end * f64::from(weight));
            added = [added[0] + a.min(b), added[1] + a.max(b)];
        }
        let (mut low, mut high, mut largest) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0.0_f64);
        for (joint, ends) in &self.boxes {
            let ends = [ends[0] + added[0], ends[1] + added[1]];
            let joint = joint.map_or(DAffine3::IDENTITY, |joint| joints[joint as usize]);
            let m = joint.matrix3;
            if m.determinant() <= 0.0 {
                return None;
            }
            let (center, half) = ((ends[0] + ends[1]) * 0.5, (ends[1] - ends[0]) * 0.5);
            let center = m * center + (joint.translation - origin);
            let half = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
            low = low.min(center - half);
            high = high.max(center + half);
            let reach = ends[0].abs().max(ends[1].abs());
            let terms = m.x_axis.abs() * reach.x + m.y_axis.abs() * reach.y + m.z_axis.abs() * reach.z;
            largest = largest.max((terms + (joint.translation - origin).abs()).max_element());
        }
        // What 32 bits may round.
        let slack = DVec3::splat(largest * 1e-5);
        let ends = [(low - slack).as_vec3(), (high + slack).as_vec3()];
        let near = largest < f64::from(MAX_COORDINATE) && ends[0].is_finite() && ends[1].is_finite();
        (near && !is_small(&ends.map(|end| end * 0.25))).then_some(ends)
    }

    /// A deformation with its bounds if a device may do it, in a scene whose materials and places are those of the pose.
    pub(super) fn bounded(&self, deformation: &Deformation, scene: &Scene) -> Option<Deformation> {
        let plain = |material: &Material| !material.emits() && !material.may_transmit();
        let plain = self.materials.iter().all(|&material| plain(&scene.materials[material as usize]));
        let mut places = self.instances.iter().map(|&index| &scene.instances[index as usize].transform);
        let finite = deformation.weights.iter().all(|weight| weight.is_finite());
        if !plain || !finite || !places.all(invertible) {
            return None;
        }
        let bounds = self.bounds(&deformation.weights, &deformation.joints, deformation.origin)?;
        Some(Deformation { bounds, ..deformation.clone() })
    }
}
