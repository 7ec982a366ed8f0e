//! How bounced light is averaged over frames, kernel by kernel.

mod shaders;
