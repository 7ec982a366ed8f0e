//! All tests of bevy_bounce that need more than one crate: one binary, because each links Bevy.

mod agreement;
mod beside;
mod compose;
mod cssm;
mod deform;
mod guides;
mod harness;
mod history;
mod lightmap;
mod metrics;
mod octahedral;
mod panel;
mod paths;
mod pictures;
mod pipelines;
mod probes;
mod radiance_cache;
mod sampling;
mod settle;
mod shaders;
mod shadow_atlas;
mod soak;
mod sort;
mod ssbc;
mod views;
mod voxels;
