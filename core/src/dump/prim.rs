//! One prim of a dump.

use super::instancer::write_part_of;
use super::text::{Page, array, integers};
use super::{geometry, write_motion, write_transform, write_warnings};
use crate::motion::Shutter;
use crate::scene::{Interpolation, PrimCommon, PrimDesc, PrimvarDesc, Scene};
use crate::translate::blur::prim_shutter;

pub(super) fn write(page: &mut Page, prim: &PrimDesc, scene: &Scene, shutter: Shutter) {
    let common = &prim.common;
    page.line(&format!(
        "{} {}",
        geometry::kind(&prim.geometry),
        common.path
    ));
    page.indented(|page| {
        let mut warnings = Vec::new();
        flags(page, common);
        write_part_of(page, common.instancer, scene);
        let shutter = prim_shutter(&common.path, common.blur_scale, shutter, &mut warnings);
        geometry::write(page, &common.path, &prim.geometry, shutter, &mut warnings);
        write_transform(page, &common.transform, shutter);
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
    write_motion(page, common.blur_scale, common.nonlinear_samples);
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
