//! Recording: a graph, its resources and the names of its passes.

use super::{
    error::Mistake,
    resource::{AnyRes, Buffer, BufferDesc, Desc, Image, ImageDesc, Res},
    work::{Object, PassDecl, ResourceDecl},
};
use crate::vk::{self, Access};
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
pub(super) const SCENE: u32 = 0;

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

    /// Keeps the passes that make a resource although nothing reads it: work to be timed whose result nobody wants.
    pub fn keep(&mut self, resource: impl Into<AnyRes>) {
        match self.readable(resource.into(), Access::Read) {
            Ok(index) => self.kept.push(index),
            Err(mistake) => self.remember(Err(mistake)),
        }
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

    pub(super) fn path(&mut self, name: &str) -> String {
        let mut path = format!("{}{name}", self.prefix);
        let count = self.paths.entry(path.clone()).or_insert(0);
        *count += 1;
        if *count > 1 {
            path = format!("{path}#{count}");
        }
        path
    }

    pub(super) fn remember(&mut self, recorded: Result<(), Mistake>) {
        if let Err(mistake) = recorded {
            self.mistake.get_or_insert(mistake);
        }
    }

    pub(super) fn push(&mut self, pass: PassDecl) {
        for used in pass.uses.iter().filter(|u| u.access.writes()) {
            self.resources[used.resource as usize].written = true;
        }
        self.passes.push(pass);
    }

    pub(super) fn own(&self, resource: AnyRes) -> Result<u32, Mistake> {
        resource.index_in(self.id).ok_or_else(|| Mistake::new("the handle belongs to another graph"))
    }

    /// The index of a resource of this graph, which has contents if they are to be read.
    pub(super) fn readable(&self, resource: AnyRes, access: Access) -> Result<u32, Mistake> {
        let index = self.own(resource)?;
        let decl = &self.resources[index as usize];
        if access.reads() && !decl.written {
            let what =
                format!("reads {} `{}`, which nothing has written before", decl.desc.noun(), decl.name);
            return Err(Mistake::new(what));
        }
        Ok(index)
    }

    /// Records outside of all groups.
    pub(super) fn at_root<R>(&mut self, f: impl FnOnce(&mut Self) -> R) -> R {
        let prefix = std::mem::take(&mut self.prefix);
        let result = f(self);
        self.prefix = prefix;
        result
    }
}
