//! Directions in a square.
//!
//! The octahedron is projected onto the plane, its lower half folded outwards (Meyer et al., *On Floating-Point Normal
//! Vectors*, 2010).

/// Point of the square `-1..=1` for a direction of any length.
pub fn to_square([x, y, z]: [f32; 3]) -> [f32; 2] {
    let sum = x.abs() + y.abs() + z.abs();
    if sum == 0.0 || !sum.is_finite() {
        return [0.0, 0.0];
    }
    let [u, v] = [x / sum, y / sum];
    // Zero of either sign lies on one side, as it does on the GPU.
    let folded = |at: f32, other: f32| if at < 0.0 { other.abs() - 1.0 } else { 1.0 - other.abs() };
    if z >= 0.0 { [u, v] } else { [folded(u, v), folded(v, u)] }
}

/// Unit direction for a point of the square `-1..=1`.
pub fn from_square([u, v]: [f32; 2]) -> [f32; 3] {
    let z = 1.0 - u.abs() - v.abs();
    let fold = (-z).max(0.0);
    let [x, y] = [u - fold.copysign(u), v - fold.copysign(v)];
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

/// A direction in two signed 16-bit numbers, as `unpack2x16snorm` reads them.
pub fn encode(direction: [f32; 3]) -> u32 {
    let [u, v] = to_square(direction).map(|value| (value.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16);
    u32::from(u) | u32::from(v) << 16
}

/// The unit direction behind [`encode`].
pub fn decode(bits: u32) -> [f32; 3] {
    let signed = |bits: u32| (f32::from(bits as u16 as i16) / 32767.0).max(-1.0);
    from_square([signed(bits), signed(bits >> 16)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip() {
        let mut rng = fastrand::Rng::with_seed(5);
        for _ in 0..10_000 {
            let direction = [(); 3].map(|()| rng.f32() * 2.0 - 1.0);
            let length = direction.iter().map(|x| x * x).sum::<f32>().sqrt();
            let unit = direction.map(|x| x / length);
            let decoded = decode(encode(direction));
            let error = unit.iter().zip(decoded).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(error < 1.0e-4, "{unit:?} {decoded:?}");
            // What was decoded stays as it is.
            assert_eq!(decode(encode(decoded)), decoded);
        }
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let mut direction = [0.0; 3];
                direction[axis] = sign;
                assert_eq!(decode(encode(direction)), direction);
            }
        }
    }
}
