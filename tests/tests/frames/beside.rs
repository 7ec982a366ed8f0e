//! Bounced light beside what else Bevy does to a picture: each of it, and each pair.
//!
//! Light is counted once: the mean of the whole picture is that of direct and of bounced light together. Three of Bevy's effects do
//! not keep to sums, and are held to what they do: fog takes some of the bounced light, of which volumetric fog scatters some, and
//! screen-space reflections show it once more.

mod reflections;

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
use bevy_bounce::{GiIsolate, GiSettings};
use bevy_bounce_examples::scenes::Builder;
use bevy_bounce_tests::eye::Eye;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination};
use half::f16;

const SIZE: UVec2 = UVec2::new(64, 36);
const EXPOSURE: Exposure = Exposure { ev100: 6.0 };
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
    eye.settle(stage);
    let frames = if effects.contains(&TemporalAntiAliasing) { FRAMES_OF_TAA } else { 0 };
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

/// Beside each effect; and what two do to bounced light is what one does after the other; without fog and reflections that is nothing. Of
/// pairs that are so far from each other in the list of effects, which ends where it begins.
fn assert_light_is_counted_once(distances: std::ops::Range<usize>) {
    let mut stage = stage();
    let plain = means(&mut stage, &[]);
    println!("alone: all, direct and bounced {plain:.3?}");
    let effects = offered(&stage);
    let shares: Vec<f64> = effects.iter().map(|effect| share_of_bounced_light(&mut stage, &[*effect])).collect();
    let alone: Vec<(Effect, f64)> = effects.into_iter().zip(shares).collect();
    let binds_arrays = stage.render_world().resource::<MeshPipeline>().binding_arrays_are_usable;
    let count = alone.len();
    for (at, (first, share)) in alone.iter().enumerate() {
        for (second, other) in distances.clone().map(|distance| &alone[(at + distance) % count]) {
            // Bevy's shader of both does not compile then.
            if !binds_arrays && [Lightmaps, EnvironmentMap].iter().all(|effect| [first, second].contains(&effect)) {
                continue;
            }
            let [all, direct, bounced] = means(&mut stage, &[*first, *second]);
            let sum = all / (direct + bounced * share * other);
            println!("{first:?}, {second:?}: {sum:.4} of the sum of the parts");
            assert!((sum - 1.0).abs() < 0.03, "{first:?}, {second:?}: {all} of {direct} and {bounced}");
        }
    }
    assert_eq!(plain, means(&mut stage, &[]), "an effect left something behind");
}

#[test]
fn light_is_counted_once_beside_effects() {
    assert_light_is_counted_once(1..2);
}

/// Each pair; those of opposite effects twice.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn light_is_counted_once_beside_each_pair_of_effects() {
    assert_light_is_counted_once(1..EFFECTS.len() / 2 + 1);
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
