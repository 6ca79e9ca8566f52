//! Every method on every stress scene, in software: it fails where it is known to and nowhere else.

mod common;

use parhelion::ErrorClass;
use parhelion::methods::REGISTRY;
use parhelion::renderer::BackendChoice;
use parhelion::stress::data::{Row, Stress, Verdict};
use parhelion::stress::{self, Options, Variant};
use parhelion::vk::Backend;
use std::collections::BTreeSet;
use std::process::Command;

const SOFTWARE: Options<'_> = Options {
    only: None,
    backend: BackendChoice::Force(Backend::Software),
    size: None,
    seed: 0,
    cancel: None,
    progress: None,
};

#[test]
fn every_case_tries_every_method_once_for_each_setting() {
    let names: Vec<_> = stress::cases().map(|case| case.name).collect();
    assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len(), "{names:?}");
    for case in stress::cases() {
        for method in REGISTRY {
            let tried = |variant: &&Variant| variant.method.name == method.name;
            assert!(case.variants().iter().any(|v| tried(&v)), "{} in {}", method.name, case.name);
        }
        let settings = |variant: &Variant| (variant.method.name, variant.settings);
        let distinct: BTreeSet<_> = case.variants().iter().map(settings).collect();
        assert_eq!(distinct.len(), case.variants().len(), "{}", case.name);
    }
}

#[test]
fn methods_fail_where_they_are_known_to_and_nowhere_else() {
    let Some((_guard, device)) = common::device() else { return };
    let stress = stress::run(&device, &SOFTWARE).unwrap();
    let unexpected = |row: &&Row| match row.verdict {
        Verdict::Holds => row.known.is_some(),
        Verdict::FailsAsKnown => false,
        Verdict::Fails => true,
    };
    let rows: Vec<_> = stress.rows.iter().filter(unexpected).map(line).collect();
    assert!(rows.is_empty(), "not as known:\n{}", rows.join("\n"));

    // A verdict is a number and a bound, and has its pictures.
    let variants: usize = stress::cases().map(|case| case.variants().len()).sum();
    assert_eq!(stress.rows.len(), variants);
    for row in &stress.rows {
        assert!(row.value.is_some(), "{}", line(row));
        assert!(
            !row.images.is_empty() && row.images.iter().all(|shown| stress.images.contains_key(&shown.key))
        );
    }
    let keys: BTreeSet<_> = stress.rows.iter().flat_map(|row| &row.images).map(|shown| &shown.key).collect();
    assert_eq!(keys.len(), stress.images.len(), "every picture is shown, none twice");

    // m = ½·√(24 m²/180), ΣL = 24 m, A = 24 m². The walls get less light at the edges than in their middle, so less
    // than what evenly lit ones lose.
    let lost = stress
        .rows
        .iter()
        .find(|row| row.scene == "clamp" && row.setting == "preset=paper-canonical")
        .unwrap();
    let evenly = 4.0 / (3.0 * std::f64::consts::PI) * 0.5 * (24.0_f64 / 180.0).sqrt();
    let share = lost.value.unwrap() / evenly;
    assert!((0.5..1.0).contains(&share), "{share} of the loss between evenly lit walls");
}

#[test]
fn one_case_alone_is_that_case_and_sizes_and_seeds_are_its_own() {
    let Some((_guard, device)) = common::device() else { return };
    let run = |size, seed| {
        let options = Options { only: Some("crease"), size, seed, ..SOFTWARE };
        stress::run(&device, &options).unwrap()
    };
    let plain = run(None, 0);
    assert!(!plain.rows.is_empty() && plain.rows.iter().all(|row| row.scene == "crease"));
    assert_eq!(plain, run(Some(stress::SIZE), 0));
    assert_ne!(plain.rows[0].value, run(None, 1).rows[0].value);
    assert_ne!(plain.images, run(Some([16, 16]), 0).images);
    let none = stress::run(&device, &Options { only: Some("no such case"), ..SOFTWARE }).unwrap();
    assert!(none.rows.is_empty());
    let error = stress::run(&device, &Options { size: Some([0, 1]), ..SOFTWARE }).unwrap_err();
    assert_eq!(error.class(), ErrorClass::Input);
}

// ---- the command ----

fn parhelion(args: &[&str]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_parhelion")).arg("stress").args(args).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

#[test]
fn the_command_writes_page_and_numbers() {
    let Some((_guard, _device)) = common::device() else { return };
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("page");
    let words = ["--only", "caustic", "--backend", "software", "-o"];
    let (code, text, errors) = parhelion(&[&words[..], &[out.to_str().unwrap()]].concat());
    assert_eq!(code, 0, "known failures are none: {errors}");
    assert!(text.contains("fails as known") && text.contains("2 fail as known, 0 fail"), "{text}");
    let numbers = std::fs::read_to_string(out.join("stress.json")).unwrap();
    let read: Stress = serde_json::from_str(&numbers).unwrap();
    assert_eq!((read.rows.len(), read.images.len(), read.backend.as_str()), (4, 0, "software"));
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains("data:image/png;base64,") && page.contains("caustic"));

    let (code, text, _) = parhelion(&[&words[..], &[out.to_str().unwrap(), "-q"]].concat());
    assert_eq!((code, text.as_str()), (0, ""));
}

#[test]
fn bad_input_is_refused_before_anything_is_rendered() {
    let file = tempfile::NamedTempFile::new().unwrap();
    for (args, expected) in [
        (&["--only", "creese"][..], "crease"),
        (&["--size", "0x4"], "--size"),
        (&["-o", file.path().to_str().unwrap()], "a file"),
        (&["-o", "/nonexistent/page"], "/nonexistent/page"),
    ] {
        let (code, _, errors) = parhelion(args);
        assert_eq!(code, 2, "{args:?}: {errors}");
        assert!(errors.contains(expected), "{args:?}: {errors}");
    }
}

fn line(row: &Row) -> String {
    let Row { scene, method, setting, number, value, bound, .. } = row;
    format!("{scene}: {method} {setting}: {number} is {value:?}, expected {bound}; known: {:?}", row.known)
}
