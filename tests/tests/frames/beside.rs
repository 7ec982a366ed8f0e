//! Bounced light beside what else Bevy does to a picture: each of it, and each pair.
//!
//! Light is counted once: the mean of the whole picture is that of direct and of bounced light together. Three of Bevy's effects do
//! not keep to sums, and are held to what they do: fog takes some of the bounced light, of which volumetric fog scatters some, and
//! screen-space reflections show it once more.

use std::ops::Range;

use bevy::anti_alias::{fxaa, taa};
use bevy::asset::RenderAssetUsages;
use bevy::camera::{Exposure, ScalingMode, Viewport};
use bevy::ecs::world::EntityWorldMut;
use bevy::light::{self, LightProbe};
use bevy::pbr::{DistanceFog, FogFalloff, Lightmap, MeshPipeline, ScreenSpaceAmbientOcclusion, ScreenSpaceReflections};
use bevy::post_process::bloom;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, WgpuFeatures};
use bevy::render::renderer::RenderDevice;
use bevy_bounce::{GiIsolate, GiSettings, GlobalIllumination, RadianceCacheSettings, Technique, VoxelizedMesh};
use bevy_bounce_examples::scenes::{Builder, Walls};
use bevy_bounce_tests::eye::Eye;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination};
use half::f16;

const SIZE: UVec2 = UVec2::new(64, 36);
const EXPOSURE: Exposure = Exposure { ev100: 6.0 };
/// Frames until a picture stands still: what it needs is compiled, light probes are lit.
const FRAMES: usize = 4;
/// Temporal anti-aliasing goes through its eight places once.
const FRAMES_OF_TAA: usize = 10;
/// `GiSettings::probes` with which volumetric fog is lit.
const PROBES: u32 = 8;

/// What else there may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Effect {
    TemporalAntiAliasing,
    Fxaa,
    Bloom,
    Occlusion,
    Reflections,
    Fog,
    VolumetricFog,
    Lightmaps,
    IrradianceVolume,
    EnvironmentMap,
}

use Effect::*;

const EFFECTS: [Effect; 10] = [
    TemporalAntiAliasing,
    Fxaa,
    Bloom,
    Occlusion,
    Reflections,
    Fog,
    VolumetricFog,
    Lightmaps,
    IrradianceVolume,
    EnvironmentMap,
];

/// Storage textures that a stage of Bevy's occlusion has.
const OCCLUSION_TEXTURES: u32 = 5;

/// What Bevy offers on the device: on WebGPU's default limits without optional features, neither bloom nor occlusion.
fn offered(stage: &Stage) -> Vec<Effect> {
    let device = stage.render_world().resource::<RenderDevice>();
    let bloom = device.features().contains(WgpuFeatures::RG11B10UFLOAT_RENDERABLE);
    let occlusion = device.limits().max_storage_textures_per_shader_stage >= OCCLUSION_TEXTURES;
    let is_offered = |effect: &Effect| match effect {
        Bloom => bloom,
        Occlusion => occlusion,
        _ => true,
    };
    EFFECTS.into_iter().filter(is_offered).collect()
}

/// What the effects of the scene need.
#[derive(Resource, Clone)]
struct Images {
    lightmap: Handle<Image>,
    volume: Handle<Image>,
}

/// The mesh that may have a lightmap: the red wall.
#[derive(Component)]
struct Mapped;

/// An image in three dimensions of one colour.
pub fn even(images: &mut Assets<Image>, [width, height, depth]: [u32; 3], value: [f32; 3]) -> Handle<Image> {
    let texel = [value[0], value[1], value[2], 1.0].map(|c| f16::from_f32(c).to_le_bytes()).concat();
    let size = Extent3d { width, height, depth_or_array_layers: depth };
    let dimension = if depth > 1 { TextureDimension::D3 } else { TextureDimension::D2 };
    let usages = RenderAssetUsages::default();
    images.add(Image::new_fill(size, dimension, &texel, TextureFormat::Rgba16Float, usages))
}

