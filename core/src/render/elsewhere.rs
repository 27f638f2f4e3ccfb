//! Passes of which some stages run elsewhere, on a GPU: the others are done here, for many tiles at a time.
//!
//! `generate` -> trace -> `shade` -> `film`: elsewhere runs one stage after the other, from the first that it takes over to
//! the last, at least trace. What stages before make is handed there, and what it makes is taken up here: hits, or sums of
//! pixels, which the film adds to its own. Where a stage fails, the tiles at hand are as they were, and the render goes on
//! without it.

use std::ops::RangeInclusive;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::generate::{Job, TileSamples};
use super::integrate::Integrator;
use crate::film::Frame;
use crate::film::tile::PixelSums;
use crate::trace::{Hit, Ray, TraceCounts};

/// Rays that are traced together, about: few enough that a cancel is heeded soon, and that no driver's patience is tried.
const RAYS: usize = 1 << 19;

/// The stages of a sample, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Samples to rays.
    Generate,
    /// Rays to hits.
    Trace,
    /// Hits to colours.
    Shade,
    /// Colours to sums of pixels.
    Film,
}

/// What stages before the first that runs elsewhere have made of tiles: by numbers of rays, which are their places in
/// [`Generator::draw_tile`](super::Generator::draw_tile), one tile's after the other's.
#[derive(Clone, Debug, Default)]
pub struct Made {
    /// By `generate`.
    pub jobs: Vec<Job>,
    /// By trace; where `shade` is done too, what is seen first: nothing matte or wholly transparent.
    pub hits: Vec<Hit>,
    /// By trace, where surfaces may be seen through: of each layer behind the first what all rays meet.
    pub behind: Vec<Vec<Hit>>,
    /// By `shade`: premultiplied radiance and coverage.
    pub colors: Vec<[f32; 4]>,
    /// By `shade`: the values of [`Prepared::mean_values`](super::Prepared::mean_values), one sample's after the other's.
    pub values: Vec<f32>,
}

/// Runs stages for the scene that is rendered.
pub trait RayTracer: Send + Sync {
    /// The first and the last stage that it takes over. The last is trace or film.
    fn stages(&self) -> RangeInclusive<Stage>;

    /// The nearest hit of each ray of tiles, by number; asked only where its stages are generate and trace.
    ///
    /// # Errors
    /// As [`RayTracer::trace`].
    fn trace_tiles(&self, tiles: &[TileSamples], hits: &mut [Hit]) -> Result<(), String>;

    /// What the samples of each pixel of tiles add up to, one tile's after the other's, and in `means` what the values of
    /// [`Prepared::mean_values`](super::Prepared::mean_values) do, [`stride`](crate::film::tile::MeanValues::stride) floats a pixel; asked only where its last
    /// stage is [`Stage::Film`].
    ///
    /// # Errors
    /// As [`RayTracer::trace`].
    fn film(
        &self,
        tiles: &[TileSamples],
        made: &Made,
        pixels: &mut [PixelSums],
        means: &mut [f32],
    ) -> Result<(), String>;

    /// The nearest hit of each ray, as [`World::next`](crate::trace::World::next) gives it where sides that are culled are not
    /// there, but for rounding.
    ///
    /// # Errors
    /// It cannot any more, for this reason; `hits` mean nothing then.
    fn trace(&self, rays: &[Ray], hits: &mut [Hit]) -> Result<(), String>;
}

/// A tracer, until it fails.
pub struct Elsewhere<'a> {
    tracer: &'a dyn RayTracer,
    failed: AtomicBool,
    why: Mutex<Option<String>>,
}

impl<'a> Elsewhere<'a> {
    /// Nothing has failed yet.
    pub fn new(tracer: &'a dyn RayTracer) -> Self {
        Self {
            tracer,
            failed: AtomicBool::new(false),
            why: Mutex::default(),
        }
    }

    /// True until it fails.
    pub fn works(&self) -> bool {
        !self.failed.load(Ordering::Relaxed)
    }

    /// Why it failed, where it did.
    pub fn fault(&self) -> Option<String> {
        let why = self.why.lock().unwrap_or_else(PoisonError::into_inner);
        why.clone()
    }

