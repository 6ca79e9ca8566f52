use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};

/// glTF metallic-roughness with the extensions named at each field. Colours are linear Rec. 709. A texture multiplies
/// the factor it stands behind; textures without mip levels are read at their full size. Occlusion textures have no
/// place here: occlusion is computed.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// As in the file.
    pub name: String,
    /// Base colour and alpha, multiplied by texture and vertex colour.
    pub base_color: Vec4,
    /// Base colour texture (sRGB texels).
    pub base_color_texture: Option<TextureRef>,
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// Perceptual roughness; GGX α is its square.
    pub roughness: f32,
    /// Roughness in green and metalness in blue (linear texels).
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Shading normals.
    pub normal_map: Option<NormalMap>,
    /// Emitted radiance (W/(sr·m²)), `KHR_materials_emissive_strength` multiplied in.
    pub emission: Vec3,
    /// Emission texture (sRGB texels).
    pub emission_texture: Option<TextureRef>,
    /// Index of refraction (`KHR_materials_ior`), 1.5 by default, at least 1. The extension's special value 0
    /// (reflect everything) is loaded as 1e6, of which all formulas make a reflectance of 1.
    pub ior: f32,
    /// Share of the light entering a dielectric that passes on (`KHR_materials_transmission`).
    pub transmission: f32,
    /// Transmission in red (linear texels).
    pub transmission_texture: Option<TextureRef>,
    /// A solid body that refracts (`KHR_materials_volume` with thickness > 0); a thin wall otherwise.
    pub volume: Option<Volume>,
    /// Set where this thin wall stands for a flat slab of a volume: its optical depth across, by channel. Light passes and
    /// is reflected as by the slab with all that goes to and fro in it; `base_color` is that of both faces together.
    pub slab: Option<Vec3>,
    /// Factor on the dielectric reflection (`KHR_materials_specular`).
    pub specular: f32,
    /// That factor in alpha.
    pub specular_texture: Option<TextureRef>,
    /// Colour of the dielectric reflection at normal incidence (`KHR_materials_specular`).
    pub specular_color: Vec3,
    /// That colour (sRGB texels).
    pub specular_color_texture: Option<TextureRef>,
    /// A clear layer on top (`KHR_materials_clearcoat`).
    pub clearcoat: Option<Clearcoat>,
    /// Base colour is emitted as is and nothing is reflected (`KHR_materials_unlit`).
    pub unlit: bool,
    /// Emission leaves both sides. Every surface blocks and scatters on both sides whatever this says.
    pub double_sided: bool,
    /// What alpha means.
    pub alpha_mode: AlphaMode,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_map: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            ior: 1.5,
            transmission: 0.0,
            transmission_texture: None,
            volume: None,
            slab: None,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            clearcoat: None,
            unlit: false,
            double_sided: false,
            alpha_mode: AlphaMode::Opaque,
        }
    }
}

impl Material {
    /// A Lambertian surface of albedo `albedo` that reflects on both sides and has no specular lobe.
    #[must_use]
    pub fn diffuse(name: impl Into<String>, albedo: Vec3) -> Self {
        Self {
            name: name.into(),
            base_color: albedo.extend(1.0),
            metallic: 0.0,
            specular: 0.0,
            double_sided: true,
            ..Self::default()
        }
    }

    /// Whether some of it may be no metal: a texture of metalness may hold any value up to the factor.
    fn may_be_dielectric(&self) -> bool {
        self.metallic < 1.0 || self.metallic_roughness_texture.is_some()
    }

    /// Whether it gives light.
    pub(crate) fn emits(&self) -> bool {
        !self.unlit && self.emission != Vec3::ZERO
    }

    /// Whether light may pass through some of it.
    pub(crate) fn may_transmit(&self) -> bool {
        !self.unlit && self.transmission > 0.0 && self.may_be_dielectric()
    }

    /// Whether some of it may let light straight through: a thin wall that transmits, or partial coverage.
    pub(crate) fn may_be_sheer(&self) -> bool {
        self.alpha_mode == AlphaMode::Blend || self.may_transmit() && self.volume.is_none()
    }

    /// Whether all of it is a pane at the default `mirror_roughness`: what imperfect visibility leaves out.
    pub(crate) fn is_pane(&self) -> bool {
        self.may_transmit() && self.volume.is_none() && self.roughness <= 0.1
    }

    /// Whether some of it may have a diffuse base that is not black.
    pub(crate) fn may_scatter(&self) -> bool {
        let opaque = self.transmission < 1.0 || self.transmission_texture.is_some();
        !self.unlit && opaque && self.may_be_dielectric() && self.base_color.truncate() != Vec3::ZERO
    }
}

/// A texture of a material and what it stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TextureUse {
    BaseColor,
    MetallicRoughness,
    Normal,
    Emission,
    Transmission,
    Specular,
    SpecularColor,
    Clearcoat,
    ClearcoatRoughness,
    ClearcoatNormal,
}

impl TextureUse {
    /// Whether texels hold a colour, which is stored sRGB-encoded.
    pub(crate) fn is_srgb(self) -> bool {
        matches!(self, Self::BaseColor | Self::Emission | Self::SpecularColor)
    }
}

