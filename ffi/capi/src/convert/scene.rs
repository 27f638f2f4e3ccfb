//! Geometry, transforms and primvars.

use std::slice::from_ref;
use std::sync::Arc;

use glam::{DMat4, Vec3};
use hdtrapeze_core::scene::{
    Axis, CurveBasis, CurveForm, CurveWrap, CurvesDesc, GridsDesc, ImplicitDesc, ImplicitKind,
    NurbsCurvesDesc, NurbsPatchDesc, PointsSamples, Rates, Samples, TransformSamples,
};
use hdtrapeze_core::surface::{
    BoundaryInterpolation, FaceVaryingLinear, Orientation, Scheme, TriangleRule,
};
use hdtrapeze_delegate::AuthoredTopology;
use hdtrapeze_delegate::samples::straight_frame;

use super::{pick, refuse};
use crate::fault::Fault;
use crate::input::{copied, slice, times};
use crate::types::*;

/// Largest rate of a grid.
const LARGEST_RATE: u16 = 16;

fn vec3s(floats: &[f32]) -> Result<Vec<Vec3>, Fault> {
    let (points, _) = floats.as_chunks::<3>();
    copied(points, |&p| Vec3::from_array(p))
}

fn matrices(doubles: &[f64]) -> Result<Vec<DMat4>, Fault> {
    let (matrices, _) = doubles.as_chunks::<16>();
    copied(matrices, DMat4::from_cols_array)
}

/// Safety, here and below: pointers in the struct are null or as the header says.
pub(crate) unsafe fn topology<'a>(from: &trz_topology) -> Result<AuthoredTopology<'a>, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        Ok(AuthoredTopology {
            scheme: pick(
                &[
                    Scheme::CatmullClark,
                    Scheme::Loop,
                    Scheme::Bilinear,
                    Scheme::None,
                ],
                from.scheme,
                "scheme",
            )?,
            boundary: pick(
                &[
                    BoundaryInterpolation::None,
                    BoundaryInterpolation::EdgeOnly,
                    BoundaryInterpolation::EdgeAndCorner,
                ],
                from.boundary,
                "boundary",
            )?,
            face_varying: pick(
                &[
                    FaceVaryingLinear::None,
                    FaceVaryingLinear::CornersOnly,
                    FaceVaryingLinear::CornersPlus1,
                    FaceVaryingLinear::CornersPlus2,
                    FaceVaryingLinear::Boundaries,
                    FaceVaryingLinear::All,
                ],
                from.face_varying,
                "face_varying",
            )?,
            triangles: pick(
                &[TriangleRule::CatmullClark, TriangleRule::Smooth],
                from.triangles,
                "triangles",
            )?,
            orientation: pick(
                &[Orientation::RightHanded, Orientation::LeftHanded],
                from.orientation,
                "orientation",
            )?,
            face_vertex_counts: slice(
                from.face_vertex_counts,
                from.face_count,
                "face_vertex_counts",
            )?,
            face_vertex_indices: slice(
                from.face_vertex_indices,
                from.index_count,
                "face_vertex_indices",
            )?,
            holes: slice(from.holes, from.hole_count, "holes")?,
            crease_indices: slice(
                from.crease_indices,
                from.crease_index_count,
                "crease_indices",
            )?,
            crease_lengths: slice(from.crease_lengths, from.crease_count, "crease_lengths")?,
            crease_sharpnesses: slice(
                from.crease_sharpnesses,
                from.crease_sharpness_count,
                "crease_sharpnesses",
            )?,
            corner_indices: slice(from.corner_indices, from.corner_count, "corner_indices")?,
            corner_sharpnesses: slice(
                from.corner_sharpnesses,
                from.corner_sharpness_count,
                "corner_sharpnesses",
            )?,
        })
    }
}

pub(crate) unsafe fn points(from: &trz_points) -> Result<PointsSamples, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        let points = trz_float_samples {
            times: from.times,
            sample_count: from.sample_count,
            values: from.points,
            counts: from.counts,
        };
        let points = vec3_samples(&points, "points")?;
        Ok(PointsSamples {
            times: points.times,
            points: points.values,
            rates: Rates {
                velocities: vec3_samples(&from.velocities, "velocities")?,
                accelerations: vec3_samples(&from.accelerations, "accelerations")?,
                time_codes_per_second: from.time_codes_per_second,
            },
        })
    }
}

