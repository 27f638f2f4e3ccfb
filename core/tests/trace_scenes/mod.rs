//! Scenes and random numbers that the tests and the bench of tracing share.
#![allow(dead_code)]

pub mod curved;
pub mod lens;

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::grid::{DicedMesh, Grid, GridChannel, octahedral};
use hdtrapeze_core::trace::{InstanceTransform, Ray, World, WorldInstance};

/// Random numbers (splitmix64).
pub struct Rng(pub u64);

impl Rng {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1 << 24) as f32
    }
    /// In [-1, 1).
    pub fn signed(&mut self) -> f32 {
        self.unit() * 2.0 - 1.0
    }
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
    /// In the cube [-1, 1)^3.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }
    /// On the unit sphere.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.cube();
            let l = v.length_squared();
            if l > 1e-4 && l <= 1.0 {
                return v / l.sqrt();
            }
        }
    }
}

/// A mesh of grids with rates `rates`; vertex `(u, v)` of grid `g` is `at(g, u, v, time)` at each key.
pub fn mesh(
    rates: &[(u16, u16)],
    keys: &[f32],
    at: impl Fn(usize, f32, f32, f32) -> Vec3,
) -> DicedMesh {
    let mut mesh = DicedMesh {
        key_times: keys.to_vec(),
        ..DicedMesh::default()
    };
    let count = |&(nu, nv): &(u16, u16)| usize::from(nu + 1) * usize::from(nv + 1);
    mesh.reserve_positions(rates.iter().map(count).sum())
        .expect("there is room");
    for (g, &(nu, nv)) in rates.iter().enumerate() {
        let grid = Grid {
            first_vertex: mesh.vertex_count as u32,
            element: g as u32,
            nu,
            nv,
        };
        for &time in keys {
            for j in 0..=nv {
                for i in 0..=nu {
                    let (u, v) = (f32::from(i) / f32::from(nu), f32::from(j) / f32::from(nv));
                    mesh.positions.push(at(g, u, v, time));
                }
            }
        }
        mesh.vertex_count += grid.vertex_count();
        mesh.grids.push(grid);
    }
    mesh
}

/// Keys: one for none, else evenly over the shutter.
pub fn keys(n: usize) -> Vec<f32> {
    match n {
        0 | 1 => vec![0.0],
        _ => (0..n).map(|k| k as f32 / (n - 1) as f32).collect(),
    }
}

/// A sheet of `n` by `n` grids over [-1, 1]^2 that ripples in z and over time.
pub fn sheet(n: usize, rate: u16, keys: &[f32]) -> DicedMesh {
    mesh(&vec![(rate, rate); n * n], keys, |g, u, v, t| {
        let (gi, gj) = ((g % n) as f32, (g / n) as f32);
        let x = (gi + u) / n as f32 * 2.0 - 1.0;
        let y = (gj + v) / n as f32 * 2.0 - 1.0;
        let phase = 7.0 * x + 4.0 * y;
        Vec3::new(x, y, 0.15 * (phase + 2.0 * t).sin())
    })
}

/// Curved patches of 16x16 that tumble in a cube.
pub fn patches(count: usize, rate: u16, keys: &[f32], seed: u64) -> DicedMesh {
    bent_patches(count, rate, keys, seed, BEND)
}

/// How much patches are bent, unless that is said.
const BEND: f32 = 0.4;

/// The same, bent so much.
pub fn bent_patches(count: usize, rate: u16, keys: &[f32], seed: u64, bend: f32) -> DicedMesh {
    let mut rng = Rng(seed);
    let size = 1.2 / (count as f32).cbrt();
    let who: Vec<_> = (0..count)
        .map(|_| {
            (
                rng.cube(),
                rng.direction(),
                rng.direction(),
                rng.unit() * TAU,
                rng.cube(),
            )
        })
        .collect();
    mesh(&vec![(rate, rate); count], keys, move |g, u, v, t| {
        let (centre, axis, spin, phase, drift) = who[g];
        let q =
            glam::Quat::from_axis_angle(spin, 0.7 * t) * glam::Quat::from_axis_angle(axis, phase);
        let (x, y) = (u - 0.5, v - 0.5);
        let p = Vec3::new(x, y, bend * (x * x - y * y));
        centre + q * p * size + drift * (0.5 * size * t)
    })
}

/// Ribbons of 1x16 that stand on the plane z = 0 and sway.
pub fn fur(count: usize, keys: &[f32], seed: u64) -> DicedMesh {
    let mut rng = Rng(seed);
    let length = 0.25;
    let width = 0.6 / (count as f32).sqrt();
    let who: Vec<_> = (0..count)
        .map(|_| {
            let root = Vec3::new(rng.signed(), rng.signed(), 0.0);
            let lean = Vec3::new(0.6 * rng.signed(), 0.6 * rng.signed(), 0.0);
            let sway = Vec3::new(0.4 * rng.signed(), 0.4 * rng.signed(), 0.0);
            (root, lean, sway, rng.unit() * PI)
        })
        .collect();
    mesh(&vec![(1, 16); count], keys, move |g, u, v, t| {
        let (root, lean, sway, angle) = who[g];
        let across = Vec3::new(angle.cos(), angle.sin(), 0.0) * (width * (1.0 - 0.9 * v));
        root + across * (u - 0.5) + (Vec3::Z * v + (lean + sway * t) * (v * v)) * length
    })
}

