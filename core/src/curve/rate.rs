//! Stations: as many as a curve needs on screen, and no more.
//!
//! Each segment is cut evenly, by how far it bends from its chord (its second derivative bounds that) and
//! by how far its cross-section turns. Then stations are left out for as long as the chords that
//! remain stay within a tolerance of all that were there, edges included: a hair that is far away
//! becomes a few cells, however many segments it has. All this is measured in pixels at the worst key.
//! Stations are places on the curve, the same at every key, and each is evaluated once: cells
//! share them.

use glam::Vec3;

use super::layout::Form;
use super::set::{CurveSet, Station};
use super::strand::{Section, Strand, face, lie_across, view_of};
use crate::dice::{Eye, RasterMetric};
use crate::motion::PointPath;
use crate::scene::CurveForm;
use crate::translate::curves::CurveSpan;

/// How far a chord may be from its curve, and a polygon from its circle, in shading rates.
const TOLERANCE: f32 = 0.1;
/// Longest cell, in shading rates.
const LONGEST: f32 = 16.0;
/// Longest cell, in shading rates, within a segment whose primvars bend.
const LONGEST_SHADED: f32 = 4.0;
/// Longest cell, in shading rates, over several segments whose primvars differ.
const LONGEST_OVER_SEGMENTS: f32 = 2.0;
/// Most cells of one segment.
const MOST_PIECES: u32 = 256;
/// Times that a segment is cut anew because its cross-section turns.
const ROUNDS: usize = 5;
/// Cosine of the most that a cross-section turns within a cell: half way it is then 3 % narrower. What
/// is thinner than a pixel must not lose coverage.
const MOST_TURN: f32 = 0.88;
/// Keys that are looked at, at most.
const MOST_KEYS: usize = 5;

/// Diameter in pixels from which a curve is a tube if it may: below, one cannot tell a ribbon that is
/// shaded round from a tube; above, a curve that comes towards the camera shows that it has no end.
const TUBE_DIAMETER: f32 = 4.0;
/// Fewest sides of a tube. Odd numbers only: their outline has twice as many corners.
const FEWEST_SIDES: u16 = 5;
/// Most sides of a tube.
const MOST_SIDES: u16 = 255;
/// Radius in pixels from which a tube's ends are closed.
const CAP_RADIUS: f32 = 0.75;
/// Cosine of the least turn at which shading shows a corner, and the radius in pixels from which it is
/// worth one.
const CORNER: (f64, f32) = (0.866, 1.0);

/// How curves are rated.
pub struct Rating<'a> {
    set: &'a CurveSet,
    path: &'a PointPath,
    metric: &'a RasterMetric,
    /// The camera at each key of the path; none where shapes must not face it.
    eyes: Option<Vec<Eye>>,
    form: CurveForm,
    keys: Vec<usize>,
    /// Pixels.
    tolerance: f32,
    longest: f32,
    longest_over_segments: f32,
}

/// A curve as it is at one key.
#[derive(Default)]
struct Look {
    points: Vec<Vec3>,
    /// Radius, pixels.
    radii: Vec<f32>,
    /// Unit directions, of the edge and along the curve.
    sides: Vec<Vec3>,
    ways: Vec<Vec3>,
    /// Stations that turn sharply.
    corners: Vec<bool>,
}

/// One thread's curve.
pub struct Rater<'a> {
    rating: &'a Rating<'a>,
    strand: Strand<'a>,
    sections: Vec<Section>,
    /// Radii of the fine stations, object space.
    radii: Vec<f64>,
    before: Vec<glam::DVec3>,
    pieces: Vec<u32>,
    fine: Vec<Station>,
    looks: Vec<Look>,
}

