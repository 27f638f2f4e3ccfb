//! Tracing against the brute-force oracle in f64.

mod trace_scenes;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::packet::PACKET;
use hdtrapeze_core::trace::places::Shift;
use hdtrapeze_core::trace::world::WorldError;
use hdtrapeze_core::trace::{
    Hit, InstanceSet, InstanceTransform, Ray, TraceCounts, World, WorldInstance, WorldSet, brute,
};
use hdtrapeze_simd::Level;
use trace_scenes::*;

/// Rays at a world of about unit size around `centre`.
fn random_ray(rng: &mut Rng, centre: Vec3, size: f32) -> Ray {
    let origin = centre + rng.direction() * size * (0.2 + 3.0 * rng.unit());
    let target = centre + rng.cube() * size;
    let dir = (target - origin) * (0.01 + 5.0 * rng.unit());
    ray(origin, dir, rng.unit())
}

/// Traces `count` rays and checks each; returns how many hit.
fn check(world: &World, rng: &mut Rng, centre: Vec3, size: f32, count: usize) -> usize {
    let mut counts = TraceCounts::default();
    let mut hits = 0;
    for _ in 0..count {
        let ray = random_ray(rng, centre, size);
        let hit = world.trace(&ray, &mut counts);
        brute::verify(world, &ray, None, &hit).unwrap_or_else(|e| panic!("{ray:?}: {e}"));
        assert_eq!(world.occluded(&ray, &mut counts), hit.is_hit());
        hits += usize::from(hit.is_hit());
    }
    hits
}

#[test]
fn objects_agree_with_the_oracle() {
    let mut rng = Rng(1);
    for k in [1, 2, 3, 5] {
        let keys = keys(k);
        let meshes = [
            ("sheet", sheet(3, 9, &keys)),
            ("patches", patches(20, 7, &keys, 3)),
            ("fur", fur(60, &keys, 4)),
            ("combed fur", combed(60, 0.05, &keys, 4)),
            ("thin strands", thin(300, &keys, 4)),
            ("sphere", sphere(2, 5, &keys)),
        ];
        for (name, mesh) in meshes {
            let world = world_of(mesh);
            let hits = check(&world, &mut rng, Vec3::ZERO, 1.0, 500);
            assert!(hits > 15, "{name} {k}: {hits}");
        }
    }
}

#[test]
fn uneven_keys_agree_with_the_oracle() {
    let mut rng = Rng(2);
    let world = world_of(patches(25, 6, &[0.0, 0.1, 0.15, 0.8, 1.0], 5));
    assert!(check(&world, &mut rng, Vec3::ZERO, 1.0, 2000) > 100);
}

/// A ray by itself passes most parts of strands by, whose boxes it meets. So do packets of rays that go all ways, where a ray
/// goes on while parts wait for it: it meets a little more. Rays beside each other are tested together instead.
#[test]
fn strands_beside_a_ray_are_not_tested() {
    for k in [1, 2, 3] {
        let object = object(fur(20_000, &keys(k), 5));
        let place = InstanceTransform::Translation(DVec3::ZERO);
        let world = World::build(vec![instance(&object, place)], DVec3::ZERO);
        let mut rng = Rng(k as u64);
        let near: Vec<Ray> = (0..PACKET * 32)
            .map(|i| {
                let at = Vec3::new((i % 45) as f32, (i / 45) as f32, 0.0) / 30.0 - 0.7;
                let by = Vec3::new(0.3 * rng.signed(), 0.3 * rng.signed(), -1.0);
                ray(at - by, by, rng.unit())
            })
            .collect();
        let all_ways: Vec<Ray> = (0..PACKET * 32)
            .map(|_| random_ray(&mut rng, Vec3::new(0.0, 0.0, 0.1), 0.8))
            .collect();
        let ask = |rays: &[Ray]| {
            let (mut alone, mut many) = (TraceCounts::default(), TraceCounts::default());
            let mut hits = vec![Hit::MISS; rays.len()];
            world.trace_many(rays, &mut hits, &mut many);
            for (ray, hit) in rays.iter().zip(&hits) {
                assert_eq!(world.trace(ray, &mut alone), *hit, "{ray:?}");
            }
            let count = hits.iter().filter(|hit| hit.is_hit()).count();
            assert!(count > rays.len() / 8, "{count} of {} hit", rays.len());
            (alone, many)
        };
        let (alone, many) = ask(&near);
        assert!(
            2 * alone.cell_tests < many.cell_tests,
            "{k} keys: {alone:?} alone, {many:?} together"
        );
        let (alone, many) = ask(&all_ways);
        assert_eq!(alone.rays, many.rays);
        for (alone, many) in [
            (alone.node_tests, many.node_tests),
            (alone.cell_tests, many.cell_tests),
        ] {
            assert!(
                8 * many < 9 * alone,
                "{k} keys: {alone} alone, {many} in turns"
            );
        }
    }
}

