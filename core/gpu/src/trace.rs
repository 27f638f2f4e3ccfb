//! The stage `trace` on a device.
//!
//! Rays go there in batches: [`Tracer::batch`] uploads one, [`Tracer::run`] traces it, [`Tracer::read`] fetches its hits.
//! [`Tracer::trace`] does all of that for any number of rays.

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use glam::Vec3;
use hdtrapeze_core::trace::{self, TraceCounts};
use hdtrapeze_shaders::layout::{Hit, Ray, TraceLaunch};
use hdtrapeze_shaders::stage::{TRACE_WORKGROUP, TracePermutation};
use wgpu::BufferUsages as Usage;

use super::kernel::{Binding, Kernel, Kernels, Launch, rows};
use super::layers::{Layer, Layers};
use super::pace::{Pace, Sizes, Submitted};
use super::scene::Page;
use super::{Device, GpuError, GpuScene};

/// Rays of one batch of [`Tracer::trace`] at most: 40 MiB of rays and hits.
const LAUNCH: usize = 1 << 19;

/// Traces rays on a device. Pipelines are compiled once for each permutation.
#[derive(Debug)]
pub struct Tracer {
    device: Arc<Device>,
    kernels: Kernels<TracePermutation>,
    pace: Pace,
}

/// The stage on a page, to be launched for some rays after others.
#[derive(Debug)]
struct Pass {
    kernel: Arc<Kernel>,
    page: [wgpu::Buffer; 6],
    launch: TraceLaunch,
    /// Rays, their hits, and what they cost or what is left of them.
    buffers: Vec<wgpu::Buffer>,
}

impl Pass {
    fn launch(&self, device: &Device, rays: Range<usize>) -> Result<Launch, GpuError> {
        let groups = (rays.len() as u32).div_ceil(TRACE_WORKGROUP).max(1);
        let launch = TraceLaunch {
            row: rows(device, groups)[0] * TRACE_WORKGROUP,
            first: rays.start as u32,
            end: rays.end as u32,
            ..self.launch
        };
        let launch = device.uniform("launch", &launch)?;
        let mut batch: Vec<&wgpu::Buffer> = self.buffers.iter().collect();
        batch.insert(2, &launch);
        let page = self.page.each_ref();
        Ok(self.kernel.launch(device, &[&page, &batch], groups))
    }
}

/// Rays on a device, and what they hit.
#[derive(Debug)]
pub struct Batch {
    /// One a page.
    passes: Vec<Pass>,
    hits: wgpu::Buffer,
    counts: Option<wgpu::Buffer>,
    len: usize,
}

impl Batch {
    /// As the layout's [`Hit`], by the numbers of rays; there once it has run.
    pub fn hits(&self) -> &wgpu::Buffer {
        &self.hits
    }

    /// Only its hits.
    pub(crate) fn into_hits(self) -> wgpu::Buffer {
        self.hits
    }
}

impl Tracer {
    /// For this device.
    pub fn new(device: Arc<Device>) -> Self {
        Self {
            kernels: Kernels::default(),
            pace: Pace::default(),
            device,
        }
    }

