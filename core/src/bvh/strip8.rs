//! Boxes and [diagonals](super::diagonal) of up to 8 parts of a strip at once, a lane each: what [`super::group8`] and
//! [`super::radii8`] find of any groups, for those that most items of fur are of. Vectors have no lanes to spare here, where those
//! have rows of 4 micropolygons.

use std::marker::PhantomData;
use std::ops::Range;

use hdtrapeze_simd::{Float, Kernel, Level, Mask, Simd};

use super::block::{GROUPS, part_of_strip};
use super::diagonal::Diagonal;
use super::group8::{Keyed, over_shutter};
use super::lanes::Ranges8;
use super::object::loose_item;
use super::radii8::{Lines, Points, radius};
use super::sorted::{Hull, Sorted};
use super::{COORDINATE_LIMIT, LinearBox};
use crate::grid::Grid;
use crate::grid::planar::GridRows;

/// Parts of a strip as items.
pub struct Parts<H: Hull> {
    /// As many as there are parts.
    items: [Sorted<H>; GROUPS],
    count: usize,
    /// The box around all.
    pub bounds: LinearBox,
    /// The sum of their boxes' areas, each as [`LinearBox::mean_half_area`].
    pub area: f32,
}

impl<H: Hull> Parts<H> {
    /// All of them.
    pub fn items(&self) -> &[Sorted<H>] {
        &self.items[..self.count]
    }
}

/// 1 to [`GROUPS`] parts of a strip, given their [numbers](super::block::loose_slots): all of one micropolygon, or of two, but for
/// the last. The grid is number `g`, and [is bounded](super::bound::is_bounded). None where bounds are beyond [`COORDINATE_LIMIT`].
pub fn parts<H: Hull>(
    level: Level,
    g: u32,
    rows: &GridRows<'_>,
    slots: Range<u32>,
) -> Option<Parts<H>> {
    let strip = Strip { g, rows, slots };
    match part_of_strip(strip.slots.start).1 {
        1 => level.run(OfStations::<H, 2>::new(strip)),
        _ => level.run(OfStations::<H, 3>::new(strip)),
    }
}

struct Strip<'a> {
    g: u32,
    rows: &'a GridRows<'a>,
    slots: Range<u32>,
}

/// Parts between `N` stations, from side to side of the strip each.
struct OfStations<'a, H, const N: usize> {
    strip: Strip<'a>,
    kind: PhantomData<H>,
}

impl<'a, H, const N: usize> OfStations<'a, H, N> {
    fn new(strip: Strip<'a>) -> Self {
        Self {
            strip,
            kind: PhantomData,
        }
    }
}

/// Where the stations of parts are.
struct Stations<'a, S, const N: usize> {
    simd: S,
    rows: &'a GridRows<'a>,
    /// Where their first coordinates are, from those of the grid on.
    at: [[usize; GROUPS]; N],
}

impl<H: Hull, const N: usize> Kernel for OfStations<'_, H, N> {
    type Output = Option<Parts<H>>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Parts<H>> {
        let Strip { g, rows, slots } = self.strip;
        let (key_times, count) = (rows.key_times, slots.len());
        let at = stations::<N>(&rows.grid, &slots);
        let stations = Stations { simd, rows, at };
        let found = over_shutter(simd, key_times, &stations);
        let bounds = found.hull();
        // Bounds at inner keys may have raised them.
        if !(bounds.is_finite() && bounds.max_abs() < COORDINATE_LIMIT) {
            return None;
        }
        let last = key_times.len() - 1;
        let mut down = [stations.down(0), [0; 3]];
        down[1] = if last == 0 {
            down[0]
        } else {
            stations.down(last)
        };
        // So that none goes down along x at the start.
        let turned = down[0][0];
        for axis in down.iter_mut().flatten() {
            *axis ^= turned;
        }
        let start = Lines::of(simd, &found.start, down[0]);
        let end = Lines::of(simd, &found.end, down[1]);
        let radii = radius([&start, &end], key_times, &stations);
        let numbers = numbers(radii.to_array(), &down);
        let mut ids = [0; GROUPS];
        for (id, slot) in ids.iter_mut().zip(slots.start..) {
            *id = loose_item(g, slot);
        }
        let hulls = H::of8(simd, &found, &numbers, ids);
        Some(Parts {
            items: hulls.map(|bounds| Sorted { bounds }),
            count,
            bounds,
            area: found.area(simd, last > 0, count as u8),
        })
    }
}

