//! Damaged and hostile files.

use super::*;
use crate::block::{BlockEncoder, BlockRays};
use crate::container::reseal;
use crate::{Filter, Interval, MapsBuilder};

/// Maps of one block with so many groups of pixels, all kinds of rows among them.
fn maps(rng: &mut fastrand::Rng, groups: usize) -> Maps {
    let mut encoder = BlockEncoder::default();
    let (mut words, mut codes) = (Vec::new(), Vec::new());
    for group in 0..groups {
        let mut rays = BlockRays::ANY;
        for row in 0..if group % 3 == 0 { 0 } else { 32 } {
            let edge = rng.usize(0..128);
            for lane in 0..64 {
                let lo = if lane < edge { 100 } else { rng.u16(0..1 + group as u16) * 300 };
                rays.set(row, lane, Interval { lo, hi: lo + 50 });
            }
        }
        codes.push(encoder.encode(&rays, &mut words));
    }
    let mut maps = MapsBuilder::default();
    maps.push(&codes, &words).expect("it is small");
    maps.finish()
}

/// A small file with everything in it.
fn small_file() -> CssmFile {
    let mut rng = fastrand::Rng::with_seed(6);
    let meta = Meta {
        atlas: [4, 2],
        depth: 8,
        texels: 3,
        blocks: 1,
        charts: 2,
        csm_grid: 8,
        csm_side: 8,
        bounds_max: [1.0; 3],
        quantum: 0.001,
        lift: 0.01,
        csm_center: [0.5; 3],
        csm_radius: 1.0,
        csm_quantum: 0.002,
        ..Meta::default()
    };
    let mut cells = vec![NO_TEXEL; 8];
    let mut texels = Vec::new();
    for number in 0..3 {
        let cell = [number, number % 2];
        cells[(cell[1] * 4 + cell[0]) as usize] = number;
        let texel =
            Texel { normal: [0.0, 0.0, 1.0], area: 0.5, chart: number % 2, cell, slot: number, ..Texel::default() };
        texels.extend(texel.to_words());
    }
    let mut parts = Parts::default();
    parts.push([0, 0, 0], &[Some([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), None]);
    let (maps, csm) = (maps(&mut rng, meta.groups()), maps(&mut rng, 2));
    CssmFile { meta, texels, cells, parts, maps, csm }
}

/// Reads a file and, if that succeeds, asks it everything there is to ask.
fn exercise(bytes: &[u8]) -> bool {
    let Ok(file) = CssmFile::from_bytes(bytes) else { return false };
    for index in 0..file.meta.texels as usize {
        let texel = file.texel(index).expect("the file was checked");
        for point in [[0.3, 0.2, 2.0], [-5.0, 0.1, 0.2], [0.0; 3], [f32::NAN; 3], [f32::MAX; 3]] {
            file.visible(&texel, point);
            file.visibility(&texel, [0.4, 1.2], point, Filter::PixelsAndTexels);
            file.blocks(point, [2.0; 3]);
            file.sees(&texel, point);
            file.stands_between([2.0; 3], point);
            file.seen_from_outside(point, [0.0, 1.0, 0.0]);
        }
        let side = file.meta.depth;
        for face in 0..6 {
            for pixel in [[0, 0], [side - 1, side - 1], [side / 2, 1]] {
                assert!(file.code(&texel, face, pixel).is_some(), "the file was checked");
            }
        }
    }
    let charted = file.parts.iter().filter(|part| file.parts.triangle(part.first_triangle).is_some());
    assert!(charted.count() <= file.parts.corners.len());
    true
}

#[test]
fn round_trip() {
    let file = small_file();
    let bytes = file.to_bytes();
    assert_eq!(CssmFile::from_bytes(&bytes), Ok(file));
    assert!(exercise(&bytes));
}

#[test]
fn every_flipped_byte_is_noticed() {
    let bytes = small_file().to_bytes();
    for at in 0..bytes.len() {
        for flip in [0x01, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[at] ^= flip;
            assert!(CssmFile::from_bytes(&damaged).is_err(), "byte {at}");
        }
    }
}

#[test]
fn flipped_bytes_with_a_right_checksum_do_no_harm() {
    let bytes = small_file().to_bytes();
    let mut accepted = 0;
    for at in 0..bytes.len() {
        for flip in [0x01, 0x10, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[at] ^= flip;
            reseal(&mut damaged);
            accepted += usize::from(exercise(&damaged));
        }
    }
    // Changed values that are as good as the ones before: otherwise nothing past the checksum was tried.
    assert!(accepted > 100);
}

#[test]
fn every_length_is_noticed() {
    let bytes = small_file().to_bytes();
    for length in 0..bytes.len() {
        let mut cut = bytes[..length].to_vec();
        assert!(CssmFile::from_bytes(&cut).is_err());
        if length >= 24 {
            cut[16..24].copy_from_slice(&(length as u64).to_le_bytes());
        }
        reseal(&mut cut);
        assert!(CssmFile::from_bytes(&cut).is_err() || length + 16 > bytes.len(), "length {length}");
    }
    let longer = [&bytes[..], &[0; 16]].concat();
    assert!(matches!(CssmFile::from_bytes(&longer), Err(CssmError::Length { .. })));
}

#[test]
fn what_is_wrong_is_said() {
    let file = small_file();
    let said = |file: &CssmFile| CssmFile::from_bytes(&file.to_bytes()).map_err(|error| error.to_string());
    let mut newer = file.to_bytes();
    newer[8] = 2;
    let problem = CssmFile::from_bytes(&newer).map_err(|error| error.to_string());
    assert!(problem.is_err_and(|problem| problem.contains("version 2") && problem.contains("update")));
    let mut changed = file.clone();
    changed.meta.depth = 12;
    assert!(said(&changed).is_err_and(|problem| problem.contains("`meta`") && problem.contains("12")));
    let mut changed = file.clone();
    changed.maps.directory[3] = 0x7fff_ffff;
    assert!(said(&changed).is_err_and(|problem| problem.contains("`directory`") && problem.contains("entry 3")));
    let mut changed = file.clone();
    changed.cells[7] = 99;
    assert!(said(&changed).is_err_and(|problem| problem.contains("`cells`") && problem.contains("cell 7")));
    let mut changed = file;
    changed.texels[9] = 64;
    assert!(said(&changed).is_err_and(|problem| problem.contains("`texels`") && problem.contains("texel 0")));
}

/// Peak of the memory this process has held, in bytes.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse().ok().map(|kilobytes: u64| kilobytes * 1024)
}

