// Puts pixels on the list of those that are integrated anew.
//
// Cost: an atomic addition in the workgroup's memory by each thread that lists any, and two in the buffer by a workgroup that does.

#define_import_path bevy_bounce::ssbc::list

#import bevy_bounce::shared::groups::MAX_WORKGROUPS
#import bevy_bounce::ssbc::repairs::{SSBC_REPAIR_HEADER, REPAIR_COUNT, REPAIR_GROUP}

@group(0) @binding(5) var<storage, read_write> repairs: array<atomic<u32>>;

var<workgroup> listed: atomic<u32>;
var<workgroup> first_slot: u32;

fn groups_for(pixels: u32) -> u32 {
    return min((pixels + REPAIR_GROUP - 1u) / REPAIR_GROUP, MAX_WORKGROUPS);
}

// Room for that many more.
fn append(count: u32) -> u32 {
    let at = atomicAdd(&repairs[REPAIR_COUNT], count);
    atomicAdd(&repairs[0], groups_for(at + count) - groups_for(at));
    atomicStore(&repairs[1], 1u);
    atomicStore(&repairs[2], 1u);
    return at;
}

/// Those of the four pixels from `first` on whose bits are set. All threads of a workgroup call it together.
fn list_pixels(first: vec2<u32>, bits: u32, lane: u32) {
    var slot = 0u;
    if bits != 0u {
        slot = atomicAdd(&listed, countOneBits(bits));
    }
    workgroupBarrier();
    if lane == 0u {
        let count = atomicLoad(&listed);
        if count > 0u {
            first_slot = append(count);
        }
    }
    workgroupBarrier();
    for (var left = bits; left != 0u; left &= left - 1u) {
        let i = countTrailingZeros(left);
        let pixel = first + vec2<u32>(i & 1u, i >> 1u);
        atomicStore(&repairs[SSBC_REPAIR_HEADER + first_slot + slot], pixel.x | (pixel.y << 16u));
        slot++;
    }
}
