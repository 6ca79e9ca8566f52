//! Pages of charts and stress scenes: what is in them, and in a browser, where there is one, what they do.

mod common;

use parhelion::chart::answer::{answers, error_of};
use parhelion::chart::data::{
    Answer, Chart, Failure, MetricInfo, PassTime, Point, Reference, SCHEMA, Spread,
};
use parhelion::metrics::SeedErrors;
use parhelion::stress::data::{Row, Shown, Stress, Verdict};
use parhelion::{chart, stress};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

/// A name that does harm wherever text is taken for markup.
const HOSTILE: &str = r#"</script><script>problems.push("ran")</script><img src=x onerror="problems.push('ran')"> & '{{style}}'"#;

const COLUMNS: [&str; 4] = ["ms", "label", "general", "metric bias"];

/// A picture of one colour, its bytes percent-encoded.
fn picture(colour: [u8; 3]) -> String {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 4, 3);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&colour.repeat(12)).unwrap();
    bytes.iter().fold(String::from("data:image/png,"), |mut url, byte| {
        write!(url, "%{byte:02x}").unwrap();
        url
    })
}

/// Numbers from 0 to 1 that look random.
fn unit(n: u32) -> f64 {
    f64::from(n.wrapping_mul(2_654_435_761).wrapping_add(12345).wrapping_mul(2_246_822_519) >> 8)
        / f64::from(1 << 24)
}

fn spread(median: f64, width: f64) -> Spread {
    let half = median.abs() * width;
    Spread { median, min: median - half, max: median + half }
}

/// 40 points of three methods: of the first unknown error by one metric, the sixth below the noise, the
/// tenth without the time of a general pipeline, the last but one equal to the third.
fn chart() -> Chart {
    let metric = |key: &str, label: &str, signed| MetricInfo {
        key: key.into(),
        label: label.into(),
        about: format!("About {HOSTILE}."),
        signed,
    };
    let mut images = BTreeMap::from([(String::from("reference"), picture([9, 9, 9]))]);
    let points = (0..40_u32).map(|i| {
        let method = ["igi", "path", HOSTILE][if i == 39 { 2 } else { i as usize % 2 }];
        let settings = match method {
            "igi" => BTreeMap::from([
                ("indirect.downsample".into(), json!(1 << (i / 2 % 3))),
                ("indirect.visibility".into(), json!(["exact", HOSTILE][i as usize / 2 % 2])),
            ]),
            "path" => BTreeMap::from([("path_trace.spp".into(), json!(i))]),
            _ => BTreeMap::new(),
        };
        let twin = if i == 38 { 2 } else { i };
        let ms = 100_f64.powf(unit(twin));
        let error = |seed| 0.3 / ms.sqrt() * (0.2 + unit(twin + seed));
        let mut metrics = BTreeMap::from([
            ("rel_mse".into(), spread(if i == 5 { 1e-6 } else { error(100) }, 0.2)),
            ("bias".into(), spread(error(200) * if i % 3 == 0 { -1.0 } else { 1.0 }, 1.5)),
        ]);
        if i != 0 {
            metrics.insert("flip".into(), spread(error(300), 0.0));
        }
        images.insert(format!("picture {i}"), picture([i as u8, 0, 255]));
        images.insert(format!("error {i}"), picture([i as u8, 255, 0]));
        Point {
            id: format!("{method} {i}"),
            method: method.into(),
            label: format!("setting {i} {}", if i == 7 { HOSTILE } else { "" }),
            settings,
            seeds: 3,
            ms: spread(ms, 0.1),
            passes: vec![
                PassTime { path: "indirect/gather".into(), ms: ms * 0.9 },
                PassTime { path: "tone_map/neutral".into(), ms: ms * 0.001 },
            ],
            rays: u64::from(i) * 1_000_000,
            device_bytes: 1 << 20,
            metrics,
            // Of the first no pictures of earlier seeds.
            over_seeds: (i != 5).then(|| SeedErrors {
                rel_mse: error(100),
                rel_mse_worst: 1.2 * error(100),
                bias: -error(200),
                bias_se: Some(0.01),
                rel_mse_of_mean: (i != 0).then(|| 0.5 * error(100)),
                systematic: (i != 0).then_some(-1e-4),
                rel_mse_blocks: 0.1 * error(100),
            }),
            ranked: i != 5,
            general_ms: (i != 9).then_some(ms * 1.2),
            image: format!("picture {i}"),
            error_image: format!("error {i}"),
            exr: (i == 1).then(|| String::from("one.exr")),
        }
    });
    let points = points.collect::<Vec<_>>();
    Chart {
        schema: SCHEMA,
        version: "0.1.0".into(),
        scene: HOSTILE.into(),
        fingerprint: "0".into(),
        triangles: 1_234_567,
        camera: HOSTILE.into(),
        size: [4, 3],
        device: "a device".into(),
        driver: "a driver".into(),
        backend: "software".into(),
        reference: Reference {
            about: "path".into(),
            spp: Some(64),
            noise: Some(1e-3),
            bias_se: Some(1e-4),
            image: "reference".into(),
        },
        metrics: vec![
            metric("rel_mse", "relMSE", false),
            metric("bias", "bias", true),
            metric("flip", "FLIP", false),
        ],
        answers: vec![
            Answer { ms: 0.1, point: None, sentence: "nothing is that fast".into() },
            Answer { ms: 100.0, point: Some(points[12].id.clone()), sentence: HOSTILE.into() },
        ],
        complete: true,
        failures: vec![Failure { label: "boxes".into(), error: HOSTILE.into() }],
        points,
        images,
    }
}

