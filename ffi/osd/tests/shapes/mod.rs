//! Meshes for the tests.
#![allow(dead_code, missing_docs)]

use glam::Vec3;
use hdtrapeze_core::surface::{Crease, MeshTopology, Scheme};

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

/// Random numbers that are the same everywhere (splitmix64).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }
    pub fn below(&mut self, n: u32) -> u32 {
        (self.bits() % u64::from(n)) as u32
    }
    pub fn chance(&mut self, p: f32) -> bool {
        self.unit() < p
    }
    pub fn vec3(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }
}

/// A bumpy sheet of quads, triangles, pentagons and hexagons with holes in it; `triangles_only` for
/// Loop.
pub fn patchwork(random: &mut Random, n: u32, triangles_only: bool) -> (MeshTopology, Vec<Vec3>) {
    let (_, mut points) = grid(n, n);
    for p in &mut points {
        *p += (random.vec3() - 0.5) * Vec3::new(0.4, 0.4, 1.0);
    }
    let w = n + 1;
    let mut faces: Vec<Vec<u32>> = Vec::new();
    let mut y = 0;
    while y < n {
        let mut x = 0;
        while x < n {
            let v = y * w + x;
            let quad = [v, v + 1, v + w + 1, v + w];
            let wide = x + 1 < n;
            let mut kind = random.below(10);
            if triangles_only {
                kind = if kind == 0 { 0 } else { 1 + kind % 2 };
            }
            match kind {
                0 => {}
                1 => faces.extend([
                    vec![quad[0], quad[1], quad[2]],
                    vec![quad[0], quad[2], quad[3]],
                ]),
                2 => faces.extend([
                    vec![quad[0], quad[1], quad[3]],
                    vec![quad[1], quad[2], quad[3]],
                ]),
                3 if wide => {
                    faces.push(vec![v, v + 1, v + 2, v + w + 2, v + w + 1, v + w]);
                    x += 1;
                }
                4 if wide => {
                    faces.push(vec![v, v + 1, v + 2, v + w + 1, v + w]);
                    faces.push(vec![v + 2, v + w + 2, v + w + 1]);
                    x += 1;
                }
                _ => {
                    let mut face = quad.to_vec();
                    face.rotate_left(random.below(4) as usize);
                    faces.push(face);
                }
            }
            x += 1;
        }
        y += 1;
    }
    let faces: Vec<&[u32]> = faces.iter().map(Vec::as_slice).collect();
    let (mut topology, points) = mesh(&faces, points);
    if triangles_only {
        topology.scheme = Scheme::Loop;
    }
    (topology, points)
}

/// Random creases along edges and corners, sharp, half-sharp and infinitely sharp.
pub fn sharpen(random: &mut Random, topology: &mut MeshTopology, share: f32) {
    let mut start = 0;
    for &count in &topology.face_vertex_counts {
        let face = &topology.face_vertex_indices[start..start + count as usize];
        start += count as usize;
        for (i, &a) in face.iter().enumerate() {
            if random.chance(share) {
                topology.creases.push(Crease {
                    vertices: vec![a, face[(i + 1) % face.len()]],
                    sharpness: vec![[0.7, 2.0, 3.3, 10.0][random.below(4) as usize]],
                });
            }
            if random.chance(0.3 * share) {
                topology
                    .corners
                    .push((a, [1.5, 10.0][random.below(2) as usize]));
            }
        }
    }
}

/// Twelve vertices of valence 5.
pub fn icosahedron() -> (MeshTopology, Vec<Vec3>) {
    let g = 0.5 * (1.0 + 5.0f32.sqrt());
    let points: Vec<Vec3> = [[0.0, 1.0, g], [1.0, g, 0.0], [g, 0.0, 1.0]]
        .iter()
        .flat_map(|p| {
            (0..4).map(move |i| {
                let sign = |on: bool| if on { -1.0 } else { 1.0 };
                // Only two coordinates are not zero.
                let (a, b) = (sign(i & 1 == 1), sign(i & 2 == 2));
                match p.iter().position(|&x| x == 0.0) {
                    Some(0) => Vec3::new(0.0, a * p[1], b * p[2]),
                    Some(1) => Vec3::new(a * p[0], 0.0, b * p[2]),
                    _ => Vec3::new(a * p[0], b * p[1], 0.0),
                }
            })
        })
        .collect();
    let mut faces = Vec::new();
    let near = |a: usize, b: usize| (points[a].distance(points[b]) - 2.0).abs() < 1e-3;
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let up = (points[b] - points[a]).cross(points[c] - points[a]);
                    let out = up.dot(points[a]) > 0.0;
                    let (b, c) = if out { (b, c) } else { (c, b) };
                    faces.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    let faces: Vec<&[u32]> = faces.iter().map(|face| face.as_slice()).collect();
    mesh(&faces, points)
}

/// Every triangle cut in three quads: each has a vertex of valence 3.
pub fn thirds((topology, mut points): (MeshTopology, Vec<Vec3>)) -> (MeshTopology, Vec<Vec3>) {
    let mut middles = std::collections::HashMap::new();
    let mut faces = Vec::new();
    for t in topology.face_vertex_indices.chunks(3) {
        let centre = points.len() as u32;
        points.push((points[t[0] as usize] + points[t[1] as usize] + points[t[2] as usize]) / 3.0);
        let m: Vec<u32> = (0..3)
            .map(|i| {
                let (a, b) = (t[i], t[(i + 1) % 3]);
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    points.push(0.5 * (points[a as usize] + points[b as usize]));
                    points.len() as u32 - 1
                })
            })
            .collect();
        for i in 0..3 {
            faces.push([t[i], m[i], centre, m[(i + 2) % 3]]);
        }
    }
    let faces: Vec<&[u32]> = faces.iter().map(|face| face.as_slice()).collect();
    mesh(&faces, points)
}
