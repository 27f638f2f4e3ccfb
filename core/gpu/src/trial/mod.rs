//! Whether a device is faster than the CPU: a trial, once for each device, driver and version, whose verdict is kept on disk.
//!
//! Both render a built-in [`scene`], from prims to pixels: dicing, trees, what goes to the device, rays, film. What drivers compile
//! is not counted, since it is kept. A device is chosen where it is faster, and where rays meet what they meet on the CPU; one that is
//! far slower is not waited for.

mod kept;
mod scene;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use hdtrapeze_core::aov::{Aov, AovData};
use hdtrapeze_core::film::Frame;
use hdtrapeze_core::render::{
    Elsewhere, Generator, Prepared, RayTracer, RenderControl, TileSamples, prepare, render_with,
};
use hdtrapeze_core::scene::Backend;
use hdtrapeze_core::trace::{Hit, Ray, TraceCounts};
use rayon::prelude::*;

pub use kept::known;
pub use scene::scene;

use super::{GpuFrame, Stages};

/// Share of rays that may meet something else: those that meet an edge within rounding.
const DIFFERENT: f64 = 0.002;
/// Distances are off by no more, in parts of themselves.
const CLOSE: f32 = 1.0e-5;
/// Share of pixels that may have another colour: each has some rays.
const DIFFERENT_PIXELS: f64 = 0.01;
/// Colours are off by no more.
const CLOSE_COLOR: f32 = 1.0e-3;
/// So many times the CPU's seconds are waited for.
const PATIENCE: f64 = 1.5;
/// Rays that are compared at once, about.
const RAYS: usize = 1 << 18;
/// Rays that are traced together on the CPU.
const CHUNK: usize = 4096;

/// How large the frame of a trial is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Of the image.
    pub resolution: [u32; 2],
    /// A pixel.
    pub samples: u32,
    /// Micropolygon edge in pixels.
    pub shading_rate: f32,
}

impl Default for Size {
    /// 0.3 million micropolygons and 0.9 million samples.
    fn default() -> Self {
        Self {
            resolution: [640, 360],
            samples: 4,
            shading_rate: 1.0,
        }
    }
}

/// Shares of what a device answered otherwise than the CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Differences {
    /// Rays that met another micropolygon, or met it somewhere else.
    pub rays: f64,
    /// Pixels that have another colour.
    pub pixels: f64,
}

/// What a trial told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Seconds of the frame on the CPU.
    pub cpu: f64,
    /// With the device; where it was not waited for, those until then.
    pub gpu: f64,
    /// Nothing where it was not waited for.
    pub differences: Option<Differences>,
}

/// What follows from a trial.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// The device is to render.
    pub gpu: bool,
    /// It failed, or was wrong.
    pub failed: bool,
    /// Why, for people.
    pub why: String,
}

/// What follows for the device of this name.
pub fn verdict(name: &str, trial: &Result<Measured, String>) -> Verdict {
    let cpu = |failed, why| Verdict {
        gpu: false,
        failed,
        why,
    };
    let measured = match trial {
        Ok(measured) => measured,
        Err(why) => return cpu(true, format!("a trial frame failed: {why}")),
    };
    let ratio = measured.gpu / measured.cpu;
    let Some(Differences { rays, pixels }) = measured.differences else {
        let why = format!("it renders a trial frame more than {ratio:.1} times as fast as {name}");
        return cpu(false, why);
    };
    let hundredths = |share: f64| 100.0 * share;
    // What is no number is within nothing.
    let within = |share: f64, most: f64| share <= most;
    if !within(rays, DIFFERENT) {
        let part = hundredths(rays);
        let why =
            format!("{name} met something else with {part:.2} % of the rays of a trial frame");
        return cpu(true, why);
    }
    if !within(pixels, DIFFERENT_PIXELS) {
        let part = hundredths(pixels);
        let why =
            format!("{name} gave another colour to {part:.2} % of the pixels of a trial frame");
        return cpu(true, why);
    }
    match measured.gpu < measured.cpu {
        true => Verdict {
            gpu: true,
            failed: false,
            why: format!(
                "it renders a trial frame {:.1} times as fast as the CPU",
                1.0 / ratio
            ),
        },
        false => {
            let why = format!("it renders a trial frame {ratio:.1} times as fast as {name}");
            cpu(false, why)
        }
    }
}

