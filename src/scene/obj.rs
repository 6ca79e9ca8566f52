//! Wavefront OBJ and MTL import.
//!
//! OBJ has no units, lights, cameras or instances: lengths are taken as metres and Y as up. Each `o` begins a
//! mesh. Polygons are split into fans, so concave ones come out wrong. Texture coordinates are turned
//! upside down, for OBJ counts v from the bottom.
//!
//! | MTL | material |
//! |---|---|
//! | `Kd`, `map_Kd` | base colour (0.8 without `Kd`, 1 if there is a map) |
//! | `Ks` | factor on the dielectric reflection, as in `KHR_materials_specular`; 0 without it |
//! | `Ns` | roughness (2/(Ns + 2))^¼: a Phong lobe as wide as a microfacet one of α² = 2/(Ns + 2) (Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007, section 5), glTF's roughness being √α; 1 without it |
//! | `Ke`, `map_Ke` | emitted radiance (W/(sr·m²); without `Ke` 0, or 1 if there is a map) |
//! | `d`, `Tr` | alpha (1 − `Tr`), blended if below 1 |
//! | `illum` 3, 5 | a mirror of colour `Ks` if that is not black |
//! | `illum` 4, 9 | thin clear glass, `illum` 6, 7: solid clear glass; `Ni` is the index of refraction |
//!
//! All else in a material, `Tf` and other maps among it, is left out.

use super::file::{self, Files};
use super::import::{self, Mended};
use super::limits::{MAX_TEXELS, MAX_TRIANGLES, MAX_VERTICES};
use super::origin::Around;
use super::{
    AlphaMode, Image, Instance, LoadOptions, Material, Mesh, Scene, SceneError, TextureRef, TextureTransform,
    Volume, Wrap,
};
use glam::{Affine3A, DAffine3, DVec3, Vec2, Vec3, Vec4};
use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use std::str::SplitWhitespace;

/// Loads an `.obj` file and the `.mtl` files it names.
///
/// # Errors
/// [`SceneError`] names the file (the `.mtl` where that is at fault), the line and the defect.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    if let Some(scene) = &options.scene {
        return Err(SceneError::new(path, "scenes", format!("no scene `{scene}`: an OBJ file is one scene")));
    }
    let (files, mended) = (Files::of(path, options)?, Mended::new(options));
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let text = read_text(path)?;
    let read = |origin| -> Result<Reader<'_>, SceneError> {
        let mut reader = Reader::new(path, &files, &mended, name.clone(), origin);
        for (number, line) in statements(&text) {
            reader.statement(&line).map_err(|defect| match defect {
                Defect::Here(problem) => SceneError::new(path, format!("line {number}"), problem),
                Defect::There(error) => error,
            })?;
        }
        reader.end_mesh();
        Ok(reader)
    };
    let reader = read(DVec3::ZERO)?;
    let placed = vec![DAffine3::IDENTITY; reader.scene.instances.len()];
    match Around::of(&reader.scene, &placed, 0.0) {
        Some(around) => read(around.origin)?.finish(),
        None => reader.finish(),
    }
}

/// A defect in the line at hand, or one located already in another file.
enum Defect {
    Here(String),
    There(SceneError),
}

impl From<String> for Defect {
    fn from(problem: String) -> Self {
        Self::Here(problem)
    }
}

impl From<SceneError> for Defect {
    fn from(error: SceneError) -> Self {
        Self::There(error)
    }
}

fn read_text(path: &Path) -> Result<String, SceneError> {
    let bytes = file::read_file(path).map_err(|problem| SceneError::new(path, "file", problem))?;
    // Names may be in any encoding; what is not UTF-8 matters to nobody but them.
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Lines without comments, those ending in `\` joined with the next, numbered from 1.
fn statements(text: &str) -> Vec<(usize, Cow<'_, str>)> {
    let mut all: Vec<(usize, Cow<'_, str>)> = Vec::new();
    let mut continued = false;
    for (i, line) in text.lines().enumerate() {
        // A `#` inside a word belongs to a name.
        let is_comment = |&(at, _): &(usize, &str)| at == 0 || line[..at].ends_with(char::is_whitespace);
        let end = line.match_indices('#').find(is_comment).map_or(line.len(), |(at, _)| at);
        let line = line[..end].trim();
        let (line, goes_on) = line.strip_suffix('\\').map_or((line, false), |line| (line, true));
        match all.last_mut().filter(|_| continued) {
            Some((_, before)) => before.to_mut().extend([" ", line]),
            None if !line.is_empty() => all.push((i + 1, Cow::Borrowed(line))),
            None => {}
        }
        continued = goes_on;
    }
    all
}

