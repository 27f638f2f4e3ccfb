//! Objects whose trees are built in a space that moves along, or for parts of the shutter: the same hits as with
//! a plain tree, and as brute force has them.

mod contained;
mod deferred;
#[path = "../trace_scenes/mod.rs"]
mod trace_scenes;

use std::sync::Arc;

use glam::{DVec3, Quat, Vec3};
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::bvh::object::Blas;
use hdtrapeze_core::bvh::relative::Trees;
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World, brute};
use hdtrapeze_simd::Level;
use trace_scenes::*;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Plain,
    Rigid,
    Carried,
    Parts,
    CarriedParts,
}

fn kind(object: &ObjectGeometry) -> Kind {
    match object.blas() {
        Blas::Static(_) | Blas::Moving(_) => Kind::Plain,
        Blas::Relative(r) => match (&r.trees, r.middle) {
            (Trees::Still(_), _) => Kind::Rigid,
            (_, None) => Kind::Carried,
            (_, Some(_)) if r.carrier.is_some() => Kind::CarriedParts,
            _ => Kind::Parts,
        },
    }
}

/// Small and large, at places, of each kind.
fn scenes() -> Vec<(&'static str, Kind, DicedMesh)> {
    let uneven = [0.0, 0.07, 0.2, 0.21, 0.5, 0.83, 1.0];
    let turned = |m: DicedMesh, q: Quat, by: Vec3| {
        let mut m = m;
        for p in &mut m.positions {
            *p = q * *p + by;
        }
        m
    };
    let q = Quat::from_axis_angle(Vec3::new(1.0, 2.0, -0.5).normalize(), 2.0);
    vec![
        ("fan", Kind::Rigid, curved::fan(2, 16, &keys(9), 3.1)),
        (
            "fan, uneven",
            Kind::Rigid,
            turned(curved::fan(2, 12, &uneven, 2.0), q, Vec3::ONE * 0.2),
        ),
        (
            "fan, quarter turns",
            Kind::Rigid,
            curved::fan(2, 16, &keys(3), 3.1),
        ),
        (
            "fan, one segment",
            Kind::Rigid,
            curved::fan(2, 16, &keys(2), 0.5),
        ),
        (
            "orbit",
            Kind::Carried,
            curved::orbit(60, 9, &keys(9), 3.0, 1),
        ),
        (
            "falling",
            Kind::Carried,
            turned(curved::falling(60, 9, &uneven, 2), q, Vec3::ZERO),
        ),
        ("wobbling fan", Kind::Carried, wobbling(&uneven)),
        ("sheet", Kind::Parts, sheet(30, 8, &keys(9))),
        ("debris", Kind::Parts, curved::debris(40, 9, &keys(9), 3)),
        ("whip", Kind::Parts, curved::whip(80, &keys(5), 3)),
        ("wind", Kind::Parts, wind(60, &keys(2), 3)),
        ("wind, uneven", Kind::Parts, wind(60, &uneven, 4)),
        ("fur", Kind::Plain, fur(60, &keys(2), 3)),
        ("patches", Kind::Plain, patches(40, 9, &keys(5), 3)),
    ]
}

/// Fur whose strands sway each its own way, much farther than they are apart.
fn wind(count: usize, keys: &[f32], seed: u64) -> DicedMesh {
    let mut m = fur(count, keys, seed);
    let size = m.grids[0].vertex_count();
    for strand in m.positions.chunks_exact_mut(size * keys.len()) {
        let (first, rest) = strand.split_at_mut(size);
        for p in rest.chunks_exact_mut(size) {
            for (p, from) in p.iter_mut().zip(&*first) {
                *p = *from + (*p - *from) * 30.0;
            }
        }
    }
    m
}

/// A fan whose blades bend while it turns.
fn wobbling(keys: &[f32]) -> DicedMesh {
    let mut m = curved::fan(2, 8, keys, 2.0);
    let mut i = 0;
    for grid in m.grids.clone() {
        for &t in keys {
            for _ in 0..grid.vertex_count() {
                let p = &mut m.positions[i];
                let bend = 0.05 * (3.0 * t).sin() * p.truncate().length_squared();
                p.z += bend;
                i += 1;
            }
        }
    }
    m
}

fn rays(rng: &mut Rng, count: usize, times: &[f32]) -> Vec<Ray> {
    (0..count)
        .map(|i| {
            // Runs of sixteen are near each other in space and time, now and then.
            if i % 32 < 16 {
                *rng = Rng(i as u64 / 16);
            }
            let origin = rng.direction() * (0.2 + 3.0 * rng.unit());
            let dir = (rng.cube() - origin) * (0.01 + 5.0 * rng.unit());
            let mut r = ray(origin, dir, rng.unit());
            if i % 3 == 0 {
                r.time = times[rng.below(times.len())];
            }
            r
        })
        .collect()
}

fn world(object: ObjectGeometry, transform: InstanceTransform) -> World {
    World::build(vec![instance(&Arc::new(object), transform)], DVec3::ZERO)
}

