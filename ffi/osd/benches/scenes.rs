//! Whole renders of three scenes on the CPU: dicing, build, rays per second, memory.
//!
//! `cargo bench -p hdtrapeze-osd --bench scenes [-- NAME...]` prints one row a scene. Each scene runs
//! in a process of its own, so that its peak memory is its own. Before a figure is printed, rays of
//! the same camera are answered by brute force over every micropolygon in f64, and must agree.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DMat4, DVec3, Vec2, Vec3};
use hdtrapeze_core::render::{Frame, Prepared, RenderControl, prepare, render};
use hdtrapeze_core::scene::Geometry;
use hdtrapeze_core::scene::{
    CameraDesc, InstanceArrays, InstancerDesc, MeshDesc, PointsSamples, PrimCommon, PrimDesc,
    PrimId, RenderSettings, Samples, Scene, TransformSamples,
};
use hdtrapeze_core::surface::{Crease, MeshTopology};
use hdtrapeze_core::trace::{Hit, TraceCounts};
use hdtrapeze_osd::OsdFactory;

const RESOLUTION: [u32; 2] = [1280, 720];
const SAMPLES: u32 = 16;
/// Rays that brute force answers before a figure is printed.
const CHECKED_RAYS: u32 = 24;

/// Makes a scene.
type Make = fn() -> Scene;

const SCENES: [(&str, Make); 3] = [
    ("sheet", sheet),
    ("tumbling", tumbling),
    ("instances", instances),
];

fn main() {
    let names: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .collect();
    if let Ok(name) = std::env::var("SCENES_BENCH_CHILD") {
        let (_, make) = SCENES
            .iter()
            .find(|(n, _)| *n == name)
            .expect("a known scene");
        return run(&name, make());
    }
    println!(
        "{} x {}, {SAMPLES} samples a pixel, {} threads",
        RESOLUTION[0],
        RESOLUTION[1],
        rayon::current_num_threads()
    );
    println!(
        "{:<10} {:>8} {:>10} {:>10} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "scene",
        "Mupoly",
        "Mlimit",
        "dice M/s",
        "build M/s",
        "Mrays/s",
        "nodes/ray",
        "cells/ray",
        "mesh B/u",
        "bvh B/u",
        "peak B/u"
    );
    let me = std::env::current_exe().expect("a path of this program");
    for (name, _) in SCENES {
        if names.is_empty() || names.iter().any(|n| n == name) {
            let status = std::process::Command::new(&me)
                .env("SCENES_BENCH_CHILD", name)
                .status()
                .expect("this program starts again");
            assert!(status.success(), "{name} failed");
        }
    }
}

fn run(name: &str, scene: Scene) {
    let cancel = AtomicBool::new(false);
    let before = peak_bytes();
    let preparation =
        prepare(&scene, &OsdFactory::default(), None, &cancel).expect("the scene is sound");
    assert!(
        preparation.warnings.is_empty(),
        "{:?}",
        preparation.warnings
    );
    let prepared = preparation.prepared;
    let after = peak_bytes();
    check(&prepared);
    let frame = Frame::new(RESOLUTION, None, prepared.aovs()).expect("a film");
    let control = RenderControl {
        cancel: &cancel,
        on_progress: &|_| {},
        on_pass: &|_, _| {},
    };
    let traced = render(&prepared, &frame, &control);
    let s = prepared.statistics();
    let cells = s.micropolygons as f64;
    let rays = traced.counts.rays as f64;
    println!(
        "{name:<10} {:>8.3} {:>10.2} {:>10.2} {:>9.2} {:>9.2} {:>9.1} {:>9.1} {:>9.1} {:>9.1} {:>9.1}",
        cells / 1.0e6,
        s.limit_evaluations as f64 / 1.0e6,
        cells / s.dice_seconds.max(1.0e-9) / 1.0e6,
        cells / s.build_seconds.max(1.0e-9) / 1.0e6,
        rays / traced.seconds / 1.0e6,
        traced.counts.node_tests as f64 / rays,
        traced.counts.cell_tests as f64 / rays,
        s.geometry_bytes as f64 / cells,
        s.bvh_bytes as f64 / cells,
        after.saturating_sub(before) as f64 / cells,
    );
}

/// Most memory this process has held, bytes; 0 where the system does not tell.
fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM:"));
    let kib = line
        .and_then(|l| l.split_whitespace().nth(1))
        .and_then(|n| n.parse::<u64>().ok());
    kib.unwrap_or(0) * 1024
}

