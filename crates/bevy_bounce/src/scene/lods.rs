//! Coarser versions of a mesh, for what casts shadows into the small maps of virtual lights; and which of them to take.

use meshoptimizer_rs::{
    Positions, SimplifyOptions, SimplifySettings, Workspace, simplify, simplify_scale, simplify_sloppy,
};

use super::deviation::deviation;
use crate::settings::OccluderBudget;

/// Triangles below which a mesh is not made coarser.
const COARSEST: usize = 24;
/// A level has this share of the triangles of the one before.
const SHARE: usize = 4;
/// A level is kept where it has at most this share of the one before, percent.
const WORTHWHILE: usize = 75;

/// A level of detail.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Lod {
    /// First index, in words.
    pub index_offset: u32,
    /// Triangles.
    pub triangle_count: u32,
    /// How far surfaces are from those of the mesh, but for a twentieth of them, local units.
    pub error: f32,
}

/// Indices of coarser and coarser versions with the same vertices, and their errors in local units: the simplifier's or what is
/// measured, whichever is larger. None for a small mesh, or one that cannot be simplified. `areas` is the running sum of the
/// areas of the triangles.
pub(super) fn simplified(positions: &[[f32; 3]], indices: &[u32], areas: &[f32]) -> Vec<(Vec<u32>, f32)> {
    let mut workspace = Workspace::default();
    let mut levels: Vec<(Vec<u32>, f32)> = Vec::new();
    let finite: Vec<[f32; 3]> = positions.iter().map(|p| p.map(|x| if x.is_finite() { x } else { 0.0 })).collect();
    loop {
        let (from, before) = levels.last().map_or((indices, 0.0), |(indices, error)| (indices.as_slice(), *error));
        if from.len() <= COARSEST * 3 {
            return levels;
        }
        let target = from.len() / SHARE;
        let fits = |indices: &[u32]| !indices.is_empty() && indices.len() * 100 <= from.len() * WORTHWHILE;
        let Some((coarser, error)) = collapse(&finite, from, target, &mut workspace)
            .filter(|(coarser, _)| fits(coarser))
            .or_else(|| cluster(&finite, from, target, &mut workspace).filter(|(coarser, _)| fits(coarser)))
        else {
            return levels;
        };
        let error = (before + error).max(deviation(&finite, indices, areas, &coarser));
        levels.push((coarser, error));
    }
}

/// By collapsing edges: keeps the topology, and may stop before the target.
fn collapse(
    positions: &[[f32; 3]],
    indices: &[u32],
    target_index_count: usize,
    workspace: &mut Workspace,
) -> Option<(Vec<u32>, f32)> {
    let options = SimplifyOptions::ERROR_ABSOLUTE | SimplifyOptions::PERMISSIVE;
    let settings = SimplifySettings { target_index_count, target_error: f32::MAX, options };
    let mesh = simplify(indices, Positions::from_packed(positions), settings, workspace).ok()?;
    Some((mesh.indices, mesh.error))
}

/// By merging vertices in the cells of a grid: for what edge collapses cannot reduce, many small parts.
fn cluster(
    positions: &[[f32; 3]],
    indices: &[u32],
    target_index_count: usize,
    workspace: &mut Workspace,
) -> Option<(Vec<u32>, f32)> {
    let positions = Positions::from_packed(positions);
    let mesh = simplify_sloppy(indices, positions, None, target_index_count, 1.0, workspace).ok()?;
    let extent = simplify_scale(positions).ok()?;
    Some((mesh.indices, mesh.error * extent))
}

/// What one instance has to offer.
pub(super) struct Candidate<'a> {
    /// From fine to coarse; at least one.
    pub lods: &'a [Lod],
    /// World units a local unit.
    pub scale: f32,
    /// Edge of its box, world units.
    pub size: f32,
}

/// The level that each candidate takes, and the largest error among them in world units.
pub(super) struct Choice {
    /// By candidate; `None` for those left out.
    pub levels: Vec<Option<usize>>,
    /// How far what casts is from the surfaces, world units; infinite where something is left out.
    pub error: f32,
}

/// Levels that have at most `budget.few` triangles together, with the smallest error. Where that is above `tolerance`, world units, the
/// coarsest that are not, if they have at most `budget.many`. Where even the coarsest are too many, the smallest candidates are left out.
pub(super) fn choose(candidates: &[&Candidate], budget: OccluderBudget, tolerance: f32) -> Choice {
    let coarsest = |c: &Candidate, error: f32| c.lods.iter().rposition(|lod| lod.error * c.scale <= error).unwrap_or(0);
    let total =
        |error: f32| -> u64 { candidates.iter().map(|c| u64::from(c.lods[coarsest(c, error)].triangle_count)).sum() };
    let mut errors: Vec<f32> = candidates
        .iter()
        .flat_map(|c| c.lods.iter().map(|lod| lod.error * c.scale))
        .filter(|e| e.is_finite())
        .collect();
    errors.sort_unstable_by(f32::total_cmp);
    errors.dedup();
    let first_fitting = errors.partition_point(|error| total(*error) > u64::from(budget.few));
    let last_tolerated = errors.partition_point(|error| *error <= tolerance).checked_sub(1);
    let beyond = last_tolerated
        .filter(|last| *last < first_fitting)
        .map(|last| errors[last])
        .filter(|error| total(*error) <= u64::from(budget.many));
    let (error, budget) = match beyond {
        Some(error) => (error, budget.many),
        None => (errors.get(first_fitting).copied().unwrap_or(f32::MAX), budget.few),
    };
    let levels: Vec<usize> = candidates.iter().map(|c| coarsest(c, error)).collect();
    let taken = largest_within(candidates, &levels, budget);
    let all_cast = taken.iter().all(Option::is_some);
    Choice { levels: taken, error: if all_cast { error } else { f32::INFINITY } }
}

