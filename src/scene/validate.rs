//! The ranges a scene's values must keep, for files and for scenes made in code alike.

use super::deformation::corners;
use super::limits::{
    Checked, MAX_ABSORPTION, MAX_COORDINATE, MAX_FACTOR, MAX_IMAGE_SIDE, MAX_IOR, MAX_RADIANCE, MAX_TEXELS,
    MAX_TEXTURE_COORDINATE, MAX_TRIANGLES, MAX_VERTICES, MIN_EXTENT,
};
use super::{
    AlphaMode, Camera, Deformation, Image, Instance, Light, LightKind, Material, Mesh, Scene, SceneError,
    TextureRef, View,
};
use glam::{Affine3A, DVec3, Vec2, Vec3, Vec4};
use std::f32::consts::{FRAC_PI_2, PI};
use std::path::Path;
use std::sync::Arc;

fn within(what: &str, value: f32, low: f32, high: f32) -> Checked {
    if (low..=high).contains(&value) && value.is_finite() {
        return Ok(());
    }
    let [value, low, end] = [value, low, high].map(|v| {
        // Zeros by the dozen are not read.
        if v.is_finite() && v.abs() >= 1e7 { format!("{v:e}") } else { v.to_string() }
    });
    let expected = if high.is_infinite() { format!("at least {low}") } else { format!("{low} to {end}") };
    Err(format!("{what} is {value}, expected {expected}"))
}

fn all_within(what: &str, values: &[f32], low: f32, high: f32) -> Checked {
    values.iter().try_for_each(|&value| within(what, value, low, high))
}

/// The first element that is not finite.
pub(super) fn finite<T: Copy + std::fmt::Debug>(what: &str, values: &[T], ok: impl Fn(T) -> bool) -> Checked {
    match values.iter().position(|&value| !ok(value)) {
        Some(i) => Err(format!("{what} {i} is not finite: {:?}", values[i])),
        None => Ok(()),
    }
}

impl Material {
    /// Checks all factors; textures' images are the scene's to check.
    pub(super) fn check(&self) -> Checked {
        all_within("base colour", &self.base_color.to_array(), 0.0, 1.0)?;
        within("metallic", self.metallic, 0.0, 1.0)?;
        within("roughness", self.roughness, 0.0, 1.0)?;
        all_within("emission", &self.emission.to_array(), 0.0, MAX_RADIANCE)?;
        within("index of refraction", self.ior, 1.0, MAX_IOR)?;
        within("transmission", self.transmission, 0.0, 1.0)?;
        within("specular factor", self.specular, 0.0, 1.0)?;
        all_within("specular colour", &self.specular_color.to_array(), 0.0, MAX_FACTOR)?;
        if let Some(volume) = self.volume {
            let distance = volume.attenuation_distance;
            if distance.is_nan() || distance <= 0.0 {
                return Err(format!("attenuation distance is {distance}, expected more than 0"));
            }
            all_within("attenuation colour", &volume.attenuation_color.to_array(), 0.0, 1.0)?;
            let absorption = volume.absorption();
            if absorption.max_element() > MAX_ABSORPTION {
                let problem = format!("attenuation distance is {distance}: absorption is {absorption}/m");
                return Err(format!("{problem}, expected at most {MAX_ABSORPTION}/m"));
            }
        }
        if let Some(depth) = self.slab {
            all_within("optical depth of a slab", &depth.to_array(), 0.0, f32::INFINITY)?;
        }
        if let AlphaMode::Mask { cutoff } = self.alpha_mode {
            within("alpha cutoff", cutoff, 0.0, f32::INFINITY)?;
        }
        if let Some(coat) = self.clearcoat {
            within("clearcoat factor", coat.factor, 0.0, 1.0)?;
            within("clearcoat roughness", coat.roughness, 0.0, 1.0)?;
        }
        let maps = [self.normal_map, self.clearcoat.and_then(|coat| coat.normal_map)];
        for map in maps.into_iter().flatten() {
            within("scale of a normal map", map.scale, -MAX_FACTOR, MAX_FACTOR)?;
        }
        self.textures().try_for_each(|(_, texture)| texture.check())
    }
}

impl TextureRef {
    fn check(&self) -> Checked {
        let t = self.transform;
        let numbers = [t.offset.x, t.offset.y, t.rotation, t.scale.x, t.scale.y];
        all_within("texture transform", &numbers, -MAX_TEXTURE_COORDINATE, MAX_TEXTURE_COORDINATE)?;
        if self.uv_set > 1 {
            return Err(format!("texture coordinate set {} of a texture, expected 0 or 1", self.uv_set));
        }
        Ok(())
    }
}

