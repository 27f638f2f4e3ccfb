//! Blocks: the build's primitive, up to 8x8 micropolygons of a grid under one implicit node.
//!
//! A block has up to 8 *groups* of up to 4x2 micropolygons, in rows; where a group lies follows from
//! its number, so nothing is stored for it but its bounds. Blocks may also be 4x16 or 16x4, with the
//! same 8 groups, so that strips of narrow grids (fur) fill their nodes; groups shrink while 8 are
//! enough. Where the box of a block is mostly empty, as along a tilted strand, the block is halved for
//! as long as that pays ([`refine`]).
//!
//! A grid that is no larger than one group ([`is_small`]) needs no block: the tree refers to it itself.

use glam::Vec3;

use super::{Bounds8, COORDINATE_LIMIT, Frame, LinearBox, ROTATION_PAD};
use crate::grid::{DicedMesh, Grid, MAX_GRID_RATE};

/// Most micropolygons of a group along u and v: one vector test of 8.
pub const GROUP: (usize, usize) = (4, 2);
/// Most groups of a block.
pub const GROUPS: usize = 8;
/// Most lattice vertices of a block: 9x9, 5x17 or 17x5.
const MAX_BLOCK_VERTICES: usize = 85;

/// Relative cost of turning a ray into a node's frame (9 products, 3 reciprocals), in units of
/// one group test. An estimate, not yet measured; only the choice of frames depends on it.
const TURN_COST: f32 = 0.3;

/// A block is halved when the boxes of its halves have less than this part of its own area together.
/// A quarter of each would be a straight diagonal strand (sum 1/2), half of each a surface (sum 1, and
/// a little less when it is tilted). Halving doubles the nodes above and the bounds stored, so it must
/// save clearly more than a surface does.
const HALVING: f32 = 0.6;
/// Blocks of fewer micropolygons than this are not halved.
const MIN_HALVED: u8 = 16;

/// A rectangle of micropolygons of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellRect {
    /// First micropolygon along u.
    pub i: u8,
    /// First micropolygon along v.
    pub j: u8,
    /// Micropolygons along u.
    pub w: u8,
    /// Micropolygons along v.
    pub h: u8,
}

/// Which part of which grid a block is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Span {
    /// Grid of the mesh.
    pub grid: u32,
    /// Micropolygons of the block.
    pub rect: CellRect,
    /// Micropolygons of a group along u and v (fewer at the far sides).
    pub group: [u8; 2],
    /// Groups in a row.
    pub columns: u8,
    /// Groups of the block.
    pub count: u8,
}

impl Span {
    fn new(grid: u32, rect: CellRect) -> Span {
        let (w, h) = (usize::from(rect.w), usize::from(rect.h));
        let mut best = GROUP;
        for cw in 1..=GROUP.0 {
            for ch in 1..=GROUP.1 {
                let fits = w.div_ceil(cw) * h.div_ceil(ch) <= GROUPS;
                if fits && cw * ch < best.0 * best.1 {
                    best = (cw, ch);
                }
            }
        }
        let columns = w.div_ceil(best.0);
        Span {
            grid,
            rect,
            group: [best.0 as u8, best.1 as u8],
            columns: columns as u8,
            count: (columns * h.div_ceil(best.1)) as u8,
        }
    }

    /// Micropolygons of group `slot` (below `count`).
    #[inline(always)]
    pub fn group_rect(&self, slot: u32) -> CellRect {
        let columns = u32::from(self.columns).max(1);
        let (row, column) = ((slot / columns) as u8, (slot % columns) as u8);
        let (i, j) = (column * self.group[0], row * self.group[1]);
        CellRect {
            i: self.rect.i + i,
            j: self.rect.j + j,
            w: self.group[0].min(self.rect.w - i),
            h: self.group[1].min(self.rect.h - j),
        }
    }
}

/// A block: its groups' bounds, in the block's frame, and what it covers.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Block<B> {
    /// Bounds of the groups.
    pub bounds: B,
    /// Number of the block's frame; 0 is the identity.
    pub frame: u32,
    /// What the block covers.
    pub span: Span,
}

/// True for a grid of one group: a whole block for it would be mostly empty.
pub fn is_small(grid: &Grid) -> bool {
    usize::from(grid.nu) <= GROUP.0 && usize::from(grid.nv) <= GROUP.1
}

