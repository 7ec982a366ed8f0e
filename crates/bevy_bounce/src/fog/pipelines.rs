//! Pipelines of the fog and their bindings.

use bevy::core_pipeline::FullscreenShader;
use bevy::material::descriptor::PipelineDescriptor;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    sampler, storage_buffer_read_only_sized, texture_2d, texture_2d_multisampled, texture_3d, texture_storage_3d,
    uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::{
    AddressMode, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BlendComponent, BlendFactor, BlendOperation,
    BlendState, CachedPipelineState, ColorTargetState, ColorWrites, FilterMode, FragmentState, PipelineCache,
    RenderPipelineDescriptor, Sampler, SamplerBindingType, SamplerDescriptor, ShaderStages, SpecializedRenderPipeline,
    StorageTextureAccess, TextureFormat, TextureSampleType,
};
use bevy::render::renderer::RenderDevice;
use bevy::render::view::ViewUniform;
use bevy::shader::Shader;
use bevy_bounce_shaders::types::{FogParameters, FroxelParameters};

use crate::VplVisibility;
use crate::compute::{GiShaders, Kernel, KernelDescriptor};
use crate::shadow_atlas::{visibility_def, visibility_layouts};

/// Light that fog scatters, pre-exposed.
pub(super) const LIGHT_FORMAT: TextureFormat = TextureFormat::Rgba16Float;

/// Bevy's own fog, by the label of its pipelines: nothing else of it is public.
const BEVYS_FOG: &str = "volumetric lighting pipeline";

/// Alpha of the target stays.
const KEPT: BlendComponent =
    BlendComponent { src_factor: BlendFactor::Zero, dst_factor: BlendFactor::One, operation: BlendOperation::Add };

/// Light before what is there already, as Bevy draws its fog; and what is taken of what is behind all volumes.
const OVER: BlendState =
    BlendState { color: BlendComponent { dst_factor: BlendFactor::OneMinusSrcAlpha, ..SUM }, alpha: KEPT };

const SUM: BlendComponent =
    BlendComponent { src_factor: BlendFactor::One, dst_factor: BlendFactor::One, operation: BlendOperation::Add };

/// A pass of a view.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub(super) enum Pass {
    /// A volume's light into the texture of the view.
    Scatter {
        /// Whether the depth has several samples.
        multisampled: bool,
    },
    /// That texture onto the picture.
    Add {
        /// Of the picture.
        format: TextureFormat,
    },
}

/// Layouts and shaders of the passes.
#[derive(Resource)]
pub(super) struct FogPipelines {
    scatter_layouts: [BindGroupLayoutDescriptor; 2],
    /// Group 0 of [`Pass::Add`].
    pub add_layout: BindGroupLayoutDescriptor,
    /// Between froxels.
    pub linear: Sampler,
    fullscreen: FullscreenShader,
    scatter_shader: Handle<Shader>,
    add_shader: Handle<Shader>,
}

impl FogPipelines {
    /// Group 0 of [`Pass::Scatter`].
    pub fn scatter_layout(&self, multisampled: bool) -> &BindGroupLayoutDescriptor {
        &self.scatter_layouts[usize::from(multisampled)]
    }
}

pub(super) fn init_pipelines(
    mut commands: Commands,
    shaders: Res<GiShaders>,
    fullscreen: Res<FullscreenShader>,
    device: Res<RenderDevice>,
) {
    commands.insert_resource(FroxelKernels::default());
    let volume = texture_3d(TextureSampleType::Float { filterable: true });
    // Depth read as a float: naga has no GLSL for loads from a depth texture.
    let depth = TextureSampleType::Float { filterable: false };
    let scatter = |name, depth| {
        let entries = BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (
                uniform_buffer::<ViewUniform>(false),
                uniform_buffer::<FogParameters>(true),
                depth,
                uniform_buffer::<FroxelParameters>(false),
                volume,
                sampler(SamplerBindingType::Filtering),
                volume,
                sampler(SamplerBindingType::Filtering),
            ),
        );
        BindGroupLayoutDescriptor::new(name, &entries)
    };
    commands.insert_resource(FogPipelines {
        scatter_layouts: [
            scatter("bounce_fog_layout", texture_2d(depth)),
            scatter("bounce_fog_multisampled_layout", texture_2d_multisampled(depth)),
        ],
        add_layout: BindGroupLayoutDescriptor::new(
            "bounce_fog_add_layout",
            &BindGroupLayoutEntries::single(
                ShaderStages::FRAGMENT,
                texture_2d(TextureSampleType::Float { filterable: false }),
            ),
        ),
        linear: device.create_sampler(&SamplerDescriptor {
            label: Some("bounce_fog_froxels"),
            address_mode_u: AddressMode::ClampToEdge,
            address_mode_v: AddressMode::ClampToEdge,
            address_mode_w: AddressMode::ClampToEdge,
            mag_filter: FilterMode::Linear,
            min_filter: FilterMode::Linear,
            ..default()
        }),
        fullscreen: fullscreen.clone(),
        scatter_shader: shaders.get("fog/scatter.wgsl"),
        add_shader: shaders.get("fog/add.wgsl"),
    });
}

