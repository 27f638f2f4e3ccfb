//! Views for hosts that wait for nothing, and the files of products.

use std::ffi::{CStr, CString, c_char};
use std::ptr::null;
use std::time::{Duration, Instant};

use hdtrapeze::*;

use crate::support::*;

const COLOR: [*const c_char; 1] = [c"color".as_ptr()];

/// A square in front of a camera.
fn scene() -> (Session, trz_id) {
    let session = Session::with_camera();
    session.square("/square", 0.0);
    let camera = session.camera("/other");
    session.set_samples(4);
    (session, camera)
}

fn render(session: &Session, view: &trz_view, products: &[*const trz_product]) -> trz_result {
    // SAFETY: pointers to live values.
    unsafe { trz_view_render(session.0, view, products.as_ptr(), products.len()) }
}

fn until(what: &str, is_so: impl Fn() -> bool) {
    let end = Instant::now() + Duration::from_secs(20);
    while !is_so() {
        assert!(Instant::now() < end, "{what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn converge(session: &Session) {
    until("it converges", || session.progress().view_converged == 1);
}

#[test]
fn a_view_is_rendered_when_it_is_new_or_something_was_edited() {
    let (session, camera) = scene();
    let settings = small_settings(2);
    let view = trz_view {
        camera,
        ..view(&settings, &COLOR)
    };
    assert_eq!(
        session.progress().view_converged,
        1,
        "nothing was asked for"
    );
    assert_eq!(session.progress().view_readable, 0);
    for _ in 0..3 {
        ok(render(&session, &view, &[]));
        converge(&session);
    }
    let progress = session.progress();
    assert_eq!((progress.view_starts, progress.view_readable), (1, 1));
    assert_eq!(
        (progress.state, progress.samples_done),
        (TRZ_STATE_FINISHED, 2)
    );
    let edits = progress.edits;
    session.square("/more", 0.5);
    assert_eq!(
        session.progress().edits,
        edits + 3,
        "made, topology, points"
    );
    assert_eq!(
        session.progress().camera_edits,
        4,
        "two made, one set and placed"
    );
    ok(render(&session, &view, &[]));
    assert_eq!(session.progress().view_starts, 2);
    let settings = small_settings(3);
    let other = trz_view {
        settings: &settings,
        ..view
    };
    ok(render(&session, &other, &[]));
    ok(render(&session, &other, &[]));
    converge(&session);
    let progress = session.progress();
    assert_eq!((progress.view_starts, progress.view_readable), (3, 3));
    assert_eq!(progress.samples_done, 3);
}

#[test]
fn a_stopped_view_waits_until_it_is_resumed() {
    let (session, camera) = scene();
    let settings = small_settings(1 << 20);
    let view = trz_view {
        camera,
        ..view(&settings, &COLOR)
    };
    ok(render(&session, &view, &[]));
    until("samples are taken", || session.progress().samples_done > 0);
    // SAFETY: a live session.
    ok(unsafe { trz_view_stop(session.0, 1) });
    let progress = session.progress();
    assert_eq!((progress.view_stopped, progress.view_converged), (1, 1));
    assert_eq!(progress.state, TRZ_STATE_CANCELLED);
    let few = small_settings(2);
    ok(render(
        &session,
        &trz_view {
            settings: &few,
            ..view
        },
        &[],
    ));
    assert!(session.wait(0.1));
    assert_eq!(
        session.progress().samples_total,
        1 << 20,
        "stopped, nothing begins"
    );
    // SAFETY: a live session.
    ok(unsafe { trz_view_resume(session.0) });
    converge(&session);
    let progress = session.progress();
    assert_eq!((progress.view_stopped, progress.samples_done), (0, 2));
    // What was not given up is not made again.
    // SAFETY: a live session.
    unsafe {
        ok(trz_view_stop(session.0, 0));
        ok(trz_view_resume(session.0));
        fails(trz_view_stop(session.0, 2), TRZ_ERROR_INVALID_ARGUMENT);
    }
    assert_eq!(session.progress().view_starts, progress.view_starts);
}

#[test]
fn a_session_ends_while_it_renders() {
    let (session, camera) = scene();
    let settings = small_settings(1 << 20);
    let view = trz_view {
        camera,
        ..view(&settings, &COLOR)
    };
    ok(render(&session, &view, &[]));
    until("samples are taken", || session.progress().samples_done > 0);
    let begin = Instant::now();
    drop(session);
    assert!(begin.elapsed() < Duration::from_secs(10));
}

#[test]
fn a_failure_is_told_once_until_a_render_succeeds() {
    let (session, camera) = scene();
    let received = Received::default();
    listen(&session, &received, TRZ_LOG_WARN);
    let settings = small_settings(1);
    let none = view(&settings, &COLOR);
    let good = trz_view { camera, ..none };
    for _ in 0..3 {
        session.square("/more", 0.5);
        ok(render(&session, &none, &[]));
        converge(&session);
        assert_eq!(session.progress().state, TRZ_STATE_FAILED);
    }
    let messages = received.take();
    assert_eq!(messages.len(), 1, "{messages:?}");
    assert_eq!(messages[0].0, TRZ_LOG_ERROR);
    ok(render(&session, &good, &[]));
    converge(&session);
    assert!(received.take().is_empty());
    ok(render(&session, &none, &[]));
    converge(&session);
    assert_eq!(received.take().len(), 1);
    let unknown = trz_view { camera: 77, ..none };
    fails(render(&session, &unknown, &[]), TRZ_ERROR_NOT_FOUND);
}

fn c_string(text: impl Into<Vec<u8>>) -> CString {
    CString::new(text).unwrap()
}

#[test]
fn products_are_written_and_those_that_cannot_be_are_told() {
    let (session, camera) = scene();
    let folder = Folder::new("products");
    std::fs::create_dir(folder.0.join("folder.exr")).unwrap();
    let received = Received::default();
    listen(&session, &received, TRZ_LOG_WARN);
    let settings = small_settings(2);
    let path = |name: &str| c_string(folder.0.join(name).to_str().unwrap());
    let normal = trz_render_var {
        source_name: c"normal".as_ptr(),
        ..render_var(c"/n".as_ptr())
    };
    let color = trz_render_var {
        source_name: c"color".as_ptr(),
        ..render_var(c"/c".as_ptr())
    };
    let nonsense = trz_render_var {
        source_name: c"x".as_ptr(),
        ..render_var(c"/x".as_ptr())
    };
    let (vars, no_vars) = ([color, nonsense, normal], [nonsense]);
    let names = [
        "a.##.exr",
        "b.png",
        "./a.07.exr",
        "c.jpg",
        "d.exr",
        "e.exr",
        "folder.exr",
        "f.exr",
        "g.exr",
    ];
    let names = names.map(path);
    let of = |path: &'static CStr, name: usize| trz_product {
        name: names[name].as_ptr(),
        camera,
        camera_path: c"/other".as_ptr(),
        vars: vars.as_ptr(),
        var_count: 3,
        ..product(path.as_ptr(), &settings)
    };
    let products = [
        of(c"/good", 0),
        trz_product {
            r#type: c"deep".as_ptr(),
            ..of(c"/deep", 4)
        },
        of(c"/png", 1),
        of(c"/again", 2),
        of(c"/jpg", 3),
        trz_product {
            name: null(),
            ..of(c"/unnamed", 0)
        },
        trz_product {
            camera: 0,
            ..of(c"/lost", 4)
        },
        trz_product {
            camera: 0,
            camera_path: null(),
            ..of(c"/blind", 5)
        },
        trz_product {
            resolution: [0, 8],
            data_window: [0.5, 0.0, 0.5, 1.0],
            ..of(c"/empty", 7)
        },
        trz_product {
            vars: no_vars.as_ptr(),
            var_count: 1,
            ..of(c"/x", 8)
        },
        of(c"/folder", 6),
    ];
    let pointers = products.each_ref().map(|product| &raw const *product);
    let view = trz_view {
        camera,
        settings_path: c"/set".as_ptr(),
        resolution: [3, 2],
        data_window: [0.0, 0.0, 1.0, 0.5],
        has_resolution: 1,
        has_data_window: 1,
        ..view(&settings, &COLOR)
    };
    for _ in 0..2 {
        ok(render(&session, &view, &pointers));
        converge(&session);
    }
    let progress = session.progress();
    assert_eq!((progress.view_starts, progress.view_readable), (1, 1));
    let mut told = received.take();
    told.sort();
    let told: Vec<_> = told
        .iter()
        .map(|(_, path, _, text)| (path.as_str(), text.as_str()))
        .collect();
    let expected = [
        ("/again", "is already written by /good; it is not written"),
        ("/blind", "it has no camera; it is not written"),
        (
            "/deep",
            "productType deep is not supported, only raster; it is not written",
        ),
        (
            "/empty",
            "dataWindowNDC is (0.5, 0, 0.5, 1), which cannot be: the data window must have xmin < xmax and \
             ymin < ymax; (0, 0, 1, 0.5) is used",
        ),
        (
            "/empty",
            "resolution is (0, 8), which cannot be: the image width must be from 1 to 65536 pixels; (3, 2) \
             is used",
        ),
        ("/folder", "folder.exr is a folder; it is not written"),
        (
            "/jpg",
            "must be one that ends in .exr or .png; it is not written",
        ),
        ("/lost", "its camera /other is no camera; it is not written"),
        (
            "/png",
            "a PNG holds only color: its other vars are left out",
        ),
        ("/unnamed", "it has no productName; it is not written"),
        ("/x", "none of its vars can be written; it is not written"),
        ("/x", "the renderer has no AOV x; the var is left out"),
    ];
    assert_eq!(told.len(), expected.len(), "{told:?}");
    for ((path, text), (prim, part)) in told.into_iter().zip(expected) {
        assert!(path == prim && text.contains(part), "{path}: {text}");
    }
    let file = std::fs::read(folder.0.join("a.07.exr")).unwrap();
    for fact in [
        "hdtrapeze/renderProduct",
        "/good",
        "/set",
        "n.X",
        "hdtrapeze/frame",
    ] {
        assert!(
            file.windows(fact.len()).any(|part| part == fact.as_bytes()),
            "{fact}"
        );
    }
    assert!(folder.0.join("b.png").is_file());
    assert!(folder.0.join("f.exr").is_file());
    assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 4);
}