impl Material {
    /// Every texture there is.
    pub(crate) fn textures(&self) -> impl Iterator<Item = (TextureUse, TextureRef)> {
        let coat = self.clearcoat.as_ref();
        [
            (TextureUse::BaseColor, self.base_color_texture),
            (TextureUse::MetallicRoughness, self.metallic_roughness_texture),
            (TextureUse::Normal, self.normal_map.map(|map| map.texture)),
            (TextureUse::Emission, self.emission_texture),
            (TextureUse::Transmission, self.transmission_texture),
            (TextureUse::Specular, self.specular_texture),
            (TextureUse::SpecularColor, self.specular_color_texture),
            (TextureUse::Clearcoat, coat.and_then(|coat| coat.texture)),
            (TextureUse::ClearcoatRoughness, coat.and_then(|coat| coat.roughness_texture)),
            (TextureUse::ClearcoatNormal, coat.and_then(|coat| coat.normal_map.map(|map| map.texture))),
        ]
        .into_iter()
        .filter_map(|(usage, texture)| Some((usage, texture?)))
    }

    /// The texture that tangents follow: the normal map's, or else the clear coat's.
    pub(crate) fn tangent_texture(&self) -> Option<TextureRef> {
        let coat = self.clearcoat.as_ref().and_then(|coat| coat.normal_map);
        self.normal_map.or(coat).map(|map| map.texture)
    }
}

/// A tangent-space normal map (linear texels, green up), on meshes that have tangents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// x, y, z in red, green, blue, from −1 to 1.
    pub texture: TextureRef,
    /// Factor on x and y.
    pub scale: f32,
}

/// A clear dielectric layer of index 1.5 on top of all else (`KHR_materials_clearcoat`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clearcoat {
    /// 0 none … 1 full.
    pub factor: f32,
    /// That factor in red (linear texels).
    pub texture: Option<TextureRef>,
    /// Perceptual roughness; GGX α is its square.
    pub roughness: f32,
    /// Roughness in green (linear texels).
    pub roughness_texture: Option<TextureRef>,
    /// Normals of the layer; without one they are the vertices', whatever the material's own map says.
    pub normal_map: Option<NormalMap>,
}

/// The inside of a solid dielectric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// Distance (m) over which white light takes on `attenuation_color`; infinite: clear.
    pub attenuation_distance: f32,
    /// Colour of white light after `attenuation_distance`.
    pub attenuation_color: Vec3,
}

impl Volume {
    /// What it absorbs (1/m), by Beer and Lambert: `attenuation_color` is left after `attenuation_distance`.
    #[must_use]
    pub fn absorption(&self) -> Vec3 {
        -self.attenuation_color.max(Vec3::splat(1e-10)).map(f32::ln) / self.attenuation_distance
    }
}

/// What a surface's alpha means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Ignored.
    Opaque,
    /// Below the cutoff there is a hole.
    Mask {
        /// Alpha from which the surface exists.
        cutoff: f32,
    },
    /// Partial coverage: alpha is the share of light that meets the surface.
    Blend,
}

/// Use of an image by a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into the scene's images.
    pub image: u32,
    /// Texture coordinate set, 0 or 1.
    pub uv_set: u32,
    /// Filtering and wrapping.
    pub sampler: Sampler,
    /// `KHR_texture_transform`; identity otherwise.
    pub transform: TextureTransform,
}

/// `KHR_texture_transform`: uv' = T · R · S · uv, as the extension defines them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureTransform {
    /// Translation in texture coordinates.
    pub offset: Vec2,
    /// Counter-clockwise rotation about the origin (radians).
    pub rotation: f32,
    /// Scale in texture coordinates.
    pub scale: Vec2,
}

impl Default for TextureTransform {
    fn default() -> Self {
        Self { offset: Vec2::ZERO, rotation: 0.0, scale: Vec2::ONE }
    }
}

impl TextureTransform {
    /// Texture coordinates in the file to those in the image. Rotation is counter-clockwise as seen on the image,
    /// whose v points down.
    #[must_use]
    pub fn to_affine(self) -> Affine2 {
        let (sin, cos) = self.rotation.sin_cos();
        let columns =
            Mat2::from_cols(Vec2::new(cos, -sin) * self.scale.x, Vec2::new(sin, cos) * self.scale.y);
        Affine2::from_mat2_translation(columns, self.offset)
    }
}

/// Sampler state; there are no mip levels, so minification follows `filter` too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sampler {
    /// Between texels.
    pub filter: Filter,
    /// Outside [0, 1] in u.
    pub wrap_u: Wrap,
    /// Outside [0, 1] in v.
    pub wrap_v: Wrap,
}

/// Texel filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Bilinear, in linear light.
    #[default]
    Linear,
}

/// Texture coordinate wrapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Tiled.
    #[default]
    Repeat,
    /// Tiled, every second tile mirrored.
    MirroredRepeat,
    /// Edge texels go on.
    ClampToEdge,
}

/// RGBA texels of 8 or 16 bits a channel, row 0 at the top; colours sRGB-encoded, all else linear, as each use of the image
/// says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// URI or name.
    pub name: String,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// `width * height` texels; of 16 bits their high bytes, and behind them as many low bytes.
    pub texels: Vec<[u8; 4]>,
}

impl Image {
    /// Texels.
    pub(super) fn count(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Low bytes of its texels; none where they have 8 bits a channel.
    pub(crate) fn low_bytes(&self) -> &[[u8; 4]] {
        self.texels.get(self.count()..).unwrap_or_default()
    }
}

/// Linear value of an sRGB-encoded one in [0, 1] (IEC 61966-2-1).
pub(crate) fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}
