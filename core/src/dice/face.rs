//! The second pass: a face becomes patches, patches are split until each is one grid.

use super::DiceInput;
use super::base::{BaseMesh, runs_forward, usable};
use super::budget::{Budget, Halt};
use super::curve::{CurvePool, CurveView, MAX_DEPTH, ONE, rate_for};
use super::edges::BaseCurves;
use super::lattice::{Lattice, Part};
use super::patch::{LOCAL, Patch, Side};
use super::sampler::{NotFinite, Sampler};
use super::source::CurveSource;
use crate::grid::MAX_GRID_RATE;
use crate::surface::PatchDomain;
use glam::{Vec2, Vec3};

/// A lattice is taken as it is where its inner edges are at most this many shading rates long: a
/// little over what edge rates allow, so that a patch follows its sides unless it bulges.
const ACCEPT: f32 = 1.35;
/// A single cell is taken as it is where its middle is at most this far from its corners, in
/// shading rates: half the diagonal of a cell whose sides are as long as edge rates allow, and some
/// shear.
const ACCEPT_HALF_DIAGONAL: f32 = 1.3;
/// Times that a lattice is evaluated anew before it is taken.
const ATTEMPTS: u32 = 3;

/// Why a face was left.
pub(super) enum Leave {
    /// It is dropped.
    NotFinite,
    /// Dicing stops.
    Halt(Halt),
}

impl From<NotFinite> for Leave {
    fn from(_: NotFinite) -> Self {
        Self::NotFinite
    }
}

impl From<Halt> for Leave {
    fn from(halt: Halt) -> Self {
        Self::Halt(halt)
    }
}

/// Curves inside one face.
#[derive(Default)]
struct LocalCurves {
    pool: CurvePool,
    /// Start and end of each curve, `[curve][end][key]`.
    ends: Vec<Vec3>,
}

/// Everything that a patch's sides refer to.
#[derive(Clone, Copy)]
pub(super) struct Curves<'a> {
    base: &'a BaseMesh,
    edges: &'a BaseCurves,
    local: &'a LocalCurves,
    key_count: usize,
}

impl<'a> Curves<'a> {
    /// The curve that a side is part of.
    pub fn of(&self, side: &Side) -> CurveView<'a> {
        if side.edge & LOCAL == 0 {
            return self.edges.edge(self.base, side.edge);
        }
        let index = (side.edge & !LOCAL) as usize;
        let k = self.key_count;
        let ends = &self.local.ends[index * 2 * k..][..2 * k];
        self.local.pool.view(index, &ends[..k], &ends[k..])
    }
}

/// What all faces together may make.
pub(super) struct FaceBudgets<'a> {
    /// Micropolygons.
    pub cells: Budget<'a>,
    /// Segments of curves inside faces: each is a side of a micropolygon, if it comes to that.
    pub segments: Budget<'a>,
}

/// Dices faces on one thread.
pub(super) struct FaceDicer<'a> {
    input: &'a DiceInput<'a>,
    base: &'a BaseMesh,
    edges: &'a BaseCurves,
    budgets: &'a FaceBudgets<'a>,
    rate: f32,
    sampler: Sampler<'a>,
    local: LocalCurves,
    lattice: Lattice,
}

impl<'a> FaceDicer<'a> {
    pub fn new(
        input: &'a DiceInput<'a>,
        base: &'a BaseMesh,
        edges: &'a BaseCurves,
        budgets: &'a FaceBudgets<'a>,
        rate: f32,
    ) -> Self {
        Self {
            input,
            base,
            edges,
            budgets,
            rate,
            sampler: Sampler::new(input.surface, input.path, input.metric),
            local: LocalCurves::default(),
            lattice: Lattice::default(),
        }
    }

    /// Surface points evaluated so far.
    pub fn evaluations(&self) -> u64 {
        self.sampler.evaluations
    }

    /// Dices `face`, whose edges are those of `row` of the base mesh, to the end of `part`.
    pub fn dice(&mut self, row: u32, face: u32, part: &mut Part) -> Result<(), Leave> {
        let range = self.base.face_edges(row);
        if range.is_empty() {
            return Ok(());
        }
        part.begin_face(self.input.surface.element(face));
        let edges = &self.base.edges[range.clone()];
        let corners = &self.base.corners[range];
        let finite = |&slot: &u32| self.edges.vertex(slot).iter().all(|p| p.is_finite());
        if !corners.iter().all(finite) || edges.iter().any(|&e| self.edges.segments(e) == 0) {
            return Err(Leave::NotFinite);
        }
        let vertices = usable(self.input.surface.face_vertices(face));
        self.sampler.bind(face);
        self.local.pool.clear();
        self.local.ends.clear();
        match vertices.len() {
            4 => self.dice_quad(vertices, edges, part),
            3 if edges.iter().all(|&e| self.edges.segments(e) == 1)
                && self.dice_triangle(vertices, edges, part)? =>
            {
                Ok(())
            }
            _ => self.dice_corners(vertices, edges, part),
        }
    }

