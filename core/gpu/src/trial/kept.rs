//! Verdicts of trials, kept on disk beside what drivers compiled: a file each, of text, which says what it is the verdict on. One
//! that is broken, or on another device, driver, version or CPU, is as none.

use std::hash::{DefaultHasher, Hasher};
use std::path::{Path, PathBuf};
use std::thread::available_parallelism;

use super::Verdict;
use crate::Found;
use crate::kept::{read, write};

/// What files begin with.
const MARK: [u8; 8] = *b"TRZTRIAL";

/// What a verdict holds for: another driver, version or number of cores is another trial.
fn key(found: &Found) -> String {
    let cores = available_parallelism().map_or(1, usize::from);
    let Found {
        name, api, driver, ..
    } = found;
    let version = env!("CARGO_PKG_VERSION");
    let words = format!("{name}, {api}, {driver}, hdTrapeze {version}, {cores} cores");
    words.replace('\n', " ")
}

fn path(folder: &Path, key: &str) -> PathBuf {
    let mut hasher = DefaultHasher::new();
    hasher.write(key.as_bytes());
    folder.join(format!("trial-{:016x}", hasher.finish()))
}

/// The verdict on a device, where one is kept in this folder.
pub fn known(folder: &Path, found: &Found) -> Option<Verdict> {
    let key = key(found);
    let text = String::from_utf8(read(&path(folder, &key), MARK)?).ok()?;
    let mut lines = text.lines();
    if lines.next()? != key {
        return None;
    }
    let (gpu, failed) = match lines.next()? {
        "gpu" => (true, false),
        "cpu" => (false, false),
        "failed" => (false, true),
        _ => return None,
    };
    let why = lines.next()?.to_owned();
    Some(Verdict { gpu, failed, why })
}

/// Keeps a verdict. Nothing is lost but time where that fails.
pub(super) fn keep(folder: &Path, found: &Found, verdict: &Verdict) {
    let key = key(found);
    let what = match verdict {
        Verdict { gpu: true, .. } => "gpu",
        Verdict { failed: true, .. } => "failed",
        _ => "cpu",
    };
    let why = verdict.why.replace('\n', " ");
    let text = format!("{key}\n{what}\n{why}\n");
    let _ = write(&path(folder, &key), MARK, text.as_bytes());
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::device::Kind;

    fn found() -> Found {
        Found {
            name: "X".to_owned(),
            api: "vulkan".to_owned(),
            driver: "maker 1.0".to_owned(),
            kind: Kind::Discrete,
            largest_buffer: 1,
            largest_binding: 1,
            workgroups: 1,
            timestamps: true,
            subgroups: true,
            chosen: true,
        }
    }

    fn verdicts() -> [Verdict; 3] {
        [(true, false), (false, false), (false, true)].map(|(gpu, failed)| Verdict {
            gpu,
            failed,
            why: format!("{gpu} {failed}"),
        })
    }

    #[test]
    fn verdicts_are_found_again() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("caches/own");
        assert_eq!(known(&folder, &found()), None);
        for verdict in verdicts() {
            keep(&folder, &found(), &verdict);
            assert_eq!(known(&folder, &found()), Some(verdict));
        }
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
    }

    #[test]
    fn another_device_or_driver_is_another_trial() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let [verdict, ..] = verdicts();
        keep(folder, &found(), &verdict);
        let others: [fn(&mut Found); 3] = [
            |found| found.name.push('2'),
            |found| found.api = "dx12".to_owned(),
            |found| found.driver = "maker 1.1".to_owned(),
        ];
        for change in others {
            let mut other = found();
            change(&mut other);
            assert_eq!(known(folder, &other), None);
        }
        // Nor does a file count that says of another device what it is.
        let mut other = found();
        other.name.push('2');
        fs::rename(path(folder, &key(&found())), path(folder, &key(&other))).unwrap();
        assert_eq!(known(folder, &other), None);
    }

    #[test]
    fn a_broken_file_is_as_none() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let [verdict, ..] = verdicts();
        let file = path(folder, &key(&found()));
        keep(folder, &found(), &verdict);
        let sound = fs::read(&file).unwrap();
        let mut flipped = sound.clone();
        flipped[sound.len() / 2] ^= 0x10;
        let half = sound[..sound.len() / 2].to_vec();
        for broken in [flipped, half, Vec::new(), b"something else".to_vec()] {
            fs::write(&file, broken).unwrap();
            assert_eq!(known(folder, &found()), None);
            keep(folder, &found(), &verdict);
            assert_eq!(known(folder, &found()), Some(verdict.clone()));
        }
        // Nowhere to write to: it is tried again, no more.
        keep(&file.join("folder"), &found(), &verdict);
    }
}
