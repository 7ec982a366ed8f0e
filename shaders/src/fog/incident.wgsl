// What fog scatters of the light that light probes know.
//
// A probe has irradiance over pi of six directions: the light L from everywhere, convolved with a clamped cosine, whose coefficients in
// Legendre's polynomials are 1, 2/3, 1/4, 0 (Ramamoorthi and Hanrahan 2001, "An Efficient Representation for Irradiance Environment Maps",
// equation 8, over pi). So the mean of the six is that of L, opposite ones differ by the net flux along their axis, and the mean of both is off
// by a quarter of what L has of the second order along it. Fog scatters by the phase function of Henyey and Greenstein (1941),
// whose coefficients are the powers of its asymmetry: 1, g, g^2. The series ends there; of the second order what is aslant to two axes is
// not known. Exact where light comes evenly or scatters evenly.
//
// Cost: six lookups in a texture of three dimensions and about 40 operations a point.

#define_import_path bevy_bounce::fog::incident

#import bevy_bounce::probes::types::ProbeParameters

// Irradiance over pi along an axis: half of what opposite directions have in common, half of what they differ by. By colour, in
// units of the texels.
struct Along {
    even: vec3<f32>,
    odd: vec3<f32>,
}

// The light there; beyond the outermost probes, theirs. See `probes/fill.wgsl` for the texture.
fn light_along(
    probes: texture_3d<f32>,
    linear: sampler,
    parameters: ProbeParameters,
    position: vec3<f32>,
    axis: u32,
) -> Along {
    let dims = vec3<f32>(parameters.dims);
    let probe = clamp((position - parameters.origin) / parameters.spacing, vec3<f32>(0.5), dims - 0.5);
    let uvw = (probe + dims * vec3<f32>(0.0, 0.0, f32(axis))) / (dims * vec3<f32>(1.0, 2.0, 3.0));
    let there = textureSampleLevel(probes, linear, uvw, 0.0).rgb;
    let opposite = textureSampleLevel(probes, linear, uvw + vec3<f32>(0.0, 0.5, 0.0), 0.0).rgb;
    return Along(0.5 * (there + opposite), 0.5 * (there - opposite));
}

// Radiance that is scattered against a direction of view, per unit of what scatters.
fn scattered_light(x: Along, y: Along, z: Along, view: vec3<f32>, asymmetry: f32) -> vec3<f32> {
    let mean = (x.even + y.even + z.even) / 3.0;
    let first = 1.5 * (x.odd * view.x + y.odd * view.y + z.odd * view.z);
    let squares = view * view;
    let second = 4.0 * (x.even * squares.x + y.even * squares.y + z.even * squares.z - mean);
    return max(mean + asymmetry * (first + asymmetry * second), vec3<f32>(0.0));
}
