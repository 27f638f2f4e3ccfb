//! Vectors in large pages of memory.
//!
//! Rays that go all ways read nodes and vertices all over memory, and a processor keeps the places of some thousand pages:
//! of 4 KiB each, these are a few MiB, and what lies elsewhere is looked up first. Linux has pages of 2 MiB for those who
//! ask (`transparent_hugepage` at `madvise`, which most distributions set), or for all (`always`), or for nobody.

/// What large pages are multiples of, in size and place: of x86-64, and of AArch64 with pages of 4 KiB.
#[cfg(target_os = "linux")]
const LARGE: usize = 2 << 20;

/// Makes room for `more` items and asks that it be in large pages, of which there are none before something is written:
/// called on a vector that holds nothing yet. Nothing changes where the system has no such pages, and for what is smaller
/// than one.
pub fn reserve<T>(items: &mut Vec<T>, more: usize) {
    items.reserve_exact(more);
    expect_large(items);
}

/// As [`reserve`] for a vector that has its room.
#[cfg(target_os = "linux")]
pub fn expect_large<T>(items: &mut Vec<T>) {
    let start = items.as_mut_ptr().addr();
    let end = start + items.capacity() * size_of::<T>();
    let from = start.next_multiple_of(LARGE);
    let to = end - end % LARGE;
    if from < to {
        let first = items.as_mut_ptr().cast::<u8>().wrapping_add(from - start);
        #[allow(unsafe_code)]
        // SAFETY: the range is a part of the vector's own memory, and the advice changes none of its bytes. Where it is
        // refused, pages are as they were.
        unsafe {
            libc::madvise(first.cast(), to - from, libc::MADV_HUGEPAGE)
        };
    }
}

/// Elsewhere the system decides.
#[cfg(not(target_os = "linux"))]
pub fn expect_large<T>(_: &mut Vec<T>) {}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::fs;

    use super::*;

    /// Flags of the mapping that holds an address.
    fn flags(address: usize) -> String {
        let maps = fs::read_to_string("/proc/self/smaps").expect("Linux has it");
        let mut inside = false;
        for line in maps.lines() {
            let range = line.split(' ').next().unwrap_or_default().split_once('-');
            let number = |x| usize::from_str_radix(x, 16).ok();
            if let Some((Some(from), Some(to))) = range.map(|(from, to)| (number(from), number(to)))
            {
                inside = (from..to).contains(&address);
            }
            if inside && let Some(flags) = line.strip_prefix("VmFlags:") {
                return flags.to_owned();
            }
        }
        panic!("nothing is mapped there");
    }

    #[test]
    fn large_pages_are_asked_for() {
        if !fs::exists("/sys/kernel/mm/transparent_hugepage/enabled").is_ok_and(|there| there) {
            eprintln!("skipped: this system has no large pages");
            return;
        }
        for count in [0, 100, LARGE, 40 << 20] {
            let mut items: Vec<u8> = Vec::new();
            reserve(&mut items, count);
            assert!(items.capacity() >= count);
            items.extend((0..count).map(|i| i as u8));
            if count >= 2 * LARGE {
                let middle = items.as_ptr().addr() + count / 2;
                assert!(flags(middle).contains(" hg"), "{}", flags(middle));
            }
            assert!(items.iter().enumerate().all(|(i, &x)| x == i as u8));
        }
    }
}
