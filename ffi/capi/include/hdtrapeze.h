/*
 * hdTrapeze, C ABI. Generated from ffi/capi/src; do not edit.
 *
 * Results. Functions that can fail return TRZ_OK or an error code, and trz_last_error tells what
 * went wrong. Outputs are written only on success, unless a function says otherwise.
 *
 * Pointers. NULL is an error where nothing else is said. A length of 0 ignores its pointer. All
 * input is copied before a call returns; nothing keeps a caller's pointer but trz_session_set_log.
 * Strings are UTF-8 and end with a NUL. Pointers that are not NULL must be valid and aligned.
 *
 * Structs. Where a struct begins with struct_size, the caller sets it to sizeof the struct before
 * any call, also where the library fills it. A smaller size is an older version and is accepted
 * down to the first; a larger size is a newer one and is accepted where the fields that the library
 * does not know are zero bytes (TRZ_ERROR_UNSUPPORTED otherwise). 0 is refused.
 *
 * Numbers. Times are time codes relative to the frame. Matrices are USD's: 16 doubles, row-major,
 * row vectors. Enum-like fields are uint32_t and take the constants of the group that they name;
 * flags are 0 or 1.
 *
 * Edits (trz_mesh_*, trz_grids_*, trz_implicit_*, trz_nurbs_*, trz_instancer_*, trz_camera_*,
 * trz_prim_*, trz_session_set_*) are queued from any thread and take effect together, in their
 * order, at the next trz_session_commit or trz_render_start.
 *
 * A defect of the library is TRZ_ERROR_INTERNAL and poisons the session: later calls return
 * TRZ_ERROR_POISONED, trz_session_destroy still works.
 */

#ifndef HDTRAPEZE_H
#define HDTRAPEZE_H

#include <stddef.h>
#include <stdint.h>

// Version of this ABI: grows when functions or fields are added; what is there never changes.
#define TRZ_ABI_VERSION 1

// Success.
#define TRZ_OK 0

// A pointer that must not be null is null.
#define TRZ_ERROR_NULL_POINTER 1

// An argument is out of range, not UTF-8, of an unknown kind, or contradicts another.
#define TRZ_ERROR_INVALID_ARGUMENT 2

// No prim, AOV, committed scene or render of that name or number.
#define TRZ_ERROR_NOT_FOUND 3

// Well formed, but this build or version cannot do it.
#define TRZ_ERROR_UNSUPPORTED 4

// Memory was refused; the session is unharmed.
#define TRZ_ERROR_OUT_OF_MEMORY 5

// A file could not be written; what was there before is untouched.
#define TRZ_ERROR_IO 6

// Cancelled before it was done.
#define TRZ_ERROR_CANCELLED 7

// An earlier call failed with TRZ_ERROR_INTERNAL; the session can only be destroyed.
#define TRZ_ERROR_POISONED 8

// Would wait for itself: called from the session's own log callback.
#define TRZ_ERROR_BUSY 9

// The buffer given is too small.
#define TRZ_ERROR_BUFFER_TOO_SMALL 10

// A defect of the library; it poisons the session.
#define TRZ_ERROR_INTERNAL 11

// subdivisionScheme catmullClark.
#define TRZ_SCHEME_CATMULL_CLARK 0

// subdivisionScheme loop; triangles only.
#define TRZ_SCHEME_LOOP 1

// subdivisionScheme bilinear.
#define TRZ_SCHEME_BILINEAR 2

// subdivisionScheme none: polygons.
#define TRZ_SCHEME_NONE 3

// interpolateBoundary none.
#define TRZ_BOUNDARY_NONE 0

// interpolateBoundary edgeOnly.
#define TRZ_BOUNDARY_EDGE_ONLY 1

// interpolateBoundary edgeAndCorner (USD's default).
#define TRZ_BOUNDARY_EDGE_AND_CORNER 2

// faceVaryingLinearInterpolation none.
#define TRZ_FVAR_NONE 0

// faceVaryingLinearInterpolation cornersOnly.
#define TRZ_FVAR_CORNERS_ONLY 1

// faceVaryingLinearInterpolation cornersPlus1 (USD's default).
#define TRZ_FVAR_CORNERS_PLUS1 2

// faceVaryingLinearInterpolation cornersPlus2.
#define TRZ_FVAR_CORNERS_PLUS2 3

// faceVaryingLinearInterpolation boundaries.
#define TRZ_FVAR_BOUNDARIES 4

// faceVaryingLinearInterpolation all.
#define TRZ_FVAR_ALL 5

// triangleSubdivisionRule catmullClark (USD's default).
#define TRZ_TRIANGLES_CATMULL_CLARK 0

// triangleSubdivisionRule smooth.
#define TRZ_TRIANGLES_SMOOTH 1

// orientation rightHanded (USD's default).
#define TRZ_ORIENTATION_RIGHT_HANDED 0

// orientation leftHanded.
#define TRZ_ORIENTATION_LEFT_HANDED 1

// elementType face (USD's default).
#define TRZ_ELEMENT_FACE 0

// elementType point.
#define TRZ_ELEMENT_POINT 1

// elementType edge.
#define TRZ_ELEMENT_EDGE 2

// elementType segment.
#define TRZ_ELEMENT_SEGMENT 3

// elementType tetrahedron.
#define TRZ_ELEMENT_TETRAHEDRON 4

// familyType unrestricted (USD's default).
#define TRZ_FAMILY_UNRESTRICTED 0

// familyType nonOverlapping.
#define TRZ_FAMILY_NON_OVERLAPPING 1

// familyType partition.
#define TRZ_FAMILY_PARTITION 2

// type linear: the basis is not used.
#define TRZ_BASIS_LINEAR 0

// type cubic, basis bezier (USD's default).
#define TRZ_BASIS_BEZIER 1

// type cubic, basis bspline.
#define TRZ_BASIS_BSPLINE 2

// type cubic, basis catmullRom.
#define TRZ_BASIS_CATMULL_ROM 3

// type cubic, basis hermite: positions and tangents by turns.
#define TRZ_BASIS_HERMITE 4

// wrap nonperiodic (USD's default).
#define TRZ_WRAP_NONPERIODIC 0

// wrap periodic.
#define TRZ_WRAP_PERIODIC 1

// wrap pinned.
#define TRZ_WRAP_PINNED 2

// Of a prim: as the settings say. Of the settings: as TRZ_CURVES_AUTO.
#define TRZ_CURVES_DEFAULT 0

// Curves without normals are tubes where they are wide on screen, else ribbons.
#define TRZ_CURVES_AUTO 1

// They are ribbons that face the camera; instanced ones are tubes.
#define TRZ_CURVES_RIBBONS 2

// They are tubes.
#define TRZ_CURVES_TUBES 3

// UsdGeomCube. Sizes: edge.
#define TRZ_IMPLICIT_CUBE 0

// UsdGeomPlane, facing along its axis. Sizes: width, length.
#define TRZ_IMPLICIT_PLANE 1

// UsdGeomSphere. Sizes: radius.
#define TRZ_IMPLICIT_SPHERE 2

// UsdGeomCylinder and UsdGeomCylinder_1. Sizes: height, radius at the lower and at the upper end.
#define TRZ_IMPLICIT_CYLINDER 3

// UsdGeomCone, its tip up the axis. Sizes: height, radius.
#define TRZ_IMPLICIT_CONE 4

// UsdGeomCapsule and UsdGeomCapsule_1: domes touch the side. Sizes: height of the side, its radius
// at the lower and at the upper end.
#define TRZ_IMPLICIT_CAPSULE 5

// Along x.
#define TRZ_AXIS_X 0

// Along y.
#define TRZ_AXIS_Y 1

// Along z (USD's default).
#define TRZ_AXIS_Z 2

// Matrices, 16 doubles each; USD layout.
#define TRZ_PATH_MATRICES 0

// Points, 3 doubles each.
#define TRZ_PATH_POINTS 1

// One value for the prim.
#define TRZ_INTERPOLATION_CONSTANT 0

// One value a face, or a curve.
#define TRZ_INTERPOLATION_UNIFORM 1

// One value a point, linear over faces; of curves, one a segment end.
#define TRZ_INTERPOLATION_VARYING 2

// One value a point, smoothed with the scheme or basis.
#define TRZ_INTERPOLATION_VERTEX 3

// One value a face-vertex.
#define TRZ_INTERPOLATION_FACE_VARYING 4

// 32-bit floats.
#define TRZ_NUMBERS_FLOAT32 0

// 64-bit floats.
#define TRZ_NUMBERS_FLOAT64 1

// 16-bit floats.
#define TRZ_NUMBERS_FLOAT16 2

// 32-bit signed integers.
#define TRZ_NUMBERS_INT32 3

// 32-bit unsigned integers.
#define TRZ_NUMBERS_UINT32 4

// 64-bit signed integers.
#define TRZ_NUMBERS_INT64 5

// 64-bit unsigned integers.
#define TRZ_NUMBERS_UINT64 6

// 8-bit unsigned integers and truth values.
#define TRZ_NUMBERS_UINT8 7

// No role, or one that does not matter here.
#define TRZ_ROLE_NONE 0

// A colour: as an AOV it has channels R, G, B and A.
#define TRZ_ROLE_COLOR 1

// Perspective camera.
#define TRZ_PROJECTION_PERSPECTIVE 0

// Orthographic camera; apertures are the size of the view.
#define TRZ_PROJECTION_ORTHOGRAPHIC 1

// Points of a shutter's curve are joined by straight lines.
#define TRZ_SHUTTER_LINEAR 0

