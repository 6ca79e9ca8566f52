//! The command line, as a user meets it: exit codes, files, and what is printed where.

mod common;

use common::check_schema as check;

use exr::meta::attribute::AttributeValue;
use exr::prelude::{ReadChannels, ReadLayers, Vec2, read};
use parhelion::config::RenderConfig;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Settings that render in no time.
const SMALL: [&str; 6] = ["--size", "32x24", "--vpls", "9", "--bounces", "2"];

/// A wall at z = 0 (at −1 in scene `deep`, which has no light), a camera `Far` at 4 and one `Near` at 2.
const WALL: &str = r#"{
  "asset": { "version": "2.0" }, "scene": 0,
  "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_specular"],
  "scenes": [{ "name": "shallow", "nodes": [0, 1, 2, 3] }, { "name": "deep", "nodes": [4, 1, 2] }],
  "nodes": [
    { "name": "wall", "mesh": 0 },
    { "name": "Far", "camera": 0, "translation": [0, 0, 4] },
    { "name": "Near", "camera": 0, "translation": [0, 0, 2] },
    { "name": "lamp", "translation": [0, 1, 3], "extensions": { "KHR_lights_punctual": { "light": 0 } } },
    { "name": "back wall", "mesh": 0, "translation": [0, 0, -1] }
  ],
  "cameras": [{ "name": "lens", "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }],
  "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 10 }] } },
  "materials": [{
    "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0 },
    "extensions": { "KHR_materials_specular": { "specularFactor": 0 } }
  }],
  "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
  "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-9, -9, 0], "max": [9, 9, 0] }],
  "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
  "buffers": [{ "byteLength": 36, "uri": "data:application/octet-stream;base64,AAAQwQAAEMEAAAAAAAAQQQAAEMEAAAAAAAAAAAAAEEEAAAAA" }]
}"#;

struct Folder(tempfile::TempDir);

impl Folder {
    fn empty() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn with_wall() -> Self {
        let folder = Self::empty();
        folder.write("wall.gltf", WALL);
        folder
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path().join(name), text).unwrap();
    }

    fn names(&self) -> Vec<String> {
        Self::names_in(self.path())
    }

    fn names_in(path: &Path) -> Vec<String> {
        let names = std::fs::read_dir(path).unwrap();
        let mut names: Vec<_> = names.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&std::fs::read(self.path().join(name)).unwrap()).unwrap()
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_parhelion"));
        command.args(args).current_dir(self.path());
        command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
        command
    }

    fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// Renders; `args` after the small settings, so that they win.
    fn render(&self, args: &[&str]) -> Output {
        let output = self.run(&[&["render"], &SMALL[..], args].concat());
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", stderr(&output));
        output
    }

    fn without_driver(&self, args: &[&str]) -> Output {
        self.command(args)
            .env("VK_DRIVER_FILES", "/nonexistent")
            .env("VK_ICD_FILENAMES", "/nonexistent")
            .output()
            .unwrap()
    }
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Channels, windows and attributes of an OpenEXR file.
struct Exr {
    channels: BTreeMap<String, Vec<f32>>,
    position: Vec2<i32>,
    size: Vec2<usize>,
    display: Vec2<usize>,
    attributes: BTreeMap<String, AttributeValue>,
}

fn exr(folder: &Folder, name: &str) -> Exr {
    let image = read().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
    let image = image.from_file(folder.path().join(name)).unwrap();
    let [layer] = &image.layer_data[..] else { panic!("{} parts", image.layer_data.len()) };
    assert_eq!(layer.attributes.layer_name, None);
    let channels = layer
        .channel_data
        .list
        .iter()
        .map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect()));
    let attributes = &layer.attributes.other;
    Exr {
        channels: channels.collect(),
        position: layer.attributes.layer_position,
        size: layer.size,
        display: image.attributes.display_window.size,
        attributes: attributes.iter().map(|(name, value)| (name.to_string(), value.clone())).collect(),
    }
}

