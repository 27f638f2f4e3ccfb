//! Objects that move as a whole: the space that moves along with them.
//!
//! A *carrier* is a rotation and a translation at every key, the identity at the first, straight between keys as
//! everything is: `A(f) = (1-f) A_k + f A_(k+1)` at fraction `f` of a segment. A point `P(f)` of the mesh
//! is at `Q(f) = A(f)^-1 P(f)` in the *carried* space. Where a wheel turns, nothing moves there, however long the
//! arcs are that its points run along; and where a swarm falls, what remains is how its members drift apart.
//! Only bounds and slab tests live in carried space. Micropolygons are tested where they are.
//!
//! **What is between keys.** With `Q_0`, `Q_1` at the ends of a segment, `A_0 Q_0` and `A_1 Q_1` are the
//! positions there, and `P(f)` is straight between them, but `Q(f)` is not straight between its own ends:
//! multiplied out,
//!
//! ```text
//! A(f) (Q(f) - (1-f) Q_0 - f Q_1) = f (1-f) (A_1 - A_0) (Q_1 - Q_0)
//! ```
//!
//! so it strays from its chord by at most `1/4 |A(f)^-1| |A_1 - A_0| |Q_1 - Q_0|`: nothing where the carrier does not
//! turn. A blend of two rotations that are an angle `d` apart shrinks by no more than `cos(d/2)`, so its inverse is no
//! longer than one over that: [`Carrier::stretch`], up to 1.5 ([`LEAST_COSINE`]).
//!
//! **What nearly stands still.** Where every `Q_k` is within `e` of `Q_0`, `Q(f)` is within `e` times
//! the stretch of it, since `Q(f) - Q_0 = A(f)^-1 ((1-f) A_0 (Q_0' - Q_0) + f A_1 (Q_1' - Q_0))`.

use glam::{DMat3, DMat4, DQuat, DVec3, Vec3};

use crate::grid::DicedMesh;

/// Cosine of the largest angle between the rotations of neighbouring keys: a little more than a quarter of a turn.
const LEAST_COSINE: f64 = -0.11;
/// What [`Carrier::stretch`] is larger by, for rotations that are rounded to f32.
const STRETCH_ROOM: f64 = 1.0 + 1.0 / (1 << 16) as f64;

/// A rotation and a translation at every key; see the module's text.
#[derive(Clone, Debug)]
pub struct Carrier {
    /// Columns of the rotation, then the translation, for each key.
    maps: Vec<[Vec3; 4]>,
    turns: bool,
    stretch: f64,
}

impl Carrier {
    /// What takes a sample of points at the first key to where they are at each; only its translation, unless
    /// `turns`. None where the points turn too far from key to key.
    pub fn fit(samples: &[Vec<Vec3>], turns: bool) -> Option<Carrier> {
        let mean = |points: &[Vec3]| {
            let sum: DVec3 = points.iter().map(|p| p.as_dvec3()).sum();
            sum / points.len().max(1) as f64
        };
        let first = samples.first()?;
        let middle = mean(first);
        let mut maps: Vec<[Vec3; 4]> = Vec::with_capacity(samples.len());
        let mut least = 1.0f64;
        for (k, points) in samples.iter().enumerate() {
            let to = mean(points);
            let turn = if turns && k > 0 {
                rotation(first, middle, points, to)
            } else {
                DMat3::IDENTITY
            };
            let by = if k > 0 {
                to - turn * middle
            } else {
                DVec3::ZERO
            };
            let map = [turn.x_axis, turn.y_axis, turn.z_axis, by].map(|v| v.as_vec3());
            if let Some(before) = maps.last().filter(|_| turns) {
                // The trace of the rotation from one to the other is 1 + 2 cos.
                let trace: f64 = (0..3).map(|c| f64::from(before[c].dot(map[c]))).sum();
                let cosine = (trace - 1.0) * 0.5;
                least = least.min(cosine);
                // Written so that NaN is refused.
                let near = cosine >= LEAST_COSINE;
                if !near {
                    return None;
                }
            }
            if !map.iter().all(|v| v.is_finite()) {
                return None;
            }
            maps.push(map);
        }
        // 1 / cos(d/2).
        let stretch = (2.0 / (1.0 + least)).sqrt() * STRETCH_ROOM;
        Some(Carrier {
            maps,
            turns,
            stretch,
        })
    }

    /// True when it does more than translate.
    pub fn turns(&self) -> bool {
        self.turns
    }

    /// The inverse of no blend between two keys is longer.
    pub fn stretch(&self) -> f64 {
        self.stretch
    }

    /// Columns of the rotation, and the translation, at each key, as they are used everywhere.
    pub fn maps(&self) -> &[[Vec3; 4]] {
        &self.maps
    }