// Points of a shutter's curve make cubic Bezier segments: 3 n + 1, of which every third is on the
// curve.
#define TRZ_SHUTTER_BEZIER 1

// Box filter, 1 pixel wide unless a width is given.
#define TRZ_FILTER_BOX 0

// Gaussian filter, 2 pixels wide.
#define TRZ_FILTER_GAUSSIAN 1

// Mitchell-Netravali filter, 4 pixels wide.
#define TRZ_FILTER_MITCHELL 2

// Blackman-Harris filter, 3 pixels wide.
#define TRZ_FILTER_BLACKMAN_HARRIS 3

// Keep the camera's width, change its height.
#define TRZ_WINDOW_MATCH_HORIZONTALLY 0

// Keep the camera's height, change its width (usdrecord's).
#define TRZ_WINDOW_MATCH_VERTICALLY 1

// Show all of the camera's view, and more.
#define TRZ_WINDOW_FIT 2

// Fill the image with part of the camera's view.
#define TRZ_WINDOW_CROP 3

// Stretch.
#define TRZ_WINDOW_DONT_CONFORM 4

// Both sides of surfaces are seen.
#define TRZ_CULL_NONE 0

// Rays pass through backs.
#define TRZ_CULL_BACK 1

// Rays pass through fronts.
#define TRZ_CULL_FRONT 2

// Rays pass through backs, but for prims that are double-sided.
#define TRZ_CULL_BACK_UNLESS_DOUBLE_SIDED 3

// What is fastest: a GPU where a trial found it faster than the CPU, see trz_auto_describe; else the CPU.
#define TRZ_BACKEND_AUTO 0

// All on the CPU.
#define TRZ_BACKEND_CPU 1

// A GPU renders what it knows, and the CPU the rest; see trz_device_describe. Settings that ask for it are refused
// with TRZ_ERROR_UNSUPPORTED where no device opens. A scene that the device does not take, and a device that is
// lost, give one warning, and the CPU renders, or goes on from the samples that there are.
#define TRZ_BACKEND_GPU 2

// Something that no setting has.
#define TRZ_VALUE_NONE 0

// True or false.
#define TRZ_VALUE_BOOL 1

// A whole number.
#define TRZ_VALUE_INTEGER 2

// A number.
#define TRZ_VALUE_REAL 3

// A word.
#define TRZ_VALUE_TEXT 4

// Two numbers.
#define TRZ_VALUE_PAIR 5

// A driver that computes on the CPU.
#define TRZ_DEVICE_SOFTWARE 0

// Unknown, or virtual.
#define TRZ_DEVICE_OTHER 1

// Shares memory with the CPU.
#define TRZ_DEVICE_INTEGRATED 2

// Has memory of its own.
#define TRZ_DEVICE_DISCRETE 3

// Something failed.
#define TRZ_LOG_ERROR 0

// Something in the scene was repaired, dropped or coarsened.
#define TRZ_LOG_WARN 1

// What a user wants to read.
#define TRZ_LOG_INFO 2

// What a developer wants to read.
#define TRZ_LOG_DEBUG 3

// 32-bit float components.
#define TRZ_FORMAT_FLOAT32 0

// 32-bit signed integer components.
#define TRZ_FORMAT_INT32 1

// 32-bit floats.
#define TRZ_COMPONENT_FLOAT32 0

// 16-bit floats.
#define TRZ_COMPONENT_FLOAT16 1

// 32-bit signed integers.
#define TRZ_COMPONENT_INT32 2

// Bytes, 255 for 1.
#define TRZ_COMPONENT_UNORM8 3

// Signed bytes, 127 for 1.
#define TRZ_COMPONENT_SNORM8 4

// OpenEXR, one layer an AOV.
#define TRZ_IMAGE_EXR 0

// PNG, 8 bits a channel, one AOV.
#define TRZ_IMAGE_PNG 1

// 16-bit floats.
#define TRZ_PIXEL_HALF 0

// 32-bit floats.
#define TRZ_PIXEL_FLOAT 1

// Uncompressed EXR.
#define TRZ_COMPRESSION_NONE 0

// Run lengths.
#define TRZ_COMPRESSION_RLE 1

// Zip, one scan line a block.
#define TRZ_COMPRESSION_ZIPS 2

// Zip, 16 scan lines a block.
#define TRZ_COMPRESSION_ZIP 3

// Wavelet.
#define TRZ_COMPRESSION_PIZ 4

// Linear values as rendered.
#define TRZ_COLOR_LINEAR 0

// Encoded with sRGB's transfer function.
#define TRZ_COLOR_SRGB 1

// Nothing was rendered yet.
#define TRZ_STATE_IDLE 0

// Edits are applied, surfaces diced, the BVH built.
#define TRZ_STATE_PREPARING 1

// Rays are traced.
#define TRZ_STATE_RENDERING 2

// Every sample was taken.
#define TRZ_STATE_FINISHED 3

// Stopped early; what was rendered is kept.
#define TRZ_STATE_CANCELLED 4

// Failed; trz_render_wait tells why.
#define TRZ_STATE_FAILED 5

// A render waits, with the samples that it has (trz_render_pause).
#define TRZ_STATE_PAUSED 6

// What is made of products: which of them share renders, and where they are written. Made by
// trz_plan_create.
typedef struct trz_plan trz_plan;

// A session: scene, renderer and images. Made by trz_session_create.
typedef struct trz_session trz_session;

// TRZ_OK or one of TRZ_ERROR_*; codes are never reused.
typedef int32_t trz_result;

// Receives messages. prim_path and code are empty where a message is not about a prim; no pointer
// is null or outlives the call. Called from any thread, one call at a time for a session. Must not
// throw, and must not call the session: calls that would wait for themselves return
// TRZ_ERROR_BUSY.
typedef void (*trz_log_fn)(void *user,
                           uint32_t level,
                           const char *prim_path,
                           const char *code,
                           const char *text);

// A prim or camera of one session; 0 is none; never reused.
typedef uint64_t trz_id;

// Topology and subdivision options of a mesh, as authored. Contradictions between counts and
// indices are found at commit, repaired or dropped with a warning.
typedef struct trz_topology {
  // sizeof(trz_topology).
  uint32_t struct_size;
  // TRZ_SCHEME_*.
  uint32_t scheme;
  // TRZ_BOUNDARY_*.
  uint32_t boundary;
  // TRZ_FVAR_*.
  uint32_t face_varying;
  // TRZ_TRIANGLES_*.
  uint32_t triangles;
  // TRZ_ORIENTATION_*.
  uint32_t orientation;
  // Vertices of each face.
  const int32_t *face_vertex_counts;
  // Number of faces.
  size_t face_count;
  // Points of the faces, concatenated.
  const int32_t *face_vertex_indices;
  // Number of face-vertices.
  size_t index_count;
  // Faces that are holes.
  const int32_t *holes;
  // Number of holes.
  size_t hole_count;
  // Points of the creases, concatenated.
  const int32_t *crease_indices;
  // Length of crease_indices.
  size_t crease_index_count;
  // Points of each crease.
  const int32_t *crease_lengths;
  // Number of creases.
  size_t crease_count;
  // One a crease, or one an edge.
  const float *crease_sharpnesses;
  // Length of crease_sharpnesses.
  size_t crease_sharpness_count;
  // Sharp points.
  const int32_t *corner_indices;
  // Number of sharp points.
  size_t corner_count;
  // One a sharp point.
  const float *corner_sharpnesses;
  // Length of corner_sharpnesses.
  size_t corner_sharpness_count;
} trz_topology;

// A subset of a mesh (UsdGeomSubset), as authored.
typedef struct trz_subset {
  // UTF-8; names it in messages.
  const char *path;
  // familyName, UTF-8; empty where it has none.
  const char *family;
  // TRZ_FAMILY_*; that of a family's first subset counts.
  uint32_t family_type;
  // TRZ_ELEMENT_*: what the indices number. Only subsets of faces are used.
  uint32_t element_type;
  // Its elements, at the frame.
  const int32_t *indices;
  // Number of indices.
  size_t index_count;
} trz_subset;

// Basis, wrap and counts of curves. The primvar widths gives their diameters (1 where there is none),
// normals makes flat ribbons of them that lie across these. Counts that basis and wrap cannot have
// are found at commit.
typedef struct trz_curves {
  // sizeof(trz_curves).
  uint32_t struct_size;
  // TRZ_BASIS_*.
  uint32_t basis;
  // TRZ_WRAP_*.
  uint32_t wrap;
  // TRZ_CURVES_*: what they are rendered as where they have no normals.
  uint32_t form;
  // Points of each curve.
  const int32_t *vertex_counts;
  // Number of curves.
  size_t curve_count;
} trz_curves;

// Grids that are already diced, object space.
typedef struct trz_grids {
  // sizeof(trz_grids).
  uint32_t struct_size;
  // key_count times, in time codes relative to the frame.
  const double *times;
  // Number of position keys.
  size_t key_count;
  // grid_count * 2: nu, nv; 1 to 16.
  const uint16_t *rates;
  // elementId of each grid, or NULL for the grid's number.
  const uint32_t *elements;
  // Number of grids.
  size_t grid_count;
  // For each grid, each key, (nv+1) rows of (nu+1) xyz.
  const float *positions;
  // Vertices over all grids and keys (3 floats each).
  size_t position_count;
} trz_grids;

