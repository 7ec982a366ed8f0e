//! A scene of any number of triangles: one torus of fixed shape, cut ever finer, so that what is voxelised stays the same
//! while the triangles grow.

use std::f32::consts::TAU;

use serde_json::json;

/// Distance of the tube's middle from the torus' centre, in metres.
const RADIUS: f32 = 1.0;
/// Radius of the tube, in metres.
const TUBE: f32 = 0.45;

/// A torus of about `triangles` triangles with a camera named `main` and a point light, as binary glTF; and how many
/// triangles it has.
pub fn torus(triangles: u32) -> (Vec<u8>, u32) {
    let around = ((triangles as f32).sqrt().round() as u32).max(4);
    let across = (triangles / (2 * around)).max(3);
    let mut bin = Vec::new();
    let mut put = |values: &[f32]| values.iter().for_each(|value| bin.extend(value.to_le_bytes()));
    let angle = |i: u32, n: u32| TAU * i as f32 / n as f32;
    for i in 0..around {
        let (sin_u, cos_u) = angle(i, around).sin_cos();
        for j in 0..across {
            let (sin_v, cos_v) = angle(j, across).sin_cos();
            let ring = RADIUS + TUBE * cos_v;
            put(&[ring * cos_u, TUBE * sin_v, ring * sin_u, cos_v * cos_u, sin_v, cos_v * sin_u]);
        }
    }
    let vertices = around * across;
    let index_start = bin.len();
    for i in 0..around {
        for j in 0..across {
            let vertex = |di: u32, dj: u32| (i + di) % around * across + (j + dj) % across;
            for index in [vertex(0, 0), vertex(0, 1), vertex(1, 1), vertex(0, 0), vertex(1, 1), vertex(1, 0)] {
                bin.extend(index.to_le_bytes());
            }
        }
    }
    let count = 2 * vertices;
    (container(&document(vertices, count, index_start, bin.len()), bin), count)
}

fn document(vertices: u32, triangles: u32, index_start: usize, length: usize) -> serde_json::Value {
    let extent = RADIUS + TUBE;
    // Looks at the origin from above and in front: turned about x by -45 degrees.
    let half_turn = (TAU / 16.0).sin_cos();
    json!({
        "asset": {"version": "2.0", "generator": "bevy_bounce xtask"},
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 200.0, "range": 1000.0}]}},
        "scene": 0,
        "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [
            {"mesh": 0, "name": "torus"},
            {"camera": 0, "name": "main", "translation": [0.0, 2.5, 2.5],
                "rotation": [-half_turn.0, 0.0, 0.0, half_turn.1]},
            {"name": "light", "translation": [0.0, 2.0, 0.0], "extensions": {"KHR_lights_punctual": {"light": 0}}}
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.05}}],
        "materials": [{"pbrMetallicRoughness": {
            "baseColorFactor": [0.7, 0.5, 0.3, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": vertices, "type": "VEC3",
                "min": [-extent, -TUBE, -extent], "max": [extent, TUBE, extent]},
            {"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": vertices, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3 * triangles, "type": "SCALAR"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": index_start, "byteStride": 24, "target": 34962},
            {"buffer": 0, "byteOffset": index_start, "byteLength": length - index_start, "target": 34963}
        ],
        "buffers": [{"byteLength": length}]
    })
}

/// The binary container: glTF 2.0 specification, section 4.
fn container(document: &serde_json::Value, mut bin: Vec<u8>) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    bin.resize(bin.len().next_multiple_of(4), 0);
    let mut out = Vec::with_capacity(28 + json.len() + bin.len());
    let mut word = |bytes: &[u8], rest: &[u8]| {
        out.extend_from_slice(bytes);
        out.extend_from_slice(rest);
    };
    word(b"glTF", &2u32.to_le_bytes());
    word(&((28 + json.len() + bin.len()) as u32).to_le_bytes(), &(json.len() as u32).to_le_bytes());
    word(b"JSON", &json);
    word(&(bin.len() as u32).to_le_bytes(), b"BIN\0");
    word(&bin, &[]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn word(bytes: &[u8], at: usize) -> usize {
        bytes[at..at + 4].iter().rev().fold(0, |value, byte| value << 8 | *byte as usize)
    }

    #[test]
    fn the_container_describes_itself() -> crate::Result<()> {
        let (bytes, triangles) = torus(1000);
        assert_eq!(&bytes[..4], b"glTF");
        assert_eq!(word(&bytes, 8), bytes.len());
        let json_length = word(&bytes, 12);
        let document: serde_json::Value = serde_json::from_slice(&bytes[20..20 + json_length])?;
        assert_eq!(document["accessors"][2]["count"], 3 * triangles);
        let bin_length = word(&bytes, 20 + json_length);
        assert_eq!(document["buffers"][0]["byteLength"], bin_length);
        assert_eq!(20 + json_length + 8 + bin_length, bytes.len());
        Ok(())
    }

    #[test]
    fn the_count_is_nearly_what_was_asked_for() {
        for wanted in [1_000, 10_000, 100_000] {
            let (bytes, triangles) = torus(wanted);
            assert!(triangles.abs_diff(wanted) * 20 < wanted, "{triangles} for {wanted}");
            assert!(bytes.len() > 12 * triangles as usize);
        }
    }

    #[test]
    fn triangles_face_outwards() {
        let (bytes, triangles) = torus(100);
        let start = 20 + word(&bytes, 12) + 8;
        let index_start = start + triangles as usize / 2 * 24;
        let vector = |vertex: usize, offset: usize| {
            let at = start + vertex * 24 + offset;
            [0, 4, 8].map(|i| f32::from_bits(word(&bytes, at + i) as u32))
        };
        for triangle in 0..triangles as usize {
            let [a, b, c] = [0, 4, 8].map(|i| word(&bytes, index_start + triangle * 12 + i));
            let (p, q, r) = (vector(a, 0), vector(b, 0), vector(c, 0));
            let (e, f) = ([0, 1, 2].map(|i| q[i] - p[i]), [0, 1, 2].map(|i| r[i] - p[i]));
            let cross = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
            let normal = vector(a, 12);
            assert!((0..3).map(|i| cross[i] * normal[i]).sum::<f32>() > 0.0, "triangle {triangle}");
        }
    }
}
