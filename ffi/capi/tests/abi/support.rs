//! Sessions and small scenes for the tests.

use std::ffi::{CStr, CString, c_char, c_void};
use std::fs;
use std::path::PathBuf;
use std::ptr::null;
use std::sync::Mutex;

use hdtrapeze::*;

/// A session that is destroyed at the end of its test.
pub struct Session(pub *mut trz_session);

// SAFETY: the ABI promises that a session can be used from any thread.
unsafe impl Send for Session {}
// SAFETY: as above, from several at once.
unsafe impl Sync for Session {}

impl Drop for Session {
    fn drop(&mut self) {
        // SAFETY: a session of trz_session_create, destroyed once.
        unsafe { trz_session_destroy(self.0) }
    }
}

/// A render var of which only the path is authored.
pub fn render_var(path: *const c_char) -> trz_render_var {
    trz_render_var {
        path,
        source_name: null(),
        source_type: null(),
        data_type: null(),
        format: null(),
        name: null(),
        channel_prefix: null(),
    }
}

impl Session {
    pub fn new() -> Self {
        let mut session = std::ptr::null_mut();
        // SAFETY: a valid place.
        ok(unsafe { trz_session_create(&mut session) });
        Session(session)
    }

    /// A session with a camera at (0, 0, 10) that sees a square of 4 x 4 around the origin, and
    /// small settings.
    pub fn with_camera() -> Self {
        let session = Session::new();
        let camera = session.camera("/camera");
        let mut lens = camera_default();
        lens.projection = TRZ_PROJECTION_ORTHOGRAPHIC;
        lens.horizontal_aperture = 4.0;
        lens.vertical_aperture = 4.0;
        let mut matrix = IDENTITY;
        matrix[14] = 10.0;
        let level = trz_transform_samples {
            times: &0.0,
            matrices: matrix.as_ptr(),
            count: 1,
            turns: 0,
        };
        let settings = small_settings(4);
        // SAFETY: pointers to live values.
        unsafe {
            ok(trz_camera_set(session.0, camera, &lens));
            ok(trz_prim_set_transform(session.0, camera, &level, 1));
            ok(trz_session_set_active_camera(session.0, camera));
            ok(trz_session_set_settings(session.0, &settings));
        }
        session
    }

    pub fn mesh(&self, path: &str) -> trz_id {
        let (path, mut id) = (CString::new(path).unwrap(), 0);
        // SAFETY: pointers to live values.
        ok(unsafe { trz_mesh_create(self.0, path.as_ptr(), &mut id) });
        id
    }

    pub fn grids(&self, path: &str) -> trz_id {
        let (path, mut id) = (CString::new(path).unwrap(), 0);
        // SAFETY: pointers to live values.
        ok(unsafe { trz_grids_create(self.0, path.as_ptr(), &mut id) });
        id
    }

    pub fn curves(&self, path: &str) -> trz_id {
        let (path, mut id) = (CString::new(path).unwrap(), 0);
        // SAFETY: pointers to live values.
        ok(unsafe { trz_curves_create(self.0, path.as_ptr(), &mut id) });
        id
    }

    pub fn spheres(&self, path: &str) -> trz_id {
        let (path, mut id) = (CString::new(path).unwrap(), 0);
        // SAFETY: pointers to live values.
        ok(unsafe { trz_spheres_create(self.0, path.as_ptr(), &mut id) });
        id
    }

    pub fn nurbs_curves(&self, path: &str) -> trz_id {
        let (path, mut id) = (CString::new(path).unwrap(), 0);
        // SAFETY: pointers to live values.
        ok(unsafe { trz_nurbs_curves_create(self.0, path.as_ptr(), &mut id) });
        id
    }

    pub fn nurbs_patch(&self, path: &str) -> trz_id {
        let (path, mut id) = (CString::new(path).unwrap(), 0);
        // SAFETY: pointers to live values.
        ok(unsafe { trz_nurbs_patch_create(self.0, path.as_ptr(), &mut id) });
        id
    }

    pub fn implicit(&self, path: &str) -> trz_id {
        let (path, mut id) = (CString::new(path).unwrap(), 0);
        // SAFETY: pointers to live values.
        ok(unsafe { trz_implicit_create(self.0, path.as_ptr(), &mut id) });
        id
    }

    pub fn instancer(&self, path: &str) -> trz_id {
        let (path, mut id) = (CString::new(path).unwrap(), 0);
        // SAFETY: a live session, a string and a place for the id.
        ok(unsafe { trz_instancer_create(self.0, path.as_ptr(), &mut id) });
        id
    }

