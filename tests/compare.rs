//! `parhelion compare`, as a user meets it. No device is needed.

use parhelion::metrics;
use parhelion::output::{Attribute, Channels, Picture, write_exr};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

const SIZE: [u32; 2] = [20, 16];

fn compare(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_parhelion"));
    command.arg("compare").args(args).current_dir(folder).env("VK_DRIVER_FILES", "/nonexistent");
    command.output().unwrap()
}

/// Three channels that follow a formula, at `gain` times its light, and a layer of depth.
fn write(file: &Path, size: [u32; 2], gain: f32, change: impl Fn(&mut [f32])) -> Vec<f32> {
    let count = (size[0] * size[1]) as usize;
    let mut beauty: Vec<f32> = (0..3 * count).map(|i| gain * (0.2 + (i % 97) as f32 / 40.0)).collect();
    change(&mut beauty);
    let depth: Vec<f32> = (0..count).map(|i| gain * (1.0 + i as f32)).collect();
    let channels = vec![
        Channels { names: ["R", "G", "B"].map(String::from).into(), data: &beauty },
        Channels { names: vec!["Z".into()], data: &depth },
    ];
    let window = [0, 0, size[0], size[1]];
    write_exr(file, &Picture { size, window, channels, attributes: Vec::new() }).unwrap();
    beauty
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn json(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn every_measure_is_the_librarys() {
    let folder = tempfile::tempdir().unwrap();
    let a = write(&folder.path().join("a.exr"), SIZE, 1.1, |_| {});
    let b = write(&folder.path().join("b.exr"), SIZE, 1.0, |_| {});
    let report = json(&compare(folder.path(), &["a.exr", "b.exr", "--json", "-o", "error.png"]));
    assert_eq!(report["channels"], serde_json::json!(["R", "G", "B"]));
    let (errors, map) = metrics::errors(&a, &b, SIZE[0] as usize, 3);
    assert_eq!(report["errors"], serde_json::to_value(&errors).unwrap());
    assert!((errors.signed_bias - 0.1).abs() < 1e-6 && errors.rel_mse < 0.01);

    let mut reader = png::Decoder::new(std::io::BufReader::new(
        std::fs::File::open(folder.path().join("error.png")).unwrap(),
    ))
    .read_info()
    .unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    let expected = map.unwrap().map.into_iter().flat_map(parhelion::output::magma);
    assert!(pixels.iter().copied().eq(expected));
    assert!(reader.info().uncompressed_latin1_text.iter().any(|t| t.text.contains("HDR-FLIP")));

    let text = stdout(&compare(folder.path(), &["a.exr", "b.exr", "-o", "error.png"]));
    for word in
        ["relMSE", "trimmed", "blocks", "MAPE", "SMAPE", "+10.000 %", "PSNR", "SSIM", "HDR-FLIP", "error.png"]
    {
        assert!(text.contains(word), "{word}: {text}");
    }
    let same = json(&compare(folder.path(), &["b.exr", "b.exr", "--json"]));
    assert_eq!((&same["errors"]["rel_mse"], &same["errors"]["flip"]), (&0.0.into(), &0.0.into()));
    assert_eq!((&same["errors"]["ssim"], &same["errors"]["psnr"]), (&1.0.into(), &Value::Null));
}

#[test]
fn pictures_of_several_seeds_are_stated_together() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let truth = write(&file("ref.exr"), SIZE, 1.0, |_| {});
    let pictures = [0.7_f32, 0.9, 0.8].map(|gain| {
        let name = format!("{gain}.exr");
        (write(&file(&name), SIZE, gain, |_| {}), name)
    });
    let names: Vec<&str> = pictures.iter().map(|(_, name)| name.as_str()).collect();
    let args = [&names[..], &["ref.exr"]].concat();
    let report = json(&compare(folder.path(), &[&args[..], &["--json", "-o", "error.png"]].concat()));
    assert_eq!(report["images"], serde_json::json!(names));
    let mut seeds = metrics::Seeds::new(&truth, SIZE[0] as usize, 3);
    pictures.iter().for_each(|(image, _)| seeds.add(image));
    let errors = seeds.errors(&metrics::ReferenceNoise::default()).unwrap();
    assert_eq!(report["over_seeds"], serde_json::to_value(errors).unwrap());
    assert_eq!(report["reference_noise"], Value::Null);
    assert!((errors.bias + 0.2).abs() < 1e-6 && errors.rel_mse_worst > 2.0 * errors.rel_mse);
    // The third is the mean of all, and so is its error's picture.
    assert_eq!(std::fs::read(file("error.png")).unwrap(), {
        compare(folder.path(), &["0.8.exr", "ref.exr", "-o", "mean.png"]);
        std::fs::read(file("mean.png")).unwrap()
    });
    let text = stdout(&compare(folder.path(), &args));
    assert!(text.starts_with("3 seeds: relMSE 0.0") && text.lines().count() == 1, "{text}");
    for word in ["worst 0.0", "bias -20.000 % ± 5.774 %", "systematic 0.0", "blocks 0.0"] {
        assert!(text.contains(word), "{word}: {text}");
    }

    // A reference that holds its halves tells its own noise.
    let half = |sign: f32| truth.iter().enumerate().map(move |(i, r)| r + sign * [0.1, -0.1][i / 3 % 2]);
    let halves = [1.0, -1.0].map(|sign| half(sign).collect::<Vec<f32>>());
    let names = ["", "half_a.", "half_b."].map(|half| ["R", "G", "B"].map(|c| format!("{half}{c}")).to_vec());
    let data = [&truth, &halves[0], &halves[1]];
    let channels = names.into_iter().zip(data).map(|(names, data)| Channels { names, data }).collect();
    let attributes = vec![("parhelion:reference", Attribute::Text("paths".into()))];
    let picture = Picture { size: SIZE, window: [0, 0, SIZE[0], SIZE[1]], channels, attributes };
    write_exr(&file("ref.exr"), &picture).unwrap();
    let noise = metrics::ReferenceNoise::of(&halves[0], &truth, SIZE[0] as usize, 3);
    let report = json(&compare(folder.path(), &[&args[..], &["--json"]].concat()));
    let errors = seeds.errors(&noise).unwrap();
    assert_eq!(report["over_seeds"], serde_json::to_value(errors).unwrap());
    assert_eq!(report["reference_noise"], serde_json::to_value(noise).unwrap());
    assert!(
        noise.rel_mse > 0.0 && stdout(&compare(folder.path(), &args)).contains("the reference's own noise")
    );
}

#[test]
fn layers_are_found_by_the_names_of_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder.path().join("a.exr"), SIZE, 0.9, |_| {});
    write(&folder.path().join("b.exr"), SIZE, 1.0, |_| {});
    for layer in ["depth", "Z"] {
        let args = ["a.exr", "b.exr", "--json", "--layer", layer, "-o", "error.png"];
        let report = json(&compare(folder.path(), &args));
        assert_eq!(report["channels"], serde_json::json!(["Z"]));
        assert!((report["errors"]["signed_bias"].as_f64().unwrap() + 0.1).abs() < 1e-6);
        assert_eq!(report["errors"]["flip"], Value::Null);
    }
}

