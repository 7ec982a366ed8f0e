//! What surfaces are for bounced light that have colours at their vertices, textures that are transformed, meshes that are edited, or a
//! material of a game's own.

use bevy::asset::RenderAssetUsages;
use bevy::image::{ImageAddressMode, ImageSampler, ImageSamplerDescriptor};
use bevy::math::Affine2;
use bevy::mesh::VertexAttributeValues;
use bevy::pbr::{ExtendedMaterial, MaterialExtension};
use bevy::prelude::*;
use bevy::render::render_resource::{AsBindGroup, Extent3d, TextureDimension, TextureFormat};
use bevy_bounce::{GiMaterial, GiMaterialPlugin};
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage};

const SIZE: UVec2 = UVec2::new(48, 32);
const RED: LinearRgba = LinearRgba::rgb(0.8, 0.1, 0.1);

/// Drawn by Bevy's plain shader; for bounced light, that standard material.
#[derive(Asset, AsBindGroup, TypePath, Clone)]
struct Own {
    look: StandardMaterial,
}

impl Material for Own {}

impl GiMaterial for Own {
    fn stand_in(&self) -> StandardMaterial {
        self.look.clone()
    }
}

#[derive(Asset, AsBindGroup, TypePath, Clone, Default)]
struct Nothing {}

impl MaterialExtension for Nothing {}

type Extended = ExtendedMaterial<StandardMaterial, Nothing>;

#[derive(Component)]
struct Wall;

fn matte(color: LinearRgba) -> StandardMaterial {
    StandardMaterial { base_color: color.into(), perceptual_roughness: 1.0, reflectance: 0.0, ..default() }
}

fn cuboid() -> Mesh {
    Cuboid::new(0.4, 2.0, 4.0).into()
}

/// A white floor from above, a lamp, and out of sight a red wall.
fn stage(plugins: impl FnOnce(&mut App)) -> Stage {
    Stage::new(SIZE, SMALL, |app| {
        app.add_plugins((MaterialPlugin::<Own>::default(), MaterialPlugin::<Extended>::default()));
        plugins(app);
        app.add_systems(
            Startup,
            |mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>, mut paints: ResMut<Assets<StandardMaterial>>| {
                let floor = Plane3d::default().mesh().size(4.0, 4.0).build();
                commands.spawn((Mesh3d(meshes.add(floor)), MeshMaterial3d(paints.add(matte(LinearRgba::WHITE)))));
                let place = Transform::from_xyz(-1.6, 1.0, 0.0);
                commands.spawn((Wall, Mesh3d(meshes.add(cuboid())), MeshMaterial3d(paints.add(matte(RED))), place));
                let lamp = PointLight { intensity: 100_000.0, range: 50.0, ..default() };
                commands.spawn((lamp, Transform::from_xyz(-0.5, 1.2, 0.0)));
                let eye = Transform::from_xyz(0.5, 3.0, 0.0).looking_at(Vec3::new(0.5, 0.0, 0.0), Vec3::NEG_Z);
                commands.spawn((Camera3d::default(), eye));
            },
        );
    })
}

/// All of the picture: the floor, and nothing else.
fn light(picture: &Picture) -> [f64; 3] {
    picture.mean_of(0..picture.width, 0..picture.height)
}

/// No more than what the floor sends itself by rounding.
fn is_dark(light: f64, beside: f64) -> bool {
    light < 1e-4 * beside
}

fn paint<M: Material>(stage: &mut Stage, material: M) -> Handle<M> {
    let handle = stage.world().resource_mut::<Assets<M>>().add(material);
    let wall = stage.only::<Wall>();
    stage.world().entity_mut(wall).insert(MeshMaterial3d(handle.clone()));
    handle
}

fn strip(stage: &mut Stage) {
    let wall = stage.only::<Wall>();
    stage.world().entity_mut(wall).remove::<MeshMaterial3d<StandardMaterial>>();
}

