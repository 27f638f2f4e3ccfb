//! Slab tests of some rays of a packet against the children of a block, in the block's own frame.
//!
//! Rays come out of their records 16 at once, however they lie in the packet, are turned side by side, and stay in
//! registers while one child after the other is tested. The numbers are those of [`super::packet::Slabs`], but for
//! signs: nothing is mirrored, since near and far planes change places instead, and where rays go both ways along an
//! axis the nearer of both planes is near.

use hdtrapeze_simd::{Float, Mask, Part, Simd};

use super::enter::Entered;
use super::packet::{LANES, PACKET, Ranges, Record, Sixteen, turned};
use crate::bvh::bowing::Bowing;
use crate::bvh::node::Lattice8;
use crate::bvh::turn::Turning;
use crate::bvh::{Bounds8, U};

/// Tests `rays`, one or more, whose `records` are given, against 8 children in a frame, which bows as is told, each ray between its own `t_min`
/// and `t_max`, which `ranges` gives: the second mirrored. Where rays enter a child is not told.
#[inline(always)]
pub fn enter_block<S: Simd, B: Bounds8, T: Turning>(
    simd: S,
    bounds: &B,
    valid: u32,
    frame: (&T, &Bowing),
    rays: u64,
    records: &[Record; PACKET],
    ranges: &Ranges,
) -> Entered {
    simd.apart(EnterBlock {
        bounds,
        valid,
        frame,
        rays,
        records,
        ranges,
    })
}

struct EnterBlock<'a, B, T> {
    bounds: &'a B,
    valid: u32,
    frame: (&'a T, &'a Bowing),
    rays: u64,
    records: &'a [Record; PACKET],
    ranges: &'a Ranges,
}

/// Planes of 8 children at one end of the shutter: of each the lower and the upper one, by axis.
type Planes = [[f32; LANES]; 3];

#[inline(always)]
fn planes<S: Simd>(simd: S, lattice: &Lattice8) -> Planes {
    let mut out = [[0.0; LANES]; 3];
    for (a, out) in out.iter_mut().enumerate() {
        let [lower, upper] = &lattice.planes[a];
        let (step, origin) = (lattice.step()[a], lattice.origin()[a]);
        let planes = simd.bytes_in_turns(lower, upper);
        *out = planes
            .mul_add(simd.all16(step), simd.all16(origin))
            .to_array();
    }
    out
}

/// Rays along one axis.
#[derive(Clone, Copy)]
struct Along<F> {
    to_start: F,
    to_end: F,
    /// Added to the near plane's answer and to the far one's; to the lower one's and to the upper one's where rays go
    /// both ways.
    base: [F; 2],
    /// Which plane is near: the lower one, 0, or the upper one.
    near: usize,
}

