//! Instancers against USD's formulas, written out.

use std::sync::Arc;

use glam::{DAffine3, DMat4, DQuat, DVec3, Quat, Vec3};

use super::{Instancer, Placements};
use crate::diagnostics::{Code, Warning};
use crate::motion::{Hierarchy, Shutter};
use crate::scene::{InstanceArrays, InstancerDesc, Samples, TransformSamples};

const SHUTTER: Shutter = Shutter {
    open: -0.25,
    close: 0.25,
};

fn samples<T: Clone>(values: &[(f64, &[T])]) -> Samples<T> {
    Samples {
        times: values.iter().map(|v| v.0).collect(),
        values: values.iter().map(|v| Arc::new(v.1.to_vec())).collect(),
    }
}

fn still<T: Clone>(values: &[T]) -> Samples<T> {
    samples(&[(0.0, values)])
}

fn desc(arrays: InstanceArrays) -> InstancerDesc {
    InstancerDesc {
        arrays: Arc::new(arrays),
        ..InstancerDesc::new("/i")
    }
}

fn resolve(arrays: InstanceArrays) -> (Instancer, Vec<Warning>) {
    let mut warnings = Vec::new();
    let instancer = Instancer::new(&desc(arrays), None, SHUTTER, &mut warnings);
    (instancer, warnings)
}

fn three() -> InstanceArrays {
    InstanceArrays {
        instance_count: 3,
        positions: still(&[Vec3::X, Vec3::Y, Vec3::Z]),
        ..InstanceArrays::default()
    }
}

fn assert_near(a: DAffine3, b: DAffine3) {
    let (a, b) = (a.to_cols_array(), b.to_cols_array());
    let far = a.iter().zip(b).any(|(a, b)| (a - b).abs() > 1e-6);
    assert!(!far, "{a:?}\n{b:?}");
}

#[test]
fn matrix_scale_orientation_position_in_this_order() {
    let q = Quat::from_axis_angle(Vec3::new(1.0, 2.0, 2.0) / 3.0, 0.7);
    let m = DMat4::from_translation(DVec3::new(0.5, 0.0, 1.0)) * DMat4::from_rotation_y(0.3);
    let (i, warnings) = resolve(InstanceArrays {
        instance_count: 1,
        positions: still(&[Vec3::new(3.0, 4.0, 5.0)]),
        orientations: still(&[q]),
        scales: still(&[Vec3::new(2.0, 1.0, -0.5)]),
        matrices: still(&[m]),
        ..InstanceArrays::default()
    });
    assert!(warnings.is_empty());
    let expected = DMat4::from_translation(DVec3::new(3.0, 4.0, 5.0))
        * DMat4::from_quat(q.as_dquat())
        * DMat4::from_scale(DVec3::new(2.0, 1.0, -0.5))
        * m;
    assert_near(i.instance(0, 0.0), DAffine3::from_mat4(expected));
}

#[test]
fn each_array_has_its_own_samples() {
    let turn = |a: f32| Quat::from_rotation_z(a);
    let (i, warnings) = resolve(InstanceArrays {
        instance_count: 1,
        positions: samples(&[(-1.0, &[Vec3::ZERO]), (1.0, &[Vec3::X * 8.0])]),
        // The long way round: the shorter arc is taken.
        orientations: samples(&[(-0.25, &[turn(0.0)]), (0.75, &[-turn(1.2)])]),
        scales: samples(&[(0.0, &[Vec3::ONE]), (0.125, &[Vec3::splat(3.0)])]),
        ..InstanceArrays::default()
    });
    assert!(warnings.is_empty());
    assert_eq!(i.key_times(), [0.0, 0.5, 0.75, 1.0]);
    // At time code 0.125.
    let expected = DMat4::from_translation(DVec3::X * 4.5)
        * DMat4::from_rotation_z(1.2 * 0.375)
        * DMat4::from_scale(DVec3::splat(3.0));
    assert_near(i.instance(0, 0.75), DAffine3::from_mat4(expected));
    assert!(i.arrays.bends);
}

