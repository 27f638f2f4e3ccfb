//! One prim of a dump.

use super::text::{Page, array, integers, matrix, number};
use super::{geometry, write_warnings};
use crate::motion::{Hierarchy, Shutter};
use crate::scene::{Interpolation, PrimCommon, PrimDesc, PrimvarDesc};
use crate::translate::blur::prim_shutter;

pub(super) fn write(page: &mut Page, prim: &PrimDesc, shutter: Shutter) {
    let common = &prim.common;
    page.line(&format!(
        "{} {}",
        geometry::kind(&prim.geometry),
        common.path
    ));
    page.indented(|page| {
        let mut warnings = Vec::new();
        flags(page, common);
        let shutter = prim_shutter(&common.path, common.blur_scale, shutter, &mut warnings);
        geometry::write(page, &common.path, &prim.geometry, shutter, &mut warnings);
        transform(page, common, shutter);
        for (name, primvar) in &common.primvars {
            write_primvar(page, name, primvar);
        }
        write_warnings(page, &warnings);
    });
}

fn flags(page: &mut Page, common: &PrimCommon) {
    if !common.visible {
        page.line("invisible");
    }
    if common.matte {
        page.line("matte");
    }
    if common.double_sided {
        page.line("double sided");
    }
    if common.blur_scale != 1.0 {
        page.line(&format!("blur scale {}", number(common.blur_scale)));
    }
    if let Some(count) = common.nonlinear_samples {
        page.line(&format!("nonlinear samples {count}"));
    }
}

/// Matrices at the keys of the prim's own samples, all levels multiplied.
fn transform(page: &mut Page, common: &PrimCommon, shutter: Shutter) {
    match Hierarchy::new(&common.transform, shutter) {
        Ok(hierarchy) => {
            for time in hierarchy.key_times() {
                let text = matrix(&hierarchy.matrix(time));
                page.line(&format!("transform at {}: {text}", number(time)));
            }
        }
        Err(error) => page.line(&format!("transform: {error}")),
    }
}

fn write_primvar(page: &mut Page, name: &str, primvar: &PrimvarDesc) {
    let values: Vec<f64> = primvar.values.iter().map(|&v| v.into()).collect();
    let interpolation = match primvar.interpolation {
        Interpolation::Constant => "constant",
        Interpolation::Uniform => "uniform",
        Interpolation::Varying => "varying",
        Interpolation::Vertex => "vertex",
        Interpolation::FaceVarying => "faceVarying",
    };
    page.line(&format!(
        "primvar {name} {interpolation} {}",
        array(&values, primvar.width)
    ));
    if !primvar.indices.is_empty() {
        page.line(&format!("indices {}", integers(&primvar.indices)));
    }
}
