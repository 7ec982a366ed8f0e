//! Baked visibility for a scene, from its file or made on the spot.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use bevy::prelude::warn;
use bevy_bounce_bake::scene::{Material, Part};
use bevy_bounce_bake::{BAKER_VERSION, BakeSettings, Scene, Source, bake, write_atomically};
use bevy_bounce_cssm::CssmFile;

use crate::Error;
use crate::scenes::{Piece, Solid};

/// Reads `file`; without one, bakes `scene` with the default settings, which takes seconds to minutes.
pub fn load(file: Option<&Path>, scene: &Path) -> Result<CssmFile, Error> {
    match file {
        Some(file) => {
            let bytes = std::fs::read(file).map_err(|error| Error::file(file, format!("cannot be read: {error}")))?;
            CssmFile::from_bytes(&bytes).map_err(|error| Error::file(file, error.to_string()))
        }
        None => {
            let source = Source::open(scene).map_err(|error| Error::file(scene, error.to_string()))?;
            let baked = Scene::from_gltf(&source).and_then(|scene| bake(&scene, &BakeSettings::default(), &()));
            Ok(baked.map_err(|error| Error::file(scene, format!("cannot be baked: {error}")))?.0)
        }
    }
}

/// Bakes an object out of pieces, or takes what is in the system's temporary folder since the last time.
pub fn bake_pieces(name: &str, pieces: &[Piece], settings: &BakeSettings) -> Result<CssmFile, Error> {
    let scene = scene(pieces);
    let path = kept(name, &scene, settings);
    let held = std::fs::read(&path).ok().and_then(|bytes| CssmFile::from_bytes(&bytes).ok());
    if let Some(file) = held {
        return Ok(file);
    }
    let baked = bake(&scene, settings, &());
    let (file, _) = baked.map_err(|error| Error::Usage(format!("{name} cannot be baked: {error}")))?;
    let folder = path.parent().map_or(Ok(()), std::fs::create_dir_all);
    if folder.is_err() || write_atomically(&path, &file.to_bytes()).is_err() {
        warn!("{}: the bake cannot be kept and is made again at the next start", path.display());
    }
    Ok(file)
}

/// Where a bake is kept: another name for another scene, other settings and another baker.
fn kept(name: &str, scene: &Scene, settings: &BakeSettings) -> PathBuf {
    let mut hasher = DefaultHasher::new();
    (BAKER_VERSION, settings.atlas, settings.depth, settings.strategy as u32, settings.unwrap).hash(&mut hasher);
    for (part, material) in scene.parts.iter().zip(&scene.materials) {
        let colors = part.colors.iter().flatten().chain([&material.factor]).flat_map(|color| color.to_array());
        let atlas = part.uv1.iter().flatten().flat_map(|at| at.to_array());
        let numbers = part.positions.iter().flat_map(|position| position.to_array()).chain(colors).chain(atlas);
        numbers.for_each(|number| number.to_bits().hash(&mut hasher));
        part.triangles.hash(&mut hasher);
    }
    std::env::temp_dir().join("bevy_bounce").join(format!("{name}-{:016x}.cssm", hasher.finish()))
}

/// A part and a material of each piece.
fn scene(pieces: &[Piece]) -> Scene {
    let part = |(number, piece): (usize, &Piece)| {
        let Solid { positions, normals, colors, atlas, indices } = &piece.solid;
        let triangles = indices.as_chunks::<3>().0.to_vec();
        let count = triangles.len() as u32;
        Part {
            name: piece.name.to_owned(),
            numbers: [0, number as u32, 0],
            positions: positions.iter().map(|position| position.to_array().into()).collect(),
            triangles,
            source_triangles: (0..count).collect(),
            source_count: count,
            normals: Some(normals.iter().map(|normal| normal.to_array().into()).collect()),
            uv1: (!atlas.is_empty()).then(|| atlas.iter().map(|at| at.to_array().into()).collect()),
            colors: Some(colors.iter().map(|color| color.extend(1.0).to_array().into()).collect()),
            material: number,
            ..Part::default()
        }
    };
    let material = |piece: &Piece| {
        let [r, g, b] = piece.albedo;
        Material { factor: [r, g, b, 1.0].into(), ..Material::default() }
    };
    Scene {
        parts: pieces.iter().enumerate().map(part).collect(),
        materials: pieces.iter().map(material).chain([Material::default()]).collect(),
        source_hash: 0,
    }
}
