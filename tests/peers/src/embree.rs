//! Embree 3, safe to use: devices, scenes of one geometry, batches of rays on all threads.
//!
//! Flush-to-zero and denormals-are-zero are set in each thread around Embree's calls, as its manual
//! asks, and only there: our own tests need gradual underflow.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_int, c_uint, c_void};
use std::sync::atomic::{AtomicI64, Ordering::Relaxed};

use libloading::Library;
use rayon::prelude::*;

use crate::batch::{Answer, Batch, Call, Width};
use crate::ffi::{self, Api, Context, Handle, INVALID_ID, Packet, RayHit};
use crate::scenes::{Indices, Shape, Vertices};

/// Names that the library has on Linux and macOS.
const NAMES: [&str; 4] = [
    "libembree3.so.3",
    "libembree3.so",
    "libembree3.dylib",
    "libembree3.3.dylib",
];

/// How a scene is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    pub shape: Shape,
    /// High build quality, else medium, which is Embree's default.
    pub high: bool,
    /// The scene flag "compact".
    pub compact: bool,
}

impl Variant {
    pub fn name(&self) -> String {
        let (high, compact) = (self.high, self.compact);
        let more = |on: bool, text: &'static str| if on { text } else { "" };
        let shape = self.shape.name();
        format!(
            "{shape}{}{}",
            more(high, " high"),
            more(compact, " compact")
        )
    }
}

/// Bytes that Embree has told of.
#[derive(Debug)]
struct Memory {
    now: AtomicI64,
    peak: AtomicI64,
    limit: AtomicI64,
}

/// A device.
#[derive(Debug)]
pub struct Embree {
    api: Api,
    device: Handle,
    memory: Box<Memory>,
}

// SAFETY: Embree's devices may be used from any thread.
unsafe impl Sync for Embree {}

/// Why there is no scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// More memory than allowed.
    Memory,
    /// Embree's error code.
    Error(c_uint),
}

impl Embree {
    /// Loads the library and makes a device, whose build threads are already started; None where it is
    /// not installed or is not Embree 3.
    pub fn find() -> Option<Self> {
        // SAFETY: Embree's initialisers have no requirements.
        let library = NAMES
            .iter()
            .find_map(|name| unsafe { Library::new(*name).ok() })?;
        // Never unloaded: the build threads outlive the device.
        let library = Box::leak(Box::new(library));
        // SAFETY: the functions stay where they are.
        let api = unsafe { Api::new(library).ok()? };
        // SAFETY: a C string.
        let device = unsafe { (api.rtcNewDevice)(CONFIG.as_ptr()) };
        if device.is_null() {
            return None;
        }
        let memory = Box::new(Memory {
            now: AtomicI64::new(0),
            peak: AtomicI64::new(0),
            limit: AtomicI64::new(i64::MAX),
        });
        let user = (&raw const *memory).cast_mut().cast();
        // SAFETY: the counters live in a box that is dropped after the device.
        unsafe { (api.rtcSetDeviceMemoryMonitorFunction)(device, Some(monitor), user) };
        let embree = Self {
            api,
            device,
            memory,
        };
        (embree.property(ffi::PROPERTY_VERSION) / 10000 == 3).then_some(embree)
    }

    fn property(&self, which: c_uint) -> isize {
        // SAFETY: a live device.
        unsafe { (self.api.rtcGetDeviceProperty)(self.device, which) }
    }

    /// Major, minor and patch version.
    pub fn version(&self) -> String {
        let v = self.property(ffi::PROPERTY_VERSION);
        format!("{}.{}.{}", v / 10000, v / 100 % 100, v % 100)
    }

    /// Widths that are native here.
    pub fn widths(&self) -> Vec<Width> {
        let mut widths = vec![Width::One];
        if self.property(ffi::PROPERTY_RAY8) != 0 {
            widths.push(Width::Eight);
        }
        if self.property(ffi::PROPERTY_RAY16) != 0 {
            widths.push(Width::Sixteen);
        }
        if self.property(ffi::PROPERTY_STREAM) != 0 {
            widths.extend([Width::Stream, Width::Stream16]);
        }
        widths
    }

