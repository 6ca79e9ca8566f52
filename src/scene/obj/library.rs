//! Materials of .mtl files and their pictures.

use super::mtl::{Map, Mtl, Taken, Textures, plain};
use super::picture::{self, Channel, Scalar};
use super::source::Source;
use super::text::{brief, split, statements, uncommented};
use crate::scene::file;
use crate::scene::{Fault, Image, MAX_TEXELS, Material, NormalMap, SceneError, TextureRef, Wrap};
use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// All that the libraries of a scene hold.
#[derive(Default)]
pub(super) struct Library {
    pub(super) materials: Vec<Material>,
    /// Materials whose base colour stands in for one that they lack.
    pub(super) lacks_color: HashSet<u32>,
    /// What is wrong with materials that nothing can be made of.
    defects: HashMap<u32, SceneError>,
    /// Kinds of statements left out.
    pub(super) skipped: BTreeSet<String>,
    /// The line of the `mtllib`, and the material.
    by_name: HashMap<String, Vec<(usize, u32)>>,
    read: HashSet<PathBuf>,
    files: HashMap<PathBuf, Rc<Image>>,
    /// Where in `images` what was made of pictures is.
    made: HashMap<Key, u32>,
    images: Vec<Rc<Image>>,
    texels: usize,
}

/// Bytes that a material takes, with its names in several lists.
const MATERIAL: u64 = 4 * size_of::<Material>() as u64;

const NO_LIBRARY: &str = "materials of such libraries are the default one";

/// What a picture of the scene is made of, and how.
type Key = Vec<(PathBuf, Option<Channel>, Kind)>;

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Kind {
    Plain,
    Alpha,
    Rough,
    /// Of heights, tiled or not.
    Normals(bool),
}

impl Library {
    /// The material that `usemtl` in `line` means, and whether its library came before.
    pub(super) fn find(&self, name: &str, line: usize) -> Option<(u32, bool)> {
        let named = self.by_name.get(name).or_else(|| self.by_name.get(uncommented(name)))?;
        // In the order of their libraries.
        match named.partition_point(|&(library, _)| library < line) {
            0 => named.first().map(|&(_, material)| (material, false)),
            before => Some((named[before - 1].1, true)),
        }
    }

    /// Refuses a material that a surface is made of and that is broken.
    pub(super) fn check(&mut self, material: u32) -> Result<(), SceneError> {
        self.defects.remove(&material).map_or(Ok(()), Err)
    }

    pub(super) fn images(&mut self) -> Vec<Image> {
        self.files.clear();
        let images = std::mem::take(&mut self.images);
        images.into_iter().map(Rc::unwrap_or_clone).collect()
    }

    /// The libraries of an `mtllib` statement: one file whose name may hold spaces, or several.
    pub(super) fn read(&mut self, source: &Source<'_>, line: usize, names: &str) -> Result<(), SceneError> {
        let is_there = |name: &str| source.is_there(name);
        let bare = uncommented(names);
        let several: Vec<&str> = bare.split_whitespace().collect();
        if is_there(names) || names.is_empty() {
            return self.library(source, line, names);
        }
        if is_there(bare) || !several.iter().any(|name| is_there(name)) && several.len() < 3 {
            return self.library(source, line, bare);
        }
        several.into_iter().try_for_each(|name| self.library(source, line, name))
    }

    fn library(&mut self, source: &Source<'_>, line: usize, name: &str) -> Result<(), SceneError> {
        let found = match source.find(source.path, line, "", name)? {
            Ok(found) => found,
            Err(problem) => {
                let own = format!("{}.mtl", source.path.file_stem().unwrap_or_default().to_string_lossy());
                let own = source.find(source.path, line, "", &own)?.ok();
                let instead = if own.is_some() { "the one named as the scene is taken" } else { NO_LIBRARY };
                source.mend(source.path, line, problem, instead)?;
                let Some(own) = own else { return Ok(()) };
                own
            }
        };
        if !self.read.insert(found.path.clone()) {
            return Ok(());
        }
        let path = source.beside_scene(&found.path);
        match source.text(&path)? {
            Ok(text) => self.statements(source, line, &path, &text),
            Err(problem) => {
                source.mend(source.path, line, format!("`{}` {problem}", file::shortened(name)), NO_LIBRARY)
            }
        }
    }

