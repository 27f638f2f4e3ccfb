//! Transform hierarchies over the shutter.
//!
//! Each level of a hierarchy interpolates its own matrices between its own samples, entry by entry or
//! along arcs ([`super::turn`]), as the host says; the object's
//! matrix at a time is the product of the levels at that time. [`Hierarchy::matrix`] evaluates that
//! definition; [`keys_within`] finds the times at which it must be sampled so that the
//! straight path between samples is never farther than a tolerance from it.

use glam::{DAffine3, DMat4, DVec3};

use super::keys::{Shutter, Timeline, merge_close, union};
use super::turn::Turn;
use crate::scene::TransformSamples;

/// Halvings of one segment, at most, when keys are added for curved motion.
const MAX_HALVINGS: u32 = 6;
/// Keys of one path, at most.
pub const MAX_KEYS: usize = 129;

#[derive(Clone, Debug)]
struct Level {
    timeline: Timeline,
    matrices: Vec<DAffine3>,
    /// From each sample to the one that follows in time, where it turns; empty where nothing does.
    turns: Vec<Option<Turn>>,
    key_times: Vec<f64>,
}

/// Why a hierarchy cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransformError {
    /// A matrix has an entry that is not finite.
    #[error("its transform is not finite")]
    NotFinite,
    /// A matrix has an entry so large that f32 would overflow.
    #[error("its transform has numbers beyond {LARGEST_ENTRY:e}")]
    TooLarge,
    /// A level has no sample with a finite time.
    #[error("its transform has no usable time sample")]
    NoSamples,
}

/// Largest entry of a usable matrix: products of a few stay far inside f64, and positions inside
/// what f32 can hold after the origin was subtracted.
const LARGEST_ENTRY: f64 = 1.0e18;

/// True for a matrix that is finite and below that.
pub fn is_usable(m: &DAffine3) -> bool {
    m.to_cols_array().iter().all(|x| x.abs() < LARGEST_ENTRY)
}

/// Levels of one object's transform, resolved to a shutter.
#[derive(Clone, Debug, Default)]
pub struct Hierarchy {
    /// The object's own level first. Static neighbours are folded together.
    levels: Vec<Level>,
}

impl Hierarchy {
    /// Resolves samples to `shutter`.
    ///
    /// # Errors
    /// A matrix that is not finite, or a level without samples.
    pub fn new(samples: &[TransformSamples], shutter: Shutter) -> Result<Self, TransformError> {
        let mut hierarchy = Self::default();
        for level in samples {
            hierarchy.push(level, shutter)?;
        }
        Ok(hierarchy)
    }

    /// Adds a level above the ones present.
    ///
    /// # Errors
    /// As [`Hierarchy::new`].
    pub fn push(
        &mut self,
        samples: &TransformSamples,
        shutter: Shutter,
    ) -> Result<(), TransformError> {
        let matrices: Vec<DAffine3> = samples.matrices.iter().map(affine).collect();
        if !matrices.iter().all(is_usable) {
            let finite = matrices.iter().all(DAffine3::is_finite);
            return Err(if finite {
                TransformError::TooLarge
            } else {
                TransformError::NotFinite
            });
        }
        let count = samples.times.len().min(matrices.len());
        let timeline =
            Timeline::new(&samples.times[..count], shutter).ok_or(TransformError::NoSamples)?;
        let mut level = Level {
            turns: match samples.turns {
                true => turns(&timeline, &matrices),
                false => Vec::new(),
            },
            timeline,
            matrices,
            key_times: Vec::new(),
        };
        level.key_times = level.timeline.key_times(shutter.is_still());
        let at_keys: Vec<DAffine3> = level.key_times.iter().map(|&t| level.matrix(t)).collect();
        if at_keys.windows(2).all(|w| w[0] == w[1]) {
            level = Level::fixed(at_keys[0]);
        }
        match self.levels.last_mut() {
            Some(below) if below.is_fixed() && level.is_fixed() => {
                *below = Level::fixed(level.matrices[0] * below.matrices[0]);
            }
            _ => self.levels.push(level),
        }
        Ok(())
    }

