//! Everything a change must pass, on a bare machine too.

use std::num::NonZero;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::Result;
use crate::crates::crates;
use crate::licences::licences;
use crate::process::{cargo, run, shared};
use crate::setup::setup;
use crate::table::{Table, duration};

/// Test binaries that use a device, which the second run of tests is of.
const DEVICE_TESTS: [&str; 5] = ["suite", "baked", "caches", "frames", "settings"];

/// Tests that run with WebGPU's limits, too, by parts of their names: those of kernels, and for each technique and
/// effect a picture in which its passes run. That all kernels are made with these limits, and that radiance caches
/// light a scene alike with both, are tests by themselves.
const LIMITED: [&str; 52] = [
    "ambient::a_forward_app",
    "ambient::an_open_floor",
    "debug::voxels_are_lit",
    "cssm::eyes::what",
    "cssm::light::",
    "cssm::query::",
    "cssm::stage::cornell_box",
    "deform::",
    "eyes::lights",
    "fog::fog_in_a_forward",
    "fog::fog_is_lit_by",
    "harness::",
    "history::frames::still",
    "history::shaders",
    "masks::a_mask",
    "masks::maps",
    "masks::rays",
    "materials::an_extended",
    "near_lights::",
    "nested::a_scene",
    "nested::paths",
    "nested::rays",
    "nested::the_",
    "paths::",
    "pictures::a_furnace",
    "pictures::a_masked",
    "pictures::cornell_box",
    "probes::a_furnace",
    "probes::memory",
    "radiance_cache::clusters",
    "radiance_cache::light",
    "radiance_cache::stage::cornell_box",
    "sampling::",
    "settle::",
    "shadow_atlas::",
    "sky::an_",
    "sky::caches",
    "sky::directions",
    "sort::",
    "ssbc::a_pixel",
    "ssbc::at_pixels",
    "ssbc::convex",
    "ssbc::footprints",
    "ssbc::frames::a_furnace",
    "ssbc::pixels",
    "ssbc::the_",
    "ssbc::two",
    "views::a_split",
    "voxel_groups::cones",
    "voxel_groups::frames::groups",
    "voxel_groups::rays",
    "voxels::",
];

/// Steps in the order they run. Clippy leaves the dependencies' metadata behind, which `docs` uses again; both test
/// runs share one build.
const STEPS: [(&str, fn() -> Result<()>); 8] = [
    ("setup", setup),
    ("fmt", || run(&mut cargo(["fmt", "--all", "--check"]))),
    ("licences", licences),
    ("crates", crates),
    ("clippy", || run(&mut cargo(["clippy", "--workspace", "--all-targets", "--locked", "--", "--deny", "warnings"]))),
    ("test", || run(&mut tests())),
    ("webgpu", || run(&mut webgpu_tests())),
    ("docs", || run(cargo(["doc", "--workspace", "--no-deps", "--locked"]).env("RUSTDOCFLAGS", "--deny warnings"))),
];

/// Runs all steps, or those named, and goes on after a failure so that one run shows everything.
pub fn ci(names: &[String]) -> Result<()> {
    let steps = choose(names)?;
    match shared() {
        Some(folder) => println!("ci: scenes and references in {}; tests that need them must run", folder.display()),
        None => println!("ci: no shared scenes and references; tests that need them are skipped by name"),
    }
    let mut results: Vec<(&str, Duration, bool)> = Vec::new();
    for (i, (name, step)) in steps.iter().enumerate() {
        println!("\n== {name} ({} of {})", i + 1, steps.len());
        let start = Instant::now();
        let done = step();
        let time = start.elapsed();
        if let Err(error) = &done {
            eprintln!("ci: {name}: {error}");
        }
        println!("== {name}: {} after {}", verdict(done.is_ok()), duration(time));
        results.push((name, time, done.is_ok()));
        // Without an adapter every later failure would only repeat this one.
        if *name == "setup" && done.is_err() {
            break;
        }
    }
    print!("\n{}", summary(&results));
    let failed: Vec<&str> = results.iter().filter(|(_, _, ok)| !ok).map(|(name, _, _)| *name).collect();
    if failed.is_empty() { Ok(()) } else { Err(format!("failed: {}", failed.join(", ")).into()) }
}

/// Unless the environment says how many tests run at once, one more than there are processors: a test that waits for a frame of a software
/// adapter leaves one idle.
fn tests() -> Command {
    let mut command = cargo(["test", "--workspace", "--locked", "--no-fail-fast"]);
    if std::env::var_os("RUST_TEST_THREADS").is_none() {
        let processors = std::thread::available_parallelism().map_or(1, NonZero::get);
        command.env("RUST_TEST_THREADS", (processors + 1).to_string());
    }
    if let Some(folder) = shared() {
        command.env("BOUNCE_SHARED", folder).env("BOUNCE_STRICT", "1");
    }
    command
}

