//! The textures of a camera with bounced light, one texel a pixel of its main pass viewport.
//!
//! | texture | format | holds |
//! |---|---|---|
//! | `surface` | rg32uint | bits of the reverse-z depth (0: nothing to light), octahedral world normal |
//! | `direct` | rgba16float | direct light; alpha: whether a surface is lit, and has a lightmap, as `compose/marks.wgsl` says |
//! | `direct_diffuse` | rgba16float | its diffuse part, and the same alpha; then, where one iteration is all, what compensation adds |
//! | `indirect` | rgba16float | irradiance of bounced light over pi; alpha, of virtual lights and up to compensation: as `interleaved/filter.wgsl` says |
//! | `mirrored_sky` | rgba16float | what is mirrored of the sky and of reflection probes, but for what screen-space reflections show; how wide the lobe is, and the probes' share; where it is to be shadowed |
//! | `sky_seen` | rg of rgba16float | share of the sky's light that is seen by a wide lobe and by a narrow one; where it is to be shadowed |
//! | `glossy` | rgba16float | bounced light convolved with the lobe of the pixel's roughness, but for what screen-space reflections show; where it is asked for |
//! | `coat` | rgba16float | the same with that of its clearcoat; where there are radiance caches |
//! | `interleaved` | rgba16float | what near lights bring, then all bounced light, half filtered; then what compensation adds, half blurred; then bounced light averaged over frames |
//!
//! Light is pre-exposed: cd/m^2 times the view's exposure. `direct`, `indirect`, the two of the sky, `glossy` and
//! `coat` are the layers of one array, so that the composing pass needs one binding for all: Bevy's view bindings leave
//! no more of the 16 that WebGPU guarantees.

use bevy::camera::MainPassResolutionOverride;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::{
    BindingResource, BufferBinding, Extent3d, ShaderType, Texture, TextureDescriptor, TextureDimension, TextureFormat,
    TextureUsages, TextureView, TextureViewDescriptor, TextureViewDimension,
};
use bevy::render::renderer::RenderDevice;
use bevy::render::view::{ExtractedView, ViewUniform, ViewUniformOffset, ViewUniforms};

use crate::compose::EnvironmentMaps;
use crate::{GiIsolate, GiSettings, Technique};

/// A camera with bounced light, in the render world.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub(crate) struct GiView {
    /// What the picture holds.
    pub isolate: GiIsolate,
    /// How bounced light is computed.
    pub technique: Technique,
    /// What it is given.
    pub settings: GiSettings,
    /// What the camera asks for.
    pub stated: GiSettings,
    /// Whether this frame recalls nothing.
    pub reset: bool,
}

/// Textures of a [`GiView`]; kept from frame to frame, made anew when the size changes.
#[derive(Component)]
pub(crate) struct ViewTextures {
    /// Size of the main pass viewport, pixels.
    pub size: UVec2,
    /// Depth and normal.
    pub surface: TextureView,
    /// All direct light.
    pub direct: TextureView,
    /// Diffuse part of the direct light; then, where one iteration is all, what compensation adds.
    pub direct_diffuse: TextureView,
    /// Bounced light.
    pub indirect: TextureView,
    /// What near lights bring; then all bounced light, half filtered; then what compensation adds, half blurred; then bounced light averaged over frames.
    pub interleaved: TextureView,
    /// Glossy bounced light, where the view asks for it.
    pub glossy: Option<TextureView>,
    /// Bounced light that clearcoats reflect, where there are radiance caches.
    pub coat: Option<TextureView>,
    /// What is mirrored of the sky, where that is to be shadowed.
    pub mirrored_sky: Option<TextureView>,
    /// What of the sky is seen, there.
    pub sky_seen: Option<TextureView>,
    /// `direct`, `indirect`, `mirrored_sky`, `sky_seen`, `glossy` and `coat` as layers of an array.
    pub light: TextureView,
    textures: [Texture; 4],
}

/// What a view needs textures for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct ViewLayout {
    /// Pixels.
    size: UVec2,
    /// What is mirrored of the sky is shadowed.
    sky: bool,
    /// There is glossy light.
    glossy: bool,
    /// It is from radiance caches, and clearcoats have theirs.
    coat: bool,
}

