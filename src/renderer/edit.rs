//! Edits of a scene on a device: what has changed decides what is redone.

use crate::accel::{Blocks, Geometry};
use crate::scene::{Instance, Material, Scene, area};
use glam::{Affine3A, Vec3};
use std::sync::Arc;

/// What an edit makes worthless, and what it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Invalidated {
    /// Pictures drawn before, and what a progressive one has come to.
    pub pictures: bool,
    /// The pipelines: the scene needs others than before.
    pub pipelines: bool,
    /// The structures that rays are traced in.
    pub structures: Redone,
    /// Bytes of shading data uploaded.
    pub bytes: u64,
}

/// How much of the structures that rays are traced in is built anew.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Redone {
    /// All stays.
    #[default]
    Nothing,
    /// The level over placements, and boxes for imperfect visibility where there are any.
    Top,
    /// That, and below it what [is brought into shape](crate::scene::Scene::deformations): fitted to it, or built anew.
    Shapes,
    /// All of it.
    All,
}

/// In what two scenes differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Difference {
    pub(super) lights: bool,
    pub(super) cameras: bool,
    pub(super) materials: bool,
    /// Which surfaces emit, and how much.
    pub(super) emission: bool,
    /// Where instances are that are to move.
    pub(super) places: bool,
    /// Into which shapes meshes are to be brought.
    pub(super) shapes: bool,
    /// All else.
    pub(super) rest: bool,
}

impl Difference {
    pub(super) fn between(old: &Scene, new: &Scene) -> Self {
        let pairs = || old.instances.iter().zip(&new.instances);
        let other_place = |(a, b): (&Instance, &Instance)| a.transform != b.transform;
        let other = |(a, b): (&Instance, &Instance)| {
            (a.mesh, a.moves) != (b.mesh, b.moves) || !a.moves && other_place((a, b))
        };
        let shapes = || old.deformations.iter().zip(&new.deformations);
        let materials = || old.materials.iter().zip(&new.materials);
        let blocks = |(a, b): (&Material, &Material)| Blocks::of(a) != Blocks::of(b);
        let rest = old.origin != new.origin
            || !same(&old.meshes, &new.meshes)
            || !same(&old.images, &new.images)
            || !same(old.environment.as_slice(), new.environment.as_slice())
            || old.instances.len() != new.instances.len()
            || old.deformations.len() != new.deformations.len()
            || shapes().any(|(a, b)| !a.is_of(b))
            || pairs().any(other)
            || old.materials.len() != new.materials.len()
            || materials().any(blocks);
        Self {
            lights: old.lights != new.lights,
            cameras: old.cameras != new.cameras,
            materials: old.materials != new.materials,
            emission: materials().any(|(a, b)| shine(a) != shine(b)),
            places: pairs().any(other_place),
            shapes: shapes().any(|(a, b)| !a.is_same(b)),
            rest,
        }
    }
}

/// Whether any triangle of an instance emits.
pub(super) fn emits(scene: &Scene, instance: &Instance) -> bool {
    scene.meshes[instance.mesh as usize].materials.iter().any(|&of| scene.materials[of as usize].emits())
}

fn shine(material: &Material) -> impl PartialEq {
    (material.emission, material.emission_texture, material.double_sided, material.unlit)
}

fn same<T>(old: &[Arc<T>], new: &[Arc<T>]) -> bool {
    old.len() == new.len() && old.iter().zip(new).all(|(a, b)| Arc::ptr_eq(a, b))
}

/// What a scene in which something is to move keeps on the host.
#[derive(Clone, Debug)]
pub(super) struct Movable {
    pub(super) geometry: Arc<Geometry>,
    /// [Of meshes](Geometry::extents).
    reach: Arc<[Vec3]>,
    /// One an instance of the scene.
    extents: Vec<Extent>,
}

/// Of an instance in the world.
#[derive(Clone, Copy, Debug)]
struct Extent {
    transform: Affine3A,
    low: Vec3,
    high: Vec3,
    /// m²; of what is brought into shape at rest.
    area: f64,
}

impl Extent {
    const NONE: Self =
        Self { transform: Affine3A::IDENTITY, low: Vec3::INFINITY, high: Vec3::NEG_INFINITY, area: 0.0 };

    fn of(scene: &Scene, instance: &Instance) -> Self {
        let areas = scene.instance_triangles(instance).map(area);
        let extent = Self { transform: instance.transform, area: areas.sum(), ..Self::NONE };
        extent.reaching(scene, instance)
    }

    fn reaching(self, scene: &Scene, instance: &Instance) -> Self {
        let Self { low, high, .. } = Self::NONE;
        let ends = scene.reach(instance).fold((low, high), |(low, high), p| (low.min(p), high.max(p)));
        Self { low: ends.0, high: ends.1, ..self }
    }

    fn ends(self) -> Option<[Vec3; 2]> {
        (self.low.x <= self.high.x).then_some([self.low, self.high])
    }

    fn and(self, other: &Self) -> Self {
        let (low, high) = (self.low.min(other.low), self.high.max(other.high));
        Self { low, high, area: self.area + other.area, ..self }
    }
}

impl Movable {
    pub(super) fn of(scene: &Scene, geometry: Geometry) -> Self {
        let extents = scene.instances.iter().map(|instance| Extent::of(scene, instance)).collect();
        Self { reach: geometry.extents().into(), geometry: Arc::new(geometry), extents }
    }

    /// Follows what moves to where it is in `scene`, of which nothing else has changed but shapes.
    pub(super) fn place(&mut self, scene: &Scene) {
        Arc::make_mut(&mut self.geometry).place(scene);
        for (extent, instance) in self.extents.iter_mut().zip(&scene.instances) {
            if extent.transform != instance.transform {
                *extent = Extent::of(scene, instance);
            } else if scene.deformation(instance.mesh).is_some() {
                *extent = extent.reaching(scene, instance);
            }
        }
    }

    /// [`Geometry::ray_epsilon`] (m).
    pub(super) fn ray_epsilon(&self) -> f32 {
        self.geometry.ray_epsilon_of(&self.reach)
    }

    /// Bounds of the instances that move (m), with their numbers; none of what has no triangle.
    pub(super) fn places<'a>(
        &'a self,
        scene: &'a Scene,
    ) -> impl Iterator<Item = (usize, Option<[Vec3; 2]>)> + 'a {
        let of = scene.instances.iter().zip(&self.extents).enumerate();
        of.filter(|(_, (instance, _))| instance.moves).map(|(i, (_, extent))| (i, extent.ends()))
    }

    /// The scene's bounds (m), none without triangles.
    pub(super) fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.extents.iter().fold(Extent::NONE, Extent::and).ends().map(|[low, high]| (low, high))
    }

    /// The scene's surface (m²).
    pub(super) fn area(&self) -> f32 {
        self.extents.iter().fold(Extent::NONE, Extent::and).area as f32
    }

    /// Whether all is so near the origin that [`Scene::near_origin`] leaves it where it is.
    pub(super) fn is_near_origin(&self, scene: &Scene) -> bool {
        self.bounds().is_none_or(|bounds| scene.is_surely_near_origin(bounds))
    }
}