#[test]
fn every_kind_has_the_hits_of_a_plain_tree() {
    for (name, wanted, mesh) in scenes() {
        let mut times = vec![
            -1.0,
            0.0,
            1.0,
            7.0,
            f32::NAN,
            0.0f32.next_up(),
            1.0f32.next_down(),
        ];
        for &t in &mesh.key_times {
            times.extend([t, t.next_up(), t.next_down()]);
        }
        let object = ObjectGeometry::new(mesh.clone());
        assert_eq!(kind(&object), wanted, "{name}");
        let plain = ObjectGeometry::plain(mesh);
        assert_eq!(kind(&plain), Kind::Plain, "{name}");
        let mut turned = affine(DVec3::ONE, 1.0, DVec3::new(-0.7, 0.5, 1.3), DVec3::X);
        turned.translation *= 0.3;
        for place in [
            InstanceTransform::Translation(DVec3::splat(0.1)),
            InstanceTransform::Static(turned),
        ] {
            let own = world(object.clone(), place.clone());
            let plain = world(plain.clone(), place);
            let rays = rays(&mut Rng(5), 1024, &times);
            let mut counts = TraceCounts::default();
            let wanted: Vec<Hit> = rays.iter().map(|r| plain.trace(r, &mut counts)).collect();
            let found = wanted.iter().filter(|h| h.is_hit()).count();
            assert!(found > 30, "{name}: {found}");
            for level in Level::available() {
                let own = own.clone().with_level(level);
                let mut many = vec![Hit::MISS; rays.len()];
                own.trace_many(&rays, &mut many, &mut counts);
                assert_eq!(many, wanted, "{name} {level:?}");
                for (ray, wanted) in rays.iter().zip(&wanted).step_by(3) {
                    assert_eq!(
                        own.trace(ray, &mut counts),
                        *wanted,
                        "{name} {level:?} {ray:?}"
                    );
                    assert_eq!(own.occluded(ray, &mut counts), wanted.is_hit(), "{name}");
                }
            }
            let clamped = rays.iter().zip(&wanted).filter(|(r, _)| !r.time.is_nan());
            for (ray, hit) in clamped.step_by(17) {
                brute::verify(&own, ray, None, hit)
                    .unwrap_or_else(|e| panic!("{name}: {ray:?}: {e}"));
            }
        }
    }
}

#[test]
fn later_hits_are_found_too() {
    for (name, _, mesh) in scenes() {
        let own = world(
            ObjectGeometry::new(mesh.clone()),
            InstanceTransform::Translation(DVec3::ZERO),
        );
        let plain = world(
            ObjectGeometry::plain(mesh),
            InstanceTransform::Translation(DVec3::ZERO),
        );
        let mut counts = TraceCounts::default();
        for ray in rays(&mut Rng(6), 64, &[0.5]) {
            let mut hit = own.trace(&ray, &mut counts);
            while hit.is_hit() {
                let next = own.trace_after(&ray, &hit, &mut counts);
                assert_eq!(next, plain.trace_after(&ray, &hit, &mut counts), "{name}");
                hit = next;
            }
        }
    }
}

#[test]
fn curves_cost_few_tests() {
    // Of nodes and micropolygons, against a plain tree, whose frames follow what falls nearly as well.
    let cases = [
        ("orbit", 2, curved::orbit(60, 16, &keys(9), 3.0, 1)),
        ("falling", 1, curved::bent_falling(60, 16, &keys(9), 2, 0.1)),
        ("fan", 2, curved::fan(2, 16, &keys(9), 3.1)),
        ("quarters", 2, curved::fan(2, 16, &keys(3), 3.1)),
        ("debris", 2, curved::debris(60, 16, &keys(9), 2)),
    ];
    for (name, times, mesh) in cases {
        let rays = rays(&mut Rng(5), 512, &[0.5]);
        let count = |object: ObjectGeometry| {
            let world = world(object, InstanceTransform::Translation(DVec3::ZERO));
            let mut counts = TraceCounts::default();
            world.trace_many(&rays, &mut vec![Hit::MISS; rays.len()], &mut counts);
            counts.node_tests + counts.cell_tests
        };
        let (own, plain) = (
            count(ObjectGeometry::new(mesh.clone())),
            count(ObjectGeometry::plain(mesh)),
        );
        assert!(own * times < plain, "{name}: {own} {plain}");
    }
}

#[test]
fn what_cannot_be_followed_is_traced_as_ever() {
    // A point that is not finite at one key, points that are absurdly far, all in one place, a single triangle's worth.
    let base = || curved::fan(1, 16, &keys(5), 2.0);
    let mut cases = vec![base(); 4];
    cases[0].positions[700].x = f32::NAN;
    cases[1].positions[700].y = 1.0e30;
    cases[2].positions.fill(Vec3::ONE);
    for p in &mut cases[3].positions {
        *p *= 1.0e-30;
    }
    for (i, mesh) in cases.into_iter().enumerate() {
        let own = world(
            ObjectGeometry::new(mesh.clone()),
            InstanceTransform::Translation(DVec3::ZERO),
        );
        let plain = world(
            ObjectGeometry::plain(mesh),
            InstanceTransform::Translation(DVec3::ZERO),
        );
        let mut counts = TraceCounts::default();
        for ray in rays(&mut Rng(7), 200, &[0.0, 1.0]) {
            assert_eq!(
                own.trace(&ray, &mut counts),
                plain.trace(&ray, &mut counts),
                "{i}"
            );
        }
    }
}

#[test]
fn one_thread_builds_the_same_trees() {
    let nodes = || {
        scenes()
            .into_iter()
            .map(|(_, _, mesh)| format!("{:?}", ObjectGeometry::new(mesh).blas()))
            .collect::<Vec<_>>()
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool of one thread");
    assert!(nodes() == pool.install(nodes));
}
