//! The first pass: base vertices and base edge curves, each evaluated once by the face that owns it.

use super::base::{BaseMesh, BasePart, runs_forward, usable};
use super::budget::{Budget, Halt};
use super::curve::{CurvePool, CurveView, MAX_DEPTH};
use super::sampler::Sampler;
use super::source::CurveSource;
use super::{DiceInput, chunk_faces};
use crate::surface::PatchDomain;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Base vertices and edge curves of the whole mesh.
#[derive(Debug, Default)]
pub(super) struct BaseCurves {
    /// `[vertex slot][key]`; not finite where the vertex cannot be used.
    vertices: Vec<Vec3>,
    pool: CurvePool,
    key_count: usize,
}

/// What a run of faces owns.
#[derive(Default)]
struct Part {
    vertices: Vec<Vec3>,
    pool: CurvePool,
    evaluations: u64,
    /// Scratch: corners and middles of the edges of one face, `[corner or middle][key]`, NaN where
    /// not known.
    points: Vec<Vec3>,
    /// Scratch: the start, middle and end of one edge.
    samples: Vec<Vec3>,
}

impl BaseCurves {
    /// Evaluates at `rate` pixels a segment. Returns the surface points that it took.
    pub fn evaluate(
        input: &DiceInput<'_>,
        base: &BaseMesh,
        rate: f32,
        budget: &Budget<'_>,
    ) -> Result<(Self, u64), Halt> {
        let face_count = base.first.len() - 1;
        let chunk = chunk_faces(face_count);
        let parts: Vec<Part> = (0..face_count.div_ceil(chunk))
            .into_par_iter()
            .map_init(
                || Sampler::new(input.surface, input.path, input.metric),
                |sampler, c| {
                    let mut part = Part::default();
                    let before = sampler.evaluations;
                    for face in c * chunk..((c + 1) * chunk).min(face_count) {
                        let face = face as u32;
                        let first = base.face_edges(face).start;
                        let known = part.pool.curves.len();
                        let wants = Wants {
                            edge: |k: usize| base.owns_edge(first + k),
                            corner: |k: usize| base.owns_corner(first + k),
                        };
                        sample_face(input, sampler, face, &wants, rate, budget, &mut part)?;
                        let segments = part.pool.curves[known..].iter().map(|c| c.segments);
                        budget.take(segments.map(u64::from).sum())?;
                    }
                    part.evaluations = sampler.evaluations - before;
                    Ok(part)
                },
            )
            .collect::<Result<_, Halt>>()?;

        let mut all = Self {
            key_count: input.path.key_times().len(),
            ..Self::default()
        };
        let pool = &mut all.pool;
        let sum = |f: fn(&Part) -> usize| parts.iter().map(f).sum::<usize>();
        all.vertices.try_reserve_exact(sum(|p| p.vertices.len()))?;
        pool.curves
            .try_reserve_exact(sum(|p| p.pool.curves.len()))?;
        pool.leaves
            .try_reserve_exact(sum(|p| p.pool.leaves.len()))?;
        pool.vertices
            .try_reserve_exact(sum(|p| p.pool.vertices.len()))?;
        let mut evaluations = 0;
        for part in parts {
            all.vertices.extend_from_slice(&part.vertices);
            all.pool.append(&part.pool, all.key_count);
            evaluations += part.evaluations;
        }
        Ok((all, evaluations))
    }

    /// Evaluates what some faces need of the base mesh, on this thread; the same bits.
    pub fn evaluate_part(
        input: &DiceInput<'_>,
        base: &BaseMesh,
        part: &BasePart,
        rate: f32,
        budget: &Budget<'_>,
    ) -> Result<(Self, u64), Halt> {
        let mut sampler = Sampler::new(input.surface, input.path, input.metric);
        let mut found = Part::default();
        for &face in &part.owners {
            let first = base.face_edges(face).start;
            let wants = Wants {
                edge: |k: usize| base.owns_edge(first + k) && part.has_edge(base.edges[first + k]),
                corner: |k: usize| {
                    base.owns_corner(first + k) && part.has_slot(base.corners[first + k])
                },
            };
            sample_face(input, &mut sampler, face, &wants, rate, budget, &mut found)?;
        }
        let all = Self {
            vertices: found.vertices,
            pool: found.pool,
            key_count: input.path.key_times().len(),
        };
        Ok((all, sampler.evaluations))
    }

    /// Position of a vertex slot at each key.
    pub fn vertex(&self, slot: u32) -> &[Vec3] {
        &self.vertices[slot as usize * self.key_count..][..self.key_count]
    }

    /// An edge's curve.
    pub fn edge(&self, base: &BaseMesh, edge: u32) -> CurveView<'_> {
        let [start, end] = base.edge_ends[edge as usize];
        self.pool
            .view(edge as usize, self.vertex(start), self.vertex(end))
    }

    /// Segments of an edge; 0 where it cannot be used.
    pub fn segments(&self, edge: u32) -> u32 {
        self.pool.curves[edge as usize].segments
    }
}