impl<S: Simd, const N: usize> Stations<'_, S, N> {
    /// The parts that go down along each axis at a key.
    #[inline(always)]
    fn down(&self, key: usize) -> [u32; 3] {
        let ([from, _], [to, _]) = (self.row(0, key), self.row(N - 1, key));
        let zero = self.simd.all8(0.0);
        [
            (to[0] - from[0]).lt(zero).bits(),
            (to[1] - from[1]).lt(zero).bits(),
            (to[2] - from[2]).lt(zero).bits(),
        ]
    }
}

impl<S: Simd, const N: usize> Points<S::F8> for Stations<'_, S, N> {
    const ROWS: usize = N;
    #[inline(always)]
    fn row(&self, station: usize, key: usize) -> [[S::F8; 3]; 2] {
        let grid = &self.rows.grid;
        let floats = &self.rows.floats[3 * key * grid.vertex_count()..];
        sides(self.simd, grid, floats, &self.at[station])
    }
    #[inline(always)]
    fn all(&self, x: f32) -> S::F8 {
        self.simd.all8(x)
    }
}

impl<S: Simd, const N: usize> Keyed<S> for Stations<'_, S, N> {
    #[inline(always)]
    fn ranges(&self, _: S, key: usize) -> Ranges8<S::F8> {
        let [first, _] = self.row(0, key);
        let mut found = Ranges8 {
            lo: first,
            hi: first,
        };
        for station in 0..N {
            for p in self.row(station, key) {
                for (axis, x) in p.into_iter().enumerate() {
                    found.lo[axis] = x.min(found.lo[axis]);
                    found.hi[axis] = x.max(found.hi[axis]);
                }
            }
        }
        found
    }
}

/// As [`Stations::at`]; the first part stands where there are fewer than 8.
#[inline(always)]
fn stations<const N: usize>(grid: &Grid, slots: &Range<u32>) -> [[usize; GROUPS]; N] {
    let length = usize::from(grid.nu.max(grid.nv));
    // A row of vertices is a station, or a side.
    let step = if grid.nu == 1 { 6 } else { 1 };
    let mut at = [[0; GROUPS]; N];
    for lane in 0..GROUPS {
        let slot = if lane < slots.len() { lane as u32 } else { 0 };
        let (from, _) = part_of_strip(slots.start + slot);
        for (station, at) in at.iter_mut().enumerate() {
            at[lane] = step * (usize::from(from) + station).min(length);
        }
    }
    at
}

/// Both sides of a station of each part.
#[inline(always)]
fn sides<S: Simd>(simd: S, grid: &Grid, floats: &[f32], at: &[usize; GROUPS]) -> [[S::F8; 3]; 2] {
    if grid.nu == 1 {
        let mut rows = [simd.all8(0.0); GROUPS];
        for (row, &at) in rows.iter_mut().zip(at) {
            // There is more after the last.
            *row = simd.from8(&floats[at..at + 8].as_chunks().0[0]);
        }
        let [x0, x1, y0, y1, z0, z1, ..] = simd.transposed(rows);
        return [[x0, y0, z0], [x1, y1, z1]];
    }
    let columns = usize::from(grid.nu) + 1;
    let mut rows = [[simd.all8(0.0); 3]; 2];
    for (row, to) in rows.iter_mut().flatten().enumerate() {
        let mut lanes = [0.0; GROUPS];
        for (lane, &at) in lanes.iter_mut().zip(at) {
            *lane = floats[row * columns + at];
        }
        *to = simd.from8(&lanes);
    }
    rows
}