    /// Object to world at `time` in [0, 1].
    pub fn matrix(&self, time: f64) -> DAffine3 {
        self.levels
            .iter()
            .fold(DAffine3::IDENTITY, |m, level| level.matrix(time) * m)
    }

    /// True when the matrix changes within the shutter.
    pub fn is_moving(&self) -> bool {
        self.levels.iter().any(|l| !l.is_fixed())
    }

    /// Number of levels that move.
    pub fn moving_levels(&self) -> usize {
        self.levels.iter().filter(|l| !l.is_fixed()).count()
    }

    /// True when a level turns between samples, so that its matrix goes along arcs between key times.
    pub fn turns(&self) -> bool {
        self.levels.iter().any(|l| !l.turns.is_empty())
    }

    /// Union of the levels' key times; `[0]` when nothing moves.
    pub fn key_times(&self) -> Vec<f64> {
        union(self.levels.iter().map(|l| l.key_times.as_slice()))
    }
}

/// Adds keys to `start` until, between neighbours, every point of `probe` follows a chord no farther
/// than `tolerance` (world units) from its path `matrix(time) * probe(time)`, as far as
/// [`MAX_KEYS`] and six halvings go. Chords of rigid points under one moving level that does not turn
/// are exact, and get no extra keys.
pub fn keys_within(
    matrix: &dyn Fn(f64) -> DAffine3,
    start: &[f64],
    tolerance: f64,
    probe: &dyn Fn(f64) -> Vec<DVec3>,
) -> Vec<f64> {
    let mut keys = start.to_vec();
    if keys.len() < 2 {
        return keys;
    }
    let place = |time: f64| -> Vec<DVec3> {
        let m = matrix(time);
        probe(time)
            .into_iter()
            .map(|p| m.transform_point3(p))
            .collect()
    };
    let mut added = Vec::new();
    for w in start.windows(2) {
        refine(
            &place,
            w[0],
            &place(w[0]),
            w[1],
            &place(w[1]),
            tolerance,
            0,
            &mut added,
        );
    }
    keys.append(&mut added);
    merge_close(&mut keys);
    keys
}

#[allow(clippy::too_many_arguments)] // a plain recursion over one interval and its two ends
fn refine(
    place: &dyn Fn(f64) -> Vec<DVec3>,
    t0: f64,
    p0: &[DVec3],
    t1: f64,
    p1: &[DVec3],
    tolerance: f64,
    depth: u32,
    added: &mut Vec<f64>,
) {
    if depth == MAX_HALVINGS || added.len() + 2 >= MAX_KEYS {
        return;
    }
    let middle = 0.5 * (t0 + t1);
    let p = place(middle);
    // The quarter points as well: an S-shaped path crosses its chord in the middle.
    let worst = |at: f64, points: &[DVec3]| {
        points
            .iter()
            .zip(p0.iter().zip(p1))
            .fold(0.0f64, |m, (p, (a, b))| {
                m.max((*p - a.lerp(*b, at)).length())
            })
    };
    let off = worst(0.5, &p)
        .max(worst(0.25, &place(t0 + 0.25 * (t1 - t0))))
        .max(worst(0.75, &place(t0 + 0.75 * (t1 - t0))));
    if off <= tolerance {
        return;
    }
    added.push(middle);
    refine(place, t0, p0, middle, &p, tolerance, depth + 1, added);
    refine(place, middle, &p, t1, p1, tolerance, depth + 1, added);
}

impl Level {
    fn fixed(matrix: DAffine3) -> Self {
        let timeline = Timeline::new(&[0.0], Shutter::default()).expect("0 is finite");
        Self {
            timeline,
            matrices: vec![matrix],
            turns: Vec::new(),
            key_times: vec![0.0],
        }
    }

    fn is_fixed(&self) -> bool {
        self.key_times.len() == 1 && self.matrices.len() == 1
    }

