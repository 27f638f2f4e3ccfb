//! Occlusion rays from first hits: what they cost, and how much alike the ways are that rays of a group take, sorted or not.
//!
//! Lanes that run together are done when the last is. Of a group of 32, the efficiency is the tests that its rays need
//! over 32 times those of the ray that needs most; and the fewer different nodes it opens, the more of them are in a cache.

use std::collections::HashSet;
use std::error::Error;
use std::sync::Arc;

use glam::Vec3;
use hdtrapeze_core::trace::{Ray, TraceCounts, World};
use hdtrapeze_gpu::occlude::{Before, Scattered};
use hdtrapeze_gpu::{GpuScene, Occluder, Occlusion, SecondaryStage, Tracer};
use hdtrapeze_shaders::layout::{Hit, Ray as RayThere};
use rayon::prelude::*;

/// Rays that run together.
const GROUP: usize = 32;
/// Groups of a batch whose nodes are told.
const TOLD: usize = 256;

/// Work of occlusion rays.
#[derive(Default)]
struct Work {
    rays: usize,
    counts: TraceCounts,
    /// Node tests and micropolygon tests that lanes of groups wait for.
    waited: [u64; 2],
    /// Groups of which nodes are told, and how many different ones they open.
    groups: usize,
    nodes: usize,
    sort: f64,
    occlude: f64,
}

/// Rays and their hits, on a device.
struct Met {
    rays: wgpu::Buffer,
    hits: wgpu::Buffer,
    len: usize,
}

pub struct Occlusions {
    tracer: Tracer,
    occluder: Occluder,
    /// The first stage there, where the CPU is to run some.
    first: Option<SecondaryStage>,
}

impl Occlusions {
    pub fn new(tracer: Tracer, first: Option<SecondaryStage>) -> Self {
        Self {
            first,
            occluder: Occluder::new(Arc::clone(tracer.device())),
            tracer,
        }
    }

    pub fn head() {
        say!(
            "{:<8} {:<7} {:<9} {:>7} {:>7} {:>7} {:>9} {:>9} {:>8} {:>8} {:>9} {:>8}",
            "scene",
            "motion",
            "order",
            "Mrays",
            "nodes",
            "cells",
            "nodes eff",
            "cells eff",
            "distinct",
            "sort s",
            "Mrays/s",
            "differ"
        );
    }

    /// Prints a row for rays as they stand, and one for rays in order; in `different` of them answers may not be the CPU's.
    pub fn rows(
        &self,
        name: &str,
        world: &World,
        scene: &GpuScene,
        rays: &[Ray],
        different: f64,
    ) -> Result<(), Box<dyn Error>> {
        for (order, sorted) in [("numbered", false), ("sorted", true)] {
            let mut work = Work::default();
            let (mut differ, mut compared) = (0, 0);
            let (mut apart, mut shares) = (0, 0);
            let mut first = 0;
            let most = self.occluder.most_hits(Occlusion::default().samples);
            for rays in rays.chunks(most) {
                let occlusion = Occlusion {
                    first,
                    sorted,
                    ..Occlusion::default()
                };
                first += rays.len() as u32;
                let met = self.met(scene, rays)?;
                if let Some(first) = self.first {
                    let before = Before { first, world };
                    apart += self.apart(scene, &met, before, &occlusion)?;
                    shares += met.len;
                }
                let mut scattered = self.scattered(scene, &met, &occlusion)?;
                if sorted {
                    let seconds = self.occluder.sort(scene, &mut scattered, true)?;
                    work.sort += seconds.unwrap_or(0.0);
                }
                if compared == 0 {
                    (differ, compared) = self.differences(world, scene, &scattered)?;
                }
                self.add(scene, &scattered, &mut work)?;
            }
            let share = f64::from(differ) / f64::from(compared);
            if share > different {
                return Err(format!("{share} of the answers differ").into());
            }
            let per_ray = |count: u64| count as f64 / work.counts.rays as f64;
            let efficiency = |tests: u64, waited: u64| tests as f64 / waited.max(1) as f64;
            say!(
                "{name:<16} {order:<9} {:>7.2} {:>7.2} {:>7.2} {:>9.3} {:>9.3} {:>8.1} {:>8.3} {:>9.1} {share:>8.6}",
                work.counts.rays as f64 * 1e-6,
                per_ray(work.counts.node_tests),
                per_ray(work.counts.cell_tests),
                efficiency(work.counts.node_tests, work.waited[0]),
                efficiency(work.counts.cell_tests, work.waited[1]),
                work.nodes as f64 / work.groups.max(1) as f64,
                work.sort,
                work.rays as f64 / work.occlude * 1e-6,
            );
            if let Some(first) = self.first {
                say!(
                    "  from {} on: {apart} of {shares} shares differ",
                    first.name()
                );
            }
        }
        Ok(())
    }

