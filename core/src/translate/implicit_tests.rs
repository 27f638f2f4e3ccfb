//! Tests of [`super::check`].

use super::*;
use crate::surface::LimitSamples;
use glam::Vec2;

const SHUTTER: Shutter = Shutter {
    open: 0.0,
    close: 1.0,
};

fn desc(kind: ImplicitKind, sizes: &[[f64; 3]]) -> ImplicitDesc {
    ImplicitDesc {
        kind,
        times: (0..sizes.len()).map(|i| i as f64).collect(),
        sizes: sizes.to_vec(),
        ..ImplicitDesc::default()
    }
}

fn run(desc: &ImplicitDesc) -> (Option<CheckedImplicit>, Vec<Warning>) {
    let mut warnings = Vec::new();
    let out = check("/i", desc, SHUTTER, &mut warnings);
    (out, warnings)
}

fn bounds(checked: &CheckedImplicit, key: usize) -> (Vec3, Vec3) {
    let points = &checked.points.points[key];
    let fold = |f: fn(Vec3, Vec3) -> Vec3| points.iter().copied().reduce(f).unwrap();
    (fold(Vec3::min), fold(Vec3::max))
}

/// Bounds of what the surface evaluates to.
fn surface_bounds(checked: &CheckedImplicit, key: usize) -> (Vec3, Vec3) {
    let n = 16;
    let st: Vec<Vec2> = (0..=n * n + 2 * n)
        .map(|i| Vec2::new((i % (n + 1)) as f32, (i / (n + 1)) as f32) / n as f32)
        .collect();
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let mut evaluator = checked.surface.evaluator();
    let mut out = LimitSamples::default();
    for face in 0..checked.surface.face_count() as u32 {
        evaluator.bind(face);
        evaluator.evaluate(crate::surface::PatchDomain::Whole, &st, false, &mut out);
        for p in &out.positions[key * st.len()..][..st.len()] {
            (low, high) = (low.min(*p), high.max(*p));
        }
    }
    (low, high)
}

#[test]
fn points_bound_the_surface_tightly_along_every_axis() {
    for (kind, sizes) in [
        (ImplicitKind::Cube, [1.5, 0.0, 0.0]),
        (ImplicitKind::Plane, [2.0, 3.0, 0.0]),
        (ImplicitKind::Sphere, [0.7, 0.0, 0.0]),
        (ImplicitKind::Cylinder, [2.0, 0.5, 1.5]),
        (ImplicitKind::Cone, [2.0, 0.5, 0.0]),
        (ImplicitKind::Capsule, [2.0, 1.0, 0.25]),
        (ImplicitKind::Capsule, [0.5, 0.25, 1.0]),
    ] {
        for axis in [Axis::X, Axis::Y, Axis::Z] {
            let desc = ImplicitDesc {
                axis,
                ..desc(kind, &[sizes])
            };
            let checked = run(&desc).0.unwrap();
            let (a, b) = (bounds(&checked, 0), surface_bounds(&checked, 0));
            // Lattices of tilted domes do not visit their equators.
            let room = (b.0 - a.0).min(a.1 - b.1);
            assert!(room.min_element() > -1e-6, "{kind:?} {axis:?} {a:?} {b:?}");
            let loose = (b.0 - a.0).max(a.1 - b.1).max_element();
            assert!(loose < 1e-2, "{kind:?} {axis:?} {a:?} {b:?}");
        }
    }
}

#[test]
fn width_and_length_of_a_plane_follow_usd() {
    for (axis, extent) in [
        (Axis::X, Vec3::new(0.0, 3.0, 2.0)),
        (Axis::Y, Vec3::new(2.0, 0.0, 3.0)),
        (Axis::Z, Vec3::new(2.0, 3.0, 0.0)),
    ] {
        let desc = ImplicitDesc {
            axis,
            ..desc(ImplicitKind::Plane, &[[2.0, 3.0, 0.0]])
        };
        let (low, high) = bounds(&run(&desc).0.unwrap(), 0);
        assert_eq!(high - low, extent);
    }
}

