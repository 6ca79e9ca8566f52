//! The scene and the camera that a command is asked for.

use super::args::{Common, Machine, SceneFile};
use super::failure::{Failure, input};
use super::progress::Reporter;
use crate::renderer::{self, Renderer, RendererOptions};
use crate::scene::{
    self, Camera, Environment, FRAMED, LoadOptions, MAX_RADIANCE, Scene, SceneProfile, builtin,
};
use crate::vk::{self, DeviceOptions};
use glam::Vec3;
use std::ffi::OsString;
use std::path::Path;
use std::sync::Arc;

/// What to call the scene while it is not loaded.
pub(super) fn name(args: &Common) -> String {
    args.file.scene.as_ref().map_or(builtin::DEFAULT.into(), |scene| scene.display().to_string())
}

/// What names of outputs begin with where none are given.
pub(super) fn stem(args: &Common) -> OsString {
    let scene = args.file.scene.as_deref().unwrap_or(Path::new(builtin::DEFAULT));
    let builtin = scene.to_str().and_then(|name| name.strip_prefix("builtin:")).map(Path::new);
    let scene = builtin.unwrap_or(scene);
    scene.file_stem().unwrap_or(scene.as_os_str()).to_owned()
}

/// Opens the device asked for.
pub(super) fn device(machine: &Machine) -> Result<vk::Device, Failure> {
    let select = machine.device.clone();
    Ok(vk::Device::open(&DeviceOptions { select, ..DeviceOptions::default() })?)
}

/// Opens the device asked for and makes what draws the scene there.
pub(super) fn renderer(
    scene: Scene,
    args: &Common,
    machine: &Machine,
    options: &RendererOptions,
    reporter: &Reporter,
) -> Result<Renderer, Failure> {
    let device = device(machine)?;
    reporter.stage("build", &name(args));
    build(&device, scene, args, options)
}

/// Makes what draws the scene.
pub(super) fn build(
    device: &vk::Device,
    scene: Scene,
    args: &Common,
    options: &RendererOptions,
) -> Result<Renderer, Failure> {
    Renderer::new(device, scene, options).map_err(|error| unbuilt(args, error))
}

/// Why a scene can't be drawn, by its name.
pub(super) fn unbuilt(args: &Common, error: renderer::Error) -> Failure {
    match error {
        renderer::Error::Structure(_) => {
            let name = name(args);
            Failure { class: error.class(), error: anyhow::anyhow!("{name}: {error}") }
        }
        error => error.into(),
    }
}

/// Loads the scene asked for, or the default room.
pub(super) fn read(file: &SceneFile, motion: bool) -> Result<Scene, Failure> {
    let default = format!("builtin:{}", builtin::DEFAULT);
    let path = file.scene.as_deref().unwrap_or(Path::new(&default));
    Ok(scene::load(path, &LoadOptions { motion, ..file.options() })?)
}

impl SceneFile {
    pub(super) fn options(&self) -> LoadOptions {
        let (scene, roots) = (self.which.clone(), self.root.clone());
        LoadOptions { scene, strict: self.strict, roots, ..LoadOptions::default() }
    }
}

/// Loads the scene, lit, and finds the camera; says what the user should know of them.
pub(super) fn load(args: &Common, reporter: &Reporter) -> Result<(Scene, Camera), Failure> {
    load_with(args, false, reporter)
}

/// The same; the scene keeps what moves it, if it is to be in `motion`.
pub(super) fn load_with(
    args: &Common,
    motion: bool,
    reporter: &Reporter,
) -> Result<(Scene, Camera), Failure> {
    let environment = match &args.environment {
        Some(word) => Some(environment(word, &args.file.options(), reporter)?),
        None => None,
    };
    reporter.stage("load", &name(args));
    let mut scene = read(&args.file, motion)?;
    let camera = camera(args, &scene)?;
    if args.eye.is_some() {
        scene.notes.retain(|note| note != FRAMED);
    }
    scene.environment = environment.map(Arc::new).or(scene.environment);
    let shines = |scene: &Scene| {
        scene.environment.is_some() || scene.may_shine() || SceneProfile::of(scene, 0.0).emission
    };
    if scene.lights.is_empty() && !args.no_headlight && !shines(&scene) {
        scene.add_headlight(&camera);
    }
    scene.notes.iter().for_each(|note| reporter.note(note));
    Ok((scene, camera))
}

/// A file, or three numbers.
fn environment(word: &str, options: &LoadOptions, reporter: &Reporter) -> Result<Environment, Failure> {
    let numbers: Option<Vec<f32>> = word.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[r, g, b]) if [r, g, b].iter().all(|v| (0.0..=MAX_RADIANCE).contains(v)) => {
            Ok(Environment::constant(Vec3::new(r, g, b)))
        }
        Some(_) => Err(input!(
            "--environment: `{word}` is not three numbers of at least 0 and at most {MAX_RADIANCE:e}"
        )),
        None => {
            let (environment, notes) = Environment::load(Path::new(word), options).map_err(|error| {
                Failure { class: error.class(), error: anyhow::anyhow!("--environment: {error}") }
            })?;
            notes.iter().for_each(|note| reporter.note(note));
            Ok(environment)
        }
    }
}

/// The camera asked for; the first otherwise, or one that frames a scene that has none.
pub(super) fn camera(args: &Common, scene: &Scene) -> Result<Camera, Failure> {
    if let (Some(eye), Some(target)) = (args.eye, args.look_at) {
        let [eye, target] = [eye, target].map(|point| scene.local(point.into()));
        if eye == target {
            return Err(input!("--look-at: the same point as --eye"));
        }
        let fov = args.fov.unwrap_or(45.0).to_radians();
        return Ok(Camera::look_at("command line", eye, target, fov));
    }
    let Some(word) = &args.camera else {
        return Ok(scene.cameras.first().cloned().unwrap_or_else(|| scene.frame_camera()));
    };
    let named = |matches: &dyn Fn(&str) -> bool| {
        scene.cameras.iter().find(|c| matches(&c.name) || c.camera_name.as_deref().is_some_and(matches))
    };
    let found = named(&|name| name == word)
        .or_else(|| scene.cameras.get(word.parse::<usize>().ok()?))
        .or_else(|| named(&|name| name.to_lowercase() == word.to_lowercase()));
    found.cloned().ok_or_else(|| {
        let cameras = scene.cameras.iter().enumerate().map(|(i, camera)| match &camera.camera_name {
            Some(name) if *name != camera.name => format!("{i}: {} ({name})", camera.name),
            _ => format!("{i}: {}", camera.name),
        });
        input!("--camera: no camera `{word}`; choose among {}", cameras.collect::<Vec<_>>().join(", "))
    })
}
