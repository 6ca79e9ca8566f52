//! Bytes of a glTF asset: the .glb container, and URIs of buffers and images.

use crate::memory::Budget;
use crate::scene::file::{self, Files};
use crate::scene::mend::Mended;
use crate::scene::{Fault, SceneError};
use std::borrow::Cow;
use std::cell::RefCell;
use std::path::Path;

/// What is done about a file that is called otherwise.
pub(super) const OTHER_CASE: &str = "case is left out of account";

/// The JSON text of a .glb file, and its binary chunk.
#[derive(Clone, Copy, Default)]
pub(super) struct Chunks<'a> {
    pub(super) json: &'a [u8],
    pub(super) binary: Option<&'a [u8]>,
    /// The first chunk whose length is no multiple of 4.
    unaligned: Option<(usize, usize)>,
    /// Bytes behind the last chunk.
    behind: usize,
}

/// What is in a .glb file. Its length may be wrong where all chunks are there.
///
/// # Errors
/// Names the `header` or the chunk, and the defect.
pub(super) fn split<'a>(file: &Path, bytes: &'a [u8], mended: &Mended) -> Result<Chunks<'a>, SceneError> {
    let defect = |element: String, problem: String| SceneError::new(file, element, problem);
    let fail = |problem: String| Err(defect("header".into(), problem));
    let mend = |element: String, problem: String, remedy| mended.mend(file, defect(element, problem), remedy);
    let Some(header) = bytes.first_chunk::<12>() else { return fail(truncated(12, bytes.len())) };
    if &header[..4] != b"glTF" {
        return fail("the file does not begin with the magic `glTF` of a .glb".into());
    }
    let version = word(&header[4..]);
    if version != 2 {
        return fail(format!("container version {version}, expected 2"));
    }
    let length = word(&header[8..]);
    if length < 12 {
        return fail(format!("length {length}, expected at least 12"));
    }
    let missing = || truncated(length, bytes.len());
    let chunks = match chunks(&bytes[12..length.min(bytes.len())]) {
        Ok(chunks) => {
            if length > bytes.len() {
                mend("header".into(), missing(), "its chunks are whole")?;
            }
            chunks
        }
        Err(_) if length > bytes.len() => return fail(missing()),
        Err((element, problem)) => {
            let Ok(chunks) = chunks(&bytes[12..]) else { return Err(defect(element, problem)) };
            mend("header".into(), format!("length {length}, but its chunks take more"), "they are read")?;
            chunks
        }
    };
    if let Some((i, size)) = chunks.unaligned {
        let problem = format!("length {size} is not a multiple of 4");
        mend(format!("chunk {i}"), problem, "its bytes are read as they are")?;
    }
    if chunks.behind > 0 {
        let problem = format!("{} bytes behind the last chunk", chunks.behind);
        mend("header".into(), problem, "they are left out")?;
    }
    Ok(chunks)
}

fn chunks(mut rest: &[u8]) -> Result<Chunks<'_>, (String, String)> {
    let mut chunks = Chunks::default();
    if rest.is_empty() {
        return Err(("chunk 0".into(), "the JSON chunk is missing".into()));
    }
    for i in 0.. {
        if rest.is_empty() {
            break;
        }
        let fail = |problem| Err((format!("chunk {i}"), problem));
        // Behind the data of the buffer nothing is read; elsewhere zeros are padding.
        let padding = |rest: &[u8]| chunks.binary.is_some() || i > 0 && rest.iter().all(|&byte| byte == 0);
        let Some(head) = rest.first_chunk::<8>() else {
            if padding(rest) {
                chunks.behind = rest.len();
                break;
            }
            return fail(truncated(8, rest.len()));
        };
        let size = word(head);
        let Some(data) = rest[8..].get(..size) else {
            if padding(rest) {
                chunks.behind = rest.len();
                break;
            }
            return fail(truncated(size, rest.len() - 8));
        };
        match (&head[4..], i) {
            (b"JSON", 0) => chunks.json = data,
            (b"BIN\0", 1) => chunks.binary = Some(data),
            (b"JSON" | b"BIN\0", _) | (_, 0) => {
                let kind = String::from_utf8_lossy(&head[4..]).into_owned();
                return fail(format!("{kind:?} is not the kind of chunk expected here"));
            }
            _ => {}
        }
        let (next, padded) = (8 + size, (8 + size).next_multiple_of(4).min(rest.len()));
        if next != padded {
            chunks.unaligned = chunks.unaligned.or(Some((i, size)));
        }
        // Some writers pad what they do not count.
        let begins = |at: usize| rest[at..].get(4..8).is_some_and(|kind| kind == b"BIN\0");
        let is_padding = rest[next..padded].iter().all(|&byte| matches!(byte, 0 | b' '));
        rest = &rest[if is_padding && !begins(next) { padded } else { next }..];
    }
    Ok(chunks)
}

fn word(bytes: &[u8]) -> usize {
    u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize
}

fn truncated(expected: usize, found: usize) -> String {
    format!("truncated: {found} of {expected} bytes")
}

/// What follows `data:`, if that is the scheme of a URI.
pub(super) fn data(uri: &str) -> Option<&str> {
    uri.split_at_checked(5).filter(|(scheme, _)| scheme.eq_ignore_ascii_case("data:")).map(|(_, data)| data)
}

/// What a URI stands for.
pub(super) struct Fetched {
    pub(super) bytes: Vec<u8>,
    /// What the file is called, where the URI says it otherwise.
    pub(super) differs: Option<String>,
}

