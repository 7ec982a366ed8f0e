//! Boxes round the cameras, each within the next, the last of which holds all: near a camera a large world is seen finely,
//! farther away coarsely. Grids are placed by them, and paths share themselves out between them.

use bevy::math::{Vec3, Vec3A};
use bevy::prelude::*;
use bevy_bounce_shaders::types::{REGIONS, Region};

use super::bounds::Bounds;
use super::extract::SceneCameras;
use super::instances::Instances;
use crate::settings::GiWorldSettings;

/// Edge of a box over that of the one within it.
const GROWTH: f32 = 4.0;
/// Parts of the range in which the boxes know the scene's bounds.
const STEPS: f32 = 8.0;

/// The boxes of this frame, at most [`REGIONS`]; a single one where the scene is no larger than what is fine.
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub(crate) struct Regions {
    boxes: Vec<Bounds>,
}

impl Regions {
    /// Boxes that reach `range` from the cameras, then [`GROWTH`] times as far, moved so that they stay within the scene's bounds,
    /// or little outside. Their size does not depend on where the cameras are, but for their distance from each other, and hardly
    /// on what comes and goes.
    fn around(cameras: &[Vec3A], bounds: Bounds, range: f32) -> Self {
        let mut boxes = Vec::new();
        let mut seen = Bounds::EMPTY;
        for camera in cameras.iter().filter(|camera| camera.is_finite()) {
            seen.include(Vec3::from(*camera));
        }
        if !(bounds.is_empty() || seen.is_empty()) {
            let step = range / STEPS;
            let (low, high) = ((bounds.min / step).floor() * step, (bounds.max / step).ceil() * step);
            let extent = high - low;
            let mut reach = range;
            while boxes.len() + 1 < REGIONS {
                let wanted = seen.max - seen.min + 2.0 * reach;
                if wanted.cmpge(bounds.max - bounds.min).all() {
                    break;
                }
                let size = wanted.min(extent);
                let min = (seen.min - reach).min(high - size).max(low);
                boxes.push(Bounds { min, max: min + size });
                reach *= GROWTH;
            }
        }
        boxes.push(bounds);
        Self { boxes }
    }

    /// A single box.
    #[cfg(test)]
    pub fn of(min: Vec3, max: Vec3) -> Self {
        Self { boxes: vec![Bounds { min, max }] }
    }

    /// Middle of the innermost box; of a scene without anything in it, the world's origin.
    pub fn center(&self) -> Vec3 {
        let inner = self.boxes.first().filter(|inner| !inner.is_empty());
        inner.map_or(Vec3::ZERO, |inner| 0.5 * (inner.min + inner.max))
    }

    /// From the innermost to the whole scene.
    pub fn boxes(&self) -> &[Bounds] {
        &self.boxes
    }

    /// Share of the light at a point that paths are spent on: 1 in the innermost box, beyond it falling with the cube of the
    /// distance. See `importance` in `shared/scene.wgsl`.
    pub fn importance(&self, point: Vec3) -> f32 {
        let Some(inner) = self.boxes.first().filter(|_| self.boxes.len() > 1) else { return 1.0 };
        let half = 0.5 * (inner.max - inner.min);
        let distance = (point - (inner.min + half)).abs() / half.max(Vec3::splat(f32::MIN_POSITIVE));
        distance.max_element().max(1.0).powi(-3)
    }

    /// Area that a directional light shines on, each box with its weight.
    pub fn weighted_area(&self, direction: Vec3) -> f32 {
        self.boxes.iter().enumerate().map(|(i, region)| weight(i) * region.projected_area(direction)).sum()
    }

    /// As the GPU has them, and how many.
    pub fn on_gpu(&self) -> ([Region; REGIONS], u32) {
        let mut regions = [Region::default(); REGIONS];
        for (i, (region, bounds)) in regions.iter_mut().zip(&self.boxes).enumerate() {
            *region = Region { min: bounds.min, weight: weight(i), max: bounds.max, padding: 0 };
            if bounds.is_empty() {
                (region.min, region.max) = (Vec3::ZERO, Vec3::ZERO);
            }
        }
        (regions, self.boxes.len() as u32)
    }
}

