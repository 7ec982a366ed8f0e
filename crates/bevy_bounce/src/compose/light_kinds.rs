//! Which kinds of lights there are: direct light is computed by pipelines that know no others.

use bevy::ecs::system::SystemParam;
use bevy::pbr::{ExtractedDirectionalLight, ExtractedPointLight, ExtractedRectLight};
use bevy::prelude::*;

/// Kinds of Bevy's lights.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub(super) struct LightKinds {
    /// `PointLight`.
    pub point: bool,
    /// `SpotLight`.
    pub spot: bool,
    /// `DirectionalLight`.
    pub directional: bool,
    /// `RectLight`.
    pub rect: bool,
}

impl LightKinds {
    /// All of them.
    pub const ALL: Self = Self { point: true, spot: true, directional: true, rect: true };
}

/// The lights of the frame, whichever views they are in.
#[derive(SystemParam)]
pub(super) struct KnownLights<'w, 's> {
    clustered: Query<'w, 's, &'static ExtractedPointLight>,
    directional: Query<'w, 's, (), With<ExtractedDirectionalLight>>,
    rect: Query<'w, 's, (), With<ExtractedRectLight>>,
}

impl KnownLights<'_, '_> {
    /// The kinds that are among them.
    pub fn kinds(&self) -> LightKinds {
        let has_angles = |light: &ExtractedPointLight| light.spot_light_angles.is_some();
        LightKinds {
            point: self.clustered.iter().any(|light| !has_angles(light)),
            spot: self.clustered.iter().any(has_angles),
            directional: !self.directional.is_empty(),
            rect: !self.rect.is_empty(),
        }
    }
}
