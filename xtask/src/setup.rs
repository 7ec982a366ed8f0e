//! What a bare machine lacks: a Vulkan driver.

use std::env;
use std::process::{Command, Stdio};

use crate::Result;
use crate::drivers::{Driver, System};
use crate::packages::{PackageManager, find_program};
use crate::process::run;

/// Finds an adapter, or installs Mesa's software driver; fails with the line to type where it may not.
pub fn setup() -> Result<()> {
    if !cfg!(target_os = "linux") {
        println!("setup: this system brings its own graphics driver");
        return Ok(());
    }
    if let Some(driver) = adapter(&System::here()) {
        report(&driver);
        return Ok(());
    }
    println!("setup: no Vulkan adapter; installing Mesa's software driver");
    install()?;
    let driver =
        adapter(&System::here()).ok_or("Mesa's driver is installed, but the Vulkan loader does not find it")?;
    report(&driver);
    Ok(())
}

/// The driver to name: hardware before software.
fn adapter(system: &System) -> Option<Driver> {
    if !system.has_loader() {
        return None;
    }
    system.drivers().into_iter().min_by_key(|driver| driver.software)
}

fn report(driver: &Driver) {
    let kind = if driver.software { "software" } else { "hardware" };
    println!("setup: {kind} Vulkan driver {}", driver.manifest.display());
}

fn install() -> Result<()> {
    let path = env::var_os("PATH").unwrap_or_default();
    let manager = PackageManager::find(&path).ok_or(
        "no package manager that this knows (apt-get, dnf, pacman, zypper, apk): \
         install a Vulkan loader and a driver, Mesa's lavapipe for example",
    )?;
    let Some(elevate) = privilege(is_root(), |program| find_program(&path, program) && allows(program)) else {
        let line = manager.commands(Some("sudo")).join(" && ");
        return Err(format!(
            "a Vulkan driver is missing, and installing it needs your password. Type:\n\n    {line}\n"
        )
        .into());
    };
    for line in manager.commands(elevate) {
        let mut words = line.split_whitespace();
        let mut command = Command::new(words.next().unwrap_or_default());
        command.args(words).env("DEBIAN_FRONTEND", "noninteractive").stdin(Stdio::null());
        run(&mut command)?;
    }
    Ok(())
}

/// How to install: `Some(None)` as root, `Some(Some(..))` through a program that asks for no password, `None` not at all.
fn privilege(root: bool, allows: impl Fn(&str) -> bool) -> Option<Option<&'static str>> {
    if root {
        return Some(None);
    }
    [("sudo", "sudo -n"), ("doas", "doas -n")]
        .into_iter()
        .find(|(program, _)| allows(program))
        .map(|(_, call)| Some(call))
}

fn is_root() -> bool {
    Command::new("id").arg("-u").output().is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

fn allows(program: &str) -> bool {
    let silent = Command::new(program)
        .args(["-n", "true"])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    silent.is_ok_and(|status| status.success())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_installs_by_itself() {
        assert_eq!(privilege(true, |_| false), Some(None));
    }

    #[test]
    fn others_need_a_program_without_a_password() {
        assert_eq!(privilege(false, |program| program == "sudo"), Some(Some("sudo -n")));
        assert_eq!(privilege(false, |program| program == "doas"), Some(Some("doas -n")));
        assert_eq!(privilege(false, |_| false), None);
    }
}
