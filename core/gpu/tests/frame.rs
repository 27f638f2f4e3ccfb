//! Images whose samples a device draws, traces, shades and films against the CPU's.
//!
//! Ids, depths and places are those of the CPU but where micropolygons meet a ray within rounding of each other, or two
//! samples of a pixel are as far from its centre: in few pixels. There a sample may also have another colour. Elsewhere
//! colours are off by roundings.

#[path = "../../tests/support/mod.rs"]
mod support;

mod device;
mod images;

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

use device::Check;
use glam::{DMat4, DVec3};
use hdtrapeze_core::aov::Aov;
use hdtrapeze_core::film::tile::PixelSums;
use hdtrapeze_core::render::{
    Elsewhere, Frame, Made, RayTracer, RenderControl, Stage, TileSamples, render_with,
};
use hdtrapeze_core::scene::{
    Backend, FilterKind, Interpolation, LensSample, PrimId, PrimvarDesc, PrimvarSample,
    PrimvarValues, Scene,
};
use hdtrapeze_core::trace::{Hit, Ray};
use hdtrapeze_gpu::{Device, FirstOnDevice, FrameOptions, GpuError, GpuFrame, Stages};
use images::*;
use libtest_mimic::Failed;

/// What the device does not shade is left to the CPU, and said.
fn others_are_shaded_here(stages: &Arc<Stages>) -> Result<(), Failed> {
    let mut huge = stage();
    shoot(&mut huge, |camera| {
        let sample = |f_stop: f64| LensSample {
            time: f_stop / 1.0e60 - 1.0,
            f_stop,
            ..camera.lens()
        };
        camera.lens_samples = vec![sample(1.0e60), sample(2.0e60)];
    });
    for (scene, first, why) in [
        (with_mixed(stage()), Stage::Generate, MIXED),
        (huge, Stage::Trace, "lens"),
    ] {
        let prepared = prepared(&scene);
        let frame = GpuFrame::new(Arc::clone(stages), &prepared)?;
        let told = frame.explain();
        if frame.stages() != (first..=Stage::Trace) || !told.contains(why) {
            return Err(told.into());
        }
        // Nothing is left of it where shading should come first there.
        match GpuFrame::with(from(FirstOnDevice::Shade), Arc::clone(stages), &prepared) {
            Err(error) if error.to_string().contains(why) => {}
            other => return Err(format!("{other:?}").into()),
        }
        let here = rendered(&prepared, None)?;
        let there = rendered(&prepared, Some(&frame))?;
        let bad = different(&there, &here, &Aov::Color, CLOSE)?;
        if bad.len() > 30 {
            return Err(format!("{} pixels differ: {told}", bad.len()).into());
        }
    }
    Ok(())
}

/// Colours have room on pages where they are shaded there, and take none where the CPU shades.
fn colours_take_room(stages: &Arc<Stages>) -> Result<(), Failed> {
    let mut painted = sheet("/sheet", &[0.0], Interpolation::Vertex);
    let sample = |(time, value): (f64, f32)| PrimvarSample {
        time,
        values: Arc::new(PrimvarValues::Float(vec![value; 3 * 42])),
        indices: Arc::default(),
    };
    let color = PrimvarDesc {
        // Twelve words a vertex, which has three of its place.
        samples: [(0.0, 0.1), (0.3, 0.7), (0.6, 0.2), (1.0, 0.9)]
            .into_iter()
            .map(sample)
            .collect(),
        ..PrimvarDesc::still(Interpolation::Vertex, 3, vec![], vec![])
    };
    let primvars = &mut painted.common.primvars;
    primvars.insert("displayColor".to_owned(), color);
    let there = scene(vec![painted]);
    let mut here = there.clone();
    here.prims
        .insert(PrimId(9), Arc::new(ball("/ball", 0.1, &[DVec3::ZERO])));
    let here = with_mixed(here);
    let pages = |scene: &Scene, first| -> Result<usize, Failed> {
        let options = FrameOptions {
            first,
            most: 1 << 12,
        };
        let prepared = prepared_on(scene, Backend::Gpu);
        let frame = GpuFrame::with(options, Arc::clone(stages), &prepared)?;
        Ok(frame.page_count())
    };
    let shaded = pages(&there, FirstOnDevice::Generate)?;
    let others = [
        pages(&there, FirstOnDevice::Film)?,
        pages(&here, FirstOnDevice::Generate)?,
    ];
    match others.iter().all(|&count| count < shaded) {
        true => Ok(()),
        false => Err(format!("{shaded} pages, and {others:?}").into()),
    }
}

