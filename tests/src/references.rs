//! Scenes and path-traced references. They are large and live outside the repository.

use std::path::{Path, PathBuf};

use crate::picture::Picture;

/// The folder with `scenes` and `references`: `BOUNCE_SHARED`, or `shared` beside or within the checkout.
pub fn shared_folder() -> Option<PathBuf> {
    let checkout = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let named = std::env::var_os("BOUNCE_SHARED").map(PathBuf::from);
    let candidates = named.map_or_else(|| vec![checkout.join("../shared"), checkout.join("shared")], |path| vec![path]);
    candidates.into_iter().find(|path| path.join("references").is_dir())
}

/// That file of the shared folder. Where it is absent the test that asks for it is skipped, and says so; with
/// `BOUNCE_STRICT=1` it fails.
pub fn shared_file(path: &str) -> Option<PathBuf> {
    let found = shared_folder().map(|folder| folder.join(path)).filter(|path| path.exists());
    if found.is_none() {
        let strict = std::env::var_os("BOUNCE_STRICT").is_some_and(|value| value == "1");
        assert!(!strict, "{path} is absent: set BOUNCE_SHARED to the folder with scenes and references");
        let name = std::thread::current().name().unwrap_or("test").to_owned();
        eprintln!("SKIPPED {name}: {path} is absent (set BOUNCE_SHARED)");
    }
    found
}

/// A scene of the shared folder, and what is path-traced of its bounced light.
pub fn shared_reference(name: &str) -> Option<(PathBuf, Picture)> {
    let scene = shared_file(&format!("scenes/{name}.glb"))?;
    let reference = shared_file(&format!("references/{name}.indirect.exr"))?;
    Some((scene, Picture::load(&reference).unwrap_or_else(|error| panic!("{error}"))))
}

/// Writes a picture into the folder that `BOUNCE_PICTURES` names, for looking at.
pub fn save_if_asked(picture: &Picture, name: &str) {
    if let Some(folder) = std::env::var_os("BOUNCE_PICTURES") {
        picture.save(&Path::new(&folder).join(name)).unwrap_or_else(|error| panic!("{error}"));
    }
}

/// A small file committed with the tests.
pub fn committed_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}
