//! The first splits of many items: over the cells of a regular grid, so that items are read three times in all rather
//! than twice a level, and most often copied only into a thread's caches.
//!
//! Cells hold a few items each, by their centres, and know what these extend over, exactly. Ranges of cells are split like
//! ranges of items, as long as there are so many cells that planes between them are as good as those
//! between items; after Pantaleoni and Luebke, "HLBVH: Hierarchical LBVH Construction for Real-Time Ray Tracing of Dynamic
//! Geometry", HPG 2010, and Garanzha, Pantaleoni, McAllister, "Simpler and Faster HLBVH with Work Queues", HPG 2011.

use std::ops::RangeInclusive;

use hdtrapeze_simd::{Float, Kernel, Level, Simd};
use rayon::prelude::*;

use super::bins::Places;
use super::build::PARALLEL_ITEMS;
use super::extent::{Extent, Piece};
use super::sorted::{Hull, Sorted};
use super::split::{Halves, split_pieces};

/// Fewer items are split one by one.
pub const COARSE_ITEMS: usize = 4 * PARALLEL_ITEMS;
/// Items of a cell on average, where they fill the grid.
const CELL_ITEMS: usize = 16;
/// Cells at most: along one axis, numbers of so many are exact.
const MOST_CELLS: usize = 1 << 22;
/// Ranges of fewer cells are split by items.
const LEAST_CELLS: usize = 64;
/// Splits below each other, at most.
const DEPTH: usize = 32;
/// Regions that are aimed at: one thread fills the cells of one, a run of numbers.
const REGIONS: usize = 128;
/// Cells of a region, between these.
const REGION_CELLS: RangeInclusive<usize> = 256..=4096;
/// Chunks whose items one thread sorts into regions.
const GROUP_CHUNKS: usize = 16;

/// A split that is known before its range is reached, and those below it.
pub struct Known<H> {
    /// Items on both sides.
    pub halves: Halves<H>,
    /// Splits of the sides.
    pub below: [Option<Box<Known<H>>>; 2],
}

/// Items in the order of their splits.
pub struct Coarse<'a, H: Hull> {
    /// All of them.
    pub chunks: Chunks<'a, H>,
    /// Their numbers, in that order.
    pub order: Vec<u32>,
    /// What they extend over.
    pub extent: Extent<H>,
    /// The first split, unless all lie in a few cells.
    pub known: Option<Box<Known<H>>>,
}

/// Items of a cell: a range of an array.
#[derive(Clone, Copy)]
struct Cell<H> {
    extent: Extent<H>,
    first: u32,
    count: u32,
}

impl<H: Hull> Piece<H> for Cell<H> {
    #[inline(always)]
    fn bounds(&self) -> &H {
        &self.extent.bounds
    }
    #[inline(always)]
    fn centres<S: Simd>(&self, simd: S) -> S::F8 {
        self.extent.centres(simd)
    }
    #[inline(always)]
    fn place<S: Simd>(&self, simd: S) -> S::F8 {
        let centres = self.extent.centres(simd);
        (centres - simd.halves_swapped(centres)) * simd.all8(0.5)
    }
    #[inline(always)]
    fn count(&self) -> u32 {
        self.count
    }
}

/// Items in chunks of up to [`PARALLEL_ITEMS`]. An item is known by the number of its chunk and, in the last
/// [`CHUNK_BITS`], its place there.
pub struct Chunks<'a, H: Hull>(Vec<&'a [Sorted<H>]>);

/// Items that are asked for before they are read.
const AHEAD: usize = 16;

const CHUNK_BITS: u32 = PARALLEL_ITEMS.ilog2();
const _: () = assert!(PARALLEL_ITEMS.is_power_of_two());

impl<'a, H: Hull> Chunks<'a, H> {
    /// The item of a number.
    #[inline(always)]
    pub fn item(&self, number: u32) -> &'a Sorted<H> {
        &self.0[(number >> CHUNK_BITS) as usize][number as usize % PARALLEL_ITEMS]
    }

    /// The item of a number in a list. Others that follow are asked for from memory.
    #[inline(always)]
    pub fn item_of<S: Simd>(&self, simd: S, numbers: &[u32], at: usize) -> &'a Sorted<H> {
        if let Some(&ahead) = numbers.get(at + AHEAD) {
            let chunk = self.0[(ahead >> CHUNK_BITS) as usize];
            simd.expect(chunk, ahead as usize % PARALLEL_ITEMS);
        }
        self.item(numbers[at])
    }

    fn len(&self) -> usize {
        self.0.iter().map(|chunk| chunk.len()).sum()
    }
}

