use super::*;
use crate::scene::{TransformSamples, WindowPolicy};
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
            assert!((camera.project(p, 0.0).unwrap() - raster).length() < 1e-2);
            assert!((camera.to_camera(p, 0.0).z + 5.0).abs() < 1e-5);
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