/// A chart of nothing.
fn empty_chart() -> Chart {
    let mut chart = chart();
    chart.points.clear();
    chart.answers.clear();
    chart.images.clear();
    chart.reference =
        Reference { about: "a file".into(), spp: None, noise: None, bias_se: None, image: String::new() };
    chart
}

/// Two scenes, three rows each: every verdict, and one that holds against what is known.
fn stress() -> Stress {
    let row = |scene: &str, method: &str, verdict, known: Option<&str>| Row {
        scene: scene.into(),
        mechanism: format!("Why {HOSTILE}."),
        method: method.into(),
        setting: HOSTILE.into(),
        number: "relMSE".into(),
        value: Some(0.25),
        bound: "at most 0.1".into(),
        verdict,
        known: known.map(String::from),
        images: ["picture", "reference"].map(|key| Shown { label: key.into(), key: key.into() }).into(),
    };
    Stress {
        schema: stress::data::SCHEMA,
        version: "0.1.0".into(),
        device: HOSTILE.into(),
        driver: "a driver".into(),
        backend: "software".into(),
        size: [4, 3],
        rows: vec![
            row("crease", "igi", Verdict::FailsAsKnown, Some("the clamp")),
            row("crease", "path", Verdict::Holds, None),
            row("crease", HOSTILE, Verdict::Fails, None),
            row(HOSTILE, "igi", Verdict::Holds, Some("the clamp")),
            Row { images: Vec::new(), value: None, ..row(HOSTILE, "path", Verdict::Fails, None) },
            row(HOSTILE, HOSTILE, Verdict::Holds, None),
        ],
        images: BTreeMap::from([
            ("picture".into(), picture([1, 2, 3])),
            ("reference".into(), picture([9, 9, 9])),
        ]),
    }
}

/// The text of the page's data.
fn embedded(page: &str) -> &str {
    let (_, rest) = page.split_once(r#"<script type="application/json" id="data">"#).unwrap();
    rest.split_once("</script>").unwrap().0
}

fn assert_one_file(page: &str) {
    assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
    assert!(!page.contains("http"), "a page asks for nothing over the network");
    assert_eq!(page.matches("<script").count(), 2, "data and program");
    assert_eq!(page.matches("</script").count(), 2);
}

#[test]
fn pages_hold_their_data_whatever_names_say() {
    let page = chart::report::html(&chart());
    assert_one_file(&page);
    let read: Chart = serde_json::from_str(embedded(&page)).unwrap();
    assert_eq!(read.points.len(), 40);
    assert_eq!((read.scene, read.metrics, read.images), (chart().scene, chart().metrics, chart().images));
    // Numbers as text: reading them may be off by a rounding.
    assert_eq!(embedded(&page).replace("\\u003c", "<"), serde_json::to_string(&chart()).unwrap());

    let page = stress::report::html(&stress());
    assert_one_file(&page);
    assert_eq!(serde_json::from_str::<Stress>(embedded(&page)).unwrap(), stress());
}

// --- In a browser ------------------------------------------------------------------------------------

/// A browser of this machine.
fn browser() -> Option<&'static str> {
    let found = ["chromium", "chromium-browser", "google-chrome"].into_iter().find(|name| {
        Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success())
    });
    common::require("chromium", found.is_some(), "no Chromium to open pages with");
    found
}

