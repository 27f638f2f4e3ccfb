//! Surfaces of revolution about z: a straight side between two caps, which are flat or parts of
//! spheres.
//!
//! The side is four faces around. A cap is one face in the middle and four around it; on the unit
//! disc the middle one is a square whose corners lie [`MIDDLE`] from the centre, and the others are
//! spanned between its sides and the circle by straight lines. A dome lifts the disc so that distance
//! from the centre becomes angle from the pole.

use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

use super::{Quadric, Sample};

/// Distance of the corners of a cap's middle face from its centre: cells of the faces around it are
/// about as wide as long.
const MIDDLE: f64 = 0.6;

/// What closes one end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cap {
    /// A disc across the axis.
    Disc {
        /// Position along the axis.
        z: f64,
        /// Radius, 0 or more.
        radius: f64,
    },
    /// The part of a sphere that lies within an angle about the outward axis.
    Dome {
        /// The sphere's centre along the axis.
        z: f64,
        /// The sphere's radius, 0 or more.
        radius: f64,
        /// The angle at the sphere's centre between the pole and the rim, radians, 0 to pi.
        opening: f64,
    },
}

impl Cap {
    /// Radius and position along the axis of the rim. `up` is 1 for the upper cap, -1 for the lower.
    fn rim(&self, up: f64) -> DVec2 {
        match *self {
            Cap::Disc { z, radius } => DVec2::new(radius, z),
            Cap::Dome { z, radius, opening } => {
                let (sin, cos) = opening.sin_cos();
                DVec2::new(radius * sin, z + up * radius * cos)
            }
        }
    }

    /// The point over the point `disc` of the unit disc.
    fn sample(&self, disc: DVec2, up: f64) -> Sample {
        match *self {
            Cap::Disc { z, radius } => Sample {
                position: (disc * radius).extend(z),
                normal: DVec3::Z * up,
            },
            Cap::Dome { z, radius, opening } => {
                let angle = opening * disc.length();
                // sin(angle) / |disc|, which at the pole is the opening.
                let lift = opening
                    * if angle > 1.0e-9 {
                        angle.sin() / angle
                    } else {
                        1.0
                    };
                let normal = (disc * lift).extend(up * angle.cos());
                let position = DVec3::Z * z + normal * radius;
                Sample { position, normal }
            }
        }
    }
}

/// The half section at one key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// The lower end.
    pub lower: Cap,
    /// The upper end.
    pub upper: Cap,
    /// False where the side closes by itself at the upper end, whose rim has no radius: then no
    /// faces are spent on it. The same at every key.
    pub has_upper: bool,
    /// The side's normal: its part away from the axis, and along it. Unit.
    pub side_normal: DVec2,
}

impl Profile {
    /// A cylinder or, with unlike radii, a part of a cone, centred.
    pub fn cylinder(height: f64, lower: f64, upper: f64) -> Self {
        let cap = |z, radius| Cap::Disc { z, radius };
        let side_normal = DVec2::new(height, lower - upper);
        Self {
            lower: cap(-0.5 * height, lower),
            upper: cap(0.5 * height, upper),
            has_upper: true,
            side_normal: side_normal.try_normalize().unwrap_or(DVec2::X),
        }
    }

    /// A cone with its tip up, centred.
    pub fn cone(height: f64, radius: f64) -> Self {
        Self {
            has_upper: false,
            ..Self::cylinder(height, radius, 0.0)
        }
    }

    /// A cylinder or part of a cone with a dome at either end that touches its side all around the
    /// rim, centred (UsdGeomCapsule_1): a dome on the wider end is more than half a sphere. Without
    /// height there is no side to touch, and the domes are half spheres.
    pub fn capsule(height: f64, lower: f64, upper: f64) -> Self {
        let slope = if height > 0.0 {
            (lower - upper) / height
        } else {
            0.0
        };
        let stretch = slope.hypot(1.0);
        let dome = |rim: f64, z: f64, opening: f64| Cap::Dome {
            z: z - rim * slope,
            radius: rim * stretch,
            opening,
        };
        let lean = slope.atan();
        Self {
            lower: dome(lower, -0.5 * height, FRAC_PI_2 + lean),
            upper: dome(upper, 0.5 * height, FRAC_PI_2 - lean),
            ..Self::cylinder(height, lower, upper)
        }
    }

    /// Largest distance from the axis, and the lowest and highest point along it.
    pub fn extent(&self) -> [f64; 3] {
        let end = |cap: &Cap, up: f64| match *cap {
            Cap::Disc { z, radius } => (radius, z),
            Cap::Dome { z, radius, opening } => {
                (radius * opening.min(FRAC_PI_2).sin(), z + up * radius)
            }
        };
        let ((a, low), (b, high)) = (end(&self.lower, -1.0), end(&self.upper, 1.0));
        [a.max(b), low.min(high), high.max(low)]
    }

