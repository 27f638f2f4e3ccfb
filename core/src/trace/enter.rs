//! Slab tests of a packet against the children of a node, which are decoded once for all rays.
//!
//! Few rays are tested one after the other, each against all children, near and far planes side by side: of 64 rays, a
//! node deep in a tree is met by a few, scattered over the packet, and what the end of a loop costs, where rays are many
//! or few, is paid once a node. Many rays are tested 16 at once, against one child after the other. The sums are the same
//! in both ways, and so are the answers.

use hdtrapeze_simd::{Float, Mask, Part, Simd};

use super::packet::{All, LANES, Lanes, PACKET, Ranges, Record, Slabs, VECTORS, part, turn_few};
use crate::bvh::Bounds8;
use crate::bvh::bowing::Bowing;
use crate::bvh::node::Lattice8;
use crate::bvh::turn::Turning;

/// Children that some of the rays may hit.
#[derive(Clone, Copy, Debug)]
pub struct Entered {
    /// Bit `i` is set when some ray may hit child `i`.
    pub children: u32,
    /// The rays that may hit each child.
    pub rays: [u64; 8],
    /// Where the first of them enters it, in every other lane.
    near: Lanes,
}

impl Entered {
    /// None.
    pub const NONE: Entered = Entered {
        children: 0,
        rays: [0; 8],
        near: [f32::INFINITY; LANES],
    };

    /// All of `rays` enter some children besides, none before `near`, of which every other lane counts.
    #[inline(always)]
    pub fn enter_all(&mut self, children: u32, rays: u64, near: &Lanes) {
        self.children |= children;
        let mut rest = children;
        while rest != 0 {
            let child = (rest.trailing_zeros() & 7) as usize;
            rest &= rest - 1;
            self.rays[child] = rays;
            self.near[2 * child] = near[2 * child];
        }
    }

    /// The rays that may hit any child.
    #[inline(always)]
    pub fn all_rays(&self) -> u64 {
        let mut rays = 0;
        for (child, own) in self.rays.iter().enumerate() {
            rays |= if self.children >> child & 1 == 1 {
                *own
            } else {
                0
            };
        }
        rays
    }

    /// Where the first ray enters a child that is entered.
    #[inline(always)]
    pub fn near(&self, child: usize) -> f32 {
        self.near[(2 * child) & (LANES - 1)]
    }

    /// Children that were entered, the nearest first, and their number.
    #[inline(always)]
    pub fn by_distance<S: Simd>(&self, simd: S) -> ([usize; 8], usize) {
        let mut slots = [0; 8];
        let mut rest = self.children;
        if rest.count_ones() <= 2 {
            // Most often.
            let first = (rest.trailing_zeros() & 7) as usize;
            let last = (31 ^ (rest | 1).leading_zeros()) as usize & 7;
            let swap = self.near(last) < self.near(first);
            (slots[0], slots[1]) = if swap { (last, first) } else { (first, last) };
            return (slots, rest.count_ones() as usize);
        }
        let near = simd.from16(&self.near);
        // Bits of the lanes that count: one of each pair.
        let entered = spread(self.children);
        while rest != 0 {
            let slot = (rest.trailing_zeros() & 7) as usize;
            rest &= rest - 1;
            let own = simd.all16(self.near(slot));
            // Its place follows from how many are nearer, or as near and before it. No distance is NaN.
            let before = (1u32 << (2 * slot)) - 1;
            let nearer = near.lt(own).bits() | near.le(own).bits() & before;
            slots[(nearer & entered).count_ones() as usize & 7] = slot;
        }
        (slots, self.children.count_ones() as usize)
    }
}

/// Bit `i` of 8 moved to bit `2 i`.
#[inline(always)]
fn spread(bits: u32) -> u32 {
    let bits = (bits | bits << 4) & 0x0f0f;
    let bits = (bits | bits << 2) & 0x3333;
    (bits | bits << 1) & 0x5555
}

/// Tests the rays `lanes` against 8 children, each between its own `t_min` and `t_max`, which `ranges` gives: the
/// second mirrored.
#[inline(always)]
pub fn enter_packet<S: Simd, B: Bounds8>(
    simd: S,
    bounds: &B,
    valid: u32,
    slabs: &Slabs,
    lanes: u64,
    spans: Spans<'_>,
) -> Entered {
    simd.apart(Enter {
        bounds,
        valid,
        slabs,
        lanes,
        spans,
    })
}

struct Enter<'a, B> {
    bounds: &'a B,
    valid: u32,
    slabs: &'a Slabs,
    lanes: u64,
    spans: Spans<'a>,
}

/// Between what each ray looks: `t_min` and `t_max`, and both in turns, the second mirrored.
#[derive(Clone, Copy)]
pub struct Spans<'a> {
    /// In turns.
    pub pairs: &'a Ranges,
    /// Where each begins.
    pub t_min: &'a All,
    /// Where it ends.
    pub t_max: &'a All,
}

