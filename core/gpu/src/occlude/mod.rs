//! Secondary rays on a device: how many of the rays that leave the first hits meet nothing.
//!
//! **Stages.** `site` tells where rays leave a first hit: off the surface, on the side that the first ray came from, at its
//! time. `scatter` sends rays from there, of the samples that camera rays are drawn with. `order` and `sort` put them in
//! an order in which those of a workgroup take nearly one way through the trees, which may be left out: answers have the
//! same bits. `occlude` tells whether each meets anything, a bit a ray, and `share` sums that up for each hit. Nothing crosses the
//! bus but what is read. [`Occluder::shares`] runs them all; each can be run alone. [`Occluder::shares_from`] has the first of them
//! run on the CPU ([`host`]), to find out which stage a difference comes from.
//!
//! Space: the world's, relative to its origin; times are in [0, 1] across the shutter; directions have unit length, so that
//! [`Occlusion::reach`] is in scene units.

pub mod host;

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use bytemuck::Pod;
use hdtrapeze_core::sample::{PatternKind, PixelSampler};
use hdtrapeze_core::trace::{self, TraceCounts};
use hdtrapeze_shaders::layout::{
    self, Ray, ScatterLaunch, ShareLaunch, Site, SiteLaunch, TraceLaunch,
};
use hdtrapeze_shaders::stage::{
    OccludePermutation, SCATTER_WORKGROUP, TRACE_WORKGROUP, Told, VISITS, scatter_source,
    share_source, site_source,
};
use wgpu::BufferUsages as Usage;

use super::kernel::{Binding, Kernel, Kernels, rows};
use super::order::Orderer;
use super::pace::{Pace, Sizes, Submitted};
use super::trace::{packed, unpacked};
use super::{Device, GpuError, GpuScene, SecondaryStage, pace};
pub use host::Before;

/// Rays that are asked about at once: 50 MB of them.
const LAUNCH: usize = 1 << 20;
/// The row that sites are pixels of, as `scatter.wgsl` has it.
const PATTERN: u32 = 0x4000_0000;
/// Storage buffers of the stage `occlude` where rays are in another order.
const ORDERED_BUFFERS: u32 = 9;

/// Which rays leave a first hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occlusion {
    /// Rays of each hit, at least 1; 4, 16, 64... make a net.
    pub samples: u32,
    /// Patterns of different seeds are independent.
    pub seed: u32,
    /// What is added to the numbers of hits, for their patterns: hits of one image that come in several batches are numbered on.
    pub first: u32,
    /// What is farther than so many scene units occludes nothing.
    pub reach: f32,
    /// Rays of neighbouring hits are taken in the order of direction and time, where the device binds enough buffers.
    pub sorted: bool,
}

impl Default for Occlusion {
    fn default() -> Self {
        Self {
            samples: 16,
            seed: 0,
            first: 0,
            reach: f32::INFINITY,
            sorted: true,
        }
    }
}

impl Occlusion {
    /// Its reach, as a device has it.
    fn finite_reach(&self) -> f32 {
        match self.reach.is_nan() {
            true => 0.0,
            false => self.reach.clamp(0.0, f32::MAX),
        }
    }
}

/// Seconds of the stages, by the device's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OcclusionSeconds {
    /// Of `site` and `scatter`.
    pub scatter: f64,
    /// Of `order` and `sort`.
    pub sort: f64,
    /// Of `occlude`.
    pub occlude: f64,
    /// Of `share`.
    pub share: f64,
}

/// Rays on a device, and the order in which they are best taken.
#[derive(Debug)]
pub struct Scattered {
    /// As the layout's [`Ray`], by their numbers.
    pub rays: wgpu::Buffer,
    /// How many.
    pub len: usize,
    /// Places of rays among them, each once.
    pub order: Option<wgpu::Buffer>,
}

