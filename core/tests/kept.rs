//! Grids of an earlier view: kept while dicing anew would gain little, and not longer.

mod support;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DMat4, DVec3, Vec3};
use hdtrapeze_core::render::{Prepared, prepare};
use hdtrapeze_core::scene::{
    CameraDesc, CurveForm, CurvesDesc, Geometry, ImplicitDesc, ImplicitKind, InstanceArrays,
    InstancerDesc, Interpolation, PointsSamples, PrimCommon, PrimDesc, PrimId, PrimvarDesc,
    RenderSettings, Samples, Scene, TransformSamples,
};
use support::NoSubdivision;

const CAMERA: PrimId = PrimId(100);

fn at(matrix: DMat4) -> Vec<TransformSamples> {
    vec![TransformSamples {
        times: vec![0.0],
        matrices: vec![matrix],
        ..TransformSamples::default()
    }]
}

fn placed(path: &str, geometry: Geometry, place: DVec3) -> PrimDesc {
    let mut common = PrimCommon::new(path);
    common.transform = at(DMat4::from_translation(place));
    PrimDesc { common, geometry }
}

fn ball(path: &str, place: DVec3) -> PrimDesc {
    let geometry = Geometry::Implicit(ImplicitDesc {
        kind: ImplicitKind::Sphere,
        times: vec![0.0],
        sizes: vec![[1.0, 0.0, 0.0]],
        ..ImplicitDesc::default()
    });
    placed(path, geometry, place)
}

fn strand(path: &str) -> PrimDesc {
    let points = vec![Vec3::NEG_Y, Vec3::Y];
    let geometry = Geometry::Curves(CurvesDesc {
        vertex_counts: Arc::new(vec![2]),
        points: PointsSamples {
            times: vec![0.0],
            points: vec![Arc::new(points)],
            ..PointsSamples::default()
        },
        ..CurvesDesc::default()
    });
    let mut prim = placed(path, geometry, DVec3::ZERO);
    let widths = PrimvarDesc::still(Interpolation::Constant, 1, vec![0.01], vec![]);
    prim.common.primvars.insert("widths".to_owned(), widths);
    prim
}

fn scene(prims: Vec<PrimDesc>) -> Scene {
    let mut scene = Scene::default();
    for (i, prim) in prims.into_iter().enumerate() {
        scene.prims.insert(PrimId(i as u64 + 1), Arc::new(prim));
    }
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        ..CameraDesc::default()
    };
    scene.cameras.insert(CAMERA, Arc::new(camera));
    scene.active_camera = Some(CAMERA);
    scene.settings = Arc::new(RenderSettings {
        keep_finer: true,
        ..RenderSettings::default()
    });
    look(&mut scene, DVec3::Z * 20.0, DVec3::ZERO);
    scene
}

fn look(scene: &mut Scene, from: DVec3, to: DVec3) {
    let z = (from - to).normalize();
    let x = DVec3::Y.cross(z).normalize();
    let [right, up, back] = [x, z.cross(x), z].map(|axis| axis.extend(0.0));
    let camera = Arc::make_mut(scene.cameras.get_mut(&CAMERA).unwrap());
    camera.transform = at(DMat4::from_cols(right, up, back, from.extend(1.0)));
}

fn commit(scene: &Scene, previous: Option<&Prepared>) -> Prepared {
    let never = AtomicBool::new(false);
    prepare(scene, &NoSubdivision, previous, &never)
        .unwrap()
        .prepared
}

/// Prims diced and taken over by a commit after `previous`.
fn touched(prepared: &Prepared) -> (u64, u64) {
    let statistics = prepared.statistics();
    (statistics.objects_diced, statistics.objects_reused)
}

#[test]
fn a_camera_that_comes_nearer_has_grids_diced_when_they_are_too_coarse() {
    let mut scene = scene(vec![ball("/a", DVec3::ZERO), ball("/b", DVec3::X * 2.5)]);
    Arc::make_mut(&mut scene.settings).occlusion_culling = false;
    let mut last = commit(&scene, None);
    let mut diced = Vec::new();
    let mut distance = 20.0;
    while distance > 5.0 {
        distance /= 1.05;
        look(&mut scene, DVec3::Z * distance, DVec3::ZERO);
        last = commit(&scene, Some(&last));
        let fresh = commit(&scene, None).statistics().micropolygons as f64;
        let kept = last.statistics().micropolygons as f64;
        assert!(kept > 0.4 * fresh, "{kept} of {fresh} at {distance}");
        diced.push(touched(&last).0);
    }
    // Twice as near twice: each is diced anew every 7 steps of 5 %, or a little earlier.
    let all: u64 = diced.iter().sum();
    assert!((6..=16).contains(&all), "{diced:?}");
    assert!(diced[..3].iter().all(|&d| d == 0), "{diced:?}");
}