/// What lights froxels is specialised for.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub(super) struct FroxelKey {
    /// What virtual lights see by.
    pub visibility: VplVisibility,
    /// Light straight from the sky, too.
    pub sky: bool,
    /// Whether the depth has several samples.
    pub multisampled: bool,
}

impl FroxelKey {
    pub fn new(visibility: VplVisibility, sky: bool, multisampled: bool) -> Self {
        Self { visibility, sky, multisampled }.seeing(visibility)
    }

    /// The same by another visibility; all maps are looked up alike.
    pub fn seeing(self, visibility: VplVisibility) -> Self {
        let visibility = match visibility {
            VplVisibility::Ism | VplVisibility::Baked => VplVisibility::Atlas,
            other => other,
        };
        Self { visibility, ..self }
    }

    fn kernel(self, shaders: &GiShaders) -> Kernel {
        let uniform = uniform_buffer_sized(false, None);
        let read = storage_buffer_read_only_sized(false, None);
        let output = texture_storage_3d(LIGHT_FORMAT, StorageTextureAccess::WriteOnly);
        let depth = TextureSampleType::Float { filterable: false };
        let depth = if self.multisampled { texture_2d_multisampled(depth) } else { texture_2d(depth) };
        let sky = self.sky.then(|| "SKY".into());
        let multisampled = self.multisampled.then(|| "MULTISAMPLED".into());
        let defs = [visibility_def(self.visibility), sky, multisampled];
        let kernel = KernelDescriptor {
            path: "fog/froxels.wgsl",
            entry: "light_froxels",
            // View, froxels; header, list; light; grid, densities; depth.
            bindings: &[uniform, uniform, read, read, output, uniform, read, depth],
            groups: &visibility_layouts(self.visibility, self.sky),
            defs: defs.into_iter().flatten().collect(),
        };
        Kernel::new(shaders, kernel)
    }
}

/// What lights froxels, made when it is first asked for.
#[derive(Resource, Default)]
pub(super) struct FroxelKernels(HashMap<FroxelKey, Kernel>);

impl FroxelKernels {
    /// Whether that of a key is compiled; makes it where there is none.
    pub fn is_ready(&mut self, key: FroxelKey, cache: &PipelineCache, shaders: &GiShaders) -> bool {
        self.0.entry(key).or_insert_with(|| key.kernel(shaders)).is_ready(cache)
    }

    /// That of a key.
    pub fn get(&self, key: FroxelKey) -> Option<&Kernel> {
        self.0.get(&key)
    }
}

impl SpecializedRenderPipeline for FogPipelines {
    type Key = Pass;

    fn specialize(&self, pass: Pass) -> RenderPipelineDescriptor {
        let (label, entry, shader, layout, format, blend) = match pass {
            Pass::Scatter { multisampled } => {
                let layout = self.scatter_layout(multisampled);
                ("bounce_fog", "scatter", &self.scatter_shader, layout, LIGHT_FORMAT, OVER)
            }
            Pass::Add { format } => {
                let blend = BlendState { color: SUM, alpha: KEPT };
                ("bounce_fog_add", "add", &self.add_shader, &self.add_layout, format, blend)
            }
        };
        let is_multisampled = pass == Pass::Scatter { multisampled: true };
        RenderPipelineDescriptor {
            label: Some(label.into()),
            layout: vec![layout.clone()],
            vertex: self.fullscreen.to_vertex_state(),
            fragment: Some(FragmentState {
                shader: shader.clone(),
                shader_defs: is_multisampled.then(|| "MULTISAMPLED".into()).into_iter().collect(),
                entry_point: Some(entry.into()),
                targets: vec![Some(ColorTargetState { format, blend: Some(blend), write_mask: ColorWrites::ALL })],
            }),
            ..default()
        }
    }
}

/// Whether Bevy draws its fog: what is added to it must not come before it.
pub(super) fn bevys_fog_is_drawn(cache: &PipelineCache) -> bool {
    let mut theirs = cache.pipelines().filter(|pipeline| match &pipeline.descriptor {
        PipelineDescriptor::RenderPipelineDescriptor(descriptor) => descriptor.label.as_deref() == Some(BEVYS_FOG),
        PipelineDescriptor::ComputePipelineDescriptor(_) => false,
    });
    let is_ready = |state: &CachedPipelineState| matches!(state, CachedPipelineState::Ok(_));
    theirs.next().is_some_and(|first| is_ready(&first.state)) && theirs.all(|other| is_ready(&other.state))
}
