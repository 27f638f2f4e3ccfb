//! Checks one mesh: topology that the scheme can use, points that are finite at every key.
//!
//! Faces that cannot be used are dropped, and the rest keeps its authored face numbers through
//! [`CheckedMesh::elements`]; the authored face-vertices that remain are in
//! [`CheckedMesh::face_vertices`], so that face-varying data still finds its values.

use glam::Vec3;

use super::points::{Bends, PointKeys, point_keys};
use crate::diagnostics::{Code, Warning};
use crate::motion::Shutter;
use crate::motion::rates::{fault, usable};
use crate::scene::MeshDesc;
use crate::surface::{Crease, MeshTopology};

/// Sharpness from which an edge or vertex is infinitely sharp; infinity itself is authored too.
const INFINITE_SHARPNESS: f32 = 10.0;

/// A mesh that dicing can take.
#[derive(Clone, Debug)]
pub struct CheckedMesh {
    /// Topology over the kept faces.
    pub topology: MeshTopology,
    /// Authored face of each kept face.
    pub elements: Vec<u32>,
    /// Authored position (in faceVertexIndices) of each kept face-vertex.
    pub face_vertices: Vec<u32>,
    /// Faces that were authored.
    pub authored_faces: usize,
    /// Face-vertices that were authored.
    pub authored_face_vertices: usize,
    /// Points, `topology.vertex_count` of them.
    pub points: PointKeys,
}

/// Checks `mesh`. `None` when nothing is left to render; an empty mesh is no reason to warn.
pub fn check(
    path: &str,
    mesh: &MeshDesc,
    shutter: Shutter,
    bends: Bends<'_>,
    warnings: &mut Vec<Warning>,
) -> Option<CheckedMesh> {
    let authored = &*mesh.topology;
    if authored.face_vertex_counts.is_empty() {
        if mesh.points.points.iter().any(|p| !p.is_empty()) {
            let text = "points but no faces; nothing to render";
            warnings.push(Warning::new(path, Code::Topology, text));
        }
        return None;
    }
    if mesh.points.points.iter().all(|p| p.is_empty()) {
        let text = format!(
            "{} faces but no points; dropped",
            authored.face_vertex_counts.len()
        );
        warnings.push(Warning::new(path, Code::Topology, text));
        return None;
    }
    let needed = authored
        .face_vertex_indices
        .iter()
        .max()
        .map_or(0, |&v| v as usize + 1);
    let PointKeys { times, mut points } =
        point_keys(path, &mesh.points, needed, shutter, bends, warnings)?;
    let vertex_count = points[0].len();

    let finite: Vec<bool> = (0..vertex_count)
        .map(|v| points.iter().all(|key| usable(key[v])))
        .collect();
    let kept = keep_faces(path, authored, &points, &finite, warnings);
    // What nothing refers to any more must still not reach arithmetic.
    for key in &mut points {
        for (p, finite) in key.iter_mut().zip(&finite) {
            if !finite {
                *p = Vec3::ZERO;
            }
        }
    }
    if kept.elements.is_empty() {
        return None;
    }
    let in_range = |v: u32| (v as usize) < vertex_count;
    let sound = |c: &&Crease| {
        c.vertices.len() >= 2
            && c.sharpness.len() + 1 == c.vertices.len()
            && c.vertices.iter().all(|&v| in_range(v))
            // False for what is not a number.
            && c.sharpness.iter().all(|s| *s >= 0.0)
    };
    let mut creases: Vec<Crease> = authored.creases.iter().filter(sound).cloned().collect();
    for sharpness in creases.iter_mut().flat_map(|c| &mut c.sharpness) {
        *sharpness = sharpness.min(INFINITE_SHARPNESS);
    }
    let corners: Vec<(u32, f32)> = authored
        .corners
        .iter()
        .copied()
        .filter(|&(v, s)| in_range(v) && s >= 0.0)
        .map(|(v, s)| (v, s.min(INFINITE_SHARPNESS)))
        .collect();
    let lost = authored.creases.len() - creases.len() + authored.corners.len() - corners.len();
    if lost > 0 {
        let text = format!("{lost} creases or corners have bad indices or sharpness; ignored");
        warnings.push(Warning::new(path, Code::Topology, text));
    }
    let faces = authored.face_vertex_counts.len();
    let lost = authored
        .holes
        .iter()
        .filter(|&&h| h as usize >= faces)
        .count();
    if lost > 0 {
        let text = format!("{lost} holeIndices are not among the {faces} faces; ignored");
        warnings.push(Warning::new(path, Code::Topology, text));
    }
    let new_face: std::collections::HashMap<u32, u32> = kept
        .elements
        .iter()
        .enumerate()
        .map(|(i, &e)| (e, i as u32))
        .collect();
    let holes = authored
        .holes
        .iter()
        .filter_map(|h| new_face.get(h).copied())
        .collect();
    let topology = MeshTopology {
        vertex_count,
        face_vertex_counts: kept.counts,
        face_vertex_indices: kept
            .face_vertices
            .iter()
            .map(|&i| authored.face_vertex_indices[i as usize])
            .collect(),
        holes,
        creases,
        corners,
        ..*authored
    };
    Some(CheckedMesh {
        topology,
        elements: kept.elements,
        face_vertices: kept.face_vertices,
        authored_faces: authored.face_vertex_counts.len(),
        authored_face_vertices: authored.face_vertex_indices.len(),
        points: PointKeys { times, points },
    })
}

