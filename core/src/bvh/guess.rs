//! A frame for a range of parts of strands, and what it would leave of their boxes: from
//! directions and boxes alone, 8 items at once.

use glam::Vec3;
use hdtrapeze_simd::{Float, Kernel, Mask, Simd};

use super::Frame;
use super::sorted::{Hull, Sorted};

/// Ranges with a smaller mean cosine of the angle to the mean direction are not turned.
const LEAST_COSINE: f32 = 0.8;
/// How wide a strand is along two axes at right angles to it, each, in units of the sum of its widths along the axes of
/// space: from 0.29 to 0.5 at most times. In fur, areas that are guessed with it are 0.8 to 1 of those that are found.
const WIDTH: f32 = 0.4;

/// Mean directions at both ends of the shutter with a smaller sine of the angle between them do not turn.
const LEAST_TURN: f32 = 0.01;

/// A frame that may suit a range.
pub struct Guess {
    /// Along the mean direction of strands at both ends of the shutter, which may be the same, and the direction in which
    /// they differ most, or that at right angles to their turn.
    pub ends: [Frame; 2],
    /// Areas of boxes as they are.
    pub before: f32,
    /// About those in the frame, rather less.
    pub after: f32,
}

/// Finds it, from items and the way from end to end of each in mid-shutter, and half of what that changes by from start to end; none where
/// these differ too much, or one is zero.
pub struct Guessed<'a, H: Hull> {
    /// The items.
    pub items: &'a [Sorted<H>],
    /// Their directions.
    pub directions: &'a [[Vec3; 2]],
    /// The least mean cosine, in units of [`LEAST_COSINE`].
    pub coherence: f32,
}

impl<H: Hull> Kernel for Guessed<'_, H> {
    type Output = Option<Guess>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Guess> {
        let Self {
            items,
            directions,
            coherence,
        } = self;
        let directions = by_eight::<H>(directions);
        let way = way(simd, &directions.mean, items.len())?;
        let Means { mean, half, length } = means::<S, H>(simd, &directions, way);
        // Written so that NaN fails.
        let coherent = mean.length() > coherence * LEAST_COSINE * length;
        if !coherent {
            return None;
        }
        let axis = mean.try_normalize()?;
        let frame = Frame::from_edges(axis, farthest(simd, &directions.mean, axis))?;
        let (before, after) = areas(simd, items, &directions, &[frame; 2]);
        let fixed = Guess {
            ends: [frame; 2],
            before,
            after,
        };
        if !H::MOVES {
            return Some(fixed);
        }
        let [start, end] = [mean - half, mean + half];
        let (across, size) = (start.cross(end), start.length() * end.length());
        let turns = across.length() > LEAST_TURN * size;
        if !turns {
            return Some(fixed);
        }
        let (Some(start), Some(end)) = (
            Frame::from_edges(start, across),
            Frame::from_edges(end, across),
        ) else {
            return Some(fixed);
        };
        let ends = [start, end];
        let (_, after) = areas(simd, items, &directions, &ends);
        if fixed.after <= after {
            return Some(fixed);
        }
        Some(Guess {
            ends,
            before,
            after,
        })
    }
}

/// More or less along all strands. Strands have no sense: sums of products of coordinates do not change where one is turned
/// round. Their matrix, applied to the axis of space that strands follow most, tells the way.
#[inline(always)]
fn way<S: Simd>(simd: S, directions: &[Eight], count: usize) -> Option<Vec3> {
    let zero = simd.all8(0.0);
    let mut sums = [zero; 6];
    let mut none = 0;
    for (number, part) in directions.iter().enumerate() {
        let [x, y, z] = load(simd, part);
        let own = [x * x, y * y, z * z, x * y, y * z, z * x];
        for (sum, own) in sums.iter_mut().zip(own) {
            *sum = *sum + own;
        }
        let there = (1 << (count - 8 * number).min(8)) - 1;
        none |= (own[0] + own[1] + own[2]).le(zero).bits() & there;
    }
    if none != 0 {
        return None;
    }
    let (xx, yy, zz) = (total(sums[0]), total(sums[1]), total(sums[2]));
    let (xy, yz, zx) = (total(sums[3]), total(sums[4]), total(sums[5]));
    Some(if xx >= yy && xx >= zz {
        Vec3::new(xx, xy, zx)
    } else if yy >= zz {
        Vec3::new(xy, yy, yz)
    } else {
        Vec3::new(zx, yz, zz)
    })
}

/// Sums over directions, those that point the other way turned round.
struct Means {
    /// Of directions in mid-shutter.
    mean: Vec3,
    /// Of half of what they change by.
    half: Vec3,
    /// Of lengths in mid-shutter.
    length: f32,
}

#[inline(always)]
fn means<S: Simd, H: Hull>(simd: S, directions: &Directions, way: Vec3) -> Means {
    let zero = simd.all8(0.0);
    let way = copies(simd, way);
    let (mut sum, mut halves, mut lengths) = ([zero; 3], [zero; 3], zero);
    for (number, part) in directions.mean.iter().enumerate() {
        let d = load(simd, part);
        let back = dot(d, way).lt(zero);
        for axis in 0..3 {
            sum[axis] = sum[axis] + (-d[axis]).or(back, d[axis]);
        }
        if H::MOVES {
            let half = load(simd, &directions.half[number]);
            for axis in 0..3 {
                halves[axis] = halves[axis] + (-half[axis]).or(back, half[axis]);
            }
        }
        let mut own = dot(d, d).to_array();
        for length in &mut own {
            *length = length.sqrt();
        }
        lengths = lengths + simd.from8(&own);
    }
    let of = |sum: [S::F8; 3]| Vec3::new(total(sum[0]), total(sum[1]), total(sum[2]));
    Means {
        mean: of(sum),
        half: of(halves),
        length: total(lengths),
    }
}

