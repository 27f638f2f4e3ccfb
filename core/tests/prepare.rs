//! Commits: what an edit touches, what bad prims cost, what effects a scene calls for.

mod support;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DMat4, DVec3, Vec3};
use hdtrapeze_core::diagnostics::Code;
use hdtrapeze_core::effects::TimePlan;
use hdtrapeze_core::render::{Preparation, PrepareError, Prepared, prepare};
use hdtrapeze_core::scene::Geometry;
use hdtrapeze_core::scene::{
    CameraDesc, InstanceArrays, InstancerDesc, MeshDesc, PointsSamples, PrimCommon, PrimDesc,
    PrimId, Samples, Scene, TransformSamples,
};
use hdtrapeze_core::surface::{MeshTopology, Scheme};
use support::NoSubdivision;

const INSTANCER: PrimId = PrimId(50);

fn quad(path: &str, place: DVec3) -> PrimDesc {
    let topology = MeshTopology {
        scheme: Scheme::None,
        face_vertex_counts: vec![4],
        face_vertex_indices: vec![0, 1, 2, 3],
        ..MeshTopology::default()
    };
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let points = corners.map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec();
    let geometry = Geometry::Mesh(MeshDesc {
        topology: Arc::new(topology),
        points: PointsSamples {
            times: vec![0.0],
            points: vec![Arc::new(points)],
            ..PointsSamples::default()
        },
        ..MeshDesc::default()
    });
    let mut common = PrimCommon::new(path);
    common.transform = vec![moving(&[DMat4::from_translation(place)])];
    PrimDesc { common, geometry }
}

fn moving(matrices: &[DMat4]) -> TransformSamples {
    let times = (0..matrices.len()).map(|i| i as f64).collect();
    TransformSamples {
        times,
        matrices: matrices.to_vec(),
        ..TransformSamples::default()
    }
}

fn scene(prims: Vec<PrimDesc>) -> Scene {
    let mut scene = Scene::default();
    for (i, prim) in prims.into_iter().enumerate() {
        scene.prims.insert(PrimId(i as u64 + 1), Arc::new(prim));
    }
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        transform: vec![moving(&[DMat4::from_translation(DVec3::new(
            0.0, 0.0, 10.0,
        ))])],
        shutter: [0.0, 1.0],
        ..CameraDesc::default()
    };
    scene.cameras.insert(PrimId(100), Arc::new(camera));
    scene.active_camera = Some(PrimId(100));
    scene
}

fn commit(scene: &Scene, previous: Option<&Prepared>) -> Preparation {
    prepare(scene, &NoSubdivision, previous, &AtomicBool::new(false)).unwrap()
}

fn edit(scene: &mut Scene, id: u64, change: impl FnOnce(&mut PrimDesc)) {
    change(Arc::make_mut(scene.prims.get_mut(&PrimId(id)).unwrap()));
}

fn edit_camera(scene: &mut Scene, change: impl FnOnce(&mut CameraDesc)) {
    change(Arc::make_mut(scene.cameras.get_mut(&PrimId(100)).unwrap()));
}

fn three() -> Scene {
    scene(
        (0..3)
            .map(|i| quad(&format!("/q{i}"), DVec3::X * f64::from(i)))
            .collect(),
    )
}

#[test]
fn an_edit_dices_only_what_it_touches() {
    let mut scene = three();
    let first = commit(&scene, None).prepared;
    let touched = |p: &Prepared| (p.statistics().objects_diced, p.statistics().objects_reused);
    assert_eq!(touched(&first), (3, 0));
    let again = commit(&scene, Some(&first)).prepared;
    assert_eq!(touched(&again), (0, 3));
    edit(&mut scene, 2, |p| p.common.transform = vec![]);
    let moved = commit(&scene, Some(&again)).prepared;
    assert_eq!(touched(&moved), (1, 2));
    edit(&mut scene, 1, |p| {
        p.common.pick_id = 7;
        p.common.matte = true;
    });
    edit(&mut scene, 3, |p| p.common.visible = false);
    let renamed = commit(&scene, Some(&moved)).prepared;
    assert_eq!(touched(&renamed), (0, 2));
    edit_camera(&mut scene, |c| c.focal_length = 7.0);
    assert_eq!(
        touched(&commit(&scene, Some(&renamed)).prepared),
        (2, 0),
        "rates have changed"
    );
}

