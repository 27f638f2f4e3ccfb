//! What the tree of an object is built over: blocks, and groups that need none.
//!
//! A grid that is no larger than a group is an item by itself. So is each group of a *strip* (a strand of
//! fur) whose box is mostly empty: groups of neighbouring strands fill boxes of the tree far better than
//! those of one strand fill a box that is as long as the strand, whatever way strands lean, and one level is
//! saved. Of [thin](super::thin) strands each micropolygon is one. All other grids are cut into blocks ([`super::block`]).
//!
//! Runs of grids are gathered in parallel, each while its vertices are near: right after they were turned
//! into rows.

use std::ops::Range;

use hdtrapeze_simd::Level;

use super::block::{self, Block, GROUPS, Span};
use super::bound::{Bounded, bound, bound_loose, is_bounded};
use super::build::Item;
use super::object::{LOOSE_GRIDS, loose_item};
use super::sorted::Sorted;
use super::strip8;
use super::thin::are_thin;
use super::tries::Tries;
use super::turn::Turning;
use super::{Bounds8, LinearBox};
use crate::grid::planar::{GridRows, Run};
use crate::grid::{DicedMesh, Grid, PlanarMesh};

/// A strip is cut loose where the boxes of its groups have less than this part of its own area together.
const LOOSE_SHARE: f32 = 0.5;
/// Blocks of a run of grids for which a frame is tried in vain before some are passed over.
const PATIENCE: u32 = 8;
/// For one of so many it is tried from then on, until one has a frame.
const EVERY: u32 = 4;
/// What is tried is in vain where a frame costs more than this of what bounds without it do. Where it costs less, it is likely to pay near
/// by: so it is on a smooth sheet, where those that do not pay cost up to 1.3 times as much, but not on small patches that are bent and move,
/// where most cost 1.4 to 2.3 times as much.
const IN_VAIN: f32 = 1.3;

/// Items of a run of grids, in their order.
pub struct Part<B: Bounds8> {
    /// Blocks. Their frames are numbered from 1.
    pub blocks: Vec<Block<B>>,
    /// Frames of the blocks.
    pub frames: Vec<B::Turning>,
    /// Blocks by number, and loose groups, numbered as the tree does.
    pub items: Vec<Sorted<B::Hull>>,
    /// Those of the loose groups that are parts of strips.
    pub strips: usize,
    /// Grids left out: not sound, or a vertex that is absurdly far.
    pub dropped: u64,
    /// The box around all items.
    pub bounds: LinearBox,
    /// As [`Bounds8::reach`], of all blocks.
    pub reach: f64,
    /// Frames of blocks.
    tries: Tries<PATIENCE, EVERY>,
}

/// How grids are gathered.
#[derive(Clone, Copy, Debug)]
pub struct How {
    /// Strips are cut into single micropolygons, not into every two.
    pub singles: bool,
    /// Blocks have no frames.
    pub upright: bool,
}

impl How {
    /// What pays for a mesh.
    pub fn of(mesh: &DicedMesh) -> Self {
        Self {
            singles: are_thin(mesh),
            upright: false,
        }
    }
}

/// Turns a mesh into rows, and gathers all its grids; those that are not sound are left out.
pub fn gather<B: Bounds8>(mesh: DicedMesh, how: How) -> (PlanarMesh, Vec<Part<B>>) {
    let level = Level::best();
    PlanarMesh::turned(mesh, |run: Run<'_>| {
        let mut part = Part::with_room(run.grids(), how.singles);
        let mut spans = Vec::new();
        run.turn(level, |g, rows| {
            let added = rows.and_then(|rows| part.add(level, g, &rows, &mut spans, how));
            part.dropped += u64::from(added.is_none());
        });
        part
    })
}

