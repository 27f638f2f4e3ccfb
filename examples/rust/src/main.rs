//! A ball that flies past while the shutter is open, through the C ABI from Rust: renders it, then
//! asks with single rays where it is at three times.
//!
//! Usage: `cargo run --release -p hdtrapeze-examples -- IMAGE.exr`
//!
//! The functions are those of `hdtrapeze.h`, linked statically. A program that cannot link Rust
//! code declares them in an `extern "C"` block instead and links `libhdtrapeze.so`.
#![allow(unsafe_code)]

use std::ffi::{CStr, CString};
use std::process::ExitCode;
use std::ptr::{null, null_mut};

use hdtrapeze::*;

/// The last call's message where it failed.
fn check(result: trz_result) -> Result<(), String> {
    if result == TRZ_OK {
        return Ok(());
    }
    // SAFETY: both strings live until the next call on this thread.
    let (name, text) = unsafe {
        (
            CStr::from_ptr(trz_result_name(result)),
            CStr::from_ptr(trz_last_error()),
        )
    };
    Err(format!(
        "{}: {}",
        name.to_string_lossy(),
        text.to_string_lossy()
    ))
}

/// A session that is destroyed when it goes out of scope.
struct Session(*mut trz_session);

impl Session {
    fn new() -> Result<Self, String> {
        let mut session = null_mut();
        // SAFETY: a valid place for the pointer.
        check(unsafe { trz_session_create(&mut session) })?;
        Ok(Session(session))
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // SAFETY: made by `trz_session_create`, destroyed once, no call is running.
        unsafe { trz_session_destroy(self.0) }
    }
}

/// A move along x in USD's layout.
fn translation(x: f64, z: f64) -> [f64; 16] {
    [
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, z, 1.0,
    ]
}

/// A subdivided octahedron of triangles, which Loop subdivision rounds to a ball.
fn add_ball(session: &Session) -> Result<(), String> {
    let corners: [f32; 18] = [
        1., 0., 0., -1., 0., 0., 0., 1., 0., 0., -1., 0., 0., 0., 1., 0., 0., -1.,
    ];
    let triangles: [i32; 24] = [
        0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5,
    ];
    let counts = [3; 8];
    let topology = trz_topology {
        struct_size: size_of::<trz_topology>() as u32,
        scheme: TRZ_SCHEME_LOOP,
        boundary: TRZ_BOUNDARY_EDGE_AND_CORNER,
        face_varying: TRZ_FVAR_CORNERS_PLUS1,
        triangles: TRZ_TRIANGLES_CATMULL_CLARK,
        orientation: TRZ_ORIENTATION_RIGHT_HANDED,
        face_vertex_counts: counts.as_ptr(),
        face_count: counts.len(),
        face_vertex_indices: triangles.as_ptr(),
        index_count: triangles.len(),
        holes: null(),
        hole_count: 0,
        crease_indices: null(),
        crease_index_count: 0,
        crease_lengths: null(),
        crease_count: 0,
        crease_sharpnesses: null(),
        crease_sharpness_count: 0,
        corner_indices: null(),
        corner_count: 0,
        corner_sharpnesses: null(),
        corner_sharpness_count: 0,
    };
    let none = trz_float_samples {
        times: null(),
        sample_count: 0,
        values: null(),
        counts: null(),
    };
    let points = trz_points {
        struct_size: size_of::<trz_points>() as u32,
        times: &0.0,
        sample_count: 1,
        points: &corners.as_ptr(),
        counts: &(corners.len() / 3),
        velocities: none,
        accelerations: none,
        time_codes_per_second: 0.0,
    };
    let times = [-0.25, 0.25];
    let matrices = [translation(-1.0, 0.0), translation(1.0, 0.0)];
    let level = trz_transform_samples {
        times: times.as_ptr(),
        matrices: matrices.as_ptr().cast(),
        count: times.len(),
        turns: 0,
    };
    let mut ball = 0;
    // SAFETY: all pointers are to live values of the lengths that are told.
    unsafe {
        check(trz_mesh_create(session.0, c"/ball".as_ptr(), &mut ball))?;
        check(trz_mesh_set_topology(session.0, ball, &topology))?;
        check(trz_prim_set_points(session.0, ball, &points))?;
        check(trz_prim_set_transform(session.0, ball, &level, 1))?;
        check(trz_prim_set_pick_id(session.0, ball, 7))
    }
}

