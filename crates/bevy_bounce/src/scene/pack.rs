//! A mesh asset as words of the geometry buffer.
//!
//! One allocation a mesh, its parts one after the other:
//!
//! | part | words | per |
//! |---|---|---|
//! | vertices | position (3 f32), UV (2 f16) | vertex |
//! | indices | 3 u32, relative to the first vertex | triangle, level of detail by level |
//! | skin | 4 joints (u16), 4 weights (unorm16) | vertex, skinned meshes only |
//! | morph deltas | position (3 f32) | target, then vertex; morphed meshes only |
//! | colours | RGBA8, colour as its square root | vertex, meshes with colours only |
//!
//! Only the first UV set is kept, in half floats: thumbnails have 16 texels.

use bevy::math::Vec3;
use bevy::mesh::{Indices, Mesh, PrimitiveTopology, VertexAttributeValues};
use bevy_bounce_shaders::types::{SKIN_WORDS, VERTEX_WORDS};
use half::f16;

use super::bounds::Bounds;
use super::lods::{Lod, simplified};

/// Why a mesh cannot take part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unusable {
    /// Lines, points, or no triangle at all.
    NoTriangles,
    /// Positions are missing or not three floats.
    NoPositions,
}

/// See the module. Offsets are in words from the start of the allocation.
#[derive(Debug, Default)]
pub(super) struct PackedMesh {
    /// Contents of the allocation.
    pub words: Vec<u32>,
    /// Number of vertices.
    pub vertex_count: u32,
    /// First index.
    pub index_offset: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// The whole mesh, then coarser and coarser ones with the same vertices; at least one.
    pub lods: Vec<Lod>,
    /// Running sum of the triangles' areas, square local units.
    pub areas: Vec<f32>,
    /// First word of the skin, where there is one.
    pub skin_offset: Option<u32>,
    /// First word of the morph deltas.
    pub morph_offset: u32,
    /// First word of the colours, where there are any.
    pub color_offset: Option<u32>,
    /// Box of the positions.
    pub bounds: Bounds,
    /// Whether Bevy's shaders have normals of it.
    pub has_normals: bool,
    /// Box of the vertices that follow a joint, by joint; joints that move nothing are left out.
    pub joint_bounds: Vec<(u16, Bounds)>,
    /// Box of the deltas, by morph target.
    pub morph_bounds: Vec<Bounds>,
}

/// Turns a mesh into words. Triangles with a vertex that is missing or not finite are left out.
pub(super) fn pack(mesh: &Mesh) -> Result<PackedMesh, Unusable> {
    let Ok(VertexAttributeValues::Float32x3(positions)) = mesh.try_attribute(Mesh::ATTRIBUTE_POSITION) else {
        return Err(Unusable::NoPositions);
    };
    let triangles = triangles(mesh, positions)?;
    if triangles.is_empty() {
        return Err(Unusable::NoTriangles);
    }

    let mut packed = PackedMesh {
        vertex_count: positions.len() as u32,
        triangle_count: triangles.len() as u32,
        has_normals: matches!(mesh.try_contains_attribute(Mesh::ATTRIBUTE_NORMAL), Ok(true)),
        ..PackedMesh::default()
    };
    let uvs = uvs(mesh);
    for (vertex, position) in positions.iter().enumerate() {
        let position = finite_or_zero(Vec3::from_array(*position));
        packed.bounds.include(position);
        packed.words.extend(position.to_array().map(f32::to_bits));
        packed.words.push(uvs.as_ref().and_then(|uvs| uvs.get(vertex).copied()).map_or(0, pack_uv));
    }
    debug_assert_eq!(packed.words.len(), packed.vertex_count as usize * VERTEX_WORDS as usize);
    packed.index_offset = packed.words.len() as u32;
    packed.words.extend(triangles.as_flattened());
    packed.areas = running_areas(positions, &triangles);
    packed.lods.push(Lod { index_offset: packed.index_offset, triangle_count: packed.triangle_count, error: 0.0 });
    for (indices, error) in simplified(positions, triangles.as_flattened(), &packed.areas) {
        let index_offset = packed.words.len() as u32;
        packed.lods.push(Lod { index_offset, triangle_count: indices.len() as u32 / 3, error });
        packed.words.extend(indices);
    }
    pack_skin(mesh, &mut packed, positions);
    pack_morph_targets(mesh, &mut packed);
    pack_colors(mesh, &mut packed);
    Ok(packed)
}