unsafe fn vec3_samples(from: &trz_float_samples, what: &str) -> Result<Samples<Vec3>, Fault> {
    // SAFETY: as the caller promises.
    unsafe { super::instancer::samples(from, what, |p: &[f32; 3]| Vec3::from_array(*p)) }
}

pub(crate) unsafe fn curves(from: &trz_curves) -> Result<CurvesDesc, Fault> {
    let bases = [
        CurveBasis::Linear,
        CurveBasis::Bezier,
        CurveBasis::Bspline,
        CurveBasis::CatmullRom,
        CurveBasis::Hermite,
    ];
    let wraps = [
        CurveWrap::Nonperiodic,
        CurveWrap::Periodic,
        CurveWrap::Pinned,
    ];
    // SAFETY: as the caller promises.
    let counts = unsafe { slice(from.vertex_counts, from.curve_count, "vertex_counts") }?;
    Ok(CurvesDesc {
        basis: pick(&bases, from.basis, "basis")?,
        wrap: pick(&wraps, from.wrap, "wrap")?,
        vertex_counts: Arc::new(copied(counts, |&c| c)?),
        form: curve_form(from.form, "form")?,
        ..CurvesDesc::default()
    })
}

/// `None` stands for TRZ_CURVES_DEFAULT.
pub(super) fn curve_form(number: u32, what: &str) -> Result<Option<CurveForm>, Fault> {
    let forms = [
        None,
        Some(CurveForm::Auto),
        Some(CurveForm::Ribbons),
        Some(CurveForm::Tubes),
    ];
    pick(&forms, number, what)
}

pub(crate) unsafe fn implicit(from: &trz_implicit) -> Result<ImplicitDesc, Fault> {
    let kinds = [
        ImplicitKind::Cube,
        ImplicitKind::Plane,
        ImplicitKind::Sphere,
        ImplicitKind::Cylinder,
        ImplicitKind::Cone,
        ImplicitKind::Capsule,
    ];
    let sides = [Orientation::RightHanded, Orientation::LeftHanded];
    let doubles = times(from.sample_count, 3, "sizes")?;
    // SAFETY: as the caller promises.
    unsafe {
        let (sizes, _) = slice(from.sizes, doubles, "sizes")?.as_chunks::<3>();
        Ok(ImplicitDesc {
            kind: pick(&kinds, from.kind, "kind")?,
            axis: pick(&[Axis::X, Axis::Y, Axis::Z], from.axis, "axis")?,
            orientation: pick(&sides, from.orientation, "orientation")?,
            times: copied(slice(from.times, from.sample_count, "times")?, |&t| t)?,
            sizes: copied(sizes, |&s| s)?,
        })
    }
}

pub(crate) unsafe fn nurbs_curves(from: &trz_nurbs_curves) -> Result<NurbsCurvesDesc, Fault> {
    let ends = times(from.range_count, 2, "ranges")?;
    // SAFETY: as the caller promises.
    unsafe {
        let counts = slice(from.vertex_counts, from.curve_count, "vertex_counts")?;
        let orders = slice(from.orders, from.curve_count, "orders")?;
        let knots = slice(from.knots, from.knot_count, "knots")?;
        let (ranges, _) = slice(from.ranges, ends, "ranges")?.as_chunks::<2>();
        let weights = slice(from.weights, from.weight_count, "weights")?;
        Ok(NurbsCurvesDesc {
            vertex_counts: Arc::new(copied(counts, |&n| n)?),
            orders: Arc::new(copied(orders, |&n| n)?),
            knots: Arc::new(copied(knots, |&x| x)?),
            ranges: Arc::new(copied(ranges, |&r| r)?),
            weights: Arc::new(copied(weights, |&x| x)?),
            form: curve_form(from.form, "form")?,
            ..NurbsCurvesDesc::default()
        })
    }
}

