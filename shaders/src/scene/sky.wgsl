// The sky as a number of directional lights. Three quarters of their directions are drawn in proportion to the light that comes from
// them and the rest evenly, so that every surface faces some, whatever is bright: one from each of as many equal stretches along
// a curve that fills the sphere. Every n-th of them is spread like all of them. Hesterberg 1995, "Weighted Average Importance
// Sampling and Defensive Mixture Distributions".
//
// `measure` makes means of a cube map, over the texels of an octahedral map; `choose` draws directions from these. The
// octahedral map is a projection onto an octahedron, so that a patch of area A there has a solid angle of A / r^3.
//
// Cost: `measure` takes samples^2 filtered loads a texel of the table, when the sky becomes another; `choose` is one workgroup
// with four texels a thread.

#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::octahedral::octahedral_to_unit
#import bevy_bounce::shared::sampling::{sample_square, PI}
#import bevy_bounce::shared::scene::{Light, Scene, projected_area, LIGHT_DIRECTIONAL}
#import bevy_bounce::shared::sky::{Sky, SKY_EDGE, SKY_TEXELS}
#import bevy_bounce::vpl::types::luminance

@group(0) @binding(0) var<uniform> sky: Sky;
@group(0) @binding(1) var<uniform> scene: Scene;
// Radiance, cd/m^2; solid angle, sr.
@group(0) @binding(2) var<storage, read_write> table: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> lights: array<Light>;
@group(0) @binding(4) var map: texture_cube<f32>;
@group(0) @binding(5) var map_sampler: sampler;

const MEASURE_GROUP: u32 = 64u;
const CHOOSE_GROUP: u32 = 256u;
/// Texels that a thread of `choose` adds up.
const RUN: u32 = SKY_TEXELS / CHOOSE_GROUP;
/// Largest half float: an image may hold more, or what is no number.
const BRIGHTEST: f32 = 65504.0;
/// Share of the directions that are spread evenly.
const EVEN_SHARE: f32 = 0.25;
/// Dimension of the sequence.
const DIMENSION_SKY: u32 = 96u;

var<workgroup> partial: array<vec4<f32>, MEASURE_GROUP>;
var<workgroup> sums: array<f32, CHOOSE_GROUP>;

fn turn(rotation: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    let t = 2.0 * cross(rotation.xyz, v);
    return v + rotation.w * t + cross(rotation.xyz, t);
}

// Solid angle of an octahedral map at a point, sr a unit of its area.
fn solid_angle(p: vec2<f32>) -> f32 {
    let q = vec3<f32>(abs(p), 0.0);
    let z = abs(1.0 - q.x - q.y);
    // Beyond the equator, the fold.
    let xy = select(1.0 - q.yx, q.xy, q.x + q.y <= 1.0);
    let square = dot(xy, xy) + z * z;
    return inverseSqrt(square * square * square);
}