fn number(word: &str) -> Result<f32, String> {
    match word.parse::<f32>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(value) => Err(format!("{value} is not finite")),
        Err(_) => Err(format!("`{word}` is not a number")),
    }
}

fn numbers(words: SplitWhitespace<'_>) -> Result<Vec<f32>, String> {
    words.map(number).collect()
}

/// Position, texture coordinate and normal of a face's corner; indices from 0.
type Corner = (u32, Option<u32>, Option<u32>);

struct Reader<'a> {
    path: &'a Path,
    files: &'a Files,
    mended: &'a Mended,
    scene: Scene,
    positions: Vec<Vec3>,
    /// One a position once a vertex has a colour.
    colors: Vec<Vec4>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    material: Option<u32>,
    by_name: HashMap<String, u32>,
    libraries: BTreeSet<String>,
    images: HashMap<String, u32>,
    mesh: Mesh,
    corners: HashMap<Corner, u32>,
    has_uv: bool,
    has_normals: bool,
    triangles: usize,
    points_and_lines: usize,
    skipped: BTreeSet<String>,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path, files: &'a Files, mended: &'a Mended, name: String, origin: DVec3) -> Self {
        Self {
            path,
            files,
            mended,
            scene: Scene { name, origin, ..Scene::default() },
            positions: Vec::new(),
            colors: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            material: None,
            by_name: HashMap::new(),
            libraries: BTreeSet::new(),
            images: HashMap::new(),
            mesh: Mesh::default(),
            corners: HashMap::new(),
            has_uv: false,
            has_normals: false,
            triangles: 0,
            points_and_lines: 0,
            skipped: BTreeSet::new(),
        }
    }

    fn statement(&mut self, line: &str) -> Result<(), Defect> {
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        let rest = line[keyword.len()..].trim();
        match keyword {
            "v" => {
                let values = numbers(words.clone())?;
                self.vertex(&values, words)?;
            }
            "vt" => match numbers(words)?[..] {
                [u] => self.uvs.push(Vec2::new(u, 1.0)),
                [u, v] | [u, v, _] => self.uvs.push(Vec2::new(u, 1.0 - v)),
                _ => return Err(Defect::Here("a texture coordinate has 1 to 3 numbers".into())),
            },
            "vn" => match numbers(words)?[..] {
                [x, y, z] => self.normals.push(import::unit_normal(Vec3::new(x, y, z))),
                _ => return Err(Defect::Here("a normal has 3 numbers".into())),
            },
            "f" => self.face(words)?,
            "l" | "p" => self.points_and_lines += 1,
            "o" => {
                self.end_mesh();
                self.mesh.name = rest.to_owned();
            }
            "usemtl" => match self.by_name.get(rest) {
                Some(&material) => self.material = Some(material),
                None => return Err(Defect::Here(format!("material `{rest}` is in no mtllib read so far"))),
            },
            "mtllib" => self.libraries(rest)?,
            "g" | "s" => {}
            other => {
                self.skipped.insert(other.chars().take(16).collect());
            }
        }
        Ok(())
    }

    /// `words` are those of `values`.
    fn vertex(&mut self, values: &[f32], words: SplitWhitespace<'_>) -> Result<(), String> {
        let color = match *values {
            [_, _, _] | [_, _, _, _] => None,
            [_, _, _, r, g, b] => Some(Vec4::new(r, g, b, 1.0).clamp(Vec4::ZERO, Vec4::ONE)),
            _ => return Err(format!("a vertex has 3, 4 or 6 numbers, this one {}", values.len())),
        };
        if self.positions.len() >= MAX_VERTICES {
            return Err(format!("more than {MAX_VERTICES} vertices"));
        }
        if let Some(color) = color {
            self.colors.resize(self.positions.len(), Vec4::ONE);
            self.colors.push(color);
        } else if !self.colors.is_empty() {
            self.colors.push(Vec4::ONE);
        }
        let mut position = Vec3::new(values[0], values[1], values[2]);
        if self.scene.origin != DVec3::ZERO {
            let exact: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
            position = self.scene.local(DVec3::from_slice(&exact));
        }
        self.positions.push(position);
        Ok(())
    }

    fn corner(&self, word: &str) -> Result<Corner, String> {
        let index = |text: &str, what: &str, count: usize| {
            let value: i64 = text.parse().map_err(|_| format!("`{word}` is not a corner of a face"))?;
            let index = if value < 0 { count as i64 + value } else { value - 1 };
            match u32::try_from(index) {
                Ok(index) if (index as usize) < count => Ok(index),
                _ => Err(format!("{what} {value} of `{word}`, but there are {count} so far")),
            }
        };
        let parts: Vec<&str> = word.split('/').collect();
        let (v, vt, vn) = match parts[..] {
            [v] => (v, "", ""),
            [v, vt] => (v, vt, ""),
            [v, vt, vn] => (v, vt, vn),
            _ => return Err(format!("`{word}` is not a corner of a face")),
        };
        let optional =
            |text: &str, what, count| (!text.is_empty()).then(|| index(text, what, count)).transpose();
        Ok((
            index(v, "vertex", self.positions.len())?,
            optional(vt, "texture coordinate", self.uvs.len())?,
            optional(vn, "normal", self.normals.len())?,
        ))
    }

    fn face(&mut self, words: SplitWhitespace<'_>) -> Result<(), String> {
        let corners = words.map(|word| self.corner(word)).collect::<Result<Vec<_>, _>>()?;
        if corners.len() < 3 {
            return Err(format!("a face has at least 3 corners, this one {}", corners.len()));
        }
        self.triangles += corners.len() - 2;
        if self.triangles > MAX_TRIANGLES {
            return Err(format!("more than {MAX_TRIANGLES} triangles"));
        }
        let material = match self.material {
            Some(material) => material,
            None => {
                self.scene
                    .materials
                    .push(Material { base_color: Vec4::new(0.8, 0.8, 0.8, 1.0), ..plain("default") });
                let default = self.scene.materials.len() as u32 - 1;
                self.material = Some(default);
                default
            }
        };
        let vertices: Vec<u32> = corners.into_iter().map(|corner| self.mesh_vertex(corner)).collect();
        for pair in vertices[1..].windows(2) {
            self.mesh.triangles.push([vertices[0], pair[0], pair[1]]);
            self.mesh.materials.push(material);
        }
        Ok(())
    }

    fn mesh_vertex(&mut self, corner: Corner) -> u32 {
        let (v, vt, vn) = corner;
        self.has_uv |= vt.is_some();
        self.has_normals |= vn.is_some();
        *self.corners.entry(corner).or_insert_with(|| {
            self.mesh.positions.push(self.positions[v as usize]);
            self.mesh.uv0.push(vt.map_or(Vec2::ZERO, |i| self.uvs[i as usize]));
            self.mesh.normals.push(vn.map_or(Vec3::ZERO, |i| self.normals[i as usize]));
            if let Some(&color) = self.colors.get(v as usize) {
                self.mesh.colors.resize(self.mesh.positions.len() - 1, Vec4::ONE);
                self.mesh.colors.push(color);
            }
            self.mesh.positions.len() as u32 - 1
        })
    }

    fn end_mesh(&mut self) {
        self.corners.clear();
        let (has_uv, has_normals) = (std::mem::take(&mut self.has_uv), std::mem::take(&mut self.has_normals));
        let mut mesh = std::mem::take(&mut self.mesh);
        if mesh.triangles.is_empty() {
            return;
        }
        if mesh.name.is_empty() {
            mesh.name.clone_from(&self.scene.name);
        }
        if !has_uv {
            mesh.uv0 = Vec::new();
        }
        if !has_normals {
            mesh.normals = Vec::new();
        }
        if !mesh.colors.is_empty() {
            mesh.colors.resize(mesh.positions.len(), Vec4::ONE);
        }
        let instance = Instance {
            name: mesh.name.clone(),
            mesh: self.scene.meshes.len() as u32,
            transform: Affine3A::IDENTITY,
        };
        self.scene.instances.push(instance);
        self.scene.meshes.push(mesh);
    }

    /// One file whose name may hold spaces, or several.
    fn libraries(&mut self, names: &str) -> Result<(), Defect> {
        let names = names.replace('\\', "/");
        if self.files.find(&names).is_ok() {
            return self.library(&names);
        }
        names.split_whitespace().try_for_each(|name| self.library(name))
    }

    fn library(&mut self, name: &str) -> Result<(), Defect> {
        if !self.libraries.insert(name.to_owned()) {
            return Ok(());
        }
        let path = self.files.find(name)?.path;
        let mut open: Option<Mtl> = None;
        for (number, line) in statements(&read_text(&path)?) {
            let located = |problem| SceneError::new(&path, format!("line {number}"), problem);
            let mut words = line.split_whitespace();
            let keyword = words.next().unwrap_or_default();
            let rest = line[keyword.len()..].trim();
            if keyword == "newmtl" {
                if rest.is_empty() {
                    return Err(located("newmtl without a name".into()).into());
                }
                self.add(open.replace(Mtl { name: rest.to_owned(), line: number, ..Mtl::default() }), &path)?;
            } else {
                let material =
                    open.as_mut().ok_or_else(|| located(format!("`{keyword}` before the first newmtl")))?;
                if !material.statement(keyword, rest, number).map_err(located)? {
                    self.skipped.insert(format!("{} (MTL)", keyword.chars().take(16).collect::<String>()));
                }
            }
        }
        Ok(self.add(open, &path)?)
    }

    fn add(&mut self, mtl: Option<Mtl>, path: &Path) -> Result<(), SceneError> {
        let Some(mtl) = mtl else { return Ok(()) };
        let mut material = mtl.material();
        let maps =
            [(mtl.map, &mut material.base_color_texture), (mtl.emission_map, &mut material.emission_texture)];
        for (map, texture) in maps {
            if let Some((line, map)) = map {
                let located = |problem| SceneError::new(path, format!("line {line}"), problem);
                *texture = Some(self.texture(map).map_err(located)?);
            }
        }
        let element = format!("line {}", mtl.line);
        material.check().map_err(|problem| {
            SceneError::new(path, element, format!("material `{}`: {problem}", mtl.name))
        })?;
        self.by_name.insert(mtl.name, self.scene.materials.len() as u32);
        self.scene.materials.push(material);
        Ok(())
    }

    fn texture(&mut self, map: Map) -> Result<TextureRef, String> {
        let image = match self.images.get(&map.file) {
            Some(&image) => image,
            None => {
                let path = self.files.find(&map.file)?.path;
                let read =
                    || -> Result<Image, String> { file::decode_image(&map.file, &file::read_file(&path)?) };
                self.scene.images.push(read().map_err(|problem| format!("`{}` {problem}", map.file))?);
                if self.scene.images.iter().map(|image| image.texels.len()).sum::<usize>() > MAX_TEXELS {
                    return Err(format!("more than {MAX_TEXELS} texels up to here"));
                }
                let image = self.scene.images.len() as u32 - 1;
                self.images.insert(map.file.clone(), image);
                image
            }
        };
        Ok(TextureRef { image, ..map.reference })
    }

    fn finish(self) -> Result<Scene, SceneError> {
        let mut scene = self.scene;
        if self.points_and_lines > 0 {
            scene.notes.push(format!("{} statements of points or lines are left out", self.points_and_lines));
        }
        if !self.skipped.is_empty() {
            let words: Vec<String> = self.skipped.into_iter().take(16).collect();
            scene.notes.push(format!("statements left out: {}", words.join(", ")));
        }
        scene.notes.extend(self.mended.notes());
        import::finish(scene, self.path, "file")
    }
}

