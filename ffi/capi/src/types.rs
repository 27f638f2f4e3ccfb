//! Structs of the C ABI, with C's names.
//!
//! A struct that begins with `struct_size` is versioned: the caller sets it to `sizeof` before any
//! call, also where the library fills the struct. Later versions add fields at the end only. A
//! smaller size is an older version and is accepted down to the first one; a larger size is a newer
//! version and is accepted where the fields unknown here are zero bytes. Structs without
//! `struct_size` are elements of arrays or fields of other structs, and never change.
#![allow(non_camel_case_types)]

use std::ffi::{c_char, c_void};
use std::sync::Arc;

use hdtrapeze_delegate::{RenderLoop, Session};

/// A session: scene, renderer and images. Made by trz_session_create.
pub struct trz_session {
    // First, since it ends before what it renders.
    pub(crate) render_loop: RenderLoop,
    pub(crate) session: Arc<Session>,
}

impl trz_session {
    pub(crate) fn new(session: Session) -> Self {
        let session = Arc::new(session);
        Self {
            render_loop: RenderLoop::new(Arc::clone(&session)),
            session,
        }
    }
}

/// A prim or camera of one session; 0 is none; never reused.
pub type trz_id = u64;

/// TRZ_OK or one of TRZ_ERROR_*; codes are never reused.
pub type trz_result = i32;

/// Receives messages. prim_path and code are empty where a message is not about a prim; no pointer
/// is null or outlives the call. Called from any thread, one call at a time for a session. Must not
/// throw, and must not call the session: calls that would wait for themselves return
/// TRZ_ERROR_BUSY.
pub type trz_log_fn = Option<
    unsafe extern "C" fn(
        user: *mut c_void,
        level: u32,
        prim_path: *const c_char,
        code: *const c_char,
        text: *const c_char,
    ),
>;

/// Evaluates a transform at a time code relative to the frame: writes a matrix, 16 doubles, USD layout.
/// Called on the thread that asks, before the call returns. Must not throw.
pub type trz_evaluate_fn =
    Option<unsafe extern "C" fn(user: *mut c_void, time: f64, matrix: *mut f64)>;

/// Matrix samples of one level of the hierarchy.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_transform_samples {
    /// count times, in time codes relative to the frame, in any order.
    pub times: *const f64,
    /// count * 16; USD layout: row-major, row vectors; local to parent.
    pub matrices: *const f64,
    /// Number of samples.
    pub count: usize,
    /// 0: between samples, matrices are interpolated entry by entry, so what turns there is flattened.
    /// 1: rotations turn at constant speed about the level's own origin, by less than half a turn from
    /// sample to sample (polar decomposition), where the stretch and the place are the same at two samples,
    /// or a third between them shows that the place goes linearly. All else is interpolated as with 0.
    /// Cameras always turn. Plus 2: the sample at the frame shows whether they do: where it lies on the line
    /// between the samples before and after it, it is left out, and all is interpolated as with 0.
    pub turns: u32,
}

/// A path that the host can evaluate at any time, as far as it has: of a transform, of points, or of
/// several transforms that are to have the same samples.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_path {
    /// sizeof(trz_path).
    pub struct_size: u32,
    /// TRZ_PATH_*.
    pub of: u32,
    /// known_count times at which it has been evaluated, none twice.
    pub times: *const f64,
    /// The first so many of the times, ascending, are those where the path may have corners, its ends
    /// included; the others are what trz_path_next asked for. At least 1.
    pub start_count: usize,
    /// Number of times.
    pub known_count: usize,
    /// known_count arrays of element_count matrices or points.
    pub values: *const *const f64,
    /// Matrices or points at each time.
    pub element_count: usize,
}

/// Topology and subdivision options of a mesh, as authored. Contradictions between counts and
/// indices are found at commit, repaired or dropped with a warning.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_topology {
    /// sizeof(trz_topology).
    pub struct_size: u32,
    /// TRZ_SCHEME_*.
    pub scheme: u32,
    /// TRZ_BOUNDARY_*.
    pub boundary: u32,
    /// TRZ_FVAR_*.
    pub face_varying: u32,
    /// TRZ_TRIANGLES_*.
    pub triangles: u32,
    /// TRZ_ORIENTATION_*.
    pub orientation: u32,
    /// Vertices of each face.
    pub face_vertex_counts: *const i32,
    /// Number of faces.
    pub face_count: usize,
    /// Points of the faces, concatenated.
    pub face_vertex_indices: *const i32,
    /// Number of face-vertices.
    pub index_count: usize,
    /// Faces that are holes.
    pub holes: *const i32,
    /// Number of holes.
    pub hole_count: usize,
    /// Points of the creases, concatenated.
    pub crease_indices: *const i32,
    /// Length of crease_indices.
    pub crease_index_count: usize,
    /// Points of each crease.
    pub crease_lengths: *const i32,
    /// Number of creases.
    pub crease_count: usize,
    /// One a crease, or one an edge.
    pub crease_sharpnesses: *const f32,
    /// Length of crease_sharpnesses.
    pub crease_sharpness_count: usize,
    /// Sharp points.
    pub corner_indices: *const i32,
    /// Number of sharp points.
    pub corner_count: usize,
    /// One a sharp point.
    pub corner_sharpnesses: *const f32,
    /// Length of corner_sharpnesses.
    pub corner_sharpness_count: usize,
}

