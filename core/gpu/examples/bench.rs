//! What a GPU makes of camera rays, beside the CPU, on the same rays: one file, which needs nothing but a Vulkan driver.
//!
//! ```text
//! cargo build --release -p hdtrapeze-gpu --example bench
//! target/release/examples/bench [--size MILLIONS] [--image PIXELS] [--repeat TIMES] [--no-cpu] [--page MIB]
//! target/release/examples/bench --occlusion [--size MILLIONS] [--image PIXELS] [--from STAGE]
//! target/release/examples/bench --frame SAMPLES [--size MILLIONS] [--opacity SHARE] [--from STAGE] [--page MIB] [--late]
//! ```
//!
//! The paper's headline case is `--frame 529 --size 48.9`.
//!
//! Scenes of about so many million micropolygons (1): a rippling sheet, tumbling patches, fur; each still, sharp (out of focus
//! at one time), and blurred (moving and out of focus, the same rays); traced through trees of the CPU, through such whose
//! bounds are all upright, and through trees of the device. Rays of an image of `PIXELS` squared (768) with 4 samples
//! each, in batches that the device binds. Hits are compared with the CPU's before a time is printed. The device's time is by its own timestamps, of the fastest
//! of `TIMES` (5) launches of each batch, and for each stage that makes trees, of the second time it does.
//!
//! Bytes and operations are what the tests imply; their parts of the device's peaks are told with `--peak-gbps` and
//! `--peak-tflops`, which it does not tell itself.
//!
//! `--page`: no array of a page is larger, as on devices that bind no more at once (128 MiB is what each binds).
//!
//! `--occlusion`: 16 rays from each first hit, as they stand and in order. With `--from`, shares are held against those that are
//! found where stages before that one (site, scatter, order, sort, occlude or share) run on the CPU.
//!
//! `--frame`: an image of 1280 x 720 with so many samples a pixel, of 1.24 million micropolygons or `--size`, moving and defocused. Rays are
//! drawn, traced, shaded and filmed there, in batches that fit; only pixels come back. Each stage is timed on its own. A first
//! pass is held against the CPU's. With `--from`, stages before that one (bound, build, instances, generate, trace, shade or film)
//! run on the CPU. `--opacity` is everything's; where it is below 1, rays go on layer by layer. Vertices go there
//! while others are diced, with `--late` after all are. Then 16 occlusion rays leave the first hit of each pixel, in order and as they stand.

/// `println!` that ends the program quietly where nobody reads on.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write;
        if writeln!(std::io::stdout(), $($text)*).is_err() {
            std::process::exit($crate::NOBODY_READS);
        }
    }};
}

mod bench_frame;
mod bench_occlusion;
mod bench_roofline;
#[path = "../../tests/trace_scenes/mod.rs"]
mod trace_scenes;

use std::error::Error;
use std::fmt::Display;
use std::process::ExitCode;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Instant;

use bench_occlusion::Occlusions;
use bench_roofline::{HIT_BYTES, Peaks, RAY_BYTES, asked};
use glam::{DVec3, Vec3};
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World};
use hdtrapeze_gpu::{
    BuildOptions, Device, FirstOnDevice, FrameOptions, GpuScene, SecondaryStage, Tracer,
    TreeBuilder,
};
use hdtrapeze_shaders::layout::Ray as RayThere;
use hdtrapeze_shaders::stage::BuildStage;
use rayon::prelude::*;
use trace_scenes::lens::Lens;
use trace_scenes::{fur, instance, keys, patches, sheet, world_of};

/// Share of rays whose answers may differ from the CPU's: those that meet an edge within rounding.
const DIFFERENT: f64 = 0.002;

/// A name, keys of vertices, and the radius of the lens. Sharp rays are the blurred ones, all at one time.
const MOTIONS: [(&str, usize, f32); 3] =
    [("still", 1, 0.0), ("sharp", 1, LENS), ("blurred", 2, LENS)];
const LENS: f32 = 0.02;

/// What the program ends with where nobody reads what it prints: as if the signal SIGPIPE had ended it.
const NOBODY_READS: i32 = 141;
/// Rays that are traced together at most, where the device binds so many: 3 GiB.
const TOGETHER: usize = 1 << 26;

/// What `--help` prints.
const HELP: &str = "\
bench: camera rays on a GPU, beside the CPU, on the same rays

  --size M           millions of micropolygons (1; 1.24 of a frame)
  --image N          pixels of a side of the image (768)
  --repeat N         launches of a batch, the fastest of which counts (5)
  --no-cpu           without the CPU's time; a sample of hits is compared
  --page MIB         no array of a page is larger
  --occlusion        16 rays from each first hit instead
  --frame SAMPLES    a frame of 1280 x 720 instead, moving and defocused;
                     --frame 529 --size 48.9 is the paper's headline case
  --opacity SHARE    of all that is in the frame, from 0 to 1
  --late             vertices of a frame go there when all is diced
  --from STAGE       stages before it run on the CPU, of a frame or of
                     occlusion rays
  --peak-gbps X      of the device, and
  --peak-tflops X    what it has: parts of these are printed";

