//! What tests need of the machine: one Vulkan device, used by one test at a time, whose validation messages
//! fail the test that caused them.
//!
//! A test whose need is not met says so and passes, unless the environment variable `PARHELION_REQUIRE` (words
//! separated by commas: `vulkan`, `ray-query`, `validation`, `shared`, `chromium`, `oidn`) lists it: then it fails.

// Every test binary has its own copy and none uses all of it.
#![allow(dead_code)]

pub(crate) mod asset;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use glam::{Affine3A, Vec2, Vec3};
use parhelion::config::RenderConfig;
use parhelion::renderer::{Frame, Layer};
use parhelion::scene::{Instance, LoadOptions, Material, Mesh, Scene};
use parhelion::techniques::indirect::Filter;
use parhelion::vk::{Device, DeviceOptions};
use serde_json::Value;

/// 180 VPLs, all asked by every pixel, and nothing else that brings indirect light: what parts are tested alone on.
pub(crate) fn plain() -> RenderConfig {
    let mut config = RenderConfig::default();
    config.vpl_shoot.vpls = 180;
    config.vpl_shoot.candidates = 1;
    config.whitted.light_samples = 16;
    config.indirect.compensation = 0;
    config.indirect.interleave = 1;
    config.indirect.filter = Filter::Paper;
    config
}

/// Their arithmetic mean.
pub(crate) fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
}

/// Fails unless `got` is `expected` but for a share of `tolerance`.
pub(crate) fn assert_close(what: &str, got: f64, expected: f64, tolerance: f64) {
    let error = got / expected - 1.0;
    println!("{what}: {got} ({:+.3} %)", 100.0 * error);
    assert!(error.abs() <= tolerance, "{what}: {got} instead of {expected} ({:+.3} %)", 100.0 * error);
}

/// Passes `present` on; where it is false, says that the test is skipped, or fails where `need` is required.
pub(crate) fn require(need: &str, present: bool, why: &str) -> bool {
    if !present {
        let required = std::env::var("PARHELION_REQUIRE").unwrap_or_default();
        assert!(!required.split(',').any(|word| word.trim() == need), "`{need}` is required: {why}");
        // Not `eprintln!`, which is shown for failing tests only.
        let _ = writeln!(std::io::stderr(), "skipped: {why}");
    }
    present
}

/// Keeps the device to one test. On drop, validation messages fail that test.
#[must_use = "bind it to a name: other tests may use the device once it is dropped"]
pub(crate) struct Guard {
    device: Device,
    _lock: MutexGuard<'static, ()>,
}

impl Drop for Guard {
    fn drop(&mut self) {
        let messages = self.device.validation().take();
        if !messages.is_empty() {
            let text = messages.join("\n");
            if std::thread::panicking() {
                eprintln!("validation messages:\n{text}");
            } else {
                panic!("validation messages:\n{text}");
            }
        }
    }
}

/// The device of this test binary and the guard to hold while it is used; `None` where there is none.
pub(crate) fn device() -> Option<(Guard, Device)> {
    static LOCK: Mutex<()> = Mutex::new(());
    static DEVICE: OnceLock<Result<Device, String>> = OnceLock::new();
    let lock = LOCK.lock().unwrap_or_else(PoisonError::into_inner);
    let device = DEVICE.get_or_init(|| {
        let options = DeviceOptions { validation: true, ..DeviceOptions::default() };
        let device = Device::open(&options).map_err(|e| e.to_string())?;
        let why = "no Vulkan validation layer; tests run without";
        require("validation", device.validation().is_active(), why);
        Ok(device)
    });
    match device {
        Ok(device) => Some((Guard { device: device.clone(), _lock: lock }, device.clone())),
        Err(why) => {
            require("vulkan", false, why);
            None
        }
    }
}

/// As [`device`], for tests that trace rays through acceleration structures.
pub(crate) fn ray_query_device() -> Option<(Guard, Device)> {
    let found = device().filter(|(_, device)| device.info().ray_query);
    require("ray-query", found.is_some(), "no Vulkan device with ray query");
    found
}

/// A file or folder of the shared data beside the repository, which is not there on every machine.
pub(crate) fn shared(path: &str) -> Option<PathBuf> {
    let found = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared").join(path);
    require("shared", found.exists(), &format!("no ../shared/{path}")).then_some(found)
}

/// A file with these bytes, in folders made where they are not there.
pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, bytes).unwrap();
    path
}

