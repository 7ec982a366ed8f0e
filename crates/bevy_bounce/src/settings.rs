//! What a camera asks for, and what the world stages make of it.

use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::extract_component::ExtractComponent;
use bevy_bounce_shaders::types::tile_parts;

use crate::compute::MAX_WORKGROUPS;
use crate::{CssmReceivers, CssmSettings, GiBudget, GiIsolate, RadianceCacheSettings, SsbcSettings};

/// Lights what this camera sees with bounced light, right in every frame.
///
/// Brings along what it needs: HDR, black ambient light and, for history, motion vectors; hands back what it found when it is
/// removed. Ambient light that the game has set is a sky meanwhile: see [`GiSettings::sky`]. Every `Camera3d` of the app is deferred,
/// without MSAA, and stays so; with
/// [`GlobalIlluminationPlugins::forward`](crate::GlobalIlluminationPlugins::forward) it brings black ambient light alone.
#[derive(Component, ExtractComponent, Reflect, Clone, Debug, Default, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[require(GiIsolate)]
pub struct GlobalIllumination {
    /// How the bounced light is computed.
    pub technique: Technique,
    /// How much is spent on it.
    pub quality: Quality,
    /// Milliseconds that the plugins may take on the GPU each frame, 0.1 to 100: `quality` is followed as far as that allows, down
    /// quickly and up slowly. `None` follows it whatever it takes. Needs Bevy's
    /// [`RenderDiagnosticsPlugin`](bevy::render::diagnostic::RenderDiagnosticsPlugin); see [`budget`](crate::budget).
    #[reflect(@0.1..=100.0_f32)]
    pub budget: Option<f32>,
    /// For camera cuts: the next frame of this camera recalls neither history nor where radiance caches lay, and is to the bit what it
    /// would be at a fresh start. Goes back to `false` by itself. Without it, what a cut shows is recalled by its place in the world,
    /// and right to a few percent.
    pub reset: bool,
}

/// How bounced light is computed.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Default)]
pub enum Technique {
    /// Bevy's own picture.
    None,
    /// Virtual point lights traced through the voxel grid. Keller 1997, Bashford-Rogers et al. 2012.
    #[default]
    InstantRadiosity,
    /// Caches of incident light on what the camera sees, filled by cones through the lit voxel grid: diffuse and glossy.
    /// Rehfeld et al. 2014.
    RadianceCache,
    /// Radiosity between the texels of baked objects, see [`CssmObject`](crate::CssmObject). Ritschel et al. 2008.
    SurfaceRadiosity,
}

/// How much is spent. Baked objects are gathered from with an error of 32, 16, 8 and 4 steps of the display. With
/// several cameras the world stages follow the most demanding one.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq)]
#[reflect(Default)]
pub enum Quality {
    /// 256 virtual lights, a grid of 32^3 voxels, shaded at half resolution, one bias compensation.
    Low,
    /// 2048 virtual lights, a grid of 64^3 voxels, shaded at half resolution, one bias compensation.
    #[default]
    Medium,
    /// 4096 virtual lights, a grid of 96^3 voxels, two bias compensations.
    High,
    /// 8192 virtual lights, a grid of 128^3 voxels, two bias compensations.
    Ultra,
    /// Every value by hand.
    Custom(GiSettings),
}

