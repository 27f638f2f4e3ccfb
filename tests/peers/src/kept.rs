//! A file that holds what was found out so far.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// A file, or none where none is asked for. What was there stays until there is something to write, and whoever reads
/// it meanwhile finds the old or the new text whole.
#[derive(Debug)]
pub struct Kept(Option<[PathBuf; 2]>);

impl Kept {
    /// Finds out whether `file` can be written, before hours have gone into what is to be written.
    pub fn beside(file: Option<&Path>) -> Result<Self, String> {
        let Some(file) = file else {
            return Ok(Self(None));
        };
        if file.is_dir() {
            return Err(format!("{}: is a folder", file.display()));
        }
        let mut name = OsString::from(file);
        name.push(".part");
        let part = PathBuf::from(name);
        fs::File::create(&part).map_err(|e| told(file, &e))?;
        Ok(Self(Some([part, file.into()])))
    }

    /// Writes what `text` gives.
    pub fn write(&self, text: impl FnOnce() -> String) -> Result<(), String> {
        let Some([part, file]) = &self.0 else {
            return Ok(());
        };
        let written = fs::write(part, text()).and_then(|()| fs::rename(part, file));
        written.map_err(|e| told(file, &e))
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        if let Some([part, _]) = &self.0 {
            // Nothing was written since.
            let _ = fs::remove_file(part);
        }
    }
}

fn told(file: &Path, e: &std::io::Error) -> String {
    format!("{}: {e}", file.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_old_or_new_and_what_cannot_be_written_is_found_first() {
        let folder = std::env::temp_dir().join(format!("peers-kept-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let file = folder.join("tables.md");
        fs::write(&file, "old").unwrap();
        let kept = Kept::beside(Some(&file)).unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "old");
        for text in ["new", "newer"] {
            kept.write(|| text.into()).unwrap();
            assert_eq!(fs::read_to_string(&file).unwrap(), text);
        }
        drop(Kept::beside(Some(&file)).unwrap());
        assert_eq!(fs::read_to_string(&file).unwrap(), "newer");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        let message = Kept::beside(Some(&folder.join("none/tables.md"))).unwrap_err();
        assert!(message.contains("tables.md"), "{message}");
        assert!(Kept::beside(Some(&folder)).is_err());
        fs::remove_dir_all(&folder).unwrap();
    }
}
