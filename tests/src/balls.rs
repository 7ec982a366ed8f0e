//! The balls of `assets/glossy_box.glb` in a picture and its reference.

use bevy::prelude::*;
use bevy_bounce_examples::glb::GlossyBalls;
use bevy_bounce_examples::scenes::CornellBox;

use crate::picture::{Picture, luminance};

/// What GGX of the balls' roughness reflects of white light in one bounce where all of it would be reflected: its mean over the hemisphere,
/// weighted by the cosine, by quadrature.
const WHITE_ONCE: [f32; 4] = [0.998, 0.977, 0.881, 0.604];

/// What a plastic ball sends of even light by the lobes that Bevy lights by environment maps with, over what it sends by the path tracer's:
/// mean of the ball as it is seen, by Bevy's split-sum formula and by a path-traced picture of the ball alone.
const PLASTIC: [f32; 4] = [0.943, 0.935, 0.934, 0.929];

/// Light of a ball over the reference's.
#[derive(Clone, Copy, Debug)]
pub struct BallRatio {
    /// 0 or 1.
    pub metallic: f32,
    /// Perceptual.
    pub roughness: f32,
    /// Of its mean luminance, but for what the two models of its material do not have in common.
    pub ratio: f32,
    /// Of its mean luminance.
    pub raw: f32,
}

/// All balls.
///
/// The path tracer's GGX reflects once: what bounces on in the relief of a rough metal is lost to it, and comes out again here, as in
/// Bevy's own light. Its plastic adds the gloss to a diffuse colour that is not diminished by what is reflected before, and reflects by the
/// exact Fresnel term, which at sixty degrees is a fifth above Schlick's. Either is left out of the ratio by what it is in even light.
pub fn ball_ratios(picture: &Picture, reference: &Picture) -> Vec<BallRatio> {
    let mut ratios = Vec::new();
    for (row, (metallic, albedo, _)) in GlossyBalls::ROWS.into_iter().enumerate() {
        for (column, roughness) in GlossyBalls::ROUGHNESS.into_iter().enumerate() {
            let light = |picture: &Picture| ball_light(picture, GlossyBalls::center(row, column));
            let metal = 1.0 - (1.0 - WHITE_ONCE[column]) * (albedo + (1.0 - albedo) / 21.0);
            let common = if metallic > 0.0 { metal } else { 1.0 / PLASTIC[column] };
            let raw = (light(picture) / light(reference)) as f32;
            let ratio = common * raw;
            println!("metallic {metallic}, roughness {roughness}: {ratio:.3}, as it is {raw:.3}");
            ratios.push(BallRatio { metallic, roughness, ratio, raw });
        }
    }
    ratios
}

/// Mean luminance of a ball, as seen by the box's camera.
fn ball_light(picture: &Picture, center: Vec3) -> f64 {
    let size = Vec2::new(picture.width as f32, picture.height as f32);
    let half = (0.5 * CornellBox::FIELD_OF_VIEW).tan() * Vec2::new(size.x / size.y, 1.0);
    let to_ball = center - CornellBox::EYE;
    let shows = |i: usize| {
        let pixel = Vec2::new((i % picture.width) as f32, (i / picture.width) as f32) + 0.5;
        let place = (2.0 * pixel / size - 1.0) * half * Vec2::new(1.0, -1.0);
        let direction = place.extend(-1.0).normalize();
        to_ball.cross(direction).length() < GlossyBalls::RADIUS
    };
    let light: Vec<f64> =
        (0..picture.pixels.len()).filter(|i| shows(*i)).map(|i| luminance(picture.pixels[i])).collect();
    light.iter().sum::<f64>() / light.len() as f64
}
