//! Commit, render, wait, cancel, read, destroy.

use std::ffi::{CString, c_char};
use std::ptr::null_mut;
use std::time::{Duration, Instant};

use hdtrapeze::*;

use crate::support::*;

/// Far more samples than any test waits for.
const ENDLESS: u32 = 1 << 20;

fn describe(session: &Session, name: &str) -> Result<trz_aov_desc, trz_result> {
    let name = CString::new(name).unwrap();
    let mut desc = trz_aov_desc {
        struct_size: size_of::<trz_aov_desc>() as u32,
        width: 0,
        height: 0,
        components: 0,
        format: 99,
        origin_x: 7,
        origin_y: 7,
    };
    // SAFETY: pointers to live values.
    match unsafe { trz_aov_describe(session.0, name.as_ptr(), &mut desc) } {
        TRZ_OK => Ok(desc),
        error => Err(error),
    }
}

fn read_color(session: &Session) -> Vec<f32> {
    let mut values = vec![-1.0f32; 32 * 32 * 4];
    let bytes = size_of_val(&*values);
    // SAFETY: a buffer of the size that is told.
    ok(unsafe {
        trz_aov_read(
            session.0,
            c"color".as_ptr(),
            values.as_mut_ptr().cast(),
            bytes,
        )
    });
    values
}

#[test]
fn a_render_from_start_to_end() {
    let session = Session::with_camera();
    session.square("/square", 0.0);
    assert_eq!(session.progress().state, TRZ_STATE_IDLE);
    assert_eq!(describe(&session, "color").err(), Some(TRZ_ERROR_NOT_FOUND));
    ok(session.start());
    assert!(session.wait(-1.0));
    let progress = session.progress();
    assert_eq!(progress.state, TRZ_STATE_FINISHED);
    assert_eq!((progress.fraction, progress.samples_done), (1.0, 4));
    assert_eq!((progress.samples_total, progress.seconds_left), (4, 0.0));
    assert!(progress.seconds > 0.0);

    let color = describe(&session, "color").unwrap();
    assert_eq!((color.width, color.height, color.components), (32, 32, 4));
    assert_eq!(color.format, TRZ_FORMAT_FLOAT32);
    assert_eq!((color.origin_x, color.origin_y), (0, 0));
    assert_eq!(describe(&session, "P").err(), Some(TRZ_ERROR_NOT_FOUND));
    assert_eq!(describe(&session, "none").err(), Some(TRZ_ERROR_NOT_FOUND));
    let mut small = [0u8; 100];
    // SAFETY: a buffer of the size that is told.
    let result = unsafe {
        trz_aov_read(
            session.0,
            c"color".as_ptr(),
            small.as_mut_ptr().cast(),
            small.len(),
        )
    };
    fails(result, TRZ_ERROR_BUFFER_TOO_SMALL);
    assert_eq!(small, [0; 100], "written although it failed");

    // The square covers x and y from 0 to 1 of a view from -2 to 2: pixels 16 to 23 of a row, and
    // rows 8 to 15 from the top.
    let pixels = read_color(&session);
    let alpha = |x: usize, y: usize| pixels[(y * 32 + x) * 4 + 3];
    assert_eq!((alpha(20, 12), alpha(12, 12)), (1.0, 0.0));
    assert_eq!((alpha(20, 20), alpha(12, 20)), (0.0, 0.0));

    let statistics = session.statistics();
    assert_eq!((statistics.prims, statistics.objects_diced), (1, 1));
    assert!(statistics.rays >= 32 * 32 * 4, "{}", statistics.rays);
    assert!(statistics.film_bytes > 0 && statistics.total_seconds > 0.0);

    // An empty commit changes nothing; another render begins anew and gives the same pixels.
    ok(session.commit());
    assert_eq!(session.progress().state, TRZ_STATE_FINISHED);
    ok(session.start());
    assert!(session.wait(-1.0));
    assert_eq!(read_color(&session), pixels);
}

#[test]
fn cancel_keeps_what_was_rendered() {
    let session = Session::with_camera();
    session.square("/square", 0.0);
    session.set_samples(ENDLESS);
    ok(session.start());
    assert!(!session.wait(0.0), "still running");
    let begin = Instant::now();
    while session.progress().samples_done == 0 {
        assert!(begin.elapsed() < Duration::from_secs(60), "no progress");
        std::thread::sleep(Duration::from_millis(1));
    }
    let running = session.progress();
    assert_eq!(running.state, TRZ_STATE_RENDERING);
    assert!(running.fraction > 0.0 && running.fraction < 1.0);
    assert!(running.seconds_left > 0.0);
    ok(session.cancel());
    let progress = session.progress();
    assert_eq!(progress.state, TRZ_STATE_CANCELLED);
    assert!(progress.samples_done >= 1 && progress.samples_done < ENDLESS);
    assert_eq!(read_color(&session).len(), 32 * 32 * 4);
    ok(session.cancel());
    assert!(session.wait(0.0));
}

