//! One compute shader on its own: bind by name, dispatch, read back.
//!
//! ```no_run
//! use bevy_bounce_tests::{compose::compose, gpu::{Resources, gpu}};
//!
//! let gpu = gpu();
//! let kernel = gpu.kernel(&compose("avg/scan.wgsl", &[])?, "scan")?;
//! let buffers = Resources::new(gpu).words("counts", &[3, 0, 2]);
//! gpu.dispatch(&kernel, &buffers, [1, 1, 1])?;
//! assert_eq!(buffers.read_words("counts")?, [0, 3, 3]);
//! # Ok::<(), String>(())
//! ```

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use bevy::render::render_resource::encase::internal::{CreateFrom, WriteInto};
use bevy::render::render_resource::encase::{StorageBuffer, UniformBuffer};
use bevy::render::render_resource::{ShaderSize, ShaderType};
use bevy::tasks::block_on;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

use crate::compose::{Composed, plain_name};

/// What to do on a machine without an adapter.
pub const NO_ADAPTER: &str = "no GPU adapter: install Mesa's software driver, e.g. `sudo apt-get install mesa-vulkan-drivers`, \
     or run `cargo xtask test`, which does";

/// A device without a window.
#[derive(Clone, Debug)]
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    kernels: Arc<Mutex<BTreeMap<String, Arc<Kernel>>>>,
    /// Error scopes belong to the device, whichever thread opens them: one at a time.
    scope: Arc<Mutex<()>>,
    /// Name of the adapter.
    pub adapter: String,
}

/// The device of this test binary. Fails with the remedy where there is no adapter.
///
/// It has no optional feature; its limits are the adapter's, or WebGPU's defaults with `BOUNCE_WEBGPU_LIMITS=1`.
pub fn gpu() -> &'static Gpu {
    static GPU: LazyLock<Result<Gpu, String>> = LazyLock::new(|| block_on(Gpu::open()));
    match &*GPU {
        Ok(gpu) => gpu,
        Err(error) => panic!("{error}"),
    }
}

/// Whether devices are to have WebGPU's default limits and no optional feature.
pub fn webgpu_limits() -> bool {
    std::env::var_os("BOUNCE_WEBGPU_LIMITS").is_some_and(|value| value == "1")
}

