//! When dicing stops early: cancelled, or more micropolygons than asked for.

use super::DiceError;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Why a pass stopped.
#[derive(Debug)]
pub(super) enum Halt {
    /// More than the budget: the caller coarsens and starts again.
    OverBudget,
    /// For good.
    Failed(DiceError),
}

impl<E: Into<DiceError>> From<E> for Halt {
    fn from(e: E) -> Self {
        Self::Failed(e.into())
    }
}

/// Counts what a pass makes, over all threads. Whether the limit is passed depends on the sum
/// only, so it does not depend on the order of the threads.
pub(super) struct Budget<'a> {
    used: AtomicU64,
    limit: u64,
    cancel: &'a AtomicBool,
}

impl<'a> Budget<'a> {
    pub fn new(limit: u64, cancel: &'a AtomicBool) -> Self {
        Self {
            used: AtomicU64::new(0),
            limit,
            cancel,
        }
    }

    /// Stops here where dicing was cancelled.
    pub fn check(&self) -> Result<(), Halt> {
        self.take(0)
    }

    /// Takes `count` out of the budget.
    pub fn take(&self, count: u64) -> Result<(), Halt> {
        if self.cancel.load(Ordering::Relaxed) {
            return Err(Halt::Failed(DiceError::Cancelled));
        }
        if self.used.fetch_add(count, Ordering::Relaxed) + count > self.limit {
            return Err(Halt::OverBudget);
        }
        Ok(())
    }
}
