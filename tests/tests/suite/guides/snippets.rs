//! The Rust of the guides, so that it is compiled and run.

use std::any::TypeId;

use bevy::core_pipeline::prepass::DeferredPrepass;
use bevy::ecs::reflect::AppTypeRegistry;
use bevy::ecs::system::RunSystemOnce;
use bevy::gltf::GltfAssetLabel;
use bevy::pbr::{ExtendedMaterial, MaterialExtension};
use bevy::prelude::*;
use bevy::reflect::serde::{TypedReflectDeserializer, TypedReflectSerializer};
use bevy::render::render_resource::AsBindGroup;
use bevy::world_serialization::{WorldAsset, WorldAssetRoot};
use bevy_bounce::GiSettings;
use bevy_bounce::prelude::*;
use bevy_bounce_cssm::CssmAsset;
use serde::de::DeserializeSeed;

#[derive(Resource, Default)]
struct Room {
    curtain: Handle<Mesh>,
    cloth: Handle<StandardMaterial>,
    sky: Handle<Mesh>,
    stars: Handle<StandardMaterial>,
}

#[derive(Resource, Default)]
struct Graphics {
    bounced_light: Option<Quality>,
}

fn spawn(mut commands: Commands, room: Res<Room>) {
    commands.spawn((
        SpotLight { intensity: 400_000.0, shadow_maps_enabled: true, ..default() },
        GiLight { share: 3.0, ..default() },
        Transform::from_xyz(0.0, 3.0, 0.0).looking_at(Vec3::ZERO, Vec3::Z),
    ));
    commands.spawn((PointLight::default(), GiLight::OFF));
    commands.spawn((
        Mesh3d(room.curtain.clone()),
        MeshMaterial3d(room.cloth.clone()),
        VoxelizedMesh { two_sided: Some(true), ..default() },
    ));
    commands.spawn((Mesh3d(room.sky.clone()), MeshMaterial3d(room.stars.clone()), VoxelizedMesh::OFF));
}

fn choose(graphics: Res<Graphics>, mut cameras: Query<&mut GlobalIllumination>) {
    if !graphics.is_changed() {
        return;
    }
    for mut camera in &mut cameras {
        match graphics.bounced_light {
            Some(quality) => (camera.technique, camera.quality) = (Technique::InstantRadiosity, quality),
            None => camera.technique = Technique::None,
        }
    }
}

fn spawn_with_budget(mut commands: Commands) {
    let illumination = GlobalIllumination { quality: Quality::High, budget: Some(4.0), ..default() };
    commands.spawn((Camera3d::default(), illumination));
}

fn save(quality: &Quality, types: &AppTypeRegistry) -> serde_json::Result<String> {
    serde_json::to_string(&TypedReflectSerializer::new(quality, &types.read()))
}

/// What `save` wrote; the default where that makes no sense.
fn load(text: &str, types: &AppTypeRegistry) -> Quality {
    let types = types.read();
    let Some(registration) = types.get(TypeId::of::<Quality>()) else { return default() };
    let mut json = serde_json::Deserializer::from_str(text);
    let value = TypedReflectDeserializer::new(registration, &types).deserialize(&mut json);
    value.ok().and_then(|value| Quality::from_reflect(&*value)).unwrap_or_default()
}

#[derive(Asset, AsBindGroup, TypePath, Clone)]
struct Snow {}

impl MaterialExtension for Snow {}

#[derive(Asset, AsBindGroup, TypePath, Clone)]
struct Lava {
    heat: f32,
}

impl Material for Lava {}

impl GiMaterial for Lava {
    fn stand_in(&self) -> StandardMaterial {
        StandardMaterial { base_color: Color::BLACK, emissive: LinearRgba::rgb(self.heat, 0.2, 0.0), ..default() }
    }
}

fn add_materials(app: &mut App) {
    app.add_plugins((
        MaterialPlugin::<ExtendedMaterial<StandardMaterial, Snow>>::default(),
        GiMaterialPlugin::<ExtendedMaterial<StandardMaterial, Snow>>::default(),
        MaterialPlugin::<Lava>::default(),
        GiMaterialPlugin::<Lava>::default(),
    ));
}

