//! What the air takes from the light of suns on its way to the scene, as Bevy's `Atmosphere` takes it from their direct light.
//!
//! `directional_light` in Bevy 0.19's `pbr_lighting.wgsl` multiplies the colour of every directional light by the transmittance of the
//! air from the lit point to the edge of the atmosphere, which it looks up in a table, and by the part of the sun's disc above
//! the horizon. Here an entry of that table is summed up on the CPU, once a light and frame, at as many points on the way as Bevy takes
//! (`AtmosphereSettings::transmittance_lut_samples`) and at the same ones: its sum is coarse and lets more of a low sun through than the
//! integral would, and what bounces has to go with what is seen.
//!
//! Bevy looks it up for every point, this for one: the middle of the scene or, of a large one, of what is near the cameras
//! ([`Regions::center`]), which does not move with a camera in a small scene. A kilometre aside or a hundred metres up
//! changes little of it. The atmosphere is the one that the first camera with global illumination, by its order, is lit by; it has
//! `AtmosphereSettings`, as Bevy asks of every camera.

use bevy::ecs::system::SystemParam;
use bevy::light::atmosphere::ScatteringTerm;
use bevy::pbr::{ExtractedAtmosphere, GpuAtmosphereSettings, GpuScatteringMedium};
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;

use super::extract::SceneCameras;
use super::regions::Regions;

/// Bevy lifts what is below the planet's surface to so many of its units above it: `EPSILON` in `atmosphere/functions.wgsl`.
const SURFACE: f32 = 1.0;
/// Where on each step of its sum Bevy looks how dense the air is: `MIDPOINT_RATIO` in `atmosphere/functions.wgsl`.
const POINT_OF_STEP: f32 = 0.3;

/// Finds the atmosphere.
#[derive(SystemParam)]
pub(super) struct AirOfScene<'w, 's> {
    cameras: Res<'w, SceneCameras>,
    regions: Res<'w, Regions>,
    atmospheres: Query<'w, 's, (&'static ExtractedAtmosphere, &'static GpuAtmosphereSettings)>,
    media: Option<Res<'w, RenderAssets<GpuScatteringMedium>>>,
}

impl AirOfScene<'_, '_> {
    /// The air over the scene; `None` without an atmosphere, and until its medium is loaded.
    pub fn find(&self) -> Option<Air<'_>> {
        let (atmosphere, settings) = self.atmospheres.get(self.cameras.first?).ok()?;
        let medium = self.media.as_ref()?.get(atmosphere.medium)?;
        Some(Air::new(atmosphere, settings, &medium.terms, self.regions.center()))
    }
}

/// Air over a place. Lengths are those of the atmosphere's own space: metres, unless its entity is scaled.
#[derive(Clone)]
pub(super) struct Air<'a> {
    atmosphere: &'a ExtractedAtmosphere,
    settings: &'a GpuAtmosphereSettings,
    terms: &'a [ScatteringTerm],
    /// Distance of the place from the planet's centre.
    radius: f32,
    /// Away from the planet.
    up: Vec3,
}

impl<'a> Air<'a> {
    fn new(
        atmosphere: &'a ExtractedAtmosphere,
        settings: &'a GpuAtmosphereSettings,
        terms: &'a [ScatteringTerm],
        place: Vec3,
    ) -> Self {
        let place = atmosphere.world_to_atmosphere.transform_point3(place);
        let radius = place.length().max(atmosphere.inner_radius + SURFACE);
        Self { atmosphere, settings, terms, radius, up: place.normalize_or(Vec3::Y) }
    }

    /// Share of the light of a sun in that unit direction, `diameter` radians wide, that reaches the place.
    pub fn lets_through(&self, to_sun: Vec3, diameter: f32) -> Vec3 {
        let cos_zenith = to_sun.dot(self.up).clamp(-1.0, 1.0);
        self.above_horizon(cos_zenith, diameter) * self.transmittance(cos_zenith)
    }

    /// `calculate_visible_sun_ratio` in `atmosphere/functions.wgsl`, with exact arc cosines.
    fn above_horizon(&self, cos_zenith: f32, diameter: f32) -> f32 {
        let sine = self.atmosphere.inner_radius / self.radius;
        let horizon = (-(1.0 - sine * sine).sqrt()).acos();
        let above = horizon - cos_zenith.acos();
        if above >= 0.5 * diameter {
            1.0
        } else if above <= -0.5 * diameter {
            0.0
        } else {
            0.5 + above / diameter
        }
    }

