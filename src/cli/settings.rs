//! The configuration: a file, then a preset, then assignments, then options, each winning over what came before.

use super::args::{Assignment, Render, Settings};
use super::failure::{Failure, input};
use crate::config::{ConfigError, MAX_SPP, RenderConfig};
use crate::methods::{Method, REGISTRY};

impl Settings {
    /// What the file says, on top of `base`.
    fn read(&self, mut base: RenderConfig) -> Result<RenderConfig, Failure> {
        if let Some(file) = &self.config {
            base.apply_toml(file)?;
        }
        Ok(base)
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
        let mut config = self.read(RenderConfig::default())?;
        self.apply(&mut config, options)?;
        self.check(&config, options)?;
        Ok(config)
    }
}

/// Builds and checks the configuration; errors name the option, assignment or file they come from.
pub(super) fn settings(args: &Render) -> Result<RenderConfig, Failure> {
    let mut base = RenderConfig::default();
    // One limit needs no other, unless it is given.
    if args.time.is_some() || args.noise.is_some() {
        for progressive in REGISTRY.iter().filter_map(|method| method.progressive) {
            (progressive.set_samples)(&mut base, MAX_SPP);
        }
    }
    let mut config = args.settings.read(base)?;
    let mut options = vec![
        ("--method", "method", args.method.clone()),
        ("--size", "size", args.machine.size.map(|size| format!("{size:?}"))),
        ("--seed", "seed", args.machine.seed.map(|seed| seed.to_string())),
        ("--pixel-samples", "pixel_samples", args.pixel_samples.map(|samples| samples.to_string())),
        ("--crop", "crop", args.crop.map(|crop| format!("{crop:?}"))),
        ("--exposure", "tone_map.exposure", args.exposure.clone()),
        ("--tone-map", "tone_map.operator", args.tone_map.clone()),
        ("--glare", "glare.strength", args.glare.map(|strength| format!("{strength:?}"))),
    ];
    options.extend(args.method_options.assignments());
    args.settings.apply(&mut config, &options)?;
    let method = config.method;
    let used = |option: &str, has: fn(&Method, &str) -> bool| match has(method, option) {
        true => Ok(()),
        false => {
            let other = REGISTRY.iter().find(|other| has(other, option)).map_or("none", |other| other.name);
            Err(input!("{option}: only method {other} uses it; this is method {}", method.name))
        }
    };
    for (option, ..) in args.method_options.assignments() {
        used(option, |method, word| method.options.iter().any(|option| option.word == word))?;
    }
    for (option, given) in [
        ("--time", args.time.is_some()),
        ("--noise", args.noise.is_some()),
        ("--preview", args.preview.is_some()),
        ("--resume", args.resumed().is_some()),
    ] {
        if given {
            used(option, |method, _| method.progressive.is_some())?;
        }
    }
    args.settings.check(&config, &options)?;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::super::args::{Cli, Command};
    use super::*;
    use crate::methods::{CliOption, OptionValue};
    use clap::{CommandFactory, Parser};

    fn given(method: &Method, option: &CliOption) -> Result<RenderConfig, String> {
        let value = match option.value {
            OptionValue::Whole(_) => Some("2"),
            OptionValue::Number(_) | OptionValue::Distance(_) => Some("0.75"),
            OptionValue::Word(_, words) => words.iter().copied().find(|word| {
                let mut config = RenderConfig::default();
                config.apply_override(&format!("{}={word}", option.key)).unwrap();
                config != RenderConfig::default()
            }),
            OptionValue::Flag => None,
        };
        let words = ["parhelion", "render", "-D", "indirect.visibility=boxes", "--method", method.name];
        let words = words.into_iter().chain([option.word]).chain(value);
        let Command::Render(args) = Cli::try_parse_from(words).unwrap().command else { unreachable!() };
        let found = settings(&args).map_err(|failure| failure.error.to_string())?;
        let mut expected = RenderConfig { method: found.method, ..RenderConfig::default() };
        let key = format!("{}={}", option.key, value.unwrap_or("true"));
        for assignment in ["indirect.visibility=boxes", &key] {
            expected.apply_override(assignment).unwrap();
        }
        assert_eq!(found, expected, "{}", option.word);
        assert!(key.starts_with("indirect.visibility") || found != given_nothing(found.method), "{key}");
        Ok(found)
    }

    fn given_nothing(method: &'static Method) -> RenderConfig {
        let mut config = RenderConfig { method, ..RenderConfig::default() };
        config.apply_override("indirect.visibility=boxes").unwrap();
        config
    }

    #[test]
    fn options_of_every_method_are_in_help_and_set_their_keys_for_it_alone() {
        let mut command = Cli::command();
        let help = command.find_subcommand_mut("render").unwrap().render_long_help().to_string();
        for method in REGISTRY {
            for option in method.options {
                assert!(help.contains(option.word) && help.contains(option.help), "{}: {help}", option.word);
                for other in REGISTRY {
                    let shared = other.options.iter().any(|there| there.word == option.word);
                    match given(other, option) {
                        Ok(config) => assert!(shared && config.method == *other),
                        Err(error) => {
                            assert!(
                                !shared && error.contains(option.word) && error.contains(other.name),
                                "{error}"
                            );
                        }
                    }
                }
            }
            assert!(
                help.contains(&format!("--method {}", method.name)) || *method == REGISTRY[0],
                "its layers"
            );
        }
    }
}
