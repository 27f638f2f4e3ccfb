//! The path of points: limit positions at point keys, through M(t) p(t), to output keys.
//!
//! Dicing evaluates positions in object space at the point keys; a [`PointPath`] maps them to the
//! output keys of the diced mesh, in the space the mesh is traced in and relative to its origin.
//! Between output keys the traced path is a straight line; the maker of the path has chosen keys
//! close enough for the chord error to be below its tolerance.

use glam::{DAffine3, DMat3, DVec3, Vec3};

/// One output key: which point keys it blends, and the matrix at that time.
#[derive(Clone, Debug)]
struct Step {
    key: usize,
    next: usize,
    f: f64,
    matrix: Option<DAffine3>,
    normal_matrix: DMat3,
}

/// Maps limit positions at point keys to output keys.
#[derive(Clone, Debug)]
pub struct PointPath {
    origin: DVec3,
    key_times: Vec<f32>,
    steps: Vec<Step>,
    point_key_times: Vec<f32>,
}

impl PointPath {
    /// The path at `key_times` (ascending in [0, 1], or the single time 0) for points with keys at
    /// `point_key_times`. `matrices` are object-to-target at each output key, or empty for identity.
    /// Output positions are relative to `origin`.
    pub fn new(
        point_key_times: &[f32],
        key_times: Vec<f32>,
        matrices: &[DAffine3],
        origin: DVec3,
    ) -> Self {
        assert!(matrices.is_empty() || matrices.len() == key_times.len());
        let steps = key_times
            .iter()
            .enumerate()
            .map(|(i, &time)| {
                let (key, f) = crate::grid::locate_key(point_key_times, time);
                let next = (key + 1).min(point_key_times.len() - 1);
                let matrix = matrices.get(i).copied();
                let normal_matrix = matrix.map_or(DMat3::IDENTITY, |m| normal_matrix(&m.matrix3));
                Step {
                    key,
                    next,
                    f: f64::from(f),
                    matrix,
                    normal_matrix,
                }
            })
            .collect();
        Self {
            origin,
            key_times,
            steps,
            point_key_times: point_key_times.to_vec(),
        }
    }

    /// Points as they are, at their own keys, relative to `origin`.
    pub fn identity(point_key_times: &[f32], origin: DVec3) -> Self {
        Self::new(point_key_times, point_key_times.to_vec(), &[], origin)
    }

    /// Number of point keys that positions to map must have.
    pub fn point_key_count(&self) -> usize {
        self.point_key_times.len()
    }

    /// The same path with keys at `key_times` (as [`Self::new`] takes them): what faces something needs
    /// keys of its own. Matrices go straight between the keys there are.
    pub fn with_keys(&self, key_times: Vec<f32>) -> Self {
        let matrix = |&time: &f32| {
            let (k, f) = crate::grid::locate_key(&self.key_times, time);
            let a = self.steps[k].matrix?;
            match self.steps.get(k + 1).and_then(|next| next.matrix) {
                Some(b) => Some(super::transform::lerp(&a, &b, f64::from(f))),
                None => Some(a),
            }
        };
        let matrices: Vec<DAffine3> = key_times.iter().filter_map(matrix).collect();
        Self::new(&self.point_key_times, key_times, &matrices, self.origin)
    }

    /// The point keys `(a, b)` and the fraction f that output key `k` is blended from: `(1 - f) a + f b`.
    pub fn blend(&self, k: usize) -> (usize, usize, f64) {
        let step = &self.steps[k];
        (step.key, step.next, step.f)
    }

    /// Object space to the space that is traced, at output key `k`; its origin is not subtracted.
    pub fn matrix(&self, k: usize) -> DAffine3 {
        self.steps[k].matrix.unwrap_or(DAffine3::IDENTITY)
    }

    /// Carries object-space normals at output key `k`; the length changes.
    pub fn normal_matrix(&self, k: usize) -> DMat3 {
        self.steps[k].normal_matrix
    }

    /// Output key times.
    pub fn key_times(&self) -> &[f32] {
        &self.key_times
    }

    /// What output positions are relative to.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Maps `n` positions: `limit` is `[point key][n]`; `out` becomes `[output key][n]`.
    pub fn map_positions(&self, limit: &[Vec3], n: usize, out: &mut Vec<Vec3>) {
        debug_assert_eq!(limit.len(), n * self.point_key_count());
        out.clear();
        out.reserve(n * self.steps.len());
        for step in &self.steps {
            let a = &limit[step.key * n..][..n];
            let b = &limit[step.next * n..][..n];
            out.extend(a.iter().zip(b).map(|(&a, &b)| self.place(step, a, b)));
        }
    }

