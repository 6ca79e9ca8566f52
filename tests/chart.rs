//! `parhelion chart` and what is chosen by it, as a user meets them, and what they are made of.

mod common;

use parhelion::chart::picture;
use parhelion::config::RenderConfig;
use parhelion::output::{ReadPicture, read_exr};
use parhelion::renderer::{FrameRequest, Renderer, RendererOptions};
use parhelion::{metrics, scene::builtin};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Six settings that render in no time.
const GRID: &str = "
    [[sweep]]
    preset = 'fast'
    vpl_shoot.vpls = [9, 36]
    vpl_shoot.bounces = [1, 6]
    [[sweep]]
    method = 'path'
    path_trace.spp = [1, 4]
";

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        folder.write("grid.toml", GRID);
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.text(name)).unwrap()
    }

    fn names(&self, folder: &str) -> Vec<String> {
        let names = std::fs::read_dir(self.path(folder)).unwrap();
        let mut names: Vec<_> = names.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_parhelion"));
        command.args(args).current_dir(self.0.path());
        // Every test has a cache of its own; the driver's, which holds compiled kernels, is common to all.
        command.env("XDG_CACHE_HOME", self.path("cache"));
        command.env("MESA_SHADER_CACHE_DIR", env!("CARGO_TARGET_TMPDIR"));
        command
    }

    fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    /// Charts a diffuse room, `args` after what makes it small.
    fn chart(&self, args: &[&str]) -> String {
        let output = self.run(&[&SMALL[..], args].concat());
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    }

    fn refused(&self, args: &[&str], words: &[&str]) {
        let output = self.run(args);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert!(words.iter().all(|word| message.contains(word)), "{args:?}: {message}");
    }
}

const SMALL: [&str; 10] = [
    "chart",
    "builtin:two-albedo",
    "--size",
    "32x24",
    "--grid",
    "grid.toml",
    "--reference-spp",
    "256",
    "-o",
    "report",
];

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn points(data: &Value) -> &[Value] {
    data["points"].as_array().unwrap()
}

/// Checks what is stated over seeds against the mean picture and what is told of each seed.
fn check_over_seeds(folder: &Folder, data: &Value, truth: &[f32]) {
    let noise = number(&data["reference"]["noise"]);
    for point in points(data) {
        let stated = |key: &str| number(&point["over_seeds"][key]);
        let metric = |key: &str, of: &str| number(&point["metrics"][key][of]);
        assert_eq!(stated("rel_mse"), metric("rel_mse", "median"), "{point}");
        assert_eq!(stated("rel_mse_worst"), metric("rel_mse", "max"), "{point}");
        assert_eq!(stated("rel_mse_blocks"), metric("rel_mse_blocks", "median"), "{point}");
        let file = folder.path(&format!("report/means/{}.exr", point["id"].as_str().unwrap()));
        let mean = pixels(&read_exr(&file).unwrap());
        let of_mean = metrics::rel_mse(&mean, truth);
        let error = metrics::without_noise(of_mean, noise);
        assert!((stated("rel_mse_of_mean") / error - 1.0).abs() < 1e-3, "{point}");
        assert!((stated("bias") - metrics::signed_bias(&mean, truth)).abs() < 1e-4, "{point}");
        assert!(stated("systematic") < of_mean && stated("bias_se") >= 0.0, "{point}");
        // Of two seeds both are known.
        let [low, high] = ["min", "max"].map(|end| metric("signed_bias", end));
        assert!((stated("bias_se") - 0.5 * (high - low)).abs() < 1e-9, "{point}");
        let average = 0.5 * (metric("rel_mse", "min") + metric("rel_mse", "max"));
        if average > 10.0 * noise {
            let systematic = 2.0 * (of_mean - noise) - average;
            assert!((stated("systematic") - systematic).abs() < 1e-4 * average, "{point}");
        }
    }
}

fn pixels(picture: &ReadPicture) -> Vec<f32> {
    picture.interleaved(&["R", "G", "B"]).unwrap()
}

