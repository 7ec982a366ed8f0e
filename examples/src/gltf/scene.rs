//! From a checked file to a lit world.

use std::path::{Path, PathBuf};

use bevy::asset::{AssetPath, LoadState, RecursiveDependencyLoadState};
use bevy::camera::Exposure;
use bevy::camera::primitives::Aabb;
use bevy::ecs::system::SystemParam;
use bevy::light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap, PointLightShadowMap};
use bevy::math::Affine2;
use bevy::math::bounding::Aabb3d;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::world_serialization::WorldInstanceReady;
use bevy_bounce::CssmObject;
use bevy_bounce_cssm::{CssmAsset, CssmFile};

use super::handler::{self, NodeIndex};
use super::{FileCamera, SceneFile, mips};
use crate::headless::{Failed, Pending};
use crate::metering::Metered;
use crate::window::Fly;
use crate::{Error, Run};

/// Loads a glTF scene, turns its shadows on, and looks at it through one of its cameras.
///
/// Files without a camera are looked at from outside, files without any light get one.
pub struct GltfScenePlugin {
    /// What to show.
    pub file: SceneFile,
    /// Through which of its cameras.
    pub camera: Option<FileCamera>,
    /// Everything diffuse and two-sided, as the references are; what shines has the sides that the file says.
    pub matte: bool,
    /// Textures upside down: the path-traced references take v the other way round.
    pub flip_textures: bool,
    /// Baked visibility of the whole scene.
    pub bake: Option<CssmFile>,
}

/// Exposure until it is measured: a lit room at night.
const FIRST_EXPOSURE: Exposure = Exposure { ev100: 8.0 };

#[derive(Resource)]
struct Loading {
    file: SceneFile,
    camera: Option<FileCamera>,
    matte: bool,
    flip_textures: bool,
    bake: Option<CssmFile>,
    gltf: Handle<Gltf>,
    /// Frames since the scene was spawned: transforms are global from the first on.
    spawned: Option<u32>,
    root: Option<Entity>,
    complete: bool,
}

/// Emission of the scene's materials, cd/m^2.
#[derive(Resource, Default)]
struct Emission(HashMap<AssetId<StandardMaterial>, LinearRgba>);

/// Plays on a loop, in step with the app's time.
#[derive(Component)]
struct Playing(AnimationNodeIndex, Handle<AnimationClip>);

const PENDING: &str = "the glTF scene";

impl Plugin for GltfScenePlugin {
    fn build(&self, app: &mut App) {
        handler::install(app);
        let loading = Loading {
            file: self.file.clone(),
            camera: self.camera.clone(),
            matte: self.matte,
            flip_textures: self.flip_textures,
            bake: self.bake.clone(),
            gltf: Handle::default(),
            spawned: None,
            root: None,
            complete: false,
        };
        app.init_resource::<Pending>().init_resource::<Failed>().init_resource::<Emission>();
        app.world_mut().resource_mut::<Pending>().add(PENDING);
        app.insert_resource(loading)
            .insert_resource(PointLightShadowMap { size: 2048 })
            .insert_resource(DirectionalLightShadowMap { size: 4096 })
            .add_systems(Startup, load)
            .add_systems(Update, (spawn, complete, play, expose_emission).chain())
            .add_observer(mark_spawned);
    }
}

impl SceneFile {
    /// The folder that [`build`](crate::app::build) should take as the root of assets.
    pub fn folder(&self) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("/")).to_owned()
    }
}

fn load(mut loading: ResMut<Loading>, assets: Res<AssetServer>) {
    let name = loading.file.path.file_name().map(PathBuf::from).unwrap_or_default();
    let builder = assets.load_builder().with_settings(handler::loader_settings);
    loading.gltf = builder.load(AssetPath::from_path_buf(name));
}

