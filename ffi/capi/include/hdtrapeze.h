#ifndef HDTRAPEZE_H
#define HDTRAPEZE_H
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

typedef struct trz_session trz_session;
typedef uint64_t trz_id; /* a prim or camera of one session; 0 is none; never reused */
typedef int32_t trz_result; /* TRZ_OK or one of TRZ_ERROR_*; codes are never reused */
#define TRZ_OK 0
#define TRZ_ERROR_NULL_POINTER 1
#define TRZ_ERROR_INVALID_ARGUMENT 2
#define TRZ_ERROR_NOT_FOUND 3
#define TRZ_ERROR_UNSUPPORTED 4
#define TRZ_ERROR_OUT_OF_MEMORY 5
#define TRZ_ERROR_IO 6
#define TRZ_ERROR_CANCELLED 7
#define TRZ_ERROR_POISONED 8
#define TRZ_ERROR_BUSY 9
#define TRZ_ERROR_BUFFER_TOO_SMALL 10
#define TRZ_ERROR_INTERNAL 11

/* enums travel as uint32_t */
enum { TRZ_SCHEME_CATMULL_CLARK = 0, TRZ_SCHEME_LOOP = 1, TRZ_SCHEME_BILINEAR = 2, TRZ_SCHEME_NONE = 3 };
enum { TRZ_BOUNDARY_NONE = 0, TRZ_BOUNDARY_EDGE_ONLY = 1, TRZ_BOUNDARY_EDGE_AND_CORNER = 2 };
enum { TRZ_FVAR_NONE = 0, TRZ_FVAR_CORNERS_ONLY = 1, TRZ_FVAR_CORNERS_PLUS1 = 2, TRZ_FVAR_CORNERS_PLUS2 = 3, TRZ_FVAR_BOUNDARIES = 4, TRZ_FVAR_ALL = 5 };
enum { TRZ_TRIANGLES_CATMULL_CLARK = 0, TRZ_TRIANGLES_SMOOTH = 1 };
enum { TRZ_ORIENTATION_RIGHT_HANDED = 0, TRZ_ORIENTATION_LEFT_HANDED = 1 };
enum { TRZ_INTERPOLATION_CONSTANT = 0, TRZ_INTERPOLATION_UNIFORM = 1, TRZ_INTERPOLATION_VARYING = 2, TRZ_INTERPOLATION_VERTEX = 3, TRZ_INTERPOLATION_FACE_VARYING = 4 };
enum { TRZ_PROJECTION_PERSPECTIVE = 0, TRZ_PROJECTION_ORTHOGRAPHIC = 1 };
enum { TRZ_FILTER_BOX = 0, TRZ_FILTER_GAUSSIAN = 1, TRZ_FILTER_MITCHELL = 2, TRZ_FILTER_BLACKMAN_HARRIS = 3 };
enum { TRZ_WINDOW_MATCH_HORIZONTALLY = 0, TRZ_WINDOW_MATCH_VERTICALLY = 1, TRZ_WINDOW_FIT = 2, TRZ_WINDOW_CROP = 3, TRZ_WINDOW_DONT_CONFORM = 4 };
enum { TRZ_BACKEND_AUTO = 0, TRZ_BACKEND_CPU = 1, TRZ_BACKEND_GPU = 2 };
enum { TRZ_LOG_ERROR = 0, TRZ_LOG_WARN = 1, TRZ_LOG_INFO = 2, TRZ_LOG_DEBUG = 3 };
enum { TRZ_FORMAT_FLOAT32 = 0, TRZ_FORMAT_INT32 = 1 };
enum { TRZ_IMAGE_EXR = 0, TRZ_IMAGE_PNG = 1 };
enum { TRZ_PIXEL_HALF = 0, TRZ_PIXEL_FLOAT = 1 };
enum { TRZ_COMPRESSION_NONE = 0, TRZ_COMPRESSION_RLE = 1, TRZ_COMPRESSION_ZIPS = 2, TRZ_COMPRESSION_ZIP = 3, TRZ_COMPRESSION_PIZ = 4 };
enum { TRZ_COLOR_LINEAR = 0, TRZ_COLOR_SRGB = 1 };

