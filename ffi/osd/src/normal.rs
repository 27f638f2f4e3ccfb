//! Unit normals from first derivatives, with care for points where they do not span a plane.

use glam::{Vec2, Vec3};

/// Sine of the angle between derivatives below which their cross product says nothing. Derivatives at
/// an extraordinary vertex are differences over 1/16 of a face, of positions that may be ten faces
/// from the origin: 160 * 2^-24 is 1e-5 of their length, and a hundred times that still points within
/// half a degree.
const SINE_TOLERANCE: f32 = 1e-3;

/// How far a sample is moved towards the middle of its domain when its normal is not defined there
/// (a rounded corner, a collapsed edge); a part of the domain.
pub(crate) const NUDGE: f32 = 1.0 / 64.0;

/// `st` a little nearer to the middle of the domain.
pub(crate) fn nudged(st: Vec2) -> Vec2 {
    st + (Vec2::splat(0.5) - st) * NUDGE
}

/// The unit normal, or nothing where the derivatives are parallel, zero or not finite.
#[inline(always)]
pub(crate) fn unit_normal(du: Vec3, dv: Vec3) -> Option<Vec3> {
    let c = du.cross(dv);
    let l2 = c.length_squared();
    // Inside this range neither product can have lost its meaning to underflow or overflow.
    if l2 > (SINE_TOLERANCE * SINE_TOLERANCE) * du.length_squared() * dv.length_squared()
        && l2 > 1e-24
        && l2 < 1e30
    {
        Some(c / l2.sqrt())
    } else {
        careful(du, dv)
    }
}

#[cold]
fn careful(du: Vec3, dv: Vec3) -> Option<Vec3> {
    let (du, dv) = (
        du.as_dvec3().try_normalize()?,
        dv.as_dvec3().try_normalize()?,
    );
    let c = du.cross(dv);
    (c.length() > f64::from(SINE_TOLERANCE)).then(|| c.normalize().as_vec3())
}
