//! The configuration: a file, then a preset, then assignments, then options, each winning over what came before.

use super::args::{Render, Settings};
use super::failure::{Failure, input};
use crate::config::{ConfigError, MAX_SPP, RenderConfig};
use crate::methods::{Method, igi, path};

/// What an option sets: its word, its key and, where it is given, its value.
pub(super) type Assignment = (&'static str, &'static str, Option<String>);

impl Settings {
    /// What the file says.
    fn read(&self) -> Result<RenderConfig, Failure> {
        match &self.config {
            Some(file) => Ok(RenderConfig::from_toml(file)?),
            None => Ok(RenderConfig::default()),
        }
    }

    /// The preset, the assignments, then the options.
    fn apply(&self, config: &mut RenderConfig, options: &[Assignment]) -> Result<(), Failure> {
        if let Some(preset) = &self.preset {
            config.apply_preset(preset)?;
        }
        for assignment in &self.define {
            config.apply_override(assignment).map_err(|error| input!("-D {assignment}: {error}"))?;
        }
        for (option, key, value) in options {
            if let Some(value) = value {
                config
                    .apply_override(&format!("{key}={value}"))
                    .map_err(|error| input!("{option}: {error}"))?;
            }
        }
        Ok(())
    }

    /// Checks ranges; errors name what set the value.
    fn check(&self, config: &RenderConfig, options: &[Assignment]) -> Result<(), Failure> {
        config.validate().map_err(|error| {
            let ConfigError::Value { key, problem } = &error else { return error.into() };
            let option = options.iter().find(|(_, name, value)| name == key && value.is_some());
            let assignment = self.define.iter().rev().find(|assignment| assignment.starts_with(key));
            match (option, assignment, &self.config) {
                (Some((option, ..)), ..) => input!("{option}: {problem}"),
                (_, Some(assignment), _) => input!("-D {assignment}: {problem}"),
                (_, _, Some(file)) => input!("{}: {error}", file.display()),
                _ => error.into(),
            }
        })
    }

    /// Builds and checks the configuration where `options` are all that is said beside.
    pub(super) fn with(&self, options: &[Assignment]) -> Result<RenderConfig, Failure> {
        let mut config = self.read()?;
        self.apply(&mut config, options)?;
        self.check(&config, options)?;
        Ok(config)
    }
}

/// Builds and checks the configuration; errors name the option, assignment or file they come from.
pub(super) fn settings(args: &Render) -> Result<RenderConfig, Failure> {
    let mut config = args.settings.read()?;
    // One limit needs no other, unless it is given.
    let limited = args.time.is_some() || args.noise.is_some();
    if limited && config.path_trace.spp == RenderConfig::default().path_trace.spp {
        config.path_trace.spp = MAX_SPP;
    }
    let options = [
        ("--method", "method", args.method.clone()),
        ("--size", "size", args.machine.size.map(|size| format!("{size:?}"))),
        ("--seed", "seed", args.machine.seed.map(|seed| seed.to_string())),
        ("--pixel-samples", "pixel_samples", args.pixel_samples.map(|samples| samples.to_string())),
        ("--crop", "crop", args.crop.map(|crop| format!("{crop:?}"))),
        ("--vpls", "vpl_shoot.vpls", args.vpls.map(|vpls| vpls.to_string())),
        ("--bounces", "vpl_shoot.bounces", args.bounces.map(|bounces| bounces.to_string())),
        (
            "--min-distance",
            "indirect.min_distance",
            args.min_distance.map(|distance| format!("{distance:?}")),
        ),
        ("--downsample", "indirect.downsample", args.downsample.map(|n| n.to_string())),
        ("--upsample", "indirect.upsample", args.upsample.clone()),
        ("--interleave", "indirect.interleave", args.interleave.map(|n| n.to_string())),
        ("--pattern", "indirect.pattern", args.pattern.clone()),
        ("--filter", "indirect.filter", args.filter.clone()),
        ("--visibility", "indirect.visibility", args.visibility.clone()),
        ("--box-split", "indirect.box_split", args.box_split.map(|length| format!("{length:?}"))),
        ("--spp", "path_trace.spp", args.spp.map(|spp| spp.to_string())),
        ("--max-depth", "path_trace.max_depth", args.max_depth.map(|depth| depth.to_string())),
        ("--estimator", "path_trace.estimator", args.estimator.clone()),
        ("--transport", "path_trace.transport", args.transport.clone()),
        ("--pixel-filter", "path_trace.pixel_filter", args.pixel_filter.clone()),
        ("--adaptive", "path_trace.adaptive", args.adaptive.then(|| "true".into())),
        ("--exposure", "tone_map.exposure", args.exposure.clone()),
        ("--tone-map", "tone_map.operator", args.tone_map.clone()),
        ("--glare", "glare.strength", args.glare.map(|strength| format!("{strength:?}"))),
    ];
    args.settings.apply(&mut config, &options)?;
    let of = |method: &'static Method| move |option| (option, method);
    let groups = options.iter().filter(|(.., value)| value.is_some()).filter_map(|(option, key, _)| {
        let method = match key.split('.').next() {
            Some("path_trace") => &path::METHOD,
            Some("whitted" | "indirect") => &igi::METHOD,
            _ => return None,
        };
        Some((*option, method))
    });
    let path_only = [
        ("--time", args.time.is_some()),
        ("--noise", args.noise.is_some()),
        ("--preview", args.preview.is_some()),
        ("--resume", args.resume.is_some()),
    ];
    let path_only = path_only.into_iter().filter_map(|(option, given)| given.then_some(option));
    for (option, method) in groups
        .chain(args.vpls.map(|_| "--vpls").map(of(&igi::METHOD)))
        .chain(path_only.map(of(&path::METHOD)))
    {
        if method != config.method {
            return Err(input!(
                "{option}: method {} has no use for it, {} has",
                config.method.name,
                method.name
            ));
        }
    }
    args.settings.check(&config, &options)?;
    Ok(config)
}
