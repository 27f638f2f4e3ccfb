//! What a scene does not use takes no memory, to the byte, and changes no bit. Instructions are counted by
//! `scripts/absent_effects.py`.

mod trace_scenes;

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use hdtrapeze_core::bvh::block::Block;
use hdtrapeze_core::bvh::object::Blas;
use hdtrapeze_core::bvh::turn::StoredTurn;
use hdtrapeze_core::bvh::{BvhStats, Frame, LinearSlabs, Node, ObjectGeometry, StaticSlabs};
use hdtrapeze_core::camera::Camera;
use hdtrapeze_core::grid::Grid;
use hdtrapeze_core::motion::Shutter;
use hdtrapeze_core::sample::PixelSampler;
use hdtrapeze_core::scene::{CameraDesc, Projection, RenderSettings};
use hdtrapeze_core::trace::{InstanceTransform, Ray, TraceCounts, World, WorldStats};
use trace_scenes::*;

/// Bytes of a tree whose nodes and blocks are so large.
fn tree_bytes(stats: &BvhStats, node: usize, block: usize, frames: usize) -> u64 {
    stats.nodes * node as u64 + stats.blocks * block as u64 + frames as u64
}

/// Bytes of frames.
fn frames(object: &ObjectGeometry) -> usize {
    match object.blas() {
        Blas::Static(t) => size_of::<Frame>() * (t.tree.frames.len() + t.frames.len()),
        Blas::Moving(t) => size_of::<StoredTurn>() * (t.tree.frames.len() + t.frames.len()),
        Blas::Relative(_) => 0,
    }
}

#[test]
fn still_nodes_blocks_and_vertices_are_stored_once() {
    // Origin, step, and 8 x 6 planes; children; frame, and mask with diagonals; where these go at the end, if things move; or
    // frame and what is covered.
    const SLABS: usize = 4 * (3 + 3) + 48;
    assert_eq!(size_of::<StaticSlabs>(), SLABS);
    assert_eq!(size_of::<LinearSlabs>(), 2 * SLABS);
    assert_eq!(size_of::<Node<StaticSlabs>>(), SLABS + 32 + 8);
    assert_eq!(size_of::<Node<LinearSlabs>>(), 2 * SLABS + 32 + 8 + 4);
    assert_eq!(size_of::<Block<StaticSlabs>>(), SLABS + 4 + 12);
    assert_eq!(size_of::<Block<LinearSlabs>>(), 2 * SLABS + 4 + 12);
    for make in [
        (|k: &[f32]| sheet(6, 16, k)) as fn(&[f32]) -> _,
        |k| patches(30, 7, k, 3),
        |k| combed(200, 0.01, k, 4),
    ] {
        let (still, moving) = (
            ObjectGeometry::new(make(&keys(1))),
            ObjectGeometry::new(make(&keys(2))),
        );
        let stats = [*still.stats(), *moving.stats()];
        assert!(
            matches!(still.blas(), Blas::Static(_)) && matches!(moving.blas(), Blas::Moving(_))
        );
        let bytes = tree_bytes(&stats[0], SLABS + 40, SLABS + 16, frames(&still));
        assert_eq!(stats[0].bvh_bytes, bytes);
        let bytes = tree_bytes(&stats[1], 2 * SLABS + 44, 2 * SLABS + 16, frames(&moving));
        assert_eq!(stats[1].bvh_bytes, bytes);
        // Positions: 12 bytes a vertex and key.
        let positions = |o: &ObjectGeometry, keys: usize| {
            let planes = o.mesh().vertex_count * keys * 12;
            let rest = o.stats().mesh_bytes as usize - size_of::<Grid>() * o.mesh().grids.len();
            assert!(rest >= planes && rest < planes + 256, "{rest} {planes}");
        };
        positions(&still, 1);
        positions(&moving, 2);
    }
}