/// True where there are numbers for all items of these parts.
pub fn numbered<H: Hull>(parts: &[Vec<Sorted<H>>]) -> bool {
    let chunks = parts.iter().map(|part| part.len().div_ceil(PARALLEL_ITEMS));
    chunks.sum::<usize>() <= (u32::MAX >> CHUNK_BITS) as usize
}

/// Splits items, which are given in parts, as far as cells are good for.
pub fn coarse<H: Hull>(level: Level, parts: &[Vec<Sorted<H>>]) -> Coarse<'_, H> {
    let chunks = parts.iter().flat_map(|part| part.chunks(PARALLEL_ITEMS));
    let chunks = Chunks(chunks.collect());
    let extent = Extent::of_all(level, &chunks.0);
    let raster = Raster::over(&extent, chunks.len());
    let (order, mut cells) = by_cell(level, &chunks, &raster);
    let known = divide(level, &mut cells, &extent, 0);
    let order = in_order(&cells, &order);
    Coarse {
        chunks,
        order,
        extent,
        known,
    }
}

/// The cells of a grid.
struct Raster {
    places: Places,
    /// Powers of two.
    along: [usize; 3],
    /// Cells of a region.
    region: usize,
}

impl Raster {
    fn over<H: Hull>(extent: &Extent<H>, items: usize) -> Self {
        let spans = extent.spans();
        let mut along = [1usize; 3];
        let most = (items / CELL_ITEMS).min(MOST_CELLS);
        while along.iter().product::<usize>() < most {
            // Cells become cubes.
            let size = |a: usize| spans[a] / along[a] as f32;
            let longest = (1..3).fold(0, |a, b| if size(b) > size(a) { b } else { a });
            along[longest] *= 2;
        }
        let region = along.iter().product::<usize>() / REGIONS;
        Self {
            places: Places::new(extent, along),
            along,
            region: region.clamp(*REGION_CELLS.start(), *REGION_CELLS.end()),
        }
    }

    /// The cell of an item.
    #[inline(always)]
    fn number<S: Simd, H: Hull>(&self, simd: S, item: &Sorted<H>) -> u32 {
        let [nx, ny, nz] = self.along;
        let [x, y, z] = self.places.numbers(simd, item.place(simd));
        // Whatever rounding does, the cell exists.
        let [x, y, z] = [x.min(nx - 1), y.min(ny - 1), z.min(nz - 1)];
        ((z * ny + y) * nx + x) as u32
    }

    fn region_count(&self) -> usize {
        self.along.iter().product::<usize>().div_ceil(self.region)
    }
}

/// The numbers of all items by cell, in each in their own order, and cells that hold any.
fn by_cell<H: Hull>(
    level: Level,
    chunks: &Chunks<'_, H>,
    raster: &Raster,
) -> (Vec<u32>, Vec<Cell<H>>) {
    let groups = chunks.0.par_chunks(GROUP_CHUNKS).enumerate();
    let groups = groups.map(|(number, group)| {
        level.run(ByRegion {
            first: number * GROUP_CHUNKS,
            group,
            raster,
        })
    });
    let groups: Vec<Group> = groups.collect();
    let mut order = vec![0u32; chunks.len()];
    let (mut rest, mut first) = (&mut order[..], 0);
    let mut regions = Vec::with_capacity(raster.region_count());
    for number in 0..raster.region_count() {
        let count = groups.iter().map(|group| group.region(number).len()).sum();
        let (own, after) = std::mem::take(&mut rest).split_at_mut(count);
        regions.push((number, first, own));
        (rest, first) = (after, first + count as u32);
    }
    let regions = regions.into_par_iter().map(|(number, first, order)| {
        level.run(InRegion {
            chunks,
            groups: &groups,
            cells: raster.region,
            number,
            first,
            order,
        })
    });
    let cells: Vec<Vec<Cell<H>>> = regions.collect();
    let parts = cells.iter().map(Vec::as_slice).collect();
    let cells = hdtrapeze_pages::joined(parts, |_, cell| *cell);
    (order, cells)
}

/// Some chunks' items, by region.
struct Group {
    items: Vec<Placed>,
    /// Where each region begins, and all end.
    starts: Vec<u32>,
}