/* Every struct begins with its own size, for versioning. */
typedef struct trz_transform_samples { /* one level of the hierarchy */
  const double *times;    /* count; time codes relative to the frame */
  const double *matrices; /* count * 16; USD layout: row-major, row vectors, local to parent */
  size_t count;
} trz_transform_samples;

typedef struct trz_topology {
  uint32_t struct_size;
  uint32_t scheme, boundary, face_varying, triangles, orientation;
  const int32_t *face_vertex_counts; size_t face_count;
  const int32_t *face_vertex_indices; size_t index_count;
  const int32_t *holes; size_t hole_count;
  const int32_t *crease_indices; size_t crease_index_count;
  const int32_t *crease_lengths; size_t crease_count;
  const float *crease_sharpnesses; size_t crease_sharpness_count; /* one a crease, or one an edge */
  const int32_t *corner_indices; size_t corner_count;
  const float *corner_sharpnesses; size_t corner_sharpness_count;
} trz_topology;

typedef struct trz_points {
  uint32_t struct_size;
  const double *times; size_t sample_count;
  const float *const *points;  /* sample_count arrays of 3 * counts[i] floats */
  const size_t *counts;        /* points of each sample */
} trz_points;

typedef struct trz_primvar {
  uint32_t struct_size;
  uint32_t interpolation;
  uint32_t width;               /* floats a value, 1 to 16 */
  const float *values; size_t value_count;
  const int32_t *indices; size_t index_count; /* 0: not indexed */
} trz_primvar;

typedef struct trz_instances {
  uint32_t struct_size;
  const double *times; size_t sample_count;
  const double *matrices;  /* [sample][instance][16], USD layout; world = prim transform, then this */
  size_t instance_count;
  const int32_t *ids;      /* instance_count, or NULL for 0, 1, 2... */
} trz_instances;

typedef struct trz_grids { /* already diced */
  uint32_t struct_size;
  const double *times; size_t key_count;
  const uint16_t *rates;    /* grid_count * 2: nu, nv; 1 to 16 */
  const uint32_t *elements; /* grid_count, or NULL for the grid's number */
  size_t grid_count;
  const float *positions;   /* for each grid, each key, (nv+1) rows of (nu+1) xyz */
  size_t position_count;    /* vertices over all grids and keys */
} trz_grids;

typedef struct trz_camera { /* all lengths in scene units */
  uint32_t struct_size;
  uint32_t projection;
  double horizontal_aperture, vertical_aperture;
  double horizontal_aperture_offset, vertical_aperture_offset;
  double focal_length, focus_distance, f_stop;
  double clipping_near, clipping_far;
  double shutter_open, shutter_close;
  double exposure_scale;
} trz_camera;

typedef struct trz_settings {
  uint32_t struct_size;
  uint32_t width, height;
  uint32_t crop[4];          /* x0 y0 x1 y1, half open, y down; all 0 for the whole image */
  float pixel_aspect;
  uint32_t window_policy;
  uint32_t samples;
  float shading_rate;
  uint32_t filter;
  float filter_width;        /* 0: the filter's own */
  uint32_t seed;
  uint32_t threads;          /* 0: all cores */
  uint32_t override_shutter; /* 1: shutter_* in place of the camera's */
  double shutter_open, shutter_close;
  uint32_t disable_motion_blur, disable_defocus;
  uint32_t camera_light;
  float time_window[2];      /* part of the shutter that is sampled; 0, 1 for all */
  uint32_t fix_lens;         /* 1: every sample goes through lens_point (unit disk) */
  float lens_point[2];
  uint64_t max_micropolygons;
  uint32_t backend;
} trz_settings;

typedef struct trz_progress {
  uint32_t struct_size;
  uint32_t state;            /* 0 idle, 1 preparing, 2 rendering, 3 finished, 4 cancelled, 5 failed */
  double fraction;           /* of the samples */
  uint32_t samples_done;     /* samples a pixel that every pixel has */
  uint32_t samples_total;
  double seconds;            /* since the start */
  double seconds_left;       /* estimate; negative while unknown */
} trz_progress;

typedef struct trz_statistics {
  uint32_t struct_size;
  uint64_t prims, instances, objects, grids, micropolygons, limit_evaluations;
  uint64_t geometry_bytes, bvh_bytes, bvh_nodes, film_bytes, peak_bytes;
  double translate_seconds, dice_seconds, build_seconds, trace_seconds, total_seconds;
  uint64_t rays, node_tests, cell_tests;
  uint64_t objects_diced, objects_reused; /* by the last commit */
} trz_statistics;

