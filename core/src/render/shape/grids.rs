//! Grids that the host has diced.

use super::primvars::Primvars;
use super::{Shape, Target};
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{GridsDesc, PrimDesc};
use crate::translate::grids::{self, CheckedGrids};
use crate::translate::points::PointKeys;

/// Checks the grids, and constant and uniform primvars.
pub(super) fn make(
    prim: &PrimDesc,
    desc: &GridsDesc,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<Box<dyn Shape>> {
    let path = &prim.common.path;
    let desc = grids::check(path, desc, context.shutter, &mut out.warnings)?;
    let mut primvars = Primvars::new(
        &prim.common,
        desc.primvar_counts(),
        context.shutter,
        &CheckedGrids::spread,
    );
    primvars.shading(out);
    let _no_channels: Vec<()> = primvars.finish(context, out);
    Some(Box::new(Grids(desc)))
}

struct Grids(CheckedGrids);

impl Shape for Grids {
    fn points(&self) -> &PointKeys {
        &self.0.points
    }

    fn dice(
        &self,
        _path: &str,
        target: &Target<'_>,
        _context: &Context<'_>,
        _out: &mut PrimObjects,
    ) -> Option<DicedMesh> {
        Some(self.0.place(target.path))
    }
}