/// Waits until the session is so; gives the progress.
fn until(session: &Session, is_so: impl Fn(&trz_progress) -> bool) -> trz_progress {
    let begin = Instant::now();
    loop {
        let progress = session.progress();
        if is_so(&progress) {
            return progress;
        }
        assert!(
            begin.elapsed() < Duration::from_secs(60),
            "state {}",
            progress.state
        );
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_pause_keeps_samples_and_changes_no_image() {
    let session = Session::with_camera();
    session.square("/square", 0.0);
    session.set_samples(2000);
    ok(session.start());
    until(&session, |progress| progress.samples_done > 0);
    ok(session.pause(1));
    let paused = until(&session, |progress| progress.state == TRZ_STATE_PAUSED);
    assert!(paused.fraction > 0.0 && paused.fraction < 1.0 && paused.seconds_left < 0.0);
    assert!(!session.wait(0.02), "it has not come to its end");
    assert_eq!(session.progress().fraction, paused.fraction, "it went on");
    assert_eq!(read_color(&session).len(), 32 * 32 * 4);
    ok(session.pause(0));
    assert!(session.wait(-1.0));
    let progress = session.progress();
    assert_eq!(
        (progress.state, progress.samples_done),
        (TRZ_STATE_FINISHED, 2000)
    );
    let rays = session.statistics().rays;
    let pixels = read_color(&session);
    ok(session.start());
    assert!(session.wait(-1.0));
    assert_eq!(read_color(&session), pixels);
    assert_eq!(session.statistics().rays, rays, "samples were taken twice");
}

#[test]
fn what_is_started_in_a_pause_waits_and_can_be_cancelled() {
    let session = Session::with_camera();
    session.square("/square", 0.0);
    ok(session.pause(1));
    ok(session.start());
    let progress = until(&session, |progress| progress.state == TRZ_STATE_PAUSED);
    assert_eq!((progress.samples_done, progress.fraction), (0, 0.0));
    ok(session.cancel());
    assert_eq!(session.progress().state, TRZ_STATE_CANCELLED);
    ok(session.start());
    until(&session, |progress| progress.state == TRZ_STATE_PAUSED);
    session.square("/other", 1.0);
    ok(session.commit());
    assert_eq!(session.progress().state, TRZ_STATE_IDLE, "edits end it");
    ok(session.start());
    ok(session.pause(0));
    assert!(session.wait(-1.0));
    assert_eq!(session.progress().state, TRZ_STATE_FINISHED);
    ok(session.pause(1));
    assert_eq!(session.progress().state, TRZ_STATE_FINISHED);
    ok(session.start());
    drop(session);
}

#[test]
fn edits_stop_a_running_render_and_empty_commits_do_not() {
    let session = Session::with_camera();
    let square = session.square("/square", 0.0);
    session.set_samples(ENDLESS);
    ok(session.start());
    ok(session.commit());
    session.set_square_points(square, 0.0);
    ok(session.commit());
    assert_eq!(session.progress().state, TRZ_STATE_RENDERING, "no change");
    session.set_square_points(square, 0.5);
    assert_eq!(session.progress().state, TRZ_STATE_RENDERING, "only queued");
    ok(session.commit());
    assert_eq!(session.progress().state, TRZ_STATE_IDLE);
    let statistics = session.statistics();
    assert_eq!(statistics.prims, 1);
}

#[test]
fn destroy_while_rendering() {
    for _ in 0..3 {
        let session = Session::with_camera();
        session.square("/square", 0.0);
        session.set_samples(ENDLESS);
        ok(session.start());
        drop(session);
    }
}

#[test]
fn no_camera_is_an_error_that_can_be_mended() {
    let session = Session::new();
    session.square("/square", 0.0);
    let message = fails(session.commit(), TRZ_ERROR_INVALID_ARGUMENT);
    assert!(message.contains("camera"), "{message}");
    assert_eq!(session.progress().state, TRZ_STATE_FAILED);
    fails(session.start(), TRZ_ERROR_INVALID_ARGUMENT);
    let camera = session.camera("/camera");
    // SAFETY: a live session.
    ok(unsafe { trz_session_set_active_camera(session.0, camera) });
    ok(session.commit());
    assert_eq!(session.statistics().prims, 1, "the earlier edit is kept");
}

#[test]
fn explain_tells_how_much_it_needs() {
    let session = Session::with_camera();
    let s = session.0;
    let mut needed = 0;
    // SAFETY: buffers of the sizes that are told.
    unsafe {
        fails(
            trz_explain(s, null_mut(), 0, &mut needed),
            TRZ_ERROR_NOT_FOUND,
        );
        ok(session.commit());
        ok(trz_explain(s, null_mut(), 0, &mut needed));
        assert!(needed > 1);
        let mut text = vec![1 as c_char; needed + 1];
        let mut again = 0;
        let short = trz_explain(s, text.as_mut_ptr(), needed - 1, &mut again);
        fails(short, TRZ_ERROR_BUFFER_TOO_SMALL);
        assert_eq!((again, text[0]), (needed, 1));
        ok(trz_explain(s, text.as_mut_ptr(), needed, &mut again));
        assert_eq!(text[needed - 1], 0, "ends with a NUL");
        assert_eq!(text[needed], 1, "nothing beyond");
    }
}

#[test]
fn rays_hit_what_is_committed() {
    let session = Session::with_camera();
    let square = session.square("/square", 0.0);
    // SAFETY: a live session.
    ok(unsafe { trz_prim_set_pick_id(session.0, square, 42) });
    let down = |x: f32, y: f32| trz_ray {
        origin: [x, y, 5.0],
        dir: [0.0, 0.0, -2.0],
        time: 0.5,
        t_min: 0.0,
        t_max: f32::INFINITY,
    };
    let mut rays = vec![down(0.25, 0.5), down(1.5, 0.5)];
    rays.push(trz_ray {
        t_max: 2.0,
        ..rays[0]
    });
    for bad in [f32::NAN, f32::INFINITY] {
        rays.push(down(bad, 0.5));
        rays.push(trz_ray {
            dir: [0.0, bad, 1.0],
            ..rays[0]
        });
    }
    rays.push(trz_ray {
        time: f32::NAN,
        ..rays[0]
    });
    rays.push(trz_ray {
        dir: [0.0; 3],
        ..rays[0]
    });
    // SAFETY: all zero bytes are a valid value of this struct of numbers.
    let mut hits = vec![unsafe { std::mem::zeroed::<trz_hit>() }; rays.len()];
    let mut trace = || {
        // SAFETY: arrays of the length that is told.
        unsafe { trz_trace_rays(session.0, rays.as_ptr(), hits.as_mut_ptr(), rays.len()) }
    };
    fails(trace(), TRZ_ERROR_NOT_FOUND);
    ok(session.commit());
    ok(trace());
    assert!((hits[0].t - 2.5).abs() < 1e-5, "{}", hits[0].t);
    assert_eq!((hits[0].prim_id, hits[0].element_id), (42, 0));
    assert_eq!(hits[0].normal, [0.0, 0.0, 1.0]);
    for (at, hit) in hits.iter().enumerate().skip(1) {
        assert_eq!(hit.t, f32::INFINITY, "ray {at}");
        assert_eq!((hit.prim_id, hit.instance_id, hit.element_id), (-1, -1, -1));
        assert_eq!(hit.normal, [0.0; 3]);
    }
}

#[test]
fn absurd_films_are_refused_and_the_session_goes_on() {
    let session = Session::with_camera();
    let mut settings = small_settings(1);
    (settings.width, settings.height) = (65_536, 65_536);
    // A coarse dicing, so that only the film is absurd.
    settings.shading_rate = 1e6;
    // SAFETY: pointers to live values.
    ok(unsafe { trz_session_set_settings(session.0, &settings) });
    fails(session.start(), TRZ_ERROR_OUT_OF_MEMORY);
    session.set_samples(1);
    ok(session.start());
    assert!(session.wait(-1.0));
}

#[test]
fn overscan_is_around_the_image_and_changes_nothing_in_it() {
    let session = Session::with_camera();
    session.square("/square", 0.0);
    ok(session.start());
    assert!(session.wait(-1.0));
    let plain = read_color(&session);
    let mut settings = small_settings(4);
    settings.data_window = [-3, 2, 40, 41];
    // SAFETY: pointers to live values.
    ok(unsafe { trz_session_set_settings(session.0, &settings) });
    ok(session.start());
    assert!(session.wait(-1.0));
    let color = describe(&session, "color").unwrap();
    assert_eq!((color.origin_x, color.origin_y), (-3, 0));
    assert_eq!((color.width, color.height), (43, 41));
    let mut values = vec![-1.0f32; 43 * 41 * 4];
    let bytes = size_of_val(&*values);
    // SAFETY: a buffer of the size that is told.
    ok(unsafe {
        trz_aov_read(
            session.0,
            c"color".as_ptr(),
            values.as_mut_ptr().cast(),
            bytes,
        )
    });
    for y in 2..32 {
        let inside = &values[(y * 43 + 3) * 4..][..32 * 4];
        assert_eq!(inside, &plain[y * 32 * 4..][..32 * 4], "row {y}");
    }
    assert!(
        values[..2 * 43 * 4].iter().all(|&v| v == 0.0),
        "not asked for"
    );
}
