//! Progressive passes over the film's tiles.
//!
//! A pass brings every tile to the same sample count; counts double from pass to pass, so that a first
//! image is there at once and the last pass does half of the work in long coherent runs. A tile is
//! brought from its own count to the pass's, so that a cancelled render can go on, and what it had is
//! a valid image.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use super::elsewhere::Elsewhere;
use super::integrate::Integrator;
use super::prepared::Prepared;
use crate::film::Frame;
use crate::trace::TraceCounts;

/// Largest step between two passes, samples a pixel: keeps progress and cancelling lively.
const LARGEST_STEP: u32 = 64;

/// How a render is watched and stopped.
pub struct RenderControl<'a> {
    /// Raised to stop; looked at between tiles.
    pub cancel: &'a AtomicBool,
    /// Called after each tile with the fraction of all samples that are done; from any thread.
    pub on_progress: &'a (dyn Fn(f64) + Sync),
    /// Called after each pass with samples done and asked for, from the calling thread.
    pub on_pass: &'a dyn Fn(u32, u32),
}

/// Counts and time of a render.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RenderStatistics {
    /// Wall clock.
    pub seconds: f64,
    /// Rays and tests.
    pub counts: TraceCounts,
    /// True when it was stopped before its last sample.
    pub cancelled: bool,
}

/// Renders `prepared` into `frame` until every pixel has its samples, or `control` says stop.
pub fn render(prepared: &Prepared, frame: &Frame, control: &RenderControl<'_>) -> RenderStatistics {
    render_with(prepared, frame, control, None)
}

/// [`render`], with stages run `elsewhere` for as long as that works.
pub fn render_with(
    prepared: &Prepared,
    frame: &Frame,
    control: &RenderControl<'_>,
    elsewhere: Option<&Elsewhere<'_>>,
) -> RenderStatistics {
    let start = Instant::now();
    let total = prepared.settings.samples;
    let integrator = Integrator::new(prepared, frame.keeps());
    let mut counts = TraceCounts::default();
    let mut done = frame.samples_done();
    let work = frame.tile_count() as f64 * f64::from(total);
    let finished = std::sync::atomic::AtomicU64::new(
        (0..frame.tile_count())
            .map(|i| u64::from(frame.tile(i).samples))
            .sum(),
    );
    while done < total && !control.cancel.load(Ordering::Relaxed) {
        let target = done.saturating_add(done.clamp(1, LARGEST_STEP)).min(total);
        let added = |samples: u32| {
            let added = u64::from(samples);
            let all = finished.fetch_add(added, Ordering::Relaxed) + added;
            (control.on_progress)(all as f64 / work);
        };
        if let Some(elsewhere) = elsewhere.filter(|e| e.works()) {
            let pass = elsewhere.fill(&integrator, frame, target, control.cancel, &added);
            counts = counts + pass;
        }
        let behind = |i| frame.tile(i).samples < target;
        if (0..frame.tile_count()).any(behind) {
            prepared.world.make_trees(control.cancel);
        }
        let pass = (0..frame.tile_count())
            .into_par_iter()
            .map(|i| {
                let mut counts = TraceCounts::default();
                if !control.cancel.load(Ordering::Relaxed) {
                    let mut tile = frame.tile(i);
                    let from = tile.samples;
                    integrator.fill(&mut tile, target, &mut counts);
                    let more = target.saturating_sub(from);
                    if more > 0 {
                        added(more);
                    }
                }
                counts
            })
            .reduce(TraceCounts::default, |a, b| a + b);
        counts = counts + pass;
        done = frame.samples_done();
        (control.on_pass)(done, total);
    }
    let cancelled = done < total;
    RenderStatistics {
        seconds: start.elapsed().as_secs_f64(),
        counts,
        cancelled,
    }
}
