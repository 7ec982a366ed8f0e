//! Files that are there as a whole or not at all.

use std::io::Write;
use std::path::Path;

use crate::BakeError;

/// Replaces the file at `path` once all bytes are on the disk; until then what was there stays.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), BakeError> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let wrong = |error| BakeError::io(path, error, "give a path in a folder that exists and can be written to");
    let mut builder = tempfile::Builder::new();
    builder.prefix(".bounce-bake-").suffix(".part");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(wrong)?;
    file.write_all(bytes).and_then(|()| file.as_file().sync_all()).map_err(wrong)?;
    file.persist(path).map_err(|error| wrong(error.error))?;
    Ok(())
}
