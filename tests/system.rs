//! The command among other programs: signals, pipes, what killed runs leave, drivers that are broken, and names that would
//! move a terminal's cursor.

mod common;

use parhelion::output::read_exr;
use serde_json::json;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Settings that render in no time.
const SMALL: [&str; 10] = [
    "render",
    "builtin:cornell",
    "--size",
    "32x24",
    "--vpls",
    "9",
    "--bounces",
    "2",
    "--backend",
    "software",
];

/// What stands for any hang: nothing here takes that long.
const LIMIT: Duration = Duration::from_secs(120);

/// Escape, carriage return, new line, delete, a control of eight bits, ends of line and paragraph, an override.
const HOSTILE: &str = "\u{1b}[2K\r\nerror: forged\u{7f}\u{9b}1m\u{85}\u{2028}\u{2029}\u{202e}\u{2066}";

fn moves(c: char) -> bool {
    c != '\n' && (c.is_control() || "\u{2028}\u{2029}\u{202e}\u{2066}".contains(c))
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn names(&self) -> Vec<String> {
        let names = fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> =
            names.map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_parhelion"));
        command.args(args).current_dir(self.0.path());
        command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
        command
    }

    fn run(&self, args: &[&str]) -> Output {
        output(self.command(args))
    }

    fn spawn(&self, args: &[&str]) -> Running {
        Running::new(self.command(args).stdout(Stdio::null()))
    }
}

/// A program that does not outlive the test.
struct Running {
    child: Child,
    /// What it says on stderr, as it says it.
    lines: Receiver<String>,
}

impl Running {
    fn new(command: &mut Command) -> Self {
        let mut child = command.stdin(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        let (send, lines) = channel();
        thread::spawn(move || stderr.lines().map_while(Result::ok).try_for_each(|line| send.send(line)));
        Self { child, lines }
    }

    /// Waits until it says `word`.
    fn says(&self, word: &str) {
        let mut before = Vec::new();
        loop {
            match self.lines.recv_timeout(LIMIT) {
                Ok(line) if line.contains(word) => return,
                Ok(line) => before.push(line),
                Err(_) => panic!("not a word of {word}: {before:?}"),
            }
        }
    }

    fn wait(&mut self) -> ExitStatus {
        let begun = Instant::now();
        loop {
            match self.child.try_wait().unwrap() {
                Some(status) => return status,
                None => assert!(begun.elapsed() < LIMIT, "it does not end"),
            }
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// The exit code of what is to end by itself, and the rest of what it says.
    fn ended(mut self) -> (Option<i32>, Vec<String>) {
        (self.wait().code(), self.lines.iter().collect())
    }

    #[cfg(unix)]
    fn signal(&self, name: &str) {
        // The shell's own `kill`: a small system has no other.
        let kill = format!("kill -{name} {}", self.child.id());
        assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn output(mut command: Command) -> Output {
    let mut running = Running::new(command.stdout(Stdio::piped()));
    let mut out = running.child.stdout.take().unwrap();
    let stdout = thread::spawn(move || {
        let mut bytes = Vec::new();
        out.read_to_end(&mut bytes).map(|_| bytes)
    });
    let status = running.wait();
    let stderr = running.lines.iter().flat_map(|line| [line, "\n".into()]).collect::<String>();
    Output { status, stdout: stdout.join().unwrap().unwrap(), stderr: stderr.into() }
}

/// What `read` makes of a file, which it may have to wait for.
fn reading<T: Send + 'static>(read: impl FnOnce() -> T + Send + 'static) -> Receiver<T> {
    let (send, read_by) = channel();
    thread::spawn(move || send.send(read()));
    read_by
}

fn small<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SMALL[..], more].concat()
}

fn words(output: &Output) -> [String; 2] {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8(bytes.clone()).unwrap())
}

#[cfg(unix)]
fn fifo(folder: &Folder, name: &str) -> PathBuf {
    let path = folder.path(name);
    assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
    path
}

fn is_picture(bytes: &[u8]) -> bool {
    use exr::prelude::{ReadChannels, ReadLayers, read};
    let image = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
    image
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .is_ok_and(|image| image.layer_data.size.area() == 768)
}

/// Sends `name` once the render has begun, and says how it ended.
#[cfg(unix)]
fn stopped(folder: &Folder, args: &[&str], name: &str) {
    let outputs = ["--size", "2048x1536", "-o", "a.exr", "--stats", "s.json", "--progress", "json"];
    let running = folder.spawn(&[&["render", "builtin:cornell"], &outputs[..], args].concat());
    running.says("\"stage\":\"render\"");
    running.signal(name);
    let (code, rest) = running.ended();
    assert_eq!(code, Some(130), "{name}: {rest:?}");
    assert!(folder.names().is_empty(), "{name}: {:?}", folder.names());
}

/// Work for days, of which one workgroup alone may take minutes.
#[cfg(unix)]
#[test]
fn every_signal_to_stop_is_answered_in_the_middle_of_work() {
    let Some((_guard, device)) = common::device() else { return };
    let folder = Folder::new();
    // Where these tests run under `nohup` themselves, so does the program.
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let deaf = ignored.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).unwrap() & 1 == 1);
    for name in ["HUP", "QUIT", "TERM", "INT"].into_iter().skip(usize::from(deaf)) {
        stopped(&folder, &["--vpls", "5000", "--pixel-samples", "65536"], name);
    }
    let ray_query = device.info().ray_query.then_some("ray-query");
    for backend in ["software"].into_iter().chain(ray_query) {
        let path = ["--method", "path", "--max-depth", "1000", "--spp", "1000000"];
        stopped(&folder, &[&path[..], &["--backend", backend]].concat(), "TERM");
        stopped(&folder, &["--vpls", "1000000", "--backend", backend], "TERM");
    }
}

