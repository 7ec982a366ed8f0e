// Codes of baked objects' depth maps, from the blocks as the files have them (crate bevy_bounce_cssm, `block`).
//
// The directory is that of a file's cube maps and, behind it, that of its maps from outside, then those of the next file; the
// blocks likewise, in pages of `2^page_bits` words, so that each page is a binding that every device allows.
//
// Cost: one read where a block has one code; otherwise also its head, the entry of the row, ends of its runs or a bit
// of each plane, an index and the code: three to ten. There is no loop here, nor more than one in a query: Mesa's software rasteriser
// leaves the loops of a thread after 65,535 rounds of all of them together, and a hierarchy's nodes shall be most of those.

#define_import_path bevy_bounce::cssm::maps

#import bevy_bounce::cssm::texels::bakes

@group(1) @binding(0) var<storage, read> directory: array<u32>;
@group(1) @binding(1) var<storage, read> blocks_a: array<u32>;
@group(1) @binding(2) var<storage, read> blocks_b: array<u32>;
@group(1) @binding(3) var<storage, read> blocks_c: array<u32>;

const LANES: u32 = 64u;
const ROWS: u32 = 32u;
const LANE_BITS: u32 = 6u;
const PALETTE_BITS: u32 = 11u;
const COUNT_BITS: u32 = 6u;
/// Head of a block: a second word follows.
const MORE_KINDS: u32 = 0x20000000u;
/// Directory: the block's only code.
const CONSTANT: u32 = 0x80000000u;

#ifdef COUNT_READS
var<private> reads: u32;
#endif

fn directory_word(index: u32) -> u32 {
#ifdef COUNT_READS
    reads++;
#endif
    return directory[index];
}

fn block_word(index: u32) -> u32 {
#ifdef COUNT_READS
    reads++;
#endif
    let at = index & ((1u << bakes.page_bits) - 1u);
    switch index >> bakes.page_bits {
        case 0u: {
            return blocks_a[at];
        }
        case 1u: {
            return blocks_b[at];
        }
        default: {
            return blocks_c[at];
        }
    }
}

// Bits needed to tell `count` things apart.
fn bits_for(count: u32) -> u32 {
    return 32u - countLeadingZeros(count - 1u);
}

// Up to 16 bits from bit `bit` of the block that starts at word `first`.
fn read_bits(first: u32, bit: u32, count: u32) -> u32 {
    if count == 0u {
        return 0u;
    }
    let word = first + (bit >> 5u);
    let shift = bit & 31u;
    var value = block_word(word) >> shift;
    if shift + count > 32u {
        value |= block_word(word + 1u) << (32u - shift);
    }
    return value & ((1u << count) - 1u);
}

// Whether a run, of those whose last lanes begin at `bit`, ends before `lane`.
fn ends_before(first: u32, bit: u32, run: u32, lane: u32) -> bool {
    return read_bits(first, bit + LANE_BITS * run, LANE_BITS) < lane;
}

// The run of 4, 8 or 16 that has `lane`, by halves.
fn find_run(first: u32, bit: u32, runs: u32, lane: u32) -> u32 {
    var run = 0u;
    if runs == 16u && ends_before(first, bit, 7u, lane) {
        run = 8u;
    }
    if runs >= 8u && ends_before(first, bit, run + 3u, lane) {
        run += 4u;
    }
    if ends_before(first, bit, run + 1u, lane) {
        run += 2u;
    }
    if ends_before(first, bit, run, lane) {
        run += 1u;
    }
    return run;
}

fn plane_bit(first: u32, bit: u32, plane: u32, lane: u32) -> u32 {
    return read_bits(first, bit + LANES * plane + lane, 1u) << plane;
}

