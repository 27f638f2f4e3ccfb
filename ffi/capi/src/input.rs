//! Reading what a C caller passes: null, alignment, sizes and UTF-8 are checked, nothing is trusted
//! beyond that a pointer that is not null points to what the header says.

use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::{ptr, slice};

use hdtrapeze_delegate::error::try_map;

use crate::constants::TRZ_ERROR_UNSUPPORTED;
use crate::fault::Fault;
use crate::types::*;

/// No struct of any version is larger; a size above is memory that was never written.
const LARGEST_STRUCT: usize = 4096;

/// A struct that begins with `struct_size`, made of integers, floats and pointers only.
///
/// # Safety
/// `repr(C)`, the first field is `struct_size: u32`, and all zero bytes are a valid value.
pub(crate) unsafe trait Versioned: Copy {
    /// C's name.
    const NAME: &'static str;
    /// Size in the first version of the ABI.
    const FIRST_SIZE: usize = size_of::<Self>();
    /// Sets the field.
    fn set_size(&mut self, size: u32);
}

macro_rules! versioned {
    ($($name:ident)*) => {$(
        // SAFETY: a `repr(C)` struct of plain numbers and pointers with `struct_size` first.
        unsafe impl Versioned for $name {
            const NAME: &'static str = stringify!($name);
            fn set_size(&mut self, size: u32) {
                self.struct_size = size;
            }
        }
    )*};
}

versioned! {
    trz_topology trz_points trz_primvar trz_instancer trz_curves trz_grids trz_implicit
    trz_nurbs_patch trz_nurbs_curves trz_camera trz_settings trz_progress trz_statistics
    trz_aov_desc trz_image trz_device trz_setting trz_view trz_product trz_planned trz_path trz_buffer
}

/// The size that a versioned struct says it has, checked.
///
/// # Safety
/// `from` is null or points to a `struct_size`.
unsafe fn stated_size<T: Versioned>(from: *const T, what: &str) -> Result<usize, Fault> {
    check_place(from, what)?;
    // SAFETY: not null and aligned; the struct begins with its size.
    let size = unsafe { from.cast::<u32>().read() } as usize;
    match size {
        0 => Err(Fault::invalid(format!(
            "struct_size of {what} is 0; set it to sizeof({})",
            T::NAME
        ))),
        _ if !(T::FIRST_SIZE..=LARGEST_STRUCT).contains(&size) => Err(Fault::invalid(format!(
            "struct_size of {what} is {size}, which no version of {} has",
            T::NAME
        ))),
        _ => Ok(size),
    }
}

/// A copy of a versioned struct; fields that the caller's version lacks are zero.
///
/// # Safety
/// `from` is null or points to a struct of the size that it states.
pub(crate) unsafe fn read<T: Versioned>(from: *const T, what: &str) -> Result<T, Fault> {
    // SAFETY: as this function's caller promises.
    let size = unsafe { stated_size(from, what) }?;
    let known = size.min(size_of::<T>());
    // SAFETY: the struct has `size` bytes; those beyond `T` are compared as bytes.
    let beyond = unsafe { slice::from_raw_parts(from.cast::<u8>().add(known), size - known) };
    if beyond.iter().any(|&byte| byte != 0) {
        return Err(Fault::new(
            TRZ_ERROR_UNSUPPORTED,
            format!(
                "{what} has fields that this version of {} does not know",
                T::NAME
            ),
        ));
    }
    let mut value = MaybeUninit::<T>::zeroed();
    // SAFETY: `known` bytes are readable and fit; zero bytes are valid for what was not copied.
    unsafe {
        ptr::copy_nonoverlapping(from.cast::<u8>(), value.as_mut_ptr().cast::<u8>(), known);
        Ok(value.assume_init())
    }
}

