//! Unwrapping, behind one function.

use glam::{UVec2, Vec2};
use uvunwrap::{Density, MeshInput, Options, Stage};

use super::Charted;
use crate::{BakeError, Progress, Step, scene::Scene};

/// Empty texels round each chart: charts are two apart where there is room, otherwise they may touch.
const PADDINGS: [u32; 2] = [1, 0];

/// Cuts the scene into charts and packs them into at most `size` by `size` texels, at one density.
pub fn unwrap(scene: &Scene, size: u32, progress: &dyn Progress) -> Result<Charted, BakeError> {
    let positions: Vec<Vec<[f32; 3]>> =
        scene.parts.iter().map(|part| part.positions.iter().map(|position| position.to_array()).collect()).collect();
    let inputs: Vec<MeshInput> = scene
        .parts
        .iter()
        .zip(&positions)
        .map(|(part, positions)| MeshInput::new(positions, part.triangles.as_flattened()))
        .collect();
    let report = |at: uvunwrap::Progress| {
        match at.stage {
            Stage::Parameterizing => progress.report(Step::Unwrapping, at.done, at.total),
            Stage::Packing => progress.report(Step::Packing, at.done, at.total),
            _ => (),
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
            // A triangle too thin for coordinates has its corners on others' charts, or on none.
            let one = at[0].chart.filter(|chart| at.iter().all(|corner| corner.chart == Some(*chart)));
            corners.push(one.map(|_| at.map(|corner| Vec2::from(corner.uv) * page)));
            chart.push(one.unwrap_or(0));
        }
    }
    let size = UVec2::new(atlas.width, atlas.height);
    Ok(Charted { size, corners, chart, charts: atlas.chart_count, from_scene: false })
}

fn too_small(size: u32, charts: &str, problem: &str) -> BakeError {
    BakeError::Atlas(format!(
        "an atlas of {size} texels is too small for {charts} ({problem}); bake with a larger --atlas"
    ))
}
