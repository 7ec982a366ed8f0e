// Paths from the lights through the voxel grid; every surface they are reflected by becomes a virtual point light.
// Keller 1997, Bashford-Rogers et al. 2012, III-B.
//
// A path starts at a light chosen in proportion to its power, and is reflected with the probability of the surface's albedo
// (the largest of red, green and blue), so that all virtual lights carry about the same flux, but for those of directional
// lights: see `start_directional`. Paths follow one sequence, the same every frame.
//
// Where the scene has regions (see `Scene`), paths of directional lights start in each: as many as its weight and the area that is
// lit there say, so that most are near the cameras.
//
// Cost: one thread a path; a ray through the grid a bounce, and up to sixteen before for a path from a directional light.

#import bevy_bounce::shared::grid::{Cell, grid_level, level_at, brick_at}
#import bevy_bounce::shared::lights::{range_window, spot_window, rect_area, rect_point}
#import bevy_bounce::shared::octahedral::decode_unit
#import bevy_bounce::shared::rays::{grid, cells, trace, to_grid, to_world, Ray, Hit}
#import bevy_bounce::shared::sampling::{
    sample_square, cosine_direction, cone_direction, disk_point, triangle_point, any_tangent, PI,
}
#import bevy_bounce::shared::scene::{Light, Scene, Region, projected_area, LIGHT_SPOT, LIGHT_DIRECTIONAL, LIGHT_RECT, CHUNK_TRIANGLES}
#import bevy_bounce::vpl::types::{
    Vpl, Path, Emitter, VplParameters, MET, BRICK_WORDS, BRICK_VERTICES, SETTLE_RANGE, vertex_slot, pack_incoming,
}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<uniform> scene: Scene;
@group(0) @binding(2) var<storage, read> lights: array<Light>;
@group(0) @binding(3) var<storage, read> emitters: array<Emitter>;
// Path by path, `max_bounces` + 1 slots each.
@group(0) @binding(4) var<storage, read_write> vertices: array<Vpl>;
@group(0) @binding(5) var<storage, read_write> paths: array<Path>;
// What is known of each brick of the grid, `BRICK_WORDS` each.
@group(0) @binding(6) var<storage, read_write> bricks: array<atomic<u32>>;

// Dimensions of the sequence.
const DIMENSION_LIGHT: u32 = 0u;
const DIMENSION_POSITION: u32 = 1u;
const DIMENSION_DIRECTION: u32 = 2u;
const DIMENSION_PROMISE: u32 = 3u;
const DIMENSION_CHOICE: u32 = 4u;
const DIMENSION_PATCH: u32 = 5u;
const DIMENSION_BOUNCE: u32 = 8u;

/// Places of which a path from a directional light starts at one.
const CANDIDATES: u32 = 8u;
/// Edge of the part of a moving region that they are in.
const PATCH: f32 = 0.25;
/// What is hoped of one whose light goes on into the open, and of one whose light meets nothing.
const OPEN_PROMISE: f32 = 0.1;
const LOST_PROMISE: f32 = 0.02;

// Voxels: a path starts on a plane of the grid, and in a corner another one is near.
const PATH_GAP: f32 = 0.02;

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
    on_surface: bool,
}

fn emissive_power() -> f32 {
    if scene.emissive_chunk_count == 0u {
        return 0.0;
    }
    return emitters[scene.emissive_chunk_count * CHUNK_TRIANGLES - 1u].cumulative_power;
}

// Of all directions of the sky, whose running sum begins anew.
fn sky_power() -> f32 {
    if scene.sky_count == 0u {
        return 0.0;
    }
    return lights[scene.light_count + scene.sky_count - 1u].cumulative_power;
}

