//! Materials, textures and images.
//!
//! The renderer's only texture is the base colour's. Textures of other factors are replaced by their mean, so that
//! the surface has the right amount of each on the whole; normal and occlusion maps are left out.

use super::{Context, container};
use crate::scene::import::{decode_image, srgb_to_linear};
use crate::scene::validate::MAX_TEXELS;
use crate::scene::{
    AlphaMode, Filter, Image, Material, Sampler, SceneError, TextureRef, TextureTransform, Volume, Wrap,
};
use ::gltf::json;
use ::gltf::json::texture::{Info, MagFilter, MinFilter, WrappingMode};
use ::gltf::json::validation::Checked;
use glam::{Vec2, Vec3, Vec4};
use std::borrow::Cow;
use std::collections::HashMap;

/// Large, finite, and of reflectance 1: what `KHR_materials_ior` wants of its special value 0.
const INFINITE_IOR: f32 = 1e6;

/// How the texels of a texture that is averaged are encoded.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Encoding {
    Linear,
    Srgb,
}

/// Images read so far.
pub(super) struct Textures {
    /// Base colour images, for the scene.
    pub(super) images: Vec<Image>,
    /// For each of the file's images the first that names the same bytes.
    origin: Vec<usize>,
    /// Index into `images` by origin.
    stored: HashMap<usize, u32>,
    means: HashMap<(usize, Encoding), Vec4>,
    texels: usize,
    /// Some texture was replaced by its mean.
    pub(super) averaged: bool,
    /// Some normal or occlusion map was left out.
    pub(super) left_out: bool,
    /// Base colour textures left out for their coordinate set.
    pub(super) far_sets: usize,
}

impl Textures {
    pub(super) fn new(root: &json::Root) -> Self {
        let mut first = HashMap::new();
        let places = root
            .images
            .iter()
            .map(|image| (image.uri.as_deref(), image.buffer_view.map(|view| view.value())));
        Self {
            images: Vec::new(),
            origin: places.enumerate().map(|(i, place)| *first.entry(place).or_insert(i)).collect(),
            stored: HashMap::new(),
            means: HashMap::new(),
            texels: 0,
            averaged: false,
            left_out: false,
            far_sets: 0,
        }
    }
}

impl Context<'_> {
    /// All factors of material `index`, without its textures.
    pub(super) fn material(&self, index: usize) -> Result<Material, SceneError> {
        let source = &self.root.materials[index];
        let material = factors(source, index).and_then(|material| material.check().map(|()| material));
        material.map_err(|problem| self.error(format!("materials[{index}]"), problem))
    }

    /// Adds the textures of material `index`.
    pub(super) fn texture(
        &self,
        index: usize,
        material: &mut Material,
        all: &mut Textures,
    ) -> Result<(), SceneError> {
        let source = &self.root.materials[index];
        let pbr = &source.pbr_metallic_roughness;
        let extensions = source.extensions.as_ref();
        let element = format!("materials[{index}]");
        if let Some(info) = &pbr.base_color_texture {
            let reference = self.texture_ref(info, all)?;
            if reference.uv_set > 1 {
                all.far_sets += 1;
            } else {
                material.base_color_texture = Some(reference);
            }
        }
        if let Some(info) = &pbr.metallic_roughness_texture {
            let mean = self.mean(info, Encoding::Linear, all)?;
            material.roughness *= mean.y;
            material.metallic *= mean.z;
        }
        if let Some(info) = source.emissive_texture.as_ref().filter(|_| material.emission != Vec3::ZERO) {
            material.emission *= self.mean(info, Encoding::Srgb, all)?.truncate();
        }
        if let Some(info) = extensions.and_then(|e| e.transmission.as_ref()?.transmission_texture.as_ref()) {
            material.transmission *= self.mean(info, Encoding::Linear, all)?.x;
        }
        if let Some(specular) = extensions.and_then(|e| e.specular.as_ref()) {
            if let Some(info) = &specular.specular_texture {
                material.specular *= self.mean(info, Encoding::Linear, all)?.w;
            }
            if let Some(info) = &specular.specular_color_texture {
                material.specular_color *= self.mean(info, Encoding::Srgb, all)?.truncate();
            }
        }
        all.left_out |= source.normal_texture.is_some() || source.occlusion_texture.is_some();
        material.check().map_err(|problem| self.error(element, problem))
    }

    fn texture_ref(&self, info: &Info, all: &mut Textures) -> Result<TextureRef, SceneError> {
        let texture = &self.root.textures[info.index.value()];
        let source = self.origin(info, all)?;
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        let image = match all.stored.get(&source) {
            Some(&image) => image,
            None => {
                let image = self.image(source, all)?;
                all.images.push(image);
                let slot = all.images.len() as u32 - 1;
                all.stored.insert(source, slot);
                slot
            }
        };
        Ok(TextureRef {
            image,
            uv_set: transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord),
            sampler: texture
                .sampler
                .map_or_else(Sampler::default, |s| sampler(&self.root.samplers[s.value()])),
            transform: transform.map_or_else(TextureTransform::default, |t| TextureTransform {
                offset: Vec2::from(t.offset.0),
                rotation: t.rotation.0,
                scale: Vec2::from(t.scale.0),
            }),
        })
    }

    /// Mean texel, its colour decoded to linear.
    fn mean(&self, info: &Info, encoding: Encoding, all: &mut Textures) -> Result<Vec4, SceneError> {
        all.averaged = true;
        let source = self.origin(info, all)?;
        if let Some(&mean) = all.means.get(&(source, encoding)) {
            return Ok(mean);
        }
        let decode: [f32; 256] = std::array::from_fn(|i| {
            let value = i as f32 / 255.0;
            if encoding == Encoding::Srgb { srgb_to_linear(value) } else { value }
        });
        let image = self.image(source, all)?;
        let sum = image.texels.iter().fold(glam::DVec4::ZERO, |sum, &[r, g, b, a]| {
            let [r, g, b] = [r, g, b].map(|c| decode[c as usize]);
            sum + Vec4::new(r, g, b, f32::from(a) / 255.0).as_dvec4()
        });
        let mean = (sum / image.texels.len() as f64).as_vec4();
        all.means.insert((source, encoding), mean);
        Ok(mean)
    }

    /// The image that a texture shows; its extensions may name others, in formats not read here.
    fn origin(&self, info: &Info, all: &Textures) -> Result<usize, SceneError> {
        let texture = info.index.value();
        let image = all.origin.get(self.root.textures[texture].source.value()).copied();
        image.ok_or_else(|| self.error(format!("textures[{texture}]"), "its source is missing"))
    }

    fn image(&self, index: usize, all: &mut Textures) -> Result<Image, SceneError> {
        let source = &self.root.images[index];
        let file_name = source.uri.as_deref().filter(|uri| !uri.starts_with("data:"));
        let name =
            source.name.as_deref().or(file_name).map_or_else(|| format!("image {index}"), str::to_owned);
        let mut read = || {
            let bytes = match (&source.uri, source.buffer_view) {
                (Some(uri), None) => Cow::Owned(container::fetch(self.file, uri)?),
                (None, Some(view)) => Cow::Borrowed(self.view_bytes(view)?),
                _ => return Err("it needs either a uri or a bufferView".to_owned()),
            };
            let image = decode_image(&name, &bytes)?;
            all.texels += image.texels.len();
            if all.texels > MAX_TEXELS {
                return Err(format!("more than {MAX_TEXELS} texels up to here"));
            }
            Ok(image)
        };
        read().map_err(|problem| self.error(format!("images[{index}]"), problem))
    }
}

