//! Occlusion culling: a prim that appears once is diced cluster by cluster, when rays first come near.
//!
//! A ray is the best witness of what is seen, with its own time and lens point. So nothing is decided
//! beforehand: each cluster is a [`Deferred`] object of the world, and what is hidden at every time and from
//! every point of the lens is never diced. Which clusters a prim has does not depend on whether it is
//! culled: without culling all are diced at once, to the same grids, into one object.

use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;

use super::kept::Tally;
use super::objects::{Context, PlacedSet, PrimObjects};
use super::prepared::PrepareStatistics;
use super::shape::Shape;
use crate::bvh::ObjectGeometry;
use crate::diagnostics::{Code, Warning};
use crate::dice::{ClusterRule, Clusters, DiceError, DiceInput, DiceOutput, RasterMetric};
use crate::grid::DicedMesh;
use crate::motion::PointPath;
use crate::trace::places::{InstanceSet, Shift};
use crate::trace::{Deferred, Winding};

/// Below this many micropolygons a prim is one object from the start: finding bounds would cost as much. Clusters
/// have as many as make crossing from one to the next rare.
const RULE: ClusterRule = ClusterRule {
    least: 4096.0,
    least_a_face: 4.0,
    most: 32768.0,
};

/// Faces of a cluster that are looked at to see whether a view asks for more of it.
const PROBED_FACES: usize = 16;

/// What clusters of a prim are diced from.
struct Source {
    shape: Arc<dyn Shape>,
    clusters: Clusters,
    points: PointPath,
    metric: RasterMetric,
    shading_rate: f32,
    max_micropolygons: u64,
}

impl Source {
    fn with_input<R>(
        &self,
        cancel: &AtomicBool,
        run: impl FnOnce(&DiceInput<'_>) -> R,
    ) -> Option<R> {
        self.with_metric(&self.metric, cancel, run)
    }

    fn with_metric<R>(
        &self,
        metric: &RasterMetric,
        cancel: &AtomicBool,
        run: impl FnOnce(&DiceInput<'_>) -> R,
    ) -> Option<R> {
        let input = DiceInput {
            surface: self.shape.surface()?,
            path: &self.points,
            metric,
            shading_rate: self.shading_rate,
            with_normals: true,
            polygons_coarse: true,
            max_micropolygons: self.max_micropolygons,
            cancel,
        };
        Some(run(&input))
    }

    fn finished(&self, output: DiceOutput) -> DicedMesh {
        let mut mesh = output.mesh;
        for grid in &mut mesh.grids {
            grid.element = self.shape.element(grid.element);
        }
        mesh
    }
}

/// What clusters of a prim share.
struct Work {
    /// Until all clusters are diced.
    source: Mutex<Option<Arc<Source>>>,
    left: AtomicUsize,
    evaluations: AtomicU64,
    dice_nanos: AtomicU64,
    build_nanos: AtomicU64,
    /// Clusters that there was no memory for.
    lost: AtomicUsize,
}

impl Work {
    /// Dices a cluster and builds its tree.
    fn make(&self, cluster: usize) -> ObjectGeometry {
        let lock = || self.source.lock().unwrap_or_else(PoisonError::into_inner);
        let source = lock().clone();
        let start = Instant::now();
        let never = AtomicBool::new(false);
        let dice = |source: &Arc<Source>| {
            source.with_input(&never, |input| source.clusters.dice(input, cluster))
        };
        let diced = source.as_ref().and_then(dice);
        add_nanos(&self.dice_nanos, start);
        let object = match (source.as_ref(), diced) {
            (Some(source), Some(Ok(output))) => {
                let evaluations = output.limit_evaluations;
                self.evaluations.fetch_add(evaluations, Ordering::Relaxed);
                let mesh = source.finished(output);
                let start = Instant::now();
                let object = ObjectGeometry::new(mesh);
                add_nanos(&self.build_nanos, start);
                object
            }
            _ => {
                self.lost.fetch_add(1, Ordering::Relaxed);
                ObjectGeometry::new(DicedMesh::default())
            }
        };
        if self.left.fetch_sub(1, Ordering::AcqRel) == 1 {
            // The surface is not needed any more.
            *lock() = None;
        }
        object
    }
}

fn add_nanos(to: &AtomicU64, since: Instant) {
    let nanos = u64::try_from(since.elapsed().as_nanos()).unwrap_or(0);
    to.fetch_add(nanos, Ordering::Relaxed);
}

/// The clusters of a prim that are diced on demand.
pub(super) struct OnDemand {
    work: Arc<Work>,
    clusters: Vec<Arc<Deferred>>,
    /// Micropolygons expected of each.
    expected: Vec<f64>,
}

impl fmt::Debug for OnDemand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OnDemand")
            .field("clusters", &self.clusters.len())
            .finish_non_exhaustive()
    }
}

impl OnDemand {
    fn new(source: Source) -> Self {
        let source = Arc::new(source);
        let clusters = &source.clusters;
        let keys = source.points.key_times().len();
        let work = Arc::new(Work {
            source: Mutex::new(Some(Arc::clone(&source))),
            left: AtomicUsize::new(clusters.len()),
            evaluations: AtomicU64::new(0),
            dice_nanos: AtomicU64::new(0),
            build_nanos: AtomicU64::new(0),
            lost: AtomicUsize::new(0),
        });
        let deferred = |cluster: usize| {
            let work = Arc::clone(&work);
            let make = Arc::new(move || work.make(cluster));
            // As many vertices, about, where grids are large.
            let micropolygons = clusters.expected(cluster) as usize;
            let bytes = micropolygons.saturating_mul(size_of::<Vec3>() * keys);
            Arc::new(Deferred::new(*clusters.bounds(cluster), bytes, make))
        };
        let all = 0..clusters.len();
        Self {
            clusters: all.clone().map(deferred).collect(),
            expected: all.map(|cluster| clusters.expected(cluster)).collect(),
            work,
        }
    }