impl<'a> Rating<'a> {
    /// For curves placed by `path` and seen as `metric` says. `eyes` are the camera at each key of
    /// the path, or none where nothing may depend on it.
    pub fn new(
        set: &'a CurveSet,
        path: &'a PointPath,
        metric: &'a RasterMetric,
        eyes: Option<Vec<Eye>>,
        form: CurveForm,
        shading_rate: f32,
    ) -> Self {
        let count = path.key_times().len();
        let looked = count.min(MOST_KEYS);
        let keys = (0..looked).map(|i| i * (count - 1) / (looked - 1).max(1));
        let bends = |c: &super::CurveChannel| {
            matches!(c.values, crate::translate::values::Values::Vertex(_))
        };
        let along = set.channels.iter().any(|c| c.values.is_along());
        let shaded = !set.kind().is_linear() && set.channels.iter().any(bends);
        let longest = if shaded { LONGEST_SHADED } else { LONGEST };
        let over = if along {
            LONGEST_OVER_SEGMENTS
        } else {
            LONGEST
        };
        Self {
            set,
            path,
            metric,
            eyes,
            form,
            keys: keys.collect(),
            tolerance: TOLERANCE * shading_rate,
            longest: longest * shading_rate,
            longest_over_segments: over * shading_rate,
        }
    }

    /// Sides of a tube of this radius in pixels.
    fn sides(&self, radius: f32) -> u16 {
        // A polygon as wide on the mean as its circle is off it by up to (pi/n)^2 / 3 of the radius.
        let n = std::f32::consts::PI * (radius / (3.0 * self.tolerance)).sqrt();
        (n.ceil().clamp(0.0, f32::from(MOST_SIDES)) as u16).max(FEWEST_SIDES) | 1
    }
}

impl<'a> Rater<'a> {
    /// For one thread.
    pub fn new(rating: &'a Rating<'a>) -> Self {
        Self {
            rating,
            strand: Strand::new(rating.set),
            sections: Vec::new(),
            radii: Vec::new(),
            before: Vec::new(),
            pieces: Vec::new(),
            fine: Vec::new(),
            looks: Vec::new(),
        }
    }

    /// Appends the stations of a curve; `None` where nothing of it can be seen, ever: it has no width or
    /// no length.
    pub fn plan(&mut self, span: &CurveSpan, stations: &mut Vec<Station>) -> Option<Form> {
        self.cut_evenly(span);
        for round in 0..=ROUNDS {
            self.make_fine(span);
            self.look(span);
            if round == ROUNDS || !self.cut_turning() {
                break;
            }
        }
        let moves = |look: &Look| look.points.iter().any(|p| *p != look.points[0]);
        if !self.looks.iter().any(moves) {
            return None;
        }
        let widest = self.largest(|look, i| look.radii[i]);
        if !self.radii.iter().any(|&radius| radius > 0.0) {
            return None;
        }
        let form = self.form(widest);
        self.mark_corners(widest);
        self.thin_out(form, stations);
        Some(form)
    }

    fn form(&self, widest: f32) -> Form {
        let rating = self.rating;
        if rating.set.normals.is_some() {
            return Form::Flat;
        }
        let tube = match rating.form {
            _ if rating.eyes.is_none() => true,
            CurveForm::Auto => 2.0 * widest > TUBE_DIAMETER,
            CurveForm::Ribbons => false,
            CurveForm::Tubes => true,
        };
        if !tube {
            return Form::Facing;
        }
        let last = self.fine.len() - 1;
        let ends = |look: &Look| look.radii[0].max(look.radii[last]);
        let end = self.looks.iter().map(ends).fold(0.0, f32::max);
        Form::Tube {
            sides: rating.sides(widest),
            caps: end >= CAP_RADIUS && !rating.set.kind().is_periodic(),
        }
    }

    /// Largest value over all keys and stations.
    fn largest(&self, value: impl Fn(&Look, usize) -> f32) -> f32 {
        self.looks
            .iter()
            .flat_map(|look| (0..self.fine.len()).map(move |i| (look, i)))
            .map(|(look, i)| value(look, i))
            .fold(0.0, f32::max)
    }

