//! Compute pipelines and the descriptor set of the scene.
//!
//! Set 0 holds the scene, with one layout a [`Backend`]: binding 0 is a uniform buffer; under
//! [`Backend::RayQuery`] binding 1 is the acceleration structure over triangles and binding 2 that over their boxes.
//! Set 1 is the pass and is pushed.

use std::any::Any;
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use ash::vk;

use super::cache::{self, Owner};
use super::{
    AccelerationStructure, Backend, Binding, BindingKind, Buffer, Device, Error, KernelCode, Modules,
};

/// The most bytes of push constants every device has.
const MAX_PARAMS: u32 = 128;

/// What a main thread has (bytes): drivers' compilers recurse.
const COMPILER_STACK: usize = 8 << 20;

/// Compute pipelines, made once each and kept; what the driver compiled is kept on disk.
#[derive(Debug)]
pub struct Pipelines {
    device: Device,
    raw: vk::PipelineCache,
    file: Option<PathBuf>,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    pipelines: HashMap<Key, Arc<Pipeline>>,
    layouts: HashMap<LayoutKey, Arc<Layout>>,
    /// Whether a pipeline was made since the last save.
    unsaved: bool,
}

#[derive(Debug, PartialEq, Eq, Hash)]
struct Key {
    name: Cow<'static, str>,
    code: Code,
    spec: Vec<u32>,
    backend: Backend,
}

impl Key {
    fn new(code: &KernelCode, spec: &[u32], backend: Backend) -> Self {
        Self { name: code.name.clone(), code: identity(code, backend), spec: spec.to_vec(), backend }
    }
}

/// A module's identity: where it lies, for one in the program, else a hash of its words.
#[derive(Debug, PartialEq, Eq, Hash)]
enum Code {
    Static(usize, usize),
    Hash(u64),
}

#[derive(Debug, PartialEq, Eq, Hash)]
struct LayoutKey {
    backend: Backend,
    bindings: Vec<(u32, vk::DescriptorType)>,
    params_size: u32,
}

#[derive(Debug)]
struct Layout {
    device: Device,
    set: vk::DescriptorSetLayout,
    raw: vk::PipelineLayout,
}

impl Drop for Layout {
    fn drop(&mut self) {
        let device = self.device.raw();
        // SAFETY: pipelines and whoever records with them hold the layout.
        unsafe {
            device.destroy_pipeline_layout(self.raw, None);
            device.destroy_descriptor_set_layout(self.set, None);
        }
    }
}

/// A compute pipeline. It can be dispatched from any base workgroup.
#[derive(Debug)]
pub struct Pipeline {
    raw: vk::Pipeline,
    layout: Arc<Layout>,
}

impl Pipeline {
    pub(crate) fn raw(&self) -> vk::Pipeline {
        self.raw
    }

    pub(crate) fn layout(&self) -> vk::PipelineLayout {
        self.layout.raw
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // SAFETY: by the rule of the module, nothing in flight uses it.
        unsafe { self.layout.device.raw().destroy_pipeline(self.raw, None) };
    }
}

impl Pipelines {
    /// Pipelines for `device`, with a cache on disk: a file for each device and driver in the folder `parhelion` of the
    /// user's cache directory (`$XDG_CACHE_HOME` or `~/.cache`).
    ///
    /// It is no error if the file is damaged or cannot be written: the pipelines are then compiled again.
    ///
    /// # Errors
    ///
    /// What the driver said.
    pub fn new(device: &Device) -> Result<Self, Error> {
        Self::with_cache(device, cache::default_file(device.info()))
    }

    /// As [`Self::new`], with the cache in `file`, or none.
    ///
    /// # Errors
    ///
    /// What the driver said.
    pub fn with_cache(device: &Device, file: Option<PathBuf>) -> Result<Self, Error> {
        let owner = Owner::new(device.info(), &device.0.limits);
        let data = file.as_deref().map_or_else(Vec::new, |file| cache::load(file, &owner));
        let create = |data: &[u8]| {
            let info = vk::PipelineCacheCreateInfo::default().initial_data(data);
            // SAFETY: the data is empty or was written by this driver.
            unsafe { device.raw().create_pipeline_cache(&info, None) }
        };
        let raw = create(&data)
            .or_else(|e| if data.is_empty() { Err(e) } else { create(&[]) })
            .map_err(Error::vulkan("vkCreatePipelineCache", "pipelines"))?;
        device.set_name(raw, "pipelines");
        Ok(Self { device: device.clone(), raw, file, state: Mutex::default() })
    }

