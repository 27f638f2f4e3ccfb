//! Images whose samples a device draws, traces, shades and films against the CPU's.
//!
//! Ids, depths and places are those of the CPU but where micropolygons meet a ray within rounding of each other, or two
//! samples of a pixel are as far from its centre: in few pixels. There a sample may also have another colour. Elsewhere
//! colours are off by roundings.

#[path = "../../tests/support/mod.rs"]
mod support;

mod device;

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

use device::Check;
use glam::{DMat4, DVec3, Quat, Vec3};
use hdtrapeze_core::aov::{Aov, AovData};
use hdtrapeze_core::film::tile::PixelSums;
use hdtrapeze_core::render::{
    Elsewhere, Frame, Made, Prepared, RayTracer, RenderControl, Stage, TileSamples, prepare,
    render, render_with,
};
use hdtrapeze_core::scene::{
    Backend, CameraDesc, FilterKind, Geometry, ImplicitDesc, ImplicitKind, InstanceArrays,
    InstancerDesc, Interpolation, MeshDesc, PointsSamples, PrimCommon, PrimDesc, PrimId,
    PrimvarDesc, PrimvarSample, PrimvarValues, RenderSettings, Samples, Scene, TransformSamples,
};
use hdtrapeze_core::surface::{MeshTopology, Scheme};
use hdtrapeze_core::trace::{Hit, Ray};
use hdtrapeze_gpu::{Device, FirstOnDevice, FrameOptions, GpuFrame, Stages};
use libtest_mimic::Failed;
use support::NoSubdivision;

const CAMERA: PrimId = PrimId(1000);
const INSTANCER: PrimId = PrimId(2000);

/// Share of pixels that may differ more than by rounding.
const DIFFERENT: f64 = 0.002;
/// Colours and places are off by no more elsewhere, in parts of themselves or of 1.
const CLOSE: f32 = 1.0e-5;
/// The same where the CPU has shaded: sums of as many samples are rounded.
const SUMMED: f32 = 2.0e-6;

fn at(matrices: &[DMat4]) -> Vec<TransformSamples> {
    let last = (matrices.len() - 1).max(1) as f64;
    vec![TransformSamples {
        times: (0..matrices.len()).map(|i| i as f64 / last).collect(),
        matrices: matrices.to_vec(),
        ..TransformSamples::default()
    }]
}

fn still(interpolation: Interpolation, count: usize) -> PrimvarDesc {
    let color = |i: usize| (i * 7 % 11) as f32 / 11.0 + 0.05;
    let values = (0..3 * count).map(color).collect();
    PrimvarDesc::still(interpolation, 3, values, vec![])
}

/// A rippled sheet of 6 by 5 polygons, with a key of its points for each growth.
fn sheet(path: &str, growths: &[f32], color: Interpolation) -> PrimDesc {
    let (nu, nv) = (6u32, 5u32);
    let corner = |i: u32, j: u32| j * (nu + 1) + i;
    let quads = (0..nv).flat_map(|j| (0..nu).map(move |i| (i, j)));
    let faces = quads.flat_map(|(i, j)| {
        [
            corner(i, j),
            corner(i + 1, j),
            corner(i + 1, j + 1),
            corner(i, j + 1),
        ]
    });
    let vertex = |k: u32, growth: f32| {
        let [x, y] = [
            (k % (nu + 1)) as f32 / nu as f32 - 0.5,
            (k / (nu + 1)) as f32 / nv as f32 - 0.5,
        ];
        let z = 0.4 * (5.0 * x + growth).sin() * (4.0 * y).cos();
        Vec3::new(7.0 * x + growth, 6.0 * y, z)
    };
    let points = |&growth: &f32| {
        let points = 0..(nu + 1) * (nv + 1);
        Arc::new(points.map(|k| vertex(k, growth)).collect())
    };
    let last = (growths.len() - 1).max(1) as f64;
    let topology = MeshTopology {
        scheme: Scheme::None,
        face_vertex_counts: vec![4; (nu * nv) as usize],
        face_vertex_indices: faces.collect(),
        ..MeshTopology::default()
    };
    let geometry = Geometry::Mesh(MeshDesc {
        topology: Arc::new(topology),
        points: PointsSamples {
            times: (0..growths.len()).map(|i| i as f64 / last).collect(),
            points: growths.iter().map(points).collect(),
            ..PointsSamples::default()
        },
        ..MeshDesc::default()
    });
    let count = match color {
        Interpolation::Constant => 1,
        Interpolation::Uniform => nu * nv,
        Interpolation::FaceVarying => 4 * nu * nv,
        Interpolation::Varying | Interpolation::Vertex => (nu + 1) * (nv + 1),
    };
    let mut common = PrimCommon::new(path);
    let color = still(color, count as usize);
    common.primvars.insert("displayColor".to_owned(), color);
    common.transform = at(&[DMat4::from_translation(DVec3::NEG_Z * 3.0)]);
    PrimDesc { common, geometry }
}