/// As `nohup` runs it.
#[cfg(unix)]
#[test]
fn a_hangup_that_is_ignored_stays_so() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::new();
    let script = format!("trap '' HUP; exec {} \"$@\"", env!("CARGO_BIN_EXE_parhelion"));
    let args = small(&["--progress", "json", "--pixel-samples", "64", "-o", "a.png"]);
    let mut command = Command::new("sh");
    command.args([&["-c", &script, "sh"][..], &args].concat()).current_dir(folder.path(""));
    command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR")).stdout(Stdio::null());
    let running = Running::new(&mut command);
    running.says("\"stage\":\"load\"");
    running.signal("HUP");
    assert_eq!(running.ended().0, Some(0));
    assert_eq!(folder.names(), ["a.png"]);
}

#[cfg(unix)]
#[test]
fn what_killed_runs_leave_is_cleared_by_the_next_and_what_is_being_written_is_not() {
    let folder = Folder::new();
    let live = File::create(folder.path(".parhelion-1-0.tmp")).unwrap();
    live.try_lock().unwrap();
    for name in [".parhelion-4194304-0.tmp", ".parhelion-1-1.tmp", "other.tmp"] {
        fs::write(folder.path(name), "x").unwrap();
    }
    let output = folder.run(&["graph", "-o", "a.dot"]);
    assert_eq!(output.status.code(), Some(0), "{:?}", words(&output));
    assert_eq!(folder.names(), [".parhelion-1-0.tmp", "a.dot", "other.tmp"]);
    drop(live);
    folder.run(&["graph", "-o", "a.dot"]);
    assert_eq!(folder.names(), ["a.dot", "other.tmp"]);
}

#[cfg(unix)]
#[test]
fn nothing_of_a_killed_run_outlasts_the_next() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::new();
    let endless = ["--spp", "1000000", "--preview", "1ms", "-o", "a.exr", "--backend", "software"];
    let path = ["render", "builtin:cornell", "--size", "32x24", "--method", "path"];
    let mut running = folder.spawn(&[&path[..], &endless].concat());
    let begun = Instant::now();
    while !folder.path("a.exr").exists() {
        assert!(begun.elapsed() < LIMIT && running.child.try_wait().unwrap().is_none());
        thread::sleep(Duration::from_millis(5));
    }
    drop(running);
    assert!(is_picture(&fs::read(folder.path("a.exr")).unwrap()));
    folder.run(&["graph", "-o", "a.dot"]);
    assert_eq!(folder.names(), ["a.dot", "a.exr"]);
}

