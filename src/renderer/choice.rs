//! Which backend a renderer takes; where a device has both, measured, not guessed.

use super::error::Error;
use super::prepared::Prepared;
use super::request::{BackendChoice, FrameRequest, RendererOptions};
use super::submit::Renderer;
use crate::accel::{Arrangement, Levels};
use crate::config::RenderConfig;
use crate::files;
use crate::read;
use crate::scene::{Scene, builtin};
use crate::vk::{self, Backend, DeviceInfo, DeviceKind};
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

impl Renderer {
    /// Uploads a scene and builds the one structure its backend needs.
    ///
    /// # Errors
    /// An invalid scene, a backend the device lacks, or too little memory.
    pub fn new(device: &vk::Device, scene: Scene, options: &RendererOptions) -> Result<Self, Error> {
        scene.validate()?;
        let ray_query = device.info().ray_query;
        let software_only = options.visibility.software_only();
        let visibility = options.visibility.name();
        let (backend, reason) = match options.backend {
            BackendChoice::Force(Backend::RayQuery) if software_only => {
                return Err(Error::SoftwareOnly { visibility });
            }
            BackendChoice::Force(Backend::RayQuery) if !ray_query => {
                return Err(Error::NoRayQuery { device: device.info().name.clone() });
            }
            BackendChoice::Force(backend) => (backend, "as asked".into()),
            _ if software_only => (Backend::Software, format!("the only one with visibility {visibility}")),
            _ if !ray_query => (Backend::Software, "the device has no ray query".into()),
            BackendChoice::Auto if device.info().kind == DeviceKind::Cpu => {
                (Backend::Software, "the faster one on CPU devices".into())
            }
            BackendChoice::Auto => {
                let timing = timing(device)?;
                (timing.fastest(), timing.to_string())
            }
            BackendChoice::Measure => {
                let timing = time(device, &scene)?;
                (timing.fastest(), format!("{timing}, on this scene"))
            }
        };
        // Visibility by leaves' boxes needs whole triangles in the world.
        let levels = if software_only { Levels::One } else { options.levels };
        let arrangement = Arrangement { whole: software_only, levels, rebuild: options.rebuild };
        Self::of(Arc::new(Prepared::new(device, scene.into(), backend, reason, arrangement)?))
    }
}

/// What both backends took for the same picture on one device and driver.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Timing {
    /// Milliseconds a frame with ray query.
    pub ray_query_ms: f64,
    /// Milliseconds a frame with the software structure.
    pub software_ms: f64,
}

impl Timing {
    /// The backend that took less.
    #[must_use]
    pub fn fastest(&self) -> Backend {
        if self.ray_query_ms < self.software_ms { Backend::RayQuery } else { Backend::Software }
    }
}

impl fmt::Display for Timing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "measured {:.2} ms with ray query, {:.2} ms in software",
            self.ray_query_ms, self.software_ms
        )
    }
}

/// The timing that was made for this device and driver, if there is one.
#[must_use]
pub fn cached_timing(info: &DeviceInfo) -> Option<Timing> {
    serde_json::from_slice(&read::regular(&cache_file(info)?, read::SETTINGS).ok()?).ok()
}

/// The cached timing, or a new one on a built-in scene.
fn timing(device: &vk::Device) -> Result<Timing, Error> {
    if let Some(timing) = cached_timing(device.info()) {
        return Ok(timing);
    }
    let timing = time(device, &builtin::by_name(builtin::DEFAULT)?)?;
    if let Some(file) = cache_file(device.info()) {
        // A cache that cannot be written is only slower next time.
        let text = serde_json::to_vec(&timing).unwrap_or_default();
        if let Err(error) = files::write_cache(&file, &text) {
            tracing::debug!("{}: {error}", file.display());
        }
    }
    Ok(timing)
}

/// Renders a small picture of `scene` with both.
fn time(device: &vk::Device, scene: &Scene) -> Result<Timing, Error> {
    let config = RenderConfig { size: [640, 480], ..RenderConfig::default() };
    let camera = scene.cameras.first().cloned().unwrap_or_else(|| scene.frame_camera());
    let milliseconds = |backend| -> Result<f64, Error> {
        let options =
            RendererOptions { backend: BackendChoice::Force(backend), ..RendererOptions::default() };
        let mut renderer = Renderer::new(device, scene.clone(), &options)?;
        let request = FrameRequest { repeat: 3, ..FrameRequest::default() };
        let frame = renderer.render(&config, &camera, &request)?;
        Ok(frame.total_ms.unwrap_or(frame.wall_ms))
    };
    Ok(Timing {
        ray_query_ms: milliseconds(Backend::RayQuery)?,
        software_ms: milliseconds(Backend::Software)?,
    })
}

fn cache_file(info: &DeviceInfo) -> Option<PathBuf> {
    let folder = vk::cache_folder()?;
    Some(folder.join(format!(
        "backend-{}-{}-{}.json",
        info.uuid,
        info.driver_version,
        env!("CARGO_PKG_VERSION")
    )))
}
