//! `parhelion methods`: a page that says what was measured, and nothing else.

mod common;

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageReader};
use parhelion::chart::data::{Chart, Failure, MetricInfo, PassTime, Point, Reference, SCHEMA, Spread};
use parhelion::chart::svg;
use parhelion::docs::WIDEST;
use parhelion::methods::REGISTRY;
use parhelion::metrics::SeedErrors;
use parhelion::stress::data::{self as stress, Row, Stress, Verdict};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A name that does harm wherever text is taken for markup.
const HOSTILE: &str = "</text><script>|`*x*`\u{1}\n&";

fn spread(median: f64, width: f64) -> Spread {
    Spread { median, min: median - width, max: median + width }
}

fn point(id: &str, label: &str, settings: Value, ms: f64, rel_mse: f64) -> Point {
    Point {
        id: id.into(),
        method: settings["method"].as_str().unwrap().into(),
        label: label.into(),
        settings: serde_json::from_value(settings).unwrap(),
        seeds: 2,
        ms: spread(ms, 0.5),
        passes: vec![
            PassTime { path: "indirect/gather".into(), ms: 0.9 * ms },
            PassTime { path: "gbuffer/primary".into(), ms: 0.095 * ms },
            PassTime { path: "tone_map/neutral".into(), ms: 0.005 * ms },
        ],
        rays: 2_500_000,
        device_bytes: 3 << 20,
        metrics: BTreeMap::from([
            ("rel_mse".into(), spread(rel_mse, 0.0)),
            ("signed_bias".into(), spread(-0.0625, 0.0)),
            ("flip".into(), spread(0.25, 0.125)),
        ]),
        over_seeds: None,
        ranked: true,
        general_ms: None,
        image: format!("pictures/{id}.jpg"),
        error_image: format!("pictures/{id}-error.jpg"),
        exr: None,
    }
}

/// The defaults, `fast` and path tracing as a chart holds them, and one setting that is no named way.
fn chart(scene: &str) -> Chart {
    let depth = json!(64);
    let fast = json!({
        "method": "igi", "indirect.downsample": 2, "indirect.upsample": "plane", "indirect.interleave": 3,
        "indirect.filter": "combined", "indirect.least_fit": 0.6, "indirect.glossy": false, "indirect.compensation": 0,
        "whitted.light_samples": 16, "vpl_shoot.vpls": 180, "shadow_terminator": false, "vpl_shoot.bounces": 3,
        "vpl_shoot.lobes": false, "vpl_shoot.guided": false, "vpl_shoot.candidates": 1,
        "path_trace.max_depth": depth, "path_trace.pixel_filter": "center",
    });
    let path = |spp: u32| json!({ "method": "path", "path_trace.spp": spp, "path_trace.max_depth": depth });
    let metric = |key: &str, label: &str, signed| MetricInfo {
        key: key.into(),
        label: label.into(),
        about: "About it.".into(),
        signed,
    };
    let over_seeds = SeedErrors {
        rel_mse: 0.125,
        rel_mse_worst: 0.25,
        bias: -0.125,
        bias_se: Some(0.003),
        rel_mse_of_mean: Some(0.03125),
        systematic: Some(0.015_625),
        rel_mse_blocks: 0.0625,
    };
    let points = vec![
        point("igi", "igi", json!({ "method": "igi", "path_trace.max_depth": depth }), 20.0, 0.0625),
        Point { over_seeds: Some(over_seeds), ..point("fast", "igi fast", fast, 4.0, 0.125) },
        point("many", HOSTILE, json!({ "method": "igi", "vpl_shoot.vpls": 1440 }), 80.0, 0.5),
        Point { ranked: false, ..point("path", "path spp=64", path(64), 1234.5, 0.0001) },
    ];
    Chart {
        schema: SCHEMA,
        version: "0.1.0".into(),
        scene: scene.into(),
        fingerprint: "0".into(),
        triangles: 4321,
        camera: "main".into(),
        size: [8, 6],
        device: "a device".into(),
        driver: "a driver".into(),
        backend: "software".into(),
        reference: Reference {
            about: "path tracing".into(),
            spp: Some(99),
            noise: Some(0.000_75),
            bias_se: Some(0.000_25),
            image: "pictures/reference.jpg".into(),
        },
        metrics: vec![
            metric("rel_mse", "relMSE", false),
            metric("flip", "HDR-FLIP", false),
            metric("signed_bias", "bias", true),
        ],
        points,
        complete: true,
        failures: vec![Failure { label: "igi boxes".into(), error: "no memory".into() }],
        answers: Vec::new(),
        images: BTreeMap::new(),
    }
}

