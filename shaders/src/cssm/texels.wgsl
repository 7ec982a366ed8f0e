// Baked objects and their texels, as the file has them: places of the surface, each with a cube map.
//
// Cost: ten words a texel.

#define_import_path bevy_bounce::cssm::texels

#import bevy_bounce::cssm::types::CssmBakes
#import bevy_bounce::shared::sampling::any_tangent
#import bevy_bounce::shared::scene::with_surface_reflection

@group(0) @binding(0) var<storage, read> texels: array<u32>;
@group(0) @binding(1) var<uniform> bakes: CssmBakes;

/// Words of a texel's record.
const TEXEL_WORDS: u32 = 10u;

/// A place of the surface, in the object's space.
struct Texel {
    position: vec3<f32>,
    normal: vec3<f32>,
    area: f32,
    /// Linear diffuse colour.
    diffuse: vec3<f32>,
    /// Block * 64 + lane of its cube map.
    slot: u32,
}

// A square root that is not made one with a division: what is divided by it is rounded as on the CPU.
fn root(x: f32) -> f32 {
    return max(sqrt(x), 1e-30);
}

// The unit vector of a normal in the file, by the same operations as on the CPU: visibility must not depend on who asks.
fn decode_normal(word: u32) -> vec3<f32> {
    let bits = bitcast<i32>(word);
    let u = max(f32((bits << 16u) >> 16u) / 32767.0, -1.0);
    let v = max(f32(bits >> 16u) / 32767.0, -1.0);
    let z = 1.0 - abs(u) - abs(v);
    let fold = max(-z, 0.0);
    let x = select(u - fold, u + fold, u < 0.0);
    let y = select(v - fold, v + fold, v < 0.0);
    let length = root(x * x + y * y + z * z);
    return vec3<f32>(x / length, y / length, z / length);
}

/// A texel of an object.
fn load_texel(object: u32, index: u32) -> Texel {
    let at = (bakes.objects[object].first_texel + index) * TEXEL_WORDS;
    var texel: Texel;
    texel.position = vec3<f32>(bitcast<f32>(texels[at]), bitcast<f32>(texels[at + 1u]), bitcast<f32>(texels[at + 2u]));
    texel.normal = decode_normal(texels[at + 3u]);
    texel.area = bitcast<f32>(texels[at + 4u]);
    texel.diffuse = vec3<f32>(unpack2x16float(texels[at + 5u]), unpack2x16float(texels[at + 6u]).x);
    texel.slot = texels[at + 9u];
    return texel;
}

/// Share of light that a texel sends on.
fn reflectance(texel: Texel, specular: f32) -> vec3<f32> {
    return with_surface_reflection(texel.diffuse, specular);
}

/// From the middle of a square of that area and normal, which stands for a texel, to the middle of a side; `cross(normal, ...)` leads to
/// the next side.
fn half_side(normal: vec3<f32>, area: f32) -> vec3<f32> {
    return any_tangent(normal) * (0.5 * sqrt(area));
}

/// Column and row of a texel in its object's atlas.
fn load_cell(object: u32, index: u32) -> vec2<u32> {
    let word = texels[(bakes.objects[object].first_texel + index) * TEXEL_WORDS + 8u];
    return vec2<u32>(word & 0xffffu, word >> 16u);
}

/// The object that has that place in the arrays of light.
fn object_of(light: u32) -> u32 {
    var object = 0u;
    while object + 1u < bakes.count && light >= bakes.objects[object + 1u].first_light {
        object++;
    }
    return object;
}

fn transform(x: vec4<f32>, y: vec4<f32>, z: vec4<f32>, p: vec4<f32>) -> vec3<f32> {
    return vec3<f32>(dot(x, p), dot(y, p), dot(z, p));
}

fn from_world(object: u32, p: vec4<f32>) -> vec3<f32> {
    let bake = &bakes.objects[object];
    return transform((*bake).object_from_world_x, (*bake).object_from_world_y, (*bake).object_from_world_z, p);
}

fn from_object(object: u32, p: vec4<f32>) -> vec3<f32> {
    let bake = &bakes.objects[object];
    return transform((*bake).world_from_object_x, (*bake).world_from_object_y, (*bake).world_from_object_z, p);
}

/// World units of a unit of an object's space.
fn scale_of(object: u32) -> f32 {
    return length(bakes.objects[object].world_from_object_x.xyz);
}

/// A point of the world in an object's space.
fn to_object(object: u32, point: vec3<f32>) -> vec3<f32> {
    return from_world(object, vec4<f32>(point, 1.0));
}

/// A direction of the world in an object's space, of unit length.
fn turn_to_object(object: u32, direction: vec3<f32>) -> vec3<f32> {
    return normalize(from_world(object, vec4<f32>(direction, 0.0)));
}

/// A point of an object in the world.
fn to_world(object: u32, point: vec3<f32>) -> vec3<f32> {
    return from_object(object, vec4<f32>(point, 1.0));
}

/// A direction of an object in the world, of unit length.
fn turn_to_world(object: u32, direction: vec3<f32>) -> vec3<f32> {
    return normalize(from_object(object, vec4<f32>(direction, 0.0)));
}
