//! A budget in milliseconds: quality follows what bounced light takes on the GPU.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy::render::diagnostic::RenderDiagnosticsPlugin;
//! use bevy_bounce::prelude::*;
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, RenderDiagnosticsPlugin, GlobalIlluminationPlugins::default()))
//!     .add_systems(Startup, |mut commands: Commands| {
//!         let illumination = GlobalIllumination { quality: Quality::High, budget: Some(4.0), ..default() };
//!         commands.spawn((Camera3d::default(), illumination));
//!     })
//!     .run();
//! ```
//!
//! # What is measured
//!
//! Bevy's [`RenderDiagnosticsPlugin`] takes timestamps around each stage of the
//! plugins: `render/bounce/STAGE/elapsed_gpu`. A frame costs the sum of them over all cameras, without `direct`, which is Bevy's own
//! light. Without that plugin, and on devices without timestamps (Bevy has them on Vulkan and Direct3D 12), nothing is known: quality stays
//! as stated, and one warning says why.
//!
//! # What follows
//!
//! Of what the camera's [`Quality`](crate::Quality) states, a budget leaves a share, from all of it to a sixteenth:
//!
//! | setting | becomes |
//! |---|---|
//! | [`GiSettings::vpls`] | that share of it, 64 at least |
//! | [`GiSettings::sky`] | that share of it, 16 at least |
//! | [`SsbcSettings::solid_angle`](crate::SsbcSettings::solid_angle), `edge_solid_angle` | divided by it |
//! | [`CssmSettings::error`](crate::CssmSettings::error) | divided by it |
//!
//! Costs of these are about proportional. All else stays as stated, for its change would be seen: grid, resolutions, iterations, caches,
//! probes. Where these alone take longer, the share is a sixteenth and the budget is overrun. Memory is held for what is stated, so that
//! no change allocates anything.
//!
//! Bounces between baked texels run one a frame, whatever the share; where [texels receive](crate::CssmReceivers::Texels) the last one,
//! that is one or two more.
//!
//! The share is lowered by up to 30 percent every twelve frames while seven frames in a row are above the budget, or
//! where the median of 63 is; and raised by up to five percent every 68 frames while that is below 82 percent of it.
//! Fewer lights are in other places and light a little differently, so that a change is faded in over 40 frames where
//! there is [history](crate::history): in these, its light may be half to twice that of its frame where light is even,
//! and 0.3 to 4.4 times that where it is not. What changes by more than three times, nine where it is uneven, such as a
//! lamp that is switched off, still shows in its frame. Without history all steps are seen.
//!
//! # Several cameras
//!
//! Each camera with a budget has a share of its own, from what all cameras cost together. Virtual lights are made for the most demanding
//! camera: one without a budget has all that it asks for, and those beside it have it, too.

mod controller;

use bevy::diagnostic::{Diagnostic, DiagnosticsStore};
use bevy::platform::time::Instant;
use bevy::prelude::*;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;

use self::controller::{Controller, LEAST_SHARE};
use crate::camera::device_is_adequate;
use crate::{GiSettings, GlobalIllumination, Technique};

/// Bevy's own light in the plugins' place.
const DIRECT: &str = "direct";
/// Frames without a measurement, while the processor's times are measured, after which there will be none.
const PATIENCE: u32 = 120;
/// Fewest virtual lights that a budget leaves.
const FEWEST_LIGHTS: u32 = 64;
/// Directions of the sky come in groups of this size, the subsets of interleaved shading; virtual lights are about as many in each.
const SUBSETS: u32 = 16;

/// What a budget leaves of its camera's quality; on cameras whose [`GlobalIllumination::budget`] is stated. See the [module](self).
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct GiBudget {
    /// Of what quality states, a sixteenth to 1.
    pub share: f32,
    /// What a frame takes with it on the GPU, ms; `None` until it is measured.
    pub spent: Option<f32>,
    #[reflect(ignore)]
    controller: Controller,
    #[reflect(ignore)]
    stated: Option<(Technique, GiSettings)>,
}

impl Default for GiBudget {
    fn default() -> Self {
        Self { share: 1.0, spent: None, controller: Controller::default(), stated: None }
    }
}

