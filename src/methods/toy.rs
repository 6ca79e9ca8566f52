//! A method that is a file and a line in the list: every part of the program finds it there.

use super::method::RenderConfig;
use super::option::{CliOption, OptionGroup, OptionValue};
use super::trial::fails;
use super::{Aov, FrameInfo, Group, Layers, Method, Reach, Sweeps};
use crate::graph::Graph;
use crate::techniques::setting::{BadValue, Settings, within};
use crate::techniques::{Kernels, compose, gbuffer};
use serde::{Deserialize, Serialize};

/// Its settings.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct ToyConfig {
    /// 0 … 1.
    level: f32,
    /// At least 1.
    rounds: Option<u32>,
}

impl Default for ToyConfig {
    fn default() -> Self {
        Self { level: 0.5, rounds: None }
    }
}

impl Settings for ToyConfig {
    fn check(&self) -> Result<(), BadValue> {
        within("toy.level", self.level, 0.0..=1.0)?;
        self.rounds.map_or(Ok(()), |rounds| within("toy.rounds", rounds, 1..=8))
    }
}

/// The registry's entry.
pub(super) static METHOD: Method = Method {
    name: "toy",
    about: "albedo in place of light",
    description: "Every surface shines as it would reflect.",
    aovs: &[Aov::Albedo, Aov::Direct],
    conditional: &[],
    own: Some(Group::of::<ToyConfig>()),
    check: |_| Ok(()),
    options: &[CliOption {
        word: "--toy-level",
        key: "toy.level",
        group: OptionGroup::Light,
        rare: false,
        help: "How bright the toy is",
        more: "",
        value: OptionValue::Number("LEVEL"),
    }],
    progressive: None,
    kernels: |kernels, _| kernels,
    costless: &[],
    reach: |_| Reach { pixels: 0, cell: 1 },
    cost: |_| 1.0,
    comparable: |_, _| (),
    pane_roughness: |_| 0.0,
    sweeps: Sweeps {
        small: "
            [[sweep]]
            method = 'toy'
            toy.level = [0.25, 1]
        ",
        paper: "",
        full: "",
        probe: "
            [[sweep]]
            method = 'toy'
        ",
        finer: "",
    },
    diffuse_indirect: |_| None,
    trials: &[fails("crease", &["toy.level=1"], "nothing shades a toy")],
    record,
    asks_free_path: |_| false,
    left_out: |_, config| {
        let ToyConfig { level, .. } = config.own.get("toy");
        if level < 1.0 {
            vec![format!("a share of {} is left out (toy.level)", 1.0 - level)]
        } else {
            Vec::new()
        }
    },
};

fn record(g: &mut Graph, k: &Kernels, _: &RenderConfig, frame: &FrameInfo) -> Layers {
    let gbuffer = gbuffer::gbuffer(g, k, frame.origin, frame.extent);
    let mut layers = Layers::new(gbuffer.albedo, gbuffer);
    layers.add_made(Aov::Direct, move |g| compose::black(g, gbuffer.albedo));
    layers
}

mod tests {
    use super::*;
    use crate::chart::choose;
    use crate::chart::grid;
    use crate::common;
    use crate::docs::Measurements;
    use crate::methods::REGISTRY;
    use crate::renderer::{FrameRequest, Renderer, RendererOptions};
    use crate::scene::{SceneProfile, builtin};
    use crate::stress;

    fn toy() -> RenderConfig {
        RenderConfig { method: &METHOD, ..RenderConfig::default() }
    }