#[test]
fn what_moves_beside_a_still_set_leaves_it_still() {
    let set = object(sheet(6, 16, &keys(1)));
    let mover = object(patches(2, 16, &keys(2), 3));
    let at = |x: f64| InstanceTransform::Translation(DVec3::X * x);
    let still = World::build(
        (0..20).map(|i| instance(&set, at(f64::from(i)))).collect(),
        DVec3::ZERO,
    );
    let mut list: Vec<_> = (0..20).map(|i| instance(&set, at(f64::from(i)))).collect();
    list.push(instance(&mover, at(-5.0)));
    let beside = World::build(list, DVec3::ZERO);
    let (a, b) = (still.stats(), beside.stats());
    // What is more is the mover's own: nodes over instances store no second bounds either.
    assert_eq!(
        b.object.bvh_bytes,
        a.object.bvh_bytes + mover.stats().bvh_bytes
    );
    assert_eq!(
        b.object.mesh_bytes,
        a.object.mesh_bytes + mover.stats().mesh_bytes
    );
    let rest = |s: &WorldStats| s.top_bytes - s.top_nodes * size_of::<Node<StaticSlabs>>() as u64;
    assert_eq!(rest(&b), rest(&a) + set_bytes(&mover));
    assert_eq!(a.top_nodes, b.top_nodes);
    // And every ray meets the same.
    let mut rng = Rng(4);
    for _ in 0..300 {
        let target = Vec3::new(20.0 * rng.unit(), rng.signed(), 0.0);
        let r = ray(target + Vec3::Z * 3.0, -Vec3::Z, rng.unit());
        let hits = [&still, &beside].map(|w| w.trace(&r, &mut TraceCounts::default()));
        assert_eq!(hits[0], hits[1]);
    }
}

/// Bytes of one more set of one instance.
fn set_bytes(object: &Arc<ObjectGeometry>) -> u64 {
    let bytes = |n: usize| {
        let list = vec![instance(object, InstanceTransform::Translation(DVec3::ZERO)); n];
        let stats = World::build(list, DVec3::ZERO).stats();
        stats.top_bytes - stats.top_nodes * size_of::<Node<LinearSlabs>>() as u64
    };
    bytes(3) - bytes(2)
}

#[test]
fn times_change_nothing_that_is_still() {
    let world = world_of(patches(40, 9, &keys(1), 6));
    let mut rng = Rng(5);
    for _ in 0..500 {
        let origin = rng.direction() * 4.0;
        let r = ray(origin, rng.cube() - origin, rng.unit());
        let ask = |time: f32| {
            let mut counts = TraceCounts::default();
            (world.trace(&Ray { time, ..r }, &mut counts), counts)
        };
        assert_eq!(ask(r.time), ask(0.0));
    }
}

#[test]
fn what_is_not_drawn_leaves_the_rest_of_a_sample_as_it_was() {
    for count in [16, 64, 7] {
        let sampler = PixelSampler::new(count, 3);
        for index in [0, 1, 5, 15, 16, 40, 1000] {
            let whole @ [x, y, u, v, time] = sampler.pixel([3, 4]).sample(index);
            assert!(whole.iter().all(|&x| x > 0.0));
            let none = sampler
                .pixel_of::<false, false>([3, 4])
                .sample_of::<false, false>(index);
            assert_eq!(none, [x, y, 0.0, 0.0, 0.0]);
            let lens = sampler
                .pixel_of::<true, false>([3, 4])
                .sample_of::<true, false>(index);
            assert_eq!(lens, [x, y, u, v, 0.0]);
            let timed = sampler
                .pixel_of::<false, true>([3, 4])
                .sample_of::<false, true>(index);
            assert_eq!(timed, [x, y, 0.0, 0.0, time]);
            let both = sampler
                .pixel_of::<true, true>([3, 4])
                .sample_of::<true, true>(index);
            assert_eq!(both, whole);
        }
    }
}

#[test]
fn a_pinhole_ray_goes_through_the_middle_of_the_lens() {
    for projection in [Projection::Perspective, Projection::Orthographic] {
        for f_stop in [0.0, 0.5] {
            let camera = CameraDesc {
                projection,
                f_stop,
                focus_distance: 5.0,
                ..CameraDesc::default()
            };
            let (camera, _) = Camera::new(&camera, &RenderSettings::default(), Shutter::default())
                .expect("a camera");
            for at in [Vec2::ZERO, Vec2::new(100.25, 3.5), Vec2::new(-20.0, 540.0)] {
                assert_eq!(camera.pinhole_ray(at, 0.0), camera.ray(at, Vec2::ZERO, 0.0));
            }
        }
    }
}
