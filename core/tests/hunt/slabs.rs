//! Slab tests against micropolygon tests: no triangle that is accepted may be culled by a box that contains it.

use std::collections::HashMap;
use std::marker::PhantomData;

use glam::Vec3;
use hdtrapeze_core::bvh::bound::bound_groups;
use hdtrapeze_core::bvh::bowing::Bowing;
use hdtrapeze_core::bvh::diagonal::{Diagonal, packed};
use hdtrapeze_core::bvh::lanes::Boxes8;
use hdtrapeze_core::bvh::node::{enter, enter_node, magnitude};
use hdtrapeze_core::bvh::turn::{Between, Pose, Turn};
use hdtrapeze_core::bvh::{Bounds8, Frame, LinearBox, LinearSlabs, Node, StaticSlabs, Tree};
use hdtrapeze_core::grid::PlanarMesh;
use hdtrapeze_core::trace::beam::Beam;
use hdtrapeze_core::trace::cell::CellRay;
use hdtrapeze_core::trace::enter::{Spans, by_child_pays, enter_few, enter_packet};
use hdtrapeze_core::trace::enter_block::enter_block;
use hdtrapeze_core::trace::laid::{Laid, Tested};
use hdtrapeze_core::trace::object_ray::{ObjectRay, SLAB_PAD};
use hdtrapeze_core::trace::packet::{
    Form, LANES, PACKET, Packet, Rays, Slabs, VECTORS, split, turn_few,
};
use hdtrapeze_simd::{Kernel, Level, Simd};

use crate::boxes::{CELL, frame, vec3};
use crate::climb::{Genes, climb};
use crate::trace_scenes::mesh;

/// A cell, a ray at it, and the frame that it is bounded in.
struct Case {
    mesh: PlanarMesh,
    boxes: [LinearBox; 2],
    /// Of the first of them, where it is a part of a strand.
    diagonal: Option<Diagonal>,
    frame: Frame,
    /// In which it is bounded in place of `frame`.
    turn: Option<Turn>,
    bowing: Bowing,
    radius: f32,
    ray: (Vec3, Vec3, f32),
    /// What the ray goes to.
    target: Vec3,
}