/// What the direction that differs most from an axis has beside it.
#[inline(always)]
fn farthest<S: Simd>(simd: S, directions: &[Eight], axis: Vec3) -> Vec3 {
    let axis = copies(simd, axis);
    let (mut most, mut beside) = (simd.all8(-1.0), [simd.all8(0.0); 3]);
    for part in directions {
        let d = load(simd, part);
        let along = dot(d, axis);
        let off = [
            d[0] - axis[0] * along,
            d[1] - axis[1] * along,
            d[2] - axis[2] * along,
        ];
        let own = dot(off, off);
        let farther = most.lt(own);
        most = own.or(farther, most);
        for axis in 0..3 {
            beside[axis] = off[axis].or(farther, beside[axis]);
        }
    }
    let most = most.to_array();
    let lane = (0..8).fold(0, |a, b| if most[b] > most[a] { b } else { a });
    let [x, y, z] = beside;
    Vec3::new(x.to_array()[lane], y.to_array()[lane], z.to_array()[lane])
}

/// Areas of the boxes of items, as they are and about as they would be in a frame whose first axis is along them, at both ends
/// of the shutter.
#[inline(always)]
fn areas<S: Simd, H: Hull>(
    simd: S,
    items: &[Sorted<H>],
    directions: &Directions,
    frames: &[Frame; 2],
) -> (f32, f32) {
    let zero = simd.all8(0.0);
    let (mut before, mut after) = (0.0, zero);
    for (number, (part, d)) in items.chunks(8).zip(&directions.mean).enumerate() {
        let d = load(simd, d);
        let (mut start, mut end) = (d, d);
        if H::MOVES {
            let half = load(simd, &directions.half[number]);
            for axis in 0..3 {
                start[axis] = d[axis] - half[axis];
                end[axis] = d[axis] + half[axis];
            }
        }
        let mut extents = [[0.0; 8]; 3];
        for (lane, item) in part.iter().enumerate() {
            let bounds = item.bounds.load(simd);
            before += H::area(simd, bounds);
            let own = H::extents(simd, bounds).to_array();
            for axis in 0..3 {
                extents[axis][lane % 8] = own[axis];
            }
        }
        // Along an axis, a box is as large as the strand is wide there, and as it goes far.
        let mut width = zero;
        for axis in 0..3 {
            let mut far = start[axis].abs();
            if H::MOVES {
                far = (far + end[axis].abs()) * simd.all8(0.5);
            }
            width = width + (simd.from8(&extents[axis]) - far).max(zero);
        }
        let width = width * simd.all8(WIDTH);
        let e0 = sizes(simd, start, &frames[0], width);
        if H::MOVES {
            // As in `LinearBox::mean_half_area`.
            let e1 = sizes(simd, end, &frames[1], width);
            let both = [e0[0] + e1[0], e0[1] + e1[1], e0[2] + e1[2]];
            let sum = products(e0) + products(e1) + products(both);
            after = after + sum * simd.all8(1.0 / 6.0);
        } else {
            after = after + products(e0);
        }
    }
    (before, total(after))
}

/// How large boxes are along the axes of a frame, of strands this wide.
#[inline(always)]
fn sizes<S: Simd>(simd: S, d: [S::F8; 3], frame: &Frame, width: S::F8) -> [S::F8; 3] {
    let [x, y, z] = frame.axes;
    [
        dot(d, copies(simd, x)).abs(),
        dot(d, copies(simd, y)).abs() + width,
        dot(d, copies(simd, z)).abs() + width,
    ]
}

#[inline(always)]
fn products<F: Float<8>>([x, y, z]: [F; 3]) -> F {
    x * y + y * z + z * x
}

/// Directions of 8 items, by axis.
type Eight = [[f32; 8]; 3];

/// Directions of items, 8 at a time; zero in lanes that are left.
struct Directions {
    /// In mid-shutter.
    mean: Vec<Eight>,
    /// Half of what they change by, where things move.
    half: Vec<Eight>,
}

#[inline(always)]
fn by_eight<H: Hull>(directions: &[[Vec3; 2]]) -> Directions {
    let count = directions.len().div_ceil(8);
    let mut mean = Vec::with_capacity(count);
    let mut half = Vec::with_capacity(if H::MOVES { count } else { 0 });
    for part in directions.chunks(8) {
        let mut eights = [Eight::default(); 2];
        for (lane, own) in part.iter().enumerate() {
            for axis in 0..3 {
                eights[0][axis][lane % 8] = own[0][axis];
                eights[1][axis][lane % 8] = own[1][axis];
            }
        }
        mean.push(eights[0]);
        if H::MOVES {
            half.push(eights[1]);
        }
    }
    Directions { mean, half }
}

#[inline(always)]
fn load<S: Simd>(simd: S, [x, y, z]: &Eight) -> [S::F8; 3] {
    [simd.from8(x), simd.from8(y), simd.from8(z)]
}

#[inline(always)]
fn copies<S: Simd>(simd: S, v: Vec3) -> [S::F8; 3] {
    [simd.all8(v.x), simd.all8(v.y), simd.all8(v.z)]
}

#[inline(always)]
fn dot<F: Float<8>>(a: [F; 3], b: [F; 3]) -> F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn total<F: Float<8>>(x: F) -> f32 {
    let [a, b, c, d, e, f, g, h] = x.to_array();
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}
