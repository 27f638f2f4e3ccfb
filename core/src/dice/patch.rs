//! Patches: dyadic rectangles of a face's unit-square domains, with the curves on their four sides.

use super::curve::ONE;
use crate::surface::PatchDomain;
use glam::Vec2;

/// Marks an edge number as one of the face's own curves rather than a base edge.
pub(super) const LOCAL: u32 = 1 << 31;

/// A patch's side: a range of an edge curve, walked along increasing s or t.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    /// Base edge, or [`LOCAL`] and the number of the face's own curve.
    pub edge: u32,
    /// Range of the edge's parameter, `a < b`.
    pub a: u32,
    pub b: u32,
    /// True where s or t increases as the edge's parameter falls.
    pub reversed: bool,
}

impl Side {
    /// All of an edge.
    pub fn whole(edge: u32, reversed: bool) -> Self {
        Self {
            edge,
            a: 0,
            b: ONE,
            reversed,
        }
    }

    /// A side that is the point at parameter `at` of an edge all along: the patch is collapsed there.
    pub fn point(edge: u32, at: u32) -> Self {
        Self {
            edge,
            a: at,
            b: at,
            reversed: false,
        }
    }

    /// From the corner where a base edge begins or ends to its middle: the side of a sub-face.
    /// `from_start`: the corner is at parameter 0.
    pub fn half(edge: u32, from_start: bool) -> Self {
        let (a, b) = if from_start {
            (0, ONE / 2)
        } else {
            (ONE / 2, ONE)
        };
        Self {
            edge,
            a,
            b,
            reversed: !from_start,
        }
    }

    /// Parameter in the middle.
    pub fn middle(&self) -> u32 {
        self.a + (self.b - self.a) / 2
    }

    /// The half before and the half after the middle, along s or t.
    pub fn split(&self) -> [Side; 2] {
        let m = self.middle();
        let low = Side { b: m, ..*self };
        let high = Side { a: m, ..*self };
        if self.reversed {
            [high, low]
        } else {
            [low, high]
        }
    }

    /// Numerator over `steps` of the parameter at lattice step `i` of `steps`.
    pub fn step(&self, i: u32, steps: u32) -> u32 {
        if self.reversed {
            self.b * steps - (self.b - self.a) * i
        } else {
            self.a * steps + (self.b - self.a) * i
        }
    }

    /// How far along the side a parameter (of [`ONE`]) lies: 0 to 1 inside, beyond outside.
    pub fn fraction(&self, parameter: f32) -> f32 {
        let length = (self.b - self.a) as f32;
        if self.reversed {
            (self.b as f32 - parameter) / length
        } else {
            (parameter - self.a as f32) / length
        }
    }
}

/// A rectangle of a domain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub domain: PatchDomain,
    /// Smallest and largest (s, t).
    pub low: Vec2,
    pub high: Vec2,
    /// Bisections still allowed along u (s) and v (t).
    pub depth: [u32; 2],
    /// Sides at smallest t, largest s, largest t, smallest s.
    pub sides: [Side; 4],
}

impl Patch {
    /// Cut across u (at the middle of s): `across` is the new curve, parameter 0 at the smaller t.
    pub fn split_u(&self, across: u32) -> [Patch; 2] {
        let s = 0.5 * (self.low.x + self.high.x);
        let (bottom, top) = (self.sides[0].split(), self.sides[2].split());
        let cut = Side::whole(across, false);
        let mut parts = [*self; 2];
        for (i, part) in parts.iter_mut().enumerate() {
            part.depth[0] -= 1;
            part.sides[0] = bottom[i];
            part.sides[2] = top[i];
            part.sides[if i == 0 { 1 } else { 3 }] = cut;
        }
        parts[0].high.x = s;
        parts[1].low.x = s;
        parts
    }

    /// Cut across v (at the middle of t): `across` is the new curve, parameter 0 at the smaller s.
    pub fn split_v(&self, across: u32) -> [Patch; 2] {
        let t = 0.5 * (self.low.y + self.high.y);
        let (right, left) = (self.sides[1].split(), self.sides[3].split());
        let cut = Side::whole(across, false);
        let mut parts = [*self; 2];
        for (i, part) in parts.iter_mut().enumerate() {
            part.depth[1] -= 1;
            part.sides[1] = right[i];
            part.sides[3] = left[i];
            part.sides[if i == 0 { 2 } else { 0 }] = cut;
        }
        parts[0].high.y = t;
        parts[1].low.y = t;
        parts
    }
}
