//! Geometry and rays that nobody should ask for: degenerate grids, directions with nothing in some components, numbers
//! that are not finite, times outside the shutter, and far too much of the same. Each ray is asked in every way (alone,
//! for any hit, in a packet with good ones, among many) with every instruction set, and all answers agree.

mod trace_scenes;

use glam::{DVec3, Vec3};
use hdtrapeze_core::bvh::object::Blas;
use hdtrapeze_core::bvh::{ObjectGeometry, StaticSlabs, Tree};
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::packet::PACKET;
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World, brute};
use hdtrapeze_simd::Level;
use trace_scenes::*;

/// What each ray hits, asked in every way.
fn answers(world: &World, rays: &[Ray]) -> Vec<Hit> {
    let none = TraceCounts::default();
    let trace = |world: &World, ray: &Ray| world.trace(ray, &mut none.clone());
    let expected: Vec<Hit> = rays.iter().map(|ray| trace(world, ray)).collect();
    for level in Level::available() {
        let world = world.clone().with_level(level);
        let mut many = vec![Hit::MISS; rays.len()];
        world.trace_many(rays, &mut many, &mut none.clone());
        let mut some = vec![false; rays.len()];
        world.occluded_many(rays, &mut some, &mut none.clone());
        for (i, (ray, want)) in rays.iter().zip(&expected).enumerate() {
            let told = || format!("{} {ray:?}", level.name());
            assert_eq!(trace(&world, ray), *want, "alone {}", told());
            assert_eq!(many[i], *want, "of many {}", told());
            assert_eq!(some[i], want.is_hit(), "any of many {}", told());
            let any = world.occluded(ray, &mut none.clone());
            assert_eq!(any, want.is_hit(), "any {}", told());
            // Among copies of another ray: in one packet of sixteen, and in some full ones.
            for size in if i % 8 == 1 { &[16, PACKET][..] } else { &[16] } {
                let size = *size;
                let mut packet = vec![rays[0]; size];
                packet[i % size] = *ray;
                let mut hits = vec![Hit::MISS; size];
                world.trace_packet(&packet, &mut hits, &mut vec![none; size]);
                for (lane, hit) in hits.iter().enumerate() {
                    let want = if lane == i % size { want } else { &expected[0] };
                    assert_eq!(hit, want, "lane {lane} {}", told());
                }
            }
        }
    }
    expected
}

/// Rays from all sides at points of [-1, 1]^3, some along axes.
fn cloud(seed: u64, count: usize) -> Vec<Ray> {
    let mut rng = Rng(seed);
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
    (0..count)
        .map(|i| {
            let target = (rng.cube() * 4.0).round() * 0.25;
            let dir = match i % 3 {
                0 => axes[rng.below(6)],
                _ => rng.direction(),
            };
            ray(target - dir * 3.0, dir, rng.unit())
        })
        .collect()
}

#[test]
fn grids_without_area_are_hit_by_no_ray_that_passes_them() {
    let points: [&dyn Fn(f32, f32, f32) -> Vec3; 6] = [
        &|_, _, _| Vec3::ZERO,
        &|_, _, t| Vec3::splat(0.25 * t),
        &|u, _, _| Vec3::new(u, 0.0, 0.0),
        &|u, v, t| Vec3::new(u + v, 2.0 * (u + v), t) * 0.25,
        // An area at no time but the ends', or not even there.
        &|u, v, t| Vec3::new(u, if t == 0.5 { 0.0 } else { v * 1e-45 }, 0.0),
        &|u, _, t| Vec3::new(u, t, 0.0),
    ];
    for (shape, at) in points.iter().enumerate() {
        for keys in [keys(1), keys(2), keys(3)] {
            for rates in [(1, 1), (16, 16), (1, 16), (5, 3)] {
                let world = world_of(mesh(&[rates; 3], &keys, |_, u, v, t| at(u, v, t)));
                let rays = cloud(1, 48);
                for (ray, hit) in rays.iter().zip(answers(&world, &rays)) {
                    // A point has no area, however it is rounded. A line that leans may have one, of an ulp.
                    assert!(
                        !hit.is_hit() || shape > 1,
                        "{shape} {rates:?} {ray:?} {hit:?}"
                    );
                    let on_it = brute::verify(&world, ray, None, &hit);
                    on_it.unwrap_or_else(|e| panic!("{shape} {rates:?} {ray:?}: {e}"));
                }
            }
        }
    }
}

