//! A sphere as a cube blown up: lines of a face lie on great circles at even angles, so that cells of
//! one face differ by less than a half in area, and both faces of an edge divide it alike.

use glam::DVec3;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4};

use super::{Quadric, Sample};

pub(super) struct Sphere {
    pub radii: Vec<f64>,
}

/// Corners of the cube: bits 0, 1 and 2 are set where x, y and z are positive.
const FACES: [[u32; 4]; 6] = [
    [1, 3, 7, 5],
    [0, 4, 6, 2],
    [2, 6, 7, 3],
    [0, 1, 5, 4],
    [4, 5, 7, 6],
    [0, 2, 3, 1],
];

impl Quadric for Sphere {
    fn faces(&self) -> &[[u32; 4]] {
        &FACES
    }

    fn key_count(&self) -> usize {
        self.radii.len()
    }

    fn sample(&self, face: usize, s: f64, t: f64, emit: &mut dyn FnMut(usize, Sample)) {
        let corner = |i: usize| {
            let bits = FACES[face][i];
            let sign = |bit: u32| if bits >> bit & 1 == 1 { 1.0 } else { -1.0 };
            DVec3::new(sign(0), sign(1), sign(2))
        };
        let even = |x: f64| (FRAC_PI_4 * (2.0 * x - 1.0)).tan();
        let (along_s, along_t) = (corner(1) - corner(0), corner(3) - corner(0));
        let middle = (corner(0) + corner(2)) * 0.5;
        let p = middle + along_s * (0.5 * even(s)) + along_t * (0.5 * even(t));
        let normal = p.normalize();
        for (key, radius) in self.radii.iter().enumerate() {
            let position = normal * *radius;
            emit(key, Sample { position, normal });
        }
    }

    fn boxes(&self, face: usize) -> Vec<[DVec3; 2]> {
        // The axis that all four corners agree on: there the normal has 1/sqrt(3) (at a corner) to 1, and
        // across it up to 1/sqrt(2) either way (at the middle of an edge).
        let corners = FACES[face];
        let same = corners.iter().fold(!0, |bits, c| bits & !(c ^ corners[0])) & 7;
        let (mut low, mut high) = (DVec3::splat(-FRAC_1_SQRT_2), DVec3::splat(FRAC_1_SQRT_2));
        let axis = same.trailing_zeros() as usize;
        let least = 1.0 / 3f64.sqrt();
        let (from, to) = match corners[0] >> axis & 1 {
            1 => (least, 1.0),
            _ => (-1.0, -least),
        };
        (low[axis], high[axis]) = (from, to);
        let radii = self.radii.iter();
        radii.map(|&radius| [low * radius, high * radius]).collect()
    }
}