#[test]
fn bad_sizes_give_one_warning() {
    for (sizes, kept, count) in [
        ([[f64::NAN, 1.0, 1.0]; 2], false, 1),
        ([[1.0, f64::INFINITY, 1.0]; 2], false, 1),
        ([[1.0, 1.0e13, 1.0]; 2], false, 1),
        ([[1.0, -1.0, -2.0]; 2], true, 1),
        ([[-1.0, 1.0, 2.0]; 2], true, 1),
        ([[1.0, 0.0, 0.0]; 2], false, 0),
        ([[0.0, 1.0, 0.0]; 2], true, 0),
        ([[0.0; 3], [1.0; 3]], true, 0),
        ([[0.0, 1.0, 2.0]; 2], true, 0),
    ] {
        for kind in [ImplicitKind::Cylinder, ImplicitKind::Capsule] {
            let (out, warnings) = run(&desc(kind, &sizes));
            assert_eq!(out.is_some(), kept, "{kind:?} {sizes:?}");
            assert_eq!(warnings.len(), count, "{kind:?} {sizes:?} {warnings:?}");
        }
    }
    let (out, warnings) = run(&desc(ImplicitKind::Capsule, &[[1.0e-13, 1.0, 2.0]]));
    assert!(out.is_none() && warnings.len() == 1);
    // What a kind does not have is not looked at.
    let (out, warnings) = run(&desc(ImplicitKind::Sphere, &[[1.0, f64::NAN, -1.0]]));
    assert!(out.is_some() && warnings.is_empty());
    let never = ImplicitDesc {
        times: vec![f64::NAN],
        ..desc(ImplicitKind::Sphere, &[[1.0; 3]])
    };
    let (out, warnings) = run(&never);
    assert!(out.is_none() && warnings[0].code == Code::TimeSamples);
    assert!(run(&ImplicitDesc::default()).0.is_none());
}

#[test]
fn a_negative_height_turns_what_tapers() {
    let tip = |height: f64| {
        let checked = run(&desc(ImplicitKind::Cone, &[[height, 1.0, 0.0]]))
            .0
            .unwrap();
        let mut out = LimitSamples::default();
        let mut evaluator = checked.surface.evaluator();
        evaluator.bind(0);
        evaluator.evaluate(
            crate::surface::PatchDomain::Whole,
            &[Vec2::ONE],
            true,
            &mut out,
        );
        out.positions[0]
    };
    assert_eq!(tip(2.0), Vec3::Z);
    assert_eq!(tip(-2.0), -Vec3::Z);
}

#[test]
fn keys_follow_sizes() {
    let still = run(&desc(ImplicitKind::Sphere, &[[1.0; 3]; 3])).0.unwrap();
    assert_eq!(still.points.times, [0.0]);
    let mut grows = desc(ImplicitKind::Sphere, &[[1.0; 3], [3.0; 3]]);
    grows.times = vec![-1.0, 3.0];
    let grows = run(&grows).0.unwrap();
    assert_eq!(grows.points.times, [0.0, 1.0]);
    assert_eq!(bounds(&grows, 0).1, Vec3::splat(1.5));
    assert_eq!(bounds(&grows, 1).1, Vec3::splat(2.0));
    assert_eq!(grows.surface.key_count(), 2);
}

#[test]
fn a_capsule_whose_side_leans_gets_keys_until_chords_are_close() {
    let even = run(&desc(
        ImplicitKind::Capsule,
        &[[2.0, 0.5, 0.5], [3.0, 1.0, 1.0]],
    ));
    assert_eq!(even.0.unwrap().points.times.len(), 2);
    let leans = desc(ImplicitKind::Capsule, &[[2.0, 0.5, 0.5], [2.0, 1.5, 0.5]]);
    let checked = run(&leans).0.unwrap();
    let times = &checked.points.times;
    assert!((5..=33).contains(&times.len()), "{}", times.len());
    let sizes = |t: f64| [2.0, 0.5 + t, 0.5];
    for w in times.windows(2) {
        let [a, b] = [w[0], w[1]].map(f64::from);
        let probe = |t: f64| Profile::capsule(sizes(t)[0], sizes(t)[1], sizes(t)[2]).probes();
        for i in 1..8 {
            let f = f64::from(i) / 8.0;
            let chord = probe(a)
                .into_iter()
                .zip(probe(b))
                .map(|(a, b)| a.lerp(b, f));
            for (p, q) in chord.zip(probe(a + (b - a) * f)) {
                assert!((p - q).length() < 1.01 * CURVE_TOLERANCE * 2.0);
            }
        }
    }
}
