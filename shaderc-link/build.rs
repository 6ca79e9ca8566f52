use std::env;
use std::path::PathBuf;

/// In link order: each library only needs symbols of those after it.
const LIBRARIES: [&str; 9] = [
    "glslang",
    "MachineIndependent",
    "GenericCodeGen",
    "OSDependent",
    "OGLCompiler",
    "HLSL",
    "SPIRV",
    "SPIRV-Tools-opt",
    "SPIRV-Tools",
];

fn main() {
    println!("cargo:rerun-if-env-changed=SHADERC_LIB_DIR");
    let arch = env::var("CARGO_CFG_TARGET_ARCH").unwrap_or_default();
    let directory = env::var_os("SHADERC_LIB_DIR")
        .map_or_else(|| PathBuf::from(format!("/usr/lib/{arch}-linux-gnu")), PathBuf::from);
    // Where these are absent, the archive is one as shaderc itself makes it, which carries everything.
    let has = |library| directory.join(format!("lib{library}.a")).exists();
    if !has("shaderc_combined") || !has("glslang") {
        return;
    }
    println!("cargo:rustc-link-search=native={}", directory.display());
    for library in LIBRARIES {
        if has(library) {
            println!("cargo:rustc-link-lib=static:-bundle={library}");
        }
    }
    println!("cargo:rustc-link-lib=dylib=stdc++");
}