struct Options {
    /// Where they were asked for.
    millions: Option<f64>,
    image: usize,
    repeat: u32,
    cpu: bool,
    /// Of the device.
    peaks: Peaks,
    /// Occlusion rays in place of camera rays.
    occlusion: bool,
    /// Samples of a frame, where that is asked for.
    frame: Option<u32>,
    /// Of all that is in a frame.
    opacity: f32,
    /// Vertices of a frame go to the device before all is diced.
    early: bool,
    /// How frames and scenes are taken to the device.
    there: FrameOptions,
    /// The first stage of secondary rays there, where some are to run on the CPU.
    secondary: Option<SecondaryStage>,
}

/// The number that a flag is given, within these bounds.
fn number<T: FromStr + PartialOrd + Display>(
    flag: &str,
    value: &str,
    [least, most]: [T; 2],
) -> Result<T, String> {
    let number = value.parse::<T>().ok();
    let number = number.filter(|x| least <= *x && *x <= most);
    number.ok_or_else(|| format!("{flag} {value}: not a number from {least} to {most}"))
}

/// None where only help is wanted.
fn options() -> Result<Option<Options>, Box<dyn Error>> {
    let mut options = Options {
        millions: None,
        image: 768,
        repeat: 5,
        cpu: true,
        peaks: Peaks::default(),
        occlusion: false,
        frame: None,
        opacity: 1.0,
        early: true,
        there: FrameOptions::default(),
        secondary: None,
    };
    let (mut from, mut opacity) = (None, None);
    let mut arguments = std::env::args().skip(1);
    while let Some(flag) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{flag} needs a value"));
        match flag.as_str() {
            "--help" | "-h" => return Ok(None),
            "--size" => options.millions = Some(number(&flag, &value()?, [1e-3, 1e3])?),
            "--image" => options.image = number(&flag, &value()?, [8, 8192])?,
            "--repeat" => options.repeat = number(&flag, &value()?, [1, 10_000])?,
            "--frame" => options.frame = Some(number(&flag, &value()?, [1, 1 << 16])?),
            "--opacity" => opacity = Some(number(&flag, &value()?, [0.0, 1.0])?),
            "--from" => from = Some(value()?),
            "--page" => options.there.most = number(&flag, &value()?, [1u64, 1 << 20])? << 20,
            "--peak-gbps" => options.peaks.gbps = Some(number(&flag, &value()?, [1.0, 1e6])?),
            "--peak-tflops" => options.peaks.tflops = Some(number(&flag, &value()?, [1e-3, 1e6])?),
            "--occlusion" => options.occlusion = true,
            "--no-cpu" => options.cpu = false,
            "--late" => options.early = false,
            _ => return Err(format!("unknown flag {flag}; see --help").into()),
        }
    }
    if options.frame.is_none() && opacity.is_some() {
        return Err("--opacity is of a --frame".into());
    }
    if options.frame.is_none() && !options.early {
        return Err("--late is of a --frame".into());
    }
    if options.frame.is_none() && !options.occlusion && from.is_some() {
        return Err("--from is of a --frame or of --occlusion rays".into());
    }
    options.opacity = opacity.unwrap_or(1.0);
    match (from, options.occlusion) {
        (None, _) => {}
        (Some(name), true) => {
            let all = SecondaryStage::ALL.map(SecondaryStage::name);
            let named = SecondaryStage::named(&name);
            options.secondary = Some(named.ok_or_else(|| no_stage(&name, &all))?);
        }
        (Some(name), false) => {
            let all = FirstOnDevice::ALL.map(FirstOnDevice::name);
            let named = FirstOnDevice::named(&name);
            options.there.first = named.ok_or_else(|| no_stage(&name, &all))?;
        }
    }
    Ok(Some(options))
}

fn no_stage(name: &str, all: &[&str]) -> String {
    format!("{name} is no stage; there are {}", all.join(", "))
}

/// A scene of about `cells` micropolygons, by name.
fn scene(name: &str, cells: f64, key_count: usize) -> DicedMesh {
    let keys = keys(key_count);
    match name {
        "sheet" => sheet((cells / 256.0).sqrt().ceil() as usize, 16, &keys),
        "patches" => patches((cells / 256.0).ceil() as usize, 16, &keys, 3),
        _ => fur((cells / 16.0).ceil() as usize, &keys, 4),
    }
}

