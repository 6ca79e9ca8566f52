//! Which file uses which: the paths in the source, resolved to the files that define what they name.
//!
//! Re-exports (`use` with a visibility) are passed through and are no uses themselves; neither are imports of a
//! whole module, only the paths that go on from it. Left out are items under `#[cfg(test)]`, documentation, and
//! what has no path: methods, fields, and traits that come into scope by a glob alone.

use proc_macro2::{TokenStream, TokenTree};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, ExprLit, Item, Lit, Meta, UseTree, Visibility};

/// The library's name, by which its binary and its own macros reach it.
pub(crate) const LIBRARY: &str = "parhelion";

/// What begins an item with a name.
const ITEMS: &[&str] = &["const", "enum", "fn", "static", "struct", "trait", "type", "union"];

/// The files of a crate or two.
#[derive(Default)]
pub(crate) struct Files {
    pub(crate) files: Vec<File>,
    /// By user, definer and path.
    pub(crate) uses: BTreeMap<(usize, usize, String), usize>,
    /// Paths into a module that has no such item.
    pub(crate) unknown: Vec<String>,
    /// Names of the modules that tests alone have.
    pub(crate) tests: Vec<String>,
}

/// A module that is a file. Inline modules belong to the file they are in.
pub(crate) struct File {
    /// Its module's name; the crate's name for a crate root.
    pub(crate) name: String,
    pub(crate) path: PathBuf,
    /// The file that declares it.
    pub(crate) parent: Option<usize>,
}

/// Reads the crates with these names and root files, the library first.
pub(crate) fn read(roots: &[(&str, &str)], source: &dyn Fn(&Path) -> Option<String>) -> Files {
    let mut reader =
        Reader { source, files: Vec::new(), scopes: Vec::new(), references: Vec::new(), tests: Vec::new() };
    for (name, path) in roots {
        let (path, root) = (PathBuf::from(path), reader.scopes.len());
        reader.files.push(File { name: (*name).to_owned(), path: path.clone(), parent: None });
        reader.scopes.push(Scope::new(root, root, reader.files.len() - 1));
        let folder = path.parent().unwrap().to_owned();
        reader.file(root, &path, &folder);
    }
    reader.resolve_all()
}

/// A module or a block: what can hold items.
struct Scope {
    names: HashMap<String, Vec<Binding>>,
    globs: Vec<Vec<String>>,
    /// The scope around a block; modules do not see the names around them.
    around: Option<usize>,
    /// The nearest module, itself if it is one.
    module: usize,
    /// The module above that one.
    above: Option<usize>,
    root: usize,
    file: usize,
}

impl Scope {
    fn new(module: usize, root: usize, file: usize) -> Self {
        Self { names: HashMap::new(), globs: Vec::new(), around: None, module, above: None, root, file }
    }
}

enum Binding {
    Item,
    Module(usize),
    Import(Vec<String>),
}

#[derive(Clone, PartialEq, Eq, Hash)]
enum Target {
    Module(usize),
    /// Defined in this file.
    Item(usize),
    /// Of another crate, or a local name.
    Elsewhere,
}

struct Reference {
    scope: usize,
    path: Vec<String>,
    line: usize,
}

struct Reader<'a> {
    source: &'a dyn Fn(&Path) -> Option<String>,
    files: Vec<File>,
    scopes: Vec<Scope>,
    references: Vec<Reference>,
    tests: Vec<String>,
}

