// Skinned and morphed vertices where they stand this frame, one thread a vertex: morph targets first, then the skin, as
// Bevy's vertex shader does (bevy_pbr::morph, bevy_pbr::skinning).

#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::scene::{NONE, VERTEX_WORDS, SKIN_WORDS, DEFORMED_WORDS}

struct DeformJob {
    world_from_local_x: vec4<f32>,
    world_from_local_y: vec4<f32>,
    world_from_local_z: vec4<f32>,
    vertex_offset: u32,
    vertex_count: u32,
    skin_offset: u32,
    morph_offset: u32,
    deformed_offset: u32,
    joint_offset: u32,
    joint_count: u32,
    weight_offset: u32,
    weight_count: u32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
}

struct DeformChunk {
    job: u32,
    first_vertex: u32,
}

@group(0) @binding(0) var<storage, read_write> geometry: array<u32>;
@group(0) @binding(1) var<storage, read> jobs: array<DeformJob>;
@group(0) @binding(2) var<storage, read> chunks: array<DeformChunk>;
// Joint matrices, then morph weights, of one job after the other.
@group(0) @binding(3) var<storage, read> pose: array<f32>;


fn position_at(offset: u32) -> vec3<f32> {
    return vec3<f32>(
        bitcast<f32>(geometry[offset]),
        bitcast<f32>(geometry[offset + 1u]),
        bitcast<f32>(geometry[offset + 2u]),
    );
}

fn joint_row(job: DeformJob, joint: u32, row: u32) -> vec4<f32> {
    let o = job.joint_offset + min(joint, job.joint_count - 1u) * 12u + row * 4u;
    return vec4<f32>(pose[o], pose[o + 1u], pose[o + 2u], pose[o + 3u]);
}

// The weights are normalised: they are stored in 16 bits.
fn skinned(job: DeformJob, vertex: u32, position: vec3<f32>) -> vec3<f32> {
    let o = job.skin_offset + vertex * SKIN_WORDS;
    let joints = vec4<u32>(
        geometry[o] & 0xffffu,
        geometry[o] >> 16u,
        geometry[o + 1u] & 0xffffu,
        geometry[o + 1u] >> 16u,
    );
    let weights = vec4<f32>(unpack2x16unorm(geometry[o + 2u]), unpack2x16unorm(geometry[o + 3u]));
    let p = vec4<f32>(position, 1.0);
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i < 4u; i++) {
        let world = vec3<f32>(
            dot(joint_row(job, joints[i], 0u), p),
            dot(joint_row(job, joints[i], 1u), p),
            dot(joint_row(job, joints[i], 2u), p),
        );
        sum += weights[i] * world;
    }
    return sum / max(dot(weights, vec4<f32>(1.0)), 1e-6);
}

@compute @workgroup_size(64)
fn deform(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let chunk = chunks[folded_index(group)];
    if chunk.job == NONE {
        return;
    }
    let job = jobs[chunk.job];
    let vertex = chunk.first_vertex + thread;
    if vertex >= job.vertex_count {
        return;
    }
    var position = position_at(job.vertex_offset + vertex * VERTEX_WORDS);
    for (var target_index = 0u; target_index < job.weight_count; target_index++) {
        let weight = pose[job.weight_offset + target_index];
        if weight != 0.0 {
            position += weight * position_at(job.morph_offset + (target_index * job.vertex_count + vertex) * 3u);
        }
    }
    if job.skin_offset != NONE {
        position = skinned(job, vertex, position);
    } else {
        let p = vec4<f32>(position, 1.0);
        position = vec3<f32>(
            dot(job.world_from_local_x, p),
            dot(job.world_from_local_y, p),
            dot(job.world_from_local_z, p),
        );
    }
    let o = job.deformed_offset + vertex * DEFORMED_WORDS;
    geometry[o] = bitcast<u32>(position.x);
    geometry[o + 1u] = bitcast<u32>(position.y);
    geometry[o + 2u] = bitcast<u32>(position.z);
}
