//! From the residual's own texels to pixels: upsampled or blurred, and integrated anew where that fails.

use std::collections::HashSet;

use bevy::math::{UVec2, UVec3, Vec2, Vec3};
use bevy_bounce_shaders::types::{CompactVpl, Grid, SSBC_REPAIR_HEADER, SsbcParameters, TENT_REACH, VplHeader};
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::{run, run_with};
use bevy_bounce_tests::twins::ssbc::{GBuffer, half_texels};
use wgpu::TextureFormat;

use super::{
    Eye, PARAMETERS, Shape, any_lens, difference, floor_and_wall, gathered, groups, light, panel, pixels, room,
    room_eye, shipped, turned_place,
};

/// The pixels in the list of those to be integrated anew, by number.
fn listed(resources: &Resources, size: UVec2) -> HashSet<usize> {
    let repairs = resources.read_words("repairs").unwrap_or_else(|error| panic!("{error}"));
    let (header, pixels) = repairs.split_at(SSBC_REPAIR_HEADER as usize);
    let listed: HashSet<usize> =
        pixels[..header[3] as usize].iter().map(|word| ((word >> 16) * size.x + (word & 0xffff)) as usize).collect();
    assert_eq!(listed.len(), header[3] as usize, "a pixel is listed twice");
    assert_eq!(header[0], header[3].div_ceil(64), "workgroups for {} pixels", header[3]);
    listed
}

/// From a quarter of the pixels to all of them: how many were integrated anew, and the sum over that at all pixels.
fn spread(shapes: &[(Shape, Vec3)], bound: f32) -> (usize, f32) {
    // Not a multiple of the samples' step, nor of a workgroup.
    let eye = room_eye(UVec2::new(301, 167));
    let gbuffer = eye.look(shapes);
    let exact = shipped(&eye, &gbuffer, PARAMETERS, bound);
    let pixel_count = eye.size.element_product() as usize;
    let resources = gathered(&eye, &gbuffer, SsbcParameters { scale: 2, ..PARAMETERS }, bound)
        .texture("spread", TextureFormat::Rgba16Float, [eye.size.x, eye.size.y, 1], false, &[])
        .alias("spread", "output")
        .zeroed("repairs", SSBC_REPAIR_HEADER as usize + pixel_count);
    run(gpu(), "ssbc/spread.wgsl", "spread", &resources, groups(eye.size.map(|pixels| pixels.div_ceil(2))));
    let listed = listed(&resources, eye.size);
    let repair_groups = (listed.len() as u32).div_ceil(64).max(1);
    run(gpu(), "ssbc/repair.wgsl", "repair", &resources, [repair_groups, 1, 1]);
    let spread = light(&resources, "spread");
    for (i, pixel) in pixels(eye.size).enumerate() {
        if listed.contains(&i) {
            assert_eq!(spread[i], exact[i], "{pixel}");
        } else if pixel % 2 == UVec2::ZERO {
            assert!((spread[i] - exact[i]).abs().max_element() <= 2e-3 * exact[i].max_element(), "{pixel}");
        }
    }
    let (energy, _) = difference(&spread, &exact);
    println!("{} of {pixel_count} pixels integrated anew; sum over exact {energy:.4}", listed.len());
    (listed.len(), energy)
}

#[test]
fn samples_are_spread_within_surfaces_and_seams_are_integrated_anew() {
    let (_, energy) = spread(&room(), 16.0);
    assert!((energy - 1.0).abs() < 0.03, "{energy} of the light at all pixels");
    // What is above the bound reaches no farther than from one sample to the next.
    let (seams, energy) = spread(&room(), 64.0);
    assert!((energy - 1.0).abs() < 0.12, "{energy} of the light at all pixels");
    // Narrower than samples are apart.
    let pole = |i: i32| (panel([-1.9 + 0.19 * i as f32, 0.0, -1.9], [0.03, 0.0, 0.0], [0.0, 2.0, 0.0]), Vec3::ONE);
    let (listed, _) = spread(&room().into_iter().chain((0..20).map(pole)).collect::<Vec<_>>(), 64.0);
    assert!(seams > 200 && listed > seams, "{seams} pixels at seams, {listed} with poles");
}

