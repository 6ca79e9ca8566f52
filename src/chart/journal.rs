//! What a sweep has finished, a line each as it happens, so that one that was cut short goes on.

use super::data::PassTime;
use crate::config::RenderConfig;
use crate::output;
use crate::read;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// What measurements must agree in to stand in one chart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Header {
    pub(super) parhelion: String,
    pub(super) scene: String,
    pub(super) size: [u32; 2],
    pub(super) device: String,
    pub(super) driver: String,
    pub(super) backend: String,
    pub(super) reference: String,
}

/// One setting with one seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Entry {
    /// Seed included.
    pub(super) config: RenderConfig,
    pub(super) ms: f64,
    /// By a pipeline that is not specialised to the scene, where that was asked for.
    #[serde(default)]
    pub(super) general_ms: Option<f64>,
    pub(super) passes: Vec<PassTime>,
    pub(super) rays: u64,
    pub(super) device_bytes: u64,
    /// Mean squared error and peak aside, what was measured: noise not yet subtracted.
    pub(super) metrics: BTreeMap<String, f64>,
    /// Where the pictures of all seeds before it were there.
    #[serde(default)]
    pub(super) mean: Option<Mean>,
}

/// Error of the mean picture over all seeds from one on, to that of the entry.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Mean {
    /// The first seed.
    pub(super) from: u32,
    pub(super) rel_mse: f64,
}

pub(super) struct Journal {
    path: PathBuf,
    file: File,
    pub(super) entries: Vec<Entry>,
}

impl Journal {
    /// Opens the journal of a folder, or begins one.
    ///
    /// The outer error is the system's; the inner one says what there is that does not belong with `header`.
    pub(super) fn open(path: &Path, header: &Header) -> Result<Result<Self, String>, output::Error> {
        let fail = |source| output::Error { file: path.into(), source };
        let text = match read::text(path, read::RESULTS) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(fail(error)),
        };
        let mut lines = text.lines();
        let mut entries = Vec::new();
        let there = lines.next().map(serde_json::from_str::<Header>);
        match there {
            // A first line that is not whole was cut off as it was written.
            None => {}
            Some(Err(_)) if text.lines().count() == 1 && !text.ends_with('\n') => {}
            Some(Err(_)) => return Ok(Err("not a journal of a chart".into())),
            Some(Ok(there)) => {
                if let Some((what, there, here)) = there.difference(header) {
                    return Ok(Err(format!("its {what} is {there}, not {here}")));
                }
                // So may the last one.
                entries.extend(lines.filter_map(|line| serde_json::from_str::<Entry>(line).ok()));
            }
        }
        // Written anew, whole: what is appended begins on a line of its own.
        output::write_file(path, |out| {
            writeln!(out, "{}", serde_json::to_string(header)?)?;
            entries.iter().try_for_each(|entry| writeln!(out, "{}", serde_json::to_string(entry)?))
        })?;
        let file = File::options().append(true).open(path).map_err(fail)?;
        Ok(Ok(Self { path: path.into(), file, entries }))
    }

    /// The measurement with `config`; where `general` is asked for, one that holds it.
    pub(super) fn find(&self, config: &RenderConfig, general: bool) -> Option<&Entry> {
        let fits = |entry: &&Entry| entry.config == *config && (!general || entry.general_ms.is_some());
        self.entries.iter().find(fits)
    }

    pub(super) fn add(&mut self, entry: Entry) -> Result<(), output::Error> {
        let mut write = || {
            let line = serde_json::to_string(&entry)?;
            self.file.write_all(format!("{line}\n").as_bytes())
        };
        write().map_err(|source| output::Error { file: self.path.clone(), source })?;
        self.entries.push(entry);
        Ok(())
    }
}