/// In one object, combed strands, whose nodes have frames, and others, whose nodes have none but diagonals.
#[test]
fn rays_that_go_all_ways_know_the_frames_of_nodes() {
    for seed in 0..6 {
        let mut rng = Rng(100 + seed);
        let (n, width) = (5000, [0.02, 0.006, 0.003][rng.below(3)]);
        let who: Vec<_> = (0..n)
            .map(|g| {
                let root = Vec3::new(rng.signed(), rng.signed(), 0.0) * 0.4;
                let combed = (Vec3::new(0.9, 0.6, 0.4) + rng.cube() * 0.06) * 0.25;
                let (root, way) = match g % 4 {
                    0 => (root, combed),
                    _ => (rng.cube(), rng.direction() * 0.3),
                };
                (root, way, rng.direction() * width)
            })
            .collect();
        let rate = if seed % 2 == 0 { (1, 16) } else { (16, 1) };
        let strands = mesh(
            &vec![rate; n],
            &keys([1, 1, 5][seed as usize % 3]),
            |g, u, v, t| {
                let (root, way, side) = who[g];
                let (across, along) = if rate.0 > 1 { (v, u) } else { (u, v) };
                let p = root + way * along + side * ((across - 0.5) * (1.0 - 0.9 * along));
                glam::Quat::from_rotation_z(2.5 * t) * p
            },
        );
        let world = world_of(strands);
        let rays: Vec<Ray> = (0..PACKET * 40)
            .map(|_| {
                let at =
                    Vec3::new(rng.signed(), rng.signed(), 0.0) * 0.4 + Vec3::Z * 0.1 * rng.unit();
                let from = rng.direction() * (0.05 + rng.unit());
                ray(at + from, -from * (0.1 + rng.unit()), rng.unit())
            })
            .collect();
        for level in Level::available() {
            let world = world.clone().with_level(level);
            let mut hits = vec![Hit::MISS; rays.len()];
            world.trace_many(&rays, &mut hits, &mut TraceCounts::default());
            for (ray, hit) in rays.iter().zip(&hits) {
                let alone = world.trace(ray, &mut TraceCounts::default());
                assert_eq!(alone, *hit, "{seed} {} {ray:?}", level.name());
            }
            assert!(hits.iter().filter(|hit| hit.is_hit()).count() > 500);
        }
    }
}

fn spinning(n: usize, turn: f64, scale: DVec3, at: DVec3) -> InstanceTransform {
    let key_times = keys(n);
    let matrices = key_times
        .iter()
        .map(|&t| {
            affine(
                DVec3::new(1.0, 2.0, 0.5),
                turn * f64::from(t),
                scale,
                at + DVec3::X * f64::from(t) * 0.4,
            )
        })
        .collect();
    InstanceTransform::Moving {
        key_times,
        matrices,
    }
}

