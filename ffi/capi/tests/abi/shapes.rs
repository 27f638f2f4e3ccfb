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
