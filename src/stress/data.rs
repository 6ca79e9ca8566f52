//! What a run of the stress scenes found: all that its page shows.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the form below.
pub const SCHEMA: u32 = 2;

/// Every method on every stress scene, on one device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stress {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Version of the program that ran.
    pub version: String,
    /// Name of the device.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// What traces rays.
    pub backend: String,
    /// Pixels of its pictures, width and height.
    pub size: [u32; 2],
    /// Those of one scene one after another.
    pub rows: Vec<Row>,
    /// Pictures by key, each a `data:` URL; only in the page.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub images: BTreeMap<String, String>,
}

/// A method, or a setting of one, on a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Name of the scene.
    pub scene: String,
    /// What makes methods fail there, in a sentence.
    pub mechanism: String,
    /// The method's word.
    pub method: String,
    /// The setting in few words; empty for the defaults.
    pub setting: String,
    /// What is measured.
    pub number: String,
    /// It; absent where there is no picture to measure.
    pub value: Option<f64>,
    /// What it must meet, in words.
    pub bound: String,
    /// Whether it does.
    pub verdict: Verdict,
    /// Why it is known not to, where it is.
    pub known: Option<String>,
    /// Pictures, the method's own first.
    pub images: Vec<Shown>,
}

/// A picture and what it is of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shown {
    /// Such as "picture", "reference", "error", "frame 2".
    pub label: String,
    /// Key in [`Stress::images`].
    pub key: String,
}

/// Whether a bound is met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// It is. A surprise where [`Row::known`] says otherwise.
    Holds,
    /// It is not, as known.
    FailsAsKnown,
    /// It is not, and should be.
    Fails,
}

impl Row {
    /// The verdict in words.
    #[must_use]
    pub fn said(&self) -> &'static str {
        match self.verdict {
            Verdict::Holds if self.known.is_some() => "holds, though known to fail",
            Verdict::Holds => "holds",
            Verdict::FailsAsKnown => "fails as known",
            Verdict::Fails => "FAILS",
        }
    }
}
