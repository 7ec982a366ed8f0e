// What is hoped of the places where paths from directional lights may start: most of those from which light is reflected onto
// something. Most of a sun's light falls onto roofs, and what is seen is below them.
//
// Light from each place is followed to where it is reflected, and once from there. How often that meets something is counted by the
// brick of the grid in which it is reflected: what moves meets it now and then, and changes a brick's share by little.
//
// Cost: two rays through the grid for each candidate, and two atomic additions.

#import bevy_bounce::shared::grid::{level_of, brick_at}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::rays::{grid, is_blocked, trace, to_grid, to_world, Ray}
#import bevy_bounce::shared::sampling::{sample_square, cosine_direction}
#import bevy_bounce::shared::scene::LIGHT_DIRECTIONAL
#import bevy_bounce::vpl::starts::{
    parameters, lights, bricks, candidates, source_of, choose_region, start_on_region, DIMENSION_PROMISE, PATH_GAP,
}
#import bevy_bounce::vpl::types::{CANDIDATES, BRICK_WORDS, BRICK_TRIED, BRICK_ONWARD}

// The brick that light from a place falls into, counted from 1; 0 where it meets nothing.
fn look(start: vec3<f32>, direction: vec3<f32>, candidate: u32) -> u32 {
    var ray: Ray;
    ray.origin = to_grid(start);
    ray.direction = direction;
    ray.length = 1e6;
    ray.gap = PATH_GAP;
    let lit = trace(ray);
    if !lit.found {
        return 0u;
    }
    ray.origin += direction * lit.t;
    let place = to_world(ray.origin);
    let brick = brick_at(level_of(grid, place), place);
    ray.start_normal = lit.normal;
    ray.direction = cosine_direction(ray.start_normal, sample_square(candidate, DIMENSION_PROMISE));
    atomicAdd(&bricks[brick * BRICK_WORDS + BRICK_TRIED], 1u);
    if is_blocked(ray) {
        atomicAdd(&bricks[brick * BRICK_WORDS + BRICK_ONWARD], 1u);
    }
    return brick + 1u;
}

@compute @workgroup_size(64)
fn look_ahead(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let candidate = folded_index(group) * 64u + lane;
    let path = candidate / CANDIDATES;
    if path >= parameters.path_count {
        return;
    }
    let source = source_of(path);
    if !source.found || source.is_emitter || lights[source.index].kind != LIGHT_DIRECTIONAL {
        return;
    }
    let light = lights[source.index];
    let name = source.sample * CANDIDATES + candidate % CANDIDATES;
    let start = start_on_region(light, choose_region(light, source.sample), source.sample, name);
    candidates[candidate] = look(start, light.direction, name);
}