    fn statements(
        &mut self,
        source: &Source<'_>,
        library: usize,
        path: &Path,
        text: &str,
    ) -> Result<(), SceneError> {
        let mut open: Option<Mtl> = None;
        for (line, statement) in statements(text) {
            let (keyword, rest) = split(&statement);
            if keyword == "newmtl" {
                if rest.is_empty() {
                    source.mend(
                        path,
                        line,
                        "newmtl without a name",
                        "it is the material of a usemtl without one",
                    )?;
                }
                source
                    .take(MATERIAL)
                    .map_err(|shortage| SceneError::short(path, format!("line {line}"), shortage))?;
                self.close(source, library, path, open.replace(Mtl::new(rest, line)))?;
                continue;
            }
            let Some(material) = &mut open else {
                let problem = format!("`{}` before the first newmtl", brief(&keyword));
                source.mend(path, line, problem, "such statements are left out")?;
                continue;
            };
            let taken = material.statement(&keyword, uncommented(rest), rest, line);
            match taken {
                Err(problem) => {
                    material.defect.get_or_insert((line, problem));
                }
                Ok(Taken::All) => {}
                Ok(Taken::But(problem, remedy)) => source.mend(path, line, problem, remedy)?,
                Ok(Taken::LeftOut) => {
                    let written = statement.split_whitespace().next().unwrap_or_default();
                    self.skipped.insert(format!("{} (MTL)", brief(written)));
                }
            }
        }
        self.close(source, library, path, open)
    }

    /// Adds a material all of whose statements are read.
    fn close(
        &mut self,
        source: &Source<'_>,
        library: usize,
        path: &Path,
        mtl: Option<Mtl>,
    ) -> Result<(), SceneError> {
        let Some(mut mtl) = mtl else { return Ok(()) };
        if mtl.contradicts_itself() {
            source.mend(path, mtl.line, "d and Tr contradict each other", "d is the one that counts")?;
        }
        let textures = Shop { library: self, source, path }.textures(&mut mtl)?;
        let mut material = mtl.material(&textures);
        let checked = material
            .check()
            .map_err(|problem| (mtl.line, format!("material `{}`: {problem}", file::shortened(&mtl.name))));
        let index = self.materials.len() as u32;
        if let Some((line, problem)) = mtl.defect.take().or(checked.err()) {
            source.mend(path, line, &*problem, "no surface is made of such materials")?;
            material = plain(&mtl.name);
            self.defects.insert(index, SceneError::new(path, format!("line {line}"), problem));
        }
        if mtl.lacks_color(&textures) && material.transmission == 0.0 {
            self.lacks_color.insert(index);
        }
        // What looks like a comment may be part of a name, here and where it is used.
        let bare = uncommented(&mtl.name).to_owned();
        if bare != mtl.name {
            self.by_name.entry(bare).or_default().push((library, index));
        }
        self.by_name.entry(mtl.name).or_default().push((library, index));
        self.materials.push(material);
        Ok(())
    }
}

/// Where a material of the file at `path` gets its pictures.
struct Shop<'a> {
    library: &'a mut Library,
    source: &'a Source<'a>,
    path: &'a Path,
}

/// A picture that is there.
struct Picture {
    path: PathBuf,
    image: Rc<Image>,
    map: Map,
}

impl Picture {
    fn scalar(&self, otherwise: Channel) -> Scalar<'_> {
        Scalar { image: &self.image, channel: self.map.channel.unwrap_or(otherwise) }
    }
}

