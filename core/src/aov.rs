//! The AOVs: names, shapes, and what a pixel of each means.
//!
//! | name | values | meaning | background |
//! |---|---|---|---|
//! | color | 4 float | filtered radiance, premultiplied alpha | 0 |
//! | depth | 1 float | clip-space depth, 0 near to 1 far, point-sampled | 1 |
//! | cameraDepth | 1 float | distance along the view axis, scene units, point-sampled | 0 |
//! | P | 3 float | world position, scene units, point-sampled | 0 |
//! | normal | 3 float | world-space shading normal (of the side that is seen where a prim is double-sided, else of the front), mean over the samples that hit | 0 |
//! | Neye | 3 float | the same in camera space | 0 |
//! | primId, instanceId, elementId | 1 int | as the host numbers them; elementId is the authored face; point-sampled | -1 |
//! | subsetId | 1 int | number of the subset that the face is in, in its mesh's list: of the family materialBind, else of the first family; -1 in none; point-sampled | -1 |
//! | motionVectors | 2 float | raster movement from shutter open to close, pixels, x right and y down, mean over the samples that hit | 0 |
//! | sampleCount | 1 int | samples taken | 0 |
//! | cost | 2 float | nodes opened and micropolygons tested, mean per sample | 0 |
//! | primvars:NAME | 1 to 4 float | the primvar where the sample hit, mean over the samples that hit | 0 |
//! | primvars:NAME | 1 to 4 int | the same for whole numbers, point-sampled | -1 |
//!
//! What a primvar AOV holds is decided by the prims that have the primvar: all of them together give
//! it the widest of their types, of which it has the first four numbers. Prims that lack it give the
//! background.
//!
//! Point-sampled AOVs of a pixel all come from one and the same sample: the one nearest to the
//! pixel's centre. They are never averaged.

use std::sync::Arc;

/// What the names of primvar AOVs begin with.
pub const PRIMVAR_PREFIX: &str = "primvars:";

/// Most numbers of a primvar AOV.
pub const WIDEST_PRIMVAR: usize = 4;

/// One AOV. They are ordered: those below as they stand, then primvars by name.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs)] // the table above says what each is
pub enum Aov {
    Color,
    Depth,
    CameraDepth,
    P,
    Normal,
    Neye,
    PrimId,
    InstanceId,
    ElementId,
    SubsetId,
    MotionVectors,
    SampleCount,
    Cost,
    Primvar(Arc<PrimvarAov>),
}

/// A primvar as an AOV.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PrimvarAov {
    /// Name of the AOV, with its prefix.
    pub name: String,
    /// Values a pixel, 1 to [`WIDEST_PRIMVAR`].
    pub components: usize,
    /// Whole numbers, taken from one sample; else floats, averaged.
    pub is_integer: bool,
    /// The values are a colour's.
    pub is_color: bool,
    /// Place of its first value among those of all primvar AOVs of its kind of numbers.
    pub first: usize,
}

impl Aov {
    /// All but primvars.
    pub const ALL: [Aov; 13] = [
        Aov::Color,
        Aov::Depth,
        Aov::CameraDepth,
        Aov::P,
        Aov::Normal,
        Aov::Neye,
        Aov::PrimId,
        Aov::InstanceId,
        Aov::ElementId,
        Aov::SubsetId,
        Aov::MotionVectors,
        Aov::SampleCount,
        Aov::Cost,
    ];

    /// The name hosts use.
    pub fn name(&self) -> &str {
        match self {
            Aov::Color => "color",
            Aov::Depth => "depth",
            Aov::CameraDepth => "cameraDepth",
            Aov::P => "P",
            Aov::Normal => "normal",
            Aov::Neye => "Neye",
            Aov::PrimId => "primId",
            Aov::InstanceId => "instanceId",
            Aov::ElementId => "elementId",
            Aov::SubsetId => "subsetId",
            Aov::MotionVectors => "motionVectors",
            Aov::SampleCount => "sampleCount",
            Aov::Cost => "cost",
            Aov::Primvar(primvar) => &primvar.name,
        }
    }

    /// The AOV of that name; primvars are known only to a render that has them.
    pub fn from_name(name: &str) -> Option<Aov> {
        Aov::ALL.into_iter().find(|a| a.name() == name)
    }

    /// Values a pixel.
    pub fn components(&self) -> usize {
        match self {
            Aov::Primvar(primvar) => primvar.components,
            Aov::Color => 4,
            Aov::P | Aov::Normal | Aov::Neye => 3,
            Aov::MotionVectors | Aov::Cost => 2,
            _ => 1,
        }
    }

    /// True for i32 values, false for f32.
    pub fn is_integer(&self) -> bool {
        match self {
            Aov::Primvar(primvar) => primvar.is_integer,
            Aov::PrimId | Aov::InstanceId | Aov::ElementId | Aov::SubsetId | Aov::SampleCount => {
                true
            }
            _ => false,
        }
    }

    /// True for AOVs taken from one sample a pixel.
    pub fn is_point_sampled(&self) -> bool {
        match self {
            Aov::Primvar(primvar) => primvar.is_integer,
            Aov::Depth
            | Aov::CameraDepth
            | Aov::P
            | Aov::PrimId
            | Aov::InstanceId
            | Aov::ElementId
            | Aov::SubsetId => true,
            _ => false,
        }
    }
}

/// The primvar that an AOV's name asks for.
pub fn primvar_of(aov: &str) -> Option<&str> {
    aov.strip_prefix(PRIMVAR_PREFIX)
        .filter(|name| !name.is_empty())
}

/// Pixels of one AOV, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct AovImage {
    /// The image's pixel that the first one here is, x right and y down: 0 or below, where overscan
    /// reaches out to the left or above.
    pub origin: [i32; 2],
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Values a pixel.
    pub components: usize,
    /// `width * height * components` values.
    pub data: AovData,
}

/// Values of an AOV.
#[derive(Clone, Debug, PartialEq)]
pub enum AovData {
    /// Floats.
    F32(Vec<f32>),
    /// Integers.
    I32(Vec<i32>),
}
