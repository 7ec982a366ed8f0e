//! `bounce-bake lightmap`.

use std::path::Path;

use bevy_bounce_bake::lightmap::{BRIGHTEST, texture_names};
use bevy_bounce_bake::{LightmapSettings, Source, bake_lightmap};

use super::args::LightmapArgs;
use super::progress::Bar;
use super::{BAD_INPUT, Failure, size, with_threads, write, write_report};

pub fn run(args: &LightmapArgs) -> Result<(), Failure> {
    let LightmapArgs { atlas, rays, bounces, probes, direct, unwrap, .. } = *args;
    let settings = LightmapSettings { atlas, rays, bounces, probes, direct, unwrap };
    settings.check()?;
    let stem = stem(&args.output, &args.scene)?;
    let source = Source::open(&args.scene)?;
    let bar = Bar::new(args.quiet);
    let (files, report) = with_threads(args.threads, || bake_lightmap(&source, &stem, &settings, &bar))??;
    bar.finish();
    let [lightmap, volume] = texture_names(&stem).map(|name| args.output.with_file_name(name));
    write(&lightmap, &files.lightmap)?;
    if let Some(bytes) = &files.volume {
        write(&volume, bytes)?;
    }
    write(&args.output, &files.scene)?;
    write_report(args.report.as_deref(), &report)?;
    if report.cut_off > 0 {
        eprintln!(
            "bounce-bake: {}: {} texels are brighter than the {BRIGHTEST} cd/m² that the format holds; scale the lights down",
            lightmap.display(),
            report.cut_off
        );
    }
    if !args.quiet {
        let [width, height] = report.atlas;
        println!(
            "{}: {} of {width} x {height} texels in {} charts, {} bounces, lightmap {}, volume {}, {:.1} s",
            args.output.display(),
            report.texels,
            report.charts,
            report.bounces,
            size(files.lightmap.len() as u64),
            files.volume.map_or("none".to_owned(), |bytes| size(bytes.len() as u64)),
            report.seconds
        );
    }
    Ok(())
}

/// The name that the files share.
fn stem(output: &Path, scene: &Path) -> Result<String, Failure> {
    let wrong = |problem: &str| Err(Failure { line: format!("{}: {problem}", output.display()), status: BAD_INPUT });
    if output.is_dir() {
        return wrong("is a folder; give a file to write, as OUT.glb");
    }
    if output.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("glb")) {
        return wrong("what is written is binary glTF; name it .glb");
    }
    if let (Ok(output), Ok(scene)) = (output.canonicalize(), scene.canonicalize())
        && output == scene
    {
        return wrong("is the scene itself, which would be lost; give another name");
    }
    match output.file_stem().and_then(|stem| stem.to_str()) {
        Some(stem) => Ok(stem.to_owned()),
        None => wrong("the name is not UTF-8; give another one"),
    }
}
