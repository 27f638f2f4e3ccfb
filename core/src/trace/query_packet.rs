//! Queries of packets: as [`super::query`] asks for one ray.

use std::cell::Cell;
use std::ops::Range;

use hdtrapeze_simd::{Float, Kernel, Mask, Simd};

use super::by_direction::{BATCH, by_direction, goes_many_ways};
use super::inside::InsideMany;
use super::late::Late;
use super::movers::MoversMany;
use super::packet::{LANES, PACKET, Packet, Rays, VECTORS, columns, part, split};
use super::queries::Queries;
use super::room::{Room, Space};
use super::traverse_packet::{Items, walk_packet};
use super::world::{MOVERS, Numbered, TopTree, World, clamp_times};
use super::{Hit, Ray, TraceCounts};
use crate::bvh::bowing::PARABOLA;
use crate::bvh::{Bounds8, ObjectGeometry, Tree};

thread_local! {
    /// What this thread keeps between packets; taken while in use.
    static ROOM: Cell<Option<Box<Room>>> = const { Cell::new(None) };
}

/// Nodes and micropolygons that a ray is tested against, in the mean, from which on an order may save more than it costs.
const COSTLY: u64 = 24;

/// What this thread keeps.
#[cfg(test)]
pub(super) fn with_room<T>(f: impl FnOnce(&mut Room) -> T) -> T {
    ROOM.with(|cell| {
        let mut room = cell.take().unwrap_or_default();
        let out = f(&mut room);
        cell.set(Some(room));
        out
    })
}

/// Where the answers to rays go.
enum Answers<'a> {
    Hits(&'a mut [Hit]),
    /// Whether there is any.
    Found(&'a mut [bool]),
}

impl Answers<'_> {
    /// Those of some rays that follow each other.
    fn some(&mut self, range: Range<usize>) -> Answers<'_> {
        match self {
            Answers::Hits(hits) => Answers::Hits(&mut hits[range]),
            Answers::Found(found) => Answers::Found(&mut found[range]),
        }
    }

    /// The best of all rays, which are the first, or have these `numbers`.
    #[inline(always)]
    fn set(self, best: &[Hit], numbers: Option<&[u16]>) {
        let hit = |best: &Hit| if best.is_hit() { *best } else { Hit::MISS };
        match (self, numbers) {
            (Answers::Hits(hits), None) => {
                for (to, best) in hits.iter_mut().zip(best) {
                    *to = hit(best);
                }
            }
            (Answers::Hits(hits), Some(numbers)) => {
                for (&i, best) in numbers.iter().zip(best) {
                    hits[usize::from(i)] = hit(best);
                }
            }
            (Answers::Found(found), None) => {
                for (to, best) in found.iter_mut().zip(best) {
                    *to = best.is_hit();
                }
            }
            (Answers::Found(found), Some(numbers)) => {
                for (&i, best) in numbers.iter().zip(best) {
                    found[usize::from(i)] = best.is_hit();
                }
            }
        }
    }
}

impl World {
    /// [`World::trace`] for many rays, best near each other in space and time; each answer is the
    /// same as alone. Traces the first `min(rays.len(), hits.len())`.
    ///
    /// Rays that begin near each other and go all ways, some hundred or more of them, are traced in an order of their own.
    pub fn trace_many(&self, rays: &[Ray], hits: &mut [Hit], counts: &mut TraceCounts) {
        let count = rays.len().min(hits.len());
        let hits = Answers::Hits(&mut hits[..count]);
        *counts = *counts + self.ask_many(&rays[..count], hits);
    }

    /// [`World::occluded`] for many rays, best near each other in space and time. Asks the first
    /// `min(rays.len(), found.len())`.
    ///
    /// As for [`World::trace_many`], those that go all ways are asked about in an order of their own.
    pub fn occluded_many(&self, rays: &[Ray], found: &mut [bool], counts: &mut TraceCounts) {
        let count = rays.len().min(found.len());
        let found = Answers::Found(&mut found[..count]);
        *counts = *counts + self.ask_many(&rays[..count], found);
    }