// The slot of a record at `lane`, by 1, 3 or 6 bit planes that begin at `bit`.
fn plane_slot(first: u32, bit: u32, planes: u32, lane: u32) -> u32 {
    var slot = plane_bit(first, bit, 0u, lane);
    if planes >= 3u {
        slot |= plane_bit(first, bit, 1u, lane) | plane_bit(first, bit, 2u, lane);
    }
    if planes == 6u {
        slot |= plane_bit(first, bit, 3u, lane) | plane_bit(first, bit, 4u, lane) | plane_bit(first, bit, 5u, lane);
    }
    return slot;
}

// Numbers of records: of 4 runs, 8 runs, 1 plane, 16 runs, 3 planes and 6 planes.
struct Counts {
    few: vec3<u32>,
    many: vec3<u32>,
}

fn unpack_counts(fields: u32) -> vec3<u32> {
    return (vec3<u32>(fields) >> vec3<u32>(0u, COUNT_BITS, 2u * COUNT_BITS)) & vec3<u32>(63u);
}

// The palette index of a record's lane; records begin at bit `records_at`, smaller ones first.
fn record_index(first: u32, records_at: u32, counts: Counts, number: u32, index_bits: u32, lane: u32) -> u32 {
    let few_bits = vec3<u32>(4u, 8u, 2u) * index_bits + vec3<u32>(4u * LANE_BITS, 8u * LANE_BITS, LANES);
    let many_bits = vec3<u32>(16u, 8u, 64u) * index_bits + vec3<u32>(16u * LANE_BITS, 3u * LANES, 6u * LANES);
    // How many records of each kind come before.
    let a = min(number, counts.few.x);
    let b = min(number - a, counts.few.y);
    let c = min(number - a - b, counts.few.z);
    let left = number - a - b - c;
    let d = min(left, counts.many.x);
    let e = min(left - d, counts.many.y);
    let before = vec3<u32>(a, b, c) * few_bits;
    let after = vec3<u32>(d, e, left - d - e) * many_bits;
    let at = records_at + before.x + before.y + before.z + after.x + after.y + after.z;
    var runs = 0u;
    var planes = 0u;
    if a < counts.few.x {
        runs = 4u;
    } else if b < counts.few.y {
        runs = 8u;
    } else if c < counts.few.z {
        planes = 1u;
    } else if d < counts.many.x {
        runs = 16u;
    } else if e < counts.many.y {
        planes = 3u;
    } else {
        planes = 6u;
    }
    let slots = select(runs, 1u << planes, runs == 0u);
    var slot: u32;
    if runs > 0u {
        slot = find_run(first, at + slots * index_bits, runs, lane);
    } else {
        slot = plane_slot(first, at + slots * index_bits, planes, lane);
    }
    return read_bits(first, at + slot * index_bits, index_bits);
}

// The code of a row and lane in the block that starts at word `first`.
fn decode_block(first: u32, row: u32, lane: u32) -> u32 {
    let head = block_word(first);
    let palette = (head & ((1u << PALETTE_BITS) - 1u)) + 1u;
    var counts = Counts(unpack_counts(head >> PALETTE_BITS), vec3<u32>(0u));
    var at = 32u;
    if (head & MORE_KINDS) != 0u {
        counts.many = unpack_counts(block_word(first + 1u));
        at = 64u;
    }
    let records = counts.few + counts.many;
    let index_bits = bits_for(palette);
    let entry_bits = bits_for(palette + records.x + records.y + records.z);
    let palette_at = at + ROWS * entry_bits;
    var index = read_bits(first, at + row * entry_bits, entry_bits);
    if index >= palette {
        index = record_index(first, palette_at + 16u * palette, counts, index - palette, index_bits, lane);
    }
    return read_bits(first, palette_at + 16u * index, 16u);
}

/// The code behind an entry of the directory; blocks are counted from `base`.
fn map_code(entry: u32, base: u32, row: u32, lane: u32) -> u32 {
    let word = directory_word(entry);
    if (word & CONSTANT) != 0u {
        return word & 0xffffu;
    }
    return decode_block(base + word, row, lane);
}