/// The blurred light of texels, and the pixels listed.
fn blur(
    eye: &Eye,
    gbuffer: &GBuffer,
    (scale, reach): (u32, u32),
    light: &dyn Fn(UVec2) -> f32,
) -> (Vec<Vec3>, HashSet<usize>) {
    let texels = eye.size.map(|pixels| pixels.div_ceil(scale));
    let samples: Vec<_> = pixels(texels).map(|texel| Vec3::splat(light(texel)).extend(1.0)).collect();
    let texture = |resources: Resources, name: &str, size: UVec2, texels: &[u8]| {
        resources.texture(name, TextureFormat::Rgba16Float, [size.x, size.y, 1], false, texels)
    };
    let surface = bytemuck::cast_slice(&gbuffer.surface);
    let resources = Resources::new(gpu())
        .bytes("view", &eye.uniform())
        .uniform("parameters", &SsbcParameters { scale, reach, ..PARAMETERS })
        .texture("surface_texture", TextureFormat::Rg32Uint, [eye.size.x, eye.size.y, 1], false, surface)
        .zeroed("repairs", (SSBC_REPAIR_HEADER + eye.size.element_product()) as usize);
    let resources = texture(resources, "samples", texels, &half_texels(&samples)).alias("samples", "light_texture");
    let resources = texture(resources, "rows", eye.size, &[]);
    let resources = texture(resources, "columns", eye.size, &[]).alias("rows", "output");
    run(gpu(), "ssbc/blur.wgsl", "blur_rows", &resources, groups(eye.size));
    let resources = resources.alias("rows", "light_texture").alias("columns", "output");
    run(gpu(), "ssbc/blur.wgsl", "blur_columns", &resources, groups(eye.size));
    let blurred = (super::light(&resources, "columns"), listed(&resources, eye.size));
    if reach == TENT_REACH {
        let resources = texture(resources.alias("samples", "light_texture"), "bounded", eye.size, &[]);
        let same = blur_same_texels(resources, eye.size, scale);
        assert!(same == blurred, "over the texels of bounded light the mean differs, scale {scale}");
    }
    blurred
}

/// The same over the texels that the filter of bounded light tells.
fn blur_same_texels(resources: Resources, size: UVec2, scale: u32) -> (Vec<Vec3>, HashSet<usize>) {
    let defs: &[_] = if scale == 2 { &["HALF_RESOLUTION"] } else { &[] };
    let blurred_rows = resources.read_texture("rows").unwrap_or_else(|error| panic!("{error}"));
    let resources = resources
        .structs("header", &[VplHeader::default()])
        .structs("compact_vpls", &[CompactVpl::default()])
        .uniform("grid", &Grid { voxel_size: 1.0, dims: UVec3::ONE, ..Default::default() })
        .floats("densities", &[1.0, 1.0])
        .texture("blurred_rows", TextureFormat::Rgba16Float, [size.x, size.y, 1], false, &blurred_rows)
        .zeroed("repairs", (SSBC_REPAIR_HEADER + size.element_product()) as usize)
        .alias("rows", "output");
    run_with(gpu(), "interleaved/filter.wgsl", "filter_rows", defs, &resources, groups(size));
    let resources = resources.alias("rows", "light_texture").alias("bounded", "output");
    run_with(gpu(), "interleaved/filter.wgsl", "filter_columns", defs, &resources, groups(size));
    let resources = resources.alias("blurred_rows", "light_texture").alias("columns", "output");
    run_with(gpu(), "ssbc/blur.wgsl", "blur_columns", &["SAME_TEXELS"], &resources, groups(size));
    (super::light(&resources, "columns"), listed(&resources, size))
}

