//! Whole frames with groups that have voxel grids of their own.

use bevy::prelude::*;
use bevy_bounce::avg::{GroupCounts, group_counts};
use bevy_bounce::{GiSettings, GlobalIllumination, Quality, Technique, VoxelizedGroup, VoxelizedMesh, VplVisibility};
use bevy_bounce_examples::scenes::{Builder, CornellBox, CornellPlugin};
use bevy_bounce_tests::metrics::Metrics;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, run};

const SIZE: UVec2 = UVec2::new(96, 54);
const FINE: GiSettings = GiSettings { grid: 48, vpls: 1024, bounces: 8, ..SMALL };
const TECHNIQUES: [Technique; 2] = [Technique::InstantRadiosity, Technique::RadianceCache];

fn lit(technique: Technique, settings: GiSettings) -> GlobalIllumination {
    GlobalIllumination { technique, quality: Quality::Custom(settings), ..default() }
}

fn stage(technique: Technique, settings: GiSettings, scene: impl FnOnce(&mut App)) -> Stage {
    Stage::with_run(run(SIZE, Some(lit(technique, settings))), scene)
}

/// The Cornell box, with or without its blocks in groups.
fn cornell(technique: Technique, settings: GiSettings, grouped: bool) -> Stage {
    stage(technique, settings, |app| {
        app.add_plugins(CornellPlugin).add_systems(
            PostStartup,
            move |mut commands: Commands, named: Query<(Entity, &Name)>| {
                for (entity, _) in named.iter().filter(|(_, name)| grouped && name.ends_with("block")) {
                    commands.entity(entity).insert(VoxelizedGroup::default());
                }
            },
        );
    })
}

fn counts(stage: &Stage) -> GroupCounts {
    group_counts(stage.render_world()).expect("there is a grid")
}

fn named(stage: &mut Stage, name: &str) -> Entity {
    let mut query = stage.world().query::<(Entity, &Name)>();
    let found = query.iter(stage.world()).find(|(_, found)| found.as_str() == name).map(|(entity, _)| entity);
    found.unwrap_or_else(|| panic!("no {name}"))
}

fn assert_like(name: &str, found: &Picture, expected: &Picture, low: f64) {
    let metrics = Metrics::new(found, expected).expect("sizes are equal");
    println!("{name}: {metrics:?}");
    assert!((metrics.energy - 1.0).abs() < 0.05 && metrics.low < low, "{name}: {metrics:?}");
}

#[test]
fn blocks_in_groups_give_the_light_of_blocks_in_the_world() {
    for technique in TECHNIQUES {
        let expected = cornell(technique, FINE, false).picture();
        let mut grouped = cornell(technique, FINE, true);
        let found = grouped.picture();
        assert_eq!(counts(&grouped).groups, 2, "both blocks are groups");
        assert!(found != expected, "groups change nothing");
        assert_like(&format!("{technique:?}"), &found, &expected, 0.1);
    }
    let atlas = GiSettings { visibility: VplVisibility::Atlas, ..FINE };
    let [expected, found] = [false, true].map(|grouped| cornell(TECHNIQUES[0], atlas, grouped).picture());
    assert_like("by maps", &found, &expected, 0.1);
}