fn view(name: &str, radius: f32) -> Lens {
    match name {
        "fur" => Lens::new(Vec3::new(0.0, -2.2, 1.6), Vec3::ZERO, radius, 0.45),
        _ => Lens::new(Vec3::new(0.3, -1.6, 2.4), Vec3::ZERO, radius, 0.4),
    }
}

/// Rays of an image of a scene with so many keys.
fn rays(name: &str, radius: f32, key_count: usize, image: usize) -> Vec<Ray> {
    let mut rays = view(name, radius).rays(image);
    if key_count < 2 {
        rays.iter_mut().for_each(|ray| ray.time = 0.0);
    }
    rays
}

/// Answers that name another micropolygon.
fn differences(a: &[Hit], b: &[Hit]) -> usize {
    let id = |hit: &Hit| (hit.instance, hit.grid, hit.cell);
    a.iter().zip(b).filter(|(a, b)| id(a) != id(b)).count()
}

fn on_cpu(world: &World, rays: &[Ray]) -> (Vec<Hit>, f64) {
    let mut hits = vec![Hit::MISS; rays.len()];
    let start = Instant::now();
    let work = rays.par_chunks(4096).zip(hits.par_chunks_mut(4096));
    work.for_each(|(rays, hits)| world.trace_many(rays, hits, &mut TraceCounts::default()));
    (hits, start.elapsed().as_secs_f64())
}

fn run() -> Result<(), Box<dyn Error>> {
    let Some(options) = options()? else {
        say!("{HELP}");
        return Ok(());
    };
    let cells = options.millions.unwrap_or(1.0) * 1e6;
    let device = Arc::new(Device::open()?);
    let found = device.found();
    say!("device: {}, {}, {}", found.name, found.api, found.driver);
    if let Some(samples) = options.frame {
        return bench_frame::run(
            &device,
            (samples, options.opacity, options.millions),
            (options.there, options.early),
            DIFFERENT,
            options.peaks,
        );
    }
    if options.occlusion {
        return occlusion(&device, &options, cells);
    }
    say!(
        "{:<8} {:<7} {:<7} {:>8} {:>8} {:>5} {:>9} {:>9} {:>8} {:>8} {:>9} {:>9} {}",
        "scene",
        "motion",
        "trees",
        "Mcells",
        "MiB",
        "pages",
        "layout s",
        "Mrays/s",
        "nodes",
        "cells",
        "differ",
        "CPU",
        Peaks::head()
    );
    let bench = Bench {
        tracer: Tracer::new(Arc::clone(&device)),
        builder: TreeBuilder::new(device),
        options,
    };
    for name in ["sheet", "patches", "fur"] {
        let (mut sharp, mut blurred) = (Vec::new(), Vec::new());
        for (motion, key_count, radius) in MOTIONS {
            let mesh = scene(name, cells, key_count);
            let cells = mesh.cell_count();
            let upright = world_upright(mesh.clone());
            let start = Instant::now();
            let world = world_of(mesh);
            let built = start.elapsed().as_secs_f64();
            let rays = rays(name, radius, key_count, bench.options.image);
            // Without the CPU's time, a sample is compared all the same.
            let some = match bench.options.cpu {
                true => rays.len(),
                false => rays.len().min(65536),
            };
            let expected = on_cpu(&world, &rays[..some]);
            for (trees, world, first) in [
                ("CPU", &world, FirstOnDevice::Generate),
                ("upright", &upright, FirstOnDevice::Generate),
                ("device", &world, FirstOnDevice::Bound),
            ] {
                let row = format!(
                    "{name:<8} {motion:<7} {trees:<7} {:>8.2}",
                    cells as f64 * 1e-6
                );
                let cost = bench.trace(&row, world, first, &rays, &expected, key_count > 1)?;
                match motion {
                    "sharp" => sharp.push((trees, cost)),
                    "blurred" => blurred.push(cost),
                    _ => {}
                }
            }
            say!(
                "  build: {built:.2} s on the CPU; {}",
                bench.build(&world, cells)?
            );
        }
        for ((trees, sharp), blurred) in sharp.iter().zip(&blurred) {
            say!(
                "  blurred to sharp, {trees}: time {:.2}, nodes {:.2}, cells {:.2}",
                blurred.seconds / sharp.seconds,
                blurred.nodes / sharp.nodes,
                blurred.cells / sharp.cells
            );
        }
    }
    Ok(())
}

/// What occlusion rays cost in each scene, through the CPU's trees.
fn occlusion(device: &Arc<Device>, options: &Options, cells: f64) -> Result<(), Box<dyn Error>> {
    let tracer = Tracer::new(Arc::clone(device));
    let occlusions = Occlusions::new(tracer, options.secondary);
    Occlusions::head();
    for name in ["sheet", "patches", "fur"] {
        for (motion, key_count, radius) in MOTIONS {
            let world = world_of(scene(name, cells, key_count));
            let rays = rays(name, radius, key_count, options.image);
            let scene = GpuScene::new(device, &world)?;
            let name = format!("{name:<8} {motion}");
            occlusions.rows(&name, &world, &scene, &rays, DIFFERENT)?;
        }
    }
    Ok(())
}