/// Tells which rays meet anything, on a device. Pipelines are compiled once for each permutation.
#[derive(Debug)]
pub struct Occluder {
    device: Arc<Device>,
    orderer: Orderer,
    sites: Kernels<bool>,
    scatters: Kernels<bool>,
    occludes: Kernels<OccludePermutation>,
    shares: Kernels<()>,
    /// Of the stage `occlude`; the others do the same for each ray.
    pace: Pace,
}

impl Occluder {
    /// For this device.
    pub fn new(device: Arc<Device>) -> Self {
        Self::with_target(device, pace::TARGET)
    }

    /// For this device, which should be at one submission no longer than `target`.
    pub fn with_target(device: Arc<Device>, target: Duration) -> Self {
        Self {
            orderer: Orderer::new(Arc::clone(&device), target),
            sites: Kernels::default(),
            scatters: Kernels::default(),
            occludes: Kernels::default(),
            shares: Kernels::default(),
            pace: Pace::new(target, Sizes::RAYS),
            device,
        }
    }

    /// What the stage `occlude` has submitted by now.
    pub fn submitted(&self) -> Submitted {
        self.pace.submitted()
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// The share of rays from each of `len` first hits that meet nothing, by the numbers of the rays that met them: 1 for
    /// misses, and for micropolygons without area. Gives them as f32 on the device; and the seconds that the device took, where
    /// that is asked for and it can tell.
    ///
    /// # Errors
    /// They are more than the device takes at once ([`Occluder::most_hits`] are not), or it is lost.
    pub fn shares(
        &self,
        scene: &GpuScene,
        [rays, hits]: [&wgpu::Buffer; 2],
        len: usize,
        occlusion: &Occlusion,
        timed: bool,
    ) -> Result<(wgpu::Buffer, OcclusionSeconds), GpuError> {
        self.run(None, scene, [rays, hits], len, occlusion, timed)
    }

    /// The same, where the CPU runs the stages before one.
    ///
    /// # Errors
    /// As [`Occluder::shares`].
    pub fn shares_from(
        &self,
        before: Before<'_>,
        scene: &GpuScene,
        [rays, hits]: [&wgpu::Buffer; 2],
        len: usize,
        occlusion: &Occlusion,
    ) -> Result<wgpu::Buffer, GpuError> {
        let (shares, _) = self.run(Some(before), scene, [rays, hits], len, occlusion, false)?;
        Ok(shares)
    }

    fn run(
        &self,
        before: Option<Before<'_>>,
        scene: &GpuScene,
        first: [&wgpu::Buffer; 2],
        len: usize,
        occlusion: &Occlusion,
        timed: bool,
    ) -> Result<(wgpu::Buffer, OcclusionSeconds), GpuError> {
        let device = &*self.device;
        let here = |stage| before.and_then(|before| before.runs(stage));
        let mut seconds = OcclusionSeconds::default();
        let (sites, site) = match here(SecondaryStage::Site) {
            None => self.sites(scene, first, len, timed)?,
            Some(world) => {
                let hits: Vec<layout::Hit> = self.fetched(first[1], len)?;
                let hits: Vec<trace::Hit> = hits.iter().map(unpacked).collect();
                let sites = host::sites(world, &self.fetched(first[0], len)?, &hits);
                (device.upload("sites", bytemuck::cast_slice(&sites))?, None)
            }
        };
        let (mut scattered, scatter) = match here(SecondaryStage::Scatter) {
            None => self.scatter(&sites, len, occlusion, timed)?,
            Some(_) => {
                self.ray_count(len, occlusion.samples)?;
                let rays = host::scattered(&self.fetched(&sites, len)?, occlusion);
                let scattered = Scattered {
                    rays: device.upload("rays", bytemuck::cast_slice(&rays))?,
                    len: rays.len(),
                    order: None,
                };
                (scattered, None)
            }
        };
        seconds.scatter = site.unwrap_or(0.0) + scatter.unwrap_or(0.0);
        if occlusion.sorted {
            let took = self.sort_from(before, scene, &mut scattered, timed)?;
            seconds.sort = took.unwrap_or(0.0);
        }
        let (occluded, occlude) = match here(SecondaryStage::Occlude) {
            None => self.occlude(scene, &scattered, timed)?,
            Some(world) => {
                let rays: Vec<Ray> = self.fetched(&scattered.rays, scattered.len)?;
                let words = host::occluded(world, &rays);
                (
                    device.upload("occluded", bytemuck::cast_slice(&words))?,
                    None,
                )
            }
        };
        seconds.occlude = occlude.unwrap_or(0.0);
        let (shares, share) = self.share(&occluded, len, occlusion.samples, timed)?;
        seconds.share = share.unwrap_or(0.0);
        Ok((shares, seconds))
    }

    /// So many of what the device has there.
    fn fetched<T: Pod>(&self, from: &wgpu::Buffer, len: usize) -> Result<Vec<T>, GpuError> {
        let mut all = vec![T::zeroed(); len];
        self.device.fetch(from, &mut all)?;
        Ok(all)
    }

    /// Hits that fit into a batch of no more than so many rays that the device takes.
    pub fn most_hits(&self, samples: u32) -> usize {
        let rays = self.device.largest() / size_of::<Ray>() as u64;
        (rays.min(LAUNCH as u64) / u64::from(samples.max(1))).max(1) as usize
    }

    /// Where rays leave the first hits, as the layout's [`Site`], by the numbers of the rays that met them.
    ///
    /// # Errors
    /// They are more than the device takes at once, or it is lost.
    pub fn sites(
        &self,
        scene: &GpuScene,
        [rays, hits]: [&wgpu::Buffer; 2],
        len: usize,
        timed: bool,
    ) -> Result<(wgpu::Buffer, Option<f64>), GpuError> {
        let device = &*self.device;
        device.check()?;
        let sites = self.storage("sites", len * size_of::<Site>())?;
        let (count, row) = self.size(len);
        let mut seconds = None;
        for (number, page) in scene.pages.iter().enumerate() {
            let [_, vertices, words, objects, instanced, matrices] = &page.group;
            let [instances, places] = page.instances();
            let launch = SiteLaunch {
                ray_count: len as u32,
                row,
                page: number as u32,
                instances,
                places,
            };
            let launch = device.uniform("launch", &launch)?;
            let time = page.permutation.time;
            let kernel = self.sites.get(time, || {
                let batch = [
                    Binding::Read,
                    Binding::Read,
                    Binding::Uniform,
                    Binding::Write,
                ];
                let groups: [&[Binding]; 2] = [&[Binding::Read; 5], &batch];
                Kernel::new(device, "site", &site_source(time), &groups)
            })?;
            let groups: [&[&wgpu::Buffer]; 2] = [
                &[vertices, words, objects, instanced, matrices],
                &[rays, hits, &launch, &sites],
            ];
            let launched = kernel.launch(device, &groups, count);
            add(&mut seconds, launched.run(device, timed)?);
        }
        Ok((sites, seconds))
    }

    /// Rays from `len` sites, all of a site's one after the other.
    ///
    /// # Errors
    /// They are more than the device takes at once, or it is lost.
    pub fn scatter(
        &self,
        sites: &wgpu::Buffer,
        len: usize,
        occlusion: &Occlusion,
        timed: bool,
    ) -> Result<(Scattered, Option<f64>), GpuError> {
        let device = &*self.device;
        device.check()?;
        let samples = occlusion.samples.max(1);
        // First of all: a pattern of as many samples may be too large for the host, too.
        let count = self.ray_count(len, samples)?;
        let sampler = PixelSampler::new(samples, occlusion.seed);
        let words: Vec<[u32; 5]> = (0..samples).map(|i| sampler.word(i)).collect();
        let words = device.upload("samples", bytemuck::cast_slice(&words))?;
        let rays = self.storage("rays", count * size_of::<Ray>())?;
        let (workgroups, row) = self.size(count);
        let seed = sampler.seed();
        let launch = ScatterLaunch {
            seed: [seed as u32, (seed >> 32) as u32],
            digits: sampler.digits(),
            samples,
            ray_count: count as u32,
            row,
            first: occlusion.first,
            reach: occlusion.finite_reach(),
        };
        let launch = device.uniform("launch", &launch)?;
        let net = sampler.kind() == PatternKind::Net;
        let kernel = self.scatters.get(net, || {
            let groups: [&[Binding]; 1] = [&[
                Binding::Uniform,
                Binding::Read,
                Binding::Read,
                Binding::Write,
            ]];
            Kernel::new(device, "scatter", &scatter_source(net), &groups)
        })?;
        let buffers: [&[&wgpu::Buffer]; 1] = [&[&launch, &words, sites, &rays]];
        let launched = kernel.launch(device, &buffers, workgroups);
        let seconds = launched.run(device, timed)?;
        let scattered = Scattered {
            rays,
            len: count,
            order: None,
        };
        Ok((scattered, seconds))
    }

    /// Rays of so many sites; they are numbered, and have to fit.
    fn ray_count(&self, len: usize, samples: u32) -> Result<usize, GpuError> {
        let count = len.saturating_mul(samples.max(1) as usize);
        let bytes = (count as u64).saturating_mul(size_of::<Ray>() as u64);
        match u32::try_from(count).is_err() || bytes > self.device.largest() {
            true => Err(self.device.too_large("rays", bytes, self.device.largest())),
            false => Ok(count),
        }
    }

    /// Rays that are there already, each with its place as its number.
    ///
    /// # Errors
    /// They are more than the device takes at once, or it is lost.
    pub fn upload(&self, rays: &[trace::Ray]) -> Result<Scattered, GpuError> {
        let packed: Vec<Ray> = (0..).zip(rays).map(packed).collect();
        Ok(Scattered {
            rays: self.device.upload("rays", bytemuck::cast_slice(&packed))?,
            len: rays.len(),
            order: None,
        })
    }

    /// Finds the order in which rays are best taken through `scene`. Does nothing where the device binds too few buffers for
    /// that.
    ///
    /// # Errors
    /// They are more than the device takes at once, or it is lost.
    pub fn sort(
        &self,
        scene: &GpuScene,
        rays: &mut Scattered,
        timed: bool,
    ) -> Result<Option<f64>, GpuError> {
        self.sort_from(None, scene, rays, timed)
    }

    /// The same, where the CPU runs the stages before one.
    ///
    /// # Errors
    /// As [`Occluder::sort`].
    pub fn sort_from(
        &self,
        before: Option<Before<'_>>,
        scene: &GpuScene,
        rays: &mut Scattered,
        timed: bool,
    ) -> Result<Option<f64>, GpuError> {
        if self.storage_buffers() < ORDERED_BUFFERS {
            return Ok(None);
        }
        let (device, len) = (&*self.device, rays.len);
        let here = |stage| before.and_then(|before| before.runs(stage)).is_some();
        let moves = scene.pages.iter().any(|page| page.permutation.time);
        let launch = self.orderer.launch(len, moves);
        let (keyed, mut seconds) = match here(SecondaryStage::Order) {
            false => self.orderer.keys(&rays.rays, &launch, timed)?,
            true => {
                let keys = host::keys(&self.fetched(&rays.rays, len)?, &launch);
                let places: Vec<u32> = (0..len as u32).collect();
                let keyed = [
                    device.upload("keys", bytemuck::cast_slice(&keys))?,
                    device.upload("order", bytemuck::cast_slice(&places))?,
                ];
                (keyed, None)
            }
        };
        let (order, sort) = match here(SecondaryStage::Sort) {
            false => self.orderer.sort(keyed, &launch, timed)?,
            true => {
                let order = host::sorted(&self.fetched(&keyed[0], len)?);
                (device.upload("order", bytemuck::cast_slice(&order))?, None)
            }
        };
        rays.order = Some(order);
        add(&mut seconds, sort);
        Ok(seconds)
    }

    /// Whether each ray meets anything from its `t_min` to its `t_max`: bit `number % 32` of word `number / 32` is 1 where it
    /// does.
    ///
    /// # Errors
    /// They are more than the device takes at once, or it is lost.
    pub fn occlude(
        &self,
        scene: &GpuScene,
        rays: &Scattered,
        timed: bool,
    ) -> Result<(wgpu::Buffer, Option<f64>), GpuError> {
        let (occluded, _, seconds) = self.told(scene, rays, Told::None, timed)?;
        Ok((occluded, seconds))
    }

    /// The share of bits that are 0, of `samples` a hit.
    ///
    /// # Errors
    /// They are more than the device takes at once, or it is lost.
    pub fn share(
        &self,
        occluded: &wgpu::Buffer,
        len: usize,
        samples: u32,
        timed: bool,
    ) -> Result<(wgpu::Buffer, Option<f64>), GpuError> {
        let device = &*self.device;
        let shares = self.storage("shares", len * size_of::<f32>())?;
        let (workgroups, row) = self.size(len);
        let launch = ShareLaunch {
            hit_count: len as u32,
            row,
            samples: samples.max(1),
        };
        let launch = device.uniform("launch", &launch)?;
        let kernel = self.shares.get((), || {
            let groups: [&[Binding]; 1] = [&[Binding::Uniform, Binding::Read, Binding::Write]];
            Kernel::new(device, "share", &share_source(), &groups)
        })?;
        let buffers: [&[&wgpu::Buffer]; 1] = [&[&launch, occluded, &shares]];
        let launched = kernel.launch(device, &buffers, workgroups);
        let seconds = launched.run(device, timed)?;
        Ok((shares, seconds))
    }

    /// Whether each ray meets anything, as [`trace::World::occluded_many`], but for rounding: see `slabs.wgsl` and `cells.wgsl`.
    /// Rays that are not finite meet nothing. Asks the first `min(rays.len(), found.len())`, sorted where that is asked for.
    ///
    /// # Errors
    /// The device failed or is lost; nothing of `found` is then to be used.
    pub fn occluded(
        &self,
        scene: &GpuScene,
        rays: &[trace::Ray],
        sorted: bool,
        found: &mut [bool],
    ) -> Result<(), GpuError> {
        for (rays, found) in rays.chunks(LAUNCH).zip(found.chunks_mut(LAUNCH)) {
            let mut there = self.upload(rays)?;
            if sorted {
                self.sort(scene, &mut there, false)?;
            }
            let (occluded, _) = self.occlude(scene, &there, false)?;
            let mut words = vec![0u32; rays.len().div_ceil(32)];
            self.device.fetch(&occluded, &mut words)?;
            for (i, found) in found.iter_mut().enumerate().take(rays.len()) {
                *found = words[i / 32] >> (i % 32) & 1 != 0;
            }
        }
        Ok(())
    }

    /// What each ray costs, by its number.
    ///
    /// # Errors
    /// As [`Occluder::occlude`].
    pub fn counts(&self, scene: &GpuScene, rays: &Scattered) -> Result<Vec<TraceCounts>, GpuError> {
        let (_, counts, _) = self.told(scene, rays, Told::Counts, false)?;
        let mut each = vec![[0u32; 2]; rays.len];
        if let Some(counts) = counts {
            self.device.fetch(&counts, &mut each)?;
        }
        let of = |[nodes, cells]: [u32; 2]| TraceCounts {
            rays: 1,
            node_tests: nodes.into(),
            cell_tests: cells.into(),
        };
        Ok(each.into_iter().map(of).collect())
    }

    /// Which nodes and blocks each ray opens on the last page, by its number: the first [`VISITS`] of them.
    ///
    /// # Errors
    /// As [`Occluder::occlude`].
    pub fn visits(&self, scene: &GpuScene, rays: &Scattered) -> Result<Vec<Vec<u32>>, GpuError> {
        let (_, visits, _) = self.told(scene, rays, Told::Visits, false)?;
        let stride = 1 + VISITS as usize;
        let mut each = vec![0u32; rays.len * stride];
        if let Some(visits) = visits {
            self.device.fetch(&visits, &mut each)?;
        }
        let of = |ray: &[u32]| ray[1..=ray[0] as usize].to_vec();
        Ok(each.chunks(stride).map(of).collect())
    }

    /// Bits, what is told besides, and seconds.
    fn told(
        &self,
        scene: &GpuScene,
        rays: &Scattered,
        told: Told,
        timed: bool,
    ) -> Result<(wgpu::Buffer, Option<wgpu::Buffer>, Option<f64>), GpuError> {
        let device = &*self.device;
        device.check()?;
        let len = rays.len;
        let occluded = self.storage("occluded", 4 * len.div_ceil(32))?;
        let besides = match told {
            Told::None => None,
            Told::Counts => Some(self.storage("counts", 8 * len)?),
            Told::Visits => Some(self.storage("visits", 4 * (1 + VISITS as usize) * len)?),
        };
        let launch = |number: usize, some: Range<usize>| {
            let page = &scene.pages[number];
            let workgroups = (some.len() as u32).div_ceil(TRACE_WORKGROUP);
            let launch = TraceLaunch {
                root: page.root,
                ray_count: len as u32,
                row: rows(device, workgroups)[0] * TRACE_WORKGROUP,
                page: number as u32,
                radius: page.radius,
                pad: page.pad,
                first: some.start as u32,
                end: some.end as u32,
                ..TraceLaunch::default()
            };
            let launch = device.uniform("launch", &launch)?;
            let mut batch = vec![&rays.rays, &occluded, &launch];
            batch.extend(besides.as_ref());
            let scene = page.group.each_ref();
            let order: Vec<&wgpu::Buffer> = rays.order.iter().collect();
            let kernel = self.occlude_kernel(OccludePermutation {
                time: page.permutation.time,
                stack: page.permutation.stack,
                ordered: rays.order.is_some(),
                told,
            })?;
            Ok(match order.is_empty() {
                true => kernel.launch(device, &[&scene, &batch], workgroups),
                false => kernel.launch(device, &[&scene, &batch, &order], workgroups),
            })
        };
        let size = (scene.pages.len(), len);
        let seconds = self.pace.run(device, size, false, timed, launch)?;
        Ok((occluded, besides, seconds))
    }

    fn occlude_kernel(&self, permutation: OccludePermutation) -> Result<Arc<Kernel>, GpuError> {
        self.occludes.get(permutation, || {
            let batch = [
                Binding::Read,
                Binding::Write,
                Binding::Uniform,
                Binding::Write,
            ];
            let batch = &batch[..3 + usize::from(permutation.told != Told::None)];
            let groups: [&[Binding]; 3] = [&[Binding::Read; 6], batch, &[Binding::Read]];
            let groups = &groups[..2 + usize::from(permutation.ordered)];
            Kernel::new(&self.device, "occlude", &permutation.source(), groups)
        })
    }

    fn storage_buffers(&self) -> u32 {
        self.device
            .device
            .limits()
            .max_storage_buffers_per_shader_stage
    }

    fn storage(&self, what: &'static str, bytes: usize) -> Result<wgpu::Buffer, GpuError> {
        let usage = Usage::STORAGE | Usage::COPY_SRC;
        // A binding may not be empty.
        self.device.buffer(what, (bytes as u64).max(64), usage)
    }

    /// Workgroups for so many invocations of the stages that go by ray or hit, and the invocations in a row of them.
    fn size(&self, count: usize) -> (u32, u32) {
        let workgroups = (count as u32).div_ceil(SCATTER_WORKGROUP);
        let row = rows(&self.device, workgroups)[0] * SCATTER_WORKGROUP;
        (workgroups, row)
    }
}

/// Adds up seconds that are told.
fn add(sum: &mut Option<f64>, seconds: Option<f64>) {
    if let Some(seconds) = seconds {
        *sum = Some(sum.unwrap_or(0.0) + seconds);
    }
}
