//! Stages that are compiled, and launches of them.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, PoisonError};

pub use hdtrapeze_shaders::stage::Binding;

use super::kept::KeptPipelines;
use super::{Device, GpuError};

/// A stage, compiled.
#[derive(Debug)]
pub struct Kernel {
    name: &'static str,
    /// By entry point.
    pipelines: Vec<(&'static str, wgpu::ComputePipeline)>,
    layouts: Vec<wgpu::BindGroupLayout>,
}

/// A stage with its buffers, and workgroups of it.
#[derive(Debug)]
pub struct Launch {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    groups: Vec<wgpu::BindGroup>,
    /// Workgroups: in a row, and rows.
    size: [u32; 2],
}

/// Kernels by what they are compiled for: each is compiled once.
#[derive(Debug)]
pub(crate) struct Kernels<P> {
    known: Mutex<HashMap<P, Arc<Kernel>>>,
}

impl<P> Default for Kernels<P> {
    fn default() -> Self {
        Self {
            known: Mutex::default(),
        }
    }
}

impl<P: Eq + Hash> Kernels<P> {
    /// The kernel of a permutation, which `make` compiles where it is not known.
    pub fn get(
        &self,
        permutation: P,
        make: impl FnOnce() -> Result<Kernel, GpuError>,
    ) -> Result<Arc<Kernel>, GpuError> {
        let known = &mut *self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(kernel) = known.get(&permutation) {
            return Ok(Arc::clone(kernel));
        }
        let kernel = Arc::new(make()?);
        known.insert(permutation, Arc::clone(&kernel));
        Ok(kernel)
    }
}

impl Kernel {
    /// Compiles `source`; its entry point is `name`. Each group of buffers is bound in the order given, from 0 on.
    ///
    /// # Errors
    /// The driver takes it not.
    pub fn new(
        device: &Device,
        name: &'static str,
        source: &str,
        groups: &[&[Binding]],
    ) -> Result<Self, GpuError> {
        Self::with_entries(device, name, source, &[name], groups)
    }

    /// The same of a text with these entry points, which see the same buffers.
    ///
    /// # Errors
    /// As [`Kernel::new`].
    pub(crate) fn with_entries(
        device: &Device,
        name: &'static str,
        source: &str,
        entries: &[&'static str],
        groups: &[&[Binding]],
    ) -> Result<Self, GpuError> {
        let on = &device.device;
        // Whatever rejects it, the device is good for others.
        let scopes = [
            wgpu::ErrorFilter::Validation,
            wgpu::ErrorFilter::Internal,
            wgpu::ErrorFilter::OutOfMemory,
        ]
        .map(|filter| on.push_error_scope(filter));
        let layouts: Vec<_> = groups.iter().map(|group| layout(on, name, group)).collect();
        let bound: Vec<_> = layouts.iter().map(Some).collect();
        let layout = on.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(name),
            bind_group_layouts: &bound,
            immediate_size: 0,
        });
        let module = on.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(name),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let pipeline = |&entry: &&'static str| {
            let descriptor = wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: device.pipelines().map(KeptPipelines::cache),
            };
            (entry, on.create_compute_pipeline(&descriptor))
        };
        let pipelines = entries.iter().map(pipeline).collect();
        // All are popped, the last first.
        let scopes = scopes.into_iter().rev();
        let errors: Vec<_> = scopes
            .filter_map(|scope| pollster::block_on(scope.pop()))
            .collect();
        if let Some(error) = errors.first() {
            return Err(GpuError::Failed {
                name: device.found().name.clone(),
                why: error.to_string(),
            });
        }
        device.check()?;
        Ok(Self {
            name,
            pipelines,
            layouts,
        })
    }

    /// So many workgroups, in as many rows as the device needs, with these buffers.
    pub fn launch(&self, device: &Device, groups: &[&[&wgpu::Buffer]], workgroups: u32) -> Launch {
        let groups = (0..).zip(groups).map(|(number, buffers)| {
            let whole = buffers.iter().map(|buffer| buffer.as_entire_binding());
            self.group(device, number, whole)
        });
        let (_, pipeline) = &self.pipelines[0];
        self.launch_of(device, pipeline, groups.collect(), workgroups)
    }

    /// Buffers, or parts of them, as group `number`.
    pub(crate) fn group<'b>(
        &self,
        device: &Device,
        number: usize,
        buffers: impl Iterator<Item = wgpu::BindingResource<'b>>,
    ) -> wgpu::BindGroup {
        let entries: Vec<_> = (0u32..)
            .zip(buffers)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(self.name),
            layout: &self.layouts[number],
            entries: &entries,
        })
    }

    /// [`Kernel::launch`] at one of several entry points, of groups that are there.
    ///
    /// # Errors
    /// It was not compiled with this entry point.
    pub(crate) fn launch_at(
        &self,
        device: &Device,
        entry: &'static str,
        groups: Vec<wgpu::BindGroup>,
        workgroups: u32,
    ) -> Result<Launch, GpuError> {
        let known = self.pipelines.iter().find(|(name, _)| *name == entry);
        let (_, pipeline) = known.ok_or_else(|| GpuError::Failed {
            name: device.found().name.clone(),
            why: format!("the stage {} has no entry point {entry}", self.name),
        })?;
        Ok(self.launch_of(device, pipeline, groups, workgroups))
    }

    fn launch_of(
        &self,
        device: &Device,
        pipeline: &wgpu::ComputePipeline,
        groups: Vec<wgpu::BindGroup>,
        workgroups: u32,
    ) -> Launch {
        Launch {
            name: self.name,
            pipeline: pipeline.clone(),
            groups,
            size: rows(device, workgroups),
        }
    }
}

