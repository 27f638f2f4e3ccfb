//! A packet as a beam: what holds all of its rays, for nodes that nearly all of them meet.
//!
//! **Shape.** Rays that go the same way along an axis, z, and along no other much faster, are lines `x(z)` and `y(z)`.
//! The smallest of several lines is concave, and so nowhere below its own chord; nor below two of them, one for each half
//! of the way, which are the smaller of two lines. The largest is the smallest mirrored. So a beam is eight chords, from
//! where rays or boxes begin to where boxes end: rays of a lens come together in its focus. A box whose range of `x`,
//! over all times of the packet, lies beyond the chords all along its range of `z` is missed by all rays: 8 children cost
//! what two or three rays cost against them.
//!
//! **Rounding.** Where a micropolygon test accepts a hit, the point `r` of the ray lies, on each axis, no farther than the
//! pad of slab tests ([`super::object_ray`]) from the box at the ray's time, with room for what slab tests round. Where
//! the ray is at the nearest `z` of that box, its `x` differs from that of `r` by at most [`STEEPEST`] pads, and so it lies
//! within 3 pads of the box. In units of `U S`, with coordinates and `|z|` of at most `S` and slopes of at most 2,
//! a line at an end is off by 11 (a difference by 1, which the slope doubles; the slope by 4, the product by 2, the sum by 3),
//! moving it by 4 more, and the chord between, of up to 4 S, by 23 (difference, quotient, length, product and sum).
//! Planes at a time are off by 8 in `x` and by 8 in `z` (at an end of the shutter by 3, a product of up to 2 S and a sum; their difference by 2, its
//! product by 2, the sum by 1), which a slope doubles: 62 together, less than a pad, which is
//! 80. So chords are moved by [`BEAM_PADS`] pads. The other half's chord only widens a beam, whatever it rounds there.
//! Where the beam begins and ends is moved as far: what it rounds is less than that, too.
//!
//! **Wide children.** Of a child that is far wider than the beam nearly all rays meet it where one does, and leaving out
//! those that do not costs more than their tests of what is below. So all go there, and none is tested: a ray may meet
//! what it would not meet alone. Where a child begins for them is where its nearest `z` is for the ray that is nearest to it
//! and fastest; a ray is inside sooner by a pad at most, and `z` and its origin are moved by [`BEAM_PADS`].

use hdtrapeze_simd::{Float, Mask, Part, Simd};

use super::cell::CellRay;
use super::packet::{All, Lanes, Packet, VECTORS, load3, part, split};
use crate::bvh::node::Lattice8;
use crate::bvh::{Bounds8, Tree, U};

/// Most that a ray may go along x or y while it goes 1 along z.
const STEEPEST: f32 = 2.0;
/// What chords are moved outward by, in pads of slab tests; derived in the module's text.
const BEAM_PADS: f32 = 4.0;
/// Fewer rays are tested one by one: a beam that holds the whole packet is wide for them.
pub const BEAM_RAYS: u32 = 24;
/// In smaller trees, making a beam takes longer than it saves.
const BEAM_NODES: usize = 8;
/// A child this many times as wide as the beam, along x and y, is wide.
const WIDE: f32 = 3.0;
/// What a quotient is made smaller by, or larger: more than the four roundings in it.
const OUTWARD: f32 = 8.0 * U;

/// A line over z, from where a half of the beam begins.
#[derive(Clone, Copy, Debug)]
struct Chord {
    start: f32,
    slope: f32,
}

impl Chord {
    /// From `a` to `b` over `length`; the smaller of both all along where that is next to nothing.
    fn new([a, b]: [f32; 2], length: f32, least: f32) -> Self {
        if length > least {
            Self {
                start: a,
                slope: (b - a) / length,
            }
        } else {
            Self {
                start: a.min(b),
                slope: 0.0,
            }
        }
    }
}

/// Two chords of a half of the beam along an axis: of the smallest mirrored, and of the smallest.
#[derive(Clone, Copy, Debug)]
struct Chords {
    start: [f32; 2],
    /// Slopes of those that rise; 0 of others.
    rising: [f32; 2],
    /// Slopes of those that fall; 0 of others.
    falling: [f32; 2],
}

impl Chords {
    fn new([smallest, mirrored]: [Chord; 2]) -> Self {
        Self {
            start: [mirrored.start, smallest.start],
            rising: [mirrored.slope.max(0.0), smallest.slope.max(0.0)],
            falling: [mirrored.slope.min(0.0), smallest.slope.min(0.0)],
        }
    }

