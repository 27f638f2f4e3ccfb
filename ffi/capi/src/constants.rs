//! Numbers of the C ABI: result codes and the values of enum-like fields.
//!
//! Plain constants, so that the header has `#define NAME value` lines that C, C++ and parsers of
//! the header read alike. A number is never reused and never changes its meaning.

/// Version of this ABI: grows when functions or fields are added; what is there never changes.
pub const TRZ_ABI_VERSION: u32 = 1;

/// Success.
pub const TRZ_OK: i32 = 0;
/// A pointer that must not be null is null.
pub const TRZ_ERROR_NULL_POINTER: i32 = 1;
/// An argument is out of range, not UTF-8, of an unknown kind, or contradicts another.
pub const TRZ_ERROR_INVALID_ARGUMENT: i32 = 2;
/// No prim, AOV, committed scene or render of that name or number.
pub const TRZ_ERROR_NOT_FOUND: i32 = 3;
/// Well formed, but this build or version cannot do it.
pub const TRZ_ERROR_UNSUPPORTED: i32 = 4;
/// Memory was refused; the session is unharmed.
pub const TRZ_ERROR_OUT_OF_MEMORY: i32 = 5;
/// A file could not be written; what was there before is untouched.
pub const TRZ_ERROR_IO: i32 = 6;
/// Cancelled before it was done.
pub const TRZ_ERROR_CANCELLED: i32 = 7;
/// An earlier call failed with TRZ_ERROR_INTERNAL; the session can only be destroyed.
pub const TRZ_ERROR_POISONED: i32 = 8;
/// Would wait for itself: called from the session's own log callback.
pub const TRZ_ERROR_BUSY: i32 = 9;
/// The buffer given is too small.
pub const TRZ_ERROR_BUFFER_TOO_SMALL: i32 = 10;
/// A defect of the library; it poisons the session.
pub const TRZ_ERROR_INTERNAL: i32 = 11;

/// subdivisionScheme catmullClark.
pub const TRZ_SCHEME_CATMULL_CLARK: u32 = 0;
/// subdivisionScheme loop; triangles only.
pub const TRZ_SCHEME_LOOP: u32 = 1;
/// subdivisionScheme bilinear.
pub const TRZ_SCHEME_BILINEAR: u32 = 2;
/// subdivisionScheme none: polygons.
pub const TRZ_SCHEME_NONE: u32 = 3;

/// interpolateBoundary none.
pub const TRZ_BOUNDARY_NONE: u32 = 0;
/// interpolateBoundary edgeOnly.
pub const TRZ_BOUNDARY_EDGE_ONLY: u32 = 1;
/// interpolateBoundary edgeAndCorner (USD's default).
pub const TRZ_BOUNDARY_EDGE_AND_CORNER: u32 = 2;

/// faceVaryingLinearInterpolation none.
pub const TRZ_FVAR_NONE: u32 = 0;
/// faceVaryingLinearInterpolation cornersOnly.
pub const TRZ_FVAR_CORNERS_ONLY: u32 = 1;
/// faceVaryingLinearInterpolation cornersPlus1 (USD's default).
pub const TRZ_FVAR_CORNERS_PLUS1: u32 = 2;
/// faceVaryingLinearInterpolation cornersPlus2.
pub const TRZ_FVAR_CORNERS_PLUS2: u32 = 3;
/// faceVaryingLinearInterpolation boundaries.
pub const TRZ_FVAR_BOUNDARIES: u32 = 4;
/// faceVaryingLinearInterpolation all.
pub const TRZ_FVAR_ALL: u32 = 5;

/// triangleSubdivisionRule catmullClark (USD's default).
pub const TRZ_TRIANGLES_CATMULL_CLARK: u32 = 0;
/// triangleSubdivisionRule smooth.
pub const TRZ_TRIANGLES_SMOOTH: u32 = 1;

/// orientation rightHanded (USD's default).
pub const TRZ_ORIENTATION_RIGHT_HANDED: u32 = 0;
/// orientation leftHanded.
pub const TRZ_ORIENTATION_LEFT_HANDED: u32 = 1;

