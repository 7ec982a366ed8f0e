//! The project's chores: set-up, demo, tests, checks and measurements.
//!
//! `cargo xtask help` lists them. Plain Rust, so that it builds in seconds on a bare machine and can set up the rest.

mod bench;
mod bench_report;
mod bench_samples;
mod bevy_examples;
mod ci;
mod crates;
mod demo;
mod drivers;
mod glb;
mod licences;
mod packages;
mod pictures;
mod process;
mod setup;
mod stats;
mod table;

use std::error::Error;
use std::process::ExitCode;

/// Chores end with one line that says what went wrong.
pub type Result<T> = std::result::Result<T, Box<dyn Error>>;

const USAGE: &str = "\
usage: cargo xtask COMMAND

  demo [--headless] [-- VIEWER OPTIONS]
                 set up, build, and show a scene: in a window where there is a display, otherwise as
                 target/demo.png with a table of stage times
  test [CARGO TEST OPTIONS]
                 set up, then `cargo test --workspace`
  setup          find a Vulkan adapter; install Mesa's software driver where there is none
  ci [STEP...]   everything a change must pass: setup fmt licences crates clippy
                 test webgpu docs
  bench [OPTIONS]
                 stage times, median and 95th percentile, beside plain Bevy; `cargo xtask bench --help`
  pictures [NAME...]
                 render the pictures of the README into assets/readme
  bevy EXAMPLE [OPTIONS]
                 one of Bevy's own examples with bounced light; `cargo xtask bevy --help`
  help           this text
";

fn main() -> ExitCode {
    let mut args = std::env::args().skip(1);
    let command = args.next();
    let rest: Vec<String> = args.collect();
    let done = match command.as_deref() {
        Some("demo") => demo::demo(&rest),
        Some("test") => demo::test(&rest),
        Some("setup") => setup::setup(),
        Some("ci") => ci::ci(&rest),
        Some("pictures") => pictures::pictures(&rest),
        Some("bench") => bench::bench(&rest),
        Some("bevy") => bevy_examples::bevy(&rest),
        Some("help" | "--help" | "-h") => {
            print!("{USAGE}");
            Ok(())
        }
        other => {
            if let Some(other) = other {
                eprintln!("xtask: no command `{other}`\n");
            }
            eprint!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first Rust block of a text, without `prefix` at the start of its lines.
    fn snippet(text: &str, prefix: &str) -> Vec<String> {
        let lines = text.lines().map(|line| line.strip_prefix(prefix).unwrap_or(line).trim_end());
        let block = lines.skip_while(|line| !line.starts_with("```")).skip(1).take_while(|line| *line != "```");
        block.map(str::to_owned).collect()
    }

    #[test]
    fn the_readme_shows_what_the_crate_documents() -> Result<()> {
        let read = |file: &str| std::fs::read_to_string(process::root().join(file));
        let readme = read("README.md")?;
        let usage = readme.split_once("## Use it").map(|(_, rest)| rest).unwrap_or_default();
        let (shown, documented) = (snippet(usage, ""), snippet(&read("crates/bevy_bounce/src/lib.rs")?, "//! "));
        let documented: Vec<String> = documented.iter().map(|line| line.trim_start_matches("//!").to_owned()).collect();
        assert_eq!(shown, documented);
        assert!(shown.len() >= 8, "{shown:?}");
        Ok(())
    }

    #[test]
    fn the_usage_names_every_command() {
        for command in ["demo", "test", "setup", "ci", "bench", "pictures", "bevy", "help"] {
            assert!(USAGE.contains(&format!("\n  {command} ")), "{command}");
        }
    }
}