    /// Builds a scene of one geometry that shares the given buffers. Embree may allocate up to
    /// `limit` bytes more.
    pub fn scene<'a>(
        &'a self,
        variant: Variant,
        vertices: &'a Vertices,
        indices: &'a Indices,
        limit: u64,
    ) -> Result<Scene<'a>, Refusal> {
        let before = self.memory.now.load(Relaxed);
        self.memory.peak.store(before, Relaxed);
        let most = before.saturating_add_unsigned(limit);
        self.memory.limit.store(most, Relaxed);
        let api = &self.api;
        let (kind, buffer, format, at, stride, count) = match indices {
            Indices::Grids(v) => {
                let (kind, buffer) = (ffi::GEOMETRY_GRID, ffi::BUFFER_GRID);
                (
                    kind,
                    buffer,
                    ffi::FORMAT_GRID,
                    v.as_ptr().cast(),
                    12,
                    v.len(),
                )
            }
            Indices::Quads(v) => {
                let (kind, buffer) = (ffi::GEOMETRY_QUAD, ffi::BUFFER_INDEX);
                (
                    kind,
                    buffer,
                    ffi::FORMAT_UINT4,
                    v.as_ptr().cast(),
                    16,
                    v.len(),
                )
            }
            Indices::Triangles(v) => {
                let (kind, buffer) = (ffi::GEOMETRY_TRIANGLE, ffi::BUFFER_INDEX);
                (
                    kind,
                    buffer,
                    ffi::FORMAT_UINT3,
                    v.as_ptr().cast(),
                    12,
                    v.len(),
                )
            }
        };
        let quality = if variant.high {
            ffi::QUALITY_HIGH
        } else {
            ffi::QUALITY_MEDIUM
        };
        let flags = if variant.compact {
            ffi::SCENE_COMPACT
        } else {
            0
        };
        let mut handle: Handle = std::ptr::null_mut();
        flushed(|| {
            // SAFETY: live handles; buffers outlive the scene ('a), hold what the counts say, and are
            // readable for 16 bytes from their last vertex (see `Vertices`).
            unsafe {
                handle = (api.rtcNewScene)(self.device);
                (api.rtcSetSceneFlags)(handle, flags);
                (api.rtcSetSceneBuildQuality)(handle, quality);
                let geometry = (api.rtcNewGeometry)(self.device, kind);
                let keys = vertices.keys();
                (api.rtcSetGeometryBuildQuality)(geometry, quality);
                (api.rtcSetGeometryTimeStepCount)(geometry, keys.len() as c_uint);
                let set = api.rtcSetSharedGeometryBuffer;
                for (slot, key) in keys.iter().enumerate() {
                    let at: *const c_void = key.as_ptr().cast();
                    let (slot, vertex) = (slot as c_uint, ffi::BUFFER_VERTEX);
                    set(
                        geometry,
                        vertex,
                        slot,
                        ffi::FORMAT_FLOAT3,
                        at,
                        0,
                        12,
                        vertices.count(),
                    );
                }
                set(geometry, buffer, 0, format, at, 0, stride, count);
                (api.rtcCommitGeometry)(geometry);
                (api.rtcAttachGeometry)(handle, geometry);
                (api.rtcReleaseGeometry)(geometry);
                (api.rtcCommitScene)(handle);
            }
        });
        // SAFETY: a live device.
        let error = unsafe { (api.rtcGetDeviceError)(self.device) };
        let bytes =
            |counter: &AtomicI64| counter.load(Relaxed).saturating_sub(before).max(0) as u64;
        let scene = Scene {
            embree: self,
            handle,
            indices,
            vertices,
            bytes: bytes(&self.memory.now),
            peak_bytes: bytes(&self.memory.peak),
        };
        self.memory.limit.store(i64::MAX, Relaxed);
        match error {
            0 => Ok(scene),
            4 | 6 => Err(Refusal::Memory),
            other => Err(Refusal::Error(other)),
        }
    }
}

const CONFIG: &CStr = c"start_threads=1,set_affinity=0";

/// Counts; refuses what goes beyond the limit before it is allocated.
///
/// # Safety
/// `user` is a [`Memory`].
unsafe extern "C" fn monitor(user: *mut c_void, bytes: isize, post: bool) -> bool {
    // SAFETY: see above.
    let memory = unsafe { &*user.cast::<Memory>() };
    let bytes = bytes as i64;
    if !post && bytes > 0 && memory.now.load(Relaxed) + bytes > memory.limit.load(Relaxed) {
        return false;
    }
    let now = memory.now.fetch_add(bytes, Relaxed) + bytes;
    memory.peak.fetch_max(now, Relaxed);
    true
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: scenes borrow the device, so none is left.
        unsafe { (self.api.rtcReleaseDevice)(self.device) };
    }
}

/// A committed scene.
#[derive(Debug)]
pub struct Scene<'a> {
    embree: &'a Embree,
    handle: Handle,
    vertices: &'a Vertices,
    indices: &'a Indices,
    /// Bytes that Embree has allocated for it, without the shared buffers.
    pub bytes: u64,
    /// The most that it had while building.
    pub peak_bytes: u64,
}

// SAFETY: Embree's queries of a committed scene may run on many threads.
unsafe impl Sync for Scene<'_> {}

/// Rays that one thread takes at a time.
pub const CHUNK: usize = 4096;

#[repr(align(64))]
struct All([c_int; 16]);

