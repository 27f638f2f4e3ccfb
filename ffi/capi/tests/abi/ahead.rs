//! Prims that are complete are prepared before the commit, and only a hint they are.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use hdtrapeze::*;
use hdtrapeze_core::surface::{
    Channel, LimitSurface, MeshTopology, SubdivisionFactory, SurfaceError,
};

use crate::support::*;

/// Counts the surfaces it refuses; meshes are rendered as polygons then.
#[derive(Clone, Default)]
struct Counter {
    made: Arc<AtomicUsize>,
    hold: Arc<AtomicBool>,
}

impl SubdivisionFactory for Counter {
    fn create(
        &self,
        _: &MeshTopology,
        _: &[Vec<glam::Vec3>],
        _: Vec<Channel>,
    ) -> Result<Box<dyn LimitSurface>, SurfaceError> {
        self.made.fetch_add(1, Ordering::SeqCst);
        while self.hold.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(1));
        }
        Err(SurfaceError::Library("not today".to_owned()))
    }
}

impl Counter {
    fn made(&self) -> usize {
        self.made.load(Ordering::SeqCst)
    }

    fn wait_for(&self, count: usize) {
        while self.made() < count {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

fn session(counter: &Counter) -> Session {
    let session = Session(session_with(Box::new(counter.clone())));
    let camera = session.camera("/camera");
    // SAFETY: a live session.
    ok(unsafe { trz_session_set_active_camera(session.0, camera) });
    session.set_samples(1);
    session
}

fn complete(session: &Session, prim: trz_id) {
    // SAFETY: a live session.
    ok(unsafe { trz_prim_complete(session.0, prim) });
}

#[test]
fn a_complete_prim_is_prepared_once_and_before_the_commit() {
    let counter = Counter::default();
    let session = session(&counter);
    let a = session.square("/a", 0.0);
    complete(&session, a);
    counter.wait_for(1);
    session.square("/b", 1.0);
    ok(session.commit());
    assert_eq!(counter.made(), 2);
    let statistics = session.statistics();
    assert_eq!((statistics.prims, statistics.objects_diced), (2, 2));

    // Unchanged: nothing is prepared again, before or at the commit.
    session.set_square_points(a, 0.0);
    complete(&session, a);
    ok(session.commit());
    assert_eq!(counter.made(), 2);
    session.set_square_points(a, 0.5);
    complete(&session, a);
    counter.wait_for(3);
    ok(session.commit());
    assert_eq!(counter.made(), 3);
    assert_eq!(session.statistics().objects_reused, 1);
}

#[test]
fn later_edits_and_another_camera_are_as_good_as_before() {
    let counter = Counter::default();
    let session = session(&counter);
    let a = session.square("/a", 0.0);
    complete(&session, a);
    counter.wait_for(1);
    session.set_square_points(a, 3.0);
    ok(session.commit());
    assert_eq!(counter.made(), 2, "prepared again with its last points");

    let b = session.square("/b", 1.0);
    complete(&session, b);
    counter.wait_for(3);
    let lens = trz_camera {
        focal_length: 3.0,
        ..camera_default()
    };
    let camera = session.camera("/other");
    // SAFETY: a live session and camera.
    unsafe {
        ok(trz_camera_set(session.0, camera, &lens));
        ok(trz_session_set_active_camera(session.0, camera));
    }
    ok(session.commit());
    assert_eq!(counter.made(), 5, "both are diced for the other camera");
}

#[test]
fn without_a_camera_and_for_removed_prims_it_is_nothing() {
    let counter = Counter::default();
    let session = Session(session_with(Box::new(counter.clone())));
    let a = session.square("/a", 0.0);
    complete(&session, a);
    // SAFETY: a live session.
    unsafe {
        ok(trz_prim_remove(session.0, a));
        fails(trz_prim_complete(session.0, a), TRZ_ERROR_NOT_FOUND);
    }
    assert_eq!(counter.made(), 0);
}

/// A session whose commit waits in the middle until `hold` is false; calls `during` meanwhile.
fn while_a_commit_is_held(during: impl FnOnce(&Session, &Counter)) -> Session {
    let counter = Counter::default();
    let session = session(&counter);
    counter.hold.store(true, Ordering::SeqCst);
    let a = session.square("/a", 0.0);
    complete(&session, a);
    counter.wait_for(1);
    std::thread::scope(|scope| {
        let commit = scope.spawn(|| session.commit());
        while session.progress().state != TRZ_STATE_PREPARING {
            std::thread::sleep(Duration::from_millis(1));
        }
        during(&session, &counter);
        assert_eq!(commit.join().unwrap(), TRZ_ERROR_CANCELLED);
    });
    ok(session.commit());
    session
}

#[test]
fn what_has_begun_ends_with_the_session_and_with_a_cancel() {
    let session = while_a_commit_is_held(|session, counter| {
        std::thread::scope(|scope| {
            let cancel = scope.spawn(|| session.cancel());
            std::thread::sleep(Duration::from_millis(50));
            counter.hold.store(false, Ordering::SeqCst);
            ok(cancel.join().unwrap());
        });
    });
    let b = session.square("/b", 0.0);
    complete(&session, b);
    drop(session);
}

#[test]
fn an_interrupt_does_not_wait_for_what_it_ends() {
    while_a_commit_is_held(|session, counter| {
        std::thread::scope(|scope| {
            let interrupt = scope.spawn(|| session.interrupt());
            let begin = Instant::now();
            while !interrupt.is_finished() && begin.elapsed() < Duration::from_secs(20) {
                std::thread::sleep(Duration::from_millis(1));
            }
            let returned = interrupt.is_finished();
            counter.hold.store(false, Ordering::SeqCst);
            assert!(returned, "it waited for the commit");
            ok(interrupt.join().unwrap());
        });
    });
}
