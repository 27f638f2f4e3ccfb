//! Bounds of blocks: the central invariant is made here.
//!
//! Each group of a block is bounded at every key of its vertices, along the axes of space and along
//! those of a frame or two that its lattice suggests; the cheapest by surface area is kept. Eight groups are
//! bounded at a time ([`super::group8`]).

use std::marker::PhantomData;
use std::ops::Range;

use glam::Vec3;
use hdtrapeze_simd::{Float, Kernel, Level, Mask, Simd};

use super::block::{Block, CellRect, GROUPS, Span, halves, halving_pays, loose};
use super::diagonal::Diagonal;
use super::group8::{Groups, Vertices, boxes, boxes_in};
use super::lanes::{Boxes8, Ranges8};
use super::radii8::radii;
use super::turn::{Between, Pose, Turning};
use super::{Bounds8, COORDINATE_LIMIT, Frame, LinearBox};
use crate::grid::planar::GridRows;
use crate::grid::{Grid, PlanarMesh};

/// What a ray that is turned into a block's frame costs, in units of what it costs at one group that it meets. Only the choice
/// of frames depends on it, and on [`THICK`]. Both were measured where all blocks would have a frame, or none, and between.
const TURN_COST: f32 = 0.5;
/// How much what boxes have above the area of the surface counts besides, where they are in a frame. Groups that a frame spares
/// a ray cost it little, since they are asked for early, and lie side by side; but of rays that leave a surface, many pass
/// its other groups where boxes are thick, and none where they are flat. On a smooth sheet, whose frames are kept, rays from
/// hits are a tenth faster with them; on small patches that are bent more, where they were slower by up to a twentieth, few blocks
/// have one.
const THICK: f32 = 2.0;

/// What became of a block.
pub enum Bounded<B: Bounds8> {
    /// Its groups are bounded.
    Block(BuiltBlock<B>),
    /// Its halves should be blocks.
    Halve,
    /// Bounds are beyond [`COORDINATE_LIMIT`].
    Absurd,
}

/// A block before its frame has a number.
pub struct BuiltBlock<B: Bounds8> {
    /// The block; its frame number is not set.
    pub block: Block<B>,
    /// Axis-aligned bounds of the block.
    pub aabb: LinearBox,
    /// Frame, if oriented bounds pay.
    pub frame: Option<B::Turning>,
    /// What oriented bounds cost of what others do, where they were tried: less than 1 if they pay.
    pub share: Option<f32>,
}

/// True when all coordinates of a grid's vertices are finite, and within [`COORDINATE_LIMIT`].
pub fn is_bounded(level: Level, rows: &GridRows<'_>) -> bool {
    level.run(Limit(rows.coordinates()))
}

/// Bounds the groups of a block in the frame that costs least, or with `upright` along the axes of space, unless its halves
/// cost less. The grid [is bounded](is_bounded).
pub fn bound<B: Bounds8>(
    level: Level,
    rows: &GridRows<'_>,
    span: Span,
    upright: bool,
) -> Bounded<B> {
    level.run(Bound {
        rows,
        span,
        upright,
        whole: false,
        kind: PhantomData,
    })
}

/// The same for a block that is not halved, whatever its halves cost. None where bounds are beyond [`COORDINATE_LIMIT`].
pub fn bound_whole<B: Bounds8>(
    level: Level,
    rows: &GridRows<'_>,
    span: Span,
) -> Option<BuiltBlock<B>> {
    let bounded = level.run(Bound {
        rows,
        span,
        upright: false,
        whole: true,
        kind: PhantomData,
    });
    match bounded {
        Bounded::Block(built) => Some(built),
        Bounded::Halve | Bounded::Absurd => None,
    }
}

/// Boxes of groups, and diagonals of these.
pub type InFrame = ([LinearBox; GROUPS], [Diagonal; GROUPS]);

/// Axis-aligned bounds of 1 to [`GROUPS`] of the [loose groups](loose) of a grid that [is bounded](is_bounded), given their
/// numbers. None where bounds are beyond [`COORDINATE_LIMIT`].
pub fn bound_loose(
    level: Level,
    rows: &GridRows<'_>,
    slots: Range<u32>,
) -> Option<[LinearBox; GROUPS]> {
    level.run(BoundLoose { rows, slots })
}

