//! Samples of one tile: trace, shade, film; [`super::generate`] draws them.
//!
//! Rays are traced in packets from one small pixel block, or a tile, near each other in time, or from one place of a large surface. Transparent surfaces
//! are composited front to back by asking for the next hit after the last, up to [`MAX_LAYERS`].

use std::ops::Range;
use std::sync::atomic::AtomicBool;

use glam::Vec3;
use rayon::prelude::*;

use super::elsewhere::{Made, Stage};
use super::generate::{Generator, Job, TileSamples, is_sorted_as_one};
use super::prepared::Prepared;
use crate::camera::Projector;
use crate::film::tile::{FirstHit, Keeps, MeanValues, PixelSums, PrimvarSample, Sample, Tile};
use crate::shade::{ChannelAccess, camera_lit};
use crate::trace::packet::PACKET;
use crate::trace::surface_order::{Expected, Usual, by_surface, expected, probed};
use crate::trace::{Hit, Ray, TraceCounts};

/// Transparent layers composited along one ray; what lies behind is left out.
pub const MAX_LAYERS: usize = 64;
/// Transmittance below which what lies behind cannot be seen: less than half a step of 10 bits.
pub const LEAST_TRANSMITTANCE: f32 = 1.0 / 2048.0;
/// Samples that are shaded before those whose values are asked for from memory meanwhile.
const AHEAD: usize = 16;
/// What all tiles of a render share.
pub(super) struct Integrator<'a> {
    prepared: &'a Prepared,
    generator: Generator<'a>,
    keeps: Keeps,
    /// Those that are asked for.
    values: MeanValues,
    irradiance: f32,
    /// When the shutter opens and when it closes.
    projectors: [Projector; 2],
    /// Rays of one pixel go different ways, and what they meet is far from caches.
    by_surface: bool,
}

impl<'a> Integrator<'a> {
    pub fn new(prepared: &'a Prepared, keeps: Keeps) -> Self {
        Self {
            prepared,
            generator: Generator::new(prepared),
            keeps,
            values: prepared.mean_values(),
            irradiance: prepared.irradiance(),
            projectors: [0.0, 1.0].map(|time| prepared.camera.projector(time)),
            by_surface: (prepared.plan.has_time() || prepared.plan.has_lens())
                && prepared.world.is_far(),
        }
    }

    /// True where rays may go on behind their first hits.
    pub fn sees_through(&self) -> bool {
        self.prepared.plan.transparency_by.is_some()
    }

    /// Makes the trees that were left for later, until `cancel` is raised.
    pub fn make_trees(&self, cancel: &AtomicBool) {
        self.prepared.world.make_trees(cancel);
    }

    /// Takes samples until every pixel of `tile` has `target`.
    pub fn fill(&self, tile: &mut Tile, target: u32, counts: &mut TraceCounts) {
        if tile.samples >= target {
            return;
        }
        let plan = &self.prepared.plan;
        match (plan.has_matte(), plan.has_culling()) {
            (false, false) => self.fill_with::<false, false>(tile, target, counts),
            (true, false) => self.fill_with::<true, false>(tile, target, counts),
            (false, true) => self.fill_with::<false, true>(tile, target, counts),
            (true, true) => self.fill_with::<true, true>(tile, target, counts),
        }
    }

