//! Settings of a render: method, picture, seed, and one group for each technique.
//!
//! A file (TOML) and single assignments reach every field; a key that names none is an error with the
//! nearest one. An optional key takes the word `auto` for its absence.

use super::{Own, REGISTRY, registry};
use crate::ErrorClass;
use crate::read;
use crate::techniques::setting::{BadValue, Settings, within};
use crate::techniques::{
    glare::GlareConfig, indirect::IndirectConfig, path_trace::PathTraceConfig, tone_map::ToneMapConfig,
    vpl_shoot::VplShootConfig, whitted::WhittedConfig,
};
use serde::Deserialize;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

pub use super::method::{LightChoice, RenderConfig};
pub use crate::techniques::path_trace::MAX_SPP;

/// Width and height a picture may have, in pixels.
pub const SIZE_RANGE: RangeInclusive<u32> = 1..=16384;

impl Default for RenderConfig {
    fn default() -> Self {
        Self {
            method: REGISTRY[0],
            size: [800, 600],
            seed: 0,
            pixel_samples: 1,
            crop: None,
            energy_conserving: false,
            shadow_terminator: true,
            panes: true,
            light_choice: LightChoice::default(),
            vpl_shoot: VplShootConfig::default(),
            whitted: WhittedConfig::default(),
            indirect: IndirectConfig::default(),
            path_trace: PathTraceConfig::default(),
            glare: GlareConfig::default(),
            tone_map: ToneMapConfig::default(),
            own: Own::default(),
        }
    }
}

/// Settings under one name.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Its word on the command line.
    pub name: &'static str,
    /// One line for help texts.
    pub about: &'static str,
    /// What it assigns, as for [`RenderConfig::apply_override`], once all accelerations are off.
    pub settings: &'static [&'static str],
}

/// What every preset begins with: the paper's VPLs, every acceleration off, Lambertian surfaces and mirrors
/// alone, facets as they are, panes that block shadow rays and lights chosen by power.
const CANONICAL: [&str; 20] = [
    "vpl_shoot.vpls=180",
    "vpl_shoot.bounces=3",
    "vpl_shoot.lobes=false",
    "vpl_shoot.guided=false",
    "vpl_shoot.candidates=1",
    "pixel_samples=1",
    "shadow_terminator=false",
    "panes=false",
    "light_choice=power",
    "whitted.light_samples=16",
    "indirect.compensation=0",
    "indirect.visibility=exact",
    "indirect.box_split=auto",
    "indirect.downsample=1",
    "indirect.upsample=paper",
    "indirect.interleave=1",
    "indirect.pattern=regular",
    "indirect.filter=paper",
    "indirect.least_fit=0",
    "indirect.glossy=false",
];

/// Figures 5 to 7 of Marques & Santos 2010, each with all that the one before it has, and our own choice at the
/// paper's number of VPLs. They leave the size of the picture, its camera and `min_distance` alone.
///
/// `fast` gathers on one pixel in four, each with a ninth of the VPLs, and by itself where few of the samples around fit. What
/// that leaves of indirect light, as relMSE against every pixel and VPL of the same paths: 0.095 in `builtin:conference` at
/// 400×300 and 0.057 in a crop of its ceiling at 800×600 (0.196 and 0.168 with 4×4 windows, where only pixels that nothing
/// fits are gathered by themselves, for a ninth of the rays; 0.152 and 0.136 with 2×2 windows alone; 0.115 and 0.083 with 2×2
/// tiles of them; 0.070 and 0.074 with a sample at every pixel).
pub const PRESETS: &[Preset] = &[
    Preset { name: "paper-canonical", about: "180 VPLs, every pixel and every VPL", settings: &[] },
    Preset {
        name: "paper-imperfect",
        about: "paper-canonical with triangles' bounding boxes in place of triangles for VPLs",
        settings: &["indirect.visibility=boxes"],
    },
    Preset {
        name: "paper-downsampled",
        about: "paper-imperfect with 4x4 downsampling",
        settings: &["indirect.visibility=boxes", "indirect.downsample=4"],
    },
    Preset {
        name: "paper-interleaved",
        about: "paper-downsampled with 3x3 interleaved sampling",
        settings: &["indirect.visibility=boxes", "indirect.downsample=4", "indirect.interleave=3"],
    },
    Preset {
        name: "fast",
        about: "exact visibility, 2x2 and 3x3 with the edge-aware filter",
        settings: &[
            "panes=true",
            "light_choice=tree",
            "indirect.downsample=2",
            "indirect.upsample=plane",
            "indirect.interleave=3",
            "indirect.filter=combined",
            "indirect.least_fit=0.6",
        ],
    },
];