    /// Adds what there is by now.
    pub fn add_to(&self, statistics: &mut PrepareStatistics) {
        let [dice, build] = self.seconds();
        statistics.limit_evaluations += self.work.evaluations.load(Ordering::Relaxed);
        statistics.dice_seconds += dice;
        statistics.build_seconds += build;
        statistics.clusters += self.clusters.len() as u64;
        for (deferred, expected) in self.clusters.iter().zip(&self.expected) {
            match deferred.made() {
                Some(object) => statistics.add_object(object),
                None => {
                    statistics.clusters_culled += 1;
                    statistics.micropolygons_culled += *expected as u64;
                }
            }
        }
    }

    /// Seconds spent on dicing and on building by now.
    pub fn seconds(&self) -> [f64; 2] {
        let Work {
            dice_nanos,
            build_nanos,
            ..
        } = &*self.work;
        [dice_nanos, build_nanos].map(|nanos| nanos.load(Ordering::Relaxed) as f64 * 1e-9)
    }

    /// What `metric` asks for of the parts that are still to be diced.
    pub fn tally(&self, metric: &RasterMetric) -> Tally {
        let lock = || self.work.source.lock();
        let Some(source) = lock().unwrap_or_else(PoisonError::into_inner).clone() else {
            return Tally::default();
        };
        let never = AtomicBool::new(false);
        let expected = |metric: &RasterMetric, cluster: usize| {
            let of = |input: &DiceInput<'_>| {
                let clusters = &source.clusters;
                clusters.expected_of_faces(input, cluster, PROBED_FACES)
            };
            source.with_metric(metric, &never, of).unwrap_or_default()
        };
        let tally = |cluster: usize| {
            let [then, now] = [&source.metric, metric].map(|metric| expected(metric, cluster));
            let faces = then.iter().zip(&now).map(|(&then, &now)| {
                let stretch = (now / then).sqrt();
                Tally::of(then, now, [stretch; 2])
            });
            faces.fold(Tally::default(), Tally::and)
        };
        let deferred = self.clusters.par_iter().enumerate();
        let unmade = deferred.filter(|(_, deferred)| deferred.made().is_none());
        let tallies = unmade.map(|(cluster, _)| tally(cluster));
        tallies.reduce(Tally::default, Tally::and)
    }

    /// What went wrong by now.
    pub fn warning(&self, path: &str) -> Option<Warning> {
        let lost = self.work.lost.load(Ordering::Relaxed);
        let text = || format!("no memory for {lost} of its parts; they are left out");
        (lost > 0).then(|| Warning::new(path, Code::Budget, text()))
    }
}

impl PrimObjects {
    /// Places a shape cluster by cluster, with vertices in world space. False where it is not to be cut.
    pub(super) fn place_clusters(
        &mut self,
        shape: &Arc<dyn Shape>,
        points: &PointPath,
        metric: &RasterMetric,
        winding: &Winding,
        context: &Context<'_>,
    ) -> bool {
        let Some(surface) = shape.surface() else {
            return false;
        };
        let start = Instant::now();
        let settings = context.settings;
        let shading_rate = settings.shading_rate;
        let max_micropolygons = settings.most_micropolygons(surface.face_count());
        let clusters = Clusters::new(
            &DiceInput {
                surface,
                path: points,
                metric,
                shading_rate,
                with_normals: true,
                polygons_coarse: true,
                max_micropolygons,
                cancel: context.cancel,
            },
            &RULE,
        );
        // What goes wrong here goes wrong in dicing too, and is told there.
        let Ok(Some(clusters)) = clusters else {
            self.dice_seconds += start.elapsed().as_secs_f64();
            return false;
        };
        let source = Source {
            shape: Arc::clone(shape),
            clusters,
            points: points.clone(),
            metric: metric.clone(),
            shading_rate,
            max_micropolygons,
        };
        let place = Shift::new(glam::DVec3::ZERO, points.origin(), 0);
        let placed = |set: InstanceSet| PlacedSet {
            set: Arc::new(set),
            winding: winding.clone(),
            numbers: Vec::new(),
        };
        self.diced = true;
        if settings.dices_on_demand() {
            let on_demand = Arc::new(OnDemand::new(source));
            let sets = on_demand.clusters.iter().map(Arc::clone);
            let sets = sets.map(|object| placed(InstanceSet::deferred(object, place)));
            self.placed.extend(sets);
            self.on_demand = Some(on_demand);
            self.dice_seconds += start.elapsed().as_secs_f64();
            return true;
        }
        let diced = source.with_input(context.cancel, |input| source.clusters.dice_all(input));
        self.dice_seconds += start.elapsed().as_secs_f64();
        match diced {
            Some(Ok(output)) => {
                self.limit_evaluations += output.limit_evaluations;
                let start = Instant::now();
                let object = context.object(source.finished(output));
                self.build_seconds += start.elapsed().as_secs_f64();
                let set = InstanceSet::translated(object, vec![place]);
                self.placed.push(placed(set));
                true
            }
            // Nothing is lost by a second try, which tells why.
            Some(Err(error)) => error == DiceError::Cancelled,
            None => false,
        }
    }
}