    /// The device they run on.
    #[must_use]
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// The pipeline of a kernel, for a backend and values of its specialization constants (in the order of
    /// [`KernelCode::spec_ids`]); compiled on first use.
    ///
    /// # Errors
    ///
    /// [`Error::Kernel`] where the kernel does not fit the device, the backend or `spec`;
    /// [`Error::NoRayQuery`]; or what the driver said.
    pub fn get(&self, code: &KernelCode, spec: &[u32], backend: Backend) -> Result<Arc<Pipeline>, Error> {
        let key = Key::new(code, spec, backend);
        let mut state = self.lock();
        if let Some(pipeline) = state.pipelines.get(&key) {
            return Ok(pipeline.clone());
        }
        let module = self.check(code, spec, backend)?;
        let layout = self.layout(&mut state, code, backend)?;
        drop(state);
        let pipeline = Arc::new(self.create(code, module, spec, layout)?);
        let mut state = self.lock();
        state.unsaved = true;
        Ok(state.pipelines.entry(key).or_insert(pipeline).clone())
    }

    /// Compiles those of `wanted` that are not there yet, side by side on the cores there are, until `stop` says so. What
    /// fails does so again where [`Self::get`] asks for it.
    pub(crate) fn compile(
        &self,
        wanted: &[(&KernelCode, &[u32])],
        backend: Backend,
        stop: &(dyn Fn() -> bool + Sync),
    ) {
        let state = self.lock();
        let mut seen = HashSet::new();
        let missing: Vec<_> = wanted
            .iter()
            .filter(|(code, spec)| {
                let key = Key::new(code, spec, backend);
                !state.pipelines.contains_key(&key) && seen.insert(key)
            })
            .collect();
        drop(state);
        let next = AtomicUsize::new(0);
        let work = || {
            while let Some(&&(code, spec)) = missing.get(next.fetch_add(1, Ordering::Relaxed))
                && !stop()
            {
                let _ = self.get(code, spec, backend);
            }
        };
        let threads = thread::available_parallelism().map_or(1, NonZero::get).min(missing.len());
        thread::scope(|scope| {
            for _ in 1..threads {
                // Without a thread this one does its work.
                let _ = thread::Builder::new().stack_size(COMPILER_STACK).spawn_scoped(scope, work);
            }
            work();
        });
    }

