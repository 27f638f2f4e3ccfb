//! Diagonals of boxes: a part of a strand runs from corner to corner of its box, and is thin. Most rays that meet such a box
//! pass the strand by; so a ray that meets it must also pass near the diagonal, within the *radius* of the part, before any
//! vertex is asked for.
//!
//! **The claim.** At both ends of the shutter the part runs from one corner of the box as it was bounded to the opposite one, not
//! always the same. Let `a(T)` and `b(T)` go linearly from those at the start to those at the end. Then every vertex `P` of the
//! part has a number `s` from 0 to 1, the same at all keys, so that `P(T) - a(T) - s (b(T) - a(T))` is no larger than the
//! radius on any axis, at every key; it is linear in time between two keys, so it is so at all times. Micropolygons are
//! triangles of such vertices, so each of their points is as near to a point of the line. Any corners will do: if they are
//! badly chosen the radius is large, and nothing is gained.
//!
//! **As stored.** A stored plane ([`super::node`]) is outward of the bound it stands for by at most [`STEP`] steps of its
//! node's grid. So the stored corners move points of the line by no more than that, on each axis.
//!
//! **The test.** Along each axis let `u` be the distance along the ray to a coordinate, `(x - o) / d`: the ray is
//! `(t, t, t)` there, and a slab test gives the corners. With `A` and `B` for those, `E = B - A` and `n = (1, 1, 1) x E`, both
//! the ray's direction and the line's are at right angles to `n`. A point of the ray that differs from one of the line by up to
//! `reach_i` along each axis therefore has `|A.n| <= reach_x |n_x| + reach_y |n_y| + reach_z |n_z|`: what is beyond is passed by.
//!
//! **Rounding**, in the units and the words of [`crate::trace::object_ray`], along an axis and divided by its direction:
//!
//! - an accepted hit and the line, with slabs as they are computed, differ by the radius, the steps, and 76.5 (there, the sum of
//!   all that a slab test may be off by); and by the pad that near and far planes are moved by, 80;
//! - the radius, as it is computed, is short by: the extents of boxes are rounded once, of up to 2 R, their product with `s`
//!   again, and both sums, of 2 R and 4 R; corners at a key between the ends are off by 5 R more: 15 R, on the axes of a frame
//!   26. Vertices, turned into a frame by three products, by 5.2;
//! - what planes are at the end of the shutter is found as a difference from what they are at its start, and added again: two
//!   roundings of up to 1.74 S each at both ends of the line, 7;
//! - `E` by one rounding, which is as if a corner were, 3.5. Each component of `n` is off by one rounding of itself, its product with
//!   `A`'s, which is at most 1.74 S, by another, and both sums by one each: 7.
//!
//! The sum is 205.2. [`PADS`] of what padding has near and far planes apart by are 240, less `1.5 * 4 * 1.74`, since that is a
//! difference of two that are rounded twice each: 229.5. What is left is room for terms of order `U^2`. In a frame that
//! turns there are no diagonals. Products below f32's normal numbers are off by up to 2^-150; those of coordinates are within what
//! [`crate::trace::object_ray::TINY_PAD`] has to spare, and for the others there is [`TINY`]. Where one is beyond f32's
//! largest number, the sum is infinite or NaN, and the ray is taken to be near.

use std::fmt::Debug;
use std::marker::PhantomData;

use glam::Vec3;
use hdtrapeze_simd::{Float, Kernel, Level, Mask, Simd};

use super::node::{Bounds8, Lattice8};

/// Stored planes are no farther out, in steps: a whole one, and what numbers of planes are moved by before they are rounded.
pub const STEP: f32 = 1.0 + 1.0 / (1 << 9) as f32;

/// What padding has near and far planes apart by is taken this many times on top of the radius; derived in the module's text.
pub const PADS: f32 = 1.5;

/// What is allowed besides; see the module's text.
pub const TINY: f32 = f32::MIN_POSITIVE;

/// Radii of a node are whole numbers of this part of the sum of its steps.
const UNIT: f32 = 1.0 / 8.0;

/// The bits of a node that say which children it has; those above are of its [`Diagonals`].
pub const CHILDREN: u32 = 0xff;

/// Bits of a number that say along which axes a diagonal goes down.
const DOWN: u32 = 7;

/// The diagonal of a box that a part of a strand is near to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diagonal {
    /// Vertices are no farther from it along any axis.
    pub radius: f32,
    /// At both ends of the shutter: bit `a` is set where it goes down along axis `a`. Never along x at the start.
    pub down: [u32; 2],
}

