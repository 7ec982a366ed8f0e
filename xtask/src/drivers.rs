//! Which Vulkan drivers the loader would find, read from the same places as the loader itself.
//!
//! See "Driver discovery on Linux" in the Vulkan-Loader's `LoaderDriverInterface.md`. A manifest alone proves nothing:
//! Mesa installs all its drivers together, so a driver counts where its library is there and a device node for it too.

use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A driver that the Vulkan loader can load.
#[derive(Debug, PartialEq, Eq)]
pub struct Driver {
    /// The manifest that names it.
    pub manifest: PathBuf,
    /// Runs on the CPU.
    pub software: bool,
}

/// What of the system the search looks at; apart from it so that tests can bring their own.
pub struct System {
    /// An environment variable.
    pub variable: fn(&str) -> Option<OsString>,
    /// Shared libraries that `ldconfig` knows, one a line.
    pub libraries: String,
    /// Device nodes of graphics processors.
    pub devices: Vec<String>,
}

impl System {
    /// This machine.
    pub fn here() -> Self {
        Self {
            variable: |name| env::var_os(name).filter(|value| !value.is_empty()),
            libraries: libraries(),
            devices: devices(),
        }
    }

    /// The loader itself, `libvulkan.so.1`.
    pub fn has_loader(&self) -> bool {
        self.has_library("libvulkan.so.1")
    }

    /// Drivers with a library and a device.
    pub fn drivers(&self) -> Vec<Driver> {
        self.manifests().into_iter().filter_map(|manifest| self.driver(manifest)).collect()
    }

    fn manifests(&self) -> Vec<PathBuf> {
        let paths = |name: &str| {
            let value = (self.variable)(name).unwrap_or_default();
            env::split_paths(&value).filter(|path| !path.as_os_str().is_empty()).collect::<Vec<_>>()
        };
        let chosen = [paths("VK_DRIVER_FILES"), paths("VK_ICD_FILENAMES")].into_iter().find(|paths| !paths.is_empty());
        let places = chosen.unwrap_or_else(|| {
            let mut places = paths("VK_ADD_DRIVER_FILES");
            places.extend(self.search_folders().into_iter().map(|folder| folder.join("vulkan/icd.d")));
            places
        });
        let mut manifests = Vec::new();
        for place in places {
            if place.is_file() {
                manifests.push(place);
            } else if let Ok(entries) = fs::read_dir(&place) {
                let mut found: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
                found.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
                found.sort();
                manifests.extend(found);
            }
        }
        manifests
    }

    fn search_folders(&self) -> Vec<PathBuf> {
        let home = (self.variable)("HOME").map(PathBuf::from);
        let one = |name: &str, fallback: &str| {
            (self.variable)(name).map(PathBuf::from).or_else(|| home.as_ref().map(|home| home.join(fallback)))
        };
        let list = |name: &str, fallback: &str| {
            let value = (self.variable)(name).unwrap_or_else(|| fallback.into());
            env::split_paths(&value).collect::<Vec<_>>()
        };
        let mut folders: Vec<PathBuf> = one("XDG_CONFIG_HOME", ".config").into_iter().collect();
        folders.extend(list("XDG_CONFIG_DIRS", "/etc/xdg"));
        folders.extend(["/usr/local/etc", "/etc"].map(PathBuf::from));
        folders.extend(one("XDG_DATA_HOME", ".local/share"));
        folders.extend(list("XDG_DATA_DIRS", "/usr/local/share:/usr/share"));
        folders
    }

    fn driver(&self, manifest: PathBuf) -> Option<Driver> {
        let library = library_path(&fs::read_to_string(&manifest).ok()?)?;
        let there = if library.contains('/') {
            manifest.parent().is_some_and(|folder| folder.join(&library).is_file())
        } else {
            self.has_library(&library)
        };
        let kind = Kind::of(&library);
        (there && kind.has_device(&self.devices))
            .then_some(Driver { manifest, software: matches!(kind, Kind::Software) })
    }

    fn has_library(&self, name: &str) -> bool {
        self.libraries.lines().any(|line| {
            line.split_whitespace().next() == Some(name) || Path::new(line).file_name().is_some_and(|file| file == name)
        })
    }
}

/// Of a driver's library: whose it is, and so which device node it needs.
#[derive(Debug, PartialEq, Eq)]
enum Kind {
    Software,
    Nvidia,
    Direct3D,
    Other,
}

impl Kind {
    fn of(library: &str) -> Self {
        let library = library.to_lowercase();
        let has = |part: &str| library.contains(part);
        if has("_lvp") || has("swiftshader") {
            Self::Software
        } else if has("_nvidia") {
            Self::Nvidia
        } else if has("_dzn") {
            Self::Direct3D
        } else {
            Self::Other
        }
    }

    fn has_device(&self, devices: &[String]) -> bool {
        let any = |start: &str| devices.iter().any(|device| device.starts_with(start));
        match self {
            Self::Software => true,
            Self::Nvidia => any("nvidia"),
            Self::Direct3D => any("dxg"),
            Self::Other => any("renderD") || any("kgsl"),
        }
    }
}

/// The library that a manifest names, `None` where it is broken or for the other word size.
fn library_path(manifest: &str) -> Option<String> {
    let json: serde_json::Value = serde_json::from_str(manifest).ok()?;
    let icd = json.get("ICD")?;
    let bits = if cfg!(target_pointer_width = "64") { "64" } else { "32" };
    if icd.get("library_arch").and_then(|arch| arch.as_str()).is_some_and(|arch| arch != bits) {
        return None;
    }
    Some(icd.get("library_path")?.as_str()?.to_owned())
}

