//! A scene with motion and faults, and its text.

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3};

use super::dump;
use crate::scene::{
    CameraDesc, Geometry, MeshDesc, PointsSamples, PrimCommon, PrimDesc, PrimId, Scene,
    TransformSamples,
};
use crate::surface::{MeshTopology, Scheme};

fn scene() -> Scene {
    let topology = MeshTopology {
        scheme: Scheme::None,
        face_vertex_counts: vec![3, 2],
        face_vertex_indices: vec![0, 1, 2, 0, 1],
        ..MeshTopology::default()
    };
    let points = |y: f32| Arc::new(vec![Vec3::new(0.0, y, 0.0), Vec3::X, Vec3::Y]);
    let geometry = Geometry::Mesh(MeshDesc {
        topology: Arc::new(topology),
        points: PointsSamples {
            times: vec![-1.0, 1.0],
            points: vec![points(-1.0), points(1.0)],
            ..PointsSamples::default()
        },
        ..MeshDesc::default()
    });
    let mut common = PrimCommon::new("/b");
    common.transform = vec![TransformSamples {
        times: vec![0.0],
        matrices: vec![DMat4::from_translation(DVec3::new(1.0, 1.0e-12, 0.0))],
        ..TransformSamples::default()
    }];
    let empty = PrimDesc {
        common: PrimCommon::new("/a"),
        geometry: Geometry::Mesh(MeshDesc::default()),
    };
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        shutter: [-0.25, 0.25],
        ..CameraDesc::default()
    };
    let mut scene = Scene::default();
    scene
        .prims
        .insert(PrimId(1), Arc::new(PrimDesc { common, geometry }));
    scene.prims.insert(PrimId(2), Arc::new(empty));
    scene.cameras.insert(PrimId(3), Arc::new(camera));
    scene.active_camera = Some(PrimId(3));
    scene
}

#[test]
fn a_scene_is_told_in_order_of_paths_with_resolved_motion() {
    let text = dump(&scene());
    let wanted = "\
mesh /a
  nothing to render
  transform: ((1 0 0 0) (0 1 0 0) (0 0 1 0) (0 0 0 1))

mesh /b
  scheme None
  boundary EdgeAndCorner, face-varying CornersPlus1, triangles CatmullClark, RightHanded
  face vertex counts 1: 3
  face vertex indices 3: 0 1 2
  authored faces kept 1: 0
  points at shutter 0: 3: (0 -0.25 0) (1 0 0) (0 1 0)
  points at shutter 1: 3: (0 0.25 0) (1 0 0) (0 1 0)
  transform: ((1 0 0 0) (0 1 0 0) (0 0 1 0) (1 0 0 1))
  warning topology: 1 of 2 faces have fewer than 3 vertices; dropped
";
    assert!(
        text.starts_with(
            "hdtrapeze dump 1\n\nshutter -0.25 0.25 in time codes relative to the frame\nat shutter 0: as it opens;"
        ),
        "{text}"
    );
    assert!(text.contains("\ncamera /camera\n"), "{text}");
    assert!(text.ends_with(wanted), "{text}");
}

#[test]
fn a_scene_without_a_camera_is_told_at_the_frame() {
    let mut scene = scene();
    scene.active_camera = None;
    let text = dump(&scene);
    assert!(text.contains("shutter 0 0 in time codes") && text.contains("no camera\n"));
    assert!(
        text.contains("points: 3: (0 0 0) (1 0 0) (0 1 0)\n"),
        "{text}"
    );
    assert!(!text.contains(" at shutter"));
}

#[test]
fn a_lens_is_told_once_or_at_its_keys() {
    let mut scene = scene();
    let edit = |scene: &mut Scene, change: &dyn Fn(&mut CameraDesc)| {
        change(Arc::make_mut(scene.cameras.get_mut(&PrimId(3)).unwrap()));
        dump(scene)
    };
    let sample = |time, focus_distance| crate::scene::LensSample {
        time,
        focus_distance,
        ..CameraDesc::default().lens()
    };
    // Other samples, the same lens over the shutter of -0.25 to 0.25.
    let rack = edit(&mut scene, &|c| {
        c.lens_samples = vec![sample(-0.25, 2.0), sample(0.25, 4.0)];
    });
    assert!(
        rack.contains("  lens at shutter 0\n    aperture and offset"),
        "{rack}"
    );
    assert!(rack.contains("    focus distance 4\n"), "{rack}");
    let longer = edit(&mut scene, &|c| {
        c.lens_samples = vec![sample(1.0, 7.0), sample(-1.0, -1.0)];
    });
    assert_eq!(rack, longer);
    let plain = edit(&mut scene, &|c| c.lens_samples = vec![sample(5.0, 0.0)]);
    assert!(!plain.contains("lens at"), "{plain}");
    let all = edit(&mut scene, &|c| {
        c.aperture.blades = 5;
        c.shutter_curve.points = vec![[0.0, 0.0], [1.0, 1.0]];
        c.clipping_planes = vec![[0.0, 0.0, -1.0, -2.0]];
    });
    assert!(
        all.contains("  blades 5, turned 0, ratio 1, roundness 0\n"),
        "{all}"
    );
    assert!(all.contains("  shutter curve 2: (0 0) (1 1)\n"), "{all}");
    assert!(all.contains("  clipping plane 0 0 -1 -2\n"), "{all}");
}

#[test]
fn turns_between_samples_are_told_where_there_are_any() {
    let told = |angle: f64, turns: bool| {
        let mut scene = scene();
        let prim = scene.prims.get_mut(&PrimId(1)).unwrap();
        Arc::make_mut(prim).common.transform = vec![TransformSamples {
            times: vec![-1.0, 1.0],
            matrices: vec![DMat4::IDENTITY, DMat4::from_rotation_z(angle)],
            turns,
        }];
        dump(&scene).contains("  transform turns between samples\n")
    };
    assert!(told(1.0, true));
    assert!(!told(0.0, true));
    assert!(!told(1.0, false));
}
