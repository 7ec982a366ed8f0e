//! Motion vectors, for as long as a camera asks for history.

use bevy::core_pipeline::prepass::MotionVectorPrepass;
use bevy::core_pipeline::prepass::background_motion_vectors::{
    BackgroundMotionVectorsBindGroup, BackgroundMotionVectorsPipelineId,
};
use bevy::ecs::world::EntityWorldMut;
use bevy::prelude::*;

use crate::GlobalIllumination;

/// On a camera whose [`MotionVectorPrepass`] is here for the history.
#[derive(Component)]
pub(super) struct Brought;

/// Cameras with history draw motion vectors; those that no longer have it go without again, unless something else on them
/// needs them.
pub(super) fn prepare_motion_vectors(
    mut commands: Commands,
    cameras: Query<(Entity, Option<&GlobalIllumination>, Has<MotionVectorPrepass>, Has<Brought>), With<Camera3d>>,
) {
    for (entity, illumination, has, brought) in &cameras {
        let asked = illumination.is_some_and(GlobalIllumination::has_history);
        let mut camera = commands.entity(entity);
        match (asked, has, brought) {
            (true, false, _) => {
                camera.insert((MotionVectorPrepass, Brought));
            }
            (false, _, true) => {
                camera.remove::<Brought>().queue(hand_back);
            }
            _ => {}
        }
    }
}

/// Takes motion vectors from a camera on which no component requires them.
fn hand_back(mut camera: EntityWorldMut) {
    let components = camera.world().components();
    let Some(motion) = components.component_id::<MotionVectorPrepass>() else { return };
    let requires = |id| {
        let info = components.get_info(id);
        info.is_some_and(|info| info.required_components().iter_ids().any(|required| required == motion))
    };
    if !camera.archetype().components().iter().any(|id| requires(*id)) {
        camera.remove::<MotionVectorPrepass>();
    }
}

/// Bevy 0.19 leaves the pipeline that draws the background's motion vectors on a view that no longer has a target for them, and
/// the next frame fails validation.
pub(super) fn forget_background(
    mut commands: Commands,
    views: Query<Entity, (With<BackgroundMotionVectorsPipelineId>, Without<MotionVectorPrepass>)>,
) {
    for view in &views {
        commands.entity(view).remove::<(BackgroundMotionVectorsPipelineId, BackgroundMotionVectorsBindGroup)>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GiSettings, Quality};

    /// What others may put on a camera, such as Bevy's temporal anti-aliasing.
    #[derive(Component, Default)]
    #[require(MotionVectorPrepass)]
    struct Other;

    fn with(history: u32) -> GlobalIllumination {
        GlobalIllumination { quality: Quality::Custom(GiSettings { history, ..default() }), ..default() }
    }

    /// Whether the camera draws motion vectors after each of the changes.
    fn drawn(changes: &[&dyn Fn(&mut EntityWorldMut)]) -> Vec<bool> {
        let mut app = App::new();
        app.add_systems(Update, prepare_motion_vectors);
        let camera = app.world_mut().spawn(Camera3d::default()).id();
        let states = changes.iter().map(|change| {
            change(&mut app.world_mut().entity_mut(camera));
            app.update();
            app.update();
            app.world().entity(camera).contains::<MotionVectorPrepass>()
        });
        states.collect()
    }

    fn put(bundle: impl Bundle + Clone) -> impl Fn(&mut EntityWorldMut) {
        move |camera| {
            camera.insert(bundle.clone());
        }
    }

    fn other(camera: &mut EntityWorldMut) {
        camera.insert(Other);
    }

    #[test]
    fn motion_vectors_come_and_go_with_the_setting() {
        let without = |camera: &mut EntityWorldMut| {
            camera.remove::<GlobalIllumination>();
        };
        let states = drawn(&[&put(with(8)), &put(with(0)), &put(with(8)), &without]);
        assert_eq!(states, [true, false, true, false]);
    }

    #[test]
    fn motion_vectors_of_others_stay() {
        let found = put(MotionVectorPrepass);
        assert_eq!(drawn(&[&found, &put(with(8)), &put(with(0))]), [true; 3], "from before");
        assert_eq!(drawn(&[&other, &put(with(8)), &put(with(0))]), [true; 3], "required before");
        assert_eq!(drawn(&[&put(with(8)), &other, &put(with(0))]), [true; 3], "required later");
    }
}