#[test]
fn a_camera_that_leaves_keeps_grids_until_they_are_far_too_fine() {
    let mut scene = scene(vec![ball("/a", DVec3::ZERO)]);
    let mut last = commit(&scene, None);
    for (distance, diced) in [(40.0, 0), (200.0, 0), (400.0, 1), (380.0, 0)] {
        look(&mut scene, DVec3::Z * distance, DVec3::ZERO);
        last = commit(&scene, Some(&last));
        assert_eq!(touched(&last), (diced, 1 - diced), "at {distance}");
    }
}

#[test]
fn a_pan_dices_what_comes_into_the_image() {
    let balls = [0.0, 3.0, 8.0].map(|x| ball(&format!("/{x}"), DVec3::X * x));
    let mut scene = scene(balls.to_vec());
    let first = commit(&scene, None);
    look(&mut scene, DVec3::Z * 20.0, DVec3::X * 0.4);
    assert_eq!(touched(&commit(&scene, Some(&first))), (0, 3));
    look(&mut scene, DVec3::Z * 20.0, DVec3::X * 5.0);
    let panned = commit(&scene, Some(&first));
    assert_eq!(touched(&panned), (1, 2), "the one that was outside");
    // What leaves the image for a while stays.
    look(&mut scene, DVec3::Z * 20.0, DVec3::ZERO);
    assert_eq!(touched(&commit(&scene, Some(&panned))), (0, 3));
}

#[test]
fn a_larger_image_is_a_nearer_camera() {
    let mut scene = scene(vec![ball("/a", DVec3::ZERO)]);
    let first = commit(&scene, None);
    let [w, h] = scene.settings.resolution;
    let mut sized = |scale: f64| {
        let size = |pixels: u32| (f64::from(pixels) * scale) as u32;
        Arc::make_mut(&mut scene.settings).resolution = [size(w), size(h)];
        touched(&commit(&scene, Some(&first)))
    };
    assert_eq!(sized(1.2), (0, 1));
    assert_eq!(sized(0.5), (0, 1));
    assert_eq!(sized(2.0), (1, 0));
}

#[test]
fn ribbons_are_turned_to_the_camera() {
    let mut scene = scene(vec![strand("/strand"), ball("/ball", DVec3::X)]);
    let first = commit(&scene, None);
    let mut seen_from = |degrees: f64, to: DVec3| {
        let (z, x) = degrees.to_radians().sin_cos();
        look(&mut scene, DVec3::new(z, 0.0, x) * 20.0, to);
        touched(&commit(&scene, Some(&first)))
    };
    assert_eq!(seen_from(1.5, DVec3::ZERO), (0, 2));
    assert_eq!(seen_from(5.0, DVec3::ZERO), (1, 1));
    assert_eq!(
        seen_from(0.0, DVec3::X * 0.4),
        (0, 2),
        "the camera turns where it is"
    );
}

#[test]
fn other_edits_are_not_passed_over() {
    let mut scene = scene(vec![ball("/a", DVec3::ZERO), ball("/b", DVec3::X * 2.0)]);
    let first = commit(&scene, None);
    look(&mut scene, DVec3::Z * 19.5, DVec3::ZERO);
    let near = scene.clone();
    let prim = Arc::make_mut(scene.prims.get_mut(&PrimId(2)).unwrap());
    prim.common.transform = at(DMat4::from_translation(DVec3::X * 2.1));
    assert_eq!(touched(&commit(&scene, Some(&first))), (1, 1));
    let with = |change: fn(&mut RenderSettings)| {
        let mut scene = near.clone();
        change(Arc::make_mut(&mut scene.settings));
        touched(&commit(&scene, Some(&first)))
    };
    assert_eq!(with(|_| ()), (0, 2));
    assert_eq!(with(|s| s.shading_rate = 0.9), (2, 0));
    assert_eq!(with(|s| s.shutter = Some([0.0, 0.5])), (0, 2));
    assert_eq!(with(|s| s.keep_finer = false), (2, 0));
    // Nor are grids that were kept, once they may not be, though the camera is where it was.
    let kept = commit(&near, Some(&first));
    let mut fresh = near.clone();
    Arc::make_mut(&mut fresh.settings).keep_finer = false;
    assert_eq!(touched(&kept), (0, 2));
    assert_eq!(touched(&commit(&fresh, Some(&kept))), (2, 0));
}

