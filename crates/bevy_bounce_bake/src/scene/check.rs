//! What can be wrong with a glTF file before its triangles are read. The `gltf` crate's readers rely on it.

use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Semantic;

/// What is wrong with the container of a binary glTF.
pub fn truncated(bytes: &[u8]) -> Option<String> {
    let word = |at: usize| bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
    match (word(4), word(8)) {
        (Some(2), Some(length)) if length as usize > bytes.len() => {
            Some(format!("is truncated: {} of {length} bytes are there; copy it again", bytes.len()))
        }
        (Some(2), Some(_)) => None,
        (Some(version), Some(_)) => Some(format!("is glTF version {version}; version 2 is understood, export it anew")),
        _ => Some("is truncated: its header is cut off; copy it again".into()),
    }
}

/// An error of the `gltf` crate in one line.
pub fn describe(error: gltf::Error) -> String {
    match error {
        gltf::Error::Validation(problems) => match problems.first() {
            Some((path, problem)) => format!("is not valid glTF at {path}: {problem}; export it anew"),
            None => "is not valid glTF; export it anew".into(),
        },
        gltf::Error::Deserialize(problem) => format!("is not valid glTF JSON: {problem}; export it anew"),
        other => format!("is not valid glTF: {other}; export it anew"),
    }
}

/// Whether every view lies in its buffer and every accessor in its view.
pub fn ranges(file: &gltf::Gltf, buffers: &[Vec<u8>]) -> Result<(), String> {
    for view in file.views() {
        let length = buffers.get(view.buffer().index()).map_or(0, Vec::len);
        if view.offset().checked_add(view.length()).is_none_or(|end| end > length) {
            return Err(format!("buffer view {} reaches past its buffer; export it anew", view.index()));
        }
    }
    let end = |offset: usize, stride: usize, size: usize, count: usize| {
        stride.checked_mul(count.saturating_sub(1)).and_then(|bytes| bytes.checked_add(size)?.checked_add(offset))
    };
    for accessor in file.accessors() {
        let size = accessor.size();
        let mut fits = accessor.view().is_some() || accessor.sparse().is_some();
        if let Some(view) = accessor.view() {
            let stride = view.stride().unwrap_or(size);
            let end = end(accessor.offset(), stride, size, accessor.count());
            fits &= accessor.count() == 0 || (stride >= size && end.is_some_and(|end| end <= view.length()));
        }
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let index = indices.index_type().size();
            let ends = [
                (end(indices.offset(), index, index, sparse.count()), indices.view().length()),
                (end(values.offset(), size, size, sparse.count()), values.view().length()),
            ];
            // Without a view, all but the sparse values are zeros: as many as the file claims.
            fits &= accessor.view().is_some() || accessor.count() <= 1 << 24;
            fits &= ends.iter().all(|(end, length)| end.is_some_and(|end| end <= *length));
        }
        if !fits {
            return Err(format!("accessor {} reaches past its buffer view; export it anew", accessor.index()));
        }
    }
    Ok(())
}

/// Whether attributes and indices have types that can be read.
pub fn types(primitive: &gltf::Primitive) -> Result<(), String> {
    for (semantic, accessor) in primitive.attributes() {
        let (data, dimensions) = (accessor.data_type(), accessor.dimensions());
        let unsigned = matches!(data, DataType::F32 | DataType::U8 | DataType::U16);
        let right = match semantic {
            Semantic::Positions | Semantic::Normals => data == DataType::F32 && dimensions == Dimensions::Vec3,
            Semantic::TexCoords(0 | 1) => unsigned && dimensions == Dimensions::Vec2,
            Semantic::Colors(0) => unsigned && matches!(dimensions, Dimensions::Vec3 | Dimensions::Vec4),
            _ => true,
        };
        if !right {
            let semantic = semantic.to_string();
            return Err(format!("{semantic} is {dimensions:?} of {data:?}; export it as floats"));
        }
    }
    if let Some(accessor) = primitive.indices() {
        let unsigned = matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32);
        if !unsigned || accessor.dimensions() != Dimensions::Scalar {
            return Err("indices are not unsigned integers; export it anew".into());
        }
    }
    Ok(())
}
