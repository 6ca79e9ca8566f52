//! The page's text.

use super::ways::Way;
use super::{Error, Measurements, small};
use crate::chart::answer::{bias_of, error_of, front_of, significant};
use crate::chart::data::{Answer, Chart, Point, Spread};
use crate::chart::svg::svg;
use crate::config::{ConfigError, Preset};
use crate::methods::Method;
use crate::stress::data::{Row, Stress, Verdict};
use crate::text::{markdown, printable};
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// A page and what it shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Page {
    /// Markdown.
    pub text: String,
    /// Files in the page's folder, by name.
    pub files: Vec<(String, Vec<u8>)>,
}

impl Measurements {
    /// The page, whose files are to lie in `folder` beside it. The same measurements give the same bytes.
    ///
    /// # Errors
    /// A picture of a chart is missing or broken.
    pub fn page(&self, folder: &str) -> Result<Page, Error> {
        let mut files = Vec::new();
        let text = write_page(self, folder, &mut files)?;
        Ok(Page { text, files })
    }
}

/// A chart and how the page calls it.
struct Room<'a> {
    chart: &'a Chart,
    folder: &'a Path,
    title: String,
    /// What names of its files begin with.
    slug: String,
    /// For each way its point.
    points: Vec<Option<&'a Point>>,
}

/// Writes the page; pictures are added to `files`, which lie in `folder`.
fn write_page(
    measured: &Measurements,
    folder: &str,
    files: &mut Vec<(String, Vec<u8>)>,
) -> Result<String, Error> {
    let ways = Way::all();
    let rooms = rooms(measured, &ways);
    let folder = &encode(folder);
    let mut text = String::from(
        "# Methods\n\nWhat each method is, costs, leaves wrong and fails at, as `parhelion methods` found it in the \
         measurements named below. `make docs` measures anew and writes this page; nothing in it is written by hand.\n\n",
    );
    text.push_str("**Charts**\n\n");
    for room in &rooms {
        let _ = writeln!(text, "- [{}](#chart-{}): {}", room.title, room.slug, about(room.chart));
    }
    text.push_str("\n**Failures**\n\n");
    match &measured.stress {
        Some((_, stress)) => {
            let _ = writeln!(text, "- {}", about_stress(stress));
        }
        None => text.push_str("- No run of `parhelion stress` was given: known failures are left out.\n"),
    }
    text.push_str(
        "\nErrors are of the whole picture against the chart's reference, medians over seeds with their range, the last of \
         which is the worst seed's; times are of one warm frame. Bias is the mean over seeds ± its standard error, by how \
         seeds differ; below 0 light is lost. Systematic is relMSE of the mean over seeds without the variance that is left \
         in it, (n · relMSE of the mean − mean of relMSE) / (n − 1) with n seeds: what no number of seeds takes away, and \
         below 0 where none shows. The reference's own noise is taken off both. Blocks are of 32×32 pixels: relMSE of their \
         means, in which grain averages out.\n\n",
    );
    for index in 0..ways.len() {
        section(&mut text, &ways, index, &rooms, measured.stress.as_ref(), folder, files)?;
    }
    for room in &rooms {
        charted(&mut text, room, folder, files);
    }
    if let Some((file, stress)) = &measured.stress {
        others(&mut text, &ways, stress).map_err(|error| unfit(file, &error))?;
    }
    Ok(text)
}

fn unfit(file: &Path, error: &ConfigError) -> Error {
    Error::Unfit { file: file.into(), problem: format!("a row's setting: {error}") }
}

fn rooms<'a>(measured: &'a Measurements, ways: &[Way]) -> Vec<Room<'a>> {
    let mut rooms: Vec<Room<'_>> = Vec::new();
    for ((folder, chart), configs) in measured.charts.iter().zip(&measured.configs) {
        let own = |way: &Way| {
            let found = configs.iter().position(|config| way.is(config))?;
            chart.points.get(found)
        };
        let twice = measured.charts.iter().filter(|(_, other)| other.scene == chart.scene).count() > 1;
        let title = if twice { format!("{}, {}", chart.scene, chart.device) } else { chart.scene.clone() };
        let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
        let stem = match chart.scene.chars().map(plain).collect::<String>().trim_matches('-') {
            "" => "room".to_owned(),
            stem => stem.to_owned(),
        };
        let taken = |slug: &str| rooms.iter().any(|room| room.slug == slug);
        let mut slug = stem.clone();
        for count in 2.. {
            if !taken(&slug) {
                break;
            }
            slug = format!("{stem}-{count}");
        }
        let points = ways.iter().map(own).collect();
        rooms.push(Room { chart, folder, title: markdown(&title), slug, points });
    }
    rooms
}

