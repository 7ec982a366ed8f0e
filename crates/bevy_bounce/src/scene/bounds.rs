//! Axis-aligned boxes.

use bevy::math::{Affine3A, Vec3, Vec3A};

/// A box; empty where `min` is above `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    /// Lowest corner.
    pub min: Vec3,
    /// Highest corner.
    pub max: Vec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Bounds {
    /// Holds nothing.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// Grows to hold a point.
    pub fn include(&mut self, point: Vec3) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }

    /// The box of both.
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Sum of the two as sets: every point of one moved by every point of the other.
    pub fn sum(&self, other: &Self) -> Self {
        Self { min: self.min + other.min, max: self.max + other.max }
    }

    /// The box of what it holds times a factor of either sign.
    pub fn scaled(&self, factor: f32) -> Self {
        let (a, b) = (self.min * factor, self.max * factor);
        Self { min: a.min(b), max: a.max(b) }
    }

    /// The smallest box round it after the transform. Arvo, Transforming Axis-Aligned Bounding Boxes, Graphics Gems, 1990.
    pub fn transformed(&self, transform: &Affine3A) -> Self {
        if self.is_empty() {
            return *self;
        }
        let center = transform.transform_point3a(Vec3A::from((self.min + self.max) * 0.5));
        let half = Vec3A::from((self.max - self.min) * 0.5);
        let m = transform.matrix3;
        let extent = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        Self { min: (center - extent).into(), max: (center + extent).into() }
    }

    /// Area of its shadow on a plane across that unit direction.
    pub fn projected_area(&self, direction: Vec3) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        let size = self.max - self.min;
        direction.abs().dot(Vec3::new(size.y * size.z, size.z * size.x, size.x * size.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::math::Quat;

    const BOX: Bounds = Bounds { min: Vec3::new(-1.0, -2.0, -3.0), max: Vec3::new(1.0, 2.0, 5.0) };

    #[test]
    fn transform_holds_every_corner() {
        let transform = Affine3A::from_scale_rotation_translation(
            Vec3::new(-2.0, 0.5, 1.0),
            Quat::from_rotation_y(0.7) * Quat::from_rotation_x(1.1),
            Vec3::new(4.0, -7.0, 1.0),
        );
        let mut expected = Bounds::EMPTY;
        for corner in 0..8 {
            let pick = |bit: u32, low: f32, high: f32| if corner & bit == 0 { low } else { high };
            expected.include(transform.transform_point3(Vec3::new(
                pick(1, BOX.min.x, BOX.max.x),
                pick(2, BOX.min.y, BOX.max.y),
                pick(4, BOX.min.z, BOX.max.z),
            )));
        }
        let found = BOX.transformed(&transform);
        assert!(found.min.abs_diff_eq(expected.min, 1e-4) && found.max.abs_diff_eq(expected.max, 1e-4));
    }

    #[test]
    fn nothing_stays_nothing() {
        assert!(Bounds::EMPTY.transformed(&Affine3A::from_translation(Vec3::ONE)).is_empty());
        assert_eq!(Bounds::EMPTY.union(&BOX), BOX);
        assert_eq!(Bounds::EMPTY.projected_area(Vec3::X), 0.0);
    }

    #[test]
    fn shadow_of_a_box() {
        assert_eq!(BOX.projected_area(Vec3::X), 32.0);
        assert_eq!(BOX.projected_area(Vec3::NEG_Z), 8.0);
        let diagonal = Bounds { min: Vec3::ZERO, max: Vec3::ONE }.projected_area(Vec3::ONE.normalize());
        assert!((diagonal - 3f32.sqrt()).abs() < 1e-5);
    }

    #[test]
    fn scaled_by_a_negative_factor() {
        assert_eq!(BOX.scaled(-2.0), Bounds { min: Vec3::new(-2.0, -4.0, -10.0), max: Vec3::new(2.0, 4.0, 6.0) });
    }
}
