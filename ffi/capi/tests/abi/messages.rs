//! The log callback.

use std::ffi::{c_char, c_void};
use std::sync::atomic::{AtomicI32, AtomicUsize, Ordering};

use hdtrapeze::*;

use crate::support::*;

fn silence(session: &Session) {
    // SAFETY: no callback.
    ok(unsafe { trz_session_set_log(session.0, None, std::ptr::null_mut(), 0) });
}

/// Crease lists that contradict each other: dropped with a warning.
fn bad_creases(session: &Session, id: trz_id) {
    // SAFETY: a live session.
    ok(unsafe { set_bad_creases(session.0, id) });
}

/// Safety: a live session.
unsafe fn set_bad_creases(session: *mut trz_session, id: trz_id) -> trz_result {
    let (points, length, sharpness) = ([0, 1], 3, 1.0);
    let mut topology = topology();
    topology.crease_indices = points.as_ptr();
    topology.crease_index_count = 2;
    topology.crease_lengths = &length;
    topology.crease_count = 1;
    topology.crease_sharpnesses = &sharpness;
    topology.crease_sharpness_count = 1;
    // SAFETY: pointers to live values.
    unsafe { trz_mesh_set_topology(session, id, &topology) }
}

#[test]
fn a_warning_names_the_prim_and_comes_once() {
    let (first, second) = (Session::new(), Session::new());
    let (to_first, to_second) = (Received::default(), Received::default());
    listen(&first, &to_first, TRZ_LOG_WARN);
    listen(&second, &to_second, TRZ_LOG_WARN);
    let mesh = first.mesh("/a/mesh");
    bad_creases(&first, mesh);
    bad_creases(&first, mesh);
    let messages = to_first.take();
    assert_eq!(messages.len(), 1, "{messages:?}");
    let (level, path, code, text) = &messages[0];
    assert_eq!((*level, path.as_str()), (TRZ_LOG_WARN, "/a/mesh"));
    assert_eq!(code, "topology");
    assert!(text.contains("crease"), "{text}");
    assert!(to_second.take().is_empty(), "sessions mix");

    listen(&first, &to_first, TRZ_LOG_ERROR);
    bad_creases(&first, first.mesh("/other"));
    assert!(to_first.take().is_empty(), "below the level");
    silence(&first);
    bad_creases(&first, first.mesh("/third"));
    assert!(to_first.take().is_empty(), "after the end");
    silence(&second);
}

#[test]
fn warnings_of_a_commit_arrive_before_it_returns() {
    let session = Session::with_camera();
    let received = Received::default();
    listen(&session, &received, TRZ_LOG_WARN);
    // Loop subdivision takes triangles only.
    let square = session.square("/loop", 0.0);
    session.set_square_topology(square, TRZ_SCHEME_LOOP);
    ok(session.commit());
    let messages = received.take();
    assert_eq!(messages.len(), 1, "{messages:?}");
    assert_eq!(messages[0].1, "/loop");
    session.set_samples(1);
    ok(session.commit());
    assert!(received.take().is_empty(), "told twice");
    silence(&session);
}

#[test]
fn subsets_are_told_by_their_own_paths_and_seen_in_their_aov() {
    let session = Session::with_camera();
    let received = Received::default();
    listen(&session, &received, TRZ_LOG_WARN);
    let mesh = session.square("/square", -0.5);
    let subsets = [
        subset(c"/square/points".as_ptr(), &[]),
        subset(c"/square/all".as_ptr(), &[0, 7]),
    ]
    .map(|s| trz_subset {
        family: c"materialBind".as_ptr(),
        family_type: TRZ_FAMILY_PARTITION,
        ..s
    });
    let points = trz_subset {
        element_type: TRZ_ELEMENT_POINT,
        ..subsets[0]
    };
    let subsets = [points, subsets[1]];
    let aov = [c"subsetId".as_ptr()];
    let mut ids = vec![-7i32; 32 * 32];
    let mut render = || {
        ok(session.start());
        assert!(session.wait(-1.0));
        let bytes = size_of_val(&*ids);
        // SAFETY: a buffer of the size that is told.
        ok(unsafe { trz_aov_read(session.0, aov[0], ids.as_mut_ptr().cast(), bytes) });
        let seen = |id: i32| ids.contains(&id);
        [-1, 0, 1].map(seen)
    };
    // SAFETY: pointers to live values.
    unsafe {
        ok(trz_session_set_aovs(session.0, aov.as_ptr(), 1));
        ok(trz_mesh_set_subsets(session.0, mesh, subsets.as_ptr(), 2));
    }
    assert_eq!(render(), [true, false, true]);
    let messages = received.take();
    let of: Vec<_> = messages.iter().map(|m| (&*m.1, &*m.2)).collect();
    assert_eq!(
        of,
        [
            ("/square/points", "unsupported"),
            ("/square/all", "topology")
        ]
    );
    // SAFETY: a live session.
    ok(unsafe { trz_mesh_set_subsets(session.0, mesh, std::ptr::null(), 0) });
    assert_eq!(render(), [true, false, false]);
    assert!(received.take().is_empty());
    silence(&session);
}

