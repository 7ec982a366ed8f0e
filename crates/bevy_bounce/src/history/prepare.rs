//! What a view keeps from frame to frame, and what it is told of the last one.

use std::sync::atomic::{AtomicBool, Ordering};

use bevy::prelude::*;
use bevy::render::camera::{ExtractedCamera, TemporalJitter};
use bevy::render::render_resource::{
    Extent3d, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView, TextureViewDescriptor,
    UniformBuffer,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::ExtractedView;
use bevy_bounce_shaders::types::HistoryParameters;

use crate::GiSettings;
use crate::view::{GiView, ViewTextures};

/// Bytes of a texel of light.
const LIGHT_BYTES: u64 = 8;
/// Bytes of a texel of what pixels show.
const SURFACE_BYTES: u64 = 4;

/// Frames after a budget has changed the lights in which the new ones are faded in.
const FADE: u32 = 40;
/// Frames over which light is averaged meanwhile, at least.
const FADING_FRAMES: u32 = 16;

/// A frame as it was drawn.
#[derive(Clone, Copy)]
struct Frame {
    clip_from_world: Mat4,
    unjittered_clip_from_world: Mat4,
    exposure: f32,
}

impl Frame {
    fn new(camera: &ExtractedCamera, view: &ExtractedView, jitter: Option<&TemporalJitter>, size: UVec2) -> Self {
        let view_from_world = view.world_from_view.to_matrix().inverse();
        let unjittered_clip_from_world = view.clip_from_view * view_from_world;
        let mut clip_from_view = view.clip_from_view;
        if let Some(jitter) = jitter {
            jitter.jitter_projection(&mut clip_from_view, size.as_vec2());
        }
        let clip_from_world = clip_from_view * view_from_world;
        Self { clip_from_world, unjittered_clip_from_world, exposure: camera.exposure }
    }

    /// Whether light of this frame can be looked up from another.
    fn is_sound(&self) -> bool {
        let inverse = self.clip_from_world.inverse();
        inverse.is_finite() && self.unjittered_clip_from_world.is_finite() && self.exposure.is_normal()
    }
}

/// What a view with history holds; kept from frame to frame, made anew when the size changes.
#[derive(Component)]
pub(crate) struct History {
    size: UVec2,
    /// What the view asked for in the frame that is kept.
    asked: GiView,
    /// What a budget left of that.
    given: GiSettings,
    /// Frames in which that is still faded in.
    fade: u32,
    frame: Option<Frame>,
    /// Whether that frame came to an end with its light kept.
    kept: AtomicBool,
    /// What the shaders are told of the last frame.
    pub parameters: UniformBuffer<HistoryParameters>,
    /// Diffuse light, and glossy light where there is any.
    pub light: Vec<TextureView>,
    /// What the pixels showed.
    pub surfaces: TextureView,
}

impl History {
    fn new(device: &RenderDevice, size: UVec2, asked: GiView) -> Self {
        let texture = |label, format| {
            let texture = device.create_texture(&TextureDescriptor {
                label: Some(label),
                size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            texture.create_view(&TextureViewDescriptor::default())
        };
        let light = |_| texture("bounce_history_light", TextureFormat::Rgba16Float);
        Self {
            size,
            asked,
            given: asked.settings,
            fade: 0,
            frame: None,
            kept: AtomicBool::new(false),
            parameters: UniformBuffer::default(),
            light: (0..lights(&asked)).map(light).collect(),
            surfaces: texture("bounce_history_surfaces", TextureFormat::R32Uint),
        }
    }

    fn fits(&self, size: UVec2, asked: &GiView) -> bool {
        self.size == size && self.light.len() == lights(asked)
    }

    /// Tells the shaders of the last frame, if it is to be looked back to, and takes this one for it.
    fn begin(&mut self, frame: Frame, asked: GiView) {
        let (reset, given) = (asked.reset, asked.settings);
        // What a budget takes and gives back is the same light from other places.
        let asked = GiView { settings: asked.stated, reset: false, ..asked };
        self.fade = match (self.asked == asked, self.given == given) {
            (true, true) => self.fade.saturating_sub(1),
            (true, false) => FADE,
            (false, _) => 0,
        };
        self.given = given;
        let kept = std::mem::take(self.kept.get_mut()) && !reset && self.asked == asked && frame.is_sound();
        let last = self.frame.filter(|last| kept && last.is_sound());
        let frames = asked.settings.history;
        let parameters = HistoryParameters {
            frames: if self.fade > 0 { frames.max(FADING_FRAMES) } else { frames } as f32,
            leniency: self.fade as f32 / FADE as f32,
            ..default()
        };
        self.parameters.set(last.map_or(parameters, |last| HistoryParameters {
            previous_clip_from_world: last.clip_from_world,
            previous_world_from_clip: last.clip_from_world.inverse(),
            previous_unjittered_clip_from_world: last.unjittered_clip_from_world,
            exposure: frame.exposure / last.exposure,
            valid: 1,
            ..parameters
        }));
        (self.frame, self.asked) = (Some(frame), asked);
    }

    /// This frame's light is kept.
    pub fn keep(&self) {
        self.kept.store(true, Ordering::Relaxed);
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 2] {
        let texels = u64::from(self.size.x) * u64::from(self.size.y);
        let light = texels * LIGHT_BYTES * self.light.len() as u64;
        [("history: light", light), ("history: surfaces", texels * SURFACE_BYTES)]
    }
}

/// Lights of a view that have a history.
fn lights(asked: &GiView) -> usize {
    1 + usize::from(asked.settings.has_glossy_light())
}

type Drawn<'w> = (&'w ExtractedCamera, &'w ExtractedView, Option<&'w TemporalJitter>);

/// Gives every view that asks for history its textures, and takes them from those that no longer do.
pub(super) fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut views: Query<
        (Entity, Option<&GiView>, Option<&ViewTextures>, Option<Drawn>, Option<&mut History>),
        Or<(With<GiView>, With<History>)>,
    >,
) {
    for (entity, view, textures, drawn, history) in &mut views {
        let asked = view.copied().filter(|view| view.settings.has_history());
        let (Some(asked), Some(textures), Some((camera, extracted, jitter))) = (asked, textures, drawn) else {
            if history.is_some() {
                commands.entity(entity).remove::<History>();
            }
            continue;
        };
        let size = textures.size;
        let frame = Frame::new(camera, extracted, jitter, size);
        match history {
            Some(mut history) if history.fits(size, &asked) => {
                history.begin(frame, asked);
                history.parameters.write_buffer(&device, &queue);
            }
            _ => {
                let mut history = History::new(&device, size, asked);
                history.begin(frame, asked);
                history.parameters.write_buffer(&device, &queue);
                commands.entity(entity).insert(history);
            }
        }
    }
}
