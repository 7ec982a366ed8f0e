//! Pipelines of the passes, specialised for a view as Bevy specialises its deferred lighting.

use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::deferred::DEFERRED_LIGHTING_PASS_ID_DEPTH_FORMAT;
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::ecs::system::SystemParam;
use bevy::pbr::deferred::{DeferredLightingPipeline, PbrDeferredLightingDepthId, SkipDeferredLighting};
use bevy::pbr::{MeshPipeline, MeshPipelineKey, MeshPipelineViewLayout, MeshPipelineViewLayoutKey, ViewKeyCache};
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{texture_2d, texture_2d_array, texture_storage_2d, uniform_buffer};
use bevy::render::render_resource::{
    BindGroupLayoutDescriptor, BindGroupLayoutEntries, CachedPipelineState, CachedRenderPipelineId, ColorTargetState,
    ColorWrites, CompareFunction, DepthBiasState, DepthStencilState, FragmentState, PipelineCache,
    RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, SpecializedRenderPipelines, StencilState,
    StorageTextureAccess, TextureFormat, TextureSampleType, VertexState,
};
use bevy::render::renderer::RenderDevice;
use bevy::render::view::{ExtractedView, ViewUniform};
use bevy::shader::{Shader, ShaderDefVal};
use bevy_bounce_shaders::types::Sky;

use super::light_kinds::{KnownLights, LightKinds};
use super::reflections::{ReflectionBindings, TAKE};
use crate::compute::{GiShaders, Kernel, KernelDescriptor, has_failed};
use crate::scene::{SceneBuffers, SkyBuffers};
use crate::view::GiView;
use crate::{GiIsolate, Technique};

/// Bindings of Bevy's view layout that are there only with the Cargo feature of that name; Bevy tells it no other way.
const PCSS_BINDING: u32 = 4;
const DFG_LUT_BINDING: u32 = 37;

/// Layouts and shaders of the passes.
#[derive(Resource)]
pub(super) struct ComposePipelines {
    /// Packs the G-buffer.
    pub surface: Kernel,
    /// Group 2 of the direct pass.
    pub direct_layout: BindGroupLayoutDescriptor,
    /// The same under a sky of ambient light.
    pub ambient_layout: BindGroupLayoutDescriptor,
    /// Group 2 of the composing passes.
    pub compose_layout: BindGroupLayoutDescriptor,
    mesh_pipeline: MeshPipeline,
    fullscreen: FullscreenShader,
    direct_shader: Handle<Shader>,
    compose_shader: Handle<Shader>,
    reflections_shader: Handle<Shader>,
    reflections_layout: BindGroupLayoutDescriptor,
}

/// What becomes of Bevy's light by environment maps in a view.
#[derive(Component, Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub(crate) enum EnvironmentMaps {
    /// It stays.
    Kept,
    /// The diffuse part goes, for the sky bounces; what is mirrored stays, and is shadowed.
    Shadowed,
    /// It goes: caches have both.
    Replaced,
    /// As shadowed, of reflection probes; ambient light is the sky, and what is mirrored of that is there, and is shadowed.
    Ambient,
}

impl EnvironmentMaps {
    /// Of a technique where the sky bounces.
    fn under(technique: Technique) -> Self {
        match technique {
            Technique::InstantRadiosity => Self::Shadowed,
            Technique::RadianceCache => Self::Replaced,
            Technique::None | Technique::SurfaceRadiosity => Self::Kept,
        }
    }

    /// Whether what is mirrored of the sky has a target of its own.
    pub fn are_shadowed(self) -> bool {
        matches!(self, Self::Shadowed | Self::Ambient)
    }
}

/// What is known of the sky.
#[derive(SystemParam)]
pub(super) struct KnownSky<'w> {
    scene: Option<Res<'w, SceneBuffers>>,
    sky: Option<Res<'w, SkyBuffers>>,
}

impl KnownSky<'_> {
    /// Whether it bounces in that view.
    fn bounces(&self, gi: &GiView) -> bool {
        gi.settings.sky > 0 && self.scene.as_ref().is_some_and(|scene| scene.sky_count() > 0)
    }

    /// Whether it is ambient light, of which that view's surfaces mirror.
    fn is_mirrored_ambient(&self, gi: &GiView) -> bool {
        let is_ambient = self.sky.as_ref().is_some_and(|sky| sky.is_ambient());
        is_ambient && gi.technique == Technique::InstantRadiosity && self.bounces(gi)
    }
}