fn stress() -> Stress {
    let row =
        |scene: &str, method: &str, setting: &str, value: Option<f64>, verdict, known: Option<&str>| Row {
            scene: scene.into(),
            mechanism: format!("Why {scene} is hard."),
            method: method.into(),
            setting: setting.into(),
            number: "share lost".into(),
            value,
            bound: "at most 0.1".into(),
            verdict,
            known: known.map(String::from),
            images: Vec::new(),
        };
    use Verdict::{Fails, FailsAsKnown, Holds};
    Stress {
        schema: stress::SCHEMA,
        version: "0.1.0".into(),
        device: "another device".into(),
        driver: "a driver".into(),
        backend: "software".into(),
        size: [32, 24],
        rows: vec![
            row("clamp", "igi", "", Some(0.4375), FailsAsKnown, Some("the clamp takes it")),
            row("clamp", "igi", "indirect.min_distance=0", Some(0.01), Holds, None),
            row("clamp", "path", "", Some(0.001), Holds, None),
            row("wires", "igi", "", Some(0.002), Holds, None),
            row("wires", "igi", "preset=fast", Some(0.75), FailsAsKnown, Some("no sample fits")),
            row("wires", "path", "path_trace.spp=128", None, Fails, None),
        ],
        images: BTreeMap::new(),
    }
}

fn jpeg(file: &Path, [width, height]: [u32; 2], grey: u8) {
    let mut bytes = Vec::new();
    let pixels = vec![grey; (3 * width * height) as usize];
    JpegEncoder::new(&mut bytes).encode(&pixels, width, height, ExtendedColorType::Rgb8).unwrap();
    std::fs::write(file, bytes).unwrap();
}

struct Folder(tempfile::TempDir);

impl Folder {
    /// `office` and `large` are charts, the second without `fast` and of pictures that are too wide; `stress` is a run.
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        folder.chart("office", &chart("Office"));
        let mut large = chart("Large Hall");
        large.size = [640, 240];
        large.points.remove(1);
        folder.chart("large", &large);
        std::fs::create_dir(folder.path("stress")).unwrap();
        folder.write("stress/stress.json", &serde_json::to_string(&stress()).unwrap());
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

    fn chart(&self, name: &str, chart: &Chart) {
        std::fs::create_dir_all(self.path(name).join("pictures")).unwrap();
        self.write(&format!("{name}/data.json"), &serde_json::to_string(chart).unwrap());
        for (index, point) in chart.points.iter().enumerate() {
            jpeg(&self.path(name).join(&point.image), chart.size, 20 * index as u8);
            jpeg(&self.path(name).join(&point.error_image), chart.size, 20 * index as u8 + 10);
        }
    }

    fn run(&self, args: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_parhelion")).args(args).current_dir(self.0.path()).output().unwrap()
    }

    fn methods(&self, args: &[&str]) {
        let output = self.run(&[&["methods"], args].concat());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(output.stdout.is_empty() && output.stderr.is_empty());
    }

    /// Everything in it, files with their contents.
    fn contents(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let entries = std::fs::read_dir(self.path(folder)).unwrap().map(Result::unwrap);
        entries
            .map(|entry| {
                (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap_or_default())
            })
            .collect()
    }
}

const ALL: [&str; 8] = ["--chart", "office", "--chart", "large", "--stress", "stress", "-o", "page.md"];

/// The section of a heading, up to the next one of any level.
fn section<'a>(page: &'a str, heading: &str) -> &'a str {
    let start = page.find(&format!("{heading}\n")).unwrap_or_else(|| panic!("no {heading}: {page}"));
    let rest = &page[start + heading.len()..];
    rest.find("\n#").map_or(rest, |end| &rest[..end])
}