fn spawn(
    mut commands: Commands,
    mut loading: ResMut<Loading>,
    mut failed: ResMut<Failed>,
    assets: Res<AssetServer>,
    gltfs: Res<Assets<Gltf>>,
    bakes: Option<ResMut<Assets<CssmAsset>>>,
) {
    if loading.root.is_some() {
        return;
    }
    match assets.get_load_states(&loading.gltf) {
        Some((LoadState::Failed(error), ..)) => {
            failed.set(Error::file(&loading.file.path, format!("cannot be loaded: {error}")));
        }
        Some((.., RecursiveDependencyLoadState::Failed(error))) => {
            failed.set(Error::file(&loading.file.path, format!("a part of it cannot be loaded: {error}")));
        }
        Some((LoadState::Loaded, _, RecursiveDependencyLoadState::Loaded)) => {
            let scene = gltfs.get(&loading.gltf).and_then(|gltf| gltf.scenes.get(loading.file.scene));
            if let Some(scene) = scene {
                let root = commands.spawn(WorldAssetRoot(scene.clone())).id();
                loading.root = Some(root);
                // Plain Bevy knows nothing of baked files.
                if let (Some(file), Some(mut bakes)) = (loading.bake.take(), bakes) {
                    commands.entity(root).insert(CssmObject { bake: bakes.add(CssmAsset { file }) });
                }
            }
        }
        _ => (),
    }
}

fn mark_spawned(ready: On<WorldInstanceReady>, mut loading: ResMut<Loading>) {
    if loading.root == Some(ready.entity) {
        loading.spawned = Some(0);
    }
}

