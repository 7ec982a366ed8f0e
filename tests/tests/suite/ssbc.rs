//! Bias compensation: the shaders against their twin, the flat sum and closed forms.

use std::f32::consts::{FRAC_PI_2, PI};

use bevy::camera::{CameraProjection, PerspectiveProjection, SubCameraView};
use bevy::math::{Mat4, UVec2, Vec2, Vec3, Vec4};
use bevy::prelude::*;
use bevy_bounce_shaders::types::{Grid, SSBC_LEVELS, SsbcParameters, VplHeader};
use bevy_bounce_tests::compose::{compose, compose_source};
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::layout::wgsl_layouts;
use bevy_bounce_tests::scene::{run, run_with};
use bevy_bounce_tests::twins::near::grazing_decay;
use bevy_bounce_tests::twins::ssbc::{
    GBuffer, Gathered, Hierarchy, Lens, flat_sum, gather, half_texels, rgb9e5_to_vec3,
};
use bevy_bounce_tests::twins::{decode_unit, encode_unit};
use wgpu::TextureFormat;

mod at_pixels;
mod descent;
mod frames;

const PARAMETERS: SsbcParameters = SsbcParameters { solid_angle: 0.08, edge_solid_angle: 0.04, scale: 1, reach: 1 };
const NEAR: f32 = 0.1;
/// As in `ssbc/radiance.wgsl`.
const LEAST_COSINE: f32 = 0.01;

/// A perspective view.
pub struct Eye {
    /// Pixels.
    pub size: UVec2,
    /// Where it is, and where it looks to.
    pub place: Transform,
    /// Its lens.
    pub clip_from_view: Mat4,
}

/// A parallelogram or a ball.
pub enum Shape {
    Panel([Vec3; 3]),
    Ball(Vec3, f32),
}

impl Eye {
    /// At a place, towards another; vertical field of view in radians.
    pub fn new(size: UVec2, at: Vec3, target: Vec3, fov: f32) -> Self {
        let aspect = size.x as f32 / size.y as f32;
        let place = Transform::from_translation(at).looking_at(target, Vec3::Y);
        Self { size, place, clip_from_view: Mat4::perspective_infinite_reverse_rh(fov, aspect, NEAR) }
    }

    fn world_from_clip(&self) -> Mat4 {
        self.place.to_matrix() * self.clip_from_view.inverse()
    }

    /// Bevy's view uniform, as far as the shaders read it.
    pub fn uniform(&self) -> Vec<u8> {
        let composed = compose("ssbc/gather.wgsl", &[]).unwrap_or_else(|error| panic!("{error}"));
        let layout = wgsl_layouts(&composed).remove("View").expect("is bound");
        let mut bytes = vec![0; layout.size as usize];
        let mut put = |name: &str, floats: &[f32]| {
            let (_, offset) = layout.members.iter().find(|(member, _)| member == name).expect("is a member");
            let at = *offset as usize;
            bytes[at..at + 4 * floats.len()].copy_from_slice(bytemuck::cast_slice(floats));
        };
        put("world_from_clip", &self.world_from_clip().to_cols_array());
        put("clip_from_world", &self.world_from_clip().inverse().to_cols_array());
        put("unjittered_clip_from_world", &self.world_from_clip().inverse().to_cols_array());
        put("world_from_view", &self.place.to_matrix().to_cols_array());
        put("clip_from_view", &self.clip_from_view.to_cols_array());
        put("world_position", &self.place.translation.to_array());
        put("exposure", &[1.0]);
        bytes.resize(bytes.len().next_multiple_of(16), 0);
        bytes
    }

