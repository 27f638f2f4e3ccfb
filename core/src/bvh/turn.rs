//! Frames that turn: oriented bounds of a block whose normal turns while the shutter is open.
//!
//! Slabs of a fixed frame are thick where normals turn. Here the third axis, the normal, goes linearly from where it is at the
//! start of the shutter to where it is at the end, `a(T) = (1 - T) a0 + T a1` as stored; nothing makes it unit length in between,
//! and nothing needs to. The other two stay where they are in mid-shutter: no axis is at right angles to others, and
//! the slabs' parallelepiped holds a turning surface as tightly as one that is still.
//!
//! **Bounds.** A vertex that goes linearly from `P0` at the first of two neighbouring keys to `P1` at the second, `h` later,
//! has at the part `s` of that time, between axes `a0` and `a1` there, the coordinate
//!
//! `(1 - s) a0.P0 + s a1.P1 - s (1 - s) w`, with `w = (a1 - a0).(P1 - P0)`,
//!
//! a chord and a bow; `w` is 0 for an axis that is fixed. Along each axis the frame adds `B(T) q`, with a number `q` of
//! its own, the *bow* of the frame. At keys, `B(T)` is `T (1 - T)`. Between two keys it goes straight where there are
//! from 3 to 9, and else it is `T (1 - T)` too ([`super::bowing`]), which is above its chord by `s (1 - s) h^2`. So with
//! `c0` and `c1` for `a.P + T (1 - T) q` at both keys, the coordinate is
//!
//! `(1 - s) c0 + s c1 - s (1 - s) l`, where `l` is `w`, or else `w - h^2 q`,
//!
//! and `s (1 - s)` is at most 1/4. Where a bound that is linear in time is not above any vertex' `c` at any key, and `e` is
//! no less than any `l` of a segment and 0, the bound less `e/4` is below the coordinate at all times; the same
//! above. With two keys `h` is 1, and `T (1 - T)` is 0 at both. A ray is turned likewise: `a(T).O + B(T) q` stands for
//! its origin and `a(T).D` for its direction.
//!
//! **What `l` is.** The block's way, which all its vertices share, is in `q`: with two keys all that turns it along
//! the third axis, with more what best takes the path of its middle to a chord ([`Turn::through`]). Of an edge `E` of the
//! block, which is at right angles to the normal at both ends, `w` is `-(a0.E1 + a1.E0)`: nothing where the surface turns
//! about an axis in its plane, and nothing where it is sheared along its normal's way, if one of the two normals is
//! shortened so that both terms cancel ([`Turn::new`]).
//!
//! **Rounding of bounds**, in units of `U sum |P_i|`, where `|a1 - a0|` is less than 1.62: ends are off as in a fixed frame
//! ([`super::ROTATION_PAD`]), and keys between them by 1 more, for their axis, which is rounded once ([`INNER_PAD`]). A bow's
//! two differences are off by 1 of themselves each, its products by 1 and its sums by 2, and padding it by 1 again, of terms
//! that are up to 1.62 times as large: 9.8, and [`BOW_PAD`] is 16. Moving a bound by a quarter of what a bow has more
//! rounds three times, by `|lo| + e/4` at most each. With more than two keys `h^2 q`, where it counts, is rounded once, by
//! `|q|/4` in a quarter, and so is `T (1 - T) q`, whose sum with a coordinate, padded in its turn, rounds twice, by
//! `|lo| + |q|/4` each. [`BOWED_PAD`] is for `|lo| + |q|` there, and for `|lo| + e/4 + |q|` where a bound is moved.
//!
//! **What is stored.** Axes are whole numbers of 2^-14, of 16 bits: 36 bytes a frame ([`StoredTurn`]). They are rounded
//! before anything is found from them, by up to 2^-15 a component, and shortened before that, so that none is longer than 1.

use glam::Vec3;

use super::bowing::goes_straight;
use super::{Frame, U};

/// What bows are widened by, per `sum |P1_i - P0_i|` of the vertex at hand; see the module's text.
pub const BOW_PAD: f32 = 16.0 * U;

/// What bounds at keys between the ends are widened by in place of [`super::ROTATION_PAD`].
pub const INNER_PAD: f32 = 6.0 * U;

/// What bounds are moved outward by, per magnitude of what is added there; see the module's text.
pub const BOWED_PAD: f32 = 4.0 * U;

