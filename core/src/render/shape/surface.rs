//! Dices any limit surface.

use super::Target;
use crate::diagnostics::Code;
use crate::dice::{DiceError, DiceInput, dice};
use crate::grid::DicedMesh;
use crate::render::objects::{Context, PrimObjects};
use crate::surface::LimitSurface;

/// Grids of `surface`, whose elements are the surface's own faces. `None`, with a warning unless it
/// was cancelled, where it cannot be diced.
pub(super) fn dice_surface(
    path: &str,
    surface: &dyn LimitSurface,
    target: &Target<'_>,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<DicedMesh> {
    let most = context.settings.most_micropolygons(surface.face_count());
    let input = DiceInput {
        surface,
        path: target.path,
        metric: target.metric,
        shading_rate: context.settings.shading_rate,
        // Facets need none: the tracer has the triangle at the ray's own time.
        with_normals: !surface.is_polygonal(),
        polygons_coarse: true,
        max_micropolygons: most,
        cancel: context.cancel,
    };
    let output = match dice(&input) {
        Ok(output) => output,
        Err(DiceError::Cancelled) => return None,
        Err(error) => {
            out.drop_prim(path, Code::Budget, &error.to_string());
            return None;
        }
    };
    out.limit_evaluations += output.limit_evaluations;
    out.coarsened |= output.coarsened;
    if output.dropped_faces > 0 {
        let text = format!(
            "{} faces have a limit surface that is not finite; dropped",
            output.dropped_faces
        );
        out.warn(path, Code::NotFinite, text);
    }
    Some(output.mesh)
}
