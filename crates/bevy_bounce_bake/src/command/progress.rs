//! The progress bar: rate and time left, on stderr where that is a terminal.

use std::sync::{Mutex, PoisonError};

use bevy_bounce_bake::{Progress, Step};
use indicatif::{ProgressBar, ProgressStyle};

/// Shows how far the present step is.
pub struct Bar {
    quiet: bool,
    shown: Mutex<Option<(Step, ProgressBar)>>,
}

impl Bar {
    /// A bar that shows once there is something to tell, and never if `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet, shown: Mutex::new(None) }
    }

    /// Takes the bar off the screen.
    pub fn finish(&self) {
        if let Some((_, bar)) = self.shown.lock().unwrap_or_else(PoisonError::into_inner).take() {
            bar.finish_and_clear();
        }
    }
}

impl Progress for Bar {
    fn report(&self, step: Step, done: usize, total: Option<usize>) {
        if self.quiet {
            return;
        }
        let mut shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, bar)) = shown.take_if(|(other, _)| *other != step) {
            bar.finish_and_clear();
        }
        let (_, bar) = shown.get_or_insert_with(|| (step, new_bar(step, total)));
        bar.set_position(bar.position().max(done as u64));
    }
}

fn new_bar(step: Step, total: Option<usize>) -> ProgressBar {
    let (bar, template) = match total {
        Some(total) => {
            let template = format!("{{wide_bar}} {{human_pos}} of {{human_len}} {step}, {{per_sec}}, {{eta}} left");
            (ProgressBar::new(total as u64), template)
        }
        None => (ProgressBar::new_spinner(), format!("{{spinner}} {{human_pos}} {step}, {{elapsed}}")),
    };
    bar.with_style(ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar()))
}