/// Opens a page with flags, and returns what the browser says on standard output and error.
fn open(browser: &str, folder: &Path, page: &str, fragment: &str, flags: &[&str]) -> (String, String) {
    let file = folder.join("page.html");
    std::fs::write(&file, page).unwrap();
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--virtual-time-budget=5000",
        ])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .args(flags)
        .arg(format!("file://{}{fragment}", file.display()))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (String::from_utf8(output.stdout).unwrap(), String::from_utf8_lossy(&output.stderr).into())
}

/// `page` with the script that notices trouble before its own.
fn hooked(page: &str) -> String {
    page.replacen("<body>", &format!("<body><script>{}</script>", include_str!("report/hook.js")), 1)
}

/// What `script`, in a block of its own, reports of a page, which must have had no trouble.
fn drive(browser: &str, page: &str, script: &str, fragment: &str, flags: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let page = hooked(page).replace("</body>", &format!("<script>{{{script}}}</script></body>"));
    let (dom, errors) = open(browser, folder.path(), &page, fragment, &[flags, &["--dump-dom"]].concat());
    let result = dom.split_once(r#"<pre id="result">"#).unwrap_or_else(|| panic!("no result: {errors}")).1;
    let result = unescape(result.split_once("</pre>").unwrap().0);
    let mut result: Value = serde_json::from_str(&result).unwrap();
    assert_eq!(result["problems"], json!([]), "trouble in the page");
    result["result"].take()
}

/// Undoes `encodeURIComponent`.
fn unescape(text: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        let hex = |rest: &mut std::str::Bytes<'_>| char::from(rest.next().unwrap()).to_digit(16).unwrap();
        bytes.push(if byte == b'%' { (hex(&mut rest) * 16 + hex(&mut rest)) as u8 } else { byte });
    }
    String::from_utf8(bytes).unwrap()
}

/// `encodeURIComponent` of an id, behind a `#`.
fn fragment(id: &str) -> String {
    id.bytes().fold(String::from("#"), |mut text, byte| {
        match byte {
            b'0'..=b'9' | b'A'..=b'Z' | b'a'..=b'z' => text.push(byte.into()),
            b'-' | b'_' | b'.' | b'!' | b'~' | b'*' | b'\'' | b'(' | b')' => text.push(byte.into()),
            _ => write!(text, "%{byte:02X}").unwrap(),
        }
        text
    })
}

fn set(ids: &Value) -> BTreeSet<&str> {
    ids.as_array().unwrap().iter().map(|id| id.as_str().unwrap()).collect()
}

fn ids(chart: &Chart, keep: impl Fn(&Point) -> bool) -> BTreeSet<&str> {
    chart.points.iter().filter(|point| keep(point)).map(|point| point.id.as_str()).collect()
}

fn error(point: &Point, metric: &str) -> Option<f64> {
    point.metrics.get(metric).map(|spread| spread.median.abs())
}

/// Ranked points that no other beats in one and equals or beats in the other.
fn front<'a>(chart: &'a Chart, metric: &str) -> Vec<&'a Point> {
    let measured = || chart.points.iter().filter(|p| error(p, metric).is_some());
    let beats = |q: &Point, p: &Point| {
        let (q, p) = ((q.ms.median, error(q, metric)), (p.ms.median, error(p, metric)));
        q != p && q.0 <= p.0 && q.1 <= p.1
    };
    measured().filter(|p| p.ranked && !measured().any(|q| beats(q, p))).collect()
}

