//! What a still scene costs: frames' passes, memory and specialization constants, and all kernels, as listed in `still.txt`.
//! Whoever adds what a still scene does not need sees here that it pays nothing; whoever changes what it does need writes the
//! list anew, by `PARHELION_STILL=write cargo test --test still`, and sees in the change how much else that touched.

mod common;

use parhelion::config::{PRESETS, RenderConfig};
use parhelion::graph::Typical;
use parhelion::renderer;
use parhelion::scene::builtin;
use parhelion::shaders;
use parhelion::vk::Backend;
use std::fmt::Write;
use std::path::Path;

/// FNV-1a, 64 bits.
fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// One line a scene and setting.
fn plans() -> String {
    let mut list = String::new();
    for name in ["cornell", "office", "conference", "prism", "pane"] {
        let scene = builtin::by_name(name).unwrap();
        let mut configs = vec![("igi", RenderConfig::default()), ("path", RenderConfig::default())];
        configs[1].1.apply_override("method=path").unwrap();
        for preset in PRESETS {
            let mut config = RenderConfig::default();
            config.apply_preset(preset.name).unwrap();
            configs.push((preset.name, config));
        }
        for (setting, config) in configs {
            let plan = renderer::plan(&scene, &config, &[], &Typical).unwrap();
            let mut passes = String::new();
            for pass in &plan.passes {
                let (path, constants) = (&pass.path, &pass.constants);
                writeln!(passes, "{path} {:?} {:?} {constants:?}", pass.shader, pass.groups).unwrap();
            }
            let (count, bytes) = (plan.passes.len(), plan.transient_bytes);
            let passes = hash(passes.as_bytes());
            writeln!(list, "{name} {setting}: {count} passes {passes:016x}, {bytes} bytes").unwrap();
        }
    }
    list
}

/// One line a kernel and backend that it differs by.
fn kernels() -> String {
    let mut list = String::new();
    for code in shaders::ALL.iter().filter(|code| !code.name.starts_with("test/")) {
        let [software, ray_query] = [Backend::Software, Backend::RayQuery].map(|b| code.module(b).unwrap());
        let digest = |words: &[u32]| hash(bytemuck::cast_slice(words));
        write!(list, "{} {:016x}", code.name, digest(software)).unwrap();
        if software != ray_query {
            write!(list, " {:016x}", digest(ray_query)).unwrap();
        }
        list.push('\n');
    }
    list
}

fn differences(known: &str, found: &str) -> String {
    let only = |some: &str, others: &str, sign: char| -> String {
        let others: Vec<&str> = others.lines().collect();
        some.lines().filter(|line| !others.contains(line)).map(|line| format!("{sign} {line}\n")).collect()
    };
    only(known, found, '-') + &only(found, known, '+')
}

#[test]
fn a_still_scene_costs_what_is_listed() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/still.txt");
    // Compilers make other code of the same kernels.
    let compiler = format!("compiler {:08x}", shaders::ALL[0].module(Backend::Software).unwrap()[2]);
    if std::env::var("PARHELION_STILL").is_ok_and(|word| word == "write") {
        std::fs::write(file, format!("{}\n{compiler}\n{}", plans(), kernels())).unwrap();
        return;
    }
    let known = std::fs::read_to_string(file).unwrap();
    let (known_plans, known_kernels) = known.split_once("\n\n").unwrap();
    let renew = "PARHELION_STILL=write cargo test --test still";
    let differ = differences(known_plans, plans().trim_end());
    assert!(differ.is_empty(), "frames of still scenes have changed; if they should have: {renew}\n{differ}");
    let (known_compiler, known_kernels) = known_kernels.split_once('\n').unwrap();
    if known_compiler != compiler {
        common::require(
            "shaderc",
            false,
            &format!("kernels are listed as of {known_compiler}, not {compiler}"),
        );
        return;
    }
    let differ = differences(known_kernels, &kernels());
    assert!(differ.is_empty(), "kernels have changed; if they should have: {renew}\n{differ}");
}
