//! What the importers share: files beside the scene, images, and the last steps of a load.

use super::validate::{self, MAX_IMAGE_SIDE, MAX_VERTICES};
use super::{Image, Mesh, Scene, SceneError};
use glam::{Affine3A, Vec3};
use std::io::Cursor;
use std::path::{Component, Path, PathBuf};

/// Largest file read (bytes), the most a .glb can say of itself.
const MAX_FILE_BYTES: u64 = u32::MAX as u64;

/// Reads a regular file; anything else (a folder, a pipe that would block) is an error.
pub(super) fn read_file(path: &Path) -> Result<Vec<u8>, String> {
    let refused = |error: std::io::Error| format!("can't be read: {error}");
    let metadata = std::fs::metadata(path).map_err(refused)?;
    if !metadata.is_file() {
        return Err("is not a file".into());
    }
    if metadata.len() > MAX_FILE_BYTES {
        return Err(format!("is {} bytes long, expected at most {MAX_FILE_BYTES}", metadata.len()));
    }
    std::fs::read(path).map_err(refused)
}

/// `relative` in the folder of `file`, if it can't lead out of that folder.
pub(super) fn beside(file: &Path, relative: &str) -> Result<PathBuf, String> {
    // Windows reads `\` and drive letters where others see a plain name: refuse them everywhere.
    let inside =
        Path::new(relative).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if relative.is_empty() || !inside || relative.contains(['\\', ':', '\0']) {
        return Err(format!("`{relative}` is not a path inside the scene's folder"));
    }
    Ok(file.parent().unwrap_or(Path::new("")).join(relative))
}

/// Decodes PNG or JPEG of any depth and colour type into 8-bit RGBA.
pub(super) fn decode_image(name: &str, bytes: &[u8]) -> Result<Image, String> {
    let corrupt = |error: &dyn std::fmt::Display| format!("can't be decoded: {error}");
    let mut reader =
        image::ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| corrupt(&e))?;
    if !matches!(reader.format(), Some(image::ImageFormat::Png | image::ImageFormat::Jpeg)) {
        return Err("is neither PNG nor JPEG".into());
    }
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_IMAGE_SIDE);
    limits.max_image_height = Some(MAX_IMAGE_SIDE);
    limits.max_alloc = Some(u64::from(MAX_IMAGE_SIDE) * u64::from(MAX_IMAGE_SIDE) * 8);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|e| corrupt(&e))?.into_rgba8();
    let (width, height) = decoded.dimensions();
    let texels = bytemuck::cast_vec(decoded.into_raw());
    Ok(Image { name: name.to_owned(), width, height, texels })
}

/// Linear value of an sRGB-encoded one in [0, 1] (IEC 61966-2-1).
pub(super) fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// What remains to be done once a file is read: drops zero-area triangles and what is empty without them, bakes
/// transforms that flatten, adds a camera where there is none, and validates.
pub(super) fn finish(mut scene: Scene, file: &Path, element: &str) -> Result<Scene, SceneError> {
    let mut dropped: usize = scene.meshes.iter_mut().map(drop_zero_area).sum();
    dropped += bake_flattening(&mut scene).map_err(|problem| SceneError::new(file, element, problem))?;
    if dropped > 0 {
        scene.notes.push(format!("{dropped} triangles of zero area are left out"));
    }
    drop_empty(&mut scene);
    if scene.instances.is_empty() {
        let why = scene.notes.iter().map(|note| format!("; {note}")).collect::<String>();
        return Err(SceneError::new(file, element, format!("there is no triangle in it{why}")));
    }
    scene.validate().map_err(|error| SceneError { file: file.to_owned(), ..error })?;
    if scene.cameras.is_empty() {
        scene.cameras.push(scene.frame_camera());
        scene.notes.push("the scene has no camera: it is seen from one that frames it".into());
    }
    Ok(scene)
}

/// Removes triangles whose exact area is zero; 64-bit floats hold differences and products of coordinates well
/// enough for collinear corners to cancel.
fn drop_zero_area(mesh: &mut Mesh) -> usize {
    let before = mesh.triangles.len();
    let keep: Vec<bool> = mesh
        .triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|v| mesh.positions[v as usize].as_dvec3());
            (b - a).cross(c - a) != glam::DVec3::ZERO
        })
        .collect();
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
fn bake_flattening(scene: &mut Scene) -> Result<usize, String> {
    let mut dropped = 0;
    let mut vertices: usize = scene.meshes.iter().map(|mesh| mesh.positions.len()).sum();
    for instance in &mut scene.instances {
        if validate::invertible(&instance.transform) {
            continue;
        }
        let mut flat = scene.meshes[instance.mesh as usize].clone();
        for position in &mut flat.positions {
            *position = instance.transform.transform_point3(*position);
        }
        flat.normals = Vec::new();
        flat.tangents = Vec::new();
        dropped += drop_zero_area(&mut flat);
        if flat.triangles.is_empty() {
            flat = Mesh::default();
        }
        vertices += flat.positions.len();
        if vertices > MAX_VERTICES {
            return Err(format!("more than {MAX_VERTICES} vertices once flattened instances have their own"));
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