    /// [`World::trace_many`] for up to [`PACKET`] rays, which tells what each of them cost.
    ///
    /// # Panics
    /// The slices have different lengths, or more elements.
    pub fn trace_packet(&self, rays: &[Ray], hits: &mut [Hit], counts: &mut [TraceCounts]) {
        assert!(rays.len() <= PACKET && rays.len() == hits.len() && rays.len() == counts.len());
        self.ask_packet(rays, None, Answers::Hits(hits), Some(counts));
    }

    /// Asks about rays, as many as there are answers.
    fn ask_many(&self, rays: &[Ray], mut answers: Answers<'_>) -> TraceCounts {
        let mut counts = TraceCounts::default();
        let mut begin = 0;
        for batch in rays.chunks(BATCH) {
            let mut own = answers.some(begin..begin + batch.len());
            begin += batch.len();
            // The first packet tells whether there is so much to test that an order pays, and whether its rays go more ways than one.
            let (packet, rest) = batch.split_at(batch.len().min(PACKET));
            let first = self.ask_packet(packet, None, own.some(0..packet.len()), None);
            counts = counts + first;
            let costly = first.tests() >= COSTLY * PACKET as u64;
            let order = match costly && !rest.is_empty() && goes_many_ways(packet) {
                true => by_direction(self.level, rest),
                false => None,
            };
            let mut rest_of_own = own.some(packet.len()..batch.len());
            if let Some(order) = order {
                let mut sorted = [Ray::NONE; PACKET];
                for numbers in order.chunks(PACKET) {
                    for (ray, &i) in sorted.iter_mut().zip(numbers) {
                        *ray = rest[usize::from(i)];
                    }
                    let all = rest_of_own.some(0..rest.len());
                    let packet = &sorted[..numbers.len()];
                    counts = counts + self.ask_packet(packet, Some(numbers), all, None);
                }
            } else {
                for (k, packet) in rest.chunks(PACKET).enumerate() {
                    let own = rest_of_own.some(k * PACKET..k * PACKET + packet.len());
                    counts = counts + self.ask_packet(packet, None, own, None);
                }
            }
        }
        counts
    }

    /// Asks about a packet; `each` hears what each of its rays did. Slices are of one length, at most [`PACKET`], but that
    /// answers may be those of more rays, where the packet's have these `numbers`: they were sorted by direction.
    fn ask_packet(
        &self,
        rays: &[Ray],
        numbers: Option<&[u16]>,
        answers: Answers<'_>,
        each: Option<&mut [TraceCounts]>,
    ) -> TraceCounts {
        let level = self.level;
        ROOM.with(|cell| {
            let mut room = cell.take().unwrap_or_default();
            let asked = level.run(Many {
                world: self,
                rays,
                numbers,
                answers,
                each,
                room: &mut room,
            });
            cell.set(Some(room));
            asked
        })
    }

    #[inline(always)]
    fn query_packet<S: Simd>(&self, simd: S, asked: Many<'_>) -> TraceCounts {
        let Many {
            rays,
            numbers,
            answers,
            each,
            room,
            ..
        } = asked;
        let any = matches!(answers, Answers::Found(_));
        let mut queries = room.take_queries();
        let mut space = room.take();
        room.opened.far = self.is_far();
        queries.ask(any, each.is_some(), rays.len());
        queries.sorted = numbers.is_some();
        let packed = &mut space.rays;
        let mut lanes = 0;
        for (v, (rays, packed)) in rays.chunks(LANES).zip(packed.iter_mut()).enumerate() {
            lanes |= u64::from(pack(simd, rays, packed, &mut queries, v)) << (LANES * v);
        }
        let packed = &packed[..rays.len().div_ceil(LANES)];
        let late = match &self.tops().top {
            TopTree::Static(tree) => {
                self.top_packet::<S, _, false>(simd, tree, packed, lanes, &mut queries, room)
            }
            TopTree::Moving(tree) => {
                self.top_packet::<S, _, true>(simd, tree, packed, lanes, &mut queries, room)
            }
        };
        if !late.is_empty() {
            self.finish_packet(simd, late, packed, &mut queries, room);
        }
        answers.set(&queries.best[..rays.len()], numbers);
        for (i, each) in each.into_iter().flatten().enumerate() {
            let (v, lane) = split(i);
            *each = TraceCounts {
                rays: 1,
                node_tests: queries.nodes[v][lane] as u64,
                cell_tests: queries.cells[v][lane] as u64,
            };
        }
        let counts = queries.counts;
        room.give_back_queries(queries);
        room.give_back(space);
        counts
    }

