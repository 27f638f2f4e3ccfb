//! Parts of strands that wait, each for one ray: 8 of them are tested at once, whoever they wait for.
//!
//! A packet of rays that go one way brings many of them to each part ([`super::two_cells`]); rays that have little in common
//! come alone, and a part of two micropolygons, or one, fills a quarter of a vector, or less. So parts wait until there are eight, and, unless
//! there are more than sixteen, for one more step of their rays, in which vertices come from memory. The operations are those of [`super::cell`] in the same order, so hits are the same.

use hdtrapeze_simd::{Float, Mask, Simd};

use super::cell::{self, CellHit, exact};
use super::cell_rays::CellRays;
use super::packet::PACKET;
use super::strip::{StrandPart, Strip};
use super::two_cells::{FIRST, missed};
use crate::grid::PlanarMesh;
use crate::grid::planar::STRIP;

/// Parts that are tested at once.
const PARTS: usize = 8;

/// Vertices of a part: 3 stations along the strand, x before y before z of both sides; and a pair of floats without meaning, so
/// that any axis below 4 of any station is in there.
const FLOATS: usize = STRIP + 2;

/// Axes in the order x, y, z of a sheared space, by the one that is z, as [`super::packet::axes_with`] has them: looked up, since
/// eight rays of different axes are as many branches that nobody guesses.
static AXES: [[u8; 3]; 4] = [[1, 2, 0], [2, 0, 1], [0, 1, 2], [0, 1, 2]];

/// A part of a strand that waits for a ray.
#[derive(Clone, Copy, Debug, Default)]
struct Wait {
    /// Where its vertices are.
    first: usize,
    /// Floats from key to key.
    stride: u32,
    grid: u32,
    /// Its first micropolygon.
    cell: u16,
    /// Vertices in a row of its grid.
    columns: u16,
    ray: u8,
    /// There is a second micropolygon.
    two: bool,
    /// The strand runs along rows, not across them.
    along_rows: bool,
}

/// Parts that wait, in two rooms which are filled in turns.
#[derive(Clone, Debug, Default)]
pub struct Waits {
    rooms: [[Wait; PARTS]; 2],
    /// The room that has waited longer.
    older: usize,
    /// Parts of both.
    count: usize,
}

impl Waits {
    /// True when the next are enough for a test.
    #[inline(always)]
    pub fn are_enough(&self) -> bool {
        self.count >= PARTS
    }

    /// True when some have to be tested before another is added.
    #[inline(always)]
    pub fn are_full(&self) -> bool {
        self.count >= 2 * PARTS
    }

    /// True when none are left.
    #[inline(always)]
    pub fn are_none(&self) -> bool {
        self.count == 0
    }

    /// Adds the part `slot` of a strand, grid `g` of the mesh, whose first vertex is given, for a ray that goes through the
    /// segment of keys `key`, and asks for its vertices at `KEYS` keys from memory. Gives the part; none where there is no room behind
    /// its vertices.
    #[inline(always)]
    pub fn add<S: Simd, const KEYS: usize>(
        &mut self,
        simd: S,
        mesh: &PlanarMesh,
        strip: &Strip,
        (g, first_vertex, slot): (u32, u32, u32),
        (ray, key): (usize, u32),
    ) -> Option<StrandPart> {
        let part = strip.part(slot);
        let stride = strip.key as usize;
        let first = 3 * first_vertex as usize * mesh.key_times.len();
        let first = first + key as usize * stride + part.floats;
        let floats = mesh.floats();
        if !strip.along_rows && first + (KEYS - 1) * stride + FLOATS > floats.len() {
            return None;
        }
        for k in 0..KEYS {
            let at = first.wrapping_add(k * stride);
            if strip.along_rows {
                simd.expect_lattices::<1>(floats, at, usize::from(strip.columns), 0);
            } else {
                simd.expect(floats, at);
                simd.expect(floats, at.wrapping_add(STRIP - 1));
            }
        }
        debug_assert!(!self.are_full());
        let room = self.older ^ (self.count / PARTS);
        self.rooms[room & 1][self.count & (PARTS - 1)] = Wait {
            first,
            stride: strip.key,
            grid: g,
            cell: part.cell as u16,
            columns: strip.columns,
            ray: ray as u8,
            two: part.two,
            along_rows: strip.along_rows,
        };
        self.count += 1;
        Some(part)
    }

