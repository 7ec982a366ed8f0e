// Structs of the baked visibility, as in types.rs.

#define_import_path bevy_bounce::cssm::types

struct CssmBake {
    world_from_object_x: vec4<f32>,
    world_from_object_y: vec4<f32>,
    world_from_object_z: vec4<f32>,
    object_from_world_x: vec4<f32>,
    object_from_world_y: vec4<f32>,
    object_from_world_z: vec4<f32>,
    bounds_min: vec3<f32>,
    texel_count: u32,
    bounds_max: vec3<f32>,
    depth: u32,
    csm_center: vec3<f32>,
    csm_radius: f32,
    quantum: f32,
    lift: f32,
    csm_quantum: f32,
    csm_grid: u32,
    csm_side: u32,
    levels: u32,
    reach: f32,
    first_light: u32,
    first_texel: u32,
    first_node: u32,
    directory: u32,
    csm_directory: u32,
    blocks: u32,
    csm_blocks: u32,
    atlas_width: u32,
    atlas_height: u32,
}

const CSSM_OBJECTS: u32 = 64u;
const CSSM_TOP_NODES: u32 = 127u;

struct CssmTop {
    center: vec3<f32>,
    radius: f32,
    skip: u32,
    object: u32,
}

struct CssmBakes {
    count: u32,
    lights: u32,
    page_bits: u32,
    padding: u32,
    objects: array<CssmBake, CSSM_OBJECTS>,
    top: array<CssmTop, CSSM_TOP_NODES>,
}

struct CssmGather {
    threshold: f32,
    filtered: u32,
    frames: u32,
    restart: u32,
}

struct CssmLevel {
    level: u32,
}

struct CssmSurface {
    part: u32,
    triangle: u32,
    barycentric: u32,
}
