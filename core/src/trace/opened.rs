//! Blocks that a packet comes to, and that wait for what comes from memory.
//!
//! A block, its frame and the vertices of its groups are asked for one after the other, since each says where the next is. To wait
//! for them is of no use as long as there is something else to go on with: the packet goes on with what is next for other rays
//! meanwhile. Rays that wait do not go on, since what one finds in a block may be before all else that it would come to. So
//! nothing is opened or tested that would not be without waiting, and each ray comes to the same in the same order.

use hdtrapeze_simd::{Part, Simd};

use super::cell_rays::CellRays;
use super::enter::Entered;
use super::packet::{InBlock, Packet};
use super::pairs::Pairs;
use super::queries::Queries;
use super::traverse::Target;
use crate::bvh::Bounds8;

/// Most blocks that are asked for.
const ASKED: usize = 4;
/// Most blocks that are open.
const OPEN: usize = 8;

/// A block, and rays that come to it.
#[derive(Clone, Copy, Debug, Default)]
struct Asked {
    block: u32,
    rays: u64,
}

/// A block, groups of it that are entered, and the rays that enter each.
#[derive(Clone, Copy, Debug, Default)]
struct Open {
    block: u32,
    groups: u32,
    rays: [u64; 8],
}

/// What waits, and the rays that do.
#[derive(Debug)]
struct Held<T, const MOST: usize> {
    count: usize,
    all: [T; MOST],
    rays: u64,
}

impl<T: Copy + Default, const MOST: usize> Default for Held<T, MOST> {
    fn default() -> Self {
        Self {
            count: 0,
            all: [T::default(); MOST],
            rays: 0,
        }
    }
}

impl<T: Copy, const MOST: usize> Held<T, MOST> {
    /// One more, which there is room for.
    #[inline(always)]
    fn add(&mut self, one: T, rays: u64) {
        debug_assert!(self.count < MOST);
        self.all[self.count & (MOST - 1)] = one;
        self.count += 1;
        self.rays |= rays;
    }

    #[inline(always)]
    fn clear(&mut self) {
        (self.count, self.rays) = (0, 0);
    }
}

/// Blocks of a packet that wait, in the order in which it came to them.
#[derive(Debug, Default)]
pub(super) struct Opened {
    /// For themselves, and their frames.
    asked: Held<Asked, ASKED>,
    /// For their vertices.
    open: Held<Open, OPEN>,
    /// Positions of the world are [far](super::World::is_far): else nothing is waited for.
    pub far: bool,
    /// To wait pays, as far as that was seen.
    pub pays: bool,
    /// Blocks that were asked for, and how often what is open was tested for want of room.
    #[cfg(test)]
    seen: [u32; 2],
}

/// How many rays of a packet come to a block together. While one waits, the others of many would wait along.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Meetings {
    blocks: u32,
    rays: u32,
}

impl Meetings {
    /// Some come to a block.
    #[inline(always)]
    pub fn add(&mut self, rays: u64) {
        self.blocks += 1;
        self.rays += rays.count_ones();
    }

    /// True where they are so few that to wait pays: fewer than 2.5 in the mean; nothing is known where none came to a block. Of sheets and
    /// patches of 4 to 49 million micropolygons, those with 1.1 to 2.0 took 0.73 to 1.05 of the time, and those with 3.5 to 7.5 took 1.00 to 1.09;
    /// one with 3.3 took 0.94, which is too near these to count on.
    #[inline(always)]
    pub fn are_of_few(self) -> Option<bool> {
        (self.blocks > 0).then_some(2 * self.rays < 5 * self.blocks)
    }
}

impl Opened {
    /// The rays that wait: none of them may go on.
    #[inline(always)]
    pub fn rays(&self) -> u64 {
        self.asked.rays | self.open.rays
    }

    /// True where no block can be asked for.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.asked.count >= ASKED
    }

    /// True where nothing waits: before a walk and after it.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.asked.count == 0 && self.open.count == 0
    }

    #[inline(always)]
    fn add(&mut self, block: u32, found: &Entered) {
        let open = Open {
            block,
            groups: found.children,
            rays: found.rays,
        };
        self.open.add(open, found.all_rays());
    }
}

/// Opens what is asked for; if nothing is, tests what is open. Rays may go on that did not before: all of them, after two
/// such steps. [Apart](Simd::apart).
pub(super) struct GoOn<'a, 't, 'p, 'r, S: Simd, B: Bounds8> {
    pub target: &'a Target<'t, S, B, false>,
    pub packet: &'a Packet<'p, S>,
    pub room: &'a mut InBlock<'r>,
    pub cells: &'a CellRays,
    pub opened: &'a mut Opened,
    pub pairs: &'a mut Pairs,
    pub queries: &'a mut Queries,
}

