//! Which settings a chart compares: a grid by name, or from a file.
//!
//! A grid is TOML: tables `[[sweep]]` of keys as for [`RenderConfig::apply_override`], beside them `preset`, which comes
//! first. A key with a list takes each of its values, every list with every other. Settings that come up twice are
//! taken once. `general = true` before the tables times every setting by a pipeline that is not specialised to the scene,
//! too: what it costs to model everything for nothing.
//!
//! ```toml
//! general = true
//!
//! [[sweep]]
//! preset = "fast"
//! vpl_shoot.vpls = [90, 180]
//! vpl_shoot.bounces = [3, 8]
//!
//! [[sweep]]
//! method = "path"
//! path_trace.spp = [1, 4, 16]
//! ```

use crate::ErrorClass;
use crate::config::{ConfigError, RenderConfig};
use crate::methods::{REGISTRY, Sweeps};
use crate::read;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use toml::Table;

/// A grid that needs no file.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// Its word on the command line.
    pub name: &'static str,
    /// One line for help texts.
    pub about: &'static str,
    /// What stands before its tables.
    head: &'static str,
    /// A method's tables.
    tables: fn(&Sweeps) -> &'static str,
}

/// The grids there are; the tables are the methods' ([`Sweeps`]).
pub const GRIDS: &[Grid] = &[
    Grid {
        name: "small",
        about: "each method from coarse to fine, in minutes on a CPU",
        head: "",
        tables: |sweeps| sweeps.small,
    },
    Grid {
        name: "paper",
        about: "the paper's approaches and ours at its numbers of VPLs",
        head: "",
        tables: |sweeps| sweeps.paper,
    },
    Grid {
        name: "full",
        about: "everything there is, for a GPU, also by a pipeline that is not specialised to the scene",
        head: "general = true\n",
        tables: |sweeps| sweeps.full,
    },
];

impl Grid {
    /// Its text, as in a file.
    #[must_use]
    pub fn text(&self) -> String {
        let tables = REGISTRY.iter().map(|method| (self.tables)(&method.sweeps));
        std::iter::once(self.head).chain(tables).collect()
    }
}

/// One way to render what all of them render.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Unique in its grid; good for a file's name.
    pub id: String,
    /// In few words.
    pub label: String,
    /// All there is to it.
    pub config: RenderConfig,
    /// Keys and values that tell it from the default configuration, or apart from the others of its method.
    pub settings: BTreeMap<String, Value>,
    /// Whether a pipeline that is not specialised to the scene is timed, too.
    pub general: bool,
}

/// A grid that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{grid}: {problem}")]
pub struct GridError {
    /// Its name or file.
    pub grid: String,
    /// What is wrong.
    pub problem: String,
}

impl GridError {
    /// What kind of failure this is: bad input.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        ErrorClass::Input
    }
}

/// What every setting of a chart has in common, and no grid may change.
const COMMON: [&str; 4] = ["size", "seed", "crop", "tone_map"];

/// The settings of a grid, on top of `base`: one of [`GRIDS`], or a file.
///
/// # Errors
/// A file that cannot be read, is no grid, or holds a key or value that no configuration has.
pub fn settings(grid: &str, base: &RenderConfig) -> Result<Vec<Setting>, GridError> {
    let fail = |problem: String| GridError { grid: grid.into(), problem };
    match GRIDS.iter().find(|there| there.name == grid) {
        Some(grid) => parse(&grid.text(), base).map_err(fail),
        None if Path::new(grid).extension().is_none() => {
            let names: Vec<_> = GRIDS.iter().map(|grid| grid.name).collect();
            Err(fail(format!("no such grid; there are {}, and files (.toml)", names.join(", "))))
        }
        None => {
            let text =
                read::text(Path::new(grid), read::SETTINGS).map_err(|error| fail(error.to_string()))?;
            parse(&text, base).map_err(fail)
        }
    }
}

pub(crate) fn parse(text: &str, base: &RenderConfig) -> Result<Vec<Setting>, String> {
    let mut table: Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    let sweeps = table.remove("sweep");
    let general = match table.remove("general") {
        None => false,
        Some(toml::Value::Boolean(general)) => general,
        Some(value) => return Err(format!("general = {value}: expected true or false")),
    };
    if let Some(key) = table.keys().next() {
        return Err(format!("unknown key `{key}`; a grid has `general` and tables [[sweep]]"));
    }
    let Some(toml::Value::Array(sweeps)) = sweeps else { return Err("no table [[sweep]]".into()) };
    let mut found: Vec<Setting> = Vec::new();
    for (index, sweep) in sweeps.into_iter().enumerate() {
        let fail = |problem: &dyn std::fmt::Display| format!("[[sweep]] {}: {problem}", index + 1);
        let toml::Value::Table(sweep) = sweep else { return Err(fail(&"not a table")) };
        for words in combinations(sweep).map_err(|problem| fail(&problem))? {
            let (config, label) = setting(base, &words).map_err(|error| fail(&error))?;
            if found.iter().all(|other| other.config != config) {
                let settings = BTreeMap::new();
                found.push(Setting { id: String::new(), label, config, settings, general });
            }
        }
    }
    if found.is_empty() {
        return Err("no settings".into());
    }
    describe(&mut found);
    Ok(found)
}

