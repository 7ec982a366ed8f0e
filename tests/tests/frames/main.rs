//! Whole frames: beside other effects, in all kinds of views, in any order of events.

mod beside;
mod fog;
mod lamps;
mod panel;
mod pictures;
mod recovery;
mod references;
mod soak;
mod views;
