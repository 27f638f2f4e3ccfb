//! Packets: up to 64 rays in one space, in vectors of 16, for tests of all of them at once.
//!
//! A packet answers for each ray what [`ObjectRay`](super::object_ray::ObjectRay) and [`CellRay`](super::cell::CellRay) answer for one: the same
//! formulas with the same pads, so the same proofs hold. Hits do not depend on who shares a packet.

use std::borrow::Borrow;

use glam::Vec3;
use hdtrapeze_simd::{Float, Mask, Part, Simd};

use super::Ray;
use super::object_ray::{DIR_RANGE, LEAST_DIR, SLAB_PAD, TINY_PAD};
use crate::bvh::bowing::Bowing;
use crate::bvh::turn::{TURN_PADS, Turning};
use crate::bvh::{COORDINATE_LIMIT, U};

/// Rays of a vector.
pub const LANES: usize = 16;
/// Vectors of a packet.
pub const VECTORS: usize = 4;
/// Most rays of a packet.
pub const PACKET: usize = VECTORS * LANES;

/// Floats from here on, and as many more, are the whole numbers, so that their bits count.
pub const WHOLE: f32 = 8_388_608.0;

/// One number a ray.
pub type Lanes = [f32; LANES];

/// One number a ray of a packet.
pub type All = [Lanes; VECTORS];

/// The lanes of vector `v` among those of a packet.
#[inline(always)]
pub fn part(lanes: u64, v: usize) -> u32 {
    (lanes >> (LANES * v)) as u32 & 0xffff
}

/// Vector and lane in it of a packet's ray.
#[inline(always)]
pub fn split(ray: usize) -> (usize, usize) {
    ((ray / LANES) & (VECTORS - 1), ray & (LANES - 1))
}

/// Axes of a sheared space, by the one that is z; see [`CellRay`](super::cell::CellRay).
#[inline(always)]
pub fn axes_with(z_axis: u8) -> [usize; 3] {
    match z_axis {
        0 => [1, 2, 0],
        1 => [2, 0, 1],
        _ => [0, 1, 2],
    }
}

/// Rays in one space, as they come.
#[derive(Clone, Copy, Debug)]
pub struct Rays {
    /// Origins, by axis.
    pub origin: [Lanes; 3],
    /// Directions, by axis.
    pub dir: [Lanes; 3],
    /// Instants in [0, 1].
    pub time: Lanes,
}

impl Rays {
    /// Nothing.
    pub const NONE: Rays = Rays {
        origin: [[0.0; LANES]; 3],
        dir: [[0.0; LANES]; 3],
        time: [0.0; LANES],
    };

    /// Origin of ray `lane`.
    #[inline(always)]
    pub fn origin_of(&self, lane: usize) -> Vec3 {
        Vec3::new(
            self.origin[0][lane],
            self.origin[1][lane],
            self.origin[2][lane],
        )
    }

    /// Direction of ray `lane`.
    #[inline(always)]
    pub fn dir_of(&self, lane: usize) -> Vec3 {
        Vec3::new(self.dir[0][lane], self.dir[1][lane], self.dir[2][lane])
    }
}

/// Origins, directions, times and `t_min` of up to 8 rays, a vector for each number; NaN where there is no ray.
#[inline(always)]
pub fn columns<S: Simd, R: Borrow<Ray>>(simd: S, rays: &[R]) -> [S::F8; LANES / 2] {
    let mut rows = [simd.all8(f32::NAN); LANES / 2];
    // Of all there may be, which is most often, their number is known and rows stay in registers.
    if let Some(rays) = rays.first_chunk::<{ LANES / 2 }>() {
        for (ray, row) in rays.iter().zip(&mut rows) {
            *row = first_eight(simd, ray.borrow());
        }
    } else {
        for (ray, row) in rays.iter().zip(&mut rows) {
            *row = first_eight(simd, ray.borrow());
        }
    }
    simd.transposed(rows)
}

