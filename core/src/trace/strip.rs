//! How strands lie in memory, for [`super::waits`]: what is the same for all parts of a strand, and for all strands that are
//! alike, is found once.

use crate::bvh::block::{is_small, part_of_strip};
use crate::grid::Grid;

/// A strand, one micropolygon across, whose [loose](crate::bvh::block::loose) parts are one or two micropolygons.
#[derive(Clone, Copy, Debug)]
pub struct Strip {
    /// It runs along rows, not across them.
    pub along_rows: bool,
    /// Vertices in a row.
    pub columns: u16,
    /// Floats from key to key.
    pub key: u32,
    /// Floats from micropolygon to micropolygon.
    step: u32,
    /// Micropolygons.
    length: u32,
}

/// A part of a strand.
#[derive(Clone, Copy, Debug)]
pub struct StrandPart {
    /// Floats from the first of its strand's.
    pub floats: usize,
    /// Its first micropolygon.
    pub cell: u32,
    /// There is a second one.
    pub two: bool,
}

impl Strip {
    /// The strand that a grid is, if it is one.
    #[inline(always)]
    pub fn of(grid: &Grid) -> Option<Self> {
        let along_rows = grid.nv == 1 && grid.nu > 1;
        let length = u32::from(grid.nu.max(grid.nv));
        // A small grid is one part as a whole.
        if grid.nu.min(grid.nv) != 1 || (is_small(grid) && length > 2) {
            return None;
        }
        let columns = grid.nu + 1;
        Some(Self {
            along_rows,
            columns,
            key: 3 * grid.vertex_count() as u32,
            step: if along_rows {
                1
            } else {
                3 * u32::from(columns)
            },
            length,
        })
    }

    /// The loose part in a slot.
    #[inline(always)]
    pub fn part(&self, slot: u32) -> StrandPart {
        let (cell, length) = part_of_strip(slot);
        let cell = u32::from(cell);
        StrandPart {
            floats: cell as usize * self.step as usize,
            cell,
            two: length == 2 && cell + 1 < self.length,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::block::{is_strip, loose, loose_slots};

    #[test]
    fn parts_are_the_loose_groups_of_strands() {
        let mut strands = 0;
        for (nu, nv) in (1..=16).flat_map(|n| [(1, n), (n, 1), (2, n)]) {
            let grid = Grid {
                first_vertex: 0,
                element: 0,
                nu,
                nv,
            };
            if !is_small(&grid) && !is_strip(&grid) {
                continue;
            }
            for slot in [false, true]
                .into_iter()
                .flat_map(|s| loose_slots(&grid, s))
            {
                let rect = loose(&grid, slot);
                let Some(strip) = Strip::of(&grid) else {
                    assert!(nu.min(nv) > 1 || rect.w * rect.h > 2, "{grid:?} {slot}");
                    continue;
                };
                let part = strip.part(slot);
                let cells = u32::from(rect.w) * u32::from(rect.h);
                assert_eq!(u32::from(part.two) + 1, cells, "{grid:?} {slot}");
                assert_eq!(part.cell, u32::from(rect.i.max(rect.j)));
                // Rows of vertices have x before y before z.
                let row = 3 * usize::from(rect.j) * (usize::from(nu) + 1);
                assert_eq!(part.floats, row + usize::from(rect.i), "{grid:?} {slot}");
                assert_eq!(strip.along_rows, nu > nv);
                strands += 1;
            }
        }
        assert!(strands > 100);
    }
}
