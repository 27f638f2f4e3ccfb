//! Packets: up to 64 rays in one space, in vectors of 16, for tests of all of them at once.
//!
//! A packet answers for each ray what [`ObjectRay`](super::object_ray::ObjectRay) and [`CellRay`] answer for one: the same
//! formulas with the same pads, so the same proofs hold. Hits do not depend on who shares a packet.

use glam::Vec3;
use hdtrapeze_simd::{Float, Mask, Part, Simd};

use super::cell::CellRay;
use super::object_ray::{DIR_RANGE, LEAST_DIR, SLAB_PAD, TINY_PAD};
use crate::bvh::{COORDINATE_LIMIT, Frame, U};

/// Rays of a vector.
pub const LANES: usize = 16;
/// Vectors of a packet.
pub const VECTORS: usize = 4;
/// Most rays of a packet.
pub const PACKET: usize = VECTORS * LANES;

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

/// Axes of a sheared space, by the one that is z; see [`CellRay`].
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

/// Rays prepared for slab tests in one frame; see [`crate::bvh::node::SlabRay`].
#[derive(Clone, Copy)]
pub struct Slabs<F> {
    pub(super) to_start: [F; 3],
    pub(super) to_end: [F; 3],
    pub(super) base: [[F; 3]; 2],
    /// Side of the near plane on each axis: 0, 1, or 2 where the rays disagree.
    pub(super) near_side: [usize; 3],
}

/// A packet prepared for the nodes of one tree.
pub struct Packet<'a, S: Simd> {
    simd: S,
    /// The rays, by vector; at most [`VECTORS`].
    pub rays: &'a [Rays],
    /// Rays that can be traced.
    pub sound: u64,
    /// In the identity frame, by vector.
    pub slabs: [Slabs<S::F16>; VECTORS],
    pad: [S::F16; VECTORS],
    smallest_dir: [S::F16; VECTORS],
    time: [S::F16; VECTORS],
}

impl<'a, S: Simd> Packet<'a, S> {
    /// Prepares the rays `lanes` for a tree whose slab tests see them at `MOVING` times. `pad` is what
    /// [`ObjectRay`](super::object_ray::ObjectRay) would be given for each; `None` derives it from `radius`.
    #[inline(always)]
    pub fn new<const MOVING: bool>(
        simd: S,
        rays: &'a [Rays],
        lanes: u64,
        radius: f32,
        pads: Option<&All>,
    ) -> Self {
        simd.apart(NewPacket::<'_, '_, MOVING> {
            rays,
            lanes,
            radius,
            pads,
        })
    }

    #[inline(always)]
    fn prepare<const MOVING: bool>(
        simd: S,
        rays: &'a [Rays],
        lanes: u64,
        radius: f32,
        pads: Option<&All>,
    ) -> Self {
        let zero = simd.all16(0.0);
        let none = Slabs {
            to_start: [zero; 3],
            to_end: [zero; 3],
            base: [[zero; 3]; 2],
            near_side: [0; 3],
        };
        let mut packet = Self {
            simd,
            rays,
            sound: 0,
            slabs: [none; VECTORS],
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
            packet.slabs[v] = slabs(
                simd,
                origin,
                dir,
                packet.time[v],
                pad,
                packet.smallest_dir[v],
            );
        }
        packet
    }

    /// The rays `lanes` turned into a node's frame; vectors with none of them are left as they are.
    #[inline(always)]
    pub fn turn(&self, frame: &Frame, lanes: u64, to: &mut [Slabs<S::F16>; VECTORS]) {
        for (v, rays) in self.rays.iter().enumerate().take(VECTORS) {
            if part(lanes, v) == 0 {
                continue;
            }
            let origin = turn(self.simd, load3(self.simd, &rays.origin), frame);
            let dir = turn(self.simd, load3(self.simd, &rays.dir), frame);
            to[v] = slabs(
                self.simd,
                origin,
                dir,
                self.time[v],
                self.pad[v],
                self.smallest_dir[v],
            );
        }
    }
}

/// A packet to be prepared.
struct NewPacket<'a, 'b, const MOVING: bool> {
    rays: &'a [Rays],
    lanes: u64,
    radius: f32,
    pads: Option<&'b All>,
}

