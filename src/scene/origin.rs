//! Scenes far from the origin, where 32-bit floats are too coarse for their shape.

use super::{Camera, Light, MAX_COORDINATE, Mesh, Scene};
use glam::{Affine3A, DAffine3, DVec3, Vec3};
use std::borrow::Cow;
use std::sync::Arc;

/// Extents (diagonals of the bounds) that a scene's centre may lie from the origin. There positions are 64 · 2⁻²⁴ of an
/// extent apart.
const FAR: f64 = 64.0;

/// The points that a scene's numbers are better taken from.
#[derive(Clone, Debug)]
pub(super) struct Around {
    /// In the world (m): the scene's centre, or 0.
    pub(super) origin: DVec3,
    /// Of each mesh in object space: its centre, or 0.
    pub(super) meshes: Vec<DVec3>,
}

impl Around {
    /// None where the numbers serve as they are. `transforms` are those of the scene's instances, which their nodes place by
    /// way of points up to `detour` (m) from the origin.
    pub(super) fn of(scene: &Scene, transforms: &[DAffine3], detour: f64) -> Option<Self> {
        let placed = || scene.instances.iter().zip(transforms);
        let world = placed()
            .map(|(instance, transform)| Bounds::of(&scene.meshes[instance.mesh as usize], transform))
            .fold(Bounds::EMPTY, Bounds::union);
        let limit = FAR * world.low.distance(world.high);
        let centre = world.low.midpoint(world.high);
        // Beyond what is allowed, validation is to find what is in the file.
        let far = centre.length() > limit && centre.abs().max_element() <= MAX_COORDINATE.into();
        let mut meshes = vec![DVec3::ZERO; scene.meshes.len()];
        for (instance, transform) in placed() {
            let mesh = instance.mesh as usize;
            // A distant object space, in a distant place or brought back by its placement.
            if meshes[mesh] == DVec3::ZERO && (far || transform.translation.length() > limit) {
                let own = Bounds::of(&scene.meshes[mesh], &DAffine3::IDENTITY);
                let centre = own.low.midpoint(own.high);
                if (transform.matrix3 * centre).length() > limit {
                    meshes[mesh] = centre;
                }
            }
        }
        let any = far || detour > 2.0 * limit || meshes.iter().any(|&mesh| mesh != DVec3::ZERO);
        any.then_some(Self { origin: if far { centre } else { DVec3::ZERO }, meshes })
    }

    /// The placement of mesh number `mesh`, both about these points.
    pub(super) fn placement(&self, mesh: usize, transform: &DAffine3) -> DAffine3 {
        let offset = self.meshes.get(mesh).copied().unwrap_or_default();
        let translation = transform.translation + (transform.matrix3 * offset - self.origin);
        DAffine3 { translation, ..*transform }
    }
}

#[derive(Clone, Copy)]
struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Bounds {
    const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Of all triangles that the transform leaves any area: what it flattens may lie anywhere.
    fn of(mesh: &Mesh, transform: &DAffine3) -> Self {
        let mut bounds = Self::EMPTY;
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|v| mesh.positions[v as usize].as_dvec3());
            let (u, v) = (transform.matrix3 * (b - a), transform.matrix3 * (c - a));
            if u.cross(v).length() > 1e-12 * u.length() * v.length() {
                let a = transform.transform_point3(a);
                for corner in [a, a + u, a + v] {
                    bounds = bounds.union(Self { low: corner, high: corner });
                }
            }
        }
        bounds
    }
}

pub(super) fn rounded(transform: &DAffine3) -> Affine3A {
    Affine3A::from_cols_array(&transform.to_cols_array().map(|e| e as f32))
}

fn moved(position: Vec3, by: DVec3) -> Vec3 {
    (position.as_dvec3() + by).as_vec3()
}

impl Light {
    pub(crate) fn moved(&self, by: DVec3) -> Self {
        Self { position: moved(self.position, by), ..self.clone() }
    }
}

impl Camera {
    pub(crate) fn moved(&self, by: DVec3) -> Self {
        let mut camera = self.clone();
        camera.transform.translation = moved(self.transform.translation.into(), by).into();
        camera
    }
}

impl Scene {
    /// Where a point in the file's coordinates is in the scene's (m).
    #[must_use]
    pub fn local(&self, point: DVec3) -> Vec3 {
        (point - self.origin).as_vec3()
    }

    /// Whether, going by its bounds (m) alone, [`near_origin`](Self::near_origin) leaves it where it is: up to half of where that
    /// begins.
    pub(crate) fn is_surely_near_origin(&self, (low, high): (Vec3, Vec3)) -> bool {
        let limit = 0.5 * FAR as f32 * low.distance(high);
        let reach = low.abs().max(high.abs()).length();
        reach <= limit
            && self.instances.iter().all(|instance| instance.transform.translation.length() <= limit)
    }

    /// The same scene about an [`origin`](Self::origin) of its own, if its centre lies over 64 extents (diagonals of its
    /// bounds) from the one it has; likewise meshes so far from theirs. 32-bit floats are too coarse there: 500 km off they
    /// are 3 cm apart. What importers load is so already, and [`Renderer`](crate::renderer::Renderer) does it to what it is
    /// given; it then takes cameras and lights in the coordinates of the scene it was given.
    #[must_use]
    pub fn near_origin(&self) -> Cow<'_, Self> {
        let exact =
            |transform: &Affine3A| DAffine3::from_cols_array(&transform.to_cols_array().map(f64::from));
        let transforms: Vec<_> = self.instances.iter().map(|instance| exact(&instance.transform)).collect();
        let Some(around) = Around::of(self, &transforms, 0.0) else { return Cow::Borrowed(self) };
        let mut scene = self.clone();
        scene.origin += around.origin;
        for (mesh, &offset) in scene.meshes.iter_mut().zip(&around.meshes) {
            if offset != DVec3::ZERO {
                Arc::make_mut(mesh)
                    .positions
                    .iter_mut()
                    .for_each(|position| *position = moved(*position, -offset));
            }
        }
        for (instance, transform) in scene.instances.iter_mut().zip(&transforms) {
            instance.transform = rounded(&around.placement(instance.mesh as usize, transform));
        }
        scene.lights.iter_mut().for_each(|light| *light = light.moved(-around.origin));
        scene.cameras.iter_mut().for_each(|camera| *camera = camera.moved(-around.origin));
        Cow::Owned(scene)
    }
}