/// Corner and middle of each edge in the domain that holds a whole quad or triangle.
fn corner_and_middle(corners: usize, k: usize) -> (Vec2, Vec2) {
    const QUAD: [(Vec2, Vec2); 4] = [
        (Vec2::new(0.0, 0.0), Vec2::new(0.5, 0.0)),
        (Vec2::new(1.0, 0.0), Vec2::new(1.0, 0.5)),
        (Vec2::new(1.0, 1.0), Vec2::new(0.5, 1.0)),
        (Vec2::new(0.0, 1.0), Vec2::new(0.0, 0.5)),
    ];
    const TRIANGLE: [(Vec2, Vec2); 3] = [
        (Vec2::new(0.0, 0.0), Vec2::new(0.5, 0.0)),
        (Vec2::new(1.0, 0.0), Vec2::new(1.0, 0.5)),
        (Vec2::new(1.0, 1.0), Vec2::new(0.0, 0.5)),
    ];
    if corners == 4 { QUAD[k] } else { TRIANGLE[k] }
}

/// What is wanted of a face: of its edges and corners, those that it owns.
struct Wants<E, C> {
    edge: E,
    corner: C,
}

/// Evaluates the edges and corners of `face` that are wanted.
fn sample_face(
    input: &DiceInput<'_>,
    sampler: &mut Sampler<'_>,
    face: u32,
    wants: &Wants<impl Fn(usize) -> bool, impl Fn(usize) -> bool>,
    rate: f32,
    budget: &Budget<'_>,
    part: &mut Part,
) -> Result<(), Halt> {
    let vertices = usable(input.surface.face_vertices(face));
    let n = vertices.len();
    let keys = sampler.key_count();
    if (0..n).all(|k| !(wants.edge)(k) && !(wants.corner)(k)) {
        return Ok(());
    }
    budget.check()?;
    let straight = input.is_coarse();
    let wants_middle = |k: usize| !straight && (wants.edge)(k);
    let wants_corner =
        |k: usize| (wants.corner)(k) || wants_middle(k) || wants_middle((k + n - 1) % n);

    let points = &mut part.points;
    points.clear();
    points.resize(2 * n * keys, Vec3::NAN);
    sampler.bind(face);
    let mut sample = |domain, wanted: &[usize], st: &[Vec2]| {
        let positions = sampler.unchecked(domain, st);
        for (j, &slot) in wanted.iter().enumerate() {
            for k in 0..keys {
                points[slot * keys + k] = positions[k * st.len() + j];
            }
        }
    };
    if n <= 4 {
        let domain = if n == 4 {
            PatchDomain::Whole
        } else {
            PatchDomain::Collapsed
        };
        let (mut wanted, mut st) = ([0usize; 8], [Vec2::ZERO; 8]);
        let mut count = 0;
        for k in 0..n {
            let (corner, middle) = corner_and_middle(n, k);
            if wants_corner(k) {
                (wanted[count], st[count]) = (2 * k, corner);
                count += 1;
            }
            if wants_middle(k) {
                (wanted[count], st[count]) = (2 * k + 1, middle);
                count += 1;
            }
        }
        sample(domain, &wanted[..count], &st[..count]);
    } else {
        for k in 0..n {
            let st = [Vec2::ZERO, Vec2::X];
            let count = 1 + usize::from(wants_middle(k));
            budget.check()?;
            if wants_corner(k) {
                let wanted = [2 * k, 2 * k + 1];
                sample(
                    PatchDomain::Corner(k as u32),
                    &wanted[..count],
                    &st[..count],
                );
            }
        }
    }

    let points = &part.points;
    let at = |slot: usize| &points[slot * keys..(slot + 1) * keys];
    for k in 0..n {
        budget.check()?;
        if (wants.corner)(k) {
            part.vertices.extend_from_slice(at(2 * k));
        }
        if !(wants.edge)(k) {
            continue;
        }
        if straight {
            part.pool.push_segment(keys);
            continue;
        }
        let forward = runs_forward(vertices, k);
        let (mut start, mut end) = (at(2 * k), at(2 * ((k + 1) % n)));
        if !forward {
            std::mem::swap(&mut start, &mut end);
        }
        let samples = &mut part.samples;
        samples.clear();
        for point in [start, at(2 * k + 1), end] {
            samples.extend_from_slice(point);
        }
        let source = CurveSource::FaceEdge {
            corners: n as u32,
            k: k as u32,
            forward,
        };
        let finite = samples.iter().all(|p| p.is_finite());
        if !finite
            || part
                .pool
                .build(sampler, &source, samples, MAX_DEPTH, rate)
                .is_err()
        {
            part.pool.push_broken(keys);
        }
    }
    Ok(())
}
