// Counts as colours, on a logarithmic scale: 0 black, 1 blue, 8 cyan, 64 green, 512 yellow, 4096 and more red.
//
// Cost: some ten operations.

#define_import_path bevy_bounce::debug::heat

/// Doublings from one colour to the next.
const STEP: f32 = 3.0;

/// The colour of a count.
fn heat(count: u32) -> vec3<f32> {
    if count == 0u {
        return vec3<f32>(0.0);
    }
    let at = log2(f32(count)) / STEP;
    // Green comes, blue goes, red comes, green goes.
    let colors = vec4<f32>(at, 2.0 - at, at - 2.0, 4.0 - at);
    let part = clamp(colors, vec4<f32>(0.0), vec4<f32>(1.0));
    return vec3<f32>(part.z, min(part.x, part.w), part.y);
}
