//! Scenes that devices render, and what their images are held to.
#![allow(dead_code)]

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

use glam::{DMat4, DVec3, Quat, Vec3};
use hdtrapeze_core::aov::{Aov, AovData};
use hdtrapeze_core::render::{
    Elsewhere, Frame, Prepared, RayTracer, RenderControl, Stage, prepare, render, render_with,
};
use hdtrapeze_core::scene::{
    Backend, CameraDesc, Geometry, ImplicitDesc, ImplicitKind, InstanceArrays, InstancerDesc,
    Interpolation, LensSample, MeshDesc, PointsSamples, PrimCommon, PrimDesc, PrimId, PrimvarDesc,
    PrimvarSample, PrimvarValues, RenderSettings, Samples, Scene, TransformSamples,
};
use hdtrapeze_core::surface::{MeshTopology, Scheme};
use hdtrapeze_gpu::{Device, FirstOnDevice, FrameOptions, GpuFrame, Stages};
use libtest_mimic::Failed;

use crate::device::Check;
use crate::support::NoSubdivision;

/// The camera.
pub const CAMERA: PrimId = PrimId(1000);
/// The instancer, where there is one.
pub const INSTANCER: PrimId = PrimId(2000);

/// Share of pixels that may differ more than by rounding.
pub const DIFFERENT: f64 = 0.002;
/// Colours and places are off by no more elsewhere, in parts of themselves or of 1.
pub const CLOSE: f32 = 1.0e-5;
/// Pixels that motion is off by: where a thing is in the image is off by some 16 roundings of the image's width, 70.
pub const MOVED: f32 = 16.0 * 70.0 / 16_777_216.0;
/// The same where the CPU has shaded: sums of as many samples are rounded.
pub const SUMMED: f32 = 2.0e-6;

/// Matrices that are spread over the shutter.
pub fn at(matrices: &[DMat4]) -> Vec<TransformSamples> {
    let last = (matrices.len() - 1).max(1) as f64;
    vec![TransformSamples {
        times: (0..matrices.len()).map(|i| i as f64 / last).collect(),
        matrices: matrices.to_vec(),
        ..TransformSamples::default()
    }]
}

/// So many colours that stay.
pub fn still(interpolation: Interpolation, count: usize) -> PrimvarDesc {
    let color = |i: usize| (i * 7 % 11) as f32 / 11.0 + 0.05;
    let values = (0..3 * count).map(color).collect();
    PrimvarDesc::still(interpolation, 3, values, vec![])
}