fn show(scene: &mut Scene, id: u64, visible: bool) {
    let prim = Arc::make_mut(scene.prims.get_mut(&PrimId(id)).unwrap());
    prim.common.visible = visible;
}

#[test]
fn what_is_hidden_is_there_when_it_is_shown_again() {
    let mut scene = scene(vec![ball("/a", DVec3::ZERO), ball("/b", DVec3::X * 2.5)]);
    Arc::make_mut(&mut scene.settings).occlusion_culling = false;
    let first = commit(&scene, None);
    show(&mut scene, 2, false);
    let hidden = commit(&scene, Some(&first));
    assert_eq!(touched(&hidden), (0, 1));
    let one = hidden.statistics().micropolygons;
    assert!(one < first.statistics().micropolygons, "it counts nowhere");
    // Also after more commits, and before a camera that moves meanwhile.
    look(&mut scene, DVec3::Z * 19.5, DVec3::ZERO);
    let near = commit(&scene, Some(&hidden));
    show(&mut scene, 2, true);
    let shown = commit(&scene, Some(&near));
    assert_eq!(touched(&shown), (0, 2));
    let all = first.statistics().micropolygons;
    assert_eq!(shown.statistics().micropolygons, all);
}

#[test]
fn what_is_hidden_is_dropped_where_it_would_not_do() {
    let mut scene = scene(vec![ball("/a", DVec3::ZERO), ball("/b", DVec3::X * 2.5)]);
    Arc::make_mut(&mut scene.settings).occlusion_culling = false;
    let first = commit(&scene, None);
    show(&mut scene, 2, false);
    let hidden = commit(&scene, Some(&first));
    let after = |change: &dyn Fn(&mut Scene)| {
        let mut scene = scene.clone();
        change(&mut scene);
        let meanwhile = commit(&scene, Some(&hidden));
        look(&mut scene, DVec3::Z * 20.0, DVec3::ZERO);
        show(&mut scene, 2, true);
        touched(&commit(&scene, Some(&meanwhile)))
    };
    assert_eq!(after(&|_| ()), (0, 2));
    let to = DVec3::X * 2.5;
    let near = |scene: &mut Scene| look(scene, to + DVec3::Z * 5.0, to);
    assert_eq!(after(&near), (1, 1));
    let smaller = |scene: &mut Scene| {
        let prim = Arc::make_mut(scene.prims.get_mut(&PrimId(2)).unwrap());
        let Geometry::Implicit(desc) = &mut prim.geometry else {
            unreachable!("a ball")
        };
        desc.sizes = vec![[0.5, 0.0, 0.0]];
    };
    assert_eq!(after(&smaller), (1, 1));
    let moved = |scene: &mut Scene| {
        let prim = Arc::make_mut(scene.prims.get_mut(&PrimId(2)).unwrap());
        prim.common.transform = at(DMat4::from_translation(DVec3::X * 2.4));
    };
    assert_eq!(after(&moved), (1, 1));
    let coarser = |scene: &mut Scene| Arc::make_mut(&mut scene.settings).shading_rate = 2.0;
    assert_eq!(after(&coarser), (1, 1));
    let batch = |scene: &mut Scene| Arc::make_mut(&mut scene.settings).keep_finer = false;
    assert_eq!(after(&batch), (1, 1));
}

/// A ball that stands still, one that moves, one that grows, one whose color changes, a strand, and an instanced ball.
fn still_and_moving() -> Scene {
    const INSTANCER: PrimId = PrimId(50);
    let two = |at: fn(f64) -> DMat4| TransformSamples {
        times: vec![0.0, 1.0],
        matrices: vec![at(0.0), at(1.0)],
        ..TransformSamples::default()
    };
    let mut moving = ball("/moving", DVec3::ZERO);
    let moved = |t: f64| DMat4::from_translation(DVec3::new(-2.5, t, 0.0));
    moving.common.transform = vec![two(moved)];
    let mut growing = ball("/growing", DVec3::X * 2.5);
    if let Geometry::Implicit(desc) = &mut growing.geometry {
        desc.times = vec![0.0, 1.0];
        desc.sizes = vec![[1.0, 0.0, 0.0], [1.2, 0.0, 0.0]];
    }
    let mut coloured = ball("/coloured", DVec3::Y * 2.5);
    let mut color = PrimvarDesc::still(Interpolation::Constant, 3, vec![0.5; 3], vec![]);
    color.samples.push(color.samples[0].clone());
    color.samples[1] =
        PrimvarDesc::still(Interpolation::Constant, 3, vec![0.7; 3], vec![]).samples[0].clone();
    color.samples[1].time = 1.0;
    let color = ("displayColor".to_owned(), color);
    coloured.common.primvars.extend([color]);
    let mut part = ball("/i/part", DVec3::Y * -2.5);
    part.common.instancer = Some((INSTANCER, 0));
    let mut still = ball("/still", DVec3::ZERO);
    // As hosts sample it that do not know.
    still.common.transform = vec![two(|_| DMat4::IDENTITY)];
    let prims = vec![still, strand("/strand"), part, moving, growing, coloured];
    let mut scene = scene(prims);
    let mut desc = InstancerDesc::new("/i");
    desc.arrays = Arc::new(InstanceArrays {
        instance_count: 1,
        ..InstanceArrays::default()
    });
    scene.instancers.insert(INSTANCER, Arc::new(desc));
    Arc::make_mut(&mut scene.settings).occlusion_culling = false;
    scene
}