fn ball(path: &str, radius: f64, places: &[DVec3]) -> PrimDesc {
    let geometry = Geometry::Implicit(ImplicitDesc {
        kind: ImplicitKind::Sphere,
        times: vec![0.0],
        sizes: vec![[radius, 0.0, 0.0]],
        ..ImplicitDesc::default()
    });
    let mut common = PrimCommon::new(path);
    let squashed = DMat4::from_scale(DVec3::new(1.0, 0.7, 1.2));
    let matrices: Vec<DMat4> = places
        .iter()
        .map(|&p| DMat4::from_translation(p) * squashed)
        .collect();
    common.transform = at(&matrices);
    PrimDesc { common, geometry }
}

/// A colour that changes while the shutter is open.
fn changing() -> PrimvarDesc {
    let sample = |(time, value): (f64, [f32; 3])| PrimvarSample {
        time,
        values: Arc::new(PrimvarValues::Float(value.to_vec())),
        indices: Arc::default(),
    };
    let samples = [
        (0.0, [0.9, 0.1, 0.2]),
        (0.4, [0.1, 0.8, 0.3]),
        (1.0, [0.2, 0.2, 1.0]),
    ];
    PrimvarDesc {
        samples: samples.into_iter().map(sample).collect(),
        ..PrimvarDesc::still(Interpolation::Constant, 3, vec![], vec![])
    }
}

/// Normals of so many points that lean from one side to the other.
fn leaning_normals(count: usize) -> PrimvarDesc {
    let sample = |(time, x): (f64, f32)| PrimvarSample {
        time,
        values: Arc::new(PrimvarValues::Float([x, 0.2, 1.0].repeat(count))),
        indices: Arc::default(),
    };
    PrimvarDesc {
        samples: [(0.0, -0.5), (1.0, 3.0)].into_iter().map(sample).collect(),
        ..PrimvarDesc::still(Interpolation::Vertex, 3, vec![], vec![])
    }
}

fn scene(prims: Vec<PrimDesc>) -> Scene {
    let mut scene = Scene::default();
    for (i, mut prim) in prims.into_iter().enumerate() {
        prim.common.pick_id = i as i32 + 1;
        scene.prims.insert(PrimId(i as u64 + 1), Arc::new(prim));
    }
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        transform: at(&[DMat4::from_translation(DVec3::new(0.4, 0.3, 6.0))]),
        focal_length: 2.5,
        focus_distance: 7.0,
        clipping: [0.1, 1000.0],
        shutter: [0.0, 1.0],
        ..CameraDesc::default()
    };
    scene.cameras.insert(CAMERA, Arc::new(camera));
    scene.active_camera = Some(CAMERA);
    let aovs = [
        "color",
        "depth",
        "cameraDepth",
        "P",
        "primId",
        "instanceId",
        "elementId",
        "sampleCount",
    ];
    scene.settings = Arc::new(RenderSettings {
        resolution: [70, 44],
        samples: 9,
        occlusion_culling: false,
        aovs: aovs.map(str::to_owned).to_vec(),
        ..RenderSettings::default()
    });
    scene
}