/// What a callback that calls its own session sees.
struct Nosy {
    session: *mut trz_session,
    calls: AtomicUsize,
    mesh: trz_id,
    results: [AtomicI32; 5],
    edit: AtomicI32,
}

unsafe extern "C" fn call_back(
    user: *mut c_void,
    _: u32,
    _: *const c_char,
    _: *const c_char,
    _: *const c_char,
) {
    // SAFETY: `user` is the `Nosy` of the test, and its session is alive.
    unsafe {
        let nosy = &*user.cast::<Nosy>();
        let s = nosy.session;
        nosy.calls.fetch_add(1, Ordering::Relaxed);
        let results = [
            trz_session_commit(s),
            trz_render_start(s),
            trz_render_wait(s, -1.0, &mut 0),
            trz_render_cancel(s),
            trz_session_set_log(s, None, std::ptr::null_mut(), 0),
        ];
        for (place, result) in nosy.results.iter().zip(results) {
            place.store(result, Ordering::Relaxed);
        }
        // An edit does not wait, also where it would warn.
        let edit = set_bad_creases(s, nosy.mesh);
        nosy.edit.store(edit, Ordering::Relaxed);
        trz_session_destroy(s);
    }
}

#[test]
fn calls_from_inside_the_callback_do_not_hang() {
    let session = Session::with_camera();
    let nosy = Nosy {
        session: session.0,
        mesh: session.mesh("/other"),
        edit: AtomicI32::new(-1),
        calls: AtomicUsize::new(0),
        results: Default::default(),
    };
    let user = (&raw const nosy).cast_mut().cast();
    // SAFETY: `nosy` outlives the callback.
    ok(unsafe { trz_session_set_log(session.0, Some(call_back), user, TRZ_LOG_WARN) });
    bad_creases(&session, session.mesh("/mesh"));
    assert_eq!(nosy.calls.load(Ordering::Relaxed), 1);
    for result in &nosy.results {
        assert_eq!(result.load(Ordering::Relaxed), TRZ_ERROR_BUSY);
    }
    assert_eq!(nosy.edit.load(Ordering::Relaxed), TRZ_OK);
    silence(&session);
    ok(session.commit());
}

#[test]
fn render_vars_without_an_aov_are_warned_about() {
    let session = Session::with_camera();
    let received = Received::default();
    listen(&session, &received, TRZ_LOG_WARN);
    for (source_type, source, word) in [
        (c"raw", c"nonsense", "nonsense"),
        (c"lpe", c"CD<L.>", "CD<L.>"),
        (c"what", c"color", "what"),
    ] {
        let var = trz_render_var {
            source_name: source.as_ptr(),
            source_type: source_type.as_ptr(),
            ..render_var(c"/Vars/x".as_ptr())
        };
        // SAFETY: pointers to live values.
        let result =
            unsafe { trz_render_var_aov(session.0, &var, std::ptr::null_mut(), 0, &mut 0) };
        assert!(fails(result, TRZ_ERROR_UNSUPPORTED).contains(word));
        let said = received.take();
        assert_eq!(said.len(), 1, "{said:?}");
        let (_, path, _, text) = &said[0];
        assert!(path == "/Vars/x" && text.contains(word), "{said:?}");
    }
    let odd = trz_render_var {
        data_type: c"banana".as_ptr(),
        ..render_var(c"/Vars/color".as_ptr())
    };
    // SAFETY: pointers to live values.
    ok(unsafe { trz_render_var_aov(session.0, &odd, std::ptr::null_mut(), 0, &mut 0) });
    assert!(received.take()[0].3.contains("banana"));
    silence(&session);
}