/// A scene whose mesh has other points, as a host edits it.
fn bent(growth: f32) -> Scene {
    let mut scene = scene(vec![
        sheet("/sheet", &[growth], Interpolation::Vertex),
        ball(
            "/ball",
            0.8,
            &[DVec3::new(-1.5 + f64::from(growth), 0.2, 0.0)],
        ),
    ]);
    set(&mut scene, |settings| settings.keep_finer = true);
    scene
}

/// Where points have moved and grids are as they were, trees are refitted; else they are made anew. Images are the CPU's.
fn edits(stages: &Arc<Stages>, pages: bool) -> Result<(), Failed> {
    let mut turned = bent(0.02);
    shoot(&mut turned, |camera| {
        camera.transform = at(&[DMat4::from_translation(DVec3::new(0.3, 0.2, 6.0))]);
    });
    let mut diced_anew = bent(0.02);
    set(&mut diced_anew, |settings| settings.shading_rate *= 0.4);
    let first = prepared_on(&bent(0.0), Backend::Gpu);
    let mut frame = match pages {
        true => paged(stages, &first, FirstOnDevice::Bound)?,
        false => GpuFrame::new(Arc::clone(stages), &first)?,
    };
    if (frame.page_count() > 1) != pages {
        return Err(format!("{} pages", frame.page_count()).into());
    }
    let all = [
        (bent(0.01), true),
        (bent(0.02), true),
        // Its view is another: so is its dicing.
        (turned, false),
        (diced_anew, false),
        (everything(), false),
    ];
    // Grids of the others are larger than these pages.
    let count = if pages { 3 } else { all.len() };
    for (scene, refitted) in all.into_iter().take(count) {
        let prepared = prepared_on(&scene, Backend::Gpu);
        frame = frame.after(&prepared)?;
        if frame.is_refitted() != refitted {
            return Err(format!("refitted: {}, not {refitted}", frame.is_refitted()).into());
        }
        as_on_the_cpu(&scene, &prepared, &frame, FirstOnDevice::Bound)?;
        if prepared.world().stats().trees > 0 {
            return Err("the CPU has made trees".into());
        }
    }
    Ok(())
}

/// Where a device has failed, what comes after a frame is not taken there, and it is said why.
fn edits_on_a_failed_device() -> Result<(), Failed> {
    let device = Arc::new(Device::open()?);
    let stages = Arc::new(Stages::new(&device));
    let [before, after] = [0.0, 0.01].map(|growth| prepared_on(&bent(growth), Backend::Gpu));
    let frame = GpuFrame::new(Arc::clone(&stages), &before)?;
    // No device has buffers for both.
    let both = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::STORAGE;
    let _ = device.buffer("nothing", 64, both);
    match frame.after(&after) {
        Err(error @ GpuError::Failed { .. }) if error.to_string().contains(" failed: ") => Ok(()),
        other => Err(format!("{other:?}").into()),
    }
}

/// What falls back to the CPU in the middle, or is never on a device, has trees there by then.
fn the_cpu_goes_on() -> Result<(), Failed> {
    struct Broken;
    impl RayTracer for Broken {
        fn stages(&self) -> std::ops::RangeInclusive<Stage> {
            Stage::Trace..=Stage::Trace
        }
        fn trace_tiles(&self, _: &[TileSamples], _: &mut [Hit]) -> Result<(), String> {
            Err("broken".to_owned())
        }
        fn film(
            &self,
            _: &[TileSamples],
            _: &Made,
            _: &mut [PixelSums],
            _: &mut [f32],
        ) -> Result<(), String> {
            Err("broken".to_owned())
        }
        fn trace(&self, _: &[Ray], _: &mut [Hit]) -> Result<(), String> {
            Err("broken".to_owned())
        }
    }
    let here = prepared_on(&everything(), Backend::Cpu);
    let expected = rendered(&here, None)?;
    for broken in [None, Some(Elsewhere::new(&Broken))] {
        let prepared = prepared_on(&everything(), Backend::Gpu);
        let stats = prepared.world().stats();
        if (stats.trees, stats.top_nodes) != (0, 0) {
            return Err("trees are made ahead".into());
        }
        let before = prepared.statistics();
        let settings = prepared.settings();
        let frame = Frame::new(settings.resolution, settings.data_window, prepared.aovs())?;
        let control = RenderControl {
            cancel: &AtomicBool::new(false),
            on_progress: &|_| {},
            on_pass: &|_, _| {},
        };
        render_with(&prepared, &frame, &control, broken.as_ref());
        let stats = prepared.world().stats();
        if stats.trees < stats.objects || stats.top_nodes == 0 {
            return Err("trees are missing".into());
        }
        let (now, known) = (prepared.statistics(), here.statistics());
        if before.bvh_nodes != 0
            || now.bvh_bytes <= before.bvh_bytes
            || now.bvh_nodes != known.bvh_nodes
            || now.geometry_bytes != known.geometry_bytes
        {
            return Err(format!("{now:?}, not {known:?}; {before:?} before").into());
        }
        for aov in prepared.aovs() {
            if !different(&frame, &expected, aov, 0.0)?.is_empty() {
                return Err(format!("{} differs", aov.name()).into());
            }
        }
    }
    Ok(())
}

