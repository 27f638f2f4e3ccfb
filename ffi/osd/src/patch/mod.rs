//! Lattice evaluation of one face's patches, on this side of the bridge.
//!
//! Data are *lanes*: four floats side by side, one lane a position key (the fourth float is padding),
//! or four components of a channel. Weights are computed once a sample and serve all lanes.
//!
//! Invariant: a sample's bits depend on its place, the patch points and nothing else: not on the
//! samples before it, nor on whether derivatives are asked for. Derivatives are up to a positive factor
//! that is the same for both.

pub(crate) mod bspline;
pub(crate) mod gregory;
pub(crate) mod tree;
pub(crate) mod triangle;

use std::sync::Arc;

use glam::{Vec2, Vec4};
use hdtrapeze_core::surface::PatchDomain;

use crate::domain::Parameterization;
use tree::{Leaf, Tree};

/// What kind of patch a face is.
#[derive(Clone, Default)]
pub(crate) enum Shape {
    /// Not evaluated here: the library does.
    #[default]
    Library,
    /// One bicubic B-spline patch, with the sides in the mask as boundaries.
    BSpline(u8),
    /// One quartic triangle.
    Triangle(Arc<triangle::Conversion>),
    /// A tree of patches.
    Tree(Arc<Tree>),
    /// Linear between this many corners: a bilinear quad, a flat triangle of the Loop scheme, or
    /// bilinear sub-faces around the centre.
    Linear(u32),
}

/// A leaf that was not used since the face was bound.
const UNUSED: u32 = u32::MAX;

/// One patch in use: its kind, and where its first lane lies in [`Pools`].
#[derive(Clone, Copy)]
enum Prepared {
    BSpline {
        first: usize,
        /// Bits of the `v` that the row sums are for, and whether they have derivatives.
        row: Option<(u32, bool)>,
    },
    Gregory(usize),
    Triangle(usize),
    Bilinear(usize),
    Flat(usize),
}

/// Control points of the patches in use, lane after lane; kept from face to face.
#[derive(Default)]
struct Pools {
    bspline: Vec<[Vec4; bspline::CONTROLS]>,
    rows: Vec<[Vec4; bspline::ROW]>,
    gregory: Vec<[Vec4; gregory::CONTROLS]>,
    triangle: Vec<[Vec4; triangle::BEZIER]>,
    bilinear: Vec<[Vec4; 4]>,
    /// The middle of a linear face's corners.
    centre: Vec<Vec4>,
    flat: Vec<[Vec4; 3]>,
}

impl Pools {
    fn clear(&mut self) {
        self.bspline.clear();
        self.rows.clear();
        self.gregory.clear();
        self.triangle.clear();
        self.bilinear.clear();
        self.centre.clear();
        self.flat.clear();
    }
}

/// The patches of a bound face.
#[derive(Default)]
pub(crate) struct Patches {
    shape: Shape,
    lanes: usize,
    /// Number in `prepared` of each leaf, or [`UNUSED`].
    leaf_slots: Vec<u32>,
    prepared: Vec<Prepared>,
    pools: Pools,
}

/// One lane at one sample.
pub(crate) struct LaneSample {
    pub(crate) position: Vec4,
    pub(crate) du: Vec4,
    pub(crate) dv: Vec4,
}

/// A patch point of one lane; `points` are `lanes * 4` floats each.
#[inline(always)]
fn point(points: &[f32], lanes: usize, lane: usize, i: usize) -> Vec4 {
    Vec4::from_slice(&points[(i * lanes + lane) * 4..])
}

impl Patches {
    /// Starts a face of this shape with this many lanes.
    pub(crate) fn reset(&mut self, shape: Shape, lanes: usize) {
        self.leaf_slots.clear();
        let leaves = match &shape {
            Shape::Tree(tree) => tree.leaves.len(),
            // One a sub-face.
            Shape::Linear(corners) => *corners as usize,
            _ => 1,
        };
        self.leaf_slots.resize(leaves, UNUSED);
        self.shape = shape;
        self.lanes = lanes;
        self.prepared.clear();
        self.pools.clear();
    }