/// Keys by their whole path with one value each, every list with every other.
fn combinations(sweep: Table) -> Result<Vec<Vec<(String, toml::Value)>>, String> {
    fn flatten(prefix: &str, table: Table, keys: &mut Vec<(String, toml::Value)>) {
        for (key, value) in table {
            let path = if prefix.is_empty() { key } else { format!("{prefix}.{key}") };
            match value {
                toml::Value::Table(inner) => flatten(&path, inner, keys),
                value => keys.push((path, value)),
            }
        }
    }
    let mut keys = Vec::new();
    flatten("", sweep, &mut keys);
    // What the others are said of comes first.
    keys.sort_by_key(|(key, _)| match key.as_str() {
        "method" => 0,
        "preset" => 1,
        _ => 2,
    });
    let mut all = vec![Vec::new()];
    for (key, value) in keys {
        if COMMON.contains(&key.split('.').next().unwrap_or_default()) {
            return Err(format!("{key}: the same for all settings of a chart, given on the command line"));
        }
        let values = match value {
            toml::Value::Array(values) => values,
            value => vec![value],
        };
        let with = |words: &Vec<(String, toml::Value)>| {
            let longer = |value: &toml::Value| {
                let mut words = words.clone();
                words.push((key.clone(), value.clone()));
                words
            };
            values.iter().map(longer).collect::<Vec<_>>()
        };
        all = all.iter().flat_map(with).collect();
    }
    Ok(all)
}

fn setting(
    base: &RenderConfig,
    words: &[(String, toml::Value)],
) -> Result<(RenderConfig, String), ConfigError> {
    let mut config = base.clone();
    let mut label = String::new();
    let word = |value: &toml::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    // A preset sets more than one key: the sweep's own win over it.
    if let Some((_, preset)) = words.iter().find(|(key, _)| key == "preset") {
        config.apply_preset(&word(preset))?;
    }
    for (key, value) in words.iter().filter(|(key, _)| key != "preset") {
        config.apply_override(&format!("{key}={value}"))?;
    }
    config.validate()?;
    if words.iter().all(|(key, _)| key != "method") {
        label.push_str(config.method.name);
    }
    for (key, value) in words {
        let name = key.rsplit('.').next().unwrap_or_default();
        let separator = if label.is_empty() { "" } else { " " };
        match key.as_str() {
            "method" | "preset" => label += &format!("{separator}{}", word(value)),
            _ => label += &format!("{separator}{name}={}", word(value)),
        }
    }
    Ok((config, label))
}

/// Gives each its id and the keys that matter.
fn describe(settings: &mut [Setting]) {
    let all: Vec<_> = settings.iter().map(|setting| leaves(&setting.config)).collect();
    let default = leaves(&RenderConfig::default());
    let mut ids = BTreeSet::new();
    for index in 0..settings.len() {
        let method = settings[index].config.method;
        let same: Vec<_> =
            (0..settings.len()).filter(|&other| settings[other].config.method == method).collect();
        let matters = |key: &String, value: &Value| {
            default.get(key) != Some(value) || same.iter().any(|&other| all[other].get(key) != Some(value))
        };
        let keys = all[index].iter().filter(|(key, value)| *key == "method" || matters(key, value));
        settings[index].settings = keys.map(|(key, value)| (key.clone(), value.clone())).collect();
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '.' { c } else { '-' };
        let stem: String = settings[index].label.chars().map(plain).collect();
        let mut id = stem.clone();
        for count in 2.. {
            if ids.insert(id.clone()) {
                break;
            }
            id = format!("{stem}-{count}");
        }
        settings[index].id = id;
    }
}

/// Every key that a grid may set, by its path.
pub(crate) fn leaves(config: &RenderConfig) -> BTreeMap<String, Value> {
    fn walk(prefix: &str, value: &Value, leaves: &mut BTreeMap<String, Value>) {
        for (name, value) in value.as_object().into_iter().flatten() {
            let path = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
            match value {
                Value::Object(_) => walk(&path, value, leaves),
                // Numbers as short as they were written: 0.05, not the nearest 32-bit float in full.
                Value::Number(number) if number.is_f64() => {
                    let short = number.as_f64().map(|value| (value as f32).to_string());
                    leaves.insert(path, short.and_then(|n| n.parse::<f64>().ok()).into());
                }
                value => drop(leaves.insert(path, value.clone())),
            }
        }
    }
    let mut config = serde_json::to_value(config).unwrap_or_default();
    if let Some(keys) = config.as_object_mut() {
        COMMON.iter().for_each(|key| drop(keys.shift_remove(*key)));
    }
    let mut found = BTreeMap::new();
    walk("", &config, &mut found);
    found
}