/// A corner of a room with a block and a polished ball, lit by a lamp.
fn scene(mut build: Builder, mut images: ResMut<Assets<Image>>) {
    build.commands.insert_resource(Images {
        lightmap: even(&mut images, [4, 4, 1], [40.0, 30.0, 20.0]),
        volume: even(&mut images, [2, 4, 6], [1.0, 1.0, 1.0]),
    });
    let (white, red) = (build.paint([0.8; 3]), build.paint([0.8, 0.1, 0.1]));
    let polish = build.materials.add(StandardMaterial {
        base_color: Color::linear_rgb(0.8, 0.8, 0.8),
        metallic: 1.0,
        perceptual_roughness: 0.15,
        ..default()
    });
    build.place(Cuboid::new(6.0, 0.2, 6.0), Transform::from_xyz(0.0, -0.1, 0.0), &white);
    build.place(Cuboid::new(6.0, 4.0, 0.2), Transform::from_xyz(0.0, 2.0, -2.0), &white);
    let wall = Mesh::from(Cuboid::new(0.2, 4.0, 6.0));
    let uv = wall.attribute(Mesh::ATTRIBUTE_UV_0).cloned();
    let wall = uv.into_iter().fold(wall, |wall, uv| wall.with_inserted_attribute(Mesh::ATTRIBUTE_UV_1, uv));
    build.place(wall, Transform::from_xyz(-2.0, 2.0, 0.0), &red).insert(Mapped);
    build.place(Sphere::new(0.7), Transform::from_xyz(0.9, 0.7, -0.2), &polish);
    build.block(Vec3::new(-0.8, 0.0, 0.2), Vec3::splat(0.9), 0.4, &white);
    let lamp = SpotLight { intensity: 400_000.0, range: 30.0, shadow_maps_enabled: true, ..default() };
    build.commands.spawn((lamp, Transform::from_xyz(1.5, 3.5, 2.0).looking_at(Vec3::new(-1.0, 0.5, -1.0), Vec3::Y)));
    build.commands.spawn((Camera3d::default(), Camera { is_active: false, ..default() }));
}

/// Gives the camera or the scene what the effect is.
fn add(effect: Effect, camera: &mut EntityWorldMut) {
    let images = camera.world().resource::<Images>().clone();
    match effect {
        TemporalAntiAliasing => put(camera, taa::TemporalAntiAliasing::default()),
        Fxaa => put(camera, fxaa::Fxaa::default()),
        Bloom => put(camera, bloom::Bloom::NATURAL),
        Occlusion => put(camera, ScreenSpaceAmbientOcclusion::default()),
        Reflections => put(camera, ScreenSpaceReflections::default()),
        Fog => {
            let falloff = FogFalloff::Exponential { density: 0.1 };
            put(camera, DistanceFog { color: Color::BLACK, falloff, ..default() });
        }
        VolumetricFog => {
            put(camera, light::VolumetricFog { ambient_intensity: 0.0, ..default() });
            camera.world_scope(spawn_fog);
        }
        Lightmaps => camera.world_scope(|world| {
            map(world, Some(Lightmap { image: images.lightmap, ..default() }));
        }),
        IrradianceVolume => camera.world_scope(|world| {
            let volume = light::IrradianceVolume { voxels: images.volume, intensity: 500.0, ..default() };
            world.spawn((LightProbe::default(), volume, Transform::from_scale(Vec3::splat(12.0))));
        }),
        EnvironmentMap => {
            let map = camera.world_scope(|world| {
                let mut images = world.resource_mut::<Assets<Image>>();
                EnvironmentMapLight { intensity: 60.0, ..EnvironmentMapLight::solid_color(&mut images, Color::WHITE) }
            });
            put(camera, map);
        }
    }
}

fn put(camera: &mut EntityWorldMut, bundle: impl Bundle) {
    camera.insert(bundle);
}

/// Fog that fills the room and what is before it, the camera too, and scatters what the lamp sends into it.
fn spawn_fog(world: &mut World) {
    let (absorption, scattering, scattering_asymmetry) = (0.5, 1.0, 0.0);
    let fog = light::FogVolume { density_factor: 0.06, absorption, scattering, scattering_asymmetry, ..default() };
    world.spawn((fog, Transform::from_xyz(0.0, 2.0, 1.5).with_scale(Vec3::new(5.0, 4.5, 8.0))));
    let mut lamps = world.query_filtered::<Entity, With<SpotLight>>();
    let lamps: Vec<Entity> = lamps.iter(world).collect();
    for lamp in lamps {
        world.entity_mut(lamp).insert(light::VolumetricLight);
    }
}