/// Renders the frame on both, on the calling thread's pool.
///
/// # Errors
/// It cannot be prepared, or the device failed.
pub fn run(stages: &Arc<Stages>, size: &Size) -> Result<Measured, String> {
    // What is compiled, and what else happens once, is done by then.
    let prepared = prepared(size, Backend::Gpu)?;
    let on_gpu = frame_of(stages, &prepared)?;
    let once = AtomicBool::new(false);
    rendered(&prepared, Some(&on_gpu), &once, &|| {
        once.store(true, Ordering::Relaxed);
    })?;
    drop((prepared, on_gpu));

    let start = Instant::now();
    let here = self::prepared(size, Backend::Cpu)?;
    let image = rendered(&here, None, &AtomicBool::new(false), &|| ())?;
    let cpu = start.elapsed().as_secs_f64();
    drop(here);

    let start = Instant::now();
    let prepared = self::prepared(size, Backend::Gpu)?;
    let on_gpu = frame_of(stages, &prepared)?;
    let late = AtomicBool::new(false);
    let look = || {
        if start.elapsed().as_secs_f64() > PATIENCE * cpu {
            late.store(true, Ordering::Relaxed);
        }
    };
    look();
    let image_there = rendered(&prepared, Some(&on_gpu), &late, &look)?;
    let gpu = start.elapsed().as_secs_f64();
    let differences = match image_there.samples_done() < size.samples {
        true => None,
        false => Some(Differences {
            rays: other_hits(&prepared, &on_gpu)?,
            pixels: other_colors(&image, &image_there)?,
        }),
    };
    Ok(Measured {
        cpu,
        gpu,
        differences,
    })
}

fn prepared(size: &Size, backend: Backend) -> Result<Prepared, String> {
    let mut scene = scene(size);
    Arc::make_mut(&mut scene.settings).backend = backend;
    let made = prepare(&scene, &scene::NoSubdivision, None, &AtomicBool::new(false));
    made.map(|made| made.prepared).map_err(|e| e.to_string())
}

fn frame_of(stages: &Arc<Stages>, prepared: &Prepared) -> Result<GpuFrame, String> {
    GpuFrame::new(Arc::clone(stages), prepared).map_err(|error| error.to_string())
}

/// An image, until `cancel` is raised; `look` is called after each tile and pass.
fn rendered(
    prepared: &Prepared,
    on: Option<&GpuFrame>,
    cancel: &AtomicBool,
    look: &(dyn Fn() + Sync),
) -> Result<Frame, String> {
    let resolution = prepared.settings().resolution;
    let frame = Frame::new(resolution, None, prepared.aovs()).map_err(|e| e.to_string())?;
    let control = RenderControl {
        cancel,
        on_progress: &|_| look(),
        on_pass: &|_, _| look(),
    };
    let elsewhere = on.map(|on| Elsewhere::new(on));
    render_with(prepared, &frame, &control, elsewhere.as_ref());
    match elsewhere.and_then(|elsewhere| elsewhere.fault()) {
        Some(why) => Err(why),
        None => Ok(frame),
    }
}

/// The share of all rays of a frame that meet something else on the device than on the CPU.
///
/// # Errors
/// The device failed.
pub fn other_hits(prepared: &Prepared, on_gpu: &GpuFrame) -> Result<f64, String> {
    let world = prepared.world();
    world.make_trees(&AtomicBool::new(false));
    let generator = Generator::new(prepared);
    let settings = prepared.settings();
    let frame = Frame::new(settings.resolution, None, &[]).map_err(|e| e.to_string())?;
    let tile = |i| TileSamples::of(&frame.tile(i), settings.samples);
    let tiles: Vec<TileSamples> = (0..frame.tile_count()).map(tile).collect();
    let largest = tiles.iter().map(TileSamples::len).max().unwrap_or(1);
    let (mut other, mut all) = (0, 0);
    for tiles in tiles.chunks((RAYS / largest.max(1)).max(1)) {
        let drawn = tiles.par_iter().map(|tile| generator.draw_tile(tile));
        let drawn: Vec<_> = drawn.collect();
        let rays: Vec<Ray> = drawn.iter().flatten().map(|(_, job)| job.ray).collect();
        let mut here = vec![Hit::MISS; rays.len()];
        let work = rays.par_chunks(CHUNK).zip(here.par_chunks_mut(CHUNK));
        work.for_each(|(rays, hits)| world.trace_many(rays, hits, &mut TraceCounts::default()));
        let mut there = vec![Hit::MISS; rays.len()];
        on_gpu.trace_tiles(tiles, &mut there)?;
        other += here
            .iter()
            .zip(&there)
            .filter(|(a, b)| differ(a, b))
            .count();
        all += rays.len();
    }
    Ok(other as f64 / all as f64)
}

