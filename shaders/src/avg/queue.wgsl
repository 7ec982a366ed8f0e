// The queue of bricks that large triangles reach.
//
// Word 0: entries wanted, which may be more than there is room for. Then per entry: triangle, brick.

#define_import_path bevy_bounce::avg::queue

@group(0) @binding(7) var<storage, read_write> queue: array<atomic<u32>>;

const QUEUE_HEADER: u32 = 1u;
const QUEUE_WORDS: u32 = 2u;

struct QueueEntry {
    // Among those of all chunks.
    triangle: u32,
    brick: u32,
}

/// Entries that a queue of so many words has room for.
fn queue_capacity(words: u32) -> u32 {
    return (words - QUEUE_HEADER) / QUEUE_WORDS;
}

/// False where there is no room.
fn enqueue(entry: QueueEntry) -> bool {
    let index = atomicAdd(&queue[0], 1u);
    if index >= queue_capacity(arrayLength(&queue)) {
        return false;
    }
    let o = QUEUE_HEADER + index * QUEUE_WORDS;
    atomicStore(&queue[o], entry.triangle);
    atomicStore(&queue[o + 1u], entry.brick);
    return true;
}

fn queue_entry(index: u32) -> QueueEntry {
    let o = QUEUE_HEADER + index * QUEUE_WORDS;
    return QueueEntry(atomicLoad(&queue[o]), atomicLoad(&queue[o + 1u]));
}