impl GiBudget {
    /// After a frame of that cost, ms, within a budget.
    fn after(&mut self, cost: f32, budget: f32, illumination: &GlobalIllumination) {
        let stated = Some((illumination.technique, illumination.quality.settings()));
        // What was measured of other settings says nothing of these; nor where the share was set by hand.
        if self.stated != stated || self.controller.share != self.share {
            self.controller = Controller::at(self.share);
            self.stated = stated;
        }
        self.controller = self.controller.after(cost, budget);
        self.share = self.controller.share;
        self.spent = self.controller.cost().or(self.spent);
    }
}

impl GiSettings {
    /// What a budget leaves of it.
    pub(crate) fn at_share(mut self, share: f32) -> Self {
        let share = if share.is_finite() { share.clamp(LEAST_SHARE, 1.0) } else { 1.0 };
        if share == 1.0 {
            return self;
        }
        let of = |count: u32, fewest: u32| {
            let scaled = (count as f32 * share / SUBSETS as f32).round() as u32 * SUBSETS;
            scaled.max(fewest).min(count)
        };
        self.vpls = of(self.vpls, FEWEST_LIGHTS);
        self.sky = of(self.sky, SUBSETS);
        self.ssbc.solid_angle /= share;
        self.ssbc.edge_solid_angle /= share;
        self.ssbc = self.ssbc.clamped();
        self.cssm.error /= share;
        self.cssm = self.cssm.clamped();
        self
    }
}

/// Lets quality follow budgets; see the [module](self).
pub struct BudgetPlugin;

impl Plugin for BudgetPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<GiBudget>();
    }

    fn finish(&self, app: &mut App) {
        if device_is_adequate(app) {
            let measured = app.is_plugin_added::<RenderDiagnosticsPlugin>();
            app.insert_resource(Clock { measured, ..default() }).add_systems(PostUpdate, follow_budgets);
        }
    }
}

/// Which frame was measured last.
#[derive(Resource, Default)]
struct Clock {
    /// Whether Bevy measures at all.
    measured: bool,
    last: Option<Instant>,
    waited: u32,
    warned: bool,
}

/// Gives cameras with a budget what it leaves them, and takes it from those without.
fn follow_budgets(
    mut commands: Commands,
    mut clock: ResMut<Clock>,
    diagnostics: Option<Res<DiagnosticsStore>>,
    mut cameras: Query<(Entity, &GlobalIllumination, &Camera, Option<&mut GiBudget>)>,
) {
    let mut wanted = false;
    let latest = diagnostics.as_deref().and_then(|diagnostics| latest_cost(diagnostics, "elapsed_gpu"));
    let fresh = latest.filter(|(time, _)| clock.last != Some(*time));
    clock.last = latest.map(|(time, _)| time);
    for (entity, illumination, camera, held) in &mut cameras {
        let budget = illumination.budget.filter(|budget| budget.is_finite() && *budget > 0.0);
        match (budget, held) {
            (None, None) => {}
            (None, Some(_)) => {
                commands.entity(entity).remove::<GiBudget>();
            }
            (Some(_), None) => {
                commands.entity(entity).insert(GiBudget::default());
            }
            (Some(budget), Some(mut held)) if camera.is_active && illumination.is_active() => {
                wanted = true;
                if let Some((_, cost)) = fresh {
                    held.after(cost, budget, illumination);
                }
            }
            _ => {}
        }
    }
    if wanted && latest.is_none() && !clock.warned {
        warn_when_unmeasured(&mut clock, diagnostics.as_deref());
    }
}

/// Says once why nothing is measured.
fn warn_when_unmeasured(clock: &mut Clock, diagnostics: Option<&DiagnosticsStore>) {
    let recorded = diagnostics.and_then(|diagnostics| latest_cost(diagnostics, "elapsed_cpu")).is_some();
    clock.waited += u32::from(recorded);
    if !clock.measured {
        warn!(
            "the budget of bounced light is not followed: nothing is measured without Bevy's RenderDiagnosticsPlugin"
        );
    } else if clock.waited > PATIENCE {
        warn!("the budget of bounced light is not followed: this device takes no timestamps");
    } else {
        return;
    }
    clock.warned = true;
}