fn factors(source: &json::Material, index: usize) -> Result<Material, String> {
    let pbr = &source.pbr_metallic_roughness;
    let extensions = source.extensions.as_ref();
    let strength =
        extensions.and_then(|e| e.emissive_strength.as_ref()).map_or(1.0, |e| e.emissive_strength.0);
    let ior = extensions.and_then(|e| e.ior.as_ref()).map_or(1.5, |i| i.ior.0);
    let specular = extensions.and_then(|e| e.specular.as_ref());
    if strength.is_nan() || strength < 0.0 {
        return Err(format!("emissive strength is {strength}, expected at least 0"));
    }
    let mut volume = None;
    if let Some(v) = extensions.and_then(|e| e.volume.as_ref()) {
        let thickness = v.thickness_factor.0;
        if !(0.0..f32::INFINITY).contains(&thickness) {
            return Err(format!("thickness is {thickness}, expected at least 0"));
        }
        volume = (thickness > 0.0).then_some(Volume {
            attenuation_distance: v.attenuation_distance.0,
            attenuation_color: Vec3::from(v.attenuation_color.0),
        });
    }
    let cutoff = source.alpha_cutoff.map_or(0.5, |c| c.0);
    Ok(Material {
        name: source.name.clone().unwrap_or_else(|| format!("material {index}")),
        base_color: Vec4::from(pbr.base_color_factor.0),
        base_color_texture: None,
        metallic: pbr.metallic_factor.0,
        roughness: pbr.roughness_factor.0,
        emission: Vec3::from(source.emissive_factor.0) * strength,
        ior: if ior == 0.0 { INFINITE_IOR } else { ior },
        transmission: extensions
            .and_then(|e| e.transmission.as_ref())
            .map_or(0.0, |t| t.transmission_factor.0),
        volume,
        specular: specular.map_or(1.0, |s| s.specular_factor.0),
        specular_color: specular.map_or(Vec3::ONE, |s| Vec3::from(s.specular_color_factor.0)),
        unlit: extensions.is_some_and(|e| e.unlit.is_some()),
        double_sided: source.double_sided,
        alpha_mode: match source.alpha_mode {
            Checked::Valid(json::material::AlphaMode::Mask) => AlphaMode::Mask { cutoff },
            Checked::Valid(json::material::AlphaMode::Blend) => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        },
    })
}

fn sampler(source: &json::texture::Sampler) -> Sampler {
    let wrap = |mode| match mode {
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::MirroredRepeat,
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::ClampToEdge,
        _ => Wrap::Repeat,
    };
    let nearest = match (source.mag_filter, source.min_filter) {
        (Some(mag), _) => mag == Checked::Valid(MagFilter::Nearest),
        (None, Some(Checked::Valid(min))) => {
            matches!(
                min,
                MinFilter::Nearest | MinFilter::NearestMipmapNearest | MinFilter::NearestMipmapLinear
            )
        }
        _ => false,
    };
    Sampler {
        filter: if nearest { Filter::Nearest } else { Filter::Linear },
        wrap_u: wrap(source.wrap_s),
        wrap_v: wrap(source.wrap_t),
    }
}
