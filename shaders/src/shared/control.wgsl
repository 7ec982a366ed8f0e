// Loops and branches that depend on uniforms. Mesa's software driver puts the values of these into kernels that branch or loop by them
// alone, and compiles most of such kernels anew at each dispatch (see CONTRIBUTING); with anything beside them it does not.

#define_import_path bevy_bounce::shared::control

/// Whether something is so that only uniforms decide; `own`: anything below 3e38 that is not the same in all threads or, where there are
/// barriers within, in all workgroups. False where that is no number.
fn holds(condition: bool, own: f32) -> bool {
    return condition & (own < 3e38);
}

/// Whether a loop is not yet at the end of what a uniform counts; `own` as in `holds`.
fn is_within(i: u32, count: u32, own: f32) -> bool {
    return holds(i < count, own);
}
