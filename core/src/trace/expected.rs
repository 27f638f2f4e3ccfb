//! What rays of a few neighbouring pixels are expected to meet, by where a few of them did: a plane that moves, and shears as it does.
//!
//! A ray is followed to the plane, and from there back to one instant, which tells where on the surface it ends, whatever time
//! and lens point it has. That chooses an order of rays and nothing else, so f32 is enough, and numbers that are not
//! finite are dealt with where the order is made. It has the same bits on every level of instructions.

use glam::{Mat2, Vec2, Vec3};
use hdtrapeze_simd::{Float, Kernel, Level, Simd};

use super::packet::{LANES, Lanes, columns};
use super::{Hit, Ray, World};

/// Rays that tell.
pub const PROBES: usize = 16;
/// Of them, those that must hit something, at the least; more than the three numbers that are fitted to each value.
const LEAST_HITS: usize = 6;

/// See the module's text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// A point of the plane, at half the shutter, and how it moves in a shutter.
    point: Vec3,
    velocity: Vec3,
    normal: Vec3,
    /// Directions along the image.
    along: [Vec3; 2],
    /// How much faster, along each of these, than `point` is what lies along each of them.
    shear: [Vec2; 2],
    /// How far points that were hit are off by the ends of the shutter, along the image: root of the mean square.
    spread: f32,
}

/// A point that was hit, at half the shutter: where, how far it goes, and how far it is off the middle of its way.
#[derive(Clone, Copy, Debug, Default)]
struct Met {
    point: Vec3,
    way: Vec3,
    bend: Vec3,
}

/// Where on a surface rays end, at half the shutter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Places {
    /// Along the image, in vectors; behind the last ray, its place again.
    pub at: Vec<[Lanes; 2]>,
    /// Number of rays.
    pub count: usize,
}

impl Places {
    /// Place of ray `i`.
    pub fn of(&self, i: usize) -> [f32; 2] {
        self.at[i / LANES].map(|lanes| lanes[i % LANES])
    }
}

#[inline(always)]
fn dot<S: Simd>(simd: S, [x, y, z]: [S::F16; 3], by: Vec3) -> S::F16 {
    x * simd.all16(by.x) + y * simd.all16(by.y) + z * simd.all16(by.z)
}

/// [`Expected::places`]; `ray` answers beyond the last too.
struct Follow<'a, F> {
    expected: &'a Expected,
    count: usize,
    ray: F,
}

impl<'r, F: Fn(usize) -> &'r Ray> Kernel for Follow<'_, F> {
    type Output = Places;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Places {
        let Self {
            expected,
            count,
            ray,
        } = self;
        let mut at = Vec::with_capacity(count.div_ceil(LANES));
        for first in (0..count).step_by(LANES) {
            let rays: [&Ray; LANES] = std::array::from_fn(|lane| ray(first + lane));
            let (first, last) = rays.split_at(LANES / 2);
            let [x, y, z, dx, dy, dz, time, _] = columns(simd, first);
            let [x_, y_, z_, dx_, dy_, dz_, time_, _] = columns(simd, last);
            let origin = [simd.halves(x, x_), simd.halves(y, y_), simd.halves(z, z_)];
            let dir = [
                simd.halves(dx, dx_),
                simd.halves(dy, dy_),
                simd.halves(dz, dz_),
            ];
            let [x, y] = expected.place(simd, origin, dir, simd.halves(time, time_));
            at.push([x.to_array(), y.to_array()]);
        }
        Places { at, count }
    }
}

impl Met {
    fn of(world: &World, hit: &Hit) -> Option<Self> {
        let [first, point, last] = [0.0, 0.5, 1.0].map(|time| world.position(hit, time));
        let (first, point, last) = (first?, point?, last?);
        let (way, bend) = (last - first, point - 0.5 * (first + last));
        (point + way + bend)
            .is_finite()
            .then_some(Self { point, way, bend })
    }
}

impl Expected {
    /// What rays met, each with its hit. `None` where they met too little.
    pub fn of(world: &World, rays: &[(Ray, Hit); PROBES]) -> Option<Self> {
        let mut met = [Met::default(); PROBES];
        let mut count = 0;
        for found in rays.iter().filter_map(|(_, hit)| Met::of(world, hit)) {
            met[count] = found;
            count += 1;
        }
        if count < LEAST_HITS {
            return None;
        }
        let dirs = rays.iter().map(|(ray, _)| ray.dir.normalize_or_zero());
        Self::fitted(&met[..count], dirs.sum::<Vec3>().try_normalize()?)
    }

