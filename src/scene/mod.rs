//! What is rendered: geometry, materials, lights and cameras, free of any device.
//!
//! Lengths are in metres, Y is up, angles in radians. Light units are radiometric: 1 candela of a glTF
//! point light is 1 W/sr, 1 lux 1 W/m², 1 nit 1 W/(sr·m²), each per colour channel (linear Rec. 709).

mod camera;
mod emitter;
mod environment;
mod feature;
mod fingerprint;
mod import;
mod light;
mod material;
mod mesh;
mod profile;
mod tangent;
mod validate;
mod world;

pub mod builtin;
pub mod gltf;
pub mod gpu;
pub mod obj;

pub use camera::{Camera, View};
pub use environment::{Environment, MAX_ENVIRONMENT_TEXELS};
pub use feature::Feature;
pub use light::{Light, LightKind};
pub use material::{
    AlphaMode, Clearcoat, Filter, Image, Material, NormalMap, Sampler, TextureRef, TextureTransform, Volume,
    Wrap,
};
pub use mesh::{Instance, Mesh};
pub use profile::SceneProfile;
pub use validate::{MAX_COORDINATE, MAX_IMAGE_SIDE, MAX_TEXELS, MAX_TRIANGLES, MAX_VERTICES};

use std::path::{Path, PathBuf};

/// A scene as loaded or made in code. Indices between its parts are checked by [`Scene::validate`].
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// File stem or `builtin:` name; used for default output names.
    pub name: String,
    /// Geometry in object space.
    pub meshes: Vec<Mesh>,
    /// Placements of meshes in the world.
    pub instances: Vec<Instance>,
    /// Materials that meshes' triangles name.
    pub materials: Vec<Material>,
    /// Texel data that materials' textures name.
    pub images: Vec<Image>,
    /// Light sources other than emissive surfaces.
    pub lights: Vec<Light>,
    /// Light from infinitely far around.
    pub environment: Option<Environment>,
    /// Cameras in file order.
    pub cameras: Vec<Camera>,
    /// What the loader left out or assumed, one sentence each, to be shown once.
    pub notes: Vec<String>,
}

/// Why a scene could not be used: the file, the element in it, and what is wrong with it.
#[derive(Debug, thiserror::Error)]
#[error("{}: {element}: {problem}", file.display())]
pub struct SceneError {
    /// The file, or `builtin:NAME`, or `scene` for one made in code.
    pub file: PathBuf,
    /// Which element, as the format names it: `meshes[3].primitives[0]`, `accessors[7]`, `line 12`.
    pub element: String,
    /// What is wrong, and where it helps what was expected.
    pub problem: String,
}

impl SceneError {
    pub(crate) fn new(file: &Path, element: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { file: file.to_owned(), element: element.into(), problem: problem.into() }
    }
}

/// How a file is read.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Which of several scenes in the file: a name or an index; the file's default otherwise.
    pub scene: Option<String>,
}

/// Loads `.gltf`, `.glb`, `.obj`, or `builtin:NAME`.
///
/// # Errors
/// [`SceneError`] names the file, the element and the defect.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    if let Some(name) = path.to_str().and_then(|path| path.strip_prefix("builtin:")) {
        return builtin::by_name(name);
    }
    let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    match extension.as_deref() {
        Some("gltf" | "glb") => gltf::load(path, options),
        Some("obj") => obj::load(path, options),
        _ => Err(SceneError::new(
            path,
            "file name",
            "not a scene this program reads (.gltf, .glb, .obj, builtin:NAME)",
        )),
    }
}
