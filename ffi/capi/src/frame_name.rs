//! File names with places for the frame: `trz_frame_name`, `trz_frame_places`.

use std::ffi::c_char;

use hdtrapeze_delegate::frame_name;

use crate::fault::call;
use crate::types::*;
use crate::{input, session};

/// Copies name with every place for the frame filled in: `####`, `##.##`, `<F4>`, `$F4`, `${F4}`, `%04d`. A
/// frame that is not finite, that of the default time, is shown as 0. capacity counts bytes with the
/// terminating NUL; out_needed receives what is needed, also where the buffer is too small. buffer may
/// be NULL where capacity is 0.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_BUFFER_TOO_SMALL. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_frame_name(
    name: *const c_char,
    frame: f64,
    buffer: *mut c_char,
    capacity: usize,
    out_needed: *mut usize,
) -> trz_result {
    call(|| {
        let frame = if frame.is_finite() { frame } else { 0.0 };
        // SAFETY: the caller passes null or valid pointers.
        unsafe {
            let expanded = frame_name::expand(input::text(name, "name")?, frame);
            session::copy_text(&expanded, buffer, capacity, out_needed)
        }
    })
}

/// Counts the places for the frame that name has, and the decimals of the one that shows the fewest.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_frame_places(
    name: *const c_char,
    out_count: *mut usize,
    out_decimals: *mut usize,
) -> trz_result {
    call(|| {
        // SAFETY: the caller passes null or valid pointers.
        unsafe {
            let places = frame_name::places(input::text(name, "name")?);
            let count = input::place(out_count, "out_count")?;
            *input::place(out_decimals, "out_decimals")? = places.decimals;
            *count = places.count;
        }
        Ok(())
    })
}
