//! How much of a long stage is handed to a device at once.
//!
//! A driver's watchdog takes away a device that is at one submission for some seconds, and how long rays take is known only
//! once some have run. So a submission has rays of one page alone, few at first, and then as many as take a small part of
//! what watchdogs allow, by how long those before took. One runs while the next waits: the device is never idle.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::kernel::{Clock, Launch, submit};
use super::{Device, GpuError};

/// What a submission should take: watchdogs wait for 2 seconds or more.
const TARGET: Duration = Duration::from_millis(250);
/// Rays of the first submission.
const FIRST: usize = 1 << 15;
/// Rays of a submission at least: a device that takes longer for these is not to be helped.
const LEAST: usize = 1 << 10;
/// Rays of a submission at most.
const MOST: usize = 1 << 20;
/// Submissions that the device has at once.
const AT_ONCE: usize = 2;

/// What was submitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Submitted {
    /// Submissions.
    pub count: u64,
    /// Rays of the largest.
    pub largest: usize,
    /// Rays that the next one may have.
    pub next: usize,
}

/// How many rays a submission of a stage may have.
#[derive(Debug)]
pub(crate) struct Pace {
    target: Duration,
    state: Mutex<Submitted>,
}

/// A submission that may still run.
struct Flying {
    submission: wgpu::SubmissionIndex,
    since: Instant,
    rays: usize,
}

impl Default for Pace {
    fn default() -> Self {
        Self::new(TARGET)
    }
}

impl Pace {
    /// Submissions should take no longer than `target`.
    pub fn new(target: Duration) -> Self {
        let state = Submitted {
            next: FIRST,
            ..Submitted::default()
        };
        Self {
            target,
            state: Mutex::new(state),
        }
    }

    /// What was submitted by now.
    pub fn submitted(&self) -> Submitted {
        *self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Runs the stage on rays `0..len` of each of `pages`, one page after the other; `launch` gives what runs on some rays of
    /// a page. Where few of these rays may be left, `sparse`, what they take says nothing about others. Gives seconds as
    /// [`Launch::run`]; all but the last submissions have run then.
    pub fn run(
        &self,
        device: &Device,
        (pages, len): (usize, usize),
        sparse: bool,
        timed: bool,
        mut launch: impl FnMut(usize, Range<usize>) -> Result<Launch, GpuError>,
    ) -> Result<Option<f64>, GpuError> {
        let mut flying: VecDeque<Flying> = VecDeque::new();
        let mut clocks = Vec::new();
        let mut last_done = None;
        for page in 0..pages {
            let mut first = 0;
            // Where there are no rays, there is nothing to be run.
            while first < len {
                let end = len.min(first + self.submitted().next);
                let one = launch(page, first..end)?;
                let clock = Clock::where_timed(device, timed)?;
                let since = Instant::now();
                let submission = submit(device, &[one], clock.as_ref())?;
                clocks.extend(clock);
                self.count(end - first);
                flying.push_back(Flying {
                    submission,
                    since,
                    rays: end - first,
                });
                if flying.len() >= AT_ONCE
                    && let Some(oldest) = flying.pop_front()
                {
                    device.wait(oldest.submission)?;
                    let done = Instant::now();
                    // It waited for those before.
                    let from = last_done.map_or(oldest.since, |last| oldest.since.max(last));
                    self.took(oldest.rays, done - from, sparse);
                    last_done = Some(done);
                }
                first = end;
            }
        }
        if !timed {
            return device.check().map(|()| None);
        }
        if let Some(last) = flying.pop_back() {
            device.wait(last.submission)?;
        }
        let seconds = clocks.iter().map(|clock| clock.seconds(device));
        let seconds: Vec<f64> = seconds.collect::<Result<_, _>>()?;
        Ok(device.found().timestamps.then(|| seconds.iter().sum()))
    }

    fn count(&self, rays: usize) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.count += 1;
        state.largest = state.largest.max(rays);
    }

    /// A submission of so many rays took so long.
    fn took(&self, rays: usize, time: Duration, sparse: bool) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if time > self.target {
            state.next = state.next.min((rays / 2).next_power_of_two()).max(LEAST);
        } else if !sparse && rays >= state.next && time < self.target / 3 {
            state.next = (2 * state.next).min(MOST);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Submissions grow while they are short, shrink where one was long, and stay within bounds.
    #[test]
    fn rays_follow_the_time() {
        let pace = Pace::default();
        let next = || pace.submitted().next;
        pace.took(next(), TARGET / 10, true);
        pace.took(next() - 1, TARGET / 10, false);
        assert_eq!(next(), FIRST, "nothing was told");
        pace.took(next(), TARGET / 10, false);
        assert_eq!(next(), 2 * FIRST);
        pace.took(next(), TARGET / 2, false);
        assert_eq!(next(), 2 * FIRST, "neither long nor short");
        for _ in 0..20 {
            pace.took(next(), TARGET / 10, false);
        }
        assert_eq!(next(), MOST);
        pace.took(next(), 2 * TARGET, true);
        assert_eq!(next(), MOST / 2);
        for _ in 0..20 {
            pace.took(next(), 2 * TARGET, false);
        }
        assert_eq!(next(), LEAST);
    }
}
