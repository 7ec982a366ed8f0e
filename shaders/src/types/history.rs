//! What is kept from frame to frame.

use bevy::math::Mat4;
use bevy::render::render_resource::ShaderType;

/// What the history is told of the last frame.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct HistoryParameters {
    /// As it was drawn: jittered where the camera is.
    pub previous_clip_from_world: Mat4,
    /// The inverse.
    pub previous_world_from_clip: Mat4,
    /// As motion vectors count: without jitter.
    pub previous_unjittered_clip_from_world: Mat4,
    /// This frame's exposure over the last one's.
    pub exposure: f32,
    /// Frames over which light is averaged at most.
    pub frames: f32,
    /// 1 where there is a last frame, 0 where not.
    pub valid: u32,
    /// 0, or up to 1 after a budget has changed how many lights there are: how much further off history may be.
    pub leniency: f32,
}
