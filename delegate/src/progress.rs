//! How far a session is, and what its last commit and render took.

use std::time::{Duration, Instant};

/// What a session is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// Nothing, and the committed scene was not rendered yet.
    #[default]
    Idle,
    /// Applying edits, dicing, building.
    Preparing,
    /// Tracing rays.
    Rendering,
    /// A render waits for the end of a pause.
    Paused,
    /// Nothing; every sample was taken.
    Finished,
    /// Nothing; the last commit or render was cancelled.
    Cancelled,
    /// Nothing; the last commit or render failed.
    Failed,
}

impl State {
    /// True while a commit or render has not come to its end.
    pub fn is_running(self) -> bool {
        matches!(self, State::Preparing | State::Rendering | State::Paused)
    }
}

/// How far a session is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// What it is doing.
    pub state: State,
    /// Of the samples, 0 to 1.
    pub fraction: f64,
    /// Samples a pixel that every pixel has.
    pub samples_done: u32,
    /// Samples a pixel that were asked for.
    pub samples_total: u32,
    /// Since the commit or render began, up to its end; pauses that are over do not count.
    pub seconds: f64,
    /// Estimate of what remains, where there is one.
    pub seconds_left: Option<f64>,
}

/// Instants of a run and the samples it has taken.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Run {
    pub began: Option<Instant>,
    pub rendering_since: Option<Instant>,
    pub ended: Option<Instant>,
    pub done: u32,
    pub total: u32,
    pub fraction: f64,
}

impl Run {
    /// Progress at `now`.
    pub fn progress(&self, state: State, now: Instant) -> Progress {
        let now = self.ended.unwrap_or(now);
        let since = |start: Option<Instant>| {
            start.map_or(Duration::ZERO, |start| now.saturating_duration_since(start))
        };
        let fraction = match state {
            State::Finished => 1.0,
            _ => self.fraction.clamp(0.0, 1.0),
        };
        let rendering = since(self.rendering_since).as_secs_f64();
        let seconds_left = match state {
            State::Rendering if fraction > 0.0 => Some(rendering / fraction - rendering),
            State::Finished => Some(0.0),
            _ => None,
        };
        Progress {
            state,
            fraction,
            samples_done: self.done,
            samples_total: self.total,
            seconds: since(self.began).as_secs_f64(),
            seconds_left,
        }
    }
}

/// Numbers of the last commit and the last render.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Geometry prims.
    pub prims: u64,
    /// Instances in the world.
    pub instances: u64,
    /// Diced objects that instances share.
    pub objects: u64,
    /// Grids.
    pub grids: u64,
    /// Micropolygons, shared ones counted once.
    pub micropolygons: u64,
    /// Limit surface evaluations.
    pub limit_evaluations: u64,
    /// Bytes of diced geometry.
    pub geometry_bytes: u64,
    /// Bytes of the BVH.
    pub bvh_bytes: u64,
    /// Nodes of the BVH.
    pub bvh_nodes: u64,
    /// Bytes of the film.
    pub film_bytes: u64,
    /// Largest resident size of the process so far; 0 where the system does not tell.
    pub peak_bytes: u64,
    /// Seconds spent on translating the scene.
    pub translate_seconds: f64,
    /// Seconds spent on splitting and dicing.
    pub dice_seconds: f64,
    /// Seconds spent on building the BVH.
    pub build_seconds: f64,
    /// Seconds spent on tracing, shading and filtering.
    pub trace_seconds: f64,
    /// Seconds of the last commit that prepared anything, and of the render.
    pub total_seconds: f64,
    /// Rays traced.
    pub rays: u64,
    /// Nodes opened.
    pub node_tests: u64,
    /// Micropolygons tested.
    pub cell_tests: u64,
    /// Objects that the last commit diced.
    pub objects_diced: u64,
    /// Objects that the last commit kept from before.
    pub objects_reused: u64,
    /// Those of them that were placed anew: only their grids were kept.
    pub objects_placed: u64,
    /// Parts of prims that are diced when a ray first comes near them.
    pub clusters: u64,
    /// Those of them that none has come near by now; they count nowhere else.
    pub clusters_culled: u64,
    /// About how many micropolygons these would have.
    pub micropolygons_culled: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_counts_rendering_only_and_stops_with_the_run() {
        let start = Instant::now();
        let at = |seconds| start + Duration::from_secs(seconds);
        let mut run = Run {
            began: Some(at(0)),
            rendering_since: Some(at(10)),
            ended: None,
            done: 1,
            total: 4,
            fraction: 0.25,
        };
        let now = run.progress(State::Rendering, at(12));
        assert_eq!((now.fraction, now.seconds), (0.25, 12.0));
        assert_eq!(now.seconds_left, Some(6.0));
        run.fraction = 0.0;
        assert_eq!(
            run.progress(State::Rendering, at(12)).seconds_left,
            None,
            "unknown before the first sample"
        );
        (run.done, run.ended) = (4, Some(at(18)));
        let end = run.progress(State::Finished, at(99));
        assert_eq!((end.seconds, end.seconds_left), (18.0, Some(0.0)));
        let empty = Run::default().progress(State::Idle, at(5));
        assert_eq!(empty, Progress::default());
    }
}
