//! The scene's buffers as they are on the GPU, after whole frames of an app without a window.

use std::sync::mpsc::channel;

use bevy::app::PluginsState;
use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::{RenderLayers, VisibilityRange};
use bevy::image::Image;
use bevy::light::NotShadowCaster;
use bevy::log::LogPlugin;
use bevy::mesh::morph::{MeshMorphWeights, MorphAttributes};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Indices, Mesh, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::encase::StorageBuffer;
use bevy::render::render_resource::encase::internal::{CreateFrom, ReadFrom};
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, Extent3d, Face, MapMode, PollType, ShaderSize,
    ShaderType, TextureDimension, TextureFormat,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::window::ExitCondition;
use bevy::winit::WinitPlugin;
use bevy_bounce_shaders::types::{self, *};

use super::*;
use crate::{GlobalIllumination, GlobalIlluminationPlugins};

/// An app with a camera that asks for bounced light; `None` on a machine without an adapter, or one that falls short.
fn app() -> Option<App> {
    let mut app = App::new();
    app.add_plugins(
        DefaultPlugins
            .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
            .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() })
            .disable::<WinitPlugin>()
            .disable::<PipelinedRenderingPlugin>()
            .disable::<LogPlugin>(),
    )
    .add_plugins(GlobalIlluminationPlugins::default());
    while app.plugins_state() == PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
    app.world_mut().spawn((Camera3d::default(), GlobalIllumination::default()));
    if !device_is_adequate(&app) {
        eprintln!("skipped: no adapter that can run the plugins");
        return None;
    }
    frames(&mut app, 4);
    Some(app)
}

fn frames(app: &mut App, count: u32) {
    for _ in 0..count {
        app.update();
    }
}

fn buffers(app: &App) -> &SceneBuffers {
    app.sub_app(RenderApp).world().resource::<SceneBuffers>()
}

