//! Tests of [`super::convert`].

use super::*;
use crate::curve::CurveKind;
use glam::Vec3;
use std::f64::consts::FRAC_1_SQRT_2;

fn desc(counts: &[i32], orders: &[i32], knots: &[f64], points: Vec<Vec3>) -> NurbsCurvesDesc {
    NurbsCurvesDesc {
        vertex_counts: Arc::new(counts.to_vec()),
        orders: Arc::new(orders.to_vec()),
        knots: Arc::new(knots.to_vec()),
        points: PointsSamples {
            times: vec![0.0],
            points: vec![Arc::new(points)],
            ..PointsSamples::default()
        },
        ..NurbsCurvesDesc::default()
    }
}

fn run(
    desc: &NurbsCurvesDesc,
    primvars: &[(&str, PrimvarDesc)],
) -> (Option<Converted>, Vec<Warning>) {
    let primvars = primvars.iter().map(|(n, p)| ((*n).to_owned(), p.clone()));
    let mut warnings = Vec::new();
    let out = convert("/n", desc, &primvars.collect(), &mut warnings);
    (out, warnings)
}

/// Points of the Bezier curves of curve `number`, `n` a segment.
fn trace(curves: &CurvesDesc, number: usize, n: usize) -> Vec<DVec3> {
    let kind = CurveKind {
        basis: curves.basis,
        wrap: curves.wrap,
    };
    let count = |i: usize| curves.vertex_counts[i] as usize;
    let first: usize = (0..number).map(count).sum();
    let points = &curves.points.points[0][first..first + count(number)];
    let mut out = Vec::new();
    for segment in 0..kind.segments(points.len()) {
        let control = kind.control(points.len(), segment, |i| points[i].as_dvec3());
        out.extend((0..n).map(|i| kind.point(&control, i as f64 / n as f64)));
    }
    out
}

/// De Boor's algorithm on points of one curve.
fn boor(knots: &[f64], p: usize, points: &[Vec3], u: f64) -> DVec3 {
    let k = (p..points.len()).rev().find(|&k| knots[k] <= u).unwrap();
    let mut d: Vec<DVec3> = (0..=p).map(|j| points[j + k - p].as_dvec3()).collect();
    for r in 1..=p {
        for j in (r..=p).rev() {
            let low = knots[j + k - p];
            let a = (u - low) / (knots[j + 1 + k - r] - low);
            d[j] = d[j - 1].lerp(d[j], a);
        }
    }
    d[p]
}

fn wiggle(n: usize) -> Vec<Vec3> {
    let point = |i: usize| {
        let x = i as f32;
        Vec3::new(x, (1.7 * x).sin(), (0.3 * x * x).cos())
    };
    (0..n).map(point).collect()
}

#[test]
fn polynomial_curves_up_to_order_four_are_exact() {
    for (order, knots) in [
        (2, vec![0., 0., 1., 2.5, 3., 3.]),
        (3, vec![0., 0., 0., 1., 1., 2., 3., 3., 3.]),
        (4, vec![0., 1., 2., 3., 4., 5., 6., 7., 8., 9.]),
        (4, vec![0., 0., 0., 0., 1., 1., 1., 2., 2., 2., 2.]),
    ] {
        let points = wiggle(knots.len() - order);
        let curve = desc(
            &[points.len() as i32],
            &[order as i32],
            &knots,
            points.clone(),
        );
        let (out, warnings) = run(&curve, &[]);
        assert!(warnings.is_empty());
        let found = trace(&out.unwrap().curves, 0, 10);
        let checked = Knots::new(order as i32, points.len() as i32, &knots, None)
            .unwrap()
            .0;
        assert_eq!(found.len(), 10 * checked.spans().len());
        for (span, found) in checked.spans().iter().zip(found.chunks(10)) {
            for (i, p) in found.iter().enumerate() {
                let u = span.start + (span.end - span.start) * i as f64 / 10.0;
                let want = boor(&knots, order - 1, &points, u);
                assert!((*p - want).length() < 1e-6, "{order} {u} {p} {want}");
            }
        }
    }
}

#[test]
fn circles_and_high_orders_are_close() {
    let w = FRAC_1_SQRT_2;
    let corners = [[1., 0.], [1., 1.], [0., 1.], [-1., 1.], [-1., 0.]];
    let points: Vec<Vec3> = corners
        .map(|[x, y]: [f32; 2]| Vec3::new(x, y, 0.0))
        .to_vec();
    let mut arc = desc(&[5], &[3], &[0., 0., 0., 1., 1., 2., 2., 2.], points);
    arc.weights = Arc::new(vec![1.0, w, 1.0, w, 1.0]);
    let found = trace(&run(&arc, &[]).0.unwrap().curves, 0, 16);
    let worst = found
        .iter()
        .map(|p| (p.length() - 1.0).abs())
        .fold(0.0, f64::max);
    assert!(worst < 2.0e-5, "{worst}");

    let knots = [0., 0., 0., 0., 0., 0., 1., 2., 3., 3., 3., 3., 3., 3.];
    let points = wiggle(8);
    let high = desc(&[8], &[6], &knots, points.clone());
    let found = trace(&run(&high, &[]).0.unwrap().curves, 0, 5);
    assert_eq!(found.len(), 3 * PARTS * 5);
    for (i, p) in found.iter().enumerate() {
        let want = boor(&knots, 5, &points, 3.0 * i as f64 / found.len() as f64);
        assert!((*p - want).length() < 2e-4, "{i} {p} {want}");
    }
}

