//! Materials, textures and images. Occlusion textures are left out: occlusion is computed.

use super::container;
use super::context::Context;
use crate::scene::clip::MaterialProperty::{EmissiveFactor, EmissiveStrength};
use crate::scene::clip::Target;
use crate::scene::file::{self, decode_image};
use crate::scene::limits::{MAX_IOR, MAX_TEXELS};
use crate::scene::{
    AlphaMode, Clearcoat, Fault, Filter, Image, Material, NormalMap, Sampler, SceneError, TextureRef,
    TextureTransform, Volume, Wrap,
};
use ::gltf::json;
use ::gltf::json::extensions::texture::TextureTransform as Transform;
use ::gltf::json::material::NormalTexture;
use ::gltf::json::texture::{Info, MagFilter, MinFilter, WrappingMode};
use ::gltf::json::validation::Checked;
use glam::{Vec2, Vec3, Vec4};
use serde::Deserialize;
use std::borrow::Cow;
use std::collections::HashMap;

/// How far outside of their range factors are taken for what rounding and interpolation leave.
const HAIR: f32 = 0.1;

/// `KHR_materials_clearcoat`, which the `gltf` crate does not type.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct ClearcoatExtension {
    clearcoat_factor: f32,
    clearcoat_texture: Option<Info>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<Info>,
    clearcoat_normal_texture: Option<NormalTexture>,
}

fn clearcoat(source: &json::Material) -> Result<Option<ClearcoatExtension>, String> {
    let others = source.extensions.as_ref().map(|extensions| &extensions.others);
    let Some(value) = others.and_then(|others| others.get("KHR_materials_clearcoat")) else {
        return Ok(None);
    };
    ClearcoatExtension::deserialize(value)
        .map(Some)
        .map_err(|error| format!("extensions.KHR_materials_clearcoat: {error}"))
}

/// What a material says of a texture.
struct Use<'a> {
    index: usize,
    set: u32,
    transform: Option<Cow<'a, Transform>>,
}

impl<'a> From<&'a Info> for Use<'a> {
    fn from(info: &'a Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        Self { index: info.index.value(), set: info.tex_coord, transform: transform.map(Cow::Borrowed) }
    }
}

impl Use<'_> {
    /// The crate does not type a normal map's transform.
    fn of_normal_map(map: &NormalTexture) -> Result<Self, String> {
        let others = map.extensions.as_ref().map(|extensions| &extensions.others);
        let transform = others
            .and_then(|others| others.get("KHR_texture_transform"))
            .map(|value| Transform::deserialize(value).map(Cow::Owned))
            .transpose()
            .map_err(|error| format!("KHR_texture_transform of a normal map: {error}"))?;
        Ok(Self { index: map.index.value(), set: map.tex_coord, transform })
    }
}

/// Images read so far.
pub(super) struct Textures {
    /// For the scene.
    pub(super) images: Vec<Image>,
    /// For each of the file's images the first that names the same bytes.
    origin: Vec<usize>,
    /// Index into `images` by origin.
    stored: HashMap<usize, u32>,
    texels: usize,
    /// Textures left out for their coordinate set.
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
            texels: 0,
            far_sets: 0,
        }
    }
}

