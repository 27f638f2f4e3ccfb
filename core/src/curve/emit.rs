//! Ribbons and tubes: cross-sections to vertices and normals.

use glam::{DAffine3, DMat3, DVec3};

use super::layout::{Form, pieces, runs};
use super::set::Station;
use super::strand::Section;
use crate::dice::fill::{Part, Slot};
use crate::grid::octahedral;

/// How far the normals at a facing ribbon's edges lean to the sides, as a tangent. Interpolated across
/// the ribbon they are as bright under light from the camera, on the mean, as the tube it stands for:
/// asinh(k)/k = pi/4.
const ROUNDNESS: f64 = 1.5696;

/// The grids of one curve, taken but not filled: in the order of [`Form::measure`].
pub struct Taken {
    slots: Vec<Slot>,
}

impl Taken {
    /// Takes the grids of a curve.
    pub fn new(form: Form, stations: &[Station], element: u32, part: &mut Part<'_>) -> Self {
        let mut slots = Vec::new();
        for run in runs(stations) {
            match form {
                Form::Flat | Form::Facing => slots.push(part.grid(element, 1, run.len())),
                Form::Tube { sides, .. } => {
                    for piece in pieces(sides.into()) {
                        slots.push(part.grid(element, run.len(), piece.len()));
                    }
                }
            }
        }
        if let Form::Tube { sides, caps: true } = form {
            for piece in pieces(sides.into()).chain(pieces(sides.into())) {
                slots.push(part.grid(element, 1, piece.len()));
            }
        }
        Self { slots }
    }
}

/// What places one key's vertices.
pub struct Placing {
    /// Output key.
    pub key: usize,
    /// Object space to the space that is traced.
    pub matrix: DAffine3,
    /// The same for normals.
    pub normal_matrix: DMat3,
    /// What positions are relative to.
    pub origin: DVec3,
}

impl Placing {
    fn vertex(&self, part: &mut Part<'_>, slot: &Slot, at: usize, p: DVec3, normal: DVec3) {
        let p = (self.matrix.transform_point3(p) - self.origin).as_vec3();
        let normal = (self.normal_matrix * normal).normalize_or_zero().as_vec3();
        part.vertex(slot, self.key, at, p, octahedral::encode(normal));
    }
}

/// The direction of the curve that shading sees at a station, and the change of the radius: at
/// corners, those of the side it is on.
fn way(section: &Section, station: &Station, behind: bool) -> (DVec3, f64) {
    let [back, ahead] = section.slopes;
    match (station.corner, behind) {
        (false, _) => (section.along, 0.5 * (back + ahead)),
        (true, true) => (section.ways[0], back),
        (true, false) => (section.ways[1], ahead),
    }
}

/// Writes a ribbon at one key. `to_eye` is given for one that is shaded round.
pub fn ribbon(
    placing: &Placing,
    taken: &Taken,
    stations: &[Station],
    sections: &[Section],
    to_eye: Option<&dyn Fn(DVec3) -> DVec3>,
    part: &mut Part<'_>,
) {
    for (slot, run) in taken.slots.iter().zip(runs(stations)) {
        for (row, i) in (run.start..=run.end).enumerate() {
            let s = &sections[i];
            let (way, _) = way(s, &stations[i], row == run.len());
            let middle = way.cross(s.side);
            let (middle, lean) = match to_eye {
                None => (middle, DVec3::ZERO),
                Some(to_eye) => {
                    let placed = placing.normal_matrix * middle;
                    let away = placed.dot(to_eye(s.p)) < 0.0;
                    (if away { -middle } else { middle }, s.side * ROUNDNESS)
                }
            };
            let edge = s.edge(s.side);
            // In this order u x v points as the curve's direction x the side does.
            placing.vertex(part, slot, 2 * row, s.p + edge, middle + lean);
            placing.vertex(part, slot, 2 * row + 1, s.p - edge, middle - lean);
        }
    }
}

