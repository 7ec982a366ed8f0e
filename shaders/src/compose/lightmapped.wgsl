// Marks the surfaces of meshes with a lightmap: Bevy's G-buffer, which carries a lightmap's light as emission, says nothing of it.
//
// The meshes are drawn once more, over the alpha of direct light and of its diffuse part. What of them is seen has the depth that
// Bevy's prepass gave it, which the same product of the same matrices gives again.
//
// Cost: a position a vertex; one load a fragment, whether it is seen or not.

#import bevy_render::view::View
#import bevy_bounce::compose::marks::LIGHTMAPPED

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var surface_texture: texture_2d<u32>;

/// Of the depth: some hundred steps of a 32-bit float, for products that the device rounds otherwise than in Bevy's prepass. In
/// perspective a hundredth of a millimetre a metre; what lies so near before a lightmapped surface is taken for it.
const TOLERANCE: f32 = 1e-5;

struct Vertex {
    @location(0) position: vec3<f32>,
    /// Rows of the mesh's `world_from_local`.
    @location(1) x: vec4<f32>,
    @location(2) y: vec4<f32>,
    @location(3) z: vec4<f32>,
}

@vertex
fn vertex(vertex: Vertex) -> @builtin(position) vec4<f32> {
    let world_from_local = transpose(mat4x4<f32>(vertex.x, vertex.y, vertex.z, vec4<f32>(0.0, 0.0, 0.0, 1.0)));
    let world_position = world_from_local * vec4<f32>(vertex.position, 1.0);
    return view.clip_from_world * vec4<f32>(world_position.xyz, 1.0);
}

struct Marks {
    @location(0) direct: vec4<f32>,
    @location(1) diffuse: vec4<f32>,
}

@fragment
fn mark(@builtin(position) position: vec4<f32>) -> Marks {
    let depth = bitcast<f32>(textureLoad(surface_texture, vec2<i32>(position.xy), 0).x);
    if depth == 0.0 || abs(depth - position.z) > TOLERANCE * depth {
        discard;
    }
    return Marks(vec4<f32>(LIGHTMAPPED), vec4<f32>(LIGHTMAPPED));
}
