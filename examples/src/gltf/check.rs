//! Checks a glTF file, so that what is wrong with it is said in one line, and Bevy's loader never panics over it.

use std::path::{Path, PathBuf};

use bevy::camera::{OrthographicProjection, PerspectiveProjection, Projection, ScalingMode};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::{Mode, Semantic};

use super::buffers::{self, Buffers};
use crate::Error;

/// A glTF file that can be loaded, and what it holds.
#[derive(Clone, Debug)]
pub struct SceneFile {
    /// Absolute path.
    pub path: PathBuf,
    /// Which of its scenes is shown: the default one, else the first.
    pub scene: usize,
    /// Cameras of that scene, in the order of their nodes.
    pub cameras: Vec<FileCamera>,
}

/// A camera in a file.
#[derive(Clone, Debug)]
pub struct FileCamera {
    /// Its node's name, else its own, else `cameraN`.
    pub name: String,
    /// Its node.
    pub node: usize,
    /// Lens.
    pub projection: Projection,
}

impl SceneFile {
    /// Reads and checks the file: container, JSON, buffers, accessors, indices, positions, images.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let wrong = |problem: String| Error::file(path, problem);
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
        if !matches!(extension.as_deref(), Some("glb" | "gltf")) {
            return Err(wrong("not a glTF by its name: give a .glb or .gltf".into()));
        }
        let bytes = std::fs::read(path).map_err(|error| wrong(format!("cannot be read: {error}")))?;
        check_container(&bytes, extension.as_deref() == Some("glb")).map_err(wrong)?;
        let file = gltf::Gltf::from_slice(&bytes).map_err(|error| wrong(describe(error)))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let buffers = buffers::load(&file, folder).map_err(wrong)?;
        check_accessors(&file).map_err(wrong)?;
        check_meshes(&file, &buffers).map_err(wrong)?;
        check_images(&file, folder).map_err(wrong)?;
        let scene = file.default_scene().or_else(|| file.scenes().next());
        let scene = scene.ok_or_else(|| wrong("holds no scene: export one".into()))?;
        Ok(Self {
            path: path.canonicalize().map_err(|error| wrong(format!("cannot be read: {error}")))?,
            scene: scene.index(),
            cameras: cameras(&scene).map_err(wrong)?,
        })
    }

    /// The camera of this name; without one `main`, else the first. `None` where the file has no camera.
    pub fn camera(&self, name: Option<&str>) -> Result<Option<&FileCamera>, Error> {
        let find = |name: &str| self.cameras.iter().find(|camera| camera.name == name);
        match name {
            None => Ok(find("main").or(self.cameras.first())),
            Some(name) => find(name).map(Some).ok_or_else(|| {
                let names: Vec<&str> = self.cameras.iter().map(|camera| camera.name.as_str()).collect();
                let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                Error::file(&self.path, format!("has no camera {name}; those there are: {names}"))
            }),
        }
    }
}

fn check_container(bytes: &[u8], binary: bool) -> Result<(), String> {
    if bytes.is_empty() {
        return Err("is empty".into());
    }
    if !bytes.starts_with(b"glTF") {
        return match binary {
            true => Err("is no binary glTF: it does not start with `glTF`; a JSON glTF is named .gltf".into()),
            false => Ok(()),
        };
    }
    let word = |at: usize| bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
    match (word(4), word(8)) {
        (Some(2), Some(length)) if length as usize > bytes.len() => {
            Err(format!("is truncated: {} of {length} bytes are there; copy it again", bytes.len()))
        }
        (Some(2), Some(_)) => Ok(()),
        (Some(version), Some(_)) => Err(format!("is glTF version {version}; version 2 is understood, export it anew")),
        _ => Err("is truncated: its header is cut off; copy it again".into()),
    }
}

fn describe(error: gltf::Error) -> String {
    match error {
        gltf::Error::Validation(problems) => match problems.first() {
            Some((path, problem)) => format!("is not valid glTF at {path}: {problem}; export it anew"),
            None => "is not valid glTF; export it anew".into(),
        },
        gltf::Error::Deserialize(problem) => format!("is not valid glTF JSON: {problem}; export it anew"),
        gltf::Error::Binary(problem) => format!("is not a valid binary glTF: {problem}; export it anew"),
        other => format!("is not valid glTF: {other}; export it anew"),
    }
}

