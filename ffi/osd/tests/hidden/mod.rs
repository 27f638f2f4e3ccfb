//! Scenes in which much is hidden.
#![allow(dead_code, missing_docs)]

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DMat4, DVec3, Quat, Vec3};
use hdtrapeze_core::aov::{Aov, AovData};
use hdtrapeze_core::render::{Frame, Prepared, RenderControl, prepare, render};
use hdtrapeze_core::scene::{
    CameraDesc, Geometry, MeshDesc, PointsSamples, PrimCommon, PrimDesc, PrimId, RenderSettings,
    Scene, TransformSamples,
};
use hdtrapeze_core::surface::MeshTopology;
use hdtrapeze_osd::OsdFactory;

pub const CAMERA: PrimId = PrimId(1_000_000);

pub fn moving(matrices: &[DMat4]) -> TransformSamples {
    let last = (matrices.len() - 1).max(1) as f64;
    TransformSamples {
        times: (0..matrices.len()).map(|i| i as f64 / last).collect(),
        matrices: matrices.to_vec(),
        ..TransformSamples::default()
    }
}

/// Places at even times of the shutter.
pub fn placed(mut prim: PrimDesc, places: &[DVec3]) -> PrimDesc {
    let matrices: Vec<DMat4> = places.iter().map(|&p| DMat4::from_translation(p)).collect();
    prim.common.transform = vec![moving(&matrices)];
    prim
}

fn mesh(path: &str, faces: Vec<[u32; 4]>, keys: Vec<Vec<Vec3>>) -> PrimDesc {
    let topology = MeshTopology {
        face_vertex_counts: vec![4; faces.len()],
        face_vertex_indices: faces.concat(),
        ..MeshTopology::default()
    };
    let last = (keys.len() - 1).max(1) as f64;
    let geometry = Geometry::Mesh(MeshDesc {
        topology: Arc::new(topology),
        points: PointsSamples {
            times: (0..keys.len()).map(|i| i as f64 / last).collect(),
            points: keys.into_iter().map(Arc::new).collect(),
            ..PointsSamples::default()
        },
        ..MeshDesc::default()
    });
    PrimDesc {
        common: PrimCommon::new(path),
        geometry,
    }
}

/// A closed ball of `6 n n` faces with bumps, which grow by `growth` of the radius.
pub fn ball(path: &str, n: i32, radius: f32, growth: f32) -> PrimDesc {
    let mut numbers: HashMap<[i32; 3], u32> = HashMap::new();
    let mut points: Vec<Vec3> = Vec::new();
    let mut faces = Vec::new();
    for face in 0..6usize {
        let (axis, side) = (face / 2, if face % 2 == 0 { 1 } else { -1 });
        let mut number = |i: i32, j: i32| {
            let mut at = [0; 3];
            at[axis] = side * n;
            // Counter-clockwise from outside.
            at[(axis + 1) % 3] = (2 * i - n) * side;
            at[(axis + 2) % 3] = 2 * j - n;
            *numbers.entry(at).or_insert_with(|| {
                let p = Vec3::from_array(at.map(|x| x as f32 / n as f32));
                points.push(p.normalize());
                points.len() as u32 - 1
            })
        };
        for j in 0..n {
            for i in 0..n {
                faces.push([
                    number(i, j),
                    number(i + 1, j),
                    number(i + 1, j + 1),
                    number(i, j + 1),
                ]);
            }
        }
    }
    let at = |growth: f32| -> Vec<Vec3> {
        let bump = |p: &Vec3| (p.x * 7.0).sin() * (p.y * 9.0).sin() * (p.z * 8.0).cos();
        let grown = |p: &Vec3| *p * radius * (1.0 + 0.05 * bump(p) + growth * (1.0 + p.y));
        points.iter().map(grown).collect()
    };
    let keys = match growth {
        0.0 => vec![at(0.0)],
        growth => vec![at(0.0), at(growth)],
    };
    mesh(path, faces, keys)
}