    fn matrix(&self, time: f64) -> DAffine3 {
        let blend = self.timeline.blend(time);
        match self.turns.get(blend.a) {
            Some(Some(turn)) if blend.f != 0.0 => turn.at(blend.f),
            _ => lerp(&self.matrices[blend.a], &self.matrices[blend.b], blend.f),
        }
    }
}

/// The turns from each sample to the next, by the sample's index; empty where there are none.
fn turns(timeline: &Timeline, matrices: &[DAffine3]) -> Vec<Option<Turn>> {
    let mut turns = vec![None; matrices.len()];
    for (a, b) in timeline.neighbours() {
        turns[a] = Turn::between(&matrices[a], &matrices[b]);
    }
    for ([a, middle, b], f) in timeline.triples() {
        let known = turns[a].is_some() && turns[middle].is_some();
        let of = [a, middle, b].map(|i| &matrices[i]);
        if let Some([first, second]) = (!known).then(|| Turn::shown(of, f)).flatten() {
            turns[a] = Some(first);
            turns[middle] = Some(second);
        }
    }
    match turns.iter().any(Option::is_some) {
        true => turns,
        false => Vec::new(),
    }
}

/// Entry-wise interpolation of matrices: points move on straight lines.
pub fn lerp(a: &DAffine3, b: &DAffine3, f: f64) -> DAffine3 {
    if f == 0.0 {
        return *a;
    }
    DAffine3 {
        matrix3: a.matrix3 * (1.0 - f) + b.matrix3 * f,
        translation: a.translation * (1.0 - f) + b.translation * f,
    }
}

