// How the levels of a radiance cache weigh the light, and which level is for which roughness. Scherzer, Nguyen, Ritschel and
// Seidel 2012, "Pre-convolved Radiance Caching"; GGX: Karis 2013, "Real Shading in Unreal Engine 4", with the eye in the
// lobe's axis.
//
// Weights of a level are divided by their sum, so that constant light comes back as it is.

#define_import_path bevy_bounce::radiance_cache::lobes

/// Perceptual roughness of the levels: a texel of the finest is as wide as a lobe of the first.
const ROUGHNESS: vec4<f32> = vec4<f32>(0.22, 0.4, 0.65, 1.0);
/// The level with a cosine.
const DIFFUSE_LEVEL: u32 = 4u;

/// Weight of light from a direction at an angle of that cosine from the axis of a coarse level's lobe, 1 to 3.
fn lobe_weight(level: u32, cosine: f32) -> f32 {
    if level == DIFFUSE_LEVEL {
        return max(cosine, 0.0);
    }
    let roughness = ROUGHNESS[level];
    let alpha = roughness * roughness;
    let half_square = 0.5 + 0.5 * cosine;
    let d = half_square * (alpha * alpha - 1.0) + 1.0;
    return max(cosine, 0.0) * alpha * alpha / (d * d);
}

/// Level of a perceptual roughness, 0 to 3, with a fraction.
fn roughness_level(roughness: f32) -> f32 {
    if roughness <= ROUGHNESS.y {
        return clamp((roughness - ROUGHNESS.x) / (ROUGHNESS.y - ROUGHNESS.x), 0.0, 1.0);
    }
    if roughness <= ROUGHNESS.z {
        return 1.0 + (roughness - ROUGHNESS.y) / (ROUGHNESS.z - ROUGHNESS.y);
    }
    return clamp(2.0 + (roughness - ROUGHNESS.z) / (ROUGHNESS.w - ROUGHNESS.z), 2.0, 3.0);
}

/// Where a rough surface's lobe points to. Lagarde and de Rousiers 2014, "Moving Frostbite to Physically Based Rendering",
/// listing 22, as in Bevy's environment maps.
fn dominant_direction(normal: vec3<f32>, mirrored: vec3<f32>, roughness: f32) -> vec3<f32> {
    let smoothness = clamp(1.0 - roughness, 0.0, 1.0);
    return normalize(mix(normal, mirrored, smoothness * (sqrt(smoothness) + roughness)));
}
