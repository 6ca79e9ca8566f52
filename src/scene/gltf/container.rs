//! Bytes of a glTF asset: the .glb container, and URIs of buffers and images.

use crate::scene::SceneError;
use crate::scene::file::{self, Files};
use std::borrow::Cow;
use std::path::Path;

/// The JSON text and the binary chunk of a .glb file, or the whole of a .gltf file and none.
///
/// # Errors
/// Names the `header` or the chunk, and the defect.
pub(super) fn split<'a>(file: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>), SceneError> {
    let fail = |element: &str, problem: String| Err(SceneError::new(file, element, problem));
    let Some(header) = bytes.first_chunk::<12>() else { return fail("header", truncated(12, bytes.len())) };
    if &header[..4] != b"glTF" {
        return fail("header", "the file does not begin with the magic `glTF` of a .glb".into());
    }
    let version = word(&header[4..]);
    if version != 2 {
        return fail("header", format!("container version {version}, expected 2"));
    }
    let length = word(&header[8..]);
    let Some(mut rest) = bytes.get(12..length) else {
        let problem = if length < 12 {
            format!("length {length}, expected at least 12")
        } else {
            truncated(length, bytes.len())
        };
        return fail("header", problem);
    };
    let (mut json, mut binary) = (None, None);
    for i in 0.. {
        if rest.is_empty() {
            break;
        }
        let element = format!("chunk {i}");
        let Some(head) = rest.first_chunk::<8>() else { return fail(&element, truncated(8, rest.len())) };
        let size = word(head);
        let Some(data) = rest[8..].get(..size) else {
            return fail(&element, truncated(size, rest.len() - 8));
        };
        if !size.is_multiple_of(4) {
            return fail(&element, format!("length {size} is not a multiple of 4"));
        }
        match (&head[4..], i) {
            (b"JSON", 0) => json = Some(data),
            (b"BIN\0", 1) => binary = Some(data),
            (b"JSON" | b"BIN\0", _) | (_, 0) => {
                let kind = String::from_utf8_lossy(&head[4..]).into_owned();
                return fail(&element, format!("{kind:?} is not the kind of chunk expected here"));
            }
            _ => {}
        }
        rest = &rest[8 + size..];
    }
    match json {
        Some(json) => Ok((json, binary)),
        None => fail("chunk 0", "the JSON chunk is missing".into()),
    }
}

fn word(bytes: &[u8]) -> usize {
    u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize
}

fn truncated(expected: usize, found: usize) -> String {
    format!("truncated: {found} of {expected} bytes")
}

/// The bytes a URI stands for: those in a `data:` URI, or a file among `files`.
///
/// # Errors
/// The defect; the caller knows the element.
pub(super) fn fetch(files: &Files, uri: &str) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (kind, payload) = data.split_once(',').ok_or("its data: URI has no comma")?;
        let payload = percent_decoded(payload)?;
        return if kind.ends_with(";base64") { base64(&payload) } else { Ok(payload.into_owned()) };
    }
    let decoded = String::from_utf8(percent_decoded(uri)?.into_owned())
        .map_err(|_| "its URI is not UTF-8".to_owned())?;
    let found = files.find(&decoded)?;
    file::read_file(&found.path).map_err(|problem| format!("`{}` {problem}", file::shortened(&decoded)))
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
            let problem = fetch(&files, uri).unwrap_err();
            assert!(problem.contains("not a path inside the scene's folder"), "{uri}: {problem}");
        }
        for address in ["file:///etc/hostname", "http://example.org/a.bin", "https%3a//example.org/a.bin"] {
            let problem = fetch(&files, address).unwrap_err();
            assert!(problem.contains("is an address"), "{address}: {problem}");
        }
        assert!(fetch(&files, "a%2").unwrap_err().contains('%'));
        assert!(fetch(&files, "data:application/octet-stream;base64").unwrap_err().contains("comma"));
        assert_eq!(fetch(&files, "data:,a%20b").unwrap(), b"a b");
        assert_eq!(fetch(&files, "data:application/octet-stream;base64,Zm9v").unwrap(), b"foo");
    }
}