impl Context<'_> {
    /// All factors of material `index`, without its textures.
    pub(super) fn material(&self, index: usize) -> Result<Material, SceneError> {
        let source = &self.root.materials[index];
        let located = |problem| self.error(format!("materials[{index}]"), problem);
        let mut material = factors(source, index).map_err(located)?;
        self.clamp(&mut material, index)?;
        material.check().map_err(located)?;
        Ok(material)
    }

    /// Brings factors into their range that are next to it, as other readers do; what is further off is for the check to find.
    fn clamp(&self, material: &mut Material, index: usize) -> Result<(), SceneError> {
        let (mut worst, mut coat) = (None::<String>, Clearcoat::default());
        let mut clamp = |what: &'static str, value: &mut f32, high: f32| {
            if !(0.0..=high).contains(value) && (-HAIR..=high + HAIR).contains(value) {
                worst.get_or_insert_with(|| format!("{what} is {value}"));
                *value = value.clamp(0.0, high);
            }
        };
        let Material { base_color, emission, specular_color, clearcoat, .. } = material;
        base_color.as_mut().iter_mut().for_each(|value| clamp("base colour", value, 1.0));
        emission.as_mut().iter_mut().for_each(|value| clamp("emission", value, f32::INFINITY));
        specular_color.as_mut().iter_mut().for_each(|value| clamp("specular colour", value, f32::INFINITY));
        clamp("metallic", &mut material.metallic, 1.0);
        clamp("roughness", &mut material.roughness, 1.0);
        clamp("transmission", &mut material.transmission, 1.0);
        clamp("specular factor", &mut material.specular, 1.0);
        let coat = clearcoat.as_mut().unwrap_or(&mut coat);
        clamp("clearcoat factor", &mut coat.factor, 1.0);
        clamp("clearcoat roughness", &mut coat.roughness, 1.0);
        if let Some(volume) = &mut material.volume {
            let color = volume.attenuation_color.as_mut();
            color.iter_mut().for_each(|value| clamp("attenuation colour", value, 1.0));
        }
        if let AlphaMode::Mask { cutoff } = &mut material.alpha_mode {
            clamp("alpha cutoff", cutoff, f32::INFINITY);
        }
        if (1.0 - HAIR..1.0).contains(&material.ior) {
            worst.get_or_insert_with(|| format!("index of refraction is {}", material.ior));
            material.ior = 1.0;
        }
        let Some(problem) = worst else { return Ok(()) };
        self.mend(format!("materials[{index}]"), problem, "it is clamped to its range")
    }

    /// Adds the textures of material `index`.
    pub(super) fn texture(
        &self,
        index: usize,
        material: &mut Material,
        all: &mut Textures,
    ) -> Result<(), SceneError> {
        self.textures(index, material, all)?;
        material.check().map_err(|problem| self.error(format!("materials[{index}]"), problem))
    }

    fn textures(&self, index: usize, material: &mut Material, all: &mut Textures) -> Result<(), SceneError> {
        let source = &self.root.materials[index];
        let pbr = &source.pbr_metallic_roughness;
        let located = |problem| self.error(format!("materials[{index}]"), problem);
        let mut texture =
            |info: Option<&Info>| self.texture_ref(index, info.map(|info| Ok(info.into())), all);
        material.base_color_texture = texture(pbr.base_color_texture.as_ref())?;
        material.metallic_roughness_texture = texture(pbr.metallic_roughness_texture.as_ref())?;
        let glows = |property| self.moves(Target::Material(index as u32, property));
        if material.emission != Vec3::ZERO || glows(EmissiveFactor) || glows(EmissiveStrength) {
            material.emission_texture = texture(source.emissive_texture.as_ref())?;
        }
        if let Some(extensions) = &source.extensions {
            if let Some(transmission) = &extensions.transmission {
                material.transmission_texture = texture(transmission.transmission_texture.as_ref())?;
            }
            if let Some(specular) = &extensions.specular {
                material.specular_texture = texture(specular.specular_texture.as_ref())?;
                material.specular_color_texture = texture(specular.specular_color_texture.as_ref())?;
            }
        }
        let extension = clearcoat(source).map_err(located)?;
        if let (Some(coat), Some(extension)) = (&mut material.clearcoat, &extension) {
            coat.texture = texture(extension.clearcoat_texture.as_ref())?;
            coat.roughness_texture = texture(extension.clearcoat_roughness_texture.as_ref())?;
            coat.normal_map = self.normal_map(index, extension.clearcoat_normal_texture.as_ref(), all)?;
        }
        material.normal_map = self.normal_map(index, source.normal_texture.as_ref(), all)?;
        Ok(())
    }

    /// Whether material `index` needs tangents.
    pub(super) fn is_normal_mapped(&self, index: usize) -> bool {
        let source = &self.root.materials[index];
        let coat = clearcoat(source).ok().flatten();
        source.normal_texture.is_some() || coat.is_some_and(|coat| coat.clearcoat_normal_texture.is_some())
    }

    fn normal_map(
        &self,
        material: usize,
        map: Option<&NormalTexture>,
        all: &mut Textures,
    ) -> Result<Option<NormalMap>, SceneError> {
        let texture = self.texture_ref(material, map.map(Use::of_normal_map), all)?;
        Ok(texture.zip(map).map(|(texture, map)| NormalMap { texture, scale: map.scale }))
    }

    /// `None` too where the coordinate set is none that is read.
    fn texture_ref(
        &self,
        material: usize,
        usage: Option<Result<Use<'_>, String>>,
        all: &mut Textures,
    ) -> Result<Option<TextureRef>, SceneError> {
        let located = |problem| self.error(format!("materials[{material}]"), problem);
        let Some(usage) = usage.transpose().map_err(located)? else { return Ok(None) };
        // The crate has not seen what is inside the extensions it does not type.
        let Some(texture) = self.root.textures.get(usage.index) else {
            return Err(located(format!("textures[{}] is not there: index out of range", usage.index)));
        };
        let transform = usage.transform.as_deref();
        let uv_set = transform.and_then(|t| t.tex_coord).unwrap_or(usage.set);
        if uv_set > 1 {
            all.far_sets += 1;
            return Ok(None);
        }
        let Some(source) = self.origin(usage.index, all)? else { return Ok(None) };
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
        Ok(Some(TextureRef {
            image,
            uv_set,
            sampler: texture
                .sampler
                .map_or_else(Sampler::default, |s| sampler(&self.root.samplers[s.value()])),
            transform: transform.map_or_else(TextureTransform::default, |t| TextureTransform {
                offset: Vec2::from(t.offset.0),
                rotation: t.rotation.0,
                scale: Vec2::from(t.scale.0),
            }),
        }))
    }

    /// The image that a texture shows; its extensions may name others, in formats not read here.
    fn origin(&self, texture: usize, all: &Textures) -> Result<Option<usize>, SceneError> {
        let source = &self.root.textures[texture];
        if let Some(&image) = all.origin.get(source.source.value()) {
            return Ok(Some(image));
        }
        let others = source.extensions.iter().flat_map(|extensions| &extensions.others);
        let other = others.filter_map(|(name, other)| Some((name, other.get("source")?.as_u64()?)));
        match other.into_iter().next() {
            Some((name, image)) => {
                let problem = format!("it is there by {name} alone, which is not supported");
                Err(self.error(format!("images[{image}]"), problem))
            }
            None => {
                let element = format!("textures[{texture}]");
                self.mend(element, "its source is missing", "surfaces go without such textures")?;
                Ok(None)
            }
        }
    }

    fn image(&self, index: usize, all: &mut Textures) -> Result<Image, SceneError> {
        let source = &self.root.images[index];
        let element = format!("images[{index}]");
        let file_name = source.uri.as_deref().filter(|uri| container::data(uri).is_none());
        let name =
            source.name.as_deref().or(file_name).map_or_else(|| format!("image {index}"), str::to_owned);
        let mut differs = None;
        let mut read = || {
            let before = *self.budget.borrow();
            let bytes = match (&source.uri, source.buffer_view) {
                (Some(uri), None) => {
                    let fetched = container::fetch(self.files, uri, self.budget)?;
                    differs = fetched.differs.map(|name| (uri, name));
                    Cow::Owned(fetched.bytes)
                }
                (None, Some(view)) => match self.view_bytes(view) {
                    Ok(bytes) => Cow::Borrowed(bytes),
                    Err(error) => return Err(format!("{}: {}", error.element, error.problem).into()),
                },
                _ => return Err(Fault::from("it needs either a uri or a bufferView")),
            };
            let image = decode_image(&name, &bytes, &mut self.budget.borrow_mut())?;
            // The encoded bytes are gone.
            self.budget.replace(before);
            self.take::<[u8; 4]>(image.texels.len())?;
            all.texels += image.texels.len();
            if all.texels > MAX_TEXELS {
                return Err(format!("more than {MAX_TEXELS} texels up to here").into());
            }
            Ok(image)
        };
        let image = read().map_err(|fault| self.fault(&element, fault))?;
        if let Some((uri, name)) = differs {
            let problem = format!("`{}` is not there, but `{name}` is", file::shortened(uri));
            self.mend(element, problem, container::OTHER_CASE)?;
        }
        Ok(image)
    }
}

