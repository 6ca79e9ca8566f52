//! The scene as a whole: its parts, its extent in the world, and the camera and light it gets where it has none.

use super::clip::{Clip, LightProperty, MaterialProperty, Target, together};
use super::mesh::drop_zero_area;
use super::{
    Camera, Deformation, Environment, Image, Instance, Light, LightKind, Material, Mesh, SceneError,
};
use glam::{DVec3, Vec3};
use std::borrow::Cow;
use std::f32::consts::{FRAC_PI_4, PI};
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// A scene as loaded or made in code. Indices between its parts are checked by [`Scene::validate`].
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// File stem or `builtin:` name; used for default output names.
    pub name: String,
    /// Where the scene's origin lies in the file's coordinates (m). Instances, lights and cameras are relative to it. Not 0
    /// where [`near_origin`](Self::near_origin) says why.
    pub origin: DVec3,
    /// Geometry in object space. Poses and copies of a scene share it, by which [`Renderer::edit`](crate::renderer::Renderer::edit)
    /// knows what stays.
    pub meshes: Vec<Arc<Mesh>>,
    /// Meshes that are to be brought into another shape than they have.
    pub deformations: Vec<Deformation>,
    /// Placements of meshes in the world.
    pub instances: Vec<Instance>,
    /// Materials that meshes' triangles name.
    pub materials: Vec<Material>,
    /// Texel data that materials' textures name, shared like geometry.
    pub images: Vec<Arc<Image>>,
    /// Light sources other than emissive surfaces.
    pub lights: Vec<Light>,
    /// Light from infinitely far around, shared like geometry.
    pub environment: Option<Arc<Environment>>,
    /// Cameras in file order.
    pub cameras: Vec<Camera>,
    /// What moves it, where the loader was asked for that.
    pub motion: Option<Arc<dyn Motion>>,
    /// What the loader left out or assumed, one sentence each, to be shown once.
    pub notes: Vec<String>,
}

/// What moves a scene. Importers make it where [`LoadOptions::motion`](super::LoadOptions::motion) asks for it.
pub trait Motion: fmt::Debug + Send + Sync {
    /// Animations of the file.
    fn clips(&self) -> &[Clip];

    /// What `scene` is at a time (s) of some clips, as [`Scene::pose`] says or, if `lazily`, as [`Scene::pose_lazily`].
    ///
    /// # Errors
    /// As for [`Scene::pose`].
    fn pose(&self, scene: &Scene, clips: &[usize], time: f64, lazily: bool) -> Result<Scene, SceneError>;
}

impl Scene {
    /// A mesh to change; copied first where other scenes share it.
    ///
    /// # Panics
    /// There is no such mesh.
    pub fn mesh_mut(&mut self, index: usize) -> &mut Mesh {
        Arc::make_mut(&mut self.meshes[index])
    }

    /// Animations of the file, which [`pose`](Self::pose) plays.
    #[must_use]
    pub fn clips(&self) -> &[Clip] {
        self.motion.as_ref().map_or(&[], |motion| motion.clips())
    }

    /// Clips that can be played together: the first, and each that moves nothing which an earlier one of them moves.
    #[must_use]
    pub fn clips_together(&self) -> Vec<usize> {
        together(self.clips())
    }

    /// Whether a clip moves what a material or a light source gives.
    #[must_use]
    pub fn may_shine(&self) -> bool {
        use MaterialProperty::{EmissiveFactor, EmissiveStrength};
        let mut targets = self.clips().iter().flat_map(|clip| &clip.channels).map(|channel| channel.target);
        targets.any(|target| match target {
            Target::Material(_, property) => matches!(property, EmissiveFactor | EmissiveStrength),
            target => matches!(target, Target::Light(_, LightProperty::Color | LightProperty::Intensity)),
        })
    }

    /// The scene at a time (s) of some of its [`clips`](Self::clips), later ones winning over earlier: instances, shapes,
    /// lights, cameras and materials as they are then, and the environment, name and lights that were added to this one. It
    /// keeps the motion, for further poses. Without clips it is the same scene.
    ///
    /// # Errors
    /// A pose that is no scene: numbers out of range.
    ///
    /// # Panics
    /// There is no such clip, but the scene has a motion.
    pub fn pose(&self, clips: &[usize], time: f64) -> Result<Self, SceneError> {
        self.pose_by(clips, time, false)
    }

    /// The same for a renderer, which brings meshes into [shape](Self::deformations) on the device where it can: that takes
    /// less time, and positions are rounded to 32 bits on the way.
    ///
    /// # Errors
    /// As for [`pose`](Self::pose).
    ///
    /// # Panics
    /// As for [`pose`](Self::pose).
    pub fn pose_lazily(&self, clips: &[usize], time: f64) -> Result<Self, SceneError> {
        self.pose_by(clips, time, true)
    }

