//! Bounds of 8 groups at once.
//!
//! A vector holds a row of 4 vertices of each of 4 groups, and another the 4 vertices that begin one later: with
//! the smaller of each pair, over the rows of a group, a lane stands for a column of its micropolygons.

use glam::Vec3;
use hdtrapeze_simd::{Float, Part, Simd};

use super::block::{CellRect, GROUP, GROUPS, Span};
use super::bowing::goes_straight;
use super::lanes::{Boxes8, Ranges8};
use super::turn::{BOW_PAD, BOWED_PAD, INNER_PAD, Turn, Turning};
use super::{Frame, ROTATION_PAD, ROTATION_TINY};
use crate::grid::Grid;

/// Rows of vertices of a group, at most.
pub(super) const ROWS: usize = GROUP.1 + 1;
const _: () = assert!(GROUP.0 == 4 && GROUPS == 8);

/// Where the vertices of up to 8 groups are.
#[derive(Clone, Copy, Debug, Default)]
pub struct Groups {
    /// Where their rows begin: with x at the first key.
    pub(super) rows: [[usize; GROUPS]; ROWS],
    /// Vertices of a row of each: y is so much later than x.
    columns: [usize; GROUPS],
    /// Floats from one key to the next.
    key: [usize; GROUPS],
    /// Lanes that are columns of micropolygons, of the first 4 groups and of the others.
    pub(super) lanes: [u32; 2],
    pub(super) more_than_4: bool,
    /// Each second group begins where the one before ends.
    pairs: bool,
}

impl Groups {
    /// Sets a group of a grid whose floats begin at `start`.
    #[inline(always)]
    pub fn put(&mut self, slot: usize, start: usize, grid: &Grid, rect: CellRect) {
        let columns = usize::from(grid.nu) + 1;
        let stride = 3 * columns;
        let first = start + usize::from(rect.j) * stride + usize::from(rect.i);
        for (row, at) in self.rows.iter_mut().enumerate() {
            // A row again where there are fewer.
            at[slot % GROUPS] = first + row.min(rect.h.into()) * stride;
        }
        self.columns[slot % GROUPS] = columns;
        self.key[slot % GROUPS] = 3 * grid.vertex_count();
        let columns = (1 << rect.w) - 1;
        self.lanes[slot / 4 % 2] |= columns << (slot % 4 * 4);
    }

    /// All 8 groups, the first again where there are fewer than that.
    #[inline(always)]
    pub fn filled(mut self, count: u8) -> Self {
        let first = self.lanes[0] & 0xf;
        for slot in count.into()..GROUPS {
            for row in &mut self.rows {
                row[slot] = row[0];
            }
            self.columns[slot] = self.columns[0];
            self.key[slot] = self.key[0];
            self.lanes[slot / 4] |= first << (slot % 4 * 4);
        }
        self.more_than_4 = count > 4;
        self
    }

    /// The groups of a block, whose grid's floats begin at 0.
    #[inline(always)]
    pub fn of_block(grid: &Grid, span: &Span) -> Self {
        let mut groups = Self::default();
        let [cw, ch] = span.group;
        let (mut i, mut j) = (0, 0);
        for slot in 0..usize::from(span.count).min(GROUPS) {
            let rect = CellRect {
                i: span.rect.i + i,
                j: span.rect.j + j,
                w: cw.min(span.rect.w - i),
                h: ch.min(span.rect.h - j),
            };
            groups.put(slot, 0, grid, rect);
            i += cw;
            if i >= span.rect.w {
                (i, j) = (0, j + ch);
            }
        }
        let mut groups = groups.filled(span.count);
        groups.pairs = usize::from(cw) == GROUP.0 && span.columns == 2 && span.count == 8;
        groups
    }
}

/// What is bounded.
#[derive(Clone, Copy)]
pub struct Vertices<'a> {
    /// Coordinates of one grid, or of all.
    pub floats: &'a [f32],
    /// Key times across the shutter.
    pub key_times: &'a [f32],
    /// There may be more keys than one.
    pub moving: bool,
    /// All groups are of one grid.
    pub one_grid: bool,
}

impl<'a> Vertices<'a> {
    /// Of the keys that count.
    #[inline(always)]
    pub(super) fn key_times(self) -> &'a [f32] {
        // Known when this is compiled, so that nothing is computed twice.
        if self.moving {
            self.key_times
        } else {
            &self.key_times[..1]
        }
    }
}

