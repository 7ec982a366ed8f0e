//! The picture of a camera with bounced light, against Bevy's own.

use std::time::Duration;

use bevy::app::{PluginsState, TerminalCtrlCHandlerPlugin};
use bevy::asset::RenderAssetUsages;
use bevy::camera::{Exposure, Hdr, RenderTarget, Viewport};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::light::AmbientLight;
use bevy::log::LogPlugin;
use bevy::pbr::{DefaultOpaqueRendererMethod, DistanceFog, FogFalloff, ScreenSpaceAmbientOcclusion};
use bevy::prelude::*;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    BufferDescriptor, BufferUsages, CachedPipelineState, CommandEncoderDescriptor, Extent3d, MapMode, PipelineCache,
    PollType, TexelCopyBufferInfo, TexelCopyBufferLayout, TextureDimension, TextureFormat, TextureUsages,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::settings::{Backends, WgpuFeatures, WgpuLimits, WgpuSettings, WgpuSettingsPriority};
use bevy::render::texture::GpuImage;
use bevy::render::{RenderApp, RenderPlugin};
use bevy::time::TimeUpdateStrategy;
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_bounce::prelude::*;
use bevy_bounce::{GiComposePlugin, GiIsolate};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};
use half::f16;

const SIZE: UVec2 = UVec2::new(96, 64);

/// Which plugins an app has.
enum Plugins {
    /// Bevy's alone.
    Bevy,
    /// And ours.
    Bounce,
}

fn settings() -> WgpuSettings {
    let backends = Some(Backends::from_env().unwrap_or(Backends::PRIMARY));
    if std::env::var_os("BOUNCE_WEBGPU_LIMITS").is_none() {
        return WgpuSettings { backends, ..default() };
    }
    WgpuSettings {
        backends,
        priority: WgpuSettingsPriority::WebGPU,
        features: WgpuFeatures::empty(),
        limits: WgpuLimits::default(),
        constrained_limits: Some(WgpuLimits::default()),
        ..default()
    }
}

fn app(plugins: Plugins, settings: WgpuSettings) -> App {
    let mut app = App::new();
    app.add_plugins(
        DefaultPlugins
            .set(RenderPlugin { render_creation: settings.into(), synchronous_pipeline_compilation: true, ..default() })
            .set(bevy::window::WindowPlugin {
                primary_window: None,
                exit_condition: ExitCondition::DontExit,
                ..default()
            })
            .disable::<LogPlugin>()
            .disable::<WinitPlugin>()
            .disable::<PipelinedRenderingPlugin>()
            .disable::<TerminalCtrlCHandlerPlugin>(),
    )
    .insert_resource(ClearColor(Color::srgb(0.1, 0.2, 0.4)))
    .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    match plugins {
        Plugins::Bevy => app.insert_resource(DefaultOpaqueRendererMethod::deferred()),
        Plugins::Bounce => app.add_plugins(GiComposePlugin),
    };
    while app.plugins_state() == PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
    app.world_mut().run_system_cached(scene).expect("the scene is there");
    app
}