    /// Gives the instances that rays came to, and whose objects are not made.
    #[inline(always)]
    pub(super) fn top_packet<S: Simd, B: Bounds8, const MOVING: bool>(
        &self,
        simd: S,
        tree: &Tree<B>,
        rays: &[Rays],
        lanes: u64,
        queries: &mut Queries,
        room: &mut Room,
    ) -> Vec<Late> {
        let mut late = Vec::new();
        if tree.root & Tree::<B>::LEAF != 0 && tree.root != Tree::<B>::EMPTY {
            // A single instance, which bounds rays itself.
            let item = tree.root & !Tree::<B>::LEAF;
            match self.find(item).0.set.made() {
                Some(object) => {
                    self.inside_packet(simd, object, item, rays, lanes, queries, room);
                }
                None => late.push(Late { item, lanes }),
            }
            return late;
        }
        // The pads of `query_top`.
        let mut pads = [[0.0; LANES]; VECTORS];
        for (pads, rays) in pads.iter_mut().zip(rays) {
            for (lane, pad) in pads.iter_mut().enumerate() {
                *pad = self.pad(rays.origin_of(lane));
            }
        }
        let mut space = room.take();
        let Space { slabs, turned, .. } = &mut *space;
        let packet = Packet::new::<MOVING>(simd, rays, lanes, 0.0, Some(&pads), (slabs, &PARABOLA));
        let mut instances = Instances {
            world: self,
            simd,
            rays,
            moving: B::MOVING,
            late,
        };
        walk_packet(simd, tree, &packet, turned, queries, room, &mut instances);
        let late = instances.late;
        room.give_back(space);
        late
    }

    /// Traces the rays `lanes` through an instance of `object`.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // inlined
    pub(super) fn inside_packet<S: Simd>(
        &self,
        simd: S,
        object: &ObjectGeometry,
        item: u32,
        rays: &[Rays],
        lanes: u64,
        queries: &mut Queries,
        room: &mut Room,
    ) {
        let (Numbered { set, .. }, i) = self.find(item);
        let mut space = room.take();
        for (v, (local, rays)) in space.rays.iter_mut().zip(rays).enumerate() {
            let lanes = part(lanes, v);
            if lanes != 0 {
                *local = set.to_object16(simd, i, rays, lanes, self.origin);
            }
        }
        let rays = &space.rays[..rays.len().min(VECTORS)];
        let strands = object.blas().is_of_strands();
        // Rays that were sorted go one way, but have less in common in strands than packets need.
        let scattered = strands && (queries.sorted || are_scattered(simd, rays, lanes));
        self.level.run(InsideMany {
            object,
            instance: item,
            rays,
            lanes,
            scattered,
            queries,
            room,
        });
        room.give_back(space);
    }
}

/// The items of a world's tree, to a packet.
struct Instances<'a, S> {
    world: &'a World,
    simd: S,
    /// In the space of the world.
    rays: &'a [Rays],
    /// The tree is that of all instances, and moves.
    moving: bool,
    /// Instances whose objects are not made.
    late: Vec<Late>,
}

impl<S: Simd> Items for Instances<'_, S> {
    #[inline(always)]
    fn soon(&self, _: u32, _: u64) {}

    #[inline(always)]
    fn test(&mut self, item: u32, lanes: u64, queries: &mut Queries, room: &mut Room) -> u64 {
        let Self {
            world,
            simd,
            rays,
            moving,
            late,
        } = self;
        if !*moving && item == MOVERS {
            late.extend(world.level.run(MoversMany {
                world,
                rays,
                lanes,
                queries,
                room,
            }));
            return 0;
        }
        match world.find(item).0.set.made() {
            Some(object) => {
                world.inside_packet(*simd, object, item, rays, lanes, queries, room);
            }
            None => late.push(Late { item, lanes }),
        }
        0
    }

    #[inline(always)]
    fn go_on(&mut self, _: &mut Queries, _: &mut Room) -> u64 {
        0
    }
}

/// Directions that differ by more than this part of the largest component of any, along an axis, are scattered.
const SCATTERED: f32 = 1.0;

