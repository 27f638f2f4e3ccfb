//! Replaces a file as a whole: written beside it under a temporary name, flushed to the disk, then renamed over it.
//!
//! Whatever fails, the file that stood there before stays as it was and the temporary one is removed.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::error::{EncodeError, ImageError};

/// Where the bytes of `path` are to go: the target of a symbolic link, so that the link itself survives.
fn resolve(path: &Path) -> Result<PathBuf, ImageError> {
    let io = |action, source| ImageError::Io {
        path: path.to_owned(),
        action,
        source,
    };
    let target = match fs::symlink_metadata(path) {
        Ok(meta) if meta.is_symlink() => {
            fs::canonicalize(path).map_err(|e| io("follow the link", e))?
        }
        _ => path.to_owned(),
    };
    match fs::metadata(&target) {
        // Renaming over a device or a folder would destroy it, or fail late.
        Ok(meta) if !meta.is_file() => Err(ImageError::invalid(
            path,
            "exists and is not a regular file",
        )),
        Ok(meta) if meta.permissions().readonly() => {
            Err(ImageError::invalid(path, "exists and is read-only"))
        }
        _ => Ok(target),
    }
}

/// Replaces the file with one of these bytes.
pub(crate) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    replace_file(path, |file| Ok(file.write_all(bytes)?))
}

/// Lets `encode` write the new contents of `path`, then puts them in place.
pub(super) fn replace_file(
    path: &Path,
    encode: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), EncodeError>,
) -> Result<(), ImageError> {
    let io = |action, source| ImageError::Io {
        path: path.to_owned(),
        action,
        source,
    };
    let target = resolve(path)?;
    let name = target
        .file_name()
        .ok_or_else(|| ImageError::invalid(path, "is not a file name"))?;
    let folder = match target.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };

    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(name);
    // Long names would not leave room for the random part.
    if prefix.len() > 200 {
        prefix = ".hdtrapeze".into();
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any other new file, less the umask; the default would be private to the user.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    // Removed when dropped, unless it was persisted.
    let mut temporary = builder
        .tempfile_in(folder)
        .map_err(|e| io("create a file in the folder", e))?;

    let mut writer = BufWriter::new(temporary.as_file_mut());
    let written = encode(&mut writer).and_then(|()| Ok(writer.flush()?));
    // Without its buffer: after a failure, dropping it must not write again.
    let (_, _) = writer.into_parts();
    written.map_err(|error| match error {
        EncodeError::Io(source) => io("write the file", source),
        EncodeError::Invalid(reason) => ImageError::invalid(path, reason),
    })?;
    if let Ok(meta) = fs::metadata(&target) {
        temporary
            .as_file()
            .set_permissions(meta.permissions())
            .map_err(|e| io("keep the permissions of the file", e))?;
    }
    temporary
        .as_file()
        .sync_all()
        .map_err(|e| io("flush the file to the disk", e))?;
    temporary
        .persist(&target)
        .map_err(|e| io("rename the finished file", e.error))?;
    Ok(())
}