impl Case {
    /// `turns` asks for a frame that is not the identity, most often, and `strand` for a cell that is thin, in one that does not
    /// turn.
    fn new(genes: &mut Genes<'_>, scale: i32, (turns, strand): (bool, bool)) -> Case {
        let many: [f32; 11] = std::array::from_fn(|k| k as f32 / 10.0);
        let keys: &[f32] = match genes.below(5) {
            0 => &[0.0],
            1 => &[0.0, 1.0],
            2 => &[0.0, 0.3, 1.0],
            3 => &many,
            _ => &[0.0, 0.1, 0.45, 0.5, 1.0],
        };
        let time = genes.unit();
        // Most often as large as the object's reach, and seen from as far: then all roundings count.
        let far = |genes: &mut Genes<'_>, most| match genes.below(3) {
            0 => genes.whole(0, most),
            _ => genes.whole(0, 2),
        };
        let size = (scale - far(genes, 30)).max(-149);
        let offset = match genes.below(2) {
            0 => Vec3::ZERO,
            _ => vec3(genes, (scale - 2).max(-149), scale),
        };
        // Flat in an axis, or none.
        let flat = genes.below(6);
        let mut corners: Vec<Vec3> = (0..4 * keys.len())
            .map(|_| {
                let mut p = vec3(genes, (size - 3).max(-149), size) + offset;
                if flat < 3 {
                    p[flat] = offset[flat];
                }
                p
            })
            .collect();
        if strand {
            let thin = (size - genes.whole(1, 24)).max(-149);
            for ends in corners.chunks_exact_mut(2) {
                ends[1] = ends[0] + vec3(genes, (thin - 3).max(-149), thin);
            }
        }
        let corner: HashMap<(u32, u32), usize> =
            [(0.0f32, 0.0f32), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
                .into_iter()
                .zip(0..)
                .map(|((u, v), i)| ((u.to_bits(), v.to_bits()), i))
                .collect();
        let of = |u: f32, v: f32, t: f32| {
            let key = keys.iter().position(|&k| k == t).unwrap_or(0);
            corners[4 * key + corner[&(u.to_bits(), v.to_bits())]]
        };
        let planar = PlanarMesh::from(mesh(&[(1, 1)], keys, |_, u, v, t| of(u, v, t)));
        let frame = match turns {
            true => frame(genes),
            false => Frame::IDENTITY,
        };
        let turn = (turns && !strand && keys.len() > 1 && genes.below(2) == 0)
            .then(|| turn(genes, frame, keys, &corners));
        let level = Level::best();
        // From one end to the other, or any way.
        let last = keys.len() - 1;
        let mut directions = [0, last].map(|k| corners[4 * k + 2] - corners[4 * k]);
        if strand && genes.below(8) == 0 {
            directions = [(); 2].map(|()| vec3(genes, -1, 0));
        }
        let groups = [(0, CELL, directions)];
        let (bounds, diagonals) = match &turn {
            Some(turn) => bound_groups(level, &planar, &groups, turn),
            None => bound_groups(level, &planar, &groups, &frame),
        };
        let (bounds, diagonal) = (bounds[0], strand.then_some(diagonals[0]));
        // A neighbour that decides where planes lie.
        let by = vec3(genes, (size - 3).max(-149), scale);
        let neighbour = LinearBox {
            lo0: bounds.lo0 + by,
            hi0: bounds.hi0 + by,
            lo1: bounds.lo1 - by,
            hi1: bounds.hi1 - by,
        };
        let mut boxes = [bounds, neighbour];
        if genes.below(2) == 0 {
            boxes[1] = bounds;
        }
        let radius = corners
            .iter()
            .fold(0.0f32, |r, p| r.max(p.abs().max_element()));
        // Somewhere on one of the triangles, near its rim or not, at the time.
        let (k, f) = hdtrapeze_core::grid::locate_key(keys, time);
        let next = (k + 1).min(keys.len() - 1);
        let at = |i: usize| corners[4 * k + i] + (corners[4 * next + i] - corners[4 * k + i]) * f;
        let (a, b) = (genes.unit(), genes.unit());
        let target = at(0) + (at(1) - at(0)) * a.max(b) + (at(3) - at(1)) * a.min(b);
        let reach = (scale - far(genes, 20) + far(genes, 6)).clamp(-149, 59);
        let origin = target + vec3(genes, (reach - 3).max(-149), reach);
        let dir = (target - origin) * (genes.whole(-40, 40) as f32).exp2();
        Case {
            mesh: planar,
            boxes,
            diagonal,
            frame,
            turn,
            bowing: Bowing::of(keys),
            radius,
            ray: (origin, dir, time),
            target,
        }
    }
}

/// A packet whose rays all differ: one is a case's, and the others lie between that and three more.
#[derive(Clone, Copy, Debug)]
struct Bundle {
    /// Which one is the case's.
    ray: usize,
    /// Those that count.
    lanes: u64,
    rays: [(Vec3, Vec3, f32); PACKET],
}

