//! System package managers, and how each installs Mesa's software Vulkan driver.

use std::path::Path;

/// A package manager that has lavapipe.
#[derive(Debug, PartialEq, Eq)]
pub struct PackageManager {
    /// Its program, as found on `PATH`.
    pub program: &'static str,
    /// Refreshes the lists of packages, where installing does not do so by itself.
    refresh: Option<&'static str>,
    /// Installs the Vulkan loader and lavapipe without a question.
    install: &'static str,
}

const MANAGERS: &[PackageManager] = &[
    PackageManager {
        program: "apt-get",
        refresh: Some("apt-get update"),
        install: "apt-get install -y --no-install-recommends libvulkan1 mesa-vulkan-drivers",
    },
    PackageManager { program: "dnf", refresh: None, install: "dnf install -y vulkan-loader mesa-vulkan-drivers" },
    PackageManager {
        program: "pacman",
        refresh: None,
        install: "pacman -Sy --noconfirm --needed vulkan-icd-loader vulkan-swrast",
    },
    PackageManager {
        program: "zypper",
        refresh: None,
        install: "zypper --non-interactive install libvulkan1 libvulkan_lvp",
    },
    PackageManager { program: "apk", refresh: None, install: "apk add --no-cache vulkan-loader mesa-vulkan-swrast" },
];

impl PackageManager {
    /// The first known manager among the folders of `path`, a `PATH` variable.
    pub fn find(path: &std::ffi::OsStr) -> Option<&'static Self> {
        Self::choose(|program| find_program(path, program))
    }

    fn choose(has: impl Fn(&str) -> bool) -> Option<&'static Self> {
        MANAGERS.iter().find(|manager| has(manager.program))
    }

    /// The commands to run, in order, each started through `elevate` (`sudo`, say) where there is one.
    pub fn commands(&self, elevate: Option<&str>) -> Vec<String> {
        let prefix = elevate.map(|program| format!("{program} ")).unwrap_or_default();
        self.refresh.into_iter().chain([self.install]).map(|command| format!("{prefix}{command}")).collect()
    }
}

/// Whether one of the folders of `path` holds `program`.
pub fn find_program(path: &std::ffi::OsStr, program: &str) -> bool {
    std::env::split_paths(path).any(|folder| is_program(&folder.join(program)))
}

fn is_program(file: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        file.metadata().is_ok_and(|data| data.is_file() && data.permissions().mode() & 0o111 != 0)
    }
    #[cfg(not(unix))]
    {
        file.is_file()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_system_gets_its_own_manager() {
        for program in ["apt-get", "dnf", "pacman", "zypper", "apk"] {
            let chosen = PackageManager::choose(|candidate| candidate == program);
            assert_eq!(chosen.map(|manager| manager.program), Some(program));
            let commands = chosen.map(|manager| manager.commands(None)).unwrap_or_default();
            assert!(commands.iter().all(|command| command.starts_with(program)), "{commands:?}");
        }
        assert_eq!(PackageManager::choose(|_| false), None);
    }

    #[test]
    fn every_command_is_elevated() {
        let apt = PackageManager::choose(|program| program == "apt-get");
        let commands = apt.map(|manager| manager.commands(Some("sudo -n"))).unwrap_or_default();
        assert_eq!(commands.len(), 2);
        assert!(commands.iter().all(|command| command.starts_with("sudo -n apt-get ")), "{commands:?}");
        assert!(commands[1].contains("mesa-vulkan-drivers"));
    }

    #[test]
    fn programs_are_sought_on_the_path() {
        assert!(!find_program(std::ffi::OsStr::new(""), "no-such-program"));
        assert!(!find_program(&std::env::temp_dir().into_os_string(), "no-such-program"));
    }
}
