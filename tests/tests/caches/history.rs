//! Bounced light averaged over frames: calm where the scene or the camera moves, and right in each frame.

mod calm;
mod frames;