/// A subset of a mesh (UsdGeomSubset), as authored.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_subset {
    /// UTF-8; names it in messages.
    pub path: *const c_char,
    /// familyName, UTF-8; empty where it has none.
    pub family: *const c_char,
    /// TRZ_FAMILY_*; that of a family's first subset counts.
    pub family_type: u32,
    /// TRZ_ELEMENT_*: what the indices number. Only subsets of faces are used.
    pub element_type: u32,
    /// Its elements, at the frame.
    pub indices: *const i32,
    /// Number of indices.
    pub index_count: usize,
}

/// Arrays of values at several times, of as many floats a value as the field that holds them says.
/// All zero: none.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_float_samples {
    /// sample_count times, in time codes relative to the frame, in any order.
    pub times: *const f64,
    /// Number of samples.
    pub sample_count: usize,
    /// sample_count arrays of counts[i] values.
    pub values: *const *const f32,
    /// Values of each sample.
    pub counts: *const usize,
}

/// Point samples of a mesh, of curves or spheres, object space.
///
/// Without velocities, points go on straight lines from sample to sample. With velocities, the
/// sample at or before the frame (the first one where all are later) moves on: dt seconds after its
/// own time a point is at p + dt (v + dt a / 2). As in USD, velocities count where their samples
/// before and after the frame have the times of those of the points, and are as many; accelerations
/// where theirs are as those of the velocities. So a host gives the samples around the frame beside
/// those around the shutter, and no velocities for points without time samples.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_points {
    /// sizeof(trz_points).
    pub struct_size: u32,
    /// sample_count times, in time codes relative to the frame, in any order.
    pub times: *const f64,
    /// Number of samples.
    pub sample_count: usize,
    /// sample_count arrays of 3 * counts[i] floats.
    pub points: *const *const f32,
    /// Points of each sample.
    pub counts: *const usize,
    /// Scene units a second, 3 floats a point.
    pub velocities: trz_float_samples,
    /// Scene units a second squared, 3 floats a point.
    pub accelerations: trz_float_samples,
    /// Time codes a second; above 0 where there are velocities.
    pub time_codes_per_second: f64,
}

/// A primvar of numbers. Floats are interpolated over the surface and between samples. Integers are
/// not: a place has the value of the nearest corner of its face, a time that of the sample before.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_primvar {
    /// sizeof(trz_primvar).
    pub struct_size: u32,
    /// TRZ_INTERPOLATION_*.
    pub interpolation: u32,
    /// TRZ_NUMBERS_*. All are kept in 32 bits; integers beyond become the nearest, with a warning;
    /// unsigned ones keep their bits.
    pub r#type: u32,
    /// TRZ_ROLE_*.
    pub role: u32,
    /// Numbers of the type, 1 to 16: 3 of a colour, 16 of a matrix.
    pub width: u32,
    /// elementSize as authored, else 1: so many of the type are one value. Above 16 numbers a value,
    /// or below 1, the primvar is ignored with a warning.
    pub element_size: i32,
    /// unauthoredValuesIndex as authored, else -1: an index that may point at nothing.
    pub unauthored_index: i32,
    /// sample_count times, in time codes relative to the frame, in any order; both values and
    /// indices may differ between them.
    pub times: *const f64,
    /// Number of samples, at least 1.
    pub sample_count: usize,
    /// sample_count arrays of value_counts[i] * width numbers.
    pub values: *const *const c_void,
    /// Of the type, in each sample.
    pub value_counts: *const usize,
    /// sample_count arrays of indices into the values, or NULL: not indexed.
    pub indices: *const *const i32,
    /// Indices of each sample; 0: it is not indexed. Ignored where indices is NULL.
    pub index_counts: *const usize,
}

/// Arrays of matrices at several times. All zero: none.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_matrix_samples {
    /// sample_count times, in time codes relative to the frame, in any order.
    pub times: *const f64,
    /// Number of samples.
    pub sample_count: usize,
    /// sample_count arrays of counts[i] matrices, 16 doubles each; USD layout: row-major, row vectors.
    pub values: *const *const f64,
    /// Matrices of each sample.
    pub counts: *const usize,
}

