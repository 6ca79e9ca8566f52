//! Wavefront OBJ and MTL import.
//!
//! OBJ has no units, lights, cameras or instances: lengths are taken as metres and Y as up. Each `o` begins a
//! mesh. Polygons are split into fans where those cover them, and else by cutting ears. Texture coordinates are turned
//! upside down, for OBJ counts v from the bottom. Vertex colours are sRGB and multiply the base colour.
//!
//! | MTL | material |
//! |---|---|
//! | `Kd`, `map_Kd` | base colour (0.8 without `Kd`, 1 if there is a map or the vertices have colours) |
//! | `Ks`, `map_Ks` | factor on the dielectric reflection, as in `KHR_materials_specular`; without `Ks` 0, or 1 if there is a map |
//! | `Ns` | roughness (2/(Ns + 2))^¼: a Phong lobe as wide as a microfacet one of α² = 2/(Ns + 2) (Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007, section 5), glTF's roughness being √α; 1 without it |
//! | `Ke`, `map_Ke` | emitted radiance (W/(sr·m²); without `Ke` 0, or 1 if there is a map) |
//! | `d`, else `Tr` | alpha (1 − `Tr`), blended if below 1 |
//! | `map_d` | alpha: that of the picture where it varies, else its luminance; a mask at 0.5 if nearly all of it is 0 or 1, blended otherwise |
//! | `illum` 3, 5 | a mirror of colour `Ks` if that is not black |
//! | `illum` 4, 9 | thin clear glass, `illum` 6, 7: solid clear glass; `Ni` is the index of refraction |
//! | `Pr`, `Pm`, `map_Pr`, `map_Pm` | roughness and metalness; `Ks` and mirrors by `illum` then count for nothing, and what is no metal reflects by an index of refraction of 1.5 |
//! | `Pc`, `Pcr` | strength and roughness of a clear coat |
//! | `norm` (`map_Norm`) | normal map, `-bm` its scale |
//! | `bump` (`map_Bump`) | a normal map of these heights, white being `-bm` texels above black; a normal map itself if it looks like one |
//!
//! `-imfchan` chooses the channel of a map of one number, luminance by default. All else in a material, `Tf`, `Ps` and other
//! maps among it, is left out.
//!
//! Defects that leave the picture what it should be, or nearly so, are mended and noted: files that are not there or have
//! nearly that name, materials that are in no library, texture coordinates and normals that are not there, numbers in
//! unusual notation. A face without one of its vertices, or a material with values that are none, is an error.

mod library;
mod mtl;
mod picture;
mod polygon;
mod source;
mod text;
mod vertices;

use super::file;
use super::import;
use super::limits::MAX_TRIANGLES;
use super::origin::Around;
use super::{Instance, LoadOptions, Material, Mesh, Scene, SceneError};
use glam::{Affine3A, DAffine3, DVec3, Vec2, Vec3, Vec4};
use library::Library;
use polygon::Splitter;
use source::Source;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;
use std::sync::Arc;
use text::{brief, split, statements, uncommented};
use vertices::Vertices;

/// Loads an `.obj` file and the `.mtl` files it names.
///
/// # Errors
/// [`SceneError`] names the file (the `.mtl` where that is at fault), the line and the defect.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    if let Some(scene) = options.scene.as_ref().filter(|scene| *scene != "0") {
        return Err(SceneError::new(path, "scenes", format!("no scene `{scene}`: an OBJ file is one scene")));
    }
    let source = Source::new(path, options)?;
    let text = source.text(path)?.map_err(|problem| SceneError::new(path, "file", problem))?;
    let vertices = Vertices::read(&source, &text)?;
    let mut library = Library::default();
    for (line, statement) in statements(&text) {
        if let ("mtllib", names) = (&*split(&statement).0, split(&statement).1) {
            library.read(&source, line, names)?;
        }
    }
    let mut reader = Reader::new(&source, &text, vertices, library);
    for (line, statement) in statements(&text) {
        reader.statement(line, &statement)?;
    }
    reader.finish()
}

