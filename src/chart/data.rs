//! What a chart holds: `data.json` in whole, and all that its page shows.

use crate::metrics::SeedErrors;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the form below.
pub const SCHEMA: u32 = 1;

/// Measured points of one scene on one device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Version of the program that measured.
    pub version: String,
    /// File or name of the scene.
    pub scene: String,
    /// Fingerprint of its contents.
    pub fingerprint: String,
    /// Triangles, instances counted one by one.
    pub triangles: u64,
    /// Camera it is seen by.
    pub camera: String,
    /// Pixels, width and height.
    pub size: [u32; 2],
    /// Name of the device.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// What traces rays.
    pub backend: String,
    /// What errors are measured against.
    pub reference: Reference,
    /// The metrics, the one to be shown first first; all are better when lower.
    pub metrics: Vec<MetricInfo>,
    /// What was measured.
    pub points: Vec<Point>,
    /// Whether every setting was measured with every seed; false while the sweep runs, or where it was cut short.
    #[serde(default)]
    pub complete: bool,
    /// Settings that gave no picture.
    pub failures: Vec<Failure>,
    /// What to use here for so many milliseconds.
    pub answers: Vec<Answer>,
    /// Pictures of the page by key, each a `data:` URL; only in the page, not in `data.json`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub images: BTreeMap<String, String>,
}

/// What errors are measured against.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reference {
    /// How it was made, in words.
    pub about: String,
    /// Samples a pixel, where known.
    pub spp: Option<u32>,
    /// relMSE between its halves over 4: its own noise, subtracted from every mean squared error. Absent without halves.
    pub noise: Option<f64>,
    /// Standard error that it gives every bias, the same for all points. Absent without halves.
    #[serde(default)]
    pub bias_se: Option<f64>,
    /// Key of its picture.
    pub image: String,
}

/// A measure of error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MetricInfo {
    /// Key in [`Point::metrics`].
    pub key: String,
    /// What axes call it.
    pub label: String,
    /// One sentence.
    pub about: String,
    /// Whether values have a sign: axes then take the absolute value.
    pub signed: bool,
}

/// A setting and what it came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Unique in the chart.
    pub id: String,
    /// The method's word.
    pub method: String,
    /// The setting in few words.
    pub label: String,
    /// Keys of the configuration and their values: those that differ from the default, or among the chart's points of
    /// this method. Enough to render it again ([`super::grid::config`]).
    pub settings: BTreeMap<String, serde_json::Value>,
    /// Seeds it was rendered with.
    pub seeds: u32,
    /// Milliseconds on the device of one warm frame.
    pub ms: Spread,
    /// Passes in order of execution.
    pub passes: Vec<PassTime>,
    /// Rays of one frame.
    pub rays: u64,
    /// Most bytes allocated on the device.
    pub device_bytes: u64,
    /// Errors by metric, over seeds. The reference's own noise is subtracted from relMSE, its trimmed form and that of
    /// blocks, down to a tenth of what was measured, and from the squared error behind `rmse`.
    pub metrics: BTreeMap<String, Spread>,
    /// How its error is stated over seeds, the reference's own noise subtracted. The systematic part is absent where the
    /// pictures of earlier seeds are not there.
    #[serde(default)]
    pub over_seeds: Option<SeedErrors>,
    /// Whether its error stands clear of the reference's own noise.
    pub ranked: bool,
    /// Milliseconds by a pipeline that is not specialised to the scene, where measured: median over seeds.
    pub general_ms: Option<f64>,
    /// Key of its picture.
    pub image: String,
    /// Key of the picture of its error.
    pub error_image: String,
    /// File of its linear picture beside the page, of points on the front.
    pub exr: Option<String>,
}

/// Median and range of some measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Median.
    pub median: f64,
    /// Least.
    pub min: f64,
    /// Most.
    pub max: f64,
}

/// A pass and its time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PassTime {
    /// Path in the graph.
    pub path: String,
    /// Milliseconds on the device.
    pub ms: f64,
}

/// A setting that gave no picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// The setting in few words.
    pub label: String,
    /// Why.
    pub error: String,
}

/// What to use for a time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Milliseconds there are.
    pub ms: f64,
    /// The point's id, where one is fast enough.
    pub point: Option<String>,
    /// The same as a sentence.
    pub sentence: String,
}