/// A fragment pass over the view.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub(super) enum Pass {
    /// Direct light.
    Direct {
        /// What becomes of Bevy's light by environment maps.
        environment_maps: EnvironmentMaps,
        /// Under a shadowed sky: glossy bounced light is added to it.
        glossy: bool,
        /// Of which lights.
        lights: LightKinds,
    },
    /// What screen-space reflections show is taken from so many targets.
    Reflections {
        /// Glossy light, the mirrored sky, or both.
        targets: usize,
    },
    /// Into the picture, with bounced light or without.
    Compose {
        /// With bounced light.
        indirect: bool,
        /// Glossy bounced light, too.
        glossy: bool,
        /// With that of clearcoats.
        coat: bool,
        /// With a shadowed sky.
        sky: bool,
    },
    /// Something alone over the finished picture.
    Isolate {
        /// With glossy bounced light.
        glossy: bool,
        /// With that of clearcoats.
        coat: bool,
        /// With a shadowed sky.
        sky: bool,
        /// Entry point of `compose/compose.wgsl`.
        entry: &'static str,
    },
}

impl Pass {
    /// Definitions of its own.
    fn shader_defs(self) -> impl Iterator<Item = &'static str> {
        let defs = match self {
            Self::Direct { environment_maps, glossy, lights } => vec![
                ("COMPOSE_GLOSSY", glossy),
                ("SKY", environment_maps.are_shadowed()),
                ("AMBIENT", environment_maps == EnvironmentMaps::Ambient),
                ("POINT_LIGHTS", lights.point),
                ("SPOT_LIGHTS", lights.spot),
                ("DIRECTIONAL_LIGHTS", lights.directional),
                ("RECT_LIGHTS", lights.rect),
            ],
            Self::Reflections { targets } => {
                vec![("SECOND_TARGET", targets > 1), ("USE_DEPTH_SAMPLERS", cfg!(not(target_arch = "wasm32")))]
            }
            Self::Compose { indirect, glossy, coat, sky } => vec![
                ("COMPOSE_INDIRECT", indirect),
                ("COMPOSE_GLOSSY", glossy),
                ("COMPOSE_COAT", coat),
                ("COMPOSE_SKY", sky),
            ],
            Self::Isolate { glossy, coat, sky, .. } => {
                vec![("COMPOSE_GLOSSY", glossy), ("COMPOSE_COAT", coat), ("COMPOSE_SKY", sky)]
            }
        };
        defs.into_iter().filter(|(_, defined)| *defined).map(|(name, _)| name)
    }

    /// Whether nothing of Bevy's light by environment maps is left.
    fn replaces_environment_maps(self) -> bool {
        matches!(self, Self::Direct { environment_maps: EnvironmentMaps::Replaced, .. })
    }

    /// What it draws to, of a view with a picture of that format.
    fn targets(self, picture: TextureFormat) -> Vec<Option<ColorTargetState>> {
        let half = TextureFormat::Rgba16Float;
        let target = |format| Some(ColorTargetState { format, blend: None, write_mask: ColorWrites::ALL });
        match self {
            Self::Direct { environment_maps, .. } => {
                vec![target(half); if environment_maps.are_shadowed() { 3 } else { 2 }]
            }
            Self::Reflections { targets } => {
                let taken = ColorTargetState { format: half, blend: Some(TAKE), write_mask: ColorWrites::COLOR };
                vec![Some(taken); targets]
            }
            Self::Compose { .. } | Self::Isolate { .. } => vec![target(picture)],
        }
    }
}

/// The pipelines of a view; there once they are compiled.
#[derive(Component)]
pub(super) struct ViewPipelines {
    /// Direct light.
    pub direct: CachedRenderPipelineId,
    /// It is with what is mirrored of a sky of ambient light.
    pub mirrors_ambient: bool,
    /// What screen-space reflections show is taken, where they are on and there is something to take it from.
    pub reflections: Option<CachedRenderPipelineId>,
    /// Into the picture.
    pub compose: CachedRenderPipelineId,
    /// Something alone over the finished picture, where that is asked for.
    pub isolate: Option<CachedRenderPipelineId>,
}

impl ViewPipelines {
    fn ids(&self) -> impl Iterator<Item = CachedRenderPipelineId> + use<> {
        [Some(self.direct), self.reflections, Some(self.compose), self.isolate].into_iter().flatten()
    }
}

