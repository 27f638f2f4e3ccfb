use super::*;
use crate::scene::{LensSample, TransformSamples, WindowPolicy};
use glam::DMat4;

fn settings(width: u32, height: u32) -> RenderSettings {
    RenderSettings {
        resolution: [width, height],
        ..RenderSettings::default()
    }
}

fn camera(desc: &CameraDesc, settings: &RenderSettings) -> Camera {
    Camera::new(
        desc,
        settings,
        Shutter {
            open: 0.0,
            close: 1.0,
        },
    )
    .unwrap()
    .0
}

fn lens() -> CameraDesc {
    CameraDesc {
        f_stop: 2.0,
        focus_distance: 7.0,
        ..CameraDesc::default()
    }
}

#[test]
fn rays_of_a_pixel_meet_in_the_focal_plane() {
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let camera = camera(
            &CameraDesc {
                projection,
                ..lens()
            },
            &settings(200, 100),
        );
        assert!((camera.lens_radius() - 1.25).abs() < 1e-6);
        let at = |u, v| {
            let ray = camera.ray(Vec2::new(31.0, 77.0), concentric_disk(u, v), 0.0);
            ray.origin + ray.dir * 7.0
        };
        for (u, v) in [(0.1, 0.9), (0.999, 0.5), (0.3, 0.2)] {
            assert!((at(u, v) - at(0.5, 0.5)).length() < 1e-5);
        }
    }
}

#[test]
fn project_inverts_ray_with_offsets_and_every_policy() {
    for projection in [Projection::Perspective, Projection::Orthographic] {
        for policy in [
            WindowPolicy::MatchHorizontally,
            WindowPolicy::MatchVertically,
            WindowPolicy::Fit,
            WindowPolicy::Crop,
            WindowPolicy::DontConform,
        ] {
            let desc = CameraDesc {
                projection,
                horizontal_aperture_offset: 0.3,
                vertical_aperture_offset: -0.2,
                transform: vec![TransformSamples {
                    times: vec![0.0],
                    matrices: vec![DMat4::from_rotation_y(0.7)],
                    ..TransformSamples::default()
                }],
                ..CameraDesc::default()
            };
            let settings = RenderSettings {
                window_policy: policy,
                ..settings(300, 200)
            };
            let camera = camera(&desc, &settings);
            let raster = Vec2::new(12.5, 180.25);
            let ray = camera.ray(raster, Vec2::ZERO, 0.0);
            let p = ray.origin + ray.dir * 5.0;
            let projector = camera.projector(0.0);
            assert!((projector.project(p).unwrap() - raster).length() < 1e-2);
            assert!((projector.to_camera(p).z + 5.0).abs() < 1e-5);
        }
    }
}

#[test]
fn match_horizontally_keeps_the_width() {
    let camera = camera(&CameraDesc::default(), &settings(400, 100));
    let left = camera.ray(Vec2::new(0.0, 50.0), Vec2::ZERO, 0.0).dir;
    assert!((left.x + 2.0955 / 2.0 / 5.0).abs() < 1e-6 && left.y.abs() < 1e-6);
    let top = camera.ray(Vec2::new(200.0, 0.0), Vec2::ZERO, 0.0).dir;
    assert!(
        (top.y - 2.0955 / 2.0 / 5.0 / 4.0).abs() < 1e-6,
        "y points up at the top"
    );
}

#[test]
fn clip_depth_is_the_projection_matrix_depth() {
    let desc = CameraDesc {
        clipping: [0.5, 20.0],
        ..CameraDesc::default()
    };
    let camera = camera(&desc, &settings(10, 10));
    // OpenGL's projection matrix, its z rows, and NDC [-1, 1] to [0, 1].
    let (n, f) = (0.5, 20.0);
    let window_depth = |d: f64| ((f + n) / (f - n) - 2.0 * f * n / ((f - n) * d)) * 0.5 + 0.5;
    for depth in [0.5, 1.0, 3.0, 19.0, 20.0] {
        assert!((f64::from(camera.clip_depth(depth as f32)) - window_depth(depth)).abs() < 1e-6);
    }
}

#[test]
fn a_turning_camera_does_not_shrink() {
    let desc = CameraDesc {
        transform: vec![TransformSamples {
            times: vec![0.0, 1.0],
            matrices: vec![DMat4::IDENTITY, DMat4::from_rotation_y(2.0)],
            ..TransformSamples::default()
        }],
        ..CameraDesc::default()
    };
    let camera = camera(&desc, &settings(10, 10));
    let ray = camera.ray(Vec2::new(5.0, 5.0), Vec2::ZERO, 0.5);
    assert!((ray.dir - Vec3::new(-(1.0f32.sin()), 0.0, -(1.0f32.cos()))).length() < 1e-6);
}

#[test]
fn bad_cameras_get_a_note_and_something_usable() {
    let desc = CameraDesc {
        clipping: [5.0, 5.0],
        focal_length: 0.0,
        f_stop: 2.8,
        exposure_scale: f64::NAN,
        ..CameraDesc::default()
    };
    let (camera, notes) = Camera::new(&desc, &settings(10, 10), Shutter::default()).unwrap();
    assert_eq!(notes.len(), 4, "{notes:?}");
    let ray = camera.ray(Vec2::new(1.0, 1.0), Vec2::ONE, 0.0);
    assert!(ray.dir.is_finite() && ray.t_max > ray.t_min && camera.lens_radius() == 0.0);
    let flat = TransformSamples {
        times: vec![0.0],
        matrices: vec![DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0))],
        ..TransformSamples::default()
    };
    let singular = CameraDesc {
        transform: vec![flat],
        ..CameraDesc::default()
    };
    let (camera, notes) = Camera::new(&singular, &settings(10, 10), Shutter::default()).unwrap();
    assert_eq!(notes.len(), 1);
    assert!(camera.ray(Vec2::ONE, Vec2::ZERO, 0.0).dir.is_finite());
    let no_focus = CameraDesc {
        f_stop: 2.8,
        ..CameraDesc::default()
    };
    let (_, notes) = Camera::new(&no_focus, &settings(10, 10), Shutter::default()).unwrap();
    assert_eq!(notes.len(), 1);
}

