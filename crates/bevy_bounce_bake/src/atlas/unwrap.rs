//! Unwrapping, behind one function.
//!
//! Each part is cut into charts and flattened by itself, then all charts are packed together: a double-sided part is
//! flattened once for both of its sides, and packing can be tried again without flattening anew.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{UVec2, Vec2};
use rayon::prelude::*;
use uvunwrap::{Density, MeshInput, Options, Packing, Stage};

use super::Charted;
use crate::scene::{Part, Scene};
use crate::{BakeError, Progress, Step};

/// Empty texels round each chart: charts are two apart where there is room, otherwise they may touch.
const PADDINGS: [u32; 2] = [1, 0];
/// Most triangles of a chart, by its part's average. Time grows faster than charts: a scanned bunny of 144,000 triangles is
/// flattened in 12 s as 409 charts with 1,000, in 16 s as 226 charts with 2,500, in 31 s as 147 charts with 6,000. Fewer
/// charts leave less of the atlas empty.
const CHART_TRIANGLES: usize = 2500;
/// Side of the page on which a part is flattened, in texels: of no consequence but for the time it takes to lay it out.
const PAGE: f32 = 512.0;

/// Charts of a part: a vertex for each corner of each chart.
struct Flat {
    positions: Vec<[f32; 3]>,
    uv: Vec<[f32; 2]>,
    indices: Vec<u32>,
    /// Triangles too thin to have coordinates.
    ignored: Vec<bool>,
}

/// Cuts the scene into charts and packs them into at most `size` by `size` texels, at one density.
pub fn unwrap(scene: &Scene, size: u32, progress: &dyn Progress) -> Result<Charted, BakeError> {
    let flat = flatten(scene, progress)?;
    let inputs: Vec<MeshInput> = flat
        .iter()
        .map(|flat| MeshInput {
            ignored_faces: Some(&flat.ignored),
            existing_uvs: Some(&flat.uv),
            ..MeshInput::new(&flat.positions, &flat.indices)
        })
        .collect();
    let report = |at: uvunwrap::Progress| {
        if at.stage == Stage::Packing {
            progress.report(Step::Packing, at.done, at.total);
        }
        true
    };
    let mut atlas = Err(too_small(size, "its charts", "no density fits"));
    for padding in PADDINGS {
        let options = Options { padding, density: Density::Auto { page_size: size }, ..Default::default() };
        atlas = match uvunwrap::generate_with_progress(&inputs, &options, report) {
            Ok(atlas) if atlas.page_count == 1 => Ok(atlas),
            Ok(atlas) => Err(too_small(size, &format!("its {} charts", atlas.chart_count), "no density fits")),
            Err(error) => Err(too_small(size, "its charts", &error.to_string())),
        };
        if atlas.is_ok() {
            break;
        }
    }
    let atlas = atlas?;
    let page = Vec2::new(atlas.width as f32, atlas.height as f32);
    let (mut corners, mut chart) = (Vec::new(), Vec::new());
    for mesh in &atlas.meshes {
        for triangle in mesh.indices.as_chunks().0 {
            let at: [&uvunwrap::OutputVertex; 3] = triangle.map(|index| &mesh.vertices[index as usize]);
            let one = one_chart(at);
            corners.push(one.map(|_| at.map(|corner| Vec2::from(corner.uv) * page)));
            chart.push(one.unwrap_or(0));
        }
    }
    let size = UVec2::new(atlas.width, atlas.height);
    Ok(Charted { size, corners, chart, charts: atlas.chart_count, from_scene: false })
}

/// The chart of a triangle. One too thin for coordinates has its corners on others' charts, or on none.
fn one_chart(corners: [&uvunwrap::OutputVertex; 3]) -> Option<u32> {
    corners[0].chart.filter(|chart| corners.iter().all(|corner| corner.chart == Some(*chart)))
}

/// The charts of all parts.
fn flatten(scene: &Scene, progress: &dyn Progress) -> Result<Vec<Flat>, BakeError> {
    let fronts = || scene.parts.iter().filter(|part| !part.back);
    let (done, all) = (AtomicUsize::new(0), fronts().map(|part| part.triangles.len()).sum());
    let advance = |more: usize| {
        let done = done.fetch_add(more, Ordering::Relaxed) + more;
        progress.report(Step::Unwrapping, done, Some(all));
    };
    let fronts: Vec<&Part> = fronts().collect();
    let fronts = fronts.par_iter().map(|part| flatten_part(part, &advance)).collect::<Result<Vec<_>, _>>()?;
    let mut fronts = fronts.into_iter();
    let mut flat: Vec<Flat> = Vec::new();
    for part in &scene.parts {
        let next = if part.back { flat.last().map(Flat::turned_over) } else { fronts.next() };
        flat.extend(next);
    }
    Ok(flat)
}

fn flatten_part(part: &Part, advance: &(dyn Fn(usize) + Sync)) -> Result<Flat, BakeError> {
    let positions: Vec<[f32; 3]> = part.positions.iter().map(|position| position.to_array()).collect();
    let input = MeshInput::new(&positions, part.triangles.as_flattened());
    let area: f32 = part
        .triangles
        .iter()
        .map(|corners| {
            let [a, b, c] = corners.map(|index| part.positions[index as usize]);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    let share = CHART_TRIANGLES as f32 / part.triangles.len().max(1) as f32;
    let options = Options {
        max_chart_area: if share < 1.0 { area * share } else { 0.0 },
        density: Density::Fixed { texels_per_unit: PAGE / area.sqrt().max(f32::MIN_POSITIVE), page_size: None },
        padding: 1,
        packing: Packing::Fast,
        ..Default::default()
    };
    let last = AtomicUsize::new(0);
    let report = |at: uvunwrap::Progress| {
        if at.stage == Stage::Parameterizing {
            advance(at.done - last.swap(at.done, Ordering::Relaxed));
        }
        true
    };
    let atlas = uvunwrap::generate_with_progress(&[input], &options, report);
    let atlas = atlas.map_err(|error| BakeError::Atlas(format!("{}: cannot be unwrapped: {error}", part.name)))?;
    let mut flat = Flat { positions: Vec::new(), uv: Vec::new(), indices: Vec::new(), ignored: Vec::new() };
    for mesh in atlas.meshes {
        flat.positions = mesh.vertices.iter().map(|vertex| positions[vertex.xref as usize]).collect();
        flat.uv = mesh.vertices.iter().map(|vertex| vertex.uv).collect();
        let triangles = mesh.indices.as_chunks().0.iter();
        let chart = |triangle: &[u32; 3]| one_chart(triangle.map(|index| &mesh.vertices[index as usize]));
        flat.ignored = triangles.map(|triangle| chart(triangle).is_none()).collect();
        flat.indices = mesh.indices;
    }
    Ok(flat)
}

impl Flat {
    fn turned_over(&self) -> Self {
        let triangles = self.indices.as_chunks::<3>().0.iter();
        Self {
            positions: self.positions.clone(),
            uv: self.uv.clone(),
            indices: triangles.flat_map(|&[a, b, c]| [a, c, b]).collect(),
            ignored: self.ignored.clone(),
        }
    }
}

fn too_small(size: u32, charts: &str, problem: &str) -> BakeError {
    BakeError::Atlas(format!(
        "an atlas of {size} texels is too small for {charts} ({problem}); bake with a larger --atlas"
    ))
}
