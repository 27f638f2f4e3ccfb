//! Samples of a primvar to keys across the shutter.

use std::collections::HashMap;

use super::{Counts, Refusal, Resolved, split};
use crate::diagnostics::Code;
use crate::motion::keys::Blend;
use crate::motion::{Shutter, Timeline};
use crate::scene::{Interpolation, PrimvarDesc, PrimvarSample, PrimvarValues};

/// Number of items of a sample as authored.
pub(super) fn items(sample: &PrimvarSample, width: usize) -> usize {
    match sample.indices.len() {
        0 => sample.values.len() / width,
        indices => indices,
    }
}

/// Number of items of a sample: 1 where one value serves all.
pub(super) fn check(
    sample: &PrimvarSample,
    primvar: &PrimvarDesc,
    width: usize,
    counts: &Counts,
) -> Result<usize, Refusal> {
    let values = sample.values.len() / width;
    if !sample.values.len().is_multiple_of(width) {
        let text = format!("has {} numbers, not {width} a value", sample.values.len());
        return Err((Code::PrimvarLength, text));
    }
    if let PrimvarValues::Float(floats) = &*sample.values
        && floats.iter().any(|x| !x.is_finite())
    {
        let text = "has values that are not finite as 32-bit numbers";
        return Err((Code::NotFinite, text.to_owned()));
    }
    let unauthored = |i: i32| i >= 0 && i == primvar.unauthored_index;
    let outside = |&i: &i32| usize::try_from(i).map_or(true, |i| i >= values) && !unauthored(i);
    if sample.indices.iter().any(outside) {
        let text = format!("has indices outside its {values} values");
        return Err((Code::PrimvarLength, text));
    }
    let items = items(sample, width);
    let expected = counts.of(primvar.interpolation);
    if items == 1 || (items > 1 && primvar.interpolation == Interpolation::Constant) {
        return Ok(1);
    }
    if items != expected.0 && !(counts.more_is_fine && items > expected.0) {
        let (prim, of) = (counts.prim, expected.1);
        let text = format!(
            "has {items} values where its {prim} has {} {of}",
            expected.0
        );
        return Err((Code::PrimvarLength, text));
    }
    Ok(items)
}

/// The keys of checked samples, which have so many items each; `None` where no time is finite.
pub(super) fn combine(
    samples: &[(&PrimvarSample, usize)],
    primvar: &PrimvarDesc,
    width: usize,
    shutter: Shutter,
) -> Option<Resolved> {
    let is_integer = samples
        .iter()
        .all(|(sample, _)| matches!(*sample.values, PrimvarValues::Int(_)));
    let (key_times, blends) = match samples {
        [_] => (vec![0.0], vec![Blend { a: 0, b: 0, f: 0.0 }]),
        _ => {
            let times: Vec<f64> = samples.iter().map(|(sample, _)| sample.time).collect();
            let timeline = Timeline::new(&times, shutter)?;
            let key_times = timeline.key_times(shutter.is_still());
            let blend = |&t: &f64| step(timeline.blend(t), is_integer);
            let blends: Vec<Blend> = key_times.iter().map(blend).collect();
            (key_times, blends)
        }
    };
    let mut used: Vec<usize> = blends.iter().flat_map(|blend| [blend.a, blend.b]).collect();
    used.sort_unstable();
    used.dedup();
    let sources: Vec<Source<'_>> = samples
        .iter()
        .map(|&(sample, items)| Source::new(sample, items, width))
        .collect();
    let items = used.iter().map(|&s| sources[s].items).max()?;
    let is_constant = items == 1;
    let layout = Layout::new(&sources, &used, items, primvar.interpolation);
    let mut resolved = Resolved {
        interpolation: match is_constant {
            true => Interpolation::Constant,
            false => primvar.interpolation,
        },
        role: primvar.role,
        is_integer,
        is_unsigned: primvar.is_unsigned,
        width,
        key_times: key_times.iter().map(|&t| t as f32).collect(),
        values: Vec::new(),
        indices: layout.indices,
    };
    resolved.values = match (&layout.rows, &blends[..]) {
        (&Rows::Authored(count), &[Blend { a, f: 0.0, .. }]) if !is_integer => {
            sources[a].floats(count)
        }
        (rows, blends) => {
            let mut values = Vec::with_capacity(rows.len() * resolved.stride());
            for row in 0..rows.len() {
                for &blend in blends {
                    let at = [blend.a, blend.b].map(|sample| rows.value(row, sample, &sources));
                    push(&sources, at, blend, is_integer, &mut values);
                }
            }
            values
        }
    };
    if stands_still(&resolved) {
        let (lanes, stride) = (resolved.lanes(), resolved.stride());
        let first = resolved
            .values
            .chunks_exact(stride)
            .flat_map(|v| &v[..lanes]);
        resolved.values = first.copied().collect();
        resolved.key_times = vec![0.0];
    }
    Some(resolved)
}

/// Whole numbers are those of the sample at or before a time.
fn step(blend: Blend, is_integer: bool) -> Blend {
    match is_integer && blend.f < 1.0 {
        true => Blend { f: 0.0, ..blend },
        false => blend,
    }
}

/// One sample's values by item.
struct Source<'a> {
    values: &'a PrimvarValues,
    indices: &'a [i32],
    value_count: usize,
    items: usize,
    width: usize,
}

impl<'a> Source<'a> {
    fn new(sample: &'a PrimvarSample, items: usize, width: usize) -> Self {
        Self {
            values: &sample.values,
            indices: &sample.indices,
            value_count: sample.values.len() / width,
            items,
            width,
        }
    }

