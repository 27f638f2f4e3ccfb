//! What the system says about memory (Linux's /proc; elsewhere nothing is known).

use std::fs;

/// More bytes than there are.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what} takes {} MiB, {} MiB are free", needed >> 20, free >> 20)]
pub struct OutOfMemory {
    what: String,
    needed: u64,
    free: u64,
}

/// Refuses to take more bytes than there are, where the system tells: Rust aborts otherwise.
///
/// # Errors
/// As it says.
pub fn check(needed: u64, what: &str) -> Result<(), OutOfMemory> {
    match available_bytes() {
        Some(free) if needed > free => Err(OutOfMemory {
            what: what.to_owned(),
            needed,
            free,
        }),
        _ => Ok(()),
    }
}

/// Bytes that can be taken without swapping, where the system tells.
fn available_bytes() -> Option<u64> {
    kib_line(&fs::read_to_string("/proc/meminfo").ok()?, "MemAvailable:")
}

/// Largest resident size of the process so far, where the system tells.
pub fn peak_bytes() -> Option<u64> {
    kib_line(&fs::read_to_string("/proc/self/status").ok()?, "VmHWM:")
}

fn kib_line(text: &str, name: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kib: u64 = rest.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kib.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_what_no_machine_has() {
        assert!(check(1, "one byte").is_ok());
        if available_bytes().is_some() {
            assert!(check(u64::MAX, "everything").is_err());
        }
    }

    #[test]
    fn reads_kibibytes() {
        let text = "MemTotal:       16 kB\nMemAvailable:    7 kB\n";
        assert_eq!(kib_line(text, "MemAvailable:"), Some(7 * 1024));
        assert_eq!(kib_line(text, "MemFree:"), None);
        assert_eq!(kib_line("MemAvailable: x kB", "MemAvailable:"), None);
    }
}
