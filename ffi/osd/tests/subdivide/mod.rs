//! Catmull-Clark subdivision by its textbook rules, in f64: an oracle that shares nothing with the
//! library. Boundaries are sharp edges with sharp corners; creases follow DeRose, Kass, Truong,
//! "Subdivision Surfaces in Character Animation", SIGGRAPH 1998.

use std::collections::BTreeMap;

use glam::{DVec3, Vec3};
use hdtrapeze_core::surface::{Crease, MeshTopology};

const INFINITE: f64 = 10.0;

struct Edge {
    faces: Vec<usize>,
    sharpness: f64,
    number: u32,
}

/// One step. Quad number k of the result is corner k of the faces, in order, with its corners in the
/// order of `PatchDomain::Corner`: corner, middle of the next edge, centre, middle of the edge before.
pub fn catmull_clark(topology: &MeshTopology, points: &[Vec3]) -> (MeshTopology, Vec<Vec3>) {
    let points: Vec<DVec3> = points.iter().map(|p| p.as_dvec3()).collect();
    let mut start = 0;
    let faces: Vec<&[u32]> = topology
        .face_vertex_counts
        .iter()
        .map(|&n| {
            start += n as usize;
            &topology.face_vertex_indices[start - n as usize..start]
        })
        .collect();

    let mut edges: BTreeMap<(u32, u32), Edge> = BTreeMap::new();
    for (f, face) in faces.iter().enumerate() {
        for (i, &a) in face.iter().enumerate() {
            let b = face[(i + 1) % face.len()];
            let number = edges.len() as u32;
            let edge = edges.entry((a.min(b), a.max(b))).or_insert(Edge {
                faces: Vec::new(),
                sharpness: 0.0,
                number,
            });
            edge.faces.push(f);
        }
    }
    for crease in &topology.creases {
        for (pair, &s) in crease.vertices.windows(2).zip(&crease.sharpness) {
            let key = (pair[0].min(pair[1]), pair[0].max(pair[1]));
            if let Some(edge) = edges.get_mut(&key) {
                // The last one counts.
                edge.sharpness = f64::from(s);
            }
        }
    }
    for edge in edges.values_mut().filter(|edge| edge.faces.len() == 1) {
        edge.sharpness = INFINITE;
    }

    let centre = |f: usize| -> DVec3 {
        let face = faces[f];
        face.iter().map(|&v| points[v as usize]).sum::<DVec3>() / face.len() as f64
    };
    let n = points.len();
    let mut out: Vec<DVec3> = vec![DVec3::ZERO; n];
    for v in 0..n as u32 {
        out[v as usize] = vertex_point(v, &points, &edges, &faces, &centre);
    }
    out.resize(n + edges.len(), DVec3::ZERO);
    for (&(a, b), edge) in &edges {
        let middle = 0.5 * (points[a as usize] + points[b as usize]);
        let smooth = match edge.faces[..] {
            [f, g] => 0.5 * middle + 0.25 * (centre(f) + centre(g)),
            _ => middle,
        };
        out[n + edge.number as usize] = smooth.lerp(middle, edge.sharpness.min(1.0));
    }
    let mut finer = MeshTopology {
        creases: Vec::new(),
        corners: Vec::new(),
        holes: Vec::new(),
        face_vertex_counts: Vec::new(),
        face_vertex_indices: Vec::new(),
        ..topology.clone()
    };
    for (f, face) in faces.iter().enumerate() {
        let middle = |a: u32, b: u32| n as u32 + edges[&(a.min(b), a.max(b))].number;
        let size = face.len();
        for i in 0..size {
            let (v, next, before) = (face[i], face[(i + 1) % size], face[(i + size - 1) % size]);
            finer.face_vertex_counts.push(4);
            finer.face_vertex_indices.extend([
                v,
                middle(v, next),
                out.len() as u32,
                middle(before, v),
            ]);
        }
        out.push(centre(f));
    }
    for (&(a, b), edge) in edges.iter().filter(|(_, edge)| edge.faces.len() == 2) {
        let finer_sharpness = match edge.sharpness {
            s if s >= INFINITE => INFINITE,
            s => (s - 1.0).max(0.0),
        };
        if finer_sharpness > 0.0 {
            finer.creases.push(Crease {
                vertices: vec![a, n as u32 + edge.number, b],
                sharpness: vec![finer_sharpness as f32; 2],
            });
        }
    }
    finer.vertex_count = out.len();
    (finer, out.iter().map(|p| p.as_vec3()).collect())
}

fn vertex_point(
    v: u32,
    points: &[DVec3],
    edges: &BTreeMap<(u32, u32), Edge>,
    faces: &[&[u32]],
    centre: &dyn Fn(usize) -> DVec3,
) -> DVec3 {
    let p = points[v as usize];
    let around: Vec<(u32, &Edge)> = edges
        .iter()
        .filter(|((a, b), _)| *a == v || *b == v)
        .map(|(&(a, b), edge)| (a + b - v, edge))
        .collect();
    let own: Vec<usize> = (0..faces.len())
        .filter(|&f| faces[f].contains(&v))
        .collect();
    if own.is_empty() {
        return p;
    }
    let boundary = around.iter().any(|(_, edge)| edge.faces.len() == 1);
    // Boundary corners are sharp, and so is where sheets touch in a vertex.
    if boundary && own.len() == 1 || around.len() > own.len() + 1 {
        return p;
    }
    let n = own.len() as f64;
    let smooth = || {
        let f = own.iter().map(|&f| centre(f)).sum::<DVec3>() / n;
        let e = around
            .iter()
            .map(|&(w, _)| points[w as usize])
            .sum::<DVec3>()
            / n;
        (f + e + (n - 2.0) * p) / n
    };
    // A vertex by the number of its sharp edges: none or one, two, more.
    let rule = |sharp: &dyn Fn(f64) -> bool| {
        let ends: Vec<u32> = around
            .iter()
            .filter(|(_, edge)| sharp(edge.sharpness))
            .map(|&(w, _)| w)
            .collect();
        match ends[..] {
            [] | [_] => smooth(),
            [a, b] => 0.75 * p + 0.125 * (points[a as usize] + points[b as usize]),
            _ => p,
        }
    };
    let parent = rule(&|s| s > 0.0);
    let child = rule(&|s| s > 1.0);
    let fading: Vec<f64> = around
        .iter()
        .map(|(_, edge)| edge.sharpness)
        .filter(|&s| s > 0.0 && s < 1.0)
        .collect();
    if fading.is_empty() {
        return if around.iter().any(|(_, e)| e.sharpness > 0.0) {
            parent
        } else {
            smooth()
        };
    }
    // Edges that stop being sharp in this step: between the rules before and after.
    let mean = fading.iter().sum::<f64>() / fading.len() as f64;
    child.lerp(parent, mean)
}
