//! Statements of a material, and the material they make.

use super::picture::Channel;
use super::text::{COMMA, CUT, Numbers, finite, number};
use crate::scene::{AlphaMode, Clearcoat, Material, NormalMap, TextureRef, TextureTransform, Volume, Wrap};
use glam::{Vec2, Vec3, Vec4};

/// How far outside 0 … 1 a factor may be for it to be taken for rounding.
const HAIR: f64 = 0.1;

/// What an MTL material says of itself.
#[derive(Default)]
pub(super) struct Mtl {
    /// All that follows `newmtl`.
    pub(super) name: String,
    pub(super) line: usize,
    diffuse: Option<Vec3>,
    specular: Option<Vec3>,
    emission: Option<Vec3>,
    shininess: Option<f32>,
    dissolve: Option<f32>,
    transparency: Option<f32>,
    ior: Option<f32>,
    illumination: u32,
    roughness: Option<f32>,
    metalness: Option<f32>,
    coat: f32,
    coat_roughness: f32,
    pub(super) maps: Maps,
    /// The line of the first statement that is broken and can't be left out, and what is wrong with it.
    pub(super) defect: Option<(usize, String)>,
}

/// Pictures as a material names them, each with the line it is in.
#[derive(Default)]
pub(super) struct Maps {
    pub(super) diffuse: Option<Map>,
    pub(super) specular: Option<Map>,
    pub(super) emission: Option<Map>,
    pub(super) alpha: Option<Map>,
    pub(super) roughness: Option<Map>,
    pub(super) metalness: Option<Map>,
    pub(super) bump: Option<Map>,
    pub(super) normal: Option<Map>,
}

/// A picture that a material names.
#[derive(Clone)]
pub(super) struct Map {
    pub(super) line: usize,
    pub(super) file: String,
    /// All but the image.
    pub(super) reference: TextureRef,
    /// `-bm`
    pub(super) bump: f32,
    /// `-imfchan`
    pub(super) channel: Option<Channel>,
}

/// Those of its pictures that are there.
#[derive(Default)]
pub(super) struct Textures {
    pub(super) diffuse: Option<TextureRef>,
    /// What the alpha in `diffuse` means, where there is one.
    pub(super) alpha: Option<AlphaMode>,
    pub(super) specular: Option<TextureRef>,
    pub(super) emission: Option<TextureRef>,
    pub(super) roughness_and_metalness: Option<TextureRef>,
    pub(super) normal: Option<NormalMap>,
}

/// What became of a statement.
pub(super) enum Taken {
    All,
    /// All but what these words say, which changes the picture little.
    But(String, &'static str),
    /// There is no place for it.
    LeftOut,
}

const CLAMPED: &str = "factors a hair outside 0 … 1 are clamped";
const SKIPPED: &str = "such statements are left out";

impl Mtl {
    pub(super) fn new(name: &str, line: usize) -> Self {
        Self { name: name.to_owned(), line, ..Self::default() }
    }

