// Triangles into the voxel grid. Bashford-Rogers et al. 2012, III-A, in compute.
//
// Runs twice over all triangles. The first run marks which facings of which voxels are touched; after the scan has given
// each of them a cell, the second (`ACCUMULATE`) adds to it the triangle's area within the voxel, and albedo, normal and
// position weighted by it, and widens the bounds of what is there; albedo once more, with the weight that it has where surfaces
// hide each other (`cells.wgsl`). Where the paper shifts vertices, steps through slices and enlarges small triangles, so that the
// rasteriser leaves no hole, an exact triangle-box test (Akenine-Moeller 2001) finds every voxel touched. Sums are integers: the
// order in which threads come does not show. With `EMISSION` the second run adds what shines, over the emissive triangles alone:
// emitted light, as a part of the brightest in the scene, weighted by area. Of masked surfaces the area is that which is there.
//
// Of nested grids each takes all triangles in turn, one dispatch for all: `level` is the one that a workgroup works for, and
// positions are in its voxels.
//
// A thread takes a triangle; one whose box holds more than INLINE_VOXELS goes to the queue as bricks of 8^3 voxels, a
// workgroup each. Where the queue is full the thread goes on by itself. Threads look for the next voxel touched each on
// its own and clip together: a voxel that is only tested costs no clip.
//
// Cost: a test of about 60 operations for each voxel that the plane reaches within the triangle's box, a clip of about 500 a
// voxel touched in the second run, where the triangle is masked 500 more and up to 16 looks at the mask. A thread of a brick takes the
// column across the triangle, so that all have about as much.

#import bevy_bounce::avg::queue::{QueueEntry, enqueue, queue_entry}
#import bevy_bounce::shared::chunks::triangle_of
#import bevy_bounce::shared::columns::{turn, turn_voxel, turn_back, column_axis}
#import bevy_bounce::shared::grid::{
    Grid, GridLevel, grid_level, level_of_brick, brick_index, brick_place, voxel_index, voxel_facings, cell_index, facing_of,
    CELL_BITS, AREA_ONE, BOUND_ONE, SUM_WORDS, SUM_MASKED, SUM_FRONT,
}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::overlap::{touches_cube, box_low, box_high}
#import bevy_bounce::shared::sampling::triangle_point
#import bevy_bounce::shared::scene::{Scene, CHUNK_TRIANGLES}
#import bevy_bounce::shared::triangles::{Triangle, surface_albedo, surface_emission, surface_cover, is_masked}

@group(0) @binding(4) var<uniform> grid: Grid;
@group(0) @binding(5) var<uniform> scene: Scene;
// Bindings 6 and 7: chunks, the queue.
#ifdef ACCUMULATE
@group(0) @binding(8) var<storage, read> voxels: array<u32>;
#ifdef EMISSION
// Red, green, blue of each cell, fixed point: 1 is the brightest emission of the scene over one voxel face.
@group(0) @binding(9) var<storage, read_write> emission_sums: array<atomic<u32>>;
#else
@group(0) @binding(9) var<storage, read_write> sums: array<atomic<i32>>;
#endif
#else
@group(0) @binding(8) var<storage, read_write> voxels: array<atomic<u32>>;
#endif

var<private> level: GridLevel;

const INLINE_VOXELS: u32 = 128u;
const BRICK: i32 = 8;
/// Places of a masked triangle at which its mask is looked at.
const MASK_PLACES: u32 = 16u;
/// How much more a surface counts there than one a voxel behind it, as a power of two.
const FRONT_OCTAVES: f32 = 8.0;
// Voxels; covers the rounding of the positions, so that a face on a boundary marks both sides.
const SLACK: f32 = 1e-4;
// Voxels; covers the rounding of the plane's height over a column. The test of each voxel decides.
const COLUMN_SLACK: f32 = 0.01;