/// Packs the G-buffer.
fn surface_kernel(shaders: &GiShaders) -> Kernel {
    Kernel::new(
        shaders,
        KernelDescriptor {
            path: "compose/surface.wgsl",
            entry: "pack",
            bindings: &[
                uniform_buffer::<ViewUniform>(false),
                // Depth read as a float: naga has no GLSL for loads from a depth texture.
                texture_2d(TextureSampleType::Float { filterable: false }),
                texture_2d(TextureSampleType::Uint),
                texture_2d(TextureSampleType::Uint),
                uniform_buffer::<PbrDeferredLightingDepthId>(false),
                texture_storage_2d(TextureFormat::Rg32Uint, StorageTextureAccess::WriteOnly),
            ],
            groups: &[],
            defs: vec![],
        },
    )
}

pub(super) fn init_compose_pipelines(
    mut commands: Commands,
    shaders: Res<GiShaders>,
    mesh_pipeline: Res<MeshPipeline>,
    fullscreen: Res<FullscreenShader>,
    device: Res<RenderDevice>,
) {
    let direct_layout = BindGroupLayoutDescriptor::new(
        "bounce_direct_layout",
        &BindGroupLayoutEntries::single(ShaderStages::FRAGMENT, texture_2d(TextureSampleType::Uint)),
    );
    let ambient_layout = BindGroupLayoutDescriptor::new(
        "bounce_direct_ambient_layout",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (texture_2d(TextureSampleType::Uint), uniform_buffer::<Sky>(false)),
        ),
    );
    let compose_layout = BindGroupLayoutDescriptor::new(
        "bounce_compose_layout",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::VERTEX_FRAGMENT,
            (
                uniform_buffer::<PbrDeferredLightingDepthId>(false).visibility(ShaderStages::VERTEX),
                texture_2d_array(TextureSampleType::Float { filterable: false }).visibility(ShaderStages::FRAGMENT),
            ),
        ),
    );
    let reflections = ReflectionBindings::new(&device);
    commands.insert_resource(ComposePipelines {
        surface: surface_kernel(&shaders),
        direct_layout,
        ambient_layout,
        compose_layout,
        mesh_pipeline: mesh_pipeline.clone(),
        fullscreen: fullscreen.clone(),
        direct_shader: shaders.get("compose/direct.wgsl"),
        compose_shader: shaders.get("compose/compose.wgsl"),
        reflections_shader: shaders.get("compose/reflections.wgsl"),
        reflections_layout: reflections.layout.clone(),
    });
    commands.insert_resource(reflections);
}

impl ComposePipelines {
    /// What `DeferredLightingLayout::specialize` of bevy_pbr/src/deferred/mod.rs defines, less `IRRADIANCE_VOLUME`, whose
    /// light ours replaces, and tonemapping, for we draw HDR alone.
    fn shader_defs(&self, key: MeshPipelineKey, layout: &MeshPipelineViewLayout) -> Vec<ShaderDefVal> {
        let layout_key = MeshPipelineViewLayoutKey::from(key);
        let binds = |binding| layout.main_layout.entries.iter().any(|entry| entry.binding == binding);
        let shadow_filter = key.intersection(MeshPipelineKey::SHADOW_FILTER_METHOD_RESERVED_BITS);
        [
            ("DEFERRED_LIGHTING_PIPELINE", true),
            ("DEFERRED_PREPASS", true),
            ("STANDARD_MATERIAL_CLEARCOAT", true),
            ("DEPTH_PREPASS", key.contains(MeshPipelineKey::DEPTH_PREPASS)),
            ("NORMAL_PREPASS", key.contains(MeshPipelineKey::NORMAL_PREPASS)),
            ("MOTION_VECTOR_PREPASS", key.contains(MeshPipelineKey::MOTION_VECTOR_PREPASS)),
            ("SCREEN_SPACE_AMBIENT_OCCLUSION", key.contains(MeshPipelineKey::SCREEN_SPACE_AMBIENT_OCCLUSION)),
            ("SCREEN_SPACE_REFLECTIONS", key.contains(MeshPipelineKey::SCREEN_SPACE_REFLECTIONS)),
            ("ENVIRONMENT_MAP", key.contains(MeshPipelineKey::ENVIRONMENT_MAP)),
            ("CONTACT_SHADOWS", key.contains(MeshPipelineKey::CONTACT_SHADOWS)),
            ("DISTANCE_FOG", key.contains(MeshPipelineKey::DISTANCE_FOG)),
            ("ATMOSPHERE", key.contains(MeshPipelineKey::ATMOSPHERE)),
            ("SHADOW_FILTER_METHOD_HARDWARE_2X2", shadow_filter == MeshPipelineKey::SHADOW_FILTER_METHOD_HARDWARE_2X2),
            ("SHADOW_FILTER_METHOD_GAUSSIAN", shadow_filter == MeshPipelineKey::SHADOW_FILTER_METHOD_GAUSSIAN),
            ("SHADOW_FILTER_METHOD_TEMPORAL", shadow_filter == MeshPipelineKey::SHADOW_FILTER_METHOD_TEMPORAL),
            ("MULTIPLE_LIGHT_PROBES_IN_ARRAY", self.mesh_pipeline.binding_arrays_are_usable),
            ("MULTIPLE_LIGHTMAPS_IN_ARRAY", self.mesh_pipeline.binding_arrays_are_usable),
            ("CLUSTERED_DECALS_ARE_USABLE", self.mesh_pipeline.clustered_decals_are_usable),
            ("BLUE_NOISE_TEXTURE", layout_key.contains(MeshPipelineViewLayoutKey::STBN)),
            ("AREA_LIGHT_LUTS", layout_key.contains(MeshPipelineViewLayoutKey::AREA_LIGHT_LUTS)),
            ("DFG_LUT", binds(DFG_LUT_BINDING)),
            ("PCSS_SAMPLERS_AVAILABLE", binds(PCSS_BINDING)),
        ]
        .into_iter()
        .filter(|(_, defined)| *defined)
        .map(|(name, _)| ShaderDefVal::from(name))
        .collect()
    }