impl ViewTextures {
    fn new(device: &RenderDevice, layout: ViewLayout) -> Self {
        let ViewLayout { size, sky, glossy, coat } = layout;
        let first_glossy = if sky { 4 } else { 2 };
        let layers = first_glossy + u32::from(glossy) + u32::from(coat);
        let texture = |label, format, layers, usage| {
            device.create_texture(&TextureDescriptor {
                label: Some(label),
                size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: layers },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage: usage | TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            })
        };
        let half = TextureFormat::Rgba16Float;
        let (storage, target) = (TextureUsages::STORAGE_BINDING, TextureUsages::RENDER_ATTACHMENT);
        let surface = texture("bounce_surface", TextureFormat::Rg32Uint, 1, storage);
        let light = texture("bounce_light", half, layers, storage | target);
        let direct_diffuse = texture("bounce_direct_diffuse", half, 1, storage | target);
        let interleaved = texture("bounce_interleaved", half, 1, storage);
        let layer = |layer| {
            light.create_view(&TextureViewDescriptor {
                dimension: Some(TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..default()
            })
        };
        let whole = |texture: &Texture| texture.create_view(&TextureViewDescriptor::default());
        Self {
            size,
            surface: whole(&surface),
            direct: layer(0),
            direct_diffuse: whole(&direct_diffuse),
            indirect: layer(1),
            interleaved: whole(&interleaved),
            mirrored_sky: sky.then(|| layer(2)),
            sky_seen: sky.then(|| layer(3)),
            glossy: glossy.then(|| layer(first_glossy)),
            coat: coat.then(|| layer(first_glossy + 1)),
            light: light
                .create_view(&TextureViewDescriptor { dimension: Some(TextureViewDimension::D2Array), ..default() }),
            textures: [surface, light, direct_diffuse, interleaved],
        }
    }

    fn layout(&self) -> ViewLayout {
        ViewLayout {
            size: self.size,
            sky: self.sky_seen.is_some(),
            glossy: self.glossy.is_some(),
            coat: self.coat.is_some(),
        }
    }

    /// What screen-space reflections show some of.
    pub fn reflected(&self) -> impl Iterator<Item = &TextureView> {
        self.glossy.iter().chain(&self.mirrored_sky)
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 4] {
        let names = ["view: surface", "view: light", "view: direct diffuse", "view: interleaved"];
        std::array::from_fn(|i| {
            let texture = &self.textures[i];
            let texels = u64::from(self.size.x) * u64::from(self.size.y) * u64::from(texture.depth_or_array_layers());
            (names[i], texels * u64::from(texture.format().block_copy_size(None).unwrap_or(0)))
        })
    }
}

/// Bevy's uniform of a view.
pub(crate) fn view_binding<'a>(uniforms: &'a ViewUniforms, offset: &ViewUniformOffset) -> Option<BindingResource<'a>> {
    let buffer = uniforms.uniforms.buffer()?;
    let (offset, size) = (offset.offset.into(), Some(ViewUniform::min_size()));
    Some(BindingResource::Buffer(BufferBinding { buffer, offset, size }))
}

/// Pixels that the main pass of a view draws; `None` where there are none.
pub(crate) fn main_pass_size(
    camera: &ExtractedCamera,
    view: &ExtractedView,
    resolution_override: Option<&MainPassResolutionOverride>,
) -> Option<UVec2> {
    let target = camera.physical_target_size?;
    let size = resolution_override.map_or(view.viewport.zw(), |size| size.0);
    let fits = (view.viewport.xy() + size).cmple(target).all();
    (size.min_element() > 0 && fits).then_some(size)
}

/// Gives every [`GiView`] its textures.
pub(crate) fn prepare_view_textures(
    mut commands: Commands,
    device: Res<RenderDevice>,
    views: Query<(
        Entity,
        &GiView,
        &ExtractedCamera,
        &ExtractedView,
        Option<&MainPassResolutionOverride>,
        Option<&EnvironmentMaps>,
        Option<&ViewTextures>,
    )>,
) {
    let limit = device.limits().max_texture_dimension_2d;
    for (entity, gi, camera, view, resolution_override, environment_maps, textures) in &views {
        let size = main_pass_size(camera, view, resolution_override).filter(|size| size.max_element() <= limit);
        let sky = environment_maps.is_some_and(|maps| maps.are_shadowed());
        let glossy = gi.settings.has_glossy_light();
        let coat = gi.settings.radiance_cache.glossy;
        let layout = size.map(|size| ViewLayout { size, sky, glossy, coat });
        if layout == textures.map(ViewTextures::layout) {
            continue;
        }
        match layout {
            Some(layout) => commands.entity(entity).insert(ViewTextures::new(&device, layout)),
            None => commands.entity(entity).remove::<ViewTextures>(),
        };
    }
}