/// A surface without a specular lobe, two-sided as OBJ's are.
fn plain(name: &str) -> Material {
    Material::diffuse(name, Vec3::ONE)
}

/// What an MTL material says of itself.
#[derive(Default)]
struct Mtl {
    name: String,
    line: usize,
    diffuse: Option<Vec3>,
    specular: Vec3,
    emission: Option<Vec3>,
    shininess: Option<f32>,
    alpha: Option<f32>,
    ior: Option<f32>,
    illumination: u32,
    map: Option<(usize, Map)>,
    emission_map: Option<(usize, Map)>,
}

/// `map_Kd` or `map_Ke`.
struct Map {
    file: String,
    /// All but the image.
    reference: TextureRef,
}

impl Mtl {
    /// Takes in a statement; false if it is one that is left out.
    fn statement(&mut self, keyword: &str, rest: &str, line: usize) -> Result<bool, String> {
        let words = || rest.split_whitespace();
        let one = || words().next().ok_or_else(|| "a number is missing".to_owned()).and_then(number);
        match keyword {
            "Kd" => self.diffuse = Some(color(words())?),
            "Ks" => self.specular = color(words())?,
            "Ke" => self.emission = Some(color(words())?),
            "Ns" => self.shininess = Some(one()?),
            "Ni" => self.ior = Some(one()?),
            "d" => self.alpha = Some(number(words().find(|&word| word != "-halo").unwrap_or_default())?),
            "Tr" => self.alpha = Some(1.0 - one()?),
            "illum" => {
                self.illumination =
                    rest.parse().map_err(|_| format!("`{rest}` is not an illumination model"))?;
            }
            "map_Kd" => self.map = Some((line, map(rest)?)),
            "map_Ke" => self.emission_map = Some((line, map(rest)?)),
            _ => return Ok(false),
        }
        if self.shininess.is_some_and(|ns| ns < 0.0) {
            return Err("Ns is negative".into());
        }
        Ok(true)
    }