    /// The kernel's module, if this device can run it.
    fn check<'a>(&self, code: &'a KernelCode, spec: &[u32], backend: Backend) -> Result<&'a [u32], Error> {
        let no = |reason: String| Err(Error::Kernel { name: code.name.to_string(), reason });
        let Some(module) = code.module(backend) else {
            return no(format!("it was not compiled for the {backend:?} backend"));
        };
        if spec.len() != code.spec_ids.len() {
            let (have, want) = (spec.len(), code.spec_ids.len());
            return no(format!("{have} values for its {want} specialization constants"));
        }
        if code.params_size > MAX_PARAMS {
            return no(format!("{} bytes of push constants; {MAX_PARAMS} is the most", code.params_size));
        }
        let limit = self.device.0.limits.max_push_descriptors as usize;
        if code.bindings.len() > limit {
            return no(format!("{} bindings; this device's limit is {limit}", code.bindings.len()));
        }
        let invocations = code.workgroup.iter().product::<u32>();
        let limit = self.device.info().max_workgroup_invocations;
        if invocations > limit {
            return no(format!("{invocations} invocations a workgroup; this device's limit is {limit}"));
        }
        Ok(module)
    }

    fn layout(&self, state: &mut State, code: &KernelCode, backend: Backend) -> Result<Arc<Layout>, Error> {
        let key = LayoutKey {
            backend,
            bindings: code.bindings.iter().map(|b| (b.binding, b.descriptor_type())).collect(),
            params_size: code.params_size,
        };
        if let Some(layout) = state.layouts.get(&key) {
            return Ok(layout.clone());
        }
        let device = self.device.raw();
        let scene = self.device.scene_layout(backend)?;
        let bindings: Vec<_> = key
            .bindings
            .iter()
            .map(|&(number, ty)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(number)
                    .descriptor_type(ty)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default()
            .flags(vk::DescriptorSetLayoutCreateFlags::PUSH_DESCRIPTOR_KHR)
            .bindings(&bindings);
        // SAFETY: the extension is enabled and the number of bindings was checked.
        let set = unsafe { device.create_descriptor_set_layout(&info, None) }
            .map_err(Error::vulkan("vkCreateDescriptorSetLayout", &code.name))?;
        let mut layout = Layout { device: self.device.clone(), set, raw: vk::PipelineLayout::null() };
        self.device.set_name(set, &code.name);
        let sets = [scene, set];
        let ranges = [vk::PushConstantRange::default()
            .stage_flags(vk::ShaderStageFlags::COMPUTE)
            .size(code.params_size)];
        let info = vk::PipelineLayoutCreateInfo::default()
            .set_layouts(&sets)
            .push_constant_ranges(if code.params_size == 0 { &[] } else { &ranges });
        // SAFETY: both set layouts are alive.
        layout.raw = unsafe { device.create_pipeline_layout(&info, None) }
            .map_err(Error::vulkan("vkCreatePipelineLayout", &code.name))?;
        self.device.set_name(layout.raw, &code.name);
        let layout = Arc::new(layout);
        state.layouts.insert(key, layout.clone());
        Ok(layout)
    }

    fn create(
        &self,
        code: &KernelCode,
        module: &[u32],
        spec: &[u32],
        layout: Arc<Layout>,
    ) -> Result<Pipeline, Error> {
        let device = self.device.raw();
        let started = std::time::Instant::now();
        let info = vk::ShaderModuleCreateInfo::default().code(module);
        // SAFETY: kernels are compiled and validated when the program is built, or by `compile`.
        let module = unsafe { device.create_shader_module(&info, None) }
            .map_err(Error::vulkan("vkCreateShaderModule", &code.name))?;
        self.device.set_name(module, &code.name);
        let entries: Vec<_> = (0..)
            .zip(code.spec_ids.iter())
            .map(|(i, &id)| vk::SpecializationMapEntry::default().constant_id(id).offset(4 * i).size(4))
            .collect();
        let specialization =
            vk::SpecializationInfo::default().map_entries(&entries).data(bytemuck::cast_slice(spec));
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main")
            .specialization_info(&specialization);
        let info = vk::ComputePipelineCreateInfo::default()
            .flags(vk::PipelineCreateFlags::DISPATCH_BASE)
            .stage(stage)
            .layout(layout.raw);
        // SAFETY: module and layout are alive and agree, both coming from one reflected kernel.
        let result = unsafe { device.create_compute_pipelines(self.raw, &[info], None) };
        // SAFETY: a module is not needed once the pipeline is made.
        unsafe { device.destroy_shader_module(module, None) };
        let raw = result.map_err(|(_, e)| Error::vulkan("vkCreateComputePipelines", &code.name)(e))?[0];
        self.device.set_name(raw, &code.name);
        tracing::debug!("pipeline `{}` {spec:?}: {:.0?}", code.name, started.elapsed());
        Ok(Pipeline { raw, layout })
    }

    /// Writes the cache file, if anything was compiled since it was last written. Dropping does so too.
    pub fn save(&self) {
        let Some(file) = self.file.as_deref() else { return };
        let mut state = self.lock();
        if std::mem::take(&mut state.unsaved)
            && let Err(reason) = self.try_save(file)
        {
            tracing::warn!("pipeline cache {}: {reason}", file.display());
        }
    }

    fn try_save(&self, file: &Path) -> Result<(), String> {
        // SAFETY: the cache is alive.
        let data =
            unsafe { self.device.raw().get_pipeline_cache_data(self.raw) }.map_err(|e| e.to_string())?;
        cache::save(file, &data).map_err(|e| e.to_string())
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Pipelines {
    fn drop(&mut self) {
        self.save();
        // SAFETY: pipelines do not need the cache they were made through.
        unsafe { self.device.raw().destroy_pipeline_cache(self.raw, None) };
    }
}

impl Binding {
    pub(crate) fn descriptor_type(&self) -> vk::DescriptorType {
        match self.kind {
            BindingKind::Buffer { .. } => vk::DescriptorType::STORAGE_BUFFER,
            BindingKind::Image(_) => vk::DescriptorType::STORAGE_IMAGE,
        }
    }
}

fn identity(code: &KernelCode, backend: Backend) -> Code {
    let module = match (&code.modules, backend) {
        (Modules::Plain(words), _) => Some(words),
        (Modules::Tracing { software, .. }, Backend::Software) => software.as_ref(),
        (Modules::Tracing { ray_query, .. }, Backend::RayQuery) => ray_query.as_ref(),
    };
    match module {
        Some(Cow::Borrowed(words)) => Code::Static(words.as_ptr().addr(), words.len()),
        Some(Cow::Owned(words)) => {
            let mut hasher = DefaultHasher::new();
            words.hash(&mut hasher);
            Code::Hash(hasher.finish())
        }
        None => Code::Hash(0),
    }
}

/// Set 0, filled: what every kernel of a frame knows of the scene.
///
/// It owns its uniform buffer. The acceleration structures it names, and what the uniform buffer leads to by address,
/// must outlive its use: [`SceneSet::keep`].
pub struct SceneSet {
    device: Device,
    pool: vk::DescriptorPool,
    raw: vk::DescriptorSet,
    backend: Backend,
    uniform: Buffer,
    kept: Vec<Arc<dyn Any + Send + Sync>>,
}

impl fmt::Debug for SceneSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SceneSet").field("backend", &self.backend).field("uniform", &self.uniform).finish()
    }
}