    /// Pieces of each segment by its bend and its length.
    fn cut_evenly(&mut self, span: &CurveSpan) {
        let rating = self.rating;
        let kind = rating.set.kind();
        self.pieces.clear();
        self.pieces.resize(span.segments as usize, 1);
        for &key in &rating.keys {
            self.strand.load(span, rating.path, key);
            let matrix = rating.path.matrix(key);
            let place = |p| (matrix.transform_point3(p) - rating.path.origin()).as_vec3();
            let measure = |a: Vec3, b: Vec3| rating.metric.length(key, a, b);
            for (segment, pieces) in self.pieces.iter_mut().enumerate() {
                let control = self.strand.control(segment as u32);
                let [a, m, b] = [0.0, 0.5, 1.0].map(|t| place(kind.point(&control, t)));
                let length = measure(a, m) + measure(m, b);
                let mut needed = (length / rating.longest).ceil();
                // A chord over 1/n of a segment misses it by at most the second derivative over 8 n^2.
                let mut off = 0.0f32;
                if !kind.is_linear() {
                    for bend in kind.bends(&control) {
                        let bend = (matrix.matrix3 * bend / 8.0).as_vec3();
                        off = off.max(measure(m, m + bend));
                    }
                }
                let width_bend = rating.set.radius_bend(span, segment as u32) / 8.0;
                if width_bend > 0.0 {
                    let across = matrix.matrix3 * glam::DVec3::splat(width_bend);
                    off = off.max(measure(m, m + across.as_vec3()));
                }
                needed = needed.max((off / rating.tolerance).sqrt().ceil());
                *pieces = (*pieces).max(needed.clamp(1.0, MOST_PIECES as f32) as u32);
            }
        }
    }

    fn make_fine(&mut self, span: &CurveSpan) {
        self.fine.clear();
        for (segment, &pieces) in self.pieces.iter().enumerate() {
            self.fine.extend((0..pieces).map(|i| Station {
                segment: segment as u32,
                t: i as f32 / pieces as f32,
                corner: false,
            }));
        }
        self.fine.push(Station {
            segment: span.segments - 1,
            t: 1.0,
            corner: false,
        });
    }

    /// Evaluates the fine stations at every key.
    fn look(&mut self, span: &CurveSpan) {
        let rating = self.rating;
        self.looks.resize_with(rating.keys.len(), Look::default);
        rating.set.radii(span, &self.fine, &mut self.radii);
        for (look, &key) in self.looks.iter_mut().zip(&rating.keys) {
            self.strand.load(span, rating.path, key);
            self.strand
                .sections(&self.fine, &self.radii, &mut self.sections);
            let matrix = rating.path.matrix(key);
            if rating.set.normals.is_some() {
                let normal = |i: usize| normal_at(rating.set, span, &self.fine[i]);
                lie_across(&mut self.sections, normal);
            } else if let Some(eyes) = &rating.eyes {
                let to_eye = view_of(rating.path, key, eyes[key]);
                self.before.clear();
                face(
                    &mut self.sections,
                    &matrix.matrix3,
                    to_eye,
                    &mut self.before,
                );
            } else {
                self.before.clear();
                super::strand::carry(&mut self.sections, false, &mut self.before);
            }
            look.points.clear();
            look.radii.clear();
            look.sides.clear();
            look.ways.clear();
            look.corners.clear();
            for s in &self.sections {
                let p = (matrix.transform_point3(s.p) - rating.path.origin()).as_vec3();
                let edge = (matrix.matrix3 * (s.side * s.radius)).as_vec3();
                look.points.push(p);
                look.radii.push(rating.metric.length(key, p, p + edge));
                let unit = |v: glam::DVec3| (matrix.matrix3 * v).normalize_or_zero().as_vec3();
                look.sides.push(unit(s.side));
                look.ways.push(unit(s.along));
                look.corners.push(s.ways[0].dot(s.ways[1]) < CORNER.0);
            }
        }
    }

