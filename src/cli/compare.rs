//! `parhelion compare`.

use super::args::Compare;
use super::failure::{Failure, input};
use super::print::print;
use crate::ErrorClass;
use crate::chart;
use crate::metrics::{self, Errors, FlipMap, ReferenceNoise, SeedErrors, Seeds};
use crate::output::{self, ReadPicture, extension, magma};
use crate::text;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

pub(super) fn run(args: &Compare) -> Result<(), Failure> {
    if let Some(file) = &args.output {
        if extension(file).as_deref() != Some("png") {
            return Err(input!("{}: the error picture is written as .png", file.display()));
        }
        output::check_writable(file).map_err(Failure::input)?;
    }
    let reference = read(&args.reference)?;
    if args.exact {
        return args
            .images
            .iter()
            .try_for_each(|file| exact(file, &fitting(file, &reference, args)?, args, &reference));
    }
    let (first, more) = args.images.split_first().ok_or_else(|| input!("no picture"))?;
    let image = fitting(first, &reference, args)?;
    let names = channels(&image, first, args.layer.as_deref())?;
    let pixels = |picture: &ReadPicture, file: &Path| {
        if let Some(name) = names.iter().find(|name| !picture.channels.contains_key(**name)) {
            let (file, first) = (file.display(), first.display());
            return Err(input!("{file}: no channel {name}, which {first} has; {}", there(picture)));
        }
        finite(picture, file, &names)?;
        Ok::<_, Failure>(picture.interleaved(&names).unwrap_or_default())
    };
    let truth = pixels(&reference, &args.reference)?;
    let width = (image.window[2] - image.window[0]) as usize;
    let mut a = pixels(&image, first)?;
    let (mut text, map) = if more.is_empty() {
        let (errors, map) = metrics::errors(&a, &truth, width, names.len());
        let told = [("errors", json!(errors))];
        (if args.json { json(args, &image, &names, &told) } else { table(&errors) }, map)
    } else {
        let mut seeds = Seeds::new(&truth, width, names.len());
        seeds.add(&a);
        for file in more {
            seeds.add(&pixels(&fitting(file, &reference, args)?, file)?);
        }
        a = seeds.mean();
        let halves = chart::reference::halves(&reference).filter(|_| args.layer.is_none());
        let noise = halves.map(|[half, _]| ReferenceNoise::of(&half, &truth, width, names.len()));
        let errors = seeds.errors(&noise.unwrap_or_default()).ok_or_else(|| input!("no picture"))?;
        let told = [("over_seeds", json!(errors)), ("reference_noise", json!(noise))];
        let text = if args.json {
            json(args, &image, &names, &told)
        } else {
            line(args.images.len(), &errors, noise.as_ref())
        };
        (text, (args.output.is_some() && names.len() == 3).then(|| metrics::flip(&a, &truth, width)))
    };
    if let Some(file) = &args.output {
        let (what, map) = match map {
            Some(FlipMap { map }) => ("HDR-FLIP", map),
            None => ("relative error", metrics::relative_errors(&a, &truth, names.len())),
        };
        let mapping = format!("{what} from 0 to 1 in the colours of magma");
        let pixels: Vec<u8> = map
            .iter()
            .flat_map(|&error| {
                let [r, g, b] = magma(error);
                [r, g, b, u8::MAX]
            })
            .collect();
        let texts = [("Software", output::SOFTWARE.to_owned()), ("Error", mapping.clone())];
        output::write_png(file, width as u32, &pixels, &texts)?;
        if !args.json {
            let _ = writeln!(text, "{}: {mapping}", text::path(file));
        }
    }
    print(&text)
}

/// A picture of the reference's size and window.
fn fitting(path: &Path, reference: &ReadPicture, args: &Compare) -> Result<ReadPicture, Failure> {
    let image = read(path)?;
    let (file, other) = (path.display(), args.reference.display());
    let size = |[width, height]: [u32; 2]| format!("{width}x{height} pixels");
    if image.size != reference.size {
        return Err(input!("{file}: {}, {other} has {}", size(image.size), size(reference.size)));
    }
    if image.window != reference.window {
        let (there, here) = (image.window, reference.window);
        return Err(input!("{file}: holds the window {there:?}, {other} {here:?} (x0, y0, x1, y1)"));
    }
    Ok(image)
}

/// Fails where a channel is missing or differs in a bit; what the files say about themselves may differ.
fn exact(file: &Path, image: &ReadPicture, args: &Compare, reference: &ReadPicture) -> Result<(), Failure> {
    let (file, other) = (file.display(), args.reference.display());
    let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    for name in image.channels.keys().chain(reference.channels.keys()) {
        let differ = match (image.channels.get(name), reference.channels.get(name)) {
            (Some(a), Some(b)) => bits(a).into_iter().zip(bits(b)).filter(|(a, b)| a != b).count(),
            (Some(_), None) => return Err(input!("{other}: no channel {name}, which {file} has")),
            _ => return Err(input!("{file}: no channel {name}, which {other} has")),
        };
        if differ > 0 {
            let error = anyhow::anyhow!("{file}: channel {name} differs from {other} in {differ} pixels");
            return Err(Failure { class: ErrorClass::Other, error });
        }
    }
    print(&format!("the same bits in {} channels\n", image.channels.len()))
}

