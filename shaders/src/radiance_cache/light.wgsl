// Light that falls on each cell of the grid: of Bevy's lights by a shadow ray to each, of a sixteenth of the sky's
// directions, and of a sixteenth of the virtual lights, which stand for emissive surfaces and for all further bounces.
// Rehfeld, Zirr and Dachsbacher 2014, 3.1, "Voxel Illumination"; shadow rays meet the planes of the grid's cells, where
// the paper's cones meet the opacity of voxels. They go the way light does: a one-sided surface lets pass what comes
// from behind, as in Bevy's shadow maps. Of the sky Bevy has no such maps: its rays go from the cell outwards, and what
// faces the cell hides it.
//
// Which sixteenth follows from the voxel's place, such that any 4x4 voxels of a plane have all sixteen: `volume.wgsl` takes
// their mean.
//
// Groups with a grid of their own are lit where they stand, each by itself, also where several share a grid.
//
// Cost: one thread a cell; a ray through the grid for each light that it faces (four for a rect light), and for a sixteenth of the
// sky's directions and of the virtual lights.

#import bevy_bounce::radiance_cache::types::LightVolume
#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::grid::{Cell, grid_level, cell_plane, cell_area}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::lights::{range_window, spot_window, rect_part, rect_part_form_factor, RECT_PARTS}
#import bevy_bounce::shared::octahedral::decode_unit
#import bevy_bounce::shared::rays::{grid, cells, voxel_groups, is_blocked, to_grid, to_world, Ray}
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::shared::scene::{Light, Scene, LIGHT_SPOT, LIGHT_DIRECTIONAL, LIGHT_RECT}
#import bevy_bounce::shared::voxel_groups::{from_group, normal_from_group, GROUP_CELLS}
#import bevy_bounce::vpl::bound::geometry_bound
#import bevy_bounce::vpl::types::{Vpl, VplHeader, SUBSETS, subset_at, sky_subset_at}

@group(0) @binding(0) var<uniform> scene: Scene;
@group(0) @binding(1) var<storage, read> lights: array<Light>;
@group(0) @binding(2) var<storage, read> header: VplHeader;
@group(0) @binding(3) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(4) var<storage, read> places: array<u32>;
// Bindings 5 and 6 are those of `vpl::bound`.
// Of each cell: irradiance by lights, and by virtual ones, lux.
@group(0) @binding(7) var<storage, read_write> irradiance: array<vec4<f32>>;
@group(0) @binding(8) var<uniform> volume: LightVolume;

const PLACE_VALID: u32 = 0x80000000u;
/// Voxels from the ends of a ray within which nothing blocks: a cell's plane is the mean of what its voxel holds.
const GAP: f32 = 0.25;
/// Voxels: beyond any grid.
const FAR: f32 = 1e6;

struct Receiver {
    // World.
    position: vec3<f32>,
    normal: vec3<f32>,
    // In its grid.
    voxel: vec3<u32>,
    has_area: bool,
}

fn voxel_of(place: u32, dims: vec3<u32>) -> vec3<u32> {
    return vec3<u32>(place % dims.x, (place / dims.x) % dims.y, place / (dims.x * dims.y));
}

// Middle of the surface of a cell, in voxels.
fn middle_of(cell: Cell, voxel: vec3<u32>) -> vec3<f32> {
    return vec3<f32>(voxel) + 0.5 + decode_unit(cell.normal) * cell_plane(cell);
}

fn receiver_in_world(index: u32, place: u32) -> Receiver {
    let cell = cells[index];
    let voxel = voxel_of(place, grid.dims);
    return Receiver(to_world(middle_of(cell, voxel)), decode_unit(cell.normal), voxel, cell_area(cell) > 0.0);
}

// `index` among the cells of all groups.
fn receiver_in_group(index: u32, place: u32) -> Receiver {
    let group = voxel_groups.groups[index / GROUP_CELLS];
    let cell = cells[group.first_cell + index % GROUP_CELLS];
    let voxel = voxel_of(place, group.dims);
    let normal = normal_from_group(group, decode_unit(cell.normal));
    return Receiver(from_group(group, middle_of(cell, voxel)), normal, voxel, cell_area(cell) > 0.0);
}

// Whether light from a place, world space, reaches a cell. `normal`: that of the surface it comes from, zero where there is none.
fn is_lit(receiver: Receiver, source: vec3<f32>, normal: vec3<f32>) -> bool {
    var ray: Ray;
    ray.origin = to_grid(source);
    let way = to_grid(receiver.position) - ray.origin;
    ray.length = length(way);
    ray.direction = way / max(ray.length, 1e-6);
    ray.start_normal = normal;
    ray.end_normal = receiver.normal;
    ray.gap = GAP;
    return !is_blocked(ray);
}

