//! The command line.

use std::path::PathBuf;

use bevy_bounce_bake::{LightmapSettings, Strategy};
use clap::{Args as ClapArgs, Parser, Subcommand};

/// Bakes visibility between all points of rigid objects, or lightmaps for plain Bevy.
#[derive(Parser)]
#[command(name = "bounce-bake", version, about)]
pub struct Args {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Bake a glTF scene
    Bake(BakeArgs),
    /// Say what is inside a baked file: sizes, ratio
    Info {
        /// File that `bake` wrote
        #[arg(value_name = "OUT.cssm")]
        file: PathBuf,
    },
    /// Compare decoded visibility with exact rays between random points of the surface; exit status 1 below the threshold
    Verify(VerifyArgs),
    /// Bake lightmap and irradiance volume of a glTF scene, for plain Bevy
    Lightmap(LightmapArgs),
}

#[derive(ClapArgs)]
pub struct BakeArgs {
    /// What to bake: the default scene of a .glb or .gltf file
    #[arg(value_name = "SCENE.glb")]
    pub scene: PathBuf,
    /// Where to; an existing file is replaced once the bake is complete
    #[arg(short, long, value_name = "OUT.cssm")]
    pub output: PathBuf,
    /// Side of the atlas in texels
    #[arg(long, value_name = "N", default_value_t = 128)]
    pub atlas: u32,
    /// Side of a depth cube map's face in pixels, a multiple of 8
    #[arg(long, value_name = "N", default_value_t = 64)]
    pub depth: u32,
    /// Order of the texels: tiles, spiral, zigzag or greedy
    #[arg(long, value_name = "NAME", default_value_t = Strategy::default())]
    pub strategy: Strategy,
    /// Unwrap anew even where every mesh has a second UV set
    #[arg(long)]
    pub unwrap: bool,
    /// How many threads; one a core by default
    #[arg(long, value_name = "N", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1024))]
    pub threads: Option<usize>,
    /// Write sizes, ratio and time as JSON
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// No progress bar and no summary
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(ClapArgs)]
pub struct LightmapArgs {
    /// What to light: the default scene of a .glb or .gltf file
    #[arg(value_name = "SCENE.glb")]
    pub scene: PathBuf,
    /// Where to: the scene with a second UV set; OUT.lightmap.ktx2 and OUT.volume.ktx2 are written beside it
    #[arg(short, long, value_name = "OUT.glb")]
    pub output: PathBuf,
    /// Side of the lightmap in texels
    #[arg(long, value_name = "N", default_value_t = LightmapSettings::default().atlas)]
    pub atlas: u32,
    /// Rays of a texel; noise falls with their square root
    #[arg(long, value_name = "N", default_value_t = LightmapSettings::default().rays)]
    pub rays: u32,
    /// Most reflections [default: as many as matter]
    #[arg(long, value_name = "N")]
    pub bounces: Option<u32>,
    /// Voxels of the irradiance volume along the longest side; 0 for no volume
    #[arg(long, value_name = "N", default_value_t = LightmapSettings::default().probes)]
    pub probes: u32,
    /// The lightmap holds what lamps light by themselves, too
    #[arg(long)]
    pub direct: bool,
    /// Unwrap anew even where every mesh has a second UV set
    #[arg(long)]
    pub unwrap: bool,
    /// How many threads; one a core by default
    #[arg(long, value_name = "N", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1024))]
    pub threads: Option<usize>,
    /// Write sizes, counts and time as JSON
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// No progress bar and no summary
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(ClapArgs)]
pub struct VerifyArgs {
    /// File that `bake` wrote
    #[arg(value_name = "OUT.cssm")]
    pub file: PathBuf,
    /// What it was baked from
    #[arg(value_name = "SCENE.glb")]
    pub scene: PathBuf,
    /// How many pairs of points
    #[arg(long, value_name = "N", default_value_t = 1_000_000, value_parser = clap::value_parser!(u64).range(1..))]
    pub rays: u64,
    /// Least agreement in percent
    #[arg(long, value_name = "P", default_value_t = 98.0)]
    pub min_agreement: f64,
}
