//! Stages that are compiled, and launches of them.

use super::{Device, GpuError};

/// How a stage sees a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binding {
    /// Reads it.
    Read,
    /// Reads and writes it.
    Write,
    /// Reads it: one struct, the same for all.
    Uniform,
}

/// A stage, compiled.
#[derive(Debug)]
pub struct Kernel {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    layouts: Vec<wgpu::BindGroupLayout>,
}

/// A stage with its buffers, and workgroups of it.
#[derive(Debug)]
pub struct Launch<'a> {
    kernel: &'a Kernel,
    groups: Vec<wgpu::BindGroup>,
    /// Workgroups: in a row, and rows.
    size: [u32; 2],
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
        let on = &device.device;
        let scope = on.push_error_scope(wgpu::ErrorFilter::Validation);
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
        let pipeline = on.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(name),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(GpuError::Failed {
                name: device.found().name.clone(),
                why: error.to_string(),
            });
        }
        device.check()?;
        Ok(Self {
            name,
            pipeline,
            layouts,
        })
    }

    /// So many workgroups, in as many rows as the device needs, with these buffers.
    pub fn launch(
        &self,
        device: &Device,
        groups: &[&[&wgpu::Buffer]],
        workgroups: u32,
    ) -> Launch<'_> {
        let bound = self.layouts.iter().zip(groups).map(|(layout, buffers)| {
            let entries = (0u32..).zip(*buffers);
            let entries: Vec<_> = entries
                .map(|(binding, buffer)| wgpu::BindGroupEntry {
                    binding,
                    resource: buffer.as_entire_binding(),
                })
                .collect();
            device.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(self.name),
                layout,
                entries: &entries,
            })
        });
        Launch {
            kernel: self,
            groups: bound.collect(),
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

impl Launch<'_> {
    /// Runs it after what was submitted before; gives the seconds that the device took where that is asked for and the
    /// device can tell, and waits for it then only.
    ///
    /// # Errors
    /// The device failed or is lost.
    pub fn run(&self, device: &Device, timed: bool) -> Result<Option<f64>, GpuError> {
        let clock = match timed && device.found().timestamps {
            true => Some(Clock::new(device, self.kernel.name)?),
            false => None,
        };
        let mut encoder = device.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(self.kernel.name),
                timestamp_writes: clock.as_ref().map(Clock::writes),
            });
            pass.set_pipeline(&self.kernel.pipeline);
            for (number, group) in (0u32..).zip(&self.groups) {
                pass.set_bind_group(number, group, &[]);
            }
            pass.dispatch_workgroups(self.size[0], self.size[1], 1);
        }
        if let Some(clock) = &clock {
            clock.resolve(&mut encoder);
        }
        let submitted = device.queue.submit([encoder.finish()]);
        if !timed {
            return device.check().map(|()| None);
        }
        device.wait(submitted)?;
        clock.map(|clock| clock.seconds(device)).transpose()
    }
}

/// Times one pass.
#[derive(Debug)]
pub(crate) struct Clock {
    set: wgpu::QuerySet,
    times: wgpu::Buffer,
}

impl Clock {
    /// For a device that has timestamps.
    pub fn new(device: &Device, name: &str) -> Result<Self, GpuError> {
        let set = device.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some(name),
            ty: wgpu::QueryType::Timestamp,
            count: 2,
        });
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        let times = device.buffer("times", 16, usage)?;
        Ok(Self { set, times })
    }

    /// For the pass.
    pub fn writes(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    /// After the pass.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
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
