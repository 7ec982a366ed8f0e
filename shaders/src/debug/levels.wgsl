// The levels of the light volume as the camera sees them, texel by texel without a filter: bands side by side, the
// finest level on the left. Light adds up along a ray as along a cone (see `radiance_cache/cone.wgsl`), until what the
// texels cover is all of it. Black where nothing is.
//
// Cost: a ray through the texels of one level a pixel, three loads a texel.

#import bevy_render::view::View
#import bevy_bounce::interleaved::surface::unproject
#import bevy_bounce::radiance_cache::types::LightVolume
#import bevy_bounce::shared::grid::Grid

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var picture: texture_storage_2d<rgba16float, write>;
@group(0) @binding(2) var<uniform> volume: LightVolume;
@group(0) @binding(3) var<storage, read> unit: array<f32>;
@group(0) @binding(4) var light_x: texture_3d<f32>;
@group(0) @binding(5) var light_y: texture_3d<f32>;
@group(0) @binding(6) var light_z: texture_3d<f32>;
@group(0) @binding(7) var<uniform> grid: Grid;

/// More texels than any ray meets.
const MAX_STEPS: u32 = 2048u;
/// Texels a step goes beyond the boundary it ends at.
const NUDGE: f32 = 1e-3;

// Light times coverage, coverage, of what faces the ray in a texel, on so much of a way through it.
fn meet(texel: vec3<i32>, direction: vec3<f32>, way: f32, level: u32) -> vec4<f32> {
    let other = vec3<i32>(i32((volume.dims.x + volume.gap) >> level), 0, 0);
    // What faces up an axis is seen by what goes down it.
    let x = textureLoad(light_x, texel + select(vec3<i32>(0), other, direction.x > 0.0), i32(level));
    let y = textureLoad(light_y, texel + select(vec3<i32>(0), other, direction.y > 0.0), i32(level));
    let z = textureLoad(light_z, texel + select(vec3<i32>(0), other, direction.z > 0.0), i32(level));
    let along = abs(direction) * way;
    return x * along.x + y * along.y + z * along.z;
}

// Places in texels of the level.
fn light_along(origin: vec3<f32>, direction: vec3<f32>, level: u32) -> vec3<f32> {
    let tiny = vec3<f32>(1e-6);
    let inverse = 1.0 / select(direction, select(-tiny, tiny, direction >= vec3<f32>(0.0)), abs(direction) < tiny);
    let dims = vec3<f32>(volume.dims >> vec3<u32>(level));
    let low = min(-origin * inverse, (dims - origin) * inverse);
    let high = max(-origin * inverse, (dims - origin) * inverse);
    let end = min(high.x, min(high.y, high.z));
    var t = max(max(low.x, low.y), max(low.z, 0.0));
    var light = vec3<f32>(0.0);
    var open = 1.0;
    for (var i = 0u; i < MAX_STEPS && t < end && open > 0.0; i++) {
        let texel = clamp(floor(origin + direction * (t + NUDGE)), vec3<f32>(0.0), dims - 1.0);
        let exits = (texel + select(vec3<f32>(0.0), vec3<f32>(1.0), inverse > vec3<f32>(0.0)) - origin) * inverse;
        let leave = max(min(exits.x, min(exits.y, exits.z)), t + NUDGE);
        let met = meet(vec3<i32>(texel), direction, leave - t, level);
        let taken = min(met.a, open);
        light += met.rgb * (taken / max(met.a, 1e-6));
        open -= taken;
        t = leave;
    }
    return light;
}

@compute @workgroup_size(8, 8)
fn show_levels(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(picture);
    if any(id.xy >= size) {
        return;
    }
    let level = id.x * (volume.last_level + 1u) / size.x;
    let uv = (vec2<f32>(id.xy) + 0.5) / vec2<f32>(size);
    let ndc = vec2<f32>(uv.x * 2.0 - 1.0, 1.0 - uv.y * 2.0);
    let near = unproject(view, vec3<f32>(ndc, 1.0));
    let direction = normalize(unproject(view, vec3<f32>(ndc, 0.5)) - near);
    let origin = (near - grid.origin) / (grid.voxel_size * f32(1u << level));
    let light = light_along(origin, direction, level) * (unit[0] * view.exposure);
    textureStore(picture, id.xy, vec4<f32>(light, 1.0));
}