#[test]
fn a_chart_in_a_browser() {
    let Some(browser) = browser() else { return };
    let chart = chart();
    let page = chart::report::html(&chart);
    let out = drive(browser, &page, include_str!("report/chart.js"), "", &["--window-size=1400,1000"]);
    let image = |key: &str| json!(chart.images[key]);
    let point = |id: &Value| chart.points.iter().find(|p| p.id == id.as_str().unwrap()).unwrap();
    let reference = image("reference");

    assert_eq!(set(&out["all"]["points"]), ids(&chart, |_| true));
    assert_eq!(set(&out["all"]["rows"]), ids(&chart, |_| true));
    assert_eq!(out["all"]["points"].as_array().unwrap().len(), chart.points.len());
    assert_eq!(out["strangers"], 0);
    assert!(out["failures"].as_str().unwrap().contains(HOSTILE));
    assert_eq!(out["hollow"], json!([[chart.points[5].id, "var(--bg)"]]));
    assert_eq!(out["first"]["points"], json!([chart.answers[1].point]), "the slowest answer is chosen first");

    for how in ["clicked", "entered", "row"] {
        let chosen = point(&out[how]["id"]);
        assert_eq!(out[how]["points"], json!([chosen.id]), "{how}");
        assert_eq!(out[how]["rows"], json!([chosen.id]), "{how}");
        assert_eq!(out[how]["shot"], image(&chosen.image), "{how}");
        assert_eq!(out[how]["hash"], fragment(&chosen.id), "{how}");
    }
    assert_eq!(out["escaped"]["points"], json!([]));
    assert_eq!(out["escaped"]["rows"], json!([]));
    assert_eq!(out["escaped"]["hash"], "");
    assert_eq!(out["escaped"]["shot"], reference);

    let clicked = point(&out["clicked"]["id"]);
    let (own, wrong) = (image(&clicked.image), image(&clicked.error_image));
    let swap = &out["swap"];
    for (how, shot) in [
        ("flipped", &reference),
        ("back", &own),
        ("tapped", &reference),
        ("error", &wrong),
        ("hovered", &reference),
        ("left", &wrong),
        ("slider", &own),
    ] {
        assert_eq!(swap[how]["shot"], *shot, "{how}");
        assert_eq!(swap[how]["over"], if how == "slider" { reference.clone() } else { Value::Null }, "{how}");
    }
    assert_eq!(swap["slider"]["clip"], "inset(0px 0px 0px 25%)");
    assert_eq!(swap["moved"]["clip"], "inset(0px 0px 0px 75%)");

    let mut by_time = chart.points.iter().collect::<Vec<_>>();
    by_time.sort_by(|a, b| a.ms.median.total_cmp(&b.ms.median));
    let mut by_error = chart.points.iter().collect::<Vec<_>>();
    by_error.sort_by(|a, b| error(a, "rel_mse").partial_cmp(&error(b, "rel_mse")).unwrap());
    let slowest = by_time[39];
    let place = by_error.iter().position(|p| p.id == slowest.id).unwrap();
    let above = by_error[(place + 1).min(39)];
    let below = if place == 39 { by_error[38] } else { slowest };
    assert_eq!(out["stops"], 1, "one point is reached by tab");
    for (key, expected) in [
        ("home", by_time[0]),
        ("right", by_time[1]),
        ("left", by_time[0]),
        ("left_end", by_time[0]),
        ("end", slowest),
        ("up", above),
        ("down", below),
    ] {
        assert_eq!(out["walk"][key], expected.id, "{key}");
    }
    assert!(out["tip"].as_str().unwrap().contains(below.label.trim_end()));

    for column in COLUMNS {
        let value = |id: &Value| {
            let point = point(id);
            match column {
                "ms" => Some(point.ms.median),
                "general" => point.general_ms,
                "label" => point.label.split(' ').nth(1).unwrap().parse().ok(),
                _ => point.metrics.get("bias").map(|spread| spread.median),
            }
        };
        for (way, sort, sign) in [("up", "ascending", 1.0), ("down", "descending", -1.0)] {
            let sorted = &out["sorted"][column][way];
            assert_eq!(sorted["sort"], sort, "{column}");
            assert_eq!(set(&sorted["rows"]), ids(&chart, |_| true), "{column}");
            let values = sorted["rows"]
                .as_array()
                .unwrap()
                .iter()
                .map(|id| value(id).map_or(f64::INFINITY, |v| v * sign));
            assert!(values.is_sorted(), "{column} {way}");
        }
    }

    for (metric, count) in [("rel_mse", 40), ("bias", 40), ("flip", 39)] {
        let shown = &out["fronts"][metric];
        let expected = front(&chart, metric);
        assert!(expected.len() > 2, "{metric}: a front worth the name");
        assert_eq!(set(&shown["front"]), expected.iter().map(|p| p.id.as_str()).collect(), "{metric}");
        assert_eq!(shown["gallery"], expected.len() + 1, "{metric}: what is not ranked behind the front");
        assert_eq!(shown["points"].as_array().unwrap().len(), count, "{metric}");
        assert_eq!(shown["rows"].as_array().unwrap().len(), 40, "{metric}");
    }

    // The page's readouts are the printed answers.
    let answers = answers(&chart.points, chart.reference.noise);
    let counted = |p: &Point| error_of(p, chart.reference.noise).unwrap().0;
    let unranked = &chart.points[5];
    for (ms, best) in out["time"].as_object().unwrap() {
        let answer = answers.iter().find(|answer| answer.ms == ms.parse::<f64>().unwrap()).unwrap();
        let id = answer.point.as_ref().map(|id| fragment(id));
        assert_eq!(best[0], json!(id), "{ms} ms");
        let about = best[1].as_str().is_some_and(|text| text.contains("relMSE about 0.00100"));
        assert_eq!(about, id == Some(fragment(&unranked.id)), "{ms} ms: {best}");
    }
    assert!(out["time"].as_object().unwrap().values().any(|best| best[0] == fragment(&unranked.id)));
    for (most, fastest) in out["error"].as_object().unwrap() {
        let enough = chart.points.iter().filter(|p| counted(p) <= most.parse().unwrap());
        let expected = enough.min_by(|a, b| a.ms.median.total_cmp(&b.ms.median));
        assert_eq!(fastest[0], json!(expected.map(|p| fragment(&p.id))), "relMSE {most}");
    }
    assert!((out["stepped"].as_f64().unwrap() / 16.8 - 1.0).abs() < 1e-9);
    assert!(out["dragged"].as_f64().unwrap() > by_time[39].ms.median, "dragged to the slow end");
    assert_eq!(out["dropped"], out["dragged"], "let go");

    let no_path = ids(&chart, |p| p.method != "path");
    let nor_4 =
        ids(&chart, |p| p.method != "path" && p.settings.get("indirect.downsample") != Some(&json!(4)));
    assert!(nor_4.len() < no_path.len());
    assert_eq!(out["without_path"]["pressed"], "false");
    for (state, expected) in
        [("without_path", no_path), ("without_path_and_4", nor_4), ("restored", ids(&chart, |_| true))]
    {
        assert_eq!(set(&out[state]["points"]), expected, "{state}");
        assert_eq!(set(&out[state]["rows"]), expected, "{state}");
    }
}

