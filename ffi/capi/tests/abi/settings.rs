//! Settings by name.

use std::ffi::{CStr, CString, c_char};

use hdtrapeze::*;

use crate::support::*;

fn described() -> Vec<trz_setting> {
    let mut all = Vec::new();
    loop {
        // SAFETY: all zero bytes are a valid value of this struct.
        let mut setting: trz_setting = unsafe { std::mem::zeroed() };
        setting.struct_size = size_of::<trz_setting>() as u32;
        // SAFETY: a pointer to a live value.
        let result = unsafe { trz_setting_describe(all.len(), &mut setting) };
        if result == TRZ_ERROR_NOT_FOUND {
            return all;
        }
        ok(result);
        all.push(setting);
    }
}

fn set(settings: &mut trz_settings, name: &CStr, value: trz_value) -> trz_result {
    // SAFETY: pointers to live values.
    unsafe { trz_settings_set(settings, name.as_ptr(), &value) }
}

fn name(setting: &trz_setting) -> &'static CStr {
    // SAFETY: a text of the library, valid for ever.
    unsafe { CStr::from_ptr(setting.name) }
}

fn whole(integer: i64) -> trz_value {
    trz_value {
        kind: TRZ_VALUE_INTEGER,
        integer,
        ..NO_VALUE
    }
}

fn flag(integer: i64) -> trz_value {
    trz_value {
        kind: TRZ_VALUE_BOOL,
        integer,
        ..NO_VALUE
    }
}

fn real(number: f64) -> trz_value {
    trz_value {
        kind: TRZ_VALUE_REAL,
        numbers: [number, 0.0],
        ..NO_VALUE
    }
}

fn pair(numbers: [f64; 2]) -> trz_value {
    trz_value {
        kind: TRZ_VALUE_PAIR,
        numbers,
        ..NO_VALUE
    }
}

fn text(text: &CStr) -> trz_value {
    trz_value {
        kind: TRZ_VALUE_TEXT,
        text: text.as_ptr(),
        ..NO_VALUE
    }
}

/// The fields that settings with names set.
fn fields(s: &trz_settings) -> impl PartialEq + std::fmt::Debug + use<> {
    let numbers = [
        s.samples,
        s.filter,
        s.override_shutter,
        s.disable_motion_blur,
        s.disable_defocus,
        s.camera_light,
        s.curves,
        s.cull,
        s.seed,
        s.threads,
        s.backend,
        s.compression,
        s.pixel_type,
    ];
    let sizes = [s.shading_rate, s.filter_width];
    let shutter = [s.shutter_open, s.shutter_close, s.time_codes_per_second];
    (numbers, sizes, shutter, s.max_micropolygons)
}

#[test]
fn fallbacks_are_the_defaults() {
    let all = described();
    assert_eq!(all.len(), 20);
    assert_eq!(all.iter().filter(|s| !s.label.is_null()).count(), 17);
    for setting in all {
        let mut settings = settings_default();
        let name = name(&setting);
        if setting.fallback.kind == TRZ_VALUE_NONE {
            assert!(
                setting.label.is_null(),
                "{name:?} is shown, and has no value"
            );
            fails(
                set(&mut settings, name, NO_VALUE),
                TRZ_ERROR_INVALID_ARGUMENT,
            );
            continue;
        }
        ok(set(&mut settings, name, setting.fallback));
        // Where 0 stands for the default, or nobody has told.
        settings.max_micropolygons = settings_default().max_micropolygons;
        settings.time_codes_per_second = 0.0;
        // Nothing while the camera's is not overridden.
        [settings.shutter_open, settings.shutter_close] = [0.0; 2];
        assert_eq!(fields(&settings), fields(&settings_default()), "{name:?}");
    }
}

#[test]
fn every_setting_changes_its_field_alone() {
    let values = [
        whole(3),
        real(0.5),
        text(c"mitchell"),
        whole(3),
        flag(1),
        real(-1.0),
        real(1.0),
        pair([-0.5, 0.5]),
        flag(1),
        flag(1),
        flag(0),
        text(c"tubes"),
        text(c"backUnlessDoubleSided"),
        whole(1000),
        whole(u32::MAX.into()),
        whole(2),
        text(c"cpu"),
        whole(30),
        text(c"piz"),
        text(c"float"),
    ];
    let mut expected = settings_default();
    let changes: [fn(&mut trz_settings); 20] = [
        |s| s.samples = 3,
        |s| s.shading_rate = 0.5,
        |s| s.filter = TRZ_FILTER_MITCHELL,
        |s| s.filter_width = 3.0,
        |s| s.override_shutter = 1,
        |s| s.shutter_open = -1.0,
        |s| s.shutter_close = 1.0,
        |s| [s.shutter_open, s.shutter_close] = [-0.5, 0.5],
        |s| s.disable_motion_blur = 1,
        |s| s.disable_defocus = 1,
        |s| s.camera_light = 0,
        |s| s.curves = TRZ_CURVES_TUBES,
        |s| s.cull = TRZ_CULL_BACK_UNLESS_DOUBLE_SIDED,
        |s| s.max_micropolygons = 1000,
        |s| s.seed = u32::MAX,
        |s| s.threads = 2,
        |s| s.backend = TRZ_BACKEND_CPU,
        |s| s.time_codes_per_second = 30.0,
        |s| s.compression = TRZ_COMPRESSION_PIZ,
        |s| s.pixel_type = TRZ_PIXEL_FLOAT,
    ];
    let mut settings = settings_default();
    for ((setting, value), change) in described().iter().zip(values).zip(changes) {
        let before = fields(&settings);
        ok(set(&mut settings, name(setting), value));
        change(&mut expected);
        assert_eq!(fields(&settings), fields(&expected), "{:?}", name(setting));
        assert_ne!(fields(&settings), before, "{:?}", name(setting));
    }
    // What names can say, a session takes.
    let session = Session::new();
    // SAFETY: pointers to live values.
    ok(unsafe { trz_session_set_settings(session.0, &settings) });
}