/// Takes from the scene what [`add`] gave it.
fn clear(world: &mut World) {
    let mut found = world.query_filtered::<Entity, Or<(With<light::IrradianceVolume>, With<light::FogVolume>)>>();
    let volumes: Vec<Entity> = found.iter(world).collect();
    for volume in volumes {
        world.despawn(volume);
    }
    let mut lamps = world.query_filtered::<Entity, With<light::VolumetricLight>>();
    let lamps: Vec<Entity> = lamps.iter(world).collect();
    for lamp in lamps {
        world.entity_mut(lamp).remove::<light::VolumetricLight>();
    }
    map(world, None);
}

/// Gives a lightmap to the meshes that may have one, or takes it. Bevy chooses their pipelines anew only where the mesh itself
/// has changed: without that its prepass draws with the layout of before, which is a validation error.
fn map(world: &mut World, lightmap: Option<Lightmap>) {
    let mut mapped = world.query_filtered::<Entity, With<Mapped>>();
    let mapped: Vec<Entity> = mapped.iter(world).collect();
    for mesh in mapped {
        let mut mesh = world.entity_mut(mesh);
        match &lightmap {
            Some(lightmap) => mesh.insert(lightmap.clone()),
            None => mesh.remove::<Lightmap>(),
        };
        if let Some(mut mesh) = mesh.get_mut::<Mesh3d>() {
            mesh.set_changed();
        }
    }
}

fn stage() -> Stage {
    Stage::new(SIZE, SMALL, |app| {
        app.add_systems(Startup, scene);
    })
}

/// What a camera with these effects sees; without `isolate` there is no bounced light.
fn picture(stage: &mut Stage, effects: &[Effect], isolate: Option<GiIsolate>) -> Picture {
    picture_by(stage, effects, isolate, ())
}

/// The same by a camera that has more.
fn picture_by(stage: &mut Stage, effects: &[Effect], isolate: Option<GiIsolate>, camera: impl Bundle) -> Picture {
    let place = Transform::from_xyz(1.2, 2.0, 4.5).looking_at(Vec3::new(-0.2, 1.0, 0.0), Vec3::Y);
    let eye = Eye::open(stage, SIZE, EXPOSURE, (place, camera));
    let mut camera = stage.world().entity_mut(eye.camera);
    if let Some(isolate) = isolate {
        let probes = if effects.contains(&VolumetricFog) { PROBES } else { 0 };
        camera.insert((illumination(GiSettings { probes, ..SMALL }), isolate));
    }
    effects.iter().for_each(|effect| add(*effect, &mut camera));
    let frames = if effects.contains(&TemporalAntiAliasing) { FRAMES_OF_TAA } else { FRAMES };
    for _ in 0..frames {
        stage.frame(std::time::Duration::ZERO);
    }
    let picture = eye.picture(stage);
    eye.close(stage);
    clear(stage.world());
    assert_eq!(picture.nonfinite(), 0, "{effects:?}, {isolate:?}: values are not finite");
    picture
}

/// Mean luminance of the whole picture, of direct and of bounced light.
fn means(stage: &mut Stage, effects: &[Effect]) -> [f64; 3] {
    [GiIsolate::All, GiIsolate::Direct, GiIsolate::Indirect]
        .map(|isolate| picture(stage, effects, Some(isolate)).mean_luminance())
}