impl Shop<'_> {
    fn textures(&mut self, mtl: &mut Mtl) -> Result<Textures, SceneError> {
        let maps = &mut mtl.maps;
        let mut textures = Textures::default();
        let (color, alpha) = (self.picture(&mut maps.diffuse)?, self.picture(&mut maps.alpha)?);
        if let Some(alpha) = &alpha {
            let scalar = alpha.scalar(picture::opacity_channel(&alpha.image));
            let make = || picture::with_alpha(color.as_ref().map(|color| &*color.image), scalar);
            let texture = self.made(Kind::Alpha, [color.as_ref(), Some(alpha)], make)?;
            textures.alpha = Some(picture::alpha_mode(&self.library.images[texture.image as usize]));
            textures.diffuse = Some(texture);
        } else if let Some(color) = &color {
            textures.diffuse = Some(self.plain(color)?);
        }
        if let Some(specular) = self.picture(&mut maps.specular)? {
            textures.specular = Some(self.plain(&specular)?);
        }
        if let Some(emission) = self.picture(&mut maps.emission)? {
            textures.emission = Some(self.plain(&emission)?);
        }
        let rough = [self.picture(&mut maps.roughness)?, self.picture(&mut maps.metalness)?];
        let rough = rough.each_ref().map(Option::as_ref);
        if rough.iter().any(Option::is_some) {
            let [green, blue] = rough.map(|map| map.map(|map| map.scalar(Channel::Luminance)));
            let make = || picture::roughness_and_metalness(green, blue);
            textures.roughness_and_metalness = Some(self.made(Kind::Rough, rough, make)?);
        }
        if let Some(normal) = self.picture(&mut maps.normal)? {
            textures.normal = Some(NormalMap { texture: self.plain(&normal)?, scale: normal.map.bump });
            if maps.bump.is_some() {
                self.library.skipped.insert("bump beside norm (MTL)".into());
            }
        } else if let Some(bump) = self.picture(&mut maps.bump)? {
            let texture = if picture::shows_normals(&bump.image) {
                let problem = format!("`{}` shows normals, not heights", file::shortened(&bump.map.file));
                self.source.mend(
                    self.path,
                    bump.map.line,
                    problem,
                    "such pictures are taken for normal maps",
                )?;
                self.plain(&bump)?
            } else {
                let sampler = bump.map.reference.sampler;
                let make = || picture::normals_of(bump.scalar(Channel::Luminance), sampler);
                self.made(Kind::Normals(sampler.wrap_u == Wrap::Repeat), [Some(&bump), None], make)?
            };
            textures.normal = Some(NormalMap { texture, scale: bump.map.bump });
        }
        Ok(textures)
    }

    /// The picture of a map; none, and no map any more, where there is none.
    fn picture(&mut self, slot: &mut Option<Map>) -> Result<Option<Picture>, SceneError> {
        let Some(map) = slot.clone() else { return Ok(None) };
        let name = file::shortened(&map.file);
        let folder = self.source.folder_of(self.path);
        let find = |name: &str| self.source.find(self.path, map.line, &folder, name);
        let found = match find(&map.file)? {
            Err(_) if uncommented(&map.file) != map.file => find(uncommented(&map.file))?,
            found => found,
        };
        let problem = match found {
            Err(problem) => problem,
            Ok(found) => match self.decoded(map.line, &found.path, &map.file)? {
                Ok(image) => return Ok(Some(Picture { path: found.path, image, map })),
                Err(problem) => format!("`{name}` {problem}"),
            },
        };
        *slot = None;
        self.source.mend(self.path, map.line, problem, "surfaces go without such pictures")?;
        Ok(None)
    }

    fn decoded(
        &mut self,
        line: usize,
        path: &Path,
        name: &str,
    ) -> Result<Result<Rc<Image>, String>, SceneError> {
        if let Some(known) = self.library.files.get(path) {
            return Ok(Ok(known.clone()));
        }
        match self.source.image(path, name) {
            Ok(image) => {
                let image = Rc::new(image);
                self.library.files.insert(path.to_owned(), image.clone());
                Ok(Ok(image))
            }
            Err(Fault::Broken(problem)) => Ok(Err(problem)),
            Err(short) => Err(short.of(self.path, format!("line {line}"))),
        }
    }

    fn take(&self, line: usize, bytes: u64) -> Result<(), SceneError> {
        self.source
            .take(bytes)
            .map_err(|shortage| SceneError::short(self.path, format!("line {line}"), shortage))
    }

    fn plain(&mut self, picture: &Picture) -> Result<TextureRef, SceneError> {
        let key = vec![(picture.path.clone(), None, Kind::Plain)];
        self.add(key, &picture.map, |_| Ok(picture.image.clone()))
    }

    /// What `make` makes of pictures, placed as the first of them.
    fn made(
        &mut self,
        kind: Kind,
        of: [Option<&Picture>; 2],
        make: impl FnOnce() -> Image,
    ) -> Result<TextureRef, SceneError> {
        let there = || of.into_iter().flatten();
        let key = of.map(|picture| match picture {
            Some(picture) => (picture.path.clone(), picture.map.channel, kind),
            None => (PathBuf::new(), None, kind),
        });
        let Some(first) = there().next() else { unreachable!("something is made of pictures") };
        for other in there().skip(1) {
            let placed = |picture: &Picture| (picture.map.reference.transform, picture.map.reference.sampler);
            if placed(other) != placed(first) {
                let problem = format!("`{}` is placed unlike the other", file::shortened(&other.map.file));
                self.source.mend(
                    self.path,
                    other.map.line,
                    problem,
                    "pictures made one are placed as the first",
                )?;
            }
        }
        self.add(key.into(), &first.map, |shop| {
            let (width, height) = picture::common_size(there().map(|picture| &*picture.image));
            shop.take(first.map.line, u64::from(width) * u64::from(height) * 8)?;
            Ok(Rc::new(make()))
        })
    }

    fn add(
        &mut self,
        key: Key,
        map: &Map,
        make: impl FnOnce(&Self) -> Result<Rc<Image>, SceneError>,
    ) -> Result<TextureRef, SceneError> {
        let image = match self.library.made.get(&key) {
            Some(&known) => known,
            None => {
                let image = make(self)?;
                self.library.texels += image.texels.len();
                if self.library.texels > MAX_TEXELS {
                    let problem = format!("more than {MAX_TEXELS} texels up to here");
                    return Err(SceneError::new(self.path, format!("line {}", map.line), problem));
                }
                self.library.images.push(image);
                let index = self.library.images.len() as u32 - 1;
                self.library.made.insert(key, index);
                index
            }
        };
        Ok(TextureRef { image, ..map.reference })
    }
}