impl Diagonal {
    /// None: nothing is said of what is in the box. The radius is beyond all others, but a few of it are still a number.
    pub const NONE: Diagonal = Diagonal {
        radius: f32::from_bits(0x7e00_0000),
        down: [0; 2],
    };

    /// The same in two numbers, one for each end: the radius, rounded up, whose last bits say where the diagonal goes down.
    pub fn to_numbers(self) -> [f32; 2] {
        // Written so that NaN is refused.
        let Self { radius, down } = if self.radius <= Self::NONE.radius {
            self
        } else {
            Self::NONE
        };
        let up = (radius.to_bits() + DOWN) & !DOWN;
        down.map(|down| f32::from_bits(up | down & DOWN))
    }

    /// Where the diagonal that a number is of goes in a box of these extents; zero where there is none.
    #[inline(always)]
    pub fn way(number: f32, extents: Vec3) -> Vec3 {
        if number >= Self::NONE.radius {
            return Vec3::ZERO;
        }
        let signed = |x: f32, axis: u32| {
            let down = number.to_bits() >> axis & 1;
            f32::from_bits(x.to_bits() ^ down << 31)
        };
        let [x, y, z] = extents.to_array();
        Vec3::new(signed(x, 0), signed(y, 1), signed(z, 2))
    }
}

/// The diagonals of a node's children that are items.
#[derive(Clone, Copy, Debug)]
pub struct Diagonals {
    /// For both ends of the shutter and each axis, the children whose diagonals go down along it.
    pub down: [[u32; 3]; 2],
    /// The largest radius of all.
    pub radius: f32,
}

/// Where diagonals go at the end of the shutter: nothing, where that is as at the start.
pub trait AtEnd: Copy + Debug + Send + Sync + 'static {
    /// The children whose diagonals go down along each axis.
    fn new(down: [u32; 3]) -> Self;
    /// The same again, given those at the start.
    fn down(self, start: [u32; 3]) -> [u32; 3];
}

impl AtEnd for () {
    fn new(_: [u32; 3]) {}
    #[inline(always)]
    fn down(self, start: [u32; 3]) -> [u32; 3] {
        start
    }
}

impl AtEnd for u32 {
    fn new([x, y, z]: [u32; 3]) -> u32 {
        x | y << 8 | z << 16
    }
    #[inline(always)]
    fn down(self, _: [u32; 3]) -> [u32; 3] {
        [self & 0xff, self >> 8 & 0xff, self >> 16 & 0xff]
    }
}

/// What radii are whole numbers of, in a node with these grids at both ends.
#[inline(always)]
fn unit(start: &Lattice8, end: &Lattice8) -> f32 {
    let sum = |steps: [f32; 3]| steps[0] + steps[1] + steps[2];
    (sum(start.step()) + sum(end.step())) * UNIT
}

/// What a node holds of its children's diagonals: bits above [`CHILDREN`], and those at the end. `numbers` are
/// [those](Diagonal::to_numbers) of children that are items, and 0 for others. None where an item has no diagonal, or a radius
/// is so large that nothing is gained.
pub fn packed<E: AtEnd>(
    level: Level,
    grids: (&Lattice8, &Lattice8),
    numbers: &[[f32; 8]; 2],
) -> (u32, E) {
    level.run(Pack {
        grids,
        numbers,
        kind: PhantomData,
    })
}

struct Pack<'a, E> {
    grids: (&'a Lattice8, &'a Lattice8),
    numbers: &'a [[f32; 8]; 2],
    kind: PhantomData<E>,
}

impl<E: AtEnd> Kernel for Pack<'_, E> {
    type Output = (u32, E);
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> (u32, E) {
        let (start, end) = self.grids;
        let radius = simd.from8(&self.numbers[0]).most();
        // An axis that is nearly flat has planes farther apart than a step.
        let mut flat = false;
        for axis in 0..3 {
            for step in [start.step()[axis], end.step()[axis]] {
                flat |= step > 0.0 && !(1.0 / step).is_finite();
            }
        }
        // Rounded up twice, for the quotient and for the product that comes of it.
        let code = (radius / unit(start, end)).next_up().next_up().ceil();
        // Written so that NaN is refused. There may be no item.
        let sound = radius > 0.0 && (1.0..=255.0).contains(&code);
        if flat || !sound {
            return (0, E::new([0; 3]));
        }
        let mut down = [[0; 3]; 2];
        for (down, numbers) in down.iter_mut().zip(self.numbers) {
            for (axis, down) in down.iter_mut().enumerate() {
                let mut words = [0; 8];
                for (word, number) in words.iter_mut().zip(numbers) {
                    *word = number.to_bits() << (31 - axis);
                }
                *down = simd.high_bits(&words);
            }
        }
        let [at_start, at_end] = down;
        (
            (code as u32) << 8 | at_start[1] << 16 | at_start[2] << 24,
            E::new(at_end),
        )
    }
}

