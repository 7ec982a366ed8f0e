//! Rigid groups with voxel grids of their own: rays meet them where they stand, and the light is that of meshes voxelised with the world.

mod cones;
mod frames;
mod rays;