/// What slab tests are padded by in a frame that turns, in pads of others; derived in [`crate::trace::object_ray`].
pub const TURN_PADS: f32 = 1.5;

/// Cosine between both normals, at least: lines between them stay well away from 0.
const LEAST_COSINE: f32 = -0.3;

/// A normal is shortened to this at least.
const LEAST_LENGTH: f32 = 0.25;

/// Bows are no larger than this many times a block's reach; derived in [`crate::trace::object_ray`].
const MOST_BOW: f32 = 5.5;

/// What components of axes are whole numbers of.
const GRAIN: f32 = 1.0 / (1 << 14) as f32;

/// What axes are shortened to before they are rounded, which lengthens them by less.
const SHORTENED: f32 = 1.0 - 1.0 / (1 << 13) as f32;

/// Adding it to a number of less than 2^15 rounds that to a whole one, which the lowest 16 bits of the sum are.
const WHOLE: f32 = (3 << 22) as f32;

/// A frame whose third axis goes from one to another.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Turn {
    /// Axes that are fixed.
    pub axes: [Vec3; 2],
    /// The third axis at the start of the shutter and at its end, of unit length or less.
    pub normals: [Vec3; 2],
    /// What is added to coordinates, times [`B(T)`](super::bowing).
    pub bow: Vec3,
}

/// A block as it is at one end of the shutter.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Along its edges.
    pub frame: Frame,
    /// Its edges.
    pub edges: [Vec3; 2],
    /// Its middle.
    pub middle: Vec3,
}

/// A block as it is at a key between the ends.
#[derive(Clone, Copy, Debug)]
pub struct Between {
    /// The key's time.
    pub time: f32,
    /// As [`Pose::edges`].
    pub edges: [Vec3; 2],
    /// As [`Pose::middle`].
    pub middle: Vec3,
}

impl Turn {
    /// From one pose of a block to another. Fixed at the first where they are far apart.
    pub fn new(start: &Pose, end: &Pose) -> Turn {
        let ahead = |normals: [Vec3; 2], i: usize| {
            let (before, after) = (start.edges[i], end.edges[i]);
            (normals[0].dot(after), normals[1].dot(before))
        };
        let Some(mut turn) = Turn::between(start, end, [0, 1].into_iter(), ahead) else {
            return Turn::fixed(&rounded(&start.frame));
        };
        turn.bow.z = turn.step().dot(end.middle - start.middle);
        turn
    }

    /// The same through keys between. Fixed at `rest` where both poses are far apart.
    pub fn through(start: &Pose, inner: &[Between], end: &Pose, rest: &Frame) -> Turn {
        let along = |normals: [Vec3; 2], i: usize| {
            let Between { time, edges, .. } = &inner[i / 2];
            let edge = edges[i % 2];
            let [before, after] = normals.map(|normal| normal.dot(edge));
            ((1.0 - time) * before, time * after)
        };
        let mut turn = Turn::between(start, end, 0..2 * inner.len(), along)
            .unwrap_or_else(|| Turn::fixed(&rounded(rest)));
        let path = Path { start, inner, end };
        for axis in 0..3 {
            turn.bow[axis] = path.bow(&turn, axis);
        }
        turn
    }

    /// A frame without a bow from one pose to another, unless they are far apart. `along` gives what is to cancel: of
    /// the normals at both ends, one a number.
    #[inline(always)]
    fn between(
        start: &Pose,
        end: &Pose,
        edges: impl Iterator<Item = usize>,
        along: impl Fn([Vec3; 2], usize) -> (f32, f32),
    ) -> Option<Turn> {
        let mut normals = [start.frame.axes[2], end.frame.axes[2]];
        let first = start.frame.axes[0] + end.frame.axes[0];
        let second = (normals[0] + normals[1]).cross(first);
        // Written so that NaN is refused.
        let near = normals[0].dot(normals[1]) >= LEAST_COSINE;
        let middle = Frame::from_edges(first, second).filter(|_| near)?;
        // Of all sums of the first number, times a ratio, and the second, the least squares.
        let (mut own, mut both) = (0.0, 0.0);
        for i in edges {
            let (of_start, of_end) = along(normals, i);
            own += of_start * of_start;
            both -= of_start * of_end;
        }
        let ratio = both / own;
        // False where there is none.
        if (LEAST_LENGTH..=1.0).contains(&ratio) {
            normals[0] *= ratio;
        } else if (1.0..=1.0 / LEAST_LENGTH).contains(&ratio) {
            normals[1] *= 1.0 / ratio;
        }
        Some(Turn {
            axes: [middle.axes[0], middle.axes[1]].map(round),
            normals: normals.map(round),
            bow: Vec3::ZERO,
        })
    }

