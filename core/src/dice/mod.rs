//! Split and dice: limit surfaces to watertight micropolygon grids at a shading rate in raster
//! space (Cook, Carpenter, Catmull, "The Reyes Image Rendering Architecture", SIGGRAPH 1987; Fisher
//! et al., "DiagSplit: Parallel, Crack-free, Adaptive Tessellation", SIGGRAPH Asia 2009).
//!
//! A [`LimitSurface`] comes in, in object space at its point keys; a [`PointPath`] takes its points
//! to the output keys; a [`RasterMetric`] measures there in pixels; a [`DicedMesh`] goes out. Rates
//! hold at the worst output key.
//!
//! **Rates belong to edges** (`base`, `edges`, `curve`). Each base vertex and each base edge is
//! evaluated once, by the first face on it, at every key. An edge has a tree of dyadic intervals
//! with a rate each, so that its longest segment is about the shading rate; its vertices are the
//! *canonical vertices* that every face on it copies, bit for bit.
//!
//! **Patches** (`patch`, `face`). A quad is one patch, a triangle or n-gon one for each corner around
//! its centre, or one collapsed patch for a triangle whose edges are single segments. A patch is
//! split in the middle where a side crosses intervals of its edge, or where its inside needs more
//! than a grid may have. A split makes a new curve, with a tree and canonical vertices of its own,
//! which ends on canonical vertices of the curves it meets; both halves share it.
//!
//! **Lattices** (`lattice`). A patch that is not split becomes one grid, as fine as its sides and
//! its inside need. A lattice vertex on a side copies the canonical vertex nearest in parameter.
//! The lattice is at least as fine as the side, so it visits every canonical vertex in turn: a
//! coarser side makes cells degenerate, never a T-junction. The corner of a patch is the canonical
//! vertex nearest to the end of the side, and both sides that meet there agree on it: for base
//! patches it is a base vertex or the middle of a base edge, from which the inner curve starts; and
//! a split makes its curve start where the halves of the side now end. By induction every side of
//! every patch is walked over the same vertices from both sides, at every key, so a closed mesh
//! gives closed triangles, whatever the rates.
//!
//! The lattice is evaluated first at the rates of its sides, and again only where its inner edges
//! turn out too long: on most meshes nothing is evaluated twice.
//!
//! **Bounds.** Trees and patches are bisected at most `MAX_DEPTH` times in each direction, what the camera
//! cannot see is measured by angle and counts an eighth or less, and above
//! [`DiceInput::max_micropolygons`] the shading rate is made coarser and dicing starts again. A face
//! with a position that is not finite is dropped and counted.
//!
//! Faces are diced in parallel; the result has the same bits for any number of threads.

mod base;
mod budget;
pub mod clusters;
mod curve;
mod edges;
pub mod eye;
mod face;
pub mod fill;
mod lattice;
pub mod metric;
mod patch;
mod sampler;
mod source;

pub use clusters::{ClusterRule, Clusters};
pub use eye::Eye;
pub use metric::{RasterMetric, RasterView};

use crate::grid::{DicedMesh, GridChannel};
use crate::motion::PointPath;
use crate::surface::LimitSurface;
use base::BaseMesh;
use budget::{Budget, Halt};
use edges::BaseCurves;
use face::{FaceBudgets, FaceDicer, Leave};
use lattice::Part;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// What is diced, and how finely.
#[derive(Clone, Copy)]
pub struct DiceInput<'a> {
    /// The surface, in object space.
    pub surface: &'a dyn LimitSurface,
    /// From the surface's keys to the output keys and the space that is traced.
    pub path: &'a PointPath,
    /// Measures what `path` gives. As many views as the path has keys.
    pub metric: &'a RasterMetric,
    /// Wanted length of a micropolygon edge in pixels. Positive.
    pub shading_rate: f32,
    /// Store normals.
    pub with_normals: bool,
    /// Leave the faces of polygonal surfaces as coarse as they are: one cell for a quad or triangle.
    /// Nothing is lost but shading between the base vertices.
    pub polygons_coarse: bool,
    /// Above this the shading rate is made coarser. Never less than one a patch.
    pub max_micropolygons: u64,
    /// Set from outside to stop early.
    pub cancel: &'a AtomicBool,
}

impl DiceInput<'_> {
    /// True where faces are taken as they are.
    fn is_coarse(&self) -> bool {
        self.polygons_coarse && self.surface.is_polygonal()
    }
}

/// Diced geometry and what it took.
#[derive(Clone, Debug, Default)]
pub struct DiceOutput {
    /// The grids.
    pub mesh: DicedMesh,
    /// Surface points evaluated; all keys of a point count as one.
    pub limit_evaluations: u64,
    /// Shading rate used, in pixels: above the wanted one where `coarsened`.
    pub shading_rate: f32,
    /// True where the budget of micropolygons made the rate coarser.
    pub coarsened: bool,
    /// Faces left out because a position was not finite.
    pub dropped_faces: u64,
}

