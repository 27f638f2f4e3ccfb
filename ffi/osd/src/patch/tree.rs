//! [`Tree`]: how the limit surface of an irregular face is put together.
//!
//! OpenSubdiv represents an irregular face by a quadtree of B-spline and Gregory patches over shared
//! patch points, and caches it by topology; it gives no access to the tree. What it does give is the
//! weight of every patch point at any place, in double precision. Each kind of patch has weights that
//! are known in closed form, so the tree is found by comparing: a cell is a patch where the weights
//! that are not zero are the patch's own, in some order, and the order says which patch points are its
//! control points. Otherwise the cell is cut in four.
//!
//! Every patch found is checked at a second place; if anything does not fit, there is no tree and
//! the face is evaluated by the library, point by point.

use std::sync::LazyLock;

use glam::Vec4;

use super::{bspline, gregory};

/// Cells are cut no more than this: the library refines sharp features six times, after the cut of a
/// face in sub-faces.
const MAX_DEPTH: u32 = 8;

/// Two weights are the same within this: both are sums of a few products of f64 numbers below one.
const TOLERANCE: f64 = 1e-11;

/// Weights below this are zero.
const ZERO: f64 = 1e-14;

/// Where cells are probed: all weights of a patch differ there by more than the tolerance.
const PROBE: [f64; 2] = [0.3719, 0.5843];

/// Where patches are checked.
const CHECK: [f64; 2] = [0.8127, 0.2261];

/// A patch of the tree.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Leaf {
    /// Bicubic B-spline: patch points of the 4 by 4 grid (phantom points repeat another), and the
    /// sides without neighbours.
    BSpline { points: [u32; 16], mask: u8 },
    /// Gregory.
    Gregory { points: [u32; 20] },
}

/// A cell: a leaf, or the number of its four children (u low to high, then v).
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cell {
    Leaf(u32),
    Children(u32),
}

/// The patches of one irregular topology.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tree {
    roots: Vec<Cell>,
    nodes: Vec<[Cell; 4]>,
    pub(crate) leaves: Vec<Leaf>,
    /// Control points: the first patch points.
    controls: usize,
    /// Weights of the control points in the patch points that follow them, a row a point.
    stencils: Vec<f32>,
}

/// Weights of one kind of patch at [`PROBE`], ascending, with the control points they belong to.
struct Pattern {
    mask: u8,
    sorted: Vec<(f64, u8)>,
}

impl Pattern {
    fn new(weights: &[f64], mask: u8) -> Self {
        let mut sorted: Vec<(f64, u8)> = weights
            .iter()
            .enumerate()
            .filter(|(_, w)| w.abs() > ZERO)
            .map(|(i, &w)| (w, i as u8))
            .collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { mask, sorted }
    }

    /// The point for each control point, where these weights are the pattern's.
    fn matches<const N: usize>(&self, weights: &[(f64, u32)]) -> Option<[u32; N]> {
        if weights.len() != self.sorted.len() {
            return None;
        }
        let mut points = [weights.first()?.1; N];
        for (&(w, point), &(expected, control)) in weights.iter().zip(&self.sorted) {
            if (w - expected).abs() > TOLERANCE {
                return None;
            }
            points[control as usize] = point;
        }
        Some(points)
    }
}

static BSPLINES: LazyLock<Vec<Pattern>> = LazyLock::new(|| {
    (0..16)
        .map(|mask| Pattern::new(&bspline::weights(PROBE[0], PROBE[1], mask), mask))
        .collect()
});

static GREGORY: LazyLock<Pattern> =
    LazyLock::new(|| Pattern::new(&gregory::weights(PROBE[0], PROBE[1]), 0));

fn not_zero(weights: &[f64]) -> Vec<(f64, u32)> {
    let mut sorted: Vec<(f64, u32)> = weights
        .iter()
        .enumerate()
        .filter(|(_, w)| w.abs() > ZERO)
        .map(|(i, &w)| (w, i as u32))
        .collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    sorted
}

impl Leaf {
    fn find(weights: &[f64]) -> Option<Self> {
        let weights = not_zero(weights);
        if let Some(points) = GREGORY.matches(&weights) {
            return Some(Self::Gregory { points });
        }
        BSPLINES.iter().find_map(|pattern| {
            let points = pattern.matches(&weights)?;
            Some(Self::BSpline {
                points,
                mask: pattern.mask,
            })
        })
    }

    /// The patch's own weights at (u, v) are these.
    fn fits(&self, u: f64, v: f64, weights: &[f64]) -> bool {
        let mut rest = weights.to_vec();
        let mut subtract = |points: &[u32], own: &[f64]| {
            for (&point, w) in points.iter().zip(own) {
                rest[point as usize] -= w;
            }
        };
        match self {
            Self::BSpline { points, mask } => subtract(points, &bspline::weights(u, v, *mask)),
            Self::Gregory { points } => subtract(points, &gregory::weights(u, v)),
        }
        rest.iter().all(|w| w.abs() < TOLERANCE)
    }
}

impl Tree {
    /// Finds the patches of a face with `sub_faces` unit squares, given the library's weights:
    /// `weights(sub_face, u, v)`.
    pub(crate) fn find(
        sub_faces: u32,
        mut weights: impl FnMut(u32, f64, f64) -> Option<Vec<f64>>,
    ) -> Option<Self> {
        let mut tree = Self {
            roots: Vec::with_capacity(sub_faces as usize),
            nodes: Vec::new(),
            leaves: Vec::new(),
            controls: 0,
            stencils: Vec::new(),
        };
        for sub_face in 0..sub_faces {
            let root = tree.add(&mut |u, v| weights(sub_face, u, v), 0, [0, 0])?;
            tree.roots.push(root);
        }
        Some(tree)
    }

