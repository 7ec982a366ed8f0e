// How bright bounced light at a pixel may be.

#define_import_path bevy_bounce::interleaved::brightest

/// Half of the largest half float, pre-exposed: of bounded light and of what compensation adds to it, so that the sum of both is a
/// number.
const BRIGHTEST: f32 = 32752.0;
