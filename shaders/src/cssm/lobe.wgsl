// What a glossy pixel sends towards the eye: the lobe of GGX with Smith's shadowing (Walter et al. 2007; Heitz 2014), divided by
// what of constant light it sends, so that the picture's split sum multiplies by that once more.
//
// A sender is a patch, not a point: by its solid angle the lobe is widened, and neighbouring texels flow together. Where a pixel has the
// mean of several frames, each looks at another place of the patch, and there is the less to widen the more there are.

#define_import_path bevy_bounce::cssm::lobe

#import bevy_bounce::shared::sampling::PI

/// A lobe in the space of an object.
struct Lobe {
    normal: vec3<f32>,
    /// Towards the eye.
    view: vec3<f32>,
    n_dot_v: f32,
    /// Square of the perceptual roughness.
    alpha: f32,
    /// Largest share of constant light, of its colours, that is sent towards the eye.
    reflected: f32,
}

// Share of constant light that is sent at a reflectance of 0 and what is added towards 1. Karis 2014, "Physically Based Shading on
// Mobile", as in Bevy.
fn split_sum(roughness: f32, n_dot_v: f32) -> vec2<f32> {
    let r = roughness * vec4<f32>(-1.0, -0.0275, -0.572, 0.022) + vec4<f32>(1.0, 0.0425, 1.04, -0.04);
    let a = min(r.x * r.x, exp2(-9.28 * n_dot_v)) * r.x + r.y;
    return max(vec2<f32>(-1.04, 1.04) * a + r.zw, vec2<f32>(0.00005));
}

/// From perceptual roughness and the largest reflectance straight on.
fn make_lobe(normal: vec3<f32>, view: vec3<f32>, perceptual_roughness: f32, f_zero: f32) -> Lobe {
    // As Bevy bounds it.
    let roughness = clamp(perceptual_roughness, 0.089, 1.0);
    let n_dot_v = max(dot(normal, view), 0.01);
    let share = split_sum(roughness, n_dot_v);
    return Lobe(normal, view, n_dot_v, roughness * roughness, f_zero * share.x + share.y);
}

// What of constant light the lobe sends where all of it would be reflected: fitted to its mean over the hemisphere, weighted by the
// cosine, which by quadrature is 0.998, 0.977, 0.881 and 0.604 at roughness 0.15, 0.3, 0.5 and 0.8. The split sum's fit is far off there.
fn white_share(alpha: f32) -> f32 {
    return 1.0 - 0.72 * pow(alpha, 1.35);
}

fn distribution(alpha: f32, cosine: f32) -> f32 {
    let square = alpha * alpha;
    let d = cosine * cosine * (square - 1.0) + 1.0;
    return square / (PI * d * d);
}

/// Weight of radiance from a direction per solid angle, of a patch of that solid angle.
fn lobe_weight(lobe: Lobe, direction: vec3<f32>, solid_angle: f32) -> f32 {
    let n_dot_l = dot(lobe.normal, direction);
    if n_dot_l <= 0.0 {
        return 0.0;
    }
    let alpha = min(sqrt(lobe.alpha * lobe.alpha + solid_angle / (2.0 * PI)), 1.0);
    let square = alpha * alpha;
    let halfway = normalize(direction + lobe.view);
    let seen = n_dot_l * sqrt(lobe.n_dot_v * lobe.n_dot_v * (1.0 - square) + square);
    let lit = lobe.n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - square) + square);
    let cosine = clamp(dot(lobe.normal, halfway), 0.0, 1.0);
    return distribution(alpha, cosine) * 0.5 * n_dot_l / ((seen + lit) * white_share(alpha));
}

/// What no weight exceeds in a cone of directions: its axis, and the cosine of its half angle. A direction and the mirrored view are at
/// most twice as far apart as their halfway direction and the normal.
fn largest_weight(lobe: Lobe, direction: vec3<f32>, slack: f32) -> f32 {
    let mirrored = reflect(-lobe.view, lobe.normal);
    let apart = dot(direction, mirrored);
    var nearest = 1.0;
    if apart < slack {
        nearest = apart * slack + sqrt(max(1.0 - apart * apart, 0.0) * max(1.0 - slack * slack, 0.0));
    }
    let square = lobe.alpha * lobe.alpha;
    let shadowed = 0.5 / (sqrt(lobe.n_dot_v * lobe.n_dot_v * (1.0 - square) + square) + lobe.n_dot_v);
    return distribution(lobe.alpha, sqrt(max(0.5 + 0.5 * nearest, 0.0))) * shadowed / white_share(lobe.alpha);
}
