//! Tangents where a file has none: MikkTSpace (Mikkelsen 2008), as glTF 2.0, section 3.7.2.1, asks for.

use super::{Material, Mesh, TextureTransform, validate};
use bevy_mikktspace::{TangentSpace, generate_tangents};
use glam::{Affine2, Vec2, Vec3, Vec4};

/// Triangles of one material.
struct Part<'a> {
    mesh: &'a Mesh,
    triangles: Vec<usize>,
    uv: &'a [Vec2],
    transform: Affine2,
    tangents: &'a mut [[Vec4; 3]],
}

impl Part<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[self.triangles[face]][corner] as usize
    }
}

impl bevy_mikktspace::Geometry for Part<'_> {
    fn num_faces(&self) -> usize {
        self.triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, corner)].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        let shading = self.mesh.normals.get(self.vertex(face, corner)).filter(|&&n| n != Vec3::ZERO);
        let own = || {
            let [a, b, c] = [0, 1, 2].map(|i| self.mesh.positions[self.vertex(face, i)].as_dvec3());
            (b - a).cross(c - a).normalize_or_zero().as_vec3()
        };
        shading.copied().unwrap_or_else(own).to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let uv = self.transform.transform_point2(self.uv[self.vertex(face, corner)]);
        // Images have v pointing down, normal maps green pointing up.
        [uv.x, 1.0 - uv.y]
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let tangent: Vec4 = space.map_or(Vec4::ZERO, |space| space.tangent_encoded().into());
        // The generator finds no direction where texture coordinates or a normal give none.
        self.tangents[self.triangles[face]][corner] =
            if validate::is_tangent(tangent) { tangent } else { Vec4::ZERO };
    }
}

impl Mesh {
    /// Sets tangents for triangles of materials with normal maps, along those maps' texture coordinates, their
    /// transform included; none where the mesh lacks the coordinates. Corners that have one keep it.
    pub fn generate_tangents(&mut self, materials: &[Material]) {
        let mut tangents = std::mem::take(&mut self.tangents);
        for (index, material) in materials.iter().enumerate() {
            let Some(texture) = material.tangent_texture() else { continue };
            let uv = if texture.uv_set == 1 { &self.uv1 } else { &self.uv0 };
            let lacks = |i: usize| tangents.get(i).is_none_or(|corners| *corners == [Vec4::ZERO; 3]);
            let here = |&i: &usize| self.materials[i] as usize == index && lacks(i);
            let triangles: Vec<usize> = (0..self.triangles.len()).filter(here).collect();
            if triangles.is_empty() || uv.is_empty() {
                continue;
            }
            tangents.resize(self.triangles.len(), [Vec4::ZERO; 3]);
            let transform = TextureTransform::to_affine(texture.transform);
            let mut part = Part { mesh: self, triangles, uv, transform, tangents: &mut tangents };
            // The error type has no values.
            let _ = generate_tangents(&mut part);
        }
        self.tangents = tangents;
    }
}