fn running_areas(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<f32> {
    let mut sum = 0.0_f64;
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| Vec3::from_array(positions[i as usize]));
        f64::from((b - a).cross(c - a).length() / 2.0)
    };
    let add = |t| {
        sum += Some(area(t)).filter(|area| area.is_finite()).unwrap_or(0.0);
        sum as f32
    };
    triangles.iter().map(add).collect()
}

fn finite_or_zero(v: Vec3) -> Vec3 {
    if v.is_finite() { v } else { Vec3::ZERO }
}

fn triangles(mesh: &Mesh, positions: &[[f32; 3]]) -> Result<Vec<[u32; 3]>, Unusable> {
    let corners: Vec<u32> = match mesh.try_indices_option() {
        Ok(Some(Indices::U16(indices))) if mesh.primitive_topology() == PrimitiveTopology::TriangleStrip => {
            indices.iter().map(|&i| if i == u16::MAX { u32::MAX } else { u32::from(i) }).collect()
        }
        Ok(Some(Indices::U16(indices))) => indices.iter().map(|&i| u32::from(i)).collect(),
        Ok(Some(Indices::U32(indices))) => indices.clone(),
        Ok(None) => (0..positions.len() as u32).collect(),
        Err(_) => return Err(Unusable::NoTriangles),
    };
    let usable =
        |&vertex: &u32| positions.get(vertex as usize).is_some_and(|position| Vec3::from_array(*position).is_finite());
    let keep = |triangle: &[u32; 3]| triangle.iter().all(usable);
    match mesh.primitive_topology() {
        PrimitiveTopology::TriangleList => Ok(corners.as_chunks::<3>().0.iter().copied().filter(keep).collect()),
        PrimitiveTopology::TriangleStrip => Ok(corners
            .split(|&corner| corner == u32::MAX)
            .flat_map(|strip| strip.windows(3).enumerate())
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] })
            .filter(keep)
            .collect()),
        _ => Err(Unusable::NoTriangles),
    }
}

fn uvs(mesh: &Mesh) -> Option<Vec<[f32; 2]>> {
    match mesh.try_attribute(Mesh::ATTRIBUTE_UV_0).ok()? {
        VertexAttributeValues::Float32x2(uvs) => Some(uvs.clone()),
        VertexAttributeValues::Float16x2(uvs) => Some(uvs.iter().map(|uv| uv.map(f16::to_f32)).collect()),
        VertexAttributeValues::Unorm16x2(uvs) => {
            Some(uvs.iter().map(|uv| uv.map(|x| f32::from(x) / 65535.0)).collect())
        }
        VertexAttributeValues::Unorm8x2(uvs) => Some(uvs.iter().map(|uv| uv.map(|x| f32::from(x) / 255.0)).collect()),
        _ => None,
    }
}

fn pack_uv(uv: [f32; 2]) -> u32 {
    let [u, v] = uv.map(|x| {
        let x = if x.is_finite() { x.clamp(-65504.0, 65504.0) } else { 0.0 };
        u32::from(f16::from_f32(x).to_bits())
    });
    u | v << 16
}

