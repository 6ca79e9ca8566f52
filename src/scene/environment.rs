use super::limits::{Checked, MAX_IMAGE_SIDE, MAX_RADIANCE};
use super::mend::Mended;
use super::{LoadOptions, SceneError, file};
use crate::memory::Budget;
use crate::read;
use exr::prelude::{ReadChannels, ReadLayers};
use glam::{Vec2, Vec3};
use std::f32::consts::{PI, TAU};
use std::io::Cursor;
use std::path::Path;

/// Most texels of an environment.
pub const MAX_ENVIRONMENT_TEXELS: usize = 1 << 26;

/// Light from infinitely far around the scene, in every direction.
///
/// An image is equirectangular in the world's axes (Y up): its centre is +X, +Z is at three quarters of its width, the
/// top row is around +Y. Between texel centres it is bilinear.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// The file, or `constant`.
    pub name: String,
    /// Texels in a row, all the way around.
    pub width: u32,
    /// Rows, from +Y to −Y.
    pub height: u32,
    /// Radiance (W/(sr·m²)), `width * height` texels, top row first.
    pub texels: Vec<Vec3>,
}

impl Environment {
    /// The same radiance (W/(sr·m²)) from everywhere.
    #[must_use]
    pub fn constant(radiance: Vec3) -> Self {
        Self { name: "constant".into(), width: 1, height: 1, texels: vec![radiance] }
    }

    /// Loads `.exr` (channels R, G, B, or Y alone) or Radiance `.hdr`, and says what was mended: texels below 0, which
    /// become 0, and infinite ones, which become as bright as the brightest other.
    ///
    /// # Errors
    /// [`SceneError`] names the file and what is wrong: no such file or format, a missing channel, more texels than
    /// [`MAX_ENVIRONMENT_TEXELS`] or than there is memory for, and the first one that is no number or above
    /// [`MAX_RADIANCE`]; where `options` are strict, the first that would be mended.
    pub fn load(path: &Path, options: &LoadOptions) -> Result<(Self, Vec<String>), SceneError> {
        let fail = |problem: String| SceneError::new(path, "environment", problem);
        let bytes = file::read_file(path, &mut Budget::of_process())
            .map_err(|fault| fault.of(path, "environment"))?;
        let room = |bytes| {
            let taken = Budget::of_process().take(bytes);
            taken.map_err(|shortage| SceneError::short(path, "environment", shortage))
        };
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        let (width, height, texels) = match extension.as_deref() {
            Some("exr") => {
                room(exr_bytes(&bytes).map_err(fail)?)?;
                read_exr(&bytes)
            }
            Some("hdr") => {
                let (decoder, texels) = hdr_decoder(&bytes).map_err(fail)?;
                room(24 * texels)?;
                read_hdr(decoder)
            }
            _ => Err("is neither .exr nor .hdr".into()),
        }
        .map_err(fail)?;
        let mut environment = Self { name: path.display().to_string(), width, height, texels };
        let mended = Mended::new(options);
        environment.mend(path, &mended)?;
        environment.check().map_err(fail)?;
        Ok((environment, mended.notes()))
    }

    /// Makes radiance of every texel, as far as a mind can be read.
    fn mend(&mut self, path: &Path, mended: &Mended) -> Result<(), SceneError> {
        let finite = self.texels.iter().flat_map(|texel| texel.to_array()).filter(|value| value.is_finite());
        let brightest = finite.fold(0.0, f32::max);
        let width = self.width as usize;
        for (i, texel) in self.texels.iter_mut().enumerate() {
            let defect = |what| {
                let place = format!("environment texel ({}, {})", i % width, i / width);
                SceneError::new(path, place, format!("it is {what}: {texel}"))
            };
            if texel.cmplt(Vec3::ZERO).any() {
                mended.mend(path, defect("negative"), "taken as 0")?;
            } else if texel.cmpeq(Vec3::INFINITY).any() {
                if brightest <= 0.0 {
                    return Err(defect("infinite, and no other shines"));
                }
                mended.mend(path, defect("infinite"), "taken as the brightest finite value")?;
            } else {
                continue;
            }
            let value = |v: f32| match v {
                f32::INFINITY => brightest,
                v if v < 0.0 => 0.0,
                v => v,
            };
            *texel = Vec3::from(texel.to_array().map(value));
        }
        Ok(())
    }

