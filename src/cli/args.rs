//! What can be said on the command line. `-h` shows the options most used, a line each, `--help` all there is to say.

use crate::config::{PRESETS, Preset};
use crate::methods::{CliOption, Method, OptionGroup, OptionValue, REGISTRY};
use crate::renderer::{Aov, BackendChoice};
use crate::stress;
use crate::techniques::tone_map::Operator;
use crate::vk::Backend;
use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Arg, ArgAction, ArgMatches, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Groups of options, in the order in which help shows them.
const SCENE: &str = "Scene";
const LIGHT: &str = "Light";
const PICTURE: &str = "Picture";
const SPEED: &str = "Speed";
const OUTPUT: &str = "Output";
const FILM: &str = "Film";

/// Where options of the machine stand in their group: behind those of the command.
const LAST: usize = 1000;

/// Where options of methods stand: between both.
const OF_METHODS: usize = 500;

/// Global illumination on any Vulkan device.
#[derive(Parser)]
#[command(version)]
pub(super) struct Cli {
    #[command(subcommand)]
    pub(super) command: Command,
}

#[derive(Subcommand)]
pub(super) enum Command {
    /// Render a scene to pictures.
    Render(Box<Render>),
    /// Repeat the paper's experiment on a scene.
    ///
    /// The paper's four approaches and ours at 30, 90 and 180 VPLs: times, errors, pictures.
    Paper(Box<Paper>),
    /// Chart error against time.
    ///
    /// Measures methods and settings on one scene and leaves a page to look at, which says what to use.
    Chart(Box<Chart>),
    /// Measure how far a picture is from a reference.
    Compare(Compare),
    /// Run every method on small scenes made to break it.
    ///
    /// Says what fails, by how much, and whether that is known.
    Stress(Stress),
    /// Write a page on each method: what it is, costs, leaves wrong and fails at.
    ///
    /// The page is made from charts and the stress suite.
    Methods(Methods),
    /// List devices, drivers, what they lack and the backend each would use.
    ///
    /// Traces a ray on each device as proof.
    Doctor(Doctor),
    /// Show the render graph of a frame, without rendering it.
    Graph(Graph),
    /// Print a script that completes this command's words in a shell.
    Completions(Completions),
}

/// Which scene, and how it is read.
#[derive(clap::Args)]
pub(super) struct SceneFile {
    /// .gltf, .glb, .obj or builtin:NAME [default: builtin:office].
    pub(super) scene: Option<PathBuf>,
    /// Scene of the file, by name or index [default: the one it names].
    #[arg(long = "scene", value_name = "NAME|INDEX", help_heading = SCENE)]
    pub(super) which: Option<String>,
    /// Folder that files of the scene may lie in beside its own; repeatable.
    ///
    /// Nothing else is read, whatever paths and links in the scene say.
    #[arg(long, value_name = "DIR", help_heading = SCENE, hide_short_help = true)]
    pub(super) root: Vec<PathBuf>,
    /// Refuse a scene with defects that are mended and noted otherwise, such as missing materials.
    #[arg(long, help_heading = SCENE, hide_short_help = true)]
    pub(super) strict: bool,
}

/// What every command that renders is asked of the scene.
#[derive(clap::Args)]
pub(super) struct Common {
    #[command(flatten)]
    pub(super) file: SceneFile,
    /// Camera of the scene, by name or index [default: the first].
    #[arg(long, value_name = "NAME|INDEX", help_heading = SCENE)]
    pub(super) camera: Option<String>,
    /// Position of a camera of your own (metres).
    #[arg(long, value_name = "X,Y,Z", help_heading = SCENE, hide_short_help = true, allow_hyphen_values = true, value_parser = point, requires = "look_at", conflicts_with = "camera")]
    pub(super) eye: Option<[f64; 3]>,
    /// Point that the camera of --eye looks at (metres).
    #[arg(long, value_name = "X,Y,Z", help_heading = SCENE, hide_short_help = true, allow_hyphen_values = true, value_parser = point, requires = "eye")]
    pub(super) look_at: Option<[f64; 3]>,
    /// Vertical field of view of the camera of --eye (degrees) [default: 45].
    #[arg(long, value_name = "DEG", help_heading = SCENE, hide_short_help = true, allow_hyphen_values = true, value_parser = field_of_view, requires = "eye")]
    pub(super) fov: Option<f32>,
    /// Light from all around: an equirectangular picture, or R,G,B.
    ///
    /// FILE.exr or FILE.hdr, or the same radiance from everywhere as three numbers (W/(sr m2)). It takes the place of the
    /// scene's own.
    #[arg(long, value_name = "FILE", help_heading = SCENE, allow_hyphen_values = true)]
    pub(super) environment: Option<String>,
    /// Leave a scene without lights dark; otherwise a light is put at the camera.
    #[arg(long, help_heading = SCENE, hide_short_help = true)]
    pub(super) no_headlight: bool,
}

