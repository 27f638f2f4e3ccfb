//! NURBS patches, and NURBS curves by way of Bezier curves.

use super::primvars::Primvars;
use super::surface::dice_surface;
use super::{Shape, Target, curves};
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{
    Geometry, Interpolation, NurbsCurvesDesc, NurbsPatchDesc, PrimCommon, PrimDesc,
};
use crate::surface::nurbs::{NurbsChannel, NurbsSurface};
use crate::surface::{Channel, ChannelKind, LimitSurface, Orientation};
use crate::translate::nurbs::check;
use crate::translate::nurbs_curves::convert;
use crate::translate::points::PointKeys;
use crate::translate::primvar::{Resolved, Spread};

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

    fn surface(&self) -> Option<&dyn LimitSurface> {
        Some(&self.surface)
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

/// Spreads a primvar over a patch.
fn spread(resolved: Resolved) -> Spread<NurbsChannel> {
    let kind = match resolved.interpolation {
        Interpolation::Constant | Interpolation::Uniform => return resolved.into_constant(),
        Interpolation::Varying | Interpolation::FaceVarying => ChannelKind::Varying,
        Interpolation::Vertex => ChannelKind::Vertex,
    };
    Spread::Channel(NurbsChannel {
        nearest: resolved.is_integer,
        channel: Channel {
            kind,
            width: resolved.stride(),
            values: resolved.into_items(),
            indices: Vec::new(),
        },
    })
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
    let mut primvars = Primvars::new(&prim.common, checked.counts, shutter, &spread);
    primvars.shading(out);
    let channels = primvars.finish(context, out);
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
