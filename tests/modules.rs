//! Modules depend on each other in one direction: no circle between the modules of a folder.
//!
//! In each folder, and at the crate's root, a module counts with all that is below it. The file that declares the
//! modules (`mod.rs`, `lib.rs`) is one of them for what it defines itself: it may use its modules, or they may use
//! it, but not both. At the root there is an order, too. With the variable `MODULE_GRAPH=FILE` the graphs go to that
//! file in Graphviz's language.

#[path = "modules/resolve.rs"]
mod resolve;

use resolve::{Files, LIBRARY};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// From the bottom up: none of these uses one behind it.
const ORDER: &[&str] = &["vk", "graph", "techniques", "methods", "renderer"];

/// What uses none of those.
const APART: &[&str] = &["scene", "sampling", "metrics", "output", "files", "text"];

/// The graph between the modules of one folder.
struct Folder {
    name: String,
    /// Its modules; the first is the file that declares the others.
    modules: Vec<String>,
    /// The modules that each uses, and why.
    uses: BTreeMap<(usize, usize), Vec<String>>,
}

impl Folder {
    fn all(files: &Files) -> Vec<Self> {
        (0..files.files.len())
            .map(|parent| Self::of(files, parent))
            .filter(|folder| folder.modules.len() > 1)
            .collect()
    }

    fn of(files: &Files, parent: usize) -> Self {
        let children = (0..files.files.len()).filter(|&file| files.files[file].parent == Some(parent));
        let nodes: Vec<_> = std::iter::once(parent).chain(children).collect();
        let node_of = |mut file: usize| loop {
            if let Some(node) = nodes.iter().position(|&node| node == file) {
                return Some(node);
            }
            file = files.files[file].parent?;
        };
        let mut uses = BTreeMap::<_, Vec<_>>::new();
        for ((from, to, path), line) in &files.uses {
            if let (Some(user), Some(used)) = (node_of(*from), node_of(*to))
                && user != used
                && (files.is_below(*from, parent) && files.is_below(*to, parent))
            {
                let [from, to] = [from, to].map(|&file| files.files[file].path.display());
                uses.entry((user, used)).or_default().push(format!("{from}:{line} uses {path} of {to}"));
            }
        }
        let mut modules: Vec<_> = nodes.iter().map(|&node| files.files[node].name.clone()).collect();
        modules[0] = files.files[parent].path.file_name().unwrap().to_string_lossy().into_owned();
        Self { name: files.module(parent), modules, uses }
    }

    /// Which modules use which, themselves or through others.
    fn reaches(&self) -> Vec<Vec<bool>> {
        let count = self.modules.len();
        let mut reaches = vec![vec![false; count]; count];
        self.uses.keys().for_each(|&(from, to)| reaches[from][to] = true);
        for via in 0..count {
            for from in 0..count {
                for to in 0..count {
                    reaches[from][to] |= reaches[from][via] && reaches[via][to];
                }
            }
        }
        reaches
    }

    /// Modules that reach each other, one list a circle or a knot of circles.
    fn circles(&self) -> Vec<Vec<usize>> {
        let (count, reaches) = (self.modules.len(), self.reaches());
        let circle = |start: usize| -> Vec<usize> {
            (0..count).filter(|&other| reaches[start][other] && reaches[other][start]).collect()
        };
        (0..count)
            .map(|start| (start, circle(start)))
            .filter(|(start, c)| c.first() == Some(start))
            .map(|c| c.1)
            .collect()
    }

    fn title(&self, circle: &[usize]) -> String {
        let mut names: Vec<_> = circle.iter().map(|&module| self.modules[module].as_str()).collect();
        names.sort_unstable();
        format!("{}: {}", self.name, names.join(", "))
    }

    /// The circle's edges, each with its uses.
    fn explain(&self, circle: &[usize]) -> String {
        let mut text = self.title(circle);
        for ((from, to), uses) in &self.uses {
            if circle.contains(from) && circle.contains(to) {
                text += &format!("\n  {} -> {}", self.modules[*from], self.modules[*to]);
                text.extend(uses.iter().map(|line| format!("\n    {line}")));
            }
        }
        text
    }

