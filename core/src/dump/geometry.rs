//! The geometry of a prim in a dump: what checking leaves of it, and its points at keys.

use std::collections::BTreeMap;

use glam::Vec3;

use super::text::{Page, array, at, integers, number};
use crate::diagnostics::Warning;
use crate::motion::Shutter;
use crate::scene::{
    CurvesDesc, Geometry, GridsDesc, ImplicitDesc, MeshDesc, NurbsCurvesDesc, NurbsPatchDesc,
    PointsSamples, SubsetDesc,
};
use crate::surface::MeshTopology;
use crate::translate::grids;
use crate::translate::implicit;
use crate::translate::mesh::check;
use crate::translate::nurbs;
use crate::translate::nurbs_curves;
use crate::translate::points::{Bends, PointKeys, point_keys};
use crate::translate::primvar::Counts;
use crate::translate::subsets;

/// Keys of paths that accelerations bend: the text must not depend on how near the camera is.
const BENDS: Bends<'_> = Bends::Samples(3);

/// The word that a prim's lines begin with.
pub(super) fn kind(geometry: &Geometry) -> &'static str {
    match geometry {
        Geometry::Mesh(_) => "mesh",
        Geometry::Grids(_) => "grids",
        Geometry::Implicit(_) => "implicit",
        Geometry::NurbsPatch(_) => "nurbs patch",
        Geometry::NurbsCurves(_) => "nurbs curves",
        Geometry::Curves(_) => "curves",
        Geometry::Spheres(_) => "spheres",
    }
}

/// Writes it, and tells how many values its primvars have, where that is known.
pub(super) fn write(
    page: &mut Page,
    path: &str,
    geometry: &Geometry,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) -> Option<Counts> {
    match geometry {
        Geometry::Mesh(desc) => return mesh(page, path, desc, shutter, warnings),
        Geometry::Grids(desc) => return grids(page, path, desc, shutter, warnings),
        Geometry::Implicit(desc) => return implicit(page, path, desc, shutter, warnings),
        Geometry::NurbsPatch(desc) => return nurbs_patch(page, path, desc, shutter, warnings),
        Geometry::NurbsCurves(desc) => nurbs_curves_as_bezier(page, path, desc, shutter, warnings),
        Geometry::Curves(desc) => curves(page, path, desc, shutter, warnings),
        Geometry::Spheres(desc) => raw_points(page, path, &desc.points, shutter, warnings),
    }
    None
}

fn mesh(
    page: &mut Page,
    path: &str,
    desc: &MeshDesc,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) -> Option<Counts> {
    let Some(mesh) = check(path, desc, shutter, BENDS, warnings) else {
        page.line("nothing to render");
        return None;
    };
    topology(page, &mesh.topology);
    if mesh.elements.len() != mesh.authored_faces {
        page.line(&format!("authored faces kept {}", integers(&mesh.elements)));
    }
    for subset in desc.subsets.iter() {
        write_subset(page, subset);
    }
    let mut faults = Vec::new();
    subsets::check(path, &desc.subsets, mesh.authored_faces, &mut faults);
    let named = |w: Warning| Warning::new(path, w.code, format!("{}: {}", w.prim, w.text));
    warnings.extend(faults.into_iter().map(named));
    points(page, &mesh.points);
    Some(mesh.primvar_counts())
}

fn write_subset(page: &mut Page, subset: &SubsetDesc) {
    let indices: Vec<f64> = subset.indices.iter().map(|&i| i.into()).collect();
    page.line(&format!(
        "subset {} family {:?} {:?}, {} {}",
        subset.path,
        subset.family,
        subset.family_type,
        subset.element.plural(),
        array(&indices, 1)
    ));
}

