//! Arguments that are wrong in other ways than null.

use std::ffi::CStr;
use std::ptr::{null, null_mut};

use hdtrapeze::*;

use crate::support::*;

#[test]
fn unknown_and_unfit_ids() {
    let session = Session::with_camera();
    let (mesh, camera) = (session.mesh("/mesh"), session.camera("/other"));
    let lens = camera_default();
    // SAFETY: pointers to live values.
    unsafe {
        let s = session.0;
        for id in [0, 999, u64::MAX] {
            fails(trz_prim_remove(s, id), TRZ_ERROR_NOT_FOUND);
            fails(
                trz_mesh_set_topology(s, id, &topology()),
                TRZ_ERROR_NOT_FOUND,
            );
            fails(trz_camera_set(s, id, &lens), TRZ_ERROR_NOT_FOUND);
        }
        let bad = TRZ_ERROR_INVALID_ARGUMENT;
        fails(trz_camera_set(s, mesh, &lens), bad);
        fails(trz_mesh_set_topology(s, camera, &topology()), bad);
        fails(trz_implicit_set(s, mesh, &sphere()), bad);
        fails(trz_mesh_set_subsets(s, camera, null(), 0), bad);
        let known = subset(c"/mesh/a".as_ptr(), &[0]);
        for wrong in [
            trz_subset {
                family_type: 3,
                ..known
            },
            trz_subset {
                element_type: 5,
                ..known
            },
            trz_subset {
                family: c"\xff".as_ptr(),
                ..known
            },
            trz_subset {
                index_count: usize::MAX,
                ..known
            },
        ] {
            let message = fails(trz_mesh_set_subsets(s, mesh, &wrong, 1), bad);
            assert!(message.contains("subsets[0]."), "{message}");
        }
        ok(trz_mesh_set_subsets(s, mesh, &known, 1));
        fails(trz_nurbs_patch_set(s, mesh, &bilinear_patch()), bad);
        fails(trz_prim_set_visible(s, camera, 1), bad);
        fails(trz_prim_set_matte(s, camera, 1), bad);
        let instancer = session.instancer("/instancer");
        fails(trz_instancer_set(s, mesh, &no_instances()), bad);
        fails(trz_prim_set_matte(s, instancer, 1), bad);
        fails(trz_prim_set_instancer(s, camera, instancer, 0), bad);
        let message = fails(trz_prim_set_instancer(s, mesh, camera, 0), bad);
        assert!(message.contains("/other"), "{message}");
        fails(trz_prim_set_instancer(s, mesh, 999, 0), TRZ_ERROR_NOT_FOUND);
        ok(trz_prim_set_primvar(
            s,
            instancer,
            c"a".as_ptr(),
            &primvar(),
        ));
        fails(
            trz_prim_set_primvar(s, camera, c"a".as_ptr(), &primvar()),
            bad,
        );
        ok(trz_prim_set_instancer(s, mesh, instancer, 7));
        ok(trz_prim_set_instancer(s, instancer, instancer, 0));
        ok(trz_prim_set_instancer(s, mesh, 0, 0));
        ok(trz_prim_remove(s, instancer));
        fails(
            trz_prim_set_instancer(s, mesh, instancer, 0),
            TRZ_ERROR_NOT_FOUND,
        );
        fails(trz_prim_set_motion(s, camera, 1.0, 0), bad);
        fails(trz_prim_set_double_sided(s, camera, 1), bad);
        let message = fails(trz_session_set_active_camera(s, mesh), bad);
        assert!(message.contains("/mesh"), "{message}");
        fails(trz_session_set_active_camera(s, 999), TRZ_ERROR_NOT_FOUND);
        ok(trz_prim_remove(s, mesh));
        fails(trz_prim_set_pick_id(s, mesh, 1), TRZ_ERROR_NOT_FOUND);
        assert_ne!(session.mesh("/mesh"), mesh, "an id came back");
    }
}