impl Reader<'_> {
    /// Reads a file into a scope; the files of its modules are in `folder`.
    fn file(&mut self, scope: usize, path: &Path, folder: &Path) {
        let text = (self.source)(path).unwrap_or_else(|| panic!("{} is not there", path.display()));
        let tree = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        for item in &tree.items {
            Walk { reader: self, scope, folder: folder.to_owned() }.visit_item(item);
        }
    }

    fn bind(&mut self, scope: usize, name: impl ToString, binding: Binding) {
        self.scopes[scope].names.entry(name.to_string()).or_default().push(binding);
    }

    fn resolve_all(self) -> Files {
        let (mut uses, mut unknown) = (BTreeMap::new(), Vec::new());
        for Reference { scope, path, line } in &self.references {
            let file = self.scopes[*scope].file;
            let mut targets = self.resolve(*scope, path, &mut HashSet::new());
            if targets.is_empty() {
                unknown.push(format!("{}:{line} {}", self.files[file].path.display(), path.join("::")));
            }
            targets.retain(|target| *target != Target::Item(file));
            for target in targets {
                if let Target::Item(definer) = target {
                    uses.entry((file, definer, path.join("::"))).or_insert(*line);
                }
            }
        }
        Files { files: self.files, uses, unknown, tests: self.tests }
    }

    /// Everything `path` may name, seen from `scope`; nothing if it leads into a module without such an item.
    fn resolve(&self, scope: usize, path: &[String], seen: &mut HashSet<(usize, String)>) -> Vec<Target> {
        let here = &self.scopes[scope];
        let mut targets = match path[0].as_str() {
            "" => vec![Target::Elsewhere],
            "crate" => vec![Target::Module(here.root)],
            "self" => vec![Target::Module(here.module)],
            "super" => vec![Target::Module(self.scopes[here.module].above.unwrap())],
            name => {
                let mut around = Some(scope);
                let mut found = Vec::new();
                while let Some(scope) = around.filter(|_| found.is_empty()) {
                    found = self.lookup(scope, name, seen);
                    around = self.scopes[scope].around;
                }
                if found.is_empty() {
                    // The library is read first.
                    found.push(if name == LIBRARY { Target::Module(0) } else { Target::Elsewhere });
                }
                found
            }
        };
        for name in &path[1..] {
            let step = |target: &Target| match (target, name.as_str()) {
                (Target::Module(module), "super") => {
                    vec![Target::Module(self.scopes[*module].above.unwrap())]
                }
                (Target::Module(module), "self") => vec![Target::Module(*module)],
                (Target::Module(module), name) => self.lookup(*module, name, seen),
                // A variant or an associated item.
                (target, _) => vec![target.clone()],
            };
            targets = targets.iter().flat_map(step).collect();
        }
        targets
    }

    fn lookup(&self, scope: usize, name: &str, seen: &mut HashSet<(usize, String)>) -> Vec<Target> {
        let Scope { names, globs, file, .. } = &self.scopes[scope];
        if !seen.insert((scope, name.to_owned())) {
            return Vec::new();
        }
        if let Some(bindings) = names.get(name) {
            let target = |binding: &Binding| match binding {
                Binding::Item => vec![Target::Item(*file)],
                Binding::Module(module) => vec![Target::Module(*module)],
                Binding::Import(path) => self.resolve(scope, path, seen),
            };
            return bindings.iter().flat_map(target).collect();
        }
        let mut found = Vec::new();
        for glob in globs {
            for target in self.resolve(scope, glob, &mut seen.clone()) {
                if let Target::Module(module) = target {
                    found.extend(self.lookup(module, name, seen));
                }
            }
        }
        found
    }
}

/// Walks through an item of a scope.
struct Walk<'a, 'b> {
    reader: &'a mut Reader<'b>,
    scope: usize,
    folder: PathBuf,
}

impl Walk<'_, '_> {
    fn refer(&mut self, path: Vec<String>, line: usize) {
        if path.first().is_some_and(|first| first != "Self") {
            self.reader.references.push(Reference { scope: self.scope, path, line });
        }
    }

    fn module(&mut self, item: &syn::ItemMod) {
        let name = item.ident.to_string();
        let scope = self.reader.scopes.len();
        let Scope { file, root, .. } = self.reader.scopes[self.scope];
        let mut inner = Scope::new(scope, root, file);
        inner.above = Some(self.scope);
        let folder = self.folder.join(&name);
        if let Some((_, items)) = &item.content {
            self.reader.scopes.push(inner);
            for item in items {
                Walk { reader: self.reader, scope, folder: folder.clone() }.visit_item(item);
            }
        } else {
            let set = item.attrs.iter().find_map(|attribute| match &attribute.meta {
                Meta::NameValue(pair) if pair.path.is_ident("path") => match &pair.value {
                    Expr::Lit(ExprLit { lit: Lit::Str(path), .. }) => Some(path.value()),
                    _ => None,
                },
                _ => None,
            });
            let beside = self.reader.files[file].path.parent().unwrap();
            let (alone, nested) =
                (self.folder.join(format!("{name}.rs")), self.folder.join(&name).join("mod.rs"));
            let path = match set {
                Some(set) => beside.join(set),
                None if (self.reader.source)(&alone).is_some() => alone,
                None => nested,
            };
            inner.file = self.reader.files.len();
            self.reader.files.push(File { name: name.clone(), path: path.clone(), parent: Some(file) });
            self.reader.scopes.push(inner);
            self.reader.file(scope, &path, &folder);
        }
        self.reader.bind(self.scope, name, Binding::Module(scope));
    }

    fn import(&mut self, tree: &UseTree, prefix: &[String], exported: bool) {
        let with = |name: &syn::Ident| {
            let end = (name != "self").then(|| name.to_string());
            prefix.iter().cloned().chain(end).collect::<Vec<_>>()
        };
        let (path, name) = match tree {
            UseTree::Path(path) => {
                let prefix: Vec<_> = prefix.iter().cloned().chain([path.ident.to_string()]).collect();
                return self.import(&path.tree, &prefix, exported);
            }
            UseTree::Group(group) => {
                return group.items.iter().for_each(|tree| self.import(tree, prefix, exported));
            }
            UseTree::Glob(_) => return self.reader.scopes[self.scope].globs.push(prefix.to_vec()),
            UseTree::Name(name) => (with(&name.ident), with(&name.ident).last().cloned().unwrap()),
            UseTree::Rename(rename) => (with(&rename.ident), rename.rename.to_string()),
        };
        if !exported {
            self.refer(path.clone(), tree.span().start().line);
        }
        self.reader.bind(self.scope, name, Binding::Import(path));
    }