fn topology(page: &mut Page, topology: &MeshTopology) {
    page.line(&format!("scheme {:?}", topology.scheme));
    page.line(&format!(
        "boundary {:?}, face-varying {:?}, triangles {:?}, {:?}",
        topology.boundary, topology.face_varying, topology.triangles, topology.orientation
    ));
    page.line(&format!(
        "face vertex counts {}",
        integers(&topology.face_vertex_counts)
    ));
    page.line(&format!(
        "face vertex indices {}",
        integers(&topology.face_vertex_indices)
    ));
    if !topology.holes.is_empty() {
        page.line(&format!("holes {}", integers(&topology.holes)));
    }
    for crease in &topology.creases {
        let sharpness: Vec<f64> = crease.sharpness.iter().map(|&s| s.into()).collect();
        page.line(&format!(
            "crease {} sharpness {}",
            integers(&crease.vertices),
            array(&sharpness, 1)
        ));
    }
    for &(vertex, sharpness) in &topology.corners {
        page.line(&format!("corner {vertex} sharpness {}", number(sharpness)));
    }
}

fn grids(
    page: &mut Page,
    path: &str,
    desc: &GridsDesc,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) -> Option<Counts> {
    let Some(checked) = grids::check(path, desc, shutter, warnings) else {
        page.line("nothing to render");
        return None;
    };
    let rates = desc.grids.iter();
    let rates: Vec<f64> = rates
        .flat_map(|&(nu, nv, _)| [nu.into(), nv.into()])
        .collect();
    page.line(&format!("rates {}", array(&rates, 2)));
    points(page, &checked.points);
    Some(checked.primvar_counts())
}

fn implicit(
    page: &mut Page,
    path: &str,
    desc: &ImplicitDesc,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) -> Option<Counts> {
    let Some(checked) = implicit::check(path, desc, shutter, warnings) else {
        page.line("nothing to render");
        return None;
    };
    page.line(&format!(
        "{:?} along {:?}, {:?}",
        desc.kind, desc.axis, desc.orientation
    ));
    for (time, sizes) in checked.points.times.iter().zip(&checked.sizes) {
        let at = at(checked.sizes.len(), *time);
        page.line(&format!("sizes{at}: {}", array(sizes, 3)));
    }
    Some(checked.primvar_counts())
}

/// NURBS curves as the curves that they become.
fn nurbs_curves_as_bezier(
    page: &mut Page,
    path: &str,
    desc: &NurbsCurvesDesc,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) {
    match nurbs_curves::convert(path, desc, &BTreeMap::new(), warnings) {
        Some(converted) => curves(page, path, &converted.curves, shutter, warnings),
        None => page.line("nothing to render"),
    }
}

fn nurbs_patch(
    page: &mut Page,
    path: &str,
    desc: &NurbsPatchDesc,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) -> Option<Counts> {
    let Some(checked) = nurbs::check(path, desc, shutter, BENDS, warnings) else {
        page.line("nothing to render");
        return None;
    };
    for (d, name) in ["u", "v"].into_iter().enumerate() {
        let (count, order) = (desc.vertex_counts[d], desc.orders[d]);
        let knots = array(&desc.knots[d], 1);
        page.line(&format!(
            "{name}: {count} points, order {order}, knots {knots}"
        ));
        if let Some(range) = desc.ranges[d] {
            page.line(&format!("{name} range {}", array(&range, 1)));
        }
    }
    page.line(&format!("{:?}", desc.orientation));
    if !checked.patch.weights.is_empty() {
        page.line(&format!("weights {}", array(&desc.weights, 1)));
    }
    points(page, &checked.points);
    Some(checked.counts)
}

fn curves(
    page: &mut Page,
    path: &str,
    desc: &CurvesDesc,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) {
    page.line(&format!("basis {:?}, wrap {:?}", desc.basis, desc.wrap));
    page.line(&format!("vertex counts {}", integers(&desc.vertex_counts)));
    raw_points(page, path, &desc.points, shutter, warnings);
}

fn raw_points(
    page: &mut Page,
    path: &str,
    samples: &PointsSamples,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) {
    match point_keys(path, samples, 0, shutter, BENDS, warnings) {
        Some(keys) => points(page, &keys),
        None => page.line("nothing to render"),
    }
}

fn points(page: &mut Page, keys: &PointKeys) {
    for (time, points) in keys.times.iter().zip(&keys.points) {
        let text = vectors(points);
        page.line(&format!("points{}: {text}", at(keys.times.len(), *time)));
    }
}

fn vectors(values: &[Vec3]) -> String {
    let floats: Vec<f64> = values
        .iter()
        .flat_map(|v| v.to_array().map(f64::from))
        .collect();
    array(&floats, 3)
}
