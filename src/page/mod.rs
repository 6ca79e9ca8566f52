//! Pages that are one file each: style, program and data within, so that they open from disk and need no network.

use crate::text::printable;
use serde::Serialize;
use serde_json::Value;
use std::borrow::Cow;

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("page.js");

/// Puts the shared style, the shared script and `data` in the places that `template` marks.
///
/// Of the JSON every `<` is escaped, which outside strings it never has, so that nothing in it ends its element, and what
/// would turn or break a line of text is shown in its place.
pub(crate) fn fill(template: &str, data: &impl Serialize) -> String {
    let mut data = serde_json::to_value(data).expect("maps with text as keys");
    show(&mut data);
    let json = data.to_string().replace('<', "\\u003c");
    template.replace("{{style}}", STYLE).replace("{{script}}", SCRIPT).replace("{{data}}", &json)
}

/// Makes all texts in `data` printable.
fn show(data: &mut Value) {
    match data {
        Value::String(text) => {
            if let Cow::Owned(printable) = printable(text) {
                *text = printable;
            }
        }
        Value::Array(items) => items.iter_mut().for_each(show),
        Value::Object(members) => {
            let shown = std::mem::take(members).into_iter().map(|(name, mut value)| {
                show(&mut value);
                (printable(&name).into_owned(), value)
            });
            *members = shown.collect();
        }
        _ => {}
    }
}

/// A `data:` URL of a file's contents.
pub(crate) fn data_url(media_type: &str, bytes: &[u8]) -> String {
    format!("data:{media_type};base64,{}", base64(bytes))
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = (0..3).fold(0_u32, |word, i| word << 8 | u32::from(chunk.get(i).copied().unwrap_or(0)));
        for digit in 0..4 {
            let shown = digit <= chunk.len();
            text.push(if shown { DIGITS[(word >> (18 - 6 * digit)) as usize & 63].into() } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_in_the_data_ends_it_or_turns_its_text() {
        let page = fill("{{data}}", &serde_json::json!({ "a\u{202e}": ["</script>\u{1b}[1m\u{85}\n", 1] }));
        assert_eq!(page, r#"{"a\\u{202e}":["\u003c/script>\\u{1b}[1m\\u{85}\\n",1]}"#);
    }

    /// The test vectors of RFC 4648.
    #[test]
    fn base64_is_the_standards() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(base64(&[0xfb, 0xff, 0xbf]), "+/+/");
    }
}
