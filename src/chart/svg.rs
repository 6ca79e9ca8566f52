//! A chart as one still picture: error against time, both logarithmic, as its page draws them.

use super::answer::{error_of, front_of, significant};
use super::data::{Chart, Point, Spread};
use crate::text::printable;
use std::fmt::Write;

const SIZE: [f64; 2] = [800.0, 540.0];
const LEFT: f64 = 66.0;
const RIGHT: f64 = 784.0;
const TOP: f64 = 82.0;
const BOTTOM: f64 = 488.0;

/// Colours and shapes of methods, the page's own on white.
const COLOURS: [&str; 7] = ["#0072b2", "#c74f00", "#00795a", "#a3407a", "#6f6200", "#5a55cf", "#4d4d4d"];
const SHAPES: [&str; 6] = [
    "M0-5a5 5 0 1 0 .001 0z",
    "M-4.5-4.5h9v9h-9z",
    "M0-5.8L5.6 4.4H-5.6z",
    "M0-6.2L6.2 0L0 6.2L-6.2 0z",
    "M0 5.8L5.6-4.4H-5.6z",
    "M-2-6h4v4h4v4h-4v4h-4v-4h-4v-4h4z",
];

/// Width of a letter, with room to spare, and height of a line (pixels).
const LETTER: [f64; 2] = [6.7, 14.0];

const METRIC: &str = "rel_mse";

const FLOOR: &str = "10 × the reference’s own noise: what is below is not ranked";

/// Where a label stands beside its mark: pixels to the right, pixels down, and which end of it is there.
type Place = (f64, f64, &'static str);

/// Where labels may stand, best first.
const PLACES: [Place; 9] = [
    (9.0, 4.0, "start"),
    (0.0, -10.0, "middle"),
    (8.0, -8.0, "start"),
    (-9.0, 4.0, "end"),
    (-8.0, -8.0, "end"),
    (0.0, 18.0, "middle"),
    (8.0, 16.0, "start"),
    (-8.0, 16.0, "end"),
    (12.0, -26.0, "start"),
];

/// Those of the front, below which nothing is.
const FRONT_PLACES: [Place; 13] = [
    (-8.0, 16.0, "end"),
    (0.0, 18.0, "middle"),
    (-9.0, 4.0, "end"),
    (8.0, 20.0, "start"),
    (-10.0, 36.0, "end"),
    (10.0, 36.0, "start"),
    (10.0, 54.0, "start"),
    (10.0, 72.0, "start"),
    (10.0, 90.0, "start"),
    (-10.0, 54.0, "end"),
    (9.0, 4.0, "start"),
    (8.0, -8.0, "start"),
    (0.0, -10.0, "middle"),
];

/// relMSE against milliseconds as SVG, 800 pixels wide on a background of its own: a mark for each point that has both,
/// its colour and shape the method's, hollow where the reference cannot rank it; the front as steps; a label wherever one
/// fits, those of the front first. The same chart gives the same bytes.
#[must_use]
pub fn svg(chart: &Chart) -> String {
    let plot = Plot::of(chart);
    let [width, height] = SIZE;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         role=\"img\" font-family=\"system-ui, -apple-system, 'Segoe UI', 'Noto Sans', sans-serif\" font-size=\"12\" \
         fill=\"#5d5d58\">\n<title>{}</title>\n<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n",
        escape(&plot.title())
    );
    plot.head(&mut out);
    axes(&mut out, &plot.x, &plot.y);
    if let Some([left, y, ..]) = plot.floor() {
        let _ = writeln!(
            out,
            "<path d=\"M{LEFT} {y:.1}H{RIGHT}\" stroke=\"#85857f\" stroke-dasharray=\"2 4\"/>\n\
             <text x=\"{:.1}\" y=\"{:.1}\">{FLOOR}</text>",
            left + 6.0,
            y + 15.0
        );
    }
    let steps = plot.steps();
    if let Some([[first, _], _]) = steps.first() {
        let line = steps.iter().map(|[_, [x, y]]| format!("L{x:.1} {y:.1}")).collect::<String>();
        let _ = writeln!(
            out,
            "<path class=\"front\" d=\"M{first:.1} {TOP}{line}\" fill=\"none\" stroke=\"#1c1c1a\" stroke-width=\"1.5\" \
             stroke-opacity=\"0.7\"/>"
        );
    }
    for best in [false, true] {
        plot.points
            .iter()
            .filter(|point| plot.on_front(point) == best)
            .for_each(|point| plot.mark(&mut out, point));
    }
    plot.labels(&mut out, &steps);
    out.push_str("</svg>\n");
    out
}

/// What is drawn, and where.
struct Plot<'a> {
    chart: &'a Chart,
    points: Vec<&'a Point>,
    /// Fastest first.
    front: Vec<&'a Point>,
    methods: Vec<&'a str>,
    x: Axis,
    y: Axis,
}