#[test]
fn a_chart_holds_every_setting_measured_against_its_reference() {
    let Some((_guard, device)) = common::device() else { return };
    let folder = Folder::new();
    let printed = folder.chart(&["--seeds", "2"]);
    let data = folder.json("report/data.json");
    let schema = std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/chart.schema.json")).unwrap();
    let schema: Value = serde_json::from_slice(&schema).unwrap();
    common::check_schema(&schema, &schema, &data, "chart").unwrap();
    for key in data.as_object().unwrap().keys() {
        let mut broken = data.clone();
        broken.as_object_mut().unwrap().shift_remove(key);
        common::check_schema(&schema, &schema, &broken, "chart").unwrap_err();
    }
    assert_eq!(data["complete"], true);
    assert_eq!((points(&data).len(), data["failures"].as_array().unwrap().len()), (6, 0));

    // Errors are those of the pictures, less the reference's noise, which its halves tell.
    let reference = read_exr(&folder.path("report/reference.exr")).unwrap();
    let truth = pixels(&reference);
    let half = |name: &str| {
        let names = ["R", "G", "B"].map(|channel| format!("{name}.{channel}"));
        reference.interleaved(&names.each_ref().map(String::as_str)).unwrap()
    };
    let (a, b) = (half("half_a"), half("half_b"));
    let quarter: Vec<f32> = truth.iter().zip(a.iter().zip(&b)).map(|(r, (a, b))| r + 0.5 * (a - b)).collect();
    let noise = metrics::rel_mse(&quarter, &truth);
    assert!((number(&data["reference"]["noise"]) / noise - 1.0).abs() < 1e-3 && noise > 0.0);
    let mut kept = 0;
    for point in points(&data) {
        let label = point["label"].as_str().unwrap();
        assert_eq!(point["seeds"], 2, "{label}");
        if device.info().timestamps {
            let passes: f64 =
                point["passes"].as_array().unwrap().iter().map(|pass| number(&pass["ms"])).sum();
            assert!(passes > 0.0 && number(&point["ms"]["median"]) > 0.0, "{label}");
        }
        assert!(
            point["rays"].as_u64().unwrap() > 768 && point["device_bytes"].as_u64().unwrap() > 0,
            "{label}"
        );
        let Some(file) = point["exr"].as_str() else { continue };
        kept += 1;
        let image = pixels(&read_exr(&folder.path("report").join(file)).unwrap());
        let measured = metrics::rel_mse(&image, &truth);
        let error = (measured - noise).max(0.1 * measured);
        let ends = ["min", "max"].map(|end| number(&point["metrics"]["rel_mse"][end]));
        assert!(ends.iter().any(|end| (end / error - 1.0).abs() < 1e-3), "{label}: {error} of {ends:?}");
        let bias = metrics::signed_bias(&image, &truth);
        let ends = ["min", "max"].map(|end| number(&point["metrics"]["signed_bias"][end]));
        assert!(ends.iter().any(|end| (end - bias).abs() < 1e-6), "{label}: {bias} of {ends:?}");
    }

    check_over_seeds(&folder, &data, &truth);
    assert!((0.0..0.1).contains(&number(&data["reference"]["bias_se"])));

    // The front is what is ranked and no point beats, and only its linear pictures are kept.
    let pair =
        |point: &Value| (number(&point["ms"]["median"]), number(&point["metrics"]["rel_mse"]["median"]));
    let all: Vec<_> = points(&data).iter().map(pair).collect();
    for point in points(&data) {
        let (ms, error) = pair(point);
        let beaten = all.iter().any(|q| q.0 <= ms && q.1 <= error && *q != (ms, error));
        assert_eq!(point["exr"].is_string(), point["ranked"] == true && !beaten, "{point}");
    }
    let files = folder.names("report/pictures");
    assert_eq!(files.iter().filter(|name| name.ends_with(".exr")).count(), kept);
    assert_eq!(files.iter().filter(|name| name.ends_with(".jpg")).count(), 2 * 6 + 1);

    // Rows, page and printed table hold the same.
    let csv = folder.text("report/data.csv");
    let lines: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines.len(), 7);
    let column = |name: &str| lines[0].iter().position(|cell| *cell == name).unwrap();
    for (line, point) in lines[1..].iter().zip(points(&data)) {
        assert_eq!(line.len(), lines[0].len());
        assert_eq!(line[column("id")], point["id"]);
        assert_eq!(line[column("front")] == "true", point["exr"].is_string());
        let ms: f64 = line[column("ms")].parse().unwrap();
        assert!((ms / number(&point["ms"]["median"]) - 1.0).abs() < 1e-9);
        let stated = |key: &str| number(&point["over_seeds"][key]);
        for (name, expected) in [("mean_bias", "bias"), ("mean_bias_se", "bias_se")]
            .into_iter()
            .chain(["rel_mse_of_mean", "systematic", "rel_mse_blocks"].map(|name| (name, name)))
        {
            let cell: f64 = line[column(name)].parse().unwrap();
            assert!((cell - stated(expected)).abs() < 1e-9, "{name}");
        }
    }
    let page = folder.text("report/index.html");
    assert_eq!(page.matches("data:image/jpeg;base64,").count(), 2 * 6 + 1);
    for point in points(&data) {
        let label = point["label"].as_str().unwrap();
        assert!(page.contains(label), "{label}");
        let listed = point["exr"].is_string() || point["ranked"] == false;
        assert_eq!(printed.lines().any(|line| line.starts_with(label)), listed, "{label}");
    }
    for answer in data["answers"].as_array().unwrap() {
        assert!(printed.contains(answer["sentence"].as_str().unwrap()), "{printed}");
    }
    assert!(!folder.names("report").iter().any(|name| name.ends_with(".tmp")));
}