/// `ldconfig`'s list; where there is none (musl), the files of the usual folders.
fn libraries() -> String {
    for program in ["ldconfig", "/sbin/ldconfig", "/usr/sbin/ldconfig"] {
        if let Ok(output) = Command::new(program).arg("-p").output()
            && output.status.success()
            && !output.stdout.is_empty()
        {
            return format!("{}\n{}", String::from_utf8_lossy(&output.stdout), listing(library_variable()));
        }
    }
    let usual = ["/usr/local/lib", "/usr/lib64", "/usr/lib", "/lib64", "/lib"].map(PathBuf::from);
    listing(library_variable().into_iter().chain(usual))
}

fn library_variable() -> Vec<PathBuf> {
    env::var_os("LD_LIBRARY_PATH").map(|value| env::split_paths(&value).collect()).unwrap_or_default()
}

fn listing(folders: impl IntoIterator<Item = PathBuf>) -> String {
    let files = folders.into_iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    files.map(|entry| entry.path().display().to_string()).collect::<Vec<_>>().join("\n")
}

fn devices() -> Vec<String> {
    let names = |folder: &str| {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect::<Vec<_>>()
    };
    let mut devices = names("/dev");
    devices.extend(names("/dev/dri"));
    devices
}

#[cfg(test)]
mod tests {
    use super::*;

    fn none(_: &str) -> Option<OsString> {
        None
    }

    fn system(libraries: &str, devices: &[&str]) -> System {
        let devices = devices.iter().map(|device| device.to_string()).collect();
        System { variable: none, libraries: libraries.to_owned(), devices }
    }

    /// A folder with one manifest in it, removed at the end.
    struct Folder(PathBuf);

    impl Folder {
        fn with(name: &str, manifest: &str) -> std::io::Result<Self> {
            let folder = env::temp_dir().join(format!("xtask-drivers-{name}-{}", std::process::id()));
            fs::create_dir_all(&folder)?;
            fs::write(folder.join("icd.json"), manifest)?;
            Ok(Self(folder))
        }
        fn manifest(&self) -> PathBuf {
            self.0.join("icd.json")
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    const LDCONFIG: &str = "2 libs found in cache `/etc/ld.so.cache'\n\tlibvulkan.so.1 (libc6,x86-64) => /lib/libvulkan.so.1\n\tlibvulkan_lvp.so (libc6,x86-64) => /lib/libvulkan_lvp.so\n";

    #[test]
    fn the_loader_is_read_from_ldconfig_or_a_listing() {
        assert!(system(LDCONFIG, &[]).has_loader());
        assert!(system("/usr/lib/libvulkan.so.1", &[]).has_loader());
        assert!(!system("\tlibvulkan.so.1.3.239 (libc6)", &[]).has_loader());
        assert!(!system("", &[]).has_loader());
    }

    #[test]
    fn manifests_name_a_library_of_this_word_size() {
        let manifest =
            r#"{"ICD": {"api_version": "1.3", "library_path": "libvulkan_lvp.so"}, "file_format_version": "1.0.0"}"#;
        assert_eq!(library_path(manifest).as_deref(), Some("libvulkan_lvp.so"));
        assert_eq!(library_path(r#"{"ICD": {"library_arch": "16", "library_path": "x.so"}}"#), None);
        assert_eq!(library_path(r#"{"ICD": {}}"#), None);
        assert_eq!(library_path("not JSON"), None);
    }

    #[test]
    fn a_hardware_driver_needs_its_device() {
        let kinds = [
            ("libvulkan_lvp.so", Kind::Software, None),
            ("./libvk_swiftshader.so", Kind::Software, None),
            ("libGLX_nvidia.so.0", Kind::Nvidia, Some("nvidiactl")),
            ("libvulkan_dzn.so", Kind::Direct3D, Some("dxg")),
            ("libvulkan_radeon.so", Kind::Other, Some("renderD128")),
        ];
        for (library, kind, device) in kinds {
            assert_eq!(Kind::of(library), kind, "{library}");
            assert_eq!(kind.has_device(&[]), device.is_none(), "{library}");
            if let Some(device) = device {
                assert!(kind.has_device(&[device.to_owned()]), "{library}");
            }
        }
    }

    #[test]
    fn a_driver_needs_its_library() -> std::io::Result<()> {
        let folder = Folder::with("lvp", r#"{"ICD": {"library_path": "libvulkan_lvp.so"}}"#)?;
        let found = system(LDCONFIG, &[]).driver(folder.manifest());
        assert_eq!(found, Some(Driver { manifest: folder.manifest(), software: true }));
        assert_eq!(system("", &[]).driver(folder.manifest()), None);
        Ok(())
    }

    #[test]
    fn a_relative_library_stands_beside_its_manifest() -> std::io::Result<()> {
        let folder = Folder::with("relative", r#"{"ICD": {"library_path": "./libvk_swiftshader.so"}}"#)?;
        assert_eq!(system("", &[]).driver(folder.manifest()), None);
        fs::write(folder.0.join("libvk_swiftshader.so"), "")?;
        assert!(system("", &[]).driver(folder.manifest()).is_some_and(|driver| driver.software));
        Ok(())
    }

    #[test]
    fn data_folders_of_the_system_are_searched() {
        let folders = system("", &[]).search_folders();
        for folder in ["/etc", "/usr/share", "/usr/local/share"] {
            assert!(folders.contains(&PathBuf::from(folder)), "{folder}");
        }
    }
}
