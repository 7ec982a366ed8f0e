//! What may happen in a frame.

use bevy::asset::RenderAssetUsages;
use bevy::camera::{RenderTarget, ScalingMode, Viewport};
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy_bounce::{CssmObject, GiLight, GlobalIllumination, VoxelizedGroup, VoxelizedMesh};
use bevy_bounce_cssm::CssmAsset;
use bevy_bounce_tests::baked::small_cornell_box;
use fastrand::Rng;

use super::fogs::{camera_fog, despawn_fog, drop_fog_asset, edit_fog, move_fog, spawn_fog, volumetric_light};
use super::settings::{illumination, isolate};
use super::skies::{ambient_light, drop_sky_asset, reflections, sky, skybox};
use super::{SIZE, Soak};

/// Most of each that there may be at a time.
const MESHES: usize = 16;
const LIGHTS: usize = 6;
const CAMERAS: usize = 2;

type Action = fn(&mut Soak);

/// Everything that may happen, by name; what should happen more often stands more often.
pub const ACTIONS: &[(&str, Action)] = &[
    ("spawn mesh", spawn_mesh),
    ("spawn mesh", spawn_mesh),
    ("spawn mesh", spawn_mesh),
    ("despawn mesh", despawn_mesh),
    ("spawn light", spawn_light),
    ("spawn light", spawn_light),
    ("despawn light", despawn_light),
    ("edit mesh", edit_mesh),
    ("swap mesh", swap_mesh),
    ("drop mesh asset", drop_mesh_asset),
    ("take mesh away", take_mesh_away),
    ("edit material", edit_material),
    ("swap material", swap_material),
    ("drop material asset", drop_material_asset),
    ("move mesh", move_mesh),
    ("move light", move_light),
    ("edit light", edit_light),
    ("hide", hide),
    ("adopt", adopt),
    ("voxelized mesh", voxelized_mesh),
    ("gi light", gi_light),
    ("baked object", baked_object),
    ("group", group),
    ("group", group),
    ("sky", sky),
    ("skybox", skybox),
    ("drop sky asset", drop_sky_asset),
    ("ambient light", ambient_light),
    ("ambient light", ambient_light),
    ("reflections", reflections),
    ("spawn fog", spawn_fog),
    ("despawn fog", despawn_fog),
    ("move fog", move_fog),
    ("edit fog", edit_fog),
    ("drop fog asset", drop_fog_asset),
    ("camera fog", camera_fog),
    ("camera fog", camera_fog),
    ("volumetric light", volumetric_light),
    ("volumetric light", volumetric_light),
    ("settings", settings),
    ("settings", settings),
    ("isolate", look_at),
    ("remove bounced light", remove_bounced_light),
    ("viewport", viewport),
    ("whole target", whole_target),
    ("activity", activity),
    ("projection", projection),
    ("move camera", move_camera),
    ("spawn camera", spawn_camera),
    ("despawn camera", despawn_camera),
    ("resize target", resize_target),
];

pub(super) fn some(random: &mut Rng, entities: &[Entity]) -> Option<Entity> {
    (!entities.is_empty()).then(|| entities[random.usize(0..entities.len())])
}

pub(super) fn unit(random: &mut Rng) -> f32 {
    2.0 * random.f32() - 1.0
}

pub(super) fn vector(random: &mut Rng) -> Vec3 {
    Vec3::new(unit(random), unit(random), unit(random))
}

pub(super) fn color(random: &mut Rng) -> Color {
    Color::linear_rgb(random.f32(), random.f32(), random.f32())
}

/// Somewhere in a room of eight metres, of any size, now and then flat or mirrored.
pub(super) fn place(random: &mut Rng) -> Transform {
    let scale = match random.u32(0..12) {
        0 => Vec3::new(1.0, 0.0, 1.0),
        1 => Vec3::new(-1.0, 1.0, 1.0),
        2 => Vec3::ZERO,
        _ => Vec3::splat(0.2 + 2.0 * random.f32()),
    };
    Transform::from_translation(4.0 * vector(random))
        .with_rotation(Quat::from_scaled_axis(3.0 * vector(random)))
        .with_scale(scale)
}

