//! Dices spheres: first what stands for each, then the vertices, both in parallel.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::lattice::{LatticeVertex, hemisphere, quad, turned};
use super::order::morton;
use crate::camera::Camera;
use crate::dice::fill::{Frame, Part, Size, fill};
use crate::dice::{DiceError, Eye, RasterMetric};
use crate::grid::{DicedMesh, MAX_GRID_RATE, octahedral};
use crate::motion::PointPath;
use crate::translate::points::PointKeys;
use crate::translate::values::Values;

/// How far an outline may be from its circle, in shading rates.
const TOLERANCE: f32 = 0.1;
/// Radius, in shading rates, up to which one cell is enough: its corners are a quarter of it out.
const ONE_CELL: f32 = 0.5;
/// Radius, in shading rates, from which a sphere has two halves: it may show its back, to a lens at its
/// side and one day to lights.
const FULL: f32 = 16.0;
/// Turns, in radians, up to which a hemisphere that faces the camera half way is enough: at both ends its
/// rim is 2 % nearer to the middle.
const MOST_TURN: f64 = 0.4;
/// Fewest cells along a side of a full sphere's halves: seen from its side, it is darker than it should
/// be where normals are interpolated over fewer.
const FEWEST_FULL: u16 = 12;
/// Most cells along a side of a hemisphere.
const MOST: u16 = 128;
/// Factor on the shading rate where there are too many micropolygons.
const COARSER: f32 = 4.0;
/// Turns up to which one key of normals serves, in radians.
const STEADY: f64 = 0.02;
/// Times that the rate is made coarser.
const ATTEMPTS: usize = 8;
/// Spheres that one thread takes at a time, at least.
const CHUNK: usize = 256;

/// Spheres, ready to be diced.
#[derive(Clone, Debug)]
pub struct SphereSet {
    /// Centres at keys, all finite.
    pub points: PointKeys,
    /// Which of them are rendered.
    pub elements: Vec<u32>,
    /// Diameters, finite and not negative.
    pub widths: Values,
}

impl SphereSet {
    /// Radius of a sphere, object space.
    fn radius(&self, element: u32) -> f64 {
        let floats = self.widths.floats();
        let at = match self.widths {
            Values::Constant(_) => 0,
            _ => element as usize,
        };
        0.5 * f64::from(floats[at])
    }
}

/// What is diced, and how finely.
pub struct SphereDice<'a> {
    /// The spheres, in object space.
    pub set: &'a SphereSet,
    /// From their centres' keys to the output keys and the space that is traced.
    pub path: &'a PointPath,
    /// Measures what `path` gives.
    pub metric: &'a RasterMetric,
    /// What they face; none where nothing may depend on where the camera is.
    pub camera: Option<&'a Camera>,
    /// Shading rate, pixels.
    pub shading_rate: f32,
    /// Above this the shading rate is made coarser.
    pub max_micropolygons: u64,
    /// Set from outside to stop early.
    pub cancel: &'a AtomicBool,
}

/// Diced spheres and what it took.
pub struct SphereDiced {
    /// The grids.
    pub mesh: DicedMesh,
    /// True where the budget of micropolygons made the rate coarser.
    pub coarsened: bool,
}

/// What stands for a sphere; n is the number of cells along a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Form {
    Nothing,
    Quad,
    Facing(u16),
    Full(u16),
}

impl Form {
    fn measure(self, size: &mut Size) {
        match self {
            Form::Nothing => {}
            Form::Quad => size.add(1, 1),
            Form::Facing(n) => each_tile(n, |i, j| size.add(i.len(), j.len())),
            Form::Full(n) => {
                for _ in 0..2 {
                    each_tile(n, |i, j| size.add(i.len(), j.len()));
                }
            }
        }
    }

    /// Normals are those that look right from the front, where there is one.
    fn lattice(self, has_front: bool) -> Vec<LatticeVertex> {
        match self {
            Form::Nothing => Vec::new(),
            Form::Quad => quad(),
            Form::Facing(n) | Form::Full(n) => hemisphere(n.into(), has_front),
        }
    }
}

/// Grids of an n x n lattice: ranges of cells along both sides.
fn each_tile(n: u16, mut tile: impl FnMut(std::ops::Range<usize>, std::ops::Range<usize>)) {
    let n = usize::from(n);
    let count = n.div_ceil(MAX_GRID_RATE as usize);
    let range = |i: usize| n * i / count..n * (i + 1) / count;
    for j in 0..count {
        for i in 0..count {
            tile(range(i), range(j));
        }
    }
}