fn png(folder: &Folder, name: &str) -> (Vec<u8>, u32, BTreeMap<String, String>) {
    let file = BufReader::new(std::fs::File::open(folder.path().join(name)).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    let info = reader.info();
    assert!(info.srgb.is_some() && info.color_type == png::ColorType::Rgb);
    let texts = info.uncompressed_latin1_text.iter().map(|t| (t.keyword.clone(), t.text.clone())).collect();
    (pixels, info.width, texts)
}

/// `part` is what `whole` shows in the window x0, y0, x1, y1.
fn assert_part<T: PartialEq>(
    whole: &[T],
    part: &[T],
    width: usize,
    per_pixel: usize,
    [x0, y0, x1, y1]: [usize; 4],
) {
    let cut = (y0..y1).flat_map(|y| &whole[(y * width + x0) * per_pixel..(y * width + x1) * per_pixel]);
    assert!(cut.eq(part.iter()), "a crop differs from the whole");
}

#[test]
fn bad_usage_exits_with_2_names_the_option_and_touches_nothing() {
    let folder = Folder::empty();
    for (args, words) in [
        (&["frobnicate"][..], &["frobnicate"][..]),
        (&["render", "--frobnicate"], &["--frobnicate"]),
        (&["render", "--size", "800"], &["--size", "800x600"]),
        (&["render", "--size", "0x5"], &["--size", "16384"]),
        (&["render", "--size", "5x16385"], &["--size", "16384"]),
        (&["render", "--size", "-5x5"], &["--size"]),
        (&["render", "--method", "magic"], &["--method", "igi"]),
        (&["render", "--vpls", "0"], &["--vpls"]),
        (&["render", "--vpls", "-1"], &["--vpls"]),
        (&["render", "--vpls", "16777217"], &["--vpls"]),
        (&["render", "--vpls", "1e3"], &["--vpls"]),
        (&["render", "--bounces", "0"], &["--bounces"]),
        (&["render", "--min-distance", "nan"], &["--min-distance"]),
        (&["render", "--min-distance", "inf"], &["--min-distance"]),
        (&["render", "--min-distance", "-1"], &["--min-distance"]),
        (&["render", "--visibility", "spheres"], &["--visibility", "boxes-plane"]),
        (&["render", "--visibility", "boxes", "--box-split", "0"], &["--box-split"]),
        (&["render", "--box-split", "0.5"], &["--box-split", "exact"]),
        (&["render", "--visibility", "boxes-inline", "--box-split", "0.5"], &["--box-split", "boxes-inline"]),
        (&["render", "-D", "indirect.box_split=1"], &["-D indirect.box_split=1"]),
        (&["render", "--exposure", "NaN"], &["--exposure"]),
        (&["render", "--exposure", "1e9"], &["--exposure"]),
        (&["render", "--tone-map", "filmic"], &["--tone-map", "reinhard", "aces"]),
        (&["render", "-D", "tone_map.white=0"], &["-D tone_map.white=0"]),
        (&["render", "--glare", "1.5"], &["--glare", "1.5"]),
        (&["render", "--glare", "nan"], &["--glare"]),
        (&["render", "-D", "glare.radius=2"], &["-D glare.radius=2"]),
        (
            &["render", "--denoise", "--method", "path", "--aov", "variance", "-o", "a.exr"],
            &["--denoise", "variance", "mean"],
        ),
        (
            &["render", "--denoise", "--method", "path", "--resume", "a.exr"],
            &["--denoise", "--resume", "reference"],
        ),
        (&["render", "--pixel-samples", "0"], &["--pixel-samples"]),
        (&["render", "--seed", "-1"], &["--seed"]),
        (&["render", "--repeat", "0"], &["--repeat"]),
        (&["render", "--crop", "0,0,10"], &["--crop"]),
        (&["render", "--crop", "5,5,5,9"], &["--crop"]),
        (&["render", "--size", "8x8", "--crop", "0,0,9,8"], &["--crop", "8x8"]),
        (&["render", "--eye", "0,0,1"], &["--look-at"]),
        (&["render", "--eye", "0,0,nan", "--look-at", "0,0,0"], &["--eye"]),
        (&["render", "--eye", "0,0,1", "--look-at", "0,0,1"], &["--look-at"]),
        (&["render", "--eye", "0,0,1", "--look-at", "0,0,0", "--fov", "180"], &["--fov"]),
        (&["render", "--fov", "30"], &["--eye"]),
        (&["render", "--camera", "a", "--eye", "0,0,1", "--look-at", "0,0,0"], &["--camera", "--eye"]),
        (&["render", "--aov", "depht", "-o", "a.exr"], &["--aov", "depht", "irradiance"]),
        (&["render", "--aov", "depth"], &["--aov", ".exr"]),
        (&["render", "--aov", "N,N", "-o", "a.exr"], &["--aov", "N"]),
        (&["render", "--backend", "embree"], &["--backend", "ray-query"]),
        (&["render", "--progress", "dots"], &["--progress"]),
        (&["render", "--tap", "a.exr"], &["--tap"]),
        (&["render", "--tap", "a:b=c.png"], &["--tap", "c.png"]),
        (&["render", "-q", "-v"], &["--quiet"]),
        (&["render", "-D", "seed"], &["-D", "KEY=VALUE"]),
        (&["render", "-D", "vpl_shoot.vpls=0"], &["-D vpl_shoot.vpls=0"]),
        (&["render", "-D", "indirect.min_distance=nan"], &["-D indirect.min_distance=nan"]),
        (&["render", "-o", "a.jpg"], &["a.jpg", ".png"]),
        (&["render", "-o", "a"], &["a:", ".png"]),
        (&["render", "-o", "a.png", "-o", "a.png"], &["a.png", "twice"]),
        (&["paper", "--size", "0x5"], &["--size", "16384"]),
        (&["paper", "--repeat", "-1"], &["--repeat"]),
        (&["paper", "--vpls", "30"], &["--vpls"]),
        (&["paper", "--camera", "a", "--eye", "0,0,1", "--look-at", "0,0,0"], &["--camera", "--eye"]),
        (&["graph", "-o", "a.svg"], &["a.svg", ".dot"]),
        (&["graph", "--method", "magic"], &["--method"]),
        (&["graph", "--preset", "magic"], &["--preset", "paper-canonical"]),
        (&["graph", "--config", "missing.toml"], &["missing.toml"]),
        (&["graph", "-D", "vpls=90"], &["-D vpls=90", "vpl_shoot.vpls"]),
        (&["graph", "-D", "vpl_shoot.vpls=0"], &["-D vpl_shoot.vpls=0"]),
    ] {
        let output = folder.run(args);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert!(words.iter().all(|word| message.contains(word)), "{args:?}: {message}");
        assert!(message.starts_with("error: ") && output.stdout.is_empty(), "{args:?}: {message}");
    }
    assert!(folder.names().is_empty());
}

#[test]
fn bad_scenes_exit_with_2_and_name_the_file() {
    let folder = Folder::with_wall();
    folder.write("broken.gltf", "{");
    for (args, words) in [
        (&["missing.glb"][..], &["missing.glb"][..]),
        (&["scene.blend"], &["scene.blend", ".glb"]),
        (&["builtin:nowhere"], &["nowhere"]),
        (&["broken.gltf"], &["broken.gltf"]),
        (&["wall.gltf", "--scene", "third"], &["wall.gltf", "third"]),
        (&["wall.gltf", "--camera", "Middle"], &["--camera", "Middle", "0: Far", "1: Near"]),
        (&["wall.gltf", "--camera", "2"], &["--camera"]),
    ] {
        for command in [&["render"][..], &["paper"], &["graph"]] {
            if command == ["graph"] && args.len() > 1 {
                continue;
            }
            let output = folder.run(&[command, args].concat());
            let message = stderr(&output);
            assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
            assert!(words.iter().all(|word| message.contains(word)), "{args:?}: {message}");
            assert_eq!(message.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{message}");
        }
    }
    assert_eq!(folder.names(), ["broken.gltf", "wall.gltf"]);
}

#[test]
fn unknown_keys_suggest_the_nearest() {
    let folder = Folder::empty();
    folder.write("typo.toml", "[vpl_shoot]\nbounce = 2\n");
    folder.write("range.toml", "vpl_shoot.bounces = 99\n");
    folder.write("syntax.toml", "seed = 1\nsize = [\n");
    for (args, words) in [
        (&["-D", "vpls=90"][..], &["-D vpls=90", "vpl_shoot.vpls"][..]),
        (&["-D", "indirect.min_dist=1"], &["indirect.min_distance"]),
        (&["--config", "typo.toml"], &["typo.toml", "vpl_shoot.bounce`", "vpl_shoot.bounces"]),
        (&["--config", "range.toml"], &["range.toml", "vpl_shoot.bounces", "32"]),
        (&["--config", "syntax.toml"], &["syntax.toml", "line 2"]),
        (&["--config", "missing.toml"], &["missing.toml"]),
    ] {
        let output = folder.run(&[&["render"], args].concat());
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert!(words.iter().all(|word| message.contains(word)), "{args:?}: {message}");
    }
}

/// The scene does not exist: an error about the output alone shows that it comes first.
#[test]
fn outputs_that_cannot_be_written_are_found_before_the_scene_is_read() {
    let folder = Folder::empty();
    std::fs::create_dir(folder.path().join("folder.png")).unwrap();
    folder.write("file", "");
    for args in [
        &["-o", "missing/a.png"][..],
        &["-o", "folder.png"],
        &["-o", "file/a.exr"],
        &["-o", "a.png", "--stats", "missing/s.json"],
        &["-o", "a.png", "--tap", "a:b=missing/t.exr"],
    ] {
        let output = folder.run(&[&["render", "none.glb"], args].concat());
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(
            args.iter().any(|file| message.contains(file.rsplit('=').next().unwrap())),
            "{args:?}: {message}"
        );
        assert!(!message.contains("none.glb"), "{message}");
    }
    for (dir, word) in [("file", "-o DIR"), ("missing/report", "missing/report"), ("report", "paper.md")] {
        std::fs::create_dir_all(folder.path().join("report/paper.md")).unwrap();
        let output = folder.run(&["paper", "none.glb", "-o", dir]);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(dir) && message.contains(word) && message.lines().count() == 1, "{message}");
    }
    assert_eq!(folder.names(), ["file", "folder.png", "report"]);
}

#[test]
fn without_a_driver_the_exit_code_is_3_and_the_graph_still_shows() {
    let folder = Folder::empty();
    for args in [&["render"][..], &["paper"], &["doctor"], &["doctor", "--json"]] {
        let output = folder.without_driver(args);
        assert_eq!(output.status.code(), Some(3), "{args:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("Vulkan"), "{}", stderr(&output));
    }
    assert!(folder.names().is_empty());
    let shown = folder.without_driver(&["graph"]);
    assert_eq!(shown.status.code(), Some(0), "{}", stderr(&shown));
    assert!(stdout(&shown).starts_with("digraph"));
    for file in ["a.dot", "a.json"] {
        let output = folder.without_driver(&["graph", "--method", "igi", "-o", file]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert!(output.stdout.is_empty());
    }
    assert_eq!(std::fs::read(folder.path().join("a.dot")).unwrap(), shown.stdout);
    assert!(folder.json("a.json")["passes"].is_array());
}

#[test]
fn help_knows_every_word_and_needs_no_device() {
    let folder = Folder::empty();
    let output = folder.without_driver(&["render", "--help"]);
    assert_eq!(output.status.code(), Some(0));
    let help = stdout(&output);
    let words = "-o --size --method --vpls --bounces --min-distance --visibility --box-split --camera --eye --look-at --fov --exposure --aov \
        --backend --pixel-samples --scene --no-headlight --config -D --device --seed --repeat --crop --stats --tap \
        --explain --quiet -v --progress --tone-map --glare --denoise --frames --fps --animation --shutter --turntable \
        --camera-path";
    for word in words.split_whitespace() {
        assert!(help.contains(word), "{word}");
    }
    let version = folder.without_driver(&["--version"]);
    assert_eq!(stdout(&version), concat!("parhelion ", env!("CARGO_PKG_VERSION"), "\n"));
}

/// Short help has a line for each option it shows, and fewer options; both show them in the same groups.
#[test]
fn short_help_is_a_part_of_the_whole_in_the_same_groups() {
    let folder = Folder::empty();
    let help = |args: &[&str]| {
        let output = folder.without_driver(args);
        assert_eq!(output.status.code(), Some(0), "{args:?}");
        stdout(&output)
    };
    let groups = |help: &str| -> Vec<String> {
        help.lines().filter_map(|line| line.strip_suffix(':')).map(String::from).collect()
    };
    let options = |help: &str| -> Vec<String> {
        let words = help.lines().map(str::trim_start).filter(|line| line.starts_with('-'));
        words.map(|line| line.split("  ").next().unwrap().to_owned()).collect()
    };
    for command in ["render", "paper", "chart", "stress", "graph", "compare", "methods", "doctor"] {
        let (short, whole) = (help(&[command, "-h"]), help(&[command, "--help"]));
        assert!(options(&whole).len() >= options(&short).len() && whole.len() > short.len(), "{command}");
        assert!(options(&short).iter().all(|option| options(&whole).contains(option)), "{command}");
        assert_eq!(groups(&short), groups(&whole), "{command}");
        for line in short.lines() {
            assert!(line.chars().count() <= 100, "{command}: {line}");
            assert!(!line.starts_with("          "), "{command}: a second line of an option: {line}");
        }
    }
    let (short, whole) = (help(&["render", "-h"]), help(&["render", "--help"]));
    assert_eq!(
        groups(&whole),
        ["Arguments", "Options", "Scene", "Light", "Picture", "Speed", "Output", "Film"],
        "{whole}"
    );
    assert!(2 * options(&short).len() < options(&whole).len(), "{short}");
    assert!(short.contains("--vpls") && !short.contains("--box-split") && whole.contains("--box-split"));
}

#[test]
fn completions_are_scripts_that_shells_read() {
    let folder = Folder::empty();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = folder.without_driver(&["completions", shell]);
        assert_eq!(output.status.code(), Some(0), "{shell}: {}", stderr(&output));
        let script = stdout(&output);
        for word in ["render", "doctor", "min-distance"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
        folder.write(shell, &script);
        // The others are not on every machine.
        if shell == "bash" {
            let checked = Command::new("bash").arg("-n").arg(folder.path().join(shell)).output().unwrap();
            assert!(checked.status.success(), "{}", stderr(&checked));
            let complete = format!(
                ". ./{shell}; COMP_WORDS=(parhelion ren); COMP_CWORD=1; _parhelion parhelion ren parhelion; echo ${{COMPREPLY[@]}}"
            );
            let completed =
                Command::new("bash").args(["-c", &complete]).current_dir(folder.path()).output().unwrap();
            assert_eq!(stdout(&completed), "render\n", "{}", stderr(&completed));
        }
    }
    let output = folder.run(&["completions", "tcsh"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("tcsh") && output.stdout.is_empty());
}

#[test]
fn the_default_room_renders_from_an_empty_folder() {
    let Some((_guard, device)) = common::device() else { return };
    let folder = Folder::empty();
    let output = folder.render(&[]);
    let text = stdout(&output);
    let [picture] = &folder.names()[..] else { panic!("{:?}", folder.names()) };
    assert!(picture.ends_with(".png"));
    for word in [picture, "32x24", &device.info().name, "backend: ", "pass", "ms", "total", "EV (auto)"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let cpu = device.info().kind == parhelion::vk::DeviceKind::Cpu;
    assert_eq!(text.contains("CPU device"), cpu, "{text}");
    for text in [text, stderr(&output)] {
        assert!(text.chars().all(|c| c == '\n' || !c.is_control()), "control characters: {text:?}");
    }
    let (pixels, width, texts) = png(&folder, picture);
    assert_eq!((width, pixels.len()), (32, 32 * 24 * 3));
    assert!(pixels.iter().any(|&p| p > 16), "a black picture");
    assert_eq!(texts["Tone mapping"], "Khronos PBR Neutral");
    assert!(texts["Exposure"].ends_with("EV (auto)") && texts["Software"].starts_with("parhelion "));

    let quiet = folder.render(&["-q"]);
    assert!(quiet.stdout.is_empty() && quiet.stderr.is_empty(), "{}{}", stdout(&quiet), stderr(&quiet));
}

#[test]
fn files_hold_what_was_asked_for() {
    let Some((_guard, device)) = common::device() else { return };
    let folder = Folder::with_wall();
    folder.write("a.exr", "replaced");
    let aovs = "albedo,N,P,direct,specular,indirect,irradiance,depth";
    let output = folder.render(&[
        "wall.gltf",
        "-o",
        "a.exr",
        "-o",
        "b.png",
        "--aov",
        aovs,
        "--stats",
        "s.json",
        "--exposure",
        "-1.5",
        "--seed",
        "7",
        "--explain",
        // Fewer kernels for it to build anew with each thing more.
        "-D",
        "indirect.compensation=0",
    ]);
    assert_eq!(folder.names(), ["a.exr", "b.png", "s.json", "wall.gltf"]);
    assert!(stdout(&output).contains("left out: no mirrors"), "{}", stdout(&output));
    let picture = exr(&folder, "a.exr");
    let names = "B G N.X N.Y N.Z P.X P.Y P.Z R Z albedo.B albedo.G albedo.R direct.B direct.G direct.R indirect.B \
        indirect.G indirect.R irradiance.B irradiance.G irradiance.R specular.B specular.G specular.R";
    assert_eq!(picture.channels.keys().cloned().collect::<Vec<_>>().join(" "), names);
    assert_eq!((picture.position, picture.size, picture.display), (Vec2(0, 0), Vec2(32, 24), Vec2(32, 24)));
    let text = |name: &str| match &picture.attributes[name] {
        AttributeValue::Text(text) => text.to_string(),
        other => panic!("{name}: {other:?}"),
    };
    assert_eq!(text("parhelion:method"), "igi");
    assert_eq!(text("parhelion:device"), device.info().name);
    assert_eq!(picture.attributes["parhelion:seed"], AttributeValue::F64(7.0));
    let settings: RenderConfig = serde_json::from_str(&text("parhelion:settings")).unwrap();
    assert_eq!((settings.seed, settings.vpl_shoot.vpls, settings.tone_map.exposure), (7, 9, Some(-1.5)));
    assert!(serde_json::from_str::<Value>(&text("parhelion:times")).unwrap().is_array());

    // Beauty is the sum of its parts, the wall is where it is.
    for channel in ["R", "G", "B"] {
        for (pixel, &beauty) in picture.channels[channel].iter().enumerate() {
            let part = |name: &str| picture.channels[&format!("{name}.{channel}")][pixel];
            let sum = part("direct") + part("specular") + part("indirect");
            assert!((beauty - sum).abs() <= 1e-5 * beauty.abs(), "{beauty} is not {sum}");
            assert!((part("albedo") - 0.5).abs() < 1e-6 && beauty > 0.0);
        }
    }
    assert!(picture.channels["Z"].iter().all(|&z| (z - 4.0).abs() < 1e-4));
    assert!(picture.channels["N.Z"].iter().all(|&z| (z - 1.0).abs() < 1e-5));
    let (_, _, texts) = png(&folder, "b.png");
    assert_eq!(texts["Exposure"], "-1.50 EV");
    let stats = folder.json("s.json");
    assert_eq!(stats["settings"]["seed"], 7);

    // What is left out is listed with what it would cost, the dearest first.
    let schema = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/stats.schema.json")).unwrap();
    let schema: Value = serde_json::from_slice(&schema).unwrap();
    common::check_schema(&schema, &schema, &stats, "stats").unwrap();
    let features = stats["economy"]["features"].as_array().unwrap();
    let times: Vec<f64> = features.iter().map(|feature| feature["ms"].as_f64().unwrap()).collect();
    assert!(times.is_sorted_by(|a, b| a >= b) && times.iter().all(|ms| *ms > 0.0), "{times:?}");
    for name in ["mirrors", "glass", "textures of base colour", "alpha masks", "spot lights", "environment"] {
        assert!(features.iter().any(|feature| feature["name"] == name), "{name} of {features:?}");
        assert!(stdout(&output).contains(&format!("\n  {name} ")), "{name}: {}", stdout(&output));
    }
}

/// Radiance is the same whatever a screen is shown, and the picture's texts say what it is.
#[test]
fn tone_mapping_and_glare_change_pictures_for_screens_alone() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    folder.render(&["wall.gltf", "-o", "a.exr", "-o", "a.png"]);
    let changes = ["--tone-map", "aces", "--glare", "0.2", "-o", "b.exr", "-o", "b.png"];
    let output = folder.render(&[&["wall.gltf"], &changes[..]].concat());
    assert!(stdout(&output).contains("glare 0.2") && stdout(&output).contains("ACES"), "{}", stdout(&output));
    let (_, _, plain) = png(&folder, "a.png");
    let (_, _, texts) = png(&folder, "b.png");
    assert_eq!(
        (&*texts["Tone mapping"], &*texts["Glare"]),
        ("ACES (Hill's fit)", "strength 0.2, radius 0.1")
    );
    assert!(texts["Exposure"] == plain["Exposure"] && !plain.contains_key("Glare"));
    assert_eq!(exr(&folder, "a.exr").channels, exr(&folder, "b.exr").channels);
    assert_ne!(png(&folder, "a.png").0, png(&folder, "b.png").0);
}

/// Found out before the scene is read.
#[test]
fn without_a_denoiser_one_line_says_so() {
    let folder = Folder::empty();
    let args = ["render", "none.glb", "--denoise"];
    let output = folder.command(&args).env("PARHELION_OIDN", "/nonexistent/oidn.so").output().unwrap();
    let message = stderr(&output);
    let (code, words) = if cfg!(feature = "denoise") {
        (1, ["/nonexistent/oidn.so", "PARHELION_OIDN"])
    } else {
        (2, ["--features denoise", "built"])
    };
    assert_eq!(output.status.code(), Some(code), "{message}");
    assert!(message.starts_with("error: --denoise: ") && message.lines().count() == 1, "{message}");
    assert!(words.iter().all(|word| message.contains(word)), "{message}");
    assert!(folder.names().is_empty());
}

/// Files keep what the samples drew, and a render goes on from that.
#[cfg(feature = "denoise")]
#[test]
fn denoised_files_keep_the_noisy_picture() {
    let Some((_guard, _)) = common::device() else { return };
    let path = std::env::var_os("PARHELION_OIDN");
    let loaded = parhelion::denoise::Denoiser::load(path.as_deref().map(Path::new));
    if !common::require("oidn", loaded.is_ok(), "no Open Image Denoise") {
        return;
    }
    let folder = Folder::with_wall();
    let path = |more: &[&str]| {
        let args = ["render", "wall.gltf", "--method", "path", "--size", "32x24", "-D", "path_trace.spp=3"];
        let output = folder.run(&[&args[..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        stdout(&output)
    };
    path(&["-o", "plain.exr", "-o", "plain.png"]);
    let text = path(&["--denoise", "-o", "a.exr", "-o", "a.png", "--stats", "s.json"]);
    assert!(
        text.contains("denoised: Open Image Denoise 2.") && text.contains("radiance, denoised"),
        "{text}"
    );
    let (plain, clean) = (exr(&folder, "plain.exr"), exr(&folder, "a.exr"));
    assert_eq!(clean.channels.keys().cloned().collect::<Vec<_>>().join(" "), "B G R noisy.B noisy.G noisy.R");
    for channel in ["R", "G", "B"] {
        assert_eq!(clean.channels[&format!("noisy.{channel}")], plain.channels[channel]);
        assert_ne!(clean.channels[channel], plain.channels[channel]);
    }
    let (_, _, texts) = png(&folder, "a.png");
    assert!(texts["Denoiser"].starts_with("Open Image Denoise 2."), "{texts:?}");
    assert_ne!(png(&folder, "a.png").0, png(&folder, "plain.png").0);
    let schema = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/stats.schema.json")).unwrap();
    let schema: Value = serde_json::from_slice(&schema).unwrap();
    let stats = folder.json("s.json");
    check(&schema, &schema, &stats, "stats").unwrap();
    assert!(stats["denoised"]["ms"].as_f64() > Some(0.0));

    path(&["--spp", "5", "--resume", "a.exr", "-o", "on.exr"]);
    path(&["--spp", "5", "-o", "whole.exr"]);
    assert_eq!(exr(&folder, "on.exr").channels, exr(&folder, "whole.exr").channels);
}

#[test]
fn openexrs_own_tools_read_the_file() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    folder.render(&["wall.gltf", "-o", "a.exr", "--aov", "N,depth", "--crop", "4,2,20,12"]);
    let Ok(output) = Command::new("exrheader").arg("a.exr").current_dir(folder.path()).output() else {
        common::require("openexr", false, "no exrheader (package openexr)");
        return;
    };
    let text = stdout(&output);
    for line in [
        "dataWindow (type box2i): (4 2) - (19 11)",
        "displayWindow (type box2i): (0 0) - (31 23)",
        "red   (0.64 0.33)",
        "parhelion:method (type string): \"igi\"",
        "N.X, 32-bit floating-point",
        "type (type string): \"scanlineimage\"",
    ] {
        assert!(text.contains(line), "{line}: {text}");
    }
}

#[test]
fn a_crop_holds_the_pixels_of_the_whole_bit_for_bit() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::empty();
    let common = ["--exposure", "0", "--aov", "albedo,N,P,direct,specular,indirect,irradiance,depth"];
    folder.render(&[&common[..], &["-o", "whole.exr", "-o", "whole.png"]].concat());
    let crop = ["--crop", "5,3,30,21", "-o", "part.exr", "-o", "part.png"];
    folder.render(&[&common[..], &crop[..]].concat());
    let (whole, part) = (exr(&folder, "whole.exr"), exr(&folder, "part.exr"));
    assert_eq!((part.position, part.size, part.display), (Vec2(5, 3), Vec2(25, 18), Vec2(32, 24)));
    let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    for (name, values) in &whole.channels {
        assert_part(&bits(values), &bits(&part.channels[name]), 32, 1, [5, 3, 30, 21]);
    }
    assert_part(&png(&folder, "whole.png").0, &png(&folder, "part.png").0, 32, 3, [5, 3, 30, 21]);

    let output = folder.render(&["--crop", "0,0,8,8", "-o", "auto.png"]);
    assert!(stdout(&output).contains("EV (auto, of the crop)"));
    assert!(png(&folder, "auto.png").2["Exposure"].ends_with("EV (auto, of the crop)"));
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_others() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::empty();
    for (seed, file) in [("3", "a.exr"), ("3", "b.exr"), ("4", "c.exr")] {
        folder.render(&["--seed", seed, "-o", file]);
    }
    let [a, b, c] = ["a.exr", "b.exr", "c.exr"].map(|name| exr(&folder, name).channels);
    assert!(a == b, "one seed, two pictures");
    assert!(a != c, "two seeds, one picture");
}

#[test]
fn cameras_and_scenes_are_found_by_name_and_index() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    for (args, depth) in [
        (&[][..], 4.0),
        (&["--camera", "Near"], 2.0),
        (&["--camera", "near"], 2.0),
        (&["--camera", "1"], 2.0),
        (&["--camera", "lens"], 4.0),
        (&["--scene", "deep"], 5.0),
        (&["--scene", "1", "--camera", "Near"], 3.0),
        (&["--eye", "-0.5,0,3", "--look-at", "-0.5,0,0", "--fov", "20"], 3.0),
    ] {
        folder.render(&[&["wall.gltf", "-o", "a.exr", "--aov", "depth"], args].concat());
        let z = &exr(&folder, "a.exr").channels["Z"];
        assert!(z.iter().all(|z| (z - depth).abs() < 1e-4), "{args:?}: {} is not {depth}", z[0]);
    }
}

#[test]
fn a_scene_without_lights_is_lit_from_the_camera_and_says_so() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    let lit = folder.render(&["wall.gltf", "--scene", "deep", "-o", "a.exr"]);
    assert!(stderr(&lit).contains("note: ") && stderr(&lit).contains("light"), "{}", stderr(&lit));
    assert!(exr(&folder, "a.exr").channels["G"].iter().all(|&g| g > 0.0));
    let sky = folder.render(&["wall.gltf", "--scene", "deep", "-o", "a.exr", "--environment", "0.5,1,2"]);
    assert!(!stderr(&sky).contains("headlight"), "{}", stderr(&sky));
    assert!(exr(&folder, "a.exr").channels["G"].iter().all(|&g| g > 0.0));
    folder.render(&["wall.gltf", "--scene", "deep", "-o", "a.exr", "--no-headlight"]);
    assert!(exr(&folder, "a.exr").channels["G"].iter().all(|&g| g == 0.0));
}

/// A room of 4 m × 3 m × 5 m with a window of 1.5 m in the middle of the wall at x = 0. Corners by number of each axis.
fn windowed() -> String {
    let (x, y, z) = ([0.0, 4.0], [0.0, 0.75, 2.25, 3.0], [0.0, 1.75, 3.25, 5.0]);
    let mut obj = String::new();
    let mut quad = |corners: [[usize; 3]; 4]| {
        for [i, j, k] in corners {
            writeln!(obj, "v {} {} {}", x[i], y[j], z[k]).unwrap();
        }
        obj.push_str("f -4 -3 -2 -1\n");
    };
    for at in [0, 3] {
        quad([[0, at, 0], [0, at, 3], [1, at, 3], [1, at, 0]]);
        quad([[0, 0, at], [1, 0, at], [1, 3, at], [0, 3, at]]);
    }
    quad([[1, 0, 0], [1, 0, 3], [1, 3, 3], [1, 3, 0]]);
    quad([[0, 0, 0], [0, 3, 0], [0, 3, 1], [0, 0, 1]]);
    quad([[0, 0, 2], [0, 3, 2], [0, 3, 3], [0, 0, 3]]);
    quad([[0, 0, 1], [0, 1, 1], [0, 1, 2], [0, 0, 2]]);
    quad([[0, 2, 1], [0, 3, 1], [0, 3, 2], [0, 2, 2]]);
    obj
}

fn rendered(folder: &Folder, args: &[&str]) -> Output {
    let output = folder.run(&[&["render", "--size", "24x24", "--backend", "software"], args].concat());
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", stderr(&output));
    output
}

/// The sky through a window: what no path finds is missing, and said to be.
#[test]
fn a_picture_that_rests_on_few_light_paths_says_so() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    folder.write("room.obj", &windowed());
    let camera = ["--eye", "3,1.5,4.8", "--look-at", "2,1.4,0", "--environment", "1,1,1"];
    let draw = |seed: &str, more: &[&str]| {
        let files = ["--aov", "indirect", "-o", "a.exr", "--stats", "s.json", "--seed", seed];
        let out = rendered(&folder, &[&["room.obj"], &camera[..], &files, more].concat());
        let share = folder.json("s.json")["paths_seen"].as_f64().unwrap();
        let light = common::mean(&exr(&folder, "a.exr").channels["indirect.G"]);
        (stderr(&out), stdout(&out), share, light)
    };
    let settings = ["vpl_shoot.guided=false", "vpl_shoot.candidates=1", "indirect.compensation=0"];
    let plainly = [&settings.map(|setting| ["-D", setting]).concat()[..], &["--vpls"]].concat();
    let mut drawn = Vec::new();
    for seed in ["0", "1", "2", "3", "4", "5", "6", "7"] {
        let (notes, text, share, light) = draw(seed, &[&plainly[..], &["180"]].concat());
        let seen = (60.0 * share).round();
        println!("seed {seed}: {seen} of 60 paths, indirect light {light}");
        assert!(text.contains(&format!("of 60 paths ({:.1} % seen)", 100.0 * share)), "{text}");
        match seen {
            0.0 => assert!(notes.contains("none of 60 light paths lights anything that is seen"), "{notes}"),
            1.0..9.0 => assert!(notes.contains(&format!("rests on {seen} of 60 light paths")), "{notes}"),
            _ => assert!(!notes.contains("light paths"), "{notes}"),
        }
        assert_eq!(seen > 0.0, light > 0.0, "{seen} paths are seen, indirect light is {light}");
        drawn.push(seen);
    }
    assert!(drawn.contains(&0.0) && drawn.iter().any(|&seen| seen > 0.0), "{drawn:?}");
    let (notes, _, share, _) = draw("0", &[&plainly[..], &["6000"]].concat());
    assert!(!notes.contains("light paths") && (0.001..0.2).contains(&share), "{share}: {notes}");
    let (_, _, aimed, _) = draw("0", &["--vpls", "6000"]);
    assert!(aimed > 2.0 * share, "{aimed} of paths that are aimed, {share} of others");
}

#[test]
fn paths_that_all_arrive_are_nothing_to_speak_of_and_none_at_all_are() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    // The second by way of its mirror, too.
    for room in ["builtin:closed-box", "builtin:mirror-box"] {
        let out = rendered(&folder, &[room, "-o", "a.exr", "--stats", "s.json"]);
        assert!(!stderr(&out).contains("light path"), "{}", stderr(&out));
        let share = folder.json("s.json")["paths_seen"].as_f64().unwrap();
        assert!(share > 0.9, "{share} of paths in {room}");
    }
    // Two squares of 0.1 m, 100 m apart.
    let square = |x: f32| format!("v {x} 0 0\nv {x} 0.1 0\nv {x} 0.1 0.1\nv {x} 0 0.1\nf -4 -3 -2 -1\n");
    folder.write("far.obj", &(square(0.0) + &square(100.0)));
    let seen = [
        "--eye",
        "1,0.05,0.05",
        "--look-at",
        "0,0.05,0.05",
        "--fov",
        "10",
        "-o",
        "a.exr",
        "--stats",
        "s.json",
    ];
    let out = rendered(&folder, &[&["far.obj", "--environment", "1,1,1"], &seen[..]].concat());
    assert!(stderr(&out).contains("none of 15360 light paths left a VPL"), "{}", stderr(&out));
    let out = rendered(&folder, &[&["far.obj", "--environment", "0,0,0"], &seen[..]].concat());
    assert!(!stderr(&out).contains("light path"), "{}", stderr(&out));
    let out = rendered(&folder, &[&["far.obj", "--no-headlight"], &seen[..]].concat());
    assert!(!stderr(&out).contains("light path"), "{}", stderr(&out));
    rendered(&folder, &[&["far.obj", "--method", "path", "--spp", "1"], &seen[..]].concat());
    assert!(folder.json("s.json")["paths_seen"].is_null());
}

#[test]
fn options_win_over_assignments_and_these_over_the_file() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    folder.write("c.toml", "seed = 1\n[vpl_shoot]\nvpls = 40\nbounces = 5\n[indirect]\nmin_distance = 0.5\n");
    let args = ["render", "wall.gltf", "--size", "8x8", "--config", "c.toml", "--stats", "s.json"];
    let more = ["-D", "vpl_shoot.vpls=50", "-D", "indirect.min_distance=auto", "--bounces", "2"];
    let output = folder.run(&[&args[..], &more[..]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let settings: RenderConfig = serde_json::from_value(folder.json("s.json")["settings"].clone()).unwrap();
    let mut expected = RenderConfig { size: [8, 8], seed: 1, ..RenderConfig::default() };
    (expected.vpl_shoot.vpls, expected.vpl_shoot.bounces) = (50, Some(2));
    assert_eq!(settings, expected);
}

#[test]
fn statistics_follow_their_schema() {
    let Some((_guard, device)) = common::device() else { return };
    let schema = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/stats.schema.json")).unwrap();
    let schema: Value = serde_json::from_slice(&schema).unwrap();
    let folder = Folder::with_wall();
    folder.render(&[
        "wall.gltf",
        "--scene",
        "deep",
        "--repeat",
        "2",
        "--crop",
        "0,0,8,8",
        "--stats",
        "s.json",
    ]);
    let stats = folder.json("s.json");
    check(&schema, &schema, &stats, "stats").unwrap();
    assert_eq!(stats["device"]["uuid"], device.info().uuid.as_str());
    assert_eq!(stats["repeat"], 2);
    assert_eq!(stats["scene"]["triangles"], 1);
    assert!(stats["passes"].as_array().unwrap().iter().any(|pass| pass["rays"].as_u64() > Some(0)));
    assert!(
        stats["structures"][0]["bytes"].as_u64() > Some(0) && stats["peak_device_bytes"].as_u64() > Some(0)
    );
    assert_eq!(
        stats["settings"].as_object().unwrap().len(),
        json!(RenderConfig::default()).as_object().unwrap().len()
    );

    let path = ["--method", "path", "--size", "8x8", "--spp", "3", "--aov", "variance", "-o", "p.exr"];
    let output = folder.run(&[&["render", "wall.gltf", "--stats", "p.json"], &path[..]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let other = folder.json("p.json");
    check(&schema, &schema, &other, "stats").unwrap();
    assert_eq!((&other["samples"], &other["vpl_count"]), (&json!(3), &Value::Null));
    assert!(other["noise"].as_f64().is_some() && stats["noise"].is_null());
    let traced = |pass: &Value| pass["path"] == "path_trace/trace" && pass["rays"].as_u64() >= Some(3 * 64);
    assert!(other["passes"].as_array().unwrap().iter().any(traced));

    // The schema refuses what is missing, what it does not know, and wrong types.
    for key in stats.as_object().unwrap().keys() {
        let mut broken = stats.clone();
        broken.as_object_mut().unwrap().shift_remove(key);
        check(&schema, &schema, &broken, "stats").unwrap_err();
        broken[key] = Value::Bool(true);
        check(&schema, &schema, &broken, "stats").unwrap_err();
    }
    let mut broken = stats.clone();
    broken["extra"] = json!(1);
    check(&schema, &schema, &broken, "stats").unwrap_err();
}

/// Lines of the Markdown table under a heading, head and rule left out.
fn table_rows(text: &str, heading: &str) -> Vec<Vec<String>> {
    let section = text.split("\n## ").find_map(|section| section.strip_prefix(heading)).unwrap();
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
    section.lines().filter(|line| line.starts_with('|')).skip(2).map(cells).collect()
}

fn paper_schema() -> Value {
    let schema = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/paper.schema.json")).unwrap();
    serde_json::from_slice(&schema).unwrap()
}

#[test]
fn the_papers_experiment_compares_every_approach_with_the_canonical_one() {
    let Some((_guard, device)) = common::device() else { return };
    let folder = Folder::empty();
    let output = folder.run(&["paper", "builtin:office", "--size", "32x24", "--seed", "3"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let approaches = ["paper-canonical", "paper-imperfect", "paper-downsampled", "paper-interleaved", "fast"];
    let differences = approaches[1..].iter().map(|approach| format!("{approach}-difference.png"));
    let pictures = approaches.iter().map(|approach| format!("{approach}.png"));
    let mut files: Vec<_> =
        ["paper.json", "paper.md"].map(String::from).into_iter().chain(pictures).chain(differences).collect();
    files.sort();
    let report = Folder::names_in(&folder.path().join("office-paper"));
    assert_eq!(report, files);

    let schema = paper_schema();
    let report = folder.json("office-paper/paper.json");
    check(&schema, &schema, &report, "paper").unwrap();
    for key in report.as_object().unwrap().keys() {
        let mut broken = report.clone();
        broken.as_object_mut().unwrap().shift_remove(key);
        check(&schema, &schema, &broken, "paper").unwrap_err();
    }
    assert_eq!(report["complete"], true);
    assert_eq!((&report["base"]["size"], &report["base"]["seed"]), (&json!([32, 24]), &json!(3)));
    assert_eq!(report["device"]["uuid"], device.info().uuid.as_str());
    assert!(report["reference"]["seed"] != 3);
    let boxes = report["structures"].as_array().unwrap().iter().any(|s| s["name"] == "boxes");
    assert!(boxes, "{}", report["structures"]);

    let rows = report["rows"].as_array().unwrap();
    let row = |vpls: u64, approach: &str| {
        rows.iter().find(|row| row["vpls"] == vpls && row["approach"] == approach).unwrap()
    };
    assert_eq!(rows.len(), 15);
    for vpls in [30, 90, 180] {
        let canonical = row(vpls, "paper-canonical");
        assert_eq!(canonical["speed_up"], 1.0);
        for approach in approaches {
            let row = row(vpls, approach);
            let number = |pointer: &str| row.pointer(pointer).and_then(Value::as_f64).unwrap();
            let ratio = canonical["frame_ms"].as_f64().unwrap() / number("/frame_ms");
            assert!((number("/speed_up") / ratio - 1.0).abs() < 1e-9, "{row}");
            assert!((number("/fps") * number("/frame_ms") / 1e3 - 1.0).abs() < 1e-9, "{row}");
            let published = vpls == 180 && approach != "fast";
            assert_eq!(row["published"].is_object(), published, "{row}");
            assert_eq!(row["picture"].is_string(), vpls == 180, "{row}");
            assert_eq!(row["ours"], approach == "fast");
            // Nothing equals the canonical picture but itself, and the reference nothing at all.
            for layer in ["beauty", "indirect"] {
                let itself = vpls == 180 && approach == "paper-canonical";
                assert_eq!(number(&format!("/error/canonical/{layer}/rel_mse")) == 0.0, itself, "{row}");
                assert!(number(&format!("/error/reference/{layer}/rel_mse")) > 0.0, "{row}");
            }
            if device.info().timestamps {
                let components = row["components"].as_array().unwrap();
                let share: f64 = components.iter().map(|part| part["share"].as_f64().unwrap()).sum();
                assert!((share - 1.0).abs() < 1e-9, "{row}");
                let filters = components.iter().find(|part| part["name"] == "filters").unwrap();
                assert_eq!(filters["ms"] != 0.0, !["paper-canonical", "paper-imperfect"].contains(&approach));
            }
        }
        // Samples are a sixteenth of the pixels, subsets a ninth of the VPLs.
        let rays = |approach| row(vpls, approach)["rays"].as_u64().unwrap();
        assert!(rays("paper-imperfect") == rays("paper-canonical"));
        assert!(rays("paper-downsampled") < rays("paper-imperfect"));
        assert!(rays("paper-interleaved") < rays("paper-downsampled"));
    }
    assert_eq!(row(180, "paper-interleaved")["published"], json!({ "fps": 7.63, "speed_up": 7.63 / 0.64 }));

    let text = std::fs::read_to_string(folder.path().join("office-paper/paper.md")).unwrap();
    assert!(stdout(&output).starts_with(&text) && !text.contains("Not complete"), "{text}");
    assert!(text.contains("were not measured here") && text.contains("GTX 480"), "{text}");
    for (heading, pictured) in [("Time", false), ("Error", false), ("Pictures", true)] {
        let lines = table_rows(&text, heading);
        assert_eq!(lines.len(), if pictured { 5 } else { 15 }, "{heading}");
        for (line, row) in lines.iter().zip(rows) {
            assert_eq!(line[usize::from(!pictured)], row["label"].as_str().unwrap(), "{heading}");
        }
    }

    // The difference is what its text says, of the pictures as they are.
    let (canonical, _, texts) = png(&folder, "office-paper/paper-canonical.png");
    let exposure = format!("{:+.2} EV", report["exposure_ev"].as_f64().unwrap());
    for approach in &approaches[1..] {
        let (picture, _, other) = png(&folder, &format!("office-paper/{approach}.png"));
        let (difference, _, said) = png(&folder, &format!("office-paper/{approach}-difference.png"));
        assert!(
            texts["Exposure"] == other["Exposure"] && other["Exposure"].starts_with(&exposure),
            "{other:?}"
        );
        assert!(said["Difference"].contains("x 8"), "{said:?}");
        let expected = picture.iter().zip(&canonical).map(|(a, b)| a.abs_diff(*b).saturating_mul(8));
        assert!(expected.eq(difference.iter().copied()), "{approach}");
        assert!(difference.iter().any(|&value| value > 0), "{approach}");
    }
}

/// … and a report that is there is replaced, in a folder of any name.
#[test]
fn only_the_papers_own_scenes_stand_beside_its_numbers() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    std::fs::create_dir(folder.path().join("report")).unwrap();
    folder.write("report/paper.md", "old");
    let args = ["paper", "wall.gltf", "--size", "16x12", "-o", "report", "--repeat", "1", "-q"];
    let output = folder.run(&args);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(output.stdout.is_empty() && output.stderr.is_empty(), "{}{}", stdout(&output), stderr(&output));
    let report = folder.json("report/paper.json");
    let schema = paper_schema();
    check(&schema, &schema, &report, "paper").unwrap();
    assert_eq!((&report["published"], &report["repeat"]), (&Value::Null, &json!(1)));
    assert!(report["rows"].as_array().unwrap().iter().all(|row| row["published"].is_null()));
    let text = std::fs::read_to_string(folder.path().join("report/paper.md")).unwrap();
    assert!(!text.contains("paper: fps") && table_rows(&text, "Time").len() == 15, "{text}");
}

/// As `render` takes settings: a file, a preset over it, assignments over that, options over all.
#[test]
fn a_graph_is_that_of_its_settings() {
    let folder = Folder::with_wall();
    folder.write("path.toml", "method = 'path'\nindirect.downsample = 2\n");
    let shown = |args: &[&str]| {
        let output = folder.run(&[&["graph", "wall.gltf"], args].concat());
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", stderr(&output));
        stdout(&output)
    };
    let (plain, path) = (shown(&[]), shown(&["--method", "path"]));
    let fast = shown(&["--preset", "fast"]);
    assert!(plain != path && plain != fast && fast.contains("indirect/"));
    assert_eq!(shown(&["--method", "igi"]), plain);
    assert_eq!(shown(&["-D", "method=path"]), path);
    assert_eq!(shown(&["--config", "path.toml"]), path);
    let halved = shown(&["--config", "path.toml", "--method", "igi"]);
    assert_eq!(halved, shown(&["-D", "indirect.downsample=2"]));
    assert_ne!(halved, plain);
    assert_eq!(shown(&["--config", "path.toml", "-D", "method=igi", "-D", "indirect.downsample=1"]), plain);
    assert_eq!(shown(&["--config", "path.toml", "--preset", "fast", "--method", "igi"]), fast);
    let off = ["-D", "indirect.downsample=1", "-D", "indirect.interleave=1"];
    assert_eq!(shown(&[&["--preset", "fast"], &off[..]].concat()), shown(&["--preset", "paper-canonical"]));
}

#[test]
fn taps_are_pictures_and_unknown_ones_are_refused() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    let output =
        folder.run(&[&["render", "wall.gltf", "--tap", "nowhere:nothing=t.exr"], &SMALL[..]].concat());
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("nowhere"), "{}", stderr(&output));
    assert_eq!(folder.names(), ["wall.gltf"]);

    // Whatever the passes are called: the first image that the plan says a pass writes.
    folder.run(&["graph", "wall.gltf", "-o", "g.json"]);
    let plan = folder.json("g.json");
    let tap = plan["passes"].as_array().unwrap().iter().find_map(|pass| {
        let written = pass["accesses"].as_array()?.iter().find(|access| {
            let resource = &plan["resources"][access["resource"].as_u64().unwrap() as usize];
            access["writes"] == true && resource["desc"]["kind"] == "image"
        })?;
        Some(format!("{}:{}", pass["path"].as_str()?, written["variable"].as_str()?))
    });
    folder.render(&["wall.gltf", "--tap", &format!("{}=t.exr", tap.unwrap())]);
    let layer = exr(&folder, "t.exr");
    assert_eq!(layer.size, Vec2(32, 24));
    assert!(layer.attributes.contains_key("parhelion:tap"));
}

#[test]
fn progress_as_json_is_one_object_a_line() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    let output = folder.render(&["wall.gltf", "--scene", "deep", "--progress", "json", "-v"]);
    let lines: Vec<Value> = stderr(&output).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    for stage in ["load", "build", "render", "write"] {
        assert!(lines.iter().any(|line| line["stage"] == stage), "{lines:?}");
    }
    let done: Vec<_> = lines.iter().filter_map(|line| line["done"].as_f64()).collect();
    assert!(
        !done.is_empty() && done.is_sorted() && done.iter().all(|done| (0.0..=1.0).contains(done)),
        "{done:?}"
    );
    assert!(lines.iter().any(|line| line["note"].is_string()));
}

#[test]
fn a_bar_appears_where_it_is_asked_for_and_stays_off_stdout() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    let bar = folder.render(&["wall.gltf", "--progress", "bar"]);
    assert!(stderr(&bar).contains('\u{1b}'), "{:?}", stderr(&bar));
    assert!(!stdout(&bar).contains('\u{1b}'));
    // So few light paths that none of them need arrive.
    let few = ["-D", "vpl_shoot.candidates=1"];
    for word in ["auto", "none"] {
        assert_eq!(stderr(&folder.render(&[&["wall.gltf", "--progress", word][..], &few].concat())), "");
    }
}

/// Work for days: only an interruption ends it.
#[cfg(unix)]
#[test]
fn an_interrupted_render_exits_with_130_and_leaves_no_file() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    let endless =
        ["render", "wall.gltf", "--size", "2048x2048", "--vpls", "1000000", "--pixel-samples", "65536"];
    let outputs = ["-o", "a.exr", "-o", "a.png", "--stats", "s.json", "--progress", "json"];
    let mut child = folder
        .command(&[&endless[..], &outputs[..]].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let started = lines.by_ref().map(Result::unwrap).find(|line| line.contains("\"stage\":\"render\""));
    assert!(started.is_some(), "it ended before it rendered: {:?}", child.wait());
    // The shell's own `kill`: a small system has no other.
    let interrupt = format!("kill -INT {}", child.id());
    assert!(Command::new("sh").args(["-c", &interrupt]).status().unwrap().success());
    let rest: Vec<_> = lines.map(Result::unwrap).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    assert_eq!(rest.last().map(String::as_str), Some("error: interrupted"));
    assert_eq!(folder.names(), ["wall.gltf"]);
}

#[cfg(unix)]
#[test]
fn an_interrupted_experiment_leaves_a_report_of_what_is_finished() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    let args = ["paper", "wall.gltf", "--size", "640x480", "--progress", "json"];
    let mut child = folder.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    // The reference follows the first row.
    let started = lines.by_ref().map(Result::unwrap).find(|line| line.contains("\"pass\":\"reference"));
    assert!(started.is_some(), "it ended before the reference: {:?}", child.wait());
    let interrupt = format!("kill -INT {}", child.id());
    assert!(Command::new("sh").args(["-c", &interrupt]).status().unwrap().success());
    let rest: Vec<_> = lines.map(Result::unwrap).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    assert_eq!(rest.last().map(String::as_str), Some("error: interrupted"));
    let report = folder.json("wall-paper/paper.json");
    let schema = paper_schema();
    check(&schema, &schema, &report, "paper").unwrap();
    let rows = report["rows"].as_array().unwrap();
    assert_eq!(report["complete"], false);
    assert!(!rows.is_empty() && rows.len() < 15 && rows[0]["approach"] == "paper-canonical", "{rows:?}");
    let text = std::fs::read_to_string(folder.path().join("wall-paper/paper.md")).unwrap();
    assert!(text.contains(&format!("**Not complete**: {} of 15", rows.len())), "{text}");
    assert_eq!(table_rows(&text, "Time").len(), rows.len());
    assert!(!Folder::names_in(&folder.path().join("wall-paper")).iter().any(|name| name.ends_with(".tmp")));
}