fn bounced_light_runs(cameras: Query<(), (With<GlobalIllumination>, With<DeferredPrepass>)>) -> bool {
    !cameras.is_empty()
}

fn spawn_baked_room(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn((
        WorldAssetRoot(assets.load(GltfAssetLabel::Scene(0).from_asset("room.glb"))),
        CssmObject { bake: assets.load("room.cssm") },
    ));
    commands.spawn((Camera3d::default(), GlobalIllumination { technique: Technique::SurfaceRadiosity, ..default() }));
}

fn calmer() -> Quality {
    Quality::Custom(GiSettings { vpls: 4096, ..Quality::Medium.settings() })
}

/// Runs a system on a world with what it asks for.
fn run<M>(app: &mut App, system: impl IntoSystem<(), (), M> + 'static) {
    app.world_mut().run_system_once(system).unwrap_or_else(|error| panic!("{error}"));
    app.world_mut().flush();
}

#[test]
fn settings_are_read_as_they_were_written() {
    let types = AppTypeRegistry::default();
    types.write().register::<GlobalIllumination>();
    for quality in [Quality::Low, Quality::Ultra, calmer()] {
        let text = save(&quality, &types).expect("is written");
        assert_eq!(load(&text, &types), quality, "{text}");
    }
    assert_eq!(calmer().settings().vpls, 4096);
    for text in ["", "null", "\"Best\"", "{\"Custom\":{\"grid\":true}}"] {
        assert_eq!(load(text, &types), Quality::Medium, "{text}");
    }
}

#[test]
fn a_menu_changes_every_camera() {
    let mut app = App::new();
    app.insert_resource(Graphics { bounced_light: Some(Quality::High) }).add_systems(Update, choose);
    let cameras = [0; 2].map(|_| app.world_mut().spawn(GlobalIllumination::default()).id());
    app.update();
    let seen = |app: &App, camera| app.world().get::<GlobalIllumination>(camera).cloned();
    for camera in cameras {
        assert_eq!(seen(&app, camera).map(|camera| camera.quality), Some(Quality::High));
    }
    app.world_mut().resource_mut::<Graphics>().bounced_light = None;
    app.update();
    for camera in cameras {
        assert_eq!(seen(&app, camera).map(|camera| camera.technique), Some(Technique::None));
    }
}

#[test]
fn a_game_can_tell_whether_bounced_light_runs() {
    let mut world = World::new();
    let camera = world.spawn(GlobalIllumination::default()).id();
    assert!(!world.run_system_once(bounced_light_runs).expect("runs"));
    world.entity_mut(camera).insert(DeferredPrepass);
    assert!(world.run_system_once(bounced_light_runs).expect("runs"));
}

#[test]
fn lights_meshes_and_baked_rooms_are_spawned() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default()));
    app.init_asset::<WorldAsset>().init_asset::<CssmAsset>().init_resource::<Room>();
    run(&mut app, spawn);
    run(&mut app, spawn_baked_room);
    run(&mut app, spawn_with_budget);
    let world = app.world_mut();
    assert_eq!(world.query::<&GiLight>().iter(world).filter(|light| **light == GiLight::OFF).count(), 1);
    assert_eq!(world.query::<&VoxelizedMesh>().iter(world).filter(|mesh| mesh.enabled).count(), 1);
    assert_eq!(world.query::<&GlobalIllumination>().iter(world).filter(|gi| gi.budget.is_some()).count(), 1);
    assert_eq!(world.query::<(&CssmObject, &WorldAssetRoot)>().iter(world).count(), 1);
}

#[test]
fn materials_of_a_game_are_announced() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default()));
    add_materials(&mut app);
    assert!(app.is_plugin_added::<GiMaterialPlugin<Lava>>());
    let lava = app.world_mut().resource_mut::<Assets<Lava>>().add(Lava { heat: 4.0 });
    let lava = app.world().resource::<Assets<Lava>>().get(&lava).map(GiMaterial::stand_in);
    assert_eq!(lava.map(|lava| lava.emissive.red), Some(4.0));
}