    fn curves(&self) -> Curves<'_> {
        Curves {
            base: self.base,
            edges: self.edges,
            local: &self.local,
            key_count: self.sampler.key_count(),
        }
    }

    fn dice_quad(&mut self, vertices: &[u32], edges: &[u32], part: &mut Part) -> Result<(), Leave> {
        // s runs along edge 0 and against edge 2, t along edge 1 and against edge 3.
        let side = |k: usize| {
            if self.edges.edge(self.base, edges[k]).is_point() {
                return Side::point(edges[k], 0);
            }
            let along = runs_forward(vertices, k);
            Side::whole(edges[k], if k < 2 { !along } else { along })
        };
        let patch = Patch {
            domain: PatchDomain::Whole,
            low: Vec2::ZERO,
            high: Vec2::ONE,
            depth: [MAX_DEPTH; 2],
            sides: [side(0), side(1), side(2), side(3)],
        };
        self.dice_patch(&patch, part)
    }

    /// A triangle as one cell, the last side collapsed to corner 2. False where its middle bulges
    /// too far for that.
    fn dice_triangle(
        &mut self,
        vertices: &[u32],
        edges: &[u32],
        part: &mut Part,
    ) -> Result<bool, Leave> {
        // Both sides from t = 0 to 1 end at corner 2; the collapsed side is that end, twice.
        let right = Side::whole(edges[1], !runs_forward(vertices, 1));
        let left = Side::whole(edges[2], runs_forward(vertices, 2));
        let tip = if right.reversed { 0 } else { ONE };
        let patch = Patch {
            domain: PatchDomain::Collapsed,
            low: Vec2::ZERO,
            high: Vec2::ONE,
            depth: [0; 2],
            sides: [
                Side::whole(edges[0], !runs_forward(vertices, 0)),
                right,
                Side::point(edges[1], tip),
                left,
            ],
        };
        let middle = (!self.input.is_coarse()).then_some(Vec2::new(0.5, 1.0 / 3.0));
        self.evaluate(&patch, 1, 1, middle)?;
        if middle.is_some() && self.half_diagonal() > ACCEPT_HALF_DIAGONAL {
            return Ok(false);
        }
        self.emit(&patch, part)?;
        Ok(true)
    }

    /// A triangle or n-gon as one quad sub-face a corner, around the centre.
    fn dice_corners(
        &mut self,
        vertices: &[u32],
        edges: &[u32],
        part: &mut Part,
    ) -> Result<(), Leave> {
        let n = vertices.len();
        let depth = MAX_DEPTH - 1;
        let centre = CurveSource::Line {
            domain: PatchDomain::Corner(0),
            from: Vec2::ONE,
            to: Vec2::ONE,
        };
        let centre = self.sampler.curve(&centre, &[1.0])?;
        for (k, &edge) in edges.iter().enumerate() {
            self.budgets.cells.check()?;
            let curve = self.edges.edge(self.base, edge);
            let start = curve.vertex(curve.map(ONE / 2, 1));
            let source = CurveSource::Line {
                domain: PatchDomain::Corner(k as u32),
                from: Vec2::X,
                to: Vec2::ONE,
            };
            self.add_curve(&source, start, &centre, depth)?;
        }
        for k in 0..n {
            let before = (k + n - 1) % n;
            let spoke = |k: usize| Side::whole(LOCAL | k as u32, false);
            let patch = Patch {
                domain: PatchDomain::Corner(k as u32),
                low: Vec2::ZERO,
                high: Vec2::ONE,
                depth: [depth; 2],
                sides: [
                    Side::half(edges[k], runs_forward(vertices, k)),
                    spoke(k),
                    spoke(before),
                    Side::half(edges[before], !runs_forward(vertices, before)),
                ],
            };
            self.dice_patch(&patch, part)?;
        }
        Ok(())
    }

    /// Adds a curve of this face between two given positions (one a key) and returns its edge
    /// number.
    fn add_curve(
        &mut self,
        source: &CurveSource,
        start: &[Vec3],
        end: &[Vec3],
        depth: u32,
    ) -> Result<u32, Leave> {
        let edge = LOCAL | self.local.pool.curves.len() as u32;
        if self.input.is_coarse() {
            self.local.pool.push_segment(start.len());
        } else {
            let samples = self.sampler.curve(source, &[0.0, 0.5, 1.0])?;
            self.local
                .pool
                .build(&mut self.sampler, source, &samples, depth, self.rate)?;
        }
        self.local.ends.extend_from_slice(start);
        self.local.ends.extend_from_slice(end);
        let segments = self.local.pool.curves.last().map_or(0, |c| c.segments);
        self.budgets.segments.take(u64::from(segments))?;
        Ok(edge)
    }

    fn dice_patch(&mut self, patch: &Patch, part: &mut Part) -> Result<(), Leave> {
        self.budgets.cells.check()?;
        let curves = self.curves();
        let need = patch.sides.map(|s| curves.of(&s).need(s.a, s.b));
        let split = patch.sides.map(|s| curves.of(&s).is_split(s.a, s.b));
        let (mut nu, mut nv) = (need[0].max(need[2]), need[1].max(need[3]));
        let (split_u, split_v) = (split[0] || split[2], split[1] || split[3]);
        if split_u || split_v {
            // The longer direction first, so that a rate that only one side has stays local.
            let u = split_u && (!split_v || nu >= nv);
            return self.split(patch, u, part);
        }
        let flat = self.input.is_coarse();
        for attempt in 1..=ATTEMPTS {
            let single = nu == 1 && nv == 1;
            let middle = (single && !flat).then_some((patch.low + patch.high) * 0.5);
            self.evaluate(patch, nu, nv, middle)?;
            if flat || attempt == ATTEMPTS {
                break;
            }
            let (wanted_u, wanted_v) = if single {
                let d = self.half_diagonal();
                let wanted = if d > ACCEPT_HALF_DIAGONAL {
                    rate_for(d * std::f32::consts::SQRT_2).max(2)
                } else {
                    1
                };
                (wanted, wanted)
            } else {
                let longest = self
                    .lattice
                    .longest_inner_edges(self.sampler.metric(), self.sampler.key_count());
                let wanted = |n: u32, l: f32| {
                    if l > ACCEPT * self.rate {
                        rate_for(n as f32 * l / self.rate).max(n)
                    } else {
                        n
                    }
                };
                (wanted(nu, longest[0]), wanted(nv, longest[1]))
            };
            let over = |wanted: u32, depth: u32| {
                if wanted > MAX_GRID_RATE && depth > 0 {
                    wanted
                } else {
                    0
                }
            };
            let (over_u, over_v) = (
                over(wanted_u, patch.depth[0]),
                over(wanted_v, patch.depth[1]),
            );
            if over_u.max(over_v) > 0 {
                return self.split(patch, over_u >= over_v, part);
            }
            let next = (wanted_u.min(MAX_GRID_RATE), wanted_v.min(MAX_GRID_RATE));
            if next == (nu, nv) {
                break;
            }
            (nu, nv) = next;
        }
        self.emit(patch, part)
    }

    fn split(&mut self, patch: &Patch, u: bool, part: &mut Part) -> Result<(), Leave> {
        let (low, high) = (patch.low, patch.high);
        let middle = (low + high) * 0.5;
        // The new curve runs from a point on the first side to one on the other.
        let (from, to, first, other, depth) = if u {
            let (from, to) = (Vec2::new(middle.x, low.y), Vec2::new(middle.x, high.y));
            (from, to, patch.sides[0], patch.sides[2], patch.depth[1])
        } else {
            let (from, to) = (Vec2::new(low.x, middle.y), Vec2::new(high.x, middle.y));
            (from, to, patch.sides[3], patch.sides[1], patch.depth[0])
        };
        let end = |side: &Side| {
            let curve = self.curves().of(side);
            curve.vertex(curve.map(side.middle(), 1)).to_vec()
        };
        let (start, end) = (end(&first), end(&other));
        let source = CurveSource::Line {
            domain: patch.domain,
            from,
            to,
        };
        let across = self.add_curve(&source, &start, &end, depth)?;
        let parts = if u {
            patch.split_u(across)
        } else {
            patch.split_v(across)
        };
        for child in &parts {
            self.dice_patch(child, part)?;
        }
        Ok(())
    }

    fn evaluate(
        &mut self,
        patch: &Patch,
        nu: u32,
        nv: u32,
        middle: Option<Vec2>,
    ) -> Result<(), Leave> {
        let curves = Curves {
            base: self.base,
            edges: self.edges,
            local: &self.local,
            key_count: self.sampler.key_count(),
        };
        let with_normals = self.input.with_normals;
        self.lattice.evaluate(
            &mut self.sampler,
            &curves,
            patch,
            [nu, nv],
            with_normals,
            middle,
        )?;
        Ok(())
    }

    /// Distance of the middle of a single cell to its farthest corner, in shading rates.
    fn half_diagonal(&self) -> f32 {
        self.lattice
            .farthest_from_middle(self.sampler.metric(), self.sampler.key_count())
            / self.rate
    }

    fn emit(&mut self, patch: &Patch, part: &mut Part) -> Result<(), Leave> {
        self.budgets.cells.take(self.lattice.cell_count())?;
        part.push(&mut self.lattice, &mut self.sampler, patch.domain);
        Ok(())
    }
}