impl Light {
    pub(super) fn check(&self) -> Checked {
        all_within("intensity", &self.intensity.to_array(), 0.0, MAX_RADIANCE)?;
        if !matches!(self.kind, LightKind::Directional) {
            within_reach("position", self.position, 10.0 * MAX_COORDINATE)?;
        }
        if !matches!(self.kind, LightKind::Point) && !self.direction.is_normalized() {
            return Err(format!("direction {} is not a unit vector", self.direction));
        }
        if let LightKind::Spot { inner, outer } = self.kind {
            within("outer cone angle", outer, 0.0, FRAC_PI_2)?;
            if !(inner >= 0.0 && inner < outer) {
                return Err(format!(
                    "inner cone angle is {inner}, expected at least 0 and less than the outer, {outer}"
                ));
            }
        }
        Ok(())
    }
}

impl View {
    pub(super) fn check(&self) -> Checked {
        match *self {
            Self::Perspective { yfov } if yfov > 0.0 && yfov < PI => Ok(()),
            Self::Perspective { yfov } => {
                Err(format!("yfov is {yfov}, expected more than 0 and less than π radians"))
            }
            Self::Orthographic { ymag } if ymag > 0.0 && ymag <= MAX_COORDINATE => Ok(()),
            Self::Orthographic { ymag } => Err(format!("ymag is {ymag}, expected more than 0")),
        }
    }
}

impl Camera {
    pub(super) fn check(&self) -> Checked {
        self.view.check()?;
        within_reach("position", self.transform.translation.into(), 10.0 * MAX_COORDINATE)?;
        let m = self.transform.matrix3;
        let off = (m.transpose() * m - glam::Mat3A::IDENTITY).to_cols_array();
        if off.iter().all(|e| e.abs() < 1e-3) && m.determinant() > 0.0 {
            return Ok(());
        }
        Err("its transform is not rigid".into())
    }
}

impl Image {
    fn check(&self) -> Checked {
        for side in [self.width, self.height] {
            if side == 0 || side > MAX_IMAGE_SIDE {
                return Err(format!(
                    "{}×{} texels, expected 1 to {MAX_IMAGE_SIDE} a side",
                    self.width, self.height
                ));
            }
        }
        if ![self.count(), 2 * self.count()].contains(&self.texels.len()) {
            return Err(format!("{} texels for {}×{}", self.texels.len(), self.width, self.height));
        }
        Ok(())
    }
}

impl Instance {
    fn check(&self) -> Checked {
        if !self.transform.is_finite() {
            return Err("its transform is not finite".into());
        }
        if !invertible(&self.transform) {
            return Err("its transform can't be inverted".into());
        }
        Ok(())
    }
}

impl Mesh {
    pub(super) fn check(&self, materials: usize) -> Checked {
        let vertices = self.positions.len();
        let lengths = [
            ("normals", self.normals.len()),
            ("uv0", self.uv0.len()),
            ("uv1", self.uv1.len()),
            ("colors", self.colors.len()),
        ];
        for (what, length) in lengths {
            if length != 0 && length != vertices {
                return Err(format!("{length} {what} for {vertices} vertices"));
            }
        }
        finite("position", &self.positions, Vec3::is_finite)?;
        for uv in [&self.uv0, &self.uv1] {
            let far = |uv: &Vec2| !(uv.abs().max_element() <= MAX_TEXTURE_COORDINATE && uv.is_finite());
            if let Some(i) = uv.iter().position(far) {
                let (found, most) = (uv[i], MAX_TEXTURE_COORDINATE);
                return Err(format!("texture coordinates {i} are {found}, expected at most {most}"));
            }
        }
        finite("color", &self.colors, Vec4::is_finite)?;
        let unit = |n: Vec3| n == Vec3::ZERO || (n.length_squared() - 1.0).abs() < 1e-2;
        if let Some(i) = self.normals.iter().position(|&n| !unit(n)) {
            return Err(format!("normal {i} is neither a unit vector nor zero: {}", self.normals[i]));
        }
        if let Some(i) = self.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= vertices)) {
            return Err(format!(
                "triangle {i} is {:?}, but there are {vertices} vertices",
                self.triangles[i]
            ));
        }
        if self.materials.len() != self.triangles.len() {
            return Err(format!("{} materials for {} triangles", self.materials.len(), self.triangles.len()));
        }
        if !self.tangents.is_empty() && self.tangents.len() != self.triangles.len() {
            return Err(format!("tangents of {} of {} triangles", self.tangents.len(), self.triangles.len()));
        }
        let off = |corners: &[Vec4; 3]| !corners.iter().all(|&tangent| is_tangent(tangent));
        if let Some(i) = self.tangents.iter().position(off) {
            return Err(format!(
                "tangents of triangle {i} are not unit vectors with a sign: {:?}",
                self.tangents[i]
            ));
        }
        if let Some(i) = self.materials.iter().position(|&m| m as usize >= materials) {
            return Err(format!(
                "triangle {i} is of material {}, but there are {materials}",
                self.materials[i]
            ));
        }
        Ok(())
    }
}

