//! Implicit prims.

use super::surface::dice_surface;
use super::{Shape, Target};
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{ImplicitDesc, PrimDesc};
use crate::shade::{DEFAULT_ALBEDO, PrimShading, Source};
use crate::surface::Orientation;
use crate::translate::implicit::{self, CheckedImplicit};
use crate::translate::points::PointKeys;
use crate::translate::primvar::Resolved;
use crate::translate::values::{self, Counts};

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

/// An implicit prim has no parts of its own.
const ONE_VALUE: Counts = Counts {
    uniform: 1,
    varying: 1,
    vertex: 1,
};

/// Checks the sizes, and primvars of one value.
pub(super) fn make(
    prim: &PrimDesc,
    desc: &ImplicitDesc,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<Box<dyn Shape>> {
    let path = &prim.common.path;
    let checked = implicit::check(path, desc, context.shutter, &mut out.warnings)?;
    let mut source = |name: &str, width: usize| {
        let primvar = prim.common.primvars.get(name)?;
        let warnings = &mut out.warnings;
        let values = values::resolve_finite(path, name, primvar, width, &ONE_VALUE, warnings)?;
        let value = Resolved::Constant(values.floats().to_vec());
        Some(Source::from_resolved(value, width, &mut Vec::new()))
    };
    let color = source("displayColor", 3);
    let opacity = source("displayOpacity", 1);
    out.shading = PrimShading {
        color: color.unwrap_or(Source::Constant(DEFAULT_ALBEDO)),
        opacity: opacity.filter(|o| *o != Source::Constant([1.0; 3])),
    };
    Some(Box::new(Implicit {
        checked,
        orientation: desc.orientation,
    }))
}
