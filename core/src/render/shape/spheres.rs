//! Spheres.

use super::curves::warn_coarsened;
use super::{Shape, Target};
use crate::diagnostics::{Code, Warning};
use crate::dice::DiceError;
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{PrimDesc, SpheresDesc};
use crate::shade::{DEFAULT_ALBEDO, PrimShading, Source};
use crate::sphere::{SphereDice, SphereSet, dice};
use crate::translate::points::PointKeys;
use crate::translate::spheres::check;
use crate::translate::values::{Counts, Values, resolve_finite, resolve_widths};

struct Spheres(SphereSet);

impl Shape for Spheres {
    fn points(&self) -> &PointKeys {
        &self.0.points
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
                if diced.coarsened {
                    warn_coarsened(path, most, out);
                }
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

/// A primvar to shade with: one value a sphere, or one for all.
fn source(
    prim: &PrimDesc,
    name: &str,
    width: usize,
    counts: &Counts,
    warnings: &mut Vec<Warning>,
) -> Option<Source> {
    let primvar = prim.common.primvars.get(name)?;
    let path = &prim.common.path;
    match resolve_finite(path, name, primvar, width, counts, warnings)? {
        Values::Constant(v) => Some(Source::Constant(match v[..] {
            [x] => [x; 3],
            _ => [v[0], v[1], v[2]],
        })),
        Values::Uniform(values) | Values::Varying(values) | Values::Vertex(values) => {
            Some(Source::Uniform { width, values })
        }
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
    let mut source =
        |name: &str, width: usize| source(prim, name, width, &counts, &mut out.warnings);
    let color = source("displayColor", 3);
    let opacity = source("displayOpacity", 1);
    out.shading = PrimShading {
        color: color.unwrap_or(Source::Constant(DEFAULT_ALBEDO)),
        opacity: opacity.filter(|o| *o != Source::Constant([1.0; 3])),
    };
    Some(Box::new(Spheres(SphereSet {
        points: spheres.points,
        elements: spheres.elements,
        widths,
    })))
}