#[test]
fn what_cannot_be_is_told_and_changes_nothing() {
    let mut settings = settings_default();
    for (name, value, why) in [
        (c"trapeze:samples", whole(0), "it must be from 1 to 1048576"),
        (c"trapeze:samples", real(2.0), "it must be a whole number"),
        (c"trapeze:samples", flag(1), "it must be a whole number"),
        (
            c"trapeze:seed",
            whole(-1),
            "it must be from 0 to 4294967295",
        ),
        (
            c"trapeze:shadingRate",
            real(-1.0),
            "it must be from 0.01 to 1000",
        ),
        (
            c"trapeze:shadingRate",
            real(f64::NAN),
            "it must be from 0.01 to 1000",
        ),
        (c"trapeze:shadingRate", text(c"1"), "it must be a number"),
        (c"trapeze:cameraLight", whole(1), "it must be true or false"),
        (
            c"trapeze:curves",
            text(c"box"),
            "it must be one of auto, ribbons, tubes",
        ),
        (
            c"trapeze:curves",
            NO_VALUE,
            "it must be one of auto, ribbons, tubes",
        ),
        (c"trapeze:shutter", real(1.0), "it must be 2 numbers"),
        (
            c"trapeze:shutter",
            pair([1.0, 0.5]),
            "the shutter closes before it opens",
        ),
        (
            c"trapeze:shutter",
            pair([0.0, f64::INFINITY]),
            "the shutter is absurdly long",
        ),
    ] {
        let told = fails(set(&mut settings, name, value), TRZ_ERROR_INVALID_ARGUMENT);
        assert_eq!(told, why, "{name:?}");
    }
    fails(
        set(&mut settings, c"trapeze:nonsense", whole(1)),
        TRZ_ERROR_NOT_FOUND,
    );
    fails(
        set(&mut settings, c"trapeze:cameraLight", flag(2)),
        TRZ_ERROR_INVALID_ARGUMENT,
    );
    let unknown = trz_value {
        kind: 77,
        ..NO_VALUE
    };
    fails(
        set(&mut settings, c"trapeze:samples", unknown),
        TRZ_ERROR_INVALID_ARGUMENT,
    );
    let no_text = trz_value {
        kind: TRZ_VALUE_TEXT,
        ..NO_VALUE
    };
    fails(
        set(&mut settings, c"trapeze:curves", no_text),
        TRZ_ERROR_NULL_POINTER,
    );
    assert_eq!(fields(&settings), fields(&settings_default()));
}

#[test]
fn what_is_described_is_what_can_be() {
    // SAFETY: a text of the library, valid for ever.
    let of_library = |text: *const c_char| unsafe { CStr::from_ptr(text) }.to_str().unwrap();
    for setting in described() {
        let name = name(&setting);
        let result = |value| set(&mut settings_default(), name, value);
        let can_be = |value| assert_eq!(result(value), TRZ_OK, "{name:?}");
        let cannot_be = |value| assert_eq!(result(value), TRZ_ERROR_INVALID_ARGUMENT, "{name:?}");
        let [least, most] = setting.range;
        match setting.kind {
            TRZ_VALUE_BOOL => can_be(flag(0)),
            TRZ_VALUE_INTEGER => {
                can_be(whole(least as i64));
                can_be(whole(most as i64));
                cannot_be(whole(least as i64 - 1));
                if most < 1e18 {
                    cannot_be(whole(most as i64 + 1));
                }
            }
            TRZ_VALUE_REAL => {
                can_be(real(least));
                can_be(real(most));
                cannot_be(real(least - 1.0));
                cannot_be(real(most + 1.0));
            }
            TRZ_VALUE_TEXT => {
                let words: Vec<_> = of_library(setting.words).split(' ').collect();
                assert!(words.len() > 1, "{name:?}");
                for word in words {
                    can_be(text(&CString::new(word).unwrap()));
                }
                cannot_be(text(setting_words(&setting)));
            }
            TRZ_VALUE_PAIR => {
                can_be(pair([least, most]));
                cannot_be(pair([least - 1.0, most]));
            }
            other => panic!("{name:?} is of the kind {other}"),
        }
        assert_eq!(
            setting.words.is_null(),
            setting.kind != TRZ_VALUE_TEXT,
            "{name:?}"
        );
        assert!(!of_library(setting.doc).is_empty(), "{name:?}");
        if setting.fallback.kind != TRZ_VALUE_NONE {
            assert_eq!(setting.fallback.kind, setting.kind, "{name:?}");
        }
    }
}

/// All words at once, which are none.
fn setting_words(setting: &trz_setting) -> &'static CStr {
    // SAFETY: a text of the library, valid for ever.
    unsafe { CStr::from_ptr(setting.words) }
}