/// What every command is asked that uses the device for a while, whatever it renders.
#[derive(clap::Args)]
pub(super) struct Machine {
    /// Width and height in pixels, each 1 to 16384 [default: 800x600].
    #[arg(long, value_name = "WxH", help_heading = PICTURE, allow_hyphen_values = true, value_parser = size)]
    pub(super) size: Option<[u32; 2]>,
    /// Seed of all samples; every seed is as good as another [default: 0].
    #[arg(long, value_name = "N", help_heading = PICTURE, hide_short_help = true, display_order = LAST, allow_negative_numbers = true)]
    pub(super) seed: Option<u32>,
    /// Vulkan device: its index, name or UUID [default: the best].
    ///
    /// `parhelion doctor` lists them.
    #[arg(long, value_name = "DEVICE", help_heading = SPEED, display_order = LAST)]
    pub(super) device: Option<String>,
    /// What traces rays: auto chooses by the device, measure by timing this scene.
    #[arg(long, value_enum, help_heading = SPEED, hide_short_help = true, display_order = LAST + 1, default_value_t)]
    pub(super) backend: BackendWord,
    /// Print errors only.
    #[arg(short, long, help_heading = OUTPUT, display_order = LAST, conflicts_with = "verbose")]
    pub(super) quiet: bool,
    /// Log more; given twice, log everything.
    #[arg(short, long, help_heading = OUTPUT, hide_short_help = true, display_order = LAST + 1, action = ArgAction::Count)]
    pub(super) verbose: u8,
    /// How progress is shown on stderr: auto is a bar on a terminal, json one object a line.
    #[arg(long, value_enum, help_heading = OUTPUT, hide_short_help = true, display_order = LAST + 2, default_value_t)]
    pub(super) progress: ProgressWord,
}

/// What `--budget` and `--error` decide, or cannot do with.
fn chosen() -> Vec<&'static str> {
    let others = ["method", "preset", "time", "noise", "resume", "pixel_samples", "config", "define", "crop"];
    method_options().map(CliOption::name).chain(others).collect()
}

/// Settings by file, name and key, which win over each other in this order.
#[derive(clap::Args)]
pub(super) struct Settings {
    /// Settings from a file; options given here win over it.
    #[arg(long, value_name = "FILE.toml", hide_short_help = true)]
    pub(super) config: Option<PathBuf>,
    /// Settings under one name, such as fast; -D and other options win over it.
    #[arg(long, value_name = "NAME", help_heading = SPEED, hide_possible_values = true, long_help = about_presets(), value_parser = presets())]
    pub(super) preset: Option<String>,
    /// One setting by its key, such as vpl_shoot.vpls=90; repeatable.
    ///
    /// It wins over --config and --preset.
    #[arg(short = 'D', value_name = "KEY=VALUE")]
    pub(super) define: Vec<String>,
}

/// Numbers of frames, at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Frames {
    pub(super) range: RangeInclusive<u32>,
    /// From one to the next, at least 1.
    pub(super) step: u32,
}

impl Frames {
    pub(super) fn iter(&self) -> impl Iterator<Item = u32> + use<> {
        self.range.clone().step_by(self.step as usize)
    }

    pub(super) fn count(&self) -> usize {
        ((self.range.end() - self.range.start()) / self.step) as usize + 1
    }
}

