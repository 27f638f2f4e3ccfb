//! A frame from samples to pixels, all of it on the device: no ray crosses the bus, and only the film is kept.

mod secondary;
#[path = "../../../tests/support/mod.rs"]
mod support;

use std::error::Error;
use std::f32::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use glam::{DMat4, DVec3, Vec3};
use hdtrapeze_core::aov::{Aov, AovData};
use hdtrapeze_core::render::{
    Elsewhere, Frame, Prepared, RayTracer, RenderControl, Stage, Watcher, prepare_with, render_with,
};
use hdtrapeze_core::scene::{
    Backend, CameraDesc, Geometry, ImplicitDesc, ImplicitKind, Interpolation, MeshDesc,
    PointsSamples, PrimCommon, PrimDesc, PrimId, PrimvarDesc, RenderSettings, Scene,
    TransformSamples,
};
use hdtrapeze_core::surface::{MeshTopology, Scheme};
use hdtrapeze_gpu::{
    Device, EarlyBytes, EarlyVertices, FirstOnDevice, FrameOptions, GpuFrame, Stages,
};
use secondary::Secondary;
use support::NoSubdivision;

use crate::bench_roofline::Peaks;
use crate::stages_told;

/// Pixels of the image.
const SIZE: [u32; 2] = [1280, 720];
/// Polygons along the sheet.
const POLYGONS: u32 = 60;
const BALLS: u64 = 24;
/// Millions of micropolygons of a pixel's size.
const MILLIONS: f64 = 1.24;

fn at(matrices: Vec<DMat4>) -> Vec<TransformSamples> {
    let last = (matrices.len() - 1).max(1) as f64;
    vec![TransformSamples {
        times: (0..matrices.len()).map(|i| i as f64 / last).collect(),
        matrices,
        ..TransformSamples::default()
    }]
}

fn color(interpolation: Interpolation, count: u32, first: u32) -> PrimvarDesc {
    let value = |i: u32| 0.1 + 0.8 * ((i + first) % 13) as f32 / 13.0;
    let values = (0..3 * count).map(value).collect();
    PrimvarDesc::still(interpolation, 3, values, vec![])
}

/// A sheet that ripples across the view.
fn sheet() -> PrimDesc {
    let row = POLYGONS + 1;
    let corner = |i: u32, j: u32| j * row + i;
    let quads = (0..POLYGONS).flat_map(|j| (0..POLYGONS).map(move |i| (i, j)));
    let faces = quads.flat_map(|(i, j)| {
        [
            corner(i, j),
            corner(i + 1, j),
            corner(i + 1, j + 1),
            corner(i, j + 1),
        ]
    });
    let points = |phase: f32| {
        let vertex = |k: u32| {
            let [x, y] = [k % row, k / row].map(|i| i as f32 / POLYGONS as f32 - 0.5);
            let z = 0.3 * (3.0 * TAU * x + phase).sin() * (2.0 * TAU * y).cos();
            Vec3::new(16.0 * x, 10.0 * y, z - 4.0)
        };
        Arc::new((0..row * row).map(vertex).collect())
    };
    let topology = MeshTopology {
        scheme: Scheme::None,
        face_vertex_counts: vec![4; (POLYGONS * POLYGONS) as usize],
        face_vertex_indices: faces.collect(),
        ..MeshTopology::default()
    };
    let geometry = Geometry::Mesh(MeshDesc {
        topology: Arc::new(topology),
        points: PointsSamples {
            times: vec![0.0, 1.0],
            points: vec![points(0.0), points(0.6)],
            ..PointsSamples::default()
        },
        ..MeshDesc::default()
    });
    let mut common = PrimCommon::new("/sheet");
    let color = color(Interpolation::Vertex, row * row, 0);
    common.primvars.insert("displayColor".to_owned(), color);
    PrimDesc { common, geometry }
}

