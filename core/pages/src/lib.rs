//! Vectors in large pages of memory.
//!
//! Rays that go all ways read nodes and vertices all over memory, and a processor keeps the places of some thousand pages:
//! of 4 KiB each, these are a few MiB, and what lies elsewhere is looked up first. Linux has pages of 2 MiB
//! (`transparent_hugepage`) for those who ask, where it is set to `madvise`, or for all, or for nobody.
//!
//! Pages become large when something is written to them first. Those that are there stay small unless they are asked to
//! [settle], since an allocator gives what was in use before. A vector that was asked for them should not grow: it would be copied to
//! where nobody asked.

#[cfg(any(target_os = "linux", test))]
use std::ops::Range;

use rayon::prelude::*;

/// What large pages are multiples of, in size and place: of x86-64, and of AArch64 with pages of 4 KiB.
const LARGE: usize = 2 << 20;

/// Makes room for `more` items and asks that all of it be in large pages. For a vector that holds next to nothing yet. Nothing
/// changes where the system has no such pages, and for what is smaller than one.
pub fn reserve<T>(items: &mut Vec<T>, more: usize) {
    items.reserve_exact(more);
    expect_large(items);
}

/// As [`reserve`] for a vector that has its room.
#[cfg(target_os = "linux")]
pub fn expect_large<T>(items: &mut Vec<T>) {
    let start = items.as_mut_ptr().addr();
    if let Some(inside) = large_pages(start, items.capacity() * size_of::<T>()) {
        let first = items.as_mut_ptr().cast::<u8>();
        let first = first.wrapping_add(inside.start - start);
        #[allow(unsafe_code)]
        // SAFETY: the range is a part of the vector's own memory (`large_pages`), and the advice changes none of its bytes. Where
        // it is refused, pages are as they were.
        unsafe {
            libc::madvise(first.cast(), inside.len(), libc::MADV_HUGEPAGE)
        };
    }
}

/// Elsewhere the system decides.
#[cfg(not(target_os = "linux"))]
pub fn expect_large<T>(_: &mut Vec<T>) {}

/// Less than this need not [settle]: a processor keeps the places of so much in small pages, and to be asked takes the system a
/// while, in which no memory is given to other threads.
#[cfg(any(target_os = "linux", test))]
const LEAST: usize = 4 << 20;

/// As Linux has it from 6.1 on, for all processors; not every libc names it.
#[cfg(target_os = "linux")]
const MADV_COLLAPSE: libc::c_int = 25;

/// Asks that items that are there already lie in large pages from now on, which takes about as long as clearing as many. True
/// where they do. Otherwise some may, and others as before: where the system can't, or gives large pages to nobody. Nothing is
/// asked, and true is given, for what is smaller than 4 MiB.
#[cfg(target_os = "linux")]
pub fn settle<T>(items: &[T]) -> bool {
    let start = items.as_ptr().addr();
    let inside = large_pages(start, size_of_val(items));
    let Some(inside) = inside.filter(|inside| inside.len() >= LEAST) else {
        return true;
    };
    if !are_given() {
        return false;
    }
    let first = items.as_ptr().cast::<u8>();
    let first = first.wrapping_add(inside.start - start).cast_mut();
    #[allow(unsafe_code)]
    // SAFETY: the range is a part of the items' own memory (`large_pages`), none of whose bytes is changed, whatever the answer:
    // they may lie elsewhere in the machine then, at the same addresses.
    let refused = unsafe { libc::madvise(first.cast(), inside.len(), MADV_COLLAPSE) };
    refused == 0
}

/// Elsewhere the system decides, and nothing is known.
#[cfg(not(target_os = "linux"))]
pub fn settle<T>(_: &[T]) -> bool {
    false
}

/// False where someone wants no large pages in the system: [`MADV_COLLAPSE`] would not ask.
#[cfg(target_os = "linux")]
fn are_given() -> bool {
    static GIVEN: std::sync::OnceLock<bool> = std::sync::OnceLock::new();
    *GIVEN.get_or_init(|| {
        std::fs::read_to_string(ENABLED).is_ok_and(|enabled| !enabled.contains("[never]"))
    })
}

/// Who is given large pages.
const ENABLED: &str = "/sys/kernel/mm/transparent_hugepage/enabled";

/// Joins parts in large pages, in parallel: what `each` makes of each item, given the number of its part.
pub fn joined<T: Copy + Send + Sync>(
    parts: Vec<&[T]>,
    each: impl Fn(usize, &T) -> T + Sync,
) -> Vec<T> {
    let mut items = Vec::new();
    let count = parts.iter().map(|part| part.len()).sum();
    reserve(&mut items, count);
    let mut room = &mut items.spare_capacity_mut()[..count];
    let mut places = Vec::with_capacity(parts.len());
    for part in parts {
        let (place, rest) = std::mem::take(&mut room).split_at_mut(part.len());
        places.push((place, part));
        room = rest;
    }
    let places = places.into_par_iter().enumerate();
    places.for_each(|(k, (place, part))| {
        for (to, from) in place.iter_mut().zip(part) {
            to.write(each(k, from));
        }
    });
    #[allow(unsafe_code)]
    // SAFETY: the vector has room for `count` items, and all were written: the places of all parts, which are `count` together, are
    // as long as these.
    unsafe {
        items.set_len(count)
    };
    items
}

