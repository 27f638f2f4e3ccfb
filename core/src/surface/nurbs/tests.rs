//! Tests of [`super::NurbsSurface`].

use super::*;
use std::collections::HashSet;
use std::f64::consts::FRAC_1_SQRT_2;

const CIRCLE_KNOTS: [f64; 12] = [0., 0., 0., 1., 1., 2., 2., 3., 3., 4., 4., 4.];
const ARC_KNOTS: [f64; 8] = [0., 0., 0., 1., 1., 2., 2., 2.];

fn knots(order: i32, knots: &[f64]) -> Knots {
    let points = knots.len() as i32 - order;
    Knots::new(order, points, knots, None).unwrap().0
}

fn patch(u: Knots, v: Knots, points: Vec<Vec3>, weights: Vec<f64>) -> NurbsPatch {
    assert_eq!(points.len(), u.point_count() * v.point_count());
    NurbsPatch {
        knots: [u, v],
        points: vec![points],
        weights,
        usable: Vec::new(),
        orientation: Orientation::RightHanded,
    }
}

/// Nine points about a square with weights that make the unit circle.
fn circle() -> [([f64; 2], f64); 9] {
    let w = FRAC_1_SQRT_2;
    [
        ([1., 0.], 1.),
        ([1., 1.], w),
        ([0., 1.], 1.),
        ([-1., 1.], w),
        ([-1., 0.], 1.),
        ([-1., -1.], w),
        ([0., -1.], 1.),
        ([1., -1.], w),
        ([1., 0.], 1.),
    ]
}

/// The unit sphere: half a circle from pole to pole, turned about z.
fn sphere() -> NurbsPatch {
    let arc = [
        ([0., -1.], 1.),
        ([1., -1.], FRAC_1_SQRT_2),
        ([1., 0.], 1.),
        ([1., 1.], FRAC_1_SQRT_2),
        ([0., 1.], 1.),
    ];
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for ([r, z], wv) in arc {
        for ([x, y], wu) in circle() {
            points.push(DVec3::new(x * r, y * r, z).as_vec3());
            weights.push(wu * wv);
        }
    }
    patch(
        knots(3, &CIRCLE_KNOTS),
        knots(3, &ARC_KNOTS),
        points,
        weights,
    )
}

fn torus() -> NurbsPatch {
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for ([r, z], wv) in circle() {
        for ([x, y], wu) in circle() {
            let r = 3.0 + r;
            points.push(DVec3::new(x * r, y * r, z).as_vec3());
            weights.push(wu * wv);
        }
    }
    let circle = || knots(3, &CIRCLE_KNOTS);
    patch(circle(), circle(), points, weights)
}