/// The cells of the only row of a section that begins so.
fn cells<'a>(section: &'a str, first: &str) -> Vec<&'a str> {
    let row = |line: &&str| line.starts_with(&format!("| {first} |"));
    let found: Vec<_> = section.lines().filter(row).collect();
    let [line] = found[..] else { panic!("{} rows of {first}: {section}", found.len()) };
    line.trim_matches('|').split(" | ").map(str::trim).collect()
}

#[test]
fn the_page_says_what_was_measured() {
    let folder = Folder::new();
    folder.methods(&ALL);
    let page = folder.text("page.md");
    for method in REGISTRY {
        assert!(section(&page, &format!("## {}", method.name)).contains(method.description), "{page}");
    }
    let igi = section(&page, "## igi");
    assert_eq!(cells(igi, "**ms a frame**")[1..], ["**20.0 (19.5 to 20.5)**"; 2]);
    assert_eq!(cells(igi, "`indirect/gather`")[1..], ["18.0", "18.0"]);
    assert_eq!(cells(igi, "`gbuffer/primary`")[1], "1.90");
    assert_eq!(cells(igi, "all others")[1], "0.100 (1 pass)");
    assert_eq!(cells(igi, "million rays")[1], "2.50");
    assert_eq!(cells(igi, "MiB on the device")[1], "3.00");
    assert_eq!(cells(igi, "relMSE")[1], "0.0625");
    assert_eq!(cells(igi, "bias")[1], "-6.2 %");
    assert_eq!(cells(igi, "systematic")[1], "–");
    let fast = section(&page, "### fast");
    assert_eq!(cells(fast, "bias")[1], "-12.50 ± 0.30 %");
    assert_eq!(cells(fast, "systematic")[1], "0.0156");
    assert_eq!(cells(igi, "HDR-FLIP")[1], "0.250 (0.125 to 0.375)");
    assert!(cells(section(&page, "## path"), "relMSE")[1].contains("about 0.000750, not ranked"));
    assert_eq!(cells(section(&page, "## path"), "**ms a frame**")[1], "**1234 (1234 to 1235)**");

    // What is not there is not made up.
    assert!(section(&page, "### fast").contains("Not in the chart of Large Hall."));
    assert_eq!(cells(section(&page, "### fast"), "**ms a frame**").len(), 2);
    let canonical = section(&page, "### paper-canonical");
    assert!(
        canonical.contains("Not in the chart of Office.")
            && canonical.contains("Not in the chart of Large Hall.")
    );
    assert!(!canonical.contains("ms a frame") && !canonical.contains(".jpg"));

    // Known failures are those of the suite, by the settings that the way has.
    let clamp = "**clamp**: Why clamp is hard.";
    let expected = ["the defaults", "share lost: 0.438", "at most 0.1", "fails as known: the clamp takes it"];
    assert_eq!(cells(igi, clamp)[1..], expected);
    assert!(igi.contains("Holds in wires.") && !igi.contains("no sample fits"));
    let wires = cells(section(&page, "### fast"), "**wires**: Why wires is hard.");
    assert_eq!(wires[1..3], ["`preset=fast`", "share lost: 0.750"]);
    assert!(section(&page, "### fast").contains("Tried with other settings alone in clamp."));
    let path = section(&page, "## path");
    assert!(path.contains("Holds in clamp.") && path.contains("other settings alone in wires."));
    let others = section(&page, "## Other settings under stress");
    assert!(others.contains("`indirect.min_distance=0`") && !others.contains("`preset=fast`"));
    assert!(others.contains("no picture") && others.contains("FAILS"));
    for words in
        ["2 scenes made to break methods", "another device", "Of 6 results 3 hold, 2 fail as known, 1 fail"]
    {
        assert!(page.contains(words), "{words}: {page}");
    }

    // Charts are whole, whatever names say.
    let office = section(&page, "## The chart of Office");
    for label in ["igi", "igi fast", "path spp=64"] {
        assert_eq!(cells(office, label).len(), 8, "{label}");
    }
    assert_eq!(cells(office, "igi fast")[7], "front");
    assert_eq!(cells(office, "path spp=64")[7], "not ranked");
    assert!(office.contains("Failed: igi boxes: no memory"));
    assert!(
        !page.contains("<script>")
            && page.contains("8×6 pixels of 4321 triangles, camera main, 2 seeds, on a device")
    );

    // Every picture is there, small, and shown.
    let files = folder.contents("page");
    let linked: BTreeSet<&str> =
        page.split("](page/").skip(1).map(|rest| rest.split_once(')').unwrap().0).collect();
    assert_eq!(linked, files.keys().map(String::as_str).collect());
    assert_eq!(files.len(), 2 * 3 + 2 * 2 + 2);
    for name in files.keys().filter(|name| name.ends_with(".jpg")) {
        let (width, height) =
            ImageReader::open(folder.path("page").join(name)).unwrap().into_dimensions().unwrap();
        let expected = if name.starts_with("office") { (8, 6) } else { (WIDEST, WIDEST * 240 / 640) };
        assert_eq!((width, height), expected, "{name}");
    }
    assert_eq!(files["office-path.jpg"], folder.contents("office/pictures")["path.jpg"]);

    // The same again, byte for byte; another time in the data is another in the page.
    folder.methods(&ALL);
    assert_eq!((folder.text("page.md"), folder.contents("page")), (page.clone(), files));
    let data = folder.text("office/data.json");
    folder.write("office/data.json", &data.replace("1234.5", "999.0"));
    folder.methods(&ALL);
    let other = folder.text("page.md");
    assert!(other.contains("**999 (") && other.replace("999", "1234") != other && !other.contains("1234.5"));
    assert!(folder.contents(".").keys().all(|name| !name.ends_with(".tmp")));
}