    /// What it sees of the shapes, each of which sends that much.
    pub fn look(&self, shapes: &[(Shape, Vec3)]) -> GBuffer {
        let lens = Lens::new(self.world_from_clip(), self.size);
        let clip_from_world = self.world_from_clip().inverse();
        let (eye, forward) = (self.place.translation, *self.place.forward());
        let is_parallel = self.clip_from_view.w_axis.w == 1.0;
        let (mut surface, mut radiance) = (Vec::new(), Vec::new());
        for pixel in (0..self.size.y).flat_map(|y| (0..self.size.x).map(move |x| UVec2::new(x, y))) {
            let on_sight = lens.position(pixel.as_vec2() + 0.5, 0.5).0;
            let (eye, direction) = match is_parallel {
                true => (on_sight - forward * forward.dot(on_sight - eye), forward),
                false => (eye, (on_sight - eye).normalize()),
            };
            let hits = shapes.iter().filter_map(|(shape, light)| Some((shape.hit(eye, direction)?, light)));
            let Some(((distance, normal), light)) = hits.min_by(|a, b| a.0.0.total_cmp(&b.0.0)) else {
                surface.push([0; 2]);
                radiance.push(Vec4::ZERO);
                continue;
            };
            let clip = clip_from_world * (eye + direction * distance).extend(1.0);
            let normal = encode_unit(normal);
            surface.push([(clip.z / clip.w).to_bits(), normal]);
            let cosine = (-decode_unit(normal).dot(direction)).max(0.0);
            radiance.push((light * grazing_decay(cosine)).extend(forward.dot(direction) / cosine.max(LEAST_COSINE)));
        }
        GBuffer { size: self.size, lens, surface, radiance }
    }
}

impl Shape {
    /// Distance and normal where a ray meets it from outside.
    fn hit(&self, origin: Vec3, direction: Vec3) -> Option<(f32, Vec3)> {
        match self {
            Shape::Panel([corner, u, v]) => {
                let normal = u.cross(*v).normalize();
                let along = normal.dot(direction);
                let distance = normal.dot(*corner - origin) / along;
                let at = origin + direction * distance - *corner;
                let inside = |edge: &Vec3| (0.0..=1.0).contains(&(at.dot(*edge) / edge.length_squared()));
                (along < 0.0 && distance > NEAR && inside(u) && inside(v)).then_some((distance, normal))
            }
            Shape::Ball(center, radius) => {
                let from = origin - *center;
                let b = from.dot(direction);
                let discriminant = b * b - from.length_squared() + radius * radius;
                let distance = -b - discriminant.max(0.0).sqrt();
                let normal = (from + direction * distance) / *radius;
                (discriminant > 0.0 && distance > NEAR).then_some((distance, normal))
            }
        }
    }
}

fn panel(corner: [f32; 3], u: [f32; 3], v: [f32; 3]) -> Shape {
    Shape::Panel([corner, u, v].map(Vec3::from))
}

/// A room with a ball and a block that touch floor and wall; 4 m a side.
pub fn room() -> Vec<(Shape, Vec3)> {
    let (white, red, blue) = (Vec3::new(1.0, 0.9, 0.8), Vec3::new(0.9, 0.2, 0.1), Vec3::new(0.1, 0.3, 0.8));
    vec![
        (panel([-2.0, 0.0, -2.0], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0]), white),
        (panel([-2.0, 4.0, -2.0], [4.0, 0.0, 0.0], [0.0, 0.0, 4.0]), white * 0.3),
        (panel([-2.0, 0.0, -2.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]), white * 0.5),
        (panel([-2.0, 0.0, 2.0], [0.0, 0.0, -4.0], [0.0, 4.0, 0.0]), red),
        (panel([2.0, 0.0, -2.0], [0.0, 0.0, 4.0], [0.0, 4.0, 0.0]), blue),
        (Shape::Ball(Vec3::new(0.7, 0.5, 0.3), 0.5), white * 0.7),
        (panel([-1.6, 0.0, -0.6], [1.2, 0.0, 0.2], [0.0, 1.7, 0.0]), blue * 2.0),
        (panel([-0.4, 0.0, -0.4], [0.2, 0.0, -1.2], [0.0, 1.7, 0.0]), red * 0.5),
        (panel([-1.6, 1.7, -0.6], [1.2, 0.0, 0.2], [0.2, 0.0, -1.2]), white),
    ]
}

pub fn room_eye(size: UVec2) -> Eye {
    Eye::new(size, Vec3::new(0.0, 2.0, 8.4), Vec3::new(0.0, 2.0, 0.0), 0.65)
}

/// The lowest level of what pixels send.
const FILL: &str = "
    #import bevy_bounce::ssbc::common::surface_texture
    #import bevy_bounce::ssbc::hierarchy::encode_pixel
    @group(0) @binding(3) var radiance_texture: texture_2d<f32>;
    @group(0) @binding(4) var level_0: texture_storage_2d<rgba32uint, write>;
    @compute @workgroup_size(8, 8)
    fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
        if all(id.xy < textureDimensions(surface_texture)) {
            let surface = textureLoad(surface_texture, id.xy, 0).xy;
            let radiance = textureLoad(radiance_texture, id.xy, 0);
            textureStore(level_0, id.xy, select(vec4<u32>(0u), encode_pixel(surface, radiance.a, radiance.rgb), surface.x != 0u));
        }
    }";

