//! Textures and parameters of a view's bias compensation.

use bevy::prelude::*;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, Extent3d, Texture, TextureDescriptor, TextureDimension, TextureFormat,
    TextureUsages, TextureView, TextureViewDescriptor, UniformBuffer,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::{SSBC_LEVELS, SSBC_REPAIR_HEADER, SsbcParameters, TENT_REACH};

use super::SsbcSettings;
use crate::view::{GiView, ViewTextures};
use crate::{GiSettings, Resolution};

/// Levels of the hierarchy, the pixels among them.
const LEVELS: u32 = 1 + SSBC_LEVELS;
/// Bytes of a texel of the hierarchy.
const NODE_BYTES: u64 = 16;
/// Irradiance over pi, pre-exposed; alpha is 1.
const RESIDUAL_FORMAT: TextureFormat = TextureFormat::Rgba16Float;
/// Bytes of a texel of it.
const RESIDUAL_BYTES: u64 = 8;
/// Bytes of a pixel in the list of repairs.
const REPAIR_BYTES: u64 = 4;

/// What a view with bias compensation holds; kept from frame to frame, made anew when size or settings change.
#[derive(Component)]
pub(crate) struct SsbcTextures {
    key: Key,
    /// How it integrates.
    pub parameters: UniformBuffer<SsbcParameters>,
    /// All levels, from the pixels up.
    pub hierarchy: TextureView,
    /// Each of them.
    pub levels: Vec<TextureView>,
    /// What is added to the bounced light.
    pub residual: TextureView,
    /// Size of the residual.
    pub residual_size: UVec2,
    /// What a residual needs that is blurred, or has fewer texels than there are pixels.
    pub at_pixels: Option<AtPixels>,
    /// Whether it is blurred.
    pub is_blurred: bool,
}

/// The residual as it is added.
pub(crate) struct AtPixels {
    /// Of as many texels as the view has pixels. `None`: it takes the place of the view's direct diffuse light, which nothing reads
    /// once the only iteration has.
    residual: Option<TextureView>,
    /// Pixels at which it is integrated anew; see `ssbc/repairs.wgsl`.
    pub repairs: Buffer,
    /// Whether there may be any.
    pub is_repaired: bool,
}

impl AtPixels {
    fn new(device: &RenderDevice, key: Key) -> Self {
        let Key { size, is_iterated, .. } = key;
        let is_repaired = key.resolution.pixels_a_texel() > 1;
        let residual = || whole(&texture(device, "bounce_ssbc_at_pixels", size, 1, RESIDUAL_FORMAT));
        Self {
            residual: is_iterated.then(residual),
            repairs: device.create_buffer(&BufferDescriptor {
                label: Some("bounce_ssbc_repairs"),
                size: repair_bytes(size, is_repaired),
                usage: BufferUsages::STORAGE | BufferUsages::INDIRECT | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            is_repaired,
        }
    }

    /// Where it is.
    pub fn residual<'a>(&'a self, view: &'a ViewTextures) -> &'a TextureView {
        self.residual.as_ref().unwrap_or(&view.direct_diffuse)
    }

    /// Bytes on the GPU.
    fn bytes(&self, size: UVec2) -> u64 {
        let own = if self.residual.is_some() { texels(size) * RESIDUAL_BYTES } else { 0 };
        own + self.repairs.size()
    }
}

impl SsbcTextures {
    fn new(device: &RenderDevice, queue: &RenderQueue, size: UVec2, asked: Asked) -> Self {
        let key = asked.key(size);
        let scale = key.resolution.pixels_a_texel();
        let residual_size = size.map(|pixels| pixels.div_ceil(scale));
        let hierarchy =
            texture(device, "bounce_ssbc_hierarchy", hierarchy_size(size), LEVELS, TextureFormat::Rgba32Uint);
        let level = |level| {
            hierarchy.create_view(&TextureViewDescriptor {
                base_mip_level: level,
                mip_level_count: Some(1),
                ..default()
            })
        };
        let mut parameters = UniformBuffer::from(asked.parameters());
        parameters.write_buffer(device, queue);
        Self {
            key,
            parameters,
            hierarchy: whole(&hierarchy),
            levels: (0..LEVELS).map(level).collect(),
            residual: whole(&texture(device, "bounce_ssbc_residual", residual_size, 1, RESIDUAL_FORMAT)),
            residual_size,
            at_pixels: (scale > 1 || key.is_blurred).then(|| AtPixels::new(device, key)),
            is_blurred: key.is_blurred,
        }
    }

    /// The residual at each pixel.
    pub fn result<'a>(&'a self, view: &'a ViewTextures) -> &'a TextureView {
        self.at_pixels.as_ref().map_or(&self.residual, |at_pixels| at_pixels.residual(view))
    }

    /// Texels of a mip level of the hierarchy.
    pub fn level_size(&self, level: u32) -> UVec2 {
        hierarchy_size(self.key.size) >> level
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 2] {
        let hierarchy: u64 = (0..LEVELS).map(|level| texels(self.level_size(level)) * NODE_BYTES).sum();
        let size = self.key.size;
        let at_pixels = self.at_pixels.as_ref().map_or(0, |at_pixels| at_pixels.bytes(size));
        [("ssbc: hierarchy", hierarchy), ("ssbc: residual", texels(self.residual_size) * RESIDUAL_BYTES + at_pixels)]
    }
}

fn texels(size: UVec2) -> u64 {
    u64::from(size.x) * u64::from(size.y)
}

/// Of a list that holds every pixel, or none.
fn repair_bytes(size: UVec2, is_repaired: bool) -> u64 {
    let pixels = if is_repaired { texels(size) } else { 0 };
    (u64::from(SSBC_REPAIR_HEADER) + pixels) * REPAIR_BYTES
}

/// What sizes and number of the textures follow from.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Key {
    /// Pixels.
    size: UVec2,
    /// At which it is integrated.
    resolution: Resolution,
    is_blurred: bool,
    /// Whether there are more iterations than one.
    is_iterated: bool,
}

/// What a view asks for.
#[derive(Clone, Copy)]
struct Asked {
    settings: SsbcSettings,
    /// At which bounded light is shaded.
    shaded: Resolution,
}

impl Asked {
    fn new(view: &GiView) -> Option<Self> {
        let GiSettings { ssbc: settings, resolution: shaded, .. } = view.settings;
        (settings.iterations > 0).then_some(Self { settings, shaded })
    }