/// The one group of a small grid.
#[inline(always)]
pub fn whole(grid: &Grid) -> CellRect {
    CellRect {
        i: 0,
        j: 0,
        w: grid.nu as u8,
        h: grid.nv as u8,
    }
}

/// Axis-aligned bounds of a small grid. None where a vertex is not finite, or beyond
/// [`COORDINATE_LIMIT`].
pub fn bound_small(mesh: &DicedMesh, number: u32) -> Option<LinearBox> {
    let rect = whole(&mesh.grids[number as usize]);
    let span = Span {
        grid: number,
        rect,
        group: [rect.w, rect.h],
        columns: 1,
        count: 1,
    };
    let bounds = group_boxes(mesh, &span, None)[0];
    let sound = bounds.is_finite() && bounds.max_abs() < COORDINATE_LIMIT;
    (sound && all_finite(mesh, &span)).then_some(bounds)
}

/// Cuts a grid into as few blocks as the shapes 8x8, 4x16 and 16x4 allow, evenly.
pub fn cut(number: u32, grid: &Grid) -> impl Iterator<Item = Span> + use<> {
    let (nu, nv) = (usize::from(grid.nu), usize::from(grid.nv));
    let count = |(w, h): (usize, usize)| nu.div_ceil(w) * nv.div_ceil(h);
    let shape = [(8, 8), (4, 16), (16, 4)]
        .into_iter()
        .min_by_key(|&s| count(s))
        .unwrap_or((8, 8));
    let (columns, rows) = (nu.div_ceil(shape.0), nv.div_ceil(shape.1));
    (0..rows).flat_map(move |row| {
        let (j, j1) = (row * nv / rows, (row + 1) * nv / rows);
        (0..columns).map(move |column| {
            let (i, i1) = (column * nu / columns, (column + 1) * nu / columns);
            let rect = CellRect {
                i: i as u8,
                j: j as u8,
                w: (i1 - i) as u8,
                h: (j1 - j) as u8,
            };
            Span::new(number, rect)
        })
    })
}

/// Halves a block, along its longer side, for as long as [`HALVING`] says that it pays; appends what
/// remains to `out`.
pub fn refine(mesh: &DicedMesh, span: Span, out: &mut Vec<Span>) {
    let r = span.rect;
    if r.w.max(r.h) >= 4 && r.w * r.h >= MIN_HALVED {
        let halves = if r.w > r.h {
            let w = r.w / 2;
            let right = CellRect {
                i: r.i + w,
                w: r.w - w,
                ..r
            };
            [CellRect { w, ..r }, right]
        } else {
            let h = r.h / 2;
            let far = CellRect {
                j: r.j + h,
                h: r.h - h,
                ..r
            };
            [CellRect { h, ..r }, far]
        }
        .map(|rect| Span::new(span.grid, rect));
        let area = |span: &Span| sampled_box(mesh, span).mean_half_area();
        if area(&halves[0]) + area(&halves[1]) < HALVING * area(&span) {
            for half in halves {
                refine(mesh, half, out);
            }
            return;
        }
    }
    out.push(span);
}

/// The box of a block's corners and middle, at both ends of the shutter: an estimate, for choices only.
fn sampled_box(mesh: &DicedMesh, span: &Span) -> LinearBox {
    let grid = &mesh.grids[span.grid as usize];
    let stride = usize::from(grid.nu) + 1;
    let [i, j, w, h] = [span.rect.i, span.rect.j, span.rect.w, span.rect.h].map(usize::from);
    let start = mesh.grid_positions(span.grid as usize, 0);
    let end = mesh.grid_positions(span.grid as usize, mesh.key_count() - 1);
    let mut out = LinearBox::EMPTY;
    for (x, y) in [(0, 0), (w, 0), (0, h), (w, h), (w / 2, h / 2)] {
        let at = (j + y) * stride + i + x;
        out = out.union(&LinearBox {
            lo0: start[at],
            hi0: start[at],
            lo1: end[at],
            hi1: end[at],
        });
    }
    out
}