/// Frames of a film.
#[derive(clap::Args)]
pub(super) struct Film {
    /// Frames of a film, such as 1-240, 1-240/10 (every tenth) or 17.
    ///
    /// Frame N shows the scene at N/fps seconds. Names of its files have a # or more where the frame's number goes.
    #[arg(long, value_name = "A-B", help_heading = FILM, value_parser = frames)]
    pub(super) frames: Option<Frames>,
    /// Write all frames side by side in rows, as one picture.
    ///
    /// It is written anew with each frame. Without -o it is all that is written.
    #[arg(long, value_name = "FILE.png", help_heading = FILM, hide_short_help = true, conflicts_with = "resume")]
    pub(super) sheet: Option<PathBuf>,
    /// Frames a second [default: 24].
    #[arg(long, value_name = "N", help_heading = FILM, value_parser = rate)]
    pub(super) fps: Option<f64>,
    /// Animation, by name or index [default: all that go together].
    ///
    /// Those go together that move different things.
    #[arg(long, value_name = "NAME|INDEX", help_heading = FILM)]
    pub(super) animation: Option<String>,
    /// Blur by motion: the shutter is open for this share of a frame's time, 0 to 1, by --method path.
    ///
    /// It opens at the frame's time. Samples are spread over up to 64 moments; layers other than the picture are of the last.
    #[arg(long, value_name = "SHARE", help_heading = FILM, hide_short_help = true, value_parser = share)]
    pub(super) shutter: Option<f64>,
    /// Turn the camera once around the scene in N frames.
    ///
    /// A camera of --eye turns around --look-at. Frame 1 is where it begins, frame N a step before it is there again.
    #[arg(long, value_name = "N", help_heading = FILM, hide_short_help = true, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(super) turntable: Option<u32>,
    /// Move the camera through positions by key times.
    ///
    /// The file has a table [[key]] for each, with time (seconds), eye and look_at (metres) and fov (degrees).
    #[arg(long, value_name = "FILE.toml", help_heading = FILM, hide_short_help = true, requires = "frames", conflicts_with_all = ["turntable", "camera", "eye"])]
    pub(super) camera_path: Option<PathBuf>,
}

