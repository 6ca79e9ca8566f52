//! The named ways to render, and which measurements are theirs.

use crate::chart::grid::leaves;
use crate::chart::reference;
use crate::config::{ConfigError, PRESETS, Preset, RenderConfig, TRIAL_PRESET};
use crate::methods::{self, Method, REGISTRY};
use crate::stress::data::Row;
use serde_json::Value;
use std::collections::BTreeMap;

/// A method of the registry with its default settings, or under a preset.
pub(super) struct Way {
    pub(super) method: &'static Method,
    pub(super) preset: Option<&'static Preset>,
    pub(super) config: RenderConfig,
}

/// What a way came to under stress.
#[derive(Default)]
pub(super) struct Tried<'a> {
    /// Of every case the rows that are nearest to it: all they set it has too, and no others of the case set more of it.
    pub(super) rows: Vec<&'a Row>,
    /// Cases that tried the method with other settings alone.
    pub(super) otherwise: Vec<&'a str>,
}

impl Way {
    /// All there are, presets behind their method.
    pub(super) fn all() -> Vec<Self> {
        let mut ways = Vec::new();
        for &method in REGISTRY {
            let plain = RenderConfig { method, ..RenderConfig::default() };
            ways.push(Self { method, preset: None, config: plain });
            for preset in PRESETS {
                let mut config = RenderConfig::default();
                config.apply_preset(preset.name).expect("a preset sets keys that there are");
                if config.method == method {
                    ways.push(Self { method, preset: Some(preset), config });
                }
            }
        }
        ways
    }

    /// The word that asks for it; unique.
    pub(super) fn name(&self) -> &'static str {
        self.preset.map_or(self.method.name, |preset| preset.name)
    }

    /// Keys that are not at their defaults, with their values.
    pub(super) fn settings(&self) -> Vec<(String, Value)> {
        let default = leaves(&RenderConfig::default());
        let own = leaves(&self.config);
        own.into_iter().filter(|(key, value)| key != "method" && default.get(key) != Some(value)).collect()
    }

    /// Whether `config`, a chart's, is this way: charts choose where paths begin and how long they are.
    pub(super) fn is(&self, config: &RenderConfig) -> bool {
        let [own, charted] = [&self.config, config].map(|config| {
            let mut config = config.clone();
            methods::comparable(&mut config, Some(reference::DEPTH));
            config
        });
        own == charted
    }

    /// What was tried of it.
    pub(super) fn tried<'a>(&self, rows: &'a [Row]) -> Result<Tried<'a>, ConfigError> {
        let own = values(&self.config);
        let mut cases: Vec<(&str, Vec<(usize, &Row)>)> = Vec::new();
        for row in rows.iter().filter(|row| row.method == self.method.name) {
            let mut config = RenderConfig::default();
            config.apply_trial(&[], row.setting.split_whitespace())?;
            let others = values(&config);
            let mut keys: Vec<_> = row.setting.split_whitespace().collect();
            let preset = keys.first().and_then(|first| first.strip_prefix(TRIAL_PRESET));
            keys.drain(..usize::from(preset.is_some()));
            keys.iter_mut().for_each(|key| *key = key.split_once('=').map_or(*key, |(key, _)| key));
            if cases.iter().all(|(scene, _)| *scene != row.scene) {
                cases.push((&row.scene, Vec::new()));
            }
            if preset == self.preset.map(|preset| preset.name)
                && keys.iter().all(|key| own.get(*key) == others.get(*key))
                && let Some((_, agreeing)) = cases.iter_mut().find(|(scene, _)| *scene == row.scene)
            {
                agreeing.push((keys.len(), row));
            }
        }
        let mut tried = Tried::default();
        for (scene, agreeing) in cases {
            match agreeing.iter().map(|(count, _)| *count).max() {
                Some(most) => tried.rows.extend(agreeing.iter().filter(|row| row.0 == most).map(|row| row.1)),
                None => tried.otherwise.push(scene),
            }
        }
        Ok(tried)
    }
}

/// Every key that a stress case may set.
fn values(config: &RenderConfig) -> BTreeMap<String, Value> {
    let mut values = leaves(config);
    values.insert("seed".into(), config.seed.into());
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stress::data::Verdict;
    use std::collections::BTreeSet;

    fn row(scene: &str, method: &str, setting: &str) -> Row {
        Row {
            scene: scene.into(),
            mechanism: String::new(),
            method: method.into(),
            setting: setting.into(),
            number: String::new(),
            value: None,
            bound: String::new(),
            verdict: Verdict::Holds,
            known: None,
            images: Vec::new(),
        }
    }

    #[test]
    fn a_row_is_of_the_ways_that_have_all_it_sets_if_no_other_sets_more() {
        let rows = [
            row("crease", "igi", ""),
            row("bumpy", "igi", ""),
            row("bumpy", "igi", "indirect.interleave=2"),
            row("bumpy", "igi", "indirect.interleave=3 indirect.filter=combined"),
            row("bumpy", "igi", "preset=fast"),
            row("bumpy", "path", ""),
            row("wires", "path", "path_trace.spp=128"),
            row("halton", "igi", "seed=1"),
            row("halton", "igi", "seed=0"),
            row("halton", "igi", "preset=fast seed=0"),
            row("halton", "igi", "preset=fast seed=1"),
            row("thin", "igi", "indirect.downsample=4"),
            row("thin", "igi", "preset=paper-downsampled"),
        ];
        let ways = Way::all();
        let settings = |name: &str| {
            let way = ways.iter().find(|way| way.name() == name).unwrap();
            let tried = way.tried(&rows).unwrap();
            let said = tried.rows.iter().map(|row| format!("{}: {}", row.scene, row.setting));
            said.chain(tried.otherwise.iter().map(|scene| format!("not {scene}"))).collect::<Vec<_>>()
        };
        let filtered = "bumpy: indirect.interleave=3 indirect.filter=combined";
        assert_eq!(settings("igi"), ["crease: ", filtered, "halton: seed=0", "not thin"]);
        let down = "thin: preset=paper-downsampled";
        assert_eq!(settings("paper-downsampled"), [down, "not crease", "not bumpy", "not halton"]);
        let fast = ["bumpy: preset=fast", "halton: preset=fast seed=0", "not crease", "not thin"];
        assert_eq!(settings("fast"), fast);
        assert_eq!(settings("path"), ["bumpy: ", "not wires"]);
        assert!(ways[0].tried(&[row("crease", "igi", "indirect.nothing=1")]).is_err());
    }

    #[test]
    fn every_way_is_itself_and_no_other() {
        let ways = Way::all();
        let names: BTreeSet<_> = ways.iter().map(Way::name).collect();
        assert_eq!(names.len(), REGISTRY.len() + PRESETS.len());
        for (a, way) in ways.iter().enumerate() {
            let mut config = way.config.clone();
            config.path_trace.max_depth = Some(64);
            let found: Vec<_> = (0..ways.len()).filter(|&b| ways[b].is(&config)).collect();
            assert_eq!(found, [a], "{}", way.name());
        }
    }
}