    pub fn camera(&self, path: &str) -> trz_id {
        let (path, mut id) = (CString::new(path).unwrap(), 0);
        // SAFETY: pointers to live values.
        ok(unsafe { trz_camera_create(self.0, path.as_ptr(), &mut id) });
        id
    }

    /// A bilinear unit square in the plane z = 0, at `offset` in x.
    pub fn square(&self, path: &str, offset: f32) -> trz_id {
        let id = self.mesh(path);
        self.set_square_topology(id, TRZ_SCHEME_BILINEAR);
        self.set_square_points(id, offset);
        id
    }

    pub fn set_square_topology(&self, id: trz_id, scheme: u32) {
        let mut topology = topology();
        topology.scheme = scheme;
        topology.face_vertex_counts = &4;
        topology.face_count = 1;
        let indices = [0, 1, 2, 3];
        topology.face_vertex_indices = indices.as_ptr();
        topology.index_count = 4;
        // SAFETY: pointers to live values.
        ok(unsafe { trz_mesh_set_topology(self.0, id, &topology) });
    }

    pub fn set_square_points(&self, id: trz_id, x: f32) {
        let floats = [
            x,
            0.0,
            0.0,
            x + 1.0,
            0.0,
            0.0,
            x + 1.0,
            1.0,
            0.0,
            x,
            1.0,
            0.0,
        ];
        let points = trz_points {
            struct_size: size_of::<trz_points>() as u32,
            times: &0.0,
            sample_count: 1,
            points: &floats.as_ptr(),
            counts: &4,
            ..no_points()
        };
        // SAFETY: pointers to live values.
        ok(unsafe { trz_prim_set_points(self.0, id, &points) });
    }

    pub fn set_samples(&self, samples: u32) {
        let settings = small_settings(samples);
        // SAFETY: pointers to live values.
        ok(unsafe { trz_session_set_settings(self.0, &settings) });
    }

    pub fn commit(&self) -> trz_result {
        // SAFETY: a live session.
        unsafe { trz_session_commit(self.0) }
    }

    pub fn start(&self) -> trz_result {
        // SAFETY: a live session.
        unsafe { trz_render_start(self.0) }
    }

    pub fn pause(&self, paused: u32) -> trz_result {
        // SAFETY: a live session.
        unsafe { trz_render_pause(self.0, paused) }
    }

    pub fn cancel(&self) -> trz_result {
        // SAFETY: a live session.
        unsafe { trz_render_cancel(self.0) }
    }

    pub fn interrupt(&self) -> trz_result {
        // SAFETY: a live session.
        unsafe { trz_render_interrupt(self.0) }
    }

    /// True where nothing runs any more.
    pub fn wait(&self, seconds: f64) -> bool {
        let mut finished = 7;
        // SAFETY: pointers to live values.
        ok(unsafe { trz_render_wait(self.0, seconds, &mut finished) });
        finished == 1
    }

    pub fn progress(&self) -> trz_progress {
        let mut progress = trz_progress {
            struct_size: size_of::<trz_progress>() as u32,
            state: 99,
            fraction: -1.0,
            samples_done: 0,
            samples_total: 0,
            seconds: 0.0,
            seconds_left: 0.0,
            edits: 0,
            camera_edits: 0,
            view_starts: 0,
            view_readable: 0,
            view_converged: 0,
            view_stopped: 0,
        };
        // SAFETY: pointers to live values.
        ok(unsafe { trz_render_progress(self.0, &mut progress) });
        progress
    }

    pub fn statistics(&self) -> trz_statistics {
        // SAFETY: all zero bytes are a valid value of this struct of numbers.
        let mut statistics: trz_statistics = unsafe { std::mem::zeroed() };
        statistics.struct_size = size_of::<trz_statistics>() as u32;
        // SAFETY: pointers to live values.
        ok(unsafe { trz_statistics_get(self.0, &mut statistics) });
        statistics
    }
}

pub const IDENTITY: [f64; 16] = [
    1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0,
];

pub fn topology() -> trz_topology {
    trz_topology {
        struct_size: size_of::<trz_topology>() as u32,
        scheme: TRZ_SCHEME_CATMULL_CLARK,
        boundary: TRZ_BOUNDARY_EDGE_AND_CORNER,
        face_varying: TRZ_FVAR_CORNERS_PLUS1,
        triangles: TRZ_TRIANGLES_CATMULL_CLARK,
        orientation: TRZ_ORIENTATION_RIGHT_HANDED,
        face_vertex_counts: null(),
        face_count: 0,
        face_vertex_indices: null(),
        index_count: 0,
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
    }
}

