//! Bytes and operations that counts of tests imply, and what part of a device's peaks they would be.
//!
//! These are what tests ask for, as `slabs.wgsl` and `cells.wgsl` are written; what caches answer never comes from memory, so
//! that a share of the bandwidth may be above 1. Operations are those in f32: sums, products, quotients, and least and
//! most of two; a fused product and sum is two. Turning of bytes into floats, of rays into frames, and addresses are left out.

use hdtrapeze_core::trace::TraceCounts;

/// Of a device, where they are told.
#[derive(Clone, Copy, Debug, Default)]
pub struct Peaks {
    /// Bytes a second, in units of 10^9.
    pub gbps: Option<f64>,
    /// Operations a second, in units of 10^12.
    pub tflops: Option<f64>,
}

/// What some rays ask for.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    pub bytes: f64,
    pub flops: f64,
}

/// A ray that is read.
pub const RAY_BYTES: f64 = 48.0;
/// A hit that is written.
pub const HIT_BYTES: f64 = 24.0;
/// A ray's place in the order that is read, and its bit that is written with the word that it is in.
pub const OCCLUDED_BYTES: f64 = 4.0 + 4.0;

/// A node with its lattice of 18 words (two of them where bounds move), 8 references, frame and mask, in units of 16 bytes. A
/// block is a unit or two less.
fn node_bytes(moving: bool) -> f64 {
    16.0 * if moving { 12.0 } else { 7.0 }
}

/// For each of 3 axes, what is common to all planes (static 4: a scale, a base, and its two sums; moving 7: two scales, a
/// base of 3, and two sums), and for each of 8 children its two planes (a product and a sum each; moving two of both) and
/// two of `min` and `max`; then 8 comparisons, and static 3 sums of inverses.
fn node_flops(moving: bool) -> f64 {
    match moving {
        false => 3.0 * (4.0 + 8.0 * (4.0 + 2.0)) + 8.0 + 3.0,
        true => 3.0 * (7.0 + 8.0 * (8.0 + 2.0)) + 8.0,
    }
}

/// Vertices that a group of 4 x 2 micropolygons loads: both rows of each row of it, 5 each; a micropolygon.
const CELL_VERTICES: f64 = 20.0 / 8.0;

/// Its vertices, 12 bytes each (at two keys where they move), and an eighth of the header of its grid.
fn cell_bytes(moving: bool) -> f64 {
    CELL_VERTICES * 12.0 * if moving { 2.0 } else { 1.0 } + 12.0 / 8.0
}

/// A vertex is moved and sheared by 3 differences and 2 products and differences (moving: 3 times a difference, a product and a
/// sum before); a micropolygon has 4 edges (and one more a row of 4), 3 each, and each of its two triangles a sum of
/// 3 and 4 of `min` and `max`. What few triangles need that are met is left out.
fn cell_flops(moving: bool) -> f64 {
    CELL_VERTICES * if moving { 16.0 } else { 7.0 } + 3.0 * 4.25 + 2.0 * (2.0 + 4.0)
}

/// What tests ask for, where each ray takes so many bytes besides.
pub fn asked(counts: &TraceCounts, moving: bool, ray: f64) -> Asked {
    let [rays, nodes, cells] =
        [counts.rays, counts.node_tests, counts.cell_tests].map(|count| count as f64);
    Asked {
        bytes: rays * ray + nodes * node_bytes(moving) + cells * cell_bytes(moving),
        flops: nodes * node_flops(moving) + cells * cell_flops(moving),
    }
}

impl Peaks {
    /// The heads of what [`Peaks::columns`] gives.
    pub fn head() -> String {
        format!("{:>8} {:>6} {:>8} {:>6}", "GB", "%", "GFLOP", "%")
    }

    /// What is asked for, and its part of what the device could give in so many seconds, in hundredths.
    pub fn columns(&self, asked: &Asked, seconds: f64) -> String {
        let part = |asked: f64, peak: Option<f64>| match peak {
            Some(peak) => format!("{:.1}", 100.0 * asked / (peak * seconds)),
            None => "-".to_owned(),
        };
        format!(
            "{:>8.2} {:>6} {:>8.2} {:>6}",
            asked.bytes * 1e-9,
            part(asked.bytes * 1e-9, self.gbps),
            asked.flops * 1e-9,
            part(asked.flops * 1e-12, self.tflops),
        )
    }
}