#[derive(clap::Args)]
pub(super) struct Render {
    #[command(flatten)]
    pub(super) common: Common,
    /// How light is computed [default: igi].
    #[arg(long, help_heading = LIGHT, value_parser = methods())]
    pub(super) method: Option<String>,
    #[command(flatten)]
    pub(super) method_options: MethodOptions,
    #[command(flatten)]
    pub(super) machine: Machine,
    /// Exposure of .png pictures in stops [default: auto].
    ///
    /// auto brings average brightness to middle grey.
    #[arg(long, value_name = "EV|auto", help_heading = PICTURE, allow_hyphen_values = true, value_parser = exposure)]
    pub(super) exposure: Option<String>,
    /// What brings exposed radiance into a screen's range for .png pictures [default: neutral].
    #[arg(long, value_name = "OPERATOR", help_heading = PICTURE, hide_short_help = true, value_parser = operators())]
    pub(super) tone_map: Option<String>,
    /// Share of the light, 0 to 1, that .png pictures spread around bright things [default: 0].
    ///
    /// -D glare.radius=0.1 is how far, in picture heights.
    #[arg(long, value_name = "STRENGTH", help_heading = PICTURE, hide_short_help = true, allow_hyphen_values = true, value_parser = number)]
    pub(super) glare: Option<f32>,
    /// Remove noise with Open Image Denoise, in builds with the feature denoise.
    ///
    /// It guesses from radiance, albedo and normals, in all pictures. .exr ones keep the noisy radiance in the layer noisy.
    #[arg(long, help_heading = PICTURE)]
    pub(super) denoise: bool,
    /// Positions a pixel that are averaged, for smooth edges; time grows in proportion [default: 1].
    #[arg(long, value_name = "N", help_heading = PICTURE, hide_short_help = true, allow_negative_numbers = true)]
    pub(super) pixel_samples: Option<u32>,
    /// Render only this part: pixels from the top left, ends exclusive.
    ///
    /// It equals the same part of the whole, bit for bit, but for automatic exposure, glare and denoising.
    #[arg(long, value_name = "X0,Y0,X1,Y1", help_heading = PICTURE, hide_short_help = true, allow_hyphen_values = true, value_parser = numbers::<u32, 4>)]
    pub(super) crop: Option<[u32; 4]>,
    /// Pick method and settings of least error for this time a frame, such as 16ms.
    ///
    /// They are picked from the scene's chart or, where there is none, after a quick probe.
    #[arg(long, value_name = "TIME", help_heading = SPEED, allow_hyphen_values = true, value_parser = budget, conflicts_with_all = chosen())]
    pub(super) budget: Option<Duration>,
    /// Pick method and settings of least time for this error (relMSE), such as 0.02.
    #[arg(long, value_name = "ERROR", help_heading = SPEED, hide_short_help = true, allow_hyphen_values = true, value_parser = error, conflicts_with = "budget", conflicts_with_all = chosen())]
    pub(super) error: Option<f64>,
    /// Chart that --budget and --error pick from [default: the last one made for scene, camera, size and device].
    #[arg(long, value_name = "data.json", help_heading = SPEED, hide_short_help = true)]
    pub(super) front: Option<PathBuf>,
    #[command(flatten)]
    pub(super) settings: Settings,
    /// Stop --method path after this time, such as 30s, 5m or 1h.
    ///
    /// --spp is a limit too only where it is given.
    #[arg(long, value_name = "TIME", help_heading = SPEED, allow_hyphen_values = true, value_parser = duration)]
    pub(super) time: Option<Duration>,
    /// Stop --method path where the estimated relative error is no more than this, such as 0.01.
    ///
    /// --spp is a limit too only where it is given.
    #[arg(long, value_name = "ERROR", help_heading = SPEED, hide_short_help = true, allow_hyphen_values = true, value_parser = error)]
    pub(super) noise: Option<f64>,
    /// Render N times after warming up, and report medians.
    #[arg(long, value_name = "N", help_heading = SPEED, hide_short_help = true, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(super) repeat: Option<u32>,
    /// Say what was left out because the scene does not need it, and measure what it would cost.
    ///
    /// Some twenty things are measured, each by two further frames or more.
    #[arg(long, help_heading = SPEED, hide_short_help = true)]
    pub(super) explain: bool,
    /// Picture to write, .exr or .png; repeatable [default: SCENE.png].
    ///
    /// .exr holds linear radiance, .png is tone mapped.
    #[arg(short, long = "output", value_name = "FILE", help_heading = OUTPUT)]
    pub(super) output: Vec<PathBuf>,
    /// Further layers for .exr pictures, such as albedo,depth.
    #[arg(long, value_name = "NAME", help_heading = OUTPUT, value_delimiter = ',', long_help = about_layers(), value_parser = aov)]
    pub(super) aov: Vec<Aov>,
    /// Refresh the pictures of --method path this often while it runs [default: 10s].
    #[arg(long, value_name = "TIME", help_heading = OUTPUT, hide_short_help = true, allow_hyphen_values = true, value_parser = duration)]
    pub(super) preview: Option<Duration>,
    /// Go on from a picture that --method path wrote, or leave out frames that are there.
    ///
    /// FILE.exr is gone on from to the same bits as without a break. With --frames there is no file: frames are left out whose
    /// pictures are of the same scene, camera, settings and backend.
    #[arg(long, value_name = "FILE.exr", help_heading = OUTPUT, hide_short_help = true, num_args = 0..=1, conflicts_with = "repeat")]
    pub(super) resume: Option<Option<PathBuf>>,
    #[command(flatten)]
    pub(super) film: Film,
    /// Write device, scene, settings, times, rays and memory as JSON.
    #[arg(long, value_name = "FILE.json", help_heading = OUTPUT)]
    pub(super) stats: Option<PathBuf>,
    /// Write a resource as a pass leaves it; repeatable.
    ///
    /// `parhelion graph` shows the names.
    #[arg(long, value_name = "PASS:RESOURCE=FILE.exr", help_heading = OUTPUT, hide_short_help = true, value_parser = tap)]
    pub(super) tap: Vec<(String, PathBuf)>,
}

impl Render {
    /// The picture that is gone on from.
    pub(super) fn resumed(&self) -> Option<&Path> {
        self.resume.as_ref()?.as_deref()
    }
}

/// What an option sets: its word, its key and, where it is given, its value.
pub(super) type Assignment = (&'static str, &'static str, Option<String>);

