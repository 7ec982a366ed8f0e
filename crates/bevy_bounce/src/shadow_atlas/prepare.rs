//! Buffers of the shadow atlas.

use bevy::prelude::*;
use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferUsages, ShaderType, UniformBuffer};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::{AtlasParameters, Occluder, WorldPoint, tile_parts};

use crate::VplVisibility;
use crate::avg::VoxelGrid;
use crate::scene::{LARGEST_ERROR, SceneBuffers};
use crate::settings::{GiWorldSettings, StatedLights};

/// The shadow maps of all virtual lights; there while a camera asks for them and what casts is fine enough.
#[derive(Resource)]
pub(crate) struct ShadowAtlas {
    /// Sizes.
    pub parameters: UniformBuffer<AtlasParameters>,
    /// `array<u32>`: a texel a word, tile by tile.
    pub atlas: Buffer,
    /// `array<Occluder>`, or `array<WorldPoint>` where maps are made from points.
    pub occluders: Buffer,
    /// `array<vec2<u32>>`, by light: the baked object and the texel of it that the light is on, or `NONE`.
    pub eyes: Buffer,
}

impl ShadowAtlas {
    /// Parts in which each tile is drawn.
    pub fn parts(&self) -> u32 {
        tile_parts(self.parameters.get().tile)
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 2] {
        [
            ("shadow atlas: tiles", self.atlas.size()),
            ("shadow atlas: occluders", self.occluders.size() + self.eyes.size()),
        ]
    }
}

fn storage(device: &RenderDevice, label: &'static str, size: u64) -> Buffer {
    device.create_buffer(&BufferDescriptor {
        label: Some(label),
        size,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

/// Largest tile, a multiple of four, of which that many fit into a binding.
fn fitting_tile(wanted: u32, lights: u32, limit: u64) -> u32 {
    (1..=wanted / 4).rev().map(|quarter| quarter * 4).find(|tile| atlas_bytes(*tile, lights) <= limit).unwrap_or(4)
}

fn atlas_bytes(tile: u32, lights: u32) -> u64 {
    u64::from(tile) * u64::from(tile) * 4 * u64::from(lights)
}

pub(super) fn prepare_atlas(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    settings: Res<GiWorldSettings>,
    stated: Res<StatedLights>,
    scene: Option<Res<SceneBuffers>>,
    grid: Option<Res<VoxelGrid>>,
    held: Option<ResMut<ShadowAtlas>>,
) {
    let wanted = settings.0.filter(|settings| settings.visibility >= VplVisibility::Ism);
    let fine_enough = |scene: &SceneBuffers| {
        let voxel = grid.as_ref().map_or(0.0, |grid| grid.uniform.get().voxel_size);
        scene.occluders().error <= LARGEST_ERROR * voxel
    };
    let (Some(settings), Some(scene)) = (wanted, scene.filter(|scene| fine_enough(scene))) else {
        commands.remove_resource::<ShadowAtlas>();
        return;
    };
    let limit = device.limits().max_storage_buffer_binding_size;
    let tile = fitting_tile(settings.map_edge(), stated.0, limit);
    let diagonal = scene.bounds().map_or(1.0, |bounds| (bounds.max - bounds.min).length());
    let counts = scene.occluders();
    let parameters = AtlasParameters {
        tile,
        occluder_count: counts.triangles,
        far: diagonal.max(f32::MIN_POSITIVE),
        point_area: counts.point_area,
        error: counts.error,
    };
    let atlas_size = atlas_bytes(tile, stated.0);
    let occluder_size = match settings.visibility {
        VplVisibility::Ism => u64::from(counts.points.max(1)) * u64::from(WorldPoint::min_size()),
        _ => u64::from(stated.occluders(&settings).many) * u64::from(Occluder::min_size()),
    };
    let eyes = if settings.visibility == VplVisibility::Baked { stated.0 } else { 1 };
    let sizes = [atlas_size, occluder_size, 8 * u64::from(eyes)];
    match held {
        Some(mut held) if [&held.atlas, &held.occluders, &held.eyes].map(|buffer| buffer.size()) == sizes => {
            if *held.parameters.get() != parameters {
                held.parameters.set(parameters);
                held.parameters.write_buffer(&device, &queue);
            }
        }
        _ => {
            let mut parameters = UniformBuffer::from(parameters);
            parameters.write_buffer(&device, &queue);
            commands.insert_resource(ShadowAtlas {
                parameters,
                atlas: storage(&device, "bounce_shadow_atlas", atlas_size),
                occluders: storage(&device, "bounce_occluders", occluder_size),
                eyes: storage(&device, "bounce_eyes", 8 * u64::from(eyes)),
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_shrink_to_what_a_binding_holds() {
        let limit = 128 << 20;
        assert_eq!(fitting_tile(32, 1024, limit), 32);
        assert_eq!(fitting_tile(48, 65536, limit), 20);
        assert_eq!(fitting_tile(48, 8192, limit), 48);
        assert_eq!(fitting_tile(256, 1024, limit), 180);
        assert_eq!(fitting_tile(8, 65536, 1), 4);
    }
}
