//! The part of Embree 3's C interface that is used here, found at run time.
//!
//! Layouts are those of Embree 3.13's `rtcore_*.h`, built with one level of instances and without
//! `EMBREE_MIN_WIDTH`, which is how distributions build it.
#![allow(unsafe_code)]

use std::ffi::{c_char, c_int, c_uint, c_void};

use libloading::Library;

/// A device, scene or geometry.
pub type Handle = *mut c_void;

/// Called with bytes to be allocated or freed; false cancels.
pub type MemoryMonitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;

pub const GEOMETRY_TRIANGLE: c_uint = 0;
pub const GEOMETRY_QUAD: c_uint = 1;
pub const GEOMETRY_GRID: c_uint = 2;
pub const BUFFER_INDEX: c_uint = 0;
pub const BUFFER_VERTEX: c_uint = 1;
pub const BUFFER_GRID: c_uint = 8;
pub const FORMAT_UINT3: c_uint = 0x5003;
pub const FORMAT_UINT4: c_uint = 0x5004;
pub const FORMAT_FLOAT3: c_uint = 0x9003;
pub const FORMAT_GRID: c_uint = 0xA001;
pub const QUALITY_MEDIUM: c_uint = 1;
pub const QUALITY_HIGH: c_uint = 2;
pub const SCENE_COMPACT: c_uint = 1 << 1;
pub const CONTEXT_COHERENT: c_uint = 1;
pub const PROPERTY_VERSION: c_uint = 0;
pub const PROPERTY_RAY8: c_uint = 33;
pub const PROPERTY_RAY16: c_uint = 34;
pub const PROPERTY_STREAM: c_uint = 35;
pub const INVALID_ID: c_uint = c_uint::MAX;

/// `RTCGrid`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    pub first: c_uint,
    pub stride: c_uint,
    pub width: u16,
    pub height: u16,
}

/// `RTCIntersectContext`.
#[repr(C)]
#[derive(Debug)]
pub struct Context {
    pub flags: c_uint,
    pub filter: *mut c_void,
    pub instance: c_uint,
}

/// `RTCRayHit`, `RTCRayHit8` and `RTCRayHit16` but for the alignment of the wide ones.
#[repr(C, align(16))]
#[derive(Clone, Debug)]
pub struct RayHit<const N: usize> {
    pub origin: [[f32; N]; 3],
    pub t_near: [f32; N],
    pub dir: [[f32; N]; 3],
    pub time: [f32; N],
    pub t_far: [f32; N],
    pub mask: [c_uint; N],
    pub id: [c_uint; N],
    pub flags: [c_uint; N],
    pub normal: [[f32; N]; 3],
    pub u: [f32; N],
    pub v: [f32; N],
    pub primitive: [c_uint; N],
    pub geometry: [c_uint; N],
    pub instance: [c_uint; N],
}

/// A packet, as aligned as the widest must be.
#[repr(C, align(64))]
#[derive(Clone, Debug)]
pub struct Packet<const N: usize>(pub RayHit<N>);

const _: () = {
    assert!(size_of::<Grid>() == 12 && align_of::<Grid>() == 4);
    assert!(size_of::<Context>() == 24 && align_of::<Context>() == 8);
    assert!(size_of::<RayHit<1>>() == 80 && align_of::<RayHit<1>>() == 16);
    assert!(size_of::<Packet<8>>() == 640 && align_of::<Packet<8>>() == 64);
    assert!(size_of::<Packet<16>>() == 1280 && align_of::<Packet<16>>() == 64);
    // Where the hit begins: after a ray whose own size is a multiple of its alignment.
    assert!(std::mem::offset_of!(RayHit<1>, normal) == 48);
    assert!(std::mem::offset_of!(RayHit<8>, normal) == 384);
    assert!(std::mem::offset_of!(RayHit<16>, normal) == 768);
};

macro_rules! api {
    ($($name:ident($($arg:ty),*) $(-> $ret:ty)?;)*) => {
        /// Embree's functions, by their names in C.
        #[allow(non_snake_case)]
        #[derive(Clone, Copy, Debug)]
        pub struct Api {
            $(pub $name: unsafe extern "C" fn($($arg),*) $(-> $ret)?,)*
        }

        impl Api {
            /// Looks all of them up.
            ///
            /// # Safety
            /// `library` is Embree 3 and outlives every call.
            pub unsafe fn new(library: &Library) -> Result<Self, libloading::Error> {
                Ok(Self {
                    // SAFETY: the types are those of Embree 3's headers.
                    $($name: unsafe { *library.get(stringify!($name))? },)*
                })
            }
        }
    };
}

api! {
    rtcNewDevice(*const c_char) -> Handle;
    rtcReleaseDevice(Handle);
    rtcGetDeviceError(Handle) -> c_uint;
    rtcGetDeviceProperty(Handle, c_uint) -> isize;
    rtcSetDeviceMemoryMonitorFunction(Handle, Option<MemoryMonitor>, *mut c_void);
    rtcNewScene(Handle) -> Handle;
    rtcReleaseScene(Handle);
    rtcSetSceneFlags(Handle, c_uint);
    rtcSetSceneBuildQuality(Handle, c_uint);
    rtcAttachGeometry(Handle, Handle) -> c_uint;
    rtcCommitScene(Handle);
    rtcNewGeometry(Handle, c_uint) -> Handle;
    rtcReleaseGeometry(Handle);
    rtcCommitGeometry(Handle);
    rtcSetGeometryBuildQuality(Handle, c_uint);
    rtcSetGeometryTimeStepCount(Handle, c_uint);
    rtcSetSharedGeometryBuffer(
        Handle, c_uint, c_uint, c_uint, *const c_void, usize, usize, usize
    );
    rtcIntersect1(Handle, *mut Context, *mut RayHit<1>);
    rtcIntersect8(*const c_int, Handle, *mut Context, *mut Packet<8>);
    rtcIntersect16(*const c_int, Handle, *mut Context, *mut Packet<16>);
    rtcIntersect1M(Handle, *mut Context, *mut RayHit<1>, c_uint, usize);
    rtcIntersectNM(Handle, *mut Context, *mut Packet<16>, c_uint, c_uint, usize);
    rtcOccluded1(Handle, *mut Context, *mut RayHit<1>);
    rtcOccluded8(*const c_int, Handle, *mut Context, *mut Packet<8>);
    rtcOccluded16(*const c_int, Handle, *mut Context, *mut Packet<16>);
    rtcOccluded1M(Handle, *mut Context, *mut RayHit<1>, c_uint, usize);
}
