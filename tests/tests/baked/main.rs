//! What is baked: visibility, with the light that is computed by it, and lightmaps.

mod cssm;
mod lightmap;