fn set(scene: &mut Scene, change: impl FnOnce(&mut RenderSettings)) {
    change(Arc::make_mut(&mut scene.settings));
}

fn shoot(scene: &mut Scene, change: impl FnOnce(&mut CameraDesc)) {
    let camera = scene.cameras.get_mut(&CAMERA).expect("it has a camera");
    change(Arc::make_mut(camera));
}

fn stage() -> Scene {
    scene(vec![
        sheet("/sheet", &[0.0], Interpolation::Vertex),
        ball("/ball", 1.1, &[DVec3::new(-1.5, 0.2, 0.0)]),
        ball("/other", 0.7, &[DVec3::new(1.2, -0.5, 1.0)]),
    ])
}

/// Everything moves, out of focus, and a matte ball is in front.
fn everything() -> Scene {
    let mut matte = ball("/matte", 0.6, &[DVec3::new(0.5, 1.0, 1.5)]);
    matte.common.matte = true;
    let mut painted = ball(
        "/painted",
        0.8,
        &[DVec3::X * 1.5, DVec3::new(1.8, 0.4, 0.2)],
    );
    let color = changing();
    painted
        .common
        .primvars
        .insert("displayColor".to_owned(), color);
    let mut scene = scene(vec![
        sheet("/sheet", &[0.0, 0.5, 0.7], Interpolation::FaceVarying),
        painted,
        matte,
    ]);
    shoot(&mut scene, |camera| {
        camera.f_stop = 0.9;
        let turned =
            DMat4::from_translation(DVec3::new(0.2, 0.3, 6.2)) * DMat4::from_rotation_y(0.2);
        camera.transform = at(&[DMat4::from_translation(DVec3::Z * 6.0), turned]);
    });
    scene
}

fn instanced(moving: bool) -> Scene {
    let mut scene = scene(vec![sheet("/sheet", &[0.0], Interpolation::Uniform)]);
    let mut prototype = ball("/many/ball", 0.5, &[DVec3::ZERO]);
    prototype.common.instancer = Some((INSTANCER, 0));
    prototype.common.pick_id = 7;
    scene.prims.insert(PrimId(20), Arc::new(prototype));
    let count = 12;
    let place = |i: usize, by: f32| {
        let i = i as f32;
        Vec3::new(
            (i * 1.7).sin() * 2.5 + by,
            (i * 2.9).cos() * 1.8,
            (i * 0.8).sin(),
        )
    };
    let turn = |i: usize| Quat::from_rotation_x(i as f32);
    let size = |i: usize| Vec3::new(1.0, 0.5 + 0.1 * i as f32, 0.8);
    let places = |by: f32| Arc::new((0..count).map(|i| place(i, by)).collect());
    let arrays = InstanceArrays {
        instance_count: count,
        positions: match moving {
            false => Samples {
                times: vec![0.0],
                values: vec![places(0.0)],
            },
            true => Samples {
                times: vec![0.0, 1.0],
                values: vec![places(0.0), places(0.6)],
            },
        },
        orientations: Samples {
            times: vec![0.0],
            values: vec![Arc::new((0..count).map(turn).collect())],
        },
        scales: Samples {
            times: vec![0.0],
            values: vec![Arc::new((0..count).map(size).collect())],
        },
        ..InstanceArrays::default()
    };
    let mut instancer = InstancerDesc::new("/many");
    instancer.arrays = Arc::new(arrays);
    let color = still(Interpolation::Varying, count);
    instancer.primvars.insert("displayColor".to_owned(), color);
    scene.instancers.insert(INSTANCER, Arc::new(instancer));
    scene
}

fn prepared(scene: &Scene) -> Prepared {
    let cancel = AtomicBool::new(false);
    let preparation = prepare(scene, &NoSubdivision, None, &cancel).expect("the scene is sound");
    assert_eq!(preparation.warnings, []);
    preparation.prepared
}

