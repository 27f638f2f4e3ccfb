//! Settings, commit and the render thread: `trz_settings_*`, `trz_session_commit`, `trz_render_*`.

use std::ffi::c_char;
use std::time::Duration;

use hdtrapeze_core::scene::RenderSettings;

use crate::fault::{Fault, call, with_handle, with_session};
use crate::types::*;
use crate::{convert, input, session};

/// Fills out, whose struct_size the caller has set, with the defaults of a new session.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size). Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_settings_default(out: *mut trz_settings) -> trz_result {
    call(|| {
        // SAFETY: the caller passes null or a struct of the size it tells.
        unsafe {
            input::write(
                out,
                convert::settings_to_c(&RenderSettings::default()),
                "out",
            )
        }
    })
}

/// Queues render settings. Every field is checked here.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_UNSUPPORTED (backend),
/// TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_session_set_settings(
    session: *mut trz_session,
    settings: *const trz_settings,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            let settings = convert::settings(&input::read(settings, "settings")?)?;
            Ok(session.set_settings(settings)?)
        })
    }
}

/// Queues the AOVs to render, by name (UTF-8), copied; color as created. A name that the renderer
/// does not know gives a warning at commit.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_session_set_aovs(
    session: *mut trz_session,
    names: *const *const c_char,
    count: usize,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            Ok(session.set_aovs(input::texts(names, count, "names")?)?)
        })
    }
}

/// Applies queued edits in the order they were queued, dices and builds; returns when it is done.
/// A running render is stopped first. With nothing queued it does nothing, and a running render
/// goes on. trz_render_cancel from another thread ends it early: edits stay applied, and the next
/// commit builds.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (no camera to render through, or one
/// that shows nothing), TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_CANCELLED, TRZ_ERROR_BUSY (inside a log
/// callback), TRZ_ERROR_POISONED. Threads: any; commits and starts run one after another.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_session_commit(session: *mut trz_session) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe { with_session(session, |session| Ok(session.commit()?)) }
}

/// Commits what is queued (see trz_session_commit), then renders from the first sample on a thread
/// of the session; returns when that has begun. A running render is stopped first.
///
/// Errors: those of trz_session_commit. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_render_start(session: *mut trz_session) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe { with_session(session, |session| Ok(session.start()?)) }
}

/// Waits until no commit or render is running, or for so many seconds; below 0: for ever.
/// out_finished becomes 1 where none is running any more (trz_render_progress tells how it ended),
/// 0 where time ran out.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (seconds is NaN),
/// TRZ_ERROR_BUSY (inside a log callback), TRZ_ERROR_POISONED (also where the render failed).
/// Threads: any, also several at once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_render_wait(
    session: *mut trz_session,
    seconds: f64,
    out_finished: *mut u32,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            let out = input::place(out_finished, "out_finished")?;
            if seconds.is_nan() {
                return Err(Fault::invalid("seconds is not a number"));
            }
            // Too long to count is for ever.
            let limit = match seconds < 0.0 {
                true => None,
                false => Duration::try_from_secs_f64(seconds).ok(),
            };
            *out = u32::from(session.wait(limit)?);
            Ok(())
        })
    }
}

/// Cancels a running commit or render and waits until it has stopped; what was rendered is kept and
/// can be read. With none running it does nothing.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_BUSY (inside a log callback), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_render_cancel(session: *mut trz_session) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe { with_session(session, |session| Ok(session.cancel()?)) }
}

/// Asks a running commit or render to stop, as trz_render_cancel does, and does not wait until it has.
/// With none running it does nothing.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_render_interrupt(session: *mut trz_session) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe { with_session(session, |session| Ok(session.interrupt()?)) }
}

/// Has renders wait with the samples that they have (1), or go on from there (0, as created). AOVs can be
/// read meanwhile. Never waits: tiles that were begun are still rendered. A commit is not held up, and a
/// render that is started during a pause waits before its first sample. trz_render_cancel and edits
/// work as always; the pause stays until it is ended.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_render_pause(session: *mut trz_session, paused: u32) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe {
        with_session(session, |session| {
            Ok(session.pause(input::flag(paused, "paused")?)?)
        })
    }
}

/// Fills out, whose struct_size the caller has set. Never waits.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_render_progress(
    session: *mut trz_session,
    out: *mut trz_progress,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_handle(session, |handle| {
            let session = &handle.session;
            let (progress, edits) = (session.progress()?, session.edits());
            let progress = convert::progress_to_c(&progress, edits, handle.render_loop.progress());
            input::write(out, progress, "out")
        })
    }
}

/// Fills out, whose struct_size the caller has set, with numbers of the last commit and the last
/// render; those of a render come when it ends.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size), TRZ_ERROR_POISONED.
/// Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_statistics_get(
    session: *mut trz_session,
    out: *mut trz_statistics,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            input::write(out, convert::statistics_to_c(&session.statistics()?), "out")
        })
    }
}

/// Writes a text (UTF-8, with a NUL) into buffer that tells which effects the committed scene calls
/// for and which prim called for each. out_needed becomes the bytes needed, also with
/// TRZ_ERROR_BUFFER_TOO_SMALL; with capacity 0 that is all that is done.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_BUFFER_TOO_SMALL, TRZ_ERROR_NOT_FOUND (nothing was
/// committed), TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_explain(
    session: *mut trz_session,
    buffer: *mut c_char,
    capacity: usize,
    out_needed: *mut usize,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            session::copy_text(&session.explain()?, buffer, capacity, out_needed)
        })
    }
}

/// Writes the scene with all queued edits as text: prims in the order of their paths, motion at keys
/// across the shutter, instances, camera and settings, and what is wrong with them. Two hosts that
/// mean the same scene get the same text. Nothing is diced or rendered; a running render goes on.
/// out_needed becomes the bytes needed, also with TRZ_ERROR_BUFFER_TOO_SMALL; with capacity 0 that is
/// all that is done.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_BUFFER_TOO_SMALL, TRZ_ERROR_BUSY, TRZ_ERROR_POISONED.
/// Threads: any; waits for a commit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_scene_dump(
    session: *mut trz_session,
    buffer: *mut c_char,
    capacity: usize,
    out_needed: *mut usize,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            session::copy_text(&session.dump()?, buffer, capacity, out_needed)
        })
    }
}

/// The same text, to a file. One that was there before is replaced only by a whole one.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_IO, TRZ_ERROR_BUSY,
/// TRZ_ERROR_POISONED. Threads: any; waits for a commit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_scene_write(
    session: *mut trz_session,
    path: *const c_char,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        with_session(session, |session| {
            Ok(session.write_dump(input::text(path, "path")?.as_ref())?)
        })
    }
}