fn check_accessors(file: &gltf::Gltf) -> Result<(), String> {
    for accessor in file.accessors() {
        let size = accessor.size();
        let needed = |offset: usize, stride: usize, size: usize, count: usize| {
            stride.checked_mul(count.saturating_sub(1)).and_then(|bytes| bytes.checked_add(size)?.checked_add(offset))
        };
        let mut fits = true;
        if let Some(view) = accessor.view() {
            let stride = view.stride().unwrap_or(size);
            let end = needed(accessor.offset(), stride, size, accessor.count());
            fits &= accessor.count() == 0 || (stride >= size && end.is_some_and(|end| end <= view.length()));
        }
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let index = indices.index_type().size();
            let ends = [
                (needed(indices.offset(), index, index, sparse.count()), indices.view().length()),
                (needed(values.offset(), size, size, sparse.count()), values.view().length()),
            ];
            fits &= ends.iter().all(|(end, length)| end.is_some_and(|end| end <= *length));
        }
        if !fits {
            return Err(format!("accessor {} reaches past its buffer view; export it anew", accessor.index()));
        }
    }
    Ok(())
}

fn check_meshes(file: &gltf::Gltf, buffers: &Buffers) -> Result<(), String> {
    for mesh in file.meshes() {
        for primitive in mesh.primitives() {
            let place =
                format!("mesh {} ({}), primitive {}", mesh.index(), mesh.name().unwrap_or("-"), primitive.index());
            for (semantic, accessor) in primitive.attributes() {
                let wanted = match semantic {
                    Semantic::Positions | Semantic::Normals => Dimensions::Vec3,
                    Semantic::Tangents => Dimensions::Vec4,
                    _ => continue,
                };
                if accessor.data_type() != DataType::F32 || accessor.dimensions() != wanted {
                    return Err(format!(
                        "{place}: {} is not {wanted:?} of floats; export it anew",
                        semantic.to_string()
                    ));
                }
            }
            if matches!(primitive.mode(), Mode::TriangleFan | Mode::LineLoop) {
                return Err(format!("{place}: {:?} is not supported; export triangles", primitive.mode()));
            }
            let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
            let Some(positions) = reader.read_positions() else {
                return Err(format!("{place}: no positions; export it anew"));
            };
            let mut vertices = 0;
            for position in positions {
                vertices += 1;
                if !position.iter().all(|coordinate| coordinate.is_finite()) {
                    return Err(format!("{place}: a position is not a finite number; export it anew"));
                }
            }
            if let Some(accessor) = primitive.indices() {
                let unsigned = matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32);
                if !unsigned || accessor.dimensions() != Dimensions::Scalar {
                    return Err(format!("{place}: indices are not unsigned integers; export it anew"));
                }
                let largest = reader.read_indices().and_then(|indices| indices.into_u32().max());
                if largest.is_some_and(|index| index >= vertices) {
                    return Err(format!("{place}: an index is past the {vertices} vertices; export it anew"));
                }
            }
        }
    }
    Ok(())
}

fn check_images(file: &gltf::Gltf, folder: &Path) -> Result<(), String> {
    for image in file.images() {
        if let gltf::image::Source::Uri { uri, .. } = image.source()
            && !uri.starts_with("data:")
        {
            let path = folder.join(buffers::decode_uri(uri)?);
            if !path.is_file() {
                return Err(format!("image {}: {} is missing; put it beside the scene", image.index(), path.display()));
            }
        }
    }
    Ok(())
}

fn cameras(scene: &gltf::Scene) -> Result<Vec<FileCamera>, String> {
    let mut cameras = Vec::new();
    let mut seen = std::collections::HashSet::new();
    let mut nodes: Vec<gltf::Node> = scene.nodes().collect();
    while let Some(node) = nodes.pop() {
        if !seen.insert(node.index()) {
            return Err(format!("node {} is reached twice: nodes must be a tree; export it anew", node.index()));
        }
        nodes.extend(node.children());
        if let Some(camera) = node.camera() {
            let name = node.name().or(camera.name()).map_or_else(|| format!("camera{}", camera.index()), str::to_owned);
            cameras.push(FileCamera { name, node: node.index(), projection: projection(&camera) });
        }
    }
    cameras.sort_by_key(|camera| camera.node);
    Ok(cameras)
}

fn projection(camera: &gltf::Camera) -> Projection {
    match camera.projection() {
        gltf::camera::Projection::Perspective(lens) => Projection::Perspective(PerspectiveProjection {
            fov: lens.yfov(),
            near: lens.znear(),
            far: lens.zfar().unwrap_or(PerspectiveProjection::default().far),
            ..Default::default()
        }),
        gltf::camera::Projection::Orthographic(lens) => Projection::Orthographic(OrthographicProjection {
            near: lens.znear(),
            far: lens.zfar(),
            // xmag and ymag are half the extent; as with a perspective's yfov, the height is what stays.
            scaling_mode: ScalingMode::FixedVertical { viewport_height: 2.0 * lens.ymag() },
            ..OrthographicProjection::default_3d()
        }),
    }
}