impl<S: Simd, B: Bounds8> Part<S> for Enter<'_, B> {
    type Output = Entered;
    #[inline(always)]
    fn run(self, simd: S) -> Entered {
        let Self {
            bounds,
            valid,
            slabs,
            lanes,
            spans,
        } = self;
        let planes = Planes::new(simd, bounds);
        let agree = slabs.agree(lanes);
        let ranges = spans.pairs;
        if agree && by_child_pays(lanes, valid) {
            each_child::<S, B>(simd, &planes, valid, slabs, lanes, spans)
        } else if agree {
            each_of::<S, B, true, false>(simd, &planes, valid, slabs, lanes, ranges)
        } else {
            each_of::<S, B, false, false>(simd, &planes, valid, slabs, lanes, ranges)
        }
    }
}

/// The same for few rays, in a frame that they are turned into on the way; `records` are theirs, and `slabs` is room for them.
#[inline(always)]
pub fn enter_few<S: Simd, B: Bounds8, T: Turning>(
    simd: S,
    bounds: &B,
    valid: u32,
    frame: (&T, &Bowing),
    rays: u64,
    (records, slabs): (&[Record; PACKET], &mut Slabs),
    ranges: &Ranges,
) -> Entered {
    simd.apart(EnterFew {
        bounds,
        valid,
        frame,
        rays,
        records,
        slabs,
        ranges,
    })
}

struct EnterFew<'a, B, T> {
    bounds: &'a B,
    valid: u32,
    frame: (&'a T, &'a Bowing),
    rays: u64,
    records: &'a [Record; PACKET],
    slabs: &'a mut Slabs,
    ranges: &'a Ranges,
}

impl<S: Simd, B: Bounds8, T: Turning> Part<S> for EnterFew<'_, B, T> {
    type Output = Entered;
    #[inline(always)]
    fn run(self, simd: S) -> Entered {
        let Self {
            bounds,
            valid,
            frame,
            rays,
            records,
            slabs,
            ranges,
        } = self;
        turn_few(simd, frame, rays, B::MOVING, records, slabs);
        let planes = Planes::new(simd, bounds);
        if slabs.agree(u64::MAX >> (rays.count_zeros() & 63)) {
            each_of::<S, B, true, true>(simd, &planes, valid, slabs, rays, ranges)
        } else {
            each_of::<S, B, false, true>(simd, &planes, valid, slabs, rays, ranges)
        }
    }
}

/// Planes of 8 children in pairs, as rays in each direction along each axis meet them: the near one, and the far one,
/// mirrored. See [`Slabs`].
struct Planes<F> {
    /// `[axis][direction]`.
    start: [[F; 2]; 3],
    end: [[F; 2]; 3],
}

impl<F: Float<LANES>> Planes<F> {
    #[inline(always)]
    fn new<S: Simd<F16 = F>, B: Bounds8>(simd: S, bounds: &B) -> Self {
        let start = pairs(simd, bounds.start());
        let end = if B::MOVING {
            pairs(simd, bounds.end())
        } else {
            start
        };
        Self { start, end }
    }
}

#[inline(always)]
fn pairs<S: Simd>(simd: S, lattice: &Lattice8) -> [[S::F16; 2]; 3] {
    let turns = simd.in_turns(&[1.0, -1.0]);
    let mut out = [[simd.all16(0.0); 2]; 3];
    for (a, out) in out.iter_mut().enumerate() {
        let [lower, upper] = &lattice.planes[a];
        // A lower plane, and an upper one mirrored.
        let forward = simd.bytes_in_turns(lower, upper).mul_add(
            simd.all16(lattice.step()[a]),
            simd.all16(lattice.origin()[a]),
        ) * turns;
        *out = [forward, simd.swapped(forward)];
    }
    out
}

/// One ray after the other, each against all children. `AGREE` says that all go in the same direction along each axis,
/// and `FEW` that [`turn_few`] made `slabs`.
#[inline(always)]
fn each_of<S: Simd, B: Bounds8, const AGREE: bool, const FEW: bool>(
    simd: S,
    planes: &Planes<S::F16>,
    valid: u32,
    slabs: &Slabs,
    lanes: u64,
    ranges: &Ranges,
) -> Entered {
    let zero = simd.all16(0.0);
    let direction = |a: usize, ray: usize| (slabs.negative[a] >> ray & 1) as usize;
    let (mut start, mut end) = ([zero; 3], [zero; 3]);
    let first = if FEW {
        0
    } else {
        lanes.trailing_zeros() as usize & (PACKET - 1)
    };
    for a in 0..3 {
        let direction = direction(a, first);
        (start[a], end[a]) = (planes.start[a][direction], planes.end[a][direction]);
    }
    let mut entered = simd.no_bits();
    let mut nearest = simd.all16(f32::INFINITY);
    let ranges = ranges.as_flattened();
    let mut rest = lanes;
    let mut next = 0;
    while rest != 0 {
        let ray = rest.trailing_zeros() as usize & (PACKET - 1);
        rest &= rest - 1;
        // Where it is in `slabs`.
        let at = if FEW { next & (PACKET - 1) } else { ray };
        next += 1;
        let mut t = [zero; 3];
        for a in 0..3 {
            if !AGREE {
                let direction = direction(a, at);
                (start[a], end[a]) = (planes.start[a][direction], planes.end[a][direction]);
            }
            t[a] = simd.in_turns(&slabs.base[a].as_flattened()[at]);
            if B::MOVING {
                let to = slabs.to_end[a].as_flattened()[at];
                t[a] = end[a].mul_add(simd.all16(to), t[a]);
            }
            let to = slabs.to_start[a].as_flattened()[at];
            t[a] = start[a].mul_add(simd.all16(to), t[a]);
        }
        let t = t[0].max(t[1]).max(t[2].max(simd.in_turns(&ranges[ray])));
        let hit = t.le(-simd.swapped(t));
        entered = simd.more_bits(entered, hit, ray);
        nearest = t.min(nearest).or(hit, nearest);
    }
    Entered {
        children: simd.some_bits(entered) & valid,
        rays: simd.bits_of(entered),
        near: nearest.to_array(),
    }
}

