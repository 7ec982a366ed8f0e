//! glTF files: checked before Bevy sees them, then spawned, lit and exposed the way the references are.

mod buffers;
mod check;
mod handler;
mod mips;
mod scene;

pub use check::{FileCamera, SceneFile};
pub use scene::GltfScenePlugin;