/// Bounds over the shutter, in a frame or axis-aligned.
#[inline(always)]
pub fn boxes<S: Simd>(
    simd: S,
    vertices: Vertices<'_>,
    groups: &Groups,
    frame: Option<&Frame>,
) -> Boxes8<S::F8> {
    let keyed = InGroups {
        vertices,
        groups,
        frame,
    };
    over_shutter(simd, vertices.key_times(), &keyed)
}

/// What has ranges of coordinates at keys.
pub(super) trait Keyed<S: Simd> {
    /// At a key. Give it `#[inline(always)]`.
    fn ranges(&self, simd: S, key: usize) -> Ranges8<S::F8>;
}

struct InGroups<'a> {
    vertices: Vertices<'a>,
    groups: &'a Groups,
    frame: Option<&'a Frame>,
}

impl<S: Simd> Keyed<S> for InGroups<'_> {
    #[inline(always)]
    fn ranges(&self, simd: S, key: usize) -> Ranges8<S::F8> {
        ranges(simd, self.vertices, self.groups, Of::Key(key), self.frame)
    }
}

/// Bounds over the shutter.
#[inline(always)]
pub(super) fn over_shutter<S: Simd>(
    simd: S,
    key_times: &[f32],
    keyed: &impl Keyed<S>,
) -> Boxes8<S::F8> {
    let start = keyed.ranges(simd, 0);
    let last = key_times.len() - 1;
    if last == 0 {
        return Boxes8 { start, end: start };
    }
    let end = keyed.ranges(simd, last);
    let mut found = Boxes8 { start, end };
    for (k, &time) in key_times.iter().enumerate().take(last).skip(1) {
        found.raise(simd, time, &keyed.ranges(simd, k));
    }
    found
}

/// Bounds over the shutter in a frame that may turn.
#[inline(always)]
pub fn boxes_in<S: Simd, T: Turning>(
    simd: S,
    vertices: Vertices<'_>,
    groups: &Groups,
    frame: &T,
) -> Boxes8<S::F8> {
    let at_start = frame.start();
    let turn = frame.turn();
    if !T::TURNS || !turn.turns() {
        return boxes(simd, vertices, groups, Some(&at_start));
    }
    let [x, y] = turn.axes;
    let at_end = Frame {
        axes: [x, y, turn.normals[1]],
    };
    // What has two keys has no bow along fixed axes.
    if vertices.key_times.len() > 2 || (turn.bow.x, turn.bow.y) != (0.0, 0.0) {
        return simd.apart(Through {
            vertices,
            groups,
            turn: &turn,
            ends: [&at_start, &at_end],
        });
    }
    let step = Frame {
        axes: [Vec3::ZERO, Vec3::ZERO, turn.step()],
    };
    let mut start = ranges(simd, vertices, groups, Of::Key(0), Some(&at_start));
    let mut end = ranges(simd, vertices, groups, Of::Key(1), Some(&at_end));
    let bows = ranges(simd, vertices, groups, Of::Step(0), Some(&step));
    let (zero, quarter) = (simd.all8(0.0), simd.all8(0.25));
    let (bow, pad) = (simd.all8(turn.bow.z), simd.all8(BOWED_PAD));
    let below = (bows.hi[2] - bow).max(zero) * quarter;
    let above = (bow - bows.lo[2]).max(zero) * quarter;
    for bounds in [&mut start, &mut end] {
        let (lo, hi) = (bounds.lo[2], bounds.hi[2]);
        bounds.lo[2] = (lo - below) - (lo.abs() + below) * pad;
        bounds.hi[2] = (hi + above) + (hi.abs() + above) * pad;
    }
    Boxes8 { start, end }
}

/// The same in a frame that turns, with any number of keys and any bow.
struct Through<'a> {
    vertices: Vertices<'a>,
    groups: &'a Groups,
    turn: &'a Turn,
    /// Axes at both ends.
    ends: [&'a Frame; 2],
}