fn mesh(random: &mut Rng) -> Mesh {
    match random.u32(0..8) {
        0 => Sphere::new(0.5).into(),
        1 => Plane3d::default().mesh().size(4.0, 4.0).into(),
        2 => Torus::default().into(),
        3 => Cylinder::default().into(),
        4 => {
            let room = Cuboid::from_length(8.0);
            let mut room = Mesh::from(room);
            // Seen from within.
            room = room.scaled_by(Vec3::new(-1.0, 1.0, 1.0));
            room
        }
        5 => one_triangle(random),
        6 => Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0; 3], [1.0; 3]]),
        _ => Cuboid::default().into(),
    }
}

/// Without normals, texture coordinates or indices; now and then without an area.
fn one_triangle(random: &mut Rng) -> Mesh {
    let corners: [Vec3; 3] = if random.bool() { std::array::from_fn(|_| vector(random)) } else { [Vec3::ZERO; 3] };
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners.map(|corner| corner.to_array()).to_vec())
}

fn material(random: &mut Rng) -> StandardMaterial {
    let alpha_mode = match random.u32(0..6) {
        0 => AlphaMode::Blend,
        1 => AlphaMode::Mask(0.5),
        2 => AlphaMode::Add,
        _ => AlphaMode::Opaque,
    };
    let emissive = if random.u32(0..5) == 0 { color(random).to_linear() * 200.0 } else { LinearRgba::BLACK };
    StandardMaterial {
        base_color: color(random).with_alpha(random.f32()),
        emissive,
        emissive_exposure_weight: random.f32(),
        metallic: if random.bool() { random.f32() } else { 0.0 },
        perceptual_roughness: random.f32(),
        unlit: random.u32(0..8) == 0,
        double_sided: random.bool(),
        cull_mode: None,
        alpha_mode,
        ..default()
    }
}

fn mesh_handle(soak: &mut Soak) -> Mesh3d {
    let mesh = mesh(&mut soak.random);
    Mesh3d(soak.stage.world().resource_mut::<Assets<Mesh>>().add(mesh))
}

fn material_handle(soak: &mut Soak) -> MeshMaterial3d<StandardMaterial> {
    let material = material(&mut soak.random);
    MeshMaterial3d(soak.stage.world().resource_mut::<Assets<StandardMaterial>>().add(material))
}

fn spawn_mesh(soak: &mut Soak) {
    if soak.meshes.len() < MESHES {
        let bundle = (mesh_handle(soak), material_handle(soak), place(&mut soak.random));
        let mesh = soak.stage.world().spawn(bundle).id();
        soak.meshes.push(mesh);
    }
}

/// With its children.
fn despawn_mesh(soak: &mut Soak) {
    if let Some(mesh) = some(&mut soak.random, &soak.meshes) {
        let world = soak.stage.world();
        world.despawn(mesh);
        soak.meshes.retain(|mesh| world.get_entity(*mesh).is_ok());
        soak.lights.retain(|light| world.get_entity(*light).is_ok());
    }
}

fn spawn_light(soak: &mut Soak) {
    if soak.lights.len() >= LIGHTS {
        return;
    }
    let random = &mut soak.random;
    let (color, shadow_maps_enabled, power) = (color(random), random.bool(), 100_000.0 * random.f32());
    let place = Transform::from_translation(3.0 * vector(random)).looking_at(vector(random), Vec3::Y);
    let kind = random.u32(0..4);
    let mut light = soak.stage.world().spawn(place);
    match kind {
        0 => light.insert(PointLight { color, shadow_maps_enabled, intensity: power, range: 20.0, ..default() }),
        1 => light.insert(SpotLight { color, shadow_maps_enabled, intensity: power, range: 20.0, ..default() }),
        2 => light.insert(DirectionalLight { color, shadow_maps_enabled, illuminance: power / 20.0, ..default() }),
        _ => light.insert(RectLight { color, intensity: power, ..default() }),
    };
    soak.lights.push(light.id());
}

fn despawn_light(soak: &mut Soak) {
    if let Some(light) = some(&mut soak.random, &soak.lights) {
        soak.stage.world().despawn(light);
        soak.lights.retain(|other| *other != light);
    }
}