    /// Radiance (W/(sr·m²)) from a unit direction.
    #[must_use]
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        let polar = Vec2::new(direction.x, direction.z).length().atan2(direction.y);
        let uv = Vec2::new(direction.z.atan2(direction.x) / TAU + 0.5, polar / PI);
        let position = uv * Vec2::new(self.width as f32, self.height as f32) - 0.5;
        let (corner, f) = (position.floor().as_ivec2(), position - position.floor());
        let texel = |x: i32, y: i32| {
            let row = y.clamp(0, self.height as i32 - 1) as usize;
            self.texels[row * self.width as usize + x.rem_euclid(self.width as i32) as usize]
        };
        let row = |y| texel(corner.x, y).lerp(texel(corner.x + 1, y), f.x);
        row(corner.y).lerp(row(corner.y + 1), f.y)
    }

    pub(super) fn check(&self) -> Checked {
        check_size(self.width as usize, self.height as usize)?;
        if self.texels.len() != self.width as usize * self.height as usize {
            return Err(format!("{} texels for {}×{}", self.texels.len(), self.width, self.height));
        }
        let good = |texel: &Vec3| texel.cmpge(Vec3::ZERO).all() && texel.max_element() <= MAX_RADIANCE;
        match self.texels.iter().position(|texel| !good(texel)) {
            Some(i) => {
                let texel = self.texels[i];
                let what = match texel.is_finite() {
                    false => "not finite".to_owned(),
                    true if texel.min_element() < 0.0 => "negative".to_owned(),
                    true => format!("above {MAX_RADIANCE:e}"),
                };
                let (x, y) = (i % self.width as usize, i / self.width as usize);
                Err(format!("texel ({x}, {y}) is {what}: {}", self.texels[i]))
            }
            None => Ok(()),
        }
    }
}

fn check_size(width: usize, height: usize) -> Checked {
    let side = 1..=MAX_IMAGE_SIDE as usize;
    if !side.contains(&width) || !side.contains(&height) || width * height > MAX_ENVIRONMENT_TEXELS {
        return Err(format!(
            "{width}×{height} texels, expected 1 to {MAX_IMAGE_SIDE} a side and at most {MAX_ENVIRONMENT_TEXELS} in all"
        ));
    }
    Ok(())
}

type Texels = (u32, u32, Vec<Vec3>);

type Decoder<'a> = image::codecs::hdr::HdrDecoder<Cursor<&'a [u8]>>;

fn corrupt(error: &dyn std::fmt::Display) -> String {
    format!("can't be decoded: {error}")
}

/// What reads an .hdr, and its texels.
fn hdr_decoder(bytes: &[u8]) -> Result<(Decoder<'_>, u64), String> {
    // `#?RADIANCE` and `#?RGBE` are common; the decoder's strict mode knows the first alone.
    if !bytes.starts_with(b"#?") {
        return Err("can't be decoded: it does not begin with `#?`".into());
    }
    let decoder = Decoder::new_nonstrict(Cursor::new(bytes)).map_err(|error| corrupt(&error))?;
    let (width, height) = image::ImageDecoder::dimensions(&decoder);
    check_size(width as usize, height as usize)?;
    Ok((decoder, u64::from(width) * u64::from(height)))
}

fn read_hdr(decoder: Decoder<'_>) -> Result<Texels, String> {
    let (width, height) = image::ImageDecoder::dimensions(&decoder);
    let decoded = image::DynamicImage::from_decoder(decoder).map_err(|error| corrupt(&error))?.into_rgb32f();
    let texels = decoded.pixels().map(|pixel| Vec3::from(pixel.0)).collect();
    Ok((width, height, texels))
}

/// Memory that reading an .exr takes.
fn exr_bytes(bytes: &[u8]) -> Result<u64, String> {
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), true);
    let meta = meta.map_err(|error| corrupt(&error))?;
    let mut texels = 0;
    for header in &meta.headers {
        check_size(header.layer_size.width(), header.layer_size.height())?;
        texels = texels.max(header.layer_size.area() as u64);
    }
    let pixels = read::exr_bytes(&meta, bytes.len() as u64)?;
    Ok(pixels.saturating_add(texels * size_of::<Vec3>() as u64))
}

fn read_exr(bytes: &[u8]) -> Result<Texels, String> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| corrupt(&error))?;
    let layer = &image.layer_data;
    let channel = |name: &str| layer.channel_data.list.iter().find(|channel| channel.name.eq(name));
    let channels = match [channel("R"), channel("G"), channel("B")] {
        [Some(r), Some(g), Some(b)] => [r, g, b],
        // With RY and BY beside it Y is luminance, the colours apart.
        _ => match (channel("Y"), channel("RY")) {
            (Some(y), None) => [y; 3],
            _ => return Err("has neither channels R, G and B nor Y alone".into()),
        },
    };
    let [mut r, mut g, mut b] = channels.map(|channel| channel.sample_data.values_as_f32());
    let mut texels = Vec::with_capacity(layer.size.area());
    while let (Some(r), Some(g), Some(b)) = (r.next(), g.next(), b.next()) {
        texels.push(Vec3::new(r, g, b));
    }
    Ok((layer.size.width() as u32, layer.size.height() as u32, texels))
}
