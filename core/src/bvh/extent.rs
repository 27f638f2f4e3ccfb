//! What items extend over, and their centres: what splits are chosen by.

use hdtrapeze_simd::{Float, Kernel, Level, Scalar, Simd};
use rayon::prelude::*;

use super::build::PARALLEL_ITEMS;
use super::sorted::{Hull, Sorted};

/// What items extend over.
#[derive(Clone, Copy)]
pub struct Extent<H> {
    /// The box around theirs.
    pub bounds: H,
    /// The box around its centres: the least in each lane of [`Hull::centre4`].
    centres: [f32; 8],
}

impl<H: Hull> Extent<H> {
    /// Of nothing.
    pub const EMPTY: Self = Self {
        bounds: H::EMPTY,
        centres: [f32::INFINITY; 8],
    };

    /// Of boxes, and [centres](Piece::centres), joined.
    #[inline(always)]
    pub fn around<S: Simd>(bounds: H::In<S>, centres: S::F8) -> Self {
        Self {
            bounds: H::store::<S>(bounds),
            centres: centres.to_array(),
        }
    }

    /// As [`Piece::centres`].
    #[inline(always)]
    pub fn centres<S: Simd>(&self, simd: S) -> S::F8 {
        simd.from8(&self.centres)
    }

    /// The least of centres along an axis.
    pub fn first(&self, axis: usize) -> f32 {
        self.centres[axis]
    }

    /// How far centres go along each axis.
    pub fn spans(&self) -> [f32; 3] {
        let c = &self.centres;
        [-c[4] - c[0], -c[5] - c[1], -c[6] - c[2]]
    }

    /// Of what is in a box, and not split.
    pub fn unsplit(bounds: H) -> Self {
        Self {
            bounds,
            ..Self::EMPTY
        }
    }

    /// Of items, in parallel where there are many.
    pub fn of(level: Level, items: &[Sorted<H>]) -> Self {
        if items.len() <= PARALLEL_ITEMS {
            return level.run(Extend(items));
        }
        let chunks: Vec<&[Sorted<H>]> = items.chunks(PARALLEL_ITEMS).collect();
        Self::of_all(level, &chunks)
    }

    /// Of chunks of items, in parallel.
    pub fn of_all(level: Level, chunks: &[&[Sorted<H>]]) -> Self {
        let extents = chunks.par_iter().map(|items| level.run(Extend(items)));
        extents.reduce(|| Self::EMPTY, |a, b| a.union(&b))
    }

    fn union(&self, o: &Self) -> Self {
        let [a, b] = [self, o].map(|e| e.bounds.load(Scalar));
        let [c, d] = [self, o].map(|e| Scalar.from8(&e.centres));
        Self {
            bounds: H::store(H::union::<Scalar>(a, b)),
            centres: c.min(d).to_array(),
        }
    }
}

struct Extend<'a, H: Hull>(&'a [Sorted<H>]);

impl<H: Hull> Kernel for Extend<'_, H> {
    type Output = Extent<H>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Extent<H> {
        let mut bounds = H::EMPTY.load(simd);
        let mut centres = simd.all8(f32::INFINITY);
        for item in self.0 {
            let own = item.bounds.load(simd);
            bounds = H::union::<S>(own, bounds);
            centres = H::centre4(simd, own).min(centres);
        }
        Extent::around::<S>(bounds, centres)
    }
}

/// What is sorted into bins: an item, or several.
pub trait Piece<H: Hull>: Copy + Sync {
    /// The box around it.
    fn bounds(&self) -> &H;
    /// The least of [`Hull::centre4`], by lane, over its items.
    fn centres<S: Simd>(&self, simd: S) -> S::F8;
    /// What its bin is chosen by, like [`Hull::centre4`].
    fn place<S: Simd>(&self, simd: S) -> S::F8;
    /// Items.
    fn count(&self) -> u32;
}

impl<H: Hull> Piece<H> for Sorted<H> {
    #[inline(always)]
    fn bounds(&self) -> &H {
        &self.bounds
    }
    #[inline(always)]
    fn centres<S: Simd>(&self, simd: S) -> S::F8 {
        H::centre4(simd, self.bounds.load(simd))
    }
    #[inline(always)]
    fn place<S: Simd>(&self, simd: S) -> S::F8 {
        self.centres(simd)
    }
    #[inline(always)]
    fn count(&self) -> u32 {
        1
    }
}
