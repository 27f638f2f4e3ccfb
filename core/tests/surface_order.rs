//! Pictures do not depend on the order of rays: whole tiles by where they meet a surface that moves out of focus, and one ray after the
//! other, give the same bits.

mod support;

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DMat4, DVec3, Vec3};
use hdtrapeze_core::aov::{Aov, AovData};
use hdtrapeze_core::render::{Frame, RenderControl, prepare, render};
use hdtrapeze_core::scene::{
    CameraDesc, Cull, Geometry, MeshDesc, PointsSamples, PrimCommon, PrimDesc, PrimId,
    RenderSettings, Scene, TransformSamples,
};
use hdtrapeze_core::surface::{MeshTopology, Scheme};
use support::NoSubdivision;

const SIZE: [u32; 2] = [43, 27];
/// Faces along a side.
const SIDE: u32 = 60;

/// A rippled sheet that faces the camera, slides, turns and grows.
fn scene(cull: Cull, f_stop: f64, slides: bool) -> Scene {
    let mut scene = Scene::default();
    let grid = |n: u32| (0..n).flat_map(move |j| (0..n).map(move |i| (i, j)));
    let points: Vec<Vec3> = grid(SIDE + 1)
        .map(|(i, j)| {
            let [x, y] = [i, j].map(|i| i as f32 / SIDE as f32 * 2.0 - 1.0);
            Vec3::new(x, y, 0.03 * (8.0 * x).sin() * (6.0 * y).cos()) * 2.0
        })
        .collect();
    let indices = grid(SIDE).flat_map(|(i, j)| {
        let at = j * (SIDE + 1) + i;
        [at, at + 1, at + SIDE + 2, at + SIDE + 1]
    });
    let mut common = PrimCommon::new("/sheet");
    let turned = |angle: f64, by: DVec3| {
        DMat4::from_translation(by)
            * DMat4::from_rotation_z(angle)
            * DMat4::from_scale(DVec3::splat(1.0 + angle))
    };
    let way = DVec3::new(0.3, -0.2, 0.1);
    let last = if slides {
        turned(0.05, way)
    } else {
        turned(0.0, DVec3::ZERO)
    };
    common.transform = vec![TransformSamples {
        times: vec![0.0, 1.0],
        matrices: vec![turned(0.0, DVec3::ZERO), last],
        ..TransformSamples::default()
    }];
    let geometry = Geometry::Mesh(MeshDesc {
        topology: Arc::new(MeshTopology {
            scheme: Scheme::None,
            face_vertex_counts: vec![4; (SIDE * SIDE) as usize],
            face_vertex_indices: indices.collect(),
            ..MeshTopology::default()
        }),
        points: PointsSamples {
            times: vec![0.0],
            points: vec![Arc::new(points)],
            ..PointsSamples::default()
        },
        ..MeshDesc::default()
    });
    let prim = PrimDesc { common, geometry };
    scene.prims.insert(PrimId(1), Arc::new(prim));
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        transform: vec![TransformSamples {
            times: vec![0.0],
            matrices: vec![DMat4::from_translation(DVec3::Z * 6.0)],
            ..TransformSamples::default()
        }],
        horizontal_aperture: 3.0,
        vertical_aperture: 3.0 * f64::from(SIZE[1]) / f64::from(SIZE[0]),
        focal_length: 5.0,
        focus_distance: 4.0,
        f_stop,
        clipping: [0.01, 1000.0],
        shutter: [0.0, 1.0],
        ..CameraDesc::default()
    };
    scene.cameras.insert(PrimId(100), Arc::new(camera));
    scene.active_camera = Some(PrimId(100));
    scene.settings = Arc::new(RenderSettings {
        resolution: SIZE,
        samples: 24,
        cull,
        aovs: ["color", "depth", "normal", "elementId"]
            .map(str::to_owned)
            .into(),
        ..RenderSettings::default()
    });
    scene
}

fn rendered(scene: &Scene) -> Vec<Vec<u32>> {
    let cancel = AtomicBool::new(false);
    let preparation = prepare(scene, &NoSubdivision, None, &cancel).unwrap();
    let prepared = preparation.prepared;
    // While debugging, so little is large.
    assert!(!cfg!(debug_assertions) || prepared.world().is_far());
    let frame = Frame::new(SIZE, None, prepared.aovs()).unwrap();
    let told = Cell::new(0);
    let control = RenderControl {
        cancel: &cancel,
        on_progress: &|_| {},
        on_pass: &|done, _| {
            if done == 1 {
                let tiles = 0..frame.tile_count();
                told.set(tiles.filter(|&i| frame.tile(i).expected.is_some()).count());
            }
        },
    };
    let statistics = render(&prepared, &frame, &control);
    let rays = u64::from(SIZE[0] * SIZE[1] * 24);
    assert_eq!(statistics.counts.rays, rays, "each ray counts once");
    // One sample a pixel tells what those after it are expected to meet, where rays go in packets.
    let least = match prepared.world().is_far() && scene.settings.cull == Cull::None {
        true => frame.tile_count() / 2,
        false => 0,
    };
    assert!(
        told.get() >= least && (least > 0 || told.get() == 0),
        "{told:?}"
    );
    let bits = |aov: &Aov| match frame.aov(aov.clone()).unwrap().data {
        AovData::F32(data) => data.iter().map(|x| x.to_bits()).collect(),
        AovData::I32(data) => data.iter().map(|x| x.cast_unsigned()).collect(),
    };
    prepared.aovs().iter().map(bits).collect()
}

#[test]
fn pictures_do_not_depend_on_the_order_of_rays() {
    for (f_stop, slides) in [(0.0, true), (8.0, false), (8.0, true)] {
        // Where a side is culled each ray goes alone; none of this one's is seen.
        let [ordered, alone] =
            [Cull::None, Cull::Back].map(|cull| rendered(&scene(cull, f_stop, slides)));
        assert_eq!(ordered.len(), 4);
        assert!(ordered[3].iter().any(|&x| x != u32::MAX));
        for (ordered, alone) in ordered.iter().zip(&alone) {
            assert!(ordered == alone, "{f_stop} {slides}");
        }
    }
}
