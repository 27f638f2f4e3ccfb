//! Primvars as hosts describe them: raw samples of numbers, unchecked.

use std::sync::Arc;

/// UsdGeomPrimvar's interpolation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// One value.
    #[default]
    Constant,
    /// One a face.
    Uniform,
    /// One a vertex, linear over faces.
    Varying,
    /// One a vertex, smoothed with the scheme.
    Vertex,
    /// One a face-vertex.
    FaceVarying,
}

/// What the numbers of a primvar are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PrimvarRole {
    /// Anything.
    #[default]
    None,
    /// A colour: its AOV has channels R, G, B and A.
    Color,
}

/// Numbers of one sample, all values one after the other.
#[derive(Clone, Debug, PartialEq)]
pub enum PrimvarValues {
    /// Real numbers, interpolated over the surface and between times.
    Float(Vec<f32>),
    /// Whole numbers, never interpolated: a point of the surface has the value nearest to it, and a time
    /// that of the sample at or before it.
    Int(Vec<i32>),
}

impl PrimvarValues {
    /// Count of numbers.
    pub fn len(&self) -> usize {
        match self {
            PrimvarValues::Float(values) => values.len(),
            PrimvarValues::Int(values) => values.len(),
        }
    }

    /// True without numbers.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A primvar at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimvarSample {
    /// Time code relative to the frame.
    pub time: f64,
    /// Values.
    pub values: Arc<PrimvarValues>,
    /// Indices into the values, or empty: each value in turn.
    pub indices: Arc<Vec<i32>>,
}

/// A primvar.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimvarDesc {
    /// Interpolation.
    pub interpolation: Interpolation,
    /// Role.
    pub role: PrimvarRole,
    /// True where whole numbers are the bits of unsigned ones.
    pub is_unsigned: bool,
    /// Numbers of the type: 3 of a colour, 16 of a matrix.
    pub width: usize,
    /// elementSize as authored: so many of the type are one value.
    pub element_size: i32,
    /// Index that stands for values that were not authored (unauthoredValuesIndex), -1 for none. What
    /// it points at is taken as a value; where it points at nothing, the value is 0.
    pub unauthored_index: i32,
    /// One or more, in any order of times; both values and indices may differ between them.
    pub samples: Vec<PrimvarSample>,
}

impl PrimvarDesc {
    /// True for whole numbers.
    pub fn is_integer(&self) -> bool {
        let whole = |s: &PrimvarSample| matches!(*s.values, PrimvarValues::Int(_));
        self.samples.iter().any(whole)
    }

    /// Floats and indices of the sample that is nearest to the frame; `None` for whole numbers.
    pub fn floats_at_frame(&self) -> Option<(&[f32], &[i32])> {
        let nearest =
            |a: &&PrimvarSample, b: &&PrimvarSample| a.time.abs().total_cmp(&b.time.abs());
        let sample = self.samples.iter().min_by(nearest)?;
        match &*sample.values {
            PrimvarValues::Float(values) => Some((values, &sample.indices)),
            PrimvarValues::Int(_) => None,
        }
    }

    /// Floats that never change, `width` a value; not indexed where `indices` is empty.
    pub fn still(
        interpolation: Interpolation,
        width: usize,
        values: Vec<f32>,
        indices: Vec<i32>,
    ) -> Self {
        Self {
            interpolation,
            role: PrimvarRole::None,
            is_unsigned: false,
            width,
            element_size: 1,
            unauthored_index: -1,
            samples: vec![PrimvarSample {
                time: 0.0,
                values: Arc::new(PrimvarValues::Float(values)),
                indices: Arc::new(indices),
            }],
        }
    }
}