/// Instances of an instancer: raw arrays of UsdGeomPointInstancer, or matrices of native instances
/// (Hydra's hydra:instanceTransforms). Each array has one value an instance, or is left out (all zero).
///
/// A point p of a part of a prototype goes to
///     p * transform of the part * matrix * scale * orientation * position * transform of the instancer
/// and on in the same way where the instancer is part of another's prototype.
///
/// Without rates, arrays are interpolated between their own samples: orientations along great arcs,
/// matrices as matrices_turn says, others linearly. With velocities or angular_velocities, every array stays at its sample at or
/// before the frame; dt seconds after it, an instance is at p + dt (v + dt a / 2), and has turned by
/// dt |w| degrees about w, after its orientation. As in USD, rates count where their samples before
/// and after the frame have the times of those of the positions (orientations), and are as many; so a
/// host gives the samples around the frame beside those around the shutter, and no rates for arrays
/// without time samples.
///
/// Samples with another number of values than instances are not interpolated with.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_instancer {
    /// sizeof(trz_instancer).
    pub struct_size: u32,
    /// Number of instances.
    pub instance_count: usize,
    /// Number of prototypes: instances of others are left out with a warning. 0: not known.
    pub prototype_count: usize,
    /// Prototype number of each instance (protoIndices); none: all are of prototype 0.
    pub prototypes: *const i32,
    /// Length of prototypes.
    pub prototype_index_count: usize,
    /// 0 for instances that are not there (invisibleIds and inactiveIds), else 1; none: all are.
    pub mask: *const u8,
    /// Length of mask.
    pub mask_count: usize,
    /// What the instanceId AOV shows for each instance; none: 0, 1, 2... Parts of nested instancers show
    /// the flat number of both instances, the outer one first: outer * inner instance_count + inner.
    pub ids: *const i32,
    /// Length of ids.
    pub id_count: usize,
    /// Scene units, 3 floats an instance.
    pub positions: trz_float_samples,
    /// Unit quaternions, 4 floats an instance: x, y, z, w (the real part last, as in USD's memory).
    pub orientations: trz_float_samples,
    /// Factors, 3 floats an instance.
    pub scales: trz_float_samples,
    /// Applied before the scale.
    pub matrices: trz_matrix_samples,
    /// Scene units a second, 3 floats an instance.
    pub velocities: trz_float_samples,
    /// Scene units a second squared, 3 floats an instance; used with velocities only.
    pub accelerations: trz_float_samples,
    /// Degrees a second about the vector's own direction, 3 floats an instance; used with orientations
    /// only.
    pub angular_velocities: trz_float_samples,
    /// Time codes a second; above 0 where there are rates.
    pub time_codes_per_second: f64,
    /// How matrices are interpolated; see turns of trz_transform_samples.
    pub matrices_turn: u32,
    /// In place of prototypes, prototype_count lists of the instances of each, as Hydra has them, or NULL.
    /// Then instanceId shows places in these lists, flat numbers of nested instancers count their lengths,
    /// and instance_count may be 0: as many as have a position or a matrix.
    pub lists: *const *const i32,
    /// Length of each list. Ignored where lists is NULL.
    pub list_counts: *const usize,
}

/// Basis, wrap and counts of curves. The primvar widths gives their diameters (1 where there is none),
/// normals makes flat ribbons of them that lie across these. Counts that basis and wrap cannot have
/// are found at commit.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_curves {
    /// sizeof(trz_curves).
    pub struct_size: u32,
    /// TRZ_BASIS_*.
    pub basis: u32,
    /// TRZ_WRAP_*.
    pub wrap: u32,
    /// TRZ_CURVES_*: what they are rendered as where they have no normals.
    pub form: u32,
    /// Points of each curve.
    pub vertex_counts: *const i32,
    /// Number of curves.
    pub curve_count: usize,
}

/// Grids that are already diced, object space.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_grids {
    /// sizeof(trz_grids).
    pub struct_size: u32,
    /// key_count times, in time codes relative to the frame.
    pub times: *const f64,
    /// Number of position keys.
    pub key_count: usize,
    /// grid_count * 2: nu, nv; 1 to 16.
    pub rates: *const u16,
    /// elementId of each grid, or NULL for the grid's number.
    pub elements: *const u32,
    /// Number of grids.
    pub grid_count: usize,
    /// For each grid, each key, (nv+1) rows of (nu+1) xyz.
    pub positions: *const f32,
    /// Vertices over all grids and keys (3 floats each).
    pub position_count: usize,
}

/// A NURBS patch; its points come by trz_prim_set_points, those along u following each other. Numbers
/// are as authored: what does not fit is found at commit.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_nurbs_patch {
    /// sizeof(trz_nurbs_patch).
    pub struct_size: u32,
    /// TRZ_ORIENTATION_*.
    pub orientation: u32,
    /// Degree plus one, along u.
    pub u_order: i32,
    /// Degree plus one, along v.
    pub v_order: i32,
    /// Points along u.
    pub u_vertex_count: i32,
    /// Points along v.
    pub v_vertex_count: i32,
    /// Knots along u.
    pub u_knots: *const f64,
    /// Number of knots along u: u_vertex_count + u_order.
    pub u_knot_count: usize,
    /// Knots along v.
    pub v_knots: *const f64,
    /// Number of knots along v: v_vertex_count + v_order.
    pub v_knot_count: usize,
    /// Parameters from and to which it is rendered; 0, 0 for all.
    pub u_range: [f64; 2],
    /// Parameters from and to which it is rendered; 0, 0 for all.
    pub v_range: [f64; 2],
    /// Weights of the points, which are not multiplied by them.
    pub weights: *const f64,
    /// Number of weights; 0: all are 1.
    pub weight_count: usize,
}

