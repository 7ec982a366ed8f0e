// Triangles by their number among those of all chunks.

#define_import_path bevy_bounce::shared::chunks

#import bevy_bounce::shared::grid::GridLevel
#import bevy_bounce::shared::scene::{Chunk, CHUNK_TRIANGLES}
#import bevy_bounce::shared::triangles::{Triangle, load_triangle}

@group(0) @binding(6) var<storage, read> chunks: array<Chunk>;

/// In voxels of a grid. Not valid where the last chunk of an instance has no more.
fn triangle_of(triangle: u32, level: GridLevel) -> Triangle {
    let chunk = chunks[triangle / CHUNK_TRIANGLES];
    return load_triangle(chunk.instance, chunk.first_triangle + triangle % CHUNK_TRIANGLES, level.origin, level.voxel_size);
}