/// Bytes that an object takes beside its triangles and vertices, with the arrays that hold it.
const MESH: u64 = 2 * (size_of::<Mesh>() + size_of::<Instance>()) as u64 + 256;

/// No texture coordinate or normal.
const NONE: u32 = u32::MAX;

/// Position, texture coordinate and normal of a face's corner; indices from 0.
type Corner = [u32; 3];

struct Reader<'a> {
    source: &'a Source<'a>,
    text: &'a str,
    vertices: Vertices,
    library: Library,
    scene: Scene,
    /// Position, texture coordinate and normal of the vertices of each mesh; positions of meshes are made of them at the end.
    corners: Vec<Vec<Corner>>,
    /// Positions, texture coordinates and normals up to here.
    counts: [usize; 3],
    material: Option<u32>,
    default: Option<u32>,
    /// Materials of surfaces whose vertices have colours, where theirs is a stand-in.
    colored: HashMap<u32, u32>,
    mesh: Mesh,
    open: Vec<Corner>,
    known: HashMap<Corner, u32>,
    splitter: Splitter,
    triangles: usize,
    points_and_lines: usize,
    skipped: BTreeSet<String>,
}

impl<'a> Reader<'a> {
    fn new(source: &'a Source<'a>, text: &'a str, vertices: Vertices, mut library: Library) -> Self {
        let name = source.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let materials = std::mem::take(&mut library.materials);
        let skipped = std::mem::take(&mut library.skipped);
        Self {
            source,
            text,
            vertices,
            library,
            scene: Scene { name, materials, ..Scene::default() },
            corners: Vec::new(),
            counts: [0; 3],
            material: None,
            default: None,
            colored: HashMap::new(),
            mesh: Mesh::default(),
            open: Vec::new(),
            known: HashMap::new(),
            splitter: Splitter::default(),
            triangles: 0,
            points_and_lines: 0,
            skipped,
        }
    }

    fn error(&self, line: usize, problem: impl Into<String>) -> SceneError {
        SceneError::new(self.source.path, format!("line {line}"), problem)
    }

    fn mend(&self, line: usize, problem: impl Into<String>, remedy: &'static str) -> Result<(), SceneError> {
        self.source.mend(self.source.path, line, problem, remedy)
    }

    fn statement(&mut self, line: usize, statement: &str) -> Result<(), SceneError> {
        let (keyword, rest) = split(statement);
        match &*keyword {
            "v" => self.counts[0] += 1,
            "vt" => self.counts[1] += 1,
            "vn" => self.counts[2] += 1,
            "f" | "fo" => self.face(line, uncommented(rest))?,
            "l" | "p" => self.points_and_lines += 1,
            "o" => {
                self.source.take(MESH).map_err(|shortage| self.source.short(shortage))?;
                self.end_mesh();
                rest.clone_into(&mut self.mesh.name);
            }
            "usemtl" => self.material = self.named(line, rest)?,
            "mtllib" | "g" | "s" => {}
            _ => {
                let written = statement.split_whitespace().next().unwrap_or_default();
                self.skipped.insert(brief(written));
            }
        }
        Ok(())
    }

    fn named(&self, line: usize, name: &str) -> Result<Option<u32>, SceneError> {
        const DEFAULT: &str = "such faces have the default material";
        match self.library.find(name, line) {
            Some((material, true)) => return Ok(Some(material)),
            Some((material, false)) => {
                let problem = format!("material `{}` is in no mtllib read so far", file::shortened(name));
                self.mend(line, problem, "those of later ones are taken")?;
                return Ok(Some(material));
            }
            None if name.is_empty() => self.mend(line, "usemtl without a name", DEFAULT)?,
            None => {
                let problem = format!("material `{}` is in no mtllib", file::shortened(name));
                self.mend(line, problem, DEFAULT)?;
            }
        }
        Ok(None)
    }

