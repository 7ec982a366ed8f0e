// What Bevy's lights send to a point.

#define_import_path bevy_bounce::shared::lights

#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::shared::scene::Light

/// Parts of a rect light's edge: it is taken as so many small ones, squared.
const RECT_PARTS: u32 = 2u;

/// Bevy's window: 1 near the light, 0 at its range, which is 0 for none. Karis 2013, "Real Shading in Unreal Engine 4".
fn range_window(range: f32, square_distance: f32) -> f32 {
    if range <= 0.0 {
        return 1.0;
    }
    let f = square_distance / (range * range);
    let window = clamp(1.0 - f * f, 0.0, 1.0);
    return window * window;
}

/// Bevy's fall-off of a spot light in a direction from it.
fn spot_window(light: Light, direction: vec3<f32>) -> f32 {
    let window = clamp((dot(direction, light.direction) - light.spot_cos_outer) * light.spot_scale, 0.0, 1.0);
    return window * window;
}

/// Square world units.
fn rect_area(light: Light) -> f32 {
    return 4.0 * length(light.side) * light.half_height;
}

/// A point of a rect light; `square` is [0, 1)^2 over it.
fn rect_point(light: Light, square: vec2<f32>) -> vec3<f32> {
    let up = normalize(cross(light.side, light.direction)) * light.half_height;
    let at = 2.0 * square - 1.0;
    return light.position + light.side * at.x + up * at.y;
}

/// The middle of one of its parts.
fn rect_part(light: Light, part: u32) -> vec3<f32> {
    let at = vec2<f32>(vec2<u32>(part % RECT_PARTS, part / RECT_PARTS)) + 0.5;
    return rect_point(light, at / f32(RECT_PARTS));
}

/// Irradiance over radiance from one of its parts, sr: that of a disc of the same area, exact on its axis.
fn rect_part_form_factor(light: Light, to_part: vec3<f32>, normal: vec3<f32>) -> f32 {
    let square = max(dot(to_part, to_part), 1e-12);
    let direction = to_part * inverseSqrt(square);
    let cosines = max(dot(normal, direction), 0.0) * max(-dot(direction, light.direction), 0.0);
    let area = rect_area(light) / f32(RECT_PARTS * RECT_PARTS);
    return cosines * area / (square + area / PI);
}
