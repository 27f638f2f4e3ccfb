//! A limit surface in closed form, for tests and benches: a polygon mesh whose faces are taken
//! bilinearly and then bent by a smooth map, with a key for each of several moments.

// Each user takes a part of it.
#![allow(dead_code)]

use glam::{Vec2, Vec3};
use hdtrapeze_core::surface::{
    ChannelInfo, LimitEvaluator, LimitSamples, LimitSurface, PatchDomain,
};

/// How points of the flat mesh are bent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bend {
    /// Not at all.
    None,
    /// Onto the unit sphere.
    Sphere,
    /// Waves of this amplitude along y.
    Waves(f32),
}

/// A mesh with a map.
#[derive(Clone, Debug)]
pub struct Analytic {
    pub points: Vec<Vec3>,
    pub faces: Vec<Vec<u32>>,
    pub bend: Bend,
    /// Scale and offset at each key.
    pub keys: Vec<(f32, Vec3)>,
    pub polygonal: bool,
    pub channels: Vec<ChannelInfo>,
}

impl Analytic {
    pub fn new(points: Vec<Vec3>, faces: Vec<Vec<u32>>, bend: Bend) -> Self {
        Self {
            points,
            faces,
            bend,
            keys: vec![(1.0, Vec3::ZERO)],
            polygonal: false,
            channels: Vec::new(),
        }
    }

    /// A cube of `n * n` quads a side. Quads for which `triangle` is true become two triangles.
    pub fn cube(n: u32, bend: Bend, triangle: impl Fn(usize) -> bool) -> Self {
        let mut points: Vec<Vec3> = Vec::new();
        let mut faces = Vec::new();
        let mut index = std::collections::HashMap::new();
        let axes = [Vec3::X, Vec3::Y, Vec3::Z];
        for side in 0..6usize {
            let w = axes[side / 2] * if side % 2 == 0 { 1.0 } else { -1.0 };
            let (mut u, mut v) = (axes[(side / 2 + 1) % 3], axes[(side / 2 + 2) % 3]);
            if side % 2 == 1 {
                std::mem::swap(&mut u, &mut v);
            }
            let mut at = |i: u32, j: u32| {
                let f = |i: u32| 2.0 * i as f32 / n as f32 - 1.0;
                let p = w + u * f(i) + v * f(j);
                let key = (p * 1024.0).round().as_ivec3();
                *index.entry(key).or_insert_with(|| {
                    points.push(p);
                    points.len() as u32 - 1
                })
            };
            for j in 0..n {
                for i in 0..n {
                    let q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                    if triangle(faces.len()) {
                        faces.push(vec![q[0], q[1], q[2]]);
                        faces.push(vec![q[0], q[2], q[3]]);
                    } else {
                        faces.push(q.to_vec());
                    }
                }
            }
        }
        Self::new(points, faces, bend)
    }

    /// A prism with `n`-gon caps; the upper cap is a fan of triangles where `fan`.
    pub fn prism(n: u32, fan: bool, bend: Bend) -> Self {
        let mut points = Vec::new();
        for z in [-0.6f32, 0.7] {
            for i in 0..n {
                let a = std::f32::consts::TAU * i as f32 / n as f32;
                points.push(Vec3::new(a.cos(), a.sin(), z));
            }
        }
        let mut faces: Vec<Vec<u32>> = (0..n)
            .map(|i| {
                let j = (i + 1) % n;
                vec![i, j, n + j, n + i]
            })
            .collect();
        faces.push((0..n).rev().collect());
        if fan {
            points.push(Vec3::new(0.1, -0.05, 1.1));
            faces.extend((0..n).map(|i| vec![n + i, n + (i + 1) % n, 2 * n]));
        } else {
            faces.push((n..2 * n).collect());
        }
        Self::new(points, faces, bend)
    }

