//! Objects that are made when rays first come near them, and have relative trees then.

use std::sync::Arc;

use glam::DVec3;
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::bvh::build::NEVER;
use hdtrapeze_core::trace::places::Shift;
use hdtrapeze_core::trace::{
    Deferred, Hit, InstanceSet, InstanceTransform, TraceCounts, World, WorldSet,
};
use hdtrapeze_simd::Level;

use crate::trace_scenes::*;
use crate::{Kind, kind, rays, scenes};

/// Where each of them is: close enough that rays to one come by others.
fn place(i: usize) -> DVec3 {
    DVec3::new(0.4, 0.3, -0.5) * (i % 4) as f64
}

#[test]
fn what_is_made_late_has_the_hits_of_what_was_there() {
    let scenes = scenes();
    let plain: Vec<_> = scenes
        .iter()
        .map(|(.., mesh)| Arc::new(ObjectGeometry::plain(mesh.clone())))
        .collect();
    let place_of = |i| InstanceTransform::Translation(place(i));
    let there = plain.iter().enumerate();
    let there = there.map(|(i, object)| instance(object, place_of(i)));
    let there = World::build(there.collect(), DVec3::ZERO);
    let late = |level: Level| {
        let deferred = scenes.iter().zip(&plain).map(|((.., mesh), plain)| {
            let mesh = mesh.clone();
            let make = Arc::new(move || ObjectGeometry::new(mesh.clone()));
            Arc::new(Deferred::new(
                *plain.bounds(),
                plain.mesh().position_bytes(),
                make,
            ))
        });
        let deferred: Vec<_> = deferred.collect();
        let sets = deferred.iter().enumerate().map(|(i, deferred)| WorldSet {
            set: Arc::new(InstanceSet::deferred(
                Arc::clone(deferred),
                Shift::new(place(i), DVec3::ZERO, 0),
            )),
            user: 0,
            culled: None,
        });
        let world = World::new(sets.collect(), DVec3::ZERO, &NEVER).expect("a world");
        (world.with_level(level), deferred)
    };
    let rays = rays(&mut Rng(9), 512, &[0.0, 0.25, 0.5, 1.0]);
    let mut counts = TraceCounts::default();
    let wanted: Vec<Hit> = rays.iter().map(|r| there.trace(r, &mut counts)).collect();
    assert!(wanted.iter().filter(|h| h.is_hit()).count() > 100);
    for level in Level::available() {
        let (world, deferred) = late(level);
        assert!(deferred.iter().all(|d| d.made().is_none()));
        let mut many = vec![Hit::MISS; rays.len()];
        world.trace_many(&rays, &mut many, &mut counts);
        assert_eq!(many, wanted, "{level:?}");
        let made = deferred.iter().filter_map(|d| d.made());
        let kinds: Vec<Kind> = made.map(|made| kind(made)).collect();
        for of in [Kind::Rigid, Kind::Carried, Kind::Parts] {
            assert!(kinds.contains(&of), "{kinds:?}");
        }
        // One by one, made by each.
        let (world, _) = late(level);
        for (ray, wanted) in rays.iter().zip(&wanted) {
            assert_eq!(world.trace(ray, &mut counts), *wanted, "{level:?} {ray:?}");
        }
        let (world, _) = late(level);
        let mut found = vec![false; rays.len()];
        world.occluded_many(&rays, &mut found, &mut counts);
        let hits = wanted.iter().map(Hit::is_hit);
        assert!(found.iter().copied().eq(hits), "{level:?}");
    }
}