    fn key(&self, size: UVec2) -> Key {
        let SsbcSettings { resolution, blur, iterations, .. } = self.settings;
        Key { size, resolution, is_blurred: blur, is_iterated: iterations > 1 }
    }

    fn parameters(&self) -> SsbcParameters {
        let scale = self.settings.resolution.pixels_a_texel();
        // Bounded light is the mean over as many of its own texels.
        SsbcParameters {
            solid_angle: self.settings.solid_angle,
            edge_solid_angle: self.settings.edge_solid_angle,
            scale,
            reach: TENT_REACH * self.shaded.pixels_a_texel() / scale,
        }
    }
}

/// Texels of the level of the pixels, such that the last one has whole ones, too.
fn hierarchy_size(size: UVec2) -> UVec2 {
    size.map(|pixels| pixels.next_multiple_of(1 << SSBC_LEVELS))
}

fn texture(device: &RenderDevice, label: &str, size: UVec2, mips: u32, format: TextureFormat) -> Texture {
    device.create_texture(&TextureDescriptor {
        label: Some(label),
        size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
        mip_level_count: mips,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format,
        usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    })
}

fn whole(texture: &Texture) -> TextureView {
    texture.create_view(&TextureViewDescriptor::default())
}

/// Gives every view that asks for compensation its textures, and takes them from those that no longer do.
pub(super) fn prepare_textures(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut views: Query<
        (Entity, Option<&GiView>, Option<&ViewTextures>, Option<&mut SsbcTextures>),
        Or<(With<GiView>, With<SsbcTextures>)>,
    >,
) {
    for (entity, view, textures, ours) in &mut views {
        let asked = view.and_then(Asked::new);
        let wanted = textures.zip(asked).map(|(textures, asked)| (textures.size, asked));
        match (wanted, ours) {
            (Some((size, asked)), Some(mut ours)) if ours.key == asked.key(size) => {
                let parameters = asked.parameters();
                if *ours.parameters.get() != parameters {
                    ours.parameters.set(parameters);
                    ours.parameters.write_buffer(&device, &queue);
                }
            }
            (Some((size, asked)), _) => {
                commands.entity(entity).insert(SsbcTextures::new(&device, &queue, size, asked));
            }
            (None, Some(_)) => {
                commands.entity(entity).remove::<SsbcTextures>();
            }
            (None, None) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of either resolution: half of the tent of bounded light is four of its own texels wide.
    #[test]
    fn the_tent_is_as_wide_as_that_of_bounded_light() {
        let reach = |shaded, resolution| {
            let parameters = Asked { settings: SsbcSettings { resolution, ..default() }, shaded }.parameters();
            (parameters.scale, parameters.reach)
        };
        assert_eq!(reach(Resolution::Full, Resolution::Full), (1, 4));
        assert_eq!(reach(Resolution::Half, Resolution::Half), (2, 4));
        assert_eq!(reach(Resolution::Half, Resolution::Full), (1, 8));
        assert_eq!(reach(Resolution::Full, Resolution::Half), (2, 2));
    }
}