/// Another shape behind the same handle.
fn edit_mesh(soak: &mut Soak) {
    let Some(entity) = some(&mut soak.random, &soak.meshes) else { return };
    let mesh = mesh(&mut soak.random);
    let Some(handle) = soak.stage.world().get::<Mesh3d>(entity).map(|mesh| mesh.0.clone()) else { return };
    // A handle whose asset was dropped takes no other.
    drop(soak.stage.world().resource_mut::<Assets<Mesh>>().insert(&handle, mesh));
}

/// One's own, or that of another.
fn swap_mesh(soak: &mut Soak) {
    let (to, from) = (some(&mut soak.random, &soak.meshes), some(&mut soak.random, &soak.meshes));
    let (Some(to), Some(from)) = (to, from) else { return };
    let shared = soak.stage.world().get::<Mesh3d>(from).cloned().filter(|_| soak.random.bool());
    let mesh = shared.unwrap_or_else(|| mesh_handle(soak));
    soak.stage.world().entity_mut(to).insert(mesh);
}

fn drop_mesh_asset(soak: &mut Soak) {
    let Some(entity) = some(&mut soak.random, &soak.meshes) else { return };
    let Some(handle) = soak.stage.world().get::<Mesh3d>(entity).map(|mesh| mesh.0.clone()) else { return };
    soak.stage.world().resource_mut::<Assets<Mesh>>().remove(&handle);
}

fn take_mesh_away(soak: &mut Soak) {
    if let Some(entity) = some(&mut soak.random, &soak.meshes) {
        soak.stage.world().entity_mut(entity).remove::<Mesh3d>();
    }
}

fn edit_material(soak: &mut Soak) {
    let Some(entity) = some(&mut soak.random, &soak.meshes) else { return };
    let changed = material(&mut soak.random);
    let world = soak.stage.world();
    let handle = world.get::<MeshMaterial3d<StandardMaterial>>(entity).map(|material| material.0.clone());
    let Some(handle) = handle else { return };
    if let Some(mut material) = world.resource_mut::<Assets<StandardMaterial>>().get_mut(&handle) {
        *material = changed;
    }
}

fn swap_material(soak: &mut Soak) {
    if let Some(entity) = some(&mut soak.random, &soak.meshes) {
        let material = material_handle(soak);
        soak.stage.world().entity_mut(entity).insert(material);
    }
}

fn drop_material_asset(soak: &mut Soak) {
    let Some(entity) = some(&mut soak.random, &soak.meshes) else { return };
    let world = soak.stage.world();
    let handle = world.get::<MeshMaterial3d<StandardMaterial>>(entity).map(|material| material.0.clone());
    if let Some(handle) = handle {
        world.resource_mut::<Assets<StandardMaterial>>().remove(&handle);
    }
}

fn move_mesh(soak: &mut Soak) {
    if let Some(entity) = some(&mut soak.random, &soak.meshes) {
        let mut place = place(&mut soak.random);
        let world = soak.stage.world();
        if world.get::<Children>(entity).is_some() && !has_size(&place) {
            place.scale = Vec3::ONE;
        }
        world.entity_mut(entity).insert(place);
    }
}

fn move_light(soak: &mut Soak) {
    if let Some(entity) = some(&mut soak.random, &soak.lights) {
        let place = place(&mut soak.random).with_scale(Vec3::ONE);
        soak.stage.world().entity_mut(entity).insert(place);
    }
}

/// Dark, with and without shadows, soft or sharp.
fn edit_light(soak: &mut Soak) {
    let Some(entity) = some(&mut soak.random, &soak.lights) else { return };
    let (dark, shadows, angle) = (soak.random.u32(0..3) == 0, soak.random.bool(), 1.5 * soak.random.f32());
    let mut light = soak.stage.world().entity_mut(entity);
    if let Some(mut point) = light.get_mut::<PointLight>() {
        point.shadow_maps_enabled = shadows;
        point.intensity *= if dark { 0.0 } else { 0.9 };
    } else if let Some(mut spot) = light.get_mut::<SpotLight>() {
        spot.shadow_maps_enabled = shadows;
        (spot.inner_angle, spot.outer_angle) = (if dark { angle } else { 0.0 }, angle);
    } else if let Some(mut sun) = light.get_mut::<DirectionalLight>() {
        sun.shadow_maps_enabled = shadows;
        sun.illuminance *= if dark { 0.0 } else { 0.9 };
    }
}