/// What of the bounced light is in the whole picture: one, but for fog of both kinds and reflections.
fn share_of_bounced_light(stage: &mut Stage, effects: &[Effect]) -> f64 {
    let [all, direct, bounced] = means(stage, effects);
    assert!(direct > 0.0 && bounced > 0.05 * direct, "{effects:?}: too little bounced light to tell");
    let sum = all / (direct + bounced);
    let share = (all - direct) / bounced;
    println!("{effects:?}: all {all:.3}, direct {direct:.3}, bounced {bounced:.3}, sum {sum:.4}, share {share:.3}");
    let fog = effects.contains(&Fog) || effects.contains(&VolumetricFog);
    let reflections = effects.contains(&Reflections);
    match (fog, reflections) {
        (false, false) => assert!((sum - 1.0).abs() < 0.03, "{effects:?}: {all} of {direct} and {bounced}"),
        (true, false) => assert!((0.3..0.95).contains(&share), "{effects:?}: {share} of the bounced light"),
        (false, true) => assert!((0.97..1.3).contains(&share), "{effects:?}: {share} of the bounced light"),
        (true, true) => assert!((0.3..1.3).contains(&share), "{effects:?}: {share} of the bounced light"),
    }
    share
}

#[test]
fn light_is_counted_once_beside_each_effect() {
    let mut stage = stage();
    let plain = means(&mut stage, &[]);
    println!("alone: all, direct and bounced {plain:.3?}");
    for effect in offered(&stage) {
        share_of_bounced_light(&mut stage, &[effect]);
    }
    assert_eq!(plain, means(&mut stage, &[]), "an effect left something behind");
}

/// A surface with a lightmap keeps that, and gets no bounced light on top, with and without compensation; what is beside it, a plate two
/// centimetres before it included, gets as much as without a lightmap. So it is in a viewport, and where rays are parallel.
#[test]
fn a_lightmap_stands_for_bounced_light() {
    let scaling_mode = ScalingMode::FixedVertical { viewport_height: 4.0 };
    let parallel = OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() };
    let viewport = Viewport { physical_position: UVec2::new(7, 5), physical_size: UVec2::new(51, 29), ..default() };
    for (name, projection, viewport) in [
        ("whole", Projection::default(), None),
        ("viewport", Projection::default(), Some(viewport)),
        ("parallel", Projection::from(parallel), None),
    ] {
        let camera = || (projection.clone(), Camera { viewport: viewport.clone(), ..default() });
        let mut stage = stage();
        let mut direct_of = |effects: &[Effect]| picture_by(&mut stage, effects, Some(GiIsolate::Direct), camera());
        let without_plate = direct_of(&[]);
        hang_plate(stage.world());
        let mut seen = |effects: &[Effect]| {
            [GiIsolate::All, GiIsolate::Direct, GiIsolate::Indirect]
                .map(|isolate| picture_by(&mut stage, effects, Some(isolate), camera()))
        };
        let ([lit, direct, _], mapped) = (seen(&[]), seen(&[Lightmaps]));
        let [mut on_wall, mut beside, mut on_plate] = [0, 0, 0];
        for (x, y) in (0..SIZE.y as usize).flat_map(|y| (0..SIZE.x as usize).map(move |x| (x, y))) {
            let at = |picture: &Picture| picture.at(x, y);
            let [all, alone, bounced] = [0, 1, 2].map(|i| at(&mapped[i]));
            if alone != at(&direct) {
                on_wall += 1;
                assert_eq!(all, alone, "{name}: ({x}, {y}) has a lightmap");
                assert_eq!(bounced, [0.0; 3], "{name}: ({x}, {y}) has a lightmap");
            } else {
                let (all, without) = (all[1], at(&lit)[1]);
                beside += usize::from(without > at(&direct)[1]);
                on_plate += usize::from(at(&direct) != at(&without_plate) && without > at(&direct)[1]);
                assert!(
                    (all - without).abs() <= 0.1 * without,
                    "{name}: ({x}, {y}), which has none: {all} of {without}"
                );
            }
        }
        println!("{name}: {on_wall} pixels with a lightmap, {beside} beside them, {on_plate} on the plate");
        assert!(on_wall > 100 && beside > 400 && on_plate > 20, "{name}: {on_wall}, {beside}, {on_plate}");
    }
}

/// Before the red wall.
fn hang_plate(world: &mut World) {
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.02, 1.0, 1.0));
    let paint = StandardMaterial { base_color: Color::linear_rgb(0.6, 0.6, 0.6), reflectance: 0.0, ..default() };
    let paint = world.resource_mut::<Assets<StandardMaterial>>().add(paint);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(paint), Transform::from_xyz(-1.87, 1.6, 0.8)));
}

