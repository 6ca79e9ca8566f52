use super::limits::MIN_EXTENT;
use glam::{Affine3A, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// Triangles in object space. Attribute vectors are empty where the mesh has none, else one a vertex.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// As in the file, or made up.
    pub name: String,
    /// Vertex positions (m).
    pub positions: Vec<Vec3>,
    /// Shading normals, unit length; a zero vector (or an empty vector) means the triangle's own normal.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, set 0.
    pub uv0: Vec<Vec2>,
    /// Texture coordinates, set 1.
    pub uv1: Vec<Vec2>,
    /// Linear RGBA that multiplies the base colour.
    pub colors: Vec<Vec4>,
    /// Vertex indices, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Material of each triangle, as long as `triangles`.
    pub materials: Vec<u32>,
    /// Tangents of each triangle's corners, as long as `triangles`, or empty: then normal maps change nothing. x, y, z
    /// have unit length and w = ±1 is the sign of the bitangent, w · normal × tangent; a zero vector stands for none.
    pub tangents: Vec<[Vec4; 3]>,
}

impl Mesh {
    /// Smallest and largest coordinates of its vertices (m), if it has any.
    pub(super) fn ends(&self) -> Option<[Vec3; 2]> {
        let ends = self.positions.iter().map(|&position| [position; 2]);
        ends.reduce(|[low, high], [a, b]| [low.min(a), high.max(b)])
    }

    /// Whether shading normals leave their triangle's own, on either side, by more than rounding does.
    #[must_use]
    pub(super) fn is_curved(&self) -> bool {
        let bent = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| self.positions[v as usize]);
            let own = (b - a).cross(c - a).normalize_or_zero();
            let off = |&v: &u32| {
                let normal = self.normals[v as usize];
                normal != Vec3::ZERO && normal.cross(own).length_squared() > 1e-7
            };
            own != Vec3::ZERO && triangle.iter().any(off)
        };
        !self.normals.is_empty() && self.triangles.iter().any(bent)
    }
}

/// A mesh placed in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The node's name.
    pub name: String,
    /// Index into the scene's meshes.
    pub mesh: u32,
    /// Object to world. May mirror (negative determinant); the front side is then flipped as glTF says.
    pub transform: Affine3A,
    /// Whether it is to be placed anew: then it is traced apart from what stays, which slows rays and makes [moving
    /// it](crate::renderer::Renderer::edit) cheap. Pictures are the same but for rounding and what is left to chance.
    pub moves: bool,
}

/// Removes triangles whose exact area is zero; 64-bit floats hold differences and products of coordinates well
/// enough for collinear corners to cancel.
pub(super) fn drop_zero_area(mesh: &mut Arc<Mesh>) -> usize {
    if !has_zero_area(mesh) {
        return 0;
    }
    let before = mesh.triangles.len();
    let keep: Vec<bool> = mesh.triangles.iter().map(|triangle| has_area(mesh, triangle)).collect();
    let mesh = Arc::make_mut(mesh);
    let mut kept = keep.iter();
    mesh.triangles.retain(|_| kept.next() == Some(&true));
    let mut kept = keep.iter();
    mesh.materials.retain(|_| kept.next() == Some(&true));
    let mut kept = keep.iter();
    mesh.tangents.retain(|_| kept.next() == Some(&true));
    before - mesh.triangles.len()
}

fn has_area(mesh: &Mesh, triangle: &[u32; 3]) -> bool {
    let [a, b, c] = triangle.map(|v| mesh.positions[v as usize].as_dvec3());
    (b - a).cross(c - a) != glam::DVec3::ZERO
}

pub(super) fn has_zero_area(mesh: &Mesh) -> bool {
    !mesh.triangles.iter().all(|triangle| has_area(mesh, triangle))
}

/// Unit vector along `normal`; zero, which stands for the triangle's own normal, where it has no direction.
pub(super) fn unit_normal(normal: Vec3) -> Vec3 {
    normal.as_dvec3().normalize_or_zero().as_vec3()
}

/// Whether what has these ends is smaller than a scene may be.
pub(super) fn is_small(&[low, high]: &[Vec3; 2]) -> bool {
    (high - low).max_element() < MIN_EXTENT
}
