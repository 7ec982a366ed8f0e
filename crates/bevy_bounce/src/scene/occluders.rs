//! What casts shadows into the maps of virtual lights: triangles of chosen levels of detail, or points spread over all surfaces.
//! Chosen anew where instances or settings change; both follow their triangles as these move.

use bevy::prelude::*;
use bevy_bounce_shaders::types::{CHUNK_TRIANGLES, OccluderChunk, POINT_SUBSETS, SurfacePoint};

use super::instances::Instances;
use super::lods::{Candidate, choose};
use super::meshes::Meshes;
use super::regions::Regions;
use super::table::GpuTable;
use crate::VplVisibility;
use crate::avg::finest_voxel;
use crate::settings::{GiSettings, GiWorldSettings, OccluderBudget, StatedLights};

/// Voxels by which the meshes that cast may be off their surfaces. Beyond that lights see by rays through the grid.
pub(crate) const LARGEST_ERROR: f32 = 1.0;

/// See the module.
#[derive(Resource)]
pub(super) struct Occluders {
    /// Of the triangles that cast.
    pub chunks: GpuTable<OccluderChunk>,
    /// How far they are from the surfaces, world units.
    pub error: f32,
    /// Points that cast, in the order of the surfaces.
    pub points: GpuTable<SurfacePoint>,
    /// Of a point, for a light that takes its share of them; square world units.
    pub point_area: f32,
    made_for: Option<Reasons>,
}

/// What the choice follows from.
#[derive(Clone, Copy, PartialEq)]
struct Reasons {
    generation: u32,
    visibility: VplVisibility,
    budget: OccluderBudget,
    tile: u32,
    /// World units that triangles may be off their surfaces.
    tolerance: f32,
}

impl Default for Occluders {
    fn default() -> Self {
        Self {
            chunks: GpuTable::new("bounce_occluder_chunks"),
            error: 0.0,
            points: GpuTable::new("bounce_surface_points"),
            point_area: 0.0,
            made_for: None,
        }
    }
}

impl Occluders {
    /// Whether another tolerance changes nothing: few triangles are fine enough for either.
    fn suffice(&self, made: Reasons, wanted: Reasons) -> bool {
        let triangles: u32 = self.chunks.values().iter().map(|chunk| chunk.triangle_count).sum();
        Reasons { tolerance: wanted.tolerance, ..made } == wanted
            && triangles <= wanted.budget.few
            && self.error <= made.tolerance.min(wanted.tolerance)
    }

    /// The device the buffers were made on is gone.
    pub fn lose_buffers(&mut self) {
        self.chunks.lose_buffer();
        self.points.lose_buffer();
    }
}

/// An instance that casts.
struct Caster<'a> {
    slot: u32,
    /// First index of the whole mesh.
    index_offset: u32,
    candidate: Candidate<'a>,
    /// Running sum of its triangles' areas, square local units.
    areas: &'a [f32],
}

impl Caster<'_> {
    /// Square world units.
    fn area(&self) -> f64 {
        f64::from(self.areas.last().copied().unwrap_or(0.0)) * f64::from(self.candidate.scale).powi(2)
    }
}