/// Cosines and sines of the corners of a tube's cross-section. The last is the first. Their radius is
/// the larger the fewer they are, so that the tube is as wide on the mean as a round one: the mean
/// width of a polygon is its perimeter over pi.
pub fn corners(sides: u16) -> Vec<[f64; 2]> {
    let step = std::f64::consts::TAU / f64::from(sides);
    let radius = 0.5 * step / (0.5 * step).sin();
    let mut ring: Vec<[f64; 2]> = (0..sides)
        .map(|j| {
            let (sin, cos) = (step * f64::from(j)).sin_cos();
            [radius * cos, radius * sin]
        })
        .collect();
    ring.push(ring[0]);
    ring
}

/// Writes a tube at one key, with its caps where it has some.
pub fn tube(
    placing: &Placing,
    taken: &Taken,
    form: Form,
    stations: &[Station],
    sections: &[Section],
    ring: &[[f64; 2]],
    part: &mut Part<'_>,
) {
    let sides = ring.len() - 1;
    let across = |s: &Section, j: usize| {
        // In this sense v runs around so that u x v points out.
        s.side * ring[j][0] + s.side.cross(s.along) * ring[j][1]
    };
    let mut slots = taken.slots.iter();
    for run in runs(stations) {
        let row = run.len() + 1;
        for piece in pieces(sides) {
            let Some(slot) = slots.next() else { return };
            for (column, i) in (run.start..=run.end).enumerate() {
                let s = &sections[i];
                let (way, slope) = way(s, &stations[i], column == run.len());
                for (line, j) in (piece.start..=piece.end).enumerate() {
                    let e = across(s, j);
                    let p = s.p + s.edge(e);
                    let out = (e - way * e.dot(way)).normalize_or_zero();
                    placing.vertex(part, slot, line * row + column, p, out - way * slope);
                }
            }
        }
    }
    if !matches!(form, Form::Tube { caps: true, .. }) {
        return;
    }
    let (first, last) = (&sections[0], &sections[sections.len() - 1]);
    for (s, out, rim) in [(first, -first.along, 1), (last, last.along, 0)] {
        for piece in pieces(sides) {
            let Some(slot) = slots.next() else { return };
            for (line, j) in (piece.start..=piece.end).enumerate() {
                let edge = s.p + s.edge(across(s, j));
                placing.vertex(part, slot, 2 * line + rim, edge, out);
                placing.vertex(part, slot, 2 * line + 1 - rim, s.p, out);
            }
        }
    }
}

/// Writes the values of a channel, `values` being one a station.
pub fn channel(
    taken: &Taken,
    form: Form,
    stations: &[Station],
    channel: usize,
    values: &[f32],
    part: &mut Part<'_>,
) {
    let width = values.len() / stations.len();
    let value = |i: usize| &values[i * width..][..width];
    let mut slots = taken.slots.iter();
    let Form::Tube { sides, caps } = form else {
        for (slot, run) in slots.zip(runs(stations)) {
            for (row, i) in (run.start..=run.end).enumerate() {
                part.value(slot, channel, 2 * row, value(i));
                part.value(slot, channel, 2 * row + 1, value(i));
            }
        }
        return;
    };
    let around = usize::from(sides);
    for run in runs(stations) {
        let row = run.len() + 1;
        for piece in pieces(around) {
            let Some(slot) = slots.next() else { return };
            for (column, i) in (run.start..=run.end).enumerate() {
                for line in 0..=piece.len() {
                    part.value(slot, channel, line * row + column, value(i));
                }
            }
        }
    }
    if !caps {
        return;
    }
    for end in [0, stations.len() - 1] {
        for piece in pieces(around) {
            let Some(slot) = slots.next() else { return };
            for vertex in 0..2 * (piece.len() + 1) {
                part.value(slot, channel, vertex, value(end));
            }
        }
    }
}
