//! Vertices that are on a device before the scene is complete: what comes of them is what comes of all at once, to the bit.

#[path = "../../tests/support/mod.rs"]
mod support;

mod device;
mod images;

use std::ops::RangeInclusive;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use device::Check;
use glam::{DMat4, DVec3};
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::render::{PrepareError, Prepared, Watcher, prepare_with};
use hdtrapeze_core::scene::{Backend, Scene};
use hdtrapeze_gpu::{
    BuildOptions, Device, EarlyLimits, EarlyVertices, FrameOptions, GpuFrame, GpuScene, Stages,
    TreeBuilder,
};
use images::*;
use libtest_mimic::Failed;
use support::NoSubdivision;

/// Every object goes by itself.
const ALONE: EarlyLimits = EarlyLimits {
    chunk: 1,
    most: u64::MAX,
};

/// Some go together, and some never.
const TOGETHER: EarlyLimits = EarlyLimits {
    chunk: 10_000,
    ..ALONE
};

/// Pipelines are compiled once.
fn stages(device: &Arc<Device>) -> &'static Arc<Stages> {
    static STAGES: OnceLock<Arc<Stages>> = OnceLock::new();
    STAGES.get_or_init(|| Arc::new(Stages::new(device)))
}

/// The same for a GPU.
fn on_gpu(mut scene: Scene) -> Scene {
    set(&mut scene, |settings| settings.backend = Backend::Gpu);
    scene
}

/// Commits a scene after another one, and tells of what is diced.
fn watched(
    scene: &Scene,
    before: Option<&Prepared>,
    watcher: &dyn Watcher,
) -> Result<Prepared, PrepareError> {
    let never = AtomicBool::new(false);
    let done = prepare_with(scene, &NoSubdivision, before, None, Some(watcher), &never)?;
    Ok(done.prepared)
}

/// Balls of many sizes, some of which move, and a sheet.
fn crowd() -> Scene {
    let ball = |i: usize| {
        let at = DVec3::new(i as f64 * 0.4 - 2.0, (i as f64).sin(), 0.0);
        let places = [at, at + DVec3::Y * 0.2];
        let places = &places[..1 + i % 2];
        ball(&format!("/ball{i:02}"), 0.05 + 0.07 * i as f64, places)
    };
    let mut prims: Vec<_> = (0..10).map(ball).collect();
    prims.push(sheet(
        "/last",
        &[0.0, 0.3],
        hdtrapeze_core::scene::Interpolation::Vertex,
    ));
    scene(prims)
}

/// Makes a scene with and without, and compares all bytes; gives how many of them were uploaded early, and how many of these
/// are in the scene.
fn same(
    builder: &TreeBuilder,
    scene: &Scene,
    limits: EarlyLimits,
    (most, pages): (u64, RangeInclusive<usize>),
) -> Result<[u64; 2], Failed> {
    let device = builder.device();
    let early = EarlyVertices::new(device, limits);
    let prepared = watched(scene, None, &early)?;
    let options = BuildOptions {
        most,
        ..BuildOptions::default()
    };
    let world = prepared.world();
    let expected = GpuScene::build(builder, world, &options)?;
    let found = GpuScene::build_early(builder, world, &options, &early)?;
    let bytes = early.bytes();
    if !pages.contains(&found.page_count()) || !found.has_own_trees() {
        return Err(format!("{} pages, not {pages:?}", found.page_count()).into());
    }
    if bytes.beside > bytes.uploaded {
        return Err(format!("{bytes:?}").into());
    }
    let [expected, found] = [expected, found].map(|scene| scene.contents(device));
    let (expected, found) = (expected?, found?);
    for (number, (a, b)) in expected.iter().zip(&found).enumerate() {
        let bits =
            |vertices: &[f32]| -> Vec<u32> { vertices.iter().map(|x| x.to_bits()).collect() };
        let same = [
            a.nodes == b.nodes,
            bits(&a.vertices) == bits(&b.vertices),
            a.words == b.words,
            a.objects == b.objects,
            (a.root, a.stack) == (b.root, b.stack),
        ];
        if same != [true; 5] {
            return Err(format!("page {number} differs: {same:?}").into());
        }
    }
    match expected.len() == found.len() {
        true => Ok([bytes.uploaded, bytes.used]),
        false => Err("not as many pages".into()),
    }
}

