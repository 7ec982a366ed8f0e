// What goes with light that surfaces mirror, in one half float: how wide the lobe is, and how much of the light is from reflection probes.

#define_import_path bevy_bounce::compose::mirrored

/// Largest codes of the two shares of [`pack_mirrored`]: all together are whole numbers that half floats have.
const WIDTH_CODES: f32 = 31.0;
const PROBE_CODES: f32 = 63.0;

/// Both are from 0 to 1.
fn pack_mirrored(width: f32, probes: f32) -> f32 {
    return round(saturate(probes) * PROBE_CODES) * (WIDTH_CODES + 1.0) + round(saturate(width) * WIDTH_CODES);
}

/// Both again.
fn unpack_mirrored(code: f32) -> vec2<f32> {
    let probes = floor(code / (WIDTH_CODES + 1.0));
    return vec2<f32>((code - probes * (WIDTH_CODES + 1.0)) / WIDTH_CODES, probes / PROBE_CODES);
}