/// Fur that leans and sways one way, nearly, with strands `width` wide at their roots.
pub fn combed(count: usize, width: f32, keys: &[f32], seed: u64) -> DicedMesh {
    let mut rng = Rng(seed);
    let who: Vec<_> = (0..count)
        .map(|_| {
            let root = Vec3::new(rng.signed(), rng.signed(), 0.0);
            let lean = Vec3::new(0.9, 0.6, 0.0) + rng.cube() * 0.1;
            let sway = Vec3::new(0.4, 0.0, 0.0) + rng.cube() * 0.1;
            (root, lean, sway, rng.unit() * PI)
        })
        .collect();
    mesh(&vec![(1, 16); count], keys, move |g, u, v, t| {
        let (root, lean, sway, angle) = who[g];
        let across = Vec3::new(angle.cos(), angle.sin(), 0.0) * (width * (1.0 - 0.9 * v));
        root + across * (u - 0.5) + (Vec3::Z * v + (lean + sway * t) * (v * v)) * 0.25
    })
}

/// Strands from anywhere in a cube to anywhere, so thin that each micropolygon is an item of the tree; of all lengths, along rows of
/// their grids and across them.
pub fn thin(count: usize, keys: &[f32], seed: u64) -> DicedMesh {
    let mut rng = Rng(seed);
    let who: Vec<_> = (0..count)
        .map(|_| [rng.cube(), rng.cube(), rng.cube() * 0.3, rng.direction()])
        .collect();
    let lengths = |g: usize| 3 + (g / 2 % 14) as u16;
    let rates: Vec<_> = (0..count)
        .map(|g| match g % 2 {
            0 => (1, lengths(g)),
            _ => (lengths(g), 1),
        })
        .collect();
    mesh(&rates, keys, move |g, u, v, t| {
        let [from, to, sway, across] = who[g];
        let (u, v) = if g % 2 == 0 { (u, v) } else { (v, u) };
        from + (to - from) * v + sway * (t * v * v) + across * (0.0015 * (u - 0.5))
    })
}

/// A closed unit sphere: six faces of a cube, `n` by `n` grids each, edge vertices with the same bits
/// on both sides. It breathes and shears over time.
pub fn sphere(n: usize, rate: u16, keys: &[f32]) -> DicedMesh {
    closed(n, rate, keys, |p, t| {
        let s = p.normalize();
        Vec3::new(
            s.x * (1.0 + 0.2 * t) + 0.3 * t * s.y,
            s.y - 0.2 * t,
            s.z * (1.0 - 0.3 * t),
        )
    })
}

/// A closed surface: the cube [-1, 1]^3 through `map(point, time)`.
pub fn closed(n: usize, rate: u16, keys: &[f32], map: impl Fn(Vec3, f32) -> Vec3) -> DicedMesh {
    let steps = (n * usize::from(rate)) as f32;
    mesh(&vec![(rate, rate); 6 * n * n], keys, |g, u, v, t| {
        let (face, rest) = (g / (n * n), g % (n * n));
        // Whole numbers first: the same lattice point is the same number on every face.
        let i = (rest % n * usize::from(rate)) as f32 + (u * f32::from(rate)).round();
        let j = (rest / n * usize::from(rate)) as f32 + (v * f32::from(rate)).round();
        let (a, b) = ((2.0 * i - steps) / steps, (2.0 * j - steps) / steps);
        let p = match face {
            0 => Vec3::new(1.0, a, b),
            1 => Vec3::new(-1.0, b, a),
            2 => Vec3::new(b, 1.0, a),
            3 => Vec3::new(a, -1.0, b),
            4 => Vec3::new(a, b, 1.0),
            _ => Vec3::new(b, a, -1.0),
        };
        map(p, t)
    })
}

/// Adds normals (one key) and a channel with each vertex's number.
pub fn dress(mesh: &mut DicedMesh, normal: Vec3) {
    mesh.normal_key_count = 1;
    mesh.normals = vec![octahedral::encode(normal); mesh.vertex_count];
    mesh.channels = vec![GridChannel {
        width: 1,
        values: (0..mesh.vertex_count).map(|i| i as f32).collect(),
    }];
}

/// A world of one object at its place.
pub fn world_of(mesh: DicedMesh) -> World {
    World::build(
        vec![instance(
            &object(mesh),
            InstanceTransform::Translation(DVec3::ZERO),
        )],
        DVec3::ZERO,
    )
}

pub fn object(mesh: DicedMesh) -> Arc<ObjectGeometry> {
    Arc::new(ObjectGeometry::new(mesh))
}

pub fn instance(object: &Arc<ObjectGeometry>, transform: InstanceTransform) -> WorldInstance {
    WorldInstance {
        object: object.clone(),
        transform,
        user: 7,
    }
}

/// A matrix: rotation, scale (mirroring where negative), shear-free, translation.
pub fn affine(axis: DVec3, angle: f64, scale: DVec3, translation: DVec3) -> DAffine3 {
    DAffine3 {
        matrix3: DMat3::from_quat(DQuat::from_axis_angle(axis.normalize(), angle))
            * DMat3::from_diagonal(scale),
        translation,
    }
}

/// A ray over everything.
pub fn ray(origin: Vec3, dir: Vec3, time: f32) -> Ray {
    Ray {
        origin,
        dir,
        time,
        t_min: 0.0,
        t_max: f32::INFINITY,
    }
}