    /// For this device, which should be at one submission no longer than `target`.
    pub fn with_target(device: Arc<Device>, target: Duration) -> Self {
        Self {
            pace: Pace::new(target, Sizes::RAYS),
            ..Self::new(device)
        }
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// The nearest hit of each ray, as [`trace::World::next`] where sides that are culled are not there, but for rounding: see
    /// `slabs.wgsl` and `cells.wgsl`. With `any`, some hit where there is one, be it on a side that is culled. Rays that are not
    /// finite miss.
    ///
    /// # Errors
    /// The device failed or is lost; nothing of `hits` is then to be used.
    pub fn trace(
        &self,
        scene: &GpuScene,
        rays: &[trace::Ray],
        any: bool,
        hits: &mut [trace::Hit],
    ) -> Result<(), GpuError> {
        for (rays, hits) in rays.chunks(LAUNCH).zip(hits.chunks_mut(LAUNCH)) {
            let batch = self.batch(scene, rays, any, false)?;
            self.run(&batch)?;
            self.read(&batch, hits)?;
        }
        Ok(())
    }

    /// Uploads rays; with `counts`, what each costs is told too.
    ///
    /// # Errors
    /// They are more than the device takes at once, or it is lost.
    pub fn batch(
        &self,
        scene: &GpuScene,
        rays: &[trace::Ray],
        any: bool,
        counts: bool,
    ) -> Result<Batch, GpuError> {
        let device = &*self.device;
        device.check()?;
        let packed: Vec<Ray> = (0..).zip(rays).map(packed).collect();
        let rays_there = device.upload("rays", bytemuck::cast_slice(&packed))?;
        self.batch_of(scene, &rays_there, rays.len(), any, counts)
    }

    /// [`Tracer::batch`], of `len` rays that are there.
    ///
    /// # Errors
    /// As [`Tracer::batch`].
    pub fn batch_of(
        &self,
        scene: &GpuScene,
        rays: &wgpu::Buffer,
        len: usize,
        any: bool,
        counts: bool,
    ) -> Result<Batch, GpuError> {
        let device = &*self.device;
        device.check()?;
        let answers = |what: &'static str, each: usize| {
            let bytes = (len.max(1) * each) as u64;
            device.buffer(what, bytes, Usage::STORAGE | Usage::COPY_SRC)
        };
        let hits = answers("hits", size_of::<Hit>())?;
        let counted = match counts {
            true => Some(answers("counts", size_of::<[u32; 2]>())?),
            false => None,
        };
        let mut buffers = vec![rays, &hits];
        buffers.extend(counted.as_ref());
        let pass = |(number, page): (usize, &Page)| {
            let permutation = TracePermutation {
                any,
                counts,
                culls: page.permutation.culls && !any,
                ..page.permutation
            };
            self.pass(page, permutation, number, Layer::first(len), &buffers)
        };
        let passes = scene.pages.iter().enumerate().map(pass);
        Ok(Batch {
            passes: passes.collect::<Result<_, GpuError>>()?,
            hits,
            counts: counted,
            len,
        })
    }

    /// What each ray meets first, then behind that, and so on for so many layers: as [`trace::World::next`] tells it, but for
    /// rounding.
    ///
    /// # Errors
    /// As [`Tracer::batch`].
    pub fn layers(
        &self,
        scene: &GpuScene,
        rays: &[trace::Ray],
        count: usize,
    ) -> Result<Vec<Vec<trace::Hit>>, GpuError> {
        let (device, len) = (&*self.device, rays.len());
        device.check()?;
        let packed: Vec<Ray> = (0..).zip(rays).map(packed).collect();
        let rays = device.upload("rays", bytemuck::cast_slice(&packed))?;
        let layers = Layers::new(device, len)?;
        layers.all_go_on(device);
        let one = |number: usize| {
            let layer = Layer {
                number,
                ..Layer::first(len)
            };
            self.layer(scene, &rays, &layers, layer, false)?;
            layers.get(device, number)
        };
        (0..count).map(one).collect()
    }

    /// Traces rays behind what the layer before met. Gives the seconds that the device took where that is asked for and it can
    /// tell, and waits for it then only.
    ///
    /// # Errors
    /// As [`Tracer::batch`].
    pub(crate) fn layer(
        &self,
        scene: &GpuScene,
        rays: &wgpu::Buffer,
        layers: &Layers,
        layer: Layer,
        timed: bool,
    ) -> Result<Option<f64>, GpuError> {
        let buffers = [rays, &layers.hits, &layers.veils];
        let pass = |(number, page): (usize, &Page)| {
            let permutation = TracePermutation {
                layers: true,
                ..page.permutation
            };
            self.pass(page, permutation, number, layer, &buffers)
        };
        let passes = scene.pages.iter().enumerate().map(pass);
        let passes: Vec<Pass> = passes.collect::<Result<_, GpuError>>()?;
        self.paced(&passes, layer.most, layer.number > 0, timed)
    }

    /// The stage on a page, by its number. `buffers` are the rays, their hits, and what they cost or what is left of them.
    fn pass(
        &self,
        page: &Page,
        permutation: TracePermutation,
        number: usize,
        layer: Layer,
        buffers: &[&wgpu::Buffer],
    ) -> Result<Pass, GpuError> {
        let launch = TraceLaunch {
            root: page.root,
            ray_count: layer.len as u32,
            page: number as u32,
            radius: page.radius,
            pad: page.pad,
            layer: layer.number as u32,
            sides: page.sides,
            ..TraceLaunch::default()
        };
        Ok(Pass {
            kernel: self.kernel(permutation)?,
            page: page.group.clone(),
            launch,
            buffers: buffers.iter().copied().cloned().collect(),
        })
    }

    fn paced(
        &self,
        passes: &[Pass],
        len: usize,
        sparse: bool,
        timed: bool,
    ) -> Result<Option<f64>, GpuError> {
        let device = &*self.device;
        let launch = |page: usize, rays| passes[page].launch(device, rays);
        let count = passes.len();
        self.pace.run(device, (count, len), sparse, timed, launch)
    }

