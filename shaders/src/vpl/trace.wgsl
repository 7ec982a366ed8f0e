// Paths from the lights through the voxel grid; every surface they are reflected by becomes a virtual point light.
// Keller 1997, Bashford-Rogers et al. 2012, III-B.
//
// Lights share the paths by power (`starts.wgsl`); a path is reflected with the probability of the surface's albedo
// (the largest of red, green and blue; `places.wgsl`), so that all virtual lights carry about the same flux, but for those of directional
// lights: see `start_directional`. The paths of a light follow a sequence of its own, the same every frame.
//
// Where the scene has regions (see `Scene`), paths of directional lights start in each: as many as its weight and the area that is
// lit there say, so that most are near the cameras.
//
// A dispatch of `trace_paths` is a bounce: between two of them vertices are set on the triangles that paths met
// (`settle.wgsl`), near where they met the grid and near where they started, and light goes on from there. Between the
// planes of voxels it would come into closed things, and light them from within instead of what is near it.
//
// Cost: one thread a path, after the first bounce one that goes on; a ray through the grid a bounce, and 24 loads for a path from a
// directional light.

#import bevy_bounce::shared::lights::{range_window, spot_window, rect_area, rect_point}
#import bevy_bounce::shared::rays::{grid, trace, to_grid, to_world, Ray}
#import bevy_bounce::shared::sampling::{
    sample_square, waiting_time, cosine_direction, cone_direction, triangle_point, PI,
}
#import bevy_bounce::shared::scene::{Light, LIGHT_SPOT, LIGHT_DIRECTIONAL, LIGHT_RECT}
#import bevy_bounce::vpl::starts::{
    parameters, lights, emitters, bricks, candidates, Source, source_of, choose_region, start_on_region, start_density,
    weighted_area, DIMENSION_LIGHT, DIMENSION_POSITION, DIMENSION_DIRECTION, PATH_GAP,
}
#import bevy_bounce::vpl::types::{
    Vpl, Path, MET, UNSETTLED, NO_CELL, DIMENSION_BOUNCE, BRICK_WORDS, BRICK_TRIED, BRICK_ONWARD, CANDIDATES, SETTLE_RANGE,
    NO_PATH, START, vertex_slot, settle_level, pack_incoming,
}

// Path by path, `max_bounces` + 1 slots each.
@group(0) @binding(6) var<storage, read_write> vertices: array<Vpl>;
@group(0) @binding(7) var<storage, read_write> paths: array<Path>;

/// Voxels from a surface at which rays through the grid start. What is nearer is met by its triangles, as is what is a little farther:
/// planes of voxels lie before and behind what they stand for.
const GRID_START: f32 = 1.0;

/// What is hoped of a place whose light goes on into the open, and of one whose light meets nothing.
const OPEN_PROMISE: f32 = 0.1;
const LOST_PROMISE: f32 = 0.02;

// Light on its way.
struct Photon {
    position: vec3<f32>,
    // Of the surface it leaves; zero in the air.
    normal: vec3<f32>,
    direction: vec3<f32>,
    // Lumens.
    flux: vec3<f32>,
    // Of the light, and how far from it the light ends; 0 for no end.
    center: vec3<f32>,
    range: f32,
    max_bounces: u32,
}

fn start_at_light(source: Source, path: u32) -> Photon {
    let light = lights[source.index];
    let weight = source.weight;
    let square = sample_square(source.sample, DIMENSION_DIRECTION);
    var photon: Photon;
    photon.position = light.position;
    photon.normal = vec3<f32>(0.0);
    photon.max_bounces = light.max_bounces;
    photon.center = light.position;
    photon.range = light.range;
    switch light.kind {
        case LIGHT_SPOT: {
            photon.direction = cone_direction(light.direction, square, light.spot_cos_outer);
            let solid_angle = 2.0 * PI * (1.0 - light.spot_cos_outer);
            photon.flux = light.color * (solid_angle * spot_window(light, photon.direction) * weight);
        }
        case LIGHT_DIRECTIONAL: {
            start_directional(&photon, source, path);
        }
        case LIGHT_RECT: {
            photon.position = rect_point(light, sample_square(source.sample, DIMENSION_POSITION));
            photon.normal = light.direction;
            photon.direction = cosine_direction(light.direction, square);
            photon.flux = light.color * (PI * rect_area(light) * weight);
        }
        default: {
            photon.direction = cone_direction(vec3<f32>(0.0, 0.0, 1.0), square, -1.0);
            photon.flux = light.color * (4.0 * PI * weight);
        }
    }
    return photon;
}

// What is hoped of a place from which light falls into that brick.
fn promise(brick: u32) -> f32 {
    if brick == 0u {
        return LOST_PROMISE;
    }
    let first = (brick - 1u) * BRICK_WORDS;
    let onward = f32(atomicLoad(&bricks[first + BRICK_ONWARD])) / max(f32(atomicLoad(&bricks[first + BRICK_TRIED])), 1.0);
    return mix(OPEN_PROMISE, 1.0, onward);
}

