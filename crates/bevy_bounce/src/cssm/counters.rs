//! What the GPU has counted, for measurements.

use bevy::prelude::*;
use bevy::render::render_resource::Buffer;

use super::Baked;
use crate::readback::read;

/// Nodes of each texel's cut: at the last bounce between texels, and at the one that only pixels show, none where texels do not receive it.
/// Waits for the GPU: for measurements, between frames.
pub fn texel_cuts(render_world: &World) -> Option<[Vec<f32>; 2]> {
    let light = &render_world.get_resource::<Baked>()?.light;
    let cuts = |buffer: &Buffer| Some(read::<Vec<Vec4>>(render_world, buffer)?.iter().map(|light| light.w).collect());
    let shown = light.received.as_ref().map_or(Some(Vec::new()), cuts)?;
    Some([cuts(&light.gathered)?, shown])
}
