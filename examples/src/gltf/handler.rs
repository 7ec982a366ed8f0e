//! What Bevy's loader leaves out or changes: cameras by node; lights' colours, ranges and sizes.

use bevy::asset::LoadContext;
use bevy::ecs::world::EntityWorldMut;
use bevy::gltf::GltfLoaderSettings;
use bevy::gltf::extensions::{ErasedGltfExtensionHandler, GltfExtensionHandler, GltfExtensionHandlers};
use bevy::prelude::*;

/// Stands for no limit, metres: glTF lights without a range fall off by distance alone, Bevy's need a number.
const UNLIMITED: f32 = 1000.0;

/// On the entity of a glTF node: its index in the file.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
pub struct NodeIndex(pub usize);

#[derive(Clone, Default)]
struct Handler;

/// Makes the loader use the handler.
pub fn install(app: &mut App) {
    app.register_type::<NodeIndex>();
    if let Some(handlers) = app.world_mut().get_resource_mut::<GltfExtensionHandlers>() {
        handlers.0.write_blocking().push(Box::new(Handler));
    }
}

/// How the loader is asked to load.
pub fn loader_settings(settings: &mut GltfLoaderSettings) {
    settings.load_cameras = false;
}

impl GltfExtensionHandler for Handler {
    fn dyn_clone(&self) -> Box<dyn ErasedGltfExtensionHandler> {
        Box::new(self.clone())
    }

    fn on_gltf_node(&mut self, _: &mut LoadContext<'_>, node: &gltf::Node, entity: &mut EntityWorldMut) {
        entity.insert(NodeIndex(node.index()));
    }

    fn on_spawn_light_directional(&mut self, _: &mut LoadContext<'_>, node: &gltf::Node, entity: &mut EntityWorldMut) {
        if let Some(mut light) = entity.get_mut::<DirectionalLight>() {
            light.color = color(node);
        }
    }

    fn on_spawn_light_point(&mut self, _: &mut LoadContext<'_>, node: &gltf::Node, entity: &mut EntityWorldMut) {
        if let Some(mut light) = entity.get_mut::<PointLight>() {
            light.range = range(node);
            light.color = color(node);
        }
    }

    fn on_spawn_light_spot(&mut self, _: &mut LoadContext<'_>, node: &gltf::Node, entity: &mut EntityWorldMut) {
        if let Some(mut light) = entity.get_mut::<SpotLight>() {
            light.range = range(node);
            light.color = color(node);
            light.radius = 0.0;
        }
    }
}

fn range(node: &gltf::Node) -> f32 {
    node.light().and_then(|light| light.range()).unwrap_or(UNLIMITED)
}

/// glTF's light colours are linear; Bevy's loader takes them for sRGB.
fn color(node: &gltf::Node) -> Color {
    node.light().map_or(Color::WHITE, |light| Color::linear_rgb(light.color()[0], light.color()[1], light.color()[2]))
}