#[test]
fn enums_flags_and_strings() {
    let session = Session::new();
    let mesh = session.mesh("/mesh");
    let bad = TRZ_ERROR_INVALID_ARGUMENT;
    let changes: [fn(&mut trz_topology); 6] = [
        |t| t.scheme = 4,
        |t| t.boundary = 3,
        |t| t.face_varying = 6,
        |t| t.triangles = 2,
        |t| t.orientation = u32::MAX,
        |t| t.struct_size -= 1,
    ];
    let ball = session.implicit("/ball");
    let implicit_changes: [fn(&mut trz_implicit); 5] = [
        |i| i.kind = 6,
        |i| i.axis = 3,
        |i| i.orientation = 2,
        |i| i.sample_count = usize::MAX / 2,
        |i| i.struct_size -= 1,
    ];
    // SAFETY: pointers to live values.
    unsafe {
        let s = session.0;
        for change in changes {
            let mut topology = topology();
            change(&mut topology);
            fails(trz_mesh_set_topology(s, mesh, &topology), bad);
        }
        let patch = session.nurbs_patch("/patch");
        let patch_changes: [fn(&mut trz_nurbs_patch); 3] = [
            |p| p.orientation = 2,
            |p| p.u_knot_count = usize::MAX / 4,
            |p| p.struct_size -= 1,
        ];
        for change in patch_changes {
            let mut value = bilinear_patch();
            change(&mut value);
            fails(trz_nurbs_patch_set(s, patch, &value), bad);
        }
        let nurbs_curves = session.nurbs_curves("/nurbs curves");
        let curve_changes: [fn(&mut trz_nurbs_curves); 4] = [
            |c| c.form = 4,
            |c| c.range_count = usize::MAX,
            |c| c.curve_count = usize::MAX / 2,
            |c| c.struct_size -= 1,
        ];
        for change in curve_changes {
            let mut value = line();
            change(&mut value);
            fails(trz_nurbs_curves_set(s, nurbs_curves, &value), bad);
        }
        fails(trz_nurbs_curves_set(s, mesh, &line()), bad);
        for change in implicit_changes {
            let mut sphere = sphere();
            change(&mut sphere);
            fails(trz_implicit_set(s, ball, &sphere), bad);
        }
        fails(trz_prim_set_visible(s, mesh, 2), bad);
        let curves_id = session.curves("/curves");
        let changes: [fn(&mut trz_curves); 4] = [
            |c| c.basis = 5,
            |c| c.wrap = 3,
            |c| c.form = 4,
            |c| c.struct_size -= 1,
        ];
        for change in changes {
            let mut curves = curves();
            change(&mut curves);
            fails(trz_curves_set(s, curves_id, &curves), bad);
        }
        fails(trz_curves_set(s, mesh, &curves()), bad);
        ok(trz_curves_set(s, curves_id, &curves()));
        fails(trz_prim_set_matte(s, mesh, 2), bad);
        fails(trz_prim_set_double_sided(s, mesh, 2), bad);
        fails(trz_session_set_log(s, None, null_mut(), 4), bad);
        fails(trz_render_wait(s, f64::NAN, &mut 0), bad);
        fails(trz_render_pause(s, 2), bad);
        let not_utf8 = c"\xff\xfe";
        fails(trz_mesh_create(s, not_utf8.as_ptr(), &mut 0), bad);
        fails(
            trz_session_set_aovs(s, [not_utf8.as_ptr()].as_ptr(), 1),
            bad,
        );
        fails(trz_prim_set_primvar(s, mesh, c"".as_ptr(), null()), bad);
        let mut camera = camera_default();
        camera.projection = 2;
        let id = session.camera("/camera");
        fails(trz_camera_set(s, id, &camera), bad);
        camera = camera_default();
        camera.shutter_curve_type = 2;
        fails(trz_camera_set(s, id, &camera), bad);
        camera.struct_size = 0;
        let message = fails(trz_camera_default(&mut camera), bad);
        assert!(message.contains("sizeof(trz_camera)"), "{message}");
        let mut gpu = settings_default();
        gpu.backend = TRZ_BACKEND_GPU;
        // Refused where there is no device.
        let mut device: trz_device = std::mem::zeroed();
        device.struct_size = size_of::<trz_device>() as u32;
        match trz_device_describe(0, &mut device) {
            TRZ_OK => {
                assert!(device.chosen == 1 && device.name[0] != 0);
                ok(trz_session_set_settings(s, &gpu));
            }
            _ => {
                fails(trz_session_set_settings(s, &gpu), TRZ_ERROR_UNSUPPORTED);
            }
        }
        fails(trz_device_describe(99, &mut device), TRZ_ERROR_NOT_FOUND);
        fails(trz_device_describe(0, null_mut()), TRZ_ERROR_NULL_POINTER);
        gpu.backend = TRZ_BACKEND_AUTO;
        ok(trz_session_set_settings(s, &gpu));
        let (mut auto, mut needed) = ([0; 400], 0);
        ok(trz_auto_describe(
            auto.as_mut_ptr(),
            auto.len(),
            &mut needed,
        ));
        let told = CStr::from_ptr(auto.as_ptr()).to_str().unwrap();
        assert!(
            told.contains(", since ") && told.len() + 1 == needed,
            "{told}"
        );
        fails(
            trz_auto_describe(auto.as_mut_ptr(), 3, &mut needed),
            TRZ_ERROR_BUFFER_TOO_SMALL,
        );
        fails(
            trz_auto_describe(auto.as_mut_ptr(), 3, null_mut()),
            TRZ_ERROR_NULL_POINTER,
        );
        ok(trz_session_set_settings(s, &gpu));
        assert_eq!(last_error(), "", "success clears the message");
    }
}