/// Bounds in a frame of 1 to [`GROUPS`] groups of grids whose vertices are finite and within
/// [`COORDINATE_LIMIT`]; each is a grid, its micropolygons and the directions that they run in at both ends of the
/// shutter. Diagonals of boxes besides, where the frame does not turn.
pub fn bound_groups<T: Turning>(
    level: Level,
    mesh: &PlanarMesh,
    groups: &[(u32, CellRect, [Vec3; 2])],
    frame: &T,
) -> InFrame {
    level.run(BoundGroups {
        mesh,
        groups,
        frame,
    })
}

struct Limit<'a>(&'a [f32]);

impl Kernel for Limit<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let limit = simd.all16(COORDINATE_LIMIT);
        let (whole, rest) = self.0.as_chunks::<16>();
        // Comparisons with NaN are false.
        let mut below = simd.all16(0.0).lt(limit);
        for x in whole {
            below = below & simd.from16(x).abs().lt(limit);
        }
        let all = below.bits() == 0xffff;
        all & rest.iter().all(|x| x.abs() < COORDINATE_LIMIT)
    }
}

struct Bound<'a, B> {
    rows: &'a GridRows<'a>,
    span: Span,
    upright: bool,
    /// It is not halved.
    whole: bool,
    kind: PhantomData<B>,
}

impl<B: Bounds8> Kernel for Bound<'_, B> {
    type Output = Bounded<B>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Bounded<B> {
        let Self {
            rows,
            span,
            upright,
            whole: keep,
            ..
        } = self;
        let groups = Groups::of_block(&rows.grid, &span);
        let vertices = Vertices {
            floats: rows.floats,
            key_times: rows.key_times,
            moving: B::MOVING,
            one_grid: true,
        };
        let mut best = boxes(simd, vertices, &groups, None);
        let aabb = best.hull();
        // Bounds at inner keys may have raised them.
        let raised = B::MOVING && rows.key_times.len() > 2;
        if raised && !(aabb.is_finite() && aabb.max_abs() < COORDINATE_LIMIT) {
            return Bounded::Absurd;
        }
        let whole = aabb.mean_half_area();
        let (u, v) = lattice_edges(rows, &span);
        let surface = u.cross(v).length();
        // Boxes of the halves have at least the area of the surface, more or less.
        if !keep
            && halving_pays([surface, 0.0], whole)
            && let Some(areas) = half_areas(simd, &span, &best)
            && halving_pays(areas, whole)
        {
            return Bounded::Halve;
        }
        let cost = best.area(simd, B::MOVING, span.count);
        let turn = whole * TURN_COST;
        let (mut frame, mut share) = (None, None);
        // So have boxes of any frame: where that saves nothing, none is tried.
        if !upright
            && surface + turn < cost
            && let Some(candidate) = turning_of::<B::Turning>(rows, &span, (u, v))
        {
            let turned = boxes_in(simd, vertices, &groups, &candidate);
            let area = turned.area(simd, B::MOVING, span.count);
            let own = area + THICK * (area - surface) + turn;
            share = Some(own / cost);
            if own < cost {
                (best, frame) = (turned, Some(candidate));
            }
        }
        Bounded::Block(BuiltBlock {
            block: Block {
                bounds: B::pack(simd, &best),
                frame: 0,
                span,
            },
            aabb,
            frame,
            share,
        })
    }
}

struct BoundGroups<'a, T> {
    mesh: &'a PlanarMesh,
    groups: &'a [(u32, CellRect, [Vec3; 2])],
    frame: &'a T,
}

impl<T: Turning> Kernel for BoundGroups<'_, T> {
    type Output = InFrame;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> InFrame {
        let turns = T::TURNS && self.frame.turn().turns();
        let frame = self.frame.start();
        let mut directions = [[Vec3::ZERO; 2]; GROUPS];
        let mut groups = Groups::default();
        for (slot, &(grid, rect, ends)) in self.groups.iter().enumerate() {
            let grid = &self.mesh.traced(grid);
            groups.put(slot, self.mesh.first_float(grid, 0), grid, rect);
            directions[slot % GROUPS] = ends.map(|end| frame.turn(end));
        }
        let groups = groups.filled(self.groups.len() as u8);
        let vertices = Vertices {
            floats: self.mesh.floats(),
            key_times: &self.mesh.key_times,
            moving: self.mesh.is_moving(),
            one_grid: false,
        };
        let found = boxes_in(simd, vertices, &groups, self.frame);
        let mut diagonals = [Diagonal::NONE; GROUPS];
        if !turns {
            let down = down(&directions);
            let radii = radii(simd, vertices, &groups, &found, down, Some(&frame));
            diagonals = with_radii(radii.to_array(), down);
        }
        (found.to_boxes(), diagonals)
    }
}