// From the shadow of the regions, at one of a few places, which is chosen in proportion to what is hoped of it
// (`look_ahead.wgsl`). Each path has its own few, so that those whose surroundings stay the same start where they did. Resampled
// importance sampling, Talbot et al. 2005.
fn start_directional(photon: ptr<function, Photon>, source: Source, path: u32) {
    let light = lights[source.index];
    var sum = 0.0;
    var least = 1e38;
    var candidate = 0u;
    var chosen = 1.0;
    for (var i = 0u; i < CANDIDATES; i++) {
        let own = promise(candidates[path * CANDIDATES + i]);
        sum += own;
        let name = source.sample * CANDIDATES + i;
        let wait = waiting_time(name, own);
        if wait < least {
            least = wait;
            candidate = name;
            chosen = own;
        }
    }
    let region = choose_region(light, source.sample);
    (*photon).position = start_on_region(light, region, source.sample, candidate);
    (*photon).direction = light.direction;
    let mean = sum / f32(CANDIDATES);
    let area = weighted_area(light) / start_density(light, (*photon).position, region);
    (*photon).flux = light.color * (area * source.weight * mean / chosen);
}

fn start_at_emitter(source: Source) -> Photon {
    let emitter = emitters[source.index];
    let where_on = triangle_point(sample_square(source.sample, DIMENSION_POSITION));
    let side = sample_square(source.sample, DIMENSION_LIGHT).y;
    var photon: Photon;
    photon.position = emitter.position + emitter.edge_b * where_on.x + emitter.edge_c * where_on.y;
    photon.normal = emitter.normal * select(1.0, -1.0, emitter.two_sided != 0u && side < 0.5);
    photon.direction = cosine_direction(photon.normal, sample_square(source.sample, DIMENSION_DIRECTION));
    photon.flux = emitter.flux * source.weight;
    photon.max_bounces = 0xffffffffu;
    return photon;
}

fn store(slot: u32, bounce_met: u32, photon: Photon, sample: u32, incoming: u32) {
    vertices[slot] = Vpl(photon.position, bounce_met, photon.normal, sample, photon.flux, incoming);
}

// To where the grid is met; `left`: bounces that are left to the path.
fn follow(path: u32, sample: u32, start: Photon, left: u32) {
    let count = paths[path].length;
    let from_surface = count > 0u;
    paths[path].first = 0u;
    if left == 0u {
        return;
    }
    var photon = start;
    let skipped = select(0.0, GRID_START * settle_level(grid, photon.position).voxel_size, from_surface);
    var ray: Ray;
    ray.origin = to_grid(photon.position + photon.direction * skipped);
    ray.direction = photon.direction;
    ray.length = 1e6;
    // A voxel off, no surface is its own.
    ray.start_normal = select(photon.normal, vec3<f32>(0.0), from_surface);
    ray.end_normal = vec3<f32>(0.0);
    ray.gap = PATH_GAP;
    let hit = trace(ray);
    if !hit.found && !from_surface {
        return;
    }
    var cell = NO_CELL;
    if hit.found {
        cell = hit.cell;
        photon.position = to_world(ray.origin + ray.direction * hit.t);
        photon.normal = hit.normal;
    }
    if !from_surface {
        let way = photon.position - photon.center;
        photon.flux *= range_window(photon.range, dot(way, way));
    }
    let way = hit.t * grid.voxel_size / settle_level(grid, photon.position).voxel_size;
    let incoming = pack_incoming(photon.direction, min(way, SETTLE_RANGE));
    store(vertex_slot(parameters, path, count), cell, photon, sample, incoming);
    paths[path].first = left | UNSETTLED;
}

// Where a path begins: at a light, or at an emitter, which is its first vertex.
fn start(path: u32, source: Source) -> Photon {
    if !source.is_emitter {
        return start_at_light(source, path);
    }
    let photon = start_at_emitter(source);
    store(vertex_slot(parameters, path, 0u), 0u, photon, source.sample, pack_incoming(-photon.normal, PATH_GAP));
    paths[path].length = 1u;
    paths[path].first_bounce = 0u;
    return photon;
}

// Where it goes on: from the surface that its last vertex was set on.
fn go_on(vertex: Vpl) -> Photon {
    let square = sample_square(vertex.sample, DIMENSION_BOUNCE + 2u * (vertex.bounce_met & ~MET) + 1u);
    var photon: Photon;
    photon.position = vertex.position;
    photon.normal = vertex.normal;
    photon.direction = cosine_direction(vertex.normal, square);
    photon.flux = vertex.flux;
    return photon;
}

// A bounce of each path that goes on. One kernel for the first and all others: rays are much code.
@compute @workgroup_size(64)
fn trace_paths(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= parameters.path_count {
        return;
    }
    let path = paths[id.x].alive;
    if path == NO_PATH {
        return;
    }
    var left = paths[path].first;
    var photon: Photon;
    var sample = 0u;
    if left == START {
        let source = source_of(path);
        left = 0u;
        if source.found {
            photon = start(path, source);
            sample = source.sample;
            left = min(parameters.max_bounces, photon.max_bounces);
        }
    } else {
        let vertex = vertices[vertex_slot(parameters, path, paths[path].length - 1u)];
        photon = go_on(vertex);
        sample = vertex.sample;
    }
    follow(path, sample, photon, left);
}