fn all_kinds(offset: DVec3, world_origin: DVec3, k: usize) -> World {
    let still = object(patches(6, 5, &keys(1), 8));
    let moving = object(sheet(2, 6, &keys(k)));
    let mirrored = DVec3::new(-0.7, 0.5, 1.3);
    let instances = vec![
        instance(&still, InstanceTransform::Translation(offset)),
        instance(
            &moving,
            InstanceTransform::Translation(offset + DVec3::new(0.3, 0.1, 0.5)),
        ),
        instance(
            &still,
            InstanceTransform::Static(affine(DVec3::ONE, 1.0, mirrored, offset - DVec3::Y)),
        ),
        instance(
            &moving,
            InstanceTransform::Static(affine(DVec3::Z, 2.0, DVec3::new(0.1, 2.0, 1.0), offset)),
        ),
        instance(&still, spinning(2, 0.8, DVec3::ONE, offset + DVec3::Z)),
        instance(&moving, spinning(5, 2.5, mirrored, offset - DVec3::Z)),
    ];
    World::build(instances, world_origin)
}

#[test]
fn instances_agree_with_the_oracle() {
    let mut rng = Rng(3);
    for k in [1, 2, 4] {
        let world = all_kinds(DVec3::ZERO, DVec3::ZERO, k);
        assert!(check(&world, &mut rng, Vec3::ZERO, 2.0, 1500) > 300);
    }
}

/// Many instances that stand still, and few that move: these have a tree of their own.
fn few_movers(movers: u32) -> World {
    let (still, moving) = (
        object(patches(3, 5, &keys(1), 8)),
        object(patches(2, 5, &keys(3), 9)),
    );
    let mut rng = Rng(10);
    let mut at = || rng.cube().as_dvec3() * 1.5;
    let mut list: Vec<WorldInstance> = (0..60)
        .map(|_| instance(&still, InstanceTransform::Translation(at())))
        .collect();
    for i in 0..movers {
        let place = match i % 2 {
            0 => InstanceTransform::Translation(at()),
            _ => spinning(3, 0.9, DVec3::ONE, at()),
        };
        list.insert(5 * i as usize, instance(&moving, place));
    }
    World::build(list, DVec3::ZERO)
}

#[test]
fn few_that_move_among_many_agree_with_the_oracle() {
    for movers in [1, 7, 12] {
        let world = few_movers(movers);
        assert!(check(&world, &mut Rng(11), Vec3::ZERO, 2.0, 150) > 20);
        // Some of what is hit moves.
        let mut rng = Rng(12);
        let hits = (0..3000).filter(|_| {
            let ray = random_ray(&mut rng, Vec3::ZERO, 2.0);
            let hit = world.trace(&ray, &mut TraceCounts::default());
            hit.is_hit() && hit.instance.is_multiple_of(5) && hit.instance < 5 * movers
        });
        assert!(hits.count() > 5, "{movers}");
    }
}

#[test]
fn far_offsets_lose_nothing() {
    // The same rays against the same world, 1e7 away: the same hits, since the world's origin
    // is subtracted before anything is rounded.
    let far = DVec3::new(1.0e7, -2.0e7, 3.0e7);
    let (near, far) = (
        all_kinds(DVec3::ZERO, DVec3::ZERO, 2),
        all_kinds(far, far, 2),
    );
    let mut rng = Rng(4);
    check(&far, &mut rng, Vec3::ZERO, 2.0, 500);
    let mut counts = TraceCounts::default();
    for _ in 0..2000 {
        let ray = random_ray(&mut rng, Vec3::ZERO, 2.0);
        let (a, b) = (near.trace(&ray, &mut counts), far.trace(&ray, &mut counts));
        if a != b {
            // f64 rounds at 1e7 too: 2e-9. Only neighbours may be swapped.
            brute::verify(&near, &ray, None, &b).unwrap_or_else(|e| panic!("{ray:?}: {a:?} {e}"));
        }
    }
}

