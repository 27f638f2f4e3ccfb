//! No ray leaves a closed surface: shared vertices and edges, random and aimed rays, at random times.

mod trace_scenes;

use glam::{DVec3, Vec3};
use hdtrapeze_core::grid::{lerp_position, locate_key};
use hdtrapeze_core::trace::{InstanceTransform, TraceCounts, World};
use rayon::prelude::*;
use trace_scenes::*;

/// Traces `count` rays from `origins` and returns the first that leaves, if any.
fn leak(
    world: &World,
    count: u64,
    seed: u64,
    inside: impl Fn(&mut Rng) -> Vec3 + Sync,
) -> Option<String> {
    (0..64u64).into_par_iter().find_map_first(|part| {
        let mut rng = Rng(seed * 1000 + part);
        let mut counts = TraceCounts::default();
        (0..count / 64).find_map(|_| {
            let ray = ray(
                inside(&mut rng),
                rng.direction() * (0.1 + rng.unit()),
                rng.unit(),
            );
            let hit = world.trace(&ray, &mut counts);
            (!hit.is_hit()).then(|| format!("{ray:?}"))
        })
    })
}

#[test]
fn a_million_rays_stay_inside_a_moving_sphere() {
    let world = world_of(sphere(3, 16, &keys(3)));
    assert_eq!(leak(&world, 1_000_000, 1, |rng| rng.cube() * 0.3), None);
}

#[test]
fn rays_stay_inside_static_and_instanced_shapes() {
    let still = world_of(sphere(2, 11, &keys(1)));
    assert_eq!(leak(&still, 200_000, 2, |rng| rng.cube() * 0.5), None);
    let box_ = world_of(closed(2, 7, &keys(2), |p, t| p * (1.0 + t)));
    assert_eq!(leak(&box_, 200_000, 3, |rng| rng.cube() * 0.9), None);
    // Oriented bounds: a thin closed slab, tilted.
    let tilt = glam::Quat::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let slab = world_of(closed(1, 16, &keys(2), move |p, t| {
        tilt * (p * Vec3::new(1.0, 0.01, 0.1)) + Vec3::X * t
    }));
    assert!(slab.stats().object.oriented_blocks > 0);
    let inside = move |rng: &mut Rng| (tilt * (rng.cube() * Vec3::new(0.9, 0.005, 0.05))) + Vec3::X;
    let at_end = |world: &World| {
        let mut rng = Rng(9);
        let mut counts = TraceCounts::default();
        (0..100_000).all(|_| {
            let ray = ray(inside(&mut rng), rng.direction(), 1.0);
            world.trace(&ray, &mut counts).is_hit()
        })
    };
    assert!(at_end(&slab));
    let o = object(sphere(2, 8, &keys(2)));
    let key_times = keys(3);
    let matrices = key_times
        .iter()
        .map(|&t| {
            affine(
                DVec3::new(0.3, 1.0, 0.2),
                f64::from(t),
                DVec3::new(-3.0, 0.7, 1.5),
                DVec3::splat(20.0),
            )
        })
        .collect();
    let turning = World::build(
        vec![instance(
            &o,
            InstanceTransform::Moving {
                key_times,
                matrices,
            },
        )],
        DVec3::ZERO,
    );
    assert_eq!(
        leak(&turning, 200_000, 4, |rng| Vec3::splat(20.0)
            + rng.cube() * 0.1),
        None
    );
}

#[test]
fn rays_at_shared_vertices_and_edges_stay_inside() {
    for k in [1, 2, 4] {
        let mesh = sphere(2, 6, &keys(k));
        let world = world_of(mesh.clone());
        let mut rng = Rng(10);
        let mut counts = TraceCounts::default();
        for _ in 0..60_000 {
            let g = rng.below(mesh.grids.len());
            let time = if rng.below(4) == 0 {
                mesh.key_times[rng.below(k)]
            } else {
                rng.unit()
            };
            let (key, f) = locate_key(&mesh.key_times, time);
            let at = |i: usize| {
                let a = mesh.grid_positions(g, key)[i];
                if k > 1 {
                    lerp_position(a, mesh.grid_positions(g, key + 1)[i], f)
                } else {
                    a
                }
            };
            // A vertex, or a point on a lattice edge or diagonal.
            let stride = 7;
            let (i, j) = (rng.below(6), rng.below(6));
            let (a, step) = (j * stride + i, [1, stride, stride + 1][rng.below(3)]);
            let s = [0.0, 0.5, 1.0, rng.unit()][rng.below(4)];
            let target = at(a) + (at(a + step) - at(a)) * s;
            let origin = [
                Vec3::ZERO,
                Vec3::new(0.25, -0.125, 0.0625),
                rng.cube() * 0.3,
            ][rng.below(3)];
            let ray = ray(origin, target - origin, time);
            let hit = world.trace(&ray, &mut counts);
            assert!(hit.is_hit(), "{k} {ray:?}");
            assert!(hit.t < 1.0 + 1e-4, "{k} {ray:?} {hit:?}");
        }
    }
}

#[test]
fn exact_edges_of_a_lattice_are_hit_once_and_the_first_wins() {
    // Coordinates, origins and directions without any rounding: edge functions are exactly 0.
    let world = world_of(closed(2, 4, &keys(1), |p, _| p * 4.0));
    let mut counts = TraceCounts::default();
    for x in -16..=16 {
        for y in -16..=16 {
            let target = Vec3::new(x as f32, y as f32, 16.0) * 0.25;
            for dir in [
                target,
                Vec3::new(target.x, 4.0, target.y),
                Vec3::new(-4.0, target.x, target.y),
            ] {
                let ray = ray(Vec3::ZERO, dir, 0.3);
                let hit = world.trace(&ray, &mut counts);
                assert!(hit.is_hit(), "{dir}");
                // The plane is exact, so t is; no other cell at this t comes before the answer.
                assert_eq!(hit.t, 1.0);
                let oracle = hdtrapeze_core::trace::brute::crossings(&world, &ray);
                let first = oracle
                    .iter()
                    .filter(|c| c.t > 0.0 && c.inside >= -1e-9)
                    .map(|c| (c.grid, c.cell))
                    .min();
                assert_eq!(first, Some((hit.grid, hit.cell)), "{dir}");
            }
        }
    }
}

#[test]
fn axis_rays_and_tiny_components_are_tight() {
    let world = world_of(sphere(2, 9, &keys(2)));
    let mut counts = TraceCounts::default();
    let tiny = [0.0, -0.0, 1e-45, -1e-45, 1e-38, 1e-20, -1e-8];
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            for a in tiny {
                for b in tiny {
                    for scale in [1.0, 1e-15, 1e15] {
                        let mut d = Vec3::new(a, a, a);
                        d[(axis + 1) % 3] = b;
                        d[axis] = sign;
                        let ray = ray(Vec3::ZERO, d * scale, 0.4);
                        assert!(world.trace(&ray, &mut counts).is_hit(), "{ray:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn far_origins_reach_the_sphere() {
    // Aimed at the middle from far away: padded slabs must not cull, whatever was rounded.
    let world = world_of(sphere(2, 9, &keys(2)));
    let mut rng = Rng(12);
    let mut counts = TraceCounts::default();
    for _ in 0..20_000 {
        let distance = 10f32.powf(rng.unit() * 5.0);
        let origin = rng.direction() * distance;
        let ray = ray(
            origin,
            (rng.cube() * 0.2 - origin) * rng.unit().max(1e-3),
            rng.unit(),
        );
        assert!(world.trace(&ray, &mut counts).is_hit(), "{ray:?}");
    }
}
