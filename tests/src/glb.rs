//! Whole glTF scenes in the form that the shaders read: geometry, lights, the first camera. No textures.

use std::path::Path;

use bevy::math::{Affine3A, Mat4, Vec3};
use bevy_bounce_shaders::types::{INSTANCE_TWO_SIDED, LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SPOT, Light};
use gltf::khr_lights_punctual::Kind;

use crate::scene::{TestScene, matte};

/// A scene with the eye that looks at it.
pub struct GlbScene {
    /// Every primitive an instance with its own material, seen from both sides.
    pub scene: TestScene,
    /// Of the first camera.
    pub world_from_view: Affine3A,
    /// Tangent of half its vertical angle.
    pub half_height: f32,
}

/// Reads a scene; triangles without an area are left out.
pub fn read(path: &Path) -> Result<GlbScene, gltf::Error> {
    let gltf::Gltf { document, blob } = gltf::Gltf::open(path)?;
    let mut found = GlbScene { scene: TestScene::default(), world_from_view: Affine3A::IDENTITY, half_height: 1.0 };
    let blob = blob.unwrap_or_default();
    let roots = document.scenes().flat_map(|scene| scene.nodes());
    let mut open: Vec<_> = roots.map(|node| (node, Mat4::IDENTITY)).collect();
    while let Some((node, parent)) = open.pop() {
        let world = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        let transform = Affine3A::from_mat4(world);
        for primitive in node.mesh().into_iter().flat_map(|mesh| mesh.primitives()) {
            add_primitive(&mut found.scene, &primitive, &blob, transform);
        }
        if let Some(camera) = node.camera()
            && let gltf::camera::Projection::Perspective(lens) = camera.projection()
        {
            found.world_from_view = transform;
            found.half_height = (lens.yfov() / 2.0).tan();
        }
        if let Some(light) = node.light() {
            found.scene.lights.push(light_of(&light, transform));
        }
        open.extend(node.children().map(|child| (child, world)));
    }
    Ok(found)
}

fn add_primitive(scene: &mut TestScene, primitive: &gltf::Primitive, blob: &[u8], transform: Affine3A) {
    let reader = primitive.reader(|_| Some(blob));
    let (Some(positions), Some(indices)) = (reader.read_positions(), reader.read_indices()) else { return };
    let positions: Vec<Vec3> = positions.map(Vec3::from).collect();
    let indices: Vec<u32> = indices.into_u32().collect();
    let triangles: Vec<[Vec3; 3]> = indices
        .as_chunks()
        .0
        .iter()
        .map(|t: &[u32; 3]| t.map(|i| positions[i as usize]))
        .filter(|[a, b, c]| (*b - *a).cross(*c - *a) != Vec3::ZERO)
        .collect();
    let [r, g, b, _] = primitive.material().pbr_metallic_roughness().base_color_factor();
    scene.materials.push(matte(Vec3::new(r, g, b)));
    let material = scene.materials.len() as u32 - 1;
    scene.mesh(&triangles, material, INSTANCE_TWO_SIDED, transform);
}

fn light_of(light: &gltf::khr_lights_punctual::Light, transform: Affine3A) -> Light {
    let intensity = Vec3::from(light.color()) * light.intensity();
    let mut found = Light {
        position: transform.translation.into(),
        direction: transform.transform_vector3(Vec3::NEG_Z).normalize(),
        color: intensity,
        kind: LIGHT_POINT,
        cumulative_power: 1.0,
        max_bounces: u32::MAX,
        ..Default::default()
    };
    match light.kind() {
        Kind::Spot { inner_cone_angle, outer_cone_angle } => {
            found.kind = LIGHT_SPOT;
            found.spot_scale = 1.0 / (inner_cone_angle.cos() - outer_cone_angle.cos()).max(1e-4);
            found.spot_cos_outer = outer_cone_angle.cos();
        }
        Kind::Directional => found.kind = LIGHT_DIRECTIONAL,
        Kind::Point => {}
    }
    found
}
