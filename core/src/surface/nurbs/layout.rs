//! The faces of a patch: pieces of spans along u and v, and which boundaries are one.

use glam::DVec3;

use super::{Basis, Net, NurbsPatch};
use crate::nurbs::Span;

/// Vertices of a face that is left out.
pub(super) const NO_FACE: u32 = u32::MAX;

/// Boundaries are one where they are no farther apart than this share of the patch's extent: what
/// rounding makes of coordinates that were once equal.
const SAME: f64 = 1.0e-6;

/// Faces needed around where a patch closes on itself, and between two poles: an edge is known by
/// its two vertices, so no two edges may have both in common.
const FEWEST_AROUND: usize = 3;
const FEWEST_BETWEEN_POLES: usize = 2;

/// A span, or an even part of one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// See [`Span::knot`].
    pub knot: usize,
    start: f64,
    end: f64,
    /// Vertex lines at its two ends.
    lines: [u32; 2],
}

impl Piece {
    /// The parameter `fraction` of the way.
    pub fn at(&self, fraction: f64) -> f64 {
        if fraction == 1.0 {
            self.end
        } else {
            self.start + (self.end - self.start) * fraction
        }
    }
}

/// Pieces along u and v, and faces over all pairs of them.
#[derive(Debug)]
pub(super) struct Layout {
    pieces: [Vec<Piece>; 2],
    /// Four vertices each, or [`NO_FACE`]; those along u follow each other.
    pub faces: Vec<[u32; 4]>,
}

impl Layout {
    pub fn new(patch: &NurbsPatch) -> Self {
        let seams = Seams::new(patch);
        let needed = |d: usize| {
            if seams.closed[d] {
                FEWEST_AROUND
            } else if seams.poles[d] == [true; 2] {
                FEWEST_BETWEEN_POLES
            } else {
                1
            }
        };
        let (along_u, u_lines) = pieces(patch, 0, needed(0), seams.closed[0]);
        let (along_v, v_lines) = pieces(patch, 1, needed(1), seams.closed[1]);
        // A boundary at a pole is one vertex: the one where its line begins.
        let vertex = |i: u32, j: u32| {
            let pole = |d: usize, line: u32, lines: u32| {
                let [low, high] = seams.poles[d];
                (low && line == 0) || (high && line == lines - 1)
            };
            let i = if pole(1, j, v_lines) { 0 } else { i };
            let j = if pole(0, i, u_lines) { 0 } else { j };
            j * u_lines + i
        };
        let mut faces = Vec::with_capacity(along_u.len() * along_v.len());
        for v in &along_v {
            for u in &along_u {
                let ([a, b], [c, d]) = (u.lines, v.lines);
                faces.push(if usable(patch, [u.knot, v.knot]) {
                    [vertex(a, c), vertex(b, c), vertex(b, d), vertex(a, d)]
                } else {
                    [NO_FACE; 4]
                });
            }
        }
        Self {
            pieces: [along_u, along_v],
            faces,
        }
    }

    /// The pieces along u and v of a face.
    pub fn pieces(&self, face: usize) -> [&Piece; 2] {
        let [u, v] = &self.pieces;
        [&u[face % u.len()], &v[face / u.len()]]
    }
}

/// True where every point that has a part in the spans can be used.
fn usable(patch: &NurbsPatch, knot: [usize; 2]) -> bool {
    let row = patch.knots[0].point_count();
    let range = |d: usize| knot[d] - patch.knots[d].degree()..=knot[d];
    patch.usable.is_empty() || range(1).all(|j| range(0).all(|i| patch.usable[j * row + i]))
}

/// Pieces of the spans of a direction, at least `needed`; and the number of vertex lines.
fn pieces(patch: &NurbsPatch, d: usize, needed: usize, closed: bool) -> (Vec<Piece>, u32) {
    let knots = &patch.knots[d];
    let spans = knots.spans();
    let parts = needed.div_ceil(spans.len());
    let mut pieces: Vec<Piece> = Vec::with_capacity(spans.len() * parts);
    let mut line = 0;
    for (number, span) in spans.iter().enumerate() {
        // Where the patch is torn the two sides have lines of their own.
        if number > 0 && knots.breaks_before(span) {
            line += 1;
        }
        let at = |part: usize| {
            if part == parts {
                span.end
            } else {
                span.start + (span.end - span.start) * part as f64 / parts as f64
            }
        };
        for part in 0..parts {
            pieces.push(Piece {
                knot: span.knot,
                start: at(part),
                end: at(part + 1),
                lines: [line, line + 1],
            });
            line += 1;
        }
    }
    match pieces.last_mut() {
        Some(last) if closed => {
            last.lines[1] = 0;
            (pieces, line)
        }
        _ => (pieces, line + 1),
    }
}

/// Which boundaries of a patch are one, at every key.
#[derive(Debug)]
struct Seams {
    /// Along u, along v: the two ends lie on one another.
    closed: [bool; 2],
    /// Along u, along v: the first and the last line are one point.
    poles: [[bool; 2]; 2],
}

impl Seams {
    fn new(patch: &NurbsPatch) -> Self {
        let all = || patch.points.iter().flatten().map(|p| p.as_dvec3());
        let low = all().fold(DVec3::INFINITY, DVec3::min);
        let high = all().fold(DVec3::NEG_INFINITY, DVec3::max);
        let tolerance = SAME * (high - low).length();
        let mut seams = Self {
            closed: [false; 2],
            poles: [[false; 2]; 2],
        };
        let close = |a: &[DVec3], b: &[DVec3]| {
            let near = |(a, b): (&DVec3, &DVec3)| (*a - *b).length() <= tolerance;
            !a.is_empty() && a.len() == b.len() && a.iter().zip(b).all(near)
        };
        for d in 0..2 {
            let [first, last] = [false, true].map(|end| boundary(patch, d, end));
            seams.closed[d] = close(&first, &last);
            for (end, line) in [first, last].iter().enumerate() {
                // Lines of all keys, one after the other.
                let mut keys = line.chunks(line.len().div_ceil(patch.points.len()).max(1));
                let is_point = |key: &[DVec3]| close(key, &vec![key[0]; key.len()]);
                seams.poles[d][end] = !line.is_empty() && keys.all(is_point);
            }
        }
        // Both ends of a line that is all one point are that point.
        for d in 0..2 {
            if seams.poles[d] == [true; 2] {
                seams.closed[d] = false;
            }
        }
        seams
    }
}

/// Points of the line at the low or high end of direction `d`: ends and middles of spans across, at
/// every key.
fn boundary(patch: &NurbsPatch, d: usize, end: bool) -> Vec<DVec3> {
    let across = 1 - d;
    let spans = patch.knots[d].spans();
    let Some(span) = (if end { spans.last() } else { spans.first() }) else {
        return Vec::new();
    };
    let at = if end { span.end } else { span.start };
    let mut basis = Basis::new(patch);
    let mut net = Net::default();
    let others = patch.knots[across].spans();
    let mut points = vec![Vec::new(); patch.points.len()];
    for other in others {
        let Span { knot, start, end } = *other;
        let mut place = ([span.knot; 2], [at; 2]);
        place.0[across] = knot;
        if !usable(patch, place.0) {
            continue;
        }
        net.set(patch, place.0);
        for f in [0.0, 0.25, 0.5, 0.75, 1.0] {
            place.1[across] = start + (end - start) * f;
            basis.set(patch, place.0, place.1);
            for (key, points) in points.iter_mut().enumerate() {
                points.push(net.position(key, &basis));
            }
        }
    }
    points.concat()
}