/// Why a surface could not be diced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DiceError {
    /// [`DiceInput::cancel`] was set.
    #[error("dicing was cancelled")]
    Cancelled,
    /// Not enough memory for the result.
    #[error("not enough memory for the diced mesh")]
    OutOfMemory,
    /// More faces or vertices than 32-bit numbers can tell apart.
    #[error("too many faces or lattice vertices for one mesh")]
    TooLarge,
    /// The shading rate is not a positive number.
    #[error("the shading rate must be a positive number of pixels")]
    ShadingRate,
    /// The keys of the surface, the path and the metric do not belong together.
    #[error("surface, path and metric have different numbers of keys")]
    KeyCount,
}

impl From<std::collections::TryReserveError> for DiceError {
    fn from(_: std::collections::TryReserveError) -> Self {
        Self::OutOfMemory
    }
}

/// The rate is coarsened by at least this factor at first, and by the square of the factor before where
/// that did not help: what does not get simpler (a surface that f32 cannot hold) ends soon.
const COARSEN: f32 = 1.25;
/// Rates above this are longer than anything the metric reports.
const COARSEST: f32 = 1.0e10;

/// Dices a surface; see the module's text.
pub fn dice(input: &DiceInput<'_>) -> Result<DiceOutput, DiceError> {
    if !(input.shading_rate > 0.0 && input.shading_rate.is_finite()) {
        return Err(DiceError::ShadingRate);
    }
    let keys = input.path.key_times().len();
    if input.path.point_key_count() != input.surface.key_count()
        || input.metric.key_count().is_some_and(|k| k != keys)
    {
        return Err(DiceError::KeyCount);
    }
    let base = BaseMesh::new(input.surface)?;
    let mut rate = input.shading_rate;
    let mut least = COARSEN;
    let mut evaluations = 0;
    loop {
        // At the coarsest rate there is one cell a patch: nothing more can be saved.
        let coarsest = rate >= COARSEST;
        let limit = if coarsest {
            u64::MAX
        } else {
            input.max_micropolygons
        };
        let excess = match dice_at(input, &base, rate, limit, &mut evaluations)? {
            Pass::Done(parts) => {
                let mut output = join(input, parts)?;
                output.limit_evaluations += evaluations;
                output.shading_rate = rate;
                output.coarsened = rate > input.shading_rate;
                return Ok(output);
            }
            // The estimate may be high: half way is safe, and costs little.
            Pass::Estimated(count) => (count as f64 / limit.max(1) as f64 / 4.0) as f32,
            // It is over for certain: most of the way.
            Pass::OverBudget(count) => (count as f64 / limit.max(1) as f64 * 0.8) as f32,
        };
        let factor = excess.sqrt();
        // Nothing sensible is so far off: end with one cell a patch.
        rate *= factor.max(least);
        least *= least;
        if rate > input.shading_rate * 1.0e5 || !rate.is_finite() {
            rate = COARSEST;
        }
    }
}

/// How a pass over the faces ended.
enum Pass {
    /// With grids.
    Done(Vec<Part>),
    /// Before the second pass: this many micropolygons were expected, far above the limit.
    Estimated(u64),
    /// At the limit; this many were expected.
    OverBudget(u64),
}

/// Estimates run high where edges are uneven: only this many times the limit saves a pass.
const GROSS: u64 = 8;

/// Dices at one rate.
fn dice_at(
    input: &DiceInput<'_>,
    base: &BaseMesh,
    rate: f32,
    limit: u64,
    evaluations: &mut u64,
) -> Result<Pass, DiceError> {
    // Every edge segment is a side of a cell, and a cell has four.
    let most = limit.saturating_mul(4);
    let budget = Budget::new(most.saturating_add(base.edges.len() as u64), input.cancel);
    let edges = match BaseCurves::evaluate(input, base, rate, &budget) {
        Ok((edges, count)) => {
            *evaluations += count;
            edges
        }
        // At least four times the limit in segments: twice as coarse is not too coarse.
        Err(Halt::OverBudget) => return Ok(Pass::Estimated(limit.saturating_mul(16))),
        Err(Halt::Failed(error)) => return Err(error),
    };
    let estimate = estimate(base, &edges);
    if estimate / GROSS > limit {
        return Ok(Pass::Estimated(estimate));
    }
    let budgets = FaceBudgets {
        cells: Budget::new(limit, input.cancel),
        segments: Budget::new(most, input.cancel),
    };
    match dice_faces(input, base, &edges, rate, &budgets) {
        Ok(parts) => Ok(Pass::Done(parts)),
        Err(Halt::OverBudget) => Ok(Pass::OverBudget(estimate)),
        Err(Halt::Failed(error)) => Err(error),
    }
}

