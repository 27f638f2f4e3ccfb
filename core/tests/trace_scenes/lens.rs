//! The camera of the benches.

use glam::Vec3;
use hdtrapeze_core::trace::Ray;

use super::{Rng, ray};

/// A thin lens that looks from `eye` at `target`, in focus there.
pub struct Lens {
    eye: Vec3,
    axes: [Vec3; 3],
    focus: f32,
    radius: f32,
    half_width: f32,
}

impl Lens {
    /// In focus at `target`; half the width of the image is `half_width` at distance 1.
    pub fn new(eye: Vec3, target: Vec3, radius: f32, half_width: f32) -> Self {
        let forward = (target - eye).normalize();
        let right = forward.cross(Vec3::Y).normalize();
        Lens {
            eye,
            axes: [right, right.cross(forward), forward],
            focus: (target - eye).length(),
            radius,
            half_width,
        }
    }

    /// Rays of an image of `size`^2 pixels with 4 samples each: 8x8 pixels and a quarter of the shutter
    /// at a time.
    pub fn rays(&self, size: usize) -> Vec<Ray> {
        self.rays_with(size, 4)
    }

    /// The same with `samples` a pixel, each in a part of the shutter of its own.
    pub fn rays_with(&self, size: usize, samples: usize) -> Vec<Ray> {
        let mut rng = Rng(42);
        let mut rays = Vec::with_capacity(size * size * samples);
        let tiles = size / 8;
        for tile in 0..tiles * tiles {
            for stratum in 0..samples {
                for pixel in 0..64 {
                    let x = (tile % tiles * 8 + pixel % 8) as f32 + rng.unit();
                    let y = (tile / tiles * 8 + pixel / 8) as f32 + rng.unit();
                    let time = (stratum as f32 + rng.unit()) / samples as f32;
                    let at = |v: f32| (v / size as f32 * 2.0 - 1.0) * self.half_width * self.focus;
                    let (r, phi) = (
                        rng.unit().sqrt() * self.radius,
                        rng.unit() * std::f32::consts::TAU,
                    );
                    let [right, up, forward] = self.axes;
                    let lens = right * (r * phi.cos()) + up * (r * phi.sin());
                    let focus = right * at(x) + up * at(y) + forward * self.focus;
                    rays.push(ray(self.eye + lens, (focus - lens).normalize(), time));
                }
            }
        }
        rays
    }
}
