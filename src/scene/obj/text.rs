//! Text of .obj and .mtl files: encodings, lines, statements and numbers.

use crate::read;
use std::borrow::Cow;

/// Remedies that several kinds of statements share.
pub(super) const COMMA: &str = "it is taken for a decimal point";
pub(super) const CUT: &str = "what follows the numbers of a statement is left out";

/// What bytes say. Names may be in any encoding; what is not UTF-8 is read as Latin-1.
///
/// # Errors
/// They are UTF-16, or no text at all.
pub(super) fn decoded(bytes: Vec<u8>) -> Result<String, String> {
    read::narrow(&bytes)?;
    if bytes.starts_with(b"glTF") {
        return Err("is binary glTF: its name ends in .glb".into());
    }
    Ok(match std::str::from_utf8(read::without_mark(&bytes)) {
        Ok(text) if text.len() < bytes.len() => text.to_owned(),
        Ok(_) => String::from_utf8(bytes).unwrap_or_default(),
        Err(_) => read::without_mark(&bytes).iter().copied().map(char::from).collect(),
    })
}

/// Lines that end as on any system, numbered from 1.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let ended = |line| str::strip_suffix(line, '\r').unwrap_or(line).split('\r');
    (1..).zip(text.split('\n').flat_map(ended).map(unmarked))
}

/// Files that were put together have a byte order mark in their middle.
fn unmarked(line: &str) -> &str {
    line.trim().trim_start_matches('\u{feff}').trim_start()
}

/// Lines that are not comments, those ending in `\` joined with the next, by the number of their first.
pub(super) fn statements(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = lines(text);
    std::iter::from_fn(move || {
        let (number, line) = lines.find(|(_, line)| !line.is_empty() && !line.starts_with('#'))?;
        let Some(start) = continued(line) else { return Some((number, Cow::Borrowed(line))) };
        let mut whole = start.to_owned();
        for (_, line) in lines.by_ref() {
            whole.push(' ');
            let more = continued(line);
            whole.push_str(more.unwrap_or(line));
            if more.is_none() {
                break;
            }
        }
        Some((number, Cow::Owned(whole)))
    })
}

fn continued(line: &str) -> Option<&str> {
    uncommented(line).strip_suffix('\\')
}

/// What stands before a comment. A `#` inside a word belongs to a name.
pub(super) fn uncommented(line: &str) -> &str {
    let is_comment = |&(at, _): &(usize, &str)| at == 0 || line[..at].ends_with(char::is_whitespace);
    line.match_indices('#').find(is_comment).map_or(line, |(at, _)| line[..at].trim_end())
}

/// The first word in small letters and what follows it.
pub(super) fn split(line: &str) -> (Cow<'_, str>, &str) {
    let line = line.trim_start();
    let (keyword, rest) = line.split_at(line.find(char::is_whitespace).unwrap_or(line.len()));
    let keyword = if keyword.bytes().any(|byte| byte.is_ascii_uppercase()) {
        Cow::Owned(keyword.to_ascii_lowercase())
    } else {
        Cow::Borrowed(keyword)
    };
    (keyword, rest.trim())
}

/// A keyword as notes list it.
pub(super) fn brief(keyword: &str) -> String {
    keyword.chars().take(16).collect()
}

/// The numbers that a statement begins with, eight at most.
pub(super) struct Numbers<'a> {
    values: [f64; 8],
    count: usize,
    /// The first word behind them.
    pub(super) rest: Option<&'a str>,
    /// One written with a comma.
    pub(super) comma: Option<&'a str>,
}

impl<'a> Numbers<'a> {
    pub(super) fn of(text: &'a str) -> Self {
        let mut numbers = Self { values: [0.0; 8], count: 0, rest: None, comma: None };
        for word in text.split_whitespace() {
            let value = number(word).or_else(|| {
                let value = number(&word.replacen(',', ".", 1))?;
                numbers.comma = Some(word);
                Some(value)
            });
            let (Some(value), true) = (value, numbers.count < 8) else {
                numbers.rest = Some(word);
                break;
            };
            numbers.values[numbers.count] = value;
            numbers.count += 1;
        }
        numbers
    }

    pub(super) fn values(&self) -> &[f64] {
        &self.values[..self.count]
    }
}

/// A number; NaN where a program wrote one in whatever way.
pub(super) fn number(word: &str) -> Option<f64> {
    let none = || {
        let bare = word.trim_start_matches(['+', '-']).to_ascii_lowercase();
        // Microsoft's: 1.#QNAN, -1.#IND, 1.#INF, nan(ind).
        (bare.starts_with("nan") || bare.starts_with("1.#")).then_some(f64::NAN)
    };
    word.parse().ok().or_else(none)
}

/// The value as 32 bits hold it.
///
/// # Errors
/// They don't.
pub(super) fn finite(value: f64) -> Result<f32, String> {
    let value = value as f32;
    if value.is_finite() { Ok(value) } else { Err(format!("{value} is not finite")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_and_go_on_as_on_any_system() {
        let text = "v 1\rv 2\r\n\n# no \\\nf 1 \\\r\n 2 # a \\\nmtllib a #1.mtl";
        let found: Vec<_> = statements(text).map(|(number, line)| (number, line.into_owned())).collect();
        let expected = [(1, "v 1"), (2, "v 2"), (5, "f 1  2 # a \\"), (7, "mtllib a #1.mtl")];
        assert_eq!(found, expected.map(|(number, line)| (number, line.to_owned())));
        assert_eq!(uncommented("f 1  2 # a \\"), "f 1  2");
        assert_eq!(uncommented("usemtl a#1"), "usemtl a#1");
    }

    #[test]
    fn encodings_are_told_apart() {
        let text = "usemtl Straße";
        let latin = text.chars().map(|c| u32::from(c) as u8).collect();
        for bytes in [text.into(), ["\u{feff}", text].concat().into_bytes(), latin] {
            assert_eq!(decoded(bytes).as_deref(), Ok(text));
        }
        for to_bytes in [u16::to_be_bytes, u16::to_le_bytes] {
            for text in [text, "\u{feff}v 0 0 0"] {
                let wide: Vec<u8> = text.encode_utf16().flat_map(to_bytes).collect();
                assert!(decoded(wide).unwrap_err().contains("UTF-16"));
            }
        }
    }

    #[test]
    fn numbers_are_read_up_to_what_is_none() {
        let numbers = Numbers::of("+1 .5 1,5 1e400 -1.#IND 2; 3");
        assert_eq!(numbers.values()[..3], [1.0, 0.5, 1.5]);
        assert!(numbers.values()[3..].iter().all(|value| !value.is_finite()));
        assert_eq!((numbers.values().len(), numbers.rest, numbers.comma), (5, Some("2;"), Some("1,5")));
        assert_eq!(Numbers::of("1,2,3").rest, Some("1,2,3"));
    }
}