    /// The corner that a word means, or none where it is no such word.
    fn corner(&self, line: usize, word: &str) -> Result<Option<Corner>, SceneError> {
        let mut corner = [NONE; 3];
        let mut parts = word.split('/');
        for (axis, what) in ["vertex", "texture coordinate", "normal"].into_iter().enumerate() {
            let text = match parts.next() {
                Some("") if axis > 0 => continue,
                Some(text) => text,
                None => break,
            };
            let Ok(value) = text.parse::<i64>() else { return Ok(None) };
            let so_far = self.counts[axis];
            let all =
                [self.vertices.positions.len(), self.vertices.uvs.len(), self.vertices.normals.len()][axis];
            let index = if value < 0 { so_far as i64 + value } else { value - 1 };
            let problem = |count, when| format!("{what} {value} of `{word}`, but there are {count}{when}");
            match u32::try_from(index) {
                Ok(index) if (index as usize) < all => {
                    if index as usize >= so_far {
                        self.mend(line, problem(so_far, " so far"), "those that come later are taken")?;
                    }
                    corner[axis] = index;
                }
                _ => {
                    let problem = if value < 0 { problem(so_far, " so far") } else { problem(all, "") };
                    if axis == 0 {
                        return Err(self.error(line, problem));
                    }
                    self.mend(line, problem, "such corners go without")?;
                }
            }
        }
        if parts.next().is_some() {
            return Ok(None);
        }
        let [position, uv, normal] = &mut corner;
        if self.vertices.positions[*position as usize].is_nan() {
            let (line, problem) = Vertices::defect(self.text, *position);
            return Err(self.error(line, problem));
        }
        // What can't be read is as if it were not there.
        if self.vertices.uvs.get(*uv as usize).is_some_and(|uv| uv.is_nan()) {
            *uv = NONE;
        }
        if self.vertices.normals.get(*normal as usize) == Some(&Vec3::ZERO) {
            *normal = NONE;
        }
        Ok(Some(corner))
    }

    fn face(&mut self, line: usize, words: &str) -> Result<(), SceneError> {
        let mut corners = Vec::new();
        for word in words.split_whitespace() {
            match self.corner(line, word)? {
                Some(corner) => corners.push(corner),
                None if corners.len() >= 3 && !word.starts_with(|c: char| c.is_ascii_digit() || c == '-') => {
                    self.mend(
                        line,
                        format!("`{}` is not a corner of a face", file::shortened(word)),
                        text::CUT,
                    )?;
                    break;
                }
                None => {
                    return Err(
                        self.error(line, format!("`{}` is not a corner of a face", file::shortened(word)))
                    );
                }
            }
        }
        if corners.len() < 3 {
            let problem = format!("a face has at least 3 corners, this one {}", corners.len());
            return self.mend(line, problem, "such faces are left out");
        }
        self.triangles += corners.len() - 2;
        if self.triangles > MAX_TRIANGLES {
            return Err(self.error(line, format!("more than {MAX_TRIANGLES} triangles")));
        }
        let places: Vec<DVec3> =
            corners.iter().map(|corner| self.vertices.positions[corner[0] as usize]).collect();
        let mut triangles = Vec::new();
        let flaw =
            self.splitter.split(&places, &mut triangles).map_err(|problem| self.error(line, problem))?;
        if let Some(problem) = flaw {
            self.mend(line, problem, "triangles of such polygons overlap")?;
        }
        let has_color = corners.iter().any(|corner| self.vertices.color(corner[0]).is_some());
        if let Some(material) = self.material {
            self.library.check(material)?;
        }
        let material = self.material(has_color);
        let before = self.open.len();
        let vertices: Vec<u32> = corners.into_iter().map(|corner| self.vertex(corner)).collect();
        // Twice what they are, as vectors grow, and three times in the map.
        let bytes = (self.open.len() - before) * (2 * VERTEX_BYTES + 4 * size_of::<(Corner, u32)>())
            + triangles.len() * 2 * size_of::<([u32; 3], u32)>();
        self.source.take(bytes as u64).map_err(|shortage| self.source.short(shortage))?;
        for triangle in triangles {
            self.mesh.triangles.push(triangle.map(|corner| vertices[corner as usize]));
            self.mesh.materials.push(material);
        }
        Ok(())
    }

