//! What a kernel pass is recorded from: the kernel, its resources and its parameters.

use super::{
    error::{Mistake, quoted, suggestion},
    resource::AnyRes,
};
use crate::vk::KernelCode;
use std::{marker::PhantomData, sync::Arc};

/// The resources of one kernel pass; generated for every kernel known at build time.
pub trait Bindings {
    /// Pushes one handle for each of [`KernelCode::bindings`], in that order.
    fn resources(&self, out: &mut Vec<AnyRes>);
}

impl Bindings for () {
    fn resources(&self, _: &mut Vec<AnyRes>) {}
}

/// A kernel known at build time: a constant description with the types of its bindings and parameters.
/// Pipelines are made when a graph runs.
#[derive(Debug)]
pub struct Kernel<B, P> {
    pub(super) code: &'static KernelCode,
    pub(super) spec: Vec<u32>,
    types: PhantomData<fn(B, P)>,
}

impl<B, P> Clone for Kernel<B, P> {
    fn clone(&self) -> Self {
        Self { code: self.code, spec: self.spec.clone(), types: PhantomData }
    }
}

impl<B, P> Kernel<B, P> {
    /// `spec` holds one value for each of [`KernelCode::spec_ids`], as 32 bits. Called by generated code.
    #[must_use]
    pub const fn new(code: &'static KernelCode, spec: Vec<u32>) -> Self {
        Self { code, spec, types: PhantomData }
    }

    /// What it was compiled to.
    #[must_use]
    pub const fn code(&self) -> &'static KernelCode {
        self.code
    }
}

/// A kernel compiled while the program runs; its names are checked by [`Graph::pass_named`](super::Graph::pass_named).
#[derive(Clone, Debug)]
pub struct RuntimeKernel {
    pub(super) code: Arc<KernelCode>,
    pub(super) spec: Vec<u32>,
}

impl RuntimeKernel {
    /// `spec` holds one value for each of [`KernelCode::spec_ids`], as 32 bits.
    #[must_use]
    pub const fn new(code: Arc<KernelCode>, spec: Vec<u32>) -> Self {
        Self { code, spec }
    }

    /// What it was compiled to.
    #[must_use]
    pub fn code(&self) -> &KernelCode {
        &self.code
    }
}

/// Push constants of [`Graph::pass_named`](super::Graph::pass_named).
#[derive(Clone, Copy, Debug)]
pub enum Params<'p> {
    /// The whole block.
    Bytes(&'p [u8]),
    /// Every member by name.
    Named(&'p [(&'p str, ParamValue)]),
}

impl<'p> From<&'p [u8]> for Params<'p> {
    fn from(bytes: &'p [u8]) -> Self {
        Self::Bytes(bytes)
    }
}

impl<'p> From<&'p [(&'p str, ParamValue)]> for Params<'p> {
    fn from(members: &'p [(&'p str, ParamValue)]) -> Self {
        Self::Named(members)
    }
}

impl<'p, const N: usize> From<&'p [(&'p str, ParamValue); N]> for Params<'p> {
    fn from(members: &'p [(&'p str, ParamValue); N]) -> Self {
        Self::Named(members)
    }
}

/// Value of one member of a kernel's push constants, made with `From`.
#[derive(Clone, Copy, Debug)]
pub struct ParamValue {
    ty: &'static str,
    bytes: [u8; 64],
    size: usize,
}

macro_rules! param_values {
    ($($rust:ty => $glsl:literal),+ $(,)?) => {$(
        impl From<$rust> for ParamValue {
            fn from(value: $rust) -> Self {
                let source = bytemuck::bytes_of(&value);
                let mut bytes = [0; 64];
                bytes[..source.len()].copy_from_slice(source);
                Self { ty: $glsl, bytes, size: source.len() }
            }
        }
    )+};
}

param_values! {
    f32 => "float", [f32; 2] => "vec2", [f32; 3] => "vec3", [f32; 4] => "vec4",
    i32 => "int", [i32; 2] => "ivec2", [i32; 3] => "ivec3", [i32; 4] => "ivec4",
    u32 => "uint", [u32; 2] => "uvec2", [u32; 3] => "uvec3", [u32; 4] => "uvec4",
    u64 => "uint64_t", glam::Vec2 => "vec2", glam::Vec3 => "vec3", glam::Vec4 => "vec4", glam::Mat4 => "mat4",
}

/// For each wanted name, the place of the given one; names must match one to one.
pub(super) fn by_name<'n>(
    noun: &str,
    wanted: impl Iterator<Item = &'n str> + Clone,
    given: impl Iterator<Item = &'n str> + Clone,
) -> Result<Vec<usize>, Mistake> {
    for (place, name) in given.clone().enumerate() {
        if !wanted.clone().any(|w| w == name) {
            let what = format!(
                "the shader has no {noun} `{name}`{}; it has {}",
                suggestion(name, wanted.clone()),
                quoted(wanted.clone())
            );
            return Err(Mistake::new(what));
        }
        if given.clone().take(place).any(|earlier| earlier == name) {
            return Err(Mistake::new(format!("{noun} `{name}` is given twice")));
        }
    }
    wanted
        .map(|name| {
            given
                .clone()
                .position(|g| g == name)
                .ok_or_else(|| Mistake::new(format!("{noun} `{name}` is not given")).at(name))
        })
        .collect()
}

pub(super) fn named_params(code: &KernelCode, given: &[(&str, ParamValue)]) -> Result<Vec<u8>, Mistake> {
    let order = by_name(
        "parameter",
        code.params.iter().map(|member| &*member.name),
        given.iter().map(|(name, _)| *name),
    )?;
    let mut bytes = vec![0; code.params_size as usize];
    for (member, place) in code.params.iter().zip(order) {
        let value = &given[place].1;
        if member.ty != value.ty || member.size as usize != value.size {
            let what = format!("a {} is given for a {}", value.ty, member.ty);
            return Err(Mistake::new(what).at(&member.name));
        }
        let start = member.offset as usize;
        bytes[start..start + value.size].copy_from_slice(&value.bytes[..value.size]);
    }
    Ok(bytes)
}