fn about(chart: &Chart) -> String {
    let [width, height] = chart.size;
    let seeds = chart.points.iter().map(|point| point.seeds);
    let seeds = match (seeds.clone().min(), seeds.max()) {
        (Some(least), Some(most)) if least != most => format!("{least} to {most} seeds"),
        (_, Some(1)) => "one seed".into(),
        (_, Some(most)) => format!("{most} seeds"),
        _ => "nothing measured".into(),
    };
    let reference = &chart.reference;
    let mut text = format!(
        "{width}×{height} pixels of {} triangles, camera {}, {seeds}, on {}; driver {}, {} backend, Parhelion {}. \
         Reference: {}{}, {}.",
        chart.triangles,
        markdown(&chart.camera),
        markdown(&chart.device),
        markdown(&chart.driver),
        markdown(&chart.backend),
        markdown(&chart.version),
        markdown(&reference.about),
        reference.spp.map_or(String::new(), |spp| format!(", {spp} samples a pixel")),
        match reference.noise {
            Some(noise) => format!("its own noise relMSE {}", number(noise)),
            None => "its own noise not known".into(),
        }
    );
    if !chart.complete {
        text.push_str(" **Not complete**: the sweep was cut short.");
    }
    text
}

fn about_stress(stress: &Stress) -> String {
    let count = |verdict| stress.rows.iter().filter(|row| row.verdict == verdict).count();
    let mut cases: Vec<&str> = stress.rows.iter().map(|row| row.scene.as_str()).collect();
    cases.dedup();
    let [width, height] = stress.size;
    format!(
        "{} scenes made to break methods, {width}×{height} pixels, on {}; driver {}, {} backend, Parhelion {}. Of {} \
         results {} hold, {} fail as known, {} fail unexpectedly. A preset's are those with the most of its settings, which \
         stand beside them.",
        cases.len(),
        markdown(&stress.device),
        markdown(&stress.driver),
        markdown(&stress.backend),
        markdown(&stress.version),
        stress.rows.len(),
        count(Verdict::Holds),
        count(Verdict::FailsAsKnown),
        count(Verdict::Fails)
    )
}

