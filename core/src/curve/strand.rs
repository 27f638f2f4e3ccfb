//! One curve at one instant: where its stations are, which way it runs there, and which way its
//! cross-section stands.
//!
//! Everything here is object space: an affine map takes a curve's cross-sections where it takes its
//! points, so ribbons and tubes are made before the map and follow M(t) p(t) with it.

use glam::{DMat3, DVec3};

use super::set::{CurveSet, Station};
use crate::dice::Eye;
use crate::motion::PointPath;
use crate::translate::curves::CurveSpan;

/// Turns sharper than this, on either side of a station, do not get longer miters: 2 is a turn by 120
/// degrees.
const LONGEST_MITER: f64 = 2.0;
/// Sines below this are no direction.
const LEAST_SINE: f64 = 1.0e-6;
/// A derivative shorter than this part of its segment is none: control points coincide.
const LEAST_SPEED: f64 = 1.0e-6;
/// Steepest slope of a tube's side that its normals follow.
const STEEPEST: f64 = 8.0;

/// A cross-section.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Section {
    /// Middle.
    pub p: DVec3,
    /// Unit directions in which the curve comes and leaves; they differ at corners only. Zero where the
    /// whole curve is one point.
    pub ways: [DVec3; 2],
    /// The mean of both, unit length.
    pub along: DVec3,
    /// Across, unit length, at a right angle to `along`: where a ribbon's edge is, and a tube's first
    /// vertex.
    pub side: DVec3,
    /// Radius.
    pub radius: f64,
    /// Changes of the radius along the curve, behind and ahead of here.
    pub slopes: [f64; 2],
}

impl Section {
    /// From the middle to the edge in direction `across` (unit, at a right angle to `along`): at a
    /// corner it is longer, so that straight pieces on both sides keep their width.
    pub fn edge(&self, across: DVec3) -> DVec3 {
        let offset = across * self.radius;
        if self.ways[0] == self.ways[1] {
            return offset;
        }
        let cosine = self.ways[0].dot(self.along);
        let bend = (self.ways[0] - self.along * cosine).normalize_or_zero();
        let longer = (1.0 / cosine).clamp(1.0, LONGEST_MITER) - 1.0;
        offset + bend * (offset.dot(bend) * longer)
    }
}

/// Evaluates curves of a set, one at a time.
pub struct Strand<'a> {
    set: &'a CurveSet,
    span: CurveSpan,
    /// The bound curve's points at the loaded key.
    points: Vec<DVec3>,
}

impl<'a> Strand<'a> {
    /// For any curve of `set`.
    pub fn new(set: &'a CurveSet) -> Self {
        Self {
            set,
            span: set.curves.spans[0],
            points: Vec::new(),
        }
    }

    /// Prepares a curve, with its points as they are at output key `key` of `path`.
    pub fn load(&mut self, span: &CurveSpan, path: &PointPath, key: usize) {
        self.span = *span;
        let keys = &self.set.curves.points.points;
        let (a, b, f) = path.blend(key);
        let range = span.first_point as usize..(span.first_point + span.point_count) as usize;
        let pairs = keys[a][range.clone()].iter().zip(&keys[b][range]);
        self.points.clear();
        self.points.extend(pairs.map(|(a, b)| {
            let a = a.as_dvec3();
            if f == 0.0 {
                a
            } else {
                a + (b.as_dvec3() - a) * f
            }
        }));
    }

    /// Control points of a segment.
    pub fn control(&self, segment: u32) -> [DVec3; 4] {
        let value = |i: usize| self.points[i];
        self.set
            .kind()
            .control(self.points.len(), segment as usize, value)
    }

