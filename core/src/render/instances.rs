//! A prim that is part of instancers: diced once in object space, placed in sets.
//!
//! Placements are classified in parallel, one byte each: by how they move, and by how many straight
//! pieces their path needs. Then the prim is diced as finely as the nearest placement asks for, and each
//! class becomes one set. Placements that rays cannot be carried through are flattened one by one.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use glam::DAffine3;
use rayon::prelude::*;

use super::objects::{Context, Flat, PlacedSet, PrimObjects};
use super::shape::{Shape, Target};
use crate::bvh::ObjectGeometry;
use crate::camera::Camera;
use crate::diagnostics::Code;
use crate::dice::{RasterMetric, RasterView};
use crate::motion::PointPath;
use crate::motion::keys::subdivided;
use crate::motion::transform::{is_usable, lerp};
use crate::trace::Winding;
use crate::trace::places::{InstanceSet, Record, Shift};
use crate::translate::instancer::{Moments, Placements};
use crate::translate::measure::{
    CHORD_TOLERANCE, ObjectBounds, instance_pixels, largest_scale, pixels_per_unit,
};
use crate::translate::route::is_invertible;

/// Halvings of the segments between key times, at most.
const MAX_DEPTH: u8 = 6;
/// Straight pieces of a path, at most.
const MAX_PIECES: usize = 128;
/// A piece spins by no more than this, whatever its ends show.
const LARGEST_SPIN: f64 = 90.0;
/// Halving a piece divides its error by 4, and by no less than 3.4 where it turns by half a turn.
const ERROR_SAFETY: f64 = 1.25;
/// Placements that are classified, and placed, together.
const CHUNK: usize = 4096;
/// Rates of shared prims are powers of this: a small move of an instancer asks for the same grids.
const RATE_STEP: f64 = 1.189_207_115_002_721; // 2^(1/4)
/// Finer grids of an earlier commit are kept up to this ratio.
const LARGEST_EXCESS: f64 = 4.0;

/// What a prim was diced to, and what is needed to place it again.
#[derive(Clone, Debug)]
pub(super) struct Shared {
    bounds: ObjectBounds,
    left_handed: bool,
    /// Straight pieces of the points' own path.
    point_segments: usize,
    /// The grids, and pixels per unit that they were diced for.
    diced: Option<(Arc<ObjectGeometry>, f64)>,
}

impl Shared {
    fn new(shape: &dyn Shape) -> Self {
        let points = shape.points();
        Self {
            bounds: ObjectBounds::of(&points.points),
            left_handed: shape.is_left_handed(),
            point_segments: points.times.len() - 1,
            diced: None,
        }
    }
}

/// How a placement reaches the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Class(u8);

impl Class {
    const LOST: Class = Class(0);
    const TRANSLATED: Class = Class(1);
    const FIXED: Class = Class(2);
    /// This and above: moving, with one more halving each.
    const MOVING: Class = Class(3);
    const ALONE: Class = Class(255);

    fn moving(depth: u8) -> Self {
        Self(Self::MOVING.0 + depth)
    }
}