impl Gpu {
    async fn open() -> Result<Self, String> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY);
        let instance = wgpu::Instance::new(descriptor);
        let adapter = wgpu::util::initialize_adapter_from_env_or_default(&instance, None)
            .await
            .map_err(|error| format!("{NO_ADAPTER} ({error})"))?;
        let required_limits = if webgpu_limits() { wgpu::Limits::default() } else { adapter.limits() };
        let (device, queue) = adapter
            .request_device(&wgpu::DeviceDescriptor { required_limits, ..Default::default() })
            .await
            .map_err(|error| format!("{}: {error}", adapter.get_info().name))?;
        Ok(Self { device, queue, kernels: Arc::default(), scope: Arc::default(), adapter: adapter.get_info().name })
    }

    /// The kernel of that name, made on first use.
    pub fn cached(&self, name: &str, make: impl FnOnce() -> Result<Kernel, String>) -> Result<Arc<Kernel>, String> {
        let mut kernels = self.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kernel) = kernels.get(name) {
            return Ok(kernel.clone());
        }
        let kernel = Arc::new(make()?);
        kernels.insert(name.to_owned(), kernel.clone());
        Ok(kernel)
    }

    /// Makes a pipeline of one entry point.
    pub fn kernel(&self, composed: &Composed, entry: &str) -> Result<Kernel, String> {
        let entries = &composed.module.entry_points;
        let index = entries.iter().position(|point| point.name == entry);
        let used = composed.info.get_entry_point(index.ok_or_else(|| format!("no entry point {entry}"))?);
        let bindings = composed.module.global_variables.iter().filter_map(|(handle, variable)| {
            let binding = variable.binding.filter(|_| !used[handle].is_empty())?;
            Some((binding.group, binding.binding, plain_name(variable.name.as_deref()?).to_owned()))
        });
        let bindings = bindings.collect();
        let source = wgpu::ShaderSource::Naga(Cow::Owned(composed.module.clone()));
        let pipeline = self.checked(|| {
            let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(entry), source });
            self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            })
        })?;
        Ok(Kernel { name: entry.to_owned(), pipeline, bindings })
    }

    /// Runs a kernel on the resources that have the names of its bindings.
    pub fn dispatch(&self, kernel: &Kernel, resources: &Resources, workgroups: [u32; 3]) -> Result<(), String> {
        self.pass(kernel, resources, |pass| pass.dispatch_workgroups(workgroups[0], workgroups[1], workgroups[2]))
    }

    /// Runs a kernel with the workgroup counts at that byte of a buffer.
    pub fn dispatch_indirect(
        &self,
        kernel: &Kernel,
        resources: &Resources,
        arguments: &str,
        offset: u64,
    ) -> Result<(), String> {
        let buffer = resources.buffer(arguments)?;
        self.pass(kernel, resources, |pass| pass.dispatch_workgroups_indirect(buffer, offset))
    }

    fn pass(
        &self,
        kernel: &Kernel,
        resources: &Resources,
        dispatch: impl FnOnce(&mut wgpu::ComputePass),
    ) -> Result<(), String> {
        let mut groups = BTreeMap::<u32, Vec<wgpu::BindGroupEntry>>::new();
        for (group, binding, name) in &kernel.bindings {
            let resource = resources.get(name).map_err(|error| format!("{}: {error}", kernel.name))?.binding();
            groups.entry(*group).or_default().push(wgpu::BindGroupEntry { binding: *binding, resource });
        }
        self.checked(|| {
            let mut encoder = self.device.create_command_encoder(&Default::default());
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&kernel.pipeline);
            for (group, entries) in &groups {
                let layout = kernel.pipeline.get_bind_group_layout(*group);
                let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries };
                pass.set_bind_group(*group, &self.device.create_bind_group(&descriptor), &[]);
            }
            dispatch(&mut pass);
            drop(pass);
            self.queue.submit([encoder.finish()]);
        })
    }

    /// Turns validation errors and lack of memory into a `Result`.
    fn checked<T>(&self, work: impl FnOnce() -> T) -> Result<T, String> {
        let _alone = self.scope.lock().unwrap_or_else(PoisonError::into_inner);
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let result = work();
        let errors = [block_on(validation.pop()), block_on(memory.pop())];
        match errors.into_iter().flatten().next() {
            Some(error) => Err(error.to_string()),
            None => Ok(result),
        }
    }

    fn read_bytes(
        &self,
        size: u64,
        copy: impl FnOnce(&mut wgpu::CommandEncoder, &wgpu::Buffer),
    ) -> Result<Vec<u8>, String> {
        self.checked(|| {
            let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            let mut encoder = self.device.create_command_encoder(&Default::default());
            copy(&mut encoder, &staging);
            self.queue.submit([encoder.finish()]);
            let slice = staging.slice(..);
            let (sender, receiver) = std::sync::mpsc::channel();
            slice.map_async(wgpu::MapMode::Read, move |result| drop(sender.send(result)));
            self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| error.to_string())?;
            receiver.recv().map_err(|error| error.to_string())?.map_err(|error| error.to_string())?;
            Ok(slice.get_mapped_range().to_vec())
        })?
    }
}

/// A compute pipeline.
#[derive(Debug)]
pub struct Kernel {
    name: String,
    pipeline: wgpu::ComputePipeline,
    /// Group, binding and plain name of what the entry point uses.
    bindings: Vec<(u32, u32, String)>,
}

/// Buffers and textures by the names that WGSL gives them; several kernels may share them.
#[derive(Clone, Debug)]
pub struct Resources {
    gpu: Gpu,
    by_name: BTreeMap<String, Resource>,
}

#[derive(Clone, Debug)]
enum Resource {
    Buffer(wgpu::Buffer),
    Texture(wgpu::Texture, wgpu::TextureView),
    Sampler(wgpu::Sampler),
}

impl Resource {
    fn binding(&self) -> wgpu::BindingResource<'_> {
        match self {
            Resource::Buffer(buffer) => buffer.as_entire_binding(),
            Resource::Texture(_, view) => wgpu::BindingResource::TextureView(view),
            Resource::Sampler(sampler) => wgpu::BindingResource::Sampler(sampler),
        }
    }
}

impl Resources {
    /// None yet.
    pub fn new(gpu: &Gpu) -> Self {
        Self { gpu: gpu.clone(), by_name: BTreeMap::new() }
    }

