//! Materials of a game's own.

use std::marker::PhantomData;

use bevy::pbr::{ExtendedMaterial, MaterialExtension};
use bevy::prelude::*;
use bevy::render::{ExtractSchedule, RenderApp};

use super::extract::{extract_cameras, extract_instances, extract_materials};
use super::instances::Instances;

/// A material whose surfaces reflect, block and send bounced light, as [`GiMaterialPlugin`] has them do.
///
/// How they are lit is up to their shaders: see "Other materials" in the guide on adding bounced light to a game.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy::render::render_resource::AsBindGroup;
/// # use bevy_bounce::GiMaterial;
/// #[derive(Asset, AsBindGroup, TypePath, Clone)]
/// struct Lava {
///     heat: f32,
/// }
///
/// impl Material for Lava {}
///
/// impl GiMaterial for Lava {
///     fn stand_in(&self) -> StandardMaterial {
///         StandardMaterial { base_color: Color::BLACK, emissive: LinearRgba::rgb(self.heat, 0.2, 0.0), ..default() }
///     }
/// }
/// ```
pub trait GiMaterial: Material {
    /// What bounced light takes the surface for: base colour, its texture, emission, roughness, metal, alpha mode and
    /// sides count, as of any `StandardMaterial`. Asked for when the asset is added or modified.
    fn stand_in(&self) -> StandardMaterial;
}

impl GiMaterial for StandardMaterial {
    fn stand_in(&self) -> StandardMaterial {
        self.clone()
    }
}

impl<E: MaterialExtension> GiMaterial for ExtendedMaterial<StandardMaterial, E> {
    fn stand_in(&self) -> StandardMaterial {
        self.base.clone()
    }
}

/// Meshes with this material take part in bounced light; `StandardMaterial` needs none. To be added beside Bevy's
/// `MaterialPlugin` of the material. Does nothing in apps without bounced light.
pub struct GiMaterialPlugin<M: GiMaterial>(PhantomData<M>);

impl<M: GiMaterial> Default for GiMaterialPlugin<M> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<M: GiMaterial> Plugin for GiMaterialPlugin<M> {
    fn build(&self, _app: &mut App) {}

    fn finish(&self, app: &mut App) {
        if !app.world().contains_resource::<Assets<M>>() {
            return;
        }
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app.add_systems(
            ExtractSchedule,
            (extract_instances::<M>, extract_materials::<M>)
                .after(extract_cameras)
                .run_if(resource_exists::<Instances>),
        );
    }
}
