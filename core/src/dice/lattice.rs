//! The lattice of one patch, and the grids that lattices become.
//!
//! Vertices on a patch's sides are copies of canonical curve vertices; normals and channels there
//! are evaluated at the place of the vertex that was copied, so that both faces of an edge agree on
//! them where the surface does.

use super::face::Curves;
use super::metric::{Measured, RasterMetric};
use super::patch::Patch;
use super::sampler::{NotFinite, Sampler};
use crate::grid::{Grid, octahedral};
use crate::surface::PatchDomain;
use glam::{Vec2, Vec3};

/// Scratch of one lattice.
#[derive(Default)]
pub(super) struct Lattice {
    nu: usize,
    nv: usize,
    /// Place of each lattice vertex in the domain, row-major.
    st: Vec<Vec2>,
    /// What is evaluated: all of them, or the inner ones; and the middle, where asked for.
    evaluated: Vec<Vec2>,
    /// `[key][vertex]`.
    positions: Vec<Vec3>,
    /// `[key][vertex]`, or empty.
    normals: Vec<Vec3>,
    /// The middle at each key, where asked for.
    middle: Vec<Vec3>,
    /// Canonical vertices that the sides copy, side after side.
    copied: Vec<u32>,
    /// Vertices of one key, ready to measure.
    measured: Vec<Measured>,
    values: Vec<f32>,
}

impl Lattice {
    pub fn cell_count(&self) -> u64 {
        (self.nu * self.nv) as u64
    }

    /// Evaluates `patch` with `rates` cells along u and v, and at `middle`.
    pub fn evaluate(
        &mut self,
        sampler: &mut Sampler<'_>,
        curves: &Curves<'_>,
        patch: &Patch,
        rates: [u32; 2],
        with_normals: bool,
        middle: Option<Vec2>,
    ) -> Result<(), NotFinite> {
        let [nu, nv] = rates;
        (self.nu, self.nv) = (nu as usize, nv as usize);
        let row = self.nu + 1;
        let n = row * (self.nv + 1);
        let (low, extent) = (patch.low, patch.high - patch.low);
        self.st.clear();
        for j in 0..=nv {
            let t = low.y + extent.y * (j as f32 / nv as f32);
            self.st.extend((0..=nu).map(|i| {
                let s = low.x + extent.x * (i as f32 / nu as f32);
                Vec2::new(s, t)
            }));
        }
        // Each vertex on a side: which canonical vertex it is, and so where.
        let sides = [
            (0, 1, nu),
            (self.nu, row, nv),
            (row * self.nv, 1, nu),
            (0, row, nv),
        ];
        self.copied.clear();
        for (number, (&(start, stride, steps), side)) in sides.iter().zip(&patch.sides).enumerate()
        {
            let curve = curves.of(side);
            let collapsed = side.a == side.b;
            for i in 0..=steps {
                let vertex = curve.map(side.step(i, steps), steps);
                self.copied.push(vertex);
                if collapsed {
                    continue;
                }
                let f = side.fraction(curve.parameter(vertex));
                let at = &mut self.st[start + stride * i as usize];
                if number % 2 == 0 {
                    at.x = (low.x + extent.x * f).clamp(0.0, 1.0);
                } else {
                    at.y = (low.y + extent.y * f).clamp(0.0, 1.0);
                }
            }
        }

        self.evaluated.clear();
        if with_normals {
            self.evaluated.extend_from_slice(&self.st);
        } else {
            for j in 1..self.nv {
                self.evaluated
                    .extend_from_slice(&self.st[j * row + 1..j * row + self.nu]);
            }
        }
        self.evaluated.extend(middle);
        self.positions.clear();
        self.normals.clear();
        self.middle.clear();
        let keys = sampler.key_count();
        let m = self.evaluated.len();
        if m == 0 {
            self.positions.resize(n * keys, Vec3::ZERO);
        } else {
            let (positions, normals) =
                sampler.lattice(patch.domain, &self.evaluated, with_normals)?;
            for k in 0..keys {
                let at_key = &positions[k * m..(k + 1) * m];
                if with_normals {
                    self.positions.extend_from_slice(&at_key[..n]);
                    self.normals.extend_from_slice(&normals[k * m..k * m + n]);
                } else {
                    let first = self.positions.len();
                    self.positions.resize(first + n, Vec3::ZERO);
                    let inner = self.nu - 1;
                    for j in 1..self.nv {
                        self.positions[first + j * row + 1..][..inner]
                            .copy_from_slice(&at_key[(j - 1) * inner..][..inner]);
                    }
                }
                if middle.is_some() {
                    self.middle.push(at_key[m - 1]);
                }
            }
        }
        let mut copied = self.copied.iter();
        for (&(start, stride, steps), side) in sides.iter().zip(&patch.sides) {
            let curve = curves.of(side);
            for (i, &vertex) in copied.by_ref().take(steps as usize + 1).enumerate() {
                let index = start + stride * i;
                for (k, &p) in curve.vertex(vertex).iter().enumerate() {
                    self.positions[k * n + index] = p;
                }
            }
        }
        for k in 0..if with_normals { keys } else { 0 } {
            let normals = &mut self.normals[k * n..(k + 1) * n];
            mend_normals(&self.positions[k * n..(k + 1) * n], normals, row);
        }
        Ok(())
    }