impl Bundle {
    fn new(genes: &mut Genes<'_>, case: &Case) -> Bundle {
        let (origin, dir, time) = case.ray;
        let way = case.target - origin;
        // Rays of a lens, rays that part, or both; next to each other, or as far apart as they are long.
        let length = way.abs().max_element().max(f32::MIN_POSITIVE);
        let length = length.log2().floor() as i32;
        let speed = dir.abs().max_element() / way.abs().max_element();
        let spread = |genes: &mut Genes<'_>| (length - genes.whole(1, 26)).max(-149);
        let (lens, apart) = (spread(genes), spread(genes));
        let by = |genes: &mut Genes<'_>, to: i32| match genes.below(3) {
            0 => Vec3::ZERO,
            _ => vec3(genes, (to - 3).max(-149), to),
        };
        let others = [(); 3].map(|()| {
            let (lens, apart) = (by(genes, lens), by(genes, apart));
            let time = if genes.below(2) == 0 {
                time
            } else {
                genes.unit()
            };
            (lens, apart, 4.0 * genes.unit(), time)
        });
        let ray = genes.below(PACKET as u64);
        let lanes = match genes.below(2) {
            0 => u64::MAX,
            _ => genes.bits() | 1 << ray,
        };
        let rays = std::array::from_fn(|lane| {
            if lane == ray {
                return case.ray;
            }
            let (lens, apart, faster, at) = others[lane % 3];
            let share = (1 + lane / 3) as f32 / 22.0;
            let from = origin + lens * share;
            let dir = (case.target + apart * share - from) * (speed * (1.0 + faster * share));
            // Those that do not count go elsewhere.
            let dir = if lanes >> lane & 1 == 1 { dir } else { -dir };
            (from, dir, time + (at - time) * share)
        });
        Bundle { ray, lanes, rays }
    }
}

/// A frame that turns from one to another, along a cell with these corners at each key.
fn turn(genes: &mut Genes<'_>, frame: Frame, keys: &[f32], corners: &[Vec3]) -> Turn {
    let at = |k: usize| {
        let at = &corners[4 * k..][..4];
        let edges = [at[1] - at[0], at[2] - at[0]];
        (edges, (at[0] + at[1] + at[2] + at[3]) * 0.25)
    };
    let pose = |frame: Frame, k: usize| {
        let (edges, middle) = at(k);
        Pose {
            frame,
            edges,
            middle,
        }
    };
    let last = keys.len() - 1;
    let (start, end) = (pose(frame, 0), pose(crate::boxes::frame(genes), last));
    if last == 1 {
        return Turn::new(&start, &end);
    }
    let inner = (1..last).map(|k| {
        let (edges, middle) = at(k);
        Between {
            time: keys[k],
            edges,
            middle,
        }
    });
    Turn::through(&start, &inner.collect::<Vec<_>>(), &end, &frame)
}

/// How much of the pad it takes until no hit is culled; none where nothing is hit.
struct Culled<'a, B>(&'a Case, &'a Way, PhantomData<B>);

/// Where shares of a pad are told apart from nothing, and from any.
const LEAST: f64 = 1.0 / 512.0;
const DEEPEST: f64 = -1e8;

/// How rays are tested.
#[derive(Clone, Debug)]
enum Way {
    Alone,
    /// As this ray of a packet.
    InPacket(usize),
    /// As all rays of a packet.
    Together,
    /// As each of these of a packet, which are few.
    Few(u64),
    /// As each of these of a packet, at a block.
    AtBlock(u64),
    /// As this ray of a packet whose rays take turns.
    InTurns(usize),
    /// As one of a packet that is met as a beam.
    InBeam(Box<Bundle>),
}