impl Diagonals {
    /// Of a node that has some; see [`packed`].
    #[inline(always)]
    pub fn of<E: AtEnd>(slots: u32, at_end: E, start: &Lattice8, end: &Lattice8) -> Self {
        let code = (slots >> 8 & 0xff) as f32;
        let down = [0, slots >> 16 & 0xff, slots >> 24];
        Self {
            down: [down, at_end.down(down)],
            radius: code * unit(start, end),
        }
    }
}

/// A diagonal along one axis, in distances along rays: where it begins, and how far it goes. First the near and the far plane are
/// given, or with `MOVING` what the start of the shutter has in them; then what its end adds, which is not looked at otherwise.
/// `down` has the diagonals that begin at the far plane, at both ends.
#[inline(always)]
fn segment<const N: usize, F: Float<N>, const MOVING: bool>(
    [near, far]: [F; 2],
    [near1, far1]: [F; 2],
    down: [F::Mask; 2],
) -> (F, F) {
    let mut a = far.or(down[0], near);
    let mut b = near.or(down[0], far);
    if MOVING {
        a = a + far1.or(down[1], near1);
        b = b + near1.or(down[1], far1);
    }
    (a, b - a)
}

/// Where a ray meets the near and the far planes of 8 children, by axis.
pub type Planes8<F> = [[F; 2]; 3];

/// Children of 8 whose diagonals a ray passes by. `turned` are [`CHILDREN`] on axes along which it sees diagonals the other way, else none:
/// where it goes down along one of x and this axis. `reach` is what ray and diagonal may be apart by on each axis; see [`reaching`]. The second
/// planes are what the start of the shutter has in the first; they are not looked at where nothing moves.
#[inline(always)]
pub fn passed_by<S: Simd, B: Bounds8>(
    simd: S,
    diagonals: &Diagonals,
    turned: [u32; 3],
    reach: [S::F8; 3],
    (planes, planes_at_start): (&Planes8<S::F8>, &Planes8<S::F8>),
) -> u32 {
    let zero = simd.all8(0.0);
    let (mut a, mut e) = ([zero; 3], [zero; 3]);
    for axis in 0..3 {
        let [near, far] = planes[axis];
        let [at_start, at_end] = &diagonals.down;
        let turned = turned[axis];
        let down = [
            simd.mask8(at_start[axis] ^ turned),
            simd.mask8(at_end[axis] ^ turned),
        ];
        (a[axis], e[axis]) = if B::MOVING {
            let first = planes_at_start[axis];
            let rest = [near - first[0], far - first[1]];
            segment::<8, S::F8, true>(first, rest, down)
        } else if axis > 0 {
            segment::<8, S::F8, false>([near, far], [near, far], down)
        } else {
            (near, far - near)
        };
    }
    let limits = [simd.all8(TINY), simd.all8(f32::INFINITY)];
    passes_by(a, e, reach, limits).bits()
}

/// What a step of a grid and a radius may have a ray and a diagonal apart by, besides `others`, which begin with [`PADS`] of what padding has
/// near and far planes apart by. `most` is [`STEP`], and `scale` the magnitude of what planes are multiplied by.
#[inline(always)]
pub fn reaching<const N: usize, F: Float<N>>(
    (step, most, radius): (F, F, F),
    scale: F,
    others: F,
) -> F {
    step.mul_add(most, radius).mul_add(scale, others)
}

