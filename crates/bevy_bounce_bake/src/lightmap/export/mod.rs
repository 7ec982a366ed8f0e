//! The scene with its second UV set: everything else stays as it stands in the file.
//!
//! The JSON is changed in place, so that what no reader here knows is kept. All buffers become the binary chunk, and
//! pictures beside the file go into it.

mod binary;
mod primitive;

use std::collections::{BTreeMap, HashMap, HashSet};

use serde_json::{Value, json};

use super::Volume;
use crate::BakeError;
use crate::atlas::Atlas;
use crate::scene::{Part, Scene, Source, buffers};
use binary::Binary;
use primitive::Lit;

/// What the scene says about its textures.
pub struct Marks {
    names: [String; 2],
    volume: Option<Volume>,
}

impl Marks {
    pub fn new(names: [String; 2], volume: Option<Volume>) -> Self {
        Self { names, volume }
    }
}

/// Nodes, and the primitives of each that are lit with their parts: one, or front and back.
type LitNodes<'a> = BTreeMap<usize, BTreeMap<usize, Vec<(&'a Part, usize)>>>;

/// The binary glTF of a source whose scene lies in that atlas.
pub fn scene(source: &Source, scene: &Scene, atlas: &Atlas, marks: &Marks) -> Result<Vec<u8>, BakeError> {
    let wrong = |problem: String| BakeError::source(&source.name, problem);
    let buffers = buffers(source).map_err(wrong)?;
    let root: Value = serde_json::from_slice(&source.json).map_err(|error| wrong(format!("is not JSON: {error}")))?;
    let mut export = Export { binary: Binary::new(root, &buffers), source, buffers: &buffers, atlas };
    export.binary.take_in_pictures(source).map_err(wrong)?;
    let nodes = lit_nodes(scene);
    if !atlas.charted.from_scene {
        export.split_meshes(&nodes).map_err(wrong)?;
        export.cull_backs(&nodes);
    }
    export.mark(&nodes, marks);
    export.binary.finish().map_err(wrong)
}

/// The parts by node and primitive, each with the number of its first triangle.
fn lit_nodes(scene: &Scene) -> LitNodes<'_> {
    let (mut nodes, mut first) = (LitNodes::new(), 0);
    for part in &scene.parts {
        let [node, _, primitive] = part.numbers.map(|number| number as usize);
        nodes.entry(node).or_default().entry(primitive).or_default().push((part, first));
        first += part.triangles.len();
    }
    nodes
}

struct Export<'a> {
    binary: Binary,
    source: &'a Source,
    buffers: &'a [Vec<u8>],
    atlas: &'a Atlas,
}

impl Export<'_> {
    /// Gives each node a mesh of its own, whose lit primitives have vertices of their own.
    fn split_meshes(&mut self, nodes: &LitNodes) -> Result<(), String> {
        let mut users: HashMap<usize, usize> = HashMap::new();
        for node in self.source.gltf.nodes() {
            *users.entry(node.mesh().map_or(usize::MAX, |mesh| mesh.index())).or_default() += 1;
        }
        for (&number, primitives) in nodes {
            let Some(mesh) = self.source.gltf.nodes().nth(number).and_then(|node| node.mesh()) else { continue };
            let mut json = self.binary.root["meshes"][mesh.index()].clone();
            for (&primitive, parts) in primitives {
                let Some(old) = mesh.primitives().nth(primitive) else { continue };
                let place = |problem| format!("mesh {}, primitive {primitive}: {problem}", mesh.index());
                primitive::check_second_set(&old).map_err(place)?;
                let lit = Lit::new(parts, self.atlas);
                lit.write(&mut self.binary, &old, self.buffers, &mut json["primitives"][primitive]).map_err(place)?;
            }
            if users.get(&mesh.index()) == Some(&1) {
                self.binary.root["meshes"][mesh.index()] = json;
            } else {
                let copy = push(&mut self.binary.root["meshes"], json);
                self.binary.root["nodes"][number]["mesh"] = copy.into();
            }
        }
        Ok(())
    }

    /// Lit primitives whose backs are triangles of their own get materials that do not draw backs.
    fn cull_backs(&mut self, nodes: &LitNodes) {
        let mut culled: BTreeMap<u64, usize> = BTreeMap::new();
        for (&number, primitives) in nodes {
            let Some(mesh) = self.binary.root["nodes"][number]["mesh"].as_u64() else { continue };
            for (&primitive, parts) in primitives {
                if parts.len() < 2 {
                    continue;
                }
                let root = &mut self.binary.root;
                let path = format!("/meshes/{mesh}/primitives/{primitive}/material");
                let Some(material) = root.pointer(&path).and_then(Value::as_u64) else { continue };
                let copy = *culled.entry(material).or_insert_with(|| {
                    let mut copy = root["materials"][material as usize].clone();
                    copy["doubleSided"] = false.into();
                    push(&mut root["materials"], copy)
                });
                root["meshes"][mesh as usize]["primitives"][primitive]["material"] = copy.into();
            }
        }
    }

    /// Says which primitives have light, and where the volume is.
    fn mark(&mut self, nodes: &LitNodes, marks: &Marks) {
        let root = &mut self.binary.root;
        let [lightmap, voxels] = &marks.names;
        let mut marked = HashSet::new();
        for (&number, primitives) in nodes {
            let mesh = root["nodes"][number]["mesh"].as_u64().unwrap_or_default() as usize;
            for &primitive in primitives.keys().filter(|&&primitive| marked.insert((mesh, primitive))) {
                add_extra(&mut root["meshes"][mesh]["primitives"][primitive], "lightmap", lightmap);
            }
        }
        let Some(volume) = marks.volume else { return };
        let mut node = json!({
            "name": "irradiance volume",
            "translation": volume.center.to_array(),
            "scale": volume.size.to_array(),
        });
        add_extra(&mut node, "irradiance_volume", voxels);
        let node = push(&mut root["nodes"], node);
        let scene = self.source.gltf.default_scene().or_else(|| self.source.gltf.scenes().next());
        let scene = scene.map_or(0, |scene| scene.index());
        push(&mut root["scenes"][scene]["nodes"], node.into());
    }
}

/// Appends to an array, which is made where there is none, and says at which place.
fn push(array: &mut Value, value: Value) -> usize {
    if !array.is_array() {
        *array = json!([]);
    }
    array.as_array_mut().map_or(0, |array| {
        array.push(value);
        array.len() - 1
    })
}

/// Adds to `extras`; those that are no object go into one.
fn add_extra(owner: &mut Value, key: &str, value: &str) {
    let extras = &mut owner["extras"];
    if !extras.is_object() {
        *extras = if extras.is_null() { json!({}) } else { json!({ "extras": extras.take() }) };
    }
    extras[key] = value.into();
}
