//! `parhelion render --frames`: frames of films, where they go and what sees them.

mod common;

use common::asset::{Asset, F32, square};
use glam::Vec3;
use parhelion::output::read_exr;
use parhelion::renderer::{BackendChoice, FrameRequest, Renderer, RendererOptions};
use parhelion::scene::{self, Environment, LoadOptions};
use parhelion::vk::Backend;
use serde_json::json;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

struct Folder(tempfile::TempDir);

const LOOK: [&str; 9] =
    ["--preset", "fast", "--size", "16x12", "--exposure", "0", "--environment", "1,1,1", "-q"];

impl Folder {
    /// With a square that passes a camera in 1 s.
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        let mut asset = square();
        asset.json["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] = json!(0);
        let times = asset.accessor(bytemuck::cast_slice(&[0.0_f32, 1.0]), F32, "SCALAR", 2);
        let values = [[-1.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let values = asset.accessor(bytemuck::cast_slice(&values), F32, "VEC3", 2);
        let channel = json!({"sampler": 0, "target": {"node": 0, "path": "translation"}});
        let sampler = json!({"input": times, "output": values});
        asset.push("animations", json!({"name": "pass", "channels": [channel], "samplers": [sampler]}));
        folder.write("walk.glb", &asset);
        folder
    }

    fn write(&self, name: &str, asset: &Asset) {
        std::fs::write(self.path(name), asset.glb()).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_parhelion"));
        command.arg("render").args(args).current_dir(self.0.path());
        command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
        command
    }

    fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    fn render(&self, args: &[&str]) -> String {
        let output = self.run(args);
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    fn film(&self, args: &[&str]) -> String {
        self.render(&[&["walk.glb"], &LOOK[..], args].concat())
    }

    /// The same, telling what it does.
    fn told(&self, args: &[&str]) -> String {
        self.render(&[&["walk.glb"], &LOOK[..8], args].concat())
    }

    fn pixels(&self, name: &str) -> Vec<f32> {
        read_exr(&self.path(name)).unwrap().interleaved(&["R", "G", "B"]).unwrap()
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    fn pictures(&self) -> Vec<String> {
        let names = std::fs::read_dir(self.0.path()).unwrap();
        let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<_> =
            names.filter(|name| !name.ends_with("glb") && !name.ends_with("toml")).collect();
        names.sort();
        names
    }
}

/// A frame of a film is that frame alone, and that pose in a renderer of its own, bit for bit.
#[test]
fn a_frame_is_the_same_alone() {
    let Some((_guard, device)) = common::device() else { return };
    let folder = Folder::new();
    folder.film(&["--frames", "2-4", "--fps", "8", "-o", "a.##.exr", "-o", "a.##.png", "--stats", "s#.json"]);
    let names = [
        "a.02.exr", "a.02.png", "a.03.exr", "a.03.png", "a.04.exr", "a.04.png", "s2.json", "s3.json",
        "s4.json",
    ];
    assert_eq!(folder.pictures(), names);
    folder.film(&["--frames", "3", "--fps", "8", "-o", "alone.exr", "-o", "alone.png"]);
    assert!(folder.pixels("alone.exr") == folder.pixels("a.03.exr"));
    assert_eq!(folder.bytes("alone.png"), folder.bytes("a.03.png"));
    assert!(folder.pixels("a.02.exr") != folder.pixels("a.03.exr"));

    let base = scene::load(&folder.path("walk.glb"), &LoadOptions { motion: true, ..LoadOptions::default() });
    let mut base = base.unwrap();
    base.environment = Some(Environment::constant(Vec3::ONE).into());
    let pose = base.pose(&[0], 3.0 / 8.0).unwrap();
    let mut config = parhelion::config::RenderConfig { size: [16, 12], ..Default::default() };
    config.apply_preset("fast").unwrap();
    let camera = pose.cameras[0].clone();
    let options =
        RendererOptions { backend: BackendChoice::Force(Backend::Software), ..RendererOptions::default() };
    let mut renderer = Renderer::new(&device, pose, &options).unwrap();
    let frame = renderer.render(&config, &camera, &FrameRequest::default()).unwrap();
    assert!(frame.beauty.data == folder.pixels("a.03.exr"));
    assert!(frame.beauty.data.iter().any(|&value| value > 0.0));
}

#[test]
fn what_is_there_is_left_out() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    let film = ["--frames", "1-3", "--fps", "8", "-o", "a.#.exr", "-o", "a.#.png"];
    let again = |more: &[&str]| folder.told(&[&film[..], &["--resume"], more].concat());
    folder.film(&film);
    let before: Vec<_> = folder.pictures().iter().map(|name| folder.bytes(name)).collect();
    assert!(again(&[]).contains("frames: 0 drawn") && folder.pictures().len() == 6);
    // One that is gone, one cut short, and one whose second picture is another's.
    std::fs::remove_file(folder.path("a.1.exr")).unwrap();
    let png = folder.bytes("a.2.png");
    std::fs::write(folder.path("a.2.png"), &png[..png.len() - 30]).unwrap();
    assert!(again(&[]).contains("frames: 2 drawn"));
    std::fs::copy(folder.path("a.1.png"), folder.path("a.3.png")).unwrap();
    let told = again(&[]);
    assert!(told.contains("frames: 1 drawn") && told.contains("2 left out"), "{told}");
    let pixels = |name: &str| folder.pixels(name);
    let after: Vec<_> = folder.pictures().iter().map(|name| folder.bytes(name)).collect();
    for (name, (before, after)) in folder.pictures().iter().zip(before.iter().zip(&after)) {
        // Headers of .exr hold times.
        assert!(before == after || name.ends_with("exr"), "{name}");
    }
    assert!(pixels("a.1.exr") != pixels("a.3.exr"));
    assert!(again(&["--vpls", "9"]).contains("frames: 3 drawn"), "other settings");
    assert!(again(&["--vpls", "9", "--aov", "albedo"]).contains("frames: 3 drawn"), "a layer more");
    assert!(again(&["--vpls", "9", "--aov", "albedo"]).contains("frames: 0 drawn"));
    // Numbers that were not asked for before.
    let stats = ["--vpls", "9", "--aov", "albedo", "--stats", "s.#.json"];
    assert!(again(&stats).contains("frames: 3 drawn") && again(&stats).contains("frames: 0 drawn"));
    let path = ["--method", "path", "--spp", "4", "--time", "60s"];
    let path = |more: &[&str]| {
        let args = ["walk.glb", "--size", "16x12", "--frames", "1", "-o", "p.exr", "-o", "p.png", "--resume"];
        folder.render(&[&args[..], &path, more].concat())
    };
    assert!(path(&[]).contains("frames: 1 drawn") && path(&[]).contains("frames: 0 drawn in 0.0 s"));
    assert!(path(&["--noise", "0.5"]).contains("frames: 1 drawn"));
}

/// A sheet is all of its frames, and all that is written.
#[test]
fn a_sheet_holds_its_frames() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    folder.film(&["--frames", "1-7/3", "--fps", "8", "--sheet", "sheet.png"]);
    assert_eq!(folder.pictures(), ["sheet.png"]);
    folder.film(&["--frames", "4", "--fps", "8", "-o", "alone.png"]);
    let open = |name: &str| image::open(folder.path(name)).unwrap().to_rgb8();
    let (sheet, alone) = (open("sheet.png"), open("alone.png"));
    assert_eq!(sheet.dimensions(), (2 * 16 + 2, 2 * 12 + 2));
    assert!(alone.enumerate_pixels().all(|(x, y, pixel)| sheet.get_pixel(18 + x, y) == pixel));
}

#[test]
fn cameras_turn_and_follow_paths() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    folder.film(&["--frames", "0", "-o", "still.exr"]);
    folder.film(&["--turntable", "4", "--fps", "1e6", "-o", "turn.#.exr"]);
    assert_eq!(folder.pictures(), ["still.exr", "turn.1.exr", "turn.2.exr", "turn.3.exr", "turn.4.exr"]);
    assert!(folder.pixels("turn.1.exr") != folder.pixels("turn.2.exr"));
    // A quarter from the first frame on is the second frame.
    folder.film(&["--turntable", "4", "--frames", "2-2", "--fps", "1e6", "-o", "second.exr"]);
    assert!(folder.pixels("turn.2.exr") == folder.pixels("second.exr"));

    let key = |time: f32, x: f32| {
        format!("[[key]]\ntime = {time}\neye = [{x}, 0, 3]\nlook_at = [0, 0, 0]\nfov = 40\n")
    };
    std::fs::write(folder.path("way.toml"), key(0.0, 0.0) + &key(1.0, 0.5)).unwrap();
    folder.film(&["--frames", "8", "--fps", "8", "--camera-path", "way.toml", "-o", "way.exr"]);
    folder.film(&[
        "--frames",
        "8",
        "--fps",
        "8",
        "--eye",
        "0.5,0,3",
        "--look-at",
        "0,0,0",
        "--fov",
        "40",
        "-o",
        "eye.exr",
    ]);
    assert!(folder.pixels("way.exr") == folder.pixels("eye.exr"));
}

/// A picture of an open shutter is the mean of moments: of two samples, each alone by a shutter as good as closed.
#[test]
fn an_open_shutter_takes_the_mean_of_moments() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    let path = |more: &[&str]| {
        let look = ["walk.glb", "--method", "path", "--size", "16x12", "--environment", "1,1,1", "-q"];
        folder.render(&[&look[..], more].concat())
    };
    path(&[
        "--frames",
        "1",
        "--fps",
        "1",
        "--shutter",
        "1",
        "--spp",
        "64",
        "--aov",
        "half_a,half_b",
        "-o",
        "open.exr",
    ]);
    let blurred = folder.pixels("open.exr");
    let layer = |name: &str| {
        let names = ["R", "G", "B"].map(|channel| format!("{name}.{channel}"));
        let read = read_exr(&folder.path("open.exr")).unwrap();
        read.interleaved(&names.each_ref().map(String::as_str)).unwrap()
    };
    // Halves make the whole.
    for (mean, (a, b)) in blurred.iter().zip(layer("half_a").iter().zip(layer("half_b"))) {
        assert!((mean - 0.5 * (a + b)).abs() < 1e-4 * mean.abs().max(1.0));
    }
    // From the end of its way on the square stands still: an open shutter sees what a closed one does.
    path(&["--frames", "1", "--fps", "1", "--spp", "64", "-o", "closed.exr"]);
    assert!(blurred == folder.pixels("closed.exr"));
    // On its way it is blurred: what is lit by the sky alone is the mean of where the square was.
    let moving = |frames: &str, shutter: &str, name: &str| {
        path(&["--frames", frames, "--fps", "4", "--shutter", shutter, "--spp", "256", "-o", name]);
        folder.pixels(name)
    };
    let whole = moving("0", "1", "whole.exr");
    let parts: Vec<Vec<f32>> = ["0", "16", "32", "48"]
        .iter()
        .map(|first| {
            let (first, name) = (first.to_string(), format!("part{first}.exr"));
            path(&["--frames", &first, "--fps", "256", "--shutter", "1", "--spp", "256", "-o", &name]);
            folder.pixels(&name)
        })
        .collect();
    let mean = |i: usize| parts.iter().map(|part| part[i]).sum::<f32>() / 4.0;
    let off =
        (0..whole.len()).map(|i| f64::from((whole[i] - mean(i)).abs())).sum::<f64>() / whole.len() as f64;
    let apart = (0..whole.len()).map(|i| f64::from((parts[0][i] - parts[3][i]).abs())).sum::<f64>();
    assert!(off < 0.05 && apart / whole.len() as f64 > 2.0 * off, "{off} {apart}");
}