pub(crate) unsafe fn nurbs_patch(from: &trz_nurbs_patch) -> Result<NurbsPatchDesc, Fault> {
    let sides = [Orientation::RightHanded, Orientation::LeftHanded];
    let range = |range: [f64; 2]| (range != [0.0; 2]).then_some(range);
    let doubles = |first, count, what: &str| {
        // SAFETY: as the caller promises.
        let numbers = unsafe { slice(first, count, what) }?;
        Ok::<_, Fault>(Arc::new(copied(numbers, |&x| x)?))
    };
    Ok(NurbsPatchDesc {
        vertex_counts: [from.u_vertex_count, from.v_vertex_count],
        orders: [from.u_order, from.v_order],
        knots: [
            doubles(from.u_knots, from.u_knot_count, "u_knots")?,
            doubles(from.v_knots, from.v_knot_count, "v_knots")?,
        ],
        ranges: [range(from.u_range), range(from.v_range)],
        weights: doubles(from.weights, from.weight_count, "weights")?,
        orientation: pick(&sides, from.orientation, "orientation")?,
        ..NurbsPatchDesc::default()
    })
}

pub(crate) unsafe fn grids(from: &trz_grids) -> Result<GridsDesc, Fault> {
    // SAFETY: as the caller promises.
    unsafe {
        let key_times = slice(from.times, from.key_count, "times")?;
        let rates = slice(from.rates, times(from.grid_count, 2, "rates")?, "rates")?;
        let (rates, _) = rates.as_chunks::<2>();
        let elements = match from.elements.is_null() {
            true => None,
            false => Some(slice(from.elements, from.grid_count, "elements")?),
        };
        let floats = times(from.position_count, 3, "positions")?;
        let positions = slice(from.positions, floats, "positions")?;
        if from.key_count == 0 && from.grid_count > 0 {
            return Err(Fault::invalid("grids need at least one key"));
        }
        let mut expected = 0usize;
        for (grid, &[nu, nv]) in rates.iter().enumerate() {
            if ![nu, nv]
                .iter()
                .all(|rate| (1..=LARGEST_RATE).contains(rate))
            {
                return Err(Fault::invalid(format!(
                    "rates of grid {grid} are {nu} x {nv}, not 1 to {LARGEST_RATE}"
                )));
            }
            let vertices = (usize::from(nu) + 1) * (usize::from(nv) + 1);
            expected = expected.saturating_add(vertices.saturating_mul(from.key_count));
        }
        if expected != from.position_count {
            return Err(Fault::invalid(format!(
                "position_count is {}, but rates and keys add up to {expected}",
                from.position_count
            )));
        }
        let mut grids = copied(rates, |&[nu, nv]| (nu, nv, 0))?;
        for (at, grid) in grids.iter_mut().enumerate() {
            grid.2 = elements.map_or(at as u32, |elements| elements[at]);
        }
        Ok(GridsDesc {
            times: copied(key_times, |&t| t)?,
            grids,
            positions: Arc::new(vec3s(positions)?),
        })
    }
}

pub(crate) unsafe fn transform(
    levels: &[trz_transform_samples],
) -> Result<Vec<TransformSamples>, Fault> {
    let convert = |(i, level): (usize, &trz_transform_samples)| {
        if level.count == 0 {
            return refuse("levels", i, "has no samples");
        }
        let doubles = times(level.count, 16, "matrices")?;
        // SAFETY: as the caller promises.
        let mut samples = unsafe {
            TransformSamples {
                times: copied(slice(level.times, level.count, "times")?, |&t| t)?,
                matrices: matrices(slice(level.matrices, doubles, "matrices")?)?,
                turns: level.turns & 1 != 0,
            }
        };
        let one = |i| from_ref(&samples.matrices[i]);
        if level.turns & 2 != 0
            && let Some(frame) = straight_frame(&samples.times, one)
        {
            samples.times.remove(frame);
            samples.matrices.remove(frame);
            samples.turns = false;
        }
        Ok(samples)
    };
    levels.iter().enumerate().map(convert).collect()
}
