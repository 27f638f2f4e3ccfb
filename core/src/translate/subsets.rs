//! Checks the subsets of a mesh, and tells of each face which one it is in.
//!
//! Nothing is lost for a fault: what is wrong with a subset gives warnings with its path, and its good
//! indices count. Subsets are few, faces are many: everything is one pass over the indices, with a number
//! a face beside them.

use std::collections::HashMap;

use crate::diagnostics::{Code, Warning};
use crate::scene::{FamilyType, SubsetDesc, SubsetElement};

/// The family that materials are bound by.
const MATERIALS: &str = "materialBind";

/// No subset.
const NONE: u32 = u32::MAX;

/// Faces of a subset: those of its indices that are faces of the mesh.
fn faces(subset: &SubsetDesc, face_count: usize) -> impl Iterator<Item = usize> {
    let indices: &[i32] = match subset.element {
        SubsetElement::Face => &subset.indices,
        _ => &[],
    };
    let known = move |&i: &i32| usize::try_from(i).ok().filter(|&i| i < face_count);
    indices.iter().filter_map(known)
}

/// A number for each face, or a warning that there is no memory for them.
fn numbers<T: Clone>(
    face_count: usize,
    number: T,
    path: &str,
    warnings: &mut Vec<Warning>,
) -> Option<Vec<T>> {
    let mut all = Vec::new();
    if all.try_reserve_exact(face_count).is_err() {
        let text = format!("no memory for the subsets of {face_count} faces; ignored");
        warnings.push(Warning::new(path, Code::Budget, text));
        return None;
    }
    all.resize(face_count, number);
    Some(all)
}

/// Warns of what is wrong with the subsets of a mesh of `face_count` authored faces.
pub fn check(path: &str, subsets: &[SubsetDesc], face_count: usize, warnings: &mut Vec<Warning>) {
    if subsets.is_empty() {
        return;
    }
    // The last subset that each face was met in.
    let Some(mut met) = numbers(face_count, NONE, path, warnings) else {
        return;
    };
    for (s, subset) in subsets.iter().enumerate() {
        if let Some(text) = indices(s as u32, subset, &mut met) {
            warnings.push(Warning::new(&subset.path, text.0, text.1));
        }
    }
    met.fill(NONE);
    for members in families(subsets) {
        family(&members, subsets, &mut met, warnings);
    }
}

/// Numbers of the subsets of each family, in the order of the families' first subsets.
fn families(subsets: &[SubsetDesc]) -> Vec<Vec<usize>> {
    let mut places: HashMap<&str, usize> = HashMap::new();
    let mut families: Vec<Vec<usize>> = Vec::new();
    for (s, subset) in subsets.iter().enumerate() {
        let place = *places.entry(&subset.family).or_insert(families.len());
        match families.get_mut(place) {
            Some(members) => members.push(s),
            None => families.push(vec![s]),
        }
    }
    families
}

/// What is wrong with the indices of one subset.
fn indices(number: u32, subset: &SubsetDesc, met: &mut [u32]) -> Option<(Code, String)> {
    if subset.element != SubsetElement::Face {
        let of = subset.element.plural();
        let text = format!("a subset of {of} is not used: only subsets of faces are");
        return Some((Code::Unsupported, text));
    }
    let (face_count, total) = (met.len(), subset.indices.len());
    let (mut known, mut twice) = (0, 0);
    for face in faces(subset, face_count) {
        known += 1;
        twice += usize::from(met[face] == number);
        met[face] = number;
    }
    let outside = total - known;
    let mut faults = Vec::new();
    if outside > 0 {
        faults.push(format!(
            "{outside} of {total} indices are not among the {face_count} faces"
        ));
    }
    if twice > 0 {
        faults.push(format!("{twice} of {total} indices are there before"));
    }
    (!faults.is_empty()).then(|| (Code::Topology, format!("{}; ignored", faults.join(", "))))
}