#[test]
fn exact_comparison_sees_one_bit() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    write(&file("a.exr"), SIZE, 1.0, |_| {});
    write(&file("same.exr"), SIZE, 1.0, |_| {});
    write(&file("other.exr"), SIZE, 1.0, |beauty| beauty[7] = f32::from_bits(beauty[7].to_bits() ^ 1));
    let exact = |other: &str| compare(folder.path(), &["--exact", "a.exr", other]);
    assert_eq!(stdout(&exact("same.exr")), "the same bits in 4 channels\n");
    let output = exact("other.exr");
    assert_eq!(output.status.code(), Some(1));
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(error, "error: a.exr: channel G differs from other.exr in 1 pixels\n");
    // Of several each is asked.
    let output = compare(folder.path(), &["--exact", "a.exr", "other.exr", "same.exr"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("other.exr: channel G differs from same.exr"));
}

#[test]
fn what_cannot_be_compared_is_refused_by_file_thing_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    write(&file("good.exr"), SIZE, 1.0, |_| {});
    write(&file("wide.exr"), [21, 16], 1.0, |_| {});
    // Pixel 7, 5, green; and one more.
    let nan = |data: &mut [f32]| data[3 * (5 * 20 + 7) + 1] = f32::NAN;
    write(&file("nan.exr"), SIZE, 1.0, nan);
    let infinite = |data: &mut [f32]| data[3 * (2 * 20 + 1)..][..6].fill(f32::INFINITY);
    write(&file("inf.exr"), SIZE, 1.0, infinite);
    let grey = vec![0.5; 320];
    let channels = vec![Channels { names: vec!["Y".into()], data: &grey }];
    let picture = Picture { size: SIZE, window: [0, 0, 20, 16], channels, attributes: Vec::new() };
    write_exr(&file("grey.exr"), &picture).unwrap();
    let part = vec![0.5; 3 * 64];
    let channels = vec![Channels { names: ["R", "G", "B"].map(String::from).into(), data: &part }];
    let picture = Picture { size: SIZE, window: [4, 4, 12, 12], channels, attributes: Vec::new() };
    write_exr(&file("part.exr"), &picture).unwrap();
    std::fs::write(file("text.exr"), "no picture").unwrap();
    for (args, words) in [
        (&["good.exr", "wide.exr"][..], &["good.exr: 20x16", "wide.exr has 21x16"][..]),
        (&["part.exr", "good.exr"], &["part.exr", "[4, 4, 12, 12]", "[0, 0, 20, 16]"]),
        (&["nan.exr", "good.exr"], &["nan.exr: channel G is NaN at pixel 7,5"]),
        (&["good.exr", "nan.exr"], &["nan.exr: channel G is NaN at pixel 7,5"]),
        (&["inf.exr", "good.exr"], &["inf.exr: channel R is inf at pixel 1,2, the first of 2"]),
        (&["good.exr", "grey.exr"], &["grey.exr: no channel R, which good.exr has; there are Y"]),
        (&["grey.exr", "good.exr"], &["grey.exr: no channels R, G and B", "there are Y"]),
        (
            &["good.exr", "good.exr", "--layer", "albedo"],
            &["--layer", "no layer albedo", "there are B, G, R, Z"],
        ),
        (&["good.exr", "wide.exr", "good.exr"], &["wide.exr: 21x16", "good.exr has 20x16"]),
        (&["good.exr", "nan.exr", "good.exr"], &["nan.exr: channel G is NaN at pixel 7,5"]),
        (&["good.exr", "grey.exr", "good.exr"], &["grey.exr: no channel R, which good.exr has"]),
        (&["text.exr", "good.exr"], &["text.exr"]),
        (&["good.exr", "gone.exr"], &["gone.exr"]),
        (&["good.exr", "good.exr", "-o", "e.jpg"], &["e.jpg", ".png"]),
        (&["good.exr", "good.exr", "-o", "gone/e.png"], &["gone/e.png"]),
        (&["good.exr"], &["REF.exr"]),
    ] {
        let output = compare(folder.path(), args);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert!(words.iter().all(|word| message.contains(word)), "{args:?}: {message}");
        assert!(message.starts_with("error: ") && output.stdout.is_empty(), "{args:?}: {message}");
    }
}