/// What it measures is what it should: paths have no bias and half the variance with twice the samples, VPLs of one
/// bounce lose the rest.
#[test]
fn errors_follow_what_methods_are() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    folder.chart(&["--seeds", "8", "-q"]);
    let data = folder.json("report/data.json");
    let median = |label: &str, metric: &str| {
        let point = points(&data).iter().find(|point| point["label"] == label);
        number(&point.unwrap_or_else(|| panic!("no {label}"))["metrics"][metric]["median"])
    };
    let ratio = median("path spp=1", "rel_mse_trimmed") / median("path spp=4", "rel_mse_trimmed");
    assert!((2.5..6.0).contains(&ratio), "{ratio}");
    assert!(median("path spp=4", "signed_bias").abs() < 0.05);
    // Noise of paths is no systematic error; what one bounce does not reach is little else.
    let share = |label: &str| {
        let point = points(&data).iter().find(|point| point["label"] == label).unwrap();
        number(&point["over_seeds"]["systematic"]) / number(&point["over_seeds"]["rel_mse"])
    };
    let [paths, dark] = ["path spp=4", "igi fast bounces=1 vpls=36"].map(share);
    assert!(paths.abs() < 0.1 && dark > 0.5, "{paths} {dark}");
    let [one, six] = [1, 6].map(|b| median(&format!("igi fast bounces={b} vpls=36"), "signed_bias"));
    assert!(one < -0.1 && one < six - 0.05, "{one} {six}");
}