/// Compares a few camera rays with brute force over every micropolygon.
fn check(prepared: &Prepared) {
    let world = prepared.world();
    let mut hits = 0;
    for i in 0..CHECKED_RAYS {
        let f = f64::from(i) / f64::from(CHECKED_RAYS);
        let at = |k: f64| (f * k).fract() as f32;
        let raster = Vec2::new(
            at(7.31) * RESOLUTION[0] as f32,
            at(3.77) * RESOLUTION[1] as f32,
        );
        let ray = prepared
            .camera()
            .ray(raster, Vec2::new(at(5.1) - 0.5, 0.3), at(1.0));
        let hit = world.trace(&ray, &mut TraceCounts::default());
        let truth = brute_force(prepared, &ray);
        match (hit.is_hit(), truth.is_finite()) {
            (true, true) => {
                let error = (f64::from(hit.t) - truth).abs() / truth;
                assert!(error < 1.0e-4, "ray {i}: {} against {truth}", hit.t);
                hits += 1;
            }
            (false, false) => {}
            (a, b) => panic!("ray {i}: traced {a}, brute force {b}"),
        }
    }
    assert!(hits > CHECKED_RAYS / 4, "the camera sees the scene");
}

fn brute_force(prepared: &Prepared, ray: &hdtrapeze_core::trace::Ray) -> f64 {
    use rayon::prelude::*;
    let world = prepared.world();
    let (origin, dir) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    let triangle = |a: DVec3, b: DVec3, c: DVec3| {
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2);
        let determinant = -dir.dot(normal);
        let to = origin - a;
        let moment = to.cross(dir);
        let (u, v) = (e2.dot(moment) / determinant, -e1.dot(moment) / determinant);
        let t = to.dot(normal) / determinant;
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        let near = t >= f64::from(ray.t_min) && t <= f64::from(ray.t_max);
        if inside && near { t } else { f64::INFINITY }
    };
    (0..world.instance_count() as u32)
        .into_par_iter()
        .map(|instance| {
            let mut nearest = f64::INFINITY;
            let mut hit = Hit {
                instance,
                ..Hit::MISS
            };
            let Some(object) = world.object(&hit) else {
                return nearest;
            };
            for (g, grid) in object.mesh().grids.iter().enumerate() {
                for cell in 0..grid.cell_count() {
                    (hit.grid, hit.cell) = (g as u32, cell as u32);
                    let Some(p) = world.cell_vertices(&hit, ray.time) else {
                        continue;
                    };
                    let p = p.map(|p| p.as_dvec3());
                    nearest = nearest
                        .min(triangle(p[0], p[1], p[2]))
                        .min(triangle(p[0], p[2], p[3]));
                }
            }
            nearest
        })
        .reduce(|| f64::INFINITY, f64::min)
}

fn scene_of(prims: Vec<PrimDesc>, distance: f64, f_stop: f64) -> Scene {
    let mut scene = Scene::default();
    for (i, prim) in prims.into_iter().enumerate() {
        scene.prims.insert(PrimId(i as u64 + 1), Arc::new(prim));
    }
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        transform: vec![fixed(DMat4::from_translation(DVec3::new(
            0.0, 0.0, distance,
        )))],
        focal_length: 3.0,
        f_stop,
        focus_distance: distance,
        clipping: [0.1, 10_000.0],
        shutter: [0.0, 1.0],
        ..CameraDesc::default()
    };
    scene.cameras.insert(PrimId(1_000_000), Arc::new(camera));
    scene.active_camera = Some(PrimId(1_000_000));
    scene.settings = Arc::new(RenderSettings {
        resolution: RESOLUTION,
        samples: SAMPLES,
        ..RenderSettings::default()
    });
    scene
}

fn fixed(matrix: DMat4) -> TransformSamples {
    TransformSamples {
        times: vec![0.0],
        matrices: vec![matrix],
        ..TransformSamples::default()
    }
}

fn mesh(path: String, topology: MeshTopology, points: PointsSamples) -> PrimDesc {
    let geometry = Geometry::Mesh(MeshDesc {
        topology: Arc::new(topology),
        points,
        ..MeshDesc::default()
    });
    PrimDesc {
        common: PrimCommon::new(path),
        geometry,
    }
}