#[derive(SystemParam)]
struct SceneQueries<'w, 's> {
    children: Query<'w, 's, &'static Children>,
    meshes: Query<'w, 's, (Entity, &'static GlobalTransform, &'static Aabb, &'static Mesh3d)>,
    materials: Query<'w, 's, (Entity, &'static MeshMaterial3d<StandardMaterial>)>,
    nodes: Query<'w, 's, (Entity, &'static GlobalTransform, &'static NodeIndex)>,
    points: Query<'w, 's, &'static mut PointLight>,
    spots: Query<'w, 's, &'static mut SpotLight>,
    suns: Query<'w, 's, (Entity, &'static mut DirectionalLight)>,
    players: Query<'w, 's, (Entity, &'static mut AnimationPlayer)>,
}

fn complete(
    mut commands: Commands,
    mut loading: ResMut<Loading>,
    mut pending: ResMut<Pending>,
    mut scene: SceneQueries,
    mut emission: ResMut<Emission>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut graphs: ResMut<Assets<AnimationGraph>>,
    mut images: ResMut<Assets<Image>>,
    gltfs: Res<Assets<Gltf>>,
    run: Res<Run>,
) {
    let (Some(frames), Some(root)) = (loading.spawned, loading.root) else { return };
    loading.spawned = Some(frames + 1);
    if frames < 1 || loading.complete {
        return;
    }
    loading.complete = true;
    mips::generate(&mut images);
    if loading.matte {
        make_matte(&mut commands, &scene, &mut materials, &mut meshes);
    }
    if loading.flip_textures {
        flip_textures(&mut materials);
    }
    for (_, handle) in &scene.materials {
        if let Some(material) = materials.get(&handle.0)
            && material.emissive.to_f32_array()[..3].iter().any(|channel| *channel > 0.0)
        {
            emission.0.insert(handle.0.id(), material.emissive);
        }
    }
    if let Some(clip) = gltfs.get(&loading.gltf).and_then(|gltf| gltf.animations.first()) {
        let (graph, node) = AnimationGraph::from_clip(clip.clone());
        let graph = graphs.add(graph);
        for (entity, mut player) in &mut scene.players {
            player.play(node).repeat().pause();
            commands.entity(entity).insert((AnimationGraphHandle(graph.clone()), Playing(node, clip.clone())));
        }
    }
    let bounds = bounds(&scene, root);
    let view = spawn_camera(&mut commands, &loading, &scene, bounds, run.headless);
    let reach = reach(bounds, view.translation);
    light(&mut commands, &mut scene, reach, view, bounds, emission.0.is_empty());
    pending.done(PENDING);
}

/// World bounds of all meshes under `root`; a metre cube where there is nothing.
fn bounds(scene: &SceneQueries, root: Entity) -> Aabb3d {
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let entities = scene.children.iter_descendants(root).filter_map(|entity| scene.meshes.get(entity).ok());
    for (_, transform, aabb, _) in entities {
        for corner in 0..8 {
            let side = |axis: u32| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
            let local = Vec3::from(aabb.center) + Vec3::from(aabb.half_extents) * Vec3::new(side(0), side(1), side(2));
            let world = transform.transform_point(local);
            if world.is_finite() {
                (min, max) = (min.min(world), max.max(world));
            }
        }
    }
    if min.cmple(max).all() {
        Aabb3d { min: min.into(), max: max.into() }
    } else {
        Aabb3d::new(Vec3::ZERO, Vec3::splat(0.5))
    }
}

/// From a point to the farthest corner of the bounds.
fn reach(bounds: Aabb3d, from: Vec3) -> f32 {
    let (min, max) = (Vec3::from(bounds.min), Vec3::from(bounds.max));
    (min - from).abs().max((max - from).abs()).length().max(1e-3)
}

/// Spawns the camera and says where it stands. Without a window it follows its node; with one it can be flown.
fn spawn_camera(
    commands: &mut Commands,
    loading: &Loading,
    scene: &SceneQueries,
    bounds: Aabb3d,
    headless: bool,
) -> Transform {
    let (center, radius) =
        (Vec3::from(bounds.min + bounds.max) * 0.5, Vec3::from(bounds.max - bounds.min).length() * 0.5);
    let chosen = loading.camera.as_ref().and_then(|camera| {
        let node = scene.nodes.iter().find(|(.., index)| index.0 == camera.node)?;
        Some((camera.projection.clone(), node.0, node.1.compute_transform()))
    });
    let fly = Fly { extent: 2.0 * radius };
    let common = (Camera3d::default(), FIRST_EXPOSURE, Metered, fly);
    match chosen {
        Some((projection, node, transform)) if headless => {
            commands.spawn((common, projection, ChildOf(node)));
            transform
        }
        Some((projection, _, transform)) => {
            let transform = Transform { scale: Vec3::ONE, ..transform };
            commands.spawn((common, projection, transform));
            transform
        }
        None => {
            let lens = PerspectiveProjection { near: radius / 1000.0, far: radius * 100.0, ..default() };
            let distance = radius / (lens.fov * 0.5).sin();
            let eye = center + Vec3::new(0.55, 0.35, 0.75).normalize() * distance;
            let transform = Transform::from_translation(eye).looking_at(center, Vec3::Y);
            commands.spawn((common, Projection::Perspective(lens), transform));
            transform
        }
    }
}

/// Shadows for all lights; a light where there is none.
fn light(
    commands: &mut Commands,
    scene: &mut SceneQueries,
    reach: f32,
    view: Transform,
    bounds: Aabb3d,
    no_emission: bool,
) {
    let cascades = CascadeShadowConfigBuilder {
        minimum_distance: reach * 1e-4,
        first_cascade_far_bound: reach * 0.1,
        maximum_distance: reach,
        ..default()
    };
    for (entity, mut sun) in &mut scene.suns {
        sun.shadow_maps_enabled = true;
        commands.entity(entity).insert(cascades.build());
    }
    scene.points.iter_mut().for_each(|mut light| light.shadow_maps_enabled = true);
    scene.spots.iter_mut().for_each(|mut light| light.shadow_maps_enabled = true);
    if !no_emission || !scene.suns.is_empty() || !scene.points.is_empty() || !scene.spots.is_empty() {
        return;
    }
    let inside =
        Vec3::from(bounds.min).cmplt(view.translation).all() && view.translation.cmplt(bounds.max.into()).all();
    if inside {
        // A lamp where the viewer stands: 300 lux half way through the room.
        let intensity = 300.0 * (0.5 * reach).powi(2) * 4.0 * std::f32::consts::PI;
        commands.spawn((PointLight { intensity, range: 10.0 * reach, ..default() }, view));
    } else {
        let direction = view.rotation * Vec3::new(0.5, -0.8, -1.0);
        commands.spawn((
            DirectionalLight { illuminance: 1000.0, shadow_maps_enabled: true, ..default() },
            Transform::default().looking_to(direction, Vec3::Y),
            cascades.build(),
        ));
        // What the sun leaves dark is seen by this.
        let fill = DirectionalLight { illuminance: 150.0, ..default() };
        commands.spawn((fill, Transform::from_rotation(view.rotation)));
    }
}

/// What `--matte` promises.
fn make_matte(
    commands: &mut Commands,
    scene: &SceneQueries,
    materials: &mut Assets<StandardMaterial>,
    meshes: &mut Assets<Mesh>,
) {
    for (entity, handle) in &scene.materials {
        let Some(mut material) = materials.get_mut(&handle.0) else { continue };
        if !matches!(material.alpha_mode, AlphaMode::Opaque | AlphaMode::Mask(_)) {
            commands.entity(entity).despawn();
            continue;
        }
        // What shines does so from the sides that the file says, as the path tracer's emitters.
        let shines = material.emissive != LinearRgba::BLACK;
        *material = StandardMaterial {
            base_color: material.base_color,
            base_color_channel: material.base_color_channel.clone(),
            base_color_texture: material.base_color_texture.clone(),
            alpha_mode: material.alpha_mode,
            emissive: material.emissive,
            uv_transform: material.uv_transform,
            metallic: 0.0,
            perceptual_roughness: 1.0,
            reflectance: 0.0,
            double_sided: material.double_sided || !shines,
            cull_mode: material.cull_mode.filter(|_| shines),
            ..default()
        };
    }
    for (.., handle) in &scene.meshes {
        if let Some(mut mesh) = meshes.get_mut(&handle.0) {
            mesh.remove_attribute(Mesh::ATTRIBUTE_COLOR);
        }
    }
}

/// Textures of the whole file, spawned or not.
fn flip_textures(materials: &mut Assets<StandardMaterial>) {
    let flip = Affine2::from_scale_angle_translation(Vec2::new(1.0, -1.0), 0.0, Vec2::Y);
    for (_, material) in materials.iter_mut() {
        material.uv_transform = flip * material.uv_transform;
    }
}

/// Clips follow the app's time exactly, however it was reached.
fn play(time: Res<Time>, clips: Res<Assets<AnimationClip>>, mut players: Query<(&mut AnimationPlayer, &Playing)>) {
    for (mut player, playing) in &mut players {
        let duration = clips.get(&playing.1).map_or(0.0, |clip| f64::from(clip.duration()));
        let seconds = if duration > 0.0 { time.elapsed_secs_f64() % duration } else { 0.0 };
        if let Some(animation) = player.animation_mut(playing.0) {
            animation.set_seek_time(seconds as f32);
        }
    }
}

/// Emission in cd/m^2 comes out as such: Bevy's deferred renderer adds it without exposure, so it is stored exposed.
fn expose_emission(
    emission: Res<Emission>,
    cameras: Query<Ref<Exposure>, With<Camera3d>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let Some(exposure) = cameras.iter().next().filter(|exposure| exposure.is_changed()) else { return };
    for (id, luminance) in &emission.0 {
        if let Some(mut material) = materials.get_mut(*id) {
            material.emissive = *luminance * exposure.exposure();
            material.emissive_exposure_weight = 0.0;
        }
    }
}