#[test]
fn a_sweep_goes_on_where_it_was_cut_short() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    folder.chart(&["--seeds", "1"]);
    let journal = folder.text("report/journal.jsonl");
    assert_eq!(journal.lines().count(), 1 + 6);
    let truth =
        |folder_name: &str| pixels(&read_exr(&folder.path(folder_name).join("reference.exr")).unwrap());
    let reference = truth("report");

    // One line torn: that one is measured again, no other.
    let kept = &journal[..journal.len() - 30];
    folder.write("report/journal.jsonl", kept);
    folder.chart(&["--seeds", "2"]);
    let longer = folder.text("report/journal.jsonl");
    assert_eq!(longer.lines().count(), 1 + 12);
    let whole = kept.rfind('\n').unwrap() + 1;
    assert!(longer.starts_with(&kept[..whole]));
    assert_eq!(folder.json("report/data.json")["complete"], true);
    let data = folder.json("report/data.json");
    assert!(points(&data).iter().all(|point| point["seeds"] == 2));
    check_over_seeds(&folder, &data, &reference);

    // Nothing is left to do, with fewer settings as well.
    let data = folder.text("report/data.json");
    folder.chart(&["--seeds", "2"]);
    assert_eq!(folder.text("report/data.json"), data);
    assert_eq!(folder.text("report/journal.jsonl"), longer);
    folder.write("grid.toml", "[[sweep]]\nmethod = 'path'\npath_trace.spp = 4");
    folder.chart(&["--seeds", "2"]);
    let data = folder.json("report/data.json");
    assert_eq!((points(&data).len(), folder.text("report/journal.jsonl")), (1, longer.clone()));

    // What was measured otherwise does not mix.
    let mut args = SMALL;
    args[3] = "32x20";
    folder.refused(&args, &["journal.jsonl", "size", "32x24", "32x20", "-o"]);
    args = SMALL;
    args[1] = "builtin:office";
    folder.refused(&args, &["journal.jsonl", "scene or camera"]);
    assert_eq!(folder.text("report/journal.jsonl"), longer);

    // The reference is the one in the cache, unless a better one is asked for.
    let mut args = SMALL;
    args[9] = "other";
    assert_eq!(folder.run(&args).status.code(), Some(0));
    assert!(truth("other") == reference);
    args[7] = "258";
    folder.refused(&args, &["journal.jsonl", "reference"]);
    args[9] = "third";
    assert_eq!(folder.run(&args).status.code(), Some(0));
    assert_eq!(folder.json("third/data.json")["reference"]["spp"], 258);
}

/// The general pipeline is timed where the grid asks for it; what was measured without is measured again.
#[test]
fn a_grid_may_ask_what_the_general_pipeline_takes() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    let sweep = "[[sweep]]\npreset = 'paper-canonical'\nvpl_shoot.vpls = 9\n[[sweep]]\nmethod = 'path'\npath_trace.spp = 1";
    let cells = || {
        let csv = folder.text("report/data.csv");
        let lines: Vec<Vec<String>> =
            csv.lines().map(|line| line.split(',').map(String::from).collect()).collect();
        let column = |name: &str| lines[0].iter().position(|cell| cell == name).unwrap();
        let [ms, general, gain] = ["ms", "general_ms", "gain"].map(column);
        lines[1..].iter().map(|line| [ms, general, gain].map(|i| line[i].clone())).collect::<Vec<_>>()
    };
    let lines = || folder.text("report/journal.jsonl").lines().count();
    folder.write("grid.toml", sweep);
    folder.chart(&["--seeds", "1"]);
    assert!(points(&folder.json("report/data.json")).iter().all(|point| point["general_ms"].is_null()));
    assert!(cells().iter().all(|[_, general, gain]| general.is_empty() && gain.is_empty()));
    assert_eq!(lines(), 1 + 2);

    folder.write("grid.toml", &format!("general = true\n{sweep}"));
    folder.chart(&["--seeds", "1"]);
    assert_eq!(lines(), 1 + 4);
    let data = folder.json("report/data.json");
    for (point, cells) in points(&data).iter().zip(cells()) {
        let [ms, general, gain] = cells.map(|cell| cell.parse::<f64>().unwrap());
        assert!(general > 0.0 && general == number(&point["general_ms"]), "{point}");
        assert!((gain * ms / general - 1.0).abs() < 1e-9);
    }

    // It is there for all who ask, and for those who do not.
    folder.chart(&["--seeds", "1"]);
    folder.write("grid.toml", sweep);
    folder.chart(&["--seeds", "1"]);
    assert_eq!((lines(), &folder.json("report/data.json")["complete"]), (1 + 4, &json!(true)));
}