    /// Tests those that have waited longest, eight where there are so many; calls `accept(ray, grid, cell, hit)` for every
    /// triangle hit, in no useful order.
    #[inline(always)]
    pub fn test<S: Simd, const MOVING: bool>(
        &mut self,
        simd: S,
        cells: &CellRays,
        mesh: &PlanarMesh,
        mut accept: impl FnMut(usize, u32, u32, CellHit),
    ) {
        let count = self.count.min(PARTS);
        if count == 0 {
            return;
        }
        let waits = &self.rooms[self.older & 1];
        self.older ^= 1;
        self.count -= count;
        // Any part where there are fewer, whose lanes do not count.
        let lanes = (1u32 << count) - 1;
        let zero = simd.all8(0.0);
        let mut eight = [zero; PARTS];
        let mut axes = [[0u8; 3]; PARTS];
        for k in 0..PARTS {
            let ray = usize::from(waits[k].ray) & (PACKET - 1);
            eight[k] = simd.from8(&cells.rays[ray]);
            axes[k] = AXES[usize::from(cells.z_axis[ray]) & 3];
        }
        let [ox, oy, oz, fraction, slope_x, slope_y, ..] = simd.transposed(eight);
        let mut at = vertices(simd, mesh, waits, &axes, false);
        if MOVING {
            let to = vertices(simd, mesh, waits, &axes, true);
            for (at, to) in at.as_flattened_mut().iter_mut().zip(to.as_flattened()) {
                for (at, to) in at.iter_mut().zip(to) {
                    *at = *at + (*to - *at) * fraction;
                }
            }
        }
        let (mut x, mut y, mut z) = ([zero; 6], [zero; 6], [zero; 6]);
        for (k, [row, column]) in CORNERS.into_iter().enumerate() {
            let [own_x, own_y, own_z] = &at[row];
            z[k] = own_z[column] + oz;
            x[k] = (own_x[column] + ox) - z[k] * slope_x;
            y[k] = (own_y[column] + oy) - z[k] * slope_y;
        }
        let [missed_a, missed_b] = missed(zero, &x, &y, FIRST);
        let [missed_c, missed_d] = missed(zero, &x, &y, SECOND);
        // Of a single micropolygon there is no second.
        let (mut single, mut along) = (0, 0);
        for (k, wait) in waits.iter().enumerate() {
            single |= u32::from(!wait.two) << k;
            along |= u32::from(wait.along_rows) << k;
        }
        // Sides and rows change places along rows, and so do a micropolygon's triangles. The first one comes first, as it does for a
        // ray alone: where both are hit at the same distance, that is the hit.
        let in_order = |a: u32, b: u32| [(a & !along) | (b & along), (b & !along) | (a & along)];
        let [missed_a, missed_b] = in_order(missed_a.bits(), missed_b.bits());
        let [missed_c, missed_d] = in_order(missed_c.bits(), missed_d.bits());
        let missed = [missed_a, missed_b, missed_c | single, missed_d | single];
        if !(missed[0] & missed[1] & missed[2] & missed[3]) & lanes == 0 {
            return;
        }
        let (mut sx, mut sy, mut sz) = ([[0.0; PARTS]; 6], [[0.0; PARTS]; 6], [[0.0; PARTS]; 6]);
        for k in 0..6 {
            (sx[k], sy[k], sz[k]) = (x[k].to_array(), y[k].to_array(), z[k].to_array());
        }
        for (i, missed) in missed.into_iter().enumerate() {
            let in_second = i >= 2;
            let mut found = !missed & lanes;
            while found != 0 {
                let lane = found.trailing_zeros() as usize & (PARTS - 1);
                found &= found - 1;
                let wait = &waits[lane];
                let corners = TRIANGLES[usize::from(wait.along_rows)][i];
                let corners = cell::corners(
                    corners,
                    #[inline(always)]
                    |k| [sx[k][lane], sy[k][lane], sz[k][lane]],
                );
                let ray = usize::from(wait.ray) & (PACKET - 1);
                let [.., dir_z, _] = cells.rays[ray];
                if let Some(hit) = exact(corners, i % 2 == 1, f64::from(dir_z)) {
                    let cell = u32::from(wait.cell) + u32::from(in_second);
                    accept(ray, wait.grid, cell, hit);
                }
            }
        }
    }
}

/// Coordinates of the vertices of all parts, at the first key of their segments or at the `next`:
/// `[station][axis][side]`.
#[inline(always)]
fn vertices<S: Simd>(
    simd: S,
    mesh: &PlanarMesh,
    waits: &[Wait; PARTS],
    axes: &[[u8; 3]; PARTS],
    next: bool,
) -> [[[S::F8; 2]; 3]; 3] {
    let floats = mesh.floats();
    let mut rooms = [[0.0; FLOATS]; PARTS];
    let mut places = [&NOWHERE; PARTS];
    for ((place, room), wait) in places.iter_mut().zip(&mut rooms).zip(waits) {
        let first = wait.first + if next { wait.stride as usize } else { 0 };
        debug_assert!(first + STRIP <= floats.len());
        let floats = floats.get(first..).unwrap_or_default();
        if wait.along_rows {
            wait.gather(floats, room);
            *place = room;
        } else {
            // It was there when it was added.
            *place = floats.first_chunk().unwrap_or(&NOWHERE);
        }
    }
    let mut at = [[[simd.all8(0.0); 2]; 3]; 3];
    for (station, at) in at.iter_mut().enumerate() {
        for (a, at) in at.iter_mut().enumerate() {
            let mut pairs = [&[0.0; 2]; PARTS];
            for k in 0..PARTS {
                let (all, _) = places[k].as_chunks();
                pairs[k] = &all[3 * station + usize::from(axes[k][a] & 3)];
            }
            *at = simd.unzipped8(pairs);
        }
    }
    at
}

impl Wait {
    /// Brings a part that runs along rows in the order of those that run across.
    #[inline(always)]
    fn gather(&self, floats: &[f32], to: &mut [f32; FLOATS]) {
        let columns = usize::from(self.columns);
        for side in 0..2 {
            for axis in 0..3 {
                // Of a single micropolygon, the third is without meaning, but there.
                let row = floats.get((3 * side + axis) * columns..);
                let row = row.and_then(<[f32]>::first_chunk::<3>).unwrap_or(&[0.0; 3]);
                for (station, x) in row.iter().enumerate() {
                    to[2 * (3 * station + axis) + side] = *x;
                }
            }
        }
    }
}

/// Station and side of each corner; the second micropolygon has two of the first.
const CORNERS: [[usize; 2]; 6] = [[0, 0], [0, 1], [1, 1], [1, 0], [2, 1], [2, 0]];

/// Corners of the second micropolygon, in their order around it.
const SECOND: [usize; 4] = [3, 2, 4, 5];

/// Corners of the triangles of both micropolygons, where strands run across rows, and along them.
const TRIANGLES: [[[usize; 3]; 4]; 2] = [
    [[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]],
    [[0, 3, 2], [0, 2, 1], [3, 5, 4], [3, 4, 2]],
];

static NOWHERE: [f32; FLOATS] = [0.0; FLOATS];
