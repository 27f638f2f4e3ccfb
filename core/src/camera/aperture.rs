//! Points of the lens' opening: the unit square to a disk, an oval, or the shape that blades leave.
//!
//! Each map takes equal areas to equal areas and keeps neighbours together, so that samples that are
//! well spread over the square are so over the opening. Points are in units of the lens' radius; every
//! shape has the area of the unit disk.
//!
//! Blades: rings of the concentric map become rings of the opening's own shape. A ring's direction
//! goes to the point of the outline below which the same share of the area lies, and its radius scales
//! that point: the density is the same everywhere, since an element r dr d(share) is.

use std::hint::select_unpredictable;

use glam::{DVec2, Vec2};

use super::CameraNotes;
use crate::diagnostics::number;
use crate::scene::ApertureDesc;

/// More blades than this are round: the outline is within 1e-4 of the circle.
const MOST_BLADES: u32 = 256;
/// Roundness below which edges are straight: arcs rise less than 1e-6 of the radius above them.
const LEAST_ROUNDNESS: f64 = 1.0e-6;
/// Newton steps for a point of an arc. The first overshoots at most, the others close in
/// quadratically; residuals are tested.
const ARC_STEPS: usize = 4;
/// Largest width over height, and its inverse.
const LARGEST_RATIO: f64 = 1000.0;

/// The opening of a lens.
#[derive(Clone, Debug, PartialEq)]
pub enum Aperture {
    /// A disk.
    Round,
    /// An ellipse with these half axes.
    Oval(Vec2),
    /// Straight or bent blades.
    Blades(Blades),
}

impl Aperture {
    /// Resolves a description; what cannot be used is noted and left at its default.
    pub fn new(desc: &ApertureDesc, notes: &mut CameraNotes) -> Self {
        let mut rotation = desc.rotation;
        if !rotation.is_finite() {
            notes.push(format!(
                "aperture rotation {rotation} is not finite; 0 is used"
            ));
            rotation = 0.0;
        }
        let mut ratio = desc.ratio;
        if !(1.0 / LARGEST_RATIO..=LARGEST_RATIO).contains(&ratio) {
            notes.push(format!(
                "aperture ratio {} is not from 0.001 to 1000; 1 is used",
                number(ratio)
            ));
            ratio = 1.0;
        }
        let mut roundness = desc.roundness;
        if !(0.0..=1.0).contains(&roundness) {
            let usable = if roundness > 1.0 { 1.0 } else { 0.0 };
            notes.push(format!(
                "aperture roundness {} is not from 0 to 1; {usable} is used",
                number(roundness)
            ));
            roundness = usable;
        }
        let half_axes = DVec2::new(ratio.sqrt(), 1.0 / ratio.sqrt());
        if (3..=MOST_BLADES).contains(&desc.blades) && roundness < 1.0 {
            return Self::Blades(Blades::new(desc.blades, rotation, half_axes, roundness));
        }
        if ratio == 1.0 {
            Self::Round
        } else {
            Self::Oval(half_axes.as_vec2())
        }
    }

    /// The point of the opening for a point of the unit square.
    #[inline]
    pub fn point(&self, u: f32, v: f32) -> Vec2 {
        match self {
            Self::Round => concentric_disk(u, v),
            Self::Oval(half_axes) => concentric_disk(u, v) * *half_axes,
            Self::Blades(blades) => blades.point(u, v),
        }
    }
}

/// A regular polygon, or one with sides bent outwards to arcs.
#[derive(Clone, Debug, PartialEq)]
pub struct Blades {
    /// Where the first corner is, in turns.
    pub start: f32,
    /// For each side, the vector to its middle and from there to its end; already squeezed.
    pub sides: Vec<[Vec2; 2]>,
    /// None for straight sides.
    pub arc: Option<BentSide>,
}

/// A side as an arc, in a frame with x through its middle: (centre + radius cos a, radius sin a),
/// as factors of the straight side's two vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BentSide {
    /// -(centre) / radius, in [0, 1).
    pub eccentricity: f64,
    /// The angle at the side's end.
    pub half_angle: f64,
    /// Angle less eccentricity times its sine, at the side's end: twice the area below half of the
    /// arc, over radius^2.
    pub half_area: f64,
    /// Radius over the distance of the side's middle, and over half its length.
    pub along: DVec2,
}