    /// The smallest of each between two lengths, in turns.
    #[inline(always)]
    fn least<S: Simd>(&self, simd: S, [low, high]: [S::F16; 2]) -> S::F16 {
        // One of both terms is 0.
        let falling = high.mul_add(simd.in_turns(&self.falling), simd.in_turns(&self.start));
        low.mul_add(simd.in_turns(&self.rising), falling)
    }
}

/// What holds all rays of a packet.
#[derive(Clone, Copy, Debug)]
pub struct Beam {
    /// x, y and z.
    axes: [usize; 3],
    /// True where rays go down along z. All z are mirrored then.
    mirrored: bool,
    /// Where each half begins.
    begins: [f32; 2],
    /// Where the beam begins, mirrored, and where it ends.
    ends: [f32; 2],
    /// The first and the last instant.
    times: [f32; 2],
    /// Along x and y, in each half.
    sides: [[Chords; 2]; 2],
    /// What is wide along x and y.
    wide: [f32; 2],
    /// The largest z of an origin, and above.
    from: f32,
    /// The smallest and the largest of what rays take for 1 along z.
    inverses: [f32; 2],
}

/// Children that a beam may touch.
#[derive(Clone, Copy, Debug)]
pub struct Touched {
    /// Those.
    pub children: u32,
    /// Those of them that are far wider than the beam: most rays meet most of them.
    pub wide: u32,
    /// No ray meets a child sooner, in every other lane.
    pub near: Lanes,
}

impl Beam {
    /// The beam of a packet in a tree. `t_min` is where each ray begins to look. None where rays do not go the same way, or
    /// the tree is small or its root is turned.
    #[inline(always)]
    pub fn new<S: Simd, B: Bounds8>(
        simd: S,
        packet: &Packet<'_, S>,
        tree: &Tree<B>,
        t_min: &All,
    ) -> Option<Beam> {
        let root = tree.nodes.get(tree.root as usize)?;
        if root.frame != 0 || packet.sound == 0 || tree.nodes.len() < BEAM_NODES {
            return None;
        }
        Self::within(simd, packet, &root.bounds, t_min)
    }

    /// The same for a tree whose root has these bounds, in the identity frame. `packet` has one sound ray or more.
    #[inline(always)]
    pub fn within<S: Simd, B: Bounds8>(
        simd: S,
        packet: &Packet<'_, S>,
        root: &B,
        t_min: &All,
    ) -> Option<Beam> {
        simd.apart(Hold {
            packet,
            root,
            t_min,
        })
    }