#[cfg(unix)]
#[test]
fn a_pipe_gets_all_that_a_file_does() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::new();
    let tap = "compose:beauty";
    for (name, args) in [
        ("p.exr", vec!["-o", "p.exr"]),
        ("p.png", vec!["-o", "p.png"]),
        ("s.json", vec!["-o", "a.png", "--stats", "s.json"]),
        ("t.exr", vec!["-o", "a.png", "--tap"]),
    ] {
        let pipe = fifo(&folder, name);
        let tapped = format!("{}=t.exr", tap_of(&folder).unwrap_or_else(|| tap.into()));
        let args = if name == "t.exr" { [&args[..], &[&tapped]].concat() } else { args };
        let reader = reading(move || fs::read(pipe).unwrap());
        let output = folder.run(&small(&args));
        assert_eq!(output.status.code(), Some(0), "{name}: {:?}", words(&output));
        let bytes = reader.recv_timeout(LIMIT).unwrap();
        match name {
            "p.exr" | "t.exr" => assert!(is_picture(&bytes), "{name}: {} bytes", bytes.len()),
            "p.png" => {
                fs::remove_file(folder.path(name)).unwrap();
                folder.run(&small(&["-o", "p.png"]));
                assert!(bytes == fs::read(folder.path(name)).unwrap());
            }
            _ => assert_eq!(
                serde_json::from_slice::<serde_json::Value>(&bytes).unwrap()["parhelion"],
                env!("CARGO_PKG_VERSION")
            ),
        }
    }
}

/// The first image that the plan says a pass writes.
fn tap_of(folder: &Folder) -> Option<String> {
    folder.run(&["graph", "builtin:cornell", "-o", "g.json"]);
    let plan: serde_json::Value = serde_json::from_slice(&fs::read(folder.path("g.json")).ok()?).ok()?;
    plan["passes"].as_array()?.iter().find_map(|pass| {
        let written = pass["accesses"].as_array()?.iter().find(|access| {
            let resource = &plan["resources"][access["resource"].as_u64().unwrap() as usize];
            access["writes"] == true && resource["desc"]["kind"] == "image"
        })?;
        Some(format!("{}:{}", pass["path"].as_str()?, written["variable"].as_str()?))
    })
}

#[cfg(unix)]
#[test]
fn a_pipe_that_nobody_reads_is_waited_for_and_a_signal_ends_that() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::new();
    let pipe = fifo(&folder, "p.exr");
    let waiting = || {
        let running = folder.spawn(&small(&["-o", "p.exr"]));
        running.says("p.exr: waiting");
        running
    };
    let running = waiting();
    running.signal("TERM");
    let (code, rest) = running.ended();
    assert_eq!((code, rest.len()), (Some(130), 0), "{rest:?}");
    // A reader may come late.
    let running = waiting();
    let bytes = reading(move || fs::read(pipe).unwrap()).recv_timeout(LIMIT).unwrap();
    assert_eq!(running.ended().0, Some(0));
    assert!(is_picture(&bytes));
}

#[cfg(unix)]
#[test]
fn a_reader_that_leaves_in_the_middle_is_one_error() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::new();
    let pipe = fifo(&folder, "p.exr");
    let reader = reading(move || File::open(pipe).unwrap().read_exact(&mut [0; 4]).unwrap());
    // More than a pipe holds.
    let output =
        folder.run(&["render", "builtin:cornell", "--size", "256x256", "--vpls", "9", "-o", "p.exr"]);
    reader.recv_timeout(LIMIT).unwrap();
    let [_, message] = words(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_eq!(message, "error: p.exr: its reader left before the end\n");
}

#[cfg(unix)]
#[test]
fn a_cache_that_is_no_file_is_ignored() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::new();
    let render = || {
        let mut command = folder.command(&small(&["-o", "a.png"]));
        command.env("XDG_CACHE_HOME", folder.path("cache"));
        let output = output(command);
        assert_eq!(output.status.code(), Some(0), "{:?}", words(&output));
    };
    render();
    let cache = folder.path("cache/parhelion");
    let files: Vec<_> = fs::read_dir(&cache).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(!files.is_empty());
    for file in &files {
        fs::remove_file(file).unwrap();
        assert!(Command::new("mkfifo").arg(file).status().unwrap().success());
    }
    render();
    let left: Vec<_> = fs::read_dir(&cache).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!((left.len(), files.iter().any(|file| file.is_file())), (files.len(), false));
}