/// Every lane of a packet is a ray.
static ALL: All = All([-1; 16]);

impl Scene<'_> {
    /// Traces all rays, on all threads.
    pub fn trace(&self, batch: &mut Batch, call: Call) {
        match batch {
            Batch::One(rays) => rays
                .par_chunks_mut(CHUNK)
                .for_each(|rays| self.ones(rays, call)),
            Batch::Eight(rays) => {
                rays.par_chunks_mut(CHUNK / 8)
                    .for_each(|rays| self.eights(rays, call));
            }
            Batch::Sixteen(rays) => {
                rays.par_chunks_mut(CHUNK / 16)
                    .for_each(|rays| self.sixteens(rays, call));
            }
        }
    }

    fn ones(&self, rays: &mut [RayHit<1>], call: Call) {
        let (api, scene, mut context) = (self.embree.api, self.handle, context(call));
        let (one, many) = if call.any {
            (api.rtcOccluded1, api.rtcOccluded1M)
        } else {
            (api.rtcIntersect1, api.rtcIntersect1M)
        };
        flushed(|| {
            if call.width == Width::Stream {
                let count = rays.len() as c_uint;
                // SAFETY: a committed scene, and as many rays as said; a ray begins its ray with hit.
                unsafe {
                    many(
                        scene,
                        &mut context,
                        rays.as_mut_ptr(),
                        count,
                        size_of::<RayHit<1>>(),
                    )
                };
            } else {
                for ray in rays {
                    // SAFETY: the same, one at a time.
                    unsafe { one(scene, &mut context, ray) };
                }
            }
        });
    }

    fn eights(&self, rays: &mut [Packet<8>], call: Call) {
        let (api, scene, mut context) = (self.embree.api, self.handle, context(call));
        let packet = if call.any {
            api.rtcOccluded8
        } else {
            api.rtcIntersect8
        };
        flushed(|| {
            for ray in rays {
                // SAFETY: a committed scene, a whole packet, a mask of as many lanes.
                unsafe { packet(ALL.0.as_ptr(), scene, &mut context, ray) };
            }
        });
    }

    fn sixteens(&self, rays: &mut [Packet<16>], call: Call) {
        let (api, scene, mut context) = (self.embree.api, self.handle, context(call));
        let packet = if call.any {
            api.rtcOccluded16
        } else {
            api.rtcIntersect16
        };
        flushed(|| {
            if call.width == Width::Stream16 && !call.any {
                let (count, stride) = (rays.len() as c_uint, size_of::<Packet<16>>());
                let many = api.rtcIntersectNM;
                // SAFETY: a committed scene, and as many packets of 16 as said.
                unsafe { many(scene, &mut context, rays.as_mut_ptr(), 16, count, stride) };
            } else {
                for ray in rays {
                    // SAFETY: a committed scene, a whole packet, a mask of as many lanes.
                    unsafe { packet(ALL.0.as_ptr(), scene, &mut context, ray) };
                }
            }
        });
    }

    /// What Embree found for ray `i`, as a micropolygon.
    pub fn answer(&self, batch: &Batch, i: usize) -> Option<Answer> {
        let (t, primitive, u, v) = batch.raw(i)?;
        let cell = self.indices.cell(self.vertices, primitive as usize, u, v);
        Some(Answer { t, cell })
    }
}

impl Drop for Scene<'_> {
    fn drop(&mut self) {
        // SAFETY: a live scene; nobody else has it.
        unsafe { (self.embree.api.rtcReleaseScene)(self.handle) };
    }
}

fn context(call: Call) -> Context {
    Context {
        flags: if call.coherent {
            ffi::CONTEXT_COHERENT
        } else {
            0
        },
        filter: std::ptr::null_mut(),
        instance: INVALID_ID,
    }
}

/// Runs `f` with flush-to-zero and denormals-are-zero in this thread.
#[cfg(target_arch = "x86_64")]
fn flushed(f: impl FnOnce()) {
    use std::arch::asm;

    /// Flush-to-zero and denormals-are-zero.
    const MODES: u32 = 0x8040;

    struct Restore(u32);
    impl Drop for Restore {
        fn drop(&mut self) {
            // SAFETY: loads what was stored before.
            unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const self.0, options(nostack)) };
        }
    }

    let mut before = 0u32;
    // SAFETY: stores a control register in a variable.
    unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut before, options(nostack)) };
    let _restore = Restore(before);
    let wanted = before | MODES;
    // SAFETY: two modes of rounding of denormals; `f` computes with floats only inside Embree, and the
    // register is as it was before anything else of this program computes.
    unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const wanted, options(nostack)) };
    f();
}

/// Runs `f`; only x86-64 has modes that Embree asks for.
#[cfg(not(target_arch = "x86_64"))]
fn flushed(f: impl FnOnce()) {
    f();
}