/// True where a ray passes a line by: `a` is a point of it, `e` its direction, both in distances along the ray, and `reach` what
/// they may differ by, on each axis. `tiny` is [`TINY`].
#[inline(always)]
fn passes_by<const N: usize, F: Float<N>>(
    a: [F; 3],
    e: [F; 3],
    reach: [F; 3],
    [tiny, infinity]: [F; 2],
) -> F::Mask {
    let n = [e[2] - e[1], e[0] - e[2], e[1] - e[0]];
    let apart = a[2].mul_add(n[2], a[1].mul_add(n[1], a[0] * n[0])).abs();
    let near = n[0].abs().mul_add(reach[0], tiny);
    let near = n[1].abs().mul_add(reach[1], near);
    let near = n[2].abs().mul_add(reach[2], near);
    near.lt(apart) & apart.lt(infinity)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn of_steps([x, y, z]: [f32; 3]) -> Lattice8 {
        Lattice8 {
            grid: [0.0, 0.0, 0.0, x, y, z],
            planes: [[[0; 8]; 2]; 3],
        }
    }

    proptest! {
        #[test]
        fn nodes_hold_the_diagonals_of_their_items(
            radii in prop::array::uniform8(0.0f32..1.0), down in prop::array::uniform8(0u32..32), items in 1u32..256,
            step in prop::array::uniform3(0.004f32..0.5), size in -100i32..50
        ) {
            let size = (size as f32).exp2();
            let grid = of_steps(step.map(|step| step * size));
            let item = |slot: usize| Diagonal { radius: radii[slot] * size, down: [down[slot] << 1 & 6, down[slot] >> 2] };
            let mut numbers = [[0.0; 8]; 2];
            let slots = (0..8).filter(|slot| items >> slot & 1 == 1);
            for slot in slots.clone() {
                [numbers[0][slot], numbers[1][slot]] = item(slot).to_numbers();
            }
            let (bits, at_end): (u32, u32) = packed(Level::best(), (&grid, &grid), &numbers);
            prop_assert_eq!(bits & CHILDREN, 0);
            if bits == 0 {
                // So large, in whole numbers of 2/8 of all steps, that it cannot be stored.
                let sum: f32 = grid.step().iter().sum();
                prop_assert!(slots.clone().any(|slot| item(slot).radius > 63.0 * sum));
                return Ok(());
            }
            let found = Diagonals::of(bits, at_end, &grid, &grid);
            for slot in slots {
                let Diagonal { radius, down } = item(slot);
                prop_assert!(found.radius >= radius);
                for (found, own) in found.down.iter().zip(down) {
                    for (axis, found) in found.iter().enumerate() {
                        prop_assert_eq!(found >> slot & 1, own >> axis & 1);
                    }
                }
            }
        }
    }

    #[test]
    fn nothing_is_said_where_an_item_has_none() {
        let grid = of_steps([1.0; 3]);
        let thin = Diagonal {
            radius: 1.0,
            ..Diagonal::NONE
        };
        let bits = |items: &[Diagonal], grid: &Lattice8| {
            let mut numbers = [[0.0; 8]; 2];
            for (slot, item) in items.iter().enumerate() {
                [numbers[0][slot], numbers[1][slot]] = item.to_numbers();
            }
            packed::<()>(Level::best(), (grid, grid), &numbers).0
        };
        assert_ne!(bits(&[thin, thin], &grid), 0);
        assert_eq!(bits(&[thin, Diagonal::NONE], &grid), 0);
        let bad = |radius: f32| Diagonal { radius, ..thin };
        assert_eq!(bits(&[thin, bad(f32::NAN)], &grid), 0);
        assert_eq!(bits(&[thin, bad(f32::INFINITY)], &grid), 0);
        // No item at all; and planes that are farther apart than their step.
        assert_eq!(bits(&[], &grid), 0);
        let flat = of_steps([1.0, 1.0, f32::from_bits(3)]);
        assert_eq!(bits(&[thin, thin], &flat), 0);
    }

    #[test]
    fn rays_pass_by_what_they_do() {
        // The line from (1, 1, 1) on along x and y, as a ray along (1, 1, 1) sees it.
        let lanes = |x: f32| hdtrapeze_simd::Scalar.all8(x);
        let passes = |height: f32, reach: f32| {
            let a = [1.0, 1.0, 1.0 + height].map(lanes);
            let limits = [TINY, f32::INFINITY].map(lanes);
            let (e, reach) = ([1.0, 2.0, 0.0].map(lanes), [reach; 3].map(lanes));
            passes_by(a, e, reach, limits).bits() == 0xff
        };
        assert!(!passes(0.0, 0.0));
        assert!(passes(0.5, 0.1) && passes(-0.5, 0.1));
        // n is (-2, 1, 1): a cube around the line of half the height is reached at a quarter of it.
        assert!(!passes(0.5, 0.126) && passes(0.5, 0.124));
        assert!(!passes(f32::INFINITY, 1.0) && !passes(f32::NAN, 1.0));
        assert!(!passes(1e38, f32::INFINITY));
    }
}