/// Dices spheres.
///
/// # Errors
/// Cancelled, or too large for memory or 32-bit numbers.
pub fn dice(input: &SphereDice<'_>) -> Result<SphereDiced, DiceError> {
    let path = input.path;
    let order = morton(
        &input.set.points.points[0],
        input.set.elements.iter().copied(),
    );
    let eyes = input.camera.map(|c| Eye::at_keys(c, path));
    // What stands still is looked at over the whole shutter.
    let mut swing = Vec::new();
    if let Some(camera) = input.camera.filter(|c| c.is_moving()) {
        let times = [0.0, 0.5, 1.0];
        swing.extend(times.map(|t| Eye::new(camera, t, path.origin())));
    }
    let chunk = (order.len() / 64).max(CHUNK);
    let chunks: Vec<&[u32]> = order.chunks(chunk).collect();
    let mut rate = input.shading_rate;
    let mut coarsened = false;
    let mut forms = Vec::new();
    let mut sizes = Vec::new();
    let mut turn = 0.0;
    for attempt in 0..ATTEMPTS {
        let rater = Rater {
            input,
            eyes: eyes.as_deref(),
            swing: &swing,
            rate,
        };
        let rated: Vec<Rated> = chunks.par_iter().map(|c| rater.rate_all(c)).collect();
        if input.cancel.load(Ordering::Relaxed) {
            return Err(DiceError::Cancelled);
        }
        turn = rated.iter().map(|r| r.turn).fold(0.0, f64::max);
        (forms, sizes) = rated.into_iter().map(|r| (r.forms, r.size)).unzip();
        let cells: u64 = sizes.iter().map(|s: &Size| s.cells).sum();
        if cells <= input.max_micropolygons || attempt + 1 == ATTEMPTS {
            break;
        }
        coarsened = true;
        rate *= COARSER;
    }
    let lattices: BTreeMap<Form, Vec<LatticeVertex>> = forms
        .iter()
        .flatten()
        .copied()
        .collect::<std::collections::BTreeSet<Form>>()
        .into_iter()
        .map(|form| (form, form.lattice(eyes.is_some())))
        .collect();
    let turns = turn > STEADY
        || (1..path.key_times().len()).any(|k| path.normal_matrix(k) != path.normal_matrix(0));
    let frame = Frame {
        origin: path.origin(),
        key_times: path.key_times(),
        normal_keys: if turns { path.key_times().len() } else { 1 },
        channels: &[],
    };
    let mesh = fill(&frame, &sizes, |c, part| {
        let mut filler = Filler {
            input,
            eyes: eyes.as_deref(),
            lattices: &lattices,
            part,
        };
        for (&element, &form) in chunks[c].iter().zip(&forms[c]) {
            filler.fill(element, form);
        }
    })?;
    Ok(SphereDiced { mesh, coarsened })
}

/// The centre of a sphere at output key `key`, object space.
fn centre(input: &SphereDice<'_>, element: u32, key: usize) -> DVec3 {
    let (a, b, f) = input.path.blend(key);
    let at = |k: usize| input.set.points.points[k][element as usize].as_dvec3();
    if f == 0.0 {
        at(a)
    } else {
        at(a).lerp(at(b), f)
    }
}

/// Axes of a lattice that faces the camera where `matrix` places it (the last towards it), in object
/// space and unit length: the part of the sphere that is seen is the half towards the camera there.
fn axes(matrix: &DMat3, view: DVec3, before: Option<DVec3>) -> [DVec3; 3] {
    // The adjugate is the inverse up to a factor, and is there where the inverse is not.
    let (x, y, z) = (matrix.x_axis, matrix.y_axis, matrix.z_axis);
    let sign = if matrix.determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    let adjugate = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)).transpose();
    let front = (adjugate * view).normalize_or(DVec3::Z) * sign;
    let side = before
        .map(|s| s - front * s.dot(front))
        .and_then(DVec3::try_normalize)
        .unwrap_or_else(|| front.any_orthonormal_vector());
    [side, front.cross(side), front]
}

/// What stands for each sphere of a chunk.
struct Rated {
    forms: Vec<Form>,
    size: Size,
    /// Most that any of them turns to face the camera, radians.
    turn: f64,
}

struct Rater<'a> {
    input: &'a SphereDice<'a>,
    eyes: Option<&'a [Eye]>,
    /// The camera at several times, where it moves.
    swing: &'a [Eye],
    rate: f32,
}

