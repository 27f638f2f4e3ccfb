//! Image files of a render.

use std::ffi::{CString, c_char};
use std::fs;
use std::path::Path;
use std::ptr::null;

use hdtrapeze::*;

use crate::support::*;

fn rendered() -> Session {
    let session = Session::with_camera();
    session.square("/square", 0.0);
    let names = [c"color".as_ptr(), c"primId".as_ptr(), c"depth".as_ptr()];
    // SAFETY: pointers to live values.
    ok(unsafe { trz_session_set_aovs(session.0, names.as_ptr(), 3) });
    ok(session.start());
    assert!(session.wait(-1.0));
    session
}

fn image(kind: u32) -> trz_image {
    trz_image {
        struct_size: size_of::<trz_image>() as u32,
        r#type: kind,
        pixel_type: TRZ_PIXEL_HALF,
        compression: TRZ_COMPRESSION_ZIP,
        color: TRZ_COLOR_SRGB,
        aovs: null(),
        aov_count: 0,
        metadata: null(),
        metadata_count: 0,
        vars: null(),
        var_count: 0,
        partial: 0,
    }
}

fn write(session: &Session, path: &Path, image: &trz_image) -> trz_result {
    let path = CString::new(path.to_str().unwrap()).unwrap();
    // SAFETY: pointers to live values.
    unsafe { trz_image_write(session.0, path.as_ptr(), image) }
}

fn contains(bytes: &[u8], part: &str) -> bool {
    bytes.windows(part.len()).any(|w| w == part.as_bytes())
}

#[test]
fn the_scene_as_text() {
    let (session, folder) = (rendered(), Folder::new("scene"));
    let (mut needed, mut text) = (0, [0; 1 << 16]);
    let (path, file) = (
        CString::new(folder.0.to_str().unwrap()).unwrap(),
        folder.0.join("scene.txt"),
    );
    let file_path = CString::new(file.to_str().unwrap()).unwrap();
    fs::write(&file, "before").unwrap();
    // SAFETY: pointers to live values.
    unsafe {
        ok(trz_scene_dump(
            session.0,
            text.as_mut_ptr().cast(),
            text.len(),
            &mut needed,
        ));
        ok(trz_scene_write(session.0, file_path.as_ptr()));
        let told = fails(
            trz_scene_write(session.0, path.as_ptr()),
            TRZ_ERROR_INVALID_ARGUMENT,
        );
        assert!(told.contains("not a regular file"), "{told}");
    }
    assert_eq!(fs::read(&file).unwrap(), text[..needed - 1]);
}

#[test]
fn exr_and_png() {
    let (session, folder) = (rendered(), Folder::new("files"));
    let exr = folder.0.join("image.exr");
    let pairs: [*const c_char; 4] = [
        c"frame".as_ptr(),
        c"12.5".as_ptr(),
        c"software".as_ptr(),
        c"a test".as_ptr(),
    ];
    let with_metadata = trz_image {
        metadata: pairs.as_ptr(),
        metadata_count: 4,
        ..image(TRZ_IMAGE_EXR)
    };
    ok(write(&session, &exr, &with_metadata));
    let bytes = fs::read(&exr).unwrap();
    assert_eq!(bytes[..4], [0x76, 0x2f, 0x31, 0x01], "OpenEXR's magic");
    for name in [
        "hdtrapeze/camera",
        "/camera",
        "hdtrapeze/samplesDone",
        "frame",
        "a test",
    ] {
        assert!(contains(&bytes, name), "{name}");
    }
    assert!(contains(&bytes, "primId.X") && contains(&bytes, "depth.Z"));

    let png = folder.0.join("image.png");
    ok(write(&session, &png, &image(TRZ_IMAGE_PNG)));
    assert_eq!(&fs::read(&png).unwrap()[1..4], b"PNG");
}