#[test]
fn the_plan_names_who_called_for_an_effect() {
    let still = commit(&three(), None).prepared;
    assert_eq!(still.plan().time, TimePlan::Still);
    assert!(!still.plan().has_lens() && !still.plan().has_transparency());

    let mut scene = three();
    let there = DMat4::from_translation(DVec3::Y);
    edit(&mut scene, 2, |p| {
        p.common.transform = vec![moving(&[DMat4::IDENTITY, there])]
    });
    let linear = commit(&scene, None).prepared;
    assert_eq!(linear.plan().time, TimePlan::Segments(1));
    assert_eq!(linear.plan().time_by.as_deref(), Some("/q1"));
    let bytes = |p: &Prepared| (p.statistics().geometry_bytes, p.statistics().bvh_bytes);
    assert!(
        bytes(&linear) > bytes(&still),
        "only what moves has second positions and bounds"
    );

    assert!(!linear.plan().has_matte() && !linear.explain("cpu").contains("matte"));
    edit(&mut scene, 3, |p| p.common.matte = true);
    let matte = commit(&scene, Some(&linear)).prepared;
    assert_eq!(matte.plan().matte_by.as_deref(), Some("/q2"));
    assert!(matte.explain("cpu").contains("called for by /q2"));

    let mut camera_only = three();
    edit_camera(&mut camera_only, |c| {
        c.transform = vec![moving(&[DMat4::from_translation(DVec3::Z * 9.0), there])];
        c.f_stop = 4.0;
        c.focus_distance = 5.0;
    });
    let camera_only = commit(&camera_only, None).prepared;
    assert_eq!(camera_only.plan().time, TimePlan::CameraOnly);
    assert_eq!(
        bytes(&camera_only),
        bytes(&still),
        "a moving camera leaves geometry static"
    );
    assert!(camera_only.plan().has_lens());
    assert_eq!(camera_only.plan().lens_by.as_deref(), Some("/camera"));

    let mut off = scene.clone();
    Arc::make_mut(&mut off.settings).disable_motion_blur = true;
    let off = commit(&off, None).prepared;
    assert_eq!(
        (off.plan().time.clone(), bytes(&off)),
        (TimePlan::Still, bytes(&still))
    );
}

#[test]
fn singular_instances_are_flattened_and_the_rest_is_shared() {
    let mut prim = quad("/q", DVec3::ZERO);
    let shift = |x: f64| DMat4::from_translation(DVec3::new(x, 0.0, 0.0));
    let through_zero = |s: f64| shift(4.0) * DMat4::from_scale(DVec3::splat(s));
    prim.common.instancer = Some((INSTANCER, 0));
    let mut scene = scene(vec![prim]);
    let matrices = vec![
        vec![shift(0.0), shift(-4.0), through_zero(1.0)],
        vec![shift(1.0), shift(-4.0), through_zero(-1.0)],
    ];
    scene.instancers.insert(
        INSTANCER,
        Arc::new(InstancerDesc {
            arrays: Arc::new(InstanceArrays {
                instance_count: 3,
                matrices: Samples {
                    times: vec![0.0, 1.0],
                    values: matrices.into_iter().map(Arc::new).collect(),
                },
                ..InstanceArrays::default()
            }),
            ..InstancerDesc::new("/instancer")
        }),
    );
    let out = commit(&scene, None);
    assert!(out.warnings.is_empty(), "{:?}", out.warnings);
    let s = out.prepared.statistics();
    assert_eq!((s.instances, s.objects), (3, 2));
}

#[test]
fn bad_prims_get_one_warning_and_the_rest_is_prepared() {
    let nan = DMat4::from_translation(DVec3::NAN);
    let mut bad = quad("/bad", DVec3::ZERO);
    bad.common.transform = vec![moving(&[nan])];
    let mut huge = quad("/huge", DVec3::ZERO);
    huge.common.transform = vec![moving(&[DMat4::from_scale(DVec3::splat(1.0e17))])];
    let mut loops = quad("/loop", DVec3::ZERO);
    if let Geometry::Mesh(mesh) = &mut loops.geometry {
        Arc::make_mut(&mut mesh.topology).scheme = Scheme::Loop;
    }
    let out = commit(
        &scene(vec![bad, quad("/good", DVec3::ZERO), huge, loops]),
        None,
    );
    let found: Vec<(&str, Code)> = out
        .warnings
        .iter()
        .map(|w| (w.prim.as_str(), w.code))
        .collect();
    let want = [
        ("/bad", Code::NotFinite),
        ("/huge", Code::NotFinite),
        ("/loop", Code::Topology),
    ];
    assert_eq!(found, want);
    assert_eq!(
        out.prepared.statistics().instances,
        2,
        "/good, and /loop as polygons"
    );
}

#[test]
fn scenes_that_cannot_be_prepared_say_why() {
    let refuse =
        |scene: &Scene| prepare(scene, &NoSubdivision, None, &AtomicBool::new(false)).unwrap_err();
    assert_eq!(refuse(&Scene::default()), PrepareError::NoCamera);
    let mut scene = three();
    Arc::make_mut(&mut scene.settings).samples = 0;
    assert!(matches!(refuse(&scene), PrepareError::Setting(_)));
    let mut scene = three();
    edit_camera(&mut scene, |c| c.transform = vec![moving(&[DMat4::NAN])]);
    assert!(matches!(refuse(&scene), PrepareError::Camera(..)));
    let cancelled = prepare(&three(), &NoSubdivision, None, &AtomicBool::new(true)).unwrap_err();
    assert_eq!(cancelled, PrepareError::Cancelled);
}

#[test]
fn a_shutter_that_closes_before_it_opens_is_still() {
    let mut scene = three();
    edit_camera(&mut scene, |c| c.shutter = [0.5, -0.5]);
    let out = commit(&scene, None);
    assert_eq!(out.warnings.len(), 1);
    assert_eq!(out.warnings[0].prim, "/camera");
    assert_eq!(out.prepared.plan().time, TimePlan::Still);
}