    /// A frame that does not turn.
    pub const fn fixed(frame: &Frame) -> Turn {
        let [x, y, z] = frame.axes;
        Turn {
            axes: [x, y],
            normals: [z; 2],
            bow: Vec3::ZERO,
        }
    }

    /// From the third axis at the start to that at the end.
    #[inline(always)]
    pub fn step(&self) -> Vec3 {
        self.normals[1] - self.normals[0]
    }

    /// True where coordinates of what is still change with time.
    #[inline(always)]
    pub fn turns(&self) -> bool {
        self.normals[0] != self.normals[1] || self.bow != Vec3::ZERO
    }

    /// Axes at `time`, each rounded once.
    pub fn at(&self, time: f32) -> Frame {
        let [x, y] = self.axes;
        let [from, to] = self.normals.map(|normal| normal.as_dvec3());
        Frame {
            axes: [x, y, (from + (to - from) * f64::from(time)).as_vec3()],
        }
    }
}

/// An axis, as it is stored.
#[inline(always)]
fn round(axis: Vec3) -> Vec3 {
    (axis * (SHORTENED / GRAIN) + WHOLE - WHOLE) * GRAIN
}

#[inline(always)]
fn rounded(frame: &Frame) -> Frame {
    Frame {
        axes: frame.axes.map(round),
    }
}

/// A [`Turn`] as it is stored.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct StoredTurn {
    /// Both that are fixed, then the third at the start and at the end, in grains.
    axes: [[i16; 3]; 4],
    bow: [f32; 3],
}

impl StoredTurn {
    /// Of one whose axes have been rounded.
    #[inline(always)]
    fn of(turn: &Turn) -> StoredTurn {
        let [x, y] = turn.axes;
        let [z0, z1] = turn.normals;
        let mut axes = [[0; 3]; 4];
        for (to, from) in axes.iter_mut().zip([x, y, z0, z1]) {
            let grains = (from * (1.0 / GRAIN) + WHOLE).to_array();
            for (to, from) in to.iter_mut().zip(grains) {
                *to = from.to_bits() as i16;
            }
        }
        StoredTurn {
            axes,
            bow: turn.bow.to_array(),
        }
    }
}

/// The way of a block's middle through more than two keys.
struct Path<'a> {
    start: &'a Pose,
    inner: &'a [Between],
    end: &'a Pose,
}

impl Path<'_> {
    /// Times of keys, and where the middle is then, relative to where it starts.
    fn knots(&self) -> impl Iterator<Item = (f32, Vec3)> + '_ {
        let first = (0.0, self.start.middle);
        let last = (1.0, self.end.middle);
        let inner = self.inner.iter().map(|key| (key.time, key.middle));
        let all = [first].into_iter().chain(inner).chain([last]);
        all.map(|(time, middle)| (time, middle - self.start.middle))
    }

    /// The bow along an axis: the least squares of what chords of the whole shutter leave at keys, or 0 where that is no
    /// worse.
    fn bow(&self, turn: &Turn, axis: usize) -> f32 {
        let excess = |time: f32, at: Vec3| {
            let whole = self.end.middle - self.start.middle;
            match axis {
                0 | 1 => turn.axes[axis].dot(at - whole * time),
                _ => {
                    let own = turn.normals[0] + turn.step() * time;
                    own.dot(at) - turn.normals[1].dot(whole) * time
                }
            }
        };
        let (mut sum, mut weight) = (0.0, 0.0);
        for (time, at) in self.knots() {
            let part = time * (1.0 - time);
            sum -= part * excess(time, at);
            weight += part * part;
        }
        let middles = self.inner.iter().map(|key| key.middle);
        let reach = middles
            .chain([self.start.middle, self.end.middle])
            .fold(0.0f32, |most, p| most.max(p.abs().max_element()));
        let bow = (sum / weight).clamp(-MOST_BOW * reach, MOST_BOW * reach);
        // What slabs of the middle alone are thick: what keys leave, and what segments add.
        let step = if axis == 2 { turn.step() } else { Vec3::ZERO };
        let straight = goes_straight(self.inner.len() + 2);
        let thick = |bow: f32| {
            let (mut lo, mut hi) = (0.0f32, 0.0f32);
            let (mut below, mut above) = (0.0f32, 0.0f32);
            let mut before = (0.0, Vec3::ZERO);
            for (time, at) in self.knots() {
                let x = excess(time, at) + time * (1.0 - time) * bow;
                (lo, hi) = (lo.min(x), hi.max(x));
                let h = time - before.0;
                let own = if straight { 0.0 } else { h * bow };
                let left = h * (step.dot(at - before.1) - own);
                (below, above) = (below.max(left), above.max(-left));
                before = (time, at);
            }
            (hi - lo) + 0.25 * (below + above)
        };
        // There is none where keys are so near one end that squares of their parts are 0.
        if bow.is_finite() && thick(bow) < thick(0.0) {
            bow
        } else {
            0.0
        }
    }
}

