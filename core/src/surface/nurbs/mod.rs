//! [`NurbsSurface`]: a tensor product of non-uniform rational B-splines as a limit surface.
//!
//! Each face is the rectangle between neighbouring knots, in which the surface is smooth; normals
//! come from its own side of a knot, so that creases at repeated knots stay sharp. Where opposite
//! boundaries of the patch lie on one another the faces across share vertices and edges, and a
//! boundary that is all one point is one vertex: closed patches are closed, whatever form is authored.
//!
//! s runs along u, t along v; the front is where u, v and the normal are right-handed. Vertex
//! channels are blended as points are, weights included.

mod layout;

use glam::{DVec3, Vec2, Vec3};

use super::{
    Channel, ChannelInfo, ChannelKind, LimitEvaluator, LimitSamples, LimitSurface, Orientation,
    PatchDomain,
};
use crate::nurbs::Knots;
use layout::Layout;

/// Below this share of the product of their lengths, the cross product of two tangents is rounding...
const DEGENERATE: f64 = 1.0e-9;
/// ...and the normal is that of the point which lies so much of the way to the middle of the face.
const INWARD: f64 = 1.0e-4;

/// A checked patch: `knots[0].point_count() * knots[1].point_count()` points at each key, u fastest.
#[derive(Clone, Debug)]
pub struct NurbsPatch {
    /// Along u and along v.
    pub knots: [Knots; 2],
    /// Object-space points at each key.
    pub points: Vec<Vec<Vec3>>,
    /// Weights, above 0, one a point; empty where all are 1.
    pub weights: Vec<f64>,
    /// False where a point cannot be used: faces that it has a part in are left out. Empty where all
    /// can.
    pub usable: Vec<bool>,
    /// Winding.
    pub orientation: Orientation,
}

/// A primvar over a patch.
#[derive(Clone, Debug)]
pub struct NurbsChannel {
    /// Vertex (one value a point) or varying (one an end of a segment, `segment_count + 1` along u and
    /// v); lengths were checked by the caller.
    pub channel: Channel,
    /// A place has the value that weighs most there, bit for bit.
    pub nearest: bool,
}

impl From<Channel> for NurbsChannel {
    fn from(channel: Channel) -> Self {
        Self {
            channel,
            nearest: false,
        }
    }
}

/// A NURBS patch as a limit surface.
pub struct NurbsSurface {
    patch: NurbsPatch,
    layout: Layout,
    channels: Vec<NurbsChannel>,
    infos: Vec<ChannelInfo>,
}

impl NurbsSurface {
    /// A surface with channels.
    pub fn new(patch: NurbsPatch, channels: Vec<NurbsChannel>) -> Self {
        let infos = channels.iter().map(|c| ChannelInfo {
            width: c.channel.width,
        });
        Self {
            layout: Layout::new(&patch),
            infos: infos.collect(),
            patch,
            channels,
        }
    }
}

impl LimitSurface for NurbsSurface {
    fn face_count(&self) -> usize {
        self.layout.faces.len()
    }
    fn face_vertices(&self, face: u32) -> &[u32] {
        let face = &self.layout.faces[face as usize];
        if face[0] == layout::NO_FACE {
            &[]
        } else {
            face
        }
    }
    fn element(&self, _: u32) -> u32 {
        0
    }
    fn key_count(&self) -> usize {
        self.patch.points.len()
    }
    fn channels(&self) -> &[ChannelInfo] {
        &self.infos
    }
    fn is_polygonal(&self) -> bool {
        false
    }
    fn evaluator(&self) -> Box<dyn LimitEvaluator + '_> {
        Box::new(Evaluator {
            surface: self,
            face: 0,
            net: Net::default(),
            basis: Basis::new(&self.patch),
        })
    }
}

/// Basis functions of both directions at one point of the patch.
#[derive(Clone, Debug)]
struct Basis {
    values: [Vec<f64>; 2],
    slopes: [Vec<f64>; 2],
}

impl Basis {
    fn new(patch: &NurbsPatch) -> Self {
        let zeros = || [0, 1].map(|d: usize| vec![0.0; patch.knots[d].degree() + 1]);
        Self {
            values: zeros(),
            slopes: zeros(),
        }
    }