/// What volumetric fog takes of bounced light and what it scatters of it is the same beside what keeps to sums.
#[test]
fn volumetric_fog_is_lit_alike_beside_each_effect() {
    let mut stage = stage();
    let alone = share_of_bounced_light(&mut stage, &[VolumetricFog]);
    for effect in offered(&stage).into_iter().filter(|effect| *effect != VolumetricFog) {
        let share = share_of_bounced_light(&mut stage, &[VolumetricFog, effect]) / alone;
        match effect {
            Fog => assert!((0.3..0.95).contains(&share), "{effect:?}: {share} of what there is without"),
            Reflections => assert!((0.97..1.3).contains(&share), "{effect:?}: {share} of what there is without"),
            // More comes to what is in the air than to surfaces: of a sky, and where a lightmap keeps bounced light from these.
            EnvironmentMap | Lightmaps => {
                assert!((1.0..1.3).contains(&share), "{effect:?}: {share} of what there is without")
            }
            _ => assert!((share - 1.0).abs() < 0.05, "{effect:?}: {share} of what there is without"),
        }
    }
}

/// What both do to bounced light is what one does after the other; without fog and reflections that is nothing.
#[test]
fn light_is_counted_once_beside_each_pair_of_effects() {
    let mut stage = stage();
    let effects = offered(&stage);
    let shares: Vec<f64> = effects.iter().map(|effect| share_of_bounced_light(&mut stage, &[*effect])).collect();
    let alone: Vec<(Effect, f64)> = effects.into_iter().zip(shares).collect();
    let binds_arrays = stage.render_world().resource::<MeshPipeline>().binding_arrays_are_usable;
    for (at, (first, share)) in alone.iter().enumerate() {
        for (second, other) in &alone[at + 1..] {
            // Bevy's shader of both does not compile then.
            if !binds_arrays && (*first, *second) == (Lightmaps, EnvironmentMap) {
                continue;
            }
            let [all, direct, bounced] = means(&mut stage, &[*first, *second]);
            let sum = all / (direct + bounced * share * other);
            println!("{first:?}, {second:?}: {sum:.4} of the sum of the parts");
            assert!((sum - 1.0).abs() < 0.03, "{first:?}, {second:?}: {all} of {direct} and {bounced}");
        }
    }
}

/// A closed room with a ball of metal before the camera, and a floor that may be of metal, too.
fn polished_room(mut build: Builder) {
    let white = build.paint([0.7; 3]);
    let red = build.paint([0.7, 0.2, 0.2]);
    let [ceiling, back, front, right] = std::array::from_fn(|_| white.clone());
    let floor = build.paint([0.8; 3]);
    build.commands.insert_resource(Polished(floor.clone()));
    let walls = Walls { floor, ceiling, back, front, left: red, right };
    build.room(Vec3::splat(-1.5), Vec3::splat(1.5), &walls);
    let metal = build.materials.add(metal(0.3));
    build.place(Sphere::new(0.4), Transform::from_xyz(0.0, -0.2, -0.3), &metal);
    build.commands.insert_resource(Ball(metal));
    build
        .commands
        .spawn((PointLight { intensity: 100_000.0, range: 30.0, ..default() }, Transform::from_xyz(0.6, 1.0, 0.6)));
    build.commands.spawn((Camera3d::default(), Camera { is_active: false, ..default() }));
}

fn metal(roughness: f32) -> StandardMaterial {
    StandardMaterial {
        base_color: Color::linear_rgb(0.8, 0.8, 0.8),
        metallic: 1.0,
        perceptual_roughness: roughness,
        ..default()
    }
}

/// Paint of the ball.
#[derive(Resource)]
struct Ball(Handle<StandardMaterial>);

/// Paint of the floor.
#[derive(Resource)]
struct Polished(Handle<StandardMaterial>);

fn polished_stage() -> Stage {
    Stage::new(SIZE, SMALL, |app| {
        app.add_systems(Startup, polished_room);
    })
}

fn paint(stage: &mut Stage, paint: &Handle<StandardMaterial>, material: StandardMaterial) {
    stage.world().resource_mut::<Assets<StandardMaterial>>().insert(paint, material).expect("is there");
}

