//! Names and messages as a person sees them, whatever a file has put into them.

use std::borrow::Cow;

/// Most characters of a message; of a longer one the middle is left out.
const LONGEST: usize = 4000;

/// What does not show, or makes the text around it show otherwise: control characters, ends of lines and paragraphs,
/// embeddings, overrides and isolates of direction. What joins letters is none of these.
fn moves(c: char) -> bool {
    c.is_control() || matches!(c, '\u{2028}' | '\u{2029}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// `text` with each character that would move a cursor, end a line or turn its direction written as Rust writes it:
/// `\n`, `\u{1b}`.
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(moves) {
        return text.into();
    }
    text.chars()
        .fold(String::new(), |mut out, c| {
            match c {
                '\t' | '\n' | '\r' => out.extend(c.escape_default()),
                c if moves(c) => out.extend(c.escape_unicode()),
                c => out.push(c),
            }
            out
        })
        .into()
}

/// [`printable`], line by line.
pub(crate) fn printable_lines(text: &str) -> Cow<'_, str> {
    let kept = |c: char| matches!(c, '\n' | '\t');
    if !text.contains(|c| moves(c) && !kept(c)) {
        return text.into();
    }
    let mut out = String::with_capacity(text.len());
    for part in text.split_inclusive(kept) {
        let end = part.len() - usize::from(part.ends_with(kept));
        out += &printable(&part[..end]);
        out += &part[end..];
    }
    out.into()
}

/// A message of one line: [`printable`], and of bounded length.
pub(crate) fn line(text: &str) -> String {
    printable(&shortened(text)).into_owned()
}

/// A path as a message names it.
#[cfg(feature = "cli")]
pub(crate) fn path(path: &std::path::Path) -> String {
    line(&path.to_string_lossy())
}

/// A name in Markdown, where it stays text.
pub(crate) fn markdown(text: &str) -> String {
    line(text).chars().fold(String::new(), |mut out, c| {
        if matches!(c, '\\' | '`' | '*' | '_' | '[' | ']' | '<' | '>' | '|' | '#' | '&' | '~') {
            out.push('\\');
        }
        out.push(c);
        out
    })
}

/// At most some thousand characters: ends say more than what is between them.
pub(crate) fn shortened(text: &str) -> Cow<'_, str> {
    // No longer in bytes, no longer in characters.
    if text.len() <= LONGEST || text.chars().count() <= LONGEST {
        return text.into();
    }
    let left_out = text.chars().count() - LONGEST;
    let start = text.char_indices().nth(LONGEST / 2).map_or(text.len(), |(at, _)| at);
    let end = text.char_indices().nth_back(LONGEST / 2 - 1).map_or(0, |(at, _)| at);
    format!("{}… ({left_out} characters) …{}", &text[..start], &text[end..]).into()
}

/// JSON, in which such characters stand in strings alone, with those escaped that serialisers leave as they are.
#[cfg(any(feature = "cli", test))]
pub(crate) fn json(json: &str) -> Cow<'_, str> {
    let raw = |c: char| c != '\n' && moves(c);
    if !json.contains(raw) {
        return json.into();
    }
    json.chars()
        .fold(String::with_capacity(json.len()), |mut out, c| {
            if raw(c) {
                out += &format!("\\u{:04x}", u32::from(c));
            } else {
                out.push(c);
            }
            out
        })
        .into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HOSTILE: &str = "a\u{1b}[2K\rb\nerror: c\u{7f}\u{9b}\u{85}\u{2028}\u{202e}\u{2066}d";

    #[test]
    fn what_moves_is_written_out_and_the_rest_stays() {
        let shown = "a\\u{1b}[2K\\rb\\nerror: c\\u{7f}\\u{9b}\\u{85}\\u{2028}\\u{202e}\\u{2066}d";
        assert_eq!(printable(HOSTILE), shown);
        assert_eq!(line(HOSTILE), shown);
        let whole = "Büro 👩\u{200d}👩\u{200d}👧 می\u{200c}خواهم C:\\new \"x\"";
        assert!(matches!(printable(whole), Cow::Borrowed(text) if text == whole));
        assert_eq!(printable_lines("a\tb\u{1b}\n\u{7}c\n"), "a\tb\\u{1b}\n\\u{7}c\n");
    }

    #[test]
    fn names_in_markdown_stay_text() {
        assert_eq!(markdown("a|b <i>*x*\n`"), "a\\|b \\<i\\>\\*x\\*\\\\n\\`");
    }

    #[test]
    fn json_keeps_its_meaning() {
        let value = serde_json::json!({ HOSTILE: [HOSTILE, 1] });
        for text in [value.to_string(), format!("{value:#}")] {
            let escaped = json(&text);
            assert!(!escaped.contains(|c| moves(c) && c != '\n'), "{escaped}");
            assert_eq!(serde_json::from_str::<serde_json::Value>(&escaped).unwrap(), value);
        }
    }

    #[test]
    fn long_messages_keep_their_ends() {
        let message = format!("room.gltf: {}: is no picture", "ä".repeat(300_000));
        let shown = line(&message);
        assert!(shown.starts_with("room.gltf: ää") && shown.ends_with("ää: is no picture"));
        assert!(shown.chars().count() < LONGEST + 40 && shown.contains(" characters) "), "{}", shown.len());
        assert_eq!(line(&"ä".repeat(LONGEST)).chars().count(), LONGEST);
    }

    proptest! {
        #[test]
        fn nothing_shown_moves(text in any::<String>()) {
            prop_assert!(!printable(&text).contains(moves));
            prop_assert!(!printable_lines(&text).contains(|c| moves(c) && !matches!(c, '\n' | '\t')));
            prop_assert_eq!(printable_lines(&text).lines().count(), text.lines().count());
        }
    }
}
