//! Grids that the host has diced.

use super::{Shape, Target};
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{GridsDesc, PrimDesc};
use crate::shade::{DEFAULT_ALBEDO, PrimShading, Source};
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
    let mut source = |name: &str, width: usize| {
        let primvar = prim.common.primvars.get(name)?;
        grids::resolve_primvar(path, name, primvar, width, &desc, &mut out.warnings)
    };
    let color = source("displayColor", 3);
    let opacity = source("displayOpacity", 1);
    out.shading = PrimShading {
        color: color.unwrap_or(Source::Constant(DEFAULT_ALBEDO)),
        opacity: opacity.filter(|o| *o != Source::Constant([1.0; 3])),
    };
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
