//! Every function gets null where it must not be.

use std::ffi::c_void;
use std::ptr::{null, null_mut};

use hdtrapeze::*;

use crate::support::*;

/// Calls each expression, which must return TRZ_ERROR_NULL_POINTER; returns the functions' names.
macro_rules! null_pointer {
    ($($function:ident($($argument:expr),* $(,)?);)*) => {{
        $(
            // SAFETY: arguments are null, or pointers to live values.
            let result = unsafe { $function($($argument),*) };
            assert_eq!(result, TRZ_ERROR_NULL_POINTER, stringify!($function($($argument),*)));
            assert!(last_error().contains("is null"), stringify!($function($($argument),*)));
        )*
        vec![$(stringify!($function)),*]
    }};
}

#[test]
fn null_session() {
    let s = null_mut();
    let (camera, settings) = (camera_default(), settings_default());
    let checked = null_pointer! {
        trz_session_set_log(s, None, null_mut(), 0);
        trz_mesh_create(s, c"/a".as_ptr(), &mut 0);
        trz_mesh_set_topology(s, 1, &topology());
        trz_mesh_set_subsets(s, 1, null(), 0);
        trz_prim_set_points(s, 1, null());
        trz_grids_create(s, c"/a".as_ptr(), &mut 0);
        trz_grids_set(s, 1, null());
        trz_curves_create(s, c"/a".as_ptr(), &mut 0);
        trz_curves_set(s, 1, null());
        trz_spheres_create(s, c"/a".as_ptr(), &mut 0);
        trz_implicit_create(s, c"/a".as_ptr(), &mut 0);
        trz_implicit_set(s, 1, null());
        trz_nurbs_patch_create(s, c"/a".as_ptr(), &mut 0);
        trz_nurbs_patch_set(s, 1, null());
        trz_nurbs_curves_create(s, c"/a".as_ptr(), &mut 0);
        trz_nurbs_curves_set(s, 1, null());
        trz_camera_create(s, c"/a".as_ptr(), &mut 0);
        trz_camera_set(s, 1, &camera);
        trz_prim_set_transform(s, 1, null(), 0);
        trz_prim_set_primvar(s, 1, c"a".as_ptr(), null());
        trz_instancer_create(s, c"/a".as_ptr(), &mut 0);
        trz_instancer_set(s, 1, null());
        trz_prim_set_instancer(s, 1, 0, 0);
        trz_prim_set_visible(s, 1, 1);
        trz_prim_set_matte(s, 1, 1);
        trz_prim_set_motion(s, 1, 1.0, 0);
        trz_prim_set_double_sided(s, 1, 1);
        trz_prim_set_pick_id(s, 1, 1);
        trz_prim_remove(s, 1);
        trz_session_set_active_camera(s, 0);
        trz_session_set_settings(s, &settings);
        trz_session_set_aovs(s, null(), 0);
        trz_session_commit(s);
        trz_render_start(s);
        trz_render_wait(s, 0.0, &mut 0);
        trz_render_cancel(s);
        trz_render_interrupt(s);
        trz_render_pause(s, 0);
        trz_render_progress(s, null_mut());
        trz_view_render(s, null(), null(), 0);
        trz_view_show(s, c"color".as_ptr(), null_mut());
        trz_plan_create(s, null(), null(), 0, null_mut());
        trz_view_stop(s, 0);
        trz_view_resume(s);
        trz_statistics_get(s, null_mut());
        trz_explain(s, null_mut(), 0, &mut 0);
        trz_scene_dump(s, null_mut(), 0, &mut 0);
        trz_scene_write(s, c"/tmp/a".as_ptr());
        trz_prim_complete(s, 1);
        trz_aov_describe(s, c"color".as_ptr(), null_mut());
        trz_aov_read(s, c"color".as_ptr(), null_mut(), 0);
        trz_image_write(s, c"/tmp/a".as_ptr(), null());
        trz_render_var_aov(s, null(), null_mut(), 0, &mut 0);
        trz_trace_rays(s, null(), null_mut(), 0);
    };
    // SAFETY: null is ignored.
    unsafe { trz_session_destroy(null_mut()) };
    // SAFETY: null is allowed.
    unsafe { trz_plan_destroy(null_mut()) };

    let header = include_str!("../../include/hdtrapeze.h");
    let takes_session = header
        .split("trz_result trz_")
        .skip(1)
        .filter_map(|text| text.split_once('('))
        .filter(|(_, arguments)| arguments.starts_with("struct trz_session *session"));
    for (name, _) in takes_session {
        let name = format!("trz_{name}");
        assert!(checked.contains(&name.as_str()), "{name} is not checked");
    }
}