// An implicit prim about the origin: a cube, sphere and so on. Sizes go linearly from sample to
// sample.
typedef struct trz_implicit {
  // sizeof(trz_implicit).
  uint32_t struct_size;
  // TRZ_IMPLICIT_*.
  uint32_t kind;
  // TRZ_AXIS_*; cubes and spheres have none.
  uint32_t axis;
  // TRZ_ORIENTATION_*; left-handed turns the outside in.
  uint32_t orientation;
  // sample_count times, in time codes relative to the frame, in any order.
  const double *times;
  // sample_count * 3: the sizes that the kind names; the rest is ignored.
  const double *sizes;
  // Number of samples.
  size_t sample_count;
} trz_implicit;

// A NURBS patch; its points come by trz_prim_set_points, those along u following each other. Numbers
// are as authored: what does not fit is found at commit.
typedef struct trz_nurbs_patch {
  // sizeof(trz_nurbs_patch).
  uint32_t struct_size;
  // TRZ_ORIENTATION_*.
  uint32_t orientation;
  // Degree plus one, along u.
  int32_t u_order;
  // Degree plus one, along v.
  int32_t v_order;
  // Points along u.
  int32_t u_vertex_count;
  // Points along v.
  int32_t v_vertex_count;
  // Knots along u.
  const double *u_knots;
  // Number of knots along u: u_vertex_count + u_order.
  size_t u_knot_count;
  // Knots along v.
  const double *v_knots;
  // Number of knots along v: v_vertex_count + v_order.
  size_t v_knot_count;
  // Parameters from and to which it is rendered; 0, 0 for all.
  double u_range[2];
  // Parameters from and to which it is rendered; 0, 0 for all.
  double v_range[2];
  // Weights of the points, which are not multiplied by them.
  const double *weights;
  // Number of weights; 0: all are 1.
  size_t weight_count;
} trz_nurbs_patch;

// NURBS curves; their points come by trz_prim_set_points. Numbers are as authored: what does not fit
// is found at commit.
typedef struct trz_nurbs_curves {
  // sizeof(trz_nurbs_curves).
  uint32_t struct_size;
  // TRZ_CURVES_*.
  uint32_t form;
  // curve_count: points of each curve.
  const int32_t *vertex_counts;
  // curve_count: degree plus one of each curve.
  const int32_t *orders;
  // Number of curves.
  size_t curve_count;
  // Knots of the curves, concatenated: each has as many as points and order.
  const double *knots;
  // Number of knots.
  size_t knot_count;
  // range_count * 2: parameters of each curve from and to which it is rendered; 0, 0 for all.
  const double *ranges;
  // Number of ranges; 0: all of each curve.
  size_t range_count;
  // Weights of the points, which are not multiplied by them.
  const double *weights;
  // Number of weights; 0: all are 1.
  size_t weight_count;
} trz_nurbs_curves;

// Lens, film back and exposure at one instant; fields as in trz_camera.
typedef struct trz_lens_sample {
  // Time codes relative to the frame.
  double time;
  // Width of the film back.
  double horizontal_aperture;
  // Height of the film back.
  double vertical_aperture;
  // Offset of the film back to the right.
  double horizontal_aperture_offset;
  // Offset of the film back upwards.
  double vertical_aperture_offset;
  // Focal length.
  double focal_length;
  // Distance from the lens to the plane in focus.
  double focus_distance;
  // f-number; 0 is a pinhole.
  double f_stop;
  // Linear factor on radiance.
  double exposure_scale;
} trz_lens_sample;

// A thin-lens camera that looks down its local -z with +y up. All lengths are scene units
// (UsdGeomCamera's apertures and focal length are tenths: multiply by 0.1). Numbers are checked at
// commit: those that cannot be used are replaced, with a warning that names the camera.
typedef struct trz_camera {
  // sizeof(trz_camera).
  uint32_t struct_size;
  // TRZ_PROJECTION_*.
  uint32_t projection;
  // Width of the film back.
  double horizontal_aperture;
  // Height of the film back.
  double vertical_aperture;
  // Offset of the film back to the right.
  double horizontal_aperture_offset;
  // Offset of the film back upwards.
  double vertical_aperture_offset;
  // Focal length.
  double focal_length;
  // Distance from the lens to the plane in focus.
  double focus_distance;
  // f-number; 0 is a pinhole. Lens radius = focal_length / (2 f_stop).
  double f_stop;
  // Nearest visible depth.
  double clipping_near;
  // Farthest visible depth.
  double clipping_far;
  // Shutter open, time codes relative to the frame.
  double shutter_open;
  // Shutter close, time codes relative to the frame.
  double shutter_close;
  // Linear factor on radiance (2^EV); 1 for none.
  double exposure_scale;
  // Blades of the lens' opening, that is corners; below 3 it is round. Its area is that of the
  // round opening of the same f_stop, whatever its shape.
  uint32_t aperture_blades;
  // TRZ_SHUTTER_*: how the points of shutter_curve are joined.
  uint32_t shutter_curve_type;
  // Degrees by which blades are turned, counter-clockwise as the camera looks; at 0 a corner
  // points up.
  double aperture_rotation;
  // Width over height of the opening, 0.001 to 1000; 1: as wide as high.
  double aperture_ratio;
  // 0: blades have straight edges; 1: the opening is round.
  double aperture_roundness;
  // shutter_curve_count pairs: position (0 open to 1 close, ascending), openness (0 or above). It
  // says how instants count, not how bright the image is. Held before the first and after the
  // last position.
  const double *shutter_curve;
  // Number of pairs; 0: fully open throughout.
  size_t shutter_curve_count;
  // clipping_plane_count times a b c d in camera space: points with a x + b y + c z + d < 0 are
  // not seen by the camera.
  const double *clipping_planes;
  // Number of planes.
  size_t clipping_plane_count;
  // The lens at lens_sample_count instants, in any order, in place of the fields above where
  // there are any. Each number is interpolated linearly between samples, and held outside.
  const struct trz_lens_sample *lens_samples;
  // Number of lens samples; 0: the lens does not change.
  size_t lens_sample_count;
} trz_camera;

// Matrix samples of one level of the hierarchy.
typedef struct trz_transform_samples {
  // count times, in time codes relative to the frame, in any order.
  const double *times;
  // count * 16; USD layout: row-major, row vectors; local to parent.
  const double *matrices;
  // Number of samples.
  size_t count;
  // 0: between samples, matrices are interpolated entry by entry, so what turns there is flattened.
  // 1: rotations turn at constant speed about the level's own origin, by less than half a turn from
  // sample to sample (polar decomposition), where the stretch and the place are the same at two samples,
  // or a third between them shows that the place goes linearly. All else is interpolated as with 0.
  // Cameras always turn. Plus 2: the sample at the frame shows whether they do: where it lies on the line
  // between the samples before and after it, it is left out, and all is interpolated as with 0.
  uint32_t turns;
} trz_transform_samples;

// Arrays of values at several times, of as many floats a value as the field that holds them says.
// All zero: none.
typedef struct trz_float_samples {
  // sample_count times, in time codes relative to the frame, in any order.
  const double *times;
  // Number of samples.
  size_t sample_count;
  // sample_count arrays of counts[i] values.
  const float *const *values;
  // Values of each sample.
  const size_t *counts;
} trz_float_samples;

// Point samples of a mesh, of curves or spheres, object space.
//
// Without velocities, points go on straight lines from sample to sample. With velocities, the
// sample at or before the frame (the first one where all are later) moves on: dt seconds after its
// own time a point is at p + dt (v + dt a / 2). As in USD, velocities count where their samples
// before and after the frame have the times of those of the points, and are as many; accelerations
// where theirs are as those of the velocities. So a host gives the samples around the frame beside
// those around the shutter, and no velocities for points without time samples.
typedef struct trz_points {
  // sizeof(trz_points).
  uint32_t struct_size;
  // sample_count times, in time codes relative to the frame, in any order.
  const double *times;
  // Number of samples.
  size_t sample_count;
  // sample_count arrays of 3 * counts[i] floats.
  const float *const *points;
  // Points of each sample.
  const size_t *counts;
  // Scene units a second, 3 floats a point.
  struct trz_float_samples velocities;
  // Scene units a second squared, 3 floats a point.
  struct trz_float_samples accelerations;
  // Time codes a second; above 0 where there are velocities.
  double time_codes_per_second;
} trz_points;

// A primvar of numbers. Floats are interpolated over the surface and between samples. Integers are
// not: a place has the value of the nearest corner of its face, a time that of the sample before.
typedef struct trz_primvar {
  // sizeof(trz_primvar).
  uint32_t struct_size;
  // TRZ_INTERPOLATION_*.
  uint32_t interpolation;
  // TRZ_NUMBERS_*. All are kept in 32 bits; integers beyond become the nearest, with a warning;
  // unsigned ones keep their bits.
  uint32_t type;
  // TRZ_ROLE_*.
  uint32_t role;
  // Numbers of the type, 1 to 16: 3 of a colour, 16 of a matrix.
  uint32_t width;
  // elementSize as authored, else 1: so many of the type are one value. Above 16 numbers a value,
  // or below 1, the primvar is ignored with a warning.
  int32_t element_size;
  // unauthoredValuesIndex as authored, else -1: an index that may point at nothing.
  int32_t unauthored_index;
  // sample_count times, in time codes relative to the frame, in any order; both values and
  // indices may differ between them.
  const double *times;
  // Number of samples, at least 1.
  size_t sample_count;
  // sample_count arrays of value_counts[i] * width numbers.
  const void *const *values;
  // Of the type, in each sample.
  const size_t *value_counts;
  // sample_count arrays of indices into the values, or NULL: not indexed.
  const int32_t *const *indices;
  // Indices of each sample; 0: it is not indexed. Ignored where indices is NULL.
  const size_t *index_counts;
} trz_primvar;