    /// What these rays meet first.
    fn met(&self, scene: &GpuScene, rays: &[Ray]) -> Result<Met, Box<dyn Error>> {
        // Misses send no rays: only hits are left to be numbered.
        let there = self.occluder.upload(rays)?.rays;
        let batch = self
            .tracer
            .batch_of(scene, &there, rays.len(), false, false)?;
        self.tracer.run(&batch)?;
        let mut hits = vec![Hit::default(); rays.len()];
        self.tracer.device().fetch(batch.hits(), &mut hits)?;
        let met = |(_, hit): &(&Ray, &Hit)| hit.instance != u32::MAX;
        let rays: Vec<Ray> = rays
            .iter()
            .zip(&hits)
            .filter(met)
            .map(|(r, _)| *r)
            .collect();
        hits.retain(|hit| hit.instance != u32::MAX);
        let device = self.tracer.device();
        Ok(Met {
            rays: self.occluder.upload(&rays)?.rays,
            hits: device.upload("hits", bytemuck::cast_slice(&hits))?,
            len: rays.len(),
        })
    }

    /// How many shares are others where the CPU runs some stages.
    fn apart(
        &self,
        scene: &GpuScene,
        met: &Met,
        before: Before<'_>,
        occlusion: &Occlusion,
    ) -> Result<usize, Box<dyn Error>> {
        let first = [&met.rays, &met.hits];
        let (whole, _) = self
            .occluder
            .shares(scene, first, met.len, occlusion, false)?;
        let some = self
            .occluder
            .shares_from(before, scene, first, met.len, occlusion)?;
        let (mut a, mut b) = (vec![0.0f32; met.len], vec![0.0f32; met.len]);
        self.tracer.device().fetch(&whole, &mut a)?;
        self.tracer.device().fetch(&some, &mut b)?;
        Ok(a.iter().zip(&b).filter(|(a, b)| a != b).count())
    }

    /// Occlusion rays of what was met.
    fn scattered(
        &self,
        scene: &GpuScene,
        met: &Met,
        occlusion: &Occlusion,
    ) -> Result<Scattered, Box<dyn Error>> {
        let first = [&met.rays, &met.hits];
        let (sites, _) = self.occluder.sites(scene, first, met.len, false)?;
        let (scattered, _) = self.occluder.scatter(&sites, met.len, occlusion, false)?;
        Ok(scattered)
    }

    fn fetched(&self, scattered: &Scattered) -> Result<Vec<RayThere>, Box<dyn Error>> {
        let mut rays = vec![RayThere::default(); scattered.len];
        self.tracer.device().fetch(&scattered.rays, &mut rays)?;
        Ok(rays)
    }

    /// How many answers are not the CPU's, of so many.
    fn differences(
        &self,
        world: &World,
        scene: &GpuScene,
        scattered: &Scattered,
    ) -> Result<(u32, u32), Box<dyn Error>> {
        let (occluded, _) = self.occluder.occlude(scene, scattered, false)?;
        let mut words = vec![0u32; scattered.len.div_ceil(32)];
        self.tracer.device().fetch(&occluded, &mut words)?;
        let rays = self.fetched(scattered)?;
        let some = &rays[..rays.len().min(1 << 17)];
        let differ = some.par_iter().enumerate().filter(|(i, ray)| {
            let here = world.occluded(&to_core(ray), &mut TraceCounts::default());
            here != (words[i / 32] >> (i % 32) & 1 != 0)
        });
        Ok((differ.count() as u32, some.len() as u32))
    }

    fn add(
        &self,
        scene: &GpuScene,
        scattered: &Scattered,
        work: &mut Work,
    ) -> Result<(), Box<dyn Error>> {
        let (_, seconds) = self.occluder.occlude(scene, scattered, true)?;
        work.occlude += seconds.unwrap_or(f64::NAN);
        work.rays += scattered.len;
        let counts = self.occluder.counts(scene, scattered)?;
        let mut order: Vec<u32> = (0..scattered.len as u32).collect();
        if let Some(there) = &scattered.order {
            self.tracer.device().fetch(there, &mut order)?;
        }
        let rays = self.fetched(scattered)?;
        let groups = order.chunks_exact(GROUP);
        let step = groups.len().div_ceil(TOLD).max(1);
        let mut told = Vec::new();
        for (i, group) in groups.enumerate() {
            let each = group.iter().map(|&place| counts[place as usize]);
            let most = each.clone().fold([0; 2], |[n, c], count| {
                [n.max(count.node_tests), c.max(count.cell_tests)]
            });
            work.counts = each.fold(work.counts, |a, b| a + b);
            for (waited, most) in work.waited.iter_mut().zip(most) {
                *waited += GROUP as u64 * most;
            }
            if i % step == 0 {
                told.extend(group.iter().map(|&place| to_core(&rays[place as usize])));
            }
        }
        let visits = self.occluder.visits(scene, &self.occluder.upload(&told)?)?;
        for group in visits.chunks(GROUP) {
            let nodes: HashSet<u32> = group.iter().flatten().copied().collect();
            work.nodes += nodes.len();
            work.groups += 1;
        }
        Ok(())
    }
}

fn to_core(ray: &RayThere) -> Ray {
    Ray {
        origin: Vec3::from_array(ray.origin),
        dir: Vec3::from_array(ray.dir),
        time: ray.time,
        t_min: ray.t_min,
        t_max: ray.t_max,
    }
}
