/*
 * A moving grid and a turning subdivision cube, rendered with motion blur and defocus through the C
 * ABI; then the same scene asked with single rays at three times.
 *
 * Usage: trapeze IMAGE.exr
 *
 * Build, after `cargo build --release -p hdtrapeze-capi`:
 *   cc -std=c99 -I ffi/capi/include examples/c/trapeze.c -L target/release -lhdtrapeze -lm \
 *      -Wl,-rpath,$PWD/target/release -o trapeze
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hdtrapeze.h"

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

/* Ends the program where a call failed. */
static void check(trz_result result, const char* what) {
    if (result != TRZ_OK) {
        fprintf(stderr, "%s: %s: %s\n", what, trz_result_name(result), trz_last_error());
        exit(1);
    }
}

static void print_message(void* user, uint32_t level, const char* prim, const char* code,
                          const char* text) {
    (void)user;
    fprintf(stderr, "[%u] %s %s: %s\n", (unsigned)level, prim, code, text);
}

/* A matrix in USD's layout: a turn around y, then a move. */
static void turn_and_move(double degrees, double x, double y, double z, double* matrix) {
    const double angle = degrees * 3.14159265358979323846 / 180.0;
    const double rows[16] = {cos(angle), 0, -sin(angle), 0, 0, 1, 0, 0,
                             sin(angle), 0, cos(angle),  0, x, y, z, 1};
    memcpy(matrix, rows, sizeof rows);
}

/* A cube that turns by 40 degrees while the shutter is open, with one sharp edge. */
static trz_id add_cube(trz_session* session) {
    static const float corners[8 * 3] = {-1, -1, 1,  1, -1, 1,  1, 1, 1,  -1, 1, 1,
                                         -1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1};
    static const int32_t counts[6] = {4, 4, 4, 4, 4, 4};
    static const int32_t indices[24] = {0, 1, 2, 3, 1, 5, 6, 2, 5, 4, 7, 6,
                                        4, 0, 3, 7, 3, 2, 6, 7, 4, 5, 1, 0};
    static const int32_t crease[2] = {2, 3};
    static const int32_t crease_length = 2;
    static const float crease_sharpness = 10;
    static const double time = 0;
    static const float red[3] = {0.8f, 0.2f, 0.15f};

    trz_id cube = 0;
    check(trz_mesh_create(session, "/cube", &cube), "create cube");

    trz_topology topology = {0};
    topology.struct_size = sizeof topology;
    topology.scheme = TRZ_SCHEME_CATMULL_CLARK;
    topology.boundary = TRZ_BOUNDARY_EDGE_AND_CORNER;
    topology.face_varying = TRZ_FVAR_CORNERS_PLUS1;
    topology.face_vertex_counts = counts;
    topology.face_count = COUNT(counts);
    topology.face_vertex_indices = indices;
    topology.index_count = COUNT(indices);
    topology.crease_indices = crease;
    topology.crease_index_count = COUNT(crease);
    topology.crease_lengths = &crease_length;
    topology.crease_count = 1;
    topology.crease_sharpnesses = &crease_sharpness;
    topology.crease_sharpness_count = 1;
    check(trz_mesh_set_topology(session, cube, &topology), "topology");

    const float* arrays[1] = {corners};
    const size_t point_counts[1] = {8};
    trz_points points = {0};
    points.struct_size = sizeof points;
    points.times = &time;
    points.sample_count = 1;
    points.points = arrays;
    points.counts = point_counts;
    check(trz_prim_set_points(session, cube, &points), "points");

    const void* colors[1] = {red};
    const size_t color_count = 1;
    trz_primvar color = {0};
    color.struct_size = sizeof color;
    color.interpolation = TRZ_INTERPOLATION_CONSTANT;
    color.type = TRZ_NUMBERS_FLOAT32;
    color.width = 3;
    color.element_size = 1;
    color.unauthored_index = -1;
    color.times = &time;
    color.sample_count = 1;
    color.values = colors;
    color.value_counts = &color_count;
    check(trz_prim_set_primvar(session, cube, "displayColor", &color), "displayColor");

    const double times[2] = {-0.25, 0.25};
    double matrices[2][16];
    turn_and_move(10, -1.2, 0, 0, matrices[0]);
    turn_and_move(50, -1.2, 0, 0, matrices[1]);
    const trz_transform_samples level = {times, matrices[0], COUNT(times), 0};
    check(trz_prim_set_transform(session, cube, &level, 1), "transform");
    check(trz_prim_set_pick_id(session, cube, 1), "pick id");
    return cube;
}