/// A rippled sheet of 6 by 5 polygons, with a key of its points for each growth.
pub fn sheet(path: &str, growths: &[f32], color: Interpolation) -> PrimDesc {
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

/// A squashed ball that goes from place to place.
pub fn ball(path: &str, radius: f64, places: &[DVec3]) -> PrimDesc {
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
pub fn changing() -> PrimvarDesc {
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
pub fn leaning_normals(count: usize) -> PrimvarDesc {
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

/// These prims before a camera.
pub fn scene(prims: Vec<PrimDesc>) -> Scene {
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

/// Changes the settings.
pub fn set(scene: &mut Scene, change: impl FnOnce(&mut RenderSettings)) {
    change(Arc::make_mut(&mut scene.settings));
}

/// Changes the camera.
pub fn shoot(scene: &mut Scene, change: impl FnOnce(&mut CameraDesc)) {
    let camera = scene.cameras.get_mut(&CAMERA).expect("it has a camera");
    change(Arc::make_mut(camera));
}

/// A prim with these opacities.
pub fn veiled(mut prim: PrimDesc, opacity: PrimvarDesc) -> PrimDesc {
    let primvars = &mut prim.common.primvars;
    primvars.insert("displayOpacity".to_owned(), opacity);
    prim
}

/// One opacity all over.
pub fn flat(opacity: f32) -> PrimvarDesc {
    PrimvarDesc::still(Interpolation::Constant, 1, vec![opacity], vec![])
}

/// What stands still.
pub fn stage() -> Scene {
    scene(vec![
        sheet("/sheet", &[0.0], Interpolation::Vertex),
        ball("/ball", 1.1, &[DVec3::new(-1.5, 0.2, 0.0)]),
        ball("/other", 0.7, &[DVec3::new(1.2, -0.5, 1.0)]),
    ])
}

/// Everything moves, out of focus, and a matte ball is in front.
pub fn everything() -> Scene {
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

/// Focus, focal length, f-number, film back and exposure change while the shutter is open.
pub fn changing_lens() -> Scene {
    let mut scene = stage();
    shoot(&mut scene, |camera| {
        let sample = |time: f64| LensSample {
            time,
            focal_length: 2.5 + time,
            f_stop: 0.6 + 0.2 * time,
            focus_distance: 5.0 + 3.0 * time,
            horizontal_aperture_offset: 0.1 * time,
            exposure_scale: 1.0 + time,
            ..camera.lens()
        };
        camera.lens_samples = vec![sample(0.0), sample(0.4), sample(1.0)];
    });
    scene
}

/// Balls by an instancer, before a sheet.
pub fn instanced(moving: bool) -> Scene {
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

/// The AOVs that show means of what is seen first.
pub const MEANS: [Aov; 3] = [Aov::Normal, Aov::Neye, Aov::MotionVectors];

/// True for AOVs that are sums over samples.
fn is_sum(aov: &Aov) -> bool {
    match aov {
        Aov::Primvar(primvar) => !primvar.is_integer,
        aov => *aov == Aov::Color || MEANS.contains(aov),
    }
}

/// The same with these AOVs beside the others.
pub fn with_means(mut scene: Scene) -> Scene {
    set(&mut scene, |settings| {
        let names = MEANS.iter().map(|aov| aov.name().to_owned());
        settings.aovs.extend(names);
    });
    scene
}

/// An AOV that [`with_mixed`] asks for.
pub const MIXED: &str = "primvars:mixed";

/// The same with an AOV that the CPU must shade for: a primvar that is of whole numbers on one prim, and of floats on another.
pub fn with_mixed(mut scene: Scene) -> Scene {
    set(&mut scene, |settings| settings.aovs.push(MIXED.to_owned()));
    let values = [PrimvarValues::Float(vec![0.5]), PrimvarValues::Int(vec![3])];
    for (prim, values) in scene.prims.values_mut().zip(values) {
        let sample = PrimvarSample {
            time: 0.0,
            values: Arc::new(values),
            indices: Arc::default(),
        };
        let mixed = PrimvarDesc {
            samples: vec![sample],
            ..PrimvarDesc::still(Interpolation::Constant, 1, vec![], vec![])
        };
        let primvars = &mut Arc::make_mut(prim).common.primvars;
        primvars.insert("mixed".to_owned(), mixed);
    }
    scene
}

/// Committed.
pub fn prepared(scene: &Scene) -> Prepared {
    let cancel = AtomicBool::new(false);
    let preparation = prepare(scene, &NoSubdivision, None, &cancel).expect("the scene is sound");
    let mut warnings = preparation.warnings.iter();
    assert!(warnings.all(|warning| warning.text.contains(MIXED)));
    preparation.prepared
}

/// Renders, with the device's stages where there are some.
pub fn rendered(prepared: &Prepared, stages: Option<&GpuFrame>) -> Result<Frame, Failed> {
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
pub fn different(there: &Frame, here: &Frame, aov: &Aov, close: f32) -> Result<Vec<usize>, Failed> {
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
pub fn prepared_on(scene: &Scene, backend: Backend) -> Prepared {
    let mut scene = scene.clone();
    set(&mut scene, |settings| settings.backend = backend);
    prepared(&scene)
}

/// Stages before this one are the CPU's.
pub fn from(first: FirstOnDevice) -> FrameOptions {
    FrameOptions {
        first,
        ..FrameOptions::default()
    }
}

/// Held against the CPU's image, with stages before `first` on the CPU.
pub fn agrees(stages: &Arc<Stages>, scene: &Scene, first: FirstOnDevice) -> Result<(), Failed> {
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
pub fn walked(stages: &Arc<Stages>, scene: &Scene) -> Result<(), Failed> {
    for first in FirstOnDevice::ALL {
        agrees(stages, scene, first).map_err(|e| format!("from {} on: {e:?}", first.name()))?;
        if FirstOnDevice::named(first.name()) != Some(first) {
            return Err(format!("{first:?} has another's name").into());
        }
    }
    Ok(())
}

/// The image of `frame`, which is of `prepared`, held against the CPU's of `scene`.
pub fn as_on_the_cpu(
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
            (Stage::Film, aov) if is_sum(aov) => (0, SUMMED),
            (Stage::Shade, Aov::MotionVectors) => (0, MOVED),
            (Stage::Shade, aov) if is_sum(aov) => (0, CLOSE),
            (Stage::Film | Stage::Shade, _) => (0, 0.0),
            (_, Aov::MotionVectors) => (few, MOVED),
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

/// A scene on the smallest pages, of some, that hold any of its grids.
pub fn paged(
    stages: &Arc<Stages>,
    prepared: &Prepared,
    first: FirstOnDevice,
) -> Result<GpuFrame, Failed> {
    let frame = |most| {
        let options = FrameOptions { first, most };
        GpuFrame::with(options, Arc::clone(stages), prepared)
    };
    let sizes = (8..20).flat_map(|i| [2 << i, 3 << i]);
    let found = sizes.map(frame).find(|frame| frame.is_ok());
    Ok(found.ok_or("no page is large enough")??)
}

/// Scenes on several pages, some objects of which are cut, are shaded and filmed there as well.
pub fn on_pages(
    stages: &Arc<Stages>,
    scene: &Scene,
    firsts: &[FirstOnDevice],
) -> Result<(), Failed> {
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

/// Stages on a device: pipelines are compiled once.
pub fn stages_once(device: &Arc<Device>) -> Arc<Stages> {
    static STAGES: OnceLock<Arc<Stages>> = OnceLock::new();
    Arc::clone(STAGES.get_or_init(|| Arc::new(Stages::new(device))))
}

/// Trials that scenes with normals and motion agree with the CPU's; those of these names from each stage on, and on pages too.
pub fn agreeing(
    scenes: Vec<(&'static str, Scene)>,
    walked_through: &[&str],
) -> Vec<(String, Check)> {
    let mut trials: Vec<(String, Check)> = Vec::new();
    for (name, scene) in scenes {
        let scene = with_means(scene);
        let walk = walked_through.contains(&name);
        if walk {
            let paged = scene.clone();
            let firsts = &[FirstOnDevice::Bound, FirstOnDevice::Generate];
            let run = move |device: &Arc<Device>| on_pages(&stages_once(device), &paged, firsts);
            trials.push((format!("pages_of_{name}"), Box::new(run)));
        }
        let run = move |device: &Arc<Device>| match walk {
            true => walked(&stages_once(device), &scene),
            false => agrees(&stages_once(device), &scene, FirstOnDevice::Bound),
        };
        trials.push((format!("scene_{name}"), Box::new(run)));
    }
    trials
}
