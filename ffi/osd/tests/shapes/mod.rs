//! Meshes for the tests.
#![allow(dead_code, missing_docs)]

use glam::Vec3;
use hdtrapeze_core::surface::{MeshTopology, Scheme};

pub fn mesh(faces: &[&[u32]], points: Vec<Vec3>) -> (MeshTopology, Vec<Vec3>) {
    let topology = MeshTopology {
        vertex_count: points.len(),
        face_vertex_counts: faces.iter().map(|face| face.len() as u32).collect(),
        face_vertex_indices: faces.concat(),
        ..MeshTopology::default()
    };
    (topology, points)
}

/// Corners at (+-1, +-1, +-1), counter-clockwise from outside.
pub fn cube() -> (MeshTopology, Vec<Vec3>) {
    let points = (0..8)
        .map(|i| {
            let sign = |bit: u32| if i & bit == 0 { -1.0 } else { 1.0 };
            Vec3::new(sign(1), sign(2), sign(4))
        })
        .collect();
    mesh(
        &[
            &[0, 2, 3, 1],
            &[4, 5, 7, 6],
            &[0, 1, 5, 4],
            &[2, 6, 7, 3],
            &[0, 4, 6, 2],
            &[1, 3, 7, 5],
        ],
        points,
    )
}

pub fn octahedron() -> (MeshTopology, Vec<Vec3>) {
    let points = vec![
        Vec3::X,
        Vec3::NEG_X,
        Vec3::Y,
        Vec3::NEG_Y,
        Vec3::Z,
        Vec3::NEG_Z,
    ];
    let (mut topology, points) = mesh(
        &[
            &[0, 2, 4],
            &[2, 1, 4],
            &[1, 3, 4],
            &[3, 0, 4],
            &[2, 0, 5],
            &[1, 2, 5],
            &[3, 1, 5],
            &[0, 3, 5],
        ],
        points,
    );
    topology.scheme = Scheme::Loop;
    (topology, points)
}

/// `nx` by `ny` unit quads in the plane z = 0, facing +z.
pub fn grid(nx: u32, ny: u32) -> (MeshTopology, Vec<Vec3>) {
    let points = (0..=ny)
        .flat_map(|y| (0..=nx).map(move |x| Vec3::new(x as f32, y as f32, 0.0)))
        .collect();
    let w = nx + 1;
    let faces: Vec<[u32; 4]> = (0..ny)
        .flat_map(|y| {
            (0..nx).map(move |x| {
                let v = y * w + x;
                [v, v + 1, v + w + 1, v + w]
            })
        })
        .collect();
    let faces: Vec<&[u32]> = faces.iter().map(|face| face.as_slice()).collect();
    mesh(&faces, points)
}
