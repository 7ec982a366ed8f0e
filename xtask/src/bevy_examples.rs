//! Bevy's own examples with bounced light: the sources that Bevy ships, with two lines more.

use std::env;
use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::Result;
use crate::licences::packages;
use crate::process::{cargo, root, run};

/// After Bevy's own plugins.
const PLUGINS: &str = ".add_plugins(bevy_bounce::prelude::GlobalIlluminationPlugins::default())";
/// Beside `Camera3d`.
const CAMERA: &str = "bevy_bounce::prelude::GlobalIllumination::default(),";
/// Where it runs, and where it has its cameras.
const RUN: &str = ".run()";
const CAMERA_3D: &str = "Camera3d::default(),";

/// What most of Bevy's examples of three dimensions use, without sound, gamepads and the clipboard, which need headers of the system.
const FEATURES: [&str; 15] = [
    "std",
    "3d_bevy_render",
    "ui_api",
    "ui_bevy_render",
    "default_app",
    "scene",
    "bevy_winit",
    "x11",
    "default_font",
    "multi_threaded",
    "keyboard",
    "mouse",
    "jpeg",
    "area_light_luts",
    "free_camera",
];
/// With which Bevy takes a picture of its own window and ends.
const TESTING: &str = "bevy_ci_testing";

const USAGE: &str = "\
usage: cargo xtask bevy EXAMPLE [OPTIONS]

  One of the examples that Bevy ships (`lighting`, `animated_mesh`, `deferred_rendering`, ...) with bounced light: its
  source, to which the plugin group and the camera's component are added. It is built beside the workspace, with more of
  Bevy than that has, which takes a while. Those that use further crates or features of Bevy do not build.

  --assets FOLDER       Bevy's `assets`, which its package does not have in it
  --frames N            end after so many frames, with a picture of the window in target/bevy/screenshot-N.png
  --without             the source as it is
";

/// What was asked for.
#[derive(Debug, Default, PartialEq)]
struct Options {
    example: String,
    /// Where Bevy looks for a folder `assets`.
    asset_root: Option<PathBuf>,
    frames: Option<u32>,
    without: bool,
}

impl Options {
    fn parse(args: &[String]) -> Result<Self> {
        let mut options = Self::default();
        let mut args = args.iter();
        while let Some(arg) = args.next() {
            let mut value = || args.next().ok_or(format!("bevy: `{arg}` needs a value"));
            match arg.as_str() {
                "--assets" => options.asset_root = Some(asset_root(value()?)?),
                "--frames" => {
                    let frames = value()?;
                    let parsed = frames.parse().map_err(|_| format!("bevy: --frames `{frames}` is not a number"))?;
                    options.frames = Some(parsed);
                }
                "--without" => options.without = true,
                name if !name.starts_with('-') && options.example.is_empty() => options.example = name.to_owned(),
                other => return Err(format!("bevy: no option `{other}`\n\n{USAGE}").into()),
            }
        }
        if options.example.is_empty() { Err(format!("bevy: which example?\n\n{USAGE}").into()) } else { Ok(options) }
    }
}

/// The folder that holds that one, whose name Bevy takes for granted.
fn asset_root(assets: &str) -> Result<PathBuf> {
    let folder = fs::canonicalize(assets).map_err(|error| format!("bevy: --assets {assets}: {error}"))?;
    let root = folder.parent().filter(|_| folder.ends_with("assets"));
    Ok(root.ok_or(format!("bevy: --assets {assets}: Bevy looks for a folder of the name `assets`"))?.to_owned())
}

/// Builds and runs one of them.
pub fn bevy(args: &[String]) -> Result<()> {
    if args.iter().any(|arg| arg == "--help" || arg == "-h") {
        print!("{USAGE}");
        return Ok(());
    }
    let options = Options::parse(args)?;
    let bevy = Bevy::find()?;
    let path = bevy.example(&options.example)?;
    let failed = |error: &dyn Display| format!("{}: {error}", path.display());
    let source = fs::read_to_string(&path).map_err(|error| failed(&error))?;
    let source = if options.without { source } else { with_bounced_light(&source).map_err(|error| failed(&error))? };

    let folder = root().join("target/bevy");
    let write = |file: &str, text: &str| {
        let path = folder.join(file);
        fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))
    };
    fs::create_dir_all(folder.join("examples"))?;
    write("lib.rs", "")?;
    write("Cargo.toml", &manifest(&bevy.version, options.frames.is_some()))?;
    fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock"))?;
    write(&format!("examples/{}.rs", options.example), &source)?;
    copy_files(&bevy.folder.join("examples/helpers"), &folder.join("helpers"))?;

    let mut command = cargo(["run", "--example", &options.example]);
    command.current_dir(&folder);
    if let Some(root) = &options.asset_root {
        command.env("BEVY_ASSET_ROOT", root);
    }
    if let Some(frames) = options.frames {
        write("frames.ron", &format!("(events: [({frames}, ScreenshotAndExit)])"))?;
        command.env("CI_TESTING_CONFIG", folder.join("frames.ron"));
    }
    if env::var_os("CARGO_TARGET_DIR").is_none() {
        command.env("CARGO_TARGET_DIR", folder.join("target"));
    }
    run(&mut command)?;
    if let Some(frames) = options.frames {
        println!("The picture: {}", folder.join(format!("screenshot-{frames}.png")).display());
    }
    Ok(())
}

