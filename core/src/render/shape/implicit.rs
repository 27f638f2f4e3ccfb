//! Implicit prims.

use super::primvars::Primvars;
use super::surface::dice_surface;
use super::{Shape, Target};
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{ImplicitDesc, PrimDesc};
use crate::surface::Orientation;
use crate::translate::implicit::{self, CheckedImplicit};
use crate::translate::points::PointKeys;
use crate::translate::primvar::{Counts, Resolved};

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
            grid.element = 0;
        }
        Some(diced)
    }
}

/// Checks the sizes, and primvars of one value.
pub(super) fn make(
    prim: &PrimDesc,
    desc: &ImplicitDesc,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<Box<dyn Shape>> {
    let path = &prim.common.path;
    let checked = implicit::check(path, desc, context.shutter, &mut out.warnings)?;
    let counts = Counts::one_value("implicit prim");
    let mut primvars = Primvars::new(
        &prim.common,
        counts,
        context.shutter,
        &Resolved::into_constant,
    );
    primvars.shading(out);
    let _no_channels: Vec<()> = primvars.finish(context, out);
    Some(Box::new(Implicit {
        checked,
        orientation: desc.orientation,
    }))
}
