//! The order of rays that leaves surfaces where they are: rays that are expected to meet one place of a surface go together, whatever
//! time and lens point they have.
//!
//! Rays of one pixel, or of one instant, meet places all over a surface where it moves fast or is out of focus. So a few
//! are traced first, or known from samples before, the others followed to what these met ([`super::expected`]), and cut into packets by
//! where they end there.
//! Those of a packet have their groups of micropolygons in common, and so memory, which is what rays wait for where scenes are large.
//! Where what was met moves in several ways, or at several depths, that tells nothing, and the usual order stays.
//!
//! Hits do not depend on the order.

use std::ops::Range;

pub use super::expected::Expected;
use super::expected::PROBES;
use super::packet::PACKET;
use super::rectangles::in_rectangles;
use super::{Hit, Ray, TraceCounts, World};

/// Rays that are ordered, at the least: four packets.
const LEAST_RAYS: usize = 4 * PACKET;
/// Rays for which some are traced first, at the least: these cost time.
const LEAST_PROBED: usize = 1024;
/// The area that packets have on a surface, of that in the usual order, up to which they are worth it.
const WORTH: f32 = 0.7;
/// Blocks by which the usual order is judged.
const JUDGED: usize = 2;
/// One of so many packets judges the order...
const EVERY: usize = 4;
/// ...but as many as this where there are,
const FEW: usize = 8;
/// and about as many as this where it would be more.
const MANY: usize = 64;

/// Rays in the order in which they usually go: block after block of pixels, and in each in packets.
#[derive(Clone, Copy, Debug)]
pub struct Usual<'a> {
    /// The rays of each block; they follow each other from 0 on.
    pub blocks: &'a [Range<usize>],
    /// A block's rays are sorted by time first.
    pub by_time: bool,
}

/// What rays are expected to meet, as some of them tell, of `count` of which `met` gives each by its number, and what it met; `None`
/// where these met too little. Any thread.
pub fn expected(
    world: &World,
    count: usize,
    met: impl Fn(usize) -> (Ray, Hit),
) -> Option<Expected> {
    (count >= PROBES)
        .then(|| Expected::of(world, &spread(count).map(met)))
        .flatten()
}

/// Numbers of some rays that are spread over blocks and pixels; where what they hit is at other times is known of each.
fn spread(count: usize) -> [usize; PROBES] {
    std::array::from_fn(|k| {
        let each = count / PROBES;
        k * each + (27 * k + 9) % PACKET.min(each)
    })
}

/// [`expected`] of rays that were not traced yet, of which some are now. What that cost is added to `counts`; they are not counted as rays.
/// `None` also where it would not pay.
pub fn probed<'r>(
    world: &World,
    count: usize,
    ray: impl Fn(usize) -> &'r Ray,
    counts: &mut TraceCounts,
) -> Option<Expected> {
    if !pays(world, count) || count < LEAST_PROBED {
        return None;
    }
    let probes = spread(count).map(|i| *ray(i));
    let mut hits = [Hit::MISS; PROBES];
    let mut own = TraceCounts::default();
    world.trace_many(&probes, &mut hits, &mut own);
    *counts = *counts + TraceCounts { rays: 0, ..own };
    Expected::of(world, &std::array::from_fn(|k| (probes[k], hits[k])))
}

/// False where there are too few rays, or positions are not [far](World::is_far), so that an order would not pay.
fn pays(world: &World, count: usize) -> bool {
    world.is_far() && count >= LEAST_RAYS && u32::try_from(count).is_ok()
}

/// Orders rays, of which `ray` gives each by its number in the usual order; `None` where that is as good, or an order would not pay.
///
/// Rays should be neighbours, as those of a tile of an image are. Any thread.
pub fn by_surface<'r>(
    world: &World,
    expected: &Expected,
    ray: impl Fn(usize) -> &'r Ray,
    usual: Usual<'_>,
) -> Option<Vec<u32>> {
    let count = usual.blocks.last()?.end;
    if !pays(world, count) {
        return None;
    }
    let before = usual_area(world, expected, &ray, usual)?;
    if expected.least_area() > WORTH * before {
        return None;
    }
    let places = expected.places(world.level, count, &ray);
    let order = in_rectangles(world.level, &places)?;
    let (mut area, mut packets) = (0.0, 0.0);
    let (full, _) = order.as_chunks::<PACKET>();
    for packet in full.iter().step_by(every(full.len())) {
        let at = packet.iter().map(|&i| i as usize);
        area += expected.area(at.map(|i| (places.of(i), ray(i).time)));
        packets += 1.0;
    }
    (area < WORTH * before * packets).then_some(order)
}

