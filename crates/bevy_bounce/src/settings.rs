//! What a camera asks for, and what the world stages make of it.

use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::extract_component::ExtractComponent;

use crate::SsbcSettings;

/// Lights what this camera sees with bounced light, computed afresh every frame.
///
/// Brings along what it needs (HDR, deferred prepass, no MSAA, no ambient light) and hands back what it found when it is
/// removed.
#[derive(Component, ExtractComponent, Reflect, Clone, Debug, Default, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct GlobalIllumination {
    /// How the bounced light is computed.
    pub technique: Technique,
    /// How much is spent on it.
    pub quality: Quality,
}

/// How bounced light is computed.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Technique {
    /// Bevy's own picture.
    None,
    /// Virtual point lights traced through the voxel grid. Keller 1997, Bashford-Rogers et al. 2012.
    #[default]
    InstantRadiosity,
}

/// How much is spent. With several cameras the world stages follow the most demanding one.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq)]
pub enum Quality {
    /// 256 virtual lights, a grid of 32^3 voxels, one bias compensation.
    Low,
    /// 1024 virtual lights, a grid of 64^3 voxels, one bias compensation.
    #[default]
    Medium,
    /// 4096 virtual lights, a grid of 96^3 voxels, two bias compensations.
    High,
    /// 8192 virtual lights, a grid of 128^3 voxels, two bias compensations.
    Ultra,
    /// Every value by hand.
    Custom(GiSettings),
}

/// The values behind [`Quality`].
#[derive(Reflect, Clone, Copy, Debug, PartialEq)]
pub struct GiSettings {
    /// Edge of the voxel grid, in voxels: the budget is `grid`^3, spread over the scene's bounds in cubic voxels.
    /// 8 to 256. Memory and the cost of voxelisation grow with its cube.
    pub grid: u32,
    /// Virtual point lights, 16 to 65536. Each pixel is lit by a sixteenth of them; cost is proportional.
    pub vpls: u32,
    /// Longest path, in bounces, 1 to 31. Roulette ends most paths earlier; what a limit of n leaves out of a room of
    /// albedo a is a^n of the bounced light.
    pub bounces: u32,
    /// What a virtual light can see.
    pub visibility: VplVisibility,
    /// Compensation of what the bounded geometry term takes from corners.
    pub ssbc: SsbcSettings,
}

/// What a virtual point light can see.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VplVisibility {
    /// Everything: no shadows in the bounced light. Fast, and it leaks.
    None,
    /// A ray through the voxel grid for every virtual light and pixel.
    #[default]
    Voxel,
}

impl Default for GiSettings {
    fn default() -> Self {
        Quality::default().settings()
    }
}

impl Quality {
    /// The values this quality stands for, within the documented ranges.
    pub fn settings(&self) -> GiSettings {
        let preset = |grid, vpls, iterations| GiSettings {
            grid,
            vpls,
            bounces: 12,
            visibility: VplVisibility::Voxel,
            ssbc: SsbcSettings { iterations, ..default() },
        };
        match *self {
            Quality::Low => preset(32, 256, 1),
            Quality::Medium => preset(64, 1024, 1),
            Quality::High => preset(96, 4096, 2),
            Quality::Ultra => preset(128, 8192, 2),
            Quality::Custom(custom) => GiSettings {
                grid: custom.grid.clamp(8, 256),
                vpls: custom.vpls.clamp(16, 65536),
                bounces: custom.bounces.clamp(1, 31),
                visibility: custom.visibility,
                ssbc: custom.ssbc.clamped(),
            },
        }
    }
}

/// What the world stages work for this frame: for every value the highest that an active camera asks for; `None` without
/// such a camera.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct GiWorldSettings(pub Option<GiSettings>);

pub(crate) fn extract_world_settings(
    mut world: ResMut<GiWorldSettings>,
    cameras: Extract<Query<(&GlobalIllumination, &Camera)>>,
) {
    world.0 = cameras
        .iter()
        .filter(|(gi, camera)| camera.is_active && gi.technique != Technique::None)
        .map(|(gi, _)| gi.quality.settings())
        .reduce(|a, b| GiSettings {
            grid: a.grid.max(b.grid),
            vpls: a.vpls.max(b.vpls),
            bounces: a.bounces.max(b.bounces),
            visibility: a.visibility,
            ssbc: a.ssbc,
        });
}