    #[inline(always)]
    fn hold<S: Simd, B: Bounds8>(
        simd: S,
        packet: &Packet<'_, S>,
        root: &B,
        t_min: &All,
    ) -> Option<Beam> {
        let (v, lane) = split(packet.sound.trailing_zeros() as usize);
        let first = packet.rays.get(v)?.dir_of(lane);
        let axes = CellRay::axes_of(first);
        let z_axis = axes[2];
        let mirrored = first[z_axis] < 0.0;
        let (zero, one, inf) = (simd.all16(0.0), simd.all16(1.0), simd.all16(f32::INFINITY));
        let mut least_time = inf;
        let mut most_time = -inf;
        let (mut pad, mut reach, mut begin) = (zero, zero, inf);
        let (mut from, mut least_inverse, mut most_inverse) = (-inf, inf, zero);
        let mut straight = true;
        let mut lines = [[[zero; 2]; VECTORS]; 2];
        let mut depths = [zero; VECTORS];
        let mut masks = [simd.mask16(0); VECTORS];
        for (v, rays) in packet.rays.iter().enumerate().take(VECTORS) {
            let lanes = part(packet.sound, v);
            if lanes == 0 {
                continue;
            }
            let mask = simd.mask16(lanes);
            masks[v] = mask;
            let (origin, dir) = (load3(simd, &rays.origin), load3(simd, &rays.dir));
            let (mut oz, mut dz) = (origin[z_axis], dir[z_axis]);
            if mirrored {
                (oz, dz) = (-oz, -dz);
            }
            let limit = dz * simd.all16(STEEPEST);
            let ok = zero.lt(dz) & dir[axes[0]].abs().le(limit) & dir[axes[1]].abs().le(limit);
            straight &= ok.bits() & lanes == lanes;
            let inverse = one.over(dz);
            from = oz.or(mask, from).max(from);
            least_inverse = inverse.or(mask, least_inverse).min(least_inverse);
            most_inverse = inverse.or(mask, most_inverse).max(most_inverse);
            for a in 0..2 {
                lines[a][v] = [origin[axes[a]], dir[axes[a]] * inverse];
            }
            depths[v] = oz;
            if B::MOVING {
                let time = packet.time(v);
                least_time = time.or(mask, least_time).min(least_time);
                most_time = time.or(mask, most_time).max(most_time);
            }
            pad = packet.pad(v).or(mask, pad).max(pad);
            for o in origin {
                reach = o.abs().or(mask, reach).max(reach);
            }
            begin = (simd.from16(&t_min[v]) * dz + oz)
                .or(mask, begin)
                .min(begin);
        }
        if !straight {
            return None;
        }
        let pad = pad.most();
        let by = BEAM_PADS * pad;
        // Where boxes begin and end, and no sooner than rays.
        let (start, end) = (root.start(), root.end());
        let (mut z0, mut z1) = (f32::INFINITY, f32::NEG_INFINITY);
        for l in [start, end] {
            let (low, high) = (
                l.origin()[z_axis],
                l.origin()[z_axis] + 255.0 * l.step()[z_axis],
            );
            let (low, high) = if mirrored { (-high, -low) } else { (low, high) };
            (z0, z1) = (z0.min(low), z1.max(high));
        }
        let begin = begin.least();
        if begin > z0 {
            z0 = begin;
        }
        let (z0, z1) = (z0 - by, z1 + by);
        let z = [z0, z0 + 0.5 * (z1 - z0), z1];
        let least = (reach.most() + z0.abs() + z1.abs()) * U;
        // At each of them, the smallest x and y of all rays, and of all mirrored.
        let mut ends = [[[0.0f32; 3]; 2]; 2];
        for (end, &z) in z.iter().enumerate() {
            let z = simd.all16(z);
            let mut low = [[inf; 2]; 2];
            for v in 0..packet.rays.len().min(VECTORS) {
                let from = z - depths[v];
                for a in 0..2 {
                    let [o, slope] = lines[a][v];
                    let x = o + from * slope;
                    low[a][0] = x.or(masks[v], inf).min(low[a][0]);
                    low[a][1] = (-x).or(masks[v], inf).min(low[a][1]);
                }
            }
            for a in 0..2 {
                for side in 0..2 {
                    ends[a][side][end] = low[a][side].least() - by;
                }
            }
        }
        let halves = |sides: [[f32; 3]; 2]| {
            let half = |k: usize| {
                let chord = |x: [f32; 3]| Chord::new([x[k], x[k + 1]], z[k + 1] - z[k], least);
                Chords::new(sides.map(chord))
            };
            [half(0), half(1)]
        };
        let width = |[least, mirrored]: [[f32; 3]; 2]| {
            let at = |end: usize| -(least[end] + mirrored[end]);
            WIDE * at(0).max(at(1)).max(at(2))
        };
        let wide = ends.map(width);
        Some(Beam {
            axes: [axes[0], axes[1], z_axis],
            mirrored,
            begins: [z[0], z[1]],
            ends: [-z[0], z[2]],
            times: if B::MOVING {
                [least_time.least(), most_time.most()]
            } else {
                [0.0; 2]
            },
            sides: ends.map(halves),
            wide,
            from: from.most() + by,
            inverses: [
                least_inverse.least() * (1.0 - OUTWARD),
                most_inverse.most() * (1.0 + OUTWARD),
            ],
        })
    }

    /// Ranges of 8 children along axis `a`, over all times of the packet: lower ends, mirrored, and upper ones, in turns.
    #[inline(always)]
    fn range<S: Simd, B: Bounds8>(&self, simd: S, bounds: &B, a: usize) -> S::F16 {
        let outward = simd.in_turns(&[-1.0, 1.0]);
        let start = planes(simd, bounds.start(), a);
        if !B::MOVING {
            return start * outward;
        }
        let step = planes(simd, bounds.end(), a) - start;
        let [first, last] = self.times;
        let first = step.mul_add(simd.all16(first), start) * outward;
        let last = step.mul_add(simd.all16(last), start) * outward;
        first.max(last)
    }

    /// Children that the beam may touch.
    #[inline(always)]
    pub fn touched<S: Simd, B: Bounds8>(&self, simd: S, bounds: &B, valid: u32) -> Touched {
        simd.apart(Touch {
            beam: self,
            bounds,
            valid,
        })
    }

