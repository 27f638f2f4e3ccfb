//! What is made of render products, for hosts that write them by themselves.

use std::ffi::{CStr, CString, c_char};
use std::ptr::{null, null_mut};

use hdtrapeze::*;

use crate::support::*;

struct Plan(*mut trz_plan);

impl Drop for Plan {
    fn drop(&mut self) {
        // SAFETY: a plan that lives, or null.
        unsafe { trz_plan_destroy(self.0) };
    }
}

/// A planned file with its texts.
#[derive(Debug, PartialEq)]
struct File {
    result: trz_result,
    why: String,
    path: String,
    render: u32,
    aovs: Vec<String>,
    size: [u32; 2],
    window: [i32; 4],
    pixel_aspect: f32,
    policy: u32,
}

fn of_library(text: *const c_char) -> String {
    match text.is_null() {
        true => String::new(),
        // SAFETY: a text of a plan that lives.
        false => unsafe { CStr::from_ptr(text) }.to_str().unwrap().to_owned(),
    }
}

fn plan(session: &Session, view: &trz_view, products: &[trz_product]) -> Vec<File> {
    let pointers: Vec<_> = products.iter().map(|product| &raw const *product).collect();
    let mut plan = Plan(null_mut());
    // SAFETY: pointers to live values.
    ok(unsafe {
        trz_plan_create(
            session.0,
            view,
            pointers.as_ptr(),
            pointers.len(),
            &mut plan.0,
        )
    });
    let mut files = Vec::new();
    loop {
        let mut file = planned();
        // SAFETY: pointers to live values.
        let result = unsafe { trz_plan_describe(plan.0, files.len(), &mut file) };
        if result == TRZ_ERROR_NOT_FOUND {
            assert_eq!(files.len(), products.len() + 1);
            return files;
        }
        ok(result);
        let mut aovs = Vec::new();
        for i in 0..file.aov_count as usize {
            // SAFETY: so many names are there.
            aovs.push(of_library(unsafe { *file.aovs.add(i) }));
        }
        // SAFETY: settings of a plan that lives, or null.
        let settings = unsafe { file.settings.as_ref() }.copied();
        let settings = settings.unwrap_or(trz_settings {
            width: 0,
            height: 0,
            pixel_aspect: 0.0,
            window_policy: 0,
            ..settings_default()
        });
        files.push(File {
            result: file.result,
            why: of_library(file.why),
            path: of_library(file.path),
            render: file.render,
            aovs,
            size: [settings.width, settings.height],
            window: settings.data_window,
            pixel_aspect: settings.pixel_aspect,
            policy: settings.window_policy,
        });
    }
}

