//! A renderer that panics or takes its time: sessions with a subdivision factory of the tests.

use std::ptr::{null, null_mut};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use hdtrapeze::*;
use hdtrapeze_core::surface::{
    Channel, LimitSurface, MeshTopology, SubdivisionFactory, SurfaceError,
};

use crate::support::*;

struct Panics;

impl SubdivisionFactory for Panics {
    fn create(
        &self,
        _: &MeshTopology,
        _: &[Vec<glam::Vec3>],
        _: Vec<Channel>,
    ) -> Result<Box<dyn LimitSurface>, SurfaceError> {
        panic!("induced by the test");
    }
}

/// Gives a session the camera and square of the other tests.
fn with_square(factory: Box<dyn SubdivisionFactory>) -> Session {
    let session = Session(session_with(factory));
    let camera = session.camera("/camera");
    // SAFETY: a live session.
    ok(unsafe { trz_session_set_active_camera(session.0, camera) });
    session.set_samples(1);
    session.square("/square", 0.0);
    session
}

#[test]
fn a_panic_poisons_its_session_only() {
    let other = Session::with_camera();
    let session = with_square(Box::new(Panics));
    let message = fails(session.start(), TRZ_ERROR_INTERNAL);
    assert!(message.contains("induced by the test"), "{message}");
    let poisoned = TRZ_ERROR_POISONED;
    let message = fails(session.start(), poisoned);
    assert!(message.contains("induced by the test"), "{message}");
    let s = session.0;
    // SAFETY: pointers to live values.
    unsafe {
        fails(session.commit(), poisoned);
        fails(session.cancel(), poisoned);
        fails(session.pause(1), poisoned);
        fails(trz_render_wait(s, -1.0, &mut 0), poisoned);
        fails(trz_mesh_create(s, c"/a".as_ptr(), &mut 0), poisoned);
        fails(trz_prim_remove(s, 1), poisoned);
        fails(trz_session_set_aovs(s, null(), 0), poisoned);
        fails(trz_session_set_log(s, None, null_mut(), 0), poisoned);
        fails(trz_trace_rays(s, null(), null_mut(), 0), poisoned);
        fails(trz_explain(s, null_mut(), 0, &mut 0), poisoned);
    }
    drop(session);
    ok(other.commit());
}

#[test]
fn who_waits_for_a_commit_that_panics_is_woken() {
    struct Late;
    impl SubdivisionFactory for Late {
        fn create(
            &self,
            _: &MeshTopology,
            _: &[Vec<glam::Vec3>],
            _: Vec<Channel>,
        ) -> Result<Box<dyn LimitSurface>, SurfaceError> {
            std::thread::sleep(Duration::from_millis(100));
            panic!("induced by the test");
        }
    }
    let session = with_square(Box::new(Late));
    std::thread::scope(|scope| {
        let commit = scope.spawn(|| session.commit());
        while !commit.is_finished() {
            // SAFETY: pointers to live values.
            let result = unsafe { trz_render_wait(session.0, -1.0, &mut 0) };
            assert!([TRZ_OK, TRZ_ERROR_POISONED].contains(&result));
        }
        assert_eq!(commit.join().unwrap(), TRZ_ERROR_INTERNAL);
    });
}

/// Says that it has begun, then waits until it may go on.
struct Slow {
    begun: Arc<AtomicBool>,
    go_on: Arc<AtomicBool>,
}

impl SubdivisionFactory for Slow {
    fn create(
        &self,
        _: &MeshTopology,
        _: &[Vec<glam::Vec3>],
        _: Vec<Channel>,
    ) -> Result<Box<dyn LimitSurface>, SurfaceError> {
        self.begun.store(true, Ordering::SeqCst);
        while !self.go_on.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(1));
        }
        Err(SurfaceError::Library("not today".to_owned()))
    }
}

#[test]
fn a_commit_can_be_cancelled_and_made_up_for() {
    let (begun, go_on) = (
        Arc::new(AtomicBool::new(false)),
        Arc::new(AtomicBool::new(false)),
    );
    let session = with_square(Box::new(Slow {
        begun: begun.clone(),
        go_on: go_on.clone(),
    }));
    std::thread::scope(|scope| {
        let commit = scope.spawn(|| session.commit());
        while !begun.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(session.progress().state, TRZ_STATE_PREPARING);
        // Editing and asking do not wait for the commit.
        session.mesh("/later");
        assert!(!session.wait(0.001));
        let cancel = scope.spawn(|| session.cancel());
        std::thread::sleep(Duration::from_millis(20));
        go_on.store(true, Ordering::SeqCst);
        assert_eq!(commit.join().unwrap(), TRZ_ERROR_CANCELLED);
        ok(cancel.join().unwrap());
    });
    assert_eq!(session.progress().state, TRZ_STATE_CANCELLED);
    ok(session.commit());
    assert_eq!(session.statistics().prims, 2);
}