/// The configuration that [`Setting::settings`] stand for, on top of `base`.
///
/// # Errors
/// A key or value that no configuration has.
pub fn config(settings: &BTreeMap<String, Value>, base: &RenderConfig) -> Result<RenderConfig, ConfigError> {
    let default = RenderConfig::default();
    let mut config = RenderConfig {
        size: base.size,
        seed: base.seed,
        crop: base.crop,
        tone_map: base.tone_map.clone(),
        ..default
    };
    for (key, value) in settings {
        let value = if value.is_null() { "auto".into() } else { value.to_string() };
        config.apply_override(&format!("{key}={value}"))?;
    }
    config.validate()?;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn labels(text: &str) -> Vec<String> {
        parse(text, &RenderConfig::default()).unwrap().into_iter().map(|setting| setting.label).collect()
    }

    #[test]
    fn lists_are_multiplied_and_what_comes_twice_is_there_once() {
        let found = labels(
            "[[sweep]]
             preset = ['fast', 'paper-canonical']
             vpl_shoot = { vpls = [90, 180] }
             [[sweep]]
             vpl_shoot = { vpls = 180, bounces = 3, lobes = false, guided = false, candidates = 1 }
             whitted.light_samples = 16
             light_choice = 'power'
             indirect = { glossy = false, compensation = 0, interleave = 1, filter = 'paper' }
             shadow_terminator = false
             panes = false
             [[sweep]]
             method = 'path'
             path_trace.spp = [1, 4]",
        );
        let expected = ["igi fast vpls=90", "igi fast vpls=180", "igi paper-canonical vpls=90"];
        assert_eq!(found[..3], expected);
        assert_eq!(found[3..], ["igi paper-canonical vpls=180", "path spp=1", "path spp=4"]);
    }

    #[test]
    fn settings_lead_back_to_the_configuration() {
        let base = RenderConfig { size: [32, 24], seed: 7, ..RenderConfig::default() };
        for grid in GRIDS {
            let found = settings(grid.name, &base).unwrap();
            let ids: BTreeSet<_> = found.iter().map(|setting| &setting.id).collect();
            assert_eq!(ids.len(), found.len());
            for setting in &found {
                assert_eq!(config(&setting.settings, &base).unwrap(), setting.config, "{}", setting.label);
                // By way of a file, too.
                let text = serde_json::to_string(&setting.settings).unwrap();
                let read = serde_json::from_str(&text).unwrap();
                assert_eq!(config(&read, &base).unwrap(), setting.config, "{text}");
            }
        }
        let counts = GRIDS.iter().map(|grid| settings(grid.name, &base).unwrap().len());
        assert!(counts.zip([12..=16, 15..=15, 60..=100]).all(|(count, expected)| expected.contains(&count)));
    }

    #[test]
    fn the_general_pipeline_is_timed_where_the_grid_says_so() {
        let base = RenderConfig::default();
        for grid in GRIDS {
            let general = settings(grid.name, &base).unwrap().iter().all(|setting| setting.general);
            assert_eq!(general, grid.name == "full", "{}", grid.name);
        }
        let asked = |text: &str| parse(text, &base).unwrap()[0].general;
        assert!(asked("general = true\n[[sweep]]") && !asked("general = false\n[[sweep]]"));
    }

    #[test]
    fn settings_are_the_keys_that_matter() {
        let text =
            "[[sweep]]\nvpl_shoot.vpls = [90, 180]\nindirect.min_distance = 0.05\n[[sweep]]\nmethod = 'path'";
        let found = parse(text, &RenderConfig::default()).unwrap();
        let settings = json!(found[1].settings);
        let expected = json!({ "indirect.min_distance": 0.05, "method": "igi", "vpl_shoot.vpls": 180 });
        assert_eq!(settings, expected);
        assert_eq!(json!(found[2].settings), json!({ "method": "path" }));
        assert_eq!(found[1].id, "igi-min-distance-0.05-vpls-180");
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        for (text, words) in [
            ("", &["[[sweep]]"][..]),
            ("sweep = []", &["no settings"]),
            ("sweep = 3", &["[[sweep]]"]),
            ("[[sweep]]\nvpl_shoot.vpls = []", &["no settings"]),
            ("[[sweep]]\n[[sweep]]\nvpls = 3", &["[[sweep]] 2", "`vpls`", "vpl_shoot.vpls"]),
            ("[[sweep]]\nvpl_shoot.vpls = [1, 0]", &["[[sweep]] 1", "vpl_shoot.vpls", "0"]),
            ("[[sweep]]\nsize = [1, 2]", &["size", "command line"]),
            ("[[sweep]]\ntone_map.exposure = 1", &["tone_map.exposure", "command line"]),
            ("[[sweep]]\npreset = 'slow'", &["slow", "paper-canonical"]),
            ("grid = 1\n[[sweep]]", &["`grid`", "[[sweep]]"]),
            ("general = 1\n[[sweep]]", &["general = 1", "true or false"]),
            ("[[sweep]", &["1"]),
        ] {
            let problem = parse(text, &RenderConfig::default()).unwrap_err();
            assert!(words.iter().all(|word| problem.contains(word)), "{text}: {problem}");
        }
        let base = RenderConfig::default();
        for (grid, word) in [("large", "small, paper, full"), ("/nonexistent/g.toml", "g.toml")] {
            assert!(settings(grid, &base).unwrap_err().to_string().contains(word));
        }
    }
}
