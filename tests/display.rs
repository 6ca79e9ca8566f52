//! From linear radiance to pictures for screens: tone mapping, glare, denoising.

mod common;

use parhelion::config::RenderConfig;
use parhelion::graph::{Executor, Graph, ImageDesc, RunOptions, Typical};
use parhelion::methods::{igi, path};
use parhelion::renderer::{self, FrameRequest, Preview, Renderer, RendererOptions};
use parhelion::scene::builtin;
use parhelion::techniques::glare::{self, GlareConfig};
use parhelion::techniques::tone_map::{self, Operator, ToneMapConfig};
use parhelion::vk::{Backend, Device, Format};
use std::cell::RefCell;
use std::time::Duration;

type Texels = Vec<[f32; 4]>;

fn image(g: &mut Graph, size: [u32; 2], texels: &Texels) -> parhelion::graph::Res<parhelion::graph::Image> {
    let image = g.image("radiance", ImageDesc::new(size, Format::Rgba32Float));
    g.upload_image("radiance", image, bytemuck::cast_slice(texels).to_vec());
    image
}

fn shown(device: &Device, config: &ToneMapConfig, texels: &Texels) -> Vec<[u8; 4]> {
    let mut g = Graph::new();
    let radiance = image(&mut g, [texels.len() as u32, 1], texels);
    let exposure = tone_map::exposure(&mut g, config, radiance);
    let display = tone_map::tone_map(&mut g, config, radiance, exposure);
    let ticket = g.read_image::<u8>(display);
    let mut run = Executor::new(device, Backend::Software).unwrap().run(g, &RunOptions::default()).unwrap();
    run.take(ticket).chunks(4).map(|p| [p[0], p[1], p[2], p[3]]).collect()
}

fn spread(device: &Device, config: &GlareConfig, size: [u32; 2], height: u32, texels: &Texels) -> Texels {
    let mut g = Graph::new();
    let radiance = image(&mut g, size, texels);
    let out = glare::glare(&mut g, config, radiance, height);
    let ticket = g.read_image(out);
    let mut run = Executor::new(device, Backend::Software).unwrap().run(g, &RunOptions::default()).unwrap();
    run.take(ticket)
}

