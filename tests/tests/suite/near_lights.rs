//! What near virtual lights bring beside the interleaved rest: the shader against all lights one after the other.

use std::f32::consts::PI;

use bevy::math::{UVec2, UVec3, Vec3};
use bevy_bounce_shaders::types::{CompactVpl, Grid, UNIFORM_VPLS, Vpl, VplHeader};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::run_with;
use bevy_bounce_tests::twins::random::Random;
use bevy_bounce_tests::twins::ssbc::GBuffer;
use wgpu::TextureFormat;

use crate::ssbc::{Eye, groups, light, pixels, room, room_eye};

/// More than are marked at a time.
const LIGHTS: usize = 3000;
/// Of the bound that is not scaled, 1/m^2.
const DENSITY: f32 = 64.0;
/// As in `interleaved/gather.wgsl`.
const NEAR: f32 = 0.125;
/// No whole number of workgroups, and odd.
const SIZE: UVec2 = UVec2::new(77, 45);

/// Half of them on what is seen, half anywhere and facing anywhere.
fn lights(gbuffer: &GBuffer) -> Vec<Vpl> {
    let mut random = Random::new(7);
    let surfaces: Vec<_> = pixels(SIZE).filter_map(|pixel| gbuffer.surface_at(pixel)).collect();
    (0..LIGHTS)
        .map(|i| {
            let (position, normal, _) = surfaces[random.below(surfaces.len() as u32) as usize];
            let anywhere = (Vec3::new(0.0, 2.0, 0.0) + 2.0 * random.vector(), random.vector().normalize_or(Vec3::Y));
            let (position, normal) = if i % 2 == 0 { (position, normal) } else { anywhere };
            Vpl { position, normal, flux: 0.1 * (random.vector() + 1.0), ..Default::default() }
        })
        .collect()
}

/// What of a light's geometry term is above an eighth of the bound that is not scaled, up to the bound; 1/m^2.
fn near_term(position: Vec3, normal: Vec3, vpl: &Vpl, scale: f32) -> f32 {
    let to_vpl = vpl.position - position;
    let direction = to_vpl.normalize_or_zero();
    let cosines = normal.dot(direction).max(0.0) * (-vpl.normal.dot(direction)).max(0.0);
    let bound = DENSITY * scale;
    (cosines / to_vpl.length_squared().max(1e-12)).min(bound) - (NEAR * DENSITY).min(bound)
}

/// What is seen, amid lights as dense as `DENSITY` at the header's scale.
fn seen(eye: &Eye, gbuffer: &GBuffer, header: VplHeader) -> Resources {
    let surface = bytemuck::cast_slice(&gbuffer.surface);
    Resources::new(gpu())
        .bytes("view", &eye.uniform())
        .structs("header", &[header])
        .uniform("grid", &Grid { voxel_size: 1.0, dims: UVec3::ONE, ..Default::default() })
        .floats("densities", &[DENSITY * header.bound_scale, 1.0])
        .texture("surface_texture", TextureFormat::Rg32Uint, [SIZE.x, SIZE.y, 1], false, surface)
}

/// What all lights bring but the interleaved part of them.
const REST: &str = "
    #import bevy_render::view::View
    #import bevy_bounce::interleaved::gather::{header, gather, far_band, whole_band}
    #import bevy_bounce::interleaved::surface::{unpack_surface, texels_shaded, PIXELS_A_TEXEL}
    @group(0) @binding(0) var<uniform> view: View;
    @group(0) @binding(1) var surface_texture: texture_2d<u32>;
    @group(0) @binding(4) var rest: texture_storage_2d<rgba16float, write>;
    @compute @workgroup_size(8, 8)
    fn gather_rest(@builtin(global_invocation_id) id: vec3<u32>) {
        let size = textureDimensions(surface_texture);
        if all(id.xy < texels_shaded(size)) {
            let pixel = id.xy * PIXELS_A_TEXEL;
            let surface = unpack_surface(textureLoad(surface_texture, pixel, 0).xy, pixel, size, view);
            let whole = gather(surface, 0u, header.count, whole_band(surface));
            let far = gather(surface, 0u, header.count, far_band(surface));
            textureStore(rest, id.xy, vec4<f32>(select(vec3<f32>(0.0), whole - far, surface.valid), 1.0));
        }
    }";

fn is_close(a: Vec3, b: Vec3) -> bool {
    (a - b).abs().cmple(0.002 * b.abs() + 0.002).all()
}

