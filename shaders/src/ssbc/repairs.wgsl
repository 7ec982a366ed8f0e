// The list of pixels for which there are too few samples of their surface.
//
// Words 0 to 2: workgroups that integrate them, as an indirect dispatch takes them. Word 3: how many they are. Then each: x in
// the low half, y in the high one.

#define_import_path bevy_bounce::ssbc::repairs

const REPAIR_COUNT: u32 = 3u;
const SSBC_REPAIR_HEADER: u32 = 4u;
const REPAIR_GROUP: u32 = 64u;
