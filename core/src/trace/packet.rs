//! Sixteen rays in one space, side by side, for tests of all of them at once.
//!
//! A packet answers for each ray what [`ObjectRay`] and [`CellRay`] answer for one: the same
//! formulas with the same pads, so the same proofs hold. Hits do not depend on who shares a packet.

use glam::Vec3;
use hdtrapeze_simd::{Float, Mask, Simd};

use super::cell::CellRay;
use super::object_ray::{DIR_RANGE, LEAST_DIR, ObjectRay, SLAB_PAD, TINY_PAD};
use crate::bvh::node::Lattice8;
use crate::bvh::{Bounds8, COORDINATE_LIMIT, Frame, U};
use crate::grid::locate_key;

/// Rays of a packet.
pub const LANES: usize = 16;

/// One number a ray.
pub type Lanes = [f32; LANES];

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
    to_start: [F; 3],
    to_end: [F; 3],
    base: [[F; 3]; 2],
    /// Side of the near plane on each axis: 0, 1, or 2 where the rays disagree.
    near_side: [usize; 3],
}

/// Rays prepared for the nodes of one tree.
pub struct Packet<'a, S: Simd> {
    simd: S,
    /// The rays.
    pub rays: &'a Rays,
    /// Lanes that can be traced.
    pub sound: u32,
    /// In the identity frame.
    pub slabs: Slabs<S::F16>,
    /// Axes of the sheared space, where all rays agree; see [`CellRay`].
    pub axes: Option<[usize; 3]>,
    /// `dir[x] / dir[z]` and `dir[y] / dir[z]` in these axes.
    slope: [S::F16; 2],
    pad: S::F16,
    smallest_dir: S::F16,
    time: S::F16,
}

/// Planes of a node's children, `[axis][side][child]`, at one end of the shutter.
type Planes = [[[f32; 8]; 2]; 3];

/// Bounds of a node as floats, decoded once for all rays.
struct Decoded {
    start: Planes,
    end: Planes,
}

#[inline(always)]
fn decode<S: Simd>(simd: S, lattice: &Lattice8, out: &mut Planes) {
    for (out, planes) in out.iter_mut().zip(&lattice.planes) {
        for (out, planes) in out.iter_mut().zip(planes) {
            *out = simd.bytes8(planes).to_array();
        }
    }
}

impl<'a, S: Simd> Packet<'a, S> {
    /// Prepares the rays `lanes` for a tree whose slab tests see them at `MOVING` times. `pad` is what
    /// [`ObjectRay`] would be given for each; `None` derives it from `radius`.
    #[inline(always)]
    pub fn new<const MOVING: bool>(
        simd: S,
        rays: &'a Rays,
        lanes: u32,
        radius: f32,
        pad: Option<S::F16>,
    ) -> Self {
        let origin = load3(simd, &rays.origin);
        let dir = load3(simd, &rays.dir);
        let reach = origin[0].abs().max(origin[1].abs()).max(origin[2].abs());
        let longest = dir[0].abs().max(dir[1].abs()).max(dir[2].abs());
        let pad = match pad {
            Some(pad) => pad,
            None => (reach + simd.all16(radius)) * simd.all16(SLAB_PAD),
        };
        let pad = pad + (longest + simd.all16(1.0)) * simd.all16(TINY_PAD);
        // Comparisons with NaN are false; each component is asked, since maxima may pass it over.
        let limit = simd.all16(COORDINATE_LIMIT);
        let most = simd.all16(*DIR_RANGE.end());
        let sound = reach.lt(limit)
            & simd.all16(*DIR_RANGE.start()).le(longest)
            & (pad * simd.all16(LEAST_DIR)).le(longest)
            & longest.le(most)
            & origin[0].abs().lt(limit)
            & origin[1].abs().lt(limit)
            & origin[2].abs().lt(limit)
            & dir[0].abs().le(most)
            & dir[1].abs().le(most)
            & dir[2].abs().le(most);
        let time = if MOVING {
            simd.from16(&rays.time)
        } else {
            simd.all16(0.0)
        };
        let smallest_dir = longest * simd.all16(U);
        let sound = sound.bits() & lanes;
        let mut packet = Self {
            simd,
            rays,
            sound,
            slabs: slabs(simd, origin, dir, time, pad, smallest_dir),
            axes: None,
            slope: [simd.all16(0.0); 2],
            pad,
            smallest_dir,
            time,
        };
        if sound != 0 {
            let axes = CellRay::axes_of(rays.dir_of(sound.trailing_zeros() as usize));
            let [x, y, z] = [dir[axes[0]], dir[axes[1]], dir[axes[2]]];
            // The rules of `axes_of`: a component wins ties against those before it in x, y, z.
            let wins = |of: S::F16, other: S::F16, first: bool| {
                if first {
                    other.abs().le(of.abs())
                } else {
                    other.abs().lt(of.abs())
                }
            };
            let agree = wins(z, x, axes[2] < axes[0]) & wins(z, y, axes[2] < axes[1]);
            if agree.bits() & sound == sound {
                packet.axes = Some(axes);
                packet.slope = [x.over(z), y.over(z)];
            }
        }
        packet
    }

