//! A ray in the space of one object, prepared once for slab tests and micropolygon tests.
//!
//! **The pad of slab tests.** A micropolygon test (see [`super::cell`]) accepts exactly those triangles
//! whose *rounded*, translated, sheared vertices contain the ray. The slab tests must never cull one
//! of them, whatever was rounded, so near planes come nearer and far planes go farther by
//! `SLAB_PAD * (|origin| + radius)`. Its derivation, in units of `U S` with `U = 2^-24`,
//! `S = max |origin_i| + radius`, where `radius` bounds every coordinate of the object's vertices
//! and every stored bound:
//!
//! - a vertex at the ray's time: the fraction between keys errs by 3 (two differences, a quotient)
//!   of a step of up to 2 radii: 6; its interpolation by 5 (2, 2, and 1 for the sum, which lies between the ends);
//!   the translation by 1; the shear by 4 (the slope, a product, a difference of up to 2 S): 16 an axis, 27.8 as a
//!   length. What the first two do to `z` is part of the vertex that is sheared, not of the shear. A hit is a mean of
//!   three such vertices, with weights that are not negative, so it is no farther off than they;
//! - `t` is rounded once, over a distance of at most sqrt(3) S: 1.8;
//! - the turned origin, three products: 5.2; the turned direction, the same at distance `t`, and its
//!   clamping (below): 7;
//! - the slab test of [`crate::bvh::node`]: for a plane `(1 - T)(o0 + s0 q0) + T (o1 + s1 q1)` it sums
//!   `s0 q0 i0`, `s1 q1 i1`, `o0 i0`, `o1 i1` and `-(o + pad) / d`, where `i0` is `(1 - T) / d` to 3 roundings
//!   and `i1` is `T / d` to 2. The products are off by 5, 4, 4, 3 and 3 of themselves, the sums before the
//!   last by 1 each (of at most R, and R + |o| twice); with `|s q| <= 2 R` and each end's `|o| <= R` that is at most
//!   `20 R + 7 |o|`, and in a rotated frame, whose coordinates are up to sqrt(3) larger, 34.7. The last sum, of what is
//!   not beyond `t` before it is rounded, is not beyond `t` after: `t` is an f32. Packets ([`super::enter`],
//!   [`super::enter_block`]) place the planes first, `o + s q` to a product and a sum, 3 R, and sum `P0 i0`, `P1 i1`
//!   and the last term, products off by 4, 3 and 3 of themselves and one sum of R + |o|: at most `8 R + 4 |o|`, less.
//!
//! The sum is 76.5; [`SLAB_PAD`] is 80, which leaves room for terms of order `U^2`. So for an accepted
//! hit at `t`, every axis of every node above it answers `near <= t <= far` in f32, and hits found do
//! not depend on the order of traversal.
//!
//! **In a frame that turns** ([`crate::bvh::turn`]) the third axis at the ray's time, `fl(a0 + fl(fl(a1 - a0) T))`, is off by
//! `2 |a1 - a0| + |a|`, at most 4.3 as a length. Origin and direction are turned by the same axis, so that counts once, where the
//! hit is, at up to sqrt(3) R: 7.4. The bow of any axis is at most 5.6 R: with two keys it is along the third alone, 1.61 for
//! the step of an axis times 2 sqrt(3) R for the block's way; with more it is no larger than 5.5 times the reach of the block's
//! middle, which is not beyond R but for its own roundings. `T (1 - T)` of it, at most 1.4 R, is off by 3
//! roundings: 4.2; where bows go straight from key to key ([`crate::bvh::bowing`]), by 3.25 of 5.6 R and one of 1.4 R:
//! 19.6. Adding it to the origin rounds by 1.8 more, and what is larger by it, by 7 times 1.4 R: 9.8. Together with the 76.5
//! above that is 115.1 on the third axis, and 107.7 on the others; such tests are padded by [`TURN_PADS`] pads, 120.
//!
//! **Below f32's normal numbers** a product is off by up to 2^-150, however small it is. In coordinates (interpolation,
//! shear, and three products that turn an origin), that is a distance of less than 2^-146. In `t`, it is multiplied
//! by the direction: `s0 i0` and `s1 i1` are so off before they are multiplied by up to 255, all else once, 2^-140
//! together. [`TINY_PAD`] is 2^-126, for each unit of the direction and for one more: the pad of no ray that is not tiny
//! or absurdly fast has other bits for it.
//!
//! **Directions near zero.** A component of the turned direction smaller than `U max |dir|` is
//! replaced by that, with its sign: over the distance of a hit the ray moves by no more than `U` of
//! it, which the pad contains; reciprocals are finite and no rule for 0 times infinity is needed.

use std::ops::RangeInclusive;

use glam::Vec3;

