//! Trees that are left for later: what is hit has the same bits, whoever asks first.

mod trace_scenes;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use glam::{DVec3, Vec3};
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::places::Shift;
use hdtrapeze_core::trace::world::WorldError;
use hdtrapeze_core::trace::{
    Hit, InstanceSet, InstanceTransform, Ray, TraceCounts, World, WorldInstance, WorldSet,
};
use rayon::prelude::*;
use trace_scenes::*;

/// Objects that are still, move, follow a curve, and have grids that cannot be traced.
fn meshes() -> Vec<DicedMesh> {
    let mut lost = sheet(3, 9, &keys(2));
    lost.positions[500].y = f32::NAN;
    lost.positions[1500].y = 1.3e18;
    lost.grids[4].nu = 99;
    // Trees are made of positions alone, and counted with all.
    let mut smooth = sheet(3, 9, &[0.0]);
    smooth.normal_key_count = 1;
    smooth.normals = vec![7; smooth.vertex_count];
    vec![
        smooth,
        patches(40, 7, &keys(3), 3),
        curved::fan(2, 6, &keys(9), 3.0),
        fur(200, &keys(2), 4),
        lost,
        DicedMesh::default(),
    ]
}

fn placed(objects: impl IntoIterator<Item = ObjectGeometry>) -> Vec<WorldInstance> {
    let mut instances = Vec::new();
    for (i, object) in (0..).zip(objects) {
        let object = Arc::new(object);
        let at = DVec3::new(0.3 * f64::from(i), 0.0, -0.2);
        instances.push(instance(&object, InstanceTransform::Translation(at)));
        let by = affine(DVec3::ONE, 0.7, DVec3::new(1.0, 0.5, 0.8), -at);
        instances.push(instance(&object, InstanceTransform::Static(by)));
    }
    instances
}

fn now() -> World {
    World::build(
        placed(meshes().into_iter().map(ObjectGeometry::new)),
        DVec3::ZERO,
    )
}

fn later() -> World {
    let objects = meshes().into_iter().map(ObjectGeometry::later);
    World::build_later(placed(objects), DVec3::ZERO)
}

fn rays() -> Vec<Ray> {
    let mut rng = Rng(8);
    let ray = |_| {
        let origin = rng.direction() * (0.2 + 3.0 * rng.unit());
        ray(origin, rng.cube() - origin, rng.unit())
    };
    (0..4000).map(ray).collect()
}

/// Each by itself, from all threads of a pool at once.
fn traced(world: &World) -> Vec<Hit> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build();
    let trace = |ray| world.trace(ray, &mut TraceCounts::default());
    let rays = rays();
    let all = || rays.par_iter().with_max_len(1).map(trace).collect();
    pool.expect("threads").install(all)
}

#[test]
fn rays_that_come_first_have_trees_made() {
    let (now, later) = (now(), later());
    let stats = later.stats();
    assert_eq!(
        (stats.trees, stats.top_nodes, stats.object.nodes),
        (0, 0, 0)
    );
    assert_eq!(stats.objects, 6);
    assert_eq!(stats.object.cells, now.stats().object.cells);
    assert_eq!(stats.object.dropped_grids, now.stats().object.dropped_grids);
    assert_eq!(stats.object.dropped_grids, 3);
    assert_eq!(stats.left_out, now.stats().left_out);
    let expected = traced(&now);
    assert!(expected.iter().filter(|hit| hit.is_hit()).count() > 500);
    assert!(traced(&later) == expected);
    let made = later.stats();
    assert!(made.trees > 0 && made.top_nodes > 0);
}

#[test]
fn trees_that_are_made_ahead_are_those() {
    let (now, later) = (now(), later());
    later.make_trees(&AtomicBool::new(true));
    assert_eq!((later.stats().trees, later.stats().top_nodes), (0, 0));
    later.make_trees(&AtomicBool::new(false));
    let (made, stats) = (later.stats(), now.stats());
    assert_eq!(made.trees, 6);
    // Those over instances may differ: boxes that are known without a tree are larger.
    assert_eq!(made.object, stats.object);
    assert!(traced(&later) == traced(&now));
}

/// Without a tree, bounds hold all vertices at all times, and the radius what any tree stores.
#[test]
fn bounds_need_no_tree() {
    for mesh in meshes() {
        let (now, later) = (
            ObjectGeometry::new(mesh.clone()),
            ObjectGeometry::later(mesh),
        );
        assert_eq!(now.is_empty(), later.is_empty());
        assert!(later.radius() >= now.radius());
        assert!(!later.has_tree() && now.has_tree());
        let mesh = later.mesh();
        for (g, sound) in mesh.sound_grids().into_iter().enumerate() {
            let points = |k| (0..mesh.grids[g].vertex_count()).map(move |i| mesh.position(g, k, i));
            let tame = |p: Vec3| p.abs().max_element() < 1e18;
            if !sound || !(0..mesh.key_count()).flat_map(points).all(tame) {
                continue;
            }
            for (k, &time) in mesh.key_times.iter().enumerate() {
                let (lo, hi) = later.bounds().at(f64::from(time));
                for p in points(k).map(|p| p.as_dvec3()) {
                    let slack = 1e-12;
                    assert!((p - lo).min_element() >= -slack && (hi - p).min_element() >= -slack);
                }
            }
        }
    }
}

