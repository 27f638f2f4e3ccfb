//! Devices: which there are, which is used and why, and one that is open.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::Duration;

use bytemuck::Pod;

use wgpu::BufferUsages as Usage;

use super::GpuError;
use super::kept::KeptPipelines;

/// What a device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A driver that computes on the CPU.
    Software,
    /// Unknown, or virtual.
    Other,
    /// Shares memory with the CPU.
    Integrated,
    /// Has memory of its own.
    Discrete,
}

/// A device that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// As the driver calls it.
    pub name: String,
    /// Vulkan, Metal or DX12.
    pub api: String,
    /// The driver and its version.
    pub driver: String,
    /// What it is.
    pub kind: Kind,
    /// Bytes of the largest buffer.
    pub largest_buffer: u64,
    /// Bytes that a stage sees of a buffer at once.
    pub largest_binding: u64,
    /// Workgroups along one side of a launch.
    pub workgroups: u32,
    /// True where stages can be timed.
    pub timestamps: bool,
    /// True where invocations of a subgroup can exchange values.
    pub subgroups: bool,
    /// True for the best one, which [`Device::open`] opens.
    pub chosen: bool,
}

/// An open device, shared by all that use it.
#[derive(Debug)]
pub struct Device {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    found: Found,
    fault: Fault,
    pipelines: Option<KeptPipelines>,
}

/// What drivers report on threads of their own.
type Fault = Arc<Mutex<Option<GpuError>>>;

/// Longest wait for one submission: drivers give up earlier.
const PATIENCE: Duration = Duration::from_secs(120);

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    // Release builds ask for no layers.
    descriptor.flags = wgpu::InstanceFlags::empty();
    wgpu::Instance::new(descriptor)
}

fn adapters() -> Vec<(wgpu::Adapter, Found)> {
    let found = pollster::block_on(instance().enumerate_adapters(wgpu::Backends::all()));
    let mut found: Vec<(wgpu::Adapter, Found)> = found
        .into_iter()
        .map(|adapter| {
            let found = Found::of(&adapter);
            (adapter, found)
        })
        .collect();
    // The best first; of equals, that which the driver names first.
    found.sort_by_key(|(_, found)| std::cmp::Reverse((found.kind, found.largest_binding)));
    if let Some((_, first)) = found.first_mut() {
        first.chosen = true;
    }
    found
}

/// False where no GPU can be there, whatever drivers there are: told without loading any, which takes a moment and memory.
pub fn may_have_hardware() -> bool {
    // Linux reaches each through one of these: most, NVIDIA's driver, Windows beneath it, Adreno's and Mali's.
    const NODES: [&str; 5] = [
        "/dev/dri",
        "/dev/nvidiactl",
        "/dev/dxg",
        "/dev/kgsl-3d0",
        "/dev/mali0",
    ];
    !cfg!(target_os = "linux") || NODES.iter().any(|node| Path::new(node).exists())
}

impl Found {
    fn of(adapter: &wgpu::Adapter) -> Self {
        let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
        let kind = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => Kind::Discrete,
            wgpu::DeviceType::IntegratedGpu => Kind::Integrated,
            wgpu::DeviceType::Cpu => Kind::Software,
            wgpu::DeviceType::VirtualGpu | wgpu::DeviceType::Other => Kind::Other,
        };
        Self {
            name: info.name,
            api: info.backend.to_string(),
            driver: [info.driver, info.driver_info].join(" ").trim().to_owned(),
            kind,
            largest_buffer: limits.max_buffer_size,
            largest_binding: limits.max_storage_buffer_binding_size,
            workgroups: limits.max_compute_workgroups_per_dimension,
            timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
            subgroups: features.contains(wgpu::Features::SUBGROUP),
            chosen: false,
        }
    }
}

impl Device {
    /// All devices there are, the best first.
    pub fn list() -> Vec<Found> {
        adapters().into_iter().map(|(_, found)| found).collect()
    }