/// Fills a caller's versioned struct as far as it goes; its `struct_size` stays.
///
/// # Safety
/// `to` is null or points to a struct of the size that it states.
pub(crate) unsafe fn write<T: Versioned>(
    to: *mut T,
    mut value: T,
    what: &str,
) -> Result<(), Fault> {
    // SAFETY: as this function's caller promises.
    let size = unsafe { stated_size(to.cast_const(), what) }?;
    let known = size.min(size_of::<T>());
    // A stated size is at most `LARGEST_STRUCT`.
    value.set_size(size as u32);
    // SAFETY: the caller's struct has `size` bytes, and `known` is no more than either has.
    unsafe {
        ptr::copy_nonoverlapping((&raw const value).cast::<u8>(), to.cast::<u8>(), known);
        to.cast::<u8>().add(known).write_bytes(0, size - known);
    }
    Ok(())
}

/// A place to write a result to.
///
/// # Safety
/// `place` is null or valid for writing and not aliased while the result lives.
pub(crate) unsafe fn place<'a, T>(place: *mut T, what: &str) -> Result<&'a mut T, Fault> {
    check_place(place.cast_const(), what)?;
    // SAFETY: not null, aligned; as this function's caller promises.
    Ok(unsafe { &mut *place })
}

/// Places to write `count` results to; what is there counts for nothing.
///
/// # Safety
/// `first` is null or valid for writing `count` elements, and not aliased while the result lives.
pub(crate) unsafe fn places<'a, T: Copy + Default>(
    first: *mut T,
    count: usize,
    what: &str,
) -> Result<&'a mut [T], Fault> {
    check_slice(first.cast_const(), count, what)?;
    if count == 0 {
        return Ok(&mut []);
    }
    for i in 0..count {
        // SAFETY: not null, aligned; as this function's caller promises.
        unsafe { first.add(i).write(T::default()) };
    }
    // SAFETY: as above, and all elements have been written.
    Ok(unsafe { slice::from_raw_parts_mut(first, count) })
}

fn check_place<T>(place: *const T, what: &str) -> Result<(), Fault> {
    if place.is_null() {
        return Err(Fault::null(what));
    }
    if !place.is_aligned() {
        return Err(Fault::invalid(format!("{what} is not aligned")));
    }
    Ok(())
}

/// Checks an array without making a reference to it. An empty one may be anywhere.
pub(crate) fn check_slice<T>(first: *const T, count: usize, what: &str) -> Result<(), Fault> {
    if count == 0 {
        return Ok(());
    }
    check_place(first, what)?;
    match count.checked_mul(size_of::<T>()) {
        Some(bytes) if isize::try_from(bytes).is_ok() => Ok(()),
        _ => Err(Fault::invalid(format!(
            "{what} cannot have {count} elements"
        ))),
    }
}

/// An array of the caller.
///
/// # Safety
/// `first` is null or points to `count` elements that do not change while the result lives.
pub(crate) unsafe fn slice<'a, T>(
    first: *const T,
    count: usize,
    what: &str,
) -> Result<&'a [T], Fault> {
    check_slice(first, count, what)?;
    if count == 0 {
        return Ok(&[]);
    }
    // SAFETY: not null, aligned, not longer than memory; as this function's caller promises.
    Ok(unsafe { slice::from_raw_parts(first, count) })
}

/// Elements counted in groups: `count * each`, refused where that overflows.
pub(crate) fn times(count: usize, each: usize, what: &str) -> Result<usize, Fault> {
    count
        .checked_mul(each)
        .ok_or_else(|| Fault::invalid(format!("{what} cannot have {count} times {each} elements")))
}

/// A converted copy of an array.
pub(crate) fn copied<S, T>(from: &[S], convert: impl FnMut(&S) -> T) -> Result<Vec<T>, Fault> {
    Ok(try_map(from, convert)?)
}

/// A string of the caller.
///
/// # Safety
/// `text` is null or ends with a NUL, and does not change while the result lives.
pub(crate) unsafe fn text<'a>(text: *const c_char, what: &str) -> Result<&'a str, Fault> {
    check_place(text, what)?;
    // SAFETY: not null; as this function's caller promises.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str()
        .map_err(|_| Fault::invalid(format!("{what} is not UTF-8")))
}

