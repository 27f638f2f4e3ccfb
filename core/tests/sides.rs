//! Culled sides: rays pass through the one side of a surface and stop at the other, wherever the
//! surface is, however it is turned, mirrored, instanced or moved.

mod support;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DMat4, DVec3, Vec3};
use hdtrapeze_core::render::{Prepared, prepare};
use hdtrapeze_core::scene::{
    Axis, CameraDesc, Cull, CurvesDesc, Geometry, ImplicitDesc, ImplicitKind, InstanceArrays,
    InstancerDesc, MeshDesc, NurbsPatchDesc, PointsSamples, PrimCommon, PrimDesc, PrimId,
    RenderSettings, Samples, Scene, SpheresDesc, TransformSamples,
};
use hdtrapeze_core::surface::{MeshTopology, Orientation, Scheme};
use hdtrapeze_core::trace::{Hit, Ray, TraceCounts};
use proptest::prelude::*;
use support::NoSubdivision;

const SIDES: [Orientation; 2] = [Orientation::RightHanded, Orientation::LeftHanded];

fn points(points: &[Vec3]) -> PointsSamples {
    PointsSamples {
        times: vec![0.0],
        points: vec![Arc::new(points.to_vec())],
        ..PointsSamples::default()
    }
}

/// A square at z = 0 that faces +z where it is right-handed.
fn square(orientation: Orientation) -> Geometry {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    Geometry::Mesh(MeshDesc {
        topology: Arc::new(MeshTopology {
            scheme: Scheme::None,
            orientation,
            face_vertex_counts: vec![4],
            face_vertex_indices: vec![0, 1, 2, 3],
            ..MeshTopology::default()
        }),
        points: points(&corners.map(|(x, y)| Vec3::new(x, y, 0.0))),
        ..MeshDesc::default()
    })
}

fn prim(geometry: Geometry, keys: &[DMat4]) -> PrimDesc {
    let mut common = PrimCommon::new("/prim");
    common.transform = vec![TransformSamples {
        times: (0..keys.len()).map(|i| i as f64).collect(),
        matrices: keys.to_vec(),
        ..TransformSamples::default()
    }];
    PrimDesc { common, geometry }
}

fn commit(mut scene: Scene, cull: Cull) -> Prepared {
    let eye = DMat4::from_translation(DVec3::Z * 10.0);
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        transform: vec![TransformSamples {
            times: vec![0.0],
            matrices: vec![eye],
            ..TransformSamples::default()
        }],
        shutter: [0.0, 1.0],
        ..CameraDesc::default()
    };
    scene.cameras.insert(PrimId(100), Arc::new(camera));
    scene.active_camera = Some(PrimId(100));
    scene.settings = Arc::new(RenderSettings {
        cull,
        shading_rate: 20.0,
        ..RenderSettings::default()
    });
    let done = prepare(&scene, &NoSubdivision, None, &AtomicBool::new(false)).unwrap();
    assert!(done.warnings.is_empty(), "{:?}", done.warnings);
    done.prepared
}

fn alone(prim: &PrimDesc, cull: Cull) -> Prepared {
    let mut scene = Scene::default();
    scene.prims.insert(PrimId(1), Arc::new(prim.clone()));
    commit(scene, cull)
}

fn ray(world: &Prepared, from: Vec3, dir: Vec3, time: f32) -> Ray {
    Ray {
        origin: from - world.world().origin().as_vec3(),
        dir,
        time,
        t_min: 0.0,
        t_max: f32::INFINITY,
    }
}

/// All hits of a culled world, near to far.
fn hits(world: &Prepared, ray: &Ray) -> Vec<Hit> {
    let counts = &mut TraceCounts::default();
    let mut all = Vec::new();
    let mut hit = world.world().next::<true>(ray, None, counts);
    while hit.is_hit() {
        all.push(hit);
        hit = world.world().next::<true>(ray, Some(&hit), counts);
    }
    all
}

/// Whether the middle of a prim that lies about z = 0 is seen from +z and from -z.
fn seen(world: &Prepared, time: f32) -> [bool; 2] {
    [1.0f32, -1.0].map(|side| {
        let from = Vec3::new(0.1, 0.2, 5.0 * side);
        !hits(world, &ray(world, from, Vec3::Z * -side, time)).is_empty()
    })
}

fn scale(x: f64, y: f64, z: f64) -> DMat4 {
    DMat4::from_scale(DVec3::new(x, y, z))
}

