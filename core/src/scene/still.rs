//! Which descriptions say the same at all times: what becomes of them does not depend on the shutter.

use super::{
    CameraDesc, Geometry, InstancerDesc, PointsSamples, PrimDesc, PrimvarDesc, Samples,
    TransformSamples,
};

impl<T> Samples<T> {
    fn is_still(&self) -> bool {
        self.values.len() <= 1
    }
}

impl PointsSamples {
    fn is_still(&self) -> bool {
        // Rates move points on from a single sample, too.
        self.points.len() <= 1 && self.rates.velocities.values.is_empty()
    }
}

impl PrimvarDesc {
    fn is_still(&self) -> bool {
        self.samples.len() <= 1
    }
}

fn are_still(levels: &[TransformSamples]) -> bool {
    levels.iter().all(|level| level.matrices.len() <= 1)
}

impl Geometry {
    fn is_still(&self) -> bool {
        match self {
            Geometry::Grids(desc) => desc.times.len() <= 1,
            Geometry::Implicit(desc) => desc.sizes.len() <= 1,
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