/// Renders, with the device's stages where there are some.
fn rendered(prepared: &Prepared, stages: Option<&GpuFrame>) -> Result<Frame, Failed> {
    let settings = prepared.settings();
    let frame = Frame::new(settings.resolution, settings.data_window, prepared.aovs())?;
    let control = RenderControl {
        cancel: &AtomicBool::new(false),
        on_progress: &|fraction| assert!((0.0..=1.0).contains(&fraction)),
        on_pass: &|_, _| {},
    };
    let Some(stages) = stages else {
        render(prepared, &frame, &control);
        return Ok(frame);
    };
    let elsewhere = Elsewhere::new(stages);
    render_with(prepared, &frame, &control, Some(&elsewhere));
    match elsewhere.fault() {
        Some(why) => Err(why.into()),
        None => Ok(frame),
    }
}

/// Numbers of pixels that differ in an AOV by more than `close`, in parts of the CPU's number or of 1.
fn different(there: &Frame, here: &Frame, aov: &Aov, close: f32) -> Result<Vec<usize>, Failed> {
    let (Some(there), Some(here)) = (there.aov(aov), here.aov(aov)) else {
        return Err(format!("{} is not kept", aov.name()).into());
    };
    let n = here.components;
    let pixels = 0..(here.width * here.height) as usize;
    let differs = |i: &usize| match (&there.data, &here.data) {
        (AovData::I32(a), AovData::I32(b)) => a[i * n..][..n] != b[i * n..][..n],
        (AovData::F32(a), AovData::F32(b)) => {
            let pairs = a[i * n..][..n].iter().zip(&b[i * n..][..n]);
            let mut off = pairs.map(|(a, b)| (a - b).abs() / b.abs().max(1.0));
            // Also where it is NaN.
            !off.all(|off| off <= close)
        }
        _ => true,
    };
    Ok(pixels.filter(differs).collect())
}

/// The same for a backend.
fn prepared_on(scene: &Scene, backend: Backend) -> Prepared {
    let mut scene = scene.clone();
    set(&mut scene, |settings| settings.backend = backend);
    prepared(&scene)
}

/// Stages before this one are the CPU's.
fn from(first: FirstOnDevice) -> FrameOptions {
    FrameOptions {
        first,
        ..FrameOptions::default()
    }
}

/// Held against the CPU's image, with stages before `first` on the CPU.
fn agrees(stages: &Arc<Stages>, scene: &Scene, first: FirstOnDevice) -> Result<(), Failed> {
    let prepared = prepared_on(scene, Backend::Gpu);
    let frame = GpuFrame::with(from(first), Arc::clone(stages), &prepared)?;
    if frame.stages() != (first.of_samples()..=Stage::Film) {
        return Err(frame.explain().into());
    }
    as_on_the_cpu(scene, &prepared, &frame, first)?;
    let made = prepared.world().stats();
    let none = (made.trees, made.top_nodes) == (0, 0);
    let told = frame.explain();
    let there = first <= FirstOnDevice::Build;
    if none != there
        || told.contains("makes trees") != there
        || told.contains("from the stage") != (first != FirstOnDevice::Bound)
    {
        return Err(format!("{} trees by the CPU; {told}", made.trees).into());
    }
    Ok(())
}

/// Each stage in its turn is the first on the device.
fn walked(stages: &Arc<Stages>, scene: &Scene) -> Result<(), Failed> {
    for first in FirstOnDevice::ALL {
        agrees(stages, scene, first).map_err(|e| format!("from {} on: {e:?}", first.name()))?;
        if FirstOnDevice::named(first.name()) != Some(first) {
            return Err(format!("{first:?} has another's name").into());
        }
    }
    Ok(())
}

