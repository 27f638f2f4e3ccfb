//! Sessions whose device is lost, and whose renders are given up.

use std::ops::RangeInclusive;
use std::sync::atomic::AtomicU32;

use glam::Vec3;
use hdtrapeze_core::film::tile::PixelSums;
use hdtrapeze_core::render::{Made, Stage, TileSamples};
use hdtrapeze_core::surface::{Channel, LimitSurface, MeshTopology, SurfaceError};
use hdtrapeze_core::trace::{Hit, Ray};

use super::*;

pub(crate) struct NoSubdivision;

impl SubdivisionFactory for NoSubdivision {
    fn create(
        &self,
        _: &MeshTopology,
        _: &[Vec<Vec3>],
        _: Vec<Channel>,
    ) -> Result<Box<dyn LimitSurface>, SurfaceError> {
        Err(SurfaceError::Library("not needed here".to_owned()))
    }
}

/// A device that is lost at once.
struct Lost;

impl RayTracer for Lost {
    fn stages(&self) -> RangeInclusive<Stage> {
        Stage::Generate..=Stage::Trace
    }
    fn trace_tiles(&self, _: &[TileSamples], _: &mut [Hit]) -> Result<(), String> {
        Err("it is lost".to_owned())
    }
    fn film(
        &self,
        _: &[TileSamples],
        _: &Made,
        _: &mut [PixelSums],
        _: &mut [f32],
    ) -> Result<(), String> {
        Err("it is lost".to_owned())
    }
    fn trace(&self, _: &[Ray], _: &mut [Hit]) -> Result<(), String> {
        Err("it is lost".to_owned())
    }
}

#[test]
fn a_device_that_is_lost_is_told_and_all_samples_are_taken() {
    let session = Session::new(Box::new(NoSubdivision));
    let told = Arc::new(Mutex::new(Vec::new()));
    let log = Arc::clone(&told);
    let log: LogFn = Box::new(move |_, prim, code, text| {
        lock(&log).push([prim, code, text].map(str::to_owned));
    });
    session.set_log(Some(log), Level::WARN).unwrap();
    let camera = session.create(Kind::Camera, "/camera").unwrap();
    session.set_active_camera(Some(camera)).unwrap();
    session.commit().unwrap();
    lock(&told).clear();
    let Committed { prepared, pool, .. } = session.committed().unwrap();
    let frame = new_frame(&prepared).unwrap();
    let cancel = AtomicBool::new(false);
    with_default(&session.shared.dispatch, || {
        let shared = &session.shared;
        render_all(shared, &pool, &prepared, Some(&Lost), &frame, &cancel);
    });
    assert_eq!(frame.samples_done(), prepared.settings().samples);
    let text = "it is lost; the CPU went on from the samples that there were";
    assert_eq!(*lock(&told), [["", "backend", text].map(str::to_owned)]);
}

#[test]
fn what_is_given_up_begins_nothing() {
    let session = Session::new(Box::new(NoSubdivision));
    let camera = session.create(Kind::Camera, "/camera").unwrap();
    session.seal();
    let start = |is_given_up: &dyn Fn() -> bool| {
        let settings = RenderSettings::default();
        session.start_sealed(Some(camera), &settings, is_given_up)
    };
    // Before it begins: its edits are the next render's.
    assert!(matches!(start(&|| true), Err(Error::Cancelled)));
    assert_eq!(lock(&session.edits).all().len(), 1);
    // As it begins, where an interrupt came too early to cancel it.
    let asked = AtomicU32::new(0);
    let given_up = start(&|| asked.fetch_add(1, Ordering::Relaxed) > 0);
    assert!(matches!(given_up, Err(Error::Cancelled)));
    assert!(lock(&session.edits).all().is_empty());
    assert!(start(&|| false).is_ok());
}
