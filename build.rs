//! Compiles every kernel under `glsl/` to SPIR-V, reads its interface and writes it as typed Rust to
//! `$OUT_DIR/shaders.rs`: one module a kernel with `Bind`, `Params`, `Spec` and `kernel()`.

extern crate shaderc_link as _;

#[path = "src/vk/kernel.rs"]
#[allow(dead_code, missing_docs, unreachable_pub)]
mod kernel;
#[path = "src/reflect.rs"]
#[allow(unreachable_pub)]
mod reflect;
mod vk {
    pub(crate) use super::kernel::*;
}

use kernel::{Access, BindingKind};
use reflect::{Reflection, SpecConstant, Structure};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Specialization constants from this id on describe the scene and are shared by all kernels.
const FIRST_SCENE_CONSTANT: u32 = 100;
const TRACE_INTERFACE: &str = "trace/trace.glsl";
/// Includes whose constants Rust has, too.
const SHARED: [&str; 7] = [
    "shared/types.glsl",
    "lib/counters.glsl",
    "path_trace/modes.glsl",
    "tone_map/operators.glsl",
    "trace/boxes.glsl",
    "trace/software.glsl",
    "vpl_shoot/blocks.glsl",
];
/// What a kernel is compiled for.
const SOFTWARE: &str = "TRACE_SOFTWARE";
const RAY_QUERY: &str = "TRACE_RAY_QUERY";
/// A kernel that includes this counts its rays.
const COUNTER_INTERFACE: &str = "lib/counters.glsl";

struct Kernel {
    reflection: Reflection,
    plain: Vec<u32>,
    /// Set where the kernel traces rays; `plain` is then the software variant.
    ray_query: Option<Vec<u32>>,
}

fn main() {
    for path in ["glsl", "src/reflect.rs", "src/vk/kernel.rs", "build.rs"] {
        println!("cargo::rerun-if-changed={path}");
    }
    let root = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap()).join("glsl");
    let mut sources = Vec::new();
    walk(&root, &mut sources);
    sources.sort();

    let mut counters = Vec::new();
    let mut read = Vec::new();
    for path in sources.iter().filter(|path| path.extension().is_some_and(|e| e == "comp")) {
        let name = relative(&root, path).trim_end_matches(".comp").to_owned();
        read.push(read_kernel(&root, path, name, &mut counters));
    }
    let built: Result<BTreeMap<String, Kernel>, String> =
        read.into_iter().collect::<Result<Vec<_>, _>>().and_then(|read| optimized(&root, read));
    let kernels = built.unwrap_or_else(|errors| {
        errors.lines().for_each(|line| println!("cargo::error={line}"));
        std::process::exit(1);
    });
    let code = match generate(&root, &sources, &kernels, &counters) {
        Ok(code) => code,
        Err(error) => {
            println!("cargo::error={error}");
            std::process::exit(1);
        }
    };
    let out = PathBuf::from(std::env::var_os("OUT_DIR").unwrap());
    fs::write(out.join("shaders.rs"), code).expect("OUT_DIR can be written");
}

fn walk(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("glsl/ can be read") {
        let path = entry.expect("glsl/ can be read").path();
        if path.is_dir() {
            walk(&path, files);
        } else {
            files.push(path);
        }
    }
}

fn relative(root: &Path, path: &Path) -> String {
    path.strip_prefix(root).unwrap().to_str().expect("file names are UTF-8").replace('\\', "/")
}

/// What an unoptimised build includes.
#[derive(Clone, Default)]
struct Includes {
    traces: bool,
    counts: bool,
    /// Of every text that went in.
    hasher: DefaultHasher,
}

/// A kernel without code.
struct ReadKernel {
    name: String,
    path: PathBuf,
    reflection: Reflection,
    traces: bool,
    /// The cell it counts its rays in.
    counter: String,
    sources: DefaultHasher,
}

