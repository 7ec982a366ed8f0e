//! Virtual lights as gizmos: each a line along its normal, in the colour of its light.

use std::sync::{Arc, Mutex, PoisonError};

use bevy::gizmos::GizmoPlugin;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_resource::encase::StorageBuffer;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode, ShaderType,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::{Vpl, VplHeader};

use crate::settings::GiWorldSettings;
use crate::vpl::VplBuffers;

/// What is drawn with the scene in the pictures of all cameras, but for those that [`GiIsolate`](crate::GiIsolate) shows alone.
#[derive(Resource, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct GiGizmos {
    /// Each virtual light as a line along its normal, in the colour of its light. Needs Bevy's features `bevy_gizmos`
    /// and `bevy_gizmos_render`, and its `GizmoPlugin`. The lights are read back from the GPU while this is on: what is
    /// drawn is some frames old.
    pub virtual_lights: bool,
    /// Length of those lines, as a share of the extent of all lights: 0.001 to 0.2.
    #[reflect(@1e-3..=0.2_f32)]
    pub length: f32,
}

impl Default for GiGizmos {
    fn default() -> Self {
        Self { virtual_lights: false, length: 0.02 }
    }
}

/// How the gizmos of virtual lights are drawn: their lines, depth and layers, by Bevy's `GizmoConfigStore`.
#[derive(GizmoConfigGroup, Reflect, Clone, Copy, Debug, Default)]
pub struct VirtualLightGizmos;

/// What is drawn of a virtual light.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Mark {
    position: Vec3,
    normal: Vec3,
    color: LinearRgba,
}

/// The lights that were read last; shared by both worlds.
#[derive(Resource, Clone, Default)]
pub(super) struct ReadLights(Arc<Mutex<Vec<Mark>>>);

impl ReadLights {
    fn set(&self, marks: Vec<Mark>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = marks;
    }
}

/// In the render world while lights are to be read: whether a copy of them is under way.
#[derive(Resource, Default)]
pub(super) struct Reading(Arc<Mutex<bool>>);

/// Draws where the app has gizmos at all.
pub(super) fn finish(app: &mut App) -> ReadLights {
    let read = ReadLights::default();
    if app.is_plugin_added::<GizmoPlugin>() {
        app.init_gizmo_group::<VirtualLightGizmos>().insert_resource(read.clone()).add_systems(PostUpdate, draw);
    }
    read
}

pub(super) fn extract(
    mut commands: Commands,
    gizmos: Extract<Res<GiGizmos>>,
    drawn: Extract<Option<Res<ReadLights>>>,
    read: Res<ReadLights>,
    reading: Option<Res<Reading>>,
) {
    match (gizmos.virtual_lights && drawn.is_some(), reading.is_some()) {
        (true, false) => commands.init_resource::<Reading>(),
        (false, true) => {
            commands.remove_resource::<Reading>();
            read.set(Vec::new());
        }
        _ => {}
    }
}

/// Copies the list of lights, unless the last copy is still under way; the GPU says when it is there.
pub(super) fn read_lights(
    reading: Option<Res<Reading>>,
    read: Res<ReadLights>,
    settings: Res<GiWorldSettings>,
    vpl: Option<Res<VplBuffers>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let Some(reading) = reading else { return };
    let (Some(_), Some(vpl)) = (settings.0, vpl) else {
        read.set(Vec::new());
        return;
    };
    if std::mem::replace(&mut *reading.0.lock().unwrap_or_else(PoisonError::into_inner), true) {
        return;
    }
    let copy = copy(&device, &queue, &vpl);
    let (under_way, read) = (Arc::downgrade(&reading.0), read.clone());
    let mapped = copy.clone();
    copy.slice(..).map_async(MapMode::Read, move |result| {
        let bytes = result.is_ok().then(|| mapped.slice(..).get_mapped_range().to_vec());
        mapped.unmap();
        // Nobody asks any more where the resource is gone.
        if let Some(under_way) = under_way.upgrade() {
            if let Some(marks) = bytes.and_then(|bytes| marks(&bytes)) {
                read.set(marks);
            }
            *under_way.lock().unwrap_or_else(PoisonError::into_inner) = false;
        }
    });
}

/// Header and list behind each other, in a buffer that can be mapped.
fn copy(device: &RenderDevice, queue: &RenderQueue, vpl: &VplBuffers) -> Buffer {
    let header = vpl.header.size();
    let copy = device.create_buffer(&BufferDescriptor {
        label: Some("bounce_read_lights"),
        size: header + vpl.vpls.size(),
        usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(&vpl.header, 0, &copy, 0, header);
    encoder.copy_buffer_to_buffer(&vpl.vpls, 0, &copy, header, vpl.vpls.size());
    queue.submit([encoder.finish()]);
    copy
}

/// What the bytes say; `None` where they make no sense.
fn marks(bytes: &[u8]) -> Option<Vec<Mark>> {
    let (header, list) = bytes.split_at_checked(u64::from(VplHeader::min_size()) as usize)?;
    let header: VplHeader = StorageBuffer::new(header).create().ok()?;
    let light = u64::from(Vpl::min_size()) as usize;
    let list = list.get(..header.count as usize * light)?;
    let lights: Vec<Vpl> = StorageBuffer::new(list).create().ok()?;
    let mark = |vpl: &Vpl| {
        let most = vpl.flux.max_element().max(f32::MIN_POSITIVE);
        let Vec3 { x, y, z } = vpl.flux / most;
        Mark { position: vpl.position, normal: vpl.normal, color: LinearRgba::rgb(x, y, z) }
    };
    Some(lights.iter().filter(|vpl| vpl.flux.max_element() > 0.0).map(mark).collect())
}

fn draw(settings: Res<GiGizmos>, read: Res<ReadLights>, mut gizmos: Gizmos<VirtualLightGizmos>) {
    if !settings.virtual_lights {
        return;
    }
    let marks = read.0.lock().unwrap_or_else(PoisonError::into_inner);
    let low = marks.iter().map(|mark| mark.position).reduce(Vec3::min).unwrap_or_default();
    let high = marks.iter().map(|mark| mark.position).reduce(Vec3::max).unwrap_or_default();
    let share = if settings.length.is_finite() { settings.length.clamp(1e-3, 0.2) } else { GiGizmos::default().length };
    for mark in marks.iter() {
        gizmos.line(mark.position, mark.position + mark.normal * ((high - low).length() * share), mark.color);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_lights_of_the_list_are_drawn() {
        let header = VplHeader { count: 2, ..default() };
        let lit = Vpl { position: Vec3::X, normal: Vec3::Y, flux: Vec3::new(2.0, 1.0, 0.0), ..default() };
        let mut bytes = StorageBuffer::new(Vec::<u8>::new());
        bytes.write(&header).expect("is written");
        let mut bytes = bytes.into_inner();
        let mut list = StorageBuffer::new(Vec::<u8>::new());
        list.write(&vec![lit, Vpl::default(), lit]).expect("is written");
        bytes.extend(list.into_inner());
        let mark = Mark { position: Vec3::X, normal: Vec3::Y, color: LinearRgba::rgb(1.0, 0.5, 0.0) };
        assert_eq!(marks(&bytes), Some(vec![mark]));
        assert_eq!(marks(&bytes[..100]), None);
        assert_eq!(marks(&[]), None);
    }
}