#ifdef ACCUMULATE
// The part of a triangle within a voxel; positions from the voxel's centre.
struct Part {
    // Voxel faces.
    area: f32,
    centroid: vec3<f32>,
    low: vec3<f32>,
    high: vec3<f32>,
    // Share that is there, where it is masked; it is part of the area.
    cover: f32,
}

// An edge of that part, counterclockwise about the normal: Green's theorem about a point of the plane.
fn add_edge(part: ptr<function, Part>, p: vec3<f32>, q: vec3<f32>, normal: vec3<f32>, pivot: vec3<f32>) {
    let area = 0.5 * dot(normal, cross(p - pivot, q - pivot));
    (*part).area += area;
    (*part).centroid += area * (pivot + p + q) / 3.0;
    (*part).low = min((*part).low, min(p, q));
    (*part).high = max((*part).high, max(p, q));
}

// Where along a segment it is within the voxel. Liang & Barsky 1984.
fn clip_segment(p: vec3<f32>, d: vec3<f32>) -> vec2<f32> {
    let inverse = select(1.0 / d, vec3<f32>(1e20), abs(d) < vec3<f32>(1e-12));
    let a = (-0.5 - p) * inverse;
    let b = (0.5 - p) * inverse;
    let low = min(a, b);
    let high = max(a, b);
    return vec2<f32>(max(max(low.x, low.y), max(low.z, 0.0)), min(min(high.x, high.y), min(high.z, 1.0)));
}

fn add_triangle_edge(part: ptr<function, Part>, p: vec3<f32>, q: vec3<f32>, normal: vec3<f32>, pivot: vec3<f32>) {
    let t = clip_segment(p, q - p);
    if t.x < t.y {
        add_edge(part, mix(p, q, t.x), mix(p, q, t.y), normal, pivot);
    }
}

// The edge where the triangle leaves the voxel through one face; `outward` is the face's normal.
fn add_face_edge(
    part: ptr<function, Part>,
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    outward: vec3<f32>,
    normal: vec3<f32>,
    pivot: vec3<f32>,
) {
    let da = dot(a, outward) - 0.5;
    let db = dot(b, outward) - 0.5;
    let dc = dot(c, outward) - 0.5;
    let crosses_ab = (da < 0.0) != (db < 0.0);
    let crosses_bc = (db < 0.0) != (dc < 0.0);
    let crosses_ca = (dc < 0.0) != (da < 0.0);
    if !(crosses_ab || crosses_bc || crosses_ca) {
        return;
    }
    let on_bc = mix(b, c, db / select(db - dc, 1.0, db == dc));
    let p = select(on_bc, mix(a, b, da / select(da - db, 1.0, da == db)), crosses_ab);
    let q = select(on_bc, mix(c, a, dc / select(dc - da, 1.0, dc == da)), crosses_ca);
    // Within the face, whatever rounding did across it.
    let along = 1.0 - abs(outward);
    let t = clip_segment(p * along, (q - p) * along);
    if t.x >= t.y {
        return;
    }
    let forward = dot(q - p, cross(normal, outward)) >= 0.0;
    let from_t = select(t.y, t.x, forward);
    let to_t = select(t.x, t.y, forward);
    add_edge(part, mix(p, q, from_t), mix(p, q, to_t), normal, pivot);
}

