//! The two commands of a newcomer. Both build with the dev profile and the whole workspace's features, so that Bevy is
//! compiled once for both.

use std::env;
use std::fs;
use std::process::Command;

use crate::Result;
use crate::process::{build_example, cargo, graphics, root, run};
use crate::setup::setup;
use crate::stats::Stats;
use crate::table::{NONE, Table, bytes, grouped, milliseconds};

/// Sets up, builds the viewer and shows its default scene.
pub fn demo(args: &[String]) -> Result<()> {
    let split = args.iter().position(|arg| arg == "--").unwrap_or(args.len());
    let (own, viewer_args) = (&args[..split], args.get(split + 1..).unwrap_or_default());
    if let Some(unknown) = own.iter().find(|arg| *arg != "--headless") {
        return Err(format!("demo: no option `{unknown}`; the viewer's own options follow `--`").into());
    }
    setup()?;
    println!("Building. Bevy and all it stands on are compiled once; that takes a while.");
    let viewer = build_example("viewer", false)?;
    if own.is_empty() && has_display(|name| env::var_os(name).is_some_and(|value| !value.is_empty())) {
        let mut command = Command::new(&viewer);
        command.args(viewer_args).current_dir(root());
        graphics(&mut command);
        match run(&mut command) {
            Ok(()) => return Ok(()),
            Err(error) => println!("{error}: is the display there? Rendering without a window instead."),
        }
    }
    let output = root().join("target");
    fs::create_dir_all(&output).map_err(|error| format!("{}: {error}", output.display()))?;
    let mut command = Command::new(&viewer);
    command.args(["--output", "target/demo.png", "--stats", "target/demo.json"]);
    if !viewer_args.iter().any(|arg| arg == "--size" || arg.starts_with("--size=")) {
        command.args(["--size", "640x360"]);
    }
    command.args(viewer_args).current_dir(root());
    graphics(&mut command);
    run(&mut command)?;
    print!("\n{}", summary(&Stats::read(&output.join("demo.json"))?));
    println!("\nThe picture: {}", output.join("demo.png").display());
    Ok(())
}

/// Sets up and runs every test.
pub fn test(args: &[String]) -> Result<()> {
    setup()?;
    run(cargo(["test", "--workspace"]).args(args))
}

fn has_display(is_set: impl Fn(&str) -> bool) -> bool {
    if is_set("CI") {
        return false;
    }
    !cfg!(target_os = "linux") || is_set("WAYLAND_DISPLAY") || is_set("DISPLAY")
}

fn summary(stats: &Stats) -> String {
    let (width, height) = stats.size;
    let mut table = Table::new(["stage", "GPU ms", "CPU ms"]);
    let cell = |times: Option<crate::stats::Times>| times.map_or(NONE.to_owned(), |times| milliseconds(times.median));
    for (name, stage) in &stats.stages {
        table.row([name.clone(), cell(stage.gpu), cell(stage.cpu)]);
    }
    let p95 = stats.frame.p95.map_or(String::new(), |p95| format!(", 95th percentile {} ms", milliseconds(p95)));
    format!(
        "{}, {width}x{height}, {} triangles, {} virtual lights, {} on the GPU\n\n{table}\nframe: median {} ms{p95}\n",
        stats.adapter,
        grouped(stats.triangles),
        grouped(stats.vpls),
        bytes(stats.gpu_bytes),
        milliseconds(stats.frame.median),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{Stage, Times};

    #[test]
    fn automation_never_opens_a_window() {
        assert!(!has_display(|_| true));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_display_is_named_by_the_environment() {
        assert!(has_display(|name| name == "DISPLAY"));
        assert!(has_display(|name| name == "WAYLAND_DISPLAY"));
        assert!(!has_display(|_| false));
    }

    #[test]
    fn the_summary_names_what_was_measured() {
        let times = |median| Some(Times { median, p95: None });
        let stats = Stats {
            adapter: "llvmpipe".into(),
            size: (640, 360),
            triangles: 34,
            vpls: 1024,
            gpu_bytes: 2 << 20,
            gpu_items: Vec::new(),
            frame: Times { median: 41.0, p95: Some(45.0) },
            stages: vec![("voxelize".into(), Stage { gpu: times(3.25), cpu: None })],
        };
        let text = summary(&stats);
        for part in
            ["llvmpipe, 640x360, 34 triangles, 1,024", "2.0 MiB", "| voxelize |   3.25 |", "median 41.0 ms", "45.0"]
        {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }
}