/// What a trial that begins with a preset has before its name.
pub(crate) const TRIAL_PRESET: &str = "preset=";

/// A configuration that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{}: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Something in the file is wrong.
    #[error("{}: {problem}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// What is wrong, with key or line.
        problem: String,
    },
    /// An assignment is not of the form KEY=VALUE.
    #[error("`{0}` is not of the form KEY=VALUE")]
    Assignment(String),
    /// No field has this name.
    #[error("unknown key `{key}`; the nearest is `{nearest}`")]
    UnknownKey {
        /// The key as given.
        key: String,
        /// The key most like it.
        nearest: String,
    },
    /// A value of the wrong type or outside its range.
    #[error("{key}: {problem}")]
    Value {
        /// The field.
        key: String,
        /// What is wrong with it.
        problem: String,
    },
}

impl ConfigError {
    /// What kind of failure this is: bad input.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        ErrorClass::Input
    }
}

impl From<BadValue> for ConfigError {
    fn from(BadValue { key, problem }: BadValue) -> Self {
        Self::Value { key: key.into(), problem }
    }
}

impl RenderConfig {
    /// Reads a TOML file; keys that it does not name keep their defaults. Ranges are [`Self::validate`]'s.
    ///
    /// # Errors
    /// The file cannot be read or is not TOML, an unknown key, a value of the wrong type.
    pub fn from_toml(file: &Path) -> Result<Self, ConfigError> {
        let mut config = Self::default();
        config.apply_toml(file)?;
        Ok(config)
    }

    /// Reads a TOML file; keys that it does not name stay as they are.
    ///
    /// # Errors
    /// As for [`Self::from_toml`]; then nothing changes.
    pub fn apply_toml(&mut self, file: &Path) -> Result<(), ConfigError> {
        let text = read::text(file, read::SETTINGS)
            .map_err(|source| ConfigError::Read { file: file.into(), source })?;
        let fail = |problem: String| ConfigError::File { file: file.into(), problem };
        let mut change: Table = text.parse().map_err(|error: toml::de::Error| fail(syntax(&text, &error)))?;
        let removed = check_keys(&mut change).map_err(|error| fail(error.to_string()))?;
        self.apply(change, &removed).map_err(|error| fail(one_line(&error)))
    }

    /// Carries out one assignment, `vpl_shoot.vpls=90`. The value is written as in TOML; strings need no quotes.
    ///
    /// # Errors
    /// Not an assignment, an unknown key, a value of the wrong type.
    pub fn apply_override(&mut self, assignment: &str) -> Result<(), ConfigError> {
        let (key, value) =
            assignment.split_once('=').ok_or_else(|| ConfigError::Assignment(assignment.into()))?;
        let (key, value) = (key.trim(), value.trim());
        let value = value.parse::<Value>().unwrap_or_else(|_| Value::String(value.into()));
        let mut parts = key.rsplit('.');
        let mut change = Table::from_iter([(parts.next().unwrap_or_default().to_owned(), value)]);
        for group in parts {
            change = Table::from_iter([(group.to_owned(), Value::Table(change))]);
        }
        let removed = check_keys(&mut change)?;
        let fail = |error: &dyn Display| ConfigError::Value { key: key.into(), problem: one_line(error) };
        self.apply(change, &removed).map_err(|error| fail(&error.message()))
    }

    /// Sets what a table holds, and takes back the keys at `removed`.
    fn apply(&mut self, change: Table, removed: &[String]) -> Result<(), toml::de::Error> {
        let mut table = Table::try_from(&*self).map_err(serde::de::Error::custom)?;
        merge(&mut table, change);
        removed.iter().for_each(|path| remove(&mut table, path));
        *self = Self::deserialize(Value::Table(table))?;
        Ok(())
    }

