//! Spheres.

use super::primvars::Primvars;
use super::{Shape, Target};
use crate::diagnostics::Code;
use crate::dice::DiceError;
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{Interpolation, PrimDesc, SpheresDesc};
use crate::sphere::{SphereDice, SphereSet, dice};
use crate::translate::points::PointKeys;
use crate::translate::primvar::{Count, Counts, Resolved, Spread};
use crate::translate::spheres::check;
use crate::translate::values::resolve_widths;

struct Spheres(SphereSet);

impl Shape for Spheres {
    fn points(&self) -> &PointKeys {
        &self.0.points
    }

    fn faces_camera(&self) -> bool {
        true
    }

    fn dice(
        &self,
        path: &str,
        target: &Target<'_>,
        context: &Context<'_>,
        out: &mut PrimObjects,
    ) -> Option<DicedMesh> {
        let most = context.settings.max_micropolygons;
        let input = SphereDice {
            set: &self.0,
            path: target.path,
            metric: target.metric,
            camera: (!target.instanced).then_some(context.camera),
            shading_rate: context.settings.shading_rate,
            max_micropolygons: most,
            cancel: context.cancel,
        };
        match dice(&input) {
            Ok(diced) => {
                out.coarsened |= diced.coarsened;
                Some(diced.mesh)
            }
            Err(DiceError::Cancelled) => None,
            Err(error) => {
                out.drop_prim(path, Code::Budget, &error.to_string());
                None
            }
        }
    }
}

/// One value a sphere, or one for all.
fn spread<C>(resolved: Resolved) -> Spread<C> {
    match resolved.interpolation {
        Interpolation::Constant => resolved.into_constant(),
        _ => Spread::Uniform(resolved.into_items()),
    }
}

/// Checks spheres and their primvars.
pub(super) fn make(
    prim: &PrimDesc,
    desc: &SpheresDesc,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<Box<dyn Shape>> {
    let path = &prim.common.path;
    let spheres = check(
        path,
        desc,
        context.shutter,
        context.bends,
        &mut out.warnings,
    )?;
    let counts = spheres.counts;
    let widths = prim.common.primvars.get("widths");
    let widths = resolve_widths(path, widths, &counts, &mut out.warnings);
    let points = Count(counts.vertex, "points");
    let primvar_counts = Counts {
        prim: "points",
        uniform: points,
        varying: points,
        vertex: points,
        face_varying: points,
        more_is_fine: false,
    };
    let mut primvars = Primvars::new(&prim.common, primvar_counts, context.shutter, &spread);
    primvars.shading(out);
    let _no_channels: Vec<()> = primvars.finish(context, out);
    Some(Box::new(Spheres(SphereSet {
        points: spheres.points,
        elements: spheres.elements,
        widths,
    })))
}