/// A ball on its way.
fn ball(i: u64) -> PrimDesc {
    let geometry = Geometry::Implicit(ImplicitDesc {
        kind: ImplicitKind::Sphere,
        times: vec![0.0],
        sizes: vec![[0.5, 0.0, 0.0]],
        ..ImplicitDesc::default()
    });
    let mut common = PrimCommon::new(format!("/ball{i}"));
    common.pick_id = i as i32 + 1;
    let i = i as f64;
    let from = DVec3::new(
        (i * 1.7).sin() * 4.0,
        (i * 2.9).cos() * 2.2,
        (i * 0.8).sin() * 2.0,
    );
    let to = from + DVec3::new((i * 3.1).cos(), (i * 1.3).sin(), 0.2) * 0.4;
    common.transform = at([from, to].map(DMat4::from_translation).to_vec());
    let color = color(Interpolation::Constant, 1, i as u32);
    common.primvars.insert("displayColor".to_owned(), color);
    PrimDesc { common, geometry }
}

fn scene(samples: u32, opacity: f32, millions: f64) -> Scene {
    let mut scene = Scene::default();
    scene.prims.insert(PrimId(1), Arc::new(sheet()));
    for i in 0..BALLS {
        scene.prims.insert(PrimId(i + 2), Arc::new(ball(i)));
    }
    for prim in scene.prims.values_mut() {
        let opacity = PrimvarDesc::still(Interpolation::Constant, 1, vec![opacity], vec![]);
        let primvars = &mut Arc::make_mut(prim).common.primvars;
        primvars.insert("displayOpacity".to_owned(), opacity);
    }
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        transform: at(vec![DMat4::from_translation(DVec3::Z * 7.0)]),
        focal_length: 2.4,
        f_stop: 1.8,
        focus_distance: 7.0,
        clipping: [0.1, 100.0],
        shutter: [0.0, 1.0],
        ..CameraDesc::default()
    };
    scene.cameras.insert(PrimId(0), Arc::new(camera));
    scene.active_camera = Some(PrimId(0));
    scene.settings = Arc::new(RenderSettings {
        resolution: SIZE,
        samples,
        shading_rate: (MILLIONS / millions).sqrt() as f32,
        occlusion_culling: false,
        // It makes all trees.
        backend: Backend::Gpu,
        aovs: ["color", "primId", "elementId"].map(str::to_owned).to_vec(),
        ..RenderSettings::default()
    });
    scene
}

/// The first sample of each pixel, on the device where it is given.
fn first_pass(prepared: &Prepared, on: Option<&GpuFrame>) -> Result<Frame, Box<dyn Error>> {
    let frame = Frame::new(SIZE, None, prepared.aovs())?;
    let cancel = AtomicBool::new(false);
    let control = RenderControl {
        cancel: &cancel,
        on_progress: &|_| {},
        on_pass: &|_, _| cancel.store(true, Ordering::Relaxed),
    };
    let elsewhere = on.map(|on| Elsewhere::new(on));
    render_with(prepared, &frame, &control, elsewhere.as_ref());
    match elsewhere.and_then(|elsewhere| elsewhere.fault()) {
        Some(why) => Err(why.into()),
        None => Ok(frame),
    }
}

/// Share of pixels whose first samples see another face than on the CPU.
fn difference(prepared: &Prepared, on: &GpuFrame) -> Result<f64, Box<dyn Error>> {
    let faces = |on| -> Result<Vec<i32>, Box<dyn Error>> {
        let frame = first_pass(prepared, on)?;
        let ids = |aov| match frame.aov(aov).map(|image| image.data) {
            Some(AovData::I32(ids)) => ids,
            _ => Vec::new(),
        };
        let (prims, faces) = (ids(Aov::PrimId), ids(Aov::ElementId));
        Ok(prims
            .iter()
            .zip(faces)
            .map(|(p, face)| p * 10_000 + face)
            .collect())
    };
    let (here, there) = (faces(None)?, faces(Some(on))?);
    let differ = here.iter().zip(&there).filter(|(a, b)| a != b).count();
    Ok(differ as f64 / here.len() as f64)
}