    /// Cross-sections at `stations`, which run from the curve's begin to its end, with the [radii](CurveSet::radii) there. `side` is not
    /// set.
    pub fn sections(&self, stations: &[Station], radii: &[f64], out: &mut Vec<Section>) {
        let kind = self.set.kind();
        out.clear();
        let way = |control: &[DVec3; 4], t: f64| {
            // All control points but the first are its end.
            if kind.is_linear() {
                return (control[1] - control[0]).normalize_or_zero();
            }
            let d = kind.derivative(control, t);
            let size = (control[1] - control[0]).length()
                + (control[2] - control[1]).length()
                + (control[3] - control[2]).length();
            if d.length() > LEAST_SPEED * size {
                d.normalize_or_zero()
            } else {
                DVec3::ZERO
            }
        };
        let smooth = matches!(
            kind.basis,
            crate::scene::CurveBasis::Bspline | crate::scene::CurveBasis::CatmullRom
        );
        let mut control = self.control(0);
        let mut segment = 0;
        for (station, &radius) in stations.iter().zip(radii) {
            let before = control;
            let joint = station.segment != segment;
            if joint {
                control = self.control(station.segment);
            }
            // Stations need not stop at each joint.
            let enters = station.segment == segment + 1 && station.t == 0.0;
            segment = station.segment;
            let t = f64::from(station.t);
            let leaves = way(&control, t);
            let comes = if !smooth && joint && station.t == 0.0 {
                let last = if enters {
                    before
                } else {
                    self.control(segment - 1)
                };
                way(&last, 1.0)
            } else {
                leaves
            };
            out.push(Section {
                p: kind.point(&control, t),
                ways: [comes, leaves],
                along: DVec3::ZERO,
                side: DVec3::ZERO,
                radius,
                slopes: [0.0; 2],
            });
        }
        if kind.is_periodic() {
            self.close(smooth, way, out);
        }
        fill_ways(out);
        for s in out.iter_mut() {
            let sum = s.ways[0] + s.ways[1];
            s.along = sum.try_normalize().unwrap_or(s.ways[1]);
        }
        slopes(out);
        if kind.is_periodic() {
            let last = out.len() - 1;
            out[0].slopes[0] = out[last].slopes[0];
            out[last] = out[0];
        }
    }

    /// The last section of a periodic curve is its first.
    fn close(&self, smooth: bool, way: impl Fn(&[DVec3; 4], f64) -> DVec3, out: &mut [Section]) {
        if !smooth {
            out[0].ways[0] = way(&self.control(self.span.segments - 1), 1.0);
        }
        let first = out[0];
        if let Some(last) = out.last_mut() {
            *last = first;
        }
    }
}

/// Puts directions where derivatives vanish: those towards the neighbours.
fn fill_ways(sections: &mut [Section]) {
    let n = sections.len();
    for i in 0..n {
        let [comes, leaves] = sections[i].ways;
        if comes != DVec3::ZERO && leaves != DVec3::ZERO {
            continue;
        }
        let p = sections[i].p;
        let apart = |q: DVec3| (q != p).then(|| q - p).and_then(DVec3::try_normalize);
        let back = sections[..i].iter().rev().find_map(|s| apart(s.p));
        let ahead = sections[i + 1..].iter().find_map(|s| apart(s.p));
        let back = back.map(|d| -d);
        let comes = some(comes).or(back).or(some(leaves)).or(ahead);
        let leaves = some(leaves).or(ahead).or(comes);
        sections[i].ways = [comes.unwrap_or_default(), leaves.unwrap_or_default()];
    }
}

fn some(v: DVec3) -> Option<DVec3> {
    (v != DVec3::ZERO).then_some(v)
}

/// Changes of the radius along the curve, from the neighbours on both sides.
fn slopes(sections: &mut [Section]) {
    for i in 1..sections.len() {
        let (a, b) = (&sections[i - 1], &sections[i]);
        let slope = (b.radius - a.radius) / (b.p - a.p).length();
        // Also where it is NaN.
        let slope = if slope.abs() < STEEPEST { slope } else { 0.0 };
        sections[i - 1].slopes[1] = slope;
        sections[i].slopes[0] = slope;
    }
    let last = sections.len() - 1;
    sections[0].slopes[0] = sections[0].slopes[1];
    sections[last].slopes[1] = sections[last].slopes[0];
}

/// A vector at a right angle to `along`.
fn any_across(along: DVec3) -> DVec3 {
    if along == DVec3::ZERO {
        DVec3::X
    } else {
        along.any_orthonormal_vector()
    }
}

/// Fills sides that are not defined (zero) with their neighbours', turned into the cross-section.
fn fill_sides(sections: &mut [Section]) {
    let defined = |s: &Section| s.side != DVec3::ZERO;
    let first = sections.iter().find(|s| defined(s)).map(|s| s.side);
    let mut last = first.unwrap_or_else(|| any_across(sections[0].along));
    for s in sections {
        if defined(s) {
            last = s.side;
        } else {
            s.side = reject(last, s.along).unwrap_or_else(|| any_across(s.along));
        }
    }
}

/// The unit vector nearest to `v` at a right angle to `along`.
fn reject(v: DVec3, along: DVec3) -> Option<DVec3> {
    let r = v - along * v.dot(along);
    (r.length() > LEAST_SINE * v.length())
        .then(|| r.try_normalize())
        .flatten()
}