/// A [`ball`] that turns about the axis of view, by an angle of radians, given at `keys` samples of its points.
pub fn turning(path: &str, n: i32, radius: f32, angle: f32, keys: usize) -> PrimDesc {
    let mut prim = ball(path, n, radius, 0.0);
    if let Geometry::Mesh(mesh) = &mut prim.geometry {
        let first = Arc::clone(&mesh.points.points[0]);
        let at = |k: usize| k as f64 / (keys - 1) as f64;
        let turned = |k: usize| {
            let q = Quat::from_rotation_z(angle * at(k) as f32);
            Arc::new(first.iter().map(|&p| q * p).collect())
        };
        mesh.points.times = (0..keys).map(at).collect();
        mesh.points.points = (0..keys).map(turned).collect();
    }
    prim
}

/// A rippled sheet of `n` by `n` faces across the view.
pub fn sheet(path: &str, n: u32, size: f32) -> PrimDesc {
    let vertex = |i: u32, j: u32| {
        let [x, y] = [i, j].map(|k| (k as f32 / n as f32 - 0.5) * size);
        Vec3::new(x, y, 0.02 * size * (9.0 * x / size + 4.0 * y).sin())
    };
    let points = (0..=n).flat_map(|j| (0..=n).map(move |i| vertex(i, j)));
    let corner = |i: u32, j: u32| j * (n + 1) + i;
    let quads = (0..n).flat_map(|j| (0..n).map(move |i| (i, j)));
    let faces = quads.map(|(i, j)| {
        [
            corner(i, j),
            corner(i + 1, j),
            corner(i + 1, j + 1),
            corner(i, j + 1),
        ]
    });
    mesh(path, faces.collect(), vec![points.collect()])
}

/// Seen from (0, 0, 12), in focus there.
pub fn scene(prims: Vec<PrimDesc>, settings: RenderSettings, f_stop: f64) -> Scene {
    let mut scene = Scene::default();
    for (i, mut prim) in prims.into_iter().enumerate() {
        prim.common.pick_id = i as i32 + 1;
        scene.prims.insert(PrimId(i as u64 + 1), Arc::new(prim));
    }
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        transform: vec![moving(&[DMat4::from_translation(DVec3::Z * 12.0)])],
        focal_length: 3.0,
        f_stop,
        focus_distance: 12.0,
        clipping: [0.1, 10_000.0],
        shutter: [0.0, 1.0],
        ..CameraDesc::default()
    };
    scene.cameras.insert(CAMERA, Arc::new(camera));
    scene.active_camera = Some(CAMERA);
    scene.settings = Arc::new(settings);
    scene
}

/// The scene with occlusion culling on or off.
pub fn with_culling(scene: &Scene, on: bool) -> Scene {
    let mut scene = scene.clone();
    Arc::make_mut(&mut scene.settings).occlusion_culling = on;
    scene
}

pub fn prepared(scene: &Scene, previous: Option<&Prepared>) -> Prepared {
    let cancel = AtomicBool::new(false);
    let factory = OsdFactory::default();
    let preparation = prepare(scene, &factory, previous, &cancel).expect("the scene is sound");
    assert!(
        preparation.warnings.is_empty(),
        "{:?}",
        preparation.warnings
    );
    preparation.prepared
}

/// Renders, on the calling thread's pool; gives seconds and rays.
pub fn rendered(prepared: &Prepared) -> (Frame, f64, u64) {
    let settings = prepared.settings();
    let frame = Frame::new(settings.resolution, None, prepared.aovs()).expect("a film");
    let control = RenderControl {
        cancel: &AtomicBool::new(false),
        on_progress: &|_| {},
        on_pass: &|_, _| {},
    };
    let traced = render(prepared, &frame, &control);
    (frame, traced.seconds, traced.counts.rays)
}

/// Every AOV of an image, as bits.
pub fn bits(frame: &Frame) -> Vec<(String, Vec<u32>)> {
    let of = |aov: &Aov| {
        let values = match frame.aov(aov).expect("it is kept").data {
            AovData::F32(values) => values.into_iter().map(f32::to_bits).collect(),
            AovData::I32(values) => values.into_iter().map(|x| x as u32).collect(),
        };
        (aov.name().to_owned(), values)
    };
    frame.aovs().iter().map(of).collect()
}
