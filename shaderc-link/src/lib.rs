//! Debian's `libshaderc_combined.a` holds shaderc alone. This crate's build script names the static
//! libraries it leaves out (packages `glslang-dev` and `spirv-tools`), where they are installed.