/// The shipped shaders, up to the residual at every pixel, or at every second one of every second row.
fn gathered(eye: &Eye, gbuffer: &GBuffer, parameters: SsbcParameters, bound: f32) -> Resources {
    let size = [eye.size.x, eye.size.y, 1];
    let padded = eye.size.map(|pixels| pixels.next_multiple_of(1 << SSBC_LEVELS));
    let samples = eye.size.map(|pixels| pixels.div_ceil(parameters.scale));
    let header = VplHeader { geometry_bound: bound, count: 1, ..Default::default() };
    let levels = ["level_0", "level_1", "level_2", "level_3", "level_4", "level_5", "level_6"];
    let surface = bytemuck::cast_slice(&gbuffer.surface);
    let resources = Resources::new(gpu())
        .bytes("view", &eye.uniform())
        .uniform("parameters", &parameters)
        .structs("header", &[header])
        .uniform("grid", &Grid { voxel_size: 1.0, dims: UVec3::ONE, ..Default::default() })
        .floats("densities", &[bound, 1.0])
        .texture("surface_texture", TextureFormat::Rg32Uint, size, false, surface)
        .texture("radiance_texture", TextureFormat::Rgba16Float, size, false, &half_texels(&gbuffer.radiance))
        .texture("residual_texture", TextureFormat::Rgba16Float, [samples.x, samples.y, 1], false, &[])
        .mips("hierarchy", TextureFormat::Rgba32Uint, padded.to_array(), &levels);
    let kernel = gpu().kernel(&compose_source(FILL, "fill.wgsl", &[]).expect("composes"), "fill");
    gpu().dispatch(&kernel.expect("the device takes it"), &resources, groups(eye.size)).expect("runs");
    let resources = resources.alias("level_0", "source");
    let resources = resources.alias("level_1", "fine").alias("level_2", "middle").alias("level_3", "coarse");
    run_with(gpu(), "ssbc/reduce.wgsl", "reduce", &["FROM_PIXELS"], &resources, groups(padded / 2));
    let resources = resources.alias("level_3", "source");
    let resources = resources.alias("level_4", "fine").alias("level_5", "middle").alias("level_6", "coarse");
    run(gpu(), "ssbc/reduce.wgsl", "reduce", &resources, groups(padded / 16));
    let resources = resources.alias("residual_texture", "output");
    run(gpu(), "ssbc/gather.wgsl", "gather", &resources, groups(samples));
    resources
}

/// Workgroups of 8x8 texels.
pub fn groups(texels: UVec2) -> [u32; 3] {
    texels.map(|texels| texels.div_ceil(8)).extend(1).to_array()
}

pub fn light(resources: &Resources, texture: &str) -> Vec<Vec3> {
    let bytes = resources.read_texture(texture).unwrap_or_else(|error| panic!("{error}"));
    let halves: Vec<f32> = bytes.as_chunks().0.iter().map(|half| half::f16::from_le_bytes(*half).to_f32()).collect();
    halves.chunks(4).map(Vec3::from_slice).collect()
}

/// The residual at every pixel by the shipped shaders.
fn shipped(eye: &Eye, gbuffer: &GBuffer, parameters: SsbcParameters, bound: f32) -> Vec<Vec3> {
    light(&gathered(eye, gbuffer, parameters, bound), "residual_texture")
}

pub fn pixels(size: UVec2) -> impl Iterator<Item = UVec2> {
    (0..size.y).flat_map(move |y| (0..size.x).map(move |x| UVec2::new(x, y)))
}

/// Sum over the pixels, and the root mean square of what they differ by, over the mean of `b`.
fn difference(a: &[Vec3], b: &[Vec3]) -> (f32, f32) {
    let sum = |values: &[Vec3]| values.iter().map(|light| light.element_sum()).sum::<f32>();
    let squares: f32 = a.iter().zip(b).map(|(a, b)| (*a - *b).length_squared()).sum();
    (sum(a) / sum(b), (squares / (3 * a.len()) as f32).sqrt() / (sum(b) / (3 * b.len()) as f32))
}

