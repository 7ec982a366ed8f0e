//! What has holes lets through the light that they let through: in shadow maps, by rays through the grid, and in whole pictures.

use bevy::camera::Exposure;
use bevy::image::Image;
use bevy::math::{Affine3A, Vec2, Vec3};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_bounce::{GiIsolate, GiSettings, VplVisibility};
use bevy_bounce_examples::scenes::Builder;
use bevy_bounce_shaders::types::{AtlasParameters, INSTANCE_TWO_SIDED, Occluder, TILE_EMPTY, Vpl, VplHeader};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::gpu;
use bevy_bounce_tests::scene::{TestScene, run, voxelize};
use bevy_bounce_tests::stage::{SMALL, Stage, illumination};
use bevy_bounce_tests::twins::random::Random;

use crate::shadow_atlas::{from_tile, tile_frame};

const TILE: u32 = 32;
const LIGHTS: u32 = 128;
const FAR: f32 = 8.0;
/// Half the width of a card, and how far it is over the floor.
const HALF: f32 = 2.0;
const HEIGHT: f32 = 1.0;

/// A card over the origin, whose UVs are from 0 to 1, of which as much is there as asked at each texel of its thumbnail.
fn card(share: impl Fn(u32, u32) -> f32) -> TestScene {
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    let [a, b, c, d] = [corner(0.0, 0.0), corner(0.0, 1.0), corner(1.0, 1.0), corner(1.0, 0.0)];
    let place = Affine3A::from_scale_rotation_translation(
        Vec3::splat(2.0 * HALF),
        Quat::IDENTITY,
        Vec3::new(-HALF, HEIGHT, -HALF),
    );
    let mut scene = TestScene::new(Vec3::ONE);
    let material = scene.masked(share);
    scene.mesh(&[[a, b, c], [a, c, d]], material, INSTANCE_TWO_SIDED, place);
    scene
}

/// Lights on the floor below, that shine upwards, each of another path.
fn lights() -> Vec<Vpl> {
    let mut random = Random::new(17);
    let mut place = |path| {
        let position = Vec3::new(random.unit() - 0.5, 0.0, random.unit() - 0.5);
        Vpl { position, normal: Vec3::Y, sample: path, bounce_met: 1, ..Vpl::default() }
    };
    (0..LIGHTS).map(&mut place).collect()
}

/// The maps of lights, a tile each.
fn maps(scene: &TestScene, lights: &[Vpl]) -> Vec<u32> {
    let (chunks, occluder_count) = scene.occluder_chunks();
    let parameters = AtlasParameters { tile: TILE, occluder_count, far: FAR, ..AtlasParameters::default() };
    let resources = scene
        .resources(gpu())
        .uniform("parameters", &parameters)
        .uniform("grid", &scene.grid(0.1))
        .structs("occluder_chunks", &chunks)
        .structs("occluders", &vec![Occluder::default(); occluder_count as usize])
        .structs("header", &[VplHeader { count: lights.len() as u32, ..VplHeader::default() }])
        .structs("vpls", lights)
        .zeroed("atlas", lights.len() * (TILE * TILE) as usize);
    run(gpu(), "shadow_atlas/occluders.wgsl", "place_occluders", &resources, [chunks.len() as u32, 1, 1]);
    run(gpu(), "shadow_atlas/rasterize.wgsl", "rasterize", &resources, [lights.len() as u32, 1, 1]);
    resources.read_words("atlas").expect("reads back")
}

/// Where on the card a texel of a light looks, in [0, 1]^2.
fn look(light: &Vpl, texel: u32) -> Option<Vec2> {
    let [x, y, z] = tile_frame(light.normal);
    let d = from_tile((Vec2::new((texel % TILE) as f32, (texel / TILE) as f32) + 0.5) / TILE as f32);
    let direction = x * d.x + y * d.y + z * d.z;
    let place = light.position + direction * (HEIGHT / direction.y);
    let uv = (Vec2::new(place.x, place.z) + HALF) / (2.0 * HALF);
    (direction.y > 0.0 && uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all()).then_some(uv)
}

