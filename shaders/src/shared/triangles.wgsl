// Triangles of the scene as they stand in the world this frame.
//
// Cost: colours of vertices take three loads a triangle, where there are any.

#define_import_path bevy_bounce::shared::triangles

#import bevy_bounce::shared::scene::{
    Instance, Material, NONE, INSTANCE_TWO_SIDED, INSTANCE_FLIPPED, VERTEX_WORDS, DEFORMED_WORDS,
    material_uv, thumbnail_texel, with_surface_reflection,
}

@group(0) @binding(0) var<storage, read> geometry: array<u32>;
@group(0) @binding(1) var<storage, read> instances: array<Instance>;
@group(0) @binding(2) var<storage, read> materials: array<Material>;
@group(0) @binding(3) var<storage, read> thumbnails: array<u32>;

struct Triangle {
    // World space, or what the caller has made of it.
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    // Unit length, towards the side that is seen.
    normal: vec3<f32>,
    uv_a: vec2<f32>,
    uv_b: vec2<f32>,
    uv_c: vec2<f32>,
    two_sided: bool,
    material: u32,
    albedo_override: u32,
    // Where there are any: one of each corner, RGBA8, the colour as its square root.
    has_colors: bool,
    colors: vec3<u32>,
    valid: bool,
}

fn vertex_position(instance: Instance, vertex: u32) -> vec3<f32> {
    let is_deformed = instance.deformed_offset != NONE;
    let o = select(
        instance.vertex_offset + vertex * VERTEX_WORDS,
        instance.deformed_offset + vertex * DEFORMED_WORDS,
        is_deformed,
    );
    let p = vec4<f32>(bitcast<f32>(geometry[o]), bitcast<f32>(geometry[o + 1u]), bitcast<f32>(geometry[o + 2u]), 1.0);
    let placed = vec3<f32>(
        dot(instance.world_from_local_x, p),
        dot(instance.world_from_local_y, p),
        dot(instance.world_from_local_z, p),
    );
    return select(placed, p.xyz, is_deformed);
}

fn vertex_uv(instance: Instance, vertex: u32) -> vec2<f32> {
    return unpack2x16float(geometry[instance.vertex_offset + vertex * VERTEX_WORDS + 3u]);
}

/// The triangle in a space whose origin and unit are given, in world units. Not valid where it has no area or is not finite.
fn load_triangle(instance_index: u32, triangle: u32, origin: vec3<f32>, unit: f32) -> Triangle {
    let instance = instances[instance_index];
    if triangle >= instance.triangle_count {
        return Triangle();
    }
    return load_corners(instance_index, instance.index_offset + triangle * 3u, origin, unit);
}

/// The triangle of three indices, the first of which is that word of the geometry buffer.
fn load_corners(instance_index: u32, i: u32, origin: vec3<f32>, unit: f32) -> Triangle {
    var t: Triangle;
    let instance = instances[instance_index];
    let index = vec3<u32>(geometry[i], geometry[i + 1u], geometry[i + 2u]);
    let scale = 1.0 / unit;
    t.a = (vertex_position(instance, index.x) - origin) * scale;
    t.b = (vertex_position(instance, index.y) - origin) * scale;
    t.c = (vertex_position(instance, index.z) - origin) * scale;
    let n = cross(t.b - t.a, t.c - t.a);
    let length_squared = dot(n, n);
    // Also false for NaN.
    t.valid = length_squared > 1e-30 && length_squared < 1e30;
    let side = select(1.0, -1.0, (instance.flags & INSTANCE_FLIPPED) != 0u);
    t.normal = n * (side * inverseSqrt(max(length_squared, 1e-30)));
    t.uv_a = vertex_uv(instance, index.x);
    t.uv_b = vertex_uv(instance, index.y);
    t.uv_c = vertex_uv(instance, index.z);
    t.two_sided = (instance.flags & INSTANCE_TWO_SIDED) != 0u;
    t.material = instance.material;
    t.albedo_override = instance.albedo_override;
    t.has_colors = instance.color_offset != NONE;
    if t.has_colors {
        let first = instance.color_offset;
        t.colors = vec3<u32>(geometry[first + index.x], geometry[first + index.y], geometry[first + index.z]);
    }
    return t;
}