/// Workgroups in a row, and rows, for so many or a few more.
pub(crate) fn rows(device: &Device, workgroups: u32) -> [u32; 2] {
    let workgroups = workgroups.max(1);
    let rows = workgroups.div_ceil(device.found().workgroups);
    [workgroups.div_ceil(rows), rows]
}

fn layout(device: &wgpu::Device, name: &str, bindings: &[Binding]) -> wgpu::BindGroupLayout {
    let entry = |(binding, kind): (u32, &Binding)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: match kind {
                Binding::Read => wgpu::BufferBindingType::Storage { read_only: true },
                Binding::Write => wgpu::BufferBindingType::Storage { read_only: false },
                Binding::Uniform => wgpu::BufferBindingType::Uniform,
            },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    let entries: Vec<_> = (0u32..).zip(bindings).map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some(name),
        entries: &entries,
    })
}

impl Launch {
    /// Runs it after what was submitted before; gives the seconds that the device took where that is asked for and the
    /// device can tell, and waits for it then only.
    ///
    /// # Errors
    /// The device failed or is lost.
    pub fn run(&self, device: &Device, timed: bool) -> Result<Option<f64>, GpuError> {
        run(device, std::slice::from_ref(self), timed)
    }
}

/// Runs launches one after the other, as [`Launch::run`]; each is submitted by itself, since a watchdog looks at submissions.
pub(crate) fn run(
    device: &Device,
    launches: &[Launch],
    timed: bool,
) -> Result<Option<f64>, GpuError> {
    let mut clocks = Vec::new();
    let mut last = None;
    for launch in launches {
        let clock = Clock::where_timed(device, timed)?;
        let one = std::slice::from_ref(launch);
        last = Some(submit(device, one, clock.as_ref())?);
        clocks.extend(clock);
    }
    if !timed {
        return device.check().map(|()| None);
    }
    if let Some(last) = last {
        device.wait(last)?;
    }
    let seconds = clocks.iter().map(|clock| clock.seconds(device));
    let seconds: Vec<f64> = seconds.collect::<Result<_, _>>()?;
    Ok(device.found().timestamps.then(|| seconds.iter().sum()))
}

/// Submits launches as one pass, which `clock` times.
pub(crate) fn submit(
    device: &Device,
    launches: &[Launch],
    clock: Option<&Clock>,
) -> Result<wgpu::SubmissionIndex, GpuError> {
    let mut encoder = device.device.create_command_encoder(&Default::default());
    record(&mut encoder, launches, clock.map(Clock::writes));
    if let Some(clock) = clock {
        clock.resolve(&mut encoder);
    }
    let submitted = device.queue.submit([encoder.finish()]);
    device.check().map(|()| submitted)
}

/// Records launches as one pass.
pub(crate) fn record(
    encoder: &mut wgpu::CommandEncoder,
    launches: &[Launch],
    timestamp_writes: Option<wgpu::ComputePassTimestampWrites<'_>>,
) {
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
        label: launches.first().map(|launch| launch.name),
        timestamp_writes,
    });
    for launch in launches {
        pass.set_pipeline(&launch.pipeline);
        for (number, group) in (0u32..).zip(&launch.groups) {
            pass.set_bind_group(number, group, &[]);
        }
        pass.dispatch_workgroups(launch.size[0], launch.size[1], 1);
    }
}

/// Times one pass.
#[derive(Debug)]
pub(crate) struct Clock {
    set: wgpu::QuerySet,
    times: wgpu::Buffer,
}

impl Clock {
    /// One where that is asked for and the device has timestamps.
    pub fn where_timed(device: &Device, timed: bool) -> Result<Option<Self>, GpuError> {
        let has = timed && device.found().timestamps;
        has.then(|| Self::new(device)).transpose()
    }

    fn new(device: &Device) -> Result<Self, GpuError> {
        let set = device.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("times"),
            ty: wgpu::QueryType::Timestamp,
            count: 2,
        });
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        let times = device.buffer("times", 16, usage)?;
        Ok(Self { set, times })
    }

    /// For the pass.
    fn writes(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    /// After the pass.
    fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.resolve_query_set(&self.set, 0..2, &self.times, 0);
    }

    /// Once it has run.
    pub fn seconds(&self, device: &Device) -> Result<f64, GpuError> {
        let mut ends = [0u64; 2];
        device.fetch(&self.times, &mut ends)?;
        let ticks = ends[1].saturating_sub(ends[0]) as f64;
        Ok(ticks * f64::from(device.queue.get_timestamp_period()) * 1e-9)
    }
}