    #[inline(always)]
    fn touch<S: Simd, B: Bounds8>(&self, simd: S, bounds: &B, valid: u32) -> Touched {
        let [x_axis, y_axis, z_axis] = self.axes;
        let mut z = self.range(simd, bounds, z_axis);
        if self.mirrored {
            z = simd.swapped(z);
        }
        // Of low ends: other lanes are without meaning.
        let ahead = -z - simd.all16(self.from);
        let [least, most] = self.inverses;
        let near = (ahead * simd.all16(least)).min(ahead * simd.all16(most));
        // What is along the beam.
        let z = z.min(simd.in_turns(&self.ends));
        let other = simd.swapped(z);
        let lower = simd.mask16(LOWER);
        let (low, high) = (-z.or(lower, other), other.or(lower, z));
        // Lengths from where each half begins.
        let mut halves = [[low, high]; 2];
        for (between, &begin) in halves.iter_mut().zip(&self.begins) {
            let begin = simd.all16(begin);
            *between = [low - begin, high - begin];
        }
        // By how much ranges reach into the beam: a difference has the right sign however it is rounded.
        let mut inside = high - low;
        let mut wide = simd.mask16(u32::MAX);
        for (a, axis) in [x_axis, y_axis].into_iter().enumerate() {
            let range = self.range(simd, bounds, axis);
            let width = range + simd.swapped(range);
            wide = wide & simd.all16(self.wide[a]).lt(width);
            let [first, last] = &self.sides[a];
            let least = first
                .least(simd, halves[0])
                .min(last.least(simd, halves[1]));
            inside = inside.min(range - least);
        }
        let inside = inside.min(simd.swapped(inside));
        let touched = simd.all16(0.0).le(inside);
        let children = pairs(simd, touched) & valid;
        Touched {
            children,
            wide: pairs(simd, wide) & children,
            near: near.to_array(),
        }
    }
}

/// Lanes of lower ends.
const LOWER: u32 = 0x5555;

/// Planes of 8 children along an axis: lower and upper ones in turns.
#[inline(always)]
fn planes<S: Simd>(simd: S, lattice: &Lattice8, axis: usize) -> S::F16 {
    let axis = axis.min(2);
    let [lower, upper] = &lattice.planes[axis];
    let (origin, step) = (lattice.grid[axis], lattice.grid[3 + axis]);
    simd.bytes_in_turns(lower, upper)
        .mul_add(simd.all16(step), simd.all16(origin))
}

/// The pairs of lanes that `mask` has; both of a pair agree.
#[inline(always)]
fn pairs<S: Simd>(simd: S, mask: S::M16) -> u32 {
    simd.some_bits(simd.more_bits(simd.no_bits(), mask, 0))
}

struct Hold<'a, 'b, S: Simd, B> {
    packet: &'a Packet<'b, S>,
    root: &'a B,
    t_min: &'a All,
}

impl<S: Simd, B: Bounds8> Part<S> for Hold<'_, '_, S, B> {
    type Output = Option<Beam>;
    #[inline(always)]
    fn run(self, simd: S) -> Option<Beam> {
        Beam::hold(simd, self.packet, self.root, self.t_min)
    }
}

struct Touch<'a, B> {
    beam: &'a Beam,
    bounds: &'a B,
    valid: u32,
}

