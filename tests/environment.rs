//! Light from all around: files that are read, mended or refused.

mod common;

use common::{gray, quad, scene, write};
use glam::Vec3;
use parhelion::scene::{Environment, LoadOptions, SceneProfile};
use std::path::Path;

#[test]
fn environments_load_or_say_why_not() {
    use parhelion::output::{Channels, Picture, write_exr};
    let folder = tempfile::tempdir().unwrap();
    let load = |file: &Path| Environment::load(file, &LoadOptions::default());
    let exr = |name: &str, names: &[&str], data: &[f32]| {
        let file = folder.path().join(name);
        let channels = vec![Channels { names: names.iter().map(ToString::to_string).collect(), data }];
        let size = [2, (data.len() / names.len() / 2) as u32];
        let picture = Picture { size, window: [0, 0, 2, size[1]], channels, attributes: Vec::new() };
        write_exr(&file, &picture).unwrap();
        file
    };
    let rgb = ["R", "G", "B"];
    let good = load(&exr("good.exr", &rgb, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])).unwrap().0;
    assert_eq!((good.width, good.height), (2, 1));
    assert_eq!(good.texels, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]);
    let grey = load(&exr("grey.exr", &["Y"], &[7.0, 8.0])).unwrap().0;
    assert_eq!(grey.texels, [Vec3::splat(7.0), Vec3::splat(8.0)]);

    // Radiance's shared exponent, without run lengths: 2 × 1 texels of (1, 0.5, 0) and (64, 128, 0).
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".to_vec();
    bytes.extend([128, 64, 0, 129, 64, 128, 0, 136]);
    let file = write(folder.path(), "sky.hdr", &bytes);
    let (sky, notes) = load(&file).unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    assert_eq!(sky.texels, [Vec3::new(1.0, 0.5, 0.0), Vec3::new(64.0, 128.0, 0.0)]);

    // Programs write another signature, and keys of their own.
    let other = [b"#?RGBE\n# made by hand\nGAMMA 1\n".as_slice(), &bytes["#?RADIANCE\n".len()..]].concat();
    assert_eq!(load(&write(folder.path(), "rgbe.hdr", &other)).unwrap().0.texels, sky.texels);

    // What has no brightness is mended, counted, and refused where nothing may be mended.
    let odd = exr("odd.exr", &rgb, &[1.0, -2.0, f32::INFINITY, 4.0, 5.0, f32::NEG_INFINITY]);
    let (mended, notes) = load(&odd).unwrap();
    assert_eq!(mended.texels, [Vec3::new(1.0, 0.0, 5.0), Vec3::new(4.0, 5.0, 0.0)]);
    assert_eq!(
        notes,
        ["environment texel (0, 0): it is negative: [1, -2, inf]; taken as 0 (and in 1 more places)",]
    );
    let strict = LoadOptions { strict: true, ..LoadOptions::default() };
    let refused = Environment::load(&odd, &strict).unwrap_err().to_string();
    assert!(
        refused.ends_with("odd.exr: environment texel (0, 0): it is negative: [1, -2, inf]"),
        "{refused}"
    );

    // +X in the middle, −X at both edges; +Z right of the middle.
    let around = Environment {
        name: "around".into(),
        width: 4,
        height: 1,
        texels: [1.0, 2.0, 3.0, 4.0].map(Vec3::splat).to_vec(),
    };
    let at = |direction: Vec3| around.radiance(direction).x;
    assert!((at(Vec3::X) - 2.5).abs() < 1e-6 && (at(Vec3::NEG_X) - 2.5).abs() < 1e-6);
    assert!((at(Vec3::Z) - 3.5).abs() < 1e-6 && (at(Vec3::NEG_Z) - 1.5).abs() < 1e-6);

    let fails = |file: &Path, words: &[&str]| {
        let error = load(file).expect_err("it is broken").to_string();
        for word in [file.to_str().unwrap(), "environment"].iter().chain(words) {
            assert!(error.contains(word), "`{error}` lacks `{word}`");
        }
    };
    fails(&exr("nan.exr", &rgb, &[1.0, 2.0, 3.0, 4.0, f32::NAN, 6.0]), &["texel (1, 0)", "not finite"]);
    fails(&exr("bright.exr", &rgb, &[1.0, 2.0, 3e38, 4.0, 5.0, 6.0]), &["texel (0, 0)", "above 1e24"]);
    fails(&exr("blazing.exr", &rgb, &[f32::INFINITY; 6]), &["texel (0, 0)", "no other shines"]);
    fails(&exr("depth.exr", &["Z"], &[1.0, 2.0]), &["channels"]);
    fails(&write(folder.path(), "cut.hdr", &bytes[..bytes.len() - 4]), &["can't be decoded"]);
    fails(&write(folder.path(), "cut.exr", b"v/1"), &["can't be decoded"]);
    let huge = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16000 +X 16000\n";
    fails(&write(folder.path(), "huge.hdr", huge), &["16000×16000"]);
    fails(&write(folder.path(), "sky.png", &bytes), &["neither .exr nor .hdr"]);
    fails(&folder.path().join("absent.exr"), &["can't be read"]);
}

#[test]
fn scenes_have_only_light_that_can_be() {
    let mut scene = scene(vec![quad(Vec3::ZERO, Vec3::X, Vec3::Y, 0)], vec![gray(0.5)]);
    scene.environment = Some(Environment::constant(Vec3::ONE).into());
    assert!(scene.validate().is_ok() && SceneProfile::of(&scene, 0.1).environment);
    for radiance in [-1.0, f32::NAN, 3e38] {
        scene.environment = Some(Environment::constant(Vec3::splat(radiance)).into());
        assert_eq!(scene.validate().unwrap_err().element, "environment", "{radiance}");
    }
}