/// Texts, without what is said of products that name no vars.
fn messages(received: &Received) -> Vec<String> {
    let mut told: Vec<_> = received.take().into_iter().map(|told| told.3).collect();
    told.retain(|text| !text.contains("orderedVars is empty"));
    told
}

#[test]
fn products_hold_the_scene_that_they_were_asked_for_with() {
    let (session, camera) = scene();
    let folder = Folder::new("wholes");
    let received = Received::default();
    listen(&session, &received, TRZ_LOG_INFO);
    let all = [1, 2, 3].map(small_settings);
    let names = [0, 1].map(|i| c_string(folder.0.join(format!("{i}.png")).to_str().unwrap()));
    let products = [0, 1].map(|i| trz_product {
        name: names[i].as_ptr(),
        camera,
        ..product([c"/first", c"/second"][i].as_ptr(), &all[i])
    });
    let pointers = products.each_ref().map(|product| &raw const *product);
    let own = trz_view {
        camera,
        ..view(&all[2], &COLOR)
    };
    ok(session.pause(1));
    ok(render(&session, &own, &pointers));
    until("the first one begins", || {
        session.progress().state == TRZ_STATE_PAUSED
    });
    // Half of what a host does that goes, or loads another scene.
    let instancer = session.instancer("/instancer");
    // SAFETY: live sessions and ids.
    unsafe {
        ok(trz_prim_remove(session.0, camera));
        let part = session.square("/part", 0.5);
        ok(trz_prim_set_instancer(session.0, part, instancer, 7));
    }
    ok(session.pause(0));
    converge(&session);
    assert_eq!(session.statistics().prims, 1, "what was edited waits");
    assert!(
        names
            .iter()
            .all(|name| std::path::Path::new(name.to_str().unwrap()).is_file())
    );
    assert_eq!(messages(&received), Vec::<String>::new());
    // The next call has it all: the camera that was rendered through is no more.
    fails(render(&session, &own, &pointers), TRZ_ERROR_NOT_FOUND);
    let none = trz_view { camera: 0, ..own };
    ok(render(&session, &none, &[]));
    converge(&session);
    assert_eq!(session.progress().state, TRZ_STATE_FAILED);
}