    fn set(&mut self, patch: &NurbsPatch, knot: [usize; 2], at: [f64; 2]) {
        for d in 0..2 {
            patch.knots[d].basis(knot[d], at[d], &mut self.values[d], &mut self.slopes[d]);
        }
    }
}

/// Homogeneous sums at one point of the patch: (x w, y w, z w) and w.
type Sum = (DVec3, f64);

/// A point and its tangents along u and v.
struct Point {
    position: DVec3,
    along: [DVec3; 2],
}

/// The control points of one span at every key, weighted: `[key][j][i]`.
#[derive(Clone, Debug, Default)]
struct Net {
    points: Vec<Sum>,
    columns: usize,
    per_key: usize,
}

impl Net {
    fn set(&mut self, patch: &NurbsPatch, knot: [usize; 2]) {
        let degree = [0, 1].map(|d: usize| patch.knots[d].degree());
        let row = patch.knots[0].point_count();
        self.columns = degree[0] + 1;
        self.per_key = self.columns * (degree[1] + 1);
        self.points.clear();
        for key in &patch.points {
            for j in knot[1] - degree[1]..=knot[1] {
                for i in knot[0] - degree[0]..=knot[0] {
                    let at = j * row + i;
                    let weight = patch.weights.get(at).copied().unwrap_or(1.0);
                    self.points.push((key[at].as_dvec3() * weight, weight));
                }
            }
        }
    }

    fn sum(&self, key: usize, u: &[f64], v: &[f64]) -> Sum {
        let mut sum = (DVec3::ZERO, 0.0);
        let points = &self.points[key * self.per_key..][..self.per_key];
        for (row, v) in points.chunks_exact(self.columns).zip(v) {
            let mut part = (DVec3::ZERO, 0.0);
            for ((p, w), u) in row.iter().zip(u) {
                part = (part.0 + *p * *u, part.1 + w * u);
            }
            sum = (sum.0 + part.0 * *v, sum.1 + part.1 * v);
        }
        sum
    }

    fn position(&self, key: usize, basis: &Basis) -> DVec3 {
        let (p, w) = self.sum(key, &basis.values[0], &basis.values[1]);
        p / w
    }

    fn point(&self, key: usize, basis: &Basis) -> Point {
        let ([u, v], [du, dv]) = (&basis.values, &basis.slopes);
        let (p, w) = self.sum(key, u, v);
        let position = p / w;
        let slope = |(p, dw): Sum| (p - position * dw) / w;
        Point {
            position,
            along: [slope(self.sum(key, du, v)), slope(self.sum(key, u, dv))],
        }
    }
}

impl Point {
    /// The unit normal; `None` where the tangents give none.
    fn normal(&self) -> Option<DVec3> {
        // Unit tangents first: patches may be far longer than wide.
        let [u, v] = self.along;
        let (lu, lv) = (u.length(), v.length());
        let n = (u / lu).cross(v / lv);
        let longest = lu.max(lv);
        (lu.min(lv) > longest * DEGENERATE && n.length() > DEGENERATE).then(|| n.normalize())
    }
}

struct Evaluator<'a> {
    surface: &'a NurbsSurface,
    face: usize,
    net: Net,
    basis: Basis,
}

impl Evaluator<'_> {
    /// The spans of the bound face, and where `(s, t)` lies in them.
    fn place(&self, s: f64, t: f64) -> ([usize; 2], [f64; 2]) {
        let pieces = self.surface.layout.pieces(self.face);
        (pieces.map(|p| p.knot), [pieces[0].at(s), pieces[1].at(t)])
    }
}

