//! Settings at random, out of their ranges, too.

use bevy::prelude::*;
use bevy_bounce::{
    CssmFilter, CssmReceivers, CssmSettings, GiIsolate, GiSettings, GlobalIllumination, Quality, RadianceCacheSettings,
    Resolution, SsbcSettings, Technique, VplVisibility,
};
use fastrand::Rng;

fn one_of<T: Copy>(random: &mut Rng, values: &[T]) -> T {
    values[random.usize(0..values.len())]
}

/// Any technique, mostly with settings of its own.
pub fn illumination(random: &mut Rng) -> GlobalIllumination {
    use Technique::{InstantRadiosity, None, RadianceCache, SurfaceRadiosity};
    let technique =
        one_of(random, &[None, InstantRadiosity, InstantRadiosity, RadianceCache, RadianceCache, SurfaceRadiosity]);
    let quality = match random.u32(0..12) {
        0 | 1 => Quality::Low,
        2 => Quality::Medium,
        _ => Quality::Custom(settings(random)),
    };
    GlobalIllumination { technique, quality, ..default() }
}

/// What a picture holds.
pub fn isolate(random: &mut Rng) -> GiIsolate {
    use GiIsolate::{
        All, BakedAtlas, Bounded, Caches, Clusters, CutSize, Direct, Glossy, Indirect, Irradiance, Residual,
        ShadowAtlas, Split, TreeLevels, VoxelAlbedo, VoxelLevels, VoxelLight, VoxelNormal,
    };
    let light = [All, All, All, All, Direct, Indirect, Bounded, Residual, Split, Glossy, Irradiance];
    let voxels = [VoxelAlbedo, VoxelNormal, VoxelLight, VoxelLevels];
    let pictures = [ShadowAtlas, Clusters, Caches, CutSize, TreeLevels, BakedAtlas];
    one_of(random, &[&light[..], &voxels, &pictures].concat())
}

fn resolution(random: &mut Rng) -> Resolution {
    one_of(random, &[Resolution::Full, Resolution::Half])
}

/// A value of a range, now and then one that makes no sense.
fn float(random: &mut Rng, low: f32, high: f32) -> f32 {
    match random.u32(0..16) {
        0 => one_of(random, &[f32::NAN, f32::INFINITY, -1.0, 0.0]),
        _ => low + (high - low) * random.f32(),
    }
}

fn settings(random: &mut Rng) -> GiSettings {
    use VplVisibility::{Atlas, Baked, Ism, None, Voxel};
    GiSettings {
        grid: random.u32(0..48),
        range: float(random, 0.5, 60.0),
        vpls: random.u32(0..300),
        bounces: random.u32(0..40),
        visibility: one_of(random, &[None, Voxel, Ism, Atlas, Baked]),
        tile: match random.u32(0..60) {
            59 => 300,
            tile => tile,
        },
        bound: float(random, 0.01, 10.0),
        probes: one_of(random, &[0, 0, 1, 8, 14]),
        sky: random.u32(0..80),
        resolution: resolution(random),
        ssbc: SsbcSettings {
            iterations: random.u32(0..4),
            solid_angle: float(random, 0.02, 0.5),
            edge_solid_angle: float(random, 0.02, 0.5),
            resolution: resolution(random),
            blur: random.bool(),
        },
        cssm: CssmSettings {
            error: float(random, 4.0, 128.0),
            filter: one_of(random, &[CssmFilter::Nearest, CssmFilter::Pixels]),
            glossy: random.bool(),
            receivers: one_of(random, &[CssmReceivers::Pixels, CssmReceivers::Texels]),
        },
        radiance_cache: RadianceCacheSettings {
            glossy: random.bool(),
            caches: random.u32(0..40_000),
            reach: float(random, 1.0, 4.0),
            further_bounces: random.bool(),
        },
        history: random.u32(0..100),
    }
}
