//! Views for hosts that wait for nothing, and the files of render products: `trz_view_*`.

use std::ffi::c_char;
use std::slice;

use hdtrapeze_delegate::buffer::Shown;

use crate::fault::with_handle;
use crate::types::*;
use crate::{convert, input};

/// Has the products and the view rendered on a thread of the session, and returns at once: commits what
/// is queued, and renders one image after the other, each from the first sample. Those that agree in
/// camera and settings are one. Products are written when their samples were taken, then the view is
/// rendered, which AOVs can be read of. What runs is given up; nothing is done where the same was asked
/// for last and nothing was edited since. What trz_session_destroy interrupts is kept beside the places of
/// its files, as trz_image.partial says. trz_render_progress tells how far it is. Settings, AOVs and
/// the active camera of the session are those of the image that is rendered.
///
/// Products that cannot be are left out, and a backend that is not there is replaced, with one warning. A
/// render that fails and a file that cannot be written give a message. Not to be mixed with
/// trz_render_start.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (camera),
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_view_render(
    session: *mut trz_session,
    view: *const trz_view,
    products: *const *const trz_product,
    product_count: usize,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_handle(session, |handle| {
            let session = &handle.session;
            let products = input::slice(products, product_count, "products")?;
            let request = convert::request(session, &input::read(view, "view")?, products)?;
            Ok(handle.render_loop.render(session.plan(&request).jobs)?)
        })
    }
}

/// Gives up what trz_view_render has rendered, and keeps it from rendering until trz_view_resume; 1: waits
/// until nothing runs. What was rendered can be read, but no file is kept of it: not where the session is
/// destroyed before trz_view_resume either.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_BUSY (waiting inside a log
/// callback), TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_view_stop(session: *mut trz_session, wait: u32) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe {
        with_handle(session, |handle| {
            Ok(handle.render_loop.stop(input::flag(wait, "wait")?)?)
        })
    }
}

/// Ends trz_view_stop: what was given up is rendered anew.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_view_resume(session: *mut trz_session) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe { with_handle(session, |handle| Ok(handle.render_loop.resume()?)) }
}

/// Fills a host's buffer with an AOV of what trz_view_render has rendered, where that is more than the
/// buffer shows: converted, at the buffer's place, over its clear value. What is rendered anew is shown as
/// soon as every pixel has a sample, and until then what was there.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_BUFFER_TOO_SMALL,
/// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any, also while rendering; one at a time for a
/// buffer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_view_show(
    session: *mut trz_session,
    aov: *const c_char,
    buffer: *mut trz_buffer,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_handle(session, |handle| {
            let aov = input::text(aov, "aov")?;
            let mut to = input::read(buffer.cast_const(), "buffer")?;
            let (layout, bytes) = convert::buffer(&to)?;
            input::check_slice(to.data.cast::<u8>().cast_const(), bytes, "data")?;
            let data = match bytes {
                0 => &mut [],
                some => slice::from_raw_parts_mut(to.data.cast::<u8>(), some),
            };
            let shown = Shown {
                filled: input::flag(to.filled, "filled")?,
                render: to.render,
                samples: to.samples,
                ended: input::flag(to.ended, "ended")?,
            };
            let now = handle.render_loop.show(aov, &layout, data, shown)?;
            (to.filled, to.ended) = (now.filled.into(), now.ended.into());
            (to.render, to.samples) = (now.render, now.samples);
            input::write(buffer, to, "buffer")
        })
    }
}
