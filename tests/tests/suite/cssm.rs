//! Baked visibility on the GPU against the CPU.

mod light;
mod query;
mod stage;
