//! What tests need of the machine: one Vulkan device, used by one test at a time, whose validation messages
//! fail the test that caused them.
//!
//! A test whose need is not met says so and passes, unless the environment variable `PARHELION_REQUIRE` (words
//! separated by commas: `vulkan`, `ray-query`, `validation`, `shared`, `oidn`) lists it: then it fails.

// Every test binary has its own copy and none uses all of it.
#![allow(dead_code)]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use glam::Vec3;
use parhelion::scene::Mesh;
use parhelion::vk::{Device, DeviceOptions};

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

/// A parallelogram with corner `o` and edges `u`, `v`; its front is the side of u × v.
pub(crate) fn quad(o: Vec3, u: Vec3, v: Vec3, material: u32) -> Mesh {
    Mesh {
        positions: vec![o, o + u, o + u + v, o + v],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        materials: vec![material; 2],
        ..Mesh::default()
    }
}