    fn dot(&self) -> String {
        let circles = self.circles();
        let edge = |&(from, to): &(usize, usize)| {
            let circular = circles.iter().any(|circle| circle.contains(&from) && circle.contains(&to));
            let color = if circular { " [color=red]" } else { "" };
            format!("  {:?} -> {:?}{color};\n", self.modules[from], self.modules[to])
        };
        let nodes = self.modules.iter().map(|module| format!("  {module:?};\n"));
        let lines: String = nodes.chain(self.uses.keys().map(edge)).collect();
        format!("digraph {:?} {{\n{lines}}}\n", self.name)
    }
}

impl Files {
    fn is_below(&self, file: usize, ancestor: usize) -> bool {
        file == ancestor || self.files[file].parent.is_some_and(|parent| self.is_below(parent, ancestor))
    }

    /// The module's path.
    fn module(&self, file: usize) -> String {
        let name = &self.files[file].name;
        self.files[file]
            .parent
            .map_or_else(|| name.clone(), |parent| format!("{}::{name}", self.module(parent)))
    }
}

fn crates() -> Files {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let source = |path: &Path| std::fs::read_to_string(folder.join(path)).ok();
    resolve::read(&[(LIBRARY, "src/lib.rs"), ("command", "src/main.rs")], &source)
}

#[test]
fn no_module_is_in_a_circle() {
    let folders = Folder::all(&crates());
    let circles: BTreeMap<_, _> = folders
        .iter()
        .flat_map(|folder| folder.circles().into_iter().map(move |c| (folder.title(&c), folder.explain(&c))))
        .collect();
    if let Some(file) = std::env::var_os("MODULE_GRAPH") {
        std::fs::write(file, folders.iter().map(Folder::dot).collect::<String>()).unwrap();
    }
    for circle in circles.values() {
        eprintln!("{circle}\n");
    }
    assert!(circles.is_empty(), "{:#?}", circles.keys());
}

#[test]
fn the_order_is_kept() {
    let folders = Folder::all(&crates());
    let root = folders.iter().find(|folder| folder.name == LIBRARY).unwrap();
    let reaches = root.reaches();
    let index = |name: &str| {
        root.modules.iter().position(|module| module == name).unwrap_or_else(|| panic!("no module {name}"))
    };
    let check = |user: &str, above: &[&str]| {
        for used in above {
            assert!(!reaches[index(user)][index(used)], "{user} uses {used}, itself or through others");
        }
    };
    ORDER.iter().enumerate().for_each(|(at, user)| check(user, &ORDER[at + 1..]));
    APART.iter().for_each(|user| check(user, ORDER));
}

#[test]
fn every_path_into_the_crate_is_resolved() {
    let files = crates();
    assert_eq!(files.unknown, Vec::<String>::new());
    let found: Vec<_> = files.files.iter().map(|file| file.path.clone()).collect();
    let mut folders = vec![PathBuf::from("src")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(&folder)).unwrap() {
            let path = folder.join(entry.unwrap().file_name());
            if path.extension().is_none() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs")
                && !files.tests.iter().any(|name| path.ends_with(format!("{name}.rs")))
            {
                assert!(found.contains(&path), "{} is no module", path.display());
            }
        }
    }
}

/// The circles of made-up files, and who uses whom.
fn made_up(sources: &[(&str, &str)]) -> (Vec<String>, Vec<String>) {
    let source = |path: &Path| {
        let found = sources.iter().find(|(name, _)| Path::new(name) == path);
        found.map(|(_, text)| (*text).to_owned())
    };
    let files = resolve::read(&[(LIBRARY, "lib.rs")], &source);
    assert_eq!(files.unknown, Vec::<String>::new());
    let circles = Folder::all(&files)
        .iter()
        .flat_map(|folder| folder.circles().iter().map(|circle| folder.title(circle)).collect::<Vec<_>>())
        .collect();
    let name = |file: usize| files.files[file].path.display().to_string();
    let uses = files.uses.keys().map(|(from, to, path)| format!("{} {path} {}", name(*from), name(*to)));
    (circles, uses.collect())
}

