// The residual at each pixel, or at every second one of every second row. Cost: see `integrate.wgsl`.

#import bevy_bounce::ssbc::common::{parameters, surface_at, view_lens}
#import bevy_bounce::ssbc::integrate::residual_light

@group(0) @binding(3) var output: texture_storage_2d<rgba16float, write>;

const GROUP: u32 = 8u;

// Threads in Morton order: those that run in step descend into the same texels.
fn place_in_group(lane: u32) -> vec2<u32> {
    return vec2<u32>(
        (lane & 1u) | ((lane >> 1u) & 2u) | ((lane >> 2u) & 4u),
        ((lane >> 1u) & 1u) | ((lane >> 2u) & 2u) | ((lane >> 3u) & 4u),
    );
}

@compute @workgroup_size(64)
fn gather(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let texel = group.xy * GROUP + place_in_group(lane);
    if any(texel >= textureDimensions(output)) {
        return;
    }
    let lens = view_lens();
    let pixel = texel * parameters.scale;
    let surface = surface_at(lens, pixel);
    var light = vec3<f32>(0.0);
    if surface.valid {
        light = residual_light(lens, surface, pixel);
    }
    textureStore(output, texel, vec4<f32>(light, 1.0));
}