    /// `fill` for scenes with matte objects or culled sides, or for those without: these are not asked
    /// for any.
    fn fill_with<const MATTE: bool, const CULL: bool>(
        &self,
        tile: &mut Tile,
        target: u32,
        counts: &mut TraceCounts,
    ) {
        let drawn = TileSamples::of(tile, target);
        let mut primvars = PrimvarSample::new(self.keeps);
        let (mut jobs, mut blocks, mut found) = (Vec::new(), Vec::new(), Vec::new());
        let as_one = is_sorted_as_one(drawn.samples.len(), self.generator.has_time);
        // A tile's rays together where they are sorted or their order is looked for, while caches hold fewer for longer.
        let together = !CULL && (as_one || self.by_surface);
        let mut pixels = self.generator.blocks(&drawn).peekable();
        while let Some(block) = pixels.next() {
            let begin = jobs.len();
            self.generator.draw_block(&drawn, block, &mut jobs);
            if as_one {
                blocks.clear();
                blocks.push(0..jobs.len());
            } else {
                blocks.push(begin..jobs.len());
            }
            if !together || pixels.peek().is_none() {
                let told = &mut tile.expected;
                self.trace::<CULL>(&jobs, &blocks, &mut found, told, counts);
                let first = |i: usize| found[i].0;
                let found = found.iter().copied();
                self.film::<MATTE, CULL>(tile, &jobs, first, found, &mut primvars, counts);
                jobs.clear();
                blocks.clear();
            }
        }
        tile.samples = target;
    }

    /// See [`Prepared::mean_values`].
    pub fn mean_values(&self) -> MeanValues {
        self.values
    }