    /// Adds a uniform buffer; a buffer of that name is replaced, as by all that follow.
    pub fn uniform<T: ShaderType + WriteInto>(self, name: &str, value: &T) -> Self {
        let mut bytes = UniformBuffer::new(Vec::new());
        bytes.write(value).unwrap_or_else(|error| panic!("{name}: {error}"));
        self.bytes(name, bytes.as_ref())
    }

    /// Adds a storage buffer that is an array of structs.
    pub fn structs<T: ShaderSize + WriteInto + Clone>(self, name: &str, values: &[T]) -> Self {
        let mut bytes = StorageBuffer::new(Vec::new());
        bytes.write(&values.to_vec()).unwrap_or_else(|error| panic!("{name}: {error}"));
        self.bytes(name, bytes.as_ref())
    }

    /// Adds a buffer of words.
    pub fn words(self, name: &str, words: &[u32]) -> Self {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.bytes(name, &bytes)
    }

    /// Adds a buffer of floats.
    pub fn floats(self, name: &str, floats: &[f32]) -> Self {
        let words: Vec<u32> = floats.iter().map(|float| float.to_bits()).collect();
        self.words(name, &words)
    }

    /// Adds a buffer of that many zero words.
    pub fn zeroed(self, name: &str, words: usize) -> Self {
        self.words(name, &vec![0; words])
    }

    /// Adds a buffer, for storage, uniform or indirect use.
    pub fn bytes(mut self, name: &str, bytes: &[u8]) -> Self {
        let mut padded = bytes.to_vec();
        padded.resize(if bytes.is_empty() { 16 } else { bytes.len().next_multiple_of(4) }, 0);
        let buffer = self.gpu.device.create_buffer_init(&BufferInitDescriptor {
            label: Some(name),
            contents: &padded,
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::UNIFORM
                | wgpu::BufferUsages::INDIRECT
                | wgpu::BufferUsages::COPY_SRC,
        });
        self.by_name.insert(name.to_owned(), Resource::Buffer(buffer));
        self
    }

