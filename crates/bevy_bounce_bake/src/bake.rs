//! From a scene to a file.

use std::sync::atomic::{AtomicUsize, Ordering};

use bevy_bounce_cssm::{CssmFile, Meta, NO_TEXEL, Parts, Quantizer, block::LANES};
use glam::Vec3;

use crate::atlas::{Atlas, UvSource};
use crate::cube_maps::{CubeMap, encode_cube_maps};
use crate::outside::{self, Sphere, encode_outside_maps};
use crate::rays::Bvh;
use crate::scene::Scene;
use crate::traversal::{self, Strategy};
use crate::{BakeError, Progress, Report, Step};

/// Goes into the hash of what a file was baked from. Raised when the same source and settings give another file.
pub const BAKER_VERSION: u32 = 3;

/// How far above its texel a cube map stands, as a share of the object's diameter: enough that no ray starts under its own
/// surface by rounding.
pub(crate) const LIFT: f32 = 1.0e-4;
/// The far plane, as a multiple of the object's diameter.
const FAR: f32 = 1.001;

/// What can be chosen. `Default` gives the paper's quality at a few megabytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BakeSettings {
    /// Side of the atlas in texels, 8 to 2048. The number of cube maps grows with its square.
    pub atlas: u32,
    /// Side of a cube map's face in pixels, a multiple of 8 up to 256.
    pub depth: u32,
    /// Order of the texels.
    pub strategy: Strategy,
    /// Whether the second UV set is passed over.
    pub unwrap: bool,
}

impl Default for BakeSettings {
    fn default() -> Self {
        Self { atlas: 128, depth: 64, strategy: Strategy::default(), unwrap: false }
    }
}

impl BakeSettings {
    /// Whether all values are in range.
    pub fn check(&self) -> Result<(), BakeError> {
        let wrong = |problem: String| Err(BakeError::Setting(problem));
        if !(8..=2048).contains(&self.atlas) {
            return wrong(format!("atlas {}: 8 to 2048 texels are possible", self.atlas));
        }
        if !(8..=256).contains(&self.depth) || !self.depth.is_multiple_of(8) {
            return wrong(format!("depth {}: a multiple of 8 up to 256 pixels is possible", self.depth));
        }
        Ok(())
    }
}

/// Bakes a scene, on all threads of the current `rayon` pool. The result does not depend on how many those are.
pub fn bake(scene: &Scene, settings: &BakeSettings, progress: &dyn Progress) -> Result<(CssmFile, Report), BakeError> {
    settings.check()?;
    let started = std::time::Instant::now();
    let source = if settings.unwrap { UvSource::Unwrap } else { UvSource::Auto };
    let atlas = Atlas::build(scene, settings.atlas, source, progress)?;
    let blocks = traversal::blocks(&atlas, settings.strategy);
    let (min, max) = scene.bounds();
    let diameter = min.distance(max);
    let bvh = Bvh::new(scene);
    let sphere = Sphere { center: 0.5 * (min + max), radius: 0.5 * FAR * diameter };
    let quantizer = Quantizer::with_far(FAR * diameter);
    let lift = LIFT * diameter;

    let cube_maps: Vec<Vec<CubeMap>> =
        blocks.iter().map(|block| block.iter().map(|&index| cube_map(&atlas, index, lift)).collect()).collect();
    let (maps, stats) = encode_cube_maps(
        &bvh,
        &cube_maps,
        settings.depth as usize,
        quantizer,
        &count(progress, Step::Casting, atlas.texels.len()),
    )?;
    let csm_quantizer = Quantizer::with_far(2.0 * sphere.radius);
    let outside_maps = (outside::GRID * outside::GRID) as usize;
    let csm = encode_outside_maps(&bvh, sphere, csm_quantizer, &count(progress, Step::Outside, outside_maps))?;

    let (texels, cells) = tables(&atlas, &blocks);
    let meta = Meta {
        atlas: atlas.size.to_array(),
        depth: settings.depth,
        texels: atlas.texels.len() as u32,
        blocks: blocks.len() as u32,
        charts: atlas.charts,
        strategy: settings.strategy as u32,
        csm_grid: outside::GRID,
        csm_side: outside::SIDE,
        bounds_min: min.to_array(),
        bounds_max: max.to_array(),
        quantum: quantizer.quantum,
        lift,
        csm_center: sphere.center.to_array(),
        csm_radius: sphere.radius,
        csm_quantum: csm_quantizer.quantum,
        source_hash: scene.source_hash,
        rays: stats.rays,
        close: stats.close,
        runs: stats.runs,
    };
    let parts = parts(scene, &atlas);
    let file = CssmFile { meta, texels, cells, parts, maps, csm };
    let report = Report::new(&file, settings, started.elapsed().as_secs_f64());
    Ok((file, report))
}

/// Tells `progress` of a step of which so many more are done at each call.
pub(crate) fn count(progress: &dyn Progress, step: Step, all: usize) -> impl Fn(usize) + Sync + '_ {
    let done = AtomicUsize::new(0);
    progress.report(step, 0, Some(all));
    move |more| progress.report(step, done.fetch_add(more, Ordering::Relaxed) + more, Some(all))
}

fn cube_map(atlas: &Atlas, index: u32, lift: f32) -> CubeMap {
    let texel = atlas.texels[index as usize].texel;
    let normal = Vec3::from(texel.normal);
    CubeMap { center: Vec3::from(texel.position) + normal * lift, normal }
}

/// Records of the texels in the order of the traversal, and the cells that show them.
fn tables(atlas: &Atlas, blocks: &[Vec<u32>]) -> (Vec<u32>, Vec<u32>) {
    let mut texels = Vec::new();
    let mut cells = vec![NO_TEXEL; (atlas.size.x * atlas.size.y) as usize];
    let mut number = 0;
    for (block, indices) in blocks.iter().enumerate() {
        for (lane, &index) in indices.iter().enumerate() {
            let mut texel = atlas.texels[index as usize].texel;
            texel.slot = (block * LANES + lane) as u32;
            cells[(texel.cell[1] * atlas.size.x + texel.cell[0]) as usize] = number;
            texels.extend(texel.to_words());
            number += 1;
        }
    }
    (texels, cells)
}

/// Atlas coordinates of all triangles of the source.
fn parts(scene: &Scene, atlas: &Atlas) -> Parts {
    let mut parts = Parts::default();
    let mut charted = atlas.charted.corners.iter();
    for part in &scene.parts {
        let mut corners = vec![None; part.source_count as usize];
        for (&number, uv) in part.source_triangles.iter().zip(&mut charted) {
            let uv = uv.map(|uv| part.source_order(uv).map(|uv| (uv / atlas.size.as_vec2()).to_array()));
            corners[number as usize] = uv;
        }
        parts.push(part.numbers, &corners);
    }
    parts
}
