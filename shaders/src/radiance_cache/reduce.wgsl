// A level of the light volume from the finer one, by surface coverage: a surface that fills half of eight voxels fills the one
// that they make. Rehfeld, Zirr and Dachsbacher 2014, 3.1, "Pre-filtered Hierarchy".
//
// Coverage is the sum of the eight over four, one at most; light is their mean weighted by coverage, times it.
//
// Cost: one thread a texel; 48 loads, six stores.

#import bevy_bounce::radiance_cache::types::LightVolume

@group(0) @binding(0) var<uniform> volume: LightVolume;
@group(0) @binding(1) var finer_x: texture_3d<f32>;
@group(0) @binding(2) var finer_y: texture_3d<f32>;
@group(0) @binding(3) var finer_z: texture_3d<f32>;
@group(0) @binding(4) var level_x: texture_storage_3d<rgba16float, write>;
@group(0) @binding(5) var level_y: texture_storage_3d<rgba16float, write>;
@group(0) @binding(6) var level_z: texture_storage_3d<rgba16float, write>;

fn covered(sum: vec4<f32>) -> vec4<f32> {
    let coverage = min(sum.a * 0.25, 1.0);
    return vec4<f32>(sum.rgb * (coverage / max(sum.a, 1e-6)), coverage);
}

fn corner(i: i32) -> vec3<i32> {
    return vec3<i32>(i & 1, (i >> 1u) & 1, i >> 2u);
}

@compute @workgroup_size(4, 4, 4)
fn reduce(@builtin(global_invocation_id) id: vec3<u32>) {
    // Both halves and the gap between them, in which nothing is.
    if any(id >= textureDimensions(level_x)) {
        return;
    }
    let texel = vec3<i32>(id);
    var x = vec4<f32>(0.0);
    var y = vec4<f32>(0.0);
    var z = vec4<f32>(0.0);
    for (var i = 0; i < 8; i++) {
        let finer = texel * 2 + corner(i);
        x += textureLoad(finer_x, finer, 0);
        y += textureLoad(finer_y, finer, 0);
        z += textureLoad(finer_z, finer, 0);
    }
    textureStore(level_x, texel, covered(x));
    textureStore(level_y, texel, covered(y));
    textureStore(level_z, texel, covered(z));
}
