//! Velocities, accelerations and blur scales, seen by rays at instants.

use hdtrapeze::*;

use crate::support::*;

/// A session with the shutter open from 0 to 1 and a unit square at the origin.
fn square() -> (Session, trz_id) {
    let session = Session::with_camera();
    let mut settings = small_settings(4);
    settings.override_shutter = 1;
    settings.shutter_close = 1.0;
    // SAFETY: pointers to live values.
    ok(unsafe { trz_session_set_settings(session.0, &settings) });
    let square = session.square("/square", 0.0);
    (session, square)
}

/// Gives the square rates along x, in units a time code, and a time code squared.
fn set_rates(session: &Session, square: trz_id, velocity: f32, acceleration: f32) {
    let floats: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];
    let along_x = |x: f32| [x, 0.0, 0.0].repeat(4);
    let velocities = along_x(velocity * 24.0);
    let accelerations = along_x(acceleration * 24.0 * 24.0);
    let (velocities, accelerations) = (velocities.as_ptr(), accelerations.as_ptr());
    let one = |values: &*const f32| trz_float_samples {
        times: &0.0,
        sample_count: 1,
        values,
        counts: &4,
    };
    let points = trz_points {
        times: &0.0,
        sample_count: 1,
        points: &floats.as_ptr(),
        counts: &4,
        velocities: one(&velocities),
        accelerations: one(&accelerations),
        time_codes_per_second: 24.0,
        ..no_points()
    };
    // SAFETY: pointers to live values.
    ok(unsafe { trz_prim_set_points(session.0, square, &points) });
}

fn set_motion(session: &Session, square: trz_id, blur_scale: f64, nonlinear_samples: u32) {
    // SAFETY: a live session.
    ok(unsafe { trz_prim_set_motion(session.0, square, blur_scale, nonlinear_samples) });
    ok(session.commit());
}

/// Where the square's left edge is at `time`, to a sixteenth.
fn left_edge(session: &Session, time: f32) -> f32 {
    let x = |i: usize| (i as f32 + 0.5) / 16.0 - 4.0;
    let rays: Vec<trz_ray> = (0..128)
        .map(|i| trz_ray {
            origin: [x(i), 0.5, 5.0],
            dir: [0.0, 0.0, -1.0],
            time,
            t_min: 0.0,
            t_max: f32::INFINITY,
        })
        .collect();
    // SAFETY: all zero bytes are a valid value of this struct of numbers.
    let mut hits = vec![unsafe { std::mem::zeroed::<trz_hit>() }; rays.len()];
    // SAFETY: arrays of one length.
    ok(unsafe { trz_trace_rays(session.0, rays.as_ptr(), hits.as_mut_ptr(), rays.len()) });
    let first = hits.iter().position(|hit| hit.t.is_finite());
    x(first.expect("the square is seen")) - 0.5 / 16.0
}

#[test]
fn velocities_and_accelerations_move_points() {
    let (session, square) = square();
    set_rates(&session, square, 1.0, 1.0);
    ok(session.commit());
    assert_eq!(left_edge(&session, 0.0), 0.0);
    assert_eq!(left_edge(&session, 0.5), 0.625);
    assert_eq!(left_edge(&session, 1.0), 1.5);
    set_motion(&session, square, 1.0, 2);
    assert_eq!(left_edge(&session, 0.5), 0.75, "a straight line");
    assert_eq!(left_edge(&session, 1.0), 1.5);
    session.set_square_points(square, 0.0);
    ok(session.commit());
    assert_eq!(left_edge(&session, 1.0), 0.0, "other points have no rates");
}

#[test]
fn blur_is_scaled_about_the_frame() {
    let (session, square) = square();
    set_rates(&session, square, 1.0, 0.0);
    for (scale, x) in [(0.5, 0.5), (2.0, 2.0), (0.0, 0.0), (-3.0, 1.0)] {
        set_motion(&session, square, scale, 0);
        assert_eq!(left_edge(&session, 0.0), 0.0);
        assert_eq!(left_edge(&session, 1.0), x, "{scale}");
    }
    // SAFETY: a live session.
    ok(unsafe { trz_prim_set_double_sided(session.0, square, 1) });
    ok(session.commit());
}

static TIMES: [f64; 2] = [0.0, 1.0];

/// USD's matrix of a turn about z.
fn turned(degrees: f64) -> [f64; 16] {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let mut matrix = IDENTITY;
    (matrix[0], matrix[1], matrix[4], matrix[5]) = (cosine, sine, -sine, cosine);
    matrix
}

