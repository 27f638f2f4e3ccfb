//! The oracle: every micropolygon, brute force, in f64.
//!
//! Independent of everything it checks: no tree, no f32 after the stored positions, and another
//! intersection method (projection along the ray, signed distances to edges). For tests, for the
//! parity of back ends, and for benches to check a sample of what they time. Slow: about 10^4
//! micropolygons a ray are sensible.

use glam::{DVec2, DVec3};

use super::places::Places;
use super::{Hit, Ray, World, world::clamp_time};
use crate::bvh::U;

/// Where hits may differ from the oracle: `TOLERANCE * condition * (|origin| + world radius)`, a
/// distance. A traced vertex is off by up to 27.8 U, a ray in an object's space by 4 more, `t` by
/// 2 (see [`super::object_ray`] and [`super::instance`]); `|M| S <= 3 c (|origin| + R)` makes it 102,
/// rounded up.
pub const TOLERANCE: f64 = 128.0 * U as f64;

/// A triangle that the ray meets, or nearly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Distance to the triangle's plane, in units of the ray's direction.
    pub t: f64,
    /// Distance, across the ray, to the nearest edge: positive inside.
    pub inside: f64,
    /// |cosine| between the ray and the triangle's normal.
    pub cosine: f64,
    /// Which micropolygon.
    pub instance: u32,
    /// Grid of it.
    pub grid: u32,
    /// Cell of it.
    pub cell: u32,
    /// What `inside` and `t |dir| cosine` may be off by.
    pub tolerance: f64,
}

fn condition(m: &glam::DMat3) -> f64 {
    let norm = |m: &glam::DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    norm(m) * norm(&m.inverse())
}

/// Calls `f(instance, grid, cell, tolerance, corners)` for every micropolygon, at the ray's time.
fn each_cell(world: &World, ray: &Ray, mut f: impl FnMut(u32, u32, u32, f64, [DVec3; 4])) {
    let time = clamp_time(ray.time);
    let reach = f64::from(ray.origin.abs().max_element()) + f64::from(world.radius());
    for number in 0..world.instance_count() as u32 {
        let (set, i) = world.find(number);
        let set = &set.set;
        let mesh = set.object().mesh();
        let m = set.to_world(i, time, world.origin);
        let condition = match set.places {
            Places::Translated(_) => 1.0,
            _ => condition(&m.matrix3),
        };
        let tolerance = TOLERANCE * condition * reach;
        // The path of a vertex, from its keys, in f64.
        let times = &mesh.key_times;
        let k = (1..times.len().max(2) - 1)
            .take_while(|&k| times[k] <= time)
            .last()
            .unwrap_or(0);
        let (next, s) = if times.len() > 1 {
            let (a, b) = (f64::from(times[k]), f64::from(times[k + 1]));
            (k + 1, (f64::from(time) - a) / (b - a))
        } else {
            (0, 0.0)
        };
        for (g, grid) in mesh.grids.iter().enumerate() {
            let p = |i: usize| {
                let (a, b) = (mesh.position(g, k, i), mesh.position(g, next, i));
                let (a, b) = (a.as_dvec3(), b.as_dvec3());
                m.transform_point3(a * (1.0 - s) + b * s)
            };
            let nu = usize::from(grid.nu);
            for cell in 0..grid.cell_count() {
                let i = cell / nu * (nu + 1) + cell % nu;
                let corners = [p(i), p(i + 1), p(i + nu + 2), p(i + nu + 1)];
                f(number, g as u32, cell as u32, tolerance, corners);
            }
        }
    }
}

/// All triangles that the ray's line meets or misses by less than the tolerance, in no order, `t`
/// unlimited. Triangles seen edge-on, to within the tolerance, are left out.
pub fn crossings(world: &World, ray: &Ray) -> Vec<Crossing> {
    let mut out = Vec::new();
    let (origin, dir) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    let Some(d) = dir.try_normalize() else {
        return out;
    };
    let (x, y) = d.any_orthonormal_pair();
    each_cell(
        world,
        ray,
        |instance, grid, cell, tolerance, [p0, p1, p2, p3]| {
            for [a, b, c] in [[p0, p1, p2], [p0, p2, p3]] {
                let flat = |p: DVec3| DVec2::new((p - origin).dot(x), (p - origin).dot(y));
                let corners = [flat(a), flat(b), flat(c)];
                let normal = (b - a).cross(c - a);
                let area = normal.dot(d);
                let mut inside = f64::INFINITY;
                for i in 0..3 {
                    let (p, q) = (corners[i], corners[(i + 1) % 3]);
                    let length = (q - p).length();
                    if length > 0.0 {
                        inside = inside.min(p.perp_dot(q) * area.signum() / length);
                    }
                }
                if !inside.is_finite() || inside < -tolerance || area == 0.0 {
                    continue;
                }
                let t = (a - origin).dot(normal) / area / dir.length();
                let cosine = (area / normal.length()).abs();
                if t.is_finite() {
                    out.push(Crossing {
                        t,
                        inside,
                        cosine,
                        instance,
                        grid,
                        cell,
                        tolerance,
                    });
                }
            }
        },
    );
    out
}

/// Checks an answer of [`World::trace`] (or, with `after`, of [`World::trace_after`]) against the
/// oracle: a hit must lie on its micropolygon to within the tolerance, and nothing that is hit
/// beyond doubt may lie before it. The error says what is wrong.
pub fn verify(world: &World, ray: &Ray, after: Option<&Hit>, hit: &Hit) -> Result<(), String> {
    let (origin, dir) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    if hit.is_hit() {
        if !(hit.t >= ray.t_min && hit.t <= ray.t_max) {
            return Err(format!("t out of range: {hit:?}"));
        }
        if after.is_some_and(|a| !a.is_before(hit)) {
            return Err(format!("{hit:?} is not after {after:?}"));
        }
        let point = origin + dir * f64::from(hit.t);
        let mut found = None;
        each_cell(world, ray, |instance, grid, cell, tolerance, p| {
            if (instance, grid, cell) == (hit.instance, hit.grid, hit.cell) {
                let w = super::shading::corner_weights(hit.u, hit.v).map(f64::from);
                let at = (0..4).fold(DVec3::ZERO, |s, i| s + p[i] * w[i]);
                let size = (p[2] - p[0]).length().max((p[3] - p[1]).length());
                found = Some((at, tolerance + size * 4.0 * f64::from(U)));
            }
        });
        let Some((on_cell, tolerance)) = found else {
            return Err(format!("no such micropolygon: {hit:?}"));
        };
        // (u, v) and t name the same point.
        let off = (on_cell - point).length();
        if off > 2.0 * tolerance {
            return Err(format!(
                "{hit:?} is {off} off its micropolygon, tolerance {tolerance}"
            ));
        }
    }
    let limit = if hit.is_hit() { hit.t } else { ray.t_max };
    let t_min = after.map_or(ray.t_min, |a| ray.t_min.max(a.t));
    for c in crossings(world, ray) {
        let slack = (c.tolerance / c.cosine + c.tolerance) / dir.length();
        let sure = c.inside > c.tolerance;
        if sure && c.t > f64::from(t_min) + slack && c.t < f64::from(limit) - slack {
            return Err(format!("{hit:?} passes over {c:?}"));
        }
    }
    Ok(())
}
