//! Files that a scene consists of, and the images in them.

use super::{Fault, Image, LoadOptions, MAX_IMAGE_SIDE, SceneError};
use crate::memory::Budget;
use crate::read;
use std::ffi::OsStr;
use std::io::Cursor;
use std::path::{Component, Path, PathBuf};

/// Largest file read (bytes), the most a .glb can say of itself.
const MAX_FILE_BYTES: u64 = u32::MAX as u64;

/// Reads a regular file, whose length is taken of `budget` first; anything else (a folder, a pipe that would block) is an
/// error.
pub(super) fn read_file(path: &Path, budget: &mut Budget) -> Result<Vec<u8>, Fault> {
    budget.take(path.metadata().map_or(0, |file| file.len()))?;
    let refused = |error: std::io::Error| format!("can't be read: {error}");
    match read::regular(path, MAX_FILE_BYTES) {
        Err(error) if error.kind() == std::io::ErrorKind::InvalidInput => Err("is not a file".into()),
        read => Ok(read.map_err(refused)?),
    }
}

/// Where the files that a scene names are found: in the folder of its own file, and in those that the user names beside it.
/// What else a name or a link leads to is as if it were not there.
pub(super) struct Files {
    folder: PathBuf,
    /// Real paths of the folders beside it.
    roots: Vec<PathBuf>,
}

/// Most parts of a path that a file is searched by, from its end.
const DEEPEST: usize = 16;

/// A file that a scene names.
pub(super) struct Found {
    /// Its real path.
    pub(super) path: PathBuf,
    /// How it is called beside what was written, where that differs.
    pub(super) differs: Option<String>,
}

impl Files {
    /// # Errors
    /// A folder of the user's that is none.
    pub(super) fn of(scene: &Path, options: &LoadOptions) -> Result<Self, SceneError> {
        let real = |root: &PathBuf| {
            let folder = root.canonicalize().and_then(|folder| folder.read_dir().map(|_| folder));
            folder.map_err(|error| SceneError::new(root, "root folder", error.to_string()))
        };
        let roots = options.roots.iter().map(real).collect::<Result<_, _>>()?;
        let folder = match scene.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        Ok(Self { folder: folder.to_owned(), roots })
    }

    /// The file of this name, as it is written or but for case.
    ///
    /// # Errors
    /// It is not there, or neither in the scene's folder nor in one of the user's.
    pub(super) fn find(&self, name: &str) -> Result<Found, String> {
        if let Some((scheme, _)) = name.split_once("://").filter(|(scheme, _)| is_scheme(scheme)) {
            return Err(format!("`{}` is an address ({scheme}), and only files are read", shortened(name)));
        }
        let outside =
            || format!("`{}` is not a path inside the scene's folder or one of --root", shortened(name));
        // Windows reads `\` and drive letters where others see a plain name: refuse them everywhere.
        if name.is_empty() || name.contains(['\\', ':', '\0']) {
            return Err(outside());
        }
        let path = self.folder.join(name);
        if let Ok(real) = path.canonicalize() {
            return if self.allows(&real) { Ok(Found { path: real, differs: None }) } else { Err(outside()) };
        }
        let inside =
            Path::new(name).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
        if !inside {
            return Err(outside());
        }
        match self.but_for_case(&self.folder, name) {
            Some(path) => Ok(Found { differs: Some(file_name(&path)), path }),
            None => Err(format!("`{}` is not there", shortened(name))),
        }
    }

    /// The file of this name; else one under it without its first folders, as files that were moved from where they were
    /// made still name the old place: `C:\models\wood.png`, `/home/me/wood.png`, `../maps/wood.png`.
    ///
    /// # Errors
    /// As [`find`](Self::find) has them, of the name as it is.
    pub(super) fn search(&self, name: &str) -> Result<Found, String> {
        let found = self.find(name);
        if found.is_ok() || name.contains('\0') {
            return found;
        }
        let slashed = name.replace('\\', "/");
        let parts: Vec<&str> = slashed.split('/').filter(|part| !matches!(*part, "" | "." | "..")).collect();
        let parts = match parts.split_first() {
            Some((drive, rest)) if drive.ends_with(':') => rest,
            _ => &parts[..],
        };
        // A file lies a few folders deep.
        let parts = &parts[parts.len().saturating_sub(DEEPEST)..];
        let folders = || std::iter::once(&self.folder).chain(&self.roots);
        let rest =
            (0..parts.len()).flat_map(|from| folders().map(move |folder| (folder, parts[from..].join("/"))));
        for (folder, rest) in rest {
            if let Some(path) = self.but_for_case(folder, &rest) {
                let differs = (rest != name).then(|| file_name(&path));
                return Ok(Found { path, differs });
            }
        }
        found
    }

