//! The progress bar: rate and time left, on stderr where that is a terminal.

use std::sync::OnceLock;

use bevy_bounce_bake::Progress;
use indicatif::{ProgressBar, ProgressStyle};

/// Shows how many depth maps are done.
pub struct Bar {
    quiet: bool,
    bar: OnceLock<ProgressBar>,
}

impl Bar {
    /// A bar that shows once the number of maps is known, and never if `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet, bar: OnceLock::new() }
    }

    /// Takes the bar off the screen.
    pub fn finish(&self) {
        if let Some(bar) = self.bar.get() {
            bar.finish_and_clear();
        }
    }
}

impl Progress for Bar {
    fn start(&self, maps: usize) {
        self.bar.get_or_init(|| {
            if self.quiet {
                return ProgressBar::hidden();
            }
            let template = "{wide_bar} {human_pos} of {human_len} depth maps, {per_sec}, {eta} left";
            let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(maps as u64).with_style(style)
        });
    }

    fn advance(&self, maps: usize) {
        if let Some(bar) = self.bar.get() {
            bar.inc(maps as u64);
        }
    }
}