#[test]
fn far_from_the_origin_agrees_within_tolerance() {
    // The world's origin is far from the object: coordinates are large, tolerances follow.
    let at = DVec3::new(1000.0, 500.0, -300.0);
    let world = all_kinds(at, DVec3::ZERO, 2);
    assert!(check(&world, &mut Rng(5), at.as_vec3(), 2.0, 1000) > 200);
}

#[test]
fn mesh_origin_and_translation_add_up() {
    let mut mesh = sheet(1, 4, &keys(1));
    mesh.origin = DVec3::splat(1.0e7);
    let o = object(mesh);
    let place = InstanceTransform::Translation(DVec3::new(0.0, 0.0, -5.0e6));
    let world = World::build(vec![instance(&o, place)], DVec3::new(1.0e7, 1.0e7, 5.0e6));
    let hit = world.trace(
        &ray(Vec3::new(0.1, 0.2, 9.0), -Vec3::Z, 0.0),
        &mut TraceCounts::default(),
    );
    assert!(hit.is_hit() && (hit.t - 9.0).abs() < 0.2);
    let p = world.position(&hit, 0.0).expect("a hit");
    assert!(
        (p - Vec3::new(0.1, 0.2, 9.0 - hit.t)).length() < 1e-5,
        "{p}"
    );
}

/// All hits, one after the other.
fn enumerate(world: &World, ray: &Ray) -> Vec<Hit> {
    let mut counts = TraceCounts::default();
    let mut hits = Vec::new();
    let mut hit = world.trace(ray, &mut counts);
    while hit.is_hit() {
        hits.push(hit);
        hit = world.trace_after(ray, &hit, &mut counts);
        assert!(hits.len() < 10_000);
    }
    hits
}

#[test]
fn trace_after_enumerates_every_hit() {
    let mut rng = Rng(6);
    let mut total = 0;
    for k in [1, 2, 3] {
        let world = all_kinds(DVec3::ZERO, DVec3::ZERO, k);
        for _ in 0..500 {
            let ray = random_ray(&mut rng, Vec3::ZERO, 2.0);
            let hits = enumerate(&world, &ray);
            assert!(hits.windows(2).all(|w| w[0].is_before(&w[1])));
            let t_min = f64::from(ray.t_min);
            let oracle: Vec<_> = brute::crossings(&world, &ray)
                .into_iter()
                .filter(|c| c.t > t_min)
                .collect();
            // Whoever the oracle is sure of is there; whoever is there, the oracle knows.
            for c in oracle.iter().filter(|c| c.inside > c.tolerance) {
                let same = |h: &&Hit| (h.instance, h.grid, h.cell) == (c.instance, c.grid, c.cell);
                let slack = 2.0 * c.tolerance / c.cosine / f64::from(ray.dir.length());
                assert!(
                    hits.iter()
                        .filter(same)
                        .any(|h| (f64::from(h.t) - c.t).abs() <= slack)
                        || c.t < t_min + slack,
                    "{ray:?} misses {c:?}"
                );
            }
            for h in &hits {
                let known = oracle
                    .iter()
                    .any(|c| (h.instance, h.grid, h.cell) == (c.instance, c.grid, c.cell));
                assert!(
                    known || f64::from(h.t) < 1e-4,
                    "{ray:?}: {h:?} is not known to the oracle"
                );
            }
            total += hits.len();
        }
    }
    assert!(total > 1000, "{total}");
}

#[test]
fn coincident_surfaces_are_each_hit_once() {
    let o = object(sheet(2, 8, &keys(2)));
    let copies = 5;
    let instances = (0..copies)
        .map(|_| instance(&o, InstanceTransform::Translation(DVec3::ZERO)))
        .collect();
    let world = World::build(instances, DVec3::ZERO);
    let mut rng = Rng(7);
    for _ in 0..500 {
        let ray = ray(
            Vec3::new(rng.signed(), rng.signed(), 2.0) * 0.9,
            Vec3::new(0.01, 0.02, -1.0),
            rng.unit(),
        );
        let hits = enumerate(&world, &ray);
        assert_eq!(hits.len(), copies, "{ray:?} {hits:?}");
        for (i, h) in hits.iter().enumerate() {
            assert_eq!(h.instance as usize, i);
            assert_eq!(
                (h.t, h.grid, h.cell),
                (hits[0].t, hits[0].grid, hits[0].cell)
            );
        }
    }
}