#[test]
fn null_arguments() {
    let session = Session::with_camera();
    let s = session.0;
    let (mesh, grids, camera, ball) = (
        session.mesh("/mesh"),
        session.grids("/grids"),
        session.camera("/other"),
        session.implicit("/ball"),
    );
    let instancer = session.instancer("/instancer");
    let name = c"a".as_ptr();
    let no_name = [null()];
    let settings = settings_default();
    let unnamed = product(null(), &settings);
    let unnamed = &raw const unnamed;
    let mut bytes = [0; 4];
    let mut no_data = buffer(&mut bytes);
    no_data.data = null_mut();
    let mut no_clear = buffer(&mut bytes);
    no_clear.clear_count = 1;
    let mut bad_topology = topology();
    bad_topology.face_count = 1;
    let size = |bytes: usize| bytes as u32;
    let points = trz_points {
        struct_size: size(size_of::<trz_points>()),
        times: &0.0,
        sample_count: 1,
        points: &null(),
        counts: &1,
        ..no_points()
    };
    let no_array = trz_float_samples {
        times: &0.0,
        sample_count: 1,
        values: &null(),
        counts: &1,
    };
    let no_velocities = trz_points {
        velocities: no_array,
        ..no_points()
    };
    let no_accelerations = trz_points {
        accelerations: no_array,
        ..no_points()
    };
    let no_counts = trz_points {
        counts: null(),
        ..points
    };
    let grid = trz_grids {
        struct_size: size(size_of::<trz_grids>()),
        times: &0.0,
        key_count: 1,
        rates: null(),
        elements: null(),
        grid_count: 1,
        positions: null(),
        position_count: 4,
    };
    let (curves_id, spheres) = (session.curves("/curves"), session.spheres("/spheres"));
    let curves = trz_curves {
        curve_count: 1,
        ..curves()
    };
    let no_sizes = trz_implicit {
        sizes: null(),
        ..sphere()
    };
    let patch = session.nurbs_patch("/patch");
    let no_knots = trz_nurbs_patch {
        v_knots: null(),
        ..bilinear_patch()
    };
    let no_weights = trz_nurbs_patch {
        weight_count: 4,
        ..bilinear_patch()
    };
    let nurbs_curves = session.nurbs_curves("/nurbs curves");
    let no_orders = trz_nurbs_curves {
        orders: null(),
        ..line()
    };
    let no_ranges = trz_nurbs_curves {
        range_count: 1,
        ..line()
    };
    let no_subset_path = trz_subset {
        path: null(),
        ..subset(name, &[])
    };
    let no_family = trz_subset {
        family: null(),
        ..subset(name, &[])
    };
    let no_indices = trz_subset {
        index_count: 1,
        ..subset(name, &[])
    };
    let no_times = trz_implicit {
        times: null(),
        ..sphere()
    };
    let no_values = trz_primvar {
        value_counts: &1,
        ..primvar()
    };
    let no_value_arrays = trz_primvar {
        values: null(),
        ..primvar()
    };
    let no_counts_of_values = trz_primvar {
        value_counts: null(),
        ..primvar()
    };
    let no_sample_times = trz_primvar {
        times: null(),
        ..primvar()
    };
    let no_index_counts = trz_primvar {
        indices: &null(),
        ..primvar()
    };
    let instances = trz_instancer {
        prototype_index_count: 1,
        ..no_instances()
    };
    let no_arrays = trz_instancer {
        positions: trz_float_samples {
            times: &0.0,
            sample_count: 1,
            values: &null(),
            counts: &1,
        },
        ..no_instances()
    };
    let no_list = trz_instancer {
        prototype_count: 1,
        lists: &null(),
        list_counts: &1,
        ..no_instances()
    };
    let no_list_counts = trz_instancer {
        list_counts: null(),
        ..no_list
    };
    let no_matrices = trz_instancer {
        matrices: trz_matrix_samples {
            times: &0.0,
            sample_count: 1,
            values: null(),
            counts: &1,
        },
        ..no_instances()
    };
    let level = trz_transform_samples {
        times: null(),
        matrices: IDENTITY.as_ptr(),
        count: 1,
        turns: 0,
    };
    let no_curve = trz_camera {
        shutter_curve_count: 1,
        ..camera_default()
    };
    let no_planes = trz_camera {
        clipping_plane_count: 1,
        ..camera_default()
    };
    let no_lenses = trz_camera {
        lens_sample_count: 1,
        ..camera_default()
    };
    let image = trz_image {
        struct_size: size(size_of::<trz_image>()),
        r#type: TRZ_IMAGE_EXR,
        pixel_type: TRZ_PIXEL_HALF,
        compression: TRZ_COMPRESSION_ZIP,
        color: TRZ_COLOR_LINEAR,
        aovs: null(),
        aov_count: 1,
        metadata: null(),
        metadata_count: 0,
        vars: null(),
        var_count: 0,
        partial: 0,
    };
    let no_vars = trz_image {
        aov_count: 0,
        var_count: 1,
        ..image
    };
    let no_path = render_var(null());
    let pathless = trz_image {
        aov_count: 0,
        var_count: 1,
        vars: &no_path,
        ..image
    };
    let var = render_var(c"/Vars/color".as_ptr());
    let no_metadata = trz_image {
        aov_count: 0,
        metadata_count: 2,
        ..image
    };
    let ray = trz_ray {
        origin: [0.0; 3],
        dir: [0.0, 0.0, 1.0],
        time: 0.0,
        t_min: 0.0,
        t_max: 1.0,
    };
    session.square("/square", 0.0);
    ok(session.start());
    assert!(session.wait(-1.0));
    let (known_times, origin) = ([0.0, 1.0], [0.0; 3]);
    let known_values = [origin.as_ptr(); 2];
    let path = trz_path {
        struct_size: size(size_of::<trz_path>()),
        of: TRZ_PATH_POINTS,
        times: known_times.as_ptr(),
        start_count: 2,
        known_count: 2,
        values: known_values.as_ptr(),
        element_count: 1,
    };
    let no_path_times = trz_path {
        times: null(),
        ..path
    };
    let no_path_values = trz_path {
        values: null(),
        ..path
    };
    let no_path_arrays = [null(); 2];
    let no_path_array = trz_path {
        values: no_path_arrays.as_ptr(),
        ..path
    };
    let (at, keep) = (&mut 0.0, &mut [0; 2]);
    let (mut plan, mut window) = (null_mut(), [0; 4]);
    let mut room = [0.0; 16];
    let matrix = room.as_mut_ptr();
    unsafe extern "C" fn identity(_: *mut c_void, _: f64, _: *mut f64) {}
    let evaluate: trz_evaluate_fn = Some(identity);
    null_pointer! {
        trz_path_next(null(), at, 1, &mut 0, keep.as_mut_ptr());
        trz_path_next(&no_path_times, at, 1, &mut 0, keep.as_mut_ptr());
        trz_path_next(&no_path_values, at, 1, &mut 0, keep.as_mut_ptr());
        trz_path_next(&no_path_array, at, 1, &mut 0, keep.as_mut_ptr());
        trz_path_next(&path, null_mut(), 1, &mut 0, keep.as_mut_ptr());
        trz_path_next(&path, at, 1, null_mut(), keep.as_mut_ptr());
        trz_path_next(&path, at, 1, &mut 0, null_mut());
        trz_path_sample(null(), 1, evaluate, null_mut(), at, matrix, 1, &mut 0);
        trz_path_sample(&0.0, 1, None, null_mut(), at, matrix, 1, &mut 0);
        trz_path_sample(&0.0, 1, evaluate, null_mut(), null_mut(), matrix, 1, &mut 0);
        trz_path_sample(&0.0, 1, evaluate, null_mut(), at, null_mut(), 1, &mut 0);
        trz_path_sample(&0.0, 1, evaluate, null_mut(), at, matrix, 1, null_mut());
        trz_word(null(), name, &mut 0);
        trz_word(c"axis".as_ptr(), null(), &mut 0);
        trz_word(c"axis".as_ptr(), c"X".as_ptr(), null_mut());
        trz_session_create(null_mut());
        trz_camera_default(null_mut());
        trz_settings_default(null_mut());
        trz_view_show(s, null(), &mut buffer(&mut [0; 4]));
        trz_view_show(s, name, null_mut());
        trz_view_show(s, name, &mut no_data);
        trz_view_show(s, name, &mut no_clear);
        trz_setting_describe(0, null_mut());
        trz_plan_create(s, null(), null(), 0, &mut plan);
        trz_plan_create(s, &view(&settings_default(), &[]), null(), 1, &mut plan);
        trz_plan_create(s, &view(&settings_default(), &[]), null(), 0, null_mut());
        trz_plan_describe(null(), 0, &mut planned());
        trz_data_window(null(), 1, 1, window.as_mut_ptr());
        trz_data_window([0.0f32; 4].as_ptr(), 1, 1, null_mut());
        trz_frame_name(null(), 1.0, null_mut(), 0, &mut 0);
        trz_frame_name(name, 1.0, null_mut(), 9, &mut 0);
        trz_frame_name(name, 1.0, null_mut(), 0, null_mut());
        trz_frame_places(null(), &mut 0, &mut 0);
        trz_frame_places(name, null_mut(), &mut 0);
        trz_frame_places(name, &mut 0, null_mut());
        trz_settings_set(null_mut(), name, &NO_VALUE);
        trz_settings_set(&mut settings_default(), null(), &NO_VALUE);
        trz_settings_set(&mut settings_default(), name, null());
        trz_view_render(s, null(), null(), 0);
        trz_view_render(s, &view(&settings_default(), &no_name), null(), 0);
        trz_view_render(s, &view(&settings_default(), &[]), null(), 1);
        trz_view_render(s, &view(&settings_default(), &[]), [null()].as_ptr(), 1);
        trz_view_render(s, &view(&settings_default(), &[]), &unnamed, 1);
        trz_mesh_create(s, null(), &mut 0);
        trz_mesh_create(s, name, null_mut());
        trz_grids_create(s, null(), &mut 0);
        trz_grids_create(s, name, null_mut());
        trz_camera_create(s, null(), &mut 0);
        trz_camera_create(s, name, null_mut());
        trz_mesh_set_topology(s, mesh, null());
        trz_mesh_set_topology(s, mesh, &bad_topology);
        trz_mesh_set_subsets(s, mesh, null(), 1);
        trz_mesh_set_subsets(s, mesh, &no_subset_path, 1);
        trz_mesh_set_subsets(s, mesh, &no_family, 1);
        trz_mesh_set_subsets(s, mesh, &no_indices, 1);
        trz_prim_set_points(s, mesh, null());
        trz_prim_set_points(s, mesh, &points);
        trz_prim_set_points(s, mesh, &no_counts);
        trz_prim_set_points(s, mesh, &no_velocities);
        trz_prim_set_points(s, mesh, &no_accelerations);
        trz_grids_set(s, grids, null());
        trz_grids_set(s, grids, &grid);
        trz_curves_create(s, null(), &mut 0);
        trz_curves_create(s, name, null_mut());
        trz_curves_set(s, curves_id, null());
        trz_curves_set(s, curves_id, &curves);
        trz_spheres_create(s, null(), &mut 0);
        trz_spheres_create(s, name, null_mut());
        trz_prim_set_points(s, spheres, null());
        trz_implicit_create(s, null(), &mut 0);
        trz_implicit_create(s, name, null_mut());
        trz_implicit_set(s, ball, null());
        trz_implicit_set(s, ball, &no_sizes);
        trz_implicit_set(s, ball, &no_times);
        trz_nurbs_patch_create(s, null(), &mut 0);
        trz_nurbs_patch_create(s, name, null_mut());
        trz_nurbs_patch_set(s, patch, null());
        trz_nurbs_patch_set(s, patch, &no_knots);
        trz_nurbs_patch_set(s, patch, &no_weights);
        trz_nurbs_curves_create(s, null(), &mut 0);
        trz_nurbs_curves_create(s, name, null_mut());
        trz_nurbs_curves_set(s, nurbs_curves, null());
        trz_nurbs_curves_set(s, nurbs_curves, &no_orders);
        trz_nurbs_curves_set(s, nurbs_curves, &no_ranges);
        trz_camera_set(s, camera, null());
        trz_camera_set(s, camera, &no_curve);
        trz_camera_set(s, camera, &no_planes);
        trz_camera_set(s, camera, &no_lenses);
        trz_prim_set_transform(s, mesh, null(), 1);
        trz_prim_set_transform(s, mesh, &level, 1);
        trz_prim_set_primvar(s, mesh, null(), null());
        trz_prim_set_primvar(s, mesh, name, &no_values);
        trz_prim_set_primvar(s, mesh, name, &no_value_arrays);
        trz_prim_set_primvar(s, mesh, name, &no_counts_of_values);
        trz_prim_set_primvar(s, mesh, name, &no_sample_times);
        trz_prim_set_primvar(s, mesh, name, &no_index_counts);
        trz_instancer_create(s, null(), &mut 0);
        trz_instancer_create(s, name, null_mut());
        trz_instancer_set(s, instancer, null());
        trz_instancer_set(s, instancer, &instances);
        trz_instancer_set(s, instancer, &no_arrays);
        trz_instancer_set(s, instancer, &no_matrices);
        trz_instancer_set(s, instancer, &no_list);
        trz_instancer_set(s, instancer, &no_list_counts);
        trz_session_set_settings(s, null());
        trz_session_set_aovs(s, null(), 1);
        trz_session_set_aovs(s, no_name.as_ptr(), 1);
        trz_render_wait(s, 0.0, null_mut());
        trz_render_progress(s, null_mut());
        trz_statistics_get(s, null_mut());
        trz_explain(s, null_mut(), 0, null_mut());
        trz_explain(s, null_mut(), 9, &mut 0);
        trz_scene_dump(s, null_mut(), 0, null_mut());
        trz_scene_dump(s, null_mut(), 9, &mut 0);
        trz_scene_write(s, null());
        trz_aov_describe(s, null(), null_mut());
        trz_aov_describe(s, c"color".as_ptr(), null_mut());
        trz_aov_read(s, null(), null_mut(), 0);
        trz_aov_read(s, c"color".as_ptr(), null_mut(), 0);
        trz_image_write(s, c"/tmp/a".as_ptr(), &no_vars);
        trz_image_write(s, c"/tmp/a".as_ptr(), &pathless);
        trz_render_var_aov(s, null(), null_mut(), 0, &mut 0);
        trz_render_var_aov(s, &no_path, null_mut(), 0, &mut 0);
        trz_render_var_aov(s, &var, null_mut(), 0, null_mut());
        trz_render_var_aov(s, &var, null_mut(), 9, &mut 0);
        trz_image_write(s, null(), &image);
        trz_image_write(s, name, null());
        trz_image_write(s, name, &image);
        trz_image_write(s, name, &no_metadata);
        trz_trace_rays(s, null(), null_mut(), 1);
        trz_trace_rays(s, &ray, null_mut(), 1);
    };
    // Nothing of it has reached the scene or done harm.
    ok(session.commit());
}