/// NURBS curves; their points come by trz_prim_set_points. Numbers are as authored: what does not fit
/// is found at commit.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_nurbs_curves {
    /// sizeof(trz_nurbs_curves).
    pub struct_size: u32,
    /// TRZ_CURVES_*.
    pub form: u32,
    /// curve_count: points of each curve.
    pub vertex_counts: *const i32,
    /// curve_count: degree plus one of each curve.
    pub orders: *const i32,
    /// Number of curves.
    pub curve_count: usize,
    /// Knots of the curves, concatenated: each has as many as points and order.
    pub knots: *const f64,
    /// Number of knots.
    pub knot_count: usize,
    /// range_count * 2: parameters of each curve from and to which it is rendered; 0, 0 for all.
    pub ranges: *const f64,
    /// Number of ranges; 0: all of each curve.
    pub range_count: usize,
    /// Weights of the points, which are not multiplied by them.
    pub weights: *const f64,
    /// Number of weights; 0: all are 1.
    pub weight_count: usize,
}

/// Lens, film back and exposure at one instant; fields as in trz_camera.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_lens_sample {
    /// Time codes relative to the frame.
    pub time: f64,
    /// Width of the film back.
    pub horizontal_aperture: f64,
    /// Height of the film back.
    pub vertical_aperture: f64,
    /// Offset of the film back to the right.
    pub horizontal_aperture_offset: f64,
    /// Offset of the film back upwards.
    pub vertical_aperture_offset: f64,
    /// Focal length.
    pub focal_length: f64,
    /// Distance from the lens to the plane in focus.
    pub focus_distance: f64,
    /// f-number; 0 is a pinhole.
    pub f_stop: f64,
    /// Linear factor on radiance.
    pub exposure_scale: f64,
}

/// An implicit prim about the origin: a cube, sphere and so on. Sizes go linearly from sample to
/// sample.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_implicit {
    /// sizeof(trz_implicit).
    pub struct_size: u32,
    /// TRZ_IMPLICIT_*.
    pub kind: u32,
    /// TRZ_AXIS_*; cubes and spheres have none.
    pub axis: u32,
    /// TRZ_ORIENTATION_*; left-handed turns the outside in.
    pub orientation: u32,
    /// sample_count times, in time codes relative to the frame, in any order.
    pub times: *const f64,
    /// sample_count * 3: the sizes that the kind names; the rest is ignored.
    pub sizes: *const f64,
    /// Number of samples.
    pub sample_count: usize,
}

/// A thin-lens camera that looks down its local -z with +y up. All lengths are scene units
/// (UsdGeomCamera's apertures and focal length are tenths: multiply by 0.1). Numbers are checked at
/// commit: those that cannot be used are replaced, with a warning that names the camera.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_camera {
    /// sizeof(trz_camera).
    pub struct_size: u32,
    /// TRZ_PROJECTION_*.
    pub projection: u32,
    /// Width of the film back.
    pub horizontal_aperture: f64,
    /// Height of the film back.
    pub vertical_aperture: f64,
    /// Offset of the film back to the right.
    pub horizontal_aperture_offset: f64,
    /// Offset of the film back upwards.
    pub vertical_aperture_offset: f64,
    /// Focal length.
    pub focal_length: f64,
    /// Distance from the lens to the plane in focus.
    pub focus_distance: f64,
    /// f-number; 0 is a pinhole. Lens radius = focal_length / (2 f_stop).
    pub f_stop: f64,
    /// Nearest visible depth.
    pub clipping_near: f64,
    /// Farthest visible depth.
    pub clipping_far: f64,
    /// Shutter open, time codes relative to the frame.
    pub shutter_open: f64,
    /// Shutter close, time codes relative to the frame.
    pub shutter_close: f64,
    /// Linear factor on radiance (2^EV); 1 for none.
    pub exposure_scale: f64,
    /// Blades of the lens' opening, that is corners; below 3 it is round. Its area is that of the
    /// round opening of the same f_stop, whatever its shape.
    pub aperture_blades: u32,
    /// TRZ_SHUTTER_*: how the points of shutter_curve are joined.
    pub shutter_curve_type: u32,
    /// Degrees by which blades are turned, counter-clockwise as the camera looks; at 0 a corner
    /// points up.
    pub aperture_rotation: f64,
    /// Width over height of the opening, 0.001 to 1000; 1: as wide as high.
    pub aperture_ratio: f64,
    /// 0: blades have straight edges; 1: the opening is round.
    pub aperture_roundness: f64,
    /// shutter_curve_count pairs: position (0 open to 1 close, ascending), openness (0 or above). It
    /// says how instants count, not how bright the image is. Held before the first and after the
    /// last position.
    pub shutter_curve: *const f64,
    /// Number of pairs; 0: fully open throughout.
    pub shutter_curve_count: usize,
    /// clipping_plane_count times a b c d in camera space: points with a x + b y + c z + d < 0 are
    /// not seen by the camera.
    pub clipping_planes: *const f64,
    /// Number of planes.
    pub clipping_plane_count: usize,
    /// The lens at lens_sample_count instants, in any order, in place of the fields above where
    /// there are any. Each number is interpolated linearly between samples, and held outside.
    pub lens_samples: *const trz_lens_sample,
    /// Number of lens samples; 0: the lens does not change.
    pub lens_sample_count: usize,
}

