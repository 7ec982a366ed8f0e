// The residual at every pixel from that at every second one of every second row: bilinear among the samples of the same
// surface; and the list of the pixels of whose surface too few samples are near. Where no sample near has any, of whatever
// surface, none is taken to be: two surfaces that are near enough give to each other. A surface that is narrower than the
// samples are apart may lose its share.
//
// Cost: one thread a sample; twelve loads, four stores and an atomic addition of the workgroup's.

#import bevy_bounce::interleaved::surface::{Surface, is_same_surface}
#import bevy_bounce::shared::groups::MAX_WORKGROUPS
#import bevy_bounce::ssbc::common::{surface_texture, surface_at, view_lens}
#import bevy_bounce::ssbc::repairs::{SSBC_REPAIR_HEADER, REPAIR_COUNT, REPAIR_GROUP}
#import bevy_pbr::rgb9e5::{rgb9e5_to_vec3_, vec3_to_rgb9e5_}

@group(0) @binding(3) var residual_texture: texture_2d<u32>;
@group(0) @binding(4) var output: texture_storage_2d<r32uint, write>;
@group(0) @binding(5) var<storage, read_write> repairs: array<atomic<u32>>;

/// Share of the samples that must be of the same surface.
const ENOUGH: f32 = 0.7;
/// Bits of rgb9e5.
const MANTISSAS: u32 = 0x7ffffffu;

struct Sample {
    surface: Surface,
    light: u32,
}

var<workgroup> failures: atomic<u32>;
var<workgroup> first_slot: u32;

fn groups_for(pixels: u32) -> u32 {
    return min((pixels + REPAIR_GROUP - 1u) / REPAIR_GROUP, MAX_WORKGROUPS);
}

// Room for that many more in the list.
fn append(count: u32) -> u32 {
    let at = atomicAdd(&repairs[REPAIR_COUNT], count);
    atomicAdd(&repairs[0], groups_for(at + count) - groups_for(at));
    atomicStore(&repairs[1], 1u);
    atomicStore(&repairs[2], 1u);
    return at;
}

// A pixel's light between the samples of its surface, and their share. The pixel has a sample at each corner of its place.
fn upsample(samples: array<Sample, 4>, surface: Surface, place: vec2<u32>) -> vec4<f32> {
    var near = samples;
    var sum = vec4<f32>(0.0);
    var count = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let is_corner = all(vec2<u32>(i & 1u, i >> 1u) <= place);
        count += select(0.0, 1.0, is_corner);
        if is_corner && surface.valid && is_same_surface(surface, near[i].surface) {
            sum += vec4<f32>(rgb9e5_to_vec3_(near[i].light), 1.0);
        }
    }
    return vec4<f32>(sum.rgb / max(sum.w, 1.0), sum.w / count);
}

@compute @workgroup_size(8, 8)
fn spread(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let size = textureDimensions(surface_texture);
    let last = textureDimensions(residual_texture) - 1u;
    let lens = view_lens();
    var samples: array<Sample, 4>;
    var lit = 0u;
    for (var i = 0u; i < 4u; i++) {
        let texel = id.xy + vec2<u32>(i & 1u, i >> 1u);
        let inside = all(texel <= last);
        let light = textureLoad(residual_texture, min(texel, last), 0).x;
        samples[i] = Sample(surface_at(lens, 2u * min(texel, last)), light);
        samples[i].surface.valid = samples[i].surface.valid && inside;
        lit |= select(0u, light & MANTISSAS, inside);
    }

    // Bits of the pixels at which it fails.
    var fails = 0u;
    for (var i = 0u; i < 4u; i++) {
        let place = vec2<u32>(i & 1u, i >> 1u);
        let pixel = 2u * id.xy + place;
        let surface = surface_at(lens, min(pixel, size - 1u));
        let upsampled = upsample(samples, surface, place);
        let inside = all(pixel < size);
        if inside {
            textureStore(output, pixel, vec4<u32>(vec3_to_rgb9e5_(upsampled.rgb), 0u, 0u, 0u));
        }
        fails |= select(0u, 1u << i, inside && surface.valid && lit != 0u && upsampled.a < ENOUGH);
    }

    var slot = atomicAdd(&failures, countOneBits(fails));
    workgroupBarrier();
    if lane == 0u {
        let count = atomicLoad(&failures);
        if count > 0u {
            first_slot = append(count);
        }
    }
    workgroupBarrier();
    for (; fails != 0u; fails &= fails - 1u) {
        let i = countTrailingZeros(fails);
        let pixel = 2u * id.xy + vec2<u32>(i & 1u, i >> 1u);
        atomicStore(&repairs[SSBC_REPAIR_HEADER + first_slot + slot], pixel.x | (pixel.y << 16u));
        slot++;
    }
}