#[test]
fn matrices_turn_where_the_host_says_so() {
    let matrix = |angle: f64| [DMat4::IDENTITY, DMat4::from_rotation_z(angle)];
    let arrays = |angle: f64, matrices_turn: bool| InstanceArrays {
        instance_count: 2,
        positions: still(&[Vec3::X, Vec3::Y]),
        matrices: samples(&[(-0.25, &matrix(0.0)), (0.25, &matrix(angle))]),
        matrices_turn,
        ..InstanceArrays::default()
    };
    let (i, _) = resolve(arrays(3.0, true));
    assert!(i.matrices_turn() && i.arrays.bends);
    let expected = DMat4::from_translation(DVec3::Y) * DMat4::from_rotation_z(0.9);
    assert_near(i.instance(1, 0.3), DAffine3::from_mat4(expected));
    assert_near(i.instance(0, 0.3), DAffine3::from_translation(DVec3::X));

    let (i, _) = resolve(arrays(3.0, false));
    assert!(!i.arrays.bends);
    let blend = DMat4::IDENTITY * 0.7 + DMat4::from_rotation_z(3.0) * 0.3;
    let expected = DMat4::from_translation(DVec3::Y) * blend;
    assert_near(i.instance(1, 0.3), DAffine3::from_mat4(expected));

    let (i, _) = resolve(arrays(0.0, true));
    assert!(!i.matrices_turn() && !i.arrays.bends);
}

#[test]
fn levels_that_turn_bend_what_they_place() {
    let level = |turns: bool| TransformSamples {
        times: vec![-0.25, 0.25],
        matrices: vec![DMat4::IDENTITY, DMat4::from_rotation_z(3.0)],
        turns,
    };
    let placed = |of_instancer: Vec<TransformSamples>, of_prim: &[TransformSamples]| {
        let mut desc = desc(three());
        desc.transform = of_instancer;
        let instancer = Instancer::new(&desc, None, SHUTTER, &mut Vec::new());
        let prim = Hierarchy::new(of_prim, SHUTTER).unwrap();
        Placements::new(Arc::new(instancer), 0, prim)
    };
    assert!(placed(vec![level(true)], &[]).bends());
    assert!(placed(vec![], &[level(true)]).bends());
    assert!(!placed(vec![level(false)], &[]).bends());
}

#[test]
fn rates_move_the_sample_before_the_frame() {
    let q = Quat::from_rotation_x(1.0);
    let w = Vec3::new(0.0, 0.0, 720.0);
    let arrays = InstanceArrays {
        instance_count: 1,
        positions: samples(&[(-1.0, &[Vec3::X]), (3.0, &[Vec3::X * 100.0])]),
        velocities: samples(&[(-1.0, &[Vec3::Y * 24.0]), (3.0, &[Vec3::ZERO])]),
        accelerations: samples(&[(-1.0, &[Vec3::Z * 576.0]), (3.0, &[Vec3::ZERO])]),
        orientations: samples(&[(-2.0, &[q]), (1.0, &[q])]),
        angular_velocities: samples(&[(-2.0, &[w]), (1.0, &[w])]),
        scales: samples(&[(0.0, &[Vec3::ONE]), (1.0, &[Vec3::splat(9.0)])]),
        time_codes_per_second: 24.0,
        ..InstanceArrays::default()
    };
    let (i, warnings) = resolve(arrays.clone());
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(i.key_times(), [0.0, 1.0]);
    for (time, code) in [(0.0, -0.25), (0.3, -0.1), (1.0, 0.25)] {
        let (dt, spin) = ((code + 1.0) / 24.0, (code + 2.0) / 24.0);
        let p = DVec3::new(1.0, 24.0 * dt, 288.0 * dt * dt);
        let expected = DMat4::from_translation(p)
            * DMat4::from_rotation_z((720.0 * spin).to_radians())
            * DMat4::from_quat(q.as_dquat());
        assert_near(i.instance(0, time), DAffine3::from_mat4(expected));
    }
    assert!((i.arrays.spin(0) - 720.0 * 0.5 / 24.0).abs() < 1e-9);

    // With motion:nonlinearSampleCount, straight between so many samples.
    let mut bent = desc(arrays);
    bent.nonlinear_samples = Some(3);
    let stops = Instancer::new(&bent, None, SHUTTER, &mut Vec::new());
    assert_eq!(stops.key_times(), [0.0, 0.5, 1.0]);
    assert!(!stops.arrays.bends);
    let (a, b) = (i.instance(0, 0.5), i.instance(0, 1.0));
    let middle = (a.translation + b.translation) * 0.5;
    assert!((stops.instance(0, 0.75).translation - middle).length() < 1e-9);
    assert!(
        (stops.instance(0, 0.75).translation - i.instance(0, 0.75).translation).length() > 1e-5
    );

    // Blur scale 0: the frame's own instant.
    bent.blur_scale = 0.0;
    let frame = Instancer::new(&bent, None, SHUTTER, &mut Vec::new());
    assert_eq!(frame.key_times(), [0.0]);
    assert_near(frame.instance(0, 1.0), i.instance(0, 0.5));
}