pub fn no_points() -> trz_points {
    let none = trz_float_samples {
        times: null(),
        sample_count: 0,
        values: null(),
        counts: null(),
    };
    trz_points {
        struct_size: size_of::<trz_points>() as u32,
        times: null(),
        sample_count: 0,
        points: null(),
        counts: null(),
        velocities: none,
        accelerations: none,
        time_codes_per_second: 0.0,
    }
}

/// A subset of faces without a family.
pub fn subset(path: *const c_char, indices: &[i32]) -> trz_subset {
    trz_subset {
        path,
        family: c"".as_ptr(),
        family_type: TRZ_FAMILY_UNRESTRICTED,
        element_type: TRZ_ELEMENT_FACE,
        indices: if indices.is_empty() {
            null()
        } else {
            indices.as_ptr()
        },
        index_count: indices.len(),
    }
}

pub fn curves() -> trz_curves {
    trz_curves {
        struct_size: size_of::<trz_curves>() as u32,
        basis: TRZ_BASIS_LINEAR,
        wrap: TRZ_WRAP_NONPERIODIC,
        form: TRZ_CURVES_DEFAULT,
        vertex_counts: null(),
        curve_count: 0,
    }
}

const KNOTS: [f64; 4] = [0.0, 0.0, 1.0, 1.0];

/// Two by two points, orders 2.
pub fn bilinear_patch() -> trz_nurbs_patch {
    trz_nurbs_patch {
        struct_size: size_of::<trz_nurbs_patch>() as u32,
        orientation: TRZ_ORIENTATION_RIGHT_HANDED,
        u_order: 2,
        v_order: 2,
        u_vertex_count: 2,
        v_vertex_count: 2,
        u_knots: KNOTS.as_ptr(),
        u_knot_count: 4,
        v_knots: KNOTS.as_ptr(),
        v_knot_count: 4,
        u_range: [0.0; 2],
        v_range: [0.0; 2],
        weights: null(),
        weight_count: 0,
    }
}

/// One curve of two points and order 2.
pub fn line() -> trz_nurbs_curves {
    trz_nurbs_curves {
        struct_size: size_of::<trz_nurbs_curves>() as u32,
        form: TRZ_CURVES_TUBES,
        vertex_counts: &2,
        orders: &2,
        curve_count: 1,
        knots: KNOTS.as_ptr(),
        knot_count: 4,
        ranges: null(),
        range_count: 0,
        weights: null(),
        weight_count: 0,
    }
}

pub fn sphere() -> trz_implicit {
    trz_implicit {
        struct_size: size_of::<trz_implicit>() as u32,
        kind: TRZ_IMPLICIT_SPHERE,
        axis: TRZ_AXIS_Z,
        orientation: TRZ_ORIENTATION_RIGHT_HANDED,
        times: &0.0,
        sizes: [1.0, 0.0, 0.0].as_ptr(),
        sample_count: 1,
    }
}

/// No instances.
pub fn no_instances() -> trz_instancer {
    // SAFETY: zeroes are a valid value of every field.
    let zero: trz_instancer = unsafe { std::mem::zeroed() };
    trz_instancer {
        struct_size: size_of::<trz_instancer>() as u32,
        ..zero
    }
}

pub fn camera_default() -> trz_camera {
    // SAFETY: all zero bytes are a valid value of this struct of numbers.
    let mut camera: trz_camera = unsafe { std::mem::zeroed() };
    camera.struct_size = size_of::<trz_camera>() as u32;
    // SAFETY: pointers to live values.
    ok(unsafe { trz_camera_default(&mut camera) });
    camera
}

pub fn settings_default() -> trz_settings {
    // SAFETY: all zero bytes are a valid value of this struct of numbers.
    let mut settings: trz_settings = unsafe { std::mem::zeroed() };
    settings.struct_size = size_of::<trz_settings>() as u32;
    // SAFETY: pointers to live values.
    ok(unsafe { trz_settings_default(&mut settings) });
    settings
}

pub fn small_settings(samples: u32) -> trz_settings {
    trz_settings {
        width: 32,
        height: 32,
        samples,
        threads: 2,
        ..settings_default()
    }
}

pub const NO_VALUE: trz_value = trz_value {
    kind: TRZ_VALUE_NONE,
    integer: 0,
    numbers: [0.0; 2],
    text: null(),
};

