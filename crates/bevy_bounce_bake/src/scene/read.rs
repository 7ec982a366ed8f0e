//! From a glTF file to triangles.

use std::collections::HashSet;

use glam::{Mat3, Mat4, Vec2, Vec3, Vec4};
use gltf::mesh::Mode;

use super::{Material, Part, Scene, Source, check};
use crate::BakeError;

impl Scene {
    /// The default scene of a glTF file, else its first. Skinned and morphed meshes are taken as they stand in the file.
    pub fn from_gltf(source: &Source) -> Result<Self, BakeError> {
        let wrong = |problem: String| BakeError::source(&source.name, problem);
        let buffers = buffers(source).map_err(wrong)?;
        check::ranges(&source.gltf, &buffers).map_err(wrong)?;
        let scene = source.gltf.default_scene().or_else(|| source.gltf.scenes().next());
        let scene = scene.ok_or_else(|| wrong("holds no scene: export one".into()))?;
        let mut materials: Vec<Material> = Vec::new();
        for material in source.gltf.materials() {
            materials.push(Material::read(&material, source, &buffers).map_err(wrong)?);
        }
        let default = materials.len();
        materials.push(Material::default());
        let mut parts = Vec::new();
        for (node, transform) in placed_nodes(&scene).map_err(wrong)? {
            let Some(mesh) = node.mesh() else { continue };
            for primitive in mesh.primitives() {
                let name = format!(
                    "mesh {} ({}), primitive {}",
                    mesh.index(),
                    mesh.name().or(node.name()).unwrap_or("-"),
                    primitive.index()
                );
                let part = read_part(&primitive, transform, &buffers, name.clone());
                let part = part.map_err(|problem| wrong(format!("{name}: {problem}")))?;
                let numbers = [node.index(), mesh.index(), primitive.index()].map(|number| number as u32);
                let material = primitive.material().index().unwrap_or(default);
                let Material { transparent, two_sided, .. } = materials[material];
                let Some(part) = part.filter(|_| !transparent) else { continue };
                let part = Part { numbers, material, ..part };
                let back = two_sided.then(|| part.turned_over());
                parts.extend([part].into_iter().chain(back));
            }
        }
        Self { parts, materials, source_hash: source.hash() }.checked(&source.name)
    }
}

/// The bytes of all buffers.
pub(crate) fn buffers(source: &Source) -> Result<Vec<Vec<u8>>, String> {
    let mut buffers = Vec::new();
    for buffer in source.gltf.buffers() {
        let place = format!("buffer {}", buffer.index());
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => source
                .gltf
                .blob
                .clone()
                .ok_or_else(|| format!("{place}: its binary chunk is missing; export it anew"))?,
            gltf::buffer::Source::Uri(uri) => source.file(uri).map_err(|problem| format!("{place}: {problem}"))?,
        };
        if bytes.len() < buffer.length() {
            let (there, needed) = (bytes.len(), buffer.length());
            return Err(format!("{place}: {there} of {needed} bytes are there; copy the file again"));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// The nodes of a scene with their transforms to its root, in depth-first order.
pub(super) fn placed_nodes<'a>(scene: &gltf::Scene<'a>) -> Result<Vec<(gltf::Node<'a>, Mat4)>, String> {
    let mut open: Vec<_> = scene.nodes().map(|node| (node, Mat4::IDENTITY)).collect();
    open.reverse();
    let (mut seen, mut placed) = (HashSet::new(), Vec::new());
    while let Some((node, parent)) = open.pop() {
        if !seen.insert(node.index()) {
            return Err(format!("node {} is reached twice: nodes must be a tree; export it anew", node.index()));
        }
        let transform = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        let mut children: Vec<_> = node.children().map(|child| (child, transform)).collect();
        children.reverse();
        open.append(&mut children);
        placed.push((node, transform));
    }
    Ok(placed)
}

/// Nodes that do not stay as they stand in the file.
pub(super) fn moving_nodes(source: &Source) -> HashSet<usize> {
    let channels = source.gltf.animations().flat_map(|animation| animation.channels().collect::<Vec<_>>());
    let animated = channels.map(|channel| channel.target().node());
    let mut open: Vec<gltf::Node> = animated.collect();
    let mut moving = HashSet::new();
    while let Some(node) = open.pop() {
        if moving.insert(node.index()) {
            open.extend(node.children());
        }
    }
    let morphs = |mesh: gltf::Mesh| mesh.primitives().any(|primitive| primitive.morph_targets().len() > 0);
    let bends = |node: &gltf::Node| node.skin().is_some() || node.mesh().is_some_and(morphs);
    moving.extend(source.gltf.nodes().filter(bends).map(|node| node.index()));
    moving
}

/// One primitive; nothing where it holds points or lines.
fn read_part(
    primitive: &gltf::Primitive,
    transform: Mat4,
    buffers: &[Vec<u8>],
    name: String,
) -> Result<Option<Part>, String> {
    check::types(primitive)?;
    let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
    let positions: Vec<Vec3> = match reader.read_positions() {
        Some(positions) => positions.map(|position| transform.transform_point3(position.into())).collect(),
        None => return Err("no positions; export it anew".into()),
    };
    let indices: Vec<u32> = match reader.read_indices() {
        Some(indices) => indices.into_u32().collect(),
        None => (0..positions.len() as u32).collect(),
    };
    let mut triangles: Vec<[u32; 3]> = match primitive.mode() {
        Mode::Triangles => indices.as_chunks().0.to_vec(),
        Mode::TriangleStrip => {
            let turned =
                |(i, t): (usize, &[u32])| if i.is_multiple_of(2) { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
            indices.windows(3).enumerate().map(turned).collect()
        }
        Mode::TriangleFan => indices.windows(2).skip(1).map(|pair| [indices[0], pair[0], pair[1]]).collect(),
        _ => return Ok(None),
    };
    let mirrored = transform.determinant() < 0.0;
    if mirrored {
        triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
    }
    let part = Part::new(name, positions, triangles)?;
    let uv = |set| -> Option<Vec<Vec2>> {
        let uv: Vec<Vec2> = reader.read_tex_coords(set)?.into_f32().map(Vec2::from).collect();
        (uv.len() == part.positions.len() && uv.iter().all(|uv| uv.is_finite())).then_some(uv)
    };
    let colors: Option<Vec<Vec4>> =
        reader.read_colors(0).map(|colors| colors.into_rgba_f32().map(Vec4::from).collect());
    let colors = colors.filter(|colors| colors.len() == part.positions.len());
    // By the transposed inverse, but for a factor: it is there for flattened meshes, too.
    let [x, y, z] = [0, 1, 2].map(|axis| transform.col(axis).truncate());
    let side = transform.determinant().signum();
    let turn = Mat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * side;
    let normals: Option<Vec<Vec3>> = reader
        .read_normals()
        .map(|normals| normals.map(|normal| (turn * Vec3::from(normal)).normalize_or_zero()).collect());
    let normals = normals.filter(|normals| normals.len() == part.positions.len());
    let (uv0, uv1) = (uv(0), uv(1));
    Ok(Some(Part { normals, uv0, uv1, colors, mirrored, ..part }))
}
