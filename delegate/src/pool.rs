//! The session's worker threads: a rayon pool that logs to the session and ends with it.

use std::io;
use std::thread::{Builder, JoinHandle, available_parallelism};

use rayon::{ThreadPool, ThreadPoolBuilder};
use tracing::Dispatch;
use tracing::dispatcher::with_default;

use crate::error::Error;

/// Worker threads; dropping it waits for them to end.
pub(crate) struct Pool {
    pool: Option<ThreadPool>,
    workers: Vec<JoinHandle<()>>,
}

impl Pool {
    /// A pool of so many threads, 0 for as many as there are cores, whose events go to `dispatch`.
    pub fn new(threads: u32, dispatch: &Dispatch) -> Result<Self, Error> {
        let cores = || available_parallelism().map_or(1, usize::from);
        let count = match threads {
            0 => cores(),
            some => some as usize,
        };
        let mut workers = Vec::new();
        let pool = ThreadPoolBuilder::new()
            .num_threads(count)
            .spawn_handler(|worker| {
                let dispatch = dispatch.clone();
                let name = format!("hdtrapeze-{}", worker.index());
                let run = move || with_default(&dispatch, || worker.run());
                workers.push(Builder::new().name(name).spawn(run)?);
                io::Result::Ok(())
            })
            .build();
        match pool {
            Ok(pool) => Ok(Self {
                pool: Some(pool),
                workers,
            }),
            Err(error) => Err(Error::OutOfMemory(format!(
                "cannot start {count} threads: {error}"
            ))),
        }
    }

    /// Runs `work` with this pool as rayon's.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }
}

impl Pool {
    /// Runs `work` on a thread of this pool, some time; panics in it must be caught.
    pub fn spawn(&self, work: impl FnOnce() + Send + 'static) {
        match &self.pool {
            Some(pool) => pool.spawn(work),
            None => work(),
        }
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        // Tells the workers to end; then they can be waited for.
        drop(self.pool.take());
        for worker in self.workers.drain(..) {
            // A worker that panicked has ended too.
            let _ = worker.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn has_the_threads_that_were_asked_for() {
        let pool = Pool::new(3, &Dispatch::none()).unwrap();
        assert_eq!(pool.install(rayon::current_num_threads), 3);
        let all = Pool::new(0, &Dispatch::none()).unwrap();
        assert_eq!(
            all.install(rayon::current_num_threads),
            available_parallelism().unwrap().get()
        );
    }
}