use crate::bvh::U;
use crate::bvh::bowing::{Bowing, PARABOLA};
use crate::bvh::node::SlabRay;
use crate::bvh::turn::{TURN_PADS, Turning};

/// Pad of slab tests per unit of `|origin| + radius`; derived in the module's text.
pub const SLAB_PAD: f32 = 80.0 * U;

/// What slab tests are padded by besides, per unit of the direction's largest component and one; derived in the
/// module's text.
pub const TINY_PAD: f32 = f32::MIN_POSITIVE;

/// Smallest and largest magnitude of a direction's largest component. Rays beyond are answered as misses.
pub const DIR_RANGE: RangeInclusive<f32> = 1.0 / (1u64 << 60) as f32..=(1u64 << 60) as f32;

/// Smallest magnitude of a direction's largest component, in pads: no term of a slab test overflows. Clamped
/// components are 2^24 smaller, coordinates at most 2^18 pads, and terms a few times that: 2^124.
pub const LEAST_DIR: f32 = (1.0 / (1u64 << 40) as f32) * (1.0 / (1u64 << 40) as f32);

/// Directions and origin of a ray in an object's space, and what every test derives from them.
#[derive(Clone, Copy, Debug)]
pub struct ObjectRay {
    /// Origin.
    pub origin: Vec3,
    /// Direction; `t` is in its units.
    pub dir: Vec3,
    /// Instant in [0, 1].
    pub time: f32,
    /// What slab tests are padded by.
    pub pad: f32,
    /// The ray in the identity frame.
    pub slab: SlabRay,
    smallest_dir: f32,
    /// What bows of frames are multiplied by.
    bow: f32,
}

impl ObjectRay {
    /// Prepares a ray against an object of `radius`. None for a ray that is not finite, has no
    /// direction, or is beyond the limits.
    #[inline]
    pub fn new(origin: Vec3, dir: Vec3, time: f32, radius: f32) -> Option<Self> {
        let pad = (origin.abs().max_element() + radius) * SLAB_PAD;
        Self::padded(origin, dir, time, pad)
    }

    /// Prepares a ray whose slab tests are padded by `pad`, no less than [`SLAB_PAD`] asks for, and by [`TINY_PAD`].
    #[inline]
    pub fn padded(origin: Vec3, dir: Vec3, time: f32, pad: f32) -> Option<Self> {
        let reach = origin.abs().max_element();
        let longest = dir.abs().max_element();
        let pad = pad + (longest + 1.0) * TINY_PAD;
        // Written so that NaN fails; NaN in one component may pass a maximum, so all are asked.
        let sound = reach < crate::bvh::COORDINATE_LIMIT
            && DIR_RANGE.contains(&longest)
            && longest >= pad * LEAST_DIR
            && origin.is_finite()
            && dir.is_finite();
        if !sound {
            return None;
        }
        let smallest_dir = longest * U;
        Some(Self {
            origin,
            dir,
            time,
            pad,
            slab: slab_ray(origin, dir, time, pad, smallest_dir),
            smallest_dir,
            bow: PARABOLA.at(time),
        })
    }

    /// The same for a tree whose frames bow as `bowing` says; without it, as is right for two keys.
    #[inline(always)]
    #[must_use]
    pub fn bowing(self, bowing: &Bowing) -> Self {
        let bow = bowing.at(self.time);
        Self { bow, ..self }
    }

    /// The ray turned into a node's frame.
    #[inline(always)]
    pub fn turned<T: Turning>(&self, frame: &T) -> SlabRay {
        let mut at = frame.start();
        let time = self.time;
        let (mut bow, mut pad) = (Vec3::ZERO, self.pad);
        if T::TURNS {
            let turn = frame.turn();
            at.axes[2] += turn.step() * time;
            bow = turn.bow * self.bow;
            pad *= TURN_PADS;
        }
        let origin = at.turn(self.origin) + bow;
        slab_ray(origin, at.turn(self.dir), time, pad, self.smallest_dir)
    }
}

#[inline(always)]
fn slab_ray(origin: Vec3, dir: Vec3, time: f32, pad: f32, smallest_dir: f32) -> SlabRay {
    let mut ray = SlabRay {
        to_start: [0.0; 3],
        to_end: [0.0; 3],
        base: [[0.0; 3]; 2],
        near_side: [0; 3],
    };
    for a in 0..3 {
        let d = if dir[a].abs() < smallest_dir {
            smallest_dir.copysign(dir[a])
        } else {
            dir[a]
        };
        let inverse = 1.0 / d;
        ray.to_start[a] = (1.0 - time) * inverse;
        ray.to_end[a] = time * inverse;
        ray.base[0][a] = (origin[a] + pad) * -inverse;
        ray.base[1][a] = (origin[a] - pad) * -inverse;
        ray.near_side[a] = usize::from(d < 0.0);
    }
    ray
}