/// Every kind of light and surface that the deferred path knows.
fn scene(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>, mut materials: ResMut<Assets<StandardMaterial>>) {
    let mut put = |mesh: Mesh, material: StandardMaterial, transform: Transform| {
        commands.spawn((Mesh3d(meshes.add(mesh)), MeshMaterial3d(materials.add(material)), transform));
    };
    let matte = |color: Color| StandardMaterial { base_color: color, perceptual_roughness: 1.0, ..default() };
    put(Cuboid::new(6.0, 0.2, 6.0).into(), matte(Color::srgb(0.7, 0.7, 0.7)), Transform::from_xyz(0.0, -0.1, 0.0));
    put(Cuboid::new(0.2, 4.0, 6.0).into(), matte(Color::srgb(0.7, 0.1, 0.1)), Transform::from_xyz(-2.5, 2.0, 0.0));
    let ball = || Mesh::from(Sphere::new(0.5));
    let shiny = StandardMaterial { metallic: 1.0, perceptual_roughness: 0.3, ..matte(Color::srgb(0.9, 0.7, 0.3)) };
    put(ball(), shiny, Transform::from_xyz(-1.2, 0.5, 0.0));
    let coated = StandardMaterial {
        clearcoat: 0.8,
        clearcoat_perceptual_roughness: 0.2,
        perceptual_roughness: 0.6,
        ..matte(Color::srgb(0.1, 0.3, 0.8))
    };
    put(ball(), coated, Transform::from_xyz(0.0, 0.5, 0.5));
    let lamp = StandardMaterial { emissive: LinearRgba::rgb(0.4, 0.3, 0.1), ..matte(Color::WHITE) };
    put(ball(), lamp, Transform::from_xyz(1.2, 0.5, 0.0));
    let unlit = StandardMaterial { unlit: true, ..matte(Color::srgb(0.2, 0.9, 0.4)) };
    put(Cuboid::from_length(0.5).into(), unlit, Transform::from_xyz(0.6, 0.25, 1.6));
    let forward = StandardMaterial {
        opaque_render_method: bevy::material::OpaqueRendererMethod::Forward,
        ..matte(Color::srgb(0.9, 0.9, 0.2))
    };
    put(Cuboid::from_length(0.4).into(), forward, Transform::from_xyz(-0.6, 0.2, 1.6));
    let glass = StandardMaterial { alpha_mode: AlphaMode::Blend, ..matte(Color::srgba(0.3, 0.3, 0.9, 0.4)) };
    put(Cuboid::new(0.6, 0.6, 0.05).into(), glass, Transform::from_xyz(0.0, 0.6, 1.8));
    commands.spawn((
        PointLight { intensity: 60_000.0, shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(1.0, 3.0, 1.0),
    ));
    commands.spawn((
        SpotLight { intensity: 200_000.0, color: Color::srgb(1.0, 0.5, 0.5), shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(-1.0, 3.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        DirectionalLight { illuminance: 900.0, shadow_maps_enabled: true, ..default() },
        Transform::default().looking_to(Vec3::new(-0.4, -1.0, -0.5), Vec3::Y),
    ));
    commands.spawn((RectLight { intensity: 30_000.0, ..default() }, Transform::from_xyz(2.0, 1.5, 2.0)));
}

/// A picture, linear and pre-exposed, four channels a pixel.
struct Picture(Vec<[f32; 4]>);

impl Picture {
    /// Largest difference of a channel, as a share of its value.
    fn difference(&self, other: &Self) -> f32 {
        let pairs = self.0.iter().flatten().zip(other.0.iter().flatten());
        pairs.map(|(a, b)| (a - b).abs() / a.max(*b).max(0.01)).fold(0.0, f32::max)
    }

    fn mean(&self, channel: usize) -> f32 {
        self.0.iter().map(|pixel| pixel[channel]).sum::<f32>() / self.0.len() as f32
    }

    fn is_finite(&self) -> bool {
        self.0.iter().flatten().all(|value| value.is_finite())
    }
}

/// The camera of every test, but for what it tests.
fn spawn_camera(app: &mut App, extra: impl Bundle) -> (Entity, Handle<Image>) {
    let size = Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: 1 };
    let format = TextureFormat::Rgba16Float;
    let mut image = Image::new_uninit(size, TextureDimension::D2, format, RenderAssetUsages::RENDER_WORLD);
    image.texture_descriptor.usage |=
        TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC;
    let image = app.world_mut().resource_mut::<Assets<Image>>().add(image);
    let camera = app
        .world_mut()
        .spawn((
            Camera3d::default(),
            RenderTarget::Image(image.clone().into()),
            Exposure { ev100: 8.0 },
            Tonemapping::None,
            DebandDither::Disabled,
            Transform::from_xyz(0.0, 2.0, 5.0).looking_at(Vec3::new(0.0, 0.7, 0.0), Vec3::Y),
        ))
        .insert(extra)
        .id();
    (camera, image)
}

/// What a camera of Bevy alone has that ours gets by itself.
fn plain() -> impl Bundle {
    (
        Hdr,
        Msaa::Off,
        bevy::core_pipeline::prepass::DepthPrepass,
        bevy::core_pipeline::prepass::DeferredPrepass,
        AmbientLight { brightness: 0.0, ..default() },
    )
}

/// Renders until nothing is waited for, and some frames more.
fn settle(app: &mut App) {
    let mut calm = 0;
    for _ in 0..200 {
        app.update();
        app.world().resource::<RenderDevice>().poll(PollType::wait_indefinitely()).expect("the device goes on");
        assert!(app.should_exit().is_none(), "the renderer stopped");
        let cache = app.sub_app(RenderApp).world().resource::<PipelineCache>();
        calm = if cache.waiting_pipelines().next().is_none() { calm + 1 } else { 0 };
        for pipeline in cache.pipelines().filter(|_| calm > 0) {
            if let CachedPipelineState::Err(error) = &pipeline.state {
                panic!("{error}");
            }
        }
        if calm == 5 {
            return;
        }
    }
    panic!("pipelines are still waited for");
}

fn read(app: &App, image: &Handle<Image>) -> Picture {
    let world = app.sub_app(RenderApp).world();
    let texture = &world.resource::<RenderAssets<GpuImage>>().get(image).expect("the target is on the GPU").texture;
    let (device, queue) = (world.resource::<RenderDevice>(), world.resource::<RenderQueue>());
    let row = (SIZE.x * 8).next_multiple_of(256);
    let buffer = device.create_buffer(&BufferDescriptor {
        label: None,
        size: u64::from(row * SIZE.y),
        usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    let layout = TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        TexelCopyBufferInfo { buffer: &buffer, layout },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    buffer.slice(..).map_async(MapMode::Read, |_| ());
    device.poll(PollType::wait_indefinitely()).expect("the device goes on");
    let bytes = buffer.slice(..).get_mapped_range();
    let texel = |bytes: &[u8]| std::array::from_fn(|i| f16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]).to_f32());
    let lines = bytes.chunks_exact(row as usize).map(|line| &line[..SIZE.x as usize * 8]);
    Picture(lines.flat_map(|line| line.chunks_exact(8).map(texel)).collect())
}

/// The picture of a camera that has `extra`, which is gone afterwards.
fn picture(app: &mut App, extra: impl Bundle) -> Picture {
    let (camera, image) = spawn_camera(app, extra);
    settle(app);
    let picture = read(app, &image);
    app.world_mut().despawn(camera);
    picture
}

/// Two units in the last place of a half float, relative: direct light is rounded on the way, and adapters may truncate.
const HALF_PRECISION: f32 = 2.0 / 1024.0;

fn fog() -> DistanceFog {
    DistanceFog {
        color: Color::srgb(0.3, 0.4, 0.5),
        directional_light_color: Color::WHITE,
        falloff: FogFalloff::Exponential { density: 0.1 },
        ..default()
    }
}

/// With nothing bounced, the picture is Bevy's own: all lights, shadows, emission, unlit, forward and blended surfaces, fog,
/// environment map, screen-space occlusion, part of the target.
#[test]
fn without_bounced_light_the_picture_is_bevys() {
    let mut bevy = app(Plugins::Bevy, settings());
    let mut bounce = app(Plugins::Bounce, settings());
    let gi = || (GlobalIllumination::default(), GiIsolate::Direct);
    let check = |name: &str, bevys: Picture, ours: Picture| {
        assert!(bevys.is_finite() && ours.is_finite(), "{name}");
        assert!(bevys.mean(0) > 0.03, "{name}: too dark to tell, {}", bevys.mean(0));
        let difference = bevys.difference(&ours);
        println!("{name}: {difference}, mean {} {}", bevys.mean(0), ours.mean(0));
        assert!(difference <= HALF_PRECISION, "{name}: {difference}");
    };
    check("lights", picture(&mut bevy, plain()), picture(&mut bounce, gi()));
    check("all", picture(&mut bevy, plain()), picture(&mut bounce, GlobalIllumination::default()));
    check("fog", picture(&mut bevy, (plain(), fog())), picture(&mut bounce, (gi(), fog())));
    let part = || Camera {
        viewport: Some(Viewport {
            physical_position: UVec2::new(17, 9),
            physical_size: UVec2::new(50, 40),
            ..default()
        }),
        ..default()
    };
    check("viewport", picture(&mut bevy, (plain(), part())), picture(&mut bounce, (gi(), part())));
    let environment = |app: &mut App| {
        let mut images = app.world_mut().resource_mut::<Assets<Image>>();
        EnvironmentMapLight {
            intensity: 300.0,
            ..EnvironmentMapLight::solid_color(&mut images, Color::srgb(0.5, 0.6, 0.9))
        }
    };
    let (theirs, ours) = (environment(&mut bevy), environment(&mut bounce));
    // Left to Bevy; otherwise it is the sky, and bounces.
    check("environment", picture(&mut bevy, (plain(), theirs)), picture(&mut bounce, (gi(), ours, GiLight::OFF)));
    let occlusion = ScreenSpaceAmbientOcclusion::default;
    let (theirs, ours) = (environment(&mut bevy), environment(&mut bounce));
    check(
        "occlusion",
        picture(&mut bevy, (plain(), theirs, occlusion())),
        picture(&mut bounce, (gi(), ours, GiLight::OFF, occlusion())),
    );
}

/// Hides a kind of lights, or shows it again.
fn show<L: Component>(app: &mut App, visibility: Visibility) {
    let mut lights = app.world_mut().query_filtered::<&mut Visibility, With<L>>();
    for mut light in lights.iter_mut(app.world_mut()) {
        *light = visibility;
    }
}

/// Kinds of lights go and come back while a camera is lit: its picture is Bevy's in the very frame, in which the pipelines of the kinds
/// that are left may not be there yet, and afterwards.
#[test]
fn kinds_of_lights_come_and_go() {
    let (mut bevy, mut bounce) = (app(Plugins::Bevy, settings()), app(Plugins::Bounce, settings()));
    let (_, theirs) = spawn_camera(&mut bevy, plain());
    let (_, ours) = spawn_camera(&mut bounce, (GlobalIllumination::default(), GiIsolate::Direct));
    let kinds: [(&str, fn(&mut App, Visibility)); 4] = [
        ("points", show::<PointLight>),
        ("spots", show::<SpotLight>),
        ("suns", show::<DirectionalLight>),
        ("rectangles", show::<RectLight>),
    ];
    settle(&mut bevy);
    settle(&mut bounce);
    let all = read(&bounce, &ours);
    for (kind, show) in kinds {
        for visibility in [Visibility::Hidden, Visibility::Inherited] {
            for app in [&mut bevy, &mut bounce] {
                show(app, visibility);
                app.update();
            }
            let at_once = (read(&bevy, &theirs), read(&bounce, &ours));
            settle(&mut bevy);
            settle(&mut bounce);
            let later = (read(&bevy, &theirs), read(&bounce, &ours));
            let differs = later.1.difference(&all);
            println!("{kind} {visibility:?}: {differs}");
            assert!(differs > 0.01 || visibility != Visibility::Hidden, "{kind}: {differs}");
            for (when, (bevys, own)) in [("at once", at_once), ("later", later)] {
                let difference = bevys.difference(&own);
                println!("{kind} {visibility:?} {when}: {difference}, mean {} {}", bevys.mean(0), own.mean(0));
                assert!(difference <= HALF_PRECISION, "{kind} {visibility:?} {when}: {difference}");
            }
        }
    }
}

/// A camera that no longer asks for bounced light shows what one shows that never did.
#[test]
fn a_camera_goes_back_to_bevys_picture() {
    let mut bounce = app(Plugins::Bounce, settings());
    let never = picture(&mut bounce, ());
    let (camera, image) = spawn_camera(&mut bounce, GlobalIllumination::default());
    settle(&mut bounce);
    let with = read(&bounce, &image);
    bounce.world_mut().entity_mut(camera).remove::<GlobalIllumination>();
    settle(&mut bounce);
    let after = read(&bounce, &image);
    // Ambient light is back: the camera that never asked has it, too.
    assert!(with.difference(&never) > 0.001, "{}", with.difference(&never));
    assert_eq!(after.difference(&never), 0.0);
}

/// Where nothing bounces, bounced light alone is black everywhere: no sky, fog, forward or blended surfaces.
#[test]
fn bounced_light_alone_shows_nothing_else() {
    let mut bounce = app(Plugins::Bounce, settings());
    let black = picture(&mut bounce, (GlobalIllumination::default(), GiIsolate::Indirect, fog()));
    assert_eq!([black.mean(0), black.mean(1), black.mean(2)], [0.0; 3]);
}

/// On a device that lacks something, the game runs on with Bevy's own picture.
#[test]
fn an_inadequate_device_shows_bevys_picture() {
    let limits = WgpuLimits { max_storage_textures_per_shader_stage: 3, ..default() };
    let settings = || WgpuSettings { constrained_limits: Some(limits.clone()), ..settings() };
    let (mut bevy, mut bounce) = (app(Plugins::Bevy, settings()), app(Plugins::Bounce, settings()));
    bevy.insert_resource(DefaultOpaqueRendererMethod::forward());
    let ours = picture(&mut bounce, GlobalIllumination::default());
    let theirs = picture(&mut bevy, ());
    assert_eq!(ours.difference(&theirs), 0.0);
}

/// Size changes, cameras that come and go, two cameras: nothing stops the renderer.
#[test]
fn cameras_change_size_and_number() {
    let mut bounce = app(Plugins::Bounce, settings());
    let (first, image) = spawn_camera(&mut bounce, GlobalIllumination::default());
    let (second, _) = spawn_camera(&mut bounce, Camera { order: 1, ..default() });
    settle(&mut bounce);
    for size in [UVec2::new(1, 1), UVec2::new(7, 64), SIZE] {
        let viewport = Viewport { physical_size: size, ..default() };
        if let Some(mut camera) = bounce.world_mut().get_mut::<Camera>(first) {
            camera.viewport = Some(viewport);
        }
        settle(&mut bounce);
        assert!(read(&bounce, &image).is_finite());
    }
    for active in [false, true] {
        if let Some(mut camera) = bounce.world_mut().get_mut::<Camera>(first) {
            camera.viewport = None;
            camera.is_active = active;
        }
        settle(&mut bounce);
    }
    bounce.world_mut().entity_mut(second).insert(GlobalIllumination::default());
    settle(&mut bounce);
    bounce.world_mut().despawn(first);
    settle(&mut bounce);
}

/// How wide a mirror's lobe is and what of its light is from reflection probes, in one half float and out of it.
#[test]
fn shares_of_mirrored_light_come_back() {
    const PACK: &str = "
        #import bevy_bounce::compose::mirrored::{pack_mirrored, unpack_mirrored}
        @group(0) @binding(0) var<storage, read> shares: array<vec2<f32>>;
        @group(0) @binding(1) var<storage, read_write> unpacked: array<vec2<f32>>;
        @compute @workgroup_size(64)
        fn pack(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x < arrayLength(&shares) {
                let half = unpack2x16float(pack2x16float(vec2<f32>(pack_mirrored(shares[id.x].x, shares[id.x].y), 0.0)));
                unpacked[id.x] = unpack_mirrored(half.x);
            }
        }";
    let steps = |count: u32| (0..=count).map(move |i| i as f32 / count as f32);
    let shares: Vec<[f32; 2]> = steps(100).flat_map(|width| steps(100).map(move |probes| [width, probes])).collect();
    let kernel = gpu().kernel(&compose_source(PACK, "pack.wgsl", &[]).expect("composes"), "pack");
    let resources = Resources::new(gpu()).floats("shares", shares.as_flattened()).zeroed("unpacked", 2 * shares.len());
    let groups = shares.len().div_ceil(64) as u32;
    gpu().dispatch(&kernel.expect("the device takes it"), &resources, [groups, 1, 1]).expect("runs");
    let unpacked = resources.read_floats("unpacked").expect("reads back");
    for (share, found) in shares.iter().zip(unpacked.as_chunks::<2>().0) {
        let [width, probes] = [0, 1].map(|i| (share[i] - found[i]).abs());
        assert!(width < 0.5 / 31.0 + 1e-4 && probes < 0.5 / 63.0 + 1e-4, "{share:?} came back as {found:?}");
        assert!(share.iter().zip(found).all(|(a, b)| *a > 0.0 && *a < 1.0 || a == b), "{share:?}: {found:?}");
    }
}