    /// Largest magnitude of a translation's component.
    pub fn reach(&self) -> f32 {
        let reach = |m: &[Vec3; 4]| m[3].abs().max_element();
        self.maps.iter().map(reach).fold(0.0, f32::max)
    }

    /// Bytes on the heap.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.maps[..])
    }

    /// Rotation and translation at fraction `f` of the segment from key `k`.
    pub fn at(&self, k: usize, f: f64) -> (DMat3, DVec3) {
        let a = self.maps[k].map(|v| v.as_dvec3());
        let b = self.maps[(k + 1).min(self.maps.len() - 1)].map(|v| v.as_dvec3());
        let [x, y, z, by] = [0, 1, 2, 3].map(|i| a[i] + (b[i] - a[i]) * f);
        (DMat3::from_cols(x, y, z), by)
    }

    /// What takes points of the mesh at key `k` to carried space: subtract, then multiply.
    pub fn inverse_at_key(&self, k: usize) -> (DMat3, DVec3) {
        let (turn, by) = self.at(k, 0.0);
        (turn.inverse(), by)
    }

    /// How far, at most, points stray from their chords within the segment from key `k` per length of
    /// the chord; see the module's text.
    pub fn stray(&self, k: usize) -> f64 {
        let norm2: f64 = (0..3)
            .map(|c| (self.maps[k + 1][c].as_dvec3() - self.maps[k][c].as_dvec3()).length_squared())
            .sum();
        0.25 * self.stretch * norm2.sqrt()
    }
}

/// The rotation that takes points about `from` nearest to others about `to` (Horn, "Closed-form solution of
/// absolute orientation using unit quaternions", JOSA A 4(4), 1987).
fn rotation(points: &[Vec3], from: DVec3, others: &[Vec3], to: DVec3) -> DMat3 {
    let mut s = DMat3::ZERO;
    for (p, q) in points.iter().zip(others) {
        let (p, q) = (p.as_dvec3() - from, q.as_dvec3() - to);
        s += DMat3::from_cols(p * q.x, p * q.y, p * q.z);
    }
    // s.col(j)[i] is the sum of p_i q_j.
    let [xx, yx, zx, xy, yy, zy, xz, yz, zz] = s.to_cols_array();
    let n = DMat4::from_cols_array(&[
        xx + yy + zz,
        yz - zy,
        zx - xz,
        xy - yx,
        yz - zy,
        xx - yy - zz,
        xy + yx,
        zx + xz,
        zx - xz,
        xy + yx,
        yy - xx - zz,
        yz + zy,
        xy - yx,
        zx + xz,
        yz + zy,
        zz - xx - yy,
    ]);
    let norm = |m: &DMat4| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    let size = norm(&n);
    let positive = size > 0.0 && size.is_finite();
    if !positive {
        return DMat3::IDENTITY;
    }
    // The eigenvector of the largest eigenvalue: columns of a high power, of a matrix made positive.
    let mut power = n * (1.0 / size) + DMat4::IDENTITY;
    for _ in 0..40 {
        power = power * power;
        power *= 1.0 / norm(&power);
    }
    let best = (0..4)
        .map(|c| power.col(c))
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    match best.and_then(|v| v.try_normalize()) {
        Some(q) => DMat3::from_quat(DQuat::from_xyzw(q.y, q.z, q.w, q.x)),
        None => DMat3::IDENTITY,
    }
}

/// Positions of some vertices at every key: those of up to `most` grids, at corners, middles of edges and
/// the middle of a part of 4 by 4 micropolygons, anywhere in the grid. Nine for a grid.
pub fn sample(mesh: &DicedMesh, most: usize) -> Vec<Vec<Vec3>> {
    let step = mesh.grids.len().div_ceil(most.max(1)).max(1);
    let mut out = vec![Vec::new(); mesh.key_count()];
    for (n, g) in (0..mesh.grids.len()).step_by(step).enumerate() {
        let grid = &mesh.grids[g];
        let (nu, nv) = (usize::from(grid.nu), usize::from(grid.nv));
        let (w, h) = (nu.min(4), nv.min(4));
        // Neighbours in the sample are taken at different places: strands move at their tips.
        let (i, j) = ((nu - w) * (n * 5 % 8) / 7, (nv - h) * (n * 3 % 8) / 7);
        for (k, out) in out.iter_mut().enumerate() {
            let points = mesh.grid_positions(g, k);
            for at in 0..9 {
                let (x, y) = (i + at % 3 * w / 2, j + at / 3 * h / 2);
                out.push(points[y * (nu + 1) + x]);
            }
        }
    }
    out
}