    #[test]
    fn configuration_knows_it() {
        let mut config = RenderConfig::default();
        config.apply_override("method=toy").unwrap();
        assert_eq!(config, toy());
        for (assignment, level) in [("toy.level=1", 1.0), ("toy.level = 0.25", 0.25)] {
            config.apply_override(assignment).unwrap();
            assert_eq!(config.own.get::<ToyConfig>("toy"), ToyConfig { level, rounds: None });
        }
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("toy.toml");
        std::fs::write(&file, "method = 'toy'\n[toy]\nlevel = 0.25\n").unwrap();
        assert_eq!(RenderConfig::from_toml(&file).unwrap(), config);
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(serde_json::from_str::<RenderConfig>(&text).unwrap(), config, "{text}");

        config.apply_override("toy.rounds=2").unwrap();
        assert_eq!(config.own.get::<ToyConfig>("toy").rounds, Some(2));
        config.apply_override("toy.rounds=auto").unwrap();
        assert_eq!(config.own.get::<ToyConfig>("toy").rounds, None);

        let refused = |assignment: &str| toy().apply_override(assignment).unwrap_err().to_string();
        assert_eq!(refused("toy.levle=1"), "unknown key `toy.levle`; the nearest is `toy.level`");
        assert!(refused("toy.level=high").contains("toy.level: ") && refused("toy=3").contains("toy: "));
        std::fs::write(&file, "[toy]\nlevle = 1\n").unwrap();
        assert!(RenderConfig::from_toml(&file).unwrap_err().to_string().ends_with("nearest is `toy.level`"));
        for (key, value, problem) in
            [("toy.level", "2", "2 is not within 0 … 1"), ("toy.rounds", "0", "0 is")]
        {
            let mut config = toy();
            config.apply_override(&format!("{key}={value}")).unwrap();
            let error = config.validate().unwrap_err().to_string();
            assert!(error.starts_with(&format!("{key}: {problem}")), "{error}");
        }
    }

    #[test]
    fn charts_and_the_choice_of_settings_try_it() {
        let base = RenderConfig::default();
        let labels = |settings: Vec<grid::Setting>| {
            let own = settings.into_iter().filter(|setting| setting.config.method == &METHOD);
            own.map(|setting| setting.label).collect::<Vec<_>>()
        };
        assert_eq!(labels(grid::settings("small", &base).unwrap()), ["toy level=0.25", "toy level=1"]);
        assert_eq!(labels(grid::settings("paper", &base).unwrap()), [""; 0]);
        assert_eq!(labels(choose::probed(&base, true).unwrap()), ["toy"]);
        let settings = grid::parse("[[sweep]]\nmethod='toy'\ntoy.level=1", &base).unwrap().remove(0).settings;
        assert_eq!(serde_json::json!(settings), serde_json::json!({ "method": "toy", "toy.level": 1.0 }));
        assert_eq!(grid::config(&settings, &base).unwrap().own.get::<ToyConfig>("toy").level, 1.0);
    }

    #[test]
    fn the_stress_suite_tries_it_in_every_case() {
        for case in stress::cases() {
            let own = case.variants().into_iter().filter(|variant| variant.method == &METHOD);
            let own: Vec<_> = own.map(|variant| (variant.settings, variant.known.is_some())).collect();
            let expected: (&[&str], bool) =
                if case.name == "crease" { (&["toy.level=1"], true) } else { (&[], false) };
            assert_eq!(own, [expected], "{}", case.name);
        }
    }

    #[test]
    fn docs_have_a_section_for_it() {
        let page = Measurements::read(&[], None).unwrap().page("page").unwrap().text;
        let Method { name, about, description, .. } = METHOD;
        assert!(page.contains(&format!("## {name}\n\n`--method {name}`: {about}. {description}")), "{page}");
    }

    #[test]
    fn it_draws_its_layers_and_counts_its_rays() {
        let Some((_guard, device)) = common::device() else { return };
        let scene = builtin::by_name("cornell").unwrap();
        let (camera, profile) = (scene.cameras[0].clone(), SceneProfile::of(&scene, 0.0));
        let options = RendererOptions::default();
        let mut renderer = Renderer::new(&device, scene, &options).unwrap();
        let config = RenderConfig { size: [16, 12], ..toy() };
        let request = FrameRequest { aovs: METHOD.aovs, ..FrameRequest::default() };
        let frame = renderer.render(&config, &camera, &request).unwrap();
        assert_eq!(frame.aovs[0].1, frame.beauty);
        assert!(frame.beauty.data.iter().any(|&v| v > 0.0) && frame.aovs[1].1.data.iter().all(|&v| v == 0.0));
        assert_eq!(frame.rays, 16 * 12);
        let counted: Vec<_> = frame.passes.iter().filter(|pass| pass.rays > Some(0)).collect();
        assert!(matches!(&counted[..], [pass] if pass.path == "gbuffer/primary"));
        assert_eq!((frame.vpl_count, frame.path_count, frame.samples), (None, None, None));
        let request = FrameRequest { aovs: &[Aov::Depth], ..request };
        let error = renderer.render(&config, &camera, &request).unwrap_err().to_string();
        assert_eq!(error, "method toy has no layer `depth`; there are albedo, direct");
        assert_eq!((METHOD.left_out)(&profile, &config), ["a share of 0.5 is left out (toy.level)"]);
        assert!(REGISTRY.contains(&&METHOD));
    }
}
