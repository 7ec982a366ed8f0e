//! The shipped shader on its own: where it looks for the last frame, and what it believes of it.

use bevy::math::{Mat4, UVec2, Vec2, Vec3, Vec4};
use bevy_bounce_shaders::types::HistoryParameters;
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::run;
use bevy_bounce_tests::twins::ssbc::{GBuffer, half_texels};
use half::f16;
use wgpu::TextureFormat;

use crate::ssbc::{Eye, Shape, room};

const SIZE: UVec2 = UVec2::new(160, 90);
const BALL: usize = 5;
/// Pixels of the back wall, some to the right of each.
const PIXELS: [usize; 3] = [40 * 160 + 60, 45 * 160 + 60, 50 * 160 + 60];
/// Frames that the past is averaged over, and the limit.
const COUNT: f32 = 7.0;
const FRAMES: f32 = 8.0;

/// A frame: where it is seen from, and where the ball is.
#[derive(Clone, Copy)]
struct Frame {
    at: Vec3,
    target: Vec3,
    ball: Vec3,
    /// Pixels.
    jitter: Vec2,
}

const FIRST: Frame = Frame {
    at: Vec3::new(0.0, 2.0, 8.4),
    target: Vec3::new(0.0, 2.0, 0.0),
    ball: Vec3::new(0.7, 0.5, 0.3),
    jitter: Vec2::ZERO,
};

impl Frame {
    fn unjittered(&self) -> Eye {
        Eye::new(SIZE, self.at, self.target, 0.65)
    }

    /// As Bevy's `TemporalJitter` has it.
    fn eye(&self) -> Eye {
        let mut eye = self.unjittered();
        let offset = self.jitter * Vec2::new(2.0, -2.0) / SIZE.as_vec2();
        eye.clip_from_view.z_axis += offset.extend(0.0).extend(0.0);
        eye
    }

    fn look(&self) -> GBuffer {
        let mut shapes = room();
        shapes[BALL].0 = Shape::Ball(self.ball, 0.5);
        self.eye().look(&shapes)
    }

    fn clip_from_world(eye: &Eye) -> Mat4 {
        eye.clip_from_view * eye.place.to_matrix().inverse()
    }

    fn uv(&self, position: Vec3) -> Vec2 {
        let clip = Self::clip_from_world(&self.unjittered()) * position.extend(1.0);
        clip.truncate().truncate() / clip.w * Vec2::new(0.5, -0.5) + 0.5
    }

    /// Where a point of the ball is in another frame; other points stay.
    fn in_frame(&self, position: Vec3, other: &Self) -> Vec3 {
        if self.is_ball(position) { position - self.ball + other.ball } else { position }
    }

    fn is_ball(&self, position: Vec3) -> bool {
        (position.distance(self.ball) - 0.5).abs() < 1e-3
    }
}

fn position(gbuffer: &GBuffer, i: usize) -> Vec3 {
    let pixel = UVec2::new(i as u32 % SIZE.x, i as u32 / SIZE.x).as_vec2() + 0.5;
    gbuffer.lens.position(pixel, f32::from_bits(gbuffer.surface[i][0])).0
}

/// Light that varies softly over the room, and on the ball with the ball.
fn light(frame: &Frame, position: Vec3) -> Vec3 {
    let p = frame.in_frame(position, &FIRST);
    0.5 + 0.2 * Vec3::new((p.x + 0.5 * p.z).sin(), (0.7 * p.y).cos(), (p.z - 0.3 * p.x).sin())
}

fn lights(frame: &Frame, gbuffer: &GBuffer, scale: f32, count: f32) -> Vec<Vec4> {
    let texel = |i: usize| match gbuffer.surface[i][0] {
        0 => Vec4::ZERO,
        _ => (scale * light(frame, position(gbuffer, i))).extend(count),
    };
    (0..gbuffer.surface.len()).map(texel).collect()
}

/// The word of `history/surfaces.wgsl`, by the shipped shader.
fn seen(gbuffer: &GBuffer) -> Resources {
    let size = [SIZE.x, SIZE.y, 1];
    let resources = Resources::new(gpu())
        .texture("surface_texture", TextureFormat::Rg32Uint, size, false, bytemuck::cast_slice(&gbuffer.surface))
        .texture("averaged", TextureFormat::Rgba16Float, size, false, &[])
        .texture("light", TextureFormat::Rgba16Float, size, false, &[])
        .texture("kept_light", TextureFormat::Rgba16Float, size, false, &[])
        .texture("past_surfaces", TextureFormat::R32Uint, size, false, &[])
        .alias("past_surfaces", "kept_surfaces");
    let groups = [SIZE.x.div_ceil(8), SIZE.y.div_ceil(8), 1];
    bevy_bounce_tests::scene::run_with(gpu(), "history/keep.wgsl", "keep", &["LAST"], &resources, groups);
    resources
}