/// Sides of a ribbon that faces `eye` where `matrix` and `to_eye` place it: at a right angle to the
/// curve and to the view of it, so that the edges are the outline of the tube it stands for.
///
/// A ribbon has no first side: each takes the sign that is nearest to `before` (the sides in the
/// space that is traced, at the key before), or to its neighbour at the first key, and `before`
/// becomes the sides of this key.
pub fn face(
    sections: &mut [Section],
    matrix: &DMat3,
    to_eye: impl Fn(DVec3) -> DVec3,
    before: &mut Vec<DVec3>,
) {
    let transposed = matrix.transpose();
    for s in sections.iter_mut() {
        let (view, way) = (to_eye(s.p), *matrix * s.along);
        let normal = view.cross(way);
        s.side = if normal.length() > LEAST_SINE * view.length() * way.length() {
            (transposed * normal).normalize_or_zero()
        } else {
            DVec3::ZERO
        };
    }
    fill_sides(sections);
    let first_key = before.len() != sections.len();
    if first_key {
        before.clear();
    }
    for (i, s) in sections.iter_mut().enumerate() {
        let placed = *matrix * s.side;
        let near = if first_key {
            before.last().copied().unwrap_or(placed)
        } else {
            before[i]
        };
        let sign = if placed.dot(near) < 0.0 { -1.0 } else { 1.0 };
        s.side *= sign;
        if first_key {
            before.push(placed * sign);
        } else {
            before[i] = placed * sign;
        }
    }
}

/// Sides of a ribbon that lies across `normal(i)`.
pub fn lie_across(sections: &mut [Section], normal: impl Fn(usize) -> DVec3) {
    for (i, s) in sections.iter_mut().enumerate() {
        let n = normal(i);
        let side = n.cross(s.along);
        s.side = if side.length() > LEAST_SINE * n.length() {
            side.normalize_or_zero()
        } else {
            DVec3::ZERO
        };
    }
    fill_sides(sections);
}

/// Sides of a tube without twist: at the first key they go along the curve by double reflection (Wang,
/// Juettler, Zheng, Liu, "Computation of Rotation Minimizing Frames", ACM TOG 27(1), 2008), and what
/// they miss at the end of a closed curve is spread over its length; from key to key each turns no
/// more than its cross-section does. `before` holds the sides at the key before.
pub fn carry(sections: &mut [Section], closed: bool, before: &mut Vec<DVec3>) {
    if before.len() == sections.len() {
        for (s, side) in sections.iter_mut().zip(before.iter_mut()) {
            s.side = reject(*side, s.along).unwrap_or_else(|| any_across(s.along));
            *side = s.side;
        }
        return;
    }
    sections[0].side = any_across(sections[0].along);
    for i in 1..sections.len() {
        let (a, b) = (sections[i - 1], sections[i]);
        sections[i].side = reflect_twice(&a, &b);
    }
    if closed {
        spread_twist(sections);
    }
    before.clear();
    before.extend(sections.iter().map(|s| s.side));
}

fn reflect_twice(a: &Section, b: &Section) -> DVec3 {
    let mirror = |v: DVec3, axis: DVec3| {
        let c = axis.dot(axis);
        if c > 0.0 {
            v - axis * (2.0 / c * axis.dot(v))
        } else {
            v
        }
    };
    let step = b.p - a.p;
    let (side, along) = (mirror(a.side, step), mirror(a.along, step));
    let side = mirror(side, b.along - along);
    reject(side, b.along).unwrap_or_else(|| any_across(b.along))
}

/// Turns the sides of a closed curve evenly, so that the last is the first.
fn spread_twist(sections: &mut [Section]) {
    let n = sections.len();
    let (first, last) = (sections[0], sections[n - 1]);
    let binormal = first.along.cross(first.side);
    let angle = f64::atan2(last.side.dot(binormal), last.side.dot(first.side));
    let length = |s: &[Section]| (s[1].p - s[0].p).length();
    let total: f64 = sections.windows(2).map(length).sum();
    let mut gone = 0.0;
    for i in 1..n {
        gone += (sections[i].p - sections[i - 1].p).length();
        let s = &mut sections[i];
        let (sin, cos) = (-angle * gone / total.max(f64::MIN_POSITIVE)).sin_cos();
        s.side = s.side * cos + s.along.cross(s.side) * sin;
    }
    sections[n - 1] = first;
}

/// From a curve's point (object space) to the camera, where `path` places it at key `key`.
pub fn view_of(path: &PointPath, key: usize, eye: Eye) -> impl Fn(DVec3) -> DVec3 {
    let (matrix, origin) = (path.matrix(key), path.origin());
    move |p| eye.from(matrix.transform_point3(p) - origin)
}