#[test]
fn what_does_not_fit_is_ignored_or_left_out_with_one_warning() {
    let check = |change: &dyn Fn(&mut InstanceArrays), code: Code, left: &[u32], word: &str| {
        let mut arrays = three();
        change(&mut arrays);
        let (i, warnings) = resolve(arrays);
        assert_eq!(warnings.len(), 1, "{word}: {warnings:?}");
        assert_eq!(warnings[0].code, code, "{word}");
        assert_eq!(warnings[0].prim, "/i");
        assert!(warnings[0].text.contains(word), "{warnings:?}");
        assert_eq!(i.members(0), left, "{word}");
        for &m in left {
            assert!(i.instance(m as usize, 0.5).is_finite());
        }
    };
    let all = &[0, 1, 2][..];
    let set = |f: fn(&mut InstanceArrays)| f;
    let length = Code::Topology;
    check(
        &set(|a| a.positions = still(&[Vec3::X])),
        length,
        &[],
        "1 positions for 3",
    );
    check(
        &set(|a| a.prototypes = vec![0]),
        length,
        &[],
        "1 protoIndices",
    );
    check(
        &set(|a| a.scales = still(&[Vec3::X; 4])),
        length,
        all,
        "4 scales",
    );
    check(
        &set(|a| a.orientations = still(&[Quat::IDENTITY])),
        length,
        all,
        "1 orientations",
    );
    check(
        &set(|a| a.mask = vec![0; 4]),
        length,
        all,
        "4 values of the mask",
    );
    check(&set(|a| a.ids = vec![7]), length, all, "1 ids");
    let numbers = |a: &mut InstanceArrays| {
        a.prototypes = vec![-1, 0, 2];
        a.prototype_count = 2;
    };
    check(&numbers, length, &[1], "2 of 3 protoIndices");
    let nan = |a: &mut InstanceArrays| {
        a.positions = still(&[Vec3::X, Vec3::NAN, Vec3::INFINITY]);
    };
    check(&nan, Code::NotFinite, &[0], "2 of 3 instances");
    let nan = |a: &mut InstanceArrays| {
        a.orientations = still(&[
            Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0),
            Quat::IDENTITY,
            Quat::IDENTITY,
        ]);
    };
    check(&nan, Code::NotFinite, &[1, 2], "1 of 3 instances");
    let zero = |a: &mut InstanceArrays| {
        let unit = Quat::from_rotation_x(1.0);
        a.orientations = still(&[Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), unit, unit]);
    };
    check(&zero, Code::NotFinite, all, "1 of 3 orientations are zero");
    let long = |a: &mut InstanceArrays| a.orientations = still(&[Quat::IDENTITY * 3.0; 3]);
    check(
        &long,
        Code::NotFinite,
        all,
        "3 of 3 orientations are not of unit length",
    );
    let flat = |a: &mut InstanceArrays| {
        a.scales = still(&[
            Vec3::ZERO,
            Vec3::new(0.0, 0.0, 1.0),
            Vec3::new(0.0, 1.0, 1.0),
        ]);
    };
    check(
        &flat,
        Code::NotFinite,
        &[2],
        "2 of 3 instances are scaled to nothing",
    );
    let varying = |a: &mut InstanceArrays| {
        let (p, more) = ([Vec3::X; 3], [Vec3::Y; 4]);
        a.positions = samples(&[(0.0, &p), (1.0, &more)]);
    };
    check(
        &varying,
        Code::TimeSamples,
        all,
        "number of instances changes",
    );
    let rates = |a: &mut InstanceArrays| {
        a.velocities = still(&[Vec3::X; 2]);
        a.time_codes_per_second = 24.0;
    };
    check(&rates, length, all, "2 velocities for 3");
    let rates = |a: &mut InstanceArrays| a.velocities = still(&[Vec3::X; 3]);
    check(&rates, Code::TimeSamples, all, "time codes a second");
}