/// True where the rays `lanes` go in all directions, more or less: few of a packet meet the same nodes.
#[inline(always)]
fn are_scattered<S: Simd>(simd: S, rays: &[Rays], lanes: u64) -> bool {
    let (mut widest, mut longest) = (0.0f32, 0.0f32);
    for axis in 0..3 {
        let (above, below) = (simd.all16(f32::INFINITY), simd.all16(f32::NEG_INFINITY));
        let (mut least, mut most) = (above, below);
        for (v, rays) in rays.iter().enumerate() {
            let lanes = simd.mask16(part(lanes, v));
            let dir = simd.from16(&rays.dir[axis]);
            least = dir.or(lanes, above).min(least);
            most = dir.or(lanes, below).max(most);
        }
        let (least, most) = (least.least(), most.most());
        widest = widest.max(most - least);
        longest = longest.max(most).max(-least);
    }
    widest > SCATTERED * longest
}

/// Rays of a vector by what they are made of, and what is asked about each; the lanes of those that ask for something.
#[inline(always)]
fn pack<S: Simd>(simd: S, rays: &[Ray], packed: &mut Rays, queries: &mut Queries, v: usize) -> u32 {
    // Whole vectors are written: what is written in halves must not be read as one soon.
    let (first, last) = rays.split_at(rays.len().min(LANES / 2));
    let t_max = simd.halves(ends(simd, first), ends(simd, last));
    let (first, last) = (columns(simd, first), columns(simd, last));
    let mut numbers = [t_max; LANES / 2];
    for ((both, first), last) in numbers.iter_mut().zip(first).zip(last) {
        *both = simd.halves(first, last);
    }
    let [x, y, z, dx, dy, dz, time, t_min] = numbers;
    packed.origin = [x.to_array(), y.to_array(), z.to_array()];
    packed.dir = [dx.to_array(), dy.to_array(), dz.to_array()];
    // Comparisons with NaN are false.
    let asks = t_min.le(t_max) & time.le(time);
    packed.time = clamp_times(simd, time).to_array();
    let asks = asks.bits() & ((1u32 << rays.len()) - 1);
    queries.begin_all(simd, v, asks, t_min, t_max);
    asks
}

/// `t_max` of up to 8 rays, as [`columns`] has their other numbers; NaN where there is no ray.
#[inline(always)]
fn ends<S: Simd>(simd: S, rays: &[Ray]) -> S::F8 {
    let mut ends = [f32::NAN; LANES / 2];
    if let Some(rays) = rays.first_chunk::<{ LANES / 2 }>() {
        for (to, ray) in ends.iter_mut().zip(rays) {
            *to = ray.t_max;
        }
    } else {
        for (to, ray) in ends.iter_mut().zip(rays) {
            *to = ray.t_max;
        }
    }
    simd.from8(&ends)
}

/// A packet of queries, for any instruction set.
struct Many<'a> {
    world: &'a World,
    rays: &'a [Ray],
    numbers: Option<&'a [u16]>,
    answers: Answers<'a>,
    each: Option<&'a mut [TraceCounts]>,
    room: &'a mut Room,
}

