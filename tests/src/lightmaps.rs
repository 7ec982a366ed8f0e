//! Small glTF files, what `bounce-bake lightmap` makes of them, and that in Bevy without a plugin of this project.

use std::path::Path;

use bevy::camera::{Camera3d, Exposure};
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::light::IrradianceVolume;
use bevy::pbr::{DefaultOpaqueRendererMethod, Lightmap};
use bevy::prelude::*;
use bevy_bounce_bake::lightmap::texture_names;
use bevy_bounce_bake::{LightmapFiles, LightmapReport, LightmapSettings, Source, bake_lightmap};
use bevy_bounce_examples::Run;
use bevy_bounce_examples::gltf::{GltfScenePlugin, SceneFile};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::picture::Picture;
use crate::stage::{Stage, run};

/// Name of the scenes, without extension.
pub const STEM: &str = "room";

/// Bakes a file's bytes.
pub fn bake(bytes: &[u8], settings: &LightmapSettings) -> (LightmapFiles, LightmapReport) {
    let source = Source::parse("room.glb".into(), bytes).unwrap_or_else(|error| panic!("{error}"));
    bake_lightmap(&source, STEM, settings, &()).unwrap_or_else(|error| panic!("{error}"))
}

/// The JSON of a binary glTF, and what follows it.
pub fn split(bytes: &[u8]) -> (Value, &[u8]) {
    let length = bytes[12..16].try_into().map_or(0, u32::from_le_bytes) as usize;
    let json = serde_json::from_slice(&bytes[20..20 + length]).unwrap_or_else(|error| panic!("{error}"));
    (json, &bytes[20 + length..])
}

/// A binary glTF of both.
pub fn join(json: &Value, rest: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let lengths = [2, 20 + text.len() + rest.len(), text.len()].map(|word| (word as u32).to_le_bytes());
    [&b"glTF"[..], lengths.as_flattened(), b"JSON", &text, rest].concat()
}

/// Writes a binary glTF.
#[derive(Default)]
pub struct GlbBuilder {
    /// Arrays and objects of the file; nodes become one scene.
    pub json: serde_json::Map<String, Value>,
    bytes: Vec<u8>,
}

impl GlbBuilder {
    /// Appends to an array of the file, and says at which place.
    pub fn push(&mut self, array: &str, value: Value) -> usize {
        let array = self.json.entry(array).or_insert_with(|| json!([]));
        array.as_array_mut().map_or(0, |array| {
            array.push(value);
            array.len() - 1
        })
    }

    /// An accessor over 32-bit floats (5126) or indices (5125).
    pub fn accessor(&mut self, words: &[[u8; 4]], component: u32, kind: &str, width: usize) -> usize {
        let view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": 4 * words.len() });
        self.bytes.extend(words.as_flattened());
        let view = self.push("bufferViews", view);
        let count = words.len() / width;
        self.push("accessors", json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }))
    }

    /// Triplets of floats.
    pub fn vectors(&mut self, values: &[Vec3]) -> usize {
        let words: Vec<[u8; 4]> = values.iter().flat_map(|value| value.to_array()).map(f32::to_le_bytes).collect();
        let accessor = self.accessor(&words, 5126, "VEC3", 3);
        let (min, max) = values.iter().fold((values[0], values[0]), |(min, max), at| (min.min(*at), max.max(*at)));
        self.json["accessors"][accessor]["min"] = json!(min.to_array());
        self.json["accessors"][accessor]["max"] = json!(max.to_array());
        accessor
    }

    /// A mesh of one primitive.
    pub fn mesh(&mut self, positions: &[Vec3], triangles: &[[u32; 3]], material: Option<usize>) -> usize {
        let positions = self.vectors(positions);
        let words: Vec<[u8; 4]> = triangles.as_flattened().iter().map(|index| index.to_le_bytes()).collect();
        let indices = self.accessor(&words, 5125, "SCALAR", 1);
        let mut primitive = json!({ "attributes": { "POSITION": positions }, "indices": indices });
        if let Some(material) = material {
            primitive["material"] = material.into();
        }
        self.push("meshes", json!({ "primitives": [primitive] }))
    }

    /// A lamp, and the node that holds it.
    pub fn lamp(&mut self, lamp: Value, mut node: Value) {
        node["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
        self.push("nodes", node);
        self.json.insert("extensions".into(), json!({ "KHR_lights_punctual": { "lights": [lamp] } }));
    }

    /// The file.
    pub fn finish(mut self) -> Vec<u8> {
        let nodes = self.json.get("nodes").and_then(Value::as_array).map_or(0, Vec::len);
        self.json.insert("asset".into(), json!({ "version": "2.0" }));
        self.json.insert("buffers".into(), json!([{ "byteLength": self.bytes.len() }]));
        self.json.insert("scenes".into(), json!([{ "nodes": (0..nodes).collect::<Vec<_>>() }]));
        self.json.insert("scene".into(), 0.into());
        let header = [(self.bytes.len() as u32).to_le_bytes(), *b"BIN\0"].concat();
        join(&Value::Object(self.json), &[header, self.bytes].concat())
    }
}

/// Corners and triangles of a cube seen from within.
pub fn room(half: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for side in [-half, half] {
            let first = positions.len() as u32;
            for (u, v) in [(-half, -half), (half, -half), (half, half), (-half, half)] {
                let mut corner = [side; 3];
                (corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (u, v);
                positions.push(Vec3::from(corner));
            }
            let quad = [[0, 1, 2], [0, 2, 3]].map(|corners| corners.map(|corner| first + corner));
            triangles.extend(if side < 0.0 { quad } else { quad.map(|[a, b, c]| [a, c, b]) });
        }
    }
    (positions, triangles)
}

