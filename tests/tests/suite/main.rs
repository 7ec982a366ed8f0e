//! Stages and shaders of bevy_bounce, by themselves and in frames. Few binaries, because each links Bevy; more than one, because
//! software adapters keep the memory of every shader they compiled, and a process may have only so many pieces of it.

mod agreement;
mod air;
mod ambient;
mod compose;
mod deform;
mod eyes;
mod fog;
mod guides;
mod harness;
mod history;
mod masks;
mod materials;
mod metrics;
mod near_lights;
mod nested;
mod octahedral;
mod particles;
mod paths;
mod pipelines;
mod probes;
mod radiance_cache;
mod sampling;
mod settle;
mod shaders;
mod shadow_atlas;
mod sky;
mod sort;
mod ssbc;
mod voxel_groups;
mod voxels;
