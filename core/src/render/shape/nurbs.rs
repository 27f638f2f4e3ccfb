//! NURBS patches, and NURBS curves by way of Bezier curves.

use super::surface::dice_surface;
use super::{Shape, Target, curves};
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{Geometry, NurbsCurvesDesc, NurbsPatchDesc, PrimCommon, PrimDesc};
use crate::shade::{DEFAULT_ALBEDO, PrimShading, Source};
use crate::surface::nurbs::NurbsSurface;
use crate::surface::{ChannelKind, Orientation};
use crate::translate::nurbs::check;
use crate::translate::nurbs_curves::convert;
use crate::translate::points::PointKeys;
use crate::translate::primvar::{ChannelData, Resolved};
use crate::translate::values::{self, Values};

struct Patch {
    surface: NurbsSurface,
    points: PointKeys,
    orientation: Orientation,
}

impl Shape for Patch {
    fn points(&self) -> &PointKeys {
        &self.points
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
        dice_surface(path, &self.surface, target, context, out)
    }
}

/// Checks a patch and makes its surface and shading.
pub(super) fn make(
    prim: &PrimDesc,
    desc: &NurbsPatchDesc,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<Box<dyn Shape>> {
    let path = &prim.common.path;
    let (shutter, bends) = (context.shutter, context.bends);
    let checked = check(path, desc, shutter, bends, &mut out.warnings)?;
    let mut channels = Vec::new();
    let mut source = |name: &str, width: usize| {
        let primvar = prim.common.primvars.get(name)?;
        let (counts, warnings) = (&checked.counts, &mut out.warnings);
        let values = values::resolve_finite(path, name, primvar, width, counts, warnings)?;
        let channel = |kind, values| {
            Resolved::Channel(ChannelData {
                kind,
                width,
                values,
                indices: Vec::new(),
            })
        };
        let resolved = match values {
            Values::Constant(value) | Values::Uniform(value) => Resolved::Constant(value),
            Values::Varying(values) => channel(ChannelKind::Varying, values),
            Values::Vertex(values) => channel(ChannelKind::Vertex, values),
        };
        Some(Source::from_resolved(resolved, width, &mut channels))
    };
    let color = source("displayColor", 3);
    let opacity = source("displayOpacity", 1);
    out.shading = PrimShading {
        color: color.unwrap_or(Source::Constant(DEFAULT_ALBEDO)),
        opacity: opacity.filter(|o| *o != Source::Constant([1.0; 3])),
    };
    Some(Box::new(Patch {
        surface: NurbsSurface::new(checked.patch, channels),
        points: checked.points,
        orientation: desc.orientation,
    }))
}

/// Converts NURBS curves, and goes on as for the curves that they become.
pub(super) fn make_curves(
    prim: &PrimDesc,
    desc: &NurbsCurvesDesc,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<Box<dyn Shape>> {
    let common = &prim.common;
    let converted = convert(&common.path, desc, &common.primvars, &mut out.warnings)?;
    let prim = PrimDesc {
        common: PrimCommon {
            primvars: converted.primvars,
            ..common.clone()
        },
        geometry: Geometry::Curves(converted.curves),
    };
    match &prim.geometry {
        Geometry::Curves(desc) => curves::make(&prim, desc, context, out),
        _ => None,
    }
}
