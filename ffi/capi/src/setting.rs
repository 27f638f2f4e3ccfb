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
            (setting.set)(&mut changed, &value).map_err(Fault::invalid)?;
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

    fn whole<T: TryFrom<i64>>(&self, range: RangeInclusive<i64>) -> Result<T, String> {
        let Value::Integer(whole) = *self else {
            return Err("it must be a whole number".to_owned());
        };
        let found = T::try_from(whole).ok().filter(|_| range.contains(&whole));
        found.ok_or_else(|| format!("it must be from {} to {}", range.start(), range.end()))
    }

    fn real(&self, range: RangeInclusive<f64>) -> Result<f64, String> {
        let real = match *self {
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

    fn flag(&self) -> Result<u32, String> {
        match *self {
            Value::Bool(flag) => Ok(flag.into()),
            _ => Err("it must be true or false".to_owned()),
        }
    }

    /// One of words that are in the order of the ABI's constants, from `first` on.
    fn word(&self, words: &[&str], first: u32) -> Result<u32, String> {
        let found = match self {
            Value::Text(text) => words.iter().position(|w| w.as_bytes() == text.to_bytes()),
            _ => None,
        };
        found
            .map(|at| first + at as u32)
            .ok_or_else(|| format!("it must be one of {}", words.join(", ")))
    }

    fn shutter(&self) -> Result<[f64; 2], String> {
        let Value::Pair(shutter @ [open, close]) = *self else {
            return Err("it must be 2 numbers".to_owned());
        };
        // Also where one is no number.
        if !(open.abs() < LONGEST && close.abs() < LONGEST) {
            return Err("the shutter is absurdly long".to_owned());
        }
        match close < open {
            true => Err("the shutter closes before it opens".to_owned()),
            false => Ok(shutter),
        }
    }
}

struct Setting {
    name: &'static CStr,
    label: Option<&'static CStr>,
    fallback: Value<'static>,
    of_prims: bool,
    set: fn(&mut trz_settings, &Value<'_>) -> Result<(), String>,
}

impl Setting {
    fn to_c(&self) -> trz_setting {
        trz_setting {
            struct_size: 0,
            of_prims: self.of_prims.into(),
            name: self.name.as_ptr(),
            label: self.label.map_or(null(), CStr::as_ptr),
            fallback: self.fallback.to_c(),
        }
    }
}

macro_rules! settings {
    ($($name:literal, $label:expr, $fallback:expr, $of_prims:expr, |$s:ident, $v:ident| $set:expr;)*) => {
        [$(Setting {
            name: $name,
            label: $label,
            fallback: $fallback,
            of_prims: $of_prims,
            set: |$s, $v| {
                $set;
                Ok(())
            },
        }),*]
    };
}

static SETTINGS: [Setting; 20] = settings! {
    c"trapeze:samples", Some(c"Samples per pixel"), Value::Integer(64), true,
        |s, v| s.samples = v.whole(1..=1 << 20)?;
    c"trapeze:shadingRate", Some(c"Shading rate (pixels)"), Value::Real(1.0), true,
        |s, v| s.shading_rate = v.real(0.01..=1000.0)? as f32;
    c"trapeze:filter", Some(c"Pixel filter"), Value::Text(c"gaussian"), true,
        |s, v| s.filter = v.word(&["box", "gaussian", "mitchell", "blackman-harris"], TRZ_FILTER_BOX)?;
    c"trapeze:filterWidth", Some(c"Filter width (pixels, 0: the filter's own)"), Value::Real(0.0), true,
        |s, v| s.filter_width = v.real(0.0..=32.0)? as f32;
    c"trapeze:overrideShutter", Some(c"Override the camera's shutter"), Value::Bool(false), false,
        |s, v| s.override_shutter = v.flag()?;
    c"trapeze:shutterOpen", Some(c"Shutter open (frames)"), Value::Real(-0.25), false,
        |s, v| s.shutter_open = v.real(-LONGEST..=LONGEST)?;
    c"trapeze:shutterClose", Some(c"Shutter close (frames)"), Value::Real(0.25), false,
        |s, v| s.shutter_close = v.real(-LONGEST..=LONGEST)?;
    c"trapeze:shutter", None, Value::None, true, |s, v| {
        [s.shutter_open, s.shutter_close] = v.shutter()?;
        s.override_shutter = 1;
    };
    c"trapeze:disableMotionBlur", Some(c"Disable motion blur"), Value::Bool(false), false,
        |s, v| s.disable_motion_blur = v.flag()?;
    c"trapeze:disableDepthOfField", Some(c"Disable depth of field"), Value::Bool(false), false,
        |s, v| s.disable_defocus = v.flag()?;
    c"trapeze:cameraLight", Some(c"Light at the camera, where the host has lights"), Value::Bool(true), true,
        |s, v| s.camera_light = v.flag()?;
    c"trapeze:curves", Some(c"Curves as"), Value::Text(c"auto"), true,
        |s, v| s.curves = v.word(&["auto", "ribbons", "tubes"], TRZ_CURVES_AUTO)?;
    c"trapeze:cull", Some(c"Sides that rays pass through"), Value::Text(c"none"), true,
        |s, v| s.cull = v.word(&["none", "back", "front", "backUnlessDoubleSided"], TRZ_CULL_NONE)?;
    c"trapeze:maxMicropolygons", Some(c"Most micropolygons (0: the renderer's own)"), Value::Integer(0), true,
        |s, v| s.max_micropolygons = v.whole(0..=i64::MAX)?;
    c"trapeze:seed", Some(c"Seed"), Value::Integer(0), true,
        |s, v| s.seed = v.whole(0..=i64::from(u32::MAX))?;
    c"trapeze:threads", Some(c"Threads (0: all cores)"), Value::Integer(0), false,
        |s, v| s.threads = v.whole(0..=4096)?;
    c"trapeze:backend", Some(c"Backend"), Value::Text(c"auto"), false,
        |s, v| s.backend = v.word(&["auto", "cpu", "gpu"], TRZ_BACKEND_AUTO)?;
    c"trapeze:timeCodesPerSecond", Some(c"Time codes per second"), Value::Real(24.0), true,
        |s, v| s.time_codes_per_second = v.real(1e-6..=1e6)?;
    c"trapeze:compression", None, Value::None, true,
        |s, v| s.compression = v.word(&["none", "rle", "zips", "zip", "piz"], TRZ_COMPRESSION_NONE)?;
    c"trapeze:pixelType", None, Value::None, true,
        |s, v| s.pixel_type = v.word(&["half", "float"], TRZ_PIXEL_HALF)?;
};
