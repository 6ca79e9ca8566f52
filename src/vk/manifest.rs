//! Manifests by which the Vulkan loader finds drivers and layers: it says of a broken one neither which nor why, runs out
//! of memory at one that is no JSON, and crashes at one of other types than it expects.
//!
//! The places are those that the loader looks in on Linux; elsewhere it has others, and none are known here.

use super::Error;
use crate::read;
use serde_json::Value;
use std::env;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// Largest manifest read (bytes).
const MOST: u64 = 1 << 20;

/// Variables that name manifests, or folders of them, in place of those of the system; the first one set counts.
const INSTEAD: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];

/// Variable that names further ones.
const BESIDE: &str = "VK_ADD_DRIVER_FILES";

/// What is wrong with a manifest.
enum Problem {
    /// The loader stops at it, whatever other drivers there are.
    Fatal(String),
    /// The loader passes it over.
    Useless(String),
}

/// Fails where a driver's manifest would stop the loader.
pub(super) fn check() -> Result<(), Error> {
    let manifests: Vec<String> = drivers().iter().filter_map(|file| fatal(file)).collect();
    if manifests.is_empty() { Ok(()) } else { Err(Error::NoDriver { manifests }) }
}

/// What to say where no driver works: each manifest with what is wrong with it.
pub(super) fn no_driver() -> Error {
    let manifests: Vec<String> =
        drivers().iter().map(|file| said(file, &problem(file, true).text())).collect();
    if manifests.is_empty() { Error::NoDevice { found: Vec::new() } } else { Error::NoDriver { manifests } }
}

/// What to say where the loader ran out of memory, as it does at a layer's manifest that is no JSON; `None` where there is
/// no such manifest.
pub(super) fn broken_layer() -> Option<Error> {
    let folders = folders(&["implicit_layer.d", "explicit_layer.d"]);
    let named = ["VK_LAYER_PATH", "VK_ADD_LAYER_PATH"].iter().filter_map(env::var_os);
    let folders = folders.into_iter().chain(named.flat_map(|list| paths(&list)));
    let manifests: Vec<String> =
        folders.flat_map(|folder| in_folder(&folder)).filter_map(|file| fatal(&file)).collect();
    (!manifests.is_empty()).then_some(Error::NoDriver { manifests })
}

/// A value for `VK_DRIVER_FILES` that leaves out manifests of drivers at which the loader would stop; `None` where there
/// are none of them, or no others.
#[must_use]
pub fn usable_drivers() -> Option<OsString> {
    let files = drivers();
    let (broken, good): (Vec<_>, Vec<_>) = files.iter().partition(|file| fatal(file).is_some());
    if broken.is_empty() || good.is_empty() { None } else { env::join_paths(good).ok() }
}

fn fatal(file: &Path) -> Option<String> {
    match problem(file, false) {
        Problem::Fatal(text) => Some(said(file, &text)),
        Problem::Useless(_) => None,
    }
}

fn said(file: &Path, problem: &str) -> String {
    format!("{}: {problem}", file.display())
}

impl Problem {
    fn text(self) -> String {
        let (Self::Fatal(text) | Self::Useless(text)) = self;
        text
    }
}

/// What is wrong with a manifest of which at least this is known, that no driver came of it. With `driver` false it may be
/// a layer's.
fn problem(file: &Path, driver: bool) -> Problem {
    let bytes = match read::regular(file, MOST) {
        Ok(bytes) => bytes,
        // Opening a pipe would never return.
        Err(error) if file.exists() && !file.is_dir() => return Problem::Fatal(error.to_string()),
        Err(error) => return Problem::Useless(error.to_string()),
    };
    if bytes.is_empty() {
        return Problem::Useless("is empty".into());
    }
    // As the loader reads it: behind a byte order mark, and whatever follows.
    let text = read::without_mark(&bytes);
    let json = match serde_json::Deserializer::from_slice(text).into_iter::<Value>().next() {
        Some(Ok(json)) => json,
        Some(Err(error)) => return Problem::Fatal(format!("is not JSON: {error}")),
        None => return Problem::Useless("is empty".into()),
    };
    let about = json.get("ICD");
    let member = |name: &str| about.and_then(|about| about.get(name));
    for (name, value) in [
        ("file_format_version", json.get("file_format_version")),
        ("ICD.library_path", member("library_path")),
        ("ICD.api_version", member("api_version")),
    ] {
        if let Some(value) = value.filter(|value| !value.is_string()) {
            return Problem::Fatal(format!("{name} is {value}, which is no text"));
        }
    }
    let Some(library) = member("library_path").and_then(Value::as_str).filter(|_| driver) else {
        return Problem::Useless("names no library (ICD.library_path)".into());
    };
    // Others are looked for where the system's libraries are.
    let place = file.parent().unwrap_or(Path::new("")).join(library);
    Problem::Useless(if library.contains('/') && !place.exists() {
        format!("its library {library} is not there")
    } else {
        format!("its library {library} is no Vulkan driver that works here")
    })
}

