//! Numbers of a render as JSON, as `docs/stats.schema.json` describes them.

use super::args::Render;
use super::economy::Economy;
use crate::config::RenderConfig;
use crate::renderer::{Frame, NotFinite, Renderer};
use crate::scene::{Camera, SceneProfile, View};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Everything measured and everything that decided it.
#[expect(clippy::too_many_arguments, reason = "all that there is to tell of a render")]
pub(super) fn stats(
    args: &Render,
    config: &RenderConfig,
    camera: &Camera,
    renderer: &Renderer,
    profile: &SceneProfile,
    frame: &Frame,
    paths_seen: Option<f64>,
    not_finite: Option<&NotFinite>,
    outputs: &[PathBuf],
    economy: Option<&Economy>,
) -> Value {
    let scene = renderer.scene();
    let (backend, reason) = renderer.backend();
    let axes = camera.transform.matrix3;
    let view = match camera.view {
        View::Perspective { yfov } => json!({ "kind": "perspective", "yfov": yfov }),
        View::Orthographic { ymag } => json!({ "kind": "orthographic", "ymag": ymag }),
    };
    json!({
        "parhelion": env!("CARGO_PKG_VERSION"),
        "device": renderer.device().info(),
        "driver": renderer.device().info().driver(),
        "backend": { "name": backend.name(), "reason": reason },
        "scene": {
            "name": scene.name,
            "meshes": scene.meshes.len(),
            "instances": scene.instances.len(),
            "triangles": profile.triangles,
            "materials": scene.materials.len(),
            "images": scene.images.len(),
            "lights": scene.lights.len(),
            "environment": scene.environment.as_ref().map(|environment| &environment.name),
            "origin": scene.origin.to_array(),
            "notes": scene.notes,
        },
        "profile": profile,
        "camera": {
            "name": camera.name,
            "eye": (scene.origin + DVec3::from(Vec3::from(camera.transform.translation))).to_array(),
            "forward": (-axes.z_axis).to_array(),
            "up": axes.y_axis.to_array(),
            "view": view,
        },
        "settings": config,
        "vpl_count": frame.vpl_count,
        "path_count": frame.path_count,
        "paths_seen": paths_seen,
        "min_distance": frame.min_distance,
        "samples": frame.samples,
        "noise": frame.noise,
        "not_finite": not_finite,
        "regathered": frame.regathered,
        "denoised": frame.denoised.as_ref().map(|denoised| json!({ "by": denoised.by, "ms": denoised.ms })),
        "exposure_ev": frame.exposure_ev,
        "structures": renderer.structures().iter().map(|structure| json!({
            "name": structure.name,
            "primitives": structure.primitives,
            "bytes": structure.bytes,
            "build_ms": structure.build_ms,
        })).collect::<Vec<_>>(),
        "repeat": args.repeat.unwrap_or(0),
        "passes": frame.passes,
        "rays": frame.rays,
        "economy": economy.map(Economy::json),
        "total_ms": frame.total_ms,
        "wall_ms": frame.wall_ms,
        "host_ms": frame.host_ms,
        "peak_device_bytes": frame.peak_device_bytes,
        "outputs": outputs.iter().map(|file| file.display().to_string()).collect::<Vec<_>>(),
    })
}
