//! What is known of an object without a tree: its bounds over time, and which grids cannot be traced.

use glam::Vec3;
use hdtrapeze_simd::Level;

use super::bound::is_bounded;
use super::{COORDINATE_LIMIT, LinearBox};
use crate::grid::planar::{GridRows, Run};
use crate::grid::{DicedMesh, PlanarMesh};

/// How much farther than vertices, whose coordinates are up to `M`, any tree over them may store bounds.
///
/// In a frame, coordinates at keys are up to `sqrt(3) M`. In one that turns ([`super::turn`]) a bow of several keys is up to `5.5 M`, and
/// adds up to a quarter of that at keys inside the shutter: 3.2. A chord that ends at the other side is raised by both until it is there,
/// 4.9, and so may end at 6.7. Between keys the axis turns by up to 1.62 while vertices go `2 sqrt(3) M`, a quarter of which is
/// 1.4, and another quarter of the bow may be left where it does not go straight: 9.5. Packing adds
/// what it rounds.
pub const STORED: f32 = 10.0;

/// See the module's text.
pub struct Outline {
    /// The mesh, turned into rows.
    pub mesh: PlanarMesh,
    /// Contains all grids that can be traced, at all times.
    pub bounds: LinearBox,
    /// Those that cannot.
    pub dropped: u64,
}

/// Turns a mesh into rows and bounds its grids, in parallel.
pub fn outline(mesh: DicedMesh) -> Outline {
    let level = Level::best();
    let (mesh, parts) = PlanarMesh::turned(mesh, |run: Run<'_>| {
        let (mut bounds, mut dropped) = (LinearBox::EMPTY, 0);
        run.turn(level, |_, rows| {
            match rows.and_then(|rows| grid_bounds(level, &rows)) {
                Some(own) => bounds = bounds.union(&own),
                None => dropped += 1,
            }
        });
        (bounds, dropped)
    });
    let mut all = Outline {
        mesh,
        bounds: LinearBox::EMPTY,
        dropped: 0,
    };
    for (bounds, dropped) in parts {
        all.bounds = all.bounds.union(&bounds);
        all.dropped += dropped;
    }
    all
}

/// Bounds of a grid over time; nothing where it cannot be traced.
fn grid_bounds(level: Level, rows: &GridRows<'_>) -> Option<LinearBox> {
    if !is_bounded(level, rows) {
        return None;
    }
    let last = rows.key_times.len() - 1;
    let ((lo0, hi0), (lo1, hi1)) = (key_bounds(rows, 0), key_bounds(rows, last));
    let mut bounds = LinearBox { lo0, hi0, lo1, hi1 };
    for (k, &time) in rows.key_times.iter().enumerate().take(last).skip(1) {
        let (lo, hi) = key_bounds(rows, k);
        bounds.raise(time, lo, hi);
    }
    (bounds.max_abs() < COORDINATE_LIMIT).then_some(bounds)
}

fn key_bounds(rows: &GridRows<'_>, k: usize) -> (Vec3, Vec3) {
    let n = rows.grid.vertex_count();
    let columns = usize::from(rows.grid.nu) + 1;
    let mut bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for row in rows.floats[3 * k * n..][..3 * n].chunks_exact(3 * columns) {
        for (axis, x) in row.chunks_exact(columns).enumerate() {
            for &x in x {
                bounds.0[axis] = bounds.0[axis].min(x);
                bounds.1[axis] = bounds.1[axis].max(x);
            }
        }
    }
    bounds
}
