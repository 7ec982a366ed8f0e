// The queue of bricks that large triangles reach.
//
// Word 0: entries wanted, which may be more than there is room for. Then per entry: instance, triangle, brick.

#define_import_path bevy_bounce::avg::queue

const QUEUE_HEADER: u32 = 1u;
const QUEUE_WORDS: u32 = 3u;

/// Entries that a queue of so many words has room for.
fn queue_capacity(words: u32) -> u32 {
    return (words - QUEUE_HEADER) / QUEUE_WORDS;
}