/// elementType face (USD's default).
pub const TRZ_ELEMENT_FACE: u32 = 0;
/// elementType point.
pub const TRZ_ELEMENT_POINT: u32 = 1;
/// elementType edge.
pub const TRZ_ELEMENT_EDGE: u32 = 2;
/// elementType segment.
pub const TRZ_ELEMENT_SEGMENT: u32 = 3;
/// elementType tetrahedron.
pub const TRZ_ELEMENT_TETRAHEDRON: u32 = 4;

/// familyType unrestricted (USD's default).
pub const TRZ_FAMILY_UNRESTRICTED: u32 = 0;
/// familyType nonOverlapping.
pub const TRZ_FAMILY_NON_OVERLAPPING: u32 = 1;
/// familyType partition.
pub const TRZ_FAMILY_PARTITION: u32 = 2;

/// type linear: the basis is not used.
pub const TRZ_BASIS_LINEAR: u32 = 0;
/// type cubic, basis bezier (USD's default).
pub const TRZ_BASIS_BEZIER: u32 = 1;
/// type cubic, basis bspline.
pub const TRZ_BASIS_BSPLINE: u32 = 2;
/// type cubic, basis catmullRom.
pub const TRZ_BASIS_CATMULL_ROM: u32 = 3;
/// type cubic, basis hermite: positions and tangents by turns.
pub const TRZ_BASIS_HERMITE: u32 = 4;

/// wrap nonperiodic (USD's default).
pub const TRZ_WRAP_NONPERIODIC: u32 = 0;
/// wrap periodic.
pub const TRZ_WRAP_PERIODIC: u32 = 1;
/// wrap pinned.
pub const TRZ_WRAP_PINNED: u32 = 2;

/// Of a prim: as the settings say. Of the settings: as TRZ_CURVES_AUTO.
pub const TRZ_CURVES_DEFAULT: u32 = 0;
/// Curves without normals are tubes where they are wide on screen, else ribbons.
pub const TRZ_CURVES_AUTO: u32 = 1;
/// They are ribbons that face the camera; instanced ones are tubes.
pub const TRZ_CURVES_RIBBONS: u32 = 2;
/// They are tubes.
pub const TRZ_CURVES_TUBES: u32 = 3;

/// UsdGeomCube. Sizes: edge.
pub const TRZ_IMPLICIT_CUBE: u32 = 0;
/// UsdGeomPlane, facing along its axis. Sizes: width, length.
pub const TRZ_IMPLICIT_PLANE: u32 = 1;
/// UsdGeomSphere. Sizes: radius.
pub const TRZ_IMPLICIT_SPHERE: u32 = 2;
/// UsdGeomCylinder and UsdGeomCylinder_1. Sizes: height, radius at the lower and at the upper end.
pub const TRZ_IMPLICIT_CYLINDER: u32 = 3;
/// UsdGeomCone, its tip up the axis. Sizes: height, radius.
pub const TRZ_IMPLICIT_CONE: u32 = 4;
/// UsdGeomCapsule and UsdGeomCapsule_1: domes touch the side. Sizes: height of the side, its radius
/// at the lower and at the upper end.
pub const TRZ_IMPLICIT_CAPSULE: u32 = 5;

/// Along x.
pub const TRZ_AXIS_X: u32 = 0;
/// Along y.
pub const TRZ_AXIS_Y: u32 = 1;
/// Along z (USD's default).
pub const TRZ_AXIS_Z: u32 = 2;

/// Matrices, 16 doubles each; USD layout.
pub const TRZ_PATH_MATRICES: u32 = 0;
/// Points, 3 doubles each.
pub const TRZ_PATH_POINTS: u32 = 1;

/// One value for the prim.
pub const TRZ_INTERPOLATION_CONSTANT: u32 = 0;
/// One value a face, or a curve.
pub const TRZ_INTERPOLATION_UNIFORM: u32 = 1;
/// One value a point, linear over faces; of curves, one a segment end.
pub const TRZ_INTERPOLATION_VARYING: u32 = 2;
/// One value a point, smoothed with the scheme or basis.
pub const TRZ_INTERPOLATION_VERTEX: u32 = 3;
/// One value a face-vertex.
pub const TRZ_INTERPOLATION_FACE_VARYING: u32 = 4;