impl<S: Simd, B: Bounds8> Part<S> for GoOn<'_, '_, '_, '_, S, B> {
    type Output = ();
    #[inline(always)]
    fn run(mut self, _: S) {
        let Opened { asked, open, .. } = &*self.opened;
        if asked.count == 0 || open.count + asked.count > OPEN {
            #[cfg(test)]
            {
                self.opened.seen[1] += u32::from(self.opened.asked.count > 0);
            }
            self.test();
        }
        self.open();
    }
}

impl<S: Simd, B: Bounds8> GoOn<'_, '_, '_, '_, S, B> {
    #[inline(always)]
    fn open(&mut self) {
        let Self { target, opened, .. } = self;
        let tree = target.blocks;
        let count = opened.asked.count.min(ASKED);
        for asked in &opened.asked.all[..count] {
            let frame = tree.blocks[asked.block as usize].frame;
            target.simd.expect(&tree.frames, frame as usize);
        }
        for i in 0..count {
            let Asked { block: item, rays } = opened.asked.all[i];
            let block = &tree.blocks[item as usize];
            let found = target.open_block(block, rays, self.packet, self.room, self.queries);
            if found.children != 0 {
                target.expect_groups(block, found.children, rays, self.cells);
                opened.add(item, &found);
            }
        }
        opened.asked.clear();
    }

    #[inline(always)]
    fn test(&mut self) {
        let Self {
            target,
            cells,
            opened,
            pairs,
            queries,
            ..
        } = self;
        for open in &opened.open.all[..opened.open.count.min(OPEN)] {
            let block = &target.blocks.blocks[open.block as usize];
            target.groups_packet(block, open.groups, &open.rays, cells, pairs, queries);
        }
        opened.open.clear();
        target.settle(cells, pairs, queries);
    }
}

