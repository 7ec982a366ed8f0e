//! Apps that stay forward.

use bevy::prelude::*;

use crate::{GiIsolate, GlobalIllumination, camera};

/// In place of [`GiComposePlugin`](crate::GiComposePlugin) where an app stays forward, with MSAA: bounced light comes
/// from the volume of light probes alone, and cameras that ask for it lose Bevy's ambient light, which is a sky where
/// the game has set it. [`GiIsolate`] does nothing.
pub struct GiForwardPlugin;

impl Plugin for GiForwardPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<GlobalIllumination>().register_type::<GiIsolate>();
    }

    fn finish(&self, app: &mut App) {
        camera::finish_forward(app);
    }
}