/// Scenes have the same bytes, whether objects came by themselves, together, in part or not at all.
fn same_bytes(device: &Arc<Device>) -> Result<(), Failed> {
    let builder = TreeBuilder::new(Arc::clone(device));
    let one = || (u64::MAX, 1..=1);
    for (name, scene) in [
        ("crowd", crowd()),
        ("everything", everything()),
        ("instanced", instanced(true)),
    ] {
        let scene = on_gpu(scene);
        let of = |limits| {
            same(&builder, &scene, limits, one())
                .map_err(|e| Failed::from(format!("{name}: {}", e.message().unwrap_or_default())))
        };
        let [all, used] = of(ALONE)?;
        let [half, half_used] = of(EarlyLimits {
            most: all / 2,
            ..ALONE
        })?;
        let none = of(EarlyLimits { most: 0, ..ALONE })?;
        let sound = all > 0 && used == all && 0 < half && half <= all / 2 && half_used == half;
        if !sound || none != [0, 0] {
            return Err(format!("{name}: {all}, {used}, {half}, {half_used}, {none:?}").into());
        }
        let [together, used] = of(TOGETHER)?;
        if used != together || together > all || (name == "crowd" && together == 0) {
            return Err(format!("{name}: {together} of {all}, {used} used").into());
        }
    }
    Ok(())
}

/// On several pages, objects that are whole are copied, and those that are cut are uploaded.
fn on_pages(device: &Arc<Device>) -> Result<(), Failed> {
    let builder = TreeBuilder::new(Arc::clone(device));
    let pages = (12_000, 2..=40);
    let [uploaded, used] = same(&builder, &on_gpu(crowd()), ALONE, pages)?;
    match 0 < used && used < uploaded {
        true => Ok(()),
        false => Err(format!("{used} of {uploaded}").into()),
    }
}

/// Edits that refit trees, and those that make them anew, show the same images.
fn edits(device: &Arc<Device>) -> Result<(), Failed> {
    let bent = |growth: f32, rate: f32| {
        let color = hdtrapeze_core::scene::Interpolation::Vertex;
        let mut scene = scene(vec![
            sheet("/sheet", &[growth], color),
            ball("/ball", 0.8, &[DVec3::new(-1.5, 0.2, 0.0)]),
        ]);
        set(&mut scene, |settings| {
            settings.keep_finer = true;
            settings.shading_rate *= rate;
        });
        on_gpu(scene)
    };
    let stages = stages(device);
    let first = bent(0.0, 1.0);
    let early = EarlyVertices::new(device, ALONE);
    let mut before = watched(&first, None, &early)?;
    let options = FrameOptions::default();
    let mut frame = GpuFrame::with_early(options, Arc::clone(stages), &before, Some(&early))?;
    for (scene, refitted) in [(bent(0.01, 1.0), true), (bent(0.02, 0.5), false)] {
        let early = EarlyVertices::new(device, ALONE);
        let prepared = watched(&scene, Some(&before), &early)?;
        frame = frame.after_early(&prepared, Some(&early))?;
        let bytes = early.bytes();
        if frame.is_refitted() != refitted || bytes.used == 0 || bytes.used != bytes.uploaded {
            return Err(format!("refitted: {}, {bytes:?}", frame.is_refitted()).into());
        }
        let expected = GpuFrame::new(Arc::clone(stages), &prepared)?;
        let there = rendered(&prepared, Some(&frame))?;
        let expected = rendered(&prepared, Some(&expected))?;
        for aov in prepared.aovs() {
            let bad = different(&there, &expected, aov, 0.0)?;
            if !bad.is_empty() {
                return Err(format!("{} differs in {} pixels", aov.name(), bad.len()).into());
            }
        }
        before = prepared;
    }
    Ok(())
}

/// Bytes that the device has once it is done with everything.
fn allocated(device: &Device) -> Result<u64, Failed> {
    device.finish(std::time::Duration::from_secs(60))?;
    device
        .allocated_bytes()
        .ok_or_else(|| "it does not tell its memory".into())
}

/// What one thread dices is uploaded before it dices the next.
fn beside_dicing(device: &Arc<Device>) -> Result<(), Failed> {
    let early = EarlyVertices::new(device, ALONE);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let scene = on_gpu(crowd());
    let prepared = pool.install(|| watched(&scene, None, &early))?;
    let bytes = early.bytes();
    let sets = prepared.world().parts();
    let last = sets
        .sets()
        .map(|set| size_of_val(set.object().mesh().floats()) as u64);
    match last.max() {
        Some(largest) if bytes.uploaded > largest && bytes.beside >= bytes.uploaded - largest => {
            Ok(())
        }
        largest => Err(format!("{bytes:?}, {largest:?}").into()),
    }
}