    /// What was submitted by now.
    pub fn submitted(&self) -> Submitted {
        self.pace.submitted()
    }

    /// Traces a batch; gives the seconds that the device took, where it can tell.
    ///
    /// # Errors
    /// The device failed or is lost.
    pub fn run(&self, batch: &Batch) -> Result<Option<f64>, GpuError> {
        self.start(batch, true)
    }

    /// The same, without waiting for it where it is not `timed`.
    pub(crate) fn start(&self, batch: &Batch, timed: bool) -> Result<Option<f64>, GpuError> {
        self.paced(&batch.passes, batch.len, false, timed)
    }

    /// Fetches the hits of a batch that has run.
    ///
    /// # Errors
    /// The device failed or is lost.
    pub fn read(&self, batch: &Batch, hits: &mut [trace::Hit]) -> Result<(), GpuError> {
        self.read_hits(&batch.hits, hits)
    }

    /// Fetches hits.
    pub(crate) fn read_hits(
        &self,
        there: &wgpu::Buffer,
        hits: &mut [trace::Hit],
    ) -> Result<(), GpuError> {
        let mut answers = vec![Hit::default(); hits.len()];
        self.device.fetch(there, &mut answers)?;
        for (hit, answer) in hits.iter_mut().zip(&answers) {
            *hit = unpacked(answer);
        }
        Ok(())
    }

    /// What a batch cost that has run, where that is told.
    ///
    /// # Errors
    /// The device failed or is lost.
    pub fn counts(&self, batch: &Batch) -> Result<Option<TraceCounts>, GpuError> {
        let Some(buffer) = &batch.counts else {
            return Ok(None);
        };
        let mut each = vec![[0u32; 2]; batch.len];
        self.device.fetch(buffer, &mut each)?;
        let of = |&[nodes, cells]: &[u32; 2]| TraceCounts {
            rays: 1,
            node_tests: nodes.into(),
            cell_tests: cells.into(),
        };
        let sum = each.iter().map(of);
        Ok(Some(sum.fold(TraceCounts::default(), |a, b| a + b)))
    }

    fn kernel(&self, permutation: TracePermutation) -> Result<Arc<Kernel>, GpuError> {
        self.kernels.get(permutation, || {
            let batch = [
                Binding::Read,
                Binding::Write,
                Binding::Uniform,
                Binding::Write,
            ];
            let more = permutation.counts || permutation.layers;
            let batch = &batch[..3 + usize::from(more)];
            let groups: [&[Binding]; 2] = [&[Binding::Read; 6], batch];
            Kernel::new(&self.device, "trace", &permutation.source(), &groups)
        })
    }
}

/// A ray that no stage stumbles over: one that is not finite has no direction, which misses.
pub(crate) fn packed((number, ray): (u32, &trace::Ray)) -> Ray {
    let finite = ray.origin.is_finite()
        && ray.dir.is_finite()
        && !(ray.time.is_nan() || ray.t_min.is_nan() || ray.t_max.is_nan());
    if !finite {
        return Ray {
            number,
            ..Ray::default()
        };
    }
    Ray {
        origin: ray.origin.to_array(),
        t_min: ray.t_min.clamp(-f32::MAX, f32::MAX),
        dir: ray.dir.to_array(),
        t_max: ray.t_max.clamp(-f32::MAX, f32::MAX),
        time: ray.time.clamp(0.0, 1.0),
        number,
        ..Ray::default()
    }
}

/// The ray of a layout's ray, for the CPU.
pub(crate) fn to_core(ray: &Ray) -> trace::Ray {
    trace::Ray {
        origin: Vec3::from_array(ray.origin),
        dir: Vec3::from_array(ray.dir),
        time: ray.time,
        t_min: ray.t_min,
        t_max: ray.t_max,
    }
}

pub(crate) fn unpacked(hit: &Hit) -> trace::Hit {
    if hit.instance == trace::Hit::NONE {
        return trace::Hit::MISS;
    }
    trace::Hit {
        t: hit.t,
        u: hit.u,
        v: hit.v,
        instance: hit.instance,
        grid: hit.grid,
        cell: hit.cell,
    }
}

/// The inverse of [`unpacked`].
pub(crate) fn to_layout(hit: &trace::Hit) -> Hit {
    let &trace::Hit {
        t,
        u,
        v,
        instance,
        grid,
        cell,
    } = hit;
    Hit {
        t,
        u,
        v,
        instance,
        grid,
        cell,
    }
}