// Arrays of matrices at several times. All zero: none.
typedef struct trz_matrix_samples {
  // sample_count times, in time codes relative to the frame, in any order.
  const double *times;
  // Number of samples.
  size_t sample_count;
  // sample_count arrays of counts[i] matrices, 16 doubles each; USD layout: row-major, row vectors.
  const double *const *values;
  // Matrices of each sample.
  const size_t *counts;
} trz_matrix_samples;

// Instances of an instancer: raw arrays of UsdGeomPointInstancer, or matrices of native instances
// (Hydra's hydra:instanceTransforms). Each array has one value an instance, or is left out (all zero).
//
// A point p of a part of a prototype goes to
//     p * transform of the part * matrix * scale * orientation * position * transform of the instancer
// and on in the same way where the instancer is part of another's prototype.
//
// Without rates, arrays are interpolated between their own samples: orientations along great arcs,
// matrices as matrices_turn says, others linearly. With velocities or angular_velocities, every array stays at its sample at or
// before the frame; dt seconds after it, an instance is at p + dt (v + dt a / 2), and has turned by
// dt |w| degrees about w, after its orientation. As in USD, rates count where their samples before
// and after the frame have the times of those of the positions (orientations), and are as many; so a
// host gives the samples around the frame beside those around the shutter, and no rates for arrays
// without time samples.
//
// Samples with another number of values than instances are not interpolated with.
typedef struct trz_instancer {
  // sizeof(trz_instancer).
  uint32_t struct_size;
  // Number of instances.
  size_t instance_count;
  // Number of prototypes: instances of others are left out with a warning. 0: not known.
  size_t prototype_count;
  // Prototype number of each instance (protoIndices); none: all are of prototype 0.
  const int32_t *prototypes;
  // Length of prototypes.
  size_t prototype_index_count;
  // 0 for instances that are not there (invisibleIds and inactiveIds), else 1; none: all are.
  const uint8_t *mask;
  // Length of mask.
  size_t mask_count;
  // What the instanceId AOV shows for each instance; none: 0, 1, 2... Parts of nested instancers show
  // the flat number of both instances, the outer one first: outer * inner instance_count + inner.
  const int32_t *ids;
  // Length of ids.
  size_t id_count;
  // Scene units, 3 floats an instance.
  struct trz_float_samples positions;
  // Unit quaternions, 4 floats an instance: x, y, z, w (the real part last, as in USD's memory).
  struct trz_float_samples orientations;
  // Factors, 3 floats an instance.
  struct trz_float_samples scales;
  // Applied before the scale.
  struct trz_matrix_samples matrices;
  // Scene units a second, 3 floats an instance.
  struct trz_float_samples velocities;
  // Scene units a second squared, 3 floats an instance; used with velocities only.
  struct trz_float_samples accelerations;
  // Degrees a second about the vector's own direction, 3 floats an instance; used with orientations
  // only.
  struct trz_float_samples angular_velocities;
  // Time codes a second; above 0 where there are rates.
  double time_codes_per_second;
  // How matrices are interpolated; see turns of trz_transform_samples.
  uint32_t matrices_turn;
  // In place of prototypes, prototype_count lists of the instances of each, as Hydra has them, or NULL.
  // Then instanceId shows places in these lists, flat numbers of nested instancers count their lengths,
  // and instance_count may be 0: as many as have a position or a matrix.
  const int32_t *const *lists;
  // Length of each list. Ignored where lists is NULL.
  const size_t *list_counts;
} trz_instancer;

// A value of a setting.
typedef struct trz_value {
  // TRZ_VALUE_*: which of the fields below counts.
  uint32_t kind;
  // TRZ_VALUE_INTEGER; TRZ_VALUE_BOOL: 0 or 1.
  int64_t integer;
  // TRZ_VALUE_PAIR; TRZ_VALUE_REAL: the first one.
  double numbers[2];
  // TRZ_VALUE_TEXT, UTF-8.
  const char *text;
} trz_value;

// A setting that has a name, for the panels of hosts and for attributes of RenderSettings and
// RenderProduct prims. Texts are owned by the library, valid for ever.
typedef struct trz_setting {
  // sizeof(trz_setting).
  uint32_t struct_size;
  // 1 where prims have it, too; 0: the host's alone.
  uint32_t of_prims;
  // Such as trapeze:samples.
  const char *name;
  // What hosts show it as; NULL: it is not shown.
  const char *label;
  // Its value where nobody has an opinion; TRZ_VALUE_NONE: none.
  struct trz_value fallback;
  // TRZ_VALUE_*: what its values are. Where they are TRZ_VALUE_REAL, whole numbers do, too.
  uint32_t kind;
  // The least and the most that a number, or each of a pair, can be.
  double range[2];
  // The words that a text can be, with spaces between; NULL for what is no text.
  const char *words;
  // What it is, for helps and tool tips: a part of a sentence.
  const char *doc;
} trz_setting;

// Settings of a render.
typedef struct trz_settings {
  // sizeof(trz_settings).
  uint32_t struct_size;
  // Image width, 1 to 65536 pixels.
  uint32_t width;
  // Image height, 1 to 65536 pixels.
  uint32_t height;
  // Pixels to render: x0 y0 x1 y1, half open, relative to the image's top left, y down; all 0
  // for the image. Inside the image it is a crop; what lies outside is overscan. The image and
  // this window together span at most 65536 pixels.
  int32_t data_window[4];
  // Pixel width over height.
  float pixel_aspect;
  // TRZ_WINDOW_*.
  uint32_t window_policy;
  // Samples a pixel, 1 to 1048576.
  uint32_t samples;
  // Micropolygon edge in pixels, above 0.
  float shading_rate;
  // TRZ_FILTER_*.
  uint32_t filter;
  // Filter diameter in pixels, up to 64; 0: the filter's own.
  float filter_width;
  // Seed of all sample patterns.
  uint32_t seed;
  // Threads, up to 4096; 0: all cores.
  uint32_t threads;
  // 1: shutter_open and shutter_close below in place of the camera's.
  uint32_t override_shutter;
  // Time codes relative to the frame.
  double shutter_open;
  // Time codes relative to the frame, not before shutter_open.
  double shutter_close;
  // 1: everything stands still at shutter open.
  uint32_t disable_motion_blur;
  // 1: the lens is a pinhole.
  uint32_t disable_defocus;
  // 1: a light at the camera where the scene has none.
  uint32_t camera_light;
  // Part of the shutter that is sampled, in [0, 1]; 0, 1 for all. Dicing still sees all of it.
  float time_window[2];
  // 1: every sample goes through lens_point.
  uint32_t fix_lens;
  // A point of the unit disk, in units of the round lens' radius.
  float lens_point[2];
  // Most micropolygons that dicing may make; beyond it rates are coarsened with a warning. 0:
  // the default.
  uint64_t max_micropolygons;
  // TRZ_BACKEND_*.
  uint32_t backend;
  // TRZ_CURVES_*: what curves without normals are rendered as, where their prim does not say.
  uint32_t curves;
  // 1: grids of an earlier commit are kept where dicing anew would gain little: while nearly all
  // micropolygons of prims that appear once have at most twice the area that is asked for, and none are far finer. A camera that moves then
  // shows sooner; bits depend on what was rendered before. Grids of hidden prims stay in memory, too, for
  // when they are shown again. 0, the default: neither.
  uint32_t keep_finer;
  // TRZ_CULL_*: the sides of meshes, grids, NURBS patches and implicit prims that rays of the image
  // pass through, as if they were not there. Fronts are as each prim's orientation has them, and
  // stay in front where transforms mirror. Curves and points are always seen.
  uint32_t cull;
  // 1: what may be hidden is diced when a ray first comes near it, and not at all where none does; the
  // image is the same. 0: everything is diced by the commit.
  uint32_t occlusion_culling;
  // TRZ_COMPRESSION_*: of the EXR files of products.
  uint32_t compression;
  // TRZ_PIXEL_*: of the EXR files of products; ids and depths are always 32 bits.
  uint32_t pixel_type;
  // Time codes a second that a setting tells, 0 for none: for hosts that do not know their stage's,
  // which prims with velocities need. A render does not.
  double time_codes_per_second;
} trz_settings;

// A path that the host can evaluate at any time, as far as it has: of a transform, of points, or of
// several transforms that are to have the same samples.
typedef struct trz_path {
  // sizeof(trz_path).
  uint32_t struct_size;
  // TRZ_PATH_*.
  uint32_t of;
  // known_count times at which it has been evaluated, none twice.
  const double *times;
  // The first so many of the times, ascending, are those where the path may have corners, its ends
  // included; the others are what trz_path_next asked for. At least 1.
  size_t start_count;
  // Number of times.
  size_t known_count;
  // known_count arrays of element_count matrices or points.
  const double *const *values;
  // Matrices or points at each time.
  size_t element_count;
} trz_path;

// Evaluates a transform at a time code relative to the frame: writes a matrix, 16 doubles, USD layout.
// Called on the thread that asks, before the call returns. Must not throw.
typedef void (*trz_evaluate_fn)(void *user, double time, double *matrix);

