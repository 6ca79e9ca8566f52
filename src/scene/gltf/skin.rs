//! Skins: vertices are where the joints' nodes have them (glTF 2.0, section 3.7.3.3), whatever the mesh's own node says.

use super::context::Context;
use crate::scene::SceneError;
use crate::scene::motion::rig;
use crate::scene::shape::Influences;
use ::gltf::json::accessor::{ComponentType, Type};
use ::gltf::json::mesh::{Primitive, Semantic};
use ::gltf::json::validation::Checked;
use glam::{DAffine3, DMat4};
use std::sync::Arc;

/// A skin that a node wears.
pub(super) struct Skin {
    index: usize,
    pub(super) source: Arc<rig::Skin>,
    /// At rest, from the mesh's space to the world: its joints, and the node that wears it for what no joint moves.
    pub(super) joints: Vec<DAffine3>,
}

impl Skin {
    /// How far from the origin its joints are (m).
    pub(super) fn reach(&self) -> f64 {
        let joints = &self.joints[..self.joints.len() - 1];
        joints.iter().map(|joint| joint.translation.length()).fold(0.0, f64::max)
    }
}

/// Transforms of nodes in the world that were asked for.
pub(super) struct Worlds {
    exact: bool,
    known: Vec<Option<DAffine3>>,
}

