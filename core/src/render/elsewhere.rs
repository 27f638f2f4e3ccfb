//! Passes of which some stages run elsewhere, on a GPU: the others are done here, for many tiles at a time.
//!
//! `generate` (there, or here) -> trace (there) -> `shade`, `film` (here). Where a stage fails, the tiles at hand are as they
//! were, and the render goes on without it.

use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use super::generate::{Job, TileSamples};
use super::integrate::Integrator;
use crate::film::Frame;
use crate::trace::{Hit, Ray, TraceCounts};

/// Rays that are traced together, about.
const RAYS: usize = 1 << 19;

/// The stages of a sample, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Samples to rays.
    Generate,
    /// Rays to hits.
    Trace,
}

/// Traces rays against the world of the scene that is rendered.
pub trait RayTracer: Send + Sync {
    /// The first stage that it takes over.
    fn first_stage(&self) -> Stage {
        Stage::Trace
    }

    /// The nearest hit of each ray of tiles, in the order of [`Generator::draw_tile`](super::Generator::draw_tile); asked
    /// only where its first stage is [`Stage::Generate`].
    ///
    /// # Errors
    /// As [`RayTracer::trace`].
    fn trace_tiles(&self, tiles: &[TileSamples], hits: &mut [Hit]) -> Result<(), String>;

    /// The nearest hit of each ray, as [`World::trace`](crate::trace::World::trace) gives it, but for rounding.
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
            counts = counts + self.fill_tiles(integrator, frame, now, target, done);
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
        let (drawn, traced) = match self.tracer.first_stage() {
            // Shading looks at rays too: they are drawn here as well, meanwhile.
            Stage::Generate => rayon::join(draw, || self.tracer.trace_tiles(&samples, &mut hits)),
            Stage::Trace => {
                let drawn = draw();
                let rays: Vec<Ray> = drawn.iter().flatten().map(|(_, job)| job.ray).collect();
                let traced = self.tracer.trace(&rays, &mut hits);
                (drawn, traced)
            }
        };
        if let Err(why) = traced {
            self.why
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .get_or_insert(why);
            self.failed.store(true, Ordering::Relaxed);
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
}
