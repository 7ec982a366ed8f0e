// Place of a point on a curve that fills space. Skilling 2004, "Programming the Hilbert curve".

#define_import_path bevy_bounce::shared::hilbert

/// Bits of each coordinate.
const HILBERT_BITS: u32 = 7u;

/// Index of a cell on the Hilbert curve through a cube of 2^`HILBERT_BITS` cells an edge: neighbours on the curve share a face.
fn hilbert_index(cell: vec3<u32>) -> u32 {
    let highest = 1u << (HILBERT_BITS - 1u);
    var x = cell;
    for (var q = highest; q > 1u; q >>= 1u) {
        let lower = q - 1u;
        for (var i = 0u; i < 3u; i++) {
            if (x[i] & q) != 0u {
                x.x ^= lower;
            } else {
                let swapped = (x.x ^ x[i]) & lower;
                x.x ^= swapped;
                x[i] ^= swapped;
            }
        }
    }
    x.y ^= x.x;
    x.z ^= x.y;
    var gray = 0u;
    for (var q = highest; q > 1u; q >>= 1u) {
        gray ^= select(0u, q - 1u, (x.z & q) != 0u);
    }
    x ^= vec3<u32>(gray);
    var index = 0u;
    for (var bit = HILBERT_BITS; bit > 0u; bit--) {
        let b = (x >> vec3<u32>(bit - 1u)) & vec3<u32>(1u);
        index = (index << 3u) | (b.x << 2u) | (b.y << 1u) | b.z;
    }
    return index;
}