/// `counters` are the kernels before it that count their rays.
fn read_kernel(
    root: &Path,
    path: &Path,
    name: String,
    counters: &mut Vec<String>,
) -> Result<ReadKernel, String> {
    // A test has the cells to itself.
    let test = name.starts_with("test/");
    let counter = format!("{}u", if test { 0 } else { counters.len() });
    let defines = [(SOFTWARE, "1"), ("RAY_COUNTER", &counter)];
    let (names, includes) = compile(root, path, &defines, shaderc::OptimizationLevel::Zero)?;
    let reflection = reflect::reflect(&names).map_err(|error| format!("{}: {error}", path.display()))?;
    if includes.counts && !test {
        counters.push(name.clone());
    }
    Ok(ReadKernel {
        name,
        path: path.to_owned(),
        reflection,
        traces: includes.traces,
        counter,
        sources: includes.hasher,
    })
}

/// Compiles all variants of all kernels, which takes minutes, on all cores.
fn optimized(root: &Path, read: Vec<ReadKernel>) -> Result<BTreeMap<String, Kernel>, String> {
    let variants =
        |kernel: &ReadKernel| if kernel.traces { vec![SOFTWARE, RAY_QUERY] } else { vec![SOFTWARE] };
    let jobs: Vec<_> = read
        .iter()
        .flat_map(|kernel| variants(kernel).into_iter().map(move |backend| (kernel, backend)))
        .collect();
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some(&(kernel, backend)) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
            let defines = [(backend, "1"), ("RAY_COUNTER", &*kernel.counter)];
            let compiled = || {
                let level = shaderc::OptimizationLevel::Performance;
                compile(root, &kernel.path, &defines, level).map(|(words, _)| words)
            };
            let mut key = kernel.sources.clone();
            (&kernel.name, defines).hash(&mut key);
            done.push(((kernel.name.clone(), backend), kept(key.finish(), compiled)));
        }
        done
    };
    let threads = thread::available_parallelism().map_or(1, NonZero::get);
    let mut done: BTreeMap<_, _> = thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("a compiler ends")).collect()
    });
    let kernels = read.into_iter().map(|kernel| {
        let mut code = |backend| done.remove(&(kernel.name.clone(), backend)).transpose();
        let (plain, ray_query) = (code(SOFTWARE)?.unwrap_or_default(), code(RAY_QUERY)?);
        Ok((kernel.name, Kernel { reflection: kernel.reflection, plain, ray_query }))
    });
    kernels.collect()
}

/// What `make` makes, unless an earlier build kept it in the folder that `PARHELION_KERNELS` names: builds of other features
/// and profiles make the same.
fn kept(key: u64, make: impl FnOnce() -> Result<Vec<u32>, String>) -> Result<Vec<u32>, String> {
    let Some(folder) = std::env::var_os("PARHELION_KERNELS").map(PathBuf::from) else { return make() };
    let file = folder.join(format!("{key:016x}.spv"));
    if let Ok(bytes) = fs::read(&file) {
        let words =
            bytes.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().expect("four bytes")));
        return Ok(words.collect());
    }
    let words = make()?;
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let unfinished = file.with_extension(std::process::id().to_string());
    let written = fs::create_dir_all(&folder).and_then(|()| fs::write(&unfinished, bytes));
    written
        .and_then(|()| fs::rename(&unfinished, &file))
        .map_err(|error| format!("PARHELION_KERNELS: {error}"))?;
    Ok(words)
}

fn compile(
    root: &Path,
    path: &Path,
    defines: &[(&str, &str)],
    level: shaderc::OptimizationLevel,
) -> Result<(Vec<u32>, Includes), String> {
    let includes = RefCell::new(Includes::default());
    let source = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    source.hash(&mut includes.borrow_mut().hasher);
    let mut options = shaderc::CompileOptions::new().expect("shaderc starts");
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    options.set_optimization_level(level);
    options.set_warnings_as_errors();
    for (name, value) in defines {
        options.add_macro_definition(name, Some(value));
    }
    options.set_include_callback(|name, _, _, _| {
        let path = root.join(name);
        let content = fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let mut includes = includes.borrow_mut();
        includes.traces |= name == TRACE_INTERFACE;
        includes.counts |= name == COUNTER_INTERFACE;
        (name, &content).hash(&mut includes.hasher);
        Ok(shaderc::ResolvedInclude { resolved_name: path.display().to_string(), content })
    });
    let name = path.display().to_string();
    let artifact = shaderc::Compiler::new()
        .expect("shaderc starts")
        .compile_into_spirv(&source, shaderc::ShaderKind::Compute, &name, "main", Some(&options))
        .map_err(|error| error.to_string())?;
    Ok((artifact.as_binary().to_vec(), includes.borrow().clone()))
}