/* One grid of 4 x 4 micropolygons that moves up by 1 while the shutter is open. */
static trz_id add_grid(trz_session* session) {
    enum { RATE = 4, KEYS = 2 };
    static const double times[KEYS] = {-0.25, 0.25};
    static const uint16_t rates[2] = {RATE, RATE};
    float positions[KEYS][RATE + 1][RATE + 1][3];
    for (int key = 0; key < KEYS; ++key) {
        for (int j = 0; j <= RATE; ++j) {
            for (int i = 0; i <= RATE; ++i) {
                float* p = positions[key][j][i];
                p[0] = 0.5f + 2.0f * (float)i / RATE;
                p[1] = -1.5f + 2.0f * (float)j / RATE + (float)key;
                p[2] = -1.0f;
            }
        }
    }
    trz_id grid = 0;
    check(trz_grids_create(session, "/grid", &grid), "create grid");
    trz_grids grids = {0};
    grids.struct_size = sizeof grids;
    grids.times = times;
    grids.key_count = KEYS;
    grids.rates = rates;
    grids.grid_count = 1;
    grids.positions = &positions[0][0][0][0];
    grids.position_count = sizeof positions / (3 * sizeof(float));
    check(trz_grids_set(session, grid, &grids), "grids");
    check(trz_prim_set_pick_id(session, grid, 2), "pick id");
    return grid;
}

/* A camera at z = 16 whose lens is focused on the cube. */
static void add_camera(trz_session* session) {
    trz_id camera = 0;
    trz_camera lens = {0};
    lens.struct_size = sizeof lens;
    check(trz_camera_default(&lens), "camera default");
    lens.focus_distance = 16;
    lens.f_stop = 4;
    lens.clipping_near = 0.1;
    lens.shutter_open = -0.25;
    lens.shutter_close = 0.25;
    double matrix[16];
    const double time = 0;
    turn_and_move(0, 0, 0, 16, matrix);
    const trz_transform_samples level = {&time, matrix, 1, 0};
    check(trz_camera_create(session, "/camera", &camera), "create camera");
    check(trz_camera_set(session, camera, &lens), "camera");
    check(trz_prim_set_transform(session, camera, &level, 1), "camera transform");
    check(trz_session_set_active_camera(session, camera), "active camera");
}

static void render(trz_session* session, const char* path) {
    trz_settings settings = {0};
    settings.struct_size = sizeof settings;
    check(trz_settings_default(&settings), "settings default");
    settings.width = 320;
    settings.height = 180;
    settings.samples = 32;
    check(trz_session_set_settings(session, &settings), "settings");
    const char* aovs[] = {"color", "depth", "primId"};
    check(trz_session_set_aovs(session, aovs, COUNT(aovs)), "AOVs");
    check(trz_render_start(session), "start");

    uint32_t finished = 0;
    while (!finished) {
        trz_progress progress = {0};
        progress.struct_size = sizeof progress;
        check(trz_render_wait(session, 0.5, &finished), "wait");
        check(trz_render_progress(session, &progress), "progress");
        fprintf(stderr, "%3.0f %%\n", 100 * progress.fraction);
    }

    trz_statistics statistics = {0};
    statistics.struct_size = sizeof statistics;
    check(trz_statistics_get(session, &statistics), "statistics");
    printf("%llu micropolygons, %llu rays\n", (unsigned long long)statistics.micropolygons,
           (unsigned long long)statistics.rays);

    trz_image image = {0};
    image.struct_size = sizeof image;
    image.type = TRZ_IMAGE_EXR;
    image.pixel_type = TRZ_PIXEL_HALF;
    image.compression = TRZ_COMPRESSION_ZIP;
    check(trz_image_write(session, path, &image), "write image");
    printf("wrote %s\n", path);
}

/* The grid's lower edge passes a fixed ray while it moves up: hit early, missed late. */
static void query(trz_session* session) {
    static const float times[3] = {0.0f, 0.25f, 1.0f};
    trz_ray rays[3];
    trz_hit hits[3];
    for (size_t i = 0; i < COUNT(rays); ++i) {
        const trz_ray ray = {{1.6f, -1.0f, 8.0f}, {0, 0, -1}, times[i], 0, INFINITY};
        rays[i] = ray;
    }
    check(trz_trace_rays(session, rays, hits, COUNT(rays)), "trace");
    for (size_t i = 0; i < COUNT(rays); ++i) {
        if (isinf(hits[i].t)) {
            printf("time %.2f: miss\n", times[i]);
        } else {
            printf("time %.2f: prim %d at t %.3f, cell %u\n", times[i], (int)hits[i].prim_id,
                   hits[i].t, (unsigned)hits[i].cell);
        }
    }
}

int main(int argc, char** argv) {
    if (argc != 2) {
        fprintf(stderr, "usage: %s IMAGE.exr\n", argv[0]);
        return 2;
    }
    printf("hdTrapeze %s\n", trz_version());
    trz_session* session = NULL;
    check(trz_session_create(&session), "create session");
    check(trz_session_set_log(session, print_message, NULL, TRZ_LOG_WARN), "log");
    add_cube(session);
    add_grid(session);
    add_camera(session);
    render(session, argv[1]);
    query(session);
    trz_session_destroy(session);
    return 0;
}