impl<'a, S: Simd, const MOVING: bool> Part<S> for NewPacket<'a, '_, MOVING> {
    type Output = Packet<'a, S>;
    #[inline(always)]
    fn run(self, simd: S) -> Packet<'a, S> {
        Packet::prepare::<MOVING>(simd, self.rays, self.lanes, self.radius, self.pads)
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

/// As [`Frame::turn`].
#[inline(always)]
fn turn<S: Simd>(simd: S, v: [S::F16; 3], frame: &Frame) -> [S::F16; 3] {
    let mut out = v;
    for (out, a) in out.iter_mut().zip(&frame.axes) {
        *out = v[0] * simd.all16(a.x) + v[1] * simd.all16(a.y) + v[2] * simd.all16(a.z);
    }
    out
}

#[inline(always)]
fn slabs<S: Simd>(
    simd: S,
    origin: [S::F16; 3],
    dir: [S::F16; 3],
    time: S::F16,
    pad: S::F16,
    smallest_dir: S::F16,
) -> Slabs<S::F16> {
    let (zero, one) = (simd.all16(0.0), simd.all16(1.0));
    let mut out = Slabs {
        to_start: [zero; 3],
        to_end: [zero; 3],
        base: [[zero; 3]; 2],
        near_side: [0; 3],
    };
    for a in 0..3 {
        let negative = dir[a].lt(zero);
        let signed = (-smallest_dir).or(negative, smallest_dir);
        let d = signed.or(dir[a].abs().lt(smallest_dir), dir[a]);
        let inverse = one.over(d);
        out.to_start[a] = (one - time) * inverse;
        out.to_end[a] = time * inverse;
        out.base[0][a] = (origin[a] + pad) * -inverse;
        out.base[1][a] = (origin[a] - pad) * -inverse;
        out.near_side[a] = match negative.bits() {
            0 => 0,
            0xffff => 1,
            _ => 2,
        };
    }
    out
}

/// Rays prepared for the micropolygons of one mesh; see [`CellRay`].
pub struct CellRays {
    /// Those that agree with each ray on axes and key: they are tested together.
    pub like: [u64; PACKET],
    /// Axis that is z in each ray's sheared space.
    pub z_axis: [u8; PACKET],
    /// Segment of keys.
    pub key: [u32; PACKET],
    /// Origins, in the order of the axes.
    pub origin: [All; 3],
    /// `dir[x] / dir[z]` and `dir[y] / dir[z]` in these axes.
    pub slope: [All; 2],
    /// Component of the direction that it is longest on.
    pub dir_z: All,
    /// Fraction inside the segment of keys.
    pub fraction: All,
}