fn sees_sky(receiver: Receiver, direction: vec3<f32>) -> bool {
    var ray: Ray;
    ray.origin = to_grid(receiver.position);
    ray.direction = direction;
    ray.length = FAR;
    ray.start_normal = receiver.normal;
    ray.gap = GAP;
    return !is_blocked(ray);
}

// Length of the diagonal of all grids, metres.
fn grid_diagonal() -> f32 {
    let coarsest = grid_level(grid, grid.further_count);
    return length(vec3<f32>(coarsest.dims)) * coarsest.voxel_size;
}

fn from_rect_light(receiver: Receiver, light: Light) -> vec3<f32> {
    var sum = 0.0;
    for (var part = 0u; part < RECT_PARTS * RECT_PARTS; part++) {
        let source = rect_part(light, part);
        let way = source - receiver.position;
        let form_factor = rect_part_form_factor(light, way, receiver.normal);
        if form_factor > 0.0 {
            sum += select(0.0, form_factor, is_lit(receiver, source, light.direction));
        }
    }
    let middle = light.position - receiver.position;
    return light.color * (sum * range_window(light.range, dot(middle, middle)));
}

fn from_light(receiver: Receiver, light: Light) -> vec3<f32> {
    if light.kind == LIGHT_RECT {
        return from_rect_light(receiver, light);
    }
    var direction = -light.direction;
    var source = receiver.position + direction * grid_diagonal();
    var strength = 1.0;
    if light.kind != LIGHT_DIRECTIONAL {
        source = light.position;
        let way = source - receiver.position;
        let square = max(dot(way, way), 1e-12);
        direction = way / sqrt(square);
        // Within half a voxel the cell's mean place says nothing about the distance.
        let near = 0.25 * grid.voxel_size * grid.voxel_size;
        strength = range_window(light.range, square) / max(square, near);
        if light.kind == LIGHT_SPOT {
            strength *= spot_window(light, -direction);
        }
    }
    strength *= max(dot(receiver.normal, direction), 0.0);
    if strength <= 0.0 || !is_lit(receiver, source, vec3<f32>(0.0)) {
        return vec3<f32>(0.0);
    }
    return light.color * strength;
}

// One of so many of the sky's directions, which stands for all.
fn from_sky(receiver: Receiver, first: u32, step: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var i = first; is_within(i, scene.sky_count, receiver.normal.x); i += step) {
        let light = lights[scene.light_count + i];
        let cosine = -dot(receiver.normal, light.direction);
        if cosine > 0.0 && sees_sky(receiver, -light.direction) {
            sum += light.color * cosine;
        }
    }
    return sum * f32(step);
}

fn from_virtual_lights(receiver: Receiver, subset: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    let bound = geometry_bound(header, receiver.position);
    let end = header.subset_start[subset + 1u];
    for (var i = header.subset_start[subset]; i < end; i++) {
        let vpl = vpls[i];
        let way = vpl.position - receiver.position;
        let square = max(dot(way, way), 1e-12);
        let direction = way / sqrt(square);
        let cosines = max(dot(receiver.normal, direction), 0.0) * max(-dot(vpl.normal, direction), 0.0);
        let geometry_term = min(cosines / square, bound);
        if geometry_term > 0.0 && is_lit(receiver, vpl.position, vpl.normal) {
            sum += vpl.flux * geometry_term;
        }
    }
    return sum * (f32(SUBSETS) / PI);
}

@compute @workgroup_size(64)
fn light_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group) * 64u + lane;
    if index >= arrayLength(&places) || places[index] == 0u {
        return;
    }
    let place = places[index] & ~PLACE_VALID;
    var receiver: Receiver;
    if index < volume.first_group_cell {
        receiver = receiver_in_world(index, place);
    } else {
        receiver = receiver_in_group(index - volume.first_group_cell, place);
    }
    var direct = vec3<f32>(0.0);
    var further = vec3<f32>(0.0);
    if receiver.has_area {
        for (var i = 0u; is_within(i, scene.light_count, receiver.normal.x); i++) {
            direct += from_light(receiver, lights[i]);
        }
        if volume.further != 0u {
            let voxel = receiver.voxel;
            let place = voxel.xy + voxel.z;
            further = from_virtual_lights(receiver, subset_at(place)) + from_sky(receiver, sky_subset_at(place), SUBSETS);
        } else {
            direct += from_sky(receiver, 0u, 1u);
        }
    }
    irradiance[2u * index] = vec4<f32>(direct, 0.0);
    irradiance[2u * index + 1u] = vec4<f32>(further, 0.0);
}