/// The same build with WebGPU's default limits, of [`LIMITED`].
fn webgpu_tests() -> Command {
    let mut command = tests();
    command.env("WGPU_SETTINGS_PRIO", "webgpu").env("BOUNCE_WEBGPU_LIMITS", "1");
    command.args(DEVICE_TESTS.iter().flat_map(|name| ["--test", name]));
    command.arg("--").args(LIMITED);
    command
}

type Step = (&'static str, fn() -> Result<()>);

fn choose(names: &[String]) -> Result<Vec<Step>> {
    if let Some(unknown) = names.iter().find(|name| !STEPS.iter().any(|(step, _)| step == name)) {
        let known: Vec<&str> = STEPS.iter().map(|(name, _)| *name).collect();
        return Err(format!("ci: no step `{unknown}`; there are {}", known.join(", ")).into());
    }
    Ok(STEPS.into_iter().filter(|(step, _)| names.is_empty() || names.iter().any(|name| name == step)).collect())
}

fn verdict(ok: bool) -> &'static str {
    if ok { "passed" } else { "FAILED" }
}

fn summary(results: &[(&str, Duration, bool)]) -> Table {
    let mut table = Table::new(["step", "time", "result"]);
    for (name, time, ok) in results {
        table.row([*name, &duration(*time), verdict(*ok)]);
    }
    let total = duration(results.iter().map(|(_, time, _)| *time).sum());
    table.row(["total", &total, verdict(results.iter().all(|(_, _, ok)| *ok))]);
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(steps: &[Step]) -> Vec<&'static str> {
        steps.iter().map(|(name, _)| *name).collect()
    }

    #[test]
    fn all_steps_run_unless_some_are_named() -> Result<()> {
        assert_eq!(names(&choose(&[])?), ["setup", "fmt", "licences", "crates", "clippy", "test", "webgpu", "docs"]);
        assert_eq!(names(&choose(&["docs".to_owned(), "fmt".to_owned()])?), ["fmt", "docs"]);
        assert!(choose(&["tests".to_owned()]).is_err_and(|error| error.to_string().contains("`tests`")));
        Ok(())
    }

    #[test]
    fn one_failure_fails_the_total() {
        let text =
            summary(&[("fmt", Duration::from_secs(1), true), ("test", Duration::from_secs(90), false)]).to_string();
        assert!(text.contains("| total | 1 min 31 s | FAILED |"), "{text}");
    }

    #[test]
    fn every_binary_of_a_device_runs_with_both_limits() -> Result<()> {
        let folders = std::fs::read_dir(crate::process::root().join("tests/tests"))?;
        let mut names: Vec<String> =
            folders.map(|folder| Ok(folder?.file_name().to_string_lossy().into_owned())).collect::<Result<_>>()?;
        names.sort_unstable();
        let mut known = DEVICE_TESTS;
        known.sort_unstable();
        assert_eq!(names, known);
        Ok(())
    }

    /// Paths of the tests below a folder that are not ignored, by the names of files and functions.
    fn tests_below(folder: &std::path::Path, module: &str, found: &mut Vec<String>) -> Result<()> {
        for entry in std::fs::read_dir(folder)? {
            let path = entry?.path();
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let within = if name == "main" { module.to_owned() } else { format!("{module}{name}::") };
            if path.is_dir() {
                tests_below(&path, &within, found)?;
                continue;
            }
            let text = std::fs::read_to_string(&path)?;
            let mut attributes = String::new();
            for line in text.lines().map(str::trim) {
                if line.starts_with("#[") {
                    attributes += line;
                } else {
                    let function = line.strip_prefix("fn ").and_then(|rest| rest.split('(').next());
                    let runs = attributes.contains("#[test]") && !attributes.contains("#[ignore");
                    found.extend(function.filter(|_| runs).map(|function| format!("{within}{function}")));
                    attributes.clear();
                }
            }
        }
        Ok(())
    }

    #[test]
    fn what_runs_with_webgpu_limits_is_there() -> Result<()> {
        let mut all = Vec::new();
        for binary in DEVICE_TESTS {
            let mut tests = Vec::new();
            tests_below(&crate::process::root().join("tests/tests").join(binary), "", &mut tests)?;
            let runs = tests.iter().any(|test| LIMITED.iter().any(|part| test.contains(part)));
            assert!(runs, "no test of {binary} runs with WebGPU's limits");
            all.extend(tests);
        }
        let gone: Vec<&str> = LIMITED.into_iter().filter(|part| !all.iter().any(|test| test.contains(part))).collect();
        assert!(gone.is_empty(), "no test's name has {gone:?} in it");
        Ok(())
    }

    #[test]
    fn test_runs_are_one_build() {
        let (first, second) = (crate::process::line(&tests()), crate::process::line(&webgpu_tests()));
        assert_eq!(first, "cargo test --workspace --locked --no-fail-fast");
        assert!(second.starts_with(&format!("{first} --test suite")), "{second}");
    }
}
