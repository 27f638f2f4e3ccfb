//! Curves.

use super::{Shape, Target};
use crate::curve::{CurveChannel, CurveDice, CurveSet, dice};
use crate::diagnostics::{Code, Warning};
use crate::dice::DiceError;
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{CurveForm, CurvesDesc, PrimDesc};
use crate::shade::{DEFAULT_ALBEDO, PrimShading, Source};
use crate::translate::curves::check;
use crate::translate::points::PointKeys;
use crate::translate::values::{Counts, Values, resolve_finite, resolve_widths};

struct Curves {
    set: CurveSet,
    form: CurveForm,
}

impl Shape for Curves {
    fn points(&self) -> &PointKeys {
        &self.set.curves.points
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

pub(super) fn warn_coarsened(path: &str, most: u64, out: &mut PrimObjects) {
    let text = format!(
        "needs more than {most} micropolygons at this shading rate; it is diced more coarsely"
    );
    out.warn(path, Code::Budget, text);
}

/// A primvar to shade with, and its channel where it varies along curves.
pub(super) fn source(
    prim: &PrimDesc,
    name: &str,
    width: usize,
    counts: &Counts,
    channels: &mut Vec<CurveChannel>,
    warnings: &mut Vec<Warning>,
) -> Option<Source> {
    let primvar = prim.common.primvars.get(name)?;
    let path = &prim.common.path;
    let values = resolve_finite(path, name, primvar, width, counts, warnings)?;
    Some(match values {
        Values::Constant(v) => Source::Constant(match v[..] {
            [x] => [x; 3],
            _ => [v[0], v[1], v[2]],
        }),
        Values::Uniform(values) => Source::Uniform { width, values },
        Values::Varying(_) | Values::Vertex(_) => {
            channels.push(CurveChannel { width, values });
            Source::Channel(channels.len() - 1)
        }
    })
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
    let mut channels = Vec::new();
    let mut source = |name: &str, width: usize| {
        source(prim, name, width, &counts, &mut channels, &mut out.warnings)
    };
    let color = source("displayColor", 3);
    let opacity = source("displayOpacity", 1);
    out.shading = PrimShading {
        color: color.unwrap_or(Source::Constant(DEFAULT_ALBEDO)),
        opacity: opacity.filter(|o| *o != Source::Constant([1.0; 3])),
    };
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
