//! Samples of paths that the host can evaluate at any time.

use std::ffi::c_void;

use hdtrapeze::*;

use crate::support::*;

/// What a host has evaluated, for a call.
struct Known {
    times: Vec<f64>,
    values: Vec<Vec<f64>>,
}

impl Known {
    /// Asks once, for at most `capacity` times: those to evaluate, and what is kept.
    fn next(&self, of: u32, start_count: usize, capacity: usize) -> (Vec<f64>, Vec<u8>) {
        let arrays: Vec<*const f64> = self.values.iter().map(|v| v.as_ptr()).collect();
        let path = trz_path {
            struct_size: size_of::<trz_path>() as u32,
            of,
            times: self.times.as_ptr(),
            start_count,
            known_count: self.times.len(),
            values: arrays.as_ptr(),
            element_count: self.values[0].len() / if of == TRZ_PATH_POINTS { 3 } else { 16 },
        };
        let mut times = vec![f64::NAN; capacity];
        let mut count = usize::MAX;
        let mut keep = vec![7; self.times.len()];
        // SAFETY: pointers to live values, arrays as long as the struct says.
        ok(unsafe {
            trz_path_next(
                &path,
                times.as_mut_ptr(),
                capacity,
                &mut count,
                keep.as_mut_ptr(),
            )
        });
        times.truncate(count);
        (times, keep)
    }
}

/// The times that are kept of a path from 0 to 1.
fn follow(of: u32, capacity: usize, evaluate: impl Fn(f64) -> Vec<f64>) -> Vec<f64> {
    let mut known = Known {
        times: vec![0.0, 1.0],
        values: vec![evaluate(0.0), evaluate(1.0)],
    };
    loop {
        let (more, keep) = known.next(of, 2, capacity);
        if more.is_empty() {
            let times = known.times.iter().zip(keep);
            let mut kept: Vec<f64> = times.filter(|t| t.1 == 1).map(|t| *t.0).collect();
            kept.sort_by(f64::total_cmp);
            return kept;
        }
        assert!(more.len() <= capacity && keep.iter().all(|&k| k == 0));
        known.values.extend(more.iter().map(|&t| evaluate(t)));
        known.times.extend(more);
    }
}

fn turning(time: f64) -> Vec<f64> {
    let (sine, cosine) = time.sin_cos();
    let mut matrix = IDENTITY;
    (matrix[0], matrix[1]) = (cosine, sine);
    (matrix[4], matrix[5]) = (-sine, cosine);
    matrix.to_vec()
}

#[test]
fn turning_matrices_get_samples_on_their_arc() {
    let kept = follow(TRZ_PATH_MATRICES, 64, turning);
    assert!((8..64).contains(&kept.len()), "{kept:?}");
    for w in kept.windows(2) {
        let (a, b) = (turning(w[0]), turning(w[1]));
        let middle = turning(0.5 * (w[0] + w[1]));
        assert!((0..16).all(|i| (0.5 * (a[i] + b[i]) - middle[i]).abs() <= 1.0 / 4000.0));
    }
    assert_eq!(follow(TRZ_PATH_MATRICES, 1, turning), kept, "one at a time");
    let moving = |t| [t, 0.0, 0.0, 1.0, t, 0.0].to_vec();
    assert_eq!(follow(TRZ_PATH_POINTS, 64, moving), [0.0, 1.0]);
    let still = |_| vec![1.0; 3];
    assert_eq!(follow(TRZ_PATH_POINTS, 64, still), [0.0]);
}

/// The times of a host's that is asked for a path from -0.5 to 0.5, and how many matrices there is room for.
fn sample(
    start: &[f64],
    capacity: usize,
    evaluate: fn(f64) -> Vec<f64>,
) -> Result<Vec<f64>, trz_result> {
    unsafe extern "C" fn call(user: *mut c_void, time: f64, matrix: *mut f64) {
        // SAFETY: it is the function below.
        let evaluate: fn(f64) -> Vec<f64> = unsafe { *user.cast() };
        // SAFETY: there is room for a matrix.
        unsafe { std::slice::from_raw_parts_mut(matrix, 16) }.copy_from_slice(&evaluate(time));
    }
    let (mut times, mut matrices, mut count) = (vec![0.0; capacity], vec![0.0; 16 * capacity], 7);
    let user = (&raw const evaluate).cast_mut().cast();
    // SAFETY: pointers to live values, arrays as long as the capacity says.
    let result = unsafe {
        let (at, values) = (times.as_mut_ptr(), matrices.as_mut_ptr());
        trz_path_sample(
            start.as_ptr(),
            start.len(),
            Some(call),
            user,
            at,
            values,
            capacity,
            &mut count,
        )
    };
    if result != TRZ_OK {
        assert_eq!(count, 7);
        return Err(result);
    }
    times.truncate(count);
    let found = |(i, t): (usize, &f64)| evaluate(*t) == matrices[16 * i..16 * (i + 1)];
    assert!(times.iter().enumerate().all(found));
    Ok(times)
}

#[test]
fn a_transform_is_sampled_by_calling_the_host() {
    let times = sample(&[0.0, 1.0], 64, turning).unwrap();
    assert_eq!(times, follow(TRZ_PATH_MATRICES, 64, turning));
    assert_eq!(
        sample(&[0.0, 1.0], 2, turning),
        Err(TRZ_ERROR_BUFFER_TOO_SMALL)
    );
    let held = |time: f64| turning(time.floor());
    assert_eq!(
        sample(&[0.0, 1.0], 64, held).unwrap(),
        [],
        "no path, but samples"
    );
    assert_eq!(sample(&[0.0, 1.0], 64, |_| turning(1.0)).unwrap(), [0.0]);
    for start in [&[][..], &[1.0, 0.0], &[0.0, f64::NAN]] {
        assert_eq!(sample(start, 64, turning), Err(TRZ_ERROR_INVALID_ARGUMENT));
    }
}

#[test]
fn paths_that_cannot_be() {
    let origin = [0.0; 3];
    let values = [origin.as_ptr(); 2];
    let refused = |times: [f64; 2], start_count: usize, of: u32, capacity: usize| {
        let path = trz_path {
            struct_size: size_of::<trz_path>() as u32,
            of,
            times: times.as_ptr(),
            start_count,
            known_count: 2,
            values: values.as_ptr(),
            element_count: usize::from(of == TRZ_PATH_POINTS),
        };
        let (mut at, mut count, mut keep) = ([0.0; 8], 0, [0; 2]);
        // SAFETY: pointers to live values.
        let result = unsafe {
            trz_path_next(
                &path,
                at.as_mut_ptr(),
                capacity,
                &mut count,
                keep.as_mut_ptr(),
            )
        };
        result == TRZ_ERROR_INVALID_ARGUMENT
    };
    assert!(!refused([0.0, 1.0], 2, TRZ_PATH_POINTS, 8));
    assert!(refused([0.0, 1.0], 0, TRZ_PATH_POINTS, 8), "no start");
    assert!(
        refused([0.0, 1.0], 3, TRZ_PATH_POINTS, 8),
        "more than known"
    );
    assert!(refused([1.0, 0.0], 2, TRZ_PATH_POINTS, 8), "descending");
    assert!(refused([0.0, f64::NAN], 1, TRZ_PATH_POINTS, 8));
    assert!(refused([0.0, 1.0], 2, 9, 8), "of nothing known");
    assert!(refused([0.0, 1.0], 2, TRZ_PATH_POINTS, 0), "no capacity");
}