/// All numbers of a ray but the last.
#[inline(always)]
fn first_eight<S: Simd>(simd: S, ray: &Ray) -> S::F8 {
    let ([x, y, z], [dx, dy, dz]) = (ray.origin.to_array(), ray.dir.to_array());
    simd.from8(&[x, y, z, dx, dy, dz, ray.time, ray.t_min])
}

/// Rays prepared for slab tests in one frame, mirrored so that each goes upward along each axis: `t = plane to + base`,
/// with a positive `to`, where planes are mirrored likewise. Far planes are mirrored once more, so that the largest
/// answer counts on both sides. Numbers are those of [`crate::bvh::node::SlabRay`], but for signs.
#[derive(Clone, Copy)]
pub struct Slabs {
    pub(super) to_start: [All; 3],
    pub(super) to_end: [All; 3],
    /// For the near plane, and for the far one.
    pub(super) base: [Ranges; 3],
    /// The same apart: `[near, far]`, by axis.
    pub(super) sides: [[All; 3]; 2],
    /// The rays that were mirrored along each axis.
    pub(super) negative: [u64; 3],
}

/// Which of [`Slabs`]'s forms of the same numbers are set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Both.
    Both,
    /// `sides`, for many rays against each child.
    Apart,
    /// `base`, for each ray against all children.
    InTurns,
}

/// Two numbers a ray of a packet: on the near side, and mirrored on the far side.
pub type Ranges = [[[f32; 2]; LANES]; VECTORS];

impl Slabs {
    /// Nothing.
    pub const NONE: Slabs = Slabs::filled(0.0, 0);

    /// What must not be read.
    pub const SPOILED: Slabs = Slabs::filled(f32::NAN, u64::MAX);

    /// The same everywhere.
    pub(super) const fn filled(x: f32, negative: u64) -> Slabs {
        Slabs {
            to_start: [[[x; LANES]; VECTORS]; 3],
            to_end: [[[x; LANES]; VECTORS]; 3],
            base: [[[[x; 2]; LANES]; VECTORS]; 3],
            sides: [[[[x; LANES]; VECTORS]; 3]; 2],
            negative: [negative; 3],
        }
    }
}

/// A packet prepared for the nodes of one tree.
pub struct Packet<'a, S: Simd> {
    simd: S,
    /// The rays, by vector; at most [`VECTORS`].
    pub rays: &'a [Rays],
    /// Rays that can be traced.
    pub sound: u64,
    /// In the identity frame, by vector.
    pub slabs: &'a mut Slabs,
    /// How frames of the tree bow.
    pub bowing: &'a Bowing,
    pad: [S::F16; VECTORS],
    smallest_dir: [S::F16; VECTORS],
    time: [S::F16; VECTORS],
}

impl<'a, S: Simd> Packet<'a, S> {
    /// Prepares the rays `lanes` for a tree whose slab tests see them at `MOVING` times. `pad` is what
    /// [`ObjectRay`](super::object_ray::ObjectRay) would be given for each; `None` derives it from `radius`.
    /// `slabs` is room for them; frames of the tree bow as `bowing` says.
    #[inline(always)]
    pub fn new<const MOVING: bool>(
        simd: S,
        rays: &'a [Rays],
        lanes: u64,
        radius: f32,
        pads: Option<&All>,
        (slabs, bowing): (&'a mut Slabs, &'a Bowing),
    ) -> Self {
        simd.apart(NewPacket::<'_, '_, MOVING> {
            rays,
            lanes,
            radius,
            pads,
            slabs,
            bowing,
        })
    }