    /// Keeps the weights of `controls` control points in all patch points.
    pub(crate) fn set_stencils(&mut self, controls: usize, stencils: &[f64]) {
        self.controls = controls;
        let derived = stencils.get(controls * controls..).unwrap_or_default();
        self.stencils = derived.iter().map(|&w| w as f32).collect();
    }

    /// All patch points from those that begin with the control points, `lanes * 4` floats each.
    pub(crate) fn complete(&self, gathered: &[f32], lanes: usize, points: &mut Vec<f32>) {
        let size = lanes * 4;
        let controls = &gathered[..self.controls * size];
        points.clear();
        points.extend_from_slice(controls);
        for row in self.stencils.chunks_exact(self.controls.max(1)) {
            for lane in 0..lanes {
                let mut sum = Vec4::ZERO;
                for (w, p) in row.iter().zip(controls.chunks_exact(size)) {
                    sum += Vec4::from_slice(&p[lane * 4..]) * *w;
                }
                points.extend_from_slice(&sum.to_array());
            }
        }
    }

    fn add(
        &mut self,
        weights: &mut dyn FnMut(f64, f64) -> Option<Vec<f64>>,
        depth: u32,
        cell: [u32; 2],
    ) -> Option<Cell> {
        let scale = 1.0 / f64::from(1u32 << depth);
        let mut at = |place: [f64; 2]| {
            weights(
                (f64::from(cell[0]) + place[0]) * scale,
                (f64::from(cell[1]) + place[1]) * scale,
            )
        };
        if let Some(leaf) = Leaf::find(&at(PROBE)?) {
            if !leaf.fits(CHECK[0], CHECK[1], &at(CHECK)?) {
                return None;
            }
            self.leaves.push(leaf);
            return Some(Cell::Leaf(self.leaves.len() as u32 - 1));
        }
        if depth == MAX_DEPTH {
            return None;
        }
        let mut children = [Cell::Leaf(0); 4];
        for (i, child) in children.iter_mut().enumerate() {
            let quarter = [2 * cell[0] + (i as u32 & 1), 2 * cell[1] + (i as u32 >> 1)];
            *child = self.add(weights, depth + 1, quarter)?;
        }
        self.nodes.push(children);
        Some(Cell::Children(self.nodes.len() as u32 - 1))
    }

    /// The leaf under (u, v) of a sub-face, and the place in it.
    #[inline(always)]
    pub(crate) fn locate(&self, sub_face: u32, mut u: f32, mut v: f32) -> (u32, f32, f32) {
        let mut cell = self.roots[sub_face as usize];
        loop {
            match cell {
                Cell::Leaf(leaf) => return (leaf, u, v),
                Cell::Children(node) => {
                    let (right, up) = (u >= 0.5, v >= 0.5);
                    // Exact: doubling, and a difference of neighbours.
                    u = 2.0 * u - f32::from(u8::from(right));
                    v = 2.0 * v - f32::from(u8::from(up));
                    cell = self.nodes[node as usize][usize::from(right) + 2 * usize::from(up)];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_are_distinct() {
        let patterns: Vec<&Pattern> = BSPLINES.iter().chain([&*GREGORY]).collect();
        for (i, a) in patterns.iter().enumerate() {
            for pair in a.sorted.windows(2) {
                assert!(pair[1].0 - pair[0].0 > 1e3 * TOLERANCE, "pattern {i}");
            }
            for b in &patterns[..i] {
                let same = a.sorted.len() == b.sorted.len()
                    && a.sorted
                        .iter()
                        .zip(&b.sorted)
                        .all(|(a, b)| (a.0 - b.0).abs() < 1e-8);
                assert!(!same);
            }
        }
    }

    /// A tree of known patches is found again, with shuffled points.
    #[test]
    fn a_made_up_tree_is_found() {
        let leaf = |u: f64, v: f64| -> (usize, f64, f64) {
            let (right, up) = (u >= 0.5, v >= 0.5);
            let i = usize::from(right) + 2 * usize::from(up);
            (
                i,
                2.0 * u - f64::from(u8::from(right)),
                2.0 * v - f64::from(u8::from(up)),
            )
        };
        let spread = |i: usize, j: usize| (i * 20 + j) * 7 % 83;
        let tree = Tree::find(1, |_, u, v| {
            let (i, u, v) = leaf(u, v);
            let mut all = vec![0.0; 83];
            match i {
                3 => {
                    for (j, w) in gregory::weights(u, v).iter().enumerate() {
                        all[spread(i, j)] += w;
                    }
                }
                _ => {
                    for (j, w) in bspline::weights(u, v, [0, 1, 10, 0][i]).iter().enumerate() {
                        all[spread(i, j)] += w;
                    }
                }
            }
            Some(all)
        })
        .expect("all cells are patches");
        assert_eq!(tree.leaves.len(), 4);
        let expected: [u32; 20] = std::array::from_fn(|j| spread(3, j) as u32);
        assert_eq!(tree.leaves[3], Leaf::Gregory { points: expected });
        assert_eq!(tree.locate(0, 0.75, 0.5), (3, 0.5, 0.0));
        assert_eq!(tree.locate(0, 0.25, 1.0), (2, 0.5, 1.0));
        // Weights of nothing we know.
        assert!(Tree::find(1, |_, u, v| Some(vec![u, v, 1.0 - u - v])).is_none());
    }
}
