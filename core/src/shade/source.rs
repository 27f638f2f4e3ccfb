//! Where the value of a primvar at a hit comes from.

use std::sync::Arc;

use crate::grid::locate_key;
use crate::scene::Interpolation;
use crate::translate::primvar::{Resolved, Spread, WIDEST, join};

/// What a hit tells about the channels of its diced mesh. `first` is the first float to read of a
/// channel's value; where there is no such value, `out` is left as it is.
pub trait ChannelAccess {
    /// Interpolated over the micropolygon.
    fn smooth(&self, channel: usize, first: usize, out: &mut [f32]);
    /// Of the nearest corner of the micropolygon.
    fn nearest(&self, channel: usize, first: usize, out: &mut [f32]);
    /// The number of the instance that was hit, among those of the instancer that the prim numbers
    /// `level`.
    fn instance(&self, level: usize) -> usize;
}

/// A primvar of one prim, ready to be read at hits.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Floats a value at one key.
    lanes: usize,
    is_integer: bool,
    data: Values,
    /// Key times; empty where nothing changes.
    key_times: Vec<f32>,
}

/// Where a source's values are.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// `[key][lane]`.
    Constant(Vec<f32>),
    /// `[authored face][key][lane]`.
    Uniform(Vec<f32>),
    /// A channel of the diced mesh, `[key][lane]` at each vertex.
    Channel(usize),
    /// One item for each instance of an instancer that the prim numbers so; shared by all that the
    /// instancer places.
    Instance(usize, Arc<Resolved>),
}

/// Floats that a value can have at one key.
const MOST_LANES: usize = 2 * WIDEST;

impl Source {
    /// One value for the prim.
    pub fn constant(value: &[f32]) -> Self {
        Self {
            lanes: value.len(),
            is_integer: false,
            data: Values::Constant(value.to_vec()),
            key_times: Vec::new(),
        }
    }

    /// The source of a resolved primvar, spread over its prim by `spread`; channels go to `channels`
    /// and are numbered there.
    pub fn new<C>(
        resolved: Resolved,
        spread: impl FnOnce(Resolved) -> Spread<C>,
        channels: &mut Vec<C>,
    ) -> Self {
        let (lanes, is_integer) = (resolved.lanes(), resolved.is_integer);
        let key_times = key_times(&resolved);
        let data = match spread(resolved) {
            Spread::Constant(value) => Values::Constant(value),
            Spread::Uniform(values) => Values::Uniform(values),
            Spread::Channel(channel) => {
                channels.push(channel);
                Values::Channel(channels.len() - 1)
            }
        };
        Self {
            lanes,
            is_integer,
            data,
            key_times,
        }
    }

    /// A value for each instance of the instancer that the prim numbers `level`; one for all where
    /// `resolved` is constant.
    pub fn instanced(resolved: &Arc<Resolved>, level: usize) -> Self {
        let data = match resolved.interpolation {
            Interpolation::Constant => Values::Constant(resolved.item(0).to_vec()),
            _ => Values::Instance(level, Arc::clone(resolved)),
        };
        Self {
            lanes: resolved.lanes(),
            is_integer: resolved.is_integer,
            data,
            key_times: key_times(resolved),
        }
    }

    /// True where it is this value all over the prim, at every time.
    pub fn is_constant(&self, value: &[f32]) -> bool {
        matches!(&self.data, Values::Constant(v) if v == value) && self.key_times.is_empty()
    }

    /// Its values.
    pub fn values(&self) -> &Values {
        &self.data
    }

    /// Floats a value at one key.
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Key times; empty where nothing changes.
    pub fn key_times(&self) -> &[f32] {
        &self.key_times
    }

    /// Straight segments in time; 0 where nothing changes.
    pub fn segments(&self) -> usize {
        self.key_times.len().saturating_sub(1)
    }

    /// Numbers a value.
    pub fn width(&self) -> usize {
        self.lanes / if self.is_integer { 2 } else { 1 }
    }

    /// The first floats of the value on `element` at a time in [0, 1], as many as `out` has; those
    /// beyond the value's stay as they are. 0 where `element` has no value.
    #[inline]
    pub fn read(&self, element: u32, time: f32, channels: &impl ChannelAccess, out: &mut [f32]) {
        if self.key_times.is_empty() {
            self.at_key(0, element, channels, out);
        } else {
            self.between(element, time, channels, out);
        }
    }

    /// Whole numbers, as [`Source::read`].
    pub fn read_integers(
        &self,
        element: u32,
        time: f32,
        channels: &impl ChannelAccess,
        out: &mut [i32],
    ) {
        let mut lanes = [0.0; MOST_LANES];
        let width = out.len().min(self.width());
        self.read(element, time, channels, &mut lanes[..2 * width]);
        let (pairs, _) = lanes.as_chunks::<2>();
        for (out, &pair) in out.iter_mut().zip(&pairs[..width]) {
            *out = join(pair);
        }
    }

    /// True for whole numbers.
    pub fn is_integer(&self) -> bool {
        self.is_integer
    }

    fn between(&self, element: u32, time: f32, channels: &impl ChannelAccess, out: &mut [f32]) {
        let (k, f) = locate_key(&self.key_times, time);
        if self.is_integer {
            // Held up to the next key.
            let k = if f < 1.0 { k } else { k + 1 };
            return self.at_key(k, element, channels, out);
        }
        self.at_key(k, element, channels, out);
        if f > 0.0 {
            let mut next = [0.0; MOST_LANES];
            let count = out.len().min(self.lanes);
            self.at_key(k + 1, element, channels, &mut next[..count]);
            for (a, b) in out.iter_mut().zip(&next[..count]) {
                *a += (b - *a) * f;
            }
        }
    }