fn generate(
    root: &Path,
    sources: &[PathBuf],
    kernels: &BTreeMap<String, Kernel>,
    counters: &[String],
) -> Result<String, String> {
    let mut code = String::new();
    let mut structures: BTreeMap<&str, (&str, &Structure)> = BTreeMap::new();
    let mut scene: BTreeMap<u32, (&str, &SpecConstant)> = BTreeMap::new();
    for (kernel, Kernel { reflection, .. }) in kernels {
        for (name, structure) in &reflection.structures {
            let (other, known) = *structures.entry(name).or_insert((kernel, structure));
            if known != structure {
                return Err(format!("struct {name} differs between kernels {other} and {kernel}"));
            }
        }
        for constant in reflection.spec.iter().filter(|constant| constant.id >= FIRST_SCENE_CONSTANT) {
            let (other, known) = *scene.entry(constant.id).or_insert((kernel, constant));
            if known != constant {
                return Err(format!("constant {} differs between kernels {other} and {kernel}", constant.id));
            }
        }
    }

    for (name, (_, structure)) in &structures {
        let padded =
            if structure.members.iter().any(|member| member.ty.starts_with("uint64")) { 8 } else { 4 };
        write_structure(&mut code, name, &format!("Twin of GLSL's `{name}`."), structure, padded)?;
    }
    for (name, value) in shared_constants(root)? {
        writeln!(code, "/// `{name}` in GLSL.\npub const {name}: u32 = {value};").unwrap();
    }
    code.push_str("/// Passes that count their rays, by kernel, in the order of the cells they count in.\n");
    writeln!(code, "pub const RAY_COUNTERS: [&str; {}] = {counters:?};", counters.len()).unwrap();
    let constants: Vec<_> = scene.values().map(|(_, constant)| *constant).collect();
    let doc = "What the scene needs of every kernel: specialization constants shared by all.";
    write_spec(&mut code, "SceneSpec", doc, &constants);
    code.push_str("impl SceneSpec {\n/// The value of the constant with this id, as bits.\n#[cfg(feature = \"compile\")]\n#[allow(clippy::unnecessary_cast)]\npub(crate) fn value(&self, id: u32) -> Option<u32> { match id {\n");
    for constant in &constants {
        let bits = if constant.ty == "float" { ".to_bits()" } else { " as u32" };
        writeln!(code, "{} => Some(self.{}{bits}),", constant.id, constant.name.to_lowercase()).unwrap();
    }
    code.push_str("_ => None } } }\n");

    let mut folders: BTreeMap<&str, Vec<(&str, &str, &Kernel)>> = BTreeMap::new();
    for (path, kernel) in kernels {
        let (folder, name) = path.rsplit_once('/').ok_or(format!("{path}.comp is not in a folder"))?;
        folders.entry(folder).or_default().push((name, path, kernel));
    }
    for (folder, kernels) in folders {
        writeln!(code, "/// Kernels of `glsl/{folder}`.\npub mod {folder} {{").unwrap();
        for (name, path, kernel) in kernels {
            write_kernel(&mut code, name, path, kernel)?;
        }
        code.push_str("}\n");
    }

    code.push_str("/// Every kernel, for tests and tools.\npub static ALL: &[&KernelCode] = &[");
    for path in kernels.keys() {
        write!(code, "&{}::CODE, ", path.replace('/', "::")).unwrap();
    }
    code.push_str("];\n");
    code.push_str("/// The GLSL that kernels compiled at run time can include: (name, text).\n");
    code.push_str("#[cfg(feature = \"compile\")]\npub(crate) static INCLUDES: &[(&str, &str)] = &[");
    for path in sources.iter().filter(|path| path.extension().is_some_and(|e| e == "glsl")) {
        let (name, path) = (relative(root, path), path.display().to_string());
        write!(code, "({name:?}, include_str!({path:?})), ").unwrap();
    }
    code.push_str("];\n");
    Ok(code)
}