#[test]
fn another_shutter_leaves_what_stands_still() {
    for keep_finer in [true, false] {
        let mut scene = still_and_moving();
        Arc::make_mut(&mut scene.settings).keep_finer = keep_finer;
        let first = commit(&scene, None);
        let shut = |scene: &mut Scene, close: f64| {
            let camera = Arc::make_mut(scene.cameras.get_mut(&CAMERA).unwrap());
            camera.shutter = [0.0, close];
        };
        let mut blurred = scene.clone();
        shut(&mut blurred, 0.5);
        let open = commit(&blurred, Some(&first));
        assert_eq!(touched(&open), (3, 3), "keep_finer {keep_finer}");
        shut(&mut blurred, 0.25);
        let edited = commit(&blurred, Some(&open));
        assert_eq!(touched(&edited), (3, 3), "keep_finer {keep_finer}");
        let fresh = commit(&blurred, None);
        assert_eq!(edited.explain("cpu"), fresh.explain("cpu"));
        assert_eq!(
            edited.statistics().micropolygons,
            fresh.statistics().micropolygons
        );
        // A camera that moves sees what stands still differently.
        let camera = Arc::make_mut(blurred.cameras.get_mut(&CAMERA).unwrap());
        let from = camera.transform[0].matrices[0];
        camera.transform[0].times = vec![0.0, 1.0];
        camera.transform[0].matrices = vec![from, from * DMat4::from_translation(DVec3::Z * -18.0)];
        let passing = commit(&blurred, Some(&edited));
        shut(&mut blurred, 0.9);
        let passed = commit(&blurred, Some(&passing));
        // An interactive host keeps the instanced one, which is fine enough.
        let all = if keep_finer { (5, 1) } else { (6, 0) };
        assert_eq!(touched(&passed), all, "keep_finer {keep_finer}");
        let [passed, fresh] =
            [&passed, &commit(&blurred, None)].map(|p| p.statistics().micropolygons);
        assert!(
            passed == fresh || keep_finer && passed > fresh,
            "{passed} of {fresh}"
        );
    }
}

#[test]
fn what_curves_become_is_of_no_matter_to_others() {
    let mut scene = still_and_moving();
    let first = commit(&scene, None);
    Arc::make_mut(&mut scene.settings).curves = CurveForm::Tubes;
    assert_eq!(touched(&commit(&scene, Some(&first))), (1, 5));
}

#[test]
fn a_hidden_instancer_keeps_its_prototype() {
    const INSTANCER: PrimId = PrimId(50);
    let mut part = ball("/i/a", DVec3::ZERO);
    part.common.instancer = Some((INSTANCER, 0));
    let mut scene = scene(vec![part, ball("/b", DVec3::X * 2.5)]);
    let mut desc = InstancerDesc::new("/i");
    desc.arrays = Arc::new(InstanceArrays {
        instance_count: 3,
        positions: Samples {
            times: vec![0.0],
            values: vec![Arc::new(vec![Vec3::X, Vec3::Y, Vec3::Z])],
        },
        ..InstanceArrays::default()
    });
    scene.instancers.insert(INSTANCER, Arc::new(desc));
    let first = commit(&scene, None);
    let visible = |scene: &mut Scene, previous: &Prepared, visible: bool| {
        Arc::make_mut(scene.instancers.get_mut(&INSTANCER).unwrap()).visible = visible;
        commit(scene, Some(previous))
    };
    let hidden = visible(&mut scene, &first, false);
    assert_eq!(touched(&hidden), (0, 1));
    let shown = visible(&mut scene, &hidden, true);
    assert_eq!(touched(&shown), (0, 2));
    assert_eq!(shown.statistics().objects_placed, 0);
    assert_eq!(shown.statistics().instances, 4);
}