/// The values behind [`Quality`]. Each number carries its range as a reflection attribute, a `RangeInclusive` of its type.
#[derive(Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Default)]
pub struct GiSettings {
    /// Edge of the voxel grid, in voxels: the budget is `grid`^3, spread over the scene's bounds, or what of them is in
    /// `range`, in cubic voxels. 8 to 256; 128 at most where radiance caches are used. Memory and the cost of
    /// voxelisation grow with its cube; large meshes may have more triangles in shadow maps.
    #[reflect(@8..=256_u32)]
    pub grid: u32,
    /// How far around the camera bounced light is as fine as the grid makes it, world units: 1 to 10,000. A scene that
    /// is wider than twice as far has further grids around that one, each four times as wide, of which the fourth at
    /// most holds all; most virtual lights are near the camera, and light probes are within this range alone, as is
    /// glossy light by caches. More is coarser near the camera; each further grid takes the memory and the time of
    /// another.
    #[reflect(@1.0..=1e4_f32)]
    pub range: f32,
    /// Virtual point lights, 16 to 65536. Each pixel is lit by a sixteenth of them, and by those near to it; cost is
    /// proportional. More than 2048 do not fit into a uniform buffer, from which they are read faster.
    #[reflect(@16..=65536_u32)]
    pub vpls: u32,
    /// Longest path, in bounces, 1 to 31. Roulette ends most paths earlier; what a limit of n leaves out of a room of
    /// albedo a is a^n of the bounced light.
    #[reflect(@1..=31_u32)]
    pub bounces: u32,
    /// What a virtual light can see.
    pub visibility: VplVisibility,
    /// Edge of a virtual light's shadow map, texels: 8 to 256, a multiple of four. Four bytes a texel and light; memory
    /// and the cost of filling it grow with its square, and contact shadows become sharper in proportion. Above 48 a map
    /// is drawn in parts of at most that edge, 4 at 96 and 36 at 256, each of which looks at all triangles: these are as
    /// many times fewer. Smaller where the maps of all lights do not fit into a binding (128 MiB where a device has
    /// WebGPU's limits: 180 with 1024 lights), and 96 at most where they are drawn from points.
    #[reflect(@8..=256_u32)]
    pub tile: u32,
    /// Scale of the bound of the geometry term, which by itself is that of two surfaces at the distance between lights
    /// (their number over the area of the surfaces around the point that is lit): 0.01 to 100. Higher keeps more light
    /// in corners, and shows single lights as bright patches. `ssbc` gives back what a low one takes, as far as the
    /// camera sees it.
    #[reflect(@0.01..=100.0_f32)]
    pub bound: f32,
    /// Light probes along the scene's longest axis, for what is not in the G-buffer: transparent and forward-rendered
    /// surfaces; and half the froxels along the picture's, for volumetric fog. 0 for none, or 4 to 64. Their light is
    /// as fine as they are near each other; cost and memory grow with the cube. In frames without any of these they
    /// cost no time.
    #[reflect(@0..=64_u32)]
    pub probes: u32,
    /// Directions from which the sky's light comes, for the whole picture: 0 to 256, a multiple of 16. The sky is what
    /// the camera's `EnvironmentMapLight` shows, also one that Bevy makes of its atmosphere; without one, its `Skybox`;
    /// with neither, ambient light from all around, as bright as Bevy shows it in the open: the camera's
    /// `AmbientLight`, or a `GlobalAmbientLight` that is not Bevy's default. Its light is then shadowed by the scene
    /// and bounces, and takes the place of Bevy's diffuse light by environment maps; what is mirrored of them stays as
    /// far as the sky is seen from there, but with [`Technique::RadianceCache`], whose caches show the sky. 0 leaves
    /// all to Bevy, and of ambient light nothing. Each pixel sends a sixteenth of so many rays through the voxel grid;
    /// more make its shadows smoother. Not with [`Technique::SurfaceRadiosity`].
    #[reflect(@0..=256_u32)]
    pub sky: u32,
    /// Pixels at which bounced light is shaded.
    pub resolution: Resolution,
    /// Compensation of what the bounded geometry term takes from corners.
    pub ssbc: SsbcSettings,
    /// Gathering from baked objects.
    pub cssm: CssmSettings,
    /// Caches of incident light: glossy light beside virtual point lights, and all of [`Technique::RadianceCache`].
    pub radiance_cache: RadianceCacheSettings,
    /// Frames over which bounced light is averaged where it hardly changes, 0 to 64; 0 and 1 are off. More is calmer,
    /// and no frame is more than four percent off its own light whatever this is. Baked light has the mean of up to 64
    /// frames, from 2 on, while everything rests. Costs the same from 2 on: 16 bytes a pixel, motion vectors included,
    /// and 8 more with glossy light; for baked light as much again, at least; see [`history`](crate::history). Bevy
    /// compiles other pipelines for its prepass when it is switched on or off, and leaves out what waits for them.
    #[reflect(@0..=64_u32)]
    pub history: u32,
}

/// Pixels at which something is computed.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Default)]
pub enum Resolution {
    /// Each.
    #[default]
    Full,
    /// Each fourth: a quarter of the sums over lights; interpolating costs what it did. Between them light is interpolated within
    /// surfaces, and computed anew at pixels whose surface has too few of them near.
    Half,
}

impl Resolution {
    /// Edge of a texel, pixels.
    pub(crate) fn pixels_a_texel(self) -> u32 {
        match self {
            Resolution::Full => 1,
            Resolution::Half => 2,
        }
    }
}

/// Virtual lights times triangles that are drawn into their shadow maps, and times the parts of these.
const OCCLUSION_BUDGET: u32 = 1 << 25;
/// The same at most, where coarser versions of the meshes would be too far off.
const LARGEST_OCCLUSION_BUDGET: u32 = 1 << 28;