/// For both ends of the shutter and each axis, the groups whose directions go down along it, or up if they go down along x at
/// the start: so that none does.
#[inline(always)]
fn down(directions: &[[Vec3; 2]; GROUPS]) -> [[u32; 3]; 2] {
    let mut down = [[0; 3]; 2];
    for (slot, ends) in directions.iter().enumerate() {
        let turned = ends[0].x < 0.0;
        for (down, end) in down.iter_mut().zip(ends) {
            for axis in 0..3 {
                down[axis] |= u32::from((end[axis] < 0.0) != turned) << slot;
            }
        }
    }
    down
}

#[inline(always)]
fn with_radii(radii: [f32; GROUPS], down: [[u32; 3]; 2]) -> [Diagonal; GROUPS] {
    let mut out = [Diagonal::NONE; GROUPS];
    for (slot, out) in out.iter_mut().enumerate() {
        let own =
            |[x, y, z]: [u32; 3]| (x >> slot & 1) | (y >> slot & 1) << 1 | (z >> slot & 1) << 2;
        *out = Diagonal {
            radius: radii[slot],
            down: down.map(own),
        };
    }
    out
}

struct BoundLoose<'a> {
    rows: &'a GridRows<'a>,
    slots: Range<u32>,
}

impl Kernel for BoundLoose<'_> {
    type Output = Option<[LinearBox; GROUPS]>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<[LinearBox; GROUPS]> {
        let grid: &Grid = &self.rows.grid;
        let mut groups = Groups::default();
        let count = self.slots.len();
        for (i, slot) in self.slots.enumerate() {
            groups.put(i, 0, grid, loose(grid, slot));
        }
        let groups = groups.filled(count as u8);
        let vertices = Vertices {
            floats: self.rows.floats,
            key_times: self.rows.key_times,
            moving: self.rows.key_times.len() > 1,
            one_grid: true,
        };
        let found = boxes(simd, vertices, &groups, None);
        let hull = found.hull();
        // Bounds at inner keys may have raised them.
        let sound = hull.is_finite() && hull.max_abs() < COORDINATE_LIMIT;
        sound.then(|| found.to_boxes())
    }
}

/// Areas of the boxes around both halves of a block's groups, where it may be halved.
#[inline(always)]
fn half_areas<S: Simd>(simd: S, span: &Span, boxes: &Boxes8<S::F8>) -> Option<[f32; 2]> {
    let halves = halves(span)?;
    let mut second = [0.0; GROUPS];
    let (mut column, mut row) = (0, 0);
    for (slot, second) in second.iter_mut().enumerate() {
        let at = if halves.columns { column } else { row };
        // Lanes beyond the last group repeat the first.
        *second = f32::from(slot < span.count.into() && at >= halves.first);
        column += 1;
        if column == span.columns {
            (column, row) = (0, row + 1);
        }
    }
    let second = simd.from8(&second);
    let in_first = second.lt(simd.all8(0.5));
    let in_second = simd.all8(0.5).lt(second);
    Some([
        part(simd, boxes, in_first).mean_half_area(),
        part(simd, boxes, in_second).mean_half_area(),
    ])
}

/// The box around some lanes.
#[inline(always)]
fn part<S: Simd>(simd: S, boxes: &Boxes8<S::F8>, lanes: <S::F8 as Float<8>>::Mask) -> LinearBox {
    let (above, below) = (simd.all8(f32::INFINITY), simd.all8(f32::NEG_INFINITY));
    let mut parts = [boxes.start, boxes.end];
    for part in &mut parts {
        let Ranges8 { lo, hi } = part;
        for axis in 0..3 {
            lo[axis] = lo[axis].or(lanes, above);
            hi[axis] = hi[axis].or(lanes, below);
        }
    }
    let [start, end] = parts;
    Boxes8 { start, end }.hull()
}

