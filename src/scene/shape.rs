//! Meshes that change shape: morph targets, then skins (glTF 2.0, sections 3.7.2.2 and 3.7.3.3).

use super::Mesh;
use super::mesh::unit_normal;
use glam::{DAffine3, DMat3, DVec3, Vec3, Vec4};

/// A mesh before it is morphed and skinned.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    /// Positions and normals as in the file, tangents of unit length or zero.
    pub(crate) base: Mesh,
    pub(crate) targets: Vec<MorphTarget>,
    /// Where there is a skin.
    pub(crate) influences: Option<Influences>,
}

/// What a morph target adds by weight: one a vertex of the base, or none where it adds nothing.
#[derive(Clone, Debug, Default)]
pub(crate) struct MorphTarget {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) normals: Vec<Vec3>,
}

/// Which joints move vertices, and how much.
#[derive(Clone, Debug, Default)]
pub(crate) struct Influences {
    /// Where each vertex's end among `of`.
    pub(crate) ends: Vec<u32>,
    /// Joints and positive weights.
    pub(crate) of: Vec<(u32, f32)>,
}

impl Influences {
    pub(super) fn vertex(&self, vertex: usize) -> &[(u32, f32)] {
        let start = vertex.checked_sub(1).map_or(0, |before| self.ends[before] as usize);
        &self.of[start..self.ends[vertex] as usize]
    }
}

impl Shape {
    /// The mesh with these weights, relative to `origin`; `joints` are from the mesh's space to the world and move what has a
    /// skin.
    ///
    /// # Errors
    /// The vertex that is not finite.
    pub(crate) fn pose(&self, weights: &[f32], joints: &[DAffine3], origin: DVec3) -> Result<Mesh, usize> {
        posed(self.base.clone(), self, weights, joints, origin)
    }

    /// The same, of one that is not posed again.
    pub(crate) fn posed(
        mut self,
        weights: &[f32],
        joints: &[DAffine3],
        origin: DVec3,
    ) -> Result<Mesh, usize> {
        posed(std::mem::take(&mut self.base), &self, weights, joints, origin)
    }
}

fn posed(
    mut base: Mesh,
    shape: &Shape,
    weights: &[f32],
    joints: &[DAffine3],
    origin: DVec3,
) -> Result<Mesh, usize> {
    let Shape { targets, influences, .. } = shape;
    let weighted = || targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0);
    // Of what is far from the origin a morph moves little.
    let exact: Option<Vec<DVec3>> = (influences.is_none() && origin != DVec3::ZERO).then(|| {
        let mut exact: Vec<DVec3> = base.positions.iter().map(|p| p.as_dvec3() - origin).collect();
        for (target, &weight) in weighted() {
            for (value, delta) in exact.iter_mut().zip(&target.positions) {
                *value += f64::from(weight) * delta.as_dvec3();
            }
        }
        exact
    });
    for (target, &weight) in weighted() {
        for (values, deltas) in
            [(&mut base.positions, &target.positions), (&mut base.normals, &target.normals)]
        {
            values.iter_mut().zip(deltas).for_each(|(value, &delta)| *value += weight * delta);
        }
    }
    let finite = |values: &[Vec3]| values.iter().position(|value| !value.is_finite()).map_or(Ok(()), Err);
    finite(&base.positions)?;
    finite(&base.normals)?;
    if let Some(exact) = exact {
        base.positions = exact.into_iter().map(|position| position.as_vec3()).collect();
    }
    match influences {
        Some(influences) => skin(&mut base, influences, joints, origin),
        None => base.normals.iter_mut().for_each(|normal| *normal = unit_normal(*normal)),
    }
    finite(&base.positions)?;
    Ok(base)
}

fn skin(mesh: &mut Mesh, influences: &Influences, joints: &[DAffine3], origin: DVec3) {
    let blend: Vec<DAffine3> =
        (0..mesh.positions.len()).map(|vertex| mean(influences.vertex(vertex), joints)).collect();
    for (position, transform) in mesh.positions.iter_mut().zip(&blend) {
        *position = (transform.transform_point3(position.as_dvec3()) - origin).as_vec3();
    }
    for (normal, transform) in mesh.normals.iter_mut().zip(&blend) {
        *normal = turned(transform, normal.as_dvec3(), false).as_vec3();
    }
    for (corners, triangle) in mesh.tangents.iter_mut().zip(&mesh.triangles) {
        for (corner, &vertex) in corners.iter_mut().zip(triangle) {
            let transform = &blend[vertex as usize];
            *corner = match turned(transform, corner.truncate().as_dvec3(), true).as_vec3() {
                Vec3::ZERO => Vec4::ZERO,
                unit => unit.extend(corner.w * mirrors(transform) as f32),
            };
        }
    }
    for (i, triangle) in mesh.triangles.iter_mut().enumerate() {
        // What was the front stays it.
        if mirrors(&blend[triangle[0] as usize]) < 0.0 {
            triangle.swap(1, 2);
            if let Some(corners) = mesh.tangents.get_mut(i) {
                corners.swap(1, 2);
            }
        }
    }
}

/// The mean of joints' transforms by weight.
fn mean(influences: &[(u32, f32)], joints: &[DAffine3]) -> DAffine3 {
    let (mut matrix, mut translation, mut sum) = (DMat3::ZERO, DVec3::ZERO, 0.0);
    for &(joint, weight) in influences {
        let (joint, weight) = (&joints[joint as usize], f64::from(weight));
        matrix += joint.matrix3 * weight;
        translation += joint.translation * weight;
        sum += weight;
    }
    DAffine3 { matrix3: matrix * sum.recip(), translation: translation / sum }
}

/// The direction of a normal or, if `along` the surface, of a tangent behind a transform; zero where it leaves none.
fn turned(transform: &DAffine3, direction: DVec3, along: bool) -> DVec3 {
    let m = &transform.matrix3;
    if along {
        return (*m * direction).normalize_or_zero();
    }
    // The cofactor matrix carries normals whatever the scaling.
    let [x, y, z] = [m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis)];
    (mirrors(transform) * (x * direction.x + y * direction.y + z * direction.z)).normalize_or_zero()
}

/// −1 where a transform mirrors, else 1.
fn mirrors(transform: &DAffine3) -> f64 {
    if transform.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 }
}