/// Random damage of all kinds for ten minutes; `CSSM_FUZZ_SECONDS` changes how long.
#[test]
#[ignore = "takes ten minutes"]
fn fuzz() {
    let seconds = std::env::var("CSSM_FUZZ_SECONDS").ok().and_then(|seconds| seconds.parse().ok()).unwrap_or(600);
    let end = std::time::Instant::now() + std::time::Duration::from_secs(seconds);
    let bytes = small_file().to_bytes();
    let mut rng = fastrand::Rng::with_seed(7);
    let before = peak_memory();
    let (mut tried, mut accepted) = (0_u64, 0_u64);
    while std::time::Instant::now() < end {
        let mut damaged = bytes.clone();
        for _ in 0..rng.usize(1..6) {
            let at = rng.usize(0..damaged.len());
            match rng.u8(0..6) {
                0 => damaged[at] = rng.u8(..),
                1 => damaged[at] ^= 1 << rng.u8(0..8),
                2 => damaged.truncate(at.max(33)),
                3 => damaged.extend((0..rng.usize(0..64)).map(|_| rng.u8(..))),
                4 => {
                    let from = rng.usize(0..damaged.len());
                    let count = rng.usize(0..64).min(damaged.len() - from.max(at));
                    damaged.copy_within(from..from + count, at);
                }
                _ => {
                    let word = [0, 1, 0x7fff_ffff, 0x8000_0000, u32::MAX, rng.u32(..)][rng.usize(0..6)];
                    let at = (at & !3).min(damaged.len().saturating_sub(4));
                    damaged[at..at + 4].copy_from_slice(&word.to_le_bytes());
                }
            }
        }
        if rng.bool() && damaged.len() >= 24 {
            let length = damaged.len() as u64;
            damaged[16..24].copy_from_slice(&length.to_le_bytes());
        }
        reseal(&mut damaged);
        accepted += u64::from(exercise(&damaged));
        tried += 1;
    }
    println!("{tried} files, {accepted} of them accepted");
    assert!(tried > 0 && accepted > 0);
    if let (Some(before), Some(after)) = (before, peak_memory()) {
        // Thousands of times the file would show.
        assert!(after.saturating_sub(before) < 1000 * bytes.len() as u64, "{before} bytes before, {after} after");
    }
}