fn scenes() -> Vec<(String, Scene)> {
    let mut all = vec![
        ("still".to_owned(), stage()),
        ("everything".to_owned(), everything()),
        ("instances".to_owned(), instanced(false)),
        ("moving_instances".to_owned(), instanced(true)),
    ];
    for color in [
        Interpolation::Constant,
        Interpolation::Uniform,
        Interpolation::FaceVarying,
    ] {
        let sheet = sheet("/sheet", &[0.0], color);
        all.push((format!("{color:?}").to_lowercase(), scene(vec![sheet])));
    }
    let moving = sheet("/sheet", &[0.0, 0.8], Interpolation::Vertex);
    all.push(("moving_mesh".to_owned(), scene(vec![moving])));
    let mut leaning = sheet("/sheet", &[0.0, 0.8], Interpolation::Vertex);
    let normals = leaning_normals(42);
    let primvars = &mut leaning.common.primvars;
    primvars.insert("normals".to_owned(), normals);
    all.push(("moving_normals".to_owned(), scene(vec![leaning])));
    let mut matte = stage();
    let prim = matte.prims.get_mut(&PrimId(2)).expect("a ball");
    Arc::make_mut(prim).common.matte = true;
    all.push(("matte".to_owned(), matte));
    let mut camera = stage();
    shoot(&mut camera, |camera| {
        let to = DMat4::from_translation(DVec3::new(0.9, 0.1, 5.5)) * DMat4::from_rotation_z(0.3);
        camera.transform = at(&[DMat4::from_translation(DVec3::Z * 6.0), to]);
    });
    all.push(("moving_camera".to_owned(), camera));
    let mut lens = stage();
    shoot(&mut lens, |camera| camera.f_stop = 0.5);
    all.push(("defocus".to_owned(), lens));
    all.push(("changing_lens".to_owned(), changing_lens()));
    for filter in [
        FilterKind::Box,
        FilterKind::Gaussian,
        FilterKind::Mitchell,
        FilterKind::BlackmanHarris,
    ] {
        let mut scene = stage();
        set(&mut scene, |s| {
            (s.filter, s.filter_width) = (filter, 3.0);
            s.samples = 16;
        });
        all.push((format!("{filter:?}").to_lowercase(), scene));
    }
    let mut window = stage();
    set(&mut window, |s| s.data_window = Some([-5, 3, 60, 50]));
    all.push(("data_window".to_owned(), window));
    all
}

fn main() {
    let mut trials: Vec<(String, Check)> = Vec::new();
    // Pipelines are compiled once.
    static STAGES: OnceLock<Arc<Stages>> = OnceLock::new();
    let on =
        |device: &Arc<Device>| Arc::clone(STAGES.get_or_init(|| Arc::new(Stages::new(device))));
    for (name, scene) in scenes() {
        let paged = scene.clone();
        let firsts: &[FirstOnDevice] = match name.as_str() {
            // Its colours are of faces, and of instances.
            "instances" => &FirstOnDevice::ALL,
            _ => &[FirstOnDevice::Bound, FirstOnDevice::Generate],
        };
        let run = move |device: &Arc<Device>| on_pages(&on(device), &paged, firsts);
        trials.push((format!("pages_of_{name}"), Box::new(run)));
        let walk = ["still", "everything", "moving_instances"].contains(&name.as_str());
        let run = move |device: &Arc<Device>| match walk {
            true => walked(&on(device), &scene),
            false => agrees(&on(device), &scene, FirstOnDevice::Bound),
        };
        trials.push((format!("scene_{name}"), Box::new(run)));
    }
    for (name, pages) in [("edits", false), ("edits_on_pages", true)] {
        let edited = move |device: &Arc<Device>| edits(&on(device), pages);
        trials.push((name.to_owned(), Box::new(edited)));
    }
    let failed = |_: &Arc<Device>| edits_on_a_failed_device();
    trials.push(("edits_on_a_failed_device".to_owned(), Box::new(failed)));
    let fallen_back = move |_: &Arc<Device>| the_cpu_goes_on();
    trials.push(("the_cpu_goes_on".to_owned(), Box::new(fallen_back)));
    let room = move |device: &Arc<Device>| colours_take_room(&on(device));
    trials.push(("colours_take_room".to_owned(), Box::new(room)));
    let others = move |device: &Arc<Device>| others_are_shaded_here(&on(device));
    trials.push(("what_the_cpu_shades".to_owned(), Box::new(others)));
    device::run(trials);
}