    fn material(&self) -> Material {
        let base = self.diffuse.unwrap_or(Vec3::splat(if self.map.is_some() { 1.0 } else { 0.8 }));
        let emission =
            self.emission.unwrap_or(Vec3::splat(if self.emission_map.is_some() { 1.0 } else { 0.0 }));
        let alpha = self.alpha.unwrap_or(1.0);
        let strongest = self.specular.max_element();
        let mut material = Material {
            base_color: base.extend(alpha),
            roughness: self.shininess.map_or(1.0, |ns| (2.0 / (ns + 2.0)).powf(0.25)),
            emission,
            specular: strongest,
            specular_color: if strongest > 0.0 { self.specular / strongest } else { Vec3::ONE },
            alpha_mode: if alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
            ..plain(&self.name)
        };
        match self.illumination {
            3 | 5 if strongest > 0.0 => {
                material.metallic = 1.0;
                material.roughness = 0.0;
                material.base_color = self.specular.extend(alpha);
                material.specular = 1.0;
                material.specular_color = Vec3::ONE;
            }
            4 | 6 | 7 | 9 => {
                material.base_color = Vec4::ONE;
                material.roughness = 0.0;
                material.transmission = 1.0;
                material.ior = self.ior.unwrap_or(1.5);
                material.specular = 1.0;
                material.specular_color = Vec3::ONE;
                material.alpha_mode = AlphaMode::Opaque;
                let solid = Volume { attenuation_distance: f32::INFINITY, attenuation_color: Vec3::ONE };
                material.volume = matches!(self.illumination, 6 | 7).then_some(solid);
            }
            _ => {}
        }
        material
    }
}

