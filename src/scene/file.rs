//! Files that a scene consists of, and the images in them.

use super::{Image, MAX_IMAGE_SIDE};
use std::io::Cursor;
use std::path::{Component, Path, PathBuf};

/// Largest file read (bytes), the most a .glb can say of itself.
const MAX_FILE_BYTES: u64 = u32::MAX as u64;

/// Reads a regular file; anything else (a folder, a pipe that would block) is an error.
pub(super) fn read_file(path: &Path) -> Result<Vec<u8>, String> {
    let refused = |error: std::io::Error| format!("can't be read: {error}");
    let metadata = std::fs::metadata(path).map_err(refused)?;
    if !metadata.is_file() {
        return Err("is not a file".into());
    }
    if metadata.len() > MAX_FILE_BYTES {
        return Err(format!("is {} bytes long, expected at most {MAX_FILE_BYTES}", metadata.len()));
    }
    std::fs::read(path).map_err(refused)
}

/// `relative` in the folder of `file`, if it can't lead out of that folder.
pub(super) fn beside(file: &Path, relative: &str) -> Result<PathBuf, String> {
    // Windows reads `\` and drive letters where others see a plain name: refuse them everywhere.
    let inside =
        Path::new(relative).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if relative.is_empty() || !inside || relative.contains(['\\', ':', '\0']) {
        return Err(format!("`{relative}` is not a path inside the scene's folder"));
    }
    Ok(file.parent().unwrap_or(Path::new("")).join(relative))
}

/// Decodes PNG or JPEG of any depth and colour type into RGBA, of 16 bits a channel where 8 do not hold what is there.
pub(super) fn decode_image(name: &str, bytes: &[u8]) -> Result<Image, String> {
    let corrupt = |error: &dyn std::fmt::Display| format!("can't be decoded: {error}");
    let mut reader =
        image::ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| corrupt(&e))?;
    if !matches!(reader.format(), Some(image::ImageFormat::Png | image::ImageFormat::Jpeg)) {
        return Err("is neither PNG nor JPEG".into());
    }
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
    Ok(Image { name: name.to_owned(), width, height, texels })
}