#[test]
fn without_the_stress_suite_the_page_says_so() {
    let folder = Folder::new();
    folder.methods(&["--chart", "office", "--chart", "office", "-o", "page.md"]);
    let page = folder.text("page.md");
    assert!(page.contains("known failures are left out") && !page.contains("Other settings under stress"));
    // Charts of one scene keep apart.
    assert!(page.contains("## The chart of Office, a device"));
    let names = folder.contents("page");
    assert!(names.contains_key("office.svg") && names.contains_key("office-2.svg"));
    assert_eq!(names.len(), 2 * (3 * 2 + 1));
}

#[test]
fn what_cannot_be_used_is_one_error_and_writes_nothing() {
    let folder = Folder::new();
    folder.write("file", "");
    let with = |name: &str, change: &dyn Fn(&mut Chart)| {
        let mut chart = chart("Office");
        change(&mut chart);
        folder.chart(name, &chart);
    };
    with("gone", &|_| {});
    std::fs::remove_file(folder.path("gone/pictures/igi-error.jpg")).unwrap();
    with("broken", &|_| {});
    folder.write("broken/pictures/fast.jpg", "no picture");
    with("bent", &|_| {});
    jpeg(&folder.path("bent/pictures/fast.jpg"), [3, 3], 0);
    with("later", &|chart| chart.schema = SCHEMA + 1);
    with("foreign", &|_| {});
    std::fs::copy(folder.path("stress/stress.json"), folder.path("foreign/data.json")).unwrap();
    folder.write("foreign/stress.json", "{\"schema\": 2}");
    with("torn", &|_| {});
    folder.write("torn/data.json", "{\"schema\": 1,");
    with("strange", &|chart| drop(chart.points[0].settings.insert("vpl_shoot.vlps".into(), json!(3))));
    std::fs::create_dir(folder.path("odd")).unwrap();
    let mut odd = stress();
    odd.rows[0].setting = "indirect.min_dist=1".into();
    folder.write("odd/stress.json", &serde_json::to_string(&odd).unwrap());
    let before = folder.contents(".");
    for (args, words) in [
        (&[][..], &["--chart"][..]),
        (&["--chart", "nowhere"], &["nowhere/data.json", "parhelion chart -o nowhere"]),
        (&["--chart", "office", "--stress", "office"], &["office/stress.json", "parhelion stress"]),
        (&["--chart", "office", "--stress", "foreign"], &["foreign/stress.json", "`version`"]),
        (&["--chart", "office", "--stress", "odd"], &["odd/stress.json", "indirect.min_distance"]),
        (&["--chart", "gone"], &["gone/pictures/igi-error.jpg"]),
        (&["--chart", "broken"], &["broken/pictures/fast.jpg", "no picture"]),
        (&["--chart", "bent"], &["bent/pictures/fast.jpg", "3x3", "8x6"]),
        (&["--chart", "later"], &["later/data.json", "of form 2"]),
        (&["--chart", "foreign"], &["foreign/data.json"]),
        (&["--chart", "torn"], &["torn/data.json", "not what `parhelion chart` writes"]),
        (&["--chart", "strange"], &["strange/data.json", "point igi", "vpl_shoot.vpls"]),
        (&["--chart", "office", "-o", "page.html"], &["page.html", ".md"]),
        (&["--chart", "office", "-o", ".md"], &[".md"]),
        (&["--chart", "office", "-o", "file.md"], &["file: a file"]),
        (&["--chart", "office", "-o", "missing/page.md"], &["missing/page.md"]),
    ] {
        let output = folder.run(&[&["methods"], args].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert!(words.iter().all(|word| message.contains(word)), "{args:?}: {message}");
        assert_eq!(message.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{message}");
    }
    assert_eq!(folder.contents("."), before);
}

#[test]
fn a_still_chart_marks_every_point_and_escapes_every_name() {
    let mut chart = chart(HOSTILE);
    let drawn = svg::svg(&chart);
    assert_eq!(drawn, svg::svg(&chart));
    let marks = |text: &str| text.matches("class=\"mark\"").count();
    assert_eq!(marks(&drawn), chart.points.len());
    // One is hollow, those on the front are labelled.
    assert_eq!(drawn.matches("fill=\"#fff\" stroke=").count(), 1);
    assert!(drawn.contains(">fast</text>") && drawn.matches("class=\"front\"").count() == 1);
    assert!(!drawn.contains("<script") && !drawn.contains('\u{1}'));
    assert_eq!(drawn.matches("<text").count(), drawn.matches("</text>").count());
    // What has no time or no error has no place.
    chart.points[0].ms = spread(0.0, 0.0);
    chart.points[1].metrics.clear();
    assert_eq!(marks(&svg::svg(&chart)), chart.points.len() - 2);
    chart.points.clear();
    assert_eq!(marks(&svg::svg(&chart)), 0);
}

/// What the program measures is what the page reads.
#[test]
fn a_page_of_real_measurements() {
    let Some((_guard, _device)) = common::device() else { return };
    let folder = Folder(tempfile::tempdir().unwrap());
    folder.write("grid.toml", "[[sweep]]\npreset = 'fast'\n[[sweep]]\nmethod = 'path'");
    let run = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_parhelion"));
        command.args(args).current_dir(folder.0.path()).env("XDG_CACHE_HOME", folder.path("cache"));
        let output = command.env("MESA_SHADER_CACHE_DIR", env!("CARGO_TARGET_TMPDIR")).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    };
    let room = ["chart", "builtin:two-albedo", "--size", "16x12", "--seeds", "1", "-o", "room", "-q"];
    run(&[&room[..], &["--grid", "grid.toml", "--reference-spp", "64"]].concat());
    run(&["stress", "--only", "caustic", "--backend", "software", "-o", "stress", "-q"]);
    run(&["methods", "--chart", "room", "--stress", "stress"]);
    let page = folder.text("methods.md");
    let data: Value = serde_json::from_str(&folder.text("room/data.json")).unwrap();
    for (heading, index) in [("### fast", 0), ("## path", 1)] {
        let ms = data["points"][index]["ms"]["median"].as_f64().unwrap();
        let said = cells(section(&page, heading), "**ms a frame**")[1].trim_matches('*');
        assert!((said.parse::<f64>().unwrap() / ms - 1.0).abs() < 0.006, "{said} {ms}");
        assert!(section(&page, heading).contains("caustic"));
    }
    assert_eq!(folder.contents("methods").len(), 2 * 2 + 1);
}