impl Header {
    fn difference(&self, other: &Self) -> Option<(&'static str, String, String)> {
        let [a, b] = [self, other].map(|header| {
            let [width, height] = header.size;
            [
                ("version", header.parhelion.clone()),
                ("scene or camera", header.scene.clone()),
                ("size", format!("{width}x{height}")),
                ("device", header.device.clone()),
                ("driver", header.driver.clone()),
                ("backend", header.backend.clone()),
                ("reference", header.reference.clone()),
            ]
        });
        let mut pairs = a.into_iter().zip(b);
        pairs.find(|(a, b)| a != b).map(|((what, there), (_, here))| (what, there, here))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn header() -> Header {
        let text = |text: &str| text.to_owned();
        Header {
            parhelion: text("1"),
            scene: text("s"),
            size: [4, 3],
            device: text("d"),
            driver: text("r"),
            backend: text("software"),
            reference: text("f"),
        }
    }

    fn entry(seed: u32) -> Entry {
        let mut config = RenderConfig { seed, ..RenderConfig::default() };
        config.indirect.min_distance = Some(0.1);
        let metrics = BTreeMap::from([("rel_mse".into(), 0.25)]);
        let mean = Some(Mean { from: 0, rel_mse: 0.125 });
        Entry {
            config,
            ms: 1.5,
            general_ms: None,
            passes: Vec::new(),
            rays: 3,
            device_bytes: 5,
            metrics,
            mean,
        }
    }

    #[test]
    fn entries_come_back_and_a_torn_line_is_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        let open = |header: &Header| Journal::open(&path, header).unwrap();
        let mut journal = open(&header()).ok().unwrap();
        journal.add(entry(0)).unwrap();
        journal.add(entry(1)).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, &text[..text.len() - 20]).unwrap();
        let mut journal = open(&header()).ok().unwrap();
        assert_eq!(journal.entries, [entry(0)]);
        journal.add(entry(2)).unwrap();
        assert_eq!(open(&header()).ok().unwrap().entries, [entry(0), entry(2)]);
        fs::write(&path, &text[..10]).unwrap();
        assert!(open(&header()).ok().unwrap().entries.is_empty());
    }

    #[test]
    fn an_entry_without_the_general_pipeline_does_for_those_who_do_not_ask() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        let mut journal = Journal::open(&path, &header()).unwrap().ok().unwrap();
        journal.add(entry(0)).unwrap();
        let config = entry(0).config;
        assert_eq!(journal.find(&config, false), Some(&entry(0)));
        assert_eq!(journal.find(&config, true), None);
        let general = Entry { general_ms: Some(2.0), ..entry(0) };
        journal.add(general.clone()).unwrap();
        let journal = Journal::open(&path, &header()).unwrap().ok().unwrap();
        assert_eq!(journal.find(&config, true), Some(&general));
        assert_eq!(journal.find(&entry(1).config, false), None);
    }

    #[test]
    fn what_was_measured_otherwise_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        Journal::open(&path, &header()).unwrap().ok().unwrap().add(entry(0)).unwrap();
        let before = fs::read(&path).unwrap();
        let other = || "x".to_owned();
        for (changed, word) in [
            (Header { scene: other(), ..header() }, "scene or camera is s, not x"),
            (Header { size: [4, 4], ..header() }, "size is 4x3, not 4x4"),
            (Header { device: other(), ..header() }, "device is d, not x"),
            (Header { driver: other(), ..header() }, "driver is r, not x"),
            (Header { backend: other(), ..header() }, "backend is software, not x"),
            (Header { reference: other(), ..header() }, "reference is f, not x"),
            (Header { parhelion: other(), ..header() }, "version is 1, not x"),
        ] {
            let problem = Journal::open(&path, &changed).unwrap().err().unwrap();
            assert!(problem.contains(word), "{problem}");
        }
        assert_eq!(fs::read(&path).unwrap(), before);
        fs::write(&path, "something else\n").unwrap();
        assert!(Journal::open(&path, &header()).unwrap().is_err());
    }
}