impl<'a> Plot<'a> {
    fn of(chart: &'a Chart) -> Self {
        let positive = |spread: &Spread| spread.median > 0.0;
        let drawn = |point: &&Point| positive(&point.ms) && point.metrics.get(METRIC).is_some_and(positive);
        let points: Vec<&Point> = chart.points.iter().filter(drawn).collect();
        let ends = |spread: Spread| [spread.median, spread.min, spread.max];
        let times: Vec<f64> = points.iter().flat_map(|point| ends(point.ms)).collect();
        let errors: Vec<f64> = points.iter().flat_map(|point| ends(point.metrics[METRIC])).collect();
        let mut methods: Vec<&str> = Vec::new();
        for point in &points {
            if !methods.contains(&point.method.as_str()) {
                methods.push(&point.method);
            }
        }
        let front = front_of(&chart.points, METRIC).into_iter().map(|index| &chart.points[index]);
        Self {
            chart,
            front: front.filter(drawn).collect(),
            methods,
            x: Axis::new(&times, [1.0, 100.0], [LEFT, RIGHT]),
            y: Axis::new(&errors, [0.01, 1.0], [BOTTOM, TOP]),
            points,
        }
    }

    fn title(&self) -> String {
        format!("{}: error against time", self.chart.scene)
    }

    fn at(&self, point: &Point) -> [f64; 2] {
        [self.x.at(point.ms.median), self.y.at(point.metrics[METRIC].median)]
    }

    fn on_front(&self, point: &Point) -> bool {
        self.front.iter().any(|other| other.id == point.id)
    }

    /// Colour and shape.
    fn style(&self, method: &str) -> [&'static str; 2] {
        let index = self.methods.iter().position(|other| *other == method).unwrap_or(0);
        [COLOURS[index % COLOURS.len()], SHAPES[index % SHAPES.len()]]
    }

    fn head(&self, out: &mut String) {
        let Chart { size: [width, height], device, backend, points, .. } = self.chart;
        let seeds = points.iter().map(|point| point.seeds).max().unwrap_or(0);
        let s = if seeds == 1 { "" } else { "s" };
        let about = format!("{width}×{height}, {device}, {backend} backend, {seeds} seed{s}");
        let _ = writeln!(
            out,
            "<text x=\"16\" y=\"24\" font-size=\"16\" font-weight=\"600\" fill=\"#1c1c1a\">{}</text>\n\
             <text x=\"16\" y=\"43\">{}</text>",
            escape(&short(&self.title(), 64)),
            escape(&short(&about, 110))
        );
        let mut x = RIGHT;
        for method in self.methods.iter().rev() {
            let ([colour, shape], word) = (self.style(method), short(method, 24));
            let sign = x - LETTER[0] * word.chars().count() as f64 - 10.0;
            let _ = writeln!(
                out,
                "<text x=\"{x:.1}\" y=\"67\" text-anchor=\"end\" fill=\"#1c1c1a\">{}</text>\n\
                 <path d=\"{shape}\" transform=\"translate({sign:.1} 63)\" fill=\"{colour}\"/>",
                escape(&word)
            );
            x = sign - 18.0;
        }
    }

    /// The bounds of the words under the line below which nothing is ranked, if it is on the axis: at the end where fewer
    /// marks are.
    fn floor(&self) -> Option<[f64; 4]> {
        let floor = self.chart.reference.noise.map(|noise| 10.0 * noise);
        let y = self.y.at(floor.filter(|floor| self.y.holds(*floor))?);
        let width = 6.0 + LETTER[0] * FLOOR.chars().count() as f64;
        let ends = [LEFT, RIGHT - width].map(|left| [left, y, left + width, y + 20.0]);
        let marks = |bounds: &[f64; 4]| {
            let near = |point: &&&Point| !apart(&around(self.at(point)), bounds);
            self.points.iter().filter(near).count()
        };
        ends.into_iter().min_by_key(marks)
    }

    /// What the front's line is made of: horizontal and vertical parts, the first from the top, the last to the right.
    fn steps(&self) -> Vec<[[f64; 2]; 2]> {
        let Some(first) = self.front.first() else { return Vec::new() };
        let mut corners = vec![[self.at(first)[0], TOP], self.at(first)];
        for point in &self.front[1..] {
            let [x, y] = self.at(point);
            let above = corners[corners.len() - 1][1];
            corners.extend([[x, above], [x, y]]);
        }
        corners.push([RIGHT, corners[corners.len() - 1][1]]);
        corners.windows(2).map(|pair| [pair[0], pair[1]]).collect()
    }