fn hide(soak: &mut Soak) {
    let all: Vec<Entity> = soak.meshes.iter().chain(&soak.lights).copied().collect();
    if let Some(entity) = some(&mut soak.random, &all) {
        let visibility = if soak.random.bool() { Visibility::Hidden } else { Visibility::Inherited };
        soak.stage.world().entity_mut(entity).insert(visibility);
    }
}

/// Lamps within what has none make Bevy panic.
fn has_size(place: &Transform) -> bool {
    place.scale.abs().min_element() > 0.0
}

/// Under another mesh, or out from under it.
fn adopt(soak: &mut Soak) {
    let all: Vec<Entity> = soak.meshes.iter().chain(&soak.lights).copied().collect();
    let (Some(child), Some(parent)) = (some(&mut soak.random, &all), some(&mut soak.random, &soak.meshes)) else {
        return;
    };
    let world = soak.stage.world();
    if !world.get::<Transform>(parent).is_some_and(has_size) {
        return;
    }
    let mut above = Some(parent);
    while let Some(entity) = above {
        if entity == child {
            world.entity_mut(child).remove::<ChildOf>();
            return;
        }
        above = world.get::<ChildOf>(entity).map(ChildOf::parent);
    }
    world.entity_mut(child).insert(ChildOf(parent));
}

fn voxelized_mesh(soak: &mut Soak) {
    let Some(entity) = some(&mut soak.random, &soak.meshes) else { return };
    let random = &mut soak.random;
    let albedo = random.bool().then(|| color(random));
    let two_sided = random.bool().then(|| random.bool());
    let (enabled, remove) = (random.bool(), random.bool());
    let mut mesh = soak.stage.world().entity_mut(entity);
    match remove {
        true => mesh.remove::<VoxelizedMesh>(),
        false => mesh.insert(VoxelizedMesh { enabled, albedo, two_sided }),
    };
}

fn gi_light(soak: &mut Soak) {
    let Some(entity) = some(&mut soak.random, &soak.lights) else { return };
    let random = &mut soak.random;
    let (intensity, share, bounces) = (2.0 * random.f32(), 2.0 * random.f32(), random.u32(0..8));
    let kind = random.u32(0..3);
    let mut light = soak.stage.world().entity_mut(entity);
    match kind {
        0 => light.remove::<GiLight>(),
        1 => light.insert(GiLight::OFF),
        _ => light.insert(GiLight { intensity, share, bounces }),
    };
}

/// A bake on a mesh that it does not fit, and away again.
fn baked_object(soak: &mut Soak) {
    let Some(entity) = some(&mut soak.random, &soak.meshes) else { return };
    let world = soak.stage.world();
    if world.entity_mut(entity).take::<CssmObject>().is_none() {
        let file = small_cornell_box().clone();
        let bake = world.resource_mut::<Assets<CssmAsset>>().add(CssmAsset { file });
        world.entity_mut(entity).insert(CssmObject { bake });
    }
}

/// The mesh and those below it have a grid of their own, and no longer.
fn group(soak: &mut Soak) {
    let Some(entity) = some(&mut soak.random, &soak.meshes) else { return };
    let (resolution, remove) = (soak.random.u32(0..40), soak.random.u32(0..3) == 0);
    let mut mesh = soak.stage.world().entity_mut(entity);
    match remove {
        true => mesh.remove::<VoxelizedGroup>(),
        false => mesh.insert(VoxelizedGroup { resolution }),
    };
}

/// The first camera or another one.
pub(super) fn camera(soak: &mut Soak) -> Entity {
    let (main, cameras) = (soak.main, soak.cameras.clone());
    if soak.random.bool() { main } else { some(&mut soak.random, &cameras).unwrap_or(main) }
}

fn settings(soak: &mut Soak) {
    let (camera, illumination) = (camera(soak), illumination(&mut soak.random));
    soak.stage.world().entity_mut(camera).insert(illumination);
}

