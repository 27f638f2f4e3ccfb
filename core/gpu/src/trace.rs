//! The stage `trace` on a device.
//!
//! Rays go there in batches: [`Tracer::batch`] uploads one, [`Tracer::run`] traces it, [`Tracer::read`] fetches its hits.
//! [`Tracer::trace`] does all of that for any number of rays.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use hdtrapeze_core::trace::{self, TraceCounts};
use hdtrapeze_shaders::layout::{Hit, Ray, TraceLaunch};
use hdtrapeze_shaders::stage::{TRACE_WORKGROUP, TracePermutation};
use wgpu::BufferUsages as Usage;

use super::kernel::{Clock, rows};
use super::scene::Page;
use super::{Device, GpuError, GpuScene};

/// Rays of one submission of [`Tracer::trace`] at most: 40 MiB of rays and hits, and no driver's patience is tried.
const LAUNCH: usize = 1 << 19;

/// Traces rays on a device. Pipelines are compiled once for each permutation.
#[derive(Debug)]
pub struct Tracer {
    device: Arc<Device>,
    /// Of the scene, of a batch, and of one that is counted.
    layouts: [wgpu::BindGroupLayout; 3],
    pipelines: Mutex<HashMap<TracePermutation, wgpu::ComputePipeline>>,
}

/// Rays on a device, and what they hit.
#[derive(Debug)]
pub struct Batch {
    launches: Vec<Launch>,
    hits: wgpu::Buffer,
    counts: Option<wgpu::Buffer>,
    len: usize,
    size: [u32; 2],
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

/// One page of the scene.
#[derive(Debug)]
struct Launch {
    pipeline: wgpu::ComputePipeline,
    groups: [wgpu::BindGroup; 2],
}

/// A binding of the stage.
fn entry(binding: u32, ty: wgpu::BufferBindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }
}

impl Tracer {
    /// For this device.
    pub fn new(device: Arc<Device>) -> Self {
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        let layout = |entries: &[wgpu::BindGroupLayoutEntry]| {
            let descriptor = wgpu::BindGroupLayoutDescriptor {
                label: Some("trace"),
                entries,
            };
            device.device.create_bind_group_layout(&descriptor)
        };
        let scene = [0, 1, 2, 3, 4, 5].map(|binding| entry(binding, storage(true)));
        let batch = [
            entry(0, storage(true)),
            entry(1, storage(false)),
            entry(2, wgpu::BufferBindingType::Uniform),
            entry(3, storage(false)),
        ];
        Self {
            layouts: [layout(&scene), layout(&batch[..3]), layout(&batch)],
            pipelines: Mutex::default(),
            device,
        }
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// The nearest hit of each ray, as [`trace::World::trace`], but for rounding: see `slabs.wgsl` and `cells.wgsl`. With
    /// `any`, some hit where there is one. Rays that are not finite miss.
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
        let groups = (len as u32).div_ceil(TRACE_WORKGROUP).max(1);
        let [across, rows] = rows(device, groups);
        let answers = |what: &'static str, each: usize| {
            let bytes = (len.max(1) * each) as u64;
            device.buffer(what, bytes, Usage::STORAGE | Usage::COPY_SRC)
        };
        let hits = answers("hits", size_of::<Hit>())?;
        let counted = match counts {
            true => Some(answers("counts", size_of::<[u32; 2]>())?),
            false => None,
        };
        let launch = |(number, page): (usize, &Page)| {
            let launch = TraceLaunch {
                root: page.root,
                ray_count: len as u32,
                row: across * TRACE_WORKGROUP,
                page: number as u32,
                radius: page.radius,
                pad: page.pad,
            };
            let launch_there = device.buffer("launch", 32, Usage::UNIFORM | Usage::COPY_DST)?;
            let bytes = bytemuck::bytes_of(&launch);
            device.queue.write_buffer(&launch_there, 0, bytes);
            let mut buffers = vec![rays, &hits, &launch_there];
            buffers.extend(counted.as_ref());
            let scene_group = self.group(0, &page.group.each_ref());
            let batch_group = self.group(1 + usize::from(counts), &buffers);
            let permutation = TracePermutation {
                any,
                counts,
                ..page.permutation
            };
            Ok(Launch {
                pipeline: self.pipeline(permutation)?,
                groups: [scene_group, batch_group],
            })
        };
        let launches = scene.pages.iter().enumerate().map(launch);
        Ok(Batch {
            launches: launches.collect::<Result<_, GpuError>>()?,
            hits,
            counts: counted,
            len,
            size: [across, rows],
        })
    }

    /// Traces a batch; gives the seconds that the device took, where it can tell.
    ///
    /// # Errors
    /// The device failed or is lost.
    pub fn run(&self, batch: &Batch) -> Result<Option<f64>, GpuError> {
        let device = &*self.device;
        let clock = match device.found().timestamps {
            true => Some(Clock::new(device, "trace")?),
            false => None,
        };
        let mut encoder = device.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("trace"),
                timestamp_writes: clock.as_ref().map(Clock::writes),
            });
            for launch in &batch.launches {
                pass.set_pipeline(&launch.pipeline);
                pass.set_bind_group(0, &launch.groups[0], &[]);
                pass.set_bind_group(1, &launch.groups[1], &[]);
                pass.dispatch_workgroups(batch.size[0], batch.size[1], 1);
            }
        }
        if let Some(clock) = &clock {
            clock.resolve(&mut encoder);
        }
        device.wait(device.queue.submit([encoder.finish()]))?;
        clock.map(|clock| clock.seconds(device)).transpose()
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

    fn pipeline(&self, permutation: TracePermutation) -> Result<wgpu::ComputePipeline, GpuError> {
        let mut known = self
            .pipelines
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = known.get(&permutation) {
            return Ok(pipeline.clone());
        }
        let device = &self.device.device;
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("trace"),
            source: wgpu::ShaderSource::Wgsl(permutation.source().into()),
        });
        let batch = &self.layouts[1 + usize::from(permutation.counts)];
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("trace"),
            bind_group_layouts: &[Some(&self.layouts[0]), Some(batch)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("trace"),
            layout: Some(&layout),
            module: &module,
            entry_point: Some("trace"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(GpuError::Failed {
                name: self.device.found().name.clone(),
                why: error.to_string(),
            });
        }
        self.device.check()?;
        known.insert(permutation, pipeline.clone());
        Ok(pipeline)
    }

    fn group(&self, number: usize, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
        let entries: Vec<wgpu::BindGroupEntry<'_>> = (0u32..)
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let descriptor = wgpu::BindGroupDescriptor {
            label: Some("trace"),
            layout: &self.layouts[number],
            entries: &entries,
        };
        self.device.device.create_bind_group(&descriptor)
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
