//! Curves.

use super::primvars::Primvars;
use super::{Shape, Target};
use crate::curve::{CurveChannel, CurveDice, CurveSet, dice};
use crate::diagnostics::Code;
use crate::dice::DiceError;
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{CurveForm, CurvesDesc, PrimDesc};
use crate::translate::curves::check;
use crate::translate::points::PointKeys;
use crate::translate::primvar::{Count, Counts};
use crate::translate::values::{self, resolve_finite, resolve_widths};

struct Curves {
    set: CurveSet,
    form: CurveForm,
}

impl Shape for Curves {
    fn points(&self) -> &PointKeys {
        &self.set.curves.points
    }

    fn faces_camera(&self) -> bool {
        self.set.normals.is_none() && self.form != CurveForm::Tubes
    }

    fn dice(
        &self,
        path: &str,
        target: &Target<'_>,
        context: &Context<'_>,
        out: &mut PrimObjects,
    ) -> Option<DicedMesh> {
        let most = context.settings.max_micropolygons;
        let input = CurveDice {
            set: &self.set,
            path: target.path,
            metric: target.metric,
            camera: (!target.instanced).then_some(context.camera),
            form: self.form,
            shading_rate: context.settings.shading_rate,
            max_micropolygons: most,
            cancel: context.cancel,
        };
        match dice(&input) {
            Ok(diced) => {
                out.limit_evaluations += diced.evaluations;
                out.segments = out.segments.max(diced.mesh.key_times.len() - 1);
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

/// How many values primvars of curves have.
fn primvar_counts(counts: &values::Counts) -> Counts {
    let varying = Count(counts.varying, "segment ends");
    Counts {
        prim: "curves",
        uniform: Count(counts.uniform, "curves"),
        varying,
        vertex: Count(counts.vertex, "points"),
        face_varying: varying,
        more_is_fine: false,
    }
}

/// Checks curves and their primvars.
pub(super) fn make(
    prim: &PrimDesc,
    desc: &CurvesDesc,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<Box<dyn Shape>> {
    let path = &prim.common.path;
    let curves = check(
        path,
        desc,
        context.shutter,
        context.bends,
        &mut out.warnings,
    )?;
    let counts = curves.counts;
    let primvars = &prim.common.primvars;
    let widths = resolve_widths(path, primvars.get("widths"), &counts, &mut out.warnings);
    let normals = primvars
        .get("normals")
        .and_then(|p| resolve_finite(path, "normals", p, 3, &counts, &mut out.warnings));
    let primvar_counts = primvar_counts(&counts);
    let mut along = Primvars::new(
        &prim.common,
        primvar_counts,
        context.shutter,
        &CurveChannel::spread,
    );
    along.shading(out);
    let channels = along.finish(context, out);
    let set = CurveSet {
        curves,
        widths,
        normals,
        channels,
    };
    Some(Box::new(Curves {
        set,
        form: desc.form.unwrap_or(context.settings.curves),
    }))
}
