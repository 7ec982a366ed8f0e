//! A primitive with vertices for its place in the atlas.

use std::collections::HashMap;

use glam::{Vec2, Vec3};
use gltf::Semantic;
use serde_json::Value;

use super::binary::Binary;
use crate::atlas::Atlas;
use crate::scene::Part;

/// The UV set that Bevy takes for lightmaps.
const SET: u32 = 1;

/// The vertices and triangles of a lit primitive.
#[derive(Default)]
pub struct Lit {
    /// Which vertex of the source each is, and whether it belongs to a back.
    vertices: Vec<(u32, bool)>,
    /// The atlas as the unit square.
    uv: Vec<[f32; 2]>,
    indices: Vec<u32>,
}

impl Lit {
    /// Of a primitive's parts, each with the number of its first triangle.
    pub fn new(parts: &[(&Part, usize)], atlas: &Atlas) -> Self {
        let mut lit = Self::default();
        let mut known: HashMap<(u32, bool, [u32; 2]), u32> = HashMap::new();
        for &(part, first) in parts {
            for (corners, uv) in part.triangles.iter().zip(&atlas.charted.corners[first..]) {
                // What has no room in the atlas is too thin to be seen.
                let uv = uv.unwrap_or_default().map(|uv: Vec2| (uv / atlas.size.as_vec2()).to_array());
                let mut indices = [0; 3];
                for (index, (&vertex, uv)) in indices.iter_mut().zip(corners.iter().zip(uv)) {
                    *index = *known.entry((vertex, part.back, uv.map(f32::to_bits))).or_insert_with(|| {
                        lit.vertices.push((vertex, part.back));
                        lit.uv.push(uv);
                        lit.uv.len() as u32 - 1
                    });
                }
                if part.mirrored {
                    indices.swap(1, 2);
                }
                lit.indices.extend(indices);
            }
        }
        lit
    }

    /// Puts them in the place of the source's own, with all attributes.
    pub fn write(
        &self,
        binary: &mut Binary,
        old: &gltf::Primitive,
        buffers: &[Vec<u8>],
        json: &mut Value,
    ) -> Result<(), String> {
        for (semantic, accessor) in old.attributes().filter(|(semantic, _)| *semantic != Semantic::TexCoords(SET)) {
            let name = semantic.to_string();
            let elements =
                elements(&accessor, buffers).ok_or_else(|| format!("{name} cannot be read; export it anew"))?;
            let chosen = self.choose(&elements, accessor.size(), &semantic);
            let chosen = chosen.ok_or_else(|| format!("{name} has fewer vertices than POSITION; export it anew"))?;
            let number = binary.push_like(&accessor, &chosen, true);
            if semantic == Semantic::Positions {
                let floats = chosen.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
                let positions: Vec<f32> = floats.collect();
                let positions: Vec<Vec3> = positions.as_chunks().0.iter().map(|at| Vec3::from_array(*at)).collect();
                binary.set_bounds(number, &positions);
            }
            json["attributes"][name] = number.into();
        }
        let uv = binary.push_pairs(&self.uv);
        json["attributes"][Semantic::TexCoords(SET).to_string()] = uv.into();
        // Bevy 0.19 has no shader for a second set without a first.
        let first = &mut json["attributes"][Semantic::TexCoords(0).to_string()];
        if first.is_null() {
            *first = uv.into();
        }
        json["indices"] = binary.push_indices(&self.indices).into();
        json["mode"] = 4.into();
        Ok(())
    }

    /// The elements of these vertices. Normals and tangents of backs are turned round.
    fn choose(&self, elements: &[u8], size: usize, semantic: &Semantic) -> Option<Vec<u8>> {
        let turns = matches!(semantic, Semantic::Normals | Semantic::Tangents);
        let mut chosen = Vec::with_capacity(self.vertices.len() * size);
        for &(vertex, back) in &self.vertices {
            let first = vertex as usize * size;
            let element = elements.get(first..first + size)?;
            if back && turns {
                let floats = element.as_chunks().0.iter().map(|bytes| -f32::from_le_bytes(*bytes));
                chosen.extend(floats.flat_map(f32::to_le_bytes));
            } else {
                chosen.extend(element);
            }
        }
        Some(chosen)
    }
}

/// The bytes of all elements, one behind the other.
fn elements(accessor: &gltf::Accessor, buffers: &[Vec<u8>]) -> Option<Vec<u8>> {
    let size = accessor.size();
    let take = |view: &gltf::buffer::View, offset: usize, stride: usize, index: usize, size: usize| {
        let first = view.offset() + offset + index * stride;
        buffers.get(view.buffer().index())?.get(first..first + size).map(<[u8]>::to_vec)
    };
    let mut bytes = match accessor.view() {
        Some(view) => {
            let stride = view.stride().unwrap_or(size);
            let all = (0..accessor.count()).map(|index| take(&view, accessor.offset(), stride, index, size));
            all.collect::<Option<Vec<_>>>()?.concat()
        }
        None => vec![0; accessor.count() * size],
    };
    if let Some(sparse) = accessor.sparse() {
        let (indices, values) = (sparse.indices(), sparse.values());
        let width = indices.index_type().size();
        for number in 0..sparse.count() {
            let index = take(&indices.view(), indices.offset(), width, number, width)?;
            let index = index.iter().rev().fold(0, |sum, &byte| sum << 8 | usize::from(byte));
            let value = take(&values.view(), values.offset(), size, number, size)?;
            bytes.get_mut(index * size..(index + 1) * size)?.copy_from_slice(&value);
        }
    }
    Some(bytes)
}

/// Whether the material leaves the second UV set to the lightmap.
pub fn check_second_set(primitive: &gltf::Primitive) -> Result<(), String> {
    let material = primitive.material();
    let pbr = material.pbr_metallic_roughness();
    let set = |info: gltf::texture::Info| {
        let moved = info.texture_transform().and_then(|transform| transform.tex_coord());
        moved.unwrap_or(info.tex_coord())
    };
    let sets = [
        ("base colour", pbr.base_color_texture().map(set)),
        ("metallic and roughness", pbr.metallic_roughness_texture().map(set)),
        ("emissive", material.emissive_texture().map(set)),
        ("normal", material.normal_texture().map(|info| info.tex_coord())),
        ("occlusion", material.occlusion_texture().map(|info| info.tex_coord())),
    ];
    match sets.into_iter().find(|(_, set)| *set == Some(SET)) {
        Some((texture, _)) => Err(format!(
            "its {texture} texture reads TEXCOORD_1, which the lightmap takes; lay all textures out in TEXCOORD_0, or \
             TEXCOORD_1 without overlaps for all meshes"
        )),
        None => Ok(()),
    }
}
