//! Twin of `shared/sampling.wgsl`.

use bevy::math::Vec2;

fn laine_karras(value: u32, seed: u32) -> u32 {
    let mut x = value;
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x
}

fn owen_scramble(value: u32, seed: u32) -> u32 {
    laine_karras(value.reverse_bits(), seed).reverse_bits()
}

fn hash(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

fn sobol_second(index: u32) -> u32 {
    let (mut result, mut direction, mut i) = (0, 0x8000_0000_u32, index);
    while i != 0 {
        if i & 1 != 0 {
            result ^= direction;
        }
        direction ^= direction >> 1;
        i >>= 1;
    }
    result
}

fn unit_float(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Point `index` of the stratified set of that dimension.
pub fn sample_square(index: u32, dimension: u32) -> Vec2 {
    let seed = hash(dimension);
    let shuffled = owen_scramble(index, seed);
    let x = owen_scramble(shuffled.reverse_bits(), hash(seed ^ 0x9e37_79b9));
    let y = owen_scramble(sobol_second(shuffled), hash(seed ^ 0x7f4a_7c15));
    Vec2::new(unit_float(x), unit_float(y))
}
