//! What integration tests share.

use glam::Vec3;
use hdtrapeze_core::surface::{
    Channel, LimitSurface, MeshTopology, SubdivisionFactory, SurfaceError,
};

/// Polygons need no subdivision library.
pub struct NoSubdivision;

impl SubdivisionFactory for NoSubdivision {
    fn create(
        &self,
        _: &MeshTopology,
        _: &[Vec<Vec3>],
        _: Vec<Channel>,
    ) -> Result<Box<dyn LimitSurface>, SurfaceError> {
        Err(SurfaceError::Library(
            "not linked into this test".to_owned(),
        ))
    }
}