/// Files of one folder into another.
fn copy_files(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    let files = fs::read_dir(from).map_err(|error| format!("{}: {error}", from.display()))?;
    for file in files.flatten().map(|file| file.path()).filter(|file| file.is_file()) {
        fs::copy(&file, to.join(file.file_name().unwrap_or_default()))?;
    }
    Ok(())
}

/// Bevy's package.
struct Bevy {
    version: String,
    folder: PathBuf,
}

impl Bevy {
    /// The one that the workspace is built with.
    fn find() -> Result<Self> {
        let packages = packages()?;
        let bevy = packages.iter().find(|package| package["name"] == "bevy").ok_or("bevy: not in the workspace")?;
        let text = |field: &str| bevy[field].as_str().map(str::to_owned);
        let folder = text("manifest_path").and_then(|path| Some(Path::new(&path).parent()?.to_owned()));
        let (version, folder) = text("version").zip(folder).ok_or("bevy: cargo does not say where it is")?;
        Ok(Self { version, folder })
    }

    /// The source of an example, in whichever of its folders that is.
    fn example(&self, name: &str) -> Result<PathBuf> {
        let folder = self.folder.join("examples");
        let folders = fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        let mut files = folders.flatten().map(|folder| folder.path().join(format!("{name}.rs")));
        let found = files.find(|file| file.is_file());
        found.ok_or_else(|| format!("bevy: no example `{name}` in {}", folder.display()).into())
    }
}

/// The package of the example, a workspace of its own.
fn manifest(version: &str, testing: bool) -> String {
    let features: Vec<&str> = FEATURES.into_iter().chain(testing.then_some(TESTING)).collect();
    let bounce = Value::from(root().join("crates/bevy_bounce").to_string_lossy());
    format!(
        "[package]\nname = \"bevy_example\"\nedition = \"2024\"\npublish = false\n\n[lib]\npath = \"lib.rs\"\n\n[workspace]\n\n\
         [dependencies]\nbevy = {{ version = \"={version}\", default-features = false, features = {features:?} }}\n\
         bevy_bounce = {{ path = {bounce} }}\n\n[profile.dev]\nopt-level = 1\ndebug = false\n"
    )
}

/// The source with two lines more: the plugins before it runs, and the component of each camera.
fn with_bounced_light(source: &str) -> std::result::Result<String, String> {
    let mut lines = Vec::new();
    let (mut apps, mut cameras) = (0, 0);
    for line in source.lines() {
        let indent = &line[..line.len() - line.trim_start().len()];
        if line.trim().trim_end_matches(';') == RUN && apps == 0 {
            lines.push(format!("{indent}{PLUGINS}"));
            apps += 1;
        }
        lines.push(line.to_owned());
        if line.trim() == CAMERA_3D {
            lines.push(format!("{indent}{CAMERA}"));
            cameras += 1;
        }
    }
    if apps == 0 || cameras == 0 {
        return Err(format!(
            "has no line `{RUN}` or no line `{CAMERA_3D}`: where bounced light goes is for you to say"
        ));
    }
    Ok(lines.join("\n") + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bevys_examples_take_two_lines() -> Result<()> {
        let bevy = Bevy::find()?;
        for name in ["lighting", "animated_mesh", "deferred_rendering"] {
            let source = fs::read_to_string(bevy.example(name)?)?;
            let changed = with_bounced_light(&source)?;
            let [before, after] = [&source, &changed].map(|text| text.lines().count());
            assert_eq!(after, before + 2, "{name}");
            let kept: Vec<&str> = changed.lines().filter(|line| !line.contains("bevy_bounce")).collect();
            assert_eq!(kept, source.lines().collect::<Vec<_>>(), "{name}: nothing else changes");
        }
        assert!(bevy.example("no_such_example").is_err());
        assert!(with_bounced_light("fn main() {}").is_err());
        Ok(())
    }

    #[test]
    fn options_are_read() -> Result<()> {
        let parse = |args: &[&str]| Options::parse(&args.iter().map(|&arg| arg.to_owned()).collect::<Vec<_>>());
        let options = parse(&["lighting", "--frames", "30", "--without"])?;
        let example = "lighting".to_owned();
        assert_eq!(options, Options { example, frames: Some(30), without: true, ..Options::default() });
        let assets = root().join("assets");
        let options = parse(&["lighting", "--assets", &assets.to_string_lossy()])?;
        assert_eq!(options.asset_root.map(|root| root.join("assets")), Some(fs::canonicalize(&assets)?));
        assert!(parse(&["lighting", "--assets", &root().to_string_lossy()]).is_err(), "another name");
        for wrong in
            [&["--frames", "30"] as &[&str], &["lighting", "--frames"], &["lighting", "--frame", "3"], &["a", "b"]]
        {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
        Ok(())
    }
}