/// The first elements of a buffer, as a shader would read them.
fn read<T>(app: &App, buffer: &Buffer, count: usize) -> Vec<T>
where
    T: ShaderType + ShaderSize + CreateFrom + ReadFrom,
{
    let world = app.sub_app(RenderApp).world();
    let (device, queue) = (world.resource::<RenderDevice>(), world.resource::<RenderQueue>());
    let size = count as u64 * T::SHADER_SIZE.get();
    let staging = device.create_buffer(&BufferDescriptor {
        label: None,
        size,
        usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, size);
    queue.submit([encoder.finish()]);
    let (sender, receiver) = channel();
    staging.slice(..).map_async(MapMode::Read, move |result| sender.send(result).expect("the test waits"));
    device.poll(PollType::wait_indefinitely()).expect("the device works");
    receiver.recv().expect("mapped").expect("readable");
    let bytes = staging.slice(..).get_mapped_range().to_vec();
    StorageBuffer::new(bytes).create().expect("as laid out")
}

fn instances(app: &App) -> Vec<Instance> {
    let count = app.sub_app(RenderApp).world().resource::<Instances>().table.values().len();
    read::<Instance>(app, &buffers(app).instances, count)
}

fn light_count(app: &App) -> usize {
    app.sub_app(RenderApp).world().resource::<Lights>().table.values().len()
}

fn material_of(app: &App, instance: &Instance) -> types::Material {
    let count = instance.material as usize + 1;
    read::<types::Material>(app, &buffers(app).materials, count)[instance.material as usize]
}

/// World-space corners of an instance's triangles, as `shared/triangles.wgsl` finds them.
fn corners(app: &App, instance: &Instance) -> Vec<Vec3> {
    let geometry = &buffers(app).geometry;
    let words = read::<u32>(app, geometry, (geometry.size() / 4) as usize);
    let position = |o: usize| Vec3::from_array([0, 1, 2].map(|i| f32::from_bits(words[o + i])));
    (0..instance.triangle_count as usize * 3)
        .map(|corner| {
            let vertex = words[instance.index_offset as usize + corner] as usize;
            if instance.deformed_offset != NONE {
                return position(instance.deformed_offset as usize + vertex * DEFORMED_WORDS as usize);
            }
            let local = position(instance.vertex_offset as usize + vertex * VERTEX_WORDS as usize).extend(1.0);
            Vec3::new(
                instance.world_from_local_x.dot(local),
                instance.world_from_local_y.dot(local),
                instance.world_from_local_z.dot(local),
            )
        })
        .collect()
}

fn add<A: Asset>(app: &mut App, asset: A) -> Handle<A> {
    app.world_mut().resource_mut::<Assets<A>>().add(asset)
}

fn triangle(usage: RenderAssetUsages) -> Mesh {
    Mesh::new(PrimitiveTopology::TriangleList, usage)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        .with_inserted_indices(Indices::U16(vec![0, 1, 2]))
}

fn spawn(app: &mut App, mesh: &Handle<Mesh>, material: &Handle<StandardMaterial>, at: Vec3) -> Entity {
    let bundle = (Mesh3d(mesh.clone()), MeshMaterial3d(material.clone()), Transform::from_translation(at));
    app.world_mut().spawn(bundle).id()
}

fn taking_part(app: &App) -> usize {
    instances(app).iter().filter(|instance| instance.triangle_count > 0).count()
}

#[test]
fn objects_come_move_hide_and_go() {
    let Some(mut app) = app() else { return };
    assert_eq!((buffers(&app).chunk_count(), buffers(&app).bounds()), (0, None));

    let mesh = add(&mut app, triangle(RenderAssetUsages::RENDER_WORLD));
    let material = add(&mut app, StandardMaterial { cull_mode: Some(Face::Front), ..default() });
    let a = spawn(&mut app, &mesh, &material, Vec3::X);
    let b = spawn(&mut app, &mesh, &material, Vec3::NEG_Y);
    app.update();
    let found = instances(&app);
    assert_eq!(corners(&app, &found[0]), [Vec3::X, 2.0 * Vec3::X, Vec3::X + Vec3::Y]);
    assert_eq!(corners(&app, &found[1])[0], Vec3::NEG_Y);
    assert_eq!((found[0].flags, buffers(&app).chunk_count()), (INSTANCE_FLIPPED, 2));
    let bounds = buffers(&app).bounds().expect("two triangles");
    assert_eq!((Vec3::from(bounds.min), Vec3::from(bounds.max)), (Vec3::new(0.0, -1.0, 0.0), Vec3::new(2.0, 1.0, 0.0)));

    let move_to = |app: &mut App, x: f32| {
        app.world_mut().entity_mut(a).insert(Transform::from_xyz(x, 0.0, 0.0));
        app.update();
    };
    move_to(&mut app, 5.0);
    assert_eq!(corners(&app, &instances(&app)[0])[0], 5.0 * Vec3::X);
    move_to(&mut app, f32::NAN);
    assert_eq!(taking_part(&app), 1);
    move_to(&mut app, 1.0);
    assert_eq!(taking_part(&app), 2);

    for hidden in [true, false] {
        let visibility = if hidden { Visibility::Hidden } else { Visibility::Inherited };
        app.world_mut().entity_mut(a).insert(visibility);
        app.update();
        assert_eq!((taking_part(&app), buffers(&app).chunk_count()), if hidden { (1, 1) } else { (2, 2) });
    }

    app.world_mut().entity_mut(a).insert(RenderLayers::layer(3));
    app.update();
    assert_eq!(taking_part(&app), 1);
    app.world_mut().entity_mut(a).remove::<RenderLayers>();
    app.update();
    assert_eq!(taking_part(&app), 2);

    // The camera is at the origin, and the object a metre from it.
    for (far, expected) in [(0.5, 1), (1.5, 2), (0.5, 1)] {
        app.world_mut().entity_mut(a).insert(VisibilityRange::abrupt(0.0, far));
        app.update();
        assert_eq!(taking_part(&app), expected);
    }
    app.world_mut().entity_mut(a).remove::<VisibilityRange>();
    app.update();
    assert_eq!(taking_part(&app), 2);

    // What is lit reflects, with or without a shadow; what is not has nothing but its shadow.
    for (unlit, casts_shadows, expected) in [(false, false, 2), (true, false, 1), (true, true, 2), (false, true, 2)] {
        if let Some(mut changed) = app.world_mut().resource_mut::<Assets<StandardMaterial>>().get_mut(&material) {
            changed.unlit = unlit;
        }
        let mut entity = app.world_mut().entity_mut(a);
        if casts_shadows {
            entity.remove::<NotShadowCaster>();
        } else {
            entity.insert(NotShadowCaster);
        }
        app.update();
        assert_eq!(taking_part(&app), expected, "unlit {unlit}, casts shadows {casts_shadows}");
    }

    app.world_mut().entity_mut(a).insert(VoxelizedMesh { albedo: Some(Color::linear_rgb(1.0, 0.0, 0.2)), ..default() });
    app.world_mut().entity_mut(b).insert(VoxelizedMesh::OFF);
    app.update();
    assert_eq!((instances(&app)[0].albedo_override, taking_part(&app)), (0xff33_00ff, 1));

    app.world_mut().despawn(a);
    app.world_mut().entity_mut(b).remove::<VoxelizedMesh>();
    app.update();
    assert_eq!((instances(&app)[0], taking_part(&app)), (Instance::default(), 1));
    app.world_mut().entity_mut(b).remove::<Mesh3d>();
    app.update();
    assert_eq!((taking_part(&app), buffers(&app).chunk_count(), buffers(&app).bounds()), (0, 0, None));
}

#[test]
fn meshes_change_and_the_buffer_grows() {
    let Some(mut app) = app() else { return };
    let mesh = add(&mut app, triangle(RenderAssetUsages::default()));
    let material = add(&mut app, StandardMaterial::default());
    spawn(&mut app, &mesh, &material, Vec3::ZERO);
    app.update();
    let before = buffers(&app).geometry.id();

    // 6 MiB of vertices and indices: the buffer of 1 MiB is made anew, and what was in it is still there.
    let big = add(&mut app, Sphere::new(2.0).mesh().uv(512, 256));
    spawn(&mut app, &big, &material, Vec3::Z);
    app.update();
    let found = instances(&app);
    assert_ne!(buffers(&app).geometry.id(), before);
    assert_eq!(corners(&app, &found[0]), [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert!(corners(&app, &found[1]).iter().all(|corner| (corner.distance(Vec3::Z) - 2.0).abs() < 1e-3));
    assert_eq!(buffers(&app).chunk_count(), 1 + found[1].triangle_count.div_ceil(CHUNK_TRIANGLES));
    let chunks = read::<Chunk>(&app, &buffers(&app).chunks, 3);
    assert_eq!(chunks.iter().map(|c| (c.instance, c.first_triangle)).collect::<Vec<_>>(), [(0, 0), (1, 0), (1, 64)]);

    if let Some(mut changed) = app.world_mut().resource_mut::<Assets<Mesh>>().get_mut(&mesh) {
        changed.insert_indices(Indices::U32(vec![0, 1, 2, 2, 1, 0]));
    }
    app.update();
    assert_eq!(instances(&app)[0].triangle_count, 2);

    drop(big);
    let used = app.sub_app(RenderApp).world().resource::<meshes::Geometry>().used_bytes();
    let gone = app.world_mut().query::<(Entity, &Mesh3d)>().iter(app.world()).nth(1).map(|(entity, _)| entity);
    app.world_mut().despawn(gone.expect("the sphere"));
    frames(&mut app, 3);
    let left = app.sub_app(RenderApp).world().resource::<meshes::Geometry>().used_bytes();
    assert!(left < used / 100, "{left} of {used} bytes are still in use");
}

#[test]
fn materials_wait_for_their_textures() {
    let Some(mut app) = app() else { return };
    let mesh = add(&mut app, triangle(RenderAssetUsages::default()));
    let image = app.world().resource::<Assets<Image>>().reserve_handle();
    let material = add(
        &mut app,
        StandardMaterial {
            base_color_texture: Some(image.clone()),
            emissive: LinearRgba::rgb(3.0, 2.0, 1.0),
            emissive_exposure_weight: 1.0,
            ..default()
        },
    );
    spawn(&mut app, &mesh, &material, Vec3::ZERO);
    frames(&mut app, 3);
    assert_eq!(taking_part(&app), 0);

    // Left half red, right half a checkerboard of black and white, 64 texels wide.
    let texel = |x: u32, y: u32| match (x < 32, (x + y).is_multiple_of(2)) {
        (true, _) => [255, 0, 0, 255],
        (false, true) => [0, 0, 0, 255],
        (false, false) => [255, 255, 255, 255],
    };
    let data = (0..64 * 64).flat_map(|i| texel(i % 64, i / 64)).collect();
    let size = Extent3d { width: 64, height: 64, depth_or_array_layers: 1 };
    let format = TextureFormat::Rgba8UnormSrgb;
    let loaded = Image::new(size, TextureDimension::D2, data, format, RenderAssetUsages::RENDER_WORLD);
    app.world_mut().resource_mut::<Assets<Image>>().insert(&image, loaded).expect("the handle is reserved");
    frames(&mut app, 2);
    assert_eq!((taking_part(&app), buffers(&app).emissive_chunk_count()), (1, 1));
    let material = material_of(&app, &instances(&app)[0]);
    assert_eq!((material.albedo, material.emissive), (Vec4::ONE, Vec3::new(3.0, 2.0, 1.0)));
    // Without a sampler of its own a texture goes on with its edge in both directions, as Bevy's do.
    let wrap = WRAP_CLAMP | WRAP_CLAMP << WRAP_BITS;
    assert_eq!(material.albedo_thumbnail % (THUMBNAIL_SIZE * THUMBNAIL_SIZE), wrap);
    let first = (material.albedo_thumbnail - wrap) as usize;
    let words = read::<u32>(&app, &buffers(&app).thumbnails, first + 256);
    let linear = |x: usize| {
        let [r, g, b, a] = words[first + x].to_le_bytes().map(|byte| f32::from(byte) / 255.0);
        Vec4::new(r * r, g * g, b * b, a)
    };
    assert!(linear(2).abs_diff_eq(Vec4::new(1.0, 0.0, 0.0, 1.0), 0.01), "{}", linear(2));
    assert!(linear(12).abs_diff_eq(Vec3::splat(0.5).extend(1.0), 0.01), "{}", linear(12));
}

#[test]
fn lights_follow_their_components() {
    let Some(mut app) = app() else { return };
    let point =
        app.world_mut().spawn((PointLight { intensity: 1000.0, ..default() }, Transform::from_xyz(1.0, 2.0, 3.0))).id();
    let sun = app
        .world_mut()
        .spawn((DirectionalLight::default(), Transform::default().looking_to(Vec3::NEG_Y, Vec3::X)))
        .id();
    app.update();
    // Without anything to shine on the sun has no power.
    assert_eq!(light_count(&app), 1);
    let mesh = add(&mut app, Plane3d::default().mesh().size(10.0, 20.0).build());
    let material = add(&mut app, StandardMaterial::default());
    spawn(&mut app, &mesh, &material, Vec3::ZERO);
    app.update();
    let lights = read::<Light>(&app, &buffers(&app).lights, 2);
    assert_eq!(
        (lights[0].kind, lights[0].position, lights[1].kind),
        (LIGHT_POINT, Vec3::new(1.0, 2.0, 3.0), LIGHT_DIRECTIONAL)
    );
    assert!((lights[0].cumulative_power - 1000.0).abs() < 0.1);
    let sun_power = lights[1].cumulative_power - lights[0].cumulative_power;
    assert!((sun_power / (light_consts::lux::AMBIENT_DAYLIGHT * 200.0) - 1.0).abs() < 1e-3, "{sun_power}");

    app.world_mut().entity_mut(sun).insert(GiLight::OFF);
    app.world_mut().entity_mut(point).insert(GiLight { intensity: 0.5, share: 3.0, bounces: 2 });
    app.update();
    let light = read::<Light>(&app, &buffers(&app).lights, 1)[0];
    assert_eq!((light_count(&app), light.max_bounces), (1, 2));
    assert!((light.color - lights[0].color * 0.5).length() < 1e-3 && (light.cumulative_power - 1500.0).abs() < 0.1);
    app.world_mut().despawn(point);
    app.update();
    assert_eq!(light_count(&app), 0);
}

#[test]
fn skins_and_morphs_stand_as_they_are_posed_this_frame() {
    let Some(mut app) = app() else { return };
    let skinned = triangle(RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_JOINT_INDEX,
            VertexAttributeValues::Uint16x4(vec![[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]]),
        )
        .with_inserted_attribute(
            Mesh::ATTRIBUTE_JOINT_WEIGHT,
            vec![[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]],
        );
    let morphed = triangle(RenderAssetUsages::RENDER_WORLD).with_morph_targets(
        [Vec3::Z, Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, Vec3::X, Vec3::ZERO]
            .map(|delta| MorphAttributes::new(delta, Vec3::ZERO, Vec3::ZERO))
            .to_vec(),
    );
    let (skinned, morphed) = (add(&mut app, skinned), add(&mut app, morphed));
    let material = add(&mut app, StandardMaterial::default());
    let joints: Vec<_> = (0..2).map(|_| app.world_mut().spawn(Transform::default()).id()).collect();
    let bind = Mat4::from_translation(Vec3::NEG_X);
    let bindposes = add(&mut app, SkinnedMeshInverseBindposes::from(vec![Mat4::IDENTITY, bind]));
    let skin = spawn(&mut app, &skinned, &material, 9.0 * Vec3::ONE);
    app.world_mut().entity_mut(skin).insert(SkinnedMesh { inverse_bindposes: bindposes, joints: joints.clone() });
    let morph = spawn(&mut app, &morphed, &material, Vec3::Y);
    app.world_mut().entity_mut(morph).insert(MeshMorphWeights::Value { weights: vec![2.0, -1.0] });

    app.update();
    let near = |found: &[Vec3], expected: [Vec3; 3]| {
        assert!(found.iter().zip(expected).all(|(a, b)| a.abs_diff_eq(b, 1e-4)), "{found:?} is not {expected:?}");
    };
    near(&corners(&app, &instances(&app)[0]), [Vec3::ZERO, Vec3::ZERO, Vec3::new(-0.5, 1.0, 0.0)]);
    near(&corners(&app, &instances(&app)[1]), [Vec3::new(0.0, 1.0, 2.0), Vec3::Y, Vec3::new(0.0, 2.0, 0.0)]);

    app.world_mut().entity_mut(joints[1]).insert(Transform::from_xyz(0.0, 0.0, 4.0));
    app.world_mut().entity_mut(morph).insert(MeshMorphWeights::Value { weights: vec![0.0, 0.0] });
    app.update();
    near(&corners(&app, &instances(&app)[0]), [Vec3::ZERO, 4.0 * Vec3::Z, Vec3::new(-0.5, 1.0, 2.0)]);
    near(&corners(&app, &instances(&app)[1]), [Vec3::Y, Vec3::X + Vec3::Y, 2.0 * Vec3::Y]);
    let bounds = buffers(&app).bounds().expect("both are there");
    for corner in instances(&app).iter().flat_map(|instance| corners(&app, instance)) {
        assert!(
            corner.cmpge(bounds.min.into()).all() && corner.cmple(bounds.max.into()).all(),
            "{corner} of {bounds:?}"
        );
    }

    app.world_mut().entity_mut(joints[0]).insert(Transform::from_xyz(f32::NAN, 0.0, 0.0));
    app.update();
    assert_eq!(taking_part(&app), 1);
    app.world_mut().entity_mut(joints[0]).insert(Transform::default());
    app.world_mut().entity_mut(morph).remove::<MeshMorphWeights>();
    app.update();
    assert_eq!((taking_part(&app), instances(&app)[1].deformed_offset), (2, NONE));
    app.world_mut().despawn(skin);
    app.update();
    assert_eq!(taking_part(&app), 1);
}

#[test]
fn groups_hold_what_is_rigid_below_them() {
    let Some(mut app) = app() else { return };
    let morphed = triangle(RenderAssetUsages::RENDER_WORLD)
        .with_morph_targets([Vec3::Z; 3].map(|delta| MorphAttributes::new(delta, Vec3::ZERO, Vec3::ZERO)).to_vec());
    let (rigid, morphed) = (add(&mut app, triangle(RenderAssetUsages::RENDER_WORLD)), add(&mut app, morphed));
    let material = add(&mut app, StandardMaterial::default());
    let root = |x: f32| (Transform::from_xyz(x, 0.0, 0.0), Visibility::default(), VoxelizedGroup::default());
    let (outer, inner) = (app.world_mut().spawn(root(5.0)).id(), app.world_mut().spawn(root(1.0)).id());
    let arm = app.world_mut().spawn((Transform::from_xyz(0.0, 2.0, 0.0), Visibility::default())).id();
    let meshes = [&rigid, &rigid, &rigid, &morphed].map(|mesh| spawn(&mut app, mesh, &material, Vec3::Z));
    app.world_mut().entity_mut(meshes[3]).insert(MeshMorphWeights::Value { weights: vec![1.0] });
    app.world_mut().entity_mut(arm).add_child(meshes[1]);
    app.world_mut().entity_mut(inner).add_child(meshes[2]);
    app.world_mut().entity_mut(outer).add_children(&[meshes[0], arm, inner, meshes[3]]);
    app.update();
    let groups = |app: &App| {
        let groups = app.sub_app(RenderApp).world().resource::<Groups>();
        let held = groups.placed.iter().map(|placed| {
            let instances = groups.grids[placed.grid].instances();
            let mut heights: Vec<f32> = instances.iter().map(|instance| instance.world_from_local_y.w).collect();
            heights.sort_by(f32::total_cmp);
            (placed.world_from_group.translation.x, heights)
        });
        (held.collect::<Vec<_>>(), buffers(app).world_chunk_count(), buffers(app).chunk_count())
    };
    // What bends is in the world; a group within the group is one of its own.
    assert_eq!(groups(&app), (vec![(5.0, vec![0.0, 2.0]), (6.0, vec![0.0])], 1, 4));
    app.world_mut().entity_mut(outer).insert(Transform::from_xyz(7.0, 0.0, 0.0));
    app.world_mut().entity_mut(arm).insert(Transform::from_xyz(0.0, 3.0, 0.0));
    app.update();
    assert_eq!(groups(&app), (vec![(7.0, vec![0.0, 3.0]), (8.0, vec![0.0])], 1, 4));
    app.world_mut().entity_mut(meshes[0]).remove::<ChildOf>();
    app.world_mut().entity_mut(inner).remove::<VoxelizedGroup>();
    app.update();
    assert_eq!(groups(&app), (vec![(7.0, vec![0.0, 3.0])], 2, 4));
    app.world_mut().entity_mut(outer).insert(Transform::from_scale(Vec3::new(1.0, 0.0, 1.0)));
    app.update();
    assert_eq!(groups(&app).0, [], "flat");
    app.world_mut().despawn(outer);
    app.update();
    assert_eq!(groups(&app), (vec![], 1, 1));
}
