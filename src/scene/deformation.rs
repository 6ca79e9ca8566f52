//! Meshes that are to be brought into another shape.

use super::Mesh;
use super::shape::{MorphTarget, Shape};
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

/// A mesh of a scene that is to be brought into shape by morph targets, then a skin. The mesh in the scene is its rest.
#[derive(Clone, Debug)]
pub struct Deformation {
    /// Index into [`Scene::meshes`](super::Scene::meshes).
    pub mesh: u32,
    pub(super) shape: Arc<Shape>,
    pub(super) weights: Vec<f32>,
    /// From the mesh's space to that of its instances, but for `origin`.
    pub(super) joints: Vec<DAffine3>,
    pub(super) origin: DVec3,
    pub(super) bounds: [Vec3; 2],
}

/// A vertex on its way to its place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex<'a> {
    pub(crate) position: Vec3,
    pub(crate) normal: Vec3,
    /// Joints and weights, which sum to anything.
    pub(crate) influences: &'a [(u32, f32)],
}

impl Deformation {
    pub(super) fn new(
        mesh: u32,
        shape: Arc<Shape>,
        weights: Vec<f32>,
        joints: Vec<DAffine3>,
        origin: DVec3,
    ) -> Self {
        Self { mesh, shape, weights, joints, origin, bounds: [Vec3::ZERO; 2] }
    }

    /// Smallest and largest coordinates that it may bring vertices to (m).
    #[must_use]
    pub fn bounds(&self) -> [Vec3; 2] {
        self.bounds
    }

    /// Corners of the bounds.
    pub(crate) fn corners(&self) -> [Vec3; 8] {
        corners(self.bounds)
    }

    /// Whether that is the mesh it brings into shape.
    pub(crate) fn fits(&self, mesh: &Mesh) -> bool {
        mesh.triangles == self.shape.base.triangles && mesh.positions.len() == self.shape.base.positions.len()
    }

    /// The mesh in that shape.
    ///
    /// # Errors
    /// The vertex that is not finite.
    pub(crate) fn posed(&self, rest: &Mesh) -> Result<Mesh, usize> {
        let posed = self.shape.pose(&self.weights, &self.joints, self.origin)?;
        Ok(Mesh {
            name: rest.name.clone(),
            uv0: rest.uv0.clone(),
            uv1: rest.uv1.clone(),
            colors: rest.colors.clone(),
            ..posed
        })
    }

    /// Whether another differs from it in nothing but weights and joints.
    pub(crate) fn is_of(&self, other: &Self) -> bool {
        let counts = |of: &Self| (of.mesh, of.weights.len(), of.joints.len());
        counts(self) == counts(other) && self.origin == other.origin && Arc::ptr_eq(&self.shape, &other.shape)
    }

    /// Whether another, [of the same](Self::is_of), brings its mesh into the same shape.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        self.weights == other.weights && self.joints == other.joints
    }

    /// What it is of, and what it does.
    pub(crate) fn key(&self) -> impl std::fmt::Debug + '_ {
        (self.mesh, &self.weights, &self.joints, self.origin)
    }

    /// Of morph targets.
    pub(crate) fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// From the mesh's space to that of its instances; none where it has no skin.
    pub(crate) fn joints(&self) -> impl ExactSizeIterator<Item = DAffine3> + '_ {
        let skinned = if self.shape.influences.is_some() { &self.joints[..] } else { &[] };
        skinned.iter().map(|joint| DAffine3 { translation: joint.translation - self.origin, ..*joint })
    }

    /// What is brought into place; of what has no skin relative to its origin.
    pub(crate) fn vertices(&self) -> impl Iterator<Item = Vertex<'_>> {
        let Shape { base, influences, .. } = &*self.shape;
        let offset = if influences.is_some() { DVec3::ZERO } else { self.origin };
        base.positions.iter().enumerate().map(move |(index, position)| Vertex {
            position: (position.as_dvec3() - offset).as_vec3(),
            normal: base.normals.get(index).copied().unwrap_or_default(),
            influences: influences.as_ref().map_or(&[], |influences| influences.vertex(index)),
        })
    }

    /// What morph targets add to a vertex: which target, by weight 1 to position and normal.
    pub(crate) fn deltas(&self, vertex: usize) -> impl Iterator<Item = (u32, Vec3, Vec3)> + '_ {
        let add = move |(target, of): (u32, &MorphTarget)| {
            let by = |deltas: &[Vec3]| deltas.get(vertex).copied().unwrap_or_default();
            let (position, normal) = (by(&of.positions), by(&of.normals));
            (position != Vec3::ZERO || normal != Vec3::ZERO).then_some((target, position, normal))
        };
        (0..).zip(&self.shape.targets).filter_map(add)
    }
}

/// Corners of a box.
pub(crate) fn corners([low, high]: [Vec3; 2]) -> [Vec3; 8] {
    let mask = |i: u32| glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0);
    std::array::from_fn(|i| Vec3::select(mask(i as u32), high, low))
}
