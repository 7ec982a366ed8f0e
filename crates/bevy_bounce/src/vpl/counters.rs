//! What the GPU has counted, for measurements.

use bevy::prelude::*;
use bevy_bounce_shaders::types::VplHeader;

use super::VplBuffers;
use crate::readback::read;
use crate::settings::GiWorldSettings;

/// Virtual point lights of the last frame; `None` where none are traced. Waits for the GPU: for measurements, between frames.
pub fn vpl_count(render_world: &mut World) -> Option<u32> {
    render_world.get_resource::<GiWorldSettings>()?.0?;
    let header = render_world.get_resource::<VplBuffers>()?.header.clone();
    read::<VplHeader>(render_world, &header).map(|header| header.count)
}
