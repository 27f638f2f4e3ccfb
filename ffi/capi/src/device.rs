//! Devices for the backend gpu.

use std::ffi::c_char;

use hdtrapeze_delegate::backend::{self, Found, Kind};

use crate::constants::*;
use crate::fault::{Fault, call};
use crate::input;
use crate::session::copy_text;
use crate::types::*;

/// Fills out, whose struct_size the caller has set, with what is known of a device: number 0 is the best one. The first
/// call loads drivers, which may take a second.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (there are not so many).
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_device_describe(index: usize, out: *mut trz_device) -> trz_result {
    // SAFETY: the caller passes null or a valid pointer.
    unsafe {
        call(|| {
            let devices = backend::devices();
            let device = devices.get(index).ok_or_else(|| {
                let text = format!("there is no device {index}; {} are found", devices.len());
                Fault::new(TRZ_ERROR_NOT_FOUND, text)
            })?;
            input::write(out, to_c(device), "out")
        })
    }
}

/// Writes a text (UTF-8, with a NUL) into buffer that tells what TRZ_BACKEND_AUTO is here, and why. Where there is a GPU
/// on which no verdict is kept, the first call, or the first settings that ask for auto, render a small frame on both, which may take
/// some seconds. out_needed becomes the bytes needed, also with TRZ_ERROR_BUFFER_TOO_SMALL; with capacity 0 that is all that
/// is written.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_BUFFER_TOO_SMALL. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_auto_describe(
    buffer: *mut c_char,
    capacity: usize,
    out_needed: *mut usize,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe { call(|| copy_text(&backend::auto().to_string(), buffer, capacity, out_needed)) }
}

fn to_c(from: &Found) -> trz_device {
    trz_device {
        struct_size: 0,
        kind: match from.kind {
            Kind::Software => TRZ_DEVICE_SOFTWARE,
            Kind::Other => TRZ_DEVICE_OTHER,
            Kind::Integrated => TRZ_DEVICE_INTEGRATED,
            Kind::Discrete => TRZ_DEVICE_DISCRETE,
        },
        name: text(&from.name),
        api: text(&from.api),
        driver: text(&from.driver),
        largest_buffer: from.largest_buffer,
        largest_binding: from.largest_binding,
        workgroups: from.workgroups,
        timestamps: from.timestamps.into(),
        subgroups: from.subgroups.into(),
        chosen: from.chosen.into(),
    }
}

/// A text with its NUL, cut at the end of a character where it is too long.
fn text<const N: usize>(from: &str) -> [c_char; N] {
    let mut out = [0; N];
    let fits = |&end: &usize| end < N && from.is_char_boundary(end);
    let end = (0..=from.len()).rev().find(fits).unwrap_or(0);
    for (to, byte) in out.iter_mut().zip(from[..end].bytes()) {
        *to = byte as c_char;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_cut_between_characters() {
        assert_eq!(text::<4>("ab").map(|c| c as u8), *b"ab\0\0");
        assert_eq!(text::<4>("abcd").map(|c| c as u8), *b"abc\0");
        assert_eq!(text::<4>("ab\u{e9}").map(|c| c as u8), *b"ab\0\0");
    }
}