/// Holds a family to what its type promises. `met` is empty, and is left so.
fn family(members: &[usize], all: &[SubsetDesc], met: &mut [u32], warnings: &mut Vec<Warning>) {
    let first = &all[members[0]];
    let (name, kind) = (&first.family, first.family_type);
    if kind == FamilyType::Unrestricted {
        return;
    }
    let mut assigned = 0;
    for &s in members {
        let (subset, number) = (&all[s], s as u32);
        let (mut shared, mut with) = (0, NONE);
        for face in faces(subset, met.len()) {
            match met[face] {
                NONE => {
                    met[face] = number;
                    assigned += 1;
                }
                owner if owner != number => {
                    shared += 1;
                    with = with.min(owner);
                }
                _ => {}
            }
        }
        if let Some(with) = all.get(with as usize) {
            let text = format!(
                "{shared} of its indices are in other subsets of its family {name} too, such as {}, and no \
                 two may overlap; the first has them",
                with.path
            );
            warnings.push(Warning::new(&subset.path, Code::Topology, text));
        }
    }
    let missing = met.len() - assigned;
    if kind == FamilyType::Partition && missing > 0 {
        let text = format!(
            "its family {name} is a partition, but {missing} of {} faces are in none of its subsets",
            met.len()
        );
        warnings.push(Warning::new(&first.path, Code::Topology, text));
    }
    for &s in members {
        for face in faces(&all[s], met.len()) {
            met[face] = NONE;
        }
    }
}