/// What the options of all methods were given.
pub(super) struct MethodOptions(Vec<(&'static CliOption, String)>);

impl MethodOptions {
    /// What they set.
    pub(super) fn assignments(&self) -> impl Iterator<Item = Assignment> {
        self.0.iter().map(|(option, value)| (option.word, option.key, Some(value.clone())))
    }
}

impl clap::Args for MethodOptions {
    fn augment_args(command: clap::Command) -> clap::Command {
        let mut options: Vec<_> = method_options().collect();
        // Groups are shown in the order of their first options.
        options.sort_by_key(|option| option.group);
        command.args(options.into_iter().enumerate().map(|(index, option)| {
            let heading = match option.group {
                OptionGroup::Light => LIGHT,
                OptionGroup::Picture => PICTURE,
                OptionGroup::Speed => SPEED,
            };
            let mut arg = Arg::new(option.name()).long(option.name()).help_heading(heading);
            arg = arg.help(option.help).hide_short_help(option.rare).display_order(OF_METHODS + index);
            if !option.more.is_empty() {
                arg = arg.long_help(format!("{}\n\n{}", option.help, option.more));
            }
            match option.value {
                OptionValue::Whole(name) => {
                    arg.value_name(name).allow_negative_numbers(true).value_parser(clap::value_parser!(u32))
                }
                OptionValue::Number(name) => {
                    arg.value_name(name).allow_hyphen_values(true).value_parser(number)
                }
                OptionValue::Distance(name) => {
                    arg.value_name(name).allow_hyphen_values(true).value_parser(distance)
                }
                OptionValue::Word(name, words) => {
                    arg.value_name(name).value_parser(PossibleValuesParser::new(words))
                }
                OptionValue::Flag => arg.action(ArgAction::SetTrue),
            }
        }))
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Self::augment_args(command)
    }
}

impl clap::FromArgMatches for MethodOptions {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let value = |option: &CliOption| {
            let name = option.name();
            match option.value {
                OptionValue::Whole(_) => matches.get_one::<u32>(name).map(u32::to_string),
                OptionValue::Number(_) | OptionValue::Distance(_) => {
                    matches.get_one::<f32>(name).map(|value| format!("{value:?}"))
                }
                OptionValue::Word(..) => matches.get_one::<String>(name).cloned(),
                OptionValue::Flag => matches.get_flag(name).then(|| "true".into()),
            }
        };
        Ok(Self(method_options().filter_map(|option| Some((option, value(option)?))).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The options of all methods, those that several share once.
fn method_options() -> impl Iterator<Item = &'static CliOption> {
    let all = || REGISTRY.iter().flat_map(|method| method.options);
    let first =
        move |(index, option): &(usize, &CliOption)| all().take(*index).all(|o| o.word != option.word);
    all().enumerate().filter(first).map(|(_, option)| option)
}

/// Which layers each method draws.
fn about_layers() -> String {
    let layers = |(index, method): (usize, &&Method)| {
        let conditional = |aov: &Aov| method.conditional.iter().any(|c| c.aov == *aov);
        let always = method.aovs.iter().copied().filter(|aov| !conditional(aov));
        let always: Vec<_> = always.map(Aov::name).collect();
        let of = if index == 0 { String::new() } else { format!("of --method {} ", method.name) };
        let with = method.conditional.iter().map(|c| format!(", with {} {}", c.option, c.aov.name()));
        std::iter::once(format!("{of}{}", always.join(", "))).chain(with).collect::<String>()
    };
    let layers: Vec<_> = REGISTRY.iter().enumerate().map(layers).collect();
    format!("Further layers for .exr pictures, such as albedo,depth\n\n{}.", layers.join("; "))
}

#[derive(clap::Args)]
pub(super) struct Paper {
    #[command(flatten)]
    pub(super) common: Common,
    #[command(flatten)]
    pub(super) machine: Machine,
    /// Frames of each after warming up; 0 renders once [default: 10, on a CPU 0].
    ///
    /// Times are medians.
    #[arg(long, value_name = "N", help_heading = SPEED, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(0..=1_000_000))]
    pub(super) repeat: Option<u32>,
    /// Folder for paper.md, paper.json and pictures [default: SCENE-paper].
    ///
    /// It is made where it is missing.
    #[arg(short, long = "output", value_name = "DIR", help_heading = OUTPUT)]
    pub(super) output: Option<PathBuf>,
}

#[derive(clap::Args)]
pub(super) struct Chart {
    #[command(flatten)]
    pub(super) common: Common,
    #[command(flatten)]
    pub(super) machine: Machine,
    /// Settings to chart: small, paper, full or FILE.toml.
    ///
    /// A file holds tables [[sweep]] of keys as for -D, lists multiplied out.
    #[arg(long, value_name = "GRID", help_heading = SPEED, default_value = "small")]
    pub(super) grid: String,
    /// Frames of each after warming up; 0 renders once [default: 5, on a CPU 0].
    ///
    /// Times are medians.
    #[arg(long, value_name = "N", help_heading = SPEED, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(0..=1_000_000))]
    pub(super) repeat: Option<u32>,
    /// Begin no further measurement after this time, such as 30s or 10m.
    ///
    /// What has been measured is charted.
    #[arg(long, value_name = "TIME", help_heading = SPEED, allow_hyphen_values = true, value_parser = duration)]
    pub(super) time_limit: Option<Duration>,
    /// Seeds each setting is rendered with, from --seed on.
    #[arg(long, value_name = "K", help_heading = PICTURE, allow_negative_numbers = true, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(super) seeds: u32,
    /// Picture to measure errors against [default: one is rendered].
    ///
    /// It shows all light, at pixels' centres.
    #[arg(long, value_name = "REF.exr", help_heading = PICTURE, conflicts_with_all = ["reference_spp", "reference_depth"])]
    pub(super) reference: Option<PathBuf>,
    /// Samples a pixel of the reference [default: 16384, or what fits in 4 minutes].
    #[arg(long, value_name = "N", help_heading = PICTURE, hide_short_help = true, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(2..=1 << 24))]
    pub(super) reference_spp: Option<u32>,
    /// Edges of the longest paths of reference and charted path tracing [default: 64, all light there is].
    #[arg(long, value_name = "N", help_heading = PICTURE, hide_short_help = true, allow_negative_numbers = true)]
    pub(super) reference_depth: Option<u32>,
    /// Folder for index.html, data.json, data.csv and pictures [default: SCENE-chart].
    ///
    /// A sweep that was cut short goes on there.
    #[arg(short, long = "output", value_name = "DIR", help_heading = OUTPUT)]
    pub(super) output: Option<PathBuf>,
}

#[derive(clap::Args)]
#[command(mut_arg("size", |size| {
    let [width, height] = stress::SIZE;
    let help = format!("Width and height in pixels, each 1 to 16384 [default: {width}x{height}]");
    size.long_help(format!("{help}\n\nBounds and verdicts are meant for the default.")).help(help)
}))]
pub(super) struct Stress {
    /// Run this scene alone.
    #[arg(long, value_name = "NAME", help_heading = SCENE, hide_possible_values = true, long_help = about_stress_scenes(), value_parser = stress_scenes())]
    pub(super) only: Option<String>,
    #[command(flatten)]
    pub(super) machine: Machine,
    /// Folder for index.html and stress.json [default: print alone].
    ///
    /// It is made where it is missing; index.html shows every picture.
    #[arg(short, long = "output", value_name = "DIR", help_heading = OUTPUT)]
    pub(super) output: Option<PathBuf>,
}