/// The frame along a block's edges, which are given as they are at its middle key; one that follows them where such turn.
#[inline(always)]
fn turning_of<T: Turning>(rows: &GridRows<'_>, span: &Span, (u, v): (Vec3, Vec3)) -> Option<T> {
    let keys = rows.key_times.len();
    if !T::TURNS || keys < 2 {
        return frame_of(u, v, span).map(T::fixed);
    }
    let corners = [corners(rows, span, 0), corners(rows, span, keys - 1)];
    let [[u0, v0], [u1, v1]] = [edges(corners[0]), edges(corners[1])];
    let along_u = runs_along_u((u0 + u1, v0 + v1), span);
    let [start, end] = [
        pose(corners[0], [u0, v0], along_u)?,
        pose(corners[1], [u1, v1], along_u)?,
    ];
    if keys == 2 {
        return Some(T::between(&start, &end));
    }
    through(rows, span, (&start, &end), (u, v))
}

/// The same between the poses at both ends of the shutter, with more than two keys.
#[inline(never)]
fn through<T: Turning>(
    rows: &GridRows<'_>,
    span: &Span,
    (start, end): (&Pose, &Pose),
    (u, v): (Vec3, Vec3),
) -> Option<T> {
    let rest = frame_of(u, v, span)?;
    let times = rows.key_times;
    let inner = times.iter().enumerate().take(times.len() - 1).skip(1);
    let inner = inner.map(|(k, &time)| {
        let corners = corners(rows, span, k);
        Between {
            time,
            edges: edges(corners),
            middle: middle(corners),
        }
    });
    let inner: Vec<Between> = inner.collect();
    Some(T::through(start, &inner, end, &rest))
}

#[inline(always)]
fn pose(corners: [Vec3; 4], [u, v]: [Vec3; 2], along_u: bool) -> Option<Pose> {
    Some(Pose {
        frame: frame_along(u, v, along_u)?,
        edges: [u, v],
        middle: middle(corners),
    })
}

#[inline(always)]
fn middle([a, b, c, d]: [Vec3; 4]) -> Vec3 {
    ((a + b) + (c + d)) * 0.25
}

/// The frame along a block's edges. Of both that lie in its plane, the one that groups fill more: along the longer of
/// their edges.
#[inline(always)]
fn frame_of(u: Vec3, v: Vec3, span: &Span) -> Option<Frame> {
    frame_along(u, v, runs_along_u((u, v), span))
}

#[inline(always)]
fn runs_along_u((u, v): (Vec3, Vec3), span: &Span) -> bool {
    let share = |group: u8, block: u8| f32::from(group) / f32::from(block);
    let along_u = u.length() * share(span.group[0], span.rect.w);
    let along_v = v.length() * share(span.group[1], span.rect.h);
    along_u >= along_v
}

#[inline(always)]
fn frame_along(u: Vec3, v: Vec3, along_u: bool) -> Option<Frame> {
    if along_u {
        Frame::from_edges(u, v)
    } else {
        Frame::from_edges(v, u)
    }
}

/// The block's edges along u and v, each the mean of the two that face each other, at the middle key: of two, the last.
#[inline(always)]
fn lattice_edges(rows: &GridRows<'_>, span: &Span) -> (Vec3, Vec3) {
    let [u, v] = edges(corners(rows, span, rows.key_times.len() / 2));
    (u, v)
}

/// Corners of a block at a key, u the faster.
#[inline(always)]
fn corners(rows: &GridRows<'_>, span: &Span, key: usize) -> [Vec3; 4] {
    let [i, j, w, h] = [span.rect.i, span.rect.j, span.rect.w, span.rect.h].map(usize::from);
    let at = |x: usize, y: usize| rows.position(key, i + x, j + y);
    [at(0, 0), at(w, 0), at(0, h), at(w, h)]
}

#[inline(always)]
fn edges([a, b, c, d]: [Vec3; 4]) -> [Vec3; 2] {
    [((b - a) + (d - c)) * 0.5, ((c - a) + (d - b)) * 0.5]
}