impl<S: Simd> Part<S> for Through<'_> {
    type Output = Boxes8<S::F8>;
    #[inline(always)]
    fn run(self, simd: S) -> Boxes8<S::F8> {
        let Self {
            vertices,
            groups,
            turn,
            ends: [at_start, at_end],
        } = self;
        let times = vertices.key_times;
        let last = times.len() - 1;
        let start = ranges(simd, vertices, groups, Of::Key(0), Some(at_start));
        let end = ranges(simd, vertices, groups, Of::Key(last), Some(at_end));
        let (zero, quarter) = (simd.all8(0.0), simd.all8(0.25));
        let pad = simd.all8(BOWED_PAD);
        let size = turn.bow.abs().to_array().map(|bow| simd.all8(bow));
        let mut raised = Boxes8 { start, end };
        for (k, &time) in times.iter().enumerate().take(last).skip(1) {
            let mut inner = ranges(simd, vertices, groups, Of::Inner(k), Some(&turn.at(time)));
            let part = f64::from(time) * (1.0 - f64::from(time));
            let bow = (turn.bow.as_dvec3() * part).as_vec3();
            for axis in 0..3 {
                let bow = simd.all8(bow[axis]);
                let (lo, hi) = (inner.lo[axis], inner.hi[axis]);
                inner.lo[axis] = (lo + bow) - (lo.abs() + size[axis]) * pad;
                inner.hi[axis] = (hi + bow) + (hi.abs() + size[axis]) * pad;
            }
            raised.raise(simd, time, &inner);
        }
        let (mut below, mut above) = ([zero; 3], [zero; 3]);
        for (k, ends) in times.windows(2).enumerate() {
            let length = f64::from(ends[1]) - f64::from(ends[0]);
            let [from, to] = turn.normals.map(|normal| normal.as_dvec3());
            let step = Frame {
                axes: [Vec3::ZERO, Vec3::ZERO, ((to - from) * length).as_vec3()],
            };
            let bows = ranges(simd, vertices, groups, Of::Step(k), Some(&step));
            let bow = match goes_straight(times.len()) {
                true => Vec3::ZERO,
                false => (turn.bow.as_dvec3() * (length * length)).as_vec3(),
            };
            for axis in 0..3 {
                let bow = simd.all8(bow[axis]);
                let (lo, hi) = match axis {
                    2 => (bows.lo[2], bows.hi[2]),
                    _ => (zero, zero),
                };
                below[axis] = below[axis].max((hi - bow) * quarter);
                above[axis] = above[axis].max((bow - lo) * quarter);
            }
        }
        let Boxes8 { mut start, mut end } = raised;
        for bounds in [&mut start, &mut end] {
            for axis in 0..3 {
                let (lo, hi) = (bounds.lo[axis], bounds.hi[axis]);
                let (below, above) = (below[axis], above[axis]);
                bounds.lo[axis] = (lo - below) - (lo.abs() + below + size[axis]) * pad;
                bounds.hi[axis] = (hi + above) + (hi.abs() + above + size[axis]) * pad;
            }
        }
        Boxes8 { start, end }
    }
}

/// What ranges are of.
#[derive(Clone, Copy)]
enum Of {
    /// Vertices at a key.
    Key(usize),
    /// The same along an axis that is rounded for it.
    Inner(usize),
    /// What vertices do from a key to the next.
    Step(usize),
}

/// Ranges of coordinates, of steps along the third axis alone, widened for the rounding of the rotation where there is one.
#[inline(always)]
fn ranges<S: Simd>(
    simd: S,
    vertices: Vertices<'_>,
    groups: &Groups,
    of: Of,
    frame: Option<&Frame>,
) -> Ranges8<S::F8> {
    let a = ranges_of_4(simd, vertices, groups, 0, of, frame);
    let b = if groups.more_than_4 {
        ranges_of_4(simd, vertices, groups, 1, of, frame)
    } else {
        a
    };
    let mut found = Ranges8 {
        lo: [
            simd.least_of_fours(a.0[0], b.0[0]),
            simd.least_of_fours(a.0[1], b.0[1]),
            simd.least_of_fours(a.0[2], b.0[2]),
        ],
        hi: [
            simd.most_of_fours(a.1[0], b.1[0]),
            simd.most_of_fours(a.1[1], b.1[1]),
            simd.most_of_fours(a.1[2], b.1[2]),
        ],
    };
    if frame.is_some() {
        let tiny = simd.all8(ROTATION_TINY);
        for axis in 0..3 {
            found.lo[axis] = found.lo[axis] - tiny;
            found.hi[axis] = found.hi[axis] + tiny;
        }
    }
    found
}

/// Lower and upper bounds on each axis, of columns of micropolygons.
type Columns<F> = ([F; 3], [F; 3]);