/// One of how many packets judges the order.
fn every(packets: usize) -> usize {
    (packets / FEW).clamp(1, EVERY).max(packets / MANY)
}

/// The area of the surface that a packet meets in the usual order: of one in the middle of each of some blocks.
fn usual_area<'r>(
    world: &World,
    expected: &Expected,
    ray: &impl Fn(usize) -> &'r Ray,
    usual: Usual<'_>,
) -> Option<f32> {
    let area_of = |number: &dyn Fn(usize) -> usize| {
        let ray = |k: usize| ray(number(k));
        let places = expected.places(world.level, PACKET, ray);
        expected.area((0..PACKET).map(|k| (places.of(k), ray(k).time)))
    };
    let full = usual.blocks.iter().filter(|block| block.len() >= PACKET);
    let step = full.clone().count().div_ceil(JUDGED).max(1);
    let (mut area, mut blocks) = (0.0, 0.0);
    for block in full.skip(step / 2).step_by(step) {
        area += if usual.by_time {
            // Those next to half the shutter. Numbers that are not negative have the order of their bits.
            let off = |i: usize| u64::from((ray(i).time - 0.5).abs().to_bits());
            let mut times: Vec<u64> = block.clone().map(|i| off(i) << 32 | i as u64).collect();
            times.select_nth_unstable(PACKET - 1);
            area_of(&|k| times[k] as u32 as usize)
        } else {
            let middle = block.start + (block.len() / PACKET / 2) * PACKET;
            let middle = middle.min(block.end - PACKET);
            area_of(&|k| middle + k)
        };
        blocks += 1.0;
    }
    let area = area / blocks;
    (area > 0.0 && area.is_finite()).then_some(area)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DVec3, Vec2, Vec3};

    use super::*;
    use crate::bvh::ObjectGeometry;
    use crate::grid::{DicedMesh, Grid};
    use crate::trace::random::unit;
    use crate::trace::{InstanceTransform, WorldInstance};

    /// Rates of a grid.
    const RATE: u16 = 8;
    /// Side of a tile, and of a block.
    const TILE: u16 = 16;
    const BLOCK: u16 = 8;

    /// A sheet of `side` x `side` grids from -1 to 1 that goes `way` in a shutter, `more` of it for each grid.
    fn sheet(side: u16, way: Vec3, more: impl Fn(usize) -> Vec3) -> World {
        let mut mesh = DicedMesh {
            key_times: vec![0.0, 1.0],
            ..DicedMesh::default()
        };
        let count = usize::from(side) * usize::from(side);
        for key in [-0.5, 0.5] {
            for grid in 0..count {
                let first = [grid % usize::from(side), grid / usize::from(side)];
                for vertex in 0..usize::from(RATE + 1).pow(2) {
                    let of = usize::from(RATE + 1);
                    let [x, y] =
                        [(first[0], vertex % of), (first[1], vertex / of)].map(|(g, i)| {
                            let i = g * usize::from(RATE) + i;
                            2.0 * i as f32 / f32::from(side * RATE) - 1.0
                        });
                    let still = Vec3::new(x, y, 0.02 * (9.0 * x).sin() * (7.0 * y).cos());
                    mesh.positions.push(still + (way + more(grid)) * key);
                }
            }
        }
        // Positions are grid after grid, and in each key after key.
        let size = usize::from(RATE + 1).pow(2);
        let by_key = std::mem::take(&mut mesh.positions);
        for grid in 0..count {
            for key in 0..2 {
                let first = (key * count + grid) * size;
                mesh.positions.extend(&by_key[first..first + size]);
            }
            mesh.grids.push(Grid {
                first_vertex: (grid * size) as u32,
                element: grid as u32,
                nu: RATE,
                nv: RATE,
            });
        }
        mesh.vertex_count = count * size;
        let instance = WorldInstance {
            object: Arc::new(ObjectGeometry::new(mesh)),
            transform: InstanceTransform::Translation(DVec3::ZERO),
            user: 0,
        };
        World::build(vec![instance], DVec3::ZERO)
    }

    /// A tile's rays as renders have them: block by block, and in each sample by sample.
    fn tile(lens: f32, samples: u8) -> (Vec<Ray>, Vec<Range<usize>>) {
        let state = &mut 3;
        let (mut rays, mut blocks) = (Vec::new(), Vec::new());
        for block in 0..4 {
            let begin = rays.len();
            for _ in 0..samples {
                for pixel in 0..BLOCK * BLOCK {
                    let x = f32::from(block % 2 * BLOCK + pixel % BLOCK) + unit(state);
                    let y = f32::from(block / 2 * BLOCK + pixel / BLOCK) + unit(state);
                    let at = (Vec2::new(x, y) / f32::from(TILE) - 0.5) * 0.3;
                    let (radius, angle) = (unit(state).sqrt() * lens, unit(state) * 6.3);
                    let origin = Vec3::new(radius * angle.cos(), radius * angle.sin(), 4.0);
                    // In focus behind the sheet.
                    rays.push(Ray {
                        origin,
                        dir: at.extend(-1.0) - origin,
                        time: unit(state),
                        t_min: 0.0,
                        t_max: f32::INFINITY,
                    });
                }
            }
            blocks.push(begin..rays.len());
        }
        (rays, blocks)
    }

    fn ordered(world: &World, rays: &[Ray], blocks: &[Range<usize>]) -> Option<Vec<u32>> {
        let usual = Usual {
            blocks,
            by_time: true,
        };
        let mut counts = TraceCounts::default();
        let ray = |i: usize| &rays[i];
        let expected = probed(world, rays.len(), ray, &mut counts);
        assert_eq!(counts.rays, 0);
        assert!(expected.is_none() || counts.node_tests > 0);
        let met = |i: usize| (rays[i], world.trace(&rays[i], &mut TraceCounts::default()));
        let told = super::expected(world, rays.len(), met);
        assert!(expected.is_none() || expected == told);
        by_surface(world, &told?, ray, usual)
    }

    /// Mean area of the boxes, at half the shutter, around what packets really hit.
    fn area(world: &World, rays: &[Ray], order: &[u32]) -> f32 {
        let mut sum = 0.0;
        let (packets, _) = order.as_chunks::<PACKET>();
        for packet in packets {
            let mut bounds = [Vec2::INFINITY, Vec2::NEG_INFINITY];
            for &i in packet {
                let ray = &rays[i as usize];
                let hit = world.trace(ray, &mut TraceCounts::default());
                let at = world.position(&hit, 0.5).expect("the sheet fills the view");
                bounds = [bounds[0].min(at.truncate()), bounds[1].max(at.truncate())];
            }
            sum += (bounds[1] - bounds[0]).element_product();
        }
        sum / packets.len() as f32
    }

    fn by_time(rays: &[Ray], blocks: &[Range<usize>]) -> Vec<u32> {
        let mut order: Vec<u32> = (0..rays.len() as u32).collect();
        for block in blocks {
            let time = |i: &u32| rays[*i as usize].time;
            order[block.clone()].sort_by(|a, b| time(a).total_cmp(&time(b)));
        }
        order
    }

    #[test]
    fn packets_meet_less_of_what_moves_or_is_out_of_focus() {
        let still = |_| Vec3::ZERO;
        for (way, lens) in [
            (Vec3::new(0.6, 0.3, 0.0), 0.0),
            (Vec3::new(-0.2, 0.5, 0.4), 0.0),
            (Vec3::ZERO, 0.4),
            (Vec3::new(0.0, 0.4, 0.1), 0.3),
        ] {
            let world = sheet(16, way, still);
            let (rays, blocks) = tile(lens, 8);
            let order = ordered(&world, &rays, &blocks).expect("an order");
            let mut all = order.clone();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..rays.len() as u32));

            let before = area(&world, &rays, &by_time(&rays, &blocks));
            let after = area(&world, &rays, &order);
            assert!(after < 0.6 * before, "{way} {lens}: {after} of {before}");

            let sorted: Vec<Ray> = order.iter().map(|&i| rays[i as usize]).collect();
            let mut hits = vec![Hit::MISS; rays.len()];
            world.trace_many(&sorted, &mut hits, &mut TraceCounts::default());
            for (ray, hit) in sorted.iter().zip(&hits) {
                assert_eq!(*hit, world.trace(ray, &mut TraceCounts::default()));
            }
        }
    }

    #[test]
    fn the_usual_order_stays_where_nothing_is_told() {
        let way = Vec3::new(0.6, 0.3, 0.0);
        let still = |_| Vec3::ZERO;
        let (rays, blocks) = tile(0.0, 8);
        let world = sheet(16, way, still);
        assert!(ordered(&world, &rays, &blocks).is_some());
        // Too few rays; nothing but misses; all in one place.
        assert!(ordered(&world, &rays[..255], &[0..128, 128..255]).is_none());
        assert!(ordered(&world, &[], &[]).is_none());
        let aside: Vec<Ray> = rays
            .iter()
            .map(|ray| Ray {
                dir: -ray.dir,
                ..*ray
            })
            .collect();
        assert!(ordered(&world, &aside, &blocks).is_none());
        assert!(ordered(&world, &vec![rays[0]; rays.len()], &blocks).is_none());
        let mut few = aside;
        few[..rays.len() / 4].copy_from_slice(&rays[..rays.len() / 4]);
        assert!(ordered(&world, &few, &blocks).is_none());
        // What caches hold.
        let small = sheet(1, way * 0.1, still);
        assert!(!small.is_far() && ordered(&small, &rays, &blocks).is_none());
        // Each grid its own way.
        let crowd = sheet(16, Vec3::ZERO, |grid| {
            let state = &mut (grid as u64 + 1);
            for _ in 0..9 {
                unit(state);
            }
            Vec3::new(unit(state) - 0.5, unit(state) - 0.5, 0.0)
        });
        assert!(ordered(&crowd, &rays, &blocks).is_none());
        // Numbers that are not finite, of which each packet's rays may be.
        let told = probed(
            &world,
            rays.len(),
            |i| &rays[i],
            &mut TraceCounts::default(),
        )
        .unwrap();
        let by = |rays: &[Ray], blocks: &[Range<usize>]| {
            let usual = Usual {
                blocks,
                by_time: true,
            };
            by_surface(&world, &told, |i| &rays[i], usual)
        };
        assert!(by(&rays, &blocks).is_some() && by(&[], &[]).is_none());
        for every in [1, 700, rays.len()] {
            for (origin, time) in [(f32::NAN, 0.5), (f32::INFINITY, 0.5), (0.0, f32::NAN)] {
                let mut broken = rays.clone();
                for ray in broken.iter_mut().step_by(every) {
                    (ray.origin, ray.time) = (ray.origin + origin, time);
                }
                assert!(by(&broken, &blocks).is_none(), "{every} {origin} {time}");
            }
        }
    }

    #[test]
    fn few_rays_are_ordered_by_what_others_told() {
        let world = sheet(16, Vec3::new(0.6, 0.3, 0.0), |_| Vec3::ZERO);
        let (rays, blocks) = tile(0.0, 1);
        let ray = |i: usize| &rays[i];
        let mut counts = TraceCounts::default();
        assert!(probed(&world, rays.len(), ray, &mut counts).is_none());
        assert_eq!(counts, TraceCounts::default());
        let order = ordered(&world, &rays, &blocks).expect("an order");
        let before = area(&world, &rays, &by_time(&rays, &blocks));
        let after = area(&world, &rays, &order);
        assert!(after < 0.7 * before, "{after} of {before}");
        assert!(expected(&world, 15, |_| unreachable!()).is_none());
    }

    #[test]
    fn enough_packets_judge() {
        for (packets, step) in [(4, 1), (8, 1), (31, 3), (32, 4), (319, 4), (640, 10)] {
            assert_eq!(every(packets), step, "{packets}");
        }
    }

    #[test]
    fn blocks_of_any_size_are_no_trouble() {
        let world = sheet(16, Vec3::new(0.6, 0.3, 0.0), |_| Vec3::ZERO);
        let (rays, _) = tile(0.2, 8);
        let ragged = [64, 63, 0, 128, 1, 65, 100, 64, 700, 64, 64, 127];
        let one_full = [1024, 32, 32, 4];
        for sizes in [
            &ragged[..],
            &[64; 16],
            &[63; 17],
            &[1; 1024],
            &[1024],
            &one_full,
        ] {
            let mut end = 0;
            let blocks: Vec<Range<usize>> = sizes
                .iter()
                .map(|size| {
                    end += size;
                    end - size..end
                })
                .collect();
            for by_time in [false, true] {
                let usual = Usual {
                    blocks: &blocks,
                    by_time,
                };
                let ray = |i: usize| &rays[i];
                let order = probed(&world, end, ray, &mut TraceCounts::default())
                    .and_then(|expected| by_surface(&world, &expected, ray, usual));
                // Nothing is known of what packets meet where no block fills one.
                let filled = sizes.iter().any(|&size| size >= PACKET);
                assert_eq!(filled, order.is_some(), "{sizes:?}");
                if let Some(mut order) = order {
                    order.sort_unstable();
                    assert!(order.into_iter().eq(0..end as u32), "{sizes:?}");
                }
            }
        }
    }
}