    /// Refers to whatever looks like a path in a macro's tokens.
    fn tokens(&mut self, tokens: TokenStream) {
        let tokens: Vec<_> = tokens.into_iter().collect();
        let is = |at: usize, sign| matches!(tokens.get(at), Some(TokenTree::Punct(p)) if p.as_char() == sign);
        let mut at = 0;
        while at < tokens.len() {
            match &tokens[at] {
                TokenTree::Group(group) => self.tokens(group.stream()),
                TokenTree::Ident(first) => {
                    // What the macro may define.
                    if let Some(TokenTree::Ident(name)) = tokens.get(at + 1)
                        && ITEMS.iter().any(|keyword| first == keyword)
                    {
                        self.reader.bind(self.scope, name, Binding::Item);
                    }
                    let start = at;
                    let mut path = vec![first.to_string()];
                    while let (true, true, Some(TokenTree::Ident(next))) =
                        (is(at + 1, ':'), is(at + 2, ':'), tokens.get(at + 3))
                    {
                        path.push(next.to_string());
                        at += 3;
                    }
                    // Not a method, nor the end of another path.
                    let ends_another = start > 1 && is(start - 1, ':') && is(start - 2, ':');
                    if !(ends_another || start > 0 && is(start - 1, '.')) {
                        self.refer(path, first.span().start().line);
                    }
                }
                _ => {}
            }
            at += 1;
        }
    }
}

impl<'ast> Visit<'ast> for Walk<'_, '_> {
    fn visit_item(&mut self, item: &'ast Item) {
        let (attributes, name) = match item {
            Item::Const(item) => (&item.attrs, Some(&item.ident)),
            Item::Enum(item) => (&item.attrs, Some(&item.ident)),
            Item::Fn(item) => (&item.attrs, Some(&item.sig.ident)),
            Item::Macro(item) => (&item.attrs, item.ident.as_ref()),
            Item::Static(item) => (&item.attrs, Some(&item.ident)),
            Item::Struct(item) => (&item.attrs, Some(&item.ident)),
            Item::Trait(item) => (&item.attrs, Some(&item.ident)),
            Item::Type(item) => (&item.attrs, Some(&item.ident)),
            Item::Union(item) => (&item.attrs, Some(&item.ident)),
            Item::Impl(item) => (&item.attrs, None),
            Item::Mod(item) => (&item.attrs, None),
            Item::Use(item) => (&item.attrs, None),
            _ => return,
        };
        if attributes.iter().any(is_test) {
            if let Item::Mod(item) = item {
                self.reader.tests.push(item.ident.to_string());
            }
            return;
        }
        if let Some(name) = name {
            self.reader.bind(self.scope, name, Binding::Item);
        }
        match item {
            Item::Mod(item) => self.module(item),
            Item::Use(item) => {
                let prefix: &[String] = if item.leading_colon.is_some() { &[String::new()] } else { &[] };
                self.import(&item.tree, prefix, !matches!(item.vis, Visibility::Inherited));
            }
            // The build script's output is all that is included.
            Item::Macro(item) if item.mac.path.is_ident("include") => {
                let name = item.mac.tokens.to_string();
                let name = name.rsplit('/').next().unwrap().split('"').next().unwrap();
                let path = Path::new(env!("OUT_DIR")).join(name);
                let folder = self.folder.clone();
                self.reader.file(self.scope, &path, &folder);
            }
            item => visit::visit_item(self, item),
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if !item.attrs.iter().any(is_test) {
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_block(&mut self, block: &'ast syn::Block) {
        let around = self.scope;
        let Scope { module, root, file, .. } = self.reader.scopes[around];
        self.scope = self.reader.scopes.len();
        self.reader.scopes.push(Scope { around: Some(around), ..Scope::new(module, root, file) });
        visit::visit_block(self, block);
        self.scope = around;
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let leading = path.leading_colon.map(|_| String::new());
        let segments = path.segments.iter().map(|segment| segment.ident.to_string());
        self.refer(leading.into_iter().chain(segments).collect(), path.span().start().line);
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        self.visit_path(&item.path);
        self.tokens(item.tokens.clone());
    }

    fn visit_attribute(&mut self, attribute: &'ast Attribute) {
        if let Meta::List(list) = &attribute.meta {
            self.tokens(list.tokens.clone());
        }
    }

    // `pub(in path)` is no use.
    fn visit_vis_restricted(&mut self, _: &'ast syn::VisRestricted) {}
}

/// Whether the attribute is `#[cfg(test)]`, alone or with more.
fn is_test(attribute: &Attribute) -> bool {
    let Meta::List(list) = &attribute.meta else { return false };
    let words = list.tokens.to_string();
    list.path.is_ident("cfg") && (words == "test" || words.starts_with("all") && words.contains("test"))
}