/// Bounds of the columns of the first 4 groups, or of the last.
#[inline(always)]
fn ranges_of_4<S: Simd>(
    simd: S,
    vertices: Vertices<'_>,
    groups: &Groups,
    half: usize,
    of: Of,
    frame: Option<&Frame>,
) -> Columns<S::F16> {
    let (above, below) = (simd.all16(f32::INFINITY), simd.all16(f32::NEG_INFINITY));
    let mut found = ([above; 3], [below; 3]);
    let rows = &groups.rows;
    row(
        simd,
        vertices,
        groups,
        (&rows[0], half, of),
        frame,
        &mut found,
    );
    row(
        simd,
        vertices,
        groups,
        (&rows[1], half, of),
        frame,
        &mut found,
    );
    row(
        simd,
        vertices,
        groups,
        (&rows[2], half, of),
        frame,
        &mut found,
    );
    let (mut lo, mut hi) = found;
    let lanes = simd.mask16(groups.lanes[half]);
    for axis in 0..3 {
        lo[axis] = lo[axis].or(lanes, above);
        hi[axis] = hi[axis].or(lanes, below);
    }
    (lo, hi)
}

/// Takes in a row of vertices of 4 groups, given where rows begin, which half it is, and what is asked for.
#[inline(always)]
fn row<S: Simd>(
    simd: S,
    vertices: Vertices<'_>,
    groups: &Groups,
    (rows, half, of): (&[usize; GROUPS], usize, Of),
    frame: Option<&Frame>,
    found: &mut Columns<S::F16>,
) {
    let (mut x, mut y, mut z);
    match of {
        Of::Key(k) | Of::Inner(k) => [x, y, z] = row_at(simd, vertices, groups, rows, half, k),
        Of::Step(k) => {
            let from = row_at(simd, vertices, groups, rows, half, k);
            [x, y, z] = row_at(simd, vertices, groups, rows, half, k + 1);
            for side in 0..2 {
                x[side] = x[side] - from[0][side];
                y[side] = y[side] - from[1][side];
                z[side] = z[side] - from[2][side];
            }
        }
    }
    // Only the third axis turns.
    let along = match of {
        Of::Key(_) => (ROTATION_PAD, 0),
        Of::Inner(_) => (INNER_PAD, 0),
        Of::Step(_) => (BOW_PAD, 2),
    };
    take_in(simd, [x[0], y[0], z[0]], along, frame, found);
    take_in(simd, [x[1], y[1], z[1]], along, frame, found);
}

/// A row of vertices of 4 groups at a key, and those one later.
#[inline(always)]
pub(super) fn row_at<S: Simd>(
    simd: S,
    vertices: Vertices<'_>,
    groups: &Groups,
    rows: &[usize; GROUPS],
    half: usize,
    k: usize,
) -> [[S::F16; 2]; 3] {
    let first = 4 * half;
    let at = [
        rows[first],
        rows[first + 1],
        rows[first + 2],
        rows[first + 3],
    ];
    if vertices.one_grid {
        let n = groups.columns[0];
        let x = &vertices.floats[k * groups.key[0]..];
        let [x, y, z] = [x, &x[n..], &x[2 * n..]];
        if groups.pairs {
            let at = [at[0], at[2]];
            [
                simd.long_rows(x, at),
                simd.long_rows(y, at),
                simd.long_rows(z, at),
            ]
        } else {
            [simd.rows(x, at), simd.rows(y, at), simd.rows(z, at)]
        }
    } else {
        let c = &groups.columns;
        let step = [c[first], c[first + 1], c[first + 2], c[first + 3]];
        let key = &groups.key[first..first + 4];
        let at = plus(at, [k * key[0], k * key[1], k * key[2], k * key[3]]);
        let y = plus(at, step);
        [
            simd.rows(vertices.floats, at),
            simd.rows(vertices.floats, y),
            simd.rows(vertices.floats, plus(y, step)),
        ]
    }
}

/// Takes in 16 vertices; in a frame with this pad, and from this axis on.
#[inline(always)]
fn take_in<S: Simd>(
    simd: S,
    p: [S::F16; 3],
    (pad, first): (f32, usize),
    frame: Option<&Frame>,
    (lo, hi): &mut Columns<S::F16>,
) {
    let Some(frame) = frame else {
        for axis in 0..3 {
            lo[axis] = p[axis].min(lo[axis]);
            hi[axis] = p[axis].max(hi[axis]);
        }
        return;
    };
    let [x, y, z] = p;
    let pad = (x.abs() + y.abs() + z.abs()) * simd.all16(pad);
    for axis in first..3 {
        let a: Vec3 = frame.axes[axis];
        let q = x * simd.all16(a.x) + y * simd.all16(a.y) + z * simd.all16(a.z);
        lo[axis] = (q - pad).min(lo[axis]);
        hi[axis] = (q + pad).max(hi[axis]);
    }
}

#[inline(always)]
fn plus(a: [usize; 4], b: [usize; 4]) -> [usize; 4] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}