    /// Linear fits to what points are off their mean, of where they are along the image.
    fn fitted(met: &[Met], forward: Vec3) -> Option<Self> {
        let count = met.len() as f32;
        let point = met.iter().map(|m| m.point).sum::<Vec3>() / count;
        let way = met.iter().map(|m| m.way).sum::<Vec3>() / count;
        let (a, b) = forward.any_orthonormal_pair();
        let along = |p: Vec3| Vec2::new(p.dot(a), p.dot(b));
        let (mut squares, mut products) = (Mat2::ZERO, [Vec2::ZERO; 3]);
        for m in met {
            let at = along(m.point - point);
            squares += Mat2::from_cols(at * at.x, at * at.y);
            let off = along(m.way - way);
            let values = [(m.point - point).dot(forward), off.x, off.y];
            for (sum, value) in products.iter_mut().zip(values) {
                *sum += at * value;
            }
        }
        // Of points that lie on a line, or in one place, nothing is said across it.
        let least = 1e-3 * (squares.x_axis.x + squares.y_axis.y) + 1e-18;
        squares += Mat2::from_diagonal(Vec2::splat(least));
        let inverse = squares.inverse();
        let [tilt, right, up] = products.map(|sum| inverse * sum);
        let off = |m: &Met| {
            let at = along(m.point - point);
            let fitted = Vec2::new(right.dot(at), up.dot(at));
            0.25 * (along(m.way - way) - fitted).length_squared() + along(m.bend).length_squared()
        };
        // Three numbers were fitted.
        let spread = (met.iter().map(off).sum::<f32>() / (count - 3.0)).sqrt();
        spread.is_finite().then_some(Self {
            point,
            velocity: way,
            normal: forward - tilt.x * a - tilt.y * b,
            along: [a, b],
            shear: [right, up],
            spread,
        })
    }

    /// Where what rays meet on the plane is at half the shutter, along the image.
    // Loops in place of closures, which are compiled without a level's instructions where they are not inlined.
    #[inline(always)]
    fn place<S: Simd>(
        &self,
        simd: S,
        origin: [S::F16; 3],
        dir: [S::F16; 3],
        time: S::F16,
    ) -> [S::F16; 2] {
        let time = time - simd.all16(0.5);
        let mut to = origin;
        for (axis, to) in to.iter_mut().enumerate() {
            let at = simd.all16(self.velocity[axis]) * time + simd.all16(self.point[axis]);
            *to = at - *to;
        }
        let t = dot(simd, to, self.normal).over(dot(simd, dir, self.normal));
        let mut off = to;
        for (off, dir) in off.iter_mut().zip(dir) {
            *off = dir * t - *off;
        }
        let [right, up] = self.along;
        let (x, y) = (dot(simd, off, right), dot(simd, off, up));
        let [right, up] = self.shear;
        let xx = simd.all16(right.x) * time + simd.all16(1.0);
        let xy = simd.all16(right.y) * time;
        let yx = simd.all16(up.x) * time;
        let yy = simd.all16(up.y) * time + simd.all16(1.0);
        let scale = simd.all16(1.0).over(xx * yy - xy * yx);
        [(yy * x - xy * y) * scale, (xx * y - yx * x) * scale]
    }