    fn mark(&self, out: &mut String, point: &Point) {
        let ([colour, shape], [x, y]) = (self.style(&point.method), self.at(point));
        let opacity = if self.on_front(point) || !point.ranked { 1.0 } else { 0.45 };
        let spread = point.metrics[METRIC];
        let across = [[self.x.at(point.ms.min), y], [self.x.at(point.ms.max), y]];
        let along = [[x, self.y.at(spread.min)], [x, self.y.at(spread.max)]];
        for [[x0, y0], [x1, y1]] in [across, along].into_iter().filter(|[from, to]| from != to) {
            let faint = 0.6 * opacity;
            let _ = writeln!(
                out,
                "<path d=\"M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}\" stroke=\"{colour}\" stroke-opacity=\"{faint:.2}\"/>"
            );
        }
        let (error, known) = error_of(point, self.chart.reference.noise).unwrap_or((spread.median, true));
        let about = if known { "" } else { "about " };
        let [ms, error] = [point.ms.median, error].map(significant);
        let _ = writeln!(
            out,
            "<path class=\"mark\" d=\"{shape}\" transform=\"translate({x:.1} {y:.1})\" fill=\"{}\" stroke=\"{colour}\" \
             stroke-width=\"1.6\" opacity=\"{opacity}\"><title>{}</title></path>",
            if point.ranked { colour } else { "#fff" },
            escape(&format!("{}: {ms} ms, relMSE {about}{error}", point.label))
        );
    }

    /// Writes each label at the first place beside its mark that is free; off the front's line if there is one.
    fn labels(&self, out: &mut String, steps: &[[[f64; 2]; 2]]) {
        let mut taken: Vec<[f64; 4]> = self.points.iter().map(|point| around(self.at(point))).collect();
        let line: Vec<[f64; 4]> = steps
            .iter()
            .map(|[[x0, y0], [x1, y1]]| [x0.min(*x1), y0.min(*y1), x0.max(*x1), y0.max(*y1)])
            .collect();
        taken.extend(self.floor());
        let mut order = self.points.clone();
        order.sort_by(|a, b| {
            self.on_front(b)
                .cmp(&self.on_front(a))
                .then(a.ms.median.total_cmp(&b.ms.median))
                .then(a.id.cmp(&b.id))
        });
        for point in order {
            let [x, y] = self.at(point);
            let own = point.label.strip_prefix(&format!("{} ", point.method)).unwrap_or(&point.label);
            let text = short(own, 36);
            let [width, height] = [LETTER[0] * text.chars().count() as f64, LETTER[1]];
            let bounds = |&(dx, dy, anchor): &Place| {
                let left = match anchor {
                    "start" => x + dx,
                    "end" => x + dx - width,
                    _ => x + dx - 0.5 * width,
                };
                [left, y + dy - 0.75 * height, left + width, y + dy + 0.25 * height]
            };
            let free = |place: &&Place| {
                let own @ [left, top, right, bottom] = bounds(place);
                let inside = left >= LEFT && right <= SIZE[0] && top >= TOP && bottom <= BOTTOM;
                inside && taken.iter().all(|other| apart(&own, other))
            };
            let clear = |place: &&Place| line.iter().all(|part| apart(&bounds(place), part));
            let places = if self.on_front(point) { &FRONT_PLACES[..] } else { &PLACES[..] };
            let found = places.iter().filter(free).find(clear).or_else(|| places.iter().find(free));
            let Some(place @ &(dx, dy, anchor)) = found else { continue };
            let own = bounds(place);
            taken.push(own);
            // A line leads to a label that is far.
            if dy.abs() > 20.0 {
                let (from, to) = if dy < 0.0 { (y - 6.0, own[3]) } else { (y + 6.0, own[1]) };
                let _ = writeln!(
                    out,
                    "<path d=\"M{x:.1} {from:.1}L{:.1} {to:.1}\" stroke=\"#85857f\" stroke-width=\"0.8\"/>",
                    x + dx
                );
            }
            let [x, y] = [x + dx, y + dy];
            let _ = writeln!(
                out,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"#1c1c1a\" stroke=\"#fff\" \
                 stroke-width=\"3\" stroke-linejoin=\"round\" paint-order=\"stroke\">{}</text>",
                escape(&text)
            );
        }
    }
}

fn axes(out: &mut String, x: &Axis, y: &Axis) {
    for (value, whole, text) in x.ticks() {
        let (at, line) = (x.at(value), if whole { "#d9d9d3" } else { "#f0f0ec" });
        let _ = writeln!(
            out,
            "<path d=\"M{at:.1} {TOP}V{BOTTOM}\" stroke=\"{line}\"/>\n\
             <text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{text}</text>",
            BOTTOM + 18.0
        );
    }
    for (value, whole, text) in y.ticks() {
        let (at, line) = (y.at(value), if whole { "#d9d9d3" } else { "#f0f0ec" });
        let _ = writeln!(
            out,
            "<path d=\"M{LEFT} {at:.1}H{RIGHT}\" stroke=\"{line}\"/>\n\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
            LEFT - 8.0,
            at + 4.0
        );
    }
    let _ = writeln!(
        out,
        "<text x=\"{RIGHT}\" y=\"{}\" text-anchor=\"end\">milliseconds a frame →</text>\n\
         <text x=\"16\" y=\"67\">↑ error (relMSE)</text>",
        BOTTOM + 42.0
    );
}