/// Largest edge of a map that is drawn from points, texels: 589,824 points for all lights, 16.5 MB in both buffers.
const LARGEST_POINT_MAP: u32 = 96;

/// How far around the camera light is fine by default, world units.
const RANGE: f32 = 40.0;

/// Frames over which bounced light is averaged by default.
const HISTORY: u32 = 8;

/// Largest edge of a grid whose voxels are lit, voxels: their light takes 115 MiB.
const MAX_LIT_GRID: u32 = 128;

impl Technique {
    /// Whether it needs the voxel grid and virtual point lights.
    pub(crate) fn uses_grid(self) -> bool {
        matches!(self, Self::InstantRadiosity | Self::RadianceCache)
    }
}

impl GlobalIllumination {
    /// What the camera is lit by: the settings of its quality, without what its budget takes and what its technique has no use for.
    pub fn given(&self, budget: Option<&GiBudget>) -> GiSettings {
        let share = budget.filter(|_| self.budget.is_some()).map_or(1.0, |budget| budget.share);
        self.settings().at_share(share)
    }

    /// Settings of this camera alone, within their ranges.
    pub(crate) fn settings(&self) -> GiSettings {
        let mut settings = self.quality.settings();
        if self.technique != Technique::InstantRadiosity {
            settings.ssbc = SsbcSettings::OFF;
            settings.radiance_cache.glossy = self.technique == Technique::RadianceCache;
        }
        let at_pixels = settings.cssm.receivers == CssmReceivers::Pixels;
        settings.cssm.glossy &= self.technique == Technique::SurfaceRadiosity && at_pixels;
        settings
    }

    /// Whether light is averaged over frames.
    pub(crate) fn has_history(&self) -> bool {
        self.is_active() && self.settings().has_history()
    }

    /// What it asks of the world stages.
    fn world_settings(&self, budget: Option<&GiBudget>, isolate: Option<&GiIsolate>) -> GiSettings {
        let mut settings = self.given(budget);
        settings.radiance_cache.glossy |= isolate.is_some_and(|isolate| isolate.shows_voxel_light());
        if self.technique == Technique::RadianceCache {
            settings.visibility = VplVisibility::None;
            // Pixels see the voxels that virtual lights light: a bounce of its own.
            settings.bounces -= 1;
        }
        if settings.lights_grid() {
            settings.grid = settings.grid.min(MAX_LIT_GRID);
        }
        settings
    }
}

impl GiSettings {
    /// Whether light is averaged over frames.
    pub(crate) fn has_history(&self) -> bool {
        self.history > 1
    }

    /// Whether glossy light is gathered.
    pub(crate) fn has_glossy_light(&self) -> bool {
        self.radiance_cache.glossy || self.cssm.glossy
    }

    /// Edge of a virtual light's map, texels, before it shrinks to what a binding holds.
    pub(crate) fn map_edge(&self) -> u32 {
        self.tile.min(if self.visibility == VplVisibility::Ism { LARGEST_POINT_MAP } else { u32::MAX })
    }

    /// Whether the voxels are lit.
    pub(crate) fn lights_grid(&self) -> bool {
        self.radiance_cache.glossy
    }
}

impl StatedLights {
    /// Triangles that cast shadows, and how many these may be where so few would be too coarse: levels of
    /// detail are chosen accordingly. One dispatch places them, a workgroup a mesh or more.
    pub fn occluders(&self, settings: &GiSettings) -> OccluderBudget {
        let maps = self.0.max(1) * tile_parts(settings.map_edge());
        let [few, many] = [OCCLUSION_BUDGET, LARGEST_OCCLUSION_BUDGET].map(|pairs| (pairs / maps).min(MAX_WORKGROUPS));
        OccluderBudget { few, many }
    }
}

/// See [`StatedLights::occluders`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OccluderBudget {
    /// Triangles, where these are fine enough.
    pub few: u32,
    /// Triangles, where they are not.
    pub many: u32,
}

