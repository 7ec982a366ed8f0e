// Directions of a radiance cache: the hemisphere over its normal as a square of equal solid angles. Shirley and Chiu 1997, "A
// Low Distortion Map Between Disk and Square"; the disk is the hemisphere in Lambert's azimuthal equal-area projection.

#define_import_path bevy_bounce::radiance_cache::hemisphere

#import bevy_bounce::shared::sampling::{any_tangent, PI}

/// The upper unit vector of a point of [0, 1]^2.
fn square_to_hemisphere(square: vec2<f32>) -> vec3<f32> {
    let p = square * 2.0 - 1.0;
    var radius = p.x;
    var angle = 0.25 * PI * p.y / max(abs(p.x), 1e-9) * select(-1.0, 1.0, p.x >= 0.0);
    if abs(p.y) > abs(p.x) {
        radius = p.y;
        angle = 0.5 * PI - 0.25 * PI * p.x / p.y;
    }
    let z = 1.0 - radius * radius;
    let scale = radius * sqrt(max(2.0 - radius * radius, 0.0));
    return vec3<f32>(cos(angle) * scale, sin(angle) * scale, z);
}

/// The point of [0, 1]^2 of a vector of unit length; of one that points down, that of the horizon below which it is.
fn hemisphere_to_square(direction: vec3<f32>) -> vec2<f32> {
    let radius = sqrt(clamp(1.0 - direction.z, 0.0, 1.0));
    var angle = 0.0;
    if abs(direction.x) + abs(direction.y) > 1e-9 {
        angle = atan2(direction.y, direction.x);
    }
    if angle < -0.25 * PI {
        angle += 2.0 * PI;
    }
    // A quarter of the disk at a time, turned so that its middle is an axis.
    let quarter = floor(angle / (0.5 * PI) + 0.5);
    let along = radius;
    let across = (angle - quarter * 0.5 * PI) * (4.0 / PI) * radius;
    let q = u32(quarter);
    var p = vec2<f32>(along, across);
    if q == 1u {
        p = vec2<f32>(-across, along);
    } else if q == 2u {
        p = vec2<f32>(-along, -across);
    } else if q == 3u {
        p = vec2<f32>(across, -along);
    }
    return clamp(p * 0.5 + 0.5, vec2<f32>(0.0), vec2<f32>(1.0));
}

/// A vector of the cache's space in the world.
fn from_cache(normal: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
    let tangent = any_tangent(normal);
    return tangent * v.x + cross(normal, tangent) * v.y + normal * v.z;
}

/// A vector of the world in the cache's space.
fn to_cache(normal: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
    let tangent = any_tangent(normal);
    return vec3<f32>(dot(tangent, v), dot(cross(normal, tangent), v), dot(normal, v));
}