#[derive(Default)]
struct Kept {
    elements: Vec<u32>,
    counts: Vec<u32>,
    face_vertices: Vec<u32>,
}

fn keep_faces(
    path: &str,
    authored: &MeshTopology,
    points: &[Vec<Vec3>],
    finite: &[bool],
    warnings: &mut Vec<Warning>,
) -> Kept {
    let indices = &authored.face_vertex_indices;
    let mut kept = Kept::default();
    let (mut small, mut outside, mut not_finite) = (0usize, 0usize, 0usize);
    let mut start = 0usize;
    let mut short = None;
    for (face, &count) in authored.face_vertex_counts.iter().enumerate() {
        let end = start.saturating_add(count as usize);
        if end > indices.len() {
            short = Some(face);
            break;
        }
        let corners = &indices[start..end];
        if count < 3 {
            small += 1;
        } else if corners.iter().any(|&v| v as usize >= finite.len()) {
            outside += 1;
        } else if corners.iter().any(|&v| !finite[v as usize]) {
            not_finite += 1;
        } else {
            kept.elements.push(face as u32);
            kept.counts.push(count);
            kept.face_vertices.extend(start as u32..end as u32);
        }
        start = end;
    }
    let faces = authored.face_vertex_counts.len();
    let mut complain = |code, text: String| warnings.push(Warning::new(path, code, text));
    if let Some(face) = short {
        complain(
            Code::Topology,
            format!(
                "faceVertexCounts ask for more than the {} faceVertexIndices; the last {} of {faces} \
                 faces are dropped",
                indices.len(),
                faces - face
            ),
        );
    } else if start < indices.len() {
        complain(
            Code::Topology,
            format!(
                "faceVertexCounts sum to {start} but there are {} faceVertexIndices; the last {} are \
                 ignored",
                indices.len(),
                indices.len() - start
            ),
        );
    }
    if outside > 0 {
        complain(
            Code::Topology,
            format!(
                "{outside} of {faces} faces refer to points that do not exist ({} points); dropped",
                finite.len()
            ),
        );
    }
    if small > 0 {
        complain(
            Code::Topology,
            format!("{small} of {faces} faces have fewer than 3 vertices; dropped"),
        );
    }
    if not_finite > 0 {
        complain(
            Code::NotFinite,
            format!(
                "{not_finite} of {faces} faces have points that are {}; dropped",
                fault(points)
            ),
        );
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::PointsSamples;
    use std::sync::Arc;

    fn quads(counts: &[u32], indices: &[u32], points: Vec<Vec3>) -> MeshDesc {
        MeshDesc {
            topology: Arc::new(MeshTopology {
                face_vertex_counts: counts.to_vec(),
                face_vertex_indices: indices.to_vec(),
                ..MeshTopology::default()
            }),
            points: PointsSamples {
                times: vec![0.0],
                points: vec![Arc::new(points)],
                ..PointsSamples::default()
            },
            ..MeshDesc::default()
        }
    }

    fn six() -> Vec<Vec3> {
        (0..6)
            .map(|i| Vec3::new((i % 3) as f32, (i / 3) as f32, 0.0))
            .collect()
    }

    fn run(mesh: &MeshDesc) -> (Option<CheckedMesh>, Vec<Warning>) {
        let mut warnings = Vec::new();
        let out = check(
            "/m",
            mesh,
            Shutter {
                open: -0.5,
                close: 0.5,
            },
            Bends::Samples(2),
            &mut warnings,
        );
        (out, warnings)
    }

    #[test]
    fn good_faces_stay_with_their_numbers() {
        let mesh = quads(
            &[4, 4, 2, 4],
            &[0, 1, 4, 3, 9, 1, 2, 5, 0, 1, 1, 2, 5, 4],
            six(),
        );
        let (out, warnings) = run(&mesh);
        let out = out.unwrap();
        assert_eq!(out.elements, vec![0, 3]);
        assert_eq!(
            out.topology.face_vertex_indices,
            vec![0, 1, 4, 3, 1, 2, 5, 4]
        );
        assert_eq!(out.face_vertices, vec![0, 1, 2, 3, 10, 11, 12, 13]);
        assert_eq!(warnings.len(), 2);
    }

    #[test]
    fn nan_points_take_their_faces_only() {
        let mut points = six();
        points[5].y = f32::NAN;
        let (out, warnings) = run(&quads(&[4, 4], &[0, 1, 4, 3, 1, 2, 5, 4], points));
        let out = out.unwrap();
        assert_eq!(out.elements, vec![0]);
        assert!(out.points.points[0].iter().all(|p| p.is_finite()));
        assert_eq!(warnings[0].code, Code::NotFinite);
    }

    #[test]
    fn counts_that_ask_too_much_and_too_little() {
        let (out, warnings) = run(&quads(&[4, 4], &[0, 1, 4, 3, 1], six()));
        assert_eq!(out.unwrap().elements, vec![0]);
        assert_eq!(warnings.len(), 1);
        let (out, warnings) = run(&quads(&[4], &[0, 1, 4, 3, 1], six()));
        assert_eq!(out.unwrap().elements, vec![0]);
        assert_eq!(warnings.len(), 1);
        let (out, _) = run(&quads(&[u32::MAX, u32::MAX], &[0, 1, 4, 3], six()));
        assert!(out.is_none());
    }

    #[test]
    fn infinite_sharpness_counts() {
        let mut mesh = quads(&[4, 4], &[0, 1, 4, 3, 1, 2, 5, 4], six());
        let topology = Arc::make_mut(&mut mesh.topology);
        let crease = |s: [f32; 2]| Crease {
            vertices: vec![0, 1, 2],
            sharpness: s.to_vec(),
        };
        topology.creases = vec![crease([f32::INFINITY, 2.5]), crease([f32::NAN, 1.0])];
        topology.corners = vec![
            (0, f32::INFINITY),
            (1, 11.0),
            (2, 0.5),
            (3, f32::NEG_INFINITY),
            (4, f32::NAN),
        ];
        let (out, warnings) = run(&mesh);
        let out = out.unwrap().topology;
        assert_eq!(out.creases, vec![crease([10.0, 2.5])]);
        assert_eq!(out.corners, vec![(0, 10.0), (1, 10.0), (2, 0.5)]);
        assert!(warnings[0].text.starts_with("3 creases or corners"));
    }

    #[test]
    fn empty_is_silent() {
        let (out, warnings) = run(&quads(&[], &[], vec![]));
        assert!(out.is_none() && warnings.is_empty());
    }

    #[test]
    fn faces_without_points_are_not() {
        let (out, warnings) = run(&quads(&[4], &[0, 1, 4, 3], vec![]));
        assert!(out.is_none());
        assert_eq!(warnings.len(), 1);
        assert_eq!(warnings[0].code, Code::Topology);
    }

    #[test]
    fn equal_samples_are_one_key_and_lengths_must_agree() {
        let mut mesh = quads(&[4], &[0, 1, 4, 3], six());
        let moved: Vec<Vec3> = six().iter().map(|p| *p + Vec3::Z).collect();
        mesh.points.times = vec![-1.0, 1.0];
        mesh.points.points = vec![Arc::new(six()), Arc::new(six())];
        assert_eq!(run(&mesh).0.unwrap().points.points.len(), 1);
        mesh.points.points[1] = Arc::new(moved);
        let out = run(&mesh).0.unwrap();
        assert_eq!(out.points.times, vec![0.0, 1.0]);
        assert!((out.points.points[1][0].z - 0.75).abs() < 1e-6);
        mesh.points.points[1] = Arc::new(six()[..5].to_vec());
        let (out, warnings) = run(&mesh);
        assert_eq!(out.unwrap().points.points.len(), 1);
        assert_eq!(warnings[0].code, Code::TimeSamples);
    }

    #[test]
    fn of_samples_that_differ_in_length_the_frames_is_taken() {
        let mut mesh = quads(&[4], &[0, 1, 4, 3], six());
        let later: Vec<Vec3> = six()
            .iter()
            .map(|p| *p + Vec3::Z)
            .chain([Vec3::X])
            .collect();
        let z = |mesh: &MeshDesc| run(mesh).0.unwrap().points.points[0][0].z;
        mesh.points.times = vec![-0.9, 0.1];
        mesh.points.points = vec![Arc::new(six()), Arc::new(later)];
        assert_eq!(z(&mesh), 0.0);
        // With too few points it cannot be that one.
        mesh.points.points[0] = Arc::new(six()[..3].to_vec());
        assert_eq!(z(&mesh), 1.0);
    }
}