@compute @workgroup_size(64)
fn measure(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let corner = vec2<f32>(vec2<u32>(group.x % SKY_EDGE, group.x / SKY_EDGE));
    let edge = 2.0 / f32(SKY_EDGE);
    let area = edge * edge / f32(sky.samples * sky.samples);
    var sum = vec4<f32>(0.0);
    for (var i = lane; i < sky.samples * sky.samples; i += MEASURE_GROUP) {
        let within = (vec2<f32>(vec2<u32>(i % sky.samples, i / sky.samples)) + 0.5) / f32(sky.samples);
        let p = (corner + within) * edge - 1.0;
        // Cube maps are left-handed.
        let direction = turn(sky.rotation, octahedral_to_unit(p)) * vec3<f32>(1.0, 1.0, -1.0);
        let texel = textureSampleLevel(map, map_sampler, direction, 0.0).rgb;
        let weight = area * solid_angle(p);
        sum += vec4<f32>(clamp(texel, vec3<f32>(0.0), vec3<f32>(BRIGHTEST)) * weight, weight);
    }
    partial[lane] = sum;
    workgroupBarrier();
    for (var step = MEASURE_GROUP / 2u; step > 0u; step >>= 1u) {
        if lane < step {
            partial[lane] += partial[lane + step];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        let all = partial[0];
        table[group.x] = vec4<f32>(all.rgb / all.w * sky.radiance, all.w);
    }
}

// Cell of a square at a place along Hilbert's curve. Warren 2012, "Hacker's Delight", 16-2.
fn curve_cell(place: u32) -> vec2<u32> {
    var cell = vec2<u32>(0u);
    var rest = place;
    for (var size = 1u; size < SKY_EDGE; size *= 2u) {
        let right = (rest / 2u) & 1u;
        let up = (rest ^ right) & 1u;
        if up == 0u {
            if right == 1u {
                cell = vec2<u32>(size - 1u) - cell;
            }
            cell = cell.yx;
        }
        cell += size * vec2<u32>(right, up);
        rest /= 4u;
    }
    return cell;
}

fn curve_texel(place: u32) -> u32 {
    let cell = curve_cell(place);
    return cell.y * SKY_EDGE + cell.x;
}

// Light of a texel, lux from straight ahead, as luminance.
fn light_of(texel: vec4<f32>) -> f32 {
    return luminance(texel.rgb) * texel.w;
}

// Sum of the values of lanes up to this one. Hillis & Steele 1986.
fn sum_up(value: f32, lane: u32) -> f32 {
    sums[lane] = value;
    for (var step = 1u; step < CHOOSE_GROUP; step *= 2u) {
        workgroupBarrier();
        var sum = sums[lane];
        if lane >= step {
            sum += sums[lane - step];
        }
        workgroupBarrier();
        sums[lane] = sum;
    }
    workgroupBarrier();
    return sums[lane];
}

// The first run of texels whose sum lies beyond a value.
fn find_run(value: f32) -> u32 {
    var low = 0u;
    var high = CHOOSE_GROUP - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if sums[middle] > value {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

// What directions are drawn by: all texels together have the light of the whole sky.
fn chance_of(texel: vec4<f32>, total: f32) -> f32 {
    return mix(light_of(texel), total * texel.w / (4.0 * PI), EVEN_SHARE);
}

// The light that stands for a stretch of the curve. `total`: light of the whole sky, lux from straight ahead.
fn draw(index: u32, total: f32) -> Light {
    let value = (f32(index) + 0.5) / f32(scene.sky_count) * sums[CHOOSE_GROUP - 1u];
    let run = find_run(value);
    var left = value;
    if run > 0u {
        left -= sums[run - 1u];
    }
    // By rounding, none of a run's texels may lie beyond the value; its last does then.
    var place = run * RUN;
    for (var i = 0u; i < RUN; i++) {
        let own = chance_of(table[curve_texel(run * RUN + i)], total);
        place = run * RUN + i;
        if own > left {
            break;
        }
        left -= own;
    }
    let texel = table[curve_texel(place)];
    let own = chance_of(texel, total);
    let p = (vec2<f32>(curve_cell(place)) + sample_square(index, DIMENSION_SKY)) * (2.0 / f32(SKY_EDGE)) - 1.0;
    var light: Light;
    light.kind = LIGHT_DIRECTIONAL;
    light.direction = -octahedral_to_unit(p);
    light.max_bounces = sky.max_bounces;
    if own > 0.0 {
        light.color = texel.rgb * texel.w * (sums[CHOOSE_GROUP - 1u] / (own * f32(scene.sky_count)));
    }
    return light;
}

@compute @workgroup_size(256)
fn choose(@builtin(local_invocation_index) lane: u32) {
    var own = vec2<f32>(0.0);
    for (var i = 0u; i < RUN; i++) {
        let texel = table[curve_texel(lane * RUN + i)];
        own += vec2<f32>(light_of(texel), texel.w);
    }
    sum_up(own.x, lane);
    let total = sums[CHOOSE_GROUP - 1u];
    workgroupBarrier();
    sum_up(mix(own.x, total * own.y / (4.0 * PI), EVEN_SHARE), lane);
    var light = draw(min(lane, scene.sky_count - 1u), total);
    workgroupBarrier();
    // What it casts on the boxes of the scene, lumens, each with its weight.
    var area = 0.0;
    for (var i = 0u; is_within(i, scene.region_count, light.direction.x); i++) {
        area += scene.regions[i].weight * projected_area(scene.regions[i], light.direction);
    }
    light.cumulative_power = sum_up(select(0.0, luminance(light.color) * area * sky.share, lane < scene.sky_count), lane);
    if lane < scene.sky_count {
        lights[scene.light_count + lane] = light;
    }
}
