//! One prim of a dump.

use super::instancer::write_part_of;
use super::text::{Page, array, at, integers, number, whole_array};
use super::{geometry, write_motion, write_transform, write_warnings};
use crate::motion::Shutter;
use crate::scene::{Interpolation, PrimCommon, PrimDesc, PrimvarDesc, PrimvarValues, Scene};
use crate::translate::blur::prim_shutter;
use crate::translate::primvar::{Resolved, join, resolve};

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
        let counts = geometry::write(page, &common.path, &prim.geometry, shutter, &mut warnings);
        write_transform(page, &common.transform, shutter);
        for (name, primvar) in &common.primvars {
            match &counts {
                Some(counts) => {
                    let path = &common.path;
                    let resolved = resolve(path, name, primvar, counts, shutter, &mut warnings);
                    if let Some(resolved) = resolved {
                        write_resolved(page, name, &resolved);
                    }
                }
                None => write_raw(page, name, primvar),
            }
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

fn title(name: &str, interpolation: Interpolation) -> String {
    let interpolation = match interpolation {
        Interpolation::Constant => "constant",
        Interpolation::Uniform => "uniform",
        Interpolation::Varying => "varying",
        Interpolation::Vertex => "vertex",
        Interpolation::FaceVarying => "faceVarying",
    };
    format!("primvar {name} {interpolation}")
}

/// A primvar at its keys.
pub(super) fn write_resolved(page: &mut Page, name: &str, primvar: &Resolved) {
    let (lanes, stride) = (primvar.lanes(), primvar.stride());
    for (key, time) in primvar.key_times.iter().enumerate() {
        let values = primvar.values.chunks_exact(stride);
        let numbers: Vec<f64> = values
            .flat_map(|value| &value[key * lanes..][..lanes])
            .map(|&v| v.into())
            .collect();
        let time = at(primvar.key_times.len(), *time);
        let text = match primvar.is_integer {
            true => {
                let pairs = numbers.as_chunks().0.iter();
                let whole: Vec<f64> = pairs.map(|pair| whole(pair, primvar.is_unsigned)).collect();
                whole_array(&whole, primvar.width)
            }
            false => array(&numbers, primvar.width),
        };
        page.line(&format!(
            "{}{time} {text}",
            title(name, primvar.interpolation)
        ));
    }
    if !primvar.indices.is_empty() {
        page.line(&format!("indices {}", integers(&primvar.indices)));
    }
}

fn whole(&[upper, lower]: &[f64; 2], is_unsigned: bool) -> f64 {
    signed(join([upper as f32, lower as f32]), is_unsigned)
}

/// A whole number, of which unsigned ones have the bits only.
fn signed(number: i32, is_unsigned: bool) -> f64 {
    match is_unsigned {
        true => number.cast_unsigned().into(),
        false => number.into(),
    }
}

/// A primvar as it was given.
fn write_raw(page: &mut Page, name: &str, primvar: &PrimvarDesc) {
    let width = primvar.width * usize::try_from(primvar.element_size).unwrap_or(0);
    for sample in &primvar.samples {
        let text = match &*sample.values {
            PrimvarValues::Float(values) => {
                let numbers: Vec<f64> = values.iter().map(|&v| v.into()).collect();
                array(&numbers, width)
            }
            PrimvarValues::Int(values) => {
                let numbers = values.iter().map(|&v| signed(v, primvar.is_unsigned));
                whole_array(&numbers.collect::<Vec<f64>>(), width)
            }
        };
        let time = match primvar.samples.len() {
            1 => String::new(),
            _ => format!(" at time code {}", number(sample.time)),
        };
        page.line(&format!(
            "{}{time} {text}",
            title(name, primvar.interpolation)
        ));
        if !sample.indices.is_empty() {
            page.line(&format!("indices {}", integers(&sample.indices)));
        }
    }
}
