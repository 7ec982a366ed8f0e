//! Writes small binary glTF files, the same to the byte every time.
//!
//! Object keys stand in alphabetical order, so that it does not matter whether `serde_json` keeps their order or sorts.

use std::f64::consts::FRAC_1_SQRT_2;

use bevy::prelude::*;
use serde_json::{Value, json};

use crate::scenes::{Block, CornellBox, Panel, Surface};

/// `assets/cornell_box.glb`.
pub fn cornell_box() -> Vec<u8> {
    let mut file = Glb::default();
    for surface in Surface::ALL {
        let [r, g, b] = surface.albedo();
        file.materials.push(json!({
            "name": format!("{surface:?}").to_lowercase(),
            "pbrMetallicRoughness": { "baseColorFactor": [decimal(r), decimal(g), decimal(b), 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0 },
        }));
    }
    for Panel { name, corner, u, v, surface } in CornellBox::PANELS {
        let mesh = file.mesh(name, &[[corner, corner + u, corner + u + v, corner + v]], surface as usize);
        file.nodes.push(json!({ "mesh": mesh, "name": name }));
    }
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
    file.nodes.push(json!({ "camera": 0, "name": "main", "translation": decimals(CornellBox::EYE) }));
    let camera = json!({
        "name": "main",
        "perspective": { "aspectRatio": 1.777_777_8, "yfov": decimal(CornellBox::FIELD_OF_VIEW), "zfar": 100.0, "znear": 0.1 },
        "type": "perspective",
    });
    let lamp = json!({
        "color": [1.0, 1.0, 1.0],
        "intensity": decimal(CornellBox::LAMP_CANDELA),
        "name": "lamp",
        "spot": { "innerConeAngle": decimal(CornellBox::LAMP_CONE[0]), "outerConeAngle": decimal(CornellBox::LAMP_CONE[1]) },
        "type": "spot",
    });
    file.finish(camera, lamp)
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
        let (min, max) = corners
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), corner| (min.min(*corner), max.max(*corner)));
        let count = indices.len() / 2;
        let index_view = self.view(&indices, 34963);
        let position_view = self.view(&floats(&corners), 34962);
        let normal_view = self.view(&floats(&normals), 34962);
        let first = self.accessors.len();
        self.accessors.extend([
            json!({ "bufferView": index_view, "componentType": 5123, "count": count, "type": "SCALAR" }),
            json!({ "bufferView": position_view, "componentType": 5126, "count": corners.len(), "max": decimals(max), "min": decimals(min), "type": "VEC3" }),
            json!({ "bufferView": normal_view, "componentType": 5126, "count": normals.len(), "type": "VEC3" }),
        ]);
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

    fn finish(self, camera: Value, light: Value) -> Vec<u8> {
        let nodes: Vec<usize> = (0..self.nodes.len()).collect();
        let document = json!({
            "accessors": self.accessors,
            "asset": { "generator": "bevy_bounce", "version": "2.0" },
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.bytes.len() }],
            "cameras": [camera],
            "extensions": { "KHR_lights_punctual": { "lights": [light] } },
            "extensionsUsed": ["KHR_lights_punctual"],
            "materials": self.materials,
            "meshes": self.meshes,
            "nodes": self.nodes,
            "scene": 0,
            "scenes": [{ "name": "cornell box", "nodes": nodes }],
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
    fn committed_asset_is_what_is_generated() {
        let committed = include_bytes!("../../assets/cornell_box.glb");
        assert!(committed.as_slice() == cornell_box(), "run `cargo run --example make_assets`");
    }
}
