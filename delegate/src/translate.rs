//! Authored topology to the renderer's: USD's creases and corners are flat lists.
//!
//! Counts and indices are only copied here, bit for bit (a negative one becomes an index beyond
//! all points); whether they make sense is found when the mesh is prepared.

use hdtrapeze_core::surface::{
    BoundaryInterpolation, Crease, FaceVaryingLinear, MeshTopology, Orientation, Scheme,
    TriangleRule,
};

use crate::error::{Error, try_copy, try_map};

/// UsdGeomMesh's topology attributes as authored.
#[derive(Clone, Copy, Debug, Default)]
pub struct AuthoredTopology<'a> {
    /// Scheme.
    pub scheme: Scheme,
    /// Boundary rule.
    pub boundary: BoundaryInterpolation,
    /// Face-varying rule.
    pub face_varying: FaceVaryingLinear,
    /// Triangle rule.
    pub triangles: TriangleRule,
    /// Winding.
    pub orientation: Orientation,
    /// faceVertexCounts.
    pub face_vertex_counts: &'a [i32],
    /// faceVertexIndices.
    pub face_vertex_indices: &'a [i32],
    /// holeIndices.
    pub holes: &'a [i32],
    /// creaseIndices.
    pub crease_indices: &'a [i32],
    /// creaseLengths.
    pub crease_lengths: &'a [i32],
    /// creaseSharpnesses: one a crease, or one an edge.
    pub crease_sharpnesses: &'a [f32],
    /// cornerIndices.
    pub corner_indices: &'a [i32],
    /// cornerSharpnesses.
    pub corner_sharpnesses: &'a [f32],
}

/// The renderer's topology, and what had to be dropped, a sentence each.
pub fn topology(from: &AuthoredTopology<'_>) -> Result<(MeshTopology, Vec<String>), Error> {
    let mut dropped = Vec::new();
    let creases = creases(from).unwrap_or_else(|why| {
        dropped.push(format!("creases are ignored: {why}"));
        Vec::new()
    });
    let mut corners = Vec::new();
    if from.corner_indices.len() == from.corner_sharpnesses.len() {
        let sharp = from.corner_indices.iter().zip(from.corner_sharpnesses);
        corners.extend(sharp.map(|(&index, &sharpness)| (index as u32, sharpness)));
    } else {
        dropped.push(format!(
            "corners are ignored: {} cornerIndices, but {} cornerSharpnesses",
            from.corner_indices.len(),
            from.corner_sharpnesses.len()
        ));
    }
    let topology = MeshTopology {
        scheme: from.scheme,
        boundary: from.boundary,
        face_varying: from.face_varying,
        triangles: from.triangles,
        orientation: from.orientation,
        vertex_count: 0,
        face_vertex_counts: try_map(from.face_vertex_counts, |&count| count as u32)?,
        face_vertex_indices: try_map(from.face_vertex_indices, |&index| index as u32)?,
        holes: ascending(from.holes)?,
        creases,
        corners,
    };
    Ok((topology, dropped))
}

fn ascending(holes: &[i32]) -> Result<Vec<u32>, Error> {
    let mut holes = try_copy(holes)?;
    holes.sort_unstable_by_key(|&face| face as u32);
    holes.dedup();
    Ok(holes.iter().map(|&face| face as u32).collect())
}

/// Cuts the flat lists into creases, one sharpness an edge.
fn creases(from: &AuthoredTopology<'_>) -> Result<Vec<Crease>, String> {
    let lengths = from.crease_lengths;
    if let Some(short) = lengths.iter().find(|&&length| length < 2) {
        return Err(format!("a creaseLength is {short}, below 2"));
    }
    let points: usize = lengths.iter().map(|&length| length as usize).sum();
    if points != from.crease_indices.len() {
        return Err(format!(
            "creaseLengths add up to {points}, but there are {} creaseIndices",
            from.crease_indices.len()
        ));
    }
    let sharpnesses = from.crease_sharpnesses;
    let edges = points - lengths.len();
    let per_edge = match sharpnesses.len() {
        count if count == lengths.len() => false,
        count if count == edges => true,
        count => {
            return Err(format!(
                "{count} creaseSharpnesses for {} creases of {edges} edges",
                lengths.len()
            ));
        }
    };
    let (mut indices, mut rest) = (from.crease_indices, sharpnesses);
    let mut creases = Vec::with_capacity(lengths.len());
    for &length in lengths {
        let (vertices, left) = indices.split_at(length as usize);
        let edges = vertices.len() - 1;
        let (own, others) = rest.split_at(if per_edge { edges } else { 1 });
        creases.push(Crease {
            vertices: vertices.iter().map(|&index| index as u32).collect(),
            sharpness: match per_edge {
                true => own.to_vec(),
                false => vec![own[0]; edges],
            },
        });
        (indices, rest) = (left, others);
    }
    Ok(creases)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sharpness_a_crease_or_one_an_edge() {
        let mut from = AuthoredTopology {
            crease_indices: &[0, 1, 2, 5, 6],
            crease_lengths: &[3, 2],
            crease_sharpnesses: &[1.0, 2.0],
            ..AuthoredTopology::default()
        };
        let (found, dropped) = topology(&from).unwrap();
        assert!(dropped.is_empty());
        assert_eq!(found.creases[0].vertices, [0, 1, 2]);
        assert_eq!(found.creases[0].sharpness, [1.0, 1.0]);
        assert_eq!(found.creases[1].vertices, [5, 6]);
        assert_eq!(found.creases[1].sharpness, [2.0]);

        from.crease_sharpnesses = &[1.0, 2.0, 3.0];
        let (found, _) = topology(&from).unwrap();
        assert_eq!(found.creases[0].sharpness, [1.0, 2.0]);
        assert_eq!(found.creases[1].sharpness, [3.0]);
    }

    #[test]
    fn lists_that_do_not_fit_are_dropped_with_a_sentence() {
        let from = AuthoredTopology {
            crease_indices: &[0, 1, 2],
            crease_lengths: &[2],
            crease_sharpnesses: &[1.0],
            corner_indices: &[1, 2],
            corner_sharpnesses: &[1.0],
            holes: &[4, -1, 2, 4],
            ..AuthoredTopology::default()
        };
        let (found, dropped) = topology(&from).unwrap();
        assert!(found.creases.is_empty() && found.corners.is_empty());
        assert_eq!(dropped.len(), 2);
        assert_eq!(found.holes, [2, 4, u32::MAX]);
        for (lengths, sharpnesses) in [
            (&[-1, 4][..], &[1.0, 1.0][..]),
            (&[1, 2], &[1.0, 1.0]),
            (&[3], &[]),
        ] {
            let from = AuthoredTopology {
                crease_lengths: lengths,
                crease_sharpnesses: sharpnesses,
                ..from
            };
            assert_eq!(topology(&from).unwrap().1.len(), 2, "{lengths:?}");
        }
    }
}