const BROKEN: [&str; 6] = [
    "{",
    "",
    "{}",
    r#"{ "file_format_version": 1, "ICD": { "library_path": 2, "api_version": 3 } }"#,
    r#"{ "file_format_version": "1.0.0", "ICD": { "library_path": "/nonexistent/a.so", "api_version": "1.3.0" } }"#,
    r#"{ "file_format_version": "1.0.0", "ICD": { "library_path": "libm.so.6", "api_version": "1.3.0" } }"#,
];

#[cfg(target_os = "linux")]
#[test]
fn a_broken_driver_is_named_by_its_manifest() {
    let folder = Folder::new();
    let manifest = folder.path("broken.json");
    let check = |what: &str, named: &Path| {
        for (args, variable) in
            [(small(&["-o", "a.png"]), "VK_DRIVER_FILES"), (vec!["doctor"], "VK_ICD_FILENAMES")]
        {
            let mut command = folder.command(&args);
            command.env_remove("VK_DRIVER_FILES").env_remove("VK_ICD_FILENAMES").env(variable, named);
            let output = output(command);
            let [_, message] = words(&output);
            assert_eq!(output.status.code(), Some(3), "{what}: {message}");
            assert!(message.contains("broken.json: ") && message.lines().count() == 1, "{what}: {message}");
        }
    };
    check("missing", &manifest);
    for text in BROKEN {
        fs::write(&manifest, text).unwrap();
        check(text, &manifest);
        check(text, &folder.path(""));
    }
    fs::remove_file(&manifest).unwrap();
    fifo(&folder, "broken.json");
    check("a pipe", &manifest);
}

#[cfg(target_os = "linux")]
#[test]
fn a_broken_driver_does_not_keep_others_from_serving() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::new();
    fs::create_dir_all(folder.path("data/vulkan/icd.d")).unwrap();
    let manifest = folder.path("data/vulkan/icd.d/a.json");
    let render = || {
        let mut command = folder.command(&small(&["-o", "a.png"]));
        match std::env::var_os("VK_DRIVER_FILES").or_else(|| std::env::var_os("VK_ICD_FILENAMES")) {
            Some(own) => {
                let both =
                    std::env::join_paths([&manifest].into_iter().cloned().chain(std::env::split_paths(&own)));
                command.env("VK_DRIVER_FILES", both.unwrap())
            }
            None => command.env("XDG_DATA_HOME", folder.path("data")),
        };
        let output = output(command);
        assert_eq!(output.status.code(), Some(0), "{:?}", words(&output));
    };
    for text in BROKEN {
        fs::write(&manifest, text).unwrap();
        render();
    }
}

#[test]
fn settings_that_the_scene_cannot_bear_are_usage() {
    let folder = Folder::new();
    let [_, message] = words(&folder.run(&["render", "builtin:cornell", "--scene", "9"]));
    assert!(message.starts_with("error: builtin:cornell: ") && message.contains("`9`"), "{message}");
    assert_eq!(folder.run(&["render", "builtin:cornell", "--scene", "9"]).status.code(), Some(2));
    let Some((_guard, _)) = common::device() else { return };
    for split in ["1e-4", "1e-30"] {
        let output = folder.run(&small(&["--visibility", "boxes", "--box-split", split]));
        let [_, message] = words(&output);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains("box_split") && message.lines().count() == 1, "{message}");
    }
}