/// The affine part of a matrix (USD's transforms have no projective part).
fn affine(m: &DMat4) -> DAffine3 {
    DAffine3::from_mat4(*m)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(times: &[f64], matrices: &[DMat4]) -> TransformSamples {
        TransformSamples {
            times: times.to_vec(),
            matrices: matrices.to_vec(),
            turns: false,
        }
    }

    fn turning(times: &[f64], matrices: &[DMat4]) -> TransformSamples {
        TransformSamples {
            turns: true,
            ..level(times, matrices)
        }
    }

    const SHUTTER: Shutter = Shutter {
        open: 0.0,
        close: 1.0,
    };

    #[test]
    fn levels_compose_own_first() {
        let own = level(&[0.0], &[DMat4::from_translation(DVec3::X)]);
        let parent = level(&[0.0], &[DMat4::from_scale(DVec3::splat(2.0))]);
        let h = Hierarchy::new(&[own, parent], SHUTTER).unwrap();
        assert_eq!(
            h.matrix(0.0).transform_point3(DVec3::ZERO),
            DVec3::new(2.0, 0.0, 0.0)
        );
        assert!(!h.is_moving());
    }

    #[test]
    fn rigid_linear_motion_gets_no_extra_keys() {
        let own = level(
            &[0.0, 1.0],
            &[DMat4::IDENTITY, DMat4::from_translation(DVec3::X)],
        );
        let h = Hierarchy::new(&[own], SHUTTER).unwrap();
        let keys = keys_within(&|t| h.matrix(t), &h.key_times(), 1e-9, &|_| {
            vec![DVec3::ONE]
        });
        assert_eq!(keys, vec![0.0, 1.0]);
    }

    #[test]
    fn moving_levels_multiply_and_add_keys() {
        let scale = level(
            &[0.0, 1.0],
            &[DMat4::IDENTITY, DMat4::from_scale(DVec3::splat(2.0))],
        );
        let shift = level(
            &[0.0, 1.0],
            &[DMat4::from_translation(DVec3::X), DMat4::IDENTITY],
        );
        // Own level shifts, the parent scales: x(t) = (1 + t)(1 - t) for the origin, not linear.
        let h = Hierarchy::new(&[shift, scale], SHUTTER).unwrap();
        let at = |t: f64| h.matrix(t).transform_point3(DVec3::ZERO).x;
        assert!((at(0.5) - 0.75).abs() < 1e-12);
        let keys = keys_within(&|t| h.matrix(t), &h.key_times(), 0.01, &|_| {
            vec![DVec3::ZERO]
        });
        assert!(keys.len() > 4);
        for w in keys.windows(2) {
            for i in 0..=8 {
                let f = f64::from(i) / 8.0;
                let t = w[0] + f * (w[1] - w[0]);
                let chord = at(w[0]) * (1.0 - f) + at(w[1]) * f;
                assert!((at(t) - chord).abs() <= 0.01);
            }
        }
    }

    /// Samples in no order, one of them outside of the shutter.
    #[test]
    fn a_turning_parent_carries_its_child_along_an_arc() {
        let child = level(&[0.0], &[DMat4::from_translation(DVec3::X * 10.0)]);
        let angles = [1.5, -0.5, 0.5];
        let parent = turning(&[1.5, -0.5, 0.5], &angles.map(DMat4::from_rotation_z));
        let h = Hierarchy::new(&[child, parent], SHUTTER).unwrap();
        assert!(h.turns() && h.moving_levels() == 1);
        assert_eq!(h.key_times(), [0.0, 0.5, 1.0]);
        for i in 0..=200 {
            let t = f64::from(i) / 200.0;
            let at = h.matrix(t).transform_point3(DVec3::ZERO);
            let expected = DVec3::new(t.cos(), t.sin(), 0.0) * 10.0;
            assert!((at - expected).length() < 1.0e-11, "{at} at {t}");
        }
    }

    #[test]
    fn without_the_flag_and_without_a_turn_matrices_go_straight() {
        let flat = DMat4::from_rotation_z(1.2) * DMat4::from_scale(DVec3::new(1.0, 1.0, 0.0));
        let mirrored = DMat4::from_rotation_z(1.2) * DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
        let scaled = DMat4::from_scale(DVec3::new(1.1, 2.3, 0.7));
        let quarter = DMat4::from_rotation_z(1.2);
        let moved = DMat4::from_translation(DVec3::ONE);
        for (to, flag) in [
            (flat, true),
            (mirrored, true),
            (scaled, true),
            (moved, true),
            (quarter, false),
        ] {
            let mut samples = level(&[0.0, 1.0], &[DMat4::IDENTITY, to]);
            samples.turns = flag;
            let h = Hierarchy::new(&[samples], SHUTTER).unwrap();
            assert!(!h.turns());
            for t in [0.0, 0.25, 1.0 / 3.0, 0.9, 1.0] {
                let expected = lerp(&DAffine3::IDENTITY, &affine(&to), t);
                assert_eq!(h.matrix(t), expected);
            }
        }
    }

    #[test]
    fn nearly_half_a_turn_gets_its_keys() {
        let half = DMat4::from_rotation_z(0.999 * std::f64::consts::PI);
        let h = Hierarchy::new(&[turning(&[0.0, 1.0], &[DMat4::IDENTITY, half])], SHUTTER).unwrap();
        let keys = keys_within(&|t| h.matrix(t), &h.key_times(), 0.001, &|_| vec![DVec3::X]);
        let at = |t: f64| h.matrix(t).transform_point3(DVec3::X);
        assert!(keys.len() > 32 && (at(0.3).length() - 1.0).abs() < 1.0e-12);
        for w in keys.windows(2) {
            let chord = at(w[0]).midpoint(at(w[1]));
            assert!((at(0.5 * (w[0] + w[1])) - chord).length() <= 0.001);
        }
    }

    #[test]
    fn bad_matrices_are_refused() {
        let nan = level(&[0.0], &[DMat4::from_translation(DVec3::NAN)]);
        assert_eq!(
            Hierarchy::new(&[nan], SHUTTER).unwrap_err(),
            TransformError::NotFinite
        );
        let huge = level(&[0.0], &[DMat4::from_scale(DVec3::splat(1e30))]);
        assert_eq!(
            Hierarchy::new(&[huge], SHUTTER).unwrap_err(),
            TransformError::TooLarge
        );
        let none = level(&[], &[]);
        assert_eq!(
            Hierarchy::new(&[none], SHUTTER).unwrap_err(),
            TransformError::NoSamples
        );
    }
}
