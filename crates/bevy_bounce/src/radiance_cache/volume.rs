//! The lit voxels: a texture for each axis, and what it is made from.

use bevy::prelude::*;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, Extent3d, Texture, TextureDescriptor, TextureDimension, TextureFormat,
    TextureUsages, TextureView, TextureViewDescriptor, UniformBuffer,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::LightVolume;

use crate::avg::VoxelGrid;
use crate::settings::GiWorldSettings;

/// Texels of the coarsest level along the grid's edge.
const COARSEST_EDGE: u32 = 4;
/// Bytes of a texel.
const TEXEL_BYTES: u64 = 8;
/// Bytes that each cell takes: its place, its irradiance by lights and by virtual ones, its emission.
const CELL_BYTES: [u64; 3] = [4, 32, 12];

/// The light of the voxels on the GPU; there while a camera uses radiance caches.
#[derive(Resource)]
pub(crate) struct VoxelLight {
    /// Sizes.
    pub parameters: UniformBuffer<LightVolume>,
    /// Voxel of each cell.
    pub places: Buffer,
    /// Light that falls on each cell.
    pub irradiance: Buffer,
    /// Fixed-point sums of the emission of each cell.
    pub emission_sums: Buffer,
    /// Radiance that counts as 1.
    pub unit: Buffer,
    /// By axis, all levels.
    pub light: [TextureView; 3],
    /// By level and axis.
    pub levels: Vec<[TextureView; 3]>,
    textures: [Texture; 3],
    cells: u32,
}

/// Halves as large as the grid, rounded up so that every level has whole texels.
fn layout(dims: UVec3, edge: u32, further: bool) -> LightVolume {
    let last_level = (edge / COARSEST_EDGE).max(1).ilog2();
    let gap = 1 << last_level;
    LightVolume {
        dims: dims.map(|voxels| voxels.next_multiple_of(gap)),
        gap,
        last_level,
        further: u32::from(further),
        padding_a: 0,
        padding_b: 0,
    }
}

/// Texels of a texture.
fn texels(volume: &LightVolume) -> UVec3 {
    UVec3::new(2 * volume.dims.x + volume.gap, volume.dims.y, volume.dims.z)
}

impl VoxelLight {
    fn new(device: &RenderDevice, parameters: LightVolume, cells: u32) -> Self {
        let buffer = |label, size| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size,
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        };
        let size = texels(&parameters);
        let textures = ["bounce_voxel_light_x", "bounce_voxel_light_y", "bounce_voxel_light_z"].map(|label| {
            device.create_texture(&TextureDescriptor {
                label: Some(label),
                size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: size.z },
                mip_level_count: parameters.last_level + 1,
                sample_count: 1,
                dimension: TextureDimension::D3,
                format: TextureFormat::Rgba16Float,
                usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            })
        });
        let level = |texture: &Texture, level| {
            texture.create_view(&TextureViewDescriptor { base_mip_level: level, mip_level_count: Some(1), ..default() })
        };
        let [places, irradiance, emission] = CELL_BYTES.map(|bytes| u64::from(cells.max(1)) * bytes);
        Self {
            parameters: UniformBuffer::from(parameters),
            places: buffer("bounce_voxel_places", places),
            irradiance: buffer("bounce_voxel_irradiance", irradiance),
            emission_sums: buffer("bounce_voxel_emission", emission),
            unit: buffer("bounce_light_unit", 16),
            light: textures.each_ref().map(|texture| texture.create_view(&TextureViewDescriptor::default())),
            levels: (0..=parameters.last_level).map(|i| textures.each_ref().map(|texture| level(texture, i))).collect(),
            textures,
            cells,
        }
    }

    /// Texels of a level of each texture.
    pub fn level_size(&self, level: u32) -> UVec3 {
        texels(self.parameters.get()) >> level
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 2] {
        let levels = 0..=self.parameters.get().last_level;
        let texels: u64 = levels.map(|level| self.level_size(level).as_u64vec3().element_product()).sum();
        let cells = self.places.size() + self.irradiance.size() + self.emission_sums.size() + self.unit.size();
        [("voxel light: cells", cells), ("voxel light: levels", texels * TEXEL_BYTES * self.textures.len() as u64)]
    }
}

/// Gives the grid its light's textures, and takes them when no camera asks for them.
pub(super) fn prepare_voxel_light(
    mut commands: Commands,
    settings: Res<GiWorldSettings>,
    grid: Option<Res<VoxelGrid>>,
    held: Option<ResMut<VoxelLight>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let wanted = settings.0.filter(|settings| settings.lights_grid());
    let (Some(settings), Some(grid)) = (wanted, grid) else {
        if held.is_some() {
            commands.remove_resource::<VoxelLight>();
        }
        return;
    };
    let parameters = layout(grid.grid.dims, settings.grid, settings.radiance_cache.further_bounces);
    let cells = grid.grid.cell_capacity;
    match held {
        Some(mut held) if texels(held.parameters.get()) == texels(&parameters) && held.cells == cells => {
            if *held.parameters.get() != parameters {
                held.parameters.set(parameters);
                held.parameters.write_buffer(&device, &queue);
            }
        }
        _ => {
            let mut light = VoxelLight::new(&device, parameters, cells);
            light.parameters.write_buffer(&device, &queue);
            commands.insert_resource(light);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_has_whole_texels() {
        for (dims, edge) in [(UVec3::new(62, 61, 63), 64), (UVec3::new(100, 5, 33), 32), (UVec3::splat(8), 8)] {
            let volume = layout(dims, edge, true);
            assert!(volume.dims.cmpge(dims).all());
            assert_eq!(texels(&volume) % (1 << volume.last_level), UVec3::ZERO, "{volume:?}");
            assert!(texels(&volume).max_element() <= 2048);
        }
        assert_eq!(layout(UVec3::splat(62), 64, true).last_level, 4);
    }
}