#[test]
fn near_lights_are_found_among_all() {
    let eye = room_eye(SIZE);
    let gbuffer = eye.look(&room());
    let lights = lights(&gbuffer);
    for (scale, texel) in [(1.0, 1), (1.0, 2), (0.25, 1), (16.0, 2), (0.1, 1)] {
        let texels = SIZE.map(|pixels| pixels.div_ceil(texel));
        let defs: &[&str] = if texel == 2 { &["HALF_RESOLUTION"] } else { &[] };
        let header = VplHeader { count: LIGHTS as u32, bound_scale: scale, ..Default::default() };
        let target = [texels.x, texels.y, 1];
        let resources = seen(&eye, &gbuffer, header)
            .structs("compact_vpls", &lights.iter().map(CompactVpl::from).collect::<Vec<_>>())
            .texture("output", TextureFormat::Rgba16Float, target, false, &[])
            .texture("rest", TextureFormat::Rgba16Float, target, false, &[]);
        run_with(gpu(), "interleaved/near.wgsl", "near", defs, &resources, groups(texels));
        let names: Vec<_> = defs.iter().map(|&name| name.into()).collect();
        let rest = gpu().kernel(&compose_source(REST, "rest.wgsl", &names).expect("composes"), "gather_rest");
        gpu().dispatch(&rest.expect("the device takes it"), &resources, groups(texels)).expect("runs");
        let (found, rest) = (light(&resources, "output"), light(&resources, "rest"));
        let mut lit = 0;
        for ((pixel, found), rest) in pixels(texels).zip(found).zip(rest) {
            let expected = gbuffer.surface_at(pixel * texel).map_or(Vec3::ZERO, |(position, normal, _)| {
                let near = lights.iter().map(|vpl| vpl.flux * near_term(position, normal, vpl, scale).max(0.0));
                near.sum::<Vec3>() / (PI * PI)
            });
            assert!(is_close(found, expected), "{pixel}, scale {scale}, {texel}: {found} for {expected}");
            assert!(is_close(found, rest), "{pixel}, scale {scale}, {texel}: {found}, and the rest is {rest}");
            lit += u32::from(expected.x > 0.01);
        }
        println!("scale {scale}, a texel of {texel}: {lit} of {} have light from near", texels.element_product());
        assert_eq!(lit == 0, scale <= NEAR, "{lit} have near lights");
    }
}

/// Light from all of the list.
const WHOLE: &str = "
    #import bevy_render::view::View
    #import bevy_bounce::interleaved::gather::{header, gather, whole_band}
    #import bevy_bounce::interleaved::surface::unpack_surface
    @group(0) @binding(0) var<uniform> view: View;
    @group(0) @binding(1) var surface_texture: texture_2d<u32>;
    @group(0) @binding(4) var output: texture_storage_2d<rgba16float, write>;
    @compute @workgroup_size(8, 8)
    fn gather_whole(@builtin(global_invocation_id) id: vec3<u32>) {
        let size = textureDimensions(surface_texture);
        if all(id.xy < size) {
            let surface = unpack_surface(textureLoad(surface_texture, id.xy, 0).xy, id.xy, size, view);
            let light = gather(surface, 0u, header.count, whole_band(surface));
            textureStore(output, id.xy, vec4<f32>(select(vec3<f32>(0.0), light, surface.valid), 1.0));
        }
    }";

#[test]
fn a_uniform_buffer_of_lights_shades_as_a_storage_buffer_does() {
    let eye = room_eye(SIZE);
    let gbuffer = eye.look(&room());
    let mut list = [CompactVpl::default(); UNIFORM_VPLS as usize];
    for (listed, vpl) in list.iter_mut().zip(&lights(&gbuffer)) {
        *listed = vpl.into();
    }
    let header = VplHeader { count: UNIFORM_VPLS, bound_scale: 1.0, ..Default::default() };
    let shown = || {
        let target = [SIZE.x, SIZE.y, 1];
        seen(&eye, &gbuffer, header).texture("output", TextureFormat::Rgba16Float, target, false, &[])
    };
    let shade = |defs: &[&str], resources: Resources| {
        let names: Vec<_> = defs.iter().map(|&name| name.into()).collect();
        let composed = compose_source(WHOLE, "whole.wgsl", &names).expect("composes");
        let mut spaces = composed.module.global_variables.iter().map(|(_, variable)| variable);
        let list = spaces.find(|variable| variable.binding.is_some_and(|binding| binding.binding == 3));
        let is_uniform = list.map(|variable| variable.space == naga::AddressSpace::Uniform);
        assert_eq!(is_uniform, Some(!defs.is_empty()), "of {defs:?}");
        let kernel = gpu().kernel(&composed, "gather_whole");
        gpu().dispatch(&kernel.expect("the device takes it"), &resources, groups(SIZE)).expect("runs");
        light(&resources, "output")
    };
    let stored = shade(&[], shown().structs("compact_vpls", &list));
    let uniform = shade(&["FEW_LIGHTS"], shown().uniform("compact_vpls", &list));
    assert!(stored.iter().any(|light| light.x > 0.1), "it is lit");
    for (pixel, (stored, uniform)) in pixels(SIZE).zip(stored.into_iter().zip(uniform)) {
        assert!(is_close(stored, uniform), "{pixel}: {stored}, and {uniform} by a uniform buffer");
    }
}