#[test]
fn an_extended_material_reflects_as_its_base() {
    let mut stage = stage(|app| {
        app.add_plugins(GiMaterialPlugin::<Extended>::default());
    });
    let red = stage.picture();
    let [r, g, _] = light(&red);
    assert!(r > 4.0 * g && g > 0.0, "the wall's light is not red: {:?}", light(&red));
    strip(&mut stage);
    paint(&mut stage, Extended { base: matte(RED), extension: Nothing {} });
    assert!(stage.settled_picture() == red, "{:?} of {:?}", light(&stage.captured()), light(&red));
    let wall = stage.only::<Wall>();
    stage.world().entity_mut(wall).remove::<MeshMaterial3d<Extended>>();
    let left = light(&stage.picture())[0];
    assert!(is_dark(left, r), "what has no material reflects: {left} of {r}");
}

#[test]
fn a_material_of_a_games_own_reflects_as_its_stand_in() {
    let mut stage = stage(|app| {
        app.add_plugins(GiMaterialPlugin::<Own>::default());
    });
    let red = stage.picture();
    let wall = stage.only::<Wall>();
    paint(&mut stage, Own { look: matte(LinearRgba::GREEN) });
    let green = stage.picture();
    let [r, g, _] = light(&green);
    assert!(is_dark(r, g), "the wall's light is not green: {r}, {g}");
    stage.world().entity_mut(wall).remove::<MeshMaterial3d<Own>>();
    assert!(stage.picture() == red, "the paint beneath does not come back: {:?}", light(&stage.captured()));
    let own = paint(&mut stage, Own { look: matte(LinearRgba::GREEN) });
    stage.picture();
    strip(&mut stage);
    assert!(stage.settled_picture() == green, "{:?} of {:?}", light(&stage.captured()), light(&green));
    if let Some(mut material) = stage.world().resource_mut::<Assets<Own>>().get_mut(&own) {
        material.look = matte(RED);
    }
    assert!(stage.picture() == red, "{:?} of {:?}", light(&stage.captured()), light(&red));

    let shines = StandardMaterial { emissive: LinearRgba::rgb(0.0, 0.0, 3.0), ..matte(LinearRgba::BLACK) };
    if let Some(mut material) = stage.world().resource_mut::<Assets<Own>>().get_mut(&own) {
        material.look = shines.clone();
    }
    let lit = light(&stage.settled_picture());
    assert!(is_dark(lit[0], lit[2]), "the wall does not shine: {lit:?}");
    stage.world().entity_mut(wall).remove::<MeshMaterial3d<Own>>();
    paint(&mut stage, shines);
    assert_eq!(light(&stage.settled_picture()), lit);
}

#[test]
fn a_material_that_is_not_announced_takes_no_part() {
    let mut stage = stage(|_| {});
    let red = light(&stage.picture())[0];
    strip(&mut stage);
    paint(&mut stage, Own { look: matte(RED) });
    let left = light(&stage.settled_picture())[0];
    assert!(is_dark(left, red), "{left} of {red}");
}

#[test]
fn colors_of_vertices_are_reflected() {
    let mut stage = stage(|_| {});
    let red = light(&stage.picture());
    paint(&mut stage, matte(LinearRgba::WHITE));
    let without = light(&stage.picture());
    assert!(without[1] > 4.0 * red[1], "{without:?}");
    let mut mesh = cuboid();
    mesh.insert_attribute(
        Mesh::ATTRIBUTE_COLOR,
        VertexAttributeValues::Float32x4(vec![RED.to_f32_array(); mesh.count_vertices()]),
    );
    let mesh = stage.world().resource_mut::<Assets<Mesh>>().add(mesh);
    let wall = stage.only::<Wall>();
    stage.world().entity_mut(wall).insert(Mesh3d(mesh));
    let found = light(&stage.settled_picture());
    let is_near = (0..3).all(|i| (found[i] / red[i] - 1.0).abs() < 0.03);
    assert!(is_near, "{found:?} of {red:?}");
}

/// A texture of two texels, the red one on the left.
fn red_and_green(stage: &mut Stage) -> Handle<Image> {
    let texels = [RED, LinearRgba::GREEN].map(|color| color.to_f32_array()).concat();
    let texels: Vec<u8> = texels.into_iter().flat_map(|value| half::f16::from_f32(value).to_le_bytes()).collect();
    let size = Extent3d { width: 2, height: 1, depth_or_array_layers: 1 };
    let (dimension, format) = (TextureDimension::D2, TextureFormat::Rgba16Float);
    let texture = Image::new(size, dimension, texels, format, RenderAssetUsages::default());
    stage.world().resource_mut::<Assets<Image>>().add(texture)
}

