//! Seconds, and memory of this process.

use std::time::{Duration, Instant};

use cpu_time::ProcessTime;

/// The least that anything takes: rates are finite.
const LEAST: f64 = 1e-9;
/// What takes less is run again, so that clocks that move by steps of some milliseconds tell it too.
const SHORT: Duration = Duration::from_millis(10);

/// What seconds are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The clock on the wall.
    Wall,
    /// Processor time, of the system and of this process's threads, those that have ended too, divided by the number of
    /// rayon's: for machines that do other work too. Flatters whoever leaves threads idle.
    Cpu,
}

impl Clock {
    /// Runs `f`; what it returns, and the seconds that it took, which are more than 0.
    pub fn time<R>(self, f: impl FnOnce() -> R) -> (R, f64) {
        let (wall, cpu) = (Instant::now(), ProcessTime::now());
        let result = f();
        let seconds = match self {
            Clock::Wall => wall.elapsed().as_secs_f64(),
            Clock::Cpu => cpu.elapsed().as_secs_f64() / rayon::current_num_threads() as f64,
        };
        (result, seconds.max(LEAST))
    }

    /// Runs `f` on what `fresh` makes, again and again until that took [`SHORT`] on the wall; the last of these, and the
    /// mean of the seconds. Making them is not counted.
    pub fn mean<T>(self, fresh: impl Fn() -> T, f: impl Fn(&mut T)) -> (T, f64) {
        let (mut runs, mut total, mut spent) = (0.0, 0.0, Duration::ZERO);
        loop {
            let mut subject = fresh();
            let begun = Instant::now();
            let ((), seconds) = self.time(|| f(&mut subject));
            spent += begun.elapsed();
            runs += 1.0;
            total += seconds;
            if spent >= SHORT {
                return (subject, total / runs);
            }
        }
    }
}

/// Bytes in a line such as `VmHWM:  12 kB`; 0 where there is none.
fn kilobytes(file: &str, name: &str) -> u64 {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix(name));
    let number = line.and_then(|rest| rest.trim_start_matches(':').split_whitespace().next());
    number.and_then(|n| n.parse().ok()).unwrap_or(0u64) * 1024
}

/// The most memory that this process has held since [`forget_peak`].
pub fn peak_memory() -> u64 {
    kilobytes("/proc/self/status", "VmHWM")
}

/// Starts [`peak_memory`] anew.
pub fn forget_peak() {
    // Where it cannot be, peaks are of all that was before too.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// Memory that can be had.
pub fn free_memory() -> u64 {
    kilobytes("/proc/meminfo", "MemAvailable")
}

#[cfg(test)]
mod tests {
    use std::hint::black_box;
    use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

    use super::*;

    #[test]
    fn what_is_short_is_repeated_and_no_time_is_0() {
        for clock in [Clock::Wall, Clock::Cpu] {
            let ((), seconds) = clock.time(|| ());
            assert!(seconds > 0.0, "{clock:?}");
            let (made, runs) = (AtomicUsize::new(0), AtomicUsize::new(0));
            let work = |sum: &mut u64| {
                runs.fetch_add(1, Relaxed);
                *sum += (0..black_box(100_000)).map(black_box).sum::<u64>();
            };
            let fresh = || {
                made.fetch_add(1, Relaxed);
                0
            };
            let (sum, seconds) = clock.mean(fresh, work);
            // Each run had one of its own.
            assert_eq!(sum, 99_999 * 50_000);
            assert_eq!(made.into_inner(), runs.load(Relaxed));
            assert!(seconds > 0.0, "{clock:?}");
            // As many runs as it takes.
            let total = seconds * runs.into_inner() as f64;
            assert!(clock == Clock::Cpu || total > 0.009, "{total}");
        }
        // What is long enough runs once.
        let runs = AtomicUsize::new(0);
        let long = |(): &mut ()| {
            runs.fetch_add(1, Relaxed);
            std::thread::sleep(Duration::from_millis(20));
        };
        let ((), seconds) = Clock::Wall.mean(|| (), long);
        assert!(seconds >= 0.02);
        assert_eq!(runs.into_inner(), 1);
    }
}
