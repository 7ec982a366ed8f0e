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
        let bytes = std::fs::read(path)
            .map_err(|error| wrong(format!("cannot be read: {error}; give the path of a .glb or .gltf file")))?;
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
        return Err("is empty; copy it again".into());
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::glb::cornell_box;

    /// What is said about a file with these bytes.
    fn complaint(name: &str, bytes: &[u8]) -> String {
        let folder = std::env::temp_dir().join(format!("bevy_bounce_check_{}", std::process::id()));
        let path = folder.join(name);
        std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, bytes)).expect("a temporary file");
        SceneFile::open(&path).map(|_| "nothing".to_owned()).unwrap_or_else(|error| error.to_string())
    }

    /// The Cornell box with its JSON changed.
    fn altered(from: &str, to: &str) -> Vec<u8> {
        assert_eq!(from.len(), to.len(), "chunk lengths must stay");
        let bytes = cornell_box();
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).expect("the text is there");
        [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
    }

    #[test]
    fn good_file_opens() {
        assert_eq!(complaint("good.glb", &cornell_box()), "nothing");
    }

    #[test]
    fn broken_files_are_named_and_explained() {
        let bytes = cornell_box();
        let cases: [(&str, Vec<u8>, &str); 11] = [
            ("scene.obj", bytes.clone(), "give a .glb or .gltf"),
            ("empty.glb", vec![], "is empty"),
            ("magic.glb", b"PK\x03\x04 surely not".to_vec(), "is no binary glTF"),
            ("header.glb", bytes[..9].to_vec(), "is truncated"),
            ("cut.glb", bytes[..bytes.len() - 100].to_vec(), "is truncated"),
            ("version.glb", [&bytes[..4], &1u32.to_le_bytes(), &bytes[8..]].concat(), "glTF version 1"),
            ("text.gltf", b"{ \"asset\": ".to_vec(), "not valid glTF JSON"),
            (
                "buffer.gltf",
                br#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[]}],"buffers":[{"byteLength":4,"uri":"absent.bin"}]}"#
                    .to_vec(),
                "put it beside the scene",
            ),
            ("count.glb", altered(r#""count":6"#, r#""count":9"#), "reaches past its buffer view"),
            ("index.glb", altered(r#""byteOffset":0"#, r#""byteOffset":9"#), "an index is past"),
            ("camera.glb", altered(r#""camera":0"#, r#""camera":7"#), "camera: Index out of bounds"),
        ];
        for (name, bytes, wanted) in cases {
            let said = complaint(name, &bytes);
            assert!(said.contains(name) && said.contains(wanted) && !said.contains('\n'), "{name}: {said}");
        }
    }

    #[test]
    fn unknown_camera_lists_those_there_are() {
        let folder = std::env::temp_dir().join(format!("bevy_bounce_camera_{}.glb", std::process::id()));
        std::fs::write(&folder, cornell_box()).expect("a temporary file");
        let file = SceneFile::open(&folder).expect("a good file");
        assert!(matches!(file.camera(None), Ok(Some(camera)) if camera.name == "main"));
        assert!(file.camera(Some("aisle")).is_err_and(|error| error.to_string().contains("those there are: main")));
    }
}
