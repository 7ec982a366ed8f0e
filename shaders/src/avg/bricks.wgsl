// How many workgroups the queue of bricks asks for: one an entry. Cost: one thread.

#import bevy_bounce::avg::queue::queue_capacity

@group(0) @binding(0) var<storage, read> queue: array<u32>;
@group(0) @binding(1) var<storage, read_write> brick_workgroups: array<u32, 3>;

@compute @workgroup_size(1)
fn size_bricks() {
    brick_workgroups = array<u32, 3>(min(queue[0], queue_capacity(arrayLength(&queue))), 1u, 1u);
}