    /// Takes in a statement; `code` is what follows the keyword without a comment, `rest` all.
    pub(super) fn statement(
        &mut self,
        keyword: &str,
        code: &str,
        rest: &str,
        line: usize,
    ) -> Result<Taken, String> {
        if let Some(slot) = self.maps.slot(keyword) {
            return Ok(match Map::of(code, rest, line) {
                Some(map) => {
                    *slot = Some(map);
                    Taken::All
                }
                None => Taken::But("the texture's file name is missing".into(), SKIPPED),
            });
        }
        if keyword == "illum" {
            let model = Numbers::of(code).values().first().copied().filter(|model| model.fract() == 0.0);
            let Some(model) = model else {
                return Ok(Taken::But(format!("`{code}` is not an illumination model"), SKIPPED));
            };
            self.illumination = model as u32;
            return Ok(Taken::All);
        }
        let color = match keyword {
            "kd" | "ks" | "ke" => true,
            "ns" | "ni" | "d" | "tr" | "pr" | "pm" | "pc" | "pcr" => false,
            _ => return Ok(Taken::LeftOut),
        };
        let code = code.strip_prefix("-halo").unwrap_or(code);
        if color && (code.starts_with("spectral") || code.starts_with("xyz")) {
            return Ok(Taken::LeftOut);
        }
        let numbers = Numbers::of(code);
        let mut values = [0.0; 3];
        let count = if color { numbers.values().len().min(3) } else { numbers.values().len().min(1) };
        match (count, numbers.rest) {
            (0, None) => return Err("a number is missing".into()),
            (0, Some(word)) => return Err(format!("`{word}` is not a number")),
            (2, Some(word)) => return Err(format!("`{word}` is not a number")),
            (2, None) => return Err("a colour has 1 or 3 numbers".into()),
            (1, _) => values = [numbers.values()[0]; 3],
            _ => values.copy_from_slice(&numbers.values()[..3]),
        }
        let mut taken = match (numbers.comma, numbers.rest.or(numbers.values().get(count).map(|_| code))) {
            (Some(word), _) => Taken::But(format!("`{word}` has a comma"), COMMA),
            (None, Some(rest)) => Taken::But(format!("`{rest}` follows a number"), CUT),
            (None, None) => Taken::All,
        };
        let (low, high) = match keyword {
            "ns" => (f64::NEG_INFINITY, f64::INFINITY),
            "ni" => (1.0, f64::INFINITY),
            "ke" => (0.0, f64::INFINITY),
            _ => (0.0, 1.0),
        };
        for value in &mut values {
            let near = value.clamp(low, high);
            if *value != near && (*value - near).abs() <= HAIR {
                taken = Taken::But(format!("{keyword} is {value}"), CLAMPED);
                *value = near;
            }
        }
        let [r, g, b] = values.map(finite);
        let (one, three) = (r.clone()?, Vec3::new(r?, g?, b?));
        match keyword {
            "kd" => self.diffuse = Some(three),
            "ks" => self.specular = Some(three),
            "ke" => self.emission = Some(three),
            "ns" if one < 0.0 => return Ok(Taken::But("Ns is negative".into(), SKIPPED)),
            "ns" => self.shininess = Some(one),
            "ni" => self.ior = Some(one),
            "d" => self.dissolve = Some(one),
            "tr" => self.transparency = Some(one),
            "pr" => self.roughness = Some(one),
            "pm" => self.metalness = Some(one),
            "pc" => self.coat = one,
            _ => self.coat_roughness = one,
        }
        Ok(taken)
    }

    /// Whether `Tr` says other than `d`, which is the one that counts.
    pub(super) fn contradicts_itself(&self) -> bool {
        self.dissolve.zip(self.transparency).is_some_and(|(d, tr)| (d + tr - 1.0).abs() > 1e-3)
    }

    /// Whether its base colour is not its own.
    pub(super) fn lacks_color(&self, textures: &Textures) -> bool {
        let picture = textures.diffuse.is_some() && self.maps.diffuse.is_some();
        self.diffuse.is_none() && !picture
    }