/// Each `const uint NAME = VALUE;` of the includes that Rust shares the meaning of.
fn shared_constants(root: &Path) -> Result<Vec<(String, u32)>, String> {
    let constant = |line: &str| {
        let (name, rest) = line.split_once(" = ")?;
        let digits = rest.split_once("u;")?.0;
        let value = match digits.strip_prefix("0x") {
            Some(hex) => u32::from_str_radix(hex, 16),
            None => digits.parse(),
        };
        Some((name.to_owned(), value.ok()?))
    };
    let mut constants = Vec::new();
    for include in SHARED {
        let text = fs::read_to_string(root.join(include)).map_err(|error| error.to_string())?;
        for line in text.lines().filter_map(|line| line.strip_prefix("const uint ")) {
            constants.push(constant(line).ok_or(format!("{include}: `{line}` is not a number"))?);
        }
    }
    Ok(constants)
}

fn rust_type(glsl: &str) -> Result<String, String> {
    let scalar = |prefix: &str| match prefix {
        "u" => "u32",
        "i" => "i32",
        _ => "f32",
    };
    Ok(match glsl {
        "float" => "f32".into(),
        "uint" => "u32".into(),
        "int" => "i32".into(),
        "bool" => "bool".into(),
        "uint64_t" => "u64".into(),
        _ => {
            if let Some((prefix, n)) = glsl.split_once("vec").filter(|(_, n)| n.parse::<u32>().is_ok()) {
                format!("[{}; {n}]", scalar(prefix))
            } else if let Some((columns, rows)) = glsl.strip_prefix("mat").and_then(|n| n.split_once('x')) {
                format!("[[f32; {rows}]; {columns}]")
            } else {
                format!("crate::shaders::{glsl}")
            }
        }
    })
}

fn write_structure(
    code: &mut String,
    name: &str,
    doc: &str,
    s: &Structure,
    align: u32,
) -> Result<(), String> {
    writeln!(code, "/// {doc}\n#[repr(C)]\n#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]\npub struct {name} {{").unwrap();
    for member in &s.members {
        let ty = rust_type(&member.ty)?;
        writeln!(code, "/// `{}` in GLSL.\npub {}: {ty},", member.ty, member.name).unwrap();
    }
    code.push_str("}\nconst _: () = {\n");
    for member in &s.members {
        writeln!(code, "assert!(std::mem::offset_of!({name}, {}) == {});", member.name, member.offset)
            .unwrap();
    }
    let size = s.size.next_multiple_of(align);
    writeln!(code, "assert!(std::mem::size_of::<{name}>() == {size});\n}};").unwrap();
    Ok(())
}

fn write_spec(code: &mut String, name: &str, doc: &str, constants: &[&SpecConstant]) {
    writeln!(code, "/// {doc}\n#[derive(Clone, Copy, Debug, PartialEq)]\npub struct {name} {{").unwrap();
    for constant in constants {
        let ty = rust_type(&constant.ty).unwrap();
        writeln!(code, "/// `{}`.\npub {}: {ty},", constant.name, constant.name.to_lowercase()).unwrap();
    }
    writeln!(code, "}}\nimpl Default for {name} {{ fn default() -> Self {{ Self {{").unwrap();
    for constant in constants {
        let bits = constant.default;
        let value = match constant.ty.as_str() {
            "bool" => (bits != 0).to_string(),
            "float" => format!("f32::from_bits({bits})"),
            "int" => (bits as i32).to_string(),
            _ => bits.to_string(),
        };
        writeln!(code, "{}: {value},", constant.name.to_lowercase()).unwrap();
    }
    code.push_str("} } }\n");
}

