//! What is rendered: geometry, materials, lights and cameras, free of any device.
//!
//! Lengths are in metres, Y is up, angles in radians. Light units are radiometric: 1 candela of a glTF
//! point light is 1 W/sr, 1 lux 1 W/m², 1 nit 1 W/(sr·m²), each per colour channel (linear Rec. 709).

mod camera;
mod clip;
mod deformation;
mod environment;
mod error;
mod feature;
mod file;
mod fingerprint;
mod import;
mod light;
mod limits;
mod material;
mod mend;
mod mesh;
mod motion;
mod origin;
mod path;
mod profile;
mod shape;
mod slab;
mod tangent;
mod validate;
mod world;

pub mod builtin;
pub mod gltf;
pub mod obj;

pub use camera::{Camera, View};
pub use clip::{
    CameraProperty, Channel, Clip, Interpolation, LightProperty, MaterialProperty, NodeProperty, Target,
    Track,
};
pub use deformation::Deformation;
pub(crate) use deformation::corners;
pub use environment::{Environment, MAX_ENVIRONMENT_TEXELS};
use error::Fault;
pub use error::SceneError;
pub use feature::Feature;
#[cfg(feature = "cli")]
pub(crate) use import::FRAMED;
pub use light::{Light, LightKind};
pub use limits::{
    MAX_ABSORPTION, MAX_COORDINATE, MAX_FACTOR, MAX_IMAGE_SIDE, MAX_IOR, MAX_RADIANCE, MAX_TEXELS,
    MAX_TEXTURE_COORDINATE, MAX_TRIANGLES, MAX_VERTICES, MIN_EXTENT,
};
pub use material::{
    AlphaMode, Clearcoat, Filter, Image, Material, NormalMap, Sampler, TextureRef, TextureTransform, Volume,
    Wrap,
};
pub(crate) use material::{TextureUse, srgb_to_linear};
pub use mend::LoadOptions;
pub use mesh::{Instance, Mesh};
pub use path::{CameraKey, CameraPath};
pub use profile::SceneProfile;
pub(crate) use profile::{Borders, DELTA_ROUGHNESS};
pub(crate) use world::area;
pub use world::{Motion, Scene};

use std::path::Path;

/// Loads `.gltf`, `.glb`, `.obj`, or `builtin:NAME`.
///
/// # Errors
/// [`SceneError`] names the file, the element and the defect.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    if let Some(name) = path.to_str().and_then(|path| path.strip_prefix("builtin:")) {
        let scene = builtin::by_name(name)?;
        return match &options.scene {
            Some(asked) if asked != "0" => {
                Err(SceneError::new(path, "scenes", format!("no scene `{asked}`: it is one scene")))
            }
            _ => Ok(scene),
        };
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