/// Of lenses with an oblique near plane and without perspective, and two kilometres from the world's origin: what is even stays even, and
/// none comes across a seam.
#[test]
fn tents_know_surfaces_by_any_lens_and_anywhere() {
    let size = UVec2::new(101, 67);
    for (name, clip_from_view, away) in any_lens(101.0 / 67.0) {
        let (at, eye) = turned_place(size, clip_from_view, away);
        let gbuffer = eye.look(&floor_and_wall(at));
        let lit = |pixel: UVec2| {
            let on_floor = gbuffer.surface_at(pixel).is_some_and(|(_, normal, _)| normal.dot(*at.up()) > 0.9);
            f32::from(u8::from(on_floor))
        };
        for (scale, reach) in [(1, 4), (2, 4)] {
            let (even, few) = blur(&eye, &gbuffer, (scale, reach), &|texel| lit(texel * scale));
            assert!(few.is_empty(), "{name}: {} pixels listed of two large surfaces", few.len());
            let on_floor = pixels(size).filter(|&pixel| lit(pixel) > 0.0).count();
            assert!((1000..6000).contains(&on_floor), "{name}: {on_floor} pixels show the floor");
            for (pixel, light) in pixels(size).zip(even) {
                assert!((light.x - lit(pixel)).abs() < 1e-3, "{name}, {pixel}: {light}, scale {scale}");
            }
        }
    }
}

/// A tent within each surface, as wide as that of bounded light, of either resolution: what is even stays even, none comes across
/// a seam, a single sample becomes the tent, and at half resolution pixels of whose surface there is no sample are listed.
#[test]
fn the_blur_is_a_tent_within_a_surface() {
    let eye = Eye::new(UVec2::new(101, 67), Vec3::new(0.0, 1.6, 1.6), Vec3::ZERO, 0.6);
    let floor = || (panel([-2.0, 0.0, 0.0], [0.0, 0.0, 2.0], [4.0, 0.0, 0.0]), Vec3::ONE);
    let wall = || (panel([-2.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 2.0, 0.0]), Vec3::ONE);
    // Less than a pixel wide, now and then on an even one.
    let pole = |i: i32| (panel([-0.4 + 0.083 * i as f32, 0.0, 0.1], [0.008, 0.0, 0.0], [0.0, 0.6, 0.0]), Vec3::ONE);
    let gbuffer = eye.look(&[floor(), wall()]);
    let is_floor = |pixel: UVec2| gbuffer.surface_at(pixel).is_some_and(|(_, normal, _)| normal.y > 0.9);
    for (scale, reach) in [(1, 4), (1, 8), (2, 4), (2, 2)] {
        let blurred = |gbuffer: &GBuffer, light: &dyn Fn(UVec2) -> f32| blur(&eye, gbuffer, (scale, reach), light);
        let (even, few) = blurred(&gbuffer, &|texel| f32::from(u8::from(is_floor(texel * scale))));
        assert!(few.is_empty(), "{} pixels listed of two large surfaces", few.len());
        for (pixel, light) in pixels(eye.size).zip(even) {
            let expected = f32::from(u8::from(is_floor(pixel)));
            assert!((light.x - expected).abs() < 1e-3, "{pixel}: {light}, scale {scale}, reach {reach}");
        }
        let sample = UVec2::new(50, 56) / scale;
        let (single, _) = blurred(&gbuffer, &|texel| f32::from(u8::from(texel == sample)));
        for (pixel, light) in pixels(eye.size).zip(single) {
            let away = (pixel.as_vec2() / scale as f32 - sample.as_vec2()).abs();
            let tent = (Vec2::splat(reach as f32) - away).max(Vec2::ZERO).element_product() / (reach as f32).powi(4);
            // At the end of the picture and of the floor the tent is narrower.
            if is_floor(pixel) && pixel.y < 66 - reach * scale && pixel.y > 40 + reach * scale {
                assert!((light.x - tent).abs() < 0.02 * tent.max(1e-2), "{pixel}: {light}, expected {tent}");
            }
        }
        let with_poles = eye.look(&[floor(), wall()].into_iter().chain((0..10).map(pole)).collect::<Vec<_>>());
        let (light, few) = blurred(&with_poles, &|_| 1.0);
        let known = pixels(eye.size).enumerate().filter(|(i, _)| !few.contains(i));
        let dark =
            known.filter(|(i, pixel)| with_poles.surface_at(*pixel).is_some() && (light[*i].x - 1.0).abs() > 1e-3);
        assert_eq!(dark.count(), 0, "pixels without light that are not listed");
        assert_eq!(few.is_empty(), scale == 1, "{} pixels listed at scale {scale}, reach {reach}", few.len());
    }
}
