//! Subsets of a mesh as hosts describe them (UsdGeomSubset), unchecked.

use std::sync::Arc;

/// What the indices of a subset number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // they are what they are called
pub enum SubsetElement {
    #[default]
    Face,
    Point,
    Edge,
    Segment,
    Tetrahedron,
}

impl SubsetElement {
    /// More than one of them, as a word.
    pub fn plural(self) -> &'static str {
        match self {
            SubsetElement::Face => "faces",
            SubsetElement::Point => "points",
            SubsetElement::Edge => "edges",
            SubsetElement::Segment => "segments",
            SubsetElement::Tetrahedron => "tetrahedra",
        }
    }
}

/// What the subsets of a family promise (familyType).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FamilyType {
    /// Nothing.
    #[default]
    Unrestricted,
    /// No element is in two of them.
    NonOverlapping,
    /// Each element is in one of them.
    Partition,
}

/// One subset.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SubsetDesc {
    /// Its path, for messages.
    pub path: String,
    /// familyName; empty where it has none.
    pub family: String,
    /// Of its family; that of the family's first subset counts.
    pub family_type: FamilyType,
    /// What its indices number.
    pub element: SubsetElement,
    /// Authored elements, at the frame.
    pub indices: Arc<Vec<i32>>,
}