#[derive(clap::Args)]
pub(super) struct Methods {
    /// Folder that `parhelion chart` has left; repeatable, a column for each.
    #[arg(long, value_name = "DIR", required = true)]
    pub(super) chart: Vec<PathBuf>,
    /// Folder that `parhelion stress -o` has left [default: failures are left out].
    #[arg(long, value_name = "DIR")]
    pub(super) stress: Option<PathBuf>,
    /// Page to write.
    ///
    /// Its pictures, and each chart's as .svg, go to the folder of its name without .md.
    #[arg(short, long = "output", value_name = "FILE.md", help_heading = OUTPUT, default_value = "methods.md")]
    pub(super) output: PathBuf,
}

#[derive(clap::Args)]
pub(super) struct Compare {
    /// Picture to judge, linear radiance; several are one method's, by different seeds.
    ///
    /// Of several it tells median and worst relMSE, bias ± its standard error, what is systematic, relMSE of blocks.
    #[arg(value_name = "A.exr", required = true)]
    pub(super) images: Vec<PathBuf>,
    /// Picture to judge by.
    #[arg(value_name = "REF.exr", required = true)]
    pub(super) reference: PathBuf,
    /// Layer to compare, such as indirect or depth [default: the picture].
    #[arg(long, value_name = "NAME", help_heading = PICTURE)]
    pub(super) layer: Option<String>,
    /// Write the error of each pixel as a picture.
    ///
    /// HDR-FLIP; relative error of layers that do not have three channels. Of several pictures it is that of their mean.
    #[arg(short, long = "output", value_name = "ERROR.png", help_heading = OUTPUT)]
    pub(super) output: Option<PathBuf>,
    /// Say whether all channels have the same bits, and no more.
    ///
    /// Exits with 1 where they have not.
    #[arg(long, help_heading = OUTPUT, conflicts_with_all = ["layer", "output", "json"])]
    pub(super) exact: bool,
    /// Print JSON.
    #[arg(long, help_heading = OUTPUT)]
    pub(super) json: bool,
}

