//! Dynamic global illumination for Bevy on every GPU that wgpu reaches.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_bounce::prelude::*;
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, GlobalIlluminationPlugins::default()))
//!     .add_systems(Startup, |mut commands: Commands| {
//!         commands.spawn((Camera3d::default(), GlobalIllumination::default()));
//!     })
//!     .run();
//! ```
//!
//! Every `Mesh3d` with a `StandardMaterial` and every light of Bevy takes part unless told
//! otherwise ([`VoxelizedMesh`], [`GiLight`]); other materials once a [`GiMaterialPlugin`] announces them.

pub mod avg;
pub mod budget;
mod camera;
pub mod compose;
mod compute;
pub mod cssm;
pub mod debug;
pub mod fog;
pub mod history;
pub mod interleaved;
mod memory;
mod plugins;
pub mod probes;
pub mod radiance_cache;
mod readback;
mod recovery;
pub mod scene;
mod settings;
pub mod shadow_atlas;
mod sort;
pub mod ssbc;
mod view;
pub mod vpl;

pub use avg::AvgPlugin;
pub use budget::{BudgetPlugin, GiBudget};
pub use compose::{GiComposePlugin, GiIsolate, ViewPass};
pub use cssm::{CssmFilter, CssmObject, CssmPart, CssmPlugin, CssmReceivers, CssmSettings};
pub use debug::{GiDebugPlugin, GiGizmos, VirtualLightGizmos};
pub use fog::GiFogPlugin;
pub use history::HistoryPlugin;
pub use interleaved::InterleavedShadingPlugin;
pub use memory::gpu_memory;
pub use plugins::{GiSystems, GlobalIlluminationPlugins};
pub use probes::{GiForwardPlugin, ProbeVolume, ProbeVolumePlugin};
pub use radiance_cache::{RadianceCachePlugin, RadianceCacheSettings};
pub use scene::{GiLight, GiMaterial, GiMaterialPlugin, GiScenePlugin, VoxelizedGroup, VoxelizedMesh};
pub use settings::{GiSettings, GlobalIllumination, Quality, Resolution, Technique, VplVisibility};
pub use shadow_atlas::ShadowAtlasPlugin;
pub use ssbc::{SsbcPlugin, SsbcSettings};
pub use vpl::{VplPlugin, vpl_count};

/// What a game needs to name.
pub mod prelude {
    pub use crate::{
        CssmObject, GiLight, GiMaterial, GiMaterialPlugin, GlobalIllumination, GlobalIlluminationPlugins, Quality,
        Resolution, Technique, VoxelizedGroup, VoxelizedMesh, VplVisibility,
    };
}
