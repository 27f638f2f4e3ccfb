//! Which descriptions say the same at all times: what becomes of them does not depend on the shutter.

use std::sync::Arc;

use super::{
    CameraDesc, Geometry, InstancerDesc, PointsSamples, PrimDesc, PrimvarDesc, PrimvarSample,
    Samples, TransformSamples,
};

/// True where there is one at most, or all are the same: hosts sample what does not move, too.
fn all_alike<T: PartialEq>(samples: &[T]) -> bool {
    samples.windows(2).all(|pair| pair[0] == pair[1])
}

/// As [`all_alike`]; arrays that are shared are not looked into.
fn arrays_alike<T: PartialEq>(samples: &[Arc<Vec<T>>]) -> bool {
    let alike = |pair: &[Arc<Vec<T>>]| Arc::ptr_eq(&pair[0], &pair[1]) || pair[0] == pair[1];
    samples.windows(2).all(alike)
}

impl<T: PartialEq> Samples<T> {
    fn is_still(&self) -> bool {
        arrays_alike(&self.values)
    }
}

impl PointsSamples {
    fn is_still(&self) -> bool {
        // Rates move points on from a single sample, too.
        self.rates.velocities.values.is_empty() && arrays_alike(&self.points)
    }
}

impl PrimvarDesc {
    fn is_still(&self) -> bool {
        let alike = |pair: &[PrimvarSample]| {
            pair[0].values == pair[1].values && pair[0].indices == pair[1].indices
        };
        self.samples.windows(2).all(alike)
    }
}

fn are_still(levels: &[TransformSamples]) -> bool {
    levels.iter().all(|level| all_alike(&level.matrices))
}

impl Geometry {
    fn is_still(&self) -> bool {
        match self {
            Geometry::Grids(desc) => desc.times.len() <= 1,
            Geometry::Implicit(desc) => all_alike(&desc.sizes),
            Geometry::Mesh(desc) => desc.points.is_still(),
            Geometry::NurbsPatch(desc) => desc.points.is_still(),
            Geometry::NurbsCurves(desc) => desc.points.is_still(),
            Geometry::Curves(desc) => desc.points.is_still(),
            Geometry::Spheres(desc) => desc.points.is_still(),
        }
    }
}

impl PrimDesc {
    /// True when nothing of it changes with time.
    pub fn is_still(&self) -> bool {
        are_still(&self.common.transform)
            && self.geometry.is_still()
            && self.common.primvars.values().all(PrimvarDesc::is_still)
    }
}

impl InstancerDesc {
    /// True when nothing of it changes with time.
    pub fn is_still(&self) -> bool {
        let arrays = &*self.arrays;
        are_still(&self.transform)
            && arrays.positions.is_still()
            && arrays.orientations.is_still()
            && arrays.scales.is_still()
            && arrays.matrices.is_still()
            && arrays.velocities.values.is_empty()
            && arrays.angular_velocities.values.is_empty()
            && self.primvars.values().all(PrimvarDesc::is_still)
    }
}

impl CameraDesc {
    /// True when nothing of it changes with time.
    pub fn is_still(&self) -> bool {
        are_still(&self.transform) && self.lens_samples.len() <= 1
    }
}