#[test]
fn a_chart_is_readable_light_and_dark_and_opens_where_it_was_left() {
    let Some(browser) = browser() else { return };
    let chart = chart();
    let left_at = &chart.points[39];
    for (dark, scheme) in [(true, 0), (false, 1)] {
        let scheme = format!("--blink-settings=preferredColorScheme={scheme}");
        let (page, script) = (chart::report::html(&chart), include_str!("report/chart.js"));
        let out =
            drive(browser, &page, script, &fragment(&left_at.id), &["--window-size=1400,1000", &scheme]);
        assert_eq!(out["dark"], dark);
        assert_eq!(out["first"]["points"], json!([left_at.id]));
        assert!(out["contrast"]["texts"].as_u64().unwrap() > 100);
        assert!(out["contrast"]["least"].as_f64().unwrap() >= 4.5, "dark {dark}: {}", out["contrast"]);
    }
}

/// Windows have a least width; frames have none.
#[test]
fn pages_fit_a_narrow_screen() {
    let Some(browser) = browser() else { return };
    for page in [chart::report::html(&chart()), stress::report::html(&stress())] {
        let page = serde_json::to_string(&hooked(&page)).unwrap().replace('<', "\\u003c");
        let script = format!(
            "const frame = document.querySelector('iframe');
            frame.onload = () => report(async () => ({{
                width: frame.contentWindow.innerWidth,
                over: frame.contentDocument.documentElement.scrollWidth - frame.contentDocument.documentElement.clientWidth,
                problems: frame.contentWindow.problems,
            }}));
            frame.srcdoc = {page};"
        );
        let frame =
            r#"<!doctype html><body><iframe width="360" height="700" style="border: 0"></iframe></body>"#;
        let out = drive(browser, frame, &script, "", &[]);
        assert_eq!(out, json!({ "width": 360, "over": 0, "problems": [] }));
    }
}

