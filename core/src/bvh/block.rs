//! Blocks: the build's primitive, up to 8x8 micropolygons of a grid under one implicit node.
//!
//! A block has up to 8 *groups* of up to 4x2 micropolygons, in rows; where a group lies follows from
//! its number, so nothing is stored for it but its bounds. Blocks may also be 4x16 or 16x4, with the
//! same 8 groups, so that strips of narrow grids (fur) fill their nodes; groups shrink while 8 are
//! enough. Where the box of a block is mostly empty, as along a tilted strand, the block is halved for
//! as long as that pays ([`halving_pays`]).
//!
//! Groups may also be *loose*: the tree refers to them itself, without a block. A grid that is no larger
//! than one group ([`is_small`]) is one; a strip is cut into several where [`super::gather`] says so.

use std::ops::Range;

use crate::grid::Grid;

/// Most micropolygons of a group along u and v: one vector test of 8.
pub const GROUP: (usize, usize) = (4, 2);
/// Most groups of a block.
pub const GROUPS: usize = 8;

/// A block is halved when the boxes of its halves have less than this part of its own area together.
/// A quarter of each would be a straight diagonal strand (sum 1/2), half of each a surface (sum 1, and
/// a little less when it is tilted). Halving doubles the nodes above and the bounds stored, so it must
/// save clearly more than a surface does.
const HALVING: f32 = 0.6;
/// Blocks of fewer micropolygons than this are not halved.
const MIN_HALVED: u8 = 16;

/// A rectangle of micropolygons of a grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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

/// The smallest groups, and of equals the narrowest, of which at most 8 cover a block: by its width and height.
static SHAPES: [[[u8; 2]; 32]; 32] = {
    let mut shapes = [[[0; 2]; 32]; 32];
    let mut at = 0;
    while at < 32 * 32 {
        shapes[at / 32][at % 32] = smallest_groups(at / 32, at % 32);
        at += 1;
    }
    shapes
};

const fn smallest_groups(w: usize, h: usize) -> [u8; 2] {
    let mut best = GROUP;
    let mut shape = 0;
    while shape < GROUP.0 * GROUP.1 {
        let (cw, ch) = (1 + shape / GROUP.1, 1 + shape % GROUP.1);
        if w.div_ceil(cw) * h.div_ceil(ch) <= GROUPS && cw * ch < best.0 * best.1 {
            best = (cw, ch);
        }
        shape += 1;
    }
    [best.0 as u8, best.1 as u8]
}

/// 256 by each number of columns, rounded up: a quotient of slots by a multiplication.
static RECIPROCAL: [u32; 16] = {
    let mut out = [0; 16];
    let mut columns = 1;
    while columns < 16 {
        out[columns] = 256u32.div_ceil(columns as u32);
        columns += 1;
    }
    out
};

impl Span {
    fn new(grid: u32, rect: CellRect) -> Span {
        let [cw, ch] = SHAPES[usize::from(rect.w & 31)][usize::from(rect.h & 31)];
        let columns = rect.w.div_ceil(cw);
        Span {
            grid,
            rect,
            group: [cw, ch],
            columns,
            count: columns * rect.h.div_ceil(ch),
        }
    }

    /// A single group.
    pub fn group(grid: u32, rect: CellRect) -> Span {
        Span {
            grid,
            rect,
            group: [rect.w, rect.h],
            columns: 1,
            count: 1,
        }
    }