    /// From the place to the edge of the atmosphere: `ray_optical_depth` in `atmosphere/transmittance_lut.wgsl`.
    fn transmittance(&self, cos_zenith: f32) -> Vec3 {
        let (radius, cos_zenith) = self.in_table(cos_zenith);
        let length = way_out(radius, cos_zenith, self.atmosphere.outer_radius);
        let count = self.settings.transmittance_lut_samples;
        let (mut depth, mut before) = (Vec3::ZERO, 0.0);
        for i in 0..count {
            let t = length * (i as f32 + POINT_OF_STEP) / count as f32;
            let height = (t * t + 2.0 * radius * cos_zenith * t + radius * radius).sqrt();
            depth += self.extinction(height) * (t - before);
            before = t;
        }
        (-depth).exp()
    }

    /// Radius and cosine of the zenith angle that are nearest to the place and that direction of all that the table has: a way
    /// that meets the planet is none of them. Bruneton and Neyret 2008, Precomputed Atmospheric Scattering, section 4.
    fn in_table(&self, cos_zenith: f32) -> (f32, f32) {
        let (inner, outer) = (self.atmosphere.inner_radius, self.atmosphere.outer_radius);
        let tangent = ((outer - inner) * (outer + inner)).sqrt();
        let to_horizon = ((self.radius - inner) * (self.radius + inner)).sqrt();
        let (shortest, longest) = (outer - self.radius, to_horizon + tangent);
        let distance = way_out(self.radius, cos_zenith, outer);
        let half_texel = 0.5 / self.settings.transmittance_lut_size.as_vec2();
        let uv = Vec2::new((distance - shortest) / (longest - shortest), to_horizon / tangent);
        let uv = uv.max(half_texel).min(1.0 - half_texel);

        let to_horizon = uv.y * tangent;
        let radius = to_horizon.hypot(inner);
        let (shortest, longest) = (outer - radius, to_horizon + tangent);
        let distance = shortest + uv.x * (longest - shortest);
        let cosine = (tangent * tangent - to_horizon * to_horizon - distance * distance) / (2.0 * radius * distance);
        (radius, cosine.clamp(-1.0, 1.0))
    }

    /// Part of the light that is absorbed or scattered on each unit of length, at that distance from the planet's centre.
    fn extinction(&self, radius: f32) -> Vec3 {
        let (inner, outer) = (self.atmosphere.inner_radius, self.atmosphere.outer_radius);
        let falloff = (1.0 - (radius - inner) / (outer - inner)).clamp(0.0, 1.0);
        self.terms.iter().map(|term| (term.absorption + term.scattering) * term.falloff.sample(falloff)).sum()
    }
}

