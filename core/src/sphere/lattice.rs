//! Unit spheres as lattices.
//!
//! A hemisphere is the square, taken to the disk concentrically (Shirley and Chiu, "A Low Distortion Map
//! Between Disk and Square", JGT 1997) and lifted, so that its rings are at even angles. The map is
//! evaluated in one octant and mirrored: the rims of two hemispheres have the same bits.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use glam::DVec3;

/// How far the normals at the corners of a square that stands for a sphere lean out, as a tangent along
/// each of its axes: interpolated, they are as bright under light from the camera, on the mean, as the
/// sphere is (2/3 of a disk).
const QUAD_LEAN: f64 = 1.5158;

/// A vertex of a lattice about the origin, whose front is towards +z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticeVertex {
    /// Position.
    pub p: DVec3,
    /// Normal, of any length.
    pub normal: DVec3,
}

/// A square of a sphere's outline's area, one cell.
pub fn quad() -> Vec<LatticeVertex> {
    let half = 0.5 * PI.sqrt();
    [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
        .map(|(x, y)| LatticeVertex {
            p: DVec3::new(x * half, y * half, 0.0),
            normal: DVec3::new(x * QUAD_LEAN, y * QUAD_LEAN, 1.0),
        })
        .to_vec()
}

/// A hemisphere of `n` by `n` cells, n even, row by row. Its outline, a polygon of 4 n sides, has the
/// area of the disk. `rounded`: its normals lean out less than the sphere's, so that interpolated
/// over few cells they are as bright on the mean as the sphere's own.
pub fn hemisphere(n: usize, rounded: bool) -> Vec<LatticeVertex> {
    let step = 2.0 * PI / (4 * n) as f64;
    let scale = (step / step.sin()).sqrt();
    let lean = match n {
        _ if !rounded => 1.0,
        0..=2 => 0.748,
        4 => 0.886,
        _ => 1.0 - 2.2 / (n * n) as f64,
    };
    let at = |i: usize| (2.0 * i as f64 - n as f64) / n as f64;
    let vertex = |x: f64, y: f64| {
        let (a, b) = (x.abs(), y.abs());
        let (large, small) = (a.max(b), a.min(b));
        if large == 0.0 {
            return LatticeVertex {
                p: DVec3::Z * scale,
                normal: DVec3::Z,
            };
        }
        let (sin, cos) = (FRAC_PI_4 * (small / large)).sin_cos();
        let (u, v) = if a >= b { (cos, sin) } else { (sin, cos) };
        let (u, v) = (u.copysign(x), v.copysign(y));
        let lift = |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            DVec3::new(u * sin, v * sin, cos)
        };
        let mut p = lift(FRAC_PI_2 * large) * scale;
        if large == 1.0 {
            p.z = 0.0;
        }
        LatticeVertex {
            p,
            normal: lift(FRAC_PI_2 * large * lean),
        }
    };
    (0..=n)
        .flat_map(|j| (0..=n).map(move |i| vertex(at(i), at(j))))
        .collect()
}

/// The other half: the hemisphere turned half around about y, so that its front is towards -z.
pub fn turned(vertex: &LatticeVertex) -> LatticeVertex {
    let turn = |v: DVec3| DVec3::new(-v.x, v.y, -v.z);
    LatticeVertex {
        p: turn(vertex.p),
        normal: turn(vertex.normal),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Area of the outline, and the mean cosine over it, of triangles as the tracer interpolates them.
    fn seen(vertices: &[LatticeVertex], n: usize) -> (f64, f64) {
        let (mut area, mut light) = (0.0, 0.0);
        const S: usize = 24;
        for j in 0..n {
            for i in 0..n {
                let v = |i: usize, j: usize| vertices[j * (n + 1) + i];
                let (a, c) = (v(i, j), v(i + 1, j + 1));
                for t in [[a, v(i + 1, j), c], [a, c, v(i, j + 1)]] {
                    let (e, f) = (t[1].p - t[0].p, t[2].p - t[0].p);
                    let size = 0.5 * (e.x * f.y - e.y * f.x);
                    let mut sum = 0.0;
                    let unit = t.map(|v| v.normal.normalize());
                    for k in 0..S * S {
                        // A uniform point of the triangle.
                        let x = ((k % S) as f64 + 0.5) / S as f64;
                        let y = ((k / S) as f64 + 0.5) / S as f64;
                        let (b, c) = if x + y < 1.0 {
                            (x, y)
                        } else {
                            (1.0 - x, 1.0 - y)
                        };
                        let m = unit[0] * (1.0 - b - c) + unit[1] * b + unit[2] * c;
                        sum += m.normalize().z;
                    }
                    area += size;
                    light += size * sum / (S * S) as f64;
                }
            }
        }
        (area, light / area)
    }

    #[test]
    fn outlines_and_brightness_are_the_spheres() {
        let (area, light) = seen(&quad(), 1);
        assert!((area / PI - 1.0).abs() < 1e-9, "{area}");
        assert!((light - 2.0 / 3.0).abs() < 2e-3, "{light}");
        for n in [2, 4, 6, 8, 16] {
            let (area, light) = seen(&hemisphere(n, true), n);
            assert!((area / PI - 1.0).abs() < 1e-9, "{n}: {area}");
            assert!((light - 2.0 / 3.0).abs() < 3e-3, "{n}: {light}");
        }
    }

    #[test]
    fn hemispheres_meet() {
        for n in [2, 6, 16] {
            let front = hemisphere(n, false);
            let back: Vec<LatticeVertex> = front.iter().map(turned).collect();
            let at = |v: &[LatticeVertex], i: usize, j: usize| v[j * (n + 1) + i];
            for i in 0..=n {
                for (i, j) in [(i, 0), (i, n), (0, i), (n, i)] {
                    let (a, b) = (at(&front, i, j), at(&back, n - i, j));
                    assert_eq!(a.p.abs(), b.p.abs());
                    assert!((a.p - b.p).length() == 0.0, "{} {}", a.p, b.p);
                }
            }
        }
    }
}