// The first of some lights whose running sum lies beyond `power`.
fn find_light(power: f32, first: u32, count: u32) -> u32 {
    var low = first;
    var high = first + count - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if lights[middle].cumulative_power > power {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

fn find_emitter(power: f32) -> u32 {
    var low = 0u;
    var high = scene.emissive_chunk_count * CHUNK_TRIANGLES - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if emitters[middle].cumulative_power > power {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

// `first`: where its running sum begins.
fn start_at_light(index: u32, first: u32, path: u32, total: f32) -> Photon {
    let light = lights[index];
    var before = 0.0;
    if index > first {
        before = lights[index - 1u].cumulative_power;
    }
    let weight = total / max(light.cumulative_power - before, 1e-30);
    let square = sample_square(path, DIMENSION_DIRECTION);
    var photon: Photon;
    photon.position = light.position;
    photon.normal = vec3<f32>(0.0);
    photon.max_bounces = light.max_bounces;
    photon.on_surface = false;
    photon.center = light.position;
    photon.range = light.range;
    switch light.kind {
        case LIGHT_SPOT: {
            photon.direction = cone_direction(light.direction, square, light.spot_cos_outer);
            let solid_angle = 2.0 * PI * (1.0 - light.spot_cos_outer);
            photon.flux = light.color * (solid_angle * spot_window(light, photon.direction) * weight);
        }
        case LIGHT_DIRECTIONAL: {
            start_directional(&photon, light, path, weight);
        }
        case LIGHT_RECT: {
            photon.position = rect_point(light, sample_square(path, DIMENSION_POSITION));
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

// Projected areas of the faces of a box that are turned to a light.
fn lit_areas(region: Region, light: Light) -> vec3<f32> {
    let size = region.max - region.min;
    return size.yzx * size.zxy * abs(light.direction);
}

// The same of all regions, each with its weight.
fn weighted_area(light: Light) -> f32 {
    var sum = 0.0;
    for (var i = 0u; i < scene.region_count; i++) {
        sum += scene.regions[i].weight * projected_area(scene.regions[i], light.direction);
    }
    return sum;
}

// Sum of the weights of the regions that a line along the light goes through: of their lit areas, times this, paths have their
// starts.
fn start_density(light: Light, point: vec3<f32>) -> f32 {
    if scene.region_count == 1u {
        return scene.regions[0].weight;
    }
    let tiny = vec3<f32>(1e-6);
    let inverse = 1.0 / select(light.direction, tiny, abs(light.direction) < tiny);
    var density = 0.0;
    for (var i = 0u; i < scene.region_count; i++) {
        let a = (scene.regions[i].min - point) * inverse;
        let b = (scene.regions[i].max - point) * inverse;
        let low = min(a, b);
        let high = max(a, b);
        let is_met = max(low.x, max(low.y, low.z)) <= min(high.x, min(high.y, high.z));
        density += select(0.0, scene.regions[i].weight, is_met);
    }
    return density;
}

// The region that a path starts in, chosen in proportion to weight and lit area.
fn choose_region(light: Light, path: u32) -> u32 {
    var left = sample_square(path, DIMENSION_CHOICE).y * weighted_area(light);
    for (var i = 0u; i + 1u < scene.region_count; i++) {
        left -= scene.regions[i].weight * projected_area(scene.regions[i], light.direction);
        if left < 0.0 {
            return i;
        }
    }
    return scene.region_count - 1u;
}

// A point on a plane before one of the three faces of a region that are turned to the light, in proportion to their projected
// areas. A region that moves with the camera has its points where they are in the world: those that it leaves behind on one
// side come in on the other. There all candidates of a path are near each other, so that what comes and goes at the region's
// ends changes nothing within.
fn start_on_region(light: Light, index: u32, path: u32, candidate: u32) -> vec3<f32> {
    let region = scene.regions[index];
    let moves = index + 1u < scene.region_count;
    var square = sample_square(candidate, DIMENSION_POSITION);
    var aside = vec2<f32>(0.0);
    if moves {
        aside = (square - 0.5) * PATCH;
        square = sample_square(path, DIMENSION_PATCH);
    }
    let size = region.max - region.min;
    let areas = lit_areas(region, light);
    var pick = square.x * (areas.x + areas.y + areas.z);
    var axis = 2u;
    if pick < areas.x {
        axis = 0u;
    } else if pick < areas.x + areas.y {
        axis = 1u;
        pick -= areas.x;
    } else {
        pick -= areas.x + areas.y;
    }
    var place = vec3<f32>(0.0);
    place[axis] = select(0.0, 1.0, light.direction[axis] < 0.0);
    place[(axis + 1u) % 3u] = clamp(pick / max(areas[axis], 1e-30), 0.0, 1.0) + aside.x;
    place[(axis + 2u) % 3u] = square.y + aside.y;
    if moves {
        // Where the lines through the region's corner cross the plane through the world's origin.
        let face = region.min[axis] + place[axis] * size[axis];
        let low = region.min - light.direction * (face / light.direction[axis]);
        let kept = place[axis];
        place = fract(place - low / size);
        place[axis] = kept;
    }
    let point = region.min + place * size;
    return point - light.direction * (way_out(light, point) + grid.voxel_size);
}

// How far it is from a point against the light to the outside of all.
fn way_out(light: Light, point: vec3<f32>) -> f32 {
    let face = select(scene.bounds_min, scene.bounds_max, light.direction < vec3<f32>(0.0));
    let ways = (point - face) / select(light.direction, vec3<f32>(1e-6), abs(light.direction) < vec3<f32>(1e-6));
    let ahead = select(ways, vec3<f32>(1e30), abs(light.direction) < vec3<f32>(1e-6));
    return max(min(ahead.x, min(ahead.y, ahead.z)), 0.0);
}

// What is hoped of a path that starts there: most where its light is reflected onto something.
fn promise(start: vec3<f32>, direction: vec3<f32>, candidate: u32) -> f32 {
    var ray: Ray;
    ray.origin = to_grid(start);
    ray.direction = direction;
    ray.length = 1e6;
    ray.gap = PATH_GAP;
    let lit = trace(ray);
    if !lit.found {
        return LOST_PROMISE;
    }
    ray.origin += direction * lit.t;
    ray.start_normal = decode_unit(cells[lit.cell].normal);
    ray.direction = cosine_direction(ray.start_normal, sample_square(candidate, DIMENSION_PROMISE));
    return select(OPEN_PROMISE, 1.0, trace(ray).found);
}

// From the shadow of the regions, at one of a few places, which is chosen in proportion to what is hoped of it: most of a
// sun's light falls onto roofs, and what is seen is below them. Each path has its own few, so that those whose
// surroundings stay the same start where they did. Resampled importance sampling, Talbot et al. 2005.
fn start_directional(photon: ptr<function, Photon>, light: Light, path: u32, weight: f32) {
    let region = choose_region(light, path);
    let pick = sample_square(path, DIMENSION_CHOICE).x;
    var sum = 0.0;
    var left = pick;
    var chosen = 0.0;
    for (var i = 0u; i < CANDIDATES; i++) {
        let candidate = path * CANDIDATES + i;
        let start = start_on_region(light, region, path, candidate);
        let own = promise(start, light.direction, candidate);
        sum += own;
        // One random number serves all choices: what of it is left over by one is even again.
        let share = own / sum;
        if left < share {
            left /= share;
            chosen = own;
            (*photon).position = start;
        } else {
            left = (left - share) / (1.0 - share);
        }
    }
    (*photon).direction = light.direction;
    let mean = sum / f32(CANDIDATES);
    let area = weighted_area(light) / start_density(light, (*photon).position);
    (*photon).flux = light.color * (area * weight * mean / chosen);
}

fn start_at_emitter(index: u32, path: u32, total: f32) -> Photon {
    let emitter = emitters[index];
    var before = 0.0;
    if index > 0u {
        before = emitters[index - 1u].cumulative_power;
    }
    let weight = total / max(emitter.cumulative_power - before, 1e-30);
    let where_on = triangle_point(sample_square(path, DIMENSION_POSITION));
    let side = sample_square(path, DIMENSION_LIGHT).y;
    var photon: Photon;
    photon.position = emitter.position + emitter.edge_b * where_on.x + emitter.edge_c * where_on.y;
    photon.normal = emitter.normal * select(1.0, -1.0, emitter.two_sided != 0u && side < 0.5);
    photon.direction = cosine_direction(photon.normal, sample_square(path, DIMENSION_DIRECTION));
    photon.flux = emitter.flux * weight;
    photon.max_bounces = 0xffffffffu;
    photon.on_surface = true;
    return photon;
}

fn store(path: u32, index: u32, bounce_met: u32, photon: Photon, incoming: u32) {
    let level = grid_level(grid, level_at(grid, photon.position));
    atomicAdd(&bricks[brick_at(level, photon.position) * BRICK_WORDS + BRICK_VERTICES], 1u);
    vertices[vertex_slot(parameters, path, index)] =
        Vpl(photon.position, bounce_met, photon.normal, path, photon.flux, incoming);
}

fn follow(path: u32, start: Photon) -> u32 {
    var photon = start;
    var count = 0u;
    if photon.on_surface {
        store(path, 0u, 0u, photon, pack_incoming(-photon.normal, PATH_GAP));
        count = 1u;
    }
    let bounces = min(parameters.max_bounces, photon.max_bounces);
    for (var bounce = 1u; bounce <= bounces; bounce++) {
        var ray: Ray;
        ray.origin = to_grid(photon.position);
        ray.direction = photon.direction;
        ray.length = 1e6;
        ray.start_normal = photon.normal;
        ray.end_normal = vec3<f32>(0.0);
        ray.gap = PATH_GAP;
        let hit = trace(ray);
        if !hit.found {
            break;
        }
        if count > 0u {
            vertices[vertex_slot(parameters, path, count - 1u)].bounce_met = (bounce - 1u) | MET;
        }
        let cell = cells[hit.cell];
        let albedo = unpack4x8unorm(cell.albedo).rgb;
        let survival = max(albedo.r, max(albedo.g, albedo.b));
        let square = sample_square(path, DIMENSION_BOUNCE + 2u * bounce);
        if square.x >= survival {
            break;
        }
        photon.flux *= albedo / survival;
        photon.position = to_world(ray.origin + ray.direction * hit.t);
        if bounce == 1u {
            let way = photon.position - photon.center;
            photon.flux *= range_window(photon.range, dot(way, way));
        }
        photon.normal = decode_unit(cell.normal);
        // Where the last one's light goes is not looked at.
        let onward = select(0u, MET, bounce == bounces);
        let level = grid_level(grid, level_at(grid, photon.position));
        let way = hit.t * grid.voxel_size / level.voxel_size;
        store(path, count, bounce | onward, photon, pack_incoming(photon.direction, min(way, SETTLE_RANGE)));
        count++;
        photon.direction = cosine_direction(photon.normal, sample_square(path, DIMENSION_BOUNCE + 2u * bounce + 1u));
    }
    return count;
}

@compute @workgroup_size(64)
fn trace_paths(@builtin(global_invocation_id) id: vec3<u32>) {
    let path = id.x;
    if path >= parameters.path_count {
        return;
    }
    let emissive = emissive_power();
    let sky = sky_power();
    let total = scene.light_power + emissive + sky;
    if total <= 0.0 {
        paths[path] = Path(0u, 0u, 0u);
        return;
    }
    let pick = sample_square(path, DIMENSION_LIGHT).x * total;
    var photon: Photon;
    // By rounding it may be the whole sum: only what shines is asked.
    if sky > 0.0 && pick >= scene.light_power + emissive {
        let first = scene.light_count;
        let index = find_light(pick - scene.light_power - emissive, first, scene.sky_count);
        photon = start_at_light(index, first, path, total);
    } else if emissive > 0.0 && pick >= scene.light_power {
        photon = start_at_emitter(find_emitter(pick - scene.light_power), path, total);
    } else {
        photon = start_at_light(find_light(pick, 0u, scene.light_count), 0u, path, total);
    }
    let count = follow(path, photon);
    paths[path] = Path(count, select(1u, 0u, photon.on_surface), 0u);
}
