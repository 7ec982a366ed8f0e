// A level of the light volume from the finer one, by surface coverage: a surface that fills half of eight voxels fills the one
// that they make. Rehfeld, Zirr and Dachsbacher 2014, 3.1, "Pre-filtered Hierarchy"; by columns, as Crassin et al. 2011, 6.2.
//
// Of two texels behind each other along the axis, the one in front takes what it covers and leaves the rest to the other, as on a
// cone's way: a lamp under a ceiling does not mix with it. Of the four columns, coverage and light are the mean.
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

// What the one behind adds, where coverage adds up to one at most.
fn behind(front: vec4<f32>, back: vec4<f32>) -> vec4<f32> {
    return front + back * (min(back.a, 1.0 - front.a) / max(back.a, 1e-6));
}

// Texel of a column, front or back, that is seen along an axis.
fn column(i: i32, axis: u32, depth: i32) -> vec3<i32> {
    var offset = vec3<i32>(0);
    offset[axis] = depth;
    offset[(axis + 1u) % 3u] = i & 1;
    offset[(axis + 2u) % 3u] = i >> 1u;
    return offset;
}

@compute @workgroup_size(4, 4, 4)
fn reduce(@builtin(global_invocation_id) id: vec3<u32>) {
    // Both halves and the gap between them, in which nothing is.
    if any(id >= textureDimensions(level_x)) {
        return;
    }
    let texel = vec3<i32>(id);
    // What faces up an axis, in the first half, is seen from above.
    let front = select(0, 1, 2u * id.x < textureDimensions(level_x).x);
    var x = vec4<f32>(0.0);
    var y = vec4<f32>(0.0);
    var z = vec4<f32>(0.0);
    for (var i = 0; i < 4; i++) {
        let first = texel * 2;
        x += behind(
            textureLoad(finer_x, first + column(i, 0u, front), 0),
            textureLoad(finer_x, first + column(i, 0u, 1 - front), 0),
        );
        y += behind(
            textureLoad(finer_y, first + column(i, 1u, front), 0),
            textureLoad(finer_y, first + column(i, 1u, 1 - front), 0),
        );
        z += behind(
            textureLoad(finer_z, first + column(i, 2u, front), 0),
            textureLoad(finer_z, first + column(i, 2u, 1 - front), 0),
        );
    }
    textureStore(level_x, texel, 0.25 * x);
    textureStore(level_y, texel, 0.25 * y);
    textureStore(level_z, texel, 0.25 * z);
}
