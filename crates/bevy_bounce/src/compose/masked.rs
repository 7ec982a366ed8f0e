//! Masked surfaces are lit once.
//!
//! Bevy leaves deferred opaque surfaces out of the main pass, but draws deferred masked ones there once more, by its forward
//! shader, which would paint over the light composed here. Each 3D camera has them in its G-buffer, so none needs that.

use std::sync::Arc;

use bevy::material::OpaqueRendererMethod;
use bevy::material::labels::DrawFunctionLabel;
use bevy::pbr::{MainPassAlphaMaskDrawFunction, PreparedMaterial};
use bevy::prelude::*;
use bevy::render::erased_render_asset::ErasedRenderAssets;

/// Takes the forward draw from deferred masked materials, each frame anew, for a changed material is prepared afresh.
pub(super) fn draw_masked_surfaces_once(mut materials: ResMut<ErasedRenderAssets<PreparedMaterial>>) {
    let forward = MainPassAlphaMaskDrawFunction.intern();
    for (_, material) in materials.iter_mut() {
        let Some(properties) = Arc::get_mut(&mut material.properties) else { continue };
        if properties.render_method == OpaqueRendererMethod::Deferred {
            properties.draw_functions.retain(|(label, _)| *label != forward);
        }
    }
}
