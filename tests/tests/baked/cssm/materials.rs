//! Materials of what baked texels light.

use bevy::asset::RenderAssetUsages;
use bevy::image::Image;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_bounce::{CssmSettings, GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_tests::baked::small_cornell_box;
use bevy_bounce_tests::metrics::Metrics;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, run};

/// A texture that has that normal everywhere.
fn normal_map(normal: Vec3) -> Image {
    let [x, y, z] = (normal * 127.5 + 127.5).round().to_array().map(|value| value as u8);
    let (size, usage) = (Extent3d::default(), RenderAssetUsages::default());
    Image::new(size, TextureDimension::D2, vec![x, y, z, 255], TextureFormat::Rgba8Unorm, usage)
}

/// The light in the box with a board in it that has that normal at its corners and, of these, that of a map.
fn with_board(corners: Vec3, mapped: Vec3) -> Picture {
    let settings = GiSettings { bounces: 2, cssm: CssmSettings { error: 4.0, ..CssmSettings::DEFAULT }, ..SMALL };
    let quality = Quality::Custom(settings);
    let illumination = GlobalIllumination { technique: Technique::SurfaceRadiosity, quality, ..default() };
    let run = run(UVec2::new(64, 36), Some(illumination));
    let mut stage = Stage::of_asset("cornell_box.glb", run, true, Some(small_cornell_box().clone()));
    let world = stage.world();
    let board = Rectangle::from_length(2.0).mesh().build();
    let board = board.with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vec![corners.to_array(); 4]);
    let board = board.with_generated_tangents().unwrap_or_else(|error| panic!("{error}"));
    let mesh = world.resource_mut::<Assets<Mesh>>().add(board);
    let map = world.resource_mut::<Assets<Image>>().add(normal_map(mapped));
    let paint = StandardMaterial {
        base_color: Color::WHITE,
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        normal_map_texture: Some(map),
        ..default()
    };
    let paint = world.resource_mut::<Assets<StandardMaterial>>().add(paint);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(paint), Transform::from_xyz(0.0, 2.0, 0.5)));
    stage.settled_picture()
}

/// A board that a map tilts has the light of one whose own normals are tilted as much.
#[test]
fn normal_maps_tilt_the_light() {
    let tilt = Vec3::new(1.0, 0.0, 1.0).normalize();
    let (flat, tilted) = (with_board(Vec3::Z, Vec3::Z), with_board(tilt, Vec3::Z));
    let mapped = with_board(Vec3::Z, tilt);
    let [apart, left] = [&flat, &mapped].map(|picture| Metrics::new(picture, &tilted).expect("sizes are equal").nrmse);
    println!("flat {apart:.4}, mapped {left:.4} from tilted");
    assert!(apart > 0.02 && left < 0.1 * apart, "flat {apart}, mapped {left} from tilted");
}