    fn pose_by(&self, clips: &[usize], time: f64, lazily: bool) -> Result<Self, SceneError> {
        let Some(motion) = &self.motion else { return Ok(self.clone()) };
        Ok(Self { motion: Some(Arc::clone(motion)), ..motion.pose(self, clips, time, lazily)? })
    }

    /// The same scene with all [deformations](Self::deformations) made: a lazy pose becomes what [`pose`](Self::pose) is.
    ///
    /// # Errors
    /// A vertex that is not finite.
    pub fn shaped(&self) -> Result<Cow<'_, Self>, SceneError> {
        if self.deformations.is_empty() {
            return Ok(Cow::Borrowed(self));
        }
        let mut scene = self.clone();
        for deformation in std::mem::take(&mut scene.deformations) {
            let mesh = &mut scene.meshes[deformation.mesh as usize];
            let posed = deformation.posed(mesh).map_err(|vertex| {
                let problem = format!("vertex {vertex} of its pose is not finite");
                SceneError::new(Path::new("scene"), format!("meshes[{}]", deformation.mesh), problem)
            })?;
            *mesh = posed.into();
            drop_zero_area(mesh);
        }
        Ok(Cow::Owned(scene))
    }

    /// World-space vertices (m) of every triangle, instance by instance, in the meshes' order, deformations not made. In a
    /// mirroring instance (negative determinant) the front side sees them clockwise.
    pub fn world_triangles(&self) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        self.instances.iter().flat_map(|instance| self.instance_triangles(instance))
    }

    /// The same of one instance.
    pub(crate) fn instance_triangles<'a>(
        &'a self,
        instance: &'a Instance,
    ) -> impl Iterator<Item = [Vec3; 3]> + 'a {
        let mesh = &self.meshes[instance.mesh as usize];
        let vertex = move |v: u32| instance.transform.transform_point3(mesh.positions[v as usize]);
        mesh.triangles.iter().map(move |triangle| triangle.map(vertex))
    }

    /// Smallest and largest coordinates (m) of all triangles in the world, as far as deformations may bring them; none without
    /// triangles.
    #[must_use]
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let corners = self.instances.iter().flat_map(|instance| self.reach(instance)).map(|p| (p, p));
        corners.reduce(|(low, high), (p, _)| (low.min(p), high.max(p)))
    }

    /// World-space points (m) within whose hull an instance's triangles are.
    pub(crate) fn reach<'a>(&'a self, instance: &'a Instance) -> impl Iterator<Item = Vec3> + 'a {
        let deformed = self.deformation(instance.mesh).map(|deformation| {
            let corners = deformation.corners();
            corners.into_iter().map(|corner| instance.transform.transform_point3(corner))
        });
        let plain = deformed.is_none().then(|| self.instance_triangles(instance).flatten());
        deformed.into_iter().flatten().chain(plain.into_iter().flatten())
    }

    /// What brings a mesh into shape.
    pub(crate) fn deformation(&self, mesh: u32) -> Option<&Deformation> {
        self.deformations.iter().find(|deformation| deformation.mesh == mesh)
    }

    /// Area of all triangles in the world (m²), one side each, deformations not made.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.world_triangles().map(area).sum()
    }

    /// A perspective camera of 45° named `framed` that sees the whole scene from the front, a little from
    /// above and the right, in any picture at least as wide as high.
    #[must_use]
    pub fn frame_camera(&self) -> Camera {
        Self::framing(self.bounds())
    }

    /// The same of what lies within bounds.
    pub(super) fn framing(bounds: Option<(Vec3, Vec3)>) -> Camera {
        let (low, high) = bounds.unwrap_or((-Vec3::ONE, Vec3::ONE));
        let radius = 0.5 * (high - low).length();
        let distance = 1.02 * radius / (0.5 * FRAC_PI_4).sin();
        let center = low.midpoint(high);
        Camera::look_at(
            "framed",
            center + distance * Vec3::new(0.4, 0.35, 1.0).normalize(),
            center,
            FRAC_PI_4,
        )
    }

    /// Adds a white point light at `camera`, for scenes without lights. A white diffuse surface that faces it
    /// at the distance d of the scene's centre (at least half the scene's radius) gets irradiance π W/m² and
    /// reflects radiance 1, so its intensity is π d² W/sr.
    pub fn add_headlight(&mut self, camera: &Camera) {
        let position = Vec3::from(camera.transform.translation);
        let (low, high) = self.bounds().unwrap_or((-Vec3::ONE, Vec3::ONE));
        let distance = position.distance(low.midpoint(high)).max(0.25 * (high - low).length());
        self.notes.push("the scene has no lights: it is lit by a point light at the camera".into());
        self.lights.push(Light {
            name: "headlight".into(),
            kind: LightKind::Point,
            position,
            direction: Vec3::NEG_Z,
            intensity: Vec3::splat(PI * distance * distance),
        });
    }
}

/// Of a triangle (m²), one side.
pub(crate) fn area([a, b, c]: [Vec3; 3]) -> f64 {
    0.5 * (b - a).as_dvec3().cross((c - a).as_dvec3()).length()
}
