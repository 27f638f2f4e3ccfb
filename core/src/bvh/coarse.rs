//! The first splits of many items: over the cells of a regular grid, so that items are read four times in all rather
//! than twice a level, and most often copied only into a thread's caches.
//!
//! Cells hold a few items each, by their centres, and know what these extend over, exactly. *Regions* are runs of cells, which are near each
//! other. Items are sorted by region where they are, in chunks that caches hold; then, a region at a time, what each chunk has of it is
//! read side by side, and counted by cell. So nothing is read from all over memory but what is copied in the end, and of that
//! neighbours are near each other. Ranges of cells are split like
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
/// Parts of fewer items on average are joined, or regions would have next to nothing in each.
const LEAST_PART: usize = PARALLEL_ITEMS / 4;

/// A split that is known before its range is reached, and those below it.
pub struct Known<H> {
    /// Items on both sides.
    pub halves: Halves<H>,
    /// Cells on the first.
    pub cells: usize,
    /// Splits of the sides.
    pub below: [Option<Box<Known<H>>>; 2],
}

/// Items in the order of their splits.
pub struct Coarse<'a, H: Hull> {
    /// Where they are.
    pub listed: Listed<'a, H>,
    /// Cells that hold any, in that order.
    pub cells: Vec<Cell<H>>,
    /// What they extend over.
    pub extent: Extent<H>,
    /// The first split, unless all lie in a few cells.
    pub known: Option<Box<Known<H>>>,
}

/// Items by cell.
pub struct Listed<'a, H: Hull> {
    chunks: Chunks<'a, H>,
    /// Their numbers.
    order: Vec<u32>,
}

impl<'a, H: Hull> Listed<'a, H> {
    /// The first item of some cells.
    pub fn first(&self, cells: &[Cell<H>]) -> Option<&'a Sorted<H>> {
        let number = self.order[cells.first()?.first as usize];
        Some(self.chunks.item(number))
    }

    /// Copies of the items of cells, which are so many.
    pub fn copied(&self, level: Level, cells: &[Cell<H>], count: usize) -> Vec<Sorted<H>> {
        let mut numbers = Vec::with_capacity(count);
        for cell in cells {
            numbers.extend_from_slice(&self.order[cell.first as usize..][..cell.count as usize]);
        }
        let copied = |numbers| {
            level.run(Copied {
                numbers,
                chunks: &self.chunks,
            })
        };
        if count <= PARALLEL_ITEMS {
            return copied(&numbers[..]);
        }
        // Few cells, or as many items are not copied together: most follow each other.
        let numbers = numbers.par_iter().with_min_len(PARALLEL_ITEMS);
        numbers.map(|&number| *self.chunks.item(number)).collect()
    }
}

/// Items by their numbers.
struct Copied<'a, H: Hull> {
    numbers: &'a [u32],
    chunks: &'a Chunks<'a, H>,
}

impl<H: Hull> Kernel for Copied<'_, H> {
    type Output = Vec<Sorted<H>>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<Sorted<H>> {
        let Self { numbers, chunks } = self;
        let item = |at| *chunks.item_of(simd, numbers, at);
        (0..numbers.len()).map(item).collect()
    }
}

/// Items of a cell: a range of those that are [listed](Listed).
#[derive(Clone, Copy)]
pub struct Cell<H: Hull> {
    extent: Extent<H>,
    first: u32,
    count: u32,
}

impl<H: Hull> Cell<H> {
    const EMPTY: Self = Self {
        extent: Extent::EMPTY,
        first: 0,
        count: 0,
    };
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
struct Chunks<'a, H: Hull>(Vec<&'a [Sorted<H>]>);

/// Items that are asked for before they are read.
const AHEAD: usize = 48;
/// The same of chunks, where those of a region are read.
const CHUNKS_AHEAD: usize = 8;
/// Bytes that come from memory at once.
const LINE: usize = 64;

const CHUNK_BITS: u32 = PARALLEL_ITEMS.ilog2();
const _: () = assert!(PARALLEL_ITEMS.is_power_of_two() && PARALLEL_ITEMS <= u16::MAX as usize);
const _: () =
    assert!(*REGION_CELLS.end() <= 1 << 16 && MOST_CELLS / *REGION_CELLS.end() <= 1 << 16);