/// 32-bit floats.
pub const TRZ_NUMBERS_FLOAT32: u32 = 0;
/// 64-bit floats.
pub const TRZ_NUMBERS_FLOAT64: u32 = 1;
/// 16-bit floats.
pub const TRZ_NUMBERS_FLOAT16: u32 = 2;
/// 32-bit signed integers.
pub const TRZ_NUMBERS_INT32: u32 = 3;
/// 32-bit unsigned integers.
pub const TRZ_NUMBERS_UINT32: u32 = 4;
/// 64-bit signed integers.
pub const TRZ_NUMBERS_INT64: u32 = 5;
/// 64-bit unsigned integers.
pub const TRZ_NUMBERS_UINT64: u32 = 6;
/// 8-bit unsigned integers and truth values.
pub const TRZ_NUMBERS_UINT8: u32 = 7;

/// No role, or one that does not matter here.
pub const TRZ_ROLE_NONE: u32 = 0;
/// A colour: as an AOV it has channels R, G, B and A.
pub const TRZ_ROLE_COLOR: u32 = 1;

/// Perspective camera.
pub const TRZ_PROJECTION_PERSPECTIVE: u32 = 0;
/// Orthographic camera; apertures are the size of the view.
pub const TRZ_PROJECTION_ORTHOGRAPHIC: u32 = 1;

/// Points of a shutter's curve are joined by straight lines.
pub const TRZ_SHUTTER_LINEAR: u32 = 0;
/// Points of a shutter's curve make cubic Bezier segments: 3 n + 1, of which every third is on the
/// curve.
pub const TRZ_SHUTTER_BEZIER: u32 = 1;

/// Box filter, 1 pixel wide unless a width is given.
pub const TRZ_FILTER_BOX: u32 = 0;
/// Gaussian filter, 2 pixels wide.
pub const TRZ_FILTER_GAUSSIAN: u32 = 1;
/// Mitchell-Netravali filter, 4 pixels wide.
pub const TRZ_FILTER_MITCHELL: u32 = 2;
/// Blackman-Harris filter, 3 pixels wide.
pub const TRZ_FILTER_BLACKMAN_HARRIS: u32 = 3;

/// Keep the camera's width, change its height.
pub const TRZ_WINDOW_MATCH_HORIZONTALLY: u32 = 0;
/// Keep the camera's height, change its width (usdrecord's).
pub const TRZ_WINDOW_MATCH_VERTICALLY: u32 = 1;
/// Show all of the camera's view, and more.
pub const TRZ_WINDOW_FIT: u32 = 2;
/// Fill the image with part of the camera's view.
pub const TRZ_WINDOW_CROP: u32 = 3;
/// Stretch.
pub const TRZ_WINDOW_DONT_CONFORM: u32 = 4;

/// Both sides of surfaces are seen.
pub const TRZ_CULL_NONE: u32 = 0;
/// Rays pass through backs.
pub const TRZ_CULL_BACK: u32 = 1;
/// Rays pass through fronts.
pub const TRZ_CULL_FRONT: u32 = 2;
/// Rays pass through backs, but for prims that are double-sided.
pub const TRZ_CULL_BACK_UNLESS_DOUBLE_SIDED: u32 = 3;

/// What is fastest: a GPU where a trial found it faster than the CPU, see trz_auto_describe; else the CPU.
pub const TRZ_BACKEND_AUTO: u32 = 0;
/// All on the CPU.
pub const TRZ_BACKEND_CPU: u32 = 1;
/// A GPU renders what it knows, and the CPU the rest; see trz_device_describe. Settings that ask for it are refused
/// with TRZ_ERROR_UNSUPPORTED where no device opens. A scene that the device does not take, and a device that is
/// lost, give one warning, and the CPU renders, or goes on from the samples that there are.
pub const TRZ_BACKEND_GPU: u32 = 2;