/// The texels of a KTX 2 file that was written, and its width, height and depth.
pub fn texels(file: &[u8]) -> (Vec<Vec3>, UVec3) {
    use bevy::image::{CompressedImageFormats, ImageSampler, ImageType};
    let kind = ImageType::Extension("ktx2");
    let formats = CompressedImageFormats::NONE;
    let image = Image::from_buffer(file, kind, formats, false, ImageSampler::Default, default());
    let image = image.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(image.texture_descriptor.format, bevy::render::render_resource::TextureFormat::Rgb9e5Ufloat);
    let size = image.texture_descriptor.size;
    let word = |bytes: &[u8; 4]| {
        let word = u32::from_le_bytes(*bytes);
        let unit = 2.0f32.powi((word >> 27) as i32 - 24);
        Vec3::from([0, 9, 18].map(|shift| (word >> shift & 511) as f32 * unit))
    };
    let texels = image.data.unwrap_or_default().as_chunks().0.iter().map(word).collect();
    (texels, UVec3::new(size.width, size.height, size.depth_or_array_layers))
}

/// A baked scene in plain Bevy.
pub struct Baked {
    stage: Stage,
    _folder: TempDir,
}

impl Baked {
    /// Shows what was baked through the camera `main`, without its light.
    pub fn new(files: &LightmapFiles, size: UVec2, deferred: bool) -> Self {
        let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
        let write = |name: &str, bytes: &[u8]| {
            std::fs::write(folder.path().join(name), bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        };
        let [lightmap, volume] = texture_names(STEM);
        write(&format!("{STEM}.glb"), &files.scene);
        write(&lightmap, &files.lightmap);
        write(&volume, files.volume.as_deref().unwrap_or_default());
        let stage = stage(folder.path(), size, deferred);
        Self { stage, _folder: folder }
    }

    /// The scene, to change it.
    pub fn world(&mut self) -> &mut World {
        self.stage.world()
    }

    /// What the camera sees, in cd/m^2.
    pub fn picture(&mut self) -> Picture {
        self.stage.settled_picture()
    }

    /// Hands out the lightmap, by what the file says about it.
    pub fn add_lightmap(&mut self) {
        let image = self.load(0);
        for entity in self.marked(&texture_names(STEM)[0]) {
            let mut entity = self.stage.world().entity_mut(entity);
            entity.insert(Lightmap { image: image.clone(), ..default() });
            // Bevy chooses pipelines anew only where the mesh itself has changed.
            entity.get_mut::<Mesh3d>().iter_mut().for_each(DetectChangesMut::set_changed);
        }
    }

    /// Hands out the irradiance volume.
    pub fn add_volume(&mut self) {
        let voxels = self.load(1);
        for entity in self.marked(&texture_names(STEM)[1]) {
            let volume = IrradianceVolume { voxels: voxels.clone(), intensity: 1.0, ..default() };
            self.stage.world().entity_mut(entity).insert(volume);
        }
    }

    /// Entities whose extras name a file.
    fn marked(&mut self, name: &str) -> Vec<Entity> {
        let world = self.stage.world();
        let mut extras = world.query::<(Entity, &bevy::gltf::GltfExtras)>();
        let marked = extras.iter(world).filter(|(_, extras)| extras.value.contains(name)).map(|(entity, _)| entity);
        let marked: Vec<Entity> = marked.collect();
        assert!(!marked.is_empty(), "nothing names {name}");
        marked
    }

    fn load(&mut self, texture: usize) -> Handle<Image> {
        let assets = self.stage.world().resource::<AssetServer>().clone();
        let image: Handle<Image> = assets.load(texture_names(STEM)[texture].clone());
        for _ in 0..1000 {
            self.stage.frame(std::time::Duration::ZERO);
            if assets.is_loaded(&image) {
                return image;
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        panic!("{} is not loaded", texture_names(STEM)[texture]);
    }
}

fn stage(folder: &Path, size: UVec2, deferred: bool) -> Stage {
    let file = SceneFile::open(&folder.join(format!("{STEM}.glb"))).unwrap_or_else(|error| panic!("{error}"));
    let camera = file.camera(None).unwrap_or_else(|error| panic!("{error}")).cloned();
    let run = Run { plain_bevy: true, exposure: Some(Exposure::EV100_INDOOR), ..run(size, None) };
    Stage::with_assets(run, Some(folder.to_owned()), |app| {
        if !deferred {
            app.insert_resource(DefaultOpaqueRendererMethod::forward()).add_observer(without_prepasses);
        }
        app.add_plugins(GltfScenePlugin { file, camera, matte: false, flip_textures: false, bake: None });
    })
}

fn without_prepasses(add: On<Add, Camera3d>, mut commands: Commands) {
    commands.entity(add.entity).remove::<(DepthPrepass, DeferredPrepass)>();
}

/// What the lightmap adds to a picture.
pub fn bounced(with: &Picture, without: &Picture) -> Picture {
    Picture::from_fn(with.width, with.height, |x, y| {
        let (with, without) = (with.at(x, y), without.at(x, y));
        std::array::from_fn(|channel| with[channel] - without[channel])
    })
}