#[test]
fn a_host_that_goes_is_told_of_its_files_once() {
    let (session, camera) = scene();
    let received = Received::default();
    listen(&session, &received, TRZ_LOG_INFO);
    let settings = small_settings(1 << 20);
    let folder = Folder::new("interrupted");
    let name = c_string(folder.0.join("never.exr").to_str().unwrap());
    let product = trz_product {
        name: name.as_ptr(),
        camera,
        ..product(c"/product".as_ptr(), &settings)
    };
    let own = trz_view {
        camera,
        ..view(&settings, &COLOR)
    };
    ok(render(&session, &own, &[&raw const product]));
    until("samples are taken", || session.progress().samples_done > 0);
    drop(session);
    let told = messages(&received);
    assert_eq!(
        told,
        [format!(
            "the host is gone before all its products are written; what was rendered is in {}",
            folder.0.join("never.partial.exr").display()
        )]
    );
    // What it had is kept, and is not taken for the whole.
    let names: Vec<_> = std::fs::read_dir(&folder.0).unwrap().collect();
    assert_eq!(names.len(), 1, "{names:?}");
    let kept = std::fs::read(folder.0.join("never.partial.exr")).unwrap();
    let fact = b"hdtrapeze/complete\0string\0\x05\0\0\0false";
    assert!(kept.windows(fact.len()).any(|part| part == fact));
}

