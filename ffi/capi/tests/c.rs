//! The header as C and C++ compilers see it: it compiles without a warning, and structs have the
//! layout that Rust gives them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use hdtrapeze::*;

fn include() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("include")
}

/// Compiles `source`; returns the program's path where it is to be linked.
fn compile(compiler: &str, standard: &str, name: &str, source: &str, link: bool) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let file = folder.join(name);
    fs::write(&file, source).unwrap();
    let program = file.with_extension("out");
    let mut command = Command::new(compiler);
    command.args([standard, "-Wall", "-Wextra", "-pedantic", "-Werror", "-I"]);
    command.arg(include()).arg(&file);
    match link {
        true => command.arg("-o").arg(&program),
        false => command.arg("-fsyntax-only"),
    };
    let done = command.output().expect("a C and C++ compiler is installed");
    let errors = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{compiler} {standard}: {errors}");
    program
}

#[test]
fn compiles_as_c99_and_cpp17() {
    let source = "#include \"hdtrapeze.h\"\n#include \"hdtrapeze.h\"\n\
                  int main(void) { return (int)sizeof(trz_settings) < 0; }\n";
    compile("cc", "-std=c99", "header.c", source, false);
    compile("c++", "-std=c++17", "header.cpp", source, false);
}

/// Lines "struct size" and "struct.field offset" by Rust, and the C statements that print the same.
#[derive(Default)]
struct Layouts {
    rust: String,
    c: String,
}

macro_rules! layouts {
    ($($name:ident { $($field:tt),* $(,)? })*) => {{
        let mut all = Layouts::default();
        $(
            // Does not compile where a field is forgotten.
            #[allow(dead_code)]
            fn $name(value: &$name) {
                let $name { $($field: _),* } = value;
            }
            let name = stringify!($name);
            all.rust += &format!("{name} {}\n", size_of::<$name>());
            all.c += &format!("printf(\"{name} %zu\\n\", sizeof({name}));\n");
            $(
                let field = stringify!($field).trim_start_matches("r#");
                let offset = std::mem::offset_of!($name, $field);
                all.rust += &format!("{name}.{field} {offset}\n");
                all.c += &format!(
                    "printf(\"{name}.{field} %zu\\n\", offsetof({name}, {field}));\n"
                );
            )*
        )*
        all
    }};
}

