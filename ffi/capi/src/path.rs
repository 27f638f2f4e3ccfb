//! Samples of paths that hosts can evaluate at any time.

use std::ffi::c_void;

use hdtrapeze_core::motion::follow::{Next, Of, Path};
use hdtrapeze_delegate::samples::sample;

use crate::constants::TRZ_ERROR_BUFFER_TOO_SMALL;
use crate::convert::pick;
use crate::fault::{Fault, call};
use crate::input::{self, slice, times};
use crate::types::*;

/// Says at which times a path is to be evaluated next, so that the lines between its samples keep to it:
/// writes at most `capacity` (at least 1) of them to `times`, and how many to `count`. The host adds their
/// values to those known and asks again. With a count of 0 the path is known well enough: those samples i
/// are to be given to the renderer for which keep, known_count bytes, has keep[i] = 1. Where nothing
/// changes, that is the first alone; where a number is not finite, those of the start.
///
/// Samples are off by at most 1/4000 of the path's size (of points, of the box around their paths; of
/// matrices, of their largest number), but where that would take more than 64.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_OUT_OF_MEMORY. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_path_next(
    path: *const trz_path,
    times: *mut f64,
    capacity: usize,
    count: *mut usize,
    keep: *mut u8,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers.
    unsafe {
        call(|| {
            let known = known(&input::read(path, "path")?)?;
            if capacity == 0 {
                return Err(Fault::invalid("capacity is 0"));
            }
            let times = input::places(times, capacity, "times")?;
            let keep = input::places(keep, known.times.len(), "keep")?;
            let count = input::place(count, "count")?;
            *count = 0;
            match known.next() {
                Next::Evaluate(more) => {
                    *count = more.len().min(capacity);
                    times[..*count].copy_from_slice(&more[..*count]);
                }
                Next::Keep(kept) => kept.iter().for_each(|&i| keep[i] = 1),
            }
            Ok(())
        })
    }
}

/// Samples a transform as trz_path_next has it done, calling `evaluate` with `user` as often as needed: writes
/// at most `capacity` times, ascending, and as many matrices of 16 doubles, and how many to `count`.
/// `start`, ascending, are start_count times, at least 1, where the path may have corners, its ends
/// included. 64 samples, or start_count where that is more, are always enough. A count of 0 says that
/// values are held next to one of these times: then the host knows no path, but samples of one.
///
/// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_BUFFER_TOO_SMALL. Threads: any.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trz_path_sample(
    start: *const f64,
    start_count: usize,
    evaluate: trz_evaluate_fn,
    user: *mut c_void,
    times: *mut f64,
    matrices: *mut f64,
    capacity: usize,
    count: *mut usize,
) -> trz_result {
    // SAFETY: the caller passes null or valid pointers, and a function that may be called.
    unsafe {
        call(|| {
            let start = slice(start, start_count, "start")?;
            let evaluate = evaluate.ok_or_else(|| Fault::null("evaluate"))?;
            let doubles = input::times(capacity, 16, "matrices")?;
            let matrices = input::places(matrices, doubles, "matrices")?;
            let times = input::places(times, capacity, "times")?;
            let count = input::place(count, "count")?;
            check_start(start)?;
            let at = |time| {
                let mut matrix = [0.0; 16];
                evaluate(user, time, matrix.as_mut_ptr());
                matrix
            };
            let samples = sample(start, at).unwrap_or_default();
            if samples.len() > capacity {
                let text = format!("there are {} samples", samples.len());
                return Err(Fault::new(TRZ_ERROR_BUFFER_TOO_SMALL, text));
            }
            for (i, (time, matrix)) in samples.iter().enumerate() {
                times[i] = *time;
                matrices[16 * i..16 * (i + 1)].copy_from_slice(matrix);
            }
            *count = samples.len();
            Ok(())
        })
    }
}

/// Times where a path may have corners.
fn check_start(start: &[f64]) -> Result<(), Fault> {
    let ascends = !start.is_empty() && start.windows(2).all(|w| w[0] < w[1]);
    match ascends && start.iter().all(|t| t.is_finite()) {
        true => Ok(()),
        false => Err(Fault::invalid(
            "times are not finite, or not at least one to start with, ascending",
        )),
    }
}

/// Safety: pointers in the struct are null or as the header says.
unsafe fn known<'a>(from: &trz_path) -> Result<Path<'a>, Fault> {
    let of = pick(&[Of::Matrices, Of::Points], from.of, "of")?;
    let width = match of {
        Of::Matrices => 16,
        Of::Points => 3,
    };
    let length = times(from.element_count, width, "values")?;
    // SAFETY: as the caller promises.
    let (known, arrays) = unsafe {
        (
            slice(from.times, from.known_count, "times")?,
            slice(from.values, from.known_count, "values")?,
        )
    };
    check_start(known.get(..from.start_count).unwrap_or_default())?;
    if !known.iter().all(|t| t.is_finite()) {
        return Err(Fault::invalid("times are not finite"));
    }
    let array = |(i, &array): (usize, &*const f64)| {
        // SAFETY: as the caller promises.
        unsafe { slice(array, length, &format!("values[{i}]")) }
    };
    Ok(Path {
        of,
        times: known,
        start: from.start_count,
        values: arrays
            .iter()
            .enumerate()
            .map(array)
            .collect::<Result<_, _>>()?,
    })
}
