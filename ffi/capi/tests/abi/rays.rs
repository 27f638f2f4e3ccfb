//! Ray queries that nobody should ask, of grids that nobody should give: answers, never a fault.

use std::ptr::null;

use hdtrapeze::*;

use crate::support::*;

const DOWN: trz_ray = trz_ray {
    origin: [0.3, 0.6, 5.0],
    dir: [0.0, 0.0, -1.0],
    time: 0.5,
    t_min: 0.0,
    t_max: f32::INFINITY,
};

fn trace(session: &Session, rays: &[trz_ray]) -> Vec<trz_hit> {
    // SAFETY: all zero bytes are a valid value of this struct of numbers.
    let mut hits = vec![unsafe { std::mem::zeroed::<trz_hit>() }; rays.len()];
    // SAFETY: arrays of one length.
    ok(unsafe { trz_trace_rays(session.0, rays.as_ptr(), hits.as_mut_ptr(), rays.len()) });
    hits
}

/// Commits grids of one cell with corners at two keys: `at(grid, corner, key)`.
fn grids(count: usize, at: impl Fn(usize, usize, usize) -> [f32; 3]) -> Session {
    let session = Session::with_camera();
    let mut settings = small_settings(4);
    settings.override_shutter = 1;
    settings.shutter_close = 1.0;
    // SAFETY: pointers to live values.
    ok(unsafe { trz_session_set_settings(session.0, &settings) });
    let prim = session.grids("/grids");
    let mut positions = Vec::new();
    for grid in 0..count {
        for key in 0..2 {
            (0..4).for_each(|corner| positions.extend(at(grid, corner, key)));
        }
    }
    let rates = vec![1u16; 2 * count];
    let given = trz_grids {
        struct_size: size_of::<trz_grids>() as u32,
        times: [0.0, 1.0].as_ptr(),
        key_count: 2,
        rates: rates.as_ptr(),
        elements: null(),
        grid_count: count,
        positions: positions.as_ptr(),
        position_count: 8 * count,
    };
    // SAFETY: pointers to live values.
    ok(unsafe { trz_grids_set(session.0, prim, &given) });
    ok(session.commit());
    session
}

/// A unit square that rises by 1.
fn square(corner: usize, key: usize) -> [f32; 3] {
    [(corner % 2) as f32, (corner / 2) as f32, key as f32]
}

#[test]
fn directions_of_any_length_and_with_empty_components() {
    let session = grids(1, |_, corner, key| square(corner, key));
    for tiny in [0.0, -0.0, 1e-45, -1e-38] {
        let ray = trz_ray {
            dir: [tiny, -tiny, -1.0],
            ..DOWN
        };
        assert!((trace(&session, &[ray])[0].t - 4.5).abs() < 1e-5, "{tiny}");
    }
    for length in [2e-38f32, 1e-30, 1.0, 1e30, 3e38] {
        let ray = trz_ray {
            dir: [0.0, 0.0, -length],
            ..DOWN
        };
        let t = trace(&session, &[ray])[0].t;
        assert!((t * length - 4.5).abs() < 1e-4, "{length} {t}");
    }
    // 4.5 units are more of these than there are numbers.
    let hit = &trace(
        &session,
        &[trz_ray {
            dir: [0.0, 0.0, -1e-45],
            ..DOWN
        }],
    )[0];
    assert_eq!(
        (hit.t, hit.prim_id, hit.normal),
        (f32::INFINITY, -1, [0.0; 3])
    );
}

#[test]
fn every_number_that_is_nan_misses_and_times_are_clamped() {
    let session = grids(1, |_, corner, key| square(corner, key));
    let nan = f32::NAN;
    let bad = [
        trz_ray { time: nan, ..DOWN },
        trz_ray { t_min: nan, ..DOWN },
        trz_ray { t_max: nan, ..DOWN },
        trz_ray {
            origin: [0.3, nan, 5.0],
            ..DOWN
        },
        trz_ray {
            dir: [nan, 0.0, -1.0],
            ..DOWN
        },
        trz_ray {
            dir: [f32::INFINITY, 0.0, -1.0],
            ..DOWN
        },
    ];
    assert!(
        trace(&session, &bad)
            .iter()
            .all(|hit| hit.t == f32::INFINITY && hit.prim_id == -1)
    );
    for (time, t) in [
        (-3.0, 5.0),
        (f32::NEG_INFINITY, 5.0),
        (0.0, 5.0),
        (1.0, 4.0),
        (f32::MAX, 4.0),
        (f32::INFINITY, 4.0),
    ] {
        let hit = &trace(&session, &[trz_ray { time, ..DOWN }])[0];
        assert!((hit.t - t).abs() < 1e-5, "{time} {}", hit.t);
    }
}

#[test]
fn degenerate_grids_are_not_hit_and_hide_nothing() {
    // A point, a line, and the square.
    let session = grids(3, |grid, corner, key| match grid {
        0 => [0.3, 0.6, 2.0],
        1 => [corner as f32 * 0.1, 0.6, 2.0],
        _ => square(corner, key),
    });
    let hit = &trace(&session, &[DOWN])[0];
    assert_eq!(hit.element_id, 2);
    assert!((hit.t - 4.5).abs() < 1e-5);
}

#[test]
fn many_grids_in_one_place_answer_the_first() {
    let session = grids(50_000, |_, corner, key| square(corner, key));
    let beside = trz_ray {
        origin: [1.5, 0.6, 5.0],
        ..DOWN
    };
    let hits = trace(&session, &[DOWN, beside]);
    assert_eq!((hits[0].grid, hits[0].element_id), (0, 0));
    assert_eq!(hits[1].t, f32::INFINITY);
}
