// Columns of voxels along one of the axes.

#define_import_path bevy_bounce::shared::columns

/// Axes in an order that puts one last.
fn turn(v: vec3<f32>, last: u32) -> vec3<f32> {
    return select(select(v, v.zxy, last == 1u), v.yzx, last == 0u);
}

fn turn_voxel(v: vec3<i32>, last: u32) -> vec3<i32> {
    return select(select(v, v.zxy, last == 1u), v.yzx, last == 0u);
}

fn turn_back(v: vec3<i32>, last: u32) -> vec3<i32> {
    return select(select(v, v.yzx, last == 1u), v.zxy, last == 0u);
}

/// The axis nearest to a normal: across it a triangle is widest.
fn column_axis(normal: vec3<f32>) -> u32 {
    let n = abs(normal);
    return select(select(2u, 1u, n.y > n.z), 0u, n.x > max(n.y, n.z));
}
