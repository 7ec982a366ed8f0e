//! Writes small binary glTF files, the same to the byte every time.
//!
//! Object keys stand in alphabetical order, so that it does not matter whether `serde_json` keeps their order or sorts.

use std::f32::consts::{PI, TAU};
use std::f64::consts::FRAC_1_SQRT_2;

use bevy::prelude::*;
use serde_json::{Value, json};

use crate::scenes::{Block, CornellBox, Panel, Surface};

/// `assets/cornell_box.glb`.
pub fn cornell_box() -> Vec<u8> {
    let mut file = Glb::default();
    file.walls(1.0);
    for Block { name, base, size, half_turn } in CornellBox::BLOCKS {
        let mesh = file.mesh(name, &cuboid(size), Surface::White as usize);
        file.nodes.push(json!({
            "mesh": mesh,
            "name": name,
            "rotation": [0.0, decimal(half_turn[0]), 0.0, decimal(half_turn[1])],
            "translation": decimals(base),
        }));
    }
    // A glTF light shines along its -z; a quarter turn about x points that down.
    file.nodes.push(json!({
        "extensions": { "KHR_lights_punctual": { "light": 0 } },
        "name": "lamp",
        "rotation": [-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2],
        "translation": decimals(CornellBox::LAMP),
    }));
    let lamp = json!({
        "color": [1.0, 1.0, 1.0],
        "intensity": decimal(CornellBox::LAMP_CANDELA),
        "name": "lamp",
        "spot": { "innerConeAngle": decimal(CornellBox::LAMP_CONE[0]), "outerConeAngle": decimal(CornellBox::LAMP_CONE[1]) },
        "type": "spot",
    });
    file.finish("cornell box", Some(lamp))
}

/// Balls in `assets/glossy_box.glb`: a row of metal over one of plastic, by roughness. Metres.
pub struct GlossyBalls;

impl GlossyBalls {
    /// Perceptual roughness, from left to right.
    pub const ROUGHNESS: [f32; 4] = [0.15, 0.3, 0.5, 0.8];
    /// Radius of each.
    pub const RADIUS: f32 = 0.4;
    /// Metallic, albedo, and the middle of the row.
    pub const ROWS: [(f32, f32, Vec3); 2] =
        [(1.0, 0.9, Vec3::new(0.0, 2.2, 0.2)), (0.0, 0.6, Vec3::new(0.0, 0.9, 0.7))];

    /// Middle of a ball.
    pub fn center(row: usize, column: usize) -> Vec3 {
        Self::ROWS[row].2 + Vec3::X * (0.9 * (column as f32 - 1.5))
    }
}

/// Roughness of the walls around the balls: Burley's diffuse lobe, which path tracers take for rough paint, sends 1.008 of what
/// Lambert's does at this one, and 1.065 at the roughness 1.
const GLOSSY_WALLS: f32 = 0.5;

/// `assets/glossy_box.glb`: balls in the box, lit by a panel that shines.
pub fn glossy_box() -> Vec<u8> {
    let mut file = Glb::default();
    file.walls(GLOSSY_WALLS);
    file.materials.push(json!({
        "emissiveFactor": [1.0, 1.0, 1.0],
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 2000.0 } },
        "name": "lamp",
        "pbrMetallicRoughness": { "baseColorFactor": [0.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0 },
    }));
    let at = |x, z| Vec3::new(x, 3.8, z);
    let lamp = file.mesh("lamp", &[[at(-0.6, -0.6), at(0.6, -0.6), at(0.6, 0.6), at(-0.6, 0.6)]], Surface::ALL.len());
    file.nodes.push(json!({ "mesh": lamp, "name": "lamp" }));
    let ball = file.ball(GlossyBalls::RADIUS);
    for (row, (metallic, albedo, _)) in GlossyBalls::ROWS.into_iter().enumerate() {
        for (column, roughness) in GlossyBalls::ROUGHNESS.into_iter().enumerate() {
            let name = format!("{} {roughness}", if metallic > 0.0 { "metal" } else { "plastic" });
            let [albedo, metallic, roughness] = [albedo, metallic, roughness].map(decimal);
            file.materials.push(json!({
                "name": name,
                "pbrMetallicRoughness": { "baseColorFactor": [albedo, albedo, albedo, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness },
            }));
            let mesh = file.primitive(&name, ball, file.materials.len() - 1);
            file.nodes
                .push(json!({ "mesh": mesh, "name": name, "translation": decimals(GlossyBalls::center(row, column)) }));
        }
    }
    file.finish("glossy box", None)
}