    /// The material of a face; white where colours of vertices are all there is.
    fn material(&mut self, has_color: bool) -> u32 {
        let materials = &mut self.scene.materials;
        let mut add = |material| {
            materials.push(material);
            materials.len() as u32 - 1
        };
        let (material, stands_in) = match self.material {
            Some(material) => (material, self.library.lacks_color.contains(&material)),
            None => {
                let gray = || Material { base_color: Vec4::new(0.8, 0.8, 0.8, 1.0), ..mtl::plain("default") };
                (*self.default.get_or_insert_with(|| add(gray())), true)
            }
        };
        if !(has_color && stands_in) {
            return material;
        }
        let white = || {
            let own = materials[material as usize].clone();
            materials.push(Material { base_color: Vec3::ONE.extend(own.base_color.w), ..own });
            materials.len() as u32 - 1
        };
        *self.colored.entry(material).or_insert_with(white)
    }

    fn vertex(&mut self, corner: Corner) -> u32 {
        *self.known.entry(corner).or_insert_with(|| {
            self.open.push(corner);
            self.open.len() as u32 - 1
        })
    }

    fn end_mesh(&mut self) {
        self.known.clear();
        let mut mesh = std::mem::take(&mut self.mesh);
        let corners = std::mem::take(&mut self.open);
        if mesh.triangles.is_empty() {
            return;
        }
        if mesh.name.is_empty() {
            mesh.name.clone_from(&self.scene.name);
        }
        let Vertices { uvs, normals, .. } = &self.vertices;
        if corners.iter().any(|corner| corner[1] != NONE) {
            let uv = |corner: &Corner| uvs.get(corner[1] as usize).copied().unwrap_or(Vec2::ZERO);
            mesh.uv0 = corners.iter().map(uv).collect();
        }
        if corners.iter().any(|corner| corner[2] != NONE) {
            let normal = |corner: &Corner| normals.get(corner[2] as usize).copied().unwrap_or(Vec3::ZERO);
            mesh.normals = corners.iter().map(normal).collect();
        }
        let colors = || corners.iter().map(|corner| self.vertices.color(corner[0]));
        if colors().any(|color| color.is_some()) {
            mesh.colors = colors().map(|color| color.unwrap_or(Vec4::ONE)).collect();
        }
        let instance = Instance {
            name: mesh.name.clone(),
            mesh: self.scene.meshes.len() as u32,
            transform: Affine3A::IDENTITY,
            moves: false,
        };
        self.scene.instances.push(instance);
        self.scene.meshes.push(mesh.into());
        self.corners.push(corners);
    }

    /// Sets positions about the scene's origin.
    fn place(&mut self) {
        for (mesh, corners) in self.scene.meshes.iter_mut().zip(&self.corners) {
            let place =
                |corner: &Corner| (self.vertices.positions[corner[0] as usize] - self.scene.origin).as_vec3();
            Arc::make_mut(mesh).positions = corners.iter().map(place).collect();
        }
    }

    fn finish(mut self) -> Result<Scene, SceneError> {
        self.end_mesh();
        self.place();
        let placed = vec![DAffine3::IDENTITY; self.scene.instances.len()];
        if let Some(around) = Around::of(&self.scene, &placed, 0.0) {
            self.scene.origin = around.origin;
            self.place();
        }
        let mut scene = self.scene;
        scene.images = self.library.images().into_iter().map(Arc::new).collect();
        for mesh in &mut scene.meshes {
            Arc::make_mut(mesh).generate_tangents(&scene.materials);
        }
        if self.points_and_lines > 0 {
            scene.notes.push(format!("{} statements of points or lines are left out", self.points_and_lines));
        }
        if !self.skipped.is_empty() {
            let words: Vec<String> = self.skipped.into_iter().take(16).collect();
            scene.notes.push(format!("statements left out: {}", words.join(", ")));
        }
        scene.notes.extend(self.source.notes());
        import::finish(scene, self.source.path, "file")
    }
}

/// Of a vertex with all there can be.
const VERTEX_BYTES: usize =
    size_of::<Corner>() + 2 * size_of::<Vec3>() + size_of::<Vec2>() + size_of::<Vec4>();