    /// Points of the section, (radius, z), that follow how the whole moves: rims, and domes halfway.
    pub fn probes(&self) -> [DVec2; 4] {
        let halfway = |cap: &Cap, up: f64| {
            let p = cap.sample(DVec2::X * 0.5, up).position;
            DVec2::new(p.x, p.z)
        };
        [
            self.lower.rim(-1.0),
            self.upper.rim(1.0),
            halfway(&self.lower, -1.0),
            halfway(&self.upper, 1.0),
        ]
    }
}

/// Vertices: the lower rim, the upper rim, the corners of the lower and of the upper middle face.
const RIMS: [u32; 2] = [0, 4];
const MIDDLES: [u32; 2] = [8, 12];
/// Faces: four of the side, then five of the lower cap and five of the upper.
const SIDE_FACES: usize = 4;
const CAP_FACES: usize = 5;

/// Profiles that turn about z.
pub(super) struct Revolved {
    profiles: Vec<Profile>,
    faces: Vec<[u32; 4]>,
}

impl Revolved {
    pub fn new(profiles: Vec<Profile>) -> Self {
        let has_upper = profiles.first().is_some_and(|p| p.has_upper);
        let quarters = || (0..4u32).map(|k| (k, (k + 1) % 4));
        let [lower, upper] = RIMS;
        let mut faces: Vec<[u32; 4]> = quarters()
            .map(|(k, l)| [lower + k, lower + l, upper + l, upper + k])
            .collect();
        // From below, angles run the other way.
        let m = MIDDLES[0];
        faces.extend(quarters().map(|(k, l)| [lower + l, lower + k, m + k, m + l]));
        faces.push([m, m + 3, m + 2, m + 1]);
        if has_upper {
            let m = MIDDLES[1];
            faces.extend(quarters().map(|(k, l)| [upper + k, upper + l, m + l, m + k]));
            faces.push([m, m + 1, m + 2, m + 3]);
        }
        Self { profiles, faces }
    }
}

/// The point of the unit circle `fraction` of the way through quarter `quarter`; exact at its ends.
fn on_circle(quarter: usize, fraction: f64) -> DVec2 {
    let p = if fraction == 1.0 {
        DVec2::Y
    } else {
        DVec2::from_angle(FRAC_PI_2 * fraction)
    };
    (0..quarter).fold(p, |p, _| p.perp())
}

/// Where `(s, t)` of a face of an upper cap lies on the unit disc.
fn on_disc(face: usize, s: f64, t: f64) -> DVec2 {
    let corner = |k: usize| on_circle(k, 0.0) * MIDDLE;
    if face == SIDE_FACES {
        let across = |a: DVec2, b: DVec2| a * (1.0 - s) + b * s;
        return across(corner(0), corner(1)) * (1.0 - t) + across(corner(3), corner(2)) * t;
    }
    let inner = corner(face) * (1.0 - s) + corner(face + 1) * s;
    on_circle(face, s) * (1.0 - t) + inner * t
}

impl Quadric for Revolved {
    fn faces(&self) -> &[[u32; 4]] {
        &self.faces
    }

    fn key_count(&self) -> usize {
        self.profiles.len()
    }

    fn sample(&self, face: usize, s: f64, t: f64, emit: &mut dyn FnMut(usize, Sample)) {
        if face < SIDE_FACES {
            let around = on_circle(face, s);
            for (key, profile) in self.profiles.iter().enumerate() {
                let (low, high) = (profile.lower.rim(-1.0), profile.upper.rim(1.0));
                let at = low * (1.0 - t) + high * t;
                let n = profile.side_normal;
                let position = (around * at.x).extend(at.y);
                let normal = (around * n.x).extend(n.y);
                emit(key, Sample { position, normal });
            }
            return;
        }
        let number = face - SIDE_FACES;
        let upper = number >= CAP_FACES;
        let (number, up) = (number % CAP_FACES, if upper { 1.0 } else { -1.0 });
        let disc = match (upper, number == SIDE_FACES) {
            (true, _) => on_disc(number, s, t),
            (false, true) => on_disc(number, t, s),
            (false, false) => on_disc(number, 1.0 - s, t),
        };
        for (key, profile) in self.profiles.iter().enumerate() {
            let cap = if upper {
                &profile.upper
            } else {
                &profile.lower
            };
            emit(key, cap.sample(disc, up));
        }
    }
}