impl<B: Bounds8> Part<B> {
    /// With room for what becomes of these grids, most often.
    fn with_room<'a>(grids: impl Iterator<Item = &'a Grid>, singles: bool) -> Self {
        let (mut blocks, mut items) = (0, 0);
        for grid in grids {
            if block::is_small(grid) || block::is_strip(grid) {
                items += block::loose_slots(grid, singles).len();
            } else {
                blocks += grid.cell_count().div_ceil(64);
            }
        }
        Part {
            blocks: Vec::with_capacity(blocks),
            frames: Vec::with_capacity(blocks),
            items: Vec::with_capacity(items + blocks),
            strips: 0,
            dropped: 0,
            bounds: LinearBox::EMPTY,
            reach: 0.0,
            tries: Tries::default(),
        }
    }

    /// Adds a grid that is a loose group; none where a bound cannot be traced.
    fn add_small(&mut self, level: Level, g: u32, rows: &GridRows<'_>) -> Option<()> {
        let [bounds, ..] = bound_loose(level, rows, 0..1)?;
        let id = loose_item(g, 0);
        self.items.push(Sorted::of(&Item { bounds, id }));
        self.bounds = self.bounds.union(&bounds);
        Some(())
    }

    /// Adds the loose groups of a strip, unless blocks are better for it; none where a bound cannot be traced.
    fn add_strip(
        &mut self,
        level: Level,
        g: u32,
        rows: &GridRows<'_>,
        slots: Range<u32>,
    ) -> Option<bool> {
        let before = self.items.len();
        let (mut whole, mut area) = (LinearBox::EMPTY, 0.0);
        let mut rest = slots.clone();
        while !rest.is_empty() {
            let some = rest.start..rest.end.min(rest.start + GROUPS as u32);
            rest.start = some.end;
            let Some(parts) = strip8::parts(level, g, rows, some) else {
                self.items.truncate(before);
                return None;
            };
            whole = whole.union(&parts.bounds);
            area += parts.area;
            self.items.extend_from_slice(parts.items());
        }
        if area >= LOOSE_SHARE * whole.mean_half_area() {
            self.items.truncate(before);
            return Some(false);
        }
        self.strips += slots.len();
        self.bounds = self.bounds.union(&whole);
        Some(true)
    }

    /// Adds the items of one grid: all, or none where a vertex cannot be traced.
    fn add(
        &mut self,
        level: Level,
        g: u32,
        rows: &GridRows<'_>,
        spans: &mut Vec<Span>,
        How { singles, upright }: How,
    ) -> Option<()> {
        if !is_bounded(level, rows) {
            return None;
        }
        let grid = &rows.grid;
        if block::is_small(grid) && g < LOOSE_GRIDS {
            return self.add_small(level, g, rows);
        }
        if block::is_strip(grid) && g < LOOSE_GRIDS {
            let slots = block::loose_slots(grid, singles);
            if self.add_strip(level, g, rows, slots)? {
                return Some(());
            }
        }
        let (before, items_before) = (self.blocks.len(), self.items.len());
        let (frames_before, bounds_before) = (self.frames.len(), (self.bounds, self.reach));
        spans.extend(block::cut(g, grid));
        spans.reverse();
        while let Some(span) = spans.pop() {
            let is_due = self.tries.is_due();
            let built = match bound::<B>(level, rows, span, upright || !is_due) {
                Bounded::Block(built) => built,
                Bounded::Halve => {
                    let [near, far] = block::halved(span);
                    spans.extend([far, near]);
                    continue;
                }
                Bounded::Absurd => {
                    // A grid is traced whole or not at all.
                    spans.clear();
                    self.blocks.truncate(before);
                    self.items.truncate(items_before);
                    self.frames.truncate(frames_before);
                    (self.bounds, self.reach) = bounds_before;
                    return None;
                }
            };
            let mut block = built.block;
            match built.share {
                Some(share) if share > IN_VAIN => self.tries.tried(true),
                Some(_) if built.frame.is_some() => self.tries.tried(false),
                // Nothing was tried, or it is likely to pay near by.
                _ => (),
            }
            if let Some(frame) = built.frame {
                self.frames.push(frame);
                block.frame = self.frames.len() as u32;
            }
            self.items.push(Sorted::of(&Item {
                bounds: built.aabb,
                id: self.blocks.len() as u32,
            }));
            self.reach = self.reach.max(block.bounds.reach());
            self.bounds = self.bounds.union(&built.aabb);
            self.blocks.push(block);
        }
        Some(())
    }
}

/// All blocks, and what the tree is built over.
pub struct Gathered<B: Bounds8> {
    /// Blocks, in the order of grids.
    pub blocks: Vec<Block<B>>,
    /// Their frames; number 0 is the identity.
    pub frames: Vec<B::Turning>,
    /// Items, by part.
    pub items: Vec<Vec<Sorted<B::Hull>>>,
}

