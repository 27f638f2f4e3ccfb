//! Runs of the dispatches of the stages that make trees.
//!
//! **How much at once.** A submission has as many dispatches as take a small part of what watchdogs allow, by how long those of
//! the stage before took. One dispatch is not cut in parts: it goes once over the items of a page at most, and a page has no
//! more than a binding holds. Where 4 GiB can be bound, that is 45 million items that move, whose boxes have 96 bytes; a
//! dispatch reads and writes some 200 bytes of each, 9 GB, which takes a device of 100 GB/s a tenth of a second. Bounds
//! take longer for each item, of as many vertices and keys as there are: those are made in ranges of items.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use bytemuck::bytes_of;
use hdtrapeze_shaders::layout::BuildLaunch;
use hdtrapeze_shaders::stage::{BuildStage, SORT_BITS};
use wgpu::BufferUsages as Usage;

use crate::kernel::{Kernel, Kernels, Launch, record};
use crate::pace::{Pace, Sizes, Submitted};
use crate::{Device, GpuError};

/// From launch to launch in a buffer: what every device takes as an offset.
const STRIDE: u64 = 256;

/// Runs that are timed: two timestamps each.
const TIMED: u32 = 256;

/// Workgroups of a submission; it has a dispatch at least.
const GROUPS: Sizes = Sizes {
    first: 1 << 8,
    least: 1,
    most: 1 << 18,
};

/// A stage, and whether bounds move.
type Permutation = (BuildStage, bool);

/// Runs stages, each compiled once for each permutation.
#[derive(Debug)]
pub(crate) struct Runner {
    pub device: Arc<Device>,
    kernels: Kernels<Permutation>,
    /// Of each stage.
    paces: [Pace; BuildStage::ALL.len()],
}

/// A dispatch.
pub(crate) struct Step {
    pub entry: &'static str,
    pub launch: BuildLaunch,
    pub workgroups: u32,
    /// Number of the set of buffers.
    pub set: usize,
}

/// What is timed in a build, in the device's own time.
pub(crate) struct Clock {
    set: Option<wgpu::QuerySet>,
    stages: Vec<BuildStage>,
}

impl Runner {
    /// For this device, which should be at one submission no longer than `target`.
    pub fn new(device: Arc<Device>, target: Duration) -> Self {
        Self {
            device,
            kernels: Kernels::default(),
            paces: BuildStage::ALL.map(|_| Pace::new(target, GROUPS)),
        }
    }

    /// What a stage has submitted by now.
    pub fn submitted(&self, stage: BuildStage) -> Submitted {
        self.paces[stage as usize].submitted()
    }