impl Kernel for Many<'_> {
    type Output = TraceCounts;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> TraceCounts {
        self.world.query_packet(simd, self)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec3;
    use hdtrapeze_simd::Level;

    use super::*;
    use crate::grid::{DicedMesh, Grid};
    use crate::trace::random::{cube, unit};
    use crate::trace::{InstanceTransform, WorldInstance};

    /// Bent grids of 3x3 micropolygons, or, `thin`, of 1x6, all over a cube, which swing.
    fn swarm(count: u32, thin: bool, keys: usize) -> WorldInstance {
        let state = &mut 3;
        let (nu, nv) = if thin { (1, 6) } else { (3, 3) };
        let mut mesh = DicedMesh {
            key_times: (0..keys)
                .map(|k| k as f32 / (keys.max(2) - 1) as f32)
                .collect(),
            ..DicedMesh::default()
        };
        for element in 0..count {
            let at = cube(state);
            let [u, v, sway] = [cube(state), cube(state), cube(state)].map(|v| v * 0.12);
            let u = if thin { u * 0.1 } else { u };
            for k in 0..keys {
                for j in 0..=nv {
                    for i in 0..=nu {
                        let [x, y] = [(i, nu), (j, nv)].map(|(i, n)| f32::from(i) / f32::from(n));
                        let bent = sway * (x * y + k as f32 * y * y);
                        mesh.positions.push(at + u * x + v * y + bent);
                    }
                }
            }
            mesh.grids.push(Grid {
                first_vertex: mesh.vertex_count as u32,
                element,
                nu,
                nv,
            });
            mesh.vertex_count += usize::from(nu + 1) * usize::from(nv + 1);
        }
        WorldInstance {
            object: Arc::new(ObjectGeometry::new(mesh)),
            transform: InstanceTransform::Translation(DVec3::ZERO),
            user: 0,
        }
    }

    /// From about one place, all ways; some are bad.
    fn leaving(count: usize) -> Vec<Ray> {
        let state = &mut 9;
        let mut ray = |i: usize| Ray {
            origin: cube(state) * 0.05,
            dir: cube(state) * if i % 97 == 5 { f32::NAN } else { 1.0 },
            time: unit(state),
            t_min: 0.0,
            t_max: if i.is_multiple_of(3) {
                0.2
            } else {
                f32::INFINITY
            },
        };
        (0..count).map(&mut ray).collect()
    }

    #[test]
    fn rays_that_go_all_ways_hit_what_they_hit_alone() {
        for keys in [1, 2] {
            for level in Level::available() {
                let patches = || swarm(4000, false, keys);
                let both = vec![patches(), swarm(4000, true, keys)];
                for instances in [vec![patches()], vec![swarm(4000, true, keys)], both] {
                    let world = World::build(instances, DVec3::ZERO).with_level(level);
                    // A batch and a half; the last packet is not full.
                    let rays = leaving(3 * BATCH / 2 + 7);
                    for batch in rays.chunks(BATCH) {
                        // They are sorted.
                        assert!(by_direction(level, &batch[PACKET..]).is_some());
                        let first = &batch[..PACKET];
                        assert!(goes_many_ways(first));
                        let mut counts = TraceCounts::default();
                        let mut hits = [Hit::MISS; PACKET];
                        world.trace_many(first, &mut hits, &mut counts);
                        assert!(counts.tests() >= COSTLY * PACKET as u64, "{counts:?}");
                    }
                    let mut hits = vec![Hit::MISS; rays.len()];
                    let mut found = vec![false; rays.len()];
                    let (counts, any_counts) =
                        (&mut TraceCounts::default(), &mut TraceCounts::default());
                    world.trace_many(&rays, &mut hits, counts);
                    world.occluded_many(&rays, &mut found, any_counts);
                    assert_eq!([counts.rays, any_counts.rays], [rays.len() as u64; 2]);
                    let mut some = 0;
                    for (i, ray) in rays.iter().enumerate() {
                        let alone = world.trace(ray, &mut TraceCounts::default());
                        assert_eq!(alone, hits[i], "{i}: {ray:?}");
                        assert_eq!(alone.is_hit(), found[i], "{i}: {ray:?}");
                        some += usize::from(alone.is_hit());
                    }
                    assert!(some > rays.len() / 8 && some < rays.len() * 7 / 8, "{some}");
                }
            }
        }
    }

    #[test]
    fn rays_for_which_there_is_no_room_are_not_traced() {
        let world = World::build(vec![swarm(4000, false, 1)], DVec3::ZERO);
        let rays = leaving(BATCH);
        let mut all = vec![Hit::MISS; BATCH];
        world.trace_many(&rays, &mut all, &mut TraceCounts::default());
        for count in [0, 1, PACKET, PACKET + 1, 1000] {
            let counts = &mut TraceCounts::default();
            let mut hits = vec![Hit::MISS; count];
            world.trace_many(&rays, &mut hits, counts);
            assert_eq!(hits, all[..count]);
            let mut found = vec![false; count];
            world.occluded_many(&rays, &mut found, counts);
            assert!(
                found
                    .iter()
                    .zip(&all)
                    .all(|(found, hit)| *found == hit.is_hit())
            );
            assert_eq!(counts.rays, 2 * count as u64);
        }
    }
}