impl PrimObjects {
    /// Places a prim. `old` is what it was before where nothing but its places may have changed, and
    /// `make_shape` checks its geometry.
    pub(super) fn instance<'s>(
        &mut self,
        path: &str,
        placements: &Placements,
        old: Option<&PrimObjects>,
        make_shape: impl FnOnce(&mut PrimObjects) -> Option<Box<dyn Shape + 's>>,
        context: &Context<'_>,
    ) {
        let mut make_shape = Some(make_shape);
        let mut make = |out: &mut Self| make_shape.take().and_then(|make| make(out));
        let mut shape = None;
        let mut shared = match old.and_then(|old| Some((old, old.shared.clone()?))) {
            Some((old, shared)) => {
                self.shading = old.shading.clone();
                self.primvars = old.primvars.clone();
                self.warnings.clone_from(&old.shape_warnings);
                self.coarsened = old.coarsened;
                shared
            }
            None => {
                let Some(made) = make(self) else { return };
                let shared = Shared::new(made.as_ref());
                shape = Some(made);
                shared
            }
        };
        let paths = Paths::new(placements, shared.bounds, context.camera, context.cancel);
        let Some((classes, pixels)) = paths.classify() else {
            let why = format!("no memory for {} instances", placements.count());
            return self.drop_prim(path, Code::Budget, &why);
        };
        if context.cancel.load(Ordering::Relaxed) {
            return;
        }
        let is = |wanted: Class| move |class: &&Class| **class == wanted;
        let lost = classes.iter().filter(is(Class::LOST)).count();
        let alone = classes.iter().filter(is(Class::ALONE)).count();
        let any_shared = lost + alone < classes.len();
        let rate = quantized(pixels);
        let finer = |diced: f64| {
            context.settings.keep_finer && diced > rate && diced < rate * LARGEST_EXCESS
        };
        let kept = shared
            .diced
            .take()
            .filter(|(_, diced)| *diced == rate || finer(*diced));
        if shape.is_none() && (alone > 0 || (any_shared && kept.is_none())) {
            self.warnings.clear();
            self.coarsened &= kept.is_some();
            shape = make(self);
            if shape.is_none() {
                return;
            }
        }
        let shape = shape.as_deref();
        if any_shared {
            self.segments = self.segments.max(shared.point_segments);
            let dice = |shape| self.dice_shared(path, shape, &shared, rate, context);
            let diced = kept.or_else(|| shape.and_then(dice));
            if let Some((geometry, _)) = &diced {
                let winding = Winding::of(shared.left_handed);
                self.place_sets(path, &paths, &classes, geometry, &winding);
            }
            shared.diced = diced;
        }
        self.shape_warnings.clone_from(&self.warnings);
        if lost > 0 {
            let of = classes.len();
            let text = format!("{lost} of {of} instances have no finite transform; dropped");
            self.warn(path, Code::NotFinite, text);
        }
        for number in (0..classes.len()).filter(|&i| classes[i] == Class::ALONE) {
            let number = number as u64;
            let matrix = |t: f64| placements.matrix(number, t);
            if let Some(shape) = shape {
                let id = placements.id(number);
                let before = self.placed.len();
                let flat = Flat::OneOfMany(shape);
                self.flatten(path, flat, &matrix, &paths.keys, id, context);
                for placed in &mut self.placed[before..] {
                    let own = |&link: &usize| vec![placements.instance_of(number, link)];
                    placed.numbers = self.given.links.iter().map(own).collect();
                }
            }
        }
        self.shared = Some(shared);
    }

    /// Dices in object space.
    fn dice_shared(
        &mut self,
        path: &str,
        shape: &dyn Shape,
        shared: &Shared,
        rate: f64,
        context: &Context<'_>,
    ) -> Option<(Arc<ObjectGeometry>, f64)> {
        let points = PointPath::identity(&shape.points().times, shared.bounds.centre());
        let metric = RasterMetric::uniform(rate as f32);
        let target = Target {
            path: &points,
            metric: &metric,
            instanced: true,
        };
        Some((self.build(path, shape, &target, context)?, rate))
    }

    /// Makes one set of each class.
    fn place_sets(
        &mut self,
        path: &str,
        paths: &Paths<'_>,
        classes: &[Class],
        geometry: &Arc<ObjectGeometry>,
        winding: &Winding,
    ) {
        let mut counts = [0usize; 256];
        for class in classes {
            counts[usize::from(class.0)] += 1;
        }
        let present = |class: &Class| counts[usize::from(class.0)] > 0;
        for class in (1..Class::ALONE.0).map(Class).filter(present) {
            let count = counts[usize::from(class.0)];
            let links = self.given.links.iter();
            let numbers = links.map(|&link| paths.numbers(class, classes, count, link));
            let set = paths.set(class, classes, count, geometry);
            let Some((set, numbers)) = set.zip(numbers.collect()) else {
                let text = format!("no memory for {count} of its instances; they are dropped");
                self.warn(path, Code::Budget, text);
                continue;
            };
            let pieces = set.key_times().map_or(0, |keys| keys.len() - 1);
            self.segments = self.segments.max(pieces);
            self.placed.push(PlacedSet {
                set: Arc::new(set),
                winding: winding.clone(),
                numbers,
            });
        }
    }
}