#[test]
fn a_setting_that_fails_is_told_and_stops_nothing() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    folder.write(
        "grid.toml",
        "[[sweep]]
         indirect.visibility = 'boxes'
         indirect.box_split = 1e-7
         [[sweep]]
         vpl_shoot.vpls = 9",
    );
    let printed = folder.chart(&["--seeds", "1"]);
    let data = folder.json("report/data.json");
    let failures = data["failures"].as_array().unwrap();
    assert_eq!((points(&data).len(), failures.len(), &data["complete"]), (1, 1, &json!(true)));
    let label = "igi box_split=0.0000001 visibility=boxes";
    let (label, error) =
        (failures[0]["label"].as_str().unwrap_or(label), failures[0]["error"].as_str().unwrap());
    assert!(error.contains("box_split"), "{error}");
    assert!(printed.contains(&format!("failed: {label}: {error}")), "{printed}");
}

#[test]
fn time_that_is_over_leaves_a_chart_of_what_is_there() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    let printed = folder.chart(&["--seeds", "2", "--time-limit", "1ms"]);
    assert!(printed.contains("not complete: 0 of 12 measurements"), "{printed}");
    assert_eq!(folder.json("report/data.json")["complete"], false);
    assert!(!folder.chart(&["--seeds", "2"]).contains("not complete"));
    assert_eq!(folder.json("report/data.json")["complete"], true);
}

#[cfg(unix)]
#[test]
fn an_interrupted_sweep_leaves_a_chart_of_what_is_finished() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    folder.write(
        "grid.toml",
        "[[sweep]]\nvpl_shoot.vpls = 9\n[[sweep]]\nmethod = 'path'\npath_trace.spp = 100000",
    );
    let mut args = SMALL.to_vec();
    args.extend(["--progress", "json"]);
    let mut child = folder.command(&args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let endless = |line: &String| line.contains("\"stage\":\"chart\"") && line.contains("spp=100000");
    // The small picture before the sweep has one sample, so this is the endless one.
    let started = lines.by_ref().map(Result::unwrap).find(endless);
    assert!(started.is_some(), "it ended: {:?}", child.wait());
    let interrupt = format!("kill -INT {}", child.id());
    assert!(Command::new("sh").args(["-c", &interrupt]).status().unwrap().success());
    let rest: Vec<_> = lines.map(Result::unwrap).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    let data = folder.json("report/data.json");
    assert_eq!((points(&data).len(), &data["complete"]), (1, &json!(false)));
    assert_eq!(points(&data)[0]["label"], "igi vpls=9");
}

#[test]
fn bad_usage_is_refused_before_anything_is_computed() {
    let folder = Folder::new();
    folder.write("bad.toml", "[[sweep]]\nvpl_shoot.vlps = 3");
    folder.write("file", "");
    for (args, words) in [
        (&["chart", "--grid", "large"][..], &["--grid", "large", "small, paper, full"][..]),
        (&["chart", "--grid", "bad.toml"], &["--grid: bad.toml", "[[sweep]] 1", "vpl_shoot.vpls"]),
        (&["chart", "--grid", "gone.toml"], &["--grid", "gone.toml"]),
        (&["chart", "--size", "0x5"], &["--size", "16384"]),
        (&["chart", "--seeds", "0"], &["--seeds"]),
        (&["chart", "--reference-spp", "1"], &["--reference-spp"]),
        (&["chart", "--reference-depth", "0"], &["--reference-depth"]),
        (&["chart", "--reference", "gone.exr"], &["--reference", "gone.exr"]),
        (&["chart", "--reference", "a.exr", "--reference-spp", "4"], &["--reference-spp"]),
        (&["chart", "--time-limit", "soon"], &["--time-limit"]),
        (&["chart", "-o", "file"], &["file", "folder"]),
        (&["render", "--budget", "16"], &["--budget", "16ms"]),
        (&["render", "--budget", "16ms", "--error", "0.1"], &["--error"]),
        (&["render", "--budget", "16ms", "--vpls", "9"], &["--vpls"]),
        (&["render", "--error", "0.1", "-D", "vpl_shoot.vpls=9"], &["-D"]),
        (&["render", "--error", "-1"], &["--error", "above 0"]),
        (&["render", "--front", "data.json"], &["--front", "--budget"]),
    ] {
        folder.refused(args, words);
    }
    assert_eq!(folder.names("."), ["bad.toml", "file", "grid.toml"]);
}

