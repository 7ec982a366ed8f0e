// Workgroups and their threads: the index of a folded dispatch, and a prefix sum within a workgroup.

#define_import_path bevy_bounce::shared::groups

/// Most workgroups along an axis; a longer row is folded into the second axis.
const MAX_WORKGROUPS: u32 = 65535u;

/// Index of a workgroup of a folded dispatch.
fn folded_index(group: vec3<u32>) -> u32 {
    return group.x + group.y * MAX_WORKGROUPS;
}

/// Threads of a workgroup that takes part in a prefix sum.
const SCAN_GROUP: u32 = 256u;

var<workgroup> scan_values: array<u32, SCAN_GROUP>;

/// Sum of the values of lower lanes. All 256 threads take part. Hillis & Steele 1986.
///
/// Cost: 1 KiB of workgroup memory, sixteen barriers.
fn exclusive_scan(value: u32, lane: u32) -> u32 {
    scan_values[lane] = value;
    workgroupBarrier();
    for (var step = 1u; step < SCAN_GROUP; step <<= 1u) {
        let lower = select(0u, scan_values[max(lane, step) - step], lane >= step);
        workgroupBarrier();
        scan_values[lane] += lower;
        workgroupBarrier();
    }
    return scan_values[lane] - value;
}

/// Sum of the values of all lanes in the last scan; a barrier must come before the next one.
fn scan_total() -> u32 {
    return scan_values[SCAN_GROUP - 1u];
}