/// True when the grid's rates and vertices are within the mesh.
pub fn is_sound(mesh: &DicedMesh, grid: &Grid) -> bool {
    let rate = 1..=MAX_GRID_RATE as u16;
    rate.contains(&grid.nu)
        && rate.contains(&grid.nv)
        && grid.first_vertex as usize + grid.vertex_count() <= mesh.vertex_count
}

/// A block before its frame has a number.
pub struct BuiltBlock<B> {
    /// The block; its frame number is not set.
    pub block: Block<B>,
    /// Axis-aligned bounds of the block.
    pub aabb: LinearBox,
    /// Frame, if oriented bounds pay.
    pub frame: Option<Frame>,
    /// Largest magnitude of any bound of the block.
    pub max_abs: f32,
}

/// Bounds the groups of a block in the frame that costs least. None where a vertex is not finite,
/// or beyond [`COORDINATE_LIMIT`].
pub fn bound<B: Bounds8>(mesh: &DicedMesh, span: Span) -> Option<BuiltBlock<B>> {
    let boxes = group_boxes(mesh, &span, None);
    let count = usize::from(span.count);
    let aabb = union(&boxes[..count]);
    // Minima pass over NaN: every vertex is looked at.
    if !(aabb.is_finite() && aabb.max_abs() < COORDINATE_LIMIT && all_finite(mesh, &span)) {
        return None;
    }
    let area = |boxes: &[LinearBox]| boxes.iter().map(LinearBox::mean_half_area).sum::<f32>();
    let mut cost = area(&boxes[..count]);
    let turn = aabb.mean_half_area() * TURN_COST;
    let (mut best, mut frame) = (boxes, None);
    for candidate in candidates(mesh, &span).into_iter().flatten() {
        let boxes = group_boxes(mesh, &span, Some(&candidate));
        let oriented = area(&boxes[..count]) + turn;
        if oriented < cost {
            (cost, best, frame) = (oriented, boxes, Some(candidate));
        }
    }
    Some(BuiltBlock {
        block: Block {
            bounds: B::pack(&best[..count]),
            frame: 0,
            span,
        },
        aabb,
        frame,
        max_abs: aabb.max_abs().max(union(&best[..count]).max_abs()),
    })
}

fn union(boxes: &[LinearBox]) -> LinearBox {
    boxes.iter().fold(LinearBox::EMPTY, |a, b| a.union(b))
}

/// The block's lattice positions at key `k`, row by row.
fn rows<'a>(
    mesh: &'a DicedMesh,
    span: &Span,
    k: usize,
) -> impl Iterator<Item = &'a [Vec3]> + use<'a> {
    let grid = &mesh.grids[span.grid as usize];
    let positions = mesh.grid_positions(span.grid as usize, k);
    let stride = usize::from(grid.nu) + 1;
    let [i, j, w, h] = [span.rect.i, span.rect.j, span.rect.w, span.rect.h].map(usize::from);
    (j..=j + h).map(move |row| &positions[row * stride + i..][..w + 1])
}

fn all_finite(mesh: &DicedMesh, span: &Span) -> bool {
    (0..mesh.key_count()).all(|k| {
        rows(mesh, span, k).all(|row| {
            row.iter()
                .all(|p| p.is_finite() && p.abs().max_element() < COORDINATE_LIMIT)
        })
    })
}

/// Frames worth trying: along each direction of the lattice, with the block's normal, as the block
/// lies in mid-shutter.
fn candidates(mesh: &DicedMesh, span: &Span) -> [Option<Frame>; 2] {
    let k = mesh.key_count() / 2;
    let mut rows = rows(mesh, span, k);
    let Some(first) = rows.next() else {
        return [None; 2];
    };
    let last = rows.last().unwrap_or(first);
    let end = first.len() - 1;
    let u = (first[end] - first[0]) + (last[end] - last[0]);
    let v = (last[0] - first[0]) + (last[end] - first[end]);
    [Frame::from_edges(u, v), Frame::from_edges(v, u)]
}