    /// Carries out the assignments of a preset.
    ///
    /// # Errors
    /// No preset has this name.
    pub fn apply_preset(&mut self, name: &str) -> Result<(), ConfigError> {
        let preset = PRESETS.iter().find(|preset| preset.name == name).ok_or_else(|| {
            let names: Vec<_> = PRESETS.iter().map(|preset| preset.name).collect();
            let problem = format!("no preset `{name}`; there are {}", names.join(", "));
            ConfigError::Value { key: "preset".into(), problem }
        })?;
        CANONICAL.iter().chain(preset.settings).try_for_each(|assignment| self.apply_override(assignment))
    }

    /// Carries out what a case of the stress suite sets and what a trial of it does: a trial overrules the case, which overrules
    /// the preset that the trial may begin with.
    ///
    /// # Errors
    /// An unknown preset or key, a value of the wrong type.
    pub(crate) fn apply_trial<'a>(
        &mut self,
        case: &'a [&'a str],
        trial: impl IntoIterator<Item = &'a str>,
    ) -> Result<(), ConfigError> {
        let mut trial = trial.into_iter().peekable();
        if let Some(name) = trial.peek().and_then(|first| first.strip_prefix(TRIAL_PRESET)) {
            self.apply_preset(name)?;
            trial.next();
        }
        case.iter().copied().chain(trial).try_for_each(|assignment| self.apply_override(assignment))
    }

    /// Checks every range its fields' documentation states.
    ///
    /// # Errors
    /// [`ConfigError::Value`] for the first field outside its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let [width, height] = self.size;
        within("size", width, SIZE_RANGE)?;
        within("size", height, SIZE_RANGE)?;
        within("pixel_samples", self.pixel_samples, 1..=65536)?;
        if let Some([x0, y0, x1, y1]) = self.crop
            && !(x0 < x1 && x1 <= width && y0 < y1 && y1 <= height)
        {
            let problem = format!("{x0},{y0},{x1},{y1} is empty or not inside a picture of {width}x{height}");
            return Err(BadValue::new("crop", problem).into());
        }
        let Self { vpl_shoot, whitted, indirect, path_trace, glare, tone_map, .. } = self;
        let groups: [&dyn Settings; 6] = [vpl_shoot, whitted, indirect, path_trace, glare, tone_map];
        groups.into_iter().try_for_each(Settings::check)?;
        self.own.check(registry::groups())?;
        (self.method.check)(self)?;
        Ok(())
    }
}

/// Every key as a path, with whether it is optional; groups come before their members.
fn known_keys() -> Vec<(String, bool)> {
    fn walk(prefix: &str, value: &serde_json::Value, keys: &mut Vec<(String, bool)>) {
        for (name, value) in value.as_object().into_iter().flatten() {
            let path = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
            keys.push((path.clone(), value.is_null()));
            walk(&path, value, keys);
        }
    }
    let defaults = serde_json::to_value(RenderConfig::default()).unwrap_or_default();
    let mut keys = Vec::new();
    walk("", &defaults, &mut keys);
    keys
}

/// Refuses unknown keys; takes out optional keys set to `auto` and returns their paths.
fn check_keys(table: &mut Table) -> Result<Vec<String>, ConfigError> {
    fn walk(
        prefix: &str,
        table: &mut Table,
        known: &[(String, bool)],
        removed: &mut Vec<String>,
    ) -> Result<(), ConfigError> {
        let names: Vec<String> = table.keys().cloned().collect();
        for name in names {
            let path = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
            let Some((_, optional)) = known.iter().find(|(key, _)| *key == path) else {
                return Err(ConfigError::UnknownKey { nearest: nearest_key(&path, known), key: path });
            };
            if *optional && table[&name].as_str() == Some("auto") {
                table.remove(&name);
                removed.push(path);
            } else if known.iter().any(|(key, _)| key.starts_with(&format!("{path}.")))
                && let Some(inner) = table[&name].as_table_mut()
            {
                walk(&path, inner, known, removed)?;
            }
        }
        Ok(())
    }
    let mut removed = Vec::new();
    walk("", table, &known_keys(), &mut removed)?;
    Ok(removed)
}

fn nearest_key(key: &str, known: &[(String, bool)]) -> String {
    fn last(path: &str) -> &str {
        path.rsplit('.').next().unwrap_or_default()
    }
    // A key without its group is the likeliest mistake, so the last parts alone count as much as the whole.
    let likeness =
        |name: &str| strsim::jaro_winkler(key, name).max(strsim::jaro_winkler(last(key), last(name)));
    let names = known.iter().map(|(name, _)| name.as_str());
    names.max_by(|a, b| likeness(a).total_cmp(&likeness(b))).unwrap_or_default().to_owned()
}

