//! Skins at rest: vertices where the joints' nodes have them (glTF 2.0, section 3.7.3.3), whatever the mesh's own node says.

use super::context::Context;
use crate::scene::SceneError;
use ::gltf::json::accessor::{ComponentType, Type};
use ::gltf::json::mesh::{Primitive, Semantic};
use ::gltf::json::validation::Checked;
use glam::{DAffine3, DMat3, DMat4, DVec3};

/// A skin that a node wears.
pub(super) struct Skin {
    index: usize,
    /// From the mesh's space to the world, by joint.
    joints: Vec<DAffine3>,
    /// The node's, for primitives that no joint moves.
    node: DAffine3,
}

impl Skin {
    /// How far from the origin its joints are (m).
    pub(super) fn reach(&self) -> f64 {
        self.joints.iter().map(|joint| joint.translation.length()).fold(0.0, f64::max)
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
        let mut joints = Vec::with_capacity(count);
        for joint in &source.joints {
            joints.push(self.world(joint.value(), worlds)?);
        }
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
            let matrices = elements.floats::<16>(0..count)?;
            for (joint, matrix) in joints.iter_mut().zip(&matrices) {
                if let Err(defect) = self.check_last_row(&element, matrix) {
                    self.mended.mend(
                        self.file,
                        defect,
                        "it is left out: its meshes are where their nodes are",
                    )?;
                    return Ok(None);
                }
                let matrix = DMat4::from_cols_array(&matrix.map(f64::from));
                *joint *= DAffine3::from_mat4(matrix);
            }
        }
        if joints.iter().any(|joint| !joint.is_finite()) {
            return Err(self.error(element, "a joint's transform is too large"));
        }
        Ok(Some(Skin { index, joints, node }))
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

    /// From the mesh's space to the world, for each of the `used` vertices: the mean of their joints' transforms.
    pub(super) fn blend(
        &self,
        primitive: &Primitive,
        element: &str,
        skin: &Skin,
        used: &[u32],
    ) -> Result<Vec<DAffine3>, SceneError> {
        let (Some(&first), Some(&last)) = (used.first(), used.last()) else { return Ok(Vec::new()) };
        let range = first as usize..last as usize + 1;
        self.take::<DAffine3>(used.len()).map_err(|shortage| self.fault(element, shortage))?;
        let mut sets = Vec::new();
        let has = |semantic| primitive.attributes.contains_key(&Checked::Valid(semantic));
        for set in (0..).take_while(|&set| has(Semantic::Joints(set)) && has(Semantic::Weights(set))) {
            let joints = self.attribute(primitive, element, Semantic::Joints(set))?;
            let weights = self.attribute(primitive, element, Semantic::Weights(set))?;
            let (Some(joints), Some(weights)) = (joints, weights) else { break };
            sets.push((joints.integers::<4>(range.clone())?, weights.floats::<4>(range.clone())?));
        }
        if sets.is_empty() || skin.joints.is_empty() {
            let problem = format!("its node wears skins[{}], but it names no joints", skin.index);
            self.mend(element, problem, "it is where its node is")?;
            return Ok(vec![skin.node; used.len()]);
        }
        let joint = |vertex: u32, joint: u32| {
            skin.joints.get(joint as usize).ok_or_else(|| {
                let (index, count) = (skin.index, skin.joints.len());
                let problem = format!("vertex {vertex} is of joint {joint}, but skins[{index}] has {count}");
                self.error(element, problem)
            })
        };
        let mut blend = Vec::with_capacity(used.len());
        for &vertex in used {
            let at = (vertex - first) as usize;
            let (mut matrix, mut translation, mut sum) = (DMat3::ZERO, DVec3::ZERO, 0.0);
            for (joints, weights) in &sets {
                for (&index, &weight) in
                    joints[at].iter().zip(&weights[at]).filter(|(_, weight)| **weight != 0.0)
                {
                    if weight < 0.0 {
                        return Err(self.error(element, format!("vertex {vertex} has the weight {weight}")));
                    }
                    let (joint, weight) = (joint(vertex, index)?, f64::from(weight));
                    matrix += joint.matrix3 * weight;
                    translation += joint.translation * weight;
                    sum += weight;
                }
            }
            if sum > 0.0 {
                // Integers of 8 bits leave as much.
                if (sum - 1.0).abs() > 0.02 {
                    let problem = format!("weights of vertex {vertex} add up to {sum}");
                    self.mend(element, problem, "they are made to add up to 1")?;
                }
                blend.push(DAffine3 { matrix3: matrix * sum.recip(), translation: translation / sum });
            } else {
                let problem = format!("vertex {vertex} has no weight");
                self.mend(element, problem, "such vertices follow their first joint")?;
                blend.push(*joint(vertex, sets[0].0[at][0])?);
            }
        }
        Ok(blend)
    }
}

/// The direction of a normal or, if `along` the surface, of a tangent behind a transform; zero where it leaves none.
pub(super) fn turned(transform: &DAffine3, direction: DVec3, along: bool) -> DVec3 {
    let m = &transform.matrix3;
    if along {
        return (*m * direction).normalize_or_zero();
    }
    // The cofactor matrix carries normals whatever the scaling.
    let [x, y, z] = [m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis)];
    (mirrors(transform) * (x * direction.x + y * direction.y + z * direction.z)).normalize_or_zero()
}

/// −1 where a transform mirrors, else 1.
pub(super) fn mirrors(transform: &DAffine3) -> f64 {
    if transform.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 }
}