/// What the second frame makes of its light and of the first one's.
fn average(first: &Frame, second: &Frame, past: &[Vec4], now: &[Vec4], exposure: f32) -> Vec<Vec4> {
    let size = [SIZE.x, SIZE.y, 1];
    let (before, after) = (first.look(), second.look());
    let previous = Frame::clip_from_world(&first.eye());
    let parameters = HistoryParameters {
        previous_clip_from_world: previous,
        previous_world_from_clip: previous.inverse(),
        previous_unjittered_clip_from_world: Frame::clip_from_world(&first.unjittered()),
        exposure,
        frames: FRAMES,
        valid: 1,
        leniency: 0.0,
    };
    let motion = (0..after.surface.len()).flat_map(|i| {
        let now = position(&after, i);
        let moved = second.uv(now) - first.uv(second.in_frame(now, first));
        moved.to_array().map(|c| f16::from_f32(c).to_le_bytes()).concat()
    });
    let motion: Vec<u8> = motion.collect();
    let mut view = second.eye();
    let jittered = view.uniform();
    view.clip_from_view = second.unjittered().clip_from_view;
    // The matrix without jitter is the second of the uniform.
    let view = [&jittered[..64], &view.uniform()[64..128], &jittered[128..]].concat();
    let resources = seen(&before)
        .bytes("view", &view)
        .uniform("parameters", &parameters)
        .texture("surface_texture", TextureFormat::Rg32Uint, size, false, bytemuck::cast_slice(&after.surface))
        .texture("motion_texture", TextureFormat::Rg16Float, size, false, &motion)
        .texture("past_light", TextureFormat::Rgba16Float, size, false, &half_texels(past))
        .texture("light_texture", TextureFormat::Rgba16Float, size, false, &half_texels(now))
        .texture("output", TextureFormat::Rgba16Float, size, false, &[]);
    let groups = [SIZE.x.div_ceil(8), SIZE.y.div_ceil(8), 1];
    run(gpu(), "history/average.wgsl", "average", &resources, groups);
    let bytes = resources.read_texture("output").unwrap_or_else(|error| panic!("{error}"));
    let half = |bytes: &[u8]| f16::from_le_bytes([bytes[0], bytes[1]]).to_f32();
    bytes.chunks_exact(8).map(|texel| Vec4::from_array(std::array::from_fn(|c| half(&texel[2 * c..])))).collect()
}

/// Whether the first frame saw that point, and whether no edge was near.
fn was_seen(first: &Frame, before: &GBuffer, point: Vec3, normal: Vec3) -> Option<bool> {
    let clip = Frame::clip_from_world(&first.eye()) * point.extend(1.0);
    let uv = clip.truncate().truncate() / clip.w * Vec2::new(0.5, -0.5) + 0.5;
    let place = (uv * SIZE.as_vec2() - 0.5).round().as_ivec2();
    let mut on_surface = [0; 2];
    for (x, y) in (-2..=2).flat_map(|y| (-2..=2).map(move |x| (x, y))) {
        let (x, y) = (place.x + x, place.y + y);
        if x < 0 || y < 0 || x >= SIZE.x as i32 || y >= SIZE.y as i32 {
            return None;
        }
        let there = position(before, (y * SIZE.x as i32 + x) as usize);
        on_surface[usize::from(normal.dot(there - point).abs() < 0.02 && there.distance(point) < 0.5)] += 1;
    }
    match on_surface {
        [0, _] => Some(true),
        [_, 0] => Some(false),
        _ => None,
    }
}

