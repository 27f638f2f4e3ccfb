//! The session's life, its log, and what a call did: `trz_session_*`, `trz_last_error`.

use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr;

use hdtrapeze_delegate::Level;

use crate::constants::*;
use crate::fault::{Fault, call, last_error, with_session};
use crate::input;
use crate::types::{trz_log_fn, trz_result, trz_session};

/// TRZ_ABI_VERSION of the library that is loaded, which may be newer than the header.
///
/// Errors: none. Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn trz_abi_version() -> u32 {
    TRZ_ABI_VERSION
}

/// Version of the library, "major.minor.patch". Owned by the library, valid for ever.
///
/// Errors: none. Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn trz_version() -> *const c_char {
    const VERSION: &CStr =
        match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
            Ok(version) => version,
            Err(_) => c"",
        };
    VERSION.as_ptr()
}

/// Name of a result code, such as "TRZ_ERROR_NOT_FOUND"; "unknown" for any other number. Owned by
/// the library, valid for ever.
///
/// Errors: none. Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn trz_result_name(result: trz_result) -> *const c_char {
    match result {
        TRZ_OK => c"TRZ_OK",
        TRZ_ERROR_NULL_POINTER => c"TRZ_ERROR_NULL_POINTER",
        TRZ_ERROR_INVALID_ARGUMENT => c"TRZ_ERROR_INVALID_ARGUMENT",
        TRZ_ERROR_NOT_FOUND => c"TRZ_ERROR_NOT_FOUND",
        TRZ_ERROR_UNSUPPORTED => c"TRZ_ERROR_UNSUPPORTED",
        TRZ_ERROR_OUT_OF_MEMORY => c"TRZ_ERROR_OUT_OF_MEMORY",
        TRZ_ERROR_IO => c"TRZ_ERROR_IO",
        TRZ_ERROR_CANCELLED => c"TRZ_ERROR_CANCELLED",
        TRZ_ERROR_POISONED => c"TRZ_ERROR_POISONED",
        TRZ_ERROR_BUSY => c"TRZ_ERROR_BUSY",
        TRZ_ERROR_BUFFER_TOO_SMALL => c"TRZ_ERROR_BUFFER_TOO_SMALL",
        TRZ_ERROR_INTERNAL => c"TRZ_ERROR_INTERNAL",
        _ => c"unknown",
    }
    .as_ptr()
}

/// What went wrong in the last call on this thread, one sentence, UTF-8; "" where it succeeded.
/// Owned by the library, valid until the next call on this thread.
///
/// Errors: none. Threads: any; each has its own message.
#[unsafe(no_mangle)]
pub extern "C" fn trz_last_error() -> *const c_char {
    last_error()
}

/// Makes an empty session. The caller owns it and gives it back to trz_session_destroy.
///
/// Errors: TRZ_ERROR_NULL_POINTER. Threads: any; sessions of one process do not mix.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_session_create(out: *mut *mut trz_session) -> trz_result {
    call(|| {
        // SAFETY: the caller passes null or a valid place for a pointer.
        let out = unsafe { input::place(out, "out") }?;
        *out = crate::session_with(crate::default_factory());
        Ok(())
    })
}

/// Destroys a session: cancels a running render, waits for its threads, frees everything. NULL is
/// ignored; a poisoned session is destroyed like any other. From inside a log callback nothing is
/// done: the session stays alive.
///
/// Errors: none. Threads: any, but no other call on the session may be running or follow.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_session_destroy(session: *mut trz_session) {
    if session.is_null() {
        return;
    }
    call(|| {
        if hdtrapeze_delegate::in_log_callback() {
            return Err(Fault::new(
                TRZ_ERROR_BUSY,
                "a session cannot be destroyed from inside a log callback",
            ));
        }
        // SAFETY: the caller passes a session of trz_session_create, once, with no call running.
        drop(unsafe { Box::from_raw(session) });
        Ok(())
    });
}

struct Host {
    log: unsafe extern "C" fn(*mut c_void, u32, *const c_char, *const c_char, *const c_char),
    user: *mut c_void,
}

// SAFETY: the header demands that the callback can be called from any thread with `user`.
unsafe impl Send for Host {}

impl Host {
    fn send(&self, level: Level, prim: &str, code: &str, text: &str) {
        let [prim, code, text] = [prim, code, text].map(c_string);
        // SAFETY: the caller of trz_session_set_log promises a valid function; strings outlive it.
        unsafe {
            (self.log)(
                self.user,
                level_number(level),
                prim.as_ptr(),
                code.as_ptr(),
                text.as_ptr(),
            );
        }
    }
}

fn level_number(level: Level) -> u32 {
    match level {
        Level::ERROR => TRZ_LOG_ERROR,
        Level::WARN => TRZ_LOG_WARN,
        Level::INFO => TRZ_LOG_INFO,
        _ => TRZ_LOG_DEBUG,
    }
}

/// A C string of `text`, without NUL characters.
pub(crate) fn c_string(text: &str) -> CString {
    CString::new(text)
        .or_else(|_| CString::new(text.replace('\0', " ")))
        .unwrap_or_default()
}

/// Sets the function that receives messages of up to this level (TRZ_LOG_*); NULL for none. A
/// warning about a prim comes once a session for the same prim, code and text. When this returns,
/// the function set before is not running and will not be called again. log and user must stay
/// valid until then.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (level), TRZ_ERROR_BUSY (inside a log
/// callback), TRZ_ERROR_POISONED. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_session_set_log(
    session: *mut trz_session,
    log: trz_log_fn,
    user: *mut c_void,
    level: u32,
) -> trz_result {
    // SAFETY: the caller passes null or a live session.
    unsafe {
        with_session(session, |session| {
            let level = match level {
                TRZ_LOG_ERROR => Level::ERROR,
                TRZ_LOG_WARN => Level::WARN,
                TRZ_LOG_INFO => Level::INFO,
                TRZ_LOG_DEBUG => Level::DEBUG,
                other => return Err(Fault::invalid(format!("no log level has number {other}"))),
            };
            let host = log.map(|log| Host { log, user });
            Ok(session.set_log(
                host.map(|host| -> hdtrapeze_delegate::LogFn {
                    Box::new(move |level, prim, code, text| host.send(level, prim, code, text))
                }),
                level,
            )?)
        })
    }
}

/// Copies `text` and a NUL into the caller's buffer of `capacity` bytes, telling the bytes needed.
/// Safety: `buffer` holds `capacity` bytes, `needed` is valid or null.
pub(crate) unsafe fn copy_text(
    text: &str,
    buffer: *mut c_char,
    capacity: usize,
    needed: *mut usize,
) -> Result<(), Fault> {
    // SAFETY: as this function's caller promises.
    let needed = unsafe { input::place(needed, "out_needed") }?;
    let text = c_string(text);
    let bytes = text.as_bytes_with_nul();
    if capacity > 0 && buffer.is_null() {
        return Err(Fault::null("buffer"));
    }
    *needed = bytes.len();
    if capacity == 0 {
        return Ok(());
    }
    if capacity < bytes.len() {
        return Err(Fault::new(
            TRZ_ERROR_BUFFER_TOO_SMALL,
            format!("{} bytes are needed, {capacity} were given", bytes.len()),
        ));
    }
    // SAFETY: `buffer` is not null and holds `capacity` bytes, no fewer than are copied.
    unsafe { ptr::copy_nonoverlapping(bytes.as_ptr().cast(), buffer, bytes.len()) };
    Ok(())
}