#[test]
fn a_square_is_seen_from_the_sides_that_are_not_culled() {
    let mut square = prim(square(Orientation::RightHanded), &[DMat4::IDENTITY]);
    let of = |prim: &PrimDesc, cull| seen(&alone(prim, cull), 0.0);
    assert_eq!(of(&square, Cull::None), [true, true]);
    assert_eq!(of(&square, Cull::Back), [true, false]);
    assert_eq!(of(&square, Cull::Front), [false, true]);
    assert_eq!(of(&square, Cull::BackUnlessDoubleSided), [true, false]);
    square.common.double_sided = true;
    assert_eq!(of(&square, Cull::BackUnlessDoubleSided), [true, true]);
    assert_eq!(of(&square, Cull::Back), [true, false]);
}

#[test]
fn mirrors_and_orientation_turn_what_they_turn() {
    // A surface that is mirrored keeps its outside: across z the square looks the other way, across x
    // and y it does not. Left-handed it looks the other way.
    for (m, front) in [
        (scale(1.0, 1.0, 1.0), true),
        (scale(-1.0, 1.0, 1.0), true),
        (scale(1.0, -2.0, 1.0), true),
        (scale(1.0, 1.0, -1.0), false),
        (scale(-1.0, 1.0, -1.0), false),
        (scale(-1.0, -1.0, -3.0), false),
        (DMat4::from_rotation_x(3.0), false),
    ] {
        for orientation in SIDES {
            let front = front == (orientation == Orientation::RightHanded);
            let one = prim(square(orientation), &[m]);
            assert_eq!(seen(&alone(&one, Cull::Back), 0.0), [front, !front], "{m}");
            assert_eq!(
                seen(&instanced(&one, m, Cull::Back), 0.0),
                [front, !front],
                "{m}"
            );
        }
    }
}

/// Two instances of a prim without its own transform, both placed by `m`.
fn instanced(of: &PrimDesc, m: DMat4, cull: Cull) -> Prepared {
    let mut scene = Scene::default();
    let mut instancer = InstancerDesc::new("/instancer");
    instancer.arrays = Arc::new(InstanceArrays {
        instance_count: 2,
        prototype_count: 1,
        prototypes: vec![0, 0],
        matrices: Samples {
            times: vec![0.0],
            values: vec![Arc::new(vec![m; 2])],
        },
        ..InstanceArrays::default()
    });
    scene.instancers.insert(PrimId(50), Arc::new(instancer));
    let mut part = of.clone();
    part.common.transform.clear();
    part.common.instancer = Some((PrimId(50), 0));
    scene.prims.insert(PrimId(1), Arc::new(part));
    let world = commit(scene, cull);
    assert_eq!(world.statistics().instances, 2);
    world
}

#[test]
fn a_square_that_moves_through_a_mirror_turns_on_its_way() {
    // Across x the outside stays; across z it turns where the square is flat, at 3/4.
    let across_x = prim(
        square(Orientation::RightHanded),
        &[scale(3.0, 1.0, 1.0), scale(-1.0, 1.0, 1.0)],
    );
    let world = alone(&across_x, Cull::Back);
    for time in [0.0, 0.3, 0.7, 0.8, 1.0] {
        assert_eq!(seen(&world, time), [true, false], "{time}");
    }
    let across_z = prim(
        square(Orientation::RightHanded),
        &[scale(1.0, 1.0, 3.0), scale(1.0, 1.0, -1.0)],
    );
    let world = alone(&across_z, Cull::Back);
    for (time, front) in [(0.0, true), (0.7, true), (0.8, false), (1.0, false)] {
        assert_eq!(seen(&world, time), [front, !front], "{time}");
    }
}

#[test]
fn curves_and_points_are_always_seen() {
    let line = [Vec3::new(-2.0, 0.1, 0.0), Vec3::new(2.0, 0.1, 0.0)];
    let curves = Geometry::Curves(CurvesDesc {
        vertex_counts: Arc::new(vec![2]),
        points: points(&line),
        ..CurvesDesc::default()
    });
    let spheres = Geometry::Spheres(SpheresDesc {
        points: points(&[Vec3::ZERO]),
    });
    for geometry in [curves, spheres] {
        for cull in [Cull::Back, Cull::Front] {
            let world = alone(&prim(geometry.clone(), &[DMat4::IDENTITY]), cull);
            assert_eq!(seen(&world, 0.0), [true, true]);
            assert!(!world.plan().has_culling(), "nothing called for it");
        }
    }
}

