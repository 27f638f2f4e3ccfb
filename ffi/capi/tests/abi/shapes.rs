//! Prims that are not meshes: rays find them where they were put.

use hdtrapeze::*;

use crate::support::*;

/// Distance at which a ray from (x, y, 5) straight down hits, and the geometric normal there.
fn drop_ray(session: &Session, x: f32, y: f32) -> (f32, [f32; 3]) {
    let ray = trz_ray {
        origin: [x, y, 5.0],
        dir: [0.0, 0.0, -1.0],
        time: 0.0,
        t_min: 0.0,
        t_max: f32::INFINITY,
    };
    // SAFETY: all zero bytes are a valid value of this struct of numbers.
    let mut hit: trz_hit = unsafe { std::mem::zeroed() };
    // SAFETY: pointers to live values.
    ok(unsafe { trz_trace_rays(session.0, &ray, &mut hit, 1) });
    (hit.t, hit.normal)
}

#[test]
fn implicit_prims_stand_where_kind_axis_and_sizes_say() {
    let session = Session::with_camera();
    let prim = session.implicit("/implicit");
    let at = |kind: u32, axis: u32, sizes: [f64; 3], x: f32, y: f32| {
        let implicit = trz_implicit {
            kind,
            axis,
            sizes: sizes.as_ptr(),
            ..sphere()
        };
        // SAFETY: pointers to live values.
        ok(unsafe { trz_implicit_set(session.0, prim, &implicit) });
        ok(session.commit());
        drop_ray(&session, x, y).0
    };
    let near = |a: f32, b: f32| assert!((a - b).abs() < 0.01, "{a} {b}");
    near(
        at(TRZ_IMPLICIT_CUBE, TRZ_AXIS_Z, [1.0, 0.0, 0.0], 0.3, -0.3),
        4.5,
    );
    near(
        at(TRZ_IMPLICIT_PLANE, TRZ_AXIS_Z, [1.0, 2.0, 0.0], 0.3, -0.9),
        5.0,
    );
    near(
        at(TRZ_IMPLICIT_SPHERE, TRZ_AXIS_X, [1.5, 0.0, 0.0], 0.0, 0.9),
        3.8,
    );
    near(
        at(TRZ_IMPLICIT_CYLINDER, TRZ_AXIS_X, [3.0, 0.5, 0.5], 1.4, 0.3),
        4.6,
    );
    near(
        at(
            TRZ_IMPLICIT_CYLINDER,
            TRZ_AXIS_Y,
            [3.0, 0.0, 1.0],
            0.0,
            0.75,
        ),
        4.25,
    );
    near(
        at(TRZ_IMPLICIT_CONE, TRZ_AXIS_Z, [2.0, 1.0, 0.0], 0.5, 0.0),
        5.0,
    );
    near(
        at(TRZ_IMPLICIT_CAPSULE, TRZ_AXIS_Y, [2.0, 0.5, 0.5], 0.0, -1.3),
        4.6,
    );
    let miss = at(TRZ_IMPLICIT_CAPSULE, TRZ_AXIS_Y, [2.0, 0.5, 0.5], 0.6, 0.0);
    assert_eq!(miss, f32::INFINITY);
}

#[test]
fn a_nurbs_patch_is_where_its_points_and_range_are() {
    let session = Session::with_camera();
    let prim = session.nurbs_patch("/patch");
    // Points along u follow each other: corners of a square that rises along u.
    let floats = [
        0.0f32, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0, 1.0,
    ];
    let points = trz_points {
        times: &0.0,
        sample_count: 1,
        points: &floats.as_ptr(),
        counts: &4,
        ..no_points()
    };
    let half = trz_nurbs_patch {
        v_range: [0.5, 1.0],
        ..bilinear_patch()
    };
    // SAFETY: pointers to live values.
    unsafe {
        ok(trz_prim_set_points(session.0, prim, &points));
        ok(trz_nurbs_patch_set(session.0, prim, &half));
    }
    ok(session.commit());
    let (t, normal) = drop_ray(&session, 0.25, 0.75);
    assert!((t - 4.75).abs() < 1e-5, "{t}");
    assert!(normal[0] < -0.7 && normal[2] > 0.7, "{normal:?}");
    assert_eq!(drop_ray(&session, 0.25, 0.25).0, f32::INFINITY);
}

#[test]
fn nurbs_curves_go_where_their_points_do() {
    let session = Session::with_camera();
    let prim = session.nurbs_curves("/line");
    let floats = [-1.0f32, 0.5, 0.0, 1.0, 0.5, 0.0];
    let points = trz_points {
        times: &0.0,
        sample_count: 1,
        points: &floats.as_ptr(),
        counts: &2,
        ..no_points()
    };
    let half_wide = [0.5f32];
    let thin = half_wide.as_ptr().cast();
    let width = trz_primvar {
        width: 1,
        values: &thin,
        value_counts: &1,
        ..primvar()
    };
    let half = trz_nurbs_curves {
        ranges: [0.0, 0.5].as_ptr(),
        range_count: 1,
        ..line()
    };
    // SAFETY: pointers to live values.
    unsafe {
        ok(trz_prim_set_points(session.0, prim, &points));
        ok(trz_prim_set_primvar(
            session.0,
            prim,
            c"widths".as_ptr(),
            &width,
        ));
        ok(trz_nurbs_curves_set(session.0, prim, &half));
    }
    ok(session.commit());
    let (t, _) = drop_ray(&session, -0.5, 0.5);
    assert!((t - 4.75).abs() < 0.02, "{t}");
    assert_eq!(drop_ray(&session, 0.5, 0.5).0, f32::INFINITY);
    assert_eq!(drop_ray(&session, -0.5, 0.8).0, f32::INFINITY);
}