    /// `n * n` quads over [-half, half]² in x and z, at y = 0, front upwards.
    pub fn plane(n: u32, half: f32, bend: Bend) -> Self {
        let mut points = Vec::new();
        for j in 0..=n {
            for i in 0..=n {
                let f = |i: u32| half * (2.0 * i as f32 / n as f32 - 1.0);
                points.push(Vec3::new(f(i), 0.0, -f(j)));
            }
        }
        let mut faces = Vec::new();
        for j in 0..n {
            for i in 0..n {
                let a = j * (n + 1) + i;
                faces.push(vec![a, a + 1, a + n + 2, a + n + 1]);
            }
        }
        Self::new(points, faces, bend)
    }

    fn bent(&self, p: Vec3, key: usize) -> (Vec3, Vec3) {
        let (scale, offset) = self.keys[key];
        let (q, normal) = match self.bend {
            Bend::None => (p, Vec3::ZERO),
            Bend::Sphere => (p.normalize(), p.normalize()),
            Bend::Waves(a) => {
                let (sx, cx) = (3.0 * p.x).sin_cos();
                let (sz, cz) = (2.0 * p.z).sin_cos();
                let q = p + Vec3::Y * a * sx * cz;
                let n = Vec3::new(-3.0 * a * cx * cz, 1.0, 2.0 * a * sx * sz);
                (q, n.normalize())
            }
        };
        (q * scale + offset, normal)
    }
}

impl LimitSurface for Analytic {
    fn face_count(&self) -> usize {
        self.faces.len()
    }
    fn face_vertices(&self, face: u32) -> &[u32] {
        &self.faces[face as usize]
    }
    fn element(&self, face: u32) -> u32 {
        face
    }
    fn key_count(&self) -> usize {
        self.keys.len()
    }
    fn channels(&self) -> &[ChannelInfo] {
        &self.channels
    }
    fn is_polygonal(&self) -> bool {
        self.polygonal
    }
    fn evaluator(&self) -> Box<dyn LimitEvaluator + '_> {
        Box::new(Evaluator {
            surface: self,
            corners: Vec::new(),
            centre: Vec3::ZERO,
        })
    }
}

struct Evaluator<'a> {
    surface: &'a Analytic,
    corners: Vec<Vec3>,
    centre: Vec3,
}

impl Evaluator<'_> {
    fn flat(&self, domain: PatchDomain, st: Vec2) -> Vec3 {
        let c = &self.corners;
        let n = c.len();
        let quad = match domain {
            PatchDomain::Whole => [c[0], c[1], c[2], c[3]],
            PatchDomain::Collapsed => [c[0], c[1], c[2], c[2]],
            PatchDomain::Corner(i) => {
                let i = i as usize;
                let (next, last) = (c[(i + 1) % n], c[(i + n - 1) % n]);
                [c[i], (c[i] + next) * 0.5, self.centre, (c[i] + last) * 0.5]
            }
        };
        quad[0]
            .lerp(quad[1], st.x)
            .lerp(quad[3].lerp(quad[2], st.x), st.y)
    }
}

impl LimitEvaluator for Evaluator<'_> {
    fn bind(&mut self, face: u32) {
        let face = &self.surface.faces[face as usize];
        self.corners.clear();
        self.corners
            .extend(face.iter().map(|&v| self.surface.points[v as usize]));
        self.centre = self.corners.iter().sum::<Vec3>() / self.corners.len() as f32;
    }
    fn evaluate(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        with_normals: bool,
        out: &mut LimitSamples,
    ) {
        out.positions.clear();
        out.normals.clear();
        for key in 0..self.surface.keys.len() {
            for &st in st {
                assert!(st.min_element() >= 0.0 && st.max_element() <= 1.0);
                let (p, n) = self.surface.bent(self.flat(domain, st), key);
                out.positions.push(p);
                if with_normals {
                    out.normals.push(n);
                }
            }
        }
    }
    fn evaluate_channel(
        &mut self,
        channel: usize,
        domain: PatchDomain,
        st: &[Vec2],
        out: &mut Vec<f32>,
    ) {
        // The flat position's coordinates, repeated.
        let width = self.surface.channels[channel].width;
        out.clear();
        for &st in st {
            let p = self.flat(domain, st);
            out.extend((0..width).map(|i| p[i % 3]));
        }
    }
}
