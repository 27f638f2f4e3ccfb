//! File names with places for the frame.

use std::ffi::{CStr, CString};
use std::ptr::null_mut;

use hdtrapeze::*;

use crate::support::*;

fn expanded(name: &str, frame: f64) -> String {
    let name = CString::new(name).unwrap();
    let mut needed = 0;
    // SAFETY: pointers to live values; the buffer is of the size that is told.
    unsafe {
        ok(trz_frame_name(
            name.as_ptr(),
            frame,
            null_mut(),
            0,
            &mut needed,
        ));
        let mut buffer = vec![0; needed];
        let text = buffer.as_mut_ptr();
        ok(trz_frame_name(
            name.as_ptr(),
            frame,
            text,
            needed,
            &mut needed,
        ));
        assert_eq!(needed, buffer.len());
        CStr::from_ptr(buffer.as_ptr()).to_str().unwrap().to_owned()
    }
}

#[test]
fn the_frame_is_filled_in() {
    assert_eq!(expanded("a.####.exr", 7.0), "a.0007.exr");
    assert_eq!(expanded("a_##.#_<F2>.exr", 1.5), "a_01.5_01.exr");
    assert_eq!(expanded("a.exr", 7.0), "a.exr");
    assert_eq!(expanded("a%04d.exr", f64::NAN), "a0000.exr");
    let mut small = [1; 4];
    let name = c"a.####.exr".as_ptr();
    // SAFETY: pointers to live values; the buffer is of the size that is told.
    let result = unsafe { trz_frame_name(name, 1.0, small.as_mut_ptr(), 4, &mut 0) };
    fails(result, TRZ_ERROR_BUFFER_TOO_SMALL);
    assert_eq!(small, [1; 4]);
}

#[test]
fn places_are_told() {
    let places = |name: &CStr| {
        let (mut count, mut decimals) = (99, 99);
        // SAFETY: pointers to live values.
        ok(unsafe { trz_frame_places(name.as_ptr(), &mut count, &mut decimals) });
        (count, decimals)
    };
    assert_eq!(places(c"a.exr"), (0, 0));
    assert_eq!(places(c"a.###.##.exr"), (1, 2));
    assert_eq!(places(c"a.###.##.$F.exr"), (2, 0));
}
