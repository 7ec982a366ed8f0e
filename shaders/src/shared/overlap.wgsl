// Which cubes a triangle touches.
//
// Cost: about 60 operations.

#define_import_path bevy_bounce::shared::overlap

#import bevy_bounce::shared::triangles::Triangle

// Separating axes of the cross products of one edge with the box axes.
fn edge_separates(edge: vec3<f32>, p: vec3<f32>, q: vec3<f32>, half: f32) -> bool {
    let a = abs(edge);
    let px = edge.z * p.y - edge.y * p.z;
    let qx = edge.z * q.y - edge.y * q.z;
    if min(px, qx) > half * (a.y + a.z) || max(px, qx) < -half * (a.y + a.z) {
        return true;
    }
    let py = edge.x * p.z - edge.z * p.x;
    let qy = edge.x * q.z - edge.z * q.x;
    if min(py, qy) > half * (a.x + a.z) || max(py, qy) < -half * (a.x + a.z) {
        return true;
    }
    let pz = edge.y * p.x - edge.x * p.y;
    let qz = edge.y * q.x - edge.x * q.y;
    return min(pz, qz) > half * (a.x + a.y) || max(pz, qz) < -half * (a.x + a.y);
}

/// Whether a triangle touches a cube. Akenine-Moeller 2001, "Fast 3D Triangle-Box Overlap Testing".
fn touches_cube(t: Triangle, center: vec3<f32>, half: f32) -> bool {
    let a = t.a - center;
    let b = t.b - center;
    let c = t.c - center;
    let low = min(a, min(b, c));
    let high = max(a, max(b, c));
    if any(low > vec3<f32>(half)) || any(high < vec3<f32>(-half)) {
        return false;
    }
    let n = abs(t.normal);
    if abs(dot(t.normal, a)) > half * (n.x + n.y + n.z) {
        return false;
    }
    return !(edge_separates(b - a, a, c, half) || edge_separates(c - b, a, b, half) || edge_separates(a - c, a, b, half));
}

/// First and last voxel, along each axis, of the box around a triangle, within a grid; `slack`: voxels by which it is larger.
fn box_low(t: Triangle, slack: f32) -> vec3<i32> {
    return max(vec3<i32>(floor(min(t.a, min(t.b, t.c)) - slack)), vec3<i32>(0));
}

fn box_high(t: Triangle, slack: f32, dims: vec3<u32>) -> vec3<i32> {
    return min(vec3<i32>(floor(max(t.a, max(t.b, t.c)) + slack)), vec3<i32>(dims) - 1);
}
