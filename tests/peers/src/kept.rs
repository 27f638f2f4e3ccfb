//! A file that holds what was found out so far.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// A file, or none where none is asked for. What was there stays until there is something to write, and whoever reads
/// it meanwhile finds the old or the new text whole; a link leads to the file that is written. What is no file, as a pipe or a device, is
/// written to as it is.
#[derive(Debug)]
pub struct Kept(Option<Place>);

#[derive(Debug)]
enum Place {
    /// Where it is written first, and where it goes then.
    File([PathBuf; 2]),
    /// A pipe or a device.
    Other(PathBuf),
}

impl Kept {
    /// Finds out whether `file` can be written, before hours have gone into what is to be written.
    pub fn beside(file: Option<&Path>) -> Result<Self, String> {
        let Some(file) = file else {
            return Ok(Self(None));
        };
        match fs::metadata(file) {
            Ok(there) if there.is_dir() => return Err(format!("{}: is a folder", file.display())),
            Ok(there) if !there.is_file() => return Ok(Self(Some(Place::Other(file.into())))),
            _ => {}
        }
        let file = resolved(file);
        let part = part(&file);
        let created = fs::File::create(&part).and_then(|_| fs::remove_file(&part));
        created.map_err(|e| told(&file, &e))?;
        Ok(Self(Some(Place::File([part, file]))))
    }

    /// Writes what `text` gives.
    pub fn write(&self, text: impl FnOnce() -> String) -> Result<(), String> {
        let (written, file) = match &self.0 {
            None => return Ok(()),
            Some(Place::Other(file)) => (fs::write(file, text()), file),
            Some(Place::File([part, file])) => {
                let written = fs::write(part, text()).and_then(|()| fs::rename(part, file));
                if written.is_err() {
                    // What was written before is kept, a part of what is new is of no use.
                    let _ = fs::remove_file(part);
                }
                (written, file)
            }
        };
        written.map_err(|e| told(file, &e))
    }
}

/// Where a file's text is written before it is whole.
fn part(file: &Path) -> PathBuf {
    let mut name = OsString::from(file);
    name.push(".part");
    name.into()
}

/// Whether two files are one, however they are spelled, or one is where the other is written first.
pub fn clash(a: &Path, b: &Path) -> bool {
    let (a, b) = (resolved(a), resolved(b));
    a == b || a == part(&b) || part(&a) == b
}

/// The same for each spelling of a file's name, also where there is no file yet; of a link to it, where that leads.
fn resolved(file: &Path) -> PathBuf {
    if let Ok(path) = file.canonicalize() {
        return path;
    }
    // One step: what leads on to nowhere from there is no file.
    let target = fs::read_link(file).map(|to| folder(file).join(to));
    let file = target.as_deref().unwrap_or(file);
    match (folder(file).canonicalize(), file.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => file.into(),
    }
}

/// Where a file is.
fn folder(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

fn told(file: &Path, e: &std::io::Error) -> String {
    format!("{}: cannot be written: {e}", file.display())
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

    #[cfg(unix)]
    #[test]
    fn links_and_devices_stay_what_they_are() {
        let folder = std::env::temp_dir().join(format!("peers-links-{}", std::process::id()));
        fs::create_dir_all(folder.join("in")).unwrap();
        let (link, file) = (folder.join("link.md"), folder.join("in/tables.md"));
        std::os::unix::fs::symlink("in/tables.md", &link).unwrap();
        // First where there is no file yet.
        for text in ["new", "newer"] {
            let kept = Kept::beside(Some(&link)).unwrap();
            assert!(clash(&link, &file));
            kept.write(|| text.into()).unwrap();
            assert!(link.is_symlink());
            assert_eq!(fs::read_to_string(&file).unwrap(), text);
        }
        // What cannot be written is found first through a link, too.
        let astray = folder.join("astray.md");
        std::os::unix::fs::symlink("none/tables.md", &astray).unwrap();
        assert!(Kept::beside(Some(&astray)).is_err());
        fs::remove_file(&astray).unwrap();
        let device = Path::new("/dev/null");
        let kept = Kept::beside(Some(device)).unwrap();
        assert!(matches!(kept, Kept(Some(Place::Other(_)))));
        kept.write(|| "nowhere".into()).unwrap();
        assert!(!fs::metadata(device).unwrap().is_file());
        assert_eq!(fs::read_dir(folder.join("in")).unwrap().count(), 1);
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 2);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_file_is_the_same_however_it_is_spelled() {
        let folder = std::env::temp_dir().join(format!("peers-clash-{}", std::process::id()));
        fs::create_dir_all(folder.join("in")).unwrap();
        let at = |name: &str| folder.join(name);
        // First where there is no file yet.
        for _ in 0..2 {
            for same in ["f", "./f", "in/../f", "f.part"] {
                assert!(clash(&at("f"), &at(same)), "{same}");
                assert!(clash(&at(same), &at("f")), "{same}");
            }
            for other in ["g", "in/f", "none/f", "f.md"] {
                assert!(!clash(&at("f"), &at(other)), "{other}");
            }
            fs::write(at("f"), "").unwrap();
        }
        assert!(clash(Path::new("f"), Path::new("./f")));
        fs::remove_dir_all(&folder).unwrap();
    }
}
