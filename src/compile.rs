//! Kernels compiled at run time against the GLSL that this library is made of.

use crate::ErrorClass;
use crate::graph::RuntimeKernel;
use crate::reflect;
use crate::renderer::Renderer;
use crate::shaders::INCLUDES;
use crate::vk::{Backend, KernelCode, Modules};
use std::cell::Cell;
use std::sync::Arc;

/// GLSL that cannot become a kernel.
#[derive(Debug, thiserror::Error)]
pub enum CompileError {
    /// The compiler's own words: file, line, error.
    #[error("{0}")]
    Glsl(String),
    /// Valid GLSL that is no kernel of a graph.
    #[error("kernel `{kernel}`: {rule}")]
    Interface {
        /// Name given by the caller.
        kernel: String,
        /// The rule it breaks.
        rule: String,
    },
}

impl CompileError {
    /// What kind of failure this is: bad input.
    #[must_use]
    pub fn class(&self) -> ErrorClass {
        ErrorClass::Input
    }
}

impl RuntimeKernel {
    /// Compiles a compute shader for the backend and the scene of `renderer`.
    ///
    /// The source may include everything under `glsl/`, first of all `trace/trace.glsl` (declare the local size
    /// before it), `lib/camera.glsl` (`camera_ray(pixel)`) and `lib/surface.glsl` (`surface_at(hit)`). Its own
    /// storage buffers and images are single variables of set 1; `readonly` and `writeonly` say how the graph
    /// orders it, and push constants hold at most 128 bytes.
    ///
    /// # Errors
    /// [`CompileError`] with file and line, or the rule of the interface that is broken.
    pub fn from_glsl(renderer: &Renderer, name: &str, source: &str) -> Result<Self, CompileError> {
        let backend = renderer.backend().0;
        let (names, traces) = compile(name, source, backend, shaderc::OptimizationLevel::Zero)?;
        let reflection =
            reflect::reflect(&names).map_err(|rule| CompileError::Interface { kernel: name.into(), rule })?;
        let (words, _) = compile(name, source, backend, shaderc::OptimizationLevel::Performance)?;
        let scene = renderer.scene_spec();
        let constants = reflection.spec.iter();
        let spec = constants.clone().map(|c| scene.value(c.id).unwrap_or(c.default)).collect();
        let modules = match (traces, backend) {
            (false, _) => Modules::Plain(words.into()),
            (true, Backend::Software) => Modules::Tracing { software: Some(words.into()), ray_query: None },
            (true, Backend::RayQuery) => Modules::Tracing { software: None, ray_query: Some(words.into()) },
        };
        let code = KernelCode {
            name: name.to_owned().into(),
            workgroup: reflection.workgroup,
            bindings: reflection.bindings.into(),
            params_size: reflection.params.size,
            params: reflection.params.members.into(),
            spec_ids: constants.map(|c| c.id).collect(),
            uses_scene: reflection.uses_scene,
            modules,
        };
        Ok(Self::new(Arc::new(code), spec))
    }
}

/// Returns the module and whether it includes the tracing interface.
fn compile(
    name: &str,
    source: &str,
    backend: Backend,
    level: shaderc::OptimizationLevel,
) -> Result<(Vec<u32>, bool), CompileError> {
    let failed = |error: shaderc::Error| CompileError::Glsl(error.to_string());
    let compiler = shaderc::Compiler::new().map_err(failed)?;
    let traces = Cell::new(false);
    let mut options = shaderc::CompileOptions::new().map_err(failed)?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    options.set_optimization_level(level);
    let define = match backend {
        Backend::Software => "TRACE_SOFTWARE",
        Backend::RayQuery => "TRACE_RAY_QUERY",
    };
    options.add_macro_definition(define, Some("1"));
    options.set_include_callback(|include, _, from, _| {
        let (name, text) = INCLUDES
            .iter()
            .find(|(name, _)| *name == include)
            .ok_or_else(|| format!("{from} includes {include}, which is not under glsl/"))?;
        traces.set(traces.get() || *name == "trace/trace.glsl");
        Ok(shaderc::ResolvedInclude { resolved_name: (*name).to_owned(), content: (*text).to_owned() })
    });
    let artifact = compiler
        .compile_into_spirv(source, shaderc::ShaderKind::Compute, name, "main", Some(&options))
        .map_err(failed)?;
    Ok((artifact.as_binary().to_vec(), traces.get()))
}
