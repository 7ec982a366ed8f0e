//! What there is on the GPU, counted where it is: in the render world.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bevy::platform::time::Instant;
use bevy::prelude::*;
use bevy::render::{Render, RenderApp, RenderSystems};
use bevy_bounce::radiance_cache::{CacheCounts, cache_counts};
use bevy_bounce::{gpu_memory, vpl_count};

use crate::BouncePanel;

/// Time between counts, which wait for the GPU.
const INTERVAL: Duration = Duration::from_millis(500);

/// What was counted last.
#[derive(Clone, Debug, Default)]
pub struct Counted {
    /// Virtual point lights; `None` where none are traced.
    pub vpls: Option<u32>,
    /// Radiance caches, view by view.
    pub caches: Vec<CacheCounts>,
    /// Bytes on the GPU, by what they are for.
    pub bytes: BTreeMap<&'static str, u64>,
}

/// Asks the render world to count, and holds the answer. Shared by both worlds.
#[derive(Resource, Clone, Debug, Default)]
pub struct Counts(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    wanted: bool,
    counted: Option<Counted>,
}

impl Counts {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts at the end of the next frame.
    pub fn want(&self) {
        self.state().wanted = true;
    }

    /// The last answer; `None` before the first.
    pub fn counted(&self) -> Option<Counted> {
        self.state().counted.clone()
    }
}

pub(crate) struct CountsPlugin;

impl Plugin for CountsPlugin {
    fn build(&self, app: &mut App) {
        let counts = Counts::default();
        app.insert_resource(counts.clone()).add_systems(Update, ask);
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            let wanted = |counts: Res<Counts>| counts.state().wanted;
            render_app
                .insert_resource(counts)
                .add_systems(Render, count.run_if(wanted).after(RenderSystems::Render).before(RenderSystems::Cleanup));
        }
    }
}

/// At once when the panel is opened, then at intervals.
fn ask(panel: Res<BouncePanel>, counts: Res<Counts>, mut last: Local<Option<Instant>>) {
    if !panel.open {
        *last = None;
        return;
    }
    if last.is_none_or(|last| last.elapsed() >= INTERVAL) {
        counts.want();
        *last = Some(Instant::now());
    }
}

fn count(render_world: &mut World) {
    let counted =
        Counted { vpls: vpl_count(render_world), caches: cache_counts(render_world), bytes: gpu_memory(render_world) };
    let mut state = render_world.resource::<Counts>().state();
    state.wanted = false;
    state.counted = Some(counted);
}
