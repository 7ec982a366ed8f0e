//! The command line that all examples share.

use std::path::PathBuf;

use bevy::prelude::UVec2;
use clap::{Args, Parser, ValueEnum};

use crate::Error;

/// Largest picture, in pixels a side: the largest texture WebGPU promises.
pub const MAX_SIZE: u32 = 8192;

/// How an example runs and what it renders.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// Render without a window and write here; repeatable. EXR: linear cd/m^2, before exposure
    #[arg(long, value_name = "FILE.png|FILE.exr")]
    pub output: Vec<PathBuf>,
    /// Render without a window, even if nothing is written
    #[arg(long)]
    pub headless: bool,
    /// Size of the picture or window, in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse_size)]
    pub size: UVec2,
    /// Frames before the capture, after pipelines are ready [default: 1; with --stats 32; with --time 60 a second]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub frames: Option<u32>,
    /// How indirect light is computed [default: vpl, or as the example has it]
    #[arg(long, value_enum)]
    pub technique: Option<TechniqueOption>,
    /// How much is spent on it
    #[arg(long, value_enum, default_value_t = QualityOption::Medium)]
    pub quality: QualityOption,
    /// What the picture holds
    #[arg(long, value_enum, default_value_t = IsolateOption::All)]
    pub isolate: IsolateOption,
    /// Virtual point lights, over the quality's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(16..=65_536))]
    pub vpls: Option<u32>,
    /// Milliseconds of GPU time for bounced light: the quality gives way where it takes longer
    #[arg(long, value_name = "MS", value_parser = parse_budget)]
    pub budget: Option<f32>,
    /// Longest light path, in bounces, over the quality's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=31))]
    pub bounces: Option<u32>,
    /// Edge of the voxel grid, in voxels, over the quality's
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(8..=256))]
    pub grid: Option<u32>,
    /// How far around the camera light is as fine as that grid, world units, over the quality's
    #[arg(long, value_name = "DISTANCE")]
    pub range: Option<f32>,
    /// What a virtual light can see, over the quality's
    #[arg(long, value_enum)]
    pub visibility: Option<VisibilityOption>,
    /// Scale of the bound of the geometry term, over the quality's
    #[arg(long, value_name = "X")]
    pub bound: Option<f32>,
    /// Light probes along the longest axis, over the quality's: they light transparent and forward-rendered surfaces; 0 is off
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=64))]
    pub probes: Option<u32>,
    /// Everything forward, with MSAA: bounced light from light probes alone
    #[arg(long, conflicts_with_all = ["plain_bevy", "isolate", "show"])]
    pub forward: bool,
    /// Pixels at which bounced light is shaded, over the quality's
    #[arg(long, value_enum)]
    pub resolution: Option<ResolutionOption>,
    /// Iterations of screen-space bias compensation, over the quality's; 0 is off
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=8))]
    pub ssbc: Option<u32>,
    /// Pixels at which that is integrated, over the quality's
    #[arg(long, value_enum)]
    pub ssbc_resolution: Option<ResolutionOption>,
    /// Steps of the display below which baked texels are taken together, over the quality's
    #[arg(long, value_name = "X")]
    pub cssm_error: Option<f32>,
    /// How baked visibility is looked up
    #[arg(long, value_enum)]
    pub cssm_filter: Option<FilterOption>,
    /// Where the last bounce from baked texels is gathered
    #[arg(long, value_enum)]
    pub cssm_receivers: Option<ReceiversOption>,
    /// Radiance caches at two million pixels, over the quality's
    #[arg(long, value_name = "N")]
    pub caches: Option<u32>,
    /// Tiles around a pixel from which it gathers radiance caches, over the quality's
    #[arg(long, value_name = "X")]
    pub cache_reach: Option<f32>,
    /// Bounced light alone, before compensation, after it, or what it adds; instead of --isolate
    #[arg(long, value_enum, conflicts_with = "isolate")]
    pub show: Option<ShowOption>,
    /// Bounced light averaged over frames [default: as the quality has it]
    #[arg(long, value_enum)]
    pub temporal: Option<Switch>,
    /// Glossy indirect light beside virtual point lights, or from baked texels [default: off, or as the example has it]
    #[arg(long, value_enum)]
    pub glossy: Option<Switch>,
    /// Animation time of the capture, reached by fixed steps from 0: in --frames equal steps, or 60 a second
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_seconds)]
    pub time: Option<f64>,
    /// Constant sky radiance, cd/m^2
    #[arg(long, value_name = "R,G,B", value_parser = parse_sky)]
    pub sky: Option<Sky>,
    /// Exposure, EV at ISO 100 [default: the scene's own, or metered once]
    #[arg(long, value_name = "EV100", allow_negative_numbers = true, value_parser = parse_exposure)]
    pub exposure: Option<f32>,
    /// WebGPU's default limits, no optional features
    #[arg(long)]
    pub webgpu_limits: bool,
    /// Write adapter, sizes and times as JSON
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
    /// Draw the virtual lights
    #[arg(long, conflicts_with = "plain_bevy")]
    pub gizmos: bool,
    /// Open the panel, which F1 does in a window; PNGs show it, EXRs do not
    #[arg(long)]
    pub panel: bool,
    /// Bevy's deferred renderer alone, without this project's plugins
    #[arg(long, hide = true)]
    pub plain_bevy: bool,
}