/// What was uploaded for a commit that is interrupted is freed; so is what is not used, and what was copied.
fn freed(_: &Arc<Device>) -> Result<(), Failed> {
    struct Interrupts<'a>(&'a EarlyVertices, AtomicBool);
    impl Watcher for Interrupts<'_> {
        fn diced(&self, object: &Arc<ObjectGeometry>) {
            self.0.diced(object);
            let enough = self.0.bytes().uploaded > 8_000;
            self.1.fetch_or(enough, Ordering::Relaxed);
        }
    }
    // Nobody else uses it.
    let device = &Arc::new(Device::open()?);
    let scene = on_gpu(crowd());
    let none = allocated(device)?;
    let early = EarlyVertices::new(device, ALONE);
    let interrupts = Interrupts(&early, AtomicBool::new(false));
    let watcher: &dyn Watcher = &interrupts;
    let given = prepare_with(
        &scene,
        &NoSubdivision,
        None,
        None,
        Some(watcher),
        &interrupts.1,
    );
    if given.err() != Some(PrepareError::Cancelled) || early.bytes().uploaded < 8_000 {
        return Err(format!("{:?}", early.bytes()).into());
    }
    if allocated(device)? < none + early.bytes().uploaded {
        return Err("what is uploaded is not counted".into());
    }
    drop(early);
    // Drivers' own things may be made once.
    if allocated(device)? > none + 1024 {
        return Err(format!("{} bytes, {none} before", allocated(device)?).into());
    }
    let builder = TreeBuilder::new(Arc::clone(device));
    let early = EarlyVertices::new(device, ALONE);
    let prepared = watched(&scene, None, &early)?;
    let options = BuildOptions::default();
    let alone = GpuScene::build(&builder, prepared.world(), &options)?;
    let both = allocated(device)?;
    drop(alone);
    let with_chunks = allocated(device)?;
    let scene = GpuScene::build_early(&builder, prepared.world(), &options, &early)?;
    let now = allocated(device)?;
    let uploaded = early.bytes().uploaded;
    if now + uploaded > both + 1024 || with_chunks < none + uploaded {
        return Err(format!("{now} bytes with {uploaded}, {both} before").into());
    }
    drop(scene);
    Ok(())
}

/// Where one object's vertices were, those of another one may be by now.
fn objects_that_are_gone(device: &Arc<Device>) -> Result<(), Failed> {
    let builder = TreeBuilder::new(Arc::clone(device));
    let early = EarlyVertices::new(device, ALONE);
    let of = |turn: f64| {
        let mut scene = on_gpu(crowd());
        shoot(&mut scene, |camera| {
            let from = DMat4::from_translation(DVec3::new(turn, 0.3, 6.0));
            camera.transform = at(&[from]);
        });
        scene
    };
    for i in 0..8 {
        drop(watched(&of(0.1 * f64::from(i)), None, &early)?);
    }
    let never = AtomicBool::new(false);
    let prepared = prepare_with(&of(1.0), &NoSubdivision, None, None, None, &never)?.prepared;
    let options = BuildOptions::default();
    let expected = GpuScene::build(&builder, prepared.world(), &options)?;
    let found = GpuScene::build_early(&builder, prepared.world(), &options, &early)?;
    let [expected, found] = [expected, found].map(|scene| scene.contents(device));
    let same = expected?[0].vertices == found?[0].vertices;
    match same && early.bytes().used == 0 && early.bytes().uploaded > 0 {
        true => Ok(()),
        false => Err(format!("{:?}", early.bytes()).into()),
    }
}

/// A device that has failed takes nothing, and dicing goes on.
fn a_failed_device() -> Result<(), Failed> {
    let device = Arc::new(Device::open()?);
    // No device has buffers for both.
    let both = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::STORAGE;
    let _ = device.buffer("nothing", 64, both);
    let early = EarlyVertices::new(&device, ALONE);
    let prepared = watched(&on_gpu(crowd()), None, &early)?;
    match early.bytes().uploaded == 0 && prepared.world().instance_count() == 11 {
        true => Ok(()),
        false => Err(format!("{:?}", early.bytes()).into()),
    }
}

fn main() {
    /// A name and a test.
    type Named = (&'static str, fn(&Arc<Device>) -> Result<(), Failed>);
    let trials: [Named; 7] = [
        ("same_bytes", same_bytes),
        ("on_pages", on_pages),
        ("edits", edits),
        ("beside_dicing", beside_dicing),
        ("freed", freed),
        ("objects_that_are_gone", objects_that_are_gone),
        ("a_failed_device", |_| a_failed_device()),
    ];
    let trials = trials.map(|(name, check)| (name.to_owned(), Box::new(check) as Check));
    device::run(trials.into());
}