pub(super) fn choose_occluders(
    mut occluders: ResMut<Occluders>,
    instances: Res<Instances>,
    meshes: Res<Meshes>,
    settings: Res<GiWorldSettings>,
    stated: Res<StatedLights>,
    regions: Res<Regions>,
) {
    let Some(settings) = settings.0 else { return };
    let triangles = settings.visibility >= VplVisibility::Atlas;
    let voxel = if triangles { finest_voxel(regions.boxes(), settings.grid) } else { 0.0 };
    let wanted = Reasons {
        generation: instances.generation(),
        visibility: settings.visibility,
        budget: stated.occluders(&settings),
        tile: settings.map_edge(),
        tolerance: LARGEST_ERROR * voxel,
    };
    let holds = occluders.made_for.is_some_and(|made| made == wanted || occluders.suffice(made, wanted));
    occluders.made_for = Some(wanted);
    if holds {
        return;
    }
    let casters: Vec<Caster> = instances
        .present()
        .filter_map(|(slot, mesh, bounds)| {
            let mesh = meshes.get(mesh)?;
            let size = (bounds.max - bounds.min).max_element();
            let scale = size / (mesh.bounds.max - mesh.bounds.min).max_element().max(f32::MIN_POSITIVE);
            let candidate = Candidate { lods: &mesh.lods, scale, size };
            Some(Caster { slot, index_offset: mesh.index_offset, candidate, areas: &mesh.areas })
        })
        .collect();
    let (chunks, error) = if triangles { chunks(&casters, &wanted) } else { (Vec::new(), 0.0) };
    occluders.chunks.replace(chunks.into_iter());
    occluders.error = error;
    let count = if settings.visibility == VplVisibility::Ism { point_count(&settings) } else { 0 };
    occluders.points.replace(spread(&casters, count));
    let area: f64 = casters.iter().map(Caster::area).sum();
    occluders.point_area = (area / f64::from((count / POINT_SUBSETS).max(1))) as f32;
}

/// Points for all lights: each takes sixteen a texel of its map.
fn point_count(settings: &GiSettings) -> u32 {
    16 * settings.map_edge().pow(2) * POINT_SUBSETS
}

/// Chunks of the triangles that cast, and their error in world units.
fn chunks(casters: &[Caster], wanted: &Reasons) -> (Vec<OccluderChunk>, f32) {
    let candidates: Vec<&Candidate> = casters.iter().map(|caster| &caster.candidate).collect();
    let mut chunks = Vec::new();
    let mut first_occluder = 0;
    let choice = choose(&candidates, wanted.budget, wanted.tolerance);
    for (caster, level) in casters.iter().zip(choice.levels) {
        let Some(lod) = level.map(|level| caster.candidate.lods[level]) else { continue };
        let error = error_steps(lod.error * caster.candidate.scale / choice.error);
        for first in (0..lod.triangle_count).step_by(CHUNK_TRIANGLES as usize) {
            let triangle_count = (lod.triangle_count - first).min(CHUNK_TRIANGLES);
            let first_index = lod.index_offset + first * 3;
            chunks.push(OccluderChunk { instance: caster.slot, first_index, first_occluder, triangle_count, error });
            first_occluder += triangle_count;
        }
    }
    (chunks, choice.error)
}

/// Thirds of the root of a share, rounded up.
fn error_steps(share: f32) -> u32 {
    if share > 0.0 { (3.0 * share.sqrt()).ceil().min(3.0) as u32 } else { 0 }
}

/// `count` points at equal steps of area, surface by surface; those that a light takes alone are even over each triangle, too.
fn spread<'a>(casters: &'a [Caster], count: u32) -> impl Iterator<Item = SurfacePoint> + 'a {
    let total: f64 = casters.iter().map(Caster::area).sum();
    let mut caster = 0;
    let mut before = 0.0;
    (0..count).filter_map(move |index| {
        let place = (f64::from(index) + 0.5) / f64::from(count) * total;
        while place - before > casters.get(caster)?.area() && caster + 1 < casters.len() {
            before += casters[caster].area();
            caster += 1;
        }
        let c = &casters[caster];
        let local = ((place - before) / f64::from(c.candidate.scale).powi(2)) as f32;
        let triangle = c.areas.partition_point(|sum| *sum <= local).min(c.areas.len().checked_sub(1)?);
        let first_index = c.index_offset + 3 * triangle as u32;
        Some(SurfacePoint { instance: c.slot, first_index, barycentric: barycentric(index) })
    })
}

/// Weights of the second and third corner of a point of a triangle, 16 bits each.
fn barycentric(index: u32) -> u32 {
    let (b, c) = in_triangle(index);
    (b * 65535.0) as u32 | ((c * 65535.0) as u32) << 16
}