/// The image of `frame`, which is of `prepared`, held against the CPU's of `scene`.
fn as_on_the_cpu(
    scene: &Scene,
    prepared: &Prepared,
    frame: &GpuFrame,
    first: FirstOnDevice,
) -> Result<(), Failed> {
    let there = rendered(prepared, Some(frame))?;
    let here = rendered(&prepared_on(scene, Backend::Cpu), None)?;
    let [width, height] = prepared.settings().resolution;
    let few = (f64::from(width * height) * DIFFERENT) as usize;
    let mut covered = 0;
    if let Some(AovData::I32(ids)) = here.aov(Aov::PrimId).map(|image| image.data) {
        covered = ids.iter().filter(|&&id| id >= 0).count();
    }
    if covered < (width * height / 3) as usize {
        return Err(format!("only {covered} pixels see anything").into());
    }
    for aov in prepared.aovs() {
        // Where the CPU has traced, ids and places are its own.
        let (few, close) = match (first.of_samples(), aov) {
            (_, Aov::SampleCount) => (0, 0.0),
            (Stage::Film, Aov::Color) => (0, SUMMED),
            (Stage::Shade, Aov::Color) => (0, CLOSE),
            (Stage::Film | Stage::Shade, _) => (0, 0.0),
            _ => (few, CLOSE),
        };
        let bad = different(&there, &here, aov, close)?;
        if bad.len() > few {
            let what = format!(
                "{} of {} pixels of {}",
                bad.len(),
                width * height,
                aov.name()
            );
            return Err(format!("{what} differ with {first:?} first, from {:?}", bad[0]).into());
        }
    }
    Ok(())
}

/// What the device does not shade is left to the CPU, and said.
fn others_are_shaded_here(stages: &Arc<Stages>) -> Result<(), Failed> {
    let mut glass = stage();
    let prim = glass.prims.get_mut(&PrimId(2)).expect("a ball");
    let half = PrimvarDesc::still(Interpolation::Constant, 1, vec![0.5], vec![]);
    let primvars = &mut Arc::make_mut(prim).common.primvars;
    primvars.insert("displayOpacity".to_owned(), half);
    let mut normals = stage();
    set(&mut normals, |s| s.aovs.push("normal".to_owned()));
    let mut rack = stage();
    shoot(&mut rack, |camera| {
        let sample = |focal_length: f64| hdtrapeze_core::scene::LensSample {
            time: focal_length - 2.0,
            focal_length,
            ..camera.lens()
        };
        camera.lens_samples = vec![sample(2.0), sample(3.0)];
    });
    for (scene, first, why) in [
        (glass, Stage::Generate, "/ball is not opaque"),
        (normals, Stage::Generate, "the AOV normal"),
        (rack, Stage::Trace, "lens"),
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

/// A scene on the smallest pages, of some, that hold any of its grids.
fn paged(
    stages: &Arc<Stages>,
    prepared: &Prepared,
    first: FirstOnDevice,
) -> Result<GpuFrame, Failed> {
    let frame = |most| {
        let options = FrameOptions { first, most };
        GpuFrame::with(options, Arc::clone(stages), prepared)
    };
    let found = (9..20).map(|i| frame(1 << i)).find(|frame| frame.is_ok());
    Ok(found.ok_or("no page is large enough")??)
}

/// Scenes on several pages, some objects of which are cut, are shaded and filmed there as well.
fn on_pages(stages: &Arc<Stages>, scene: &Scene, firsts: &[FirstOnDevice]) -> Result<(), Failed> {
    for &first in firsts {
        let prepared = prepared_on(scene, Backend::Gpu);
        let frame = paged(stages, &prepared, first)?;
        let told = frame.explain();
        if frame.page_count() < 2
            || frame.stages() != (first.of_samples()..=Stage::Film)
            || !told.contains("pages")
        {
            return Err(told.into());
        }
        as_on_the_cpu(scene, &prepared, &frame, first)?;
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
    set(&mut here, |s| s.aovs.push("normal".to_owned()));
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
        fn film(&self, _: &[TileSamples], _: &Made, _: &mut [PixelSums]) -> Result<(), String> {
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
    let fallen_back = move |_: &Arc<Device>| the_cpu_goes_on();
    trials.push(("the_cpu_goes_on".to_owned(), Box::new(fallen_back)));
    let room = move |device: &Arc<Device>| colours_take_room(&on(device));
    trials.push(("colours_take_room".to_owned(), Box::new(room)));
    let others = move |device: &Arc<Device>| others_are_shaded_here(&on(device));
    trials.push(("what_the_cpu_shades".to_owned(), Box::new(others)));
    device::run(trials);
}