/// Mean light of parts of the picture, columns and rows, by caches and, where asked for, Bevy's reflections.
fn parts<const N: usize>(
    stage: &mut Stage,
    isolate: GiIsolate,
    reflections: bool,
    towards: Vec3,
    parts: [(Range<usize>, Range<usize>); N],
) -> [f64; N] {
    let radiance_cache = RadianceCacheSettings { glossy: true, ..default() };
    let light = illumination(GiSettings { grid: 64, radiance_cache, ..SMALL });
    let place = Transform::from_xyz(0.0, 0.0, 1.3).looking_at(towards, Vec3::Y);
    let eye = Eye::open(stage, SIZE, EXPOSURE, (place, light, isolate));
    if reflections {
        // On mirrors, too.
        let reflections = ScreenSpaceReflections { min_perceptual_roughness: 0.0..0.0, ..default() };
        stage.world().entity_mut(eye.camera).insert(reflections);
    }
    (0..4).for_each(|_| stage.frame(std::time::Duration::ZERO));
    let mut means = [0.0; N];
    // Bevy's reflections are a ray a pixel, another one each frame.
    let frames = if reflections { 8.0 } else { 1.0 };
    for _ in 0..frames as usize {
        stage.frame(std::time::Duration::ZERO);
        let picture = eye.picture(stage);
        assert_eq!(picture.nonfinite(), 0);
        for (mean, (x, y)) in means.iter_mut().zip(&parts) {
            *mean += picture.mean_of(x.clone(), y.clone())[1] / frames;
        }
    }
    eye.close(stage);
    means
}

/// However smooth a metal is, it has about the same light with Bevy's reflections as by caches alone: nothing twice, and no seam where
/// reflections fade or meet nothing, which is most of a ball's front.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn reflections_and_caches_share_the_light() {
    let mut stage = polished_stage();
    let ball = stage.world().resource::<Ball>().0.clone();
    const BALL: Vec3 = Vec3::new(0.0, -0.2, -0.3);
    let quarters = [0, 1, 2, 3].map(|i| (25 + 7 * (i % 2), 11 + 7 * (i / 2))).map(|(x, y)| (x..x + 7, y..y + 7));
    for roughness in [0.1, 0.3, 0.57] {
        paint(&mut stage, &ball, metal(roughness));
        let mut light = |reflections| parts(&mut stage, GiIsolate::All, reflections, BALL, quarters.clone());
        let (by_caches, with) = (light(false), light(true));
        let ratios: [f64; 4] = std::array::from_fn(|i| with[i] / by_caches[i]);
        println!("roughness {roughness}: by caches {by_caches:.2?}, with reflections {ratios:.2?} of it");
        assert!(ratios.iter().all(|ratio| (0.9..1.1).contains(ratio)), "roughness {roughness}: {ratios:?}");
    }
}

/// Where Bevy's reflections do meet something, on a floor of metal, caches leave them its light, and it is about what caches show there.
#[test]
fn what_reflections_meet_is_theirs() {
    let mut stage = polished_stage();
    let floor = stage.world().resource::<Polished>().0.clone();
    paint(&mut stage, &floor, metal(0.2));
    let before_the_wall = [(6..26, 13..18), (38..58, 13..18)];
    let mut light = |isolate, reflections| {
        parts(&mut stage, isolate, reflections, Vec3::new(0.0, -1.5, -0.7), before_the_wall.clone())
    };
    let [by_caches, left] = [false, true].map(|reflections| light(GiIsolate::Glossy, reflections));
    let [whole, with] = [false, true].map(|reflections| light(GiIsolate::All, reflections));
    for i in 0..2 {
        let (left, with) = (left[i] / by_caches[i], with[i] / whole[i]);
        println!("caches keep {left:.2} of their light; with reflections {with:.2} of that without");
        assert!(left < 0.5, "reflections meet the wall, and caches keep {left}");
        // Caches show the wall's foot blurred, and darker than it is; both at once would be twice as much and more.
        assert!((0.6..1.6).contains(&with), "{with} of the light");
    }
}