fn add_camera(session: &Session) -> Result<(), String> {
    // SAFETY: all zero bytes are a valid value of a struct of numbers.
    let mut lens: trz_camera = unsafe { std::mem::zeroed() };
    lens.struct_size = size_of::<trz_camera>() as u32;
    let matrix = translation(0.0, 8.0);
    let level = trz_transform_samples {
        times: &0.0,
        matrices: matrix.as_ptr(),
        count: 1,
        turns: 0,
    };
    let mut camera = 0;
    // SAFETY: all pointers are to live values of the lengths that are told.
    unsafe {
        check(trz_camera_default(&mut lens))?;
        (lens.shutter_open, lens.shutter_close) = (-0.25, 0.25);
        check(trz_camera_create(
            session.0,
            c"/camera".as_ptr(),
            &mut camera,
        ))?;
        check(trz_camera_set(session.0, camera, &lens))?;
        check(trz_prim_set_transform(session.0, camera, &level, 1))?;
        check(trz_session_set_active_camera(session.0, camera))
    }
}

fn render(session: &Session, path: &str) -> Result<(), String> {
    let path_c = CString::new(path).map_err(|error| error.to_string())?;
    // SAFETY: all zero bytes are a valid value of a struct of numbers.
    let mut settings: trz_settings = unsafe { std::mem::zeroed() };
    settings.struct_size = size_of::<trz_settings>() as u32;
    let image = trz_image {
        struct_size: size_of::<trz_image>() as u32,
        r#type: TRZ_IMAGE_EXR,
        pixel_type: TRZ_PIXEL_HALF,
        compression: TRZ_COMPRESSION_PIZ,
        color: TRZ_COLOR_LINEAR,
        aovs: null(),
        aov_count: 0,
        metadata: null(),
        metadata_count: 0,
        vars: null(),
        var_count: 0,
        partial: 0,
    };
    // SAFETY: all pointers are to live values of the lengths that are told.
    unsafe {
        check(trz_settings_default(&mut settings))?;
        (settings.width, settings.height) = (320, 180);
        settings.samples = 32;
        check(trz_session_set_settings(session.0, &settings))?;
        check(trz_render_start(session.0))?;
        check(trz_render_wait(session.0, -1.0, &mut 0))?;
        check(trz_image_write(session.0, path_c.as_ptr(), &image))?;
    }
    println!("wrote {path}");
    Ok(())
}

/// Rays down the middle of the view: the ball is there at half time only.
fn query(session: &Session) -> Result<(), String> {
    let rays = [0.0, 0.5, 1.0].map(|time| trz_ray {
        origin: [0.0, 0.0, 8.0],
        dir: [0.0, 0.0, -1.0],
        time,
        t_min: 0.0,
        t_max: f32::INFINITY,
    });
    // SAFETY: all zero bytes are a valid value of a struct of numbers.
    let mut hits: [trz_hit; 3] = unsafe { std::mem::zeroed() };
    // SAFETY: arrays of the length that is told.
    check(unsafe { trz_trace_rays(session.0, rays.as_ptr(), hits.as_mut_ptr(), rays.len()) })?;
    for (ray, hit) in rays.iter().zip(hits) {
        match hit.t.is_finite() {
            true => println!(
                "time {:.2}: prim {} at t {:.3}",
                ray.time, hit.prim_id, hit.t
            ),
            false => println!("time {:.2}: miss", ray.time),
        }
    }
    Ok(())
}

fn main() -> ExitCode {
    let Some(path) = std::env::args().nth(1) else {
        eprintln!("usage: trapeze-example IMAGE.exr");
        return ExitCode::from(2);
    };
    let run = || {
        let session = Session::new()?;
        add_ball(&session)?;
        add_camera(&session)?;
        render(&session, &path)?;
        query(&session)
    };
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
