//! Folders of the workspace, and the programs that chores start.

use std::env;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::Result;

/// The workspace's folder. Read when run, not when compiled: one build may serve several checkouts.
pub fn root() -> PathBuf {
    let manifest = env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
    let parent = manifest.as_deref().and_then(Path::parent).map(Path::to_path_buf);
    parent.or_else(|| env::current_dir().ok()).unwrap_or_default()
}

/// The folder of scenes and references that are too large or not free enough to be committed: `BOUNCE_SHARED`, or
/// `shared` beside the checkout.
pub fn shared() -> Option<PathBuf> {
    let named = env::var_os("BOUNCE_SHARED").map(PathBuf::from);
    let folder = named.or_else(|| root().parent().map(|parent| parent.join("shared")))?;
    (folder.join("scenes").is_dir() && folder.join("references").is_dir()).then_some(folder)
}

/// Cargo at the workspace's root.
pub fn cargo<S: AsRef<std::ffi::OsStr>>(args: impl IntoIterator<Item = S>) -> Command {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(args).current_dir(root());
    graphics(&mut command);
    command
}

/// On Linux Vulkan alone unless the user says otherwise, so that a run does not depend on which backend answers first.
///
/// Where no desktop runs, Mesa's device-select layer, which would look for one and complain, stays out.
pub fn graphics(command: &mut Command) {
    if !cfg!(target_os = "linux") {
        return;
    }
    if env::var_os("WGPU_BACKEND").is_none() {
        command.env("WGPU_BACKEND", "vulkan");
    }
    if env::var_os("XDG_RUNTIME_DIR").is_none() {
        command.env("NODEVICE_SELECT", "1");
    }
}

/// The command as one would type it.
pub fn line(command: &Command) -> String {
    let program = Path::new(command.get_program()).file_name().unwrap_or(command.get_program());
    let words = [program].into_iter().chain(command.get_args());
    words.map(|word| word.to_string_lossy().into_owned()).collect::<Vec<_>>().join(" ")
}

/// Prints the command, runs it, and fails where it does.
pub fn run(command: &mut Command) -> Result<()> {
    println!("$ {}", line(command));
    let status = command.status().map_err(|error| format!("cannot start `{}`: {error}", line(command)))?;
    if status.success() { Ok(()) } else { Err(format!("`{}` failed ({status})", line(command)).into()) }
}

/// Builds one example, with the features of the whole workspace so that Bevy is compiled once, and says where it is.
pub fn build_example(name: &str, release: bool) -> Result<PathBuf> {
    let mut command = cargo(["build", "--workspace", "--example", name]);
    if release {
        command.arg("--release");
    }
    println!("$ {}", line(&command));
    command.arg("--message-format=json-render-diagnostics").stdout(Stdio::piped());
    let mut child = command.spawn().map_err(|error| format!("cannot start cargo: {error}"))?;
    let mut executable = None;
    if let Some(stdout) = child.stdout.take() {
        for message in BufReader::new(stdout).lines() {
            executable = example_executable(&message?, name).or(executable);
        }
    }
    let status = child.wait()?;
    if !status.success() {
        return Err(format!("the example `{name}` does not build").into());
    }
    executable.ok_or_else(|| format!("cargo named no program for the example `{name}`").into())
}

fn example_executable(message: &str, name: &str) -> Option<PathBuf> {
    let message: serde_json::Value = serde_json::from_str(message).ok()?;
    let target = message.get("target")?;
    let is_example = target.get("kind")?.as_array()?.iter().any(|kind| kind == "example");
    (is_example && target.get("name")? == name).then(|| message.get("executable")?.as_str().map(PathBuf::from))?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_is_read_from_cargos_messages() {
        let artifact = r#"{"reason": "compiler-artifact", "target": {"kind": ["example"], "name": "viewer"}, "executable": "/t/viewer"}"#;
        assert_eq!(example_executable(artifact, "viewer"), Some(PathBuf::from("/t/viewer")));
        assert_eq!(example_executable(artifact, "minimal"), None);
        let library =
            r#"{"reason": "compiler-artifact", "target": {"kind": ["lib"], "name": "viewer"}, "executable": null}"#;
        assert_eq!(example_executable(library, "viewer"), None);
        assert_eq!(example_executable(r#"{"reason": "build-finished", "success": true}"#, "viewer"), None);
        assert_eq!(example_executable("warning: text", "viewer"), None);
    }

    #[test]
    fn commands_are_shown_without_their_folder() {
        let mut command = Command::new("/usr/bin/cargo");
        command.args(["fmt", "--check"]);
        assert_eq!(line(&command), "cargo fmt --check");
    }
}