impl LimitEvaluator for Evaluator<'_> {
    fn bind(&mut self, face: u32) {
        self.face = face as usize;
        let (knot, _) = self.place(0.0, 0.0);
        self.net.set(&self.surface.patch, knot);
    }

    fn evaluate(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        with_normals: bool,
        out: &mut LimitSamples,
    ) {
        debug_assert_eq!(domain, PatchDomain::Whole);
        let patch = &self.surface.patch;
        let front = match patch.orientation {
            Orientation::RightHanded => 1.0,
            Orientation::LeftHanded => -1.0,
        };
        let (n, keys) = (st.len(), patch.points.len());
        out.positions.clear();
        out.positions.resize(n * keys, Vec3::ZERO);
        out.normals.clear();
        if with_normals {
            out.normals.resize(n * keys, Vec3::ZERO);
        }
        for (i, st) in st.iter().enumerate() {
            let [s, t] = [st.x, st.y].map(|x| f64::from(x).clamp(0.0, 1.0));
            let (knot, at) = self.place(s, t);
            self.basis.set(patch, knot, at);
            let mut lost = false;
            for key in 0..keys {
                if !with_normals {
                    out.positions[key * n + i] = self.net.position(key, &self.basis).as_vec3();
                    continue;
                }
                let point = self.net.point(key, &self.basis);
                out.positions[key * n + i] = point.position.as_vec3();
                match point.normal() {
                    Some(normal) => out.normals[key * n + i] = (normal * front).as_vec3(),
                    None => lost = true,
                }
            }
            if lost {
                let inward = |x: f64| x + (0.5 - x) * INWARD;
                let (knot, at) = self.place(inward(s), inward(t));
                self.basis.set(patch, knot, at);
                for key in 0..keys {
                    let normal = &mut out.normals[key * n + i];
                    if *normal == Vec3::ZERO {
                        let beside = self.net.point(key, &self.basis).normal();
                        *normal = (beside.unwrap_or(DVec3::ZERO) * front).as_vec3();
                    }
                }
            }
        }
    }

    fn hull(&mut self, out: &mut Vec<Vec3>) -> bool {
        out.clear();
        // Weights below 0 make a rational mean leave the hull.
        let sound = self.net.points.iter().all(|&(_, w)| w > 0.0);
        out.extend(self.net.points.iter().map(|&(p, w)| (p / w).as_vec3()));
        sound
    }

    fn evaluate_channel(
        &mut self,
        channel: usize,
        domain: PatchDomain,
        st: &[Vec2],
        out: &mut Vec<f32>,
    ) {
        debug_assert_eq!(domain, PatchDomain::Whole);
        out.clear();
        let patch = &self.surface.patch;
        let NurbsChannel { channel, nearest } = &self.surface.channels[channel];
        let Channel {
            kind,
            width,
            values,
            ..
        } = channel;
        let mut sums = vec![0.0f64; *width];
        for st in st {
            let [s, t] = [st.x, st.y].map(|x| f64::from(x).clamp(0.0, 1.0));
            let (knot, at) = self.place(s, t);
            let first = [0, 1].map(|d: usize| knot[d] - patch.knots[d].degree());
            // Bilinear between ends of segments, or the basis over points.
            let (row, sides) = match kind {
                ChannelKind::Varying => {
                    let f = [0, 1].map(|d: usize| patch.knots[d].fraction(knot[d], at[d]));
                    for (d, f) in f.iter().enumerate() {
                        self.basis.values[d][..2].copy_from_slice(&[1.0 - f, *f]);
                    }
                    (patch.knots[0].segment_count() + 1, [2, 2])
                }
                _ => {
                    self.basis.set(patch, knot, at);
                    let sides = [0, 1].map(|d: usize| patch.knots[d].degree() + 1);
                    (patch.knots[0].point_count(), sides)
                }
            };
            let rational = *kind != ChannelKind::Varying;
            sums.fill(0.0);
            let mut total = 0.0;
            let mut heaviest = (f64::NEG_INFINITY, 0);
            for (j, v) in self.basis.values[1][..sides[1]].iter().enumerate() {
                for (i, u) in self.basis.values[0][..sides[0]].iter().enumerate() {
                    let at = (first[1] + j) * row + first[0] + i;
                    let weight = patch.weights.get(at).filter(|_| rational).unwrap_or(&1.0);
                    let share = u * v * weight;
                    total += share;
                    if share > heaviest.0 {
                        heaviest = (share, at);
                    }
                    let value = &values[at * width..][..*width];
                    for (sum, x) in sums.iter_mut().zip(value) {
                        *sum += share * f64::from(*x);
                    }
                }
            }
            if *nearest {
                out.extend_from_slice(&values[heaviest.1 * width..][..*width]);
            } else {
                out.extend(sums.iter().map(|sum| (sum / total) as f32));
            }
        }
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
