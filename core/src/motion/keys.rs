//! Raw samples to keys on [0, 1] across the shutter.
//!
//! Hosts give samples at any times, in any order, possibly bracketing the shutter or missing it
//! altogether. Keys are the shutter's two ends, interpolated, and every sample strictly between
//! them. Outside its samples a value is held. A shutter of no length has one key.

/// Sample times nearer to each other, or to an end of the shutter, than this fraction of the shutter
/// are one key: below it a segment's slope would be rounding noise (24-bit times in [0, 1]).
pub const KEY_MERGE: f64 = 1.0e-6;

/// The interval that the shutter is open, in time codes relative to the frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shutter {
    /// Open.
    pub open: f64,
    /// Close, not before open.
    pub close: f64,
}

impl Shutter {
    /// True when the shutter has no length, so nothing blurs.
    pub fn is_still(&self) -> bool {
        self.close <= self.open
    }

    /// The times of the motion that is seen while this shutter is open, where the motion's blur is
    /// scaled (motion:blurScale): `scale` times as far from the frame. 0 is the frame's own instant.
    #[must_use]
    pub fn scaled(self, scale: f64) -> Self {
        Self {
            open: self.open * scale,
            close: self.close * scale,
        }
    }

    /// The time code at `time` in [0, 1] across the shutter.
    pub fn time_code(&self, time: f64) -> f64 {
        self.open * (1.0 - time) + self.close * time
    }

    /// Time code to [0, 1] across the shutter (not clamped); 0 when still.
    pub fn normalize(&self, time_code: f64) -> f64 {
        if self.is_still() {
            0.0
        } else {
            (time_code - self.open) / (self.close - self.open)
        }
    }
}

/// How one key is made from samples: `(1 - f) * samples[a] + f * samples[b]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blend {
    /// First sample.
    pub a: usize,
    /// Second sample.
    pub b: usize,
    /// Weight of the second.
    pub f: f64,
}

/// Samples in order of time, without duplicates: indices into the host's arrays.
#[derive(Clone, Debug, PartialEq)]
pub struct Timeline {
    /// Times normalised to the shutter, ascending.
    times: Vec<f64>,
    /// Index of the host's sample at each time.
    samples: Vec<usize>,
}

impl Timeline {
    /// Sorts `time_codes`; of equal times the last given wins; times that are not finite are left out.
    /// `None` when nothing is left.
    pub fn new(time_codes: &[f64], shutter: Shutter) -> Option<Self> {
        let mut order: Vec<usize> = (0..time_codes.len())
            .filter(|&i| time_codes[i].is_finite())
            .collect();
        order.sort_by(|&a, &b| time_codes[a].total_cmp(&time_codes[b]).then(b.cmp(&a)));
        order.dedup_by(|next, kept| time_codes[*next] == time_codes[*kept]);
        if order.is_empty() {
            return None;
        }
        let times = order
            .iter()
            .map(|&i| {
                // A still shutter keeps time codes, measured from open.
                if shutter.is_still() {
                    time_codes[i] - shutter.open
                } else {
                    shutter.normalize(time_codes[i])
                }
            })
            .collect();
        Some(Self {
            times,
            samples: order,
        })
    }

    /// Times of samples, normalised to the shutter, ascending.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Samples that follow each other in time, by their indices.
    pub fn neighbours(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.samples.windows(2).map(|pair| (pair[0], pair[1]))
    }