impl SceneSet {
    /// The backend whose kernels it fits.
    #[must_use]
    pub fn backend(&self) -> Backend {
        self.backend
    }

    pub(crate) fn raw(&self) -> vk::DescriptorSet {
        self.raw
    }

    /// The bytes of the uniform buffer, if it is an [upload](super::MemoryKind::Upload) buffer, to be written and never
    /// read. Whoever has the set to himself has no run in flight that reads them.
    pub fn uniform_mut(&mut self) -> Option<&mut [u8]> {
        self.uniform.mapped_mut()
    }

    /// Keeps something alive for as long as the set.
    pub fn keep(&mut self, what: Arc<dyn Any + Send + Sync>) {
        self.kept.push(what);
    }

    /// Puts the structure over triangles' boxes at binding 2, for [`Backend::RayQuery`].
    pub fn set_boxes(&mut self, structure: &AccelerationStructure) {
        if self.backend == Backend::RayQuery {
            self.set_structures(&[2], structure);
        }
    }

    fn set_structures(&mut self, bindings: &[u32], structure: &AccelerationStructure) {
        for &binding in bindings {
            let raw = [structure.raw()];
            let mut info =
                vk::WriteDescriptorSetAccelerationStructureKHR::default().acceleration_structures(&raw);
            let write = vk::WriteDescriptorSet::default()
                .dst_set(self.raw)
                .dst_binding(binding)
                .descriptor_type(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR)
                .descriptor_count(1)
                .push_next(&mut info);
            // SAFETY: by the rule of the module the set is not in use, and its layout has the binding.
            unsafe { self.device.raw().update_descriptor_sets(&[write], &[]) };
        }
    }
}

impl Drop for SceneSet {
    fn drop(&mut self) {
        // SAFETY: by the rule of the module, nothing in flight uses it.
        unsafe { self.device.raw().destroy_descriptor_pool(self.pool, None) };
    }
}

impl Device {
    /// Set 0 for a backend: `uniform` at binding 0 and, for [`Backend::RayQuery`], `structure` at binding 1, and at
    /// binding 2 until [`SceneSet::set_boxes`] puts another there. Without it, kernels that trace rays must not run.
    ///
    /// # Errors
    ///
    /// [`Error::TooLarge`] where a uniform buffer cannot have that many bytes, [`Error::NoRayQuery`], or what
    /// the driver said.
    pub fn scene_set(
        &self,
        backend: Backend,
        uniform: Buffer,
        structure: Option<&AccelerationStructure>,
    ) -> Result<SceneSet, Error> {
        let limit = u64::from(self.0.limits.properties.max_uniform_buffer_range);
        if uniform.size() > limit {
            let what = format!("bytes of uniform buffer `{}`", uniform.name());
            return Err(Error::TooLarge { what, value: uniform.size(), limit });
        }
        let layouts = [self.scene_layout(backend)?];
        let size = |ty| vk::DescriptorPoolSize::default().ty(ty).descriptor_count(1);
        let mut sizes = vec![size(vk::DescriptorType::UNIFORM_BUFFER)];
        if backend == Backend::RayQuery {
            sizes.push(size(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR).descriptor_count(2));
        }
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        // SAFETY: acceleration structures are only named where their extension is enabled.
        let pool = unsafe { self.raw().create_descriptor_pool(&info, None) }
            .map_err(Error::vulkan("vkCreateDescriptorPool", "scene"))?;
        let mut set = SceneSet {
            device: self.clone(),
            pool,
            raw: vk::DescriptorSet::null(),
            backend,
            uniform,
            kept: Vec::new(),
        };
        self.set_name(pool, "scene");
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&layouts);
        // SAFETY: the pool has room for exactly this set.
        set.raw = unsafe { self.raw().allocate_descriptor_sets(&info) }
            .map_err(Error::vulkan("vkAllocateDescriptorSets", "scene"))?[0];
        self.set_name(set.raw, "scene");

        let buffers = [set.uniform.descriptor()];
        let write = vk::WriteDescriptorSet::default()
            .dst_set(set.raw)
            .dst_binding(0)
            .descriptor_type(vk::DescriptorType::UNIFORM_BUFFER)
            .buffer_info(&buffers);
        // SAFETY: the set is not in use, and the write fits its layout.
        unsafe { self.raw().update_descriptor_sets(&[write], &[]) };
        if backend == Backend::RayQuery
            && let Some(structure) = structure
        {
            set.set_structures(&[1, 2], structure);
        }
        Ok(set)
    }
}
