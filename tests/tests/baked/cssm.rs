//! Baked visibility on the GPU against the CPU.

mod examples;
mod eyes;
mod glossy;
mod light;
mod materials;
mod moving;
mod query;
mod references;
mod spread;
mod stage;
mod table;
mod views;