/// The wall has the quarter of the texture that begins there along u, and reflects as expected.
fn assert_reflects(stage: &mut Stage, texture: &Handle<Image>, first: f32, expected: [f64; 3]) {
    let uv_transform = Affine2::from_scale_angle_translation(Vec2::splat(0.25), 0.0, Vec2::new(first, 0.0));
    let base_color_texture = Some(texture.clone());
    paint(stage, StandardMaterial { base_color_texture, uv_transform, ..matte(LinearRgba::WHITE) });
    let found = light(&stage.settled_picture());
    let is_near = (0..3).all(|i| (found[i] - expected[i]).abs() < 0.03 * expected[0].max(expected[1]));
    assert!(is_near, "from {first}: {found:?}, not {expected:?}");
}

/// A texture of two texels, of which the material's transform leaves one on the wall.
#[test]
fn textures_lie_where_their_transform_puts_them() {
    let mut stage = stage(|_| {});
    let [red, green] = [RED, LinearRgba::GREEN].map(|color| {
        paint(&mut stage, matte(color));
        light(&stage.settled_picture())
    });
    let texture = red_and_green(&mut stage);
    for (first, expected) in [(0.125, red), (0.625, green)] {
        assert_reflects(&mut stage, &texture, first, expected);
    }
}

/// A texture, red on the left and green on the right, of which the wall is beyond the right edge; and once more beyond the left.
#[test]
fn textures_go_on_as_their_samplers_say() {
    let mut stage = stage(|_| {});
    let [red, green] = [RED, LinearRgba::GREEN].map(|color| {
        paint(&mut stage, matte(color));
        light(&stage.settled_picture())
    });
    let texture = red_and_green(&mut stage);
    use ImageAddressMode::{ClampToEdge, MirrorRepeat, Repeat};
    for (mode, first, expected) in [
        (None, 1.125, green),
        (None, -0.875, red),
        (Some(ClampToEdge), 1.125, green),
        (Some(Repeat), 1.125, red),
        (Some(Repeat), -0.875, red),
        (Some(MirrorRepeat), 1.125, green),
        (Some(MirrorRepeat), 2.125, red),
    ] {
        let sampler = mode.map_or(ImageSampler::Default, |mode| {
            ImageSampler::Descriptor(ImageSamplerDescriptor { address_mode_u: mode, ..default() })
        });
        if let Some(mut texture) = stage.world().resource_mut::<Assets<Image>>().get_mut(&texture) {
            texture.sampler = sampler;
        }
        println!("{mode:?}");
        assert_reflects(&mut stage, &texture, first, expected);
    }
}

/// Positions, count of vertices and colours, in place: as if the mesh had been so from the first.
#[test]
fn a_mesh_that_is_edited_is_what_it_became() {
    let mut stage = stage(|_| {});
    let first = stage.picture();
    let lower = Mesh::from(Cuboid::new(0.4, 1.0, 4.0)).translated_by(Vec3::Y * -0.5);
    let ball = Mesh::from(Sphere::new(0.7));
    let mut colored = cuboid();
    let colors = vec![LinearRgba::BLUE.to_f32_array(); colored.count_vertices()];
    colored.insert_attribute(Mesh::ATTRIBUTE_COLOR, VertexAttributeValues::Float32x4(colors));
    let wall = stage.only::<Wall>();
    for (name, becomes) in [("lower", lower), ("a ball", ball), ("coloured", colored)] {
        let put = |stage: &mut Stage, mesh: Mesh| {
            let mesh = stage.world().resource_mut::<Assets<Mesh>>().add(mesh);
            stage.world().entity_mut(wall).insert(Mesh3d(mesh.clone()));
            mesh
        };
        put(&mut stage, becomes.clone());
        let expected = stage.settled_picture();
        assert!(expected != first, "{name}: shows nothing");
        let mesh = put(&mut stage, cuboid());
        assert!(stage.settled_picture() == first, "{name}: what it was does not come back");
        if let Some(mut mesh) = stage.world().resource_mut::<Assets<Mesh>>().get_mut(&mesh) {
            *mesh = becomes;
        }
        let edited = stage.settled_picture();
        assert!(edited == expected, "{name}: {:?}, not {:?}", light(&edited), light(&expected));
    }
}