/// A triangle whose every name is hostile.
fn hostile_scene(required: bool) -> String {
    let name = |word: &str| format!("{word}{HOSTILE}");
    let mut scene = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "name": name("scene"), "nodes": [0, 1] }],
        "nodes": [
            { "name": name("node"), "mesh": 0 },
            { "name": name("camera"), "camera": 0, "translation": [0, 0, 4] },
        ],
        "cameras": [{ "name": name("lens"), "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }],
        "extensionsUsed": [name("EXT")],
        "materials": [{ "name": name("material") }],
        "meshes": [{ "name": name("mesh"), "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-9, -9, 0], "max": [9, 9, 0] }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{ "byteLength": 36, "uri": "data:application/octet-stream;base64,AAAQwQAAEMEAAAAAAAAQQQAAEMEAAAAAAAAAAAAAEEEAAAAA" }],
    });
    if required {
        scene["extensionsRequired"] = json!([name("EXT")]);
    }
    scene.to_string()
}

#[cfg(unix)]
#[test]
fn names_never_move_the_cursor_or_forge_a_line() {
    let folder = Folder::new();
    let file = format!("wall{HOSTILE}.gltf");
    fs::write(folder.path("required.gltf"), hostile_scene(true)).unwrap();
    fs::write(folder.path(&file), hostile_scene(false)).unwrap();
    let missing = format!("missing{HOSTILE}.gltf");
    let shown = |args: &[&str], code: i32| {
        let output = folder.run(args);
        let texts = words(&output);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {texts:?}");
        for text in &texts {
            assert!(
                !text.contains(moves) && !text.lines().any(|line| line.starts_with("error: forged")),
                "{text:?}"
            );
        }
        texts
    };
    for args in [
        &["render", "required.gltf"][..],
        &["render", &missing],
        &["render", &file, "--camera", "none"],
        &["render", "-o", &missing],
        &["compare", &missing, &missing],
        &["compare", &missing, &missing, &missing],
        &["graph", "-D", HOSTILE],
        &["graph", "--method", HOSTILE],
    ] {
        let [_, message] = shown(args, 2);
        assert!(message.lines().filter(|line| line.starts_with("error: ")).count() == 1, "{message}");
        assert!(message.contains("\\u{1b}[2K\\r\\nerror: forged"), "{message}");
    }
    shown(&["graph", &file], 0);

    let Some((_guard, _)) = common::device() else { return };
    let size = ["--size", "16x12", "--backend", "software"];
    let (picture, stats) = (format!("a{HOSTILE}.exr"), format!("s{HOSTILE}.json"));
    for progress in ["none", "json", "bar"] {
        let args = ["render", &file, "-v", "-o", &picture, "--stats", &stats, "--progress", progress];
        if progress == "bar" {
            // A bar moves the cursor itself.
            let [_, text] = words(&folder.run(&[&args[..], &size].concat()));
            assert!(!text.contains(HOSTILE) && !text.contains("\r\nerror: forged"), "{text:?}");
            continue;
        }
        let [report, messages] = shown(&[&args[..], &size].concat(), 0);
        assert!(report.contains("a\\u{1b}[2K") && report.contains("scene: "), "{report}");
        if progress == "json" {
            let lines = messages.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
            assert!(
                lines.filter_map(|line| Some(line["what"].as_str()?.contains(HOSTILE))).any(|whole| whole)
            );
        }
    }
}

fn texels(folder: &Folder, name: &str) -> Vec<f32> {
    read_exr(&folder.path(name)).unwrap().interleaved(&["R", "G", "B"]).unwrap()
}

/// A triangle of 18 nm that the brightest lamp there may be stands 1 nm before: its radiance is beyond 32-bit floats.
const BEYOND_FLOATS: &str = r#"{
    "asset": { "version": "2.0" },
    "scenes": [{ "nodes": [0] }],
    "extensionsUsed": ["KHR_lights_punctual"],
    "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 1e24 }] } },
    "nodes": [
        { "scale": [1e-9, 1e-9, 1e-9], "children": [1, 2, 3] },
        { "mesh": 0 },
        { "camera": 0, "translation": [0, 0, 40] },
        { "translation": [0, 0, 1], "extensions": { "KHR_lights_punctual": { "light": 0 } } }
    ],
    "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }],
    "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
    "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
    "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
    "buffers": [{ "byteLength": 36, "uri": "data:application/octet-stream;base64,AAAQwQAAEMEAAAAAAAAQQQAAEMEAAAAAAAAAAAAAEEEAAAAA" }]
}"#;