impl Rater<'_> {
    fn rate_all(&self, elements: &[u32]) -> Rated {
        let mut rated = Rated {
            forms: vec![Form::Nothing; elements.len()],
            size: Size::default(),
            turn: 0.0,
        };
        if self.input.cancel.load(Ordering::Relaxed) {
            return rated;
        }
        for (form, &element) in rated.forms.iter_mut().zip(elements) {
            let turn;
            (*form, turn) = self.form(element);
            form.measure(&mut rated.size);
            if !matches!(form, Form::Full(_) | Form::Nothing) {
                rated.turn = rated.turn.max(turn);
            }
        }
        rated
    }

    /// What stands for a sphere, and how far that turns to face the camera, in radians.
    fn form(&self, element: u32) -> (Form, f64) {
        let radius = self.input.set.radius(element);
        if radius <= 0.0 {
            return (Form::Nothing, 0.0);
        }
        let path = self.input.path;
        let tolerance = TOLERANCE * self.rate;
        let (mut pixels, mut turn) = (0.0f32, 0.0f64);
        let mut fronts = None;
        for key in 0..path.key_times().len() {
            let matrix = path.matrix(key);
            let p = matrix.transform_point3(centre(self.input, element, key)) - path.origin();
            let view = self.eyes.map_or(DVec3::Z, |eyes| eyes[key].from(p));
            let [side, up, front] = axes(&matrix.matrix3, view, None);
            let placed = p.as_vec3();
            for across in [side, up] {
                let edge = (matrix.matrix3 * (across * radius)).as_vec3();
                pixels = pixels.max(self.input.metric.length(key, placed, placed + edge));
            }
            turn = turn.max(angle(fronts.unwrap_or(front), front));
            fronts = Some(front);
            if path.key_times().len() == 1 {
                for eye in self.swing {
                    let [.., other] = axes(&matrix.matrix3, eye.from(p), None);
                    turn = turn.max(2.0 * angle(front, other));
                }
            }
        }
        // The outline of a polygon of N sides with the disk's area is off it by up to r (pi/N)^2 / 3.
        let sides = std::f32::consts::PI * (pixels / (3.0 * tolerance)).sqrt();
        let n = 2 * ((sides / 8.0).ceil() as u16).clamp(1, MOST / 2);
        // Half a turn away from where it faces, a hemisphere's rim comes nearer by r (1 - cos).
        let near = f64::from(pixels) * (1.0 - (0.5 * turn).cos());
        let full = pixels > FULL * self.rate || near > f64::from(tolerance) || turn > MOST_TURN;
        let form = if self.eyes.is_none() || full {
            Form::Full(n.max(FEWEST_FULL))
        } else if pixels <= ONE_CELL * self.rate {
            Form::Quad
        } else {
            Form::Facing(n)
        };
        (form, turn)
    }
}

fn angle(a: DVec3, b: DVec3) -> f64 {
    f64::atan2(a.cross(b).length(), a.dot(b))
}

struct Filler<'a, 'p, 'q> {
    input: &'a SphereDice<'a>,
    eyes: Option<&'a [Eye]>,
    lattices: &'a BTreeMap<Form, Vec<LatticeVertex>>,
    part: &'p mut Part<'q>,
}

impl Filler<'_, '_, '_> {
    fn fill(&mut self, element: u32, form: Form) {
        let Some(lattice) = self.lattices.get(&form) else {
            return;
        };
        let (n, halves) = match form {
            Form::Nothing => return,
            Form::Quad => (1, 1),
            Form::Facing(n) => (n, 1),
            Form::Full(n) => (n, 2),
        };
        let path = self.input.path;
        let radius = self.input.set.radius(element);
        let keys = path.key_times().len();
        let row = usize::from(n) + 1;
        for half in 0..halves {
            let part = &mut *self.part;
            each_tile(n, |columns, rows| {
                let slot = part.grid(element, columns.len(), rows.len());
                let mut side = None;
                for key in 0..keys {
                    let matrix = path.matrix(key);
                    let normal_matrix = path.normal_matrix(key);
                    let p = centre(self.input, element, key);
                    let frame = match self.eyes {
                        None => [DVec3::X, DVec3::Y, DVec3::Z],
                        Some(eyes) => {
                            // A full sphere turns its best side once.
                            let key = if halves == 1 { key } else { keys / 2 };
                            let p = centre(self.input, element, key);
                            let matrix = path.matrix(key);
                            let view = eyes[key].from(matrix.transform_point3(p) - path.origin());
                            axes(&matrix.matrix3, view, side)
                        }
                    };
                    side = Some(frame[0]);
                    let frame = DMat3::from_cols(frame[0], frame[1], frame[2]);
                    let mut at = 0;
                    for j in rows.start..=rows.end {
                        for i in columns.start..=columns.end {
                            let mut v = lattice[j * row + i];
                            if half == 1 {
                                v = turned(&v);
                            }
                            let place = p + frame * (v.p * radius);
                            let place = (matrix.transform_point3(place) - path.origin()).as_vec3();
                            let normal = (normal_matrix * (frame * v.normal)).normalize_or_zero();
                            let normal = octahedral::encode(normal.as_vec3());
                            part.vertex(&slot, key, at, place, normal);
                            at += 1;
                        }
                    }
                }
            });
        }
    }
}