/// Bounds of each group of a block, in a frame or axis-aligned: the central invariant is made here.
pub fn group_boxes(mesh: &DicedMesh, span: &Span, frame: Option<&Frame>) -> [LinearBox; GROUPS] {
    let mut boxes = [LinearBox::EMPTY; GROUPS];
    let keys = mesh.key_count();
    let count = usize::from(span.count);
    let mut at_start = [(Vec3::ZERO, Vec3::ZERO); GROUPS];
    group_ranges(mesh, span, 0, frame, &mut at_start);
    let mut at_end = at_start;
    if keys > 1 {
        group_ranges(mesh, span, keys - 1, frame, &mut at_end);
    }
    for slot in 0..count {
        boxes[slot] = LinearBox {
            lo0: at_start[slot].0,
            hi0: at_start[slot].1,
            lo1: at_end[slot].0,
            hi1: at_end[slot].1,
        };
    }
    for k in 1..keys.saturating_sub(1) {
        group_ranges(mesh, span, k, frame, &mut at_start);
        for slot in 0..count {
            boxes[slot].raise(mesh.key_times[k], at_start[slot].0, at_start[slot].1);
        }
    }
    boxes
}

/// Ranges of the coordinates of each group's vertices at key `k`, widened for the rounding of the
/// rotation where there is one.
fn group_ranges(
    mesh: &DicedMesh,
    span: &Span,
    k: usize,
    frame: Option<&Frame>,
    out: &mut [(Vec3, Vec3); GROUPS],
) {
    let mut lo = [Vec3::ZERO; MAX_BLOCK_VERTICES];
    let mut hi = [Vec3::ZERO; MAX_BLOCK_VERTICES];
    let stride = usize::from(span.rect.w) + 1;
    for (row, positions) in rows(mesh, span, k).enumerate() {
        for (i, &p) in positions.iter().enumerate() {
            let at = row * stride + i;
            (lo[at], hi[at]) = match frame {
                None => (p, p),
                Some(frame) => {
                    let q = frame.turn(p);
                    let pad = Vec3::splat((p.x.abs() + p.y.abs() + p.z.abs()) * ROTATION_PAD);
                    (q - pad, q + pad)
                }
            };
        }
    }
    for slot in 0..u32::from(span.count) {
        let r = span.group_rect(slot);
        let (i, j) = (
            usize::from(r.i - span.rect.i),
            usize::from(r.j - span.rect.j),
        );
        let mut range = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for row in j..=j + usize::from(r.h) {
            for at in row * stride + i..=row * stride + i + usize::from(r.w) {
                range = (range.0.min(lo[at]), range.1.max(hi[at]));
            }
        }
        out[slot as usize] = range;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_cover_every_cell_once() {
        for nu in 1..=16u16 {
            for nv in 1..=16u16 {
                let grid = Grid {
                    first_vertex: 0,
                    element: 0,
                    nu,
                    nv,
                };
                let mut seen = vec![0; grid.cell_count()];
                let mut blocks = 0;
                for span in cut(3, &grid) {
                    blocks += 1;
                    assert!(span.count as usize <= GROUPS && span.count > 0);
                    let vertices = (span.rect.w as usize + 1) * (span.rect.h as usize + 1);
                    assert!(vertices <= MAX_BLOCK_VERTICES);
                    for slot in 0..u32::from(span.count) {
                        let r = span.group_rect(slot);
                        assert!(usize::from(r.w) <= GROUP.0 && usize::from(r.h) <= GROUP.1);
                        for j in r.j..r.j + r.h {
                            for i in r.i..r.i + r.w {
                                seen[usize::from(j) * usize::from(nu) + usize::from(i)] += 1;
                            }
                        }
                    }
                }
                assert!(seen.iter().all(|&n| n == 1), "{nu}x{nv}: {seen:?}");
                assert!(blocks <= 4);
            }
        }
    }

    #[test]
    fn strips_are_one_block_of_small_groups() {
        let grid = |nu, nv| Grid {
            first_vertex: 0,
            element: 0,
            nu,
            nv,
        };
        let fur: Vec<Span> = cut(0, &grid(1, 16)).collect();
        assert_eq!((fur.len(), fur[0].group, fur[0].count), (1, [1, 2], 8));
        let strip: Vec<Span> = cut(0, &grid(16, 1)).collect();
        assert_eq!(
            (strip.len(), strip[0].group, strip[0].count),
            (1, [2, 1], 8)
        );
        assert_eq!(cut(0, &grid(16, 16)).count(), 4);
    }
}