    #[inline(always)]
    fn prepare<const MOVING: bool>(
        simd: S,
        rays: &'a [Rays],
        lanes: u64,
        radius: f32,
        pads: Option<&All>,
        (slabs, bowing): (&'a mut Slabs, &'a Bowing),
    ) -> Self {
        let zero = simd.all16(0.0);
        let mut packet = Self {
            simd,
            rays,
            sound: 0,
            slabs,
            bowing,
            pad: [zero; VECTORS],
            smallest_dir: [zero; VECTORS],
            time: [zero; VECTORS],
        };
        for (v, rays) in rays.iter().enumerate().take(VECTORS) {
            let origin = load3(simd, &rays.origin);
            let dir = load3(simd, &rays.dir);
            let pad = match pads {
                Some(pads) => simd.from16(&pads[v]),
                None => slab_pad(simd, &origin, radius),
            };
            let longest = most(&dir);
            let pad = pad + (longest + simd.all16(1.0)) * simd.all16(TINY_PAD);
            let sound = sound(simd, &origin, &dir, pad);
            packet.sound |= u64::from(sound.bits() & part(lanes, v)) << (LANES * v);
            if MOVING {
                packet.time[v] = simd.from16(&rays.time);
            }
            packet.pad[v] = pad;
            packet.smallest_dir[v] = longest * simd.all16(U);
            let rays = (origin, dir, packet.time[v]);
            let pads = (pad, packet.smallest_dir[v]);
            packet.slabs.set(simd, v, rays, pads, MOVING, Form::Both);
        }
        packet
    }

    /// Instants of a vector; 0 where nothing moves.
    #[inline(always)]
    pub fn time(&self, v: usize) -> S::F16 {
        self.time[v]
    }

    /// What slab tests of a vector are padded by.
    #[inline(always)]
    pub fn pad(&self, v: usize) -> S::F16 {
        self.pad[v]
    }

    /// The rays `lanes` turned into a frame, in a tree whose bounds are `moving`; vectors with none of them are left as
    /// they are. Only what `form` names is set.
    #[inline(always)]
    pub fn turn<T: Turning>(
        &self,
        frame: &T,
        lanes: u64,
        moving: bool,
        form: Form,
        to: &mut Slabs,
    ) {
        let simd = self.simd;
        for (v, rays) in self.rays.iter().enumerate().take(VECTORS) {
            if part(lanes, v) == 0 {
                continue;
            }
            let rays = (
                load3(simd, &rays.origin),
                load3(simd, &rays.dir),
                self.time[v],
            );
            let (rays, pad) = turned(Sixteen(simd), (frame, self.bowing), rays, self.pad[v]);
            to.set(simd, v, rays, (pad, self.smallest_dir[v]), moving, form);
        }
    }

    /// Each sound ray's numbers together. Of others nothing is said.
    #[inline(always)]
    pub fn records(&self, to: &mut [Record; PACKET]) {
        self.simd.apart(Record8 { packet: self, to });
    }
}

/// Origin, direction, instant and pad of a ray, for frames that few rays of a packet are turned into.
pub type Record = [f32; 8];

/// Room for a packet in the frames of blocks.
pub struct InBlock<'a> {
    /// For its rays in one of them.
    pub turned: &'a mut Slabs,
    /// For what they are turned from.
    pub records: &'a mut [Record; PACKET],
    /// True where that is there: from the first block on that has a frame of its own.
    pub ready: bool,
}

struct Record8<'a, 'b, S: Simd> {
    packet: &'a Packet<'b, S>,
    to: &'a mut [Record; PACKET],
}

impl<S: Simd> Part<S> for Record8<'_, '_, S> {
    type Output = ();
    #[inline(always)]
    fn run(self, simd: S) {
        let Packet {
            rays, time, pad, ..
        } = self.packet;
        for (v, rays) in rays.iter().enumerate().take(VECTORS) {
            let (time, pad) = (time[v].to_array(), pad[v].to_array());
            let ([x, y, z], [dx, dy, dz]) = (&rays.origin, &rays.dir);
            let of = [x, y, z, dx, dy, dz, &time, &pad];
            for half in 0..2 {
                let mut eight = [simd.all8(0.0); EIGHT];
                for (eight, lanes) in eight.iter_mut().zip(of) {
                    *eight = simd.from8(&lanes.as_chunks().0[half]);
                }
                let first = LANES * v + EIGHT * half;
                let to = &mut self.to[first..first + EIGHT];
                for (to, ray) in to.iter_mut().zip(simd.transposed(eight)) {
                    *to = ray.to_array();
                }
            }
        }
    }
}