    /// Opens the best device that opens, be it one of software.
    ///
    /// # Errors
    /// There is none, or it does not open.
    pub fn open() -> Result<Self, GpuError> {
        Self::open_with(None)
    }

    /// The same, where what its driver compiles is kept in this folder for the next time.
    ///
    /// # Errors
    /// As [`Device::open`].
    pub fn open_with(pipelines: Option<&Path>) -> Result<Self, GpuError> {
        let mut refused = None;
        for (adapter, found) in adapters() {
            match Self::open_one(&adapter, found, pipelines) {
                Ok(device) => return Ok(device),
                // The best one's words count.
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        let why = "there is no Vulkan, Metal or DX12 driver with a device";
        Err(refused.unwrap_or_else(|| GpuError::NoDevice(why.to_owned())))
    }

    fn open_one(
        adapter: &wgpu::Adapter,
        found: Found,
        pipelines: Option<&Path>,
    ) -> Result<Self, GpuError> {
        let limits = adapter.limits();
        let mut wanted = wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::SUBGROUP;
        wanted.set(wgpu::Features::PIPELINE_CACHE, pipelines.is_some());
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("hdTrapeze"),
            required_features: adapter.features() & wanted,
            required_limits: limits,
            ..Default::default()
        };
        let (device, queue) =
            pollster::block_on(adapter.request_device(&descriptor)).map_err(|error| {
                GpuError::Refused {
                    name: found.name.clone(),
                    why: error.to_string(),
                }
            })?;
        let fault: Fault = Arc::default();
        let note = {
            let (fault, name) = (Arc::clone(&fault), found.name.clone());
            move |make: fn(String, String) -> GpuError, why: String| {
                let mut fault = fault.lock().unwrap_or_else(PoisonError::into_inner);
                // The first tells most.
                fault.get_or_insert_with(|| make(name.clone(), why));
            }
        };
        let failed = note.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            failed(
                |name, why| GpuError::Failed { name, why },
                error.to_string(),
            );
        }));
        device.set_device_lost_callback(move |reason, why| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                note(|name, why| GpuError::Lost { name, why }, why);
            }
        });
        let info = adapter.get_info();
        let pipelines = pipelines.and_then(|folder| KeptPipelines::open(&device, &info, folder));
        Ok(Self {
            device,
            queue,
            found,
            fault,
            pipelines,
        })
    }

    /// Where pipelines that are made are kept, if anywhere.
    pub(crate) fn pipelines(&self) -> Option<&KeptPipelines> {
        self.pipelines.as_ref()
    }

    /// True where pipelines of another run were found.
    pub fn has_kept_pipelines(&self) -> bool {
        self.pipelines().is_some_and(KeptPipelines::were_found)
    }

    /// What it is.
    pub fn found(&self) -> &Found {
        &self.found
    }

    /// What went wrong, if anything did.
    ///
    /// # Errors
    /// A stage failed or the device is lost: it is of no more use.
    pub fn check(&self) -> Result<(), GpuError> {
        let fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        fault.clone().map_or(Ok(()), Err)
    }

    /// Waits for what was submitted last.
    pub(crate) fn wait(&self, submission: wgpu::SubmissionIndex) -> Result<(), GpuError> {
        self.wait_for(submission, PATIENCE)
    }

    /// Waits until all that was submitted has run. A device that takes longer than `patience` counts as lost.
    ///
    /// # Errors
    /// It failed or is lost.
    pub fn finish(&self, patience: Duration) -> Result<(), GpuError> {
        self.wait_for(self.queue.submit([]), patience)
    }

    fn wait_for(
        &self,
        submission: wgpu::SubmissionIndex,
        patience: Duration,
    ) -> Result<(), GpuError> {
        let poll = wgpu::PollType::Wait {
            submission_index: Some(submission),
            timeout: Some(patience),
        };
        let waited = self.device.poll(poll);
        self.check()?;
        waited.map(drop).map_err(|error| {
            let lost = GpuError::Lost {
                name: self.found.name.clone(),
                why: error.to_string(),
            };
            // Nobody is to wait for it again.
            let mut fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
            fault.get_or_insert(lost).clone()
        })
    }

    /// A buffer with these bytes, which `what` names.
    ///
    /// # Errors
    /// It is larger than the device takes, or there is no memory.
    pub fn upload(&self, what: &'static str, bytes: &[u8]) -> Result<wgpu::Buffer, GpuError> {
        let usage = Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC;
        // A binding may not be empty.
        let buffer = self.buffer(what, (bytes.len() as u64).max(64), usage)?;
        self.queue.write_buffer(&buffer, 0, bytes);
        Ok(buffer)
    }

    /// Bytes of the largest buffer that can be bound.
    pub(crate) fn largest(&self) -> u64 {
        self.found.largest_buffer.min(self.found.largest_binding)
    }

    /// So many bytes of `what` are more than there may be.
    pub(crate) fn too_large(&self, what: &'static str, bytes: u64, limit: u64) -> GpuError {
        GpuError::TooLarge {
            name: self.found.name.clone(),
            what,
            bytes,
            limit,
        }
    }

    /// A buffer with one struct, for [`Binding::Uniform`](super::kernel::Binding::Uniform).
    ///
    /// # Errors
    /// As [`Device::upload`].
    pub(crate) fn uniform<T: Pod>(
        &self,
        what: &'static str,
        value: &T,
    ) -> Result<wgpu::Buffer, GpuError> {
        let bytes = (size_of::<T>() as u64).next_multiple_of(16);
        let buffer = self.buffer(what, bytes, Usage::UNIFORM | Usage::COPY_DST)?;
        self.queue
            .write_buffer(&buffer, 0, bytemuck::bytes_of(value));
        Ok(buffer)
    }

    /// A buffer that holds nothing yet.
    ///
    /// # Errors
    /// As [`Device::upload`].
    pub fn buffer(
        &self,
        what: &'static str,
        bytes: u64,
        usage: Usage,
    ) -> Result<wgpu::Buffer, GpuError> {
        if bytes > self.largest() {
            return Err(self.too_large(what, bytes, self.largest()));
        }
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT),
            usage,
            mapped_at_creation: false,
        });
        match pollster::block_on(scope.pop()) {
            Some(_) => Err(GpuError::OutOfMemory {
                name: self.found.name.clone(),
                what,
                bytes,
            }),
            None => Ok(buffer),
        }
    }
    /// Copies the start of a buffer that can be copied from.
    ///
    /// # Errors
    /// The device failed or is lost.
    pub fn fetch<T: Pod>(&self, from: &wgpu::Buffer, into: &mut [T]) -> Result<(), GpuError> {
        let bytes = size_of_val(into) as u64;
        if bytes == 0 {
            return Ok(());
        }
        let back = self.buffer("answers", bytes, Usage::MAP_READ | Usage::COPY_DST)?;
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(from, 0, &back, 0, bytes);
        let (done, mapped) = mpsc::channel();
        encoder.map_buffer_on_submit(&back, wgpu::MapMode::Read, .., move |result| {
            // Nobody listens where waiting failed.
            let _ = done.send(result.is_ok());
        });
        self.wait(self.queue.submit([encoder.finish()]))?;
        let unreadable = || GpuError::Failed {
            name: self.found.name.clone(),
            why: "its answers cannot be read".to_owned(),
        };
        // Another thread that waits for the device may be about to tell.
        if mapped.recv_timeout(PATIENCE) != Ok(true) {
            return Err(unreadable());
        }
        let view = back.get_mapped_range(..).map_err(|_| unreadable())?;
        let to: &mut [u8] = bytemuck::cast_slice_mut(into);
        to.copy_from_slice(&view[..to.len()]);
        Ok(())
    }
}