/// True where hits are of different micropolygons, or too far apart.
fn differ(here: &Hit, there: &Hit) -> bool {
    let id = |hit: &Hit| (hit.instance, hit.grid, hit.cell);
    if !here.is_hit() || !there.is_hit() {
        return here.is_hit() != there.is_hit();
    }
    let close = (here.t - there.t).abs() <= CLOSE * here.t.abs();
    id(here) != id(there) || !close
}

/// The share of pixels that have another colour.
fn other_colors(here: &Frame, there: &Frame) -> Result<f64, String> {
    let colors = |frame: &Frame| match frame.aov(Aov::Color).map(|image| image.data) {
        Some(AovData::F32(colors)) => Ok(colors),
        _ => Err("it has no colours".to_owned()),
    };
    let (here, there) = (colors(here)?, colors(there)?);
    let (pixels, _) = here.as_chunks::<4>();
    let (others, _) = there.as_chunks::<4>();
    let close = |(a, b): (&f32, &f32)| (a - b).abs() <= CLOSE_COLOR;
    let pairs = pixels.iter().zip(others);
    let other = pairs.filter(|(a, b)| !a.iter().zip(*b).all(close)).count();
    Ok(other as f64 / pixels.len().max(1) as f64)
}

/// Tries the device of these stages, on the calling thread's pool, and keeps the verdict in this folder, where there is one.
pub fn tried(stages: &Arc<Stages>, folder: Option<&std::path::Path>) -> Verdict {
    let found = stages.device().found();
    let verdict = verdict(&found.name, &run(stages, &Size::default()));
    if let Some(folder) = folder {
        kept::keep(folder, found, &verdict);
    }
    verdict
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(cpu: f64, gpu: f64, rays: f64, pixels: f64) -> Result<Measured, String> {
        Ok(Measured {
            cpu,
            gpu,
            differences: Some(Differences { rays, pixels }),
        })
    }

    #[test]
    fn a_device_is_chosen_where_it_is_faster_and_right() {
        let told = |trial| {
            let Verdict { gpu, failed, why } = verdict("X", &trial);
            (gpu, failed, why)
        };
        let (gpu, failed, why) = told(measured(1.0, 0.25, 0.001, 0.004));
        assert!(gpu && !failed && why.contains("4.0 times as fast as the CPU"));
        let (gpu, failed, why) = told(measured(1.0, 1.25, 0.001, 0.004));
        assert!(
            !gpu && !failed && why.contains("1.2 times as fast as X"),
            "{why}"
        );
        // Wrong is worse than slow, and so is what is no number.
        for (rays, pixels) in [(0.003, 0.0), (0.0, 0.02), (f64::NAN, 0.0), (0.0, f64::NAN)] {
            let (gpu, failed, why) = told(measured(1.0, 0.25, rays, pixels));
            assert!(!gpu && failed && why.contains('%'), "{why}");
        }
        let (gpu, failed, why) = told(Err("it is lost".to_owned()));
        assert!(!gpu && failed && why.contains("it is lost"));
        let unfinished = Measured {
            cpu: 1.0,
            gpu: 1.6,
            differences: None,
        };
        let (gpu, failed, why) = told(Ok(unfinished));
        assert!(!gpu && !failed && why.contains("more than 1.6 times as fast as X"));
        // Faster or not, what was not compared is not chosen.
        let unfinished = Measured {
            gpu: 0.5,
            ..unfinished
        };
        assert!(!told(Ok(unfinished)).0);
    }

    #[test]
    fn hits_differ_by_what_they_name_and_where_they_are() {
        let hit = Hit {
            t: 4.0,
            instance: 1,
            grid: 2,
            cell: 3,
            ..Hit::MISS
        };
        assert!(!differ(&hit, &hit) && !differ(&Hit::MISS, &Hit::MISS));
        assert!(differ(&hit, &Hit::MISS) && differ(&Hit::MISS, &hit));
        for other in [
            Hit { instance: 2, ..hit },
            Hit { grid: 3, ..hit },
            Hit { cell: 4, ..hit },
            Hit { t: 4.0001, ..hit },
            Hit { t: f32::NAN, ..hit },
        ] {
            assert!(differ(&hit, &other) && differ(&other, &hit), "{other:?}");
        }
        let rounded = Hit {
            t: 4.0 + 4.0 * f32::EPSILON,
            ..hit
        };
        assert!(!differ(&hit, &rounded));
    }
}
