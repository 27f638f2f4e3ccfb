//! Settings by name, one table for all hosts: `trz_setting_describe`, `trz_settings_set`.

use std::ffi::{CStr, c_char};
use std::ops::RangeInclusive;
use std::ptr::null;

use hdtrapeze_core::diagnostics::number;

use crate::constants::*;
use crate::fault::{Fault, call};
use crate::input;
use crate::types::*;

/// Times beyond this are a mistake.
const LONGEST: f64 = 1e6;

/// Fills out, whose struct_size the caller has set, with a setting that has a name. They are numbered from
/// 0 on, in the order in which hosts show them.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size), TRZ_ERROR_NOT_FOUND (there
/// are not so many). Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_setting_describe(index: usize, out: *mut trz_setting) -> trz_result {
    call(|| {
        let setting = SETTINGS.get(index).ok_or_else(|| {
            let text = format!("there are {} settings with names", SETTINGS.len());
            Fault::new(TRZ_ERROR_NOT_FOUND, text)
        })?;
        // SAFETY: the caller passes null or a struct of the size it tells.
        unsafe { input::write(out, setting.to_c(), "out") }
    })
}

/// Sets the fields of settings that a setting's name stands for. Where the value cannot be they stay, and
/// trz_last_error tells what "it must be".
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_NOT_FOUND (name), TRZ_ERROR_INVALID_ARGUMENT. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_settings_set(
    settings: *mut trz_settings,
    name: *const c_char,
    value: *const trz_value,
) -> trz_result {
    call(|| {
        // SAFETY: the caller passes null or valid pointers.
        unsafe {
            let mut changed = input::read(settings.cast_const(), "settings")?;
            let name = input::text(name, "name")?;
            let value = Value::new(&input::slice(value, 1, "value")?[0])?;
            let known = |setting: &&Setting| setting.name.to_bytes() == name.as_bytes();
            let setting = SETTINGS
                .iter()
                .find(known)
                .ok_or_else(|| Fault::new(TRZ_ERROR_NOT_FOUND, format!("{name} is no setting")))?;
            let value = setting.kind.check(&value).map_err(Fault::invalid)?;
            (setting.set)(&mut changed, value);
            input::write(settings, changed, "settings")
        }
    })
}

#[derive(Clone, Copy)]
enum Value<'a> {
    None,
    Bool(bool),
    Integer(i64),
    Real(f64),
    Text(&'a CStr),
    Pair([f64; 2]),
}

impl Value<'_> {
    /// Safety: the text is null or as the header says.
    unsafe fn new(from: &trz_value) -> Result<Self, Fault> {
        Ok(match from.kind {
            TRZ_VALUE_NONE => Value::None,
            TRZ_VALUE_BOOL => Value::Bool(match from.integer {
                0 => false,
                1 => true,
                other => return Err(Fault::invalid(format!("integer is {other}, not 0 or 1"))),
            }),
            TRZ_VALUE_INTEGER => Value::Integer(from.integer),
            TRZ_VALUE_REAL => Value::Real(from.numbers[0]),
            TRZ_VALUE_TEXT if from.text.is_null() => return Err(Fault::null("text")),
            // SAFETY: not null; as the caller promises.
            TRZ_VALUE_TEXT => Value::Text(unsafe { CStr::from_ptr(from.text) }),
            TRZ_VALUE_PAIR => Value::Pair(from.numbers),
            other => return Err(Fault::invalid(format!("kind {other} is not known"))),
        })
    }

    fn to_c(self) -> trz_value {
        let mut value = trz_value {
            kind: TRZ_VALUE_NONE,
            integer: 0,
            numbers: [0.0; 2],
            text: null(),
        };
        match self {
            Value::None => {}
            Value::Bool(flag) => (value.kind, value.integer) = (TRZ_VALUE_BOOL, flag.into()),
            Value::Integer(whole) => (value.kind, value.integer) = (TRZ_VALUE_INTEGER, whole),
            Value::Real(real) => (value.kind, value.numbers[0]) = (TRZ_VALUE_REAL, real),
            Value::Text(text) => (value.kind, value.text) = (TRZ_VALUE_TEXT, text.as_ptr()),
            Value::Pair(pair) => (value.kind, value.numbers) = (TRZ_VALUE_PAIR, pair),
        }
        value
    }
}

/// What a setting can be.
enum Kind {
    Flag,
    Whole(RangeInclusive<i64>),
    Real(RangeInclusive<f64>),
    /// Words with spaces between, in the order of the ABI's constants from the number on.
    Word(&'static CStr, u32),
    /// Open and close.
    Shutter,
}

/// A value that can be: a flag, a whole number or a constant; a number or two.
#[derive(Clone, Copy, Default)]
struct Checked {
    whole: i64,
    numbers: [f64; 2],
}

impl Checked {
    /// The range of the setting has been checked.
    fn u32(self) -> u32 {
        self.whole as u32
    }