#[test]
fn reexports_lead_to_the_file_that_defines() {
    let (circles, uses) = made_up(&[
        ("lib.rs", "pub mod a; pub mod b; pub use a::Thing; pub(crate) use a::inner as renamed;"),
        ("a/mod.rs", "pub(crate) mod inner; pub use inner::Thing; pub fn f() { crate::b::g() }"),
        ("a/inner.rs", "pub struct Thing; impl Thing { pub const N: u8 = 0; }"),
        ("b.rs", "use parhelion::{Thing as T}; pub fn g() { T::N; crate::renamed::Thing::N; }"),
    ]);
    assert_eq!(
        uses,
        [
            "a/mod.rs crate::b::g b.rs",
            "b.rs T::N a/inner.rs",
            "b.rs crate::renamed::Thing::N a/inner.rs",
            "b.rs parhelion::Thing a/inner.rs",
        ]
    );
    assert_eq!(circles, ["parhelion: a, b"]);
}

#[test]
fn super_leads_up_from_files_blocks_and_inline_modules() {
    let (circles, uses) = made_up(&[
        ("lib.rs", "mod a; mod b;"),
        ("a/mod.rs", "mod c; mod d; pub fn f() {}"),
        (
            "a/c.rs",
            "mod inline { fn g() { let _ = { super::super::super::b::h() }; } } pub fn i() { super::d::j() }",
        ),
        ("a/d.rs", "pub fn j() { { use super::c; c::i() } }"),
        ("b.rs", "pub fn h() { use super::a; a::f() }"),
    ]);
    assert_eq!(
        uses,
        [
            "a/c.rs super::d::j a/d.rs",
            "a/c.rs super::super::super::b::h b.rs",
            "a/d.rs c::i a/c.rs",
            "b.rs a::f a/mod.rs",
        ]
    );
    assert_eq!(circles, ["parhelion: a, b", "parhelion::a: c, d"]);
}

#[test]
fn globs_bring_names_from_where_they_are_defined() {
    let (circles, uses) = made_up(&[
        ("lib.rs", "mod a; mod b; mod prelude { pub use crate::a::*; pub use crate::b::*; }"),
        ("a.rs", "use crate::prelude::*; pub struct A(B); pub const NONE: Option<u8> = None;"),
        ("b.rs", "use crate::prelude::*; pub struct B; fn f(_: A) {}"),
    ]);
    assert_eq!(uses, ["a.rs B b.rs", "b.rs A a.rs"]);
    assert_eq!(circles, ["parhelion: a, b"]);
}

#[test]
fn the_declaring_file_counts_for_what_it_defines() {
    let files = |parent| [("lib.rs", parent), ("a.rs", "pub struct A(crate::Size);")];
    let (circles, _) = made_up(&files("mod a; pub struct Size; pub use a::A;"));
    assert!(circles.is_empty(), "a re-export is no use: {circles:?}");
    let (circles, _) = made_up(&files("mod a; pub struct Size; pub use a::A; fn f(_: A) {}"));
    assert_eq!(circles, ["parhelion: a, lib.rs"]);
}

#[test]
fn macros_and_attributes_hold_paths_and_tests_and_docs_do_not() {
    let (_, uses) = made_up(&[
        ("lib.rs", "#[path = \"elsewhere/a.rs\"] mod a; mod b; mod c { pub mod image { pub fn f() {} } }"),
        (
            "elsewhere/a.rs",
            "//! [`crate::b::Doc`]
            use ::image::f as other;
            use image::g;
            macro_rules! m { ($x:ident) => { $crate::b::M::$x(other(), g()) }; }
            #[derive(D)] struct S { #[error(\"{}\", crate::b::E(0))] x: u8 }
            fn f(x: u8) { println!(\"{}\", [x.b::<u8>(), crate::b::P(1)]); b::no() }
            #[cfg(test)] mod tests { use crate::b::Never; }
            impl S { #[cfg(test)] fn t() { crate::b::Never; } }
            fn h(_: crate::b::Made) {}",
        ),
        (
            "b.rs",
            "pub struct Doc; pub struct M; pub fn E() {} pub fn P() {} pub struct Never;
            macro_rules! made { () => { pub struct Made; } } made!();",
        ),
    ]);
    assert_eq!(
        uses,
        [
            "elsewhere/a.rs crate::b::E b.rs",
            "elsewhere/a.rs crate::b::M b.rs",
            "elsewhere/a.rs crate::b::Made b.rs",
            "elsewhere/a.rs crate::b::P b.rs",
        ]
    );
}
