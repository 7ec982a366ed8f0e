//! What can be set on a camera.

use bevy::ecs::reflect::{AppTypeRegistry, ReflectComponent};
use bevy::prelude::*;
use bevy::reflect::TypeRegistry;
use bevy_bounce::{GiBudget, GiGizmos, GlobalIllumination};
use bevy_egui::EguiContext;
use bevy_egui::egui::{Context, ScrollArea, Ui, Window};

use crate::{BouncePanel, Edited, PanelCamera, edit, scene_rows};

/// Width of the panel's windows, points.
pub(crate) const WIDTH: f32 = 280.0;
/// What a window leaves of the height of the picture, with its title, points.
pub(crate) const MARGIN: f32 = 64.0;

/// Copies of every component of `bevy_bounce` that an entity has, in the order of their names.
pub fn components(world: &World, registry: &TypeRegistry, entity: Entity) -> Vec<Box<dyn Reflect>> {
    let Ok(entity) = world.get_entity(entity) else { return Vec::new() };
    let ours = registry
        .iter_with_data::<ReflectComponent>()
        .filter(|(registered, _)| registered.type_info().type_path_table().crate_name() == Some("bevy_bounce"));
    let found = ours.filter_map(|(_, reflected)| reflected.reflect(entity)?.reflect_clone().ok());
    let mut found: Vec<_> = found.collect();
    found.sort_by_key(|component| component.reflect_short_type_path().to_owned());
    found
}

/// Sets a component to a value of its own type, as [`components`] gave it.
pub fn apply(world: &mut World, registry: &TypeRegistry, entity: Entity, value: &dyn Reflect) {
    let reflected = registry.get_type_data::<ReflectComponent>(value.reflect_type_info().type_id());
    if let (Some(reflected), Ok(entity)) = (reflected, world.get_entity_mut(entity)) {
        reflected.apply(entity, value.as_partial_reflect());
    }
}

/// The context of the panel, while it is open.
pub(crate) fn context(world: &mut World) -> Option<Context> {
    let mut contexts = world.query_filtered::<&mut EguiContext, With<PanelCamera>>();
    contexts.single_mut(world).ok().map(|mut context| context.get_mut().clone())
}

/// The window with the settings of every camera.
pub(crate) fn show(world: &mut World) {
    let Some(context) = context(world) else { return };
    let registry = world.resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let mut cameras = world.query_filtered::<(Entity, Option<&Name>), With<GlobalIllumination>>();
    let cameras: Vec<(Entity, String)> = cameras
        .iter(world)
        .map(|(entity, name)| (entity, name.map_or_else(|| format!("camera {entity}"), |name| name.to_string())))
        .collect();
    let mut shown = 0;
    let height = context.content_rect().height() - MARGIN;
    let window = Window::new("Bounced light").default_pos([8.0, 8.0]).default_size([WIDTH, height]).fade_in(false);
    window.show(&context, |ui| {
        ScrollArea::vertical().max_height(height).show(ui, |ui| {
            for (camera, name) in &cameras {
                if cameras.len() > 1 {
                    ui.strong(name);
                }
                shown += ui.push_id(camera, |ui| camera_rows(ui, world, &registry, *camera)).inner;
            }
            shown += gizmo_rows(ui, world, &registry);
            shown += scene_rows(ui, world, &registry).shown;
        });
    });
    world.resource_mut::<BouncePanel>().bypass_change_detection().settings = shown;
}

/// What is drawn over all pictures.
fn gizmo_rows(ui: &mut Ui, world: &mut World, registry: &TypeRegistry) -> usize {
    let Some(mut gizmos) = world.get_resource::<GiGizmos>().copied() else { return 0 };
    let edited = edit(ui, registry, "Gizmos", &mut gizmos);
    if edited.changed {
        world.insert_resource(gizmos);
    }
    edited.shown
}

fn camera_rows(ui: &mut Ui, world: &mut World, registry: &TypeRegistry, camera: Entity) -> usize {
    let mut shown = 0;
    // What a budget leaves is no wish, and stands with the costs.
    let settings = components(world, registry, camera).into_iter().filter(|component| !component.is::<GiBudget>());
    for mut component in settings {
        let name = component.reflect_short_type_path().to_owned();
        let edited: Edited = edit(ui, registry, &name, component.as_partial_reflect_mut());
        if edited.changed {
            apply(world, registry, camera, &*component);
        }
        shown += edited.shown;
    }
    shown
}