/// Rays that are turned at once where they are few.
const EIGHT: usize = 8;

/// Few rays of a packet, turned into a frame: one after the other from the first place on, however they lie in the
/// packet. [`Form::InTurns`] is set.
#[inline(always)]
pub fn turn_few<S: Simd, T: Turning>(
    simd: S,
    frame: (&T, &Bowing),
    rays: u64,
    moving: bool,
    records: &[Record; PACKET],
    to: &mut Slabs,
) {
    let eights = Eight(simd);
    to.negative = [0; 3];
    let mut rest = rays;
    let mut first = 0;
    while rest != 0 {
        let mut eight = [simd.all8(0.0); EIGHT];
        for to in &mut eight {
            // Any ray where there are no more.
            *to = simd.from8(&records[rest.trailing_zeros() as usize & (PACKET - 1)]);
            rest &= rest.wrapping_sub(1);
        }
        let [x, y, z, dx, dy, dz, time, pad] = simd.transposed(eight);
        let longest = dx.abs().max(dy.abs()).max(dz.abs());
        let rays = ([x, y, z], [dx, dy, dz], time);
        let ((origin, dir, time), pad) = turned(eights, frame, rays, pad);
        let (v, lane) = split(first);
        for a in 0..3 {
            let pads = (pad, longest * simd.all8(U));
            let along = mirrored(eights, (origin[a], dir[a], time), pads, moving);
            let set = |to: &mut Lanes, x: S::F8| {
                to[lane..lane + EIGHT].copy_from_slice(&x.to_array());
            };
            set(&mut to.to_start[a][v], along.to_start);
            if moving {
                set(&mut to.to_end[a][v], along.to_end);
            }
            let pairs = simd.in_pairs(along.near, along.far).to_array();
            to.base[a][v][lane..lane + EIGHT]
                .as_flattened_mut()
                .copy_from_slice(&pairs);
            to.negative[a] |= u64::from(along.negative.bits()) << first;
        }
        first = (first + EIGHT) & (PACKET - 1);
    }
}

/// Makes vectors of `N` copies.
pub(super) trait Copies<const N: usize>: Copy {
    type Vector: Float<N>;
    fn all(self, x: f32) -> Self::Vector;
}

/// Vectors of 8.
#[derive(Clone, Copy)]
struct Eight<S>(S);

impl<S: Simd> Copies<EIGHT> for Eight<S> {
    type Vector = S::F8;
    #[inline(always)]
    fn all(self, x: f32) -> S::F8 {
        self.0.all8(x)
    }
}

/// Vectors of 16.
#[derive(Clone, Copy)]
pub(super) struct Sixteen<S>(pub S);

impl<S: Simd> Copies<LANES> for Sixteen<S> {
    type Vector = S::F16;
    #[inline(always)]
    fn all(self, x: f32) -> S::F16 {
        self.0.all16(x)
    }
}

/// Origin, direction and instant of rays, by lane.
pub(super) type Turned<F> = ([F; 3], [F; 3], F);

/// Rays turned into a frame, and what slab tests are padded by there.
#[inline(always)]
pub(super) fn turned<const N: usize, C: Copies<N>, T: Turning>(
    copies: C,
    (frame, bowing): (&T, &Bowing),
    (origin, dir, time): Turned<C::Vector>,
    pad: C::Vector,
) -> (Turned<C::Vector>, C::Vector) {
    let turn = frame.turn();
    let [x, y] = turn.axes;
    let (x, y) = (all3(copies, x), all3(copies, y));
    let mut z = all3(copies, turn.normals[0]);
    let mut pad = pad;
    if T::TURNS {
        let step = all3(copies, turn.step());
        for (z, step) in z.iter_mut().zip(step) {
            *z = step.mul_add(time, *z);
        }
        pad = pad * copies.all(TURN_PADS);
    }
    let mut origin = [along(&x, &origin), along(&y, &origin), along(&z, &origin)];
    let dir = [along(&x, &dir), along(&y, &dir), along(&z, &dir)];
    if T::TURNS {
        let bow = bow(copies, bowing, time);
        let most = all3(copies, turn.bow);
        for (origin, most) in origin.iter_mut().zip(most) {
            *origin = bow.mul_add(most, *origin);
        }
    }
    ((origin, dir, time), pad)
}

