//! The lit voxels: a texture for each axis, and what it is made from.

use bevy::prelude::*;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, Extent3d, Texture, TextureDescriptor, TextureDimension, TextureFormat,
    TextureUsages, TextureView, TextureViewDescriptor, UniformBuffer,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::{GROUP_EDGE, LightVolume};

use crate::avg::{GROUP_CELLS, VoxelGrid};
use crate::settings::GiWorldSettings;

/// Texels of the coarsest level along the grid's edge.
const COARSEST_EDGE: u32 = 4;
/// Bytes of a texel.
const TEXEL_BYTES: u64 = 8;
/// Bytes that each cell takes: its place, its irradiance by lights and by virtual ones, its emission.
const CELL_BYTES: [u64; 3] = [4, 32, 12];
/// Bytes of a cell's emission.
pub(super) const EMISSION_BYTES: u64 = CELL_BYTES[2];

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
    /// Of the world.
    pub world: LightTextures,
    /// Of groups with a grid of their own, where there are any: a cube for each.
    pub groups: Option<LightTextures>,
    /// By their grids: the revision whose emission is known.
    pub emitted: Vec<u64>,
    /// Whether they hold light.
    pub is_lit: bool,
    rooms: Rooms,
}

/// What there is room for.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rooms {
    /// Cells of the world and of the grids of groups.
    cells: u64,
    /// Groups, each with light of its own.
    groups: u64,
    /// Where that begins.
    first_group_cell: u64,
}

impl Rooms {
    fn of(grid: &VoxelGrid) -> Self {
        let groups = match grid.groups.count() {
            0 => 0,
            count => u64::from(count.next_power_of_two()),
        };
        Self { cells: grid.groups.cell_count(), groups, first_group_cell: grid.groups.first_cell }
    }

    /// With room for as many groups as there was in another room of the same grids.
    fn kept(self, before: &Self) -> Self {
        let same = self.cells == before.cells && self.first_group_cell == before.first_group_cell;
        Self { groups: if same { self.groups.max(before.groups) } else { self.groups }, ..self }
    }

    /// Cells of the world and of groups that are lit.
    fn lit(&self) -> u64 {
        self.first_group_cell + self.groups * GROUP_CELLS
    }
}

/// Light by axis: a texture each.
pub(crate) struct LightTextures {
    /// All levels.
    pub light: [TextureView; 3],
    /// By level.
    pub levels: Vec<[TextureView; 3]>,
    textures: [Texture; 3],
}

impl LightTextures {
    fn new(device: &RenderDevice, size: UVec3, levels: u32) -> Self {
        let textures = ["bounce_voxel_light_x", "bounce_voxel_light_y", "bounce_voxel_light_z"].map(|label| {
            device.create_texture(&TextureDescriptor {
                label: Some(label),
                size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: size.z },
                mip_level_count: levels,
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
        Self {
            light: textures.each_ref().map(|texture| texture.create_view(&TextureViewDescriptor::default())),
            levels: (0..levels).map(|i| textures.each_ref().map(|texture| level(texture, i))).collect(),
            textures,
        }
    }

    /// Texels of a level of each.
    pub fn level_size(&self, level: u32) -> UVec3 {
        let size = self.textures[0].size();
        (UVec3::new(size.width, size.height, size.depth_or_array_layers) >> level).max(UVec3::ONE)
    }

    fn bytes(&self) -> u64 {
        let texels = |level| self.level_size(level).as_u64vec3().element_product();
        (0..self.levels.len() as u32).map(texels).sum::<u64>() * TEXEL_BYTES * self.textures.len() as u64
    }
}

/// Halves as large as the grid, rounded up so that every level has whole texels.
fn layout(dims: UVec3, edge: u32, further: bool, first_group_cell: u32) -> LightVolume {
    let last_level = (edge / COARSEST_EDGE).max(1).ilog2();
    let gap = 1 << last_level;
    LightVolume {
        dims: dims.map(|voxels| voxels.next_multiple_of(gap)),
        gap,
        last_level,
        further: u32::from(further),
        first_group_cell,
        padding: 0,
    }
}

/// Texels of a texture.
fn texels(volume: &LightVolume) -> UVec3 {
    UVec3::new(2 * volume.dims.x + volume.gap, volume.dims.y, volume.dims.z)
}

impl VoxelLight {
    fn new(device: &RenderDevice, parameters: LightVolume, rooms: Rooms) -> Self {
        let buffer = |label, size: u64| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size: size.max(16),
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        };
        let [place, irradiance, emission] = CELL_BYTES;
        let cubes = UVec3::new(2 * GROUP_EDGE, GROUP_EDGE, GROUP_EDGE * rooms.groups as u32);
        Self {
            parameters: UniformBuffer::from(parameters),
            places: buffer("bounce_voxel_places", rooms.lit() * place),
            irradiance: buffer("bounce_voxel_irradiance", rooms.lit() * irradiance),
            emission_sums: buffer("bounce_voxel_emission", rooms.cells * emission),
            unit: buffer("bounce_light_unit", 16),
            world: LightTextures::new(device, texels(&parameters), parameters.last_level + 1),
            groups: (rooms.groups > 0).then(|| LightTextures::new(device, cubes, GROUP_EDGE.ilog2() + 1)),
            emitted: Vec::new(),
            is_lit: false,
            rooms,
        }
    }

    /// Where the emission of the world's cells is, bytes.
    pub fn world_emission(&self) -> (u64, u64) {
        (0, self.rooms.first_group_cell * EMISSION_BYTES)
    }

    /// Textures of the groups; where there are none, those of the world stand in for them and are not looked at.
    pub fn group_light(&self) -> &[TextureView; 3] {
        self.groups.as_ref().map_or(&self.world.light, |groups| &groups.light)
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 2] {
        let cells = self.places.size() + self.irradiance.size() + self.emission_sums.size() + self.unit.size();
        let levels = self.world.bytes() + self.groups.as_ref().map_or(0, LightTextures::bytes);
        [("voxel light: cells", cells), ("voxel light: levels", levels)]
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
    let rooms = Rooms::of(&grid);
    let rooms = held.as_ref().map_or(rooms, |held| rooms.kept(&held.rooms));
    let further = settings.radiance_cache.further_bounces;
    let parameters = layout(grid.grid.dims, settings.grid, further, rooms.first_group_cell as u32);
    match held {
        Some(mut held) if texels(held.parameters.get()) == texels(&parameters) && held.rooms == rooms => {
            if *held.parameters.get() != parameters {
                held.parameters.set(parameters);
                held.parameters.write_buffer(&device, &queue);
            }
        }
        _ => {
            let mut light = VoxelLight::new(&device, parameters, rooms);
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
            let volume = layout(dims, edge, true, 0);
            assert!(volume.dims.cmpge(dims).all());
            assert_eq!(texels(&volume) % (1 << volume.last_level), UVec3::ZERO, "{volume:?}");
            assert!(texels(&volume).max_element() <= 2048);
        }
        assert_eq!(layout(UVec3::splat(62), 64, true, 0).last_level, 4);
    }
}