#[test]
fn degenerate_grids_leave_their_neighbours_alone() {
    // Good grids among points, lines, and grids of which one key, or one coordinate, is not finite.
    for k in [1, 2, 3] {
        let good = sheet(2, 8, &keys(k));
        let n = good.grids[0].vertex_count();
        let mut mixed = DicedMesh {
            key_times: good.key_times.clone(),
            ..DicedMesh::default()
        };
        for g in 0..12 {
            let mut grid = good.grids[g / 3];
            grid.first_vertex = mixed.vertex_count as u32;
            for key in 0..k {
                for (i, &p) in good.grid_positions(g / 3, key).iter().enumerate() {
                    mixed.positions.push(match (g % 3, g / 3) {
                        (0, _) => p,
                        (1, 0) => Vec3::ZERO,
                        (1, 1) => Vec3::splat(p.x),
                        // The last key alone; a single coordinate; infinity; absurdly far.
                        (1, _) if key == k - 1 => Vec3::NAN,
                        (2, 0) if i == 7 => Vec3::new(p.x, f32::NAN, p.z),
                        (2, 1) if i == n - 1 && key == 0 => Vec3::new(f32::INFINITY, 0.0, 0.0),
                        (2, 2) if i == 0 => Vec3::splat(1e30),
                        (2, _) if i == 40 => Vec3::splat(f32::NEG_INFINITY),
                        _ => p,
                    });
                }
            }
            mixed.vertex_count += n;
            mixed.grids.push(grid);
        }
        let mixed = object(mixed);
        assert_eq!(mixed.stats().dropped_grids, 6, "{k}");
        let place = InstanceTransform::Translation(DVec3::ZERO);
        let mixed = World::build(vec![instance(&mixed, place)], DVec3::ZERO);
        let rays = cloud(2, 160);
        let clean = answers(&world_of(good), &rays);
        assert!(clean.iter().filter(|h| h.is_hit()).count() > 40);
        for (mut want, hit) in clean.into_iter().zip(answers(&mixed, &rays)) {
            want.grid *= if want.is_hit() { 3 } else { 1 };
            assert_eq!(hit, want);
        }
    }
}

#[test]
fn grids_of_rates_that_are_not_allowed_leave_their_neighbours_alone() {
    // What comes before each good grid: rates, and whether their vertices are there.
    let bad = [
        ((8, 17), true),
        ((17, 8), false),
        ((0, 5), true),
        ((u16::MAX, u16::MAX), false),
    ];
    for k in [1, 2] {
        let good = sheet(2, 8, &keys(k));
        let mut mixed = DicedMesh {
            key_times: good.key_times.clone(),
            ..DicedMesh::default()
        };
        for (g, ((nu, nv), there)) in bad.into_iter().enumerate() {
            let mut grid = good.grids[g];
            (grid.nu, grid.nv) = (nu, nv);
            grid.first_vertex = mixed.vertex_count as u32;
            mixed.grids.push(grid);
            if there {
                mixed.vertex_count += grid.vertex_count();
                mixed.positions.resize(mixed.vertex_count * k, Vec3::ONE);
            }
            let mut grid = good.grids[g];
            grid.first_vertex = mixed.vertex_count as u32;
            mixed.grids.push(grid);
            mixed.vertex_count += grid.vertex_count();
            let positions = (0..k).flat_map(|key| good.grid_positions(g, key));
            mixed.positions.extend(positions);
        }
        let mixed = object(mixed);
        assert_eq!(mixed.stats().dropped_grids, 4, "{k}");
        let place = InstanceTransform::Translation(DVec3::ZERO);
        let mixed = World::build(vec![instance(&mixed, place)], DVec3::ZERO);
        let rays = cloud(5, 96);
        let clean = answers(&world_of(good), &rays);
        assert!(clean.iter().filter(|h| h.is_hit()).count() > 20);
        for (mut want, hit) in clean.into_iter().zip(answers(&mixed, &rays)) {
            want.grid = if want.is_hit() {
                2 * want.grid + 1
            } else {
                want.grid
            };
            assert_eq!(hit, want);
        }
    }
}