    /// Longest inner lattice edges along u and along v, in pixels at the worst key. Edges on the
    /// sides have their own rates, and those that end there may be longer by half a step of a
    /// coarse side: they are left out as long as there are others.
    pub fn longest_inner_edges(&mut self, metric: &RasterMetric, keys: usize) -> [f32; 2] {
        let row = self.nu + 1;
        let n = row * (self.nv + 1);
        let inner = |cells: usize| if cells > 2 { 1..cells - 1 } else { 0..cells };
        // Of large lattices every other line is enough.
        let step = |cells: usize| if cells > 5 { 2 } else { 1 };
        let mut longest = [0.0f32; 2];
        for k in 0..keys {
            let at = &self.positions[k * n..(k + 1) * n];
            self.measured.clear();
            self.measured
                .extend(at.iter().map(|&p| metric.measure(k, p)));
            let at = &self.measured;
            let length = |a: usize, b: usize| metric.length_between(k, &at[a], &at[b]);
            for j in (1..self.nv).step_by(step(self.nv)) {
                for i in inner(self.nu) {
                    let v = j * row + i;
                    longest[0] = longest[0].max(length(v, v + 1));
                }
            }
            for j in inner(self.nv) {
                for i in (1..self.nu).step_by(step(self.nu)) {
                    let v = j * row + i;
                    longest[1] = longest[1].max(length(v, v + row));
                }
            }
        }
        longest
    }

    /// Longest distance from the middle to a corner of a single cell, in pixels.
    pub fn farthest_from_middle(&self, metric: &RasterMetric, keys: usize) -> f32 {
        let n = self.st.len();
        let mut farthest = 0.0f32;
        for k in 0..keys {
            for &p in &self.positions[k * n..(k + 1) * n] {
                farthest = farthest.max(metric.length(k, self.middle[k], p));
            }
        }
        farthest
    }
}