/// Settings of a render.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_settings {
    /// sizeof(trz_settings).
    pub struct_size: u32,
    /// Image width, 1 to 65536 pixels.
    pub width: u32,
    /// Image height, 1 to 65536 pixels.
    pub height: u32,
    /// Pixels to render: x0 y0 x1 y1, half open, relative to the image's top left, y down; all 0
    /// for the image. Inside the image it is a crop; what lies outside is overscan. The image and
    /// this window together span at most 65536 pixels.
    pub data_window: [i32; 4],
    /// Pixel width over height.
    pub pixel_aspect: f32,
    /// TRZ_WINDOW_*.
    pub window_policy: u32,
    /// Samples a pixel, 1 to 1048576.
    pub samples: u32,
    /// Micropolygon edge in pixels, above 0.
    pub shading_rate: f32,
    /// TRZ_FILTER_*.
    pub filter: u32,
    /// Filter diameter in pixels, up to 64; 0: the filter's own.
    pub filter_width: f32,
    /// Seed of all sample patterns.
    pub seed: u32,
    /// Threads, up to 4096; 0: all cores.
    pub threads: u32,
    /// 1: shutter_open and shutter_close below in place of the camera's.
    pub override_shutter: u32,
    /// Time codes relative to the frame.
    pub shutter_open: f64,
    /// Time codes relative to the frame, not before shutter_open.
    pub shutter_close: f64,
    /// 1: everything stands still at shutter open.
    pub disable_motion_blur: u32,
    /// 1: the lens is a pinhole.
    pub disable_defocus: u32,
    /// 1: a light at the camera where the scene has none.
    pub camera_light: u32,
    /// Part of the shutter that is sampled, in [0, 1]; 0, 1 for all. Dicing still sees all of it.
    pub time_window: [f32; 2],
    /// 1: every sample goes through lens_point.
    pub fix_lens: u32,
    /// A point of the unit disk, in units of the round lens' radius.
    pub lens_point: [f32; 2],
    /// Most micropolygons that dicing may make; beyond it rates are coarsened with a warning. 0:
    /// the default.
    pub max_micropolygons: u64,
    /// TRZ_BACKEND_*.
    pub backend: u32,
    /// TRZ_CURVES_*: what curves without normals are rendered as, where their prim does not say.
    pub curves: u32,
    /// 1: grids of an earlier commit are kept where dicing anew would gain little: while nearly all
    /// micropolygons of prims that appear once have at most twice the area that is asked for, and none are far finer. A camera that moves then
    /// shows sooner; bits depend on what was rendered before. Grids of hidden prims stay in memory, too, for
    /// when they are shown again. 0, the default: neither.
    pub keep_finer: u32,
    /// TRZ_CULL_*: the sides of meshes, grids, NURBS patches and implicit prims that rays of the image
    /// pass through, as if they were not there. Fronts are as each prim's orientation has them, and
    /// stay in front where transforms mirror. Curves and points are always seen.
    pub cull: u32,
    /// 1: what may be hidden is diced when a ray first comes near it, and not at all where none does; the
    /// image is the same. 0: everything is diced by the commit.
    pub occlusion_culling: u32,
    /// TRZ_COMPRESSION_*: of the EXR files of products.
    pub compression: u32,
    /// TRZ_PIXEL_*: of the EXR files of products; ids and depths are always 32 bits.
    pub pixel_type: u32,
    /// Time codes a second that a setting tells, 0 for none: for hosts that do not know their stage's,
    /// which prims with velocities need. A render does not.
    pub time_codes_per_second: f64,
}

/// A value of a setting.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_value {
    /// TRZ_VALUE_*: which of the fields below counts.
    pub kind: u32,
    /// TRZ_VALUE_INTEGER; TRZ_VALUE_BOOL: 0 or 1.
    pub integer: i64,
    /// TRZ_VALUE_PAIR; TRZ_VALUE_REAL: the first one.
    pub numbers: [f64; 2],
    /// TRZ_VALUE_TEXT, UTF-8.
    pub text: *const c_char,
}