    pub fn clock(&self) -> Clock {
        let device = &self.device;
        let set = device.found().timestamps.then(|| {
            let descriptor = wgpu::QuerySetDescriptor {
                label: Some("build"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * TIMED,
            };
            device.device.create_query_set(&descriptor)
        });
        Clock {
            set,
            stages: Vec::new(),
        }
    }

    /// Submits dispatches of a stage, each with one of these sets of buffers.
    pub fn run(
        &self,
        clock: &mut Clock,
        (stage, moves): Permutation,
        steps: &[Step],
        sets: &[&[&wgpu::Buffer]],
    ) -> Result<(), GpuError> {
        let device = &*self.device;
        let kernel = self.kernel((stage, moves))?;
        // Dispatches in a row with the same launch share it.
        let mut bytes: Vec<u8> = Vec::new();
        let mut offsets = Vec::with_capacity(steps.len());
        for (i, step) in steps.iter().enumerate() {
            if i == 0 || steps[i - 1].launch != step.launch {
                bytes.resize(bytes.len().next_multiple_of(STRIDE as usize), 0);
                offsets.push(bytes.len() as u32);
                bytes.extend_from_slice(bytes_of(&step.launch));
            } else {
                offsets.push(offsets[i - 1]);
            }
        }
        let usage = Usage::UNIFORM | Usage::COPY_DST;
        let launches = device.buffer("launches", bytes.len() as u64, usage)?;
        device.queue.write_buffer(&launches, 0, &bytes);
        let group = |(set, offset): (usize, u32)| {
            let launch = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: &launches,
                offset: offset.into(),
                size: wgpu::BufferSize::new(size_of::<BuildLaunch>() as u64),
            });
            let storage = sets[set].iter().map(|buffer| buffer.as_entire_binding());
            kernel.group(device, 0, std::iter::once(launch).chain(storage))
        };
        let mut groups: HashMap<(usize, u32), wgpu::BindGroup> = HashMap::new();
        let mut flight = self.paces[stage as usize].flight(device);
        let mut steps = steps.iter().zip(offsets).peekable();
        while steps.peek().is_some() {
            let most = flight.next();
            let (mut launches, mut workgroups): (Vec<Launch>, usize) = (Vec::new(), 0);
            while workgroups < most
                && let Some((step, offset)) = steps.next()
            {
                let key = (step.set, offset);
                let group = groups.entry(key).or_insert_with(|| group(key)).clone();
                launches.push(kernel.launch_at(
                    device,
                    step.entry,
                    vec![group],
                    step.workgroups,
                )?);
                workgroups += step.workgroups as usize;
            }
            flight.add((launches.len(), workgroups), false, || {
                let mut encoder = device.device.create_command_encoder(&Default::default());
                record(&mut encoder, &launches, clock.stamp(stage));
                Ok(device.queue.submit([encoder.finish()]))
            })?;
        }
        device.check()
    }

    /// The seconds of each stage that was timed.
    pub fn seconds(&self, clock: &Clock) -> Result<Vec<(BuildStage, f64)>, GpuError> {
        let device = &*self.device;
        let (Some(set), runs @ 1..) = (&clock.set, clock.stages.len()) else {
            return Ok(Vec::new());
        };
        let mut stamps = vec![[0u64; 2]; runs];
        let usage = Usage::QUERY_RESOLVE | Usage::COPY_SRC;
        let times = device.buffer("times", size_of_val(&stamps[..]) as u64, usage)?;
        let mut encoder = device.device.create_command_encoder(&Default::default());
        encoder.resolve_query_set(set, 0..2 * runs as u32, &times, 0);
        device.queue.submit([encoder.finish()]);
        device.fetch(&times, &mut stamps)?;
        let period = f64::from(device.queue.get_timestamp_period()) * 1e-9;
        let spent = |stage| {
            let runs = clock.stages.iter().zip(&stamps);
            let runs = runs.filter(|(of, _)| **of == stage);
            let ticks = runs.map(|(_, [from, to])| to.saturating_sub(*from) as f64);
            (stage, ticks.sum::<f64>() * period)
        };
        Ok(BuildStage::ALL.map(spent).to_vec())
    }

    fn kernel(&self, (stage, moves): Permutation) -> Result<Arc<Kernel>, GpuError> {
        self.kernels.get((stage, moves), || {
            let entries = stage.entry_points().iter().map(|&(name, _)| name);
            let entries: Vec<&'static str> = entries.collect();
            let (source, groups) = (stage.source(moves), [stage.bindings()]);
            Kernel::with_entries(&self.device, stage.name(), &source, &entries, &groups)
        })
    }
}

impl Clock {
    /// Where the next run is timed, as long as there is room.
    fn stamp(&mut self, stage: BuildStage) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let set = self.set.as_ref()?;
        let run = self.stages.len() as u32;
        if run == TIMED {
            return None;
        }
        self.stages.push(stage);
        Some(wgpu::ComputePassTimestampWrites {
            query_set: set,
            beginning_of_pass_write_index: Some(2 * run),
            end_of_pass_write_index: Some(2 * run + 1),
        })
    }
}

/// The dispatches of the stage `sort` that put `launch.items` in the order of the low `bits` of their keys; sets of buffers take
/// turns, so that where there is an odd number of rounds, what is sorted is what the first set sorts into.
pub(crate) fn sort_steps(launch: BuildLaunch, bits: u32) -> (Vec<Step>, u32) {
    let rounds = bits.div_ceil(SORT_BITS);
    let mut steps = Vec::new();
    for round in 0..rounds {
        let launch = BuildLaunch {
            first: round * SORT_BITS,
            ..launch
        };
        let step = |entry, workgroups| Step {
            entry,
            launch,
            workgroups,
            set: round as usize % 2,
        };
        steps.push(step("count", launch.tiles));
        steps.push(step("sum", 1));
        steps.push(step("scatter", launch.tiles));
    }
    (steps, rounds)
}

/// Workgroups of so many invocations for `count` of them.
pub(crate) fn workgroups(count: u32, size: u32) -> u32 {
    count.div_ceil(size)
}