/// Steps of a Kronecker sequence in the square of which every fourth is even, too, as [`POINT_SUBSETS`] takes them: the largest circle
/// without a point has 0.97 of the root of the area a point, of either, for 16 to 2048 points. The R2 sequence (Roberts 2018) has 0.86 and
/// 1.7: every fourth of it lies on a few lines.
const STEPS: [f64; 2] = [0.765_183_929_829_757_2, 0.403_490_884_939_937_23];

/// A point of a triangle, even over consecutive indices and over every fourth: weights of its second and third corner. Heitz 2019, "A
/// Low-Distortion Map Between Triangle and Square".
pub(super) fn in_triangle(index: u32) -> (f64, f64) {
    let [u, v] = STEPS.map(|step| ((f64::from(index) + 0.5) * step).fract());
    if u < v { (u / 2.0, v - u / 2.0) } else { (u - v / 2.0, v / 2.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::lods::Lod;

    #[test]
    fn points_are_spread_by_area() {
        let lods = [Lod::default()];
        let caster = |slot, index_offset, scale, areas| {
            let candidate = Candidate { lods: &lods, scale, size: 1.0 };
            Caster { slot, index_offset, candidate, areas }
        };
        // World areas: 1, 3; nothing; 4, 0, 8.
        let casters =
            [caster(5, 0, 1.0, &[1.0, 4.0][..]), caster(6, 100, 1.0, &[]), caster(9, 200, 2.0, &[1.0, 1.0, 3.0])];
        let count = |instance, first_index| {
            spread(&casters, 1600).filter(|p| p.instance == instance && p.first_index == first_index).count()
        };
        let found = [count(5, 0), count(5, 3), count(9, 200), count(9, 203), count(9, 206)];
        for (found, expected) in found.iter().zip([100, 300, 400, 0, 800]) {
            assert!(found.abs_diff(expected) <= 1, "{found} points, expected {expected}");
        }
        assert_eq!(spread(&casters, 1600).count(), 1600);
        assert_eq!(spread(&[], 16).count(), 0);
        assert_eq!(spread(&casters[1..2], 16).count(), 0);
    }

    #[test]
    fn points_of_one_light_and_of_all_are_even_over_a_triangle() {
        let runs = (0..POINT_SUBSETS).map(|first| (first, POINT_SUBSETS)).chain([(0, 1), (777, 1)]);
        for (first, step) in runs {
            // Of 16 triangles of one size that the triangle is cut into: a point in 16 is in each.
            let mut counts = [0; 16];
            for index in (first..).step_by(step as usize).take(400) {
                let (b, c) = in_triangle(index);
                let (x, y) = (4.0 * b, 4.0 * c);
                let upper = x.fract() + y.fract() > 1.0;
                counts[2 * x as usize + usize::from(upper) + [0, 7, 12, 15][y as usize]] += 1;
            }
            assert!(counts.iter().all(|count| (18..=30).contains(count)), "every {step}th from {first}: {counts:?}");
        }
    }

    #[test]
    fn errors_are_never_understated() {
        let steps = [0.0, 0.01, 1.0 / 9.0, 0.2, 0.45, 1.0, 2.0, f32::NAN].map(error_steps);
        assert_eq!(steps, [0, 1, 1, 2, 3, 3, 3, 0]);
    }

    #[test]
    fn points_fill_the_triangle() {
        let mut mean = [0.0; 2];
        for index in 0..4096 {
            let word = barycentric(index);
            let (b, c) = (f64::from(word & 0xffff) / 65535.0, f64::from(word >> 16) / 65535.0);
            assert!(b + c <= 1.0 + 1e-4);
            mean[0] += b / 4096.0;
            mean[1] += c / 4096.0;
        }
        assert!(mean.iter().all(|m| (m - 1.0 / 3.0).abs() < 2e-3), "{mean:?}");
    }
}