#[test]
fn order_and_batches_change_nothing() {
    // The same instances in reverse, and the same grids in another order, give the same hits.
    let objects: Vec<_> = (0..4)
        .map(|i| object(patches(10, 4, &keys(2), 20 + i)))
        .collect();
    let list: Vec<WorldInstance> = objects
        .iter()
        .flat_map(|o| {
            [
                instance(o, InstanceTransform::Translation(DVec3::X * 0.1)),
                instance(o, spinning(2, 0.5, DVec3::ONE, DVec3::ZERO)),
            ]
        })
        .collect();
    let n = list.len() as u32;
    let forward = World::build(list.clone(), DVec3::ZERO);
    let backward = World::build(list.into_iter().rev().collect(), DVec3::ZERO);
    let mut rng = Rng(8);
    let rays: Vec<Ray> = (0..3000)
        .map(|_| random_ray(&mut rng, Vec3::ZERO, 1.0))
        .collect();
    let (mut alone, mut batch) = (TraceCounts::default(), TraceCounts::default());
    let mut hits = vec![Hit::MISS; rays.len()];
    forward.trace_many(&rays, &mut hits, &mut batch);
    for (ray, hit) in rays.iter().zip(&hits) {
        assert_eq!(forward.trace(ray, &mut alone), *hit);
        let mut back = backward.trace(ray, &mut TraceCounts::default());
        if back.is_hit() {
            back.instance = n - 1 - back.instance;
        }
        assert_eq!(back.t, hit.t);
    }
    assert_eq!(alone.rays, batch.rays);
}

/// Ribbons of one micropolygon and of two, and of parts of two with one left, along u and along v.
fn parts(keys: &[f32]) -> DicedMesh {
    const RATES: [(u16, u16); 8] = [
        (1, 1),
        (1, 2),
        (2, 1),
        (1, 3),
        (1, 9),
        (7, 1),
        (16, 1),
        (1, 16),
    ];
    let mut rng = Rng(41);
    let who: Vec<_> = (0..400)
        .map(|_| {
            (
                rng.cube(),
                rng.direction() * 0.6,
                rng.direction() * 0.1,
                rng.cube() * 0.2,
            )
        })
        .collect();
    let rates: Vec<_> = RATES.into_iter().cycle().take(who.len()).collect();
    mesh(&rates, keys, |g, u, v, t| {
        let (at, along, across, by) = who[g];
        let (u, v) = if rates[g].0 > rates[g].1 {
            (v, u)
        } else {
            (u, v)
        };
        at + along * v + across * (u + v * v) + by * (t + t * t)
    })
}