impl<'a, H: Hull> Chunks<'a, H> {
    #[inline(always)]
    fn item(&self, number: u32) -> &'a Sorted<H> {
        &self.0[(number >> CHUNK_BITS) as usize][number as usize % PARALLEL_ITEMS]
    }

    /// The item of a number in a list. Others that follow are asked for from memory.
    #[inline(always)]
    fn item_of<S: Simd>(&self, simd: S, numbers: &[u32], at: usize) -> &'a Sorted<H> {
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

/// Splits items, which are given in parts and change places in these, as far as cells are good for.
pub fn coarse<H: Hull>(level: Level, parts: &mut Vec<Vec<Sorted<H>>>) -> Coarse<'_, H> {
    let count = parts.iter().map(Vec::len).sum::<usize>();
    if count < LEAST_PART * parts.len() {
        let all = parts.iter().map(Vec::as_slice).collect();
        *parts = vec![hdtrapeze_pages::joined(all, |_, item| *item)];
    }
    let chunks: Vec<_> = chunks(parts).collect();
    let extent = Extent::of_all(level, &chunks);
    let raster = Raster::over(&extent, count);
    let chunks = parts
        .par_iter_mut()
        .flat_map(|part| part.par_chunks_mut(PARALLEL_ITEMS));
    let starts = chunks.map(|items| {
        level.run(ByRegion {
            items,
            raster: &raster,
        })
    });
    let starts: Vec<Vec<u16>> = starts.collect();
    let chunks = Chunks(self::chunks(parts).collect());
    let (order, mut cells) = by_cell(level, &chunks, &starts, &raster);
    let known = divide(level, &mut cells, &extent, 0);
    Coarse {
        listed: Listed { chunks, order },
        cells,
        extent,
        known,
    }
}

/// Items in pieces that their numbers are made of.
fn chunks<H: Hull>(parts: &[Vec<Sorted<H>>]) -> impl Iterator<Item = &[Sorted<H>]> {
    parts.iter().flat_map(|part| part.chunks(PARALLEL_ITEMS))
}

/// The cells of a grid. Their numbers are in the order of a tree that halves it again and again, so that a run of them is near
/// each other.
struct Raster {
    places: Places,
    /// What each place along an axis adds to the number of a cell: powers of two of them.
    numbers: [Vec<u32>; 3],
    /// Cells of a region, which is a run of numbers.
    region: usize,
    regions: usize,
}

impl Raster {
    fn over<H: Hull>(extent: &Extent<H>, items: usize) -> Self {
        let spans = extent.spans();
        let mut along = [1usize; 3];
        // The axes that are halved, one after the other.
        let mut halved = Vec::new();
        let most = (items / CELL_ITEMS).min(MOST_CELLS);
        while along.iter().product::<usize>() < most {
            // Cells become cubes.
            let size = |a: usize| spans[a] / along[a] as f32;
            let longest = (1..3).fold(0, |a, b| if size(b) > size(a) { b } else { a });
            along[longest] *= 2;
            halved.push(longest);
        }
        let cells = 1usize << halved.len();
        let region = (cells / REGIONS).clamp(*REGION_CELLS.start(), *REGION_CELLS.end());
        Self {
            places: Places::new(extent, along),
            numbers: [0, 1, 2].map(|axis| numbers_along(axis, along[axis], &halved)),
            region,
            regions: cells.div_ceil(region),
        }
    }

    /// The cell of an item.
    #[inline(always)]
    fn number<S: Simd, H: Hull>(&self, simd: S, item: &Sorted<H>) -> usize {
        let places = self.places.numbers(simd, item.place(simd));
        let mut number = 0;
        for (place, numbers) in places.into_iter().zip(&self.numbers) {
            // Whatever rounding does, the cell exists.
            number |= numbers[place.min(numbers.len() - 1)];
        }
        number as usize
    }
}

/// What places along an axis add to the numbers of cells: the bits of the place, from the highest on, where this axis was `halved`.
fn numbers_along(axis: usize, places: usize, halved: &[usize]) -> Vec<u32> {
    let number = |place: usize| {
        let (mut number, mut bits) = (0u32, places.ilog2());
        for &other in halved {
            number <<= 1;
            if other == axis {
                bits -= 1;
                number |= (place >> bits & 1) as u32;
            }
        }
        number
    };
    (0..places).map(number).collect()
}