/// What a virtual point light can see.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[reflect(Default)]
pub enum VplVisibility {
    /// Everything: no shadows in the bounced light. Fast, and it leaks.
    None,
    /// A ray through the voxel grid for every virtual light and pixel.
    Voxel,
    /// Imperfect shadow maps: as `Atlas`, drawn from points spread over the surfaces. Cost does not depend on the number of
    /// triangles. Coarse: bounced light is too dark in large scenes.
    Ism,
    /// A shadow map over the hemisphere of every virtual light, into which the scene's triangles are drawn; of large meshes, a
    /// coarser version. Triangles times lights (and parts, see `tile`) are bounded: by 34 million while the coarser versions are no more than a voxel off, else by
    /// 268 million, and by 65,535 triangles. Where even so many would be coarser, lights see as with `Voxel`.
    #[default]
    Atlas,
    /// As `Atlas`, but what lights on a [`CssmObject`](crate::CssmObject) see of that is looked up in its bake,
    /// whatever its triangles: there are no coarser versions of its meshes. Takes the bake's memory, and three to ten
    /// reads a texel of each map.
    Baked,
}

impl Default for GiSettings {
    fn default() -> Self {
        Quality::default().settings()
    }
}

impl Quality {
    /// The values this quality stands for, within the documented ranges.
    pub fn settings(&self) -> GiSettings {
        let preset = |grid, vpls, tile, probes, sky, resolution, iterations, error| GiSettings {
            grid,
            range: RANGE,
            vpls,
            bounces: 12,
            visibility: VplVisibility::Atlas,
            tile,
            bound: 1.0,
            probes,
            sky,
            resolution,
            ssbc: SsbcSettings { iterations, ..default() },
            cssm: CssmSettings { error, ..default() },
            radiance_cache: RadianceCacheSettings::DEFAULT,
            history: HISTORY,
        };
        match *self {
            Quality::Low => preset(32, 256, 24, 16, 32, Resolution::Half, 1, 32.0),
            Quality::Medium => preset(64, 2048, 32, 20, 64, Resolution::Half, 1, 16.0),
            Quality::High => preset(96, 4096, 32, 20, 128, Resolution::Full, 2, 8.0),
            Quality::Ultra => preset(128, 8192, 48, 24, 256, Resolution::Full, 2, 4.0),
            Quality::Custom(custom) => GiSettings {
                grid: custom.grid.clamp(8, 256),
                range: if custom.range.is_nan() { RANGE } else { custom.range.clamp(1.0, 1e4) },
                vpls: custom.vpls.clamp(16, 65536),
                bounces: custom.bounces.clamp(1, 31),
                visibility: custom.visibility,
                tile: custom.tile.clamp(8, 256) & !3,
                bound: if custom.bound.is_finite() { custom.bound.clamp(0.01, 100.0) } else { 1.0 },
                probes: if custom.probes == 0 { 0 } else { custom.probes.clamp(4, 64) },
                sky: (custom.sky.min(256) + 15) & !15,
                resolution: custom.resolution,
                ssbc: custom.ssbc.clamped(),
                cssm: custom.cssm.clamped(),
                radiance_cache: custom.radiance_cache.clamped(),
                history: custom.history.min(64),
            },
        }
    }
}

/// What the world stages work for this frame: for every value the highest that an active camera asks for; `None` without
/// such a camera.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct GiWorldSettings(pub Option<GiSettings>);

/// Virtual lights that the cameras of [`GiWorldSettings`] would have without budgets: what room is held for, and what does not change
/// with a budget.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct StatedLights(pub u32);

pub(crate) fn extract_world_settings(
    mut world: ResMut<GiWorldSettings>,
    mut stated: ResMut<StatedLights>,
    cameras: Extract<Query<(&GlobalIllumination, &Camera, Option<&GiBudget>, Option<&GiIsolate>)>>,
) {
    let asking = || cameras.iter().filter(|(gi, camera, ..)| camera.is_active && gi.technique.uses_grid());
    stated.0 = asking().map(|(gi, ..)| gi.settings().vpls).max().unwrap_or(0);
    world.0 = asking().map(|(gi, _, budget, isolate)| gi.world_settings(budget, isolate)).reduce(|a, b| GiSettings {
        grid: a.grid.max(b.grid).min(if a.lights_grid() || b.lights_grid() { MAX_LIT_GRID } else { u32::MAX }),
        range: a.range.max(b.range),
        vpls: a.vpls.max(b.vpls),
        bounces: a.bounces.max(b.bounces),
        visibility: a.visibility.max(b.visibility),
        tile: a.tile.max(b.tile),
        bound: a.bound.min(b.bound),
        probes: a.probes.max(b.probes),
        sky: a.sky.max(b.sky),
        resolution: a.resolution,
        ssbc: a.ssbc,
        cssm: a.cssm,
        radiance_cache: a.radiance_cache.more(b.radiance_cache),
        history: a.history,
    });
}