// How far a render is.
typedef struct trz_progress {
  // sizeof(trz_progress).
  uint32_t struct_size;
  // TRZ_STATE_*.
  uint32_t state;
  // Of the samples, 0 to 1.
  double fraction;
  // Samples a pixel that every pixel has.
  uint32_t samples_done;
  // Samples a pixel that were asked for.
  uint32_t samples_total;
  // Seconds since the start (of the commit or render), up to its end, without pauses that are over.
  double seconds;
  // Estimate; negative while unknown.
  double seconds_left;
  // Edits of prims, instancers and cameras that were queued so far.
  uint64_t edits;
  // Those of cameras.
  uint64_t camera_edits;
  // How often trz_view_render has started to render anew.
  uint64_t view_starts;
  // Number of the render of trz_view_render that AOVs can be read of, 0 for none; it grows with each.
  uint64_t view_readable;
  // 1: nothing more comes of trz_view_render: all samples were taken, or it failed, or it was stopped.
  uint32_t view_converged;
  // 1: trz_view_stop holds, and nothing runs.
  uint32_t view_stopped;
} trz_progress;

// What the last commit and the last render did.
typedef struct trz_statistics {
  // sizeof(trz_statistics).
  uint32_t struct_size;
  // Geometry prims.
  uint64_t prims;
  // Instances in the world.
  uint64_t instances;
  // Diced objects that instances share.
  uint64_t objects;
  // Grids.
  uint64_t grids;
  // Micropolygons, shared ones counted once.
  uint64_t micropolygons;
  // Limit surface evaluations.
  uint64_t limit_evaluations;
  // Bytes of diced geometry.
  uint64_t geometry_bytes;
  // Bytes of the BVH.
  uint64_t bvh_bytes;
  // Nodes of the BVH.
  uint64_t bvh_nodes;
  // Bytes of the film.
  uint64_t film_bytes;
  // Largest resident size of the process so far, bytes; 0 where the system does not tell.
  uint64_t peak_bytes;
  // Seconds spent on translating the scene.
  double translate_seconds;
  // Seconds spent on splitting and dicing.
  double dice_seconds;
  // Seconds spent on building the BVH.
  double build_seconds;
  // Seconds spent on tracing, shading and filtering.
  double trace_seconds;
  // Seconds of the commit and the render.
  double total_seconds;
  // Rays traced.
  uint64_t rays;
  // Nodes opened; one is a test of up to 8 children.
  uint64_t node_tests;
  // Micropolygons tested.
  uint64_t cell_tests;
  // Objects that the last commit diced.
  uint64_t objects_diced;
  // Objects that the last commit kept from before.
  uint64_t objects_reused;
  // Those of them that it placed anew: only their grids were kept.
  uint64_t objects_placed;
  // Parts of prims that are diced when a ray first comes near them.
  uint64_t clusters;
  // Those of them that none has come near by now. Grids, micropolygons, bytes and seconds are of what is
  // diced; seconds spent on dicing while rendering are part of trace_seconds too.
  uint64_t clusters_culled;
  // About how many micropolygons these would have.
  uint64_t micropolygons_culled;
} trz_statistics;

// What is rendered, besides the scene.
typedef struct trz_view {
  // sizeof(trz_view).
  uint32_t struct_size;
  // Number of names.
  uint32_t aov_count;
  // The camera to render through, 0 for none.
  trz_id camera;
  // Settings of the render.
  const struct trz_settings *settings;
  // Names of the AOVs to render.
  const char *const *aovs;
  // The frame, for names and metadata of files; not finite at the default time.
  double frame;
  // Path of the RenderSettings prim that products are of; NULL for none.
  const char *settings_path;
  // Its resolution, for products whose own cannot be; the view's where has_resolution is 0.
  int32_t resolution[2];
  // The same of its dataWindowNDC, as a product's; all of the image where has_data_window is 0.
  float data_window[4];
  // The same of its pixelAspectRatio; 1 where has_pixel_aspect is 0.
  float pixel_aspect;
  // The same of its aspectRatioConformPolicy; NULL where that is not known: then expandAperture.
  const char *conform;
  // 1: the view's own image has this resolution, pixel aspect and policy, in place of its settings'.
  uint32_t shapes_view;
  // 1: the same of this data window.
  uint32_t windows_view;
  // Width over height of the film back of the view's camera; 0 where it is not known.
  double camera_aspect;
  // The file that the host itself writes of the view, which a product may have taken; NULL for none.
  const char *path;
  // 1: resolution is known. What cannot be of what is known is told, and is as the schema has it.
  uint32_t has_resolution;
  // The same of data_window.
  uint32_t has_data_window;
  // The same of pixel_aspect.
  uint32_t has_pixel_aspect;
} trz_view;

// A render var of a product (UsdRenderVar) as authored. Texts are UTF-8; NULL where nothing is
// authored.
//
// What is written of it: by source_type, source_name is an AOV or what other renderers call it
// (raw, intrinsic: Ci, a, z, id...), a primvar (primvar), or a light path expression (lpe, of which
// only those of the whole image are known). format, else data_type says 16 or 32 bits and how many
// values (color3h: half R G B). The first colour is named R G B A, its alpha A, all others
// `name.X`...: by channel_prefix, else name, else the end of path.
typedef struct trz_render_var {
  // Path of the prim.
  const char *path;
  // sourceName; without it the var's name is the source.
  const char *source_name;
  // sourceType.
  const char *source_type;
  // dataType.
  const char *data_type;
  // driver:parameters:aov:format.
  const char *format;
  // driver:parameters:aov:name.
  const char *name;
  // driver:parameters:aov:channel_prefix.
  const char *channel_prefix;
} trz_render_var;

// A render product (UsdRenderProduct) as authored, and what its image is rendered with. Texts are
// UTF-8; NULL where nothing is authored.
typedef struct trz_product {
  // sizeof(trz_product).
  uint32_t struct_size;
  // pixelAspectRatio.
  float pixel_aspect;
  // Path of the prim.
  const char *path;
  // productType.
  const char *type;
  // productName: a path with .exr or .png at its end. Places for the frame (`####`, `##.##`, `<F4>`, `$F4`,
  // `${F4}`, `%04d`) are filled in.
  const char *name;
  // The camera to render through; 0 where there is none at camera_path.
  trz_id camera;
  // Path of the camera.
  const char *camera_path;
  // Width over height of the camera's film back; 0 where it is not known.
  double camera_aspect;
  // Width and height.
  int32_t resolution[2];
  // dataWindowNDC: xmin, ymin, xmax, ymax, y up; 0 0 1 1 is the image.
  float data_window[4];
  // aspectRatioConformPolicy.
  const char *conform;
  // Settings of the render, but for the shape of the image.
  const struct trz_settings *settings;
  // orderedVars.
  const struct trz_render_var *vars;
  // Number of vars.
  size_t var_count;
  // How many prims orderedVars names, also such as are no vars. 0, and no vars: color is written.
  size_t var_target_count;
} trz_product;

// A host's own buffer for an AOV, and what it shows. A host sets what it is like, and all fields below
// to 0 whenever that, the data or the AOV is another.
typedef struct trz_buffer {
  // sizeof(trz_buffer).
  uint32_t struct_size;
  // Pixels across.
  uint32_t width;
  // Pixels down.
  uint32_t height;
  // TRZ_COMPONENT_*.
  uint32_t component;
  // Components a pixel, 1 to 4. Those that the AOV lacks are 0, but for the fourth beside three: 1.
  uint32_t components;
  // 1: rows are from the bottom up; 0: from the top down.
  uint32_t bottom_up;
  // The image's pixel that the buffer's top left is, x right and y down.
  int32_t origin[2];
  // clear_count numbers of clear_type: what is shown where nothing was rendered, and behind color.
  const void *clear;
  // TRZ_NUMBERS_*.
  uint32_t clear_type;
  // Numbers of the clear value; 0: all is 0.
  uint32_t clear_count;
  // The pixels, rows without gaps.
  void *data;
  // Size of data.
  size_t bytes;
  // The library's: 1 where data was filled, if only with the clear value.
  uint32_t filled;
  // The library's: samples that are shown.
  uint32_t samples;
  // The library's: view_readable of what is shown.
  uint64_t render;
  // The library's: 1 where the render that is shown had ended.
  uint32_t ended;
} trz_buffer;

// What becomes of a product, or of the host's own image. Pointers are the plan's, valid as long as it is.
typedef struct trz_planned {
  // sizeof(trz_planned).
  uint32_t struct_size;
  // TRZ_OK. Or why it is not written: TRZ_ERROR_UNSUPPORTED, no such thing is (its productType);
  // TRZ_ERROR_INVALID_ARGUMENT, what it asks for cannot be; TRZ_ERROR_IO, its file cannot be written.
  // Then all below is 0, but for why.
  trz_result result;
  // The reason, of which a message has told; empty where it is written.
  const char *why;
  // Its file; empty for the host's own image.
  const char *path;
  // Number of its render, which those that agree in camera and settings share.
  uint32_t render;
  // Number of names.
  uint32_t aov_count;
  // Names of the AOVs of that render.
  const char *const *aovs;
  // Settings of that render, with the shape of the image.
  const struct trz_settings *settings;
} trz_planned;

// Size and type of an AOV. It covers the image and the data window; what was not rendered of them
// is background.
typedef struct trz_aov_desc {
  // sizeof(trz_aov_desc).
  uint32_t struct_size;
  // Pixels across; the image's width unless there is overscan.
  uint32_t width;
  // Pixels down.
  uint32_t height;
  // Components a pixel; each takes 4 bytes.
  uint32_t components;
  // TRZ_FORMAT_*.
  uint32_t format;
  // Column of the image that the first pixel is in; below 0 with overscan to the left.
  int32_t origin_x;
  // Row of the image that the first pixel is in; below 0 with overscan above.
  int32_t origin_y;
} trz_aov_desc;