/// Sorts the items of a chunk by region; returns where each begins, and all end.
struct ByRegion<'a, H: Hull> {
    items: &'a mut [Sorted<H>],
    raster: &'a Raster,
}

impl<H: Hull> Kernel for ByRegion<'_, H> {
    type Output = Vec<u16>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<u16> {
        let Self { items, raster } = self;
        let bits = raster.region.ilog2();
        let mut counts = vec![0u16; raster.regions];
        let mut regions = [0u16; PARALLEL_ITEMS];
        for (item, region) in items.iter().zip(&mut regions) {
            *region = (raster.number(simd, item) >> bits) as u16;
            counts[usize::from(*region)] += 1;
        }
        let mut sum = 0;
        let mut starts = Vec::with_capacity(raster.regions + 1);
        for count in &mut counts {
            starts.push(sum);
            sum += std::mem::replace(count, sum);
        }
        starts.push(sum);
        let given = items.to_vec();
        for (item, region) in given.iter().zip(regions) {
            let next = &mut counts[usize::from(region)];
            items[usize::from(*next)] = *item;
            *next += 1;
        }
        starts
    }
}

/// The numbers of all items by cell, and cells that hold any.
fn by_cell<H: Hull>(
    level: Level,
    chunks: &Chunks<'_, H>,
    starts: &[Vec<u16>],
    raster: &Raster,
) -> (Vec<u32>, Vec<Cell<H>>) {
    let mut order = vec![0u32; chunks.len()];
    hdtrapeze_pages::expect_large(&mut order);
    let (mut rest, mut first) = (&mut order[..], 0);
    let mut regions = Vec::with_capacity(raster.regions);
    let mut counts = vec![0; raster.regions];
    for starts in starts {
        for (count, ends) in counts.iter_mut().zip(starts.windows(2)) {
            *count += usize::from(ends[1] - ends[0]);
        }
    }
    for (number, count) in counts.into_iter().enumerate() {
        let (own, after) = std::mem::take(&mut rest).split_at_mut(count);
        regions.push((number, first, own));
        (rest, first) = (after, first + count as u32);
    }
    let regions = regions.into_par_iter().map(|(number, first, order)| {
        level.run(InRegion {
            chunks,
            starts,
            raster,
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

/// Sorts the items of a region by cell.
struct InRegion<'a, H: Hull> {
    chunks: &'a Chunks<'a, H>,
    /// Where regions begin in each chunk.
    starts: &'a [Vec<u16>],
    raster: &'a Raster,
    number: usize,
    /// Items of regions before it.
    first: u32,
    /// For the numbers of its items.
    order: &'a mut [u32],
}

impl<H: Hull> InRegion<'_, H> {
    /// Asks for its items in a chunk from memory.
    #[inline(always)]
    fn expect<S: Simd>(&self, simd: S, chunk: usize) {
        if let (Some(items), Some(starts)) = (self.chunks.0.get(chunk), self.starts.get(chunk)) {
            let own = starts[self.number].into()..starts[self.number + 1].into();
            for item in own.step_by(LINE.div_ceil(size_of::<Sorted<H>>())) {
                simd.expect(items, item);
            }
        }
    }

    /// Its items in each chunk, and the number of the first.
    fn items(&self) -> impl Iterator<Item = (u32, &[Sorted<H>])> {
        let all = (0u32..).zip(&self.chunks.0).zip(self.starts);
        all.map(|((chunk, items), starts)| {
            let [start, end] = [starts[self.number], starts[self.number + 1]];
            let items = &items[usize::from(start)..usize::from(end)];
            (chunk << CHUNK_BITS | u32::from(start), items)
        })
    }
}

impl<H: Hull> Kernel for InRegion<'_, H> {
    type Output = Vec<Cell<H>>;
    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) -> Vec<Cell<H>> {
        let order = std::mem::take(&mut self.order);
        if order.is_empty() {
            return Vec::new();
        }
        let mut cells = vec![Cell::<H>::EMPTY; self.raster.region];
        let mut numbers = Vec::with_capacity(order.len());
        for (chunk, (_, items)) in self.items().enumerate() {
            self.expect(simd, chunk + CHUNKS_AHEAD);
            for item in items {
                let number = self.raster.number(simd, item);
                debug_assert_eq!(number / self.raster.region, self.number);
                let number = number % self.raster.region;
                let cell = &mut cells[number];
                let extent = &cell.extent;
                let bounds = H::union::<S>(item.bounds.load(simd), extent.bounds.load(simd));
                let centres = item.centres(simd).min(extent.centres(simd));
                cell.extent = Extent::around::<S>(bounds, centres);
                cell.count += 1;
                numbers.push(number as u16);
            }
        }
        let mut sum = 0;
        for cell in &mut cells {
            cell.first = sum;
            sum += cell.count;
        }
        let mut number = numbers.into_iter();
        for (first, items) in self.items() {
            for (item, number) in (first..).zip(number.by_ref().take(items.len())) {
                let next = &mut cells[usize::from(number)].first;
                order[*next as usize] = item;
                *next += 1;
            }
        }
        // No larger than they are: all regions' cells are there together.
        let filled = cells.iter().filter(|cell| cell.count > 0);
        let mut found = Vec::with_capacity(filled.clone().count());
        found.extend(filled.map(|cell| Cell {
            first: cell.first - cell.count + self.first,
            ..*cell
        }));
        found
    }
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
        cells: middle,
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
        // Many regions of cells.
        let count = 64 * PARALLEL_ITEMS as u32 + 5;
        for level in Level::available() {
            let mut parts = parts::<H>(count, slab);
            let coarse = coarse(level, &mut parts);
            let known = coarse.known.as_deref().expect("many cells");
            let items = coarse.listed.copied(level, &coarse.cells, count as usize);
            assert_eq!(items.len(), count as usize);
            let first = coarse.listed.first(&coarse.cells).map(Sorted::id);
            assert_eq!(first, Some(items[0].id()));
            // Each cell has its own items, and all of them.
            let raster = Raster::over(&coarse.extent, count as usize);
            let mut numbers = std::collections::HashSet::new();
            for cell in &coarse.cells {
                let own = coarse.listed.copied(level, &[*cell], cell.count as usize);
                let number = raster.number(hdtrapeze_simd::Scalar, &own[0]);
                let same = |item| raster.number(hdtrapeze_simd::Scalar, item) == number;
                assert!(own.iter().all(same) && numbers.insert(number));
            }
            let all = Extent::of(Level::SCALAR, &items);
            let centres = |e: &Extent<H>| e.centres(hdtrapeze_simd::Scalar).to_array();
            assert_eq!(centres(&coarse.extent), centres(&all));
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
    fn small_parts_are_joined_in_their_order() {
        let count = 8 * COARSE_ITEMS as u32 + 3;
        let items = parts::<StaticHull>(count, Vec3::ONE).concat();
        let mut small: Vec<Vec<_>> = items.chunks(50).map(<[_]>::to_vec).collect();
        let level = Level::best();
        let [a, b] = [&mut small, &mut vec![items]].map(|parts| {
            let coarse = coarse(level, parts);
            let items = coarse.listed.copied(level, &coarse.cells, count as usize);
            items.iter().map(Sorted::id).collect::<Vec<u32>>()
        });
        assert!(a == b && small.len() == 1);
    }

    #[test]
    fn a_run_of_cells_is_near_each_other() {
        let halved = [0, 2, 0, 1, 0, 2, 1];
        let numbers = [(0, 8), (1, 4), (2, 4)].map(|(axis, n)| numbers_along(axis, n, &halved));
        let mut places = vec![None; 128];
        for (x, y, z) in (0..8).flat_map(|x| (0..16).map(move |yz| (x, yz % 4, yz / 4))) {
            let number = numbers[0][x] | numbers[1][y] | numbers[2][z];
            assert_eq!(places[number as usize].replace([x, y, z]), None);
        }
        // The last halvings are within a run.
        for (run, size) in [(8, [2, 2, 2]), (16, [2, 4, 2]), (64, [4, 4, 4])] {
            for places in places.chunks(run) {
                for (axis, size) in size.into_iter().enumerate() {
                    let of = |place: &Option<[usize; 3]>| place.expect("each has one")[axis];
                    let least = places.iter().map(of).min();
                    let most = places.iter().map(of).max();
                    assert_eq!(most.zip(least).map(|(a, b)| a - b + 1), Some(size), "{run}");
                }
            }
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
        let mut parts = same(parts(COARSE_ITEMS as u32, Vec3::ONE));
        let coarse = coarse(Level::best(), &mut parts);
        assert!(coarse.known.is_none() && coarse.cells.len() == 1);
    }
}