/// The bytes in a `data:` URI, or of a file among `files`.
pub(super) fn fetch(files: &Files, uri: &str, budget: &RefCell<Budget>) -> Result<Fetched, Fault> {
    if let Some(data) = data(uri) {
        let (kind, payload) = data.split_once(',').ok_or("its data: URI has no comma")?;
        budget.borrow_mut().take(payload.len() as u64)?;
        let payload = percent_decoded(payload)?;
        let bytes = if kind.to_ascii_lowercase().ends_with(";base64") {
            base64(&payload)?
        } else {
            payload.into_owned()
        };
        return Ok(Fetched { bytes, differs: None });
    }
    let decoded = String::from_utf8(percent_decoded(uri)?.into_owned())
        .map_err(|_| "its URI is not UTF-8".to_owned())?;
    let found = files.find(&decoded)?;
    let bytes = file::read_file(&found.path, &mut budget.borrow_mut()).map_err(|fault| match fault {
        Fault::Broken(problem) => format!("`{}` {problem}", file::shortened(&decoded)).into(),
        short => short,
    })?;
    Ok(Fetched { bytes, differs: found.differs })
}

fn percent_decoded(text: &str) -> Result<Cow<'_, [u8]>, String> {
    if !text.contains('%') {
        return Ok(Cow::Borrowed(text.as_bytes()));
    }
    let mut bytes = text.bytes();
    let mut decoded = Vec::with_capacity(text.len());
    while let Some(byte) = bytes.next() {
        if byte != b'%' {
            decoded.push(byte);
            continue;
        }
        let mut digit = || {
            bytes.next().and_then(|b| (b as char).to_digit(16)).ok_or("its URI has a % without two digits")
        };
        decoded.push((digit()? * 16 + digit()?) as u8);
    }
    Ok(Cow::Owned(decoded))
}

/// RFC 4648, section 4; padding may be absent.
fn base64(text: &[u8]) -> Result<Vec<u8>, String> {
    let padding = text.iter().rev().take_while(|&&c| c == b'=').count();
    let digits = &text[..text.len() - padding];
    if padding > 2 || digits.len() % 4 == 1 || (padding > 0 && !text.len().is_multiple_of(4)) {
        return Err("its base64 data is truncated".into());
    }
    let mut bytes = Vec::with_capacity(digits.len() / 4 * 3 + 2);
    for group in digits.chunks(4) {
        let mut bits = 0_u32;
        for &c in group {
            let digit = match c {
                b'A'..=b'Z' => c - b'A',
                b'a'..=b'z' => c - b'a' + 26,
                b'0'..=b'9' => c - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return Err(format!("{:?} is not a base64 digit", c as char)),
            };
            bits = bits << 6 | u32::from(digit);
        }
        bits <<= 6 * (4 - group.len());
        bytes.extend_from_slice(&bits.to_be_bytes()[1..group.len()]);
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::LoadOptions;

    /// The test vectors of RFC 4648, section 10, with and without padding.
    #[test]
    fn base64_vectors() {
        let vectors = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ];
        for (plain, encoded) in vectors {
            assert_eq!(base64(encoded.as_bytes()).unwrap(), plain.as_bytes());
            assert_eq!(base64(encoded.trim_end_matches('=').as_bytes()).unwrap(), plain.as_bytes());
        }
        for broken in ["Z", "Zg=", "Zg===", "Zm9v=", "Zm 9", "Zm9\u{e9}"] {
            assert!(base64(broken.as_bytes()).is_err(), "{broken}");
        }
    }

    #[test]
    fn uris_stay_in_the_folder() {
        let scene = Path::new("/nowhere/scene.gltf");
        let files = Files::of(scene, &LoadOptions::default()).unwrap();
        let read = |uri: &str| match fetch(&files, uri, &RefCell::new(Budget::of(1 << 20))) {
            Ok(fetched) => Ok(fetched.bytes),
            Err(Fault::Broken(problem)) => Err(problem),
            Err(Fault::Short(shortage)) => Err(shortage.to_string()),
        };
        let refused = [
            "/etc/hostname",
            "../a.bin",
            "a/../../b.bin",
            "%2e%2e/a.bin",
            "%2E%2E%2Fa.bin",
            "..%5ca.bin",
            "..\\a.bin",
            "C:/a.bin",
            "//host/a.bin",
            "%2fetc/hostname",
            "a%00.bin",
            "",
        ];
        for uri in refused {
            let problem = read(uri).unwrap_err();
            assert!(problem.contains("not a path inside the scene's folder"), "{uri}: {problem}");
        }
        for address in ["file:///etc/hostname", "http://example.org/a.bin", "https%3a//example.org/a.bin"] {
            let problem = read(address).unwrap_err();
            assert!(problem.contains("is an address"), "{address}: {problem}");
        }
        assert!(read("a%2").unwrap_err().contains('%'));
        assert!(read("data:application/octet-stream;base64").unwrap_err().contains("comma"));
        assert_eq!(read("data:,a%20b").unwrap(), b"a b");
        assert_eq!(read("DATA:application/octet-stream;base64,Zm9v").unwrap(), b"foo");
        let long = format!("data:,{}", "a".repeat(2 << 20));
        assert_eq!(read(&long).unwrap_err(), "takes 2.0 MiB of memory, and there are 1.0 MiB left");
    }
}