#[test]
fn bad_usage_is_refused_before_anything_is_drawn() {
    let folder = Folder::new();
    std::fs::write(folder.path("none.toml"), "").unwrap();
    std::fs::write(folder.path("odd.toml"), "[[key]]\ntime = 0\neye = [0, 0, 0]\nlook_at = [0, 0, 0]\n")
        .unwrap();
    let cases: &[(&[&str], &[&str])] = &[
        (&["--frames", "3-1"], &["--frames", "3-1"]),
        (&["--frames", "1-x"], &["--frames"]),
        (&["--frames", "1-9/0"], &["--frames"]),
        (&["--sheet", "s.png"], &["--sheet: needs --frames"]),
        (&["--frames", "1-2", "--sheet", "s.exr"], &["--sheet: s.exr", ".png"]),
        (&["--frames", "1-2", "--resume", "--sheet", "s.png"], &["--sheet", "--resume"]),
        (&["--frames", "1-10000000", "--sheet", "s.png"], &["--sheet", "16384"]),
        (&["--fps", "24"], &["--fps: needs --frames"]),
        (&["--frames", "1", "--fps", "0"], &["--fps"]),
        (&["--frames", "1-2", "-o", "a.png"], &["a.png", "#"]),
        (&["--frames", "1-2", "-o", "a#.png", "--stats", "s.json"], &["s.json", "#"]),
        (&["--frames", "1-2", "-o", "a#.png", "-o", "a##.png", "-o", "a#.png"], &["a1.png", "written twice"]),
        (&["--frames", "1", "--animation", "run"], &["--animation", "`run`", "0: pass"]),
        (&["--animation", "pass"], &["--animation: needs --frames"]),
        (&["--frames", "9-10", "-o", "k#.exr", "-o", "k##.exr"], &["k10.exr", "written twice"]),
        (&["--shutter", "0.5"], &["--shutter: needs --frames"]),
        (&["--frames", "1", "--shutter", "2"], &["--shutter"]),
        (
            &["--frames", "1", "--shutter", "1", "--method", "path", "--noise", "0.1"],
            &["--noise", "--shutter"],
        ),
        (&["--frames", "1", "--explain"], &["--explain"]),
        (&["--frames", "1", "--resume", "a.exr"], &["--resume"]),
        (&["--resume"], &["--resume", "--frames"]),
        (&["--turntable", "0"], &["--turntable"]),
        (&["--camera-path", "way.toml"], &["--frames"]),
        (&["--frames", "1", "--camera-path", "way.toml"], &["--camera-path", "way.toml"]),
        (&["--frames", "1", "--camera-path", "none.toml"], &["none.toml", "key"]),
        (&["--frames", "1", "--camera-path", "odd.toml"], &["odd.toml", "key 0", "same point"]),
        (&["--frames", "1", "-o", "nowhere/a.png"], &["nowhere/a.png"]),
    ];
    for (args, words) in cases {
        let output = folder.run(&[&["walk.glb", "--size", "8x8"], *args].concat());
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {told}");
        assert!(words.iter().all(|word| told.contains(word)), "{args:?}: {told}");
        assert_eq!(folder.pictures(), [""; 0], "{args:?}");
    }
}

/// Ctrl-C leaves frames that are whole, and none half written.
#[cfg(unix)]
#[test]
fn an_interrupted_film_leaves_whole_frames() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    let args = [&["walk.glb"], &LOOK[..], &["--frames", "1-100000", "-o", "a.#.exr"]].concat();
    let mut child = folder.command(&args).stderr(Stdio::piped()).spawn().unwrap();
    let second = folder.path("a.2.exr");
    let came = (0..1200).any(|_| {
        std::thread::sleep(Duration::from_millis(100));
        second.exists()
    });
    assert!(came);
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let names = folder.pictures();
    assert!(names.len() >= 2);
    names.iter().for_each(|name| assert_eq!(folder.pixels(name).len(), 3 * 16 * 12));
}