    /// Evaluates every lane at every `st`; `points` are the patch points of the bound face. Calls
    /// `sink(sample, lane, values)`; derivatives are zero where they are not asked for.
    pub(crate) fn evaluate(
        &mut self,
        points: &[f32],
        parameterization: Parameterization,
        domain: PatchDomain,
        st: &[Vec2],
        derivatives: bool,
        mut sink: impl FnMut(usize, usize, LaneSample),
    ) {
        for (i, &st) in st.iter().enumerate() {
            let (sub_face, at) = parameterization.locate(domain, st);
            let (leaf, u, v) = match &self.shape {
                Shape::Tree(tree) => tree.locate(sub_face, at.x, at.y),
                Shape::Linear(_) => (sub_face, at.x, at.y),
                _ => (0, at.x, at.y),
            };
            let slot = match self.leaf_slots[leaf as usize] {
                UNUSED => self.prepare(points, parameterization, leaf),
                slot => slot,
            };
            let (lanes, pools) = (self.lanes, &mut self.pools);
            match &mut self.prepared[slot as usize] {
                Prepared::BSpline { first, row } => {
                    let rows = &mut pools.rows[*first..*first + lanes];
                    let bits = v.to_bits();
                    if !row.is_some_and(|(b, d)| b == bits && (d || !derivatives)) {
                        let controls = &pools.bspline[*first..*first + lanes];
                        for (p, sums) in controls.iter().zip(rows.iter_mut()) {
                            bspline::sum_columns(p, v, derivatives, sums);
                        }
                        *row = Some((bits, derivatives));
                    }
                    let b = bspline::basis(u);
                    let d = bspline::derivative(u);
                    for (lane, r) in rows.iter().enumerate() {
                        let position = bspline::combine(b, r[0], r[1], r[2], r[3]);
                        let (du, dv) = if derivatives {
                            (
                                bspline::combine(d, r[0], r[1], r[2], r[3]),
                                bspline::combine(b, r[4], r[5], r[6], r[7]),
                            )
                        } else {
                            (Vec4::ZERO, Vec4::ZERO)
                        };
                        sink(i, lane, LaneSample { position, du, dv });
                    }
                }
                &mut Prepared::Gregory(first) => {
                    let place = gregory::Place::new(u, v);
                    for (lane, p) in pools.gregory[first..first + lanes].iter().enumerate() {
                        let [position, du, dv] = place.evaluate(p, derivatives);
                        sink(i, lane, LaneSample { position, du, dv });
                    }
                }
                &mut Prepared::Triangle(first) => {
                    let cubics = triangle::cubics(u, v);
                    for (lane, b) in pools.triangle[first..first + lanes].iter().enumerate() {
                        let [position, du, dv] = triangle::evaluate(b, &cubics, u, v);
                        sink(i, lane, LaneSample { position, du, dv });
                    }
                }
                &mut Prepared::Bilinear(first) => {
                    let corners = &pools.bilinear[first..first + lanes];
                    for (lane, &[a, b, c, d]) in corners.iter().enumerate() {
                        let (low, high) = (a + (b - a) * u, d + (c - d) * u);
                        let sample = LaneSample {
                            position: low * (1.0 - v) + high * v,
                            du: (b - a) * (1.0 - v) + (c - d) * v,
                            dv: high - low,
                        };
                        sink(i, lane, sample);
                    }
                }
                &mut Prepared::Flat(first) => {
                    let corners = &pools.flat[first..first + lanes];
                    for (lane, &[a, b, c]) in corners.iter().enumerate() {
                        let sample = LaneSample {
                            position: a * (1.0 - u - v) + b * u + c * v,
                            du: b - a,
                            dv: c - a,
                        };
                        sink(i, lane, sample);
                    }
                }
            }
        }
    }

