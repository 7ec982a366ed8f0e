//! A new device knows nothing of what was made on the last one.
//!
//! Bevy runs `RenderStartup` whenever it gets a device: at start, and after one was lost, where the game's
//! `RenderErrorHandler` asks for another. Pipelines are made there. What is kept from frame to frame is taken away there,
//! and comes back as the next frame is prepared: nothing else needs to know that there was another device.

use bevy::prelude::*;

/// Takes away what a resource holds on the last device. For `RenderStartup`.
pub(crate) fn forget_resource<R: Resource>(mut commands: Commands) {
    commands.remove_resource::<R>();
}

/// Takes away what components hold on the last device. For `RenderStartup`.
pub(crate) fn forget_components<C: Component>(mut commands: Commands, holders: Query<Entity, With<C>>) {
    for holder in &holders {
        commands.entity(holder).remove::<C>();
    }
}