/// A setting that has a name, for the panels of hosts and for attributes of RenderSettings and
/// RenderProduct prims. Texts are owned by the library, valid for ever.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_setting {
    /// sizeof(trz_setting).
    pub struct_size: u32,
    /// 1 where prims have it, too; 0: the host's alone.
    pub of_prims: u32,
    /// Such as trapeze:samples.
    pub name: *const c_char,
    /// What hosts show it as; NULL: it is not shown.
    pub label: *const c_char,
    /// Its value where nobody has an opinion; TRZ_VALUE_NONE: none.
    pub fallback: trz_value,
    /// TRZ_VALUE_*: what its values are. Where they are TRZ_VALUE_REAL, whole numbers do, too.
    pub kind: u32,
    /// The least and the most that a number, or each of a pair, can be.
    pub range: [f64; 2],
    /// The words that a text can be, with spaces between; NULL for what is no text.
    pub words: *const c_char,
    /// What it is, for helps and tool tips: a part of a sentence.
    pub doc: *const c_char,
}

/// What is rendered, besides the scene.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_view {
    /// sizeof(trz_view).
    pub struct_size: u32,
    /// Number of names.
    pub aov_count: u32,
    /// The camera to render through, 0 for none.
    pub camera: trz_id,
    /// Settings of the render.
    pub settings: *const trz_settings,
    /// Names of the AOVs to render.
    pub aovs: *const *const c_char,
    /// The frame, for names and metadata of files; not finite at the default time.
    pub frame: f64,
    /// Path of the RenderSettings prim that products are of; NULL for none.
    pub settings_path: *const c_char,
    /// Its resolution, for products whose own cannot be; the view's where has_resolution is 0.
    pub resolution: [i32; 2],
    /// The same of its dataWindowNDC, as a product's; all of the image where has_data_window is 0.
    pub data_window: [f32; 4],
    /// The same of its pixelAspectRatio; 1 where has_pixel_aspect is 0.
    pub pixel_aspect: f32,
    /// The same of its aspectRatioConformPolicy; NULL where that is not known: then expandAperture.
    pub conform: *const c_char,
    /// 1: the view's own image has this resolution, pixel aspect and policy, in place of its settings'.
    pub shapes_view: u32,
    /// 1: the same of this data window.
    pub windows_view: u32,
    /// Width over height of the film back of the view's camera; 0 where it is not known.
    pub camera_aspect: f64,
    /// The file that the host itself writes of the view, which a product may have taken; NULL for none.
    pub path: *const c_char,
    /// 1: resolution is known. What cannot be of what is known is told, and is as the schema has it.
    pub has_resolution: u32,
    /// The same of data_window.
    pub has_data_window: u32,
    /// The same of pixel_aspect.
    pub has_pixel_aspect: u32,
}

/// A render product (UsdRenderProduct) as authored, and what its image is rendered with. Texts are
/// UTF-8; NULL where nothing is authored.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_product {
    /// sizeof(trz_product).
    pub struct_size: u32,
    /// pixelAspectRatio.
    pub pixel_aspect: f32,
    /// Path of the prim.
    pub path: *const c_char,
    /// productType.
    pub r#type: *const c_char,
    /// productName: a path with .exr or .png at its end. Places for the frame (`####`, `##.##`, `<F4>`, `$F4`,
    /// `${F4}`, `%04d`) are filled in.
    pub name: *const c_char,
    /// The camera to render through; 0 where there is none at camera_path.
    pub camera: trz_id,
    /// Path of the camera.
    pub camera_path: *const c_char,
    /// Width over height of the camera's film back; 0 where it is not known.
    pub camera_aspect: f64,
    /// Width and height.
    pub resolution: [i32; 2],
    /// dataWindowNDC: xmin, ymin, xmax, ymax, y up; 0 0 1 1 is the image.
    pub data_window: [f32; 4],
    /// aspectRatioConformPolicy.
    pub conform: *const c_char,
    /// Settings of the render, but for the shape of the image.
    pub settings: *const trz_settings,
    /// orderedVars.
    pub vars: *const trz_render_var,
    /// Number of vars.
    pub var_count: usize,
    /// How many prims orderedVars names, also such as are no vars. 0, and no vars: color is written.
    pub var_target_count: usize,
}

/// What is made of products: which of them share renders, and where they are written. Made by
/// trz_plan_create.
pub struct trz_plan {
    pub(crate) files: Vec<crate::plan::PlannedFile>,
}

/// What becomes of a product, or of the host's own image. Pointers are the plan's, valid as long as it is.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_planned {
    /// sizeof(trz_planned).
    pub struct_size: u32,
    /// TRZ_OK. Or why it is not written: TRZ_ERROR_UNSUPPORTED, no such thing is (its productType);
    /// TRZ_ERROR_INVALID_ARGUMENT, what it asks for cannot be; TRZ_ERROR_IO, its file cannot be written.
    /// Then all below is 0, but for why.
    pub result: trz_result,
    /// The reason, of which a message has told; empty where it is written.
    pub why: *const c_char,
    /// Its file; empty for the host's own image.
    pub path: *const c_char,
    /// Number of its render, which those that agree in camera and settings share.
    pub render: u32,
    /// Number of names.
    pub aov_count: u32,
    /// Names of the AOVs of that render.
    pub aovs: *const *const c_char,
    /// Settings of that render, with the shape of the image.
    pub settings: *const trz_settings,
}