fn section(
    text: &mut String,
    ways: &[Way],
    index: usize,
    rooms: &[Room<'_>],
    stress: Option<&(PathBuf, Stress)>,
    folder: &str,
    files: &mut Vec<(String, Vec<u8>)>,
) -> Result<(), Error> {
    let way = &ways[index];
    let settings: Vec<_> =
        way.settings().iter().map(|(key, value)| code(&format!("{key}={}", word(value)))).collect();
    let settings = match settings[..] {
        [] => "All settings are at their defaults.".into(),
        _ => format!("Beside the defaults it sets {}.", settings.join(", ")),
    };
    let _ = match way.preset {
        None => {
            let Method { name, about, description, .. } = way.method;
            writeln!(text, "## {name}\n\n`--method {name}`: {about}. {description} {settings}\n")
        }
        Some(Preset { name, about, .. }) => {
            writeln!(text, "### {name}\n\n`--preset {name}`: {about}. {settings}\n")
        }
    };
    let charted: Vec<(&Room<'_>, &Point)> =
        rooms.iter().filter_map(|room| Some((room, room.points[index]?))).collect();
    if !charted.is_empty() {
        pictures(text, way, &charted, folder, files)?;
        numbers(text, &charted);
    }
    for room in rooms.iter().filter(|room| room.points[index].is_none()) {
        let _ = writeln!(text, "Not in the chart of {}.\n", room.title);
    }
    if let Some((file, stress)) = stress {
        failures(text, way, stress).map_err(|error| unfit(file, &error))?;
    }
    Ok(())
}

fn pictures(
    text: &mut String,
    way: &Way,
    charted: &[(&Room<'_>, &Point)],
    folder: &str,
    files: &mut Vec<(String, Vec<u8>)>,
) -> Result<(), Error> {
    let mut cells = Vec::new();
    for (room, point) in charted {
        let own = format!("{}-{}.jpg", room.slug, way.name());
        let wrong = format!("{}-{}-error.jpg", room.slug, way.name());
        cells.push(vec![
            room.title.clone(),
            format!("![{} by {}]({folder}/{own})", room.title, way.name()),
            format!("![its error]({folder}/{wrong})"),
        ]);
        for (name, key) in [(own, &point.image), (wrong, &point.error_image)] {
            files.push((name, small(room.folder, key, room.chart.size)?));
        }
    }
    table(text, &["", "picture", "where a person sees its error (HDR-FLIP)"], cells);
    Ok(())
}

/// Cost and error, a column for each room.
fn numbers(text: &mut String, charted: &[(&Room<'_>, &Point)]) {
    let head = |title: &'static str| {
        std::iter::once(title).chain(charted.iter().map(|(room, _)| room.title.as_str())).collect::<Vec<_>>()
    };
    let row = |name: &str, cell: &dyn Fn(&Room<'_>, &Point) -> String| {
        let cells = charted.iter().map(|(room, point)| cell(room, point));
        std::iter::once(name.to_owned()).chain(cells).collect::<Vec<_>>()
    };
    let mut rows = vec![row("**ms a frame**", &|_, point| format!("**{}**", spread(&point.ms, number)))];
    let mut paths: Vec<&str> = Vec::new();
    for pass in charted.iter().flat_map(|(_, point)| listed(point)) {
        if !paths.contains(&pass) {
            paths.push(pass);
        }
    }
    for path in &paths {
        let time = |_: &Room<'_>, point: &Point| {
            let found = point.passes.iter().find(|pass| pass.path == *path);
            found.map_or("–".into(), |pass| number(pass.ms))
        };
        rows.push(row(&code(path), &time));
    }
    let rest = |_: &Room<'_>, point: &Point| {
        let rest = point.passes.iter().filter(|pass| !paths.contains(&pass.path.as_str()));
        let (count, ms) = rest.fold((0, 0.0), |(count, ms), pass| (count + 1, ms + pass.ms));
        match (point.passes.len(), count) {
            (0, _) => "no pass was timed".into(),
            (_, 0) => "–".into(),
            (_, 1) => format!("{} (1 pass)", number(ms)),
            (_, count) => format!("{} ({count} passes)", number(ms)),
        }
    };
    rows.push(row("all others", &rest));
    rows.push(row("million rays", &|_, point| number(point.rays as f64 / 1e6)));
    rows.push(row("MiB on the device", &|_, point| number(point.device_bytes as f64 / f64::from(1 << 20))));
    table(text, &head("cost"), rows);

    let mut known: Vec<(&str, &str, bool)> = Vec::new();
    for metric in charted.iter().flat_map(|(room, _)| &room.chart.metrics) {
        if known.iter().all(|(key, ..)| *key != metric.key) {
            known.push((&metric.key, &metric.label, metric.signed));
        }
    }
    let rows = known
        .iter()
        .map(|(key, label, _)| row(&markdown(label), &|room, point| error(room.chart, point, key)));
    let mut rows: Vec<_> = rows.collect();
    rows.push(row("systematic", &|_, point| systematic(point)));
    table(text, &head("error"), rows);
}

/// Passes that take a hundredth of the time or more.
fn listed(point: &Point) -> impl Iterator<Item = &str> {
    let total: f64 = point.passes.iter().map(|pass| pass.ms).sum();
    point.passes.iter().filter(move |pass| pass.ms >= 0.01 * total).map(|pass| pass.path.as_str())
}

/// A point's error with its range, as charts say it.
fn error(chart: &Chart, point: &Point, key: &str) -> String {
    let Some(found) = point.metrics.get(key) else { return "–".into() };
    match (key, error_of(point, chart.reference.noise)) {
        ("rel_mse", Some((error, false))) => format!("about {}, not ranked", number(error)),
        ("signed_bias", _) => match bias_of(point).filter(|_| point.over_seeds.is_some()) {
            Some(bias) => bias,
            None => spread(found, percent),
        },
        _ => spread(found, number),
    }
}

fn systematic(point: &Point) -> String {
    point.over_seeds.and_then(|errors| errors.systematic).map_or("–".into(), number)
}

/// What a way fails at.
fn failures(text: &mut String, way: &Way, stress: &Stress) -> Result<(), ConfigError> {
    let tried = way.tried(&stress.rows)?;
    if tried.rows.is_empty() {
        text.push_str("The stress suite has not tried it.\n\n");
        return Ok(());
    }
    let (held, failed): (Vec<&Row>, Vec<&Row>) =
        tried.rows.iter().partition(|row| row.verdict == Verdict::Holds && row.known.is_none());
    let rows = failed.iter().map(|row| {
        let mut cells = vec![format!("**{}**: {}", markdown(&row.scene), markdown(&row.mechanism))];
        cells.extend(verdict(row));
        cells
    });
    let rows: Vec<_> = rows.collect();
    if !rows.is_empty() {
        table(text, &["known failures", "settings", "measured", "bound", "verdict"], rows);
    }
    let list = |rows: &[&Row]| {
        let mut scenes: Vec<String> = rows.iter().map(|row| markdown(&row.scene)).collect();
        scenes.dedup();
        scenes.join(", ")
    };
    let mut said = Vec::new();
    if !held.is_empty() {
        said.push(format!("Holds in {}.", list(&held)));
    }
    if !tried.otherwise.is_empty() {
        let scenes: Vec<_> = tried.otherwise.iter().map(|scene| markdown(scene)).collect();
        said.push(format!("Tried with other settings alone in {}.", scenes.join(", ")));
    }
    if !said.is_empty() {
        let _ = writeln!(text, "{}\n", said.join(" "));
    }
    Ok(())
}

/// Settings, measured, bound and verdict of a row.
fn verdict(row: &Row) -> [String; 4] {
    let settings: Vec<_> = row.setting.split_whitespace().map(code).collect();
    let because = row.known.as_ref().map_or(String::new(), |known| format!(": {}", markdown(known)));
    [
        if settings.is_empty() { "the defaults".into() } else { settings.join(" ") },
        format!("{}: {}", markdown(&row.number), row.value.map_or("no picture".into(), number)),
        markdown(&row.bound),
        format!("{}{because}", row.said()),
    ]
}

/// A chart's picture and all of its points.
fn charted(text: &mut String, room: &Room<'_>, folder: &str, files: &mut Vec<(String, Vec<u8>)>) {
    let Room { chart, title, slug, .. } = room;
    let _ = writeln!(text, "<a id=\"chart-{slug}\"></a>\n\n## The chart of {title}\n");
    let _ = writeln!(text, "![{title}: error against time, the front as steps]({folder}/{slug}.svg)\n");
    files.push((format!("{slug}.svg"), svg(chart).into_bytes()));
    let front = front_of(&chart.points, "rel_mse");
    let keys = ["rel_mse", "rel_mse_blocks", "signed_bias", "flip"];
    let metrics: Vec<_> =
        keys.iter().filter_map(|key| chart.metrics.iter().find(|metric| metric.key == *key)).collect();
    let labels: Vec<String> = metrics.iter().map(|metric| markdown(&metric.label)).collect();
    let mut head = vec!["setting", "ms"];
    head.extend(labels.iter().map(String::as_str));
    head.extend(["systematic", "million rays", "standing"]);
    let rows = chart.points.iter().enumerate().map(|(index, point)| {
        let standing = match (front.contains(&index), point.ranked) {
            (true, _) => "front",
            (_, true) => "",
            (_, false) => "not ranked",
        };
        let mut cells = vec![markdown(&point.label), number(point.ms.median)];
        cells.extend(metrics.iter().map(|metric| {
            match (metric.key.as_str(), point.metrics.get(&metric.key)) {
                (_, None) => "–".into(),
                ("signed_bias", _) => bias_of(point).unwrap_or_else(|| "–".into()),
                ("rel_mse", _) => error_of(point, chart.reference.noise)
                    .map_or("–".into(), |(error, known)| {
                        format!("{}{}", if known { "" } else { "about " }, number(error))
                    }),
                (_, Some(error)) => number(error.median),
            }
        }));
        cells.extend([systematic(point), number(point.rays as f64 / 1e6), standing.into()]);
        cells
    });
    table(text, &head, rows.collect::<Vec<_>>());
    let unranked = chart.points.iter().filter(|point| !point.ranked).count();
    if unranked > 0 {
        text.push_str(
            "Not ranked: too near the reference's own noise; drawn hollow, and of its error no more is known than “about”.\n\n",
        );
    }
    // Where nothing is fast enough, the last answer says what is nearest.
    let found = chart.answers.iter().any(|answer| answer.point.is_some());
    let last = chart.answers.len().saturating_sub(1);
    let said =
        |(index, answer): &(usize, &Answer)| if found { answer.point.is_some() } else { *index == last };
    for (_, answer) in chart.answers.iter().enumerate().filter(said) {
        let _ = writeln!(text, "- {}", markdown(&answer.sentence));
    }
    for failure in &chart.failures {
        let _ = writeln!(text, "- Failed: {}: {}", markdown(&failure.label), markdown(&failure.error));
    }
    text.push('\n');
}

/// Rows that are no named way's.
fn others(text: &mut String, ways: &[Way], stress: &Stress) -> Result<(), ConfigError> {
    let mut said: Vec<&Row> = Vec::new();
    for way in ways {
        said.extend(way.tried(&stress.rows)?.rows);
    }
    let rest = stress.rows.iter().filter(|row| said.iter().all(|other| !std::ptr::eq(*other, *row)));
    let rows = rest.map(|row| {
        let mut cells = vec![markdown(&row.scene), markdown(&row.method)];
        cells.extend(verdict(row));
        cells
    });
    let rows: Vec<_> = rows.collect();
    if !rows.is_empty() {
        text.push_str(
            "## Other settings under stress\n\nRemedies, and what fails beyond the named ways.\n\n",
        );
        table(text, &["case", "method", "settings", "measured", "bound", "verdict"], rows);
    }
    Ok(())
}

fn table(text: &mut String, head: &[&str], rows: Vec<Vec<String>>) {
    let _ = writeln!(text, "| {} |", head.join(" | "));
    let _ = writeln!(text, "|{}", "---|".repeat(head.len()));
    for row in rows {
        let _ = writeln!(text, "| {} |", row.join(" | "));
    }
    text.push('\n');
}

fn spread(spread: &Spread, show: fn(f64) -> String) -> String {
    let [median, min, max] = [spread.median, spread.min, spread.max].map(show);
    if min == max { median } else { format!("{median} ({min} to {max})") }
}

fn percent(value: f64) -> String {
    format!("{:+.1} %", 100.0 * value)
}

/// Three digits that count.
fn number(value: f64) -> String {
    match value.abs() {
        size if size > 0.0 && !(1e-4..1e7).contains(&size) => format!("{value:.2e}"),
        _ => significant(value),
    }
}

fn word(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Text as code, where Markdown can hold it so.
fn code(text: &str) -> String {
    match text.contains(['`', '|']) || printable(text) != text {
        true => markdown(text),
        false => format!("`{text}`"),
    }
}

/// A name as part of an address.
fn encode(name: &str) -> String {
    name.bytes().fold(String::new(), |mut text, byte| {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' => text.push(byte.into()),
            _ => {
                let _ = write!(text, "%{byte:02X}");
            }
        }
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_text() {
        assert_eq!(encode("my (page)_1"), "my%20%28page%29_1");
        assert_eq!((code("a_b=1"), code("a|b")), ("`a_b=1`".into(), "a\\|b".into()));
    }

    #[test]
    fn numbers_have_three_digits() {
        for (value, text) in [(0.0, "0"), (12.345, "12.3"), (1e-7, "1.00e-7"), (1.26e9, "1.26e9")] {
            assert_eq!(number(value), text);
        }
        assert_eq!(percent(-0.0213), "-2.1 %");
        let around = Spread { median: 2.0, min: 1.0, max: 3.0 };
        assert_eq!(spread(&around, number), "2.00 (1.00 to 3.00)");
        assert_eq!(spread(&Spread { min: 2.0, max: 2.0, ..around }, number), "2.00");
    }
}