// Weights of the corners at a point of the triangle's plane.
fn corner_weights(t: Triangle, p: vec3<f32>) -> vec3<f32> {
    let e1 = t.b - t.a;
    let e2 = t.c - t.a;
    let d = p - t.a;
    let d11 = dot(e1, e1);
    let d12 = dot(e1, e2);
    let d22 = dot(e2, e2);
    let p1 = dot(d, e1);
    let p2 = dot(d, e2);
    let inv = 1.0 / max(d11 * d22 - d12 * d12, 1e-30);
    let v = (d22 * p1 - d12 * p2) * inv;
    let w = (d11 * p2 - d12 * p1) * inv;
    return vec3<f32>(1.0 - v - w, v, w);
}

fn triangle_uv(t: Triangle, p: vec3<f32>) -> vec2<f32> {
    let weights = corner_weights(t, p);
    return t.uv_a + weights.y * (t.uv_b - t.uv_a) + weights.z * (t.uv_c - t.uv_a);
}

// A colour that is stored as its square root, and alpha.
fn unpack_color(word: u32) -> vec4<f32> {
    let stored = unpack4x8unorm(word);
    return vec4<f32>(stored.rgb * stored.rgb, stored.a);
}

fn triangle_color(t: Triangle, p: vec3<f32>) -> vec4<f32> {
    let weights = corner_weights(t, p);
    return unpack_color(t.colors.x) * weights.x + unpack_color(t.colors.y) * weights.y + unpack_color(t.colors.z) * weights.z;
}

// Colour (linear) of a thumbnail at a UV; alpha, or of a masked surface the share that is there.
fn thumbnail_color(material: Material, thumbnail: u32, uv: vec2<f32>) -> vec4<f32> {
    return unpack_color(thumbnails[thumbnail_texel(thumbnail, material_uv(material, uv))]);
}

/// Linear albedo of the surface at a point of it; what it reflects before that is part of it.
fn surface_albedo(t: Triangle, p: vec3<f32>) -> vec3<f32> {
    if t.albedo_override != 0u {
        return unpack4x8unorm(t.albedo_override).rgb;
    }
    let material = materials[t.material];
    var albedo = material.albedo.rgb;
    if material.albedo_thumbnail != NONE {
        albedo *= thumbnail_color(material, material.albedo_thumbnail, triangle_uv(t, p)).rgb;
    }
    if t.has_colors {
        albedo *= triangle_color(t, p).rgb;
    }
    return clamp(with_surface_reflection(albedo, material.specular), vec3<f32>(0.0), vec3<f32>(1.0));
}

/// Share of the surface that is there around a point of it: what the holes of a masked one leave.
fn surface_cover(t: Triangle, p: vec3<f32>) -> f32 {
    let material = materials[t.material];
    if material.alpha_cutoff <= 0.0 {
        return 1.0;
    }
    var alpha = material.albedo.a;
    if t.has_colors {
        alpha *= triangle_color(t, p).a;
    }
    if alpha < material.alpha_cutoff {
        return 0.0;
    }
    if material.albedo_thumbnail == NONE {
        return 1.0;
    }
    return thumbnail_color(material, material.albedo_thumbnail, triangle_uv(t, p)).a;
}

/// Whether the surface may have holes.
fn is_masked(t: Triangle) -> bool {
    return materials[t.material].alpha_cutoff > 0.0;
}

/// Radiance that the surface emits at a point of it, cd/m^2.
fn surface_emission(t: Triangle, p: vec3<f32>) -> vec3<f32> {
    let material = materials[t.material];
    var emission = material.emissive;
    if material.emissive_thumbnail != NONE {
        emission *= thumbnail_color(material, material.emissive_thumbnail, triangle_uv(t, p)).rgb;
    }
    return emission;
}