#[test]
fn velocities_serve_where_the_number_of_instances_changes() {
    let mut arrays = three();
    arrays.positions = samples(&[(0.0, &[Vec3::X; 3]), (1.0, &[Vec3::Y; 4])]);
    arrays.velocities = samples(&[(0.0, &[Vec3::Y * 24.0; 3]), (1.0, &[Vec3::Y; 4])]);
    arrays.time_codes_per_second = 24.0;
    let (i, warnings) = resolve(arrays);
    assert!(warnings.is_empty(), "{warnings:?}");
    let moved = i.instance(2, 1.0).translation;
    assert!((moved - DVec3::new(1.0, 0.25, 0.0)).length() < 1e-9);
}

#[test]
fn masks_and_prototypes_choose_members() {
    let mut arrays = three();
    arrays.prototypes = vec![1, 0, 1];
    arrays.mask = vec![1, 1, 0];
    let (i, warnings) = resolve(arrays);
    assert!(warnings.is_empty());
    assert_eq!(
        (i.members(0), i.members(1), i.members(2)),
        (&[1][..], &[0][..], &[][..])
    );
    let (empty, warnings) = resolve(InstanceArrays::default());
    assert!(warnings.is_empty() && empty.members(0).is_empty());
}

#[test]
fn nested_instancers_multiply_outermost_first() {
    let level = |x: f64| TransformSamples {
        times: vec![0.0],
        matrices: vec![DMat4::from_rotation_z(x)],
        ..TransformSamples::default()
    };
    let mut outer = three();
    outer.prototypes = vec![1, 0, 1];
    let mut outer = desc(outer);
    outer.transform = vec![level(0.5)];
    let outer = Arc::new(Instancer::new(&outer, None, SHUTTER, &mut Vec::new()));
    let mut inner = three();
    inner.mask = vec![1, 0, 1];
    let mut inner = desc(inner);
    inner.transform = vec![level(-0.2)];
    let inner = Instancer::new(&inner, Some((outer, 1)), SHUTTER, &mut Vec::new());
    assert_eq!(inner.placement_count(0), 4);
    let prim = Hierarchy::new(&[level(0.1)], SHUTTER).unwrap();
    let placements = Placements::new(Arc::new(inner), 0, prim);
    assert_eq!(placements.count(), 4);
    // outer * 3 + inner, with the indices in the arrays.
    let ids: Vec<i32> = (0..4).map(|n| placements.id(n)).collect();
    assert_eq!(ids, [0, 2, 6, 8]);
    let r = |a: f64| DMat4::from_rotation_z(a);
    let t = DMat4::from_translation;
    let expected = r(0.5) * t(DVec3::Z) * r(-0.2) * t(DVec3::X) * r(0.1);
    assert_near(placements.matrix(2, 0.3), DAffine3::from_mat4(expected));
    let moments = placements.at(&[0.0]);
    let mut walker = moments.walker();
    for n in [3, 0, 2, 1, 2] {
        assert_near(walker.matrices(n)[0], placements.matrix(n, 0.0));
    }
    assert!(!placements.bends());
    assert_eq!(placements.key_times(), [0.0]);
}

/// Prototypes as Hydra has them: what ids show are places in the lists.
fn listed() -> InstanceArrays {
    InstanceArrays {
        instance_count: 0,
        lists: vec![vec![2, 0], vec![1]],
        ..three()
    }
}