#[test]
fn instruction_sets_and_packets_give_the_same_hits() {
    // Packets that hold together, and packets of rays that have nothing to do with each other.
    let worlds = [
        few_movers(5),
        world_of(sheet(6, 16, &keys(1))),
        world_of(sheet(6, 16, &keys(2))),
        world_of(patches(60, 8, &keys(3), 5)),
        world_of(fur(300, &keys(2), 6)),
        world_of(combed(300, 0.01, &keys(2), 6)),
        world_of(thin(300, &keys(1), 6)),
        world_of(thin(300, &keys(2), 6)),
        world_of(parts(&keys(1))),
        world_of(parts(&keys(3))),
        World::build(
            (0..5u32)
                .map(|i| {
                    let transform = spinning(2, 0.5, DVec3::ONE, DVec3::X * f64::from(i) * 0.4);
                    instance(&object(patches(8, 5, &keys(2), i.into())), transform)
                })
                .collect(),
            DVec3::ZERO,
        ),
    ];
    let mut rng = Rng(77);
    let mut coherent = Vec::new();
    for _ in 0..40 {
        let (eye, time) = (Vec3::new(rng.signed(), rng.signed(), 3.0), rng.unit());
        let target = rng.cube() * 0.8;
        for lane in 0..64 {
            let aside = Vec3::new((lane % 8) as f32, (lane / 8) as f32, 0.0) * 0.01;
            let dir = target + aside - eye;
            coherent.push(ray(eye, dir, time + 0.02 * rng.unit()));
        }
    }
    let mixed: Vec<Ray> = (0..331)
        .map(|_| random_ray(&mut rng, Vec3::ZERO, 1.5))
        .collect();
    for (w, world) in worlds.iter().enumerate() {
        let scalar = world.clone().with_level(Level::SCALAR);
        for rays in [&coherent, &mixed] {
            let expected: Vec<Hit> = rays
                .iter()
                .map(|ray| scalar.trace(ray, &mut TraceCounts::default()))
                .collect();
            assert!(expected.iter().any(Hit::is_hit));
            for level in Level::available() {
                let world = world.clone().with_level(level);
                let mut hits = vec![Hit::MISS; rays.len()];
                let mut counts = TraceCounts::default();
                world.trace_many(rays, &mut hits, &mut counts);
                let mut found = vec![false; rays.len()];
                world.occluded_many(rays, &mut found, &mut TraceCounts::default());
                assert!(
                    found
                        .iter()
                        .eq(expected.iter().map(Hit::is_hit).collect::<Vec<_>>().iter())
                );
                for (i, ray) in rays.iter().enumerate() {
                    let alone = world.trace(ray, &mut TraceCounts::default());
                    assert_eq!(alone, expected[i], "{w} {} {ray:?}", level.name());
                    assert_eq!(hits[i], expected[i], "{w} {} {ray:?}", level.name());
                }
                assert_eq!(counts.rays, rays.len() as u64);
                assert!(counts.node_tests > 0 && counts.cell_tests > 0);
                // In packets as they lie: together, they may have an order of their own.
                let mut packets = TraceCounts::default();
                let mut each = vec![TraceCounts::default(); rays.len()];
                for (rays, each) in rays.chunks(PACKET).zip(each.chunks_mut(PACKET)) {
                    let mut hits = vec![Hit::MISS; rays.len()];
                    world.trace_packet(rays, &mut hits, each);
                    world.trace_many(rays, &mut hits, &mut packets);
                }
                let sum = each.into_iter().reduce(|a, b| a + b);
                assert_eq!(sum, Some(packets), "what each cost, and all");
                if std::ptr::eq(rays, &raw const coherent) {
                    assert_eq!(counts, packets, "they stay as they lie");
                }
            }
        }
    }
}

/// Where a packet does not fill vectors, what is in their other lanes must not count: here these hold the first ray, which sees the
/// vertices of another segment of keys than the rest of its packet, or along other axes.
#[test]
fn the_first_ray_of_a_packet_is_not_asked_for_others() {
    let worlds = [
        world_of(fur(3000, &keys(3), 6)),
        world_of(combed(3000, 0.01, &keys(3), 6)),
    ];
    let mut rng = Rng(78);
    for world in &worlds {
        let mut found = 0;
        for packet in 0..600 {
            let (eye, late) = (Vec3::new(rng.signed(), rng.signed(), 3.0), packet % 2 == 0);
            let target = Vec3::new(rng.signed(), rng.signed(), 0.1 * rng.unit()) * 0.8;
            let mut rays = Vec::with_capacity(PACKET);
            for lane in 0..PACKET {
                let aside = Vec3::new((lane % 8) as f32, (lane / 8) as f32, 0.0) * 0.004;
                let time = 0.45 * rng.unit() + if late { 0.55 } else { 0.0 };
                rays.push(ray(eye, target + aside - eye, time));
            }
            let dir = rays[PACKET / 2].dir;
            rays[0] = match packet / 2 % 2 {
                0 => ray(eye, dir, if late { 0.2 } else { 0.8 }),
                _ => ray(target - 3.0 * Vec3::X, Vec3::X + 0.01 * rng.cube(), 0.5),
            };
            let mut hits = vec![Hit::MISS; PACKET];
            world.trace_many(&rays, &mut hits, &mut TraceCounts::default());
            for (ray, hit) in rays.iter().zip(&hits) {
                let alone = world.trace(ray, &mut TraceCounts::default());
                assert_eq!(alone, *hit, "{ray:?}");
            }
            found += hits.iter().filter(|hit| hit.is_hit()).count();
        }
        assert!(found > 100 * PACKET, "{found}");
    }
}

