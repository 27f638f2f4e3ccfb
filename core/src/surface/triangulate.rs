//! Cutting polygons into triangles: ear clipping in the plane that fits best.
//!
//! Works on any closed loop of points; where no ear is left (a loop that crosses itself, or has no
//! area), the rest becomes a fan, so that every polygon of n corners gives n - 2 triangles and every
//! edge of it stays an edge of one of them.

use glam::{DVec2, DVec3, Vec3};

/// Twice the area vector of a closed loop (Newell), in f64. Zero where it has no plane.
pub(super) fn area_vector(points: &[Vec3]) -> DVec3 {
    let Some(first) = points.first() else {
        return DVec3::ZERO;
    };
    let origin = first.as_dvec3();
    points
        .iter()
        .zip(points.iter().cycle().skip(1))
        .map(|(a, b)| (a.as_dvec3() - origin).cross(b.as_dvec3() - origin))
        .sum()
}

/// True where a loop turns the same way at every corner, seen along its area vector: it can be
/// spanned without leaving its outline. False also where it has no area.
pub(super) fn is_convex(points: &[Vec3]) -> bool {
    let up = area_vector(points);
    let n = points.len();
    up != DVec3::ZERO
        && (0..n).all(|i| {
            let p = points[i].as_dvec3();
            let before = p - points[(i + n - 1) % n].as_dvec3();
            let after = points[(i + 1) % n].as_dvec3() - p;
            before.cross(after).dot(up) >= 0.0
        })
}

/// Triangles over the corners `0..points.len()`, in the winding of the loop.
pub(super) fn triangulate(points: &[Vec3]) -> Vec<[u32; 3]> {
    let n = points.len();
    let mut triangles = Vec::with_capacity(n.saturating_sub(2));
    let mut rest: Vec<u32> = (0..n as u32).collect();
    if let Some(flat) = flatten(points) {
        clip_ears(&flat, &mut rest, &mut triangles);
    }
    for i in 1..rest.len().saturating_sub(1) {
        triangles.push([rest[0], rest[i], rest[i + 1]]);
    }
    triangles
}

/// Points in the loop's plane, counter-clockwise.
fn flatten(points: &[Vec3]) -> Option<Vec<DVec2>> {
    let up = area_vector(points).try_normalize()?;
    let (x, y) = up.any_orthonormal_pair();
    // x, y, up is right-handed, so a loop that runs counter-clockwise around `up` does in the plane.
    let origin = points[0].as_dvec3();
    Some(
        points
            .iter()
            .map(|p| {
                let d = p.as_dvec3() - origin;
                DVec2::new(d.dot(x), d.dot(y))
            })
            .collect(),
    )
}

/// Twice the signed area of a triangle.
fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - b)
}

/// Clips ears off `rest` until three corners, or no ear, are left.
fn clip_ears(points: &[DVec2], rest: &mut Vec<u32>, triangles: &mut Vec<[u32; 3]>) {
    let at = |i: u32| points[i as usize];
    let corner = |rest: &[u32], i: usize| {
        let n = rest.len();
        (rest[(i + n - 1) % n], rest[i], rest[(i + 1) % n])
    };
    // Only corners that turn inwards can lie inside an ear; one that no longer does never starts
    // again, so a stale entry only costs a test.
    let mut inward: Vec<u32> = (0..rest.len())
        .filter(|&i| {
            let (a, b, c) = corner(rest, i);
            turn(at(a), at(b), at(c)) < 0.0
        })
        .map(|i| rest[i])
        .collect();
    let mut i = 0;
    let mut failures = 0;
    while rest.len() > 3 && failures < rest.len() {
        i %= rest.len();
        let (a, b, c) = corner(rest, i);
        let (pa, pb, pc) = (at(a), at(b), at(c));
        let is_ear = turn(pa, pb, pc) > 0.0
            && !inward.iter().any(|&j| {
                let p = at(j);
                p != pa
                    && p != pb
                    && p != pc
                    && turn(pa, pb, p) >= 0.0
                    && turn(pb, pc, p) >= 0.0
                    && turn(pc, pa, p) >= 0.0
            });
        if !is_ear {
            i += 1;
            failures += 1;
            continue;
        }
        triangles.push([a, b, c]);
        rest.remove(i);
        inward.retain(|&j| j != b);
        failures = 0;
        // Step over the next corner, so that ears are taken all around and not in one fan of slivers.
        i += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[Vec3], triangles: &[[u32; 3]]) -> (f64, f64) {
        let up = area_vector(points).normalize();
        triangles
            .iter()
            .map(|t| {
                let p = t.map(|i| points[i as usize]);
                0.5 * area_vector(&p).dot(up)
            })
            .fold((0.0, 0.0), |(sum, absolute), a| {
                (sum + a, absolute + a.abs())
            })
    }

    fn check(points: &[Vec3]) {
        let triangles = triangulate(points);
        assert_eq!(triangles.len(), points.len() - 2);
        let expected = 0.5 * area_vector(points).length();
        let (signed, absolute) = area(points, &triangles);
        // No triangle is turned over, so none lies outside.
        assert!(
            (signed - expected).abs() < 1e-6 * expected,
            "{signed} {expected}"
        );
        assert!(
            (absolute - expected).abs() < 1e-6 * expected,
            "{absolute} {expected}"
        );
    }

    fn star(n: usize, inner: f32) -> Vec<Vec3> {
        (0..2 * n)
            .map(|i| {
                let r = if i % 2 == 0 { 1.0 } else { inner };
                let (sin, cos) = (i as f32 * std::f32::consts::PI / n as f32).sin_cos();
                Vec3::new(r * cos, r * sin, 0.3 * r * cos)
            })
            .collect()
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        for n in [3, 5, 12, 40] {
            for inner in [0.1, 0.5, 0.95] {
                let mut points = star(n, inner);
                check(&points);
                points.reverse();
                check(&points);
            }
        }
        let comb: Vec<Vec3> = [
            (0, 0),
            (7, 0),
            (7, 5),
            (6, 5),
            (6, 1),
            (5, 1),
            (5, 5),
            (4, 5),
            (4, 1),
            (3, 1),
            (3, 5),
            (2, 5),
            (2, 1),
            (1, 1),
            (1, 5),
            (0, 5),
        ]
        .iter()
        .map(|&(x, y)| Vec3::new(5.0, x as f32, y as f32))
        .collect();
        check(&comb);
    }

    #[test]
    fn corners_on_a_straight_edge_are_kept() {
        let square: Vec<Vec3> = [
            (0, 0),
            (1, 0),
            (2, 0),
            (2, 1),
            (2, 2),
            (1, 2),
            (0, 2),
            (0, 1),
        ]
        .iter()
        .map(|&(x, y)| Vec3::new(x as f32, y as f32, 0.0))
        .collect();
        check(&square);
    }

    #[test]
    fn degenerate_loops_become_fans() {
        for points in [
            vec![Vec3::ONE; 6],
            (0..5).map(|i| Vec3::X * i as f32).collect(),
        ] {
            assert_eq!(triangulate(&points).len(), points.len() - 2);
        }
        // A loop that crosses itself: no promise but the number.
        let eight: Vec<Vec3> = [(0, 0), (2, 2), (2, 0), (0, 2), (1, 5)]
            .iter()
            .map(|&(x, y)| Vec3::new(x as f32, y as f32, 0.0))
            .collect();
        assert_eq!(triangulate(&eight).len(), 3);
        assert!(triangulate(&[]).is_empty());
    }
}
