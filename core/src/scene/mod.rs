//! The scene as hosts describe it: raw samples, authored topology, settings. Nothing is resolved to
//! a shutter or a camera here.
//!
//! Times are time codes relative to the frame being rendered, the same unit as the camera's shutter.
//! Prims are shared (`Arc`) so that an edit copies one prim, and unchanged prims are recognised by
//! pointer.

pub mod camera;
pub mod geometry;
pub mod instancer;
pub mod prim;
pub mod primvar;
pub mod settings;
mod still;
pub mod subset;

use std::collections::BTreeMap;
use std::sync::Arc;

pub use camera::{
    ApertureDesc, CameraDesc, LensSample, Projection, ShutterCurveDesc, ShutterCurveKind,
};
pub use geometry::{
    Axis, CurveBasis, CurveForm, CurveWrap, CurvesDesc, Geometry, GridsDesc, ImplicitDesc,
    ImplicitKind, MeshDesc, NurbsCurvesDesc, NurbsPatchDesc, PointsSamples, Rates, Samples,
    SpheresDesc,
};
pub use instancer::{InstanceArrays, InstancerDesc, PrototypeOf};
pub use prim::{PrimCommon, PrimDesc, TransformSamples};
pub use primvar::{Interpolation, PrimvarDesc, PrimvarRole, PrimvarSample, PrimvarValues};
pub use settings::{Backend, Cull, FilterKind, RenderSettings, WindowPolicy};
pub use subset::{FamilyType, SubsetDesc, SubsetElement};

/// Identifies a prim for the life of a scene; never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PrimId(pub u64);

/// Everything a render needs to know.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Geometry, in the order of creation.
    pub prims: BTreeMap<PrimId, Arc<PrimDesc>>,
    /// Instancers.
    pub instancers: BTreeMap<PrimId, Arc<InstancerDesc>>,
    /// Cameras.
    pub cameras: BTreeMap<PrimId, Arc<CameraDesc>>,
    /// The camera to render through; with none, nothing can be rendered.
    pub active_camera: Option<PrimId>,
    /// Settings.
    pub settings: Arc<RenderSettings>,
}
