//! Grids that were diced for another view, kept while dicing them again would gain little.
//!
//! Rates depend on what the camera sees, so a camera that moves asks for other grids of all that appears
//! once. Where [`keep_finer`](crate::scene::RenderSettings::keep_finer) allows it, those of a prim stay
//! while they are about as fine as the view asks for. What tells so are the micropolygons themselves: samples
//! of each grid are measured as the new view sees them and as the one they were diced for did. What dicing had
//! left long (flat polygons, what was outside of the image) was right then, so an edge is too long only where
//! it is longer than both the rate and what it was. A camera on its way around a prim sees some of it that was
//! nearly edge-on: a few long micropolygons are let pass, since their chords miss next to nothing. Of clusters that no
//! ray has asked for, faces are counted as [`Clusters::expected`](crate::dice::Clusters::expected) counts them.
//! Shapes that face the camera stay while they would turn by no more than [`LARGEST_TURN`].
//!
//! A prim stays as a whole or not at all, so its parts meet without cracks. What is hidden stays by the same
//! rules, until its geometry is edited or it is removed: the price of showing it again at once is its memory.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::objects::{Context, PrimObjects};
use super::shape::Shape;
use crate::bvh::ObjectGeometry;
use crate::camera::Camera;
use crate::dice::{Eye, RasterMetric};
use crate::grid::{lerp_position, locate_key};
use crate::motion::PointPath;
use crate::translate::measure::views_at_keys;

/// How many times the area that is asked for a micropolygon may have...
const LARGEST_AREA: f64 = 2.0;
/// ...but for this share of all of them...
const FEW: f64 = 0.1;
/// ...and how much longer than asked for any edge may be.
const LONGEST: f64 = 4.0;
/// How many micropolygons may stand for one that is asked for: so many that what leaves the image for a while
/// (see [`OFF_SCREEN`](crate::dice::metric::OFF_SCREEN)) is there when it comes back.
const LARGEST_EXCESS: f64 = 256.0;
/// How far a shape that faces the camera may be turned from it, as a sine: 2 degrees, which take a ribbon 0.06 % of
/// its width.
const LARGEST_TURN: f64 = 0.035;
/// Cells sampled along each side of a grid, at most.
const SAMPLES: usize = 2;
/// Keys at which they are measured, at most.
const MOST_KEYS: usize = 3;
/// Grids that a thread measures at a time.
const CHUNK: usize = 256;

/// What a prim that appears once was diced for.
#[derive(Clone, Debug)]
pub(super) struct DicedFor {
    key_times: Vec<f32>,
    origin: DVec3,
    metric: RasterMetric,
    rate: f32,
    /// The camera at each key, where shapes face it.
    eyes: Option<Vec<Eye>>,
}

/// What a view asks for of micropolygons that another one was given.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tally {
    /// True where a part is much too coarse.
    coarse: bool,
    /// Micropolygons that the view asks for.
    asked: f64,
    /// Those of them that are asked for where there are too few.
    asked_more: f64,
    /// Micropolygons that the earlier view asked for.
    asked_then: f64,
}

impl Tally {
    /// Of parts whose micropolygons were asked to be `then` and are asked to be `now`, in number; `stretch` is
    /// how much longer than asked for their edges are.
    pub fn of(then: f64, now: f64, stretch: [f64; 2]) -> Self {
        let [u, v] = stretch.map(|stretch| stretch.max(1.0));
        Self {
            coarse: u.max(v) > LONGEST,
            asked: now,
            asked_more: if u * v > LARGEST_AREA { now } else { 0.0 },
            asked_then: then,
        }
    }

    /// What has to be diced anew, whatever else there is.
    fn lost() -> Self {
        Self {
            coarse: true,
            ..Self::default()
        }
    }

    pub fn and(self, other: Self) -> Self {
        Self {
            coarse: self.coarse || other.coarse,
            asked: self.asked + other.asked,
            asked_more: self.asked_more + other.asked_more,
            asked_then: self.asked_then + other.asked_then,
        }
    }

    fn is_enough(&self) -> bool {
        let wasted = self.asked * LARGEST_EXCESS < self.asked_then;
        !self.coarse && !wasted && self.asked_more <= self.asked * FEW
    }
}

impl DicedFor {
    pub fn new(
        shape: &dyn Shape,
        path: &PointPath,
        metric: &RasterMetric,
        context: &Context<'_>,
    ) -> Self {
        Self {
            key_times: path.key_times().to_vec(),
            origin: path.origin(),
            metric: metric.clone(),
            rate: context.settings.shading_rate,
            eyes: shape
                .faces_camera()
                .then(|| Eye::at_keys(context.camera, path)),
        }
    }