#[test]
fn counts_that_cannot_be() {
    let session = Session::new();
    let (mesh, grids) = (session.mesh("/mesh"), session.grids("/grids"));
    let instancer = session.instancer("/instancer");
    let bad = TRZ_ERROR_INVALID_ARGUMENT;
    let huge = usize::MAX;
    // SAFETY: pointers to live values; counts that exceed them are refused before they are read.
    unsafe {
        let s = session.0;
        let mut topology = topology();
        topology.face_vertex_counts = &4;
        topology.face_count = huge;
        fails(trz_mesh_set_topology(s, mesh, &topology), bad);
        let mut curves = curves();
        curves.vertex_counts = &2;
        curves.curve_count = huge;
        let curves_id = session.curves("/curves");
        fails(trz_curves_set(s, curves_id, &curves), bad);
        let points = trz_points {
            struct_size: size_of::<trz_points>() as u32,
            times: &0.0,
            sample_count: 1,
            points: &[0.0f32; 3].as_ptr(),
            counts: &(huge / 2),
            ..no_points()
        };
        fails(trz_prim_set_points(s, mesh, &points), bad);
        let velocities = trz_float_samples {
            times: &0.0,
            sample_count: 1,
            values: &[0.0f32; 3].as_ptr(),
            counts: &(huge / 2),
        };
        let points = trz_points {
            velocities,
            ..no_points()
        };
        let message = fails(trz_prim_set_points(s, mesh, &points), bad);
        assert!(message.contains("velocities[0]"), "{message}");
        let (name, floats) = (c"a".as_ptr(), [0.0f32; 3].as_ptr().cast());
        let count = huge / 8;
        let (mut many, indices) = (primvar(), [0i32].as_ptr());
        (many.width, many.values, many.value_counts) = (16, &floats, &count);
        fails(trz_prim_set_primvar(s, mesh, name, &many), bad);
        (many.width, many.value_counts) = (3, &1);
        ok(trz_prim_set_primvar(s, mesh, name, &many));
        (many.indices, many.index_counts) = (&indices, &huge);
        fails(trz_prim_set_primvar(s, mesh, name, &many), bad);
        many = primvar();
        many.sample_count = huge;
        fails(trz_prim_set_primvar(s, mesh, name, &many), bad);
        let changes: [fn(&mut trz_primvar); 6] = [
            |p| p.width = 0,
            |p| p.width = 17,
            |p| p.interpolation = 5,
            |p| p.r#type = 8,
            |p| p.role = 2,
            |p| p.sample_count = 0,
        ];
        for change in changes {
            let mut changed = primvar();
            change(&mut changed);
            fails(trz_prim_set_primvar(s, mesh, name, &changed), bad);
        }
        let mut instances = trz_instancer {
            matrices: trz_matrix_samples {
                times: &0.0,
                sample_count: 1,
                values: &IDENTITY.as_ptr(),
                counts: &(huge / 16),
            },
            ..no_instances()
        };
        fails(trz_instancer_set(s, instancer, &instances), bad);
        instances = no_instances();
        instances.mask = &1;
        instances.mask_count = huge;
        fails(trz_instancer_set(s, instancer, &instances), bad);
        let level = trz_transform_samples {
            times: &0.0,
            matrices: IDENTITY.as_ptr(),
            count: 0,
            turns: 0,
        };
        fails(trz_prim_set_transform(s, mesh, &level, 1), bad);
        let camera = session.camera("/camera");
        let mut lens = camera_default();
        lens.shutter_curve = [0.0; 2].as_ptr();
        lens.shutter_curve_count = huge / 2 + 1;
        fails(trz_camera_set(s, camera, &lens), bad);
        lens.shutter_curve_count = 0;
        lens.clipping_planes = [0.0; 4].as_ptr();
        lens.clipping_plane_count = huge / 16;
        fails(trz_camera_set(s, camera, &lens), bad);
        lens.clipping_plane_count = 0;
        ok(trz_camera_set(s, camera, &lens));
        let square = [0.0f32; 12];
        let mut one = trz_grids {
            struct_size: size_of::<trz_grids>() as u32,
            times: &0.0,
            key_count: 1,
            rates: [1u16, 1].as_ptr(),
            elements: null(),
            grid_count: 1,
            positions: square.as_ptr(),
            position_count: 3,
        };
        let message = fails(trz_grids_set(s, grids, &one), bad);
        assert!(message.contains("add up to 4"), "{message}");
        one.position_count = 4;
        ok(trz_grids_set(s, grids, &one));
        one.rates = [17u16, 1].as_ptr();
        fails(trz_grids_set(s, grids, &one), bad);
        one.rates = [0u16, 1].as_ptr();
        fails(trz_grids_set(s, grids, &one), bad);
    }
}

#[test]
fn names_of_results_and_versions() {
    let header = include_str!("../../include/hdtrapeze.h");
    for line in header.lines() {
        let mut words = line
            .split_whitespace()
            .skip_while(|w| *w != "#define")
            .skip(1);
        let (Some(name), Some(Ok(value))) =
            (words.next(), words.next().map(str::parse::<trz_result>))
        else {
            continue;
        };
        if name == "TRZ_OK" || name.starts_with("TRZ_ERROR_") {
            // SAFETY: a string that lives for ever.
            let found = unsafe { CStr::from_ptr(trz_result_name(value)) };
            assert_eq!(found.to_str().unwrap(), name);
        }
    }
    // SAFETY: as above.
    let (unknown, version) = unsafe {
        (
            CStr::from_ptr(trz_result_name(-5)),
            CStr::from_ptr(trz_version()),
        )
    };
    assert_eq!(unknown, c"unknown");
    assert_eq!(version.to_str().unwrap(), env!("CARGO_PKG_VERSION"));
    assert_eq!(trz_abi_version(), TRZ_ABI_VERSION);
}