    /// Brings tiles to `target` samples, until it fails or `cancel` is raised; `done` hears how many samples a pixel of
    /// each tile were added.
    pub(super) fn fill(
        &self,
        integrator: &Integrator<'_>,
        frame: &Frame,
        target: u32,
        cancel: &AtomicBool,
        done: &(dyn Fn(u32) + Sync),
    ) -> TraceCounts {
        let behind = |&i: &usize| frame.tile(i).samples < target;
        let tiles: Vec<usize> = (0..frame.tile_count()).filter(behind).collect();
        let mut counts = TraceCounts::default();
        let films = *self.tracer.stages().end() == Stage::Film;
        if *self.tracer.stages().start() > Stage::Trace || (!films && integrator.sees_through()) {
            integrator.make_trees(cancel);
        }
        let mut rest = &tiles[..];
        while !rest.is_empty() && self.works() && !cancel.load(Ordering::Relaxed) {
            let rays_of = |&i: &usize| {
                let tile = frame.tile(i);
                (tile.width * tile.height * (target - tile.samples)) as usize
            };
            let mut rays = 0;
            let full = rest.iter().position(|tile| {
                rays += rays_of(tile);
                rays >= RAYS
            });
            let (now, later) = rest.split_at(full.map_or(rest.len(), |i| i + 1));
            rest = later;
            counts = counts
                + match films {
                    true => self.merge_tiles(integrator, frame, now, target, done),
                    false => self.fill_tiles(integrator, frame, now, target, done),
                };
        }
        counts
    }

    fn fill_tiles(
        &self,
        integrator: &Integrator<'_>,
        frame: &Frame,
        tiles: &[usize],
        target: u32,
        done: &(dyn Fn(u32) + Sync),
    ) -> TraceCounts {
        let samples = |&i: &usize| TileSamples::of(&frame.tile(i), target);
        let samples: Vec<TileSamples> = tiles.iter().map(samples).collect();
        let mut hits = vec![Hit::MISS; samples.iter().map(TileSamples::len).sum()];
        let draw = || -> Vec<Vec<(usize, Job)>> {
            let drawn = samples.par_iter();
            drawn
                .map(|samples| integrator.generator().draw_tile(samples))
                .collect()
        };
        let (drawn, traced) = match self.tracer.stages().start() {
            // Shading looks at rays too: they are drawn here as well, meanwhile.
            Stage::Generate => rayon::join(draw, || self.tracer.trace_tiles(&samples, &mut hits)),
            _ => {
                let drawn = draw();
                let rays: Vec<Ray> = drawn.iter().flatten().map(|(_, job)| job.ray).collect();
                let traced = self.tracer.trace(&rays, &mut hits);
                (drawn, traced)
            }
        };
        if let Err(why) = traced {
            self.fail(why);
            return TraceCounts::default();
        }
        let mut rest = &hits[..];
        let work = tiles.iter().zip(&drawn).map(|(&i, jobs)| {
            let (own, others) = rest.split_at(jobs.len());
            rest = others;
            (i, jobs, own)
        });
        let work: Vec<_> = work.collect();
        work.into_par_iter()
            .map(|(i, jobs, hits)| {
                let mut counts = TraceCounts::default();
                let mut tile = frame.tile(i);
                let added = target.saturating_sub(tile.samples);
                integrator.film_tile(&mut tile, target, jobs, hits, &mut counts);
                done(added);
                counts
            })
            .reduce(TraceCounts::default, |a, b| a + b)
    }

    fn merge_tiles(
        &self,
        integrator: &Integrator<'_>,
        frame: &Frame,
        tiles: &[usize],
        target: u32,
        done: &(dyn Fn(u32) + Sync),
    ) -> TraceCounts {
        let samples = |&i: &usize| TileSamples::of(&frame.tile(i), target);
        let samples: Vec<TileSamples> = tiles.iter().map(samples).collect();
        let pixels_of = |samples: &TileSamples| (samples.width * samples.height) as usize;
        let made = integrator.make(&samples, *self.tracer.stages().start());
        let mut pixels = vec![PixelSums::NONE; samples.iter().map(pixels_of).sum()];
        let stride = integrator.mean_values().stride();
        let mut means = vec![0.0; pixels.len() * stride];
        let filmed = self.tracer.film(&samples, &made, &mut pixels, &mut means);
        if let Err(why) = filmed {
            self.fail(why);
            return TraceCounts::default();
        }
        let mut rest = (&pixels[..], &means[..]);
        let work = tiles.iter().zip(&samples).map(|(&i, samples)| {
            let count = pixels_of(samples);
            let (own, others) = rest.0.split_at(count);
            let (own_means, other_means) = rest.1.split_at(count * stride);
            rest = (others, other_means);
            (i, samples.samples.len(), own, own_means)
        });
        let work: Vec<_> = work.collect();
        work.into_par_iter()
            .map(|(i, added, pixels, means)| {
                let mut counts = TraceCounts::default();
                let tile = &mut frame.tile(i);
                integrator.merge_tile(tile, target, pixels, means, &mut counts);
                done(added as u32);
                counts
            })
            .reduce(TraceCounts::default, |a, b| a + b)
    }

    fn fail(&self, why: String) {
        self.why
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .get_or_insert(why);
        self.failed.store(true, Ordering::Relaxed);
    }
}
