// Unit vectors in one word: octahedral map, two 16-bit signed normalised values.
//
// Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 3(2), Listing 1 and 2.
// The largest angular error of this width is about 0.004 degrees.

#define_import_path bevy_bounce::shared::octahedral

/// -1 or 1, and 1 for 0: `sign` would send an axis to the centre.
fn sign_not_zero(v: vec2<f32>) -> vec2<f32> {
    return select(vec2<f32>(-1.0), vec2<f32>(1.0), v >= vec2<f32>(0.0));
}

/// A unit vector to a point of [-1, 1]^2.
fn unit_to_octahedral(n: vec3<f32>) -> vec2<f32> {
    let p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    return select((1.0 - abs(p.yx)) * sign_not_zero(p), p, n.z >= 0.0);
}

/// A point of [-1, 1]^2 to where it is on the octahedron.
fn on_octahedron(p: vec2<f32>) -> vec3<f32> {
    let z = 1.0 - abs(p.x) - abs(p.y);
    return vec3<f32>(p - sign_not_zero(p) * max(-z, 0.0), z);
}

/// A point of [-1, 1]^2 to a unit vector.
fn octahedral_to_unit(p: vec2<f32>) -> vec3<f32> {
    let n = on_octahedron(p);
    return n * inverseSqrt(dot(n, n));
}

/// A unit vector to its word.
fn encode_unit(n: vec3<f32>) -> u32 {
    return pack2x16snorm(unit_to_octahedral(n));
}

// A word to its point of [-1, 1]^2. `unpack2x16snorm` would divide, and clamp what `encode_unit` never writes.
fn unpack_octahedral(word: u32) -> vec2<f32> {
    return vec2<f32>(vec2<i32>(i32(word << 16u), i32(word)) >> vec2<u32>(16u)) * (1.0 / 32767.0);
}

/// A word to its unit vector.
fn decode_unit(word: u32) -> vec3<f32> {
    return octahedral_to_unit(unpack_octahedral(word));
}

/// The same, of any length.
fn decode_direction(word: u32) -> vec3<f32> {
    return on_octahedron(unpack_octahedral(word));
}

/// A unit vector to the lower half of a word: two 8-bit signed normalised values, half a degree off at most.
fn encode_unit_8(n: vec3<f32>) -> u32 {
    let p = vec2<i32>(round(clamp(unit_to_octahedral(n), vec2<f32>(-1.0), vec2<f32>(1.0)) * 127.0));
    return (u32(p.x & 0xff) << 8u) | u32(p.y & 0xff);
}

/// The unit vector in the lower half of a word.
fn decode_unit_8(word: u32) -> vec3<f32> {
    let p = vec2<i32>(i32(word << 16u) >> 24u, i32(word << 24u) >> 24u);
    return octahedral_to_unit(vec2<f32>(p) * (1.0 / 127.0));
}