    /// The real path of `name` in `folder`, each of its parts as it is or else but for case; the first by name of several.
    fn but_for_case(&self, folder: &Path, name: &str) -> Option<PathBuf> {
        let mut path = folder.canonicalize().ok()?;
        for part in name.split('/').filter(|part| !matches!(*part, "" | ".")) {
            let exact = path.join(part);
            let next = if exact.exists() {
                exact
            } else {
                let alike = |name: &OsStr| {
                    name.to_str().is_some_and(|name| name.to_lowercase() == part.to_lowercase())
                };
                let names = path.read_dir().ok()?.filter_map(|entry| Some(entry.ok()?.file_name()));
                path.join(names.filter(|name| alike(name)).min()?)
            };
            path = next.canonicalize().ok().filter(|path| self.allows(path))?;
        }
        Some(path)
    }

    fn allows(&self, real: &Path) -> bool {
        let folder = self.folder.canonicalize();
        folder.iter().chain(&self.roots).any(|folder| real.starts_with(folder))
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// RFC 3986, section 3.1; a single letter is a drive.
fn is_scheme(text: &str) -> bool {
    let mut bytes = text.bytes();
    text.len() > 1
        && bytes.next().is_some_and(|b| b.is_ascii_alphabetic())
        && bytes.all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b))
}

/// A name as messages quote it: of any length, cut to what a line holds.
pub(super) fn shortened(name: &str) -> String {
    const LONGEST: usize = 200;
    if name.chars().count() <= LONGEST {
        return name.to_owned();
    }
    let start: String = name.chars().take(LONGEST / 2).collect();
    format!("{start}… ({} bytes)", name.len())
}

/// Formats of images that are not read: what files of them begin with, from which byte, and the extension of glTF that
/// allows them.
const OTHER_FORMATS: &[(usize, &[u8], &str)] = &[
    (8, b"WEBP", "WebP: EXT_texture_webp"),
    (1, b"KTX 20", "KTX2: KHR_texture_basisu"),
    (0, b"DDS ", "DDS: MSFT_texture_dds"),
    (4, b"ftypavif", "AVIF: EXT_texture_avif"),
];

