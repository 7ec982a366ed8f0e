//! What the command does.

mod args;
mod lightmap;
mod progress;

use std::path::Path;
use std::process::ExitCode;

use bevy_bounce_bake::{BakeError, BakeSettings, Scene, Source, Strategy, bake, verify, write_atomically};
use bevy_bounce_cssm::CssmFile;
use clap::Parser;

use args::{Args, BakeArgs, Command, VerifyArgs};
use progress::Bar;

/// Ran, and found something wanting.
const FAILED: u8 = 1;
/// Could not run for what it was given.
const BAD_INPUT: u8 = 2;

/// Why the command ends early: one line and a status.
struct Failure {
    line: String,
    status: u8,
}

impl From<BakeError> for Failure {
    fn from(error: BakeError) -> Self {
        Self { line: error.to_string(), status: BAD_INPUT }
    }
}

/// Runs what the command line asks for.
pub fn run() -> ExitCode {
    let result = match Args::parse().command {
        Command::Bake(args) => run_bake(&args),
        Command::Info { file } => run_info(&file),
        Command::Verify(args) => run_verify(&args),
        Command::Lightmap(args) => lightmap::run(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("bounce-bake: {}", failure.line);
            ExitCode::from(failure.status)
        }
    }
}

fn run_bake(args: &BakeArgs) -> Result<(), Failure> {
    let settings = BakeSettings { atlas: args.atlas, depth: args.depth, strategy: args.strategy, unwrap: args.unwrap };
    settings.check()?;
    if args.output.is_dir() {
        let line = format!("{}: is a folder; give a file to write, as OUT.cssm", args.output.display());
        return Err(Failure { line, status: BAD_INPUT });
    }
    let scene = Scene::from_gltf(&Source::open(&args.scene)?)?;
    let bar = Bar::new(args.quiet);
    let (file, report) = with_threads(args.threads, || bake(&scene, &settings, &bar))??;
    bar.finish();
    write(&args.output, &file.to_bytes())?;
    write_report(args.report.as_deref(), &report)?;
    if !args.quiet {
        println!(
            "{}: {} depth maps, {} runs, {} in {}, {:.1} : 1, {:.1} s",
            args.output.display(),
            report.depth_maps,
            report.runs,
            size(report.uncompressed_bytes),
            size(report.compressed_bytes),
            report.ratio,
            report.seconds
        );
    }
    Ok(())
}

fn run_info(path: &Path) -> Result<(), Failure> {
    let bytes = read(path)?;
    let file = open(path, &bytes)?;
    let meta = &file.meta;
    let strategy = Strategy::ALL.get(meta.strategy as usize).map_or("unknown".to_owned(), Strategy::to_string);
    let [width, height] = meta.atlas;
    let (compressed, uncompressed) = (file.compressed_bytes(), file.uncompressed_bytes());
    println!("file              {}", size(bytes.len() as u64));
    println!("atlas             {width} x {height} texels, {} with a depth map, {} charts", meta.texels, meta.charts);
    println!("depth maps        6 x {0} x {0}, {strategy}, {1} blocks", meta.depth, meta.blocks);
    println!("depth step        {:e} world units", meta.quantum);
    println!("bounds            {:?} to {:?}", meta.bounds_min, meta.bounds_max);
    println!("parts             {}", file.parts.iter().count());
    println!("runs              {}", meta.runs);
    println!("directory         {}", size(4 * file.maps.directory.len() as u64));
    println!("blocks            {}", size(4 * file.maps.blocks.len() as u64));
    println!(
        "depth             {} in {}, {:.1} : 1",
        size(uncompressed),
        size(compressed),
        uncompressed as f64 / compressed as f64
    );
    println!(
        "from outside      {0} x {0} directions of {1} x {1}, {2}",
        meta.csm_grid,
        meta.csm_side,
        size(4 * (file.csm.directory.len() + file.csm.blocks.len()) as u64)
    );
    println!("close surfaces    {} of {} rays have two within a depth step", meta.close, meta.rays);
    Ok(())
}

fn run_verify(args: &VerifyArgs) -> Result<(), Failure> {
    let file = open(&args.file, &read(&args.file)?)?;
    let scene = Scene::from_gltf(&Source::open(&args.scene)?)?;
    let agreement = with_threads(None, || verify(&file, &scene, args.rays))??;
    let missed = agreement.pairs - agreement.agreeing;
    println!("{} pairs of surface points, {missed} disagree", agreement.pairs);
    println!("distance of disagreements from an edge of visibility, in texels and pixels:");
    let mut low = 0.0;
    let ends = bevy_bounce_bake::verify::BIN_ENDS.map(Some).into_iter().chain([None]);
    for (end, count) in ends.zip(agreement.distances) {
        let range = end.map_or(format!("{low:4.2} and more"), |end| format!("{low:4.2} to {end:4.2}"));
        println!("  {range:<14} {count:>9}  {:6.3} %", 100.0 * count as f64 / agreement.pairs.max(1) as f64);
        low = end.unwrap_or(low);
    }
    println!("within one texel: {:.2} % of the disagreements", agreement.near_percent());
    let chance = 100.0 * agreement.sampled_near as f64 / agreement.sampled.max(1) as f64;
    println!("within one texel: {chance:.2} % of all pairs");
    let nearest = 100.0 * agreement.nearest as f64 / agreement.pairs.max(1) as f64;
    println!("by a single pixel, without filtering: {nearest:.2} %");
    println!("agreement {:.2} %", agreement.percent());
    if agreement.percent() < args.min_agreement {
        let line = format!(
            "{}: agreement is below {} %; bake with a larger --atlas or --depth",
            args.file.display(),
            args.min_agreement
        );
        return Err(Failure { line, status: FAILED });
    }
    Ok(())
}

/// Writes a result.
fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    write_atomically(path, bytes).map_err(|error| Failure { line: error.to_string(), status: FAILED })
}

/// Writes a report where one is asked for.
fn write_report(path: Option<&Path>, report: &impl serde::Serialize) -> Result<(), Failure> {
    let Some(path) = path else { return Ok(()) };
    let json = serde_json::to_vec_pretty(report)
        .map_err(|error| Failure { line: format!("{}: {error}", path.display()), status: FAILED })?;
    write(path, &json)
}

/// Runs `body` on so many threads, or on one a core.
fn with_threads<T: Send>(threads: Option<usize>, body: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    let pool = pool.map_err(|error| Failure { line: format!("threads: {error}"), status: FAILED })?;
    Ok(pool.install(body))
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    std::fs::read(path).map_err(|error| Failure {
        line: format!("{}: cannot be read: {error}; give a file that `bounce-bake bake` wrote", path.display()),
        status: BAD_INPUT,
    })
}

fn open(path: &Path, bytes: &[u8]) -> Result<CssmFile, Failure> {
    CssmFile::from_bytes(bytes)
        .map_err(|error| Failure { line: format!("{}: {error}", path.display()), status: BAD_INPUT })
}

/// Bytes for people.
fn size(bytes: u64) -> String {
    match bytes {
        0..10_000 => format!("{bytes} B"),
        10_000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1.0e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1.0e6),
        _ => format!("{:.2} GB", bytes as f64 / 1.0e9),
    }
}