#[derive(clap::Args)]
pub(super) struct Doctor {
    /// Print JSON.
    #[arg(long, help_heading = OUTPUT)]
    pub(super) json: bool,
}

#[derive(clap::Args)]
pub(super) struct Graph {
    #[command(flatten)]
    pub(super) file: SceneFile,
    /// Method whose frame is shown [default: igi].
    #[arg(long, help_heading = LIGHT, value_parser = methods())]
    pub(super) method: Option<String>,
    #[command(flatten)]
    pub(super) settings: Settings,
    /// File to write, .dot (Graphviz) or .json [default: .dot to stdout].
    #[arg(short, long = "output", value_name = "FILE", help_heading = OUTPUT)]
    pub(super) output: Option<PathBuf>,
}

#[derive(clap::Args)]
pub(super) struct Completions {
    /// Shell that reads the script.
    pub(super) shell: Shell,
}

#[derive(Clone, Copy, Default, ValueEnum)]
pub(super) enum BackendWord {
    #[default]
    Auto,
    Measure,
    RayQuery,
    Software,
}

impl From<BackendWord> for BackendChoice {
    fn from(word: BackendWord) -> Self {
        match word {
            BackendWord::Auto => Self::Auto,
            BackendWord::Measure => Self::Measure,
            BackendWord::RayQuery => Self::Force(Backend::RayQuery),
            BackendWord::Software => Self::Force(Backend::Software),
        }
    }
}

#[derive(Clone, Copy, Default, PartialEq, ValueEnum)]
pub(super) enum ProgressWord {
    #[default]
    Auto,
    Bar,
    Json,
    None,
}

fn methods() -> PossibleValuesParser {
    PossibleValuesParser::new(REGISTRY.iter().map(|method| method.name))
}

fn stress_scenes() -> PossibleValuesParser {
    PossibleValuesParser::new(stress::cases().map(|case| case.name))
}

fn presets() -> PossibleValuesParser {
    let value = |preset: &Preset| PossibleValue::new(preset.name).help(preset.about);
    PossibleValuesParser::new(PRESETS.iter().map(value))
}

/// A line for each preset, which short help has no room for.
fn about_presets() -> String {
    let lines = PRESETS.iter().map(|preset| format!("\n{}: {}", preset.name, preset.about));
    format!("Settings under one name; -D and other options win over it.\n{}", lines.collect::<String>())
}

fn about_stress_scenes() -> String {
    let names: Vec<_> = stress::cases().map(|case| case.name).collect();
    format!("Run this scene alone: {}", names.join(", "))
}

fn operators() -> PossibleValuesParser {
    PossibleValuesParser::new(Operator::ALL.iter().map(|operator| operator.name()))
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    parsed.ok_or_else(|| "expected WIDTHxHEIGHT, such as 800x600".into())
}

fn numbers<T: std::str::FromStr, const N: usize>(text: &str) -> Result<[T; N], String> {
    let parsed: Option<Vec<T>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    let expected = || format!("expected {N} numbers with commas between");
    parsed.and_then(|parsed| parsed.try_into().ok()).ok_or_else(expected)
}

fn number(text: &str) -> Result<f32, String> {
    let parsed = text.trim().parse().ok().filter(|value: &f32| value.is_finite());
    parsed.ok_or_else(|| "expected a finite number".into())
}

fn point(text: &str) -> Result<[f64; 3], String> {
    let point: [f64; 3] = numbers(text)?;
    if point.iter().all(|&value| (value as f32).is_finite()) {
        Ok(point)
    } else {
        Err("expected finite numbers".into())
    }
}

fn distance(text: &str) -> Result<f32, String> {
    let value = number(text)?;
    if value >= 0.0 { Ok(value) } else { Err("expected a distance, at least 0".into()) }
}

fn field_of_view(text: &str) -> Result<f32, String> {
    let value = number(text)?;
    if value > 0.0 && value < 180.0 { Ok(value) } else { Err("expected an angle between 0 and 180".into()) }
}

fn exposure(text: &str) -> Result<String, String> {
    if text == "auto" { Ok(text.into()) } else { number(text).map(|stops| format!("{stops:?}")) }
}

fn aov(text: &str) -> Result<Aov, String> {
    let found = Aov::ALL.iter().copied().find(|aov| aov.name() == text);
    found.ok_or_else(|| {
        let names: Vec<_> = Aov::ALL.iter().map(|aov| aov.name()).collect();
        format!("there are {}", names.join(", "))
    })
}