#[test]
fn the_shipped_integration_equals_its_twin_and_the_flat_sum() {
    let mut eye = room_eye(UVec2::new(320, 180));
    // Off the middle, where seams pass through the middles of pixels: which side of them those are on, rounding would say.
    eye.place.translation += Vec3::new(0.013, 0.007, 0.0);
    let gbuffer = eye.look(&room());
    let hierarchy = Hierarchy::new(&gbuffer);
    for bound in [64.0, 16.0] {
        let ours = shipped(&eye, &gbuffer, PARAMETERS, bound);
        let twin: Vec<Gathered> =
            pixels(eye.size).map(|pixel| gather(&gbuffer, &hierarchy, PARAMETERS, bound, pixel)).collect();
        let flat: Vec<Gathered> = pixels(eye.size).map(|pixel| flat_sum(&gbuffer, bound, pixel)).collect();
        let light = |gathered: &[Gathered]| gathered.iter().map(|g| g.light).collect::<Vec<_>>();
        let samples = |gathered: &[Gathered]| {
            let seen = gathered.iter().filter(|g| g.samples > 0);
            seen.clone().map(|g| g.samples as f32).sum::<f32>() / seen.count() as f32
        };
        let (energy, error) = difference(&ours, &light(&twin));
        println!("bound {bound}: shader over twin {energy:.4}, rms {error:.4}");
        assert!((energy - 1.0).abs() < 0.005 && error < 0.05, "shader against twin: {energy}, {error}");
        let (energy, error) = difference(&light(&twin), &light(&flat));
        let (few, many) = (samples(&twin), samples(&flat));
        println!(
            "bound {bound}: hierarchical over flat {energy:.4}, rms {error:.4}; samples a pixel {few:.1}, {many:.1}"
        );
        assert!((energy - 1.0).abs() < 0.01 && error < 0.1, "hierarchical against flat: {energy}, {error}");
        assert!(few * 5.0 < many, "{few} of {many} samples a pixel");
    }
}

/// Irradiance over pi at a height over a plane of radiance 1 that meets the receiver's at a right angle: the integral of
/// what the geometry term has above the bound, over a strip that holds all of it.
fn perpendicular(height: f32, bound: f32) -> f32 {
    let reach = 1.0 / bound.sqrt();
    let steps = 400;
    // Finer near the edge.
    let at = |i: usize| reach * (i as f32 / steps as f32).powi(2);
    let middle = |i: usize| 0.5 * (at(i) + at(i + 1));
    let mut sum = 0.0;
    for i in 0..steps {
        for j in 0..steps {
            let (up, along) = (middle(i), middle(j));
            let square = height * height + up * up + along * along;
            let term = (height * up / (square * square) - bound).max(0.0);
            sum += 2.0 * term * (at(i + 1) - at(i)) * (at(j + 1) - at(j));
        }
    }
    sum / PI
}