/// As [`Regions::importance`] at the faces of a box.
fn weight(index: usize) -> f32 {
    GROWTH.powi(-3 * index as i32)
}

/// Places the boxes.
pub(super) fn place_regions(
    mut regions: ResMut<Regions>,
    cameras: Res<SceneCameras>,
    instances: Res<Instances>,
    settings: Res<GiWorldSettings>,
) {
    let range = settings.0.map_or(f32::INFINITY, |settings| settings.range);
    regions.set_if_neq(Regions::around(&cameras.positions, instances.bounds(), range));
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORLD: Bounds = Bounds { min: Vec3::new(-500.0, 0.0, -500.0), max: Vec3::new(500.0, 20.0, 500.0) };

    fn around(camera: Vec3, range: f32) -> Vec<Bounds> {
        Regions::around(&[camera.into()], WORLD, range).boxes
    }

    #[test]
    fn a_small_scene_has_one() {
        assert_eq!(around(Vec3::ZERO, 500.0), [WORLD]);
        assert_eq!(around(Vec3::new(1e4, 0.0, 0.0), f32::INFINITY), [WORLD]);
        assert_eq!(Regions::around(&[], WORLD, 40.0).boxes, [WORLD]);
        assert_eq!(Regions::around(&[Vec3A::NAN], WORLD, 40.0).boxes, [WORLD]);
        assert_eq!(Regions::around(&[Vec3A::ZERO], Bounds::EMPTY, 40.0).boxes, [Bounds::EMPTY]);
    }

    #[test]
    fn each_is_within_the_next_and_keeps_its_size() {
        for camera in [Vec3::ZERO, Vec3::new(490.0, 2.0, -499.0), Vec3::new(123.4, 50.0, -700.0)] {
            let boxes = around(camera, 40.0);
            assert_eq!(boxes.len(), 3, "{boxes:?}");
            for (i, pair) in boxes.windows(2).enumerate() {
                let size = 80.0 * GROWTH.powi(i as i32);
                assert!((pair[0].max - pair[0].min).abs_diff_eq(Vec3::new(size, 20.0, size), 1e-3), "{boxes:?}");
                assert!(
                    pair[0].min.cmpge(pair[1].min).all() && pair[0].max.cmple(pair[1].max + 1e-3).all(),
                    "{boxes:?}"
                );
            }
            assert_eq!(boxes[2], WORLD);
        }
    }

    #[test]
    fn there_are_no_more_than_fit() {
        let boxes = around(Vec3::ZERO, 1e-3);
        assert_eq!(boxes.len(), REGIONS);
        assert_eq!(boxes[REGIONS - 1], WORLD);
    }

    #[test]
    fn two_cameras_share_theirs() {
        let cameras = [Vec3A::ZERO, Vec3A::new(100.0, 0.0, 0.0)];
        let boxes = Regions::around(&cameras, WORLD, 40.0).boxes;
        assert_eq!(boxes[0], Bounds { min: Vec3::new(-40.0, 0.0, -40.0), max: Vec3::new(140.0, 20.0, 40.0) });
    }

    #[test]
    fn importance_meets_the_weights_at_the_faces() {
        let regions = Regions::around(&[Vec3A::ZERO], WORLD, 40.0);
        assert_eq!(regions.importance(Vec3::new(39.0, 10.0, -12.0)), 1.0);
        assert!((regions.importance(Vec3::new(160.0, 3.0, 0.0)) / weight(1) - 1.0).abs() < 1e-5);
        assert_eq!(Regions::around(&[], WORLD, 40.0).importance(Vec3::splat(1e5)), 1.0);
    }
}