/// A view without a camera, at frame 7.
pub fn view(settings: &trz_settings, aovs: &[*const c_char]) -> trz_view {
    trz_view {
        struct_size: size_of::<trz_view>() as u32,
        aov_count: aovs.len() as u32,
        camera: 0,
        settings,
        aovs: aovs.as_ptr(),
        frame: 7.0,
        settings_path: null(),
        resolution: [0; 2],
        data_window: [0.0; 4],
        pixel_aspect: 0.0,
        conform: null(),
        shapes_view: 0,
        windows_view: 0,
        camera_aspect: 0.0,
        path: null(),
        has_resolution: 0,
        has_data_window: 0,
        has_pixel_aspect: 0,
    }
}

/// A buffer of one row of pixels with a byte each.
pub fn buffer(data: &mut [u8]) -> trz_buffer {
    trz_buffer {
        struct_size: size_of::<trz_buffer>() as u32,
        width: data.len() as u32,
        height: 1,
        component: TRZ_COMPONENT_UNORM8,
        components: 1,
        bottom_up: 0,
        origin: [0, 0],
        clear: null(),
        clear_type: TRZ_NUMBERS_FLOAT32,
        clear_count: 0,
        data: data.as_mut_ptr().cast(),
        bytes: data.len(),
        filled: 0,
        samples: 0,
        render: 0,
        ended: 0,
    }
}

/// A product without name, camera and vars, of 16 x 8 pixels.
pub fn product(path: *const c_char, settings: &trz_settings) -> trz_product {
    trz_product {
        struct_size: size_of::<trz_product>() as u32,
        pixel_aspect: 1.0,
        path,
        r#type: c"raster".as_ptr(),
        name: null(),
        camera: 0,
        camera_path: null(),
        camera_aspect: 0.0,
        resolution: [16, 8],
        data_window: [0.0, 0.0, 1.0, 1.0],
        conform: null(),
        settings,
        vars: null(),
        var_count: 0,
        var_target_count: 0,
    }
}

pub fn planned() -> trz_planned {
    trz_planned {
        struct_size: size_of::<trz_planned>() as u32,
        result: TRZ_OK,
        why: null(),
        path: null(),
        render: 0,
        aov_count: 0,
        aovs: null(),
        settings: null(),
    }
}

pub fn last_error() -> String {
    // SAFETY: a string that is valid until the next call on this thread.
    unsafe { CStr::from_ptr(trz_last_error()) }
        .to_str()
        .expect("messages are UTF-8")
        .to_owned()
}

#[track_caller]
pub fn ok(result: trz_result) {
    assert_eq!(result, TRZ_OK, "{}", last_error());
}

/// The call must fail with this code and a message.
#[track_caller]
pub fn fails(result: trz_result, code: trz_result) -> String {
    let message = last_error();
    assert_eq!(result, code, "{message}");
    assert!(!message.is_empty(), "no message");
    message
}

/// A primvar with one sample of a constant value of three floats, no number of which exists.
pub fn primvar() -> trz_primvar {
    trz_primvar {
        struct_size: size_of::<trz_primvar>() as u32,
        interpolation: TRZ_INTERPOLATION_CONSTANT,
        r#type: TRZ_NUMBERS_FLOAT32,
        role: TRZ_ROLE_NONE,
        width: 3,
        element_size: 1,
        unauthored_index: -1,
        times: &0.0,
        sample_count: 1,
        values: &null(),
        value_counts: &0,
        indices: null(),
        index_counts: null(),
    }
}

/// Messages of a session: level, path, code and text.
#[derive(Default)]
pub struct Received(Mutex<Vec<(u32, String, String, String)>>);

impl Received {
    pub fn user(&self) -> *mut c_void {
        (&raw const *self).cast_mut().cast()
    }

    /// What came since the last call.
    pub fn take(&self) -> Vec<(u32, String, String, String)> {
        std::mem::take(&mut *self.0.lock().unwrap())
    }
}

unsafe extern "C" fn receive(
    user: *mut c_void,
    level: u32,
    path: *const c_char,
    code: *const c_char,
    text: *const c_char,
) {
    // SAFETY: `user` is the `Received` of the test, the strings are valid during the call.
    unsafe {
        let string = |at| CStr::from_ptr(at).to_str().unwrap().to_owned();
        let message = (level, string(path), string(code), string(text));
        (*user.cast::<Received>()).0.lock().unwrap().push(message);
    }
}

pub fn listen(session: &Session, received: &Received, level: u32) {
    // SAFETY: `received` outlives the session's use of it in these tests.
    ok(unsafe { trz_session_set_log(session.0, Some(receive), received.user(), level) });
}

/// A folder of its own for each test, removed at the end.
pub struct Folder(pub PathBuf);

impl Folder {
    pub fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("hdtrapeze-{}-{name}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        Folder(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}
