// A texture as 16x16 means: one workgroup a texel of the thumbnail, RGBA8, colour as the square root of linear.
//
// Where a texture has mip levels a coarse one is read; where it has none, up to 32x32 of the texels are, evenly spread. Of a masked
// texture up to 32x32 always are, for in a coarse level its holes are filled: alpha becomes the share of them that reaches the cutoff, and
// colours count where they do.

#import bevy_bounce::shared::scene::THUMBNAIL_SIZE

struct ThumbnailJob {
    offset: u32,
    // Alpha, in 255ths, from which a texel of a masked texture is there; 0 where it is not masked.
    cutoff: u32,
    // GLSL ES cannot ask a texture.
    mip_levels: u32,
    padding: u32,
}

@group(0) @binding(0) var<uniform> job: ThumbnailJob;
@group(0) @binding(1) var color_texture: texture_2d<f32>;
@group(0) @binding(2) var<storage, read_write> thumbnails: array<u32>;

const THREADS: u32 = 64u;
/// Texels read along an axis, at most.
const SAMPLES: u32 = 32u;
/// Edge, in texels, below which a mip level is not looked for.
const COARSE: u32 = 64u;

// Colour where the surface is there, and alpha.
var<workgroup> sums: array<vec4<f32>, 64>;
var<workgroup> weights: array<f32, 64>;

// The coarsest level that still has so many texels along its shorter axis.
fn coarse_level(size: vec2<u32>, levels: u32, texels: u32) -> u32 {
    let ratio = max(min(size.x, size.y) / texels, 1u);
    return min(firstLeadingBit(ratio), levels - 1u);
}

@compute @workgroup_size(64)
fn average(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let needed = select(COARSE, SAMPLES * THUMBNAIL_SIZE, job.cutoff != 0u);
    let level = coarse_level(textureDimensions(color_texture), job.mip_levels, needed);
    let size = textureDimensions(color_texture, level);
    let start = vec2<f32>(group.xy) / f32(THUMBNAIL_SIZE);
    let count = clamp(size / THUMBNAIL_SIZE, vec2<u32>(1u), vec2<u32>(SAMPLES));
    let step = 1.0 / (f32(THUMBNAIL_SIZE) * vec2<f32>(count));

    var sum = vec4<f32>(0.0);
    var total = 0.0;
    for (var i = thread; i < count.x * count.y; i += THREADS) {
        let uv = start + (vec2<f32>(vec2<u32>(i % count.x, i / count.x)) + 0.5) * step;
        let texel = min(vec2<u32>(uv * vec2<f32>(size)), size - 1u);
        let color = clamp(textureLoad(color_texture, texel, level), vec4<f32>(0.0), vec4<f32>(1.0));
        let is_there = color.a * 255.0 >= f32(job.cutoff) - 0.5;
        let weight = select(0.0, 1.0, is_there);
        let alpha = select(color.a, weight, job.cutoff != 0u);
        sum += vec4<f32>(color.rgb * weight, alpha);
        total += weight;
    }
    sums[thread] = sum;
    weights[thread] = total;
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if thread < half {
            sums[thread] += sums[thread + half];
            weights[thread] += weights[thread + half];
        }
    }
    if thread == 0u {
        let color = sums[0].rgb / max(weights[0], 1e-6);
        let alpha = sums[0].a / f32(count.x * count.y);
        thumbnails[job.offset + group.y * THUMBNAIL_SIZE + group.x] = pack4x8unorm(vec4<f32>(sqrt(color), alpha));
    }
}
