//! Seconds, and memory of this process.

use std::time::Instant;

/// What seconds are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The clock on the wall.
    Wall,
    /// Processor time of all threads, divided by their number: for machines that do other work too.
    /// Flatters whoever leaves threads idle.
    Cpu,
}

impl Clock {
    /// Runs `f`; what it returns, and the seconds that it took.
    pub fn time<R>(self, f: impl FnOnce() -> R) -> (R, f64) {
        let (wall, cpu) = (Instant::now(), cpu_seconds());
        let result = f();
        let seconds = match self {
            Clock::Wall => wall.elapsed().as_secs_f64(),
            Clock::Cpu => (cpu_seconds() - cpu) / rayon::current_num_threads() as f64,
        };
        (result, seconds)
    }
}

/// Processor time of all threads so far; NaN where the system does not tell.
fn cpu_seconds() -> f64 {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else {
        return f64::NAN;
    };
    let of_task = |task: std::io::Result<std::fs::DirEntry>| {
        let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    };
    tasks.filter_map(of_task).sum::<f64>() * 1e-9
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
