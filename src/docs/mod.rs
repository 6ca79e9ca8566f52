//! What each method is, costs, leaves wrong and fails at, as one Markdown page, from charts and the stress suite as they
//! were measured. The page holds nothing else: what was not measured it leaves out, and says so.

mod markdown;
mod ways;

pub use markdown::Page;

use crate::ErrorClass;
use crate::chart::data::Chart;
use crate::chart::{data, grid, picture};
use crate::config::RenderConfig;
use crate::read;
use crate::stress::data::{self as stress, Stress};
use image::imageops::{self, FilterType};
use serde::de::DeserializeOwned;
use std::io;
use std::path::{Path, PathBuf};

/// Widest a picture of the page is (pixels); larger ones are shrunk.
pub const WIDEST: u32 = 320;

/// Measurements that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file that cannot be read.
    #[error("{}: {source}; make it with `parhelion {command} -o {}`", file.display(), folder.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The folder it is missing from.
        folder: PathBuf,
        /// What makes such folders.
        command: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// A file that holds something else.
    #[error("{}: {problem}", file.display())]
    Unfit {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

impl Error {
    /// What kind of failure this is: bad input.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        ErrorClass::Input
    }
}

/// Charts and the stress suite.
#[derive(Clone, Debug)]
pub struct Measurements {
    charts: Vec<(PathBuf, Chart)>,
    /// Of each chart's points.
    configs: Vec<Vec<RenderConfig>>,
    stress: Option<(PathBuf, Stress)>,
}

impl Measurements {
    /// Reads `data.json` of each of `charts`, folders of [`crate::chart::run`], and `stress.json` of the folder `stress`.
    ///
    /// # Errors
    /// A file is missing, or is not what it should be.
    pub fn read(charts: &[PathBuf], stress: Option<&Path>) -> Result<Self, Error> {
        let chart = |folder: &PathBuf| {
            json(folder, "data.json", "chart", data::SCHEMA).map(|(_, chart)| (folder.clone(), chart))
        };
        let charts: Vec<(PathBuf, Chart)> = charts.iter().map(chart).collect::<Result<_, _>>()?;
        let configs = |(folder, chart): &(PathBuf, Chart)| {
            let config = |point: &data::Point| {
                grid::config(&point.settings, &RenderConfig::default()).map_err(|error| Error::Unfit {
                    file: folder.join("data.json"),
                    problem: format!("point {}: {error}", point.id),
                })
            };
            chart.points.iter().map(config).collect::<Result<Vec<_>, _>>()
        };
        let configs = charts.iter().map(configs).collect::<Result<_, _>>()?;
        let stress =
            stress.map(|folder| json(folder, "stress.json", "stress", stress::SCHEMA)).transpose()?;
        Ok(Self { charts, configs, stress })
    }
}

/// Reads `name`, which `command` has left in `folder`, of the form that this program knows.
fn json<T: DeserializeOwned>(
    folder: &Path,
    name: &str,
    command: &'static str,
    schema: u32,
) -> Result<(PathBuf, T), Error> {
    let file = folder.join(name);
    let bytes = match read::regular(&file, read::RESULTS) {
        Ok(bytes) => bytes,
        Err(source) => return Err(Error::Read { file, folder: folder.into(), command, source }),
    };
    let unfit = |problem| Error::Unfit { file: file.clone(), problem };
    let foreign = |error: serde_json::Error| unfit(format!("not what `parhelion {command}` writes: {error}"));
    let value: serde_json::Value = serde_json::from_slice(&bytes).map_err(foreign)?;
    let found = value.get("schema").and_then(serde_json::Value::as_u64);
    if let Some(found) = found.filter(|found| *found != u64::from(schema)) {
        return Err(unfit(format!(
            "of form {found}, but this program reads form {schema}; make it anew with `parhelion {command}`"
        )));
    }
    let read = serde_json::from_value(value).map_err(foreign)?;
    Ok((file, read))
}

/// A chart's picture, at most [`WIDEST`] pixels wide.
fn small(folder: &Path, key: &str, [width, height]: [u32; 2]) -> Result<Vec<u8>, Error> {
    let file = folder.join(key);
    let bytes = match read::regular(&file, read::RESULTS) {
        Ok(bytes) => bytes,
        Err(source) => return Err(Error::Read { file, folder: folder.into(), command: "chart", source }),
    };
    let unfit = |problem: String| Error::Unfit { file: file.clone(), problem };
    let image =
        image::load_from_memory(&bytes).map_err(|error| unfit(format!("no picture: {error}")))?.to_rgb8();
    if image.dimensions() != (width, height) {
        let (w, h) = image.dimensions();
        return Err(unfit(format!("{w}x{h} pixels, the chart's pictures have {width}x{height}")));
    }
    if width <= WIDEST {
        return Ok(bytes);
    }
    let rows = (f64::from(height) * f64::from(WIDEST) / f64::from(width)).round().max(1.0) as u32;
    let shrunk = imageops::resize(&image, WIDEST, rows, FilterType::Triangle);
    picture::jpeg(shrunk.as_raw(), WIDEST).map_err(|error| unfit(error.to_string()))
}