#[test]
fn failures_leave_what_was_there() {
    let (session, folder) = (rendered(), Folder::new("failures"));
    let (exr, png) = (image(TRZ_IMAGE_EXR), image(TRZ_IMAGE_PNG));
    let file = folder.0.join("kept");
    fs::write(&file, "before").unwrap();
    let names = [c"color".as_ptr(), c"depth".as_ptr()];
    let two = trz_image {
        aovs: names.as_ptr(),
        aov_count: 2,
        ..png
    };
    fails(write(&session, &file, &two), TRZ_ERROR_INVALID_ARGUMENT);
    let ids = [c"primId".as_ptr()];
    let integers = trz_image {
        aovs: ids.as_ptr(),
        aov_count: 1,
        ..png
    };
    fails(
        write(&session, &file, &integers),
        TRZ_ERROR_INVALID_ARGUMENT,
    );
    let unknown = [c"normal".as_ptr()];
    let absent = trz_image {
        aovs: unknown.as_ptr(),
        aov_count: 1,
        ..exr
    };
    fails(write(&session, &file, &absent), TRZ_ERROR_NOT_FOUND);
    assert_eq!(fs::read_to_string(&file).unwrap(), "before");

    let nowhere = folder.0.join("no such folder").join("image.exr");
    let message = fails(write(&session, &nowhere, &exr), TRZ_ERROR_IO);
    assert!(message.contains("no such folder"), "{message}");
    fails(
        write(&session, Path::new(""), &exr),
        TRZ_ERROR_INVALID_ARGUMENT,
    );
    let changes: [fn(&mut trz_image); 5] = [
        |i| i.r#type = 2,
        |i| i.pixel_type = 2,
        |i| i.compression = 5,
        |i| i.color = 2,
        |i| i.metadata_count = 1,
    ];
    for change in changes {
        let mut bad = exr;
        change(&mut bad);
        fails(write(&session, &file, &bad), TRZ_ERROR_INVALID_ARGUMENT);
    }
    let none = Session::with_camera();
    fails(write(&none, &file, &exr), TRZ_ERROR_NOT_FOUND);
}

#[test]
fn render_vars_are_layers() {
    let (session, folder) = (rendered(), Folder::new("vars"));
    let vars = [
        render_var(c"/Render/Vars/color".as_ptr()),
        trz_render_var {
            source_name: c"id".as_ptr(),
            data_type: c"float".as_ptr(),
            ..render_var(c"/Render/Vars/objects".as_ptr())
        },
        trz_render_var {
            source_name: c"depth".as_ptr(),
            name: c"far".as_ptr(),
            ..render_var(c"/Render/Vars/x".as_ptr())
        },
    ];
    for (var, expected) in vars.iter().zip(["color", "primId", "depth"]) {
        let (mut name, mut needed) = ([0 as c_char; 16], 0);
        // SAFETY: pointers to live values.
        ok(unsafe {
            trz_render_var_aov(session.0, var, name.as_mut_ptr(), name.len(), &mut needed)
        });
        assert_eq!(needed, expected.len() + 1);
        // SAFETY: filled with a text and its NUL.
        let name = unsafe { std::ffi::CStr::from_ptr(name.as_ptr()) };
        assert_eq!(name.to_str().unwrap(), expected);
    }
    let product = trz_image {
        vars: vars.as_ptr(),
        var_count: vars.len(),
        ..image(TRZ_IMAGE_EXR)
    };
    let exr = folder.0.join("product.exr");
    ok(write(&session, &exr, &product));
    let bytes = fs::read(&exr).unwrap();
    assert!(contains(&bytes, "objects.X") && contains(&bytes, "far.Z"));
    assert!(!contains(&bytes, "primId") && !contains(&bytes, "depth."));

    let names = [c"color".as_ptr()];
    let both = trz_image {
        aovs: names.as_ptr(),
        aov_count: 1,
        ..product
    };
    fails(write(&session, &exr, &both), TRZ_ERROR_INVALID_ARGUMENT);
    let png = trz_image {
        r#type: TRZ_IMAGE_PNG,
        ..product
    };
    ok(write(&session, &folder.0.join("product.png"), &png));
    let no_color = trz_image {
        vars: &vars[2],
        var_count: 1,
        ..png
    };
    let message = fails(write(&session, &exr, &no_color), TRZ_ERROR_INVALID_ARGUMENT);
    assert!(message.contains("color"), "{message}");
    let absent = render_var(c"/Render/Vars/normal".as_ptr());
    let absent = trz_image {
        vars: &absent,
        var_count: 1,
        ..product
    };
    fails(write(&session, &exr, &absent), TRZ_ERROR_NOT_FOUND);
    assert_eq!(fs::read(&exr).unwrap(), bytes);
}
