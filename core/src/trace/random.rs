//! Random numbers of tests: each from a state that it moves on.

use glam::Vec3;

/// A number from 0 to 1.
pub fn unit(state: &mut u64) -> f32 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as f32 / (1u64 << 24) as f32
}

/// A point of the cube from -1 to 1.
pub fn cube(state: &mut u64) -> Vec3 {
    Vec3::new(unit(state), unit(state), unit(state)) * 2.0 - 1.0
}
