//! Recording of kernels and of passes that record themselves, with every check that needs no device.

use super::{
    error::{Error, Mistake},
    kernel::{Bindings, Kernel, Params, RuntimeKernel, by_name, named_params},
    record::{Graph, SCENE},
    resource::{AnyRes, Desc},
    stages::Stages,
    work::{Code, Dispatch, Grid, KernelWork, PassDecl, RawContext, ResourceDecl, Use, Work},
};
use crate::vk::{Access, BindingKind, KernelCode};
use bytemuck::Pod;
use std::{borrow::Cow, sync::Arc};

impl Graph {
    /// A pass that runs a kernel known at build time. A mistake (an image of another format, a handle of
    /// another graph, a read of what nothing has written, …) is returned by [`plan`](Self::plan) or when
    /// the graph runs, naming pass, shader and variable.
    pub fn pass<B: Bindings, P: Pod>(
        &mut self,
        name: impl Into<Cow<'static, str>>,
        kernel: &Kernel<B, P>,
        bind: B,
        params: P,
        grid: Grid,
    ) {
        let mut bound = Vec::with_capacity(kernel.code.bindings.len());
        bind.resources(&mut bound);
        let params = bytemuck::bytes_of(&params).to_vec();
        let path = self.path(&name.into());
        let recorded =
            self.kernel_pass(path, Code::Static(kernel.code), kernel.spec.clone(), &bound, params, grid);
        self.remember(recorded);
    }

