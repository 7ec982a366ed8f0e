//! Cones through groups: they close what groups fill, and see their light.

use std::f32::consts::PI;

use bevy::math::{Affine3A, EulerRot, Quat, UVec3, Vec3, Vec4};
use bevy_bounce_shaders::types::{
    CACHE_EDGE, CACHE_HEIGHT, CACHE_WIDTH, CACHES_A_ROW, CacheCounters, GROUP_EDGE, Grid, LightVolume, RadianceCache,
};
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::{TestScene, add_groups, cuboid, run, run_with, voxelize};
use bevy_bounce_tests::twins::random::Random;
use half::f16;
use wgpu::TextureFormat;

use super::rays::group_grid;
use crate::paths::intersect;

const HALF: TextureFormat = TextureFormat::Rgba16Float;
const ALBEDO: f32 = 0.5;
/// Room for the light of a group's cells.
const GROUP_CELLS: usize = GROUP_EDGE.pow(3) as usize / 2;

/// Voxels of an empty world of 8 by 8 by 8.
const WORLD: UVec3 = UVec3::splat(64);
/// What the coarsest level of the world's light divides.
const GAP: u32 = 16;

fn world() -> Grid {
    // Off the places where walls are.
    let origin = Vec3::new(-4.03, -4.05, -4.02);
    Grid { origin, voxel_size: 0.125, dims: WORLD, cell_capacity: 100_000, ..Default::default() }
}

/// Makes the levels of some textures of light from cells that send a radiance of 1, by the names of the textures.
fn filter(mut resources: Resources, name: &str, size: [u32; 3], levels: u32, defs: &[&str]) -> Resources {
    for axis in ["x", "y", "z"] {
        let names: Vec<String> = (0..levels).map(|level| format!("{name}_{axis}{level}")).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        resources = resources
            .volume_mips(&format!("{name}_{axis}"), HALF, size, &names)
            .alias(names[0], &format!("level_{axis}"));
    }
    let groups = |size: [u32; 3]| size.map(|texels| texels.div_ceil(4));
    run_with(gpu(), "radiance_cache/volume.wgsl", "fill", defs, &resources, groups(size));
    for level in 1..levels {
        for axis in ["x", "y", "z"] {
            resources = resources
                .alias(&format!("{name}_{axis}{}", level - 1), &format!("finer_{axis}"))
                .alias(&format!("{name}_{axis}{level}"), &format!("level_{axis}"));
        }
        let half = size.map(|texels| texels >> level);
        run(gpu(), "radiance_cache/reduce.wgsl", "reduce", &resources, groups(half));
    }
    resources
}

/// What caches at those places see of groups in the empty world, or of the same meshes voxelised with it: light and coverage of each
/// direction.
fn see(groups: &[(&TestScene, Affine3A)], as_groups: bool, caches: &[(Vec3, Vec3)]) -> Vec<Vec<Vec4>> {
    let mut scene = TestScene::new(Vec3::splat(ALBEDO));
    let (mut grids, mut placed) = (Vec::new(), Vec::new());
    for (index, &(group, place)) in groups.iter().enumerate() {
        if as_groups {
            grids.push((group, group_grid(group)));
            placed.push((index, place));
        } else {
            scene.mesh(&group.triangles, 0, 0, place);
        }
    }
    let empty = voxelize(gpu(), &scene, &world(), None);
    let resources = add_groups(gpu(), empty, &grids, &placed);
    let cells = resources.read_words("cells").expect("reads back").len() / 4 + groups.len() * GROUP_CELLS;
    let volume = LightVolume { dims: WORLD, gap: GAP, last_level: GAP.ilog2(), ..Default::default() };
    let records: Vec<_> = caches
        .iter()
        .map(|&(position, normal)| RadianceCache { position, normal, radius: 1.0, ..Default::default() })
        .collect();
    let resources = resources
        .uniform("volume", &volume)
        // What sends a radiance of 1.
        .floats("irradiance", &vec![PI / ALBEDO; 8 * cells])
        .zeroed("emission_sums", 4)
        .floats("unit", &[1.0])
        .structs("counters", &[CacheCounters { clusters: caches.len() as u32, ..Default::default() }])
        .structs("caches", &records)
        .texture("atlas", HALF, [CACHES_A_ROW * CACHE_WIDTH, CACHE_HEIGHT, 1], false, &[])
        .sampler("light_sampler", wgpu::FilterMode::Linear);
    let resources = filter(resources, "light", [2 * WORLD.x + GAP, WORLD.y, WORLD.z], GAP.ilog2() + 1, &[]);
    let cube = [2 * GROUP_EDGE, GROUP_EDGE, GROUP_EDGE * groups.len() as u32];
    let resources = filter(resources, "group", cube, GROUP_EDGE.ilog2() + 1, &["GROUPS"]);
    run(gpu(), "radiance_cache/create.wgsl", "create", &resources, [caches.len() as u32, 1, 1]);
    let bytes = resources.read_texture("atlas").expect("reads back");
    let halves: Vec<f32> = bytes.as_chunks().0.iter().map(|c| f16::from_le_bytes(*c).to_f32()).collect();
    let atlas: Vec<Vec4> = halves.as_chunks().0.iter().map(|c| Vec4::from_array(*c)).collect();
    let texel = |index: u32, i: u32| {
        let (x, y) = (index * CACHE_WIDTH + i % CACHE_EDGE, i / CACHE_EDGE);
        atlas[(y * CACHES_A_ROW * CACHE_WIDTH + x) as usize]
    };
    (0..caches.len() as u32).map(|cache| (0..CACHE_EDGE * CACHE_EDGE).map(|i| texel(cache, i)).collect()).collect()
}