fn look_at(soak: &mut Soak) {
    let (camera, isolate) = (camera(soak), isolate(&mut soak.random));
    soak.stage.world().entity_mut(camera).insert(isolate);
}

fn remove_bounced_light(soak: &mut Soak) {
    let camera = camera(soak);
    soak.stage.world().entity_mut(camera).remove::<GlobalIllumination>();
}

fn change_camera(soak: &mut Soak, entity: Entity, change: impl FnOnce(&mut Camera)) {
    if let Some(mut camera) = soak.stage.world().get_mut::<Camera>(entity) {
        change(&mut camera);
    }
}

fn viewport(soak: &mut Soak) {
    let random = &mut soak.random;
    let physical_position = UVec2::new(random.u32(0..SIZE.x), random.u32(0..SIZE.y));
    let room = SIZE - physical_position;
    let physical_size = UVec2::new(random.u32(1..=room.x), random.u32(1..=room.y));
    let main = soak.main;
    change_camera(soak, main, |camera| {
        camera.viewport = Some(Viewport { physical_position, physical_size, ..default() });
    });
}

fn whole_target(soak: &mut Soak) {
    let main = soak.main;
    change_camera(soak, main, |camera| camera.viewport = None);
}

fn activity(soak: &mut Soak) {
    let (camera, active) = (camera(soak), soak.random.u32(0..4) > 0);
    change_camera(soak, camera, |camera| camera.is_active = active);
}

fn projection(soak: &mut Soak) {
    let camera = camera(soak);
    let parallel = OrthographicProjection {
        scaling_mode: ScalingMode::FixedVertical { viewport_height: 1.0 + 8.0 * soak.random.f32() },
        ..OrthographicProjection::default_3d()
    };
    let projection = if soak.random.bool() { Projection::default() } else { Projection::Orthographic(parallel) };
    soak.stage.world().entity_mut(camera).insert(projection);
}

fn move_camera(soak: &mut Soak) {
    let camera = camera(soak);
    let place = Transform::from_translation(6.0 * vector(&mut soak.random)).looking_at(Vec3::ZERO, Vec3::Y);
    soak.stage.world().entity_mut(camera).insert(place);
}

fn target(random: &mut Rng) -> Image {
    let size = Extent3d { width: random.u32(1..64), height: random.u32(1..64), depth_or_array_layers: 1 };
    let usages = RenderAssetUsages::RENDER_WORLD;
    let mut image = Image::new_uninit(size, TextureDimension::D2, TextureFormat::Rgba8UnormSrgb, usages);
    image.texture_descriptor.usage |= TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING;
    image
}

/// With a target of its own, with and without bounced light.
fn spawn_camera(soak: &mut Soak) {
    if soak.cameras.len() >= CAMERAS {
        return;
    }
    let (image, order) = (target(&mut soak.random), -1 - soak.cameras.len() as isize);
    let lit = soak.random.bool().then(|| illumination(&mut soak.random));
    let place = Transform::from_translation(5.0 * vector(&mut soak.random)).looking_at(Vec3::ZERO, Vec3::Y);
    let world = soak.stage.world();
    let image = world.resource_mut::<Assets<Image>>().add(image);
    let camera = world.spawn((Camera3d::default(), place)).id();
    // After what the run gives to every camera.
    let mut camera = world.entity_mut(camera);
    camera.insert((RenderTarget::Image(image.into()), Camera { order, ..default() })).remove::<GlobalIllumination>();
    if let Some(lit) = lit {
        camera.insert(lit);
    }
    let camera = camera.id();
    soak.cameras.push(camera);
}

fn despawn_camera(soak: &mut Soak) {
    if let Some(camera) = some(&mut soak.random, &soak.cameras) {
        soak.stage.world().despawn(camera);
        soak.cameras.retain(|other| *other != camera);
    }
}

fn resize_target(soak: &mut Soak) {
    let Some(camera) = some(&mut soak.random, &soak.cameras) else { return };
    let image = target(&mut soak.random);
    let world = soak.stage.world();
    let handle = world.get::<RenderTarget>(camera).and_then(|target| target.as_image().cloned());
    if let Some(handle) = handle {
        drop(world.resource_mut::<Assets<Image>>().insert(&handle, image));
    }
}