impl<S: Simd, B: Bounds8, T: Turning> Part<S> for EnterBlock<'_, B, T> {
    type Output = Entered;
    #[inline(always)]
    fn run(self, simd: S) -> Entered {
        let Self { bounds, ranges, .. } = self;
        let start = planes(simd, bounds.start());
        let end = if B::MOVING {
            planes(simd, bounds.end())
        } else {
            start
        };
        let ranges = ranges.as_flattened();
        let mut found = Entered::NONE;
        let mut rest = self.rays;
        while rest != 0 {
            let all = rest;
            let mut records = [&self.records[0]; LANES];
            let mut spans = [&ranges[0]; LANES];
            for (record, span) in records.iter_mut().zip(&mut spans) {
                // Any ray where there are no more.
                let ray = rest.trailing_zeros() as usize & (PACKET - 1);
                (*record, *span) = (&self.records[ray], &ranges[ray]);
                rest &= rest.wrapping_sub(1);
            }
            let own = all & !rest;
            let lanes = ((1u64 << own.count_ones()) - 1) as u32;
            let [x, y, z, dx, dy, dz, time, pad] = simd.columns(records);
            let longest = dx.abs().max(dy.abs()).max(dz.abs());
            let smallest_dir = longest * simd.all16(U);
            let rays = ([x, y, z], [dx, dy, dz], time);
            let ((origin, dir, time), pad) = turned(Sixteen(simd), self.frame, rays, pad);
            let (zero, one) = (simd.all16(0.0), simd.all16(1.0));
            let (to_start, to_end) = (one - time, time);
            let mut agree = true;
            let mut along = [Along {
                to_start: one,
                to_end: one,
                base: [zero; 2],
                near: 0,
            }; 3];
            for (a, along) in along.iter_mut().enumerate() {
                let negative = dir[a].lt(zero);
                let d = dir[a].abs();
                let inverse = one.over(smallest_dir.or(d.lt(smallest_dir), d));
                let inverse = (-inverse).or(negative, inverse);
                along.to_start = inverse;
                if B::MOVING {
                    (along.to_start, along.to_end) = (to_start * inverse, to_end * inverse);
                }
                let (lower, upper) = ((origin[a] + pad) * -inverse, (origin[a] - pad) * -inverse);
                along.base = [lower, upper];
                let negative = negative.bits() & lanes;
                if negative == lanes {
                    (along.base, along.near) = ([upper, lower], 1);
                } else if negative != 0 {
                    agree = false;
                }
            }
            let [t_min, mirrored_t_max] = simd.unzipped(spans);
            // Those that are not asked for look nowhere.
            let t_max = (-mirrored_t_max).or(simd.mask16(lanes), -simd.all16(f32::INFINITY));
            let span = [t_min, t_max];
            if agree {
                each_child::<S, B, true>(simd, &start, &end, &along, span, own, &mut found);
            } else {
                for along in &mut along {
                    if along.near == 1 {
                        (along.base, along.near) = ([along.base[1], along.base[0]], 0);
                    }
                }
                each_child::<S, B, false>(simd, &start, &end, &along, span, own, &mut found);
            }
        }
        found.children &= self.valid;
        found
    }
}