fn pack_skin(mesh: &Mesh, packed: &mut PackedMesh, positions: &[[f32; 3]]) {
    let (Ok(VertexAttributeValues::Uint16x4(joints)), Ok(VertexAttributeValues::Float32x4(weights))) =
        (mesh.try_attribute(Mesh::ATTRIBUTE_JOINT_INDEX), mesh.try_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT))
    else {
        return;
    };
    if joints.len() != positions.len() || weights.len() != positions.len() {
        return;
    }
    packed.skin_offset = Some(packed.words.len() as u32);
    packed.words.reserve(positions.len() * SKIN_WORDS as usize);
    let mut bounds = Vec::new();
    for ((position, joints), weights) in positions.iter().zip(joints).zip(weights) {
        let weights = weights.map(|w| (w.clamp(0.0, 1.0) * 65535.0).round() as u32);
        let joints = joints.map(u32::from);
        packed.words.extend([
            joints[0] | joints[1] << 16,
            joints[2] | joints[3] << 16,
            weights[0] | weights[1] << 16,
            weights[2] | weights[3] << 16,
        ]);
        for (joint, _) in joints.into_iter().zip(weights).filter(|&(_, weight)| weight > 0) {
            if bounds.len() <= joint as usize {
                bounds.resize(joint as usize + 1, Bounds::EMPTY);
            }
            bounds[joint as usize].include(finite_or_zero(Vec3::from_array(*position)));
        }
    }
    packed.joint_bounds = (0u16..).zip(bounds).filter(|(_, bounds)| !bounds.is_empty()).collect();
}

fn pack_morph_targets(mesh: &Mesh, packed: &mut PackedMesh) {
    let Ok(deltas) = mesh.try_morph_targets() else { return };
    packed.morph_offset = packed.words.len() as u32;
    for target in deltas.chunks_exact(packed.vertex_count as usize) {
        let mut bounds = Bounds::EMPTY;
        for delta in target {
            let delta = finite_or_zero(delta.position);
            bounds.include(delta);
            packed.words.extend(delta.to_array().map(f32::to_bits));
        }
        packed.morph_bounds.push(bounds);
    }
}

fn pack_colors(mesh: &Mesh, packed: &mut PackedMesh) {
    let Ok(VertexAttributeValues::Float32x4(colors)) = mesh.try_attribute(Mesh::ATTRIBUTE_COLOR) else { return };
    if colors.len() == packed.vertex_count as usize {
        packed.color_offset = Some(packed.words.len() as u32);
        packed.words.extend(colors.iter().map(pack_color));
    }
}

