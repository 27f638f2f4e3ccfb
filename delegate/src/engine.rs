//! Between the session and the renderer: statistics, errors, films and rays in the session's terms.

use glam::{DVec3, Vec3};
use hdtrapeze_core::film::tile::Keeps;
use hdtrapeze_core::memory;
use hdtrapeze_core::render::{Frame, FrameError, PrepareError, Prepared, WorldHit, WorldRay};

use crate::error::Error;
use crate::progress::Statistics;

/// Numbers of a commit.
pub(crate) fn prepare_statistics(prepared: &Prepared) -> Statistics {
    let from = prepared.statistics();
    Statistics {
        prims: from.prims,
        instances: from.instances,
        objects: from.objects,
        grids: from.grids,
        micropolygons: from.micropolygons,
        limit_evaluations: from.limit_evaluations,
        geometry_bytes: from.geometry_bytes,
        bvh_bytes: from.bvh_bytes,
        bvh_nodes: from.bvh_nodes,
        translate_seconds: from.translate_seconds,
        dice_seconds: from.dice_seconds,
        build_seconds: from.build_seconds + from.world_seconds,
        total_seconds: from.total_seconds,
        objects_diced: from.objects_diced,
        objects_reused: from.objects_reused,
        objects_placed: from.objects_placed,
        clusters: from.clusters,
        clusters_culled: from.clusters_culled,
        micropolygons_culled: from.micropolygons_culled,
        ..Statistics::default()
    }
}

/// `known`, with what rays have had diced since.
pub(crate) fn current_statistics(known: &Statistics, prepared: &Prepared) -> Statistics {
    Statistics {
        film_bytes: known.film_bytes,
        peak_bytes: known.peak_bytes,
        trace_seconds: known.trace_seconds,
        total_seconds: known.total_seconds,
        rays: known.rays,
        node_tests: known.node_tests,
        cell_tests: known.cell_tests,
        ..prepare_statistics(prepared)
    }
}

/// An empty film, refused where memory for it and for reading it back is not there.
pub(crate) fn new_frame(prepared: &Prepared) -> Result<Frame, Error> {
    let settings = prepared.settings();
    let window = settings.window();
    let pixels = |[x0, y0, x1, y1]: [i32; 4]| {
        u64::from(x0.abs_diff(x1)).saturating_mul(u64::from(y0.abs_diff(y1)))
    };
    let widest = prepared.aovs().iter().map(|aov| aov.components()).max();
    let film = pixels(settings.data_window.unwrap_or(window))
        .saturating_mul(Keeps::of(prepared.aovs()).bytes() as u64);
    let read = pixels(window).saturating_mul(4 * widest.unwrap_or(0) as u64);
    memory::check(film.saturating_add(read), "the film")?;
    let frame = Frame::new(settings.resolution, settings.data_window, prepared.aovs());
    frame.map_err(|error| match error {
        FrameError::OutOfMemory(_) => Error::OutOfMemory(error.to_string()),
        _ => Error::InvalidArgument(error.to_string()),
    })
}

/// What a refused scene is to a host.
pub(crate) fn prepare_error(error: PrepareError) -> Error {
    match error {
        PrepareError::Cancelled => Error::Cancelled,
        PrepareError::OutOfMemory(what) => Error::OutOfMemory(what),
        _ => Error::InvalidArgument(error.to_string()),
    }
}

/// A ray that hits nothing.
pub(crate) const NO_RAY: WorldRay = WorldRay {
    origin: DVec3::ZERO,
    dir: Vec3::Z,
    time: 0.0,
    t_min: 1.0,
    t_max: 0.0,
};

/// What such a ray hits; the trace overwrites it.
pub(crate) const MISS: WorldHit = WorldHit {
    t: f32::INFINITY,
    u: 0.0,
    v: 0.0,
    normal: Vec3::ZERO,
    prim_id: -1,
    instance_id: -1,
    element_id: -1,
    grid: 0,
    cell: 0,
};

/// False for numbers that are not finite and for no direction.
pub(crate) fn is_traceable(ray: &WorldRay) -> bool {
    let numbers = [ray.time, ray.t_min, ray.t_max];
    ray.origin.as_vec3().is_finite()
        && ray.dir.is_finite()
        && ray.dir != Vec3::ZERO
        && !numbers.iter().any(|number| number.is_nan())
}