    /// Where what each of `count` rays meets on the plane is at half the shutter, along the image.
    pub fn places<'r>(&self, level: Level, count: usize, ray: impl Fn(usize) -> &'r Ray) -> Places {
        let (expected, last) = (self, count.saturating_sub(1));
        level.run(Follow {
            expected,
            count,
            ray: |i: usize| ray(i.min(last)),
        })
    }

    /// The area of the surface that rays meet together, by their places and times.
    pub fn area(&self, rays: impl Iterator<Item = ([f32; 2], f32)>) -> f32 {
        let mut bounds = [[f32::INFINITY, f32::NEG_INFINITY]; 3];
        for ([x, y], time) in rays {
            for (bounds, x) in bounds.iter_mut().zip([x, y, time]) {
                *bounds = [bounds[0].min(x), bounds[1].max(x)];
            }
        }
        let [x, y, time] = bounds.map(|[low, high]| high - low);
        let off = 2.0 * self.spread * time;
        (x + off) * (y + off)
    }

    /// The least that [`Self::area`] is of rays of all times.
    pub fn least_area(&self) -> f32 {
        (2.0 * self.spread).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plane that moves and shears, by formula.
    fn at(p: Vec2, time: f32) -> Vec3 {
        let still = Vec3::new(p.x, p.y, 0.3 * p.x - 0.2 * p.y);
        still + (time - 0.5) * Vec3::new(0.8 + 0.3 * p.y, -0.5 + 0.2 * p.x, 0.1)
    }

    fn met(p: Vec2) -> Met {
        let [first, point, last] = [0.0, 0.5, 1.0].map(|time| at(p, time));
        Met {
            point,
            way: last - first,
            bend: point - 0.5 * (first + last),
        }
    }

    fn points() -> impl Iterator<Item = Vec2> {
        (0..12u8).map(|i| Vec2::new(f32::from(i % 4), f32::from(i / 4)) * 0.1 - 0.15)
    }

    /// What one of many rays meets, on which all levels agree.
    fn place(expected: &Expected, ray: &Ray) -> [f32; 2] {
        let at = 21;
        let aside = Ray {
            time: 1.0 - ray.time,
            ..*ray
        };
        let rays = |i: usize| if i == at { ray } else { &aside };
        let place = expected.places(Level::SCALAR, at + 1, rays);
        for level in Level::available() {
            assert_eq!(expected.places(level, at + 1, rays), place, "{level:?}");
        }
        assert_eq!(place.count, at + 1);
        // The last one, and what is behind it.
        for i in at..place.at.len() * LANES {
            assert_eq!(place.of(i), place.of(at));
        }
        assert!(place.of(0) != place.of(at) || ray.time == 0.5);
        place.of(at)
    }

    #[test]
    fn rays_end_where_the_surface_is_at_half_the_shutter() {
        let met: Vec<Met> = points().map(met).collect();
        let expected = Expected::fitted(&met, Vec3::NEG_Z).unwrap();
        assert!(expected.spread < 1e-3, "{expected:?}");
        let normal = Vec3::new(0.3, -0.2, -1.0).normalize();
        assert!(expected.normal.normalize().dot(normal) > 0.9999);
        for p in points() {
            for (time, lens) in [(0.0, 0.3), (0.4, -0.2), (1.0, 0.0), (0.9, 0.5)] {
                let origin = Vec3::new(lens, 0.1 - lens, 4.0);
                let ray = Ray {
                    origin,
                    dir: at(p, time) - origin,
                    time,
                    t_min: 0.0,
                    t_max: f32::INFINITY,
                };
                let off = at(p, 0.5) - expected.point;
                let should = expected.along.map(|axis| off.dot(axis));
                let is = place(&expected, &ray);
                let error = (Vec2::from(is) - Vec2::from(should)).length();
                // Depths shear too, which is not followed; a shutter's way is 50 times as far.
                assert!(error < 0.02, "{p} at {time} from {lens}: {error}");
            }
        }
    }

    #[test]
    fn what_goes_several_ways_is_spread() {
        let ways = |by: f32| {
            let one = |(i, p): (usize, Vec2)| {
                let mut met = met(p);
                met.way.x += if i % 2 == 0 { by } else { -by };
                met
            };
            let met: Vec<Met> = points().enumerate().map(one).collect();
            Expected::fitted(&met, Vec3::NEG_Z).unwrap()
        };
        // Half of a way to each end of the shutter; three of twelve numbers are fitted.
        let spread = ways(0.4).spread;
        assert!((0.18..0.26).contains(&spread), "{spread}");
        assert!(ways(0.4).least_area() > 0.1 && ways(0.0).least_area() < 1e-6);

        let mut bent: Vec<Met> = points().map(met).collect();
        for (i, met) in bent.iter_mut().enumerate() {
            met.bend.y = if i % 3 == 0 { 0.2 } else { -0.1 };
        }
        let bent = Expected::fitted(&bent, Vec3::NEG_Z).unwrap().spread;
        assert!((0.12..0.2).contains(&bent), "{bent}");
    }

    #[test]
    fn one_place_and_a_line_are_no_trouble() {
        // Exactly in one place.
        let one = vec![met(Vec2::new(0.125, 0.25)); 8];
        let line: Vec<Met> = (0..8u8)
            .map(|i| met(Vec2::splat(f32::from(i) * 0.1)))
            .collect();
        for all in [one, line] {
            let expected = Expected::fitted(&all, Vec3::NEG_Z).unwrap();
            let origin = Vec3::Z * 3.0;
            let ray = Ray {
                origin,
                dir: at(Vec2::splat(0.3), 0.2) - origin,
                time: 0.2,
                t_min: 0.0,
                t_max: f32::INFINITY,
            };
            assert!(place(&expected, &ray).iter().all(|x| x.is_finite()));
        }
        let nowhere = Met {
            point: Vec3::splat(f32::NAN),
            ..Met::default()
        };
        assert!(Expected::fitted(&[nowhere; 8], Vec3::NEG_Z).is_none());
    }
}
