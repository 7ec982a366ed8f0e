use super::*;
use crate::interval::Interval;

/// Rays such that a lane's codes depend on where it lies: few codes, many codes, and nothing in common.
fn random_rays(rng: &mut fastrand::Rng, values: u16) -> BlockRays {
    let mut rays = BlockRays::ANY;
    let edges: [usize; ROWS] = std::array::from_fn(|_| rng.usize(0..2 * LANES));
    for (row, edge) in edges.into_iter().enumerate() {
        for lane in 0..LANES {
            let base = if lane < edge { 7 } else { rng.u16(0..values) * 100 };
            let interval = match rng.u8(0..10) {
                0 => Interval::ANY,
                1 if values > 20 => Interval::EMPTY_RAY,
                _ => Interval { lo: base, hi: base + rng.u16(0..90) },
            };
            rays.set(row, lane, interval);
        }
    }
    rays
}

#[test]
fn every_code_is_right() {
    let mut rng = fastrand::Rng::with_seed(3);
    let mut encoder = BlockEncoder::default();
    for case in 0..300 {
        let rays = random_rays(&mut rng, 1 + case % 60);
        let mut words = vec![0xdead_beef];
        let code = encoder.encode(&rays, &mut words);
        if let BlockCode::Words(size) = code {
            assert_eq!(check(&words[1..]), Some(size));
            assert_eq!(words.len(), size + 1);
        }
        for row in 0..ROWS {
            for lane in 0..LANES {
                let code = match code {
                    BlockCode::Constant(code) => code,
                    BlockCode::Words(_) => decode(&words[1..], row, lane).expect("in the block"),
                };
                assert!(rays.get(row, lane).contains(code), "case {case} row {row} lane {lane}");
            }
        }
    }
}

#[test]
fn the_widest_block_fits() {
    let mut rays = BlockRays::ANY;
    for row in 0..ROWS {
        for lane in 0..LANES {
            let code = ((row * LANES + lane) * 31 % 65536) as u16;
            rays.set(row, lane, Interval { lo: code, hi: code });
        }
    }
    let mut words = Vec::new();
    let code = BlockEncoder::default().encode(&rays, &mut words);
    assert_eq!(code, BlockCode::Words(check(&words).expect("valid")));
    for (row, lane) in [(0, 0), (31, 63), (7, 40)] {
        assert_eq!(decode(&words, row, lane), Some(rays.lo[row][lane]));
    }
}

#[test]
fn damage_is_noticed() {
    let mut rng = fastrand::Rng::with_seed(4);
    let rays = random_rays(&mut rng, 30);
    let mut words = Vec::new();
    BlockEncoder::default().encode(&rays, &mut words);
    for length in 0..words.len() {
        assert_eq!(check(&words[..length]), None);
    }
    for word in 0..words.len() {
        for bit in 0..32 {
            let mut damaged = words.clone();
            damaged[word] ^= 1 << bit;
            if check(&damaged).is_some() {
                for (row, lane) in [(0, 0), (13, 21), (31, 63)] {
                    assert!(decode(&damaged, row, lane).is_some());
                }
            }
        }
    }
}
