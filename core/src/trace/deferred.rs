//! Objects that are made when a ray first comes near them.
//!
//! A deferred object has bounds, which contain whatever it will be made to. A ray that has been to all objects that
//! are made, and enters these bounds nearer than its best hit, has it made; no other ray could have hit it.
//! So hits are those of an object that is there from the start, in whatever order rays come, and what no ray
//! comes near is never made.

use std::fmt;
use std::sync::{Arc, OnceLock};

use glam::Vec3;

use super::object_ray::{SLAB_PAD, TINY_PAD};
use crate::alone::alone_or;
use crate::bvh::{LinearBox, ObjectGeometry};
use crate::grid::DicedMesh;

/// Bounds as they are stored reach farther than what they contain, in a rotated frame by the square root of 3.
const STORED: f32 = 2.0;

type Make = Arc<dyn Fn() -> ObjectGeometry + Send + Sync>;

/// See the module's text.
pub struct Deferred {
    bounds: LinearBox,
    expected_bytes: usize,
    made: OnceLock<Arc<ObjectGeometry>>,
    make: Make,
}

impl fmt::Debug for Deferred {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Deferred")
            .field("bounds", &self.bounds)
            .field("made", &self.made)
            .finish_non_exhaustive()
    }
}

impl Deferred {
    /// `make` gives an object all of which lies within `bounds`: always the same one, whenever it is asked. It
    /// is asked once, on a thread of its own. `expected_bytes` is about what its positions take.
    pub fn new(
        bounds: LinearBox,
        expected_bytes: usize,
        make: Arc<dyn Fn() -> ObjectGeometry + Send + Sync>,
    ) -> Self {
        Self {
            bounds,
            expected_bytes,
            made: OnceLock::new(),
            make,
        }
    }

    /// Contains the object, relative to its mesh's origin.
    pub fn bounds(&self) -> &LinearBox {
        &self.bounds
    }

    /// Bytes of its positions, or what is expected while it is not made.
    pub fn position_bytes(&self) -> usize {
        self.made()
            .map_or(self.expected_bytes, |made| made.mesh().position_bytes())
    }

    /// Bounds the magnitude of coordinates, over time. The object, once it is made, has a radius of its own, which rays are prepared by.
    pub fn radius(&self) -> f32 {
        self.bounds.max_abs() * STORED
    }

    /// The object, where it has been made.
    pub fn made(&self) -> Option<&Arc<ObjectGeometry>> {
        self.made.get()
    }

    /// The object, which is made where it was not. Threads that ask for it meanwhile wait.
    pub fn object(&self) -> &Arc<ObjectGeometry> {
        self.made.get_or_init(|| {
            let make = Arc::clone(&self.make);
            let nothing = || ObjectGeometry::new(DicedMesh::default());
            Arc::new(alone_or(move || make(), nothing))
        })
    }

    /// Where a ray in the object's space enters its bounds; nothing where no vertex test of the object can
    /// accept it between `t_min` and `t_max`, both inclusive. As the slab tests of nodes, in f64, with twice
    /// their pad; NaN where numbers are not finite.
    pub(super) fn entry(
        &self,
        origin: Vec3,
        dir: Vec3,
        time: f32,
        [t_min, t_max]: [f32; 2],
    ) -> Option<f64> {
        let tiny = (dir.abs().max_element() + 1.0) * TINY_PAD;
        let pad = SLAB_PAD * (origin.abs().max_element() + self.radius()) + tiny;
        let pad = 2.0 * f64::from(pad);
        let (low, high) = self.bounds.at(f64::from(time));
        let (origin, dir) = (origin.as_dvec3(), dir.as_dvec3());
        let (mut near, mut far) = (f64::from(t_min), f64::from(t_max));
        for axis in 0..3 {
            let (a, b) = (
                low[axis] - pad - origin[axis],
                high[axis] + pad - origin[axis],
            );
            if dir[axis] == 0.0 {
                if a > 0.0 || b < 0.0 {
                    return None;
                }
                continue;
            }
            let (a, b) = (a / dir[axis], b / dir[axis]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        // Written so that NaN is let through.
        if near > far { None } else { Some(near) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> Deferred {
        let bounds = LinearBox {
            lo0: Vec3::ZERO,
            hi0: Vec3::ONE,
            lo1: Vec3::X * 4.0,
            hi1: Vec3::ONE + Vec3::X * 4.0,
        };
        Deferred::new(
            bounds,
            0,
            Arc::new(|| ObjectGeometry::new(DicedMesh::default())),
        )
    }

    #[test]
    fn only_rays_that_may_hit_reach_it() {
        let deferred = unit();
        let from = Vec3::new(0.5, 0.5, -2.0);
        let entry = |origin: Vec3, time: f32, t: [f32; 2]| deferred.entry(origin, Vec3::Z, time, t);
        assert_eq!(entry(from, 0.5, [0.0, 10.0]), None, "it has moved on");
        assert_eq!(
            entry(from, 0.0, [0.0, 1.9]),
            None,
            "it is behind the best hit"
        );
        assert_eq!(entry(from, 0.0, [3.1, 10.0]), None);
        assert_eq!(entry(from + Vec3::Y, 0.0, [0.0, 10.0]), None);
        let near = entry(from + Vec3::X * 2.0, 0.5, [0.0, 2.0]).expect("it is met");
        assert!((near - 2.0).abs() < 1.0e-3);
        assert!(deferred.made().is_none());
        assert!(deferred.object().is_empty() && deferred.made().is_some());
    }

    #[test]
    fn rays_along_a_side_reach_it() {
        let at = |x: f32| {
            let entry = unit().entry(Vec3::new(x, 0.5, -2.0), Vec3::Z, 0.0, [0.0, 2.0]);
            entry.is_some()
        };
        assert!(at(0.0) && at(1.0) && at(1.0f32.next_up()) && !at(1.001));
    }
}
