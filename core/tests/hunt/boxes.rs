//! Stored bounds against the vertices that they are to contain, in exact arithmetic.

use glam::Vec3;
use hdtrapeze_core::bvh::block::CellRect;
use hdtrapeze_core::bvh::bound::bound_groups;
use hdtrapeze_core::bvh::lanes::{Boxes8, EXCESS_ROUNDING, EXCESS_TINY};
use hdtrapeze_core::bvh::node::{Lattice8, pack};
use hdtrapeze_core::bvh::{
    Bounds8, Frame, LinearBox, LinearSlabs, ROTATION_PAD, ROTATION_TINY, StaticSlabs,
};
use hdtrapeze_core::grid::PlanarMesh;
use hdtrapeze_simd::{Kernel, Level, Simd};

use crate::climb::{Genes, climb};
use crate::exact::{Exact, dot};
use crate::trace_scenes::mesh;

pub const CELL: CellRect = CellRect {
    i: 0,
    j: 0,
    w: 1,
    h: 1,
};

pub fn vec3(genes: &mut Genes<'_>, from: i32, to: i32) -> Vec3 {
    Vec3::new(
        genes.float(from, to),
        genes.float(from, to),
        genes.float(from, to),
    )
}

/// The identity, or a rotation: near an axis, or any.
pub fn frame(genes: &mut Genes<'_>) -> Frame {
    let spread = genes.whole(-24, 0);
    let kind = genes.below(4);
    let mut edges = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis + vec3(genes, spread - 3, spread));
    edges.rotate_left(genes.below(3));
    match kind {
        0 => Frame::IDENTITY,
        _ => Frame::from_edges(edges[0], edges[1]).unwrap_or(Frame::IDENTITY),
    }
}

/// How much of the rotation's pad is used: all corners of a cell are one vertex, whose coordinates in the frame are
/// known exactly.
#[test]
fn bounds_of_rotated_vertices() {
    let found = climb(12_000, 16, 1, |genes| {
        // Down to where products underflow.
        let scale = genes.whole(-149, 58);
        let p = vec3(genes, (scale - 26).max(-149), scale);
        let frame = frame(genes);
        let planar = PlanarMesh::from(mesh(&[(1, 1)], &[0.0], |_, _, _, _| p));
        let groups = [(0, CELL, [Vec3::ZERO; 2])];
        let bounds = bound_groups(Level::best(), &planar, &groups, &frame).0[0];
        let size = f64::from(p.x.abs()) + f64::from(p.y.abs()) + f64::from(p.z.abs());
        let pad = f64::from(ROTATION_PAD) * size + f64::from(ROTATION_TINY);
        (0..3).fold(f64::NEG_INFINITY, |worst, a| {
            let at = dot(frame.axes[a].to_array(), p.to_array());
            let low = (at.clone() - Exact::from(bounds.lo0[a])).value();
            let high = (Exact::from(bounds.hi0[a]) - at).value();
            let used = 1.0 - low.min(high) / pad;
            if low.min(high) < 0.0 {
                worst.max(used).max(1.5)
            } else {
                worst.max(used.min(1.0))
            }
        })
    });
    found.check("vertices in a frame", 0.5);
}

/// The excess of an inner key over the chord: after raising, the exact chord contains it.
#[test]
fn chords_of_inner_keys() {
    let found = climb(20_000, 12, 2, |genes| {
        let scale = genes.whole(-149, 58);
        let range = ((scale - 80).max(-149), scale);
        let [b0, b1, value] = [0; 3].map(|_| genes.float(range.0, range.1));
        let b1 = if genes.below(4) == 0 { b0 } else { b1 };
        let time = genes.unit();
        // Lower and upper bounds on different axes do not mix.
        let splat = Vec3::splat;
        let mut b = LinearBox {
            lo0: splat(b0),
            hi0: splat(b0),
            lo1: splat(b1),
            hi1: splat(b1),
        };
        b.raise(time, splat(value), splat(value));
        let chord = |b0: f32, b1: f32| {
            let (b0, b1) = (Exact::from(b0), Exact::from(b1));
            b0.clone() + (b1 - b0) * Exact::from(time)
        };
        let below = (chord(b.lo0.x, b.lo1.x) - Exact::from(value)).value();
        let above = (Exact::from(value) - chord(b.hi0.x, b.hi1.x)).value();
        let size = f64::from(b0.abs().max(b1.abs()).max(value.abs()));
        // In units of f64's rounding.
        let used = below.max(above) / (size * 2f64.powi(-53));
        if below.max(above) > 0.0 {
            used.max(1.5)
        } else {
            1.0 + used.max(-1e6) * 1e-6
        }
    });
    // Bounds that touch are what is wanted.
    found.check("inner keys", 0.999);
}

/// A box raised at inner keys, in all lanes.
struct Raise<'a>(LinearBox, &'a [(f32, f32)]);

impl Kernel for Raise<'_> {
    type Output = LinearBox;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> LinearBox {
        let Raise(first, keys) = self;
        let mut boxes = Boxes8::of(simd, &[first]);
        for &(time, value) in keys {
            let value = Vec3::splat(value);
            let inner = Boxes8::of(
                simd,
                &[LinearBox {
                    lo0: value,
                    hi0: value,
                    lo1: value,
                    hi1: value,
                }],
            );
            boxes.raise(simd, time, &inner.start);
        }
        boxes.to_boxes()[7]
    }
}

