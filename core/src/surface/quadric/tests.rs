//! Tests of [`super::QuadricSurface`].

use super::*;
use glam::{DVec2, Vec3};

fn all() -> Vec<(&'static str, QuadricSurface)> {
    let revolved = |profiles| QuadricSurface::revolved(profiles, Axis::Z, false, RIGHT);
    vec![
        ("sphere", QuadricSurface::sphere(vec![1.5], RIGHT)),
        ("cylinder", revolved(vec![Profile::cylinder(3.0, 1.2, 1.2)])),
        ("tapered", revolved(vec![Profile::cylinder(3.0, 0.4, 2.0)])),
        ("cone", revolved(vec![Profile::cone(2.5, 0.8)])),
        ("capsule", revolved(vec![Profile::capsule(2.0, 0.7, 0.7)])),
        ("drop", revolved(vec![Profile::capsule(2.0, 1.4, 0.3)])),
        ("hat", revolved(vec![Profile::capsule(1.0, 0.3, 1.2)])),
        ("tip", revolved(vec![Profile::capsule(2.0, 0.8, 0.0)])),
    ]
}

const RIGHT: Orientation = Orientation::RightHanded;

/// Signed distance to the surface, exact near it but for rims, from the definition alone.
fn distance(name: &str, p: DVec3) -> f64 {
    let q = DVec2::new(p.truncate().length(), p.z);
    let side = |r0: f64, z0: f64, r1: f64, z1: f64| {
        let along = DVec2::new(r1 - r0, z1 - z0).normalize();
        (q - DVec2::new(r0, z0)).dot(-along.perp())
    };
    let frustum =
        |h: f64, r0: f64, r1: f64| side(r0, -0.5 * h, r1, 0.5 * h).max(q.y.abs() - 0.5 * h);
    // The hull of the spheres that touch the side at its ends.
    let hull = |h: f64, a: f64, b: f64| {
        let lean = ((a - b) / h).atan();
        let ball = |r: f64, z: f64| (DVec2::new(0.0, z - r * lean.tan()), r / lean.cos());
        let ((c0, r0), (c1, r1)) = (ball(a, -0.5 * h), ball(b, 0.5 * h));
        let at = |f: f64| (q - c0.lerp(c1, f)).length() - (r0 + (r1 - r0) * f);
        let (mut low, mut high) = (0.0f64, 1.0f64);
        for _ in 0..200 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if at(a) < at(b) { high = b } else { low = a }
        }
        at(0.0).min(at(1.0)).min(at(0.5 * (low + high)))
    };
    match name {
        "sphere" => p.length() - 1.5,
        "cylinder" => frustum(3.0, 1.2, 1.2),
        "tapered" => frustum(3.0, 0.4, 2.0),
        "cone" => frustum(2.5, 0.8, 0.0),
        "capsule" => hull(2.0, 0.7, 0.7),
        "drop" => hull(2.0, 1.4, 0.3),
        "hat" => hull(1.0, 0.3, 1.2),
        _ => hull(2.0, 0.8, 0.0),
    }
}

