//! The stage `trace` on a device.

use std::collections::HashMap;
use std::num::NonZeroU64;
use std::sync::{Arc, Mutex, PoisonError, mpsc};

use hdtrapeze_core::trace;
use hdtrapeze_shaders::layout::{Hit, Ray, TraceLaunch};
use hdtrapeze_shaders::stage::{TRACE_WORKGROUP, TracePermutation};

use super::{Device, GpuError, GpuScene};

/// Rays of one submission at most: 40 MiB of rays and hits, and no driver's patience is tried.
const LAUNCH: usize = 1 << 19;

/// Traces rays on a device. Pipelines are compiled once for each permutation.
#[derive(Debug)]
pub struct Tracer {
    device: Arc<Device>,
    layouts: [wgpu::BindGroupLayout; 2],
    layout: wgpu::PipelineLayout,
    pipelines: Mutex<HashMap<TracePermutation, wgpu::ComputePipeline>>,
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
        let launch = [
            entry(0, storage(true)),
            entry(1, storage(false)),
            entry(2, wgpu::BufferBindingType::Uniform),
        ];
        let layouts = [layout(&scene), layout(&launch)];
        let pipeline = wgpu::PipelineLayoutDescriptor {
            label: Some("trace"),
            bind_group_layouts: &[Some(&layouts[0]), Some(&layouts[1])],
            immediate_size: 0,
        };
        Self {
            layout: device.device.create_pipeline_layout(&pipeline),
            layouts,
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
        self.device.check()?;
        let pipeline = self.pipeline(scene.permutation)?;
        let group = self.group(0, &scene.group.each_ref());
        for (rays, hits) in rays.chunks(LAUNCH).zip(hits.chunks_mut(LAUNCH)) {
            self.launch(&pipeline, &group, scene, rays, any, hits)?;
        }
        Ok(())
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
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("trace"),
            layout: Some(&self.layout),
            module: &module,
            entry_point: Some("trace"),
            compilation_options: wgpu::PipelineCompilationOptions {
                // Written by the stage before they are read.
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
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

    fn launch(
        &self,
        pipeline: &wgpu::ComputePipeline,
        scene_group: &wgpu::BindGroup,
        scene: &GpuScene,
        rays: &[trace::Ray],
        any: bool,
        hits: &mut [trace::Hit],
    ) -> Result<(), GpuError> {
        use wgpu::BufferUsages as Usage;
        let device = &*self.device;
        let count = rays.len().min(hits.len());
        let packed: Vec<Ray> = rays[..count].iter().map(packed).collect();
        let groups = (count as u32).div_ceil(TRACE_WORKGROUP);
        let rows = groups.div_ceil(device.found().workgroups).max(1);
        let across = groups.div_ceil(rows).max(1);
        let launch = TraceLaunch {
            root: scene.root,
            ray_count: count as u32,
            row: across * TRACE_WORKGROUP,
            any: any.into(),
            radius: scene.radius,
            pad: scene.pad,
        };
        let bytes = (count * size_of::<Hit>()) as u64;
        let Some(size) = NonZeroU64::new(bytes) else {
            return Ok(());
        };
        let ray_buffer = device.upload("rays", bytemuck::cast_slice(&packed))?;
        let hit_buffer = device.buffer("hits", size.get(), Usage::STORAGE | Usage::COPY_SRC)?;
        let back = device.buffer("hits", size.get(), Usage::MAP_READ | Usage::COPY_DST)?;
        let uniform = Usage::UNIFORM | Usage::COPY_DST;
        let launch_buffer = device.buffer("launch", 32, uniform)?;
        device
            .queue
            .write_buffer(&launch_buffer, 0, bytemuck::bytes_of(&launch));
        let launch_group = self.group(1, &[&ray_buffer, &hit_buffer, &launch_buffer]);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, scene_group, &[]);
            pass.set_bind_group(1, &launch_group, &[]);
            pass.dispatch_workgroups(across, rows, 1);
        }
        encoder.copy_buffer_to_buffer(&hit_buffer, 0, &back, 0, size.get());
        let (done, mapped) = mpsc::channel();
        encoder.map_buffer_on_submit(&back, wgpu::MapMode::Read, .., move |result| {
            // Nobody listens where waiting failed.
            let _ = done.send(result.is_ok());
        });
        let submission = device.queue.submit([encoder.finish()]);
        device.wait(submission)?;
        let failed = |why: &str| GpuError::Failed {
            name: device.found().name.clone(),
            why: why.to_owned(),
        };
        if mapped.try_recv() != Ok(true) {
            return Err(failed("its answers cannot be read"));
        }
        let view = back
            .get_mapped_range(..)
            .map_err(|_| failed("its answers cannot be read"))?;
        let answers: &[Hit] = bytemuck::cast_slice(&view);
        for (hit, answer) in hits.iter_mut().zip(answers) {
            *hit = unpacked(answer);
        }
        Ok(())
    }
}

/// A ray that no stage stumbles over: one that is not finite has no direction, which misses.
fn packed(ray: &trace::Ray) -> Ray {
    let finite = ray.origin.is_finite()
        && ray.dir.is_finite()
        && !(ray.time.is_nan() || ray.t_min.is_nan() || ray.t_max.is_nan());
    if !finite {
        return Ray::default();
    }
    Ray {
        origin: ray.origin.to_array(),
        t_min: ray.t_min.clamp(-f32::MAX, f32::MAX),
        dir: ray.dir.to_array(),
        t_max: ray.t_max.clamp(-f32::MAX, f32::MAX),
        time: ray.time.clamp(0.0, 1.0),
        ..Ray::default()
    }
}

fn unpacked(hit: &Hit) -> trace::Hit {
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