fn all_layouts() -> Layouts {
    layouts! {
        trz_transform_samples { times, matrices, count, turns }
        trz_path { struct_size, of, times, start_count, known_count, values, element_count }
        trz_topology {
            struct_size, scheme, boundary, face_varying, triangles, orientation,
            face_vertex_counts, face_count, face_vertex_indices, index_count, holes, hole_count,
            crease_indices, crease_index_count, crease_lengths, crease_count, crease_sharpnesses,
            crease_sharpness_count, corner_indices, corner_count, corner_sharpnesses,
            corner_sharpness_count,
        }
        trz_subset { path, family, family_type, element_type, indices, index_count }
        trz_float_samples { times, sample_count, values, counts }
        trz_points {
            struct_size, times, sample_count, points, counts, velocities, accelerations,
            time_codes_per_second,
        }
        trz_primvar {
            struct_size, interpolation, r#type, role, width, element_size, unauthored_index, times,
            sample_count, values, value_counts, indices, index_counts,
        }
        trz_matrix_samples { times, sample_count, values, counts }
        trz_instancer {
            struct_size, instance_count, prototype_count, prototypes, prototype_index_count, mask,
            mask_count, ids, id_count, positions, orientations, scales, matrices, velocities,
            accelerations, angular_velocities, time_codes_per_second, matrices_turn, lists,
            list_counts,
        }
        trz_curves { struct_size, basis, wrap, form, vertex_counts, curve_count }
        trz_implicit { struct_size, kind, axis, orientation, times, sizes, sample_count }
        trz_nurbs_patch {
            struct_size, orientation, u_order, v_order, u_vertex_count, v_vertex_count, u_knots,
            u_knot_count, v_knots, v_knot_count, u_range, v_range, weights, weight_count,
        }
        trz_nurbs_curves {
            struct_size, form, vertex_counts, orders, curve_count, knots, knot_count, ranges,
            range_count, weights, weight_count,
        }
        trz_grids {
            struct_size, times, key_count, rates, elements, grid_count, positions, position_count,
        }
        trz_lens_sample {
            time, horizontal_aperture, vertical_aperture, horizontal_aperture_offset,
            vertical_aperture_offset, focal_length, focus_distance, f_stop, exposure_scale,
        }
        trz_camera {
            struct_size, projection, horizontal_aperture, vertical_aperture,
            horizontal_aperture_offset, vertical_aperture_offset, focal_length, focus_distance,
            f_stop, clipping_near, clipping_far, shutter_open, shutter_close, exposure_scale,
            aperture_blades, shutter_curve_type, aperture_rotation, aperture_ratio,
            aperture_roundness, shutter_curve, shutter_curve_count, clipping_planes,
            clipping_plane_count, lens_samples, lens_sample_count,
        }
        trz_settings {
            struct_size, width, height, data_window, pixel_aspect, window_policy, samples, shading_rate,
            filter, filter_width, seed, threads, override_shutter, shutter_open, shutter_close,
            disable_motion_blur, disable_defocus, camera_light, time_window, fix_lens, lens_point,
            max_micropolygons, backend, curves, keep_finer, cull,
            occlusion_culling, compression, pixel_type, time_codes_per_second,
        }
        trz_value { kind, integer, numbers, text }
        trz_setting { struct_size, of_prims, name, label, fallback, kind, range, words, doc }
        trz_view {
            struct_size, aov_count, camera, settings, aovs, frame, settings_path, resolution, data_window,
            pixel_aspect, conform, shapes_view, windows_view, camera_aspect, path, has_resolution,
            has_data_window, has_pixel_aspect,
        }
        trz_product {
            struct_size, pixel_aspect, path, r#type, name, camera, camera_path, camera_aspect, resolution,
            data_window, conform, settings, vars, var_count, var_target_count,
        }
        trz_planned { struct_size, result, why, path, render, aov_count, aovs, settings }
        trz_buffer {
            struct_size, width, height, component, components, bottom_up, origin, clear, clear_type,
            clear_count, data, bytes, filled, samples, render, ended,
        }
        trz_progress {
            struct_size, state, fraction, samples_done, samples_total, seconds, seconds_left, edits,
            camera_edits, view_starts, view_readable, view_converged, view_stopped,
        }
        trz_statistics {
            struct_size, prims, instances, objects, grids, micropolygons, limit_evaluations,
            geometry_bytes, bvh_bytes, bvh_nodes, film_bytes, peak_bytes, translate_seconds,
            dice_seconds, build_seconds, trace_seconds, total_seconds, rays, node_tests,
            cell_tests, objects_diced, objects_reused, objects_placed, clusters,
            clusters_culled, micropolygons_culled,
        }
        trz_device {
            struct_size, kind, name, api, driver, largest_buffer, largest_binding, workgroups,
            timestamps, subgroups, chosen,
        }
        trz_aov_desc { struct_size, width, height, components, format, origin_x, origin_y }
        trz_image {
            struct_size, r#type, pixel_type, compression, color, aovs, aov_count, metadata,
            metadata_count, vars, var_count, partial,
        }
        trz_render_var {
            path, source_name, source_type, data_type, format, name, channel_prefix,
        }
        trz_ray { origin, dir, time, t_min, t_max }
        trz_hit { t, u, v, normal, prim_id, instance_id, element_id, grid, cell }
    }
}

#[test]
fn structs_have_one_layout() {
    let layouts = all_layouts();
    let header = fs::read_to_string(include().join("hdtrapeze.h")).unwrap();
    for (_, rest) in header
        .match_indices("\ntypedef struct ")
        .map(|(at, found)| {
            let rest = &header[at + found.len()..];
            (at, rest)
        })
    {
        let name = rest.split([' ', ';']).next().unwrap_or_default();
        let opaque = ["trz_session", "trz_plan"].contains(&name);
        assert!(
            opaque || layouts.rust.contains(&format!("{name} ")),
            "{name} is not compared"
        );
    }
    let source = format!(
        "#include <stdio.h>\n#include \"hdtrapeze.h\"\nint main(void) {{\n{}return 0;\n}}\n",
        layouts.c
    );
    let program = compile("cc", "-std=c99", "layout.c", &source, true);
    let printed = Command::new(program).output().expect("runs");
    let c = String::from_utf8_lossy(&printed.stdout);
    for (rust, c) in layouts.rust.lines().zip(c.lines()) {
        assert_eq!(rust, c, "Rust's layout, C's layout");
    }
    assert_eq!(layouts.rust.lines().count(), c.lines().count());
}