fn merge(table: &mut Table, change: Table) {
    for (key, value) in change {
        match (table.get_mut(&key), value) {
            (Some(Value::Table(inner)), Value::Table(change)) => merge(inner, change),
            (_, value) => drop(table.insert(key, value)),
        }
    }
}

fn remove(table: &mut Table, path: &str) {
    match path.split_once('.') {
        None => drop(table.remove(path)),
        Some((group, rest)) => {
            if let Some(inner) = table.get_mut(group).and_then(Value::as_table_mut) {
                remove(inner, rest);
            }
        }
    }
}

fn syntax(text: &str, error: &toml::de::Error) -> String {
    let line = error.span().map(|span| text[..span.start.min(text.len())].matches('\n').count() + 1);
    match line {
        Some(line) => format!("line {line}: {}", error.message()),
        None => error.message().to_owned(),
    }
}

fn one_line(error: &dyn Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common;

    fn with(assignment: &str) -> Result<RenderConfig, ConfigError> {
        let mut config = RenderConfig::default();
        config.apply_override(assignment).map(|()| config)
    }

    fn file(text: &str) -> Result<RenderConfig, ConfigError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("settings.toml");
        std::fs::write(&path, text).unwrap();
        RenderConfig::from_toml(&path)
    }

    #[test]
    fn every_method_is_named_by_its_word() {
        for method in REGISTRY {
            let config = with(&format!("method={}", method.name)).unwrap();
            assert_eq!(config.method, *method);
            assert_eq!(serde_json::to_value(config).unwrap()["method"], method.name);
        }
        let error = with("method=photon").unwrap_err().to_string();
        assert!(REGISTRY.iter().all(|method| error.contains(&format!("`{}`", method.name))), "{error}");
    }

    #[test]
    fn defaults_are_the_papers_size_and_valid() {
        let config = RenderConfig::default();
        config.validate().unwrap();
        assert_eq!(config.size, [800, 600]);
    }

    /// Whatever was set before, a preset is valid, and the paper's differ from one to the next by one acceleration.
    #[test]
    fn presets_are_cumulative_and_overrule_what_was_there() {
        let mut strange = RenderConfig { pixel_samples: 3, ..RenderConfig::default() };
        for assignment in [
            "vpl_shoot.vpls=7",
            "indirect.visibility=boxes-plane",
            "indirect.box_split=0.5",
            "indirect.downsample=2",
            "indirect.upsample=plane",
            "indirect.interleave=2",
            "indirect.pattern=irregular",
            "indirect.compensation=2",
        ] {
            strange.apply_override(assignment).unwrap();
        }
        let preset = |name| {
            let [mut plain, mut strange] = [RenderConfig::default(), strange.clone()];
            plain.apply_preset(name).unwrap();
            strange.apply_preset(name).unwrap();
            strange.validate().unwrap();
            assert_eq!(plain, strange, "{name}");
            plain
        };
        let mut expected = common::plain();
        expected.apply_override("indirect.glossy=false").unwrap();
        expected.vpl_shoot.bounces = Some(3);
        (expected.vpl_shoot.lobes, expected.vpl_shoot.guided) = (false, false);
        expected.shadow_terminator = false;
        expected.panes = false;
        expected.light_choice = LightChoice::Power;
        for (name, change) in [
            ("paper-canonical", "seed=0"),
            ("paper-imperfect", "indirect.visibility=boxes"),
            ("paper-downsampled", "indirect.downsample=4"),
            ("paper-interleaved", "indirect.interleave=3"),
        ] {
            expected.apply_override(change).unwrap();
            assert_eq!(preset(name), expected, "{name}");
        }
        assert_eq!(preset("fast").indirect.visibility, crate::techniques::indirect::Visibility::Exact);
    }

    /// Every leaf can be set both ways, and the two ways agree.
    #[test]
    fn file_and_assignment_reach_every_field() {
        let values = [
            ("method", "\"igi\""),
            ("size", "[64, 48]"),
            ("seed", "7"),
            ("pixel_samples", "4"),
            ("crop", "[1, 2, 3, 4]"),
            ("energy_conserving", "true"),
            ("shadow_terminator", "false"),
            ("panes", "false"),
            ("light_choice", "\"power\""),
            ("vpl_shoot.vpls", "90"),
            ("vpl_shoot.bounces", "2"),
            ("vpl_shoot.lobes", "false"),
            ("vpl_shoot.guided", "false"),
            ("vpl_shoot.candidates", "4"),
            ("whitted.specular_depth", "1"),
            ("whitted.mirror_roughness", "0.25"),
            ("whitted.light_samples", "64"),
            ("indirect.min_distance", "0.5"),
            ("indirect.compensation", "4"),
            ("indirect.downsample", "4"),
            ("indirect.upsample", "\"plane\""),
            ("indirect.interleave", "2"),
            ("indirect.pattern", "\"irregular\""),
            ("indirect.filter", "\"paper\""),
            ("indirect.depth_threshold", "0.1"),
            ("indirect.normal_threshold", "0.5"),
            ("indirect.plane_threshold", "0.75"),
            ("indirect.plane_cosine", "0.5"),
            ("indirect.least_fit", "0.5"),
            ("indirect.glossy", "false"),
            ("indirect.visibility", "\"boxes-plane\""),
            ("indirect.box_split", "0.5"),
            ("path_trace.spp", "16"),
            ("path_trace.max_depth", "7"),
            ("path_trace.estimator", "\"naive\""),
            ("path_trace.transport", "\"diffuse-indirect\""),
            ("path_trace.pixel_filter", "\"center\""),
            ("path_trace.roulette_depth", "3"),
            ("glare.strength", "0.25"),
            ("glare.radius", "0.25"),
            ("path_trace.adaptive", "true"),
            ("tone_map.exposure", "-1.5"),
            ("tone_map.operator", "\"aces\""),
            ("tone_map.white", "2.0"),
        ];
        let keys = known_keys();
        // A method's own settings are for its own tests.
        let own = |key: &str| {
            REGISTRY.iter().any(|method| method.own.is_some() && key.split('.').next() == Some(method.name))
        };
        let leaves = keys
            .iter()
            .filter(|(key, _)| !own(key) && !keys.iter().any(|(k, _)| k.starts_with(&format!("{key}."))));
        for (key, _) in leaves {
            let (_, value) =
                values.iter().find(|(k, _)| k == key).unwrap_or_else(|| panic!("{key} is untested"));
            let assigned = with(&format!("{key}={value}")).unwrap();
            assert_eq!(assigned, file(&format!("{key} = {value}\n")).unwrap(), "{key}");
            assert!(key == "method" || assigned != RenderConfig::default(), "{key}");
        }
    }

    #[test]
    fn strings_need_no_quotes_and_whole_numbers_are_numbers() {
        assert_eq!(with("method=igi").unwrap(), RenderConfig::default());
        assert_eq!(with("indirect.min_distance = 1").unwrap().indirect.min_distance, Some(1.0));
    }

    #[test]
    fn auto_takes_an_optional_key_back() {
        let mut config = with("tone_map.exposure=2").unwrap();
        config.apply_override("tone_map.exposure=auto").unwrap();
        assert_eq!(config, RenderConfig::default());
        assert_eq!(file("tone_map.exposure = \"auto\"").unwrap(), RenderConfig::default());
        assert!(with("seed=auto").is_err(), "a key that is always there has no `auto`");
    }

    #[test]
    fn unknown_keys_name_the_nearest() {
        for (key, nearest) in [
            ("vpls", "vpl_shoot.vpls"),
            ("vpl_shoot.vlps", "vpl_shoot.vpls"),
            ("bounce", "vpl_shoot.bounces"),
            ("tonemap", "tone_map"),
            ("sede", "seed"),
        ] {
            let expected = format!("unknown key `{key}`; the nearest is `{nearest}`");
            assert_eq!(with(&format!("{key}=1")).unwrap_err().to_string(), expected);
            assert!(file(&format!("{key} = 1")).unwrap_err().to_string().ends_with(&expected));
        }
        assert!(with("seed.low=1").is_err(), "a field has no members");
    }

    #[test]
    fn wrong_types_name_the_key() {
        let error = with("vpl_shoot.vpls=many").unwrap_err().to_string();
        assert!(error.starts_with("vpl_shoot.vpls: ") && error.contains("many"), "{error}");
        let error = file("[vpl_shoot]\nvpls = -1\n").unwrap_err().to_string();
        assert!(error.contains("settings.toml") && error.contains("vpl_shoot.vpls"), "{error}");
        let error = file("seed = 1\nsize = [").unwrap_err().to_string();
        assert!(error.contains("line 2"), "{error}");
        assert!(matches!(with("seed").unwrap_err(), ConfigError::Assignment(_)));
        let missing = RenderConfig::from_toml(Path::new("/nonexistent/x.toml")).unwrap_err();
        assert!(missing.to_string().starts_with("/nonexistent/x.toml: "));
    }

    #[test]
    fn values_outside_their_ranges_are_refused_by_name() {
        for (assignment, key) in [
            ("size=[0,1]", "size"),
            ("size=[1,16385]", "size"),
            ("pixel_samples=0", "pixel_samples"),
            ("crop=[0,0,0,1]", "crop"),
            ("crop=[0,0,801,1]", "crop"),
            ("crop=[0,5,1,5]", "crop"),
            ("vpl_shoot.vpls=0", "vpl_shoot.vpls"),
            ("vpl_shoot.vpls=16777217", "vpl_shoot.vpls"),
            ("vpl_shoot.bounces=33", "vpl_shoot.bounces"),
            ("whitted.specular_depth=17", "whitted.specular_depth"),
            ("whitted.mirror_roughness=1.5", "whitted.mirror_roughness"),
            ("whitted.mirror_roughness=nan", "whitted.mirror_roughness"),
            ("whitted.light_samples=0", "whitted.light_samples"),
            ("whitted.light_samples=4097", "whitted.light_samples"),
            ("indirect.min_distance=-0.1", "indirect.min_distance"),
            ("indirect.min_distance=inf", "indirect.min_distance"),
            ("indirect.min_distance=1e300", "indirect.min_distance"),
            ("indirect.compensation=65", "indirect.compensation"),
            ("indirect.downsample=0", "indirect.downsample"),
            ("indirect.downsample=17", "indirect.downsample"),
            ("indirect.interleave=0", "indirect.interleave"),
            ("indirect.interleave=4", "indirect.interleave"),
            ("indirect.depth_threshold=0", "indirect.depth_threshold"),
            ("indirect.normal_threshold=nan", "indirect.normal_threshold"),
            ("indirect.plane_threshold=-1", "indirect.plane_threshold"),
            ("indirect.plane_cosine=1", "indirect.plane_cosine"),
            ("indirect.box_split=0.5", "indirect.box_split"),
            ("path_trace.spp=0", "path_trace.spp"),
            ("path_trace.spp=16777217", "path_trace.spp"),
            ("path_trace.max_depth=0", "path_trace.max_depth"),
            ("path_trace.max_depth=65537", "path_trace.max_depth"),
            ("path_trace.roulette_depth=0", "path_trace.roulette_depth"),
            ("glare.strength=1.5", "glare.strength"),
            ("glare.strength=-0.1", "glare.strength"),
            ("glare.strength=nan", "glare.strength"),
            ("glare.radius=0", "glare.radius"),
            ("glare.radius=0.6", "glare.radius"),
            ("tone_map.white=0", "tone_map.white"),
            ("tone_map.white=inf", "tone_map.white"),
            ("tone_map.exposure=nan", "tone_map.exposure"),
            ("tone_map.exposure=65", "tone_map.exposure"),
        ] {
            let config = with(assignment).unwrap();
            match config.validate() {
                Err(ConfigError::Value { key: named, .. }) => assert_eq!(named, key),
                other => panic!("{assignment}: {other:?}"),
            }
        }
        let mut config = with("indirect.visibility=boxes").unwrap();
        for (longest, fits) in [("0.5", true), ("0", false), ("-1", false), ("inf", false), ("nan", false)] {
            config.apply_override(&format!("indirect.box_split={longest}")).unwrap();
            assert_eq!(config.validate().is_ok(), fits, "{longest}");
        }
        for assignment in
            ["size=[16384,1]", "crop=[0,0,800,600]", "vpl_shoot.vpls=16777216", "tone_map.exposure=-3"]
        {
            with(assignment).unwrap().validate().unwrap();
        }
    }
}
