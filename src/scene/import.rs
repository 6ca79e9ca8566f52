//! The last steps of a load, which the importers share.

use super::{Fault, MAX_VERTICES, Mesh, Scene, SceneError, slab, validate};
use crate::memory::Budget;
use glam::{Affine3A, Vec2, Vec3, Vec4};
use std::path::Path;
use std::sync::Arc;

/// What is noted of a scene without a camera.
pub(crate) const FRAMED: &str = "the scene has no camera: it is seen from one that frames it";

/// What remains to be done once a file is read: drops zero-area triangles and what is empty without them, bakes
/// transforms that flatten, makes panes of flat slabs, adds a camera where there is none, and validates.
pub(super) fn finish(scene: Scene, file: &Path, element: &str) -> Result<Scene, SceneError> {
    let mut scene = finish_pose(scene, file, element)?;
    if scene.instances.is_empty() {
        let why = scene.notes.iter().map(|note| format!("; {note}")).collect::<String>();
        return Err(SceneError::new(file, element, format!("there is no triangle in it{why}")));
    }
    if scene.cameras.is_empty() {
        scene.cameras.push(scene.frame_camera());
        scene.notes.push(FRAMED.into());
    }
    Ok(scene)
}

/// The same of a moment, when there may be nothing to see; it may have no camera.
pub(super) fn finish_pose(mut scene: Scene, file: &Path, element: &str) -> Result<Scene, SceneError> {
    let mut dropped: usize = scene.meshes.iter_mut().map(drop_zero_area).sum();
    dropped += bake_flattening(&mut scene).map_err(|fault| fault.of(file, element))?;
    if dropped > 0 {
        scene.notes.push(format!("{dropped} triangles of zero area are left out"));
    }
    slab::become_panes(&mut scene);
    drop_empty(&mut scene);
    scene.validate().map_err(|error| SceneError { file: file.to_owned(), ..error })?;
    Ok(scene)
}

/// Removes triangles whose exact area is zero; 64-bit floats hold differences and products of coordinates well
/// enough for collinear corners to cancel.
fn drop_zero_area(mesh: &mut Arc<Mesh>) -> usize {
    let before = mesh.triangles.len();
    let keep: Vec<bool> = mesh
        .triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|v| mesh.positions[v as usize].as_dvec3());
            (b - a).cross(c - a) != glam::DVec3::ZERO
        })
        .collect();
    if !keep.contains(&false) {
        return 0;
    }
    let mesh = Arc::make_mut(mesh);
    let mut kept = keep.iter();
    mesh.triangles.retain(|_| kept.next() == Some(&true));
    let mut kept = keep.iter();
    mesh.materials.retain(|_| kept.next() == Some(&true));
    let mut kept = keep.iter();
    mesh.tangents.retain(|_| kept.next() == Some(&true));
    before - mesh.triangles.len()
}

/// Gives every instance whose transform can't be inverted a mesh of its own in world space, without normals
/// and tangents, which such a transform does not define.
fn bake_flattening(scene: &mut Scene) -> Result<usize, Fault> {
    let mut dropped = 0;
    let mut budget = None;
    let mut vertices: usize = scene.meshes.iter().map(|mesh| mesh.positions.len()).sum();
    for instance in &mut scene.instances {
        if validate::invertible(&instance.transform) {
            continue;
        }
        let mesh = &scene.meshes[instance.mesh as usize];
        let bytes = mesh.positions.len() * size_of::<([Vec3; 2], [Vec2; 2], Vec4)>()
            + mesh.triangles.len() * size_of::<([u32; 4], [Vec4; 3])>();
        budget.get_or_insert_with(Budget::of_process).take(bytes as u64)?;
        let mut flat = Mesh::clone(mesh);
        for position in &mut flat.positions {
            *position = instance.transform.transform_point3(*position);
        }
        flat.normals = Vec::new();
        flat.tangents = Vec::new();
        let mut flat = Arc::new(flat);
        dropped += drop_zero_area(&mut flat);
        if flat.triangles.is_empty() {
            flat = Arc::default();
        }
        vertices += flat.positions.len();
        if vertices > MAX_VERTICES {
            let problem =
                format!("more than {MAX_VERTICES} vertices once flattened instances have their own");
            return Err(problem.into());
        }
        instance.mesh = scene.meshes.len() as u32;
        instance.transform = Affine3A::IDENTITY;
        scene.meshes.push(flat);
    }
    Ok(dropped)
}

/// Removes instances of meshes without triangles and meshes without instances.
fn drop_empty(scene: &mut Scene) {
    scene.instances.retain(|instance| !scene.meshes[instance.mesh as usize].triangles.is_empty());
    let mut new_index = vec![None; scene.meshes.len()];
    let mut meshes = Vec::new();
    for instance in &mut scene.instances {
        let slot = &mut new_index[instance.mesh as usize];
        instance.mesh = *slot.get_or_insert_with(|| {
            meshes.push(std::mem::take(&mut scene.meshes[instance.mesh as usize]));
            meshes.len() as u32 - 1
        });
    }
    scene.meshes = meshes;
}

/// Unit vector along `normal`; zero, which stands for the triangle's own normal, where it has no direction.
pub(super) fn unit_normal(normal: Vec3) -> Vec3 {
    normal.as_dvec3().normalize_or_zero().as_vec3()
}