#[test]
fn what_is_not_finite_is_told_with_pass_and_pixel() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::new();
    fs::write(folder.path("lamp.gltf"), BEYOND_FLOATS).unwrap();
    fs::write(folder.path("dim.gltf"), BEYOND_FLOATS.replace("1e24", "1e12")).unwrap();
    for (method, pass) in [("igi", "whitted/"), ("path", "path_trace/")] {
        let [size, rest] = [["--size", "24x18"], ["--backend", "software"]];
        let files = ["-q", "--method", method, "-o", "a.exr", "--stats", "s.json"];
        let render = |scene| {
            let output = folder.run(&[&["render", scene], &size[..], &rest, &files].concat());
            assert_eq!(output.status.code(), Some(0));
            let stats = serde_json::from_slice(&fs::read(folder.path("s.json")).unwrap()).unwrap();
            let (picture, [_, words]) = (texels(&folder, "a.exr"), words(&output));
            (stats, picture, words)
        };
        let (stats, picture, message): (serde_json::Value, _, _) = render("lamp.gltf");
        let odd = |pixel: &[f32]| pixel.iter().any(|v| !v.is_finite());
        let pixels: Vec<_> = picture.chunks(3).map(odd).collect();
        let first = pixels.iter().position(|&odd| odd).unwrap() as u64;
        let told = &stats["not_finite"];
        assert_eq!(told["pixels"], pixels.iter().filter(|&&odd| odd).count() as u64);
        assert_eq!(told["first"], json!([first % 24, first / 24]));
        let [name, at] = [&told["pass"], &told["first"]].map(|value| value.to_string());
        assert!(name.contains(pass), "{name}");
        let at = at.trim_matches(['[', ']']).replace(',', ", ");
        assert!(
            message.lines().count() == 1 && message.starts_with("warning: beauty is not finite"),
            "{message}"
        );
        assert!(
            message.contains(&format!("({at})")) && message.contains(name.trim_matches('"')),
            "{message}"
        );

        let (stats, picture, message) = render("dim.gltf");
        assert!(stats["not_finite"].is_null() && message.is_empty(), "{message}");
        assert!(!odd(&picture) && picture.iter().any(|&v| v > 0.0));
    }
}

/// Files are read as leniently, and as far from the scene, as the command line says.
#[test]
fn strict_and_root_decide_what_is_read() {
    let folder = Folder::new();
    fs::create_dir(folder.path("room")).unwrap();
    fs::create_dir(folder.path("textures")).unwrap();
    let picture = image::RgbImage::from_pixel(1, 1, image::Rgb([255, 0, 0]));
    picture.save(folder.path("textures/red.png")).unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path("room").join(name), text).unwrap();
    write("a.obj", "mtllib a.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n");
    write("a.mtl", "newmtl red\nmap_Kd ../textures/red.png\n");
    let graph = |args: &[&str]| {
        let output = folder.run(&[&["graph", "room/a.obj"], args].concat());
        let [_, message] = words(&output);
        (output.status.code(), message)
    };
    let (code, message) = graph(&["--strict"]);
    assert!(code == Some(2) && message.contains("red.png") && message.lines().count() == 1, "{message}");
    assert_eq!(graph(&["--strict", "--root", "."]), (Some(0), String::new()));
    assert_eq!(graph(&["--strict", "--root", "textures"]), (Some(0), String::new()));
    assert_eq!(graph(&["--strict", "--root", "room"]).0, Some(2));
    let (code, message) = graph(&["--root", "nowhere"]);
    assert!(code == Some(2) && message.contains("nowhere"), "{message}");

    let Some((_guard, _)) = common::device() else { return };
    let render = |args: &[&str]| {
        let small = ["render", "room/a.obj", "--size", "16x12", "--backend", "software", "-o", "a.exr"];
        let output = folder.run(&[&small, args].concat());
        let [_, message] = words(&output);
        assert_eq!(output.status.code(), Some(0), "{message}");
        (message, texels(&folder, "a.exr"))
    };
    let (message, gray) = render(&[]);
    assert!(message.lines().any(|line| line.starts_with("note: ") && line.contains("red.png")), "{message}");
    let (message, red) = render(&["--root", "textures"]);
    assert!(!message.contains("red.png"), "{message}");
    let green = |picture: &[f32]| picture.iter().skip(1).step_by(3).sum::<f32>();
    assert!(green(&gray) > 0.0 && green(&red) < 0.5 * green(&gray));
}

/// A render by a shell that has set a limit.
#[cfg(unix)]
fn limited(folder: &Folder, limit: &str) -> Command {
    let mut command = Command::new("sh");
    let program = format!("ulimit {limit}; exec \"$@\"");
    command.args(["-c", &program, "sh", env!("CARGO_BIN_EXE_parhelion"), "render"]);
    command.current_dir(folder.0.path()).env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
    command
}

