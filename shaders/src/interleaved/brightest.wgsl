// How bright bounced light at a pixel may be.

#define_import_path bevy_bounce::interleaved::brightest

/// Half of the largest half float, pre-exposed: each of bounded light and of what compensation adds to it has as much at most, so that
/// the sum of both is a number.
const BRIGHTEST_PART: f32 = 32752.0;