/// Gives a direction to vertices without a normal (poles, collapsed edges): that of their
/// neighbours, or of the lattice's cells around them, on the side that the valid normals point to.
fn mend_normals(positions: &[Vec3], normals: &mut [Vec3], row: usize) {
    if normals.iter().all(|&n| n != Vec3::ZERO && n.is_finite()) {
        return;
    }
    let rows = normals.len() / row;
    let valid = |n: Vec3| n.is_finite() && n != Vec3::ZERO;
    let geometric = |i: usize, j: usize| {
        let at = |i: usize, j: usize| positions[j * row + i];
        let du = at((i + 1).min(row - 1), j) - at(i.saturating_sub(1), j);
        let dv = at(i, (j + 1).min(rows - 1)) - at(i, j.saturating_sub(1));
        du.cross(dv)
    };
    let known = normals.to_vec();
    let mut facing = 0.0f64;
    for j in 0..rows {
        for i in 0..row {
            let n = known[j * row + i];
            if valid(n) {
                facing += f64::from(geometric(i, j).dot(n));
            }
        }
    }
    let sign = if facing < 0.0 { -1.0 } else { 1.0 };
    for j in 0..rows {
        for i in 0..row {
            if valid(known[j * row + i]) {
                continue;
            }
            let mut sum = Vec3::ZERO;
            let mut flat = geometric(i, j);
            for y in j.saturating_sub(1)..(j + 2).min(rows) {
                for x in i.saturating_sub(1)..(i + 2).min(row) {
                    let n = known[y * row + x];
                    if valid(n) {
                        sum += n;
                    }
                    flat += geometric(x, y);
                }
            }
            normals[j * row + i] = sum
                .try_normalize()
                .or_else(|| (flat * sign).try_normalize())
                .unwrap_or(Vec3::ZERO);
        }
    }
}

/// Grids of a run of faces, in the layout of [`crate::grid`], vertices numbered from 0.
#[derive(Debug, Default)]
pub(super) struct Part {
    pub grids: Vec<Grid>,
    pub vertex_count: u64,
    pub positions: Vec<Vec3>,
    pub normals: Vec<u32>,
    pub channels: Vec<Vec<f32>>,
    pub normal_key_count: usize,
    /// Faces left out because something was not finite.
    pub dropped_faces: u64,
    pub evaluations: u64,
    element: u32,
    /// Lengths before the current face.
    mark: Option<Box<Mark>>,
}

#[derive(Debug, Default)]
struct Mark {
    grids: usize,
    vertex_count: u64,
    positions: usize,
    normals: usize,
    channels: Vec<usize>,
}

impl Part {
    pub fn new(channel_count: usize, normal_key_count: usize) -> Self {
        Self {
            channels: vec![Vec::new(); channel_count],
            normal_key_count,
            ..Self::default()
        }
    }

    /// Grids that follow belong to the authored face `element`.
    pub fn begin_face(&mut self, element: u32) {
        self.element = element;
        let mark = self.mark.get_or_insert_default();
        mark.grids = self.grids.len();
        mark.vertex_count = self.vertex_count;
        mark.positions = self.positions.len();
        mark.normals = self.normals.len();
        mark.channels.clear();
        mark.channels.extend(self.channels.iter().map(Vec::len));
    }

    /// Takes back what was added since [`Part::begin_face`].
    pub fn drop_face(&mut self) {
        self.dropped_faces += 1;
        if let Some(mark) = &self.mark {
            self.grids.truncate(mark.grids);
            self.vertex_count = mark.vertex_count;
            self.positions.truncate(mark.positions);
            self.normals.truncate(mark.normals);
            for (values, &length) in self.channels.iter_mut().zip(&mark.channels) {
                values.truncate(length);
            }
        }
    }

    /// Adds a lattice as a grid.
    pub fn push(&mut self, lattice: &mut Lattice, sampler: &mut Sampler<'_>, domain: PatchDomain) {
        let n = lattice.st.len();
        self.grids.push(Grid {
            // A part never has so many: the caller checks the sum.
            first_vertex: self.vertex_count as u32,
            element: self.element,
            nu: lattice.nu as u16,
            nv: lattice.nv as u16,
        });
        self.vertex_count += n as u64;
        self.positions.extend_from_slice(&lattice.positions);
        let normals = &lattice.normals[..(n * self.normal_key_count).min(lattice.normals.len())];
        self.normals
            .extend(normals.iter().map(|&n| octahedral::encode(n)));
        for (c, values) in self.channels.iter_mut().enumerate() {
            sampler.channel(c, domain, &lattice.st, &mut lattice.values);
            values.extend_from_slice(&lattice.values);
        }
    }
}
