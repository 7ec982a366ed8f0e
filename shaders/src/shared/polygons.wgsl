// Light from polygons that send the same from everywhere.
//
// Form factor of a polygon: Lambert 1760, in the form of Baum et al. 1989, "Improving Radiosity Solutions through the Use of
// Analytically Determined Form-Factors".

#define_import_path bevy_bounce::shared::polygons

// Angle that an edge spans as seen from the origin, by how much it turns round an axis.
fn edge_term(axis: vec3<f32>, a: vec3<f32>, b: vec3<f32>) -> f32 {
    let across = cross(a, b);
    let sine = max(length(across), 1e-20);
    return atan2(sine, dot(a, b)) * dot(axis, across) / sine;
}

/// Irradiance, from radiance 1, at the origin of a surface of that normal, and area over its plane.
fn polygon_light(corners: array<vec3<f32>, 4>, normal: vec3<f32>) -> vec2<f32> {
    var polygon = corners;
    var light = 0.0;
    var area = vec3<f32>(0.0);
    // Where it goes below the receiver's plane, and comes up again.
    var down = vec3<f32>(0.0);
    var up = vec3<f32>(0.0);
    for (var i = 0; i < 4; i++) {
        var a = polygon[i];
        var b = polygon[(i + 1) % 4];
        let heights = vec2<f32>(dot(normal, a), dot(normal, b));
        if max(heights.x, heights.y) < 0.0 {
            continue;
        }
        let crossing = mix(a, b, heights.x / select(heights.x - heights.y, 1.0, heights.x == heights.y));
        if heights.x < 0.0 {
            a = crossing;
            up = crossing;
        }
        if heights.y < 0.0 {
            b = crossing;
            down = crossing;
        }
        light += edge_term(normal, a, b);
        area += cross(a, b);
    }
    light += edge_term(normal, down, up);
    area += cross(down, up);
    return 0.5 * vec2<f32>(abs(light), length(area));
}