#[test]
fn a_picture_of_the_users_own_is_a_reference() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    let render = |args: &[&str]| {
        let output = folder.run(&[&["render", "builtin:two-albedo", "-q"], args].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    };
    render(&["--size", "32x24", "--preset", "fast", "--vpls", "9", "-o", "own.exr"]);
    render(&["--size", "16x24", "-o", "small.exr"]);
    folder.write("grid.toml", "[[sweep]]\npreset = 'fast'\nvpl_shoot.vpls = [9, 36]");
    let args = [
        "chart",
        "builtin:two-albedo",
        "--size",
        "32x24",
        "--grid",
        "grid.toml",
        "--seeds",
        "1",
        "-o",
        "report",
    ];
    let with = |file| [&args[..], &["--reference", file]].concat();
    folder.refused(&with("small.exr"), &["--reference", "small.exr", "16x24", "32x24"]);
    assert_eq!(folder.run(&with("own.exr")).status.code(), Some(0));
    let data = folder.json("report/data.json");
    assert_eq!((&data["reference"]["noise"], &data["reference"]["spp"]), (&Value::Null, &Value::Null));
    assert!(data["reference"]["about"].as_str().unwrap().contains("own.exr"));
    // It is the first setting's own picture: to the last bit, on one device.
    let error = |index: usize| number(&points(&data)[index]["metrics"]["rel_mse"]["median"]);
    assert!(error(0) == 0.0 && error(1) > 0.0);
}

/// The sky around the scene is that of `render`.
#[test]
fn a_chart_takes_an_environment() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    let scene = ["builtin:plane", "--size", "32x24", "--environment"];
    let own = folder
        .run(&[&["render", "-q", "--preset", "fast", "-o", "own.exr"], &scene[..], &["1,2,3"]].concat());
    assert_eq!(own.status.code(), Some(0), "{}", stderr(&own));
    folder.write("grid.toml", "[[sweep]]\npreset = 'fast'");
    let error = |sky| {
        let args = ["--grid", "grid.toml", "--seeds", "1", "--reference", "own.exr", "-o", sky];
        let output = folder.run(&[&["chart", "-q"], &scene[..], &[sky], &args].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        number(&points(&folder.json(&format!("{sky}/data.json")))[0]["metrics"]["rel_mse"]["median"])
    };
    assert_eq!(error("1,2,3"), 0.0);
    assert!(error("3,2,1") > 0.0);
}