/// Diagonals [in numbers](Diagonal::to_numbers), for both ends of the shutter.
#[inline(always)]
fn numbers(radii: [f32; GROUPS], down: &[[u32; 3]; 2]) -> [[f32; GROUPS]; 2] {
    let mut numbers = [[0.0; GROUPS]; 2];
    for (lane, radius) in radii.into_iter().enumerate() {
        let own =
            |[x, y, z]: [u32; 3]| (x >> lane & 1) | (y >> lane & 1) << 1 | (z >> lane & 1) << 2;
        let diagonal = Diagonal {
            radius,
            down: down.map(own),
        };
        [numbers[0][lane], numbers[1][lane]] = diagonal.to_numbers();
    }
    numbers
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};
    use hdtrapeze_simd::Scalar;

    use super::super::block::{is_small, loose, loose_slots};
    use super::super::bound::bound_loose;
    use super::super::sorted::{LinearHull, StaticHull};
    use super::*;
    use crate::grid::{DicedMesh, PlanarMesh};

    /// A strip that winds, of `length` micropolygons, along a row of its grid or across rows.
    fn strip(length: u16, along: bool, key_times: &[f32]) -> PlanarMesh {
        let number = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32 - 0.5;
        let point = |seed| Vec3::new(number(seed), number(seed + 1), number(seed + 2));
        let (nu, nv) = if along { (length, 1) } else { (1, length) };
        let mut mesh = DicedMesh {
            key_times: key_times.to_vec(),
            vertex_count: (usize::from(length) + 1) * 2,
            grids: vec![Grid {
                first_vertex: 0,
                element: 0,
                nu,
                nv,
            }],
            ..DicedMesh::default()
        };
        for k in 0..key_times.len() as u32 {
            for vertex in 0..mesh.vertex_count as u32 {
                let (station, side) = match along {
                    true => (vertex % (u32::from(nu) + 1), vertex / (u32::from(nu) + 1)),
                    false => (vertex / 2, vertex % 2),
                };
                let winding = point(100 * u32::from(length) + 7 * station + 1000 * k);
                mesh.positions
                    .push(winding + Vec3::Y * station as f32 * 0.3 + Vec3::Z * side as f32 * 0.05);
            }
        }
        PlanarMesh::from(mesh)
    }

    fn bits(b: &LinearBox) -> [[u32; 3]; 4] {
        [b.lo0, b.hi0, b.lo1, b.hi1].map(|v| v.to_array().map(f32::to_bits))
    }

    fn whole<H: Hull>(hull: &H) -> LinearBox {
        H::boxes(Scalar, [hull; 8]).to_boxes()[0]
    }

    /// How far the vertices of a part are from diagonals of its box, by their numbers for both ends, in f64.
    fn farthest(rows: &GridRows<'_>, slot: u32, b: &LinearBox, [start, end]: [f32; 2]) -> f64 {
        let ends = |number: f32, lo: Vec3, hi: Vec3| {
            let way = Diagonal::way(number, hi - lo).as_dvec3();
            let middle = (lo.as_dvec3() + hi.as_dvec3()) * 0.5;
            [middle - way * 0.5, way]
        };
        let ([a0, w0], [a1, w1]) = (ends(start, b.lo0, b.hi0), ends(end, b.lo1, b.hi1));
        let rect = loose(&rows.grid, slot);
        let last = rows.key_times.len() - 1;
        let mut most = 0.0f64;
        for j in rect.j..=rect.j + rect.h {
            for i in rect.i..=rect.i + rect.w {
                let at = |k: usize| rows.position(k, i.into(), j.into()).as_dvec3();
                let s = (at(0) + at(last) - a0 - a1).dot(w0 + w1) / (w0 + w1).length_squared();
                let s = s.clamp(0.0, 1.0);
                for (k, &time) in rows.key_times.iter().enumerate() {
                    let time = DVec3::splat(f64::from(time));
                    let line = a0 + (a1 - a0) * time + (w0 + (w1 - w0) * time) * s;
                    most = most.max((at(k) - line).abs().max_element());
                }
            }
        }
        most
    }

    fn check<H: Hull>(key_times: &[f32]) -> usize {
        let mut checked = 0;
        // How far all are from their diagonals, and from others: with an axis or two turned at both ends, at the end
        // alone, and with that of the start at the end.
        let mut sums = [0.0; 8];
        for (length, along, singles) in (3..=16)
            .flat_map(|length| [false, true].map(|along| (length, along)))
            .flat_map(|(length, along)| [false, true].map(|singles| (length, along, singles)))
        {
            let mesh = strip(length, along, key_times);
            let rows = mesh.grid_rows(0);
            if is_small(&rows.grid) {
                continue;
            }
            let mut slots = loose_slots(&rows.grid, singles);
            while !slots.is_empty() {
                let some = slots.start..slots.end.min(slots.start + GROUPS as u32);
                slots.start = some.end;
                let boxes = bound_loose(Level::SCALAR, &rows, some.clone()).expect("bounded");
                for level in Level::available() {
                    let found = parts::<H>(level, 77, &rows, some.clone()).expect("bounded");
                    assert_eq!(found.items().len(), some.len());
                    let (mut around, mut area) = (LinearBox::EMPTY, 0.0);
                    for ((slot, item), b) in some.clone().zip(found.items()).zip(&boxes) {
                        assert_eq!(item.id(), loose_item(77, slot));
                        let own = whole(&item.bounds);
                        assert_eq!(bits(&own), bits(&whole(&H::of(b))));
                        (around, area) = (around.union(b), area + own.mean_half_area());
                        let radius = f64::from(item.bounds.diagonal()[0]);
                        let diagonals = item.bounds.diagonal();
                        let farthest = |numbers| farthest(&rows, slot, &own, numbers);
                        let turned = |ends: [u32; 2]| {
                            let [start, end] = diagonals.map(f32::to_bits);
                            [start ^ ends[0], end ^ ends[1]].map(f32::from_bits)
                        };
                        let at_start = diagonals[0].to_bits() & 7;
                        let as_start = [0, (diagonals[1].to_bits() & 7) ^ at_start];
                        let ends = [
                            [0, 0],
                            [2, 2],
                            [4, 4],
                            [6, 6],
                            [0, 2],
                            [0, 4],
                            [0, 6],
                            as_start,
                        ];
                        for (sum, ends) in sums.iter_mut().zip(ends) {
                            *sum += farthest(turned(ends));
                        }
                        let farthest = farthest(diagonals);
                        assert!(
                            (farthest - 1e-6..farthest + 1e-5).contains(&radius),
                            "{radius} {farthest}, {length} {along} {slot}"
                        );
                        checked += 1;
                    }
                    assert_eq!(bits(&found.bounds), bits(&around));
                    assert!((found.area / area - 1.0).abs() < 1e-5);
                }
            }
        }
        let own = sums[0];
        assert!(sums[1..4].iter().all(|&sum| sum > 1.1 * own), "{sums:?}");
        assert!(
            key_times.len() == 1 || sums[4..].iter().all(|&sum| sum > 1.05 * own),
            "{sums:?}"
        );
        checked
    }

    #[test]
    fn parts_are_bounded_as_any_groups_are_and_near_to_their_diagonals() {
        assert!(check::<StaticHull>(&[0.0]) > 200);
        assert!(check::<LinearHull>(&[0.0]) > 200);
        assert!(check::<LinearHull>(&[0.0, 1.0]) > 200);
        assert!(check::<LinearHull>(&[0.0, 0.3, 0.7, 1.0]) > 200);
    }

    #[test]
    fn absurd_parts_are_refused() {
        // Bounds at the inner key raise those at both ends.
        let mut mesh = DicedMesh {
            key_times: vec![0.0, 0.01, 1.0],
            vertex_count: 12,
            grids: vec![Grid {
                first_vertex: 0,
                element: 0,
                nu: 1,
                nv: 5,
            }],
            positions: vec![Vec3::ZERO; 36],
            ..DicedMesh::default()
        };
        let level = Level::best();
        let refused = |mesh: &DicedMesh| {
            let mesh = PlanarMesh::from(mesh.clone());
            parts::<LinearHull>(level, 0, &mesh.grid_rows(0), 0..3).is_none()
        };
        assert!(!refused(&mesh));
        for (k, x) in [(0, 1.0), (1, COORDINATE_LIMIT * 0.9), (2, 2.0)] {
            mesh.positions[12 * k + 5] = Vec3::X * x;
        }
        assert!(!refused(&mesh));
        mesh.positions[12 + 5] = Vec3::X * COORDINATE_LIMIT * 1.1;
        assert!(refused(&mesh));
    }
}