/// A host's own buffer for an AOV, and what it shows. A host sets what it is like, and all fields below
/// to 0 whenever that, the data or the AOV is another.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_buffer {
    /// sizeof(trz_buffer).
    pub struct_size: u32,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// TRZ_COMPONENT_*.
    pub component: u32,
    /// Components a pixel, 1 to 4. Those that the AOV lacks are 0, but for the fourth beside three: 1.
    pub components: u32,
    /// 1: rows are from the bottom up; 0: from the top down.
    pub bottom_up: u32,
    /// The image's pixel that the buffer's top left is, x right and y down.
    pub origin: [i32; 2],
    /// clear_count numbers of clear_type: what is shown where nothing was rendered, and behind color.
    pub clear: *const c_void,
    /// TRZ_NUMBERS_*.
    pub clear_type: u32,
    /// Numbers of the clear value; 0: all is 0.
    pub clear_count: u32,
    /// The pixels, rows without gaps.
    pub data: *mut c_void,
    /// Size of data.
    pub bytes: usize,
    /// The library's: 1 where data was filled, if only with the clear value.
    pub filled: u32,
    /// The library's: samples that are shown.
    pub samples: u32,
    /// The library's: view_readable of what is shown.
    pub render: u64,
    /// The library's: 1 where the render that is shown had ended.
    pub ended: u32,
}

/// How far a render is.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_progress {
    /// sizeof(trz_progress).
    pub struct_size: u32,
    /// TRZ_STATE_*.
    pub state: u32,
    /// Of the samples, 0 to 1.
    pub fraction: f64,
    /// Samples a pixel that every pixel has.
    pub samples_done: u32,
    /// Samples a pixel that were asked for.
    pub samples_total: u32,
    /// Seconds since the start (of the commit or render), up to its end, without pauses that are over.
    pub seconds: f64,
    /// Estimate; negative while unknown.
    pub seconds_left: f64,
    /// Edits of prims, instancers and cameras that were queued so far.
    pub edits: u64,
    /// Those of cameras.
    pub camera_edits: u64,
    /// How often trz_view_render has started to render anew.
    pub view_starts: u64,
    /// Number of the render of trz_view_render that AOVs can be read of, 0 for none; it grows with each.
    pub view_readable: u64,
    /// 1: nothing more comes of trz_view_render: all samples were taken, or it failed, or it was stopped.
    pub view_converged: u32,
    /// 1: trz_view_stop holds, and nothing runs.
    pub view_stopped: u32,
}

/// A GPU, or what stands in for one. Texts end with a NUL, and are cut where they are longer.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_device {
    /// sizeof(trz_device).
    pub struct_size: u32,
    /// TRZ_DEVICE_*.
    pub kind: u32,
    /// As its driver calls it.
    pub name: [c_char; 256],
    /// Vulkan, Metal or DX12.
    pub api: [c_char; 32],
    /// The driver and its version.
    pub driver: [c_char; 256],
    /// Bytes of the largest buffer.
    pub largest_buffer: u64,
    /// Bytes of a buffer that a stage sees at once.
    pub largest_binding: u64,
    /// Workgroups along one side of a launch.
    pub workgroups: u32,
    /// 1 where stages can be timed.
    pub timestamps: u32,
    /// 1 where invocations of a subgroup can exchange values.
    pub subgroups: u32,
    /// 1 for the one that the backend gpu uses.
    pub chosen: u32,
}

/// What the last commit and the last render did.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_statistics {
    /// sizeof(trz_statistics).
    pub struct_size: u32,
    /// Geometry prims.
    pub prims: u64,
    /// Instances in the world.
    pub instances: u64,
    /// Diced objects that instances share.
    pub objects: u64,
    /// Grids.
    pub grids: u64,
    /// Micropolygons, shared ones counted once.
    pub micropolygons: u64,
    /// Limit surface evaluations.
    pub limit_evaluations: u64,
    /// Bytes of diced geometry.
    pub geometry_bytes: u64,
    /// Bytes of the BVH.
    pub bvh_bytes: u64,
    /// Nodes of the BVH.
    pub bvh_nodes: u64,
    /// Bytes of the film.
    pub film_bytes: u64,
    /// Largest resident size of the process so far, bytes; 0 where the system does not tell.
    pub peak_bytes: u64,
    /// Seconds spent on translating the scene.
    pub translate_seconds: f64,
    /// Seconds spent on splitting and dicing.
    pub dice_seconds: f64,
    /// Seconds spent on building the BVH.
    pub build_seconds: f64,
    /// Seconds spent on tracing, shading and filtering.
    pub trace_seconds: f64,
    /// Seconds of the commit and the render.
    pub total_seconds: f64,
    /// Rays traced.
    pub rays: u64,
    /// Nodes opened; one is a test of up to 8 children.
    pub node_tests: u64,
    /// Micropolygons tested.
    pub cell_tests: u64,
    /// Objects that the last commit diced.
    pub objects_diced: u64,
    /// Objects that the last commit kept from before.
    pub objects_reused: u64,
    /// Those of them that it placed anew: only their grids were kept.
    pub objects_placed: u64,
    /// Parts of prims that are diced when a ray first comes near them.
    pub clusters: u64,
    /// Those of them that none has come near by now. Grids, micropolygons, bytes and seconds are of what is
    /// diced; seconds spent on dicing while rendering are part of trace_seconds too.
    pub clusters_culled: u64,
    /// About how many micropolygons these would have.
    pub micropolygons_culled: u64,
}

