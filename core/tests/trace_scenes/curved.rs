//! Scenes whose points run along curves: what a chord from open to close of the shutter misses.

use std::f32::consts::{PI, TAU};

use glam::{Quat, Vec3};
use hdtrapeze_core::grid::DicedMesh;

use super::{BEND, Rng, mesh};

/// A propeller of five twisted blades of `n` by `4 n` grids about the z axis, which turns by `angle`.
pub fn fan(n: usize, rate: u16, keys: &[f32], angle: f32) -> DicedMesh {
    let blade = n * 4 * n;
    mesh(&vec![(rate, rate); 5 * blade], keys, |g, u, v, t| {
        let (which, g) = (g / blade, g % blade);
        let across = ((g % n) as f32 + u) / n as f32 - 0.5;
        let along = ((g / n) as f32 + v) / (4 * n) as f32;
        let pitch = 0.3 + 0.9 * (1.0 - along);
        let chord = 0.3 * (1.0 - 0.4 * along) * across;
        let p = Vec3::new(0.1 + 0.9 * along, chord * pitch.cos(), chord * pitch.sin());
        Quat::from_rotation_z(which as f32 * TAU / 5.0 + angle * t) * p
    })
}

/// Patches that each make half a turn about an axis of their own.
pub fn debris(count: usize, rate: u16, keys: &[f32], seed: u64) -> DicedMesh {
    bent_debris(count, rate, keys, seed, BEND)
}

/// The same, bent so much.
pub fn bent_debris(count: usize, rate: u16, keys: &[f32], seed: u64, bend: f32) -> DicedMesh {
    let mut rng = Rng(seed);
    let size = 1.2 / (count as f32).cbrt();
    let who: Vec<_> = (0..count)
        .map(|_| (rng.cube(), rng.direction(), rng.direction(), rng.cube()))
        .collect();
    mesh(&vec![(rate, rate); count], keys, move |g, u, v, t| {
        let (centre, axis, spin, drift) = who[g];
        let q = Quat::from_axis_angle(spin, PI * t) * Quat::from_rotation_arc(Vec3::Z, axis);
        let (x, y) = (u - 0.5, v - 0.5);
        let p = Vec3::new(x, y, bend * (x * x - y * y));
        centre + q * p * size + drift * (0.5 * size * t)
    })
}

/// Patches that fall from rest, all alike, each with a drift of its own.
pub fn falling(count: usize, rate: u16, keys: &[f32], seed: u64) -> DicedMesh {
    bent_falling(count, rate, keys, seed, BEND)
}

/// The same, bent so much.
pub fn bent_falling(count: usize, rate: u16, keys: &[f32], seed: u64, bend: f32) -> DicedMesh {
    carried(count, rate, keys, seed, bend, |t| {
        Vec3::new(0.3 * t, -0.8 * t * t, 0.0)
    })
}

/// Patches that circle the z axis together, by `angle`, and keep their orientation.
pub fn orbit(count: usize, rate: u16, keys: &[f32], angle: f32, seed: u64) -> DicedMesh {
    carried(count, rate, keys, seed, BEND, |t| {
        Vec3::new((angle * t).cos(), (angle * t).sin(), 0.0) * 0.5
    })
}

fn carried(
    count: usize,
    rate: u16,
    keys: &[f32],
    seed: u64,
    bend: f32,
    path: impl Fn(f32) -> Vec3,
) -> DicedMesh {
    let mut rng = Rng(seed);
    let size = 0.9 / (count as f32).cbrt();
    let who: Vec<_> = (0..count)
        .map(|_| (rng.cube() * 0.7, rng.direction(), rng.cube()))
        .collect();
    mesh(&vec![(rate, rate); count], keys, move |g, u, v, t| {
        let (centre, axis, drift) = who[g];
        let (x, y) = (u - 0.5, v - 0.5);
        let p = Vec3::new(x, y, bend * (x * x - y * y));
        let q = Quat::from_rotation_arc(Vec3::Z, axis);
        centre + q * p * size + drift * (0.5 * size * t) + path(t)
    })
}

/// Ribbons that stand on the plane z = 0 and whip round: each tip runs along an arc of a radian and a half.
pub fn whip(count: usize, keys: &[f32], seed: u64) -> DicedMesh {
    let mut rng = Rng(seed);
    let width = 0.6 / (count as f32).sqrt();
    let who: Vec<_> = (0..count)
        .map(|_| {
            let root = Vec3::new(rng.signed(), rng.signed(), 0.0);
            (root, rng.unit() * TAU, rng.unit() * PI, rng.signed())
        })
        .collect();
    mesh(&vec![(1, 16); count], keys, move |g, u, v, t| {
        let (root, towards, angle, sense) = who[g];
        let across = Vec3::new(angle.cos(), angle.sin(), 0.0) * (width * (1.0 - 0.9 * v));
        let turn = towards + 1.5 * sense.signum() * t;
        let lean = Vec3::new(turn.cos(), turn.sin(), 0.0) * 0.6;
        root + across * (u - 0.5) + (Vec3::Z * v + lean * (v * v)) * 0.25
    })
}

/// Blocks that fly along arcs and turn meanwhile, with noise at every key.
pub fn flown(count: usize, keys: &[f32], noise: f32, seed: u64) -> DicedMesh {
    let mut rng = Rng(seed);
    let who: Vec<_> = (0..count)
        .map(|_| {
            (
                rng.cube(),
                rng.direction(),
                rng.direction(),
                rng.cube(),
                rng.cube(),
            )
        })
        .collect();
    mesh(&vec![(16, 16); count], keys, move |g, u, v, t| {
        let (centre, axis, spin, way, fall) = who[g];
        let q = Quat::from_axis_angle(spin, 1.5 * t) * Quat::from_rotation_arc(Vec3::Z, axis);
        let (x, y) = (u - 0.5, v - 0.5);
        let p = Vec3::new(x, y, 0.1 * (x * x - y * y));
        let bits = u64::from(u.to_bits()) << 32 ^ u64::from(v.to_bits()).rotate_left(11);
        let off = Rng(seed ^ bits ^ u64::from(t.to_bits()).rotate_left(43)).cube() * noise;
        centre + q * (p * 0.3 + off) + way * t + fall * (t * t)
    })
}
