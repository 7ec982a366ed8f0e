// The residual at each pixel, or at every second one of every second row. Cost: see `integrate.wgsl`.

#import bevy_pbr::rgb9e5::vec3_to_rgb9e5_
#import bevy_bounce::interleaved::surface::unpack_surface
#import bevy_bounce::ssbc::common::{view, parameters, surface_texture}
#import bevy_bounce::ssbc::integrate::residual_light

@group(0) @binding(3) var output: texture_storage_2d<r32uint, write>;

@compute @workgroup_size(8, 8)
fn gather(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= textureDimensions(output)) {
        return;
    }
    let pixel = id.xy * parameters.scale;
    let size = textureDimensions(surface_texture);
    let surface = unpack_surface(textureLoad(surface_texture, pixel, 0).xy, pixel, size, view);
    var light = 0u;
    if surface.valid {
        light = vec3_to_rgb9e5_(residual_light(surface, pixel));
    }
    textureStore(output, id.xy, vec4<u32>(light, 0u, 0u, 0u));
}