/// Numbers without pattern in -1 to 1.
fn noise(n: usize) -> f64 {
    let mut x = (n as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x ^= x >> 29;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^= x >> 32;
    (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A wild rational patch: repeated knots, orders 4 and 3.
fn wild() -> NurbsPatch {
    let u = knots(
        4,
        &[0., 0., 0., 0., 1., 2.5, 2.5, 3., 3., 3., 4., 4., 4., 4.],
    );
    let v = knots(3, &[-1., -0.5, 0., 1., 1.5, 1.5, 2., 3., 3.]);
    let count = u.point_count() * v.point_count();
    let row = u.point_count();
    let point = |i: usize| {
        let (x, y) = ((i % row) as f64, (i / row) as f64);
        let jitter = DVec3::new(noise(3 * i), noise(3 * i + 1), noise(3 * i + 2)) * 0.3;
        (DVec3::new(x, y, 0.0) + jitter).as_vec3()
    };
    let weight = |i: usize| 1.0 + 0.6 * noise(1000 + i);
    patch(
        u,
        v,
        (0..count).map(point).collect(),
        (0..count).map(weight).collect(),
    )
}

/// A basis function straight from its definition.
fn naive(knots: &[f64], i: usize, p: usize, u: f64) -> f64 {
    if p == 0 {
        return f64::from(u8::from(knots[i] <= u && u < knots[i + 1]));
    }
    let part = |top: f64, span: f64, n: f64| if span == 0.0 { 0.0 } else { top / span * n };
    part(
        u - knots[i],
        knots[i + p] - knots[i],
        naive(knots, i, p - 1, u),
    ) + part(
        knots[i + p + 1] - u,
        knots[i + p + 1] - knots[i + 1],
        naive(knots, i + 1, p - 1, u),
    )
}

fn evaluate(surface: &NurbsSurface, face: u32, st: &[Vec2]) -> LimitSamples {
    let mut evaluator = surface.evaluator();
    let mut out = LimitSamples::default();
    evaluator.bind(face);
    evaluator.evaluate(PatchDomain::Whole, st, true, &mut out);
    out
}

fn lattice(n: u32) -> Vec<Vec2> {
    let at = |i: u32| i as f32 / n as f32;
    (0..=n)
        .flat_map(|j| (0..=n).map(move |i| Vec2::new(at(i), at(j))))
        .collect()
}

#[test]
fn points_are_those_of_the_definition_and_normals_their_derivatives() {
    let patch = wild();
    let raw = [
        vec![0., 0., 0., 0., 1., 2.5, 2.5, 3., 3., 3., 4., 4., 4., 4.],
        vec![-1., -0.5, 0., 1., 1.5, 1.5, 2., 3., 3.],
    ];
    let (points, weights) = (patch.points[0].clone(), patch.weights.clone());
    let row = patch.knots[0].point_count();
    let exact = |u: f64, v: f64| {
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for (i, (p, w)) in points.iter().zip(&weights).enumerate() {
            let n = naive(&raw[0], i % row, 3, u) * naive(&raw[1], i / row, 2, v) * w;
            sum += p.as_dvec3() * n;
            total += n;
        }
        sum / total
    };
    let spans = patch.knots.clone().map(|k| k.spans().to_vec());
    let surface = NurbsSurface::new(patch, Vec::new());
    assert_eq!(surface.face_count(), spans[0].len() * spans[1].len());
    for face in 0..surface.face_count() {
        let (u, v) = (
            spans[0][face % spans[0].len()],
            spans[1][face / spans[0].len()],
        );
        let st: Vec<Vec2> = (0..20)
            .map(|i| Inner(noise(50 + 2 * i), noise(51 + 2 * i)).place())
            .collect();
        let out = evaluate(&surface, face as u32, &st);
        for (st, (p, n)) in st.iter().zip(out.positions.iter().zip(&out.normals)) {
            let u = u.start + (u.end - u.start) * f64::from(st.x);
            let v = v.start + (v.end - v.start) * f64::from(st.y);
            let want = exact(u, v);
            assert!((p.as_dvec3() - want).length() < 1e-6, "{face} {p} {want}");
            let h = 1e-6;
            let du = exact(u + h, v) - exact(u - h, v);
            let dv = exact(u, v + h) - exact(u, v - h);
            let normal = du.cross(dv).normalize();
            assert!(
                (n.as_dvec3() - normal).length() < 1e-5,
                "{face} {n} {normal}"
            );
        }
    }
}

/// A point inside the unit square, from numbers in -1 to 1.
struct Inner(f64, f64);

impl Inner {
    fn place(&self) -> Vec2 {
        Vec2::new(self.0 as f32, self.1 as f32) * 0.45 + 0.5
    }
}

#[test]
fn circles_are_exact_and_poles_have_normals() {
    let sphere = NurbsSurface::new(sphere(), Vec::new());
    let torus = NurbsSurface::new(torus(), Vec::new());
    for face in 0..sphere.face_count() as u32 {
        let out = evaluate(&sphere, face, &lattice(8));
        for (p, n) in out.positions.iter().zip(&out.normals) {
            assert!((p.length() - 1.0).abs() < 1.2e-7, "{p}");
            // At a pole it is that of a place beside.
            let most = if p.z.abs() == 1.0 { 1e-3 } else { 1e-6 };
            assert!((*n - *p).length() < most, "{p} {n}");
        }
    }
    for face in 0..torus.face_count() as u32 {
        let out = evaluate(&torus, face, &lattice(8));
        for (p, n) in out.positions.iter().zip(&out.normals) {
            let ring = p.truncate().normalize().extend(0.0) * 3.0;
            assert!(((*p - ring).length() - 1.0).abs() < 1e-6);
            assert!((*n - (*p - ring)).length() < 2e-6, "{p} {n}");
        }
    }
}

#[test]
fn boundaries_that_lie_on_one_another_are_one() {
    let vertices = |surface: &NurbsSurface| {
        let faces = (0..surface.face_count() as u32).map(|f| surface.face_vertices(f).to_vec());
        let faces: Vec<_> = faces.collect();
        let all: HashSet<u32> = faces.iter().flatten().copied().collect();
        let mut edges = HashSet::new();
        for face in &faces {
            for k in 0..4 {
                let (a, b) = (face[k], face[(k + 1) % 4]);
                if a != b {
                    assert!(edges.insert((a, b)), "an edge runs twice the same way");
                }
            }
        }
        let open = edges.iter().filter(|(a, b)| !edges.contains(&(*b, *a)));
        (faces.len(), all.len(), open.count())
    };
    let surface = |patch| NurbsSurface::new(patch, Vec::new());
    // Two bands of four, two poles and four vertices between.
    assert_eq!(vertices(&surface(sphere())), (8, 6, 0));
    assert_eq!(vertices(&surface(torus())), (16, 16, 0));
    assert_eq!(vertices(&surface(wild())), (4 * 3, 5 * 4, 14));
    // One span around and one from pole to pole: cut until edges differ.
    let around = knots(3, &[0., 0., 0., 1., 1., 1.]);
    let corners = |p: [[f32; 3]; 3]| p.map(Vec3::from).to_vec();
    let loop_ = corners([[0., 0., 0.], [1., 1., 0.], [0., 0., 0.]]);
    let tops = loop_.iter().map(|p| *p + Vec3::Z).collect::<Vec<_>>();
    let line = knots(2, &[0., 0., 1., 1.]);
    let points = [loop_.clone(), tops].concat();
    let tube = patch(around.clone(), line.clone(), points, Vec::new());
    assert_eq!(vertices(&surface(tube)), (3, 6, 6));
    let poles = [loop_[0], loop_[0], Vec3::X, Vec3::Y, Vec3::Z, Vec3::Z];
    let lens = patch(line, around, poles.to_vec(), Vec::new());
    assert_eq!(vertices(&surface(lens)), (2, 4, 4));
    // What is together at one key only is not one.
    let mut opens = torus();
    opens
        .points
        .push(opens.points[0].iter().map(|p| *p + Vec3::Z * p.x).collect());
    assert_eq!(vertices(&surface(opens.clone())), (16, 16, 0));
    for row in opens.points[1].chunks_mut(9) {
        row[8].z += 1.0;
    }
    assert_eq!(vertices(&surface(opens)), (16, 20, 8));
}

#[test]
fn torn_patches_and_lost_points_leave_gaps() {
    // Order 2 with a double knot: two strips that do not meet.
    let u = knots(2, &[0., 0., 1., 1., 2., 2.]);
    let v = knots(2, &[0., 0., 1., 1.]);
    let xs = [0., 1., 2., 3.];
    let points = [0.0f32, 1.0].iter();
    let points: Vec<Vec3> = points
        .flat_map(|y| xs.map(|x| Vec3::new(x, *y, 0.0)))
        .collect();
    let mut torn = patch(u, v, points, Vec::new());
    let surface = NurbsSurface::new(torn.clone(), Vec::new());
    assert_eq!(surface.face_count(), 2);
    let (a, b) = (surface.face_vertices(0), surface.face_vertices(1));
    assert!(a.iter().all(|v| !b.contains(v)), "{a:?} {b:?}");
    let ends = |face| evaluate(&surface, face, &[Vec2::ZERO, Vec2::X]).positions;
    assert_eq!(ends(0), [Vec3::ZERO, Vec3::X]);
    assert_eq!(ends(1), [Vec3::X * 2.0, Vec3::X * 3.0]);

    torn.usable = vec![true; 8];
    torn.usable[3] = false;
    let surface = NurbsSurface::new(torn, Vec::new());
    assert!(surface.face_vertices(1).is_empty() && !surface.face_vertices(0).is_empty());
}

#[test]
fn creases_at_repeated_knots_are_sharp_and_orientation_turns_them() {
    let u = knots(3, &[0., 0., 0., 1., 1., 2., 2., 2.]);
    let v = knots(2, &[0., 0., 1., 1.]);
    // A roof: up, and down again.
    let profile = [(0., 0.), (0.5, 0.5), (1., 1.), (1.5, 0.5), (2., 0.)];
    let points: Vec<Vec3> = [0.0f32, 1.0]
        .iter()
        .flat_map(|y| profile.map(|(x, z)| Vec3::new(x, *y, z)))
        .collect();
    let mut roof = patch(u, v, points, Vec::new());
    for sign in [1.0, -1.0] {
        let surface = NurbsSurface::new(roof.clone(), Vec::new());
        let at = |face, s| evaluate(&surface, face, &[Vec2::new(s, 0.5)]);
        let (left, right) = (at(0, 1.0), at(1, 0.0));
        assert_eq!(left.positions, right.positions);
        let slope = Vec3::new(-1.0, 0.0, 1.0).normalize();
        assert!((left.normals[0] - slope * sign).length() < 1e-6);
        assert!((right.normals[0] - slope * sign * Vec3::new(-1.0, 1.0, 1.0)).length() < 1e-6);
        roof.orientation = Orientation::LeftHanded;
    }
}

#[test]
fn channels_follow_points_or_segments() {
    let patch = wild();
    let (row, rows) = (patch.knots[0].point_count(), patch.knots[1].point_count());
    let vertex = Channel {
        kind: ChannelKind::Vertex,
        width: 3,
        values: patch.points[0].iter().flat_map(|p| p.to_array()).collect(),
        indices: Vec::new(),
    };
    let segments = [row - 3, rows - 2];
    let at_ends = (0..=segments[1])
        .flat_map(|j| (0..=segments[0]).map(move |i| (10 * j + i) as f32))
        .collect();
    let varying = Channel {
        kind: ChannelKind::Varying,
        width: 1,
        values: at_ends,
        indices: Vec::new(),
    };
    let spans = patch.knots.clone().map(|k| k.spans().to_vec());
    let surface = NurbsSurface::new(patch, vec![vertex.into(), varying.into()]);
    let mut evaluator = surface.evaluator();
    let st = lattice(3);
    let (mut positions, mut values) = (LimitSamples::default(), Vec::new());
    for face in 0..surface.face_count() {
        evaluator.bind(face as u32);
        evaluator.evaluate(PatchDomain::Whole, &st, false, &mut positions);
        evaluator.evaluate_channel(0, PatchDomain::Whole, &st, &mut values);
        for (p, value) in positions.positions.iter().zip(values.chunks(3)) {
            assert!((*p - Vec3::from_slice(value)).length() < 1e-6);
        }
        evaluator.evaluate_channel(1, PatchDomain::Whole, &st, &mut values);
        // Segments without a length count.
        let i = spans[0][face % 4].knot - 3;
        let j = spans[1][face / 4].knot - 2;
        for (st, value) in st.iter().zip(&values) {
            let want = 10.0 * (j as f32 + st.y) + i as f32 + st.x;
            assert!((want - value).abs() < 1e-4, "{face} {st} {value} {want}");
        }
    }
}