/// What blocks of a kind of tree are turned by: a [`Frame`], a [`Turn`], or one as it is stored.
pub trait Turning: Clone + Copy + std::fmt::Debug + Send + Sync + 'static {
    /// True where it may change with time.
    const TURNS: bool;
    /// No rotation.
    const IDENTITY: Self;
    /// One that does not turn.
    fn fixed(frame: Frame) -> Self;
    /// From one pose of a block to another, through keys between, or fixed at `rest` where nothing turns.
    fn through(start: &Pose, inner: &[Between], end: &Pose, rest: &Frame) -> Self;
    /// The same with two keys.
    fn between(start: &Pose, end: &Pose) -> Self;
    /// The same as a [`Turn`].
    fn turn(&self) -> Turn;
    /// As it is at the start.
    fn start(&self) -> Frame;
}

impl Turning for Frame {
    const TURNS: bool = false;
    const IDENTITY: Self = Frame::IDENTITY;
    fn fixed(frame: Frame) -> Self {
        frame
    }
    fn through(_: &Pose, _: &[Between], _: &Pose, rest: &Frame) -> Self {
        *rest
    }
    fn between(start: &Pose, _: &Pose) -> Self {
        start.frame
    }
    #[inline(always)]
    fn turn(&self) -> Turn {
        Turn::fixed(self)
    }
    #[inline(always)]
    fn start(&self) -> Frame {
        *self
    }
}

impl Turning for Turn {
    const TURNS: bool = true;
    const IDENTITY: Self = Turn::fixed(&Frame::IDENTITY);
    fn fixed(frame: Frame) -> Self {
        Turn::fixed(&frame)
    }
    fn through(start: &Pose, inner: &[Between], end: &Pose, rest: &Frame) -> Self {
        Turn::through(start, inner, end, rest)
    }
    fn between(start: &Pose, end: &Pose) -> Self {
        Turn::new(start, end)
    }
    #[inline(always)]
    fn turn(&self) -> Turn {
        *self
    }
    #[inline(always)]
    fn start(&self) -> Frame {
        let [x, y] = self.axes;
        Frame {
            axes: [x, y, self.normals[0]],
        }
    }
}

impl Turning for StoredTurn {
    const TURNS: bool = true;
    const IDENTITY: Self = {
        /// 1, in grains.
        const ONE: i16 = 1 << 14;
        StoredTurn {
            axes: [[ONE, 0, 0], [0, ONE, 0], [0, 0, ONE], [0, 0, ONE]],
            bow: [0.0; 3],
        }
    };
    fn fixed(frame: Frame) -> Self {
        StoredTurn::of(&Turn::fixed(&rounded(&frame)))
    }
    fn through(start: &Pose, inner: &[Between], end: &Pose, rest: &Frame) -> Self {
        StoredTurn::of(&Turn::through(start, inner, end, rest))
    }
    #[inline(always)]
    fn between(start: &Pose, end: &Pose) -> Self {
        StoredTurn::of(&Turn::new(start, end))
    }
    #[inline(always)]
    fn turn(&self) -> Turn {
        let [x, y, z0, z1] = self
            .axes
            .map(|axis| Vec3::from_array(axis.map(f32::from)) * GRAIN);
        Turn {
            axes: [x, y],
            normals: [z0, z1],
            bow: Vec3::from_array(self.bow),
        }
    }
    #[inline(always)]
    fn start(&self) -> Frame {
        self.turn().start()
    }
}