/// Lenses with an oblique near plane, of perspective and without, and where they stand from the world's origin, metres.
fn any_lens(aspect: f32) -> [(&'static str, Mat4, f32); 4] {
    let lens = |fov: f32| PerspectiveProjection { fov, aspect_ratio: aspect, ..Default::default() };
    let near_clip_plane = Vec3::new(0.2, 0.3, -1.0).normalize().extend(-0.1);
    let oblique = PerspectiveProjection { near_clip_plane, ..lens(0.6) }.get_clip_from_view();
    let parallel = Mat4::orthographic_rh(-0.5 * aspect, 0.5 * aspect, -0.5, 0.5, 20.0, 0.1);
    let wide = lens(0.6).get_clip_from_view();
    [("oblique", oblique, 0.0), ("parallel", parallel, 0.0), ("far", wide, 2e3), ("parallel, far", parallel, 2e3)]
}

/// A place so far from the world's origin, turned such that no axis is along one of the world's, and an eye that looks at it.
fn turned_place(size: UVec2, clip_from_view: Mat4, away: f32) -> (Transform, Eye) {
    let at = Transform::from_translation(away * Vec3::new(1.0, 0.1, -0.7));
    let at = at.with_rotation(Quat::from_rotation_y(0.7) * Quat::from_rotation_x(0.4));
    let place = at * Transform::from_xyz(0.0, 1.6, 1.6).looking_at(Vec3::ZERO, Vec3::Y);
    (at, Eye { size, place, clip_from_view })
}

/// Of radiance 1, at right angles; they meet along the x axis of a place.
fn floor_and_wall(at: Transform) -> [(Shape, Vec3); 2] {
    let [x, y, z] = [4.0 * at.right(), 2.0 * at.up(), 2.0 * at.back()];
    let part = |a, b| (Shape::Panel([at.translation - 0.5 * x, a, b]), Vec3::ONE);
    [part(z, x), part(x, y)]
}

/// The residual on the floor, by its distance from the wall, is that of the closed form through any lens.
#[test]
fn any_lens_gives_back_what_the_bound_takes() {
    let bound = 30f32;
    let reach = 0.58 / bound.sqrt();
    for (name, clip_from_view, away) in any_lens(1.0) {
        let (at, eye) = turned_place(UVec2::new(150, 150), clip_from_view, away);
        let gbuffer = eye.look(&floor_and_wall(at));
        let residual = shipped(&eye, &gbuffer, PARAMETERS, bound);
        let (mut ours, mut expected) = (0.0, 0.0);
        for pixel in pixels(eye.size).filter(|pixel| (70..80).contains(&pixel.x)) {
            let Some((position, normal, _)) = gbuffer.surface_at(pixel) else { continue };
            let from_wall = (position - at.translation).dot(*at.back());
            if normal.dot(*at.up()) > 0.9 && from_wall < reach {
                ours += residual[(pixel.y * eye.size.x + pixel.x) as usize].x;
                expected += perpendicular(from_wall, bound);
            }
        }
        println!("{name}: residual {ours:.3}, integral {expected:.3}");
        assert!(expected > 1.0 && (ours / expected - 1.0).abs() < 0.08, "{name}: {ours} against {expected}");
    }
}

/// Floor and wall of radiance 1: the residual on the floor by its distance from the wall.
#[test]
fn two_squares_give_back_what_the_bound_takes() {
    let eye = Eye::new(UVec2::new(256, 256), Vec3::new(0.0, 1.6, 1.6), Vec3::ZERO, 0.6);
    let gbuffer = eye.look(&floor_and_wall(Transform::IDENTITY));
    let bound = 30f32;
    let reach = 0.58 / bound.sqrt();
    let on_floor = |pixel: &UVec2| gbuffer.surface_at(*pixel).filter(|(_, normal, _)| normal.y > 0.9);
    let floor: Vec<(UVec2, f32)> = pixels(eye.size)
        .filter(|pixel| (120..136).contains(&pixel.x))
        .filter_map(|pixel| on_floor(&pixel).map(|(position, ..)| (pixel, position.z)))
        .collect();
    let expected: f32 = floor.iter().filter(|(_, z)| *z < reach).map(|(_, z)| perpendicular(*z, bound)).sum();
    let fine = SsbcParameters { solid_angle: 0.01, edge_solid_angle: 0.01, ..PARAMETERS };
    for (parameters, tolerance) in [(PARAMETERS, 0.07), (fine, 0.03)] {
        let residual = shipped(&eye, &gbuffer, parameters, bound);
        let light = |pixel: UVec2| residual[(pixel.y * eye.size.x + pixel.x) as usize].x;
        let ours: f32 = floor.iter().filter(|(_, z)| *z < reach).map(|(pixel, _)| light(*pixel)).sum();
        println!("{} sr: residual {ours:.3}, integral {expected:.3}", parameters.solid_angle);
        assert!(expected > 1.0 && (ours / expected - 1.0).abs() < tolerance, "{ours} against {expected}");
        // A wall fills half of the hemisphere at most.
        assert!(floor.iter().all(|(pixel, _)| light(*pixel) < 0.5), "the singularity is back");
        // The geometry term of perpendicular surfaces is at most 0.325 / distance^2.
        assert!(floor.iter().all(|(pixel, z)| *z < reach || light(*pixel) < 1e-3), "light where nothing is bounded");
    }
}

/// Rows next to a seam that passes their pixels at every height and in every direction.
#[test]
fn pixels_at_a_seam_get_what_they_lost() {
    let (bound, footprint) = (30f32, 0.012);
    let (mut count, mut sum, mut worst) = (0, 0.0, 0f32);
    for roll in [0.03, 0.4, 0.785, 1.2, 2.3] {
        let floor = panel([-2.0, 0.0, 0.0], [0.0, 0.0, 2.0], [4.0, 0.0, 0.0]);
        let wall = panel([-2.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 2.0, 0.0]);
        let mut eye = Eye::new(UVec2::new(96, 96), Vec3::new(0.0, 1.1, 1.6), Vec3::ZERO, 0.45);
        eye.place.rotate_local_z(roll);
        let gbuffer = eye.look(&[(floor, Vec3::ONE), (wall, Vec3::ONE)]);
        let residual = shipped(&eye, &gbuffer, PARAMETERS, bound);
        for (pixel, light) in pixels(eye.size).zip(residual) {
            let Some((position, normal, _)) = gbuffer.surface_at(pixel) else { continue };
            let height = if normal.y > 0.9 { position.z } else { position.y };
            if height < 2.0 * footprint && pixel.as_vec2().distance(Vec2::splat(48.0)) < 40.0 {
                let error = light.x / perpendicular(height, bound) - 1.0;
                (count, sum, worst) = (count + 1, sum + error, worst.max(error.abs()));
            }
        }
    }
    let mean = sum / count as f32;
    println!("{count} pixels, mean error {mean:.3}, worst {worst:.3}");
    assert!(count > 1000 && mean.abs() < 0.05 && worst < 0.15, "{count} pixels, mean error {mean}, worst {worst}");
}

/// The edge of a pixel by the closed form: of lenses that are straight, parallel, of a part of a view and with an
/// oblique near plane, far from the world's origin.
#[test]
fn footprints_are_those_of_the_lens() {
    let (size, fov) = (UVec2::new(32, 18), 0.7f32);
    let aspect = size.x as f32 / size.y as f32;
    let straight = PerspectiveProjection { fov, aspect_ratio: aspect, near: NEAR, ..default() };
    let near_clip_plane = Vec3::new(0.2, 0.3, -1.0).normalize().extend(-NEAR);
    let oblique = PerspectiveProjection { near_clip_plane, ..straight.clone() };
    let part = SubCameraView { full_size: 2 * size, offset: Vec2::new(30.0, 4.0), size };
    let edge = 2.0 * (0.5 * fov).tan() / size.y as f32;
    let lenses = [
        ("straight", straight.get_clip_from_view(), edge),
        ("part", straight.get_clip_from_view_for_sub(&part), 0.5 * edge),
        ("oblique", oblique.get_clip_from_view(), edge),
        ("parallel", Mat4::orthographic_rh(-1.6, 1.6, -0.9, 0.9, 50.0, NEAR), 0.0),
    ];
    let source = "
        #import bevy_bounce::ssbc::common::{surface_texture, surface_at, view_lens}
        @group(0) @binding(3) var<storage, read_write> footprints: array<f32>;
        @compute @workgroup_size(8, 8)
        fn measure(@builtin(global_invocation_id) id: vec3<u32>) {
            let size = textureDimensions(surface_texture);
            if all(id.xy < size) {
                footprints[id.y * size.x + id.x] = surface_at(view_lens(), id.xy).footprint;
            }
        }";
    let kernel = gpu().kernel(&compose_source(source, "measure.wgsl", &[]).expect("composes"), "measure");
    let kernel = kernel.expect("the device takes it");
    for (name, clip_from_view, edge) in lenses {
        let at = Vec3::new(100.0, 20.0, -40.0);
        let place = Transform::from_translation(at).looking_at(at + Vec3::new(0.3, -1.0, -1.0), Vec3::Y);
        let eye = Eye { size, place, clip_from_view };
        let floor = (panel([60.0, 17.0, -80.0], [0.0, 0.0, 80.0], [80.0, 0.0, 0.0]), Vec3::ONE);
        let gbuffer = eye.look(&[floor]);
        let resources = Resources::new(gpu())
            .bytes("view", &eye.uniform())
            .texture(
                "surface_texture",
                TextureFormat::Rg32Uint,
                [size.x, size.y, 1],
                false,
                bytemuck::cast_slice(&gbuffer.surface),
            )
            .floats("footprints", &vec![0.0; size.element_product() as usize]);
        gpu().dispatch(&kernel, &resources, groups(size)).expect("runs");
        let footprints = resources.read_floats("footprints").unwrap_or_else(|error| panic!("{error}"));
        let mut seen = 0;
        for (pixel, footprint) in pixels(size).zip(footprints) {
            let Some((position, ..)) = gbuffer.surface_at(pixel) else { continue };
            let depth = (position - at).dot(*place.forward());
            let expected = if edge > 0.0 { edge * depth } else { 1.8 / size.y as f32 };
            seen += 1;
            assert!((footprint / expected - 1.0).abs() < 0.01, "{name}, {pixel}: {footprint}, expected {expected}");
        }
        assert!(seen > 100, "{name}: {seen} pixels of the floor");
    }
}

/// An edge that turns away loses nothing to the bound, wherever it passes its pixels.
#[test]
fn convex_edges_get_nothing() {
    for (azimuth, elevation, roll) in
        [(1.1f32, 0.4f32, 0.0), (1.1, 0.4, 0.3), (1.2, 0.6, 0.2), (1.0, 0.8, 1.0), (0.0, 0.6, 0.0)]
    {
        let top = panel([-1.0, 0.0, -1.0], [0.0, 0.0, 1.0], [2.0, 0.0, 0.0]);
        let front = panel([-1.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let toward = Vec3::new(elevation.cos() * azimuth.sin(), elevation.sin(), elevation.cos() * azimuth.cos());
        let mut eye = Eye::new(UVec2::new(160, 160), 2.4 * toward, Vec3::ZERO, 0.4);
        eye.place.rotate_local_z(roll);
        let gbuffer = eye.look(&[(top, Vec3::ONE), (front, Vec3::ONE)]);
        let most = shipped(&eye, &gbuffer, PARAMETERS, 30.0).iter().fold(0f32, |most, light| most.max(light.x));
        assert!(most < 1e-3, "{most} of a radiance of 1 from {azimuth}, {elevation}, turned by {roll}");
    }
}

/// What a pixel sends: emission, direct light, bounced light times diffuse colour and occlusion; its area.
#[test]
fn a_pixel_sends_all_but_specular_light() {
    let eye = Eye::new(UVec2::new(4, 4), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, -1.0), FRAC_PI_2);
    let gbuffer = eye.look(&[(panel([-9.0, 0.0, -9.0], [0.0, 0.0, 18.0], [18.0, 0.0, 0.0]), Vec3::ONE)]);
    // Base colour 0.5 (gamma 2.2), emission 2 (rgb9e5: 256 * 2^(17 - 24)), metallic 0.2, occlusion 0.6.
    let base = u32::from((0.5f32.powf(1.0 / 2.2) * 255.0).round() as u8) * 0x010101;
    let emission = (256 | 256 << 9 | 256 << 18) | 17 << 27;
    let deferred = [base, emission, 51 << 8 | 153 << 16, 0].repeat(16);
    let light = |value: f32| half_texels(&[Vec4::splat(value); 16]);
    let resources = Resources::new(gpu())
        .bytes("view", &eye.uniform())
        .uniform("parameters", &PARAMETERS)
        .texture("surface_texture", TextureFormat::Rg32Uint, [4, 4, 1], false, bytemuck::cast_slice(&gbuffer.surface))
        .texture("residual", TextureFormat::Rgba16Float, [4, 4, 1], false, &light(1.0))
        .texture("deferred_texture", TextureFormat::Rgba32Uint, [4, 4, 1], false, bytemuck::cast_slice(&deferred))
        .texture("direct_diffuse", TextureFormat::Rgba16Float, [4, 4, 1], false, &light(3.0))
        .texture("indirect", TextureFormat::Rgba16Float, [4, 4, 1], false, &light(10.0))
        .texture("output", TextureFormat::Rgba32Uint, [4, 4, 1], false, &[]);
    let reflected = 0.5 * 0.8 * 0.6;
    for (defs, bounced) in [(&[] as &[&str], 10.0), (&["COMPENSATED"], 11.0)] {
        run_with(gpu(), "ssbc/radiance.wgsl", "radiance", defs, &resources, [1, 1, 1]);
        let texels = resources.read_texture("output").unwrap_or_else(|error| panic!("{error}"));
        let words: Vec<u32> = texels.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
        for (node, expected) in words.chunks(4).zip(&gbuffer.radiance) {
            let (light, area) = (rgb9e5_to_vec3(node[3]), half::f16::from_bits(node[2] as u16).to_f32());
            let sent = if expected.w > 0.0 { 2.0 + 3.0 + bounced * reflected } else { 0.0 };
            assert!((light - sent).abs().max_element() < 0.02, "{light}, expected {sent}");
            assert!((area - expected.w).abs() < 0.01 * expected.w.max(1e-3), "area {area} not {}", expected.w);
        }
    }
}