/// Texels that look at the card where `counts` says, and those of them that it hides; by light.
fn hidden(lights: &[Vpl], words: &[u32], counts: impl Fn(Vec2) -> bool) -> Vec<(u32, u32)> {
    let of = |(light, tile): (&Vpl, &[u32])| {
        let mut found = (0, 0);
        for (texel, word) in (0..).zip(tile) {
            if look(light, texel).is_some_and(&counts) {
                found.0 += 1;
                found.1 += u32::from(*word != TILE_EMPTY);
            }
        }
        found
    };
    lights.iter().zip(words.chunks((TILE * TILE) as usize)).map(of).collect()
}

fn share(found: &[(u32, u32)]) -> (f64, f64) {
    let (all, hidden) = found.iter().fold((0, 0), |sum, light| (sum.0 + light.0, sum.1 + light.1));
    (f64::from(hidden) / f64::from(all), f64::from(all))
}

#[test]
fn maps_let_through_what_fine_holes_do() {
    let lights = lights();
    for there in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let words = maps(&card(|_, _| there), &lights);
        assert!(words == maps(&card(|_, _| there), &lights), "{there}: maps differ from run to run");
        let found = hidden(&lights, &words, |_| true);
        let (all, texels) = share(&found);
        let there = f64::from(there);
        println!("{there}: {all:.4} of {texels} texels are hidden");
        let spread = |texels: f64| (there * (1.0 - there) / texels).sqrt();
        assert!((all - there).abs() <= 4.0 * spread(texels), "{all} of {texels} texels are hidden, {there} is there");
        // Lights see other holes.
        for (light, &(texels, hidden)) in found.iter().enumerate() {
            let (texels, hidden) = (f64::from(texels), f64::from(hidden));
            let off = (hidden / texels - there).abs();
            assert!(off <= 5.0 * spread(texels), "light {light} sees {hidden} of {texels} texels hidden");
        }
        let tiles: Vec<&[u32]> = words.chunks((TILE * TILE) as usize).collect();
        let middle = (TILE / 2 * TILE + TILE / 2) as usize;
        let seen = tiles.iter().filter(|tile| tile[middle] != TILE_EMPTY).count() as f64 / f64::from(LIGHTS);
        assert!(
            (seen - there).abs() <= 5.0 * spread(f64::from(LIGHTS)),
            "{seen} of the lights are hidden straight above"
        );
    }
}

#[test]
fn maps_have_large_holes_where_they_are() {
    const EDGE: f32 = 0.08;
    let lights = lights();
    for there in [0.25, 0.5, 0.75] {
        let words = maps(&card(|x, _| f32::from((x as f32 + 0.5) / 16.0 < there)), &lights);
        let (solid, _) = share(&hidden(&lights, &words, |uv| uv.x < there - EDGE));
        let (open, _) = share(&hidden(&lights, &words, |uv| uv.x > there + EDGE));
        println!("{there}: {solid:.4} of the texels are hidden where the card is, {open:.4} where it is not");
        assert!(solid > 0.999 && open < 0.001, "{solid} of the texels are hidden where the card is, {open} where not");
        // All of it: as many as look at what is there, but for texels on the border.
        let (all, _) = share(&hidden(&lights, &words, |_| true));
        let looks: Vec<(u32, u32)> = lights
            .iter()
            .map(|light| {
                let at: Vec<Vec2> = (0..TILE * TILE).filter_map(|texel| look(light, texel)).collect();
                (at.len() as u32, at.iter().filter(|uv| uv.x < there).count() as u32)
            })
            .collect();
        let (expected, _) = share(&looks);
        assert!((all - expected).abs() < 0.01, "{all} of the texels are hidden, {expected} look at what is there");
    }
}

