// Normals and their histogram in whole numbers, so that every device and the processor choose the same axes and clusters.
//
// A bin is a texel of an octahedral map of 8x8; its direction is that of its centre, in eighths.

#define_import_path bevy_bounce::radiance_cache::normals

/// Edge of the histogram, bins.
const EDGE: i32 = 8;
const BINS: u32 = 64u;
/// Largest value of an octahedral coordinate.
const MOST: i32 = 32767;

fn sign_of(x: i32) -> i32 {
    return select(-1, 1, x >= 0);
}

// From the octahedron's net to its surface, whose points have that sum of magnitudes.
fn fold(x: i32, y: i32, sum: i32) -> vec3<i32> {
    let z = sum - abs(x) - abs(y);
    if z >= 0 {
        return vec3<i32>(x, y, z);
    }
    return vec3<i32>((sum - abs(y)) * sign_of(x), (sum - abs(x)) * sign_of(y), z);
}

/// A packed normal as a vector of the octahedron.
fn normal_vector(word: u32) -> vec3<i32> {
    let x = max(i32(word << 16u) >> 16u, -MOST);
    let y = max(i32(word) >> 16u, -MOST);
    return fold(x, y, MOST);
}

/// Its bin.
fn normal_bin(word: u32) -> u32 {
    let x = max(i32(word << 16u) >> 16u, -MOST) + MOST;
    let y = max(i32(word) >> 16u, -MOST) + MOST;
    let column = min(x * EDGE / (2 * MOST), EDGE - 1);
    let row = min(y * EDGE / (2 * MOST), EDGE - 1);
    return u32(row * EDGE + column);
}

/// Direction of a bin.
fn bin_vector(bin: u32) -> vec3<i32> {
    let x = 2 * (i32(bin) % EDGE) - (EDGE - 1);
    let y = 2 * (i32(bin) / EDGE) - (EDGE - 1);
    return fold(x, y, EDGE);
}

/// A bin that may lie one beyond the map's edge, where the net goes on mirrored.
fn wrapped_bin(column: i32, row: i32) -> u32 {
    var x = column;
    var y = row;
    if x < 0 || x >= EDGE {
        x = clamp(x, 0, EDGE - 1);
        y = EDGE - 1 - y;
    }
    if y < 0 || y >= EDGE {
        y = clamp(y, 0, EDGE - 1);
        x = EDGE - 1 - x;
    }
    return u32(y * EDGE + x);
}

fn whole_dot(a: vec3<i32>, b: vec3<i32>) -> i32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

/// 4096 (1 - |cos|^8) of two bins.
fn apart(a: u32, b: u32) -> u32 {
    let u = bin_vector(a);
    let v = bin_vector(b);
    let both = u32(abs(whole_dot(u, v)));
    let square = both * both * 4096u / u32(whole_dot(u, u) * whole_dot(v, v));
    let fourth = square * square >> 12u;
    return 4096u - min(fourth * fourth >> 12u, 4096u);
}

/// Facing of a normal in a frame of three bins, six bits each: the axis that it is nearest to, twice, plus one where it looks
/// the other way.
fn facing_in(frame: u32, word: u32) -> u32 {
    // Ten bits, so that squares fit into a word.
    let n = normal_vector(word) / 32;
    var best = 0u;
    var best_square = 0u;
    var best_length = 1u;
    for (var i = 0u; i < 3u; i++) {
        let axis = bin_vector((frame >> (6u * i)) & 63u);
        let along = whole_dot(n, axis);
        let square = u32(along * along);
        let length = u32(whole_dot(axis, axis));
        if square * best_length > best_square * length {
            best = 2u * i + select(0u, 1u, along < 0);
            best_square = square;
            best_length = length;
        }
    }
    return best;
}