typedef struct trz_aov_desc {
  uint32_t struct_size;
  uint32_t width, height, components, format;
} trz_aov_desc;

typedef struct trz_image {
  uint32_t struct_size;
  uint32_t type;             /* TRZ_IMAGE_* */
  uint32_t pixel_type;       /* EXR; ids and depth are always 32 bits */
  uint32_t compression;      /* EXR */
  uint32_t color;            /* TRZ_COLOR_*: what color is encoded to */
  const char *const *aovs; size_t aov_count;           /* none: all that were rendered (PNG: color) */
  const char *const *metadata; size_t metadata_count;  /* name, value, name, value... */
} trz_image;

typedef struct trz_ray { float origin[3]; float dir[3]; float time; float t_min; float t_max; } trz_ray; /* world space */
typedef struct trz_hit {
  float t;               /* infinity: miss */
  float u, v;            /* in the micropolygon */
  float normal[3];       /* geometric, world, unit */
  int32_t prim_id, instance_id, element_id;  /* -1: miss */
  uint32_t grid, cell;
} trz_hit;

typedef void (*trz_log_fn)(void *user, uint32_t level, const char *prim_path, const char *code, const char *text);

uint32_t trz_abi_version(void);
const char *trz_version(void);
const char *trz_result_name(trz_result);
const char *trz_last_error(void); /* of this thread; "" when none */

trz_result trz_session_create(trz_session **out);
void trz_session_destroy(trz_session *);
trz_result trz_session_set_log(trz_session *, trz_log_fn, void *user, uint32_t level);

trz_result trz_mesh_create(trz_session *, const char *path, trz_id *out);
trz_result trz_mesh_set_topology(trz_session *, trz_id, const trz_topology *);
trz_result trz_mesh_set_points(trz_session *, trz_id, const trz_points *);
trz_result trz_grids_create(trz_session *, const char *path, trz_id *out);
trz_result trz_grids_set(trz_session *, trz_id, const trz_grids *);
trz_result trz_camera_create(trz_session *, const char *path, trz_id *out);
trz_result trz_camera_default(trz_camera *out);
trz_result trz_camera_set(trz_session *, trz_id, const trz_camera *);
trz_result trz_prim_set_transform(trz_session *, trz_id, const trz_transform_samples *levels, size_t level_count); /* own level first */
trz_result trz_prim_set_primvar(trz_session *, trz_id, const char *name, const trz_primvar *); /* NULL removes */
trz_result trz_prim_set_instances(trz_session *, trz_id, const trz_instances *); /* NULL: not instanced */
trz_result trz_prim_set_visible(trz_session *, trz_id, uint32_t visible);
trz_result trz_prim_set_pick_id(trz_session *, trz_id, int32_t prim_id);
trz_result trz_prim_remove(trz_session *, trz_id);
trz_result trz_session_set_active_camera(trz_session *, trz_id);

trz_result trz_settings_default(trz_settings *out);
trz_result trz_session_set_settings(trz_session *, const trz_settings *);
trz_result trz_session_set_aovs(trz_session *, const char *const *names, size_t count);

trz_result trz_session_commit(trz_session *);   /* blocks: applies edits, dices, builds */
trz_result trz_render_start(trz_session *);     /* commits what is pending, then renders on its own thread */
trz_result trz_render_wait(trz_session *, double seconds, uint32_t *out_finished); /* seconds < 0: for ever */
trz_result trz_render_cancel(trz_session *);    /* keeps what was rendered */
trz_result trz_render_progress(trz_session *, trz_progress *out);
trz_result trz_statistics_get(trz_session *, trz_statistics *out);
trz_result trz_explain(trz_session *, char *buffer, size_t capacity, size_t *out_needed);

trz_result trz_aov_describe(trz_session *, const char *name, trz_aov_desc *out);
trz_result trz_aov_read(trz_session *, const char *name, void *buffer, size_t bytes); /* rows top down */
trz_result trz_image_write(trz_session *, const char *path, const trz_image *);

trz_result trz_trace_rays(trz_session *, const trz_ray *rays, trz_hit *hits, size_t count);

#ifdef __cplusplus
}
#endif
#endif