// How an image file is written.
typedef struct trz_image {
  // sizeof(trz_image).
  uint32_t struct_size;
  // TRZ_IMAGE_*.
  uint32_t type;
  // TRZ_PIXEL_*, EXR only; ids and depths are always 32 bits.
  uint32_t pixel_type;
  // TRZ_COMPRESSION_*, EXR only.
  uint32_t compression;
  // TRZ_COLOR_*: what the color AOV is encoded to.
  uint32_t color;
  // Names of the AOVs to write.
  const char *const *aovs;
  // Number of names; 0: all that were rendered (PNG: color).
  size_t aov_count;
  // name, value, name, value...
  const char *const *metadata;
  // Length of metadata, even.
  size_t metadata_count;
  // Render vars to write in place of AOVs; their AOVs must have been rendered. A PNG holds the
  // first one of color.
  const struct trz_render_var *vars;
  // Number of render vars; 0: aovs says what is written.
  size_t var_count;
  // 1: what an interrupted render had; goes to name.partial.exr beside name.exr, which stays, with
  // hdtrapeze/complete false.
  uint32_t partial;
} trz_image;

// A ray at one instant, world space.
typedef struct trz_ray {
  // World space.
  float origin[3];
  // World space, of any length but 0.
  float dir[3];
  // In [0, 1] across the shutter; clamped.
  float time;
  // Hits nearer than this are ignored; in units of dir's length. Below 0 is 0.
  float t_min;
  // Hits farther than this are ignored; infinity for no limit.
  float t_max;
} trz_ray;

// The nearest micropolygon along a ray.
typedef struct trz_hit {
  // Distance in units of the ray's dir; infinity: a miss.
  float t;
  // Position in the micropolygon, 0 to 1.
  float u;
  // Position in the micropolygon, 0 to 1.
  float v;
  // Geometric, world space, unit; zero for a miss.
  float normal[3];
  // As set by trz_prim_set_pick_id; -1 for a miss.
  int32_t prim_id;
  // -1 for a miss.
  int32_t instance_id;
  // Authored face, or element of the grid; -1 for a miss.
  int32_t element_id;
  // Grid of the object.
  uint32_t grid;
  // Cell of the grid: j * nu + i.
  uint32_t cell;
} trz_hit;

// A GPU, or what stands in for one. Texts end with a NUL, and are cut where they are longer.
typedef struct trz_device {
  // sizeof(trz_device).
  uint32_t struct_size;
  // TRZ_DEVICE_*.
  uint32_t kind;
  // As its driver calls it.
  char name[256];
  // Vulkan, Metal or DX12.
  char api[32];
  // The driver and its version.
  char driver[256];
  // Bytes of the largest buffer.
  uint64_t largest_buffer;
  // Bytes of a buffer that a stage sees at once.
  uint64_t largest_binding;
  // Workgroups along one side of a launch.
  uint32_t workgroups;
  // 1 where stages can be timed.
  uint32_t timestamps;
  // 1 where invocations of a subgroup can exchange values.
  uint32_t subgroups;
  // 1 for the one that the backend gpu uses.
  uint32_t chosen;
} trz_device;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// TRZ_ABI_VERSION of the library that is loaded, which may be newer than the header.
//
// Errors: none. Threads: any.
uint32_t trz_abi_version(void);

// Version of the library, "major.minor.patch". Owned by the library, valid for ever.
//
// Errors: none. Threads: any.
const char *trz_version(void);

// Name of a result code, such as "TRZ_ERROR_NOT_FOUND"; "unknown" for any other number. Owned by
// the library, valid for ever.
//
// Errors: none. Threads: any.
const char *trz_result_name(trz_result result);

// What went wrong in the last call on this thread, one sentence, UTF-8; "" where it succeeded.
// Owned by the library, valid until the next call on this thread.
//
// Errors: none. Threads: any; each has its own message.
const char *trz_last_error(void);

// Makes an empty session. The caller owns it and gives it back to trz_session_destroy.
//
// Errors: TRZ_ERROR_NULL_POINTER. Threads: any; sessions of one process do not mix.
trz_result trz_session_create(struct trz_session **out);

// Destroys a session: cancels a running render, waits for its threads, frees everything. NULL is
// ignored; a poisoned session is destroyed like any other. From inside a log callback nothing is
// done: the session stays alive.
//
// Errors: none. Threads: any, but no other call on the session may be running or follow.
void trz_session_destroy(struct trz_session *session);

// Sets the function that receives messages of up to this level (TRZ_LOG_*); NULL for none. A
// warning about a prim comes once a session for the same prim, code and text. When this returns,
// the function set before is not running and will not be called again. log and user must stay
// valid until then.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (level), TRZ_ERROR_BUSY (inside a log
// callback), TRZ_ERROR_POISONED. Threads: any.
trz_result trz_session_set_log(struct trz_session *session,
                               trz_log_fn log,
                               void *user,
                               uint32_t level);

// Queues a mesh without faces. path (UTF-8) names it in messages; two prims may have one path.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_mesh_create(struct trz_session *session, const char *path, trz_id *out);

// Queues a mesh's topology; everything is copied. Creases or corners whose lists do not fit each
// other are dropped with a warning.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_mesh_set_topology(struct trz_session *session,
                                 trz_id mesh,
                                 const struct trz_topology *topology);

// Queues the subsets of a mesh, in place of those before; everything is copied, and the array may be
// NULL where there are none. The AOV subsetId holds their numbers in it: of the family materialBind,
// else of the family of the first subset of faces. Indices that are no faces or come twice, faces in two
// subsets of a family whose type does not allow it, and faces that a partition lacks give warnings at
// commit, with the subset's path; the rest counts, and where subsets overlap the first.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_mesh_set_subsets(struct trz_session *session,
                                trz_id mesh,
                                const struct trz_subset *subsets,
                                size_t subset_count);

// Queues an empty prim of curves. path (UTF-8) names it in messages. Its points are set with
// trz_prim_set_points, its widths and normals with trz_prim_set_primvar.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_curves_create(struct trz_session *session, const char *path, trz_id *out);

// Queues basis, wrap and counts of a curves prim, in place of those before; everything is copied. Its
// points stay.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_curves_set(struct trz_session *session,
                          trz_id curves_prim,
                          const struct trz_curves *curves);

// Queues an empty prim of spheres. path (UTF-8) names it in messages. Their centres are set with
// trz_prim_set_points; the primvar widths gives their diameters (1 where there is none).
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_spheres_create(struct trz_session *session, const char *path, trz_id *out);

// Queues an empty prim of pre-diced grids. path (UTF-8) names it in messages.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_grids_create(struct trz_session *session, const char *path, trz_id *out);

// Queues the grids of a grids prim, in place of those before; everything is copied. Rates must be
// 1 to 16, and position_count what rates and keys add up to.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_grids_set(struct trz_session *session,
                         trz_id grids_prim,
                         const struct trz_grids *grids);

// Queues an implicit prim without sizes. path (UTF-8) names it in messages.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_implicit_create(struct trz_session *session, const char *path, trz_id *out);

// Queues kind and sizes of an implicit prim, in place of those before; everything is copied. Sizes
// that are not finite or are negative are found at commit. Primvars of a cube or a plane have values
// for the mesh that Hydra draws for it, whose faces elementId tells: a cube's are +z, -z, +y, -y, +x,
// -x. Other kinds have one value, and elementId 0.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_implicit_set(struct trz_session *session,
                            trz_id prim,
                            const struct trz_implicit *implicit);

// Queues a NURBS patch without points. path (UTF-8) names it in messages.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_nurbs_patch_create(struct trz_session *session, const char *path, trz_id *out);

// Queues orders, knots and weights of a NURBS patch, in place of those before; everything is copied.
// The patch is closed where its opposite boundaries lie on one another. Primvars have one value, one
// a point, or, where they vary, one an end of a segment (points - order + 2 along u and along v);
// elementId is 0.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_nurbs_patch_set(struct trz_session *session,
                               trz_id prim,
                               const struct trz_nurbs_patch *patch);

// Queues NURBS curves without points. path (UTF-8) names them in messages.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_nurbs_curves_create(struct trz_session *session, const char *path, trz_id *out);

// Queues orders, knots and weights of NURBS curves, in place of those before; everything is copied.
// Primvars are as for curves (trz_curves_set); one that varies has a value at each end of a segment:
// points - order + 2 a curve.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_nurbs_curves_set(struct trz_session *session,
                                trz_id prim,
                                const struct trz_nurbs_curves *curves);

// Queues a camera with trz_camera_default's values. path (UTF-8) names it in messages and
// metadata.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_camera_create(struct trz_session *session, const char *path, trz_id *out);

// Fills out, whose struct_size the caller has set, with UsdGeomCamera's fallbacks in scene units.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size). Threads: any.
trz_result trz_camera_default(struct trz_camera *out);

// Queues a camera's lens, film back, shutter and clipping planes; everything is copied.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_camera_set(struct trz_session *session,
                          trz_id camera,
                          const struct trz_camera *desc);

// Queues the transform of a prim, instancer or camera: level_count levels, its own first, then its
// parent's, up to the root, or to the root of the prototype that it is part of (included); none is the
// identity. Everything is copied.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (a level without samples),
// TRZ_ERROR_NOT_FOUND, TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_prim_set_transform(struct trz_session *session,
                                  trz_id prim,
                                  const struct trz_transform_samples *levels,
                                  size_t level_count);

// Queues the points of a mesh, of curves or spheres, and their velocities and accelerations;
// everything is copied. Samples of unequal counts are rendered without motion, with a warning at
// commit, unless velocities move them; velocities that do not fit are ignored, with a warning.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_prim_set_points(struct trz_session *session,
                               trz_id prim,
                               const struct trz_points *points);