/// A closed room of walls that shine alike, with a floor of white metal that goes from polished to matt.
fn shining_room(mut build: Builder, mut images: ResMut<Assets<Image>>) {
    let emission = EMITTED * EXPOSURE.exposure();
    let wall = build.materials.add(StandardMaterial {
        base_color: Color::BLACK,
        reflectance: 0.0,
        emissive: LinearRgba::rgb(emission, emission, emission),
        ..default()
    });
    let [floor, ceiling, back, front, left, right] = std::array::from_fn(|_| wall.clone());
    build.room(Vec3::splat(-1.5), Vec3::splat(1.5), &Walls { floor, ceiling, back, front, left, right });
    // Green is roughness, blue is metal.
    let texels = (0..=u8::MAX).flat_map(|x| [0, (f32::from(x) * 0.7) as u8, u8::MAX, u8::MAX]).collect();
    let size = Extent3d { width: 256, height: 1, depth_or_array_layers: 1 };
    let usage = RenderAssetUsages::RENDER_WORLD;
    let ramp = images.add(Image::new(size, TextureDimension::D2, texels, TextureFormat::Rgba8Unorm, usage));
    let floor = build.materials.add(StandardMaterial {
        base_color: Color::WHITE,
        metallic_roughness_texture: Some(ramp),
        ..metal(1.0)
    });
    let black = VoxelizedMesh { albedo: Some(Color::BLACK), ..default() };
    build.place(Plane3d::default().mesh().size(3.0, 3.0), Transform::from_xyz(0.0, -1.4, 0.0), &floor).insert(black);
    build.commands.spawn((Camera3d::default(), Camera { is_active: false, ..default() }));
}

/// Of the walls of [`shining_room`], cd/m^2.
const EMITTED: f32 = 20.0;

/// Where light is the same from everywhere, a mirror shows it as matt metal does: there is no seam where Bevy's reflections begin and end
/// by roughness, nor where they leave the picture, and none of the light is shown twice or lost. Bevy's reflections draw from GGX itself,
/// while what bounces in the relief of metal stays by Bevy's approximation of it: together up to a tenth too much.
#[test]
fn reflections_have_no_seam() {
    const COLUMNS: usize = 8;
    let mut stage = Stage::new(SIZE, SMALL, |app| {
        app.add_systems(Startup, shining_room);
    });
    let columns: [(Range<usize>, Range<usize>); COLUMNS] = std::array::from_fn(|i| (8 * i..8 * i + 8, 13..19));
    let towards = Vec3::new(0.0, -1.5, -0.7);
    for (reflections, most) in [(false, 0.05), (true, 0.12)] {
        let light = parts(&mut stage, GiIsolate::All, reflections, towards, columns.clone());
        let light = light.map(|light| light / f64::from(EMITTED));
        println!("reflections {reflections}: {light:.3?} of the light");
        assert!(light.iter().all(|light| (light - 1.0).abs() < most), "reflections {reflections}: {light:?}");
    }
    let [whole, left] = [false, true]
        .map(|reflections| parts(&mut stage, GiIsolate::Glossy, reflections, towards, [(24..40, 13..19)])[0]);
    assert!(left < 0.5 * whole, "reflections meet nothing: caches keep {left} of {whole}");
}