fn pack_color([r, g, b, a]: &[f32; 4]) -> u32 {
    // What is not a number is 0 as a byte.
    let byte = |x: f32| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    u32::from_le_bytes([byte(r.sqrt()), byte(g.sqrt()), byte(b.sqrt()), byte(*a)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::asset::RenderAssetUsages;
    use bevy::mesh::morph::MorphAttributes;
    use bevy::mesh::{MeshVertexAttribute, VertexFormat};

    fn mesh(topology: PrimitiveTopology, positions: Vec<[f32; 3]>) -> Mesh {
        Mesh::new(topology, RenderAssetUsages::default()).with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
    }

    fn grid(n: usize) -> Vec<[f32; 3]> {
        (0..n).map(|i| [i as f32, (i * i) as f32, 0.5]).collect()
    }

    fn indices(packed: &PackedMesh) -> &[u32] {
        &packed.words[packed.index_offset as usize..][..packed.triangle_count as usize * 3]
    }

    #[test]
    fn a_list_without_indices() {
        let packed = pack(&mesh(PrimitiveTopology::TriangleList, grid(7))).map(|p| (indices(&p).to_vec(), p.bounds));
        let bounds = Bounds { min: Vec3::new(0.0, 0.0, 0.5), max: Vec3::new(6.0, 36.0, 0.5) };
        assert_eq!(packed, Ok((vec![0, 1, 2, 3, 4, 5], bounds)));
    }

    #[test]
    fn strips_keep_their_winding_and_restart() {
        let strip = mesh(PrimitiveTopology::TriangleStrip, grid(8)).with_inserted_indices(Indices::U16(vec![
            0,
            1,
            2,
            3,
            u16::MAX,
            4,
            5,
            6,
        ]));
        assert_eq!(pack(&strip).map(|p| indices(&p).to_vec()), Ok(vec![0, 1, 2, 2, 1, 3, 4, 5, 6]));
    }

    #[test]
    fn broken_vertices_take_their_triangles_along() {
        let mut positions = grid(6);
        positions[4][1] = f32::NAN;
        let list = mesh(PrimitiveTopology::TriangleList, positions)
            .with_inserted_indices(Indices::U32(vec![0, 1, 2, 2, 3, 4, 1, 2, 99, 3, 2, 5]));
        let packed = pack(&list).map(|p| (indices(&p).to_vec(), p.words.contains(&f32::NAN.to_bits())));
        assert_eq!(packed, Ok((vec![0, 1, 2, 3, 2, 5], false)));
    }

    #[test]
    fn what_has_no_triangles_is_refused() {
        let refused = |mesh: Mesh| pack(&mesh).err();
        assert_eq!(refused(mesh(PrimitiveTopology::LineList, grid(4))), Some(Unusable::NoTriangles));
        assert_eq!(refused(mesh(PrimitiveTopology::TriangleList, grid(2))), Some(Unusable::NoTriangles));
        let empty = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default());
        assert_eq!(refused(empty.clone()), Some(Unusable::NoPositions));
        let flat = MeshVertexAttribute { format: VertexFormat::Float32x2, ..Mesh::ATTRIBUTE_POSITION };
        let flat = empty.with_inserted_attribute(flat, vec![[0.0; 2]; 3]);
        assert_eq!(refused(flat), Some(Unusable::NoPositions));
    }

    #[test]
    fn skin_and_morph_parts_lie_where_they_say() {
        let mesh = mesh(PrimitiveTopology::TriangleList, grid(3))
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_JOINT_INDEX,
                VertexAttributeValues::Uint16x4(vec![[1, 2, 0, 0], [2, 0, 0, 0], [1, 0, 0, 0]]),
            )
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_JOINT_WEIGHT,
                vec![[0.5, 0.5, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]],
            )
            .with_morph_targets(
                (0..6).map(|i| MorphAttributes::new(Vec3::splat(i as f32), Vec3::ZERO, Vec3::ZERO)).collect(),
            );
        let packed = pack(&mesh).unwrap_or_default();
        assert_eq!(packed.skin_offset, Some(3 * 4 + 3));
        assert_eq!(packed.words[15..19], [1 | 2 << 16, 0, 32768 | 32768 << 16, 0]);
        assert_eq!(packed.morph_offset, 15 + 12);
        assert_eq!(f32::from_bits(packed.words[27 + 3 * 4]), 4.0);
        assert_eq!(packed.words.len(), 27 + 18);
        let joint_2 = Bounds { min: Vec3::new(0.0, 0.0, 0.5), max: Vec3::new(1.0, 1.0, 0.5) };
        assert_eq!(packed.joint_bounds.iter().map(|(joint, _)| *joint).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(packed.joint_bounds[1].1, joint_2);
        assert_eq!(packed.morph_bounds[1], Bounds { min: Vec3::splat(3.0), max: Vec3::splat(5.0) });
    }

    #[test]
    fn colors_are_bytes_of_roots() {
        let colors = vec![[0.25, 1.0, 4.0, 0.5], [0.0, -1.0, f32::NAN, f32::NAN], [1.0; 4]];
        let mesh =
            mesh(PrimitiveTopology::TriangleList, grid(3)).with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colors);
        let packed = pack(&mesh).unwrap_or_default();
        assert_eq!((packed.color_offset, packed.words.len()), (Some(3 * 4 + 3), 15 + 3));
        assert_eq!(packed.words[15..], [0x80ff_ff80, 0, u32::MAX]);
    }

    #[test]
    fn uvs_are_finite_halves() {
        assert_eq!(pack_uv([1.0, -2.0]), 0x3C00 | 0xC000 << 16);
        assert_eq!(pack_uv([f32::NAN, 1e9]), 0x7BFF << 16);
    }
}