    /// Micropolygons of group `slot` (below `count`).
    #[inline(always)]
    pub fn group_rect(&self, slot: u32) -> CellRect {
        let columns = self.columns & 15;
        let row = ((slot * RECIPROCAL[usize::from(columns)]) >> 8) as u8;
        let column = slot as u8 - row * columns;
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

/// True for a strand of fur, one micropolygon across, that may be cut into [loose groups](loose).
pub fn is_strip(grid: &Grid) -> bool {
    grid.nu.min(grid.nv) == 1 && grid.nu.max(grid.nv) >= 3
}

/// Micropolygons along a loose group of a strip; where strands are [thin](super::thin), a single one.
const LOOSE_LENGTH: u8 = 2;

/// The numbers that the loose groups of a grid have, which is small, or a strip: at most [`GROUPS`] from 0 on. Those of the single
/// micropolygons of a strip follow, from [`GROUPS`] on.
pub fn loose_slots(grid: &Grid, singles: bool) -> Range<u32> {
    if is_small(grid) {
        return 0..1;
    }
    let length = u32::from(grid.nu.max(grid.nv));
    if singles {
        GROUPS as u32..GROUPS as u32 + length
    } else {
        0..length.div_ceil(u32::from(LOOSE_LENGTH))
    }
}

/// The first micropolygon of a loose group of a strip, and how many there are unless the strip ends before.
#[inline(always)]
pub fn part_of_strip(slot: u32) -> (u8, u8) {
    let slot = slot as u8;
    match slot.checked_sub(GROUPS as u8) {
        Some(single) => (single, 1),
        None => (slot * LOOSE_LENGTH, LOOSE_LENGTH),
    }
}

/// A group that the tree refers to without a block: all of a small grid, or a part of a strip.
#[inline(always)]
pub fn loose(grid: &Grid, slot: u32) -> CellRect {
    let (w, h) = (grid.nu as u8, grid.nv as u8);
    let whole = CellRect { i: 0, j: 0, w, h };
    if is_small(grid) {
        return whole;
    }
    let (from, length) = part_of_strip(slot);
    if w == 1 {
        CellRect {
            j: from,
            h: length.min(h - from),
            ..whole
        }
    } else {
        CellRect {
            i: from,
            w: length.min(w - from),
            ..whole
        }
    }
}

/// Cuts a grid into as few blocks as the shapes 8x8, 4x16 and 16x4 allow, evenly.
pub fn cut(number: u32, grid: &Grid) -> impl Iterator<Item = Span> + use<> {
    let [nu, nv] = [grid.nu as u8, grid.nv as u8];
    // Divisors that are known here: this runs for every grid.
    let blocks = [
        [nu.div_ceil(8), nv.div_ceil(8)],
        [nu.div_ceil(4), nv.div_ceil(16)],
        [nu.div_ceil(16), nv.div_ceil(4)],
    ];
    let [columns, rows] = blocks
        .into_iter()
        .min_by_key(|&[columns, rows]| columns * rows)
        .unwrap_or(blocks[0]);
    let (mut column, mut row) = (0, 0);
    std::iter::from_fn(move || {
        if row == rows {
            return None;
        }
        let (i, i1) = (column * nu / columns, (column + 1) * nu / columns);
        let (j, j1) = (row * nv / rows, (row + 1) * nv / rows);
        column += 1;
        if column == columns {
            (column, row) = (0, row + 1);
        }
        let (w, h) = (i1 - i, j1 - j);
        Some(Span::new(number, CellRect { i, j, w, h }))
    })
}

/// True where the halves of a block, along its longer side, should be blocks of their own, by the areas of their
/// boxes and its own ([`HALVING`]).
#[inline(always)]
pub fn halving_pays(halves: [f32; 2], whole: f32) -> bool {
    halves[0] + halves[1] < HALVING * whole
}

/// The first `groups` of a row, or rows of groups, are nearer to the block's start along its longer side.
#[derive(Clone, Copy)]
pub struct Halves {
    /// True where columns are halved, not rows.
    pub columns: bool,
    /// Columns or rows of groups in the first half.
    pub first: u8,
}

/// How a block may be halved; none where it is too small.
#[inline(always)]
pub fn halves(span: &Span) -> Option<Halves> {
    let r = span.rect;
    let columns = r.w > r.h;
    let rows = span.count / span.columns.max(1);
    let first = if columns { span.columns } else { rows } / 2;
    (r.w.max(r.h) >= 4 && r.w * r.h >= MIN_HALVED && first > 0).then_some(Halves { columns, first })
}

/// A block halved along its longer side.
pub fn halved(span: Span) -> [Span; 2] {
    let r = span.rect;
    if r.w > r.h {
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
    .map(|rect| Span::new(span.grid, rect))
}

#[cfg(test)]
mod tests {
    use super::super::object::LOOSE_BITS;
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
    fn loose_groups_cover_every_cell_once() {
        for (nu, nv) in (1..=16u16).flat_map(|n| [(1, n), (n, 1), (4, 2)]) {
            let grid = Grid {
                first_vertex: 0,
                element: 0,
                nu,
                nv,
            };
            assert!(is_small(&grid) || is_strip(&grid), "{nu}x{nv}");
            for singles in [false, true] {
                let slots = loose_slots(&grid, singles);
                let most = if singles { 3 * GROUPS } else { GROUPS };
                assert!(slots.end as usize <= most && slots.end <= 1 << LOOSE_BITS);
                let single = singles && !is_small(&grid);
                assert!(slots.start == if single { GROUPS as u32 } else { 0 });
                let mut seen = vec![0; grid.cell_count()];
                for r in slots.map(|slot| loose(&grid, slot)) {
                    assert!(usize::from(r.w) <= GROUP.0 && usize::from(r.h) <= GROUP.1);
                    assert!(!single || r.w * r.h == 1);
                    for j in r.j..r.j + r.h {
                        for i in r.i..r.i + r.w {
                            seen[usize::from(j) * usize::from(nu) + usize::from(i)] += 1;
                        }
                    }
                }
                assert!(seen.iter().all(|&n| n == 1), "{nu}x{nv}: {seen:?}");
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