/// Grids that cross over to the other side and turn on their way, far from what their ends tell.
#[test]
fn no_tree_stores_more_than_the_radius_says() {
    let mut rng = Rng(17);
    let mut most = 0.0f32;
    for round in 0..2400 {
        // Key times that crowd at an end raise chords the most.
        let mut times: Vec<f32> = (0..[0, 1, 3, 9][round % 4])
            .map(|_| rng.unit().powi([1, 6][round / 4 % 2]))
            .chain([0.0, 1.0])
            .collect();
        times.sort_by(f32::total_cmp);
        times.dedup();
        let corners: Vec<Vec3> = times.iter().map(|_| corner(&mut rng)).collect();
        let (upright, lean) = (rng.direction(), [0.3, 0.6, 3.0][round / 8 % 3]);
        let normals: Vec<Vec3> = times
            .iter()
            .map(|_| (upright + rng.direction() * lean).normalize())
            .collect();
        let size = [0.001, 0.05, 0.3][round % 3];
        let mesh = mesh(&[(8, 8); 2], &times, |g, u, v, time| {
            let key = times.iter().position(|&t| t == time).unwrap_or(0);
            let side = normals[key].any_orthonormal_vector();
            let across = normals[key].cross(side);
            let at = side * (u + g as f32 - 1.0) + across * (v - 0.5);
            corners[key] * (1.0 - size) + at * size
        });
        let reach = mesh
            .positions
            .iter()
            .fold(0.0f32, |m, p| m.max(p.abs().max_element()));
        let later = ObjectGeometry::later(mesh.clone());
        for now in [
            ObjectGeometry::new(mesh.clone()),
            ObjectGeometry::plain(mesh),
        ] {
            assert!(later.radius() >= now.radius(), "{times:?}");
            most = most.max(now.radius() / reach);
        }
    }
    // The hunt finds some that go far.
    assert!(most > 3.5 && most < 10.0, "{most}");
}

/// A corner of a cube, or near it.
fn corner(rng: &mut Rng) -> Vec3 {
    rng.cube().signum() * (1.0 - 0.05 * rng.unit())
}

/// Thousands of instances, some of which move.
fn many(object: fn(DicedMesh) -> ObjectGeometry) -> Vec<WorldSet> {
    let mut rng = Rng(5);
    let meshes = [sheet(2, 5, &[0.0]), patches(4, 5, &keys(2), 3)];
    let sets = meshes.into_iter().map(|mesh| {
        let origin = mesh.origin;
        let shift = |_| Shift::new(rng.cube().as_dvec3() * 20.0, origin, 0);
        let shifts = (0..30_000).map(shift).collect();
        WorldSet {
            set: Arc::new(InstanceSet::translated(Arc::new(object(mesh)), shifts)),
            user: 0,
            culled: None,
        }
    });
    sets.collect()
}

/// Raises a flag some time after it began with `build`, which is given the flag; before, where that is no time.
fn cancelled_after<T>(wait: Duration, build: impl FnOnce(&AtomicBool) -> T) -> T {
    let cancel = AtomicBool::new(wait.is_zero());
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(wait);
            cancel.store(true, Ordering::Relaxed);
        });
        build(&cancel)
    })
}

#[test]
fn builds_that_are_cancelled_midway_leave_nothing_behind() {
    let begun = Instant::now();
    let whole = World::new(
        many(ObjectGeometry::new),
        DVec3::ZERO,
        &AtomicBool::new(false),
    );
    let took = begun.elapsed();
    let expected = traced(&whole.expect("nobody cancels"));
    assert!(expected.iter().filter(|hit| hit.is_hit()).count() > 500);
    for step in 0..=12 {
        let wait = took * step / 12;
        match cancelled_after(wait, |cancel| {
            World::new(many(ObjectGeometry::new), DVec3::ZERO, cancel)
        }) {
            Ok(world) => assert!(step > 0 && traced(&world) == expected, "{step}"),
            Err(why) => assert_eq!(why, WorldError::Cancelled, "{step}"),
        }
        let later = World::later(
            many(ObjectGeometry::later),
            DVec3::ZERO,
            &AtomicBool::new(false),
        );
        let later = later.expect("nobody cancels");
        cancelled_after(wait, |cancel| later.make_trees(cancel));
        assert!(step > 0 || !later.has_tree());
        // Some of it is there, or all, or nothing.
        assert!(traced(&later) == expected, "{step}");
    }
}