#[test]
fn empty_arrays_need_no_pointer() {
    let session = Session::with_camera();
    let mesh = session.mesh("/empty");
    let grids = session.grids("/no grids");
    let instancer = session.instancer("/no instances");
    let empty_grids = trz_grids {
        struct_size: size_of::<trz_grids>() as u32,
        times: null(),
        key_count: 0,
        rates: null(),
        elements: null(),
        grid_count: 0,
        positions: null(),
        position_count: 0,
    };
    let ball = session.implicit("/no sizes");
    let empty_sizes = trz_implicit {
        times: null(),
        sizes: null(),
        sample_count: 0,
        ..sphere()
    };
    // SAFETY: pointers to live values.
    unsafe {
        ok(trz_mesh_set_topology(session.0, mesh, &topology()));
        ok(trz_mesh_set_subsets(session.0, mesh, null(), 0));
        ok(trz_prim_set_points(session.0, mesh, &no_points()));
        ok(trz_grids_set(session.0, grids, &empty_grids));
        let no_curves = session.curves("/no curves");
        ok(trz_curves_set(session.0, no_curves, &curves()));
        let no_spheres = session.spheres("/no spheres");
        ok(trz_prim_set_points(session.0, no_spheres, &no_points()));
        ok(trz_implicit_set(session.0, ball, &empty_sizes));
        let no_lines = trz_nurbs_curves {
            vertex_counts: null(),
            orders: null(),
            curve_count: 0,
            ..line()
        };
        let lines = session.nurbs_curves("/no lines");
        ok(trz_nurbs_curves_set(session.0, lines, &no_lines));
        let patch = session.nurbs_patch("/no patch");
        let empty = trz_nurbs_patch {
            u_knots: null(),
            u_knot_count: 0,
            ..bilinear_patch()
        };
        ok(trz_nurbs_patch_set(session.0, patch, &empty));
        ok(trz_instancer_set(session.0, instancer, &no_instances()));
        ok(trz_prim_set_instancer(session.0, mesh, instancer, 0));
        ok(trz_prim_set_transform(session.0, mesh, null(), 0));
        ok(trz_prim_set_primvar(
            session.0,
            mesh,
            c"absent".as_ptr(),
            null(),
        ));
        ok(trz_prim_set_primvar(
            session.0,
            instancer,
            c"absent".as_ptr(),
            null(),
        ));
        ok(trz_session_set_aovs(session.0, null(), 0));
        ok(session.commit());
        ok(trz_trace_rays(session.0, null(), null_mut(), 0));
    }
}
