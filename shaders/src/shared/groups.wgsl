// Workgroups and their threads: the index of a folded dispatch, and a prefix sum within a workgroup.

#define_import_path bevy_bounce::shared::groups

/// Most workgroups along an axis; a longer row is folded into the second axis.
const MAX_WORKGROUPS: u32 = 65535u;

/// Index of a workgroup of a folded dispatch.
fn folded_index(group: vec3<u32>) -> u32 {
    return group.x + group.y * MAX_WORKGROUPS;
}

/// The stretch of a list of that length that a lane of a workgroup of 256 goes through: its first entry, and the end.
fn stretch_of(lane: u32, count: u32) -> vec2<u32> {
    let length = (count + SCAN_GROUP - 1u) / SCAN_GROUP;
    return min(vec2<u32>(lane, lane + 1u) * length, vec2<u32>(count));
}

/// Threads of a workgroup that takes part in a prefix sum.
const SCAN_GROUP: u32 = 256u;
/// Values that one of them sums up: the square root, so that there are as many rows.
const SCAN_ROW: u32 = 16u;

var<workgroup> scan_values: array<u32, SCAN_GROUP>;
var<workgroup> scan_rows: array<u32, SCAN_ROW>;

fn rows_before(row: u32) -> u32 {
    var sum = 0u;
    for (var i = 0u; i < row; i++) {
        sum += scan_rows[i];
    }
    return sum;
}

/// Sum of the values of lower lanes. All 256 threads take part; a barrier must come before the next one.
/// Dotsenko et al. 2008, "Fast Scan Algorithms on Graphics Processors".
///
/// Cost: 1 KiB of workgroup memory, two barriers, two rows of sixteen additions one after the other.
fn exclusive_scan(value: u32, lane: u32) -> u32 {
    scan_values[lane] = value;
    workgroupBarrier();
    if lane < SCAN_ROW {
        var sum = 0u;
        for (var i = lane * SCAN_ROW; i < (lane + 1u) * SCAN_ROW; i++) {
            let next = scan_values[i];
            scan_values[i] = sum;
            sum += next;
        }
        scan_rows[lane] = sum;
    }
    workgroupBarrier();
    return rows_before(lane / SCAN_ROW) + scan_values[lane];
}

/// Sum of the values of all lanes in the last scan.
fn scan_total() -> u32 {
    return rows_before(SCAN_ROW);
}
