//! All WGSL of bevy_bounce, and the Rust structs that it mirrors.
//!
//! Every file is listed in [`SHADERS`]; modules are imported by their `#define_import_path`, which is
//! `bevy_bounce::FOLDER::FILE`.

pub mod types;

/// A WGSL file of this crate.
#[derive(Clone, Copy, Debug)]
pub struct ShaderSource {
    /// Path within the crate, e.g. `avg/mark.wgsl`.
    pub path: &'static str,
    /// Its text, with naga_oil directives.
    pub source: &'static str,
    /// Compute entry points; empty for a module that is only imported and for fragment shaders.
    pub entry_points: &'static [&'static str],
}

macro_rules! shaders {
    ($($path:literal => [$($entry:literal),*]),* $(,)?) => {
        /// All shaders, imported modules before those that import them.
        pub const SHADERS: &[ShaderSource] = &[$(ShaderSource {
            path: $path,
            source: include_str!($path),
            entry_points: &[$($entry),*],
        }),*];
    };
}

shaders! {
    "shared/groups.wgsl" => [],
    "shared/octahedral.wgsl" => [],
    "shared/hilbert.wgsl" => [],
    "shared/scene.wgsl" => [],
    "shared/sky.wgsl" => [],
    "shared/sampling.wgsl" => [],
    "shared/lights.wgsl" => [],
    "shared/grid.wgsl" => [],
    "shared/voxel_groups.wgsl" => [],
    "shared/rays.wgsl" => [],
    "shared/triangles.wgsl" => [],
    "sort/radix.wgsl" => ["count_digits", "scan_digits", "scatter"],
    "scene/deform.wgsl" => ["deform"],
    "scene/thumbnail.wgsl" => ["average"],
    "scene/sky.wgsl" => ["measure", "choose"],
    "avg/queue.wgsl" => [],
    "avg/bricks.wgsl" => ["size_bricks"],
    "avg/voxelize.wgsl" => ["triangles", "bricks"],
    "avg/cells.wgsl" => ["count_blocks", "scan_blocks", "assign_cells", "resolve"],
    "avg/distance.wgsl" => ["find_occupied", "pass_x", "pass_y", "pass_z"],
    "vpl/types.wgsl" => [],
    "vpl/emitters.wgsl" => ["collect", "accumulate"],
    "vpl/starts.wgsl" => [],
    "vpl/look_ahead.wgsl" => ["look_ahead"],
    "vpl/trace.wgsl" => ["trace_paths"],
    "vpl/order.wgsl" => ["scan_paths", "write_pairs"],
    "vpl/weights.wgsl" => ["scan_weights"],
    "vpl/cuts.wgsl" => ["measure_nodes", "cut"],
    "vpl/list.wgsl" => ["build_list"],
    "vpl/places.wgsl" => ["file_lights", "set_lights"],
    "vpl/settle.wgsl" => ["meet_triangles"],
    "vpl/group_areas.wgsl" => ["add_group_areas"],
    "vpl/density.wgsl" => ["measure_density"],
    "vpl/bound.wgsl" => [],
    "shadow_atlas/types.wgsl" => [],
    "shadow_atlas/tile.wgsl" => [],
    "shadow_atlas/masks.wgsl" => [],
    "shadow_atlas/lookup.wgsl" => [],
    "shadow_atlas/occluders.wgsl" => ["place_occluders"],
    "shadow_atlas/rasterize.wgsl" => ["rasterize"],
    "shadow_atlas/eyes.wgsl" => ["find_eyes"],
    "shadow_atlas/baked.wgsl" => ["draw_baked"],
    "shadow_atlas/points.wgsl" => ["place_points"],
    "shadow_atlas/splat.wgsl" => ["splat_points"],
    "interleaved/surface.wgsl" => [],
    "interleaved/sky.wgsl" => [],
    "interleaved/gather.wgsl" => [],
    "interleaved/shade.wgsl" => ["shade"],
    "interleaved/filter.wgsl" => ["filter_rows", "filter_columns"],
    "probes/types.wgsl" => [],
    "probes/place.wgsl" => ["place"],
    "probes/light.wgsl" => ["gather_probes"],
    "probes/sky.wgsl" => ["add_sky"],
    "probes/fill.wgsl" => ["fill"],
    "fog/types.wgsl" => [],
    "fog/incident.wgsl" => [],
    "fog/scatter.wgsl" => [],
    "fog/add.wgsl" => [],
    "ssbc/common.wgsl" => [],
    "ssbc/hierarchy.wgsl" => [],
    "ssbc/upsample.wgsl" => [],
    "ssbc/integrate.wgsl" => [],
    "ssbc/radiance.wgsl" => ["radiance"],
    "ssbc/reduce.wgsl" => ["reduce"],
    "ssbc/gather.wgsl" => ["gather"],
    "ssbc/blur.wgsl" => ["blur"],
    "ssbc/apply.wgsl" => [],
    "cssm/types.wgsl" => [],
    "cssm/texels.wgsl" => [],
    "cssm/maps.wgsl" => [],
    "cssm/query.wgsl" => [],
    "cssm/tree.wgsl" => [],
    "cssm/gather.wgsl" => [],
    "cssm/locate.wgsl" => [],
    "cssm/lobe.wgsl" => [],
    "cssm/emit.wgsl" => ["emit"],
    "cssm/direct.wgsl" => ["direct"],
    "cssm/hierarchy.wgsl" => ["leaves", "pull", "pull_top"],
    "cssm/bounce.wgsl" => ["bounce"],
    "debug/heat.wgsl" => [],
    "cssm/pixels.wgsl" => ["pixels"],
    "cssm/smooth.wgsl" => ["smooth_pixels"],
    "radiance_cache/types.wgsl" => [],
    "radiance_cache/places.wgsl" => ["list_places", "list_group_places", "measure_unit"],
    "radiance_cache/light.wgsl" => ["light_cells"],
    "radiance_cache/volume.wgsl" => ["fill"],
    "radiance_cache/reduce.wgsl" => ["reduce"],
    "radiance_cache/normals.wgsl" => [],
    "radiance_cache/frame.wgsl" => ["choose_axes"],
    "radiance_cache/keys.wgsl" => ["write_keys"],
    "radiance_cache/clusters.wgsl" => ["count_differences", "choose_coarseness", "count_blocks", "scan_blocks", "number_clusters"],
    "radiance_cache/keep.wgsl" => ["keep"],
    "radiance_cache/place.wgsl" => ["place"],
    "radiance_cache/hemisphere.wgsl" => [],
    "radiance_cache/lobes.wgsl" => [],
    "radiance_cache/cone.wgsl" => [],
    "radiance_cache/group_cones.wgsl" => [],
    "radiance_cache/march.wgsl" => [],
    "radiance_cache/create.wgsl" => ["create"],
    "radiance_cache/evaluate.wgsl" => ["evaluate"],
    "history/surfaces.wgsl" => [],
    "history/recall.wgsl" => [],
    "history/average.wgsl" => ["average"],
    "history/keep.wgsl" => ["keep"],
    "compose/surface.wgsl" => ["pack"],
    "compose/gbuffer.wgsl" => [],
    "compose/mirrored.wgsl" => [],
    "compose/direct.wgsl" => [],
    "compose/reflections.wgsl" => [],
    "compose/compose.wgsl" => [],
    "debug/voxels.wgsl" => ["show_voxels"],
    "debug/atlas.wgsl" => ["show_atlas"],
    "debug/clusters.wgsl" => ["show_clusters"],
    "debug/caches.wgsl" => ["show_caches"],
    "debug/levels.wgsl" => ["show_levels"],
    "debug/tree.wgsl" => ["show_tree"],
    "debug/baked_atlas.wgsl" => ["show_baked_atlas"],
}

/// The shader of that path.
pub fn shader(path: &str) -> Option<&'static ShaderSource> {
    SHADERS.iter().find(|shader| shader.path == path)
}
