//! Whether anything reads the volume this frame.

use bevy::core_pipeline::core_3d::{AlphaMask3d, Opaque3d, Transparent3d};
use bevy::ecs::system::SystemParam;
use bevy::pbr::Transmissive3d;
use bevy::prelude::*;
use bevy::render::render_phase::{BinnedPhaseItem, SortedPhaseItem, ViewBinnedRenderPhases, ViewSortedRenderPhases};

/// What Bevy draws after the G-buffer, by its forward shaders.
#[derive(SystemParam)]
pub(super) struct Receivers<'w> {
    opaque: Option<Res<'w, ViewBinnedRenderPhases<Opaque3d>>>,
    masked: Option<Res<'w, ViewBinnedRenderPhases<AlphaMask3d>>>,
    transmissive: Option<Res<'w, ViewSortedRenderPhases<Transmissive3d>>>,
    transparent: Option<Res<'w, ViewSortedRenderPhases<Transparent3d>>>,
}

impl Receivers<'_> {
    /// Whether any view draws something that the volume lights.
    pub fn any(&self) -> bool {
        any_binned(self.opaque.as_deref())
            || any_binned(self.masked.as_deref())
            || any_sorted(self.transmissive.as_deref())
            || any_sorted(self.transparent.as_deref())
    }
}

fn any_binned<T: BinnedPhaseItem>(phases: Option<&ViewBinnedRenderPhases<T>>) -> bool {
    phases.is_some_and(|phases| phases.values().any(|phase| !phase.is_empty()))
}

fn any_sorted<T: SortedPhaseItem>(phases: Option<&ViewSortedRenderPhases<T>>) -> bool {
    phases.is_some_and(|phases| phases.values().any(|phase| !phase.items.is_empty()))
}