#[test]
fn transforms_turn_between_samples_where_asked_to() {
    let (session, square) = square();
    let matrices = [turned(0.0), turned(120.0)];
    for (turns, x) in [(0, -0.3125), (1, -0.875)] {
        let level = trz_transform_samples {
            times: TIMES.as_ptr(),
            matrices: matrices.as_ptr().cast(),
            count: 2,
            turns,
        };
        // SAFETY: pointers to live values.
        ok(unsafe { trz_prim_set_transform(session.0, square, &level, 1) });
        ok(session.commit());
        assert_eq!(left_edge(&session, 0.5), x, "{turns}");
    }
}

#[test]
fn the_frame_shows_whether_what_moves_turns() {
    let session = Session::with_camera();
    let settings = trz_settings {
        override_shutter: 1,
        shutter_open: -1.0,
        shutter_close: 3.0,
        ..small_settings(4)
    };
    // SAFETY: pointers to live values.
    ok(unsafe { trz_session_set_settings(session.0, &settings) });
    let square = session.square("/square", 0.0);
    let instancer = session.instancer("/instancer");
    let (first, last, arc) = (turned(0.0), turned(120.0), turned(60.0));
    let line: [f64; 16] = std::array::from_fn(|i| 0.5 * (first[i] + last[i]));
    let times = [-1.0, 0.0, 1.0, 3.0];
    // Halfway from the third sample to the fourth: on the line, or on an arc.
    let cases = [
        (1, line, -0.875),
        (3, line, -0.3125),
        (3, arc, -0.875),
        (2, arc, -0.3125),
    ];
    for (turns, frame, x) in cases {
        let matrices = [first, frame, last, first];
        let level = trz_transform_samples {
            times: times.as_ptr(),
            matrices: matrices.as_ptr().cast(),
            count: 4,
            turns,
        };
        let still = trz_transform_samples { count: 1, ..level };
        let values = matrices.each_ref().map(|m| m.as_ptr());
        let desc = trz_instancer {
            instance_count: 1,
            matrices: trz_matrix_samples {
                times: times.as_ptr(),
                sample_count: 4,
                values: values.as_ptr(),
                counts: [1; 4].as_ptr(),
            },
            matrices_turn: turns,
            ..no_instances()
        };
        // SAFETY: pointers to live values.
        unsafe {
            ok(trz_prim_set_instancer(session.0, square, 0, 0));
            ok(trz_prim_set_transform(session.0, square, &level, 1));
            ok(session.commit());
            assert_eq!(left_edge(&session, 0.75), x, "{turns}");
            ok(trz_prim_set_transform(session.0, square, &still, 1));
            ok(trz_instancer_set(session.0, instancer, &desc));
            ok(trz_prim_set_instancer(session.0, square, instancer, 0));
        }
        ok(session.commit());
        assert_eq!(left_edge(&session, 0.75), x, "instances: {turns}");
    }
}

#[test]
fn matrices_of_instances_turn_between_samples_where_asked_to() {
    let (session, square) = square();
    let instancer = session.instancer("/instancer");
    let matrices = [turned(0.0), turned(120.0)];
    let counts = [1, 1];
    let values = [matrices[0].as_ptr(), matrices[1].as_ptr()];
    for (matrices_turn, x) in [(0, -0.3125), (1, -0.875)] {
        let desc = trz_instancer {
            instance_count: 1,
            matrices: trz_matrix_samples {
                times: TIMES.as_ptr(),
                sample_count: 2,
                values: values.as_ptr(),
                counts: counts.as_ptr(),
            },
            matrices_turn,
            ..no_instances()
        };
        // SAFETY: pointers to live values.
        unsafe {
            ok(trz_instancer_set(session.0, instancer, &desc));
            ok(trz_prim_set_instancer(session.0, square, instancer, 0));
        }
        ok(session.commit());
        assert_eq!(left_edge(&session, 0.5), x, "{matrices_turn}");
    }
}

#[test]
fn lists_of_instances_are_prototypes() {
    let (session, square) = square();
    let instancer = session.instancer("/instancer");
    let places: [f32; 9] = [3.0, 0.0, 0.0, 2.0, 0.0, 0.0, -1.0, 0.0, 0.0];
    let lists = [[2].as_ptr(), [1, 0].as_ptr()];
    let desc = trz_instancer {
        prototype_count: 2,
        lists: lists.as_ptr(),
        list_counts: [1, 2].as_ptr(),
        positions: trz_float_samples {
            times: &0.0,
            sample_count: 1,
            values: &places.as_ptr(),
            counts: &3,
        },
        ..no_instances()
    };
    for (prototype, x) in [(0, -1.0), (1, 2.0)] {
        // SAFETY: pointers to live values.
        unsafe {
            ok(trz_instancer_set(session.0, instancer, &desc));
            ok(trz_prim_set_instancer(
                session.0, square, instancer, prototype,
            ));
        }
        ok(session.commit());
        assert_eq!(left_edge(&session, 0.0), x, "{prototype}");
    }
}
