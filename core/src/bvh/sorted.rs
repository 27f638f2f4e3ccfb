//! Boxes as the build sorts them: vectors of 4 lanes, and the second bounds only where things move.

use glam::{Vec3, Vec3A};

use super::LinearBox;
use super::build::Item;

/// A box of one kind: what grows, and has an area.
pub trait Hull: Clone + Copy + Send + Sync {
    /// The box of nothing.
    const EMPTY: Self;
    /// The box; one that does not move contains both ends of one that does.
    fn of(bounds: &LinearBox) -> Self;
    /// The same as a linear box.
    fn linear(&self) -> LinearBox;
    /// As [`LinearBox::union`].
    fn union(&self, other: &Self) -> Self;
    /// As [`LinearBox::centre4`].
    fn centre4(&self) -> Vec3A;
    /// As [`LinearBox::mean_half_area`].
    fn area(&self) -> f32;
}

/// A box that does not move.
#[derive(Clone, Copy, Debug)]
pub struct StaticHull {
    lo: Vec3A,
    hi: Vec3A,
}

/// A box with bounds at both ends of the shutter.
#[derive(Clone, Copy, Debug)]
pub struct LinearHull {
    start: StaticHull,
    end: StaticHull,
}

impl Hull for StaticHull {
    const EMPTY: Self = Self {
        lo: Vec3A::INFINITY,
        hi: Vec3A::NEG_INFINITY,
    };
    fn of(b: &LinearBox) -> Self {
        Self {
            lo: b.lo0.min(b.lo1).into(),
            hi: b.hi0.max(b.hi1).into(),
        }
    }
    fn linear(&self) -> LinearBox {
        let (lo, hi) = (Vec3::from(self.lo), Vec3::from(self.hi));
        LinearBox {
            lo0: lo,
            hi0: hi,
            lo1: lo,
            hi1: hi,
        }
    }
    #[inline(always)]
    fn union(&self, other: &Self) -> Self {
        Self {
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
        }
    }
    #[inline(always)]
    fn centre4(&self) -> Vec3A {
        let sum = self.lo + self.hi;
        sum + sum
    }
    #[inline(always)]
    fn area(&self) -> f32 {
        let e = self.extent();
        products(e, e)
    }
}

impl StaticHull {
    #[inline(always)]
    fn extent(&self) -> Vec3A {
        (self.hi - self.lo).max(Vec3A::ZERO)
    }
}

/// `a.x b.y + a.y b.z + a.z b.x`.
#[inline(always)]
fn products(a: Vec3A, b: Vec3A) -> f32 {
    let p = a * Vec3A::new(b.y, b.z, b.x);
    p.x + p.y + p.z
}

impl Hull for LinearHull {
    const EMPTY: Self = Self {
        start: StaticHull::EMPTY,
        end: StaticHull::EMPTY,
    };
    fn of(b: &LinearBox) -> Self {
        let hull = |lo: Vec3, hi: Vec3| StaticHull {
            lo: lo.into(),
            hi: hi.into(),
        };
        Self {
            start: hull(b.lo0, b.hi0),
            end: hull(b.lo1, b.hi1),
        }
    }
    fn linear(&self) -> LinearBox {
        LinearBox {
            lo0: self.start.lo.into(),
            hi0: self.start.hi.into(),
            lo1: self.end.lo.into(),
            hi1: self.end.hi.into(),
        }
    }
    #[inline(always)]
    fn union(&self, other: &Self) -> Self {
        Self {
            start: self.start.union(&other.start),
            end: self.end.union(&other.end),
        }
    }
    #[inline(always)]
    fn centre4(&self) -> Vec3A {
        (self.start.lo + self.start.hi) + (self.end.lo + self.end.hi)
    }
    #[inline(always)]
    fn area(&self) -> f32 {
        // The mean of x y over time, as in `LinearBox::mean_half_area`, regrouped: with the sum s of both ends'
        // extents, it is (x0 y0 + x1 y1 + sx sy) / 6.
        let (e0, e1) = (self.start.extent(), self.end.extent());
        let s = e0 + e1;
        (products(e0, e0) + products(e1, e1) + products(s, s)) * (1.0 / 6.0)
    }
}

/// An item being sorted.
#[derive(Clone, Copy, Debug)]
pub struct Sorted<H> {
    /// Its box.
    pub bounds: H,
    /// Its number.
    pub id: u32,
    /// As [`Item::along`].
    pub along: Vec3,
}

impl<H: Hull> Sorted<H> {
    /// Of an item.
    pub fn of(item: &Item) -> Self {
        Self {
            bounds: H::of(&item.bounds),
            id: item.id,
            along: item.along,
        }
    }
}