/// Two percent more light than in the last frame: an eighth of that shows where the surface was seen, all of it where not.
fn found(name: &str, first: Frame, second: Frame) {
    let (before, after) = (first.look(), second.look());
    let past = lights(&first, &before, 1.0, COUNT);
    let now = lights(&second, &after, 1.02, 1.0);
    let result = average(&first, &second, &past, &now, 1.0);
    let (mut known, mut unknown, mut lost) = (0, 0, 0);
    for (i, texel) in result.iter().enumerate().filter(|(i, _)| after.surface[*i][0] != 0) {
        let point = position(&after, i);
        let expected = light(&second, point);
        let gain = (texel.truncate() / expected - 1.0).max_element();
        let normal = bevy_bounce_tests::twins::decode_unit(after.surface[i][1]);
        match was_seen(&first, &before, second.in_frame(point, &first), normal) {
            // Surfaces that are bent or seen at a grazing angle may lose a pixel here and there.
            Some(true) if texel.w > 1.5 => {
                assert!((gain - 0.02 / FRAMES).abs() < 0.003, "{name}, pixel {i}: {gain} more, {texel}");
                known += 1;
            }
            Some(true) => lost += 1,
            Some(false) => {
                assert!((gain - 0.02).abs() < 0.002 && texel.w == 1.0, "{name}, pixel {i}: {gain} more, {texel}");
                unknown += 1;
            }
            None => {}
        }
    }
    println!("{name}: {known} pixels found, {lost} lost, {unknown} not seen before");
    assert!(known > 2500 && lost * 50 < known, "{name}: {known} found, {lost} lost");
    assert!(unknown > 0 || first.ball == second.ball, "{name}: nothing was hidden");
}

#[test]
fn surfaces_are_found_where_they_were() {
    found("at rest", FIRST, FIRST);
    found("a step aside", FIRST, Frame { at: FIRST.at + Vec3::new(0.4, 0.1, -0.3), ..FIRST });
    let turned = Frame { target: Vec3::new(0.6, 1.8, 0.0), ..FIRST };
    found("a turn", Frame { at: FIRST.at + Vec3::new(0.3, 0.0, 0.0), ..FIRST }, turned);
    let jittered = |x, y| Frame { jitter: Vec2::new(x, y), ..FIRST };
    found("jitter", jittered(0.4, -0.3), jittered(-0.45, 0.35));
    let rolled = Frame { ball: FIRST.ball + Vec3::new(-0.4, 0.0, 0.1), ..FIRST };
    found("a ball that moved", FIRST, rolled);
    found("both", FIRST, Frame { at: FIRST.at + Vec3::new(0.2, 0.2, 0.0), jitter: Vec2::splat(0.3), ..rolled });
}

/// Nothing that is not finite stays, from neither frame; nothing else is lost.
#[test]
fn what_is_not_finite_does_not_persist() {
    let gbuffer = FIRST.look();
    let mut past = lights(&FIRST, &gbuffer, 1.0, COUNT);
    let mut now = past.clone();
    for (i, bad) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().enumerate() {
        past[PIXELS[0] + 7 * i].y = bad;
        now[PIXELS[1] + 7 * i].x = bad;
    }
    past[PIXELS[2]].w = f32::NAN;
    let result = average(&FIRST, &FIRST, &past, &now, 1.0);
    for (i, texel) in result.iter().enumerate().filter(|(i, _)| gbuffer.surface[*i][0] != 0) {
        let expected = light(&FIRST, position(&gbuffer, i));
        assert!(
            texel.is_finite() && (texel.truncate() / expected - 1.0).abs().max_element() < 0.002,
            "pixel {i}: {texel}"
        );
    }
    let kept = PIXELS.map(|i| result[i].w);
    assert_eq!((kept[0], kept[2]), (1.0, 1.0), "what was not finite is forgotten");
    assert!(kept[1] >= 1.0, "what is not finite is replaced by what was known");
}

/// What changes much shows at once, whatever was known; what was not lit stays black.
#[test]
fn what_changes_shows_at_once() {
    let gbuffer = FIRST.look();
    let past = lights(&FIRST, &gbuffer, 1.0, COUNT);
    for scale in [0.0, 0.5, 0.9, 1.15, 3.0] {
        let now = lights(&FIRST, &gbuffer, scale, 1.0);
        let result = average(&FIRST, &FIRST, &past, &now, 1.0);
        // The standard deviation of the light around a pixel counts, too: the steepest of it is let go.
        let late = result.iter().zip(&now).filter(|(texel, now)| {
            (texel.truncate() - now.truncate()).abs().max_element() > 0.001 * now.max_element().max(0.01)
        });
        let late = late.count();
        println!("{scale}: {late} of {} pixels are late", result.len());
        assert!(late * 100 < result.len(), "{scale}: {late} pixels are late");
    }
    // The same light in another exposure is the same.
    let now = lights(&FIRST, &gbuffer, 4.0, 1.0);
    let result = average(&FIRST, &FIRST, &past, &now, 4.0);
    let forgotten = result.iter().zip(&past).filter(|(texel, past)| texel.w < past.w).count();
    assert_eq!(forgotten, 0, "a change of exposure is taken for one of light");
}