/// Pixels per object-space unit of the placement that is largest.
pub(super) fn largest_pixels(
    placements: &Placements,
    bounds: &ObjectBounds,
    camera: &Camera,
    cancel: &AtomicBool,
) -> f64 {
    let paths = Paths::new(placements, *bounds, camera, cancel);
    paths.classify().map_or(0.0, |(_, pixels)| pixels)
}

/// The rate to dice for where `pixels` a unit are asked for: the same for nearly the same.
fn quantized(pixels: f64) -> f64 {
    if pixels > 0.0 && pixels.is_finite() {
        RATE_STEP.powf((pixels.ln() / RATE_STEP.ln()).ceil())
    } else {
        pixels
    }
}

/// Paths of all placements, at the times that matter. Once `cancel` is raised, none is followed: what comes of
/// them then is of no use.
struct Paths<'a> {
    placements: &'a Placements,
    bounds: ObjectBounds,
    keys: Vec<f64>,
    bends: bool,
    /// Key times, then camera times.
    views: Vec<RasterView>,
    /// At the views' times; where paths bend, then at the quarters of each segment.
    probes: Moments<'a>,
    /// At the key times, halved this many times.
    halved: Vec<OnceLock<Moments<'a>>>,
    cancel: &'a AtomicBool,
}

impl<'a> Paths<'a> {
    fn new(
        placements: &'a Placements,
        bounds: ObjectBounds,
        camera: &Camera,
        cancel: &'a AtomicBool,
    ) -> Self {
        let keys = placements.key_times();
        let bends = keys.len() > 1 && placements.bends();
        let mut times = keys.clone();
        if camera.is_moving() {
            times.extend_from_slice(camera.key_times());
        }
        let views = times.iter().map(|&t| camera.raster_view(t)).collect();
        if bends {
            times.extend(quarters(&keys));
        }
        Self {
            placements,
            bounds,
            bends,
            views,
            probes: placements.at(&times),
            halved: (0..=MAX_DEPTH).map(|_| OnceLock::new()).collect(),
            keys,
            cancel,
        }
    }