fn clip_to_voxel(t: Triangle, center: vec3<f32>) -> Part {
    let a = t.a - center;
    let b = t.b - center;
    let c = t.c - center;
    // Of the winding, whichever side is seen.
    let normal = normalize(cross(b - a, c - a));
    let nearest = normal * dot(normal, a);
    var part = Part(0.0, vec3<f32>(0.0), vec3<f32>(0.5), vec3<f32>(-0.5), 1.0);
    add_triangle_edge(&part, a, b, normal, nearest);
    add_triangle_edge(&part, b, c, normal, nearest);
    add_triangle_edge(&part, c, a, normal, nearest);
    if any(min(a, min(b, c)) < vec3<f32>(-0.5)) || any(max(a, max(b, c)) > vec3<f32>(0.5)) {
        add_face_edge(&part, a, b, c, vec3<f32>(1.0, 0.0, 0.0), normal, nearest);
        add_face_edge(&part, a, b, c, vec3<f32>(-1.0, 0.0, 0.0), normal, nearest);
        add_face_edge(&part, a, b, c, vec3<f32>(0.0, 1.0, 0.0), normal, nearest);
        add_face_edge(&part, a, b, c, vec3<f32>(0.0, -1.0, 0.0), normal, nearest);
        add_face_edge(&part, a, b, c, vec3<f32>(0.0, 0.0, 1.0), normal, nearest);
        add_face_edge(&part, a, b, c, vec3<f32>(0.0, 0.0, -1.0), normal, nearest);
    }
    if part.area < 1.0 / AREA_ONE {
        // Touched, no more: the nearest point of the plane stands for it.
        let point = clamp(nearest, vec3<f32>(-0.5), vec3<f32>(0.5));
        let low = clamp(min(part.low, point), vec3<f32>(-0.5), point);
        let high = clamp(max(part.high, point), point, vec3<f32>(0.5));
        return Part(0.0, point, low, high, 1.0);
    }
    part.centroid = clamp(part.centroid / part.area, vec3<f32>(-0.5), vec3<f32>(0.5));
    return part;
}

#ifdef EMISSION
fn add(cell: u32, part: Part, emission: vec3<f32>, normal: vec3<f32>) {
    let weight = max(part.area * AREA_ONE, 1.0);
    let e = vec3<u32>(round(clamp(emission / max(scene.max_emission, 1e-30), vec3<f32>(0.0), vec3<f32>(1.0)) * weight));
    atomicAdd(&emission_sums[cell * 3u], e.x);
    atomicAdd(&emission_sums[cell * 3u + 1u], e.y);
    atomicAdd(&emission_sums[cell * 3u + 2u], e.z);
}
#else
// How much a surface counts where surfaces of a voxel hide each other: the more, the farther its plane is before the
// voxel's middle, voxels. One plane counts alike in all its parts, however it is tilted.
fn front_share(plane: f32) -> f32 {
    return exp2(FRONT_OCTAVES * (plane - 0.5 * sqrt(3.0)));
}

fn add(cell: u32, part: Part, albedo: vec3<f32>, normal: vec3<f32>) {
    let o = cell * SUM_WORDS;
    let weight = max(part.area * AREA_ONE, 1.0);
    let a = vec3<i32>(round(albedo * weight));
    let n = vec3<i32>(round(normal * weight));
    let p = vec3<i32>(round(part.centroid * weight));
    let front_weight = max(weight * front_share(dot(normal, part.centroid)), 1.0);
    let front = vec3<i32>(round(albedo * front_weight));
    let low = vec3<i32>(ceil((0.5 - part.low) * BOUND_ONE));
    let high = vec3<i32>(ceil((0.5 + part.high) * BOUND_ONE));
    atomicAdd(&sums[o], i32(weight));
    atomicAdd(&sums[o + 1u], a.x);
    atomicAdd(&sums[o + 2u], a.y);
    atomicAdd(&sums[o + 3u], a.z);
    atomicAdd(&sums[o + 4u], n.x);
    atomicAdd(&sums[o + 5u], n.y);
    atomicAdd(&sums[o + 6u], n.z);
    atomicAdd(&sums[o + 7u], p.x);
    atomicAdd(&sums[o + 8u], p.y);
    atomicAdd(&sums[o + 9u], p.z);
    atomicMax(&sums[o + 10u], low.x);
    atomicMax(&sums[o + 11u], low.y);
    atomicMax(&sums[o + 12u], low.z);
    atomicMax(&sums[o + 13u], high.x);
    atomicMax(&sums[o + 14u], high.y);
    atomicMax(&sums[o + 15u], high.z);
    if part.cover < 1.0 {
        atomicAdd(&sums[o + SUM_MASKED], i32(weight));
    }
    atomicAdd(&sums[o + SUM_FRONT], i32(front_weight));
    atomicAdd(&sums[o + SUM_FRONT + 1u], front.x);
    atomicAdd(&sums[o + SUM_FRONT + 2u], front.y);
    atomicAdd(&sums[o + SUM_FRONT + 3u], front.z);
}
#endif

