//! The pictures of the README, rendered by the examples themselves.

use std::fs;
use std::process::Command;

use crate::Result;
use crate::process::{build_example, graphics, root, run};
use crate::setup::setup;

/// File name without extension, example, its options.
const PICTURES: [(&str, &str, &[&str]); 6] = [
    ("cornell_animated", "cornell_animated", &["--time", "2", "--frames", "1"]),
    ("moving_lamp", "moving_lamp", &["--time", "2", "--frames", "1"]),
    ("u_room", "u_room", &[]),
    ("cornell_direct", "viewer", &["--isolate", "direct"]),
    ("cornell_indirect", "viewer", &["--isolate", "indirect"]),
    ("cornell_all", "viewer", &[]),
];

/// Renders all of them, or those named, into `assets/readme`.
pub fn pictures(names: &[String]) -> Result<()> {
    if let Some(unknown) = names.iter().find(|name| !PICTURES.iter().any(|(picture, ..)| picture == name)) {
        return Err(format!("pictures: no picture `{unknown}`").into());
    }
    setup()?;
    let folder = root().join("assets/readme");
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for (name, example, options) in PICTURES {
        if !names.is_empty() && !names.iter().any(|given| given == name) {
            continue;
        }
        let mut command = Command::new(build_example(example, false)?);
        command.args(["--output", &format!("assets/readme/{name}.png"), "--size", "640x360"]);
        command.args(options).current_dir(root());
        graphics(&mut command);
        run(&mut command)?;
    }
    Ok(())
}