    fn at_key(&self, key: usize, element: u32, channels: &impl ChannelAccess, out: &mut [f32]) {
        let count = out.len().min(self.lanes);
        let out = &mut out[..count];
        let mut copy = |values: &[f32], start: usize| match values.get(start..start + count) {
            Some(value) => out.copy_from_slice(value),
            None => out.fill(0.0),
        };
        let first = key * self.lanes;
        match &self.data {
            Values::Constant(values) => copy(values, first),
            Values::Uniform(values) => {
                let stride = self.lanes * self.key_times.len().max(1);
                copy(values, element as usize * stride + first);
            }
            Values::Instance(level, resolved) => match channels.instance(*level) {
                i if i < resolved.item_count() => copy(resolved.item(i), first),
                _ => out.fill(0.0),
            },
            Values::Channel(i) if self.is_integer => channels.nearest(*i, first, out),
            Values::Channel(i) => channels.smooth(*i, first, out),
        }
    }
}

/// Those of a source: none where nothing changes.
fn key_times(resolved: &Resolved) -> Vec<f32> {
    match resolved.key_times.as_slice() {
        [_] => Vec::new(),
        times => times.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::PrimvarRole;
    use crate::translate::primvar::split;

    /// Channels whose floats are their own numbers.
    struct Numbers;

    impl ChannelAccess for Numbers {
        fn smooth(&self, channel: usize, first: usize, out: &mut [f32]) {
            for (i, out) in out.iter_mut().enumerate() {
                *out = (100 * channel + first + i) as f32;
            }
        }
        fn nearest(&self, _: usize, first: usize, out: &mut [f32]) {
            out.copy_from_slice(&split(-70_000 - first as i32));
        }
        fn instance(&self, level: usize) -> usize {
            level
        }
    }

    fn resolved(width: usize, key_times: &[f32], is_integer: bool) -> Resolved {
        Resolved {
            interpolation: Interpolation::Uniform,
            role: PrimvarRole::None,
            is_integer,
            is_unsigned: false,
            width,
            key_times: key_times.to_vec(),
            values: Vec::new(),
            indices: Vec::new(),
        }
    }

    #[test]
    fn values_by_face_and_time() {
        // Two faces, three keys, two floats.
        let values: Vec<f32> = (0..12).map(|i| i as f32).collect();
        let spread = |_| Spread::Uniform(values);
        let source = Source::new(
            resolved(2, &[0.0, 0.25, 1.0], false),
            spread,
            &mut Vec::<()>::new(),
        );
        let at = |element, time| {
            let mut out = [-1.0; 3];
            source.read(element, time, &Numbers, &mut out);
            out
        };
        assert_eq!(at(0, 0.0), [0.0, 1.0, -1.0]);
        assert_eq!(at(1, 0.25), [8.0, 9.0, -1.0]);
        assert_eq!(at(1, 0.125), [7.0, 8.0, -1.0]);
        assert_eq!(at(1, 1.0), [10.0, 11.0, -1.0]);
        assert_eq!(at(2, 0.5), [0.0, 0.0, -1.0], "a face without a value");
        assert_eq!(source.segments(), 2);
    }

    #[test]
    fn channels_are_read_from_their_key_on() {
        let channel = |_| Spread::Channel(());
        let mut channels = Vec::new();
        let still = Source::new(resolved(3, &[0.0], false), channel, &mut channels);
        let moving = Source::new(resolved(3, &[0.0, 1.0], false), channel, &mut channels);
        let mut out = [0.0; 2];
        still.read(0, 0.5, &Numbers, &mut out);
        assert_eq!((out, still.segments()), ([0.0, 1.0], 0));
        moving.read(0, 0.5, &Numbers, &mut out);
        assert_eq!(out, [101.5, 102.5]);
        assert_eq!(channels.len(), 2);
    }

    #[test]
    fn values_by_instance_and_time() {
        let mut values = resolved(1, &[0.0, 1.0], false);
        values.values = vec![0.0, 1.0, 10.0, 20.0];
        values.indices = vec![1, 0];
        let values = Arc::new(values);
        let at = |instance, time| {
            let mut out = [-1.0];
            Source::instanced(&values, instance).read(7, time, &Numbers, &mut out);
            out[0]
        };
        assert_eq!((at(0, 0.0), at(0, 0.5)), (10.0, 15.0));
        assert_eq!(at(1, 1.0), 1.0);
        assert_eq!(at(2, 1.0), 0.0, "an instance without a value");
    }

    #[test]
    fn whole_numbers_hold_until_the_next_key() {
        let values: Vec<f32> = [i32::MIN, i32::MAX].into_iter().flat_map(split).collect();
        let constant = |_| Spread::Constant(values);
        let mut channels = Vec::<()>::new();
        let source = Source::new(resolved(1, &[0.0, 1.0], true), constant, &mut channels);
        let at = |time| {
            let mut out = [7; 2];
            source.read_integers(0, time, &Numbers, &mut out);
            out
        };
        assert_eq!(at(0.999), [i32::MIN, 7]);
        assert_eq!(at(1.0), [i32::MAX, 7]);
    }
}