impl CellRays {
    /// Prepares the rays `sound`, of which there is one or more.
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, rays: &[Rays], sound: u64, key_times: &[f32]) -> Self {
        simd.apart(NewCells {
            rays,
            sound,
            key_times,
        })
    }

    #[inline(always)]
    fn prepare<S: Simd>(simd: S, rays: &[Rays], sound: u64, key_times: &[f32]) -> Self {
        let mut agree = true;
        let mut out = Self {
            like: [sound; PACKET],
            z_axis: [0; PACKET],
            key: [0; PACKET],
            origin: [[[0.0; LANES]; VECTORS]; 3],
            slope: [[[0.0; LANES]; VECTORS]; 2],
            dir_z: [[1.0; LANES]; VECTORS],
            fraction: [[0.0; LANES]; VECTORS],
        };
        let (v, lane) = split(sound.trailing_zeros() as usize);
        let Some(first) = rays.get(v) else {
            return out;
        };
        let axes = CellRay::axes_of(first.dir_of(lane));
        out.z_axis = [axes[2] as u8; PACKET];
        for (v, rays) in rays.iter().enumerate().take(VECTORS) {
            let sound = part(sound, v);
            let (x, y, z) = (
                simd.from16(&rays.dir[axes[0]]),
                simd.from16(&rays.dir[axes[1]]),
                simd.from16(&rays.dir[axes[2]]),
            );
            // The rules of `axes_of`: a component wins ties against those before it in x, y, z.
            let same = wins(z, x, axes[2] < axes[0]) & wins(z, y, axes[2] < axes[1]);
            agree &= same.bits() & sound == sound;
            out.slope[0][v] = x.over(z).to_array();
            out.slope[1][v] = y.over(z).to_array();
            out.dir_z[v] = rays.dir[axes[2]];
            for (to, &axis) in out.origin.iter_mut().zip(&axes) {
                to[v] = rays.origin[axis];
            }
            if let [a, b] = key_times {
                // As `locate_key` has it.
                let (zero, one) = (simd.all16(0.0), simd.all16(1.0));
                let f = simd.from16(&rays.time) - simd.all16(*a);
                let f = f.over(simd.all16(b - a));
                out.fraction[v] = f.max(zero).min(one).to_array();
            }
        }
        if !agree {
            out.each_with_its_axes(rays);
        }
        if key_times.len() > 2 {
            for (v, rays) in rays.iter().enumerate().take(VECTORS) {
                out.locate(simd, v, rays, key_times);
            }
        }
        if !agree || key_times.len() > 2 {
            out.sort(simd, sound);
        }
        out
    }

    fn each_with_its_axes(&mut self, rays: &[Rays]) {
        for (v, rays) in rays.iter().enumerate().take(VECTORS) {
            for lane in 0..LANES {
                let (origin, dir) = (rays.origin_of(lane), rays.dir_of(lane));
                let axes = CellRay::axes_of(dir);
                let dir_z = dir[axes[2]];
                self.z_axis[LANES * v + lane] = axes[2] as u8;
                for (to, &axis) in self.origin.iter_mut().zip(&axes) {
                    to[v][lane] = origin[axis];
                }
                self.slope[0][v][lane] = dir[axes[0]] / dir_z;
                self.slope[1][v][lane] = dir[axes[1]] / dir_z;
                self.dir_z[v][lane] = dir_z;
            }
        }
    }

    /// Segments of keys, and fractions inside them: as `locate_key` has it.
    #[inline(always)]
    fn locate<S: Simd>(&mut self, simd: S, v: usize, rays: &Rays, key_times: &[f32]) {
        let (zero, one) = (simd.all16(0.0), simd.all16(1.0));
        let time = simd.from16(&rays.time);
        let (mut from, mut to) = (simd.all16(key_times[0]), simd.all16(key_times[1]));
        let mut key = zero;
        for at in key_times[1..].windows(2) {
            let after = simd.all16(at[0]).le(time);
            from = simd.all16(at[0]).or(after, from);
            to = simd.all16(at[1]).or(after, to);
            key = key + one.or(after, zero);
        }
        let fraction = (time - from).over(to - from);
        self.fraction[v] = fraction.max(zero).min(one).to_array();
        for (to, key) in self.key[LANES * v..].iter_mut().zip(key.to_array()) {
            *to = key as u32;
        }
    }

    /// Finds which of the rays `sound` agree.
    #[inline(always)]
    fn sort<S: Simd>(&mut self, simd: S, sound: u64) {
        let mut kinds = [[0.0; LANES]; VECTORS];
        for ray in 0..PACKET {
            kinds[ray / LANES][ray % LANES] =
                (4 * self.key[ray] + u32::from(self.z_axis[ray])) as f32;
        }
        let mut rest = sound;
        while rest != 0 {
            let (v, lane) = split(rest.trailing_zeros() as usize);
            let kind = simd.all16(kinds[v][lane]);
            let mut like = 0;
            for (v, kinds) in kinds.iter().enumerate() {
                let kinds = simd.from16(kinds);
                let same = kinds.le(kind) & kind.le(kinds);
                like |= u64::from(same.bits()) << (LANES * v);
            }
            like &= rest;
            rest &= !like;
            let mut left = like;
            while left != 0 {
                self.like[left.trailing_zeros() as usize & (PACKET - 1)] = like;
                left &= left - 1;
            }
        }
    }
}

/// Rays to be prepared for micropolygons.
struct NewCells<'a> {
    rays: &'a [Rays],
    sound: u64,
    key_times: &'a [f32],
}

impl<S: Simd> Part<S> for NewCells<'_> {
    type Output = CellRays;
    #[inline(always)]
    fn run(self, simd: S) -> CellRays {
        CellRays::prepare(simd, self.rays, self.sound, self.key_times)
    }
}

#[inline(always)]
fn wins<F: Float<LANES>>(of: F, other: F, first: bool) -> F::Mask {
    if first {
        other.abs().le(of.abs())
    } else {
        other.abs().lt(of.abs())
    }
}