#[test]
fn t_range_is_inclusive() {
    let world = world_of(mesh(&[(4, 4)], &[0.0], |_, u, v, _| Vec3::new(u, v, 0.0)));
    let mut counts = TraceCounts::default();
    let mut r = ray(Vec3::new(0.3, 0.4, 1.0), -Vec3::Z, 0.5);
    for (t_min, t_max, want) in [
        (1.0, 1.0, true),
        (0.0, 1.0, true),
        (1.0, 2.0, true),
        (0.0, 1.0f32.next_down(), false),
        (1.0f32.next_up(), 9.0, false),
        (2.0, 0.0, false),
        (f32::NAN, 2.0, false),
        (0.0, f32::NAN, false),
        (-5.0, f32::INFINITY, true),
    ] {
        (r.t_min, r.t_max) = (t_min, t_max);
        assert_eq!(
            world.trace(&r, &mut counts).is_hit(),
            want,
            "{t_min} {t_max}"
        );
        assert_eq!(world.occluded(&r, &mut counts), want);
    }
    // Behind the origin, when asked for.
    let mut r = ray(Vec3::new(0.3, 0.4, 1.0), Vec3::Z, 0.5);
    r.t_min = -3.0;
    assert_eq!(world.trace(&r, &mut counts).t, -1.0);
}

#[test]
fn bad_rays_miss() {
    let world = all_kinds(DVec3::ZERO, DVec3::ZERO, 2);
    let mut counts = TraceCounts::default();
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
        for axis in 0..3 {
            let mut v = Vec3::ONE;
            v[axis] = bad;
            assert!(!world.trace(&ray(v, -Vec3::ONE, 0.5), &mut counts).is_hit());
            assert!(!world.trace(&ray(Vec3::ONE, v, 0.5), &mut counts).is_hit());
        }
    }
    assert!(
        !world
            .trace(&ray(Vec3::ONE, Vec3::ZERO, 0.5), &mut counts)
            .is_hit()
    );
    // Times are clamped.
    let at = |time| {
        world.trace(
            &ray(Vec3::new(0.1, 0.2, 5.0), -Vec3::Z, time),
            &mut TraceCounts::default(),
        )
    };
    assert_eq!(at(-3.0), at(0.0));
    assert_eq!(at(7.0), at(1.0));
    assert!(at(0.0).is_hit() && !at(f32::NAN).is_hit());
}