fn evaluate(surface: &QuadricSurface, face: u32, st: &[Vec2]) -> LimitSamples {
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
fn points_lie_on_the_surface_and_normals_are_its_gradient() {
    for (name, surface) in all() {
        let mut worst = 0.0f64;
        for face in 0..surface.face_count() as u32 {
            let st = lattice(9);
            let out = evaluate(&surface, face, &st);
            for (i, (p, n)) in out.positions.iter().zip(&out.normals).enumerate() {
                let (p, n) = (p.as_dvec3(), n.as_dvec3());
                worst = worst.max(distance(name, p).abs());
                assert!((n.length() - 1.0).abs() < 1e-6);
                let inner = st[i].min_element() > 0.0 && st[i].max_element() < 1.0;
                // The upper dome of the tip has no area.
                let exists = name != "tip" || face < 9;
                if inner && exists {
                    let h = 1e-6;
                    let slope = |e: DVec3| {
                        (distance(name, p + e * h) - distance(name, p - e * h)) / (2.0 * h)
                    };
                    let gradient = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
                    assert!(
                        (gradient - n).length() < 1e-5,
                        "{name} {face} {p} {n} {gradient}"
                    );
                }
            }
        }
        println!("{name}: {worst}");
        // Half a unit in the last place of each coordinate, of numbers up to 4.
        assert!(
            worst < 3f64.sqrt() * 0.5 * 2f64.powi(-22),
            "{name}: {worst}"
        );
    }
}

#[test]
fn faces_meet_with_the_same_parameter_and_look_outward() {
    for (name, surface) in all() {
        let mut corners = std::collections::HashMap::<u32, Vec3>::new();
        let mut edges = std::collections::HashMap::<(u32, u32), Vec<Vec3>>::new();
        for face in 0..surface.face_count() as u32 {
            let vertices = surface.face_vertices(face);
            let square = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
            for k in 0..4 {
                let (a, b) = (vertices[k], vertices[(k + 1) % 4]);
                let line: Vec<Vec2> = (0..=8)
                    .map(|i| square[k].lerp(square[(k + 1) % 4], i as f32 / 8.0))
                    .collect();
                let mut points = evaluate(&surface, face, &line).positions;
                let corner = *corners.entry(a).or_insert(points[0]);
                assert!((corner - points[0]).length() < 1e-6, "{name} {face} {k}");
                if a > b {
                    points.reverse();
                }
                match edges.remove(&(a.min(b), a.max(b))) {
                    Some(other) => {
                        for (p, q) in points.iter().zip(&other) {
                            assert!((*p - *q).length() < 1e-6, "{name} {face} {k}: {p} {q}");
                        }
                    }
                    None => drop(edges.insert((a.min(b), a.max(b)), points)),
                }
            }
            let h = 1.0 / 1024.0;
            let st = [
                Vec2::splat(0.5),
                Vec2::new(0.5 + h, 0.5),
                Vec2::new(0.5, 0.5 + h),
            ];
            let out = evaluate(&surface, face, &st);
            let p = &out.positions;
            let across = (p[1] - p[0]).cross(p[2] - p[0]);
            assert!(across.dot(out.normals[0]) >= 0.0, "{name} {face}");
        }
        // Of a cone's side the tip is left, a loop of edges without length.
        let open = if name == "cone" { 4 } else { 0 };
        assert_eq!(edges.len(), open, "{name}");
    }
}

#[test]
fn cells_of_a_face_are_of_about_one_size() {
    for (name, most) in [("sphere", 1.4), ("cylinder", 3.3), ("capsule", 2.5)] {
        let (_, surface) = all().into_iter().find(|(n, _)| *n == name).unwrap();
        for face in 0..surface.face_count() as u32 {
            let p = evaluate(&surface, face, &lattice(16)).positions;
            let areas: Vec<f32> = (0..16 * 16)
                .map(|i| {
                    let v = i / 16 * 17 + i % 16;
                    (p[v + 18] - p[v]).cross(p[v + 17] - p[v + 1]).length()
                })
                .collect();
            let (low, high) = areas.iter().fold((f32::MAX, 0.0f32), |(low, high), &a| {
                (low.min(a), high.max(a))
            });
            println!("{name} {face}: {}", high / low);
            assert!(high / low < most, "{name} {face}: {}", high / low);
        }
    }
}

#[test]
fn axes_turn_and_orientation_turns_normals() {
    for (axis, tip) in [(Axis::X, Vec3::X), (Axis::Y, Vec3::Y), (Axis::Z, Vec3::Z)] {
        for (reversed, orientation) in [
            (false, RIGHT),
            (true, RIGHT),
            (false, Orientation::LeftHanded),
        ] {
            let cone = vec![Profile::cone(2.0, 0.5)];
            let cone = QuadricSurface::revolved(cone, axis, reversed, orientation);
            let up = if reversed { -tip } else { tip };
            assert_eq!(evaluate(&cone, 0, &[Vec2::ONE]).positions[0], up);
            let base = evaluate(&cone, 8, &[Vec2::splat(0.5)]);
            assert_eq!(base.positions[0], -up);
            let outside = if orientation == RIGHT { -up } else { up };
            assert_eq!(base.normals[0], outside);
        }
    }
}

#[test]
fn keys_are_their_own_sizes() {
    let surface = QuadricSurface::sphere(vec![1.0, 3.0], RIGHT);
    let out = evaluate(&surface, 4, &[Vec2::splat(0.5), Vec2::ZERO]);
    assert_eq!(out.positions[0], Vec3::Z);
    assert_eq!(out.positions[2], Vec3::Z * 3.0);
    assert!((out.positions[3] - out.positions[1] * 3.0).length() < 1e-6);
    assert_eq!(out.normals[1], out.normals[3]);
}