/// Under a sky that bounces, what reflections show of a black wall is black: no sky is mirrored there beside it.
#[test]
fn reflections_hide_the_sky() {
    let mut stage = Stage::new(SIZE, SMALL, |app| {
        app.add_systems(Startup, |mut build: Builder| {
            let (metal, black) = (build.materials.add(metal(0.2)), build.paint([0.0; 3]));
            build.place(Cuboid::new(6.0, 0.2, 6.0), Transform::from_xyz(0.0, -0.1, 0.0), &metal);
            build.place(Cuboid::new(6.0, 3.0, 0.2), Transform::from_xyz(0.0, 1.5, -1.6), &black);
            build.commands.spawn((Camera3d::default(), Camera { is_active: false, ..default() }));
        });
    });
    let radiance_cache = RadianceCacheSettings { glossy: true, ..default() };
    let mut floor = |glossy: bool, isolate: GiIsolate, reflections: bool| {
        let settings = if glossy { GiSettings { radiance_cache, ..SMALL } } else { SMALL };
        // The foot of the wall is in the picture's upper half, and its middle below the upper edge.
        let place = Transform::from_xyz(0.0, 1.5, 1.4).looking_at(Vec3::new(0.0, 0.0, -0.7), Vec3::Y);
        let sky = {
            let mut images = stage.world().resource_mut::<Assets<Image>>();
            EnvironmentMapLight { intensity: 1000.0, ..EnvironmentMapLight::solid_color(&mut images, Color::WHITE) }
        };
        let eye = Eye::open(&mut stage, SIZE, EXPOSURE, (place, illumination(settings), sky, isolate));
        if reflections {
            stage.world().entity_mut(eye.camera).insert(ScreenSpaceReflections::default());
        }
        (0..FRAMES).for_each(|_| stage.frame(std::time::Duration::ZERO));
        let mean = eye.picture(&stage).mean_of(20..44, 13..18)[1];
        eye.close(&mut stage);
        mean
    };
    // Beside caches without bounced light: what bounces in the relief of metal is not mirrored, and stays.
    for (glossy, isolate) in [(false, GiIsolate::All), (true, GiIsolate::Direct)] {
        let (without, with) = (floor(glossy, isolate, false), floor(glossy, isolate, true));
        println!("glossy {glossy}, {isolate:?}: {with:.2} with reflections, {without:.2} without");
        assert!(with < 0.3 * without && without > 0.0, "glossy {glossy}, {isolate:?}: {with} of {without}");
    }
}

/// Under a sky that bounces, what metal mirrors of it is there once beside Bevy's reflections, whatever the technique.
#[test]
fn the_sky_is_mirrored_once_beside_reflections() {
    let mut stage = Stage::new(SIZE, SMALL, |app| {
        app.add_systems(Startup, |mut build: Builder| {
            let metal = build.materials.add(metal(0.3));
            build.place(Sphere::new(0.7), Transform::IDENTITY, &metal);
            let white = build.paint([0.7; 3]);
            build.place(Cuboid::new(4.0, 0.2, 4.0), Transform::from_xyz(0.0, -1.5, 0.0), &white);
            build.commands.spawn((Camera3d::default(), Camera { is_active: false, ..default() }));
        });
    });
    for technique in [Technique::InstantRadiosity, Technique::RadianceCache] {
        let mut light = |reflections: bool| {
            let place = Transform::from_xyz(0.0, 0.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y);
            let sky = {
                let mut images = stage.world().resource_mut::<Assets<Image>>();
                EnvironmentMapLight { intensity: 1000.0, ..EnvironmentMapLight::solid_color(&mut images, Color::WHITE) }
            };
            let light = GlobalIllumination { technique, ..illumination(SMALL) };
            let eye = Eye::open(&mut stage, SIZE, EXPOSURE, (place, light, sky, GiIsolate::All));
            if reflections {
                stage.world().entity_mut(eye.camera).insert(ScreenSpaceReflections::default());
            }
            (0..FRAMES).for_each(|_| stage.frame(std::time::Duration::ZERO));
            let mean = eye.picture(&stage).mean_of(28..36, 14..22)[1];
            eye.close(&mut stage);
            mean
        };
        let (without, with) = (light(false), light(true));
        println!("{technique:?}: {with:.1} with reflections, {without:.1} without");
        assert!(without > 0.0 && (with / without - 1.0).abs() < 0.05, "{technique:?}: {with}, {without}");
    }
}

/// The effects are there: each changes the picture, and what stands for bounced light is left out where that is computed.
#[test]
fn effects_are_there() {
    let mut stage = stage();
    let [lit, plain] = [Some(GiIsolate::All), None].map(|isolate| picture(&mut stage, &[], isolate));
    for effect in offered(&stage) {
        let with = picture(&mut stage, &[effect], Some(GiIsolate::All));
        let without = picture(&mut stage, &[effect], None);
        // Bevy's occlusion is for ambient light alone.
        assert!(without != plain || effect == Occlusion, "{effect:?} does nothing to Bevy's picture");
        match effect {
            IrradianceVolume => assert!(with == lit, "an irradiance volume counts beside bounced light"),
            _ => assert!(with != lit, "{effect:?} does nothing beside bounced light"),
        }
    }
}
