//! How the bows of frames that turn go with time: what is added to coordinates, times a number of the frame's own
//! ([`super::turn`]).
//!
//! At the times `T` of keys it is `T (1 - T)`. Between them it goes that way too where there are two keys, or more than 9, which
//! would be too many lines to ask each ray for. Where there are from 3 to 9, it goes straight from one key to the next, as
//! vertices do, so that what follows them leaves nothing. It is the least of all lines through neighbouring keys then, since
//! `T (1 - T)` bends one way only: `(1 - a - b) T + a b` goes through it at `a` and at `b`.
//!
//! **Rounding**, in units of `U = 2^-24`: `T (1 - T)`, of at most 1/4, is off by 2 of itself. The two numbers of a line, found in
//! f64, are rounded once, as are its product and its sum. Where a line is the least it is at most 1/4. If it rises or is level,
//! both of its terms are at most that, and together they are off by 1; if it falls, `a b` is at most 1, the other term no larger,
//! and together they are off by 3.25. A line that is not the least does not fall below it by more than that when it is
//! rounded.

/// Lines that each ray is asked for, at most; what has more keys bows as if it had two.
const MOST_LINES: usize = 8;

/// True where bows of what has so many keys go straight from key to key.
#[inline(always)]
pub const fn goes_straight(keys: usize) -> bool {
    keys > 2 && keys <= MOST_LINES + 1
}

/// How bows go in one tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Bowing {
    /// Slope and start of each line; none where bows do not go straight.
    lines: Vec<[f32; 2]>,
}

/// As `T (1 - T)`.
pub static PARABOLA: Bowing = Bowing::parabola();

impl Bowing {
    /// As `T (1 - T)`.
    pub const fn parabola() -> Self {
        Self { lines: Vec::new() }
    }

    /// For what has these keys.
    pub fn of(key_times: &[f32]) -> Self {
        if !goes_straight(key_times.len()) {
            return Self::parabola();
        }
        let line = |ends: &[f32]| {
            let (a, b) = (f64::from(ends[0]), f64::from(ends[1]));
            [(1.0 - a - b) as f32, (a * b) as f32]
        };
        Self {
            lines: key_times.windows(2).map(line).collect(),
        }
    }

    /// Slope and start of lines, the least of which it is; none where it is `T (1 - T)`.
    #[inline(always)]
    pub fn lines(&self) -> &[[f32; 2]] {
        &self.lines
    }

    /// At a time in [0, 1].
    #[inline(always)]
    pub fn at(&self, time: f32) -> f32 {
        let straight = |least: f32, [slope, start]: &[f32; 2]| least.min(slope * time + start);
        match self.lines() {
            [] => time * (1.0 - time),
            lines => lines.iter().fold(f32::INFINITY, straight),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::U;

    /// Straight from key to key, in f64.
    fn exact(keys: &[f32], time: f32) -> f64 {
        let at = |time: f32| f64::from(time) * (1.0 - f64::from(time));
        if keys.len() < 3 || keys.len() > 9 {
            return at(time);
        }
        let k = keys[1..keys.len() - 1].partition_point(|&key| key <= time);
        let (a, b) = (keys[k], keys[k + 1]);
        let fraction = (f64::from(time) - f64::from(a)) / (f64::from(b) - f64::from(a));
        at(a) + (at(b) - at(a)) * fraction
    }

    #[test]
    fn bows_go_from_key_to_key() {
        let mut state = 1u64;
        let mut unit = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1);
            (state >> 40) as f32 / (1u64 << 24) as f32
        };
        let (mut worst, mut between) = (0.0f64, 0.0f64);
        for count in (2..=12).cycle().take(2000) {
            // Some of them close to one end.
            let end = [1.0, 0.01, 1e-4][count % 3];
            let inner = (2..count).map(|k| {
                if k % 2 == 0 {
                    1.0 - end * unit()
                } else {
                    unit()
                }
            });
            let mut keys: Vec<f32> = inner.chain([0.0, 1.0]).collect();
            keys.sort_by(f32::total_cmp);
            keys.dedup();
            let bowing = Bowing::of(&keys);
            let straight = (3..=9).contains(&keys.len());
            let lines = if straight { keys.len() - 1 } else { 0 };
            assert_eq!(bowing.lines().len(), lines);
            let random: Vec<f32> = (0..20).map(|_| unit()).collect();
            for &time in keys.iter().chain(&random) {
                let off = (f64::from(bowing.at(time)) - exact(&keys, time)).abs();
                worst = worst.max(off / f64::from(U));
                let parabola = f64::from(time) * (1.0 - f64::from(time));
                between = between.max(parabola - exact(&keys, time));
            }
        }
        // As derived, and not by much less; and it is not the parabola.
        assert!(worst > 0.5 && worst < 3.25, "{worst}");
        assert!(between > 0.05, "{between}");
    }
}
