//! Implicit prims.

use super::primvars::Primvars;
use super::surface::dice_surface;
use super::{Shape, Target};
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{ImplicitDesc, PrimDesc};
use crate::surface::{LimitSurface, Orientation};
use crate::translate::implicit::{self, CheckedImplicit};
use crate::translate::points::PointKeys;

struct Implicit {
    checked: CheckedImplicit,
    orientation: Orientation,
}

impl Shape for Implicit {
    fn points(&self) -> &PointKeys {
        &self.checked.points
    }

    fn is_left_handed(&self) -> bool {
        self.orientation == Orientation::LeftHanded
    }

    fn surface(&self) -> Option<&dyn LimitSurface> {
        Some(self.checked.surface.as_ref())
    }

    fn element(&self, element: u32) -> u32 {
        match self.checked.faces {
            None => 0,
            Some(_) => element,
        }
    }

    fn dice(
        &self,
        path: &str,
        target: &Target<'_>,
        context: &Context<'_>,
        out: &mut PrimObjects,
    ) -> Option<DicedMesh> {
        let surface = self.checked.surface.as_ref();
        let mut diced = dice_surface(path, surface, target, context, out)?;
        for grid in &mut diced.grids {
            grid.element = self.element(grid.element);
        }
        Some(diced)
    }
}

/// Checks the sizes and the primvars.
pub(super) fn make(
    prim: &PrimDesc,
    desc: &ImplicitDesc,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<Box<dyn Shape>> {
    let path = &prim.common.path;
    let checked = implicit::check(path, desc, context.shutter, &mut out.warnings)?;
    let counts = checked.primvar_counts();
    let spread = |resolved| checked.spread(resolved);
    let mut primvars = Primvars::new(&prim.common, counts, context.shutter, &spread);
    primvars.shading(out);
    let channels = primvars.finish(context, out);
    Some(Box::new(Implicit {
        checked: checked.with_channels(channels),
        orientation: desc.orientation,
    }))
}
