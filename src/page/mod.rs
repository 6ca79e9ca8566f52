//! Pages that are one file each: style, program and data within, so that they open from disk and need no network.

use serde::Serialize;

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("page.js");

/// Puts the shared style, the shared script and `data` in the places that `template` marks.
///
/// Of the JSON every `<` is escaped, which outside strings it never has, so that nothing in it ends its element.
pub(crate) fn fill(template: &str, data: &impl Serialize) -> String {
    let json = serde_json::to_string(data).expect("maps with text as keys").replace('<', "\\u003c");
    template.replace("{{style}}", STYLE).replace("{{script}}", SCRIPT).replace("{{data}}", &json)
}
