//! Faces that are too large for the library.
//!
//! OpenSubdiv keeps a dense matrix for an irregular face, the weight of every control point in every
//! patch point: for an n-gon 212 n^2 bytes, 212 MB and 2 s for 1000 sides. Nothing interrupts it while
//! it builds that matrix. Faces for which the matrix would be larger than [`MOST_MATRIX_BYTES`] are
//! found here, before the library is asked, and stay linear between their control points.

/// Largest matrix that the library may build for a face. An n-gon on its own reaches it with 1100
/// sides, a triangle at a vertex of valence n with n = 2700.
const MOST_MATRIX_BYTES: u64 = 1 << 28;

/// Patch points that the library makes for each side of a face, for each face around its vertices, and
/// on top of these and the control points; counted on n-gons and fans, at the level of isolation that
/// the bridge asks for.
const POINTS_A_SIDE: u64 = 44;
const POINTS_A_NEIGHBOUR: u64 = 8;
const POINTS: u64 = 200;

/// Bytes of the library's matrix for a face with this many sides, this many faces around its vertices
/// (each vertex counts on its own), and this many control points.
fn matrix_bytes(sides: u64, neighbours: u64, controls: u64) -> u64 {
    let points = sides * POINTS_A_SIDE + neighbours * POINTS_A_NEIGHBOUR + controls + POINTS;
    points.saturating_mul(controls).saturating_mul(4)
}

/// The faces that are too large, ascending.
pub(crate) fn too_large<'a>(
    faces: impl Iterator<Item = &'a [i32]> + Clone,
    vertex_count: usize,
) -> Vec<i32> {
    // Faces around each vertex, and the vertices that they add to its own.
    let mut around = vec![(0u64, 0u64); vertex_count];
    for face in faces.clone() {
        for &v in face {
            let (valence, ring) = &mut around[v as usize];
            *valence += 1;
            *ring += face.len() as u64 - 2;
        }
    }
    let vertex_count = vertex_count as u64;
    faces
        .zip(0..)
        .filter(|(face, _)| {
            let (mut neighbours, mut controls) = (0u64, 0u64);
            for &v in *face {
                let (valence, ring) = around[v as usize];
                neighbours += valence;
                // The face itself is in the ring of each of its vertices.
                controls += ring + 2 - face.len() as u64;
            }
            controls = (controls + face.len() as u64).min(vertex_count);
            matrix_bytes(face.len() as u64, neighbours, controls) > MOST_MATRIX_BYTES
        })
        .map(|(_, number)| number)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the library said of polygons and fans of triangles: (sides, neighbours, controls, points).
    #[test]
    fn matrices_are_as_large_as_the_librarys() {
        let counted = [
            (600, 600, 600, 31_804u64),
            (1000, 1000, 1000, 53_004),
            (3, 604, 601, 5_608),
            (3, 1004, 1001, 9_208),
        ];
        for (sides, neighbours, controls, points) in counted {
            let ratio =
                matrix_bytes(sides, neighbours, controls) as f64 / (points * controls * 4) as f64;
            assert!((0.95..1.1).contains(&ratio), "{sides} {controls}: {ratio}");
        }
    }

    #[test]
    fn only_large_faces_are_too_large() {
        let polygon = |n: i32| (0..n).collect::<Vec<i32>>();
        let find = |faces: &[Vec<i32>], count| too_large(faces.iter().map(|f| &f[..]), count);
        assert!(find(&[polygon(1000)], 1000).is_empty());
        assert_eq!(find(&[vec![0, 1, 2], polygon(1200)], 1200), [1]);
        let fan = |n: i32| (0..n).map(|i| vec![i, (i + 1) % n, n]).collect::<Vec<_>>();
        assert!(find(&fan(2000), 2001).is_empty());
        assert_eq!(find(&fan(3000), 3001).len(), 3000);
    }
}