/// Dices all faces, a part for each run of them.
fn dice_faces(
    input: &DiceInput<'_>,
    base: &BaseMesh,
    edges: &BaseCurves,
    rate: f32,
    budgets: &FaceBudgets<'_>,
) -> Result<Vec<Part>, Halt> {
    let face_count = base.first.len() - 1;
    let chunk = chunk_faces(face_count);
    let channels = input.surface.channels().len();
    let normal_keys = normal_key_count(input);
    (0..face_count.div_ceil(chunk))
        .into_par_iter()
        .map_init(
            || FaceDicer::new(input, base, edges, budgets, rate),
            |dicer, c| {
                let mut part = Part::new(channels, normal_keys);
                let before = dicer.evaluations();
                for face in c * chunk..((c + 1) * chunk).min(face_count) {
                    match dicer.dice(face as u32, face as u32, &mut part) {
                        Ok(()) => {}
                        Err(Leave::NotFinite) => part.drop_face(),
                        Err(Leave::Halt(halt)) => return Err(halt),
                    }
                }
                part.evaluations = dicer.evaluations() - before;
                Ok(part)
            },
        )
        .collect()
}

/// About how many micropolygons there will be, from the rates of the base edges.
fn estimate(base: &BaseMesh, edges: &BaseCurves) -> u64 {
    let faces = base.first.len() as u32 - 1;
    let cells = |face: u32| {
        let edges_of = &base.edges[base.face_edges(face)];
        let rate = |k: usize| u64::from(edges.segments(edges_of[k]));
        match edges_of.len() {
            0 => 0,
            4 => rate(0).max(rate(2)) * rate(1).max(rate(3)),
            n => {
                let most = (0..n).map(rate).max().unwrap_or(1);
                if n == 3 && most == 1 {
                    return 1;
                }
                let half = most.div_ceil(2);
                half * half * n as u64
            }
        }
    };
    (0..faces).into_par_iter().map(cells).sum()
}

fn normal_key_count(input: &DiceInput<'_>) -> usize {
    match (input.with_normals, input.path.turns_normals()) {
        (false, _) => 0,
        (true, false) => 1,
        (true, true) => input.path.key_times().len(),
    }
}

/// Faces that one thread takes at a time: enough to make evaluators worth it, few enough to spread.
fn chunk_faces(face_count: usize) -> usize {
    (face_count / 64).clamp(1, 128)
}

/// Puts the parts together, in the order of the faces.
fn join(input: &DiceInput<'_>, parts: Vec<Part>) -> Result<DiceOutput, DiceError> {
    let sum = |f: fn(&Part) -> u64| parts.iter().map(f).sum::<u64>();
    let vertex_count = sum(|p| p.vertex_count);
    if vertex_count > u64::from(u32::MAX) {
        return Err(DiceError::TooLarge);
    }
    let mut output = DiceOutput {
        limit_evaluations: sum(|p| p.evaluations),
        dropped_faces: sum(|p| p.dropped_faces),
        ..DiceOutput::default()
    };
    let mesh = &mut output.mesh;
    mesh.origin = input.path.origin();
    mesh.key_times = input.path.key_times().to_vec();
    mesh.vertex_count = vertex_count as usize;
    mesh.normal_key_count = normal_key_count(input);
    let channels = input.surface.channels();
    mesh.channels = channels
        .iter()
        .map(|c| GridChannel {
            width: c.width,
            values: Vec::new(),
        })
        .collect();
    mesh.grids
        .try_reserve_exact(sum(|p| p.grids.len() as u64) as usize)?;
    hdtrapeze_pages::expect_large(&mut mesh.grids);
    mesh.reserve_positions(mesh.vertex_count)?;
    mesh.normals
        .try_reserve_exact(mesh.vertex_count * mesh.normal_key_count)?;
    for channel in &mut mesh.channels {
        channel
            .values
            .try_reserve_exact(mesh.vertex_count * channel.width)?;
    }
    let mut first = 0u32;
    for part in parts {
        mesh.grids
            .extend(part.grids.iter().map(|g| crate::grid::Grid {
                first_vertex: g.first_vertex + first,
                ..*g
            }));
        mesh.positions.extend_from_slice(&part.positions);
        mesh.normals.extend_from_slice(&part.normals);
        for (channel, values) in mesh.channels.iter_mut().zip(&part.channels) {
            channel.values.extend_from_slice(values);
        }
        first += part.vertex_count as u32;
    }
    Ok(output)
}