    /// Draws the rays that [`Self::fill`] traces, in its order.
    pub fn generator(&self) -> &Generator<'a> {
        &self.generator
    }

    /// The rest of [`Self::fill`]: `hits` are what the jobs met first, as traced elsewhere. What lies behind a transparent hit
    /// is asked for by the hit before it, whose distance must be rounded as it is here: those are traced again.
    pub fn film_tile(
        &self,
        tile: &mut Tile,
        target: u32,
        jobs: &[(usize, Job)],
        hits: &[Hit],
        counts: &mut TraceCounts,
    ) {
        let own = TraceCounts {
            rays: 1,
            ..TraceCounts::default()
        };
        let found = jobs.iter().zip(hits).map(|((_, job), hit)| {
            let mut own = own;
            let through = hit.is_hit() && self.prepared.hit_prim(hit).1.shading.opacity.is_some();
            match through {
                true => (self.first_hit(job, &mut own), own),
                false => (*hit, own),
            }
        });
        let first = |i: usize| hits[i];
        let primvars = &mut PrimvarSample::new(self.keeps);
        let plan = &self.prepared.plan;
        match (plan.has_matte(), plan.has_culling()) {
            (false, false) => self.film::<false, false>(tile, jobs, first, found, primvars, counts),
            (true, false) => self.film::<true, false>(tile, jobs, first, found, primvars, counts),
            (false, true) => self.film::<false, true>(tile, jobs, first, found, primvars, counts),
            (true, true) => self.film::<true, true>(tile, jobs, first, found, primvars, counts),
        }
        tile.samples = target;
    }

    /// What a job meets first.
    fn first_hit(&self, job: &Job, counts: &mut TraceCounts) -> Hit {
        let world = &self.prepared.world;
        match self.prepared.plan.has_culling() {
            false => world.next::<false>(&job.ray, None, counts),
            true => world.next::<true>(&job.ray, None, counts),
        }
    }

    /// The rest of [`Self::fill`] for samples that were shaded and filmed elsewhere.
    pub fn merge_tile(
        &self,
        tile: &mut Tile,
        target: u32,
        pixels: &[PixelSums],
        means: &[f32],
        counts: &mut TraceCounts,
    ) {
        let values = self.mean_values();
        let mut means = means.chunks_exact(values.stride().max(1));
        for (i, sums) in pixels.iter().enumerate() {
            tile.merge(i, sums, || {
                sums.hit
                    .is_hit()
                    .then(|| self.point_sample(&sums.hit, sums.time))
            });
            if let Some(means) = means.next() {
                tile.merge_means(i, values, means);
            }
        }
        counts.rays += pixels.len() as u64 * u64::from(target.saturating_sub(tile.samples));
        tile.samples = target;
    }

    /// What stages before `first` make of tiles.
    pub fn make(&self, tiles: &[TileSamples], first: Stage) -> Made {
        let mut made = Made::default();
        if first > Stage::Generate {
            let drawn = tiles
                .par_iter()
                .flat_map_iter(|tile| self.generator.draw_tile(tile));
            made.jobs = drawn.map(|(_, job)| job).collect();
        }
        let jobs = made.jobs.par_iter();
        if first > Stage::Trace {
            let trace = |job: &Job| self.first_hit(job, &mut TraceCounts::default());
            made.hits = jobs.clone().map(trace).collect();
        }
        let rays = jobs.zip(&made.hits);
        match first {
            Stage::Shade if self.sees_through() => {
                let met = rays.map(|(job, hit)| {
                    let mut met = Vec::new();
                    self.composite(job, hit, |hit, _| met.push(*hit));
                    met
                });
                let met: Vec<Vec<Hit>> = met.collect();
                let layers = met.iter().map(Vec::len).max().unwrap_or(0);
                let layer = |layer: usize| {
                    let hits = met.par_iter().map(|met| met.get(layer));
                    hits.map(|hit| hit.copied().unwrap_or(Hit::MISS)).collect()
                };
                made.behind = (1..layers).map(layer).collect();
            }
            Stage::Film => {
                let shade = |(job, hit): (&Job, &Hit)| {
                    let mut seen = Hit::MISS;
                    let sample = self.composite(job, hit, |hit, is_seen| {
                        if is_seen {
                            seen = *hit;
                        }
                    });
                    (sample, seen)
                };
                let samples: Vec<(Sample, PrimvarSample)>;
                (samples, made.hits) = rays.map(shade).unzip();
                made.colors = samples.iter().map(|(sample, _)| sample.color).collect();
                for (sample, primvars) in &samples {
                    let own = self.mean_values().of(sample.first.as_ref(), primvars);
                    made.values.extend(own);
                }
            }
            _ => {}
        }
        made
    }

    /// What a job sees, whose first hit this is, and primvars of that; `met` as [`Self::shade`] has it.
    fn composite(
        &self,
        job: &Job,
        first: &Hit,
        met: impl FnMut(&Hit, bool),
    ) -> (Sample, PrimvarSample) {
        let counts = &mut TraceCounts::default();
        let mut primvars = PrimvarSample::new(self.keeps);
        let asked = Asked {
            means: self.keeps.first_of_all(),
            point: false,
        };
        let sample = match self.prepared.plan.has_culling() {
            false => self.shade::<true, false>(job, first, asked, counts, &mut primvars, met),
            true => self.shade::<true, true>(job, first, asked, counts, &mut primvars, met),
        };
        (sample, primvars)
    }

    /// Shades and films what was traced, in the order of samples: sums have the same bits whatever was traced
    /// together. `first` gives the first hit of a job that comes later.
    fn film<const MATTE: bool, const CULL: bool>(
        &self,
        tile: &mut Tile,
        jobs: &[(usize, Job)],
        first: impl Fn(usize) -> Hit,
        found: impl Iterator<Item = (Hit, TraceCounts)>,
        primvars: &mut PrimvarSample,
        counts: &mut TraceCounts,
    ) {
        let wants_primvars = self.keeps.primvars().is_some();
        for (i, ((slot, job), (hit, mut own))) in jobs.iter().zip(found).enumerate() {
            if i % AHEAD == 0 {
                self.expect(jobs, &first, i + AHEAD);
            }
            let asked = Asked {
                means: self.keeps.first_of_all(),
                point: tile.is_nearest(*slot, job.distance2),
            };
            let sample = self.shade::<MATTE, CULL>(job, &hit, asked, &mut own, primvars, |_, _| {});
            let is_point = tile.add(*slot, &sample);
            if wants_primvars {
                let hit = sample.first.is_some().then_some(&*primvars);
                tile.add_primvars(*slot, hit, is_point);
            }
            *counts = *counts + own;
        }
    }

    /// Asks for what shading takes from memory of up to [`AHEAD`] jobs, from number `from` on.
    fn expect(&self, jobs: &[(usize, Job)], first: impl Fn(usize) -> Hit, from: usize) {
        if !self.wants_normals() {
            return;
        }
        let to = jobs.len().min(from + AHEAD);
        let hits = (from..to).map(|i| (first(i), jobs[i].1.ray.time));
        self.prepared.world.expect_normals(hits);
    }

    /// True where colors or other means are asked for that normals are needed for.
    fn wants_normals(&self) -> bool {
        self.keeps.color() || self.values.normal || self.values.n_eye
    }

    /// Traces the jobs of pixel blocks; `found` gets what each
    /// met first, and what that cost; where no cost is kept, `counts` gets it for all of them. `told` is what they are expected to meet,
    /// and what those that come next are.
    fn trace<const CULL: bool>(
        &self,
        jobs: &[(usize, Job)],
        blocks: &[Range<usize>],
        found: &mut Vec<(Hit, TraceCounts)>,
        told: &mut Option<Expected>,
        counts: &mut TraceCounts,
    ) {
        let world = &self.prepared.world;
        found.clear();
        if CULL {
            found.extend(jobs.iter().map(|(_, job)| {
                let mut own = TraceCounts::default();
                (world.next::<CULL>(&job.ray, None, &mut own), own)
            }));
            return;
        }
        found.resize(jobs.len(), (Hit::MISS, TraceCounts::default()));
        let Some((_, first)) = jobs.first() else {
            return;
        };
        let order = self.order(jobs, blocks, told, counts);
        let (mut rays, mut hits) = ([first.ray; PACKET], [Hit::MISS; PACKET]);
        let mut own = [TraceCounts::default(); PACKET];
        for order in order.chunks(PACKET) {
            let n = order.len();
            for (ray, &i) in rays.iter_mut().zip(order) {
                *ray = jobs[i as usize].1.ray;
            }
            match self.keeps.cost() {
                true => world.trace_packet(&rays[..n], &mut hits[..n], &mut own[..n]),
                false => world.trace_many(&rays[..n], &mut hits[..n], counts),
            }
            for (lane, &i) in order.iter().enumerate() {
                found[i as usize] = (hits[lane], own[lane]);
            }
        }
        if self.by_surface && told.is_none() {
            *told = expected(world, jobs.len(), |i| (jobs[i].1.ray, found[i].0));
        }
    }

    /// The order in which jobs are traced, so that those of a packet have much in common: by where they meet surfaces where that
    /// can be told and pays, else those of nearly one instant of each block.
    fn order(
        &self,
        jobs: &[(usize, Job)],
        blocks: &[Range<usize>],
        told: &mut Option<Expected>,
        counts: &mut TraceCounts,
    ) -> Vec<u32> {
        let by_time = self.prepared.plan.has_time();
        if self.by_surface {
            let ray = |i: usize| &jobs[i].1.ray;
            let usual = Usual { blocks, by_time };
            let world = &self.prepared.world;
            if told.is_none() {
                *told = probed(world, jobs.len(), ray, counts);
            }
            let order = told.and_then(|told| by_surface(world, &told, ray, usual));
            if let Some(order) = order {
                return order;
            }
            // These may tell more.
            *told = None;
        }
        if !by_time {
            return (0..jobs.len() as u32).collect();
        }
        // Times are not negative, so that their bits have their order.
        let key = |(i, (_, job)): (u64, &(usize, Job))| {
            u64::from(job.ray.time.max(0.0).to_bits()) << 32 | i
        };
        let mut keys: Vec<u64> = (0..).zip(jobs).map(key).collect();
        for block in blocks {
            keys[block.clone()].sort_unstable();
        }
        keys.into_iter().map(|key| key as u32).collect()
    }

    /// Composites what the ray meets, front to back. A matte object takes its share of the ray away
    /// and gives nothing for it: neither colour nor alpha, nor the values of a first hit. Of the first hit, what is `asked` for is
    /// looked up, and `primvars` becomes its. `met` hears of each hit that is taken in, and whether it is what is seen first.
    fn shade<const MATTE: bool, const CULL: bool>(
        &self,
        job: &Job,
        first: &Hit,
        asked: Asked,
        counts: &mut TraceCounts,
        primvars: &mut PrimvarSample,
        mut met: impl FnMut(&Hit, bool),
    ) -> Sample {
        let mut color = Vec3::ZERO;
        let mut transmittance = 1.0f32;
        let mut held_out = 0.0f32;
        let mut found = None;
        let mut unseen = true;
        let wants_first = asked.means || asked.point;
        let mut hit = *first;
        for _ in 0..MAX_LAYERS {
            if !hit.is_hit() {
                break;
            }
            let first = (wants_first && unseen).then_some((asked, &mut *primvars));
            let (layer, opacity) = self.surface(&job.ray, &hit, first);
            let matte = MATTE && self.prepared.hit_prim(&hit).1.matte;
            let is_first = opacity > 0.0 && unseen;
            if is_first {
                unseen = false;
                found = (!matte).then_some(layer.first);
            }
            met(&hit, is_first && !matte);
            let before = transmittance;
            transmittance *= 1.0 - opacity;
            if transmittance < LEAST_TRANSMITTANCE {
                transmittance = 0.0;
            }
            if matte {
                held_out += before - transmittance;
            } else {
                color += layer.radiance * (opacity * before);
            }
            if transmittance == 0.0 {
                break;
            }
            let world = &self.prepared.world;
            hit = world.next::<CULL>(&job.ray, Some(&hit), counts);
        }
        if self.prepared.camera.lens_changes() {
            color *= self.prepared.camera.lens(job.ray.time).exposure;
        }
        let alpha = 1.0 - transmittance - held_out;
        Sample {
            weight: job.weight,
            distance2: job.distance2,
            color: [color.x, color.y, color.z, alpha.max(0.0)],
            first: found,
            cost: [counts.node_tests as f32, counts.cell_tests as f32],
        }
    }

    /// Shades one hit: radiance, opacity, and the AOV values that are asked for when it may be the first.
    fn surface(
        &self,
        ray: &Ray,
        hit: &Hit,
        first: Option<(Asked, &mut PrimvarSample)>,
    ) -> (Layer, f32) {
        let prepared = self.prepared;
        let world = &prepared.world;
        let (entry, prim) = prepared.hit_prim(hit);
        let shading = &prim.shading;
        let element = world.element(hit).unwrap_or(0);
        let channels = AtHit { prepared, hit };
        let opacity = shading.opacity.as_ref().map_or(1.0, |source| {
            let mut value = [0.0];
            source.read(element, ray.time, &channels, &mut value);
            value[0].clamp(0.0, 1.0)
        });
        // Both sides are lit alike, so only who asks for normals hears of which is seen.
        let asked_for = self.values.normal || self.values.n_eye;
        let sided = prim.double_sided && first.is_some() && asked_for;
        let (normal, n_eye) = match self.wants_normals() {
            true => self.normals(ray, hit, entry.facets.is_inverted(ray.time), sided),
            false => (Vec3::ZERO, Vec3::ZERO),
        };
        let radiance = if self.keeps.color() {
            let mut albedo = [0.0; 3];
            let color = &shading.color;
            color.read(element, ray.time, &channels, &mut albedo);
            camera_lit(Vec3::from_array(albedo), n_eye, self.irradiance)
        } else {
            Vec3::ZERO
        };
        let first = if let Some((asked, primvars)) = first {
            prepared.read_primvars(prim, element, ray.time, &channels, primvars);
            FirstHit {
                normal: normal.to_array(),
                n_eye: n_eye.to_array(),
                motion: match self.values.motion {
                    true => self.motion(hit),
                    false => [0.0; 2],
                },
                ..match asked.point {
                    true => self.point_hit(hit, ray.time),
                    false => FirstHit::default(),
                }
            }
        } else {
            FirstHit::default()
        };
        (Layer { radiance, first }, opacity)
    }

    /// What a point sample keeps of its first hit, and the primvars there.
    fn point_sample(&self, hit: &Hit, time: f32) -> (FirstHit, PrimvarSample) {
        let prepared = self.prepared;
        let mut primvars = PrimvarSample::new(self.keeps);
        if self.keeps.primvars().is_some() {
            let (_, prim) = prepared.hit_prim(hit);
            let element = prepared.world.element(hit).unwrap_or(0);
            let channels = AtHit { prepared, hit };
            prepared.read_primvars(prim, element, time, &channels, &mut primvars);
        }
        (self.point_hit(hit, time), primvars)
    }

    /// What a point sample keeps of its first hit.
    fn point_hit(&self, hit: &Hit, time: f32) -> FirstHit {
        let world = &self.prepared.world;
        let camera = &self.prepared.camera;
        let (_, prim) = self.prepared.hit_prim(hit);
        let element = world.element(hit).unwrap_or(0);
        let p = world.position(hit, time).unwrap_or(Vec3::ZERO);
        FirstHit {
            depth: camera.clip_depth(hit.t),
            camera_depth: hit.t,
            p: (p.as_dvec3() + camera.origin()).as_vec3().to_array(),
            prim_id: prim.pick_id,
            instance_id: world.instance_id(hit).unwrap_or(-1),
            element_id: element as i32,
            subset_id: prim.subset_of(element),
            ..FirstHit::default()
        }
    }

    /// Shading normals in the world and in camera space, of an `inverted` facet or another, on the side that is seen or, where
    /// it is not `sided`, on that of the surface.
    fn normals(&self, ray: &Ray, hit: &Hit, inverted: bool, sided: bool) -> (Vec3, Vec3) {
        let prepared = self.prepared;
        let normal = prepared.world.shading_normal(hit, ray.time);
        let normal = normal.unwrap_or(Vec3::ZERO);
        let normal = if inverted { -normal } else { normal };
        let normal = match sided {
            true => self.on_the_side_seen(normal, ray, hit),
            false => normal,
        };
        (normal, prepared.camera.normal_to_camera(normal, ray.time))
    }

    /// A normal, or its opposite where that is on the side of the facet that the ray sees.
    fn on_the_side_seen(&self, normal: Vec3, ray: &Ray, hit: &Hit) -> Vec3 {
        let facet = self.prepared.world.geometric_normal(hit, ray.time);
        let facet = facet.unwrap_or(Vec3::ZERO);
        if facet.dot(normal) * facet.dot(ray.dir) > 0.0 {
            -normal
        } else {
            normal
        }
    }

    /// Raster movement of the point that was hit, from shutter open to close.
    fn motion(&self, hit: &Hit) -> [f32; 2] {
        let Some([open, close]) = self.prepared.world.end_positions(hit) else {
            return [0.0; 2];
        };
        let [at_open, at_close] = &self.projectors;
        match (at_open.project(open), at_close.project(close)) {
            (Some(a), Some(b)) => (b - a).to_array(),
            _ => [0.0; 2],
        }
    }
}

/// What is asked for of the first hit of a sample.
#[derive(Clone, Copy, Debug)]
struct Asked {
    /// What is averaged over the samples of a pixel.
    means: bool,
    /// What one sample of each pixel gives, since this is the one.
    point: bool,
}

/// What sources ask about a hit.
struct AtHit<'a> {
    prepared: &'a Prepared,
    hit: &'a Hit,
}

impl ChannelAccess for AtHit<'_> {
    #[inline]
    fn smooth(&self, channel: usize, first: usize, out: &mut [f32]) {
        self.prepared
            .world
            .channel_from(self.hit, channel, first, out);
    }
    fn nearest(&self, channel: usize, first: usize, out: &mut [f32]) {
        let world = &self.prepared.world;
        world.channel_nearest(self.hit, channel, first, out);
    }
    fn instance(&self, level: usize) -> usize {
        self.prepared.instance(self.hit, level)
    }
}

struct Layer {
    radiance: Vec3,
    first: FirstHit,
}