fn frames(text: &str) -> Result<Frames, String> {
    let expected = || {
        "expected a frame, such as 17, or two, such as 1-240, the first no later, and after a / from one to the next"
            .to_owned()
    };
    let (range, step) = text.split_once('/').unwrap_or((text, "1"));
    let (first, last) = range.split_once('-').unwrap_or((range, range));
    let [first, last, step] =
        [first, last, step].map(|word| word.parse::<u32>().ok().filter(|&frame| frame <= 100_000_000));
    let (Some(first), Some(last), Some(step)) = (first, last, step) else { return Err(expected()) };
    (first <= last && step > 0).then_some(Frames { range: first..=last, step }).ok_or_else(expected)
}

fn share(text: &str) -> Result<f64, String> {
    let parsed = text.parse().ok().filter(|share: &f64| (0.0..=1.0).contains(share));
    parsed.ok_or_else(|| "expected a share from 0 to 1, such as 0.5".into())
}

fn rate(text: &str) -> Result<f64, String> {
    let parsed = text.parse().ok().filter(|rate: &f64| (1e-3..=1e6).contains(rate));
    parsed.ok_or_else(|| "expected a number of frames a second, such as 24".into())
}

fn duration(text: &str) -> Result<Duration, String> {
    let expected = || "expected a time, such as 30s, 5m or 1h".to_owned();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match &text[digits.len()..] {
        "s" | "" => 1.0,
        "ms" => 1e-3,
        "m" => 60.0,
        "h" => 3600.0,
        _ => return Err(expected()),
    };
    let seconds = digits.parse::<f64>().map_err(|_| expected())? * unit;
    Duration::try_from_secs_f64(seconds).ok().filter(|time| !time.is_zero()).ok_or_else(expected)
}

/// Of a frame nobody expects seconds, of other times nobody milliseconds: the unit has to be there.
fn budget(text: &str) -> Result<Duration, String> {
    match text.ends_with(|c: char| c.is_ascii_alphabetic()) {
        true => duration(text),
        false => Err("expected a time with its unit, such as 16ms".into()),
    }
}

fn error(text: &str) -> Result<f64, String> {
    let parsed = text.parse().ok().filter(|value: &f64| value.is_finite() && *value > 0.0);
    parsed.ok_or_else(|| "expected a number above 0, such as 0.01".into())
}

fn tap(text: &str) -> Result<(String, PathBuf), String> {
    let split = text.split_once('=').filter(|(tap, file)| tap.contains(':') && !file.is_empty());
    split.map(|(tap, file)| (tap.into(), file.into())).ok_or_else(|| "expected PASS:RESOURCE=FILE.exr".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn options_are_declared_consistently() {
        Cli::command().debug_assert();
    }

    /// Where help states a default, it is the configuration's.
    #[test]
    fn help_states_the_defaults_there_are() {
        let config = crate::config::RenderConfig::default();
        let mut command = Cli::command();
        let help = command.find_subcommand_mut("render").unwrap().render_long_help().to_string();
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        let [width, height] = config.size;
        let graph = command.find_subcommand_mut("graph").unwrap().render_long_help().to_string();
        assert!(graph.contains(&format!("[default: {}]", config.method.name)), "{graph}");
        let stress = command.find_subcommand_mut("stress").unwrap().render_long_help().to_string();
        let [columns, rows] = stress::SIZE;
        assert!(
            stress.contains(&format!("[default: {columns}x{rows}]")) && !stress.contains("800x600"),
            "{stress}"
        );
        for (option, default) in [
            ("--size", format!("{width}x{height}")),
            ("--method", config.method.name.to_owned()),
            ("--vpls", config.vpl_shoot.vpls.to_string()),
            ("--bounces", "auto, chance ends paths".into()),
            ("--visibility", config.indirect.visibility.name().into()),
            ("--pixel-samples", config.pixel_samples.to_string()),
            ("--spp", config.path_trace.spp.to_string()),
            ("--seed", config.seed.to_string()),
            ("--tone-map", config.tone_map.operator.name().into()),
        ] {
            let rest = &help[help.find(&format!("{option} <")).unwrap()..];
            assert!(rest[..200].contains(&format!("[default: {default}]")), "{option}: {}", &rest[..200]);
        }
    }
}
