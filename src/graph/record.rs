//! Recording: resources, passes, and every check that needs no device.

use super::{
    error::{Error, Mistake, quoted, suggestion},
    kernel::{Bindings, Kernel, Params, RuntimeKernel, by_name, named_params},
    resource::{AnyRes, Buffer, BufferDesc, Desc, Image, ImageDesc, Res, Tap, Ticket},
    stages::Stages,
    work::{Code, Dispatch, Grid, KernelWork, Object, PassDecl, RawContext, ResourceDecl, Use, Work},
};
use crate::vk::{self, Access, BindingKind, KernelCode};
use bytemuck::Pod;
use std::{
    borrow::Cow,
    collections::HashMap,
    fmt,
    ops::Range,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
};

/// Index of the scene, see [`Graph::scene`].
const SCENE: u32 = 0;

/// A list of passes over resources, recorded anew for every frame. See the [module](super) for the rules.
pub struct Graph {
    pub(super) id: u32,
    pub(super) resources: Vec<ResourceDecl>,
    pub(super) passes: Vec<PassDecl>,
    /// Where in staging memory the contents of each ticket arrive.
    pub(super) tickets: Vec<Range<u64>>,
    pub(super) upload_bytes: u64,
    pub(super) readback_bytes: u64,
    /// See [`Graph::keep`].
    pub(super) kept: Vec<u32>,
    pub(super) mistake: Option<Mistake>,
    prefix: String,
    /// How many passes asked for each path.
    paths: HashMap<String, u32>,
}

impl fmt::Debug for Graph {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.passes.iter().map(|pass| &pass.path)).finish()
    }
}

impl Default for Graph {
    fn default() -> Self {
        Self::new()
    }
}

