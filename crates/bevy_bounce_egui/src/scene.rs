//! How lights and meshes take part, one by one.

use bevy::ecs::query::QueryFilter;
use bevy::light::RectLight;
use bevy::prelude::*;
use bevy::reflect::TypeRegistry;
use bevy_bounce::{GiLight, VoxelizedGroup, VoxelizedMesh};
use bevy_egui::egui::{CollapsingHeader, Id, Ui};

use crate::{Edited, edit};

/// Rows that a list has at most; more are found by their names.
const ROWS: usize = 50;

type Lights = Or<(With<PointLight>, With<SpotLight>, With<DirectionalLight>, With<RectLight>)>;

/// Lists of the scene's lights, meshes and groups, closed at first, 50 rows of each: the settings that are shown, and whether one was
/// changed. A light without [`GiLight`] and a mesh without [`VoxelizedMesh`] show the default, and get one where it is changed.
///
/// Each frame counts the entities of each list, and sorts those of an open one by name.
pub fn scene_rows(ui: &mut Ui, world: &mut World, registry: &TypeRegistry) -> Edited {
    list::<GiLight, Lights>(ui, world, registry, "Lights")
        .and(list::<VoxelizedMesh, With<Mesh3d>>(ui, world, registry, "Meshes"))
        .and(list::<VoxelizedGroup, With<VoxelizedGroup>>(ui, world, registry, "Groups of meshes"))
}

/// Entities by their names, each with what it has of `C`, or the default of that.
fn list<C, F>(ui: &mut Ui, world: &mut World, registry: &TypeRegistry, title: &str) -> Edited
where
    C: Component + Reflect + Default + Clone,
    F: QueryFilter,
{
    let mut query = world.query_filtered::<(), F>();
    let count = query.iter(world).count();
    if count == 0 {
        return Edited::default();
    }
    let heading = CollapsingHeader::new(format!("{title} ({count})")).id_salt(title).default_open(false);
    let shown = heading.show(ui, |ui| {
        let wanted = filter(ui, title);
        let mut found = world.query_filtered::<(Entity, Option<&Name>), F>();
        let named = found.iter(world).map(|(entity, name)| (entity, name_of(entity, name)));
        let is_wanted = |name: &str| wanted.is_empty() || name.to_lowercase().contains(&wanted);
        let mut named: Vec<(Entity, String)> = named.filter(|(_, name)| is_wanted(name)).collect();
        named.sort_unstable_by(|(a, first), (b, second)| (first, a).cmp(&(second, b)));
        let rows = named.iter().take(ROWS);
        let edited = rows.map(|(entity, name)| row::<C>(ui, world, registry, *entity, name));
        let edited = edited.fold(Edited::default(), Edited::and);
        if named.len() > ROWS {
            ui.weak(format!("and {} more: look for them by name", named.len() - ROWS));
        }
        edited
    });
    shown.body_returned.unwrap_or_default()
}

fn name_of(entity: Entity, name: Option<&Name>) -> String {
    name.map_or_else(|| entity.to_string(), |name| format!("{name} {entity}"))
}

/// What the names of a list are to contain, in small letters; kept while the panel is open.
fn filter(ui: &mut Ui, title: &str) -> String {
    let id = Id::new(("bounce_filter", title));
    let mut wanted: String = ui.data(|data| data.get_temp(id)).unwrap_or_default();
    ui.horizontal(|ui| {
        ui.label("name");
        ui.text_edit_singleline(&mut wanted);
    });
    ui.data_mut(|data| data.insert_temp(id, wanted.clone()));
    wanted.to_lowercase()
}

fn row<C>(ui: &mut Ui, world: &mut World, registry: &TypeRegistry, entity: Entity, name: &str) -> Edited
where
    C: Component + Reflect + Default + Clone,
{
    let heading = CollapsingHeader::new(name).id_salt(entity).default_open(false);
    let shown = heading.show(ui, |ui| {
        let mut value = world.get::<C>(entity).cloned().unwrap_or_default();
        let name = value.reflect_short_type_path().to_owned();
        let edited = edit(ui, registry, &name, value.as_partial_reflect_mut());
        if edited.changed
            && let Ok(mut entity) = world.get_entity_mut(entity)
        {
            entity.insert(value);
        }
        edited
    });
    shown.body_returned.unwrap_or_default()
}