    /// Label, shader, entry point of its fragments, layout of group 2.
    fn program(&self, pass: Pass) -> (&'static str, &Handle<Shader>, &'static str, &BindGroupLayoutDescriptor) {
        match pass {
            Pass::Direct { environment_maps, .. } => {
                let is_ambient = environment_maps == EnvironmentMaps::Ambient;
                let layout = if is_ambient { &self.ambient_layout } else { &self.direct_layout };
                ("bounce_direct", &self.direct_shader, "fragment", layout)
            }
            Pass::Reflections { .. } => {
                ("bounce_reflections", &self.reflections_shader, "take", &self.reflections_layout)
            }
            Pass::Compose { .. } => ("bounce_compose", &self.compose_shader, "compose", &self.compose_layout),
            Pass::Isolate { entry, .. } => ("bounce_isolate", &self.compose_shader, entry, &self.compose_layout),
        }
    }
}

impl SpecializedRenderPipeline for ComposePipelines {
    type Key = (MeshPipelineKey, Pass);

    fn specialize(&self, (key, pass): Self::Key) -> RenderPipelineDescriptor {
        let layout = self.mesh_pipeline.get_view_layout(key.into());
        let mut shader_defs = self.shader_defs(key, &layout);
        if pass.replaces_environment_maps() {
            shader_defs.retain(|def| *def != "ENVIRONMENT_MAP".into());
        }
        shader_defs.extend(pass.shader_defs().map(ShaderDefVal::from));
        let (label, shader, entry_point, group_layout) = self.program(pass);
        let is_composed = matches!(pass, Pass::Compose { .. });
        let vertex = if is_composed {
            VertexState {
                shader: shader.clone(),
                shader_defs: shader_defs.clone(),
                entry_point: Some("vertex".into()),
                buffers: vec![],
            }
        } else {
            self.fullscreen.to_vertex_state()
        };
        RenderPipelineDescriptor {
            label: Some(label.into()),
            layout: vec![layout.main_layout, layout.binding_array_layout, group_layout.clone()],
            vertex,
            fragment: Some(FragmentState {
                shader: shader.clone(),
                shader_defs,
                entry_point: Some(entry_point.into()),
                targets: pass.targets(key.target_format()),
            }),
            depth_stencil: is_composed.then(lighting_pass_id_test),
            ..default()
        }
    }
}

/// What draws it alone.
fn entry(isolate: GiIsolate) -> &'static str {
    match isolate {
        GiIsolate::Split => "isolate_halves",
        GiIsolate::Glossy => "isolate_glossy",
        GiIsolate::Irradiance => "isolate_irradiance",
        isolate if isolate.is_picture() => "isolate_picture",
        _ => "isolate_indirect",
    }
}

/// Draws where the depth equals the lighting pass id.
fn lighting_pass_id_test() -> DepthStencilState {
    DepthStencilState {
        format: DEFERRED_LIGHTING_PASS_ID_DEPTH_FORMAT,
        depth_write_enabled: Some(false),
        depth_compare: Some(CompareFunction::Equal),
        stencil: StencilState::default(),
        bias: DepthBiasState::default(),
    }
}