/// Whether a tangent is a unit vector with a sign, or none.
pub(super) fn is_tangent(tangent: Vec4) -> bool {
    let length2 = tangent.truncate().length_squared();
    tangent == Vec4::ZERO || tangent.w.abs() == 1.0 && (length2 - 1.0).abs() < 1e-2
}

fn within_reach(what: &str, point: Vec3, limit: f32) -> Checked {
    if point.abs().max_element() <= limit && point.is_finite() {
        return Ok(());
    }
    Err(format!("{what} {point} is not within {limit} m of the origin"))
}

fn check_extent(low: DVec3, high: DVec3) -> Checked {
    let extent = (high - low).max_element();
    if extent > 0.0 && extent < f64::from(MIN_EXTENT) {
        return Err(format!("the scene is {extent:e} m across, expected at least {MIN_EXTENT:e}"));
    }
    Ok(())
}

/// Whether `transform` can be inverted in 32-bit floats; a flattening or vanishing one can't.
pub(super) fn invertible(transform: &Affine3A) -> bool {
    let m = transform.matrix3.as_dmat3();
    let largest = m.x_axis.length().max(m.y_axis.length()).max(m.z_axis.length());
    let relative = m.determinant() / largest.powi(3);
    relative.abs() > 1e-12 && transform.matrix3.determinant().is_normal()
}

impl Scene {
    /// Checks what renderers rely on: indices between the scene's parts, lengths of attributes, values finite
    /// and in their ranges, transforms invertible, sizes within [`MAX_TRIANGLES`], [`MAX_VERTICES`],
    /// [`MAX_TEXELS`], [`MAX_IMAGE_SIDE`] and, in the file's coordinates, [`MAX_COORDINATE`].
    ///
    /// # Errors
    /// The first defect; its file is `scene`.
    pub fn validate(&self) -> Result<(), SceneError> {
        self.validate_by(&|_| None)
    }

    /// The same, where the ends of meshes that are valid (m) may be known.
    pub(super) fn validate_by(
        &self,
        known: &dyn Fn(&Arc<Mesh>) -> Option<[Vec3; 2]>,
    ) -> Result<(), SceneError> {
        let fail = |element: String, problem: String| SceneError::new(Path::new("scene"), element, problem);
        for (i, mesh) in self.meshes.iter().enumerate().filter(|(_, mesh)| known(mesh).is_none()) {
            mesh.check(self.materials.len()).map_err(|problem| fail(format!("meshes[{i}]"), problem))?;
        }
        self.validate_materials()?;
        for (i, image) in self.images.iter().enumerate() {
            image.check().map_err(|problem| fail(format!("images[{i}]"), problem))?;
        }
        Self::validate_lights(&self.lights)?;
        if let Some(environment) = &self.environment {
            environment.check().map_err(|problem| fail("environment".into(), problem))?;
        }
        self.validate_cameras()?;
        self.check_sizes().map_err(|problem| fail("size".into(), problem))?;
        let mut triangles = 0_usize;
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for (i, instance) in self.instances.iter().enumerate() {
            let element = || format!("instances[{i}] ({})", instance.name);
            let Some(mesh) = self.meshes.get(instance.mesh as usize) else {
                return Err(fail(
                    element(),
                    format!("mesh {}, but there are {}", instance.mesh, self.meshes.len()),
                ));
            };
            triangles = triangles.saturating_add(mesh.triangles.len());
            if triangles > MAX_TRIANGLES {
                return Err(fail(element(), format!("more than {MAX_TRIANGLES} triangles up to here")));
            }
            instance.check().map_err(|problem| fail(element(), problem))?;
            let mut reach = |position: Vec3| {
                let placed = instance.transform.transform_point3(position).as_dvec3() + self.origin;
                (low, high) = (low.min(placed), high.max(placed));
                within_reach("a vertex at", placed.as_vec3(), MAX_COORDINATE)
            };
            let deformation = self.deformation(instance.mesh);
            let corners = deformation.map(Deformation::corners).or_else(|| known(mesh).map(corners));
            // Where corners are too far away a vertex need not be.
            let near = corners.filter(|corners| {
                deformation.is_some() || corners.iter().all(|&corner| reach(corner).is_ok())
            });
            let reached = match near {
                Some(corners) => corners.into_iter().try_for_each(reach),
                None => mesh.positions.iter().copied().try_for_each(reach),
            };
            reached.map_err(|problem| fail(element(), problem))?;
        }
        for (i, deformation) in self.deformations.iter().enumerate() {
            let mesh = self.meshes.get(deformation.mesh as usize);
            let fits = mesh.is_some_and(|mesh| deformation.fits(mesh));
            let twice = self.deformations[..i].iter().any(|other| other.mesh == deformation.mesh);
            if !fits || twice {
                let problem = format!("mesh {} is not what it brings into shape", deformation.mesh);
                return Err(fail(format!("deformations[{i}]"), problem));
            }
        }
        check_extent(low, high).map_err(|problem| fail("size".into(), problem))
    }