/// [`Bowing::at`] the time of each ray.
#[inline(always)]
fn bow<const N: usize, C: Copies<N>>(copies: C, bowing: &Bowing, time: C::Vector) -> C::Vector {
    let [first, rest @ ..] = bowing.lines() else {
        return time * (copies.all(1.0) - time);
    };
    let line = |[slope, start]: [f32; 2]| time.mul_add(copies.all(slope), copies.all(start));
    let mut least = line(*first);
    for &next in rest {
        least = least.min(line(next));
    }
    least
}

/// Rays along one axis, as [`Slabs`] has them.
struct Mirrored<F, M> {
    negative: M,
    to_start: F,
    /// Without meaning where nothing moves.
    to_end: F,
    near: F,
    far: F,
}

#[inline(always)]
fn mirrored<const N: usize, F: Float<N>>(
    copies: impl Copies<N, Vector = F>,
    (origin, dir, time): (F, F, F),
    (pad, smallest_dir): (F, F),
    moving: bool,
) -> Mirrored<F, F::Mask> {
    let (zero, one) = (copies.all(0.0), copies.all(1.0));
    let negative = dir.lt(zero);
    let d = dir.abs();
    let inverse = one.over(smallest_dir.or(d.lt(smallest_dir), d));
    let origin = (-origin).or(negative, origin);
    let (mut to_start, mut to_end) = (inverse, inverse);
    if moving {
        (to_start, to_end) = ((one - time) * inverse, time * inverse);
    }
    Mirrored {
        negative,
        to_start,
        to_end,
        near: (origin + pad) * -inverse,
        far: (origin - pad) * inverse,
    }
}

/// A packet to be prepared.
struct NewPacket<'a, 'b, const MOVING: bool> {
    rays: &'a [Rays],
    lanes: u64,
    radius: f32,
    pads: Option<&'b All>,
    slabs: &'a mut Slabs,
    bowing: &'a Bowing,
}

impl<'a, S: Simd, const MOVING: bool> Part<S> for NewPacket<'a, '_, MOVING> {
    type Output = Packet<'a, S>;
    #[inline(always)]
    fn run(self, simd: S) -> Packet<'a, S> {
        Packet::prepare::<MOVING>(
            simd,
            self.rays,
            self.lanes,
            self.radius,
            self.pads,
            (self.slabs, self.bowing),
        )
    }
}

/// Those of the rays `lanes` that can be traced in an object of `radius`, in its own space.
#[inline(always)]
pub fn sound_rays<S: Simd>(simd: S, rays: &[Rays], lanes: u64, radius: f32) -> u64 {
    let mut out = 0;
    for (v, rays) in rays.iter().enumerate().take(VECTORS) {
        let (origin, dir) = (load3(simd, &rays.origin), load3(simd, &rays.dir));
        let tiny = (most(&dir) + simd.all16(1.0)) * simd.all16(TINY_PAD);
        let pad = slab_pad(simd, &origin, radius) + tiny;
        let sound = sound(simd, &origin, &dir, pad).bits();
        out |= u64::from(sound & part(lanes, v)) << (LANES * v);
    }
    out
}

/// What slab tests are padded by at least, in a tree whose coordinates are up to `radius`.
#[inline(always)]
pub fn slab_pad<S: Simd>(simd: S, origin: &[S::F16; 3], radius: f32) -> S::F16 {
    (most(origin) + simd.all16(radius)) * simd.all16(SLAB_PAD)
}

/// Largest magnitude of a component.
#[inline(always)]
pub fn most<F: Float<LANES>>(v: &[F; 3]) -> F {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
}

