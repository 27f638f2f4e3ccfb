//! Rotations of nodes: what turns an axis-aligned box into an oriented one.
//!
//! A frame is three axes. They need not be exactly unit or orthogonal: slabs on any axes contain
//! what they contain, and the stored axes are the ones that bounds and rays are turned by. Axes are
//! near unit (within `4 U`); the pads of rotation rely on it that they are no longer.

use glam::{DMat3, DVec3, Vec3};

/// Three axes, rows of the matrix that turns object space into the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Frame {
    /// The axes, near unit length.
    pub axes: [Vec3; 3],
}

impl Frame {
    /// No rotation: axis-aligned boxes.
    pub const IDENTITY: Frame = Frame {
        axes: [Vec3::X, Vec3::Y, Vec3::Z],
    };

    /// Coordinates of `v` in the frame: `x*ax + y*ay + z*az` for each axis, in this order.
    #[inline(always)]
    pub fn turn(&self, v: Vec3) -> Vec3 {
        let dot = |a: Vec3| v.x * a.x + v.y * a.y + v.z * a.z;
        Vec3::new(dot(self.axes[0]), dot(self.axes[1]), dot(self.axes[2]))
    }

    /// The frame with first axis along `u` and last along `u x v`; none where they do not span a
    /// plane and `u` is no direction either.
    pub fn from_edges(u: Vec3, v: Vec3) -> Option<Frame> {
        let (u, v) = (u.as_dvec3(), v.as_dvec3());
        let x = u.try_normalize().or_else(|| v.try_normalize())?;
        let z = x
            .cross(v)
            .try_normalize()
            .filter(|_| x.cross(v).length_squared() > 1e-12 * v.length_squared())
            .unwrap_or_else(|| x.any_orthonormal_vector());
        // Unit and at right angles, but for f64's rounding: so is the third.
        Some(Frame {
            axes: [x, z.cross(x), z].map(|a| a.as_vec3()),
        })
    }

    /// Principal axes of a set of points: eigenvectors of their covariance, by cyclic Jacobi
    /// rotations. None for fewer than two distinct points.
    pub fn principal(points: &[Vec3]) -> Option<Frame> {
        let n = points.len() as f64;
        let mean = points.iter().fold(DVec3::ZERO, |s, p| s + p.as_dvec3()) / n;
        let mut m = DMat3::ZERO;
        for p in points {
            let d = p.as_dvec3() - mean;
            m += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        }
        let trace = m.x_axis.x + m.y_axis.y + m.z_axis.z;
        // Also rejects what is not finite.
        if !(trace > 0.0 && trace.is_finite()) {
            return None;
        }
        let v = eigenvectors(m * trace.recip());
        Some(Frame::from_axes(v.x_axis, v.y_axis, v.z_axis))
    }

    fn from_axes(x: DVec3, y: DVec3, z: DVec3) -> Frame {
        Frame {
            axes: [x, y, z].map(|a| a.normalize().as_vec3()),
        }
    }
}

/// Eigenvectors (columns) of a symmetric matrix. Five sweeps reach f64's precision for 3x3.
fn eigenvectors(m: DMat3) -> DMat3 {
    let mut a = m.to_cols_array_2d();
    let mut v = DMat3::IDENTITY.to_cols_array_2d();
    for _ in 0..5 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q].abs() < 1e-300 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            for column in &mut a {
                let (x, y) = (column[p], column[q]);
                column[p] = c * x - s * y;
                column[q] = s * x + c * y;
            }
            for i in 0..3 {
                let (x, y) = (a[p][i], a[q][i]);
                a[p][i] = c * x - s * y;
                a[q][i] = s * x + c * y;
                let (x, y) = (v[p][i], v[q][i]);
                v[p][i] = c * x - s * y;
                v[q][i] = s * x + c * y;
            }
        }
    }
    DMat3::from_cols_array_2d(&v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn frames_are_orthonormal(p in prop::collection::vec(prop::array::uniform3(-10.0f32..10.0), 2..30)) {
            let points: Vec<Vec3> = p.iter().map(|&p| Vec3::from_array(p)).collect();
            let frames = [Frame::principal(&points), Frame::from_edges(points[0], points[1])];
            for frame in frames.into_iter().flatten() {
                for i in 0..3 {
                    for j in 0..3 {
                        let d = frame.axes[i].as_dvec3().dot(frame.axes[j].as_dvec3());
                        let want = if i == j { 1.0 } else { 0.0 };
                        prop_assert!((d - want).abs() < 4.0 * f64::from(crate::bvh::U), "{} {} {}", i, j, d);
                    }
                }
            }
        }
    }

    #[test]
    fn principal_axes_follow_a_strand() {
        let d = Vec3::new(1.0, 2.0, -0.5);
        let points: Vec<Vec3> = (0..9).map(|i| d * i as f32).collect();
        let frame = Frame::principal(&points).expect("points span a line");
        let along = frame.axes.iter().map(|a| a.dot(d.normalize()).abs());
        assert!(along.fold(0.0f32, f32::max) > 1.0 - 1e-6);
        assert!(Frame::principal(&[Vec3::ONE; 4]).is_none());
        assert!(Frame::from_edges(Vec3::ZERO, Vec3::ZERO).is_none());
    }
}