/// Rays through the grid, from below and above.
#[test]
fn rays_pass_as_many_holes_as_there_are() {
    const RAYS: usize = 20_000;
    const LOOK: &str = "
        #import bevy_bounce::shared::rays::{Ray, is_blocked, to_grid, grid}
        @group(0) @binding(0) var<storage, read> ends: array<vec4<f32>>;
        @group(0) @binding(1) var<storage, read_write> blocked: array<u32>;
        @compute @workgroup_size(64)
        fn look(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x >= arrayLength(&blocked) {
                return;
            }
            var ray: Ray;
            let way = ends[2u * id.x + 1u].xyz - ends[2u * id.x].xyz;
            ray.origin = to_grid(ends[2u * id.x].xyz);
            ray.direction = normalize(way);
            ray.length = length(way) / grid.voxel_size;
            blocked[id.x] = u32(is_blocked(ray));
        }";
    let mut random = Random::new(23);
    let mut end = |height: f32| Vec3::new(random.unit() - 0.5, height, random.unit() - 0.5) * 3.0;
    let ends: Vec<f32> = (0..2 * RAYS).flat_map(|i| end([0.0, 0.6][i % 2]).extend(0.0).to_array()).collect();
    for there in [0.0, 0.25, 0.5, 0.75, 1.0] {
        // Voxels of about half a texel of the thumbnail, and of many.
        for voxel in [0.13, 0.9] {
            let scene = card(|_, _| there);
            let resources =
                voxelize(gpu(), &scene, &scene.grid(voxel), None).floats("ends", &ends).zeroed("blocked", RAYS);
            let kernel = gpu().kernel(&compose_source(LOOK, "look.wgsl", &[]).expect("composes"), "look");
            let kernel = kernel.expect("the device takes it");
            gpu().dispatch(&kernel, &resources, [RAYS.div_ceil(64) as u32, 1, 1]).expect("runs");
            let blocked = resources.read_words("blocked").expect("reads back");
            let found = blocked.iter().filter(|word| **word != 0).count() as f32 / RAYS as f32;
            println!("{there}: {found:.4} of the rays are stopped, with voxels of {voxel}");
            assert!((found - there).abs() < 0.03, "{found} of the rays are stopped, {there} is there");
        }
    }
}

const ROOM: Vec3 = Vec3::new(2.0, 2.5, 1.5);

#[derive(Component)]
struct Wall;

/// What divides the room.
#[derive(Clone, Copy, Debug)]
enum Divided {
    Not,
    Opaque,
    /// Half of it is holes, by a mask much finer than a voxel.
    Masked,
    /// Half of it is holes, square ones.
    Holes,
}

/// Whether a square of a checker is there.
fn is_there(x: u32, y: u32) -> bool {
    (x + y).is_multiple_of(2)
}

/// A wall across the room, seen from both sides, of that albedo.
fn divide(world: &mut World, divided: Divided, albedo: f32) {
    let mut walls = world.query_filtered::<Entity, With<Wall>>();
    let walls: Vec<Entity> = walls.iter(world).collect();
    walls.into_iter().for_each(|wall| _ = world.despawn(wall));
    let paint = paint(world, matches!(divided, Divided::Masked), albedo);
    let full = Vec2::new(2.0 * ROOM.z, ROOM.y);
    let squares = UVec2::new(12, 10);
    let pieces: Vec<(Vec2, Vec2)> = match divided {
        Divided::Not => vec![],
        Divided::Opaque | Divided::Masked => vec![(Vec2::ZERO, full)],
        Divided::Holes => {
            let size = full / squares.as_vec2();
            let all = (0..squares.x * squares.y).map(|i| UVec2::new(i % squares.x, i / squares.x));
            all.filter(|at| is_there(at.x, at.y)).map(|at| ((at.as_vec2() + 0.5) * size - 0.5 * full, size)).collect()
        }
    };
    for (middle, size) in pieces {
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::from_size(size));
        let place = Transform::from_xyz(0.0, 0.5 * ROOM.y + middle.y, middle.x).looking_to(Vec3::X, Vec3::Y);
        world.spawn((Wall, Mesh3d(mesh), MeshMaterial3d(paint.clone()), place));
    }
}

/// Of both sides, with a mask that is a fine checker or without one.
fn paint(world: &mut World, masked: bool, albedo: f32) -> Handle<StandardMaterial> {
    let texels = (0..64 * 64).flat_map(|i| [255, 255, 255, if is_there(i % 64, i / 64) { 255 } else { 0 }]);
    let size = Extent3d { width: 64, height: 64, depth_or_array_layers: 1 };
    let image = Image::new(
        size,
        TextureDimension::D2,
        texels.collect(),
        TextureFormat::Rgba8UnormSrgb,
        bevy::asset::RenderAssetUsages::default(),
    );
    let mask = world.resource_mut::<Assets<Image>>().add(image);
    let paint = StandardMaterial {
        base_color: Color::linear_rgb(albedo, albedo, albedo),
        base_color_texture: masked.then_some(mask),
        alpha_mode: if masked { AlphaMode::Mask(0.5) } else { AlphaMode::Opaque },
        double_sided: true,
        cull_mode: None,
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        ..default()
    };
    world.resource_mut::<Assets<StandardMaterial>>().add(paint)
}

