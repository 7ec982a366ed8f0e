// Where the light of each face of each probe is taken.
//
// What Bevy interpolates knows nothing of walls. So the values must be right for the surfaces that are lit by them:
//
// - A probe behind a surface, in a wall or under a floor, is moved before it, as far as the next probe at most. (Majercik et
//   al. 2019, "Dynamic Diffuse Global Illumination with Ray-Traced Irradiance Fields", section 5, move probes within their cell.)
// - A face whose direction a surface looks in that lies on the probe's line along that direction, no farther than the next probe,
//   takes the light of that surface, there and with its normal. Probes on both sides of a floor then know what light falls
//   onto it, and a surface aslant gets its own light from all faces that it weighs.
// - What stays behind a surface has no light of its own; `fill.wgsl` takes that of its neighbours.
//
// Cost: a thread a face; five lines at most of two spacings, one word a voxel and four more for each of its facings.

#import bevy_bounce::probes::types::{
    ProbeParameters, ProbePlace, PROBE_FACES, PLACE_BEHIND, PLACE_UNKNOWN, PLACE_OPEN, PLACE_SURFACE, PLACE_SHIFT, PROBE_MOVED,
    probe_count, probe_at, axis_unit, face_normal,
}
#import bevy_bounce::shared::grid::{
    grid_level, voxel_index, voxel_facings, cell_plane, cell_area, bounds_low, bounds_high, CELL_MASK,
}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::octahedral::{decode_unit, encode_unit_8}
#import bevy_bounce::shared::rays::{grid, voxels, cells, to_grid, to_world, BOUNDS_SLACK}

@group(0) @binding(0) var<uniform> parameters: ProbeParameters;
@group(0) @binding(1) var<storage, read_write> places: array<ProbePlace>;

/// Cosine between a line and a normal below which the surface is along the line, not across it.
const ACROSS: f32 = 0.4;
/// Share of the way to the next probe by which a probe that is moved comes to lie before the surface. Nearer, the lights on what
/// meets the surface there would be too far apart to show that as a surface.
const BEFORE: f32 = 0.5;
/// Voxels by which what hides a probe must be nearer than what it sees: where a sheet has two sides, the one before it counts.
const MARGIN: f32 = 0.5;
/// Times a probe is moved: out of a wall, and out of what stands at the wall.
const MOVES: u32 = 2u;

// Where a line meets a surface.
struct Met {
    found: bool,
    // Voxels along the line, in either direction.
    t: f32,
    normal: vec3<f32>,
}

// The nearest surfaces on a line through a point to both sides: one that looks along the line, and one that looks against it.
struct Line {
    along: Met,
    against: Met,
}

fn meet(at: vec3<f32>, axis: u32, reach: f32) -> Line {
    let line = axis_unit(axis);
    var nearest: Line;
    nearest.along = Met(false, reach, line);
    nearest.against = Met(false, reach, -line);
    let own = floor(at);
    let dims = vec3<f32>(grid.dims);
    if any(((own < vec3<f32>(0.0)) | (own >= dims)) & (line == vec3<f32>(0.0))) {
        return nearest;
    }
    let first = max(i32(floor(at[axis] - reach)), 0);
    let end = min(i32(floor(at[axis] + reach)) + 1, i32(grid.dims[axis]));
    for (var i = first; i < end; i++) {
        let voxel = select(own, vec3<f32>(f32(i)), line == vec3<f32>(1.0));
        let word = voxels[voxel_index(grid_level(grid, 0u), vec3<i32>(voxel))];
        let count = countOneBits(voxel_facings(word));
        for (var facing = 0u; facing < count; facing++) {
            let cell = cells[(word & CELL_MASK) + facing];
            let normal = decode_unit(cell.normal);
            let slope = normal[axis];
            if abs(slope) < ACROSS || cell_area(cell) <= 0.0 {
                continue;
            }
            let t = (cell_plane(cell) - dot(normal, at - voxel - 0.5)) / slope;
            let place = at + line * t - voxel;
            if any(place < bounds_low(cell.bounds) - BOUNDS_SLACK) || any(place > bounds_high(cell.bounds) + BOUNDS_SLACK) {
                continue;
            }
            if slope > 0.0 && abs(t) < abs(nearest.along.t) {
                nearest.along = Met(true, t, normal);
            }
            if slope < 0.0 && abs(t) < abs(nearest.against.t) {
                nearest.against = Met(true, t, normal);
            }
        }
    }
    return nearest;
}

// How far a point is from what hides it and from what it is before, voxels; and the way out.
struct Surroundings {
    behind: f32,
    before: f32,
    way_out: vec3<f32>,
    // To keep clear of what it is before.
    aside: vec3<f32>,
}

fn look_around(at: vec3<f32>, reach: f32) -> Surroundings {
    let nowhere = 2.0 * reach + 2.0 * MARGIN;
    var around = Surroundings(nowhere, nowhere, vec3<f32>(0.0), vec3<f32>(0.0));
    let clearance = BEFORE * reach;
    for (var axis = 0u; axis < 3u; axis++) {
        let line = meet(at, axis, reach);
        for (var side = 0u; side < 2u; side++) {
            var met = line.along;
            var facing = axis_unit(axis);
            if side == 1u {
                met = line.against;
                facing = -facing;
            }
            // Of a surface that looks along the line, the point is before it where it lies farther along.
            let height = -met.t * facing[axis];
            if met.found && height >= 0.0 {
                around.before = min(around.before, height);
                around.aside += facing * max(clearance - height, 0.0);
            } else if met.found && -height < around.behind {
                around.behind = -height;
                around.way_out = facing * (clearance - height);
            }
        }
    }
    return around;
}

@compute @workgroup_size(64)
fn place(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = folded_index(group) * 64u + lane;
    let count = probe_count(parameters);
    if entry >= count * PROBE_FACES {
        return;
    }
    let face = entry / count;
    let probe = vec3<f32>(probe_at(parameters, entry % count));
    let reach = parameters.spacing / grid.voxel_size;
    var at = to_grid(parameters.origin + (probe + 0.5) * parameters.spacing);
    var around = look_around(at, reach);
    let moved = select(0u, PROBE_MOVED, around.behind + MARGIN < around.before);
    for (var i = 0u; i < MOVES && around.behind + MARGIN < around.before; i++) {
        at += around.way_out;
        around = look_around(at, reach);
    }
    let is_behind = around.behind + MARGIN < around.before;
    at += around.aside;
    var kind = select(select(PLACE_UNKNOWN, PLACE_OPEN, around.before <= reach), PLACE_BEHIND, is_behind);

    let line = meet(at, face / 2u, reach);
    var own = line.along;
    if (face & 1u) == 1u {
        own = line.against;
    }
    var normal = face_normal(face);
    if own.found {
        at += axis_unit(face / 2u) * own.t;
        normal = own.normal;
        kind = PLACE_SURFACE;
    }
    places[entry] = ProbePlace(to_world(at), moved | (kind << PLACE_SHIFT) | encode_unit_8(normal));
}
