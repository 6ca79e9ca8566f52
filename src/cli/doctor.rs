//! `parhelion doctor`.

use super::args;
use super::failure::Failure;
use super::print::print;
use crate::ErrorClass;
use crate::config::RenderConfig;
use crate::renderer::{Aov, BackendChoice, FrameRequest, Renderer, RendererOptions, Timing, cached_timing};
use crate::scene::{Camera, Instance, Material, Mesh, Scene};
use crate::text;
use crate::vk::Backend;
use crate::vk::{self, DeviceInfo, DeviceKind, DeviceOptions};
use glam::Vec3;
use std::fmt::Write;
use std::sync::Arc;

/// What was found out about one device.
#[derive(serde::Serialize)]
struct Report {
    #[serde(flatten)]
    info: DeviceInfo,
    /// The backend `auto` takes, and why.
    backend: Option<&'static str>,
    reason: Option<String>,
    /// The timing behind `auto`, where one was needed.
    timing: Option<Timing>,
    rays: Vec<Ray>,
    /// What went wrong on the way.
    error: Option<String>,
}

/// One ray sent to a wall at a known distance.
#[derive(serde::Serialize)]
struct Ray {
    backend: &'static str,
    /// Distance it came back with (m).
    distance: f32,
    expected: f32,
    ok: bool,
}

impl Report {
    fn works(&self) -> bool {
        self.error.is_none() && !self.rays.is_empty() && self.rays.iter().all(|ray| ray.ok)
    }
}

pub(super) fn run(args: &args::Doctor) -> Result<(), Failure> {
    let reports: Vec<Report> = vk::enumerate()?.into_iter().map(examine).collect();
    let suitable = reports.iter().filter(|report| report.info.missing.is_empty());
    let default =
        suitable.clone().max_by_key(|report| (report.info.score, std::cmp::Reverse(report.info.index)));
    let default = default.map(|report| report.info.index);
    if args.json {
        let json = format!("{:#}\n", serde_json::json!({ "devices": reports, "default": default }));
        print(&text::json(&json))?;
    } else {
        let mut text: String = reports.iter().map(describe).collect();
        if let Some(default) = default {
            let _ = writeln!(text, "default device: {default}");
        }
        print(&text)?;
    }
    if default.is_none() {
        let found = reports.iter().map(|r| format!("{} lacks {}", r.info.name, r.info.missing.join(", ")));
        return Err(vk::Error::NoDevice { found: found.collect() }.into());
    }
    match suitable.clone().find(|report| !report.works()) {
        None => Ok(()),
        Some(report) => Err(Failure {
            class: ErrorClass::Other,
            error: anyhow::anyhow!("device {} does not work", report.info.index),
        }),
    }
}

fn examine(info: DeviceInfo) -> Report {
    let mut report =
        Report { info, backend: None, reason: None, timing: None, rays: Vec::new(), error: None };
    if report.info.missing.is_empty() {
        report.error = trace(&mut report).err().map(|failure| failure.error.to_string());
    }
    report
}

fn trace(report: &mut Report) -> Result<(), Failure> {
    let options = DeviceOptions { select: Some(report.info.index.to_string()), ..DeviceOptions::default() };
    let device = vk::Device::open(&options)?;
    let (backend, reason) = {
        let renderer = Renderer::new(&device, wall(), &RendererOptions::default())?;
        let (backend, reason) = renderer.backend();
        (backend, reason.to_owned())
    };
    (report.backend, report.reason) = (Some(backend.name()), Some(reason));
    report.timing = cached_timing(&report.info);
    let backends = [Backend::Software, Backend::RayQuery];
    for backend in backends.into_iter().filter(|b| *b == Backend::Software || report.info.ray_query) {
        let options =
            RendererOptions { backend: BackendChoice::Force(backend), ..RendererOptions::default() };
        let mut renderer = Renderer::new(&device, wall(), &options)?;
        let camera = Camera::look_at("doctor", Vec3::ZERO, Vec3::NEG_Z, 1.0);
        let config = RenderConfig { size: [1, 1], ..RenderConfig::default() };
        let request = FrameRequest { aovs: &[Aov::Depth], ..FrameRequest::default() };
        let frame = renderer.render(&config, &camera, &request)?;
        let distance =
            frame.aovs.first().and_then(|(_, layer)| layer.data.first()).copied().unwrap_or(f32::NAN);
        let ok = (distance - WALL).abs() <= 1e-5 * WALL;
        report.rays.push(Ray { backend: backend.name(), distance, expected: WALL, ok });
    }
    Ok(())
}

/// Distance of the wall (m).
const WALL: f32 = 2.0;

fn wall() -> Scene {
    let corner = |x, y| Vec3::new(x, y, -WALL);
    Scene {
        name: "doctor".into(),
        meshes: vec![Arc::new(Mesh {
            name: "wall".into(),
            positions: vec![corner(-3.0, -3.0), corner(3.0, -3.0), corner(0.0, 3.0)],
            triangles: vec![[0, 1, 2]],
            materials: vec![0],
            ..Mesh::default()
        })],
        instances: vec![Instance {
            name: "wall".into(),
            mesh: 0,
            transform: glam::Affine3A::IDENTITY,
            moves: false,
        }],
        materials: vec![Material::diffuse("wall", Vec3::splat(0.5))],
        ..Scene::default()
    }
}

fn describe(report: &Report) -> String {
    let info = &report.info;
    let mut text = format!("{}  {}\n", info.index, info.name);
    let mut line = |name: &str, value: &str| {
        let _ = writeln!(text, "   {name:<10} {value}");
    };
    let kind = match info.kind {
        DeviceKind::Cpu => "CPU",
        DeviceKind::Integrated => "integrated GPU",
        DeviceKind::Discrete => "discrete GPU",
        DeviceKind::Virtual => "virtual GPU",
        DeviceKind::Other => "unknown",
    };
    let yes = |what: bool| if what { "yes" } else { "no" };
    line("kind", kind);
    line("driver", &format!("{}, Vulkan {}", info.driver(), info.api_version));
    line("UUID", &info.uuid);
    line("memory", &format!("{:.1} GiB", info.memory_bytes as f64 / f64::from(1 << 30)));
    let subgroup = info.subgroup_size;
    line(
        "features",
        &format!(
            "ray query {}, timestamps {}, subgroups of {subgroup}",
            yes(info.ray_query),
            yes(info.timestamps)
        ),
    );
    line("missing", &if info.missing.is_empty() { "nothing".to_owned() } else { info.missing.join(", ") });
    if let Some((backend, reason)) = report.backend.zip(report.reason.as_ref()) {
        line("backend", &format!("{backend} ({reason})"));
    }
    for ray in &report.rays {
        let verdict = if ray.ok { "as it should" } else { "WRONG" };
        line(
            "ray",
            &format!("{}: {} m to a wall at {} m, {verdict}", ray.backend, ray.distance, ray.expected),
        );
    }
    if let Some(error) = &report.error {
        line("error", error);
    }
    text
}