/// One number stands for three.
fn color(words: SplitWhitespace<'_>) -> Result<Vec3, String> {
    match numbers(words)?[..] {
        [grey] => Ok(Vec3::splat(grey)),
        [r, g, b] => Ok(Vec3::new(r, g, b)),
        _ => Err("a colour has 1 or 3 numbers".into()),
    }
}

/// Options and file name of a texture statement.
fn map(text: &str) -> Result<Map, String> {
    let (mut offset, mut scale) = (Vec2::ZERO, Vec2::ONE);
    let mut reference = TextureRef {
        image: 0,
        uv_set: 0,
        sampler: Default::default(),
        transform: TextureTransform::default(),
    };
    let mut words = text.split_whitespace().peekable();
    while let Some(option) = words.next_if(|word| word.starts_with('-')) {
        match option {
            "-o" | "-s" | "-t" => {
                let mut values = Vec::new();
                while let Some(value) =
                    words.peek().filter(|_| values.len() < 3).and_then(|word| number(word).ok())
                {
                    values.push(value);
                    words.next();
                }
                let Some(&u) = values.first() else { return Err(format!("{option} lacks its numbers")) };
                match option {
                    "-o" => offset = Vec2::new(u, values.get(1).copied().unwrap_or(0.0)),
                    "-s" => scale = Vec2::new(u, values.get(1).copied().unwrap_or(1.0)),
                    _ => {}
                }
            }
            "-mm" => {
                words.nth(1);
            }
            "-clamp" => {
                if words.next() == Some("on") {
                    reference.sampler.wrap_u = Wrap::ClampToEdge;
                    reference.sampler.wrap_v = Wrap::ClampToEdge;
                }
            }
            _ => {
                words.next();
            }
        }
    }
    // v was turned upside down: 1 − (s·(1 − v) + o) = s·v + (1 − s − o).
    reference.transform.offset = Vec2::new(offset.x, 1.0 - scale.y - offset.y);
    reference.transform.scale = scale;
    let file = words.collect::<Vec<_>>().join(" ").replace('\\', "/");
    if file.is_empty() {
        return Err("the texture's file name is missing".into());
    }
    Ok(Map { file, reference })
}