    /// True where what was diced is good enough for `camera`.
    fn fits(&self, objects: &PrimObjects, camera: &Camera) -> bool {
        let views = views_at_keys(camera, &self.key_times);
        let metric = RasterMetric::new(&views, self.origin);
        let made: Vec<&ObjectGeometry> = objects
            .placed
            .iter()
            .filter_map(|placed| placed.set.made())
            .map(|object| &**object)
            .collect();
        let pieces: Vec<(&ObjectGeometry, usize)> = made
            .iter()
            .flat_map(|&object| {
                let grids = object.mesh().grids.len();
                (0..grids).step_by(CHUNK).map(move |first| (object, first))
            })
            .collect();
        let now = Eye::at_times(camera, &self.key_times, self.origin);
        let turned = |object: &ObjectGeometry, first: usize| match &self.eyes {
            Some(then) => self.turned(object, first, then, &now),
            None => false,
        };
        let of = |&(object, first): &(&ObjectGeometry, usize)| match turned(object, first) {
            true => Tally::lost(),
            false => self.tally(object, first, &metric),
        };
        let made = pieces.par_iter().map(of);
        let made = made.reduce(Tally::default, Tally::and);
        let unseen = objects.on_demand.as_ref();
        let unseen = unseen.map_or(Tally::default(), |unseen| unseen.tally(&metric));
        made.and(unseen).is_enough()
    }

    /// Measures samples of the grids from `first` on.
    fn tally(&self, object: &ObjectGeometry, first: usize, metric: &RasterMetric) -> Tally {
        let mut tally = Tally::default();
        let mesh = object.mesh();
        let rate = f64::from(self.rate);
        for g in first..(first + CHUNK).min(mesh.grids.len()) {
            let grid = &mesh.grids[g];
            let [nu, nv] = [grid.nu, grid.nv].map(usize::from);
            let of_grid = (nu * nv) as f64 / (samples(nu).count() * samples(nv).count()) as f64;
            for (i, j) in samples(nv).flat_map(|j| samples(nu).map(move |i| (i, j))) {
                let corner = j * (nu + 1) + i;
                let ends = [corner, corner + 1, corner + nu + 1];
                let [mut now, mut then] = [[0.0f64; 2]; 2];
                for k in some_keys(self.key_times.len()) {
                    let at = |vertex| position(object, g, vertex, self.key_times[k]);
                    let [a, u, v] = ends.map(at);
                    for (longest, metric) in [(&mut now, metric), (&mut then, &self.metric)] {
                        let a = metric.measure(k, a);
                        for (longest, b) in longest.iter_mut().zip([u, v]) {
                            let length = metric.length_between(k, &a, &metric.measure(k, b));
                            *longest = longest.max(length.into());
                        }
                    }
                }
                let cells = |edges: [f64; 2]| {
                    let [u, v] = edges.map(|edge| (edge / rate).min(1.0));
                    u * v * of_grid
                };
                let stretch = [0, 1].map(|side| now[side] / then[side].max(rate));
                tally = tally.and(Tally::of(cells(then), cells(now), stretch));
            }
        }
        tally
    }

    /// True where grids from `first` on no longer face the camera.
    fn turned(&self, object: &ObjectGeometry, first: usize, then: &[Eye], now: &[Eye]) -> bool {
        let end = (first + CHUNK).min(object.mesh().grids.len());
        let grid = |g: usize| {
            some_keys(self.key_times.len()).any(|k| {
                let p = position(object, g, 0, self.key_times[k]).as_dvec3();
                let [a, b] = [then[k], now[k]].map(|eye| eye.from(p));
                // Written so that what is not finite has turned.
                let sine = a.cross(b).length() / (a.length() * b.length());
                !(sine < LARGEST_TURN && a.dot(b) > 0.0)
            })
        };
        (first..end).any(grid)
    }
}

impl PrimObjects {
    /// True where a prim that appears once may stay as it is before `camera`.
    pub(super) fn fits(&self, camera: &Camera) -> bool {
        let fits = |diced_for: &DicedFor| diced_for.fits(self, camera);
        !self.coarsened && self.diced_for.as_ref().is_some_and(fits)
    }
}

/// Cells to sample of `count` along a side.
fn samples(count: usize) -> impl Iterator<Item = usize> + Clone {
    let n = count.min(SAMPLES);
    (0..n).map(move |i| (2 * i + 1) * count / (2 * n))
}

/// Keys to measure at, of `count`: first, middle, last.
fn some_keys(count: usize) -> impl Iterator<Item = usize> {
    let n = count.min(MOST_KEYS);
    (0..n).map(move |i| i * (count - 1) / (n - 1).max(1))
}

/// A vertex of grid `g` at `time`, relative to the mesh's origin.
fn position(object: &ObjectGeometry, g: usize, vertex: usize, time: f32) -> Vec3 {
    let mesh = object.mesh();
    let (k, f) = locate_key(&mesh.key_times, time);
    let a = mesh.position(g, k, vertex);
    if f == 0.0 {
        return a;
    }
    lerp_position(a, mesh.position(g, k + 1, vertex), f)
}