// Queues a primvar under its USD name (displayColor, st...), without "primvars:", in place of the
// one before; NULL removes it. Everything is copied. Only what shading or an AOV asks for takes
// part in a render. UsdGeomPointBased's own normals have the name normals. An instancer's primvar goes to
// what its instances place: one value an instance, by its index (vertex, varying, face-varying or
// uniform; Hydra's instance interpolation is any of them), or one for all. A prim's own primvar of the
// name wins, then that of the innermost instancer.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_prim_set_primvar(struct trz_session *session,
                                trz_id prim,
                                const char *name,
                                const struct trz_primvar *primvar);

// Queues whether a prim is seen by the camera: 1 (as created) or 0.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_POISONED. Threads: any.
trz_result trz_prim_set_visible(struct trz_session *session, trz_id prim, uint32_t visible);

// Queues how a prim's motion is blurred. blur_scale (USD's motion:blurScale, 1 as created) is a
// factor on times relative to the frame for all that moves it: transform levels, instances, points
// and their velocities, sizes; so 0 is no blur, and the frame's own instant stays where it is.
// Where it is not 1, samples are needed around blur_scale times the shutter. What is negative or
// not finite is taken as 1, with a warning at commit. nonlinear_sample_count (USD's
// motion:nonlinearSampleCount) is the number of positions, evenly spaced over the shutter, where
// accelerations bend a path; 0, as created: as many as keep within a tenth of a pixel of it.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_POISONED. Threads: any.
trz_result trz_prim_set_motion(struct trz_session *session,
                               trz_id prim,
                               double blur_scale,
                               uint32_t nonlinear_sample_count);

// Queues whether both sides of a prim's surface are outsides (USD's doubleSided): 1, or 0 (as
// created). The AOVs normal and Neye of a double-sided prim are those of the side that is seen, of
// others those of the front from either side; and see TRZ_CULL_BACK_UNLESS_DOUBLE_SIDED. Colours do not
// depend on it: both sides are lit.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_POISONED. Threads: any.
trz_result trz_prim_set_double_sided(struct trz_session *session,
                                     trz_id prim,
                                     uint32_t double_sided);

// Queues whether a prim is a matte object (a holdout): 1, or 0 (as created). A matte object hides
// what lies behind it, with zero colour and zero alpha, and other AOVs stay at their background.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_POISONED. Threads: any.
trz_result trz_prim_set_matte(struct trz_session *session, trz_id prim, uint32_t matte);

// Queues the number that the primId AOV and ray hits show for a prim; 0 as created.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_POISONED. Threads: any.
trz_result trz_prim_set_pick_id(struct trz_session *session, trz_id prim, int32_t prim_id);

// Tells that all edits of a prim have been queued: it may be translated and diced right away, on the
// session's threads, while the host goes on with others. A hint that changes nothing but when the work
// is done; edits that come later are as good as before. Worth it where the active camera and the
// settings have been queued before, and each prim's edits follow each other.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_NOT_FOUND, TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_prim_complete(struct trz_session *session,
                             trz_id prim);

// Queues the removal of a prim or camera. Its id is not found any more from now on.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_NOT_FOUND, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_prim_remove(struct trz_session *session, trz_id prim);

// Queues which camera to render through; 0 for none.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (not a camera), TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_POISONED. Threads: any.
trz_result trz_session_set_active_camera(struct trz_session *session, trz_id camera);

// Queues an instancer without instances. path (UTF-8) names it in messages; two may have one path. It
// draws nothing itself: trz_prim_set_instancer makes prims (and other instancers) part of its
// prototypes. Of the functions for prims it takes trz_prim_set_transform (its levels up to the world,
// or to the root of the prototype that it is part of), trz_prim_set_primvar (one value an instance),
// trz_prim_set_visible, trz_prim_set_motion and trz_prim_remove; remove what is part of it too.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (path), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_instancer_create(struct trz_session *session,
                                const char *path,
                                trz_id *out);

// Queues the instances of an instancer, in place of those before; everything is copied. Arrays that do
// not fit each other, and numbers that are not finite, are found at commit: what can be is rendered,
// with a warning.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_instancer_set(struct trz_session *session,
                             trz_id instancer,
                             const struct trz_instancer *instances);

// Queues that a prim, or another instancer, is part of prototype number `prototype` of an instancer: it
// appears once for each instance of that prototype, and not by itself. instancer 0: it stands by
// itself, as created. Its transform levels then end at the root of the prototype.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (a camera, or not an instancer),
// TRZ_ERROR_NOT_FOUND, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_prim_set_instancer(struct trz_session *session,
                                  trz_id prim,
                                  trz_id instancer,
                                  uint32_t prototype);

// Fills out, whose struct_size the caller has set, with a setting that has a name. They are numbered from
// 0 on, in the order in which hosts show them.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size), TRZ_ERROR_NOT_FOUND (there
// are not so many). Threads: any.
trz_result trz_setting_describe(size_t index,
                                struct trz_setting *out);

// Sets the fields of settings that a setting's name stands for. Where the value cannot be they stay, and
// trz_last_error tells what "it must be".
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_NOT_FOUND (name), TRZ_ERROR_INVALID_ARGUMENT. Threads: any.
trz_result trz_settings_set(struct trz_settings *settings,
                            const char *name,
                            const struct trz_value *value);

// Copies name with every place for the frame filled in: `####`, `##.##`, `<F4>`, `$F4`, `${F4}`, `%04d`. A
// frame that is not finite, that of the default time, is shown as 0. capacity counts bytes with the
// terminating NUL; out_needed receives what is needed, also where the buffer is too small. buffer may
// be NULL where capacity is 0.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_BUFFER_TOO_SMALL. Threads: any.
trz_result trz_frame_name(const char *name,
                          double frame,
                          char *buffer,
                          size_t capacity,
                          size_t *out_needed);

// Counts the places for the frame that name has, and the decimals of the one that shows the fewest.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT. Threads: any.
trz_result trz_frame_places(const char *name, size_t *out_count, size_t *out_decimals);

// Says at which times a path is to be evaluated next, so that the lines between its samples keep to it:
// writes at most `capacity` (at least 1) of them to `times`, and how many to `count`. The host adds their
// values to those known and asks again. With a count of 0 the path is known well enough: those samples i
// are to be given to the renderer for which keep, known_count bytes, has keep[i] = 1. Where nothing
// changes, that is the first alone; where a number is not finite, those of the start.
//
// Samples are off by at most 1/4000 of the path's size (of points, of the box around their paths; of
// matrices, of their largest number), but where that would take more than 64.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_OUT_OF_MEMORY. Threads: any.
trz_result trz_path_next(const struct trz_path *path,
                         double *times,
                         size_t capacity,
                         size_t *count,
                         uint8_t *keep);

// Samples a transform as trz_path_next has it done, calling `evaluate` with `user` as often as needed: writes
// at most `capacity` times, ascending, and as many matrices of 16 doubles, and how many to `count`.
// `start`, ascending, are start_count times, at least 1, where the path may have corners, its ends
// included. 64 samples, or start_count where that is more, are always enough. A count of 0 says that
// values are held next to one of these times: then the host knows no path, but samples of one.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_BUFFER_TOO_SMALL. Threads: any.
trz_result trz_path_sample(const double *start,
                           size_t start_count,
                           trz_evaluate_fn evaluate,
                           void *user,
                           double *times,
                           double *matrices,
                           size_t capacity,
                           size_t *count);

// The constant that a word stands for as the value of an attribute, by their names in USD. An empty word
// is USD's fallback; so is one that is not known, which is TRZ_ERROR_NOT_FOUND, with out written: then
// the last error is a sentence for users.
// Attributes: subdivisionScheme, interpolateBoundary, faceVaryingLinearInterpolation,
// triangleSubdivisionRule, orientation, basis, wrap, axis and trapeze:curves.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (attribute), TRZ_ERROR_NOT_FOUND (word).
// Threads: any.
trz_result trz_word(const char *attribute,
                    const char *word,
                    uint32_t *out);

// Fills out, whose struct_size the caller has set, with the defaults of a new session.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size). Threads: any.
trz_result trz_settings_default(struct trz_settings *out);

// Queues render settings. Every field is checked here.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_UNSUPPORTED (backend),
// TRZ_ERROR_POISONED. Threads: any.
trz_result trz_session_set_settings(struct trz_session *session,
                                    const struct trz_settings *settings);

// Queues the AOVs to render, by name (UTF-8), copied; color as created. A name that the renderer
// does not know gives a warning at commit.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_session_set_aovs(struct trz_session *session,
                                const char *const *names,
                                size_t count);

// Applies queued edits in the order they were queued, dices and builds; returns when it is done.
// A running render is stopped first. With nothing queued it does nothing, and a running render
// goes on. trz_render_cancel from another thread ends it early: edits stay applied, and the next
// commit builds.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (no camera to render through, or one
// that shows nothing), TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_CANCELLED, TRZ_ERROR_BUSY (inside a log
// callback), TRZ_ERROR_POISONED. Threads: any; commits and starts run one after another.
trz_result trz_session_commit(struct trz_session *session);

// Commits what is queued (see trz_session_commit), then renders from the first sample on a thread
// of the session; returns when that has begun. A running render is stopped first.
//
// Errors: those of trz_session_commit. Threads: any.
trz_result trz_render_start(struct trz_session *session);