    /// A pass that runs a kernel compiled at run time, its resources and parameters given by GLSL name.
    ///
    /// # Errors
    /// An unknown, missing or repeated name (with the nearest one there is), a resource or parameter of
    /// another type, and whatever [`pass`](Self::pass) would remember. Nothing is recorded then.
    pub fn pass_named<'p>(
        &mut self,
        name: impl Into<Cow<'static, str>>,
        kernel: &RuntimeKernel,
        bind: &[(&str, AnyRes)],
        params: impl Into<Params<'p>>,
        grid: Grid,
    ) -> Result<(), Error> {
        let path = self.path(&name.into());
        let code = &kernel.code;
        let in_pass = |mistake: Mistake| mistake.in_shader(&code.name).in_pass(&path);
        let order = by_name(
            "variable",
            code.bindings.iter().map(|binding| &*binding.name),
            bind.iter().map(|(name, _)| *name),
        )
        .map_err(in_pass)?;
        let bound: Vec<AnyRes> = order.into_iter().map(|given| bind[given].1).collect();
        let params = match params.into() {
            Params::Bytes(bytes) => bytes.to_vec(),
            Params::Named(members) => named_params(code, members).map_err(in_pass)?,
        };
        let code = Code::Shared(Arc::clone(code));
        Ok(self.kernel_pass(path, code, kernel.spec.clone(), &bound, params, grid)?)
    }

    /// A pass that records its own commands, such as an acceleration structure's build. It is never culled,
    /// is ordered against all stages, and must touch no more than it declares.
    pub fn raw(
        &mut self,
        name: impl Into<Cow<'static, str>>,
        accesses: &[(AnyRes, Access)],
        record: impl FnOnce(&RawContext<'_>) + Send + 'static,
    ) {
        let path = self.path(&name.into());
        let mut uses = Vec::with_capacity(accesses.len());
        for &(resource, access) in accesses {
            match self.readable(resource, access) {
                Ok(index) => uses.push(Use {
                    resource: index,
                    variable: self.resources[index as usize].name.clone(),
                    stages: Stages::ALL,
                    access,
                }),
                Err(mistake) => return self.remember(Err(mistake.in_pass(&path))),
            }
        }
        self.push(PassDecl { path, uses, work: Work::Raw(Some(Box::new(record))) });
    }

    fn kernel_pass(
        &mut self,
        path: String,
        code: Code,
        spec: Vec<u32>,
        bound: &[AnyRes],
        params: Vec<u8>,
        grid: Grid,
    ) -> Result<(), Mistake> {
        match self.kernel_uses(&code, &spec, bound, &params, grid) {
            Ok((uses, bound, dispatch)) => {
                let work = Work::Kernel(KernelWork { code, spec, bound, params, dispatch });
                self.push(PassDecl { path, uses, work });
                Ok(())
            }
            Err(mistake) => Err(mistake.in_shader(&code.name).in_pass(&path)),
        }
    }

    fn kernel_uses(
        &self,
        code: &KernelCode,
        spec: &[u32],
        bound: &[AnyRes],
        params: &[u8],
        grid: Grid,
    ) -> Result<(Vec<Use>, Vec<u32>, Dispatch), Mistake> {
        let counts = [
            ("resources", bound.len(), code.bindings.len()),
            ("specialization constants", spec.len(), code.spec_ids.len()),
            ("bytes of parameters", params.len(), code.params_size as usize),
        ];
        for (what, given, wanted) in counts {
            if given != wanted {
                return Err(Mistake::new(format!("{given} {what} where the shader has {wanted}")));
            }
        }
        let mut uses = Vec::with_capacity(bound.len() + 2);
        let mut indices = Vec::with_capacity(bound.len());
        for (binding, &resource) in code.bindings.iter().zip(bound) {
            let index = self
                .readable(resource, binding.access)
                .and_then(|index| self.fits(binding.kind, index).map(|()| index))
                .map_err(|m| m.at(&binding.name))?;
            indices.push(index);
            uses.push(Use {
                resource: index,
                variable: binding.name.clone(),
                stages: Stages::COMPUTE,
                access: binding.access,
            });
        }
        if code.uses_scene {
            let access = Access::Read;
            uses.push(Use { resource: SCENE, variable: "scene".into(), stages: Stages::COMPUTE, access });
        }
        let dispatch = self.dispatch(code.workgroup, grid).map_err(|m| m.at("grid"))?;
        if let Dispatch::Indirect { buffer, .. } = dispatch {
            let access = Access::Read;
            uses.push(Use { resource: buffer, variable: "grid".into(), stages: Stages::INDIRECT, access });
        }
        Ok((uses, indices, dispatch))
    }

    /// Checks that a resource is what a shader declares.
    fn fits(&self, kind: BindingKind, index: u32) -> Result<(), Mistake> {
        let ResourceDecl { name, desc, .. } = &self.resources[index as usize];
        let what = match (kind, *desc) {
            (BindingKind::Buffer { stride }, Desc::Buffer(desc)) if desc.size < u64::from(stride) => {
                format!("buffer `{name}` of {} bytes holds no element of {stride}", desc.size)
            }
            (BindingKind::Image(format), Desc::Image(desc)) if desc.format != format => {
                format!("image `{name}` is {:?}, the shader declares {format:?}", desc.format)
            }
            (BindingKind::Buffer { .. }, Desc::Buffer(_)) | (BindingKind::Image(_), Desc::Image(_)) => {
                return Ok(());
            }
            (BindingKind::Buffer { .. }, desc) => {
                format!("the shader declares a buffer, `{name}` is an {}", desc.noun())
            }
            (BindingKind::Image(_), desc) => {
                format!("the shader declares an image, `{name}` is a {}", desc.noun())
            }
        };
        Err(Mistake::new(what))
    }

    fn dispatch(&self, workgroup: [u32; 3], grid: Grid) -> Result<Dispatch, Mistake> {
        let size = match grid {
            Grid::Of(size) => size,
            Grid::Over(image) => match self.resources[self.own(image.any)? as usize].desc {
                Desc::Image(desc) => [desc.extent[0], desc.extent[1], 1],
                _ => return Err(Mistake::new("the grid is no image")),
            },
            Grid::Indirect { buffer, offset } => {
                let buffer = self.readable(buffer.any, Access::Read)?;
                let ResourceDecl { name, desc, .. } = &self.resources[buffer as usize];
                let bytes = desc.bytes();
                if !offset.is_multiple_of(4) || offset.checked_add(12).is_none_or(|end| end > bytes) {
                    let what =
                        format!("no three numbers at byte {offset} of buffer `{name}` of {bytes} bytes");
                    return Err(Mistake::new(what));
                }
                return Ok(Dispatch::Indirect { buffer, offset });
            }
        };
        Ok(Dispatch::Groups(std::array::from_fn(|i| size[i].div_ceil(workgroup[i].max(1)))))
    }
}