/// Finds each view its pipelines, and takes over from Bevy's deferred lighting once they are there: until then, and should
/// they fail, Bevy goes on lighting a view that it has lit before.
///
/// Those of a sky are made while there may be one, so that it may come and go from one frame to the next; a game may
/// set ambient light at any time: what is mirrored of it waits for its pipelines, and nothing else does. Those of direct light are made
/// for all kinds of lights, and beside that for the kinds there are, to which a view turns once they are compiled.
pub(super) fn prepare_compose_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    pipelines: Res<ComposePipelines>,
    mut specialized: ResMut<SpecializedRenderPipelines<ComposePipelines>>,
    keys: Res<ViewKeyCache>,
    sky: KnownSky,
    lights: KnownLights,
    views: Query<
        (Entity, &GiView, &ExtractedView, Has<DeferredLightingPipeline>),
        (With<DepthPrepass>, With<DeferredPrepass>),
    >,
) {
    let direct_lights = [LightKinds::ALL, lights.kinds()];
    let is_ready = |id| matches!(cache.get_render_pipeline_state(id), CachedPipelineState::Ok(_));
    for (entity, gi, view, lit_by_bevy) in &views {
        let Some(&key) = keys.get(&view.retained_view_entity) else { continue };
        if key.contains(MeshPipelineKey::TONEMAP_IN_SHADER) {
            commands.entity(entity).remove::<(ViewPipelines, EnvironmentMaps, SkipDeferredLighting)>();
            continue;
        }
        let (glossy, coat) = (gi.settings.has_glossy_light(), gi.settings.radiance_cache.glossy);
        let mut pipeline = |pass| specialized.specialize(&cache, &pipelines, (key, pass));
        let mut all = |environment_maps: EnvironmentMaps| {
            let (indirect, sky) = (gi.isolate != GiIsolate::Direct, environment_maps.are_shadowed());
            let direct = |lights| Pass::Direct { environment_maps, glossy: glossy && sky, lights };
            let [direct, lean] = direct_lights.map(|lights| pipeline(direct(lights)));
            let isolate = Pass::Isolate { glossy, coat, sky, entry: entry(gi.isolate) };
            let targets = usize::from(glossy) + usize::from(sky);
            let reflects = targets > 0 && key.contains(MeshPipelineKey::SCREEN_SPACE_REFLECTIONS);
            ViewPipelines {
                reflections: reflects.then(|| pipeline(Pass::Reflections { targets })),
                direct: if is_ready(direct) && is_ready(lean) { lean } else { direct },
                mirrors_ambient: environment_maps == EnvironmentMaps::Ambient,
                compose: pipeline(Pass::Compose { indirect, glossy, coat, sky }),
                isolate: gi.isolate.is_alone().then(|| pipeline(isolate)),
            }
        };
        let under_map = key.contains(MeshPipelineKey::ENVIRONMENT_MAP).then(|| EnvironmentMaps::under(gi.technique));
        let without = all(EnvironmentMaps::Kept);
        let with = under_map.map(&mut all);
        let ambient = sky.is_mirrored_ambient(gi).then(|| all(EnvironmentMaps::Ambient));

        let are_ready = |of: &ViewPipelines| of.ids().all(is_ready);
        let needed = || [Some(&without), with.as_ref()].into_iter().flatten();
        let ready = pipelines.surface.is_ready(&cache) && needed().all(are_ready);
        let has_failed = |id| has_failed(cache.get_render_pipeline_state(id));
        let failed = pipelines.surface.has_failed(&cache) || needed().flat_map(ViewPipelines::ids).any(has_failed);
        let (view_pipelines, environment_maps) = match (ambient.filter(are_ready), with, under_map) {
            (Some(ambient), ..) => (ambient, EnvironmentMaps::Ambient),
            (None, Some(with), Some(under_map)) if sky.bounces(gi) => (with, under_map),
            _ => (without, EnvironmentMaps::Kept),
        };
        let mut view = commands.entity(entity);
        view.insert(environment_maps);
        hand_over(&mut view, ready.then_some(view_pipelines), failed || lit_by_bevy);
    }
}

/// A view to our passes, or back to Bevy's; a view that Bevy has not lit before waits in the dark.
fn hand_over(view: &mut EntityCommands, pipelines: Option<ViewPipelines>, to_bevy: bool) {
    match pipelines {
        Some(pipelines) => view.insert((pipelines, SkipDeferredLighting)),
        None if to_bevy => view.remove::<(ViewPipelines, SkipDeferredLighting)>(),
        None => view.insert(SkipDeferredLighting).remove::<ViewPipelines>(),
    };
}
