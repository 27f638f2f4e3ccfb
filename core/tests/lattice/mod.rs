//! What tests of diced meshes share: cameras, triangles, open edges.

// Each user takes a part of it.
#![allow(dead_code)]

use glam::{DAffine3, DVec3, Vec2, Vec3};
use hdtrapeze_core::dice::RasterView;
use hdtrapeze_core::grid::DicedMesh;
use std::collections::HashMap;

/// A perspective camera at `eye`, looking at `target`, 640 by 480 pixels.
pub fn camera(eye: Vec3, target: Vec3, pixels: f32) -> RasterView {
    let forward = (target - eye).as_dvec3().try_normalize();
    let forward = forward.unwrap_or(-DVec3::Z);
    let up = if forward.cross(DVec3::Y).length() > 1.0e-3 {
        DVec3::Y
    } else {
        DVec3::X
    };
    let right = forward.cross(up).normalize();
    let rotation = glam::DMat3::from_cols(right, right.cross(forward), -forward).transpose();
    RasterView {
        world_to_camera: DAffine3::from_mat3_translation(rotation, -(rotation * eye.as_dvec3())),
        scale: Vec2::splat(pixels),
        centre: Vec2::new(320.0, 240.0),
        orthographic: false,
        near: 0.05,
        size: Vec2::new(640.0, 480.0),
    }
}

/// Calls `f` with each micropolygon triangle at key `k`, corners ordered so that the diagonal is
/// the last side.
pub fn each_triangle(mesh: &DicedMesh, k: usize, mut f: impl FnMut([Vec3; 3])) {
    for (g, grid) in mesh.grids.iter().enumerate() {
        let at = mesh.grid_positions(g, k);
        let row = grid.nu as usize + 1;
        for j in 0..grid.nv as usize {
            for i in 0..grid.nu as usize {
                let v = j * row + i;
                f([at[v], at[v + 1], at[v + row + 1]]);
                f([at[v + row + 1], at[v + row], at[v]]);
            }
        }
    }
}

/// Directed triangle edges, by position bits, that their reverses do not match.
pub fn open_edges(mesh: &DicedMesh, k: usize) -> usize {
    type Bits = [u32; 3];
    let bits = |p: Vec3| p.to_array().map(|x| (x + 0.0).to_bits());
    let mut balance: HashMap<(Bits, Bits), i64> = HashMap::new();
    each_triangle(mesh, k, |t| {
        let t = t.map(bits);
        if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
            return;
        }
        for e in 0..3 {
            let (a, b) = (t[e], t[(e + 1) % 3]);
            if a < b {
                *balance.entry((a, b)).or_default() += 1;
            } else {
                *balance.entry((b, a)).or_default() -= 1;
            }
        }
    });
    balance.values().filter(|&&n| n != 0).count()
}

/// Area, and volume inside, of a diced mesh at key `k`.
pub fn area_and_volume(mesh: &DicedMesh, k: usize) -> (f64, f64) {
    let (mut area, mut volume) = (0.0, 0.0);
    each_triangle(mesh, k, |t| {
        let [a, b, c] = t.map(|p| p.as_dvec3());
        area += 0.5 * (b - a).cross(c - a).length();
        volume += a.dot(b.cross(c)) / 6.0;
    });
    (area, volume)
}