#[test]
fn corners_stay_and_ends_are_shared() {
    // Order 3 with a double knot: two parabolas that meet in a corner.
    let points = [[0., 0.], [1., 2.], [2., 2.], [3., 2.], [4., 0.]];
    let points = points.map(|[x, y]: [f32; 2]| Vec3::new(x, y, 0.0)).to_vec();
    let corner = desc(&[5], &[3], &[0., 0., 0., 1., 1., 2., 2., 2.], points);
    let out = run(&corner, &[]).0.unwrap().curves;
    assert_eq!(*out.vertex_counts, [7]);
    let p = &out.points.points[0];
    assert_eq!(
        (p[0], p[3], p[6]),
        (Vec3::ZERO, Vec3::new(2., 2., 0.), Vec3::X * 4.0)
    );
    let (before, after) = (p[3] - p[2], p[4] - p[3]);
    assert!(before.normalize().dot(after.normalize()) > 0.9);
    let mut sharp = corner.clone();
    Arc::make_mut(&mut sharp.points.points[0])[3] = Vec3::new(2., 0., 0.);
    let p = run(&sharp, &[]).0.unwrap().curves.points.points[0].clone();
    let (before, after) = (p[3] - p[2], p[4] - p[3]);
    assert!(before.normalize().dot(after.normalize()) < 0.1);
}

#[test]
fn primvars_and_velocities_follow_the_points() {
    let knots = [0., 0., 0., 0., 1., 2., 3., 3., 3., 3.];
    let points = wiggle(12);
    let both = [knots, knots].concat();
    let mut curves = desc(&[6, 6], &[4, 4], &both, points.clone());
    let (v, double) = (points.clone(), |p: &Vec3| *p * 2.0);
    curves.points.rates.velocities = Samples {
        times: vec![0.0],
        values: vec![Arc::new(v.iter().map(double).collect())],
    };
    let primvar =
        |interpolation, width, values| PrimvarDesc::still(interpolation, width, values, vec![]);
    let vertex = primvar(
        Interpolation::Vertex,
        3,
        points.iter().flat_map(|p| p.to_array()).collect(),
    );
    // Four ends of segments each.
    let varying = primvar(
        Interpolation::Varying,
        1,
        (0..8).map(|i| i as f32).collect(),
    );
    let uniform = primvar(Interpolation::Uniform, 1, vec![5.0, 6.0]);
    let (out, warnings) = run(
        &curves,
        &[
            ("displayColor", vertex),
            ("displayOpacity", varying),
            ("widths", uniform),
        ],
    );
    let out = out.unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(*out.curves.vertex_counts, [10, 10]);
    let bezier = &out.curves.points.points[0];
    assert_eq!(bezier.len(), 20);
    let rates = &out.curves.points.rates.velocities.values[0];
    let floats = |name: &str| out.primvars[name].floats_at_frame().unwrap().0;
    let colors = floats("displayColor");
    for (i, p) in bezier.iter().enumerate() {
        assert!((rates[i] - *p * 2.0).length() < 1e-6);
        assert!((Vec3::from_slice(&colors[3 * i..]) - *p).length() < 1e-6);
    }
    assert_eq!(
        floats("displayOpacity"),
        [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    );
    assert_eq!(floats("widths"), [5.0, 6.0]);
}

#[test]
fn curves_that_cannot_be_leave_the_others_their_numbers() {
    let one = [0., 0., 1., 1.];
    let torn = [0., 0., 1., 1., 2., 2.];
    let knots = [&one[..], &[0., 1., 0., 1.], &torn, &one].concat();
    let bad = desc(&[2, 2, 4, 2], &[2, 2, 2, 2], &knots, wiggle(10));
    let (out, warnings) = run(&bad, &[]);
    let out = out.unwrap().curves;
    assert_eq!(*out.vertex_counts, [4, 0, 0, 4]);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0]
            .text
            .starts_with("2 of 4 curves cannot be used (of curve 1, knots")
    );
    assert_eq!(out.points.points[0][4], wiggle(10)[8]);

    let (out, warnings) = run(
        &desc(&[2, 2], &[2, 2], &[one, one].concat(), wiggle(3)),
        &[],
    );
    assert_eq!((*out.unwrap().curves.vertex_counts).clone(), [4, 0]);
    assert_eq!(warnings.len(), 1);
    let (out, warnings) = run(&desc(&[2], &[2], &one, wiggle(3)), &[]);
    assert!(out.is_some() && warnings.len() == 1);
    let (out, warnings) = run(&desc(&[2, i32::MAX], &[2, i32::MAX], &one, wiggle(2)), &[]);
    assert_eq!((*out.unwrap().curves.vertex_counts).clone(), [4, 0]);
    assert_eq!(warnings.len(), 1);
    for weights in [vec![1.0], vec![1.0, -1.0], vec![1.0, f64::NAN]] {
        let mut curve = desc(&[2], &[2], &one, wiggle(2));
        curve.weights = Arc::new(weights);
        let (out, warnings) = run(&curve, &[]);
        assert!(out.is_some() && warnings.len() == 1);
    }
    let (out, warnings) = run(&NurbsCurvesDesc::default(), &[]);
    assert!(out.is_none() && warnings.is_empty());
}
