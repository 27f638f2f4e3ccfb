//! What shading reads at a hit: positions, normals and channels, through every kind of transform.

mod trace_scenes;

use glam::{DVec3, Vec3};
use hdtrapeze_core::grid::octahedral;
use hdtrapeze_core::trace::{Hit, InstanceTransform, TraceCounts, World};
use trace_scenes::*;

fn trace(world: &World, origin: Vec3, dir: Vec3, time: f32) -> Hit {
    world.trace(&ray(origin, dir, time), &mut TraceCounts::default())
}

#[test]
fn vertices_positions_and_channels_agree_with_u_and_v() {
    // A flat grid: x = u, y = v, channel = vertex number, which is linear in both.
    let mut m = mesh(&[(1, 1), (5, 3)], &[0.0, 1.0], |g, u, v, t| {
        Vec3::new(u * 5.0, v * 3.0, g as f32 * 4.0 + t)
    });
    dress(&mut m, Vec3::Z);
    let o = object(m);
    let by = DVec3::new(10.0, 0.0, 0.0);
    let world = World::build(
        vec![instance(&o, InstanceTransform::Translation(by))],
        DVec3::ZERO,
    );
    let mut rng = Rng(1);
    for _ in 0..500 {
        let (x, y, time) = (rng.unit() * 5.0, rng.unit() * 3.0, rng.unit());
        let hit = trace(&world, Vec3::new(10.0 + x, y, 9.0), -Vec3::Z, time);
        assert_eq!(hit.grid, 1);
        let (i, j) = (x.floor(), y.floor());
        assert_eq!(hit.cell, (j * 5.0 + i) as u32);
        assert!(
            (hit.u - (x - i)).abs() < 1e-5 && (hit.v - (y - j)).abs() < 1e-5,
            "{hit:?}"
        );
        let p = world.position(&hit, time).expect("a hit");
        assert!((p - Vec3::new(10.0 + x, y, 4.0 + time)).length() < 1e-5);
        let later = world.position(&hit, 1.0).expect("a hit");
        assert!((later - Vec3::new(10.0 + x, y, 5.0)).length() < 1e-5);
        let corners = world.cell_vertices(&hit, 0.0).expect("a hit");
        assert_eq!(corners[0], Vec3::new(10.0 + i, j, 4.0));
        assert_eq!(corners[2], Vec3::new(11.0 + i, j + 1.0, 4.0));
        let mut value = [0.0; 3];
        assert_eq!(world.channel(&hit, 0, &mut value), Some(1));
        assert!((value[0] - (4.0 + x + 6.0 * y)).abs() < 1e-4);
        assert_eq!(world.channel(&hit, 1, &mut value), None);
        assert_eq!(world.element(&hit), Some(1));
        assert_eq!(world.user(&hit), Some(7));
        assert_eq!(world.geometric_normal(&hit, time), Some(Vec3::Z));
        let n = world.shading_normal(&hit, time).expect("a hit");
        assert!((n - Vec3::Z).length() < 1e-3);
    }
    assert_eq!(world.position(&Hit::MISS, 0.0), None);
    assert_eq!(world.shading_normal(&Hit::MISS, 0.0), None);
}

/// One of each kind.
fn places() -> [InstanceTransform; 3] {
    [
        InstanceTransform::Translation(DVec3::ZERO),
        InstanceTransform::Static(affine(
            DVec3::ONE,
            0.4,
            DVec3::new(-2.0, 0.5, 1.0),
            DVec3::ZERO,
        )),
        InstanceTransform::Moving {
            key_times: vec![0.0, 1.0],
            matrices: vec![
                affine(DVec3::X, 0.0, DVec3::new(1.0, -1.0, 1.0), DVec3::ZERO),
                affine(DVec3::X, 0.5, DVec3::new(2.0, -1.0, 3.0), DVec3::ZERO),
            ],
        },
    ]
}

#[test]
fn positions_at_both_ends_are_those_at_their_times() {
    let mut rng = Rng(3);
    for (n, place) in [1, 2, 3, 5]
        .into_iter()
        .flat_map(|n| places().map(|place| (n, place)))
    {
        let moves = matches!(place, InstanceTransform::Moving { .. });
        let m = closed(2, 12, &keys(n), |p, t| {
            p.normalize() * (1.0 + t * (t + 0.3 * p.x))
        });
        let world = World::build(vec![instance(&object(m), place)], DVec3::ZERO);
        for _ in 0..100 {
            let hit = trace(&world, Vec3::ZERO, rng.direction(), rng.unit());
            let at = |time: f32| world.position(&hit, time).expect("a hit");
            assert_eq!(world.end_positions(&hit), Some([at(0.0), at(1.0)]));
            assert_eq!(at(0.0) != at(1.0), n > 1 || moves);
        }
        assert_eq!(world.end_positions(&Hit::MISS), None);
    }
}

#[test]
fn normals_follow_transforms_outward() {
    // A sphere has its position as its normal; under any transform normals stay outward, and
    // perpendicular to the transformed surface.
    let mut m = closed(2, 12, &keys(1), |p, _| p.normalize());
    m.normal_key_count = 1;
    m.normals = m.positions.iter().map(|&p| octahedral::encode(p)).collect();
    // Cells of the faces of `closed` turn both ways; compare up to sign for geometric normals.
    let o = object(m);
    let mut rng = Rng(2);
    for place in places() {
        let world = World::build(vec![instance(&o, place)], DVec3::ZERO);
        for _ in 0..300 {
            let (dir, time) = (rng.direction(), rng.unit());
            let hit = trace(&world, Vec3::ZERO, dir, time);
            let shading = world.shading_normal(&hit, time).expect("a hit");
            let geometric = world.geometric_normal(&hit, time).expect("a hit");
            assert!((shading.length() - 1.0).abs() < 1e-5);
            assert!(shading.dot(dir) > 0.0, "outward");
            assert!(shading.dot(geometric).abs() > 0.97, "{shading} {geometric}");
            let p = world.cell_vertices(&hit, time).expect("a hit");
            assert!((p[2] - p[0]).normalize().dot(geometric).abs() < 1e-3);
        }
    }
}

#[test]
fn normals_at_keys_turn_with_time() {
    let mut m = mesh(&[(2, 2)], &[0.0, 1.0], |_, u, v, _| Vec3::new(u, v, 0.0));
    m.normal_key_count = 2;
    let n = m.vertex_count;
    m.normals = vec![octahedral::encode(Vec3::Z); n];
    m.normals.extend(vec![octahedral::encode(Vec3::X); n]);
    let world = world_of(m);
    let hit = trace(&world, Vec3::new(0.3, 0.3, 1.0), -Vec3::Z, 0.5);
    let want = (Vec3::X + Vec3::Z).normalize();
    assert!((world.shading_normal(&hit, 0.5).expect("a hit") - want).length() < 1e-3);
    assert!((world.shading_normal(&hit, 1.0).expect("a hit") - Vec3::X).length() < 1e-3);
}