fn turned(place: Vec3) -> Affine3A {
    Affine3A::from_rotation_translation(Quat::from_euler(EulerRot::XYZ, 0.5, 0.8, 0.2), place)
}

fn turned_about_y(place: Vec3) -> Affine3A {
    Affine3A::from_rotation_translation(Quat::from_rotation_y(0.15), place)
}

/// As a room that lies along the axes of the world's voxels is to cones through these, whichever way it is turned.
#[test]
fn a_room_that_is_a_group_is_closed_and_lit() {
    let mut group = TestScene::new(Vec3::splat(ALBEDO));
    group.room(Vec3::new(-1.7, -1.1, -1.4), Vec3::new(1.7, 1.1, 1.4));
    let mut random = Random::new(3);
    // On its walls.
    let caches: Vec<(Vec3, Vec3)> = (0..18)
        .map(|i| {
            let axis = i % 3;
            let (mut on, mut normal) = (random.vector() * 0.9, Vec3::ZERO);
            on[axis] = on[axis].signum();
            normal[axis] = -on[axis];
            (on * Vec3::new(1.7, 1.1, 1.4), normal)
        })
        .collect();
    let [turned, straight] = [turned(Vec3::new(0.3, -0.2, 0.1)), Affine3A::from_translation(Vec3::new(0.3, -0.2, 0.1))];
    let seen = |place: Affine3A, as_group: bool| -> Vec<Vec4> {
        let there = |&(on, normal): &(Vec3, Vec3)| (place.transform_point3(on), place.transform_vector3(normal));
        let caches: Vec<_> = caches.iter().map(there).collect();
        see(&[(&group, place)], as_group, &caches).into_iter().flatten().collect()
    };
    let closed = |texels: &[Vec4]| texels.iter().map(|texel| texel.w).sum::<f32>() / texels.len() as f32;
    let in_world = seen(straight, false);
    println!("closed: {} in the world, {} turned there", closed(&in_world), closed(&seen(turned, false)));
    for place in [turned, straight] {
        let texels = seen(place, true);
        let least = texels.iter().map(|texel| texel.w).fold(1.0, f32::min);
        println!("closed: {} in a group, {least} at least", closed(&texels));
        assert!(closed(&texels) > closed(&in_world) - 0.01 && least > 0.6, "cones leave a closed room");
        for texel in &texels {
            assert!((texel.truncate() / texel.w - 1.0).abs().max_element() < 0.02, "{texel}");
        }
    }
}