#[test]
fn a_reader_that_leaves_early_is_no_error() {
    let Some((_guard, _)) = common::device() else { return };
    let folder = Folder::with_wall();
    let args = [&["render", "wall.gltf", "-o", "a.png"], &SMALL[..]].concat();
    let mut child = folder.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let mut message = String::new();
    child.stderr.take().unwrap().read_to_string(&mut message).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{message}");
    assert!(!message.contains("panicked"), "{message}");
    assert_eq!(folder.names(), ["a.png", "wall.gltf"]);
}

#[test]
fn doctor_finds_the_device_and_traces_a_ray() {
    let Some((_guard, device)) = common::device() else { return };
    let folder = Folder::empty();
    let output = folder.run(&["doctor", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["default"], device.info().index);
    let found = &report["devices"][device.info().index];
    assert_eq!(found["name"], device.info().name.as_str());
    assert!(["software", "ray-query"].contains(&found["backend"].as_str().unwrap()));
    let rays = found["rays"].as_array().unwrap();
    assert_eq!(rays.len(), if device.info().ray_query { 2 } else { 1 });
    assert!(rays.iter().all(|ray| ray["ok"] == true && ray["distance"] == 2.0), "{rays:?}");
    let text = stdout(&folder.run(&["doctor"]));
    for word in
        [&device.info().name, &device.info().uuid, "driver", "missing    nothing", "backend", "as it should"]
    {
        assert!(text.contains(word), "{word}: {text}");
    }
    assert!(folder.names().is_empty());
}