impl<S: Simd, B: Bounds8> Part<S> for Touch<'_, B> {
    type Output = Touched;
    #[inline(always)]
    fn run(self, simd: S) -> Touched {
        self.beam.touch(simd, self.bounds, self.valid)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use hdtrapeze_simd::{Kernel, Level};

    use super::*;
    use crate::bvh::bowing::PARABOLA;
    use crate::bvh::lanes::Boxes8;
    use crate::bvh::{LinearBox, LinearSlabs, StaticSlabs};
    use crate::trace::enter::{Spans, enter_packet};
    use crate::trace::packet::{LANES, Rays, Slabs};

    /// Numbers from -1 to 1.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1);
            (self.0 >> 40) as f32 / (1u64 << 23) as f32 - 1.0
        }

        fn vec(&mut self) -> Vec3 {
            Vec3::new(self.next(), self.next(), self.next())
        }
    }

    /// Children that the beam touches, those that some ray enters, and those that none enters sooner than the beam says;
    /// none where there is no beam.
    struct Both<'a, B> {
        rays: &'a [Rays; VECTORS],
        lanes: u64,
        boxes: &'a [LinearBox],
        kind: std::marker::PhantomData<B>,
    }

    impl<B: Bounds8> Kernel for Both<'_, B> {
        type Output = Option<(u32, u32, u32)>;
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Option<(u32, u32, u32)> {
            let bounds = B::pack(simd, &Boxes8::of(simd, self.boxes));
            let mut slabs = Slabs::NONE;
            let (rays, room) = (self.rays, (&mut slabs, &PARABOLA));
            let packet = if B::MOVING {
                Packet::new::<true>(simd, rays, self.lanes, 4.0, None, room)
            } else {
                Packet::new::<false>(simd, rays, self.lanes, 4.0, None, room)
            };
            let t_min = [[0.25; LANES]; VECTORS];
            let beam = Beam::within(simd, &packet, &bounds, &t_min)?;
            let touched = beam.touched(simd, &bounds, 0xff);
            assert_eq!(touched.wide & !touched.children, 0);
            let (mut entered, mut in_time) = (0, 0xff);
            // One by one, so that no other ray can hide a mistake.
            for ray in (0..64).filter(|ray| packet.sound >> ray & 1 == 1) {
                let spans = Spans {
                    pairs: &[[[0.25, -1e30]; LANES]; VECTORS],
                    t_min: &t_min,
                    t_max: &[[1e30; LANES]; VECTORS],
                };
                let found = enter_packet(simd, &bounds, 0xff, packet.slabs, 1 << ray, spans);
                entered |= found.children;
                for child in (0..8).filter(|child| found.children >> child & 1 == 1) {
                    if touched.near[2 * child] > found.near(child) {
                        in_time &= !(1 << child);
                    }
                }
            }
            Some((touched.children, entered, in_time))
        }
    }

    fn trial<B: Bounds8>(seed: u64, level: Level) -> Option<(u32, u32, u32)> {
        let mut random = Random(seed * 77 + 5);
        let (target, from) = (random.vec(), random.vec() * 3.0);
        let width = [0.002, 0.05, 0.4][seed as usize % 3];
        let mut rays = [Rays::NONE; VECTORS];
        for rays in &mut rays {
            for lane in 0..LANES {
                let origin = from + random.vec() * width;
                let dir = (target + random.vec() * width - origin) * (1.5 + random.next());
                for a in 0..3 {
                    (rays.origin[a][lane], rays.dir[a][lane]) = (origin[a], dir[a]);
                }
                rays.time[lane] = 0.5 + 0.5 * random.next();
            }
        }
        // Not all lanes count: those that do not go elsewhere.
        let lanes = match seed % 2 {
            0 => u64::MAX,
            _ => 0xffff_0000_7fff_00f0,
        };
        for ray in (0..64).filter(|ray| lanes >> ray & 1 == 0) {
            rays[ray / LANES].dir[ray % 3][ray % LANES] *= -1.0;
        }
        let boxes: Vec<LinearBox> = (0..8)
            .map(|_| {
                let (at, size) = (random.vec() * 1.5, (random.vec() + 1.0) * 0.2);
                let (by, wider) = (random.vec() * 0.3, (random.vec() + 1.0) * 0.1);
                LinearBox {
                    lo0: at,
                    hi0: at + size,
                    lo1: at + by,
                    hi1: at + by + size + wider,
                }
            })
            .collect();
        level.run(Both::<B> {
            rays: &rays,
            lanes,
            boxes: &boxes,
            kind: std::marker::PhantomData,
        })
    }

    #[test]
    fn beams_touch_what_rays_enter_and_little_else() {
        for level in Level::available() {
            let (mut touched, mut entered, mut beams) = (0, 0, 0);
            for seed in 0..3000 {
                for found in [
                    trial::<StaticSlabs>(seed, level),
                    trial::<LinearSlabs>(seed, level),
                ] {
                    let Some((by_beam, by_rays, in_time)) = found else {
                        continue;
                    };
                    assert_eq!(by_rays & !by_beam, 0, "{seed}, {}", level.name());
                    assert_eq!(in_time, 0xff, "{seed}, {}", level.name());
                    beams += 1;
                    touched += by_beam.count_ones();
                    entered += by_rays.count_ones();
                }
            }
            // Of 8 children rays enter one in a trial, on average, and beams touch half as many again.
            let name = level.name();
            assert!(beams > 4000, "{name}: {beams} beams");
            assert!(
                touched < 2 * entered && entered > beams / 2,
                "{name}: {touched} touched, {entered} entered, {beams} beams"
            );
        }
    }
}