/// Of a box, near and far, whatever the size of its voxels: caches see as much of it as there is.
#[test]
fn groups_neither_grow_nor_vanish() {
    for (half, place) in [
        (Vec3::new(0.5, 0.4, 0.3), turned(Vec3::ZERO)),
        (Vec3::new(0.2, 0.2, 0.2), turned(Vec3::new(0.1, 0.2, -0.1))),
        (Vec3::new(0.5, 0.5, 0.5), turned(Vec3::ZERO) * Affine3A::from_scale(Vec3::new(0.16, 0.3, 0.2))),
        (Vec3::new(1.2, 0.9, 1.0), turned(Vec3::ZERO)),
    ] {
        let mut group = TestScene::new(Vec3::splat(ALBEDO));
        group.soup(&cuboid(-half, half));
        let middle = place.transform_point3(Vec3::ZERO);
        let mut random = Random::new(8);
        let triangles: Vec<[Vec3; 3]> = group.triangles.iter().map(|t| t.map(|p| place.transform_point3(p))).collect();
        let size = half.max_element() * place.matrix3.x_axis.length().max(place.matrix3.y_axis.length());
        for distance in [1.8, 3.0] {
            let caches: Vec<(Vec3, Vec3)> = (0..24)
                .map(|_| {
                    let way = random.direction();
                    (middle - way * (distance + size), (way + 0.3 * random.vector()).normalize())
                })
                .collect();
            let seen = see(&[(&group, place)], true, &caches);
            let sum = |seen: &[Vec<Vec4>], value: fn(&Vec4) -> f32| {
                seen.iter().flatten().map(value).sum::<f32>() * 2.0 * PI / 256.0
            };
            let (found, light) = (sum(&seen, |texel| texel.w), sum(&seen, |texel| texel.x));
            let in_world = sum(&see(&[(&group, place)], false, &caches), |texel| texel.w);
            let rays = 4000;
            let exact: f32 = caches
                .iter()
                .map(|&(origin, normal)| {
                    let met = (0..rays).filter(|_| {
                        let direction = random.direction();
                        let direction = direction * direction.dot(normal).signum();
                        triangles.iter().any(|t| intersect(t, origin, direction).is_some())
                    });
                    2.0 * PI * met.count() as f32 / rays as f32
                })
                .sum();
            let ratio = found / exact;
            println!(
                "half {half} at {distance}: {:.4} sr, {ratio:.3} of what there is, {:.3} in the world",
                exact / 24.0,
                in_world / exact,
            );
            assert!((light / found - 1.0).abs() < 0.02, "{light} of light on {found}");
            assert!((0.8..1.4).contains(&ratio), "half {half} at {distance}: {found} sr, expected {exact}");
        }
    }
}

/// Of two blocks one behind the other, what the one in front covers hides the other's light and no more, whichever is
/// first among the groups.
#[test]
fn groups_hide_what_is_behind_them() {
    let block = |albedo: Vec3, half: Vec3| {
        let mut group = TestScene::new(albedo * ALBEDO);
        group.soup(&cuboid(-half, half));
        group
    };
    let (narrow, wide) = (Vec3::new(0.6, 0.5, 0.25), Vec3::new(1.9, 1.7, 0.3));
    let caches =
        [(Vec3::new(0.1, -0.1, 1.6), Vec3::NEG_Z), (Vec3::new(-0.8, 0.3, 1.3), Vec3::new(0.4, -0.1, -1.0).normalize())];
    let look = |groups: &[(&TestScene, Affine3A)]| see(groups, true, &caches).into_iter().flatten().collect::<Vec<_>>();
    let at = |z: f32| turned_about_y(Vec3::new(0.05, 0.1, z));
    for (front, behind) in [(narrow, wide), (wide, narrow)] {
        let (red, green) = (block(Vec3::X, front), block(Vec3::Y, behind));
        let (red, green) = ((&red, at(0.0)), (&green, at(-1.3)));
        let (of_red, of_green) = (look(&[red]), look(&[green]));
        let together = look(&[red, green]);
        let mut hidden = 0.0;
        for ((red, green), both) in of_red.iter().zip(&of_green).zip(&together) {
            let left = green.y * (1.0 - red.w);
            // A cone that is open by six percent counts as closed.
            assert!((both.x - red.x).abs() < 0.07, "in front there is {} of {}", both.x, red.x);
            assert!((both.y - left).abs() < 0.1, "behind there is {} of {left}", both.y);
            hidden += green.y - both.y;
        }
        println!("{hidden} of {} is hidden", of_green.iter().map(|green| green.y).sum::<f32>());
        assert!(hidden > 10.0, "nothing is hidden: {hidden}");
        let other_way = look(&[green, red]);
        let differs = together.iter().zip(&other_way).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max);
        assert!(differs < 2e-3, "the order of the groups changes light by {differs}");
    }
}