/// The same of 8 boxes at once, for two keys: how much is used of what rounding may take.
#[test]
fn chords_of_inner_keys_in_lanes() {
    for (level, seed) in Level::available().into_iter().zip(70..) {
        let found = climb(20_000, 16, seed, |genes| {
            let scale = genes.whole(-149, 58);
            let range = ((scale - 40).max(-149), scale);
            let [b0, b1, first, second] = [0; 4].map(|_| genes.float(range.0, range.1));
            let b1 = if genes.below(4) == 0 { b0 } else { b1 };
            let keys = [(genes.unit(), first), (genes.unit(), second)];
            let b = LinearBox {
                lo0: Vec3::splat(b0),
                hi0: Vec3::splat(b0),
                lo1: Vec3::splat(b1),
                hi1: Vec3::splat(b1),
            };
            let chord = |b0: f32, b1: f32, time: f32| {
                let (b0, b1) = (Exact::from(b0), Exact::from(b1));
                b0.clone() + (b1 - b0) * Exact::from(time)
            };
            let mut worst = f64::NEG_INFINITY;
            for count in 1..=2 {
                let before = level.run(Raise(b, &keys[..count - 1]));
                let after = level.run(Raise(b, &keys[..count]));
                for (k, &(time, value)) in keys[..count].iter().enumerate() {
                    let side = |b: [f32; 2]| (Exact::from(value) - chord(b[0], b[1], time)).value();
                    let above = side([after.hi0.x, after.hi1.x]);
                    let below = -side([after.lo0.x, after.lo1.x]);
                    if above > 0.0 || below > 0.0 {
                        return 2.0;
                    }
                    let [h0, h1] = [before.hi0.x, before.hi1.x];
                    if k + 1 == count && h0 != h1 && side([h0, h1]) > 0.0 {
                        let all =
                            f64::from(h0.abs()) + f64::from(h1.abs()) + f64::from(value.abs());
                        let pad = f64::from(EXCESS_ROUNDING) * all + f64::from(EXCESS_TINY);
                        worst = worst.max(1.0 + above / pad);
                    }
                }
            }
            worst
        });
        found.check(&format!("inner keys in lanes, {}", level.name()), 0.2);
    }
}

/// Planes of 8 bits: lower ones are not above what they stand for, upper ones not below. How much of what numbers are
/// moved by ([`NUMBER_PAD`]) is used.
#[test]
fn quantized_planes() {
    /// As in `bvh::node`.
    const NUMBER_PAD: f64 = 1.0 / 1024.0;
    let found = climb(20_000, 32, 3, |genes| {
        let scale = genes.whole(-140, 58);
        let offset = genes.float(-149, 58);
        let count = 2 + genes.below(7);
        let boxes: Vec<LinearBox> = (0..count)
            .map(|_| {
                let (a, b) = (
                    genes.float((scale - 12).max(-149), scale),
                    genes.float((scale - 12).max(-149), scale),
                );
                let bounds = [a.min(b) + offset, a.max(b) + offset].map(Vec3::splat);
                LinearBox {
                    lo0: bounds[0],
                    hi0: bounds[1],
                    lo1: bounds[1] * -0.5,
                    hi1: bounds[1] * -0.5 + (bounds[1] - bounds[0]),
                }
            })
            .collect();
        let still: Vec<LinearBox> = boxes
            .iter()
            .map(|b| LinearBox {
                lo1: b.lo0,
                hi1: b.hi0,
                ..*b
            })
            .collect();
        let (linear, fixed) = (
            pack::<LinearSlabs>(Level::best(), &boxes),
            pack::<StaticSlabs>(Level::best(), &still),
        );
        let mut worst = f64::NEG_INFINITY;
        let mut see = |lattice: &Lattice8, slot: usize, lo: f32, hi: f32| {
            let step = f64::from(lattice.step()[0]);
            let plane = |side: usize| {
                let q = f64::from(lattice.planes[0][side][slot]);
                Exact::from(lattice.origin()[0]) + Exact::product(step, q)
            };
            let low = (Exact::from(lo) - plane(0)).value();
            let high = (plane(1) - Exact::from(hi)).value();
            if low.min(high) < 0.0 {
                worst = worst.max(2.0);
            }
            // The first and the last plane are exact, not padded.
            if step > 0.0 && (1.0 / lattice.step()[0]).is_finite() {
                let inner = [
                    (lattice.planes[0][0][slot] > 0, low),
                    (lattice.planes[0][1][slot] < 255, high),
                ];
                for (_, slack) in inner.into_iter().filter(|(inner, _)| *inner) {
                    worst = worst.max(1.0 - slack / (step * NUMBER_PAD));
                }
            }
        };
        for (slot, b) in boxes.iter().enumerate() {
            see(linear.start(), slot, b.lo0.x, b.hi0.x);
            see(linear.end(), slot, b.lo1.x, b.hi1.x);
            see(fixed.start(), slot, b.lo0.x, b.hi0.x);
        }
        worst
    });
    found.check("numbers of planes", 0.0001);
}