#[cfg(unix)]
#[test]
fn limits_of_the_shell_are_errors() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::new();
    for (limit, code, word) in [("-v 300000", 71, "1.5 GiB"), ("-v 1000000", 71, "1.5 GiB")] {
        let mut command = limited(&folder, limit);
        command.args(&SMALL[1..]).args(["-o", "a.exr", "-q"]).env("XDG_CACHE_HOME", "/nowhere");
        let output = output(command);
        let [_, message] = words(&output);
        assert_eq!(output.status.code(), Some(code), "{limit}: {message}");
        assert!(message.lines().count() == 1 && message.contains(word), "{limit}: {message}");
        assert!(folder.names().is_empty(), "{:?}", folder.names());
    }
}

/// What each of these small files is to become.
#[cfg(unix)]
#[test]
fn files_that_once_failed_are_mended_or_refused() {
    let Some(cases) = common::shared("cases") else { return };
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::new();
    let render = |name: &str, args: &[&str]| {
        // Some would take what the machine has.
        let mut command = limited(&folder, "-v 16000000");
        command
            .arg(cases.join(name))
            .args(["--size", "24x18", "--backend", "software", "-o", "a.exr"])
            .args(args);
        let output = output(command);
        let [_, message] = words(&output);
        (output.status.code(), message)
    };
    for (name, word) in [
        ("tangent_parallel_to_normal.gltf", ""),
        ("no_mtl.obj", "`gone.mtl`"),
        ("no_usemtl.obj", "`a`"),
        ("scene_without_nodes.gltf", ""),
        ("hugeuv.glb", "texture coordinates"),
    ] {
        let notes =
            |message: &str| message.lines().any(|line| line.starts_with("note: ") && line.contains(word));
        let (code, message) = render(name, &["--method", "path"]);
        assert!(code == Some(0) && notes(&message) || word.is_empty(), "{name}: {message}");
        assert!(!message.contains("warning"), "{name}: {message}");
        let strict = if word.is_empty() { 0 } else { 2 };
        let (code, message) = render(name, &["--strict"]);
        assert!(code == Some(strict) && message.contains(word), "{name}: {message}");
    }
    for (name, words) in
        [("light3e+38.glb", ["lights[0]", "3e38"]), ("esc.gltf", ["extensionsRequired", "\\u{1b}[31mRED"])]
    {
        let (code, message) = render(name, &[]);
        assert_eq!(code, Some(2), "{name}: {message}");
        let message = message.lines().last().unwrap();
        let named = message.strip_prefix("error: ").is_some_and(|m| m.contains(name));
        assert!(named && words.iter().all(|word| message.contains(word)), "{message}");
    }
}

/// 128 million triangles are 64 000 in two levels: beside the driver, a gigabyte is more than enough. Boxes have one level.
#[cfg(target_os = "linux")]
#[test]
fn instances_take_little_memory() {
    let Some((_guard, _)) = common::device() else { return };
    let Some(cases) = common::shared("cases") else { return };
    let folder = Folder::new();
    let render = |limit: &str, args: &[&str]| {
        let mut command = limited(&folder, limit);
        command.arg(cases.join("instances_128m.glb")).args(["--size", "24x18", "--backend", "software"]);
        command.args(["-q", "-o", "a.exr"]).args(args);
        let output = output(command);
        let [_, message] = words(&output);
        (output.status.code(), message)
    };
    assert_eq!(render("-v 2500000", &[]), (Some(0), String::new()));
    let pixels = texels(&folder, "a.exr");
    assert!(pixels.iter().any(|&value| value > 0.0));
    for visibility in ["boxes", "boxes-inline"] {
        let (code, message) = render("-v 16000000", &["--visibility", visibility]);
        assert_eq!(code, Some(71), "{message}");
        let words = ["error: ", "instances_128m.glb", "128000000 triangles", "GiB"];
        assert!(words.iter().all(|word| message.contains(word)), "{message}");
    }
}

#[test]
fn long_words_are_not_told_whole() {
    let folder = Folder::new();
    let long = "x".repeat(300_000);
    let scene =
        json!({ "asset": { "version": "2.0" }, "extensionsUsed": [long], "extensionsRequired": [long] });
    fs::write(folder.path("long.gltf"), scene.to_string()).unwrap();
    let output = folder.run(&["render", "long.gltf"]);
    let [_, message] = words(&output);
    assert_eq!(output.status.code(), Some(2));
    assert!(message.starts_with("error: long.gltf") && message.len() < 10_000, "{} bytes", message.len());
}