/// Of each of `face_count` authored faces the number of its subset in `subsets`, or -1: of the family
/// materialBind, else of the family of the first subset of faces. Where subsets overlap it is the first.
/// Empty where no face is in one.
pub fn subset_of_faces(
    path: &str,
    subsets: &[SubsetDesc],
    face_count: usize,
    warnings: &mut Vec<Warning>,
) -> Vec<i32> {
    let of_faces = |s: &&SubsetDesc| s.element == SubsetElement::Face;
    let materials = subsets.iter().filter(of_faces);
    let materials = materials.clone().find(|s| s.family == MATERIALS);
    let Some(first) = materials.or_else(|| subsets.iter().find(of_faces)) else {
        return Vec::new();
    };
    let Some(mut out) = numbers(face_count, -1, path, warnings) else {
        return Vec::new();
    };
    let members = subsets.iter().enumerate();
    for (s, subset) in members.filter(|(_, s)| s.family == first.family) {
        let number = i32::try_from(s).unwrap_or(i32::MAX);
        for face in faces(subset, face_count) {
            if out[face] < 0 {
                out[face] = number;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    fn subset(path: &str, family: &str, family_type: FamilyType, indices: &[i32]) -> SubsetDesc {
        SubsetDesc {
            path: path.to_owned(),
            family: family.to_owned(),
            family_type,
            element: SubsetElement::Face,
            indices: Arc::new(indices.to_vec()),
        }
    }

    fn complaints(subsets: &[SubsetDesc], face_count: usize) -> Vec<(String, Code, String)> {
        let mut warnings = Vec::new();
        check("/m", subsets, face_count, &mut warnings);
        let parts = |w: Warning| (w.prim, w.code, w.text);
        warnings.into_iter().map(parts).collect()
    }

    fn numbers_of(subsets: &[SubsetDesc], face_count: usize) -> Vec<i32> {
        subset_of_faces("/m", subsets, face_count, &mut Vec::new())
    }

    use FamilyType::{NonOverlapping, Partition, Unrestricted};

    #[test]
    fn good_subsets_are_silent() {
        let halves = |kind| {
            [
                subset("/m/a", "f", kind, &[0, 2]),
                subset("/m/b", "f", kind, &[3, 1]),
            ]
        };
        assert!(complaints(&halves(Partition), 4).is_empty());
        assert!(complaints(&halves(NonOverlapping), 9).is_empty());
        assert!(complaints(&[], 4).is_empty());
        let overlapping = [
            subset("/m/a", "f", Unrestricted, &[0, 2]),
            subset("/m/b", "f", Unrestricted, &[2, 1]),
            subset("/m/c", "g", Partition, &[2, 1, 0]),
        ];
        assert!(complaints(&overlapping, 3).is_empty());
        assert_eq!(numbers_of(&halves(Partition), 4), [0, 1, 0, 1]);
    }

    #[test]
    fn indices_that_are_no_faces_or_come_twice() {
        let bad = subset("/m/a", "f", Unrestricted, &[0, -1, 4, 1, 0, i32::MAX, 0]);
        let found = complaints(std::slice::from_ref(&bad), 4);
        let text =
            "3 of 7 indices are not among the 4 faces, 2 of 7 indices are there before; ignored";
        assert_eq!(
            found,
            [("/m/a".to_owned(), Code::Topology, text.to_owned())]
        );
        assert_eq!(numbers_of(&[bad], 4), [0, 0, -1, -1]);
    }

    #[test]
    fn faces_in_two_subsets_of_a_family_that_must_not_overlap() {
        let subsets = [
            subset("/m/a", "f", NonOverlapping, &[0, 1]),
            subset("/m/x", "g", NonOverlapping, &[0, 1, 2]),
            subset("/m/b", "f", NonOverlapping, &[1, 2, 0]),
        ];
        let found = complaints(&subsets, 5);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].0, "/m/b");
        assert!(found[0].2.starts_with("2 of its indices") && found[0].2.contains("/m/a"));
        assert_eq!(
            numbers_of(&subsets, 5),
            [0, 0, 2, -1, -1],
            "the first has them"
        );
    }

    #[test]
    fn faces_that_a_partition_lacks() {
        let subsets = [
            subset("/m/a", "f", Partition, &[0]),
            subset("/m/b", "f", Partition, &[2, 9]),
        ];
        let found = complaints(&subsets, 5);
        let paths: Vec<&str> = found.iter().map(|f| f.0.as_str()).collect();
        assert_eq!(paths, ["/m/b", "/m/a"]);
        assert!(found[1].2.contains("3 of 5 faces are in none"), "{found:?}");
    }

    #[test]
    fn many_families_take_no_time_of_each_other() {
        let one = |i: i32| {
            subset(
                &format!("/m/{i}"),
                &format!("f{i}"),
                NonOverlapping,
                &[i, i / 2],
            )
        };
        let mut subsets: Vec<_> = (0..100_000).map(one).collect();
        let other = SubsetDesc {
            path: "/m/other".to_owned(),
            ..subsets[5].clone()
        };
        subsets.push(other);
        let found = complaints(&subsets, 100_000);
        let paths: Vec<&str> = found.iter().map(|f| f.0.as_str()).collect();
        assert_eq!(paths, ["/m/0", "/m/other"], "one twice, one that overlaps");
    }

    #[test]
    fn only_faces_count() {
        let mut points = subset("/m/p", "materialBind", Partition, &[0, 1]);
        points.element = SubsetElement::Point;
        let faces = subset("/m/f", "", Unrestricted, &[1]);
        let found = complaints(&[points.clone(), faces.clone()], 2);
        assert_eq!(found[0].1, Code::Unsupported);
        assert!(found[0].2.contains("subset of points"), "{found:?}");
        assert_eq!(numbers_of(&[points.clone(), faces], 2), [-1, 1]);
        assert!(numbers_of(&[points], 2).is_empty());
    }

    #[test]
    fn materials_come_first() {
        let subsets = [
            subset("/m/a", "other", Unrestricted, &[0, 1, 2]),
            subset("/m/b", "materialBind", Unrestricted, &[1]),
            subset("/m/c", "materialBind", Unrestricted, &[1, 2]),
        ];
        assert_eq!(numbers_of(&subsets, 4), [-1, 1, 2, -1]);
        assert_eq!(numbers_of(&subsets[..1], 4), [0, 0, 0, -1]);
    }
}
