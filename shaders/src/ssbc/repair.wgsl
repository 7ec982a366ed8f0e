// The residual anew at the pixels of the list: those of one edge are integrated side by side. Cost: see `integrate.wgsl`.

#import bevy_bounce::ssbc::common::{surface_at, view_lens}
#import bevy_bounce::ssbc::integrate::residual_light
#import bevy_bounce::ssbc::repairs::{SSBC_REPAIR_HEADER, REPAIR_COUNT, REPAIR_GROUP}

@group(0) @binding(3) var output: texture_storage_2d<rgba16float, write>;
@group(0) @binding(8) var<storage, read> repairs: array<u32>;

@compute @workgroup_size(REPAIR_GROUP)
fn repair(@builtin(global_invocation_id) id: vec3<u32>) {
    let lens = view_lens();
    let threads = repairs[0] * REPAIR_GROUP;
    for (var i = id.x; i < repairs[REPAIR_COUNT]; i += threads) {
        let word = repairs[SSBC_REPAIR_HEADER + i];
        let pixel = vec2<u32>(word & 0xffffu, word >> 16u);
        let light = residual_light(lens, surface_at(lens, pixel), pixel);
        textureStore(output, pixel, vec4<f32>(light, 1.0));
    }
}
