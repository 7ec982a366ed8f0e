// Which paths go on. Few do after some bounces: those that do not take no threads.
//
// Cost, a bounce: a load a path, an atomic for each that goes on.

#import bevy_bounce::vpl::types::{Path, VplParameters, START, NO_PATH}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<storage, read_write> paths: array<Path>;
// How many go on; 0 between bounces.
@group(0) @binding(2) var<storage, read_write> alive_count: atomic<u32>;
@group(0) @binding(3) var<storage, read_write> alive_workgroups: array<u32, 3>;

/// Threads of the workgroups that take them.
const GROUP: u32 = 64u;

@compute @workgroup_size(64)
fn begin_paths(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < parameters.path_count {
        paths[id.x] = Path(0u, 1u, START, NO_PATH);
    }
}

@compute @workgroup_size(64)
fn gather_alive(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < parameters.path_count && paths[id.x].first != 0u {
        paths[atomicAdd(&alive_count, 1u)].alive = id.x;
    }
}

@compute @workgroup_size(64)
fn size_alive(@builtin(local_invocation_index) lane: u32) {
    let count = atomicLoad(&alive_count);
    if count + lane < parameters.path_count {
        paths[count + lane].alive = NO_PATH;
    }
    storageBarrier();
    if lane == 0u {
        alive_workgroups = array<u32, 3>((count + GROUP - 1u) / GROUP, 1u, 1u);
        atomicStore(&alive_count, 0u);
    }
}