/// What a test of 16 rays against a child takes, in tests of one ray against all children: 80 instructions to 37 with AVX2
/// where nothing moves, and 93 to 43 where it does.
const BY_CHILD: u32 = 2;

/// True where tests of 16 rays against one child after the other cost less than those of one ray after the other.
#[inline(always)]
pub fn by_child_pays(lanes: u64, valid: u32) -> bool {
    let mut vectors = 0;
    for v in 0..VECTORS {
        vectors += u32::from(part(lanes, v) != 0);
    }
    lanes.count_ones() > BY_CHILD * valid.count_ones() * vectors
}

/// One child after the other, each against all rays, which go in the same direction along each axis.
#[inline(always)]
fn each_child<S: Simd, B: Bounds8>(
    simd: S,
    planes: &Planes<S::F16>,
    valid: u32,
    slabs: &Slabs,
    lanes: u64,
    spans: Spans<'_>,
) -> Entered {
    let zero = simd.all16(0.0);
    let mut start = [[0.0; LANES]; 3];
    let mut end = [[0.0; LANES]; 3];
    for a in 0..3 {
        let direction = (slabs.negative[a] >> (lanes.trailing_zeros() & 63) & 1) as usize;
        start[a] = planes.start[a][direction].to_array();
        if B::MOVING {
            end[a] = planes.end[a][direction].to_array();
        }
    }
    let infinity = simd.all16(f32::INFINITY);
    let mut nearest = [infinity; 8];
    let mut entered = [0u64; 8];
    for v in 0..VECTORS {
        let own = part(lanes, v);
        if own == 0 {
            continue;
        }
        let (mut to_start, mut to_end) = ([zero; 3], [zero; 3]);
        let mut base = [[zero; 3]; 2];
        for a in 0..3 {
            to_start[a] = simd.from16(&slabs.to_start[a][v]);
            if B::MOVING {
                to_end[a] = simd.from16(&slabs.to_end[a][v]);
            }
            base[0][a] = simd.from16(&slabs.sides[0][a][v]);
            base[1][a] = simd.from16(&slabs.sides[1][a][v]);
        }
        let (t_min, t_max) = (simd.from16(&spans.t_min[v]), simd.from16(&spans.t_max[v]));
        // Others look nowhere.
        let t_max = t_max.or(simd.mask16(own), -infinity);
        let mut rest = valid;
        while rest != 0 {
            let child = (rest.trailing_zeros() & 7) as usize;
            rest &= rest - 1;
            let mut t = [[zero; 3]; 2];
            for side in 0..2 {
                for a in 0..3 {
                    let mut plane = base[side][a];
                    if B::MOVING {
                        plane = simd
                            .all16(end[a][2 * child + side])
                            .mul_add(to_end[a], plane);
                    }
                    t[side][a] = simd
                        .all16(start[a][2 * child + side])
                        .mul_add(to_start[a], plane);
                }
            }
            let near = t[0][0].max(t[0][1]).max(t[0][2].max(t_min));
            let far = t[1][0].max(t[1][1]).max(t[1][2].max(-t_max));
            let hit = near.le(-far);
            // The minimum of all, not a choice of what is kept: compilers make that a masked store, which some processors
            // are slow at.
            nearest[child] = near.or(hit, infinity).min(nearest[child]);
            entered[child] |= u64::from(hit.bits()) << (LANES * v);
        }
    }
    // Joined as vectors: what is written in parts must not be read as a whole soon.
    let mut near = infinity;
    let mut children = 0;
    let mut rest = valid;
    while rest != 0 {
        let child = (rest.trailing_zeros() & 7) as usize;
        rest &= rest - 1;
        if entered[child] != 0 {
            children |= 1 << child;
            let first = simd.all16(nearest[child].least());
            near = first.or(simd.mask16(3 << (2 * child)), near);
        }
    }
    Entered {
        children,
        rays: entered,
        near: near.to_array(),
    }
}