#[derive(Default)]
struct Glb {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    nodes: Vec<Value>,
}

impl Glb {
    /// Quadrilaterals, counter-clockwise, each with its own normal.
    fn mesh(&mut self, name: &str, quads: &[[Vec3; 4]], material: usize) -> usize {
        let corners: Vec<Vec3> = quads.iter().flatten().copied().collect();
        let normals = quads.iter().flat_map(|[a, b, _, d]| [(*b - *a).cross(*d - *a).normalize_or(Vec3::Y); 4]);
        let normals: Vec<Vec3> = normals.collect();
        let indices: Vec<u8> = (0..quads.len())
            .flat_map(|quad| [0, 1, 2, 0, 2, 3].map(|corner| (4 * quad + corner) as u16))
            .flat_map(u16::to_le_bytes)
            .collect();
        let first = self.geometry(&indices, &corners, &normals);
        self.primitive(name, first, material)
    }

    /// The box's five walls.
    fn walls(&mut self, roughness: f32) {
        for surface in Surface::ALL {
            let [r, g, b] = surface.albedo();
            self.materials.push(json!({
                "name": format!("{surface:?}").to_lowercase(),
                "pbrMetallicRoughness": { "baseColorFactor": [decimal(r), decimal(g), decimal(b), 1.0], "metallicFactor": 0.0, "roughnessFactor": decimal(roughness) },
            }));
        }
        for Panel { name, corner, u, v, surface } in CornellBox::PANELS {
            let mesh = self.mesh(name, &[[corner, corner + u, corner + u + v, corner + v]], surface as usize);
            self.nodes.push(json!({ "mesh": mesh, "name": name }));
        }
    }

    /// A ball about the origin of 32 meridians and 16 parallels. Returns its first accessor.
    fn ball(&mut self, radius: f32) -> usize {
        const SIDES: u16 = 32;
        const RINGS: u16 = 16;
        let normal = |ring: u16, side: u16| {
            let (sin, cos) = (PI * f32::from(ring) / f32::from(RINGS)).sin_cos();
            let (across, along) = (TAU * f32::from(side) / f32::from(SIDES)).sin_cos();
            Vec3::new(sin * along, cos, -sin * across)
        };
        let normals: Vec<Vec3> = (0..=RINGS).flat_map(|ring| (0..=SIDES).map(move |side| normal(ring, side))).collect();
        let corners: Vec<Vec3> = normals.iter().map(|normal| *normal * radius).collect();
        let quad = |ring: u16, side: u16| {
            let upper = ring * (SIDES + 1) + side;
            let lower = upper + SIDES + 1;
            let top = (ring > 0).then_some([upper, lower, upper + 1]);
            let bottom = (ring + 1 < RINGS).then_some([upper + 1, lower, lower + 1]);
            top.into_iter().chain(bottom).flatten()
        };
        let indices: Vec<u8> = (0..RINGS)
            .flat_map(|ring| (0..SIDES).flat_map(move |side| quad(ring, side)))
            .flat_map(u16::to_le_bytes)
            .collect();
        self.geometry(&indices, &corners, &normals)
    }