/// A PNG whose rows have `width` texels.
pub(crate) fn png(width: u32, texels: &[[u8; 4]]) -> Vec<u8> {
    let height = texels.len() as u32 / width;
    let image = image::RgbaImage::from_raw(width, height, texels.as_flattened().to_vec()).unwrap();
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// A unit square, upright.
pub(crate) const SQUARE: [Vec3; 4] =
    [Vec3::new(0.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.0), Vec3::new(1.0, 1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)];
/// Its texture coordinates, v from the top.
pub(crate) const UV: [Vec2; 4] =
    [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(1.0, 0.0), Vec2::new(0.0, 0.0)];

/// Mends nothing.
pub(crate) fn strict() -> LoadOptions {
    LoadOptions { strict: true, ..LoadOptions::default() }
}

/// A parallelogram with corner `o` and edges `u`, `v`; its front is the side of u × v.
pub(crate) fn quad(o: Vec3, u: Vec3, v: Vec3, material: u32) -> Mesh {
    Mesh {
        positions: vec![o, o + u, o + u + v, o + v],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![material; 2],
        ..Mesh::default()
    }
}

/// Each mesh where it is, in no light.
pub(crate) fn scene(meshes: Vec<impl Into<Arc<Mesh>>>, materials: Vec<Material>) -> Scene {
    let instance = |mesh| Instance { name: String::new(), mesh, transform: Affine3A::IDENTITY, moves: false };
    let instances = (0..meshes.len() as u32).map(instance).collect();
    Scene {
        name: "test".into(),
        meshes: meshes.into_iter().map(Into::into).collect(),
        instances,
        materials,
        ..Scene::default()
    }
}

/// Diffuse, alike in all channels.
pub(crate) fn gray(albedo: f32) -> Material {
    Material::diffuse("gray", Vec3::splat(albedo))
}

/// A frame without a pixel.
pub(crate) fn frame() -> Frame {
    Frame { beauty: Layer { channels: 3, ..Layer::default() }, ..Frame::default() }
}

/// The part of JSON Schema that the schemas in `docs` use; any other word in them fails the test.
pub(crate) fn check_schema(root: &Value, schema: &Value, value: &Value, at: &str) -> Result<(), String> {
    let fail = |what: String| Err(format!("{at}: {what}"));
    for (word, rule) in schema.as_object().unwrap() {
        match word.as_str() {
            "$schema" | "$defs" | "title" | "description" | "properties" => {}
            "$ref" => check_schema(root, root.pointer(&rule.as_str().unwrap()[1..]).unwrap(), value, at)?,
            "type" => {
                let kind = match value {
                    Value::Null => "null",
                    Value::Bool(_) => "boolean",
                    Value::Number(n) if n.is_u64() || n.is_i64() => "integer",
                    Value::Number(_) => "number",
                    Value::String(_) => "string",
                    Value::Array(_) => "array",
                    Value::Object(_) => "object",
                };
                let is = |name: &Value| name == kind || (name == "number" && kind == "integer");
                if !rule.as_array().map_or_else(|| is(rule), |kinds| kinds.iter().any(is)) {
                    return fail(format!("{kind} is not {rule}"));
                }
            }
            "enum" if !rule.as_array().unwrap().contains(value) => {
                return fail(format!("{value} is not of {rule}"));
            }
            "minimum" if value.is_number() && value.as_f64() < rule.as_f64() => {
                return fail(format!("below {rule}"));
            }
            "maximum" if value.is_number() && value.as_f64() > rule.as_f64() => {
                return fail(format!("above {rule}"));
            }
            "minItems" if value.as_array().is_some_and(|a| (a.len() as u64) < rule.as_u64().unwrap()) => {
                return fail("too short".into());
            }
            "maxItems" if value.as_array().is_some_and(|a| a.len() as u64 > rule.as_u64().unwrap()) => {
                return fail("too long".into());
            }
            "enum" | "minimum" | "maximum" | "minItems" | "maxItems" => {}
            "items" => {
                for (index, item) in value.as_array().into_iter().flatten().enumerate() {
                    check_schema(root, rule, item, &format!("{at}[{index}]"))?;
                }
            }
            "required" => {
                for key in rule.as_array().unwrap() {
                    if value.is_object() && value.get(key.as_str().unwrap()).is_none() {
                        return fail(format!("{key} is missing"));
                    }
                }
            }
            "additionalProperties" => {
                let known = |key: &str| schema["properties"].get(key).is_some();
                for (key, value) in value.as_object().into_iter().flatten().filter(|(key, _)| !known(key)) {
                    match rule {
                        Value::Bool(false) => return fail(format!("{key} is unknown")),
                        _ => check_schema(root, rule, value, &format!("{at}.{key}"))?,
                    }
                }
            }
            other => panic!("{at}: the schema uses `{other}`"),
        }
    }
    for (key, rule) in schema.get("properties").and_then(Value::as_object).into_iter().flatten() {
        if let Some(value) = value.get(key) {
            check_schema(root, rule, value, &format!("{at}.{key}"))?;
        }
    }
    Ok(())
}