#[test]
fn a_backend_that_is_not_there_is_replaced() {
    let (session, camera) = scene();
    let received = Received::default();
    listen(&session, &received, TRZ_LOG_WARN);
    let settings = trz_settings {
        backend: TRZ_BACKEND_GPU,
        ..small_settings(1)
    };
    // SAFETY: pointers to live values.
    let has_gpu = unsafe { trz_session_set_settings(session.0, &settings) } == TRZ_OK;
    let view = trz_view {
        camera,
        ..view(&settings, &COLOR)
    };
    for _ in 0..2 {
        ok(render(&session, &view, &[]));
        converge(&session);
    }
    assert_eq!(session.progress().state, TRZ_STATE_FINISHED);
    let told = received.take();
    let auto = told
        .iter()
        .filter(|told| told.3.ends_with("; the backend auto is used"));
    assert_eq!(auto.count(), usize::from(!has_gpu), "{told:?}");
}

fn show(session: &Session, buffer: &mut trz_buffer) -> trz_result {
    // SAFETY: pointers to live values.
    unsafe { trz_view_show(session.0, c"depth".as_ptr(), buffer) }
}

#[test]
fn a_buffer_shows_what_is_new() {
    let (session, camera) = scene();
    let (mut data, clear) = ([9; 32], [0.2f64]);
    let mut to = trz_buffer {
        clear: clear.as_ptr().cast(),
        clear_type: TRZ_NUMBERS_FLOAT64,
        clear_count: 1,
        ..buffer(&mut data)
    };
    ok(show(&session, &mut to));
    assert_eq!((data, to.filled, to.render), ([51; 32], 1, 0));
    let settings = small_settings(2);
    let depth = [c"depth".as_ptr()];
    let view = trz_view {
        camera,
        ..view(&settings, &depth)
    };
    ok(render(&session, &view, &[]));
    converge(&session);
    ok(show(&session, &mut to));
    assert_eq!((to.render, to.samples, to.ended), (1, 2, 1));
    // What it shows already is not written again.
    assert_ne!(data, [51; 32]);
    data.fill(9);
    ok(show(&session, &mut to));
    assert_eq!(data, [9; 32]);
    to.render = 0;
    ok(show(&session, &mut to));
    assert_ne!(data, [9; 32]);
    // Clear values of any type of numbers.
    let (half, whole) = ([0x3800u16], [1u64]);
    for (clear, clear_type, byte) in [
        (
            half.as_ptr().cast::<std::ffi::c_void>(),
            TRZ_NUMBERS_FLOAT16,
            128,
        ),
        (whole.as_ptr().cast(), TRZ_NUMBERS_UINT64, 255),
    ] {
        let mut data = [9; 32];
        let mut to = trz_buffer {
            clear,
            clear_type,
            clear_count: 1,
            origin: [1000, 0],
            ..buffer(&mut data)
        };
        ok(show(&session, &mut to));
        assert_eq!(data, [byte; 32]);
    }
    for wrong in [
        trz_buffer {
            components: 5,
            ..to
        },
        trz_buffer {
            components: 0,
            ..to
        },
        trz_buffer { component: 5, ..to },
        trz_buffer { bottom_up: 2, ..to },
        trz_buffer { filled: 2, ..to },
        trz_buffer {
            clear_type: 77,
            ..to
        },
    ] {
        fails(show(&session, &mut { wrong }), TRZ_ERROR_INVALID_ARGUMENT);
    }
    for small in [
        trz_buffer { bytes: 31, ..to },
        trz_buffer { height: 2, ..to },
        trz_buffer {
            width: u32::MAX,
            height: u32::MAX,
            components: 4,
            ..to
        },
    ] {
        fails(show(&session, &mut { small }), TRZ_ERROR_BUFFER_TOO_SMALL);
    }
}