    fn halved(&self, depth: u8) -> &Moments<'a> {
        self.halved[usize::from(depth)]
            .get_or_init(|| self.placements.at(&subdivided(&self.keys, depth.into())))
    }

    /// The class of every placement, and pixels per object-space unit of the one that is largest; `None`
    /// where there is no memory for them.
    fn classify(&self) -> Option<(Vec<Class>, f64)> {
        let count = usize::try_from(self.placements.count()).ok()?;
        let mut classes = Vec::new();
        classes.try_reserve_exact(count).ok()?;
        classes.resize(count, Class::LOST);
        let pixels = classes
            .par_chunks_mut(CHUNK)
            .enumerate()
            .map(|(chunk, classes)| {
                if self.cancel.load(Ordering::Relaxed) {
                    return 0.0;
                }
                let mut walker = self.probes.walker();
                let mut most = 0.0f64;
                for (i, class) in classes.iter_mut().enumerate() {
                    let number = (chunk * CHUNK + i) as u64;
                    let matrices = walker.matrices(number);
                    if !matrices.iter().all(is_usable) {
                        continue;
                    }
                    *class = self.class(number, matrices);
                    if *class != Class::ALONE {
                        let seen = self.views.iter().zip(matrices);
                        let pixels = seen.map(|(view, m)| instance_pixels(view, m, &self.bounds));
                        most = pixels.fold(most, f64::max);
                    }
                }
                most
            })
            .reduce(|| 0.0, f64::max);
        Some((classes, pixels))
    }

    /// The class of a placement with these matrices at the probes' times.
    fn class(&self, number: u64, matrices: &[DAffine3]) -> Class {
        let at_keys = &matrices[..self.keys.len()];
        let at_quarters = &matrices[self.views.len()..];
        let first = &matrices[0];
        if matrices.iter().all(|m| m == first) && self.least_depth(number) == 0 {
            return if first.matrix3 == glam::DMat3::IDENTITY {
                Class::TRANSLATED
            } else if is_invertible(&[*first]) {
                Class::FIXED
            } else {
                Class::ALONE
            };
        }
        let depth = self.depth(number, matrices, at_keys, at_quarters);
        let sound = match depth {
            0 => is_invertible(at_keys),
            _ => is_invertible(self.halved(depth).walker().matrices(number)),
        };
        match sound {
            true => Class::moving(depth),
            false => Class::ALONE,
        }
    }

    /// Halvings without which a spin may go unseen.
    fn least_depth(&self, number: u64) -> u8 {
        if !self.bends {
            return 0;
        }
        let pieces = self.placements.spin(number) / LARGEST_SPIN;
        let depth = pieces.log2().ceil().clamp(0.0, f64::from(MAX_DEPTH));
        self.most_depth().min(depth as u8)
    }

    fn most_depth(&self) -> u8 {
        let segments = self.keys.len() - 1;
        let fits = |depth: &u8| segments << *depth <= MAX_PIECES;
        (0..=MAX_DEPTH).filter(fits).max().unwrap_or(0)
    }

    /// Halvings that keep the path of a placement within the tolerance.
    fn depth(
        &self,
        number: u64,
        matrices: &[DAffine3],
        at_keys: &[DAffine3],
        at_quarters: &[DAffine3],
    ) -> u8 {
        if !self.bends {
            return 0;
        }
        let least = self.least_depth(number);
        let error = match least {
            0 => self.chord_error(at_keys, at_quarters),
            _ => {
                let times = subdivided(&self.keys, least.into());
                let quarters = self.placements.at(&quarters(&times));
                let mut between = quarters.walker();
                let mut ends = self.halved(least).walker();
                self.chord_error(ends.matrices(number), between.matrices(number))
            }
        };
        let finest = self
            .views
            .iter()
            .zip(matrices)
            .map(|(view, m)| {
                let scale = largest_scale(m).max(f64::MIN_POSITIVE);
                // Pixels per world unit: the object's own scale is not part of it.
                pixels_per_unit(view, m, &self.bounds) / scale
            })
            .fold(0.0f64, f64::max);
        let ratio = error * finest / CHORD_TOLERANCE;
        let more = if ratio <= 1.0 {
            0.0
        } else {
            (ratio * ERROR_SAFETY).log(4.0).ceil()
        };
        let depth = (f64::from(least) + more).min(f64::from(MAX_DEPTH));
        self.most_depth().min(depth as u8)
    }

    /// How far straight pieces between `ends` are from the path at the quarters of each, in world
    /// units, for any point of the prim's bounds.
    fn chord_error(&self, ends: &[DAffine3], quarters: &[DAffine3]) -> f64 {
        let (centre, radius) = (self.bounds.centre(), self.bounds.radius());
        let mut worst = 0.0f64;
        for (w, between) in ends.windows(2).zip(quarters.chunks_exact(3)) {
            for (m, f) in between.iter().zip([0.25, 0.5, 0.75]) {
                let chord = lerp(&w[0], &w[1], f);
                let moved = m.transform_point3(centre) - chord.transform_point3(centre);
                let turned = m.matrix3 - chord.matrix3;
                let turned = turned
                    .to_cols_array()
                    .iter()
                    .map(|x| x * x)
                    .sum::<f64>()
                    .sqrt();
                worst = worst.max(moved.length() + turned * radius);
            }
        }
        worst
    }

    /// The instance of instancer `link` that each placement of a class is in; `None` where there is no
    /// memory for it.
    fn numbers(
        &self,
        class: Class,
        classes: &[Class],
        count: usize,
        link: usize,
    ) -> Option<Vec<u32>> {
        let mut numbers = Vec::new();
        numbers.try_reserve_exact(count).ok()?;
        let of_class = (0u64..).zip(classes).filter(|(_, c)| **c == class);
        numbers.extend(of_class.map(|(number, _)| self.placements.instance_of(number, link)));
        Some(numbers)
    }

    /// The placements of one class as a set; `None` where there is no memory for it.
    fn set(
        &self,
        class: Class,
        classes: &[Class],
        count: usize,
        geometry: &Arc<ObjectGeometry>,
    ) -> Option<InstanceSet> {
        let object = Arc::clone(geometry);
        let origin = geometry.mesh().origin;
        let id = |number| self.placements.id(number);
        Some(match class {
            Class::TRANSLATED => {
                let shift = |n, m: &[DAffine3], out: &mut [Shift]| {
                    out[0] = Shift::new(m[0].translation, origin, id(n));
                };
                let moments = self.placements.at(&self.keys[..1]);
                let shifts = self.fill(class, classes, count, 1, &moments, shift)?;
                InstanceSet::translated(object, shifts)
            }
            Class::FIXED => {
                let fixed = |n, m: &[DAffine3], out: &mut [Record]| {
                    out[0] = Record::fixed(&m[0], origin, id(n));
                };
                let moments = self.placements.at(&self.keys[..1]);
                let records = self.fill(class, classes, count, 1, &moments, fixed)?;
                InstanceSet::fixed(object, records)
            }
            Class(moving) => {
                let depth = moving - Class::MOVING.0;
                let times = subdivided(&self.keys, depth.into());
                let keys = |n, m: &[DAffine3], out: &mut [Record]| {
                    for (out, m) in out.iter_mut().zip(m) {
                        *out = Record::key(m, origin, id(n));
                    }
                };
                let width = times.len();
                let records = self.fill(class, classes, count, width, self.halved(depth), keys)?;
                let times = times.iter().map(|&t| t as f32).collect();
                InstanceSet::moving(object, times, records)
            }
        })
    }

    /// Calls `make(number, matrices, out)` for every placement of `class`, with `width` places to fill.
    fn fill<T: Default + Clone + Send>(
        &self,
        class: Class,
        classes: &[Class],
        count: usize,
        width: usize,
        moments: &Moments<'_>,
        make: impl Fn(u64, &[DAffine3], &mut [T]) + Sync,
    ) -> Option<Vec<T>> {
        let mut all = Vec::new();
        all.try_reserve_exact(count.checked_mul(width)?).ok()?;
        all.resize(count * width, T::default());
        let mut parts = Vec::with_capacity(classes.len().div_ceil(CHUNK));
        let mut rest = all.as_mut_slice();
        for (chunk, classes) in classes.chunks(CHUNK).enumerate() {
            let here = classes.iter().filter(|&&c| c == class).count();
            let (part, others) = rest.split_at_mut(here * width);
            rest = others;
            parts.push((chunk * CHUNK, classes, part));
        }
        parts.into_par_iter().for_each(|(first, classes, part)| {
            if self.cancel.load(Ordering::Relaxed) {
                return;
            }
            let mut walker = moments.walker();
            let numbers = classes.iter().enumerate().filter(|(_, c)| **c == class);
            for ((i, _), out) in numbers.zip(part.chunks_exact_mut(width)) {
                let number = (first + i) as u64;
                make(number, walker.matrices(number), out);
            }
        });
        Some(all)
    }
}

/// The quarters of each segment between `times`.
fn quarters(times: &[f64]) -> Vec<f64> {
    let of = |w: &[f64]| [0.25, 0.5, 0.75].map(|f| w[0] + (w[1] - w[0]) * f);
    times.windows(2).flat_map(of).collect()
}

#[cfg(test)]
#[path = "instances_tests.rs"]
mod tests;
