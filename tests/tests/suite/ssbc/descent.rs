//! The way of bias compensation through its levels: every pixel of a disc, and each once.

use bevy::math::{UVec2, Vec2};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};
use wgpu::TextureFormat;

use super::pixels;

/// Takes every texel apart, and counts how often it comes to each pixel; one thread a disc.
const WALK: &str = "
    #import bevy_bounce::ssbc::common::{surface_texture, Disc}
    #import bevy_bounce::ssbc::integrate::{roots_of, walk_of, block_after, next, take_apart}
    @group(0) @binding(9) var<storage, read> discs: array<vec4<f32>>;
    @group(0) @binding(10) var<storage, read_write> counts: array<u32>;
    @compute @workgroup_size(1)
    fn walk(@builtin(workgroup_id) id: vec3<u32>) {
        let size = vec2<i32>(textureDimensions(surface_texture));
        let disc = Disc(discs[id.x].xy, discs[id.x].zw, 1.0 / discs[id.x].zw);
        let roots = roots_of(disc);
        for (var block = roots.low; block.y < roots.end.y; block = block_after(block, roots)) {
            var walk = walk_of(block, roots, disc);
            while walk.pending != 0u {
                let place = next(&walk);
                if place.level == roots.level && any(place.corner >= size) {
                    // No such texel: the first pixel shows it.
                    counts[i32(id.x) * size.x * size.y] += 2u;
                }
                if place.level > 0u {
                    take_apart(&walk, place, disc);
                } else if all(place.corner < size) {
                    counts[i32(id.x) * size.x * size.y + place.corner.y * size.x + place.corner.x] += 1u;
                }
            }
        }
    }";

/// From roots of a pixel to several rows of the coarsest, and from the middle of the picture to beyond each of its edges.
fn discs() -> Vec<(Vec2, Vec2)> {
    let radii =
        [(0.2, 0.3), (0.4, 0.4), (0.7, 2.1), (5.0, 9.0), (13.0, 1.0), (20.0, 31.0), (60.0, 45.0), (200.0, 90.0)];
    let middles = [(75.3, 44.8), (0.1, 0.2), (149.9, 89.7), (64.0, 32.0), (-20.0, 50.0), (75.0, -8.0), (170.0, 100.0)];
    let disc = |radius| middles.map(|middle| (Vec2::from(middle), Vec2::from(radius)));
    radii.into_iter().flat_map(disc).collect()
}

#[test]
fn every_pixel_of_a_disc_is_met_once() {
    // No multiple of any texel that is larger than two pixels.
    let size = UVec2::new(150, 90);
    let discs = discs();
    let floats: Vec<f32> = discs.iter().flat_map(|(middle, radius)| [middle.x, middle.y, radius.x, radius.y]).collect();
    let pixel_count = size.element_product() as usize;
    let resources = Resources::new(gpu())
        .texture("surface_texture", TextureFormat::Rg32Uint, [size.x, size.y, 1], false, &[])
        .floats("discs", &floats)
        .zeroed("counts", discs.len() * pixel_count);
    let kernel = gpu().kernel(&compose_source(WALK, "walk.wgsl", &[]).expect("composes"), "walk");
    let kernel = kernel.expect("the device takes it");
    gpu().dispatch(&kernel, &resources, [discs.len() as u32, 1, 1]).expect("runs");
    let counts = resources.read_words("counts").unwrap_or_else(|error| panic!("{error}"));
    let mut met = 0;
    for ((middle, radius), counts) in discs.into_iter().zip(counts.chunks(pixel_count)) {
        for (pixel, count) in pixels(size).zip(counts) {
            let away = (pixel.as_vec2() + 0.5 - middle).abs() - 0.5;
            let away = (away.max(Vec2::ZERO) / radius).length_squared();
            // Nearer to the edge of the disc rounding says which side it is on.
            if (away - 1.0).abs() > 1e-4 {
                assert_eq!(*count, u32::from(away < 1.0), "{pixel} of a disc of {radius} round {middle}");
                met += count;
            }
        }
    }
    assert!(met > 50_000, "{met} pixels of all discs");
}