/// Decodes PNG or JPEG of any depth and colour type into RGBA, of 16 bits a channel where 8 do not hold what is there.
pub(super) fn decode_image(name: &str, bytes: &[u8], budget: &mut Budget) -> Result<Image, Fault> {
    let corrupt = |error: &dyn std::fmt::Display| format!("can't be decoded: {error}");
    let open = || image::ImageReader::new(Cursor::new(bytes)).with_guessed_format();
    let mut reader = open().map_err(|e| corrupt(&e))?;
    if !matches!(reader.format(), Some(image::ImageFormat::Png | image::ImageFormat::Jpeg)) {
        let found = |&&(at, magic, _): &&(usize, &[u8], &str)| {
            bytes.get(at..).is_some_and(|bytes| bytes.starts_with(magic))
        };
        let other = OTHER_FORMATS.iter().find(found);
        let other = other.map_or(String::new(), |(.., other)| format!(" but {other} is not supported"));
        return Err(format!("is neither PNG nor JPEG{other}").into());
    }
    // What the decoder makes and what is kept, of up to 16 bits a channel each.
    let size = open().ok().and_then(|reader| reader.into_dimensions().ok());
    let (width, height) = size.filter(|&(w, h)| w.max(h) <= MAX_IMAGE_SIDE).unwrap_or_default();
    let texels = u64::from(width) * u64::from(height);
    let mut transient = *budget;
    transient.take(16 * texels)?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_IMAGE_SIDE);
    limits.max_image_height = Some(MAX_IMAGE_SIDE);
    limits.max_alloc = Some(u64::from(MAX_IMAGE_SIDE) * u64::from(MAX_IMAGE_SIDE) * 8);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|e| corrupt(&e))?;
    let (width, height) = (decoded.width(), decoded.height());
    let mut texels: Vec<[u8; 4]> = Vec::new();
    let color = decoded.color();
    if color.bytes_per_pixel() == 2 * color.channel_count() {
        let samples = decoded.into_rgba16().into_raw();
        let plane =
            |shift: u32| samples.chunks_exact(4).map(move |s| [0, 1, 2, 3].map(|i| (s[i] >> shift) as u8));
        texels.extend(plane(8));
        // 257 v of 65 535 is v of 255.
        if samples.iter().any(|sample| sample % 257 != 0) {
            texels.extend(plane(0));
        }
    } else {
        texels = bytemuck::cast_vec(decoded.into_rgba8().into_raw());
    }
    budget.take(4 * texels.len() as u64)?;
    Ok(Image { name: name.to_owned(), width, height, texels })
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    /// Whatever a scene calls them and wherever links lead, files are found in its folder and in those named beside it.
    #[test]
    fn nothing_outside_is_found() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        for folder in ["scene/maps", "beside"] {
            fs::create_dir_all(at(folder)).unwrap();
        }
        for file in ["scene/maps/Wood.png", "scene/iron.png", "beside/clay.png", "secret.png"] {
            fs::write(at(file), file).unwrap();
        }
        symlink(at("secret.png"), at("scene/link.png")).unwrap();
        symlink(at("beside"), at("scene/door")).unwrap();
        symlink("maps/Wood.png", at("scene/inner.png")).unwrap();
        let scene = at("scene/a.obj");
        let closed = Files::of(&scene, &LoadOptions::default()).unwrap();
        let options = LoadOptions { roots: vec![at("beside")], ..LoadOptions::default() };
        let open = Files::of(&scene, &options).unwrap();
        let named = |found: Result<Found, String>| found.ok().map(|found| file_name(&found.path));
        let absolute = at("scene/iron.png").display().to_string();
        let cases = [
            ("iron.png", Some("iron.png"), Some("iron.png")),
            ("./maps/../iron.png", Some("iron.png"), Some("iron.png")),
            ("MAPS/wood.PNG", Some("Wood.png"), Some("Wood.png")),
            ("inner.png", Some("Wood.png"), Some("Wood.png")),
            (&absolute, Some("iron.png"), Some("iron.png")),
            ("link.png", None, None),
            ("../secret.png", None, None),
            ("door/clay.png", None, Some("clay.png")),
            ("../beside/clay.png", None, Some("clay.png")),
            ("..\\beside\\clay.png", None, None),
            ("C:/iron.png", None, None),
            ("", None, None),
        ];
        for (name, inside, beside) in cases {
            assert_eq!(named(closed.find(name)).as_deref(), inside, "{name}");
            assert_eq!(named(open.find(name)).as_deref(), beside, "{name} with a root");
        }
        for name in ["C:\\models\\maps\\wood.png", "/gone/maps/Wood.png", "../maps/wood.png", "wood.png"] {
            let found = named(closed.search(name));
            assert_eq!(found.as_deref(), (name != "wood.png").then_some("Wood.png"), "{name}");
        }
        assert_eq!(named(open.search("D:\\clay.png")).as_deref(), Some("clay.png"));
        for name in ["link.png", "x/link.png", "../../secret.png", "door/clay.png"] {
            assert!(closed.search(name).is_err(), "{name}");
        }
        let problem = Files::of(&scene, &LoadOptions { roots: vec![at("none")], ..LoadOptions::default() });
        assert!(problem.err().unwrap().to_string().contains("none: root folder: "));
        assert!(closed.find("https://example.org/a.png").err().unwrap().contains("is an address (https)"));
    }
}