/// The bounds of a mark.
fn around([x, y]: [f64; 2]) -> [f64; 4] {
    [x - 7.0, y - 7.0, x + 7.0, y + 7.0]
}

/// Whether two bounds (left, top, right, bottom) have nothing in common.
fn apart(a: &[f64; 4], b: &[f64; 4]) -> bool {
    a[2] <= b[0] || b[2] <= a[0] || a[3] <= b[1] || b[3] <= a[1]
}

/// A logarithmic axis.
struct Axis {
    low: f64,
    high: f64,
    ends: [f64; 2],
}

impl Axis {
    /// Holds all positive values with some air, and a factor of 4 at least.
    fn new(values: &[f64], otherwise: [f64; 2], ends: [f64; 2]) -> Self {
        let positive = || values.iter().copied().filter(|value| *value > 0.0 && value.is_finite());
        let (low, high) = (positive().fold(f64::INFINITY, f64::min), positive().fold(0.0, f64::max));
        let [low, high] = if high > 0.0 {
            let air = (4.0 / (high / low)).sqrt().max(1.3);
            [low / air, high * air]
        } else {
            otherwise
        };
        Self { low, high, ends }
    }

    fn holds(&self, value: f64) -> bool {
        value > self.low && value < self.high
    }

    /// The pixel of a value; of one that is off the axis its nearer end.
    fn at(&self, value: f64) -> f64 {
        let share = (value.clamp(self.low, self.high) / self.low).ln() / (self.high / self.low).ln();
        self.ends[0] + share * (self.ends[1] - self.ends[0])
    }

    /// 1, 2 and 5 of each decade, whether it is the decade's own, and a text where there is room.
    fn ticks(&self) -> Vec<(f64, bool, String)> {
        let decade =
            (self.ends[1] - self.ends[0]).abs() * std::f64::consts::LN_10 / (self.high / self.low).ln();
        let powers = self.low.log10().floor() as i32..=self.high.log10().floor() as i32;
        let values = powers.flat_map(|power| [1.0, 2.0, 5.0].map(|digit| (digit, power)));
        let tick = |(digit, power): (f64, i32)| {
            let value: f64 = format!("{digit}e{power}").parse().ok().filter(|value| self.holds(*value))?;
            let whole = digit == 1.0;
            let text = match (whole || decade > 100.0, power) {
                (false, _) => String::new(),
                (true, -4..=5) => value.to_string(),
                (true, _) => format!("{digit}e{power}"),
            };
            Some((value, whole, text))
        };
        values.filter_map(tick).collect()
    }
}

/// At most so many characters.
fn short(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some(_) => text.chars().take(most - 1).chain(['…']).collect(),
        None => text.into(),
    }
}

/// Text as XML holds it; two characters that XML cannot hold become U+FFFD.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in printable(text).chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_runs_from_end_to_end_by_factors() {
        let axis = Axis::new(&[1.0, 100.0, 0.0, f64::NAN], [3.0, 4.0], [10.0, 110.0]);
        assert!((axis.at(10.0) - 60.0).abs() < 1e-9 && axis.at(1e-9) == 10.0 && axis.at(1e9) == 110.0);
        assert!(axis.at(1.0) > 10.0 && axis.at(100.0) < 110.0);
        let texts: Vec<_> = axis.ticks().into_iter().filter(|tick| tick.1).map(|tick| tick.2).collect();
        assert_eq!(texts, ["1", "10", "100"]);
        // One value alone stands in the middle, none leaves what was given.
        let axis = Axis::new(&[7.0], [3.0, 4.0], [0.0, 100.0]);
        assert!((axis.at(7.0) - 50.0).abs() < 1e-9 && (axis.high / axis.low - 4.0).abs() < 1e-9);
        assert_eq!(Axis::new(&[], [3.0, 4.0], [0.0, 100.0]).low, 3.0);
        let far = Axis::new(&[1e-7, 1e-6], [3.0, 4.0], [0.0, 100.0]).ticks();
        assert!(far.iter().any(|(.., text)| text == "1e-7"), "{far:?}");
    }

    #[test]
    fn text_is_cut_and_escaped() {
        assert_eq!(escape("a<b>&\"c\"\u{1}\n"), "a&lt;b&gt;&amp;&quot;c&quot;\\u{1}\\n");
        assert_eq!((short("abcd", 4), short("abcde", 4)), ("abcd".into(), "abc…".into()));
    }
}