impl Graph {
    /// An empty graph.
    #[must_use]
    pub fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let scene = ResourceDecl {
            name: "scene".into(),
            desc: Desc::Scene,
            imported: true,
            object: Object::None,
            written: true,
        };
        Self {
            id: NEXT.fetch_add(1, Ordering::Relaxed),
            resources: vec![scene],
            passes: Vec::new(),
            tickets: Vec::new(),
            upload_bytes: 0,
            readback_bytes: 0,
            kept: Vec::new(),
            mistake: None,
            prefix: String::new(),
            paths: HashMap::new(),
        }
    }

    /// A transient image. Its memory exists from its first pass to its last and may be shared with others.
    pub fn image(&mut self, name: impl Into<Cow<'static, str>>, desc: ImageDesc) -> Res<Image> {
        self.resource(name.into(), Desc::Image(desc), false)
    }

    /// A transient buffer of `size` bytes, at least 1.
    pub fn buffer(&mut self, name: impl Into<Cow<'static, str>>, size: u64) -> Res<Buffer> {
        self.resource(name.into(), Desc::Buffer(BufferDesc { size }), false)
    }

    /// An image that exists outside of the graph, whose contents survive it. Passes that write it are never
    /// culled. Importing it again gives the same handle.
    pub fn import_image(&mut self, name: impl Into<Cow<'static, str>>, image: &Arc<vk::Image>) -> Res<Image> {
        let desc = Desc::Image(ImageDesc::new(image.extent(), image.format()));
        let same = |object: &Object| matches!(object, Object::Image(other) if Arc::ptr_eq(other, image));
        self.import(name.into(), desc, Object::Image(Arc::clone(image)), same)
    }

    /// A buffer that exists outside of the graph, like [`import_image`](Self::import_image). It may be one the
    /// host has written, or will read.
    pub fn import_buffer(
        &mut self,
        name: impl Into<Cow<'static, str>>,
        buffer: &Arc<vk::Buffer>,
    ) -> Res<Buffer> {
        let desc = Desc::Buffer(BufferDesc { size: buffer.size() });
        let same = |object: &Object| matches!(object, Object::Buffer(other) if Arc::ptr_eq(other, buffer));
        self.import(name.into(), desc, Object::Buffer(Arc::clone(buffer)), same)
    }

    /// An imported image without its object: such a graph can be planned and dumped where there is no
    /// device, not run.
    pub fn declare_image(&mut self, name: impl Into<Cow<'static, str>>, desc: ImageDesc) -> Res<Image> {
        self.resource(name.into(), Desc::Image(desc), true)
    }

    /// An imported buffer without its object, like [`declare_image`](Self::declare_image).
    pub fn declare_buffer(&mut self, name: impl Into<Cow<'static, str>>, size: u64) -> Res<Buffer> {
        self.resource(name.into(), Desc::Buffer(BufferDesc { size }), true)
    }

    /// Descriptor set 0 with the acceleration structures and buffers it leads to. Kernels that use the scene
    /// read it without saying so; a raw pass that builds or updates a part of it declares a write.
    #[must_use]
    pub fn scene(&self) -> AnyRes {
        AnyRes::new(self.id, SCENE)
    }

    /// Size and format of an image.
    ///
    /// # Panics
    /// If the handle belongs to another graph.
    #[must_use]
    pub fn desc(&self, image: Res<Image>) -> ImageDesc {
        match self.own(image.any).map(|index| self.resources[index as usize].desc) {
            Ok(Desc::Image(desc)) => desc,
            _ => panic!("{image:?} is no image of this graph"),
        }
    }

    /// Bytes of a buffer.
    ///
    /// # Panics
    /// If the handle belongs to another graph.
    #[must_use]
    pub fn size(&self, buffer: Res<Buffer>) -> u64 {
        match self.own(buffer.any).map(|index| self.resources[index as usize].desc) {
            Ok(Desc::Buffer(desc)) => desc.size,
            _ => panic!("{buffer:?} is no buffer of this graph"),
        }
    }

    /// Records with `name/` before the names of passes, by which times roll up.
    pub fn group<R>(&mut self, name: impl Into<Cow<'static, str>>, f: impl FnOnce(&mut Self) -> R) -> R {
        let outer = self.prefix.len();
        self.prefix.push_str(&name.into());
        self.prefix.push('/');
        let result = f(self);
        self.prefix.truncate(outer);
        result
    }

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

    /// Sets every four bytes of a buffer, whose size must be a multiple of 4.
    pub fn fill(&mut self, name: impl Into<Cow<'static, str>>, buffer: Res<Buffer>, value: u32) {
        self.transfer(name.into(), &[("buffer", buffer.any, Access::Write)], |descs, index| {
            let bytes = descs[0].bytes();
            if !bytes.is_multiple_of(4) {
                return Err(Mistake::new(format!("{bytes} bytes are no multiple of 4")).at("buffer"));
            }
            Ok(Work::Fill { buffer: index[0], value })
        });
    }

    /// Sets every texel of an image to zero.
    pub fn clear_image(&mut self, name: impl Into<Cow<'static, str>>, image: Res<Image>) {
        let operands = [("image", image.any, Access::Write)];
        self.transfer(name.into(), &operands, |_, index| Ok(Work::Clear { image: index[0] }));
    }

    /// A transient buffer that holds `contents` before the first pass: no pass waits for them alone.
    pub fn buffer_with(&mut self, name: &'static str, contents: Vec<u8>) -> Res<Buffer> {
        let buffer = self.buffer(name, contents.len() as u64);
        let recorded = self.passes.len();
        self.upload(name, buffer, contents);
        let added = self.passes.len() - recorded;
        self.passes.rotate_right(added);
        buffer
    }

    /// Copies bytes to the start of a buffer, which must hold them.
    pub fn upload(&mut self, name: impl Into<Cow<'static, str>>, buffer: Res<Buffer>, bytes: Vec<u8>) {
        let at = advance(&mut self.upload_bytes, bytes.len() as u64);
        self.transfer(name.into(), &[("buffer", buffer.any, Access::Write)], |descs, index| {
            let (given, room) = (bytes.len() as u64, descs[0].bytes());
            if given > room {
                return Err(Mistake::new(format!("{given} bytes for a buffer of {room}")).at("buffer"));
            }
            Ok(Work::Upload { to: index[0], at, bytes })
        });
    }

    /// Copies tightly packed texels, row by row from the top left, to a whole image.
    pub fn upload_image(&mut self, name: impl Into<Cow<'static, str>>, image: Res<Image>, texels: Vec<u8>) {
        let at = advance(&mut self.upload_bytes, texels.len() as u64);
        self.transfer(name.into(), &[("image", image.any, Access::Write)], |descs, index| {
            let (given, room) = (texels.len() as u64, descs[0].bytes());
            if given != room {
                return Err(Mistake::new(format!("{given} bytes for an image of {room}")).at("image"));
            }
            Ok(Work::Upload { to: index[0], at, bytes: texels })
        });
    }

    /// Copies `size` bytes from one buffer to another.
    pub fn copy_buffer(
        &mut self,
        name: impl Into<Cow<'static, str>>,
        (from, from_offset): (Res<Buffer>, u64),
        (to, to_offset): (Res<Buffer>, u64),
        size: u64,
    ) {
        let operands = [("from", from.any, Access::Read), ("to", to.any, Access::Write)];
        self.transfer(name.into(), &operands, |descs, index| {
            for ((desc, offset), variable) in descs.iter().zip([from_offset, to_offset]).zip(["from", "to"]) {
                if offset.checked_add(size).is_none_or(|end| end > desc.bytes()) {
                    let what = format!("{size} bytes at byte {offset} reach past the end, {}", desc.bytes());
                    return Err(Mistake::new(what).at(variable));
                }
            }
            if size == 0 {
                return Err(Mistake::new("copies no bytes"));
            }
            if index[0] == index[1] && from_offset.abs_diff(to_offset) < size {
                return Err(Mistake::new("copies a buffer over itself"));
            }
            Ok(Work::CopyBuffer { from: index[0], from_offset, to: index[1], to_offset, size })
        });
    }

    /// Copies an image to another of the same size and format.
    pub fn copy_image(&mut self, name: impl Into<Cow<'static, str>>, from: Res<Image>, to: Res<Image>) {
        let operands = [("from", from.any, Access::Read), ("to", to.any, Access::Write)];
        self.transfer(name.into(), &operands, |descs, index| {
            if descs[0] != descs[1] {
                return Err(Mistake::new(format!("{:?} is copied to {:?}", descs[0], descs[1])));
            }
            if index[0] == index[1] {
                return Err(Mistake::new("copies an image over itself"));
            }
            Ok(Work::CopyImage { from: index[0], to: index[1] })
        });
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

    /// Keeps the passes that make a resource although nothing reads it: work to be timed whose result nobody wants.
    pub fn keep(&mut self, resource: impl Into<AnyRes>) {
        match self.readable(resource.into(), Access::Read) {
            Ok(index) => self.kept.push(index),
            Err(mistake) => self.remember(Err(mistake)),
        }
    }

    /// Asks for a buffer's contents as they are at this point of the recording.
    pub fn read_buffer<T: Pod>(&mut self, buffer: Res<Buffer>) -> Ticket<T> {
        self.readback(buffer.any)
    }

    /// Asks for an image's texels as they are at this point of the recording, row by row from the top left,
    /// tightly packed. `T` may be a texel (`[f32; 4]`) or a component (`f32`).
    pub fn read_image<T: Pod>(&mut self, image: Res<Image>) -> Ticket<T> {
        self.readback(image.any)
    }

    /// Asks for what a recorded pass leaves in one of its resources, `"path/of/pass:variable"`. The variable
    /// is the shader's, or the resource's own name.
    ///
    /// # Errors
    /// A name that is not there, with those that are.
    pub fn tap(&mut self, spec: &str) -> Result<Tap, Error> {
        let (path, variable) = spec
            .rsplit_once(':')
            .ok_or_else(|| Mistake::new(format!("tap `{spec}` is not of the form `PASS:VARIABLE`")))?;
        let passes = || self.passes.iter().filter(|p| !matches!(p.work, Work::Readback { .. }));
        let pass = self.passes.iter().position(|p| p.path == path).ok_or_else(|| {
            let names = || passes().map(|p| &*p.path);
            let what = format!(
                "no pass `{path}` to tap{}; there are {}",
                suggestion(path, names()),
                quoted(names())
            );
            Mistake::new(what)
        })?;
        let tappable = || self.passes[pass].uses.iter().filter(|u| u.resource != SCENE);
        let resource = tappable()
            .find(|u| u.variable == variable)
            .or_else(|| tappable().find(|u| self.resources[u.resource as usize].name == variable))
            .map(|u| u.resource)
            .ok_or_else(|| {
                let names = || tappable().map(|u| &*u.variable);
                let what = format!(
                    "no variable `{variable}` to tap{}; there are {}",
                    suggestion(variable, names()),
                    quoted(names())
                );
                Mistake::new(what).in_pass(path)
            })?;
        let desc = self.resources[resource as usize].desc;
        let ticket = self.ticket(desc.bytes());
        let uses =
            vec![Use { resource, variable: "source".into(), stages: Stages::TRANSFER, access: Access::Read }];
        let work = Work::Readback { from: resource, ticket: ticket.index };
        let path = self.at_root(|g| g.path(&format!("tap/{spec}")));
        self.passes.insert(pass + 1, PassDecl { path, uses, work });
        Ok(Tap { ticket, desc })
    }

    fn resource<T>(&mut self, name: Cow<'static, str>, desc: Desc, imported: bool) -> Res<T> {
        if desc.bytes() == 0 {
            self.remember(Err(Mistake::new(format!("{} `{name}` has no bytes", desc.noun()))));
        }
        let index = u32::try_from(self.resources.len()).expect("fewer than 2^32 resources");
        self.resources.push(ResourceDecl { name, desc, imported, object: Object::None, written: imported });
        Res::new(self.id, index)
    }

    fn import<T>(
        &mut self,
        name: Cow<'static, str>,
        desc: Desc,
        object: Object,
        same: impl Fn(&Object) -> bool,
    ) -> Res<T> {
        // Two handles of one object would hide its hazards.
        if let Some(index) = self.resources.iter().position(|decl| same(&decl.object)) {
            return Res::new(self.id, index as u32);
        }
        let res: Res<T> = self.resource(name, desc, true);
        let index = self.resources.len() - 1;
        self.resources[index].object = object;
        res
    }

    fn path(&mut self, name: &str) -> String {
        let mut path = format!("{}{name}", self.prefix);
        let count = self.paths.entry(path.clone()).or_insert(0);
        *count += 1;
        if *count > 1 {
            path = format!("{path}#{count}");
        }
        path
    }

    fn remember(&mut self, recorded: Result<(), Mistake>) {
        if let Err(mistake) = recorded {
            self.mistake.get_or_insert(mistake);
        }
    }

    fn push(&mut self, pass: PassDecl) {
        for used in pass.uses.iter().filter(|u| u.access.writes()) {
            self.resources[used.resource as usize].written = true;
        }
        self.passes.push(pass);
    }

    fn own(&self, resource: AnyRes) -> Result<u32, Mistake> {
        resource.index_in(self.id).ok_or_else(|| Mistake::new("the handle belongs to another graph"))
    }

    /// The index of a resource of this graph, which has contents if they are to be read.
    fn readable(&self, resource: AnyRes, access: Access) -> Result<u32, Mistake> {
        let index = self.own(resource)?;
        let decl = &self.resources[index as usize];
        if access.reads() && !decl.written {
            let what =
                format!("reads {} `{}`, which nothing has written before", decl.desc.noun(), decl.name);
            return Err(Mistake::new(what));
        }
        Ok(index)
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

    /// Records the pass that `work` makes of its operands' descriptions and indices, or remembers the mistake.
    fn transfer(
        &mut self,
        name: Cow<'static, str>,
        operands: &[(&'static str, AnyRes, Access)],
        work: impl FnOnce(&[Desc], &[u32]) -> Result<Work, Mistake>,
    ) {
        let path = self.path(&name);
        let uses = operands.iter().map(|&(variable, resource, access)| {
            let index = self.readable(resource, access).map_err(|m| m.at(variable))?;
            Ok(Use { resource: index, variable: variable.into(), stages: Stages::TRANSFER, access })
        });
        let recorded = uses.collect::<Result<Vec<Use>, Mistake>>().and_then(|uses| {
            let indices: Vec<u32> = uses.iter().map(|u| u.resource).collect();
            let descs: Vec<Desc> = indices.iter().map(|&index| self.resources[index as usize].desc).collect();
            Ok((uses, work(&descs, &indices)?))
        });
        match recorded {
            Ok((uses, work)) => self.push(PassDecl { path, uses, work }),
            Err(mistake) => self.remember(Err(mistake.in_pass(&path))),
        }
    }

    fn ticket<T>(&mut self, bytes: u64) -> Ticket<T> {
        let start = advance(&mut self.readback_bytes, bytes);
        self.tickets.push(start..start + bytes);
        Ticket::new(self.id, self.tickets.len() - 1)
    }

    fn readback<T: Pod>(&mut self, resource: AnyRes) -> Ticket<T> {
        let decl = self.own(resource).map(|index| &self.resources[index as usize]);
        let (name, desc) = decl.map_or(("".into(), None), |decl| (decl.name.clone(), Some(decl.desc)));
        let ticket = self.ticket(desc.map_or(0, Desc::bytes));
        let index = ticket.index;
        self.at_root(|g| {
            g.transfer(
                format!("readback/{name}").into(),
                &[("source", resource, Access::Read)],
                |descs, from| {
                    let unit = match descs[0] {
                        Desc::Image(desc) => u64::from(desc.format.size()),
                        desc => desc.bytes(),
                    };
                    let element = size_of::<T>() as u64;
                    if element == 0 || !unit.is_multiple_of(element) {
                        let what = format!("holds no whole number of elements of {element} bytes");
                        return Err(Mistake::new(what).at("source"));
                    }
                    Ok(Work::Readback { from: from[0], ticket: index })
                },
            );
        });
        ticket
    }

    /// Records outside of all groups.
    fn at_root<R>(&mut self, f: impl FnOnce(&mut Self) -> R) -> R {
        let prefix = std::mem::take(&mut self.prefix);
        let result = f(self);
        self.prefix = prefix;
        result
    }
}

/// The place of `size` bytes in staging memory, aligned for texels of all formats.
fn advance(at: &mut u64, size: u64) -> u64 {
    let start = *at;
    *at = (start + size).next_multiple_of(16);
    start
}