#[test]
fn empty_and_broken_input_misses() {
    let mut counts = TraceCounts::default();
    let r = ray(Vec3::Z * 3.0, -Vec3::Z, 0.5);
    assert!(
        !World::build(Vec::new(), DVec3::ZERO)
            .trace(&r, &mut counts)
            .is_hit()
    );
    assert!(
        !world_of(DicedMesh::default())
            .trace(&r, &mut counts)
            .is_hit()
    );
    let mut bad = sheet(2, 4, &keys(2));
    bad.positions[3] = Vec3::NAN;
    let o = object(bad);
    assert_eq!(o.stats().dropped_grids, 1);
    let mut short = sheet(1, 4, &keys(2));
    short.positions.truncate(10);
    assert_eq!(object(short).stats().dropped_grids, 1);
    let nan = DVec3::splat(f64::NAN);
    let flat = affine(DVec3::X, 0.3, DVec3::new(1.0, 0.0, 1.0), DVec3::ZERO);
    let through_zero = InstanceTransform::Moving {
        key_times: vec![0.0, 1.0],
        matrices: vec![
            affine(DVec3::X, 0.0, DVec3::ONE, DVec3::ZERO),
            affine(DVec3::X, 0.0, -DVec3::ONE, DVec3::ZERO),
        ],
    };
    let unequal = InstanceTransform::Moving {
        key_times: vec![0.0, 1.0],
        matrices: vec![],
    };
    let list = vec![
        instance(&o, InstanceTransform::Translation(nan)),
        instance(&o, InstanceTransform::Static(flat)),
        instance(&o, through_zero),
        instance(&o, unequal),
    ];
    let world = World::build(list, DVec3::ZERO);
    assert_eq!(world.stats().left_out, 3);
    // Singular at 1/2: nothing panics.
    assert!(!world.trace(&r, &mut counts).is_hit());
}

#[test]
fn a_world_that_nobody_wants_any_more_is_not_built() {
    let sheet = object(sheet(1, 2, &keys(1)));
    let set = |cancelled: bool| {
        let shift = |i: i32| Shift::new(DVec3::X * f64::from(i), DVec3::ZERO, i);
        let set = InstanceSet::translated(Arc::clone(&sheet), (0..20_000).map(shift).collect());
        let set = WorldSet {
            set: Arc::new(set),
            user: 0,
            culled: None,
        };
        World::new(vec![set], DVec3::ZERO, &AtomicBool::new(cancelled))
    };
    assert_eq!(set(true).err(), Some(WorldError::Cancelled));
    assert_eq!(set(false).map(|world| world.instance_count()), Ok(20_000));
}

/// From so far that distances are multiples of 1/32, rays meet both triangles of a micropolygon at the same one, often.
#[test]
fn rays_in_packets_see_the_triangle_that_they_see_alone() {
    for across in [false, true] {
        let mut rng = Rng(5);
        let who: Vec<_> = (0..100)
            .map(|_| {
                let off: [Vec3; 18] = std::array::from_fn(|_| rng.cube() * 0.02);
                (rng.cube(), rng.direction(), rng.direction(), off)
            })
            .collect();
        let rates = if across { (8, 1) } else { (1, 8) };
        let strands = mesh(&[rates; 100], &[0.0], |g, u, v, _| {
            let (u, v) = if across { (v, u) } else { (u, v) };
            let (from, along, side, off) = &who[g];
            let off = off[2 * (8.0 * v).round() as usize + u.round() as usize];
            *from + *along * v + *side * (0.02 * (u - 0.5)) + off
        });
        let world = world_of(strands.clone());
        let mut hits = 0;
        for _ in 0..100 {
            let rays: Vec<Ray> = (0..PACKET)
                .map(|_| {
                    let (g, j, dir) = (rng.below(100), rng.below(8), rng.direction());
                    let p = strands.grid_positions(g, 0);
                    let target = match across {
                        true => (p[j] + p[j + 1] + p[9 + j]) / 3.0,
                        false => (p[2 * j] + p[2 * j + 1] + p[2 * j + 2]) / 3.0,
                    };
                    ray(target - dir * 3e5, dir, 0.0)
                })
                .collect();
            let mut found = vec![Hit::MISS; PACKET];
            world.trace_many(&rays, &mut found, &mut TraceCounts::default());
            for (ray, hit) in rays.iter().zip(&found) {
                let alone = world.trace(ray, &mut TraceCounts::default());
                assert_eq!(*hit, alone, "{ray:?}");
                hits += usize::from(hit.is_hit());
            }
        }
        assert!(hits > 500, "{hits}");
    }
}
