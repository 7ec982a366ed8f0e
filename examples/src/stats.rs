//! What a run cost, as JSON.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use bevy::diagnostic::{Diagnostic, DiagnosticsStore};
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::renderer::RenderAdapterInfo;
use bevy_bounce::radiance_cache::cache_counts;
use bevy_bounce::{gpu_memory, vpl_count};
use serde_json::{Value, json};

use crate::stage_clock::StageClock;
use crate::{Error, Run};

/// Writes adapter, sizes, frame times and stage times.
///
/// `frame_ms` is the wall time of a whole frame, submitted and finished. `stages` are this project's, `engine` is what
/// Bevy itself measures; both with median and 95th percentile, `null` where the adapter has no timestamps.
/// On a software adapter `stages` are wall times: see [`stage_clock`](crate::stage_clock).
pub fn write(app: &mut App, run: &Run, times: &[Duration], path: &Path) -> Result<(), Error> {
    let millis: Vec<f64> = times.iter().map(|time| time.as_secs_f64() * 1e3).collect();
    let (stages, engine) = stages(app);
    let (bytes, bytes_by) = gpu_bytes(app);
    let stats = json!({
        "adapter": app.world().get_resource::<RenderAdapterInfo>().map(|info| info.name.clone()),
        "size": [run.size.x, run.size.y],
        "triangles": triangles(app),
        "vpls": vpls(app),
        "caches": caches(app),
        "gpu_bytes": bytes,
        "gpu_bytes_by": bytes_by,
        "frames": times.len(),
        "frame_ms": { "median": percentile(&millis, 0.5), "p95": percentile(&millis, 0.95), "worst": percentile(&millis, 1.0) },
        "stages": stages,
        "engine": engine,
    });
    let text = format!("{stats:#}\n");
    std::fs::write(path, text).map_err(|error| Error::file(path, format!("cannot be written: {error}")))
}

/// Nearest-rank percentile; `null` of nothing.
fn percentile(values: &[f64], fraction: f64) -> Option<f64> {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let rank = (values.len() as f64 * fraction).ceil() as usize;
    values.get(rank.max(1) - 1).copied()
}

/// Triangles of all mesh instances in the world, seen or not.
fn triangles(app: &mut App) -> usize {
    let mut instances = app.world_mut().query::<&Mesh3d>();
    let meshes = app.world().resource::<Assets<Mesh>>();
    let triangles = |mesh: &Mesh| match mesh.primitive_topology() {
        PrimitiveTopology::TriangleList => mesh.indices().map_or(mesh.count_vertices(), |indices| indices.len()) / 3,
        PrimitiveTopology::TriangleStrip => {
            mesh.indices().map_or(mesh.count_vertices(), |indices| indices.len()).saturating_sub(2)
        }
        _ => 0,
    };
    instances.iter(app.world()).filter_map(|instance| meshes.get(&instance.0)).map(triangles).sum()
}

/// Virtual point lights of the last frame.
fn vpls(app: &mut App) -> u32 {
    app.get_sub_app_mut(RenderApp).and_then(|render| vpl_count(render.world_mut())).unwrap_or(0)
}

/// Radiance caches of each view in the last frame: how many, clusters merged for want of room, pixels, pixels without one.
fn caches(app: &mut App) -> Vec<Value> {
    let counts = app.get_sub_app_mut(RenderApp).map(|render| cache_counts(render.world_mut())).unwrap_or_default();
    let counts = counts
        .into_iter()
        .map(|c| json!({ "caches": c.caches, "merged": c.merged, "pixels": c.pixels, "missing": c.missing }));
    counts.collect()
}

/// What the plugins hold on the GPU: the sum, and by name.
fn gpu_bytes(app: &mut App) -> (u64, BTreeMap<&'static str, u64>) {
    let by_name = app.get_sub_app_mut(RenderApp).map(|render| gpu_memory(render.world_mut())).unwrap_or_default();
    (by_name.values().sum(), by_name)
}

/// Times by stage: this project's, and the engine's.
fn stages(app: &App) -> (BTreeMap<String, Value>, BTreeMap<String, Value>) {
    let (mut ours, mut engine) = (BTreeMap::new(), BTreeMap::new());
    let Some(diagnostics) = app.world().get_resource::<DiagnosticsStore>() else { return (ours, engine) };
    let values = |diagnostic: Option<&Diagnostic>| -> Vec<f64> {
        diagnostic.map(|diagnostic| diagnostic.values().copied().collect()).unwrap_or_default()
    };
    let find = |path: String| diagnostics.iter().find(|diagnostic| diagnostic.path().as_str() == path);
    for diagnostic in diagnostics.iter() {
        let Some(path) = diagnostic.path().as_str().strip_suffix("/elapsed_cpu") else { continue };
        let Some(name) = path.strip_prefix("render/") else { continue };
        let (gpu, cpu) = (values(find(format!("{path}/elapsed_gpu"))), values(Some(diagnostic)));
        let times = json!({
            "gpu_ms": percentile(&gpu, 0.5),
            "gpu_ms_p95": percentile(&gpu, 0.95),
            "cpu_ms": percentile(&cpu, 0.5),
            "cpu_ms_p95": percentile(&cpu, 0.95),
        });
        match name.strip_prefix("bounce/") {
            Some(stage) => ours.insert(stage.to_owned(), times),
            None => engine.insert(name.to_owned(), times),
        };
    }
    let clock = app.world().get_resource::<StageClock>().map(StageClock::stages).unwrap_or_default();
    for (stage, times) in clock {
        let entry = ours.entry(stage.to_owned()).or_insert_with(|| json!({ "cpu_ms": null, "cpu_ms_p95": null }));
        entry["gpu_ms"] = json!(percentile(&times, 0.5));
        entry["gpu_ms_p95"] = json!(percentile(&times, 0.95));
    }
    (ours, engine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_rank() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!(percentile(&values, 0.5), Some(2.0));
        assert_eq!(percentile(&values, 0.95), Some(4.0));
        assert_eq!(percentile(&[], 0.5), None);
    }
}
