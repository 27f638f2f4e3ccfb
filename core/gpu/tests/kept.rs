//! Compiled pipelines that are kept on disk: the next run finds them, and no file does harm.

#[path = "../../tests/support/mod.rs"]
mod support;

mod device;
mod images;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use device::Check;
use hdtrapeze_core::aov::Aov;
use hdtrapeze_core::scene::Backend;
use hdtrapeze_gpu::{Device, GpuFrame, Stages};
use images::*;
use libtest_mimic::Failed;

/// Renders with what is in the folder; tells whether pipelines were found there.
fn found_in(folder: &Path) -> Result<bool, Failed> {
    let device = Arc::new(Device::open_with(Some(folder))?);
    let prepared = prepared_on(&stage(), Backend::Gpu);
    let frame = GpuFrame::new(Arc::new(Stages::new(&device)), &prepared)?;
    let there = rendered(&prepared, Some(&frame))?;
    let here = rendered(&prepared_on(&stage(), Backend::Cpu), None)?;
    let bad = different(&there, &here, &Aov::Color, CLOSE)?;
    match bad.len() {
        0..=6 => Ok(device.has_kept_pipelines()),
        bad => Err(format!("{bad} pixels differ").into()),
    }
}

fn files_in(folder: &Path) -> Result<Vec<PathBuf>, Failed> {
    let entries = fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path()));
    Ok(entries.collect::<Result<_, _>>()?)
}

/// The one file that is there.
fn file_in(folder: &Path) -> Result<PathBuf, Failed> {
    match &files_in(folder)?[..] {
        [file] => Ok(file.clone()),
        files => Err(format!("{files:?}").into()),
    }
}

/// The first run leaves a file, and the next one finds it and leaves it as it is.
fn the_next_run_finds_them(_: &Arc<Device>) -> Result<(), Failed> {
    let root = tempfile::tempdir()?;
    // It is made where it is not there.
    let folder = root.path().join("caches/own");
    if found_in(&folder)? {
        return Err("found in an empty folder".into());
    }
    let size = fs::metadata(file_in(&folder)?)?.len();
    if !found_in(&folder)? {
        return Err("not found".into());
    }
    let again = fs::metadata(file_in(&folder)?)?.len();
    // Mesa's software device has nothing to keep, but says so.
    match size > 64 && again < 2 * size {
        true => Ok(()),
        false => Err(format!("{size} bytes, then {again}").into()),
    }
}

/// What is no such file, or is one no longer, is as none, and the next run has a sound one.
fn broken_files_do_no_harm(_: &Arc<Device>) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    found_in(folder.path())?;
    let file = file_in(folder.path())?;
    let sound = fs::read(&file)?;
    let mut flipped = sound.clone();
    flipped[sound.len() / 2] ^= 0x10;
    let half = sound[..sound.len() / 2].to_vec();
    for broken in [flipped, half, Vec::new(), b"something else".to_vec()] {
        fs::write(&file, &broken)?;
        if found_in(folder.path())? {
            return Err(format!("{} bytes are taken", broken.len()).into());
        }
        if !found_in(folder.path())? {
            return Err("it is not written anew".into());
        }
    }
    Ok(())
}

/// A folder that cannot be there is as none.
fn what_cannot_be_written_is_left(_: &Arc<Device>) -> Result<(), Failed> {
    let root = tempfile::tempdir()?;
    let file = root.path().join("file");
    fs::write(&file, "no folder")?;
    match found_in(&file.join("folder"))? || files_in(root.path())?.len() != 1 {
        true => Err("something is there".into()),
        false => Ok(()),
    }
}

fn main() {
    let trials: Vec<(String, Check)> = vec![
        ("found".to_owned(), Box::new(the_next_run_finds_them)),
        ("broken".to_owned(), Box::new(broken_files_do_no_harm)),
        (
            "no_folder".to_owned(),
            Box::new(what_cannot_be_written_is_left),
        ),
    ];
    device::run(trials);
}