    /// Calls `sink(lane, point)` with points whose hull contains all of the face; as many for each lane, in
    /// the same order.
    pub(crate) fn hull(
        &mut self,
        points: &[f32],
        parameterization: Parameterization,
        mut sink: impl FnMut(usize, Vec4),
    ) {
        for leaf in 0..self.leaf_slots.len() as u32 {
            let slot = match self.leaf_slots[leaf as usize] {
                UNUSED => self.prepare(points, parameterization, leaf),
                slot => slot,
            };
            let pools = &self.pools;
            for lane in 0..self.lanes {
                let mut all = |points: &[Vec4]| points.iter().for_each(|&p| sink(lane, p));
                match self.prepared[slot as usize] {
                    Prepared::BSpline { first, .. } => {
                        all(&bspline::bezier(&pools.bspline[first + lane]));
                    }
                    Prepared::Gregory(first) => all(&pools.gregory[first + lane]),
                    Prepared::Triangle(first) => all(&pools.triangle[first + lane]),
                    Prepared::Bilinear(first) => all(&pools.bilinear[first + lane]),
                    Prepared::Flat(first) => all(&pools.flat[first + lane]),
                }
            }
        }
    }

    /// Gathers the control points of a leaf; gives its slot.
    fn prepare(&mut self, points: &[f32], parameterization: Parameterization, leaf: u32) -> u32 {
        let (lanes, pools) = (0..self.lanes, &mut self.pools);
        let at = |lane: usize, i: usize| point(points, self.lanes, lane, i);
        let mut bspline = |pick: &dyn Fn(usize) -> usize, mask: u8| {
            let first = pools.bspline.len();
            for lane in lanes.clone() {
                let mut p = std::array::from_fn(|i| at(lane, pick(i)));
                bspline::extrapolate(&mut p, mask);
                pools.bspline.push(p);
                pools.rows.push([Vec4::ZERO; bspline::ROW]);
            }
            Prepared::BSpline { first, row: None }
        };
        let prepared = match &self.shape {
            Shape::BSpline(mask) => bspline(&|i| i, *mask),
            // The library's faces never come here; an empty patch would do.
            Shape::Library => bspline(&|_| 0, 0),
            Shape::Triangle(conversion) => {
                let bezier = lanes.map(|lane| {
                    triangle::convert(conversion, &std::array::from_fn(|i| at(lane, i)))
                });
                let first = pools.triangle.len();
                pools.triangle.extend(bezier);
                Prepared::Triangle(first)
            }
            Shape::Linear(corners) => {
                let (n, i) = (*corners as usize, leaf as usize);
                let at = |lane: usize, i: usize| at(lane, i % n);
                if parameterization == Parameterization::Triangle {
                    let first = pools.flat.len();
                    let corners = lanes.map(|lane| std::array::from_fn(|i| at(lane, i)));
                    pools.flat.extend(corners);
                    Prepared::Flat(first)
                } else {
                    let first = pools.bilinear.len();
                    let is_quad = parameterization == Parameterization::Quad;
                    if !is_quad && pools.centre.is_empty() {
                        let middle = |lane| (0..n).map(|j| at(lane, j)).sum::<Vec4>() / n as f32;
                        pools.centre.extend(lanes.clone().map(middle));
                    }
                    let centres = &pools.centre;
                    pools.bilinear.extend(lanes.map(|lane| {
                        if is_quad {
                            return std::array::from_fn(|i| at(lane, i));
                        }
                        let corner = at(lane, i);
                        let centre = centres[lane];
                        let next = 0.5 * (corner + at(lane, i + 1));
                        let previous = 0.5 * (corner + at(lane, i + n - 1));
                        [corner, next, centre, previous]
                    }));
                    Prepared::Bilinear(first)
                }
            }
            Shape::Tree(tree) => match &tree.leaves[leaf as usize] {
                Leaf::BSpline { points, mask } => bspline(&|i| points[i] as usize, *mask),
                Leaf::Gregory { points } => {
                    let first = pools.gregory.len();
                    let controls = lanes.map(|lane| points.map(|i| at(lane, i as usize)));
                    pools.gregory.extend(controls);
                    Prepared::Gregory(first)
                }
            },
        };
        let slot = self.prepared.len() as u32;
        self.prepared.push(prepared);
        self.leaf_slots[leaf as usize] = slot;
        slot
    }
}