    /// Cuts segments in which the cross-section turns too far between two stations; false where none.
    fn cut_turning(&mut self) -> bool {
        let mut any = false;
        for i in 1..self.fine.len() {
            let segment = self.fine[i - 1].segment as usize;
            let turned = self.looks.iter().any(|look| {
                // The pieces at a corner meet in one cross-section; no cutting makes it turn less.
                let joint = look.corners[i - 1] || look.corners[i];
                !joint && !self.turns_little(look, i - 1, i, self.rating.eyes.is_none())
            });
            if turned && self.pieces[segment] < MOST_PIECES {
                // Marked by the highest bit, so that it is doubled once.
                self.pieces[segment] |= 1 << 31;
                any = true;
            }
        }
        for pieces in &mut self.pieces {
            if *pieces >> 31 == 1 {
                *pieces = (2 * (*pieces & !(1 << 31))).min(MOST_PIECES);
            }
        }
        any
    }

    /// True where a straight cell from `a` to `b` keeps the edges within tolerance, as far as turning goes:
    /// in the middle, the chord of an edge that turns by phi is nearer by r phi^2 / 8.
    fn turns_little(&self, look: &Look, a: usize, b: usize, tube: bool) -> bool {
        let directions = if tube { &look.ways } else { &look.sides };
        let cosine = directions[a].dot(directions[b]);
        let radius = look.radii[a].max(look.radii[b]);
        radius * (1.0 - cosine) <= 4.0 * self.rating.tolerance && cosine > MOST_TURN
    }

    fn mark_corners(&mut self, widest: f32) {
        if widest < CORNER.1 {
            return;
        }
        for (i, station) in self.fine.iter_mut().enumerate() {
            station.corner = self.looks.iter().any(|look| look.corners[i]);
        }
    }

    /// Appends the stations that are needed.
    fn thin_out(&self, form: Form, stations: &mut Vec<Station>) {
        let tube = matches!(form, Form::Tube { .. });
        stations.push(self.fine[0]);
        let mut a = 0;
        while a + 1 < self.fine.len() {
            let mut b = a + 1;
            while b + 1 < self.fine.len() && self.is_straight(a, b + 1, tube) {
                b += 1;
            }
            stations.push(self.fine[b]);
            a = b;
        }
    }

    /// True where one cell from `a` to `b` stands for all that lies between.
    fn is_straight(&self, a: usize, b: usize, tube: bool) -> bool {
        let rating = self.rating;
        if (a + 1..b).any(|m| self.fine[m].corner) {
            return false;
        }
        let (first, last) = (&self.fine[a], &self.fine[b]);
        let one_segment =
            first.segment == last.segment || (last.segment == first.segment + 1 && last.t == 0.0);
        let longest = if one_segment {
            rating.longest
        } else {
            rating.longest_over_segments.min(rating.longest)
        };
        self.looks.iter().zip(&rating.keys).all(|(look, &key)| {
            let (p, q) = (look.points[a], look.points[b]);
            let chord = q - p;
            let squared = chord.length_squared();
            rating.metric.length(key, p, q) <= longest
                && self.turns_little(look, a, b, tube)
                && (a + 1..b).all(|m| {
                    let at = look.points[m];
                    let f = (at - p).dot(chord) / squared;
                    // Also where it is NaN.
                    let f = if f > 0.0 { f.min(1.0) } else { 0.0 };
                    let radius = look.radii[a] + (look.radii[b] - look.radii[a]) * f;
                    (look.radii[m] - radius).abs() <= rating.tolerance
                        && rating.metric.length(key, at, p + chord * f) <= rating.tolerance
                })
        })
    }
}

/// The authored normal at a place.
pub fn normal_at(set: &CurveSet, span: &CurveSpan, at: &Station) -> glam::DVec3 {
    set.normals.as_ref().map_or(glam::DVec3::ZERO, |normals| {
        glam::DVec3::from_array([0, 1, 2].map(|c| set.value(normals, 3, c, span, at)))
    })
}
