//! The pictures of the README, rendered by the examples themselves.

use std::fs;
use std::process::Command;

use crate::Result;
use crate::process::{build_example, graphics, root, run};
use crate::setup::setup;

const LARGE: &str = "640x360";
/// A picture of a film strip.
const SMALL: &str = "288x162";

/// File name without extension, example, size in pixels, other options.
const PICTURES: [(&str, &str, &str, &[&str]); 8] = [
    ("cornell_animated", "cornell_animated", LARGE, &["--time", "2", "--frames", "1"]),
    ("moving_lamp_1", "moving_lamp", SMALL, &["--time", "7.5", "--frames", "1"]),
    ("moving_lamp_2", "moving_lamp", SMALL, &["--time", "9", "--frames", "1"]),
    ("moving_lamp_3", "moving_lamp", SMALL, &["--time", "10.5", "--frames", "1"]),
    ("moving_lamp_4", "moving_lamp", SMALL, &["--time", "12", "--frames", "1"]),
    ("cornell_direct", "viewer", LARGE, &["--isolate", "direct"]),
    ("cornell_indirect", "viewer", LARGE, &["--isolate", "indirect"]),
    ("cornell_all", "viewer", LARGE, &[]),
];

/// Renders all of them, or those named, into `assets/readme`.
pub fn pictures(names: &[String]) -> Result<()> {
    if let Some(unknown) = names.iter().find(|name| !PICTURES.iter().any(|(picture, ..)| picture == name)) {
        return Err(format!("pictures: no picture `{unknown}`").into());
    }
    setup()?;
    let folder = root().join("assets/readme");
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for (name, example, size, options) in PICTURES {
        if !names.is_empty() && !names.iter().any(|given| given == name) {
            continue;
        }
        let mut command = Command::new(build_example(example, false)?);
        command.args(["--output", &format!("assets/readme/{name}.png"), "--size", size]);
        command.args(options).current_dir(root());
        graphics(&mut command);
        run(&mut command)?;
    }
    Ok(())
}
