//! The trial by which a device is held against the CPU: it runs, and sees what is wrong.

#[path = "../../tests/support/mod.rs"]
mod support;

mod device;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use device::Check;
use glam::{DMat4, DVec3};
use hdtrapeze_core::render::{Prepared, prepare};
use hdtrapeze_core::scene::{Backend, PrimId, Scene};
use hdtrapeze_gpu::trial::{Size, known, other_hits, run, scene, tried, verdict};
use hdtrapeze_gpu::{Device, GpuFrame, Stages};
use libtest_mimic::Failed;
use support::NoSubdivision;

/// Small enough for a device of software.
const SMALL: Size = Size {
    resolution: [96, 54],
    samples: 4,
    shading_rate: 1.0,
};

/// Most rays meet what they meet on the CPU, and pixels have its colours, where the device was waited for.
fn agrees(device: &Arc<Device>) -> Result<(), Failed> {
    let stages = Arc::new(Stages::new(device));
    let measured = run(&stages, &SMALL)?;
    let verdict = verdict(&device.found().name, &Ok(measured));
    let sound = measured.cpu > 0.0 && measured.gpu > 0.0 && !verdict.failed;
    match sound && verdict.gpu == (measured.gpu < measured.cpu) {
        true => Ok(()),
        false => Err(format!("{measured:?}: {verdict:?}").into()),
    }
}

fn prepared_of(mut scene: Scene) -> Result<Prepared, Failed> {
    Arc::make_mut(&mut scene.settings).backend = Backend::AutoGpu;
    let made = prepare(&scene, &NoSubdivision, None, &AtomicBool::new(false));
    Ok(made.map_err(|error| error.to_string())?.prepared)
}

/// A ball that is off by a little on the device is seen by rays.
fn what_is_wrong_is_seen(device: &Arc<Device>) -> Result<(), Failed> {
    let stages = Arc::new(Stages::new(device));
    let here = prepared_of(scene(&SMALL))?;
    let there = GpuFrame::new(Arc::clone(&stages), &here)?;
    let same = other_hits(&here, &there)?;
    if same > 0.002 {
        return Err(format!("{same} of the rays differ").into());
    }
    let mut off = scene(&SMALL);
    let ball = off.prims.get_mut(&PrimId(6)).ok_or("it has no ball")?;
    for samples in &mut Arc::make_mut(ball).common.transform {
        let by = DMat4::from_translation(DVec3::Z * 1e-3);
        samples.matrices.iter_mut().for_each(|m| *m = by * *m);
    }
    let there = GpuFrame::new(stages, &prepared_of(off)?)?;
    match other_hits(&here, &there)? {
        other if other > 0.002 => Ok(()),
        other => Err(format!("only {other} of the rays differ").into()),
    }
}

/// A trial leaves its verdict, also where the device is slow.
fn the_verdict_is_kept(device: &Arc<Device>) -> Result<(), Failed> {
    let folder = tempfile::tempdir()?;
    if known(folder.path(), device.found()).is_some() {
        return Err("known in an empty folder".into());
    }
    let stages = Arc::new(Stages::new(device));
    let verdict = tried(&stages, Some(folder.path()));
    match known(folder.path(), device.found()) {
        Some(known) if known == verdict && !verdict.failed => Ok(()),
        known => Err(format!("{verdict:?}, {known:?}").into()),
    }
}

fn main() {
    let trials: Vec<(String, Check)> = vec![
        ("agrees".to_owned(), Box::new(agrees)),
        ("wrong".to_owned(), Box::new(what_is_wrong_is_seen)),
        ("kept".to_owned(), Box::new(the_verdict_is_kept)),
    ];
    device::run(trials);
}