    /// Adds a texture with one mip; 2D where the depth is 1 and `volume` false. Zero where `bytes` is empty.
    pub fn texture(
        mut self,
        name: &str,
        format: wgpu::TextureFormat,
        size: [u32; 3],
        volume: bool,
        bytes: &[u8],
    ) -> Self {
        let size = wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: size[2] };
        let allowed = format.guaranteed_format_features(wgpu::Features::empty()).allowed_usages;
        let descriptor = wgpu::TextureDescriptor {
            label: Some(name),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: if volume { wgpu::TextureDimension::D3 } else { wgpu::TextureDimension::D2 },
            format,
            usage: allowed
                & (wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::STORAGE_BINDING
                    | wgpu::TextureUsages::COPY_SRC
                    | wgpu::TextureUsages::COPY_DST),
            view_formats: &[],
        };
        let texture = self.gpu.device.create_texture(&descriptor);
        if !bytes.is_empty() {
            let row = format.block_copy_size(None).unwrap_or(0) * size.width;
            let layout =
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: Some(size.height) };
            self.gpu.queue.write_texture(texture.as_image_copy(), bytes, layout, size);
        }
        let view = texture.create_view(&Default::default());
        self.by_name.insert(name.to_owned(), Resource::Texture(texture, view));
        self
    }

    /// Adds a cube map with one mip; faces in the order +x, -x, +y, -y, +z, -z.
    pub fn cube(mut self, name: &str, format: wgpu::TextureFormat, edge: u32, bytes: &[u8]) -> Self {
        self = self.texture(name, format, [edge, edge, 6], false, bytes);
        if let Some(Resource::Texture(texture, view)) = self.by_name.get_mut(name) {
            let dimension = Some(wgpu::TextureViewDimension::Cube);
            *view = texture.create_view(&wgpu::TextureViewDescriptor { dimension, ..Default::default() });
        }
        self
    }

    /// Adds a 2D texture of zeros, and each of its mip levels under a name of its own.
    pub fn mips(self, name: &str, format: wgpu::TextureFormat, size: [u32; 2], levels: &[&str]) -> Self {
        self.mips_of(name, format, [size[0], size[1], 1], wgpu::TextureDimension::D2, levels)
    }

    /// The same of a 3D texture.
    pub fn volume_mips(self, name: &str, format: wgpu::TextureFormat, size: [u32; 3], levels: &[&str]) -> Self {
        self.mips_of(name, format, size, wgpu::TextureDimension::D3, levels)
    }

    fn mips_of(
        mut self,
        name: &str,
        format: wgpu::TextureFormat,
        size: [u32; 3],
        dimension: wgpu::TextureDimension,
        levels: &[&str],
    ) -> Self {
        let texture = self.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(name),
            size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: size[2] },
            mip_level_count: levels.len() as u32,
            sample_count: 1,
            dimension,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::STORAGE_BINDING,
            view_formats: &[],
        });
        for (level, alias) in (0..).zip(levels) {
            let view = texture.create_view(&wgpu::TextureViewDescriptor {
                base_mip_level: level,
                mip_level_count: Some(1),
                ..Default::default()
            });
            self.by_name.insert((*alias).to_owned(), Resource::Texture(texture.clone(), view));
        }
        let view = texture.create_view(&Default::default());
        self.by_name.insert(name.to_owned(), Resource::Texture(texture, view));
        self
    }

    /// Gives what has that name another one as well.
    pub fn alias(mut self, name: &str, alias: &str) -> Self {
        let resource = self.by_name.get(name).unwrap_or_else(|| panic!("no resource {name}")).clone();
        self.by_name.insert(alias.to_owned(), resource);
        self
    }

    /// Adds a sampler that clamps at the edge.
    pub fn sampler(mut self, name: &str, filter: wgpu::FilterMode) -> Self {
        let sampler = self.gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: filter,
            min_filter: filter,
            mipmap_filter: match filter {
                wgpu::FilterMode::Linear => wgpu::MipmapFilterMode::Linear,
                wgpu::FilterMode::Nearest => wgpu::MipmapFilterMode::Nearest,
            },
            ..Default::default()
        });
        self.by_name.insert(name.to_owned(), Resource::Sampler(sampler));
        self
    }

    /// The words of a buffer now.
    pub fn read_words(&self, name: &str) -> Result<Vec<u32>, String> {
        let bytes = self.read_buffer(name)?;
        Ok(bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect())
    }

    /// The floats of a buffer now.
    pub fn read_floats(&self, name: &str) -> Result<Vec<f32>, String> {
        Ok(self.read_words(name)?.into_iter().map(f32::from_bits).collect())
    }

    /// The structs of a buffer now.
    pub fn read_structs<T: ShaderSize + CreateFrom>(&self, name: &str) -> Result<Vec<T>, String> {
        let bytes = self.read_buffer(name)?;
        let whole = bytes.len() / T::SHADER_SIZE.get() as usize * T::SHADER_SIZE.get() as usize;
        StorageBuffer::new(&bytes[..whole]).create().map_err(|error| format!("{name}: {error}"))
    }

    /// The texels of a texture now, without padding between rows.
    pub fn read_texture(&self, name: &str) -> Result<Vec<u8>, String> {
        let Resource::Texture(texture, _) = self.get(name)? else { return Err(format!("{name} is not a texture")) };
        let size = texture.size();
        let row = texture.format().block_copy_size(None).unwrap_or(0) * size.width;
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let rows = u64::from(size.height) * u64::from(size.depth_or_array_layers);
        let bytes = self.gpu.read_bytes(u64::from(padded) * rows, |encoder, buffer| {
            let layout = wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded),
                rows_per_image: Some(size.height),
            };
            encoder.copy_texture_to_buffer(texture.as_image_copy(), wgpu::TexelCopyBufferInfo { buffer, layout }, size);
        })?;
        Ok(bytes.chunks(padded as usize).flat_map(|line| &line[..row as usize]).copied().collect())
    }

    fn read_buffer(&self, name: &str) -> Result<Vec<u8>, String> {
        let source = self.buffer(name)?;
        let size = source.size();
        self.gpu.read_bytes(size, |encoder, staging| encoder.copy_buffer_to_buffer(source, 0, staging, 0, size))
    }

    fn buffer(&self, name: &str) -> Result<&wgpu::Buffer, String> {
        match self.get(name)? {
            Resource::Buffer(buffer) => Ok(buffer),
            _ => Err(format!("{name} is not a buffer")),
        }
    }

    fn get(&self, name: &str) -> Result<&Resource, String> {
        self.by_name.get(name).ok_or_else(|| format!("no resource {name}"))
    }
}