/// The level of each candidate; of the smallest none, if they would be more than `budget` triangles.
fn largest_within(candidates: &[&Candidate], levels: &[usize], budget: u32) -> Vec<Option<usize>> {
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|&a, &b| candidates[b].size.total_cmp(&candidates[a].size).then(a.cmp(&b)));
    let mut taken = vec![None; candidates.len()];
    let mut left = budget;
    for index in order {
        let triangles = candidates[index].lods[levels[index]].triangle_count;
        if let Some(rest) = left.checked_sub(triangles) {
            left = rest;
            taken[index] = Some(levels[index]);
        }
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of n x n cells, bent by a wave of that height.
    fn sheet(n: u32, height: f32) -> (Vec<[f32; 3]>, Vec<u32>) {
        let at = |i: u32| i as f32 / n as f32;
        let positions = (0..=n).flat_map(|y| (0..=n).map(move |x| [at(x), height * (at(x) * 20.0).sin(), at(y)]));
        let quads = (0..n).flat_map(|y| (0..n).map(move |x| y * (n + 1) + x));
        let indices = quads.flat_map(|i| [i, i + n + 1, i + 1, i + 1, i + n + 1, i + n + 2]);
        (positions.collect(), indices.collect())
    }

    /// The running sum of as much for each triangle.
    fn even_areas(indices: &[u32]) -> Vec<f32> {
        (1..=indices.len() / 3).map(|count| count as f32).collect()
    }

    #[test]
    fn a_flat_sheet_becomes_coarse_without_error() {
        let (positions, indices) = sheet(32, 0.0);
        let levels = simplified(&positions, &indices, &even_areas(&indices));
        let counts: Vec<usize> = levels.iter().map(|(indices, _)| indices.len() / 3).collect();
        assert!(counts.len() >= 3 && counts.is_sorted_by(|a, b| a > b), "{counts:?}");
        let area = |indices: &[u32]| -> f32 {
            let corner = |i: u32| positions[i as usize];
            let triangle = |t: &[u32; 3]| {
                let [a, b, c] = t.map(corner);
                ((b[0] - a[0]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[0] - a[0])).abs() / 2.0
            };
            indices.as_chunks().0.iter().map(triangle).sum()
        };
        for (indices, error) in &levels {
            assert!(*error < 1e-3, "{error}");
            assert!((area(indices) - 1.0).abs() < 1e-3, "{} of the sheet is left", area(indices));
        }
    }

    #[test]
    fn the_error_is_that_of_the_surface() {
        let (positions, indices) = sheet(64, 0.05);
        let levels = simplified(&positions, &indices, &even_areas(&indices));
        let (_, last) = levels.last().expect("has levels");
        assert!(
            levels.is_sorted_by(|a, b| a.1 <= b.1) && (0.005..0.3).contains(last),
            "{last}, {} levels",
            levels.len()
        );
    }

    #[test]
    fn a_small_mesh_stays() {
        let (positions, indices) = sheet(3, 0.0);
        assert!(simplified(&positions, &indices, &even_areas(&indices)).is_empty());
        assert!(
            simplified(&[[f32::NAN; 3]; 3], &[0, 1, 2].repeat(200), &[0.0; 200]).len() < 3,
            "does not loop for ever"
        );
    }

    fn lods(counts: &[u32]) -> Vec<Lod> {
        let lod =
            |(level, &triangle_count): (usize, &u32)| Lod { triangle_count, error: level as f32, ..Lod::default() };
        counts.iter().enumerate().map(lod).collect()
    }

    #[test]
    fn the_budget_goes_where_errors_are_large() {
        let (fine, coarse) = (lods(&[1000, 250, 60]), lods(&[800, 200]));
        let candidates =
            [Candidate { lods: &fine, scale: 1.0, size: 1.0 }, Candidate { lods: &coarse, scale: 0.1, size: 0.5 }];
        let within = |few| choose(&candidates.each_ref(), OccluderBudget { few, many: few }, 0.0);
        let chosen = |budget| within(budget).levels;
        assert_eq!(chosen(1800), [Some(0), Some(0)]);
        assert_eq!(chosen(1799), [Some(0), Some(1)], "the smaller one has the smaller error");
        assert_eq!(chosen(1199), [Some(1), Some(1)]);
        assert_eq!(chosen(260), [Some(2), Some(1)]);
        assert_eq!(chosen(259), [Some(2), None], "the smaller one is left out");
        assert_eq!(chosen(0), [None, None]);
        assert_eq!([1800, 1799, 1199, 259].map(|budget| within(budget).error), [0.0, 0.1, 1.0, f32::INFINITY]);
        assert!(choose(&[], OccluderBudget { few: 100, many: 100 }, 0.0).levels.is_empty());
    }

    #[test]
    fn the_budget_grows_as_far_as_the_tolerance_asks() {
        let lods = lods(&[1000, 250, 60]);
        let candidates = [Candidate { lods: &lods, scale: 1.0, size: 1.0 }];
        let error =
            |few, many, tolerance| choose(&candidates.each_ref(), OccluderBudget { few, many }, tolerance).error;
        assert_eq!(error(100, 1000, 2.0), 2.0, "fine enough as it is");
        assert_eq!(error(100, 1000, 1.9), 1.0, "the coarsest that is tolerated");
        assert_eq!(error(100, 1000, 0.5), 0.0);
        assert_eq!(error(100, 999, 0.5), 2.0, "too many: as if nothing were tolerated");
        assert_eq!(error(300, 1000, 1.5), 1.0);
        assert_eq!(error(1000, 1000, 1.5), 0.0, "no coarser than it must be");
    }
}
