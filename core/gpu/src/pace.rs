//! How much of a long stage is handed to a device at once.
//!
//! A driver's watchdog takes away a device that is at one submission for some seconds, and how long rays take is known only
//! once some have run. So a submission has rays of one page alone, few at first, and then as many as take a small part of
//! what watchdogs allow, by how long those before took. One runs while the next waits: the device is never idle. Stages that
//! make trees are many dispatches in a row, which are counted by their workgroups in place of rays.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::kernel::{Clock, Launch, submit};
use super::{Device, GpuError};

/// What a submission should take: watchdogs wait for 2 seconds or more.
pub(crate) const TARGET: Duration = Duration::from_millis(250);
/// Submissions that the device has at once.
const AT_ONCE: usize = 2;

/// How large submissions are, in what the work of a stage is counted by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sizes {
    /// The first.
    pub first: usize,
    /// At least: a device that takes longer for these is not to be helped.
    pub least: usize,
    /// At most.
    pub most: usize,
}

impl Sizes {
    /// In rays.
    pub const RAYS: Self = Self {
        first: 1 << 15,
        least: 1 << 10,
        most: 1 << 20,
    };
}

/// What was submitted. Work is counted by rays, of stages that make trees by workgroups.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Submitted {
    /// Submissions.
    pub count: u64,
    /// Dispatches of all.
    pub dispatches: u64,
    /// Work of the largest.
    pub largest: usize,
    /// What the next one may have.
    pub next: usize,
}

/// How much a submission of a stage may have.
#[derive(Debug)]
pub(crate) struct Pace {
    target: Duration,
    sizes: Sizes,
    state: Mutex<Submitted>,
}

/// Submissions of a stage, one after the other.
#[derive(Debug)]
pub(crate) struct Flight<'a> {
    pace: &'a Pace,
    device: &'a Device,
    flying: VecDeque<Flying>,
    last_done: Option<Instant>,
}

/// A submission that may still run.
#[derive(Debug)]
struct Flying {
    submission: wgpu::SubmissionIndex,
    since: Instant,
    /// Its size, or less where that is more than it should have been.
    asked: usize,
    sparse: bool,
}

impl Flight<'_> {
    /// What the next submission may have.
    pub fn next(&self) -> usize {
        self.pace.submitted().next
    }

    /// Adds what `submit` submits: so many dispatches, of this size together. Where it is `sparse`, what it takes says nothing
    /// about others. Waits until the device has nothing but this.
    pub fn add(
        &mut self,
        (dispatches, size): (usize, usize),
        sparse: bool,
        submit: impl FnOnce() -> Result<wgpu::SubmissionIndex, GpuError>,
    ) -> Result<(), GpuError> {
        // Where work does not come in parts of any size, it may be more.
        let asked = size.min(self.next());
        let since = Instant::now();
        let submission = submit()?;
        self.pace.count(dispatches, size);
        self.flying.push_back(Flying {
            submission,
            since,
            asked,
            sparse,
        });
        if self.flying.len() >= AT_ONCE
            && let Some(oldest) = self.flying.pop_front()
        {
            self.device.wait(oldest.submission)?;
            let done = Instant::now();
            // It waited for those before.
            let from = self
                .last_done
                .map_or(oldest.since, |last| oldest.since.max(last));
            self.pace.took(oldest.asked, done - from, oldest.sparse);
            self.last_done = Some(done);
        }
        Ok(())
    }

    /// Waits for the last.
    fn wait(mut self) -> Result<(), GpuError> {
        let last = self.flying.pop_back();
        last.map_or(Ok(()), |last| self.device.wait(last.submission))
    }
}

impl Default for Pace {
    fn default() -> Self {
        Self::new(TARGET, Sizes::RAYS)
    }
}

impl Pace {
    /// Submissions should take no longer than `target`.
    pub fn new(target: Duration, sizes: Sizes) -> Self {
        let state = Submitted {
            next: sizes.first,
            ..Submitted::default()
        };
        Self {
            target,
            sizes,
            state: Mutex::new(state),
        }
    }

    /// Submissions that are to come.
    pub fn flight<'a>(&'a self, device: &'a Device) -> Flight<'a> {
        Flight {
            pace: self,
            device,
            flying: VecDeque::new(),
            last_done: None,
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
        let mut flight = self.flight(device);
        let mut clocks = Vec::new();
        for page in 0..pages {
            let mut first = 0;
            // Where there are no rays, there is nothing to be run.
            while first < len {
                let end = len.min(first + flight.next());
                let one = launch(page, first..end)?;
                let clock = Clock::where_timed(device, timed)?;
                flight.add((1, end - first), sparse, || {
                    submit(device, &[one], clock.as_ref())
                })?;
                clocks.extend(clock);
                first = end;
            }
        }
        if !timed {
            return device.check().map(|()| None);
        }
        flight.wait()?;
        let seconds = clocks.iter().map(|clock| clock.seconds(device));
        let seconds: Vec<f64> = seconds.collect::<Result<_, _>>()?;
        Ok(device.found().timestamps.then(|| seconds.iter().sum()))
    }

    fn count(&self, dispatches: usize, size: usize) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.count += 1;
        state.dispatches += dispatches as u64;
        state.largest = state.largest.max(size);
    }

    /// A submission of this size took so long.
    fn took(&self, size: usize, time: Duration, sparse: bool) {
        let Sizes { least, most, .. } = self.sizes;
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if time > self.target {
            state.next = state.next.min((size / 2).next_power_of_two()).max(least);
        } else if !sparse && size >= state.next && time < self.target / 3 {
            state.next = (2 * state.next).min(most);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Submissions grow while they are short, shrink where one was long, and stay within bounds.
    #[test]
    fn sizes_follow_the_time() {
        let Sizes { first, least, most } = Sizes::RAYS;
        let pace = Pace::default();
        let next = || pace.submitted().next;
        pace.took(next(), TARGET / 10, true);
        pace.took(next() - 1, TARGET / 10, false);
        assert_eq!(next(), first, "nothing was told");
        pace.took(next(), TARGET / 10, false);
        assert_eq!(next(), 2 * first);
        pace.took(next(), TARGET / 2, false);
        assert_eq!(next(), 2 * first, "neither long nor short");
        for _ in 0..20 {
            pace.took(next(), TARGET / 10, false);
        }
        assert_eq!(next(), most);
        pace.took(next(), 2 * TARGET, true);
        assert_eq!(next(), most / 2);
        for _ in 0..20 {
            pace.took(next(), 2 * TARGET, false);
        }
        assert_eq!(next(), least);
    }
}