/// `--technique`
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum TechniqueOption {
    /// Bevy's own picture
    None,
    /// Virtual point lights through a voxel grid
    Vpl,
    /// Radiance caches
    RadianceCache,
    /// Baked visibility
    Cssm,
}

/// `--quality`
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum QualityOption {
    /// 256 virtual lights, 32^3 voxels
    Low,
    /// 2048 virtual lights, 64^3 voxels
    Medium,
    /// 4096 virtual lights, 96^3 voxels
    High,
    /// 8192 virtual lights, 128^3 voxels
    Ultra,
}

/// `--isolate`
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum IsolateOption {
    /// Everything
    All,
    /// What Bevy lights by itself, and emission
    Direct,
    /// Bounced light alone
    Indirect,
    /// What is reflected of it glossily
    Glossy,
    /// Bounced light as it falls on surfaces
    Irradiance,
    /// Left without bias compensation, right with it
    Split,
    /// Colours of the voxels
    VoxelAlbedo,
    /// Normals of the voxels
    VoxelNormal,
    /// Light that voxels send
    VoxelLight,
    /// The levels of that light that cones march through, side by side
    VoxelLevels,
    /// Shadow maps of the virtual lights
    ShadowAtlas,
    /// Clusters of the radiance caches
    Clusters,
    /// What the radiance caches hold
    Caches,
    /// Nodes of baked hierarchies that each pixel gathers from
    CutSize,
    /// Baked hierarchies, level by level
    TreeLevels,
    /// Lit atlases of baked objects
    BakedAtlas,
}

/// `--resolution`, `--ssbc-resolution`
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResolutionOption {
    /// Every pixel
    Full,
    /// Every fourth
    Half,
}

/// `--cssm-filter`
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilterOption {
    /// By one pixel
    Nearest,
    /// By four
    Pixels,
}

/// `--cssm-receivers`
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReceiversOption {
    /// Each pixel
    Pixels,
    /// Texels, of which pixels show a smooth picture
    Texels,
}

/// `--show`
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShowOption {
    /// Bounced light with a bounded geometry term
    Bounded,
    /// The same, compensated
    Compensated,
    /// The difference
    Residual,
}

/// `--visibility`
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum VisibilityOption {
    /// Virtual lights see everything
    None,
    /// Rasterised shadow maps
    Atlas,
    /// Imperfect shadow maps
    Ism,
    /// Rays through the voxel grid
    Voxel,
    /// Shadow maps, and baked visibility where there is any
    Cssm,
}

/// `on` or `off`
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switch {
    /// Yes
    On,
    /// No
    Off,
}

/// Constant sky radiance, cd/m^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky(pub [f32; 3]);

/// Reads the command line under the example's own name; the error's text starts with one line that says it all.
pub fn parse<C: Parser>(name: &'static str) -> Result<C, Error> {
    let mut command = C::command().name(name).bin_name(name);
    let matches = command.try_get_matches_from_mut(std::env::args_os()).map_err(one_line)?;
    C::from_arg_matches(&matches).map_err(one_line)
}

/// clap spreads some errors, such as a missing value, over several lines; help and version stay as they are.
fn one_line(error: clap::Error) -> Error {
    if !error.use_stderr() {
        return Error::CommandLine(error);
    }
    let text = error.to_string();
    let mut lines = text.lines().map(str::trim).take_while(|line| !line.starts_with("Usage:"));
    let first = lines.next().unwrap_or_default().trim_start_matches("error: ").to_owned();
    let rest: Vec<&str> = lines.filter(|line| !line.is_empty() && !line.starts_with("For more information")).collect();
    let rest = if rest.is_empty() { String::new() } else { format!(" {}", rest.join(" ")) };
    Error::Usage(format!("{first}{rest}; --help lists the options"))
}

fn parse_size(text: &str) -> Result<UVec2, String> {
    let wrong = || format!("give width x height in pixels, each 1 to {MAX_SIZE}, such as 1280x720");
    let (width, height) = text.split_once(['x', 'X']).ok_or_else(wrong)?;
    let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIZE).contains(side)).ok_or_else(wrong);
    Ok(UVec2::new(side(width)?, side(height)?))
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (0.0..=86_400.0).contains(seconds));
    seconds.ok_or_else(|| "give seconds, 0 to 86400".to_owned())
}

fn parse_budget(text: &str) -> Result<f32, String> {
    let milliseconds = text.parse().ok().filter(|milliseconds| (0.1..=100.0).contains(milliseconds));
    milliseconds.ok_or_else(|| "give milliseconds, 0.1 to 100".to_owned())
}

fn parse_exposure(text: &str) -> Result<f32, String> {
    let ev100 = text.parse().ok().filter(|ev100| (-16.0..=24.0).contains(ev100));
    ev100.ok_or_else(|| "give an exposure value at ISO 100, -16 to 24".to_owned())
}

fn parse_sky(text: &str) -> Result<Sky, String> {
    let wrong = || "give three radiances in cd/m^2, none negative, such as 100,120,150".to_owned();
    let channels: Vec<f32> = text.split(',').filter_map(|channel| channel.trim().parse().ok()).collect();
    let valid = text.split(',').count() == 3 && channels.iter().all(|value| value.is_finite() && *value >= 0.0);
    <[f32; 3]>::try_from(channels).ok().filter(|_| valid).map(Sky).ok_or_else(wrong)
}