/// Something that no setting has.
pub const TRZ_VALUE_NONE: u32 = 0;
/// True or false.
pub const TRZ_VALUE_BOOL: u32 = 1;
/// A whole number.
pub const TRZ_VALUE_INTEGER: u32 = 2;
/// A number.
pub const TRZ_VALUE_REAL: u32 = 3;
/// A word.
pub const TRZ_VALUE_TEXT: u32 = 4;
/// Two numbers.
pub const TRZ_VALUE_PAIR: u32 = 5;

/// A driver that computes on the CPU.
pub const TRZ_DEVICE_SOFTWARE: u32 = 0;
/// Unknown, or virtual.
pub const TRZ_DEVICE_OTHER: u32 = 1;
/// Shares memory with the CPU.
pub const TRZ_DEVICE_INTEGRATED: u32 = 2;
/// Has memory of its own.
pub const TRZ_DEVICE_DISCRETE: u32 = 3;

/// Something failed.
pub const TRZ_LOG_ERROR: u32 = 0;
/// Something in the scene was repaired, dropped or coarsened.
pub const TRZ_LOG_WARN: u32 = 1;
/// What a user wants to read.
pub const TRZ_LOG_INFO: u32 = 2;
/// What a developer wants to read.
pub const TRZ_LOG_DEBUG: u32 = 3;

/// 32-bit float components.
pub const TRZ_FORMAT_FLOAT32: u32 = 0;
/// 32-bit signed integer components.
pub const TRZ_FORMAT_INT32: u32 = 1;

/// 32-bit floats.
pub const TRZ_COMPONENT_FLOAT32: u32 = 0;
/// 16-bit floats.
pub const TRZ_COMPONENT_FLOAT16: u32 = 1;
/// 32-bit signed integers.
pub const TRZ_COMPONENT_INT32: u32 = 2;
/// Bytes, 255 for 1.
pub const TRZ_COMPONENT_UNORM8: u32 = 3;
/// Signed bytes, 127 for 1.
pub const TRZ_COMPONENT_SNORM8: u32 = 4;

/// OpenEXR, one layer an AOV.
pub const TRZ_IMAGE_EXR: u32 = 0;
/// PNG, 8 bits a channel, one AOV.
pub const TRZ_IMAGE_PNG: u32 = 1;

/// 16-bit floats.
pub const TRZ_PIXEL_HALF: u32 = 0;
/// 32-bit floats.
pub const TRZ_PIXEL_FLOAT: u32 = 1;

/// Uncompressed EXR.
pub const TRZ_COMPRESSION_NONE: u32 = 0;
/// Run lengths.
pub const TRZ_COMPRESSION_RLE: u32 = 1;
/// Zip, one scan line a block.
pub const TRZ_COMPRESSION_ZIPS: u32 = 2;
/// Zip, 16 scan lines a block.
pub const TRZ_COMPRESSION_ZIP: u32 = 3;
/// Wavelet.
pub const TRZ_COMPRESSION_PIZ: u32 = 4;

/// Linear values as rendered.
pub const TRZ_COLOR_LINEAR: u32 = 0;
/// Encoded with sRGB's transfer function.
pub const TRZ_COLOR_SRGB: u32 = 1;

/// Nothing was rendered yet.
pub const TRZ_STATE_IDLE: u32 = 0;
/// Edits are applied, surfaces diced, the BVH built.
pub const TRZ_STATE_PREPARING: u32 = 1;
/// Rays are traced.
pub const TRZ_STATE_RENDERING: u32 = 2;
/// Every sample was taken.
pub const TRZ_STATE_FINISHED: u32 = 3;
/// Stopped early; what was rendered is kept.
pub const TRZ_STATE_CANCELLED: u32 = 4;
/// Failed; trz_render_wait tells why.
pub const TRZ_STATE_FAILED: u32 = 5;
/// A render waits, with the samples that it has (trz_render_pause).
pub const TRZ_STATE_PAUSED: u32 = 6;