/// Manifests of drivers.
fn drivers() -> Vec<PathBuf> {
    let named = |list: OsString| {
        paths(&list).into_iter().flat_map(|path| if path.is_dir() { in_folder(&path) } else { vec![path] })
    };
    if let Some(list) = INSTEAD.iter().find_map(env::var_os).filter(|list| !list.is_empty()) {
        return named(list).collect();
    }
    let beside = env::var_os(BESIDE).into_iter().flat_map(named);
    beside.chain(folders(&["icd.d"]).iter().flat_map(|folder| in_folder(folder))).collect()
}

/// Folders that the loader looks in for manifests.
fn folders(kinds: &[&str]) -> Vec<PathBuf> {
    if !cfg!(target_os = "linux") {
        return Vec::new();
    }
    let list = |name: &str, default: &str| {
        paths(&env::var_os(name).filter(|list| !list.is_empty()).unwrap_or_else(|| default.into()))
    };
    let home = |name: &str, default: &str| match env::var_os(name).filter(|path| !path.is_empty()) {
        Some(path) => Some(PathBuf::from(path)),
        None => env::var_os("HOME").map(|home| Path::new(&home).join(default)),
    };
    let places = home("XDG_CONFIG_HOME", ".config").into_iter();
    let places = places.chain(list("XDG_CONFIG_DIRS", "/etc/xdg")).chain(["/etc".into()]);
    let places = places.chain(home("XDG_DATA_HOME", ".local/share"));
    let places = places.chain(list("XDG_DATA_DIRS", "/usr/local/share:/usr/share"));
    places.flat_map(|place| kinds.iter().map(move |kind| place.join("vulkan").join(kind))).collect()
}

fn paths(list: &OsStr) -> Vec<PathBuf> {
    env::split_paths(list).filter(|path| !path.as_os_str().is_empty()).collect()
}

/// Manifests in a folder, by name.
fn in_folder(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<_> = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension() == Some(OsStr::new("json")))
        .collect();
    files.sort();
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stops_the_loader_is_told_from_what_it_passes_over() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.json");
        for (text, stops, word) in [
            ("{", true, "is not JSON"),
            ("no JSON", true, "is not JSON"),
            (r#"{ "file_format_version": 1 }"#, true, "file_format_version is 1"),
            (r#"{ "ICD": { "library_path": ["a"] } }"#, true, "library_path"),
            (r#"{ "ICD": { "library_path": "a", "api_version": 1.3 } }"#, true, "api_version is 1.3"),
            ("", false, "is empty"),
            ("{}", false, "no library"),
            (r#"{ "ICD": { "library_path": "./a.so" } }"#, false, "./a.so is not there"),
            (r#"{ "ICD": { "library_path": "liba.so" } } x"#, false, "liba.so is no Vulkan driver"),
            ("\u{feff}{ \"ICD\": { \"library_path\": \"liba.so\" } }", false, "liba.so is no"),
        ] {
            std::fs::write(&file, text).unwrap();
            let found = problem(&file, true);
            assert_eq!(matches!(found, Problem::Fatal(_)), stops, "{text}");
            let found = found.text();
            assert!(found.contains(word), "{text}: {found}");
        }
        assert!(matches!(problem(&folder.path().join("b.json"), true), Problem::Useless(_)));
        assert!(matches!(problem(Path::new("/dev/null"), true), Problem::Fatal(_)));
    }
}
