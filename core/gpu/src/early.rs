//! Vertices that go to a device while the scene is still being diced, so that its bus works beside the CPU.
//!
//! Core tells of each object as soon as its vertices are final. Large ones are uploaded at once, small ones once there are
//! enough for a chunk, by the thread that has diced them: a copy to where the device fetches it, and no wait. When pages are laid
//! out, what is there is copied from one place of the device to another; the rest is uploaded then,
//! and so is all of an object that is cut into pages. The bytes of pages are the same.
//!
//! **Bounds.** No more bytes wait on a device than [`EarlyLimits`] allow, and as many on the host for their way there. What would be
//! more is uploaded later, and so is everything where the device has no room for a chunk; none of them waits any more then. Chunks are
//! freed once they are copied, before trees are made.
//!
//! **What never comes.** Dropped, all chunks are freed: of a commit that was interrupted, of prims that were edited meanwhile.

use std::collections::HashMap;
use std::ops::Range;
use std::ptr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use bytemuck::cast_slice;
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::render::Watcher;

use super::{Device, FirstOnDevice, FrameOptions, GpuError, Stages};

/// How much is uploaded ahead, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EarlyLimits {
    /// What is worth a transfer of its own.
    pub chunk: u64,
    /// What waits on a device at most.
    pub most: u64,
}

impl Default for EarlyLimits {
    fn default() -> Self {
        Self {
            chunk: 4 << 20,
            most: 1 << 30,
        }
    }
}

/// See the module's text.
#[derive(Debug)]
pub struct EarlyVertices {
    device: Arc<Device>,
    limits: EarlyLimits,
    state: Mutex<State>,
}

/// What was uploaded ahead, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EarlyBytes {
    /// All that was.
    pub uploaded: u64,
    /// What had been submitted when the last object was diced.
    pub beside: u64,
    /// What pages have of it.
    pub used: u64,
}

#[derive(Debug, Default)]
struct State {
    /// Objects, by where they are in memory: nothing else is there while somebody knows of them.
    there: HashMap<usize, (Weak<ObjectGeometry>, There)>,
    /// Coordinates of objects that wait for others.
    waiting: Vec<f32>,
    objects: Vec<Placed>,
    /// What is on the device, on its way there or waiting.
    admitted: u64,
    /// Nothing more is uploaded.
    closed: bool,
    bytes: EarlyBytes,
}

/// An object, and its coordinates in a chunk.
type Placed = (Weak<ObjectGeometry>, Range<usize>);

/// Vertices of an object on a device.
#[derive(Clone, Debug)]
pub(crate) struct There {
    pub buffer: wgpu::Buffer,
    /// Its bytes.
    pub bytes: Range<u64>,
}

impl EarlyVertices {
    /// For a scene that is taken to the device of `stages` in this way; none where the CPU makes its trees.
    pub fn for_frame(stages: &Stages, options: &FrameOptions) -> Option<Self> {
        let device = stages.device();
        (options.first < FirstOnDevice::Instances)
            .then(|| Self::new(device, EarlyLimits::default()))
    }

    /// For a scene on this device.
    pub fn new(device: &Arc<Device>, limits: EarlyLimits) -> Self {
        Self {
            device: Arc::clone(device),
            limits,
            state: Mutex::default(),
        }
    }

    /// What was uploaded by now.
    pub fn bytes(&self) -> EarlyBytes {
        self.state().bytes
    }

    /// True where both are for the same device.
    pub fn is_like(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.device, &other.device)
    }

    /// Where the vertices of an object are, which is asked once.
    pub(crate) fn take(&self, object: &ObjectGeometry) -> Option<There> {
        let mut state = self.state();
        let (_, there) = state.there.remove(&place(object))?;
        state.bytes.used += there.bytes.end - there.bytes.start;
        Some(there)
    }

    /// Frees what there is of an object.
    pub(crate) fn forget(&self, object: &ObjectGeometry) {
        self.state().there.remove(&place(object));
    }

    /// Frees all there is, and takes no more.
    pub(crate) fn close(&self) -> Result<(), GpuError> {
        let mut state = self.state();
        state.closed = true;
        (state.waiting, state.objects) = Default::default();
        let there = std::mem::take(&mut state.there);
        drop(state);
        if there.is_empty() {
            return Ok(());
        }
        drop(there);
        // The device lets go of what nothing that was submitted needs.
        self.device.wait(self.device.queue.submit([]))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn upload(&self, floats: &[f32], objects: Vec<Placed>) {
        let sent = self.sent(floats);
        let mut state = self.state();
        let Ok(buffer) = sent else {
            drop(state);
            // The frame does without; what is wrong with the device, it tells then.
            let _ = self.close();
            return;
        };
        if state.closed {
            return;
        }
        state.bytes.uploaded += size_of_val(floats) as u64;
        for (object, range) in objects {
            let [start, end] = [range.start, range.end].map(|i| (i * size_of::<f32>()) as u64);
            let there = There {
                buffer: buffer.clone(),
                bytes: start..end,
            };
            let place = object.as_ptr().addr();
            state.there.insert(place, (object, there));
        }
    }

    /// A buffer with these coordinates, which are on their way.
    fn sent(&self, floats: &[f32]) -> Result<wgpu::Buffer, GpuError> {
        let device = &*self.device;
        device.check()?;
        let scope = device
            .device
            .push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffer = device.upload("early vertices", cast_slice(floats));
        // Else they would go with what is submitted next.
        device.queue.submit([]);
        match pollster::block_on(scope.pop()) {
            None => buffer,
            Some(_) => Err(GpuError::OutOfMemory {
                name: device.found().name.clone(),
                what: "early vertices",
                bytes: size_of_val(floats) as u64,
            }),
        }
    }
}

impl Watcher for EarlyVertices {
    fn diced(&self, object: &Arc<ObjectGeometry>) {
        let vertices = object.mesh().floats();
        let bytes = size_of_val(vertices) as u64;
        let mut state = self.state();
        state.bytes.beside = state.bytes.uploaded;
        let is_too_large =
            bytes > self.device.largest() || state.admitted + bytes > self.limits.most;
        if state.closed || vertices.is_empty() || is_too_large {
            return;
        }
        state.admitted += bytes;
        let known = Arc::downgrade(object);
        if bytes >= self.limits.chunk {
            drop(state);
            return self.upload(vertices, vec![(known, 0..vertices.len())]);
        }
        let first = state.waiting.len();
        state.waiting.extend_from_slice(vertices);
        let range = first..state.waiting.len();
        state.objects.push((known, range));
        if size_of_val(&state.waiting[..]) as u64 >= self.limits.chunk {
            let waiting = std::mem::take(&mut state.waiting);
            let objects = std::mem::take(&mut state.objects);
            drop(state);
            self.upload(&waiting, objects);
        }
    }
}

impl Drop for EarlyVertices {
    fn drop(&mut self) {
        // A device that has failed frees it by itself.
        let _ = self.close();
    }
}

fn place(object: &ObjectGeometry) -> usize {
    ptr::from_ref(object).addr()
}