#[test]
fn what_moves_is_not_voxelised_again() {
    assert_moves_alone(Technique::InstantRadiosity);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn what_moves_is_not_voxelised_again_for_caches() {
    assert_moves_alone(Technique::RadianceCache);
}

/// A group that moves is lit where it is, by the voxels that it has.
fn assert_moves_alone(technique: Technique) {
    let places = [
        Transform::from_xyz(0.9, 0.9, 0.9).with_rotation(Quat::from_rotation_x(0.7)),
        Transform::from_xyz(-1.0, 2.6, 0.3).with_scale(Vec3::new(0.5, 1.3, 0.8)),
        Transform::from_xyz(0.9, 0.9, 0.9).with_scale(Vec3::new(-1.0, 1.0, 1.0)),
    ];
    let mut stage = cornell(technique, SMALL, true);
    let block = named(&mut stage, "short block");
    let before = stage.picture();
    let voxelized = counts(&stage).voxelized;
    for place in places {
        stage.world().entity_mut(block).insert(place);
        let moved = stage.picture();
        // A mirror image is another one: of each triangle the other side is seen.
        let mirrored = u64::from(place.scale.x < 0.0);
        assert_eq!(counts(&stage).voxelized, voxelized + mirrored, "voxelised again");
        assert!(moved != before, "the light stays where it was");
        let fresh = self::stage(technique, SMALL, |app| {
            app.add_plugins(CornellPlugin).add_systems(
                PostStartup,
                move |mut commands: Commands, named: Query<(Entity, &Name)>| {
                    for (entity, name) in &named {
                        if name.ends_with("block") {
                            commands.entity(entity).insert(VoxelizedGroup::default());
                        }
                        if name.as_str() == "short block" {
                            commands.entity(entity).insert(place);
                        }
                    }
                },
            );
        })
        .picture();
        if technique == Technique::InstantRadiosity {
            assert!(moved == fresh, "{technique:?}: not the light of that place");
        } else {
            // Caches stay where they were put.
            assert_like("moved", &moved, &fresh, 0.1);
        }
    }
}

/// A hall with blocks on its floor, each a child of a root of its own.
fn hall(build: &mut Builder, blocks: usize, grouped: bool) {
    let white = build.paint([0.7; 3]);
    CornellBox::spawn_walls(build);
    CornellBox::spawn_lamp_and_camera(&mut build.commands);
    let (body, top) =
        (build.meshes.add(Cuboid::new(0.31, 0.43, 0.29)), build.meshes.add(Cuboid::new(0.13, 0.17, 0.11)));
    for i in 0..blocks {
        let place = Vec3::new(-1.53 + 0.61 * (i % 6) as f32, 0.29, -1.51 + 0.59 * (i / 6) as f32);
        let turned = Transform::from_translation(place).with_rotation(Quat::from_rotation_y(0.4 * i as f32));
        let mut root = build.commands.spawn((turned, Visibility::default()));
        if grouped {
            root.insert(VoxelizedGroup { resolution: 16 });
        }
        root.with_children(|parts| {
            let part = |mesh: &Handle<Mesh>| (Mesh3d(mesh.clone()), MeshMaterial3d(white.clone()));
            parts.spawn((part(&body), Transform::IDENTITY));
            parts.spawn((part(&top), Transform::from_xyz(0.05, 0.29, -0.03)));
        });
    }
}

fn hall_stage(technique: Technique, blocks: usize, grouped: bool) -> Stage {
    stage(technique, FINE, |app| {
        app.add_systems(Startup, move |mut build: Builder| hall(&mut build, blocks, grouped));
    })
}

#[test]
fn groups_of_the_same_meshes_share_a_grid() {
    let mut stage = hall_stage(Technique::InstantRadiosity, 2, true);
    let first = stage.picture();
    assert_eq!(counts(&stage), GroupCounts { groups: 2, grids: 1, voxelized: 1 });
    let mut roots = stage.world().query_filtered::<Entity, With<VoxelizedGroup>>();
    let roots: Vec<Entity> = roots.iter(stage.world()).collect();
    // One gets another resolution, and is one of its own.
    stage.world().entity_mut(roots[1]).insert(VoxelizedGroup { resolution: 32 });
    stage.frame(std::time::Duration::ZERO);
    assert_eq!(
        counts(&stage),
        GroupCounts { groups: 2, grids: 2, voxelized: 2 },
        "with room for two, both are made anew"
    );
    // One loses a part.
    let child = stage.world().get::<Children>(roots[0]).map(|children| children[0]).expect("has parts");
    stage.world().entity_mut(child).insert(VoxelizedMesh::OFF);
    stage.frame(std::time::Duration::ZERO);
    assert_eq!(counts(&stage), GroupCounts { groups: 2, grids: 2, voxelized: 3 });
    // All as before.
    stage.world().entity_mut(child).remove::<VoxelizedMesh>();
    stage.world().entity_mut(roots[1]).insert(VoxelizedGroup { resolution: 16 });
    assert!(stage.picture() == first, "something was left behind");
    assert_eq!(counts(&stage).grids, 1);
    // A look that changes is voxelised anew.
    let before = counts(&stage).voxelized;
    let handle = {
        let mut painted = stage.world().query_filtered::<&MeshMaterial3d<StandardMaterial>, With<ChildOf>>();
        painted.iter(stage.world()).next().map(|material| material.0.clone()).expect("is painted")
    };
    if let Some(mut paint) = stage.world().resource_mut::<Assets<StandardMaterial>>().get_mut(&handle) {
        paint.base_color = Color::linear_rgb(0.9, 0.1, 0.1);
    }
    assert!(stage.picture() != first, "its paint is another");
    assert_eq!(counts(&stage).voxelized, before + 1);
}

#[test]
fn a_group_that_goes_leaves_nothing() {
    assert_goes_whole(Technique::InstantRadiosity);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn a_group_that_goes_leaves_nothing_for_caches() {
    assert_goes_whole(Technique::RadianceCache);
}

/// Without its groups a hall is lit as if they had never been there.
fn assert_goes_whole(technique: Technique) {
    let expected = hall_stage(technique, 0, false).picture();
    let mut stage = hall_stage(technique, 3, true);
    assert!(stage.picture() != expected);
    let mut roots = stage.world().query_filtered::<Entity, With<VoxelizedGroup>>();
    let roots: Vec<Entity> = roots.iter(stage.world()).collect();
    for root in roots {
        stage.world().entity_mut(root).despawn();
    }
    stage.frame(std::time::Duration::ZERO);
    let camera = stage.only::<Camera3d>();
    if let Some(mut illumination) = stage.world().get_mut::<GlobalIllumination>(camera) {
        illumination.reset = true;
    }
    assert!(stage.picture() == expected, "{technique:?}: something of the groups is left");
    assert_eq!(counts(&stage).groups, 0);
}

/// The Cornell box with so many small cubes along its back as have room in groups, then its two blocks.
fn crowded(technique: Technique, grouped: bool, blocks: bool) -> Stage {
    let settings = GiSettings { grid: 40, vpls: 512, ..SMALL };
    stage(technique, settings, move |app| {
        app.add_systems(Startup, move |mut build: Builder| {
            CornellBox::spawn_walls(&mut build);
            CornellBox::spawn_lamp_and_camera(&mut build.commands);
            let white = build.paint([0.7; 3]);
            let cube = build.meshes.add(Cuboid::from_length(0.07));
            let group = move |root: &mut EntityCommands| {
                if grouped {
                    root.insert(VoxelizedGroup { resolution: 8 });
                }
            };
            for i in 0..32 {
                let place = Transform::from_xyz(-1.71 + 0.11 * i as f32, 0.07, -1.87);
                let cube = (Mesh3d(cube.clone()), MeshMaterial3d(white.clone()), place);
                group(&mut build.commands.spawn(cube));
            }
            for block in CornellBox::BLOCKS.iter().filter(|_| blocks) {
                group(&mut build.block(block.base, block.size, 0.3, &white));
            }
        });
    })
}

#[test]
fn more_groups_than_there_is_room_for_are_in_the_world() {
    assert_crowds_spill(Technique::InstantRadiosity);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn more_groups_than_there_is_room_for_are_in_the_world_of_caches() {
    assert_crowds_spill(Technique::RadianceCache);
}

/// What has no grid of its own is lit in the world's.
fn assert_crowds_spill(technique: Technique) {
    let expected = crowded(technique, false, true).picture();
    let without = crowded(technique, true, false).picture();
    let mut stage = crowded(technique, true, true);
    let found = stage.picture();
    assert_eq!(counts(&stage), GroupCounts { groups: 32, grids: 1, voxelized: 1 });
    assert_like(&format!("{technique:?}"), &found, &expected, 0.1);
    let differs = Metrics::new(&without, &expected).expect("sizes are equal");
    assert!(differs.low > 0.2, "the bounds would not notice that blocks are missing: {differs:?}");
}

/// Groups beside the same meshes in the world: milliseconds of the stages that know of voxels.
#[test]
#[ignore = "prints a table; takes minutes on a software adapter"]
fn what_groups_cost() {
    println!("| technique | groups | `voxelize` | `vpl_trace` | `interleaved` | `voxel_light` | `cache_creation` |");
    println!("|---|---|---|---|---|---|---|");
    for (technique, blocks, grouped) in
        TECHNIQUES.into_iter().flat_map(|t| [0, 8, 32].into_iter().flat_map(move |n| [(t, n, false), (t, n, true)]))
    {
        let mut stage = stage(technique, FINE, |app| {
            app.add_plugins(bevy_bounce_examples::stage_clock::StageClockPlugin);
            app.add_systems(Startup, move |mut build: Builder| hall(&mut build, blocks, grouped));
        });
        let times = stage.stage_times(5);
        let millis = |stage: &str| {
            let mut times = times.get(stage).cloned().unwrap_or_default();
            times.sort_by(f64::total_cmp);
            times.get(times.len() / 2).map_or("-".to_owned(), |millis| format!("{millis:.1}"))
        };
        let stages = ["voxelize", "vpl_trace", "interleaved", "voxel_light", "cache_creation"].map(millis).join(" | ");
        let kind = if grouped { format!("{blocks}") } else { format!("none, {blocks} in the world") };
        println!("| {technique:?} | {kind} | {stages} |");
    }
}