    /// Indices of two bytes, positions and normals as accessors in this order; returns the first.
    fn geometry(&mut self, indices: &[u8], corners: &[Vec3], normals: &[Vec3]) -> usize {
        let (min, max) = corners
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), corner| (min.min(*corner), max.max(*corner)));
        let count = indices.len() / 2;
        let index_view = self.view(indices, 34963);
        let position_view = self.view(&floats(corners), 34962);
        let normal_view = self.view(&floats(normals), 34962);
        let first = self.accessors.len();
        self.accessors.extend([
            json!({ "bufferView": index_view, "componentType": 5123, "count": count, "type": "SCALAR" }),
            json!({ "bufferView": position_view, "componentType": 5126, "count": corners.len(), "max": decimals(max), "min": decimals(min), "type": "VEC3" }),
            json!({ "bufferView": normal_view, "componentType": 5126, "count": normals.len(), "type": "VEC3" }),
        ]);
        first
    }

    /// A mesh of those accessors.
    fn primitive(&mut self, name: &str, first: usize, material: usize) -> usize {
        self.meshes.push(json!({
            "name": name,
            "primitives": [{ "attributes": { "NORMAL": first + 2, "POSITION": first + 1 }, "indices": first, "material": material }],
        }));
        self.meshes.len() - 1
    }

    fn view(&mut self, bytes: &[u8], target: u32) -> usize {
        self.views
            .push(json!({ "buffer": 0, "byteLength": bytes.len(), "byteOffset": self.bytes.len(), "target": target }));
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }

    /// With the box's camera.
    fn finish(mut self, name: &str, light: Option<Value>) -> Vec<u8> {
        self.nodes.push(json!({ "camera": 0, "name": "main", "translation": decimals(CornellBox::EYE) }));
        let camera = json!({
            "name": "main",
            "perspective": { "aspectRatio": 1.777_777_8, "yfov": decimal(CornellBox::FIELD_OF_VIEW), "zfar": 100.0, "znear": 0.1 },
            "type": "perspective",
        });
        let nodes: Vec<usize> = (0..self.nodes.len()).collect();
        let (used, extensions) = match light {
            Some(light) => ("KHR_lights_punctual", json!({ "KHR_lights_punctual": { "lights": [light] } })),
            None => ("KHR_materials_emissive_strength", json!({})),
        };
        let document = json!({
            "accessors": self.accessors,
            "asset": { "generator": "bevy_bounce", "version": "2.0" },
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.bytes.len() }],
            "cameras": [camera],
            "extensions": extensions,
            "extensionsUsed": [used],
            "materials": self.materials,
            "meshes": self.meshes,
            "nodes": self.nodes,
            "scene": 0,
            "scenes": [{ "name": name, "nodes": nodes }],
        });
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + 8 + self.bytes.len();
        let word = |value: usize| (value as u32).to_le_bytes();
        [
            b"glTF".as_slice(),
            &word(2),
            &word(length),
            &word(text.len()),
            b"JSON",
            &text,
            &word(self.bytes.len()),
            b"BIN\0",
            &self.bytes,
        ]
        .concat()
    }
}

fn floats(vectors: &[Vec3]) -> Vec<u8> {
    vectors.iter().flat_map(|vector| vector.to_array()).flat_map(f32::to_le_bytes).collect()
}

/// The number as it is written in the source, not its nearest binary fraction spelt out.
fn decimal(value: f32) -> f64 {
    value.to_string().parse().unwrap_or_default()
}

fn decimals(vector: Vec3) -> [f64; 3] {
    vector.to_array().map(decimal)
}

/// Six faces of a box standing on the origin.
fn cuboid(size: Vec3) -> [[Vec3; 4]; 6] {
    let half = Vec3::new(0.5 * size.x, size.y, 0.5 * size.z);
    let at = |x: f32, y: f32, z: f32| Vec3::new(x * half.x, y * half.y, z * half.z);
    [
        [at(-1.0, 0.0, 1.0), at(1.0, 0.0, 1.0), at(1.0, 1.0, 1.0), at(-1.0, 1.0, 1.0)],
        [at(1.0, 0.0, -1.0), at(-1.0, 0.0, -1.0), at(-1.0, 1.0, -1.0), at(1.0, 1.0, -1.0)],
        [at(1.0, 0.0, 1.0), at(1.0, 0.0, -1.0), at(1.0, 1.0, -1.0), at(1.0, 1.0, 1.0)],
        [at(-1.0, 0.0, -1.0), at(-1.0, 0.0, 1.0), at(-1.0, 1.0, 1.0), at(-1.0, 1.0, -1.0)],
        [at(-1.0, 1.0, 1.0), at(1.0, 1.0, 1.0), at(1.0, 1.0, -1.0), at(-1.0, 1.0, -1.0)],
        [at(-1.0, 0.0, -1.0), at(1.0, 0.0, -1.0), at(1.0, 0.0, 1.0), at(-1.0, 0.0, 1.0)],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn committed_assets_are_what_is_generated() {
        let hint = "run `cargo run --example make_assets`";
        assert!(include_bytes!("../../assets/cornell_box.glb").as_slice() == cornell_box(), "{hint}");
        assert!(include_bytes!("../../assets/glossy_box.glb").as_slice() == glossy_box(), "{hint}");
    }
}