/// A still picture is XML, holds what the chart does, and covers what lies behind it.
#[test]
fn a_still_chart_in_a_browser() {
    let Some(browser) = browser() else { return };
    let chart = chart();
    for (chart, marks) in [(&chart, 40), (&empty_chart(), 0)] {
        let text = serde_json::to_string(&chart::svg::svg(chart)).unwrap().replace('<', "\\u003c");
        let script = format!(
            "const read = new DOMParser().parseFromString({text}, 'image/svg+xml');
            const all = (selector) => [...read.querySelectorAll(selector)];
            document.body.append(document.importNode(read.documentElement, true));
            const box = (node) => node.getBoundingClientRect();
            const svg = box(document.querySelector('svg'));
            const texts = [...document.querySelectorAll('svg text')].map((node) => [node.textContent, box(node)]);
            report(async () => ({{
                errors: all('parsererror').length,
                strangers: all('script, img').length,
                marks: all('.mark').length,
                hollow: all('.mark[fill=\"#fff\"]').map((mark) => mark.querySelector('title').textContent),
                background: read.querySelector('rect').getAttribute('fill'),
                title: read.querySelector('title').textContent,
                over: texts.filter(([, at]) => at.left < svg.left || at.right > svg.right || at.top < svg.top || at.bottom > svg.bottom).map(([text]) => text),
            }}));"
        );
        let page = r#"<!doctype html><meta charset="utf-8"><body></body>"#;
        let out = drive(browser, page, &script, "", &["--window-size=1000,800"]);
        assert_eq!((&out["errors"], &out["strangers"]), (&json!(0), &json!(0)));
        assert_eq!(out["marks"], marks);
        assert_eq!((&out["background"], &out["over"]), (&json!("#fff"), &json!([])));
        assert!(out["title"].as_str().unwrap().contains(HOSTILE));
        let hollow = out["hollow"].as_array().unwrap();
        assert_eq!(hollow.len(), usize::from(marks > 0));
        assert!(
            hollow.iter().all(|title| title.as_str().unwrap().contains("relMSE about 0.00100")),
            "{hollow:?}"
        );
    }
}

#[test]
fn a_chart_of_nothing_opens() {
    let Some(browser) = browser() else { return };
    let script = "report(async () => ids('.point').concat(ids('#table tbody tr')));";
    let out = drive(browser, &chart::report::html(&empty_chart()), script, "#nowhere", &[]);
    assert_eq!(out, json!([]));
}

#[test]
fn print_shows_every_picture_of_the_front() {
    let Some(browser) = browser() else { return };
    let chart = chart();
    let folder = tempfile::tempdir().unwrap();
    let pdf = folder.path().join("page.pdf");
    let flags = [format!("--print-to-pdf={}", pdf.display()), "--enable-logging=stderr".into()];
    let flags = flags.each_ref().map(String::as_str);
    let (_, log) = open(browser, folder.path(), &chart::report::html(&chart), "", &flags);
    assert!(!log.contains("CONSOLE"), "{log}");
    let pdf = std::fs::read(pdf).unwrap();
    let pictures = String::from_utf8_lossy(&pdf).matches("/Subtype /Image").count();
    assert!(pictures >= front(&chart, "rel_mse").len(), "{pictures} pictures");
}

#[test]
fn verdicts_in_a_browser() {
    let Some(browser) = browser() else { return };
    let stress = stress();
    let page = stress::report::html(&stress);
    let rows = |keep: &dyn Fn(&Row) -> bool| -> BTreeSet<String> {
        stress.rows.iter().enumerate().filter(|(_, row)| keep(row)).map(|(i, _)| format!("row-{i}")).collect()
    };
    let assert_shown = |out: &Value, keep: &dyn Fn(&Row) -> bool| {
        let expected = rows(keep);
        let expected = expected.iter().map(String::as_str).collect::<BTreeSet<_>>();
        assert_eq!(set(&out["cards"]), expected);
        assert_eq!(set(&out["links"]), expected);
    };
    for scheme in ["--blink-settings=preferredColorScheme=0", "--blink-settings=preferredColorScheme=1"] {
        let out = drive(browser, &page, include_str!("report/stress.js"), "", &[scheme]);
        assert_shown(&out, &|_| true);
        assert_shown(&out["without_holds"], &|row| row.verdict != Verdict::Holds);
        assert_shown(&out["without_path"], &|row| row.method != "path");
        assert!(out["count"].as_str().unwrap().contains("3 not as expected"), "{}", out["count"]);
        let words =
            ["≈ fails as known", "✓ holds", "✗ fails", "! holds, known to fail", "✗ fails", "✓ holds"];
        assert_eq!(out["words"], json!(words));
        assert_eq!(set(&out["colours"]).len(), 3, "a colour for each verdict");
        let [picture, reference] = ["picture", "reference"].map(|key| &stress.images[key]);
        assert_eq!(out["pictures"], json!([picture, reference, picture]));
        assert!(out["contrast"]["least"].as_f64().unwrap() >= 4.5, "{scheme}: {}", out["contrast"]);
    }
}