/// Size and type of an AOV. It covers the image and the data window; what was not rendered of them
/// is background.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_aov_desc {
    /// sizeof(trz_aov_desc).
    pub struct_size: u32,
    /// Pixels across; the image's width unless there is overscan.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Components a pixel; each takes 4 bytes.
    pub components: u32,
    /// TRZ_FORMAT_*.
    pub format: u32,
    /// Column of the image that the first pixel is in; below 0 with overscan to the left.
    pub origin_x: i32,
    /// Row of the image that the first pixel is in; below 0 with overscan above.
    pub origin_y: i32,
}

/// A render var of a product (UsdRenderVar) as authored. Texts are UTF-8; NULL where nothing is
/// authored.
///
/// What is written of it: by source_type, source_name is an AOV or what other renderers call it
/// (raw, intrinsic: Ci, a, z, id...), a primvar (primvar), or a light path expression (lpe, of which
/// only those of the whole image are known). format, else data_type says 16 or 32 bits and how many
/// values (color3h: half R G B). The first colour is named R G B A, its alpha A, all others
/// `name.X`...: by channel_prefix, else name, else the end of path.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_render_var {
    /// Path of the prim.
    pub path: *const c_char,
    /// sourceName; without it the var's name is the source.
    pub source_name: *const c_char,
    /// sourceType.
    pub source_type: *const c_char,
    /// dataType.
    pub data_type: *const c_char,
    /// driver:parameters:aov:format.
    pub format: *const c_char,
    /// driver:parameters:aov:name.
    pub name: *const c_char,
    /// driver:parameters:aov:channel_prefix.
    pub channel_prefix: *const c_char,
}

/// How an image file is written.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_image {
    /// sizeof(trz_image).
    pub struct_size: u32,
    /// TRZ_IMAGE_*.
    pub r#type: u32,
    /// TRZ_PIXEL_*, EXR only; ids and depths are always 32 bits.
    pub pixel_type: u32,
    /// TRZ_COMPRESSION_*, EXR only.
    pub compression: u32,
    /// TRZ_COLOR_*: what the color AOV is encoded to.
    pub color: u32,
    /// Names of the AOVs to write.
    pub aovs: *const *const c_char,
    /// Number of names; 0: all that were rendered (PNG: color).
    pub aov_count: usize,
    /// name, value, name, value...
    pub metadata: *const *const c_char,
    /// Length of metadata, even.
    pub metadata_count: usize,
    /// Render vars to write in place of AOVs; their AOVs must have been rendered. A PNG holds the
    /// first one of color.
    pub vars: *const trz_render_var,
    /// Number of render vars; 0: aovs says what is written.
    pub var_count: usize,
    /// 1: what an interrupted render had; goes to name.partial.exr beside name.exr, which stays, with
    /// hdtrapeze/complete false.
    pub partial: u32,
}

/// A ray at one instant, world space.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_ray {
    /// World space.
    pub origin: [f32; 3],
    /// World space, of any length but 0.
    pub dir: [f32; 3],
    /// In [0, 1] across the shutter; clamped.
    pub time: f32,
    /// Hits nearer than this are ignored; in units of dir's length. Below 0 is 0.
    pub t_min: f32,
    /// Hits farther than this are ignored; infinity for no limit.
    pub t_max: f32,
}

/// The nearest micropolygon along a ray.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct trz_hit {
    /// Distance in units of the ray's dir; infinity: a miss.
    pub t: f32,
    /// Position in the micropolygon, 0 to 1.
    pub u: f32,
    /// Position in the micropolygon, 0 to 1.
    pub v: f32,
    /// Geometric, world space, unit; zero for a miss.
    pub normal: [f32; 3],
    /// As set by trz_prim_set_pick_id; -1 for a miss.
    pub prim_id: i32,
    /// -1 for a miss.
    pub instance_id: i32,
    /// Authored face, or element of the grid; -1 for a miss.
    pub element_id: i32,
    /// Grid of the object.
    pub grid: u32,
    /// Cell of the grid: j * nu + i.
    pub cell: u32,
}