/// What is chosen is what the chart predicts, is rendered with those settings, and is told with what came of it.
#[test]
fn a_budget_takes_the_best_of_the_chart_and_an_error_the_fastest() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    folder.chart(&["--seeds", "2", "-q"]);
    let data = folder.json("report/data.json");
    // Of what is not ranked the reference's noise is known.
    let noise = number(&data["reference"]["noise"]);
    let ms = |point: &&Value| number(&point["ms"]["median"]);
    let error = |point: &&Value| {
        let error = number(&point["metrics"]["rel_mse"]["median"]);
        if point["ranked"] == true { error } else { error.max(noise) }
    };
    let fastest = points(&data).iter().min_by(|a, b| ms(a).total_cmp(&ms(b))).unwrap();
    let render = |args: &[&str]| {
        let size = if args.contains(&"--size") { &[][..] } else { &["--size", "32x24"] };
        let render = ["render", "builtin:two-albedo", "-o", "a.exr"];
        let output = folder.run(&[&render[..], size, args].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let picture = read_exr(&folder.path("a.exr")).unwrap();
        let Some(parhelion::output::Attribute::Text(settings)) = picture.attributes.get("parhelion:settings")
        else {
            panic!("no settings")
        };
        let settings: RenderConfig = serde_json::from_str(settings).unwrap();
        (String::from_utf8(output.stdout).unwrap(), settings)
    };
    let vpls = |point: &Value| point["settings"]["vpl_shoot.vpls"].as_u64().map(|n| n as u32);
    // Nothing is as fast as that: the fastest there is.
    let (text, settings) = render(&["--budget", "0.001ms"]);
    assert!(
        text.contains("nothing fulfils it") && text.contains(fastest["label"].as_str().unwrap()),
        "{text}"
    );
    assert_eq!(Some(settings.vpl_shoot.vpls), vpls(fastest).or(Some(180)));
    // Everything is exact enough: the fastest again.
    let (text, _) = render(&["--error", "1e9", "--seed", "5"]);
    assert!(!text.contains("nothing fulfils it"), "{text}");
    assert!(
        text.contains(&format!("picked for error 1000000000: {}", fastest["label"].as_str().unwrap())),
        "{text}"
    );
    for word in ["predicted: ", "a chart of 6 settings at 32x24", "got: ", "relMSE"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    // More exact than anything charted: paths with more samples.
    let least = points(&data).iter().map(|point| error(&point)).fold(f64::INFINITY, f64::min);
    let (text, settings) = render(&["--error", &format!("{}", 0.4 * least)]);
    assert!(text.contains("path spp=") && settings.path_trace.spp > 4, "{text}");
    // The file itself is as good as what was left in the cache, and of any size.
    let (text, _) = render(&["--error", "1e9", "--front", "report/data.json", "--size", "64x24"]);
    assert!(text.contains("in proportion to pixels"), "{text}");
    folder.refused(&["render", "--budget", "1ms", "--front", "grid.toml"], &["--front", "grid.toml"]);
}

#[test]
fn without_a_chart_a_probe_predicts() {
    let Some(_device) = common::device() else { return };
    let folder = Folder::new();
    let run = || {
        let args = ["render", "builtin:two-albedo", "--size", "48x32", "--error", "1e9", "-o", "a.png"];
        let output = folder.run(&args);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let text = String::from_utf8(output.stdout).unwrap();
        let said = text.lines().filter(|line| line.starts_with("picked") || line.starts_with("predicted"));
        (said.map(String::from).collect::<Vec<_>>(), text)
    };
    let (first, text) = run();
    assert!(text.contains("by a probe at") && text.contains("its error is known once"), "{text}");
    // It is made once.
    assert_eq!(run().0, first);
    assert_eq!(folder.names("cache/parhelion/fronts").len(), 1);
}

/// The page's pictures are those a render would have drawn.
#[test]
fn tone_mapping_on_the_host_is_that_of_the_device() {
    let Some((_guard, device)) = common::device() else { return };
    let scene = builtin::by_name("office").unwrap();
    let camera = scene.cameras[0].clone();
    let mut renderer = Renderer::new(&device, scene, &RendererOptions::default()).unwrap();
    let mut config = RenderConfig { size: [40, 30], ..common::plain() };
    config.vpl_shoot.vpls = 9;
    // Automatic, and so bright that the operator compresses most of it.
    for exposure in [None, Some(4.0)] {
        config.tone_map.exposure = exposure;
        let frame = renderer.render(&config, &camera, &FrameRequest::default()).unwrap();
        if exposure.is_none() {
            assert!((picture::exposure(&frame.beauty.data) - frame.exposure_ev).abs() < 1e-3);
        }
        let host = picture::display(&frame.beauty.data, frame.exposure_ev);
        let drawn = frame.display.chunks_exact(4).flat_map(|pixel| &pixel[..3]);
        let worst = host.iter().zip(drawn).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(worst <= 1, "{worst}");
    }
}