impl<S: Simd, B: Bounds8> Target<'_, S, B, false> {
    /// A block that `rays` come to, none of which wait, waits with them. There is room for it.
    #[inline(always)]
    pub(super) fn ask(&self, opened: &mut Opened, block: u32, rays: u64) {
        self.simd.expect(&self.blocks.blocks, block as usize);
        #[cfg(test)]
        {
            opened.seen[0] += 1;
        }
        opened.asked.add(Asked { block, rays }, rays);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DAffine3, DQuat, DVec3};

    use crate::bvh::ObjectGeometry;
    use crate::grid::{DicedMesh, Grid};
    use crate::trace::instance::InstanceTransform;
    use crate::trace::packet::PACKET;
    use crate::trace::query_packet::with_room;
    use crate::trace::random::{cube, unit};
    use crate::trace::{Hit, Ray, TraceCounts, World, WorldInstance};

    /// Bent patches that turn and drift in a cube; or `many` such cubes that overlap, so that subtrees of one wait while another is walked.
    fn patches(keys: usize, many: bool) -> World {
        const RATE: u16 = 16;
        let state = &mut 5;
        let key_time = |k: usize| k as f32 / (keys.max(2) - 1) as f32;
        let mut mesh = DicedMesh {
            key_times: (0..keys).map(key_time).collect(),
            ..DicedMesh::default()
        };
        for element in 0..60 {
            let corner = cube(state);
            let [along, across, bend, drift, turn] =
                [0.4, 0.4, 0.1, 0.2, 0.2].map(|size| cube(state) * size);
            for k in 0..keys {
                let time = key_time(k);
                for j in 0..=RATE {
                    for i in 0..=RATE {
                        let (u, v) = (
                            f32::from(i) / f32::from(RATE),
                            f32::from(j) / f32::from(RATE),
                        );
                        let bent = bend * (4.0 * u * v) + turn * (u * time * time);
                        mesh.positions
                            .push(corner + along * u + across * v + bent + drift * time);
                    }
                }
            }
            mesh.grids.push(Grid {
                first_vertex: mesh.vertex_count as u32,
                element,
                nu: RATE,
                nv: RATE,
            });
            mesh.vertex_count += usize::from(RATE + 1) * usize::from(RATE + 1);
        }
        let object = Arc::new(ObjectGeometry::new(mesh));
        assert!(object.stats().blocks > 200);
        let count = if many { 7 } else { 1 };
        let instances = (0..count).map(|i| {
            let angle = 0.4 * f64::from(i);
            let way = DVec3::new(angle.sin(), angle.cos() - 1.0, 0.2 * angle) * 0.8;
            let turned = |by: f64| {
                let size = DVec3::splat(0.7);
                DAffine3::from_scale_rotation_translation(size, DQuat::from_rotation_y(by), way)
            };
            let transform = match i % 3 {
                0 => InstanceTransform::Translation(way),
                1 => InstanceTransform::Static(turned(angle)),
                _ => InstanceTransform::Moving {
                    key_times: vec![0.0, 1.0],
                    matrices: vec![turned(angle), turned(angle + 0.1)],
                },
            };
            WorldInstance {
                object: object.clone(),
                transform,
                user: 0,
            }
        });
        let world = World::build(instances.collect(), DVec3::ZERO);
        assert!(world.is_far());
        world
    }

    #[test]
    fn rays_come_to_the_same_where_blocks_wait() {
        let cases = [1, 2, 4].map(|keys| [false, true].map(|many| (keys, many)));
        let mut seen = [0, 0];
        for (keys, many) in cases.into_iter().flatten() {
            let world = patches(keys, many);
            let (mut few, mut some) = (0, 0);
            for seed in 0..60 {
                let state = &mut (seed + 1);
                // From all around, and side by side.
                let (eye, spread) = (cube(state) * 3.0, if seed % 2 == 0 { 1.0 } else { 0.1 });
                let rays: Vec<Ray> = (0..PACKET)
                    .map(|i| {
                        let origin = if spread == 1.0 { cube(state) } else { eye };
                        Ray {
                            origin,
                            dir: cube(state) * spread - origin,
                            time: unit(state),
                            t_min: 0.0,
                            t_max: if i % 5 == 0 { 0.7 } else { f32::INFINITY },
                        }
                    })
                    .collect();
                let mut trace = |waits: bool| {
                    let mut hits = vec![Hit::MISS; PACKET];
                    let mut each = vec![TraceCounts::default(); PACKET];
                    let set = || {
                        with_room(|room| {
                            room.opened.pays = waits;
                            room.opened.seen = [0, 0];
                        });
                    };
                    let mut count = || {
                        let now = with_room(|room| room.opened.seen);
                        // Packets of many cubes find out by themselves.
                        assert!(waits || many || now == [0, 0], "{now:?}");
                        seen = [seen[0] + now[0], seen[1] + now[1]];
                    };
                    set();
                    world.trace_packet(&rays, &mut hits, &mut each);
                    let pays = with_room(|room| room.opened.pays);
                    count();
                    set();
                    let (mut found, mut all) = (vec![false; PACKET], TraceCounts::default());
                    world.occluded_many(&rays, &mut found, &mut all);
                    count();
                    ((hits, each), (found, all), pays)
                };
                let (waiting, at_once) = (trace(true), trace(false));
                assert_eq!(waiting, at_once, "{keys} keys, {seed}");
                let ((hits, _), (found, _), pays) = waiting;
                for ((ray, hit), found) in rays.iter().zip(hits).zip(found) {
                    let alone = world.trace(ray, &mut TraceCounts::default());
                    assert_eq!(alone, hit, "{keys} keys, {seed}: {ray:?}");
                    assert_eq!(alone.is_hit(), found, "{keys} keys, {seed}: {ray:?}");
                    some += usize::from(hit.is_hit());
                }
                few += usize::from(pays);
            }
            assert!(some > 600 && some < 60 * PACKET, "{some}");
            // Packets from all around.
            assert!((20..60).contains(&few), "{few}");
        }
        assert!(seen[0] > 10_000 && seen[1] > 3, "{seen:?}");
    }

    /// A packet that comes to no block says nothing of the next.
    #[test]
    fn that_it_pays_is_not_forgotten_without_a_block() {
        let world = patches(1, false);
        let short = Ray {
            origin: glam::Vec3::ZERO,
            dir: glam::Vec3::X,
            time: 0.0,
            t_min: 0.0,
            t_max: 1e-6,
        };
        let pays = |waits: bool| {
            with_room(|room| room.opened.pays = waits);
            let counts = &mut [TraceCounts::default()];
            world.trace_packet(&[short], &mut [Hit::MISS], counts);
            (with_room(|room| room.opened.pays), counts[0].node_tests)
        };
        let (after, nodes) = pays(true);
        assert!(after && nodes > 0, "{nodes}");
        assert!(!pays(false).0);
        // One ray that comes to blocks is few.
        let state = &mut 9;
        let hits = |ray: &Ray| world.trace(ray, &mut TraceCounts::default()).is_hit();
        let long = std::iter::repeat_with(|| Ray {
            dir: cube(state),
            t_max: f32::INFINITY,
            ..short
        });
        let long = long.take(100).find(hits).expect("one of them hits");
        with_room(|room| room.opened.pays = false);
        let counts = &mut [TraceCounts::default()];
        world.trace_packet(&[long], &mut [Hit::MISS], counts);
        assert!(with_room(|room| room.opened.pays));
    }
}