#[test]
fn lists_choose_members_and_number_them() {
    let (i, warnings) = resolve(listed());
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!((i.members(0), i.members(1)), (&[2, 0][..], &[1][..]));
    assert_near(i.instance(2, 0.0), DAffine3::from_translation(DVec3::Z));
    let placements = Placements::new(Arc::new(i), 0, Hierarchy::default());
    assert_eq!([placements.id(0), placements.id(1)], [0, 1]);
    assert_eq!(placements.instance_of(0, 0), 2, "primvars are by instance");
    assert!(!placements.ids_are_indices());
    let first = placements.matrix(0, 0.0);
    assert_near(first, DAffine3::from_translation(DVec3::Z));

    let mut arrays = listed();
    arrays.positions = still(&[Vec3::X, Vec3::Y, Vec3::NAN]);
    let (i, warnings) = resolve(arrays);
    assert_eq!((i.members(0), warnings.len()), (&[0][..], 1));
    let placements = Placements::new(Arc::new(i), 0, Hierarchy::default());
    assert_eq!(placements.id(0), 1, "its place in the list stays");
}

#[test]
fn nested_lists_count_their_own_lengths() {
    let (outer, _) = resolve(listed());
    let inner = desc(listed());
    let inner = Instancer::new(&inner, Some((Arc::new(outer), 0)), SHUTTER, &mut Vec::new());
    let placements = Placements::new(Arc::new(inner), 0, Hierarchy::default());
    let ids: Vec<i32> = (0..4).map(|n| placements.id(n)).collect();
    assert_eq!(ids, [0, 1, 2, 3]);
    let expected = DAffine3::from_translation(DVec3::new(1.0, 0.0, 1.0));
    assert_near(placements.matrix(1, 0.0), expected);
}

#[test]
fn lists_without_places_draw_nothing() {
    let mut arrays = listed();
    arrays.positions = Samples::default();
    arrays.scales = still(&[Vec3::ONE; 3]);
    let (i, warnings) = resolve(arrays);
    assert!(i.members(0).is_empty());
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].text.contains("no positions"), "{warnings:?}");

    let mut arrays = listed();
    arrays.positions = still(&[Vec3::X, Vec3::Y]);
    let (i, warnings) = resolve(arrays.clone());
    assert!(i.members(1).is_empty());
    assert!(warnings[0].text.contains("2 positions for 3 instances"));

    arrays.lists = vec![vec![2, 0, i32::MAX], vec![1], vec![-1, i32::MIN]];
    let (i, warnings) = resolve(arrays);
    assert_eq!((i.members(0), i.members(1)), (&[0][..], &[1][..]));
    assert!(i.members(2).is_empty());
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].text.contains("4 of 6 instances have no place"));
}

#[test]
fn ids_are_for_single_instancers() {
    let mut arrays = three();
    arrays.ids = vec![70, 80, 90];
    let (i, _) = resolve(arrays.clone());
    let placements = Placements::new(Arc::new(i), 0, Hierarchy::default());
    assert_eq!(placements.id(2), 90);
    let (outer, _) = resolve(three());
    let inner = Instancer::new(
        &desc(arrays),
        Some((Arc::new(outer), 0)),
        SHUTTER,
        &mut Vec::new(),
    );
    let placements = Placements::new(Arc::new(inner), 0, Hierarchy::default());
    assert_eq!(placements.id(5), 5);
}

#[test]
fn quaternions_that_are_nearly_unit_are_taken_as_they_are() {
    // 1 / sqrt(2) in half precision: a length of 0.9999, as USD uses it.
    let h = 0.707_031_25f32;
    let mut arrays = three();
    arrays.orientations = still(&[Quat::from_xyzw(0.0, 0.0, h, h); 3]);
    let (i, warnings) = resolve(arrays);
    assert!(warnings.is_empty());
    let x = i.instance(0, 0.0).matrix3.x_axis;
    let h = f64::from(h);
    assert!((x - DVec3::new(1.0 - 2.0 * h * h, 2.0 * h * h, 0.0)).length() < 1e-12);
    assert!(DQuat::from_xyzw(0.0, 0.0, h, h).length() < 1.0);
}