/// The same with no bounds along anything but the axes of space.
fn world_upright(mesh: DicedMesh) -> World {
    let object = Arc::new(ObjectGeometry::upright(mesh));
    let place = InstanceTransform::Translation(DVec3::ZERO);
    World::build(vec![instance(&object, place)], DVec3::ZERO)
}

/// What rays cost: seconds of the fastest launch, and tests a ray.
struct Cost {
    seconds: f64,
    nodes: f64,
    cells: f64,
}

struct Bench {
    tracer: Tracer,
    builder: TreeBuilder,
    options: Options,
}

impl Bench {
    fn scene(&self, world: &World, first: FirstOnDevice) -> Result<GpuScene, Box<dyn Error>> {
        let options = BuildOptions {
            first,
            most: self.options.there.most,
            ..BuildOptions::default()
        };
        Ok(GpuScene::build(&self.builder, world, &options)?)
    }

    /// Prints what rays cost through trees of one kind; `row` is what the line begins with.
    fn trace(
        &self,
        row: &str,
        world: &World,
        first: FirstOnDevice,
        rays: &[Ray],
        (expected, seconds): &(Vec<Hit>, f64),
        moving: bool,
    ) -> Result<Cost, Box<dyn Error>> {
        let tracer = &self.tracer;
        let start = Instant::now();
        let scene = self.scene(world, first)?;
        let layout = start.elapsed().as_secs_f64();
        let mut counts = TraceCounts::default();
        let mut best = 0.0;
        let mut hits = vec![Hit::MISS; rays.len()];
        let found = tracer.device().found();
        let binding = found.largest_binding.min(found.largest_buffer) as usize;
        let together = (binding / size_of::<RayThere>()).min(TOGETHER);
        for (rays, hits) in rays.chunks(together).zip(hits.chunks_mut(together)) {
            let counted = tracer.batch(&scene, rays, false, true)?;
            tracer.run(&counted)?;
            counts = counts + tracer.counts(&counted)?.unwrap_or_default();
            drop(counted);
            let batch = tracer.batch(&scene, rays, false, false)?;
            let mut fastest = f64::INFINITY;
            for _ in 0..self.options.repeat {
                let start = Instant::now();
                let timed = tracer.run(&batch)?;
                fastest = fastest.min(timed.unwrap_or_else(|| start.elapsed().as_secs_f64()));
            }
            best += fastest;
            tracer.read(&batch, hits)?;
        }
        let some = expected.len();
        let differ = differences(&hits, expected) as f64 / some as f64;
        if differ > DIFFERENT {
            return Err(format!("{row}: {differ} of the hits differ").into());
        }
        let per_ray = |count: u64| count as f64 / rays.len() as f64;
        say!(
            "{row} {:>8.0} {:>5} {layout:>9.2} {:>9.1} {:>8.1} {:>8.1} {differ:>9.6} {:>9} {}",
            scene.bytes() as f64 / f64::from(1 << 20),
            scene.page_count(),
            rays.len() as f64 / best * 1e-6,
            per_ray(counts.node_tests),
            per_ray(counts.cell_tests),
            match self.options.cpu {
                true => format!("{:.1}", some as f64 / seconds * 1e-6),
                false => "-".to_owned(),
            },
            self.options
                .peaks
                .columns(&asked(&counts, moving, RAY_BYTES + HIT_BYTES), best),
        );
        Ok(Cost {
            seconds: best,
            nodes: per_ray(counts.node_tests),
            cells: per_ray(counts.cell_tests),
        })
    }

    /// What making trees on the device over so many micropolygons takes.
    fn build(&self, world: &World, cells: usize) -> Result<String, Box<dyn Error>> {
        let scene = self.scene(world, FirstOnDevice::Bound)?;
        Ok(stages_told(scene.build_seconds(), cells))
    }
}

/// Milliseconds of each stage that makes trees on the device over so many micropolygons, and how many that is a second.
fn stages_told(seconds: Vec<(BuildStage, f64)>, cells: usize) -> String {
    let stage = |(stage, seconds): (_, f64)| format!("{stage:?} {:.2} ms", seconds * 1e3);
    let all: f64 = seconds.iter().map(|(_, seconds)| seconds).sum();
    let stages: Vec<String> = seconds.into_iter().map(stage).collect();
    let rate = cells as f64 / all * 1e-9;
    match stages.is_empty() {
        true => "no clock on the device".to_owned(),
        false => format!("{}: {rate:.3} Gmicropolygons/s", stages.join(", ")),
    }
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