#[test]
fn files_renders_and_refusals() {
    let session = Session::with_camera();
    let camera = session.camera("/c");
    let (settings, color) = (settings_default(), [c"color".as_ptr()]);
    let own = trz_view {
        camera,
        path: c"/tmp/a.0007.exr".as_ptr(),
        ..view(&settings, &color)
    };
    let of = |path: &'static CStr, name: &CStr| trz_product {
        name: name.as_ptr(),
        camera,
        ..product(path.as_ptr(), &settings)
    };
    let folder = std::env::temp_dir().join(format!("hdtrapeze-{}.exr", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let folder_name = CString::new(folder.to_str().unwrap()).unwrap();
    let var = trz_render_var {
        source_name: c"depth".as_ptr(),
        ..render_var(c"/depth".as_ptr())
    };
    let products = [
        of(c"/a", c"/tmp/a.####.exr"),
        trz_product {
            vars: &var,
            var_count: 1,
            ..of(c"/b", c"/tmp/b.exr")
        },
        trz_product {
            resolution: [9, 9],
            ..of(c"/c", c"/tmp/c.png")
        },
        of(c"/again", c"/tmp/../tmp/b.exr"),
        trz_product {
            r#type: c"deep".as_ptr(),
            ..of(c"/deep", c"/tmp/deep.exr")
        },
        of(c"/lost", c"/no such folder/a.exr"),
        of(c"/folder", &folder_name),
        trz_product {
            var_target_count: 1,
            ..of(c"/none", c"/tmp/none.exr")
        },
        of(c"/closed", c"/proc/a.exr"),
    ];
    let files = plan(&session, &own, &products);
    let results: Vec<_> = files
        .iter()
        .map(|file| (file.result, file.render))
        .collect();
    let invalid = (TRZ_ERROR_INVALID_ARGUMENT, 0);
    assert_eq!(
        results,
        [
            (TRZ_OK, 0),
            (TRZ_OK, 0),
            (TRZ_OK, 1),
            invalid,
            (TRZ_ERROR_UNSUPPORTED, 0),
            (TRZ_ERROR_IO, 0),
            (TRZ_ERROR_IO, 0),
            invalid,
            (TRZ_ERROR_IO, 0),
            invalid,
        ]
    );
    assert_eq!(files[0].path, "/tmp/a.0007.exr");
    assert_eq!(files[0].aovs, ["color", "depth"]);
    assert_eq!((files[1].size, files[2].size), ([16, 8], [9, 9]));
    assert_eq!(files[3].why, "/tmp/../tmp/b.exr is already written by /b");
    assert_eq!(files[5].why, "the folder /no such folder does not exist");
    assert!(files[6].why.ends_with(" is a folder"), "{:?}", files[6]);
    assert_eq!(files[8].why, "the folder /proc is not writable");
    assert_eq!(files[9].why, "/tmp/a.0007.exr is already written by /a");
    std::fs::remove_dir(&folder).unwrap();
    // Without a file of that name it is the last render.
    let own = trz_view {
        path: null(),
        ..own
    };
    let own = plan(&session, &own, &products).pop().unwrap();
    assert_eq!((own.result, own.render, own.path.as_str()), (TRZ_OK, 2, ""));
}

#[test]
fn shapes_of_settings() {
    let session = Session::with_camera();
    let camera = session.camera("/c");
    let (settings, color) = (settings_default(), [c"color".as_ptr()]);
    let own = trz_view {
        camera,
        camera_aspect: 2.0,
        settings_path: c"/set".as_ptr(),
        resolution: [0, 20],
        data_window: [0.0, 0.0, 0.5, 1.0],
        pixel_aspect: -1.0,
        conform: c"adjustApertureHeight".as_ptr(),
        shapes_view: 1,
        windows_view: 1,
        has_resolution: 1,
        has_data_window: 1,
        has_pixel_aspect: 1,
        ..view(&settings, &color)
    };
    let wrong = trz_product {
        name: c"/tmp/a.exr".as_ptr(),
        camera,
        resolution: [4, 70_000],
        data_window: [0.0; 4],
        pixel_aspect: f32::NAN,
        conform: c"bend".as_ptr(),
        ..product(c"/wrong".as_ptr(), &settings)
    };
    let received = Received::default();
    listen(&session, &received, TRZ_LOG_WARN);
    let files = plan(&session, &own, &[wrong]);
    for file in &files {
        assert_eq!(file.size, [2048, 1080]);
        assert_eq!(file.window, [0, 0, 1024, 1080]);
        assert_eq!(file.pixel_aspect, 1.0);
        assert_eq!(file.policy, TRZ_WINDOW_MATCH_HORIZONTALLY);
    }
    let told = received.take();
    let of = |prim: &str| {
        let mut texts: Vec<_> = told.iter().filter(|told| told.1 == prim).collect();
        texts.retain(|told| told.3.contains("cannot be"));
        texts
    };
    assert_eq!(of("/set").len(), 2, "{told:?}");
    assert_eq!(of("/wrong").len(), 4, "{told:?}");
    // Two of the settings' cannot be either, and so are as the schema has them.
    for used in [
        "pixels; (2048, 1080) is used",
        "1000; 1 is used",
        "adjustPixelAspectRatio; adjustApertureHeight is used",
        "ymax; (0, 0, 0.5, 1) is used",
    ] {
        let found = of("/wrong").iter().any(|told| told.3.ends_with(used));
        assert!(found, "{used}: {told:?}");
    }
    // What is not asked for stays.
    let own = trz_view {
        shapes_view: 0,
        windows_view: 0,
        ..own
    };
    let files = plan(&session, &own, &[]);
    assert_eq!(files[0].size, [settings.width, settings.height]);
    assert_eq!(files[0].window, [0; 4]);
    let empty = trz_view {
        data_window: [0.5, 0.0, 0.5001, 1.0],
        resolution: [16, 8],
        windows_view: 1,
        ..own
    };
    let files = plan(&session, &empty, &[]);
    assert_eq!(files[0].result, TRZ_ERROR_INVALID_ARGUMENT);
    assert!(files[0].why.contains("holds no pixel"), "{files:?}");
}

#[test]
fn zeros_are_told_where_they_are_known() {
    let session = Session::with_camera();
    let camera = session.camera("/c");
    let (settings, color) = (settings_default(), [c"color".as_ptr()]);
    let unknown = trz_view {
        camera,
        settings_path: c"/set".as_ptr(),
        shapes_view: 1,
        windows_view: 1,
        ..view(&settings, &color)
    };
    let same = trz_product {
        name: c"/tmp/a.exr".as_ptr(),
        camera,
        resolution: [0; 2],
        data_window: [0.0; 4],
        pixel_aspect: 0.0,
        conform: c"".as_ptr(),
        ..product(c"/same".as_ptr(), &settings)
    };
    let received = Received::default();
    listen(&session, &received, TRZ_LOG_WARN);
    let told = |prim: &str| {
        let mut told = received.take();
        told.retain(|told| told.1 == prim && told.3.contains("cannot be"));
        told.len()
    };
    let files = plan(&session, &unknown, &[same]);
    assert_eq!(told("/same"), 4, "none is the settings'");
    for file in &files {
        assert_eq!(file.size, [settings.width, settings.height]);
        assert_eq!(file.window, [0; 4]);
    }
    let known = trz_view {
        has_resolution: 1,
        has_data_window: 1,
        has_pixel_aspect: 1,
        conform: c"".as_ptr(),
        ..unknown
    };
    for told_now in [4, 0] {
        let files = plan(&session, &known, &[same]);
        assert_eq!(told("/set"), told_now);
        for file in &files {
            assert_eq!(file.size, [2048, 1080]);
            assert_eq!((file.window, file.pixel_aspect), ([0; 4], 1.0));
            assert_eq!(file.policy, TRZ_WINDOW_FIT);
        }
    }
}

#[test]
fn frames_that_replace_each_other_are_told() {
    let session = Session::with_camera();
    let camera = session.camera("/c");
    let settings = settings_default();
    let received = Received::default();
    listen(&session, &received, TRZ_LOG_WARN);
    for (frame, name) in [
        (1.0, "a"),
        (1.0, "a"),
        (1.0, "b.#"),
        (2.0, "b.#"),
        (2.0, "a"),
    ] {
        let name = CString::new(format!("/tmp/{name}.exr")).unwrap();
        let own = trz_view {
            camera,
            frame,
            ..view(&settings, &[])
        };
        let product = trz_product {
            name: name.as_ptr(),
            camera,
            ..product(c"/product".as_ptr(), &settings)
        };
        plan(&session, &own, &[product]);
    }
    let told = received.take();
    let replaced: Vec<_> = told
        .iter()
        .filter(|told| told.3.contains("each frame replaces"))
        .collect();
    assert_eq!(replaced.len(), 1, "{told:?}");
    assert!(replaced[0].3.contains("/tmp/a.exr"), "{told:?}");
}

#[test]
fn data_windows_are_pixels() {
    let window = |ndc: [f32; 4], width| {
        let mut out = [7; 4];
        // SAFETY: pointers to four numbers.
        let result = unsafe { trz_data_window(ndc.as_ptr(), width, 50, out.as_mut_ptr()) };
        (result, out)
    };
    assert_eq!(window([0.0, 0.0, 1.0, 1.0], 100), (TRZ_OK, [0; 4]));
    assert_eq!(
        window([0.25, 0.5, 0.75, 1.5], 100),
        (TRZ_OK, [25, -25, 75, 25])
    );
    assert_eq!(window([0.0; 4], 100), (TRZ_ERROR_INVALID_ARGUMENT, [7; 4]));
    assert_eq!(
        window([0.0, 0.0, 1.0, 1.0], 0),
        (TRZ_ERROR_INVALID_ARGUMENT, [7; 4])
    );
    assert_eq!(
        window([0.5, 0.0, 0.5001, 1.0], 100),
        (TRZ_ERROR_NOT_FOUND, [7; 4])
    );
    assert_eq!(
        window([0.0, 0.0, 99.0, 1.0], 65_536),
        (TRZ_ERROR_NOT_FOUND, [7; 4])
    );
}
