//! A frame from samples to pixels, all of it on the device: no ray crosses the bus, and only the film is kept.

mod secondary;
#[path = "../../../tests/support/mod.rs"]
mod support;

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use hdtrapeze_core::aov::{Aov, AovData};
use hdtrapeze_core::render::{
    Elsewhere, Frame, Prepared, RayTracer, RenderControl, Stage, Watcher, prepare_with, render_with,
};
use hdtrapeze_core::scene::{Backend, Interpolation, PrimvarDesc, Scene};
use hdtrapeze_gpu::{
    Device, EarlyBytes, EarlyVertices, FirstOnDevice, FrameOptions, GpuFrame, Stages, trial,
};
use secondary::Secondary;
use support::NoSubdivision;

use crate::bench_roofline::Peaks;
use crate::stages_told;

/// Pixels of the image.
const SIZE: [u32; 2] = [1280, 720];
/// Millions of micropolygons of a pixel's size.
const MILLIONS: f64 = 1.24;

/// The scene of a trial, with an opacity, in this image.
fn scene(samples: u32, opacity: f32, millions: f64) -> Scene {
    let mut scene = trial::scene(&trial::Size {
        resolution: SIZE,
        samples,
        shading_rate: (MILLIONS / millions).sqrt() as f32,
    });
    for prim in scene.prims.values_mut() {
        let opacity = PrimvarDesc::still(Interpolation::Constant, 1, vec![opacity], vec![]);
        let primvars = &mut Arc::make_mut(prim).common.primvars;
        primvars.insert("displayOpacity".to_owned(), opacity);
    }
    let settings = Arc::make_mut(&mut scene.settings);
    settings.occlusion_culling = false;
    // It makes all trees.
    settings.backend = Backend::Gpu;
    settings.aovs = ["color", "primId", "elementId"].map(str::to_owned).to_vec();
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
            "vertices, in chunks of 4 MiB and more: {uploaded:.0} MiB uploaded early, {beside:.0} before all was diced, {used:.0} used"
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
