//! Frames that turn: oriented bounds of a block whose normal turns while the shutter is open.
//!
//! Slabs of a fixed frame are thick where normals turn. Here the third axis, the normal, goes linearly from where it is at the
//! start of the shutter to where it is at the end, `a(T) = (1 - T) a0 + T a1` as stored; nothing makes it unit length in between,
//! and nothing needs to. The other two stay where they are in mid-shutter: no axis is at right angles to others, and
//! the slabs' parallelepiped holds a turning surface as tightly as one that is still.
//!
//! **Bounds.** A vertex that goes linearly from `P0` to `P1` has the coordinate
//!
//! `a(T).P(T) = (1 - T) a0.P0 + T a1.P1 - T (1 - T) w`, with `w = (a1 - a0).(P1 - P0)`,
//!
//! a chord and a bow. With any number `q`, the *bow* of the frame,
//!
//! `a(T).P(T) + T (1 - T) q = (1 - T) a0.P0 + T a1.P1 - T (1 - T) (w - q)`,
//!
//! and `T (1 - T)` is at most 1/4. So where `lo0 <= a0.P0` and `lo1 <= a1.P1` for all vertices, and `e` is no less than any
//! `w - q` and 0, bounds that go from `lo0 - e/4` to `lo1 - e/4` are below `a(T).P(T) + T (1 - T) q`; the same above. A
//! ray is turned likewise: `a(T).O + T (1 - T) q` stands for its origin and `a(T).D` for its direction.
//!
//! **What `w - q` is.** The block's way, which all its vertices share, is in `q`. Of an edge `E` of the block, which
//! is at right angles to the normal at both ends, `w` is `-(a0.E1 + a1.E0)`: nothing where the surface turns
//! about an axis in its plane, and nothing where it is sheared along its normal's way, if one of the two normals is
//! shortened so that both terms cancel ([`Turn::new`]).
//!
//! **Rounding of bounds**, in units of `U sum |P_i|`, where `|a1 - a0|` is less than 2: ends are off as in a fixed frame
//! ([`super::ROTATION_PAD`]); a bow's two differences by 1 of themselves each, its products by 1 and its sums by 2, and padding
//! it by 1 again, of terms that are up to twice as large: 12, and [`BOW_PAD`] is 16. Moving a bound by a quarter of what a bow
//! has more rounds three times, by `|lo| + e/4` at most each.

use glam::Vec3;

use super::{Frame, U};

/// What bows are widened by, per `sum |P1_i - P0_i|` of the vertex at hand; see the module's text.
pub const BOW_PAD: f32 = 16.0 * U;

/// What bounds are moved outward by, per magnitude of what is added there; see the module's text.
pub const BOWED_PAD: f32 = 4.0 * U;

/// What slab tests are padded by in a frame that turns, in pads of others; derived in [`crate::trace::object_ray`].
pub const TURN_PADS: f32 = 1.5;

/// Cosine between both normals, at least: lines between them stay well away from 0.
const LEAST_COSINE: f32 = -0.3;

/// A normal is shortened to this at least.
const LEAST_LENGTH: f32 = 0.25;

/// A frame whose third axis goes from one to another.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Turn {
    /// Axes that are fixed.
    pub axes: [Vec3; 2],
    /// The third axis at the start of the shutter and at its end, of unit length or less.
    pub normals: [Vec3; 2],
    /// What is added to coordinates along the third axis, times `T (1 - T)`.
    pub bow: f32,
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

impl Turn {
    /// From one pose of a block to another. Fixed at the first where they are far apart.
    pub fn new(start: &Pose, end: &Pose) -> Turn {
        let mut normals = [start.frame.axes[2], end.frame.axes[2]];
        let along = start.frame.axes[0] + end.frame.axes[0];
        let across = (normals[0] + normals[1]).cross(along);
        let (true, Some(middle)) = (
            normals[0].dot(normals[1]) >= LEAST_COSINE,
            Frame::from_edges(along, across),
        ) else {
            return Turn::fixed(&start.frame);
        };
        // Of all `l0 a0.E1 + l1 a1.E0`, the least squares.
        let (mut own, mut both) = (0.0, 0.0);
        for (before, after) in start.edges.iter().zip(end.edges) {
            let ahead = normals[0].dot(after);
            own += ahead * ahead;
            both -= ahead * normals[1].dot(*before);
        }
        let ratio = both / own;
        // False where there is none.
        if (LEAST_LENGTH..=1.0).contains(&ratio) {
            normals[0] *= ratio;
        } else if (1.0..=1.0 / LEAST_LENGTH).contains(&ratio) {
            normals[1] *= 1.0 / ratio;
        }
        Turn {
            axes: [middle.axes[0], middle.axes[1]],
            normals,
            bow: (normals[1] - normals[0]).dot(end.middle - start.middle),
        }
    }

    /// A frame that does not turn.
    pub const fn fixed(frame: &Frame) -> Turn {
        let [x, y, z] = frame.axes;
        Turn {
            axes: [x, y],
            normals: [z; 2],
            bow: 0.0,
        }
    }

    /// From the third axis at the start to that at the end.
    #[inline(always)]
    pub fn step(&self) -> Vec3 {
        self.normals[1] - self.normals[0]
    }
}

/// What blocks of a kind of tree are turned by: a [`Frame`], or a [`Turn`].
pub trait Turning: Clone + Copy + std::fmt::Debug + Send + Sync + 'static {
    /// True where it may change with time.
    const TURNS: bool;
    /// No rotation.
    const IDENTITY: Self;
    /// One that does not turn.
    fn fixed(frame: Frame) -> Self;
    /// From one pose of a block to another, or the first, where nothing turns.
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
