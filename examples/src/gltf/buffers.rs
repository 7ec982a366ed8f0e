//! A glTF file's buffers, wherever they are.

use std::path::Path;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;

/// The bytes of every buffer, as long as the file says.
pub type Buffers = Vec<Vec<u8>>;

/// Reads all buffers; checks their lengths, and that every view lies within its buffer.
pub fn load(file: &gltf::Gltf, folder: &Path) -> Result<Buffers, String> {
    let mut buffers = Buffers::new();
    for buffer in file.buffers() {
        let place = format!("buffer {}", buffer.index());
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => {
                file.blob.clone().ok_or_else(|| format!("{place}: its binary chunk is missing; export it anew"))?
            }
            gltf::buffer::Source::Uri(uri) => read(uri, folder).map_err(|problem| format!("{place}: {problem}"))?,
        };
        if bytes.len() < buffer.length() {
            let (there, needed) = (bytes.len(), buffer.length());
            return Err(format!("{place}: {there} of {needed} bytes are there; copy the file again"));
        }
        buffers.push(bytes);
    }
    for view in file.views() {
        let end = view.offset().checked_add(view.length());
        if end.is_none_or(|end| end > view.buffer().length()) {
            return Err(format!("buffer view {} reaches past its buffer; export it anew", view.index()));
        }
    }
    Ok(buffers)
}

fn read(uri: &str, folder: &Path) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, payload) = data.split_once(";base64,").ok_or("its data URI is not base64; export it anew")?;
        return BASE64_STANDARD.decode(payload).map_err(|error| format!("its data URI is broken: {error}"));
    }
    let path = folder.join(decode_uri(uri)?);
    std::fs::read(&path).map_err(|error| format!("{}: {error}; put it beside the scene", path.display()))
}

/// A relative URI as a path.
pub fn decode_uri(uri: &str) -> Result<String, String> {
    if uri.contains("://") {
        return Err(format!("{uri}: files on the net are not fetched; put it beside the scene"));
    }
    let decoded = percent_encoding::percent_decode_str(uri).decode_utf8();
    decoded.map(|path| path.into_owned()).map_err(|_| format!("{uri}: not UTF-8; rename the file"))
}