/// When the last measured frame came in, and what its stages took together, ms.
fn latest_cost(diagnostics: &DiagnosticsStore, clock: &str) -> Option<(Instant, f32)> {
    let is_ours = |diagnostic: &&Diagnostic| {
        let stage = diagnostic.path().as_str().strip_prefix("render/bounce/").and_then(|path| path.strip_suffix(clock));
        stage.is_some_and(|stage| stage.trim_end_matches('/') != DIRECT)
    };
    let stages: Vec<&Diagnostic> = diagnostics.iter().filter(is_ours).collect();
    let latest = stages.iter().filter_map(|stage| stage.measurement()).map(|measured| measured.time).max()?;
    // Several cameras measure a stage several times.
    let of_frame = stages.iter().flat_map(|stage| stage.measurements()).filter(|measured| measured.time == latest);
    Some((latest, of_frame.map(|measured| measured.value.max(0.0)).sum::<f64>() as f32))
}

#[cfg(test)]
mod tests {
    use bevy::diagnostic::{DiagnosticMeasurement, DiagnosticPath};

    use super::*;
    use crate::Quality;

    #[test]
    fn a_share_takes_away_and_never_adds() {
        for quality in [Quality::Low, Quality::Medium, Quality::High, Quality::Ultra] {
            let stated = quality.settings();
            assert_eq!(stated.at_share(1.0), stated);
            assert_eq!(stated.at_share(f32::NAN), stated);
            let mut last = stated;
            for share in (1..=40).rev().map(|share| share as f32 / 40.0) {
                let given = stated.at_share(share);
                assert!(given.vpls <= last.vpls && given.sky <= last.sky, "{given:?}");
                assert!(given.ssbc.solid_angle >= last.ssbc.solid_angle && given.cssm.error >= last.cssm.error);
                assert!(given.vpls >= FEWEST_LIGHTS && given.sky >= SUBSETS && given.vpls % SUBSETS == 0);
                let left = |given: GiSettings| GiSettings {
                    vpls: stated.vpls,
                    sky: stated.sky,
                    ssbc: stated.ssbc,
                    cssm: stated.cssm,
                    ..given
                };
                assert_eq!(left(given), stated, "what would be seen changes");
                last = given;
            }
        }
        let least = GiSettings { vpls: 16, sky: 0, ..default() }.at_share(0.1);
        assert_eq!((least.vpls, least.sky), (16, 0));
    }

    fn measure(diagnostics: &mut DiagnosticsStore, path: &'static str, time: Instant, value: f64) {
        let path = DiagnosticPath::const_new(path);
        if diagnostics.get(&path).is_none() {
            diagnostics.add(Diagnostic::new(path.clone()));
        }
        if let Some(diagnostic) = diagnostics.get_mut(&path) {
            diagnostic.add_measurement(DiagnosticMeasurement { time, value });
        }
    }

    #[test]
    fn a_frame_costs_its_stages_over_all_cameras() {
        let mut diagnostics = DiagnosticsStore::default();
        assert_eq!(latest_cost(&diagnostics, "elapsed_gpu"), None);
        let first = Instant::now();
        let second = first + std::time::Duration::from_millis(10);
        measure(&mut diagnostics, "render/bounce/ssbc/elapsed_gpu", first, 7.0);
        for (path, value) in [
            ("render/bounce/interleaved/elapsed_gpu", 1.0),
            ("render/bounce/interleaved/elapsed_gpu", 2.0),
            ("render/bounce/interleaved/elapsed_cpu", 16.0),
            ("render/bounce/direct/elapsed_gpu", 32.0),
            ("render/bounce/scene/elapsed_gpu", 0.5),
            ("render/shadows/elapsed_gpu", 64.0),
        ] {
            measure(&mut diagnostics, path, second, value);
        }
        assert_eq!(latest_cost(&diagnostics, "elapsed_gpu"), Some((second, 3.5)));
    }

    #[test]
    fn other_settings_are_measured_anew() {
        let mut budget = GiBudget::default();
        let mut illumination = GlobalIllumination { budget: Some(4.0), ..default() };
        (0..40).for_each(|_| budget.after(8.0, 4.0, &illumination));
        let share = budget.share;
        assert!(share < 0.8 && budget.spent == Some(8.0), "{budget:?}");
        illumination.quality = Quality::Low;
        (0..11).for_each(|_| budget.after(8.0, 4.0, &illumination));
        assert_eq!(budget.share, share);
        (0..1).for_each(|_| budget.after(8.0, 4.0, &illumination));
        assert!(budget.share < share);
    }
}