    /// One position at output key `k`, from its limit positions at every point key.
    pub fn map_point(&self, k: usize, at_keys: impl Fn(usize) -> Vec3) -> Vec3 {
        let step = &self.steps[k];
        self.place(step, at_keys(step.key), at_keys(step.next))
    }

    fn place(&self, step: &Step, a: Vec3, b: Vec3) -> Vec3 {
        let p = if step.f == 0.0 {
            a.as_dvec3()
        } else {
            a.as_dvec3() + (b.as_dvec3() - a.as_dvec3()) * step.f
        };
        let p = step.matrix.as_ref().map_or(p, |m| m.transform_point3(p));
        (p - self.origin).as_vec3()
    }

    /// Maps `n` unit normals: `limit` is `[point key][n]`; `out` becomes `[output key][n]`, unit
    /// length, zero where not defined.
    pub fn map_normals(&self, limit: &[Vec3], n: usize, out: &mut Vec<Vec3>) {
        debug_assert_eq!(limit.len(), n * self.point_key_count());
        out.clear();
        out.reserve(n * self.steps.len());
        for step in &self.steps {
            let a = &limit[step.key * n..][..n];
            let b = &limit[step.next * n..][..n];
            out.extend(a.iter().zip(b).map(|(&a, &b)| {
                let v = a.as_dvec3() + (b.as_dvec3() - a.as_dvec3()) * step.f;
                (step.normal_matrix * v).normalize_or_zero().as_vec3()
            }));
        }
    }

    /// True when the normals change between output keys (rotation, or deforming points).
    pub fn turns_normals(&self) -> bool {
        self.point_key_times.len() > 1
            || self.steps.windows(2).any(|w| {
                let d = w[0].normal_matrix - w[1].normal_matrix;
                d.to_cols_array().iter().any(|x| x.abs() > 1.0e-12)
            })
    }
}

/// Cofactor matrix: carries normals through `m`, up to a positive scale, also where `m` is singular
/// or mirrors (the sign of the determinant keeps fronts in front).
fn normal_matrix(m: &DMat3) -> DMat3 {
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let cofactor = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let scale = cofactor
        .to_cols_array()
        .iter()
        .fold(0.0f64, |a, &v| a.max(v.abs()));
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    if scale > 0.0 {
        cofactor * (sign / scale)
    } else {
        cofactor
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirrored_transform_keeps_normals_outward() {
        let m = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let path = PointPath::new(&[0.0], vec![0.0], &[m], DVec3::ZERO);
        let mut out = Vec::new();
        // The normal of a sphere's point on +x must follow the point to -x.
        path.map_normals(&[Vec3::X], 1, &mut out);
        assert_eq!(out, vec![-Vec3::X]);
    }

    #[test]
    fn keys_in_between_follow_the_same_path() {
        let shift = |x: f64| DAffine3::from_translation(DVec3::new(x, 0.0, 0.0));
        let matrices = [shift(0.0), shift(2.0), shift(1.0)];
        let path = PointPath::new(&[0.0, 1.0], vec![0.0, 0.5, 1.0], &matrices, DVec3::ZERO);
        let more = path.with_keys(vec![0.0, 0.25, 0.5, 0.75, 1.0]);
        let mut out = Vec::new();
        more.map_positions(&[Vec3::ZERO, Vec3::Y], 1, &mut out);
        let at = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        let want = [
            at(0.0, 0.0),
            at(1.0, 0.25),
            at(2.0, 0.5),
            at(1.5, 0.75),
            at(1.0, 1.0),
        ];
        assert_eq!(out, want);
        let still = PointPath::identity(&[0.0], DVec3::ZERO).with_keys(vec![0.0, 1.0]);
        still.map_positions(&[Vec3::Y], 1, &mut out);
        assert_eq!(out, [Vec3::Y, Vec3::Y]);
    }

    #[test]
    fn far_origin_loses_nothing() {
        let m = DAffine3::from_translation(DVec3::splat(1.0e7));
        let path = PointPath::new(&[0.0], vec![0.0], &[m], DVec3::splat(1.0e7));
        let mut out = Vec::new();
        path.map_positions(&[Vec3::new(0.1, 0.2, 0.3)], 1, &mut out);
        assert!((out[0] - Vec3::new(0.1, 0.2, 0.3)).length() < 1.0e-7);
    }
}