    /// The value of an item; [`NO_VALUE`] where none was authored.
    fn value_of(&self, item: usize) -> u32 {
        let item = if self.items == 1 { 0 } else { item };
        match self.indices.get(item) {
            // Indices that point at nothing are those of values that were not authored.
            Some(&i) => match usize::try_from(i) {
                Ok(value) if value < self.value_count => value as u32,
                _ => NO_VALUE,
            },
            None => item as u32,
        }
    }

    /// The first `count` values as floats; those beyond the authored ones are 0.
    fn floats(&self, count: usize) -> Vec<f32> {
        let mut floats = match self.values {
            PrimvarValues::Float(values) => values.clone(),
            PrimvarValues::Int(values) => values.iter().map(|&x| x as f32).collect(),
        };
        floats.resize(count * self.width, 0.0);
        floats
    }

    fn float(&self, value: u32, lane: usize) -> f64 {
        let at = value as usize * self.width + lane;
        match self.values {
            _ if value == NO_VALUE => 0.0,
            PrimvarValues::Float(values) => values[at].into(),
            PrimvarValues::Int(values) => values[at].into(),
        }
    }

    fn integer(&self, value: u32, lane: usize) -> i32 {
        match self.values {
            PrimvarValues::Int(values) if value != NO_VALUE => {
                values[value as usize * self.width + lane]
            }
            _ => 0,
        }
    }
}

/// Stands for a value that was not authored: 0.
const NO_VALUE: u32 = u32::MAX;

/// Which values take part, and which of them each item has.
struct Layout {
    rows: Rows,
    /// Row of each item; empty where item i has row i.
    indices: Vec<u32>,
}

/// Values of the samples that go together.
enum Rows {
    /// The values as they are numbered in every sample, the first so many; those beyond are 0.
    Authored(usize),
    /// The values of the samples, a list a row.
    Spelled(Vec<Box<[u32]>>),
}

impl Rows {
    fn len(&self) -> usize {
        match self {
            Rows::Authored(count) => *count,
            Rows::Spelled(rows) => rows.len(),
        }
    }

    /// The value of a sample in a row.
    fn value(&self, row: usize, sample: usize, sources: &[Source<'_>]) -> u32 {
        match self {
            Rows::Authored(_) if row < sources[sample].value_count => row as u32,
            Rows::Authored(_) => NO_VALUE,
            Rows::Spelled(rows) => rows[row][sample],
        }
    }
}

impl Layout {
    /// Samples with the same indices keep them, and with them what the host says about where values
    /// are shared. Others are spelled out item by item.
    fn new(
        sources: &[Source<'_>],
        used: &[usize],
        items: usize,
        interpolation: Interpolation,
    ) -> Self {
        let first = &sources[used[0]];
        let same = |s: &usize| {
            let other = &sources[*s];
            (other.items, other.value_count, other.indices)
                == (first.items, first.value_count, first.indices)
        };
        if items > 1 && used.iter().all(same) {
            if first.indices.is_empty() {
                let rows = Rows::Authored(items);
                let indices = Vec::new();
                return Self { rows, indices };
            }
            let (count, mut most) = (first.value_count as u32, first.value_count);
            let mut indices: Vec<u32> = (0..items).map(|i| first.value_of(i)).collect();
            for index in indices.iter_mut().filter(|i| **i == NO_VALUE) {
                *index = count;
                most = first.value_count + 1;
            }
            let rows = Rows::Authored(most);
            return Self { rows, indices };
        }
        let row = |item| -> Box<[u32]> { sources.iter().map(|s| s.value_of(item)).collect() };
        if interpolation != Interpolation::FaceVarying || items == 1 {
            let rows = Rows::Spelled((0..items).map(row).collect());
            let indices = Vec::new();
            return Self { rows, indices };
        }
        // Shared where every sample shares: the seams of face-varying data.
        let mut seen: HashMap<Box<[u32]>, u32> = HashMap::new();
        let mut rows = Vec::new();
        let mut number = |row: Box<[u32]>| {
            *seen.entry(row).or_insert_with_key(|row| {
                rows.push(row.clone());
                rows.len() as u32 - 1
            })
        };
        let indices = (0..items).map(|item| number(row(item))).collect();
        let rows = Rows::Spelled(rows);
        Self { rows, indices }
    }
}

/// One value at one key: value `at[0]` of the first sample of the blend, `at[1]` of the second.
fn push(sources: &[Source<'_>], at: [u32; 2], blend: Blend, is_integer: bool, out: &mut Vec<f32>) {
    let (a, b) = (&sources[blend.a], &sources[blend.b]);
    for lane in 0..a.width {
        if is_integer {
            let (source, at) = if blend.f < 1.0 {
                (a, at[0])
            } else {
                (b, at[1])
            };
            out.extend(split(source.integer(at, lane)));
            continue;
        }
        let from = a.float(at[0], lane);
        out.push(match blend.f == 0.0 {
            true => from as f32,
            false => (from * (1.0 - blend.f) + b.float(at[1], lane) * blend.f) as f32,
        });
    }
}

fn stands_still(resolved: &Resolved) -> bool {
    let lanes = resolved.lanes();
    let still = |value: &[f32]| {
        let (first, rest) = value.split_at(lanes);
        rest.chunks_exact(lanes).all(|key| key == first)
    };
    resolved.key_times.len() > 1 && resolved.values.chunks_exact(resolved.stride()).all(still)
}