    /// The rays turned into a node's frame.
    #[inline(always)]
    pub fn turned(&self, frame: &Frame) -> Slabs<S::F16> {
        let origin = turn(self.simd, load3(self.simd, &self.rays.origin), frame);
        let dir = turn(self.simd, load3(self.simd, &self.rays.dir), frame);
        slabs(
            self.simd,
            origin,
            dir,
            self.time,
            self.pad,
            self.smallest_dir,
        )
    }
}

#[inline(always)]
fn load3<S: Simd>(simd: S, x: &[Lanes; 3]) -> [S::F16; 3] {
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

/// Children that some of the rays may hit.
pub struct Entered16 {
    /// Bit `i` is set when some ray may hit child `i`.
    pub children: u32,
    /// The rays that may hit each child.
    pub rays: [u32; 8],
    /// Where the first of them enters.
    pub near: [f32; 8],
}

/// Tests the rays `lanes` against 8 children, each between its own `t_min` and `t_max`.
#[inline(always)]
pub fn enter16<S: Simd, B: Bounds8>(
    simd: S,
    bounds: &B,
    valid: u32,
    slabs: &Slabs<S::F16>,
    lanes: u32,
    t_min: &Lanes,
    t_max: &Lanes,
) -> Entered16 {
    let mut out = Entered16 {
        children: 0,
        rays: [0; 8],
        near: [0.0; 8],
    };
    let mut planes = Decoded {
        start: [[[0.0; 8]; 2]; 3],
        end: [[[0.0; 8]; 2]; 3],
    };
    decode(simd, bounds.start(), &mut planes.start);
    if B::MOVING {
        decode(simd, bounds.end(), &mut planes.end);
    }
    let mut rest = valid;
    // Coefficients of a plane's numbers, and what remains, for lower and upper planes.
    let zero = simd.all16(0.0);
    let (mut scale, mut end_scale) = ([zero; 3], [zero; 3]);
    let mut base = [[zero; 3]; 2];
    for a in 0..3 {
        let (start, end) = (bounds.start(), bounds.end());
        scale[a] = simd.all16(start.step[a]) * slabs.to_start[a];
        let mut origin = simd.all16(start.origin[a]) * slabs.to_start[a];
        if B::MOVING {
            end_scale[a] = simd.all16(end.step[a]) * slabs.to_end[a];
            origin = origin + simd.all16(end.origin[a]) * slabs.to_end[a];
        }
        base[0][a] = origin + slabs.base[0][a];
        base[1][a] = origin + slabs.base[1][a];
    }
    let t_min = simd.from16(t_min);
    let t_max = simd.from16(t_max);
    let infinity = simd.all16(f32::INFINITY);
    let mut nears = [zero; 8];
    while rest != 0 {
        let child = (rest.trailing_zeros() & 7) as usize;
        rest &= rest - 1;
        let (mut near, mut far) = (t_min, t_max);
        for a in 0..3 {
            let mut t = [zero; 2];
            for side in 0..2 {
                t[side] = simd
                    .all16(planes.start[a][side][child])
                    .mul_add(scale[a], base[side][a]);
                if B::MOVING {
                    t[side] = simd
                        .all16(planes.end[a][side][child])
                        .mul_add(end_scale[a], t[side]);
                }
            }
            let (n, f) = match slabs.near_side[a] {
                0 => (t[0], t[1]),
                1 => (t[1], t[0]),
                _ => (t[0].min(t[1]), t[0].max(t[1])),
            };
            near = n.max(near);
            far = f.min(far);
        }
        let bits = near.le(far).bits() & lanes;
        out.rays[child] = bits;
        out.children |= u32::from(bits != 0) << child;
        nears[child] = near;
    }
    let mut rest = out.children;
    while rest != 0 {
        let child = (rest.trailing_zeros() & 7) as usize;
        rest &= rest - 1;
        let hit = simd.mask16(out.rays[child]);
        out.near[child] = nears[child].or(hit, infinity).least();
    }
    out
}

/// Rays prepared for the micropolygons of one mesh; see [`CellRay`].
pub struct CellRays {
    /// Axes of the sheared space, and the segment of keys, where all rays agree.
    pub common: Option<([usize; 3], usize)>,
    /// Whether `axes`, `slope` and `dir_z` are those of all rays; if not, each has its own.
    agree: bool,
    axes: [usize; 3],
    key: [u32; LANES],
    /// `dir[x] / dir[z]` and `dir[y] / dir[z]` in the axes of each ray.
    pub slope: [Lanes; 2],
    dir_z: Lanes,
    /// Fraction inside the segment of keys.
    pub fraction: Lanes,
}

impl CellRays {
    /// Prepares the sound rays of `packet`.
    #[inline(always)]
    pub fn new<S: Simd>(packet: &Packet<'_, S>, key_times: &[f32]) -> Self {
        let rays = packet.rays;
        let mut out = Self {
            common: None,
            agree: false,
            axes: [0, 1, 2],
            key: [0; LANES],
            slope: [packet.slope[0].to_array(), packet.slope[1].to_array()],
            dir_z: [1.0; LANES],
            fraction: [0.0; LANES],
        };
        let first = packet.sound.trailing_zeros() as usize & (LANES - 1);
        let mut one_segment = true;
        match key_times {
            [] | [_] => {}
            [a, b] => {
                // As `locate_key` has it.
                let simd = packet.simd;
                let (zero, one) = (simd.all16(0.0), simd.all16(1.0));
                let f = simd.from16(&rays.time) - simd.all16(*a);
                let f = f.over(simd.all16(b - a));
                out.fraction = f.max(zero).min(one).to_array();
            }
            _ => {
                for lane in 0..LANES {
                    let (key, fraction) = locate_key(key_times, rays.time[lane]);
                    out.key[lane] = key as u32;
                    out.fraction[lane] = fraction;
                    let counts = packet.sound >> lane & 1 == 1;
                    one_segment &= !counts || out.key[lane] == out.key[first];
                }
            }
        }
        if let Some(axes) = packet.axes {
            out.axes = axes;
            out.dir_z = rays.dir[axes[2]];
            out.common = one_segment.then_some((axes, out.key[first] as usize));
        }
        out.agree = packet.axes.is_some();
        out
    }

    /// One of them.
    #[inline(always)]
    pub fn lane(&self, rays: &Rays, lane: usize) -> CellRay {
        let (axes, slope, dir_z) = if self.agree {
            let slope = [self.slope[0][lane], self.slope[1][lane]];
            (self.axes, slope, self.dir_z(lane))
        } else {
            let dir = rays.dir_of(lane);
            let axes = CellRay::axes_of(dir);
            let dir_z = dir[axes[2]];
            let slope = [dir[axes[0]] / dir_z, dir[axes[1]] / dir_z];
            (axes, slope, f64::from(dir_z))
        };
        CellRay {
            origin: rays.origin_of(lane),
            axes,
            slope,
            dir_z,
            key: self.key[lane] as usize,
            fraction: self.fraction[lane],
        }
    }

    /// Component of ray `lane`'s direction that it is longest on, where all agree which that is.
    #[inline(always)]
    pub fn dir_z(&self, lane: usize) -> f64 {
        f64::from(self.dir_z[lane])
    }
}

/// One ray of a packet, for tests of it alone.
#[inline(always)]
pub fn alone(rays: &Rays, lane: usize, time: f32, radius: f32) -> Option<ObjectRay> {
    ObjectRay::new(rays.origin_of(lane), rays.dir_of(lane), time, radius)
}