/// Emissive factor and strength.
pub(super) fn glow(source: &json::Material) -> (Vec3, f32) {
    let strength = source.extensions.as_ref().and_then(|e| e.emissive_strength.as_ref());
    (Vec3::from(source.emissive_factor.0), strength.map_or(1.0, |e| e.emissive_strength.0))
}

fn factors(source: &json::Material, index: usize) -> Result<Material, String> {
    let pbr = &source.pbr_metallic_roughness;
    let extensions = source.extensions.as_ref();
    let (factor, strength) = glow(source);
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
    let clearcoat = clearcoat(source)?.map(|coat| Clearcoat {
        factor: coat.clearcoat_factor,
        roughness: coat.clearcoat_roughness_factor,
        ..Clearcoat::default()
    });
    let cutoff = source.alpha_cutoff.map_or(0.5, |c| c.0);
    Ok(Material {
        name: source.name.clone().unwrap_or_else(|| format!("material {index}")),
        base_color: Vec4::from(pbr.base_color_factor.0),
        metallic: pbr.metallic_factor.0,
        roughness: pbr.roughness_factor.0,
        emission: factor * strength,
        // The extension's special value stands for an infinite index; beyond the largest all light is reflected, too.
        ior: if ior == 0.0 { MAX_IOR } else { ior.min(MAX_IOR) },
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
        clearcoat,
        ..Material::default()
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
