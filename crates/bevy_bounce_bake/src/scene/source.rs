//! A glTF file and what it refers to, as bytes: from a folder, or from wherever else files come.

use std::collections::BTreeMap;
use std::path::Path;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;

use crate::BakeError;

/// A glTF file, its buffers and its pictures.
#[derive(Debug)]
pub struct Source {
    /// Name for messages: the path as it was given.
    pub name: String,
    pub(crate) gltf: gltf::Gltf,
    /// The JSON as it stands in the file.
    pub(crate) json: Vec<u8>,
    hash: crc32fast::Hasher,
    length: u64,
    files: BTreeMap<String, Vec<u8>>,
}

impl Source {
    /// Reads the file and all it refers to.
    pub fn open(path: &Path) -> Result<Self, BakeError> {
        let name = path.display().to_string();
        let read = |path: &Path| std::fs::read(path);
        let bytes = read(path).map_err(|error| {
            BakeError::source(&name, format!("cannot be read: {error}; give the path of a .glb or .gltf file"))
        })?;
        let mut source = Self::parse(name, &bytes)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for file in source.missing_files() {
            let path = folder.join(&file);
            let bytes = read(&path).map_err(|error| {
                BakeError::source(&source.name, format!("{}: {error}; put it beside the scene", path.display()))
            })?;
            source.add_file(file, bytes);
        }
        Ok(source)
    }

    /// Understands the glTF itself. `name` is for messages.
    pub fn parse(name: String, bytes: &[u8]) -> Result<Self, BakeError> {
        let problem = match bytes {
            [] => Some("is empty; export it anew".to_owned()),
            [b'g', b'l', b'T', b'F', ..] => super::check::truncated(bytes),
            _ => None,
        };
        if let Some(problem) = problem {
            return Err(BakeError::source(&name, problem));
        }
        let gltf =
            gltf::Gltf::from_slice(bytes).map_err(|error| BakeError::source(&name, super::check::describe(error)))?;
        let json = gltf::Glb::from_slice(bytes).map_or(bytes.to_vec(), |glb| glb.json.into_owned());
        let mut source = Self { name, gltf, json, hash: crc32fast::Hasher::new(), length: 0, files: BTreeMap::new() };
        source.count(bytes);
        for uri in source.uris() {
            decode_uri(&uri).map_err(|problem| BakeError::source(&source.name, problem))?;
        }
        Ok(source)
    }

    /// The files beside the glTF that it needs and that were not added yet, as paths relative to it.
    pub fn missing_files(&self) -> Vec<String> {
        let paths = self.uris().filter(|uri| !uri.starts_with("data:")).filter_map(|uri| decode_uri(&uri).ok());
        let mut paths: Vec<String> = paths.filter(|path| !self.files.contains_key(path)).collect();
        paths.sort();
        paths.dedup();
        paths
    }

    /// Adds one of the [missing files](Self::missing_files). The order counts for the hash.
    pub fn add_file(&mut self, path: String, bytes: Vec<u8>) {
        self.count(&bytes);
        self.files.insert(path, bytes);
    }

    /// The bytes behind a URI.
    pub(crate) fn file(&self, uri: &str) -> Result<Vec<u8>, String> {
        if let Some(data) = uri.strip_prefix("data:") {
            let (_, payload) = data.split_once(";base64,").ok_or("its data URI is not base64; export it anew")?;
            return BASE64_STANDARD.decode(payload).map_err(|error| format!("its data URI is broken: {error}"));
        }
        let path = decode_uri(uri)?;
        self.files.get(&path).cloned().ok_or_else(|| format!("{path} is missing; put it beside the scene"))
    }

    /// Hash and length of all bytes: CRC-32 in the high half.
    pub fn hash(&self) -> u64 {
        u64::from(self.hash.clone().finalize()) << 32 | (self.length & 0xffff_ffff)
    }

    fn uris(&self) -> impl Iterator<Item = String> + '_ {
        let buffers = self.gltf.buffers().filter_map(|buffer| match buffer.source() {
            gltf::buffer::Source::Uri(uri) => Some(uri.to_owned()),
            gltf::buffer::Source::Bin => None,
        });
        let images = self.gltf.images().filter_map(|image| match image.source() {
            gltf::image::Source::Uri { uri, .. } => Some(uri.to_owned()),
            gltf::image::Source::View { .. } => None,
        });
        buffers.chain(images)
    }

    fn count(&mut self, bytes: &[u8]) {
        self.hash.update(bytes);
        self.length += bytes.len() as u64;
    }
}

/// A relative URI as a path.
fn decode_uri(uri: &str) -> Result<String, String> {
    if uri.starts_with("data:") {
        return Ok(String::new());
    }
    if uri.contains("://") {
        return Err(format!("{uri}: files on the net are not fetched; put it beside the scene"));
    }
    let decoded = percent_encoding::percent_decode_str(uri).decode_utf8();
    decoded.map(|path| path.into_owned()).map_err(|_| format!("{uri}: not UTF-8; rename the file"))
}