// Waits until no commit or render is running, or for so many seconds; below 0: for ever.
// out_finished becomes 1 where none is running any more (trz_render_progress tells how it ended),
// 0 where time ran out.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (seconds is NaN),
// TRZ_ERROR_BUSY (inside a log callback), TRZ_ERROR_POISONED (also where the render failed).
// Threads: any, also several at once.
trz_result trz_render_wait(struct trz_session *session, double seconds, uint32_t *out_finished);

// Cancels a running commit or render and waits until it has stopped; what was rendered is kept and
// can be read. With none running it does nothing.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_BUSY (inside a log callback), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_render_cancel(struct trz_session *session);

// Asks a running commit or render to stop, as trz_render_cancel does, and does not wait until it has.
// With none running it does nothing.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_render_interrupt(struct trz_session *session);

// Has renders wait with the samples that they have (1), or go on from there (0, as created). AOVs can be
// read meanwhile. Never waits: tiles that were begun are still rendered. A commit is not held up, and a
// render that is started during a pause waits before its first sample. trz_render_cancel and edits
// work as always; the pause stays until it is ended.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_render_pause(struct trz_session *session,
                            uint32_t paused);

// Fills out, whose struct_size the caller has set. Never waits.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_render_progress(struct trz_session *session, struct trz_progress *out);

// Fills out, whose struct_size the caller has set, with numbers of the last commit and the last
// render; those of a render come when it ends.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size), TRZ_ERROR_POISONED.
// Threads: any.
trz_result trz_statistics_get(struct trz_session *session, struct trz_statistics *out);

// Writes a text (UTF-8, with a NUL) into buffer that tells which effects the committed scene calls
// for and which prim called for each. out_needed becomes the bytes needed, also with
// TRZ_ERROR_BUFFER_TOO_SMALL; with capacity 0 that is all that is done.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_BUFFER_TOO_SMALL, TRZ_ERROR_NOT_FOUND (nothing was
// committed), TRZ_ERROR_POISONED. Threads: any.
trz_result trz_explain(struct trz_session *session,
                       char *buffer,
                       size_t capacity,
                       size_t *out_needed);

// Writes the scene with all queued edits as text: prims in the order of their paths, motion at keys
// across the shutter, instances, camera and settings, and what is wrong with them. Two hosts that
// mean the same scene get the same text. Nothing is diced or rendered; a running render goes on.
// out_needed becomes the bytes needed, also with TRZ_ERROR_BUFFER_TOO_SMALL; with capacity 0 that is
// all that is done.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_BUFFER_TOO_SMALL, TRZ_ERROR_BUSY, TRZ_ERROR_POISONED.
// Threads: any; waits for a commit.
trz_result trz_scene_dump(struct trz_session *session,
                          char *buffer,
                          size_t capacity,
                          size_t *out_needed);

// The same text, to a file. One that was there before is replaced only by a whole one.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_IO, TRZ_ERROR_BUSY,
// TRZ_ERROR_POISONED. Threads: any; waits for a commit.
trz_result trz_scene_write(struct trz_session *session, const char *path);

// Has the products and the view rendered on a thread of the session, and returns at once: commits what
// is queued, and renders one image after the other, each from the first sample. Those that agree in
// camera and settings are one. Products are written when their samples were taken, then the view is
// rendered, which AOVs can be read of. What runs is given up; nothing is done where the same was asked
// for last and nothing was edited since. What trz_session_destroy interrupts is kept beside the places of
// its files, as trz_image.partial says. trz_render_progress tells how far it is. Settings, AOVs and
// the active camera of the session are those of the image that is rendered.
//
// Products that cannot be are left out, and a backend that is not there is replaced, with one warning. A
// render that fails and a file that cannot be written give a message. Not to be mixed with
// trz_render_start.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (camera),
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_view_render(struct trz_session *session,
                           const struct trz_view *view,
                           const struct trz_product *const *products,
                           size_t product_count);

// Gives up what trz_view_render has rendered, and keeps it from rendering until trz_view_resume; 1: waits
// until nothing runs. What was rendered can be read, but no file is kept of it: not where the session is
// destroyed before trz_view_resume either.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_BUSY (waiting inside a log
// callback), TRZ_ERROR_POISONED. Threads: any.
trz_result trz_view_stop(struct trz_session *session,
                         uint32_t wait);

// Ends trz_view_stop: what was given up is rendered anew.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_view_resume(struct trz_session *session);

// Fills a host's buffer with an AOV of what trz_view_render has rendered, where that is more than the
// buffer shows: converted, at the buffer's place, over its clear value. What is rendered anew is shown as
// soon as every pixel has a sample, and until then what was there.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_BUFFER_TOO_SMALL,
// TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any, also while rendering; one at a time for a
// buffer.
trz_result trz_view_show(struct trz_session *session,
                         const char *aov,
                         struct trz_buffer *buffer);

// Says what trz_view_render would make of a view and its products, for a host that renders and writes
// each by itself: which share a render, where they are written, and which cannot be, of which one warning
// tells. Renders are numbered in the order in which trz_view_render makes them. The caller gives the plan
// back to trz_plan_destroy. No edit and no render of the session is changed; it remembers the files, so
// that a plan of another frame tells where that would replace them.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_OUT_OF_MEMORY,
// TRZ_ERROR_POISONED. Threads: any.
trz_result trz_plan_create(struct trz_session *session,
                           const struct trz_view *view,
                           const struct trz_product *const *products,
                           size_t product_count,
                           struct trz_plan **out);

// Fills out, whose struct_size the caller has set, with what becomes of a product, by its place in the
// array of trz_plan_create; the number after the last is the host's own image.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (struct_size), TRZ_ERROR_NOT_FOUND.
// Threads: any.
trz_result trz_plan_describe(const struct trz_plan *plan,
                             size_t product,
                             struct trz_planned *out);

// Frees a plan. NULL is ignored.
//
// Errors: none. Threads: any, but no other call on the plan may be running or follow.
void trz_plan_destroy(struct trz_plan *plan);

// The pixels of a dataWindowNDC (xmin, ymin, xmax, ymax, y up; 0 0 1 1 is the image), as
// trz_settings.data_window has them: those whose centres are inside. All 0 for the image.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT (the size is not 1 to 65536 pixels, the
// window cannot be), TRZ_ERROR_NOT_FOUND (it holds no pixel, or more than 65536 across or down).
// Threads: any.
trz_result trz_data_window(const float *ndc,
                           uint32_t width,
                           uint32_t height,
                           int32_t *out);

// Fills out, whose struct_size the caller has set, with the size and type of an AOV of the last
// render that was started.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (no such AOV, or
// no render yet), TRZ_ERROR_POISONED. Threads: any, also while rendering.
trz_result trz_aov_describe(struct trz_session *session,
                            const char *name,
                            struct trz_aov_desc *out);

// Copies an AOV of the last render that was started, as far as it is: rows from the top down,
// components of 4 bytes, nothing between them. bytes is buffer's size, at least
// width * height * components * 4.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (no such AOV, or
// no render yet), TRZ_ERROR_BUFFER_TOO_SMALL, TRZ_ERROR_POISONED. Threads: any, also while
// rendering.
trz_result trz_aov_read(struct trz_session *session, const char *name, void *buffer, size_t bytes);

// Copies the name of the AOV that a render var is written from, to be given to
// trz_session_set_aovs. What the var asks for that is not done gives one warning, which names it.
// capacity counts bytes with the terminating NUL; out_needed receives what is needed, also where
// the buffer is too small. buffer may be NULL where capacity is 0.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_UNSUPPORTED (leave the var
// out), TRZ_ERROR_BUFFER_TOO_SMALL, TRZ_ERROR_POISONED. Threads: any.
trz_result trz_render_var_aov(struct trz_session *session,
                              const struct trz_render_var *var,
                              char *buffer,
                              size_t capacity,
                              size_t *out_needed);

// Writes AOVs of the last render that was started to a file. A file that was there before is
// replaced only once this one is written to its end. Everything passed is read before this returns and not kept.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (no such AOV, or
// no render yet), TRZ_ERROR_UNSUPPORTED, TRZ_ERROR_IO, TRZ_ERROR_POISONED. Threads: any, also
// while rendering.
trz_result trz_image_write(struct trz_session *session,
                           const char *path,
                           const struct trz_image *image);

// Traces count rays against the committed scene and fills hits[i] with the nearest hit of rays[i].
// A ray with numbers that are not finite, or without a direction, misses. Queued edits are not
// seen before they are committed.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (nothing was
// committed), TRZ_ERROR_OUT_OF_MEMORY, TRZ_ERROR_POISONED. Threads: any, also while rendering.
trz_result trz_trace_rays(struct trz_session *session,
                          const struct trz_ray *rays,
                          struct trz_hit *hits,
                          size_t count);

// Fills out, whose struct_size the caller has set, with what is known of a device: number 0 is the best one. The first
// call loads drivers, which may take a second.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_INVALID_ARGUMENT, TRZ_ERROR_NOT_FOUND (there are not so many).
// Threads: any.
trz_result trz_device_describe(size_t index,
                               struct trz_device *out);

// Writes a text (UTF-8, with a NUL) into buffer that tells what TRZ_BACKEND_AUTO is here, and why. Where there is a GPU
// on which no verdict is kept, the first call, or the first settings that ask for auto, render a small frame on both, which may take
// some seconds. out_needed becomes the bytes needed, also with TRZ_ERROR_BUFFER_TOO_SMALL; with capacity 0 that is all that
// is written.
//
// Errors: TRZ_ERROR_NULL_POINTER, TRZ_ERROR_BUFFER_TOO_SMALL. Threads: any.
trz_result trz_auto_describe(char *buffer,
                             size_t capacity,
                             size_t *out_needed);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* HDTRAPEZE_H */
