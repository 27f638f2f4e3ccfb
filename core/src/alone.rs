//! Work that must not be mixed with other work of a thread pool.
//!
//! A rayon worker that waits for a part of its own work takes other work meanwhile. Where the work at hand
//! holds what the other would wait for, that never ends: so a thread that makes something for all to see
//! makes it *alone*.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, mpsc};
use std::time::Duration;

use rayon::{ThreadPool, ThreadPoolBuilder};

/// Pools of one thread each.
struct Threads {
    /// Those that have nothing to do: as many as were ever at work at a time.
    idle: Vec<ThreadPool>,
    /// All there are.
    count: usize,
}

static THREADS: Mutex<Threads> = Mutex::new(Threads {
    idle: Vec::new(),
    count: 0,
});
/// Tells that one of them has nothing to do.
static FREED: Condvar = Condvar::new();
/// Where the system gives no thread at all, it is asked so often, and so long apart.
const TRIES: u32 = 100;
const APART: Duration = Duration::from_millis(10);

/// There is no thread to be had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoThread;

/// Runs `work` on a thread whose rayon pool has no other, and waits for it without taking up other work. A
/// panic of `work` goes on here.
///
/// # Errors
/// No thread can be started, and none was ever.
pub fn alone<R: Send + 'static>(work: impl FnOnce() -> R + Send + 'static) -> Result<R, NoThread> {
    let pool = idle_pool()?;
    let (send, receive) = mpsc::channel();
    pool.spawn(move || {
        // Nobody left to receive is no matter of this thread's.
        let _ = send.send(catch_unwind(AssertUnwindSafe(work)));
    });
    let result = receive.recv();
    threads().idle.push(pool);
    FREED.notify_one();
    match result {
        Ok(Ok(result)) => Ok(result),
        Ok(Err(panic)) => resume_unwind(panic),
        Err(_) => Err(NoThread),
    }
}

/// [`alone`], or what is `empty` where there is no thread: that something is missing is told.
pub fn alone_or<R: Send + 'static>(
    work: impl FnOnce() -> R + Send + 'static,
    empty: impl FnOnce() -> R,
) -> R {
    alone(work).unwrap_or_else(|NoThread| {
        tracing::error!("no thread can be started: part of the scene is missing");
        empty()
    })
}

fn threads() -> MutexGuard<'static, Threads> {
    THREADS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A pool that has nothing to do. Where no more can be started, those at work are waited for: their work waits for nobody.
fn idle_pool() -> Result<ThreadPool, NoThread> {
    let mut tries = 0;
    loop {
        if let Some(pool) = threads().idle.pop() {
            return Ok(pool);
        }
        let built = ThreadPoolBuilder::new()
            .num_threads(1)
            .thread_name(|_| "hdtrapeze-alone".to_owned())
            .build();
        let mut threads = threads();
        if let Ok(pool) = built {
            threads.count += 1;
            return Ok(pool);
        }
        tries += 1;
        if threads.count == 0 && tries >= TRIES {
            return Err(NoThread);
        }
        if threads.idle.is_empty() {
            let woken = FREED.wait_timeout(threads, APART);
            drop(woken.unwrap_or_else(PoisonError::into_inner));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::sync::OnceLock;

    /// With the work done in the pool itself this does not end: a thread that waits for its own parts
    /// takes another task, and waits there for what it makes.
    #[test]
    fn all_tasks_of_a_pool_may_wait_for_what_one_of_them_makes() {
        let pool = ThreadPoolBuilder::new()
            .num_threads(3)
            .build()
            .expect("threads");
        for round in 0..50u64 {
            let cell = OnceLock::new();
            let make = move || alone(move || (0..2000u64).into_par_iter().map(|i| i + round).sum());
            let sums: Vec<u64> = pool.install(|| {
                let tasks = (0..64).into_par_iter().with_max_len(1);
                tasks
                    .map(|_| *cell.get_or_init(|| make().expect("a thread")))
                    .collect()
            });
            assert!(sums.iter().all(|&sum| sum == 1_999_000 + 2000 * round));
        }
    }

    #[test]
    fn panics_go_on_where_the_work_was_asked_for() {
        let caught = catch_unwind(|| alone(|| panic!("made to fail")));
        assert!(caught.is_err());
        assert_eq!(alone(|| 7), Ok(7));
    }
}
