//! Prepares prims while the host still reads others.
//!
//! A prim that the host has completed is prepared on the session's pool. A commit waits for what has
//! begun, prepares the rest as ever, and takes over what was prepared for the camera and settings it
//! has. Everything here is a hint: what is not there in time is prepared by the commit.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, Weak};
use std::time::Duration;

use hdtrapeze_core::render::{self, Watcher};
use hdtrapeze_core::scene::{PrimDesc, PrimId, Scene};
use hdtrapeze_core::surface::SubdivisionFactory;
use hdtrapeze_gpu::EarlyVertices;

use crate::pool::Pool;
use crate::status::{Shared, lock};

/// How often a commit that waits looks whether it was cancelled.
const LOOK: Duration = Duration::from_millis(20);

/// Work ahead of one commit, for one version of cameras and settings. Dropping it interrupts what has
/// begun and waits for it.
pub(crate) struct Ahead {
    /// Of the edit queue.
    pub view_version: u64,
    work: Arc<Work>,
    pool: Arc<Pool>,
}

struct Work {
    prepared: render::Ahead,
    /// Where a GPU is to render, what goes there already.
    early: Option<EarlyVertices>,
    factory: Arc<dyn SubdivisionFactory>,
    /// Not owned: it owns the pool, which must not be dropped by one of its own threads.
    shared: Weak<Shared>,
    running: Mutex<usize>,
    ended: Condvar,
    /// Begins nothing more.
    stop: AtomicBool,
    /// Interrupts what has begun.
    cancel: AtomicBool,
}

impl Ahead {
    /// For the camera and settings of `view`; `None` where nothing can be prepared for them.
    pub fn new(
        view: &Scene,
        view_version: u64,
        factory: &Arc<dyn SubdivisionFactory>,
        shared: &Arc<Shared>,
        pool: Arc<Pool>,
        early: Option<EarlyVertices>,
    ) -> Option<Self> {
        let work = Work {
            prepared: render::Ahead::new(view)?,
            early,
            factory: factory.clone(),
            shared: Arc::downgrade(shared),
            running: Mutex::new(0),
            ended: Condvar::new(),
            stop: AtomicBool::new(false),
            cancel: AtomicBool::new(false),
        };
        Some(Self {
            view_version,
            work: Arc::new(work),
            pool,
        })
    }

    /// Prepares a prim as soon as a thread is free.
    pub fn begin(&self, id: PrimId, prim: Arc<PrimDesc>) {
        *lock(&self.work.running) += 1;
        let work = self.work.clone();
        self.pool.spawn(move || {
            // Gone before the session, which waits for this job, can be.
            if let Some(shared) = work.shared.upgrade()
                && !work.stop.load(Ordering::Relaxed)
            {
                let factory = work.factory.as_ref();
                let watcher = work.early.as_ref().map(|early| early as &dyn Watcher);
                let prepare = || {
                    work.prepared
                        .prepare(id, &prim, factory, watcher, &work.cancel)
                };
                // A panic poisons the session, which is told by whatever is called next.
                let _ = shared.guard(prepare);
            }
            *lock(&work.running) -= 1;
            work.ended.notify_all();
        });
    }

    /// Waits for what has begun, and begins nothing more; `cancel` interrupts it. Gives what was prepared, and what of it is on
    /// a GPU.
    pub fn finish(&self, cancel: &AtomicBool) -> (&render::Ahead, Option<&EarlyVertices>) {
        self.work.stop.store(true, Ordering::Relaxed);
        let mut running = lock(&self.work.running);
        while *running > 0 {
            if cancel.load(Ordering::Relaxed) {
                self.work.cancel.store(true, Ordering::Relaxed);
            }
            let woken = self.work.ended.wait_timeout(running, LOOK);
            running = woken.unwrap_or_else(PoisonError::into_inner).0;
        }
        drop(running);
        (&self.work.prepared, self.work.early.as_ref())
    }
}

impl Drop for Ahead {
    fn drop(&mut self) {
        self.finish(&AtomicBool::new(true));
    }
}
