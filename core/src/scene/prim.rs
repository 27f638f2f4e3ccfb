//! What all geometry prims have: transforms, primvars, instances, visibility.

use std::collections::BTreeMap;

use glam::DMat4;

use super::{Geometry, PrimvarDesc, PrototypeOf};

/// Matrix samples of one level of the hierarchy. Matrices map local to parent, column vectors
/// (USD's row-vector matrices in row-major order have the same sixteen numbers in memory).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TransformSamples {
    /// Time codes relative to the frame; any order; one or more.
    pub times: Vec<f64>,
    /// One matrix a time.
    pub matrices: Vec<DMat4>,
    /// Between samples, rotations turn at constant speed about the level's own origin, where the samples show
    /// that they do ([`crate::motion::turn`]). Otherwise matrices are interpolated entry by entry.
    pub turns: bool,
}

/// What all geometry prims have.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimCommon {
    /// Path, for messages and metadata.
    pub path: String,
    /// Transform levels, the prim's own first, then its parent's, up to the root: of the stage, or of the
    /// prototype that the prim is part of (that root's own level included).
    pub transform: Vec<TransformSamples>,
    /// The prototype of an instancer that the prim is part of; none: it appears once.
    pub instancer: Option<PrototypeOf>,
    /// Primvars by name; `displayColor`, `displayOpacity` and `normals` are shaded with.
    pub primvars: BTreeMap<String, PrimvarDesc>,
    /// Visible to the camera.
    pub visible: bool,
    /// A holdout: occludes like any other surface, with zero colour and zero alpha, and gives no
    /// other AOV a value.
    pub matte: bool,
    /// primId AOV value.
    pub pick_id: i32,
    /// Factor on the motion that is blurred (UsdGeomMotionAPI's motion:blurScale): times relative to
    /// the frame are multiplied by it. 1 as created, 0 for no blur.
    pub blur_scale: f64,
    /// Position samples over the shutter where rates bend a path (motion:nonlinearSampleCount);
    /// `None`: as many as the path needs.
    pub nonlinear_samples: Option<u32>,
    /// Both sides are outsides (UsdGeomGprim's doubleSided): normals are those of the side that is
    /// seen. Otherwise they are the front's, from whichever side.
    pub double_sided: bool,
}

/// One prim.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimDesc {
    /// What all prims have.
    pub common: PrimCommon,
    /// Geometry.
    pub geometry: Geometry,
}

impl PrimCommon {
    /// A visible prim at the origin with no primvars.
    pub fn new(path: impl Into<String>) -> Self {
        Self {
            path: path.into(),
            transform: Vec::new(),
            instancer: None,
            primvars: BTreeMap::new(),
            visible: true,
            matte: false,
            pick_id: 0,
            blur_scale: 1.0,
            nonlinear_samples: None,
            double_sided: false,
        }
    }
}