fn linear(value: u8) -> f64 {
    let v = f64::from(value) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Each operator where its definition says what comes out.
#[test]
fn operators_are_those_they_are_named_after() {
    let Some((_guard, device)) = common::device() else { return };
    let config = |operator| ToneMapConfig { exposure: Some(0.0), operator, ..ToneMapConfig::default() };
    let near = |shown: u8, expected: f64, what: &str| {
        let value = linear(shown);
        // Half a step of eight bits in sRGB, and a little.
        let step = linear(shown.saturating_add(1)) - linear(shown.saturating_sub(1));
        assert!((value - expected).abs() <= 0.3 * step.max(1e-3), "{what}: {value} is not {expected}");
    };

    let grey = |v: f32| [v, v, v, 1.0];
    let greys: Texels = [0.0, 0.18, 0.5, 1.0, 4.0, 1e4, 1e30].map(grey).to_vec();
    for (operator, expected) in [
        // Offset by 0.04; from 0.76 on 1 − 0.24²/(v − 0.04 + 0.24 − 0.76).
        (Operator::Neutral, [0.0, 0.14, 0.46, 0.869_091, 0.983_256, 1.0, 1.0]),
        // v·(1 + v/16)/(1 + v).
        (Operator::Reinhard, [0.0, 0.154_258, 0.343_75, 0.531_25, 1.0, 1.0, 1.0]),
        // (v² + 0.0245786·v − 0.000090537)/(0.983729·v² + 0.432951·v + 0.238081).
        (Operator::Aces, [0.0, 0.105_591, 0.374_308, 0.619_115, 0.909_014, 1.0, 1.0]),
        (Operator::Linear, [0.0, 0.18, 0.5, 1.0, 1.0, 1.0, 1.0]),
    ] {
        let pixels = shown(&device, &config(operator), &greys);
        for (pixel, expected) in pixels.iter().zip(expected) {
            near(pixel[1], expected, operator.name());
            assert!(pixel[0].abs_diff(pixel[1]) <= 1 && pixel[2].abs_diff(pixel[1]) <= 1, "{pixel:?}");
            assert_eq!(pixel[3], 255);
        }
    }

    // Reinhard keeps hue and saturation, ACES bleaches bright colours.
    let [pixel] = shown(&device, &config(Operator::Reinhard), &vec![[1.2, 0.6, 0.3, 1.0]])[..] else {
        panic!()
    };
    let [red, green, blue] = [pixel[0], pixel[1], pixel[2]].map(linear);
    assert!((red / green - 2.0).abs() < 0.03 && (green / blue - 2.0).abs() < 0.03, "{pixel:?}");
    let red = |operator| shown(&device, &config(operator), &vec![[40.0, 1.0, 1.0, 1.0]])[0];
    assert!(red(Operator::Aces)[1] > 200, "{:?}", red(Operator::Aces));

    // `white` is what comes out as 1, and only Reinhard's.
    let white = ToneMapConfig { white: 2.0, ..config(Operator::Reinhard) };
    let pixels = shown(&device, &white, &[1.9, 2.0].map(grey).to_vec());
    assert!(pixels[0][1] < 255 && pixels[1][1] == 255, "{pixels:?}");
}

/// A constant picture has no glare, borders and odd sizes included.
#[test]
fn glare_leaves_a_constant_picture_alone() {
    let Some((_guard, device)) = common::device() else { return };
    for (size, strength, radius) in
        [([37, 21], 1.0, 0.3), ([64, 48], 0.2, 0.1), ([1, 1], 0.5, 0.5), ([3, 90], 1.0, 0.5)]
    {
        let texels = vec![[0.7, 1234.5, 1e-5, 1.0]; (size[0] * size[1]) as usize];
        let out = spread(&device, &GlareConfig { strength, radius }, size, size[1], &texels);
        for (out, texel) in out.iter().zip(&texels) {
            for channel in 0..3 {
                let (out, texel) = (out[channel], texel[channel]);
                assert!((out / texel - 1.0).abs() <= 1e-6, "{size:?}: {out} is not {texel}");
            }
        }
    }
}

/// What spreads from one pixel: its sum, its centre and its width are right wherever it lies on the pyramid's grid.
#[test]
fn glare_keeps_light_and_its_place() {
    let Some((_guard, device)) = common::device() else { return };
    const SIZE: u32 = 192;
    // Whole levels: spots of 1 to 4 steps, variances (4ⁿ − 1)/2 along each axis.
    let radius = (255.0_f32 / 2.0).sqrt();
    let expected = (1..=4).map(|n| (4.0_f64.powi(n) - 1.0) / 2.0).sum::<f64>() / 4.0;
    let mut widths = 0.0;
    for (x0, y0, strength) in [(96, 96, 1.0), (101, 90, 1.0), (103, 95, 1.0), (90, 104, 1.0), (97, 93, 0.25)]
    {
        let mut texels = vec![[0.0, 0.0, 0.0, 1.0]; (SIZE * SIZE) as usize];
        texels[(y0 * SIZE + x0) as usize] = [1000.0, 10.0, 0.0, 1.0];
        let config = GlareConfig { strength, radius: radius / SIZE as f32 };
        let out = spread(&device, &config, [SIZE; 2], SIZE, &texels);
        let [mut sum, mut x1, mut y1, mut x2] = [0.0_f64; 4];
        for (i, texel) in out.iter().enumerate() {
            let (x, y) = ((i as u32 % SIZE) as f64 - f64::from(x0), (i as u32 / SIZE) as f64 - f64::from(y0));
            let value = f64::from(texel[0]) / 1000.0;
            assert!(value >= 0.0 && texel[2] == 0.0);
            sum += value;
            (x1, y1, x2) = (x1 + value * x, y1 + value * y, x2 + value * x * x);
        }
        assert!((sum - 1.0).abs() < 1e-5, "{x0}, {y0}: {sum} of the light is there");
        assert!(x1.abs() < 1e-3 && y1.abs() < 1e-3, "{x0}, {y0}: moved by {x1}, {y1} pixels");
        if strength == 1.0 {
            widths += x2 / 4.0;
        } else {
            let centre = f64::from(out[(y0 * SIZE + x0) as usize][0]) / 1000.0;
            assert!(centre > 0.75 && centre < 0.9, "the pixel keeps {centre}");
        }
    }
    assert!((widths / expected - 1.0).abs() < 0.05, "variance {widths}, not {expected}");
}

/// A spot in the middle of the pyramid's grid: the same to all sides, and darker with every pixel away from it.
#[test]
fn glare_is_symmetric_and_falls_with_distance() {
    let Some((_guard, device)) = common::device() else { return };
    const SIZE: usize = 128;
    let mut texels = vec![[0.0, 0.0, 0.0, 1.0]; SIZE * SIZE];
    for (x, y) in [(63, 63), (64, 63), (63, 64), (64, 64)] {
        texels[y * SIZE + x] = [1.0; 4];
    }
    let config = GlareConfig { strength: 0.5, radius: 0.09 };
    let out = spread(&device, &config, [SIZE as u32; 2], SIZE as u32, &texels);
    let at = |x: usize, y: usize| f64::from(out[y * SIZE + x][0]);
    for y in 0..SIZE {
        for x in 0..SIZE {
            for other in [at(SIZE - 1 - x, SIZE - 1 - y), at(SIZE - 1 - x, y), at(y, x)] {
                assert!((at(x, y) - other).abs() <= 1e-6 * other.max(1e-6), "{x}, {y}");
            }
        }
    }
    for i in 64..100 {
        for (near, far) in [(at(i, 64), at(i + 1, 64)), (at(i, i), at(i + 1, i + 1))] {
            assert!(near > far, "{i}: {near} and then {far}");
        }
    }
    let sum: f64 = out.iter().map(|texel| f64::from(texel[0])).sum();
    assert!((sum - 4.0).abs() < 1e-4, "{sum}");
}

/// Off is the graph without it, whatever else is set; on is that graph and the glare's own passes.
#[test]
fn no_glare_is_no_pass() {
    let scene = builtin::by_name("cornell").unwrap();
    for method in [&igi::METHOD, &path::METHOD] {
        let plain = RenderConfig { method, size: [32, 24], ..common::plain() };
        let plan = |config: &RenderConfig| renderer::plan(&scene, config, &[], &Typical).unwrap();
        let paths = |config: &RenderConfig| -> Vec<String> {
            plan(config).passes.iter().map(|pass| pass.path.clone()).collect()
        };
        let mut config = plain.clone();
        config.glare.radius = 0.4;
        assert_eq!(plan(&config).json(&[]), plan(&plain).json(&[]));
        config.glare.strength = 0.1;
        let (with, without) = (paths(&config), paths(&plain));
        assert!(!without.iter().any(|path| path.contains("glare")));
        let mut rest = with.clone();
        rest.retain(|path| !path.starts_with("glare/"));
        assert_eq!(rest, without);
        // 24 pixels · 0.4: four levels, down and up.
        assert_eq!(with.len() - without.len(), 8, "{with:?}");
    }
}

/// Radiance and exposure know nothing of glare; what is shown does, on the way too.
#[test]
fn glare_is_in_what_is_shown_alone() {
    let Some((_guard, device)) = common::device() else { return };
    let scene = builtin::by_name("cornell").unwrap();
    let camera = scene.cameras[0].clone();
    let mut renderer = Renderer::new(&device, scene, &RendererOptions::default()).unwrap();
    for method in [&igi::METHOD, &path::METHOD] {
        let mut config = RenderConfig { method, size: [32, 24], ..common::plain() };
        (config.vpl_shoot.vpls, config.path_trace.spp) = (9, 3);
        let previews = RefCell::new(Vec::new());
        let show = |frame: &renderer::Frame| previews.borrow_mut().push(frame.display.clone());
        let preview = Some(Preview { every: Duration::ZERO, show: &show });
        let request = FrameRequest { preview, ..FrameRequest::default() };
        let plain = renderer.render(&config, &camera, &request).unwrap();
        let plain_preview = previews.take();
        config.glare.strength = 0.3;
        let glaring = renderer.render(&config, &camera, &request).unwrap();
        assert!(plain.beauty == glaring.beauty && plain.exposure_ev == glaring.exposure_ev);
        assert!(plain.display != glaring.display);
        assert_eq!(plain_preview.is_empty(), method == &igi::METHOD);
        assert!(plain_preview.iter().zip(previews.take()).all(|(plain, glaring)| *plain != glaring));
    }
}

/// What denoising promises, where the library is.
#[cfg(feature = "denoise")]
mod denoise {
    use super::*;
    use parhelion::denoise::{Denoiser, Error, Input};
    use parhelion::metrics::rel_mse;
    use parhelion::renderer::{Aov, Layer};
    use std::path::Path;

    fn denoiser() -> Option<Denoiser> {
        let path = std::env::var_os("PARHELION_OIDN");
        let loaded = Denoiser::load(path.as_deref().map(Path::new));
        let why = loaded.as_ref().err().map(ToString::to_string).unwrap_or_default();
        common::require("oidn", loaded.is_ok(), &why);
        loaded.ok()
    }

    fn layer(size: [u32; 2], value: [f32; 3]) -> Layer {
        let data = value.repeat((size[0] * size[1]) as usize);
        Layer { width: size[0], height: size[1], channels: 3, data }
    }

    #[test]
    fn a_missing_or_wrong_library_is_one_clear_error() {
        let folder = tempfile::tempdir().unwrap();
        let wrong = folder.path().join("wrong.so");
        std::fs::write(&wrong, "no library").unwrap();
        for path in [Path::new("/nonexistent/oidn.so"), folder.path(), &wrong] {
            let error = Denoiser::load(Some(path)).unwrap_err();
            let message = error.to_string();
            assert!(
                matches!(error, Error::Absent { .. }) && error.class() == parhelion::ErrorClass::Other,
                "{message}"
            );
            assert!(
                message.contains(path.to_str().unwrap()) && message.contains("PARHELION_OIDN"),
                "{message}"
            );
        }
    }

    #[test]
    fn a_constant_picture_stays_constant() {
        let Some(denoiser) = denoiser() else { return };
        assert!(denoiser.name().starts_with("Open Image Denoise 2."), "{}", denoiser.name());
        let size = [48, 37];
        let (albedo, normal) = (layer(size, [0.5; 3]), layer(size, [0.0, 0.0, 1.0]));
        for value in [0.02, 1.0, 300.0] {
            let radiance = layer(size, [value; 3]);
            let input = Input { radiance: &radiance, albedo: &albedo, normal: &normal };
            let out = denoiser.denoise(&input).unwrap();
            assert_eq!((out.width, out.height, out.channels, out.data.len()), (48, 37, 3, 48 * 37 * 3));
            // A network: it ripples, more so at borders, and is nearly exact on average.
            let errors = out.data.iter().map(|v| f64::from(v / value) - 1.0);
            let mean = errors.clone().sum::<f64>() / out.data.len() as f64;
            let rms = (errors.map(|error| error * error).sum::<f64>() / out.data.len() as f64).sqrt();
            assert!(mean.abs() < 0.02 && rms < 0.05, "{value}: off by {mean} on average, {rms} rms");
        }
        let small = layer([47, 37], [0.5; 3]);
        let radiance = layer(size, [1.0; 3]);
        let error = denoiser.denoise(&Input { radiance: &radiance, albedo: &small, normal: &normal });
        assert!(matches!(error, Err(Error::Shape("albedo"))));
    }

    /// Nearer to the reference than the samples alone; what the samples draw is kept, and no layer more.
    #[test]
    fn denoised_pictures_have_less_error() {
        let Some((_guard, device)) = common::device() else { return };
        let Some(denoiser) = denoiser() else { return };
        let scene = builtin::by_name("cornell").unwrap();
        let camera = scene.cameras[0].clone();
        let mut renderer = Renderer::new(&device, scene, &RendererOptions::default()).unwrap();
        let mut config = RenderConfig { method: &path::METHOD, size: [48, 48], ..common::plain() };
        config.tone_map.exposure = Some(0.0);
        let mut picture = |spp, seed, denoiser| {
            (config.path_trace.spp, config.seed) = (spp, seed);
            let request = FrameRequest { aovs: &[Aov::N], denoiser, ..FrameRequest::default() };
            renderer.render(&config, &camera, &request).unwrap()
        };
        let reference = picture(256, 1, None).beauty.data;
        let plain = picture(4, 0, None);
        let clean = picture(4, 0, Some(&denoiser));
        let denoised = clean.denoised.as_ref().unwrap();
        assert!(denoised.noisy == plain.beauty && plain.denoised.is_none());
        assert!(clean.aovs == plain.aovs && clean.display != plain.display);
        let [before, after] = [&plain, &clean].map(|frame| rel_mse(&frame.beauty.data, &reference));
        assert!(after < 0.5 * before, "{before} before, {after} after");
    }
}