// Albedo times the share of the surface that is there, and that share.
fn masked_albedo(t: Triangle, p: vec3<f32>) -> vec4<f32> {
    let cover = surface_cover(t, p);
    return vec4<f32>(surface_albedo(t, p) * cover, cover);
}

// Albedo of a part of a triangle, and the share of it that is there: where it is masked, by those of the triangle's `MASK_PLACES` that lie
// in the voxel. They follow the sequence R2 (Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences").
fn part_albedo(t: Triangle, center: vec3<f32>, part: Part) -> vec4<f32> {
    let middle = center + part.centroid;
    if !is_masked(t) {
        return vec4<f32>(surface_albedo(t, middle), 1.0);
    }
    var sum = vec4<f32>(0.0);
    var count = 0.0;
    for (var i = 0u; i < MASK_PLACES; i++) {
        let weights = triangle_point(fract((f32(i) + 0.5) * vec2<f32>(0.75487767, 0.56984029)));
        let place = t.a + (t.b - t.a) * weights.x + (t.c - t.a) * weights.y;
        if all(abs(place - center) <= vec3<f32>(0.5)) {
            sum += masked_albedo(t, place);
            count += 1.0;
        }
    }
    if count == 0.0 {
        sum = masked_albedo(t, middle);
        count = 1.0;
    }
    return vec4<f32>(sum.rgb / max(sum.a, 1e-6), sum.a / count);
}

fn add_side(voxel: vec3<i32>, part: Part, color: vec3<f32>, normal: vec3<f32>) {
    let word = voxels[voxel_index(level, voxel)];
    let facing = facing_of(normal);
    if (voxel_facings(word) & (1u << facing)) != 0u {
        add(cell_index(word, facing), part, color, normal);
    }
}
#endif

// What a triangle does to a voxel that it touches.
fn visit(t: Triangle, voxel: vec3<i32>) {
#ifdef ACCUMULATE
    let center = vec3<f32>(voxel) + 0.5;
    var part = clip_to_voxel(t, center);
    let albedo = part_albedo(t, center, part);
    if albedo.a <= 0.0 {
        return;
    }
    part.cover = albedo.a;
    part.area *= albedo.a;
#ifdef EMISSION
    let color = surface_emission(t, center + part.centroid);
#else
    let color = albedo.rgb;
#endif
    add_side(voxel, part, color, t.normal);
    if t.two_sided {
        add_side(voxel, part, color, -t.normal);
    }
#else
    var facings = 1u << facing_of(t.normal);
    if t.two_sided {
        facings |= 1u << facing_of(-t.normal);
    }
    atomicOr(&voxels[voxel_index(level, voxel)], facings << CELL_BITS);
#endif
}

// First and last voxel between two of a column along `axis`, in turned axes, that the triangle's plane reaches: three at most.
fn column_range(t: Triangle, axis: u32, column: vec2<i32>, low: i32, high: i32) -> vec2<i32> {
    let a = turn(t.a, axis);
    let n = turn(t.normal, axis);
    let slope = n.xy / n.z;
    let height = a.z - dot(slope, vec2<f32>(column) + 0.5 - a.xy);
    let reach = 0.5 * (abs(slope.x) + abs(slope.y)) + COLUMN_SLACK;
    return vec2<i32>(floor(vec2<f32>(
        clamp(height - reach, f32(low), f32(high) + 1.0),
        clamp(height + reach, f32(low) - 1.0, f32(high)),
    )));
}