    fn f64(self) -> f64 {
        self.numbers[0]
    }
}

impl Kind {
    /// The value, or what "it must be".
    fn check(&self, value: &Value<'_>) -> Result<Checked, String> {
        let whole = |whole| Checked {
            whole,
            ..Checked::default()
        };
        match (self, *value) {
            (Kind::Flag, Value::Bool(flag)) => Ok(whole(flag.into())),
            (Kind::Flag, _) => Err("it must be true or false".to_owned()),
            (Kind::Whole(range), Value::Integer(given)) => match range.contains(&given) {
                true => Ok(whole(given)),
                false => Err(format!(
                    "it must be from {} to {}",
                    range.start(),
                    range.end()
                )),
            },
            (Kind::Whole(_), _) => Err("it must be a whole number".to_owned()),
            (Kind::Real(range), value) => Ok(Checked {
                numbers: [real(&value, range)?, 0.0],
                ..Checked::default()
            }),
            (Kind::Word(words, first), value) => {
                let words: Vec<_> = words.to_bytes().split(|&byte| byte == b' ').collect();
                let found = match value {
                    Value::Text(text) => words.iter().position(|word| *word == text.to_bytes()),
                    _ => None,
                };
                let found = found.map(|at| whole(i64::from(*first) + at as i64));
                found.ok_or_else(|| {
                    let words = words.join(&b", "[..]);
                    format!("it must be one of {}", String::from_utf8_lossy(&words))
                })
            }
            (Kind::Shutter, Value::Pair(numbers)) => Ok(Checked {
                numbers: shutter(numbers)?,
                ..Checked::default()
            }),
            (Kind::Shutter, _) => Err("it must be 2 numbers".to_owned()),
        }
    }
}

fn real(value: &Value<'_>, range: &RangeInclusive<f64>) -> Result<f64, String> {
    let real = match *value {
        Value::Integer(whole) => whole as f64,
        Value::Real(real) => real,
        _ => return Err("it must be a number".to_owned()),
    };
    // Hosts may hold it in 32 bits, where an end such as 0.01 is another number.
    let ends = *range.start() as f32..=*range.end() as f32;
    match range.contains(&real) || ends.contains(&(real as f32)) {
        true => Ok(real),
        false => Err(format!(
            "it must be from {} to {}",
            number(*range.start()),
            number(*range.end())
        )),
    }
}

fn shutter(shutter @ [open, close]: [f64; 2]) -> Result<[f64; 2], String> {
    // Also where one is no number.
    if !(INSTANTS.contains(&open) && INSTANTS.contains(&close)) {
        return Err("the shutter is absurdly long".to_owned());
    }
    match close < open {
        true => Err("the shutter closes before it opens".to_owned()),
        false => Ok(shutter),
    }
}

struct Setting {
    name: &'static CStr,
    label: Option<&'static CStr>,
    /// Of what it is for, as a help says it.
    doc: &'static CStr,
    kind: Kind,
    fallback: Value<'static>,
    of_prims: bool,
    set: fn(&mut trz_settings, Checked),
}

impl Setting {
    fn to_c(&self) -> trz_setting {
        let (kind, range) = match &self.kind {
            Kind::Flag => (TRZ_VALUE_BOOL, [0.0; 2]),
            Kind::Whole(range) => (
                TRZ_VALUE_INTEGER,
                [*range.start() as f64, *range.end() as f64],
            ),
            Kind::Real(range) => (TRZ_VALUE_REAL, [*range.start(), *range.end()]),
            Kind::Word(..) => (TRZ_VALUE_TEXT, [0.0; 2]),
            Kind::Shutter => (TRZ_VALUE_PAIR, [-LONGEST, LONGEST]),
        };
        trz_setting {
            struct_size: 0,
            of_prims: self.of_prims.into(),
            name: self.name.as_ptr(),
            label: self.label.map_or(null(), CStr::as_ptr),
            fallback: self.fallback.to_c(),
            kind,
            range,
            words: match self.kind {
                Kind::Word(words, _) => words.as_ptr(),
                _ => null(),
            },
            doc: self.doc.as_ptr(),
        }
    }
}

macro_rules! settings {
    ($($name:literal, $label:expr, $kind:expr, $fallback:expr, $of_prims:expr, $doc:literal,
        |$s:ident, $v:ident| $set:expr;)*) => {
        [$(Setting {
            name: $name,
            label: $label,
            doc: $doc,
            kind: $kind,
            fallback: $fallback,
            of_prims: $of_prims,
            set: |$s, $v| $set,
        }),*]
    };
}

/// Any instant that is no mistake.
const INSTANTS: RangeInclusive<f64> = -LONGEST..=LONGEST;

static SETTINGS: [Setting; 20] = settings! {
    c"trapeze:samples", Some(c"Samples per pixel"), Kind::Whole(1..=1 << 20), Value::Integer(64), true,
        c"samples a pixel; powers of 4 are the most even",
        |s, v| s.samples = v.u32();
    c"trapeze:shadingRate", Some(c"Shading rate (pixels)"), Kind::Real(0.01..=1000.0), Value::Real(1.0), true,
        c"micropolygon edge in pixels",
        |s, v| s.shading_rate = v.f64() as f32;
    c"trapeze:filter", Some(c"Pixel filter"),
        Kind::Word(c"box gaussian mitchell blackman-harris", TRZ_FILTER_BOX), Value::Text(c"gaussian"), true,
        c"pixel filter",
        |s, v| s.filter = v.u32();
    c"trapeze:filterWidth", Some(c"Filter width (pixels, 0: the filter's own)"),
        Kind::Real(0.0..=32.0), Value::Real(0.0), true,
        c"diameter of the filter in pixels; 0: the filter's own",
        |s, v| s.filter_width = v.f64() as f32;
    c"trapeze:overrideShutter", Some(c"Override the camera's shutter"), Kind::Flag, Value::Bool(false), false,
        c"shutterOpen and shutterClose in place of the camera's shutter",
        |s, v| s.override_shutter = v.u32();
    c"trapeze:shutterOpen", Some(c"Shutter open (frames)"), Kind::Real(INSTANTS), Value::Real(-0.25), false,
        c"when the shutter opens, in time codes relative to the frame",
        |s, v| s.shutter_open = v.f64();
    c"trapeze:shutterClose", Some(c"Shutter close (frames)"), Kind::Real(INSTANTS), Value::Real(0.25), false,
        c"when the shutter closes, in time codes relative to the frame",
        |s, v| s.shutter_close = v.f64();
    c"trapeze:shutter", None, Kind::Shutter, Value::None, true,
        c"open and close in time codes relative to the frame, in place of the camera's",
        |s, v| {
            [s.shutter_open, s.shutter_close] = v.numbers;
            s.override_shutter = 1;
        };
    c"trapeze:disableMotionBlur", Some(c"Disable motion blur"), Kind::Flag, Value::Bool(false), false,
        c"everything as at the frame's own time",
        |s, v| s.disable_motion_blur = v.u32();
    c"trapeze:disableDepthOfField", Some(c"Disable depth of field"), Kind::Flag, Value::Bool(false), false,
        c"a pinhole in place of the lens",
        |s, v| s.disable_defocus = v.u32();
    c"trapeze:cameraLight", Some(c"Light at the camera, where the host has lights"),
        Kind::Flag, Value::Bool(true), true,
        c"a light at the camera",
        |s, v| s.camera_light = v.u32();
    c"trapeze:curves", Some(c"Curves as"), Kind::Word(c"auto ribbons tubes", TRZ_CURVES_AUTO),
        Value::Text(c"auto"), true,
        c"what curves without normals become",
        |s, v| s.curves = v.u32();
    c"trapeze:cull", Some(c"Sides that rays pass through"),
        Kind::Word(c"none back front backUnlessDoubleSided", TRZ_CULL_NONE), Value::Text(c"none"), true,
        c"sides of surfaces that are not seen",
        |s, v| s.cull = v.u32();
    c"trapeze:maxMicropolygons", Some(c"Most micropolygons (0: the renderer's own)"),
        Kind::Whole(0..=i64::MAX), Value::Integer(0), true,
        c"most micropolygons; 0: the renderer's own",
        |s, v| s.max_micropolygons = v.whole.unsigned_abs();
    c"trapeze:seed", Some(c"Seed"), Kind::Whole(0..=u32::MAX as i64), Value::Integer(0), true,
        c"seed of the sample patterns",
        |s, v| s.seed = v.u32();
    c"trapeze:threads", Some(c"Threads (0: all cores)"), Kind::Whole(0..=4096), Value::Integer(0), false,
        c"threads; 0: all cores",
        |s, v| s.threads = v.u32();
    c"trapeze:backend", Some(c"Backend"), Kind::Word(c"auto cpu gpu", TRZ_BACKEND_AUTO), Value::Text(c"auto"), false,
        c"what computes",
        |s, v| s.backend = v.u32();
    c"trapeze:timeCodesPerSecond", Some(c"Time codes per second"), Kind::Real(1e-6..=1e6), Value::Real(24.0), true,
        c"the stage's, for hosts that do not know it; prims with velocities need it",
        |s, v| s.time_codes_per_second = v.f64();
    c"trapeze:compression", None, Kind::Word(c"none rle zips zip piz", TRZ_COMPRESSION_NONE),
        Value::Text(c"zip"), true,
        c"of EXR files",
        |s, v| s.compression = v.u32();
    c"trapeze:pixelType", None, Kind::Word(c"half float", TRZ_PIXEL_HALF), Value::Text(c"half"), true,
        c"16 or 32 bits in EXR files; ids and depths always have 32",
        |s, v| s.pixel_type = v.u32();
};
