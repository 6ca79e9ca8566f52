//! The last steps of a load, which the importers share.

use super::mesh::{drop_zero_area, has_zero_area};
use super::{Fault, MAX_VERTICES, Mesh, Scene, SceneError, slab, validate};
use crate::memory::Budget;
use glam::{Affine3A, Vec2, Vec3, Vec4};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// What is noted of a scene without a camera.
pub(crate) const FRAMED: &str = "the scene has no camera: it is seen from one that frames it";

/// What remains to be done once a file is read: drops zero-area triangles and what is empty without them, bakes
/// transforms that flatten, makes panes of flat slabs, adds a camera where there is none, and validates.
pub(super) fn finish(scene: Scene, file: &Path, element: &str) -> Result<Scene, SceneError> {
    let mut scene = finish_pose(scene, &Settled::default(), file, element)?;
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

/// What is done of that before a pose is known.
#[derive(Debug, Default)]
pub(super) struct Settled {
    /// Meshes that are done with and valid, by address, and where their vertices are (m).
    meshes: HashMap<usize, [Vec3; 2]>,
    /// Triangles of zero area that they were.
    dropped: usize,
    /// Whether slabs have become panes.
    panes: bool,
}

impl Settled {
    /// Settles the meshes for which `stays` holds of a scene's parts and, if `panes`, which slabs are panes.
    pub(super) fn of(parts: &mut Scene, stays: impl Fn(usize) -> bool, panes: bool) -> Self {
        let mut dropped = 0;
        for (_, mesh) in parts.meshes.iter_mut().enumerate().filter(|&(index, _)| stays(index)) {
            dropped += drop_zero_area(mesh);
        }
        if panes {
            slab::become_panes(parts);
        }
        let done =
            |(index, mesh): &(usize, &Arc<Mesh>)| stays(*index) && is_done(mesh, parts.materials.len());
        let all = parts.meshes.iter().enumerate().filter(done);
        let meshes = all.filter_map(|(_, mesh)| Some((address(mesh), mesh.ends()?))).collect();
        Self { meshes, dropped, panes }
    }

    /// Where the vertices of a mesh are (m) that is done with.
    pub(super) fn bounds(&self, mesh: &Arc<Mesh>) -> Option<[Vec3; 2]> {
        self.meshes.get(&address(mesh)).copied()
    }
}

fn address(mesh: &Arc<Mesh>) -> usize {
    Arc::as_ptr(mesh) as usize
}

/// Whether nothing remains to be done with a mesh.
pub(super) fn is_done(mesh: &Mesh, materials: usize) -> bool {
    !mesh.triangles.is_empty() && mesh.check(materials).is_ok() && !has_zero_area(mesh)
}

/// The same of a moment, when there may be nothing to see; it may have no camera.
pub(super) fn finish_pose(
    mut scene: Scene,
    settled: &Settled,
    file: &Path,
    element: &str,
) -> Result<Scene, SceneError> {
    let open = scene.meshes.iter_mut().filter(|mesh| settled.bounds(mesh).is_none());
    let mut dropped: usize = settled.dropped + open.map(drop_zero_area).sum::<usize>();
    dropped += bake_flattening(&mut scene).map_err(|fault| fault.of(file, element))?;
    if dropped > 0 {
        scene.notes.push(format!("{dropped} triangles of zero area are left out"));
    }
    if !settled.panes {
        slab::become_panes(&mut scene);
    }
    drop_empty(&mut scene);
    let known = |mesh: &Arc<Mesh>| settled.bounds(mesh);
    scene.validate_by(&known).map_err(|error| SceneError { file: file.to_owned(), ..error })?;
    Ok(scene)
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
    scene.deformations.retain_mut(|deformation| {
        let index = new_index[deformation.mesh as usize];
        deformation.mesh = index.unwrap_or_default();
        index.is_some()
    });
}
