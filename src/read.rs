//! Reading files whose length nobody vouches for.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// The whole of a file, a pipe or a device.
///
/// # Errors
/// What the system says, or that there are more than `limit` bytes.
pub(crate) fn at_most(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let too_long = || io::Error::new(io::ErrorKind::FileTooLarge, format!("more than {limit} bytes"));
    if file.metadata()?.len() > limit {
        return Err(too_long());
    }
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit { Err(too_long()) } else { Ok(bytes) }
}

/// The same of a regular file alone: whoever opens a pipe may wait for ever.
///
/// # Errors
/// As [`at_most`], or that it is something else.
pub(crate) fn regular(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "is not a file"));
    }
    at_most(path, limit)
}

/// Most bytes of a file of settings.
pub(crate) const SETTINGS: u64 = 1 << 24;

/// Most bytes of a file of results.
pub(crate) const RESULTS: u64 = 1 << 30;

/// As [`at_most`], as text.
///
/// # Errors
/// As [`at_most`], or that it is not UTF-8. A byte order mark is no part of it.
pub(crate) fn text(path: &Path, limit: u64) -> io::Result<String> {
    let bytes = at_most(path, limit)?;
    let text = std::str::from_utf8(without_mark(&bytes));
    text.map(str::to_owned).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

/// Refuses text in UTF-16, with a mark or without one.
///
/// # Errors
/// It is such.
pub(crate) fn narrow(bytes: &[u8]) -> Result<(), &'static str> {
    match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [1..=255, 0, 1..=255, 0, ..] | [0, 1..=255, 0, 1..=255, ..] => {
            Err("is UTF-16, and only UTF-8 is read")
        }
        _ => Ok(()),
    }
}

/// `bytes` behind a byte order mark of UTF-8, which editors put before any text.
pub(crate) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// More bytes of pixels than OpenEXR's compressions put into one: Deflate puts 1032 zeros there, the others fewer.
const EXR_RATIO: u64 = 2048;

/// Bytes of memory that the pixels of an OpenEXR file of `length` bytes take once they are read; those of its largest part.
///
/// # Errors
/// The file is too short to hold its pixels.
pub(crate) fn exr_bytes(meta: &exr::meta::MetaData, length: u64) -> Result<u64, String> {
    let mut most = 0;
    for header in &meta.headers {
        let channels = header.channels.list.iter();
        let pixel: u64 = channels.map(|channel| channel.sample_type.bytes_per_sample() as u64).sum();
        let (width, height) = (header.layer_size.width() as u64, header.layer_size.height() as u64);
        let bytes = width.saturating_mul(height).saturating_mul(pixel);
        if bytes / EXR_RATIO > length {
            return Err(format!("{width}x{height} pixels can't be in a file of {length} bytes"));
        }
        most = most.max(bytes);
    }
    // Blocks are decoded beside the pixels.
    Ok(most.saturating_mul(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_longer_is_an_error_whatever_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.toml");
        std::fs::write(&file, "\u{feff}seed = 1").unwrap();
        assert_eq!(text(&file, 11).unwrap(), "seed = 1");
        assert_eq!(text(&file, 10).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        std::fs::write(&file, [0xff]).unwrap();
        assert_eq!(text(&file, 11).unwrap_err().kind(), io::ErrorKind::InvalidData);
        assert_eq!(regular(folder.path(), 11).unwrap_err().kind(), io::ErrorKind::InvalidInput);
        #[cfg(unix)]
        assert_eq!(at_most(Path::new("/dev/zero"), 1 << 20).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
    }
}