#[test]
fn directions_may_have_next_to_nothing_in_a_component() {
    let tiny = [0.0, -0.0, 1e-45, -1e-45, f32::MIN_POSITIVE, -1e-20];
    for k in [1, 2] {
        for m in [
            sheet(3, 9, &keys(k)),
            patches(20, 7, &keys(k), 3),
            combed(60, 0.05, &keys(k), 4),
        ] {
            let object = object(m);
            // Under a matrix too.
            let m = affine(DVec3::ONE, 0.7, DVec3::new(1.0, -0.8, 1.2), DVec3::X);
            let places = [
                InstanceTransform::Translation(DVec3::ZERO),
                InstanceTransform::Static(m),
            ];
            let world = World::build(places.map(|p| instance(&object, p)).into(), DVec3::ZERO);
            let mut rng = Rng(3);
            let rays: Vec<Ray> = (0..120)
                .map(|i| {
                    // Along an axis, or in a plane of two.
                    let mut dir = Vec3::from_array([0; 3].map(|_| tiny[rng.below(6)]));
                    dir[i % 3] = if i % 2 == 0 { 1.0 } else { -1.0 };
                    if i % 5 == 0 {
                        dir[(i + 1) % 3] = rng.signed();
                    }
                    ray(rng.cube() - dir * 4.0, dir, rng.unit())
                })
                .collect();
            let hits = answers(&world, &rays);
            assert!(hits.iter().any(Hit::is_hit));
            for (ray, hit) in rays.iter().zip(&hits) {
                brute::verify(&world, ray, None, hit).unwrap_or_else(|e| panic!("{ray:?}: {e}"));
            }
        }
    }
}

#[test]
fn rays_that_are_not_numbers_miss() {
    let object = object(sheet(3, 9, &keys(2)));
    let spin = |t: f64| affine(DVec3::Z, t, DVec3::ONE, DVec3::ZERO);
    let moving = InstanceTransform::Moving {
        key_times: vec![0.0, 1.0],
        matrices: vec![spin(0.0), spin(0.3)],
    };
    for place in [
        InstanceTransform::Translation(DVec3::ZERO),
        InstanceTransform::Static(spin(0.4)),
        moving,
    ] {
        let world = World::build(vec![instance(&object, place)], DVec3::ZERO);
        let good = ray(Vec3::new(0.1, 0.2, 5.0), -Vec3::Z, 0.5);
        let mut rays = vec![good];
        let far = 2f32.powi(60);
        for bad in [f32::NAN, f32::INFINITY, -f32::INFINITY, far, 1e30, -1e38] {
            for axis in 0..3 {
                let (mut origin, mut dir) = (good, good);
                origin.origin[axis] = bad;
                dir.dir[axis] = bad;
                rays.extend([origin, dir]);
            }
        }
        // All of a direction below what counts as one.
        rays.extend([0.0, -0.0, 1e-45, 1e-38, 1e-30, 0.5 / far].map(|s| Ray {
            dir: -Vec3::Z * s,
            ..good
        }));
        rays.extend([
            Ray {
                time: f32::NAN,
                ..good
            },
            Ray {
                t_min: f32::NAN,
                ..good
            },
            Ray {
                t_max: f32::NAN,
                ..good
            },
            Ray {
                t_min: 2.0,
                t_max: 1.0,
                ..good
            },
            Ray {
                t_min: f32::INFINITY,
                ..good
            },
            Ray {
                t_max: f32::NEG_INFINITY,
                ..good
            },
        ]);
        let hits = answers(&world, &rays);
        assert!(hits[0].is_hit());
        for (ray, hit) in rays.iter().zip(&hits).skip(1) {
            assert_eq!(*hit, Hit::MISS, "{ray:?}");
        }
    }
}

#[test]
fn times_outside_the_shutter_are_its_ends() {
    for k in [1, 2, 4] {
        let world = world_of(patches(30, 6, &keys(k), 9));
        let rays = cloud(4, 96);
        let at = |time: f32| {
            let rays: Vec<Ray> = rays.iter().map(|r| Ray { time, ..*r }).collect();
            answers(&world, &rays)
        };
        let (open, close) = (at(0.0), at(1.0));
        assert!(open.iter().any(Hit::is_hit) && (k == 1 || open != close));
        for time in [-0.0, -1e-45, -3.0, f32::NEG_INFINITY, 1e-45] {
            assert!(time > 0.0 || at(time) == open, "{time}");
        }
        for time in [1.0f32.next_up(), 7.0, f32::MAX, f32::INFINITY] {
            assert_eq!(at(time), close, "{time}");
        }
    }
}

/// `count` copies of a grid.
fn pile(count: usize, rate: (u16, u16), keys: &[f32]) -> DicedMesh {
    mesh(&vec![rate; count], keys, |_, u, v, t| {
        Vec3::new(u, v, 0.1 * t)
    })
}

#[test]
fn piles_of_equal_grids_take_linear_memory_and_nodes() {
    for (rate, keys) in [((1, 1), keys(1)), ((3, 2), keys(2)), ((1, 16), keys(1))] {
        let of = |count: usize| *ObjectGeometry::new(pile(count, rate, &keys)).stats();
        let (few, many) = (of(4_000), of(32_000));
        for (what, few, many) in [
            ("nodes", few.nodes, many.nodes),
            ("bytes", few.bvh_bytes, many.bvh_bytes),
        ] {
            assert!(many <= 9 * few, "{what}: {few} {many}");
        }
    }
}

