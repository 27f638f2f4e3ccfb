//! Authored primvars to the renderer's: whatever a type's numbers are, they become 32 bits.

use std::sync::Arc;

use half::f16;
use hdtrapeze_core::scene::{
    Interpolation, PrimvarDesc, PrimvarRole, PrimvarSample, PrimvarValues,
};

use crate::error::{Error, try_copy, try_map};

/// Numbers as a host has them.
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)] // named as Rust's types are
pub enum Numbers<'a> {
    F32(&'a [f32]),
    F64(&'a [f64]),
    /// Bits of 16-bit floats.
    F16(&'a [u16]),
    I32(&'a [i32]),
    U32(&'a [u32]),
    I64(&'a [i64]),
    U64(&'a [u64]),
    /// Also for truth values.
    U8(&'a [u8]),
}

impl Numbers<'_> {
    /// All as real numbers.
    pub fn to_f64(self) -> Vec<f64> {
        fn reals<T: Copy>(values: &[T], real: impl Fn(T) -> f64) -> Vec<f64> {
            values.iter().map(|&value| real(value)).collect()
        }
        match self {
            Numbers::F32(values) => reals(values, f64::from),
            Numbers::F64(values) => values.to_vec(),
            Numbers::F16(values) => reals(values, |bits| f16::from_bits(bits).to_f64()),
            Numbers::I32(values) => reals(values, f64::from),
            Numbers::U32(values) => reals(values, f64::from),
            Numbers::I64(values) => reals(values, |value| value as f64),
            Numbers::U64(values) => reals(values, |value| value as f64),
            Numbers::U8(values) => reals(values, f64::from),
        }
    }
}

/// One sample of a primvar as authored.
#[derive(Clone, Copy, Debug)]
pub struct AuthoredSample<'a> {
    /// Time code relative to the frame.
    pub time: f64,
    /// Values.
    pub values: Numbers<'a>,
    /// Indices, or none.
    pub indices: &'a [i32],
}

/// A primvar as authored; see [`PrimvarDesc`] for its fields.
#[derive(Clone, Debug, Default)]
#[allow(missing_docs)] // as in PrimvarDesc
pub struct AuthoredPrimvar<'a> {
    pub interpolation: Interpolation,
    pub role: PrimvarRole,
    pub width: usize,
    pub element_size: i32,
    pub unauthored_index: i32,
    pub samples: Vec<AuthoredSample<'a>>,
}

/// The renderer's primvar, and how many whole numbers do not fit 32 bits: they become the nearest
/// that does. Unsigned ones keep their bits, so that those from 2^31 are negative as i32. Reals beyond 32 bits become infinite, which is found when they are used.
pub fn primvar(from: &AuthoredPrimvar<'_>) -> Result<(PrimvarDesc, usize), Error> {
    let mut clipped = 0;
    let mut samples = Vec::with_capacity(from.samples.len());
    for sample in &from.samples {
        samples.push(PrimvarSample {
            time: sample.time,
            values: Arc::new(values(sample.values, &mut clipped)?),
            indices: Arc::new(try_copy(sample.indices)?),
        });
    }
    let desc = PrimvarDesc {
        interpolation: from.interpolation,
        role: from.role,
        is_unsigned: from
            .samples
            .iter()
            .any(|sample| matches!(sample.values, Numbers::U32(_) | Numbers::U64(_))),
        width: from.width,
        element_size: from.element_size,
        unauthored_index: from.unauthored_index,
        samples,
    };
    Ok((desc, clipped))
}

fn values(from: Numbers<'_>, clipped: &mut usize) -> Result<PrimvarValues, Error> {
    Ok(match from {
        Numbers::F32(v) => PrimvarValues::Float(try_copy(v)?),
        Numbers::F64(v) => PrimvarValues::Float(try_map(v, |&x| x as f32)?),
        Numbers::F16(v) => PrimvarValues::Float(try_map(v, |&x| f16::from_bits(x).to_f32())?),
        Numbers::I32(v) => PrimvarValues::Int(try_copy(v)?),
        Numbers::U8(v) => PrimvarValues::Int(try_map(v, |&x| x.into())?),
        Numbers::U32(v) => PrimvarValues::Int(try_map(v, |&x| x.cast_signed())?),
        Numbers::I64(v) => PrimvarValues::Int(try_map(v, |&x| fit(x, clipped))?),
        Numbers::U64(v) => PrimvarValues::Int(try_map(v, |&x| fit_unsigned(x, clipped))?),
    })
}

fn fit(x: i64, clipped: &mut usize) -> i32 {
    i32::try_from(x).unwrap_or_else(|_| {
        *clipped += 1;
        if x < 0 { i32::MIN } else { i32::MAX }
    })
}

fn fit_unsigned(x: u64, clipped: &mut usize) -> i32 {
    let kept = u32::try_from(x).unwrap_or_else(|_| {
        *clipped += 1;
        u32::MAX
    });
    kept.cast_signed()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_becomes_32_bits() {
        let mut clipped = 0;
        let mut convert = |numbers| values(numbers, &mut clipped).unwrap();
        let floats = PrimvarValues::Float(vec![1.0, -2.5]);
        assert_eq!(convert(Numbers::F32(&[1.0, -2.5])), floats);
        assert_eq!(convert(Numbers::F64(&[1.0, -2.5])), floats);
        let halves = [1.0, -2.5].map(|x| f16::from_f32(x).to_bits());
        assert_eq!(convert(Numbers::F16(&halves)), floats);
        let whole = |values: &[i32]| PrimvarValues::Int(values.to_vec());
        assert_eq!(convert(Numbers::I32(&[-1, 7])), whole(&[-1, 7]));
        assert_eq!(convert(Numbers::U8(&[0, 255])), whole(&[0, 255]));
        assert_eq!(convert(Numbers::U32(&[7, u32::MAX])), whole(&[7, -1]));
        let ends = [i64::MIN, -1, i64::MAX];
        assert_eq!(
            convert(Numbers::I64(&ends)),
            whole(&[i32::MIN, -1, i32::MAX])
        );
        assert_eq!(convert(Numbers::U64(&[u64::MAX, 2])), whole(&[-1, 2]));
        let kept = whole(&[3_000_000_000u32.cast_signed()]);
        assert_eq!(convert(Numbers::U32(&[3_000_000_000])), kept);
        assert_eq!(convert(Numbers::U64(&[3_000_000_000])), kept);
        assert_eq!(
            convert(Numbers::F64(&[1.0e300])),
            PrimvarValues::Float(vec![f32::INFINITY])
        );
        assert_eq!(clipped, 3);
    }
}
