// How loops end.

#define_import_path bevy_bounce::shared::loops

/// Whether a loop is not yet at the end of what a uniform counts; `own`: anything below 3e38 that is not the same in all threads, or
/// in all workgroups, without which Mesa's software driver compiles the kernel anew at each dispatch (see CONTRIBUTING).
fn is_within(i: u32, count: u32, own: f32) -> bool {
    return (i < count) & (own < 3e38);
}