impl Group {
    fn region(&self, number: usize) -> &[Placed] {
        &self.items[self.starts[number] as usize..self.starts[number + 1] as usize]
    }
}

/// An item's number, and its cell's.
#[derive(Clone, Copy, Default)]
struct Placed {
    item: u32,
    cell: u32,
}

/// From how many there are of each: where each begins, and all end.
fn starts(counts: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut sum = 0;
    let mut starts: Vec<u32> = counts
        .map(|count| {
            sum += count;
            sum - count
        })
        .collect();
    starts.push(sum);
    starts
}

struct ByRegion<'a, H: Hull> {
    /// The first chunk's number.
    first: usize,
    group: &'a [&'a [Sorted<H>]],
    raster: &'a Raster,
}

impl<H: Hull> Kernel for ByRegion<'_, H> {
    type Output = Group;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Group {
        let count = self.group.iter().map(|chunk| chunk.len()).sum();
        let mut given = Vec::with_capacity(count);
        let bits = self.raster.region.ilog2();
        let mut counts = vec![0u32; self.raster.region_count()];
        for (chunk, items) in (self.first as u32..).zip(self.group) {
            for (item, own) in (chunk << CHUNK_BITS..).zip(*items) {
                let cell = self.raster.number(simd, own);
                counts[(cell >> bits) as usize] += 1;
                given.push(Placed { item, cell });
            }
        }
        let starts = starts(counts.into_iter());
        let mut next = starts.clone();
        let mut items = vec![Placed::default(); count];
        for placed in given {
            let at = &mut next[(placed.cell >> bits) as usize];
            items[*at as usize] = placed;
            *at += 1;
        }
        Group { items, starts }
    }
}

struct InRegion<'a, H: Hull> {
    chunks: &'a Chunks<'a, H>,
    groups: &'a [Group],
    /// Cells of a region.
    cells: usize,
    number: usize,
    /// Items of regions before it.
    first: u32,
    /// For the numbers of its items.
    order: &'a mut [u32],
}

impl<H: Hull> Kernel for InRegion<'_, H> {
    type Output = Vec<Cell<H>>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<Cell<H>> {
        let Self { chunks, order, .. } = self;
        let items = || {
            self.groups
                .iter()
                .flat_map(|group| group.region(self.number))
        };
        let mut counts = vec![0u32; self.cells];
        for placed in items() {
            counts[placed.cell as usize & (self.cells - 1)] += 1;
        }
        let filled = counts.iter().filter(|&&count| count > 0).count();
        let starts = starts(counts.into_iter());
        let mut next = starts.clone();
        for placed in items() {
            let at = &mut next[placed.cell as usize & (self.cells - 1)];
            order[*at as usize] = placed.item;
            *at += 1;
        }
        let mut cells = Vec::with_capacity(filled);
        for ends in starts.windows(2).filter(|ends| ends[0] < ends[1]) {
            let mut bounds = H::EMPTY.load(simd);
            let mut centres = simd.all8(f32::INFINITY);
            for at in ends[0] as usize..ends[1] as usize {
                let item = chunks.item_of(simd, order, at);
                bounds = H::union::<S>(item.bounds.load(simd), bounds);
                centres = item.centres(simd).min(centres);
            }
            cells.push(Cell {
                extent: Extent::around::<S>(bounds, centres),
                first: self.first + ends[0],
                count: ends[1] - ends[0],
            });
        }
        cells
    }
}

/// The numbers of items in the order of their cells.
fn in_order<H: Hull>(cells: &[Cell<H>], by_cell: &[u32]) -> Vec<u32> {
    let mut order = vec![0u32; by_cell.len()];
    let mut rest = &mut order[..];
    let counts = cells.par_chunks(PARALLEL_ITEMS);
    let counts = counts.map(|cells| cells.iter().map(|cell| cell.count as usize).sum());
    let counts: Vec<usize> = counts.collect();
    let mut parts = Vec::with_capacity(counts.len());
    for (count, cells) in counts.into_iter().zip(cells.chunks(PARALLEL_ITEMS)) {
        let (own, after) = std::mem::take(&mut rest).split_at_mut(count);
        parts.push((own, cells));
        rest = after;
    }
    parts.into_par_iter().for_each(|(mut order, cells)| {
        for cell in cells {
            let (own, after) = std::mem::take(&mut order).split_at_mut(cell.count as usize);
            own.copy_from_slice(&by_cell[cell.first as usize..][..own.len()]);
            order = after;
        }
    });
    order
}

