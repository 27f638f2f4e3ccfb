//! How a call fails: code and message, panics caught at the boundary.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use hdtrapeze_delegate::{Error, Session};

use crate::constants::*;
use crate::session::c_string;
use crate::types::{trz_result, trz_session};

/// A failure on its way to the caller.
#[derive(Debug)]
pub(crate) struct Fault {
    code: trz_result,
    message: String,
}

impl Fault {
    pub fn new(code: trz_result, message: impl Into<String>) -> Self {
        Self {
            code,
            message: message.into(),
        }
    }

    pub fn invalid(message: impl Into<String>) -> Self {
        Self::new(TRZ_ERROR_INVALID_ARGUMENT, message)
    }

    pub fn code(&self) -> trz_result {
        self.code
    }

    pub fn message(&self) -> &str {
        &self.message
    }

    pub fn null(what: &str) -> Self {
        Self::new(TRZ_ERROR_NULL_POINTER, format!("{what} is null"))
    }
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        let code = match error {
            Error::InvalidArgument(_) => TRZ_ERROR_INVALID_ARGUMENT,
            Error::NotFound(_) => TRZ_ERROR_NOT_FOUND,
            Error::Unsupported(_) => TRZ_ERROR_UNSUPPORTED,
            Error::OutOfMemory(_) => TRZ_ERROR_OUT_OF_MEMORY,
            Error::Io(_) => TRZ_ERROR_IO,
            Error::Cancelled => TRZ_ERROR_CANCELLED,
            Error::Poisoned(_) => TRZ_ERROR_POISONED,
            Error::Busy => TRZ_ERROR_BUSY,
            Error::Internal(_) => TRZ_ERROR_INTERNAL,
        };
        Self::new(code, error.to_string())
    }
}

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

fn remember(message: &str) {
    // A thread that is ending has no message to keep.
    let _ = LAST_ERROR.try_with(|last| *last.borrow_mut() = c_string(message));
}

/// Message of the last call on this thread; valid until the next one.
pub(crate) fn last_error() -> *const c_char {
    LAST_ERROR
        .try_with(|last| last.borrow().as_ptr())
        .unwrap_or(c"".as_ptr())
}

/// Runs the body of an exported function: no panic leaves it.
pub(crate) fn call(body: impl FnOnce() -> Result<(), Fault>) -> trz_result {
    finish(catch_unwind(AssertUnwindSafe(body)), |_| ())
}

/// As [`call`], for a function of a session; a panic poisons the session.
///
/// # Safety
/// `session` is null or a live session.
pub(crate) unsafe fn with_session(
    session: *const trz_session,
    body: impl FnOnce(&Session) -> Result<(), Fault>,
) -> trz_result {
    // SAFETY: as this function's caller promises.
    unsafe { with_handle(session, |handle| body(&handle.session)) }
}

/// As [`with_session`], for what belongs to a session beside it.
///
/// # Safety
/// `session` is null or a live session.
pub(crate) unsafe fn with_handle(
    session: *const trz_session,
    body: impl FnOnce(&trz_session) -> Result<(), Fault>,
) -> trz_result {
    // SAFETY: as this function's caller promises; only shared references are made of a session.
    let Some(session) = (unsafe { session.as_ref() }) else {
        return finish(Ok(Err(Fault::null("session"))), |_| ());
    };
    let outcome = catch_unwind(AssertUnwindSafe(|| body(session)));
    finish(outcome, |why| session.session.poison(why))
}

fn finish(
    outcome: Result<Result<(), Fault>, Box<dyn Any + Send>>,
    poison: impl FnOnce(&str),
) -> trz_result {
    let fault = match outcome {
        Ok(Ok(())) => {
            remember("");
            return TRZ_OK;
        }
        Ok(Err(fault)) => fault,
        Err(panic) => {
            let text = panic.downcast_ref::<&str>().copied();
            let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
            let why = text.unwrap_or("panic without a message").to_owned();
            poison(&why);
            // Dropping a panic's payload may panic itself.
            std::mem::forget(panic);
            Error::Internal(why).into()
        }
    };
    remember(&fault.message);
    fault.code
}
