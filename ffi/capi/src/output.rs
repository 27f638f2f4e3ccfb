//! What a render gives back: AOVs, image files, ray hits.

use std::ffi::{c_char, c_void};

use crate::constants::*;
use crate::fault::{Fault, with_session};
use crate::types::*;
use crate::{convert, input, session};

/// Fills out, whose struct_size the caller has set, with the size and type of an AOV of the last
/// render that was started.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (no such AOV, or
/// no render yet), TRZ_ERROR_POISONED. Threads: any, also while rendering.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_aov_describe(
    session: *mut trz_session,
    name: *const c_char,
    out: *mut trz_aov_desc,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            let name = input::text(name, "name")?;
            input::write(out, convert::aov_to_c(&session.describe_aov(name)?), "out")
        })
    }
}

/// Copies an AOV of the last render that was started, as far as it is: rows from the top down,
/// components of 4 bytes, nothing between them. bytes is buffer's size, at least
/// width * height * components * 4.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (no such AOV, or
/// no render yet), TRZ_ERROR_BUFFER_TOO_SMALL, TRZ_ERROR_POISONED. Threads: any, also while
/// rendering.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_aov_read(
    session: *mut trz_session,
    name: *const c_char,
    buffer: *mut c_void,
    bytes: usize,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            let name = input::text(name, "name")?;
            if buffer.is_null() {
                return Err(Fault::null("buffer"));
            }
            let needed = session.describe_aov(name)?.bytes();
            if (bytes as u64) < needed {
                return Err(Fault::new(
                    TRZ_ERROR_BUFFER_TOO_SMALL,
                    format!("{name} takes {needed} bytes, {bytes} were given"),
                ));
            }
            let image = session.aov(name)?;
            let source = convert::aov_bytes(&image);
            // Another render may have been started in between.
            if bytes < source.len() {
                return Err(Fault::new(
                    TRZ_ERROR_BUFFER_TOO_SMALL,
                    "the image's size changed",
                ));
            }
            std::ptr::copy_nonoverlapping(source.as_ptr(), buffer.cast(), source.len());
            Ok(())
        })
    }
}

/// Copies the name of the AOV that a render var is written from, to be given to
/// trz_session_set_aovs. What the var asks for that is not done gives one warning, which names it.
/// capacity counts bytes with the terminating NUL; out_needed receives what is needed, also where
/// the buffer is too small. buffer may be NULL where capacity is 0.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_UNSUPPORTED (leave the var
/// out), TRZ_ERROR_BUFFER_TOO_SMALL, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_render_var_aov(
    session: *mut trz_session,
    var: *const trz_render_var,
    buffer: *mut c_char,
    capacity: usize,
    out_needed: *mut usize,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            let var = convert::render_var(&input::slice(var, 1, "var")?[0])?;
            session::copy_text(&session.render_var_aov(&var)?, buffer, capacity, out_needed)
        })
    }
}

/// Writes AOVs of the last render that was started to a file. A file that was there before is
/// replaced only once this one is written to its end. Everything passed is read before this returns and not kept.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (no such AOV, or
/// no render yet), TRZ_ERROR_UNSUPPORTED, TRZ_ERROR_IO, TRZ_ERROR_POISONED. Threads: any, also
/// while rendering.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_image_write(
    session: *mut trz_session,
    path: *const c_char,
    image: *const trz_image,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            let path = input::text(path, "path")?;
            if path.is_empty() {
                return Err(Fault::invalid("an image needs a file path"));
            }
            let options = convert::image(&input::read(image, "image")?)?;
            Ok(session.write_image(path.as_ref(), &options)?)
        })
    }
}

/// Traces count rays against the committed scene and fills hits[i] with the nearest hit of rays[i].
/// A ray with numbers that are not finite, or without a direction, misses. Queued edits are not
/// seen before they are committed.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (nothing was
/// committed), TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any, also while rendering.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_trace_rays(
    session: *mut trz_session,
    rays: *const trz_ray,
    hits: *mut trz_hit,
    count: usize,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            let rays = input::slice(rays, count, "rays")?;
            input::check_slice(hits.cast_const(), count, "hits")?;
            let found = session.trace(&input::copied(rays, convert::ray)?)?;
            for (index, hit) in found.iter().enumerate().take(count) {
                hits.add(index).write(convert::hit_to_c(hit));
            }
            Ok(())
        })
    }
}