// The voxels touched between two corners, in turned axes.
fn visit_columns(t: Triangle, axis: u32, low: vec3<i32>, high: vec3<i32>) {
    let width = high.x - low.x + 1;
    let columns = width * (high.y - low.y + 1);
    var column = 0;
    var place = low;
    var last = low.z - 1;
    loop {
        var voxel = vec3<i32>(0);
        var found = false;
        loop {
            if place.z > last {
                if column >= columns {
                    break;
                }
                place = vec3<i32>(low.x + column % width, low.y + column / width, 0);
                column++;
                let range = column_range(t, axis, place.xy, low.z, high.z);
                place.z = range.x;
                last = range.y;
                continue;
            }
            voxel = turn_back(place, axis);
            place.z++;
            found = touches_cube(t, vec3<f32>(voxel) + 0.5, 0.5 + SLACK);
            if found {
                break;
            }
        }
        if !found {
            break;
        }
        visit(t, voxel);
    }
}

fn visit_box(t: Triangle, low: vec3<i32>, high: vec3<i32>) {
    let axis = column_axis(t.normal);
    visit_columns(t, axis, turn_voxel(low, axis), turn_voxel(high, axis));
}

fn enqueue_bricks(t: Triangle, triangle: u32, low: vec3<i32>, high: vec3<i32>) {
    let first = low / BRICK;
    let last = high / BRICK;
    for (var z = first.z; z <= last.z; z++) {
        for (var y = first.y; y <= last.y; y++) {
            for (var x = first.x; x <= last.x; x++) {
                let brick = vec3<i32>(x, y, z);
                let center = (vec3<f32>(brick) + 0.5) * f32(BRICK);
                if !touches_cube(t, center, 0.5 * f32(BRICK) + SLACK) {
                    continue;
                }
                if !enqueue(QueueEntry(triangle, brick_index(level, vec3<u32>(brick)))) {
                    visit_box(t, max(brick * BRICK, low), min(brick * BRICK + (BRICK - 1), high));
                }
            }
        }
    }
}

@compute @workgroup_size(64)
fn triangles(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group);
#ifdef EMISSION
    let count = scene.world_emissive_chunk_count;
#else
    let count = scene.world_chunk_count;
#endif
    if index >= count * (grid.further_count + 1u) {
        return;
    }
    level = grid_level(grid, index / count);
    let triangle = index % count * CHUNK_TRIANGLES + lane;
    let t = triangle_of(triangle, level);
    if !t.valid {
        return;
    }
    let low = box_low(t, SLACK);
    let high = box_high(t, SLACK, level.dims);
    if any(low > high) {
        return;
    }
    let extent = vec3<u32>(high - low + 1);
    if extent.x * extent.y * extent.z > INLINE_VOXELS {
        enqueue_bricks(t, triangle, low, high);
    } else {
        visit_box(t, low, high);
    }
}

@compute @workgroup_size(64)
fn bricks(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = queue_entry(group.x);
    level = grid_level(grid, level_of_brick(grid, entry.brick));
    let t = triangle_of(entry.triangle, level);
    let brick = vec3<i32>(brick_place(level, entry.brick));
    let axis = column_axis(t.normal);
    let corner = turn_voxel(brick * BRICK, axis);
    let column = corner.xy + vec2<i32>(i32(lane & 7u), i32(lane >> 3u));
    let low = turn_voxel(box_low(t, SLACK), axis);
    let high = turn_voxel(box_high(t, SLACK, level.dims), axis);
    if any(column < low.xy) || any(column > high.xy) {
        return;
    }
    let bottom = vec3<i32>(column, max(corner.z, low.z));
    visit_columns(t, axis, bottom, vec3<i32>(column, min(corner.z + (BRICK - 1), high.z)));
}
