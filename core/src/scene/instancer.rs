//! Instancers as hosts describe them: raw arrays of UsdGeomPointInstancer, or matrices of native
//! instances (hydra:instanceTransforms).
//!
//! As in Hydra, prims and other instancers are *parts of a prototype* of an instancer
//! ([`super::PrimCommon::instancer`], [`InstancerDesc::parent`]). A point p of a prim goes to
//!
//! ```text
//! p * the prim's transform * matrix * scale * orientation * position * the instancer's transform
//!   * (the same of one instance of the instancer's parent, if it has one)
//! ```
//!
//! in USD's row vectors, for each instance of the prim's prototype number that is not masked.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat4, Quat, Vec3};

use super::{PrimId, PrimvarDesc, Samples, TransformSamples};

/// A part of a scene: prototype number of an instancer.
pub type PrototypeOf = (PrimId, u32);

/// Arrays of an instancer, one value an instance in each, unchecked. An array that is not given
/// (no samples) has no effect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InstanceArrays {
    /// Number of instances; with [`Self::lists`], 0 is as many as have a position or a matrix.
    pub instance_count: usize,
    /// Prototype number of each; empty: all are of prototype 0.
    pub prototypes: Vec<i32>,
    /// In place of `prototypes`, the instances of each prototype, as Hydra has them. Then instanceId shows
    /// places in these lists, and flat numbers of nested instancers count their lengths.
    pub lists: Vec<Vec<i32>>,
    /// Number of prototypes: instances of others are left out with a warning. 0: it is not known.
    pub prototype_count: usize,
    /// 0 for instances that are not there (invisibleIds, inactiveIds); empty: all are.
    pub mask: Vec<u8>,
    /// Numbers that the instanceId AOV shows in place of 0, 1, 2..., or empty. Not used for parts of
    /// nested instancers.
    pub ids: Vec<i32>,
    /// Instancer space.
    pub positions: Samples<Vec3>,
    /// Unit quaternions.
    pub orientations: Samples<Quat>,
    /// Factors along the prototype's axes.
    pub scales: Samples<Vec3>,
    /// Applied before scales.
    pub matrices: Samples<DMat4>,
    /// Between samples, matrices turn as those of [`TransformSamples::turns`] do.
    pub matrices_turn: bool,
    /// Units a second. With velocities or angular velocities, instances move on from the samples at or
    /// before the frame, and later samples of any array are not used.
    pub velocities: Samples<Vec3>,
    /// Units a second squared; used with velocities only.
    pub accelerations: Samples<Vec3>,
    /// Degrees a second about the vector's own direction; used with orientations only.
    pub angular_velocities: Samples<Vec3>,
    /// The stage's time codes a second; rates are ignored where it is not above 0.
    pub time_codes_per_second: f64,
}

/// An instancer.
#[derive(Clone, Debug, PartialEq)]
pub struct InstancerDesc {
    /// Path, for messages.
    pub path: String,
    /// Levels from the instancer up to the world, or to the root of the prototype that it is part of;
    /// its own first.
    pub transform: Vec<TransformSamples>,
    /// The prototype of another instancer that it is part of.
    pub parent: Option<PrototypeOf>,
    /// With 0, nothing that it places is visible.
    pub visible: bool,
    /// See [`super::PrimCommon::blur_scale`].
    pub blur_scale: f64,
    /// See [`super::PrimCommon::nonlinear_samples`].
    pub nonlinear_samples: Option<u32>,
    /// The instances.
    pub arrays: Arc<InstanceArrays>,
    /// Primvars by name that instances give to what they place, as if each were authored at the root of
    /// the instance: constant, or one value an instance (all other interpolations; a single value
    /// serves all). A prim's own primvar of the name wins, then that of the innermost instancer.
    pub primvars: BTreeMap<String, PrimvarDesc>,
}

impl InstancerDesc {
    /// An instancer without instances.
    pub fn new(path: impl Into<String>) -> Self {
        Self {
            path: path.into(),
            transform: Vec::new(),
            parent: None,
            visible: true,
            blur_scale: 1.0,
            nonlinear_samples: None,
            arrays: Arc::default(),
            primvars: BTreeMap::new(),
        }
    }
}