impl Way {
    /// Whether a ray with a share of its pad enters the first of the bounds, of an object of `radius`, at `t`.
    #[inline(always)]
    fn enters<S: Simd, B: Bounds8>(
        &self,
        simd: S,
        case: &Case,
        (bounds, radius): (&B, f32),
        share: f64,
        t: f32,
    ) -> bool {
        let (origin, dir, time) = case.ray;
        let pad_of = |origin: Vec3| {
            let own = (origin.abs().max_element() + radius) * SLAB_PAD;
            (f64::from(own) * share) as f32
        };
        let pad = pad_of(origin);
        let turns = case.frame != Frame::IDENTITY || case.turn.is_some();
        match self {
            Way::Alone => {
                let time = if B::MOVING { time } else { 0.0 };
                let Some(ray) = ObjectRay::padded(origin, dir, time, pad) else {
                    return false;
                };
                let ray = ray.bowing(&case.bowing);
                let slabs = match &case.turn {
                    Some(turn) => ray.turned(turn),
                    None if turns => ray.turned(&case.frame),
                    None => ray.slab,
                };
                if case.diagonal.is_none() {
                    return enter(simd, bounds, 1, &slabs, t, t).0 == 1;
                }
                enter_node(simd, &of_item(bounds, case.diagonal), &slabs, t, t).0 == 1
            }
            Way::InBeam(bundle) => {
                let mut rays = [Rays::NONE; VECTORS];
                let mut pads = [[0.0; LANES]; VECTORS];
                for (ray, &(origin, dir, time)) in bundle.rays.iter().enumerate() {
                    let (v, lane) = split(ray);
                    set(&mut rays[v], lane, (origin, dir, time));
                    pads[v][lane] = pad_of(origin);
                }
                let mut slabs = Slabs::NONE;
                let (lanes, pads) = (bundle.lanes, Some(&pads));
                let slabs = (&mut slabs, &case.bowing);
                let packet = if B::MOVING {
                    Packet::new::<true>(simd, &rays, lanes, 0.0, pads, slabs)
                } else {
                    Packet::new::<false>(simd, &rays, lanes, 0.0, pads, slabs)
                };
                if packet.sound >> bundle.ray & 1 == 0 {
                    return false;
                }
                // Where there is no beam, rays are tested one by one.
                Beam::within(simd, &packet, bounds, &[[t; LANES]; VECTORS])
                    .map(|beam| beam.touched(simd, bounds, 1))
                    .is_none_or(|touched| touched.children == 1 && touched.near[0] <= t)
            }
            Way::InPacket(_) | Way::Together | Way::Few(_) | Way::AtBlock(_) | Way::InTurns(_) => {
                let mut rays = [Rays::NONE; VECTORS];
                let lanes = match self {
                    Way::InPacket(ray) | Way::InTurns(ray) => 1u64 << *ray,
                    Way::Few(lanes) | Way::AtBlock(lanes) => *lanes,
                    _ => u64::MAX,
                };
                for ray in 0..PACKET {
                    let (v, lane) = split(ray);
                    set(&mut rays[v], lane, case.ray);
                }
                let pads = [[pad; LANES]; VECTORS];
                let bowing = &case.bowing;
                let mut slabs = Slabs::NONE;
                let slabs = (&mut slabs, bowing);
                let packet = if B::MOVING {
                    Packet::new::<true>(simd, &rays, lanes, 0.0, Some(&pads), slabs)
                } else {
                    Packet::new::<false>(simd, &rays, lanes, 0.0, Some(&pads), slabs)
                };
                if packet.sound != lanes {
                    return false;
                }
                let [t_min, t_max] = [[[t; LANES]; VECTORS]; 2];
                let mut turned = Slabs::SPOILED;
                let ranges = [[[t, -t]; LANES]; VECTORS];
                let mut records = [[f32::NAN; 8]; PACKET];
                packet.records(&mut records);
                let (all, frame) = (&records, (&case.frame, bowing));
                if let Way::InTurns(ray) = self {
                    let mut laid = Laid::filled(f32::NAN);
                    match &case.turn {
                        Some(turn) => {
                            let turn = (turn, bowing);
                            turn_few(simd, turn, lanes, B::MOVING, all, &mut turned);
                            laid.set(simd, &turned, 0, B::MOVING);
                        }
                        None if turns => {
                            turn_few(simd, frame, lanes, B::MOVING, all, &mut turned);
                            laid.set(simd, &turned, 0, B::MOVING);
                        }
                        None => laid.set(simd, packet.slabs, *ray, B::MOVING),
                    }
                    let node = of_item(bounds, case.diagonal);
                    let mut tested = Tested::filled(f32::NAN);
                    let span = std::array::from_fn(|i| if i < LANES / 2 { t } else { -t });
                    laid.test(simd, &node, &span, &mut tested);
                    // Where there are no diagonals, they say nothing.
                    let near = laid.near_diagonals(simd, &node, &tested);
                    return tested.inner == 0 && tested.items == 1 && near == 1;
                }
                let few = match (self, &case.turn) {
                    (Way::Few(_), Some(turn)) => {
                        let room = (all, &mut turned);
                        let turn = (turn, bowing);
                        Some(enter_few(simd, bounds, 1, turn, lanes, room, &ranges))
                    }
                    (Way::Few(_), None) => {
                        let room = (all, &mut turned);
                        Some(enter_few(simd, bounds, 1, frame, lanes, room, &ranges))
                    }
                    (Way::AtBlock(_), Some(turn)) => {
                        let turn = (turn, bowing);
                        Some(enter_block(simd, bounds, 1, turn, lanes, all, &ranges))
                    }
                    (Way::AtBlock(_), None) => {
                        Some(enter_block(simd, bounds, 1, frame, lanes, all, &ranges))
                    }
                    _ => None,
                };
                if let Some(entered) = few {
                    return entered.children == 1 && entered.rays[0] == lanes;
                }
                // As traversal asks: what is not asked for is NaN.
                let form = match by_child_pays(lanes, 1) {
                    true => Form::Apart,
                    false => Form::InTurns,
                };
                let slabs = match &case.turn {
                    Some(turn) => {
                        packet.turn(turn, lanes, B::MOVING, form, &mut turned);
                        &turned
                    }
                    None if turns => {
                        packet.turn(&case.frame, lanes, B::MOVING, form, &mut turned);
                        &turned
                    }
                    None => &*packet.slabs,
                };
                let spans = Spans {
                    pairs: &ranges,
                    t_min: &t_min,
                    t_max: &t_max,
                };
                let entered = enter_packet(simd, bounds, 1, slabs, lanes, spans);
                entered.children == 1 && entered.rays[0] == lanes
            }
        }
    }
}

