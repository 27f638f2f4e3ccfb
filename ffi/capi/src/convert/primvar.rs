//! Primvars: samples of numbers of any type.

use std::ffi::c_void;

use hdtrapeze_core::scene::{Interpolation, PrimvarRole};
use hdtrapeze_delegate::primvar::{AuthoredPrimvar, AuthoredSample, Numbers};

use super::{pick, refuse};
use crate::constants::*;
use crate::fault::Fault;
use crate::input::{slice, times};
use crate::types::*;

/// Most numbers of a primvar's type: a matrix.
const WIDEST_TYPE: u32 = 16;

/// Safety: pointers in the struct are null or as the header says.
pub(crate) unsafe fn primvar<'a>(from: &trz_primvar) -> Result<AuthoredPrimvar<'a>, Fault> {
    let kinds = [
        Interpolation::Constant,
        Interpolation::Uniform,
        Interpolation::Varying,
        Interpolation::Vertex,
        Interpolation::FaceVarying,
    ];
    let roles = [PrimvarRole::None, PrimvarRole::Color];
    if !(1..=WIDEST_TYPE).contains(&from.width) {
        return refuse("width", from.width, "is not 1 to 16");
    }
    if from.sample_count == 0 {
        return Err(Fault::invalid("a primvar needs at least one sample"));
    }
    let count = from.sample_count;
    let mut samples = Vec::new();
    // SAFETY: as the caller promises.
    unsafe {
        let sample_times = slice(from.times, count, "times")?;
        let arrays = slice(from.values, count, "values")?;
        let counts = slice(from.value_counts, count, "value_counts")?;
        let (indices, index_counts) = match from.indices.is_null() {
            true => (&[][..], &[][..]),
            false => (
                slice(from.indices, count, "indices")?,
                slice(from.index_counts, count, "index_counts")?,
            ),
        };
        samples
            .try_reserve_exact(count)
            .map_err(|_| Fault::new(TRZ_ERROR_OUT_OF_MEMORY, "no memory for the samples"))?;
        for (i, &time) in sample_times.iter().enumerate() {
            let what = format!("values[{i}]");
            let length = times(counts[i], from.width as usize, &what)?;
            samples.push(AuthoredSample {
                time,
                values: numbers(from.r#type, arrays[i], length, &what)?,
                indices: match indices.get(i) {
                    Some(&array) => slice(array, index_counts[i], &format!("indices[{i}]"))?,
                    None => &[],
                },
            });
        }
    }
    Ok(AuthoredPrimvar {
        interpolation: pick(&kinds, from.interpolation, "interpolation")?,
        role: pick(&roles, from.role, "role")?,
        width: from.width as usize,
        element_size: from.element_size,
        unauthored_index: from.unauthored_index,
        samples,
    })
}

/// Safety: `first` is null or points to `count` numbers of the type.
pub(crate) unsafe fn numbers<'a>(
    kind: u32,
    first: *const c_void,
    count: usize,
    what: &str,
) -> Result<Numbers<'a>, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        Ok(match kind {
            TRZ_NUMBERS_FLOAT32 => Numbers::F32(slice(first.cast(), count, what)?),
            TRZ_NUMBERS_FLOAT64 => Numbers::F64(slice(first.cast(), count, what)?),
            TRZ_NUMBERS_FLOAT16 => Numbers::F16(slice(first.cast(), count, what)?),
            TRZ_NUMBERS_INT32 => Numbers::I32(slice(first.cast(), count, what)?),
            TRZ_NUMBERS_UINT32 => Numbers::U32(slice(first.cast(), count, what)?),
            TRZ_NUMBERS_INT64 => Numbers::I64(slice(first.cast(), count, what)?),
            TRZ_NUMBERS_UINT64 => Numbers::U64(slice(first.cast(), count, what)?),
            TRZ_NUMBERS_UINT8 => Numbers::U8(slice(first.cast(), count, what)?),
            other => return refuse("type", other, "is not known"),
        })
    }
}
