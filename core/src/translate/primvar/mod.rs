//! One primvar resolved against the counts of its prim and the shutter: checked values at keys.
//!
//! What does not fit is left out with one warning: a time sample where others remain, else the
//! primvar. A single value serves every interpolation. [`spread`] carries the result over a mesh.
//!
//! **Whole numbers.** Surfaces carry floats, so a whole number goes as two of them, its upper and lower
//! 16 bits ([`split`], [`join`]): exact, as long as nothing interpolates them.

mod keys;
pub mod spread;

use crate::diagnostics::{Code, Warning};
use crate::motion::Shutter;
use crate::scene::{Interpolation, PrimvarDesc, PrimvarRole};

pub use spread::Spread;

/// Most numbers of one value: a matrix.
pub const WIDEST: usize = 16;

/// So many of what: faces of a mesh, points of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Count(pub usize, pub &'static str);

/// How many values a primvar of a prim has in each interpolation. Kinds of prims that have no
/// vertices say 1: a single value is all that they take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// The kind of prim, for messages.
    pub prim: &'static str,
    /// Uniform.
    pub uniform: Count,
    /// Varying.
    pub varying: Count,
    /// Vertex.
    pub vertex: Count,
    /// Face-varying.
    pub face_varying: Count,
    /// True where the prim may be a part of something larger: values beyond these are left alone.
    pub more_is_fine: bool,
}

impl Counts {
    /// For prims without parts of their own.
    pub const fn one_value(prim: &'static str) -> Self {
        let one = Count(1, "value");
        Self {
            prim,
            uniform: one,
            varying: one,
            vertex: one,
            face_varying: one,
            more_is_fine: false,
        }
    }

    /// Values of a primvar with `interpolation`.
    pub fn of(&self, interpolation: Interpolation) -> Count {
        match interpolation {
            Interpolation::Constant => Count(1, "value"),
            Interpolation::Uniform => self.uniform,
            Interpolation::Varying => self.varying,
            Interpolation::Vertex => self.vertex,
            Interpolation::FaceVarying => self.face_varying,
        }
    }
}

/// A checked primvar at keys across the shutter.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolved {
    /// Constant wherever one value serves all.
    pub interpolation: Interpolation,
    /// Role.
    pub role: PrimvarRole,
    /// True for whole numbers, which take two floats each and are never interpolated.
    pub is_integer: bool,
    /// As in [`PrimvarDesc`].
    pub is_unsigned: bool,
    /// Numbers a value at one key.
    pub width: usize,
    /// Key times in [0, 1], ascending from 0; `[0]` where nothing changes.
    pub key_times: Vec<f32>,
    /// `[value][key][lane]`.
    pub values: Vec<f32>,
    /// The value of each item, in authored order; empty where item i has value i.
    pub indices: Vec<u32>,
}

impl Resolved {
    /// The value of a prim that takes one only.
    pub fn into_constant<C>(self) -> Spread<C> {
        Spread::Constant(self.item(0).to_vec())
    }

    /// Floats a value at one key.
    pub fn lanes(&self) -> usize {
        self.width * if self.is_integer { 2 } else { 1 }
    }

    /// Floats a value at all keys.
    pub fn stride(&self) -> usize {
        self.lanes() * self.key_times.len()
    }

    /// Items: values as they are spread over the prim.
    pub fn item_count(&self) -> usize {
        match self.indices.is_empty() {
            true => self.values.len() / self.stride(),
            false => self.indices.len(),
        }
    }

    /// Item `i`, `[key][lane]`.
    pub fn item(&self, i: usize) -> &[f32] {
        let value = self.indices.get(i).map_or(i, |&value| value as usize);
        &self.values[value * self.stride()..][..self.stride()]
    }

    /// All items, one after the other.
    pub fn into_items(self) -> Vec<f32> {
        if self.indices.is_empty() {
            return self.values;
        }
        let items = 0..self.item_count();
        items.flat_map(|i| self.item(i).iter().copied()).collect()
    }
}

/// A whole number as two floats.
pub fn split(x: i32) -> [f32; 2] {
    [(x >> 16) as f32, (x & 0xffff) as f32]
}

/// The whole number of two floats.
pub fn join([upper, lower]: [f32; 2]) -> i32 {
    ((upper as i32) << 16) | lower as i32
}

/// Why a primvar or one of its samples cannot be used.
type Refusal = (Code, String);

/// Resolves a primvar whose values must be `width` floats.
pub fn resolve_floats(
    path: &str,
    name: &str,
    primvar: &PrimvarDesc,
    width: usize,
    counts: &Counts,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) -> Option<Resolved> {
    let got = primvar
        .width
        .saturating_mul(primvar.element_size.max(0) as usize);
    let whole = primvar.is_integer();
    if got == width && !whole {
        return resolve(path, name, primvar, counts, shutter, warnings);
    }
    let numbers = if whole { "whole numbers" } else { "floats" };
    let text = format!(
        "primvar {name} has {got} {numbers} a value where {width} floats are needed; it is ignored"
    );
    warnings.push(Warning::new(path, Code::PrimvarLength, text));
    None
}

/// Resolves a primvar of any type.
pub fn resolve(
    path: &str,
    name: &str,
    primvar: &PrimvarDesc,
    counts: &Counts,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) -> Option<Resolved> {
    let mut say = |code, text: String| {
        let text = format!("primvar {name} {text}");
        warnings.push(Warning::new(path, code, text));
    };
    let size = usize::try_from(primvar.element_size).unwrap_or(0);
    let width = primvar.width.saturating_mul(size);
    if !(1..=WIDEST).contains(&width) {
        let text = format!(
            "has {} numbers times elementSize {} a value, not 1 to {WIDEST}; it is ignored",
            primvar.width, primvar.element_size
        );
        say(Code::PrimvarLength, text);
        return None;
    }
    if primvar.samples.iter().all(|s| s.values.is_empty()) {
        return None;
    }
    let mut kept = Vec::with_capacity(primvar.samples.len());
    let mut refused = Vec::new();
    for sample in &primvar.samples {
        match keys::check(sample, primvar, width, counts) {
            Ok(count) => kept.push((sample, count)),
            Err(refusal) => refused.push((sample.time, refusal)),
        }
    }
    if primvar.interpolation == Interpolation::Constant
        && let Some(many) = kept
            .iter()
            .map(|(s, _)| keys::items(s, width))
            .find(|&n| n > 1)
    {
        let text = format!(
            "has {many} values but is constant, as without an interpolation; the first is used"
        );
        say(Code::PrimvarLength, text);
    }
    if let Some((time, (code, why))) = refused.first() {
        let text = match (kept.is_empty(), refused.len()) {
            (true, _) => format!("{why}; it is ignored"),
            (false, 1) => format!("{why} at time {time} of the frame; that sample is left out"),
            (false, n) => format!("{why} at time {time} of the frame; {n} samples are left out"),
        };
        say(*code, text);
    }
    match keys::combine(&kept, primvar, width, shutter) {
        _ if kept.is_empty() => None,
        Some(resolved) => Some(resolved),
        None => {
            let text = "has no sample with a finite time; it is ignored".to_owned();
            say(Code::TimeSamples, text);
            None
        }
    }
}

#[cfg(test)]
mod tests;