/// A string of the caller, empty for null.
///
/// # Safety
/// As for [`text`].
pub(crate) unsafe fn text_or_empty(at: *const c_char, what: &str) -> Result<String, Fault> {
    match at.is_null() {
        true => Ok(String::new()),
        // SAFETY: as this function's caller promises.
        false => unsafe { text(at, what) }.map(str::to_owned),
    }
}

/// Copies of the caller's strings.
///
/// # Safety
/// As for [`slice`] and [`text`].
pub(crate) unsafe fn texts(
    first: *const *const c_char,
    count: usize,
    what: &str,
) -> Result<Vec<String>, Fault> {
    // SAFETY: as this function's caller promises.
    let pointers = unsafe { slice(first, count, what) }?;
    pointers
        .iter()
        .enumerate()
        // SAFETY: as this function's caller promises.
        .map(|(i, &at)| unsafe { text(at, &format!("{what}[{i}]")) }.map(str::to_owned))
        .collect()
}

/// 0 or 1.
pub(crate) fn flag(value: u32, what: &str) -> Result<bool, Fault> {
    match value {
        0 => Ok(false),
        1 => Ok(true),
        other => Err(Fault::invalid(format!("{what} is {other}, not 0 or 1"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::*;

    /// A `trz_primvar` of a later version, with a field more.
    #[repr(C)]
    struct Later {
        now: trz_primvar,
        added: u64,
    }

    fn primvar(struct_size: usize) -> trz_primvar {
        trz_primvar {
            struct_size: struct_size as u32,
            interpolation: TRZ_INTERPOLATION_VERTEX,
            r#type: TRZ_NUMBERS_FLOAT32,
            role: TRZ_ROLE_NONE,
            width: 3,
            element_size: 1,
            unauthored_index: -1,
            times: ptr::null(),
            sample_count: 0,
            values: ptr::null(),
            value_counts: ptr::null(),
            indices: ptr::null(),
            index_counts: ptr::null(),
        }
    }

    #[test]
    fn sizes_of_other_versions() {
        let read = |from: &trz_primvar| {
            // SAFETY: a live struct of at least the size that is accepted.
            unsafe { read(from, "primvar") }.map(|value| value.width)
        };
        let size = size_of::<trz_primvar>();
        assert_eq!(read(&primvar(size)).unwrap(), 3);
        for wrong in [0, 1, size - 1, LARGEST_STRUCT + 1, u32::MAX as usize] {
            assert!(read(&primvar(wrong)).is_err(), "{wrong}");
        }
        let mut later = Later {
            now: primvar(size_of::<Later>()),
            added: 0,
        };
        assert_eq!(read(&later.now).unwrap(), 3, "unknown but unused");
        later.added = 1;
        assert!(read(&later.now).is_err(), "unknown and used");
    }

    #[test]
    fn output_of_another_version_is_filled_as_far_as_it_goes() {
        let mut later = Later {
            now: primvar(size_of::<Later>()),
            added: 7,
        };
        let mut value = primvar(0);
        value.width = 9;
        // SAFETY: a live struct of the size that it states.
        unsafe { write((&raw mut later).cast::<trz_primvar>(), value, "out") }.unwrap();
        assert_eq!((later.now.width, later.added), (9, 0));
        assert_eq!(later.now.struct_size as usize, size_of::<Later>());
    }

    #[test]
    fn arrays_that_cannot_be() {
        let one = [1.0f32];
        let check = |at: *const f32, count| check_slice(at, count, "values");
        assert!(check(one.as_ptr(), 1).is_ok());
        assert!(check(ptr::null(), 0).is_ok());
        assert!(check(ptr::null(), 1).is_err());
        assert!(check(one.as_ptr(), usize::MAX).is_err());
        assert!(check(one.as_ptr(), usize::MAX / 4 + 2).is_err());
        let odd = one.as_ptr().cast::<u8>().wrapping_add(1).cast::<f32>();
        assert!(check(odd, 1).is_err());
        assert!(times(usize::MAX, 2, "values").is_err());
    }
}