#[test]
fn the_plan_names_the_prim_that_is_culled() {
    let mut scene = Scene::default();
    for (id, double_sided) in [(1, true), (2, false)] {
        let mut square = prim(square(Orientation::RightHanded), &[DMat4::IDENTITY]);
        square.common.path = format!("/square{id}");
        square.common.double_sided = double_sided;
        scene.prims.insert(PrimId(id), Arc::new(square));
    }
    let by = |cull| commit(scene.clone(), cull).plan().culled_by.clone();
    assert_eq!(by(Cull::None), None);
    assert_eq!(by(Cull::Front).as_deref(), Some("/square1"));
    assert_eq!(by(Cull::BackUnlessDoubleSided).as_deref(), Some("/square2"));
    let told = commit(scene.clone(), Cull::Front).explain("cpu");
    assert!(
        told.contains("culled sides: some, called for by /square1\n"),
        "{told}"
    );
}

/// Closed solids about the origin, within 2 of it.
fn solid(which: usize, axis: Axis, orientation: Orientation) -> Geometry {
    let (kind, sizes) = [
        (ImplicitKind::Cube, [1.5, 0.0, 0.0]),
        (ImplicitKind::Sphere, [1.2, 0.0, 0.0]),
        (ImplicitKind::Cylinder, [2.0, 0.5, 0.9]),
        (ImplicitKind::Cylinder, [2.0, 0.9, 0.0]),
        (ImplicitKind::Cone, [2.0, 1.0, 0.0]),
        (ImplicitKind::Capsule, [1.0, 0.3, 0.6]),
        (ImplicitKind::Capsule, [1.0, 0.6, 0.3]),
    ][which];
    Geometry::Implicit(ImplicitDesc {
        kind,
        axis,
        orientation,
        times: vec![0.0],
        sizes: vec![sizes],
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Of a convex solid, rays from outside see the front first and the back last, whatever its kind,
    /// axis, orientation, place and mirrors; and each hit is on one side.
    #[test]
    fn solids_have_an_outside(
        which in 0usize..7,
        axis in 0usize..3,
        left in any::<bool>(),
        mirror in prop::array::uniform3(any::<bool>()),
        turn in 0.0f64..6.0,
        shared in any::<bool>(),
        from in prop::array::uniform3(-1.0f32..1.0),
        to in prop::array::uniform3(-0.5f32..0.5),
    ) {
        let axis = [Axis::X, Axis::Y, Axis::Z][axis];
        let [x, y, z] = mirror.map(|mirrored| if mirrored { -1.0 } else { 1.0 });
        let m = DMat4::from_axis_angle(DVec3::ONE.normalize(), turn) * scale(x, 1.3 * y, z);
        let one = prim(solid(which, axis, SIDES[usize::from(left)]), &[m]);
        let world = |cull| if shared { instanced(&one, m, cull) } else { alone(&one, cull) };
        let [all, fronts, backs] = [Cull::None, Cull::Back, Cull::Front].map(world);
        let outside = Vec3::from_array(from).normalize_or(Vec3::X) * 4.0;
        let ray = ray(&all, outside, Vec3::from_array(to) - outside, 0.0);
        // At a rim, the strip that joins two parts' edges is seen from both sides, a hair's breadth wide.
        prop_assume!(hits(&all, &ray).len() <= if shared { 4 } else { 2 });
        let first = |world: &Prepared| hits(world, &ray).first().map(|h| h.t);
        let last = |world: &Prepared| hits(world, &ray).last().map(|h| h.t);
        let near = |a: Option<f32>, b: Option<f32>| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() < 1.0e-2,
            (a, b) => a == b,
        };
        let (outer, inner) = if left { (&backs, &fronts) } else { (&fronts, &backs) };
        prop_assert!(near(first(outer), first(&all)) && near(last(outer), first(&all)));
        prop_assert!(near(first(inner), last(&all)) && near(last(inner), last(&all)));
    }
}

#[test]
fn patches_face_where_u_v_and_the_normal_are_right_handed() {
    for orientation in SIDES {
        let geometry = Geometry::NurbsPatch(NurbsPatchDesc {
            vertex_counts: [2, 2],
            orders: [2, 2],
            knots: [0, 1].map(|_| Arc::new(vec![0.0, 0.0, 1.0, 1.0])),
            orientation,
            points: points(&[
                Vec3::new(-1.0, -1.0, 0.0),
                Vec3::new(1.0, -1.0, 0.0),
                Vec3::new(-1.0, 1.0, 0.0),
                Vec3::new(1.0, 1.0, 0.0),
            ]),
            ..NurbsPatchDesc::default()
        });
        let front = orientation == Orientation::RightHanded;
        for (m, turned) in [(scale(1.0, 1.0, 1.0), false), (scale(1.0, 1.0, -1.0), true)] {
            let world = alone(&prim(geometry.clone(), &[m]), Cull::Back);
            let front = front != turned;
            assert_eq!(seen(&world, 0.0), [front, !front], "{orientation:?}");
        }
    }
}
