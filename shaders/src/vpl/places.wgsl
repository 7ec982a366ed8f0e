// Where virtual lights are: `file_lights` files each under its brick, so that triangles find those near them (`settle.wgsl`);
// `set_lights` sets it on what its path met.
//
// Cost: one thread a light.

#import bevy_bounce::shared::grid::{Grid, grid_level, level_at, brick_at}
#import bevy_bounce::vpl::types::{
    Vpl, VplHeader, MET, BRICK_WORDS, BRICK_FIRST, MEETING_WORDS, MEETING_NONE, incoming_direction, incoming_reach,
    meeting_distance, meeting_normal,
}

@group(0) @binding(0) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read> header: VplHeader;
@group(0) @binding(2) var<storage, read_write> vpls: array<Vpl>;
// What is known of each brick of the grid, `BRICK_WORDS` each.
@group(0) @binding(3) var<storage, read_write> bricks: array<atomic<u32>>;
// `MEETING_WORDS` a light: the nearest meeting, the next light of its brick.
@group(0) @binding(4) var<storage, read_write> meetings: array<u32>;

@compute @workgroup_size(64)
fn file_lights(@builtin(global_invocation_id) id: vec3<u32>) {
    let light = id.x;
    if light >= header.count {
        return;
    }
    let vpl = vpls[light];
    meetings[light * MEETING_WORDS] = MEETING_NONE;
    // What lies on an emissive triangle is where it belongs.
    if (vpl.bounce_met & ~MET) != 0u {
        let brick = brick_at(grid_level(grid, level_at(grid, vpl.position)), vpl.position);
        meetings[light * MEETING_WORDS + 1u] = atomicExchange(&bricks[brick * BRICK_WORDS + BRICK_FIRST], light + 1u);
    }
}

@compute @workgroup_size(64)
fn set_lights(@builtin(global_invocation_id) id: vec3<u32>) {
    let light = id.x;
    if light >= header.count || meetings[light * MEETING_WORDS] == MEETING_NONE {
        return;
    }
    let meeting = meetings[light * MEETING_WORDS];
    let incoming = vpls[light].incoming;
    let level = grid_level(grid, level_at(grid, vpls[light].position));
    let way = (meeting_distance(meeting) - incoming_reach(incoming)) * level.voxel_size;
    vpls[light].position += incoming_direction(incoming) * way;
    vpls[light].normal = meeting_normal(meeting);
}