fn read(file: &Path) -> Result<ReadPicture, Failure> {
    output::read_exr(file).map_err(|error| match error.class() {
        ErrorClass::Memory => error.into(),
        _ => Failure::input(error),
    })
}

/// The channels of a layer in order, or of the picture itself.
fn channels<'a>(picture: &'a ReadPicture, file: &Path, layer: Option<&str>) -> Result<Vec<&'a str>, Failure> {
    let has = |name: &String| picture.channels.get_key_value(name).map(|(name, _)| name.as_str());
    let prefix = layer.map_or(String::new(), |layer| format!("{layer}."));
    for suffixes in ["R G B", "X Y Z", "Y", "Z"] {
        let found: Option<Vec<_>> =
            suffixes.split(' ').map(|suffix| has(&format!("{prefix}{suffix}"))).collect();
        if let Some(found) = found.filter(|_| layer.is_some() || suffixes == "R G B") {
            return Ok(found);
        }
    }
    // A layer of one channel that is named by itself, such as Z; depth is its name on the command line.
    let alone = layer
        .and_then(|layer| has(&layer.to_owned()).or_else(|| has(&"Z".into()).filter(|_| layer == "depth")));
    alone.map(|name| vec![name]).ok_or_else(|| {
        let file = file.display();
        match layer {
            Some(layer) => input!("--layer: {file}: no layer {layer}; {}", there(picture)),
            None => input!("{file}: no channels R, G and B (--layer names others); {}", there(picture)),
        }
    })
}

fn there(picture: &ReadPicture) -> String {
    let names: Vec<_> = picture.channels.keys().map(String::as_str).collect();
    format!("there are {}", names.join(", "))
}

/// Refuses what no error can be measured of.
fn finite(picture: &ReadPicture, file: &Path, names: &[&str]) -> Result<(), Failure> {
    let [x0, y0, x1, _] = picture.window;
    for name in names {
        let values = &picture.channels[*name];
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            let width = (x1 - x0) as usize;
            let (x, y) = (x0 as usize + index % width, y0 as usize + index / width);
            let count = values.iter().filter(|value| !value.is_finite()).count();
            let more = if count == 1 { String::new() } else { format!(", the first of {count}") };
            let what = values[index];
            return Err(input!("{}: channel {name} is {what} at pixel {x},{y}{more}", file.display()));
        }
    }
    Ok(())
}

fn table(errors: &Errors) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "{name:<10}{value}");
    };
    line("relMSE", format!("{:.6}", errors.rel_mse));
    line("  trimmed", format!("{:.6} (without the largest 0.1 % of its terms)", errors.rel_mse_trimmed));
    line(
        "  blocks",
        format!("{:.6} (of means of blocks of {1}x{1} pixels)", errors.rel_mse_blocks, metrics::BLOCK),
    );
    line("MAPE", format!("{:.3} %", 100.0 * errors.mape));
    line("SMAPE", format!("{:.3} %", 100.0 * errors.smape));
    line("bias", format!("{:+.3} %", 100.0 * errors.signed_bias));
    line("PSNR", format!("{:.2} dB (peak {})", errors.psnr, errors.peak));
    if let Some(ssim) = errors.ssim {
        line("SSIM", format!("{ssim:.5}"));
    }
    if let Some(flip) = errors.flip {
        line("HDR-FLIP", format!("{flip:.5}"));
    }
    text
}

/// How the error of a method is stated, as one line.
fn line(count: usize, errors: &SeedErrors, noise: Option<&ReferenceNoise>) -> String {
    let SeedErrors { rel_mse, rel_mse_worst, rel_mse_blocks, .. } = errors;
    let percent = |share: f64| format!("{:.3} %", 100.0 * share);
    let mut text = format!(
        "{count} seeds: relMSE {rel_mse:.6} (worst {rel_mse_worst:.6}), bias {}{}",
        if errors.bias < 0.0 { "" } else { "+" },
        percent(errors.bias)
    );
    if let Some(se) = errors.bias_se {
        let _ = write!(text, " ± {}", percent(se));
    }
    if let (Some(systematic), Some(of_mean)) = (errors.systematic, errors.rel_mse_of_mean) {
        let _ = write!(text, ", systematic {systematic:.6} (mean of seeds {of_mean:.6})");
    }
    let _ = write!(text, ", blocks {rel_mse_blocks:.6}");
    if let Some(ReferenceNoise { rel_mse, bias_se, .. }) = noise {
        let _ = write!(
            text,
            "; the reference's own noise, relMSE {rel_mse:.6}, is taken off, its bias ± {}",
            percent(*bias_se)
        );
    }
    text.push('\n');
    text
}

fn json(args: &Compare, image: &ReadPicture, names: &[&str], found: &[(&str, Value)]) -> String {
    let path = |file: &PathBuf| file.display().to_string();
    let mut object = json!({ "parhelion": env!("CARGO_PKG_VERSION") });
    match &args.images[..] {
        [image] => object["image"] = path(image).into(),
        images => object["images"] = images.iter().map(path).collect(),
    }
    object["reference"] = path(&args.reference).into();
    object["size"] = json!(image.size);
    object["window"] = json!(image.window);
    object["channels"] = json!(names);
    for (key, value) in found {
        object[*key] = value.clone();
    }
    format!("{}\n", text::json(&format!("{object:#}")))
}