/// Nodes from the root of a tree to its deepest one.
fn depth(tree: &Tree<StaticSlabs>) -> usize {
    let mut deepest = 0;
    let mut open = vec![(tree.root, 1)];
    while let Some((node, depth)) = open.pop() {
        deepest = deepest.max(depth);
        let node = &tree.nodes[node as usize];
        let children = (0..8).filter(|child| node.slots >> child & 1 == 1);
        let children = children.map(|child| node.children[child]);
        let inner = children.filter(|child| child & Tree::<StaticSlabs>::LEAF == 0);
        open.extend(inner.map(|child| (child, depth + 1)));
    }
    deepest
}

#[test]
fn a_million_equal_grids_make_a_tree_that_is_not_deep() {
    const COUNT: usize = 1_000_000;
    let object = object(pile(COUNT, (1, 1), &keys(1)));
    let stats = *object.stats();
    assert_eq!((stats.cells, stats.dropped_grids), (COUNT as u64, 0));
    // Full nodes would be a seventh.
    assert!(stats.nodes <= COUNT as u64 / 3, "{stats:?}");
    assert!(stats.bvh_bytes <= 64 * COUNT as u64, "{stats:?}");
    let Blas::Static(tree) = object.blas() else {
        panic!("a tree that does not move");
    };
    // The binary logarithm is 20, of which a node takes 3.
    assert!(depth(&tree.tree) <= 8, "{}", depth(&tree.tree));
    let place = InstanceTransform::Translation(DVec3::ZERO);
    let world = World::build(vec![instance(&object, place)], DVec3::ZERO);
    let into = ray(Vec3::new(0.3, 0.6, 2.0), -Vec3::Z, 0.5);
    let beside = ray(Vec3::new(1.3, 0.6, 2.0), -Vec3::Z, 0.5);
    for level in Level::available() {
        let world = world.clone().with_level(level);
        let mut counts = TraceCounts::default();
        assert!(world.occluded(&into, &mut counts));
        assert!(
            counts.cell_tests <= 8 && counts.node_tests < 16,
            "{counts:?}"
        );
        let mut counts = TraceCounts::default();
        assert!(!world.trace(&beside, &mut counts).is_hit());
        assert!(!world.occluded(&beside, &mut counts));
        assert!(
            counts.cell_tests == 0 && counts.node_tests <= 2,
            "{counts:?}"
        );
    }
}

#[test]
fn rays_through_a_pile_ask_each_grid_once_and_rays_beside_it_none() {
    for (rate, keys) in [((1, 1), keys(1)), ((1, 1), keys(2)), ((8, 8), keys(2))] {
        let count = 5000;
        let world = world_of(pile(count, rate, &keys));
        let into = ray(Vec3::new(0.3, 0.6, 2.0), -Vec3::Z, 0.5);
        let beside = ray(Vec3::new(1.3, 0.6, 2.0), -Vec3::Z, 0.5);
        let hits = answers(&world, &[into, beside]);
        assert!(hits[0].is_hit() && hits[0].grid == 0 && !hits[1].is_hit());
        let mut counts = TraceCounts::default();
        world.trace(&into, &mut counts);
        // One group of each grid.
        assert!(counts.cell_tests <= 8 * count as u64, "{counts:?}");
        assert!(counts.node_tests <= 2 * count as u64, "{counts:?}");
        let mut counts = TraceCounts::default();
        assert!(world.occluded(&into, &mut counts));
        assert!(
            counts.cell_tests <= 8 && counts.node_tests < 12,
            "{counts:?}"
        );
        let mut counts = TraceCounts::default();
        world.trace(&beside, &mut counts);
        assert!(
            counts.cell_tests == 0 && counts.node_tests <= 1,
            "{counts:?}"
        );
        // All of them in order, as far as one cares.
        let mut hit = hits[0];
        for grid in 1..20 {
            hit = world.trace_after(&into, &hit, &mut TraceCounts::default());
            assert_eq!((hit.t, hit.grid), (hits[0].t, grid));
        }
    }
}

#[test]
fn piles_of_equal_instances_answer_the_first() {
    let o = object(pile(1, (2, 2), &keys(2)));
    let place = InstanceTransform::Translation(DVec3::ZERO);
    let world = World::build(vec![instance(&o, place); 20_000], DVec3::ZERO);
    let into = ray(Vec3::new(0.3, 0.6, 2.0), -Vec3::Z, 0.5);
    let hits = answers(&world, &[into]);
    assert!(hits[0].is_hit() && hits[0].instance == 0);
    assert!(world.stats().top_nodes <= 20_000 / 6);
}
