//! Subsets of meshes.

use std::sync::Arc;

use hdtrapeze_core::scene::{FamilyType, SubsetDesc, SubsetElement};

use super::pick;
use crate::fault::Fault;
use crate::input::{copied, slice, text};
use crate::types::*;

const ELEMENTS: [SubsetElement; 5] = [
    SubsetElement::Face,
    SubsetElement::Point,
    SubsetElement::Edge,
    SubsetElement::Segment,
    SubsetElement::Tetrahedron,
];

const FAMILIES: [FamilyType; 3] = [
    FamilyType::Unrestricted,
    FamilyType::NonOverlapping,
    FamilyType::Partition,
];

/// Safety: pointers in the structs are null or as the header says.
pub(crate) unsafe fn subsets(from: &[trz_subset]) -> Result<Arc<Vec<SubsetDesc>>, Fault> {
    let one = |(i, subset): (usize, &trz_subset)| {
        let name = |field: &str| format!("subsets[{i}].{field}");
        // SAFETY: as the caller promises.
        unsafe {
            let indices = slice(subset.indices, subset.index_count, &name("indices"))?;
            Ok(SubsetDesc {
                path: text(subset.path, &name("path"))?.to_owned(),
                family: text(subset.family, &name("family"))?.to_owned(),
                family_type: pick(&FAMILIES, subset.family_type, &name("family_type"))?,
                element: pick(&ELEMENTS, subset.element_type, &name("element_type"))?,
                indices: Arc::new(copied(indices, |&index| index)?),
            })
        }
    };
    let all: Result<Vec<_>, Fault> = from.iter().enumerate().map(one).collect();
    all.map(Arc::new)
}
