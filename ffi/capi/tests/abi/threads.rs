//! Many threads on one session, as Hydra syncs.

use hdtrapeze::*;

use crate::support::*;

const THREADS: usize = 4;
const ROUNDS: usize = 40;

#[test]
fn edits_from_many_threads_while_rendering() {
    let session = Session::with_camera();
    session.set_samples(1 << 20);
    session.square("/first", -1.0);
    ok(session.start());
    std::thread::scope(|scope| {
        for thread in 0..THREADS {
            let session = &session;
            scope.spawn(move || {
                for round in 0..ROUNDS {
                    let id = session.square(&format!("/t{thread}/r{round}"), round as f32 * 0.01);
                    session.set_square_points(id, 0.5);
                    // SAFETY: a live session.
                    unsafe {
                        ok(trz_prim_set_pick_id(session.0, id, round as i32));
                        ok(trz_prim_set_visible(session.0, id, 1));
                        if round % 2 == 1 {
                            ok(trz_prim_remove(session.0, id));
                        }
                    }
                    if round % 8 == thread {
                        ok(session.start());
                    }
                    session.progress();
                    session.statistics();
                }
            });
        }
        // Readers never wait for a commit, and see whole images only.
        let session = &session;
        scope.spawn(move || {
            let mut pixels = vec![0.0f32; 32 * 32 * 4];
            let bytes = size_of_val(&*pixels);
            for _ in 0..ROUNDS {
                // SAFETY: a buffer of the size that is told.
                ok(unsafe {
                    let buffer = pixels.as_mut_ptr().cast();
                    trz_aov_read(session.0, c"color".as_ptr(), buffer, bytes)
                });
            }
        });
    });
    session.set_samples(1);
    ok(session.start());
    assert!(session.wait(-1.0));
    let expected = 1 + THREADS * ROUNDS / 2;
    assert_eq!(session.statistics().prims, expected as u64);
}

#[test]
fn cancel_from_many_threads() {
    let session = Session::with_camera();
    session.set_samples(1 << 20);
    session.square("/square", 0.0);
    std::thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                for _ in 0..10 {
                    // A start whose preparation another thread cancels says so.
                    let result = session.start();
                    assert!([TRZ_OK, TRZ_ERROR_CANCELLED].contains(&result));
                    ok(session.cancel());
                }
            });
        }
    });
    // The last start was followed by its own thread's cancel.
    assert!(session.wait(0.0));
}