    pub(super) fn material(&self, textures: &Textures) -> Material {
        let white = |texture: Option<TextureRef>| Vec3::splat(if texture.is_some() { 1.0 } else { 0.0 });
        let stand_in = Vec3::splat(if self.lacks_color(textures) { 0.8 } else { 1.0 });
        let alpha = self.dissolve.or(self.transparency.map(|tr| 1.0 - tr)).unwrap_or(1.0);
        let specular = self.specular.unwrap_or(white(textures.specular));
        let strongest = specular.max_element();
        let mut material = Material {
            base_color: self.diffuse.unwrap_or(stand_in).extend(alpha),
            base_color_texture: textures.diffuse,
            roughness: self.shininess.map_or(1.0, |ns| (2.0 / (ns + 2.0)).powf(0.25)),
            emission: self.emission.unwrap_or(white(textures.emission)),
            emission_texture: textures.emission,
            specular: strongest,
            specular_color: if strongest > 0.0 { specular / strongest } else { Vec3::ONE },
            specular_color_texture: textures.specular.filter(|_| strongest > 0.0),
            normal_map: textures.normal,
            alpha_mode: if alpha < 1.0 {
                AlphaMode::Blend
            } else {
                textures.alpha.unwrap_or(AlphaMode::Opaque)
            },
            ..plain(&self.name)
        };
        let full = |material: &mut Material| {
            material.specular = 1.0;
            material.specular_color = Vec3::ONE;
            material.specular_color_texture = None;
        };
        let rough = textures.roughness_and_metalness;
        let is_glass = matches!(self.illumination, 4 | 6 | 7 | 9);
        let is_physical = self.roughness.is_some() || self.metalness.is_some() || rough.is_some();
        if is_physical {
            let or_one = |map: &Option<Map>, other| if map.is_some() { 1.0 } else { other };
            let otherwise = or_one(&self.maps.roughness, material.roughness);
            material.roughness = self.roughness.unwrap_or(otherwise);
            material.metallic = self.metalness.unwrap_or(or_one(&self.maps.metalness, 0.0));
            material.metallic_roughness_texture = rough;
            full(&mut material);
        } else if matches!(self.illumination, 3 | 5) && strongest > 0.0 {
            material.metallic = 1.0;
            material.roughness = 0.0;
            material.base_color = specular.extend(alpha);
            full(&mut material);
        }
        if is_glass {
            material.base_color = Vec4::ONE;
            material.roughness = self.roughness.unwrap_or(0.0);
            material.transmission = 1.0;
            material.ior = self.ior.unwrap_or(1.5);
            full(&mut material);
            material.alpha_mode = AlphaMode::Opaque;
            let solid = Volume { attenuation_distance: f32::INFINITY, attenuation_color: Vec3::ONE };
            material.volume = matches!(self.illumination, 6 | 7).then_some(solid);
        }
        if self.coat > 0.0 {
            let coat =
                Clearcoat { factor: self.coat, roughness: self.coat_roughness, ..Clearcoat::default() };
            material.clearcoat = Some(coat);
        }
        material
    }
}

impl Maps {
    fn slot(&mut self, keyword: &str) -> Option<&mut Option<Map>> {
        Some(match keyword {
            "map_kd" => &mut self.diffuse,
            "map_ks" => &mut self.specular,
            "map_ke" => &mut self.emission,
            "map_d" => &mut self.alpha,
            "map_pr" => &mut self.roughness,
            "map_pm" => &mut self.metalness,
            "bump" | "map_bump" => &mut self.bump,
            "norm" | "map_norm" => &mut self.normal,
            _ => return None,
        })
    }
}

impl Map {
    /// Options and file name of a texture statement; none without a name. A comment may be part of the name.
    fn of(code: &str, rest: &str, line: usize) -> Option<Self> {
        let (mut offset, mut scale) = (Vec2::ZERO, Vec2::ONE);
        let mut map = Self {
            line,
            file: String::new(),
            reference: TextureRef {
                image: 0,
                uv_set: 0,
                sampler: Default::default(),
                transform: TextureTransform::default(),
            },
            bump: 1.0,
            channel: None,
        };
        let mut words = code.split_whitespace().peekable();
        let mut file = Vec::new();
        while let Some(word) = words.next() {
            match word {
                "-o" | "-s" | "-t" => {
                    let mut values = [None; 3];
                    for value in &mut values {
                        *value = words.peek().and_then(|word| finite(number(word)?).ok());
                        if value.is_none() {
                            break;
                        }
                        words.next();
                    }
                    match word {
                        "-o" => offset = Vec2::new(values[0].unwrap_or(0.0), values[1].unwrap_or(0.0)),
                        "-s" => scale = Vec2::new(values[0].unwrap_or(1.0), values[1].unwrap_or(1.0)),
                        _ => {}
                    }
                }
                "-mm" => {
                    words.nth(1);
                }
                "-clamp" => {
                    if words.next() == Some("on") {
                        map.reference.sampler.wrap_u = Wrap::ClampToEdge;
                        map.reference.sampler.wrap_v = Wrap::ClampToEdge;
                    }
                }
                "-bm" => {
                    let factor = words.next().and_then(|word| finite(number(word)?).ok());
                    map.bump = factor.unwrap_or(1.0);
                }
                "-imfchan" => map.channel = words.next().and_then(Channel::of),
                "-blendu" | "-blendv" | "-boost" | "-cc" | "-colorspace" | "-texres" | "-type" => {
                    words.next();
                }
                _ if file.is_empty() && word.starts_with('-') && words.peek().is_some() => {
                    words.next();
                }
                _ => file.push(word),
            }
        }
        // v was turned upside down: 1 − (s·(1 − v) + o) = s·v + (1 − s − o).
        map.reference.transform.offset = Vec2::new(offset.x, 1.0 - scale.y - offset.y);
        map.reference.transform.scale = scale;
        // A name without options may hold anything.
        let has_options = file.len() < code.split_whitespace().count();
        map.file = if !has_options { rest.to_owned() } else { file.join(" ") };
        (!map.file.is_empty()).then_some(map)
    }
}

/// A surface without a specular lobe, two-sided as OBJ's are.
pub(super) fn plain(name: &str) -> Material {
    Material::diffuse(name, Vec3::ONE)
}