/// Joins parts, in their order.
pub fn joined<B: Bounds8>(parts: Vec<Part<B>>) -> Gathered<B> {
    let sum = |count: fn(&Part<B>) -> usize| parts.iter().map(count).sum::<usize>();
    let mut blocks = Vec::new();
    hdtrapeze_pages::reserve(&mut blocks, sum(|p| p.blocks.len()));
    let mut items = Vec::with_capacity(parts.len());
    let mut frames = Vec::with_capacity(sum(|p| p.frames.len()) + 1);
    frames.push(B::Turning::IDENTITY);
    for mut part in parts {
        let (block_base, frame_base) = (blocks.len() as u32, frames.len() as u32 - 1);
        for block in part.blocks.iter_mut().filter(|b| b.frame != 0) {
            block.frame += frame_base;
        }
        if block_base > 0 && !part.blocks.is_empty() {
            for item in &mut part.items {
                if item.id() & super::LOOSE == 0 {
                    *item = item.numbered(item.id() + block_base);
                }
            }
        }
        blocks.append(&mut part.blocks);
        items.push(part.items);
        frames.append(&mut part.frames);
    }
    Gathered {
        blocks,
        frames,
        items,
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::COORDINATE_LIMIT;
    use super::super::node::{LinearSlabs, StaticSlabs};
    use super::*;

    /// What becomes of a strand of 16 micropolygons, of which each is an item, and whose station number `i` is at `at(key, i)`.
    fn strand(
        key_times: &[f32],
        at: impl Fn(usize, u16) -> Vec3,
    ) -> (Option<()>, Part<LinearSlabs>) {
        let grid = Grid {
            first_vertex: 0,
            element: 0,
            nu: 1,
            nv: 16,
        };
        let vertices =
            || (0..17).flat_map(|station| [(station, Vec3::ZERO), (station, Vec3::Y * 0.01)]);
        let key = |k| vertices().map(move |(station, side)| (k, station, side));
        let mesh = PlanarMesh::from(DicedMesh {
            key_times: key_times.to_vec(),
            vertex_count: 34,
            grids: vec![grid],
            positions: (0..key_times.len())
                .flat_map(key)
                .map(|(k, station, side)| at(k, station) + side)
                .collect(),
            ..DicedMesh::default()
        });
        let mut part = Part::with_room([grid].iter(), true);
        let rows = mesh.grid_rows(0);
        let how = How {
            singles: true,
            upright: false,
        };
        let added = part.add(Level::best(), 0, &rows, &mut Vec::new(), how);
        (added, part)
    }

    #[test]
    fn a_strand_is_traced_whole_or_not_at_all() {
        let leans = |_, station: u16| Vec3::splat(station.into());
        let (added, part) = strand(&[0.0, 0.01, 1.0], leans);
        assert_eq!((added, part.items.len(), part.strips), (Some(()), 16, 16));
        // Bounds at the inner key raise those at the ends too far, also of the last 8 micropolygons alone.
        for station in [2, 9, 15] {
            let far = |k: usize, s: u16| match (k, s == station) {
                (1, true) => Vec3::X * COORDINATE_LIMIT * 0.9,
                (2, true) => Vec3::X * COORDINATE_LIMIT * 0.5,
                _ => leans(k, s),
            };
            let (added, part) = strand(&[0.0, 0.01, 1.0], far);
            assert_eq!(added, None, "{station}");
            assert!(part.items.is_empty() && part.blocks.is_empty() && part.strips == 0);
            assert_eq!(part.bounds, LinearBox::EMPTY);
        }
    }

    #[test]
    fn strands_that_fill_their_box_are_blocks() {
        // Along an axis, boxes of micropolygons have all of the area, those of the first half most of it.
        let straight = |_, s: u16| Vec3::X * (f32::from(s.min(8)) + 0.1 * f32::from(s));
        let (added, part) = strand(&[0.0, 1.0], straight);
        assert_eq!((added, part.strips), (Some(()), 0));
        assert!(!part.blocks.is_empty() && part.items.len() == part.blocks.len());
        // Half of it is along an axis, and leans then.
        let bent = |_, s: u16| {
            Vec3::new(
                s.into(),
                s.saturating_sub(8).into(),
                s.saturating_sub(8).into(),
            )
        };
        let (added, part) = strand(&[0.0, 1.0], bent);
        assert_eq!((added, part.strips), (Some(()), 16));
    }

    /// Of grids that are bent, none of whose blocks has a frame, and flat ones that lean after them, all of whose blocks would.
    #[test]
    fn frames_are_tried_for_fewer_blocks_where_they_were_tried_in_vain() {
        const RATE: u16 = 16;
        const BENT: u32 = 8;
        let grids: Vec<Grid> = (0..20)
            .map(|element| Grid {
                first_vertex: element * u32::from(RATE + 1).pow(2),
                element,
                nu: RATE,
                nv: RATE,
            })
            .collect();
        let vertex = |grid: u32, i: u16, j: u16| {
            let [x, y] = [i, j].map(|i| f32::from(i) / f32::from(RATE));
            let bent = 8.0 * (x - 0.5) * (y - 0.5) * (x + y);
            match grid < BENT {
                true => Vec3::new(x, y, bent),
                false => Vec3::new(x, y, x),
            }
        };
        let side = || 0..=RATE;
        let positions = grids.iter().flat_map(|grid| {
            side().flat_map(move |j| side().map(move |i| vertex(grid.element, i, j)))
        });
        let mesh = PlanarMesh::from(DicedMesh {
            key_times: vec![0.0],
            vertex_count: grids.len() * usize::from(RATE + 1).pow(2),
            positions: positions.collect(),
            grids,
            ..DicedMesh::default()
        });
        let mut part = Part::<StaticSlabs>::with_room(mesh.grids.iter(), false);
        for g in 0..mesh.grids.len() {
            let rows = mesh.grid_rows(g);
            let how = How {
                singles: false,
                upright: false,
            };
            part.add(Level::best(), g as u32, &rows, &mut Vec::new(), how)
                .expect("it can be traced");
        }
        let of_bent = part.blocks.iter().filter(|block| block.span.grid < BENT);
        let (bent, flat) = part.blocks.split_at(of_bent.count());
        assert_eq!((bent.len(), flat.len()), (32, 48));
        assert!(bent.iter().all(|block| block.frame == 0));
        // The 36th is the first that is tried again.
        let passed_over = flat.iter().take_while(|block| block.frame == 0).count();
        assert_eq!(passed_over, 3);
        assert!(flat[3..].iter().all(|block| block.frame != 0));
    }
}
