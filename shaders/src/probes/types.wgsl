// Probes: where they are, and what is known of each of their faces.
//
// A probe has a value for each of six directions that a surface may look in: +x, -x, +y, -y, +z, -z. Values are stored face by
// face, probes along x, y, z within. That is Valve's ambient cube (Mitchell 2006), as Bevy's irradiance volumes take it.

#define_import_path bevy_bounce::probes::types

struct ProbeParameters {
    // Corner of the volume; the first probe is half a spacing inside.
    origin: vec3<f32>,
    // World units between probes.
    spacing: f32,
    dims: vec3<u32>,
    // What a texel holds for 1 cd/m^2.
    scale: f32,
}

// Where the light of a face is taken.
struct ProbePlace {
    // World space.
    position: vec3<f32>,
    // Octahedral normal, 16 bits; above it, one of `PLACE_*`, and `PROBE_MOVED`.
    word: u32,
}

/// Directions of a probe.
const PROBE_FACES: u32 = 6u;

/// Behind a surface: what is there is seen by nobody.
const PLACE_BEHIND: u32 = 0u;
/// No surface is near enough to tell.
const PLACE_UNKNOWN: u32 = 1u;
/// Before the nearest surface.
const PLACE_OPEN: u32 = 2u;
/// On a surface that looks that way.
const PLACE_SURFACE: u32 = 3u;
/// Where the kind is in the word.
const PLACE_SHIFT: u32 = 16u;
/// The probe was behind a surface.
const PROBE_MOVED: u32 = 0x40000u;

fn probe_count(parameters: ProbeParameters) -> u32 {
    return parameters.dims.x * parameters.dims.y * parameters.dims.z;
}

fn probe_at(parameters: ProbeParameters, index: u32) -> vec3<u32> {
    let dims = parameters.dims;
    return vec3<u32>(index % dims.x, (index / dims.x) % dims.y, index / (dims.x * dims.y));
}

fn probe_index(parameters: ProbeParameters, probe: vec3<u32>) -> u32 {
    return (probe.z * parameters.dims.y + probe.y) * parameters.dims.x + probe.x;
}

fn axis_unit(axis: u32) -> vec3<f32> {
    return vec3<f32>(vec3<u32>(axis) == vec3<u32>(0u, 1u, 2u));
}

/// The direction of a face.
fn face_normal(face: u32) -> vec3<f32> {
    return axis_unit(face / 2u) * select(1.0, -1.0, (face & 1u) == 1u);
}

fn place_kind(place: ProbePlace) -> u32 {
    return (place.word >> PLACE_SHIFT) & 3u;
}
