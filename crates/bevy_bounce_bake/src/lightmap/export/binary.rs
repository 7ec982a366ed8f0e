//! The binary chunk and what describes it.

use glam::Vec3;
use serde_json::{Map, Value, json};

use super::push;
use crate::scene::Source;

/// `bufferView.target` of vertices and of indices.
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;
/// `accessor.componentType` of 32-bit floats and indices.
const FLOAT: u32 = 5126;
const UNSIGNED: u32 = 5125;

/// A glTF whose buffers are one.
pub struct Binary {
    pub root: Value,
    bytes: Vec<u8>,
}

impl Binary {
    /// Joins the buffers.
    pub fn new(mut root: Value, buffers: &[Vec<u8>]) -> Self {
        let (mut bytes, mut starts) = (Vec::new(), Vec::new());
        let lengths = root["buffers"].as_array().into_iter().flatten().map(|buffer| buffer["byteLength"].as_u64());
        let lengths: Vec<usize> = lengths.map(|length| length.unwrap_or(0) as usize).collect();
        for (buffer, length) in buffers.iter().zip(lengths) {
            pad(&mut bytes, 0);
            starts.push(bytes.len());
            bytes.extend(&buffer[..length.min(buffer.len())]);
        }
        for view in root["bufferViews"].as_array_mut().into_iter().flatten().filter_map(Value::as_object_mut) {
            let start = starts.get(view.get("buffer").and_then(Value::as_u64).unwrap_or(0) as usize);
            let offset = view.get("byteOffset").and_then(Value::as_u64).unwrap_or(0) as usize;
            view.insert("buffer".into(), 0.into());
            view.insert("byteOffset".into(), (offset + start.unwrap_or(&0)).into());
        }
        Self { root, bytes }
    }

    /// Pictures that are files beside the scene go in; those that are data URIs stay.
    pub fn take_in_pictures(&mut self, source: &Source) -> Result<(), String> {
        for number in 0..self.root["images"].as_array().map_or(0, Vec::len) {
            let uri = self.root["images"][number]["uri"].as_str().map(str::to_owned);
            let Some(uri) = uri.filter(|uri| !uri.starts_with("data:")) else { continue };
            let place = |problem: &str| format!("image {number}: {problem}");
            let bytes = source.file(&uri).map_err(|problem| place(&problem))?;
            let format = image::guess_format(&bytes).map_err(|_| place("neither PNG nor JPEG; export it as one"))?;
            let view = self.push_view(&bytes, None, None);
            let Some(image) = self.root["images"][number].as_object_mut() else { continue };
            image.remove("uri");
            image.insert("bufferView".into(), view.into());
            image.insert("mimeType".into(), format.to_mime_type().into());
        }
        Ok(())
    }

    /// An accessor like another one, over other elements of the same size in bytes. Each starts at a multiple of four.
    pub fn push_like(&mut self, other: &gltf::Accessor, elements: &[u8], target: bool) -> usize {
        let size = other.size().max(1);
        let stride = size.next_multiple_of(4);
        let mut bytes = Vec::with_capacity(elements.len() / size * stride);
        for element in elements.chunks_exact(size) {
            bytes.extend(element);
            bytes.resize(bytes.len() + stride - size, 0);
        }
        let view = self.push_view(&bytes, (stride != size).then_some(stride), target.then_some(VERTICES));
        let mut accessor = self.root["accessors"][other.index()].clone();
        if let Some(accessor) = accessor.as_object_mut() {
            for key in ["byteOffset", "sparse", "min", "max"] {
                accessor.remove(key);
            }
            accessor.insert("bufferView".into(), view.into());
            accessor.insert("count".into(), (elements.len() / size).into());
        }
        push(&mut self.root["accessors"], accessor)
    }

    /// Says between which corners an accessor's positions lie.
    pub fn set_bounds(&mut self, accessor: usize, positions: &[Vec3]) {
        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (min, max) = positions.iter().fold(empty, |(min, max), at| (min.min(*at), max.max(*at)));
        let accessor = &mut self.root["accessors"][accessor];
        accessor["min"] = json!(min.to_array());
        accessor["max"] = json!(max.to_array());
    }

    /// Pairs of floats.
    pub fn push_pairs(&mut self, pairs: &[[f32; 2]]) -> usize {
        let bytes: Vec<u8> = pairs.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        let view = self.push_view(&bytes, None, Some(VERTICES));
        let accessor = json!({ "bufferView": view, "componentType": FLOAT, "count": pairs.len(), "type": "VEC2" });
        push(&mut self.root["accessors"], accessor)
    }

    pub fn push_indices(&mut self, indices: &[u32]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let view = self.push_view(&bytes, None, Some(INDICES));
        let accessor =
            json!({ "bufferView": view, "componentType": UNSIGNED, "count": indices.len(), "type": "SCALAR" });
        push(&mut self.root["accessors"], accessor)
    }

    fn push_view(&mut self, bytes: &[u8], stride: Option<usize>, target: Option<u32>) -> usize {
        pad(&mut self.bytes, 0);
        let mut view = Map::new();
        view.insert("buffer".into(), 0.into());
        view.insert("byteOffset".into(), self.bytes.len().into());
        view.insert("byteLength".into(), bytes.len().into());
        stride.map(|stride| view.insert("byteStride".into(), stride.into()));
        target.map(|target| view.insert("target".into(), target.into()));
        self.bytes.extend(bytes);
        push(&mut self.root["bufferViews"], view.into())
    }

    /// The file.
    pub fn finish(mut self) -> Result<Vec<u8>, String> {
        pad(&mut self.bytes, 0);
        if !self.bytes.is_empty() {
            self.root["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        }
        let mut text =
            serde_json::to_vec(&self.root).map_err(|error| format!("its JSON cannot be written: {error}"))?;
        pad(&mut text, b' ');
        let length = |bytes: usize| u32::try_from(bytes).map_err(|_| "would take more than 4 GiB; split it".to_owned());
        let chunk = if self.bytes.is_empty() { 0 } else { 8 + self.bytes.len() };
        let mut file = Vec::with_capacity(20 + text.len() + chunk);
        file.extend(b"glTF");
        file.extend([2, length(20 + text.len() + chunk)?, length(text.len())?].map(u32::to_le_bytes).as_flattened());
        file.extend(b"JSON");
        file.extend(text);
        if !self.bytes.is_empty() {
            file.extend(length(self.bytes.len())?.to_le_bytes());
            file.extend(b"BIN\0");
            file.extend(self.bytes);
        }
        Ok(file)
    }
}

/// Fills up to a multiple of four bytes.
fn pad(bytes: &mut Vec<u8>, with: u8) {
    bytes.resize(bytes.len().next_multiple_of(4), with);
}