/// The large pages that lie within so many bytes.
#[cfg(any(target_os = "linux", test))]
fn large_pages(start: usize, bytes: usize) -> Option<Range<usize>> {
    let end = start + bytes;
    let from = start.checked_next_multiple_of(LARGE)?;
    let to = end - end % LARGE;
    (from < to).then_some(from..to)
}

/// True where the system was asked for large pages at the first of some items that one may begin at; none where that is not known.
/// For tests: it reads a list of all memory.
#[doc(hidden)]
pub fn were_asked_for<T>(items: &[T]) -> Option<bool> {
    let flags = told_of(items, "VmFlags:")?;
    Some(flags.split(' ').any(|flag| flag == "hg"))
}

/// What the system tells of the memory at the first of some items that a large page may begin at.
fn told_of<T>(items: &[T], what: &str) -> Option<String> {
    if !std::fs::exists(ENABLED).ok()? {
        return None;
    }
    let address = items.as_ptr().addr().next_multiple_of(LARGE);
    let maps = std::fs::read_to_string("/proc/self/smaps").ok()?;
    let mut inside = false;
    for line in maps.lines() {
        let range = line.split(' ').next().unwrap_or_default().split_once('-');
        let number = |x| usize::from_str_radix(x, 16).ok();
        if let Some((Some(from), Some(to))) = range.map(|(from, to)| (number(from), number(to))) {
            inside = (from..to).contains(&address);
        }
        if inside && let Some(told) = line.strip_prefix(what) {
            return Some(told.trim().into());
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_pages_lie_within() {
        let page = |from: usize, to: usize| Some(from * LARGE..to * LARGE);
        for (start, bytes, expected) in [
            (8, 0, None),
            (3 * LARGE, LARGE - 1, None),
            (3 * LARGE, LARGE, page(3, 4)),
            (3 * LARGE, 2 * LARGE + 5, page(3, 5)),
            (3 * LARGE + 16, LARGE, None),
            (3 * LARGE + 16, 2 * LARGE - 17, None),
            (3 * LARGE + 16, 2 * LARGE - 16, page(4, 5)),
            (3 * LARGE - 1, LARGE + 1, page(3, 4)),
            (usize::MAX - 5, 5, None),
        ] {
            assert_eq!(large_pages(start, bytes), expected, "{start} {bytes}");
        }
    }

    #[test]
    fn parts_are_joined_in_their_order() {
        for lengths in [
            &[][..],
            &[0],
            &[3],
            &[0, 5, 0, 1, 7],
            &[1_500_000, 0, 2_000_000, 1],
        ] {
            let mut next = 0u32;
            let parts: Vec<Vec<u32>> = lengths
                .iter()
                .map(|&length| {
                    next += length;
                    (next - length..next).collect()
                })
                .collect();
            let slices = parts.iter().map(Vec::as_slice).collect();
            let all = joined(slices, |k, &x| 8 * x + k as u32);
            if next > 1 << 20 {
                assert_ne!(were_asked_for(&all), Some(false));
            }
            let expected = (0u32..).zip(&parts);
            let expected = expected.flat_map(|(k, part)| part.iter().map(move |&x| 8 * x + k));
            assert!(all.into_iter().eq(expected), "{lengths:?}");
        }
    }

    #[test]
    fn large_pages_are_asked_for() {
        for count in [0, 100, 40 << 20] {
            let mut items: Vec<u8> = Vec::new();
            reserve(&mut items, count);
            assert!(items.capacity() >= count);
            items.extend((0..count).map(|i| i as u8));
            if count >= 2 * LARGE {
                match were_asked_for(&items) {
                    Some(asked) => assert!(asked),
                    None => eprintln!("skipped: this system does not tell"),
                }
            }
            assert!(items.iter().enumerate().all(|(i, &x)| x == i as u8));
        }
        reserve(&mut vec![(); 3], 1 << 40);
    }

    #[test]
    fn what_is_there_goes_into_large_pages() {
        // Small ones, unless the system gives large ones to all.
        let bytes: Vec<u8> = (0..40usize << 20).map(|i| (i >> 7) as u8).collect();
        assert!(settle(&bytes[..100]) || !cfg!(target_os = "linux"));
        if settle(&bytes) {
            let large = told_of(&bytes, "AnonHugePages:");
            let large = large.and_then(|large| large.trim_end_matches(" kB").parse::<usize>().ok());
            let all =
                large_pages(bytes.as_ptr().addr(), bytes.len()).map_or(0, |pages| pages.len());
            assert!(
                all > LEAST && large.is_none_or(|large| large >= all / 1024),
                "{large:?}"
            );
        } else {
            eprintln!("skipped: this system does not make pages large");
        }
        assert!(bytes.iter().enumerate().all(|(i, &x)| x == (i >> 7) as u8));
    }
}
