//! Rigid objects with baked visibility, baked when the example starts.

use bevy::prelude::*;
use bevy_bounce::{CssmObject, CssmPart};
use bevy_bounce_bake::BakeSettings;
use bevy_bounce_cssm::CssmAsset;

use super::{Builder, Solid};
use crate::headless::Failed;
use crate::{Error, baked};

/// A solid and the linear albedo of its paint.
#[derive(Clone, Debug)]
pub struct Piece {
    /// What it is.
    pub name: &'static str,
    /// Its triangles.
    pub solid: Solid,
    /// Of the paint.
    pub albedo: [f32; 3],
}

/// Pieces of a rigid object, and what was baked of them.
pub struct BakedObject {
    name: &'static str,
    pieces: Vec<(&'static str, Handle<Mesh>, Handle<StandardMaterial>)>,
    bake: Option<Handle<CssmAsset>>,
}

impl BakedObject {
    /// Bakes an object, if there is something that takes it.
    pub fn new(
        name: &'static str,
        pieces: &[Piece],
        settings: &BakeSettings,
        build: &mut Builder,
        bakes: Option<&mut Assets<CssmAsset>>,
    ) -> Result<Self, Error> {
        let bake = match bakes {
            Some(bakes) => Some(bakes.add(CssmAsset { file: baked::bake_pieces(name, pieces, settings)? })),
            None => None,
        };
        let piece = |piece: &Piece| (piece.name, build.meshes.add(piece.solid.mesh()), build.paint(piece.albedo));
        Ok(Self { name, pieces: pieces.iter().map(piece).collect(), bake })
    }

    /// Spawns one such object.
    pub fn spawn(&self, commands: &mut Commands, at: Transform) -> Entity {
        let mut root = commands.spawn((Name::new(self.name), at, Visibility::default()));
        if let Some(bake) = &self.bake {
            root.insert(CssmObject { bake: bake.clone() });
        }
        root.with_children(|children| {
            for ((name, mesh, paint), part) in self.pieces.iter().zip(0..) {
                let mesh = (Mesh3d(mesh.clone()), MeshMaterial3d(paint.clone()));
                children.spawn((Name::new(*name), mesh, CssmPart(part)));
            }
        });
        root.id()
    }
}

/// Ends the run with what went wrong in a system.
pub fn report(result: Result<(), Error>, failed: &mut Failed) {
    if let Err(error) = result {
        failed.set(error);
    }
}