    /// The same of three that follow each other, and where between the outer two the one in the middle is.
    pub fn triples(&self) -> impl Iterator<Item = ([usize; 3], f64)> + '_ {
        let times = self.times.windows(3);
        let of = |t: &[f64]| (t[1] - t[0]) / (t[2] - t[0]);
        let indices = self.samples.windows(3).map(|i| [i[0], i[1], i[2]]);
        indices.zip(times.map(of))
    }

    /// The blend at `time` (in [0, 1] across the shutter).
    pub fn blend(&self, time: f64) -> Blend {
        let next = self.times.partition_point(|&t| t <= time);
        let last = self.times.len() - 1;
        if next == 0 {
            return Blend {
                a: self.samples[0],
                b: self.samples[0],
                f: 0.0,
            };
        }
        if next > last {
            return Blend {
                a: self.samples[last],
                b: self.samples[last],
                f: 0.0,
            };
        }
        let (t0, t1) = (self.times[next - 1], self.times[next]);
        Blend {
            a: self.samples[next - 1],
            b: self.samples[next],
            f: ((time - t0) / (t1 - t0)).clamp(0.0, 1.0),
        }
    }

    /// Key times that follow this timeline exactly: 0, every sample inside the shutter, 1; or just 0
    /// when `still` or when the value is held over the whole shutter.
    pub fn key_times(&self, still: bool) -> Vec<f64> {
        let last = self.times.len() - 1;
        if still || last == 0 || self.times[last] <= 0.0 || self.times[0] >= 1.0 {
            return vec![0.0];
        }
        let mut keys = vec![0.0];
        keys.extend(self.times.iter().copied().filter(|&t| t > 0.0 && t < 1.0));
        keys.push(1.0);
        merge_close(&mut keys);
        keys
    }
}

/// Sorts key times and merges those closer than [`KEY_MERGE`], keeping 0 and 1 where present.
pub fn merge_close(keys: &mut Vec<f64>) {
    keys.sort_by(f64::total_cmp);
    keys.dedup_by(|next, kept| {
        let close = *next - *kept < KEY_MERGE;
        if close && *next >= 1.0 && *kept > 0.0 {
            *kept = *next;
        }
        close
    });
}

/// The union of key-time lists; `[0]` only where every list is `[0]`.
pub fn union<'a>(lists: impl IntoIterator<Item = &'a [f64]>) -> Vec<f64> {
    let mut keys = vec![0.0];
    for list in lists {
        keys.extend_from_slice(list);
    }
    merge_close(&mut keys);
    keys
}

/// Key times with every segment halved `depth` times.
pub fn subdivided(keys: &[f64], depth: u32) -> Vec<f64> {
    let pieces = 1u32 << depth;
    let mut out = Vec::with_capacity(keys.len() << depth);
    for w in keys.windows(2) {
        let at = |k: u32| w[0] + (w[1] - w[0]) * (f64::from(k) / f64::from(pieces));
        out.extend((0..pieces).map(at));
    }
    out.extend(keys.last());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHUTTER: Shutter = Shutter {
        open: -0.25,
        close: 0.25,
    };

    #[test]
    fn brackets_become_ends() {
        let line = Timeline::new(&[1.0, -1.0], SHUTTER).unwrap();
        assert_eq!(line.key_times(false), vec![0.0, 1.0]);
        let open = line.blend(0.0);
        assert_eq!((open.a, open.b), (1, 0));
        assert!((open.f - 0.375).abs() < 1e-12);
    }

    #[test]
    fn inner_samples_stay_and_duplicates_go() {
        let line = Timeline::new(&[0.0, -0.25, 0.0, 0.25, 0.1], SHUTTER).unwrap();
        let keys = line.key_times(false);
        assert_eq!(keys.len(), 4);
        assert!((keys[1] - 0.5).abs() < 1e-12 && (keys[2] - 0.7).abs() < 1e-12);
        assert_eq!(
            line.blend(0.5).a,
            2,
            "of two samples at one time the last given wins"
        );
    }

    #[test]
    fn held_outside_and_still() {
        assert_eq!(
            Timeline::new(&[3.0, 4.0], SHUTTER)
                .unwrap()
                .key_times(false),
            vec![0.0]
        );
        assert_eq!(
            Timeline::new(&[-1.0, 1.0], SHUTTER)
                .unwrap()
                .key_times(true),
            vec![0.0]
        );
        let still = Shutter {
            open: 2.0,
            close: 2.0,
        };
        let line = Timeline::new(&[1.0, 3.0], still).unwrap();
        assert!((line.blend(0.0).f - 0.5).abs() < 1e-12);
        assert!(Timeline::new(&[f64::NAN], SHUTTER).is_none());
    }

    #[test]
    fn samples_next_to_the_ends_merge_into_them() {
        let line = Timeline::new(&[-0.25, -0.25 + 1e-9, 0.25 - 1e-9, 0.3], SHUTTER).unwrap();
        assert_eq!(line.key_times(false), vec![0.0, 1.0]);
    }
}
