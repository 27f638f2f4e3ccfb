//! Where a curve lies on the surface: the face's edge or a line inside a patch domain.

use crate::surface::PatchDomain;
use glam::Vec2;

/// A curve over the bound face.
#[derive(Clone, Copy, Debug)]
pub(super) enum CurveSource {
    /// Edge `k` of a face with `corners` corners, `forward` where parameter 0 is at corner `k`.
    FaceEdge { corners: u32, k: u32, forward: bool },
    /// A straight line in a domain.
    Line {
        domain: PatchDomain,
        from: Vec2,
        to: Vec2,
    },
}

impl CurveSource {
    /// Domain and position in it at parameter `p` in [0, 1].
    pub fn place(&self, p: f32) -> (PatchDomain, Vec2) {
        match *self {
            Self::Line { domain, from, to } => {
                // Exact at both ends; lines run along s or t, so the other coordinate is exact.
                let at = |a: f32, b: f32| if a == b { a } else { a + (b - a) * p };
                (domain, Vec2::new(at(from.x, to.x), at(from.y, to.y)))
            }
            Self::FaceEdge {
                corners,
                k,
                forward,
            } => {
                let q = if forward { p } else { 1.0 - p };
                if corners == 4 {
                    let st = match k {
                        0 => Vec2::new(q, 0.0),
                        1 => Vec2::new(1.0, q),
                        2 => Vec2::new(1.0 - q, 1.0),
                        _ => Vec2::new(0.0, 1.0 - q),
                    };
                    (PatchDomain::Whole, st)
                } else if q <= 0.5 {
                    (PatchDomain::Corner(k), Vec2::new(2.0 * q, 0.0))
                } else {
                    let next = if k + 1 == corners { 0 } else { k + 1 };
                    (PatchDomain::Corner(next), Vec2::new(0.0, 2.0 - 2.0 * q))
                }
            }
        }
    }
}