impl Context<'_> {
    /// With all digits of the nodes' numbers, if `exact`.
    pub(super) fn worlds(&self, exact: bool) -> Worlds {
        Worlds { exact, known: vec![None; self.root.nodes.len()] }
    }

    fn world(&self, node: usize, worlds: &mut Worlds) -> Result<DAffine3, SceneError> {
        let mut way = Vec::new();
        let (mut world, mut at) = (DAffine3::IDENTITY, Some(node));
        while let Some(node) = at {
            if let Some(known) = worlds.known[node] {
                world = known;
                break;
            }
            way.push(node);
            at = self.parents[node];
        }
        for node in way.into_iter().rev() {
            world *= self.local_transform(node, worlds.exact)?;
            worlds.known[node] = Some(world);
        }
        Ok(world)
    }

    /// Skin `index`, worn by a node that is placed by `node`; none where its matrices are not such.
    pub(super) fn skin(
        &self,
        index: usize,
        node: DAffine3,
        worlds: &mut Worlds,
    ) -> Result<Option<Skin>, SceneError> {
        let source = &self.root.skins[index];
        let element = format!("skins[{index}]");
        let count = source.joints.len();
        // They are gone before the next.
        let mut transient = *self.budget.borrow();
        let bytes = count as u64 * size_of::<[DAffine3; 2]>() as u64;
        transient.take(bytes).map_err(|shortage| self.fault(&element, shortage))?;
        let mut inverse_bind = Vec::new();
        if let Some(accessor) = source.inverse_bind_matrices {
            let elements = self.elements(accessor.value())?;
            if (elements.component, elements.shape) != (ComponentType::F32, Type::Mat4) {
                let problem = format!("accessors[{accessor}] can't be matrices: they are MAT4 of floats");
                return Err(self.error(element, problem));
            }
            if elements.count < count {
                let problem = format!("{} inverse bind matrices for {count} joints", elements.count);
                return Err(self.error(element, problem));
            }
            for matrix in elements.floats::<16>(0..count)? {
                if let Err(defect) = self.check_last_row(&element, &matrix) {
                    self.mended.mend(
                        self.file,
                        defect,
                        "it is left out: its meshes are where their nodes are",
                    )?;
                    return Ok(None);
                }
                inverse_bind.push(DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from))));
            }
        }
        let joints = source.joints.iter().map(|joint| joint.value() as u32).collect();
        let source = Arc::new(rig::Skin { joints, inverse_bind });
        let joints = source.transforms(|joint| self.world(joint as usize, worlds), node)?;
        if joints.iter().any(|joint| !joint.is_finite()) {
            return Err(self.error(element, "a joint's transform is too large"));
        }
        Ok(Some(Skin { index, source, joints }))
    }

    /// The last row of a matrix is 0 0 0 1, but for rounding.
    pub(super) fn check_last_row(&self, element: &str, matrix: &[f32; 16]) -> Result<(), SceneError> {
        let row = [matrix[3], matrix[7], matrix[11], matrix[15]];
        let off = row.iter().zip([0.0, 0.0, 0.0, 1.0]).map(|(e, wanted)| (e - wanted).abs());
        let off = off.fold(0.0, f32::max);
        if off <= 0.0 {
            return Ok(());
        }
        let problem = format!("the last row of its matrix is not 0 0 0 1 but {row:?}");
        if off < 1e-4 {
            self.mend(element, problem, "it is rounded")
        } else {
            Err(self.error(element, problem))
        }
    }

    /// Appends which joints move the `used` vertices.
    pub(super) fn influences(
        &self,
        all: &mut Influences,
        primitive: &Primitive,
        element: &str,
        skin: &Skin,
        used: &[u32],
    ) -> Result<(), SceneError> {
        let (Some(&first), Some(&last)) = (used.first(), used.last()) else { return Ok(()) };
        let range = first as usize..last as usize + 1;
        let mut sets = Vec::new();
        let has = |semantic| primitive.attributes.contains_key(&Checked::Valid(semantic));
        for set in (0..).take_while(|&set| has(Semantic::Joints(set)) && has(Semantic::Weights(set))) {
            let joints = self.attribute(primitive, element, Semantic::Joints(set))?;
            let weights = self.attribute(primitive, element, Semantic::Weights(set))?;
            let (Some(joints), Some(weights)) = (joints, weights) else { break };
            sets.push((joints.integers::<4>(range.clone())?, weights.floats::<4>(range.clone())?));
        }
        let count = skin.source.joints.len() as u32;
        self.take::<u32>(used.len()).map_err(|shortage| self.fault(element, shortage))?;
        if sets.is_empty() || count == 0 {
            let problem = format!("its node wears skins[{}], but it names no joints", skin.index);
            self.mend(element, problem, "it is where its node is")?;
            self.take::<(u32, f32)>(used.len()).map_err(|shortage| self.fault(element, shortage))?;
            for _ in used {
                all.of.push((count, 1.0));
                all.ends.push(all.of.len() as u32);
            }
            return Ok(());
        }
        self.take::<[(u32, f32); 4]>(used.len() * sets.len())
            .map_err(|shortage| self.fault(element, shortage))?;
        let joint = |vertex: u32, joint: u32| {
            if joint < count {
                return Ok(joint);
            }
            let problem =
                format!("vertex {vertex} is of joint {joint}, but skins[{}] has {count}", skin.index);
            Err(self.error(element, problem))
        };
        for &vertex in used {
            let at = (vertex - first) as usize;
            let mut sum = 0.0;
            for (joints, weights) in &sets {
                for (&index, &weight) in
                    joints[at].iter().zip(&weights[at]).filter(|(_, weight)| **weight != 0.0)
                {
                    if weight < 0.0 {
                        return Err(self.error(element, format!("vertex {vertex} has the weight {weight}")));
                    }
                    all.of.push((joint(vertex, index)?, weight));
                    sum += f64::from(weight);
                }
            }
            if sum > 0.0 {
                // Integers of 8 bits leave as much.
                if (sum - 1.0).abs() > 0.02 {
                    let problem = format!("weights of vertex {vertex} add up to {sum}");
                    self.mend(element, problem, "they are made to add up to 1")?;
                }
            } else {
                let problem = format!("vertex {vertex} has no weight");
                self.mend(element, problem, "such vertices follow their first joint")?;
                all.of.push((joint(vertex, sets[0].0[at][0])?, 1.0));
            }
            all.ends.push(all.of.len() as u32);
        }
        Ok(())
    }
}