/// A Catmull-Clark sheet over the whole image whose ripples travel while the shutter is open.
fn sheet() -> Scene {
    const N: u32 = 96;
    let points = |phase: f32| -> Vec<Vec3> {
        let vertex = |i: u32, j: u32| {
            let (x, y) = (
                i as f32 / N as f32 * 2.0 - 1.0,
                j as f32 / N as f32 * 2.0 - 1.0,
            );
            Vec3::new(6.0 * x, 4.0 * y, 0.25 * (9.0 * x + 4.0 * y + phase).sin())
        };
        (0..=N)
            .flat_map(|j| (0..=N).map(move |i| vertex(i, j)))
            .collect()
    };
    let corner = |i: u32, j: u32| j * (N + 1) + i;
    let quads = (0..N).flat_map(|j| (0..N).map(move |i| (i, j)));
    let topology = MeshTopology {
        face_vertex_counts: vec![4; (N * N) as usize],
        face_vertex_indices: quads
            .flat_map(|(i, j)| {
                [
                    corner(i, j),
                    corner(i + 1, j),
                    corner(i + 1, j + 1),
                    corner(i, j + 1),
                ]
            })
            .collect(),
        ..MeshTopology::default()
    };
    let samples = PointsSamples {
        times: vec![0.0, 1.0],
        points: vec![Arc::new(points(0.0)), Arc::new(points(0.8))],
        ..PointsSamples::default()
    };
    scene_of(
        vec![mesh("/sheet".to_owned(), topology, samples)],
        12.0,
        2.0,
    )
}

fn cube() -> (MeshTopology, PointsSamples) {
    let corners = (0..8u32).map(|i| {
        let side = |bit: u32| if i & bit == 0 { -0.5 } else { 0.5 };
        Vec3::new(side(1), side(2), side(4))
    });
    let topology = MeshTopology {
        face_vertex_counts: vec![4; 6],
        face_vertex_indices: vec![
            0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5,
        ],
        creases: vec![Crease {
            vertices: vec![0, 1, 3, 2, 0],
            sharpness: vec![3.0; 4],
        }],
        ..MeshTopology::default()
    };
    let points = Arc::new(corners.collect::<Vec<Vec3>>());
    (
        topology,
        PointsSamples {
            times: vec![0.0],
            points: vec![points],
            ..PointsSamples::default()
        },
    )
}

/// Places on a jittered lattice that fills the view.
fn places(columns: i32, rows: i32, spacing: f64) -> impl Iterator<Item = (DVec3, f64)> {
    (0..columns * rows).map(move |i| {
        let (x, y) = (i % columns, i / columns);
        let turn = f64::from(i) * 2.399_963;
        let depth = (f64::from(i) * 0.618_034).fract() * -4.0;
        let place = DVec3::new(
            (f64::from(x) - f64::from(columns - 1) / 2.0) * spacing,
            (f64::from(y) - f64::from(rows - 1) / 2.0) * spacing,
            depth,
        );
        (place, turn)
    })
}

/// 240 creased cubes, each turning by up to a radian and moving its own size.
fn tumbling() -> Scene {
    let prims = places(20, 12, 0.62)
        .enumerate()
        .map(|(i, (place, turn))| {
            let (topology, points) = cube();
            let mut prim = mesh(format!("/cube{i}"), topology, points);
            let times: Vec<f64> = (0..=8).map(|k| f64::from(k) / 8.0).collect();
            let matrices = times
                .iter()
                .map(|&t| {
                    DMat4::from_translation(place + DVec3::new(0.6 * t, 0.2 * t, 0.0))
                        * DMat4::from_rotation_z(turn + t)
                        * DMat4::from_rotation_x(turn * 0.7 + 0.5 * t)
                        * DMat4::from_scale(DVec3::splat(0.45))
                })
                .collect();
            prim.common.transform = vec![TransformSamples {
                times,
                matrices,
                ..TransformSamples::default()
            }];
            prim
        })
        .collect();
    scene_of(prims, 12.0, 2.0)
}

/// 2,000 instances of one creased cube, each moving.
fn instances() -> Scene {
    let (topology, points) = cube();
    let mut prim = mesh("/cube".to_owned(), topology, points);
    let placed: Vec<(DVec3, f64)> = places(50, 40, 0.25).collect();
    let at = |shift: f64| {
        placed.iter().map(move |(place, turn)| {
            DMat4::from_translation(*place + DVec3::new(0.1 * shift, 0.0, 0.0))
                * DMat4::from_rotation_z(*turn + 0.3 * shift)
                * DMat4::from_scale(DVec3::splat(0.3))
        })
    };
    let id = PrimId(1 << 32);
    prim.common.instancer = Some((id, 0));
    let arrays = InstanceArrays {
        instance_count: placed.len(),
        matrices: Samples {
            times: vec![0.0, 1.0],
            values: [0.0, 1.0].map(|s| Arc::new(at(s).collect())).to_vec(),
        },
        ..InstanceArrays::default()
    };
    let instancer = InstancerDesc {
        arrays: Arc::new(arrays),
        ..InstancerDesc::new("/instancer")
    };
    let mut scene = scene_of(vec![prim], 12.0, 2.0);
    scene.instancers.insert(id, Arc::new(instancer));
    scene
}
