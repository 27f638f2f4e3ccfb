//! What all threads of a session see: its state, what was committed and rendered, its log.
//!
//! The lock is held for moments only, never while the renderer works or a log function runs.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use hdtrapeze_core::render::{Frame, Prepared};
use hdtrapeze_gpu::GpuFrame;
use tracing::Dispatch;

use crate::error::Error;
use crate::log::Log;
use crate::pool::Pool;
use crate::progress::{Run, State, Statistics};

/// Locks; a panic of another holder poisons the session, not the lock.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What was committed: rays can be traced against it.
#[derive(Clone)]
pub(crate) struct Committed {
    pub prepared: Arc<Prepared>,
    /// The same on a GPU, where one renders.
    pub gpu: Option<Arc<GpuFrame>>,
    /// What renders and why, for people.
    pub backend: Arc<str>,
    pub pool: Arc<Pool>,
}

/// The last render that was started.
#[derive(Clone)]
pub(crate) struct Rendered {
    pub frame: Arc<Frame>,
    pub resolution: [u32; 2],
    pub pixel_aspect: f32,
    /// Metadata of its files.
    pub facts: Vec<(String, String)>,
}

/// See the module.
#[derive(Default)]
pub(crate) struct Status {
    pub state: State,
    pub run: Run,
    pub cancel: Arc<AtomicBool>,
    /// Renders are to wait; `cancel` interrupts one for it.
    pub paused: bool,
    /// What runs is to end, whether paused or not.
    pub ending: bool,
    pub committed: Option<Committed>,
    pub rendered: Option<Rendered>,
    pub statistics: Statistics,
    /// Why the session is poisoned.
    pub failure: Option<String>,
}

/// What the session shares with its render thread.
pub(crate) struct Shared {
    pub log: Arc<Log>,
    pub dispatch: Dispatch,
    status: Mutex<Status>,
    changed: Condvar,
}

impl Shared {
    pub fn new() -> Arc<Self> {
        let log = Log::new();
        Arc::new(Self {
            dispatch: log.dispatch(),
            log,
            status: Mutex::default(),
            changed: Condvar::new(),
        })
    }

    pub fn status(&self) -> MutexGuard<'_, Status> {
        lock(&self.status)
    }

    /// Starts a run; returns the flag that cancels it.
    pub fn begin(&self) -> Arc<AtomicBool> {
        let cancel = Arc::new(AtomicBool::new(false));
        let mut status = self.status();
        status.state = State::Preparing;
        status.run = Run {
            began: Some(Instant::now()),
            ..Run::default()
        };
        status.cancel = cancel.clone();
        status.ending = false;
        cancel
    }

    /// Ends a run and wakes who waits for it.
    pub fn end(&self, state: State) {
        let mut status = self.status();
        // A poisoned session has failed, whatever else ends.
        status.state = match status.failure {
            Some(_) => State::Failed,
            None => state,
        };
        status.run.ended = Some(Instant::now());
        drop(status);
        self.changed.notify_all();
    }

    /// Waits until nothing runs, at most so long; true when nothing does.
    pub fn wait(&self, limit: Option<Duration>) -> bool {
        let deadline = limit.and_then(|limit| Instant::now().checked_add(limit));
        let mut status = self.status();
        while status.state.is_running() {
            status = match deadline {
                None => self.changed.wait(status),
                Some(deadline) => {
                    let left = deadline.saturating_duration_since(Instant::now());
                    if left.is_zero() {
                        return false;
                    }
                    let woken = self.changed.wait_timeout(status, left);
                    Ok(woken.unwrap_or_else(PoisonError::into_inner).0)
                }
            }
            .unwrap_or_else(PoisonError::into_inner);
        }
        true
    }

    /// Asks what runs to stop; returns its flag.
    pub fn request_cancel(&self) -> Arc<AtomicBool> {
        let mut status = self.status();
        status.ending = true;
        let cancel = status.cancel.clone();
        cancel.store(true, Ordering::Relaxed);
        drop(status);
        self.changed.notify_all();
        cancel
    }

    /// Waits until the run with that flag does not run any more.
    pub fn wait_for(&self, cancel: &Arc<AtomicBool>) {
        let mut status = self.status();
        while status.state.is_running() && Arc::ptr_eq(&status.cancel, cancel) {
            status = self
                .changed
                .wait(status)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Has renders wait, or go on.
    pub fn pause(&self, paused: bool) {
        let mut status = self.status();
        status.paused = paused;
        if paused && status.state == State::Rendering {
            status.cancel.store(true, Ordering::Relaxed);
        }
        drop(status);
        self.changed.notify_all();
    }

    /// Waits while renders are to wait. True where the render is to go on.
    pub fn wait_for_resume(&self) -> bool {
        let mut status = self.status();
        let since = Instant::now();
        while status.paused && !status.ending {
            status.state = State::Paused;
            status = self
                .changed
                .wait(status)
                .unwrap_or_else(PoisonError::into_inner);
        }
        if status.ending {
            return false;
        }
        status.cancel.store(false, Ordering::Relaxed);
        if status.state == State::Paused {
            status.state = State::Rendering;
            let run = &mut status.run;
            for instant in [&mut run.began, &mut run.rendering_since] {
                *instant = instant.map(|instant| instant + since.elapsed());
            }
        }
        true
    }

    /// Refuses where an earlier call panicked.
    pub fn check(&self) -> Result<(), Error> {
        match &self.status().failure {
            Some(why) => Err(Error::Poisoned(why.clone())),
            None => Ok(()),
        }
    }

    /// From now on every call is refused.
    pub fn poison(&self, why: &str) {
        let mut status = self.status();
        status.failure.get_or_insert_with(|| why.to_owned());
        status.ending = true;
        status.cancel.store(true, Ordering::Relaxed);
        drop(status);
        self.end(State::Failed);
    }

    /// Runs a part of the renderer; a panic poisons the session.
    pub fn guard<T>(&self, work: impl FnOnce() -> T) -> Result<T, Error> {
        catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
            let why = panic_text(panic.as_ref());
            self.poison(&why);
            Error::Internal(why)
        })
    }
}

/// The message of a panic.
pub(crate) fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("panic without a message")
        .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_cancels_waits_for_what_was_cancelled_alone() {
        for _ in 0..200 {
            let shared = Shared::new();
            let first = shared.begin();
            std::thread::scope(|scope| {
                let waits = scope.spawn(|| shared.wait_for(&shared.request_cancel()));
                while !first.load(Ordering::Relaxed) {
                    std::thread::yield_now();
                }
                shared.end(State::Cancelled);
                let second = shared.begin();
                let deadline = Instant::now() + Duration::from_secs(5);
                while !waits.is_finished() && Instant::now() < deadline {
                    std::thread::yield_now();
                }
                let returned = waits.is_finished();
                shared.end(State::Finished);
                assert!(returned, "it waits for a render that it did not cancel");
                assert!(!second.load(Ordering::Relaxed));
            });
        }
    }
}