/// Renders the frame with so many samples a pixel, of things with this opacity, and about so many millions of micropolygons, and
/// prints what that took; first samples may differ from the CPU's in so many parts of the image.
pub fn run(
    device: &Arc<Device>,
    (samples, opacity, millions): (u32, f32, Option<f64>),
    (options, early): (FrameOptions, bool),
    different: f64,
    peaks: Peaks,
) -> Result<(), Box<dyn Error>> {
    let never = AtomicBool::new(false);
    let stages = Arc::new(Stages::new(device));
    let early = EarlyVertices::for_frame(&stages, &options).filter(|_| early);
    let start = Instant::now();
    let prepared = {
        let scene = scene(samples, opacity, millions.unwrap_or(MILLIONS));
        let watcher = early.as_ref().map(|early| early as &dyn Watcher);
        prepare_with(&scene, &NoSubdivision, None, None, watcher, &never)?.prepared
    };
    let seconds = start.elapsed().as_secs_f64();
    let cells = prepared.statistics().micropolygons;
    say!(
        "prepared in {seconds:.2} s: {:.2} Mcells",
        cells as f64 * 1e-6
    );
    let start = Instant::now();
    let on_gpu = GpuFrame::with_early(options, stages, &prepared, early.as_ref())?;
    let mib = on_gpu.bytes() as f64 / f64::from(1 << 20);
    let here = prepared.world().stats();
    say!(
        "uploaded in {:.2} s: {mib:.0} MiB; {}; {} of {} trees made on the CPU",
        start.elapsed().as_secs_f64(),
        on_gpu.explain(),
        here.trees,
        here.objects,
    );
    if let Some(early) = &early {
        let EarlyBytes {
            uploaded,
            beside,
            used,
        } = early.bytes();
        let [uploaded, beside, used] =
            [uploaded, beside, used].map(|b| b as f64 / f64::from(1 << 20));
        say!(
            "vertices: {uploaded:.0} MiB uploaded early, {beside:.0} before all was diced, {used:.0} used"
        );
    }
    drop(early);
    if options.first < FirstOnDevice::Generate {
        let seconds = on_gpu.build_seconds();
        say!("trees made there: {}", stages_told(seconds, cells as usize));
    }
    if on_gpu.stages() != (options.first.of_samples()..=Stage::Film) {
        return Err(on_gpu.explain().into());
    }
    let differ = difference(&prepared, &on_gpu)?;
    say!("first samples that differ from the CPU's: {differ:.6}");
    if differ > different {
        return Err(format!("{differ} of the pixels differ").into());
    }
    let on_gpu = on_gpu.timed();
    let frame = Frame::new(SIZE, None, prepared.aovs())?;
    let control = RenderControl {
        cancel: &never,
        on_progress: &|_| {},
        on_pass: &|_, _| {},
    };
    let elsewhere = Elsewhere::new(&on_gpu);
    let rendered = render_with(&prepared, &frame, &control, Some(&elsewhere));
    if let Some(why) = elsewhere.fault() {
        return Err(why.into());
    }
    let rays = f64::from(SIZE[0] * SIZE[1]) * f64::from(samples);
    say!("{:<9} {:>9} {:>9}", "stage", "s", "Mrays/s");
    for (stage, seconds) in ["generate", "trace", "shade", "film"]
        .iter()
        .zip(on_gpu.seconds())
    {
        say!("{stage:<9} {seconds:>9.3} {:>9.1}", rays / seconds * 1e-6);
    }
    let seconds = rendered.seconds;
    say!("{:<9} {seconds:>9.3} {:>9.1}", "all", rays / seconds * 1e-6);
    say!(
        "{:.1} M rays, {samples} samples a pixel of {SIZE:?}",
        rays * 1e-6
    );
    drop(on_gpu);
    Secondary::new(device, &prepared)?.run(different, peaks)
}
