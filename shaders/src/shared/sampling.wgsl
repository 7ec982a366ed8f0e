// Quasi-random numbers and what is made of them.
//
// Owen-scrambled Sobol' points by hashing. Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4). The first two
// dimensions of Sobol's sequence, padded to as many as asked for by shuffling the index: any aligned power of two of
// consecutive points is stratified in every pair of dimensions. The same every frame.

#define_import_path bevy_bounce::shared::sampling

const PI: f32 = 3.14159265358979;

// Vegdahl 2021's improvement of the Laine-Karras permutation.
fn laine_karras(value: u32, seed: u32) -> u32 {
    var x = value;
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

fn owen_scramble(value: u32, seed: u32) -> u32 {
    return reverseBits(laine_karras(reverseBits(value), seed));
}

// pcg, Jarzynski & Olano 2020.
fn hash(value: u32) -> u32 {
    let state = value * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// Second dimension of Sobol's sequence.
fn sobol_second(index: u32) -> u32 {
    var result = 0u;
    var direction = 0x80000000u;
    for (var i = index; i != 0u; i >>= 1u) {
        if (i & 1u) != 0u {
            result ^= direction;
        }
        direction ^= direction >> 1u;
    }
    return result;
}

// 24 bits, so that the result stays below 1.
fn unit_float(bits: u32) -> f32 {
    return f32(bits >> 8u) * (1.0 / 16777216.0);
}

/// Of many, the one that waits the shortest is each with a probability in proportion to its weight, and another one only where the
/// weights of these two say so. Efraimidis & Spirakis 2006, "Weighted random sampling with a reservoir". `name`: the chance is its own.
fn waiting_time(name: u32, weight: f32) -> f32 {
    return -log(max(unit_float(hash(name)), 1e-10)) / max(weight, 1e-30);
}

/// Point `index` of a stratified set in [0, 1)^2, a set of its own for every `dimension`.
fn sample_square(index: u32, dimension: u32) -> vec2<f32> {
    let seed = hash(dimension);
    let shuffled = owen_scramble(index, seed);
    let x = owen_scramble(reverseBits(shuffled), hash(seed ^ 0x9e3779b9u));
    let y = owen_scramble(sobol_second(shuffled), hash(seed ^ 0x7f4a7c15u));
    return vec2<f32>(unit_float(x), unit_float(y));
}

/// A direction about `normal`, distributed as its cosine: theta = acos(sqrt(1 - x)). The paper prints sqrt(cos x), a misprint.
fn cosine_direction(normal: vec3<f32>, square: vec2<f32>) -> vec3<f32> {
    return from_frame(normal, square, sqrt(1.0 - square.x));
}

/// A direction about `axis`, uniform over the cone of that half angle's cosine.
fn cone_direction(axis: vec3<f32>, square: vec2<f32>, cos_angle: f32) -> vec3<f32> {
    return from_frame(axis, square, mix(1.0, cos_angle, square.x));
}

fn from_frame(axis: vec3<f32>, square: vec2<f32>, cos_theta: f32) -> vec3<f32> {
    let phi = 2.0 * PI * square.y;
    let sin_theta = sqrt(max(1.0 - cos_theta * cos_theta, 0.0));
    let tangent = any_tangent(axis);
    let bitangent = cross(axis, tangent);
    return normalize(tangent * (cos(phi) * sin_theta) + bitangent * (sin(phi) * sin_theta) + axis * cos_theta);
}

/// A point of the unit disk, uniform.
fn disk_point(square: vec2<f32>) -> vec2<f32> {
    let phi = 2.0 * PI * square.y;
    return sqrt(square.x) * vec2<f32>(cos(phi), sin(phi));
}

/// Barycentric coordinates of a point of a triangle, uniform. Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
fn triangle_point(square: vec2<f32>) -> vec2<f32> {
    if square.x < square.y {
        let x = square.x * 0.5;
        return vec2<f32>(x, square.y - x);
    }
    let y = square.y * 0.5;
    return vec2<f32>(square.x - y, y);
}

/// A unit vector perpendicular to a unit vector. Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
fn any_tangent(n: vec3<f32>) -> vec3<f32> {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    return vec3<f32>(1.0 + s * n.x * n.x * a, s * n.x * n.y * a, -s * n.x);
}