fn write_kernel(code: &mut String, name: &str, path: &str, kernel: &Kernel) -> Result<(), String> {
    let Reflection { workgroup, bindings, params, spec, uses_scene, .. } = &kernel.reflection;
    writeln!(code, "/// `glsl/{path}.comp`.\npub mod {name} {{\n#[allow(unused_imports)] use crate::{{graph::{{AnyRes, Bindings, Buffer, Image, Kernel, Res}}, vk::*}};\nuse std::borrow::Cow;").unwrap();

    writeln!(code, "/// Resources of `{path}`.\n#[derive(Clone, Copy, Debug)]\npub struct Bind {{").unwrap();
    for binding in bindings {
        let (ty, what) = match binding.kind {
            BindingKind::Buffer { stride } => ("Buffer", format!("buffer, {stride} B an element")),
            BindingKind::Image(format) => ("Image", format!("image, {format:?}")),
        };
        let access = match binding.access {
            Access::Read => "Read",
            Access::Write => "Written",
            Access::ReadWrite => "Read and written",
        };
        writeln!(code, "/// {access}; {what}.\npub {}: Res<{ty}>,", binding.name).unwrap();
    }
    code.push_str("}\nimpl Bindings for Bind { fn resources(&self, out: &mut Vec<AnyRes>) { let _ = &out;\n");
    for binding in bindings {
        writeln!(code, "out.push(self.{}.into());", binding.name).unwrap();
    }
    code.push_str("} }\n");

    let align = if params.members.iter().any(|member| member.ty.starts_with("uint64")) { 8 } else { 4 };
    write_structure(code, "Params", &format!("Push constants of `{path}`."), params, align)?;
    let own: Vec<_> = spec.iter().filter(|constant| constant.id < FIRST_SCENE_CONSTANT).collect();
    let scene_wide = spec.len() > own.len();
    let mut arguments = Vec::new();
    if !own.is_empty() {
        write_spec(code, "Spec", &format!("Specialization constants of `{path}`."), &own);
        arguments.push("spec: Spec");
    }
    if scene_wide {
        arguments.push("scene: &crate::shaders::SceneSpec");
    }
    // What decides nothing makes no pipeline of its own.
    let modules = [Some(&kernel.plain), kernel.ray_query.as_ref()];
    let alive: Vec<_> = modules.into_iter().flatten().map(|words| reflect::spec_defaults(words)).collect();
    let used: Vec<_> =
        spec.iter().filter(|constant| alive.iter().any(|ids| ids.contains_key(&constant.id))).collect();
    let values: Vec<_> = used
        .iter()
        .map(|constant| {
            let field = constant.name.to_lowercase();
            let from = if constant.id < FIRST_SCENE_CONSTANT { "spec" } else { "scene" };
            match constant.ty.as_str() {
                "float" => format!("{from}.{field}.to_bits()"),
                _ => format!("{from}.{field} as u32"),
            }
        })
        .collect();
    writeln!(code, "/// The kernel, specialised.\n#[must_use]\n#[allow(clippy::unnecessary_cast, trivial_numeric_casts, unused_variables)]\npub fn kernel({}) -> Kernel<Bind, Params> {{ Kernel::new(&CODE, vec![{}]) }}", arguments.join(", "), values.join(", ")).unwrap();

    writeln!(code, "/// Interface and SPIR-V.\npub static CODE: KernelCode = KernelCode {{ name: Cow::Borrowed({path:?}), workgroup: {workgroup:?}, params_size: {}, uses_scene: {uses_scene},", params.size).unwrap();
    code.push_str("bindings: Cow::Borrowed(&[");
    for binding in bindings {
        let kind = match binding.kind {
            BindingKind::Buffer { stride } => format!("BindingKind::Buffer {{ stride: {stride} }}"),
            BindingKind::Image(format) => format!("BindingKind::Image(Format::{format:?})"),
        };
        write!(
            code,
            "Binding {{ name: Cow::Borrowed({:?}), binding: {}, kind: {kind}, access: Access::{:?} }}, ",
            binding.name, binding.binding, binding.access
        )
        .unwrap();
    }
    code.push_str("]),\nparams: Cow::Borrowed(&[");
    for member in &params.members {
        write!(
            code,
            "ParamMember {{ name: Cow::Borrowed({:?}), ty: Cow::Borrowed({:?}), offset: {}, size: {} }}, ",
            member.name, member.ty, member.offset, member.size
        )
        .unwrap();
    }
    let ids: Vec<_> = used.iter().map(|constant| constant.id).collect();
    writeln!(code, "]),\nspec_ids: Cow::Borrowed(&{ids:?}),").unwrap();
    match &kernel.ray_query {
        None => code.push_str("modules: Modules::Plain(Cow::Borrowed(&SPIRV)) };\n"),
        Some(words) => {
            code.push_str("modules: Modules::Tracing { software: Some(Cow::Borrowed(&SPIRV)), ray_query: Some(Cow::Borrowed(&SPIRV_RAY_QUERY)) } };\n");
            writeln!(code, "static SPIRV_RAY_QUERY: [u32; {}] = {words:?};", words.len()).unwrap();
        }
    }
    writeln!(code, "static SPIRV: [u32; {}] = {:?};\n}}", kernel.plain.len(), kernel.plain).unwrap();
    Ok(())
}