/// Half of the room along x, open towards the other one.
fn half(build: &mut Builder, from: f32, to: f32, albedo: f32) {
    let paint = build.materials.add(StandardMaterial {
        base_color: Color::linear_rgb(albedo, albedo, albedo),
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        ..default()
    });
    let (low, high) = (Vec3::new(from, 0.0, -ROOM.z), Vec3::new(to, ROOM.y, ROOM.z));
    let (x, y, z) = (Vec3::X * (to - from), Vec3::Y * ROOM.y, Vec3::Z * 2.0 * ROOM.z);
    build.panel(low, z, x, &paint);
    build.panel(low + y, x, z, &paint);
    build.panel(low, x, y, &paint);
    build.panel(high - y, -x, y, &paint);
    if from < 0.0 {
        build.panel(low + z, -z, y, &paint);
    } else {
        build.panel(low + x, z, y, &paint);
    }
}

/// Two halves of a room, one with a lamp, and a camera that looks at the end of the other.
fn rooms(near: f32, far: f32) -> Stage {
    let settings = settings(VplVisibility::Atlas);
    Stage::new(UVec2::new(48, 32), settings, |app| {
        app.add_systems(Startup, move |mut build: Builder| {
            half(&mut build, -ROOM.x, 0.0, near);
            half(&mut build, 0.0, ROOM.x, far);
            build.commands.spawn((
                PointLight { intensity: 500_000.0, range: 100.0, ..default() },
                Transform::from_xyz(-0.8, 1.9, 0.3),
            ));
            let place = Transform::from_xyz(0.1, 1.3, 0.0).looking_to(Vec3::X, Vec3::Y);
            build.commands.spawn((Camera3d::default(), Exposure { ev100: 6.0 }, GiIsolate::Irradiance, place));
        });
    })
}

fn settings(visibility: VplVisibility) -> GiSettings {
    GiSettings { grid: 64, vpls: 1024, visibility, ..SMALL }
}

/// Bounced light on the walls of the half without a lamp, behind each wall.
fn light_behind(stage: &mut Stage, visibility: VplVisibility, albedo: f32) -> [f64; 4] {
    stage.light_by(illumination(settings(visibility)));
    [Divided::Not, Divided::Opaque, Divided::Masked, Divided::Holes].map(|divided| {
        divide(stage.world(), divided, albedo);
        let camera = stage.only::<Camera3d>();
        stage.world().entity_mut(camera).insert(GiIsolate::Irradiance);
        let mean = stage.settled_picture().mean_luminance();
        println!("{visibility:?}, walls of {albedo}, {divided:?}: {mean:.4}");
        mean
    })
}

/// Where all but the half with the lamp is black, light that goes through the wall does not come back: behind a wall of which half is
/// there, there is half of the light.
#[test]
fn a_curtain_of_which_half_is_there_halves_the_light() {
    let mut stage = rooms(0.7, 0.0);
    for visibility in [VplVisibility::Atlas, VplVisibility::Voxel] {
        let [open, shut, masked, holes] = light_behind(&mut stage, visibility, 0.0);
        let share = |light: f64| (light - shut) / (open - shut);
        println!("{visibility:?}: {:.3} by the mask, {:.3} by holes", share(masked), share(holes));
        assert!(open > 0.0 && shut < 0.02 * open, "{visibility:?}: {shut} of {open} passes an opaque wall");
        assert!((share(masked) - 0.5).abs() < 0.05, "{visibility:?}: {} of the light passes a mask", share(masked));
    }
}

/// With light that goes to and fro: a mask lets pass what a wall with real holes does.
#[test]
fn a_mask_is_like_real_holes() {
    let mut stage = rooms(0.7, 0.7);
    let [open, shut, masked, holes] = light_behind(&mut stage, VplVisibility::Atlas, 0.7);
    let share = |light: f64| (light - shut) / (open - shut);
    println!("{:.3} of the light by the mask, {:.3} by holes", share(masked), share(holes));
    assert!(
        shut < 0.01 * open && (masked / holes - 1.0).abs() < 0.1,
        "{masked} behind a mask, {holes} behind real holes"
    );
}