    /// Checks where instances are, as [`validate`](Self::validate) does: those in `places`, within whose bounds (m) their vertices
    /// are, if it has any, and the bounds of all.
    pub(crate) fn validate_places(
        &self,
        places: impl IntoIterator<Item = (usize, Option<[Vec3; 2]>)>,
        (low, high): (Vec3, Vec3),
    ) -> Result<(), SceneError> {
        let fail = |element: String, problem: String| SceneError::new(Path::new("scene"), element, problem);
        for (i, ends) in places {
            let instance = &self.instances[i];
            let reached = |end: Vec3| {
                within_reach("a vertex at", (end.as_dvec3() + self.origin).as_vec3(), MAX_COORDINATE)
            };
            let checked = instance.check().and_then(|()| ends.into_iter().flatten().try_for_each(reached));
            checked.map_err(|problem| fail(format!("instances[{i}] ({})", instance.name), problem))?;
        }
        check_extent(low.as_dvec3(), high.as_dvec3()).map_err(|problem| fail("size".into(), problem))
    }

    /// Checks materials, as [`validate`](Self::validate) does.
    pub(crate) fn validate_materials(&self) -> Result<(), SceneError> {
        for (i, material) in self.materials.iter().enumerate() {
            let unknown =
                material.textures().map(|(_, t)| t.image).find(|&image| image as usize >= self.images.len());
            let known = unknown.map_or(Ok(()), |image| Err(format!("its image {image} is not there")));
            let fail = |problem| SceneError::new(Path::new("scene"), format!("materials[{i}]"), problem);
            material.check().and(known).map_err(fail)?;
        }
        Ok(())
    }

    /// Checks cameras, as [`validate`](Self::validate) does.
    pub(crate) fn validate_cameras(&self) -> Result<(), SceneError> {
        for (i, camera) in self.cameras.iter().enumerate() {
            let fail = |problem| SceneError::new(Path::new("scene"), format!("cameras[{i}]"), problem);
            camera.check().map_err(fail)?;
        }
        Ok(())
    }

    /// Checks the ranges of lights, as [`validate`](Self::validate) does.
    ///
    /// # Errors
    /// The first defect; its file is `scene`.
    pub fn validate_lights(lights: &[Light]) -> Result<(), SceneError> {
        for (i, light) in lights.iter().enumerate() {
            let fail = |problem| SceneError::new(Path::new("scene"), format!("lights[{i}]"), problem);
            light.check().map_err(fail)?;
        }
        Ok(())
    }

    fn check_sizes(&self) -> Checked {
        let vertices: usize = self.meshes.iter().map(|mesh| mesh.positions.len()).sum();
        if vertices > MAX_VERTICES {
            return Err(format!("{vertices} vertices, expected at most {MAX_VERTICES}"));
        }
        let texels: usize = self.images.iter().map(|image| image.texels.len()).sum();
        if texels > MAX_TEXELS {
            return Err(format!("{texels} texels, expected at most {MAX_TEXELS}"));
        }
        Ok(())
    }
}
