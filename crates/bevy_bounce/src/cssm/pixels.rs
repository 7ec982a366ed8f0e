//! What a view keeps of its pixels' light: while everything rests, each frame gathers it from other texels, and the mean is shown.

use bevy::prelude::*;
use bevy::render::camera::{ExtractedCamera, TemporalJitter};
use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferUsages, UniformBuffer};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::ExtractedView;
use bevy_bounce_shaders::types::CssmGather;

use super::object::CssmView;
use super::prepare::Baked;
use crate::view::{GiView, ViewTextures};
use crate::{CssmReceivers, Technique};

/// Frames that are averaged.
const RESTING_FRAMES: u32 = 64;
/// Bytes a pixel of what is kept of diffuse light, and as much of glossy light.
const KEPT_BYTES: u64 = 16;

/// How the pixels of a view gather, and what is kept of their light.
#[derive(Component)]
pub(crate) struct PixelLight {
    /// `CssmGather`.
    pub settings: UniformBuffer<CssmGather>,
    /// `array<vec4<u32>>`: see `cssm/pixels.wgsl`. As good as nothing where nothing is averaged.
    pub kept: Buffer,
    /// What the light that is kept depends on, but for what each pixel shows.
    of: Option<Look>,
}

/// Where from and how a view looks, and at which light.
#[derive(Clone, Copy, PartialEq)]
struct Look {
    gather: CssmGather,
    clip_from_world: Mat4,
    exposure: f32,
    size: UVec2,
    glossy: bool,
    times_lit: u64,
}

impl PixelLight {
    fn new(device: &RenderDevice, size: u64) -> Self {
        let kept = device.create_buffer(&BufferDescriptor {
            label: Some("bounce_cssm_kept"),
            size,
            usage: BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        Self { settings: UniformBuffer::default(), kept, of: None }
    }

    /// Name and size of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 1] {
        [("cssm: resting pixels", self.kept.size())]
    }
}

type Drawn<'w> =
    (&'w CssmView, &'w GiView, &'w ViewTextures, &'w ExtractedCamera, &'w ExtractedView, Option<&'w TemporalJitter>);

/// Tells pixels how to gather, and whether what is kept of their light still holds; takes that from views that are no longer lit by
/// baked objects.
pub(super) fn prepare_pixels(
    mut commands: Commands,
    mut views: Query<(Entity, Option<Drawn>, Option<&mut PixelLight>), Or<(With<CssmView>, With<PixelLight>)>>,
    baked: Option<Res<Baked>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    // Texels whose light is not all there are lit in this frame.
    let (texels_rest, times_lit) = baked.map_or((false, 0), |baked| (baked.rests(), baked.times_lit));
    let times_lit = times_lit + u64::from(!texels_rest);
    let most = device.limits().max_storage_buffer_binding_size;
    for (entity, drawn, light) in &mut views {
        let drawn = drawn.filter(|(_, gi, ..)| gi.technique == Technique::SurfaceRadiosity);
        let Some((CssmView(gather), gi, textures, camera, view, jitter)) = drawn else {
            commands.entity(entity).remove::<(CssmView, PixelLight)>();
            continue;
        };
        let glossy = textures.glossy.is_some();
        let texels = u64::from(textures.size.x) * u64::from(textures.size.y);
        let bytes = texels * KEPT_BYTES * (1 + u64::from(glossy));
        let at_pixels = gi.settings.cssm.receivers == CssmReceivers::Pixels;
        let averages = at_pixels && gi.settings.has_history() && bytes <= most;
        let (frames, bytes) = if averages { (RESTING_FRAMES, bytes) } else { (1, KEPT_BYTES) };

        let mut clip_from_view = view.clip_from_view;
        if let Some(jitter) = jitter {
            jitter.jitter_projection(&mut clip_from_view, textures.size.as_vec2());
        }
        let look = Look {
            gather: CssmGather { frames, ..*gather },
            clip_from_world: clip_from_view * view.world_from_view.to_matrix().inverse(),
            exposure: camera.exposure,
            size: textures.size,
            glossy,
            times_lit,
        };
        let rests = |light: &PixelLight| averages && texels_rest && !gi.reset && light.of == Some(look);
        let wanted = |light: &PixelLight| CssmGather { restart: u32::from(!rests(light)), ..look.gather };
        match light {
            Some(mut light) if light.kept.size() == bytes => {
                let settings = wanted(&light);
                if *light.settings.get() != settings {
                    light.settings.set(settings);
                    light.settings.write_buffer(&device, &queue);
                }
                light.of = Some(look);
            }
            _ => {
                let mut light = PixelLight::new(&device, bytes);
                light.settings.set(wanted(&light));
                light.settings.write_buffer(&device, &queue);
                light.of = Some(look);
                commands.entity(entity).insert(light);
            }
        }
    }
}