/// Length of the way to the sphere of radius `outer` from a distance of `radius` from its centre.
fn way_out(radius: f32, cos_zenith: f32, outer: f32) -> f32 {
    let discriminant = radius * radius * (cos_zenith * cos_zenith - 1.0) + outer * outer;
    (discriminant.max(0.0).sqrt() - radius * cos_zenith).max(0.0)
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use bevy::light::atmosphere::{Falloff, ScatteringMedium};
    use bevy::math::curve::{ConstantCurve, Interval};
    use bevy::pbr::AtmosphereSettings;

    use super::*;

    const INNER: f32 = 6_360_000.0;
    const HEIGHT: f32 = 100_000.0;
    const BETA: Vec3 = Vec3::new(1e-6, 2e-6, 5e-6);
    /// Diameter of the sun seen from Earth, radians.
    const SUN: f32 = 0.0093;

    /// The planet below the origin, in world units of so many metres.
    fn atmosphere(metres: f32) -> ExtractedAtmosphere {
        let planet = Transform::from_xyz(0.0, -INNER / metres, 0.0).with_scale(Vec3::splat(1.0 / metres));
        ExtractedAtmosphere {
            inner_radius: INNER,
            outer_radius: INNER + HEIGHT,
            ground_albedo: Vec3::splat(0.3),
            medium: AssetId::default(),
            world_to_atmosphere: planet.to_matrix().inverse(),
        }
    }

    fn settings(samples: u32) -> GpuAtmosphereSettings {
        AtmosphereSettings { transmittance_lut_samples: samples, ..default() }.into()
    }

    /// Direction to a sun that many degrees above the horizontal.
    fn sun(degrees: f32) -> Vec3 {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Vec3::new(0.6 * cos, sin, -0.8 * cos)
    }

    /// Of air that takes `BETA` a metre where it is densest.
    fn term(falloff: Falloff) -> ScatteringTerm {
        let absorption = BETA * Vec3::new(1.0, 0.0, 0.8);
        ScatteringTerm { absorption, scattering: BETA - absorption, falloff, ..default() }
    }

    fn assert_near(found: Vec3, expected: Vec3, error: f32) {
        assert!((found / expected - 1.0).abs().max_element() < error, "{found}, expected {expected}");
    }

    #[test]
    fn straight_up_through_air_that_thins_exponentially() {
        let scale = 0.08;
        let (atmosphere, settings) = (atmosphere(1.0), settings(20_000));
        let terms = [term(Falloff::Exponential { scale })];
        // Bevy's falloff reaches zero at the edge: (exp(-x / s) - exp(-1 / s)) / (1 - exp(-1 / s)), here from x to 1.
        let depth_above = |x: f32| {
            let end = (-1.0 / scale).exp();
            HEIGHT * (scale * ((-x / scale).exp() - end) - end * (1.0 - x)) / (1.0 - end)
        };
        for altitude in [0.0, 500.0, 8_000.0, 50_000.0] {
            let found = Air::new(&atmosphere, &settings, &terms, Vec3::Y * altitude).lets_through(Vec3::Y, SUN);
            let expected = (-BETA * depth_above(altitude / HEIGHT)).exp();
            // The table begins half a texel beside the zenith, and is in texels of height.
            assert_near(found, expected, 0.01);
        }
    }

    #[test]
    fn along_every_way_through_even_air() {
        let atmosphere = atmosphere(1.0);
        let terms = [term(Falloff::from_curve(ConstantCurve::new(Interval::UNIT, 1.0)))];
        let settings = settings(20_000);
        for degrees in [60.0, 20.0, 5.0, 1.0_f32] {
            let air = Air::new(&atmosphere, &settings, &terms, Vec3::Y * 200.0);
            // By the law of cosines, of the triangle with the planet's centre.
            let (radius, outer, sin) = (INNER + 200.0, INNER + HEIGHT, degrees.to_radians().sin());
            let chord = (outer * outer - radius * radius * (1.0 - sin * sin)).sqrt() - radius * sin;
            assert_near(air.lets_through(sun(degrees), SUN), (-BETA * chord).exp(), 0.01);
        }
    }

    #[test]
    fn a_low_sun_is_dim_and_red_in_the_air_of_earth() {
        let (atmosphere, settings) = (atmosphere(1.0), settings(40));
        let medium = ScatteringMedium::default();
        let air = Air::new(&atmosphere, &settings, &medium.terms, Vec3::ZERO);
        let mut above = Vec3::ONE;
        for degrees in [90.0, 45.0, 20.0, 10.0, 5.0, 2.0, 1.0] {
            let found = air.lets_through(sun(degrees), SUN);
            println!("{degrees} degrees above the horizon: {found:.4}");
            assert!(found.cmple(above).all() && found.min_element() > 0.0, "{found} at {degrees}, {above} above it");
            assert!(found.x > found.y && found.y > found.z, "{found} at {degrees}");
            above = found;
        }
    }

    #[test]
    fn a_sun_that_sets_is_cut_by_the_horizon() {
        let (atmosphere, settings) = (atmosphere(1.0), settings(40));
        let vacuum = |place| Air::new(&atmosphere, &settings, &[], place);
        let ground = vacuum(Vec3::ZERO);
        let dip = (INNER / (INNER + SURFACE)).acos().to_degrees();
        let half = 0.5 * SUN * 180.0 / PI;
        assert_eq!(ground.lets_through(sun(half), SUN), Vec3::ONE);
        assert_near(ground.lets_through(sun(-dip), SUN), Vec3::splat(0.5), 0.01);
        assert_eq!(ground.lets_through(sun(-half - 2.0 * dip), SUN), Vec3::ZERO);
        assert_eq!(ground.lets_through(Vec3::NEG_Y, SUN), Vec3::ZERO);
        // From a mountain it is seen longer, and without a disc it goes at once.
        let mountain = vacuum(Vec3::Y * 5_000.0);
        assert_eq!(mountain.lets_through(sun(-1.0), SUN), Vec3::ONE);
        assert_eq!([sun(0.1), sun(-0.1)].map(|sun| ground.lets_through(sun, 0.0)), [Vec3::ONE, Vec3::ZERO]);
    }

    #[test]
    fn units_of_the_world_do_not_matter() {
        let medium = ScatteringMedium::default();
        let settings = settings(40);
        let [metres, kilometres] = [1.0, 1000.0].map(|metres| {
            let atmosphere = atmosphere(metres);
            Air::new(&atmosphere, &settings, &medium.terms, Vec3::Y * 2_000.0 / metres).lets_through(sun(8.0), SUN)
        });
        assert_near(kilometres, metres, 1e-3);
    }

    #[test]
    fn every_place_has_a_finite_share() {
        let (atmosphere, settings) = (atmosphere(1.0), settings(40));
        let medium = ScatteringMedium::default();
        for place in [Vec3::ZERO, Vec3::NEG_Y * INNER, Vec3::NEG_Y * 1e5, Vec3::Y * HEIGHT, Vec3::Y * 1e8] {
            let air = Air::new(&atmosphere, &settings, &medium.terms, place);
            for degrees in [90.0, 30.0, 0.0, -0.3, -30.0, -90.0] {
                let share = air.lets_through(sun(degrees), SUN);
                assert!(share.min_element() >= 0.0 && share.max_element() <= 1.0, "{share} at {place}, {degrees}");
            }
        }
    }
}