/// A node with an item in its first place, which has a diagonal or not.
fn of_item<B: Bounds8>(bounds: &B, diagonal: Option<Diagonal>) -> Node<B> {
    let [start, end] = diagonal.unwrap_or(Diagonal::NONE).to_numbers();
    let numbers = [start, end].map(|n| [n, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let grids = (bounds.start(), bounds.end());
    let (diagonals, at_end) = packed(Level::best(), grids, &numbers);
    Node {
        bounds: *bounds,
        children: [Tree::<B>::LEAF; 8],
        frame: 0,
        slots: 1 | diagonals,
        at_end,
    }
}

/// The smallest share of the pad that lets a ray in; no number where any does, as where there is no beam.
fn used(entered: impl Fn(f64) -> bool) -> f64 {
    // With the ray's own pad first: what is hit must be entered, whatever scaled pads say.
    if !entered(1.0) {
        return 2.0;
    }
    // Boxes that lie across say how far, so that there is a way up from there.
    let (mut no, mut yes) = (0.0, 1.0);
    if entered(0.0) {
        (no, yes) = (-LEAST, 0.0);
        while entered(no) {
            if no < DEEPEST {
                return f64::NEG_INFINITY;
            }
            (no, yes) = (16.0 * no, no);
        }
    } else {
        while yes > LEAST && entered(yes / 8.0) {
            yes /= 8.0;
        }
    }
    for _ in 0..7 {
        let middle = (no + yes) * 0.5;
        if entered(middle) {
            yes = middle
        } else {
            no = middle
        }
    }
    yes
}

/// Puts a ray in its place in a packet.
fn set(rays: &mut Rays, lane: usize, (origin, dir, time): (Vec3, Vec3, f32)) {
    for a in 0..3 {
        (rays.origin[a][lane], rays.dir[a][lane]) = (origin[a], dir[a]);
    }
    rays.time[lane] = time;
}

impl<B: Bounds8> Kernel for Culled<'_, B> {
    type Output = Option<f64>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<f64> {
        let Self(case, way, _) = self;
        let bounds = B::pack(simd, &Boxes8::of(simd, &case.boxes));
        let (origin, dir, time) = case.ray;
        let time = if B::MOVING { time } else { 0.0 };
        let radius = case.radius.max(magnitude(bounds.reach()));
        let ray = ObjectRay::new(origin, dir, time, radius)?;
        let cells = CellRay::new(&ray, &case.mesh.key_times);
        let mut hits = Vec::new();
        if B::MOVING {
            cells.test_group::<S, true, false>(simd, &case.mesh, 0, CELL, None, |_, hit| {
                hits.push(hit.t)
            });
        } else {
            cells.test_group::<S, false, false>(simd, &case.mesh, 0, CELL, None, |_, hit| {
                hits.push(hit.t)
            });
        }
        let entered = |share: f64, t: f32| way.enters(simd, case, (&bounds, radius), share, t);
        let mut worst: Option<f64> = None;
        for t in hits {
            let used = used(|share| entered(share, t));
            worst = Some(worst.map_or(used, |w| w.max(used)));
        }
        worst
    }
}

fn score(case: &Case, way: &Way, level: Level) -> f64 {
    let used = if case.mesh.is_moving() {
        level.run(Culled::<LinearSlabs>(case, way, PhantomData))
    } else {
        level.run(Culled::<StaticSlabs>(case, way, PhantomData))
    };
    used.unwrap_or(f64::NEG_INFINITY)
}

fn hunt(
    what: &str,
    scales: (i32, i32),
    seed: u64,
    least: f64,
    kind: (bool, bool),
    way: impl Fn(&mut Genes<'_>, &Case) -> Way + Sync,
) {
    for (level, seed) in Level::available().into_iter().zip(seed..) {
        let found = climb(40_000, 64, seed, |genes| {
            let scale = genes.whole(scales.0, scales.1);
            let case = Case::new(genes, scale, kind);
            score(&case, &way(genes, &case), level)
        });
        found.check(&format!("{what}, {}", level.name()), least);
    }
}

fn ray_by_ray(genes: &mut Genes<'_>, _: &Case) -> Way {
    let some = |genes: &mut Genes<'_>| u64::MAX / (genes.below(1 << 16) as u64 + 1);
    match genes.below(7) {
        6 => Way::InTurns(genes.below(PACKET as u64)),
        0 | 1 => Way::Alone,
        2 => Way::InPacket(genes.below(PACKET as u64)),
        3 => Way::Few(some(genes)),
        4 => Way::AtBlock(some(genes)),
        _ => Way::Together,
    }
}

fn in_beam(genes: &mut Genes<'_>, case: &Case) -> Way {
    Way::InBeam(Box::new(Bundle::new(genes, case)))
}

#[test]
fn slabs_of_cells() {
    hunt("slabs", (-10, 10), 10, 0.03, (true, false), ray_by_ray);
}

#[test]
fn slabs_of_tiny_and_huge_cells() {
    hunt(
        "slabs of any size",
        (-149, 58),
        20,
        0.03,
        (true, false),
        ray_by_ray,
    );
}

/// The ways that are tested against diagonals.
fn by_diagonals(genes: &mut Genes<'_>, _: &Case) -> Way {
    match genes.below(2) {
        0 => Way::Alone,
        _ => Way::InTurns(genes.below(PACKET as u64)),
    }
}

#[test]
fn diagonals_of_strands() {
    hunt("diagonals", (-10, 10), 50, 0.03, (true, true), by_diagonals);
}

#[test]
fn diagonals_of_tiny_and_huge_strands() {
    let what = "diagonals of any size";
    hunt(what, (-149, 58), 60, 0.03, (true, true), by_diagonals);
}

#[test]
fn beams_of_cells() {
    hunt("beams", (-10, 10), 36, 0.002, (false, false), in_beam);
}

#[test]
fn beams_of_tiny_and_huge_cells() {
    hunt(
        "beams of any size",
        (-149, 58),
        40,
        0.002,
        (false, false),
        in_beam,
    );
}
