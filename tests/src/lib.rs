//! What the tests of bevy_bounce stand on.
//!
//! | module | what for |
//! |---|---|
//! | [`baked`] | small bakes as the GPU takes them |
//! | [`balls`] | glossy balls in a picture and its reference |
//! | [`cornell`] | light in the Cornell box by path tracing |
//! | [`compose`] | the shipped WGSL as naga modules, with Bevy's own modules beside it |
//! | [`eye`] | further cameras of a stage |
//! | [`translate`] | those modules in every language that a backend takes, and what they ask of a device |
//! | [`gpu`] | one compute shader on its own: bind, dispatch, read back |
//! | [`glb`] | whole glTF scenes in the form that the shaders read |
//! | [`layout`] | memory layouts of the structs that Rust and WGSL share |
//! | [`lightmaps`] | small glTF files, their lightmaps, and both in plain Bevy |
//! | [`picture`], [`metrics`], [`flip`] | pictures and how far apart they are |
//! | [`references`] | where scenes and path-traced references are |
//! | [`scene`] | small scenes in the form that the shaders read |
//! | [`stage`] | a scene rendered without a window |
//! | [`stats`] | chi-squared test |
//! | [`twins`] | the shaders again, in plain Rust |
//!
//! The tests are in `tests/suite` (stages and shaders), `tests/baked` (visibility and lightmaps), `tests/caches`
//! (radiance caches and history), `tests/frames` (whole frames) and `tests/settings` (what a camera asks for).
//! Environment: `BOUNCE_WEBGPU_LIMITS=1` runs every device with WebGPU's default limits and no optional feature;
//! `BOUNCE_SHARED` names the folder with scenes and references; `BOUNCE_STRICT=1` fails where they are absent instead
//! of skipping by name.

pub mod baked;
pub mod balls;
pub mod compose;
pub mod cornell;
pub mod eye;
pub mod flip;
pub mod glb;
pub mod gpu;
pub mod layout;
pub mod lightmaps;
pub mod metrics;
pub mod picture;
pub mod references;
pub mod scene;
pub mod stage;
pub mod stats;
pub mod translate;
pub mod twins;