/// Rays that can be traced with these pads.
#[inline(always)]
fn sound<S: Simd>(simd: S, origin: &[S::F16; 3], dir: &[S::F16; 3], pad: S::F16) -> S::M16 {
    let (reach, longest) = (most(origin), most(dir));
    // Comparisons with NaN are false; each component is asked, since maxima may pass it over.
    let limit = simd.all16(COORDINATE_LIMIT);
    let most = simd.all16(*DIR_RANGE.end());
    reach.lt(limit)
        & simd.all16(*DIR_RANGE.start()).le(longest)
        & (pad * simd.all16(LEAST_DIR)).le(longest)
        & longest.le(most)
        & origin[0].abs().lt(limit)
        & origin[1].abs().lt(limit)
        & origin[2].abs().lt(limit)
        & dir[0].abs().le(most)
        & dir[1].abs().le(most)
        & dir[2].abs().le(most)
}

/// A vector of points or directions, by axis.
#[inline(always)]
pub fn load3<S: Simd>(simd: S, x: &[Lanes; 3]) -> [S::F16; 3] {
    [simd.from16(&x[0]), simd.from16(&x[1]), simd.from16(&x[2])]
}

#[inline(always)]
fn all3<const N: usize, C: Copies<N>>(copies: C, v: Vec3) -> [C::Vector; 3] {
    [copies.all(v.x), copies.all(v.y), copies.all(v.z)]
}

/// The coordinate along an axis.
#[inline(always)]
fn along<const N: usize, F: Float<N>>(axis: &[F; 3], v: &[F; 3]) -> F {
    let [x, y, z] = *v;
    z.mul_add(axis[2], y.mul_add(axis[1], x * axis[0]))
}

impl Slabs {
    /// True where the rays `lanes` go in the same direction along each axis.
    #[inline(always)]
    pub fn agree(&self, lanes: u64) -> bool {
        let uniform = |n: &u64| n & lanes == 0 || n & lanes == lanes;
        self.negative.iter().all(uniform)
    }

    /// Sets [`Form::InTurns`] where [`Form::Apart`] is set.
    #[inline(always)]
    pub fn pair<S: Simd>(&mut self, simd: S, lanes: u64) {
        for v in 0..VECTORS {
            if part(lanes, v) == 0 {
                continue;
            }
            for a in 0..3 {
                let [near, far] = [&self.sides[0][a][v], &self.sides[1][a][v]];
                self.base[a][v] = in_turns(simd, simd.from16(near), simd.from16(far));
            }
        }
    }

    /// Prepares a vector of rays.
    #[inline(always)]
    fn set<S: Simd>(
        &mut self,
        simd: S,
        v: usize,
        (origin, dir, time): ([S::F16; 3], [S::F16; 3], S::F16),
        (pad, smallest_dir): (S::F16, S::F16),
        moving: bool,
        form: Form,
    ) {
        for a in 0..3 {
            let pads = (pad, smallest_dir);
            let along = mirrored(Sixteen(simd), (origin[a], dir[a], time), pads, moving);
            self.to_start[a][v] = along.to_start.to_array();
            if moving {
                self.to_end[a][v] = along.to_end.to_array();
            }
            if form != Form::Apart {
                self.base[a][v] = in_turns(simd, along.near, along.far);
            }
            if form != Form::InTurns {
                self.sides[0][a][v] = along.near.to_array();
                self.sides[1][a][v] = along.far.to_array();
            }
            let shift = LANES * v;
            let kept = self.negative[a] & !(0xffff << shift);
            self.negative[a] = kept | u64::from(along.negative.bits()) << shift;
        }
    }
}

/// Lanes of one and of the other, as pairs.
#[inline(always)]
pub(super) fn in_turns<S: Simd>(simd: S, even: S::F16, odd: S::F16) -> [[f32; 2]; LANES] {
    let [low, high] = simd.zip(even, odd);
    let mut out = [[0.0; 2]; LANES];
    let (pairs, _) = out.as_flattened_mut().as_chunks_mut::<LANES>();
    (pairs[0], pairs[1]) = (low.to_array(), high.to_array());
    out
}