fn divide<H: Hull>(
    level: Level,
    cells: &mut [Cell<H>],
    extent: &Extent<H>,
    depth: usize,
) -> Option<Box<Known<H>>> {
    if cells.len() < LEAST_CELLS || depth >= DEPTH {
        return None;
    }
    let (middle, halves) = split_pieces(level, cells, extent)?;
    let (left, right) = cells.split_at_mut(middle);
    let [a, b] = &halves.extents;
    let below = rayon::join(
        || divide(level, left, a, depth + 1),
        || divide(level, right, b, depth + 1),
    );
    Some(Box::new(Known {
        halves,
        below: below.into(),
    }))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::LinearBox;
    use super::super::build::Item;
    use super::super::sorted::{LinearHull, StaticHull};
    use super::*;

    /// A number between 0 and 1 for each item and each `k`.
    fn number(i: u32, k: u32) -> f32 {
        (i.wrapping_mul(2 * k + 1).wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32
    }

    /// Small boxes that move, in a slab, in parts of all lengths.
    fn parts<H: Hull>(count: u32, slab: Vec3) -> Vec<Vec<Sorted<H>>> {
        let item = |id: u32| {
            let at = |k: u32| Vec3::new(number(id, k), number(id, k + 1), number(id, k + 2));
            let (lo0, lo1) = (at(11) * slab, at(11) * slab + at(23) * 0.1);
            let bounds = LinearBox {
                lo0,
                hi0: lo0 + at(31) * 0.01,
                lo1,
                hi1: lo1 + at(41) * 0.01,
            };
            Sorted::of(&Item { bounds, id })
        };
        let items: Vec<Sorted<H>> = (0..count).map(item).collect();
        let (few, many) = items.split_at(7);
        let (many, most) = many.split_at(PARALLEL_ITEMS);
        vec![few.to_vec(), Vec::new(), many.to_vec(), most.to_vec()]
    }

    /// Each side extends over its items, no more and no less; returns the splits.
    fn check<H: Hull>(items: &[Sorted<H>], known: &Known<H>) -> usize {
        let middle = known.halves.middle;
        assert!(middle > 0 && middle < items.len());
        let (left, right) = items.split_at(middle);
        let mut splits = 1;
        for (side, items) in [left, right].into_iter().enumerate() {
            let (found, want) = (
                &known.halves.extents[side],
                Extent::of(Level::SCALAR, items),
            );
            let bits = |e: &Extent<H>| {
                let boxes = H::boxes(hdtrapeze_simd::Scalar, [&e.bounds; 8]).to_boxes();
                let centres = e.centres(hdtrapeze_simd::Scalar).to_array();
                (boxes[0], centres.map(f32::to_bits))
            };
            assert_eq!(bits(found), bits(&want));
            if let Some(known) = &known.below[side] {
                splits += check(items, known);
            }
        }
        splits
    }

    fn keeps<H: Hull>(slab: Vec3) {
        // Several groups of chunks and many regions of cells.
        let count = 4 * (GROUP_CHUNKS * PARALLEL_ITEMS) as u32 + 5;
        for level in Level::available() {
            let parts = parts::<H>(count, slab);
            let coarse = coarse(level, &parts);
            let known = coarse.known.as_deref().expect("many cells");
            let items = coarse.order.iter().map(|&i| *coarse.chunks.item(i));
            let items: Vec<Sorted<H>> = items.collect();
            let splits = check(&items, known);
            assert!(splits > 10, "{splits}");
            let mut ids: Vec<u32> = items.iter().map(Sorted::id).collect();
            ids.sort_unstable();
            assert!(ids.into_iter().eq(0..count));
        }
    }

    #[test]
    fn sides_extend_over_their_items() {
        for slab in [Vec3::ONE, Vec3::new(3.0, 1e-3, 1.0), Vec3::X] {
            keeps::<StaticHull>(slab);
            keeps::<LinearHull>(slab);
        }
    }

    #[test]
    fn what_lies_in_one_cell_is_not_split() {
        let same = |parts: Vec<Vec<Sorted<StaticHull>>>| {
            let one = parts[0][0];
            parts
                .into_iter()
                .map(|part| vec![one; part.len()])
                .collect::<Vec<_>>()
        };
        let parts = same(parts(COARSE_ITEMS as u32, Vec3::ONE));
        let coarse = coarse(Level::best(), &parts);
        assert!(coarse.known.is_none() && coarse.order.len() == COARSE_ITEMS);
    }
}