/// One child after the other: the rays `own`, by lane.
#[inline(always)]
fn each_child<S: Simd, B: Bounds8, const AGREE: bool>(
    simd: S,
    start: &Planes,
    end: &Planes,
    along: &[Along<S::F16>; 3],
    [t_min, t_max]: [S::F16; 2],
    own: u64,
    found: &mut Entered,
) {
    for child in 0..8 {
        let (mut near, mut far) = (t_min, t_max);
        for (a, along) in along.iter().enumerate() {
            let mut t = along.base;
            for (side, t) in t.iter_mut().enumerate() {
                let plane = 2 * child + (side ^ along.near & 1);
                if B::MOVING {
                    *t = simd.all16(end[a][plane]).mul_add(along.to_end, *t);
                }
                *t = simd.all16(start[a][plane]).mul_add(along.to_start, *t);
            }
            let [first, second] = t;
            if AGREE {
                (near, far) = (first.max(near), second.min(far));
            } else {
                (near, far) = (first.min(second).max(near), first.max(second).min(far));
            }
        }
        let rays = simd.spread(near.le(far).bits(), own);
        found.rays[child] |= rays;
        found.children |= u32::from(rays != 0) << child;
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use hdtrapeze_simd::{Kernel, Level};

    use super::*;
    use crate::bvh::bowing::PARABOLA;
    use crate::bvh::lanes::Boxes8;
    use crate::bvh::turn::Turn;
    use crate::bvh::{Frame, LinearBox, LinearSlabs, StaticSlabs};
    use crate::trace::enter::enter_few;
    use crate::trace::packet::{Slabs, VECTORS};

    /// Random numbers (splitmix64).
    struct Random(u64);

    impl Random {
        fn bits(&mut self) -> u64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        }
        /// In [-1, 1).
        fn next(&mut self) -> f32 {
            (self.bits() >> 40) as f32 / (1 << 23) as f32 - 1.0
        }
        fn vec(&mut self) -> Vec3 {
            Vec3::new(self.next(), self.next(), self.next())
        }
    }

    /// What rays enter side by side, and each alone: how many pairs of them and children.
    struct Both<B>(u64, std::marker::PhantomData<B>);

    impl<B: Bounds8> Kernel for Both<B> {
        type Output = (u32, u32);
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> (u32, u32) {
            let mut random = Random(self.0);
            let boxes: Vec<LinearBox> = (0..8)
                .map(|_| {
                    let (at, by) = (random.vec(), random.vec() * 0.2);
                    let size = (random.vec() + 1.0) * 0.3;
                    LinearBox {
                        lo0: at,
                        hi0: at + size,
                        lo1: at + by,
                        hi1: at + by + size,
                    }
                })
                .collect();
            let bounds = B::pack(simd, &Boxes8::of(simd, &boxes));
            let axes = Frame::from_edges(random.vec(), random.vec()).unwrap_or(Frame::IDENTITY);
            let mut frame = Turn::fixed(&axes);
            if B::MOVING {
                frame.normals[1] = (frame.normals[1] + random.vec() * 0.2).normalize();
                frame.bow = random.vec() * 0.1;
            }
            // From all around, or all the same way along each axis.
            let around = self.0.is_multiple_of(3);
            let (eye, target) = (random.vec() * 4.0, random.vec() * 0.3);
            let mut records = [[f32::NAN; 8]; PACKET];
            let mut ranges: Ranges = [[[f32::NAN; 2]; LANES]; VECTORS];
            let mut rays = random.bits() & random.bits();
            if self.0.is_multiple_of(2) {
                rays &= random.bits() & random.bits();
            }
            rays |= 1 << (self.0 % 64);
            for ray in (0..PACKET).filter(|ray| rays >> ray & 1 == 1) {
                let origin = if around { random.vec() * 4.0 } else { eye };
                let to = target + random.vec() * 0.8;
                let [x, y, z] = origin.to_array();
                let [dx, dy, dz] = (to - origin).to_array();
                let time = 0.5 + 0.5 * random.next();
                records[ray] = [x, y, z, dx, dy, dz, time, 1e-5];
                ranges.as_flattened_mut()[ray] = [0.4 + 0.4 * random.next(), -1.1];
            }
            let valid = 0xff >> (self.0 % 5);
            let keys = [0.0, 0.25, 0.625, 1.0];
            let bowing = match self.0 % 7 {
                0..4 => &PARABOLA,
                _ => &Bowing::of(&keys),
            };
            let frame = (&frame, bowing);
            let found = enter_block(simd, &bounds, valid, frame, rays, &records, &ranges);
            let mut room = Slabs::SPOILED;
            let (mut all, mut entered) = (0, 0);
            for ray in (0..PACKET).filter(|ray| rays >> ray & 1 == 1) {
                let one = 1 << ray;
                let alone = (&records, &mut room);
                let own = enter_few(simd, &bounds, valid, frame, one, alone, &ranges);
                for child in 0..8 {
                    let enters = own.children >> child & 1 == 1;
                    let found = found.children >> child & 1 == 1 && found.rays[child] & one != 0;
                    assert_eq!(found, enters, "{}: ray {ray}, child {child}", self.0);
                    all += 1;
                    entered += u32::from(enters);
                }
            }
            for child in (0..8).filter(|child| found.children >> child & 1 == 1) {
                assert_eq!(found.rays[child] & !rays, 0);
                assert_ne!(found.rays[child], 0);
            }
            (all, entered)
        }
    }

    #[test]
    fn side_by_side_rays_enter_what_they_enter_alone() {
        for level in Level::available() {
            let (mut all, mut entered) = (0, 0);
            for seed in 0..1000 {
                for (a, e) in [
                    level.run(Both::<StaticSlabs>(seed, std::marker::PhantomData)),
                    level.run(Both::<LinearSlabs>(seed, std::marker::PhantomData)),
                ] {
                    (all, entered) = (all + a, entered + e);
                }
            }
            // Some of them: rays go past most of what is somewhere.
            assert!(
                entered > all / 100 && entered < all / 2,
                "{entered} of {all}"
            );
        }
    }
}