impl Blades {
    fn new(blades: u32, rotation: f64, half_axes: DVec2, roundness: f64) -> Self {
        let half = std::f64::consts::PI / f64::from(blades);
        let (sin, cos) = half.sin_cos();
        // All for corners at distance 1 first.
        let (mut area, mut arc) = (sin * cos, None);
        if roundness >= LEAST_ROUNDNESS {
            let radius = 1.0 / roundness;
            let centre = cos - (radius * radius - sin * sin).sqrt();
            let eccentricity = -centre / radius;
            let half_angle = (sin / radius).asin();
            let half_area = half_angle - eccentricity * half_angle.sin();
            area = radius * radius * half_area;
            arc = Some(BentSide {
                eccentricity,
                half_angle,
                half_area,
                along: DVec2::new(radius / cos, radius / sin),
            });
        }
        let scale = (std::f64::consts::PI / (f64::from(blades) * area)).sqrt();
        let first = rotation.rem_euclid(360.0).to_radians() + std::f64::consts::FRAC_PI_2;
        let side = |k: u32| {
            let to_middle = DVec2::from_angle(first + half * f64::from(2 * k + 1));
            let middle = to_middle * (scale * cos) * half_axes;
            let end = to_middle.perp() * (scale * sin) * half_axes;
            [middle.as_vec2(), end.as_vec2()]
        };
        Self {
            start: (first / std::f64::consts::TAU).rem_euclid(1.0) as f32,
            sides: (0..blades).map(side).collect(),
            arc,
        }
    }

    fn point(&self, u: f32, v: f32) -> Vec2 {
        let (radius, turn) = concentric_polar(u, v);
        let count = self.sides.len();
        let at = (turn - self.start).rem_euclid(1.0) * count as f32;
        let k = (at as usize).min(count - 1);
        let share = (2.0 * (at - k as f32) - 1.0).clamp(-1.0, 1.0);
        let [middle, end] = self.sides[k];
        match &self.arc {
            None => (middle + end * share) * radius,
            Some(side) => {
                let at = side.point(share);
                (middle * at.x + end * at.y) * radius
            }
        }
    }
}

impl BentSide {
    /// The point of the arc below which `share` of its area lies, -1 at its start to 1 at its end.
    fn point(&self, share: f32) -> Vec2 {
        let share = f64::from(share);
        let angle = self.angle(share.abs()).copysign(share);
        let (sin, cos) = angle.sin_cos();
        (DVec2::new(cos - self.eccentricity, sin) * self.along).as_vec2()
    }

    /// Solves angle - eccentricity sin(angle) = share * half_area (Kepler's equation): convex, so
    /// that Newton's steps close in from above after the first.
    fn angle(&self, share: f64) -> f64 {
        let e = self.eccentricity;
        let target = share * self.half_area;
        let mut angle = share * self.half_angle;
        for _ in 0..ARC_STEPS {
            let (sin, cos) = angle.sin_cos();
            angle -= (angle - e * sin - target) / (1.0 - e * cos);
        }
        angle.clamp(0.0, self.half_angle)
    }
}

/// Unit square to unit disk, keeping strata together (Shirley and Chiu, "A Low Distortion Map
/// Between Disk and Square", JGT 1997).
#[inline]
pub fn concentric_disk(u: f32, v: f32) -> Vec2 {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
    let p = Vec2::new(2.0 * u - 1.0, 2.0 * v - 1.0);
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    // Nobody guesses which is larger.
    let wide = p.x.abs() > p.y.abs();
    let (r, other) = select_unpredictable(wide, (p.x, p.y), (p.y, p.x));
    let turned = FRAC_PI_4 * (other / r);
    let angle = select_unpredictable(wide, turned, FRAC_PI_2 - turned);
    Vec2::new(angle.cos(), angle.sin()) * r
}

/// The same map in polar form: radius, and angle in turns from -1/8 to 7/8.
fn concentric_polar(u: f32, v: f32) -> (f32, f32) {
    let p = Vec2::new(2.0 * u - 1.0, 2.0 * v - 1.0);
    let size = p.abs();
    if p == Vec2::ZERO {
        (0.0, 0.0)
    } else if size.x > size.y {
        let turn = 0.125 * (p.y / p.x);
        (size.x, if p.x > 0.0 { turn } else { turn + 0.5 })
    } else {
        let turn = 0.25 - 0.125 * (p.x / p.y);
        (size.y, if p.y > 0.0 { turn } else { turn + 0.5 })
    }
}

#[cfg(test)]
#[path = "aperture_tests.rs"]
mod tests;