fn lens_samples(values: &[(f64, f64, f64)]) -> CameraDesc {
    let sample = |&(time, f_stop, focus_distance): &(f64, f64, f64)| LensSample {
        time,
        f_stop,
        focus_distance,
        ..CameraDesc::default().lens()
    };
    CameraDesc {
        lens_samples: values.iter().map(sample).collect(),
        ..CameraDesc::default()
    }
}

fn radius(camera: &Camera, time: f32) -> f32 {
    camera.lens(time).radius
}

#[test]
fn a_pinhole_that_opens_has_a_radius_that_grows() {
    // The f-number has no path from 0: the radius has. The pinhole need not know its focus.
    let camera = camera(
        &lens_samples(&[(0.0, 0.0, 0.0), (1.0, 2.0, 7.0)]),
        &settings(10, 10),
    );
    assert!(camera.lens_changes() && camera.is_moving());
    for time in [0.0, 0.25, 0.5, 1.0] {
        assert!((radius(&camera, time) - 1.25 * time).abs() < 1e-6);
        assert_eq!(camera.lens(time).focus_distance, 7.0);
    }
    assert_eq!(camera.lens_radius(), 1.25);
    let ray = camera.ray(Vec2::ONE, Vec2::ONE, 1.0e-7);
    assert!(ray.origin.is_finite() && ray.dir.is_finite());
}

#[test]
fn lenses_between_samples_follow_f_number_and_focal_length() {
    let mut desc = lens_samples(&[(1.0, 2.0, 4.0), (-1.0, 6.0, 8.0)]);
    desc.lens_samples[0].focal_length = 15.0;
    let camera = camera(&desc, &settings(10, 10));
    // The shutter is the second half: f-numbers 4 to 2, focal lengths 10 to 15, focus 6 to 4.
    for (time, f_stop, focal, focus) in [(0.0, 4.0, 10.0, 6.0), (0.5, 3.0, 12.5, 5.0)] {
        assert!((radius(&camera, time) - focal / (2.0 * f_stop)).abs() < 1e-5);
        assert!((camera.lens(time).focus_distance - focus).abs() < 1e-6);
        let half = camera.lens(time).window.size().x / 2.0;
        assert!((half - 2.0955 / 2.0 / focal).abs() < 1e-6);
    }
    assert_eq!(camera.key_times(), [0.0, 1.0]);
    // Dicing sees the longest lens where it is.
    let scale = |time| camera.raster_view(time).scale.x;
    assert!((scale(1.0) / scale(0.0) - 1.5).abs() < 1e-5);
}

#[test]
fn bad_lens_samples_get_one_note() {
    let nan = f64::NAN;
    let cases = [
        (vec![(0.0, 2.0, 0.0), (1.0, 3.0, -1.0)], "focusDistance"),
        (vec![(0.0, nan, 5.0), (1.0, -2.0, 5.0)], "gives no lens"),
        (vec![(nan, 2.0, 5.0)], "no time"),
    ];
    for (samples, words) in cases {
        let shutter = Shutter {
            open: 0.0,
            close: 1.0,
        };
        let desc = lens_samples(&samples);
        let (camera, notes) = Camera::new(&desc, &settings(10, 10), shutter).unwrap();
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(notes[0].contains(words), "{notes:?}");
        assert!(!camera.lens_changes() && camera.lens_radius() == 0.0);
    }
}

#[test]
fn sizes_that_f32_cannot_hold_are_refused() {
    for (aperture, focal_length) in [(1.0e300, 5.0), (2.0, 1.0e-200), (1.0e-300, 5.0)] {
        let desc = CameraDesc {
            horizontal_aperture: aperture,
            focal_length,
            ..CameraDesc::default()
        };
        let (camera, notes) = Camera::new(&desc, &settings(10, 10), Shutter::default()).unwrap();
        assert_eq!(notes.len(), 1, "{notes:?}");
        let dir = camera.ray(Vec2::ONE, Vec2::ZERO, 0.0).dir;
        assert!(dir.is_finite() && dir.x != 0.0);
    }
}

#[test]
fn a_little_overscan_dices_as_none_does_and_more_as_image() {
    let with = |data_window| RenderSettings {
        data_window: Some(data_window),
        ..settings(200, 100)
    };
    let view =
        |settings: &RenderSettings| camera(&CameraDesc::default(), settings).raster_view(0.0);
    let plain = view(&settings(200, 100));
    for window in [[50, 20, 60, 30], [-10, -5, 210, 105]] {
        let view = view(&with(window));
        assert_eq!((view.size, view.centre), (plain.size, plain.centre));
    }
    let wide = view(&with([-60, 0, 200, 300]));
    assert_eq!(wide.size, Vec2::new(260.0, 300.0));
    assert_eq!(wide.centre, plain.centre + Vec2::new(60.0, 0.0));
    assert_eq!(wide.scale, plain.scale);
}
